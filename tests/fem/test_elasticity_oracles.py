"""Plane elasticity of curved second-order triangles against closed solutions."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import spsolve

from gearfe.fem.plane import Material, Plane, element_stiffness, physical_gradients, stress_rows, triangle_shapes

MATERIAL = Material(200e9, 0.30)
WIDTH = 10e-3
GAUSS, GAUSS_WEIGHTS = 0.5 + 0.5 * np.polynomial.legendre.leggauss(4)[0], 0.5 * np.polynomial.legendre.leggauss(4)[1]


def _grid(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the unit square (on a lattice twice as fine) and six-node triangles, diagonals alternating."""
    x, y = np.meshgrid(np.linspace(0, 1, 2 * columns + 1), np.linspace(0, 1, 2 * rows + 1), indexing="ij")

    def number(i: int, j: int) -> int:
        return i * (2 * rows + 1) + j

    triangles = []
    for i in range(0, 2 * columns, 2):
        for j in range(0, 2 * rows, 2):
            a, b, c, d = (i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2)
            halves = [(a, b, c), (a, c, d)] if (i + j) % 4 == 0 else [(a, b, d), (b, c, d)]
            for p, q, r in halves:
                middles = [((u[0] + v[0]) // 2, (u[1] + v[1]) // 2) for u, v in ((p, q), (q, r), (r, p))]
                triangles.append([number(*node) for node in (p, q, r, *middles)])
    return np.stack([x.ravel(), y.ravel()], axis=1), np.array(triangles)


def _assembled(points: np.ndarray, triangles: np.ndarray, plane: Plane) -> csc_matrix:
    blocks = element_stiffness(points[triangles], MATERIAL, plane, WIDTH)
    unknowns = (2 * triangles[:, :, None] + np.arange(2)).reshape(len(triangles), 12)
    rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
    size = 2 * len(points)
    return coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsc()


def _edge_load(points: np.ndarray, edges: np.ndarray, traction) -> np.ndarray:
    """Consistent nodal forces of traction(x), Pa, on quadratic edges (start, middle, end)."""
    xi = GAUSS[:, None]
    shapes = np.concatenate([(1 - xi) * (1 - 2 * xi), 4 * xi * (1 - xi), xi * (2 * xi - 1)], axis=1)
    slopes = np.concatenate([4 * xi - 3, 4 - 8 * xi, 4 * xi - 1], axis=1)
    force = np.zeros_like(points)
    for edge in edges:
        length = np.linalg.norm(slopes @ points[edge], axis=1)
        values = traction(shapes @ points[edge])
        force[edge] += WIDTH * shapes.T @ (values * (length * GAUSS_WEIGHTS)[:, None])
    return force.ravel()


def _solved(stiffness: csc_matrix, force: np.ndarray, fixed: np.ndarray, values: np.ndarray) -> np.ndarray:
    free = np.setdiff1d(np.arange(len(force)), fixed)
    u = np.zeros(len(force))
    u[fixed] = values
    u[free] = spsolve(stiffness[free][:, free], force[free] - stiffness[free][:, fixed] @ values)
    return u.reshape(-1, 2)


def _stress(gradients: np.ndarray, u: np.ndarray, plane: Plane) -> np.ndarray:
    """Stresses xx, yy, zz, xy; nothing strains along the axis in plane strain."""
    xx, yy, xy = np.moveaxis(np.einsum("mqsai,mai->mqs", stress_rows(gradients, MATERIAL, plane), u), -1, 0)
    zz = MATERIAL.poisson_ratio * (xx + yy) if plane == "strain" else 0 * xx
    return np.stack([xx, yy, zz, xy], axis=-1)


def _slope(sizes: list[float], errors: list[float]) -> float:
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize(("inner", "outer"), [(100e6, 0.0), (0.0, 60e6)])
def test_lame_ring_under_inner_or_outer_pressure(plane: Plane, inner: float, outer: float) -> None:
    """Timoshenko & Goodier, Theory of Elasticity, art. 28: sigma_r = A - B/r^2, sigma_t = A + B/r^2."""
    a, b = 0.02, 0.05
    e, nu = MATERIAL.youngs_modulus, MATERIAL.poisson_ratio
    big_a = (inner * a**2 - outer * b**2) / (b**2 - a**2)
    big_b = (inner - outer) * a**2 * b**2 / (b**2 - a**2)

    def radial(r: np.ndarray) -> np.ndarray:
        if plane == "stress":
            return ((1 - nu) * big_a * r + (1 + nu) * big_b / r) / e
        return (1 + nu) / e * ((1 - 2 * nu) * big_a * r + big_b / r)

    sizes, of_u, of_stress = [], [], []
    for n in (2, 4, 8):
        unit, triangles = _grid(n, n)
        r, angle = a + (b - a) * unit[:, 0], 0.5 * np.pi * unit[:, 1]
        points = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
        lattice = np.arange(len(points)).reshape(2 * n + 1, 2 * n + 1)
        ends = [np.stack([line[:-2:2], line[1::2], line[2::2]], axis=1) for line in (lattice[0], lattice[-1])]
        force = _edge_load(points, ends[0], lambda x: inner * x / np.linalg.norm(x, axis=1)[:, None])
        force += _edge_load(points, ends[1], lambda x: -outer * x / np.linalg.norm(x, axis=1)[:, None])
        held = np.concatenate([2 * lattice[:, 0] + 1, 2 * lattice[:, -1]])  # symmetry of the quarter
        u = _solved(_assembled(points, triangles, plane), force, held, np.zeros(len(held)))
        exact = radial(r)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        middle = triangle_shapes(np.array([1 / 3]), np.array([1 / 3]))
        gradients, _ = physical_gradients(points[triangles], middle[1])
        found = _stress(gradients, u[triangles], plane)[:, 0]
        sizes.append(1 / n)
        of_u.append(float(np.linalg.norm(u - exact) / np.linalg.norm(exact)))
        trace = 2 * big_a * (1 + (nu if plane == "strain" else 0))
        of_stress.append(float(np.sqrt(np.mean((found[:, :3].sum(axis=1) / trace - 1) ** 2))))
    assert _slope(sizes, of_u) > 2.8
    assert _slope(sizes, of_stress) > 1.7
    assert of_u[-1] < 2e-4


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_cantilever_with_the_exact_boundary_displacements_and_tractions(plane: Plane) -> None:
    """Timoshenko & Goodier, art. 21: end load P, parabolic shear; the exact displacements are cubic."""
    length, half, load = 0.2, 0.02, 5e3
    e, nu = MATERIAL.youngs_modulus, MATERIAL.poisson_ratio
    inertia = 2 / 3 * half**3 * WIDTH
    shear = e / (2 * (1 + nu))
    if plane == "strain":
        e, nu = e / (1 - nu**2), nu / (1 - nu)

    def exact(x: np.ndarray) -> np.ndarray:
        # load P downwards at x = 0, the point (length, 0) fixed with a vertical element there held
        s, y = x[:, 0], x[:, 1]
        u = -load * s**2 * y / (2 * e * inertia) - nu * load * y**3 / (6 * e * inertia)
        u += load * y**3 / (6 * shear * inertia)
        u += (load * length**2 / (2 * e * inertia) - load * half**2 / (2 * shear * inertia)) * y
        v = nu * load * s * y**2 / (2 * e * inertia) + load * s**3 / (6 * e * inertia)
        v += -load * length**2 * s / (2 * e * inertia) + load * length**3 / (3 * e * inertia)
        return np.stack([u, v], axis=1)

    sizes, errors = [], []
    for n in (1, 2, 4):
        unit, triangles = _grid(5 * n, n)
        points = np.stack([length * unit[:, 0], half * (2 * unit[:, 1] - 1)], axis=1)
        lattice = np.arange(len(points)).reshape(10 * n + 1, 2 * n + 1)
        edges = np.stack([lattice[0][:-2:2], lattice[0][1::2], lattice[0][2::2]], axis=1)

        def traction(x: np.ndarray) -> np.ndarray:
            # the face x = 0 looks to -x: its traction is -sigma_xy
            return np.stack([0 * x[:, 0], load / (2 * inertia) * (half**2 - x[:, 1] ** 2)], axis=1)

        force = _edge_load(points, edges, traction)
        held = (2 * lattice[-1][:, None] + np.arange(2)).ravel()
        u = _solved(_assembled(points, triangles, plane), force, held, exact(points[lattice[-1]]).ravel())
        sizes.append(1 / n)
        errors.append(float(np.linalg.norm(u - exact(points)) / np.linalg.norm(exact(points))))
    assert _slope(sizes, errors) > 2.8
    assert errors[-1] < 1e-4


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_linear_displacements_pass_the_patch_test_on_curved_triangles(plane: Plane) -> None:
    """Any linear field: constant stress inside, no force on inner nodes, whatever the curvature of the edges."""
    unit, triangles = _grid(3, 3)
    r, angle = 0.02 + 0.03 * unit[:, 0], 1.2 * unit[:, 1]
    points = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
    slope = np.array([[1.3e-4, -2.1e-4], [0.7e-4, 2.9e-4]])
    u = points @ slope.T
    e, nu = MATERIAL.youngs_modulus, MATERIAL.poisson_ratio
    strain = 0.5 * (slope + slope.T)
    if plane == "stress":
        law = e / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    else:
        law = e / ((1 + nu) * (1 - 2 * nu)) * np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]])
    xx, yy, xy = law @ [strain[0, 0], strain[1, 1], 2 * strain[0, 1]]
    gradients, _ = physical_gradients(points[triangles], triangle_shapes(np.array([0.2, 0.6]), np.array([0.3, 0.1]))[1])
    found = _stress(gradients, u[triangles], plane)
    zz = nu * (xx + yy) if plane == "strain" else 0.0
    np.testing.assert_allclose(found, np.broadcast_to([xx, yy, zz, xy], found.shape), rtol=1e-9, atol=1e-9 * abs(xx))
    force = (_assembled(points, triangles, plane) @ u.ravel()).reshape(-1, 2)
    inner = np.all((unit > 0) & (unit < 1), axis=1)
    scale = np.abs(force).max()
    assert np.abs(force[inner]).max() < 1e-11 * scale
    assert np.abs(force.sum(axis=0)).max() < 1e-10 * scale
