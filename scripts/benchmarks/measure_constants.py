"""What constants of the contact solution change in the mesh stiffness, each halved and doubled.

A constant that only says how an equation is solved changes nothing that matters; one that changes more belongs to the
discretisation. Cases: those that the campaign of gears keeps, and random ones.

    python scripts/benchmarks/measure_constants.py [CASES]   # a Markdown table; 24 random cases take ten minutes
"""

from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.base.errors import InputError
from gearfe.gears.gearmesh.job import StiffnessJob, read_stiffness_job
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
#: Module -> constants, with two other values each.
CONSTANTS: dict[str, dict[str, tuple[Any, Any]]] = {
    "gears.contact.flank_compliance": {"SPACING": (0.7, 0.9), "TOO_NEAR": (0.6, 0.9)},
    "gears.contact.half_plane_step": {
        "WINDOW": (1.1, 1.6), "WIDER": (1.3, 2.2), "LEAST_FORCE": (5e-5, 2e-4), "LEAST_WIDTH": (5e-7, 2e-6),
        "REFERENCE_WIDTH": (5e-3, 2e-2), "MOVED": (0.05, 0.2), "WIDENED_BELOW": (5e-4, 2e-3),
    },
    "gears.contact.half_plane": {
        "HELD_STEPS": (2, 6), "NEAR": (1e-5, 4e-5), "TOLERANCE": (5e-7, 2e-6),
        "SEARCHES": (6, 24), "AHEAD": (5e-4, 2e-3), "STEPS": (20, 60),
        "SHARPEST": (0.01, 0.04),
    },
    "gears.geometry.first_contact": {"NEAR": (5e-4, 2e-3), "STEEPEST": (0.1, 0.4)},
    "gears.contact.elements": {"AHEAD": (5e-5, 2e-4), "BESIDE": (3, 10), "CHORD": (1e-4, 1e-2), "STEPS": (30, 80)},
}  # fmt: skip
#: Modules whose constants the condensed gears depend on.
OF_GEARS = ("gears.contact.flank_compliance",)


def jobs(count: int) -> list[StiffnessJob]:
    """Kept cases, and random ones that can run."""
    from tests.campaigns import gears

    made = [read_stiffness_job(path) for path in sorted((ROOT / "tests/campaigns/kept/gears").glob("*.toml"))]
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            case = gears.draw(np.random.default_rng([777, number]), number)
            try:
                made.append(read_stiffness_job(case.write(Path(folder))))
            except InputError:
                continue
    return made


def answers(found: list[StiffnessJob], elastic: list[Any]) -> list[Any]:
    """Stiffness and statuses of every job that has an answer."""
    made: list[Any] = []
    for job, gears in zip(found, elastic, strict=True):
        try:
            curve = sweep_stiffness(job.pair, elastic=gears, **job.sweep)
            made.append((curve.k_mesh, curve.status))
        except InputError:
            made.append((np.zeros(0), np.zeros(0, dtype=np.str_)))
    return made


def holders_of(constant: str, value: float) -> list[Any]:
    """Modules that hold a constant: its own, and those that import it."""
    loaded = [module for name, module in sys.modules.items() if name.startswith("gearfe.")]
    return [module for module in loaded if getattr(module, constant, None) is value]


def main(count: int = 24) -> int:
    """Print the table."""
    found = jobs(count)
    elastic = [elastic_pair(job.pair, job.model) for job in found]
    before = answers(found, elastic)
    print("| constant | value | others | largest change of k_mesh | positions with another status |")
    print("|---|---|---|---|---|")
    for name, constants in CONSTANTS.items():
        module = importlib.import_module(f"gearfe.{name}")
        for constant, values in constants.items():
            own, worst, other = getattr(module, constant), 0.0, 0
            holders = [module] if isinstance(own, int) else holders_of(constant, own)
            for value in values:
                for holder in holders:
                    setattr(holder, constant, value)
                gears = [elastic_pair(job.pair, job.model) for job in found] if name in OF_GEARS else elastic
                for (k, status), (k_now, status_now) in zip(before, answers(found, gears), strict=True):
                    with np.errstate(divide="ignore", invalid="ignore"):
                        off = np.abs(k_now / k - 1)
                    worst = max(worst, float(off[np.isfinite(off)].max(initial=0.0)))
                    other += int((status != status_now).sum())
            for holder in holders:
                setattr(holder, constant, own)
            told = ", ".join(f"{value:g}" for value in values)
            print(f"| `{name}.{constant}` | {own:g} | {told} | {worst:.1e} | {other} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*map(int, sys.argv[1:])))
