"""Tetrahedra and named groups of a mesh file of any format; CAD files are meshed by gmsh."""

from __future__ import annotations

import hashlib
import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError, nearest
from ...base.typing import Array, IntArray
from ...output.exchange.abaqus_cards import inclusion as card_inclusion
from ...output.exchange.abaqus_mesh import read_abaqus
from ...output.exchange.included import source_files
from ...output.exchange.meshio_mesh import heavy_files, read_by_meshio
from ...output.exchange.nastran_cards import inclusion as bulk_inclusion
from ...output.exchange.nastran_mesh import read_bulk_mesh
from ...output.exchange.source_mesh import SourceMesh, checked_source
from .cad import CAD, mesh_cad_file
from .gmsh_file import ENDINGS, read_by_gmsh

#: Formats of Nastran and Abaqus; and surfaces, which have no inside.
NASTRAN = (".bdf", ".nas", ".fem")
ABAQUS = (".inp",)
SURFACES = (".stl", ".ply", ".off", ".obj", ".wkt", ".svg")
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
    notes
        Remarks on the reading of the file, for the user.
    """

    nodes: Array
    tets: IntArray
    groups: dict[str, IntArray]
    notes: tuple[str, ...] = ()

    def group(self, name: str, field: str) -> IntArray:
        """Nodes of a group that belong to tetrahedra.

        Raises
        ------
        InputError
            Where there is none of this name, or none of its nodes belongs to an element.
        """
        alike = [other for other in self.groups if other.casefold() == name.casefold()]
        if name not in self.groups and len(alike) == 1:  # Abaqus and others do not tell capitals from small letters
            name = alike[0]
        if name not in self.groups:
            listed = (
                ", ".join(itertools.starmap(self._text_of, itertools.islice(self.groups.items(), LISTED))) or "none"
            )
            more = f" and {len(self.groups) - LISTED} more" if len(self.groups) > LISTED else ""
            problem = f"there is no such group in the mesh; it has: {listed}{more}"
            cure = "name groups in the mesher, or give the position by point_mm instead of group"
            raise InputError(field, name, problem, nearest(name, self.groups) or cure)
        nodes = np.intersect1d(self.groups[name], self.tets)
        if not len(nodes):
            raise InputError(field, name, "none of its nodes belongs to a tetrahedron", "take another group")
        return nodes

    def _text_of(self, name: str, nodes: IntArray) -> str:
        """A group; one that has a number instead of a name with its place."""
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
        raise InputError(field, str(path), problem, "check the path, which is relative to the job file")
    if path.suffix.lower() in CAD:
        return MeshFile(*mesh_cad_file(path, field, size))
    if path.suffix.lower() in SURFACES:
        raise InputError(field, path.name, "is a surface, which has no tetrahedra", INSIDE)
    mesh = read_source(path, field)
    points = mesh.points
    if points.shape[1] != 3:
        raise InputError(field, path.name, "is a plane mesh: its nodes have no z", "bring a mesh of solid elements")
    kinds = {kind: len(nodes) for kind, nodes in mesh.cells.items()}
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
    tets = mesh.cells[found[0]]
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    if (np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0).all():  # the sense in which MED numbers corners
        tets = tets[:, MIRRORED[: tets.shape[1]]]
    return MeshFile(points, tets, {name: nodes for name, nodes in mesh.groups.items() if len(nodes)}, mesh.notes)


def read_source(path: Path, field: str) -> SourceMesh:
    """Mesh of a file with elements of any kind; its suffix gives the format.

    Raises
    ------
    InputError
        When it cannot be read, is damaged, or names nodes that it does not have.
    """
    ending = path.suffix.lower()
    if ending in ENDINGS:
        mesh = read_by_gmsh(path, field)
    elif ending in NASTRAN:
        mesh = read_bulk_mesh(path, field)
    elif ending in ABAQUS:
        mesh = read_abaqus(path, field)
    else:
        mesh = read_by_meshio(path, field)
    return checked_source(mesh, path, field)


def source_fingerprint(path: Path, field: str) -> str:
    """Hash of the content of a mesh file and of the files that it names.

    Raises
    ------
    InputError
        When one of them cannot be read.
    """
    ending, files = path.suffix.lower(), [path]
    if path.is_file() and ending in (*NASTRAN, *ABAQUS):
        files = source_files(path, field, bulk_inclusion if ending in NASTRAN else card_inclusion)
    elif path.is_file() and ending == ".xdmf":
        files += heavy_files(path, field)
    found = hashlib.sha256()
    for file in files:
        try:
            content = file.read_bytes()
        except OSError as error:
            reason = error.strerror or str(error)
            cure = "check the path, which is relative to the job file"
            raise InputError(field, str(file), f"cannot be read ({reason})", cure) from None
        found.update(hashlib.sha256(content).digest())
    return found.hexdigest()
