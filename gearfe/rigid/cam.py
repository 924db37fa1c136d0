"""A follower that a cam moves by a profile of its angle."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError
from .forms import Frames, Point
from .gear_ratio import both_move
from .joints import Joint, Profile, Row


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
