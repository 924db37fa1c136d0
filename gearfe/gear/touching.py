r"""Where and when do the rigid driving flanks of each tooth pair first touch? Exact curves, to rounding.

About the wheel's centre every point of the wheel's flank moves on a circle. With the polar angles of the pinion's
flank, seen from there, :math:`\varphi_1(u)` at its parameter u, and of the wheel's flank at the same radius and zero
twist, :math:`\varphi_2(r(u))`, that point of the pinion's flank is met at the twist

.. math:: D(u) = \varphi_1(u) - \varphi_2(r(u)),

the pair touches at :math:`\varphi_k = \min_u D`. The minimum is smooth on the path of contact and on rounds and
reliefs, where parabolas close in on it, a kink of D at the kink of a relief, and an end of the range where a sharp tip
bears before or after the path.

The working flank is the involute with its relief, then the tip round. Roots take no part, but where one is undercut:
the involute then starts with an edge, which can bear as a sharp tip does, and the mate's tip passes so close below it
that the root may be touched first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .curves import Arc, Flank, Trochoid
from .deviation import Deviation
from .involute import deviated
from .mesh_geometry import MeshGeometry
from .spur_gear import Gear

#: Points of the first search along a flank and of each closer look, and how often it looks closer at most; points
#: besides for each piece of a deviation, whose waves may be short.
COARSE, CLOSER, REFINEMENTS, PER_PIECE = 97, 65, 13, 2
#: Change of the least twist (rad) from one look to the next that is rounding.
ROUNDING = 2e-15
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

    flank: Flank
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
        flank = self.flank
        s = flank.roll(np.minimum(np.maximum(u, 0.0), 1.0))
        beside = s - flank.relief(s)[0] if flank.modified else s
        made = np.exp(1j * (flank.base_angle - s / flank.base_radius)) * (flank.base_radius + 1j * beside)
        if self.round_ is not None:
            round_ = complex(*self.round_.centre) + self.round_.radius * _round_normals(self.round_, u)
            made = np.where(u > 1.0, round_, made)
        return self._with_root(u, made, lambda root, v: _complex(root.point(v)))

    def normals(self, u: Array) -> ComplexArray:
        """Outward unit normals as complex numbers."""
        flank = self.flank
        s = flank.roll(np.minimum(np.maximum(u, 0.0), 1.0))
        made = 1j * np.exp(1j * (flank.base_angle - s / flank.base_radius))
        if flank.modified:
            depth, slope = flank.relief(s)
            forward = (s - depth) / flank.base_radius
            size = np.hypot(forward, slope)
            made = made * np.where(size > 0.0, (forward - 1j * slope) / np.where(size > 0.0, size, 1.0), 1.0)
        if self.round_ is not None:
            made = np.where(u > 1.0, _round_normals(self.round_, u), made)
        return self._with_root(u, made, lambda root, v: _complex(root.normal(v)))

    def speeds(self, u: Array) -> Array:
        """Arc length per unit of u (m)."""
        made: Array = self.flank.speed(np.clip(u, 0.0, 1.0))
        if self.round_ is not None:
            made = np.where(u > 1.0, self.round_.speed(u - 1.0), made)
        return self._with_root(u, made, lambda root, v: root.speed(v))

    def _with_root(self, u: Any, values: Any, of_root: Callable[[Trochoid, Array], Any]) -> Any:
        """Values with those of the root's curve where u < 0."""
        if self.root is None or not np.any(np.asarray(u) < 0.0):
            return values
        return np.where(np.asarray(u) < 0.0, of_root(self.root, 1.0 + np.minimum(u, 0.0)), values)

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

    def at_radius(self, radius: Array) -> Array:
        """Parameter u of the points at given radii (m) within the range."""
        return self._with_root(
            np.where(radius < self.radii[0], -1.0, 1.0),
            self._above_root(radius),
            lambda root, _: self._in_root(root, radius),
        )

    def _in_root(self, root: Trochoid, radius: Array) -> Array:
        """Parameter u in the root by Newton's method from a table; the radius grows all along it."""
        v = np.linspace(0.5, 1.0, 65)
        v = np.interp(radius, np.abs(_complex(root.point(v))), v)
        for _ in range(3):
            point, along = _complex(root.point(v)), -1j * _complex(root.normal(v))
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

    def curvature(self, u: Any, most: float) -> Any:
        """Curvature (1/m) at u (a number or an array), at most `most`, which a corner has."""
        at = np.clip(u, self.start, 1.0)
        before, after = np.maximum(at - BESIDE, self.start), np.minimum(at + BESIDE, 1.0)
        for mark in self.marks:  # not across it, beside which it is another
            if self.start < mark < 1.0:
                below = at <= mark
                before = np.where(below, before, np.maximum(before, mark))
                after = np.where(below, np.minimum(after, mark), after)
        normals = self.normals(np.stack([before, after]))
        turned = -np.angle(normals[1] / normals[0]) / (self.speeds(at) * (after - before))
        made = np.where(self.corners(np.asarray(u)), most, np.maximum(0.0, turned))
        if self.round_ is not None:
            made = np.where(u > 1.0, 1.0 / self.round_.radius, made)
        return np.minimum(most, made)[()]

    def bend(self, u: Array) -> Array:
        """How much the normal turns around u, per length (1/m): across marks too, infinite at corners."""
        beside = np.clip(np.stack([u - BESIDE, u + BESIDE]), self.start, self.end)
        normals, points = self.normals(beside), self.points(beside)
        turned = np.abs(np.angle(normals[1] / normals[0]))
        return np.where(self.corners(u), math.inf, turned / np.abs(points[1] - points[0]))

    @cached_property
    def marks(self) -> list[float]:
        """Parameters where the curvature jumps or the flank ends sharply."""
        found = [0.0, 1.0] if self.undercut else [1.0]
        if self.flank.amount > 0.0:
            found.append(float(self.parameter(self.flank.relief_start)))
        return sorted({*found, *self.kinks.tolist()})


