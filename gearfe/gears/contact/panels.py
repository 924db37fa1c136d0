r"""Unilateral pressure on panels, for all contacts of many positions at once.

Each contact has n panels over its window; the pressure p (N/m2) is constant on each. With the gap g that the faces
would have without these pressures, and the influence K of all panels of one position on each other,

.. math::
    p \ge 0, \qquad g + K p \ge 0, \qquad p\,(g + K p) = 0 .

The gap is closed on the loaded panels. An active-set iteration finds them: it removes panels that pull and adds panels
that overlap, until none does.

**Surfaces.** A line load f per width at t moves the surface of a half-plane at s by
:math:`-\tfrac{2}{\pi E'}\ln|s-t|\,f` plus a constant (Flamant). :math:`E'` is :math:`E/(1-\nu^2)` in plane strain and E
in plane stress. At the corner of a wedge of half angle :math:`\alpha` it moves points at the distance y from the corner
by :math:`-\tfrac{1}{E'}\,A\ln y\,f` with the tensor

.. math:: A = \mathrm{diag}\Big(\frac{1}{\alpha+\tfrac12\sin 2\alpha},\;\frac{1}{\alpha-\tfrac12\sin 2\alpha}\Big)

along and across its middle (Timoshenko & Goodier, *Theory of Elasticity*, sec. 38). A flank that ends in a corner is a
half-plane seen from near and a wedge seen from far,

.. math::
    u(s) \approx -\tfrac{1}{E'}\Big(\tfrac2\pi\ln|s-t|\,I + W\ln(y(s)+y(t))\Big) f, \qquad W = A - \tfrac2\pi I .

The exact wedge (Mellin's transform) has a further bounded term, zero at a right angle. It is left out: it changes the
torques of sharp tips by at most 0.006 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.typing import Array, BoolArray, IntArray

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
    pair : ndarray, shape (p,)
        Tooth pair of each contact.
    first, second : ndarray, shape (c,)
        The contacts i and j of each couple, in rising order.
    positions, slots
        Number of positions, and most contacts of one.
    """

    position: IntArray
    slot: IntArray
    pair: IntArray
    first: IntArray
    second: IntArray
    positions: int
    slots: int

    @cached_property
    def step(self) -> IntArray:
        """Tooth pair's number of i less that of j, shape (c,): 0 for contacts of one tooth pair."""
        return self.pair[self.first] - self.pair[self.second]

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
        """Which contacts share a tooth pair: these with the tooth pairs as positions."""
        new = (np.diff(self.position, prepend=-1) != 0) | (np.diff(self.pair, prepend=0) != 0)
        return couplings(np.cumsum(new) - 1, np.zeros_like(self.pair), int(new.sum()))

    def total(self, of_contacts: Array | BoolArray) -> Array:
        """Sums over the contacts of each position, shape (positions,)."""
        return np.bincount(self.position, of_contacts, self.positions).astype(float, copy=False)

    def sums(self, of_couples: Array) -> Array:
        """Sums over the couples of each first contact, shape (p, ...)."""
        return np.asarray(np.add.reduceat(of_couples, self.starts))

    def matrices(self, blocks: Array) -> Array:
        """Matrices of the positions, shape (positions, z n, z n) with z slots, of blocks by couple, shape (c, n, n)."""
        z, n = self.slots, blocks.shape[1]
        if z == 1:
            return blocks
        made = np.zeros((self.positions, z, n, z, n))
        made[self.position[self.first], self.slot[self.first], :, self.slot[self.second]] = blocks
        return made.reshape(self.positions, z * n, z * n)

    def vectors(self, of_contacts: Array) -> Array:
        """Vectors of the positions, shape (positions, z n, ...), of parts by contact, shape (p, n, ...); 0 in empty
        slots.
        """
        n, *shape = of_contacts.shape[1:]
        made = of_contacts
        if len(self.position) < self.positions * self.slots:
            made = np.zeros((self.positions, self.slots, n, *shape), dtype=of_contacts.dtype)
            made[self.position, self.slot] = of_contacts
        return made.reshape(self.positions, self.slots * n, *shape)

    def parts(self, vectors: Array) -> Array:
        """The parts by contact, shape (p, n, ...), of vectors of the positions."""
        n, full = vectors.shape[1] // self.slots, self.positions * self.slots
        made = vectors.reshape(full, n, *vectors.shape[2:])
        return made if len(self.position) == full else made[self.slots * self.position + self.slot]


