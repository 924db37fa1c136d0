"""Linearised contact of a group of positions: rows of the active points, and each position's factorised matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection
from .exact_rows import exact_rows, sparse_rows, turning_stiffness
from .group import Group

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Rows:
    """Rows of the active points, each over the 20 unknowns that it touches.

    Attributes
    ----------
    points : ndarray, shape (a,)
    at : ndarray, shape (a,)
        Position of each.
    unknowns : ndarray, shape (20, a)
    opening, normal, turn, slide, lift : ndarray, shape (20, a)
        dg/du, G, theta, d xi and A, see `gearfe.contact.exact_rows`.
    loads, cut : ndarray, shape (a,)
        Forces of the points, and their change per unit of the foot point where a sharp end cuts their areas (N).
    metric, bow, gap : ndarray, shape (a,)
        M, nu and g.
    """

    points: IntArray
    at: IntArray
    unknowns: IntArray
    opening: Array
    normal: Array
    turn: Array
    slide: Array
    lift: Array
    loads: Array
    cut: Array
    metric: Array
    bow: Array
    gap: Array
    area: Array

    def take(self, chosen: NDArray[np.bool_]) -> Rows:
        """The rows `chosen`."""
        return Rows(**{name: getattr(self, name)[..., chosen] for name in self.__dataclass_fields__})

    def bending(self, change: Array) -> Array:
        """H change: how the contact forces turn and move when the nodes move by `change`, shape (2n,)."""
        moved = change[self.unknowns]
        slide = _dot(self.slide, moved)
        turned = self.loads * (self.bow * slide + _dot(self.turn, moved))
        parts = self.metric * turned * self.slide + self.gap * turned * self.turn - self.loads * slide * self.lift
        if self.cut.any():
            parts += self.cut * slide * self.normal
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=len(change))

    def forces(self, pressure: Array, size: int) -> Array:
        """G^T W p, shape (size,)."""
        parts = self.area * pressure * self.normal
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=size)


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->j", a, b)


@dataclass(frozen=True)
class Piece:
    """Matrices of one position on the unknowns that its active points touch.

    Attributes
    ----------
    factor
        Of the transposed M = I + R G^T W.
    response : ndarray, shape (a, t)
        R = gamma dg/du C + S.
    compliance : tuple of (ndarray, ndarray)
        C of the pinion and of the wheel.
    position : int
    points, unknowns : slice
        Where its active points and touched unknowns stand among those of all positions.
    """

    factor: tuple[Array, IntArray]
    response: Array
    compliance: tuple[Array, Array]
    position: int
    points: slice
    unknowns: slice


@dataclass(frozen=True)
class Linear:
    """Linearised contact of several positions: their pieces and, one after the other, the unknowns that they touch."""

    pieces: list[Piece]
    touched: IntArray

    def of(self, chosen: NDArray[np.bool_]) -> Linear:
        """The positions `chosen`, shape (B,); of the others nothing is computed any more."""
        return Linear([piece for piece in self.pieces if chosen[piece.position]], self.touched)

    def solve(self, right: Array) -> Array:
        """M^-1 right, shape (a,)."""
        out = np.zeros_like(right)
        for piece in self.pieces:
            out[piece.points] = dgetrs(*piece.factor, right[piece.points], trans=1)[0]
        return out

    def pressures(self, forces: Array, count: int) -> Array:
        """R forces, shape (count,)."""
        loads, out = forces[self.touched], np.zeros(count)
        for piece in self.pieces:
            np.dot(piece.response, loads[piece.unknowns], out=out[piece.points])
        return out

    def displacements(self, forces: Array) -> Array:
        """C forces, shape (2n,); only the touched unknowns are computed."""
        loads, out = forces[self.touched], np.zeros(len(forces))
        moved = np.zeros_like(loads)
        for piece in self.pieces:
            pinion, wheel = piece.compliance
            first, end = piece.unknowns.start, piece.unknowns.stop
            middle = first + len(pinion)
            np.dot(pinion, loads[first:middle], out=moved[first:middle])
            np.dot(wheel, loads[middle:end], out=moved[middle:end])
        out[self.touched] = moved
        return out


def rows_of(group: Group, found: Projection, pressure: Array, active: IntArray, placed: Array) -> Rows:
    """Rows of the active points at their closest points `found`, under the pressures (Pa), shape (q,), with the nodes

    in their places (m), shape (n, 2).
    """
    chosen = found.take(active)
    edges, slaves = group.counts[group.facing[active]], group.slave_nodes[active]
    rows = exact_rows(chosen, edges, placed, slaves, group.slave_shapes[active], group.rotation)
    normal, turn, slide, lift = (x.reshape(20, -1) for x in (rows.normal, rows.turn, rows.slide, rows.lift))
    unknowns = (2 * rows.nodes[:, None] + np.arange(2)[:, None]).reshape(20, -1)
    area, pressed, weight = group.areas(chosen.place, active), pressure[active], group.weight[active]
    across = (area > 0) & (area < weight)
    return Rows(
        points=active,
        at=group.at[active],
        unknowns=unknowns,
        opening=normal - rows.steep * slide,
        normal=normal,
        turn=turn,
        slide=slide,
        lift=lift,
        loads=area * pressed,
        cut=np.where(across, -weight / (2 * group.fade[active]) * pressed, 0.0),
        metric=rows.metric,
        bow=rows.bow,
        gap=chosen.gap,
        area=area,
    )


def linearised(group: Group, rows: Rows) -> Linear:
    """Matrices of the active points, factorised."""
    at, unknowns, points = rows.at, rows.unknowns, rows.points
    touched = np.zeros(len(group.points), dtype=bool)
    touched[unknowns[::2] // 2] = True
    nodes = np.flatnonzero(touched)
    window = group.node_window[nodes]
    block = 2 * group.position[window] + group.gear[window]
    count = np.bincount(block, minlength=2 * group.size)
    length = 2 * (count[::2] + count[1::2])  # touched unknowns of each position
    column = np.empty(len(touched), dtype=np.int64)
    column[nodes] = 2 * np.arange(len(nodes)) - (np.cumsum(length) - length)[group.position[window]]
    active = np.bincount(at, minlength=group.size)
    row = np.arange(len(at)) - (np.cumsum(active) - active)[at]
    area = active * length
    slot = (np.cumsum(area) - area)[at] + row * length[at]
    slots = (slot + column[unknowns // 2] + np.tile([0, 1], 10)[:, None]).ravel()
    opening: Array = np.bincount(slots, (group.parameter[points] * rows.opening).ravel(), area.sum())
    weighted: Array = np.bincount(slots, (rows.area * rows.normal).ravel(), area.sum())
    # unknowns and stress rows within their blocks
    local = ((2 * (nodes - group.first_node[group.block_window[block]]))[:, None] + np.arange(2)).ravel()
    own_block = 2 * at + group.gear[group.owner[points]]
    stress = points - group.first_point[group.block_window[own_block]]
    rows_of_block, columns_of_block = np.bincount(own_block, minlength=2 * group.size).tolist(), (2 * count).tolist()
    pieces: list[Piece] = []
    top = left = start = 0
    for b in np.flatnonzero(active).tolist():
        a, t = rows_of_block[2 * b] + rows_of_block[2 * b + 1], columns_of_block[2 * b] + columns_of_block[2 * b + 1]
        part = slice(start, start + a * t)
        scaled, loads = opening[part].reshape(a, t), weighted[part].reshape(a, t)
        response, compliance = np.empty((a, t)), []
        r = c = 0
        for k in (2 * b, 2 * b + 1):
            matrix, rr, cc = group.blocks[k].matrix, r + rows_of_block[k], c + columns_of_block[k]
            used = local[left + c : left + cc]
            compliance.append(matrix.take(used, axis=0).take(used, axis=1))
            np.matmul(scaled[:, c:cc], compliance[-1], out=response[:, c:cc])
            if group.stressed is not None and rr > r:
                chosen = stress[top + r : top + rr] + len(group.blocks[k].forces)
                response[r:rr, c:cc] += matrix.take(chosen, axis=0).take(used, axis=1)
            r, c = rr, cc
        m = response @ loads.T
        m.flat[:: a + 1] += 1.0
        # the transposed matrix is what LAPACK sees in C order: factorise that, solve transposed, and nothing is copied
        factor = dgetrf(m.T, overwrite_a=1)[:2]
        both = (compliance[0], compliance[1])
        pieces.append(Piece(factor, response, both, b, slice(top, top + a), slice(left, left + t)))
        top, left, start = top + a, left + t, start + a * t
    return Linear(pieces, (2 * nodes[:, None] + np.arange(2)).ravel())


def coupled(
    rows: Rows, piece: Piece, unknowns: IntArray, right: Array, origin: Array, fixed: Array
) -> tuple[Array, Array]:
    """Pressures and forces of one position with p = right - R f for f = G^T W p + H(C f - origin) + fixed.

    `rows` are its own, `origin` and `fixed` on the `unknowns` that they touch, shape (t,).
    """
    columns, count = np.searchsorted(unknowns, rows.unknowns), len(unknowns)
    stiffness = turning_stiffness(
        rows.normal, rows.slide, rows.turn, rows.lift, metric=rows.metric, bow=rows.bow, gap=rows.gap,
        loads=rows.loads, cut=rows.cut, columns=columns, count=count,
    )  # fmt: skip
    split = len(piece.compliance[0])
    bent = np.eye(len(unknowns))
    bent[:, :split] -= stiffness[:, :split] @ piece.compliance[0]
    bent[:, split:] -= stiffness[:, split:] @ piece.compliance[1]
    weighted = sparse_rows(rows.area * rows.normal, columns, count).toarray().T
    sides = np.column_stack([weighted, fixed - stiffness @ origin])
    solved = np.linalg.solve(bent, sides)
    loads, rest = solved[:, :-1], solved[:, -1]
    pressure = np.linalg.solve(np.eye(len(right)) + piece.response @ loads, right - piece.response @ rest)
    return pressure, loads @ pressure + rest
