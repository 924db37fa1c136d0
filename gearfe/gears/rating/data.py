"""What a rating takes: gears in the lengths and signs of the standard, their strength, load and lubricant.

Gear 1 is the pinion of the standard, the gear with fewer teeth, whichever drives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...base.errors import InputError
from ...base.tables.rating import GearRatingTable, MeshRatingTable
from ..geometry.derived import active_tip_radius
from ..geometry.mesh_geometry import MeshGeometry
from ..geometry.spur_gear import Gear
from ..geometry.tolerances import helix_tolerances, rounded, tolerances
from . import materials
from .stiffness import ordered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...base.tables.rating import SpectrumBinTable

#: Edition of ISO 6336 -> edition of ISO 1328-1 whose tolerances go with it.
TOLERANCES = {2006: 1995, 2019: 2013}
#: What holds where the file gives no value.
MATERIAL, GRADE, CORE = "Eh", "MQ", "25"
FLANK_ROUGHNESS, ROOT_ROUGHNESS, QUALITY = 4.8, 20.0, 6
VISCOSITY, LIFE, FLANK_SAFETY, ROOT_SAFETY, LONG_LIFE = 220.0, 20_000.0, 1.0, 1.4, 0.85
#: Ratio R_z/R_a, ISO 6336-2; thermal contact coefficient of steel (N/(mm m^1/2 s^1/2 K)), ISO/TS 6336-20.
RZ_OVER_RA, THERMAL_CONTACT = 6.0, 13.78
OIL_DENSITY, LOAD_STAGE, SCUFFING_SAFETY = 890.0, 12, 2.0
#: Factor f_ZCa of helical gears without modifications, ISO 6336-2:2019.
NO_RELIEF = 1.2
#: HBW of a hardness in HV (ISO 18265: HB = 0.95 HV).
BRINELL = 0.95


@dataclass(frozen=True)
class Strength:
    """Strength and accuracy of a gear.

    Attributes
    ----------
    material
        Key of `gears.rating.materials.TABLE`.
    sigma_H_lim, sigma_F_lim
        Allowable stress numbers (N/mm^2).
    brinell
        Hardness of the surface (HBW), None: not known.
    yield_strength
        0.2 % proof stress or yield point (N/mm^2), None: not known; tensile strength of grey cast iron.
    flank_roughness, root_roughness
        R_z (um).
    quality
        Class of ISO 1328-1.
    f_pt, f_falpha, f_Hbeta
        Single pitch, profile form and helix slope deviation (um).
    C_a
        Tip relief (um), None: not given.
    web, rim
        b_s and s_R (mm), None: a solid disc, a thick rim.
    mates
        Mates that share its torque at the same time.
    fixed
        Whether the casing holds it.
    alternating
        Y_M.
    flank_ra
        R_a of the flanks (um).
    structure, thermal_contact
        X_W, and B_M (N/(mm m^1/2 s^1/2 K)).
    """

    material: str
    sigma_H_lim: float
    sigma_F_lim: float
    brinell: float | None = None
    yield_strength: float | None = None
    flank_roughness: float = FLANK_ROUGHNESS
    root_roughness: float = ROOT_ROUGHNESS
    quality: int = QUALITY
    f_pt: float = 0.0
    f_falpha: float = 0.0
    f_Hbeta: float = 0.0
    C_a: float | None = None
    web: float | None = None
    rim: float | None = None
    mates: int = 1
    fixed: bool = False
    alternating: float = 1.0
    flank_ra: float = FLANK_ROUGHNESS / RZ_OVER_RA
    structure: float = 1.0
    thermal_contact: float = THERMAL_CONTACT

    @property
    def hardened(self) -> bool:
        """Whether its surface is hardened."""
        return self.material in materials.SURFACE_HARDENED


def strength_of(table: GearRatingTable, gear: Gear, edition: int, where: str, relief: float | None = None) -> Strength:
    """Return the strength of a gear that a table describes.

    Parameters
    ----------
    table : GearRatingTable
        Its keys.
    gear : Gear
        The gear, for its tolerances.
    edition : int
        Edition of ISO 6336.
    where : str
        Name of the table, for messages.
    relief : float, optional
        Tip relief (um) of the flanks' deviations, which adds to that of the tooth form.

    Raises
    ------
    InputError
        For hardness out of the range of the material, a missing yield point, a class that the gear has no tolerances
        in.
    """
    material, grade = table.material or MATERIAL, table.grade or GRADE
    core, hardness = table.core_hardness or CORE, table.hardness

    def number(given: float | None, stress: str) -> float:
        if given is not None:
            return given
        return materials.stress_number(material, stress, grade, hardness, core=core, field=f"{where}.hardness")

    if table.yield_strength_MPa is None and material not in materials.SURFACE_HARDENED:
        problem = f"is required for {material}: the slip-layer thickness depends on it (ISO 6336-3, Table 3)"
        cure = "add the tensile strength" if material in materials.SOFT_IRON else "add the 0.2 % proof stress"
        raise InputError(f"{where}.yield_strength_MPa", None, problem, cure)
    brinell = None
    if hardness is not None:
        scale = materials.TABLE[material][materials.CONTACT][grade].scale
        brinell = hardness if scale == "HBW" else BRINELL * hardness
    quality = QUALITY if table.quality is None else table.quality
    deviations = {
        "single_pitch_um": lambda: tolerances(gear, quality, TOLERANCES[edition]).single,
        "profile_form_um": lambda: tolerances(gear, quality, TOLERANCES[edition]).form,
        "helix_slope_um": lambda: helix_tolerances(gear, quality, TOLERANCES[edition]).helix_slope,
    }
    found: dict[str, float] = {}
    for key, tolerance in deviations.items():
        given = getattr(table, key)
        try:
            found[key] = given if given is not None else rounded(1e6 * tolerance())
        except InputError as error:
            field = "quality" if error.field == "class" else error.field
            raise InputError(f"{where}.{field}", error.value, error.reason, f"add {key} to {where}") from None
    of_form = 0.0 if gear.tip_relief is None else 1e6 * gear.tip_relief.amount
    # without a relief of design there is that of running-in
    of_design = of_form + (relief or 0.0) or None
    return Strength(
        material=material,
        sigma_H_lim=number(table.sigma_h_lim_MPa, materials.CONTACT),
        sigma_F_lim=number(table.sigma_f_lim_MPa, materials.BENDING),
        brinell=brinell,
        yield_strength=table.yield_strength_MPa,
        flank_roughness=table.flank_roughness_um or FLANK_ROUGHNESS,
        root_roughness=table.root_roughness_um or ROOT_ROUGHNESS,
        quality=quality,
        f_pt=found["single_pitch_um"],
        f_falpha=found["profile_form_um"],
        f_Hbeta=found["helix_slope_um"],
        C_a=of_design if table.tip_relief_um is None else table.tip_relief_um,
        web=table.web_thickness_mm,
        rim=table.rim_thickness_mm,
        mates=table.mates or 1,
        fixed=bool(table.fixed),
        alternating=table.alternating_factor or 1.0,
        flank_ra=table.flank_ra_um or (table.flank_roughness_um or FLANK_ROUGHNESS) / RZ_OVER_RA,
        structure=table.structure_factor or 1.0,
        thermal_contact=table.thermal_contact_N_per_mm_m05_s05_K or THERMAL_CONTACT,
    )


@dataclass(frozen=True)
class Oil:
    """Lubricant of a mesh at work.

    Attributes
    ----------
    temperature
        Of the oil (deg C).
    viscosity_100
        Kinematic viscosity at 100 C (mm^2/s).
    density
        At 15 C (kg/m^3).
    kind, lubrication
        Keys of `gears.rating.scuffing.LUBRICANTS` and of `LUBRICATION`.
    stage
        Load stage of the FZG test A/8.3/90.
    friction
        Mean coefficient of friction, None: by the formulas.
    """

    temperature: float
    viscosity_100: float
    density: float = OIL_DENSITY
    kind: str = "mineral"
    lubrication: str = "dip"
    stage: int = LOAD_STAGE
    friction: float | None = None


#: Keys that say something about the oil at work only.
OIL_KEYS = (
    *("viscosity_100_mm2_per_s", "oil_density_kg_per_m3", "oil", "lubrication", "scuffing_load_stage"),
    *("friction_coefficient", "least_scuffing_safety"),
)


def oil_of(table: MeshRatingTable, where: str) -> Oil | None:
    """Return the oil that a table describes, None without oil_temperature_C.

    Raises
    ------
    InputError
        For keys of scuffing without oil_temperature_C, a missing viscosity at 100 C, and one that exceeds that at 40 C.
    """
    if table.oil_temperature_C is None:
        for key in OIL_KEYS:
            if getattr(table, key) is not None:
                problem = "has no effect without oil_temperature_C"
                raise InputError(
                    f"{where}.{key}", getattr(table, key), problem, "add oil_temperature_C, or leave it out"
                )
        return None
    warm, cold = table.viscosity_100_mm2_per_s, table.viscosity_40_mm2_per_s or VISCOSITY
    if warm is None:
        cure = "add the viscosity at 100 C (mm2/s) of the oil's data sheet, or leave out oil_temperature_C"
        raise InputError(f"{where}.viscosity_100_mm2_per_s", None, "is required with oil_temperature_C", cure)
    if warm >= cold:
        problem = f"must be < {cold:g} mm2/s, the viscosity at 40 C"
        raise InputError(f"{where}.viscosity_100_mm2_per_s", warm, problem, "see the oil's data sheet")
    return Oil(
        temperature=table.oil_temperature_C,
        viscosity_100=warm,
        density=table.oil_density_kg_per_m3 or OIL_DENSITY,
        kind=table.oil or "mineral",
        lubrication=table.lubrication or "dip",
        stage=table.scuffing_load_stage or LOAD_STAGE,
        friction=table.friction_coefficient,
    )


@dataclass(frozen=True)
class Load:
    """Load of a mesh, lubricant and what is prescribed; names as of `gearfe.base.tables.rating.MeshRatingTable`."""

    torque: float
    speed: float
    hours: float = LIFE
    application_factor: float = 1.0
    mesh_load_factor: float = 1.0
    dynamic_factor: float | None = None
    face_load_factor: float | None = None
    transverse_load_factor: float | None = None
    blank_factor: float | None = None
    viscosity_40: float = VISCOSITY
    misalignment: float | None = None
    shaft_misalignment: float | None = None
    bearing_span: float | None = None
    pinion_offset: float = 0.0
    shaft_diameter: float | None = None
    arrangement: str = "a"
    helix_modification: str = "none"
    tip_relief_factor: float = NO_RELIEF
    pitting_allowed: bool = False
    long_life: float = LONG_LIFE
    flank_safety: float = FLANK_SAFETY
    root_safety: float = ROOT_SAFETY
    scuffing_safety: float = SCUFFING_SAFETY
    oil: Oil | None = None
    spectrum: Sequence[SpectrumBinTable] = ()


def load_of(table: MeshRatingTable, where: str, torque: float | None = None) -> Load:
    """Return the load of a mesh that a table describes.

    Parameters
    ----------
    table : MeshRatingTable
        Its keys.
    where : str
        Name of the table, for messages.
    torque : float, optional
        Torque at the driver (N m) where the table gives none.

    Raises
    ------
    InputError
        For a missing torque or speed, keys that a spectrum replaces, and keys of the shaft that need each other.
    """
    spectrum = table.spectrum or ()
    given, speed, hours = table.torque_driver_Nm, table.speed_rpm, table.life_h or LIFE
    if spectrum:
        if table.life_h is not None:
            cure = "leave it out: the hours of the spectrum add up"
            raise InputError(f"{where}.life_h", table.life_h, "cannot be given together with a spectrum", cure)
        if speed is not None and given is None:
            problem = "must not be given with a spectrum, unless torque_driver_Nm is given, too"
            cure = "leave it out: the part with the largest torque has a speed; or add torque_driver_Nm"
            raise InputError(f"{where}.speed_rpm", speed, problem, cure)
        largest = max(spectrum, key=lambda part: (part.torque_driver_Nm, part.speed_rpm))
        given = largest.torque_driver_Nm if given is None else given
        speed = largest.speed_rpm if speed is None else speed
        hours = sum(part.hours for part in spectrum)
    given = torque if given is None else given
    if given is None:
        cure = "add torque_driver_Nm (N m) to [rating], or torque_Nm (of the wheel) to [stiffness]"
        raise InputError(f"{where}.torque_driver_Nm", None, "no torque is given", cure)
    if speed is None:
        raise InputError(
            f"{where}.speed_rpm", None, "is required", "add the speed of the driver (1/min), or a table [train]"
        )
    span, shaft = table.bearing_span_mm, table.shaft_diameter_mm
    if (span is None) != (shaft is None):
        keys = "bearing_span_mm", "shaft_diameter_mm"
        lacking, other = keys if span is None else keys[::-1]
        raise InputError(f"{where}.{lacking}", None, f"is required together with {other}", "give both, or neither")
    offset = table.pinion_offset_mm or 0.0
    if span is not None and offset > 0.3 * span:
        problem = f"must be <= {0.3 * span:.6g} mm, 0.3 of the span, for method C of ISO 6336-1"
        raise InputError(f"{where}.pinion_offset_mm", offset, problem, "give shaft_misalignment_um of an analysis")
    return Load(
        torque=given,
        speed=speed,
        hours=hours,
        application_factor=table.application_factor or 1.0,
        mesh_load_factor=table.mesh_load_factor or 1.0,
        dynamic_factor=table.dynamic_factor,
        face_load_factor=table.face_load_factor,
        transverse_load_factor=table.transverse_load_factor,
        blank_factor=table.blank_factor,
        viscosity_40=table.viscosity_40_mm2_per_s or VISCOSITY,
        misalignment=table.misalignment_um,
        shaft_misalignment=table.shaft_misalignment_um,
        bearing_span=span,
        pinion_offset=offset,
        shaft_diameter=shaft,
        arrangement=table.arrangement or "a",
        helix_modification=table.helix_modification or "none",
        tip_relief_factor=NO_RELIEF if table.tip_relief_factor is None else table.tip_relief_factor,
        pitting_allowed=bool(table.pitting_allowed),
        long_life=table.long_life_factor or LONG_LIFE,
        flank_safety=table.least_flank_safety or FLANK_SAFETY,
        root_safety=table.least_root_safety or ROOT_SAFETY,
        scuffing_safety=table.least_scuffing_safety or SCUFFING_SAFETY,
        oil=oil_of(table, where),
        spectrum=spectrum,
    )


@dataclass(frozen=True)
class PairData:
    """Gears of a mesh as the formulas take them: mm and rad, gear 1 with fewer teeth, signs of ISO 21771.

    Attributes
    ----------
    z, x, z_n
        Tooth numbers, profile shifts and virtual tooth numbers.
    m_n, alpha_n, beta, alpha_t, beta_b, alpha_wt
        Module and angles.
    a
        Centre distance.
    d, d_b, d_a, d_f
        Reference, base, active tip and root diameter.
    h_fP, rho_fP
        Dedendum and tip radius of the racks.
    b, b_F
        Common face width, and the widths that bear at the roots.
    eps_alpha, eps_beta
        Transverse contact ratio and overlap ratio.
    cutter
        Virtual number of teeth and profile shift of the pinion-type cutter of an internal gear 2; None: external gears.
    """

    z: tuple[int, int]
    x: tuple[float, float]
    z_n: tuple[float, float]
    m_n: float
    alpha_n: float
    beta: float
    alpha_t: float
    beta_b: float
    alpha_wt: float
    a: float
    d: tuple[float, float]
    d_b: tuple[float, float]
    d_a: tuple[float, float]
    d_f: tuple[float, float]
    h_fP: tuple[float, float]
    rho_fP: tuple[float, float]
    b: float
    b_F: tuple[float, float]
    eps_alpha: float
    eps_beta: float
    cutter: tuple[float, float] | None = None

    @property
    def u(self) -> float:
        """Gear ratio z_2/z_1, negative for an internal wheel."""
        return self.z[1] / self.z[0]

    @property
    def eps_gamma(self) -> float:
        """Total contact ratio."""
        return self.eps_alpha + self.eps_beta

    @property
    def rho_red(self) -> float:
        """Radius of relative curvature at the pitch point, transverse (mm), ISO 6336-2:2006 (46), (47)."""
        one, two = (0.5 * d_b * math.tan(self.alpha_wt) for d_b in self.d_b)
        return one * two / (one + two)


def _cutter(gear: Gear) -> tuple[float, float] | None:
    """Virtual number of teeth and profile shift of the cutter of an internal gear.

    Raises
    ------
    InputError
        For an internal gear whose root is given by its form diameter.
    """
    if not gear.internal:
        return None
    if gear.form_diameter is not None:
        problem = "gives the root without a cutter, which the tooth form of ISO 6336-3 needs"
        cure = "write cutter_teeth instead of form_diameter_mm"
        raise InputError("form_diameter", 1e3 * gear.form_diameter, problem, cure)
    teeth = gear.tooth_count // 2 if gear.cutter_teeth is None else gear.cutter_teeth
    return teeth * gear.virtual_teeth / gear.teeth, gear.cutter_shift


def pair_data(pair: MeshGeometry) -> PairData:
    """Return the gears of a mesh as the formulas take them."""
    one, two = ordered(pair)

    def diameters(radii: tuple[float, float]) -> tuple[float, float]:
        return 2e3 * one.sign * radii[0], 2e3 * two.sign * radii[1]

    b = 1e3 * pair.common_width
    return PairData(
        z=(one.teeth, two.teeth),
        x=(one.profile_shift, two.profile_shift),
        z_n=(one.virtual_teeth, two.virtual_teeth),
        m_n=1e3 * one.module,
        alpha_n=one.pressure_angle,
        beta=one.helix_angle,
        alpha_t=one.transverse_pressure_angle,
        beta_b=one.base_helix_angle,
        alpha_wt=pair.working_pressure_angle,
        a=1e3 * pair.wheel_centre,
        d=diameters((one.reference_radius, two.reference_radius)),
        d_b=diameters((one.base_radius, two.base_radius)),
        d_a=diameters((active_tip_radius(one), active_tip_radius(two))),
        d_f=diameters((one.root_radius, two.root_radius)),
        h_fP=(1e3 * one.dedendum * one.module, 1e3 * two.dedendum * two.module),
        rho_fP=(1e3 * one.rack_tip_radius * one.module, 1e3 * two.rack_tip_radius * two.module),
        b=b,
        b_F=(
            min(1e3 * one.face_width, b + 2e3 * one.module),
            min(1e3 * two.face_width, b + 2e3 * two.module),
        ),
        eps_alpha=pair.contact_ratio_active,
        eps_beta=pair.overlap_ratio,
        cutter=_cutter(two),
    )
