r"""Contact of a batch of positions: Newton's method on the pressures at the points of finite-element flanks.

With the rows :math:`G = n\cdot D` of the gaps' variation at the present state u = C f, the areas W, the compliance C of
the flanks and the stress rows S, a step solves

.. math::
    f^+ = G^T W p, \qquad p = \max(0,\; -\gamma\,(g + G\,(C f^+ - u)) - S f^+) .

What G leaves out (the normals turn and the forces move with the faces; across blended normals the gap also changes as
its foot point slides) enters with the next step, where gaps and rows are taken anew. Errors shrink by about the ratio
of pressure to modulus a step; steps are mixed with those before, so that they shrink faster and settle beside corners.
The matrix is made anew until the solution is near: under sharp corners pressures come to a third of the modulus, and
the rows turn with the faces. A position has converged when its pressures are those that the law asks for *and* its
forces are those of the pressures at the places reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .element_batch import Batch
from .flank import project
from .position import taken

#: Relative error of pressures and forces at which a position has converged, and steps after which it has not.
TOLERANCE, STEPS = 1e-9, 40
#: Steps that are mixed.
DEPTH = 8
#: Error from which on the matrix serves for all further steps (the chord method: Kelley, *Iterative Methods for Linear
#: and Nonlinear Equations*, 1995, sec. 5.4.1).
CHORD = 1e-3
#: So many points beside those that ask for pressure may bear in a step.
BESIDE = 5
#: Exchanges of the points that bear.
EXCHANGES = 60


@dataclass(frozen=True)
class State:
    """Pressures at the contact points and forces on the nodes, for all positions of a batch.

    Attributes
    ----------
    pressure, place : ndarray, shape (q,)
        p (Pa), and foot points on the mates' chains of edges.
    forces, displacement : ndarray of complex, shape (n,)
        f (N) and u = C f (m), tooth axes.
    iterations : ndarray, shape (B,)
        Steps that led there.
    converged : ndarray of bool, shape (B,)
    """

    pressure: Array
    place: Array
    forces: ComplexArray
    displacement: ComplexArray
    iterations: IntArray
    converged: BoolArray


def first_state(batch: Batch, forces: ComplexArray) -> State:
    """What the first step begins with: the points on loaded edges bear, and windows that face each other begin and end
    at the same places.
    """
    mate, loaded = batch.mate[batch.owner], (forces[batch.slave_nodes] != 0).all(axis=1)
    place = batch.counts[mate] * (1 - batch.slave_place / batch.counts[batch.owner])
    none = np.zeros(batch.size, dtype=np.int64)
    return State(loaded.astype(float), place, forces, np.zeros_like(forces), none, none > 0)


@dataclass(frozen=True)
class ProjectedPoints:
    """Contact points of some positions as they lie to their mates in a state.

    Attributes
    ----------
    points, at : ndarray, shape (k,)
        Numbers of the contact points, and of their positions.
    nodes : ndarray, shape (k, 6)
        Nodes of each point's own edge and of the edge that it faces.
    normal : ndarray of complex, shape (k, 6)
        G: coefficients of the nodes' displacements in the gap, tooth axes.
    place, gap, area : ndarray, shape (k,)
        Foot points on the mates' chains of edges, gaps (m), and areas as far as they face the mate (m2). Without a
        closest point they are `gearfe.contact.flank.OFF_END` and none.
    trial : ndarray, shape (k,)
        Pressure that the law asks for (Pa).
    """

    points: IntArray
    at: IntArray
    nodes: IntArray
    normal: ComplexArray
    place: Array
    gap: Array
    area: Array
    trial: Array

    def forces(self, pressure: Array, count: int) -> ComplexArray:
        """G^T W p (N), shape (n,), for pressures (Pa), shape (k,)."""
        loads, nodes = self.normal * (self.area * pressure)[:, None], self.nodes.ravel()
        x, y = (np.bincount(nodes, part.ravel(), count) for part in (loads.real, loads.imag))
        return np.asarray(x + 1j * y)

    def closing(self, displacement: ComplexArray) -> Array:
        """G u (m), shape (k,)."""
        return np.asarray((self.normal.conj() * displacement[self.nodes]).real.sum(axis=1))


def projected(
    batch: Batch, turn: ComplexArray, displacement: ComplexArray, stress: Array, place: Array, points: IntArray
) -> ProjectedPoints:
    """The contact points `points` from starting places, with windows turned by `turn` and nodes displaced."""
    placed, own = batch.placed(displacement, turn), batch.owner[points]
    mate, half_stretch = batch.mate[own], batch.end_weighting[points]
    found = project(batch.slaves(placed, points), placed, batch.counts, mate, place[points], half_stretch)
    on_own = batch.slave_shapes[points] * (found.normal * turn[own].conj())[:, None]
    on_mate = -found.shapes * (found.normal * turn[mate].conj())[:, None]
    before_end = np.clip(0.5 + (batch.counts[mate] - found.place) / (2 * half_stretch), 0.0, 1.0)
    return ProjectedPoints(
        points=points,
        at=batch.position[own],
        nodes=np.concatenate([batch.slave_nodes[points], found.edge[:, None] + np.arange(3)], axis=1),
        normal=np.concatenate([on_own, on_mate], axis=1),
        place=found.place,
        gap=found.gap,
        area=np.where(found.reached, batch.weight[points] * before_end, 0.0),
        trial=np.maximum(-batch.parameter[points] * found.gap - stress[points], 0.0),
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

    def solve(self, right: Array) -> Array:
        """Pressures p >= 0 (Pa) with M p >= q, complementary, for q = `right`, all of shape (c,).

        All points that are wrong change places at once (block principal pivoting: Judice & Pires, *Comput. Oper. Res.*
        21, 1994).
        """
        for _ in range(EXCHANGES):
            on = np.flatnonzero(self.bears)
            if self.factor is None:
                # the transposed matrix is what LAPACK sees in C order: factorise that and solve transposed
                self.factor = dgetrf(self.matrix.take(on, axis=0).take(on, axis=1).T, overwrite_a=1)[:2]
            pressure = np.zeros(len(right))
            pressure[on] = dgetrs(*self.factor, right[on], trans=1)[0]
            open_ = self.matrix[:, on] @ pressure[on] - right
            wrong = np.where(self.bears, pressure, open_) < 0
            if not wrong.any():
                break
            self.bears, self.factor = self.bears ^ wrong, None
        return np.maximum(pressure, 0.0)


def equations_of(batch: Batch, b: int, rows: ProjectedPoints, bears: BoolArray) -> Equations:
    """Those of position b on the points `rows`, some of which bear at first."""
    points, count = rows.points, len(rows.points)
    nodes, column = np.unique(rows.nodes, return_inverse=True)
    G = np.zeros((count, len(nodes)), dtype=complex)
    G[np.arange(count)[:, None], column.reshape(-1, 6)] = rows.normal
    matrix = np.eye(count)
    for block in batch.blocks[b :: batch.size]:
        own = slice(*np.searchsorted(nodes, [block.nodes.start, block.nodes.stop]))
        unknowns = (2 * (nodes[own] - block.nodes.start)[:, None] + np.arange(2)).ravel()
        opening = np.ascontiguousarray(G[:, own]).view(float)
        loads = (opening * rows.area[:, None]).T
        compliance = block.compliance.take(unknowns, axis=0).take(unknowns, axis=1)
        matrix += batch.parameter[points, None] * (opening @ (compliance @ loads))
        if len(block.stress):
            mine = slice(*np.searchsorted(points, [block.points.start, block.points.stop]))
            stress = block.stress.take(points[mine] - block.points.start, axis=0).take(unknowns, axis=1)
            matrix[mine] += stress @ loads
    return Equations(points, matrix, bears)


def solve(batch: Batch, start: State, turn: ComplexArray, equations: dict[int, Equations]) -> State:
    """Solve all positions of a batch from a first state, with the windows turned by `turn`, shape (W,).

    `equations` are those of positions that were solved before near by, and are those of the last steps afterwards.
    """
    pressure, place, forces = start.pressure.copy(), start.place.copy(), start.forces.copy()
    moved, iterations = np.zeros_like(forces), np.zeros(batch.size, dtype=np.int64)
    live, converged = np.ones(batch.size, dtype=bool), np.zeros(batch.size, dtype=bool)
    of_nodes, of_points = (
        [np.flatnonzero(of == b) for b in range(batch.size)] for of in (batch.node_position, batch.at)
    )
    past: list[list[tuple[Array, Array]]] = [[] for _ in range(batch.size)]
    for number in range(STEPS + 1):
        here, stress = batch.respond(forces, np.flatnonzero(live))
        moved = np.where(live[batch.node_position], here, moved)
        rows = projected(batch, turn, moved, stress, place, np.flatnonzero(live[batch.at]))
        place[rows.points] = rows.place
        p = pressure[rows.points]
        now = rows.forces(p, len(forces))
        error = _error(batch, rows, p, forces, now)
        converged |= live & (error < np.maximum(TOLERANCE, _rounding(batch, rows)))
        asks = (rows.trial > 0) | (p > 0)
        live &= ~converged & (np.bincount(rows.at[asks], minlength=batch.size) > 0)
        if number == STEPS or not live.any():
            break
        iterations[live] += 1
        goes_on = live[rows.at]
        rows, asks, p = taken(rows, goes_on), asks[goes_on], p[goes_on]
        guess, stress = batch.respond(now, np.flatnonzero(live))
        # what the law asks for, linearised, beside the pressures
        off = -batch.parameter[rows.points] * (rows.gap + rows.closing(guess - moved)) - stress[rows.points] - p
        new = np.zeros(len(p))
        for b in np.flatnonzero(live).tolist():
            mine = np.flatnonzero(rows.at == b)
            known = equations[b].points if b in equations and (error[b] < CHORD or number == 0) else ()
            if not np.isin(rows.points[mine][asks[mine]], known).all():
                may = mine[np.convolve(asks[mine], np.ones(2 * BESIDE + 1))[BESIDE:-BESIDE] > 0]
                equations[b] = equations_of(batch, b, taken(rows, may), p[may] > 0)
            own = equations[b]
            on = mine[np.searchsorted(rows.points[mine], own.points)]
            new[on] = own.solve(off[on] + own.matrix @ p[on])
        pressed, loads = np.zeros(len(pressure)), rows.forces(new, len(forces))
        pressed[rows.points] = new
        for b in np.flatnonzero(live).tolist():
            i, k = of_nodes[b], of_points[b]
            was, now = (np.concatenate([f[i].view(float), s[k]]) for f, s in ((forces, pressure), (loads, pressed)))
            past[b] = [*past[b][-DEPTH:], (now, now - was)]
            made = _mixed(past[b])
            forces[i], pressure[k] = made[: 2 * len(i)].view(complex), made[2 * len(i) :]
    return State(pressure, place, forces, moved, iterations, converged)


def _mixed(past: list[tuple[Array, Array]]) -> Array:
    """What the last steps reached, mixed so that their changes cancel best.

    (Anderson's method: Walker & Ni, *SIAM J. Numer. Anal.* 49, 2011.)
    """
    reached, change = (np.array(part) for part in zip(*past, strict=True))
    share = np.linalg.lstsq(np.diff(change, axis=0).T, change[-1], rcond=1e-10)[0]
    return np.asarray(reached[-1] - share @ np.diff(reached, axis=0))


def _error(batch: Batch, rows: ProjectedPoints, pressure: Array, forces: ComplexArray, now: ComplexArray) -> Array:
    """Of each position how far its pressures are from what the law asks or its forces from those of its pressures at
    the places reached, `now`, the larger, relative to their sums, shape (B,).
    """

    def total(at: IntArray, values: Array) -> Array:
        return np.bincount(at, values, batch.size)

    least, of = 1e-300, batch.node_position
    off = total(rows.at, rows.area * np.abs(pressure - rows.trial))
    off /= np.maximum(total(rows.at, rows.area * rows.trial), least)
    return np.maximum(off, total(of, np.abs(forces - now)) / np.maximum(total(of, np.abs(now)), least))


def _rounding(batch: Batch, rows: ProjectedPoints) -> Array:
    """Smallest error that rounding lets the law reach in each position: gamma times the last bit of a coordinate."""
    bears = rows.trial > 0
    stiff = np.bincount(rows.at, rows.area * bears * batch.parameter[rows.points], batch.size)
    load = np.bincount(rows.at, rows.area * rows.trial, batch.size)
    extent = batch.elastic.centre_distance
    return np.asarray(np.finfo(float).eps * extent * stiff / np.maximum(load, 1e-300))
