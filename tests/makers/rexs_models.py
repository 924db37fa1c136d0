"""Small REXS models, written for the tests: components and relations in a few lines, as XML, JSON or an archive."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from gearfe.output.exchange.rexs.schema import schema

#: (number, type, name, attributes); an attribute is a value in the unit of the schema, or (value, unit).
Part = tuple[int, str, str, Mapping[str, Any]]
#: (type, role -> number), or (type, roles, order).
Joint = tuple[Any, ...]

HEAD = 'applicationId="tests" applicationVersion="1" date="2026-01-01T00:00:00+00:00"'


def _unit(kind: str, name: str, value: Any) -> tuple[Any, str]:
    if isinstance(value, tuple):
        return value[0], value[1]
    known = schema().attribute(kind, name)
    return value, known.unit if known else "none"


def _xml_value(value: Any) -> str:
    if isinstance(value, list):
        return "<array>" + "".join(f"<c>{_xml_value(item)}</c>" for item in value) + "</array>"
    if isinstance(value, bool):
        return "true" if value else "false"
    return escape(str(value))


def _xml_component(part: Part) -> str:
    number, kind, name, attributes = part
    lines = []
    for key, given in attributes.items():
        value, unit = _unit(kind, key, given)
        lines.append(f"<attribute id={quoteattr(key)} unit={quoteattr(unit)}>{_xml_value(value)}</attribute>")
    head = f"<component id={quoteattr(str(number))} type={quoteattr(kind)} name={quoteattr(name)}>"
    return f"{head}{''.join(lines)}</component>"


def xml_of(parts: Iterable[Part], joints: Iterable[Joint] = (), version: str = "2.0", more: str = "") -> str:
    """Return the XML of a model; `more` is put at its end, for load spectra."""
    relations = []
    for number, joint in enumerate(joints, start=1):
        kind, roles, *order = joint
        refs = "".join(f'<ref id="{target}" role="{role}"/>' for role, target in roles.items())
        place = f' order="{order[0]}"' if order else ""
        relations.append(f'<relation id="{number}" type="{kind}"{place}>{refs}</relation>')
    components = "".join(_xml_component(part) for part in parts)
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model version="{version}" {HEAD}><relations>{"".join(relations)}'
        f"</relations><components>{components}</components>{more}</model>"
    )


def json_of(parts: Iterable[Part], joints: Iterable[Joint] = (), version: str = "2.0") -> str:
    """Return the JSON of a model."""
    components = []
    for number, kind, name, attributes in parts:
        entries = []
        for key, given in attributes.items():
            value, unit = _unit(kind, key, given)
            known = schema().attribute(kind, key)
            entries.append({"id": key, "unit": unit, known.kind if known else "string": value})
        components.append({"id": number, "type": kind, "name": name, "attributes": entries})
    relations = []
    for number, joint in enumerate(joints, start=1):
        kind, roles, *order = joint
        refs = [{"id": target, "role": role} for role, target in roles.items()]
        relations.append({"id": number, "type": kind, "refs": refs} | ({"order": order[0]} if order else {}))
    head = {"version": version, "applicationId": "tests", "applicationVersion": "1", "date": "2026-01-01T00:00:00"}
    return json.dumps({"model": {**head, "relations": relations, "components": components}})


def zip_of(files: Mapping[str, bytes | str]) -> bytes:
    """Return an archive of files."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def saved(folder: Path, content: str | bytes, name: str = "model.rexs") -> Path:
    """Write a file and return its path."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def pose(u: float, v: float, w: float, along: Iterable[float] = (1.0, 0.0, 0.0)) -> dict[str, Any]:
    """Attributes of a place in the system of the gear unit, component 1."""
    axis = list(along)
    return {
        "reference_component_for_position": 1, "support_vector": [u, v, w], "u_axis_vector": axis,
        "w_axis_vector": [0.0, 0.0, 1.0],
    }  # fmt: skip


def spur_pair(**gear: Any) -> tuple[list[Part], list[Joint]]:
    """Return a spur stage 20/40, m = 2 mm, between two stepped shafts in four bearings, 30 N m at 1500 per minute.

    Keyword arguments are further attributes of the first gear.
    """
    parts: list[Part] = [
        (1, "gear_unit", "unit", pose(0.0, 0.0, 0.0)),
        (2, "gear_casing", "casing", {}),
        (3, "shaft", "input", {**pose(0.0, 0.0, 0.0), "rotational_speed": 1500.0, "defines_speed": True}),
        (4, "shaft", "output", pose(0.0, 0.0, 60.0)),
        (5, "cylindrical_gear", "pinion", {
            **pose(50.0, 0.0, 0.0), "number_of_teeth": 20, "normal_module": 2.0, "face_width": 20.0,
            "helix_angle_reference_diameter": 0.0, **gear,
        }),
        (6, "cylindrical_gear", "wheel", {
            **pose(50.0, 0.0, 60.0), "number_of_teeth": 40, "normal_module": 2.0, "face_width": 18.0,
            "helix_angle_reference_diameter": 0.0,
        }),
        (7, "cylindrical_stage", "stage", {"center_distance": 60.0}),
        (8, "external_load", "motor", {
            "u_coordinate_on_shaft": 5.0, "torque_around_u_axis": 30.0, "defines_torque": True,
        }),
        (9, "external_load", "machine", {"u_coordinate_on_shaft": 95.0, "transmits_torque": True}),
        (10, "material", "steel", {"elastic_modulus": 206000.0, "poisson_ratio": 0.3, "density": 7.83}),
    ]  # fmt: skip
    joints: list[Joint] = [
        ("assembly", {"assembly": 3, "part": 5}),
        ("assembly", {"assembly": 4, "part": 6}),
        ("stage", {"stage": 7, "gear_1": 5, "gear_2": 6}),
        ("assembly", {"assembly": 3, "part": 8}),
        ("assembly", {"assembly": 4, "part": 9}),
        *(("reference", {"origin": number, "referenced": 10}) for number in (3, 4, 5, 6)),
    ]
    for number, (shaft, u, w) in enumerate(
        ((3, 20.0, 0.0), (3, 80.0, 0.0), (4, 20.0, 60.0), (4, 80.0, 60.0)), start=11
    ):
        stiffness = {"radial_stiffness": 2e8, "axial_stiffness": 1e8, "bending_stiffness": 1e7}
        parts.append((number, "concept_bearing", f"B{number}", {**pose(u, 0.0, w), **stiffness}))
        joints.append(("side", {"assembly": number, "inner_part": shaft, "outer_part": 2}))
    for number, (shaft, u, length, d) in enumerate(
        ((3, 0.0, 40.0, 20.0), (3, 40.0, 60.0, 25.0), (4, 0.0, 60.0, 30.0), (4, 60.0, 40.0, 28.0)), start=21
    ):
        size = {
            "outer_diameter_begin": d,
            "outer_diameter_end": d,
            "inner_diameter_begin": 0.0,
            "inner_diameter_end": 0.0,
        }
        parts.append((number, "shaft_section", "", {"u_coordinate_on_shaft": u, "length": length, **size}))
        joints.append(("assembly", {"assembly": shaft, "part": number}))
    for number, gear_number, shift in ((31, 5, 0.0), (33, 6, 0.0)):
        for side in (number, number + 1):
            flank = {"normal_pressure_angle": 20.0, "addendum_modification_coefficient": shift}
            parts.append((side, "cylindrical_gear_flank", "", flank))
        joints.append(("flank", {"gear": gear_number, "left": number, "right": number + 1}))
    return parts, joints


def with_attributes(parts: Iterable[Part], number: int, **attributes: Any) -> list[Part]:
    """Return the parts with attributes of one of them changed; None takes one out."""
    changed = []
    for other, kind, name, given in parts:
        merged = {**given, **attributes} if other == number else given
        changed.append((other, kind, name, {key: value for key, value in merged.items() if value is not None}))
    return changed
