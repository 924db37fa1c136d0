#!/usr/bin/env python3
"""Measure run-ups of shipped jobs at 200 speeds: processor seconds without multipliers, and of the multipliers.

Prints rows of the last table of docs/development/runup.md: the least of several runs each, in turns, with kernels,
curves and housing loaded before.

Usage: python scripts/benchmarks/measure_runups.py [--runs 5] [--speeds 200]
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path

import numpy as np

from gearfe.base.tables.jobs import load_job
from gearfe.drivetrain.gearbox.job import job_train, read_train_job, train_body
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.modes.job import at_speed, band_of
from gearfe.drivetrain.runup.run_up import RunUp, run_up
from gearfe.drivetrain.train import build_train

GEOMETRY = Path(__file__).resolve().parents[2] / "geometry"
#: File and variant of each run-up.
JOBS = (("planetary", None), ("gear_train", "operating"), ("gear_train", None))


def run_up_of(name: str, variant: str | None, speeds: int) -> partial[RunUp]:
    """Run-up of a shipped job over the speeds of its table, so many of them; its argument is `stability`."""
    file = GEOMETRY / f"{name}.toml"
    table = load_job(file, ("runup",))["runup"]
    over = np.linspace(table.speed_start_rad_per_s, table.speed_stop_rad_per_s, speeds)
    job = at_speed(read_train_job(file, variant), float(over[0]))
    model = build_train(job_train(job, train_curves(job), train_body(job)))
    return partial(run_up, model, over, tolerance=table.tolerance, band_hz=table.band_Hz or band_of(job))


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--speeds", type=int, default=200)
    args = parser.parse_args()
    for name, variant in JOBS:
        make = run_up_of(name, variant, args.speeds)
        make(stability=True)
        seconds: dict[bool, list[float]] = {False: [], True: []}
        for _ in range(args.runs):
            for stability, spent in seconds.items():
                begin = time.process_time()
                make(stability=stability)
                spent.append(time.process_time() - begin)
        alone, both = (min(spent) for spent in seconds.values())
        shown = f"`{name}.toml`" + (f", variant {variant}" if variant else "")
        print(f"| {shown}, {args.speeds} speeds | {alone:.2g} s; multipliers {both - alone:.2g} s more |", flush=True)


if __name__ == "__main__":
    main()
