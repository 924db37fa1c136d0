"""Extruded and twisted bodies: motions without energy, parity, plane strain."""

from __future__ import annotations

import numpy as np
import pytest

from gearfe.fem.extruded import _assembled, condense_extruded, lobatto_functions, section_integrals
from gearfe.fem.plane import Material, second_order

STEEL = Material()


def section():
    """Nodes and triangles of a rectangle beside the axis, 4 mm by 3 mm."""
    x, y = np.meshgrid(np.linspace(1e-3, 5e-3, 5), np.linspace(-1e-3, 2e-3, 4), indexing="ij")
    corners = np.stack([x.ravel(), y.ravel()], axis=1)
    cells = [(4 * i + j, 4 * i + 4 + j, 4 * i + 5 + j, 4 * i + 1 + j) for i in range(4) for j in range(3)]
    triangles = np.array([t for a, b, c, d in cells for t in ((a, b, c), (a, c, d))])
    points, quadratic, _ = second_order(corners, triangles)
    return points, quadratic


def stiffness(turn, functions):
    """The whole matrix: nodes, then v along x, v along y, w by functions."""
    points, triangles = section()
    rows = _assembled(triangles, section_integrals(points, triangles, STEEL, turn), functions, len(points))
    width = rows.blocks.shape[1]
    matrix = np.zeros((len(points), width, len(points), width))
    row = np.repeat(np.arange(len(points)), np.diff(rows.starts))
    matrix[row, :, rows.columns] = rows.blocks
    matrix[rows.columns, :, row] = rows.blocks.transpose(0, 2, 1)
    return points, matrix.reshape(len(points) * width, -1)


@pytest.mark.parametrize("turn", [0.0, 20.0, -35.0])
def test_rigid_motions_have_no_energy(turn):
    """Turn about the axis, displacement along it, and, to the order of the polynomials, across it."""
    functions = lobatto_functions([-4e-3, 4e-3], [7])
    points, matrix = stiffness(turn, (functions, functions))
    x, y = points.T
    z = np.linalg.lstsq(functions.values, functions.points, rcond=None)[0]  # z by the functions
    one, count = np.ones(functions.count), functions.count
    turned = np.concatenate([np.outer(-y, one), np.outer(x, one), np.zeros((len(x), count))], axis=1)
    along = np.concatenate([np.zeros((len(x), 2 * count)), np.ones((len(x), count))], axis=1)
    cosine, sine = np.outer(np.ones(len(x)), np.cos(turn * z)), np.outer(np.ones(len(x)), np.sin(turn * z))
    across = np.concatenate([cosine, -sine, np.zeros((len(x), count))], axis=1)
    scale = np.abs(np.diag(matrix)).max()
    for motion, least in ((turned, 1e-13), (along, 1e-13), (across, 1e-9)):
        size = motion.ravel()
        assert size @ matrix @ size < least * scale * (size @ size)
    # a shear along the axis is no rigid motion
    sheared = np.concatenate([np.outer(x * 0 + 1, z), np.zeros((len(x), 2 * count))], axis=1).ravel()
    assert sheared @ matrix @ sheared > 1e-6 * scale * (sheared @ sheared)


def test_matrices_are_symmetric_and_mirror_with_the_hand():
    functions = lobatto_functions([-4e-3, 4e-3], [4])
    _, one = stiffness(25.0, (functions, functions))
    _, other = stiffness(-25.0, (functions, functions))
    assert np.abs(one - one.T).max() < 1e-12 * np.abs(one).max()
    n = functions.count
    mirror = np.zeros((3 * n, 3 * n))
    for axis, sign in enumerate((1.0, 1.0, -1.0)):
        mirror[axis * n : (axis + 1) * n, axis * n : (axis + 1) * n] = sign * np.eye(n)[::-1]
    nodes = len(one) // len(mirror)
    whole = np.kron(np.eye(nodes), mirror)
    assert np.abs(whole @ one @ whole.T - other).max() < 1e-11 * np.abs(one).max()


def test_functions_are_exact_for_polynomials():
    functions = lobatto_functions([0.0, 1.0, 3.0], [2, 3], breaks=[0.4, 2.5])
    assert functions.count == 6
    for power in range(3):
        values = np.linalg.lstsq(functions.values, functions.points**power, rcond=None)[0]
        assert np.allclose(functions.values @ values, functions.points**power, atol=1e-12)
        assert np.allclose(functions.slopes @ values, power * functions.points ** max(power - 1, 0), atol=1e-11)
    assert np.sum(functions.weights) == pytest.approx(3.0)
    even, odd = lobatto_functions([-1.0, 1.0], [4]).by_parity()
    assert (even.count, odd.count) == (3, 2)
    assert np.allclose(even.values, even.values[::-1])
    assert np.allclose(odd.values, -odd.values[::-1])


def test_bar_between_smooth_walls_is_as_stiff_as_plane_strain():
    """One constant for v and none for w: displacements of an extruded body per length are those of plane strain."""
    points, triangles = section()
    left, right = (np.flatnonzero(np.isclose(points[:, 0], x)) for x in (1e-3, 5e-3))
    integrals = section_integrals(points, triangles, STEEL)
    functions = lobatto_functions([0.0, 1.0], [0]), None
    factor = condense_extruded(points, triangles, integrals, functions, retained=right, fixed=left)
    displaced = np.zeros(2 * len(right))
    displaced[::2] = 1.0
    pull = displaced @ factor.schur @ displaced
    nu = STEEL.poisson_ratio
    strip = STEEL.youngs_modulus * 3 / 4
    assert strip / (1 - nu**2) < pull < strip * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
