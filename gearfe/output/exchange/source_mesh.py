"""Define the form in which all readers return a mesh of another program, and their common check."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray


class SourceMesh(NamedTuple):
    """Nodes, elements and groups of a file.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Coordinates in the file's unit; shape (n, 2) from formats of plane meshes.
    cells : dict
        Kind of element by meshio's name (``tetra10``) -> node numbers from 0, shape (m, nodes of the kind).
    groups : dict
        Name, or number as text, of each group of nodes, faces or elements -> its nodes.
    notes
        What the user should know about how the file was read.
    """

    points: Array
    cells: dict[str, IntArray]
    groups: dict[str, IntArray]
    notes: tuple[str, ...] = ()


def checked_source(mesh: SourceMesh, path: Path, field: str) -> SourceMesh:
    """Return the mesh if its node numbers exist and the coordinates of its elements are finite.

    Raises
    ------
    InputError
        With the element and the node that are wrong.
    """
    points = np.asarray(mesh.points, dtype=float)
    cure = "the file is damaged, or cut short: export it again"
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(field, path.name, f"has coordinates of the shape {points.shape}, not (nodes, 3)", cure)
    for kind, nodes in mesh.cells.items():
        wrong = np.argwhere((nodes < 0) | (nodes >= len(points)))
        if len(wrong):
            element, place = wrong[0]
            problem = (
                f"element {element + 1} of kind {kind} names the node {int(nodes[element, place])} (counted from 0), "
                f"but the file has {len(points)} nodes"
            )
            raise InputError(field, path.name, problem, cure)
        used = np.unique(nodes)
        lost = used[~np.isfinite(points[used]).all(axis=1)]
        if len(lost):
            problem = f"node {int(lost[0]) + 1} of the file has a coordinate that is not a finite number"
            raise InputError(field, path.name, problem, cure)
    for name, nodes in mesh.groups.items():
        if len(nodes) and not (nodes.min() >= 0 and nodes.max() < len(points)):
            problem = f"the group {name} names nodes that the file does not have: it has {len(points)}"
            raise InputError(field, path.name, problem, cure)
    return mesh._replace(points=points)
