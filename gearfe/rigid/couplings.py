"""Joints that couple the motions of two bodies which others guide: gears, belts, racks, cams."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from .forms import GROUND, Frames, Point
from .joints import Joint, Profile, Row


@dataclass(frozen=True)
class GearRatio(Joint):
    """Body `b` turns by `ratio` times what body `a` turns: one constraint.

    The ratio is negative for external gears, -z_a/z_b. The multiplier is the moment on `a` (N m), with the sign turned;
    `b` gets -1/ratio of it for equal power.
    """

    a: str
    b: str
    ratio: float
    name: str = ""

    def __post_init__(self) -> None:
        both_move(f"gear {self.name!r}", self.a, self.b)
        if not (math.isfinite(self.ratio) and self.ratio != 0.0):
            cure = "give -z_a/z_b for external gears"
            raise InputError(f"gear {self.name!r} ratio", self.ratio, "must be finite and not 0", cure)

    def rows(self, frames: Frames) -> list[Row]:
        """theta_a - theta_b / ratio keeps what it starts with."""
        form = frames.angle(self.a) - (1.0 / self.ratio) * frames.angle(self.b)
        return [Row("angles", form - (frames.start_angle(self.a) - frames.start_angle(self.b) / self.ratio))]


@dataclass(frozen=True)
class Belt(Joint):
    """Pulleys of the radii `radius_a`, `radius_b` (m) on bodies `a` and `b` pay out the same length: one constraint.

    A `crossed` belt turns them in opposite senses. The multiplier is the difference of both strands'
    tensions (N).
    """

    a: str
    b: str
    radius_a: float
    radius_b: float
    crossed: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        both_move(f"belt {self.name!r}", self.a, self.b)
        for key in ("radius_a", "radius_b"):
            if not getattr(self, key) > 0.0:
                raise InputError(f"belt {self.name!r} {key}", getattr(self, key), "must be > 0 m", "give the radius")

    def rows(self, frames: Frames) -> list[Row]:
        """r_a theta_a -+ r_b theta_b keeps what it starts with."""
        other = self.radius_b if self.crossed else -self.radius_b
        start = self.radius_a * frames.start_angle(self.a) + other * frames.start_angle(self.b)
        return [Row("length", self.radius_a * frames.angle(self.a) + other * frames.angle(self.b) - start)]


@dataclass(frozen=True)
class Rack(Joint):
    """Body `a` moves along `direction` (of the ground) by `radius` (m) times what body `b` turns: one constraint.

    What guides the rack and bears the pinion are joints of their own. A negative radius turns the sense. The multiplier
    is the tooth force along the direction (N).
    """

    a: str
    b: str
    radius: float
    direction: Point = (1.0, 0.0)
    point: Point = (0.0, 0.0)
    name: str = ""

    def __post_init__(self) -> None:
        both_move(f"rack {self.name!r}", self.a, self.b)
        if not (math.isfinite(self.radius) and self.radius != 0.0):
            cure = "give the pinion's pitch radius"
            raise InputError(f"rack {self.name!r} radius", self.radius, "must be finite and not 0 m", cure)

    def rows(self, frames: Frames) -> list[Row]:
        """u . P - r theta keeps what it starts with."""
        length = math.hypot(*self.direction)
        x, y = self.direction[0] / length, self.direction[1] / length
        place = frames.start_place(self.a, self.point)
        start = x * place[0] + y * place[1] - self.radius * frames.start_angle(self.b)
        return [
            Row("length", frames.point(self.a, self.point).along(x, y) - self.radius * frames.angle(self.b) - start)
        ]


@dataclass(frozen=True)
class Cam(Joint):
    """A coordinate of the follower, body `a`, is `profile` of the angle of body `b`: one constraint.

    `coordinate` is ``"angle"`` (rad), ``"x"`` or ``"y"`` (m, of the point `point`). The multiplier is the force or
    moment between both; nothing lifts off, so that its sign tells whether a spring would be needed. The cam gets the
    profile's slope times that.
    """

    a: str
    b: str
    coordinate: str
    profile: Profile
    point: Point = (0.0, 0.0)
    name: str = ""

    def __post_init__(self) -> None:
        both_move(f"cam {self.name!r}", self.a, self.b)
        if self.coordinate not in ("angle", "x", "y"):
            where = f"cam {self.name!r} coordinate"
            raise InputError(where, self.coordinate, "must be one of angle, x, y", "choose one of these")

    def rows(self, frames: Frames) -> list[Row]:
        """u - s(theta_b)."""
        if self.coordinate == "angle":
            moved = frames.angle(self.a)
        else:
            place = frames.point(self.a, self.point)
            moved = place.x if self.coordinate == "x" else place.y
        return [Row(self.coordinate, moved + 0.0 * frames.angle(self.b), profile=(self.b, self.profile))]


def both_move(label: str, *bodies: str) -> None:
    """Refuse a coupling to the ground."""
    if GROUND in bodies:
        raise InputError(label, GROUND, "couples turns of two bodies that move", "name the other body: to = ...")
