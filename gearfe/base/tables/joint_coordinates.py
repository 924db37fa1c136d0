"""Links of a mechanism file given by their joints: ``at_m``, the position of a joint at the start, and ``links``.

The frame of each link has its origin in the first of its joints, in the order of the file. Its x axis points to the
next joint at another position. Lengths, start poses and points follow. A link whose joints lie on one line is a uniform
slender rod, unless [bodies.NAME] gives other values. Its mass centre is in the middle, its moment of inertia m L^2 /
12.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..config import build, quantity
from ..errors import InputError

GROUND = "ground"
#: Types of joints that a position defines; the last two also need a direction. Start poses give all angles.
PLACED = ("hinge", "slot", "prismatic")
#: Keys of bodies that follow from the positions of the joints.
_POSE = ("position_m", "angle_deg", "angle_rad")
#: Joints of a link that are so far off a line, relative to its length, lie on it; round-off of 15 digits.
STRAIGHT = 1e-9
#: Further keys of a joint with ``at_m``.
_KEYS = ("at_m", "links", "type", "direction")


@dataclass(frozen=True)
class LinksTable:
    """[links]: what links have in common that joints with at_m define."""

    mass_per_length_kg_per_m: float | None = quantity(
        None, above=0.0, doc="mass of links without mass_kg over their length (kg/m): uniform slender rods"
    )


@dataclass(frozen=True)
class _Placed:
    """A point of links at the start."""

    name: str
    at: tuple[float, float]
    links: tuple[str, ...]


def with_links(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return a parsed mechanism file in which bodies, points and types replace positions of joints.

    Parameters
    ----------
    raw : mapping
        The parsed file, without expressions of parameters. Files without ``at_m`` are returned as they are.

    Raises
    ------
    InputError
        For positions and names that are none, and for what contradicts the positions.
    """
    joints, bodies = raw.get("joints", {}), raw.get("bodies", {})
    if not (isinstance(joints, dict) and isinstance(bodies, dict)):
        return {name: table for name, table in raw.items() if name != "links"}  # which is an error of those tables
    given = {name: joint for name, joint in joints.items() if _is_placed(joint)}
    if not given:
        if isinstance(raw.get("links"), dict):
            cure = "give joints at_m and links, or remove [links]"
            raise InputError("[links]", None, "is of links that joints with at_m define, and there are none", cure)
        return dict(raw)
    placed = [_placed(name, joint) for name, joint in given.items()]
    density = build(LinksTable, raw.get("links", {}), "links").mass_per_length_kg_per_m
    points: dict[str, dict[str, tuple[float, float]]] = {}
    for point in placed:
        for link in point.links:
            points.setdefault(link, {})[point.name] = point.at
    frames = {link: _frame(at) for link, at in points.items() if link != GROUND}
    made, used = dict(bodies), False
    for link, frame in frames.items():
        body = bodies.get(link, {})
        if not isinstance(body, dict):
            raise InputError(f"bodies.{link}", body, "must be a table", f"write [bodies.{link}]")
        made[link], massed = _body(link, body, points[link], frame, density)
        used = used or massed
    if density is not None and not used:
        problem = "is used by no link: each has a mass of its own, a beam or a plate"
        raise InputError("links.mass_per_length_kg_per_m", density, problem, "remove it, or the masses")
    ground = raw.get("ground", {})
    if GROUND in points and isinstance(ground, dict):
        at_rest = _with_points("ground", ground.get("points_m", {}), points[GROUND])
        ground = {**ground, "points_m": at_rest}
    by_name = {point.name: point for point in placed}
    rest: dict[str, Any] = {}
    for name, joint in joints.items():
        rest |= _joints(by_name[name], joint, frames, joints) if name in by_name else {name: joint}
    others = {name: table for name, table in raw.items() if name != "links"}
    return {**others, "bodies": made, "joints": rest, **({"ground": ground} if ground else {})}


def _is_placed(joint: Any) -> bool:
    return isinstance(joint, dict) and ("at_m" in joint or joint.get("links", []) != [])  # the default is none


