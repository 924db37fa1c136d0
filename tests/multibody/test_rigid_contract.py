"""The component contract with parts that the core has never seen: a modal body, a nonlinear hinge, laws of any kind."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gearfe.base.errors import InputError
from gearfe.multibody import (
    GROUND,
    Body,
    Element,
    Gravity,
    Hinge,
    LinearJoint,
    Linkage,
    LocalForce,
    ModalBlocks,
    Moment,
    SeriesLaw,
    SpanFunction,
    Spring,
    StateFunction,
    System,
    consistent_start,
    integrate,
)
from gearfe.multibody.core.modes import fastest_rate
from gearfe.multibody.integrators.collocation.run import Stepper
from gearfe.multibody.integrators.collocation.scheme import GAUSS, RADAU, scheme
from gearfe.multibody.integrators.taylor import run as taylor
from tests.makers.rigid_cases import pendulum

M = np.diag([2.0, 1.0, 0.5])
K = np.array([[90.0, -30.0, 0.0], [-30.0, 80.0, -20.0], [0.0, -20.0, 60.0]])
C = 0.004 * K


class HingeToModalBody(Element):
    """Point of a planar body on a point that the modal coordinates move: P(q) - P0 - Phi eta = 0."""

    rows = 2

    def __init__(self, linkage: Linkage, modal: ModalBlocks, point, place, Phi) -> None:  # type: ignore[no-untyped-def]
        self.touches = (linkage, modal)
        self.point, self.place, self.Phi = np.array(point), np.array(place), Phi

    def _arm(self, q):  # type: ignore[no-untyped-def]
        c, s = np.cos(q[2]), np.sin(q[2])
        return np.array([c * self.point[0] - s * self.point[1], s * self.point[0] + c * self.point[1]])

    def residual(self, t, q):  # type: ignore[no-untyped-def]
        return q[:2] + self._arm(q) - self.place - self.Phi @ q[3:]

    def jacobian(self, t, q):  # type: ignore[no-untyped-def]
        arm = self._arm(q)
        return np.hstack([np.eye(2), [[-arm[1]], [arm[0]]], -self.Phi])

    def velocity_terms(self, t, q, v):  # type: ignore[no-untyped-def]
        return -self._arm(q) * v[2] ** 2


def rod_on_a_modal_body() -> System:
    linkage = Linkage((Body("rod", 1.0, 0.1, (0.5, 0.0), (0.0, 0.0), 0.3),), (), (Gravity((0.0, -9.81)),))
    modal = ModalBlocks(M, C * 0, K)
    Phi = np.array([[1.0, 0.2, 0.0], [0.0, 0.5, 1.0]])
    return System([linkage, modal, HingeToModalBody(linkage, modal, (-0.5, 0.0), (0.0, 0.0), Phi)])


@pytest.mark.parametrize(("tolerance", "allowed"), [(1e-10, 1e-8), (1e-7, 1e-4)])
def test_modal_body_hinged_to_a_rigid_body(tolerance, allowed):
    """Against minimal coordinates (angle, eta) derived by hand: the hinge point is Phi eta."""
    system = rod_on_a_modal_body()
    Phi = system.elements[2].Phi  # type: ignore[attr-defined]

    def rhs(_t, y):  # type: ignore[no-untyped-def]
        theta, eta, w, de = y[0], y[1:4], y[4], y[5:8]
        arm = 0.5 * np.array([np.cos(theta), np.sin(theta)])
        turn = np.array([-arm[1], arm[0]])
        J = np.column_stack([turn, Phi])  # mass centre velocity = J (w, eta')
        full = J.T @ J  # mass 1 kg
        full[0, 0] += 0.1
        full[1:, 1:] += M
        force = J.T @ (np.array([0.0, -9.81]) + arm * w * w)
        force[1:] -= K @ eta
        return np.concatenate([[w], de, np.linalg.solve(full, force)])

    times = np.linspace(0, 2, 21)
    y0 = np.concatenate([[0.3], np.zeros(7)])
    exact = solve_ivp(rhs, (0, 2), y0, "DOP853", t_eval=times, rtol=1e-12, atol=1e-12).y
    made = integrate(system, times, method="implicit", tolerance=tolerance)
    assert made.status == 0
    assert np.abs(made.q[:, 2] - exact[0]).max() <= allowed
    assert np.abs(made.q[:, 3:] - exact[1:4].T).max() <= allowed
    energy = sum(system.energy(made.q, made.v))
    assert np.ptp(energy) <= 100 * allowed


def test_auto_does_not_need_taylor_recurrences():
    assert integrate(rod_on_a_modal_body(), [0.0, 0.1]).method == "implicit"


def test_linear_system_against_the_matrix_exponential():
    """Constant blocks and a linear joint, eliminated at set-up; a redundant copy of the joint does no harm."""
    modal = ModalBlocks(M, C, K, v0=np.array([0.0, 1.0, 2.0]))
    tie = LinearJoint((modal,), np.array([[0.0, 2.0, -1.0]]), np.zeros(1))
    system = System([modal, tie, LinearJoint((modal,), np.array([[0.0, 4.0, -2.0]]), np.zeros(1))])
    start = consistent_start(system)
    assert start.freedoms.net == 2
    T = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 2.0]])
    m, c, k = (T.T @ X @ T for X in (M, C, K))
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]])
    times = np.linspace(0, 3, 16)
    made = integrate(system, times, tolerance=1e-11)
    exact = np.array([T @ (expm(A * t) @ [0, 0, 0, 1.0])[:2] for t in times])
    assert np.abs(made.q - exact).max() <= 1e-9
    accelerations = np.array([T @ (A @ expm(A * t) @ [0, 0, 0, 1.0])[2:] for t in times])
    assert np.abs(made.a - accelerations).max() <= 1e-7


def mesh_like_law(t, u, du, parameters, out):  # type: ignore[no-untyped-def]
    """Spring whose stiffness follows the state and time, with damping."""
    out[0] = -(parameters[0] * (1.0 + 0.3 * np.cos(5.0 * t + u[1])) * u[0] + parameters[1] * du[0])
    out[1] = 0.0


def mesh_like_begin(t, sign, u, du, memory, pieces):  # type: ignore[no-untyped-def]
    """No pieces."""


def mesh_like_order(j, t, s, u, parameters, memory, pieces, out):  # type: ignore[no-untyped-def]
    """The same by orders; in the memory cosine and sine of the phase p = 5 t + u1: c' = -s p', s' = c p'."""
    if j == 0:
        memory[0, 0], memory[1, 0] = np.cos(5.0 * t + u[1, 0]), np.sin(5.0 * t + u[1, 0])
    else:
        memory[0, j] = memory[1, j] = 0.0
        for i in range(1, j + 1):
            rate = i * (u[1, i] + (5.0 * s if i == 1 else 0.0)) / j
            memory[0, j] -= rate * memory[1, j - i]
            memory[1, j] += rate * memory[0, j - i]
    stiff = u[0, j]
    for i in range(j + 1):
        stiff += 0.3 * memory[0, i] * u[0, j - i]
    out[0] = -(parameters[0] * stiff + parameters[1] * (j + 1) * u[0, j + 1] / s)
    out[1] = 0.0


def mesh_like_corner(last, limit, parameters, memory, pieces, ahead):  # type: ignore[no-untyped-def]
    """Smooth everywhere."""
    return 2.0


def two_spins(compiled: bool) -> System:
    """Two inertias on a spring of varying stiffness: directions (difference, first angle)."""
    body = ModalBlocks(np.diag([0.8, 0.3]), np.zeros((2, 2)), np.zeros((2, 2)), v0=np.array([3.0, 1.0]))
    parameters = np.array([40.0, 0.02])

    def law(t, u, du):  # type: ignore[no-untyped-def]
        out = np.zeros(2)
        mesh_like_law(t, u, du, parameters, out)
        return out

    W = np.array([[1.0, 1.0], [-1.0, 0.0]])
    series = SeriesLaw(mesh_like_begin, mesh_like_order, mesh_like_corner, (), parameters, 2, 0)
    return System([body, LocalForce((body,), W, law, series if compiled else None)])


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_stiffness_that_is_any_callable_of_state_and_time(compiled):
    system = two_spins(compiled)

    def rhs(t, y):  # type: ignore[no-untyped-def]
        force = 40.0 * (1 + 0.3 * np.cos(5 * t + y[0])) * (y[0] - y[1]) + 0.02 * (y[2] - y[3])
        return [y[2], y[3], -force / 0.8, force / 0.3]

    times = np.linspace(0, 4, 41)
    exact = solve_ivp(rhs, (0, 4), [0, 0, 3.0, 1.0], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y
    made = integrate(system, times, tolerance=1e-10)
    assert made.status == 0
    assert made.method == ("taylor" if compiled else "implicit")
    assert np.abs(made.q - exact[:2].T).max() <= 1e-8
    stiff = integrate(system, times, tolerance=1e-8, method="implicit")
    assert np.abs(stiff.q - exact[:2].T).max() <= 1e-4


def slope(steps, errors) -> float:  # type: ignore[no-untyped-def]
    """Fall of log error against the log of the number of steps."""
    return float(-np.polyfit(np.log(steps), np.log(errors), 1)[0])


def test_convergence_order_of_the_series():
    """A series of degree 8 for the positions has degree 7 for the velocities: order 7 with fixed steps."""
    system = pendulum(0.7, 1.0, 1.0)
    start = consistent_start(system)
    fine = integrate(system, [0.0, 1.0], tolerance=1e-13, start=start).q[-1, 2]
    steps, errors = [], []
    for count in (30, 45, 67, 100):
        prepared = taylor.prepare(system, start, 8)
        dense, _, _ = taylor.run_taylor(prepared, start, 1.0, tolerance=1e3, longest=1.0 / count)
        steps.append(len(dense.coefficients))
        errors.append(abs(dense(np.array([1.0]))[0, 2] - fine))
    assert slope(steps, errors) >= 6.5


@pytest.mark.parametrize(("family", "order"), [(RADAU, 5), (GAUSS, 6)])
def test_convergence_order_of_collocation(family, order):
    """Three stages, fixed steps of the index-3 method with the projection after each: 2s - 1 and 2s."""
    system = pendulum(0.7, 1.0, 1.0)
    start = consistent_start(system)
    fine = integrate(system, [0.0, 1.0], tolerance=1e-13, start=start).q[-1, 2]
    errors = []
    steps = np.array([20, 28, 40])
    for count in steps:
        step = Stepper(system, start, scheme(family, 3))
        step.restart(system, start, 0.0, start.q, start.v)
        q, v = start.q, start.v
        for k in range(count):
            assert step(k / count, 1 / count, q, v, np.full(3, 1e-9)) > 0
            step.keep(1 / count)
            q, v = step.w.qn.copy(), step.w.vn.copy()
        errors.append(abs(q[2] - fine))
    assert slope(steps, errors) >= order - 0.5


def test_stiff_system_takes_the_implicit_method():
    """A decay of 2e6 1/s beside a swing of 1 Hz: explicit steps would follow the decay."""
    modal = ModalBlocks(np.eye(2), np.diag([2e6, 0.0]), np.diag([1e6, 40.0]), q0=np.array([1.0, 1.0]))
    system = System([modal])
    decay, _ = fastest_rate(system, consistent_start(system))
    assert decay == pytest.approx(2e6)
    times = np.linspace(0, 3, 31)
    made = integrate(system, times, tolerance=1e-6)
    assert made.method == "implicit"
    assert made.status == 0
    assert made.statistics["steps"] < 2000
    assert np.abs(made.q[:, 1] - np.cos(sqrt(40.0) * times)).max() <= 1e-4
    slow = (2e6 - sqrt(4e12 - 4e6)) / 2
    assert np.abs(made.q[:, 0] - np.exp(-slow * times)).max() <= 1e-4


class Unwritten(StateFunction, SpanFunction):
    """A load and a tension that write nothing."""

    def write(self, *_: object) -> Any:
        return None

    def value(self, *_: object) -> float:
        return 1.0


@pytest.mark.parametrize(
    "force", [Moment("rod", Unwritten()), Spring("rod", GROUND, (0.8, 0.0), (1.0, 1.0), law=Unwritten())]
)
def test_a_load_without_a_register_is_told_what_to_be(force: Any) -> None:
    body = Body("rod", 2.0, 0.1, (0.4, 0.0))
    with pytest.raises(InputError, match=r"Unwritten.write: gives no number of a register; .*LocalForce"):
        integrate(System([Linkage((body,), (Hinge("rod", GROUND),), (force,))]), [0.0, 0.1])
