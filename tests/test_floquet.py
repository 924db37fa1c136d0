"""Floquet multipliers against published stability boundaries, closed forms and an independent integration."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from gearfe.rigid import constant, integrate
from gearfe.runup.run_up import steady_state
from gearfe.train import Damping, Load, TrainModel, build_train
from gearfe.train.floquet import Linearised, multipliers, train_multipliers
from gearfe.train.monodromy import flow, kick_times, monodromy

from .trains import SHIPPED, changed, curve, elastic, train


def mathieu(a: float, q: float, **options: float) -> np.ndarray:
    """Multipliers of y'' + (a - 2 q cos 2t) y = 0 over pi."""
    one = np.ones((1, 1))
    return multipliers(np.array([a]), 0 * one, one, lambda t: 2 * q * np.cos(2 * t)[:, None], math.pi, **options)


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
        return float(mathieu(value, q, first=512, tolerance=1e-4).sum().real) - trace

    assert brentq(beyond, a - 1e-4, a + 1e-4, xtol=1e-10) == pytest.approx(a, abs=1e-8)  # the table has 8 decimals
    assert complex(mathieu(a, q, first=512).prod()) == pytest.approx(1.0, abs=1e-9)  # Liouville: no damping


def test_mathieu_within_an_unstable_tongue() -> None:
    a, q = 1.0, 0.4

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], -(a - 2 * q * math.cos(2 * t)) * y[0]])

    columns = [solve_ivp(rhs, (0, math.pi), s, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1] for s in np.eye(2)]
    expected = np.linalg.eigvals(np.array(columns).T)
    expected = expected[np.argsort(-np.abs(expected))]
    assert abs(expected[0]) > 1.5
    assert mathieu(a, q, first=256) == pytest.approx(expected, abs=1e-8)


def test_order_four() -> None:
    def traced(steps: int) -> complex:
        one = np.ones((1, 1))
        gains = lambda t: 16.0 * np.cos(2 * t)[:, None]  # noqa: E731
        edges = np.linspace(0.0, math.pi, steps + 1)
        constant, reads = flow(np.array([30.0]), 0 * one, math.pi), np.array([[1.0], [0.0]])
        strengths = gains(kick_times(edges).ravel()).reshape(steps, -1, 1, 1)
        return complex(np.trace(monodromy(constant, edges, one, reads, strengths)))

    exact = traced(1024)
    errors = np.abs([traced(steps) - exact for steps in (6, 12, 24)])
    assert (np.log2(errors[:-1] / errors[1:]) > 3.8).all()


def test_constant_system_with_gyroscopic_damping() -> None:
    """Without a periodic part the multipliers are exponentials; a mode without stiffness does no harm."""
    eigenvalues, D = np.array([0.0, 4.0, 30.0]), np.array([[0.1, 0.4, 0.0], [-0.4, 0.2, 0.1], [0.0, 0.0, 0.05]])
    found = multipliers(eigenvalues, D, np.zeros((3, 0)), lambda t: np.zeros((len(t), 0)), 1.7)
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag(eigenvalues), -D]])
    expected = np.linalg.eigvals(expm(1.7 * A))
    assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(expected)), abs=1e-9)


def by_differences(model: TrainModel, at: np.ndarray, period: float) -> np.ndarray:
    """Eigenvalues of the map over a period by central differences of the integrator about a state (y, v)."""
    modal, n = model.modal, len(model.modal.eigenvalues)
    unit = np.concatenate([np.maximum(np.sqrt(modal.eigenvalues), 1.0 / period), np.ones(n)])

    def after(state: np.ndarray) -> np.ndarray:
        start = dataclasses.replace(model.start, q=modal.origin + modal.T @ state[:n], v=modal.T @ state[n:])
        run = integrate(model.system, [0.0, period], method="taylor", tolerance=1e-12, start=start)
        return np.concatenate(modal.reduce(run.q[-1], run.v[-1]))

    step = 3e-4 * float(np.abs(unit * at).max())
    columns = [(after(at + d) - after(at - d)) / (2 * step) for d in np.diag(step / unit)]
    assert np.abs(unit * (after(at) - at)).max() < 1e-4 * np.abs(unit * at).max()  # the motion repeats
    return np.linalg.eigvals(unit[:, None] * np.array(columns).T)


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
    found, note = train_multipliers(model)
    assert (note, found is None) == ("", False)
    period = 0.15 * 2 * math.pi / 600.0
    orbit = Linearised(model, 600.0, period)
    assert orbit.matrix(256) is not None
    if load == 0.0:
        assert not orbit.state.any()
        assert np.abs(found) == pytest.approx(1.0, abs=1e-5)
        return
    n = len(orbit.static)
    state = np.concatenate([orbit.static + orbit.state[:n] / orbit.constant.scale, orbit.state[n:]])
    expected = by_differences(model, state, period)
    assert np.sort(np.abs(found))[::-1] == pytest.approx(np.sort(np.abs(expected))[::-1], abs=2e-6)
    if damping.beta == 0.0:
        assert np.abs(found).max() > 1.0 + 2e-5
    # harmonic balance, without damping and with one mode exactly at five times the mesh frequency
    balanced = steady_state(model, 600.0, tolerance=1e-4).multipliers
    assert np.sort(np.abs(balanced)) == pytest.approx(np.sort(np.abs(expected)), abs=2e-4)


def test_a_critically_damped_mode_has_no_eigenvectors_of_its_own() -> None:
    """The constant part alone, where two eigenvalues fall together: (1 + t) exp(-t) still."""
    found = multipliers(np.array([4.0]), np.array([[4.0]]), np.ones((1, 1)), lambda t: np.zeros((len(t), 1)), 0.7)
    assert np.abs(found) == pytest.approx(math.exp(-1.4), rel=1e-7)


def test_rigid_meshes_in_a_rigid_housing_leave_nothing_to_vibrate() -> None:
    found, note = train_multipliers(build_train(train(SHIPPED, stiffness=None)))
    assert found is None
    assert "nothing can vibrate" in note


def test_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """The stage holds the dense linear algebra at one thread."""
    from threadpoolctl import threadpool_info

    from gearfe.train import floquet

    seen = []

    def looked(found: object, **options: object) -> None:
        seen.extend(p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas")

    monkeypatch.setattr(floquet, "settled", looked)
    train_multipliers(build_train(train([(20, 30)], stiffness=curve)))
    assert set(seen) == {1}


def test_no_common_period_says_why() -> None:
    gear_train = train([(23, 41), (29, 37), (31, 43)], stiffness=curve, ys=[0.012, 0.0, -0.012])
    found, note = train_multipliers(build_train(gear_train))
    assert found is None
    assert "none within reason" in note


def test_undamped_rigid_train_can_be_unstable() -> None:
    """One mesh, tuned so that twice its natural frequency is the mesh frequency: the principal Mathieu tongue."""
    gear_train = train([(20, 30)], stiffness=lambda z: curve(z, 1e8, 0.4))
    frequency = build_train(gear_train).coupled_frequencies_hz[-1]
    from gearfe.train import Drive

    speed = 2 * frequency * 2 * math.pi / 20
    unstable = build_train(changed(gear_train, drive=Drive("s0", "s0+", constant(speed))))
    found, _ = train_multipliers(unstable)
    assert found is not None
    # y'' + w^2 (1 + e cos 2 w t) y: growth exp(e w T/4) per period T of the stiffness, to first order in e
    assert abs(found[0]) == pytest.approx(math.exp(0.4 * math.pi / 4), rel=0.02)
