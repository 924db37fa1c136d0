"""Contact points as they lie to their mates, and the linear equations of their pressures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .element_batch import Batch

#: Exchanges of the points that bear, and how often more may be wrong than before.
EXCHANGES, CHANCES = 60, 3


@dataclass(frozen=True)
class State:
    """Pressures at the contact points and what they cause, for all positions of a batch.

    Attributes
    ----------
    pressure, stress, place : ndarray, shape (q,)
        p (Pa), S f (Pa), and foot points on the mates' chains of edges.
    forces, displacement : ndarray of complex, shape (n,)
        f (N) and u = C f (m), tooth axes.
    """

    pressure: Array
    stress: Array
    place: Array
    forces: ComplexArray
    displacement: ComplexArray


@dataclass(frozen=True)
class Seen:
    """Contact points of some positions as they lie to their mates in a state.

    Attributes
    ----------
    points : ndarray, shape (k,)
        Numbers of the contact points.
    nodes : ndarray, shape (k, 6)
        Nodes of each point's own edge and of the edge that it faces.
    normal : ndarray of complex, shape (k, 6)
        G: coefficients of the nodes' displacements in the gap, tooth axes.
    place, gap, area : ndarray, shape (k,)
        Foot points on the mates' chains of edges, gaps (m), and areas as far as they face the mate (m2).
    reached : ndarray of bool, shape (k,)
        Whether the mate has a point that is closest.
    trial : ndarray, shape (k,)
        Pressure that the law asks for (Pa).
    """

    points: IntArray
    nodes: IntArray
    normal: ComplexArray
    place: Array
    gap: Array
    area: Array
    reached: BoolArray
    trial: Array

    def forces(self, pressure: Array, count: int) -> ComplexArray:
        """G^T W p (N), shape (n,), for pressures (Pa), shape (k,)."""
        loads, nodes = self.normal * (self.area * pressure)[:, None], self.nodes.ravel()
        x, y = (np.bincount(nodes, part.ravel(), count) for part in (loads.real, loads.imag))
        return np.asarray(x + 1j * y)

    def closing(self, displacement: ComplexArray) -> Array:
        """G u (m), shape (k,)."""
        return np.asarray((self.normal.conj() * displacement[self.nodes]).real.sum(axis=1))


def seen(batch: Batch, state: State, turn: ComplexArray, points: IntArray) -> Seen:
    """The contact points `points` in a state, with the windows turned by `turn`, shape (W,)."""
    found = batch.project(batch.placed(state.displacement, turn), points, state.place[points])
    normal = found.normal
    own, mate = batch.owner[points], batch.facing[points]
    rows = np.concatenate(
        [
            batch.slave_shapes[points] * (normal * turn[own].conj())[:, None],
            -found.shapes * (normal * turn[mate].conj())[:, None],
        ],
        axis=1,
    )
    reached = found.reached
    trial = np.maximum(-batch.parameter[points] * found.gap - state.stress[points], 0.0)
    return Seen(
        points=points,
        nodes=np.concatenate([batch.slave_nodes[points], found.edge[:, None] + np.arange(3)], axis=1),
        normal=rows,
        place=found.place,
        gap=found.gap,
        area=np.where(reached, batch.areas(found.place, points), 0.0),
        reached=reached,
        trial=np.where(reached, trial, 0.0),
    )


@dataclass
class Equations:
    """M = I + (gamma G C + S) G^T W of one position, on the points that may bear; the others change as it is solved.

    Attributes
    ----------
    points : ndarray, shape (c,)
        Numbers of those points.
    matrix : ndarray, shape (c, c)
        M.
    bears : ndarray of bool, shape (c,)
        Which bore last.
    factor
        Factors of the transposed M of those; None before the first solution.
    """

    points: IntArray
    matrix: Array
    bears: BoolArray
    factor: tuple[Array, IntArray] | None = None

    def solve(self, right: Array, reached: BoolArray, *, held: bool = False) -> Array:
        """Pressures p >= 0 (Pa) with M p >= q, complementary, for q = `right`, all of shape (c,).

        The points that bear are exchanged all at once as long as fewer and fewer are wrong, else one by one, which ends
        for every positive matrix (block principal pivoting: Judice & Pires, *Comput. Oper. Res.* 21, 1994). They stay
        where they are `held`.

        Parameters
        ----------
        reached : ndarray of bool, shape (c,)
            Whether a point has a closest one on its mate.
        """
        fewest, chances = len(right) + 1, CHANCES
        for _ in range(EXCHANGES):
            on = np.flatnonzero(self.bears)
            if self.factor is None:
                # the transposed matrix is what LAPACK sees in C order: factorise that and solve transposed
                self.factor = dgetrf(self.matrix.take(on, axis=0).take(on, axis=1).T, overwrite_a=1)[:2]
            pressure = np.zeros(len(right))
            pressure[on] = dgetrs(*self.factor, right[on], trans=1)[0]
            if held:
                return pressure
            open_ = self.matrix[:, on] @ pressure[on] - right
            wrong = np.where(self.bears, (pressure < 0) | ~reached, (open_ < 0) & reached)
            count = int(np.count_nonzero(wrong))
            if count == 0:
                break
            if count < fewest:
                fewest, chances = count, CHANCES
            elif chances > 0:
                chances -= 1
            else:
                wrong[: int(np.flatnonzero(wrong)[-1])] = False
            self.bears, self.factor = self.bears ^ wrong, None
        return np.maximum(pressure, 0.0)


def equations_of(batch: Batch, b: int, rows: Seen, asks: BoolArray) -> Equations:
    """Those of position b on the points `rows`, of which those that ask for pressure bear at first."""
    points, count = rows.points, len(rows.points)
    nodes, column = np.unique(rows.nodes, return_inverse=True)
    G = np.zeros((count, len(nodes)), dtype=complex)
    G[np.arange(count)[:, None], column.reshape(-1, 6)] = rows.normal
    matrix = np.eye(count)
    for block in batch.blocks[2 * b : 2 * b + 2]:
        own = slice(*np.searchsorted(nodes, [block.nodes.start, block.nodes.stop]))
        unknowns = (2 * (nodes[own] - block.nodes.start)[:, None] + np.arange(2)).ravel()
        opening = np.ascontiguousarray(G[:, own]).view(float)
        loads = (opening * rows.area[:, None]).T
        columns = block.matrix.take(unknowns, axis=1)
        matrix += batch.parameter[points, None] * (opening @ (columns.take(unknowns, axis=0) @ loads))
        if len(block.matrix) > block.matrix.shape[1]:
            mine = np.flatnonzero((points >= block.points.start) & (points < block.points.stop))
            stress = block.matrix.shape[1] + points[mine] - block.points.start
            matrix[mine] += columns.take(stress, axis=0) @ loads
    return Equations(points, matrix, asks)
