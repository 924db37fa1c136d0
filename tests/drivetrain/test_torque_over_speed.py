"""Torques over speed: fans, motors and tables, by closed forms; the operating point; run-ups; mistakes in files."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.text import toml_document
from gearfe.base.tables.timefunction import SpeedFunctionTable
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.gearbox.over_speed import operating_speed
from gearfe.drivetrain.gearbox.timefunctions import speed_function
from gearfe.drivetrain.modes.job import at_speed
from gearfe.drivetrain.modes.whirl import train_modes
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.train import Damping, Drive, GearTrain, SpeedCurve, build_train, simulate
from gearfe.drivetrain.train.simulate import unbalanced
from gearfe.multibody import TimeFunction, constant
from tests.makers.gearboxes import tables
from tests.makers.trains import base_radius, changed, curve, train

RATIO = 20 / 30


def function(largest: float = 0.0, **keys: Any) -> TimeFunction:
    return speed_function(build(SpeedFunctionTable, keys, "key"), "key", Path(), largest)


def from_rest(motor: TimeFunction, *, reference: float = 0.0, load: TimeFunction | None = None) -> GearTrain:
    """A rigid chain that a torque over speed starts from rest, against a load over speed or none."""
    made = train([(20, 30)], stiffness=None)
    over = SpeedCurve(motor, reference)
    drive = Drive("s0", "s0+", constant(0.0), torque=constant(over.steady), over_speed=over)
    if load is None:
        return changed(made, drive=drive, loads=())
    fan = SpeedCurve(load, -RATIO * reference)
    loads = (dataclasses.replace(made.loads[0], torque=constant(fan.steady), over_speed=fan),)
    return changed(made, drive=drive, loads=loads)


def inertia(gear_train: GearTrain) -> float:
    one, two = (body.rotor.polar for body in build_train(gear_train).shafts)
    return float(one + two * RATIO**2)


@pytest.mark.parametrize("method", ["taylor", "implicit"])
@pytest.mark.parametrize("reference", [0.0, 120.0])
def test_a_fan_is_spun_up_by_the_hyperbolic_tangent(method: str, reference: float) -> None:
    """J w' = M - c w^2: w = sqrt(M/c) tanh(sqrt(M c) t/J), whatever speed counts as steady."""
    torque, fan = 30.0, 1e-3
    motor = function(400.0, expression=f"{torque} - {fan}*speed*abs(speed)")
    given = from_rest(motor, reference=reference)
    t, final = np.linspace(0.0, 0.02, 41), math.sqrt(torque / fan)
    response = simulate(build_train(given), t, tolerance=1e-10, method=method)
    expected = final * np.tanh(math.sqrt(torque * fan) / inertia(given) * t)
    np.testing.assert_allclose(response.speed[:, 0], expected, atol=1e-8 * final)
    np.testing.assert_allclose(response.drive_torque, torque - fan * expected**2, atol=1e-7 * torque)
    assert expected[-1] > 0.99 * final


def test_a_fan_on_the_other_shaft_brakes_by_its_own_speed() -> None:
    """Reduced to the drive the fan is c g^3 w^2: the same closed form; the load turns backwards."""
    torque, fan = 30.0, 3e-3
    load = function(400.0, expression=f"-{fan}*speed*abs(speed)")
    given = from_rest(constant(torque), load=load)
    t, reduced = np.linspace(0.0, 0.02, 41), fan * RATIO**3
    response = simulate(build_train(given), t, tolerance=1e-10)
    expected = math.sqrt(torque / reduced) * np.tanh(math.sqrt(torque * reduced) / inertia(given) * t)
    np.testing.assert_allclose(response.speed[:, 1], -RATIO * expected, atol=1e-8 * expected.max())


@pytest.mark.parametrize(("reference", "balances"), [(100.0, True), (60.0, False)])
def test_torques_that_do_not_balance_at_the_steady_speed_are_named(reference: float, balances: bool) -> None:
    """A motor of constant torque, and a fan behind gears that takes as much at 100 rad/s of the motor."""
    fan = 1e-2
    motor = function(400.0, expression=f"{RATIO**3 * fan * 100.0**2} + 0*speed")
    load = function(400.0, expression=f"-{fan}*speed*abs(speed)")
    model = build_train(from_rest(motor, reference=reference, load=load))
    assert (unbalanced(model) == []) == balances


