"""The [rating] table: load capacity by ISO 6336, in everyday units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from ..config import Removed, quantity, renamed
from ..errors import InputError, shown, unknown_name

#: Editions of ISO 6336; that of 2006 goes with the tolerances of ISO 1328-1:1995, that of 2019 with those of 2013.
EDITIONS = (2006, 2019)
#: Materials of ISO 6336-5.
MATERIALS = (
    *("St", "St_cast", "GTS", "GGG", "GGG_ferritic", "GG", "V_carbon", "V", "V_cast_carbon", "V_cast"),
    *("Eh", "IF", "NT", "NV", "NV_nitrocar"),
)
#: Qualities of material of ISO 6336-5.
GRADES = ("ML", "MQ", "ME")
#: Hardness of the core of case-hardened steel of grade MQ (HRC).
CORES = ("25", "25_jominy", "30")
#: Arrangements of ISO 6336-1, Figure 13.
ARRANGEMENTS = ("a", "b", "c", "d", "e")
#: Lubricants of ISO/TS 6336-20, and ways of lubrication.
OILS = (*("mineral", "polyalphaolefin", "polyglycol", "water_soluble_polyglycol", "phosphate_ester", "traction_fluid"),)
LUBRICATION = ("dip", "spray", "spray_and_dip", "submerged")
#: Helix modifications of ISO 6336-1, Table 8.
HELIX_MODIFICATIONS = ("none", "crowning", "crowning_of_load", "correction", "correction_and_crowning", "end_relief")


def _at_driver(torque: Any) -> str:
    return f"write torque_driver_Nm = {shown(torque)} for the driver; torque_Nm of [stiffness] is at the wheel"


#: Torque of a rating under the name that [stiffness] has for the wheel's torque.
DRIVER_TORQUE: dict[str, Removed] = {"torque_Nm": ("does not say which shaft it is of", _at_driver)}


@dataclass(frozen=True)
class GearRatingTable:
    """Strength and accuracy of one gear."""

    #: Removed keys, see `gearfe.base.config.build`.
    REMOVED: ClassVar[dict[str, Removed]] = {"thermal_contact": renamed("thermal_contact_N_per_mm_m05_s05_K")}

    material: str | None = quantity(
        None, choices=MATERIALS, doc="material of ISO 6336-5, by default Eh (case-hardened steel)"
    )
    grade: str | None = quantity(None, choices=GRADES, doc="quality of the material: ML, MQ (default) or ME")
    hardness: float | None = quantity(
        None, above=0.0, doc="hardness of the surface (HV; HBW of St, St_cast, GTS, GGG, GG)"
    )
    core_hardness: str | None = quantity(
        None,
        choices=CORES,
        doc="core of case-hardened steel of grade MQ: 25 HRC (default), 25_jominy (and 28 HRC at J = 12 mm), 30 HRC",
    )
    sigma_h_lim_MPa: float | None = quantity(
        None, above=0.0, doc="allowable stress number of contact (MPa), instead of that of the material"
    )
    sigma_f_lim_MPa: float | None = quantity(
        None, above=0.0, doc="allowable stress number of bending (MPa), instead of that of the material"
    )
    yield_strength_MPa: float | None = quantity(
        None, above=0.0, doc="yield point or 0.2 % proof stress (MPa); needed for St, V, GGG, GTS; tensile for GG"
    )
    flank_roughness_um: float | None = quantity(None, above=0.0, doc="R_z of the flanks (um), by default 4.8")
    root_roughness_um: float | None = quantity(None, above=0.0, doc="R_z of the fillets (um), by default 20")
    quality: int | None = quantity(
        None, low=0, high=12, doc="flank tolerance class of ISO 1328-1, by default 6 (edition 2006: accuracy grade)"
    )
    single_pitch_um: float | None = quantity(
        None, low=0.0, doc="single pitch deviation f_pt (um), instead of that of quality"
    )
    profile_form_um: float | None = quantity(
        None, low=0.0, doc="profile form deviation f_falpha (um), instead of that of quality"
    )
    helix_slope_um: float | None = quantity(
        None, low=0.0, doc="helix slope deviation f_Hbeta (um), instead of that of quality; no modification"
    )
    tip_relief_um: float | None = quantity(
        None,
        low=0.0,
        doc="tip relief C_a (um); left out: that of tooth form and microgeometry, without any that of running-in",
    )
    flank_ra_um: float | None = quantity(
        None, above=0.0, doc="R_a of the flanks (um), for scuffing; left out: a sixth of flank_roughness_um"
    )
    structure_factor: float | None = quantity(
        None,
        above=0.0,
        high=2.0,
        doc="structure factor X_W of scuffing: 1 (default) case-hardened, 1.5 nitrided, 0.45 stainless",
    )
    thermal_contact_N_per_mm_m05_s05_K: float | None = quantity(
        None, above=0.0, doc="thermal contact coefficient B_M (N/(mm m^0.5 s^0.5 K)), by default 13.78 (steel)"
    )
    web_thickness_mm: float | None = quantity(None, above=0.0, doc="web b_s (mm), for C_R; left out: a solid disc")
    rim_thickness_mm: float | None = quantity(
        None, above=0.0, doc="rim s_R below the roots (mm), for C_R and Y_B; left out: it is thick"
    )
    mates: int | None = quantity(
        None,
        low=1,
        high=100,
        doc="mates that share its torque, as planets at a sun; left out: those of the train, else 1",
    )
    fixed: bool | None = quantity(
        None, doc="true: held by the casing, as most rings of planetary stages; its mass counts as infinite in K_v"
    )
    alternating_factor: float | None = quantity(
        None,
        above=0.0,
        high=1.0,
        doc="factor Y_M of the bending number; left out: 0.7 for planets and idlers of a train, else 1",
    )
    thickness_allowances_um: tuple[float, float] | None = quantity(
        None, doc="upper and lower allowance of the tooth thickness (um), A_sne and A_sni, for the backlash"
    )
    thickness_series: str | None = quantity(
        None, doc='series of DIN 3967 for the tooth thickness, as "cd25", instead of thickness_allowances_um'
    )
    ball_diameter_mm: float | None = quantity(
        None, above=0.0, doc="diameter of the balls of M_dK (mm); left out: one that touches near d + 2 x m_n"
    )


@dataclass(frozen=True)
class SpectrumBinTable:
    """A part of a load spectrum."""

    REMOVED: ClassVar[dict[str, Removed]] = DRIVER_TORQUE

    torque_driver_Nm: float = quantity(doc="torque at the driver (N m)", above=0.0)
    speed_rpm: float = quantity(doc="speed of the driver (1/min)", above=0.0)
    hours: float = quantity(doc="time at this load (h)", above=0.0)


@dataclass(frozen=True)
class MeshRatingTable:
    """Load, lubricant and factors of one mesh."""

    REMOVED: ClassVar[dict[str, Removed]] = DRIVER_TORQUE

    torque_driver_Nm: float | None = quantity(None, above=0.0, doc="torque at the driver (N m)")
    speed_rpm: float | None = quantity(
        None,
        above=0.0,
        doc="speed of the driver (1/min), in planetary gears relative to the carrier; left out: that of the train",
    )
    life_h: float | None = quantity(None, above=0.0, doc="required life (h), by default 20,000; not with a spectrum")
    application_factor: float | None = quantity(None, low=1.0, doc="application factor K_A, by default 1")
    mesh_load_factor: float | None = quantity(None, low=1.0, doc="mesh load factor K_gamma, by default 1")
    dynamic_factor: float | None = quantity(None, low=1.0, doc="dynamic factor K_v; left out: method B")
    face_load_factor: float | None = quantity(None, low=1.0, doc="face load factor K_Hbeta; left out: method C")
    transverse_load_factor: float | None = quantity(
        None, low=1.0, doc="transverse load factors K_Halpha = K_Falpha; left out: method B"
    )
    blank_factor: float | None = quantity(
        None, above=0.0, high=1.0, doc="gear blank factor C_R; left out: from web and rim, 1 for solid discs"
    )
    viscosity_40_mm2_per_s: float | None = quantity(
        None, above=0.0, doc="kinematic viscosity of the oil at 40 C (mm2/s), by default 220"
    )
    oil_temperature_C: float | None = quantity(
        None, low=-40.0, high=200.0, doc="oil temperature (C); with it scuffing is rated, too"
    )
    viscosity_100_mm2_per_s: float | None = quantity(
        None, above=1.0, doc="kinematic viscosity of the oil at 100 C (mm2/s); needed with oil_temperature_C"
    )
    oil_density_kg_per_m3: float | None = quantity(
        None, low=500.0, high=2000.0, doc="density of the oil at 15 C (kg/m3), by default 890"
    )
    oil: str | None = quantity(None, choices=OILS, doc="kind of lubricant, by default mineral")
    lubrication: str | None = quantity(
        None, choices=LUBRICATION, doc="way of lubrication, by default dip; spray has X_S = 1.2, submerged 0.2"
    )
    scuffing_load_stage: int | None = quantity(
        None, low=1, high=14, doc="load stage of the oil in the FZG test A/8.3/90 (ISO 14635-1), by default 12"
    )
    friction_coefficient: float | None = quantity(
        None, above=0.0, high=1.0, doc="mean coefficient of friction; left out: from load, speed, oil and roughness"
    )
    misalignment_um: float | None = quantity(
        None,
        low=0.0,
        doc="misalignment of manufacture f_ma (um), not that of [pair]; left out: from both helix slope deviations",
    )
    shaft_misalignment_um: float | None = quantity(
        None, low=0.0, doc="misalignment by deflection f_sh (um); left out: from the keys of the shaft, else 0"
    )
    bearing_span_mm: float | None = quantity(None, above=0.0, doc="bearing span l of the pinion's shaft (mm)")
    pinion_offset_mm: float | None = quantity(
        None, low=0.0, doc="distance s of the pinion from the middle of the span (mm)"
    )
    shaft_diameter_mm: float | None = quantity(None, above=0.0, doc="diameter d_sh of the pinion's shaft (mm)")
    arrangement: str | None = quantity(
        None, choices=ARRANGEMENTS, doc="arrangement of ISO 6336-1, Figure 13, by default a"
    )
    helix_modification: str | None = quantity(
        None, choices=HELIX_MODIFICATIONS, doc="helix modification of ISO 6336-1, Table 8, by default none"
    )
    tip_relief_factor: float | None = quantity(
        None,
        low=1.0,
        high=1.2,
        doc="factor f_ZCa of helical gears (edition 2019): 1 with proven modifications, 1.2 (default) without",
    )
    pitting_allowed: bool | None = quantity(None, doc="true: a certain amount of pitting is allowed")
    long_life_factor: float | None = quantity(
        None, low=0.85, high=1.0, doc="life factors at 1e10 cycles, by default 0.85; 1 for optimum conditions"
    )
    least_flank_safety: float | None = quantity(None, above=0.0, doc="required safety S_Hmin, by default 1")
    least_root_safety: float | None = quantity(None, above=0.0, doc="required safety S_Fmin, by default 1.4")
    least_scuffing_safety: float | None = quantity(
        None, above=0.0, doc="required safety against scuffing, of both temperatures, by default 2"
    )
    distance_allowances_um: tuple[float, float] | None = quantity(
        None, doc="upper and lower allowance of the centre distance (um), for the backlash"
    )
    spectrum: tuple[SpectrumBinTable, ...] | None = quantity(
        None, doc="load spectrum for damage and life by Miner's rule; left out: torque_driver_Nm, speed_rpm and life_h"
    )


@dataclass(frozen=True)
class RatingTable(MeshRatingTable, GearRatingTable):
    """Keys of all meshes and gears, and those of single ones by name, which win."""

    REMOVED: ClassVar[dict[str, Removed]] = GearRatingTable.REMOVED | MeshRatingTable.REMOVED

    edition: int = quantity(2019, low=2006, high=2019, doc="edition of ISO 6336: 2006 or 2019")
    gears: dict[str, GearRatingTable] = quantity(dict, doc="keys of gears by their names")  # noqa: RUF009
    meshes: dict[str, MeshRatingTable] = quantity(dict, doc="keys of meshes by their names")  # noqa: RUF009

    def check(self, where: str) -> None:
        """Raise `InputError` for an edition that there is not."""
        if self.edition not in EDITIONS:
            raise InputError(f"{where}.edition", self.edition, "must be 2006 or 2019", "2019 is the newer one")

    def of_gear(self, name: str, known: Mapping[str, Any]) -> GearRatingTable:
        """Return the keys of a gear: its own, else those of all; `known`: names of gears that there are."""
        return _merged(self, self.gears, name, known, GearRatingTable, "gears")

    def of_mesh(self, name: str, known: Mapping[str, Any]) -> MeshRatingTable:
        """Return the keys of a mesh: its own, else those of all; `known`: names of meshes that there are."""
        return _merged(self, self.meshes, name, known, MeshRatingTable, "meshes")


#: Keys that say the same in two ways: one of a single gear replaces both of all gears.
ALTERNATIVES = ("thickness_allowances_um", "thickness_series")


def _merged(
    table: RatingTable, own: Mapping[str, Any], name: str, known: Mapping[str, Any], kind: Any, where: str
) -> Any:
    for other in own:
        if other not in known:
            raise unknown_name(f"rating.{where}", other, known)
    keys = [field.name for field in fields(kind)]
    given = {key: getattr(own[name], key) for key in keys} if name in own else {}
    chosen = {key: value for key, value in given.items() if value is not None}
    replaced = set(ALTERNATIVES) if set(ALTERNATIVES) & chosen.keys() else set()  # of all gears
    return kind(**{key: chosen.get(key, None if key in replaced else getattr(table, key)) for key in keys})
