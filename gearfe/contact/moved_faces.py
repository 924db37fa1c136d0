r"""The faces of tooth pairs as loads and rotations have moved them, seen along a common normal.

About a centre O with the unit normal n out of the pinion and the tangent t = -i n, a point is O + n h + t x. The face
of a gear whose tooth is turned by the unit number q about the gear's centre c, and displaced by d + d'(s - s_0) about
the arc s_0, is

.. math:: Z(s) = q\,(z(s) + d + d'\,(s-s_0)) + c, \qquad h - i x = (Z(s) - O)/n .

At a given x its arc follows from Newton's method on the exact curve, and the gap between the faces is the difference of
their heights h at the same x: exact for any rotation and displacement of the faces. Arrays hold pinion and wheel in
their second axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gear.flank_curve import FlankTables
from ..typing import Array, ComplexArray

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
        seen = flanks.at(ends)[0] + self.stretch[:, :, None] * (ends - self.arc[:, :, None])
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
