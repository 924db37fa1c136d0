"""Steps of collocation so short that differences of positions are rounding: accelerations and reactions stay right."""

from __future__ import annotations

import math
from math import cos, sin

import numpy as np
import pytest

from gearfe.multibody import Body, CoordinateSpring, Fixed, Gravity, Hinge, Linkage, System, TimeFunction, integrate
from gearfe.multibody.planar.beam import Beam
from gearfe.multibody.planar.beam_link import BeamLink, Section
from gearfe.multibody.planar.forces import Moment
from tests.makers.rigid_cases import G, folding_links

METHODS = ["implicit", "symplectic"]


def torque(breaks: tuple[float, ...]) -> TimeFunction:
    """5 N m at all times, with times at which steps have to end."""
    pieces = len(breaks) + 1
    return TimeFunction((-math.inf, *breaks), (0.0,) * pieces, ((5.0,),) * pieces)


def rod(breaks: tuple[float, ...]) -> System:
    """A rod of 1 kg and 1 m under gravity and a torque."""
    body = Body("rod", 1.0, 1 / 12, (0.5, 0.0), (0.0, 0.0), 0.3)
    return System([Linkage((body,), (Hinge("rod", "ground"),), (Gravity((0.0, -G)), Moment("rod", torque(breaks))))])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("step", [1e-12, 1e-10, 1e-8, 1e-6])
def test_accelerations_between_two_near_breaks(method: str, step: float) -> None:
    """From the equation of motion in the angle, (1/3) a = 5 - (g/2) cos; the hinge carries m (a_centre + g)."""
    times = np.array([0.0, 0.5, 0.5 + 0.3 * step, 0.5 + step, 0.6])
    made = integrate(rod((0.5, 0.5 + step)), times, method=method, tolerance=1e-9)
    angle, rate = made.q[1:, 2], made.v[1:, 2]
    pull = 3.0 * (5.0 - 0.5 * G * np.cos(angle))
    np.testing.assert_allclose(made.a[1:, 2], pull, rtol=1e-5)
    arm = np.array([np.cos(angle), np.sin(angle)]) / 2
    centre = pull * np.array([-arm[1], arm[0]]) - rate**2 * arm
    np.testing.assert_allclose(
        np.abs(made.multipliers[1:]), np.abs(centre.T + np.array([0.0, G])), rtol=1e-6, atol=1e-6
    )


def test_the_last_row_of_a_run_is_as_exact_as_the_others() -> None:
    """Folding links: (2/3 + 2 sin^2) a + 2 sin cos w^2 + g cos = 0; equal steps of 1/283 s leave 1e-14 s at the end."""
    made = integrate(folding_links(), np.linspace(0.0, 1.0, 101), method="symplectic", tolerance=1e-9)
    for angle, rate, pull in np.column_stack([made.q[:, 2], made.v[:, 2], made.a[:, 2]]):
        s, c = sin(angle), cos(angle)
        if abs(c) > 0.2:  # the hinges say little about the angle where the links fold
            assert (2 / 3 + 2 * s * s) * pull == pytest.approx(-2 * s * c * rate**2 - G * c, abs=2e-5)
    assert np.diff(made.dense.times).min() > 1e-6


@pytest.mark.parametrize("step", [1e-11, 1e-8])
def test_a_flexible_link_between_two_near_breaks(step: float) -> None:
    """Accelerations, root force and stresses go on smoothly through the short step."""
    section = Section(1e-4, 1e-9, 0.01)
    link = BeamLink("beam", 1.0, section, 2e11, 7800.0, elements=2, damping=1e-4)
    held = Moment(link.node_names[-1], torque((0.01, 0.01 + step)))
    linkage = Linkage(link.nodes(), (Fixed("beam"),), (Gravity((0.0, -G)), held))
    beam = Beam(linkage, link)
    times = np.array([0.0, 0.01 - 1e-7, 0.01 + 0.4 * step, 0.01 + 1e-7, 0.012])
    made = integrate(System([linkage, beam]), times, method="implicit", tolerance=1e-9)
    for values in (made.a, made.multipliers, made.stress_at(beam, times).reshape(5, -1)):
        size = np.abs(values[1:4]).max()
        np.testing.assert_allclose(values[2], 0.5 * (values[1] + values[3]), atol=2e-3 * size)


def test_springs_at_rest_have_no_acceleration() -> None:
    """All steps of a body at rest are straight lines."""
    body = Body("block", 1.0, 0.1, (0.0, 0.0), (2.0, 0.0))
    system = System([Linkage((body,), (), (CoordinateSpring("block", "x", 100.0, 1.0, 2.0),))])
    made = integrate(system, np.linspace(0.0, 10.0, 11), method="implicit", tolerance=1e-9)
    assert np.abs(made.a).max() == 0.0
