"""Write a job as REXS 2.0, with attributes of the schema, or of gearfe where the schema has none.

The model is written, read back as any REXS file is, and compared with the job. Keys that differ, and tables without a
component, go into ``custom_gearfe_keys`` and ``custom_gearfe_tables``, which the reader puts over what it derived. So a
job comes back with every number as it was, and another program finds all that REXS can say.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from ....base.config import read_toml
from ....base.errors import InputError
from ....base.files import whole_file
from ....base.tables.bearing import ANGULAR, CYLINDRICAL, DEEP_GROOVE, TAPERED
from ....base.tables.gearbox import Gearbox, NamedGear, mesh_name
from ....base.tables.jobs import NAMED, gearbox_of, job_tables, train_tables
from ....base.tables.pair import FROM_DISTANCE
from ....base.tables.text import toml_document
from ....version import VERSION as PROGRAM
from .job import OWN_KEYS, OWN_NAME, OWN_TABLES, rexs_job
from .modifications import SHAPES
from .parts import TYPES
from .read import read_model
from .results import GEAR_DATA, Result, gear_data
from .schema import VERSION, schema
from .units import written

#: Endings of files -> form.
ENDINGS = {
    ".rexs": "xml",
    ".rexs.xml": "xml",
    ".rexsj": "json",
    ".rexs.json": "json",
    ".rexsz": "zip",
    ".rexs.zip": "zip",
}
#: Tables that become components; others by name have none in REXS.
AS_COMPONENTS = ("materials", "gears", "meshes", "shafts", "bearings", "machines", "couplings")
#: Keys that the reader adds after it has taken those of this program.
LATE = ("mesh_model", "addendum", "oil_viscosity_mPa_s", "roughness_um")
#: Attribute of an external load, key of [[train.forces]], and unit.
FORCES = (
    ("force_u_direction", "force_y_N", "N"),
    ("force_v_direction", "force_z_N", "N"),
    ("force_w_direction", "force_x_N", "N"),
    ("torque_around_v_axis", "moment_z_Nm", "N m"),
    ("torque_around_w_axis", "moment_x_Nm", "N m"),
)
#: Type of bearing in a job -> in REXS.
_TYPES = {kind: name for name, kind in reversed(TYPES.items())}
#: Shape of a relief in a job -> in REXS.
_SHAPES = {shape: name for name, shape in SHAPES.items()}


@dataclass
class _Part:
    """A component under way: attribute -> value as text, truth value, or list of texts."""

    number: int
    kind: str
    name: str
    attributes: dict[str, Any] = field(default_factory=dict)


@dataclass
class _Builder:
    """Components and relations of a model under way, and number -> attributes of a component in the load case."""

    parts: list[_Part] = field(default_factory=list)
    relations: list[tuple[str, dict[str, int], int | None]] = field(default_factory=list)
    numbers: dict[tuple[str, str], int] = field(default_factory=dict)
    loaded: dict[int, _Part] = field(default_factory=dict)

    def add(self, kind: str, name: str = "", table: str = "", **values: Any) -> _Part:
        """Add a component. A value is (number, its unit), a text, a truth value, a whole number or None for nothing."""
        part = _Part(len(self.parts) + 1, kind, name)
        self.parts.append(part)
        self.set(part, **values)
        if table:
            self.numbers[table, name] = part.number
        return part

    def set(self, part: _Part, **values: Any) -> None:
        """Set attributes of a component, in the unit of the schema."""
        for key, value in values.items():
            if value is None:
                continue
            known = schema().attribute(part.kind, key)
            assert known is not None, (part.kind, key)
            if isinstance(value, tuple):
                number, unit = value
                if number is None:
                    continue
                many = isinstance(number, list)
                texts = [written(item, unit, known.unit) for item in (number if many else [number])]
                part.attributes[key] = texts if many else texts[0]
            else:
                part.attributes[key] = value

    def add_results(self, results: Iterable[Result]) -> None:
        """Add results where the schema has an attribute for them; an attribute that the job gives stays."""
        for result in results:
            number = self.numbers.get((result.table, result.name))
            if number is None:
                continue
            part = self.parts[number - 1]
            if schema().attribute(part.kind, result.attribute) is None:
                continue
            if result.loaded:
                part = self.loaded.setdefault(number, _Part(number, part.kind, part.name))
            if result.attribute in part.attributes:
                continue
            value = result.value
            if isinstance(value, (bool, int)):
                self.set(part, **{result.attribute: value})
                continue
            values = [value] if isinstance(value, float) else list(value)
            if all(math.isfinite(item) for item in values):  # REXS has finite numbers only
                self.set(part, **{result.attribute: (value if isinstance(value, float) else values, result.unit)})

    def relate(self, kind: str, order: int | None = None, **roles: int) -> None:
        """Add a relation."""
        self.relations.append((kind, roles, order))


def write_rexs(job: str | Path | Mapping[str, Any], path: str | Path, results: Iterable[Result] = ()) -> None:
    """Write a job as a REXS 2.0 file. The ending gives the form: .rexs (XML), .rexsj (JSON), .rexsz (archive of XML).

    Parameters
    ----------
    job
        Job file, or its parsed tables.
    path
        File to write.
    results
        What was computed of it, see `gearfe.rexs_results`; those without an attribute in REXS are left out.

    Raises
    ------
    InputError
        For mistakes in the job, jobs without gears, and other endings.
    """
    path = Path(path)
    form = next((form for ending, form in ENDINGS.items() if path.name.lower().endswith(ending)), None)
    if form is None:
        raise InputError("file", str(path), f"must end in {', '.join(ENDINGS)}", "name it gearbox.rexs")
    name = "job" if isinstance(job, Mapping) else str(job)
    raw = dict(job) if isinstance(job, Mapping) else read_toml(job)
    content = rexs_bytes(raw, form, name, results)
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def rexs_bytes(raw: Mapping[str, Any], form: str = "xml", name: str = "job", results: Iterable[Result] = ()) -> bytes:
    """Return a parsed job as REXS 2.0.

    Parameters
    ----------
    raw
        Tables of the job.
    form
        ``xml``, ``json`` or ``zip``.
    name
        Of the job, for messages.
    results
        What was computed of it.
    """
    tables, others = _by_name(dict(raw), name)
    builder = _model(tables, others)
    builder.add_results(results)
    derived = rexs_job(read_model(_xml(builder), name)).tables
    for kind in AS_COMPONENTS:
        for key, entry in tables.get(kind, {}).items():
            part = builder.parts[builder.numbers[kind, key] - 1]
            made = derived.get(kind, {}).get(key, {})
            if made != entry:
                kept = [k for k, value in entry.items() if k not in LATE and k in made and made[k] == value]
                keys = {k: value for k, value in entry.items() if k not in kept}
                part.attributes[OWN_KEYS] = toml_document({"table": kind, "kept": kept, "keys": keys})
            part.attributes[OWN_NAME] = key
    unit = builder.parts[0]
    unit.attributes[OWN_TABLES] = toml_document(others) or "# no other tables"
    xml = _xml(builder)
    if form == "json":
        return _json(builder)
    return xml if form == "xml" else _zip(xml)


# --- jobs by name ---------------------------------------------------------------------------------------------------


def _by_name(raw: dict[str, Any], path: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the tables by name of a job, of shorthand, too, and its other tables."""
    if "gears" not in raw and raw.get("train", {}).get("shafts"):
        raw = _of_train(raw, path)
    elif "gears" not in raw and "pair" in raw:
        raw = _of_pair(raw, path)
    if "gears" not in raw:
        problem = "is not there: REXS is written of gears by name, or of [pair]"
        raise InputError("[gears]", None, problem, "write [gears.NAME] and [meshes.NAME] (gearfe new gearbox)")
    job_tables(raw, path, ("gears", "meshes"), tuple(name for name in NAMED if name in raw))
    gearbox_of(raw, path)  # raises for gears that cannot mesh
    tables = {kind: raw[kind] for kind in AS_COMPONENTS if kind in raw}
    return tables, {name: table for name, table in raw.items() if name not in AS_COMPONENTS}