def test_a_motor_that_falls_in_a_line_is_the_slope() -> None:
    """A DC motor, M0 (1 - w/w0): the exponential, and the same as `slope`."""
    stall, idle = 40.0, 300.0
    given = from_rest(function(900.0, expression=f"{stall}*(1 - speed/{idle})"))
    t = np.linspace(0.0, 0.02, 41)
    response = simulate(build_train(given), t, tolerance=1e-10)
    expected = idle * (1.0 - np.exp(-stall / idle * t / inertia(given)))
    np.testing.assert_allclose(response.speed[:, 0], expected, atol=1e-8 * idle)
    drive = Drive("s0", "s0+", constant(0.0), torque=constant(stall), slope=stall / idle)
    sloped = simulate(build_train(changed(given, drive=drive)), t, tolerance=1e-10)
    np.testing.assert_allclose(response.speed, sloped.speed, atol=1e-8 * idle)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_tables_against_another_integrator(method: str, interpolation: str) -> None:
    """A motor's table with its breaks: scipy's DOP853 on J w' = T(w) from break to break."""
    speed, torque = np.array([0.0, 60.0, 110.0, 150.0, 180.0]), np.array([20.0, 26.0, 40.0, 24.0, 0.0])
    given = from_rest(
        function(
            points_rad_per_s_Nm=[list(row) for row in zip(speed, torque, strict=True)], interpolation=interpolation
        )
    )
    t = np.linspace(0.0, 0.03, 61)
    response = simulate(build_train(given), t, tolerance=1e-9, method=method)
    at = PchipInterpolator(speed, torque) if interpolation == "cubic" else lambda w: np.interp(w, speed, torque)
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-10, "max_step": 5e-5}
    J = inertia(given)
    expected = solve_ivp(lambda _, w: at(w) / J, (0.0, t[-1]), [0.0], t_eval=t, **options).y[0]
    assert expected[-1] > 170.0
    np.testing.assert_allclose(response.speed[:, 0], expected, atol=1e-6 * expected.max())


def test_steps_end_at_the_breaks_of_a_table() -> None:
    """Straight pieces: between two breaks w' is linear in w, so Taylor's series reach 1e-9 in few steps."""
    given = from_rest(function(points_rad_per_s_Nm=[[0.0, 20.0], [60.0, 30.0], [120.0, 10.0]], interpolation="linear"))
    J, rises, falls = inertia(given), 10.0 / 60.0, 20.0 / 60.0
    reached = J / rises * math.log(1.0 + rises * 60.0 / 20.0)  # 60 rad/s, where the pieces meet
    t = np.array([0.0, 0.7 * reached, reached + 0.5 * J / falls])
    response = simulate(build_train(given), t, tolerance=1e-12)
    before = 20.0 / rises * (math.exp(rises / J * t[1]) - 1.0)
    after = 60.0 + 30.0 / falls * (1.0 - math.exp(-0.5))
    assert response.speed[1:, 0] == pytest.approx([before, after], rel=1e-9)
    assert response.statistics["steps"] < 20


def test_shapes_of_tables_and_expressions() -> None:
    table = function(points_rad_per_s_Nm=[[-10.0, 5.0], [0.0, 5.0], [20.0, -3.0]])
    np.testing.assert_allclose(table(np.array([-50.0, -10.0, 0.0, 20.0, 70.0])), [5.0, 5.0, 5.0, -3.0, -3.0])
    assert float(table(0.0, 1)) == pytest.approx(0.0, abs=1e-12)  # monotone: nothing overshoots
    assert float(table(np.linspace(-60.0, 60.0, 999)).max()) <= 5.0 + 1e-12
    kloss = function(500.0, expression="2*80*0.2*(1 - speed/157)/((1 - speed/157)**2 + 0.2**2)")
    slip = 1.0 - np.linspace(-490.0, 490.0, 333) / 157.0
    np.testing.assert_allclose(kloss(157.0 * (1.0 - slip)), 160.0 * 0.2 * slip / (slip**2 + 0.04), atol=1e-8)
    assert float(kloss(600.0)) == pytest.approx(float(kloss(500.0)), rel=1e-9)
    assert float(constant(3.0)(1.0)) == float(function(points_rad_per_s_Nm=[[7.0, 3.0]])(1.0))


