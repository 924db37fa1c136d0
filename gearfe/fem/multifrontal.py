r"""Cholesky factorisation of large sparse matrices on dense fronts, whole or down to a few retained unknowns.

The unknowns are eliminated in groups, the *fronts*. A front collects the rows of A that belong to its own unknowns i,
and the updates of earlier fronts for them. It eliminates these unknowns and leaves an update of the outer ones o,

.. math::
    F_{ii} = L_{ii} L_{ii}^T,\qquad L_{oi} = F_{oi} L_{ii}^{-T},\qquad U = F_{oo} - L_{oi} L_{oi}^T

(the multifrontal method: Duff, Reid, ACM Trans. Math. Softw. 9, 1983; Liu, SIAM Review 34, 1992). Every step is one
dense kernel of LAPACK or BLAS, and a solve with many right-hand sides reads the factor twice, however many there are.
If the last unknowns r are retained, the fronts leave the Schur complement :math:`A_{rr} - A_{re} A_{ee}^{-1} A_{er}` of
the eliminated ones e in their rows. The backward pass recovers the eliminated unknowns. The forward pass transfers
loads on them to the retained ones.

The unknowns of a mesh node stay together. Which nodes are a front: here by bisection of a mesh's elements (nested
dissection: George, SIAM J. Numer. Anal. 10, 1973), for sparse matrices see `gearfe.fem.reduction.sparse_solver`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from ..base.typing import Array, IntArray

#: Elements in a leaf of the bisection for two unknowns a node, and the least for many: below, Python's overhead per
#: front rules; above, the dense work does. 6 instead of 40 halve the time for 30 unknowns a node.
LEAF_ELEMENTS, LEAST_LEAF = 40, 6
#: Rows of an update that are passed on at a time: a strip of them stays in the processor's cache.
STRIP = 64
#: Linear forms that go through the fronts at a time: few of these are met by neighbouring ones.
FORMS = 32


@dataclass(frozen=True)
class Front:
    """Own unknowns ``begin:end`` and outer ones (m,), L_ii (k, k) and L_oi (m, k), both in Fortran order."""

    begin: int
    end: int
    outer: IntArray
    pivot: Array
    coupling: Array


@dataclass(frozen=True)
class Factor:
    """Factor of a symmetric positive definite matrix, up to its retained unknowns.

    Attributes
    ----------
    size
        Order of the matrix.
    order : ndarray, shape (n,)
        Number in the matrix of each unknown in the order of elimination, the retained ones last. Unknowns of the matrix
        that do not appear are held at zero.
    fronts
        In the order of elimination.
    schur : ndarray, shape (r, r)
        A_rr - A_re A_ee^-1 A_er on the retained unknowns (N/m for a stiffness).
    """

    size: int
    order: IntArray
    fronts: tuple[Front, ...]
    schur: Array

    @property
    def retained(self) -> IntArray:
        """Numbers in the matrix of the retained unknowns, shape (r,)."""
        return self.order[len(self.order) - len(self.schur) :]

    def arrays(self) -> dict[str, Array | IntArray]:
        """Return its data as few long arrays by name, to be stored."""
        fronts = self.fronts
        blocks = [block.ravel(order="F") for front in fronts for block in (front.pivot, front.coupling)]
        return {
            "size": np.array(self.size),
            "order": self.order,
            "schur": self.schur,
            "limits": np.array([[front.begin, front.end, len(front.outer)] for front in fronts]).reshape(-1, 3),
            "outer": np.concatenate([self.order[:0], *(front.outer for front in fronts)]),
            "blocks": np.concatenate([np.zeros(0), *blocks]),
        }

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, Any]) -> Factor:
        """Return the factor of `arrays`; its fronts are views of them."""
        limits, outer, blocks = arrays["limits"], arrays["outer"], arrays["blocks"]
        fronts, first, number = [], 0, 0
        for begin, end, others in limits.tolist():
            own, whole = end - begin, end - begin + others
            pivot = blocks[first : first + own * own].reshape((own, own), order="F")
            coupling = blocks[first + own * own : first + own * whole].reshape((others, own), order="F")
            fronts.append(Front(begin, end, outer[number : number + others], pivot, coupling))
            first, number = first + own * whole, number + others
        return cls(int(arrays["size"]), arrays["order"], tuple(fronts), arrays["schur"])

    def solve(self, b: Array) -> Array:
        """Solve for right-hand sides (n,) or (n, p) if no unknowns are retained. Several at a time are much cheaper."""
        x = np.ascontiguousarray(np.atleast_2d(np.transpose(b)).T[self.order], dtype=float)
        self._forward(x)
        self._backward(x)
        return self._spread(x).reshape(np.shape(b))

    def recover(self, values: Array, unknowns: IntArray | None = None, loads: Array | None = None) -> Array:
        """Return the full displacement of a body from that of its retained unknowns.

        Parameters
        ----------
        values : ndarray, shape (r, k)
            Displacements of the retained unknowns, k cases (m).
        unknowns : ndarray, shape (m,), optional
            Numbers in the matrix of eliminated unknowns that carry loads; without them none does.
        loads : ndarray, shape (m, k), optional
            Their loads (N).

        Returns
        -------
        ndarray, shape (size, k)
        """
        x = np.zeros((len(self.order), values.shape[1]))
        if unknowns is not None:
            x[self._numbers()[unknowns]] = loads
            self._forward(x)
        x[len(x) - len(values) :] = values
        self._backward(x)
        return self._spread(x)

    def _numbers(self) -> IntArray:
        """Places of the matrix's unknowns in the order of elimination, for those that are not held."""
        number = np.empty(self.size, dtype=np.int64)
        number[self.order] = np.arange(len(self.order))
        return number

    def on_retained(self, rows: Array, unknowns: IntArray) -> Array:
        """Return linear forms of the full displacement in the retained unknowns: B_r - B_e A_ee^-1 A_er.

        Parameters
        ----------
        rows, unknowns : ndarray, shape (m, a)
            Coefficients of m forms (any unit) and the unknowns that they belong to.

        Returns
        -------
        ndarray, shape (m, r)
        """
        n = len(self.order)
        number = np.full(self.size, n)  # unknowns held at zero are nobody's
        number[self.order] = np.arange(n)
        found, x = np.empty((len(rows), len(self.schur))), np.empty((n + 1, FORMS))
        for first in range(0, len(rows), FORMS):
            part = slice(first, first + FORMS)
            x[:] = 0.0
            np.add.at(x, (number[unknowns[part]], np.arange(len(rows[part]))[:, None]), rows[part])
            self._forward(x)
            found[part] = x[n - len(self.schur) : n, : len(rows[part])].T
        return found

    def reduced_loads(self, unknowns: IntArray, values: Array) -> tuple[Array, Array]:
        """Carry loads forward through the fronts, without a way back.

        Parameters
        ----------
        unknowns : ndarray, shape (m,)
            Numbers in the matrix of the loaded unknowns, none of which is held.
        values : ndarray, shape (m, k)
            Their loads (N), k cases.

        Returns
        -------
        eliminated : ndarray, shape (e, k)
            Y, so that Y^T Y are the displacements, along the loads, of the eliminated unknowns with the retained ones
            held.
        retained : ndarray, shape (r, k)
            Loads that act on the Schur complement (N).
        """
        x = np.zeros((len(self.order), values.shape[1]))
        x[self._numbers()[unknowns]] = values
        self._forward(x)
        cut = len(x) - len(self.schur)
        return x[:cut], x[cut:]

    def _forward(self, x: Array) -> None:
        # rows of x are contiguous: x[a:b].T is in Fortran order, and BLAS changes it in place
        for front in self.fronts:
            own = x[front.begin : front.end]
            if own.any():
                dtrsm(1.0, front.pivot, own.T, side=1, lower=1, trans_a=1, overwrite_b=1)
                x[front.outer] -= front.coupling @ own

    def _backward(self, x: Array) -> None:
        for front in reversed(self.fronts):
            own = x[front.begin : front.end]
            own -= front.coupling.T @ x[front.outer]
            dtrsm(1.0, front.pivot, own.T, side=1, lower=1, overwrite_b=1)

    def _spread(self, x: Array) -> Array:
        full = np.zeros((self.size, x.shape[1]))
        full[self.order] = x
        return full


