"""A wheel that rolls without slip on a straight line of another body."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from .forms import Frames, Point
from .joints import Joint, Row


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
