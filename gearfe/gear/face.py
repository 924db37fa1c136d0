"""The working flank of a tooth: the involute with its relief, then the tip round.

Roots take no part, but where one is undercut: the involute then starts with an edge, which can bear as a sharp tip
does, and the mate's tip passes so close below it that the root may be touched first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..typing import Array, BoolArray, ComplexArray
from .curves import Arc, Involute, Trochoid
from .deviation import Deviation
from .involute import deviated
from .spur_gear import Gear

#: A place is an end of the range, or a mark, when it is so near to it: places have the rounding of angles and radii.
AT_AN_END = 1e-9
#: Moves of a roll length that are rounding, in parts of the longest.
ROLL_ROUNDING = 1e-15
#: Parameters on either side of a point between which a face's turning is taken.
BESIDE = 1e-5


@dataclass(frozen=True)
class Face:
    """Working flank of a gear in the frame of its tooth: u in [0, 1] is the involute, in [1, 2] the tip round, in
    [-0.5, 0] the upper half of an undercut root.

    Attributes
    ----------
    flank
        Involute with relief, parameter linear in the roll length.
    round_
        Tip round, or None.
    root
        The root of an undercut tooth, else None.
    """

    flank: Involute
    round_: Arc | None
    root: Trochoid | None = None

    @property
    def undercut(self) -> bool:
        """Whether the involute starts with an edge."""
        return self.root is not None

    @property
    def start(self) -> float:
        """First parameter."""
        return -0.5 if self.undercut else 0.0

    @property
    def end(self) -> float:
        """Last parameter."""
        return 1.0 if self.round_ is None else 2.0

    @property
    def sharp(self) -> bool:
        """Whether the flank ends in a corner."""
        return self.round_ is None

    def points(self, u: Array) -> ComplexArray:
        """Points (m) as complex numbers."""
        return self._of_curves("point", u)

    def normals(self, u: Array) -> ComplexArray:
        """Outward unit normals as complex numbers."""
        return self._of_curves("normal", u)

    def speeds(self, u: Array) -> Array:
        """Arc length per unit of u (m)."""
        return self._of_curves("speed", u)

    def _of_curves(self, what: str, u: Array) -> Any:
        """A quantity of the curve that each parameter lies on."""
        made = getattr(self.flank, what)(np.minimum(np.maximum(u, 0.0), 1.0))
        if self.round_ is not None:
            made = np.where(u > 1.0, getattr(self.round_, what)(u - 1.0), made)
        if self.root is not None and (u < 0.0).any():
            made = np.where(u < 0.0, getattr(self.root, what)(1.0 + np.minimum(u, 0.0)), made)
        return made

    def parameter(self, roll: Any) -> Any:
        """Parameter at a roll length (m)."""
        return (roll - self.flank.start) / (self.flank.end - self.flank.start)

    @cached_property
    def kinks(self) -> Array:
        """Rising parameters of the kinks of relief and deviation."""
        return np.array([self.parameter(roll) for roll in self.flank.kinks])

    @cached_property
    def radii(self) -> tuple[float, float, float]:
        """Radii (m) of the start, of the end of the involute and of the end."""
        low, middle, high = np.abs(self.points(np.array([0.0, 1.0, self.end])))
        return float(low), float(middle), float(high)

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Radii (m) between which it lies."""
        return float(np.abs(self.points(np.array(self.start)))), self.radii[2]

    def at_radius(self, radius: Array) -> Array:
        """Parameter u of the points at given radii (m) within the range."""
        above, low = self._above_root(radius), radius < self.radii[0]
        return above if self.root is None or not low.any() else np.where(low, self._in_root(self.root, radius), above)

    def _in_root(self, root: Trochoid, radius: Array) -> Array:
        """Parameter u in the root by Newton's method from a table; the radius grows all along it."""
        v = np.linspace(0.5, 1.0, 65)
        v = np.interp(radius, np.abs(root.point(v)), v)
        for _ in range(3):
            point, along = root.point(v), -1j * root.normal(v)
            rate = (point.conj() * along).real / np.abs(point) * root.speed(v)
            v = np.clip(v + (radius - np.abs(point)) / rate, 0.5, 1.0)
        return v - 1.0

    def _above_root(self, radius: Array) -> Array:
        flank = self.flank
        forward = np.sqrt(np.maximum(0.0, (radius - flank.base_radius) * (radius + flank.base_radius)))
        s = forward
        if flank.modified:  # s - relief(s) = forward
            for _ in range(12):
                depth, slope = flank.relief(s)
                move = (s - depth - forward) / (1.0 - slope)
                s = s - move
                if (np.abs(move) <= ROLL_ROUNDING * flank.end).all():
                    break
        u = np.minimum(np.maximum((s - flank.start) / (flank.end - flank.start), 0.0), 1.0)
        if self.round_ is None:
            return u
        arc = self.round_
        centre = complex(*arc.centre)
        distance = abs(centre)
        cosine = (radius**2 - distance**2 - arc.radius**2) / (2.0 * distance * arc.radius)
        # the round is passed clockwise from the flank to the tip, on the left of its centre's ray
        angle = math.atan2(centre.imag, centre.real) + np.arccos(np.clip(cosine, -1.0, 1.0))
        along = np.clip((angle - arc.start_angle) / (arc.end_angle - arc.start_angle), 0.0, 1.0)
        return np.where(radius > self.radii[1], 1.0 + along, u)

    def corners(self, u: Array) -> BoolArray:
        """Whether the face has a corner at u: a sharp tip, an undercut's edge, a kink (where a linear relief starts).

        Its normal may be any of a fan there, and without friction the force takes that of the smooth mate.
        """
        found = np.asarray((u >= self.end - AT_AN_END) & self.sharp)
        if self.undercut:
            found = found | (np.abs(u) < AT_AN_END)
        for kink in self.kinks:
            found = found | (np.abs(u - kink) <= AT_AN_END)
        return found

    def turning(self, u: Array) -> tuple[Array, Array]:
        """Curvature at u, and how much the normal turns around u per length, across marks, too (1/m); both are
        infinite at corners.
        """
        at = np.minimum(np.maximum(u, self.start), 1.0)
        before, after = np.maximum(at - BESIDE, self.start), np.minimum(at + BESIDE, 1.0)
        for mark in self.marks:  # the curvature is not taken across it, beside which it is another
            if self.start < mark < 1.0:
                below = at <= mark
                before = np.where(below, before, np.maximum(before, mark))
                after = np.where(below, np.minimum(after, mark), after)
        around = np.minimum(np.maximum([u - BESIDE, u + BESIDE], self.start), self.end)
        normals = self.normals(np.stack([before, after, *around]))
        turned = np.angle(normals[::2] / normals[1::2])
        curvature = np.maximum(turned[0], 0.0) / (self.speeds(at) * (after - before))
        if self.round_ is not None:
            curvature = np.where(u > 1.0, 1.0 / self.round_.radius, curvature)
        made = curvature, np.abs(turned[1]) / np.abs(np.subtract(*self.points(around)))
        curvature, bend = np.where(self.corners(u), math.inf, made)
        return curvature, bend

    @cached_property
    def marks(self) -> list[float]:
        """Parameters where the curvature jumps or the flank ends sharply."""
        found = [0.0, 1.0] if self.undercut else [1.0]
        if self.flank.amount > 0.0:
            found.append(float(self.parameter(self.flank.relief_start)))
        return sorted({*found, *self.kinks.tolist()})


def face_of(gear: Gear, deviation: Deviation | None = None) -> Face:
    """Working flank of a gear, with a deviation of micrometres."""
    profile = gear.profile
    flank, arc = profile.flank, None
    if deviation is not None:
        flank, arc = deviated(gear, profile, deviation)
    else:
        round_ = next((s.curve for s in profile.segments if s.name == "tip_round"), None)
        arc = round_ if isinstance(round_, Arc) else None
    if not profile.undercut:
        return Face(flank, arc)
    root = profile.segment("trochoid").curve
    # going up a convex flank its normal turns clockwise
    fall = np.angle(root.normal(np.array(1.0)) / flank.normal(np.array(0.0)))
    return Face(flank, arc, root if isinstance(root, Trochoid) and fall > 0.0 else None)
