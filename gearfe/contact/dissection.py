"""Static condensation of a finite-element body onto a few retained unknowns by nested dissection.

The elements are bisected into small leaves. A node can be eliminated as soon as all elements round it have been joined
(nested dissection: George, SIAM J. Numer. Anal. 10, 1973); `gearfe.reduction.multifrontal` eliminates in that order and
leaves the Schur complement on the retained unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from ..reduction.multifrontal import MultifrontalFactor, NotPositiveDefinite, multifrontal
from ..reduction.sparse_solver import node_graph
from ..typing import Array, IntArray

#: Elements in a leaf of the bisection, and nodes of a subtree that becomes one front: fastest of those tried.
LEAF_ELEMENTS, LEAF_NODES = 40, 90


@dataclass(frozen=True)
class Condensed:
    """Schur complement on the retained unknowns with the way back to the eliminated ones.

    Attributes
    ----------
    free : ndarray
        Unknowns that are not held (numbers in the full vector), rising.
    size
        Length of the full vector.
    factor
        Of the stiffness of the free unknowns.
    """

    free: IntArray
    size: int
    factor: MultifrontalFactor

    @property
    def schur(self) -> Array:
        """K_rr - K_re K_ee^-1 K_er (N/m), shape (r, r), in the order of the retained nodes."""
        return self.factor.schur

    def recover(self, values: Array) -> Array:
        """Full displacement (m), shape (size, k), of a body without loads on its eliminated unknowns.

        Parameters
        ----------
        values : ndarray, shape (r, k)
            Displacements of the retained unknowns, k cases (m).
        """
        full = np.zeros((self.size, values.shape[1]))
        full[self.free] = self.factor.recover(values)
        return full

    def on_retained(self, rows: Array, unknowns: IntArray) -> Array:
        """What gives linear forms of the full displacement from the retained unknowns alone, shape (m, r).

        Parameters
        ----------
        rows, unknowns : ndarray, shape (m, a)
            Coefficients of m forms (any unit) and the unknowns that they belong to.
        """
        moves = np.isin(unknowns, self.free)
        place = np.searchsorted(self.free, np.where(moves, unknowns, self.free[0]))
        return self.factor.on_kept(np.where(moves, rows, 0.0), place)


def condense(
    elements: IntArray, matrices: Array, centres: Array, *, nodes: int, retained: IntArray, fixed: IntArray
) -> Condensed:
    """Condense a plane body with two unknowns a node (2 node, 2 node + 1).

    Parameters
    ----------
    elements : ndarray, shape (m, a)
        Node numbers of each element.
    matrices : ndarray, shape (m, 2a, 2a)
        Symmetric element stiffness (N/m), node-major.
    centres : ndarray, shape (m, 2)
        Element centres, for the bisection (m).
    nodes
        Number of nodes.
    retained : ndarray
        Node numbers to keep; the Schur complement has them in this order.
    fixed : ndarray
        Nodes held at zero.
    """
    owner = _owners(elements, *_bisect(centres), nodes)
    owner[retained] = 0  # after the root, which is 1
    free = np.setdiff1d(np.arange(nodes), fixed)
    number = np.full(nodes, -1)
    number[free] = np.arange(len(free))
    order = np.argsort(-owner[free], kind="stable")
    order[len(free) - len(retained) :] = number[retained]
    stiffness = _assembled(number[elements], matrices, len(free))
    try:
        factor = multifrontal(stiffness, node_graph(stiffness), order, kept=len(retained), leaf_nodes=LEAF_NODES)
    except NotPositiveDefinite:
        raise np.linalg.LinAlgError("the body is not held or an element is inside out") from None
    return Condensed(_unknowns(free), 2 * nodes, factor)


def _assembled(elements: IntArray, matrices: Array, nodes: int) -> Any:
    """Stiffness in blocks of a node's two unknowns (BSR); held nodes have the number -1."""
    a = elements.shape[1]
    rows, columns = np.repeat(elements, a, axis=1).ravel(), np.tile(elements, (1, a)).ravel()
    blocks = matrices.reshape(-1, a, 2, a, 2).transpose(0, 1, 3, 2, 4).reshape(-1, 4)
    inside = (rows >= 0) & (columns >= 0)
    pairs, place = np.unique(rows[inside] * nodes + columns[inside], return_inverse=True)
    data = np.stack([np.bincount(place, weights=part) for part in blocks[inside].T], axis=1)
    starts = np.searchsorted(pairs // nodes, np.arange(nodes + 1))
    return sparse.bsr_array((data.reshape(-1, 2, 2), pairs % nodes, starts), shape=(2 * nodes, 2 * nodes))


def _unknowns(node_numbers: IntArray) -> IntArray:
    return (2 * node_numbers[:, None] + np.arange(2)).ravel()


def _bisect(centres: Array) -> tuple[IntArray, int]:
    """Leaf number of each element and the number of levels, by halving along the longer side each time."""
    levels = max(0, int(np.ceil(np.log2(len(centres) / LEAF_ELEMENTS))))
    leaf = np.zeros(len(centres), dtype=np.int64)
    groups = [np.arange(len(centres))]
    for _ in range(levels):
        halves = []
        for group in groups:
            spread = np.ptp(centres[group], axis=0)
            rank = np.argsort(centres[group, int(np.argmax(spread))], kind="stable")
            middle = len(group) // 2
            halves += [group[rank[:middle]], group[rank[middle:]]]
        groups = halves
    for number, group in enumerate(groups):
        leaf[group] = number
    return leaf, levels


def _owners(elements: IntArray, leaf_of: IntArray, levels: int, nodes: int) -> IntArray:
    """Tree node (heap numbering, root 1) at which each mesh node can go: the ancestor its elements' leaves share."""
    leaves = np.repeat(leaf_of + 2**levels, elements.shape[1])
    low = np.full(nodes, np.iinfo(np.int64).max)
    high = np.zeros(nodes, dtype=np.int64)
    np.minimum.at(low, elements.ravel(), leaves)
    np.maximum.at(high, elements.ravel(), leaves)
    for _ in range(levels + 1):  # leaves of a heap share a level: shift both until they meet
        apart = (low != high) & (high > 0)
        low[apart] >>= 1
        high[apart] >>= 1
    return high
