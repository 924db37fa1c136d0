"""Static condensation of a finite-element body onto a few retained unknowns by nested dissection.

The elements are bisected into small leaves. Every node is eliminated as soon as all elements round it have been joined,
with dense Cholesky kernels on each front (the multifrontal method: Duff & Reid, ACM TOMS 9, 1983; nested dissection:
George, SIAM J. Numer. Anal. 10, 1973). The root front is the Schur complement on the retained unknowns; the fronts stay
for recovering the eliminated ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from ..typing import Array, BoolArray, IntArray

#: Elements in a leaf: below, Python's overhead per front rules; above, the dense work does.
LEAF_ELEMENTS = 40


@dataclass(frozen=True)
class _Front:
    """One front: eliminated unknowns `inner`, remaining ones `outer`, K_ii = U^T U and U^-T K_io."""

    inner: IntArray
    outer: IntArray
    factor: Array
    coupling: Array


@dataclass(frozen=True)
class Condensed:
    """Schur complement on the retained unknowns with the way back to the eliminated ones.

    Attributes
    ----------
    schur : ndarray, shape (r, r)
        K_rr - K_re K_ee^-1 K_er (N/m), in the order of `retained`.
    retained : ndarray, shape (r,)
        Retained unknowns (numbers in the full vector).
    size
        Length of the full vector.
    fronts
        In the order of elimination; recovery runs backwards.
    """

    schur: Array
    retained: IntArray
    size: int
    fronts: tuple[_Front, ...]

    def recover(self, values: Array) -> Array:
        """Full displacement of a body without loads on its eliminated unknowns.

        Parameters
        ----------
        values : ndarray, shape (r, k)
            Displacements of the retained unknowns, k cases (m).

        Returns
        -------
        ndarray, shape (size, k)
        """
        full = np.zeros((self.size, values.shape[1]))
        full[self.retained] = values
        for front in reversed(self.fronts):
            right = front.coupling @ full[front.outer]
            full[front.inner] = -dtrsm(1.0, front.factor, right)
        return full

    def on_retained(self, rows: Array, unknowns: IntArray) -> Array:
        """What gives linear forms of the full displacement from the retained unknowns alone: B_r - B_e K_ee^-1 K_er.

        Parameters
        ----------
        rows, unknowns : ndarray, shape (m, a)
            Coefficients of m forms (any unit) and the unknowns that they belong to.

        Returns
        -------
        ndarray, shape (m, r)
        """
        seen = np.zeros(self.size, dtype=bool)
        seen[unknowns], seen[self.retained], fronts = True, True, []
        for front in self.fronts:
            if seen[front.inner].any():
                seen[front.inner], seen[front.outer] = True, True
                fronts.append(front)
        place = np.cumsum(seen) - 1
        forms = np.zeros((place[-1] + 1, len(rows)))
        np.add.at(forms, (place[unknowns], np.arange(len(rows))[:, None]), rows)
        for front in fronts:
            own = forms[place[front.inner]]
            met = np.flatnonzero(own.any(axis=0))  # few forms look into a small front
            solved = dtrsm(1.0, front.factor, own[:, met], trans_a=1)
            forms[np.ix_(place[front.outer], met)] -= front.coupling.T @ solved
        return np.ascontiguousarray(forms[place[self.retained]].T)


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
    leaf_of, levels = _bisect(centres)
    owner = _owners(elements, leaf_of, levels, nodes)
    owner[retained] = 0  # above the root, which is 1
    owner[fixed] = -1
    # in the order in which they go: a front then eliminates the first of its nodes
    order = np.argsort(-owner, kind="stable")
    number = np.empty(nodes, dtype=np.int64)
    number[order] = np.arange(nodes)
    elements, free = number[elements], owner[order] >= 0
    fronts: list[_Front] = []
    pending: dict[int, tuple[IntArray, Array]] = {}
    for leaf in range(2**levels):
        pending[2**levels + leaf] = _leaf(elements[leaf_of == leaf], matrices[leaf_of == leaf], free)
    for front in range(2 ** (levels + 1) - 1, 0, -1):
        if front < 2**levels:
            pending[front] = _merge(pending.pop(2 * front), pending.pop(2 * front + 1))
        members, matrix = pending[front]
        count = int(np.count_nonzero(owner[order[members]] == front))
        if count:
            made, update = _eliminated(_unknowns(order[members]), matrix, 2 * count)
            fronts.append(made)
            pending[front] = members[count:], update
    members, matrix = pending[1]
    place = _unknowns(np.searchsorted(members, number[retained]))
    whole = matrix + np.tril(matrix, -1).T
    return Condensed(whole[np.ix_(place, place)], _unknowns(retained), 2 * nodes, tuple(fronts))


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


def _leaf(elements: IntArray, matrices: Array, free: BoolArray) -> tuple[IntArray, Array]:
    """Assemble a leaf densely on its free nodes: as for all fronts, their numbers rise and the matrix is lower
    triangular.
    """
    members, local = np.unique(elements, return_inverse=True)
    local = local.reshape(elements.shape)
    rows = (2 * local[:, :, None] + np.arange(2)).reshape(len(elements), -1)
    size = 2 * len(members)
    flat = rows[:, :, None] * size + rows[:, None, :]
    matrix = np.bincount(flat.ravel(), weights=matrices.ravel(), minlength=size * size).reshape(size, size)
    keep = free[members]
    if not keep.all():
        index = _unknowns(np.flatnonzero(keep))
        matrix, members = matrix[np.ix_(index, index)], members[keep]
    return members, np.tril(matrix)


def _merge(left: tuple[IntArray, Array], right: tuple[IntArray, Array]) -> tuple[IntArray, Array]:
    members = np.union1d(left[0], right[0])
    matrix = np.zeros((2 * len(members), 2 * len(members)))
    one, other = (_unknowns(np.searchsorted(members, nodes)) for nodes in (left[0], right[0]))
    matrix[one[:, None], one] = left[1]
    matrix[other[:, None], other] += right[1]
    return members, matrix


def _eliminated(unknowns: IntArray, matrix: Array, count: int) -> tuple[_Front, Array]:
    """Eliminate the first unknowns of a front, so many of them; the lower triangular matrix of the others."""
    # LAPACK sees rows as columns: of the lower triangular matrix the upper one, without a copy
    factor, info = dpotrf(matrix[:count, :count].T, clean=0)
    if info != 0:
        raise np.linalg.LinAlgError("the body is not held or an element is inside out")
    coupling = dtrsm(1.0, factor, matrix[count:, :count].T, trans_a=1)
    update = dsyrk(-1.0, coupling, beta=1.0, c=matrix[count:, count:].copy().T, trans=1, overwrite_c=1)
    return _Front(unknowns[:count], unknowns[count:], factor, coupling), update.T