def test_a_run_up_has_the_torque_of_each_speed() -> None:
    """A fan in a run-up: the mean force of the mesh is that of its torque there; the transient agrees."""
    fan = 4e-4
    load = SpeedCurve(function(3000.0, expression=f"-{fan}*speed*abs(speed)"), -RATIO * 600.0)
    made = train([(20, 30)], stiffness=lambda teeth: curve(teeth, swing=0.1))
    loads = (dataclasses.replace(made.loads[0], torque=constant(load.steady), over_speed=load),)
    made = changed(made, loads=loads, damping=Damping(ratio=0.05))
    model, speeds = build_train(made), np.array([300.0, 600.0, 900.0])
    run = run_up(model, speeds, tolerance=1e-6, band_hz=5000.0)
    assert len(run.states) == 3
    for state, speed in zip(run.states, speeds, strict=True):
        expected = fan * (RATIO * speed) ** 2 / base_radius(30)
        assert state.force[:, 0].mean() == pytest.approx(expected, rel=1e-4)
    slower = changed(made, drive=dataclasses.replace(made.driven, speed=constant(300.0)))
    response = simulate(build_train(slower), np.linspace(0.0, 0.6, 60001), tolerance=1e-9)
    late = response.contact_force[response.time > 0.6 - 2 * math.pi / 300.0, 0]
    state = steady_state(model, 300.0, tolerance=1e-6)
    assert np.ptp(state.force[:, 0]) == pytest.approx(np.ptp(late), rel=5e-3)


def test_modes_have_the_slope_at_the_operating_point() -> None:
    """A torque over speed damps as its straight line: one and the same damping as by `slope`."""
    fan = 4e-4
    load = SpeedCurve(function(3000.0, expression=f"-{fan}*speed*abs(speed)"), -400.0)
    made = changed(train([(20, 30)]), damping=Damping(gyroscopic=False))
    one = dataclasses.replace(made.loads[0], torque=constant(load.steady), over_speed=load)
    two = dataclasses.replace(made.loads[0], torque=constant(load.steady), slope=2.0 * fan * 400.0)
    damped = [train_modes(build_train(changed(made, loads=(x,))), [600.0], 1e5).damping_ratio for x in (one, two)]
    assert (damped[0] > 0.0).any()
    np.testing.assert_allclose(damped[0], damped[1], rtol=1e-9)


# --- job files ------------------------------------------------------------------------------------------------------


def job(load: dict[str, Any], drive: dict[str, Any] | None = None) -> dict[str, Any]:
    """The worked gearbox of three meshes with other torques."""
    made = tables()
    made["train"]["loads"] = [{"shaft": "s4", **load}]
    made["train"]["drive"] |= drive or {}
    return made


def written(path: Path, content: dict[str, Any]) -> Path:
    path.write_text(toml_document(content))
    return path


FAN = {"torque_over_speed": "-2e-3*speed*abs(speed)"}


def test_the_operating_point_of_a_prescribed_speed(tmp_path: Path) -> None:
    read = read_train_job(written(tmp_path / "job.toml", job(FAN)))
    made = job_train(read)
    speed = float(made.driven.speed(0.0))
    turns = speed * float(made.kinematics.ratios[made.shaft_number("s4")])
    assert float(made.loads[0].torque(0.0)) == pytest.approx(-2e-3 * turns * abs(turns), rel=1e-9)
    assert operating_speed(made) == pytest.approx(speed)
    slow = job_train(at_speed(read, 0.1 * speed))
    assert float(slow.loads[0].torque(0.0)) == pytest.approx(float(made.loads[0].torque(0.0)), rel=1e-9)


@pytest.mark.parametrize("nominal", [150.0, 0.0])
def test_motor_and_fan_meet(tmp_path: Path, nominal: float) -> None:
    """M0 (1 - w/w0) = c g^3 w^2 of a motor and a fan behind gears, from a nominal speed or from rest."""
    motor = {
        "speed_rad_per_s": nominal,
        "torque_over_speed": {"expression": "50*(1 - speed/200)", "largest_speed_rad_per_s": 400.0},
    }
    fan = {"torque_over_speed": {"expression": "-2e-2*speed*abs(speed)", "largest_speed_rad_per_s": 600.0}}
    made = job_train(read_train_job(written(tmp_path / "job.toml", job(fan, motor))))
    ratio = abs(float(made.kinematics.ratios[made.shaft_number("s4")]))
    reduced = 2e-2 * ratio**3
    expected = (-50 / 200 + math.sqrt((50 / 200) ** 2 + 4 * reduced * 50)) / (2 * reduced)
    assert operating_speed(made) == pytest.approx(expected, rel=1e-9)
    assert made.driven.torque is not None
    assert float(made.driven.torque(0.0)) == pytest.approx(50 * (1 - expected / 200), rel=1e-9)


