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

from ..errors import InputError
from ..typing import Array, IntArray

Vector = tuple[float, float, float]

#: Nodes up to this part of the radius outside a bore still belong to it (meshes written with few digits).
RADIUS_TOLERANCE = 1e-3
#: The same for planes and ends of ranges, in parts of the body's size.
PLACE_TOLERANCE = 1e-6


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


def bore_attachment(bore: Bore | Sequence[Any], number: int, nodes: Array) -> tuple[Attachment, tuple[str, ...]]:
    """Attachment of a bore: all nodes at or inside its radius, within its range. Also notes for the user.

    The reference point is the point of the axis in the middle of the range.

    Raises
    ------
    InputError
        Not a bore; no nodes there.
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
    begin, end = float(height[chosen].min()), float(height[chosen].max())
    notes: tuple[str, ...] = ()
    if not (math.isfinite(first) and math.isfinite(last)):
        first, last = max(first, begin), min(last, end)
    elif max(begin - first, last - end) > 0.01 * (last - first) + slack:
        notes = (
            f"bore {name}: its nodes reach from {begin:.6g} to {end:.6g} m along the axis, the given range from "
            f"{first:.6g} to {last:.6g} m; the reference point is the middle of the given range",
        )
    reference = point + 0.5 * (first + last) * axis
    return Attachment(name, reference, axis, chosen), notes


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
