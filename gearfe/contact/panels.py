r"""Unilateral pressure on panels, for all tooth pairs of many positions at once.

Each tooth pair has n panels over its window; the pressure p (N/m2) is constant on each. With the gap g that the faces
would have without their own local deformation, the influence K of the panels on each other, and the compliance T
between the forces per width :math:`F=\int p` of the pairs of one position,

.. math::
    p \ge 0, \qquad g + K p + y \ge 0, \qquad p\,(g + K p + y) = 0, \qquad y = T (F - F_0),

where the gap holds the forces F_0 already. On the set of panels that bear, every pair gives F = c - S y with two right
sides of one matrix, and the few forces of a position follow from a system of their own size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .wedge import log_integral

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Panels of a window, and changes of the set of panels that bear before a solution is given up.
PANELS, CHANGES = 28, 40
#: Edges of the panels on a window of half width 1 (closer at its ends, where the pressure is steep); middles; widths.
EDGES = -np.cos(np.linspace(0, math.pi, PANELS + 1))
MIDDLES, WIDTHS = 0.5 * (EDGES[1:] + EDGES[:-1]), np.diff(EDGES)
#: Minus the integral of ln|x - s| over each panel, at the middles of all, shape (n, n).
LOGS = -np.diff(log_integral(EDGES - MIDDLES[:, None]), axis=1)
#: Overlap of a panel that does not bear, relative to the deepest local approach, from which it is let in.
ROUNDING = 1e-11


@dataclass(frozen=True)
class Couplings:
    """Which tooth pairs share a position: all ordered couples (i, j) of pairs of one position, with i = j.

    Attributes
    ----------
    position, slot : ndarray, shape (p,)
        Position of each pair, and its number within the position.
    first, second : ndarray, shape (c,)
        The pairs i and j of each couple.
    step : ndarray, shape (c,)
        Pair number of i less that of j.
    positions, slots
        Number of positions, and most pairs of one.
    """

    position: IntArray
    slot: IntArray
    first: IntArray
    second: IntArray
    step: IntArray
    positions: int
    slots: int

    @cached_property
    def starts(self) -> IntArray:
        """Where the couples of each first pair start, shape (p,)."""
        return np.searchsorted(self.first, np.arange(len(self.position)))

    @cached_property
    def own(self) -> IntArray:
        """Couple of each pair with itself, shape (p,)."""
        return np.flatnonzero(self.first == self.second)

    def total(self, of_pairs: Array | NDArray[np.bool_]) -> Array:
        """Sums over the pairs of each position, shape (positions,)."""
        return np.bincount(self.position, of_pairs, self.positions).astype(float)

    def times(self, matrix: Array, vector: Array) -> Array:
        """sum_j matrix_ij vector_j for each pair i; `matrix` has one entry a couple, shape (c,)."""
        return np.bincount(self.first, matrix * vector[self.second], len(self.position)).astype(float)

    def solved(self, free: Array, stiffness: Array, matrix: Array) -> Array:
        """F with F + stiffness * (matrix F) = free, pair by pair within its position, shape (p,)."""
        size = (self.positions, self.slots)
        system, right = np.zeros((*size, self.slots)), np.zeros(size)
        at = self.position[self.first]
        system[at, self.slot[self.first], self.slot[self.second]] = stiffness[self.first] * matrix
        right[self.position, self.slot] = free
        solution = np.linalg.solve(system + np.eye(self.slots), right[..., None])[..., 0]
        return np.asarray(solution[self.position, self.slot])


def couplings(position: IntArray, number: IntArray, positions: int) -> Couplings:
    """Couples of the tooth pairs `number` at `position`, both of shape (p,), sorted by position."""
    slot = np.arange(len(position)) - np.searchsorted(position, position)
    slots = int(slot.max(initial=0)) + 1
    at = np.full((positions, slots), -1)
    at[position, slot] = np.arange(len(position))
    mates = at[position]
    first, place = np.nonzero(mates >= 0)
    second = mates[first, place]
    return Couplings(position, slot, first, second, number[first] - number[second], positions, slots)


@dataclass(frozen=True)
class Pressed:
    """Solution of the unilateral problem.

    Attributes
    ----------
    force : ndarray, shape (p,)
        Force per width of each pair (N/m).
    pressure : ndarray, shape (p, n)
        On the panels (Pa).
    approach : ndarray, shape (p, n)
        K p (m).
    settled : ndarray of bool, shape (p,)
        Whether the set of panels that bear was found.
    """

    force: Array
    pressure: Array
    approach: Array
    settled: NDArray[np.bool_]


def influence(half: Array, compliance: float) -> Array:
    """K of half-planes on panels over windows of half width `half` (m), shape (p,), `compliance` = 2/pi sum 1/E'."""
    log = np.log(half)[:, None, None] * WIDTHS
    return np.asarray(compliance * half[:, None, None] * (LOGS - log))