def test_files_report_the_operating_point(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "fan.csv").write_text("speed_rad_per_s,torque_Nm\n-40,40\n0,0\n40,-40\n")
    content = job({"torque_over_speed": {"csv": "fan.csv"}})
    content["train"] |= {"duration_ms": 0.5, "step_us": 50.0, "curves": {"mesh_model": "mean_stiffness"}}
    for mesh in content["meshes"].values():
        mesh["stiffness_N_per_m"] = 3e8
    path = written(tmp_path / "job.toml", content)
    assert main(["vibration", str(path), "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    printed = capsys.readouterr()
    assert "operating point: drive at" in printed.out
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert abs(summary["operating_point"]["torques_over_speed_Nm"]["load_1"]) <= 40.0
    speed = summary["operating_point"]["drive_speed_rad_per_s"]
    assert speed == content["train"]["drive"]["speed_rad_per_s"]
    content["train"]["loads"][0]["torque_over_speed"] = {"points_rad_per_s_Nm": [[-1.0, 1.0], [1.0, -1.0]]}
    path = written(tmp_path / "narrow.toml", content)
    assert main(["vibration", str(path), "--out", str(tmp_path / "narrow"), "--no-pictures"]) == 0
    summary = json.loads((tmp_path / "narrow" / "summary.json").read_text())
    assert any("is known from -1 to 1 rad/s" in sentence for sentence in summary["warnings"])


def at(key: str, value: Any) -> dict[str, Any]:
    return {"torque_over_speed": {key: value}}


#: The same torque at all speeds.
LEVEL = {"points_rad_per_s_Nm": [[0.0, 1.0]]}
WRONG: list[tuple[dict[str, Any], dict[str, Any], str, str]] = [
    ({}, {}, "train.loads[0].torque_Nm", "add it, or torque_over_speed"),
    ({"torque_over_speed": {}}, {}, "train.loads[0].torque_over_speed", "give points"),
    (at("expression", "-log(speed)"), {}, "torque_over_speed.expression", "has no value at"),
    (at("expression", "-5*speed/abs(speed + 1e-9)"), {}, "torque_over_speed.expression", "jumps at"),
    (at("expression", "-time"), {}, "torque_over_speed.expression", "time"),
    (at("points_rad_per_s_Nm", [[0.0, 1.0], [0.0, 2.0]]), {}, "torque_over_speed.points_rad_per_s_Nm[1]", "rad/s"),
    ({"torque_over_speed": {**LEVEL, "expression": "1"}}, {}, "expression", "conflicts with points_rad_per_s_Nm"),
    ({"torque_over_speed": {**LEVEL, "largest_speed_rad_per_s": 9.0}}, {}, "largest_speed", "leave it"),
    (at("points", [[0.0, 1.0]]), {}, "torque_over_speed.points", "write points_rad_per_s_Nm = [[0.0, 1.0]]"),
    (at("csv", "none.csv"), {}, "torque_over_speed.csv", "none.csv"),
    ({**FAN, "ramp_width_ms": 1.0}, {}, "ramp_width_ms", "has no ramp"),
    (FAN, {"speed_rad_per_s": 0.0, "torque_Nm": 10.0}, "largest_speed_rad_per_s", "is required"),
    (FAN, {**FAN, "stiffness_Nm_per_rad": 1e4}, "drive.stiffness_Nm_per_rad", "conflicts with torque_over_speed"),
]  # fmt: skip


@pytest.mark.parametrize(("load", "drive", "field", "text"), WRONG, ids=range(len(WRONG)))
def test_mistakes_are_named(load: dict[str, Any], drive: dict[str, Any], field: str, text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        _ = job_train(read_train_job(written(tmp_path / "job.toml", job(load, drive))))
    assert field in str(error.value), str(error.value)
    assert text in str(error.value), str(error.value)
    assert error.value.cure


def test_a_curve_of_a_drive_by_speed_and_sines_are_refused() -> None:
    made, over = train([(20, 30)]), SpeedCurve(constant(1.0), 0.0)
    with pytest.raises(InputError, match="drive torque over speed"):
        build_train(changed(made, drive=dataclasses.replace(made.driven, over_speed=over)))
    wave = SpeedCurve(TimeFunction(sines=((1.0, 1.0, 0.0),)), 0.0)
    with pytest.raises(InputError, match="pieces of polynomials"):
        build_train(changed(made, loads=(dataclasses.replace(made.loads[0], over_speed=wave),)))
