"""Gear pairs: two spur gears, checked to run together. The front door of the geometry; SI units and radians.

`Gear` and `TipRelief` describe one gear (`gearfe.gear.spur_gear`), `GearPair` two in mesh: its quantities are those of
`gearfe.gear.mesh_geometry.MeshGeometry`, which also states the convention of angles and flanks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..shown import Shown
from ..tables.pair import INSTEAD, GearTable, PairTable
from .drawing_values import coefficients
from .mesh_geometry import MeshGeometry, PathPoint
from .pair_checks import check_pair, pair_warnings
from .spur_gear import Gear, TipRelief

__all__ = ["Gear", "GearPair", "PathPoint", "TipRelief"]

#: Argument of `Gear` or `GearPair` -> its key in a job file and the factor from SI to the key's unit.
KEYS: dict[str, tuple[str, float]] = {
    "module": ("module_mm", 1e3),
    "pressure_angle": ("pressure_angle_deg", 180.0 / math.pi),
    "face_width": ("face_width_mm", 1e3),
    "bore_diameter": ("bore_diameter_mm", 1e3),
    "tip_round": ("tip_round_mm", 1e3),
    "tip_relief.amount": ("tip_relief_amount_um", 1e6),
    "tip_relief.length": ("tip_relief_length_mm", 1e3),
    "tip_relief.exponent": ("tip_relief_exponent", 1.0),
    "tooth_thinning": ("tooth_thinning_um", 1e6),
    "centre_distance": ("centre_distance_mm", 1e3),
}


@dataclass(frozen=True, repr=False)
class GearPair(MeshGeometry, Shown):
    """Two external spur gears in mesh, checked when made.

    Parameters
    ----------
    pinion, wheel
        The gears; the pinion drives.
    centre_distance
        Centre distance a (m); None: without backlash for the unthinned teeth, from the profile shifts.

    Raises
    ------
    InputError
        For gears that cannot mesh, jam, interfere, or have a contact ratio below 1.
    """

    def __post_init__(self) -> None:
        check_pair(self)

    def facts(self) -> dict[str, str]:
        """Teeth, module, centre distance, contact ratio."""
        return {
            "teeth": f"{self.pinion.teeth}/{self.wheel.teeth}",
            "module": f"{1e3 * self.pinion.module:.6g} mm",
            "centre distance": f"{1e3 * self.working_centre_distance:.6g} mm",
            "working pressure angle": f"{math.degrees(self.working_pressure_angle):.5g} deg",
            "contact ratio": f"{self.contact_ratio:.4g}",
            "backlash": f"{1e3 * self.backlash:.4g} mm",
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is legal but deserves a look, one sentence each."""
        return pair_warnings(self)

    @classmethod
    def from_table(cls, table: PairTable, where: str = "pair") -> GearPair:
        """Pair that a job file's [pair] table describes; errors name the file's keys and units."""
        pinion = _gear_from_table(table, "pinion", where)
        wheel = _gear_from_table(table, "wheel", where)
        distance = table.centre_distance_mm
        try:
            return cls(pinion, wheel, None if distance is None else distance * 1e-3)
        except InputError as error:
            side, _, name = error.field.rpartition(".") if error.field.startswith(("pinion", "wheel")) else ("", "", "")
            raise _renamed(error, table, side, name or error.field, where) from None


def _gear_from_table(table: PairTable, side: str, where: str) -> Gear:
    own: GearTable = getattr(table, side)
    value = table.tooth_form(side)
    value |= coefficients(own, table.module_mm_of(side), value, f"{where}.{side}")
    relief = None
    if value["tip_relief_amount_um"]:
        length = value["tip_relief_length_mm"]
        relief = TipRelief(value["tip_relief_amount_um"] * 1e-6, length * 1e-3, value["tip_relief_exponent"])
    try:
        return Gear(
            own.teeth,
            table.module_mm_of(side) * 1e-3,
            math.radians(value["pressure_angle_deg"]),
            value["face_width_mm"] * 1e-3,
            own.bore_diameter_mm * 1e-3,
            profile_shift=value["profile_shift"],
            addendum=value["addendum"],
            dedendum=value["dedendum"],
            rack_tip_radius=value["rack_tip_radius"],
            tip_round=value["tip_round_mm"] * 1e-3,
            tip_shortening=value["tip_shortening"],
            tip_relief=relief,
            tooth_thinning=value["tooth_thinning_um"] * 1e-6,
        )
    except InputError as error:
        raise _renamed(error, table, side, error.field, where) from None


def _renamed(error: InputError, table: PairTable, side: str, name: str, where: str) -> InputError:
    """The same error in the words of the job file: its key where it was given, its unit."""
    key, factor = KEYS.get(name, (name, 1.0))
    own: Any = getattr(table, side) if side else None
    for drawn, stands_for in INSTEAD.items():
        if own is not None and key in stands_for and getattr(own, drawn) is not None:
            number = error.value * factor if isinstance(error.value, float) else error.value
            problem = f"makes {key} {number:.6g}: {error.problem}"
            return InputError(f"{where}.{side}.{drawn}", getattr(own, drawn), problem, error.cure)
    if name == "module" and own.pitch_diameter_mm is not None:
        key, factor = "pitch_diameter_mm", 1e3 * own.teeth
    shared = side and getattr(own, key, None) is None and getattr(table, key, None) is not None
    field = f"{where}.{key}" if shared or not side else f"{where}.{side}.{key}"
    value = error.value
    if isinstance(value, float):
        value = float(f"{value * factor:.12g}")
    return InputError(field, value, error.problem, error.cure)
