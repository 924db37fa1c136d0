"""Second-order triangles of a plane part: an outline with round holes, meshed by gmsh, or a mesh file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from ..plane import least_jacobian, second_order
from .mesh_file import read_source
from .session import gmsh_session

Point = tuple[float, float]
#: Elements round a hole, at least.
ROUND = 16


class PlateMesh(NamedTuple):
    """Triangles of second order.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Nodes (m).
    triangles : ndarray, shape (m, 6)
        Corners counter-clockwise, then the nodes in the middle of edges 01, 12, 20.
    """

    points: Array
    triangles: IntArray


def mesh_outline(outline: Sequence[Point], holes: Sequence[tuple[float, float, float]], size: float) -> PlateMesh:
    """Mesh a polygon with round holes (x, y, radius); everything in metres, `size` the edge of the elements.

    Outline and holes must not cross one another (`check_outline`).
    """
    with gmsh_session("plate") as gmsh:
        geo, unit = gmsh.model.geo, 1e3
        loops = [_polygon(geo, unit * np.asarray(outline), unit * size)]
        loops += [_circle(geo, unit * np.asarray(hole), unit * size) for hole in holes]
        geo.addPlaneSurface(loops)
        geo.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        tags, flat, _ = gmsh.model.mesh.getNodes()
        triangles = gmsh.model.mesh.getElementsByType(9)[1].astype(np.int64).reshape(-1, 6)
        number = np.full(int(tags.max()) + 1, -1)
        number[tags.astype(np.int64)] = np.arange(len(tags))
        points = flat.reshape(-1, 3)[:, :2] / unit
        return _sound(points, number[triangles], "outline_m", "give a smaller element_size_m")


def _polygon(geo: Any, points: Array, size: float) -> int:
    corners = [geo.addPoint(x, y, 0.0, size) for x, y in points]
    ends = [*corners[1:], corners[0]]
    lines = [geo.addLine(a, b) for a, b in zip(corners, ends, strict=True)]
    return int(geo.addCurveLoop(lines))


def _circle(geo: Any, hole: Array, size: float) -> int:
    x, y, radius = hole
    fine = min(size, 2.0 * math.pi * radius / ROUND)
    add = geo.addPoint
    centre = add(x, y, 0.0, fine)
    at = [add(x + radius * c, y + radius * s, 0.0, fine) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    arcs = [geo.addCircleArc(at[k - 1], centre, at[k]) for k in range(4)]
    return int(geo.addCurveLoop(arcs))


def read_plate(path: Path, field: str, unit: float) -> PlateMesh:
    """Triangles of a mesh file; `unit` is the length of its unit (m).

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, has other elements than triangles, or is not plane.
    """
    if not path.is_file():
        raise InputError(
            field, str(path), "there is no such file", "check the path, which is relative to the mechanism file"
        )
    mesh = read_source(path, field)
    points = mesh.points
    faces = {kind: nodes for kind, nodes in mesh.cells.items() if not kind.startswith(("vertex", "line"))}
    kind = next((k for k in ("triangle6", "triangle") if k in faces), None)
    if kind is None or len(faces) > 1:
        listed = ", ".join(f"{len(data)} {name}" for name, data in faces.items()) or "no faces"
        raise InputError(field, path.name, f"must have triangles of one order only, but has {listed}", "mesh it again")
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points):
        raise InputError(field, path.name, "is not plane: z differs", "lay the part into the x-y plane")
    used, triangles = np.unique(faces[kind], return_inverse=True)
    triangles = triangles.reshape(-1, 6 if kind == "triangle6" else 3)
    points = unit * points[used, :2]
    if kind == "triangle":
        points, triangles, _ = second_order(points, triangles)
    return _sound(points, triangles, field, "mesh it again")


def _sound(points: Array, triangles: IntArray, field: str, cure: str) -> PlateMesh:
    """Elements counter-clockwise and not folded, all in one piece, no nodes beside them."""
    used, triangles = np.unique(triangles, return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 6)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    clockwise = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0.0
    triangles[clockwise] = triangles[clockwise][:, [0, 2, 1, 5, 4, 3]]
    if not (least_jacobian(points, triangles) > 0.0).all():
        raise InputError(field, None, "gives elements that are folded or without area", cure)
    if _pieces(len(points), triangles) > 1:
        raise InputError(field, None, "is in several pieces that do not hang together", "give each a separate body")
    return PlateMesh(points, triangles)


def _pieces(count: int, triangles: IntArray) -> int:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    rows, columns = np.repeat(triangles[:, 0], 6), triangles.ravel()
    return int(connected_components(coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count)))[0])


def check_outline(outline: Sequence[Point], holes: Sequence[tuple[str, float, float, float]], where: str) -> None:
    """A polygon that does not cross itself, holes (name, x, y, radius) inside of it and apart.

    Raises
    ------
    InputError
        Where that is not so; names sides by their first corner.
    """
    corners = np.asarray(outline, dtype=float)
    n = len(corners)
    if n < 3:
        raise InputError(where, n, "must have at least three corners", "give [x, y] of each in m")
    ends = np.roll(corners, -1, axis=0)
    for i in range(n):
        if np.array_equal(corners[i], ends[i]):
            raise InputError(where, list(outline[i]), f"is given twice in a row (corner {i + 1})", "remove one")
        for j in range(i + 1, n):
            beside = j == i + 1 or (i == 0 and j == n - 1)
            if not beside and _meet(corners[i], ends[i], corners[j], ends[j]):
                problem = f"crosses itself: the side from corner {i + 1} meets that from corner {j + 1}"
                raise InputError(where, None, problem, "give the corners in order around the part")
    for k, (name, x, y, radius) in enumerate(holes):
        centre = np.array([x, y])
        side = ends - corners
        share = np.clip(((centre - corners) * side).sum(1) / (side**2).sum(1), 0.0, 1.0)
        wall = float(np.hypot(*(corners + share[:, None] * side - centre).T).min())
        if wall <= radius or not _inside(centre, corners, ends):
            raise InputError(name, [x, y, radius], "does not lie inside of the outline", "move it, or make it smaller")
        for other, u, v, r in holes[:k]:
            if math.hypot(x - u, y - v) <= radius + r:
                raise InputError(name, [x, y, radius], f"meets {other}", "move it, or make it smaller")


def _meet(a: Array, b: Array, c: Array, d: Array) -> bool:
    def side(p: Array, q: Array, r: Array) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    one, two, three, four = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
    if one * two < 0.0 and three * four < 0.0:
        return True
    lies = ((one, a, b, c), (two, a, b, d), (three, c, d, a), (four, c, d, b))
    return any(s == 0.0 and (np.minimum(p, q) <= r).all() and (r <= np.maximum(p, q)).all() for s, p, q, r in lies)


def _inside(point: Array, corners: Array, ends: Array) -> bool:
    """Return whether a ray to the right leaves the polygon an odd number of times."""
    crosses = (corners[:, 1] > point[1]) != (ends[:, 1] > point[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = corners[:, 0] + (point[1] - corners[:, 1]) / (ends[:, 1] - corners[:, 1]) * (ends - corners)[:, 0]
    return bool((crosses & (at > point[0])).sum() % 2)
