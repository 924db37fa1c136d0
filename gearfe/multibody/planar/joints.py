"""Planar joints as plain data, each with the forms that it holds at zero.

A new joint is a class with `rows`, in this module or another. Its line in `base.tables.kinds.JOINTS` makes it known to
mechanism files. Nothing else changes: every integrator gets the joint from its forms (`multibody.planar.forms`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

from ...base.errors import InputError
from ..series.timefunctions import TimeFunction
from .bodies import Frames
from .forms import GROUND, Form, Point

if TYPE_CHECKING:
    from ..series.tape import Tape


class Profile(Protocol):
    """A function of an angle with a steady curvature."""

    def write(self, tape: Tape, coordinate: int) -> int:
        """Variable of the tape that is s of a coordinate."""


class Row(NamedTuple):
    """One constraint: ``form = motion(t)``, ``form = 0``, or with a profile s of a body's angle ``form = s(theta)``."""

    what: str  # it holds, for messages
    form: Form
    motion: TimeFunction | None = None
    profile: tuple[str, Profile] | None = None  # name of the body, which the form names, too


class Joint(ABC):
    """Joint of two bodies: a frozen dataclass with a `name` and the names of its bodies.

    A joint MUST provide `rows`. Fields called ``a``, ``b``, ``body``,
    ``line``, ``relative_to`` name bodies, others are numbers, points (m, in the frame of a body), functions of time.
    """

    name: str

    @abstractmethod
    def rows(self, frames: Frames) -> list[Row]:
        """Forms that the joint holds."""


@dataclass(frozen=True)
class Hinge(Joint):
    """Point `point_a` of body `a` stays on point `point_b` of body `b`: two constraints."""

    a: str
    b: str
    point_a: Point = (0.0, 0.0)
    point_b: Point = (0.0, 0.0)
    name: str = ""

    def rows(self, frames: Frames) -> list[Row]:
        """P_a - P_b = 0."""
        gap = frames.point(self.a, self.point_a) - frames.point(self.b, self.point_b)
        return [Row("x", gap.x), Row("y", gap.y)]


@dataclass(frozen=True)
class Slot(Joint):
    """Point `point` of body `body` stays on a line of body `line`: one constraint (nothing of the joint has mass)."""

    body: str
    line: str
    point: Point = (0.0, 0.0)
    origin: Point = (0.0, 0.0)
    direction: Point = (1.0, 0.0)
    name: str = ""

    def rows(self, frames: Frames) -> list[Row]:
        """n . (P - X) = n0 . O with the unit vector n across the line, and the line's place O as seen from X."""
        x, y = -self.direction[1], self.direction[0]
        at = frames.arm(self.line, self.origin)
        offset = (x * at[0] + y * at[1]) / math.hypot(x, y)
        gap = frames.point(self.body, self.point) - frames.centre(self.line)
        return [Row("across the line", frames.direction(self.line, (x, y)).dot(gap) - offset)]


@dataclass(frozen=True)
class Prismatic(Joint):
    """Body `body` slides along a line of body `line` without turning against it: two constraints.

    `angle` is the angle of `body` minus that of `line` (rad); ``None`` keeps the one it starts with.
    """

    body: str
    line: str
    point: Point = (0.0, 0.0)
    origin: Point = (0.0, 0.0)
    direction: Point = (1.0, 0.0)
    angle: float | None = None
    name: str = ""

    def rows(self, frames: Frames) -> list[Row]:
        """Those of a slot, and the angle."""
        slot = Slot(self.body, self.line, self.point, self.origin, self.direction)
        held = frames.start_angle(self.body) - frames.start_angle(self.line) if self.angle is None else self.angle
        return [*slot.rows(frames), Row("angle", frames.angle(self.body) - frames.angle(self.line) - held)]


@dataclass(frozen=True)
class Fixed(Joint):
    """Body `a` stands still in the frame of body `b`, as it starts: three constraints."""

    a: str
    b: str = GROUND
    name: str = ""

    def rows(self, frames: Frames) -> list[Row]:
        """Those of a hinge at the origin of `a`, and the angle."""
        at_b = frames.start_seen_from(self.b, frames.start_place(self.a, (0.0, 0.0)))
        held = frames.start_angle(self.a) - frames.start_angle(self.b)
        hinge = Hinge(self.a, self.b, (0.0, 0.0), at_b)
        return [*hinge.rows(frames), Row("angle", frames.angle(self.a) - frames.angle(self.b) - held)]


