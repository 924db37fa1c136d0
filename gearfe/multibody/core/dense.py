"""Coordinates at any time of a run: a polynomial on every step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.typing import Array

#: Times may lie outside of the run by so much of its length: rounding of output times.
SLACK = 1e-9


class Dense(Protocol):
    """Coordinates at any time within the run."""

    @property
    def times(self) -> Array:
        """Ends of the steps (s)."""

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        """Coordinates (derivative 0), velocities (1), accelerations (2) at the times t; shape (times, size)."""


@dataclass(frozen=True)
class Polynomials:
    """Dense output: on step k the polynomial sum_j c_kj (t - o_k)^j about its origin o_k, by default the begin t_k.

    Parameters
    ----------
    times : ndarray, shape (steps + 1,)
        Ends of the steps (s), rising or falling.
    coefficients : ndarray, shape (steps, orders, size)
        c_kj.
    evaluate
        ``evaluate(times, coefficients, sign, t, derivative, out)``: a compiled form of the sums, for times in order of
        travel.
    begin
        Start of the run where that is not the first of the times (s): a start on a singular position is left by a
        series about a moment a little later.
    origins : ndarray, shape (steps,), optional
        o_k (s).
    """

    times: Array
    coefficients: Array
    evaluate: Callable[..., None] | None = None
    begin: float | None = None
    origins: Array | None = None

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Values of all columns (or a derivative of them) at the times t."""
        if len(self.coefficients) == 0:
            raise ValueError("no step was completed, so there is nothing between the times")
        run = self.times if self.begin is None else np.array([self.begin, self.times[-1]])
        t = np.ascontiguousarray(within_run(run, t))
        sign = 1.0 if self.times[-1] >= self.times[0] else -1.0
        out = np.zeros((t.size, self.coefficients.shape[2]))
        if self.evaluate is not None:
            self.evaluate(self.times, self.coefficients, sign, t, derivative, out)
            return out
        k = np.clip(np.searchsorted(sign * self.times, sign * t, side="right") - 1, 0, len(self.coefficients) - 1)
        h = (t - (self.times if self.origins is None else self.origins)[k])[:, None]
        for j in range(self.coefficients.shape[1] - 1, derivative - 1, -1):
            out = out * h + math.perm(j, derivative) * self.coefficients[k, j]
        return out


def hermite(times: Array, q: Array, v: Array, a: Array) -> Polynomials:
    """Return the polynomials of degree 5 through the states at the ends of steps.

    Parameters
    ----------
    times : ndarray, shape (steps + 1,)
        Ends of the steps (s).
    q, v, a : ndarray, shape (steps + 1, size)
        Coordinates, velocities and accelerations there.
    """
    h = np.diff(times)[:, None]
    q0, v0, a0 = q[:-1], h * v[:-1], h * h * a[:-1]
    d = q[1:] - q0 - v0 - a0 / 2
    e, f = h * v[1:] - v0 - a0, h * h * a[1:] - a0
    scaled = [q0, v0, a0 / 2, 10 * d - 4 * e + f / 2, -15 * d + 7 * e - f, 6 * d - 3 * e + f / 2]
    return Polynomials(times, np.stack([c / h**j for j, c in enumerate(scaled)], axis=1))


def within_run(run: Array, times: ArrayLike) -> Array:
    """The times (s), shape (n,), those outside by rounding moved to the ends.

    Parameters
    ----------
    run : ndarray, shape (steps + 1,)
        Ends of the steps (s), rising or falling.
    times
        Asked times (s).

    Raises
    ------
    InputError
        When a time lies outside: the polynomials of the steps say nothing there.
    """
    given = np.atleast_1d(np.asarray(times, dtype=float))
    low, high = min(run[0], run[-1]), max(run[0], run[-1])
    slack = SLACK * (high - low) + 1e-12 * max(abs(low), abs(high))
    outside = ~((given >= low - slack) & (given <= high + slack))
    if outside.any():
        problem = f"lies outside of the run, which goes from {run[0]:.9g} to {run[-1]:.9g} s"
        cure = "ask for times within it, or integrate further"
        raise InputError("times", float(given[np.argmax(outside)]), problem, cure)
    return np.clip(given, low, high)
