r"""Unilateral pressure on panels, for all contacts of many positions at once.

Each contact has n panels over its window; the pressure p (N/m2) is constant on each. With the gap g that the faces
would have without their local deformation, the influence K of the panels on each other, of all contacts of one tooth
pair, and the compliance T between the forces per width :math:`F=\int p` of the contacts of one position,

.. math::
    p \ge 0, \qquad g + K p + y \ge 0, \qquad p\,(g + K p + y) = 0, \qquad y = T (F - F_0),

where the gap holds the forces F_0 already. On the set of panels that bear, every tooth pair of z contacts gives their
F = c - S y with 1 + z right sides of one matrix, and the few forces of a position follow from a system of their own
size.

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
from dataclasses import dataclass
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
        The contacts i and j of each couple.
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
    def starts(self) -> IntArray:
        """Where the couples of each first contact start, shape (p,)."""
        return np.searchsorted(self.first, np.arange(len(self.position)))

    @cached_property
    def own(self) -> IntArray:
        """Couple of each contact with itself, shape (p,)."""
        return np.flatnonzero(self.first == self.second)

    @cached_property
    def neighbours(self) -> IntArray:
        """Couples of different contacts of one tooth pair, shape (q,)."""
        return np.flatnonzero((self.step == 0) & (self.first != self.second))

    @cached_property
    def groups(self) -> list[IntArray]:
        """Contacts of each tooth pair, an array of shape (pairs, z) for every number z of them."""
        if len(self.neighbours) == 0:
            return [np.arange(len(self.position))[:, None]]
        together = self.step == 0
        first, second = self.first[together], self.second[together]
        counts = np.bincount(first)
        leads = second[np.searchsorted(first, np.arange(len(counts)))] == np.arange(len(counts))
        return [second[(counts == z)[first] & leads[first]].reshape(-1, z) for z in np.unique(counts)]

    @cached_property
    def dense(self) -> tuple[IntArray, IntArray]:
        """Places of contacts and couples among vectors and matrices of all slots, shapes (p,) and (c,)."""
        row = self.position * self.slots + self.slot
        return row, row[self.first] * self.slots + self.slot[self.second]

    def couple(self, first: IntArray, second: IntArray) -> IntArray:
        """Numbers of couples of contacts."""
        return np.asarray(self.starts.take(first) + self.slot.take(second))

    def total(self, of_contacts: Array | BoolArray) -> Array:
        """Sums over the contacts of each position, shape (positions,)."""
        return np.bincount(self.position, of_contacts, self.positions).astype(float, copy=False)

    def diagonal(self, of_contacts: Array) -> Array:
        """The diagonal matrix with these entries, by couple, shape (c,)."""
        return np.asarray(np.where(self.first == self.second, of_contacts[self.first], 0.0), dtype=float)

    def times(self, matrix: Array, vector: Array) -> Array:
        """sum_j matrix_ij vector_j for each contact i; `matrix` has one entry a couple, shape (c,)."""
        return np.bincount(self.first, matrix * vector.take(self.second), len(self.position)).astype(float, copy=False)

    def solved(self, free: Array, stiffness: Array, matrix: Array) -> Array:
        """F with F + stiffness (matrix F) = free within each position, shape (p,); both matrices by couple."""
        if self.slots == 1:
            return np.asarray(free / (1.0 + stiffness * matrix))
        size, row, place = self.slots, *self.dense
        if len(place) == self.positions * size * size:  # no slot is empty
            S, T, right = stiffness, matrix, free
        else:
            S, T, right = (np.zeros(self.positions * size**power) for power in (2, 2, 1))
            S[place], T[place], right[row] = stiffness, matrix, free
        system = S.reshape(-1, size, size) @ T.reshape(-1, size, size)
        system.reshape(-1, size * size)[:, :: size + 1] += 1.0
        return np.linalg.solve(system, right.reshape(-1, size, 1)).ravel().take(row)


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
    settled: BoolArray


def influence(half: Array, compliance: float) -> Array:
    """K of half-planes on panels over windows of half width `half` (m), shape (p,), `compliance` = 2/pi sum 1/E'."""
    log = np.log(half)[:, None, None] * WIDTHS
    return np.asarray(compliance * half[:, None, None] * (LOGS - log))


@dataclass(frozen=True)
class _Group:
    """Tooth pairs with z contacts each: the contacts, shape (P, z), and K of all their panels, shape (P, z n, z n)."""

    contacts: IntArray
    K: Array

    def responses(self, on: BoolArray, gap: Array) -> Array:
        """Pressures on the panels `on` for the gap and for an even approach in each contact, shape (P, z n, 1 + z)."""
        (count, z), n, size = self.contacts.shape, gap.shape[1], self.K.shape[1]
        right = np.zeros((count, size, 1 + z))
        right[..., 0] = -gap.take(self.contacts, axis=0).reshape(count, size)
        for k in range(z):
            right[:, k * n : (k + 1) * n, 1 + k] = 1.0
        bears = on.take(self.contacts, axis=0).reshape(count, size, 1)
        system = np.where(bears & bears.swapaxes(1, 2), self.K, np.eye(size))
        return np.asarray(np.linalg.solve(system, right * bears))


