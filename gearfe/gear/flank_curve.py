r"""The flank of a tooth by its arc length: root, involute with its relief, and tip round as one tabulated curve.

Between knots on the exact curve, points are cubic in the arc length s with the exact points and unit tangents at both
ends (Hermite): with :math:`\tau = s - s_i`, :math:`z(s) = z_i + t_i\tau + c_i\tau^2 + d_i\tau^3`. The knots include all
marks, so kinks stay sharp; the error is :math:`h^4\kappa''/384` of the curvature :math:`\kappa`, nanometres and less.

A flank with a deviation is tabulated by the arc length of the flank without: the same material has the same s, however
far a waviness lengthens the curve, and the tangents are longer than 1 by half the square of the deviation's slope.
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
from .spur_gear import Gear
from .touching import Face, face_of

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
        tangent = -1j * (root.normal(v) @ np.array([1, 1j]))
        u = np.concatenate([v[:-1] - 1, u])
        points = np.concatenate([(root.point(v) @ np.array([1, 1j]))[:-1], points])
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
