"""Floquet multipliers against published stability boundaries, closed forms and an independent integration."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from gearfe.drivetrain.runup.monodromy import flow, kick_times, monodromy
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.runup.train_stability import train_stability
from gearfe.drivetrain.train import Damping, Drive, Load, TrainModel, build_train
from gearfe.multibody import constant, integrate
from tests.makers.trains import SHIPPED, changed, curve, elastic, modal_start, train


def around(eigenvalues, damping, gain, period: float, steps: int) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Eigenvalues of the map of ``y'' = -eigenvalues y - D y'``, the first with a gain p(t) y beside, over a period."""
    n = len(eigenvalues)
    edges = np.linspace(0.0, period, steps + 1)
    first = np.eye(n)[:, :1]
    strengths = gain(kick_times(edges))[..., None, None]
    constant = flow(np.diag(eigenvalues), np.array(damping), period)
    found = np.linalg.eigvals(monodromy(constant, edges, first, np.vstack([first, 0.0 * first]), strengths))
    return np.asarray(found[np.argsort(-np.abs(found))])


def mathieu(a: float, q: float, steps: int = 1024) -> np.ndarray:
    """Multipliers of y'' + (a - 2 q cos 2t) y = 0 over pi."""
    return around([a], [[0.0]], lambda t: 2.0 * q * np.cos(2.0 * t), math.pi, steps)


# Abramowitz & Stegun, Handbook of Mathematical Functions, Table 20.1: characteristic values a_r and b_r
BOUNDARIES = [
    (-5.80004602, 5.0, 2.0),  # a_0
    (-5.79008060, 5.0, -2.0),  # b_1
    (1.85818754, 5.0, -2.0),  # a_1
    (2.09946045, 5.0, 2.0),  # b_2
    (7.44910974, 5.0, 2.0),  # a_2
    (-13.93697996, 10.0, 2.0),  # a_0
]


@pytest.mark.parametrize(("a", "q", "trace"), BOUNDARIES)
def test_mathieu_on_the_tabulated_boundaries(a: float, q: float, trace: float) -> None:
    """On a boundary the solution has the period pi or 2 pi: the trace of the monodromy matrix is 2 or -2."""

    def beyond(value: float) -> float:
        return float(mathieu(value, q).sum().real) - trace

    assert brentq(beyond, a - 1e-4, a + 1e-4, xtol=1e-10) == pytest.approx(a, abs=1e-8)  # the table has 8 decimals
    assert complex(mathieu(a, q).prod()) == pytest.approx(1.0, abs=1e-9)  # Liouville: no damping


def test_mathieu_within_an_unstable_tongue() -> None:
    a, q = 1.0, 0.4

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], -(a - 2 * q * math.cos(2 * t)) * y[0]])

    columns = [solve_ivp(rhs, (0, math.pi), s, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1] for s in np.eye(2)]
    expected = np.linalg.eigvals(np.array(columns).T)
    expected = expected[np.argsort(-np.abs(expected))]
    assert abs(expected[0]) > 1.5
    assert mathieu(a, q) == pytest.approx(expected, abs=1e-8)


def test_order_four() -> None:
    exact = mathieu(30.0, 8.0, 1024).sum()
    errors = np.abs([mathieu(30.0, 8.0, steps).sum() - exact for steps in (6, 12, 24)])
    assert (np.log2(errors[:-1] / errors[1:]) > 3.8).all()


def test_constant_system_with_gyroscopic_damping() -> None:
    """Without a periodic part the multipliers are exponentials; a mode without stiffness does no harm."""
    eigenvalues, D = np.array([0.0, 4.0, 30.0]), np.array([[0.1, 0.4, 0.0], [-0.4, 0.2, 0.1], [0.0, 0.0, 0.05]])
    found = around(eigenvalues, D, np.zeros_like, 1.7, 64)
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag(eigenvalues), -D]])
    expected = np.linalg.eigvals(expm(1.7 * A))
    assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(expected)), abs=1e-9)


def by_differences(model: TrainModel, at: np.ndarray, period: float) -> np.ndarray:
    """Eigenvalues of the map over a period by differences of the integrator about the orbit near a state (y, v)."""
    modal, n = model.modal, len(model.modal.eigenvalues)
    unit = np.concatenate([np.maximum(np.sqrt(modal.eigenvalues), 1.0 / period), np.ones(n)])
    step = 3e-4 * float(np.abs(unit * at).max())

    def after(x: np.ndarray) -> np.ndarray:
        state = x / unit
        start = dataclasses.replace(model.start, q=modal.origin + modal.T @ state[:n], v=modal.T @ state[n:])
        run = integrate(model.system, [0.0, period], method="taylor", tolerance=1e-12, start=start)
        return unit * np.concatenate(modal.reduce(run.q[-1], run.v[-1]))

    def matrix(x: np.ndarray) -> np.ndarray:
        return np.array([(after(x + d) - after(x - d)) / (2 * step) for d in step * np.eye(2 * n)]).T

    x = unit * at
    back = np.linalg.inv(matrix(x) - np.eye(2 * n))
    for _ in range(3):
        x = x - back @ (after(x) - x)
    assert np.abs(after(x) - x).max() < 1e-7 * np.abs(x).max()  # the motion repeats
    return np.linalg.eigvals(matrix(x))


