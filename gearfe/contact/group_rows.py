"""Linearised contact of a group of positions: rows of the active points, and each position's factorised matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection, gap_rows
from .group import Group

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Rows:
    """Rows of the active points, each over the 12 unknowns that it touches.

    Attributes
    ----------
    points : ndarray, shape (a,)
    at : ndarray, shape (a,)
        Position of each.
    unknowns : ndarray, shape (a, 12)
    opening, normal, tilt, slide : ndarray, shape (a, 12)
        dg/du, G, N and d xi, see `gearfe.contact.closest`.
    """

    points: IntArray
    at: IntArray
    unknowns: IntArray
    opening: Array
    normal: Array
    tilt: Array
    slide: Array
    loads: Array
    cut: Array
    share: Array
    curvature: Array
    thin: Array
    area: Array

    def take(self, chosen: NDArray[np.bool_]) -> Rows:
        """The rows `chosen`."""
        return Rows(**{name: getattr(self, name)[chosen] for name in self.__dataclass_fields__})

    def bending(self, change: Array) -> Array:
        """H change: how the contact forces turn and move when the nodes move by `change`, shape (2n,)."""
        moved = change[self.unknowns]
        tilt, slide = _dot(self.tilt, moved), _dot(self.slide, moved)
        to_slide = -self.loads * self.share * (tilt + self.curvature * slide)
        to_tilt = self.loads * (self.thin * tilt - self.share * slide)
        parts = (
            to_slide[:, None] * self.slide + to_tilt[:, None] * self.tilt + (self.cut * slide)[:, None] * self.normal
        )
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=len(change))

    def forces(self, pressure: Array, size: int) -> Array:
        """G^T W p, shape (size,)."""
        parts = (self.area * pressure)[:, None] * self.normal
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=size)


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)


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


def rows_of(group: Group, found: Projection, pressure: Array, active: IntArray) -> Rows:
    """Rows of the active points at their closest points `found`, under the pressures (Pa), shape (q,)."""
    chosen = found.take(active)
    rows = gap_rows(chosen, group.slave_nodes[active], group.slave_shapes[active], group.rotation)
    steep = chosen.normal[:, 0] * chosen.tangent[:, 0] + chosen.normal[:, 1] * chosen.tangent[:, 1]
    normal, tilt, slide = (x.reshape(len(active), 12) for x in (rows.normal, rows.tilt, rows.slide))
    unknowns = (2 * rows.nodes[:, :, None] + np.arange(2)).reshape(len(active), 12)
    metric = chosen.tangent[:, 0] ** 2 + chosen.tangent[:, 1] ** 2
    area, pressed, weight = group.areas(chosen.place, active), pressure[active], group.weight[active]
    across = (area > 0) & (area < weight)
    return Rows(
        points=active,
        at=group.at[active],
        unknowns=unknowns,
        opening=normal - steep[:, None] * slide,
        normal=normal,
        tilt=tilt,
        slide=slide,
        loads=area * pressed,
        cut=np.where(across, -weight / (2 * group.fade[active]) * pressed, 0.0),
        share=1 - chosen.gap * chosen.curvature / metric,
        curvature=chosen.curvature,
        thin=chosen.gap / metric,
        area=area,
    )


def linearised(group: Group, rows: Rows) -> Linear:
    """Matrices of the active points, factorised."""
    at, unknowns, points = rows.at, rows.unknowns, rows.points
    touched = np.zeros(len(group.points), dtype=bool)
    touched[unknowns[:, ::2] // 2] = True
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
    slots = slot[:, None] + column[unknowns // 2] + np.tile([0, 1], 6)
    opening, weighted = np.zeros(area.sum()), np.zeros(area.sum())
    opening[slots] = group.parameter[points][:, None] * rows.opening
    weighted[slots] = rows.area[:, None] * rows.normal
    # unknowns and stress rows within their blocks
    local = ((2 * (nodes - group.first_node[group.block_window[block]]))[:, None] + np.arange(2)).ravel()
    own = 2 * at + group.gear[group.owner[points]]
    stress = points - group.first_point[group.block_window[own]]
    rows_of_block, columns_of_block = np.bincount(own, minlength=2 * group.size).tolist(), (2 * count).tolist()
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
            compliance.append(matrix[used[:, None], used])
            np.matmul(scaled[:, c:cc], compliance[-1], out=response[:, c:cc])
            if group.stressed is not None and rr > r:
                chosen = stress[top + r : top + rr] + len(group.blocks[k].forces)
                response[r:rr, c:cc] += matrix[chosen[:, None], used]
            r, c = rr, cc
        m = response @ loads.T
        m.flat[:: a + 1] += 1.0
        # the transposed matrix is what LAPACK sees in C order: factorise that, solve transposed, and nothing is copied
        factor = dgetrf(m.T, overwrite_a=1)[:2]
        both = (compliance[0], compliance[1])
        pieces.append(Piece(factor, response, both, b, slice(top, top + a), slice(left, left + t)))
        top, left, start = top + a, left + t, start + a * t
    return Linear(pieces, (2 * nodes[:, None] + np.arange(2)).ravel())
