"""Meshes of gears for other programs, through meshio: .msh (gmsh), .vtu (VTK), .inp (Abaqus, CalculiX). Millimetres.

Every gear becomes a group of second-order triangles with its name; its outline pieces (bore, root, flank_right,
flank_left, tip) become groups called ``<gear>_<piece>``, in the way that the format offers:

====== =============================================================================================================
.msh   physical groups, of triangles and of second-order lines
.vtu   cell data ``group`` (numbers) on triangles and lines, and point data of 0 and 1 with each group's name
.inp   element sets, node sets, and element surfaces for contact; element type CPE6 or CPS6 by plane state
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


def export_mesh(path: str | Path, parts: Mapping[str, MeshPart], *, plane: str = "strain") -> dict[str, int]:
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
    except ImportError as error:
        raise MissingLibraryError(f"meshio cannot be imported ({error}); install it: pip install meshio") from error

    offsets = np.cumsum([0, *(len(part.points) for part in parts.values())])
    flat = 1e3 * np.concatenate([part.points for part in parts.values()])
    points = np.column_stack([flat, np.zeros(len(flat))])
    bodies = {name: p.triangles + first for (name, p), first in zip(parts.items(), offsets, strict=False)}
    edges = {
        f"{name}_{boundary}": nodes + first
        for (name, p), first in zip(parts.items(), offsets, strict=False)
        for boundary, nodes in p.boundaries.items()
    }
    groups = bodies | edges
    cells = [("triangle6", nodes) for nodes in bodies.values()]
    cells += [("line3", nodes[:, [0, 2, 1]]) for nodes in edges.values()]
    tags = [np.full(len(nodes), number) for number, (_, nodes) in enumerate(cells, start=1)]
    mesh = meshio.Mesh(points, cells)
    if chosen == "gmsh22":
        mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        size = {name: 2 if name in bodies else 1 for name in groups}
        mesh.field_data = {name: np.array([n, size[name]]) for n, name in enumerate(groups, start=1)}
    else:
        mesh.cell_data = {"group": tags}
        for name, nodes in groups.items():
            mesh.point_data[name] = np.isin(np.arange(len(points)), nodes).astype(np.uint8)
    options = {"binary": False} if chosen == "gmsh22" else {}
    with whole_file(path) as temporary:
        mesh.write(temporary, file_format=chosen, **options)
    return group_sizes(parts)


def group_sizes(parts: Mapping[str, MeshPart]) -> dict[str, int]:
    """Group name -> number of its elements (bodies) or edges (boundaries)."""
    edges = {f"{name}_{key}": len(edge) for name, part in parts.items() for key, edge in part.boundaries.items()}
    return {name: len(part.triangles) for name, part in parts.items()} | edges


def abaqus_mesh(parts: Mapping[str, MeshPart], plane: str) -> list[str]:
    """Lines of an Abaqus mesh: nodes, elements with their sets, node sets, and element surfaces ``S_<group>``.

    CalculiX reads numbers of 20 characters at most.
    """
    points = 1e3 * np.concatenate([part.points for part in parts.values()])
    lines = ["*NODE, NSET=NALL", *(f"{i}, {x:.13e}, {y:.13e}, 0." for i, (x, y) in enumerate(points, start=1))]
    kind = "CPE6" if plane == "strain" else "CPS6"
    node = element = 1
    for name, part in parts.items():
        lines.append(f"*ELEMENT, ELSET={name}, TYPE={kind}")
        lines += [f"{element + e}, " + ", ".join(map(str, nodes + node)) for e, nodes in enumerate(part.triangles)]
        sides = ((side, e, int(n)) for side in range(3) for e, n in enumerate(part.triangles[:, 3 + side]))
        middle = {n: (element + e, side + 1) for side, e, n in sides}
        for boundary, edges in part.boundaries.items():
            lines += [f"*NSET, NSET={name}_{boundary}", *(f"{n + node}," for n in np.unique(edges))]
            lines.append(f"*SURFACE, NAME=S_{name}_{boundary}, TYPE=ELEMENT")
            lines += ["{}, S{}".format(*middle[int(n)]) for n in edges[:, 1]]
        node, element = node + len(part.points), element + len(part.triangles)
    return lines
