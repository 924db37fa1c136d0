"""Modifications of flanks: components of REXS that a flank refers to, as [gears.NAME.microgeometry]."""

from __future__ import annotations

from typing import Any

from .ledger import READ
from .model import Component
from .reading import MODIFICATIONS, Reading

#: Shape in REXS -> in a job.
SHAPES = {"linear": "linear", "parabolic": "parabolic", "circular": "arc"}


def microgeometry(reading: Reading, gear: Component, flanks: dict[str, Component], key: str) -> dict[str, Any]:
    """Return the table of a gear, with left and right apart where they differ; empty without modifications.

    Parameters
    ----------
    reading
        The conversion.
    gear
        The gear.
    flanks
        Its flanks by ``left`` and ``right``.
    key
        Name of its entry of the job, for the list.
    """
    orientation = reading.text(gear, "datum_face_orientation")
    datum_high = orientation != "negative"
    sides = {}
    for side, flank in flanks.items():
        table: dict[str, Any] = {}
        for item in reading.parts(flank, "reference", "origin", "referenced"):
            if item.kind in MODIFICATIONS:
                _take(reading, item, table, f"{key}.microgeometry", datum_high)
        sides[side] = table
    used = [table for table in sides.values() if table]
    if not used:
        return {}
    if not orientation:
        reading.defaulted(gear, f"{key}.microgeometry", "datum face on the side of larger u: the file does not say")
    if len(sides) == 2 and sides.get("left") == sides.get("right"):
        return sides["left"]
    if datum_high:
        rule = "left and right as seen on the datum face, which is that of larger y"
    else:
        sides = {"left": sides.get("right", {}), "right": sides.get("left", {})}
        rule = "left and right seen from larger y: the datum face is that of smaller y, so they are exchanged"
    reading.derived(gear, "flank", f"{key}.microgeometry.left, right", rule)
    return {side: table for side, table in sides.items() if table}


def _take(reading: Reading, item: Component, table: dict[str, Any], key: str, datum_high: bool) -> None:
    """Put one modification into the table of a flank."""
    if item.kind in ("tip_relief", "root_relief"):
        _profile_relief(reading, item, item.kind.removesuffix("_relief"), table, key)
    elif item.kind.startswith("end_relief"):
        datum = item.kind == "end_relief_datum_face"
        _end_relief(reading, item, datum, "high" if datum == datum_high else "low", table, key)
    elif item.kind == "profile_crowning":
        amounts = [reading.number(item, f"profile_crowning_at_{end}", "um") for end in ("tip", "root")]
        _symmetric(reading, item, amounts, "profile_crowning_um", table, key)
    elif item.kind == "helix_crowning":
        ends = ("datum_face", "non_datum_face")
        amounts = [reading.number(item, f"helix_crowning_amount_{end}", "um") for end in ends]
        _symmetric(reading, item, amounts, "helix_crowning_um", table, key)
    elif item.kind == "profile_slope":
        amount = reading.number(item, "profile_slope", "um", f"{key}.profile_slope_um")
        if amount is not None:
            table["profile_slope_um"] = amount
    elif item.kind == "helix_slope":
        amount = reading.number(item, "helix_slope", "um")
        if amount is not None:
            table["helix_slope_um"] = amount if datum_high else -amount + 0.0
            rule = "positive: more material at the datum face"
            reading.derived(item, "helix_slope", f"{key}.helix_slope_um", rule)
    elif item.kind == "profile_twist":
        amount = reading.number(item, "profile_twist", "um", f"{key}.bias_um", "slope at the tip less that at the root")
        if amount is not None:
            table["bias_um"] = amount
    elif item.kind.startswith("triangular"):
        reading.ignored(item, item.kind, "the file does not say at which end of the face: add triangular_reliefs")
    else:
        reading.ignored(item, item.kind, "no key for measured or topographical deviations of this form: measured_csv")


