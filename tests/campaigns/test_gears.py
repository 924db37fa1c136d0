"""Pairs on which the campaign of random gears found something wrong: all its checks hold on them now."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfe.base.errors import InputError
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from tests.places import KEPT

from .campaign import Case
from .gears import run

CASES = sorted((KEPT / "gears").glob("*.toml"))


@pytest.mark.parametrize("path", CASES, ids=lambda p: p.stem)
def test_kept_cases(path: Path, tmp_path: Path) -> None:
    found = run(Case(0, "kept", {"job.toml": path.read_text(encoding="utf-8")}, "gearfe stiffness job.toml"), tmp_path)
    assert found.outcome == "done"
    assert {c.name for c in found.checks} >= {"tangent", "swap", "period"}
    assert [c for c in found.checks if not c.share <= 1.0] == []


def test_a_torque_beyond_small_strain_is_refused() -> None:
    job = read_stiffness_job(KEPT / "gears" / "bent_teeth.toml")
    elastic = elastic_pair(job.pair, coarsen=5.0)
    with pytest.raises(InputError, match="modules"):
        sweep_stiffness(job.pair, torque=3e4, angles=[0.1], elastic=elastic)
