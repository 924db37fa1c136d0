"""Pairs on which the campaign of random gears found something wrong: all its checks hold on them now."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfe.stress.campaign import Case
from gearfe.stress.gears import run

KEPT = sorted((Path(__file__).parent / "test_stress_cases" / "gears").glob("*.toml"))
#: Tens of Newton steps on large windows.
LONG = {"teeth_missed", "nearer_tip"}


@pytest.mark.parametrize(
    "path", [pytest.param(p, marks=pytest.mark.slow if p.stem in LONG else ()) for p in KEPT], ids=lambda p: p.stem
)
def test_kept_cases(path: Path, tmp_path: Path) -> None:
    found = run(Case(0, "kept", {"job.toml": path.read_text(encoding="utf-8")}, "gearfe stiffness job.toml"), tmp_path)
    assert found.outcome == "done"
    assert {c.name for c in found.checks} >= {"tangent", "balance", "swap", "period"}
    assert [c for c in found.checks if not c.share <= 1.0] == []
