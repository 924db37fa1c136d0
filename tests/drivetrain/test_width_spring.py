"""Springs of meshes whose load varies along the face width: the contact's force, tangent and transmission error."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.gearbox.job import TrainJob, job_train, read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import TrainModel, build_train
from gearfe.drivetrain.train.statics import static_errors
from gearfe.gears.gearmesh.job import StiffnessJob
from gearfe.gears.gearmesh.width_job import job_lines
from gearfe.gears.gearmesh.width_spring import WidthStates, mesh_spring, width_states
from gearfe.gears.geometry.pair import gear_pair
from gearfe.gears.width import sweep_width
from tests.makers.files import job_file
from tests.makers.job_texts import SMALL_TRAIN

TORQUE, BETA = 75.0, math.radians(15.0)
#: Microgeometry: teeth that differ, and a left flank of its own.
UNEVEN = "[microgeometry]\n[microgeometry.pinion]\npitch_um = [" + ", ".join(["1.0", "-1.0"] * 10) + "]\n"
SIDES = "[microgeometry]\n[microgeometry.pinion.left]\nhelix_slope_um = 3.0\n"


def text(model: str = "variable_stiffness", pair: str = "misalignment_um = 10.0", *, helical: bool = False) -> str:
    """The small train with tilted axes, or with helical gears, its spring computed on coarse sections."""
    made = SMALL_TRAIN.replace("[pair.pinion]", f"{pair}\n[pair.pinion]", 1)
    made = made.replace("stiffness_N_per_m = 1e8", f'mesh_model = "{model}"')
    if helical:
        made = made.replace("[pair.pinion]", "helix_angle_deg = 15.0\n[pair.pinion]", 1)
        made = made.replace("x_mm = 62.5", f"x_mm = {62.5 / math.cos(BETA):.12f}")
    return made + "[stiffness]\ncoarsen = 2.0\n[train.curves]\npositions = 24\n[train.damping]\nratio = 0.05\n"


def read(folder: Path, content: str) -> TrainJob:
    return read_train_job(job_file(folder, content))


def model_of(job: TrainJob) -> TrainModel:
    return build_train(job_train(job, train_curves(job)))


def contact(job: TrainJob, angles: np.ndarray, torques: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Transmission error (m) and tangent (N/m) of the contact along the width, (torques, angles)."""
    train, named = job_train(job), job.meshes[0]
    pair = gear_pair(*(gear.gear for gear in train.gears))
    lines = job_lines(StiffnessJob(named, pair))
    sweep = sweep_width(lines, torques, angles=angles)
    return sweep.transmission_error, sweep.stiffness / pair.wheel.base_radius**2


@pytest.mark.parametrize("helical", [False, True])
def test_the_spring_has_the_static_transmission_error_of_the_contact(helical: bool, tmp_path: Path) -> None:
    """At the carried torque, and to first order for more of it."""
    job = read(tmp_path, text(helical=helical))
    model = model_of(job)
    line = model.meshes[0]
    angles = line.pair.mesh_cycle * np.arange(24) / 24
    errors, tangent = contact(job, angles, [TORQUE, 1.05 * TORQUE])
    (static,) = static_errors(model.train, angles)
    assert static is not None
    np.testing.assert_allclose(static, errors[0], rtol=0.0, atol=1e-5 * errors[0].max())
    np.testing.assert_allclose(line.stiffness(angles), tangent[0], rtol=1e-9)
    more = 0.05 * TORQUE / line.pair.wheel.base_radius
    np.testing.assert_allclose(more / line.stiffness(angles), errors[1] - errors[0], rtol=0.02)


@pytest.mark.parametrize("model", ["variable_stiffness", "mean_stiffness"])
def test_slow_running_follows_the_static_transmission_error(model: str, tmp_path: Path) -> None:
    """It excites the train: at a hundredth of the speed the dynamic error is the static one."""
    job = read(tmp_path, text(model))
    slow = text(model).replace("speed_rad_per_s = 600.0", "speed_rad_per_s = 5.0")
    made = model_of(read(tmp_path, slow))
    state = steady_state(made, 5.0, tolerance=1e-5)
    angle = state.lattice.theta[:, 0] / (2.0 * math.pi) * made.meshes[0].pair.mesh_cycle
    (static,) = static_errors(made.train, angle)
    assert static is not None
    swing = float(np.ptp(static))
    assert swing > 0.1e-6
    np.testing.assert_allclose(state.transmission_error[:, 0], static, rtol=0.0, atol=0.02 * swing)
    flat = np.ptp(made.meshes[0].stiffness(angle))
    assert (flat == 0.0) == (model == "mean_stiffness")
    assert len(job.meshes) == 1


def test_tilts_load_the_spring_as_they_load_the_contact(tmp_path: Path) -> None:
    """Change of force and moment between contacts whose axes differ by 1 um over the width, at one twist."""
    states = []
    for tilt in (9.5, 10.0, 10.5):
        job = read(tmp_path, text(pair=f"misalignment_um = {tilt}"))
        pair = gear_pair(*(gear.gear for gear in job_train(job).gears))
        angles = pair.mesh_cycle * np.arange(6) / 6
        states.append(width_states(StiffnessJob(job.meshes[0], pair), angles, twist=math.radians(0.03)))
    low, middle, high = states
    gamma = 1e-6 / 10e-3
    against = middle.stiffness * middle.lever**2 + middle.against_tilting
    for change, tangent in (
        (high.force - low.force, middle.stiffness * middle.lever),
        (high.moment - low.moment, against),
    ):
        off = np.sort(np.abs(change / (tangent * gamma) - 1.0))
        assert off[-2] < 5e-3
        assert off[-1] < 0.1  # a pair comes into contact there
    assert (middle.moment > 0.0).all()  # the flanks close towards larger y