def _complex(points: Any) -> ComplexArray:
    return np.asarray(points[..., 0] + 1j * points[..., 1])


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
    fall = np.angle(_complex(root.normal(np.array(1.0))) / _complex(flank.normal(np.array(0.0))))
    return Face(flank, arc, root if isinstance(root, Trochoid) and fall > 0.0 else None)


@dataclass(frozen=True)
class Touching:
    """Tooth pairs whose rigid flanks meet, n of them over all positions; pinion and wheel in second axes.

    Attributes
    ----------
    position : ndarray, shape (n,)
        Number of the pinion angle.
    pair : ndarray, shape (n,)
        Pair number k: pinion tooth k, wheel tooth -1 - k.
    angle : ndarray, shape (n,)
        Pinion angle (rad).
    twist : ndarray, shape (n,)
        Twist of the wheel at which the pair touches (rad).
    place : ndarray, shape (n, 2)
        Parameters u of the touching points on pinion and wheel.
    radius : ndarray, shape (n, 2)
        Their radii about the own centres (m).
    point, normal : ndarray of complex, shape (n,)
        Point of contact and common normal out of the pinion, global axes.
    arm : ndarray, shape (n, 2)
        Torques of pinion and wheel per force (m).
    curvature : ndarray, shape (n,)
        Relative curvature of both flanks there (1/m), infinite at a sharp corner.
    flank : ndarray, shape (n, 2)
        Numbers of their flanks in `gearfe.gear.tooth_flanks.ToothFlanks.faces`.
    turn : ndarray, shape (n, 2)
        Turns of their flanks by pitch errors (rad).
    """

    position: IntArray
    pair: IntArray
    angle: Array
    twist: Array
    place: Array
    radius: Array
    point: ComplexArray
    normal: ComplexArray
    arm: Array
    curvature: Array
    flank: IntArray
    turn: Array

    def take(self, index: Any) -> Touching:
        """The pairs `index`."""
        return Touching(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def __len__(self) -> int:
        return len(self.pair)


class Flanks:
    """A working flank of each gear of a pair, and the twist D at which a point of the pinion's is met."""

    def __init__(self, pair: MeshGeometry, faces: tuple[Face, Face] | None = None) -> None:
        self.pair = pair
        self.faces = (face_of(pair.pinion), face_of(pair.wheel)) if faces is None else faces
        self.pinion, self.wheel = self.faces
        low = np.abs(self.wheel.points(np.array(self.wheel.start)))
        self._radii = float(low), self.wheel.radii[2]

    def wheel_frame(self, angle: Array, number: IntArray) -> Array:
        """Angle (rad) of the frame of the mating wheel tooth at zero twist."""
        pair = self.pair
        return -angle / pair.gear_ratio + math.pi - (2 * number + 1) * math.pi / pair.wheel.teeth

    def placed(self, angle: Array, number: IntArray, u: Array) -> ComplexArray:
        """Points of the pinion's flank seen from the wheel's centre, global axes (m)."""
        turn = np.exp(1j * (angle + number * self.pair.mesh_cycle))
        return self.pinion.points(u) * turn - self.pair.working_centre_distance

    def twist(self, angle: Array, number: IntArray, u: Array) -> Array:
        """D (rad) at parameters u of the pinion's flank, infinite where the wheel's flank has no such radius."""
        seen = self.placed(angle, number, u)
        radius = np.abs(seen)
        inside = (radius >= self._radii[0]) & (radius <= self._radii[1] * (1 + 1e-15))
        mate = self.wheel.points(self.wheel.at_radius(radius))
        apart = np.angle(seen * np.exp(-1j * self.wheel_frame(angle, number)) / mate)
        return np.where(inside, apart, np.inf)

    def touching(self, angles: Array) -> Touching:
        """First touch of every pair that can meet at the given pinion angles (rad), shape (p,)."""
        return self.first_touch(*candidates(self.pair, angles))

    def first_touch(self, position: IntArray, angle: Array, number: IntArray) -> Touching:
        """First touch of the tooth pairs `number` at pinion angles (rad), of those of them that meet, shape (n,)."""
        pieces = [len(face.flank.deviation.pieces) for face in self.faces if face.flank.deviation is not None]
        coarse = COARSE + PER_PIECE * max(pieces, default=0)
        low, high = self.pinion.start, self.pinion.end
        u = np.broadcast_to(np.linspace(low, high, coarse), (len(angle), coarse))
        best, least = np.zeros(len(angle)), np.full(len(angle), np.inf)
        open_, step = np.arange(len(angle)), (high - low) / (coarse - 1)
        for _ in range(REFINEMENTS):
            found = self.twist(angle[open_, None], number[open_, None], u)
            place, value, known = _lowest(u, found, step)
            with np.errstate(invalid="ignore"):
                goes_on = np.isfinite(value) & ~(known & (np.abs(value - least[open_]) <= ROUNDING))
            open_, place, reach = open_[goes_on], place[goes_on], 1.5 * step
            best[open_], least[open_] = place, value[goes_on]
            if len(open_) == 0:
                break
            middle = np.clip(place, low + reach, high - reach)[:, None]
            u = np.clip(middle + reach * np.linspace(-1.0, 1.0, CLOSER), low, high)
            step = 2.0 * reach / (CLOSER - 1)
        best = np.where(np.abs(best) < AT_AN_END, 0.0, best)
        meets = np.isfinite(least)
        return self._described(position[meets], angle[meets], number[meets], best[meets], least[meets])

    def _described(self, position: IntArray, angle: Array, number: IntArray, u: Array, twist: Array) -> Touching:
        seen = self.placed(angle, number, u)
        radius = np.abs(seen)
        mate = self.wheel.at_radius(radius)
        mate = np.where(
            np.abs(mate) < AT_AN_END, 0.0, np.where(mate > self.wheel.end - AT_AN_END, self.wheel.end, mate)
        )
        turn = np.exp(1j * (angle + number * self.pair.mesh_cycle))
        normal = self.pinion.normals(u) * turn
        wheel_normal = -self.wheel.normals(mate) * np.exp(1j * (self.wheel_frame(angle, number) + twist))
        # the normal of the flatter face is the surer one; at the mate's corner it is the only one
        normal = np.where(self.pinion.bend(u) > self.wheel.bend(mate), wheel_normal, normal)
        point = seen + self.pair.working_centre_distance
        arm = np.stack([_cross(point, normal), -_cross(seen, normal)], axis=1)
        place, radii = np.stack([u, mate], axis=1), np.stack([np.abs(point), radius], axis=1)
        bent = self.pinion.curvature(u, math.inf) + self.wheel.curvature(mate, math.inf)
        flank, turn = np.tile(np.array([0, 1]), (len(angle), 1)), np.zeros((len(angle), 2))
        return Touching(position, number, angle, twist, place, radii, point, normal, arm, bent, flank, turn)


def _lowest(u: Array, values: Array, step: float) -> tuple[Array, Array, BoolArray]:
    """Place and value of the lowest point of the parabola through the lowest value of each row and those beside it,
    `step` apart; and whether these are finite, so that no end of the mate's flank lies between them.
    """
    rows, last = np.arange(len(u)), u.shape[1] - 1
    k = np.argmin(values, axis=1)
    lowest, middle = values[rows, k], np.minimum(np.maximum(k, 1), last - 1)
    before, here, after = (values[rows, middle + j] for j in (-1, 0, 1))
    known = np.isfinite(before + here + after)
    before, after = (np.subtract(one, here, out=np.zeros(len(u)), where=known) for one in (before, after))
    bend = np.where(known & (before + after > 0), before + after, np.inf)
    shift = np.minimum(np.maximum(0.5 * (before - after) / bend, -1.0), 1.0)
    value = here + shift * (0.5 * (after - before) + 0.5 * shift * (before + after))
    better = known & (value < lowest)
    return np.where(better, u[rows, middle] + step * shift, u[rows, k]), np.where(better, value, lowest), known


def candidates(pair: MeshGeometry, angles: Array) -> tuple[IntArray, Array, IntArray]:
    """Pinion teeth whose tip can reach the wheel's tip circle: positions, pinion angles (rad) and tooth numbers."""
    a, tip1, tip2 = pair.working_centre_distance, pair.pinion.tip_radius, pair.wheel.tip_radius
    reach = math.acos(min(1.0, max(-1.0, (a * a + tip1 * tip1 - tip2 * tip2) / (2 * a * tip1))))
    reach += pair.pinion.profile.tip_half_angle + 0.5 * pair.mesh_cycle
    half = math.ceil(reach / pair.mesh_cycle)
    number = np.round(-angles / pair.mesh_cycle).astype(np.int64)[:, None] + np.arange(-half, half + 1)
    position, tooth = np.nonzero(np.abs(angles[:, None] + number * pair.mesh_cycle) <= reach)
    return position, angles[position], number[position, tooth]


def _cross(a: ComplexArray, b: ComplexArray) -> Array:
    return np.asarray((np.conj(a) * b).imag)


def _round_normals(round_: Arc, u: Array) -> ComplexArray:
    """Normals of a tip round at parameters u in [1, 2]."""
    start, end = round_.start_angle, round_.end_angle
    return np.asarray(np.exp(1j * (start + (u - 1.0) * (end - start))))