def _of_pair(raw: dict[str, Any], path: str) -> dict[str, Any]:
    """Tables by name that say what [pair] and [microgeometry] do."""
    box: Gearbox = gearbox_of(raw, path)
    mesh = next(iter(box.meshes.values()))
    keys = {"driver": mesh.driver.name, "driven": mesh.driven.name, "centre_distance_mm": mesh.centre_distance_mm,
            "flank": mesh.flank, "tolerance_class": mesh.tolerance_class, "misalignment_um": mesh.misalignment_um,
            "misalignment_across_um": mesh.misalignment_across_um}  # fmt: skip
    keep = {key: value for key, value in keys.items() if value not in (None, 0.0)}
    gears = {gear.name: _gear_entry(gear) for gear in mesh.gears}
    others = {name: table for name, table in raw.items() if name not in ("pair", "microgeometry")}
    loads = {
        key: value
        for key, value in raw.get("microgeometry", {}).items()
        if key not in ("flank", "tolerance_class", "pinion", "wheel")
    }
    if loads and "loadmap" not in others:
        others["loadmap"] = loads
    materials = {f"{gear.name}_material": table_dict(gear.material) for gear in mesh.gears if gear.material is not None}
    return {**others, "gears": gears, "meshes": {mesh.name: keep}, **({"materials": materials} if materials else {})}


