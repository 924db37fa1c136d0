"""Write meshes of gears for other programs, through meshio: .msh (gmsh), .vtu (VTK), .inp (Abaqus, CalculiX). Units are
mm.

Every gear becomes a group of second-order triangles with its name. Its outline pieces (bore, root, flank_right,
flank_left, tip) become groups called ``<gear>_<piece>``, in the form that the format has. Gears in space are wedges of
15 nodes, their outline pieces surfaces of four-sided faces.

====== =============================================================================================================
.msh   physical groups, of elements and of second-order lines or faces
.vtu   cell data ``group`` (numbers) on elements and lines or faces, and point data of 0 and 1 with each group's name
.inp   element sets, node sets, and element surfaces for contact; element type CPE6 or CPS6 by plane state, or C3D15
====== =============================================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError, MissingLibraryError
from ...base.files import whole_file
from ...base.typing import Array, IntArray

#: File suffix -> meshio's format. Version 2.2 of .msh keeps groups without CAD entities; newer ones do not.
FORMATS = {".msh": "gmsh22", ".vtu": "vtu", ".inp": "abaqus"}


@dataclass(frozen=True)
class MeshPart:
    """A meshed body in its place.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        m.
    triangles : ndarray, shape (m, 6)
        Second-order triangles: corners, then the nodes in the middle of edges 01, 12, 20.
    boundaries : dict of str to ndarray, shape (k, 3)
        Edges (start, middle, end node).
    """

    points: Array
    triangles: IntArray
    boundaries: Mapping[str, IntArray]


#: Nodes of a wedge's faces as four-sided faces of eight nodes, by the face's number in Abaqus.
SIDES = {
    3: (0, 1, 4, 3, 6, 13, 9, 12),
    4: (1, 2, 5, 4, 7, 14, 10, 13),
    5: (2, 0, 3, 5, 8, 12, 11, 14),
}


@dataclass(frozen=True)
class SolidPart:
    """A meshed body in space, in its place.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        m.
    wedges : ndarray, shape (m, 15)
        Second-order wedges: corners of one triangle and of the other, then the nodes in the middle of edges: of the
        first triangle, of the second, and in between.
    boundaries : dict of str to ndarray, shape (k, 2)
        Wedge and number of its face, see `SIDES`.
    """

    points: Array
    wedges: IntArray
    boundaries: Mapping[str, IntArray]


#: A body in the plane or in space.
Part = MeshPart | SolidPart


def elements_of(part: Part) -> tuple[str, IntArray]:
    """Return meshio's name of a body's elements, and their nodes."""
    return ("triangle6", part.triangles) if isinstance(part, MeshPart) else ("wedge15", part.wedges)


def boundary_elements(part: Part, name: str) -> tuple[str, IntArray]:
    """Return meshio's name of the lines or faces of a boundary, and their nodes: corners first."""
    boundary = part.boundaries[name]
    if isinstance(part, MeshPart):
        return "line3", boundary[:, [0, 2, 1]]
    faces = np.zeros((len(boundary), 8), dtype=np.int64)
    for number, nodes in SIDES.items():
        of_side = boundary[:, 1] == number
        faces[of_side] = part.wedges[boundary[of_side, 0]][:, nodes]
    return "quad8", faces


