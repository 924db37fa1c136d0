"""Housings from arrays: bores, attachments, supports, and everything that can be wrong with a mesh."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.housing.attachments import Attachment, Bore, Plane, interface_matrix
from gearfe.drivetrain.housing.model import Housing
from gearfe.fem.bodies.mesh_checks import boundary_faces
from gearfe.fem.meshing.session import gmsh_session
from gearfe.fem.plane import Material
from gearfe.fem.solid import curved_elements, jacobian_determinants
from tests.makers.housing_meshes import box, second_order

pytestmark = pytest.mark.usefixtures("own_cache")


def tube(cells: tuple[int, int, int] = (2, 12, 3), *, order: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Half a thick tube along x, radii 20 and 35 mm, length 60 mm: a bearing shell with a bore at y = z = 0."""

    def bent(p: np.ndarray) -> np.ndarray:
        radius, angle = 0.02 + p[:, 0], p[:, 1]
        return np.column_stack([p[:, 2], radius * np.cos(angle), -radius * np.sin(angle)])

    nodes, tets = box(cells, (0.015, math.pi, 0.06), order=order, mapped=bent)
    swapped = tets.copy()
    swapped[:, [1, 2]] = tets[:, [2, 1]]
    if order == 2:
        swapped[:, [4, 6, 8, 9]] = tets[:, [6, 4, 9, 8]]
    ratio = jacobian_determinants(nodes, tets)
    return nodes, (tets if ratio.min() > 0 else swapped)


AXIS = ((0.01, 0.0, 0.0), (2.0, 0.0, 0.0), 0.02, (-0.01, 0.05))


def test_housing_from_arrays() -> None:
    nodes, tets = tube()
    flat = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    with pytest.raises(InputError, match="are fixed"):
        Housing.from_arrays(nodes, tets, [AXIS], flat)
    outside = np.flatnonzero(np.linalg.norm(nodes[:, 1:], axis=1) > 0.035 - 1e-9)
    housing = Housing.from_arrays(nodes, tets, [AXIS], outside)
    (bore,) = housing.attachments
    np.testing.assert_allclose(bore.point, [0.03, 0.0, 0.0], atol=1e-15)
    np.testing.assert_array_equal(bore.axis, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(np.linalg.norm(nodes[bore.nodes, 1:], axis=1), 0.02, rtol=1e-12)
    assert housing.attachments[0].name == "1"
    body = housing.reduce(3)
    assert body.size == 6 + 3 + 6
    mask = np.zeros(len(nodes), dtype=bool)
    mask[outside] = True
    same = Housing.from_arrays(nodes, tets, [Bore(*AXIS, name="main")], mask, material=Material())  # type: ignore[arg-type]
    np.testing.assert_array_equal(same.fixed, housing.fixed)
    assert same.attachments[0].name == "main"


def test_material_is_no_bore() -> None:
    """A radius in millimetres, or a bore where the mesh is solid, would make material rigid without a word."""
    nodes, tets = tube()
    with pytest.raises(InputError, match="material, not a bore"):
        Housing.from_arrays(nodes, tets, [(AXIS[0], AXIS[1], 20.0, AXIS[3])])
    solid, cells = box((4, 4, 4), (0.1, 0.1, 0.1))
    with pytest.raises(InputError, match="material, not a bore"):
        Housing.from_arrays(solid, cells, [((0.05, 0.05, 0.0), (0.0, 0.0, 1.0), 0.04, (0.0, 0.1))])


def test_reference_point_is_no_node_mean() -> None:
    """Half a bore: the mean of its nodes lies far off the axis, the reference point on it."""
    nodes, tets = tube()
    housing = Housing.from_arrays(nodes, tets, [AXIS])
    bore = housing.attachments[0]
    assert np.linalg.norm(nodes[bore.nodes].mean(axis=0)[1:]) > 0.01
    assert np.linalg.norm(bore.point[1:]) == 0.0
    # a rigid motion of the attachment is a rigid motion of its nodes
    matrix = interface_matrix(housing.attachments, nodes)
    moved = (matrix @ np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])).reshape(-1, 3)
    expected = np.array([1.0, 2.0, 3.0]) + np.cross([0.1, 0.2, 0.3], nodes[bore.nodes] - bore.point)
    np.testing.assert_allclose(moved[bore.nodes], expected, rtol=1e-12)
    assert not moved[np.setdiff1d(np.arange(len(nodes)), bore.nodes)].any()