def _of_train(raw: dict[str, Any], path: str) -> dict[str, Any]:
    """Tables by name that say what the lists of [train] do, with [pair] and [microgeometry] where gears are theirs."""
    tables = train_tables(raw, path, "")
    train, box = tables["train"], tables["gearbox"]
    bores = {str(bore.attachment): bore for bore in train.rigid_bores}
    carried = {str(bearing.attachment): bearing for bearing in train.bearings}
    shafts, bearings, used = {}, {}, set()
    for shaft in train.shafts:
        entry = table_dict(shaft)
        name = entry.pop("name")
        entry["attachments"] = [hinge for hinge in shaft.attachments if str(hinge) not in carried]
        for hinge in shaft.attachments:
            if str(hinge) not in carried:
                continue
            bearing = {**table_dict(carried[str(hinge)]), "shaft": name}
            del bearing["attachment"]
            if train.housing == "rigid" and str(hinge) in bores:
                bearing["y_mm"] = bores[str(hinge)].y_mm
                used.add(str(hinge))
            bearings[str(hinge)] = bearing
        if not entry["attachments"]:
            del entry["attachments"]
        shafts[name] = entry
    meshes = {}
    for mesh in train.meshes:
        known = box.meshes[mesh_name(mesh.driver, mesh.driven)]
        keys = {"centre_distance_mm": known.centre_distance_mm, "misalignment_um": known.misalignment_um,
                "misalignment_across_um": known.misalignment_across_um}  # fmt: skip
        meshes[known.name] = table_dict(mesh) | {key: value for key, value in keys.items() if value}
    gears, materials = {}, {}
    for name, gear in box.gears.items():
        if not gear.shaft:
            continue
        gears[name] = {**_gear_entry(gear), "shaft": gear.shaft, "y_mm": gear.y_mm}
        materials[f"{name}_material"] = (
            {"density_kg_per_m3": gear.density_kg_per_m3} if gear.material is None else table_dict(gear.material)
        )
        gears[name]["material"] = f"{name}_material"
    others = {name: table for name, table in raw.items() if name not in ("pair", "microgeometry")}
    lists = ("shafts", "gears", "meshes", "bearings", "machines", "couplings", "rigid_bores")
    others["train"] = {key: value for key, value in raw["train"].items() if key not in lists}
    hinges = [table_dict(bore) for name, bore in bores.items() if name not in used]
    if hinges:
        others["train"]["rigid_bores"] = hinges
    parts = {
        kind: {item.name: {key: value for key, value in table_dict(item).items() if key != "name"} for item in items}
        for kind, items in (("machines", train.machines), ("couplings", train.couplings))
    }
    made = {"materials": materials, "gears": gears, "meshes": meshes, "shafts": shafts, "bearings": bearings, **parts}
    return {**{kind: table for kind, table in made.items() if table}, **others}


