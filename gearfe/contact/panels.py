r"""Unilateral pressure on panels, for all contacts of many positions at once.

Each contact has n panels over its window; the pressure p (N/m2) is constant on each. With the gap g that the faces
would have without these pressures, and the influence K of all panels of one position on each other,

.. math::
    p \ge 0, \qquad g + K p \ge 0, \qquad p\,(g + K p) = 0 .

On the panels that bear the gap is closed; which bear is found by taking out those that pull and letting in those that
overlap, until none does.

**Surfaces.** A line load f per width at t moves the surface of a half-plane at s by :math:`-\tfrac{2}{\pi
E'}\ln|s-t|\,f` plus a constant, with :math:`E' = E/(1-\nu^2)` in plane strain and E in plane stress (Flamant); at the
corner of a wedge of half angle :math:`\alpha` points at the distance y from it by :math:`-\tfrac{1}{E'}\,A\ln y\,f`
with the tensor

.. math:: A = \mathrm{diag}\Big(\frac{1}{\alpha+\tfrac12\sin 2\alpha},\;\frac{1}{\alpha-\tfrac12\sin 2\alpha}\Big)

along and across its middle (Timoshenko & Goodier, *Theory of Elasticity*, sec. 38). A flank that ends in a corner is a
half-plane seen from near and a wedge seen from far,

.. math::
    u(s) \approx -\tfrac{1}{E'}\Big(\tfrac2\pi\ln|s-t|\,I + W\ln(y(s)+y(t))\Big) f, \qquad W = A - \tfrac2\pi I .

What the exact wedge (Mellin's transform) has besides is bounded, nothing at a right angle, and changes the torques of
sharp tips by at most 0.006 %: left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..typing import Array, BoolArray, IntArray

#: Rule that averages over an elliptic pressure on |x| < 1: Gauss-Chebyshev of the second kind, exact for polynomials of
#: degree 2 n - 1.
POINTS = 24
_TURN = math.pi * np.arange(1, POINTS + 1) / (POINTS + 1)
ELLIPSE_X = np.cos(_TURN)
ELLIPSE_W = np.sin(_TURN) ** 2 * 2.0 / (POINTS + 1)


def wedge_tensor(half_angle: float) -> Array:
    """W along (first) and across (second) the middle of a wedge, shape (2,) (-)."""
    sine = 0.5 * math.sin(2 * half_angle)
    return np.array([1 / (half_angle + sine), 1 / (half_angle - sine)]) - 2 / math.pi


def mean_log(x: Array, half_width: Array) -> Array:
    """Mean of ln|x - s| over an elliptic pressure on |s| < half_width, both in m.

    Inside it is ln(a/2) - 1/2 + (x/a)^2, outside what makes the surface of Hertz's contact.
    """
    r = np.abs(x) / half_width
    out = np.maximum(r, 1.0)
    far = out**2 - out * np.sqrt(out**2 - 1) + np.arccosh(out)
    return np.asarray(np.log(half_width / 2) - 0.5 + np.where(r <= 1.0, r**2, far))


def log_integral(z: Array) -> Array:
    """Integral of ln|z|: z ln|z| - z."""
    return z * np.log(np.where(z != 0, np.abs(z), 1.0)) - z


#: Distance (m) of two places that is none.
LEAST_DISTANCE = 1e-9
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
    """Which contacts share a position: all ordered couples (i, j) of contacts of one position, with i = j.

    Attributes
    ----------
    position, slot : ndarray, shape (p,)
        Position of each contact, and its number within the position.
    first, second : ndarray, shape (c,)
        The contacts i and j of each couple, in rising order.
    step : ndarray, shape (c,)
        Tooth pair's number of i less that of j: 0 for contacts of one tooth pair.
    positions, slots
        Number of positions, and most contacts of one.
    """

    position: IntArray
    slot: IntArray
    first: IntArray
    second: IntArray
    step: IntArray
    positions: int
    slots: int

    @cached_property
    def furthest(self) -> int:
        """Most teeth between two pairs of a position."""
        return int(np.abs(self.step).max(initial=0))

    @cached_property
    def own(self) -> IntArray:
        """Couple of each contact with itself, shape (p,)."""
        return np.flatnonzero(self.first == self.second)

    @cached_property
    def back(self) -> IntArray:
        """The couple (j, i) of each couple (i, j), shape (c,)."""
        return np.lexsort((self.first, self.second))

    @cached_property
    def starts(self) -> IntArray:
        """Where the couples of each first contact start, shape (p,)."""
        return np.searchsorted(self.first, np.arange(len(self.position)))

    @cached_property
    def beside(self) -> Couplings:
        """The couples of contacts of one tooth pair alone."""
        same = self.step == 0
        return replace(self, first=self.first[same], second=self.second[same], step=self.step[same])

    def total(self, of_contacts: Array | BoolArray) -> Array:
        """Sums over the contacts of each position, shape (positions,)."""
        return np.bincount(self.position, of_contacts, self.positions).astype(float, copy=False)

    def sums(self, of_couples: Array) -> Array:
        """Sums over the couples of each first contact, shape (p, ...)."""
        return np.asarray(np.add.reduceat(of_couples, self.starts))

    def matrices(self, blocks: Array) -> Array:
        """Matrices of the positions, shape (positions, z n, z n) with z slots, of blocks by couple, shape (c, n, n)."""
        z, n = self.slots, blocks.shape[1]
        made = np.zeros((self.positions, z, n, z, n))
        made[self.position[self.first], self.slot[self.first], :, self.slot[self.second]] = blocks
        return made.reshape(self.positions, z * n, z * n)

    def vectors(self, of_contacts: Array) -> Array:
        """Vectors of the positions, shape (positions, z n), of parts by contact, shape (p, n); 0 in empty slots."""
        n = of_contacts.shape[1]
        made = np.zeros((self.positions, self.slots, n), dtype=of_contacts.dtype)
        made[self.position, self.slot] = of_contacts
        return made.reshape(self.positions, self.slots * n)

    def parts(self, vectors: Array) -> Array:
        """The parts by contact, shape (p, n), of vectors of the positions."""
        n = vectors.shape[1] // self.slots
        made: Array = vectors.reshape(self.positions, self.slots, n)[self.position, self.slot]
        return made


def couplings(position: IntArray, number: IntArray, positions: int) -> Couplings:
    """Couples of the contacts of tooth pairs `number` at `position`, both of shape (p,), sorted by both."""
    slot = np.arange(len(position)) - np.searchsorted(position, position)
    slots = int(slot.max(initial=0)) + 1
    at = np.full((positions, slots), -1)
    at[position, slot] = np.arange(len(position))
    mates = at[position]
    first, place = np.nonzero(mates >= 0)
    second = mates[first, place]
    return Couplings(position, slot, first, second, number[first] - number[second], positions, slots)


def influence(half: Array, compliance: float) -> Array:
    """K of half-planes on panels over windows of half width `half` (m), shape (p,), `compliance` = 2/pi sum 1/E'."""
    log = np.log(half)[:, None, None] * WIDTHS
    return np.asarray(compliance * half[:, None, None] * (LOGS - log))


