"""The [pair] table: a pair of spur gears and their materials, in everyday units.

Keys of the tooth form may stand in [pair], for both gears, or in [pair.pinion] and [pair.wheel], which then win.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..config import quantity
from ..errors import InputError, given

#: What holds where the file gives no value; the other keys are required.
DEFAULTS: dict[str, float] = {
    "profile_shift": 0.0,
    "addendum": 1.0,
    "dedendum": 1.25,
    "rack_tip_radius": 0.3,
    "tip_round_mm": 0.0,
    "tip_shortening": 0.0,
    "tip_relief_amount_um": 0.0,
    "tip_relief_exponent": 1.0,
    "tooth_thinning_um": 0.0,
}
#: Keys of a gear's drawing -> those of the tooth form that they stand for.
INSTEAD: dict[str, tuple[str, ...]] = {
    "tip_diameter_mm": ("addendum", "tip_shortening"),
    "root_diameter_mm": ("dedendum",),
    "span_mm": ("tooth_thinning_um",),
}
REQUIRED = ("pressure_angle_deg", "face_width_mm")
OPTIONAL = ("tip_relief_length_mm",)


@dataclass(frozen=True)
class MaterialTable:
    """Isotropic linear elastic material; without any key, structural steel."""

    youngs_modulus_GPa: float = quantity(200.0, doc="Young's modulus (GPa)", low=1e-9, high=1e9)
    poisson_ratio: float = quantity(0.30, doc="Poisson's ratio (-)", low=0.0, below=0.5)
    density_kg_per_m3: float = quantity(7850.0, doc="density (kg/m3)", above=0.0)


@dataclass(frozen=True)
class ToothFormTable:
    """Keys that both gears may share; coefficients are in units of the module."""

    module_mm: float | None = quantity(None, doc="module (mm), instead of pitch_diameter_mm", above=0.0)
    pressure_angle_deg: float | None = quantity(
        None, doc="pressure angle at the reference circle (deg)", low=5.0, high=45.0
    )
    face_width_mm: float | None = quantity(None, doc="face width (mm)", above=0.0)
    profile_shift: float | None = quantity(None, doc="profile shift coefficient x (times module), by default 0")
    addendum: float | None = quantity(None, doc="addendum (times module), by default 1", above=0.0)
    dedendum: float | None = quantity(None, doc="dedendum (times module), by default 1.25", above=0.0)
    rack_tip_radius: float | None = quantity(
        None, doc="tip radius of the generating rack (times module), by default 0.3", low=0.0
    )
    tip_round_mm: float | None = quantity(
        None, doc="radius of the round between flank and tip circle (mm), by default 0", low=0.0
    )
    tip_shortening: float | None = quantity(None, doc="tip shortening k (times module), by default 0", low=0.0)
    tip_relief_amount_um: float | None = quantity(None, doc="tip relief at the tip circle (um), by default 0", low=0.0)
    tip_relief_length_mm: float | None = quantity(None, doc="roll length of the relief from the tip (mm)", above=0.0)
    tip_relief_exponent: float | None = quantity(
        None, doc="exponent of the relief: 1 linear (default), 2 parabolic", low=1.0
    )
    tooth_thinning_um: float | None = quantity(
        None, doc="arc taken off each tooth at the reference circle, for backlash (um), by default 0", low=0.0
    )


def tooth_form(*tables: ToothFormTable) -> dict[str, Any]:
    """Keys of a tooth form but the module, each from the first table that gives it, else its default."""
    return {
        key: next((v for v in (getattr(table, key) for table in tables) if v is not None), DEFAULTS.get(key))
        for key in (*DEFAULTS, *REQUIRED, *OPTIONAL)
    }


@dataclass(frozen=True)
class GearTable(ToothFormTable):
    """One gear of a pair."""

    teeth: int = quantity(doc="number of teeth", low=8, high=1000)
    bore_diameter_mm: float = quantity(doc="diameter of the rigid bore (mm); it decides the stiffness level", above=0.0)
    pitch_diameter_mm: float | None = quantity(None, doc="reference diameter (mm), instead of module_mm", above=0.0)
    tip_diameter_mm: float | None = quantity(
        None, doc="tip diameter (mm), instead of addendum and tip_shortening", above=0.0
    )
    root_diameter_mm: float | None = quantity(None, doc="root diameter (mm), instead of dedendum", above=0.0)
    span_mm: float | None = quantity(
        None, doc="span size over span_teeth teeth, W_k (mm), instead of tooth_thinning_um", above=0.0
    )
    span_teeth: int | None = quantity(None, doc="number of teeth k of span_mm", low=2)
    material: MaterialTable | None = quantity(None, doc="material of this gear, if not the shared one")  # noqa: RUF009


@dataclass(frozen=True)
class PairTable(ToothFormTable):
    """A gear pair: shared keys here, [pair.pinion] and [pair.wheel] below, [pair.material] for both or one per gear."""

    pinion: GearTable = quantity(doc="the driving gear")  # noqa: RUF009
    wheel: GearTable = quantity(doc="the driven gear")  # noqa: RUF009
    centre_distance_mm: float | None = quantity(
        None, doc="centre distance (mm); without it, from the profile shifts without backlash", above=0.0
    )
    material: MaterialTable = quantity(MaterialTable, doc="material of both gears")  # noqa: RUF009

    def tooth_form(self, side: str) -> dict[str, Any]:
        """Keys of the tooth form of the gear `side` ("pinion" or "wheel"), shared values and defaults filled in."""
        return tooth_form(getattr(self, side), self)

    def module_mm_of(self, side: str) -> float:
        """Module of the gear `side` (mm), from its own pitch diameter or module, or from the shared module."""
        own: GearTable = getattr(self, side)
        if own.pitch_diameter_mm is not None:
            return own.pitch_diameter_mm / own.teeth
        return given(own.module_mm if own.module_mm is not None else self.module_mm, "pair.module_mm")

    def material_of(self, side: str) -> MaterialTable:
        """Material of the gear `side`."""
        own: GearTable = getattr(self, side)
        return own.material if own.material is not None else self.material

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that are missing or contradict each other."""
        for side in ("pinion", "wheel"):
            own: GearTable = getattr(self, side)
            label = f"{where}.{side}"
            for key, others in INSTEAD.items():
                for other in others if getattr(own, key) is not None else ():
                    if getattr(own, other) is not None:
                        problem = f"says what {other} = {getattr(own, other):g} says"
                        raise InputError(f"{label}.{key}", getattr(own, key), problem, "leave one out")
            if (own.span_mm is None) != (own.span_teeth is None):
                lacking = "span_mm" if own.span_mm is None else "span_teeth"
                raise InputError(f"{label}.{lacking}", None, "is required with the other one", "give both, or neither")
            module = own.module_mm if own.module_mm is not None else self.module_mm
            if own.pitch_diameter_mm is None and module is None:
                doc = "give the module (mm), here or in the shared table, or pitch_diameter_mm"
                raise InputError(f"{label}.module_mm", None, "is required", doc)
            if own.pitch_diameter_mm is not None and module is not None:
                implied = own.pitch_diameter_mm / own.teeth
                if abs(implied - module) > 1e-9 * module:
                    problem = f"contradicts module_mm = {module:g}: {own.teeth} teeth make it {module * own.teeth:.9g}"
                    raise InputError(f"{label}.pitch_diameter_mm", own.pitch_diameter_mm, problem, "leave one out")
            form = self.tooth_form(side)
            for key in REQUIRED:
                if form[key] is None:
                    raise InputError(f"{where}.{key}", None, "is required", f"add it to [{where}] or to each gear")
            if form["tip_relief_amount_um"] and form["tip_relief_length_mm"] is None:
                cure = "add it, or leave out tip_relief_amount_um"
                raise InputError(f"{label}.tip_relief_length_mm", None, "is required with a tip relief", cure)
