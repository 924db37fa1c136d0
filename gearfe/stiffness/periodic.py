r"""Periodic interpolation with value and slope, piecewise linear or monotone cubic.

The monotone cubic is the Hermite interpolant with the slopes of Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5, 1984):
with intervals h and secants :math:`\Delta`, at node k

.. math::
    m_k = \frac{w_1 + w_2}{w_1/\Delta_{k-1} + w_2/\Delta_k}, \quad w_1 = 2h_k + h_{k-1},\ w_2 = h_k + 2h_{k-1}

where both secants have the same sign, and 0 elsewhere: no overshoot between nodes, and a continuous slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..typing import Array

#: Names of the methods of interpolation.
METHODS = ("cubic", "linear")


class ValueAndSlope(NamedTuple):
    """Value and its derivative with respect to the phase."""

    value: Array
    slope: Array


@dataclass(frozen=True)
class PeriodicInterpolant:
    """Interpolant through (phase, value) nodes, repeated with a period.

    Parameters
    ----------
    period
        Length of one cycle, in the unit of the phase.
    nodes : ndarray, shape (n + 1,)
        Rising phases; the last is the first plus the period.
    values, slopes : ndarray, shape (n + 1,)
        Values and, for the cubic, derivatives there.
    method
        ``cubic`` or ``linear``.
    left_out : ndarray
        Phases that were asked for but have no value, for the record.
    """

    period: float
    nodes: Array
    values: Array
    slopes: Array
    method: str
    left_out: Array

    def __call__(self, phase: ArrayLike) -> ValueAndSlope:
        """Value and slope at any phase; both have the shape of `phase`."""
        phase = np.asarray(phase, dtype=float)
        start = self.nodes[0]
        place = start + np.mod(phase - start, self.period)
        k = np.clip(np.searchsorted(self.nodes, place, side="right") - 1, 0, len(self.nodes) - 2)
        h = self.nodes[k + 1] - self.nodes[k]
        t = (place - self.nodes[k]) / h
        low, high = self.values[k], self.values[k + 1]
        rise = high - low
        if self.method == "linear":
            return ValueAndSlope(low + t * rise, rise / h)
        a, b = h * self.slopes[k], h * self.slopes[k + 1]
        # Hermite: low + t a + t^2 (3 rise - 2 a - b) + t^3 (a + b - 2 rise)
        square, cube = 3 * rise - 2 * a - b, a + b - 2 * rise
        value = low + t * (a + t * (square + t * cube))
        return ValueAndSlope(value, (a + t * (2 * square + 3 * t * cube)) / h)


def periodic_interpolant(
    phase: ArrayLike, values: ArrayLike, period: float, *, method: str = "cubic", widest_gap: float = 0.25
) -> PeriodicInterpolant:
    """Interpolant through samples of a periodic function.

    Parameters
    ----------
    phase, values : array_like, shape (n,)
        Samples in any order and any cycle; a phase that occurs twice counts once (first come), values that are not
        numbers are left out.
    period
        Length of one cycle, in the unit of the phase.
    widest_gap
        Largest stretch without a sample, as a share of the period, that counts as covered.

    Raises
    ------
    InputError
        When the samples do not cover the cycle.
    """
    if method not in METHODS:
        raise InputError("interpolation", method, "must be one of " + ", ".join(METHODS))
    phase, values = np.asarray(phase, dtype=float), np.asarray(values, dtype=float)
    wrapped = wrapped_phase(phase, period)
    known = np.isfinite(values)
    order = np.flatnonzero(known)[np.argsort(wrapped[known], kind="stable")]
    nodes = wrapped[order]
    if len(nodes):
        starts = np.flatnonzero(np.concatenate([[True], np.diff(nodes) > 1e-9 * period]))
        order = np.minimum.reduceat(order, starts)
        nodes = wrapped[order]
    gaps = np.diff(np.append(nodes, nodes[0] + period)) if len(nodes) else np.array([period])
    k = int(np.argmax(gaps))
    if gaps[k] > widest_gap * period * (1 + 1e-9):
        start = nodes[k] if len(nodes) else 0.0
        problem = (
            f"does not cover the mesh cycle: no position was solved between {np.degrees(start):.6g} and "
            f"{np.degrees(start + gaps[k]):.6g} deg of a cycle of {np.degrees(period):.6g} deg"
        )
        raise InputError("stiffness curve", None, problem, "ask for angles over a whole cycle, or for smaller steps")
    at = values[order]
    slopes = _monotone_slopes(gaps, at) if method == "cubic" else np.zeros(len(at))
    missing = np.setdiff1d(np.round(wrapped[~known], 12), np.round(nodes, 12))
    return PeriodicInterpolant(
        period, np.append(nodes, nodes[0] + period), np.append(at, at[0]), np.append(slopes, slopes[0]), method, missing
    )


def wrapped_phase(phase: Array, period: float) -> Array:
    """Phases reduced to [0, period); a rounding error below a whole number of periods counts as that number."""
    wrapped = np.mod(phase, period)
    wrapped[wrapped > period * (1 - 1e-9)] = 0.0
    return wrapped


def _monotone_slopes(intervals: Array, values: Array) -> Array:
    secants = (np.roll(values, -1) - values) / intervals
    before_h, before = np.roll(intervals, 1), np.roll(secants, 1)
    w1, w2 = 2 * intervals + before_h, intervals + 2 * before_h
    same = before * secants > 0
    slopes = np.zeros(len(values))
    slopes[same] = (w1 + w2)[same] / (w1[same] / before[same] + w2[same] / secants[same])
    return slopes
