"""Random gear pairs as users could ask for, as tables of a job file; some with one value that cannot be.

Gears have 10 to 150 teeth, rigid flanks overlap by a tenth of a module at most, torques are 1e-4 to 1 of what the
material bears, and numerical options are left alone in nine of ten cases (`chosen`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.pair import PairTable
from gearfe.gears.geometry.pair import GearPair

Table = dict[str, Any]

#: Numbers of teeth, and the largest overlap (modules): within what `gearfe.gears.geometry.validity` allows.
TEETH, LARGEST_OVERLAP = (10, 150), 0.1
#: Torques as shares of what the material bears.
TORQUES = (1e-4, 1.0)
#: Strain E/sigma_FE that a tooth root bears, and the factors Y_F Y_S of ISO 6336-3 on the nominal stress F/(b m). A
#: case-hardened steel has sigma_FE = 1000 N/mm2 (ISO 6336-5, grade MQ), 0.5 % of its modulus.
BORNE, ROOT_FACTORS = 5e-3, 4.3
#: Young's modulus of gears without a [material] (GPa), as `gearfe.base.tables.pair` has it.
STEEL_GPA = 200.0
#: One in so many cases has another value than the default of a numerical option.
SELDOM = 0.1

#: Values that make little sense anywhere.
ODD = (0, -1, 1e-12, 1e12, float("nan"), float("inf"), True, "twenty", [1.0, 2.0], -0.5, 3.7, 5000)


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is evenly spread."""
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


def rounded(value: float, digits: int = 4) -> float:
    """A number as a person would write it."""
    return float(f"{value:.{digits}g}")


def chosen(random: np.random.Generator, default: Any, make: Callable[[], Any]) -> Any:
    """A numerical option: its default in nine of ten cases, else what `make` draws."""
    value = make()  # drawn in any case: what follows does not depend on the choice
    return value if random.random() < SELDOM else default


def random_pair(random: np.random.Generator, *, most_teeth: int = TEETH[1]) -> Table:
    """A [pair] table: 14.5 to 30 deg, shifts, reliefs, tip rounds, bores. Some cannot run together."""
    alpha = 20.0 if random.random() < 0.3 else rounded(random.uniform(14.5, 30.0))
    module = rounded(log_uniform(random, 0.3, 12.0), 3)
    addendum = 1.0 if random.random() < 0.6 else rounded(random.uniform(0.7, 1.15), 3)
    dedendum = rounded(addendum + random.uniform(0.2, 0.35), 3)
    rack_tip = rounded(random.uniform(0.05, 0.35), 3)
    table: Table = {
        "module_mm": module,
        "pressure_angle_deg": alpha,
        "face_width_mm": rounded(log_uniform(random, 2.0, 60.0), 3),
        "addendum": addendum,
        "dedendum": dedendum,
        "rack_tip_radius": rack_tip,
    }
    shifts = []
    for side in ("pinion", "wheel"):
        teeth = round(log_uniform(random, TEETH[0], most_teeth))
        least = dedendum - rack_tip * (1 - math.sin(math.radians(alpha)))
        least -= 0.5 * teeth * math.sin(math.radians(alpha)) ** 2  # no undercut from here on
        low = max(-0.5, least) if random.random() < 0.85 else -0.5
        shift = rounded(low + abs(random.normal(0.0, 0.35)), 3) if random.random() < 0.7 else rounded(max(low, 0.0), 3)
        shifts.append(shift)
        bore = random.uniform(0.1, 0.85) * max(teeth + 2 * (shift - dedendum) - 2.0, 0.5) * module
        own: Table = {"teeth": teeth, "bore_diameter_mm": rounded(max(bore, 1e-3)), "profile_shift": shift}
        if random.random() < 0.5:
            own["tip_round_mm"] = rounded(random.uniform(0.01, 0.08) * module, 3)
        if random.random() < 0.35:
            own["tip_relief_amount_um"] = rounded(log_uniform(random, 1.0, 60.0), 3)
            own["tip_relief_length_mm"] = rounded(random.uniform(0.2, 1.2) * module, 3)
            own["tip_relief_exponent"] = float(random.choice([1.0, 1.5, 2.0]))
        if random.random() < 0.25:
            own["tooth_thinning_um"] = rounded(random.uniform(5.0, 60.0) * module, 3)
        table[side] = own
    if random.random() < 0.5:  # tips held off the mate's root, as a designer would
        table["tip_shortening"] = rounded(max(0.0, 0.6 * sum(shifts)) * random.uniform(0.2, 0.8), 3)
    if random.random() < 0.2:
        teeth_sum = table["pinion"]["teeth"] + table["wheel"]["teeth"]
        table["centre_distance_mm"] = rounded(module * (0.5 * teeth_sum + random.uniform(0.9, 1.15) * sum(shifts)), 6)
    if random.random() < 0.3:
        table["material"] = {
            "youngs_modulus_GPa": rounded(log_uniform(random, 1.0, 400.0), 3),
            "poisson_ratio": rounded(random.uniform(0.0, 0.45), 3),
        }
    return table


def running_pair(random: np.random.Generator, **options: Any) -> Table:
    """The first of many random pairs that can run together."""
    for _ in range(200):
        table = random_pair(random, **options)
        try:
            GearPair.from_table(build(PairTable, table, "pair"))
        except InputError:
            continue
        break
    return table


def twist_of_overlap(table: Table, overlap: float) -> float:
    """Twist (deg) at which the rigid flanks of a pair overlap by so many modules."""
    radius = 0.5 * table["wheel"]["teeth"] * math.cos(math.radians(table["pressure_angle_deg"]))  # of the base circle
    return rounded(math.degrees(overlap / radius))


def borne_torque(table: Table) -> float:
    """Torque (N m) at the wheel that its material bears: sigma_FE b m/(Y_F Y_S) on the pitch circle (ISO 6336-3)."""
    strength = BORNE * 1e3 * table.get("material", {}).get("youngs_modulus_GPa", STEEL_GPA)  # N/mm2
    force = strength * table["face_width_mm"] * table["module_mm"] / ROOT_FACTORS
    return float(force * 0.5e-3 * table["wheel"]["teeth"] * table["module_mm"])


def invalid(random: np.random.Generator, table: Table) -> Table:
    """The same tables with one value that makes little sense."""
    made = {k: dict(v) if isinstance(v, dict) else v for k, v in table.items()}
    places = [(made, k) for k, v in made.items() if not isinstance(v, dict)]
    places += [(v, k) for v in made.values() if isinstance(v, dict) for k in v]
    where, key = places[random.integers(len(places))]
    where[key] = ODD[random.integers(len(ODD))]
    return made
