r"""Contact of many positions in lockstep: Newton's method on the pressures at the points of finite-element flanks.

With the rows :math:`G = n\cdot D` of the gaps' variation at the present state u, the areas W, the compliance C of the
flanks and the stress rows S, a step solves on the points that bear

.. math::
    f = G^T W p, \qquad u^+ = C f, \qquad p = -\gamma\,(g + G\,(u^+ - u)) - S f .

What G leaves out (the normals turn and the forces move with the faces; across blended normals the gap also changes as
its foot point slides) enters with the next step, where gaps and rows are taken anew: an error shrinks by a factor of
some hundred a step, which is the ratio of contact pressure to modulus times that of tooth height to contact width.
A position has converged when its pressures are those that the law asks for *and* its forces are those of the pressures
at the places reached.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection, unreached
from .element_batch import Batch, Block

Array = NDArray[Any]
IntArray = NDArray[Any]
ComplexArray = NDArray[np.complex128]

#: Steps after which a position has not converged.
STEPS = 30
#: Steps that are mixed.
DEPTH = 4


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
    asked : ndarray, shape (k,)
        Pressure that the law asks for (Pa).
    """

    points: IntArray
    nodes: IntArray
    normal: ComplexArray
    place: Array
    gap: Array
    area: Array
    reached: NDArray[np.bool_]
    asked: Array

    def take(self, index: Any) -> Seen:
        """The points `index` of these."""
        return Seen(**{name: getattr(self, name)[index] for name in self.__dataclass_fields__})

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
    normal = found.normal[:, 0] + 1j * found.normal[:, 1]
    own, mate = batch.owner[points], batch.facing[points]
    rows = np.concatenate(
        [
            batch.slave_shapes[points] * (normal * turn[own].conj())[:, None],
            -found.shapes * (normal * turn[mate].conj())[:, None],
        ],
        axis=1,
    )
    reached = ~unreached(found.gap)
    asked = np.maximum(-batch.parameter[points] * found.gap - state.stress[points], 0.0)
    return Seen(
        points=points,
        nodes=np.concatenate([batch.slave_nodes[points], found.edge[:, None] + np.arange(3)], axis=1),
        normal=rows,
        place=found.place,
        gap=found.gap,
        area=np.where(reached, batch.areas(found.place, points), 0.0),
        reached=reached,
        asked=np.where(reached, asked, 0.0),
    )


@dataclass(frozen=True)
class Piece:
    """Equations of one position: its bearing points, and the factors of the transposed matrix."""

    points: IntArray
    factor: tuple[Array, IntArray]

    def solve(self, right: Array) -> Array:
        """Pressures (Pa) for right-hand sides (Pa)."""
        return np.asarray(dgetrs(*self.factor, right, trans=1)[0])


def piece_of(batch: Batch, b: int, rows: Seen) -> Piece:
    """I + (gamma G C + S) G^T W of position b, on its bearing points `rows`."""
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
    # the transposed matrix is what LAPACK sees in C order: factorise that, solve transposed, and nothing is copied
    return Piece(points, dgetrf(matrix.T, overwrite_a=1)[:2])


Pieces = dict[int, Piece]


def step(batch: Batch, state: State, rows: Seen, pieces: Pieces) -> State:
    """One step of the positions to which the bearing points `rows` belong; the others stay.

    Their equations `pieces` need not be those of these very rows: the residual is.
    """
    points, size = rows.points, len(batch.points)
    at = batch.at[points]
    live, first = np.unique(at, return_index=True)
    pressure = state.pressure[points]
    guess, stress = batch.respond(rows.forces(pressure, size), live.tolist())
    opened = rows.gap + rows.closing(guess - state.displacement)
    right = -batch.parameter[points] * opened - stress[points] - pressure
    for b, part in zip(live.tolist(), np.split(np.arange(len(at)), first[1:]), strict=True):
        pressure[part] += pieces[b].solve(right[part])
    forces = rows.forces(pressure, size)
    displacement, stress = batch.respond(forces, live.tolist())
    mine = np.zeros(batch.size, dtype=bool)
    mine[live] = True
    of_nodes, of_points = mine[batch.node_position], mine[batch.at]
    return State(
        pressure=np.where(of_points, _spread(pressure, points, len(of_points)), state.pressure),
        stress=np.where(of_points, stress, state.stress),
        place=state.place,
        forces=np.where(of_nodes, forces, state.forces),
        displacement=np.where(of_nodes, displacement, state.displacement),
    )


