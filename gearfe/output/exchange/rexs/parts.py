"""Gears, shafts, bearings, couplings and materials of a REXS model as entries of a job's tables."""

from __future__ import annotations

import itertools
import math
from typing import Any

from ....base.errors import InputError
from ....base.tables.bearing import ANGULAR, CYLINDRICAL, DEEP_GROOVE, TAPERED
from .frames import PARALLEL, cross, dot
from .ledger import DERIVED, READ
from .model import Component
from .modifications import microgeometry
from .reading import Reading

GEARS = ("cylindrical_gear", "ring_gear")
BEARINGS = ("rolling_bearing_with_catalog_geometry", "rolling_bearing_with_detailed_geometry", "concept_bearing")
COUPLINGS = ("coupling", "switchable_coupling")
#: Stiffness (N/m, N m/rad, N m/rad in torsion) of a rigid part: 1e20 of a file would leave no digits for others.
RIGID, RIGID_TILT, RIGID_TORSION = 1e10, 1e7, 1e7
#: Stiffness of a bearing without any in the file (N/m): a deep-groove ball bearing of 50 mm under load.
USUAL = 2e8
#: Young's modulus of a rigid material in a job (GPa): that of diamond, above which the program warns.
STIFFEST_GPA = 1200.0
#: Material below the root circle of a gear that is cut into its shaft, and that of a gear on a shaft (normal modules).
RIM = 1.5
#: Thinning below which teeth have the nominal thickness (um).
LEAST_THINNING = 1e-3
#: Rim of a ring without any size in the file (modules).
USUAL_RIM = 3.0
#: Type of bearing in REXS -> in a job.
TYPES = {
    "radial_grooved_ball_bearing": DEEP_GROOVE,
    "angular_contact_ball_bearing": ANGULAR,
    "radial_roller_bearing": CYLINDRICAL,
    "radial_needle_roller_bearing": CYLINDRICAL,
    "radial_tapered_roller_bearing": TAPERED,
}
#: Factor f0 of the static load rating of radial ball bearings over D_w cos(alpha)/D_pw (ISO 76:2006, table 1).
_F0 = ((0.0, 14.7), (0.09, 16.5), (0.10, 16.4), (0.20, 14.0), (0.30, 11.6), (0.40, 9.4))


def materials(reading: Reading) -> dict[str, dict[str, Any]]:
    """Return [materials.NAME] of all materials that have an elastic modulus."""
    tables: dict[str, dict[str, Any]] = {}
    for item in reading.model.of_kind("material"):
        modulus = reading.number(item, "elastic_modulus", "GPa")
        poisson = reading.number(item, "poisson_ratio", "none")
        shear = reading.number(item, "shear_modulus", "GPa") if modulus is None else None
        rule = ""
        if modulus is None and shear is not None and poisson is not None:
            modulus, rule = 2.0 * shear * (1.0 + poisson), "E = 2 G (1 + nu)"
        if modulus is None:
            continue
        key = f"materials.{reading.name(item)}"
        if modulus > STIFFEST_GPA:
            modulus, rule = STIFFEST_GPA, f"E of {modulus:.4g} GPa: rigid, as diamond in a job"
        attribute = "shear_modulus" if shear is not None else "elastic_modulus"
        reading.note(DERIVED if rule else READ, item, attribute, f"{key}.youngs_modulus_GPa", rule)
        entry: dict[str, Any] = {"youngs_modulus_GPa": modulus}
        if poisson is not None:
            reading.note(READ, item, "poisson_ratio", f"{key}.poisson_ratio")
            entry["poisson_ratio"] = poisson
        density = reading.number(item, "density", "kg / m^3", f"{key}.density_kg_per_m3")
        if density is not None:
            entry["density_kg_per_m3"] = density
        else:
            reading.defaulted(item, f"{key}.density_kg_per_m3", "7850, of steel")
        tables[reading.name(item)] = entry
    return tables


def material_of(reading: Reading, component: Component, tables: dict[str, Any], where: str) -> str | None:
    """Return the name of the material that a component refers to.

    Parameters
    ----------
    reading
        The conversion.
    component
        Gear or shaft.
    tables
        [materials.NAME].
    where
        Name of its entry of the job, for the list.
    """
    for item in reading.parts(component, "reference", "origin", "referenced", "material"):
        if reading.name(item) in tables:
            reading.note(READ, component, "reference to material", f"{where}.material")
            return reading.name(item)
        reading.ignored(component, "reference to material", f"{item.label} has no elastic modulus: steel")
    return None


# --- shafts ---------------------------------------------------------------------------------------------------------


def sense(reading: Reading, component: Component) -> float:
    """Return 1 or -1: whether u of a component runs along y of the job or against it."""
    frame = reading.frames.get(component.number)
    return 1.0 if frame is None or dot(frame.u, reading.axes.y) >= 0.0 else -1.0