def _gear_entry(gear: NamedGear) -> dict[str, Any]:
    """Entry of a gear with the keys that its tables give."""
    entry: dict[str, Any] = {"teeth": gear.teeth, **gear.drawn}
    for key, value in gear.form.items():
        if value is not None and (gear.written(key) or key in ("module_mm", "pressure_angle_deg", "face_width_mm")):
            entry[key] = FROM_DISTANCE if key == "profile_shift" and gear.shift_from else value
    entry.pop("pitch_diameter_mm", None)
    if gear.y_mm:
        entry["y_mm"] = gear.y_mm
    if gear.material is not None:
        entry["material"] = f"{gear.name}_material"
    if gear.microgeometry is not None:
        entry["microgeometry"] = table_dict(gear.microgeometry)
    return entry


def table_dict(table: Any) -> dict[str, Any]:
    """Return the keys of a table that are not their defaults, tables within it alike."""
    entry = {}
    for item in fields(table):
        value = getattr(table, item.name)
        if value is None or value in (item.default, ()):
            continue
        if is_dataclass(value):
            value = table_dict(value)
        elif isinstance(value, tuple):
            value = [table_dict(one) if is_dataclass(one) else _plain(one) for one in value]
        if value not in ({}, []):
            entry[item.name] = value
    return entry


def _plain(value: Any) -> Any:
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


# --- components -----------------------------------------------------------------------------------------------------


def _pose(u: float, v: float = 0.0, w: float = 0.0) -> dict[str, Any]:
    """Attributes of a place in the system of the gear unit."""
    return {
        "reference_component_for_position": 1, "support_vector": ([u, v, w], "mm"),
        "u_axis_vector": ([1.0, 0.0, 0.0], "mm"), "w_axis_vector": ([0.0, 0.0, 1.0], "mm"),
    }  # fmt: skip


def _model(tables: Mapping[str, Any], others: Mapping[str, Any]) -> _Builder:
    """Return the components and relations of a job."""
    b = _Builder()
    b.add("gear_unit", "gear unit", **_pose(0.0))
    casing = b.add("gear_casing", "housing").number
    b.relate("assembly", assembly=1, part=casing)
    for name, entry in tables.get("materials", {}).items():
        b.add("material", name, "materials", elastic_modulus=(entry.get("youngs_modulus_GPa", 200.0), "GPa"),
              poisson_ratio=(entry.get("poisson_ratio", 0.3), "none"),
              density=(entry.get("density_kg_per_m3", 7850.0), "kg / m^3"))  # fmt: skip
    train = others.get("train", {})
    for name, entry in tables.get("shafts", {}).items():
        _shaft(b, name, entry, train)
    for name, entry in tables["gears"].items():
        _gear(b, name, entry, tables.get("shafts", {}))
    for name, entry in tables["meshes"].items():
        _mesh(b, name, entry)
    for name, entry in tables.get("bearings", {}).items():
        _bearing(b, name, entry, tables.get("shafts", {}), casing)
    for name, entry in tables.get("machines", {}).items():
        shaft = tables.get("shafts", {}).get(entry["shaft"], {})
        at = None if "y_mm" not in entry else entry["y_mm"] - _start(shaft)
        part = b.add("additional_mass", name, "machines", moment_of_inertia_u_axis=(entry["inertia_kg_m2"], "kg m^2"),
                     u_coordinate_on_shaft=(at, "mm"))  # fmt: skip
        b.relate("assembly", assembly=b.numbers["shafts", entry["shaft"]], part=part.number)
    for name, entry in tables.get("couplings", {}).items():
        one, two = (b.numbers["shafts", shaft] for shaft in entry["shafts"])
        part = b.add("coupling", name, "couplings", rotational_stiffness=(entry["stiffness_Nm_per_rad"], "N m / rad"))
        b.relate("side", assembly=part.number, inner_part=one, outer_part=two)
    _train(b, train, tables.get("shafts", {}))
    return b


def _start(shaft: Mapping[str, Any]) -> float:
    """Place of the end of lowest y of a shaft (mm)."""
    sections = shaft.get("sections", [])
    length = sum(section["length_mm"] for section in sections) if sections else shaft.get("length_mm", 0.0)
    return float(shaft.get("y_mm", 0.0) - 0.5 * length)


