r"""Sparse symmetric positive definite systems ``A x = b`` by the factorisation of `gearfe.reduction.multifrontal`.

The order of elimination is METIS' nested dissection where pymetis is installed, else SciPy's minimum degree, which is
as good up to 100,000 unknowns. Measured on housings (processor seconds on one core, METIS and minimum degree): 64,000
unknowns 0.6 and 0.5, 110,000 1.5 and 1.7, 190,000 1.6 and 3.8, 280,000 9.7 and 15.

The unknowns of a mesh node stay together: orders are found on the graph of nodes, a third of the size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from ..errors import InputError
from ..typing import IntArray
from .multifrontal import MultifrontalFactor, NotPositiveDefinite, multifrontal

#: Response to a random load, against the stiffest unknown's, above which a body counts as free to move. Bodies that are
#: held, slender ones too, stay below 1e10; rounding alone holds a free one at 1e13 and more.
UNBOUNDED = 1e12


def factorize(matrix: Any, *, block: int = 3) -> MultifrontalFactor:
    """Factorise a sparse symmetric positive definite matrix.

    Parameters
    ----------
    matrix : (n, n) sparse
        Both triangles stored.
    block
        Unknowns that belong to one mesh node and stand together (used for the ordering where it divides n).

    Raises
    ------
    InputError
        Matrix that is not positive definite.
    """
    if matrix.shape[0] != matrix.shape[1]:
        raise InputError("matrix", matrix.shape, "must be square", "")
    if matrix.shape[0] == 0:
        return MultifrontalFactor(np.arange(0), ())
    width = block if matrix.shape[0] % block == 0 else 1
    blocks = sparse.bsr_array(matrix, blocksize=(width, width))
    graph = node_graph(blocks)
    try:
        factor = multifrontal(blocks, graph, elimination_order(graph))
    except NotPositiveDefinite as error:
        raise _not_definite() from error
    # a random right-hand side: an unbounded or negative response means a free part
    b = np.random.default_rng(0).standard_normal(matrix.shape[0])
    x = factor.solve(b)
    growth = float(np.max(np.abs(matrix.diagonal()))) * float(np.linalg.norm(x)) / float(np.linalg.norm(b))
    if not (growth < UNBOUNDED and float(b @ x) > 0.0):
        raise _not_definite()
    return factor


def node_graph(blocks: Any) -> Any:
    """Which nodes a matrix in blocks (BSR) couples: CSR, without the diagonal."""
    nodes = len(blocks.indptr) - 1
    rows = np.repeat(np.arange(nodes, dtype=np.int32), np.diff(blocks.indptr))
    off = rows != blocks.indices
    ones = np.ones(int(off.sum()), dtype=np.int8)
    return sparse.csr_array((ones, (rows[off], blocks.indices[off])), shape=(nodes, nodes))


def elimination_order(graph: Any) -> IntArray:
    """Order of the nodes of a graph with little fill."""
    if graph.nnz == 0:
        return np.arange(graph.shape[0])
    try:
        import pymetis
    except ImportError:
        from scipy.sparse.linalg import spilu

        # what SuperLU would eliminate, in its order; with nothing kept but the diagonal that costs next to nothing
        laplacian = sparse.csc_array(sparse.diags_array(np.diff(graph.indptr) + 1.0) - graph)
        options = {"SymmetricMode": True}
        found = spilu(
            laplacian, drop_tol=np.inf, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
            options=options,
        )  # fmt: skip
        return np.argsort(found.perm_c)
    if hasattr(pymetis, "CSRAdjacency"):
        order, _ = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))
    else:
        order, _ = pymetis.nested_dissection(xadj=graph.indptr, adjncy=graph.indices)
    return np.asarray(order, dtype=np.int64)


def _not_definite() -> InputError:
    return InputError(
        "stiffness matrix",
        None,
        "is not positive definite: part of the body can still move freely",
        "hold it (fixed nodes or attachments) or join loose parts of the mesh",
    )
