"""Tetrahedral elasticity against theory: patch test, Lame ring, exact bending and longitudinal vibration, rates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTetP1, ElementTetP2, ElementVector, MeshTet1, MeshTet2
from skfem.assembly import Dofs
from skfem.helpers import ddot, div, sym_grad

from gearfe.base.errors import InputError
from gearfe.fem.bodies.mesh_checks import boundary_faces
from gearfe.fem.bodies.meshes import Tetrahedra
from gearfe.fem.bodies.surface import nodal_normals, triangle_functions
from gearfe.fem.plane import Material
from gearfe.fem.reduction.lanczos import lowest_modes
from gearfe.fem.reduction.sparse_solver import factorize
from gearfe.fem.solid import CURVED_DEGREE, assemble, curved_elements, jacobian_determinants
from tests.makers.housing_meshes import box, surface_area

STEEL = Material()
RNG = np.random.default_rng(7)


def wavy(points: np.ndarray) -> np.ndarray:
    """A smooth map that bends every edge."""
    x, y, z = points.T
    return np.column_stack([x + 0.03 * np.sin(2 * y + z), y + 0.04 * np.sin(3 * x), z + 0.03 * np.cos(2 * x + y)])


def skfem_mesh(nodes: np.ndarray, tets: np.ndarray) -> Any:
    """scikit-fem mesh of the elements, geometry of the same order as the elements (``MeshTet1`` or ``MeshTet2``).

    scikit-fem numbers vertices first and midside nodes by its own edges, so node numbers change; element order and the
    order of nodes within an element stay.
    """
    corners, renumbered = np.unique(tets[:, :4], return_inverse=True)
    linear = MeshTet1(
        np.ascontiguousarray(nodes[corners].T), np.ascontiguousarray(renumbered.reshape(-1, 4).T), validate=False
    )
    if tets.shape[1] == 4:
        return linear
    dofs = Dofs(linear, ElementTetP2())
    locations = np.zeros((3, dofs.N))
    locations[:, dofs.element_dofs.T] = nodes[tets].transpose(2, 0, 1)
    return MeshTet2(locations, linear.t, validate=False)


def general_element_matrices(nodes: np.ndarray, tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (m, a, 3, a, 3) and mass of one axis (m, a, a) of any tetrahedra, curved or not, by scikit-fem's weak
    forms and isoparametric maps.

    The exact mass of a curved second-order element needs degree 7 (4 from the product, 3 from the volume ratio).
    """
    lam, mu = STEEL.lame()

    @BilinearForm
    def stiffness(u: Any, v: Any, _: Any) -> Any:
        return lam * div(u) * div(v) + 2.0 * mu * ddot(sym_grad(u), sym_grad(v))

    @BilinearForm
    def mass(u: Any, v: Any, _: Any) -> Any:
        return STEEL.density * u * v

    scalar = ElementTetP1() if tets.shape[1] == 4 else ElementTetP2()
    mesh = skfem_mesh(nodes, tets)
    a = tets.shape[1]
    exact_order = 2 if a == 4 else 7
    k = stiffness.coo_data(Basis(mesh, ElementVector(scalar), intorder=1 if a == 4 else CURVED_DEGREE)).tolocal()
    m = mass.coo_data(Basis(mesh, scalar, intorder=exact_order)).tolocal()
    return k.reshape(len(tets), a, 3, a, 3), m


def general_matrices(nodes: np.ndarray, tets: np.ndarray) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Matrices summed from scikit-fem's general vector forms, the independent route."""
    stiffness, mass = general_element_matrices(nodes, tets)
    a, n = tets.shape[1], len(nodes)
    rows = (3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), -1)
    at = (np.repeat(rows, 3 * a, axis=1).ravel(), np.tile(rows, (1, 3 * a)).ravel())
    k = sparse.csr_array((stiffness.ravel(), at), shape=(3 * n, 3 * n))
    at = (np.repeat(tets, a, axis=1).ravel(), np.tile(tets, (1, a)).ravel())
    return k, sparse.csr_array((mass.ravel(), at), shape=(n, n))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("bent", [False, True])
def test_blocks_equal_the_general_forms(order: int, bent: bool) -> None:
    nodes, tets = box((2, 2, 3), (1.0, 0.8, 1.1), order=order, mapped=wavy if bent else None)
    assert curved_elements(nodes, tets).any() == (bent and order == 2)
    found = assemble(nodes, tets, STEEL)
    k, m = general_matrices(nodes, tets)
    assert abs(found.stiffness - k).max() < 1e-13 * abs(k).max()
    assert abs(found.nodal_mass - m).max() < 1e-13 * abs(m).max()
    assert abs(found.mass - sparse.kron(m, np.eye(3))).max() < 1e-13 * abs(m).max()


def test_straight_and_curved_elements_mix() -> None:
    nodes, tets = box((3, 2, 2), (1.0, 1.0, 1.0))
    moved = tets[:3, 4:].ravel()
    nodes[moved] += RNG.uniform(-0.01, 0.01, (len(moved), 3))
    assert 0 < curved_elements(nodes, tets).sum() < len(tets)
    found = assemble(nodes, tets, STEEL)
    k, m = general_matrices(nodes, tets)
    assert abs(found.stiffness - k).max() < 1e-13 * abs(k).max()
    assert abs(found.nodal_mass - m).max() < 1e-13 * abs(m).max()