def shafts(reading: Reading, material: dict[str, Any]) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """Return [shafts.NAME], and the shafts that a job cannot have, by name, with the reason."""
    tables: dict[str, dict[str, Any]] = {}
    left: dict[str, str] = {}
    for item in reading.model.of_kind("shaft"):
        name = reading.name(item)
        key = f"shafts.{name}"
        frame, place = reading.frames.get(item.number), reading.place(item)
        if frame is not None:
            across = cross(frame.u, reading.axes.y)
            if math.sqrt(dot(across, across)) > PARALLEL:
                left[name] = "its axis is not parallel to that of the first shaft: a job has parallel shafts only"
                continue
        x, y, z = place or (0.0, 0.0, 0.0)
        if place is None:
            reading.defaulted(item, f"{key}.x_mm", "0: the file gives no position")
        else:
            reading.derived(item, "support_vector", f"{key}.x_mm, y_mm, z_mm", "y along u, z along v, x along w")
        entry: dict[str, Any] = {"x_mm": x + 0.0, "z_mm": z + 0.0}
        sections, start = _sections(reading, item, key)
        direction = sense(reading, item)
        if sections:
            length = sum(section["length_mm"] for section in sections)
            entry["y_mm"] = y + direction * (start + 0.5 * length)
            entry["sections"] = sections if direction > 0.0 else [_turned(section) for section in reversed(sections)]
        else:
            _bare(reading, item, entry, y, direction, key)
        if chosen := material_of(reading, item, material, key):
            entry["material"] = chosen
        tables[name] = entry
    return tables, left


def _sections(reading: Reading, shaft: Component, key: str) -> tuple[list[dict[str, Any]], float]:
    """Return the sections along u, and where the first one begins (mm); none if they do not follow each other."""
    items = reading.parts(shaft, "assembly", "assembly", "part", "shaft_section")
    given = []
    for item in items:
        start = reading.number(item, "u_coordinate_on_shaft", "mm")
        length = reading.number(item, "length", "mm")
        if length is None or length <= 0.0:
            reading.ignored(item, "length", "a section without a length")
            continue
        given.append((start, length, item))
    if not given:
        return [], 0.0
    if any(start is None for start, _, _ in given):
        reading.derived(
            shaft, "u_coordinate_on_shaft", f"{key}.sections", "missing: one after the other in their order"
        )
        begin = 0.0
        ordered = []
        for _, length, item in given:
            ordered.append((begin, length, item))
            begin += length
    else:
        ordered = sorted([(start or 0.0, length, item) for start, length, item in given], key=lambda row: row[0])
    end = ordered[0][0]
    for start, length, item in ordered:
        if abs(start - end) > 1e-6 * max(1.0, abs(end)):
            rule = f"begins at {start:.9g} mm, the section before it ends at {end:.9g} mm: the shaft is rigid"
            reading.ignored(item, "u_coordinate_on_shaft", rule)
            return [], 0.0
        end = start + length
    sections = [_section(reading, item, length, key) for _, length, item in ordered]
    return sections, ordered[0][0]


def _section(reading: Reading, item: Component, length: float, key: str) -> dict[str, Any]:
    section: dict[str, Any] = {"length_mm": length}
    reading.note(READ, item, "length", f"{key}.sections.length_mm")
    for name in ("outer", "inner"):
        ends = [reading.number(item, f"{name}_diameter_{end}", "mm") for end in ("begin", "end")]
        one, two = (ends[0] if ends[1] is None else ends[1]) if ends[0] is None else ends[0], ends[1]
        two = one if two is None else two
        if one is None or two is None or (name == "inner" and not one and not two):
            continue
        reading.note(READ, item, f"{name}_diameter_begin, _end", f"{key}.sections.{name}_diameter_mm")
        if one == two:
            section[f"{name}_diameter_mm"] = one
        else:
            section[f"{name}_diameter_start_mm"], section[f"{name}_diameter_end_mm"] = one, two
    return section


def _turned(section: dict[str, Any]) -> dict[str, Any]:
    """The section seen from its other end."""
    swap = {"start": "end", "end": "start"}
    return {
        next((key.replace(f"_{a}_", f"_{b}_") for a, b in swap.items() if f"_{a}_" in key), key): value
        for key, value in section.items()
    }


def _bare(reading: Reading, shaft: Component, entry: dict[str, Any], y: float, direction: float, key: str) -> None:
    """Length and radius of a shaft without sections: it reaches over all that is on it."""
    reach = [0.0]
    for item in (*reading.parts(shaft, "assembly", "assembly", "part", *GEARS, "external_load"),):
        at = reading.number(item, "u_coordinate_on_shaft", "mm")
        width = reading.number(item, "face_width", "mm") or 0.0
        if at is not None:
            reach += [at - width, at + width]
    for item in _carried(reading, shaft):
        at = reading.number(item, "u_coordinate_on_shaft_inner_side", "mm")
        reach += [] if at is None else [at]
    length = max(reach) - min(reach)
    inner = [reading.number(item, "inner_diameter", "mm") for item in _carried(reading, shaft)]
    diameters = [value for value in inner if value]
    entry["y_mm"] = y + direction * 0.5 * (max(reach) + min(reach))
    entry["length_mm"] = length or 50.0
    entry["radius_mm"] = 0.5 * min(diameters) if diameters else 10.0
    rule = "no sections: rigid, as long as what is on it, the bore of its smallest bearing or 20 mm thick"
    reading.defaulted(shaft, f"{key}.length_mm, radius_mm", rule)


def _carried(reading: Reading, shaft: Component) -> list[Component]:
    return reading.model.partners("side", "inner_part", shaft.number, "assembly")


def diameter_at(entry: dict[str, Any], y: float, name: str = "outer") -> float | None:
    """Return the diameter of a shaft (mm) at a position along y; None beyond its ends or if it is rigid."""
    sections = entry.get("sections", [])
    start = entry["y_mm"] - 0.5 * sum(section["length_mm"] for section in sections)
    for section in sections:
        share = (y - start) / section["length_mm"]
        if 0.0 <= share <= 1.0:
            one = section.get(f"{name}_diameter_mm", section.get(f"{name}_diameter_start_mm", 0.0))
            two = section.get(f"{name}_diameter_mm", section.get(f"{name}_diameter_end_mm", 0.0))
            return one + share * (two - one)
        start += section["length_mm"]
    return None


