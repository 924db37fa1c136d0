"""Find values of a job that seem to be in another unit than that of their key."""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Iterator
from typing import Any, NamedTuple

from .errors import shown


class Range(NamedTuple):
    """Values that materials have, what lies at both ends, and factors by which other units are mistaken for this one.

    Attributes
    ----------
    low, high
        Bounds in the unit of the key.
    usual
        Bounds of common engineering materials, among which a value in another unit must come to lie.
    below, above
        What is said of a value beyond the bounds.
    units
        Name of another unit -> factor from it to the unit of the key.
    """

    low: float
    high: float
    usual: tuple[float, float]
    below: str
    above: str
    units: dict[str, float]


#: Soft rubber has 0.5 MPa, diamond 1200 GPa; foam 10 kg/m3, osmium 22,590 (Ashby, Materials Selection in Mechanical
#: Design, property charts).
MATERIALS = {
    "youngs_modulus_GPa": Range(
        5e-4, 1300.0, (0.5, 1300.0), "softer than rubber", "stiffer than diamond", {"MPa": 1e-3, "Pa": 1e-9}
    ),
    "density_kg_per_m3": Range(
        10.0, 25e3, (500.0, 25e3), "lighter than any solid", "denser than any solid",
        {"g/cm3": 1e3, "g/mm3": 1e6, "kg/mm3": 1e9, "t/mm3": 1e12},
    ),
}  # fmt: skip

#: No number in everyday units is larger (-): the fourth powers of such numbers overflow.
LARGEST = 1e75
#: A length so many times the median of all lengths is suspected: a millimetre is 1000 times too long as a metre.
FAR = 200.0
#: Terms of a function of time that have its unit.
_TERMS = ("constant", "step", "sine")
#: Keys of a function of time that do not have its unit.
_TIMES = ("origin_s", "step_centre_s", "step_width_s", "frequency_hz", "phase_deg")
#: Keys in metres that are no sizes of the mechanism.
_OTHER = ("mesh_unit_m",)


def _numbers(value: Any, name: str, key: str) -> Iterator[tuple[str, str, float]]:
    """Each number of a table: its full name, the key with the unit, the number."""
    if isinstance(value, dict):
        for inner, item in value.items():
            # names of points stand below the key that has the unit
            held = key.endswith("_m") and inner not in _TIMES
            yield from _numbers(item, f"{name}.{inner}" if name else inner, key if held else inner)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from _numbers(item, f"{name}[{i}]", key)
    elif isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < LARGEST:
        yield name, key, float(value)


def _turns(raw: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """Each number that is an angle by another key than its own: its full name and the number."""
    for kind in ("joints", "forces"):
        for name, part in _tables(raw.get(kind)):
            if part.get("coordinate") != "angle":
                continue
            for key in ("motion_rad", "reference_rad"):
                value = part.get(key)
                values = (
                    {"": value} if not isinstance(value, dict) else {f".{term}": value.get(term) for term in _TERMS}
                )
                for term, number in values.items():
                    yield from ((f"{kind}.{name}.{key}{term}", n) for _, _, n in _numbers(number, "", ""))
    start = raw.get("start")
    for kind, values in _tables(start):
        for expression, value in values.items():
            if kind == "positions" and expression.strip().startswith("angle"):
                yield from ((f"start.positions.{expression}", n) for _, _, n in _numbers(value, "", ""))


def _tables(raw: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and tables of a table of tables; what is none is left to the reader of the job."""
    for name, table in raw.items() if isinstance(raw, dict) else ():
        if isinstance(table, dict):
            yield name, table


def other_unit(key: str, number: float) -> str:
    """Return how to write a material's value that may be in another unit; an empty text for others."""
    known = MATERIALS.get(key)
    if known is None or not 0.0 < number < LARGEST or known.low <= number <= known.high:
        return ""
    for unit, factor in known.units.items():
        if known.usual[0] <= factor * number <= known.usual[1]:
            return f"if it is in {unit}, write {float(f'{factor * number:.12g}'):g}"
    return "check its unit"


def beyond(key: str, number: float) -> str:
    """Return the remark on a material value beyond its bounds."""
    known = MATERIALS[key]
    return known.below if number < known.low else known.above


def suspects(raw: dict[str, Any]) -> list[str]:
    """Return sentences about values that may be in another unit than that of their key.

    These are moduli and densities that no solid has, angles in rad that may be degrees, and lengths in m that may be
    millimetres.

    Parameters
    ----------
    raw
        Parsed tables of a job file.
    """
    sentences = []
    lengths = []
    for name, key, number in _numbers(raw, "", ""):
        if cure := other_unit(key, number):
            sentences.append(f"{shown(name)[1:-1]} = {number:g} is {beyond(key, number)}; {cure}")
        if key == "angle_rad" and abs(number) > 2.0 * math.pi:
            turns = abs(number) / (2.0 * math.pi)
            degrees = name.removesuffix("_rad") + "_deg"
            sentences.append(
                f"{shown(name)[1:-1]} = {number:g} is {turns:.3g} turns; "
                f"if it is in degrees, write {degrees} = {number:g}"
            )
        if re.search(r"(?<!N|r)_m$", key) and key not in _OTHER and number != 0.0:  # no N_m, no N_per_m
            lengths.append((name, abs(number)))
    sentences += [
        f"{shown(name)[1:-1]} = {number:g} is {number / (2.0 * math.pi):.3g} turns; "
        f"if it is in degrees, write {math.radians(number):.9g} rad"
        for name, number in _turns(raw)
        if abs(number) > 2.0 * math.pi and number == round(number)  # turns in rad are as a rule no whole numbers
    ]
    if len(lengths) > 2:
        middle = statistics.median(length for _, length in lengths)
        far = [(name, length) for name, length in lengths if length > FAR * middle]
        if far:
            name, length = max(far, key=lambda item: item[1])
            sentences.append(
                f"{shown(name)[1:-1]} = {length:g} m is {length / middle:.0f} times the median of all lengths, "
                f"{middle:.3g} m; if it is in millimetres, write {1e-3 * length:g}"
            )
    return sentences