def unilateral(K: Array, gap: Array, bearing: BoolArray, *, held: bool = False) -> tuple[Array, BoolArray]:
    """Solve the unilateral problems of m positions with n unknowns each.

    Parameters
    ----------
    K : ndarray, shape (m, n, n)
        Approach of the panels' middles by pressures on all panels (m/Pa).
    gap : ndarray, shape (m, n)
        g (m).
    bearing : ndarray of bool, shape (m, n)
        First guess of the panels that bear.
    held
        Whether that is no guess but what bears.

    Returns
    -------
    pressure : ndarray, shape (m, n)
        p (Pa).
    settled : ndarray of bool, shape (m,)
        Whether the set of panels that bear was found.
    """
    pressure, settled, open_ = np.zeros_like(gap), np.zeros(len(gap), dtype=bool), np.arange(len(gap))
    for _ in range(1 if held else CHANGES):
        used = np.flatnonzero(bearing.any(axis=0))
        on, p = bearing[:, used], np.zeros_like(gap)
        system = np.where(on[:, :, None] & on[:, None], K[:, used[:, None], used], np.eye(len(used)))
        p[:, used] = np.linalg.solve(system, np.where(on, -gap[:, used], 0.0)[..., None])[..., 0]
        approach = (K @ p[..., None])[..., 0]
        bound = ROUNDING * np.abs(approach).max(axis=1, keepdims=True)
        now = np.where(bearing, p > 0, gap + approach < -bound)
        same = (now == bearing).all(axis=1)
        pressure[open_], settled[open_] = p, same
        if same.all():
            break
        K, gap, bearing, open_ = K[~same], gap[~same], now[~same], open_[~same]
    return pressure, settled


def first_guess(gap: Array) -> BoolArray:
    """Panels that bear, where the ends of the window lie a quarter beyond Hertz's contact."""
    least = gap.min(axis=1, keepdims=True)
    end = gap[:, [0, -1]].min(axis=1, keepdims=True)
    return np.asarray(gap < least + 0.75 * (end - least))
