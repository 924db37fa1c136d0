"""Multifrontal Cholesky: its tree against the definition, its factor against A = L L^T, its solutions against scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from gearfe.fem.multifrontal import Factor
from gearfe.fem.reduction import sparse_solver
from gearfe.fem.reduction.sparse_solver import elimination_order, multifrontal, node_graph


def blocks(matrix: Any, width: int = 1) -> sparse.bsr_array:
    """In blocks of the unknowns of a node."""
    return sparse.bsr_array(matrix, blocksize=(width, width))


def grid(cells: tuple[int, int, int], width: int = 1) -> sparse.bsr_array:
    """Laplacian of a box with `width` coupled unknowns a node, positive definite."""
    line = [sparse.diags_array([2.0 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1]) for n in cells]  # type: ignore[arg-type]
    eye = [sparse.eye_array(n) for n in cells]
    nodal = sparse.kron(line[0], sparse.kron(eye[1], eye[2])) + sparse.kron(eye[0], sparse.kron(line[1], eye[2]))
    nodal = nodal + sparse.kron(eye[0], sparse.kron(eye[1], line[2])) + 0.1 * sparse.eye_array(nodal.shape[0])
    pair = np.random.default_rng(3).standard_normal((width, width))
    return blocks(sparse.kron(nodal, pair @ pair.T + np.eye(width)), width)


def lower(factor: Factor) -> np.ndarray:
    """L (n, n) in the order of elimination."""
    full = np.zeros((len(factor.order),) * 2)
    for front in factor.fronts:
        full[front.begin : front.end, front.begin : front.end] = np.tril(front.pivot)
        full[front.outer, front.begin : front.end] = front.coupling
    return full


@pytest.mark.parametrize("seed", range(5))
def test_elimination_tree_is_that_of_the_factor(seed: int) -> None:
    """Parent of j: the first row below j in which column j of L has an entry."""
    rng = np.random.default_rng(seed)
    n = 40
    pattern = sparse.random_array((n, n), density=0.04, rng=rng).toarray() != 0.0
    pattern |= pattern.T
    np.fill_diagonal(pattern, False)
    filled = pattern.copy()
    for j in range(n):
        below = np.flatnonzero(filled[j + 1 :, j]) + j + 1
        filled[np.ix_(below, below)] = True
    truth = [int(rows[0]) + j + 1 if len(rows := np.flatnonzero(filled[j + 1 :, j])) else -1 for j in range(n)]
    assert sparse_solver._elimination_tree(sparse.csr_array(pattern.astype(np.int8))) == truth


@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("leaf", [0, 6, 10_000])
def test_factor_and_solutions(width: int, leaf: int) -> None:
    """Fronts of width 3 are wider than a strip of their updates."""
    matrix = grid((6, 5, 4), width)
    rng = np.random.default_rng(1)
    graph = node_graph(matrix)
    for order in (np.arange(graph.shape[0]), rng.permutation(graph.shape[0])):
        factor = multifrontal(matrix, graph, order, leaf_nodes=leaf)
        found = lower(factor)
        permuted = matrix.toarray()[np.ix_(factor.order, factor.order)]
        np.testing.assert_allclose(found @ found.T, permuted, atol=1e-12 * np.abs(permuted).max())
        b = rng.standard_normal((matrix.shape[0], 3))
        np.testing.assert_allclose(factor.solve(b), spsolve(matrix.tocsc(), b), rtol=1e-9, atol=1e-12)


def test_nodes_without_coupling_and_separate_parts() -> None:
    parts = [grid((3, 3, 3)), sparse.csr_array([[5.0]]), grid((40, 1, 1)), sparse.csr_array(2.0 * np.eye(3))]
    matrix = blocks(sparse.block_diag(parts))
    graph = node_graph(matrix)
    b = np.arange(1.0, matrix.shape[0] + 1.0)
    factor = multifrontal(matrix, graph, np.random.default_rng(0).permutation(matrix.shape[0]))
    np.testing.assert_allclose(matrix @ factor.solve(b), b, rtol=1e-12)


def test_indefinite_matrices_have_no_factor() -> None:
    matrix = grid((5, 4, 3))
    graph = node_graph(matrix)
    lowest = float(np.linalg.eigvalsh(matrix.toarray())[0])
    identity = sparse.eye_array(matrix.shape[0])
    multifrontal(blocks(matrix - 0.999 * lowest * identity), graph, np.arange(graph.shape[0]))
    with pytest.raises(np.linalg.LinAlgError):
        multifrontal(blocks(matrix - 1.001 * lowest * identity), graph, np.arange(graph.shape[0]))


def test_cost_of_a_plate_stays_near_linear() -> None:
    """Nested dissection of a plane grid of n nodes stores O(n log n) numbers (George, 1973): exponent below 1.2."""
    pytest.importorskip("pymetis")
    stored = []
    for side in (40, 80):
        matrix = grid((side, side, 1))
        graph = node_graph(matrix)
        fronts = multifrontal(matrix, graph, elimination_order(graph)).fronts
        stored.append(sum(front.pivot.size + front.coupling.size for front in fronts))
    assert np.log(stored[1] / stored[0]) / np.log(4.0) < 1.2


def test_a_stored_factor_solves_as_the_first() -> None:
    matrix = grid((4, 3, 5), 2)
    factor = sparse_solver.factorize(matrix, block=2)
    again = Factor.of_arrays(factor.arrays())
    b = np.random.default_rng(5).standard_normal((matrix.shape[0], 3))
    np.testing.assert_array_equal(again.solve(b), factor.solve(b))
    np.testing.assert_allclose(matrix @ again.solve(b), b, atol=1e-10)
