"""The modes of a job: its train over the speeds of its table, without a run-up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.tables.modes import ModesTable
from ...base.tables.runup import RunUpTable
from ...base.typing import Array
from ..gearbox.inherited import inherited
from ..gearbox.job import TrainJob, job_train, train_body
from ..gearbox.mesh_stiffness import train_curves
from ..gearbox.over_speed import operating_speed
from ..train import build_train
from ..train.kinematics import drive_sense, fastest
from ..train.model import TrainModel
from .critical import Campbell, campbell
from .orders import train_orders
from .whirl import train_modes

#: Upper end of the band (Hz) of a train in a rigid housing.
BAND = 5000.0
#: Last speed where none is given, in parts of that of the drive.
BEYOND = 2.0


@dataclass(frozen=True, eq=False)
class ModesResult:
    """Modes and critical speeds of a job's train, the model, and the speed at which it runs (rad/s)."""

    model: TrainModel
    campbell: Campbell
    speed: float


def solved(
    job: TrainJob, table: ModesTable, runup: RunUpTable | None = None, curves: Sequence[str] = (), *, watch: Any
) -> ModesResult:
    """Return the modes of a job's train and where orders meet them.

    Parameters
    ----------
    job : TrainJob
        The train's job.
    table : ModesTable
        Speeds, band and orders.
    runup : RunUpTable, optional
        Range of speeds and band where the table has none.
    curves : sequence of str
        CSV files of stiffness curves instead of computed ones, see `train_curves`.
    watch : Stopwatch
        Measures the stages.

    Raises
    ------
    InputError
        For speeds that are not given and do not follow, and for what a train refuses.
    """
    runs = _running(job)
    speeds = _speeds(table, runup, runs)
    job = at_speed(job, float(speeds[np.argmax(np.abs(speeds))]))
    with watch.stage("curves"):
        stiffness = train_curves(job, curves)
    with watch.stage("housing"):
        body = train_body(job)
    with watch.stage("model"):
        model = build_train(job_train(job, stiffness, body))
    band = table.band_Hz or (None if runup is None else runup.band_Hz) or band_of(job)
    with watch.stage("modes"):
        modes = train_modes(model, speeds, band)
        found = campbell(modes, train_orders(model, table.multiples, table.shaft_multiples), band)
    return ModesResult(model, found, runs)


def band_of(job: TrainJob) -> float:
    """Highest frequency of interest (Hz) of a job: that of its housing's reduction."""
    return BAND if job.housing is None else job.housing.reduction.band_Hz


def at_speed(job: TrainJob, speed: float) -> TrainJob:
    """The job with a constant speed of its drive (rad/s), whose sense decides which flanks drive.

    A drive by torque becomes one by speed, and speeds at the start are left out: modes and steady states are those at a
    speed. Torques of loads over speed keep the operating point that they have in [train].
    """
    if job.table.drive is None:
        return job
    drive = replace(
        job.table.drive,
        speed_rad_per_s=speed,
        ramp_width_ms=None,
        torque_Nm=None,
        torque_over_speed=None,
        torque_slope_Nm_s_per_rad=0.0,
    )
    shafts = tuple(replace(shaft, initial_speed_rad_per_s=None) for shaft in job.table.shafts)
    machines = tuple(replace(machine, initial_speed_rad_per_s=None) for machine in job.table.machines)
    operating = job.operating_speed
    if any(load.torque_over_speed is not None for load in job.table.loads):
        operating = math.copysign(operating_speed(job.rigid_train) or 0.0, speed)
    return replace(
        job, table=replace(job.table, drive=drive, shafts=shafts, machines=machines), operating_speed=operating
    )


def _running(job: TrainJob) -> float:
    """Speed of the drive (rad/s): the largest that it comes to, in its sense."""
    speed = job.rigid_train.driven.speed
    return drive_sense(speed) * fastest(speed)


def _speeds(table: ModesTable, runup: RunUpTable | None, runs: float) -> Array:
    """Speeds of the drive (rad/s): those of the table, of the run-up, or up to some times that of the drive."""
    start, stop = table.speed_start_rad_per_s, table.speed_stop_rad_per_s
    if runup is not None:
        start = runup.speed_start_rad_per_s if start is None else start
        stop = runup.speed_stop_rad_per_s if stop is None else stop
    start = 0.0 if start is None else start
    stop = BEYOND * runs if stop is None else stop
    if stop == start:
        problem = "is not given, and the speed of the drive is 0"
        raise InputError("modes.speed_stop_rad_per_s", None, problem, "give the last speed of the drive")
    replace(table, speed_start_rad_per_s=start, speed_stop_rad_per_s=stop).check("modes")
    low, high = sorted((start, stop), key=abs)  # modes are followed from slow to fast
    return np.linspace(low, high, table.speeds)


def described(job: TrainJob, table: ModesTable, result: ModesResult) -> dict[str, Any]:
    """What was computed: entries of the summary."""
    return {
        "variant": job.table.variant,
        "inherited": inherited(job, result.model.train),
        "job": {"modes": asdict(table), "train": asdict(job.table)},
    }
