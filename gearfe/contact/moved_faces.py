r"""The faces of tooth pairs as loads and rotations have moved them, seen along a common normal.

About a centre O with the unit normal n out of the pinion and the tangent t = -i n, a point is O + n h + t x. The face
of a gear whose tooth is turned by the unit number q about the gear's centre c, and displaced by d + d'(s - s_0) about
the arc s_0, is

.. math:: Z(s) = q\,(z(s) + d + d'\,(s-s_0)) + c, \qquad h - i x = (Z(s) - O)/n .

At a given x its arc follows from Newton's method on the exact curve, and the gap between the faces is the difference of
their heights h at the same x: exact for any rotation and displacement of the faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gear.flank_curve import FlankCurve

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Steps of Newton's method for the arc at a place along the tangent, and least cosine between tangent and face.
NEWTON, STEEPEST = 2, 0.2
#: Along the pinion's flank x grows with the arc, along the wheel's it falls.
WAY = (1.0, -1.0)


@dataclass(frozen=True)
class Frames:
    """Where the faces of p tooth pairs are; pinion and wheel in the second axis.

    Attributes
    ----------
    centre, normal : ndarray of complex, shape (p,)
        O (m) and n, global axes.
    turn : ndarray of complex, shape (p, 2)
        q of the teeth: tooth axes to global ones.
    hub : ndarray, shape (p, 2)
        x of the gears' centres (m).
    arc : ndarray, shape (p, 2)
        s_0 of the material at O (m).
    shift, stretch : ndarray of complex, shape (p, 2)
        d (m) and d' (-), tooth axes.
    """

    centre: ComplexArray
    normal: ComplexArray
    turn: ComplexArray
    hub: Array
    arc: Array
    shift: ComplexArray
    stretch: ComplexArray

    def heights(self, curve: FlankCurve, gear: int, x: Array, steps: int = NEWTON) -> tuple[Array, Array, Array]:
        """Arcs (m), heights h and places x' (m) of one face at places x (m), shape (p, n).

        x' is x but for rounding, and where the face ends before: there it is the place of its end.
        """
        start, stretch = self.arc[:, gear, None], self.stretch[:, gear, None]
        turn = (self.turn[:, gear] / self.normal)[:, None]
        moved = ((self.hub[:, gear] - self.centre) / self.normal)[:, None] + self.shift[:, gear, None] * turn
        s = np.clip(start + WAY[gear] * x, curve.low, curve.high)
        for _ in range(steps):
            point, tangent = curve.at(s)
            off = x + ((point + stretch * (s - start)) * turn + moved).imag
            along = np.minimum(-STEEPEST, ((tangent + stretch) * turn).imag * WAY[gear])
            s = np.clip(s - WAY[gear] * off / along, curve.low, curve.high)
        seen = (curve.at(s)[0] + stretch * (s - start)) * turn + moved
        return s, seen.real, -seen.imag

    def range(self, curves: Sequence[FlankCurve]) -> tuple[Array, Array]:
        """Least and largest x (m) that both faces reach, shape (p,)."""
        ends = []
        for gear, curve in enumerate(curves):
            s = curve.arc[[0, -1]]
            here = (
                curve.at(s)[0] + self.shift[:, gear, None] + self.stretch[:, gear, None] * (s - self.arc[:, gear, None])
            )
            seen = (here * self.turn[:, gear, None] + (self.hub[:, gear] - self.centre)[:, None]) / self.normal[:, None]
            ends.append(-seen.imag)
        return np.maximum(ends[0][:, 0], ends[1][:, 1]), np.minimum(ends[0][:, 1], ends[1][:, 0])


@dataclass(frozen=True)
class Windows:
    """Where the contacts of p pairs can be.

    Attributes
    ----------
    middle, half : ndarray, shape (p,)
        Of the window along x (m).
    nearest : ndarray, shape (p,)
        x where the faces are nearest to each other (m).
    lean : ndarray, shape (p,)
        Slope of the mean of both faces there (-).
    free : ndarray of bool, shape (p, 2)
        Whether both faces go on beyond the window's ends.
    """

    middle: Array
    half: Array
    nearest: Array
    lean: Array
    free: NDArray[np.bool_]


#: Places at which a window is searched for, in units of the contact's expected half width.
_LOOK = np.concatenate([-np.geomspace(0.03, 30, 20)[::-1], [0.0], np.geomspace(0.03, 30, 20)])


def windows(frames: Frames, curves: Sequence[FlankCurve], scale: Array, depth: Array) -> Windows:
    """Windows in which the gap is at most `depth` (m) above its least, linear in its root between places of a search.

    Parameters
    ----------
    scale, depth : ndarray, shape (p,)
        Expected half width and largest gap of the contacts (m).
    """
    low, high = frames.range(curves)
    x = np.clip(scale[:, None] * _LOOK, low[:, None], high[:, None])
    heights = [frames.heights(curve, gear, x)[1] for gear, curve in enumerate(curves)]
    gap = heights[1] - heights[0]
    row, count, nearest = np.arange(len(x)), x.shape[1], np.argmin(gap, axis=1)
    over = np.sqrt(gap - gap.min(axis=1, keepdims=True)) - np.sqrt(depth)[:, None]
    ends = []
    for way in (-1, 1):
        beyond = (over > 0) & (way * (np.arange(count) - nearest[:, None]) > 0)
        first = np.argmax(beyond, axis=1) if way > 0 else count - 1 - np.argmax(beyond[:, ::-1], axis=1)
        first = np.where(beyond.any(axis=1), first, count - 1 if way > 0 else 0)
        inner = np.clip(first - way, 0, count - 1)
        a, b = over[row, inner], over[row, first]
        share = np.where(b > np.maximum(a, 0), -a / np.where(b > a, b - a, 1.0), 1.0)
        ends.append(x[row, inner] + np.clip(share, 0, 1) * (x[row, first] - x[row, inner]))
    left, right = np.maximum(nearest - 1, 0), np.minimum(nearest + 1, count - 1)
    rise = 0.5 * sum(h[row, right] - h[row, left] for h in heights)
    lean = rise / np.maximum(1e-12, x[row, right] - x[row, left])
    half = np.maximum(0.5 * (ends[1] - ends[0]), 1e-4 * scale)
    free = np.stack([ends[0] > low, ends[1] < high], axis=1)
    return Windows(0.5 * (ends[1] + ends[0]), half, x[row, nearest], lean, free)