def test_range_decides_where_the_bore_is() -> None:
    nodes, tets = tube()
    whole = Housing.from_arrays(nodes, tets, [Bore((0, 0, 0), (1, 0, 0), 0.02)])
    np.testing.assert_allclose(whole.attachments[0].point, [0.03, 0.0, 0.0], atol=1e-12)
    two = Housing.from_arrays(
        nodes, tets, [((0, 0, 0), (1, 0, 0), 0.02, (0.0, 0.02)), ((0, 0, 0), (-1, 0, 0), 0.02, (-0.06, -0.04))]
    )
    np.testing.assert_allclose([a.point[0] for a in two.attachments], [0.01, 0.05], atol=1e-12)
    long = Housing.from_arrays(nodes, tets, [((0, 0, 0), (1, 0, 0), 0.02, (-0.02, 0.06))])
    assert any("middle of the given range" in note for note in long.notes)


def test_meshes_of_gmsh_and_of_linear_elements() -> None:
    nodes, tets = tube()
    gmsh_order = tets.copy()
    gmsh_order[:, [8, 9]] = tets[:, [9, 8]]
    first, second = Housing.from_arrays(nodes, tets), Housing.from_arrays(nodes, gmsh_order)
    np.testing.assert_array_equal(first.mesh.cells, second.mesh.cells)
    extra = np.concatenate([np.full((5, 3), 9.9), nodes])
    shifted = Housing.from_arrays(extra, tets + 5, [AXIS], np.array([5 + int(tets.max()), 2]))
    assert any("5 nodes belong to no element" in note for note in shifted.notes)
    np.testing.assert_array_equal(shifted.nodes, nodes)
    np.testing.assert_array_equal(shifted.fixed, [tets.max()])
    linear = Housing.from_arrays(*tube(order=1), [AXIS])
    assert any("too stiff" in note for note in linear.notes)
    assert linear.reduce(3).size == 15


def test_mesh_straight_from_gmsh(tmp_path: Path) -> None:
    """A plate with a hole, meshed by gmsh, through meshio: numbers, order and orientation are understood."""
    import meshio

    with gmsh_session("plate") as gmsh:
        plate = gmsh.model.occ.addBox(0, 0, 0, 40, 30, 5)
        hole = gmsh.model.occ.addCylinder(20, 15, 0, 0, 0, 5, 6)
        gmsh.model.occ.cut([(3, plate)], [(3, hole)])
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 6)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "plate.msh"))
    mesh = meshio.read(tmp_path / "plate.msh")
    tets = np.concatenate([block.data for block in mesh.cells if block.type == "tetra10"])
    housing = Housing.from_arrays(
        1e-3 * mesh.points, tets, [((0.02, 0.015, 0.0), (0, 0, 1), 0.006, (0.0, 0.005))], ((0, 0, 0), (1, 0, 0))
    )
    assert housing.mass_kg == pytest.approx(7850e-9 * (40 * 30 * 5 - math.pi * 36 * 5), rel=1e-3)
    assert housing.reduce(4).coupled.frequencies_hz[0] > 100.0