def couplings(position: IntArray, pair: IntArray, positions: int) -> Couplings:
    """Couples of the contacts of tooth pairs `pair` at `position`, both of shape (p,), sorted by both."""
    slot = np.arange(len(position)) - np.searchsorted(position, position)
    slots = int(slot.max(initial=0)) + 1
    at = np.full((positions, slots), -1)
    at[position, slot] = np.arange(len(position))
    mates = at[position]
    first, place = np.nonzero(mates >= 0)
    return Couplings(position, slot, pair, first, mates[first, place], positions, slots)


def influence(half: Array, compliance: float) -> Array:
    """K of half-planes on panels over windows of half width `half` (m), shape (p,), `compliance` = 2/pi sum 1/E'."""
    scale = (compliance * half)[:, None, None]
    made = scale * LOGS
    made -= scale * np.log(half)[:, None, None] * WIDTHS
    return made


def unilateral(
    couples: Couplings,
    K: Array,
    T: Array,
    width: Array,
    gap: Array,
    bearing: BoolArray,
    *,
    held: bool = False,
) -> tuple[Array, Array, BoolArray]:
    r"""Solve the unilateral problems of m positions with n panels a contact.

    Tooth pairs feel each other by forces alone. Under the forces of all contacts, F, the panels of one tooth pair carry
    :math:`p = p_0 - P\,T F`. The pressures :math:`p_0` close the gap, and P are those of an approach of 1 at each of
    the pair's contacts. The sums of p over the panels are the equations for F.

    Parameters
    ----------
    couples : Couplings
        Which contacts share a position.
    K : ndarray, shape (q, n, n)
        Approach of the panels' middles by pressures on the panels of the same tooth pair, by couple of
        `couples.beside` (m/Pa).
    T : ndarray, shape (c,)
        Approach of all panels of the first contact by a unit force per width on the second (m2/N).
    width, gap : ndarray, shape (p, n)
        Widths of the panels and g (m).
    bearing : ndarray of bool, shape (p, n)
        First guess of the loaded panels.
    held : bool
        Whether that is no guess but the set of loaded panels.

    Returns
    -------
    pressure, approach : ndarray, shape (p, n)
        p (Pa), and what it brings the panels' middles nearer by (m).
    settled : ndarray of bool, shape (m,)
        Whether the set of loaded panels was found.
    """
    pairs, n = couples.beside, gap.shape[1]
    z, K, far_field = pairs.slots, pairs.matrices(K), couples.matrices(T[:, None, None])
    right = np.zeros((len(gap), n, z + 1))
    right[:, :, 0] = -gap
    right[np.arange(len(gap)), :, 1 + pairs.slot] = 1
    right, on = pairs.vectors(right), pairs.vectors(bearing)
    beside, column = couples.step == 0, 1 + pairs.slot[pairs.second]
    made, yields, nothing = np.empty_like(right), np.zeros(len(T)), np.eye(z * n)
    new: Any = slice(None)  # tooth pairs whose panels are to be solved
    for _ in range(1 if held else CHANGES):
        mask = on[new]
        system = np.where(mask[:, :, None] & mask[:, None], K[new], nothing)
        made[new] = np.linalg.solve(system, np.where(mask[:, :, None], right[new], 0.0))
        answers = pairs.parts(made)
        forces = (width[:, None] @ answers)[:, 0]
        yields[beside] = forces[pairs.first, column]
        system = np.eye(couples.slots) + couples.matrices(yields[:, None, None]) @ far_field
        found = np.linalg.solve(system, couples.vectors(forces[:, :1])[:, :, None])
        even = couples.parts((far_field @ found)[:, :, 0])
        back = pairs.vectors(even)[pairs.position]
        pressure = answers[:, :, 0] - (answers[:, :, 1:] @ back[:, :, None])[:, :, 0]
        approach = pairs.parts((K @ pairs.vectors(pressure)[:, :, None])[:, :, 0]) + even
        bound = ROUNDING * np.abs(approach).max(axis=1, keepdims=True)
        now = pairs.vectors(np.where(pairs.parts(on), pressure > 0, gap + approach < -bound))
        new = np.flatnonzero((now != on).any(axis=1))
        if len(new) == 0:
            break
        on = now
    settled = np.ones(couples.positions, dtype=bool)
    settled[couples.position[np.isin(pairs.position, new)]] = False
    return pressure, approach, settled


def first_guess(gap: Array) -> BoolArray:
    """Panels that bear, where the ends of the window lie a quarter beyond Hertz's contact."""
    least = gap.min(axis=1, keepdims=True)
    end = gap[:, [0, -1]].min(axis=1, keepdims=True)
    return np.asarray(gap < least + 0.75 * (end - least))