def _placed(name: str, joint: Mapping[str, Any]) -> _Placed:
    """Position and links of a joint."""
    label, example = f"joints.{name}", 'links = ["crank", "rod"]'
    for key in joint:
        if key not in _KEYS:
            cure = f"remove it, or at_m and links; with these its keys are {', '.join(_KEYS[2:])}"
            raise InputError(f"{label}.{key}", joint[key], "conflicts with at_m and links", cure)
    for key, cure in (("at_m", "add at_m = [x, y], its position at the start in m"), ("links", f"add {example}")):
        if key not in joint:
            other = "links" if key == "at_m" else "at_m"
            raise InputError(f"{label}.{key}", None, f"is required with {other}", cure)
    at, links = joint["at_m"], joint["links"]
    if not (isinstance(at, list) and len(at) == 2 and all(_is_number(x) for x in at)):
        raise InputError(f"{label}.at_m", at, "must be two finite numbers", "write [x, y] in m")
    if not (isinstance(links, list) and links and all(isinstance(link, str) for link in links)):
        raise InputError(f"{label}.links", links, "must be a list of names", f"write {example}")
    for i, link in enumerate(links):
        if link in links[:i]:
            raise InputError(f"{label}.links[{i}]", link, "joins a link to itself", "name each link once")
        if not link.isidentifier():
            problem = "must be a word of letters, digits and _ (it is used in expressions and columns)"
            raise InputError(f"{label}.links[{i}]", link, problem, "rename it")
    kind = joint.get("type", "hinge")
    if len(links) == 1:
        for key in ("type", "direction"):
            if key in joint:
                problem = f"is of a joint, and {label} has one link: it is a point of it"
                raise InputError(f"{label}.{key}", joint[key], problem, "name a second link, or remove it")
    elif kind not in PLACED:
        cure = "give its body and its points by name: joints with at_m are points of their links"
        problem = f"must be one of {', '.join(PLACED)} for a joint with at_m"
        raise InputError(f"{label}.type", kind, problem, cure)
    elif kind != "hinge" and len(links) > 2:
        cure = "give each pair its own joint"
        raise InputError(f"{label}.links", links, f"must be two links of a {kind} joint", cure)
    return _Placed(name, (float(at[0]), float(at[1])), tuple(links))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e75


