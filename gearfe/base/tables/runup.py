"""Table ``[runup]``: the range of speeds of a run-up, and its report. The train is that of ``[train]``."""

from __future__ import annotations

from dataclasses import dataclass

from ..config import quantity
from ..errors import InputError


@dataclass(frozen=True)
class RunUpTable:
    """Steady states of the train over the speed of its drive."""

    NAME = "runup"

    speed_start_rad_per_s: float = quantity(doc="first speed of the drive (rad/s)")
    speed_stop_rad_per_s: float = quantity(doc="last speed (rad/s), of the same sign")
    speeds: int = quantity(200, low=2, high=100_000, doc="number of speeds, evenly spaced")
    tolerance: float = quantity(
        1e-3, low=1e-6, high=0.1, doc="error of the mesh deflections, relative to those under the steady force"
    )
    band_Hz: float | None = quantity(
        None, above=0.0, doc="highest frequency of interest (Hz); left out: that of [housing.reduction], or 5000"
    )
    multiples: int = quantity(5, low=1, high=50, doc="harmonics of each mesh frequency in orders.csv")
    shaft_multiples: int = quantity(
        2,
        low=0,
        high=50,
        doc="multiples of the rotation frequency of each shaft in the Campbell diagram and the critical speeds",
    )

    instability_loads: tuple[float, ...] = quantity(
        (), above=0.0, doc="factors on all loads for a map of parametric instability without damping; empty: none"
    )
    stability: bool = quantity(True, doc="false: leave out the Floquet multipliers")

    def check(self, where: str) -> None:
        """Rules that join several keys."""
        start, stop = self.speed_start_rad_per_s, self.speed_stop_rad_per_s
        if not start * stop > 0.0:
            field, value = ("speed_start_rad_per_s", start) if start == 0.0 else ("speed_stop_rad_per_s", stop)
            problem = f"makes a range, {start:g} to {stop:g} rad/s, that contains zero or changes sign"
            cure = "a train at rest has no steady vibration: take both of one sign, above zero in size"
            raise InputError(f"{where}.{field}", value, problem, cure)
        if start == stop:
            raise InputError(f"{where}.speed_stop_rad_per_s", stop, "is the first speed, too", "give a range")