def test_right_flanks_drive_where_the_driver_turns_backwards(tmp_path: Path) -> None:
    """A slope over the width closes the flanks at one end whichever drives: the mirror image has the same spring."""
    lead = "[microgeometry]\n[microgeometry.pinion]\nhelix_slope_um = {}\n"
    forward = read(tmp_path, text(pair="") + lead.format(8.0))
    backward = text(pair="").replace("speed_rad_per_s = 600.0", "speed_rad_per_s = -600.0")
    backward = backward.replace("torque_Nm = 75.0", "torque_Nm = -75.0")
    one, two, tilted = (
        train_curves(job)[0]
        for job in (
            forward,
            read(tmp_path, backward + lead.format(8.0)),
            read(tmp_path, text(pair="misalignment_um = 8.0")),
        )
    )
    # a tilt displaces flanks by n.e of what a slope does: where tips bear, that is a little less
    for other, rel, near in ((two, 1e-12, 1e-15), (tilted, 1e-4, 2e-9)):
        np.testing.assert_allclose(other.stiffness.values, one.stiffness.values, rtol=rel)
        np.testing.assert_allclose(other.transmission_error.values, one.transmission_error.values, atol=near)
        np.testing.assert_allclose(other.tilting.lever.values, one.tilting.lever.values, atol=1e-6)
        assert other.tilting.stiffness == pytest.approx(one.tilting.stiffness, rel=1e-3)
    assert one.tilting.lever.values.min() > 0.0  # the loaded end, for both senses of rotation


def test_a_spur_mesh_alike_along_the_width_keeps_its_curve(tmp_path: Path) -> None:
    content = text(pair="").replace("positions", 'load = "torque"\npositions') + SIDES.replace("left", "right")
    job = read(tmp_path, content)
    (curve,) = train_curves(job)
    assert type(curve).__name__ == "StiffnessCurve"


def test_a_mean_has_the_force_of_the_load() -> None:
    """F = k (delta - e) at the given approach is the force of the sweep, for both kinds."""
    pitch = 0.3
    angle = pitch * np.arange(12) / 12
    swing = np.cos(2.0 * math.pi * angle / pitch)
    states = WidthStates(
        angle,
        force=np.full(12, 1500.0),
        approach=1e-5 + 1e-6 * swing,
        stiffness=2e8 + 3e7 * np.sin(21.0 * angle),
        lever=1e-3 * swing,
        moment=2.0 - swing,
        against_tilting=np.full(12, 700.0),
    )
    varying, mean = (mesh_spring(states, pitch, mean=mean) for mean in (False, True))
    for table in (varying, mean):
        k = table.stiffness if isinstance(table.stiffness, float) else table.stiffness(angle).value
        force = k * (states.approach - table.transmission_error(angle).value)
        np.testing.assert_allclose(force, 1500.0, rtol=1e-12)
        assert table.tilting is not None
        moment = table.tilting.lever(angle).value * force + table.tilting.moment(angle).value
        np.testing.assert_allclose(moment, states.moment, rtol=1e-12)
        assert table.tilting.stiffness == pytest.approx(700.0, rel=1e-12)
    assert isinstance(mean.stiffness, float)
    assert mean.stiffness == pytest.approx(varying.stiffness.mean, rel=1e-12)


REFUSED = [
    (text().replace("torque_Nm = 75.0", "torque_Nm = 0.0"), "carries no torque, so its stiffness along the face"),
    (text().replace("torque_Nm = 75.0", "torque_Nm = 7e5"), "must be <="),
    (text().replace("coarsen = 2.0", 'plane = "stress"'), "stiffness.plane = 'stress': is for loads alike along"),
    (text() + UNEVEN, "has pitch errors, and pair.misalignment_um makes the load vary"),
    (text().replace("damping_N_s", "backlash_um = 40.0\ndamping_N_s") + SIDES, "left and right flanks differ"),
    (text().replace("positions = 24", 'load = "stiffness"'), "no load: neither twist_deg nor torque_Nm is given"),
]


@pytest.mark.parametrize(("content", "message"), REFUSED)
def test_what_a_spring_along_the_width_refuses(content: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        model_of(read(tmp_path, content))


def test_the_load_of_the_stiffness_table_counts_where_the_job_says_so(tmp_path: Path) -> None:
    content = text().replace("positions = 24", 'load = "stiffness"').replace(
        "coarsen = 2.0", "coarsen = 2.0\ntorque_Nm = 75.0\nangle_step_deg = 0.75"
    )  # fmt: skip
    (one,), (two,) = train_curves(read(tmp_path, content)), train_curves(read(tmp_path, text()))
    np.testing.assert_allclose(one.stiffness.values, two.stiffness.values, rtol=1e-9)
