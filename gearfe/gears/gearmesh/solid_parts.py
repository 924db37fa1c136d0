r"""Meshes in space of gears whose load varies along the face width, with their modifications: for other programs.

A gear is its section, turned by :math:`\kappa z` along the axis, in layers of wedges. Its driving flanks have the
material h(s, z) of all their modifications. Nodes of the flanks are displaced by it along the normal of the section,
nodes below them by less, and by zero at the depth `FADED`. No element is inverted by this. The tilts of the axes
displace the wheel's sections, as in `gearfe.gears.width.flanks`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from ...output.exchange.mesh_export import MeshPart, SolidPart
from ..geometry.modifications import ends_of
from ..teeth.tooth_sector import SectorMesh, web_triangles
from ..teeth.whole_gear import WholeGear
from ..width import WideFlanks, WideMesh

#: Least thickness of a layer beside the end of a web (modules).
LEAST_LAYER = 0.05
#: Depth below a flank at which nothing is left of its modifications (modules), at most half of the tooth's thickness.
FADED = 0.6


@dataclass(frozen=True)
class FlankFeet:
    """Where the nodes of a section have their feet on the driving flanks.

    Attributes
    ----------
    tooth : ndarray of int, shape (n,)
        Numbers of the teeth.
    roll : ndarray, shape (n,)
        Roll lengths of the feet, within form and tip circle (m).
    shift : ndarray, shape (n, 2)
        Outward normals times the share of the modification that the node takes (-).
    """

    tooth: IntArray
    roll: Array
    shift: Array


def flank_feet(section: WholeGear | SectorMesh, mesh: WideMesh, gear: int) -> FlankFeet:
    """Return the feet of all nodes of a section, a gear's in the axes of its tooth 0 or a sector's.

    Parameters
    ----------
    section : WholeGear or SectorMesh
        The section.
    mesh : WideMesh
        The gears.
    gear : int
        0 for the pinion, 1 for the wheel.
    """
    gear_ = mesh.gears[gear]
    n, depth = len(section.points), FADED * gear_.module
    feet = FlankFeet(np.zeros(n, dtype=np.int64), np.full(n, ends_of(gear_)[0]), np.zeros((n, 2)))
    if isinstance(section, SectorMesh):
        teeth = [(0, section.contact_edges(), np.arange(n))]
    else:
        parts = zip(section.contact, section.numbers, strict=True)
        teeth = [(k, edges, numbers) for k, (edges, numbers) in enumerate(parts)]
    pitch = 2.0 * math.pi / gear_.teeth
    for tooth, edges, numbers in teeth:
        chain = section.points[np.append(edges[:, :2].ravel(), edges[-1, 2])] @ np.array([1, 1j])
        nodes = section.points[numbers] @ np.array([1, 1j])
        distance, foot, normal = _nearest(nodes, chain)
        middle = np.exp(1j * pitch * tooth)
        other = _nearest(nodes, (chain / middle).conj() * middle)[0]  # of the tooth's back
        share = distance / np.maximum(distance + other, 1e-300)
        left = np.clip(1.0 - np.maximum(distance / depth, 2.0 * share), 0.0, 1.0)
        kept = left > np.abs(feet.shift[numbers]).max(axis=1)
        at, form, tip = numbers[kept], *ends_of(gear_)
        roll = np.sqrt(np.maximum(np.abs(foot[kept]) ** 2 - gear_.base_radius**2, 0.0))
        feet.tooth[at], feet.roll[at] = tooth, np.clip(roll, form, tip)
        feet.shift[at] = np.stack([normal.real, normal.imag], axis=1)[kept] * left[kept, None]
    return feet


def _nearest(nodes: ComplexArray, chain: ComplexArray) -> tuple[Array, ComplexArray, ComplexArray]:
    """Distances of nodes from a chain of straight pieces, their feet, and normals to the left of the chain there."""
    start, along = chain[:-1], np.diff(chain)
    relative = nodes[:, None] - start
    share = np.clip((relative * along.conj()).real / np.abs(along) ** 2, 0.0, 1.0)
    distance = np.abs(relative - share * along)
    row, nearest = np.arange(len(nodes)), distance.argmin(axis=1)
    foot = start[nearest] + share[row, nearest] * along[nearest]
    return distance[row, nearest], foot, 1j * along[nearest] / np.abs(along[nearest])


def modified(feet: FlankFeet, mesh: WideMesh, flanks: WideFlanks, gear: int) -> Callable[[float], Array]:
    """Return what gives the displacements (m) of a section's nodes by the modifications at z (m), shape (n, 2).

    Parameters
    ----------
    feet : FlankFeet
        Feet of the nodes.
    mesh : WideMesh
        The gears.
    flanks : WideFlanks
        Their flanks.
    gear : int
        0 for the pinion, 1 for the wheel.
    """
    own, face = flanks.profiles[gear], mesh.faces[gear]
    profile = own.profiles[own.profile[0]]
    plain = own.turn_of(feet.tooth) * mesh.gears[gear].base_radius
    if profile is not None:
        plain = plain + profile.at(feet.roll)[0]

    def at(z: float) -> Array:
        material = plain + flanks.material(gear, feet.roll, np.full(len(feet.roll), z), feet.tooth, face)
        return np.asarray(material[:, None] * feet.shift)

    return at


def tilted(mesh: WideMesh, flanks: WideFlanks, gear: int) -> Callable[[float], complex]:
    """Return what gives the displacement (m) of a gear's section at z (m) by the tilts of the axes: x + i y."""
    forward = np.exp(1j * (0.5 * math.pi - mesh.sections.working_pressure_angle))
    tilt, middle = flanks.misalignment, 0.5 * sum(mesh.zone)
    rate = complex((-tilt.in_plane + 1j * tilt.across) * forward) if gear == 1 else 0j
    return lambda z: rate * (z - middle)


