"""Table ``[spectrum]``: the record that a spectrum is of, spectra over short times, orders, measured ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..config import Removed, quantity, renamed
from ..errors import InputError

STEADY = "steady"


@dataclass(frozen=True)
class MeasuredTable:
    """Measured accelerations to draw beside the computed ones."""

    file: str = quantity(
        doc="CSV with time_s or frequency_Hz and acceleration_m_per_s2, or a universal file (.uff, .unv: dataset 58)"
    )
    attachment: int | str = quantity(doc="attachment that it was measured at")
    name: str = quantity("measured", doc="its name in the picture")
    number: int = quantity(1, low=1, doc="which data set of a universal file")


@dataclass(frozen=True)
class SpectrumTable:
    """Spectra of a run."""

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {"spectrum_from": renamed("spectrum_from_ms")}

    window: str = quantity(
        "none", choices=("none", "hann", "hamming", "blackman", "flattop"), doc="window of the spectrum"
    )
    spectrum_from_ms: float | str = quantity(
        0.0, low=0.0, doc='start of the record (ms); "steady" in a job file: after the start-up has decayed'
    )
    spectrum_ms: float | None = quantity(None, above=0.0, doc="duration of the record (ms); left out: to the end")
    short_time_ms: float | None = quantity(
        None, above=0.0, doc="duration of the parts of spectra over time (ms); left out: none"
    )
    order_turns: float | None = quantity(
        None,
        above=0.0,
        doc="turns of the first shaft that turns, in the parts that orders are tracked over; left out: none",
    )
    orders: tuple[float, ...] = quantity(
        (),
        above=0.0,
        doc="orders that are tracked, those of the first shaft that turns; left out: multiples 1 to 3 of the meshes",
    )
    measured: tuple[MeasuredTable, ...] = quantity((), doc="[[spectrum.measured]]")

    @property
    def start(self) -> float | None:
        """Begin of the record (s); None: where the motion is steady."""
        return None if self.spectrum_from_ms == STEADY else 1e-3 * float(self.spectrum_from_ms)

    @property
    def duration(self) -> float | None:
        """Duration of the record (s); None: to the end."""
        return None if self.spectrum_ms is None else 1e-3 * self.spectrum_ms

    def check(self, where: str) -> None:
        """A text is the one word that is known."""
        if isinstance(self.spectrum_from_ms, str) and self.spectrum_from_ms != STEADY:
            cure = f'write milliseconds, or "{STEADY}"'
            raise InputError(f"{where}.spectrum_from_ms", self.spectrum_from_ms, "is no time", cure)
        if self.orders and self.order_turns is None:
            raise InputError(f"{where}.order_turns", None, "is required with orders", "write order_turns = 4")
