"""Planetary stages of a REXS model as [carriers.NAME], with one entry for all planets.

REXS has a shaft, a gear, meshes, bearings and a pin for each planet, side plates, and several shafts for one carrier.
A job has one shaft for the carrier, and the planet's shaft, gear and meshes once, with the angles of the places.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ....base.tables.jobs import NAMED
from .ledger import plain
from .model import Component
from .parts import RIGID, RIGID_TILT, RIGID_TORSION
from .reading import Reading

#: Table of carriers; a program without it computes the meshes alone.
CARRIERS = "carriers"
#: Mesh stiffness per width of a pair of steel gears (N/(mm um)) without any in the file: c_gamma of ISO 6336-1.
USUAL_MESH = 20.0
#: Distance of planets from the circle that they should be on (mm), rounded places in a file.
ROUNDED_MM = 1e-3


def planetary(
    reading: Reading, tables: dict[str, Any], held: Mapping[str, str], left: dict[tuple[str, str], tuple[Any, str]]
) -> None:
    """Put carriers into the tables of a job, and take out what becomes part of them.

    Parameters
    ----------
    reading
        The conversion.
    tables
        Tables of the job.
    held
        Couplings to the casing -> the shaft that each holds.
    left
        Entries that a job cannot have, with the reason.
    """
    stages = reading.model.of_kind("planetary_stage")
    for stage in stages:
        if CARRIERS not in NAMED:
            reading.ignored(
                stage, "planetary_stage", "its carrier has no table in a job: its meshes alone are computed"
            )
            continue
        reason = _stage(reading, stage, tables, left)
        if reason:
            reading.ignored(stage, "planetary_stage", reason)
    if stages and CARRIERS in NAMED:
        carried = {bearing["shaft"] for bearing in tables["bearings"].values()}
        for coupling, shaft in held.items():
            if shaft in tables["shafts"]:
                _hold(reading, tables, shaft, coupling, shaft in carried)
                left.pop(("couplings", coupling), None)
        ring_springs(reading, tables)


def _stage(
    reading: Reading, stage: Component, tables: dict[str, Any], left: dict[tuple[str, str], tuple[Any, str]]
) -> str:
    """One stage; returns why it cannot be, or nothing."""
    shafts = tables["shafts"]
    carriers = [reading.name(item) for item in _shafts(reading, stage, "planet_carrier_shaft")]
    planets = [reading.name(item) for item in _shafts(reading, stage, "planet_shaft")]
    pins = [reading.name(item) for item in _shafts(reading, stage, "planet_pin")]
    carriers, planets = ([name for name in names if name in shafts] for names in (carriers, planets))
    if not carriers or not planets:
        return "has no shaft of its carrier, or no planets"
    carried = {entry["shaft"] for entry in tables["bearings"].values()}
    main = next((name for name in carriers if name in carried), carriers[0])
    angles = _angles(shafts, main, planets)
    if angles is None:
        return "its planets are not on a circle around the carrier"
    planets = [name for _, name in sorted(zip(angles, planets, strict=True))]
    angles = sorted(angles)
    groups = [_group(tables, name) for name in planets]
    if any(not _alike(tables, groups[0], group) for group in groups[1:]):
        return "its planets differ from each other: a job has one entry for all"
    holder = reading.parts(stage, "assembly", "assembly", "part", "planet_carrier")
    name = reading.name(holder[0] if holder else stage)
    count = len(planets)
    even = all(abs(angle - 360.0 * k / count) < 1e-6 for k, angle in enumerate(angles))
    placed = {"planets": count} if even else {"planet_angles_deg": angles}
    tables.setdefault(CARRIERS, {})[name] = {"shaft": main, **placed}
    where = f"carriers.{name}"
    reading.derived(
        stage,
        "planet_shaft",
        f"{where}.{next(iter(placed))}",
        "positions of the planets around the axis of the carrier",
    )
    _pins(reading, tables[CARRIERS][name], planets[0], where)
    shafts[planets[0]]["carrier"] = name
    for planet, group in zip(planets[1:], groups[1:], strict=True):
        for kind, names in group.items():
            for key in names.values():
                tables[kind].pop(key)
                part = reading.part(kind, key)
                reading.derived(part, part.kind, f"{kind}.{groups[0][kind][next(iter(names))]}", f"as {planets[0]}")
        reading.derived(reading.part("shafts", planet), "shaft", f"shafts.{planets[0]}", "a planet of the same set")
    _absorb(reading, tables, main, [*carriers, *pins], left)
    _reach(reading, shafts, main, shafts[planets[0]])
    return ""


def _reach(reading: Reading, shafts: dict[str, Any], main: str, planet: Mapping[str, Any]) -> None:
    """Lengthen the elastic shaft of a carrier to the far end of its planets if the file gives less."""
    body = shafts[main]
    if "sections" not in body:
        return
    low, high = _ends(body)
    ends = _ends(planet)
    if low <= planet["y_mm"] <= high:
        return
    up = planet["y_mm"] > high
    more = ends[1] - high if up else low - ends[0]
    nearest = body["sections"][-1 if up else 0]
    key = "end" if up else "start"
    outer = nearest.get("outer_diameter_mm", nearest.get(f"outer_diameter_{key}_mm"))
    section = {"length_mm": more, "outer_diameter_mm": outer}
    body["sections"] = [*body["sections"], section] if up else [section, *body["sections"]]
    body["y_mm"] += 0.5 * more if up else -0.5 * more
    rule = f"{more:g} mm more of the last diameter: the carrier reaches over its planets"
    reading.derived(reading.part("shafts", main), "planet_shaft", f"shafts.{main}.sections", rule)


def _ends(shaft: Mapping[str, Any]) -> tuple[float, float]:
    """Places of the ends of a shaft along the axis (mm)."""
    sections = shaft.get("sections", ())
    length = sum(section["length_mm"] for section in sections) if sections else shaft.get("length_mm", 0.0)
    return shaft["y_mm"] - 0.5 * length, shaft["y_mm"] + 0.5 * length


def place_coupled(reading: Reading, tables: dict[str, Any]) -> None:
    """Put shafts without a place on the axis of those that they are coupled to, after their end.

    The coordinates of the coupling on both shafts say how far, where the file gives them.
    """
    shafts = tables["shafts"]
    placed = {name for name in shafts if reading.numbers["shafts", name] in reading.frames}
    waiting = [name for name in tables["couplings"] if placed]
    while True:
        ready = [name for name in waiting if len(placed & {*tables["couplings"][name]["shafts"]}) == 1]
        if not ready:
            return
        name = ready[0]
        waiting.remove(name)
        pair = tables["couplings"][name]["shafts"]
        known, new = pair if pair[0] in placed else pair[::-1]
        coupling = reading.part("couplings", name)
        at = [reading.number(coupling, f"u_coordinate_on_shaft_{side}_side", "mm") for side in ("inner", "outer")]
        one, two = at if pair[0] == known else at[::-1]
        low, high = _ends(shafts[known])
        start = high if one is None or two is None else low + one - two
        length = _ends(shafts[new])[1] - _ends(shafts[new])[0]
        shafts[new] |= {"x_mm": shafts[known]["x_mm"], "z_mm": shafts[known]["z_mm"], "y_mm": start + 0.5 * length}
        placed.add(new)
        rule = f"on the axis of {known}, " + ("after its end" if one is None or two is None else "by its coordinates")
        reading.derived(coupling, "side", f"shafts.{new}.x_mm, y_mm, z_mm", rule)


def _shafts(reading: Reading, stage: Component, relation: str) -> list[Component]:
    return reading.parts(stage, relation, "planetary_stage", "shaft", "shaft")


def _angles(shafts: Mapping[str, Any], carrier: str, planets: list[str]) -> list[float] | None:
    """Return angles of planets from the first one (deg, about +y, 0 to 360); None if not on a circle."""
    x, z = shafts[carrier]["x_mm"], shafts[carrier]["z_mm"]
    places = [(shafts[name]["x_mm"] - x, z - shafts[name]["z_mm"]) for name in planets]
    radii = [math.hypot(*place) for place in places]
    if min(radii) <= 0.0 or max(radii) - min(radii) > ROUNDED_MM:
        return None
    first = math.atan2(places[0][1], places[0][0])
    turned = [math.degrees(math.atan2(up, along) - first) % 360.0 for along, up in places]
    return [0.0 if angle > 360.0 - 1e-6 else round(angle, 6) for angle in turned]


def _group(tables: Mapping[str, Any], planet: str) -> dict[str, dict[str, str]]:
    """Entries of one planet: table -> what it is among them -> its name."""
    gears = {name: entry for name, entry in tables["gears"].items() if entry.get("shaft") == planet}
    group: dict[str, dict[str, str]] = {"shafts": {"shaft": planet}, "gears": {}, "meshes": {}}
    for number, name in enumerate(gears):
        group["gears"][str(number)] = name
        for mesh, entry in tables["meshes"].items():
            if name in (entry["driver"], entry["driven"]):
                mate = entry["driven"] if entry["driver"] == name else entry["driver"]
                role = "driver" if entry["driver"] == name else "driven"
                group["meshes"][f"{number} {role} {mate}"] = mesh
    return group


def _alike(tables: Mapping[str, Any], one: dict[str, dict[str, str]], two: dict[str, dict[str, str]]) -> bool:
    """Return whether the entries of two planets differ by names and places only."""
    for kind, names in one.items():
        if names.keys() != two[kind].keys():
            return False
        for key, name in names.items():
            pair = [dict(tables[kind][other]) for other in (name, two[kind][key])]
            for entry in pair:
                for other in ("x_mm", "z_mm", "shaft", "driver", "driven"):
                    entry.pop(other, None)
            if pair[0] != pair[1]:
                return False
    return True


def _pins(reading: Reading, entry: dict[str, Any], planet: str, where: str) -> None:
    """Stiffness of the pins: that of the bearings of a planet; hinges where these are rigid."""
    shaft = reading.part("shafts", planet)
    total = 0.0
    for relation in reading.model.relations:
        if relation.kind == "side" and shaft.number in relation.roles.values():
            bearing = reading.model.components[relation.roles.get("assembly", shaft.number)]
            if bearing.kind == "concept_bearing":
                reading.relations.add(relation.number)
                total += reading.number(bearing, "radial_stiffness", "N / m") or 0.0
    if 0.0 < total < RIGID:
        entry["pin_stiffness_N_per_m"] = total
        reading.derived(shaft, "bearings", f"{where}.pin_stiffness_N_per_m", "sum of the bearings of a planet")
    else:
        reading.derived(shaft, "bearings", where, "rigid bearings of the planets: pins are rigid")


def _absorb(
    reading: Reading,
    tables: dict[str, Any],
    main: str,
    parts: list[str],
    left: dict[tuple[str, str], tuple[Any, str]],
) -> None:
    """Remove the other shafts of a carrier, its pins and coupled parts, because a job has one shaft for it."""
    shafts = tables["shafts"]
    with_gears = {entry.get("shaft") for entry in tables["gears"].values()}
    lost, merged = {name for name in parts if name in shafts and name != main}, set[str]()
    while True:
        more = {
            name
            for entry in tables["couplings"].values()
            if lost & {*entry["shafts"]} or main in entry["shafts"]
            for name in entry["shafts"]
            if name not in (main, *lost) and name not in with_gears
            and entry["stiffness_Nm_per_rad"] >= RIGID_TORSION
        }  # fmt: skip
        if not more:
            break
        lost |= more
    for name in _joined(shafts, main, lost):
        lost.discard(name)
        reading.derived(reading.part("shafts", name), "shaft", f"shafts.{main}.sections", "rigidly coupled: one shaft")
        left["shafts", name] = ({}, f"its sections are part of the shaft {main}, which it is coupled to rigidly")
        shafts.pop(name)
        merged.add(name)
    reason = f"is part of the carrier, which is the shaft {main} in a job: its mass is missing there"
    for name in lost:
        left["shafts", name] = (shafts.pop(name), reason)
        reading.ignored(reading.part("shafts", name), "shaft", plain(reason))
    for name, entry in list(tables["couplings"].items()):
        if (lost | merged) & {*entry["shafts"]}:
            left["couplings", name] = (tables["couplings"].pop(name), f"within the carrier {main}")


def _joined(shafts: dict[str, Any], main: str, others: set[str]) -> list[str]:
    """Append the sections of coaxial shafts that follow each other to those of a shaft; return their names in order."""
    names: list[str] = []
    while True:
        body = shafts[main]
        if "sections" not in body:
            return names
        length = sum(section["length_mm"] for section in body["sections"])
        ends = (body["y_mm"] - 0.5 * length, body["y_mm"] + 0.5 * length)
        for name in sorted(others.difference(names)):
            entry = shafts[name]
            apart = math.hypot(entry["x_mm"] - body["x_mm"], entry["z_mm"] - body["z_mm"])
            if "sections" not in entry or apart > ROUNDED_MM:
                continue
            more = sum(section["length_mm"] for section in entry["sections"])
            start = entry["y_mm"] - 0.5 * more
            sections = [
                {**section, "material": entry["material"]}
                if "material" in entry and "material" not in section
                else section
                for section in entry["sections"]
            ]
            if abs(start - ends[1]) < ROUNDED_MM:
                body["sections"], body["y_mm"] = [*body["sections"], *sections], body["y_mm"] + 0.5 * more
            elif abs(start + more - ends[0]) < ROUNDED_MM:
                body["sections"], body["y_mm"] = [*sections, *body["sections"]], body["y_mm"] - 0.5 * more
            else:
                continue
            names.append(name)
            break
        else:
            return names


def _hold(reading: Reading, tables: dict[str, Any], shaft: str, name: str, carried: bool) -> None:
    """Fix a shaft on the housing. If it has no bearing, the stiffness of its coupling supports it."""
    coupling, entry = reading.part("couplings", name), tables["shafts"][shaft]
    entry["speed_ratio"] = 0
    reading.derived(coupling, "side", f"shafts.{shaft}.speed_ratio", "held by the casing")
    torsion = reading.number(coupling, "rotational_stiffness", "N m / rad")
    if torsion is not None and torsion <= RIGID_TORSION:
        entry["holding_stiffness_Nm_per_rad"] = entry.get("holding_stiffness_Nm_per_rad", 0.0) + torsion
    if carried:
        return
    across, axial, tilt = (
        min(reading.number(coupling, key, unit) or rigid, rigid)
        for key, unit, rigid in (
            ("radial_stiffness", "N / m", RIGID),
            ("axial_stiffness", "N / m", RIGID),
            ("bending_stiffness", "N m / rad", RIGID_TILT),
        )
    )
    place = reading.place(coupling)
    y, where = entry["y_mm"] if place is None else place[1], f"bearings.{name}"
    for gear, table in tables["gears"].items():
        half = 0.5 * table.get("face_width_mm", 0.0)
        if table.get("shaft") == shaft and abs(y - table.get("y_mm", 0.0)) < half:
            y = table["y_mm"] + math.copysign(half, y - table["y_mm"])
            reading.derived(coupling, "support_vector", f"{where}.y_mm", f"the nearer end of the face of {gear}")
    springs = {"stiffness_N_per_m": [across, axial, across], "tilt_stiffness_Nm_per_rad": [tilt, tilt]}
    tables["bearings"][name] = {"shaft": shaft, "y_mm": y, **springs}
    reading.derived(coupling, "radial_stiffness", f"{where}.stiffness_N_per_m", f"at most {RIGID:g} N/m, rigid")


def ring_springs(reading: Reading, tables: dict[str, Any]) -> None:
    """Give meshes with rings in a train the stiffness of the file, where the program does not compute it."""
    for name, entry in tables["meshes"].items():
        gears = [tables["gears"].get(entry[role], {}) for role in ("driver", "driven")]
        if all(gear.get("teeth", 1) > 0 for gear in gears):
            continue
        stage = reading.part("meshes", name)
        width = min((gear["face_width_mm"] for gear in gears if "face_width_mm" in gear), default=0.0)
        attribute = stage.attributes.get("mesh_stiffness_for_load_distribution_along_face_width")
        given = None if attribute is None or attribute.value is None else float(attribute.value)
        key = f"meshes.{name}.stiffness_N_per_m"
        if given is not None:
            reading.used.add((stage.number, "mesh_stiffness_for_load_distribution_along_face_width"))
            reading.derived(stage, "mesh_stiffness_for_load_distribution_along_face_width", key, "times the face width")
        else:
            reading.defaulted(stage, key, f"{USUAL_MESH:g} N/(mm um) times the face width")
        entry["stiffness_N_per_m"] = 1e6 * (given or USUAL_MESH) * width
        for oil in [oil for oil in ("oil_viscosity_mPa_s", "roughness_um") if oil in entry]:
            del entry[oil]
            reading.ignored(stage, oil, "friction is of meshes with a potential, and this one is a spring")