def _shaft(b: _Builder, name: str, entry: Mapping[str, Any], train: Mapping[str, Any]) -> None:
    part = b.add("shaft", name, "shafts", **_pose(_start(entry), entry.get("z_mm", 0.0), entry["x_mm"]))
    b.relate("assembly", assembly=1, part=part.number)
    drive = train.get("drive", {})
    speed = drive.get("speed_rad_per_s")
    if drive.get("shaft") == name and isinstance(speed, (int, float)):
        b.set(part, rotational_speed=(speed, "rad / s"), defines_speed=True)
    _reference(b, part.number, entry)
    sections = (
        entry.get("sections") or [{"length_mm": entry["length_mm"], "outer_diameter_mm": 2.0 * entry["radius_mm"]}]
        if "sections" in entry or "length_mm" in entry
        else []
    )
    at = 0.0
    for section in sections:
        ends: dict[str, Any] = {}
        for which in ("outer", "inner"):
            for end, mine in (("begin", "start"), ("end", "end")):
                default = 0.0 if which == "inner" else None
                value = section.get(f"{which}_diameter_mm", section.get(f"{which}_diameter_{mine}_mm", default))
                ends[f"{which}_diameter_{end}"] = (value, "mm")
        piece = b.add(
            "shaft_section", "", u_coordinate_on_shaft=(at, "mm"), length=(section["length_mm"], "mm"), **ends
        )
        b.relate("assembly", assembly=part.number, part=piece.number)
        at += section["length_mm"]


def _reference(b: _Builder, number: int, entry: Mapping[str, Any]) -> None:
    """Material of a part, where it is one by name."""
    target = b.numbers.get(("materials", str(entry.get("material"))))
    if target is not None:
        b.relate("reference", origin=number, referenced=target)


def _gear(b: _Builder, name: str, entry: Mapping[str, Any], shafts: Mapping[str, Any]) -> None:
    internal = entry["teeth"] < 0
    shaft = shafts.get(entry.get("shaft", ""), {})
    helix = entry.get("helix_angle_deg", 0.0)
    sign = -1.0 if entry.get("helix_hand") == "left" else 1.0
    place = _pose(entry.get("y_mm", 0.0), shaft.get("z_mm", 0.0), shaft.get("x_mm", 0.0))
    part = b.add("ring_gear" if internal else "cylindrical_gear", name, "gears", number_of_teeth=abs(entry["teeth"]),
                 normal_module=(entry.get("module_mm"), "mm"), face_width=(entry.get("face_width_mm"), "mm"),
                 helix_angle_reference_diameter=(sign * helix + 0.0, "deg"),
                 u_coordinate_on_shaft=(entry.get("y_mm", 0.0) - _start(shaft) if shaft else None, "mm"),
                 tip_diameter=(_size(entry.get("tip_diameter_mm")), "mm"),
                 root_diameter=(_size(entry.get("root_diameter_mm")), "mm"), **place)  # fmt: skip
    if not internal:
        b.set(part, inner_diameter=(entry.get("bore_diameter_mm"), "mm"), span_measurement=(entry.get("span_mm"), "mm"),
              number_of_teeth_for_span_measurement=entry.get("span_teeth"))  # fmt: skip
    elif "rim_diameter_mm" in entry:
        body = b.add("gear_body", "", outer_diameter=(_size(entry["rim_diameter_mm"]), "mm"))
        b.relate("assembly", assembly=part.number, part=body.number)
    if shaft:
        b.relate("assembly", assembly=b.numbers["shafts", entry["shaft"]], part=part.number)
    _reference(b, part.number, entry)
    shift = entry.get("profile_shift", 0.0)
    flanks = {}
    for side in ("left", "right"):
        flank = b.add("cylindrical_gear_flank", "", normal_pressure_angle=(entry.get("pressure_angle_deg"), "deg"))
        b.set(flank, addendum_coefficient_basic_profile=(entry.get("addendum"), "none"))
        if not isinstance(shift, str):
            b.set(flank, addendum_modification_coefficient=(shift, "none"))
        flanks[side] = flank.number
    b.relate("flank", gear=part.number, **flanks)
    _tool(b, entry, flanks, internal)
    deviations = entry.get("microgeometry")
    if deviations:
        b.set(part, datum_face_orientation="positive")
        for side, number in flanks.items():
            for kind, values in _modifications({**deviations, **deviations.get(side, {})}):
                item = b.add(kind, "", **values)
                b.relate("reference", origin=number, referenced=item.number)


