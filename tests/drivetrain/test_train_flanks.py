"""Loads that press the back flanks are an error with its cure; statics by hand."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from gearfe import steady_state
from gearfe.base.errors import InputError
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.train import Drive, GearMesh, Load, build_train, simulate
from gearfe.multibody import TimeFunction, constant, smoothed_step
from tests.makers.files import job_file
from tests.makers.job_texts import BARE_TRAIN, BORES
from tests.makers.trains import SHIPPED, base_radius, braking, changed, train

BASE = train(SHIPPED)
PAIR = """
[pair]
module_mm = 2.0
pressure_angle_deg = 20.0
face_width_mm = 12.0
tooth_thinning_um = 20.0
pinion = { teeth = 18, bore_diameter_mm = 9.0 }
wheel = { teeth = 27, bore_diameter_mm = 9.0 }
"""


def loaded(*torques: TimeFunction | float, shafts: tuple[str, ...] = ("s2",), **changes: object):  # type: ignore[no-untyped-def]
    loads = tuple(
        Load(shaft, None, constant(t) if isinstance(t, float) else t) for shaft, t in zip(shafts, torques, strict=True)
    )
    return changed(BASE, loads=loads, **changes)


def test_a_load_of_the_wrong_sign_says_so(tmp_path: Path) -> None:
    """Before any curve is computed: the curves of the file are made in between."""
    path = job_file(tmp_path, BARE_TRAIN.replace("torque_Nm = -30.0", "torque_Nm = 30.0") + BORES)
    job = read_train_job(path)
    force = 30.0 / (0.027 * math.cos(math.radians(20.0)))
    words = rf"load on 'out' torque_Nm = 30.0: drives the train.*is -{force:.6g} N.*write -30 to brake"
    with pytest.raises(InputError, match=words):
        train_curves(job)
    with pytest.raises(InputError, match="drives the train"):
        build_train(job_train(job, [1e8], None))


def test_a_load_that_drives_works_on_back_flanks_that_are_known(tmp_path: Path) -> None:
    """By the backlash of the mesh, or with a mesh law that of the gears; a stiffness without backlash has none."""
    wrong = BARE_TRAIN.replace("torque_Nm = -30.0", "torque_Nm = 30.0") + BORES
    force = 30.0 / (0.027 * math.cos(math.radians(20.0)))
    job = read_train_job(job_file(tmp_path, wrong.replace("= 2e8", "= 2e8\nbacklash_um = 20.0")))
    made = simulate(build_train(job_train(job, train_curves(job))), job.times, tolerance=job.table.tolerance)
    assert made.contact_force[-1, 0] == pytest.approx(-force, rel=0.2)
    mapped = wrong.replace("stiffness_N_per_m = 2e8", "") + PAIR
    assert job_train(read_train_job(job_file(tmp_path, mapped))).kinematics.steady_forces == pytest.approx([-force])
    for change in (
        ("thinning_um = 20.0", "thinning_um = 0.0"),
        ('driven = "b"', 'driven = "b"\nmesh_model = "variable_stiffness"'),
    ):
        with pytest.raises(InputError, match="drives the train"):
            job_train(read_train_job(job_file(tmp_path, mapped.replace(*change))))


def test_a_load_beyond_every_contact_names_the_mesh(tmp_path: Path) -> None:
    text = (
        BARE_TRAIN.replace("stiffness_N_per_m = 2e8", "").replace("torque_Nm = -30.0", "torque_Nm = -3e5")
        + BORES
        + PAIR
    )
    with pytest.raises(
        InputError, match=r"mesh 'a-b' mesh_model_torque_Nm = 1500000.*no contact solution.*smaller load"
    ):
        train_curves(read_train_job(job_file(tmp_path, text)))


@pytest.mark.parametrize("speed", [600.0, -600.0])
def test_signs_follow_the_sense_of_the_drive(speed: float) -> None:
    drive = Drive("s0", "s0+", constant(speed))
    build_train(loaded(-math.copysign(50.0, speed), drive=drive))
    with pytest.raises(InputError, match="drives the train"):
        build_train(loaded(math.copysign(50.0, speed), drive=drive))


def test_a_ramp_of_the_drive_from_rest_has_its_final_sense() -> None:
    ramp = Drive("s0", "s0+", smoothed_step(1e-3, 2e-3, -600.0))
    build_train(loaded(50.0, drive=ramp))
    with pytest.raises(InputError, match="drives the train"):
        build_train(loaded(-50.0, drive=ramp))


def test_several_loads_are_summed_at_all_times() -> None:
    """s1 turns at -400 rad/s: +90 N m brake it. On the first mesh 2/3 of the 100 N m of s2 act as well."""
    both = loaded(100.0, 90.0, shafts=("s2", "s1"))
    with pytest.raises(InputError, match=r"load on 's2' torque_Nm = 100.*mesh 'd1-g1'"):
        build_train(both)
    helped = loaded(-100.0, -30.0, shafts=("s2", "s1"))  # the middle load drives, and the last one holds it
    assert helped.kinematics.steady_forces[0] == pytest.approx((100.0 * 2 / 3 - 30.0) / base_radius(30))
    build_train(helped)
    with pytest.raises(InputError, match=r"load on 's1' torque_Nm = -70.*mesh 'd0-g0' is -2"):
        build_train(loaded(-100.0, -70.0, shafts=("s2", "s1")))
    early = loaded(smoothed_step(0.5e-3, 1e-3, -100.0), smoothed_step(2e-3, 1e-3, 150.0), shafts=("s2", "s2"))
    with pytest.raises(InputError, match=r"torque_Nm = 150.*at 2\.5 ms"):
        build_train(early)
    late = loaded(50.0, smoothed_step(2e-3, 1e-3, -150.0), shafts=("s2", "s2"))
    with pytest.raises(InputError, match=r"torque_Nm = 50.0"):
        build_train(late)


def test_a_mesh_written_the_wrong_way_round_is_told_from_a_wrong_torque() -> None:
    turned = GearMesh("g0", "d0", 1e8)
    with pytest.raises(InputError, match=r"brakes, but gear 'd0' drives gear 'g0'.*exchange driver and driven"):
        build_train(changed(BASE, meshes=(turned, BASE.meshes[1])))


def test_a_load_that_is_meant_to_drive() -> None:
    """Named as drivers, the load's gears press the driving flanks: the mirror image of the train driven there."""
    meshes = tuple(GearMesh(m.driven, m.driver, m.stiffness) for m in BASE.meshes)
    lowering = changed(BASE, meshes=meshes, loads=(Load("s2", "s2+", -1.0 * braking(2)),))
    times = np.linspace(0.0, 2e-3, 21)
    one, two = (simulate(build_train(s), times, tolerance=1e-9).contact_force for s in (BASE, lowering))
    assert one == pytest.approx(two, rel=1e-6, abs=1e-3)
    assert one[-1].min() > 0.0