def _groups(K: Array, between: Array, couples: Couplings) -> list[_Group]:
    if len(couples.neighbours) == 0:
        return [_Group(couples.groups[0], K)]
    first, second = couples.first[couples.neighbours], couples.second[couples.neighbours]
    n, made = K.shape[1], []
    for contacts in couples.groups:
        count, z = contacts.shape
        whole = np.zeros((count, z, n, z, n))
        row, place = np.full((2, len(K)), -1)
        row[contacts], place[contacts] = np.arange(count)[:, None], np.arange(z)
        whole[row[contacts], place[contacts], :, place[contacts]] = K[contacts]
        mine = row[first] >= 0
        whole[row[first[mine]], place[first[mine]], :, place[second[mine]]] = between[mine]
        made.append(_Group(contacts, whole.reshape(count, z * n, z * n)))
    return made


def pressed(
    K: Array,
    between: Array,
    gap: Array,
    widths: Array,
    T: Array,
    carried: Array,
    couples: Couplings,
    bearing: BoolArray,
    *,
    held: bool = False,
) -> Pressed:
    """Solve the unilateral problem of p contacts with n panels each.

    Parameters
    ----------
    K : ndarray, shape (p, n, n)
        Approach of the panels' middles for pressures on the panels of the same contact (m/Pa).
    between : ndarray, shape (q, n, n)
        The same between contacts of one tooth pair, in the order of `Couplings.neighbours`.
    gap, widths : ndarray, shape (p, n)
        Gap at the panels' middles and widths of the panels (m).
    T : ndarray, shape (c,)
        Compliance between the contacts (m2/N), by couple.
    carried : ndarray, shape (p,)
        F_0, the forces per width (N/m) that the gap holds.
    bearing : ndarray of bool, shape (p, n)
        First guess of the panels that bear.
    held
        Whether that is no guess but what bears.
    """
    n, groups, on, responses = gap.shape[1], _groups(K, between, couples), bearing, []
    y0 = -couples.times(T, carried)
    pressure, approach, free, stiffness = np.empty_like(gap), np.empty_like(gap), np.empty(len(gap)), np.zeros(len(T))
    changed: BoolArray = np.zeros(0, dtype=bool)
    for number in range(1 if held else CHANGES):
        for k, group in enumerate(groups):
            part = group
            if number == 0:
                both = part.responses(on, gap)
                responses.append(both)
            else:
                rows = np.flatnonzero(changed.take(group.contacts).any(axis=1))
                if len(rows) == 0:
                    continue
                part = _Group(group.contacts[rows], group.K[rows])
                responses[k][rows] = both = part.responses(on, gap)
            (count, z), contacts = part.contacts.shape, part.contacts
            forces = (widths.take(contacts, axis=0)[:, :, None] @ both.reshape(count, z, n, 1 + z))[:, :, 0]
            free[contacts] = forces[:, :, 0]
            stiffness[couples.couple(contacts[:, :, None], contacts[:, None])] = forces[:, :, 1:]
        force = couples.solved(free - couples.times(stiffness, y0), stiffness, T)
        y = couples.times(T, force) + y0
        for group, both in zip(groups, responses, strict=True):
            p = both[:, :, 0] - (both[:, :, 1:] @ y.take(group.contacts)[:, :, None])[:, :, 0]
            pressure[group.contacts] = p.reshape(*group.contacts.shape, n)
            approach[group.contacts] = (group.K @ p[:, :, None]).reshape(*group.contacts.shape, n)
        bound = ROUNDING * np.abs(approach).max(axis=1, keepdims=True)
        now = np.where(on, pressure > 0, gap + y[:, None] + approach < -bound)
        changed = (now != on).any(axis=1)
        if not changed.any():
            break
        on = now
    # without a bearing panel the force is rounding
    return Pressed(np.where(on.any(axis=1), force, 0.0), np.where(on, pressure, 0.0), approach, ~changed)


def first_guess(gap: Array) -> BoolArray:
    """Panels that bear, where the ends of the window lie a quarter beyond Hertz's contact."""
    least = gap.min(axis=1, keepdims=True)
    end = gap[:, [0, -1]].min(axis=1, keepdims=True)
    return np.asarray(gap < least + 0.75 * (end - least))


def forces_of_overlaps(overlap: Array, compliance: Array, T: Array, couples: Couplings) -> Array:
    """Forces per width (N/m) >= 0 that take up overlaps (m) when contacts yield by `compliance` (m2/N) besides T."""
    on = overlap > 0
    force = np.zeros_like(overlap)
    for _ in range(couples.slots + 1):
        force = couples.solved(np.where(on, overlap / compliance, 0.0), couples.diagonal(on / compliance), T)
        if (force >= 0).all():
            break
        on = on & (force > 0)
    return np.maximum(force, 0.0)
