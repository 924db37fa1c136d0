r"""Periodic interpolation with value and slope, piecewise linear or monotone cubic.

The monotone cubic is the Hermite interpolant with the slopes of Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5, 1984):
with intervals h and secants :math:`\Delta`, at node k

.. math::
    m_k = \frac{w_1 + w_2}{w_1/\Delta_{k-1} + w_2/\Delta_k}, \quad w_1 = 2h_k + h_{k-1},\ w_2 = h_k + 2h_{k-1}

where both secants have the same sign, and 0 elsewhere: no overshoot between nodes, and a continuous slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..typing import Array, IntArray

#: Names of the methods of interpolation.
METHODS = ("cubic", "linear")


class ValueAndSlope(NamedTuple):
    """Value and its derivative with respect to the phase."""

    value: Array
    slope: Array


@dataclass(frozen=True)
class PeriodicInterpolant:
    """Piecewise cubic over a phase, repeated with a period.

    Parameters
    ----------
    period
        Length of one cycle, in the unit of the phase.
    nodes : ndarray, shape (n + 1,)
        Rising phases; the last is the first plus the period.
    cubics : ndarray, shape (n, 4)
        ``c0 + c1 x + c2 x2 + c3 x3`` of the phase x from each node but the last.
    """

    period: float
    nodes: Array
    cubics: Array

    @property
    def values(self) -> Array:
        """Values at the nodes but the last, shape (n,)."""
        return np.asarray(self.cubics[:, 0])

    @property
    def mean(self) -> float:
        """Mean over the period."""
        h = np.diff(self.nodes)
        return float(h @ (self.cubics * h[:, None] ** np.arange(4)) @ (1.0 / np.arange(1, 5)) / self.period)

    def __call__(self, phase: ArrayLike) -> ValueAndSlope:
        """Value and slope at any phase; both have the shape of `phase`."""
        phase, nodes = np.asarray(phase, dtype=float), self.nodes
        place = phase - np.floor((phase - nodes[0]) / self.period) * self.period
        cell = np.minimum(np.searchsorted(nodes[1:], place, side="right"), len(nodes) - 2)
        c, x = self.cubics[cell], place - nodes[cell]
        c0, c1, c2, c3 = (c[..., i] for i in range(4))
        return ValueAndSlope(c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + x * 3.0 * c3))


class Curves(NamedTuple):
    """Periodic interpolants one after the other, for compiled recurrences."""

    first: IntArray  # (c + 1,) first node of each
    nodes: Array  # (all nodes,) rising phases; the last of each is its first plus the period
    cubics: Array  # (all nodes, 4) value over the phase from each node but the last


def curve_arrays(curves: Sequence[PeriodicInterpolant]) -> Curves:
    """Arrays of periodic interpolants."""
    return Curves(
        np.cumsum([0, *(len(curve.nodes) for curve in curves)]).astype(np.int64),
        np.concatenate([np.zeros(0), *(curve.nodes for curve in curves)]),
        np.concatenate([np.zeros((0, 4)), *(np.vstack([curve.cubics, np.zeros(4)]) for curve in curves)]),
    )


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
    known = np.flatnonzero(np.isfinite(values))
    nodes, source = distinct_phases(phase[known], period)
    at = np.empty(len(nodes))
    at[source[::-1]] = values[known[::-1]]  # the first come of a phase is written last
    gaps = np.diff(np.append(nodes, nodes[0] + period)) if len(nodes) else np.array([period])
    k = int(np.argmax(gaps))
    if gaps[k] > widest_gap * period * (1 + 1e-9):
        start = nodes[k] if len(nodes) else 0.0
        problem = (
            f"does not cover the mesh cycle: no position was solved between {np.degrees(start):.6g} and "
            f"{np.degrees(start + gaps[k]):.6g} deg of a cycle of {np.degrees(period):.6g} deg"
        )
        raise InputError("stiffness curve", None, problem, "ask for angles over a whole cycle, or for smaller steps")
    secant, bends = (np.roll(at, -1) - at) / gaps, np.zeros((2, len(at)))
    slopes = secant
    if method == "cubic":
        slopes = _monotone_slopes(gaps, secant)
        end = np.roll(slopes, -1)
        bends = np.stack([(3 * secant - 2 * slopes - end) / gaps, (slopes + end - 2 * secant) / gaps**2])
    return PeriodicInterpolant(period, np.append(nodes, nodes[0] + period), np.stack([at, slopes, *bends], axis=1))


def distinct_phases(phase: Array, period: float) -> tuple[Array, IntArray]:
    """Rising phases in [0, period) that differ by more than rounding, and for each given one the number of its own."""
    wrapped = np.mod(phase, period)
    wrapped[wrapped > period * (1 - 1e-9)] = 0.0
    order = np.argsort(wrapped, kind="stable")
    rising, new = wrapped[order], np.ones(len(order), dtype=bool)
    new[1:] = rising[1:] - rising[:-1] > 1e-9 * period
    source = np.empty(len(order), dtype=np.int64)
    source[order] = np.cumsum(new) - 1
    return rising[new], source


def _monotone_slopes(intervals: Array, secants: Array) -> Array:
    before_h, before = np.roll(intervals, 1), np.roll(secants, 1)
    w1, w2 = 2 * intervals + before_h, intervals + 2 * before_h
    same = before * secants > 0
    slopes = np.zeros(len(secants))
    slopes[same] = (w1 + w2)[same] / (w1[same] / before[same] + w2[same] / secants[same])
    return slopes
