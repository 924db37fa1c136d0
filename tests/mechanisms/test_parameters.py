"""[parameters] of a mechanism file: a file with them is the file with their numbers, and mistakes are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfe.base.config import read_toml
from gearfe.base.errors import InputError
from gearfe.base.tables.mechanism import mechanism_tables, read_mechanism_file
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.sensitivity import sensitivities
from gearfe.mechanisms.solve import solve, sweep
from tests.makers.files import mechanism_file

PENDULUM = """
title = "a pendulum"
{parameters}
[run]
end_s = 1.0
step_s = 0.01
frames = {frames}
[ground.points_m]
O = [{half}, 0.0]
[bodies.rod]
mass_kg = {mass}
inertia_kg_m2 = {inertia}
centre_m = [{half}, 0.0]
position_m = [{half}, 0.0]
angle_deg = -60.0
points_m = {{ tip = [{length}, 0.0] }}
[joints.O]
type = "hinge"
body = "rod"
to_point = "O"
[forces.gravity]
type = "gravity"
acceleration_m_per_s2 = [0.0, {gravity}]
[forces.drag]
type = "moment"
body = "rod"
moment_N_m = "{drag}"
[start.velocities]
"rate(rod)" = {rate}
[[outputs]]
name = "share"
value = "x(rod.tip) / {l}"
"""
NUMBERS = {
    "parameters": "", "frames": 20, "half": 0.4, "mass": 2.0, "inertia": 2.0 * 0.8**2 / 12.0, "length": 0.8,
    "gravity": -9.81, "drag": "-0.3 * rate(rod)", "rate": 1.5, "l": "0.8",
}  # fmt: skip
NAMED = {
    "parameters": '[parameters]\nl = 0.8\nm = 2\nhalf = "l/2"\nc = 0.3\ng = -9.81\nn = 10\n', "frames": '"2*n"',
    "half": '"half"', "mass": '"m"', "inertia": '"m*l**2/12"', "length": '"l"', "gravity": '"g"',
    "drag": "-c * rate(rod)", "rate": '"3*half + 0.3"', "l": "l",
}  # fmt: skip


def test_a_file_with_parameters_is_the_one_with_their_numbers(tmp_path: Path) -> None:
    plain = mechanism_tables(read_toml(mechanism_file(tmp_path, PENDULUM.format(**NUMBERS))))
    named = mechanism_file(tmp_path, PENDULUM.format(**NAMED))
    tables = read_mechanism_file(named)
    assert tables.parameters == {"l": 0.8, "m": 2, "half": 0.4, "c": 0.3, "g": -9.81, "n": 10}
    assert tables.bodies["rod"].inertia_kg_m2 == pytest.approx(NUMBERS["inertia"], rel=1e-15)
    assert tables.run == plain.run
    motion = solve(load_mechanism(named)).results
    again = mechanism_file(tmp_path, PENDULUM.format(**NUMBERS))
    expected = solve(load_mechanism(again)).results
    assert motion is not None
    assert expected is not None
    np.testing.assert_allclose(motion.outputs["share"], expected.outputs["share"], atol=1e-12)


def test_studies_and_slopes_change_a_parameter(tmp_path: Path) -> None:
    """The period of small swings goes with the root of the length: so does the angle over t / sqrt(l)."""
    file = mechanism_file(tmp_path, PENDULUM.format(**NAMED))
    base, longer = sweep(file, [{}, {"parameters.l": 0.9}])
    numbers = {**NUMBERS, "half": 0.45, "length": 0.9, "inertia": 2.0 * 0.9**2 / 12.0, "rate": 1.65, "l": "0.9"}
    written = solve(load_mechanism(mechanism_file(tmp_path, PENDULUM.format(**numbers)))).results
    assert written is not None
    assert not np.allclose(longer.tables["trajectory"]["share"], base.tables["trajectory"]["share"], atol=1e-3)
    np.testing.assert_allclose(longer.tables["trajectory"]["share"], written.outputs["share"], atol=1e-9)
    file = mechanism_file(tmp_path, PENDULUM.format(**NAMED))
    slopes = sensitivities(file, ["parameters.c"])
    by_hand = sweep(file, [{"parameters.c": 0.3 + h} for h in (1e-4, -1e-4)])
    (slope,) = [slopes.slopes[key] for key in slopes.slopes if key[1] == "share"]
    difference = (by_hand[0].tables["trajectory"]["share"] - by_hand[1].tables["trajectory"]["share"]) / 2e-4
    np.testing.assert_allclose(slope, difference, atol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ('half = "l/2"', 'half = "ell/2"', "parameters.half", "unknown name 'ell'"),
        ('half = "l/2"', 'half = "m/(l - 0.8)"', "parameters.half", "has no finite value"),
        ('half = "l/2"', "half = true", "parameters.half", "must be a number"),
        ("l = 0.8", "sin = 0.8", "parameters", "is the name of a function"),
        ("l = 0.8", "time = 0.8", "parameters", "is the name of a function or a quantity"),
        ("l = 0.8", "length = 0.8", "parameters", "name"),
        ("l = 0.8", '"l-1" = 0.8', "parameters", "must be a word"),
        ("l = 0.8", "l = 0.8\nidle = 1.0", "parameters.idle", "is used nowhere"),
        ("l = 0.8", "l = 1" + 400 * "0", "parameters.l", "must be finite"),
        ('mass_kg = "m"', 'mass_kg = "-m"', "bodies.rod.mass_kg", ">= 0"),
        ('mass_kg = "m"', 'mass_kg = "__import__(1)"', "bodies.rod.mass_kg", "__import__"),
        ('frames = "2*n"', 'frames = "n/3"', "run.frames", "whole number"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, field: str, words: str) -> None:
    text = PENDULUM.format(**NAMED)
    assert old in text
    text = text.replace(old, new)
    if new.startswith(("sin", "time", "length")):
        text = text.replace('half = "l/2"', "half = 0.4").replace('"l"', "0.8").replace("m*l**2/12", "m/12")
        text = text.replace("/ l", f"/ {new.split(maxsplit=1)[0]}")
    with pytest.raises(InputError) as caught:
        load_mechanism(mechanism_file(tmp_path, text))
    assert field in caught.value.field
    assert words in str(caught.value)


def test_speeds_in_turns_take_expressions(tmp_path: Path) -> None:
    text = PENDULUM.format(**NAMED).replace("angle_deg = -60.0", 'angle_deg = -60.0\nrate_rpm = "3*n"')
    tables = read_mechanism_file(mechanism_file(tmp_path, text))
    assert tables.bodies["rod"].rate_rad_per_s == pytest.approx(30.0 * 2.0 * np.pi / 60.0, rel=1e-14)


def test_texts_stay_errors_without_parameters(tmp_path: Path) -> None:
    text = PENDULUM.format(**NUMBERS | {"mass": '"heavy"'})
    with pytest.raises(InputError, match=r"mass_kg.*must be a number"):
        load_mechanism(mechanism_file(tmp_path, text))
    text = PENDULUM.format(**NUMBERS | {"parameters": "parameters = 3"})
    with pytest.raises(InputError, match=r"parameters.*must be a table"):
        load_mechanism(mechanism_file(tmp_path, text))
