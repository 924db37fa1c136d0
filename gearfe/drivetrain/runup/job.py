"""The run-up of a job: its train in steady running at all speeds of its table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.progress import stage
from ...base.tables.runup import RunUpTable
from ..gearbox.inherited import inherited
from ..gearbox.job import TrainJob, job_train, train_body
from ..gearbox.mesh_stiffness import train_curves
from ..modes.job import at_speed, band_of
from ..train import build_train
from ..train.gear_train import GearTrain
from .instability import InstabilityMap, instability_map
from .run_up import RunUp, run_up


def solved(
    job: TrainJob, table: RunUpTable, curves: Sequence[str] = (), *, watch: Any
) -> tuple[RunUp, InstabilityMap | None]:
    """Return the steady states of a job's train, and its instability map if the table has loads for one.

    Parameters
    ----------
    job : TrainJob
        The train's job.
    table : RunUpTable
        Speeds, tolerance, band and loads.
    curves : sequence of str
        CSV files of stiffness curves instead of computed ones: one for all meshes, or one for each mesh.
    watch : Stopwatch
        Measures the stages.

    Raises
    ------
    InputError
        If no periodic motion is found at any of the speeds, and for what a train or a run-up refuses.
    """
    speeds = np.linspace(table.speed_start_rad_per_s, table.speed_stop_rad_per_s, table.speeds)
    job = at_speed(job, float(speeds[0]))
    with watch.stage("curves"):
        stiffness = train_curves(job, curves)
    with watch.stage("housing"):
        body = train_body(job)
    with watch.stage("model"):
        model = build_train(job_train(job, stiffness, body))
    band = table.band_Hz or band_of(job)
    with watch.stage("steady states"), stage("steady states"):
        options: dict[str, Any] = {"tolerance": table.tolerance, "band_hz": band, "stability": table.stability}
        run = run_up(model, speeds, **options)
    if not run.states:
        value = [table.speed_start_rad_per_s, table.speed_stop_rad_per_s]
        problem = "; ".join(["has no periodic motion that was found at any of the speeds", *run.notes])
        raise InputError("runup", value, problem, "add damping, or look at a transient: gearfe vibration")
    unstable = None
    if table.instability_loads:
        with watch.stage("instability"), stage("instability"):
            unstable = instability_map(run.train, speeds, table.instability_loads)
    return run, unstable


def described(job: TrainJob, table: RunUpTable, train: GearTrain) -> dict[str, Any]:
    """What was computed: entries of the summary."""
    return {
        "variant": job.table.variant,
        "inherited": inherited(job, train),
        "job": {"runup": asdict(table), "train": asdict(job.table)},
    }