def test_skfem_mesh_keeps_elements_and_geometry() -> None:
    nodes, tets = box((2, 1, 1), (1.0, 1.0, 1.0), mapped=wavy)
    mesh = skfem_mesh(nodes, tets)
    np.testing.assert_array_equal(mesh.doflocs[:, mesh.dofs.element_dofs].transpose(2, 1, 0), nodes[tets])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("bent", [False, True])
def test_patch_test(order: int, bent: bool) -> None:
    """A linear displacement leaves no force inside and stores the energy of its constant strain."""
    nodes, tets = box((3, 3, 3), (1.0, 1.0, 1.0), order=order, mapped=wavy if bent else None)
    gradient = np.array([[1.0, 0.3, -0.2], [0.1, -0.5, 0.4], [0.6, 0.2, 0.7]]) * 1e-3
    found = assemble(nodes, tets, STEEL)
    u = (nodes @ gradient.T).ravel()
    force = (found.stiffness @ u).reshape(-1, 3)
    inside = np.setdiff1d(np.arange(len(nodes)), boundary_faces(tets))
    assert len(inside) > 0
    # curved elements integrate rational functions: the patch test holds to the quadrature's error
    assert np.abs(force[inside]).max() < (1e-3 if bent and order == 2 else 1e-12) * np.abs(force).max()
    if not bent:
        strain = 0.5 * (gradient + gradient.T)
        lam, mu = STEEL.lame()
        density = lam * np.trace(strain) ** 2 + 2 * mu * np.sum(strain**2)
        assert u @ force.ravel() == pytest.approx(density * 1.0, rel=1e-12)


def test_rigid_motions_cost_nothing_and_carry_the_mass() -> None:
    nodes, tets = box((2, 2, 2), (0.2, 0.1, 0.3), mapped=lambda p: p + 0.004 * np.sin(20 * p[:, [1, 2, 0]]))
    found = assemble(nodes, tets, STEEL)
    scale = abs(found.stiffness).max()
    for axis in range(3):
        shift = np.zeros_like(nodes)
        shift[:, axis] = 1.0
        turn = np.cross(np.eye(3)[axis], nodes)
        for motion in (shift, turn):
            assert np.abs(found.stiffness @ motion.ravel()).max() < 1e-12 * scale
    volume = jacobian_determinants(*box((2, 2, 2), (0.2, 0.1, 0.3), order=1)).sum() / 6
    assert volume == pytest.approx(0.006, rel=1e-12)
    straight = assemble(*box((2, 2, 2), (0.2, 0.1, 0.3)), STEEL)
    assert straight.nodal_mass.sum() == pytest.approx(0.006 * STEEL.density, rel=1e-12)


def lame_errors(divisions: int) -> tuple[float, float]:
    """Relative errors of a quarter ring under inner pressure in plane strain: of its energy and of its inner radius."""
    inner, outer, pressure = 1.0, 2.0, 1e6

    def ring(p: np.ndarray) -> np.ndarray:
        radius, angle = inner + p[:, 0], p[:, 1]
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), p[:, 2]])

    nodes, tets = box((divisions, 2 * divisions, 1), (outer - inner, np.pi / 2, 0.3), mapped=ring)
    k = assemble(nodes, tets, STEEL).stiffness.tocsr()
    faces = boundary_faces(tets)
    faces = faces[np.all(np.abs(np.linalg.norm(nodes[faces][..., :2], axis=2) - inner) < 1e-9, axis=1)]
    functions = triangle_functions(faces.shape[1])
    force = np.zeros((len(nodes), 3))
    np.add.at(force, faces, -pressure * np.einsum("ap,fpk->fak", functions.values, functions.areas(nodes[faces])))
    held = np.zeros((len(nodes), 3), dtype=bool)
    held[:, 2] = True
    held[np.abs(nodes[:, 1]) < 1e-9, 1] = True
    held[np.abs(nodes[:, 0]) < 1e-9, 0] = True
    free = np.flatnonzero(~held.ravel())
    u = np.zeros(nodes.size)
    u[free] = spsolve(k[free][:, free].tocsc(), force.ravel()[free])
    # Timoshenko, Goodier, Theory of Elasticity, 3rd ed., art. 28, plane strain
    nu, e = STEEL.poisson_ratio, STEEL.youngs_modulus
    exact = (1 + nu) / e * pressure * inner**2 / (outer**2 - inner**2) * ((1 - 2 * nu) * inner + outer**2 / inner)
    work = pressure * exact * 0.3 * inner * np.pi / 2
    radial = u.reshape(-1, 3)[np.abs(nodes[:, 1]) + np.abs(nodes[:, 0] - inner) < 1e-9, 0]
    return 1.0 - float(u @ force.ravel()) / work, float(np.abs(radial / exact - 1.0).max())


