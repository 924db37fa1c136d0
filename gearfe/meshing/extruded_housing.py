r"""The parametric housing as an extrusion along y: triangles of order 3 in the plane, times layers of order 3.

Faces of one plane arrangement are solid or empty in each interval between planes y = const, so plane triangles times
layers are a mesh of the housing (prisms with 40 nodes). At its re-entrant edges the stress grows as
:math:`r^{\alpha-1}` (:math:`\alpha = 0.544` at a right angle: Williams, J. Appl. Mech. 19, 1952); there the elements
are thin across the edge and long along it: in the plane by gmsh's anisotropic mesher, along y in the layers.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.housing import HousingTable
from .housing_mesh import bore_ranges
from .session import gmsh_session

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Order of the elements in the plane and along y; gmsh's type of such triangles, and of its anisotropic mesher.
ORDER, _TRIANGLE, _BAMG = 3, 21, 7.0
#: Degree of the rule on a triangle (the mass of a curved one: 3 + 3 from the product, 4 from the map).
_DEGREE = 10
#: Smallest volume ratio in a triangle that an arc bends, against the mean, before its edges are made straight.
_LEAST_RATIO = 0.05


@dataclass(frozen=True)
class Sizes:
    """Element sizes (mm): across singular edges, along them, round bores, elsewhere; growth from layer to layer."""

    across: float = 3.0
    along: float = 24.0
    round: float = 12.0
    far: float = 40.0
    growth: float = 4.0


class Extrusion(NamedTuple):
    """Plane triangles, levels along y, and what is solid."""

    #: (n, 2) x and z (mm)
    points: Floats
    #: (m, 10) nodes of the triangles
    triangles: Ints
    #: (l,) y of the levels (mm), ORDER to a layer
    levels: Floats
    #: (layers, m) whether a triangle is solid in a layer
    solid: NDArray[np.bool_]


def extruded_housing(table: HousingTable, sizes: Sizes) -> Extrusion:
    """Plane mesh and layers of a housing."""
    layers = _layers(table, sizes)
    levels = [layers[0][0]]
    for low, high in layers:
        levels += [low + (high - low) * k / ORDER for k in range(1, ORDER + 1)]
    with gmsh_session("housing reference", options={"Mesh.Algorithm": _BAMG, "Mesh.MeshSizeMax": sizes.far}) as gmsh:
        _plane_geometry(gmsh.model, table, sizes)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(ORDER)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        place = np.empty(int(tags.max()) + 1, dtype=np.int64)
        place[tags.astype(np.int64)] = np.arange(len(tags))
        points = coordinates.reshape(-1, 3)[:, :2]
        parts, inside = [], []
        for _, face in gmsh.model.getEntities(2):
            _, found = gmsh.model.mesh.getElementsByType(_TRIANGLE, face)
            own = place[np.asarray(found, dtype=np.int64)].reshape(-1, 10)
            centres = points[own[:, :3]].mean(axis=1)
            parts.append(own)
            # a curved triangle may leave its centre outside: the face as a whole is in or out
            flags = [np.mean(_solid(table, centres, 0.5 * (a + b))) > 0.5 for a, b in layers]
            inside.append(np.repeat(np.array(flags)[:, None], len(own), axis=1))
    triangles, solid = np.concatenate(parts), np.concatenate(inside, axis=1)
    return Extrusion(_straightened(points, triangles), triangles, np.array(levels), solid)


def _layers(table: HousingTable, sizes: Sizes) -> list[tuple[float, float]]:
    """Ranges of y (mm) from one plane at which the solid region changes to the next.

    Thin at the walls' faces, where the walls' feet and the bosses' rings are, and growing from there.
    """
    half, (plus, minus), feet = 0.5 * table.inner_gap_mm, table.wall_thickness_mm, table.feet
    low, high = -half - minus, half + plus
    planes = dict.fromkeys((low, -half, half, high), True)
    others = [low + feet.inset_y_mm, low + feet.inset_y_mm + feet.width_y_mm]
    others += [high - feet.inset_y_mm, high - feet.inset_y_mm - feet.width_y_mm]
    others += [y for shaft in table.shafts for ends in bore_ranges(table, shaft).values() for y in ends]
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
        count = max(1, round(length / sizes.across))
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


def _solid(table: HousingTable, place: Floats, y: float) -> NDArray[np.bool_]:
    """(n,) whether points (x, z) are in the material at height y: the same parts as the product's geometry."""
    x, z = place.T
    (x0, x1), (z0, z1), half = table.wall_x_mm, table.wall_z_mm, 0.5 * table.inner_gap_mm
    low, high = -half - table.wall_thickness_mm[1], half + table.wall_thickness_mm[0]
    bottom, feet = z0 - table.base_thickness_mm, table.feet
    first, last = table.end_wall_thickness_mm

    def box(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> NDArray[np.bool_]:
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
        for start, end in bore_ranges(table, shaft).values():
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
    arcs = {r: min(sizes.round, math.sqrt(2.0 * r * sizes.across)) for r in round_}
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
    least = field.add("MinAniso")
    field.setNumbers(least, "FieldsList", found)
    field.setAsBackgroundMesh(least)


def _straightened(points: Floats, triangles: Ints) -> Floats:
    """Points with straight edges where thin triangles are folded by the arcs of bores and bosses."""
    _, slopes, _ = triangle_functions()
    points = points.copy()
    for _ in range(5):
        det = np.linalg.det(np.einsum("eak,apm->epkm", points[triangles], slopes, optimize=True))
        folded = triangles[
            (det * np.sign(det.mean(axis=1))[:, None]).min(axis=1) <= _LEAST_RATIO * np.abs(det.mean(axis=1))
        ]
        if not len(folded):
            return points
        a, b, c = (points[folded[:, k]] for k in range(3))
        for first, (start, end) in zip((3, 5, 7), ((a, b), (b, c), (c, a)), strict=True):
            points[folded[:, first]] = start + (end - start) / 3.0
            points[folded[:, first + 1]] = start + 2.0 * (end - start) / 3.0
        points[folded[:, 9]] = (a + b + c) / 3.0
    return points


def triangle_functions() -> tuple[Floats, Floats, Floats]:
    """Values (10, p), slopes (10, p, 2) and weights (p,) of gmsh's triangle of order 3."""
    with gmsh_session("shape functions") as gmsh:
        points, weights = gmsh.model.mesh.getIntegrationPoints(_TRIANGLE, f"Gauss{_DEGREE}")
        _, values, _ = gmsh.model.mesh.getBasisFunctions(_TRIANGLE, points, "Lagrange")
        _, slopes, _ = gmsh.model.mesh.getBasisFunctions(_TRIANGLE, points, "GradLagrange")
    p = len(weights)
    values, slopes = np.asarray(values).reshape(p, 10), np.asarray(slopes).reshape(p, 10, 3)
    return values.T.copy(), slopes[:, :, :2].transpose(1, 0, 2).copy(), np.asarray(weights)
