r"""Rigid attachments: all nodes of a bore follow six coordinates of a reference point.

A node at x moves by ``u = t + theta x (x - p)`` with p the reference point. Point and axis come from the geometry. They
are never taken from the mean of the nodes, which an uneven mesh pulls off the axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from ...base.errors import InputError
from ...base.shown import percent
from ...base.typing import Array, BoolArray, IntArray

Vector = tuple[float, float, float]

#: Nodes up to this part of the radius outside a bore still belong to it (meshes written with few digits).
RADIUS_TOLERANCE = 1e-3
#: The same for planes and ends of ranges, in parts of the body's size.
PLACE_TOLERANCE = 1e-6
#: Spread of the distances from the axis, in parts of the radius, above which nodes are no bore.
OUT_OF_ROUND = 0.05
#: Gap between neighbouring nodes round the axis (rad) above which a bore is open: six edges a circle leave 60 deg.
OPEN = math.radians(75.0)


@dataclass(frozen=True)
class Bore:
    """A cylindrical bore.

    Parameters
    ----------
    point
        A point on the axis (m).
    direction
        Along the axis; any length.
    radius
        Radius (m).
    along
        Where the bore begins and ends along the axis, counted from `point` (m); ``None`` for all that the mesh has.
    name
        Name of the attachment; by default its number, counted from 1.
    """

    point: Vector
    direction: Vector
    radius: float
    along: tuple[float, float] | None = None
    name: str = ""


@dataclass(frozen=True)
class Plane:
    """A plane, to pick the nodes that lie on it: a point on it (m) and its normal."""

    point: Vector
    normal: Vector


@dataclass(frozen=True, eq=False)
class Attachment:
    """Nodes that move as one rigid thing.

    Parameters
    ----------
    name
        Its name.
    point
        Reference point (m).
    axis
        Unit vector, for a bore along its axis.
    nodes : (k,)
        Node numbers, three at least and not on one line.
    """

    name: str
    point: Array
    axis: Array
    nodes: IntArray


def bore_attachment(
    bore: Bore | Sequence[Any], number: int, nodes: Array, corners: BoolArray | None = None
) -> tuple[Attachment, tuple[str, ...]]:
    """Attach all nodes at or inside the radius of a bore, within its range; also return notes for the user.

    The reference point is the point of the axis in the middle of the range.

    Parameters
    ----------
    bore
        The bore, or the values of a `Bore`.
    number
        Its number, counted from 1, which is its name where it has none.
    nodes : (n, 3)
        Nodes of the mesh (m).
    corners : (n,)
        Which of them are corners of elements: these should lie on the cylinder; midside nodes of straight edges lie on
        chords. By default all.

    Raises
    ------
    InputError
        Not a bore; no nodes there; nodes that are far from lying on a cylinder.
    """
    made = bore if isinstance(bore, Bore) else _bore(bore, number)
    name = made.name or str(number)
    field = f"bores[{name}]"
    point, direction = _vector(f"{field}.point", made.point), _vector(f"{field}.direction", made.direction)
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        raise InputError(f"{field}.direction", made.direction, "must not be zero", "give the direction of the axis")
    axis = direction / length
    if not (made.radius > 0.0 and math.isfinite(made.radius)):
        raise InputError(f"{field}.radius", made.radius, "must be > 0", "give it in metres")
    first, last = (-math.inf, math.inf) if made.along is None else (float(made.along[0]), float(made.along[1]))
    if not first < last:
        raise InputError(f"{field}.along", made.along, "must be (begin, end) with begin < end", "swap them")
    slack = PLACE_TOLERANCE * float(np.ptp(nodes, axis=0).max())
    offset = nodes - point
    height = offset @ axis
    radial = np.linalg.norm(offset - np.outer(height, axis), axis=1)
    within = (height >= first - slack) & (height <= last + slack)
    chosen = np.flatnonzero(within & (radial <= made.radius * (1.0 + RADIUS_TOLERANCE)))
    if not len(chosen):
        near = radial <= made.radius * (1.0 + RADIUS_TOLERANCE)
        if near.any():
            reach = f"{1e3 * height[near].min():.6g} and {1e3 * height[near].max():.6g} mm"
            problem = (
                f"no node lies in its range from {1e3 * first:.6g} to {1e3 * last:.6g} mm along the axis, counted from "
                f"its point: those within its radius lie between {reach}"
            )
        elif within.any():
            nearest = f"the nearest node there is {1e3 * radial[within].min():.6g} mm from the axis"
            problem = f"no node lies within {1e3 * made.radius:g} mm of the axis: {nearest}"
        else:
            reach = f"the mesh lies between {1e3 * height.min():.6g} and {1e3 * height.max():.6g} mm along the axis"
            problem = f"no node lies within {1e3 * made.radius:g} mm of the axis: {reach}, counted from its point"
        raise InputError(field, None, problem, "check point, direction, radius and range (metres)")
    deep = radial[chosen] < 0.8 * made.radius  # nodes on chords of six edges a circle stand at 0.87 of it
    if deep.any():
        problem = (
            f"{int(deep.sum())} of its {len(chosen)} nodes lie deep inside the radius (the nearest "
            f"{radial[chosen].min():.6g} m from the axis): that is material, not a bore"
        )
        raise InputError(f"{field}.radius", made.radius, problem, "give the bore's own radius in metres, and its axis")
    known = chosen if corners is None or not corners[chosen].any() else chosen[corners[chosen]]
    notes = cylinder_notes(field, name, offset[known], axis, of_radius=made.radius)
    begin, end = float(height[chosen].min()), float(height[chosen].max())
    if not (math.isfinite(first) and math.isfinite(last)):
        first, last = max(first, begin), min(last, end)
    elif max(begin - first, last - end) > 0.01 * (last - first) + slack:
        notes += (
            f"bore {name}: its nodes reach from {begin:.6g} to {end:.6g} m along the axis, the given range from "
            f"{first:.6g} to {last:.6g} m; the reference point is the middle of the given range",
        )
    reference = point + 0.5 * (first + last) * axis
    return Attachment(name, reference, axis, chosen), notes


def cylinder_notes(field: str, name: str, offset: Array, axis: Array, *, of_radius: float) -> tuple[str, ...]:
    """Say where nodes differ from a cylinder that has a given radius, is closed round its axis, and has a length.

    Parameters
    ----------
    field, name
        Key and name of the bore, for messages.
    offset : (k, 3)
        Places of the nodes from a point of the axis (m).
    axis : (3,)
        Unit vector.
    of_radius
        Radius that they should have (m).

    Raises
    ------
    InputError
        When they are out of round by more than `OUT_OF_ROUND`.
    """
    height, across = offset @ axis, offset @ np.linalg.svd(axis[None])[2][1:].T
    radial = np.linalg.norm(across, axis=1)
    least, most = float(radial.min()), float(radial.max())
    between = f"its {len(radial)} nodes lie {1e3 * least:.4g} to {1e3 * most:.4g} mm from the axis"
    notes = []
    if most - least > OUT_OF_ROUND * of_radius:
        problem = (
            f"{between}: out of round by {percent((most - least) / of_radius)} of the radius, more than "
            f"{100.0 * OUT_OF_ROUND:g} %"
        )
        cure = (
            "check axis, point and radius, give each wall a bore of its own (range), or attach the nodes of a group to "
            "a point (point_mm beside group), whatever their shape"
        )
        raise InputError(field, name, problem, cure)
    if most - least > 2.0 * RADIUS_TOLERANCE * of_radius:
        why = _why_not_round(across, radial, height)
        notes.append(f"bore {name}: {between}{why}; nodes that lie further out than its radius are not attached")
    elif abs(0.5 * (least + most) - of_radius) > 2.0 * RADIUS_TOLERANCE * of_radius:
        notes.append(f"bore {name}: {between}, its radius is {1e3 * of_radius:.4g} mm")
    gap, length = _largest_gap(across), float(np.ptp(height))
    if gap > OPEN:
        notes.append(
            f"bore {name}: its nodes leave {math.degrees(gap):.0f} of 360 deg round the axis open; if it is a whole "
            "bore, check its point and radius"
        )
    if length < RADIUS_TOLERANCE * of_radius:
        notes.append(
            f"bore {name}: its nodes are one ring without length; a bearing's width is held where the range or group "
            "has nodes over all of it"
        )
    return tuple(notes)


def _why_not_round(across: Array, radial: Array, height: Array) -> str:
    """Parts of the distances from the axis that are eccentric, tilted, conical and oval: the largest, in words."""
    angle = np.arctan2(across[:, 1], across[:, 0])
    span = float(np.ptp(height))
    along = (height - height.mean()) / span if span > RADIUS_TOLERANCE * radial.mean() else np.zeros(len(height))
    waves = [np.cos(angle), np.sin(angle), along * np.cos(angle), along * np.sin(angle), along]
    waves += [np.cos(2.0 * angle), np.sin(2.0 * angle)]
    fit = np.linalg.lstsq(np.column_stack([np.ones(len(angle)), *waves]), radial, rcond=None)[0]
    rest = radial - np.column_stack([np.ones(len(angle)), *waves]) @ fit
    amounts = {
        "off the axis by": math.hypot(fit[1], fit[2]),
        "tilted over its length by": math.hypot(fit[3], fit[4]),
        "wider at one end by": abs(float(fit[5])),
        "oval by": 2.0 * math.hypot(fit[6], fit[7]),
        "scattered by": 2.0 * float(np.sqrt(np.mean(rest**2))),
    }
    word = max(amounts, key=lambda key: amounts[key])
    return f", {word} {1e3 * amounts[word]:.2g} mm"


def _largest_gap(across: Array) -> float:
    """Largest angle between neighbouring nodes round the axis (rad)."""
    angle = np.sort(np.arctan2(across[:, 1], across[:, 0]))
    return float(np.diff(np.append(angle, angle[0] + 2.0 * math.pi)).max())


def plane_nodes(plane: Plane, nodes: Array) -> IntArray:
    """Numbers of the nodes that lie on a plane."""
    normal = _vector("fixed.normal", plane.normal)
    length = float(np.linalg.norm(normal))
    if length == 0.0:
        raise InputError("fixed.normal", plane.normal, "must not be zero", "give the normal of the plane")
    distance = (nodes - _vector("fixed.point", plane.point)) @ (normal / length)
    found = np.flatnonzero(np.abs(distance) <= PLACE_TOLERANCE * float(np.ptp(nodes, axis=0).max()))
    if not len(found):
        problem = f"no node lies on this plane; the nearest is {np.abs(distance).min():.6g} m away"
        raise InputError("fixed", None, problem, "move the plane, give node numbers, or fixed=None for a free body")
    return found


def check_attachments(attachments: Sequence[Attachment], fixed: IntArray, nodes: Array) -> None:
    """Names differ, nodes exist, none is claimed twice, none lies on a line.

    Raises
    ------
    InputError
        With the names of those that clash.
    """
    owner = np.full(len(nodes), -1)
    held = np.zeros(len(nodes), dtype=bool)
    held[fixed] = True
    for number, attachment in enumerate(attachments):
        field, chosen = f"attachment {attachment.name!r}", np.asarray(attachment.nodes)
        if attachment.name in [other.name for other in attachments[:number]]:
            raise InputError(field, None, "two attachments have this name", "rename one")
        if not len(chosen):
            raise InputError(field, None, "has no nodes", "check where it should be")
        if chosen.min() < 0 or chosen.max() >= len(nodes):
            raise InputError(field, None, f"has node numbers outside 0..{len(nodes) - 1}", "they count from 0")
        spread = nodes[chosen] - nodes[chosen].mean(axis=0)
        singular = np.linalg.svd(spread, compute_uv=False) if len(chosen) > 1 else np.zeros(3)
        if len(chosen) < 3 or singular[1] < 1e-6 * singular[0]:
            problem = f"its {len(chosen)} nodes lie on one line and cannot carry a rotation about it"
            raise InputError(field, None, problem, "give three nodes or more that are not in line")
        if held[chosen].any():
            raise InputError(field, None, f"{int(held[chosen].sum())} of its nodes are fixed", "free them or drop them")
        if (owner[chosen] >= 0).any():
            other = attachments[int(owner[chosen][owner[chosen] >= 0][0])].name
            raise InputError(field, None, f"overlaps attachment {other!r}: they share nodes", "separate them")
        owner[chosen] = number


def interface_matrix(attachments: Sequence[Attachment], nodes: Array) -> sparse.csc_array:
    """(3 n, 6 a) displacement of all nodes for unit attachment coordinates; rows of other nodes are empty."""
    blocks = [sparse.csc_array((3 * len(nodes), 0))]
    for attachment in attachments:
        moved = np.zeros((len(nodes), 18))
        chosen = np.asarray(attachment.nodes, dtype=np.int64)
        moved[chosen] = rigid_motions(nodes[chosen] - attachment.point).reshape(-1, 18)
        blocks.append(sparse.csc_array(moved.reshape(-1, 6)))
    return sparse.csc_array(sparse.hstack(blocks, format="csc"))


def rigid_motions(nodes: Array) -> Array:
    """(3 n, 6) nodal displacement for unit translations and small rotations about the origin."""
    motions = np.zeros((len(nodes), 3, 6))
    motions[:, range(3), range(3)] = 1.0
    for axis in range(3):
        unit = np.zeros(3)
        unit[axis] = 1.0
        motions[:, :, 3 + axis] = np.cross(unit, nodes)
    return motions.reshape(-1, 6)


def _bore(given: Sequence[Any], number: int) -> Bore:
    if len(given) not in (3, 4):
        problem = "must be (axis point, axis direction, radius, range along the axis)"
        raise InputError(f"bores[{number}]", None, problem, "or a Bore")
    return Bore(*given)


def _vector(field: str, value: Any) -> Array:
    vector = np.asarray(value, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise InputError(field, value, "must be three finite numbers", "x, y, z")
    return vector