@dataclass(frozen=True)
class BlockRows:
    """Upper triangle of a symmetric matrix in blocks of w unknowns a node, by rows (as SciPy's BSR).

    Attributes
    ----------
    starts : ndarray, shape (nodes + 1,)
        Where the blocks of each row begin and the last one's end.
    columns : ndarray, shape (blocks,)
        Node of each block's columns, in any order within a row.
    blocks : ndarray, shape (blocks, w, w)
        Their values, those on the diagonal whole.
    """

    starts: IntArray
    columns: IntArray
    blocks: Array


def eliminate(matrix: BlockRows, ends: IntArray, order: IntArray, nodes: int, retained: int = 0) -> Factor:
    """Factorise a symmetric positive definite matrix front by front.

    Parameters
    ----------
    matrix
        Its nodes in the order of elimination.
    ends : ndarray, shape (fronts,)
        One past the last own node of each front.
    order : ndarray
        Number of each node of `matrix` in the whole matrix of so many `nodes`; those left out are held at zero.
    nodes : int
        Number of nodes of the whole matrix.
    retained
        Number of nodes after the last front, which are not eliminated.

    Raises
    ------
    numpy.linalg.LinAlgError
        Matrix that is not positive definite.
    """
    width, starts = matrix.blocks.shape[1], matrix.starts
    groups = np.append(ends, len(order)) if retained else ends
    group_of = np.repeat(np.arange(len(groups)), np.diff(groups, prepend=0))
    waiting: list[list[tuple[IntArray, Array]]] = [[] for _ in groups]  # updates, with the group of their first node
    place = np.empty(len(order), dtype=np.int64)
    fronts: list[Front] = []
    schur, begin = np.zeros((0, 0)), 0
    for end, below in zip(groups.tolist(), waiting, strict=True):
        among = slice(starts[begin], starts[end])
        near = np.unique(np.concatenate([matrix.columns[among], *(left for left, _ in below)]))
        outer = near[np.searchsorted(near, end) :]
        own, size = end - begin, end - begin + len(outer)
        place[begin:end], place[outer] = np.arange(own), np.arange(own, size)
        # everything below is the upper triangle in C order: for BLAS and LAPACK, the lower one in Fortran order
        panel = np.zeros((own * width, size * width))
        row = np.repeat(np.arange(own), np.diff(starts[begin : end + 1]))
        panel.reshape(own, width, size, width)[row, :, place[matrix.columns[among]]] = matrix.blocks[among]
        rest = np.zeros((len(outer) * width,) * 2)
        while below:
            left, update = below.pop()
            index = unknowns_of(place[left], width)
            split = int(np.searchsorted(index, own * width))
            _add(panel, index[:split], index, update)
            _add(rest, index[split:] - own * width, index[split:] - own * width, update[split:, split:])
        if len(fronts) == len(ends):
            schur = np.triu(panel) + np.triu(panel, 1).T
            break
        pivot, failed = dpotrf(np.array(panel[:, : own * width]).T, lower=1, clean=0, overwrite_a=1)
        if failed:
            raise np.linalg.LinAlgError("not positive definite: the body is not held, or an element is inside out")
        coupling = np.array(panel[:, own * width :]).T
        if len(outer):
            coupling = dtrsm(1.0, pivot, coupling, side=1, lower=1, trans_a=1, overwrite_b=1)
            update = dsyrk(-1.0, coupling, beta=1.0, c=rest.T, lower=1, overwrite_c=1).T
            waiting[group_of[outer[0]]].append((outer, update))
        fronts.append(Front(begin * width, end * width, unknowns_of(outer, width), pivot, coupling))
        begin = end
    return Factor(width * nodes, unknowns_of(order, width), tuple(fronts), schur)


