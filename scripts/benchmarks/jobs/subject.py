"""What the studies work on: the shipped job, or small stand-ins for a smoke run."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.places import GEOMETRY

if TYPE_CHECKING:
    from gearfe.base.tables.housing import HousingTable
    from gearfe.drivetrain.housing.model import Housing
    from gearfe.drivetrain.train import GearTrain
    from gearfe.gears.geometry.pair import GearPair

#: Speed (rad/s) and backlash (m) of the train whose teeth part.
PARTING_SPEED, PARTING_BACKLASH = 713.0, 40e-6


def given_file(path: Path) -> Path:
    """A file of the repository.

    Raises
    ------
    InputError
        When it is not there: the benchmark runs in a copy of the repository.
    """
    if not path.exists():
        from gearfe.base.errors import InputError

        cure = "run the benchmark in a copy of the repository, which holds the shipped jobs and the reference data"
        raise InputError("benchmark", str(path), "is not there", cure)
    return path


def shipped_pair() -> GearPair:
    """20/30 teeth with tip rounds of 0.1 mm, `geometry/gear_train.toml`."""
    from gearfe.gears.gearmesh.job import read_stiffness_job

    return read_stiffness_job(given_file(GEOMETRY / "gear_train.toml")).pair


def reference_pair() -> GearPair:
    """The sharp-tipped pair of `tests/data/gear_pair_20_30.csv`, bores of 0.35 times the pitch diameter."""
    from gearfe.gears.geometry.pair import Gear, GearPair

    form: dict[str, Any] = {"module": 2.5e-3, "pressure_angle": math.radians(25.0), "face_width": 10e-3}
    pinion, wheel = (Gear(z, bore_diameter=0.35 * z * 2.5e-3, **form) for z in (20, 30))
    return GearPair(pinion, wheel)


def off_changes(pair: GearPair, angles: np.ndarray, margin: float) -> np.ndarray:
    """(n,) whether positions are farther than `margin` (rad) from where a pair of teeth comes or goes."""
    cycle = pair.mesh_cycle
    changes = [pair.path[name].pinion_angle for name in ("B", "D")]
    apart = [np.abs((angles - change + 0.5 * cycle) % cycle - 0.5 * cycle) for change in changes]
    return np.asarray(np.min(apart, axis=0) > margin)


@lru_cache(maxsize=1)
def shipped_housing() -> HousingTable:
    """Table ``[housing]`` of the shipped job."""
    from gearfe.base.tables.jobs import load_job

    table: HousingTable = load_job(given_file(GEOMETRY / "gear_train.toml"), ("housing",))["housing"]
    return table


def housing_of(size_mm: float, *, small: bool = False) -> Housing:
    """The shipped housing with elements `size_mm` thick at inner edges; small: about one of its shafts, and short."""
    from gearfe.drivetrain.housing.build import housing_from_table

    table = shipped_housing()
    if small:
        middle = 0.5 * sum(table.wall_x_mm)
        shaft = replace(table.shafts[0], x_mm=middle)
        table = replace(table, shafts=(shaft,), wall_x_mm=(middle - 30.0, middle + 30.0))
    return housing_from_table(replace(table, mesh=replace(table.mesh, size_mm=size_mm)))


def train_model(variant: str, *, quick: bool = False, modes: int | None = None, speed: float | None = None) -> Any:
    """The shipped gear train ready to be simulated; quick: in a rigid housing with constant mesh stiffness.

    Parameters
    ----------
    variant
        ``undamped_springs`` or ``operating``; ``parting``: the latter at a resonance, with backlash.
    modes
        Of the housing with held bores, in place of the job's choice by frequency.
    speed
        Of the drive (rad/s), in place of the variant's.
    """
    from gearfe.drivetrain.gearbox.job import job_train, read_train_job, train_body
    from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
    from gearfe.drivetrain.train import build_train
    from gearfe.multibody import constant

    parting = variant == "parting"
    job = read_train_job(given_file(GEOMETRY / "gear_train.toml"), "operating" if parting else variant)

    def built(train: GearTrain) -> Any:
        if parting:
            train = replace(train, meshes=tuple(replace(mesh, backlash=PARTING_BACKLASH) for mesh in train.meshes))
        turning = PARTING_SPEED if parting and speed is None else speed
        if turning is not None:
            train = replace(train, drive=replace(train.driven, speed=constant(turning)))
        return build_train(train)

    if quick:
        job = replace(job, table=replace(job.table, housing="rigid"))
        return built(job_train(job, (1.1e8, 1.1e8), None))
    if modes is not None:
        assert job.housing is not None
        reduction = replace(job.housing.reduction, modes=modes)
        job = replace(job, housing=replace(job.housing, reduction=reduction))
    return built(job_train(job, train_curves(job), train_body(job)))


def train_times(quick: bool) -> np.ndarray:
    """Output times of the shipped train, 0..7 ms in steps of 35 us (s)."""
    return 35e-6 * np.arange(21 if quick else 201)
