"""Tetrahedra and named groups of a mesh file, as far as meshio reads its format; CAD files are meshed by gmsh."""

from __future__ import annotations

import contextlib
import io
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, nearest
from ..files import read_text
from ..typing import Array, IntArray
from .nastran import read_bulk_mesh
from .session import gmsh_session

#: Formats of CAD programs, which have no mesh yet.
CAD = (".step", ".stp", ".iges", ".igs", ".brep")
#: Formats of which gmsh reads more than meshio; of Nastran, which both misread; and surfaces, which have no inside.
BY_GMSH = (".unv", ".med", ".mesh")
NASTRAN = (".bdf", ".nas", ".fem")
SURFACES = (".stl", ".ply", ".off", ".obj", ".wkt", ".svg")
#: Arrays of whole numbers by which formats number groups without a name.
NUMBERED = ("gmsh:physical", "medit:ref", "nastran:ref", "ref", "cell_tags", "point_tags", "avsucd:material")
#: Triangles of .inp files, as gmsh and CalculiX write them beside the tetrahedra, that meshio's reader does not name.
TRIANGLES = {"CPS6": "triangle6", "CPE3": "triangle", "S6": "triangle6", "M3D3": "triangle", "M3D6": "triangle6"}
INSIDE = "mesh its inside: give the CAD model (.step), or what gmsh FILE -3 -order 2 makes of it"
#: The same tetrahedron with its second and third corner exchanged.
MIRRORED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
TETRAHEDRA = ("tetra10", "tetra")
#: Groups that a message lists.
LISTED = 20


class MeshFile(NamedTuple):
    """A mesh as a file has it.

    Attributes
    ----------
    nodes : ndarray, shape (n, 3)
        In the file's unit, as read; in m for `group`.
    tets : ndarray, shape (m, 4) or (m, 10)
        Node numbers from 0.
    groups : dict
        Name, or number as text, of each group of nodes, faces or elements -> its nodes.
    """

    nodes: Array
    tets: IntArray
    groups: dict[str, IntArray]

    def group(self, name: str, field: str) -> IntArray:
        """Nodes of a group that belong to tetrahedra.

        Raises
        ------
        InputError
            Where there is none of this name, or none of its nodes belongs to an element.
        """
        if name not in self.groups:
            listed = (
                ", ".join(itertools.starmap(self._text_of, itertools.islice(self.groups.items(), LISTED))) or "none"
            )
            more = f" and {len(self.groups) - LISTED} more" if len(self.groups) > LISTED else ""
            problem = f"there is no such group in the mesh; it has: {listed}{more}"
            cure = "name groups in the mesher, or tell the place by point_mm in place of group"
            raise InputError(field, name, problem, nearest(name, self.groups) or cure)
        nodes = np.intersect1d(self.groups[name], self.tets)
        if not len(nodes):
            raise InputError(field, name, "none of its nodes belongs to a tetrahedron", "take another group")
        return nodes

    def _text_of(self, name: str, nodes: IntArray) -> str:
        """A group; one that has a number in place of a name with its place."""
        if not name.isdigit():
            return name
        low, high = self.nodes[nodes].min(axis=0), self.nodes[nodes].max(axis=0)
        middle = ", ".join(f"{x:.4g}" for x in (500.0 * (low + high)).round(6) + 0.0)
        return f"{name} (about {middle} mm)"


