"""Report of a rating: the content of rating.json, the table rating.csv, and the lines that are printed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.tables.rating import GearRatingTable, MeshRatingTable, RatingTable
from ..geometry.balls import ball_diameter, over_balls
from ..geometry.derived import derived_geometry
from ..geometry.measures import backlash_limits, span_of
from ..geometry.pair import Gear, GearPair
from ..geometry.thickness_series import thickness_allowances
from ..geometry.tolerances import tolerances_um
from .data import QUALITY, TOLERANCES
from .ledger import Entry
from .rate import Rating

#: Points of the path of contact in rating.json.
PATH_POINTS = 200
#: Roles of the gears of a pair.
SIDES = ("pinion", "wheel")


def rating_summary(rating: Rating, pair: GearPair, table: RatingTable, mesh: str) -> dict[str, Any]:
    """Return the content of rating.json.

    Parameters
    ----------
    rating : Rating
        The rating.
    pair : GearPair
        Its gears.
    table : RatingTable
        The table [rating].
    mesh : str
        Name of the mesh.
    """
    names = rating.names[rating.driver], rating.names[1 - rating.driver]
    groups: dict[str, dict[str, Any]] = {}
    for entry in rating.entries():
        groups.setdefault(entry.group, {})[entry.name] = {
            "value": _by_name(entry, rating.names),
            "unit": entry.unit,
            "formula": entry.formula,
            "meaning": entry.meaning,
        }
    gear_keys = {name: table.of_gear(name, dict.fromkeys((*names, *table.gears))) for name in names}
    mesh_keys = table.of_mesh(mesh, dict.fromkeys((mesh, *table.meshes)))
    return {
        "edition": f"ISO 6336:{rating.edition}",
        "gears": dict(zip(("gear_1", "gear_2"), rating.names, strict=True)),
        "driver": names[0],
        "method": method(rating),
        "basis": [list(row) for row in basis(rating)],
        "safety": {
            symbol: dict(zip(rating.names, values, strict=True))
            for symbol, values in (("S_H", rating.S_H), ("S_F", rating.S_F))
        }
        | scuffing_safeties(rating),
        **groups,
        **_temperatures(rating),
        "strength": {name: asdict(s) for name, s in zip(rating.names, rating.strengths, strict=True)},
        "load": asdict(rating.load),
        "geometry": derived_geometry(pair),
        "measures": measures(pair, names, gear_keys, mesh_keys, rating.edition),
        "warnings": [*pair.warnings, *rating.warnings],
    }


def scuffing_safeties(rating: Rating) -> dict[str, float]:
    """Safety factors against scuffing by their symbols, none without oil_temperature_C."""
    heat = rating.scuffing
    if heat is None:
        return {}
    return {"S_B": heat.S_B} | ({} if heat.S_intS is None else {"S_intS": heat.S_intS})


def _temperatures(rating: Rating) -> dict[str, Any]:
    """Places, load shares and temperatures along the path of contact."""
    if rating.scuffing is None:
        return {}
    path = rating.scuffing.path
    step = max(1, len(path.gamma) // PATH_POINTS)
    columns = {"Gamma": path.gamma, "X_Gamma": path.share, "theta_fl_K": path.flash, "theta_B_C": path.contact}
    return {"scuffing_path": {name: values[::step].tolist() for name, values in columns.items()}}


def _by_name(entry: Entry, names: tuple[str, str]) -> Any:
    if isinstance(entry.value, tuple):
        return dict(zip(names, entry.value, strict=True))
    return entry.value


def measures(
    pair: GearPair,
    names: tuple[str, str],
    gears: Mapping[str, GearRatingTable],
    mesh: MeshRatingTable,
    edition: int = 2019,
) -> dict[str, Any]:
    """Return tolerances, sizes over balls and spans with their limits, and the backlash that allowances leave.

    Parameters
    ----------
    pair : GearPair
        The gears.
    names : (str, str)
        Names of pinion and wheel of the pair.
    gears : mapping
        Name -> keys of the gear.
    mesh : MeshRatingTable
        Keys of the mesh.
    edition : int
        Edition of ISO 6336, with which one of ISO 1328-1 goes.
    """
    made: dict[str, Any] = {}
    limits = {name: _thickness(getattr(pair, side), gears[name]) for side, name in zip(SIDES, names, strict=True)}
    allowances = [limits[name] for name in names]
    for side, name in zip(SIDES, names, strict=True):
        gear, keys = getattr(pair, side), gears[name]
        quality = QUALITY if keys.quality is None else keys.quality
        allowance = limits[name]
        thinning = [] if allowance is None else [-1e-6 * value for value in allowance]
        k = gear.span_teeth
        sizes: dict[str, Any] = {"span_teeth": k, "span_mm": 1e3 * gear.span_size(k)}
        if thinning:
            sizes["span_limits_mm"] = [1e3 * span_of(gear, k, value) for value in thinning]
        sizes |= _balls(gear, keys.ball_diameter_mm, thinning)
        made[name] = {
            "quality": quality,
            "tolerances_um": _tolerances(gear, quality, TOLERANCES[edition]),
            **sizes,
        }
    distance = mesh.distance_allowances_um
    if distance is not None or any(allowances):
        thickness = [(0.0, 0.0) if a is None else (1e-6 * a[0], 1e-6 * a[1]) for a in allowances]
        one, two = (0.0, 0.0) if distance is None else distance
        found = backlash_limits(pair, (thickness[0], thickness[1]), (1e-6 * one, 1e-6 * two))
        made["backlash"] = {
            "circumferential_mm": [1e3 * value for value in found.circumferential],
            "normal_mm": [1e3 * value for value in found.normal],
        }
    return made


def _thickness(gear: Gear, keys: GearRatingTable) -> tuple[float, float] | None:
    """Upper and lower allowance of the tooth thickness (um), None: not given."""
    if keys.thickness_series is None:
        return keys.thickness_allowances_um
    if keys.thickness_allowances_um is not None:
        problem = "cannot be given together with thickness_allowances_um"
        raise InputError("rating.thickness_series", keys.thickness_series, problem, "leave out one of the two")
    return thickness_allowances(keys.thickness_series, 2e3 * gear.reference_radius, "rating.thickness_series")


def _balls(gear: Gear, given_mm: float | None, thinning: list[float]) -> dict[str, Any]:
    """Ball diameter and sizes over balls with their limits (mm) at each thinning (m)."""
    ball = ball_diameter(gear) if given_mm is None else 1e-3 * given_mm
    made: dict[str, Any] = {"ball_diameter_mm": 1e3 * ball, "over_balls_mm": 1e3 * over_balls(gear, ball)}
    if thinning:
        made["over_balls_limits_mm"] = [1e3 * over_balls(gear, ball, value) for value in thinning]
    if given_mm is not None and any(math.isnan(value) for value in np.hstack(list(made.values()))):
        problem = "is too small: such balls fall to the root of the space"
        raise InputError("rating.ball_diameter_mm", given_mm, problem, f"{1e3 * ball_diameter(gear):.4g} mm fits")
    return made


def _tolerances(gear: Any, quality: int, edition: int) -> dict[str, float] | None:
    """Tolerances (um) of a gear, None: the standard has none for it."""
    try:
        return tolerances_um(gear, quality, edition)
    except InputError:
        return None


#: Values that the command prints of each group.
PRINTED = {
    "influence": (
        *("F_t_N", "v_m_per_s", "c_prime_N_per_mm_um", "c_gamma_alpha_N_per_mm_um"),
        *("N", "K_A", "K_gamma", "K_v", "K_Hbeta", "K_Fbeta", "K_Halpha", "K_Falpha"),
    ),
    "flank": (
        *("Z_H", "Z_E", "Z_eps", "Z_beta", "Z_BD", "Z_L", "Z_v", "Z_R", "Z_W", "Z_NT"),
        *("sigma_H0_MPa", "sigma_H_MPa", "sigma_HP_MPa", "S_H"),
    ),
    "root": (
        *("Y_F", "Y_S", "Y_beta", "Y_B", "Y_DT", "Y_NT", "Y_delta_rel_T", "Y_R_rel_T", "Y_X"),
        *("sigma_F0_MPa", "sigma_F_MPa", "sigma_FP_MPa", "S_F"),
    ),
    "life": ("U_H", "U_F", "life_flank_h", "life_root_h", "S_H_spectrum", "S_F_spectrum"),
    "loss": ("H_V", "P_V_W"),
    "scuffing": (
        *("mu_m", "theta_flm_K", "theta_M_C", "theta_B_C", "theta_S_C", "S_B"),
        *("mu_mC", "theta_flaint_K", "theta_int_C", "theta_Sint_C", "S_intS"),
    ),
}


def method(rating: Rating) -> str:
    """Return the edition, the methods, and the edition of the formula numbers."""
    face = rating.sources.get("K_Hbeta", "by method C")
    return f"ISO 6336:{rating.edition}, method B, K_Hβ {face}; formula numbers of the edition of 2006"


def basis(rating: Rating) -> list[tuple[str, str, str, str]]:
    """Return what a rating starts from: name, value of gear 1, value of gear 2 and unit of each row."""
    general, load, pair = rating.general, rating.load, rating.pair
    one, two = rating.strengths
    torques = [0.5e-3 * general.F_t_N * abs(d) for d in pair.d]
    turns = load.speed * (abs(pair.u) if rating.driver else 1.0)
    speeds = turns, turns / abs(pair.u)
    roles = ["driver" if i == rating.driver else "driven" for i in (0, 1)]

    def both(*values: float | None) -> tuple[str, str]:
        texts = ["-" if value is None else f"{value:.5g}" for value in values]
        return texts[0], texts[-1]

    rows: list[tuple[str, str, str, str]] = [
        ("gear", *rating.names, ""),
        ("role", roles[0], roles[1], ""),
        ("teeth", *both(*pair.z), ""),
        ("torque of this mesh", *both(*torques), "N m"),
        ("mates that share the torque", *both(one.mates, two.mates), ""),
        ("speed", *both(*speeds), "1/min"),
        (
            "power of this mesh",
            *both(*(1e-3 * t * n * math.pi / 30.0 for t, n in zip(torques, speeds, strict=True))),
            "kW",
        ),
        ("common face width", *both(pair.b), "mm"),
        ("material", one.material, two.material, ""),
        ("hardness", *both(one.brinell, two.brinell), "HBW"),
        ("σ_Hlim", *both(one.sigma_H_lim, two.sigma_H_lim), "MPa"),
        ("σ_Flim", *both(one.sigma_F_lim, two.sigma_F_lim), "MPa"),
        ("flank tolerance class, ISO 1328-1", *both(one.quality, two.quality), ""),
        ("application factor K_A", *both(general.K_A), ""),
        ("required life", *both(load.hours), "h"),
        ("oil viscosity at 40 °C", *both(load.viscosity_40), "mm²/s"),
        ("required S_Hmin", *both(load.flank_safety), ""),
        ("required S_Fmin", *both(load.root_safety), ""),
    ]
    if load.oil is not None:
        rows.append(("required safety against scuffing", *both(load.scuffing_safety), ""))
    if "K_Hbeta" not in rating.sources and load.shaft_misalignment is None and load.bearing_span is None:
        rows.append(("f_sh (no data of the pinion's shaft)", *both(0.0), "µm"))
    return rows


def rating_lines(rating: Rating) -> list[str]:
    """Lines to print: the basis and the main values of both gears."""
    lines = [method(rating)]
    lines += [f"  {name:<36}{one:>12}  {two:>12}  {unit}".rstrip() for name, one, two, unit in basis(rating)]
    for entry in rating.entries():
        if entry.name in PRINTED[entry.group]:
            pair = entry.value if isinstance(entry.value, tuple) else (entry.value,)
            values = "  ".join(f"{value:>12.6g}" for value in pair)
            lines.append(f"  {entry.name:<28}{values:<28}{entry.meaning}")
    return lines


def safety_bars(rating: Rating) -> list[tuple[str, float, float]]:
    """Name, safety factor and required safety of flanks and roots, for the picture."""
    made = []
    for symbol, values, least in (
        ("S_H", rating.S_H, rating.load.flank_safety),
        ("S_F", rating.S_F, rating.load.root_safety),
    ):
        made += [(f"{symbol} {name}", value, least) for name, value in zip(rating.names, values, strict=True)]
    made += [(symbol, value, rating.load.scuffing_safety) for symbol, value in scuffing_safeties(rating).items()]
    return [bar for bar in made if math.isfinite(bar[1])]
