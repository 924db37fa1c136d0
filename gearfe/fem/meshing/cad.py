"""Second-order tetrahedra of a CAD file (STEP, IGES, BREP), by gmsh.

gmsh meshes the faces first, each in its own plane of parameters. Where two faces are closer than the length of an
element (thin walls, rings around bores), triangles of one can cross those of the other. Then no volume can be meshed.
Which triangles cross depends on the algorithm, so that of the faces is exchanged before a size is given up.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.progress import stage
from ...base.typing import Array, IntArray
from .session import gmsh_session

#: Formats of CAD programs, which have no mesh yet.
CAD = (".step", ".stp", ".iges", ".igs", ".brep")
#: gmsh's surface algorithms in the order in which they are tried: number (`Mesh.Algorithm`) and name.
ALGORITHMS = {6: "Frontal-Delaunay", 5: "Delaunay", 1: "MeshAdapt"}
#: gmsh's type of tetrahedra with ten nodes.
_TETRA10 = 11
#: Elements on a full circle.
ROUND = 12


class CadMesh(NamedTuple):
    """Mesh of a CAD file.

    Attributes
    ----------
    nodes : ndarray, shape (n, 3)
        In mm.
    tets : ndarray, shape (m, 10)
        Node numbers from 0, midside nodes in gmsh's order.
    groups : dict
        Number of each surface in gmsh, as text -> its nodes.
    notes
        Remarks on the meshing, for the user.
    """

    nodes: Array
    tets: IntArray
    groups: dict[str, IntArray]
    notes: tuple[str, ...]


def mesh_cad_file(path: Path, field: str, size: float) -> CadMesh:
    """Mesh the solid of a CAD file.

    Parameters
    ----------
    path
        File of a format in `CAD`.
    field
        Key that named it, for messages.
    size
        Largest edge of the elements (mm).

    Raises
    ------
    InputError
        When it cannot be read, has no solid, or no algorithm meshes it.
    """
    problems: list[str] = []
    for number, name in ALGORITHMS.items():
        # a session each: after facets that cross, gmsh meshes no volume any more, whatever the model
        with gmsh_session("housing") as gmsh:
            _import(gmsh, path, field)
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)
            gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", ROUND)
            with stage(f"meshing {path.name} (surfaces by {name})"):
                problem = _meshed_by(gmsh, number)
            if problem is None:
                notes = () if not problems else (_fallback_note(name, problems),)
                return CadMesh(*_read_back(gmsh.model), notes)
            shortest = min(float(gmsh.model.occ.getMass(1, tag)) for _, tag in gmsh.model.getEntities(1))
        problems.append(f"{name}: {problem}")
    finer = ", ".join(f"{part * size:.3g}" for part in (0.7, 0.5, 0.35))
    cure = (
        f"another size_mm ({finer}) often meshes; if none does, look at the named surfaces in the CAD program: faces "
        f"that cross or nearly touch, edges without length (the shortest edge here has {shortest:.3g} mm)"
    )
    problem = f"cannot be meshed with size_mm = {size:g} by any of gmsh's surface algorithms ({'; '.join(problems)})"
    raise InputError(field, path.name, problem, cure)


def _import(gmsh: Any, path: Path, field: str) -> None:
    """Read the solid into the model of a session."""
    gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    try:
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
    except Exception as error:
        raise InputError(field, path.name, f"cannot be read ({error})", "export it again as STEP") from None
    if not gmsh.model.getEntities(3):
        raise InputError(field, path.name, "has no solid, only surfaces or curves", "export the solid body")


def _meshed_by(gmsh: Any, algorithm: int) -> str | None:
    """Mesh with a surface algorithm; the reason why there is no mesh, or None."""
    mesh = gmsh.model.mesh
    mesh.clear()
    gmsh.option.setNumber("Mesh.Algorithm", algorithm)
    try:
        mesh.generate(3)
        mesh.setOrder(2)
    except Exception as error:  # gmsh raises bare Exception with its log line
        return str(error).strip() or "no reason given"
    empty = [str(tag) for _, tag in gmsh.model.getEntities(3) if not len(mesh.getElementsByType(_TETRA10, tag)[0])]
    return f"no elements in volume {', '.join(empty)}" if empty else None


def _fallback_note(name: str, problems: list[str]) -> str:
    return f"surfaces were meshed by gmsh's algorithm {name}, because others gave no sound mesh ({'; '.join(problems)})"


def _read_back(model: Any) -> tuple[Array, IntArray, dict[str, IntArray]]:
    tags, points, _ = model.mesh.getNodes()
    number = np.full(int(tags.max()) + 1, -1)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    _, cells = model.mesh.getElementsByType(_TETRA10)
    groups = {
        str(tag): number[model.mesh.getNodes(2, tag, includeBoundary=True)[0].astype(np.int64)]
        for _, tag in model.getEntities(2)
    }
    return points.reshape(-1, 3), number[cells.astype(np.int64)].reshape(-1, 10), groups
