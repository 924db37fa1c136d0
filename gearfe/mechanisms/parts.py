"""Bodies, joints, forces and functions of time from their tables."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.errors import InputError, given, unknown_name
from ..base.expressions import parse
from ..base.tables.kinds import MOTIONS, Kind
from ..base.tables.mechanism import BodyTable, ForceTable, FunctionTable, JointTable, MechanismFile
from ..multibody import GROUND, Body, TimeFunction, constant, polynomial, sine, smoothed_step
from ..multibody.planar.beam_link import BeamLink
from .links import link_of
from .loads import ALLOWED, OF_SPAN, ExpressionLoad, ExpressionTension
from .motions import time_function_of
from .plates import PlatePart
from .quantities import quantity_names
from .tables import ValueTable

Point = tuple[float, float]
#: Keys that may be expressions of the state.
LOADS = ("x_N", "y_N", "moment_N_m")
#: Keys that may be expressions of the time.
OVER_TIME = (*MOTIONS, "length_m")


#: Times of a run at which a length over time is looked at.
LENGTHS = 2001
#: Flexible links by name: where joints and forces find the bodies that are their nodes.
Links = Mapping[str, BeamLink | PlatePart]


def body_of(file: MechanismFile, name: str, t: BodyTable, parts: Mapping[str, PlatePart]) -> Body:
    """Return a rigid body from its table; a link is taken as rigid.

    Parameters
    ----------
    file : MechanismFile
        The file, whose other tables a beam may name.
    name : str
        Name of the body.
    t : BodyTable
        Its table.
    parts : mapping
        Links of finite elements by name.

    Raises
    ------
    InputError
        If mass or moment of inertia is missing.
    """
    if t.beam is not None:
        return link_of(file, name, t).rigid()
    if t.plate is not None:
        return parts[name].rigid()
    mass, inertia = given(t.mass_kg, f"bodies.{name}.mass_kg"), given(t.inertia_kg_m2, f"bodies.{name}.inertia_kg_m2")
    angle = t.angle_rad if t.angle_rad is not None else math.radians(t.angle_deg or 0.0)
    return Body(name, mass, inertia, t.centre_m, t.position_m, angle, t.velocity_m_per_s, t.rate_rad_per_s)


def _place(
    file: MechanismFile, links: Links, where: str, point: str | Point | None, label: str, *, pointed: bool
) -> tuple[str, Point]:
    """Return the body of the linkage and the position in its frame of the point `where`.

    `where` is a body, or a point of a flexible link.

    What takes no point (not `pointed`) acts on the section where a flexible link begins.
    """
    body, _, at = where.partition(".")
    place = (0.0, 0.0)
    if at:
        place = file.bodies[body].all_points[at]
    elif isinstance(point, str):
        points = file.ground.points_m if body == GROUND else file.bodies[body].all_points
        if point == "centre" and body != GROUND and file.bodies[body].shape is None:
            place = file.bodies[body].centre_m
        elif point not in points:
            raise unknown_name(f"{label}: points of {body}", point, points)
        else:
            place = points[point]
    elif point is not None:
        place = point
    if body not in links:
        return body, place
    link = links[body]
    if isinstance(link, PlatePart):
        return link.at(place, label) if pointed or at else (link.name, (0.0, 0.0))
    return link.node_names[link.node(place[0])], (0.0, place[1])


def part_of(
    file: MechanismFile,
    links: Links,
    tables: Mapping[str, ValueTable],
    label: str,
    name: str,
    table: JointTable | ForceTable,
    kind: Kind,
) -> Any:
    """Return a joint or force from its table: the class of its type, with the keys as fields.

    Parameters
    ----------
    file : MechanismFile
        The file, for bodies and their points.
    links : mapping
        Flexible links by name.
    tables : mapping
        Tables of values by name.
    label : str
        ``joints.NAME`` or ``forces.NAME``, for messages.
    name : str
        Name of the joint or force.
    table : JointTable or ForceTable
        Its keys.
    kind : Kind
        Class of its type, and the field of each key.

    Raises
    ------
    InputError
        For unknown names, and for values that the class refuses; the message names the key.
    """
    module, _, cls = kind.reference.partition(":")
    values: dict[str, Any] = {}
    for body, point in (("body", "point"), ("to", "to_point")):
        if body in kind.fields and getattr(table, body) is not None:
            place = _place(
                file,
                links,
                getattr(table, body),
                getattr(table, point),
                f"{label}.{point}",
                pointed=point in kind.fields,
            )
            values[kind.fields[body]] = place[0]
            if point in kind.fields and not _selects_section(file, table, getattr(table, body)):
                values[kind.fields[point]] = place[1]
    for key, field_name in kind.fields.items():
        value = getattr(table, key)
        if key in ("body", "to", "point", "to_point"):
            continue
        if key == "carrier" and value is not None:
            value = _place(file, links, value, None, f"{label}.carrier", pointed=False)[0]
        if isinstance(value, FunctionTable):
            value = time_function(value, tables, f"{label}.{key}", smooth=key not in LOADS)
            if key == "length_m":
                _check_length(value, file.run.end_s, f"{label}.{key}")
        elif isinstance(value, str) and key in OVER_TIME:
            node = parse(value, f"{label}.{key}", quantity_names(("time",), tables, "a motion", file.parameters))
            value = time_function_of(node, value, f"{label}.{key}", file.run.end_s)
            if key == "length_m":
                _check_length(value, file.run.end_s, f"{label}.{key}")
        elif key == "profile":
            value = _profile(value, tables, f"{label}.profile")
        elif isinstance(value, str) and key in LOADS:
            node = parse(value, f"{label}.{key}", quantity_names(ALLOWED, tables, "a load", file.parameters))
            value = ExpressionLoad(value, f"{label}.{key}", node)
        elif key == "tension_N" and value is not None:
            node = parse(value, f"{label}.{key}", quantity_names(OF_SPAN, tables, "a tension", file.parameters))
            value = ExpressionTension(value, f"{label}.{key}", node)
        elif key.endswith("_deg") and value is not None:
            value = math.radians(value)
        if value is not None:
            values[field_name] = value
    try:
        return getattr(importlib.import_module(module), cls)(**values, name=name)
    except InputError as error:  # of the class's field: the file has a key
        named = [key for key, of in kind.fields.items() if error.field.endswith(f" {of}")]
        wrong = next((key for key in named if getattr(table, key) is not None), next(iter(named), None))
        if wrong is None:
            raise
        raise InputError(f"{label}.{wrong}", error.value, error.problem, error.cure) from None


def _selects_section(file: MechanismFile, table: JointTable | ForceTable, where: str) -> bool:
    """Return whether a point of `where` only selects the section or interface whose angle is meant."""
    body = file.bodies.get(where.partition(".")[0])
    return body is not None and body.shape is not None and getattr(table, "coordinate", None) in ("angle", "rate")


def _check_length(length: TimeFunction, end: float, label: str) -> None:
    """Refuse a length that is not positive over the run, or has no square."""
    inner = [t for t in length.breaks if 0.0 < t < end]
    times = np.unique(np.concatenate([np.linspace(0.0, end, LENGTHS), inner]))
    values = length(times)
    if not (values > 0.0).all():
        at, value = times[int(values.argmin())], float(values.min())
        raise InputError(label, value, f"must be > 0 m at all times (at {at:.6g} s)", "give a longer one")
    try:
        length.squared()
    except InputError as error:
        raise InputError(label, None, error.problem, error.cure) from None


def _profile(name: str, tables: Mapping[str, ValueTable], label: str) -> ValueTable:
    """Table of a cam: one turn, with a steady curvature."""
    if name not in tables:
        raise unknown_name(label, name, tables)
    table = tables[name]
    if table.kind != "periodic" or abs(table.x[-1] - table.x[0] - 2 * math.pi) > 1e-6:
        problem = "must be periodic over one turn, 0 to 2 pi rad"
        raise InputError(label, name, problem, 'write interpolation = "periodic" in its table')
    return table


def time_function(
    table: FunctionTable, tables: Mapping[str, ValueTable], label: str, *, smooth: bool = False
) -> TimeFunction:
    """Return a function of time from its keys: constant, table, polynomial, step and sine add up.

    Parameters
    ----------
    table : FunctionTable
        The keys.
    tables : mapping
        Tables of values by name.
    label : str
        Name of the key in messages.
    smooth : bool
        Whether a jump in the first derivative is refused, as for a prescribed motion.

    Raises
    ------
    InputError
        For an unknown table, one that is periodic or begins after the start, and one that jumps if `smooth`.
    """
    total = constant(table.constant)
    if table.table is not None:
        if table.table not in tables:
            raise unknown_name(f"{label}.table", table.table, tables)
        known = tables[table.table]
        if known.kind == "periodic":
            raise InputError(f"{label}.table", table.table, "is periodic", 'write interpolation = "cubic" in its table')
        if smooth and known.kind == "linear":
            cure = 'write interpolation = "cubic" in its table'
            raise InputError(f"{label}.table", table.table, "would make the speed of a prescribed motion jump", cure)
        if known.x[0] > 0.0:
            raise InputError(f"{label}.table", table.table, f"begins at {known.x[0]:g} s, after the run", "begin at 0")
        total = known.over_time() if table.constant == 0.0 else known.over_time() + total
    if table.polynomial:
        total = total + polynomial(table.polynomial, table.origin_s)
    if table.step is not None:
        total = total + smoothed_step(
            table.step_centre_s, given(table.step_width_s, f"{label}.step_width_s"), table.step
        )
    if table.sine is not None:
        total = total + sine(
            table.sine, 2 * math.pi * given(table.frequency_hz, f"{label}.frequency_hz"), math.radians(table.phase_deg)
        )
    return total


def known_until(file: MechanismFile, tables: Mapping[str, ValueTable]) -> float:
    """Time at which the first table ends that is a function of time (s)."""
    parts: list[JointTable | ForceTable] = [*file.joints.values(), *file.forces.values()]
    given = [value for part in parts for value in vars(part).values() if isinstance(value, FunctionTable)]
    ends = [float(tables[value.table].x[-1]) for value in given if value.table is not None]
    return min(ends, default=math.inf)
