"""Table [rating] of a REXS model: materials, hardness, quality, roughness, allowances and the oil of its gears.

Loads and speeds are those of [train]. What the model does not say has the defaults of a rating.
"""

from __future__ import annotations

import math
import re
from typing import Any

from ....base.tables.rating import MATERIALS
from .ledger import READ
from .model import Component
from .reading import Reading

#: Type of heat treatment in REXS -> material of a rating.
HEAT_TREATED = {
    "black_malleable_cast_iron": "GTS",
    "case_hardened_wrought_steel": "Eh",
    "flame_or_induction_hardened_steel": "IF",
    "grey_cast_iron": "GG",
    "nitrided_steel": "NT",
    "nitrided_through_hardened_steel": "NV",
    "nitrocaburized_wrought_steel": "NV_nitrocar",
    "nodular_cast_iron_ferritic_structure": "GGG_ferritic",
    "nodular_cast_iron_perlitic_or_bainitic_structure": "GGG",
    "normalized_cast_steel": "St_cast",
    "normalized_wrought_low_carbon_steel": "St",
    "through_hardened_cast_steel": "V_cast",
    "through_hardened_wrought_steel": "V",
}
#: Materials whose hardness is in HBW, ISO 6336-5:2016, Table 1; that of the others is in HV.
BRINELL_SCALE = ("St", "St_cast", "GTS", "GGG", "GGG_ferritic", "GG")
#: HBW of a hardness in HV (ISO 18265: HB = 0.95 HV).
BRINELL = 0.95
#: Surface hardness (HV) from which on steel without a type of heat treatment counts as case-hardened.
CASE = 500.0
SERIES = "tooth_thickness_deviation_tolerance_series_din_3967_1978"
OIL = {
    "viscosity_at_40_degree_celsius": ("mm^2 / s", "viscosity_40_mm2_per_s"),
    "viscosity_at_100_degree_celsius": ("mm^2 / s", "viscosity_100_mm2_per_s"),
    "density_at_15_degree_celsius": ("kg / m^3", "oil_density_kg_per_m3"),
}


def dynamic_viscosity(low: float, high: float, density: float, temperature: float) -> float | None:
    """Dynamic viscosity (mPa s) at a temperature (C) of an oil with kinematic ones (mm2/s) at 40 and 100 C.

    None for numbers that no oil has: the formula has logarithms of them, and grows without bound.

    lg lg(nu + 0.7) is linear in lg T (Ubbelohde-Walther, ASTM D341).

    Parameters
    ----------
    low, high : float
        Kinematic viscosities at 40 and 100 C (mm2/s).
    density : float
        At 15 C (kg/m3).
    temperature : float
        Of the oil (C).
    """
    if not (0.5 < high < low < 1e6 and -50.0 < temperature < 300.0 and density > 0.0):
        return None
    one, two = (math.log10(math.log10(value + 0.7)) for value in (low, high))
    logs = [math.log10(at + 273.15) for at in (40.0, 100.0, temperature)]
    between = one + (two - one) * (logs[2] - logs[0]) / (logs[1] - logs[0])
    try:
        kinematic = 10.0**10.0**between - 0.7
    except OverflowError:
        return None
    dynamic = kinematic * (density - 0.65 * (temperature - 15.0)) * 1e-3
    return dynamic if 0.0 < dynamic < math.inf else None


def rating(reading: Reading, tables: dict[str, Any]) -> dict[str, Any]:
    """Return the table [rating], empty without meshes in a train.

    Parameters
    ----------
    reading
        The conversion.
    tables
        Tables of the job.
    """
    if not tables.get("meshes") or "train" not in tables:
        return {}
    gears = {name: _gear(reading, tables, name) for name in tables["gears"]}
    table = _oil(reading, tables)
    reading.defaulted(None, "rating", "steel Eh of grade MQ, quality 6, 20,000 h, K_A 1 where nothing else stands here")
    return {"edition": 2019, **table, "gears": {name: entry for name, entry in gears.items() if entry}}


