"""Define functions in job files, of time or of speed.

Functions of time are sums of points, smoothed steps, sines and a CSV file, or an expression. Functions of speed are
points, a CSV file or an expression.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import ClassVar

from ..config import Removed, quantity, renamed
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
    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {"points": renamed("points_ms")}

    constant: float = quantity(0.0, doc="constant part, in the unit of the key")
    points_ms: tuple[tuple[float, float], ...] = quantity(
        (), doc="list of [time (ms), value]; the first and the last value hold before and after"
    )
    csv: str | None = quantity(None, doc="or a CSV file with the columns time_ms and value, next to the job file")
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
        if self.points_ms and self.csv is not None:
            raise InputError(f"{where}.csv", self.csv, "conflicts with points_ms", "leave one out")
        parts = (self.constant, self.points_ms, self.csv, self.steps, self.sines, self.expression)
        if not any(part or part == 0.0 for part in parts[1:]) and not self.constant:
            raise InputError(
                where, None, "is an empty function of time", "give points_ms, steps, sines or an expression"
            )
        check_rising(f"{where}.points_ms", tuple(time for time, _ in self.points_ms))


@dataclass(frozen=True)
class SpeedFunctionTable:
    """A torque over speed. A text in its place is an expression."""

    SHORT = "expression"
    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {"points": renamed("points_rad_per_s_Nm")}

    points_rad_per_s_Nm: tuple[tuple[float, float], ...] = quantity(
        (), doc="list of [speed (rad/s), torque (N m)]; the first and the last torque hold below and above"
    )
    csv: str | None = quantity(
        None, doc="or a CSV file with the columns speed_rad_per_s and torque_Nm, next to the job file"
    )
    interpolation: str = quantity(
        "cubic", choices=("linear", "cubic"), doc="between points: straight lines, or monotone cubics"
    )
    expression: str | None = quantity(
        None, doc="or arithmetic on `speed` (rad/s), pi, abs, min, ... in N m, as -0.01*speed*abs(speed)"
    )
    largest_speed_rad_per_s: float | None = quantity(
        None,
        above=0.0,
        doc="largest speed of an expression, in both directions; beyond it the torque is constant; left out: 5 "
        "times the speed of the shaft in [train]",
    )

    def check(self, where: str) -> None:
        """One of the three is given; points rise."""
        given = [key for key in ("points_rad_per_s_Nm", "csv", "expression") if getattr(self, key)]
        if not given:
            raise InputError(
                where, None, "is an empty function of speed", "give points_rad_per_s_Nm, csv or an expression"
            )
        if len(given) > 1:
            raise InputError(f"{where}.{given[1]}", None, f"conflicts with {given[0]}", "leave one out")
        if self.largest_speed_rad_per_s is not None and self.expression is None:
            problem = "is of an expression: points hold their first and last torque beyond their ends"
            raise InputError(f"{where}.largest_speed_rad_per_s", self.largest_speed_rad_per_s, problem, "leave it out")
        check_rising(f"{where}.points_rad_per_s_Nm", tuple(speed for speed, _ in self.points_rad_per_s_Nm), "rad/s")


def check_rising(where: str, places: tuple[float, ...], unit: str = "ms") -> None:
    """Raise `InputError` for times (or speeds, by the unit) of points that do not rise."""
    for i, (one, two) in enumerate(itertools.pairwise(places), start=1):
        if not one < two:
            problem = f"must be {'later' if unit == 'ms' else 'more'} than the one before, {one:g} {unit}"
            raise InputError(f"{where}[{i}]", two, problem, "let them rise; for a jump write a short ramp")
