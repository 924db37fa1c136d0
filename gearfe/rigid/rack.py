"""A rack that a pinion with a bearing at rest drives along a fixed direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from .forms import Frames, Point
from .gear_ratio import both_move
from .joints import Joint, Row


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
