"""The distance joint: pendulum and tension by theory, and the coupler without mass that it stands for."""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from gearfe.base.errors import InputError
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.results import reactions
from gearfe.multibody import Body, Distance, Gravity, Hinge, Linkage, Slot, System, consistent_start, integrate
from tests.makers.rigid_cases import G, residuals, total_energy


def system(bodies, joints) -> System:  # type: ignore[no-untyped-def]
    return System([Linkage(tuple(bodies), tuple(joints), (Gravity((0.0, -G)),))])


def bob(angle: float, length: float) -> System:
    """A mass on a rod without mass; the rod's ends are off both frames' origins."""
    at = (0.3 + length * sin(angle), 0.2 - length * cos(angle))
    return system([Body("bob", 1.7, 0.2, (0.1, 0.0), (at[0] - 0.1, at[1]))],
                  [Distance("bob", "ground", (0.1, 0.0), (0.3, 0.2), length, "rod")])  # fmt: skip


@pytest.mark.parametrize(("method", "tolerance", "allowed"),
                         [("taylor", 1e-12, 1e-10), ("implicit", 1e-6, 1e-4)])  # fmt: skip
def test_pendulum_period_and_tension(method, tolerance, allowed):
    """Period 4 sqrt(l/g) K(sin(a/2)); tension m (g cos phi + l phi'^2)."""
    angle, length = 1.1, 0.6
    period = 4.0 * sqrt(length / G) * ellipk(sin(angle / 2) ** 2)
    times = np.linspace(0.0, period, 9)
    made = integrate(bob(angle, length), times, method=method, tolerance=tolerance)
    assert made.q[-1] == pytest.approx(made.q[0], abs=allowed)
    x, y = made.q[:, 0] - 0.3, made.q[:, 1] - 0.2
    speed = (made.v[:, :2] ** 2).sum(axis=1)
    tension = 1.7 * (-G * y / length + speed / length)
    np.testing.assert_allclose(made.multipliers[:, 0], tension, rtol=100 * allowed)
    np.testing.assert_allclose(np.hypot(x, y), length, atol=allowed)
    assert np.ptp(total_energy(made)) < 100 * allowed


def test_a_coupler_without_mass_is_a_distance():
    """A four-bar with a coupler of no mass, hinged at both ends, and one with a distance in its place."""
    crank = Body("crank", 1.3, 0.02, (0.2, 0.0), angle=0.6, rate=5.0)
    tip = (0.4 * cos(0.6), 0.4 * sin(0.6))
    rocker = Body("rocker", 0.9, 0.05, (0.4, 0.0), (1.0, 0.0), 1.4)
    end = (1.0 + 0.8 * cos(1.4), 0.8 * sin(1.4))
    length = float(np.hypot(end[0] - tip[0], end[1] - tip[1]))
    slope = float(np.arctan2(end[1] - tip[1], end[0] - tip[0]))
    coupler = Body("coupler", 0.0, 0.0, (0.5 * length, 0.0), tip, slope)
    ends = [Hinge("crank", "ground"), Hinge("rocker", "ground", (0.0, 0.0), (1.0, 0.0))]
    hinged = [*ends, Hinge("crank", "coupler", (0.4, 0.0)), Hinge("coupler", "rocker", (length, 0.0), (0.8, 0.0))]
    held = [*ends, Distance("crank", "rocker", (0.4, 0.0), (0.8, 0.0))]
    times, options = np.linspace(0.0, 1.0, 11), {"method": "taylor", "tolerance": 1e-11}
    first = integrate(system([crank, rocker, coupler], hinged), times, **options)
    second = integrate(system([crank, rocker], held), times, **options)
    np.testing.assert_allclose(second.q, first.q[:, :6], atol=1e-9)
    np.testing.assert_allclose(second.a, first.a[:, :6], atol=1e-6)
    assert max(residuals(second)) < 1e-10


