"""The run of a vibration job: its curves and housing, each from the cache where it can be, and the transient."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

from ...base.cache import versions
from ...base.record_spectrum import finer, subdivided
from ..gearbox.bearing_report import bearing_summary
from ..gearbox.inherited import inherited
from ..gearbox.job import TrainJob, job_train, train_body
from ..gearbox.mesh_stiffness import train_curves
from ..train import build_train
from ..train.gear_train import GearTrain
from ..train.model import TrainModel
from ..train.response import TrainResponse
from ..train.simulate import simulate_in_pieces
from .follow import TrainRun
from .report import stiffness_ranges

#: Tolerance that suffices for errors: forces and accelerations are within a hundredth of it.
ROUGH = 1e-3


def simulated(job: TrainJob, curves: Sequence[str], *, watch: Any, estimate: bool) -> TrainRun:
    """Return the run of a job; its curves and housing come from the cache if they are there.

    Parameters
    ----------
    job : TrainJob
        The train's job.
    curves : sequence of str
        CSV files of stiffness curves instead of computed ones, see `train_curves`.
    watch : Stopwatch
        Measures the stages.
    estimate : bool
        Whether errors are estimated.
    """
    with watch.stage("curves"):
        stiffness = train_curves(job, curves, estimate=estimate)
    with watch.stage("housing"):
        body = train_body(job)
    with watch.stage("model"):
        train = job_train(job, stiffness, body)
        model = build_train(train)
        highest = float(model.coupled_frequencies_hz.max(initial=0.0))
    options: dict[str, Any] = {"tolerance": job.table.tolerance, "method": job.table.method, "band_hz": band(job)}

    def pieces(times: Any) -> Iterator[TrainResponse]:
        return simulate_in_pieces(model, finer(times, highest)[0], estimate=estimate, **options)

    every = finer(job.times, highest)[1]
    again = repeater(job, every) if estimate else None
    further = described(job, train) | {"bearings": bearing_summary(model.operating)}
    return TrainRun(model, job.times, pieces, every, further, again, band(job))


def band(job: TrainJob) -> float:
    """Highest frequency of interest (Hz)."""
    return 5000.0 if job.housing is None else job.housing.reduction.band_Hz


def repeater(job: TrainJob, every: int) -> Callable[[TrainModel, str], Callable[[Any], Iterator[TrainResponse]]]:
    """The same run with another train by a method, as many samples in an output step; differences of runs need fewer
    digits.
    """

    def again(model: TrainModel, method: str) -> Callable[[Any], Iterator[TrainResponse]]:
        options: dict[str, Any] = {"tolerance": max(job.table.tolerance, ROUGH), "method": method}
        return lambda times: simulate_in_pieces(model, subdivided(times, every), **options)

    return again


def described(job: TrainJob, train: GearTrain) -> dict[str, Any]:
    """What was computed: entries of the summary."""
    body = train.housing
    housing = None
    if body is not None:
        housing = {
            "mass_kg": body.rigid_mass[0, 0],
            "coordinates": body.size,
            "modes": body.modes,
            "unknowns": body.nodes.size,
            "notes": list(body.notes),
        }
    return {
        "variant": job.table.variant,
        "housing": housing or "rigid",
        "inherited": inherited(job, train),
        "mesh_stiffness_N_per_m": stiffness_ranges(train),
        "mesh_phases_deg": {
            mesh.name: math.degrees(phase) for mesh, phase in zip(train.meshes, train.kinematics.phases, strict=True)
        },
        "job": {"train": asdict(job.table), "stiffness": asdict(job.stiffness)},
        "versions": versions(),
    }