def _mixed(batch: Batch, b: int, past: list[tuple[Array, Array]], old: State, new: State) -> State:
    """The new state of position b, mixed with those of the steps before so that their changes cancel best.

    (Anderson's method: Walker & Ni, *SIAM J. Numer. Anal.* 49, 2011.)
    """
    nodes = slice(batch.blocks[2 * b].nodes.start, batch.blocks[2 * b + 1].nodes.stop)
    points = slice(batch.blocks[2 * b].points.start, batch.blocks[2 * b + 1].points.stop)

    def vector(state: State) -> Array:
        return np.concatenate([state.forces[nodes].view(float), state.displacement[nodes].view(float),
                               state.pressure[points], state.stress[points]])  # fmt: skip

    here, count = vector(new), 2 * (nodes.stop - nodes.start)
    past.append((here, here[:count] - vector(old)[:count]))
    if len(past) == 1:
        return new
    del past[:-DEPTH - 1]
    reached, change = (np.array(part) for part in zip(*past, strict=True))
    share = np.linalg.lstsq(np.diff(change, axis=0).T, change[-1], rcond=1e-10)[0]
    mixed = here - share @ np.diff(reached, axis=0)
    new.forces[nodes].view(float)[:] = mixed[:count]
    new.displacement[nodes].view(float)[:] = mixed[count : 2 * count]
    new.pressure[points], new.stress[points] = np.split(mixed[2 * count :], 2)
    return new


@dataclass(frozen=True)
class Outcome:
    """End of the iteration of a batch.

    Attributes
    ----------
    state
        Last states.
    pieces
        Equations of the converged positions.
    iterations : ndarray, shape (B,)
        Steps.
    """

    state: State
    pieces: Pieces
    iterations: IntArray


def solve(batch: Batch, state: State, tolerance: float) -> Outcome:
    """Solve all positions of a batch from a first state, whose pressures choose the points that bear at first."""
    live, iterations = np.ones(batch.size, dtype=bool), np.zeros(batch.size, dtype=np.int64)
    pieces: Pieces = {}
    done: Pieces = {}
    past: dict[int, list[tuple[Array, Array]]] = {}
    for number in range(STEPS + 1):
        found = seen(batch, state, batch.turn, np.flatnonzero(live[batch.at]))
        state = replace(state, place=_spread(found.place, found.points, state.place))
        bears = found.reached & ((found.asked if number else state.pressure[found.points]) > 0)
        if number:
            converged = live & (_error(batch, state, found) < np.maximum(tolerance, _rounding(batch, found)))
            done |= {b: pieces[b] for b in np.flatnonzero(converged).tolist()}
            live &= ~converged
        live &= np.bincount(batch.at[found.points[bears]], minlength=batch.size) > 0
        if number == STEPS or not live.any():
            break
        iterations[live] = number + 1
        rows = found.take(bears & live[batch.at[found.points]])
        at = batch.at[rows.points]
        for b in np.flatnonzero(live).tolist():
            mine = slice(*np.searchsorted(at, [b, b + 1]).tolist())
            if b not in pieces or not np.array_equal(pieces[b].points, rows.points[mine]):
                pieces[b] = piece_of(batch, b, rows.take(mine))
                past[b] = []
        new = step(batch, state, rows, pieces)
        for b in np.flatnonzero(live).tolist():
            new = _mixed(batch, b, past[b], state, new)
        state = new
    return Outcome(state, done, iterations)


def _spread(values: Array, points: IntArray, whole: Array | int) -> Array:
    """`values` at `points` of `whole`, or of so many zeros."""
    made = np.zeros(whole) if isinstance(whole, int) else whole.copy()
    made[points] = values
    return made


def _error(batch: Batch, state: State, found: Seen) -> Array:
    """Of each position how far its pressures are from what the law asks or its forces from those of its pressures at
    the places reached, the larger, relative to their sums, shape (B,).
    """
    at, pressure = batch.at[found.points], state.pressure[found.points]

    def total(values: Array) -> Array:
        return np.bincount(at, values, batch.size)

    off = total(found.area * np.abs(pressure - found.asked)) / np.maximum(total(found.area * found.asked), 1e-300)
    now = found.forces(pressure, len(batch.points))
    of = batch.node_position
    turned = np.bincount(of, np.abs(state.forces - now), batch.size)
    return np.maximum(off, turned / np.maximum(np.bincount(of, np.abs(now), batch.size), 1e-300))


def _rounding(batch: Batch, found: Seen) -> Array:
    """Smallest error that rounding lets the law reach in each position: gamma times the last bit of a coordinate."""
    at, bears = batch.at[found.points], found.asked > 0
    stiff = np.bincount(at, found.area * bears * batch.parameter[found.points], batch.size)
    load = np.bincount(at, found.area * found.asked, batch.size)
    extent = batch.elastic.centre_distance
    return np.asarray(np.finfo(float).eps * extent * stiff / np.maximum(load, 1e-300))