# --- gears ----------------------------------------------------------------------------------------------------------


def shaft_of(reading: Reading, component: Component) -> Component | None:
    """Return the shaft that carries a gear or a load: by an assembly, or by a coupling of both."""
    for item in reading.parts(component, "assembly", "part", "assembly", "shaft"):
        return item
    for role, other in (("outer_part", "inner_part"), ("inner_part", "outer_part")):
        for item in reading.parts(component, "side", role, other, "shaft"):
            reading.derived(component, "side relation", "gears.shaft", f"held on {item.label} without play")
            return item
    return None


def along(reading: Reading, component: Component, shaft: Component | None, width: float = 0.0) -> float | None:
    """Return y (mm) of the middle of a part: its own place, or its coordinate on the shaft.

    Version 1.0 counts the coordinate of a gear to the beginning of its face, later ones to its middle (the two
    published examples).

    Parameters
    ----------
    reading
        The conversion.
    component
        Gear, load or mass.
    shaft
        Shaft that carries it.
    width
        Its face width (mm).
    """
    place = reading.place(component)
    at = reading.number(component, "u_coordinate_on_shaft", "mm")
    if place is not None:
        return place[1]
    if at is None or shaft is None:
        return None
    origin = reading.place(shaft) or (0.0, 0.0, 0.0)
    if reading.model.version == "1.0":
        at += 0.5 * width
    return origin[1] + sense(reading, shaft) * at


