r"""Mesh law of gears whose load varies along the face width: one energy over phase, approach and tilt.

With the pinion angle :math:`\varphi`, the approach :math:`\delta` in the middle of the common width and the tilt
:math:`\gamma` of the gears in the plane of action, contact without friction stores

.. math:: W(\varphi, \delta, \gamma) = E(\varphi, x, \gamma), \qquad x = \delta - t(\varphi, \gamma), \qquad
          E = 0 \text{ for } x \le 0 ,

t the approach at which the rigid flanks touch. Force, moment about the middle of the width, and moment on the phase are

.. math::
    F = \frac{\partial W}{\partial\delta} = E_x,\qquad
    G = \frac{\partial W}{\partial\gamma} = E_\gamma - F\,t_\gamma,\qquad
    M = \frac{\partial W}{\partial\varphi} = E_\varphi - F\,t_\varphi ,

so a mesh without damping keeps its energy whichever way approach, tilt and phase go. On the driver acts the torque
:math:`-r_{b1} F - M`, on the driven gear :math:`r_{b2} F`.

**Form.** On each cell of phase, x and tilt E is a polynomial. Over x it is of degree five and has the energy, the force
and the tangent of the contact at both ends of the cell. Over the tilt it is cubic, with the contact's moment and the
change of its force there; t is a cubic spline. Over the phase all are periodic cubic splines. Beyond the last nodes the
force goes on linear in x, and linear in the tilt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.typing import Array, BoolArray, IntArray
from .load_search import Response, approach_of_force

#: Phases at which means over the mesh cycle are taken.
PHASES = 72
#: Tilt over the width (m) beyond which a law that was made for none is not known.
LEAST_TILT = 1e-8
#: Coefficients of a cell: powers of x, of the tilt, and of the phase.
POWERS = 6, 4, 4


class WidthForces(NamedTuple):
    """The law at n places, each of shape (n,).

    Attributes
    ----------
    force, moment, couple
        F (N), M on the phase (N m) and G on the tilt (N m).
    tangent, cross, by_tilt
        Derivatives of F with approach (N/m), phase (N/rad) and tilt (N/rad).
    bend, twist
        Derivatives of M with phase and tilt (N m/rad).
    against
        Derivative of G with the tilt (N m/rad).
    energy
        W (J).
    beyond
        Whether approach or tilt are farther than the law is known.
    """

    force: Array
    moment: Array
    couple: Array
    tangent: Array
    cross: Array
    by_tilt: Array
    bend: Array
    twist: Array
    against: Array
    energy: Array
    beyond: BoolArray


class Linearised(NamedTuple):
    r"""Means over a mesh cycle of :math:`F = k(\delta + \ell\gamma - e)`, :math:`G = \ell F + m + \kappa\gamma`.

    Attributes
    ----------
    stiffness, lever, moment, against
        k (N/m), l (m), m (N m) and kappa (N m/rad), which is not negative.
    """

    stiffness: float
    lever: float
    moment: float
    against: float


@dataclass(frozen=True, eq=False)
class WidthLaw:
    """Law of a pair's driving flanks over the face width; n cells of the phase, m of x, g tilts.

    Parameters
    ----------
    nodes : ndarray, shape (n + 1,)
        Pinion angles (rad) between which the law is a polynomial; the last is the first plus a mesh cycle.
    overlaps : ndarray, shape (m,)
        First x of each cell (m), from 0; the last cell begins at the reach and goes on from there.
    tilts : ndarray, shape (g,)
        Rising tilts (rad) of the nodes; cell 0 lies before the first, cell i goes on from node i - 1. One: E is
        linear in the tilt, for gears that cannot tilt.
    touch : ndarray, shape (n, g + 1, 4, 4)
        Coefficients of t on a cell: power of the tilt, of the phase (m, ...).
    energies : ndarray, shape (n, m, g + 1, 6, 4, 4)
        Coefficients of E on a cell: power of x, of the tilt, of the phase (J, ...).
    base_radii
        Of pinion and wheel (m).
    width
        Common face width (m).
    backlash
        Backlash along the line of action in the transverse section, of the pair's geometry (m).
    largest_force
        Mesh force (N) up to which the law is known at every phase without a tilt.
    error, rms_error
        Largest error of the force, or of the moment over half the width, in parts of the force, and their root mean
        square. NaN where there is none.
    back
        Law of the back flanks, of the pair seen from behind; None: they are the mirror image of the driving ones.
    """

    nodes: Array
    overlaps: Array
    tilts: Array
    touch: Array
    energies: Array
    base_radii: tuple[float, float]
    width: float
    backlash: float
    largest_force: float
    error: float = math.nan
    rms_error: float = math.nan
    back: WidthLaw | None = None

    @property
    def sides(self) -> tuple[WidthLaw, WidthLaw]:
        """Of the driving flanks, and of the back flanks at the mirrored phase."""
        return self, self.back or self

    @property
    def cycle(self) -> float:
        """Pinion angle from one tooth to the next (rad)."""
        return float(self.nodes[-1] - self.nodes[0])

    @property
    def reach(self) -> float:
        """Largest x (m) for which the law is known."""
        return float(self.overlaps[-1])

    def stiffer(self, part: float) -> WidthLaw:
        """All forces larger by a part of themselves at the same approach and tilt."""
        factor = 1.0 + part
        back = None if self.back is None else self.back.stiffer(part)
        return replace(self, energies=factor * self.energies, largest_force=factor * self.largest_force, back=back)

    def about(self, lever: float) -> WidthLaw:
        """The law of approach and moment about a place along the axis, so far from the middle of the width (m)."""
        touch = self.touch.copy()
        origins = np.concatenate([self.tilts[:1], self.tilts])
        touch[:, :, 0, 0] += lever * origins
        touch[:, :, 1, 0] += lever
        return replace(self, touch=touch)

    def cells(self, angles: Array, overlaps: Array, tilts: Array) -> tuple[IntArray, ...]:
        """Cells of phase, x and tilt, shapes (n,)."""
        place = self.nodes[0] + np.mod(angles - self.nodes[0], self.cycle)
        phase = np.clip(np.searchsorted(self.nodes, place, side="right") - 1, 0, len(self.nodes) - 2)
        part = np.maximum(np.searchsorted(self.overlaps, overlaps, side="right") - 1, 0)
        return phase, part, np.searchsorted(self.tilts, tilts, side="right")

    def _places(self, angles: Array, tilts: Array) -> tuple[IntArray, IntArray, Array, Array]:
        """Cells of phase and tilt, and the powers with their first two derivatives, shapes (n, 3, 4)."""
        phase, _, side = self.cells(angles, np.zeros(len(angles)), tilts)
        z = self.nodes[0] + np.mod(angles - self.nodes[0], self.cycle) - self.nodes[phase]
        y = tilts - self.tilts[np.maximum(side - 1, 0)]
        return phase, side, _jet(z, 4), _jet(y, 4)

    def first_contact(self, angles: ArrayLike, tilts: ArrayLike = 0.0) -> Array:
        """Approach t (m) at which the rigid flanks touch, at pinion angles (n,) and tilts (rad)."""
        angle, tilt = (np.ravel(x) for x in np.broadcast_arrays(np.asarray(angles, float), np.asarray(tilts, float)))
        phase, side, z, y = self._places(angle, tilt)
        return np.asarray(np.einsum("nca,nc,na->n", self.touch[phase, side], y[:, 0], z[:, 0]))

    def __call__(self, angles: ArrayLike, approaches: ArrayLike, tilts: ArrayLike = 0.0) -> WidthForces:
        """Return forces at pinion angles (rad), approaches (m) and tilts (rad), all of shape (n,)."""
        given = (np.asarray(x, dtype=float) for x in (angles, approaches, tilts))
        angle, approach, tilt = (np.ravel(x) for x in np.broadcast_arrays(*given))
        return self.at(angle, approach - self.first_contact(angle, tilt), tilt)

    def at(self, angle: Array, overlap: Array, tilt: Array) -> WidthForces:
        """Return forces at pinion angles (rad), x (m) and tilts (rad), all of shape (n,)."""
        finite = np.isfinite(angle) & np.isfinite(overlap) & np.isfinite(tilt)
        angle, tilt = np.where(finite, angle, 0.0), np.where(finite, tilt, 0.0)
        phase, side, z, y = self._places(angle, tilt)
        part = self.cells(angle, np.where(finite, overlap, 0.0), tilt)[1]
        x = _jet(np.where(finite, np.maximum(overlap, 0.0), 0.0) - self.overlaps[part], POWERS[0])
        t = np.einsum("nca,njc,nka->njk", self.touch[phase, side], y, z)
        over_z = np.einsum("nbca,nka->nkbc", self.energies[phase, part, side], z)
        E = np.einsum("nkbc,nib,njc->nijk", over_z, x, y)  # derivatives with x, tilt and phase
        bears = np.where(finite, overlap > 0.0, math.nan)
        force, tx, ty = E[:, 1, 0, 0], t[:, 0, 1], t[:, 1, 0]
        of_phase, of_tilt = E[:, 1, 0, 1] - E[:, 2, 0, 0] * tx, E[:, 1, 1, 0] - E[:, 2, 0, 0] * ty
        values = (
            force,
            E[:, 0, 0, 1] - force * tx,
            E[:, 0, 1, 0] - force * ty,
            E[:, 2, 0, 0],
            of_phase,
            of_tilt,
            E[:, 0, 0, 2] - E[:, 1, 0, 1] * tx - of_phase * tx - force * t[:, 0, 2],
            E[:, 0, 1, 1] - E[:, 1, 0, 1] * ty - of_tilt * tx - force * t[:, 1, 1],
            E[:, 0, 2, 0] - E[:, 1, 1, 0] * ty - of_tilt * ty - force * t[:, 2, 0],
            E[:, 0, 0, 0],
        )
        forces = [np.where(bears == 0.0, 0.0, bears * value) for value in values]
        return WidthForces._make([*forces, self.past(overlap, tilt)])

    def past(self, overlap: Array, tilt: Array) -> BoolArray:
        """Whether x (m) or tilt (rad) are farther than the law is known, shape (n,)."""
        least = LEAST_TILT / self.width if len(self.tilts) == 1 else 0.0
        tilted = (tilt < self.tilts[0] - least) | (tilt > self.tilts[-1] + least)
        return np.asarray((overlap > self.reach) | ((overlap > 0.0) & tilted))

    def most(self, angles: ArrayLike, tilts: ArrayLike = 0.0) -> Array:
        """Mesh force (N) up to which the law is known at pinion angles (n,) and tilts (rad)."""
        return self(angles, self.first_contact(angles, tilts) + self.reach, tilts).force

    def approach(self, angles: ArrayLike, forces: ArrayLike, tilts: ArrayLike = 0.0) -> Array:
        """Approach (m) that makes a mesh force (N) at a tilt (rad): the static transmission error under load.

        Raises
        ------
        InputError
            For a force beyond what the law is known for.
        """
        given = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (angles, forces, tilts))
        angle, force, tilt = (np.array(x) for x in np.broadcast_arrays(*given))

        def evaluate(numbers: IntArray, approaches: Array) -> Response:
            forces = self(angle[numbers], approaches, tilt[numbers])
            return Response(forces.force, forces.tangent)

        most = self.most(angle, tilt)
        return approach_of_force(evaluate, force, self.first_contact(angle, tilt), most, self.reach)

    def linearised(self, force: float) -> Linearised:
        """Return the spring of this law under a constant force (N) without a tilt."""
        angles = self.nodes[0] + self.cycle * (np.arange(PHASES) + 0.5) / PHASES
        at = self(angles, self.approach(angles, force))
        lever = float(np.mean(at.by_tilt) / np.mean(at.tangent))
        against = float(np.mean(at.against)) - lever * float(np.mean(at.by_tilt))
        return Linearised(float(at.tangent.mean()), lever, float(np.mean(at.couple)) - lever * force, max(0.0, against))

    @cached_property
    def tables(self) -> tuple[Array, ...]:
        """Nodes, first x of the cells, tilts, touch and energies, contiguous."""
        arrays = (self.nodes, self.overlaps, self.tilts, self.touch, self.energies)
        return tuple(np.ascontiguousarray(x, dtype=float) for x in arrays)


def _jet(x: Array, count: int) -> Array:
    """Powers of x up to count - 1 with two derivatives, shape (n, 3, count)."""
    powers = x[:, None] ** np.arange(count)
    jets = np.zeros((len(x), 3, count))
    jets[:, 0] = powers
    order = np.arange(1, count)
    jets[:, 1, 1:] = order * powers[:, :-1]
    jets[:, 2, 2:] = (order * (order - 1))[1:] * powers[:, :-2]
    return jets


@dataclass(frozen=True, eq=False)
class WidthTable:
    """Contacts on a grid of n phases, m values of x and g tilts, from which `law_of_table` makes a law.

    Attributes
    ----------
    angles : ndarray, shape (n,)
        Pinion angles (rad) of one mesh cycle.
    overlaps : ndarray, shape (m,)
        x (m), rising from 0.
    tilts : ndarray, shape (g,)
        Tilts (rad).
    touch : ndarray, shape (n, g)
        t (m).
    energy, force, tangent, couple, by_tilt : ndarray, shape (n, m, g)
        W (J), F (N), dF/d approach (N/m), G (N m) and dF/d tilt (N/rad).
    """

    angles: Array
    overlaps: Array
    tilts: Array
    touch: Array
    energy: Array
    force: Array
    tangent: Array
    couple: Array
    by_tilt: Array


def law_coefficients(table: WidthTable, cycle: float) -> tuple[Array, Array]:
    """Return the coefficients `touch` and `energies` of a `WidthLaw`.

    Parameters
    ----------
    table : WidthTable
        Contacts.
    cycle : float
        Mesh cycle (rad).
    """
    from scipy.interpolate import CubicSpline  # a train with springs only needs none: its import takes half a second

    nodes = np.append(table.angles, table.angles[0] + cycle)
    tilts, jets = table.tilts, np.stack([table.energy, table.force, table.tangent])
    rise, stiffening = np.zeros_like(table.touch), np.zeros_like(table.tangent)
    if len(tilts) > 1:
        rise, stiffening = (CubicSpline(tilts, x, axis=-1)(tilts, 1) for x in (table.touch, table.tangent))
    moved = rise[:, None, :]  # of the first contact: slopes are those at a fixed x
    slopes = np.stack([table.couple + table.force * moved, table.by_tilt + table.tangent * moved, stiffening])
    energies = _over_tilt(tilts, *(_over_overlap(table.overlaps, values) for values in (jets, slopes)))
    touch = _over_tilt(tilts, table.touch, rise)
    return _over_phase(nodes, touch), np.moveaxis(_over_phase(nodes, energies), 2, 3)


def _over_overlap(overlaps: Array, jets: Array) -> Array:
    """Coefficients over x, lowest first, of values and two derivatives (3, n, m, g) at its nodes: (n, m, 6, g)."""
    value, slope, bend = jets
    h = np.diff(overlaps)[:, None]
    powers = np.zeros((*value.shape[:2], POWERS[0], value.shape[2]))
    powers[:, :, 0], powers[:, :, 1], powers[:, :, 2] = value, slope, 0.5 * bend
    low = powers[:, :-1]
    # what value, slope and bend lack at the other end, in powers of the cell's width
    off = value[:, 1:] - low[:, :, 0] - h * (low[:, :, 1] + h * low[:, :, 2])
    steep = h * (slope[:, 1:] - low[:, :, 1] - 2.0 * h * low[:, :, 2])
    bent = h**2 * (bend[:, 1:] - bend[:, :-1])
    powers[:, :-1, 3] = (10.0 * off - 4.0 * steep + 0.5 * bent) / h**3
    powers[:, :-1, 4] = (-15.0 * off + 7.0 * steep - bent) / h**4
    powers[:, :-1, 5] = (6.0 * off - 3.0 * steep + 0.5 * bent) / h**5
    return powers


def _over_tilt(tilts: Array, values: Array, slopes: Array) -> Array:
    """Coefficients over the tilt, lowest first, of values and slopes (..., g) at the tilts: shape (..., g + 1, 4)."""
    g = len(tilts)
    powers = np.zeros((*values.shape[:-1], g + 1, 4))
    powers[..., 1:, 0], powers[..., 1:, 1] = values, slopes
    powers[..., 0, :2] = powers[..., 1, :2]
    h = np.diff(tilts)
    secant = np.diff(values, axis=-1) / h
    powers[..., 1:g, 2] = (3.0 * secant - 2.0 * slopes[..., :-1] - slopes[..., 1:]) / h
    powers[..., 1:g, 3] = (slopes[..., :-1] + slopes[..., 1:] - 2.0 * secant) / h**2
    return powers


def _over_phase(nodes: Array, values: Array) -> Array:
    """Coefficients over the phase of periodic values (n, ...) at its nodes: shape (n, ..., 4)."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(nodes, np.concatenate([values, values[:1]]), bc_type="periodic")
    return np.moveaxis(spline.c[::-1], 0, -1)


