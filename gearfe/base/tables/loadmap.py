"""The [loadmap] table: torques and angles of a load map, in everyday units."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..config import quantity
from ..errors import InputError

#: Keys that say the torques.
TORQUES = ("torques_Nm", "torques_pinion_Nm", "torque_start_Nm", "torque_stop_Nm", "torque_count", "torque_spacing")


@dataclass(frozen=True)
class LoadMapTable:
    """Torques, positions and extras of a load map; model and mesh are those of [stiffness]."""

    NAME = "loadmap"

    torques_Nm: tuple[float, ...] | None = quantity(
        None, doc="torques at the wheel's hub (N m), or give torque_start_Nm and torque_stop_Nm", above=0.0
    )
    torques_pinion_Nm: tuple[float, ...] | None = quantity(
        None,
        doc="torques at the hub of the pinion, the driver (N m); torques_Nm are these times z2/z1",
        above=0.0,
    )
    torque_start_Nm: float | None = quantity(None, doc="least torque at the wheel's hub (N m)", above=0.0)
    torque_stop_Nm: float | None = quantity(None, doc="largest torque (N m)", above=0.0)
    torque_count: int = quantity(20, doc="number of torques from torque_start_Nm to torque_stop_Nm", low=2, high=10_000)
    torque_spacing: str = quantity("even", doc="how these torques are spaced: even or log", choices=("even", "log"))
    positions: int = quantity(18, doc="pinion angles in one mesh cycle", low=1, high=100_000)
    mesh_cycles: int | None = quantity(
        None, doc="mesh cycles; by default 1 if all teeth are alike, otherwise the full period", low=1, high=100_000
    )
    root_stress: bool = quantity(False, doc="true: also compute the tension at the tooth roots")

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that contradict each other."""
        start, stop = self.torque_start_Nm, self.torque_stop_Nm
        pinion = self.torques_pinion_Nm
        if pinion is not None:
            other = next((key for key in TORQUES[:4] if key != "torques_pinion_Nm" and self._given(key)), None)
            if other is not None:
                problem, cure = f"conflicts with {other}", "leave one of them out"
                raise InputError(f"{where}.torques_pinion_Nm", list(pinion), problem, cure)
            if not pinion:
                raise InputError(f"{where}.torques_pinion_Nm", [], "is empty", "give at least one torque")
        if self.torques_Nm is not None:
            if start is not None or stop is not None:
                name, value = ("torque_start_Nm", start) if start is not None else ("torque_stop_Nm", stop)
                raise InputError(f"{where}.{name}", value, "conflicts with torques_Nm", "leave one of them out")
            if not self.torques_Nm:
                raise InputError(f"{where}.torques_Nm", [], "is empty", "give at least one torque")
        elif (start is None) != (stop is None):
            name = "torque_stop_Nm" if stop is None else "torque_start_Nm"
            raise InputError(f"{where}.{name}", None, "is missing", "give both ends of the range")
        elif start is not None and stop is not None and not start < stop:
            raise InputError(f"{where}.torque_stop_Nm", stop, f"must be > torque_start_Nm = {start:g}", "swap them")

    def _given(self, key: str) -> bool:
        return getattr(self, key) is not None

    def at_wheel(self, ratio: float) -> LoadMapTable:
        """Return the table with torques at the wheel; `ratio` is z2/z1."""
        if self.torques_pinion_Nm is None:
            return self
        return replace(self, torques_Nm=tuple(ratio * t for t in self.torques_pinion_Nm), torques_pinion_Nm=None)

    def torques(self) -> list[float]:
        """Rising torques (N m).

        Raises
        ------
        InputError
            When the table gives none.
        """
        if self.torques_Nm is not None:
            return sorted(set(self.torques_Nm))
        start, stop, last = self.torque_start_Nm, self.torque_stop_Nm, self.torque_count - 1
        if start is None or stop is None:
            cure = (
                f"add torques_Nm = [...] to [{self.NAME}], or torque_start_Nm and torque_stop_Nm, or give --torques-Nm"
            )
            raise InputError(f"{self.NAME}.torques_Nm", None, "no torques are given", cure)
        if self.torque_spacing == "log":
            step = math.log(stop / start) / last
            return [start, *(start * math.exp(step * i) for i in range(1, last)), stop]
        return [start, *(start + (stop - start) * i / last for i in range(1, last)), stop]