def _gear(reading: Reading, tables: dict[str, Any], name: str) -> dict[str, Any]:
    """Keys of a gear."""
    gear, key = reading.part("gears", name), f"rating.gears.{name}"
    entry: dict[str, Any] = {}
    material = tables["gears"][name].get("material")
    # a material without an elastic modulus has no entry in [materials], but its strength counts
    items = reading.parts(gear, "reference", "origin", "referenced", "material")
    if material is not None:
        items = [reading.part("materials", material)]
    if items:
        entry |= _material(reading, items[0], key)
    quality = reading.integer(gear, "global_tolerance_class_iso_1328_2013")
    if quality is not None:
        entry["quality"] = quality
        reading.note(READ, gear, "global_tolerance_class_iso_1328_2013", f"{key}.quality")
    rough = reading.number(gear, "arithmetic_mean_roughness_flank_iso_4287_1997", "um")
    if rough is not None and rough > 0.0:
        entry["flank_ra_um"] = rough
        entry["flank_roughness_um"] = float(f"{6.0 * rough:.6g}")
        rule = "R_z = 6 R_a (ISO 6336-2)"
        reading.derived(gear, "arithmetic_mean_roughness_flank_iso_4287_1997", f"{key}.flank_roughness_um", rule)
    elif rough is not None:
        reading.ignored(gear, "arithmetic_mean_roughness_flank_iso_4287_1997", "must be positive")
    series = reading.text(gear, SERIES)
    if re.fullmatch(r"(a|ab|b|bc|c|cd|d|e|f|g|h)(2\d|30)", series) and series[-2:] != "20":
        entry["thickness_series"] = series
        rule = "limits of sizes and backlash by gearfe gear; the teeth of the job have tooth_thinning_um = 0"
        reading.derived(gear, SERIES, f"{key}.thickness_series", rule)
    elif series:
        reading.ignored(gear, SERIES, f"{series}: no series of DIN 3967, which has a to h with 21 to 30")
    return entry


def _material(reading: Reading, item: Component, key: str) -> dict[str, Any]:
    """Material, hardness and yield strength of a gear, as the file has them: the rating checks them."""
    entry: dict[str, Any] = {}
    hardness = reading.number(item, "surface_hardness_vickers", "HV")
    for name in (f"heat_treated_material_type_iso_6336_{year}" for year in (2019, 2006)):
        treated = reading.text(item, name)
        if treated in HEAT_TREATED and not entry:
            entry["material"] = HEAT_TREATED[treated]
            reading.note(READ, item, name, f"{key}.material")
        elif treated:
            rule = f"{treated}: {entry['material']} is taken" if entry else f"{treated}: no material of ISO 6336-5"
            reading.ignored(item, name, rule)
    if not entry and hardness is not None and hardness > 0.0:
        entry["material"] = "Eh" if hardness >= CASE else "V"
        rule = f"case-hardened from {CASE:g} HV on, else through-hardened"
        reading.derived(item, "surface_hardness_vickers", f"{key}.material", rule)
    values = {"hardness": (hardness, "surface_hardness_vickers")}
    values["yield_strength_MPa"] = reading.number(item, "yield_strength", "N / mm^2"), "yield_strength"
    for name, (value, attribute) in values.items():
        if value is None:
            continue
        if not entry or not 0.0 < value < math.inf:
            rule = "must be positive" if entry else "the type of heat treatment is missing"
            reading.ignored(item, attribute, rule)
        elif name == "hardness" and entry["material"] in BRINELL_SCALE:
            entry[name] = float(f"{BRINELL * value:.6g}")
            reading.derived(item, attribute, f"{key}.{name}", f"HBW = {BRINELL:g} HV (ISO 18265)")
        else:
            entry[name] = value
            reading.note(READ, item, attribute, f"{key}.{name}")
    assert entry.get("material", "Eh") in MATERIALS
    return entry


def _oil(reading: Reading, tables: dict[str, Any]) -> dict[str, Any]:
    """Keys of the oil: that of the first mesh with one, else of the casing."""
    casing = next(iter(reading.model.of_kind("gear_casing")), None)
    owners = [reading.part("meshes", name) for name in tables["meshes"]] + ([] if casing is None else [casing])
    oils = [oil for owner in owners for oil in reading.parts(owner, "reference", "origin", "referenced", "lubricant")]
    if not oils:
        return {}
    values = {key: reading.number(oils[0], name, unit) for name, (unit, key) in OIL.items()}
    cold, warm, density = (values[key] for _, key in OIL.values())
    temperature = reading.number(casing, "temperature_lubricant", "C")
    whole = None not in (cold, warm, density, temperature)
    usual = 1.0, 880.0, 40.0  # where the file gives none
    given = [value if own is None else own for own, value in zip((warm, density, temperature), usual, strict=True)]
    sound = dynamic_viscosity(cold or 0.0, *given)
    if cold is None or sound is None or not cold > 1.0:
        return {}
    table = {"viscosity_40_mm2_per_s": cold}
    reading.note(READ, oils[0], "viscosity_at_40_degree_celsius", "rating.viscosity_40_mm2_per_s")
    if not whole or not (warm or 0.0) > 1.0 or not -40.0 <= (temperature or 0.0) <= 200.0:
        return table
    table |= {"viscosity_100_mm2_per_s": warm or 0.0, "oil_temperature_C": temperature or 0.0}
    reading.note(READ, oils[0], "viscosity_at_100_degree_celsius", "rating.viscosity_100_mm2_per_s")
    reading.note(READ, casing, "temperature_lubricant", "rating.oil_temperature_C")
    if 500.0 <= (density or 0.0) <= 2000.0:
        table["oil_density_kg_per_m3"] = density or 0.0
        reading.note(READ, oils[0], "density_at_15_degree_celsius", "rating.oil_density_kg_per_m3")
    return table