def format_of(path: str | Path) -> str:
    """meshio's format for a file name.

    Raises
    ------
    InputError
        For a suffix that is not known.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise InputError("--out", str(path), "must end in one of " + ", ".join(FORMATS), "choose one of these formats")
    return FORMATS[suffix]


def export_mesh(path: str | Path, parts: Mapping[str, Part], *, plane: str = "strain") -> dict[str, int]:
    """Write bodies with their named boundaries.

    Parameters
    ----------
    path
        File; the suffix decides the format.
    parts
        Name -> body.
    plane
        ``strain`` or ``stress``: element type in .inp files.

    Returns
    -------
    dict
        See `group_sizes`.
    """
    chosen = format_of(path)
    if chosen == "abaqus":
        with whole_file(path) as temporary:
            temporary.write_text("\n".join(abaqus_mesh(parts, plane)) + "\n", encoding="ascii", newline="\n")
        return group_sizes(parts)
    try:
        import meshio
        from meshio._mesh import topological_dimension
    except ImportError as error:
        raise MissingLibraryError(f"meshio cannot be imported ({error}); install it: pip install meshio") from error

    # meshio 5 writes these wedges in all of its formats, and lacks their dimension
    topological_dimension.setdefault("wedge15", 3)
    offsets = np.cumsum([0, *(len(part.points) for part in parts.values())])
    points = 1e3 * np.concatenate([np.pad(p.points, ((0, 0), (0, 3 - p.points.shape[1]))) for p in parts.values()])
    bodies, sides = {}, {}
    for (name, part), first in zip(parts.items(), offsets, strict=False):
        kind, nodes = elements_of(part)
        bodies[name] = kind, nodes + first
        for boundary in part.boundaries:
            kind, nodes = boundary_elements(part, boundary)
            sides[f"{name}_{boundary}"] = kind, nodes + first
    groups = bodies | sides
    cells = list(groups.values())
    tags = [np.full(len(nodes), number) for number, (_, nodes) in enumerate(cells, start=1)]
    mesh = meshio.Mesh(points, cells)
    if chosen == "gmsh22":
        mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        most = 3 if any(isinstance(part, SolidPart) for part in parts.values()) else 2
        size = {name: most if name in bodies else most - 1 for name in groups}
        mesh.field_data = {name: np.array([n, size[name]]) for n, name in enumerate(groups, start=1)}
    else:
        mesh.cell_data = {"group": tags}
        for name, (_, nodes) in groups.items():
            mesh.point_data[name] = np.isin(np.arange(len(points)), nodes).astype(np.uint8)
    options = {"binary": False} if chosen == "gmsh22" else {}
    with whole_file(path) as temporary:
        mesh.write(temporary, file_format=chosen, **options)
    return group_sizes(parts)


def group_sizes(parts: Mapping[str, Part]) -> dict[str, int]:
    """Group name -> number of its elements (bodies), edges or faces (boundaries)."""
    sides = {f"{name}_{key}": len(side) for name, part in parts.items() for key, side in part.boundaries.items()}
    return {name: len(elements_of(part)[1]) for name, part in parts.items()} | sides


def abaqus_mesh(parts: Mapping[str, Part], plane: str) -> list[str]:
    """Lines of an Abaqus mesh: nodes, elements with their sets, node sets, and element surfaces ``S_<group>``.

    CalculiX reads numbers of 20 characters at most.
    """
    lines, number = ["*NODE, NSET=NALL"], 1
    for part in parts.values():
        for point in 1e3 * part.points:
            x, y, *more = point.tolist()
            lines.append(f"{number}, {x:.13e}, {y:.13e}, " + (f"{more[0]:.13e}" if more else "0."))
            number += 1
    kinds = {"triangle6": "CPE6" if plane == "strain" else "CPS6", "wedge15": "C3D15"}
    node = element = 1
    for name, part in parts.items():
        kind, elements = elements_of(part)
        lines.append(f"*ELEMENT, ELSET={name}, TYPE={kinds[kind]}")
        lines += [f"{element + e}, " + ", ".join(map(str, nodes + node)) for e, nodes in enumerate(elements)]
        for boundary in part.boundaries:
            _, sides = boundary_elements(part, boundary)
            lines += [f"*NSET, NSET={name}_{boundary}", *(f"{n + node}," for n in np.unique(sides))]
            lines.append(f"*SURFACE, NAME=S_{name}_{boundary}, TYPE=ELEMENT")
            lines += [f"{element + e}, S{side}" for e, side in _element_sides(part, boundary)]
        node, element = node + len(part.points), element + len(elements)
    return lines


def _element_sides(part: Part, boundary: str) -> list[tuple[int, int]]:
    """Elements of a boundary and numbers of their sides in Abaqus."""
    if isinstance(part, SolidPart):
        return [(int(e), int(side)) for e, side in part.boundaries[boundary]]
    sides = ((side, e, int(n)) for side in range(3) for e, n in enumerate(part.triangles[:, 3 + side]))
    middle = {n: (e, side + 1) for side, e, n in sides}
    return [middle[int(n)] for n in part.boundaries[boundary][:, 1]]
