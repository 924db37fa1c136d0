"""Speeds in 1/min wherever a speed is read: job files, options, --set, functions of time."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gearfe.base.config import JobFile, build, read_toml
from gearfe.base.errors import InputError
from gearfe.base.other_units import in_known_units, partner
from gearfe.base.tables.mechanism import ForceTable, FunctionTable, JointTable
from gearfe.base.tables.rating import RatingTable
from gearfe.base.tables.runup import RunUpTable
from gearfe.base.tables.train import TrainDriveTable
from gearfe.cli.arguments import command_module, parser_of
from gearfe.cli.main import main
from tests.makers.job_texts import SMALL_TRAIN
from tests.places import GEOMETRY

RPM = 2.0 * math.pi / 60.0


def drive(**keys: object) -> TrainDriveTable:
    return build(TrainDriveTable, {"shaft": "one", "attachment": "a", **keys}, "train.drive")


def test_numbers_and_functions_of_time_are_turned() -> None:
    assert drive(speed_rpm=3000).speed_rad_per_s == pytest.approx(3000 * RPM, rel=1e-15)
    table = {
        "constant": 60.0,
        "points_ms": [[0, 0.0], [5, 30.0]],
        "steps": [{"height": 6.0, "centre_ms": 1.0, "width_ms": 1.0}],
        "sines": [{"amplitude": 3.0, "frequency_Hz": 7.0}],
    }
    made = drive(speed_rpm=table).speed_rad_per_s
    assert made.constant == pytest.approx(60 * RPM)
    assert made.points_ms == ((0.0, 0.0), (5.0, pytest.approx(30 * RPM)))
    assert made.steps[0].height == pytest.approx(6 * RPM)
    assert made.steps[0].centre_ms == 1.0
    assert (made.sines[0].amplitude, made.sines[0].frequency_Hz) == (pytest.approx(3 * RPM), 7.0)
    expression = drive(speed_rpm="100 + 2*time").speed_rad_per_s.expression
    value = eval(expression, {"time": 3.0})  # arithmetic of Python's own
    assert value == pytest.approx(106 * RPM)


def test_every_table_with_a_speed_takes_both() -> None:
    run = build(RunUpTable, {"speed_start_rpm": 1000, "speed_stop_rpm": 2000.0, "speeds": 3}, "runup")
    assert (run.speed_start_rad_per_s, run.speed_stop_rad_per_s) == pytest.approx((1000 * RPM, 2000 * RPM))
    rating = build(RatingTable, {"torque_driver_Nm": 1.0, "speed_rad_per_s": 100.0}, "rating")  # the other way round
    assert rating.speed_rpm == pytest.approx(100.0 / RPM)


def test_both_contradict_each_other_and_a_change_replaces_the_other() -> None:
    with pytest.raises(InputError, match="says what speed_rad_per_s says"):
        drive(speed_rpm=3000.0, speed_rad_per_s=300.0)
    with pytest.raises(InputError, match=r"write the key train\.drive\.speed_rad_per_s"):
        drive(speed_rpm={"csv": "speed.csv"})
    assert partner("torque_Nm") == ""
    assert in_known_units({"x_rpm": 1.0}, ["y"], "t") == {"x_rpm": 1.0}  # unknown keys stay as they are


def test_set_and_options(tmp_path: Path) -> None:
    path = tmp_path / "job.toml"
    path.write_text(SMALL_TRAIN, encoding="utf-8")
    raw = read_toml(JobFile(str(path), ["train.drive.speed_rpm=6000"]))
    assert "speed_rad_per_s" not in raw["train"]["drive"]
    assert raw["train"]["drive"]["speed_rpm"] == 6000
    parser = parser_of(command_module("runup"), "gearfe runup", "", "")
    parsed = parser.parse_args([str(path), "--speed-start-rpm", "1500", "--speed-stop-rad-per-s", "200"])
    assert parsed.speed_start_rad_per_s == pytest.approx(1500 * RPM)
    assert parsed.speed_stop_rad_per_s == 200.0
    rating = parser_of(command_module("rating"), "gearfe rating", "", "")
    assert rating.parse_args([str(path), "--speed-rad-per-s", "100"]).speed_rpm == pytest.approx(100.0 / RPM)
    assert rating.parse_args([str(path), "--speed-rpm", "955"]).speed_rpm == 955.0
    assert main(["runup", str(path), "--speed-start-rpm", "1", "--speed-start-rad-per-s", "1"]) == 2
    out = tmp_path / "out"
    line = [
        "vibration",
        str(path),
        "--out",
        str(out),
        "--no-pictures",
        "--no-estimate",
        "--set",
        "train.duration_ms=0.5",
    ]
    assert main([*line, "--set", f"train.drive.speed_rpm={600.0 / RPM!r}"]) == 0
    first = (out / "response.csv").read_text(encoding="utf-8").splitlines()[1]
    assert first.split(",")[3] == "600"  # the speed of the drive, as in the file in rad/s


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"speed_rad_per_s": -5.0}, ["rating.speed_rad_per_s = -5.0:", "(rating.speed_rpm = -47.7465)"]),
        ({"speed_rad_per_s": True}, ["rating.speed_rad_per_s = True: must be a number"]),
        ({"speed_rad_per_s": "fast"}, ["rating.speed_rad_per_s = 'fast': must be a number"]),
    ],
)
def test_errors_name_the_key_that_was_written(keys: dict[str, object], words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        build(RatingTable, {"torque_driver_Nm": 1.0, **keys}, "rating")
    for part in words:
        assert part in str(caught.value)


def test_a_truth_value_is_no_speed_in_revolutions() -> None:
    with pytest.raises(InputError) as caught:
        drive(speed_rpm=True)
    assert str(caught.value).startswith("train.drive.speed_rpm = True")


def test_errors_name_the_option_that_was_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["rating", str(GEOMETRY / "fzg_c.toml"), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert main([*line, "--speed-rad-per-s", "abc"]) == 2
    assert "--speed-rad-per-s: 'abc' must be a number" in capsys.readouterr().err
    assert main([*line, "--speed-rad-per-s", "-5"]) == 2
    message = capsys.readouterr().err
    assert "--speed-rad-per-s = -5" in message
    assert "(--speed-rpm = -47.7465)" in message


def test_terms_of_a_prescribed_rate_have_the_unit_of_the_key() -> None:
    """All terms of a function of time of a mechanism, a step and a sine among them, are in 1/min with the key."""
    terms = {"constant": 30.0, "polynomial": [60.0, 6.0], "step": 90.0, "step_width_s": 2.0, "sine": 3.0}
    joint = {"type": "prescribed", "body": "crank", "coordinate": "rate"}
    made = build(JointTable, {**joint, "motion_rpm": {**terms, "frequency_hz": 5.0}}, "joints.drive").motion_rad_per_s
    assert isinstance(made, FunctionTable)
    assert made.constant == pytest.approx(30.0 * RPM)
    assert made.polynomial == pytest.approx((60.0 * RPM, 6.0 * RPM))
    assert (made.step, made.sine) == pytest.approx((90.0 * RPM, 3.0 * RPM))
    assert (made.step_width_s, made.frequency_hz) == (2.0, 5.0)
    with pytest.raises(InputError, match=r"motion_rpm\.table.*values in rad/s"):
        build(JointTable, {**joint, "motion_rpm": {"table": "drive"}}, "joints.drive")


@pytest.mark.parametrize(
    ("table", "keys", "words"),
    [
        (
            JointTable,
            {"type": "prescribed", "body": "a", "coordinate": "x", "motion": 3.0},
            "motion_rad_per_s = 3.0 or motion_m = 3.0",
        ),
        (
            ForceTable,
            {"type": "spring", "body": "a", "stiffness": 3.0},
            "stiffness_N_per_m = 3.0 or stiffness_Nm_per_rad = 3.0",
        ),
        (
            ForceTable,
            {"type": "spring", "body": "a", "damping": 3.0},
            "damping_N_s_per_m = 3.0 or damping_Nm_s_per_rad = 3.0",
        ),
        (
            ForceTable,
            {"type": "coordinate_spring", "body": "a", "coordinate": "angle", "reference": 3.0},
            "reference_m = 3.0 or reference_rad = 3.0",
        ),
        (
            ForceTable,
            {"type": "coordinate_spring", "body": "a", "coordinate": "angle", "stiffness_N_per_m": 3.0},
            "has another unit than coordinate = 'angle'; write stiffness_Nm_per_rad",
        ),
    ],
)
def test_keys_without_a_unit_are_answered_with_those_that_have_one(table: type, keys: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        build(table, keys, "part")
