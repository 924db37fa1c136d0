r"""Sparse symmetric positive definite systems ``A x = b``: one small interface, two factorisations behind it.

``multifrontal`` is the Cholesky factorisation of `gearfe.reduction.multifrontal`, in the order of METIS, wherever
pymetis is installed; ``superlu`` that of scipy alone (SuperLU, symmetric mode, minimum degree), far slower on large
meshes. Measured, second-order elasticity in three dimensions (processor seconds on one core; factor, then one
right-hand side out of a block of eight): 45,000 unknowns 1.0 s and 9 ms, SuperLU in METIS' order 1.9 s and 11 ms;
108,000 unknowns 3.6 s and 24 ms, 8.6 s and 51 ms. CHOLMOD and PARDISO factorise as fast and solve two to three times
slower, and a reduction to some tens of modes solves for 200 right-hand sides (72,000 unknowns: 7.7 s, 13.1 s, 15.9 s).

The unknowns of a mesh node stay together: orderings are found on the graph of nodes, a third of the size.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from ..errors import InputError, MissingLibraryError
from ..typing import Array, IntArray

#: Names of the solvers, best first; each needs the package on the right (``None``: scipy alone).
PACKAGES: dict[str, str | None] = {"multifrontal": "pymetis", "superlu": None}
#: Response to a random load, against the stiffest unknown's, above which a body counts as free to move. Bodies that are
#: held, slender ones too, stay below 1e10; rounding alone holds a free one at 1e13 and more.
UNBOUNDED = 1e12


@dataclass(frozen=True)
class Factorization:
    """A factorised matrix.

    Attributes
    ----------
    solver
        Name of the solver that made it.
    unknowns
        Order n of the matrix.
    solve
        (n,) or (n, k) right-hand sides to solutions of the same shape.
    """

    solver: str
    unknowns: int
    solve: Callable[[Array], Array]


def installed_solvers() -> tuple[str, ...]:
    """Names of the solvers that can be used here, found without importing their packages."""
    return tuple(name for name, package in PACKAGES.items() if package is None or importlib.util.find_spec(package))


def choose_solver(solver: str = "auto") -> str:
    """Name of the solver that `factorize` will use."""
    here = installed_solvers()
    if solver == "auto":
        return here[0]
    if solver not in PACKAGES:
        raise InputError("solver", solver, "must be auto, " + ", ".join(PACKAGES), "choose one of these")
    if solver not in here:
        raise MissingLibraryError(f"the sparse solver {solver!r} needs pymetis: pip install 'gearfe[fast]'")
    return solver


def factorize(matrix: Any, *, solver: str = "auto", block: int = 3) -> Factorization:
    """Factorise a sparse symmetric positive definite matrix.

    Parameters
    ----------
    matrix : (n, n) sparse
        Both triangles stored.
    solver
        ``auto`` (the first that is installed), ``multifrontal`` or ``superlu``.
    block
        Unknowns that belong to one mesh node and stand together (used for the ordering where it divides n).

    Raises
    ------
    InputError
        Unknown solver name; matrix that is not positive definite.
    MissingLibraryError
        The package of the named solver is not installed.
    """
    if matrix.shape[0] != matrix.shape[1]:
        raise InputError("matrix", matrix.shape, "must be square", "")
    if matrix.shape[0] == 0:
        return Factorization("none", 0, lambda b: np.array(b, dtype=float))
    name = choose_solver(solver)
    solve = _multifrontal(matrix, block) if name == "multifrontal" else _superlu(matrix)
    _check_definite(matrix, solve)
    return Factorization(name, matrix.shape[0], solve)


def _multifrontal(matrix: Any, block: int) -> Callable[[Array], Array]:
    from .multifrontal import NotPositiveDefinite, multifrontal

    width = block if matrix.shape[0] % block == 0 else 1
    blocks = sparse.bsr_array(matrix, blocksize=(width, width))
    graph = node_graph(blocks)
    try:
        return multifrontal(blocks, graph, metis_order(graph)).solve
    except NotPositiveDefinite as error:
        raise _not_definite() from error


def node_graph(blocks: Any) -> Any:
    """Which nodes a matrix in blocks (BSR) couples: CSR, without the diagonal."""
    nodes = len(blocks.indptr) - 1
    rows = np.repeat(np.arange(nodes, dtype=np.int32), np.diff(blocks.indptr))
    off = rows != blocks.indices
    ones = np.ones(int(off.sum()), dtype=np.int8)
    return sparse.csr_array((ones, (rows[off], blocks.indices[off])), shape=(nodes, nodes))


def metis_order(graph: Any) -> IntArray:
    """Order of the nodes of a graph with little fill, by nested dissection (METIS through pymetis)."""
    pymetis: Any = importlib.import_module("pymetis")

    if graph.nnz == 0:
        return np.arange(graph.shape[0])
    if hasattr(pymetis, "CSRAdjacency"):
        order, _ = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))
    else:
        order, _ = pymetis.nested_dissection(xadj=graph.indptr, adjncy=graph.indices)
    return np.asarray(order, dtype=np.int64)


def _superlu(matrix: Any) -> Callable[[Array], Array]:
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    try:
        lu = splu(sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:
        raise _not_definite() from error
    return lambda b: np.asarray(lu.solve(np.asfortranarray(b, dtype=float)))


def _check_definite(matrix: Any, solve: Callable[[Array], Array]) -> None:
    """One solve with a random right-hand side: an unbounded or negative response means a free part."""
    b = np.random.default_rng(0).standard_normal(matrix.shape[0])
    try:
        x = solve(b)
    except ArithmeticError as error:
        raise _not_definite() from error
    growth = float(np.max(np.abs(matrix.diagonal()))) * float(np.linalg.norm(x)) / float(np.linalg.norm(b))
    if not (growth < UNBOUNDED and float(b @ x) > 0.0):
        raise _not_definite()


def _not_definite() -> InputError:
    return InputError(
        "stiffness matrix",
        None,
        "is not positive definite: part of the body can still move freely",
        "hold it (fixed nodes or attachments) or join loose parts of the mesh",
    )
