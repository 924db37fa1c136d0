"""Table ``[modes]``: speeds and orders of a Campbell diagram. The train is that of ``[train]``."""

from __future__ import annotations

from dataclasses import dataclass

from ..config import quantity
from ..errors import InputError


@dataclass(frozen=True)
class ModesTable:
    """Modes of the train over the speed of its drive, and where orders meet them."""

    NAME = "modes"

    speed_start_rad_per_s: float | None = quantity(
        None, doc="first speed of the drive (rad/s); left out: that of [runup], or 0"
    )
    speed_stop_rad_per_s: float | None = quantity(
        None, doc="last speed (rad/s), of the same sign; left out: that of [runup], or twice that of the drive"
    )
    speeds: int = quantity(25, low=2, high=10_000, doc="number of speeds, evenly spaced")
    band_Hz: float | None = quantity(
        None,
        above=0.0,
        doc="modes below this frequency (Hz); left out: that of [runup] or [housing.reduction], or 5000",
    )
    multiples: int = quantity(5, low=0, high=50, doc="multiples of each mesh frequency among the orders")
    shaft_multiples: int = quantity(
        2, low=0, high=50, doc="multiples of the rotation frequency of each shaft among the orders"
    )

    def check(self, where: str) -> None:
        """Rules that join several keys."""
        start, stop = self.speed_start_rad_per_s, self.speed_stop_rad_per_s
        if start is None or stop is None:
            return
        if start * stop < 0.0:
            problem = f"makes a range, {start:g} to {stop:g} rad/s, that changes sign"
            cure = "take both of one sign, or one of them zero: the sense of the drive determines the loaded flanks"
            raise InputError(f"{where}.speed_stop_rad_per_s", stop, problem, cure)
        if start == stop:
            raise InputError(f"{where}.speed_stop_rad_per_s", stop, "is the first speed, too", "give a range")
