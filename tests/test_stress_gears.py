"""Pairs on which the campaign of random gears found something wrong: all its checks hold on them now."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.contact.laws import ContactLaw, Exact, Nitsche, Penalty
from gearfe.contact.overlap import overlaps
from gearfe.contact.scene import MeshingPair
from gearfe.contact.solver import solve_on_whole_windows, solve_positions
from gearfe.errors import InputError
from gearfe.meshing.recipe import sector_recipes
from gearfe.stiffness.job import read_stiffness_job
from gearfe.stiffness.routes import Router
from gearfe.stiffness.sweep import elastic_pair, sweep_stiffness
from gearfe.stress.campaign import Case
from gearfe.stress.gears import _element, run

from .gears import pair

KEPT = sorted((Path(__file__).parent / "test_stress_cases" / "gears").glob("*.toml"))
#: Large windows, many Newton steps.
LONG = {
    "bent_teeth", "blend_of_routes", "corner_held_from_both_sides", "corner_with_several_equilibria",
    "jump_of_the_moment", "nearer_tip", "points_on_the_other_gear", "teeth_missed",
}  # fmt: skip


@pytest.mark.parametrize(
    "path", [pytest.param(p, marks=pytest.mark.slow if p.stem in LONG else ()) for p in KEPT], ids=lambda p: p.stem
)
def test_kept_cases(path: Path, tmp_path: Path) -> None:
    found = run(Case(0, "kept", {"job.toml": path.read_text(encoding="utf-8")}, "gearfe stiffness job.toml"), tmp_path)
    assert found.outcome == "done"
    assert {c.name for c in found.checks} >= {"tangent", "balance", "swap", "period"}
    assert [c for c in found.checks if not c.share <= 1.0] == []
    # ten times the law's estimate at edges would hide what was found on some of them
    assert next(c.value for c in found.checks if c.name == "swap") < 2e-3


def test_both_gears_see_the_same_teeth_overlap() -> None:
    """Deep overlaps: the pairs do not depend on which gear is the pinion, whose vertices alone miss some."""
    job = read_stiffness_job(Path(__file__).parent / "test_stress_cases" / "gears" / "teeth_missed.toml")
    one = elastic_pair(job.pair, coarsen=4.0)
    other = MeshingPair(one.wheel, one.pinion, one.centre_distance, one.width, one.law)
    angles = np.linspace(0.0, job.pair.mesh_cycle, 7)
    twists = np.full(len(angles), job.sweep["twist"])
    turned = one.wheel_angle(angles, twists) + math.pi / one.wheel.teeth
    mirrored = overlaps(other, turned, twists * one.wheel.teeth / one.pinion.teeth)
    for mine, theirs in zip(overlaps(one, angles, twists), mirrored, strict=True):
        assert len(mine) >= 5
        assert {o.tooth for o in mine} == {-1 - o.tooth for o in theirs}
        depth = {-1 - o.tooth: o.depth for o in theirs}
        assert all(o.depth == pytest.approx(depth[o.tooth], rel=1e-6) for o in mine)


@pytest.mark.parametrize("law", [Nitsche(), Penalty(), Exact()], ids=lambda law: law.name)
@pytest.mark.parametrize(("cycles", "factor"), [(0.0, 1.0), (-0.035, 1.0), (-0.08, 0.5), (0.03, 1.5)])
def test_a_tip_that_lies_along_a_root_bears_wherever_it_does_on_larger_windows(
    law: ContactLaw, cycles: float, factor: float
) -> None:
    """The overlap is nearly as deep at its far end as at the deepest point: nothing is narrowed there."""
    job = read_stiffness_job(Path(__file__).parent / "test_stress_cases" / "gears" / "tip_along_a_root.toml")
    elastic = elastic_pair(job.pair, **{**job.model, "law": law})
    angle = job.sweep["angles"][2:3] + cycles * job.pair.mesh_cycle
    twist = Router(job.pair, elastic).touching_twists(angle) + factor * job.sweep["twist"]
    (position,) = solve_positions(elastic, angle, twist)
    whole = solve_on_whole_windows(elastic, float(angle[0]), float(twist[0]))
    assert position.status == whole.status == "converged"
    assert position.torque_wheel == pytest.approx(whole.torque_wheel, rel=1e-9)


def test_roots_are_where_flanks_are_hollow() -> None:
    """Up to the form circle (ISO 21771), where the involute starts."""
    gears = pair(20, 30)
    for body, gear in zip(elastic_pair(gears).bodies, (gears.pinion, gears.wheel), strict=True):
        radii = np.linalg.norm(body.flank.points[::2], axis=1)
        form = float(np.linalg.norm(gear.profile.flank.point(np.array(0.0))))
        below, above = radii[body.flank.root - 1], radii[body.flank.root]
        assert 0 < body.flank.root < 0.2 * body.flank.edges
        assert below < form <= above * (1 + 1e-9)


def test_the_element_at_a_contact_is_the_one_there() -> None:
    """At the pitch point the flank's, at the tip the strip's, which are most of all."""
    gears = pair(20, 30)
    body, recipe = elastic_pair(gears, coarsen=1.5).pinion, sector_recipes(gears, coarsen=1.5)[0]
    base = gears.pinion.base_radius
    pitch, tip = (math.sqrt(r**2 - base**2) for r in (0.5 * 20 * gears.pinion.module, gears.pinion.tip_radius))
    assert _element(body, base, pitch) == pytest.approx(recipe.flank, rel=0.05)
    assert _element(body, base, tip * (1 - 1e-9)) == pytest.approx(recipe.strip, rel=0.05)


def test_small_loads_where_the_moment_of_the_pressure_has_a_jumping_rate() -> None:
    """Newton's steps went to and fro across the jump. The mesh knows the torque from another formulation."""
    job = read_stiffness_job(Path(__file__).parent / "test_stress_cases" / "gears" / "jump_of_the_moment.toml")
    elastic = elastic_pair(job.pair, **job.model)
    angle, twist = np.radians([0.1693]), np.array([4.3794e-4])
    known, direct = (Router(job.pair, elastic, route).solve(angle, twist)[0] for route in ("hertz", "direct"))
    assert known.status == direct.status == "converged"
    assert known.torque_wheel == pytest.approx(direct.torque_wheel, rel=2e-3)


def test_a_torque_beyond_small_strain_is_refused() -> None:
    job = read_stiffness_job(Path(__file__).parent / "test_stress_cases" / "gears" / "bent_teeth.toml")
    elastic = elastic_pair(job.pair, coarsen=5.0)
    with pytest.raises(InputError, match="modules"):
        sweep_stiffness(job.pair, torque=3e4, angles=[0.1], elastic=elastic)