def solid_part(
    section: MeshPart,
    levels: Array,
    place: Callable[[float], tuple[complex, complex]],
    moved: Callable[[float], Array] | None = None,
    solid: Callable[[float], BoolArray] | None = None,
) -> SolidPart:
    """Return the wedges of a section between levels along the axis.

    Parameters
    ----------
    section : MeshPart
        n nodes and m elements; edges of its boundaries from any side.
    levels : ndarray, shape (l + 1,)
        Rising ends of the layers (m).
    place : callable
        Unit complex number by which the section is turned at z (m), and displacement x + i y (m).
    moved : callable, optional
        Displacements of the nodes at z in the section's axes (m), shape (n, 2).
    solid : callable, optional
        Elements of the section that have material at z (m), shape (m,); all if not given.
    """
    plane = section.points @ np.array([1, 1j])
    corners = np.zeros(len(plane), dtype=bool)
    corners[section.triangles[:, :3]] = True
    heights = np.interp(np.arange(2 * len(levels) - 1) / 2, np.arange(len(levels)), levels)
    numbers = np.full((len(heights), len(plane)), -1)
    points, count = [], 0
    for i, z in enumerate(heights.tolist()):
        used = np.flatnonzero(corners) if i % 2 else np.arange(len(plane))
        numbers[i, used] = count + np.arange(len(used))
        count += len(used)
        turn, centre = place(z)
        at = plane if moved is None else plane + moved(z) @ np.array([1, 1j])
        at = (at * turn + centre)[used]
        points.append(np.stack([at.real, at.imag, np.full(len(used), z)], axis=1))
    corner, edge = section.triangles[:, :3], section.triangles[:, 3:]
    layers = [
        np.concatenate([numbers[i][corner], numbers[i + 2][corner], numbers[i][edge], numbers[i + 2][edge],
                        numbers[i + 1][corner]], axis=1)
        for i in range(0, len(heights) - 2, 2)
    ]  # fmt: skip
    behind = np.full(len(plane), -1)  # of nodes in the middle of an edge: element times three plus side
    behind[edge] = 3 * np.arange(len(edge))[:, None] + np.arange(3)
    boundaries = {}
    for name, edges in section.boundaries.items():
        element, side = np.divmod(behind[edges[:, 1]], 3)
        rows = [np.stack([element + i * len(edge), side + 3], axis=1) for i in range(len(layers))]
        boundaries[name] = np.concatenate(rows)
    part = SolidPart(np.concatenate(points), np.concatenate(layers), boundaries)
    if solid is None:
        return part
    return _part_of(part, np.concatenate([solid(0.5 * (a + b)) for a, b in itertools.pairwise(levels.tolist())]))


def _part_of(part: SolidPart, kept: BoolArray) -> SolidPart:
    """Return some of the elements, with their nodes and their faces on boundaries."""
    nodes, wedges = np.unique(part.wedges[kept], return_inverse=True)
    number = np.cumsum(kept) - 1
    boundaries = {
        name: np.stack([number[rows[:, 0]], rows[:, 1]], axis=1)[kept[rows[:, 0]]]
        for name, rows in part.boundaries.items()
    }
    return SolidPart(part.points[nodes], wedges.reshape(-1, part.wedges.shape[1]), boundaries)


def graded_levels(face: tuple[float, float], layers: int) -> Array:
    """Return the ends of layers over a face (m), shape (layers + 1,), closer to each other towards its ends."""
    low, high = face
    return 0.5 * (low + high) + 0.5 * (high - low) * np.sin(0.5 * math.pi * np.linspace(-1.0, 1.0, layers + 1))


def gear_solid(
    section: WholeGear | SectorMesh,
    mesh: WideMesh,
    flanks: WideFlanks,
    gear: int,
    place: tuple[float, float],
    levels: Array,
) -> SolidPart:
    """Return one gear in space, with its modifications and the tilt of its axis.

    Parameters
    ----------
    section : WholeGear or SectorMesh
        Mesh of its section in the axes of its tooth 0.
    mesh : WideMesh
        The gears.
    flanks : WideFlanks
        Their flanks.
    gear : int
        0 for the pinion, 1 for the wheel.
    place : pair of float
        Pinion angle, and twist of the wheel from where unmodified flanks touch (rad).
    levels : ndarray, shape (l + 1,)
        Ends of the layers (m).
    """
    pair = mesh.sections
    first = float(pair.tooth_angle(gear, 0, place[0], pair.contact_twist + place[1]))
    tilt = tilted(mesh, flanks, gear)
    centre = gear * pair.wheel_centre

    def at(z: float) -> tuple[complex, complex]:
        return complex(np.exp(1j * (first + mesh.turns[gear] * z))), centre + tilt(z)

    part = section if isinstance(section, MeshPart) else MeshPart(
        section.points, section.triangles, {**section.boundaries, "contact": section.contact_edges()}
    )  # fmt: skip
    moved = modified(flank_feet(section, mesh, gear), mesh, flanks, gear)
    web, ends = mesh.webs[gear], mesh.web_ends(gear)
    if web is None or ends is None:
        return solid_part(part, levels, at, moved)
    narrow = web_triangles(part.points, part.triangles, web)
    low, high = ends
    between = levels[np.abs(levels[:, None] - ends).min(axis=1) > LEAST_LAYER * mesh.module]
    heights = np.unique([*mesh.faces[gear], *between.tolist(), *ends])
    return solid_part(part, heights, at, moved, lambda z: ~narrow | (low < z < high))
