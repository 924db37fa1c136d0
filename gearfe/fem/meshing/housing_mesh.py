r"""The parametric housing as an extrusion along y: triangles of order 3 in the plane, times layers of order 3.

The faces of one plane arrangement are solid or empty in each interval between planes y = const. Plane triangles times
layers are therefore a mesh of the housing (prisms with 40 nodes). At its re-entrant edges the stress grows as
:math:`r^{\alpha-1}` (:math:`\alpha = 0.544` at a right angle: Williams, J. Appl. Mech. 19, 1952); there the elements
are thin across the edge and long along it. In the plane gmsh's anisotropic mesher makes them, along y the layers do.
Built in millimetres, returned in metres; the nodes on bores and bosses lie on the true cylinders.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from ...base.cache import cached_arrays
from ...base.errors import InputError
from ...base.progress import stage
from ...base.tables.housing import HousingTable
from ...base.typing import Array, BoolArray, IntArray
from ..prisms import ORDER, volume_ratios
from .housing_recipe import RECIPE
from .session import gmsh_session

#: gmsh's type of triangles of order 3; its anisotropic mesher, and the one that adds no points within a face.
_TRIANGLE, _BAMG, _NO_POINTS_INSIDE = 21, 7.0, 3
#: Edges round a bore at least; rings thinner than this many times `Sizes.across` take one element across.
_LEAST_ROUND, _THIN = 6, 2.0
#: Smallest volume ratio in a curved triangle against the mean; below it the bores are meshed again with smaller sizes.
_LEAST_RATIO, _FINER, _TRIALS = 0.05, 0.7, 6
#: The same triangle seen from behind.
REVERSED = np.array([0, 2, 1, 8, 7, 6, 5, 4, 3, 9])


class Sizes(NamedTuple):
    """Element sizes (mm): across singular edges, along them, round bores, elsewhere; growth from layer to layer."""

    across: float
    along: float
    round: float
    far: float
    growth: float = 5.0


class Extrusion(NamedTuple):
    """Plane triangles, levels along y, and what is solid."""

    #: (n, 2) x and z (m)
    points: Array
    #: (m, 10) nodes in gmsh's order, anticlockwise in the plane of x and z
    triangles: IntArray
    #: (l,) y of the levels (m), ORDER to a layer
    levels: Array
    #: (layers, m) whether a triangle is solid in a layer
    solid: BoolArray


def sizes(size_mm: float) -> Sizes:
    """Sizes that go with a thickness across re-entrant edges: the ratios that gave the least error for the time."""
    return Sizes(size_mm, ALONG * size_mm, ROUND * size_mm, FAR * size_mm)


#: In parts of the thickness across re-entrant edges.
ALONG, ROUND, FAR = 8.0, 3.0, 10.0


def housing_mesh(table: HousingTable) -> Extrusion:
    """Mesh of the housing, from the cache when it was made before.

    Raises
    ------
    InputError
        When gmsh cannot mesh the geometry.
    MissingLibraryError
        When gmsh is needed and cannot be imported.
    """
    feet = table.feet
    recipe: dict[str, object] = {name: getattr(table, name) for name in _GEOMETRY}
    recipe["feet"] = [feet.length_x_mm, feet.width_y_mm, feet.height_mm, feet.inset_y_mm]
    recipe |= {"size": table.mesh.size_mm, "version": RECIPE}
    with stage("meshing the housing"):
        arrays = cached_arrays("housing", recipe, lambda: extruded(table, sizes(table.mesh.size_mm))._asdict())
    return Extrusion(**arrays)


_GEOMETRY = (
    "wall_x_mm",
    "wall_z_mm",
    "inner_gap_mm",
    "wall_thickness_mm",
    "base_thickness_mm",
    "end_wall_thickness_mm",
    "cover_thickness_mm",
    "shafts",
)


def extruded(table: HousingTable, sizes: Sizes) -> Extrusion:
    """Plane mesh and layers of a housing."""
    layers = _layers(table, sizes)
    levels = [layers[0][0]]
    for low, high in layers:
        levels += [low + (high - low) * k / ORDER for k in range(1, ORDER + 1)]
    points, triangles = _plane_mesh(table, sizes)
    centres = points[triangles[:, 9]]  # the mean of the corners may lie beyond an arc
    solid = np.array([_solid(table, centres, 0.5 * (low + high)) for low, high in layers])
    used = solid.any(axis=0)
    triangles, solid = triangles[used], solid[:, used]
    (ax, az), (bx, bz), (cx, cz) = (points[triangles[:, k]].T for k in range(3))
    behind = (bx - ax) * (cz - az) < (bz - az) * (cx - ax)
    triangles[behind] = triangles[behind][:, REVERSED]
    kept, triangles = np.unique(triangles, return_inverse=True)
    return Extrusion(1e-3 * points[kept], triangles.reshape(-1, 10), 1e-3 * np.array(levels), solid)


def _plane_mesh(table: HousingTable, sizes: Sizes) -> tuple[Array, IntArray]:
    """Points (mm) and triangles.

    Raises
    ------
    InputError
        When gmsh cannot mesh the geometry, or arcs fold triangles that are too thin for them.
    """
    cure = "check that the dimensions fit each other, or choose another size_mm"
    options = {"Mesh.Algorithm": _BAMG, "Mesh.MeshSizeMax": sizes.far, "Mesh.LcIntegrationPrecision": 1e-4}
    for _ in range(_TRIALS):
        with gmsh_session("housing", options=options) as gmsh:
            try:
                _plane_geometry(gmsh.model, table, sizes)
                gmsh.model.mesh.generate(2)
                gmsh.model.mesh.setOrder(ORDER)
                # where an arc folds a thin triangle, its other edges are bent as well
                gmsh.model.mesh.optimize("HighOrderElastic")
            except Exception as error:  # gmsh raises bare Exception with its log line
                raise InputError("housing", None, f"gmsh could not mesh this geometry ({error})", cure) from error
            tags, coordinates, _ = gmsh.model.mesh.getNodes()
            faces = gmsh.model.getEntities(2)
            found = [gmsh.model.mesh.getElementsByType(_TRIANGLE, face)[1].reshape(-1, 10) for _, face in faces]
        place = np.empty(int(tags.max()) + 1, dtype=np.int64)
        place[tags.astype(np.int64)] = np.arange(len(tags))
        points, triangles = coordinates.reshape(-1, 3)[:, :2], place[np.concatenate(found).astype(np.int64)]
        if np.all(volume_ratios(points, triangles) > _LEAST_RATIO):
            return points, triangles
        sizes = sizes._replace(round=_FINER * sizes.round)
    raise InputError("housing", None, "arcs of bores and bosses fold elements of this mesh", cure)


def _layers(table: HousingTable, sizes: Sizes) -> list[tuple[float, float]]:
    """Ranges of y (mm) from one plane at which the solid region changes to the next.

    Thin at the walls' faces, where the walls' feet and the bosses' rings are, and growing from there.
    """
    half, (plus, minus), feet = 0.5 * table.inner_gap_mm, table.wall_thickness_mm, table.feet
    low, high = -half - minus, half + plus
    planes = dict.fromkeys((low, -half, half, high), True)
    others = [low + feet.inset_y_mm, low + feet.inset_y_mm + feet.width_y_mm]
    others += [high - feet.inset_y_mm, high - feet.inset_y_mm - feet.width_y_mm]
    others += [y for shaft in table.shafts for ends in table.bore_ranges(shaft) for y in ends]
    for y in others:
        if min(abs(y - known) for known in planes) > 1e-6:
            planes[y] = False
    found = []
    for (a, thin_a), (b, thin_b) in itertools.pairwise(sorted(planes.items())):
        ends = a + np.cumsum([0.0, *_steps(b - a, thin_a, thin_b, sizes)])
        ends[-1] = b
        found += [(float(p), float(q)) for p, q in itertools.pairwise(ends)]
    return found


def _steps(length: float, first: bool, last: bool, sizes: Sizes) -> list[float]:
    """Thicknesses over a length: from `across` at a thin end, growing by `growth` up to the size far away."""
    one, two = ([sizes.across] * first, [sizes.across] * last)
    if first and last and length < 3.0 * sizes.across:
        count = max(1, math.floor(length / sizes.across + 1e-9))
        return [length / count] * count
    if length < 2.0 * sizes.across:
        return [length]
    left = length - sum(one) - sum(two)
    for side in (one, two):
        while side and left > 2.0 * sizes.growth * side[-1] and sizes.growth * side[-1] < sizes.far:
            side.append(sizes.growth * side[-1])
            left -= side[-1]
    limit = min([sizes.far, *(sizes.growth * side[-1] for side in (one, two) if side)])
    count = max(1, math.ceil(left / limit - 1e-9))
    return [*one, *([left / count] * count), *two[::-1]]


def _solid(table: HousingTable, place: Array, y: float) -> BoolArray:
    """(n,) whether points (x, z) are in the material at height y: the same parts as the product's geometry."""
    x, z = place.T
    (x0, x1), (z0, z1), half = table.wall_x_mm, table.wall_z_mm, 0.5 * table.inner_gap_mm
    low, high = -half - table.wall_thickness_mm[1], half + table.wall_thickness_mm[0]
    bottom, feet = z0 - table.base_thickness_mm, table.feet
    first, last = table.end_wall_thickness_mm

    def box(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> BoolArray:
        return (a[0] < x) & (x < a[1]) & (b[0] < y < b[1]) & (c[0] < z) & (z < c[1])

    found = box((x0, x1), (half, high), (z0, z1)) | box((x0, x1), (low, -half), (z0, z1))
    found |= box((x0, x1), (low, high), (bottom, z0))
    found |= box((x0, x0 + first), (-half, half), (z0, z1)) | box((x1 - last, x1), (-half, half), (z0, z1))
    found |= box((x0, x1), (low, high), (z1, z1 + table.cover_thickness_mm))
    for ends in ((x0 - feet.length_x_mm, x0), (x1, x1 + feet.length_x_mm)):
        for front in (low + feet.inset_y_mm, high - feet.inset_y_mm - feet.width_y_mm):
            found |= box(ends, (front, front + feet.width_y_mm), (bottom, bottom + feet.height_mm))
    holes = np.zeros(len(x), dtype=bool)
    for shaft in table.shafts:
        away = np.hypot(x - shaft.x_mm, z - shaft.z_mm)
        for start, end in table.bore_ranges(shaft):
            if start < y < end:
                found |= (away < shaft.boss_radius_mm) & (shaft.boss_height_mm > 0.0)
                holes |= away < shaft.bore_radius_mm
    return np.asarray(found & ~holes)


def _plane_geometry(model: Any, table: HousingTable, sizes: Sizes) -> None:
    """All outlines in one arrangement of faces, with sizes that are small across singular edges."""
    occ, field = model.occ, model.mesh.field
    (x0, x1), (z0, z1), feet = table.wall_x_mm, table.wall_z_mm, table.feet
    bottom, (first, last) = z0 - table.base_thickness_mm, table.end_wall_thickness_mm

    def box(a: float, b: float, c: float, d: float) -> tuple[int, int]:
        return 2, occ.addRectangle(a, c, 0.0, b - a, d - c)

    parts = [box(x0, x1, bottom, z0), box(x0, x1, z0, z1)]
    parts += [box(x0 - feet.length_x_mm, x0, bottom, bottom + feet.height_mm)]
    parts += [box(x1, x1 + feet.length_x_mm, bottom, bottom + feet.height_mm)]
    parts += [box(x0, x0 + first, z0, z1)] if first > 0.0 else []
    parts += [box(x1 - last, x1, z0, z1)] if last > 0.0 else []
    parts += [box(x0, x1, z1, z1 + table.cover_thickness_mm)] if table.cover_thickness_mm > 0.0 else []
    for shaft in table.shafts:
        radii = [shaft.bore_radius_mm] + [shaft.boss_radius_mm] * (shaft.boss_height_mm > 0.0)
        parts += [(2, occ.addDisk(shaft.x_mm, shaft.z_mm, 0.0, r, r)) for r in radii]
    occ.fragment(parts[:1], parts[1:])
    occ.synchronize()
    straight: list[int] = []
    round_: dict[float, list[int]] = {}
    upright = [x0, x1] + [x0 + first] * (first > 0.0) + [x1 - last] * (last > 0.0)
    level = [z0] + [z1] * (table.cover_thickness_mm > 0.0)
    for _, tag in model.getEntities(1):
        a, b, _, c, d, _ = model.getBoundingBox(1, tag)
        if model.getType(1, tag) != "Line":
            low, _ = model.getParametrizationBounds(1, tag)
            radius = 1.0 / float(model.getCurvature(1, tag, low)[0])
            round_.setdefault(round(radius, 6), []).append(tag)
        elif c - a < 1e-3:
            outer = min(abs(a - x0), abs(a - x1)) < 1e-3
            if min(abs(a - x) for x in upright) < 1e-3 and (
                not outer or d < z0 - 1e-3 or d < bottom + feet.height_mm + 1e-3
            ):
                straight.append(tag)
        elif min(abs(b - z) for z in level) < 1e-3:
            straight.append(tag)
    found = []
    # an arc's sagitta s^2 / (8 r) is a quarter of the elements' thickness there
    arcs = {r: min(sizes.round, math.sqrt(2.0 * r * sizes.across), 2.0 * math.pi * r / _LEAST_ROUND) for r in round_}
    for r, tags in round_.items():
        for tag in tags:
            pieces = math.ceil(model.occ.getMass(1, tag) / arcs[r] - 1e-6)
            model.mesh.setTransfiniteCurve(tag, 1 + max(1, pieces))
    for lines, along in ((straight, sizes.along), *((tags, arcs[r]) for r, tags in round_.items())):
        one = field.add("AttractorAnisoCurve")
        field.setNumbers(one, "CurvesList", lines)
        limits = {"SizeMinNormal": sizes.across, "SizeMinTangent": along, "SizeMaxNormal": sizes.far}
        limits |= {
            "SizeMaxTangent": sizes.far,
            "DistMin": 0.5 * sizes.across,
            "DistMax": 0.8 * sizes.far,
            "Sampling": 200,
        }
        for key, value in limits.items():
            field.setNumber(one, key, value)
        found.append(one)
    for shaft in table.shafts:
        if 0.0 < shaft.boss_radius_mm - shaft.bore_radius_mm < _THIN * sizes.across and shaft.boss_height_mm > 0.0:
            for _, tag in model.getEntities(2):
                a, b, _, c, d, _ = model.getBoundingBox(2, tag)
                reach = max(shaft.x_mm - a, shaft.z_mm - b, c - shaft.x_mm, d - shaft.z_mm)
                if reach < shaft.boss_radius_mm + 1e-3:
                    model.mesh.setAlgorithm(2, tag, _NO_POINTS_INSIDE)
    least = field.add("MinAniso")
    field.setNumbers(least, "FieldsList", found)
    field.setAsBackgroundMesh(least)
