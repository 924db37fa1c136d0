"""Kinematics of a train: computed once for each layout, and held by the train."""

from __future__ import annotations

import dataclasses
import sys
from collections import Counter
from types import FrameType
from typing import Any

import pytest

from gearfe.base.errors import InputError
from gearfe.base.progress import Stopwatch
from gearfe.base.tables.runup import RunUpTable
from gearfe.drivetrain.gearbox.job import TrainJob, read_train_job
from gearfe.drivetrain.runup.job import at_speed, solved
from gearfe.drivetrain.train.kinematics import kinematics
from gearfe.drivetrain.vibration.run import simulated
from gearfe.gears.geometry.involute import tooth_profile
from gearfe.gears.geometry.pair import _shared_pair, gear_pair
from tests.makers.trains import changed, gear, train
from tests.places import GEOMETRY

SHIPPED = GEOMETRY / "gear_train.toml"
#: What follows from the layout of the train or from its gears alone.
ONCE = ("rolling", "tooth_places", "_rigid_train")
#: The shipped train has two different gears, and both of its meshes have the same pair of them.
GEARS, PAIRS = 2, 1


def springs(variant: str | None = None) -> TrainJob:
    """The shipped train, two meshes, in a rigid housing with constant springs."""
    job = read_train_job(SHIPPED, variant)
    meshes = tuple(dataclasses.replace(mesh, stiffness_N_per_m=1.1e8) for mesh in job.table.meshes)
    return dataclasses.replace(job, table=dataclasses.replace(job.table, housing="rigid", meshes=meshes))


def calls(run: Any) -> Counter[str]:
    """How often functions of the package are called in a run that begins without what others computed."""
    for cached in (kinematics, tooth_profile, _shared_pair):
        cached.cache_clear()
    counts: Counter[str] = Counter()

    def watch(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and "gearfe" in frame.f_code.co_filename:
            counts[frame.f_code.co_name] += 1

    sys.setprofile(watch)
    try:
        run()
    finally:
        sys.setprofile(None)
    return counts


def checked(counts: Counter[str]) -> None:
    assert {name: counts[name] for name in ONCE} == dict.fromkeys(ONCE, 1)
    assert counts["tooth_profile"] == GEARS
    assert counts["check_pair"] == PAIRS


def test_a_vibration_run_computes_kinematics_once() -> None:
    def run() -> None:
        planned = simulated(springs(), (), watch=Stopwatch(), estimate=False)
        assert [piece.status for piece in planned.pieces(planned.times[:3])] == ["done"]

    checked(calls(run))


def test_a_run_up_computes_kinematics_once() -> None:
    table = RunUpTable(speed_start_rad_per_s=500.0, speed_stop_rad_per_s=510.0, speeds=2, stability=False)
    checked(calls(lambda: solved(springs(), table, watch=Stopwatch())))


def test_trains_of_equal_layout_share_their_kinematics() -> None:
    """Stiffness is no part of the layout; the sense of the drive is."""
    base = train([(20, 30), (30, 20)])
    stiffer = changed(base, meshes=tuple(dataclasses.replace(mesh, stiffness=1e8) for mesh in base.meshes))
    assert stiffer.kinematics is base.kinematics
    speed = base.driven.speed * -1.0
    reversed_ = changed(base, drive=dataclasses.replace(base.driven, speed=speed), loads=())
    assert reversed_.kinematics.senses == tuple(-sense for sense in base.kinematics.senses)


def test_shared_kinematics_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        train([(20, 30)]).kinematics.steady_forces[0] = 0.0


def test_a_run_up_has_the_senses_of_its_own_speeds() -> None:
    """Which flanks drive, and so which deviations count, follows from the speeds of the run-up."""
    job = springs()
    unloaded = dataclasses.replace(job, table=dataclasses.replace(job.table, loads=()))
    backwards = at_speed(unloaded, -500.0)
    senses = job.rigid_train.kinematics.senses
    assert backwards.rigid_train.kinematics.senses == tuple(-sense for sense in senses)


def test_equal_gears_share_a_pair_and_a_wrong_distance_is_refused() -> None:
    assert gear_pair(gear(20), gear(30)) is gear_pair(gear(20), gear(30))
    with pytest.raises(InputError, match="centre_distance"):
        gear_pair(gear(20), gear(30), [0.0625])  # type: ignore[arg-type]
