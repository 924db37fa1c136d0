#!/usr/bin/env python3
"""Accuracy against time of the stiffness sweep: element size x contact law, for the shipped pair at 0.05 deg.

The error of each setting is taken against the curve on a far finer mesh (Nitsche); seconds are those of one process in
which meshes are read from the cache, from gears to curve, and the mesher's own seconds stand beside. With --write the
table in docs/stiffness.md is replaced, and the rows of the default meshes in README.md.

Usage: python scripts/benchmarks/measure_accuracy.py [--job JOB.toml] [--write]
"""

from __future__ import annotations

import argparse
import math
import os
import platform
import time
from pathlib import Path

import numpy as np

from gearfe import GearPair, sweep_stiffness
from gearfe.base.tables.pair import LAWS
from gearfe.gears.contact.laws import DEFAULT_MODEL
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes

ROOT = Path(__file__).resolve().parents[2]
SIZES = (2.0, 1.5, 1.0, 0.7)
FINEST = 0.35
TWIST = math.radians(0.05)
START, END = "<!-- accuracy: begin -->", "<!-- accuracy: end -->"


def meshing_seconds(pair: GearPair, coarsen: float, flank_coarsen: float) -> float:
    """Seconds that gmsh needs for both tooth sectors."""
    start = time.perf_counter()
    recipes = sector_recipes(pair, coarsen=coarsen, flank_coarsen=flank_coarsen)
    for gear, recipe in zip((pair.pinion, pair.wheel), recipes, strict=True):
        sector_mesh(gear, recipe, cache=False)
    return time.perf_counter() - start


def on_path(pair: GearPair, angles: np.ndarray, margin: float) -> np.ndarray:
    """Positions farther than `margin` (rad) from where a pair of teeth comes or goes."""
    cycle = pair.mesh_cycle
    changes = [pair.path[name].pinion_angle for name in ("B", "D")]
    apart = [np.abs((angles - change + 0.5 * cycle) % cycle - 0.5 * cycle) for change in changes]
    return np.min(apart, axis=0) > margin


def replace(page: Path, lines: list[str]) -> None:
    """Put lines between the marks of a page."""
    before, _, rest = page.read_text(encoding="utf-8").partition(START)
    _, _, after = rest.partition(END)
    page.write_text("\n".join([f"{before}{START}", *lines, f"{END}{after}"]), encoding="utf-8", newline="\n")


def main() -> None:
    """Measure and print (or write) the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--job", default=str(ROOT / "geometry" / "gear_train.toml"))
    parser.add_argument("--write", action="store_true", help="put the table into docs/stiffness.md and README.md")
    args = parser.parse_args()
    job = read_stiffness_job(args.job)
    pair = job.pair
    angles = np.radians(np.arange(1.0, 41.0))
    common = {"twist": TWIST, "angles": angles, "materials": job.materials, "plane": job.table.plane}
    truth = sweep_stiffness(pair, law="nitsche", coarsen=FINEST, **common)
    path = on_path(pair, angles, math.radians(1.6))
    lines = [
        "| law | `coarsen` | flank element (mm) | error of k away from pair changes | error of k at all positions | "
        "total time (s) | contact solutions (s) | meshing, first run only (s) |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for law in LAWS:
        for size in SIZES:
            factor = DEFAULT_MODEL.changed(law=law, coarsen=size).mesh_flank_coarsen
            mesher = meshing_seconds(pair, size, factor)
            sweep_stiffness(pair, law=law, coarsen=size, **common)  # fills the mesh cache
            best = None
            for _ in range(3):
                start = time.perf_counter()
                curve = sweep_stiffness(pair, law=law, coarsen=size, **common)
                seconds = time.perf_counter() - start
                if best is None or seconds < best[0]:
                    best = (seconds, curve)
            assert best is not None
            seconds, curve = best
            off = np.abs(curve.k_mesh / truth.k_mesh - 1)
            flank = 1e3 * sector_recipes(pair, coarsen=size, flank_coarsen=factor)[0].flank
            lines.append(
                f"| {law} | {size:g} | {flank:.3g} | {100 * off[path].max():.3f} % | {100 * off.max():.3f} % | "
                f"{seconds:.2f} | {curve.timings['positions']:.2f} | {mesher:.2f} |"
            )
            print(lines[-1], flush=True)
    note = (
        f"20/30 teeth at 0.05 deg, 40 positions; error against `coarsen` = {FINEST:g}; best of three runs on "
        f"{os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python {platform.python_version()}."
    )
    table = [*lines, "", note]
    if not args.write:
        print("\n" + "\n".join(table))
        return
    replace(ROOT / "docs" / "stiffness.md", table)
    replace(
        ROOT / "README.md",
        [line for line in table if not line.startswith("|") or " | 1 | " in line or line in lines[:2]],
    )


if __name__ == "__main__":
    main()
