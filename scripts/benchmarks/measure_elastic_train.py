#!/usr/bin/env python3
"""Measure the shipped train with elastic shafts of 20 mm against the one with rigid shafts.

Prints the largest difference of the first 15 coupled frequencies from those of all coordinates of the beams, the
misalignment of both meshes, and processor seconds of the transient and of the run-up with rigid and elastic shafts: the
median of several runs each, kernels loaded before, taken in turns.

Usage: python scripts/benchmarks/measure_elastic_train.py [--runs 3] [--speeds 200]
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.drivetrain.gearbox.job import job_train, read_train_job, train_body
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.runup.run_up import run_up
from gearfe.drivetrain.train import GearTrain, TrainModel, build_train, elastic_shaft, simulate
from gearfe.drivetrain.train.misalignment import misalignments
from gearfe.fem.beams import BeamShaft, ReducedShaft, Section, full_shaft

JOB = Path(__file__).resolve().parents[2] / "geometry" / "gear_train.toml"
#: Diameter of the shafts (m).
DIAMETER = 0.02
#: Frequencies that are compared, and up to where the elements of the whole model are accurate (Hz).
COMPARED, ACCURATE_HZ = 15, 40e3
#: Of the run-up: speeds of the drive (rad/s), tolerance, highest frequency of interest (Hz).
SLOWEST, FASTEST, TOLERANCE, BAND_HZ = 200.0, 1200.0, 1e-3, 5000.0


def with_steel(train: GearTrain) -> GearTrain:
    """The train with shafts of steel, elastic."""
    shafts = (
        replace(shaft, sections=(Section(shaft.length, DIAMETER, DIAMETER, young=200e9),), radius=0.5 * DIAMETER)
        for shaft in train.shafts
    )
    return replace(train, shafts=tuple(shafts))


def unreduced(train: GearTrain) -> TrainModel:
    """The model with all coordinates of the beams."""
    reduce_shaft: Any = elastic_shaft.reduce_shaft

    def whole(shaft: BeamShaft, frame: Any, _: float, *, elements: int | None) -> ReducedShaft:
        return full_shaft(shaft, frame, ACCURATE_HZ, elements=elements)

    elastic_shaft.reduced_shaft.cache_clear()
    setattr(elastic_shaft, "reduce_shaft", whole)  # noqa: B010
    try:
        return build_train(train)
    finally:
        setattr(elastic_shaft, "reduce_shaft", reduce_shaft)  # noqa: B010
        elastic_shaft.reduced_shaft.cache_clear()


def seconds(runs: int, works: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Median of the processor seconds of each work over the runs."""
    taken: dict[str, list[float]] = {name: [] for name in works}
    for run in range(runs + 1):
        for name, work in works.items():
            start = time.process_time()
            work()
            if run:  # the first one loads the kernels
                taken[name].append(time.process_time() - start)
    return {name: statistics.median(values) for name, values in taken.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=3, help="runs of each, their median counts")
    parser.add_argument("--speeds", type=int, default=200, help="speeds of the run-up")
    args = parser.parse_args()
    job = read_train_job(JOB)
    train = job_train(job, train_curves(job), train_body(job))
    models = {"rigid": build_train(train), "elastic": build_train(with_steel(train))}
    whole = unreduced(with_steel(train))
    first, all_of_them = (m.coupled_frequencies_hz[:COMPARED] for m in (models["elastic"], whole))
    print(f"coordinates: rigid {models['rigid'].system.size}, elastic {models['elastic'].system.size}, "
          f"unreduced {whole.system.size}")  # fmt: skip
    print(f"first {COMPARED} coupled frequencies: largest difference {np.abs(first / all_of_them - 1.0).max():.2e}")
    for name, model in models.items():
        for mesh in misalignments(model):
            print(f"misalignment, {name} shafts, mesh {mesh.mesh}: f_sh {1e6 * mesh.f_sh:.3f} um")
    speeds = np.linspace(SLOWEST, FASTEST, args.speeds)
    kinds: dict[str, Callable[[TrainModel], object]] = {
        "transient": lambda model: simulate(model, job.times, tolerance=job.table.tolerance),
        f"run-up of {args.speeds} speeds": lambda model: run_up(model, speeds, tolerance=TOLERANCE, band_hz=BAND_HZ),
    }
    for kind, work in kinds.items():
        taken = seconds(args.runs, {name: partial(work, model) for name, model in models.items()})
        print(f"{kind}: rigid {taken['rigid']:.3f} s, elastic {taken['elastic']:.3f} s, "
              f"{taken['elastic'] / taken['rigid']:.2f} times")  # fmt: skip


if __name__ == "__main__":
    main()