class WidthLaws(NamedTuple):
    """l laws over the face width, filled up to the largest, for compiled recurrences: see `WidthLaw`."""

    cells: IntArray  # (l,) cells of the phase
    parts: IntArray  # (l,) cells of x
    sides: IntArray  # (l,) tilts
    nodes: Array  # (l, n + 1)
    overlaps: Array  # (l, m)
    tilts: Array  # (l, g)
    touch: Array  # (l, n, g + 1, 4, 4)
    energies: Array  # (l, n, m, (g + 1) 6, 4, 4)


def stacked_width_laws(laws: list[WidthLaw]) -> WidthLaws:
    """Arrays of laws over the face width, side by side."""
    shapes = np.array([law.energies.shape[:3] for law in laws], dtype=np.int64).reshape(-1, 3)
    n, m, g = shapes.max(axis=0, initial=1).tolist()
    count = len(laws)
    cells, parts, sides = shapes.T.copy()
    stacked = WidthLaws(
        cells,
        parts,
        sides - 1,
        np.zeros((count, n + 1)),
        np.zeros((count, m)),
        np.zeros((count, g)),
        np.zeros((count, n, g, 4, 4)),
        np.zeros((count, n, m, g * POWERS[0], 4, 4)),
    )
    for i, law in enumerate(laws):
        nodes, overlaps, tilts, touch, energies = law.tables
        a, b, c = energies.shape[:3]
        stacked.nodes[i, : a + 1], stacked.overlaps[i, :b], stacked.tilts[i, : c - 1] = nodes, overlaps, tilts
        stacked.touch[i, :a, :c] = touch
        stacked.energies[i, :a, :b, : c * POWERS[0]] = energies.reshape(a, b, -1, 4, 4)
    return stacked
