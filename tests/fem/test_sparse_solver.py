"""The sparse solver against numpy, in the orders of METIS and SciPy; matrices that are not positive definite."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy import sparse

from gearfe.base.errors import InputError
from gearfe.fem.plane import Material
from gearfe.fem.reduction.lanczos import lowest_modes
from gearfe.fem.reduction.sparse_solver import elimination_order, factorize, multifrontal, node_graph
from gearfe.fem.solid import assemble
from tests.makers.housing_meshes import box


def cantilever() -> tuple[sparse.csr_array, sparse.csr_array]:
    nodes, tets = box((5, 2, 2), (0.5, 0.1, 0.1))
    found = assemble(nodes, tets, Material())
    free = (3 * np.flatnonzero(nodes[:, 0] > 1e-9)[:, None] + np.arange(3)).ravel()
    return found.stiffness.tocsr()[free][:, free], found.mass[free][:, free]


@pytest.fixture(params=["pymetis", "scipy"])
def order(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """What finds the order of elimination."""
    if request.param == "scipy":
        monkeypatch.setitem(sys.modules, "pymetis", None)
    else:
        pytest.importorskip("pymetis")
    return str(request.param)


@pytest.mark.usefixtures("order")
def test_solves_like_numpy() -> None:
    k, _ = cantilever()
    factor = factorize(k)
    rng = np.random.default_rng(0)
    for shape in ((k.shape[0],), (k.shape[0], 1), (k.shape[0], 7)):
        b = rng.standard_normal(shape)
        kept = b.copy()
        x = factor.solve(b)
        assert x.shape == b.shape
        np.testing.assert_array_equal(b, kept)
        truth = np.linalg.solve(k.toarray(), b)
        np.testing.assert_allclose(x, truth, atol=1e-10 * np.abs(truth).max())


@pytest.mark.usefixtures("order")
def test_two_factorisations_do_not_disturb_each_other() -> None:
    k, m = cantilever()
    first = factorize(k)
    second = factorize(k + 1e6 * m)
    b = np.ones(k.shape[0])
    for factor, matrix in ((first, k), (second, k + 1e6 * m), (first, k)):
        np.testing.assert_allclose(factor.solve(b), np.linalg.solve(matrix.toarray(), b), rtol=1e-7, atol=1e-14)


@pytest.mark.usefixtures("order")
def test_a_body_that_can_move_is_refused() -> None:
    free = assemble(*box((2, 1, 1), (0.2, 0.1, 0.1)), Material()).stiffness
    for matrix in (free, -cantilever()[0]):
        with pytest.raises(InputError, match="positive definite"):
            factorize(matrix)


@pytest.mark.usefixtures("order")
def test_order_leaves_little_fill() -> None:
    """Against the order of the mesher's numbers, a bar of 24 x 4 x 4 cubes from end to end and then crosswise."""
    nodes, tets = box((24, 4, 4), (0.6, 0.1, 0.1))
    blocks = assemble(nodes, tets, Material()).stiffness
    graph = node_graph(blocks)
    found = elimination_order(graph)
    np.testing.assert_array_equal(np.sort(found), np.arange(graph.shape[0]))
    held = sparse.bsr_array(blocks + 1e9 * sparse.eye_array(blocks.shape[0]), blocksize=(3, 3))
    here, there = (
        sum(front.pivot.size + front.coupling.size for front in multifrontal(held, graph, one).fronts)
        for one in (found, np.arange(graph.shape[0]))
    )
    assert here < 0.5 * there


def test_blocks_that_do_not_divide_the_order() -> None:
    matrix = sparse.diags_array([4.0 * np.ones(10), -np.ones(9), -np.ones(9)], offsets=[0, 1, -1]).tocsr()  # type: ignore[arg-type]
    np.testing.assert_allclose(matrix @ factorize(matrix).solve(np.ones(10)), np.ones(10), rtol=1e-13)
    assert factorize(sparse.csr_array((0, 0))).solve(np.zeros(0)).shape == (0,)


@pytest.mark.parametrize("block", [1, 2, 6, 20])
def test_lanczos_finds_repeated_modes(block: int) -> None:
    """A square section bends in two directions at the same frequency: held against scipy's dense solver."""
    from scipy.linalg import eigh

    k, m = cantilever()
    truth = eigh(k.toarray(), m.toarray(), eigvals_only=True)
    assert truth[1] / truth[0] - 1.0 < 0.02
    found = lowest_modes(factorize(k).solve, m, count=25, block=block)
    np.testing.assert_allclose(found.eigenvalues, truth[:25], rtol=1e-9)
    assert found.next_eigenvalue == pytest.approx(truth[25], rel=1e-4)
    v = found.vectors
    np.testing.assert_allclose(v.T @ (m @ v), np.eye(25), atol=1e-11)
    # the docstring's promise, in the norm of the iterated operator: |K^-1 M v - v / lambda| <= tol / lambda
    residual = (factorize(k).solve(m @ v) - v / found.eigenvalues) * found.eigenvalues
    assert np.sqrt(np.max(np.einsum("ij,ij->j", residual, m @ residual))) < 2e-5


def test_lanczos_by_limit_and_to_the_last_mode() -> None:
    from scipy.linalg import eigh

    nodes, tets = box((2, 1, 1), (0.2, 0.1, 0.1))
    body = assemble(nodes, tets, Material())
    free = (3 * np.flatnonzero(nodes[:, 0] > 1e-9)[:, None] + np.arange(3)).ravel()
    k, m = body.stiffness.tocsr()[free][:, free], body.mass[free][:, free]
    truth = eigh(k.toarray(), m.toarray(), eigvals_only=True)
    solve = factorize(k).solve
    for inside in (0, 1, 7):
        limit = 0.5 * (truth[inside] + (truth[inside - 1] if inside else 0.0))
        np.testing.assert_allclose(lowest_modes(solve, m, limit=limit).eigenvalues, truth[:inside], rtol=1e-9)
    assert len(lowest_modes(solve, m, limit=0.0, at_least=5).eigenvalues) == 5
    assert len(lowest_modes(solve, m, count=3, limit=truth[10]).eigenvalues) == 3
    everything = lowest_modes(solve, m, count=10_000)
    np.testing.assert_allclose(everything.eigenvalues, truth, rtol=1e-6)
    assert everything.next_eigenvalue == np.inf
    assert len(lowest_modes(solve, m, count=0).eigenvalues) == 0
