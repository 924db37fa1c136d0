r"""Cholesky factorisation of a large sparse matrix on dense fronts: ``A = L L^T`` by LAPACK, front by front.

Nested dissection orders the unknowns; what depends on what is a tree (the elimination tree). Runs of the tree become
*fronts*. Taken from the leaves to the roots, a front collects the rows of A that belong to its own unknowns and what
its children left over, eliminates its own unknowns and leaves an update of the outer ones behind,

.. math::
    F_{ii} = L_{ii} L_{ii}^T,\qquad L_{oi} = F_{oi} L_{ii}^{-T},\qquad U = F_{oo} - L_{oi} L_{oi}^T

(the multifrontal method: Duff, Reid, ACM Trans. Math. Softw. 9, 1983; Liu, SIAM Review 34, 1992). Every step is one
dense kernel, and a solve with many right-hand sides reads the factor twice, however many there are.

The unknowns of a mesh node stay together: trees and fronts are found on the graph of nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf
from scipy.sparse.csgraph import minimum_spanning_tree

from ..typing import Array, IntArray

#: Nodes in a subtree that becomes one front: with fewer, calls of small kernels rule; with more, stored zeros do.
LEAF_NODES = 32
#: Rows of an update that are passed on at a time: a strip of them stays in the processor's cache.
STRIP = 64


class NotPositiveDefinite(ArithmeticError):
    """A pivot block has no Cholesky factor."""


@dataclass(frozen=True)
class _Front:
    """Own unknowns ``begin:end`` and outer ones (m,), L_ii (k, k) and L_oi (m, k), both in Fortran order."""

    begin: int
    end: int
    outer: IntArray
    pivot: Array
    coupling: Array


@dataclass(frozen=True)
class MultifrontalFactor:
    """Factor of a symmetric positive definite matrix.

    Attributes
    ----------
    order : (n,)
        Number in the matrix of each unknown in the order of elimination.
    fronts
        In the order of elimination.
    """

    order: IntArray
    fronts: tuple[_Front, ...]

    def solve(self, b: Array) -> Array:
        """(n,) or (n, p) right-hand sides to solutions of the same shape; several at a time are much cheaper."""
        x = np.ascontiguousarray(np.atleast_2d(np.transpose(b)).T[self.order], dtype=float)
        # rows of x are contiguous: x[a:b].T is in Fortran order, and BLAS changes it in place
        for front in self.fronts:
            own = x[front.begin : front.end]
            dtrsm(1.0, front.pivot, own.T, side=1, lower=1, trans_a=1, overwrite_b=1)
            x[front.outer] -= front.coupling @ own
        for front in reversed(self.fronts):
            own = x[front.begin : front.end]
            own -= front.coupling.T @ x[front.outer]
            dtrsm(1.0, front.pivot, own.T, side=1, lower=1, overwrite_b=1)
        result = np.empty_like(x)
        result[self.order] = x
        return result.reshape(np.shape(b))


@dataclass(frozen=True)
class _Tree:
    """Fronts on the graph of nodes.

    Attributes
    ----------
    order : (nodes,)
        Number in the graph of each node in the order of elimination.
    ends : (fronts,)
        One past the last own node of each front; children stand before their parents.
    outer
        Of each front the outer nodes, ascending, in the order of elimination.
    children
        Of each front.
    """

    order: IntArray
    ends: IntArray
    outer: list[IntArray]
    children: list[list[int]]


def multifrontal(matrix: Any, graph: Any, order: IntArray, *, leaf_nodes: int = LEAF_NODES) -> MultifrontalFactor:
    """Factorise a symmetric positive definite matrix.

    Parameters
    ----------
    matrix : (n, n) sparse
        Both triangles stored; best in blocks (BSR) of b rows.
    graph : (n / b, n / b) sparse CSR
        Which nodes, of b unknowns each, are coupled; no diagonal.
    order : (n / b,)
        Numbers of the nodes in an order with little fill.
    leaf_nodes
        Nodes in a subtree that becomes one front.

    Raises
    ------
    NotPositiveDefinite
    """
    nodes = graph.shape[0]
    width = matrix.shape[0] // nodes
    tree = _fronts(graph, order, leaf_nodes)
    number = np.empty(nodes, dtype=np.int64)
    number[tree.order] = np.arange(nodes)
    blocks = sparse.bsr_array(matrix, blocksize=(width, width))
    rows, columns = number[np.repeat(np.arange(nodes), np.diff(blocks.indptr))], number[blocks.indices]
    kept = np.flatnonzero(columns >= rows)  # the upper triangle, by rows, with the place of its blocks as values
    upper = sparse.csr_array((kept, (rows[kept], columns[kept])), shape=graph.shape)
    place = np.empty(nodes, dtype=np.int64)
    updates: dict[int, tuple[IntArray, Array]] = {}
    fronts = []
    begin = 0
    for here, (end, outer) in enumerate(zip(tree.ends.tolist(), tree.outer, strict=True)):
        own, size = end - begin, end - begin + len(outer)
        place[begin:end], place[outer] = np.arange(own), np.arange(own, size)
        # everything below is the upper triangle in C order: for BLAS and LAPACK, the lower one in Fortran order
        panel = np.zeros((own * width, size * width))
        among = slice(upper.indptr[begin], upper.indptr[end])
        row = np.repeat(np.arange(own), np.diff(upper.indptr[begin : end + 1]))
        where = (row, slice(None), place[upper.indices[among]])
        panel.reshape(own, width, size, width)[where] = blocks.data[upper.data[among]]
        rest = np.zeros(((size - own) * width,) * 2)
        for child in tree.children[here]:
            left, update = updates.pop(child)
            index = _unknowns(place[left], width)
            split = int(np.searchsorted(index, own * width))
            _add(panel, index[:split], index, update)
            _add(rest, index[split:] - own * width, index[split:] - own * width, update[split:, split:])
        pivot, failed = dpotrf(np.array(panel[:, : own * width]).T, lower=1, clean=0, overwrite_a=1)
        if failed:
            raise NotPositiveDefinite
        coupling = np.array(panel[:, own * width :]).T
        if len(outer):
            coupling = dtrsm(1.0, pivot, coupling, side=1, lower=1, trans_a=1, overwrite_b=1)
            updates[here] = outer, dsyrk(-1.0, coupling, beta=1.0, c=rest.T, lower=1, overwrite_c=1).T
        fronts.append(_Front(begin * width, end * width, _unknowns(outer, width), pivot, coupling))
        begin = end
    return MultifrontalFactor(_unknowns(tree.order, width), tuple(fronts))


def _unknowns(nodes: IntArray, width: int) -> IntArray:
    return np.asarray((width * nodes[:, None] + np.arange(width)).ravel())


def _add(target: Array, rows: IntArray, columns: IntArray, values: Array) -> None:
    """``target[rows][:, columns] += values``, upper triangle; `rows` are the first of the ascending `columns`.

    A strip is spread over whole rows first, which are then added in one piece: five times faster than indexing twice.
    """
    strip = np.zeros((STRIP, target.shape[1]))
    for first in range(0, len(rows), STRIP):
        last = min(first + STRIP, len(rows))
        part = strip[: last - first]
        part[:, columns[max(first - STRIP, 0) : first]] = 0.0
        part[:, columns[first:]] = values[first:last, first:]
        target[rows[first:last]] += part


def _fronts(graph: Any, order: IntArray, leaf_nodes: int) -> _Tree:
    """Elimination tree, its postorder, and its runs: subtrees of `leaf_nodes`, and chains without larger branches."""
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
    ends = np.flatnonzero(np.diff(np.array(top)[run], append=-1)) + 1
    order = order[run]
    graph = sparse.csr_array(graph[order][:, order])
    front_of = np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
    outer: list[IntArray] = []
    children: list[list[int]] = [[] for _ in ends]
    begin = 0
    for here, end in enumerate(ends.tolist()):
        near = [graph.indices[graph.indptr[begin] : graph.indptr[end]], *(outer[child] for child in children[here])]
        found = np.unique(np.concatenate(near))
        outer.append(found[np.searchsorted(found, end) :])
        if len(outer[-1]):
            children[front_of[outer[-1][0]]].append(here)
        begin = end
    return _Tree(order, ends, outer, children)


def _elimination_tree(graph: Any) -> list[int]:
    """Parent of each node (-1: none) when the nodes are eliminated in order (Liu, SIAM J. Matrix Anal. Appl. 11, 1990).

    The tree depends only on which nodes are connected through nodes up to each j. A minimum spanning tree with the
    larger node of an edge as its weight keeps that, so only its few edges need be gone through one by one.
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
