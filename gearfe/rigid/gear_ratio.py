"""Angles of two bodies in a fixed ratio: gears on shafts at rest, or a chain without slip."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from .forms import GROUND, Frames
from .joints import Joint, Row


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


def both_move(label: str, *bodies: str) -> None:
    """Refuse a coupling to the ground."""
    if GROUND in bodies:
        raise InputError(label, GROUND, "couples turns of two bodies that move", "name the other body: to = ...")
