"""A function of time in a job file: points, smoothed steps, sines and a CSV file that add up, or an expression."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from ..config import quantity
from ..errors import InputError


@dataclass(frozen=True)
class StepTable:
    """A smoothed step 10 x^3 - 15 x^4 + 6 x^5 from 0."""

    height: float = quantity(doc="height, in the unit of the key")
    centre_ms: float = quantity(doc="time of its middle (ms)")
    width_ms: float = quantity(above=0.0, doc="its duration (ms)")


@dataclass(frozen=True)
class SineTable:
    """A sine about 0."""

    amplitude: float = quantity(doc="amplitude, in the unit of the key")
    frequency_Hz: float = quantity(above=0.0, doc="frequency (Hz)")
    phase_deg: float = quantity(0.0, doc="phase (deg)")


@dataclass(frozen=True)
class TrainFunctionTable:
    """A function of time; its parts add up. A text in its place is an expression."""

    SHORT = "expression"

    constant: float = quantity(0.0, doc="constant part, in the unit of the key")
    points: tuple[tuple[float, float], ...] = quantity(
        (), doc="list of [time (ms), value]; the first and the last value hold before and after"
    )
    csv: str | None = quantity(None, doc="or a CSV file with the columns time_ms and value, beside the job file")
    interpolation: str = quantity(
        "linear", choices=("linear", "cubic"), doc="between points: straight lines, or monotone cubics"
    )
    steps: tuple[StepTable, ...] = quantity((), doc="smoothed steps")
    sines: tuple[SineTable, ...] = quantity((), doc="sines")
    expression: str | None = quantity(
        None, doc="arithmetic on `time` (s), pi, sin, cos, exp, min, ... in the unit of the key, as 100 + 50*time"
    )

    def check(self, where: str) -> None:
        """Something is given; points rise."""
        if self.points and self.csv is not None:
            raise InputError(f"{where}.csv", self.csv, "stands beside points", "leave one out")
        parts = (self.constant, self.points, self.csv, self.steps, self.sines, self.expression)
        if not any(part or part == 0.0 for part in parts[1:]) and not self.constant:
            raise InputError(where, None, "is an empty function of time", "give points, steps, sines or an expression")
        check_rising(f"{where}.points", tuple(time for time, _ in self.points))


def check_rising(where: str, times: tuple[float, ...]) -> None:
    """Times of points rise."""
    for i, (one, two) in enumerate(itertools.pairwise(times), start=1):
        if not one < two:
            problem = f"must be later than the one before, {one:g} ms"
            raise InputError(f"{where}[{i}]", two, problem, "let times rise; for a jump write a short ramp")