def test_lame_ring_with_its_rate() -> None:
    """Energy (fourth order, from below) and displacement of the inner wall."""
    sizes = np.array([3, 4, 6])
    energy, radial = np.array([lame_errors(n) for n in sizes]).T
    assert np.all(energy > 0.0)
    rate = -np.polyfit(np.log(sizes), np.log(energy), 1)[0]
    assert rate > 3.5, (energy, rate)
    assert radial[-1] < 1e-3


def bar_frequency(cells: int, order: int) -> float:
    """First longitudinal frequency (Hz) of a free bar, nu = 0: exactly c / (2 L) in three dimensions too."""
    material = Material(200e9, 0.0, 7850.0)
    nodes, tets = box((cells, 1, 1), (1.0, 0.1, 0.1), order=order)
    found = assemble(nodes, tets, material)
    # motion along x only, constant over the section, is what the mode is: project on it
    planes = np.unique(np.round(nodes[:, 0], 12))
    place = np.searchsorted(planes, np.round(nodes[:, 0], 12))
    section = sparse.csr_array(
        (np.ones(len(nodes)), (3 * np.arange(len(nodes)), place)), shape=(nodes.size, len(planes))
    )
    k, m = ((section.T @ matrix @ section).toarray() for matrix in (found.stiffness, found.mass))
    values = np.sort(np.linalg.eigvals(np.linalg.solve(m, k)).real)
    return float(np.sqrt(values[1]) / (2 * np.pi))


@pytest.mark.parametrize(("order", "rate"), [(1, 2), (2, 4)])
def test_bar_frequencies_fall_to_the_exact_one_with_the_rate(order: int, rate: int) -> None:
    exact = np.sqrt(200e9 / 7850.0) / 2.0
    cells = np.array([2, 4, 8])
    errors = np.array([bar_frequency(n, order) for n in cells]) / exact - 1.0
    assert np.all(errors > 0.0)
    assert np.all(np.diff(errors) < 0.0)
    assert -np.polyfit(np.log(cells), np.log(errors), 1)[0] == pytest.approx(rate, abs=0.15)


def test_clamped_square_plate() -> None:
    """First frequency against thin-plate theory: lambda^2 = 35.99 (Leissa, Vibration of Plates, NASA SP-160, 4.23).

    A plate of a/h = 50: shear lowers the true frequency by less than 0.5 %, the mesh raises it, less and less.
    """
    a, h, e, nu, rho = 1.0, 0.02, 200e9, 0.3, 7850.0
    stiffness = e * h**3 / (12 * (1 - nu**2))
    theory = 35.99 / a**2 * np.sqrt(stiffness / (rho * h))
    found = []
    for cells in (10, 16, 24):
        nodes, tets = box((cells, cells, 1), (a, a, h))
        body = assemble(nodes, tets, Material(e, nu, rho))
        edge = (np.minimum(nodes[:, :2], a - nodes[:, :2]) < 1e-9).any(axis=1)
        free = (3 * np.flatnonzero(~edge)[:, None] + np.arange(3)).ravel()
        k, m = body.stiffness.tocsr()[free][:, free], body.nodal_mass[free[::3] // 3][:, free[::3] // 3]
        found.append(
            np.sqrt(lowest_modes(factorize(k).solve, sparse.kron(m, np.eye(3), format="csr"), count=1).eigenvalues[0])
        )
    assert np.all(np.diff(found) < 0.0)
    assert found[-1] == pytest.approx(theory, rel=0.01)


def test_outer_surface_of_a_box() -> None:
    nodes, tets = box((2, 3, 2), (1.0, 2.0, 0.5))
    faces = boundary_faces(tets)
    assert surface_area(nodes, faces) == pytest.approx(2 * (2.0 + 0.5 + 1.0), rel=1e-12)
    normals = nodal_normals(nodes, faces)
    middle = int(np.flatnonzero((nodes[:, 2] == 0.5) & (nodes[:, 0] == 0.5) & (nodes[:, 1] > 0) & (nodes[:, 1] < 2))[0])
    np.testing.assert_allclose(normals[middle], [0, 0, 1], atol=1e-12)
    assert not normals[np.setdiff1d(np.arange(len(nodes)), faces)].any()
    # v = (x, 0, 0): v.n = 1 on the face x = 1 of area 1; v = (0, 0, 1): both faces of area 2; v = y e_x: y^2 on x = 1
    motions = np.zeros((len(nodes), 3, 3))
    motions[:, 0, 0], motions[:, 2, 1], motions[:, 0, 2] = nodes[:, 0], 1.0, nodes[:, 1]
    matrix = Tetrahedra(nodes, tets).surface([]).radiation(motions.reshape(-1, 3))
    np.testing.assert_allclose(np.diag(matrix), [1.0, 4.0, 2 * 0.5 * 8 / 3], rtol=1e-12)


@pytest.mark.parametrize(
    ("values", "name"),
    [((0.0, 0.3, 1.0), "youngs_modulus"), ((1.0, 0.5, 1.0), "poisson_ratio"), ((1.0, 0.3, -1.0), "density")],
)
def test_impossible_materials_are_named(values: tuple[float, float, float], name: str) -> None:
    with pytest.raises(InputError, match=name):
        Material(*values)
