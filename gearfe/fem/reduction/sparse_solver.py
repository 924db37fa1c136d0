r"""Solve sparse symmetric positive definite systems ``A x = b`` by the factorisation of `gearfe.fem.multifrontal`.

The order of elimination is METIS' nested dissection if pymetis is installed, otherwise SciPy's minimum degree. The
latter is as good up to 100,000 unknowns. Measured on housings (processor seconds on one core, METIS and minimum
degree): 64,000 unknowns 0.6 and 0.5, 110,000 1.5 and 1.7, 190,000 1.6 and 3.8, 280,000 9.7 and 15.

The dependencies of the unknowns in that order form the elimination tree, whose chains become fronts. The unknowns of a
mesh node stay together: orders and trees are computed on the graph of nodes, a third of the size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import minimum_spanning_tree

from ...base.errors import InputError
from ...base.typing import IntArray
from ..multifrontal import BlockRows, Factor, eliminate

#: Nodes in a subtree that becomes one front: with fewer, calls of small kernels rule; with more, stored zeros do.
LEAF_NODES = 32
#: Response to a random load, against the stiffest unknown's, above which a body counts as free to move. Bodies that are
#: held, slender ones too, stay below 1e10; rounding alone holds a free one at 1e13 and more.
UNBOUNDED = 1e12


def factorize(matrix: Any, *, block: int = 3) -> Factor:
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
        return Factor(0, np.arange(0), (), np.zeros((0, 0)))
    width = block if matrix.shape[0] % block == 0 else 1
    blocks = sparse.bsr_array(matrix, blocksize=(width, width))
    graph = node_graph(blocks)
    try:
        factor = multifrontal(blocks, graph, elimination_order(graph))
    except np.linalg.LinAlgError as error:
        raise _not_definite() from error
    # a random right-hand side: an unbounded or negative response means a free part
    b = np.random.default_rng(0).standard_normal(matrix.shape[0])
    x = factor.solve(b)
    growth = float(np.max(np.abs(matrix.diagonal()))) * float(np.linalg.norm(x)) / float(np.linalg.norm(b))
    if not (growth < UNBOUNDED and float(b @ x) > 0.0):
        raise _not_definite()
    return factor


def multifrontal(blocks: Any, graph: Any, order: IntArray, *, leaf_nodes: int = LEAF_NODES) -> Factor:
    """Factorise a symmetric positive definite matrix in an order with little fill.

    Parameters
    ----------
    blocks : (n, n) sparse BSR
        Both triangles stored, in blocks of the unknowns of a node.
    graph : sparse CSR
        Which nodes are coupled, without the diagonal (`node_graph`).
    order : (nodes,)
        Numbers of the nodes in the order.
    leaf_nodes
        Nodes in a subtree that becomes one front.

    Raises
    ------
    numpy.linalg.LinAlgError
        Matrix that is not positive definite.
    """
    order, ends = _fronts(graph, order, leaf_nodes)
    nodes = len(order)
    number = np.empty(nodes, dtype=np.int64)
    number[order] = np.arange(nodes)
    rows, columns = number[np.repeat(np.arange(nodes), np.diff(blocks.indptr))], number[blocks.indices]
    kept = np.flatnonzero(columns >= rows)  # the upper triangle, by rows, with the place of its blocks as values
    upper = sparse.csr_array((kept, (rows[kept], columns[kept])), shape=graph.shape)
    return eliminate(BlockRows(upper.indptr, upper.indices, blocks.data[upper.data]), ends, order, nodes)


def node_graph(blocks: Any) -> Any:
    """Return the graph of nodes that a block matrix (BSR) couples: CSR, without the diagonal."""
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


def _fronts(graph: Any, order: IntArray, leaf_nodes: int) -> tuple[IntArray, IntArray]:
    """Return the nodes front by front, and the ends of the fronts.

    Fronts are subtrees of `leaf_nodes` in the elimination tree, and chains without larger branches.
    """
    parent = _elimination_tree(graph[order][:, order])
    nodes = len(parent)
    size = [1] * nodes
    for j, p in enumerate(parent):
        if p >= 0:
            size[p] += size[j]
    large, above = np.array(size) > leaf_nodes, np.array(parent)
    branches = np.bincount(above[large & (above >= 0)], minlength=nodes)
    # the last node of a front: top of a small subtree, or a large one whose parent has several large children, or none
    goes_on = (above >= 0) & np.where(large, branches[above] == 1, ~large[above])
    top = list(range(nodes))
    for j in range(nodes - 1, -1, -1):
        if goes_on[j]:
            top[j] = top[parent[j]]
    # nodes by the last one of their front: what a node depends on has come before
    run = np.argsort(top, kind="stable")
    return order[run], np.flatnonzero(np.diff(np.array(top)[run], append=-1)) + 1


def _elimination_tree(graph: Any) -> list[int]:
    """Parent of each node (-1: none) when the nodes are eliminated in order (Liu, SIAM J. Matrix Anal. Appl. 11, 1990).

    The tree depends only on which nodes are connected through nodes up to each j. A minimum spanning tree with the
    larger node of an edge as its weight keeps that, so only its few edges are processed one by one.
    """
    nodes = graph.shape[0]
    edges = sparse.triu(graph, 1, format="coo")
    spanning = minimum_spanning_tree(sparse.csr_array((edges.col.astype(float), edges.coords), shape=graph.shape))
    spanning = spanning.tocoo()
    by_column = np.argsort(spanning.col, kind="stable")
    parent, root = [-1] * nodes, list(range(nodes))
    for low, high in zip(spanning.row[by_column].tolist(), spanning.col[by_column].tolist(), strict=True):
        while root[low] != low:
            root[low] = root[root[low]]
            low = root[low]  # noqa: PLW2901
        parent[low] = root[low] = high
    return parent


def _not_definite() -> InputError:
    return InputError(
        "stiffness matrix",
        None,
        "is not positive definite: part of the body can still move freely",
        "hold it (fixed nodes or attachments) or join loose parts of the mesh",
    )
