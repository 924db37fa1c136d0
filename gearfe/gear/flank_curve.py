r"""The flank of a tooth by its arc length: root, involute with its relief, and tip round as one tabulated curve.

Between knots on the exact curve, points are cubic in the arc length s with the exact points and unit tangents at both
ends (Hermite): with :math:`\tau = s - s_i`, :math:`z(s) = z_i + t_i\tau + c_i\tau^2 + d_i\tau^3`. The knots include all
marks, so kinks stay sharp; the error is :math:`h^4\kappa''/384` of the curvature :math:`\kappa`, nanometres and less.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .curves import Trochoid
from .spur_gear import Gear
from .touching import Face, face_of

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Knots on the involute, on the tip round and on the upper half of the root.
INVOLUTE, ROUND, ROOT = 513, 65, 129
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
    def _finder(self) -> tuple[float, NDArray[np.int64]]:
        """Cells per metre of a uniform grid, and the last knot before each cell."""
        count = 8 * len(self.arc)
        cells = self.low + (self.high - self.low) * np.arange(count + 1) / count
        return count / (self.high - self.low), np.searchsorted(self.arc, cells, side="right") - 1

    def at(self, s: Array) -> tuple[ComplexArray, ComplexArray]:
        """Points (m) and unit tangents towards the tip at arc lengths s (m) within the curve."""
        scale, before = self._finder
        i = before[((s - self.low) * scale).astype(np.int64)]
        last = len(self.arc) - 2
        # a cell is shorter than most pieces: at most a few steps on
        ahead = (i < last) & (s >= self.arc[np.minimum(i + 1, last)])
        while ahead.any():
            i = i + ahead
            ahead = (i < last) & (s >= self.arc[np.minimum(i + 1, last)])
        i = np.minimum(i, last)
        t = s - self.arc[i]
        a, b, c, d = (one[i] for one in self.cubic)
        return ((d * t + c) * t + b) * t + a, (3 * d * t + 2 * c) * t + b

    def arc_at(self, parameter: Any) -> Array:
        """Arc lengths (m) of parameters u, linear between the knots."""
        return np.interp(parameter, self.parameter, self.arc)

    def parameter_at(self, s: Any) -> Array:
        """Parameters u of arc lengths s (m), linear between the knots."""
        return np.interp(s, self.arc, self.parameter)


def flank_curve(gear: Gear) -> FlankCurve:
    """Tabulate the flank of a gear, from the middle of the root's trochoid (if it has one) to the end at the tip."""
    face = face_of(gear)
    marks = [m for m in face.marks() if 0 < m < face.end]
    u = np.unique(np.concatenate([np.linspace(0, 1, INVOLUTE), np.linspace(1, face.end, ROUND), marks]))
    points, size = face.points(u), _lengths(face.speeds, u)
    before, after = (
        -1j * face.normals(np.clip(v, 0.0, face.end)) for v in (u[:-1] + BESIDE, u[1:] - BESIDE)
    )  # tangents at the start and end of each piece
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


def _lengths(speed: Any, parameter: Array) -> Array:
    """Arc lengths (m) of the pieces between parameters."""
    half = 0.5 * np.diff(parameter)
    return np.asarray((speed(parameter[:-1, None] + half[:, None] * (1 + _GAUSS_X)) @ _GAUSS_W) * half)
