"""Gear pairs that run together, and the pair of a job file; `geometry.mesh_geometry` says how they stand and turn.

SI units and radians. Whether two gears can run together is checked by `gearfe.gears.geometry.validity`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real
from typing import Any

from ...base.errors import InputError, given
from ...base.shown import Shown
from ...base.tables.pair import INSTEAD, GearTable, PairTable
from .gear_data import TipRelief, nominal_span
from .mesh_geometry import MeshGeometry, PathPoint
from .spur_gear import Gear
from .validity import check_pair, pair_warnings

__all__ = ["Gear", "GearPair", "MeshGeometry", "PathPoint", "TipRelief"]


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
        return tuple(pair_warnings(self))

    @classmethod
    def from_table(cls, table: PairTable) -> GearPair:
        """Pair that a job file's [pair] table describes; errors name the file's keys and units."""
        pinion, wheel = _gear_from_table(table, "pinion"), _gear_from_table(table, "wheel")
        distance = table.centre_distance_mm
        try:
            return gear_pair(pinion, wheel, None if distance is None else distance * 1e-3)
        except InputError as error:
            side, _, name = error.field.rpartition(".") if error.field.startswith(("pinion", "wheel")) else ("", "", "")
            raise _renamed(error, table, side, name or error.field) from None


#: Argument of `Gear` or `GearPair` -> its key in a job file and the key's unit in SI.
KEYS: dict[str, tuple[str, float]] = {
    "module": ("module_mm", 1e-3),
    "pressure_angle": ("pressure_angle_deg", math.pi / 180.0),
    "face_width": ("face_width_mm", 1e-3),
    "bore_diameter": ("bore_diameter_mm", 1e-3),
    "tip_round": ("tip_round_mm", 1e-3),
    "tip_relief.amount": ("tip_relief_amount_um", 1e-6),
    "tip_relief.length": ("tip_relief_length_mm", 1e-3),
    "tip_relief.exponent": ("tip_relief_exponent", 1.0),
    "tooth_thinning": ("tooth_thinning_um", 1e-6),
    "centre_distance": ("centre_distance_mm", 1e-3),
}


def gear_pair(pinion: Gear, wheel: Gear, centre_distance: float | None = None) -> GearPair:
    """A checked pair; equal gears at an equal centre distance (m) share one.

    Raises
    ------
    InputError
        For gears that cannot run together.
    """
    if centre_distance is not None and not isinstance(centre_distance, Real):
        return GearPair(pinion, wheel, centre_distance)  # which refuses it
    return _shared_pair(pinion, wheel, centre_distance)


@lru_cache(maxsize=256)
def _shared_pair(pinion: Gear, wheel: Gear, centre_distance: float | None) -> GearPair:
    return GearPair(pinion, wheel, centre_distance)


def _gear_from_table(table: PairTable, side: str) -> Gear:
    own: GearTable = getattr(table, side)
    form = {**table.tooth_form(side), "module_mm": table.module_mm_of(side), "bore_diameter_mm": own.bore_diameter_mm}
    form |= _of_drawing(own, form, f"pair.{side}")
    try:
        return gear_of_form(own.teeth, form)
    except InputError as error:
        raise _renamed(error, table, side, error.field) from None


def _of_drawing(own: GearTable, form: Mapping[str, Any], where: str) -> dict[str, float]:
    """Keys of the tooth form that the drawing values of a gear stand for: tip and root diameters, the span size."""
    module_mm, half, x = form["module_mm"], 0.5 * own.teeth, float(form["profile_shift"])
    made: dict[str, float] = {}
    if own.tip_diameter_mm is not None:
        made |= {"addendum": 0.5 * own.tip_diameter_mm / module_mm - half - x, "tip_shortening": 0.0}
    if own.root_diameter_mm is not None:
        made["dedendum"] = half + x - 0.5 * own.root_diameter_mm / module_mm
    if own.span_mm is not None and own.span_teeth is not None:
        angle = math.radians(form["pressure_angle_deg"])
        most = module_mm * nominal_span(own.teeth, x, angle, own.span_teeth)
        if own.span_mm > most:
            problem = f"must be <= {most:.6g} mm, the span over {own.span_teeth} teeth without backlash"
            raise InputError(f"{where}.span_mm", own.span_mm, problem, "use more profile_shift, or another span_teeth")
        made["tooth_thinning_um"] = 1e3 * (most - own.span_mm) / math.cos(angle)
    return made


def gear_of_form(teeth: int, form: Mapping[str, Any]) -> Gear:
    """Gear with the keys of `gearfe.base.tables.pair.tooth_form`, ``module_mm`` and ``bore_diameter_mm``."""
    made = dict(form)
    for name, (key, unit) in KEYS.items():
        if made.get(key) is not None:
            made[name] = made.pop(key) * unit
    amount, length, exponent = (made.pop(f"tip_relief.{name}", None) for name in ("amount", "length", "exponent"))
    if amount:
        made["tip_relief"] = TipRelief(amount, given(length, "tip_relief_length_mm"), exponent)
    return Gear(teeth, **{name: made[name] for name in made if name != "tip_relief_length_mm"})


def in_keys(error: InputError, where: str, *, key: str = "", unit: float = 0.0) -> InputError:
    """Return the error of an argument of `Gear` as that of its key in a table, in the key's unit.

    Parameters
    ----------
    error : InputError
        The error.
    where : str
        Table of the key, for the message.
    key : str
        Key, if it is not the usual one.
    unit : float
        Unit of the key in SI; 0 for the usual one.
    """
    named, own = KEYS.get(error.field, (error.field, 1.0))
    value = float(f"{error.value / (unit or own):.12g}") if isinstance(error.value, float) else error.value
    return InputError(f"{where}.{key or named}", value, error.problem, error.cure)


def _of_drawn(error: InputError, table: PairTable, side: str, drawn: str, made: str) -> InputError:
    """The error of a coefficient as that of the drawing value that it was made from, its bound as one of that value."""
    own: GearTable = getattr(table, side)
    field, value = f"pair.{side}.{drawn}", getattr(own, drawn)
    if error.limit is None:
        return InputError(field, value, f"{made}: {error.problem}", error.cure)
    sign, bound, _ = error.limit
    form, module = table.tooth_form(side), table.module_mm_of(side)
    shift = float(form["profile_shift"])
    if drawn != "tip_diameter_mm":  # these fall as the dedendum and the thinning grow
        sign = {"<": ">", ">": "<", ">=": "<="}[sign]
    if drawn == "span_mm":
        angle = math.radians(form["pressure_angle_deg"])
        whole = module * nominal_span(own.teeth, shift, angle, given(own.span_teeth, "span_teeth"))
        limit = whole - 1e-3 * bound * math.cos(angle)
    else:
        limit = module * (own.teeth + 2.0 * shift + 2.0 * (bound if drawn == "tip_diameter_mm" else -bound))
    cure = f"use a {'smaller' if '<' in sign else 'larger'} {drawn}"
    return InputError(field, value, f"{made}: {error.reason}: must be {sign} {limit:.6g} mm", cure)


def _renamed(error: InputError, table: PairTable, side: str, name: str) -> InputError:
    """The same error in the words of the job file: its key where it was given, its unit."""
    error = InputError(name, error.value, error.reason, error.cure, error.limit)
    key, unit = KEYS.get(name, (name, 1.0))
    if not side:
        return in_keys(error, "pair")
    own: GearTable = getattr(table, side)
    for drawn, stands_for in INSTEAD.items():
        if key in stands_for and getattr(own, drawn) is not None:
            number = error.value / unit if isinstance(error.value, float) else error.value
            return _of_drawn(error, table, side, drawn, f"makes {key} {number:.6g}")
    if name == "module" and own.pitch_diameter_mm is not None:
        return in_keys(error, f"pair.{side}", key="pitch_diameter_mm", unit=1e-3 / own.teeth)
    shared = getattr(own, key, None) is None and getattr(table, key, None) is not None
    return in_keys(error, "pair" if shared else f"pair.{side}")
