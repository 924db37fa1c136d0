"""A tetrahedral mesh brought by anyone, checked and put in order: what is wrong is named, with the cure."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from ..solid import EDGES, FACES, jacobian_determinants

#: A midside node further than this part of its edge's length from the edge's middle belongs to another edge.
_FAR = 0.35
#: Volume ratios below this part of their mean count as collapsed.
_FLAT = 1e-9


class CheckedMesh(NamedTuple):
    """A mesh whose nodes are all used, with midside nodes in this project's order."""

    nodes: Array
    tets: IntArray
    #: (used,) number that each node had before
    original: IntArray
    notes: tuple[str, ...]


def checked_mesh(nodes: object, tets: object) -> CheckedMesh:
    """Check a mesh: shapes, numbers, order of midside nodes, orientation, connection. Drop nodes no element uses.

    Raises
    ------
    InputError
        Wrong shape, node numbers out of range, coordinates not finite, inverted or collapsed elements, parts that do
        not hang together face to face.
    """
    points = np.asarray(nodes, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("nodes", points.shape, "must have the shape (n, 3), in metres", "transpose it?")
    cells: Any = np.asarray(tets)
    if cells.ndim != 2 or cells.shape[1] not in (4, 10) or len(cells) == 0:
        raise InputError("tets", cells.shape, "must have the shape (m, 4) or (m, 10)", "bring tetrahedra only")
    if cells.dtype.kind not in "iu":
        raise InputError("tets", str(cells.dtype), "must be whole numbers", "node numbers count from 0")
    cells = cells.astype(np.int64)
    if cells.min() < 0 or cells.max() >= len(points):
        value = [int(cells.min()), int(cells.max())]
        raise InputError("tets", value, f"node numbers must lie in 0..{len(points) - 1}", "they count from 0")
    if not np.all(np.isfinite(points)):
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InputError("nodes", bad, "this node has a coordinate that is not a finite number", "correct it")
    notes = []
    original, renumbered = np.unique(cells, return_inverse=True)
    cells = renumbered.reshape(cells.shape).astype(np.int64)
    if len(original) < len(points):
        notes.append(f"{len(points) - len(original)} nodes belong to no element and are left out")
    points = points[original]
    if cells.shape[1] == 10:
        cells = _ordered(points, cells)
    _check_volumes(points, cells)
    _check_connected(points, cells)
    return CheckedMesh(points, cells, original, tuple(notes))


def boundary_faces(cells: IntArray) -> IntArray:
    """(f, 3) or (f, 6) faces that belong to one cell only, anticlockwise seen from outside.

    Cells are tetrahedra of four or ten nodes, or wedges of six, whose quadrilateral faces become two triangles each.
    """
    if cells.shape[1] == 6:
        a, b, c, d = _only_once(cells[:, WEDGE_SIDES].reshape(-1, 4)).T
        ends = _only_once(cells[:, WEDGE_ENDS].reshape(-1, 3))
        return np.concatenate([ends, np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    per = 3 if cells.shape[1] == 4 else 6
    return _only_once(cells[:, FACES[:, :per]].reshape(-1, per))


#: Faces of a wedge, its first three nodes clockwise seen from the other three.
WEDGE_ENDS, WEDGE_SIDES = np.array([[0, 1, 2], [3, 5, 4]]), np.array([[1, 0, 3, 4], [2, 1, 4, 5], [0, 2, 5, 3]])


def _only_once(faces: IntArray) -> IntArray:
    """Faces that no other has the first three nodes (of a quadrilateral: all but the largest number) in common with."""
    known = np.sort(faces[:, : 4 if faces.shape[1] == 4 else 3], axis=1)[:, :3]
    n = int(faces.max(initial=0)) + 1
    key = (known[:, 0] * n + known[:, 1]) * n + known[:, 2]
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    return faces[np.sort(first[count == 1])]


def _ordered(nodes: Array, tets: IntArray) -> IntArray:
    """Midside nodes in the order of `EDGES`, from their positions: VTK's, Abaqus' and gmsh's orders are known."""
    middles = 0.5 * (nodes[tets[:, EDGES[:, 0]]] + nodes[tets[:, EDGES[:, 1]]])
    lengths = np.linalg.norm(nodes[tets[:, EDGES[:, 0]]] - nodes[tets[:, EDGES[:, 1]]], axis=2)
    for order in ([4, 5, 6, 7, 8, 9], [4, 5, 6, 7, 9, 8]):
        away = np.linalg.norm(nodes[tets[:, order]] - middles, axis=2) / np.maximum(lengths, 1e-300)
        if np.all(away < _FAR):
            return np.concatenate([tets[:, :4], tets[:, order]], axis=1)
    worst = int(np.argmax(away.max(axis=1)))
    problem = "a midside node of this element does not lie near the middle of its edge"
    raise InputError("tets", worst, problem, "order them by edges 01, 12, 02, 03, 13, 23 (VTK) or as gmsh does")


def _check_volumes(nodes: Array, tets: IntArray) -> None:
    volume = jacobian_determinants(nodes, tets[:, :4])[:, 0]
    scale = float(np.abs(volume).mean())
    bad = np.flatnonzero(volume <= _FLAT * scale)
    if not len(bad):
        return
    shown = ", ".join(str(e) for e in bad[:5]) + (", ..." if len(bad) > 5 else "")
    cure = "swap two corners of those with negative volume, remove those with none"
    if np.all(volume < -_FLAT * scale):
        cure = "all elements are mirrored: swap their second and third corner (and the midside nodes that go with them)"
    raise InputError("tets", None, f"{len(bad)} inverted or collapsed elements ({shown})", cure)


def _check_connected(nodes: Array, tets: IntArray) -> None:
    faces = np.sort(tets[:, FACES[:, :3]].reshape(-1, 3), axis=1)
    element = np.repeat(np.arange(len(tets)), 4)
    order = np.lexsort(faces.T)
    faces, element = faces[order], element[order]
    same = np.all(faces[1:] == faces[:-1], axis=1)
    if np.any(same[1:] & same[:-1]):
        bad = int(element[np.flatnonzero(same[1:] & same[:-1])[0]])
        raise InputError("tets", bad, "a face of this element belongs to three elements", "remove the doubled elements")
    pairs = (np.ones(int(same.sum())), (element[:-1][same], element[1:][same]))
    parts, label = connected_components(sparse.coo_array(pairs, shape=(len(tets), len(tets))), directed=False)
    if parts == 1:
        return
    sizes = np.bincount(label)
    small = int(np.argmin(sizes))
    place = nodes[tets[label == small, :4]].mean(axis=(0, 1))
    where = ", ".join(f"{v:.6g}" for v in place)
    smallest = f"the smallest has {sizes[small]} elements near ({where}) m"
    problem = f"the mesh falls into {parts} parts that share no face; {smallest}"
    raise InputError("tets", None, problem, "merge nodes that coincide, or remove the loose part")