@pytest.mark.parametrize(
    ("method", "damping", "load"),
    [("linear", Damping(), -100.0), ("cubic", Damping(beta=2e-7), -100.0), ("linear", Damping(), 0.0)],
    ids=["undamped", "damped", "no load"],
)
def test_multipliers_are_those_of_the_train_that_is_integrated(method: str, damping: Damping, load: float) -> None:
    """Elastic housing, two meshes, gyroscopic moments: the integrator itself, state by state, over a period.

    Under load k follows the rotation beside rolling, which makes multipliers of an undamped train leave the unit
    circle; without load it makes no difference.
    """
    shape = train(SHIPPED, stiffness=lambda z: curve(z, swing=0.3, method=method, count=18), damping=damping)
    gear_train = elastic(changed(shape, loads=(Load("s2", "s2+", constant(load)),)), skew=0.3)
    model = build_train(gear_train)
    made = train_stability(model)
    assert made.note == ""
    assert made.multipliers is not None
    found, period = np.sort(np.abs(made.multipliers)), 0.15 * 2 * math.pi / 600.0
    assert made.time == pytest.approx(period)
    if load == 0.0:
        assert found == pytest.approx(1.0, abs=1e-12)
        return
    orbit = steady_state(model, 600.0, tolerance=1e-6, stability=False)
    expected = by_differences(model, modal_start(model, orbit), period)
    assert found == pytest.approx(np.sort(np.abs(expected)), abs=2e-6)
    if damping.beta == 0.0:
        assert found.max() > 1.0 + 2e-5


def test_a_critically_damped_mode_has_no_eigenvectors_of_its_own() -> None:
    """The constant part alone, where two eigenvalues fall together: (1 + t) exp(-t) still."""
    found = around([4.0], [[4.0]], np.zeros_like, 0.7, 64)
    assert np.abs(found) == pytest.approx(math.exp(-1.4), rel=1e-7)


def test_multipliers_of_a_heavily_damped_mode() -> None:
    """y'' + c y' + c y = 0 creeps as exp(-t) once c is large; steps back in time overflow where they are long."""
    found = around([1e6], [[1e6]], np.zeros_like, 1.0, 1024)
    assert np.sort(np.abs(found)) == pytest.approx([0.0, math.exp(-1.0)], abs=1e-5)


def test_rigid_meshes_in_a_rigid_housing_leave_nothing_to_vibrate() -> None:
    made = train_stability(build_train(train(SHIPPED, stiffness=None)))
    assert made.multipliers is None
    assert "nothing can vibrate" in made.note


def test_too_many_phases_say_why() -> None:
    teeth = [(23, 41), (29, 37), (31, 43), (47, 59)]
    made = train_stability(build_train(train(teeth, stiffness=curve, ys=[0.024, 0.008, -0.008, -0.024])))
    assert made.multipliers is None
    assert "need 4 phases of their own" in made.note


def test_undamped_rigid_train_can_be_unstable() -> None:
    """One mesh, tuned so that twice its natural frequency is the mesh frequency: the principal Mathieu tongue."""
    gear_train = train([(20, 30)], stiffness=lambda z: curve(z, 1e8, 0.4))
    frequency = build_train(gear_train).coupled_frequencies_hz[-1]
    speed = 2 * frequency * 2 * math.pi / 20
    unstable = build_train(changed(gear_train, drive=Drive("s0", "s0+", constant(speed))))
    found = train_stability(unstable).multipliers
    assert found is not None
    # y'' + w^2 (1 + e cos 2 w t) y: growth exp(e w T/4) per period T of the stiffness, to first order in e
    assert abs(found[0]) == pytest.approx(math.exp(0.4 * math.pi / 4), rel=0.02)


@pytest.mark.parametrize("damping", [[0.1, 0.3, 0.2], [0.1, 4.0, 0.2]], ids=["eigenvectors", "critically damped"])
def test_several_forces_that_other_modes_yield_to_by_direct_integration(damping: list[float]) -> None:
    """Four forces f = A(t) (S y + R f) on three modes; DOP853 integrates them with f from a linear system."""
    rng = np.random.default_rng(5)
    squares, D, period = np.array([1.0, 4.0, 9.0]), np.diag(damping), 1.3
    W, S, R = rng.standard_normal((3, 4)), rng.standard_normal((3, 5)), 0.2 * rng.standard_normal((5, 4))
    still, swinging = rng.standard_normal((2, 4, 5))

    def strength(t: np.ndarray | float) -> np.ndarray:
        return 0.3 * (still + swinging * np.cos(2.0 * math.pi * np.asarray(t) / period)[..., None, None])

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        A = strength(t)
        force = np.linalg.solve(np.eye(4) - A @ R, A @ S.T @ y[:3])
        return np.concatenate([y[3:], W @ force - squares * y[:3] - D @ y[3:]])

    columns = [solve_ivp(rhs, (0, period), s, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1] for s in np.eye(6)]
    expected = np.linalg.eigvals(np.array(columns).T)
    constant, edges = flow(np.diag(squares), D, period), np.linspace(0.0, period, 65)
    found = np.linalg.eigvals(monodromy(constant, edges, W, np.vstack([S, 0.0 * S]), strength(kick_times(edges)), R))
    assert (constant.values is None) == (damping[1] == 4.0)
    assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(expected)), rel=1e-7)


def test_a_flow_of_one_freedom_serves_more_than_one_map() -> None:
    """One pair of eigenvalues is a single row of coordinates, which is contiguous either way round."""
    constant, edges = flow(np.array([[4.0]]), np.array([[0.1]]), 1.0), np.linspace(0.0, 1.0, 9)
    strengths = -0.5 * np.cos(2.0 * math.pi * kick_times(edges))[..., None, None]
    kicked = np.array([[1.0]]), np.array([[1.0], [0.0]]), strengths
    first = monodromy(constant, edges, *kicked)
    np.testing.assert_array_equal(monodromy(constant, edges, *kicked), first)