def unknowns_of(nodes: IntArray, width: int) -> IntArray:
    """Numbers of the unknowns of nodes that have `width` each."""
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


def condense(
    elements: IntArray, matrices: Array, centres: Array, *, nodes: int, retained: IntArray, fixed: IntArray
) -> Factor:
    """Condense a plane body with two unknowns a node (2 node, 2 node + 1) onto retained nodes.

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

    Raises
    ------
    numpy.linalg.LinAlgError
        A body that can move, or elements inside out.
    """
    order, ends = elimination_order(elements, centres, nodes=nodes, retained=retained, fixed=fixed, width=2)
    number = np.full(nodes, len(order))
    number[order] = np.arange(len(order))
    return eliminate(_assembled(number[elements], matrices, len(order)), ends, order, nodes, len(retained))


def elimination_order(
    elements: IntArray, centres: Array, *, nodes: int, retained: IntArray, fixed: IntArray, width: int
) -> tuple[IntArray, IntArray]:
    """Fronts of a mesh by bisection of its elements.

    Parameters
    ----------
    elements : ndarray, shape (m, a)
        Node numbers of each element.
    centres : ndarray, shape (m, 2)
        Element centres (m).
    nodes
        Number of nodes.
    retained, fixed : ndarray
        Nodes to keep, and nodes held at zero.
    width
        Unknowns of a node.

    Returns
    -------
    order : ndarray
        Nodes in the order of elimination, the retained ones last.
    ends : ndarray, shape (fronts,)
        One past the last node of each front in that order.
    """
    leaf = max(LEAST_LEAF, 2 * LEAF_ELEMENTS // width)
    owner = _owners(elements, centres, nodes, leaf)
    owner[retained] = owner[fixed] = 0  # no front's: the root is 1
    inner = np.argsort(-owner, kind="stable")[: np.count_nonzero(owner)]
    ends = np.flatnonzero(np.diff(owner[inner], append=0)) + 1
    return np.concatenate([inner, retained]), ends


def _owners(elements: IntArray, centres: Array, nodes: int, leaf: int) -> IntArray:
    """Return the smallest subtree of halves (heap numbering, root 1) with all elements of each mesh node.

    The smallest halves have `leaf` elements at most.
    """
    levels = max(0, int(np.ceil(np.log2(len(elements) / leaf))))
    leaves = np.repeat(2**levels + _leaves(centres, levels), elements.shape[1])
    low, high = np.full(nodes, 2 << levels), np.zeros(nodes, dtype=np.int64)
    np.minimum.at(low, elements.ravel(), leaves)
    np.maximum.at(high, elements.ravel(), leaves)
    return high >> np.frexp(low ^ high)[1]  # what the numbers share in front of their first different bit


def _leaves(centres: Array, levels: int) -> IntArray:
    """Leaf of each element, halving along the longer side so many times."""
    leaf = np.zeros(len(centres), dtype=np.int64)
    if levels:
        by_place = np.argsort(centres[:, np.argmax(np.ptp(centres, axis=0))], kind="stable")
        for upper, half in enumerate(np.split(by_place, [len(centres) // 2])):
            leaf[half] = upper << (levels - 1) | _leaves(centres[half], levels - 1)
    return leaf


def _assembled(elements: IntArray, matrices: Array, nodes: int) -> BlockRows:
    """Upper triangle of the sum of element matrices on the first nodes, so many of them; the others are held."""
    shape = len(elements), elements.shape[1], elements.shape[1]
    rows = np.broadcast_to(elements[:, :, None], shape)
    columns = np.broadcast_to(elements[:, None, :], shape)
    kept = np.flatnonzero((rows <= columns) & (columns < nodes))
    key = (rows * nodes + columns).ravel()[kept]
    by_key = np.argsort(key, kind="stable")
    key = key[by_key]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    blocks = matrices.reshape(*shape[:2], 2, shape[2], 2).transpose(0, 1, 3, 2, 4).reshape(-1, 2, 2)
    row, column = np.divmod(key[first], nodes)
    starts = np.searchsorted(row, np.arange(nodes + 1))
    return BlockRows(starts, column, np.add.reduceat(blocks[kept[by_key]], first, axis=0))
