"""Condensation and cyclic symmetry against plain sparse solves on the same mesh; surface stress of exact fields."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu, spsolve

from gearfe.fem.multifrontal import condense
from gearfe.fem.plane import element_stiffness
from gearfe.fem.reduction.sparse_solver import factorize
from gearfe.gears.contact.compliance import GearBody
from gearfe.gears.contact.flank import flank_of, normal_stress_rows
from gearfe.gears.teeth.whole_gear import whole_gear
from tests.makers.contact_cases import IRON, STEEL, WIDTH, bodies, meshes

COARSE = 5.0


def _sparse(points: np.ndarray, triangles: np.ndarray, material, plane) -> csc_matrix:
    blocks = element_stiffness(points[triangles], material, plane, WIDTH)
    unknowns = (2 * triangles[:, :, None] + np.arange(2)).reshape(len(triangles), 12)
    rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
    return coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(2 * len(points),) * 2).tocsc()


def _unknowns(nodes: np.ndarray) -> np.ndarray:
    return (2 * np.asarray(nodes)[:, None] + np.arange(2)).ravel()


def test_dissection_is_the_schur_complement_of_a_sparse_solve() -> None:
    mesh = meshes("modified", COARSE)[0]
    fixed = np.unique(mesh.boundaries["bore"])
    flank = flank_of(mesh, 4)
    retained = np.concatenate([flank.nodes, mesh.cut_right[:-1], mesh.cut_left[:-1]])
    corners = mesh.points[mesh.triangles]
    found = condense(
        mesh.triangles,
        element_stiffness(corners, STEEL, "strain", WIDTH),
        corners[:, :3].mean(axis=1),
        nodes=len(mesh.points),
        retained=retained,
        fixed=fixed,
    )
    stiffness = _sparse(mesh.points, mesh.triangles, STEEL, "strain")
    keep = _unknowns(retained)
    drop = np.setdiff1d(np.arange(2 * len(mesh.points)), np.concatenate([keep, _unknowns(fixed)]))
    inner = -spsolve(stiffness[drop][:, drop], stiffness[drop][:, keep]).toarray()
    schur = stiffness[keep][:, keep].toarray() + stiffness[keep][:, drop] @ inner
    np.testing.assert_allclose(found.schur, schur, rtol=0, atol=1e-11 * np.abs(schur).max())
    values = np.random.default_rng(1).normal(size=(len(keep), 3))
    field = found.recover(values)
    np.testing.assert_allclose(field[drop], inner @ values, rtol=0, atol=1e-11 * np.abs(values).max() * 10)
    assert (field[_unknowns(fixed)] == 0).all()
    for few in (drop[:2], drop[-3:], np.append(drop[:1], found.retained[:2])):  # forms that look into few fronts
        form = found.on_retained(np.ones((1, len(few))), few[None])
        np.testing.assert_allclose(form @ values, field[few].sum(axis=0)[None], rtol=0, atol=1e-12)


def test_fronts_of_elements_and_of_the_sparse_matrix_solve_alike() -> None:
    """Nothing retained: bisection of the elements and the elimination tree of METIS' order are two ways to fronts."""
    mesh = meshes("modified", COARSE)[1]
    fixed, corners = np.unique(mesh.boundaries["bore"]), mesh.points[mesh.triangles]
    found = condense(
        mesh.triangles,
        element_stiffness(corners, STEEL, "stress", WIDTH),
        corners[:, :3].mean(axis=1),
        nodes=len(mesh.points),
        retained=np.zeros(0, dtype=np.int64),
        fixed=fixed,
    )
    free = np.setdiff1d(np.arange(2 * len(mesh.points)), _unknowns(fixed))
    np.testing.assert_array_equal(np.sort(found.order), free)
    loads = np.random.default_rng(4).normal(size=(2 * len(mesh.points), 2))
    other = factorize(_sparse(mesh.points, mesh.triangles, STEEL, "stress")[free][:, free], block=2)
    expected = other.solve(loads[free])
    field = found.solve(loads)
    np.testing.assert_allclose(field[free], expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    assert (field[_unknowns(fixed)] == 0).all()


@pytest.mark.parametrize("gear", [0, 1])
def test_cyclic_compliance_is_that_of_the_whole_gear(gear: int) -> None:
    """Forces on tooth 0 of a gear with a fixed bore: displacements of its own and of other teeth, in their own axes."""
    body: GearBody = bodies("sharp", COARSE, "strain")[gear]
    whole = whole_gear(body.mesh)
    stiffness = _sparse(whole.points, whole.triangles, (STEEL, IRON)[gear], "strain")
    free = np.setdiff1d(np.arange(2 * len(whole.points)), _unknowns(np.unique(whole.boundaries["bore"])))
    rng = np.random.default_rng(2)
    loads = rng.normal(size=(2 * len(body.flank.nodes), 3))
    force = np.zeros((2 * len(whole.points), 3))
    force[_unknowns(whole.numbers[0][body.flank.nodes])] = loads
    displacement = np.zeros_like(force)
    displacement[free] = splu(stiffness[free][:, free]).solve(force[free])
    for tooth in (0, 1, 4, body.teeth - 1):
        expected = displacement[_unknowns(whole.numbers[tooth][body.flank.nodes])].reshape(-1, 2, 3)
        angle = 2 * np.pi * tooth / body.teeth
        c, s = np.cos(angle), np.sin(angle)
        expected = np.einsum("ji,njk->nik", np.array([[c, -s], [s, c]]), expected).reshape(-1, 3)
        found = body.interface @ (body.coupling[tooth] @ (body.interface.T @ loads))
        if tooth == 0:
            found = found + body.own @ loads
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(displacement).max())


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_surface_stress_of_a_linear_field_is_exact(plane: str) -> None:
    """n . sigma n for the constant stress of a linear displacement field; normals of the profile from the flank."""
    mesh = meshes("modified", COARSE)[1]
    unknowns, rows = normal_stress_rows(mesh, IRON, plane, 4)  # type: ignore[arg-type]
    slope = np.array([[1.3e-4, -2.1e-4], [0.7e-4, 2.9e-4]])
    found = np.einsum("eqi,ei->eq", rows, (mesh.points @ slope.T).ravel()[unknowns])
    e, nu = IRON.youngs_modulus, IRON.poisson_ratio
    if plane == "strain":  # Hooke's law of plane strain is that of plane stress with these
        e, nu = e / (1 - nu**2), nu / (1 - nu)
    xx, yy = slope[0, 0], slope[1, 1]
    sigma = e / (1 - nu**2) * np.array([[xx + nu * yy, 0], [0, yy + nu * xx]])
    sigma[0, 1] = sigma[1, 0] = e / (2 * (1 + nu)) * (slope[0, 1] + slope[1, 0])
    corners = mesh.points[mesh.contact_edges()]
    xi = 0.5 + 0.5 * np.polynomial.legendre.leggauss(4)[0]
    tangent = np.einsum("qa,eai->eqi", np.stack([4 * xi - 3, 4 - 8 * xi, 4 * xi - 1], axis=1), corners)
    normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    # outward: the tooth's left flank faces away from its centreline, y = 0
    assert (normal[len(normal) // 2 :, :, 1] > 0).all()
    expected = np.einsum("eqi,ij,eqj->eq", normal, sigma, normal)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(sigma).max())


def test_condensed_stress_follows_the_recovered_field() -> None:
    """Stress rows for forces = stress rows for displacements of the field that those forces cause."""
    body = bodies("sharp", COARSE, "stress")[0]
    loads = np.random.default_rng(3).normal(size=2 * len(body.flank.nodes))
    whole = whole_gear(body.mesh)
    stiffness = _sparse(whole.points, whole.triangles, STEEL, "stress")
    free = np.setdiff1d(np.arange(2 * len(whole.points)), _unknowns(np.unique(whole.boundaries["bore"])))
    force = np.zeros(2 * len(whole.points))
    force[_unknowns(whole.numbers[0][body.flank.nodes])] = loads
    u = np.zeros_like(force)
    u[free] = splu(stiffness[free][:, free]).solve(force[free])
    unknowns, rows = normal_stress_rows(body.mesh, STEEL, "stress", 4)
    on_sector = u[_unknowns(whole.numbers[0])]
    expected = np.einsum("eqi,ei->eq", rows, on_sector[unknowns]).ravel()
    found = body.stress_own @ loads + body.stress_interface @ (body.driven(0) @ loads)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
