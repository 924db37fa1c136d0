r"""Periodic interpolation with value and slope, piecewise linear or monotone cubic.

The monotone cubic is the Hermite interpolant with the slopes of Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5, 1984):
with intervals h and secants :math:`\Delta`, at node k

.. math::
    m_k = \frac{w_1 + w_2}{w_1/\Delta_{k-1} + w_2/\Delta_k}, \quad w_1 = 2h_k + h_{k-1},\ w_2 = h_k + 2h_{k-1}

where both secants have the same sign, and 0 elsewhere: no overshoot between nodes, and a continuous slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.typing import Array, IntArray

#: Names of the methods of interpolation.
METHODS = ("cubic", "linear")
#: Samples whole periods apart agree within this part of the largest value: above the rounding of tables and the noise
#: of finite elements (0.1 to 0.3 %). What neighbouring samples differ by is allowed on top, between them.
AGREEING = 5e-3
#: Largest stretch without a sample, as a share of the period, that counts as covered.
WIDEST_GAP = 0.25


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

    def reversed(self) -> PeriodicInterpolant:
        """The function ``-f(-phase)``."""
        low, h = self.cubics, np.diff(self.nodes)[:, None] ** np.arange(4)
        c0, c1, c2, c3 = (low * h).T  # of the part x/h of a cell; from its other end on: 1 - x/h
        ends = np.stack([c0 + c1 + c2 + c3, -c1 - 2.0 * c2 - 3.0 * c3, c2 + 3.0 * c3, -c3], axis=1) / h
        return PeriodicInterpolant(self.period, -self.nodes[::-1], -ends[::-1])

    def on_nodes(self, nodes: Array) -> PeriodicInterpolant:
        """The same function on rising nodes (n + 1,) over a period, which are those of this one and others."""
        middle = 0.5 * (nodes[:-1] + nodes[1:])
        turns = np.floor((middle - self.nodes[0]) / self.period) * self.period
        cell = np.minimum(np.searchsorted(self.nodes[1:], middle - turns, side="right"), len(self.nodes) - 2)
        c0, c1, c2, c3 = self.cubics[cell].T
        x = nodes[:-1] - turns - self.nodes[cell]
        moved = [c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + x * 3.0 * c3), c2 + 3.0 * x * c3, c3]
        return PeriodicInterpolant(self.period, nodes, np.stack(moved, axis=1))


def on_common_nodes(
    one: PeriodicInterpolant, two: PeriodicInterpolant
) -> tuple[PeriodicInterpolant, PeriodicInterpolant]:
    """Two functions of one period on the nodes of both; the first, if it is flat, may have any period."""
    if not one.cubics[:, 1:].any() and len(one.nodes) == 2:
        one = replace(one, period=two.period, nodes=two.nodes[0] + np.array([0.0, two.period]))
    start, period = one.nodes[0], one.period
    every = start + np.mod(np.concatenate([one.nodes[:-1], two.nodes[:-1]]) - start, period)
    nodes = np.sort(every)
    nodes = nodes[np.append(True, np.diff(nodes) > 1e-9 * period)]
    nodes = np.append(nodes[nodes < start + (1.0 - 1e-9) * period], start + period)
    return one.on_nodes(nodes), two.on_nodes(nodes)


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
    phase: ArrayLike, values: ArrayLike, period: float, *, method: str = "cubic", widest_gap: float = WIDEST_GAP
) -> PeriodicInterpolant:
    """Interpolate samples of a periodic function.

    Parameters
    ----------
    phase, values : array_like, shape (n,)
        Samples in any order and any cycle; a phase that occurs twice counts once (first come), values that are NaN
        are left out.
    period
        Length of one cycle, in the unit of the phase.
    method : str
        ``cubic``, with monotone slopes, or ``linear``.
    widest_gap
        Largest stretch without a sample, as a share of the period, that counts as covered.

    Raises
    ------
    InputError
        When the samples do not cover the cycle, or contradict each other whole cycles apart.
    """
    if method not in METHODS:
        raise InputError("interpolation", method, "must be one of " + ", ".join(METHODS))
    phase, values = np.asarray(phase, dtype=float), np.asarray(values, dtype=float)
    check_repeats(phase, values, period)
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


def check_repeats(phase: Array, values: Array, period: float, source: str | None = None) -> None:
    """Raise `InputError` for samples of a periodic function that contradict each other.

    Each sample is held against the straight line between the two samples beside it, in phase, from the cycles before
    its own. It may be off by `AGREEING` of the largest value and, towards the middle of that line, by what the four
    nearest of those samples differ by.

    Parameters
    ----------
    phase, values : ndarray, shape (n,)
        Samples in any order (rad, any unit); values that are NaN are left out.
    period
        Length of one cycle (rad).
    source
        Where they are from, for the message.
    """
    rows = np.flatnonzero(np.isfinite(values) & np.isfinite(phase))
    if len(rows) == 0:
        return
    first = rows[0]
    turn = np.floor((phase[rows] - phase[first]) / period + 1e-9).astype(np.int64)
    # equal angles contradict each other too: of each angle only the first come belongs to the cycle itself
    _, earliest = np.unique(phase[rows], return_index=True)
    repeated = np.setdiff1d(np.arange(len(rows)), earliest)
    order = [np.intersect1d(np.flatnonzero(turn == number), earliest) for number in sorted(set(turn.tolist()), key=abs)]
    allowed = AGREEING * float(np.abs(values[rows]).max())
    before = rows[order[0]]
    for later in (*(rows[part] for part in order[1:]), rows[repeated]):
        places, source_of = distinct_phases(phase[before], period)
        known = np.empty(len(places), dtype=np.int64)
        known[source_of[::-1]] = before[::-1]
        low, share, gap = _between(places, phase[later], period)
        n = len(places)
        around = values[known[(low[:, None] + np.arange(-1, 3)) % n]]
        line = around[:, 1] + share * (around[:, 2] - around[:, 1])
        room = allowed + 4.0 * share * (1.0 - share) * np.ptp(around, axis=1)
        beside = np.minimum(share, 1.0 - share) * gap
        comparable = (gap <= WIDEST_GAP * period) | (beside <= 1e-9 * period)
        off = np.where(comparable, np.abs(values[later] - line) - room, -np.inf)
        if len(off) and off.max() > 0.0:
            worst = int(off.argmax())
            one = int(known[(low[worst] + (share[worst] > 0.5)) % n])
            raise _contradiction(phase, values, period, (one, int(later[worst])), source)
        before = np.concatenate([before, later])


def _between(places: Array, phase: Array, period: float) -> tuple[IntArray, Array, Array]:
    """Return the number of the last of rising places in [0, period) at or before each phase, the share of the way to
    the next one, and the distance between the two."""
    wrapped = np.mod(phase, period)
    low = np.searchsorted(places, wrapped + 1e-9 * period, side="right") - 1
    start = np.where(low < 0, places[-1] - period, places[low])
    following = (low + 1) % len(places)
    gap = np.where(following == 0, places[0] + period, places[following]) - start
    share = np.clip((wrapped - start) / np.where(gap > 0.0, gap, period), 0.0, 1.0)
    return low % len(places), share, np.asarray(gap)


def _contradiction(phase: Array, values: Array, period: float, pair: tuple[int, int], source: str | None) -> InputError:
    """The error for two samples."""
    said = [f"row {i + 1} ({np.degrees(phase[i]):.6g} deg: {values[i]:.6g})" for i in sorted(pair)]
    problem = f"contradicts itself: {said[0]} against {said[1]}, with a mesh cycle of {np.degrees(period):.6g} deg"
    return InputError("stiffness curve", source, problem, "keep the rows of one mesh cycle, or correct the mesh cycle")


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
