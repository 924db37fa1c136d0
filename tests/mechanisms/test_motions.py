"""Motions by expressions of the time: the function and its derivatives, files that use them, and those refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.expressions import Names, parse
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.motions import DEGREE, time_function_of
from gearfe.mechanisms.solve import solve
from gearfe.multibody import TimeFunction
from tests.makers.files import mechanism_file

CRANK = """
[run]
end_s = 2.0
step_s = 0.02
[bodies.crank]
mass_kg = 1.0
inertia_kg_m2 = 0.1
[joints.O]
type = "hinge"
body = "crank"
[joints.drive]
type = "prescribed"
body = "crank"
coordinate = "angle"
motion_rad = {motion}
[[outputs]]
name = "angle_rad"
value = "angle(crank)"
[[outputs]]
name = "acceleration"
value = "angular_acceleration(crank)"
"""


def function(text: str, end: float = 3.0) -> TimeFunction:
    return time_function_of(parse(text, "motion", Names(("time",))), text, "motion", end)


@pytest.mark.parametrize(
    ("text", "derivatives"),
    [
        ("sin(3*time)**2", (lambda t: np.sin(3 * t) ** 2, lambda t: 3 * np.sin(6 * t), lambda t: 18 * np.cos(6 * t))),
        ("exp(-time)*time", (lambda t: t * np.exp(-t), lambda t: (1 - t) * np.exp(-t), lambda t: (t - 2) * np.exp(-t))),
        ("tanh(40*(time - 1))", (
            lambda t: np.tanh(40 * (t - 1)),
            lambda t: 40 / np.cosh(40 * (t - 1)) ** 2,
            lambda t: -3200 * np.tanh(40 * (t - 1)) / np.cosh(40 * (t - 1)) ** 2,
        )),
        ("cos(2*pi*1000*time/3)", (lambda t: np.cos(2 * np.pi * 1000 * t / 3),)),  # whole periods between samples
        ("2*pi", (lambda t: 2 * np.pi + 0 * t, lambda t: 0 * t)),
    ],
)  # fmt: skip
def test_pieces_follow_the_expression_and_its_derivatives(text, derivatives) -> None:  # type: ignore[no-untyped-def]
    """Markov's inequality: a polynomial's slope is at most n^2 over half the width of its piece times its size.

    Rounding in the time of a fast function counts, too.
    """
    made, times = function(text), np.linspace(0.0, 3.0, 4321)
    shortest = 0.5 * min(np.diff([0.0, *made.breaks, 3.15]))
    for order, exact in enumerate(derivatives):
        rounding = 1e-12 + 4 * np.finfo(float).eps * 3.0 * np.abs(made(times, 1)).max()
        bound = rounding * (DEGREE**2 / shortest) ** order
        np.testing.assert_allclose(made(times, order), exact(times), rtol=0.0, atol=bound)


def test_a_motion_by_expression_is_that_by_terms(tmp_path: Path) -> None:
    terms = "{ sine = 0.3, frequency_hz = 0.8, phase_deg = 20.0, polynomial = [0.1, 0.5] }"
    text = f'"0.3*sin(2*pi*0.8*time + {math.radians(20.0)!r}) + 0.1 + 0.5*time"'
    one, two = (
        solve(load_mechanism(mechanism_file(tmp_path, CRANK.format(motion=motion)))).results for motion in (terms, text)
    )
    assert one is not None
    assert two is not None
    for name, bound in (("angle_rad", 1e-12), ("acceleration", 1e-9)):
        np.testing.assert_allclose(two.outputs[name], one.outputs[name], rtol=0.0, atol=bound)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ('"abs(time - 1)"', "is not smooth"),
        ('"max(time, 1.3)"', "is not smooth"),
        ('"1/(time - 1)"', "has no value at 1 s"),
        ('"sqrt(time - 0.5)"', "has no value at 0 s"),
        ('"angle(crank)"', "time"),
        ('"omega*time"', "omega"),
        ('"sin(1e9*time)"', "is not smooth, or too fast"),
    ],
)
def test_motions_that_cannot_be_prescribed_are_refused(tmp_path: Path, motion: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        load_mechanism(mechanism_file(tmp_path, CRANK.format(motion=motion)))
    assert "joints.drive.motion" in caught.value.field
    assert words in str(caught.value)


def test_reactions_are_outputs(tmp_path: Path) -> None:
    """A body driven about its centre asks for J alpha; the hinge of a turning one for its weight and m r omega^2."""
    text = CRANK.format(motion='"3*time"').replace("inertia_kg_m2 = 0.1", "inertia_kg_m2 = 0.1\ncentre_m = [0.2, 0.0]")
    text += """
[forces.gravity]
type = "gravity"
acceleration_m_per_s2 = [0.0, -9.81]
"""
    outputs = {"x": "reaction_x(O)", "y": "reaction_y(O) - 9.81", "moment": "reaction_moment(drive)"}
    text += "".join(f'[[outputs]]\nname = "{name}"\nvalue = "{value}"\n' for name, value in outputs.items())
    results = solve(load_mechanism(mechanism_file(tmp_path, text))).results
    assert results is not None
    angle = 3.0 * results.trajectory.time
    for name, expected in (
        ("x", -1.0 * 0.2 * 9.0 * np.cos(angle)),
        ("y", -1.0 * 0.2 * 9.0 * np.sin(angle)),
        ("moment", 1.0 * 9.81 * 0.2 * np.cos(angle)),
    ):
        np.testing.assert_allclose(results.outputs[name], expected, rtol=0.0, atol=1e-9)
    with pytest.raises(InputError, match="joints"):
        load_mechanism(mechanism_file(tmp_path, text.replace("reaction_x(O)", "reaction_x(P)")))
    load = '"reaction_x(O)"'
    with pytest.raises(InputError, match="reaction_x"):
        load_mechanism(mechanism_file(tmp_path, text + f'[forces.f]\ntype = "force"\nbody = "crank"\nx_N = {load}\n'))


@pytest.mark.parametrize("width", [0.001, 0.005, 0.05])
def test_a_short_pulse_is_followed(width: float) -> None:
    """Shorter than the distance of a piece's points, longer than the times at which the pieces are compared."""
    made = function(f"0.5*exp(-((time - 0.37)/{width})**2)", 1.0)
    times = np.linspace(0.0, 1.0, 54_321)
    np.testing.assert_allclose(made(times), 0.5 * np.exp(-(((times - 0.37) / width) ** 2)), rtol=0.0, atol=1e-11)
