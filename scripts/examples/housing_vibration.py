#!/usr/bin/env python3
"""A gear train in its housing in a few lines of Python: what ``gearfe vibration`` does, without its options.

Usage: python scripts/examples/housing_vibration.py [JOB.toml [OUT_DIR [VARIANT]]]
"""

from __future__ import annotations

import sys

from gearfe.base.files import output_folder, write_csv
from gearfe.base.record_spectrum import finer
from gearfe.drivetrain.gearbox.job import job_train, read_train_job, train_body
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.train import build_train, simulate
from gearfe.drivetrain.vibration.follow import RunningMean
from gearfe.drivetrain.vibration.spectra import response_columns, spectra


def main(job_file: str = "geometry/gear_train.toml", out: str = "out/vibration", variant: str | None = None) -> int:
    """Simulate, write response.csv and spectrum.csv, print the mean contact forces."""
    job = read_train_job(job_file, variant)
    train = job_train(job, train_curves(job), train_body(job))
    model = build_train(train)
    times, every = finer(job.times, model.coupled_frequencies_hz.max())  # what the fastest mode needs
    response = simulate(model, times, tolerance=job.table.tolerance)
    radiation = None if train.housing is None else train.housing.radiation
    folder = output_folder(out)
    write_csv(folder / "response.csv", response_columns(response.every(every), radiation))
    write_csv(folder / "spectrum.csv", spectra(response, radiation, every=every).columns())
    force = RunningMean(response.time, response.load_end_s, response.common_period_s)
    force.add(response.time, response.contact_force)
    for name, mean in zip(response.mesh_names, force.value, strict=True):
        print(f"mean contact force {name}: {mean:.6g} N over {force.periods} common mesh periods")
    print(f"written to {folder}: response.csv, spectrum.csv")
    return int(response.status != "done")


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
