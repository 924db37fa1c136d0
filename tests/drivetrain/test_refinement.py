"""Refinement of tetrahedra: the body stays, meshes conform, frequencies fall below those of uniform meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.housing import HousingTable
from gearfe.drivetrain.housing.build import housing_from_table
from gearfe.drivetrain.housing.model import Housing
from gearfe.drivetrain.housing.refinement import refined
from gearfe.fem.bodies.bisection import bisected
from gearfe.fem.bodies.mesh_checks import boundary_faces, checked_mesh
from gearfe.fem.plane import Material
from gearfe.fem.reduction.error import mesh_error
from gearfe.fem.solid import EDGES, FACES, assemble
from tests.makers.housing_meshes import bent, box, second_order, surface_area
from tests.places import MESHES


def shape(nodes: np.ndarray, tets: np.ndarray) -> float:
    """Least quality of the corners' tetrahedra: 1 for a regular one, 0 for a flat one."""
    corners = nodes[tets[:, :4]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    length = np.linalg.norm(corners[:, EDGES[:, 0]] - corners[:, EDGES[:, 1]], axis=2)
    return float((np.sqrt(2.0) * volume / np.mean(length**2, axis=1) ** 1.5).min())


def test_cut_elements_fill_the_same_body_and_meet_face_to_face() -> None:
    """Curved elements, chosen at random four times over: volume, surface, faces, midside nodes, sets of nodes."""
    nodes, tets = box((3, 2, 2), (1.0, 0.5, 0.5), mapped=bent)
    flat = box((3, 2, 2), (1.0, 0.5, 0.5))[0]
    members = np.array([flat[:, 0] < 1e-9, flat[:, 2] < 1e-9])
    generator = np.random.default_rng(3)
    steel, quality = Material(), shape(nodes, tets)
    mass = assemble(nodes, tets, steel).nodal_mass.sum()
    area = surface_area(nodes, boundary_faces(tets))
    held = surface_area(nodes, faces_within(tets, members[0]))
    for _ in range(4):
        chosen = generator.choice(len(tets), max(1, len(tets) // 60), replace=False)
        before = len(tets)
        nodes, tets, members = bisected(nodes, tets, chosen, members)
        assert len(tets) >= before + 7 * len(chosen)
        assert np.array_equal(np.unique(tets), np.arange(len(nodes)))
        faces = np.sort(tets[:, FACES[:, :3]].reshape(-1, 3), axis=1)
        assert np.unique(faces, axis=0, return_counts=True)[1].max() == 2
        ends, place = np.unique(np.sort(tets[:, EDGES].reshape(-1, 2), axis=1), axis=0, return_inverse=True)
        assert len(np.unique(np.column_stack([place.ravel(), tets[:, 4:].ravel()]), axis=0)) == len(ends)
        assert assemble(nodes, tets, steel).nodal_mass.sum() == pytest.approx(mass, rel=1e-12)
        assert surface_area(nodes, boundary_faces(tets)) == pytest.approx(area, rel=1e-9)
        assert surface_area(nodes, faces_within(tets, members[0])) == pytest.approx(held, rel=1e-9)
        assert checked_mesh(nodes, tets).notes == ()
    assert shape(nodes, tets) > 0.3 * quality  # angles stay bounded


def faces_within(tets: np.ndarray, member: np.ndarray) -> np.ndarray:
    faces = boundary_faces(tets)
    return np.asarray(faces[member[faces].all(axis=1)])


def ell(cells: int) -> Housing:
    """An angle of two legs, held at the end of one: its inner edge is re-entrant."""
    nodes, tets = box((3 * cells, cells, 3 * cells), (0.12, 0.04, 0.12), order=1)
    centre = nodes[tets].mean(axis=1)
    tets = tets[(centre[:, 0] < 0.04) | (centre[:, 2] < 0.04)]
    used, numbers = np.unique(tets, return_inverse=True)
    nodes, tets = second_order(nodes[used], numbers.reshape(tets.shape))
    return Housing.from_arrays(nodes, tets, fixed=((0, 0, 0.12), (0, 0, 1)))


def frequencies(housing: Housing) -> np.ndarray:
    return housing.reduce(6, quasi_static=0, estimate=False).coupled.frequencies_hz[:4]


def test_frequencies_of_fewer_unknowns_are_below_those_of_a_uniform_mesh() -> None:
    """Frequencies come from above, so the lower ones are nearer; refined spaces hold the coarser ones."""
    coarse, uniform = ell(1), ell(5)
    one = refined(coarse, 4000)
    two = refined(coarse, 12_000)
    assert coarse.unknowns < one.unknowns <= 4000 < two.unknowns <= 12_000 < 0.7 * uniform.unknowns
    assert np.all(frequencies(one) < frequencies(coarse))
    assert np.all(frequencies(two) < frequencies(uniform))
    true = frequencies(one) / frequencies(two) - 1.0  # the finer one errs as well, by a part of that
    assert np.all(true < mesh_error(one.reduce(12), 3000.0).frequency_errors[:4])
    assert two.notes[-1].startswith(f"the mesh was refined from {coarse.unknowns} to {two.unknowns} unknowns")
    assert np.array_equal(two.original[: len(coarse.nodes)], coarse.original)
    assert np.all(two.original[len(coarse.nodes) :] == -1)


def table(**keys: Any) -> HousingTable:
    bores = [{"group": f"bore_{i}"} for i in (1, 2, 3, 4)]
    return build(HousingTable, {"mesh": "box.msh", "bores": bores, "held": [{"group": "feet"}], **keys}, "housing")


def test_a_mesh_file_is_refined_with_its_bores_and_held_faces() -> None:
    given = housing_from_table(table(), MESHES)
    made = housing_from_table(table(mesh={"file": "box.msh", "refine_to_unknowns": 25_000}), MESHES)
    assert given.unknowns < made.unknowns <= 25_000
    for one, two in zip(given.attachments, made.attachments, strict=True):
        assert (one.name, one.point.tolist(), one.axis.tolist()) == (two.name, two.point.tolist(), two.axis.tolist())
        assert set(one.nodes) <= set(two.nodes)
    for old, new in zip(
        [given.fixed, *(a.nodes for a in given.attachments)], [made.fixed, *(a.nodes for a in made.attachments)],
        strict=True,
    ):  # fmt: skip
        areas = [
            surface_area(h.nodes, faces_within(h.mesh.cells, np.isin(np.arange(len(h.nodes)), chosen)))
            for h, chosen in ((given, old), (made, new))
        ]
        assert areas[1] == pytest.approx(areas[0], rel=1e-6)  # of curved faces, by points
    assert np.all(frequencies(made) < frequencies(given))


@pytest.mark.parametrize(
    ("mesh", "part"),
    [
        (
            {"size_mm": 8.0, "refine_to_unknowns": 50_000},
            "= 50000: refines a mesh of the user's own",
        ),
        ({"file": "box.msh", "refine_to_unknowns": 500}, "= 500: must be finite and >= 1000"),
        ({"file": "box.msh", "refine_to_unknowns": 9000}, "the mesh has 16152 unknowns already"),
    ],
)
def test_what_cannot_be_refined_is_told(mesh: dict[str, Any], part: str) -> None:
    keys: dict[str, Any] = {} if "file" in mesh else {"bores": [], "held": []}
    with pytest.raises(InputError, match=part):
        housing_from_table(table(mesh=mesh, **keys), MESHES)


def test_linear_elements_are_not_refined() -> None:
    nodes, tets = box((4, 2, 1), (0.4, 0.1, 0.02), order=1)
    with pytest.raises(InputError, match="second order only; export the mesh with midside nodes"):
        refined(Housing.from_arrays(nodes, tets, fixed=((0, 0, 0), (1, 0, 0))), 5000)