def test_what_is_no_mistake() -> None:
    """No load, inertia alone, oscillating torques, another initial speed; a drive at rest, its loads either way."""
    build_train(changed(BASE, loads=()))
    build_train(loaded(-20.0, drive=Drive("s0", "s0+", constant(600.0) + smoothed_step(1e-3, 1e-3, -300.0))))
    build_train(loaded(constant(-20.0) + TimeFunction(sines=((50.0, 3000.0, 0.0),))))
    fast = (*BASE.shafts[:2], dataclasses.replace(BASE.shafts[2], initial_speed=300.0))
    build_train(changed(BASE, shafts=fast))
    still = Drive("s0", "s0+", constant(0.0))
    for torque in (50.0, -50.0):
        made = simulate(build_train(loaded(torque, drive=still)), np.linspace(0.0, 1e-3, 5))
        assert made.contact_force.min() >= -1e-9


@pytest.mark.parametrize("kind", ["stiffness", "potential"])
def test_steady_states_on_back_flanks_begin_behind_the_backlash(tmp_path: Path, kind: str) -> None:
    """Slow motions carry the force of statics, of the load and of the opposite one, and the teeth stay in contact."""
    text = (
        BARE_TRAIN + BORES if kind == "stiffness" else BARE_TRAIN.replace("stiffness_N_per_m = 2e8", "") + BORES + PAIR
    )
    text = text.replace("= 2e8", "= 2e8\nbacklash_um = 20.0").replace("ratio = 0.05", "ratio = 0.2")
    job = read_train_job(job_file(tmp_path, text))
    curves = train_curves(job)
    driven = job_train(job, curves)
    driving = changed(driven, loads=tuple(dataclasses.replace(x, torque=-1.0 * x.torque) for x in driven.loads))
    there, back = (steady_state(build_train(one), -20.0) for one in (driven, driving))
    force = 30.0 / (0.027 * math.cos(math.radians(20.0)))
    assert there.force.mean() == pytest.approx(force, rel=1e-3)
    assert back.force.mean() == pytest.approx(-force, rel=1e-3)
    assert there.force.min() > 0.0 > back.force.max()