@dataclass(frozen=True)
class Distance(Joint):
    """Points `point_a` of body `a` and `point_b` of body `b` stay `length` (m) apart: one constraint.

    ``None`` keeps the distance that they start with; a function of time, which stays positive, is an actuator. The
    multiplier is the tension of the rod (N), times its length over that at time 0.
    """

    a: str
    b: str
    point_a: Point = (0.0, 0.0)
    point_b: Point = (0.0, 0.0)
    length: float | TimeFunction | None = None
    name: str = ""

    def rows(self, frames: Frames) -> list[Row]:
        """(D . D - L(t)^2) / (2 L(0)) = 0 with the span D: its gradient is a unit force along the rod at time 0."""
        span = frames.point(self.a, self.point_a) - frames.point(self.b, self.point_b)
        given = self.length
        length = float(given(0.0)) if isinstance(given, TimeFunction) else given
        if length is None:
            length = math.dist(frames.start_place(self.a, self.point_a), frames.start_place(self.b, self.point_b))
        if not length > 0.0:
            cure = "give it a length, or join the points by a hinge"
            raise InputError(f"distance {self.name!r} length", length, "must be > 0 m", cure)
        square = span.dot(0.5 / length * span)
        if isinstance(given, TimeFunction):
            return [Row("distance", square, 0.5 / length * given.squared())]
        return [Row("distance", square - 0.5 * length)]


@dataclass(frozen=True)
class Rolling(Joint):
    """A wheel of the radius `radius` (m) about `point` of `body` rolls on a line of body `line`: two constraints.

    It stays on the side of the line on which it starts. The multipliers are the normal force, which may pull, and the
    friction that rolling needs (N).
    """

    body: str
    line: str
    radius: float
    point: Point = (0.0, 0.0)
    origin: Point = (0.0, 0.0)
    direction: Point = (1.0, 0.0)
    name: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            cure = "give the wheel's radius in m"
            raise InputError(f"rolling {self.name!r} radius", self.radius, "must be finite and > 0 m", cure)

    def rows(self, frames: Frames) -> list[Row]:
        """n . (P - O) = side r, and t . (P - O) + side r (theta - theta_line) keeps what it starts with."""
        length = math.hypot(*self.direction)
        x, y = self.direction[0] / length, self.direction[1] / length
        at = frames.start_seen_from(self.line, frames.start_place(self.body, self.point))
        start = at[0] - self.origin[0], at[1] - self.origin[1]
        side = math.copysign(self.radius, x * start[1] - y * start[0])
        gap = frames.point(self.body, self.point) - frames.point(self.line, self.origin)
        across = frames.direction(self.line, (-y, x)).dot(gap) - side
        turned = frames.start_angle(self.body) - frames.start_angle(self.line)
        along = frames.direction(self.line, (x, y)).dot(gap) - (x * start[0] + y * start[1] + side * turned)
        return [
            Row("across the line", across),
            Row("rolling", along + side * (frames.angle(self.body) - frames.angle(self.line))),
        ]


@dataclass(frozen=True)
class Prescribed(Joint):
    """A motion given as a function of time: one constraint.

    `coordinate` is ``"angle"`` (rad) or ``"rate"`` (rad/s), relative to body `relative_to`; with a rate the angle
    starts from the start pose. With ``"x"`` or ``"y"`` (m) it is that of the point `point`, seen from the point
    `origin` of body `relative_to` along its axes.
    """

    body: str
    coordinate: str
    function: TimeFunction
    relative_to: str = GROUND
    point: Point = (0.0, 0.0)
    origin: Point = (0.0, 0.0)
    name: str = ""

    def __post_init__(self) -> None:
        if self.coordinate not in ("angle", "rate", "x", "y"):
            where = f"prescribed motion {self.name!r} coordinate"
            raise InputError(where, self.coordinate, "must be one of angle, rate, x, y", "choose one of these")
        for key in ("point", "origin"):
            if self.coordinate in ("angle", "rate") and getattr(self, key) != (0.0, 0.0):
                where = f"prescribed motion {self.name!r} {key}"
                raise InputError(where, getattr(self, key), "has no part in an angle", "remove it, or prescribe x or y")

    def rows(self, frames: Frames) -> list[Row]:
        """The coordinate less its function of time."""
        if self.coordinate in ("x", "y"):
            along = (1.0, 0.0) if self.coordinate == "x" else (0.0, 1.0)
            gap = frames.point(self.body, self.point) - frames.point(self.relative_to, self.origin)
            return [Row(self.coordinate, frames.direction(self.relative_to, along).dot(gap), self.function)]
        motion = self.function
        if self.coordinate == "rate":
            motion = motion.integral(frames.start_angle(self.body) - frames.start_angle(self.relative_to))
        return [Row("angle", frames.angle(self.body) - frames.angle(self.relative_to), motion)]


def places(joint: Joint) -> dict[str, Point]:
    """Return the points of bodies, by name, where a joint force acts; none for moments and moving points."""
    if getattr(joint, "coordinate", "") in ("angle", "rate"):
        return {}
    keys = (("a", "point_a"), ("b", "point_b"), ("body", "point"), ("relative_to", "origin"))
    return {
        getattr(joint, body): getattr(joint, point)
        for body, point in keys
        if hasattr(joint, body) and hasattr(joint, point)
    }
