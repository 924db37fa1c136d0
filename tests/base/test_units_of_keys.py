"""Keys of job files that hold quantities end with their unit."""

from __future__ import annotations

import dataclasses
import re
import typing
from collections.abc import Iterator
from typing import Any

from gearfe.base.config import fields_of, type_hints
from gearfe.base.quantities import UNITS
from gearfe.base.tables.jobs import TABLES, table_class
from gearfe.base.tables.mechanism import MechanismFile

#: Ends of keys besides the units of columns: units of what is only read, and of lists whose entries have several.
OTHERS = (
    "hz", "N_s_per_m", "Nm_s_per_rad", "per_s", "N_per_mm3", "kg_m2", "kg_per_m", "kg_per_m3", "mPa_s", "m2", "m4", "C",
    "mm2_per_s", "Hz", "h", "hours", "N_per_mm_m05_s05_K", "N_m_rad", "N_m_s_rad", "mm_um", "rad_per_s_Nm", "Nm_deg",
)  # fmt: skip
#: Numbers without a unit: ratios, factors, counts, classes, coordinates of a design, scales of hardness.
NUMBERS = re.compile(
    r"(profile_shift|addendum|dedendum|rack_tip_radius|tip_shortening|tip_relief_exponent|cutter_shift|friction"
    r"|oil_factor|poisson_ratio|nitsche_gamma0|(flank_)?coarsen|hardness|structure_factor|quality"
    r"|\w*_factor|\w*_safety|friction_coefficient|\w+_osculation|(damping_|speed_)?ratio|tolerance|low|high|direction"
    r"|normal|instability_loads|orders|order_turns|magnification|wrap|every)\Z"
)  # fmt: skip
#: Terms of a function of time have the unit of the key that holds them; parameters and start values that of their use.
INHERITED = {"constant", "polynomial", "step", "sine", "height", "amplitude", "parameters", "positions", "velocities"}
#: Names, expressions and files, whose description says units: a point is a name or coordinates in its body's frame (m).
TEXTS = {"point", "to_point", "expression", "law_parameters", "unit", "reference"}
#: A unit in the description of a key.
UNIT = re.compile(r"\((?:um|mm|ms|us|s|h|deg|rad|N|N m|N/m|N m/rad|N s/m|rad/s|1/min|MPa|GPa|kg|kg m2|Hz|m)[),;]")


def tables() -> Iterator[type]:
    """All tables of job files."""
    waiting: list[Any] = [MechanismFile, *(table_class(name) for name in TABLES)]
    seen: set[Any] = set()
    while waiting:
        hint = waiting.pop()
        waiting += typing.get_args(hint)
        if dataclasses.is_dataclass(hint) and isinstance(hint, type) and hint not in seen:
            seen.add(hint)
            waiting += type_hints(hint).values()
            yield hint


def holds_numbers(hint: Any) -> bool:
    return hint is float or any(map(holds_numbers, typing.get_args(hint)))


def has_unit(key: str) -> bool:
    return any(key.endswith(f"_{unit}") or key == unit for unit in (*UNITS, *OTHERS))


def test_every_quantity_has_its_unit_in_the_key() -> None:
    found = {
        f"{table.__name__}.{key}"
        for table in tables()
        for key, spec in fields_of(table).items()
        if not has_unit(key)
        and key not in INHERITED | TEXTS
        and not NUMBERS.match(key)
        and (holds_numbers(type_hints(table)[key]) or UNIT.search(spec.metadata.get("doc", "")))
    }
    assert found == set()