def pressed(
    K: Array,
    gap: Array,
    widths: Array,
    T: Array,
    carried: Array,
    couples: Couplings,
    bearing: NDArray[np.bool_],
    *,
    held: bool = False,
) -> Pressed:
    """Solve the unilateral problem.

    Parameters
    ----------
    K : ndarray, shape (p, n, n)
        Approach of the panels' middles for pressures on the panels (m/Pa).
    gap, widths : ndarray, shape (p, n)
        Gap at the panels' middles and widths of the panels (m).
    T : ndarray, shape (c,)
        Compliance between the pairs (m2/N), by couple.
    carried : ndarray, shape (p,)
        F_0, the forces per width (N/m) that the gap holds.
    bearing : ndarray of bool, shape (p, n)
        First guess of the panels that bear.
    held
        Whether that is no guess but what bears.
    """
    n = gap.shape[1]
    diagonal = np.arange(n)
    on = bearing
    right = np.stack([-gap, np.ones_like(gap)], axis=2)
    y0 = -couples.times(T, carried)
    for _ in range(1 if held else CHANGES):
        if on.all():
            both = np.linalg.solve(K, right)
        else:
            system = np.where(on[:, :, None] & on[:, None, :], K, 0.0)
            system[:, diagonal, diagonal] = np.where(on, K[:, diagonal, diagonal], 1.0)
            both = np.linalg.solve(system, np.where(on[:, :, None], right, 0.0))
        free, stiffness = (widths[:, None, :] @ both)[:, 0].T
        force = couples.solved(free - stiffness * y0, stiffness, T)
        y = (couples.times(T, force) + y0)[:, None]
        p = both[:, :, 0] - both[:, :, 1] * y
        approach = (K @ p[:, :, None])[:, :, 0]
        bound = ROUNDING * np.abs(approach).max(axis=1, keepdims=True)
        now = np.where(on, p > 0, gap + y + approach < -bound)
        settled = (now == on).all(axis=1)
        if settled.all():
            break
        on = now
    # without a bearing panel the force is rounding
    return Pressed(np.where(on.any(axis=1), force, 0.0), np.where(on, p, 0.0), approach, settled)


def first_guess(gap: Array) -> NDArray[np.bool_]:
    """Panels that bear, where the ends of the window lie a quarter beyond Hertz's contact."""
    least = gap.min(axis=1, keepdims=True)
    end = gap[:, [0, -1]].min(axis=1, keepdims=True)
    return np.asarray(gap < least + 0.75 * (end - least))


def forces_of_overlaps(overlap: Array, compliance: float, T: Array, couples: Couplings) -> Array:
    """Forces per width (N/m) >= 0 that take up overlaps (m) when every pair yields by `compliance` (m2/N) besides T."""
    on = overlap > 0
    force = np.zeros_like(overlap)
    for _ in range(couples.slots + 1):
        force = couples.solved(np.where(on, overlap / compliance, 0.0), np.where(on, 1 / compliance, 0.0), T)
        if (force >= 0).all():
            break
        on = on & (force > 0)
    return np.maximum(force, 0.0)