def read_mesh_file(path: str | Path, field: str, size: float) -> MeshFile:
    """Read a mesh.

    Parameters
    ----------
    path
        File; its suffix gives the format.
    field
        Key that named it, for messages.
    size
        Largest edge of the elements of a CAD file (mm).

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, or has no tetrahedra.
    """
    path = Path(path)
    if not path.is_file():
        problem = "is a folder, not a file" if path.is_dir() else "there is no such file"
        raise InputError(field, str(path), problem, "check the path; it is looked for beside the job file")
    if path.suffix.lower() in CAD:
        return _meshed(path, field, size)
    if path.suffix.lower() in SURFACES:
        raise InputError(field, path.name, "is a surface, which has no tetrahedra", INSIDE)
    mesh = _reader(path)(path, field)
    points = np.asarray(mesh.points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(field, path.name, "is a plane mesh: its nodes have no z", "bring a mesh of solid elements")
    kinds = {block.type: len(block.data) for block in mesh.cells}
    found = [kind for kind in TETRAHEDRA if kind in kinds]
    others = [
        kind for kind in kinds if kind not in TETRAHEDRA and kind.startswith(("hexa", "wedge", "pyramid", "poly"))
    ]
    listed = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no elements"
    if others or len(found) > 1:
        problem = f"must have tetrahedra of one order only, but it has {listed}"
        raise InputError(field, path.name, problem, "mesh it with tetrahedra, of the second order if you can")
    if not found:
        problem = f"has no tetrahedra, but {listed}"
        raise InputError(field, path.name, problem, INSIDE)
    tets = np.concatenate([block.data for block in mesh.cells if block.type == found[0]]).astype(np.int64)
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    if (np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0).all():  # the sense in which MED numbers corners
        tets = tets[:, MIRRORED[: tets.shape[1]]]
    groups: dict[str, list[IntArray]] = {}
    for name, nodes in _groups(mesh):
        groups.setdefault(name, []).append(np.asarray(nodes, dtype=np.int64).ravel())
    whole = {name: np.unique(np.concatenate(parts)) for name, parts in groups.items()}
    return MeshFile(points, tets, {name: nodes for name, nodes in whole.items() if len(nodes)})


def _reader(path: Path) -> Callable[[Path, str], Any]:
    ending = path.suffix.lower()
    return _by_gmsh if ending in BY_GMSH else _nastran if ending in NASTRAN else _read


def _nastran(path: Path, field: str) -> Any:
    import meshio

    mesh = read_bulk_mesh(read_text(path, field), path, field)
    return meshio.Mesh(mesh.points, list(mesh.cells.items()), point_sets=mesh.properties)


def _read(path: Path, field: str) -> Any:
    import meshio
    from meshio.abaqus._abaqus import abaqus_to_meshio_type

    abaqus_to_meshio_type.update(TRIANGLES)
    said = io.StringIO()
    try:  # meshio prints what it tried, and ends the process when nothing helps
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        if path.suffix.lower() not in meshio.extension_to_filetypes:
            known = ", ".join(sorted({*meshio.extension_to_filetypes, *CAD, *BY_GMSH, *NASTRAN} - {*SURFACES}))
            raise InputError(field, path.name, f"has an ending that is not known: {known}", "convert it") from None
        lines = [line.strip() for line in [*said.getvalue().splitlines(), str(error)] if line.strip()]
        reason = next(
            (line for line in lines if "Couldn't read" not in line and line != "1"), "no reader understands it"
        )
        problem = f"cannot be read as a {path.suffix} file ({reason[:200]})"
        raise InputError(field, path.name, problem, "is it whole? or write it as .msh (gmsh) or .vtu") from None


def _by_gmsh(path: Path, field: str) -> Any:
    """A mesh as gmsh reads it; where it names no groups, properties and references are the numbers of its entities."""
    import meshio
    from meshio.gmsh.common import _gmsh_to_meshio_type

    with gmsh_session("housing") as gmsh:
        try:
            gmsh.merge(str(path))
        except Exception as error:
            raise InputError(
                field, path.name, f"cannot be read ({error})", "is it whole? or write it as .msh"
            ) from None
        model = gmsh.model
        kinds, _, members = model.mesh.getElements()
        if not len(kinds):
            raise InputError(field, path.name, "has no elements", "is it whole? or write it as .msh (gmsh)")
        points, number = _nodes(model)
        counts = [model.mesh.getElementProperties(kind)[3] for kind in kinds]
        cells = [
            (_gmsh_to_meshio_type[kind], number[nodes.astype(np.int64)].reshape(-1, count))
            for kind, nodes, count in zip(kinds, members, counts, strict=True)
        ]
        groups: dict[str, list[IntArray]] = {}
        for dimension, tag in model.getPhysicalGroups():
            nodes = model.mesh.getNodesForPhysicalGroup(dimension, tag)[0]
            groups.setdefault(model.getPhysicalName(dimension, tag).strip() or str(tag), []).append(nodes)
        for dimension, tag in () if groups else [*model.getEntities(2), *model.getEntities(3)]:
            groups.setdefault(str(tag), [np.concatenate(model.mesh.getElements(dimension, tag)[2])])  # faces first
        sets = {name: number[np.concatenate(parts).astype(np.int64)] for name, parts in groups.items()}
    return meshio.Mesh(points, cells, point_sets=sets)


def _nodes(model: Any) -> tuple[Array, IntArray]:
    """Nodes of gmsh's model, and the row of each by its tag."""
    tags, points, _ = model.mesh.getNodes()
    number = np.full(int(tags.max()) + 1, -1)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    return points.reshape(-1, 3), number


def _groups(mesh: Any) -> Iterator[tuple[str, IntArray]]:
    """Names and nodes of all groups of a mesh, one by one; a name may come several times."""
    for name, nodes in (mesh.point_sets or {}).items():
        yield name, nodes
    for name, parts in (mesh.cell_sets or {}).items():
        if not name.startswith("gmsh:"):
            for block, rows in zip(mesh.cells, parts, strict=False):
                if rows is not None and len(rows):
                    yield name, block.data[np.asarray(rows, dtype=np.int64)]
    names: dict[int, list[str]] = {int(np.ravel(tag)[0]): [] for tag in mesh.field_data.values()}  # by name
    for tags in (getattr(mesh, "cell_tags", None), getattr(mesh, "point_tags", None)):
        for tag, own in (tags or {}).items():
            names.setdefault(int(tag), []).extend(own)
    for key, blocks in mesh.cell_data.items():
        for block, values in zip(mesh.cells, blocks, strict=False):
            for name, rows in _rows(key, np.asarray(values), names):
                yield name, block.data[rows]
    for key, values in mesh.point_data.items():
        yield from _rows(key, np.asarray(values), names)
    for name, known in mesh.field_data.items():  # physical names of gmsh before version 4
        for block, values in zip(mesh.cells, mesh.cell_data.get("gmsh:physical", []), strict=False):
            rows = np.flatnonzero(np.asarray(values) == np.asarray(known).ravel()[0])
            if len(rows) and name not in (mesh.cell_sets or {}):
                yield name, block.data[rows]


def _rows(key: str, values: Array, names: dict[int, list[str]]) -> Iterator[tuple[str, IntArray]]:
    """Groups of one array: its numbers, where they are known to be groups; else, of marks 0 and 1, its own name."""
    if values.ndim != 1:
        return
    if key in NUMBERED:
        for number in np.unique(values[values != 0]):
            rows = np.flatnonzero(values == number)
            for name in names.get(int(number), [str(int(number))]):
                yield name, rows
    elif not key.startswith("gmsh:") and np.isin(values, (0, 1)).all() and values.any():
        yield key, np.flatnonzero(values)


def _meshed(path: Path, field: str, size: float) -> MeshFile:
    """Second-order tetrahedra of a CAD file, in mm; its surfaces are groups by their numbers in gmsh."""
    with gmsh_session("housing") as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        try:
            gmsh.model.occ.importShapes(str(path))
            gmsh.model.occ.synchronize()
        except Exception as error:
            raise InputError(field, path.name, f"cannot be read ({error})", "export it anew as STEP") from None
        if not gmsh.model.getEntities(3):
            raise InputError(field, path.name, "has no solid, only surfaces or curves", "export the solid body")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        try:
            gmsh.model.mesh.generate(3)
            gmsh.model.mesh.setOrder(2)
        except Exception as error:
            raise InputError(
                field, path.name, f"cannot be meshed ({error})", "mend the solid, or other size_mm"
            ) from None
        points, number = _nodes(gmsh.model)
        _, cells = gmsh.model.mesh.getElementsByType(11)
        groups = {
            str(tag): number[gmsh.model.mesh.getNodes(2, tag, includeBoundary=True)[0].astype(np.int64)]
            for _, tag in gmsh.model.getEntities(2)
        }
    return MeshFile(points, number[cells.astype(np.int64)].reshape(-1, 10), groups)