def _size(value: float | None) -> float | None:
    return None if value is None else abs(value)


def _tool(b: _Builder, entry: Mapping[str, Any], flanks: Mapping[str, int], internal: bool) -> None:
    """Tool of a gear whose file gives dedendum, rack tip radius or cutter."""
    if not {"dedendum", "rack_tip_radius", "cutter_teeth"} & entry.keys():
        return
    values: dict[str, Any] = {
        "addendum_coefficient_reference_profile": (entry.get("dedendum"), "none"),
        "tip_corner_radius_factor_reference_profile": (entry.get("rack_tip_radius"), "none"),
    }
    if internal:
        values |= {
            "number_of_teeth": entry.get("cutter_teeth"),
            "addendum_modification_coefficient": (entry.get("cutter_shift"), "none"),
        }
    tool = b.add("cutter_wheel_tool" if internal else "rack_shaped_tool", "", **values)
    for flank in flanks.values():
        settings = b.add("cylindrical_gear_manufacturing_settings", "")
        b.relate("manufacturing_step", 1, workpiece=flank, tool=tool.number, manufacturing_settings=settings.number)


def _modifications(table: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Components of the modifications of one flank."""
    items: list[tuple[str, dict[str, Any]]] = []
    for end in ("tip", "root"):
        if f"{end}_relief_um" in table:
            items.append((f"{end}_relief", {
                f"{end}_relief_depth": (table[f"{end}_relief_um"], "um"),
                f"{end}_relief_datum_length": (table.get(f"{end}_relief_length_mm"), "mm"),
                f"{end}_relief_datum_diameter": (table.get(f"{end}_relief_start_diameter_mm"), "mm"),
                f"{end}_relief_evaluation_reference": (table.get(f"{end}_relief_end_diameter_mm"), "mm"),
                "shape_of_relief": _SHAPES[table.get(f"{end}_relief_shape", "linear")],
            }))  # fmt: skip
    for name, face in (("low", "non_datum_face"), ("high", "datum_face")):
        if f"end_relief_{name}_um" in table:
            items.append((f"end_relief_{face}", {
                f"end_relief_depth_{face}": (table[f"end_relief_{name}_um"], "um"),
                f"end_relief_length_{face}": (table.get(f"end_relief_{name}_length_mm"), "mm"),
                "shape_of_relief": _SHAPES[table.get("end_relief_shape", "linear")],
            }))  # fmt: skip
    for key, kind, names in (
        ("profile_crowning_um", "profile_crowning", ("profile_crowning_at_tip", "profile_crowning_at_root")),
        ("helix_crowning_um", "helix_crowning",
         ("helix_crowning_amount_datum_face", "helix_crowning_amount_non_datum_face")),
        ("profile_slope_um", "profile_slope", ("profile_slope",)),
        ("helix_slope_um", "helix_slope", ("helix_slope",)),
        ("bias_um", "profile_twist", ("profile_twist",)),
    ):  # fmt: skip
        if key in table:
            items.append((kind, dict.fromkeys(names, (table[key], "um"))))
    return items


def _mesh(b: _Builder, name: str, entry: Mapping[str, Any]) -> None:
    distance = entry.get("centre_distance_mm")
    part = b.add("cylindrical_stage", name, "meshes", center_distance=(_size(distance), "mm"))
    b.relate("assembly", assembly=1, part=part.number)
    gears = [b.numbers["gears", entry[role]] for role in ("driver", "driven")]
    b.relate("stage", stage=part.number, gear_1=gears[0], gear_2=gears[1])
    for gear, drives in zip(gears, (True, False), strict=True):
        data = b.add("cylindrical_stage_gear_data", "", is_driving_gear=drives)
        b.numbers[GEAR_DATA, gear_data(name, entry["driver" if drives else "driven"])] = data.number
        b.relate("stage_gear_data", stage=part.number, gear=gear, stage_gear_data=data.number)


def _bearing(b: _Builder, name: str, entry: Mapping[str, Any], shafts: Mapping[str, Any], casing: int) -> None:
    shaft = shafts.get(entry["shaft"], {})
    y = entry.get("y_mm", 0.0)
    at = {f"u_coordinate_on_shaft_{side}_side": (y - _start(shaft), "mm") for side in ("inner",)}
    pose = _pose(y, shaft.get("z_mm", 0.0), shaft.get("x_mm", 0.0)) if "y_mm" in entry else {}
    kind = entry.get("type")
    if kind is None:
        stiffness, tilt = entry.get("stiffness_N_per_m"), entry.get("tilt_stiffness_Nm_per_rad") or (0.0, 0.0)
        values: dict[str, Any] = {}
        if stiffness is not None:
            values = {
                "radial_stiffness": (stiffness[0], "N / m"), "axial_stiffness": (stiffness[1], "N / m"),
                "bending_stiffness": (tilt[0], "N m / rad"),
            }  # fmt: skip
        part = b.add("concept_bearing", name, "bearings", **pose, **at, **values)
    else:
        part = _rolling(b, name, entry, kind, {**pose, **at})
    b.relate("side", assembly=part.number, inner_part=b.numbers["shafts", entry["shaft"]], outer_part=casing)


def _rolling(b: _Builder, name: str, entry: Mapping[str, Any], kind: str, values: dict[str, Any]) -> _Part:
    """A rolling bearing with its rows and an element of each."""
    count = 2 if entry.get("row_distance_mm") else 1
    axial = {"+y": "positive", "-y": "negative"}.get(entry.get("carries", ""))
    part = b.add("rolling_bearing_with_detailed_geometry", name, "bearings", bearing_type=_TYPES[kind],
                 number_of_bearing_rows=count, distance_between_bearing_rows=(entry.get("row_distance_mm"), "mm"),
                 operating_radial_bearing_clearance=(entry.get("radial_clearance_um"), "um"),
                 axial_force_absorption=axial, **values)  # fmt: skip
    size = entry["element_diameter_mm"]
    for order in range(1, count + 1):
        row = b.add("rolling_bearing_row", "", number_of_rolling_elements=entry["elements"],
                    reference_diameter_rolling_bearing=(entry["pitch_diameter_mm"], "mm"),
                    pressure_angle=(entry.get("contact_angle_deg", 0.0), "deg"))  # fmt: skip
        if kind in (DEEP_GROOVE, ANGULAR):
            for side in ("inner", "outer"):
                if f"{side}_osculation" in entry:
                    b.set(row, **{f"raceway_radius_of_{side}_ring": (entry[f"{side}_osculation"] * size, "mm")})
        element = b.add("rolling_element", "", diameter_of_rolling_element=(size, "mm"))
        if kind in (CYLINDRICAL, TAPERED):
            b.set(element, length_of_rolling_element=(entry["roller_length_mm"], "mm"))
        b.relate("ordered_assembly", order, assembly=part.number, part=row.number)
        b.relate("ordered_assembly", 1, assembly=row.number, part=element.number)
    return part


def _train(b: _Builder, train: Mapping[str, Any], shafts: Mapping[str, Any]) -> None:
    """Drive and loads as external loads."""
    drive = train.get("drive")
    loads = [("drive", drive)] if drive else []
    loads += [(f"load {number}", load) for number, load in enumerate(train.get("loads", []), start=1)]
    for name, load in loads:
        shaft = shafts.get(load["shaft"])
        if shaft is None:
            continue
        torque = load.get("torque_Nm")
        known = isinstance(torque, (int, float))
        y = load.get("y_mm", shaft.get("y_mm", 0.0))
        part = b.add("external_load", name, u_coordinate_on_shaft=(y - _start(shaft), "mm"),
                     torque_around_u_axis=(torque, "N m") if known else None, transmits_torque=True,
                     defines_torque=True if known else None)  # fmt: skip
        b.relate("assembly", assembly=b.numbers["shafts", load["shaft"]], part=part.number)
    for number, force in enumerate(train.get("forces", []), start=1):
        shaft = shafts.get(force["shaft"])
        if shaft is None:
            continue
        values: dict[str, Any] = {name: (force.get(key), unit) for name, key, unit in FORCES}
        at = force["y_mm"] - _start(shaft)
        part = b.add("external_load", f"force {number}", u_coordinate_on_shaft=(at, "mm"), transmits_torque=False,
                     **values)  # fmt: skip
        b.relate("assembly", assembly=b.numbers["shafts", force["shaft"]], part=part.number)


# --- text -----------------------------------------------------------------------------------------------------------


def _head() -> dict[str, str]:
    now = datetime.now(UTC).replace(microsecond=0).isoformat()
    return {"version": VERSION, "applicationId": "gearfe", "applicationVersion": PROGRAM, "date": now}


def _unit(part: _Part, name: str) -> str:
    known = schema().attribute(part.kind, name)
    return "none" if known is None else known.unit


def _xml(b: _Builder) -> bytes:
    head = " ".join(f"{key}={quoteattr(value)}" for key, value in _head().items())
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', f"<model {head}>", "  <relations>"]
    kinds = {part.number: part.kind for part in b.parts}
    for number, (kind, roles, order) in enumerate(b.relations, start=1):
        place = "" if order is None else f' order="{order}"'
        lines.append(f'    <relation id="{number}" type="{kind}"{place}>')
        lines += [f'      <ref id="{target}" role="{role}" hint="{kinds[target]}"/>' for role, target in roles.items()]
        lines.append("    </relation>")
    lines += ["  </relations>", "  <components>"]
    lines += [line for part in b.parts for line in _xml_component(part)]
    lines.append("  </components>")
    if b.loaded:
        lines += ['  <load_spectrum id="1">', '    <load_case id="1">']
        lines += [f"  {line}" for _, part in sorted(b.loaded.items()) for line in _xml_component(part)]
        lines += ["    </load_case>", "  </load_spectrum>"]
    return "\n".join([*lines, "</model>", ""]).encode()


def _xml_component(part: _Part) -> list[str]:
    lines = [f'    <component id="{part.number}" type="{part.kind}" name={quoteattr(part.name)}>']
    for name, value in part.attributes.items():
        text = _xml_value(value)
        lines.append(f'      <attribute id="{name}" unit={quoteattr(_unit(part, name))}>{text}</attribute>')
    return [*lines, "    </component>"]


def _xml_value(value: Any) -> str:
    if isinstance(value, list):
        return "<array>" + "".join(f"<c>{escape(str(item))}</c>" for item in value) + "</array>"
    return str(value).lower() if isinstance(value, bool) else escape(str(value))


def _json(b: _Builder) -> bytes:
    components = [_json_component(part) for part in b.parts]
    relations = []
    for number, (kind, roles, order) in enumerate(b.relations, start=1):
        refs = [{"id": target, "role": role, "hint": b.parts[target - 1].kind} for role, target in roles.items()]
        place = {} if order is None else {"order": order}
        relations.append({"id": number, "type": kind, **place, "refs": refs})
    model: dict[str, Any] = {**_head(), "relations": relations, "components": components}
    if b.loaded:
        case = {"id": 1, "components": [_json_component(part) for _, part in sorted(b.loaded.items())]}
        model["load_spectrum"] = {"id": 1, "load_cases": [case]}
    text = json.dumps({"model": model}, indent=1, default=str)
    return _Number.unquoted(text).encode()


def _json_component(part: _Part) -> dict[str, Any]:
    attributes = []
    for name, value in part.attributes.items():
        known = schema().attribute(part.kind, name)
        kind = "string" if known is None else known.kind
        attributes.append({"id": name, "unit": _unit(part, name), kind: _Number.of(kind, value)})
    return {"id": part.number, "type": part.kind, "name": part.name, "attributes": attributes}


class _Number:
    """Decimal numbers of JSON: written as marked texts, and the marks taken off, for floats have too few digits."""

    MARK = "\ue000"

    @classmethod
    def of(cls, kind: str, value: Any) -> Any:
        """Value of an attribute for `json.dumps`."""
        if isinstance(value, list):
            return [cls.of(kind.removesuffix("_array"), item) for item in value]
        return f"{cls.MARK}{value}{cls.MARK}" if kind == "floating_point" else value

    @classmethod
    def unquoted(cls, text: str) -> str:
        """Text of JSON with its numbers."""
        mark = json.dumps(cls.MARK)[1:-1]
        return text.replace(f'"{mark}', "").replace(f'{mark}"', "")


def _zip(xml: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("model.rexs", xml)
    return stream.getvalue()