def _amount(reading: Reading, item: Component, name: str, key: str) -> float | None:
    """Amount of material taken off (um); an additive one, or a negative one, adds material."""
    amount = reading.number(item, name, "um")
    if amount is None:
        return None
    if amount < 0.0:
        reading.ignored(item, name, "adds material: a relief of a job takes off")
        return None
    reading.note(READ, item, name, key)
    return amount


def _shape(reading: Reading, item: Component, key: str) -> str:
    shape = reading.text(item, "shape_of_relief")
    if shape and shape not in SHAPES:
        reading.ignored(item, "shape_of_relief", f"{shape}: linear instead")
    elif shape:
        reading.note(READ, item, "shape_of_relief", key)
    return SHAPES.get(shape, "linear")


def _profile_relief(reading: Reading, item: Component, end: str, table: dict[str, Any], key: str) -> None:
    amount = _amount(reading, item, f"{end}_relief_depth", f"{key}.{end}_relief_um")
    if amount is None:
        return
    values: dict[str, Any] = {f"{end}_relief_um": amount}
    diameter = reading.number(item, f"{end}_relief_datum_diameter", "mm")
    length = reading.number(item, f"{end}_relief_datum_length", "mm")
    if diameter is not None:
        values[f"{end}_relief_start_diameter_mm"] = diameter
        reading.note(READ, item, f"{end}_relief_datum_diameter", f"{key}.{end}_relief_start_diameter_mm")
        if length is not None:
            reading.ignored(item, f"{end}_relief_datum_length", "the diameter says it")
    elif length is not None:
        values[f"{end}_relief_length_mm"] = length
        reading.note(READ, item, f"{end}_relief_datum_length", f"{key}.{end}_relief_length_mm")
    else:
        reading.ignored(item, f"{end}_relief_depth", "neither diameter nor length says where it begins")
        return
    reference = reading.number(item, f"{end}_relief_evaluation_reference", "mm")
    if reference is not None:
        values[f"{end}_relief_end_diameter_mm"] = reference
        name = f"{end}_relief_evaluation_reference"
        reading.note(READ, item, name, f"{key}.{end}_relief_end_diameter_mm")
    values[f"{end}_relief_shape"] = _shape(reading, item, f"{key}.{end}_relief_shape")
    table |= values


def _end_relief(reading: Reading, item: Component, datum: bool, end: str, table: dict[str, Any], key: str) -> None:
    face = "datum_face" if datum else "non_datum_face"
    amount = _amount(reading, item, f"end_relief_depth_{face}", f"{key}.end_relief_{end}_um")
    length = reading.number(item, f"end_relief_length_{face}", "mm", f"{key}.end_relief_{end}_length_mm")
    if amount is None:
        return
    if length is None:
        reading.ignored(item, f"end_relief_depth_{face}", "no length says where it begins")
        return
    table[f"end_relief_{end}_um"], table[f"end_relief_{end}_length_mm"] = amount, length
    shape = _shape(reading, item, f"{key}.end_relief_shape")
    if shape == "arc":
        reading.ignored(item, "shape_of_relief", "circular: parabolic instead, the same to the second order")
    table["end_relief_shape"] = "parabolic" if shape in ("arc", "parabolic") else "linear"


def _symmetric(
    reading: Reading, item: Component, amounts: list[float | None], name: str, table: dict[str, Any], key: str
) -> None:
    """Crowning with equal amounts at both ends; of unequal ones their mean."""
    given = [amount for amount in amounts if amount is not None]
    if not given:
        return
    table[name] = given[0] if given[0] == given[-1] else 0.5 * (given[0] + given[-1])
    if given[0] == given[-1]:
        reading.note(READ, item, "amount at both ends", f"{key}.{name}")
    else:
        rule = f"{given[0]:g} and {given[-1]:g} um at the ends: the mean"
        reading.derived(item, "amount at both ends", f"{key}.{name}", rule)
