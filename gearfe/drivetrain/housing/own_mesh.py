r"""A housing from a mesh file of the user's own: bores by axis, radius and range or by groups, held faces likewise.

A group that is a bore is a cylinder. Its axis and radius minimise :math:`\sum_i (d_i - r)^2` over the distances d of
its nodes from the axis. It must be a cylinder within a thousandth of the radius. The reference point is the point of
the axis in the middle of the nodes' range.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from ...base.errors import InputError, given
from ...base.tables.housing import UNITS, HeldTable, HousingMeshTable, HousingTable, MeshBoreTable
from ...base.typing import Array, BoolArray, IntArray
from ...fem.meshing.mesh_file import MeshFile, read_mesh_file
from ...fem.plane import Material
from .attachments import RADIUS_TOLERANCE, Attachment, Bore, Plane, bore_attachment, cylinder_notes, plane_nodes
from .model import Housing
from .refinement import refined

#: Extent of a housing (mm): a mesh beyond it has another unit than that of the job.
SIZES_MM = (2.0, 50e3)


def own_housing(table: HousingTable, folder: Path, material: Material) -> Housing:
    """Housing of the mesh file that a [housing] table names; files are looked for in `folder`.

    Raises
    ------
    InputError
        For every mistake in file, bores and held faces, in the table's keys.
    """
    field = "housing.mesh"
    found = read_mesh_file(folder / given(table.mesh.file, field), field, table.mesh.size_mm)
    mesh = found._replace(nodes=_turned(UNITS[table.mesh.unit] * found.nodes, table.mesh))
    used = np.unique(mesh.tets)
    notes = [*mesh.notes, size_note(mesh.nodes[used], table.mesh.unit)]
    attachments = []
    for i, bore in enumerate(table.bores):
        made, remarks = _attachment(bore, i, mesh, used)
        attachments.append(made)
        notes += remarks
    held = [_held(one, f"housing.held[{i}]", mesh, used) for i, one in enumerate(table.held)]
    box = None if table.mesh.inner_box_mm is None else 1e-3 * np.array(table.mesh.inner_box_mm)

    def outer(centres: Array) -> BoolArray:
        return np.ones(len(centres), bool) if box is None else ~((centres >= box[0]) & (centres <= box[1])).all(axis=1)

    try:
        housing = Housing.from_arrays(
            mesh.nodes,
            mesh.tets,
            fixed=np.unique(np.concatenate(held)) if held else None,
            material=material,
            attachments=attachments,
            outer=outer,
        )
        housing = dataclasses.replace(housing, notes=(*notes, *housing.notes))
        if table.mesh.refine_to_unknowns is not None:
            housing = refined(housing, table.mesh.refine_to_unknowns, outer)
    except InputError as error:
        raise InputError(f"{field} {table.mesh.file}, {error.field}", error.value, error.problem, error.cure) from None
    return housing


def _turned(nodes: Array, table: HousingMeshTable) -> Array:
    """Nodes (m) about the new origin, in the new axes."""
    places = ["xyz".index(name[-1]) for name in table.axes]
    signs = [-1.0 if name.startswith("-") else 1.0 for name in table.axes]
    return np.asarray((nodes - 1e-3 * np.array(table.origin_mm))[:, places] * signs)


def size_note(nodes: Array, unit: str) -> str:
    """How large a mesh is: a unit that is wrong shows there.

    Raises
    ------
    InputError
        When no housing is of this size.
    """
    sizes = 1e3 * np.ptp(nodes, axis=0)
    x, y, z = sizes
    note = f"the mesh is {x:.4g} x {y:.4g} x {z:.4g} mm"
    if not SIZES_MM[0] <= sizes.max() <= SIZES_MM[1]:
        problem = f"{note} in this unit; a housing has {SIZES_MM[0]:g} mm to {SIZES_MM[1] / 1e3:g} m"
        cure = f"write mesh = {{ file = ..., unit = ... }}, one of {', '.join(UNITS)}"
        raise InputError("housing.mesh.unit", unit, problem, cure)
    return note


def fitted_cylinder(points: Array) -> tuple[Array, Array, float, float]:
    """Cylinder nearest to points (n, 3): a point of its axis, unit vector along it, radius, largest distance off it."""
    from scipy.optimize import least_squares

    middle = points.mean(axis=0)
    size = float(np.abs(points - middle).max())
    at = (points - middle) / size
    starts = [*np.eye(3), *np.linalg.svd(at, full_matrices=False)[2]]

    def parts(x: Array, frame: Array) -> tuple[Array, Array, Array]:
        axis = np.array([x[0], x[1], 1.0]) @ frame
        axis = axis / np.linalg.norm(axis)
        foot = x[2] * frame[0] + x[3] * frame[1]
        offset = at - foot
        return foot, axis, np.linalg.norm(offset - np.outer(offset @ axis, axis), axis=1)

    fits = []
    for start in starts:
        frame = np.linalg.svd(np.outer(start, start))[0].T[[1, 2, 0]]
        # a circle through the points seen along the start (Kasa's equations)
        plane = np.column_stack([at @ frame[0], at @ frame[1]])
        matrix = np.column_stack([2 * plane, np.ones(len(at))])
        x, y, _ = np.linalg.lstsq(matrix, (plane**2).sum(axis=1), rcond=None)[0]

        def off(x: Array, frame: Array = frame) -> Array:
            distance = parts(x, frame)[2]
            return np.asarray(distance - distance.mean())

        found = least_squares(off, [0.0, 0.0, x, y], xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=60)
        fits.append((found, frame))
    best, frame = min(fits, key=lambda fit: fit[0].cost)
    foot, axis, distance = parts(best.x, frame)
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    radius = float(distance.mean())
    return middle + size * foot, axis, size * radius, size * float(np.abs(distance - radius).max())


def _attachment(bore: MeshBoreTable, i: int, mesh: MeshFile, used: IntArray) -> tuple[Attachment, tuple[str, ...]]:
    field, name = f"housing.bores[{i}]", bore.name or str(i + 1)
    corners = np.zeros(len(mesh.nodes), dtype=bool)
    corners[mesh.tets[:, :4]] = True
    point = None if bore.point_mm is None else 1e-3 * np.array(bore.point_mm)
    if bore.group is None:
        along = None if bore.range_mm is None else (1e-3 * bore.range_mm[0], 1e-3 * bore.range_mm[1])
        x, y, z = (float(one) for one in given(point, f"{field}.point_mm"))
        radius = 1e-3 * given(bore.radius_mm, f"{field}.radius_mm")
        there = Bore((x, y, z), bore.direction, radius, along, name)
        try:
            made, notes = bore_attachment(there, i + 1, mesh.nodes[used], corners[used])
        except InputError as error:
            cure = "check point_mm, direction, radius_mm and range_mm, and the unit of the mesh"
            cure += "; a group beside point_mm may have any shape" if "round" in error.problem else ""
            raise InputError(field, name, error.problem, cure) from None
        return dataclasses.replace(made, nodes=used[made.nodes]), notes
    nodes = mesh.group(bore.group, f"{field}.group")
    if point is not None:
        axis = np.array(bore.direction, dtype=float)
        axis /= np.linalg.norm(axis)
        offset = mesh.nodes[nodes] - point
        radial = 1e3 * np.linalg.norm(offset - np.outer(offset @ axis, axis), axis=1)
        shape = f"{radial.min():.4g} to {radial.max():.4g} mm from the axis through its point_mm"
        note = f"bore {name}: the {len(nodes)} nodes of group {bore.group} are attached as they lie, {shape}"
        return Attachment(name, point, axis, nodes), (note,)
    at = mesh.nodes[nodes]
    foot, axis, radius, off = fitted_cylinder(at) if len(at) >= 6 else (at[0], at[0], 0.0, np.inf)
    if not (off <= RADIUS_TOLERANCE * radius and radius <= np.linalg.norm(np.ptp(at, axis=0))):  # else a flat patch
        flat = np.linalg.svd(at - at.mean(axis=0), compute_uv=False)[2] if len(at) > 3 else 0.0
        distance = f"they are up to {1e3 * off:.3g} mm off the nearest one"
        distance = "they lie in a plane" if flat < 1e-3 * np.linalg.norm(np.ptp(at, axis=0)) else distance
        problem = f"its {len(nodes)} nodes are no cylinder: {distance}"
        cure = "give point_mm, the point that the attachment is referred to, as well as the group"
        raise InputError(f"{field}.group", bore.group, problem, cure)
    height = (at - foot) @ axis
    reference = foot + 0.5 * (height.min() + height.max()) * axis
    note = f"bore {name}: group {bore.group} is a cylinder of radius {1e3 * radius:.6g} mm"
    known = nodes[corners[nodes]] if corners[nodes].any() else nodes
    notes = cylinder_notes(f"{field}.group", name, mesh.nodes[known] - foot, axis, of_radius=radius)
    return Attachment(name, reference, axis, nodes), (note, *notes)


def _held(held: HeldTable, field: str, mesh: MeshFile, used: IntArray) -> IntArray:
    if held.group is not None:
        return mesh.group(held.group, f"{field}.group")
    point = given(held.point_mm, f"{field}.point_mm")
    x, y, z = (1e-3 * one for one in point)
    try:
        return used[plane_nodes(Plane((x, y, z), held.normal), mesh.nodes[used])]
    except InputError as error:
        cure = "check point_mm and normal, and the unit of the mesh"
        raise InputError(field, list(point), error.problem, cure) from None
