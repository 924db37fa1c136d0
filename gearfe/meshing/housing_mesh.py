"""Tetrahedra of the parametric gearbox housing: gmsh's CAD kernel joins the parts, cuts the bores and meshes the whole.

Built in millimetres, returned in metres. Midside nodes on bores and bosses lie on the true cylinders.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..progress import stage
from ..solid import unfolded
from ..tables.housing import HousingTable, ShaftAxisTable
from .cache import cached_arrays
from .session import gmsh_session

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Raise when anything below changes the meshes that come out.
RECIPE = 2
#: gmsh's element types of four and ten nodes; the last two midside nodes of the latter change places on the way out.
_TET4, _TET10 = 4, 11
#: Smallest volume ratio in a curved element, against its mean, before its midside nodes go back to straight edges.
_LEAST_RATIO = 0.1
#: Bounding boxes of gmsh are a little larger than what they hold (mm).
_NEAR = 1e-3
#: Element sizes in parts of `size_mm`: base plate and feet; inner lines where walls meet the base, where the feet do.
_BASE, _WALL_LINE, _FOOT_LINE = 1.43, 0.57, 0.43
#: Over these lengths, in parts of `size_mm`, the sizes pass into each other: from such lines, and below the walls.
_LINE_REACH, _BASE_REACH = 0.57, 1.43


class TetMesh(NamedTuple):
    """A tetrahedral mesh."""

    #: (n, 3) m
    nodes: Floats
    #: (m, 4) or (m, 10), midside nodes in the order of `gearfe.solid.EDGES`
    tets: Ints


def housing_mesh(table: HousingTable) -> TetMesh:
    """Mesh of the housing, from the cache when it was made before.

    Raises
    ------
    InputError
        When gmsh cannot mesh the geometry.
    MissingLibraryError
        When gmsh is needed and cannot be imported.
    """
    recipe = {name: getattr(table, name) for name in _GEOMETRY} | {"mesh": _mesh_recipe(table), "version": RECIPE}
    with stage("meshing the housing"):
        arrays = cached_arrays("housing", recipe, lambda: _make(table)._asdict())
    return TetMesh(arrays["nodes"], arrays["tets"])


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


def _mesh_recipe(table: HousingTable) -> dict[str, object]:
    feet, mesh = table.feet, table.mesh
    return {
        "feet": [feet.length_x_mm, feet.width_y_mm, feet.height_mm, feet.inset_y_mm],
        "size": mesh.size_mm,
        "bore_edges": mesh.bore_edges,
        "order": mesh.order,
        "graded": mesh.graded,
    }


def _make(table: HousingTable) -> TetMesh:
    options = {
        # faces in one plane stay apart: the bottoms of the feet, which are held, end where the feet end
        "Geometry.OCCUnionUnify": 0.0,
        "Mesh.MeshSizeMax": table.mesh.size_mm * (_BASE if table.mesh.graded else 1.0),
        "Mesh.MeshSizeFromCurvature": table.mesh.bore_edges,
        "Mesh.SecondOrderLinear": 0.0,
    }
    with gmsh_session("housing", options=options) as gmsh:
        try:
            _build(gmsh.model.occ, table)
            gmsh.model.occ.synchronize()
            if table.mesh.graded:
                _grade(gmsh.model, table)
            gmsh.model.mesh.generate(3)
            if table.mesh.order == 2:
                gmsh.model.mesh.setOrder(2)
            mesh = _arrays(gmsh)
        except InputError:
            raise
        except Exception as error:  # gmsh raises bare Exception with its log line
            cure = "check that the dimensions fit each other, or choose another size_mm"
            raise InputError("housing", None, f"gmsh could not mesh this geometry ({error})", cure) from error
    nodes, _ = unfolded(mesh.nodes, mesh.tets, least=_LEAST_RATIO)
    return TetMesh(1e-3 * nodes, mesh.tets)


def _build(occ: Any, table: HousingTable) -> None:
    """Join walls, base, end walls, cover, feet and bosses; cut the bores."""
    (x0, x1), (z0, z1), half = table.wall_x_mm, table.wall_z_mm, 0.5 * table.inner_gap_mm
    plus, minus = table.wall_thickness_mm
    low, high, bottom = -half - minus, half + plus, z0 - table.base_thickness_mm

    def box(start: tuple[float, float, float], end: tuple[float, float, float]) -> tuple[int, int]:
        return 3, occ.addBox(*start, *(b - a for a, b in zip(start, end, strict=True)))

    parts = [
        box((x0, half, z0), (x1, high, z1)),
        box((x0, low, z0), (x1, -half, z1)),
        box((x0, low, bottom), (x1, high, z0)),
    ]
    first, last = table.end_wall_thickness_mm
    if first > 0.0:
        parts.append(box((x0, -half, z0), (x0 + first, half, z1)))
    if last > 0.0:
        parts.append(box((x1 - last, -half, z0), (x1, half, z1)))
    if table.cover_thickness_mm > 0.0:
        parts.append(box((x0, low, z1), (x1, high, z1 + table.cover_thickness_mm)))
    feet = table.feet
    for left, right in ((x0 - feet.length_x_mm, x0), (x1, x1 + feet.length_x_mm)):
        for front in (low + feet.inset_y_mm, high - feet.inset_y_mm - feet.width_y_mm):
            parts.append(box((left, front, bottom), (right, front + feet.width_y_mm, bottom + feet.height_mm)))
    holes = []
    for shaft in table.shafts:
        for side, (start, end) in bore_ranges(table, shaft).items():
            inner = half if side == "plus" else -half
            outer = end if side == "plus" else start
            if shaft.boss_height_mm > 0.0:
                parts.append(
                    (3, occ.addCylinder(shaft.x_mm, inner, shaft.z_mm, 0, outer - inner, 0, shaft.boss_radius_mm))
                )
            holes.append((3, occ.addCylinder(shaft.x_mm, inner, shaft.z_mm, 0, outer - inner, 0, shaft.bore_radius_mm)))
    body, _ = occ.fuse(parts[:1], parts[1:])
    if holes:
        body, _ = occ.cut(body, holes)
    if len(body) != 1:
        raise InputError("housing", len(body), "the parts do not form one body", "check the dimensions")


def _grade(model: Any, table: HousingTable) -> None:
    """Sizes where they pay: fine where stress is singular (inner corners, ends of held feet), coarse in the base."""
    size, field = table.mesh.size_mm, model.mesh.field
    (x0, x1), (z0, z1), half = table.wall_x_mm, table.wall_z_mm, 0.5 * table.inner_gap_mm
    first, last = table.end_wall_thickness_mm
    top_of_feet = z0 - table.base_thickness_mm + table.feet.height_mm
    wall_lines, foot_lines = [], []
    for _, tag in model.getEntities(1):
        low_x, low_y, low_z, high_x, high_y, high_z = model.getBoundingBox(1, tag)

        def within(low: float, high: float, *places: float) -> bool:
            return any(max(abs(low - place), abs(high - place)) < _NEAR for place in places)

        inner = within(low_y, high_y, -half, half) or within(low_x, high_x, *([x0 + first] if first else []), x1 - last)
        if within(low_z, high_z, z0) and inner:
            wall_lines.append(tag)
        if within(low_x, high_x, x0, x1) and high_z < top_of_feet + _NEAR:
            foot_lines.append(tag)
    found = []
    for lines, part in ((wall_lines, _WALL_LINE), (foot_lines, _FOOT_LINE)):
        distance, threshold = field.add("Distance"), field.add("Threshold")
        field.setNumbers(distance, "CurvesList", lines)
        field.setNumber(distance, "Sampling", 100)
        limits = {"SizeMin": part, "SizeMax": _BASE, "DistMin": 0.5 * part, "DistMax": _LINE_REACH}
        for key, value in ({"InField": distance} | {key: size * value for key, value in limits.items()}).items():
            field.setNumber(threshold, key, value)
        found.append(threshold)
    walls = field.add("Box")
    margin = table.inner_gap_mm + sum(table.wall_thickness_mm) + sum(s.boss_height_mm for s in table.shafts)
    limits = {"VIn": size, "VOut": _BASE * size, "Thickness": _BASE_REACH * size, "XMin": x0, "XMax": x1}
    limits |= {"YMin": -margin, "YMax": margin, "ZMin": z0, "ZMax": z1 + table.cover_thickness_mm + size}
    for key, value in limits.items():
        field.setNumber(walls, key, value)
    least = field.add("Min")
    field.setNumbers(least, "FieldsList", [*found, walls])
    field.setAsBackgroundMesh(least)


def bore_ranges(table: HousingTable, shaft: ShaftAxisTable) -> dict[str, tuple[float, float]]:
    """Range along y (mm) of each bore of a shaft axis: ``plus`` and ``minus`` wall, boss included."""
    half = 0.5 * table.inner_gap_mm
    plus = (half, half + table.wall_thickness_mm[0] + shaft.boss_height_mm)
    minus = (-half - table.wall_thickness_mm[1] - shaft.boss_height_mm, -half)
    both = {"plus": plus, "minus": minus}
    return both if shaft.walls == "both" else {shaft.walls: both[shaft.walls]}


def _arrays(gmsh: Any) -> TetMesh:
    """Nodes (mm) that elements use, and elements with their midside nodes in this project's order."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    kinds, _, element_nodes = gmsh.model.mesh.getElements(3)
    if len(kinds) != 1 or kinds[0] not in (_TET4, _TET10):
        raise InputError(
            "housing.mesh", list(kinds), "gmsh made other elements than tetrahedra", "report this geometry"
        )
    tets = element_nodes[0].reshape(-1, 10 if kinds[0] == _TET10 else 4).astype(np.int64)
    if kinds[0] == _TET10:
        tets[:, [8, 9]] = tets[:, [9, 8]]
    used, renumbered = np.unique(tets, return_inverse=True)
    place = np.empty(int(tags.max()) + 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    return TetMesh(coordinates.reshape(-1, 3)[place[used]], renumbered.reshape(tets.shape).astype(np.int64))