def gears(
    reading: Reading, material: dict[str, Any], shaft_tables: dict[str, dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Return [gears.NAME]."""
    tables = {}
    for item in reading.model.of_kind(*GEARS):
        name = reading.name(item)
        key = f"gears.{name}"
        teeth = reading.integer(item, "number_of_teeth", f"{key}.teeth")
        if teeth is None:
            reading.ignored(item, "number_of_teeth", "a gear without a number of teeth is left out")
            continue
        if not teeth:
            problem, cure = "must not be 0", "correct it in the file"
            raise InputError(f"number_of_teeth of {item.label}", teeth, problem, cure)
        entry: dict[str, Any] = {"teeth": -abs(teeth) if item.kind == "ring_gear" else teeth}
        flanks = _flanks(reading, item)
        _form(reading, item, flanks, entry, key)
        shaft = shaft_of(reading, item)
        y = along(reading, item, shaft, entry.get("face_width_mm", 0.0))
        shaft_table = None if shaft is None else shaft_tables.get(reading.name(shaft))
        if shaft is not None:
            entry["shaft"] = reading.name(shaft)
            reading.note(READ, item, "assembly with shaft", f"{key}.shaft")
        if y is not None:
            entry["y_mm"] = y + 0.0
            reading.derived(
                item, "support_vector or u_coordinate_on_shaft", f"{key}.y_mm", "middle of its face, along u"
            )
        _bore(reading, item, entry, shaft_table, key)
        if chosen := material_of(reading, item, material, key):
            entry["material"] = chosen
        if deviations := microgeometry(reading, item, flanks, key):
            entry["microgeometry"] = deviations
        tables[name] = entry
    return tables


def _flanks(reading: Reading, gear: Component) -> dict[str, Component]:
    """Left and right flank of a gear."""
    flanks: dict[str, Component] = {}
    for relation in reading.model.joined("flank", "gear", gear.number):
        reading.relations.add(relation.number)
        flanks |= {side: reading.model.components[number] for side, number in relation.roles.items() if side != "gear"}
    return flanks


def _tools(reading: Reading, gear: Component, flanks: dict[str, Component]) -> list[Component]:
    """Tools of a gear in the order of use: of its flanks, in older versions of the gear."""
    tools = reading.parts(gear, "ordered_reference", "origin", "referenced")
    for flank in flanks.values():
        tools += reading.parts(flank, "manufacturing_step", "workpiece", "tool")
    seen: dict[int, Component] = {item.number: item for item in tools}
    return list(seen.values())


def _first(reading: Reading, items: list[Component], name: str, unit: str, key: str) -> float | None:
    """Attribute of the first component that has it; a difference to the others is noted."""
    values = [(item, reading.number(item, name, unit)) for item in items]
    given = [(item, value) for item, value in values if value is not None]
    if not given:
        return None
    reading.note(READ, given[0][0], name, key)
    for item, value in given[1:]:
        if value != given[0][1]:
            reading.ignored(item, name, f"differs from that of {given[0][0].label}, and a job has symmetric teeth")
        else:
            reading.note(READ, item, name, key)
    return given[0][1]


def _form(reading: Reading, gear: Component, flanks: dict[str, Component], entry: dict[str, Any], key: str) -> None:
    """Keys of the tooth form."""
    sides = list(flanks.values())
    tools = _tools(reading, gear, flanks)
    racks = [tool for tool in tools if tool.kind == "rack_shaped_tool"]
    helix = reading.number(gear, "helix_angle_reference_diameter", "deg")
    module = reading.number(gear, "normal_module", "mm", f"{key}.module_mm")
    if module is None:
        transverse = reading.number(gear, "transverse_module", "mm")
        if transverse is not None:
            module = transverse * math.cos(math.radians(helix or 0.0))
            reading.derived(gear, "transverse_module", f"{key}.module_mm", "m_n = m_t cos(beta)")
    if module is not None:
        entry["module_mm"] = module
    angle = _first(reading, [*sides, *racks], "normal_pressure_angle", "deg", f"{key}.pressure_angle_deg")
    if angle is None:
        angle = 20.0
        reading.defaulted(gear, f"{key}.pressure_angle_deg", "20, of ISO 53")
    entry["pressure_angle_deg"] = angle
    if helix:
        entry["helix_angle_deg"] = abs(helix)
        reading.note(READ, gear, "helix_angle_reference_diameter", f"{key}.helix_angle_deg")
        if gear.kind == "cylindrical_gear":
            entry["helix_hand"] = "right" if helix > 0.0 else "left"
            rule = "positive: right-hand (ISO 21771)"
            reading.derived(gear, "helix_angle_reference_diameter", f"{key}.helix_hand", rule)
    elif helix is not None:
        reading.note(READ, gear, "helix_angle_reference_diameter", f"{key}.helix_angle_deg")
    width = reading.number(gear, "face_width", "mm", f"{key}.face_width_mm")
    if width is not None:
        entry["face_width_mm"] = width
    shift = _first(reading, sides, "addendum_modification_coefficient", "none", f"{key}.profile_shift")
    if shift is None:
        amount = _first(reading, sides, "addendum_modification", "mm", f"{key}.profile_shift")
        if amount is not None and module:
            shift = amount / module
            reading.derived(sides[0], "addendum_modification", f"{key}.profile_shift", "x = x m_n / m_n")
    if shift is not None:
        entry["profile_shift"] = shift
    _heights(reading, gear, sides, tools, entry, key)
    _thickness(reading, gear, flanks, entry, key)


def _heights(
    reading: Reading,
    gear: Component,
    sides: list[Component],
    tools: list[Component],
    entry: dict[str, Any],
    key: str,
) -> None:
    """Addendum, dedendum and the round of the rack."""
    module, sign = entry.get("module_mm"), -1.0 if gear.kind == "ring_gear" else 1.0
    outside = _first(reading, sides, "addendum_coefficient_basic_profile", "none", f"{key}.addendum")
    tip = reading.number(gear, "tip_diameter", "mm")
    if outside is not None:
        entry["addendum"] = outside
        if tip is not None:
            reading.ignored(gear, "tip_diameter", "the addendum of the basic profile says it")
    elif tip is not None:
        entry["tip_diameter_mm"] = sign * abs(tip)
        reading.note(READ, gear, "tip_diameter", f"{key}.tip_diameter_mm")
    elif gear.kind == "cylindrical_gear":
        reading.defaulted(gear, f"{key}.addendum", "1, of ISO 53")
    racks = [tool for tool in tools if tool.kind in ("rack_shaped_tool", "cutter_wheel_tool")]
    for tool in racks[1:]:
        reading.ignored(tool, "tool", "the first tool makes the root, later ones the flanks")
    values = {}
    for name, length, where, rule in (
        ("addendum_coefficient_reference_profile", "addendum_reference_profile", "dedendum", "h_fP* = h_aP0*"),
        (
            "tip_corner_radius_factor_reference_profile",
            "tip_corner_radius_reference_profile",
            "rack_tip_radius",
            "rho_fP* = rho_aP0*",
        ),
    ):
        value = reading.number(racks[0], name, "none", f"{key}.{where}", rule) if racks else None
        if value is None and racks and module:
            amount = reading.number(racks[0], length, "mm", f"{key}.{where}", f"{rule}, over the module")
            value = None if amount is None else amount / module
        if value is not None:
            values[where] = value
    for tool in racks[:1]:
        if gear.kind == "ring_gear" and tool.kind == "cutter_wheel_tool":
            teeth = reading.integer(tool, "number_of_teeth", f"{key}.cutter_teeth")
            shift = reading.number(tool, "addendum_modification_coefficient", "none", f"{key}.cutter_shift")
            entry |= {} if teeth is None else {"cutter_teeth": teeth}
            entry |= {} if shift is None else {"cutter_shift": shift}
    root = reading.number(gear, "root_diameter", "mm")
    if "dedendum" in values:
        if root is not None:
            reading.ignored(gear, "root_diameter", "the tool says it")
    elif root is not None:
        entry["root_diameter_mm"] = sign * abs(root)
        reading.note(READ, gear, "root_diameter", f"{key}.root_diameter_mm")
    else:
        reading.defaulted(gear, f"{key}.dedendum", "1.25, of ISO 53")
    if "rack_tip_radius" not in values:
        reading.defaulted(gear, f"{key}.rack_tip_radius", "0.3, of the program")
    entry |= values
    for side in sides:
        chamfer = reading.number(side, "tooth_tip_chamfer", "mm")
        if chamfer:
            reading.ignored(side, "tooth_tip_chamfer", "no key for chamfers: tip_round_mm is the nearest")


def _thickness(
    reading: Reading, gear: Component, flanks: dict[str, Component], entry: dict[str, Any], key: str
) -> None:
    """Tooth thinning: of the generated profile shift, or of the normal tooth thickness, or of the span."""
    module, tangent = entry.get("module_mm"), math.tan(math.radians(entry["pressure_angle_deg"]))
    shift = entry.get("profile_shift")
    settings = [
        item
        for flank in flanks.values()
        for item in reading.parts(flank, "manufacturing_step", "workpiece", "manufacturing_settings")
    ]
    sources = [(item, "generated_addendum_modification_coefficient", "none", "2 (x - x_E) m_n tan(alpha_n)")
               for item in settings[-1:]]  # fmt: skip
    thickness = "normal_tooth_thickness_at_reference_diameter"
    sources.append((gear, thickness, "mm", "m_n (pi/2 + 2 x tan(alpha_n)) less it"))
    said = ""
    for item, attribute, unit, rule in sources:
        value = reading.number(item, attribute, unit)
        if value is None:
            continue
        if said or shift is None or not module:
            missing = "needs the module" if shift is not None else "needs the profile shift"
            reading.ignored(item, attribute, f"{said} says it" if said else missing)
            continue
        if attribute == thickness:
            thinning = 1e3 * (module * (0.5 * math.pi + 2.0 * shift * tangent) - value)
        else:
            thinning = 2e3 * (shift - value) * module * tangent
        if thinning < -LEAST_THINNING:
            reading.ignored(
                item, attribute, f"thicker than nominal by {-thinning:.4g} um: a job has thinner teeth only"
            )
            continue
        said = attribute
        if thinning > LEAST_THINNING:
            entry["tooth_thinning_um"] = float(f"{thinning:.9g}")
            reading.derived(item, attribute, f"{key}.tooth_thinning_um", rule)
        else:
            reading.note(READ, item, attribute, "", "the nominal thickness")
    span = reading.number(gear, "span_measurement", "mm")
    count = reading.integer(gear, "number_of_teeth_for_span_measurement")
    given = {"span_measurement": span, "number_of_teeth_for_span_measurement": count}
    if said or span is None or count is None or gear.kind != "cylindrical_gear":
        lack = "only of external gears" if gear.kind != "cylindrical_gear" else "needs span and number of teeth"
        for attribute in (name for name, value in given.items() if value is not None):
            reading.ignored(gear, attribute, f"{said} says it" if said else lack)
    else:
        entry["span_mm"], entry["span_teeth"] = span, count
        reading.note(READ, gear, "span_measurement", f"{key}.span_mm")
        reading.note(READ, gear, "number_of_teeth_for_span_measurement", f"{key}.span_teeth")


def _bore(reading: Reading, gear: Component, entry: dict[str, Any], shaft: dict[str, Any] | None, where: str) -> None:
    """Diameter of the rigid bore, of a ring that of its rim."""
    module = entry.get("module_mm", 1.0)
    pitch = abs(entry["teeth"]) * module / math.cos(math.radians(entry.get("helix_angle_deg", 0.0)))
    bodies = reading.parts(gear, "assembly", "assembly", "part", "gear_body")
    if gear.kind == "ring_gear":
        _rim(reading, gear, bodies, entry, shaft, pitch, where)
        return
    key = f"{where}.bore_diameter_mm"
    for item in (gear, *bodies):
        value = reading.number(item, "inner_diameter", "mm")
        if value:
            entry["bore_diameter_mm"] = value
            reading.note(READ, item, "inner_diameter", key)
            return
    root = entry.get("root_diameter_mm") or pitch + 2.0 * module * (_shift(entry) - entry.get("dedendum", 1.25))
    largest = root - 2.0 * RIM * module
    y = entry.get("y_mm")
    outer = diameter_at(shaft, y) if shaft is not None and y is not None else None
    if outer is not None and outer <= largest:
        entry["bore_diameter_mm"] = outer
        reading.derived(gear, "shaft_section", key, "outer diameter of the shaft at the middle of the gear")
    elif outer is not None:
        entry["bore_diameter_mm"] = float(f"{max(largest, 0.2 * pitch):.6g}")
        rule = f"cut into its shaft: {RIM:g} modules below the root circle, at least 0.2 times the pitch circle"
        reading.derived(gear, "shaft_section", key, rule)
    else:
        entry["bore_diameter_mm"] = float(f"{0.2 * pitch:.6g}")
        reading.defaulted(gear, key, "0.2 times the pitch diameter: the file gives no shaft section there")


def _rim(
    reading: Reading,
    gear: Component,
    bodies: list[Component],
    entry: dict[str, Any],
    shaft: dict[str, Any] | None,
    pitch: float,
    where: str,
) -> None:
    """Return the rim diameter of a ring (negative, ISO 21771): that of its body, of its shaft, or a usual one."""
    key, module = f"{where}.rim_diameter_mm", entry.get("module_mm", 1.0)
    for item in bodies:
        value = reading.number(item, "outer_diameter", "mm")
        if value:
            entry["rim_diameter_mm"] = -value
            reading.note(READ, item, "outer_diameter", key)
            return
    y = entry.get("y_mm")
    rim = diameter_at(shaft, y) if shaft is not None and y is not None else None
    if rim and rim > pitch + 2.0 * (1.25 + RIM) * module:
        entry["rim_diameter_mm"] = -rim
        reading.derived(gear, "shaft_section", key, "outer diameter of its shaft")
    else:
        entry["rim_diameter_mm"] = -float(f"{pitch + 2.0 * (1.25 + USUAL_RIM) * module:.6g}")
        reading.defaulted(gear, key, f"a rim of {USUAL_RIM:g} modules outside of the root circle")


def _shift(entry: dict[str, Any]) -> float:
    shift = entry.get("profile_shift", 0.0)
    return shift if isinstance(shift, float) else 0.0


# --- bearings, couplings --------------------------------------------------------------------------------------------


def bearings(reading: Reading) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """Return [bearings.NAME] between shafts and the casing, and the other ones with the reason."""
    tables, left = {}, {}
    for item in reading.model.of_kind(*BEARINGS):
        sides = next(reading.model.joined("side", "assembly", item.number), None)
        if sides is None:
            reading.ignored(item, "bearing", "no side relation names its part")
            continue
        reading.relations.add(sides.number)
        parts = {role: reading.model.components[number] for role, number in sides.roles.items() if role != "assembly"}
        kinds = {part.kind for part in parts.values()}
        name = reading.name(item)
        if kinds != {"shaft", "gear_casing"}:
            labels = " and ".join(part.label for part in parts.values())
            left[name] = f"carries {labels}: a bearing of a job is between a shaft and the housing"
            continue
        shaft = next(part for part in parts.values() if part.kind == "shaft")
        key = f"bearings.{name}"
        entry: dict[str, Any] = {"shaft": reading.name(shaft)}
        place = reading.place(item)
        side = "inner" if parts.get("inner_part") is shaft else "outer"
        at = reading.number(item, f"u_coordinate_on_shaft_{side}_side", "mm")
        if place is None and at is not None:
            origin = reading.place(shaft) or (0.0, 0.0, 0.0)
            place = (0.0, origin[1] + sense(reading, shaft) * at, 0.0)
        if place is None:
            left[name] = "has neither support_vector nor u_coordinate_on_shaft"
            continue
        entry["y_mm"] = place[1] + 0.0
        reading.derived(item, "support_vector or u_coordinate_on_shaft", f"{key}.y_mm", "along u")
        entry |= _rolling(reading, item, shaft, key) or _springs(reading, item, key)
        tables[name] = entry
    return tables, left


def _rolling(reading: Reading, bearing: Component, shaft: Component, key: str) -> dict[str, Any]:
    """Geometry of a rolling bearing: its own, or that which follows from catalogue values; empty without either."""
    given = reading.text(bearing, "bearing_type")
    if not given:
        return {}
    kind = TYPES.get(given)
    if kind is None:
        reading.ignored(bearing, "bearing_type", f"{given}: a job has {', '.join(dict.fromkeys(TYPES.values()))} only")
        return {}
    rows = reading.parts(bearing, "ordered_assembly", "assembly", "part", "rolling_bearing_row")
    entry = _rows(reading, bearing, rows, kind, key) or _catalogue(reading, bearing, rows, kind, key)
    if not entry:
        return {}
    reading.note(READ, bearing, "bearing_type", f"{key}.type")
    clearance = reading.number(bearing, "operating_radial_bearing_clearance", "um")
    if kind in (DEEP_GROOVE, CYLINDRICAL):
        if clearance is not None:
            entry["radial_clearance_um"] = clearance
            reading.note(READ, bearing, "operating_radial_bearing_clearance", f"{key}.radial_clearance_um")
    elif clearance:
        reading.ignored(bearing, "operating_radial_bearing_clearance", "of a type that a job gives an axial preload")
    _carries(reading, bearing, rows, shaft, kind, entry, key)
    for name in ("radial_stiffness", "axial_stiffness", "bending_stiffness"):
        if reading.attribute(bearing, name) is not None:
            reading.ignored(bearing, name, "the stiffness follows from the geometry and the load")
    return entry


def _rows(reading: Reading, bearing: Component, rows: list[Component], kind: str, key: str) -> dict[str, Any]:
    """Geometry in the rows of a bearing and their rolling elements."""
    if not rows:
        return {}
    row = rows[0]
    elements = reading.parts(row, "ordered_assembly", "assembly", "part", "rolling_element")
    number = reading.integer(row, "number_of_rolling_elements") or len(elements) or None
    pitch = reading.number(row, "reference_diameter_rolling_bearing", "mm")
    size = reading.number(elements[0], "diameter_of_rolling_element", "mm") if elements else None
    if not (number and pitch and size):
        return {}
    entry: dict[str, Any] = {
        "type": kind, "elements": number, "element_diameter_mm": size, "pitch_diameter_mm": pitch,
    }  # fmt: skip
    reading.note(READ, row, "number_of_rolling_elements", f"{key}.elements")
    reading.note(READ, row, "reference_diameter_rolling_bearing", f"{key}.pitch_diameter_mm")
    reading.note(READ, elements[0], "diameter_of_rolling_element", f"{key}.element_diameter_mm")
    for other in elements[1:]:
        reading.used |= {(other.number, name) for name in other.attributes}
        reading.derived(other, "rolling_element", f"{key}.elements", "as the first of its row")
    if kind in (DEEP_GROOVE, ANGULAR):
        for side in ("inner", "outer"):
            radius = reading.number(row, f"raceway_radius_of_{side}_ring", "mm")
            if radius:
                entry[f"{side}_osculation"] = radius / size
                rule = "over the diameter of the ball"
                reading.derived(row, f"raceway_radius_of_{side}_ring", f"{key}.{side}_osculation", rule)
    else:
        length = reading.number(row, "significant_contact_length_inner_ring", "mm")
        name = "significant_contact_length_inner_ring"
        if length is None:
            length, name = reading.number(elements[0], "length_of_rolling_element", "mm"), "length_of_rolling_element"
        if not length:
            return {}
        entry["roller_length_mm"] = length
        reading.note(READ, row if name.startswith("sig") else elements[0], name, f"{key}.roller_length_mm")
    angle = reading.number(row, "pressure_angle", "deg")
    if kind in (ANGULAR, TAPERED):
        if not angle:
            return {}
        entry["contact_angle_deg"] = abs(angle)
        reading.note(READ, row, "pressure_angle", f"{key}.contact_angle_deg")
    if len(rows) == 2:
        apart = reading.number(bearing, "distance_between_bearing_rows", "mm")
        if apart:
            entry["row_distance_mm"] = apart
            reading.note(READ, bearing, "distance_between_bearing_rows", f"{key}.row_distance_mm")
            for name in rows[1].attributes:
                reading.used.add((rows[1].number, name))
            reading.derived(rows[1], "rolling_bearing_row", key, "as the first row")
    return entry


def _catalogue(reading: Reading, bearing: Component, rows: list[Component], kind: str, key: str) -> dict[str, Any]:
    """Geometry that follows from bore, outside diameter, width and static load rating (ISO 76:2006)."""
    bore = reading.number(bearing, "inner_diameter", "mm")
    outside = reading.number(bearing, "outer_diameter", "mm")
    rating = reading.number(bearing, "radial_static_load_rating", "N")
    width = reading.number(bearing, "width", "mm")
    angle = reading.number(rows[0], "pressure_angle", "deg") if rows else None
    if not (bore and outside and rating and outside > bore) or (kind in (ANGULAR, TAPERED) and not angle):
        return {}
    count = max(len(rows), reading.integer(bearing, "number_of_bearing_rows") or 1)
    pitch, cosine = 0.5 * (bore + outside), math.cos(math.radians(angle or 0.0))
    entry: dict[str, Any] = {"type": kind}
    if kind in (DEEP_GROOVE, ANGULAR):
        size = 0.3 * (outside - bore)
        number = rating / (_f0(size * cosine / pitch) * count * size * size * cosine)
        rule = "D_w = 0.3 (D - d), Z = C_0/(f_0 i D_w^2 cos(alpha)) (ISO 76)"
    else:
        if not width:
            return {}
        size = 0.26 * (outside - bore)
        length = 0.64 * width
        number = rating / (44.0 * (1.0 - size * cosine / pitch) * count * length * size * cosine)
        rule = "D_we = 0.26 (D - d), L_we = 0.64 B, Z = C_0/(44 (1 - D_we cos(a)/D_pw) i L_we D_we cos(a)) (ISO 76)"
        entry["roller_length_mm"] = float(f"{length:.6g}")
    most = int(math.pi / math.asin(size / pitch))
    entry |= {
        "elements": max(3, min(round(number), most)),
        "element_diameter_mm": float(f"{size:.6g}"),
        "pitch_diameter_mm": pitch,
    }
    if kind in (ANGULAR, TAPERED):
        entry["contact_angle_deg"] = abs(angle or 0.0)
    if count == 2:
        apart = reading.number(bearing, "distance_between_bearing_rows", "mm")
        entry["row_distance_mm"] = apart or 0.5 * (width or size)
    names = "inner_diameter, outer_diameter, width, radial_static_load_rating"
    reading.derived(bearing, names, f"{key}.elements, element_diameter_mm, pitch_diameter_mm", rule)
    return entry


def _f0(ratio: float) -> float:
    for (a, one), (b, two) in itertools.pairwise(_F0):
        if ratio <= b:
            return one + (ratio - a) / (b - a) * (two - one)
    return _F0[-1][1]


def _carries(
    reading: Reading,
    bearing: Component,
    rows: list[Component],
    shaft: Component,
    kind: str,
    entry: dict[str, Any],
    key: str,
) -> None:
    """Direction of the axial force that a bearing carries."""
    axial = reading.text(bearing, "axial_force_absorption")
    for row in rows:
        reading.text(row, "axial_force_absorption_of_row")
    if kind in (ANGULAR, TAPERED):
        if entry.get("row_distance_mm"):
            entry["arrangement"] = "O"
            reading.defaulted(bearing, f"{key}.arrangement", "O, back to back")
            return
        sign = {"positive": 1.0, "negative": -1.0}.get(axial)
        if sign is None:
            reading.defaulted(bearing, f"{key}.carries", "+y: the file says no direction")
        else:
            rule = "the force on the shaft, along u"
            reading.derived(bearing, "axial_force_absorption", f"{key}.carries", rule)
        entry["carries"] = "+y" if (sign or 1.0) * sense(reading, shaft) > 0.0 else "-y"
    elif kind == DEEP_GROOVE and axial in ("no_direction", "positive", "negative"):
        rule = f"{axial}: a deep-groove ball bearing of a job carries axial forces both ways"
        reading.ignored(bearing, "axial_force_absorption", rule)
    elif kind == CYLINDRICAL and axial in ("both_directions", "positive", "negative"):
        stiffness = reading.number(bearing, "axial_stiffness", "N / m")
        if stiffness:
            entry["axial_stiffness_N_per_m"] = min(stiffness, RIGID)
            reading.note(READ, bearing, "axial_stiffness", f"{key}.axial_stiffness_N_per_m")
        else:
            entry["axial_stiffness_N_per_m"] = USUAL
            reading.defaulted(bearing, f"{key}.axial_stiffness_N_per_m", f"{USUAL:g}, ribs")


def _springs(reading: Reading, bearing: Component, key: str) -> dict[str, Any]:
    """Stiffness of a bearing as numbers."""
    axial = reading.text(bearing, "axial_force_absorption")
    radial = reading.flag(bearing, "radial_force_absorption")
    values = {}
    for name, unit, rigid, target in (
        ("radial_stiffness", "N / m", RIGID, "stiffness_N_per_m"),
        ("axial_stiffness", "N / m", RIGID, "stiffness_N_per_m"),
        ("bending_stiffness", "N m / rad", RIGID_TILT, "tilt_stiffness_Nm_per_rad"),
    ):
        value = reading.number(bearing, name, unit)
        if value is not None and value > rigid:
            reading.derived(bearing, name, f"{key}.{target}", f"rigid: {rigid:g} {unit}")
        elif value is not None:
            reading.note(READ, bearing, name, f"{key}.{target}")
        values[name] = None if value is None else min(value, rigid)
    across, tilt = values["radial_stiffness"], values["bending_stiffness"] or 0.0
    if across is None or (not across and radial is not False):
        across = USUAL
        reading.defaulted(bearing, f"{key}.stiffness_N_per_m", f"{USUAL:g} N/m across the axis")
    if radial is False:
        across = 0.0
        reading.derived(
            bearing, "radial_force_absorption", f"{key}.stiffness_N_per_m", "carries nothing across the axis"
        )
    way = values["axial_stiffness"]
    if axial == "no_direction":
        way = 0.0
        reading.derived(bearing, "axial_force_absorption", f"{key}.stiffness_N_per_m", "floats: no axial stiffness")
    elif not way and axial:
        way = USUAL
        reading.defaulted(bearing, f"{key}.stiffness_N_per_m", f"{USUAL:g} N/m along the axis")
    elif axial in ("positive", "negative"):
        reading.ignored(bearing, "axial_force_absorption", f"{axial}: springs of a job act both ways")
    elif axial:
        reading.note(READ, bearing, "axial_force_absorption", f"{key}.stiffness_N_per_m")
    return {"stiffness_N_per_m": [across, way or 0.0, across], "tilt_stiffness_Nm_per_rad": [tilt, tilt]}


def couplings(reading: Reading) -> tuple[dict[str, dict[str, Any]], dict[str, str], dict[str, str]]:
    """Return [couplings.NAME], couplings to the casing -> the shaft that they hold, and others -> reason."""
    tables: dict[str, dict[str, Any]] = {}
    held: dict[str, str] = {}
    left: dict[str, str] = {}
    for item in reading.model.of_kind(*COUPLINGS):
        sides = next(reading.model.joined("side", "assembly", item.number), None)
        name = reading.name(item)
        if reading.flag(item, "is_engaged") is False:
            left[name] = "is not engaged"
            continue
        if sides is None:
            left[name] = "no side relation names its shafts"
            continue
        reading.relations.add(sides.number)
        parts = [reading.model.components[number] for role, number in sides.roles.items() if role != "assembly"]
        kinds = sorted(part.kind for part in parts)
        if kinds == ["gear_casing", "shaft"]:
            shaft = next(part for part in parts if part.kind == "shaft")
            held[name] = reading.name(shaft)
            continue
        if set(kinds) & set(GEARS):
            reading.derived(item, "side relation", "gears.shaft", "a gear on its shaft turns with it without play")
            continue
        if kinds != ["shaft", "shaft"]:
            left[name] = f"couples {' and '.join(part.label for part in parts)}: a job couples two shafts on one axis"
            continue
        key = f"couplings.{name}"
        stiffness = reading.number(item, "rotational_stiffness", "N m / rad")
        if stiffness is None or stiffness > RIGID_TORSION:
            if stiffness is None:
                reading.defaulted(item, f"{key}.stiffness_Nm_per_rad", f"rigid: {RIGID_TORSION:g}")
            else:
                rule = f"rigid: {RIGID_TORSION:g}"
                reading.derived(item, "rotational_stiffness", f"{key}.stiffness_Nm_per_rad", rule)
            stiffness = RIGID_TORSION
        else:
            reading.note(READ, item, "rotational_stiffness", f"{key}.stiffness_Nm_per_rad")
        for other in ("axial_stiffness", "radial_stiffness", "bending_stiffness"):
            if reading.attribute(item, other) is not None:
                reading.ignored(item, other, "a coupling of a job is a torsional spring only")
        first, second = (reading.name(part) for part in parts)
        tables[name] = {"shafts": [first, second], "stiffness_Nm_per_rad": stiffness}
    return tables, held, left


def masses(reading: Reading, shaft_tables: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return [machines.NAME] of additional masses on shafts: their inertia about the axis, on a stiff spring."""
    tables = {}
    for item in reading.model.of_kind("additional_mass"):
        shaft = shaft_of(reading, item)
        inertia = reading.number(item, "moment_of_inertia_u_axis", "kg m^2")
        if reading.attribute(item, "mass_of_component") is not None:
            rule = "no key for point masses on shafts: its inertia about the axis is a machine, its weight is missing"
            reading.ignored(item, "mass_of_component", rule)
        if shaft is None or not inertia:
            reading.ignored(item, "additional_mass", "on no shaft, or without moment_of_inertia_u_axis")
            continue
        name = reading.name(item)
        reading.note(READ, item, "moment_of_inertia_u_axis", f"machines.{name}.inertia_kg_m2")
        stiffness = float(f"{inertia * (2.0 * math.pi * 2e4) ** 2:.6g}")
        rule = "rigid: its own frequency on the shaft is 20 kHz"
        reading.derived(item, "moment_of_inertia_u_axis", f"machines.{name}.stiffness_Nm_per_rad", rule)
        entry = {"shaft": reading.name(shaft), "inertia_kg_m2": inertia, "stiffness_Nm_per_rad": stiffness}
        y = along(reading, item, shaft)
        if y is not None and "sections" in shaft_tables.get(reading.name(shaft), {}):
            entry["y_mm"] = y
        tables[name] = entry
    return tables
