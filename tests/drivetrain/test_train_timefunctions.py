"""Speeds and torques over time in a job file: numbers in, exact functions and their motion out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.timefunction import TrainFunctionTable
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.timefunctions import PIECES, fitted, time_function
from tests.makers.job_texts import SMALL_TRAIN

TIMES = np.linspace(0.0, 0.1, 4001)


def function(folder=None, **keys):
    return time_function(build(TrainFunctionTable, keys, "f"), "f", folder, 0.1)


def test_points_are_straight_lines_that_hold_at_their_ends(tmp_path):
    made = function(points_ms=[[10, 2.0], [30, 6.0], [50, 5.0]])
    np.testing.assert_allclose(made(TIMES), np.interp(TIMES, [0.01, 0.03, 0.05], [2.0, 6.0, 5.0]), atol=1e-13)
    assert made.ends
    (tmp_path / "f.csv").write_text("time_ms,value\n10,2.0\n30,6.0\n50,5.0\n")
    assert function(tmp_path, csv="f.csv") == made
    smooth = function(points_ms=[[0, 0.0], [20, 6.0], [50, 5.0]], interpolation="cubic")
    assert smooth(np.array([0.0, 0.02, 0.05, 0.08])).tolist() == pytest.approx([0.0, 6.0, 5.0, 5.0])
    assert np.abs(np.diff(smooth(TIMES[TIMES < 0.05], 1))).max() < 1.5  # its slope does not jump between points
    assert smooth(TIMES).max() == pytest.approx(6.0)  # monotone: nothing rings


def test_parts_add_up():
    made = function(
        constant=1.0, points_ms=[[0, 0.0], [100, 10.0]], steps=[{"height": 3.0, "centre_ms": 50.0, "width_ms": 20.0}],
        sines=[{"amplitude": 0.5, "frequency_Hz": 40.0, "phase_deg": 90.0}], expression="2*time",
    )  # fmt: skip
    x = np.clip((TIMES - 0.04) / 0.02, 0.0, 1.0)
    step = 3.0 * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    expected = 1.0 + 100.0 * TIMES + step + 0.5 * np.cos(80.0 * math.pi * TIMES) + 2.0 * TIMES
    np.testing.assert_allclose(made(TIMES), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "exact", "pieces"),
    [
        ("600", lambda t: 600.0 + 0 * t, 1),
        ("100 + 5000*time - 3e5*time**3", lambda t: 100 + 5000 * t - 3e5 * t**3, 1),
        ("600 + 20*sin(2*pi*50*time)", lambda t: 600 + 20 * np.sin(100 * np.pi * t), 20),
        ("500*exp(-time/0.01)", lambda t: 500 * np.exp(-t / 0.01), 20),
        ("min(6000*time, 300)", lambda t: np.minimum(6000 * t, 300), 60),
    ],
)
def test_expressions_become_polynomials(text, exact, pieces):
    made = function(expression=text)
    largest = np.abs(exact(TIMES)).max()
    np.testing.assert_allclose(made(TIMES), exact(TIMES), atol=(1e-6 if "min" in text else 2e-11) * largest)
    assert len(made.starts) <= pieces
    # its integral is the angle: against Simpson's rule on a hundred times as many points
    fine = np.linspace(0.0, 0.1, 200_001)
    y = exact(fine)
    simpson = (fine[1] - fine[0]) / 3 * (y[0] + y[-1] + 4 * y[1:-1:2].sum() + 2 * y[2:-2:2].sum())
    assert float(made.integral()(0.1)) == pytest.approx(simpson, rel=1e-8)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({}, "empty function"),
        ({"points_ms": [[0, 1.0], [0, 2.0]]}, r"points_ms\[1\] = 0.0: must be later"),
        ({"points_ms": [[0, 1.0]], "csv": "a.csv"}, "conflicts with points_ms"),
        ({"csv": "none.csv"}, "there is no such file"),
        ({"csv": "wrong.csv"}, "has no column value"),
        ({"expression": "600 +"}, "not an expression"),
        ({"expression": "600*angle(one)"}, "unknown name 'angle'; known names: abs, .* sin, .* tanh$"),
        ({"expression": "1/(time - 0.05)"}, "time - 0.05"),
        ({"expression": "log(time - 0.05)"}, "has no value at"),
        ({"expression": "atan2(0.05 - time, 0*time)"}, "jumps at 50"),
        ({"expression": "sin(1e6*time)"}, f"more than {PIECES} pieces"),
        ({"steps": [{"height": 1.0, "centre_ms": 5.0}]}, "width_ms"),
        ({"pionts_ms": [[0, 1.0]]}, "did you mean 'points_ms'"),
    ],
)
def test_what_is_no_function_is_told(tmp_path, keys, told):
    (tmp_path / "wrong.csv").write_text("time_ms,torque\n0,1\n")
    with pytest.raises(InputError, match=told):
        function(tmp_path, **keys)


def test_a_fit_is_as_exact_as_it_says():
    made = fitted(lambda t: np.cos(300.0 * t) / (1.0 + 50.0 * t), 0.1, "f", "")
    assert np.abs(made(TIMES) - np.cos(300.0 * TIMES) / (1.0 + 50.0 * TIMES)).max() < 2e-11


DRIVE = "speed_rad_per_s = 600.0"
LOAD = "torque_Nm = 75.0\nramp_centre_ms = 0.25\nramp_width_ms = 0.5"


def job(tmp_path, drive: str = DRIVE, load: str = LOAD):
    path = tmp_path / "job.toml"
    path.write_text(SMALL_TRAIN.replace(DRIVE, drive).replace(LOAD, load))
    return path


def test_a_linear_ramp_turns_as_its_integral(tmp_path, capsys):
    """Speed 200 + 1e5 t: the angle is 200 t + 5e4 t^2, the acceleration of a shaft on a rigid drive 1e5."""
    for drive in ('speed_rad_per_s = "200 + 1e5*time"', "speed_rad_per_s = { points_ms = [[0, 200.0], [2, 400.0]] }"):
        path = job(tmp_path, drive)
        out = tmp_path / "out"
        assert main(["vibration", str(path), "--out", str(out), "--no-pictures", "--no-estimate"]) == 0
        made = np.genfromtxt(out / "response.csv", delimiter=",", names=True)
        t = made["time_s"]
        np.testing.assert_allclose(np.radians(made["drive_angle_deg"]), 200.0 * t + 5e4 * t**2, atol=1e-12)
        np.testing.assert_allclose(made["speed_one_rad_per_s"], 200.0 + 1e5 * t, rtol=1e-12)
        told = capsys.readouterr().out
        assert ("636.6 to 1273.2 Hz" if "time" in drive else "1273.2 Hz") in told  # 20 teeth


def test_a_mistake_in_a_job_is_told_with_its_key(tmp_path, capsys):
    path = job(tmp_path, 'speed_rad_per_s = "600*tme"')
    assert main(["vibration", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "train.drive.speed_rad_per_s.expression" in capsys.readouterr().err
    path = job(tmp_path, "speed_rad_per_s = { points_ms = [[0, 1.0]] }\nramp_width_ms = 1.0")
    assert main(["vibration", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "train.drive.ramp_width_ms = 1.0: conflicts with a function of time" in capsys.readouterr().err
    path = job(tmp_path, load='torque_Nm = "20 - 30*sin(3000*time)"')
    assert main(["vibration", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "back flanks" in capsys.readouterr().err


def test_a_load_that_never_rests_has_no_multipliers(tmp_path, capsys):
    out = ["--out", str(tmp_path / "out"), "--no-pictures", "--no-estimate"]
    for load, changes in (('"75 + 10*sin(9000*time)"', True), ('"75"', False)):
        assert main(["vibration", str(job(tmp_path, load=f"torque_Nm = {load}")), *out]) == 0
        assert ("a load changes all the time" in capsys.readouterr().out) == changes


def test_a_sine_and_its_expression_move_a_train_alike(tmp_path):
    """Speed and load swing, once as exact sines, once as pieces of polynomials: the forces agree to the tolerance."""
    swings = {
        "sines": (
            "{ constant = 600.0, sines = [{ amplitude = 20.0, frequency_Hz = 800.0 }] }",
            "{ constant = 75.0, sines = [{ amplitude = 10.0, frequency_Hz = 300.0, phase_deg = 90.0 }] }",
        ),
        "text": ('"600 + 20*sin(2*pi*800*time)"', '"75 + 10*cos(2*pi*300*time)"'),
    }
    force = []
    for name, (speed, torque) in swings.items():
        path = job(tmp_path, f"speed_rad_per_s = {speed}", f"torque_Nm = {torque}")
        out = tmp_path / name
        assert main(["vibration", str(path), "--out", str(out), "--no-pictures", "--no-estimate"]) == 0
        made = np.genfromtxt(out / "response.csv", delimiter=",", names=True)
        force.append(made["contact_force_1_N"])
        t = made["time_s"]
        np.testing.assert_allclose(made["speed_one_rad_per_s"], 600 + 20 * np.sin(1600 * math.pi * t), rtol=1e-10)
    assert np.ptp(force[0]) > 100.0
    np.testing.assert_allclose(force[0], force[1], atol=1e-6 * np.abs(force[0]).max())
