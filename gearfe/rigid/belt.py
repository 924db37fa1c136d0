"""A belt without slip or stretch over two pulleys with bearings at rest."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError
from .forms import Frames
from .gear_ratio import both_move
from .joints import Joint, Row


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