@dataclass(frozen=True)
class _Frame:
    """Start pose of a link: origin (m), angle (rad)."""

    origin: tuple[float, float]
    angle: float

    def inside(self, at: tuple[float, float]) -> list[float]:
        """A position in the frame; one on its axis has y = 0."""
        x, y = at[0] - self.origin[0], at[1] - self.origin[1]
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        along, across = cosine * x + sine * y, cosine * y - sine * x
        return [along, across if abs(across) > STRAIGHT * math.hypot(x, y) else 0.0]

    def turned(self, way: tuple[float, float]) -> list[float]:
        """A direction in the frame."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        return [cosine * way[0] + sine * way[1], cosine * way[1] - sine * way[0]]


def _frame(points: Mapping[str, tuple[float, float]]) -> _Frame:
    first, *others = points.values()
    ways = [(x - first[0], y - first[1]) for x, y in others]
    far = max((math.hypot(*way) for way in ways), default=0.0)
    along = next((way for way in ways if math.hypot(*way) > STRAIGHT * far), (1.0, 0.0))
    return _Frame(first, math.atan2(along[1], along[0]))


def _body(
    name: str, body: Mapping[str, Any], points: Mapping[str, tuple[float, float]], frame: _Frame, density: float | None
) -> tuple[dict[str, Any], bool]:
    """Table of a link, and whether its mass follows from its length.

    Parameters
    ----------
    name : str
        Name of the link.
    body : mapping
        Its own table.
    points : mapping
        Positions of its joints at the start (m).
    frame : _Frame
        Its frame.
    density : float or None
        Mass of links over their length (kg/m).
    """
    where = f"bodies.{name}"
    for key in _POSE:
        if key in body:
            problem = f"follows from the joints of the link: {', '.join(points)}"
            raise InputError(f"{where}.{key}", body[key], problem, "remove it, or at_m of these joints")
    inside = {joint: frame.inside(at) for joint, at in points.items()}
    table = {
        **body, "position_m": list(frame.origin), "angle_rad": frame.angle,
        "points_m": _with_points(where, body.get("points_m", {}), inside),
    }  # fmt: skip
    if "beam" in body or "plate" in body or {"mass_kg", "inertia_kg_m2"} <= body.keys():
        return table, False
    low, high = min(x for x, _ in inside.values()), max(x for x, _ in inside.values())
    straight = all(y == 0.0 for _, y in inside.values())
    if "inertia_kg_m2" in body or "centre_m" in body or not straight or not high > low:
        why = (
            "is required: mass_kg, inertia_kg_m2 and centre_m belong together"
            if "inertia_kg_m2" in body or "centre_m" in body
            else f"is required: the joints of the link ({', '.join(points)}) "
            + ("lie at one position, so it has no length" if straight else "are not on one line")
        )
        missing = "mass_kg" if "mass_kg" not in body else "inertia_kg_m2"
        raise InputError(f"{where}.{missing}", None, why, f"give mass_kg, inertia_kg_m2 and centre_m in [{where}]")
    length = high - low
    if "mass_kg" not in body and density is None:
        cure = f"give it in [{where}], or mass_per_length_kg_per_m of all links in [links]"
        raise InputError(f"{where}.mass_kg", None, "is required", cure)
    mass = body["mass_kg"] if "mass_kg" in body else (density or 0.0) * length
    if not _is_number(mass):
        raise InputError(f"{where}.mass_kg", mass, "must be a number", "write the mass in kg")
    table |= {"mass_kg": mass, "inertia_kg_m2": mass * length**2 / 12.0, "centre_m": [0.5 * (low + high), 0.0]}
    return table, "mass_kg" not in body


def _with_points(where: str, own: Any, points: Mapping[str, Any]) -> Any:
    """Named points of a body or the ground, those of its joints among them."""
    if not isinstance(own, dict):
        return own  # which is an error of its own
    for name in points:
        if name in own:
            problem = f"is the position of joint {name!r}, which has at_m"
            raise InputError(f"{where}.points_m.{name}", own[name], problem, "remove it, or rename it")
    return {**own, **{name: list(at) for name, at in points.items()}}


def _joints(
    point: _Placed, joint: Mapping[str, Any], frames: Mapping[str, _Frame], joints: Mapping[str, Any]
) -> dict[str, Any]:
    """Entries of [joints.NAME] of a point: one for two links, NAME_1, NAME_2, ... for more, all with the first.

    Parameters
    ----------
    point : _Placed
        The point.
    joint : mapping
        Its table.
    frames : mapping
        Frames of the links.
    joints : mapping
        All joints of the file, for names that are taken.
    """
    kind = joint.get("type", "hinge")
    common = {"type": kind, "point": point.name, "to_point": point.name}
    if kind == "hinge":
        if "direction" in joint:
            problem, cure = "does not belong to type 'hinge'", 'remove it, or write type = "slot"'
            raise InputError(f"joints.{point.name}.direction", joint["direction"], problem, cure)
        first, *others = sorted(point.links, key=lambda link: link != GROUND)  # angles are those of moving links
        made = {}
        for k, link in enumerate(others, start=1):
            name = point.name if len(others) == 1 else f"{point.name}_{k}"
            if name != point.name and name in joints:
                problem = f"is the name of a hinge made of joints.{point.name}"
                raise InputError("joints", name, problem, "rename one")
            body, to = (link, first) if first == GROUND else (first, link)
            made[name] = {**common, "body": body, "to": to}
        return made
    body, to = point.links
    entry = {**common, "body": body, "to": to}
    way = joint.get("direction")
    if way is not None:
        if not (isinstance(way, list) and len(way) == 2 and all(_is_number(x) for x in way)):
            raise InputError(f"joints.{point.name}.direction", way, "must be two finite numbers", "write [x, y]")
        entry["direction"] = frames[to].turned((way[0], way[1])) if to in frames else way
    return {point.name: entry}