def broken(change: str) -> tuple[np.ndarray, np.ndarray]:
    nodes, tets = box((2, 1, 1), (2.0, 1.0, 1.0), order=1)
    if change == "mirrored":
        tets[:, [0, 1]] = tets[:, [1, 0]]
    elif change == "inverted":
        tets[3, [0, 1]] = tets[3, [1, 0]]
    elif change == "flat":
        nodes[tets[0, 0]] = nodes[tets[0, 1]]
    elif change == "apart":
        tets = np.concatenate([tets, tets + len(nodes)])
        nodes = np.concatenate([nodes, nodes + 5.0])
    elif change == "edge":  # two boxes that share one edge only
        other = np.array([2.0, 1.0, 0.0]) + nodes
        merged = {tuple(p): i for i, p in enumerate(nodes.round(9).tolist())}
        numbers = [merged.get(tuple(p), len(nodes) + i) for i, p in enumerate(other.round(9).tolist())]
        tets = np.concatenate([tets, np.array(numbers)[tets]])
        nodes = np.concatenate([nodes, other])
    elif change == "doubled":
        tets = np.concatenate([tets, tets[:1]])
    elif change == "nan":
        nodes[2, 1] = np.nan
    elif change == "numbers":
        tets[0, 0] = 99
    elif change == "folded":
        nodes, tets = second_order(nodes, tets)
        nodes[tets[0, 4]] += 0.33 * (nodes[tets[0, 1]] - nodes[tets[0, 0]])
    elif change == "order":
        nodes, tets = second_order(nodes, tets)
        tets[:, [4, 9]] = tets[:, [9, 4]]
    return nodes, tets


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("mirrored", "all elements are mirrored"),
        ("inverted", r"1 inverted or collapsed elements \(3\)"),
        ("flat", "inverted or collapsed"),
        ("apart", "2 parts that share no face"),
        ("edge", "2 parts that share no face"),
        ("doubled", "three elements"),
        ("nan", "finite"),
        ("numbers", "node numbers"),
        ("order", "middle of its edge"),
    ],
)
def test_broken_meshes_are_named(change: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Housing.from_arrays(*broken(change))


@pytest.mark.parametrize(
    ("bore", "message"),
    [
        (((0, 0, 0), (1, 0, 0), 0.01, (0.0, 0.06)), "no node lies within.*nearest node there is 20"),
        (((0, 0, 0), (1, 0, 0), 0.02, (0.5, 0.6)), "those within its radius lie between"),
        (((0, 0, 0), (0, 0, 0), 0.02, (0.0, 0.06)), "direction"),
        (((0, 0, 0), (1, 0, 0), -0.02, (0.0, 0.06)), "radius"),
        (((0, 0, 0), (1, 0, 0), 0.02, (0.06, 0.0)), "begin < end"),
        (((0, 0), (1, 0, 0), 0.02, (0.0, 0.06)), "three finite numbers"),
        (((0, 0, 0), (1, 0, 0)), "axis point"),
    ],
)
def test_bad_bores_are_named(bore: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Housing.from_arrays(*tube(), [bore])


def test_bad_attachments_and_supports_are_named() -> None:
    nodes, tets = tube()
    point, axis = np.zeros(3), np.array([1.0, 0, 0])
    for attachments, message in (
        ([Attachment("a", point, axis, np.array([], dtype=int))], "names no node"),
        ([Attachment("a", point, axis, np.array([0, 1]))], "one line"),
        ([Attachment("a", point, axis, np.array([0, 10**6]))], "node numbers"),
        ([Attachment("a", point, axis, np.arange(9)), Attachment("b", point, axis, np.arange(8, 20))], "overlaps.*'a'"),
        ([Attachment("a", point, axis, np.arange(9)), Attachment("a", point, axis, np.arange(9, 20))], "this name"),
    ):
        with pytest.raises(InputError, match=message):
            Housing.from_arrays(nodes, tets, attachments=attachments)
    with pytest.raises(InputError, match="overlaps attachment '1'"):
        Housing.from_arrays(nodes, tets, [AXIS, AXIS])
    for fixed, message in (
        (Plane((0.0, 0.0, 9.0), (0.0, 0.0, 1.0)), "no node lies on this plane; the nearest is"),
        (Plane((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), "normal"),
        (np.array([], dtype=int), "names no node"),
        (np.zeros(3, dtype=bool), "one flag"),
        (np.array([[1.5, 2.0]]), "Plane"),
    ):
        with pytest.raises(InputError, match=message):
            Housing.from_arrays(nodes, tets, [], fixed)


def folded_disc(sag: float, thickness: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Box of (1, 1, thickness) whose bottom bulges into it by `sag` at midside nodes, and the volume that it loses.

    The midside node of an edge of the bottom moves up by `sag`; the bottom's triangles lose ``sag/3 area`` for each of
    their midside nodes (the integral of the quadratic function of a midside node is a third of the area).
    """
    nodes, tets = box((4, 4, 1), (1.0, 1.0, thickness))
    bottom = boundary_faces(tets)
    bottom = bottom[np.all(nodes[bottom, 2] < 1e-9, axis=1)]
    inner = [n for n in np.unique(bottom[:, 3:]) if 0.3 < nodes[n, 0] < 0.7 and 0.3 < nodes[n, 1] < 0.7]
    nodes[inner, 2] += sag
    corners = nodes[bottom[:, :3], :2]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    lost = sag / 3.0 * float(area @ np.isin(bottom[:, 3:], inner).sum(axis=1))
    return nodes, tets, lost


@pytest.mark.parametrize(("sag", "thickness"), [(0.065, 0.2), (0.08, 0.2), (0.06, 0.1)])
def test_folded_elements_follow_the_surface(sag: float, thickness: float) -> None:
    """Inner nodes move first; the mass is that of the given surface unless the surface itself had to move."""
    nodes, tets, lost = folded_disc(sag, thickness)
    assert jacobian_determinants(nodes, tets).min() <= 0.0
    housing = Housing.from_arrays(nodes, tets)
    assert jacobian_determinants(housing.nodes, housing.mesh.cells).min() > 0.0
    given = 7850.0 * (thickness - lost)
    assert housing.mass_kg - housing.added_kg == pytest.approx(given, rel=1e-9)
    note = next(note for note in housing.notes if "folded" in note)
    surface = np.unique(boundary_faces(tets))
    if housing.added_kg == 0.0:
        np.testing.assert_array_equal(housing.nodes[surface], nodes[surface])
        assert "the mass stay what" in note
    else:  # straight edges would give all of it back
        assert 0.0 < housing.added_kg < 0.5 * 7850.0 * lost
        assert f"{housing.added_kg:+.2g} kg" in note
    assert housing.reduce(2).added_kg == housing.added_kg


def test_unfolding_that_makes_another_body_is_refused() -> None:
    """A bulge beyond the other face: at most its part within the thickness can stay, so the rest comes back as mass."""
    nodes, tets, lost = folded_disc(0.06, 0.03)
    assert lost > 0.1 * 0.03
    with pytest.raises(InputError, match=r"curved edges folded .* changes the mass by \+\S+ %, more than 5 %"):
        Housing.from_arrays(nodes, tets)


def test_midside_nodes_are_moved_no_further_than_needed() -> None:
    """A midside node slid along its edge folds at a quadrature point beyond a quarter of it; it stays near there."""
    nodes, tets = broken("folded")
    housing = Housing.from_arrays(nodes, tets)
    assert jacobian_determinants(housing.nodes, housing.mesh.cells).min() > 0.0
    assert curved_elements(housing.nodes, housing.mesh.cells).any()
    assert housing.mass_kg == pytest.approx(7850.0 * 2.0, rel=1e-9)


def test_any_number_of_attachments() -> None:
    """No attachment at all, and many; the order of the coordinates is theirs."""
    nodes, tets = box((6, 1, 1), (0.6, 0.1, 0.1))
    left = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert Housing.from_arrays(nodes, tets, fixed=left).reduce(3).size == 3
    many = [
        Attachment(
            f"cut {x:.1f}", np.array([x, 0.05, 0.05]), np.array([1.0, 0, 0]), np.flatnonzero(np.isclose(nodes[:, 0], x))
        )
        for x in (0.6, 0.4, 0.2)
    ]
    body = Housing.from_arrays(nodes, tets, attachments=many, fixed=left).reduce(3)
    assert body.attachment_names == ("cut 0.6", "cut 0.4", "cut 0.2")
    assert body.attachment("cut 0.2") == slice(12, 18)
    # pulled at its end, the bar's cuts move in proportion (nu = 0.3 only matters between rigid cuts)
    load = np.zeros(body.size)
    load[0] = 1.0
    u = np.linalg.solve(body.stiffness, load)
    assert u[0] > u[6] > u[12] > 0.0
