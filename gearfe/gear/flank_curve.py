r"""The flank of a tooth by its arc length: root, involute with its relief, and tip round as one tabulated curve.

Between knots on the exact curve, points are cubic in the arc length s with the exact points and unit tangents at both
ends (Hermite): with :math:`\tau = s - s_i`, :math:`z(s) = z_i + t_i\tau + c_i\tau^2 + d_i\tau^3`. The knots include all
marks, so kinks stay sharp; the error is :math:`h^4\kappa''/384` of the curvature :math:`\kappa`, nanometres and less.

A flank with a deviation is tabulated by the arc length of the flank without: the same material has the same s, however
far a waviness lengthens the curve, and the tangents are longer than 1 by half the square of the deviation's slope.

**Faces in mesh**, as loads and rotations have moved them, are seen along a common normal. About a centre O with the
unit normal n out of the pinion and the tangent t = -i n, a point is O + n h + t x. The face of a gear whose tooth is
turned by the unit number q about the gear's centre c, and displaced by d + d'(s - s_0) about the arc s_0, is

.. math:: Z(s) = q\,(z(s) + d + d'\,(s-s_0)) + c, \qquad h - i x = (Z(s) - O)/n .

At a given x its arc follows from Newton's method on the exact curve, and the gap between the faces is the difference of
their heights h at the same x: exact for any rotation and displacement of the faces. Arrays hold pinion and wheel in
their second axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..typing import Array, ComplexArray, IntArray
from .curves import Trochoid
from .face import Face, face_of
from .spur_gear import Gear

#: Knots on the involute, on the tip round and on the upper half of the root.
INVOLUTE, ROUND, ROOT = 513, 65, 129
#: Most cells of the grid that finds the piece at an arc length.
MOST_CELLS = 1 << 15
#: One-sided parameter (of a length of 1) at which the tangent at a knot is taken.
BESIDE = 1e-9

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class FlankCurve:
    """Flank of one tooth in its frame, by arc length.

    Attributes
    ----------
    face
        The working flank that it tabulates.
    parameter : ndarray, shape (k,)
        Parameter u of the knots: in [0, 1] on the involute, in [1, 2] on the tip round, below 0 in the root.
    arc : ndarray, shape (k,)
        Their arc length s (m), 0 where the working flank starts, rising to the tip.
    cubic : ndarray of complex, shape (4, k - 1)
        Coefficients of the powers of s - arc[i], in rising order.
    """

    face: Face
    parameter: Array
    arc: Array
    cubic: ComplexArray

    @property
    def low(self) -> float:
        """First arc length, in the root (m)."""
        return float(self.arc[0])

    @property
    def high(self) -> float:
        """Arc length of the end at the tip (m)."""
        return float(self.arc[-1])

    @cached_property
    def _tables(self) -> FlankTables:
        return flank_tables((self,))

    def at(self, s: Array) -> tuple[ComplexArray, ComplexArray]:
        """Points (m) and tangents dz/ds towards the tip at arc lengths s (m) within the curve."""
        made = self._tables.at(np.asarray(s)[None])
        return made[0][0], made[1][0]

    def arc_at(self, parameter: Any) -> Array:
        """Arc lengths (m) of parameters u, linear between the knots."""
        return np.interp(parameter, self.parameter, self.arc)

    def parameter_at(self, s: Any) -> Array:
        """Parameters u of arc lengths s (m), linear between the knots."""
        return np.interp(s, self.arc, self.parameter)


@dataclass(frozen=True)
class FlankTables:
    """Several flanks in one table of k pieces, so that one look-up serves all: flanks in an axis of the arc lengths.

    Attributes
    ----------
    low, high : ndarray, shape (f, 1)
        First and last arc length of the f flanks (m).
    cells, start : ndarray, shape (f, 1)
        Cells per metre of a uniform grid on each flank, and the number of its first cell.
    piece : ndarray, shape (all cells,)
        The piece in which each cell starts.
    arc, beyond : ndarray, shape (k,)
        Arc length where each piece starts, and where the next one of the flank does (m).
    cubic : ndarray of complex, shape (4, k)
        As in `FlankCurve`.
    steps
        Most pieces that start within a cell.
    """

    low: Array
    high: Array
    cells: Array
    start: IntArray
    piece: IntArray
    arc: Array
    beyond: Array
    cubic: ComplexArray
    steps: int

    @cached_property
    def ends(self) -> Array:
        """First and last arc lengths (m), shape (f, 2)."""
        return np.concatenate([self.low, self.high], axis=-1)

    def of(self, flank: IntArray) -> FlankTables:
        """The same table with other axes of flanks: the flanks `flank`, shape (..., g), for arc lengths (..., g, m)."""
        return replace(
            self, low=self.low[flank], high=self.high[flank], cells=self.cells[flank], start=self.start[flank]
        )

    def pieces(self, s: Array) -> tuple[ComplexArray, Array]:
        """Coefficients, shape (4, ..., f, m), and arc lengths within the pieces, for arc lengths s (m), (..., f, m)."""
        i = self.piece.take(((s - self.low) * self.cells).astype(np.int64) + self.start)
        for _ in range(self.steps):
            i = i + (s >= self.beyond.take(i))
        return self.cubic.take(i, axis=1), s - self.arc.take(i)

    def at(self, s: Array) -> tuple[ComplexArray, ComplexArray]:
        """Points (m) and tangents dz/ds towards the tips at arc lengths s (m), shape (..., f, m), within the flanks."""
        (a, b, c, d), t = self.pieces(s)
        return ((d * t + c) * t + b) * t + a, (3 * d * t + 2 * c) * t + b

    def points(self, s: Array) -> ComplexArray:
        """Points alone."""
        (a, b, c, d), t = self.pieces(s)
        return np.asarray(((d * t + c) * t + b) * t + a)


def flank_tables(curves: Sequence[FlankCurve]) -> FlankTables:
    """One table of several flanks."""
    counts, pieces, steps, first = [], [], 1, 0
    for curve in curves:
        length = curve.high - curve.low
        count = min(MOST_CELLS, math.ceil(length / np.diff(curve.arc).min()))
        ends = curve.low + length * np.arange(count + 1) / count
        found = np.clip(np.searchsorted(curve.arc, ends, side="right") - 1, 0, len(curve.arc) - 2)
        steps = max(steps, int(np.diff(found).max()))  # rounding beside a piece's end does not matter
        pieces.append(found + first)
        counts.append(count)
        first += len(curve.arc) - 1
    low, high = (np.array([[curve.arc[end]] for curve in curves]) for end in (0, -1))
    return FlankTables(
        low=low,
        high=high,
        cells=np.array(counts)[:, None] / (high - low),
        start=(np.cumsum([0, *(count + 1 for count in counts[:-1])]))[:, None],
        piece=np.concatenate(pieces),
        arc=np.concatenate([curve.arc[:-1] for curve in curves]),
        beyond=np.concatenate([np.append(curve.arc[1:-1], np.inf) for curve in curves]),
        cubic=np.concatenate([curve.cubic for curve in curves], axis=1),
        steps=steps,
    )


def flank_curve(gear: Gear, face: Face | None = None) -> FlankCurve:
    """Tabulate a flank of a gear, that without deviation if none is given, from the middle of the root's trochoid
    (if any) to the end at the tip.
    """
    face = face or face_of(gear)
    marks = [m for m in face.marks if 0 < m < face.end]
    u = np.unique(np.concatenate([np.linspace(0, 1, INVOLUTE), np.linspace(1, face.end, ROUND), marks]))
    nominal = replace(face, flank=replace(face.flank, deviation=None))
    points, size = face.points(u), _lengths(nominal.speeds, u)
    before, after = (
        _rates(face, nominal, np.clip(v, 0.0, face.end)) for v in (u[:-1] + BESIDE, u[1:] - BESIDE)
    )  # at the start and end of each piece
    root = next((s.curve for s in gear.profile.segments if s.name == "trochoid"), None)
    if isinstance(root, Trochoid):
        v = np.linspace(0.5, 1.0, ROOT)
        tangent = -1j * (root.normal(v))
        u = np.concatenate([v[:-1] - 1, u])
        points = np.concatenate([root.point(v)[:-1], points])
        size = np.concatenate([_lengths(root.speed, v), size])
        before, after = np.concatenate([tangent[:-1], before]), np.concatenate([tangent[1:], after])
    s = np.concatenate([[0.0], np.cumsum(size)])
    s = s - s[np.searchsorted(u, 0.0)]
    h, chord = np.diff(s), np.diff(points)
    cubic = [points[:-1], before, (3 * chord / h - 2 * before - after) / h, (before + after - 2 * chord / h) / h**2]
    return FlankCurve(face, u, s, np.stack(cubic))


def _rates(face: Face, nominal: Face, u: Array) -> ComplexArray:
    """Derivatives of the points by the arc length of the flank without deviation."""
    speed = nominal.speeds(u)
    return np.asarray(-1j * face.normals(u) * np.where(speed > 0, face.speeds(u) / np.where(speed > 0, speed, 1), 1))


def _lengths(speed: Any, parameter: Array) -> Array:
    """Arc lengths (m) of the pieces between parameters."""
    half = 0.5 * np.diff(parameter)
    return np.asarray((speed(parameter[:-1, None] + half[:, None] * (1 + _GAUSS_X)) @ _GAUSS_W) * half)


#: Most steps of Newton's method for the arc at a place along the tangent, its last move in windows, and least cosine
#: between tangent and face.
NEWTON, NEAR, STEEPEST = 4, 1e-3, 0.2
#: Along the pinion's flank x grows with the arc, along the wheel's it falls.
WAY = np.array([1.0, -1.0])
_WAYS = WAY[:, None]


@dataclass(frozen=True)
class Faces:
    """Both faces of p contacts as seen from O along n.

    Attributes
    ----------
    turn : ndarray of complex, shape (p, 2)
        q/n.
    offset : ndarray of complex, shape (p, 2)
        ((c - O) + q d)/n (m).
    stretch : ndarray of complex, shape (p, 2)
        d' (-), tooth axes.
    arc : ndarray, shape (p, 2)
        s_0 (m).
    """

    turn: ComplexArray
    offset: ComplexArray
    stretch: ComplexArray
    arc: Array

    def heights(self, flanks: FlankTables, x: Array) -> tuple[Array, Array, ComplexArray]:
        """Arcs (m), heights (m) and undeformed points (m, tooth axes) of the faces at places x (m) of shape (p, n), or
        (p, 2, n) for places of each.

        All have the shape (p, 2, n). Where a face ends before, they are those of its end.
        """
        start, turn = self.arc[:, :, None], self.turn[:, :, None]
        stretch, offset = self.stretch[:, :, None], self.offset[:, :, None]
        x = x[:, None, :] if x.ndim == 2 else x
        close = NEAR * (x.max(axis=2, keepdims=True) - x.min(axis=2, keepdims=True))
        s = np.minimum(np.maximum(start + _WAYS * x, flanks.low), flanks.high)
        for _ in range(NEWTON):
            (a, b, c, d), t = flanks.pieces(s)
            tangent = ((3 * d * t + 2 * c) * t + b + stretch) * turn
            seen = (((d * t + c) * t + b) * t + a + stretch * (s - start)) * turn + offset
            move = _WAYS * (x + seen.imag) / np.maximum(STEEPEST, -_WAYS * tangent.imag)
            new = np.minimum(np.maximum(s + move, flanks.low), flanks.high)
            s = new
            if (np.abs(move) <= close).all():
                break
        (a, b, c, d), t = flanks.pieces(s)  # the last move may have crossed the begin of a relief
        point = ((d * t + c) * t + b) * t + a
        return s, ((point + stretch * (s - start)) * turn + offset).real, point

    def range(self, flanks: FlankTables, ends: Array) -> tuple[Array, Array]:
        """Least and largest x (m) that both faces reach between their arcs `ends` (m), shape (p, 2, 2)."""
        seen = flanks.points(ends) + self.stretch[:, :, None] * (ends - self.arc[:, :, None])
        x = -(seen * self.turn[:, :, None] + self.offset[:, :, None]).imag
        return np.maximum(x[:, 0, 0], x[:, 1, 1]), np.minimum(x[:, 0, 1], x[:, 1, 0])


@dataclass(frozen=True)
class Windows:
    """Where p contacts can be.

    Attributes
    ----------
    low, high : ndarray, shape (p,)
        Ends of the window along x (m).
    nearest : ndarray, shape (p,)
        x where the faces are nearest to each other (m).
    mean_slope : ndarray, shape (p,)
        Slope of the mean of both faces there (-).
    """

    low: Array
    high: Array
    nearest: Array
    mean_slope: Array


#: Places at which a window is searched for, in units of the contact's expected half width.
LOOK = np.concatenate([-np.geomspace(0.03, 30, 20)[::-1], [0.0], np.geomspace(0.03, 30, 20)])


def windows(x: Array, h: Array, gap: Array, depth: Array) -> Windows:
    """Windows in which the gap is at most `depth` (m) above its least, linear in its root between places.

    Parameters
    ----------
    x, h : ndarray, shape (p, m), (p, 2, m)
        Rising places along the tangent (m), and heights of the faces there (m).
    gap, depth : ndarray, shape (p, m), (p,)
        m.
    """
    count = x.shape[1]
    row, number, last = count * np.arange(len(x)), np.arange(count), count - 1
    nearest = np.argmin(gap, axis=1)
    over = np.sqrt(gap - gap.take(row + nearest)[:, None]) - np.sqrt(depth)[:, None]
    wide = over > 0
    before, beyond = wide & (number < nearest[:, None]), wide & (number > nearest[:, None])
    ends = []
    for first, way in ((last - np.argmax(before[:, ::-1], axis=1), 1), (np.argmax(beyond, axis=1), -1)):
        # the first place that is out of the window, and the one before it; there is none past the last place
        outer = row + np.where(first * way < nearest * way, first, 0 if way > 0 else last)
        inner = np.minimum(np.maximum(outer + way, row), row + last)
        a, b, start = over.take(inner), over.take(outer), x.take(inner)
        share = np.where(b > np.maximum(a, 0), -a / np.where(b > a, b - a, 1.0), 1.0)
        ends.append(start + np.minimum(np.maximum(share, 0), 1) * (x.take(outer) - start))
    left, right = row + np.maximum(nearest - 1, 0), row + np.minimum(nearest + 1, last)
    middle = h[:, 0] + h[:, 1]
    rise = 0.5 * (middle.take(right) - middle.take(left))
    slope = rise / np.maximum(1e-12, x.take(right) - x.take(left))
    return Windows(ends[0], ends[1], x.take(row + nearest), slope)
