"""Pairs on which the campaign of random gears found something wrong: all its checks hold on them now."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfe.contact.laws import ContactLaw, Exact, Nitsche, Penalty
from gearfe.contact.solver import solve_on_whole_windows, solve_positions
from gearfe.errors import InputError
from gearfe.gear.touching import Flanks
from gearfe.stiffness.job import read_stiffness_job
from gearfe.stiffness.sweep import elastic_pair, sweep_stiffness
from gearfe.stress.campaign import Case
from gearfe.stress.gears import run

from .gears import pair

KEPT = sorted((Path(__file__).parent / "test_stress_cases" / "gears").glob("*.toml"))


@pytest.mark.parametrize("path", KEPT, ids=lambda p: p.stem)
def test_kept_cases(path: Path, tmp_path: Path) -> None:
    found = run(Case(0, "kept", {"job.toml": path.read_text(encoding="utf-8")}, "gearfe stiffness job.toml"), tmp_path)
    assert found.outcome == "done"
    assert {c.name for c in found.checks} >= {"tangent", "swap", "period"}
    assert [c for c in found.checks if not c.share <= 1.0] == []


@pytest.mark.parametrize("law", [Nitsche(), Penalty(), Exact()], ids=lambda law: law.name)
@pytest.mark.parametrize(("cycles", "factor"), [(0.0, 1.0), (-0.035, 1.0), (-0.08, 0.5), (0.03, 1.5)])
def test_a_tip_that_lies_along_a_root_bears_wherever_it_does_on_larger_windows(
    law: ContactLaw, cycles: float, factor: float
) -> None:
    """The overlap is nearly as deep at its far end as at the deepest point: nothing is narrowed there."""
    job = read_stiffness_job(Path(__file__).parent / "test_stress_cases" / "gears" / "tip_along_a_root.toml")
    elastic = elastic_pair(job.pair, **{**job.model, "law": law})
    angle = job.sweep["angles"][2:3] + cycles * job.pair.mesh_cycle
    twist = Flanks(job.pair).touching(angle).twist.min(keepdims=True) + factor * job.sweep["twist"]
    (position,) = solve_positions(elastic, angle, twist)
    whole = solve_on_whole_windows(elastic, float(angle[0]), float(twist[0]))
    assert position.status == whole.status == "converged"
    assert position.torque_wheel == pytest.approx(whole.torque_wheel, rel=1e-9)


def test_roots_are_where_flanks_are_hollow() -> None:
    """Up to the form circle (ISO 21771), where the involute starts."""
    gears = pair(20, 30)
    for body, gear in zip(elastic_pair(gears, law="nitsche").bodies, (gears.pinion, gears.wheel), strict=True):
        radii = np.linalg.norm(body.flank.points[::2], axis=1)
        form = float(np.linalg.norm(gear.profile.flank.point(np.array(0.0))))
        below, above = radii[body.flank.root - 1], radii[body.flank.root]
        assert 0 < body.flank.root < 0.2 * body.flank.edges
        assert below < form <= above * (1 + 1e-9)


def test_a_torque_beyond_small_strain_is_refused() -> None:
    job = read_stiffness_job(Path(__file__).parent / "test_stress_cases" / "gears" / "bent_teeth.toml")
    elastic = elastic_pair(job.pair, coarsen=5.0)
    with pytest.raises(InputError, match="modules"):
        sweep_stiffness(job.pair, torque=3e4, angles=[0.1], elastic=elastic)
