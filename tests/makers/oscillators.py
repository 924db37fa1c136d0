"""Oscillators of one degree of freedom, and periodic motions by shooting: an integration of its own, events located.

Nothing here comes from `gearfe.drivetrain.runup`'s solution; its oscillators are made for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from gearfe.drivetrain.runup.balance import Oscillator, Pushes, settled, solve
from gearfe.drivetrain.runup.follow import follow
from gearfe.drivetrain.runup.linear import Linear


def synthesis(amplitudes: np.ndarray, samples: int) -> np.ndarray:
    """Values of ``Re sum a_k exp(i k theta)`` at even places of one phase."""
    spectrum = np.zeros((samples // 2 + 1, amplitudes.shape[1]), dtype=complex)
    spectrum[: len(amplitudes)] = 0.5 * samples * amplitudes
    spectrum[0] *= 2.0
    return np.asarray(np.fft.irfft(spectrum, samples, axis=0))


def analysis(values: np.ndarray) -> np.ndarray:
    """Complex amplitudes of values at even places of one phase."""
    made = np.fft.rfft(values, axis=0) * (2.0 / len(values))
    made[0] *= 0.5
    return np.asarray(made)


def rates(amplitudes: np.ndarray, omega0: float) -> np.ndarray:
    """Amplitudes of the time derivative."""
    return np.asarray(1j * omega0 * np.arange(len(amplitudes))[:, None] * amplitudes)


def pushes(force: np.ndarray, slope: np.ndarray) -> Pushes:
    """Forces (S,) on one freedom, and their derivatives with it."""
    first = np.zeros(1, dtype=np.int64)
    return Pushes(force[:, None], [(first, first, slope[:, None])])


@dataclass(frozen=True)
class Single:
    """``x'' + 2 z x' + force(theta, x) = load + swing cos(theta)``, natural frequency 1 where the force is x."""

    damping: float
    load: float
    swing: float
    force: Callable[[np.ndarray, np.ndarray], np.ndarray]
    slope: Callable[[np.ndarray, np.ndarray], np.ndarray]
    phase: float = 0.0

    def __call__(self, theta, speed, u, du):  # type: ignore[no-untyped-def]
        x, theta = u[:, 0], theta[:, 0]
        push = self.swing * np.cos(theta + self.phase) + x - self.force(theta + self.phase, x)
        return pushes(push, 1.0 - self.slope(theta + self.phase, x))

    @property
    def oscillator(self) -> Oscillator:
        one = np.ones((1, 1))
        linear = Linear(np.ones(1), 2.0 * self.damping * one, one, self.load * np.ones(1))
        return Oscillator(linear, self, (1.0,), np.ones(1))

    def rhs(self, speed):  # type: ignore[no-untyped-def]
        def made(t, y):  # type: ignore[no-untyped-def]
            push = self.load + self.swing * math.cos(speed * t + self.phase)
            return [y[1], push - 2.0 * self.damping * y[1] - float(self.force(speed * t + self.phase, np.array(y[0])))]

        return made


def duffing(cubic: float, damping: float, swing: float) -> Single:
    return Single(
        damping, 0.0, swing, lambda th, x: x + cubic * x**3, lambda th, x: 1.0 + 3.0 * cubic * x**2 + 0.0 * th
    )  # fmt: skip


def meshing(ripple: float, damping: float, load: float, gap: float = math.inf) -> Single:
    """A spring ``1 + ripple cos`` that parts below 0 and bears on its back side behind a gap."""

    def side(th, x):  # type: ignore[no-untyped-def]
        return np.where(x > 0.0, x, np.where(x < -gap, x + gap, 0.0))

    def slope(th, x):  # type: ignore[no-untyped-def]
        return (1.0 + ripple * np.cos(th)) * ((x > 0.0) | (x < -gap))

    return Single(damping, load, 0.0, lambda th, x: (1.0 + ripple * np.cos(th)) * side(th, x), slope)


def around(system: Single, speed: float, state: np.ndarray, *, parts: bool = False) -> np.ndarray:
    """State after a period; with `parts` each touch (x = 0) ends a stretch of the integration."""
    t, end, y = 0.0, 2.0 * math.pi / speed, np.array(state)

    def touch(t, y):  # type: ignore[no-untyped-def]
        return y[0]

    touch.terminal = True  # type: ignore[attr-defined]
    while True:
        events = [touch] if parts else None
        run = solve_ivp(system.rhs(speed), (t, end), y, "DOP853", events=events, rtol=1e-10, atol=1e-12)
        t, y = run.t[-1], run.y[:, -1]
        if run.status == 0:
            return y
        y = np.array([math.copysign(1e-14, y[1]), y[1]])


def monodromy(system: Single, speed: float, state: np.ndarray, **options: bool) -> np.ndarray:
    h = 1e-5
    columns = [
        (around(system, speed, state + h * e, **options) - around(system, speed, state - h * e, **options)) / (2 * h)
        for e in np.eye(2)
    ]
    return np.array(columns).T


def shooting(system: Single, speed: float, state: np.ndarray, **options: bool) -> np.ndarray:
    """Start of a periodic motion."""
    for _ in range(12):
        gap = around(system, speed, state, **options) - state
        if np.abs(gap).max() < 1e-8:
            return state
        state = state - np.linalg.solve(monodromy(system, speed, state, **options) - np.eye(2), gap)
    raise AssertionError("no periodic motion by shooting")


def turning_speed(system: Single, speed: float, one: np.ndarray, two: np.ndarray, **options: bool) -> float:
    """Speed at which the curve of periodic motions turns between two of them at the same speed.

    The curve is followed over the way from the one to the other: the distance from it and the speed by shooting.
    """
    part, across = np.linspace(0.0, 1.0, 5), np.array([-(two - one)[1], (two - one)[0]])
    found, guess = [], np.array([0.0, speed])
    for s in part:

        def gap(x, s=s):  # type: ignore[no-untyped-def]
            state = one + s * (two - one) + x[0] * across
            return around(system, x[1], state, **options) - state

        guess = fsolve(gap, guess, xtol=1e-8, epsfcn=1e-10)
        assert np.abs(gap(guess)).max() < 1e-7
        found.append(guess[1])
    fit = np.polynomial.Polynomial.fit(part, found, 4)
    roots = [r.real for r in fit.deriv().roots() if abs(r.imag) < 1e-9 and 0.0 < r.real < 1.0]
    return float(fit(roots[0]))


def start_of(orbit, samples=64):  # type: ignore[no-untyped-def]
    """Place and rate at theta = 0."""
    omega = abs(orbit.speed)
    size = max(samples, 2 * len(orbit.places))
    u, du = synthesis(orbit.places, size), synthesis(rates(orbit.places, omega), size)
    return np.array([u[0, 0], du[0, 0]])


def settled_at(system, speed, tolerance=1e-8, harmonics=16):  # type: ignore[no-untyped-def]
    guess = np.zeros((harmonics + 1, 1), dtype=complex)
    guess[0] = system.linear.rest()
    return settled(system, *solve(system, speed, guess, tolerance), tolerance)


def response_curve(system, speeds, tolerance=1e-7, highest=0.0):  # type: ignore[no-untyped-def]
    return follow(system, speeds, settled_at(system, speeds[0], tolerance), tolerance=tolerance, highest=highest)
