"""A joint that keeps two points apart: a rod without mass, or a point on a circle."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from .forms import Frames, Point
from .joints import Joint, Row


@dataclass(frozen=True)
class Distance(Joint):
    """Points `point_a` of body `a` and `point_b` of body `b` stay `length` (m) apart: one constraint.

    ``None`` keeps the distance that they start with. The multiplier is the tension of the rod (N).
    """

    a: str
    b: str
    point_a: Point = (0.0, 0.0)
    point_b: Point = (0.0, 0.0)
    length: float | None = None
    name: str = ""

    def rows(self, frames: Frames) -> list[Row]:
        """(D . D - L^2) / (2 L) = 0 with the span D: its gradient is a unit force along the rod."""
        span = frames.point(self.a, self.point_a) - frames.point(self.b, self.point_b)
        length = self.length
        if length is None:
            length = math.dist(frames.start_place(self.a, self.point_a), frames.start_place(self.b, self.point_b))
        if not length > 0.0:
            cure = "give it a length, or join the points by a hinge"
            raise InputError(f"distance {self.name!r} length", length, "must be > 0 m", cure)
        return [Row("distance", span.dot(0.5 / length * span) - 0.5 * length)]