def test_a_rod_that_passes_the_line_of_its_crank():
    """Crank of 1 m, a rod of 1 m without mass, a bob on its end held to the x axis at x = 2 cos phi: a change point.

    (1/3 + 4 sin^2 phi) phi'' + 4 sin phi cos phi phi'^2 + g/2 cos phi = 0, by Runge-Kutta of order 8 (scipy).
    """
    start, rate = pi / 4, 6.0

    def rhs(_t: float, y: np.ndarray) -> list[float]:
        s, c = sin(y[0]), cos(y[0])
        return [y[1], -(4 * s * c * y[1] ** 2 + G / 2 * c) / (1 / 3 + 4 * s * s)]

    times = np.linspace(0.0, 4.0, 41)
    exact = solve_ivp(rhs, (0.0, 4.0), [start, rate], "DOP853", t_eval=times, rtol=3e-14, atol=1e-14).y[0]
    crank = Body("crank", 1.0, 1 / 12, (0.5, 0.0), angle=start, rate=rate)
    bob = Body("bob", 1.0, 0.1, (0.0, 0.0), (2 * cos(start), 0.0), velocity=(-2 * sin(start) * rate, 0.0))
    joints = [Hinge("crank", "ground"), Distance("crank", "bob", (1.0, 0.0), length=1.0), Slot("bob", "ground")]
    made = integrate(system([crank, bob], joints), times, tolerance=1e-11, method="taylor")
    assert len(made.statistics["change_points"]) > 3
    np.testing.assert_allclose(made.q[:, 2], exact, atol=1e-8)
    np.testing.assert_allclose(made.q[:, 3], 2.0 * np.cos(exact), atol=1e-8)  # it stays on its branch


def test_forces_and_slopes_of_a_distance_are_derivatives():
    """Jacobian, velocity terms and geometric stiffness against central differences, between two moving bodies."""
    bodies = [Body("a", 1.0, 1.0, (0.1, 0.3), (0.0, 0.0), 0.4), Body("b", 1.0, 1.0, (-0.2, 0.1), (1.0, 0.5), -0.7)]
    made = system(bodies, [Distance("a", "b", (0.5, 0.2), (0.1, -0.4), 0.9)])
    q, v, step = made.start_q, np.array([0.3, -0.2, 1.1, 0.5, 0.4, -0.8]), 1e-6
    G = np.array([(made.residual(0.0, q + d) - made.residual(0.0, q - d)) / (2 * step) for d in step * np.eye(6)]).T
    np.testing.assert_allclose(made.jacobian(0.0, q), G, atol=1e-9)
    rate = (made.jacobian(0.0, q + step * v) - made.jacobian(0.0, q - step * v)) / (2 * step)
    np.testing.assert_allclose(made.velocity_terms(0.0, q, v), rate @ v, atol=1e-8)
    bend = [(made.jacobian(0.0, q + d) - made.jacobian(0.0, q - d)).T @ [1.7] / (2 * step) for d in step * np.eye(6)]
    np.testing.assert_allclose(made.elements[0].curvature(q, np.array([1.7])), np.array(bend).T, atol=1e-8)


def test_no_distance_at_all_is_refused():
    with pytest.raises(InputError, match="hinge"):
        system([Body("a", 1.0, 1.0)], [Distance("a", "ground", name="rod")])


def test_a_length_that_the_start_does_not_have_is_closed():
    made = system([Body("a", 1.0, 1.0, (0.0, 0.0), (1.0, 0.0))], [Distance("a", "ground", length=1.3)])
    assert np.hypot(*consistent_start(made).q[:2]) == pytest.approx(1.3, abs=1e-12)


def test_a_mechanism_file_with_a_distance(tmp_path):
    """A hanging bob at rest: the reaction on it is its weight, along the rod; keys of other joints are refused."""
    text = f"""
    run = {{ end_s = 0.1, step_s = 0.05 }}
    bodies.bob = {{ mass_kg = 2.0, inertia_kg_m2 = 0.1, position_m = [0.2, -0.5] }}
    joints.rod = {{ type = "distance", body = "bob", to_point = [0.2, 0.0], length_m = 0.5 }}
    forces.gravity = {{ type = "gravity", acceleration_m_per_s2 = [0.0, {-G}] }}
    """
    (tmp_path / "job.toml").write_text(text, encoding="utf-8")
    mechanism = load_mechanism(tmp_path / "job.toml")
    made = integrate(mechanism.system, [0.0, 0.1], start=mechanism.start())
    held = reactions(mechanism, made)
    np.testing.assert_allclose(held["rod_y_N"], 2.0 * G, rtol=1e-12)
    np.testing.assert_allclose(held["rod_x_N"], 0.0, atol=1e-9)
    (tmp_path / "job.toml").write_text(text.replace("length_m = 0.5", "direction = [1.0, 0.0]"), encoding="utf-8")
    with pytest.raises(InputError, match=r"joints.rod.direction.*does not belong to type 'distance'"):
        load_mechanism(tmp_path / "job.toml")
