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
from typing import Any

import numpy as np

from ..errors import InputError, MissingLibraryError
from ..output.files import whole_file
from ..typing import Array, IntArray

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
        Group name -> number of its elements (bodies) or edges (boundaries).
    """
    chosen = format_of(path)
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
    with whole_file(path) as temporary:
        if chosen == "abaqus":
            _write_abaqus(meshio, temporary, points, bodies, edges, plane)
        else:
            cells = [("triangle6", nodes) for nodes in bodies.values()]
            cells += [("line3", nodes[:, [0, 2, 1]]) for nodes in edges.values()]
            groups = [*bodies, *edges]
            tags = [np.full(len(nodes), number) for number, (_, nodes) in enumerate(cells, start=1)]
            mesh = meshio.Mesh(points, cells)
            if chosen == "gmsh22":
                mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
                size = {name: 2 if name in bodies else 1 for name in groups}
                mesh.field_data = {name: np.array([n, size[name]]) for n, name in enumerate(groups, start=1)}
                mesh.write(temporary, file_format="gmsh22", binary=False)
            else:
                mesh.cell_data = {"group": tags}
                for name, nodes in {**bodies, **edges}.items():
                    on = np.zeros(len(points), dtype=np.uint8)
                    on[nodes.ravel()] = 1
                    mesh.point_data[name] = on
                mesh.write(temporary, file_format="vtu")
    return {name: len(nodes) for name, nodes in {**bodies, **edges}.items()}


def _write_abaqus(
    meshio: Any, path: Path, points: Array, bodies: dict[str, IntArray], edges: dict[str, IntArray], plane: str
) -> None:
    """meshio writes nodes, elements and sets; element type and surfaces (which it does not know) are put in here."""
    blocks = [("triangle6", nodes) for nodes in bodies.values()]
    sets = {
        name: [
            np.arange(len(nodes)) if other == name else np.zeros(0, dtype=np.int64) for other, nodes in bodies.items()
        ]
        for name in bodies
    }
    mesh = meshio.Mesh(points, blocks, cell_sets=sets)
    mesh.point_sets = {name: np.unique(nodes) for name, nodes in edges.items()}
    mesh.write(path, file_format="abaqus")
    lines = path.read_text(encoding="utf-8").splitlines()
    kind = "CPE6" if plane == "strain" else "CPS6"
    lines = [f"*ELEMENT, TYPE={kind}" if line.startswith("*ELEMENT") else line for line in lines]
    triangles = np.concatenate(list(bodies.values()))
    middle = {int(node): (e, side) for side in range(3) for e, node in enumerate(triangles[:, 3 + side])}
    for name, nodes in edges.items():
        lines.append(f"*SURFACE, NAME=S_{name}, TYPE=ELEMENT")
        lines += [f"{e + 1}, S{side + 1}" for e, side in (middle[int(node)] for node in nodes[:, 1])]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
