"""Floquet multipliers against published stability boundaries, closed forms and an independent integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from gearfe.train import Damping, build_train
from gearfe.train.floquet import _monodromy, multipliers, train_multipliers

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
        return complex(np.linalg.eigvals(_monodromy(np.array([30.0]), 0 * one, one, gains, math.pi, steps)).sum())

    exact = traced(1024)
    errors = np.abs([traced(steps) - exact for steps in (6, 12, 24)])
    assert (np.log2(errors[:-1] / errors[1:]) > 3.8).all()


def test_constant_system_with_gyroscopic_damping() -> None:
    """Without a periodic part the multipliers are exponentials; a mode without stiffness does no harm."""
    squares, D = np.array([0.0, 4.0, 30.0]), np.array([[0.1, 0.4, 0.0], [-0.4, 0.2, 0.1], [0.0, 0.0, 0.05]])
    found = multipliers(squares, D, np.zeros((3, 0)), lambda t: np.zeros((len(t), 0)), 1.7)
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag(squares), -D]])
    expected = np.linalg.eigvals(expm(1.7 * A))
    assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(expected)), abs=1e-9)


def test_train_against_an_independent_monodromy_matrix() -> None:
    """Elastic housing, two meshes, gyroscopic moments and damping: columns integrated one by one."""
    scene = elastic(train(SHIPPED, stiffness=lambda z: curve(z, swing=0.3), damping=Damping(beta=2e-7)), skew=0.3)
    model = build_train(scene)
    found, note = train_multipliers(model)
    assert note == ""
    assert found is not None
    n, core = len(model.core.squares), model.core
    period = 0.15 * 2 * math.pi / 600.0

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        q, v = core.T @ y[:n], core.T @ y[n:]
        f = -model.system.stiffness @ q - model.system.damping @ v
        for line in model.meshes:
            f -= (line.stiffness(np.array(600.0 * t)) - line.mean) * (line.row @ q) * line.row
        for body, first, g in zip(model.shafts, model.first, model.ratios, strict=True):
            f[first + 3] -= body.rotor.polar * g * 600.0 * v[first + 4]
            f[first + 4] += body.rotor.polar * g * 600.0 * v[first + 3]
        return np.concatenate([y[n:], core.T.T @ f])

    rng = np.random.default_rng(3)
    start = rng.standard_normal(2 * n)
    start[n:] *= 2e4
    end = solve_ivp(rhs, (0, period), start, method="DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
    directions = np.array([line.row @ core.T for line in model.meshes]).T
    damping = core.damping.copy()
    for body, first, g in zip(model.shafts, model.first, model.ratios, strict=True):
        one, two = core.T[first + 3], core.T[first + 4]
        damping += body.rotor.polar * g * 600.0 * (np.outer(one, two) - np.outer(two, one))
    scale = np.maximum(np.sqrt(core.squares), 1 / period)
    A = np.block([[np.zeros((n, n)), np.diag(scale)], [np.diag(-core.squares / scale), -damping]])
    V = np.linalg.eig(A)[1]
    X = _monodromy(
        core.squares, damping, directions,
        lambda t: np.array([x.mean - x.stiffness(600.0 * t) for x in model.meshes]).T, period, 512,
    )  # fmt: skip
    full = np.real(V @ X @ np.linalg.inv(V))
    unit = np.concatenate([scale, np.ones(n)])
    assert np.abs(full @ (unit * start) - unit * end).max() < 2e-5 * np.abs(unit * end).max()
    assert np.abs(found[0]) == pytest.approx(np.abs(np.linalg.eigvals(X)).max(), rel=1e-5)
    assert np.abs(found).max() < 1.0


def test_no_common_period_says_why() -> None:
    scene = train([(23, 41), (29, 37), (31, 43)], stiffness=curve, ys=[0.012, 0.0, -0.012])
    found, note = train_multipliers(build_train(scene))
    assert found is None
    assert "none within reason" in note


def test_undamped_rigid_train_can_be_unstable() -> None:
    """One mesh, tuned so that twice its natural frequency is the mesh frequency: the principal Mathieu tongue."""
    scene = train([(20, 30)], stiffness=lambda z: curve(z, 1e8, 0.4))
    frequency = build_train(scene).coupled_frequencies_hz[-1]
    from gearfe.rigid import constant
    from gearfe.train import Drive

    speed = 2 * frequency * 2 * math.pi / 20
    unstable = build_train(changed(scene, drive=Drive("s0", "s0+", constant(speed))))
    found, _ = train_multipliers(unstable)
    assert found is not None
    # y'' + w^2 (1 + e cos 2 w t) y: growth exp(e w T/4) per period T of the stiffness, to first order in e
    assert abs(found[0]) == pytest.approx(math.exp(0.4 * math.pi / 4), rel=0.02)
