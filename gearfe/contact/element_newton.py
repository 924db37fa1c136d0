r"""Contact of a batch of positions: Newton's method on the pressures at the points of finite-element flanks.

With the rows :math:`G = n\cdot D` of the gaps' variation at the present state u, the areas W, the compliance C of the
flanks and the stress rows S, a step solves

.. math::
    f = G^T W p, \qquad u^+ = C f, \qquad p = \max(0,\; -\gamma\,(g + G\,(u^+ - u)) - S f) .

What G leaves out (the normals turn and the forces move with the faces; across blended normals the gap also changes as
its foot point slides) enters with the next step, where gaps and rows are taken anew. Errors shrink by about the ratio
of pressure to modulus a step; steps are mixed with those before, so that they shrink faster and settle beside corners.
The matrix is made anew until the solution is near: under sharp corners pressures come to a third of the modulus, and
the rows turn with the faces. A position has converged when its pressures are those that the law asks for *and* its
forces are those of the pressures at the places reached.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .element_batch import Batch
from .position import taken

#: Steps after which a position has not converged.
STEPS = 40
#: Steps that are mixed.
DEPTH = 8
#: Error from which on the matrix serves for all further steps (the chord method: Kelley, *Iterative Methods for Linear
#: and Nonlinear Equations*, 1995, sec. 5.4.1).
CHORD = 1e-3
#: So many points beside those that ask for pressure may bear in a step.
BESIDE = 5
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
class ProjectedPoints:
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


def projected(batch: Batch, state: State, turn: ComplexArray, points: IntArray) -> ProjectedPoints:
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
    return ProjectedPoints(
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


def equations_of(batch: Batch, b: int, rows: ProjectedPoints, asks: BoolArray) -> Equations:
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


def step(
    batch: Batch, state: State, rows: ProjectedPoints, equations: dict[int, Equations], *, held: bool = False
) -> State:
    """One step of the positions whose contact points `rows` are; the others stay.

    Their `equations` need not be made of these very rows: the residual is.
    """
    points, size = rows.points, len(batch.points)
    at = batch.at[points]
    live, first = np.unique(at, return_index=True)
    pressure = state.pressure[points]
    guess, stress = batch.respond(rows.forces(pressure, size), live.tolist())
    opened = rows.gap + rows.closing(guess - state.displacement)
    trial = -batch.parameter[points] * opened - stress[points]
    for b, (start, end) in zip(live.tolist(), itertools.pairwise([*first.tolist(), len(at)]), strict=True):
        own = equations[b]
        mine = start + np.searchsorted(points[start:end], own.points)
        right = trial[mine] - pressure[mine] + own.matrix @ pressure[mine]
        pressure[start:end] = 0.0
        pressure[mine] = own.solve(right, rows.reached[mine], held=held)
    forces = rows.forces(pressure, size)
    displacement, stress = batch.respond(forces, live.tolist())
    moves = np.zeros(batch.size, dtype=bool)
    moves[live] = True
    of_nodes, of_points = moves[batch.node_position], moves[batch.at]
    return State(
        pressure=np.where(of_points, _scattered(pressure, points, len(of_points)), state.pressure),
        stress=np.where(of_points, stress, state.stress),
        place=state.place,
        forces=np.where(of_nodes, forces, state.forces),
        displacement=np.where(of_nodes, displacement, state.displacement),
    )


def _mix(batch: Batch, b: int, past: list[tuple[Array, Array]], old: State, new: State) -> None:
    """Mix the new state of position b with those of the steps before, so that their changes cancel best.

    (Anderson's method: Walker & Ni, *SIAM J. Numer. Anal.* 49, 2011.)
    """
    blocks = batch.blocks[2 * b : 2 * b + 2]
    nodes = slice(blocks[0].nodes.start, blocks[1].nodes.stop)
    points = slice(blocks[0].points.start, blocks[1].points.stop)
    parts = [
        [state.forces.view(float)[2 * nodes.start : 2 * nodes.stop],
         state.displacement.view(float)[2 * nodes.start : 2 * nodes.stop], state.pressure[points], state.stress[points]]
        for state in (old, new)
    ]  # fmt: skip
    here = np.concatenate(parts[1])
    past.append((here, parts[1][0] - parts[0][0]))
    del past[: -DEPTH - 1]
    if len(past) == 1:
        return
    reached, change = (np.array(part) for part in zip(*past, strict=True))
    share = np.linalg.lstsq(np.diff(change, axis=0).T, change[-1], rcond=1e-10)[0]
    mixed = here - share @ np.diff(reached, axis=0)
    ends = np.cumsum([len(part) for part in parts[1]])[:-1]
    for part, values in zip(parts[1], np.split(mixed, ends), strict=True):
        part[:] = values


@dataclass(frozen=True)
class Outcome:
    """End of the iteration of a batch.

    Attributes
    ----------
    state
        Last states.
    equations
        Those of the converged positions.
    iterations : ndarray, shape (B,)
        Steps.
    """

    state: State
    equations: dict[int, Equations]
    iterations: IntArray

    @property
    def points(self) -> IntArray:
        """Contact points of those equations."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *(own.points for own in self.equations.values())])


def solve(batch: Batch, state: State, tolerance: float) -> Outcome:
    """Solve all positions of a batch from a first state, whose pressures choose the points that bear at first."""
    live, iterations = np.ones(batch.size, dtype=bool), np.zeros(batch.size, dtype=np.int64)
    error = np.full(batch.size, np.inf)
    equations: dict[int, Equations] = {}
    past: list[list[tuple[Array, Array]]] = [[] for _ in range(batch.size)]
    done: set[int] = set()
    for number in range(STEPS + 1):
        found = projected(batch, state, batch.turn, np.flatnonzero(live[batch.at]))
        state = replace(state, place=_scattered(found.place, found.points, state.place))
        if number:
            error = _error(batch, state, found)
            converged = live & (error < np.maximum(tolerance, _rounding(batch, found)))
            done |= set(np.flatnonzero(converged).tolist())
            live &= ~converged
        at, bears = batch.at[found.points], state.pressure[found.points] > 0
        asks = found.trial > 0 if number else bears
        # mixing may open all gaps by the overlap of a stiff law: then the points that bear are where to go on
        asks = asks | (bears & (np.bincount(at[asks], minlength=batch.size) == 0)[at])
        live &= np.bincount(at[asks], minlength=batch.size) > 0
        if number == STEPS or not live.any():
            break
        iterations[live] = number + 1
        old = state
        for b in np.flatnonzero(live).tolist():
            mine = slice(*np.searchsorted(at, [b, b + 1]).tolist())
            known = equations[b].points if error[b] < CHORD else ()
            if not np.isin(found.points[mine][asks[mine]], known).all():
                beside = np.convolve(asks[mine], np.ones(2 * BESIDE + 1))[BESIDE:-BESIDE] > 0
                may = mine.start + np.flatnonzero(beside & found.reached[mine])
                equations[b] = equations_of(batch, b, taken(found, may), asks[may])
        state = step(batch, old, taken(found, live[at]), equations)
        for b in np.flatnonzero(live).tolist():
            _mix(batch, b, past[b], old, state)
    return Outcome(state, {b: equations[b] for b in sorted(done)}, iterations)


def turned(batch: Batch, outcome: Outcome, turn: ComplexArray, tolerance: float) -> State:
    """The converged positions with their windows turned on to `turn`, shape (W,), and the same points bearing.

    Parameters
    ----------
    tolerance
        Accuracy of the forces relative to their change; a position that does not reach it gets not-a-number.
    """
    start, of = outcome.state, batch.node_position
    points = outcome.points
    rows = projected(batch, start, batch.turn, points)
    forces = rows.forces(start.pressure[points], len(of))
    state, open_ = start, np.isin(np.arange(batch.size), list(outcome.equations))
    past: dict[int, list[tuple[Array, Array]]] = {b: [] for b in outcome.equations}
    for _ in range(STEPS):
        if not open_.any():
            break
        old = state
        state = step(
            batch, old, projected(batch, old, turn, points[open_[batch.at[points]]]), outcome.equations, held=True
        )
        moved, last = (np.bincount(of, np.abs(state.forces - f), batch.size) for f in (forces, old.forces))
        open_ &= last > tolerance * moved
        for b in np.flatnonzero(open_).tolist():
            _mix(batch, b, past[b], old, state)
    return replace(state, forces=np.where(open_[of], np.nan, state.forces))


def _scattered(values: Array, points: IntArray, whole: Array | int) -> Array:
    """`values` at `points` of `whole`, or of so many zeros."""
    made = np.zeros(whole) if isinstance(whole, int) else whole.copy()
    made[points] = values
    return made


def _error(batch: Batch, state: State, found: ProjectedPoints) -> Array:
    """Of each position how far its pressures are from what the law asks or its forces from those of its pressures at
    the places reached, the larger, relative to their sums, shape (B,).
    """
    at, pressure = batch.at[found.points], state.pressure[found.points]

    def total(values: Array) -> Array:
        return np.bincount(at, values, batch.size)

    off = total(found.area * np.abs(pressure - found.trial)) / np.maximum(total(found.area * found.trial), 1e-300)
    now = found.forces(pressure, len(batch.points))
    of = batch.node_position
    turned = np.bincount(of, np.abs(state.forces - now), batch.size)
    return np.maximum(off, turned / np.maximum(np.bincount(of, np.abs(now), batch.size), 1e-300))


def _rounding(batch: Batch, found: ProjectedPoints) -> Array:
    """Smallest error that rounding lets the law reach in each position: gamma times the last bit of a coordinate."""
    at, bears = batch.at[found.points], found.trial > 0
    stiff = np.bincount(at, found.area * bears * batch.parameter[found.points], batch.size)
    load = np.bincount(at, found.area * found.trial, batch.size)
    extent = batch.elastic.centre_distance
    return np.asarray(np.finfo(float).eps * extent * stiff / np.maximum(load, 1e-300))
