r"""Contact of one position: Newton's method on the pressures at the points of finite-element flanks.

With the rows :math:`G = n\cdot D` of the gaps' variation at the present state u, the areas W, the compliance C of the
flanks and the stress rows S, a step solves

.. math::
    f = G^T W p, \qquad u^+ = C f, \qquad p = \max(0,\; -\gamma\,(g + G\,(u^+ - u)) - S f) .

What G leaves out (the normals turn and the forces move with the faces; across blended normals the gap also changes as
its foot point slides) enters with the next step, where gaps and rows are taken anew. Errors shrink by about the ratio
of pressure to modulus a step; steps are mixed with those before, so that they shrink faster and settle beside corners.
The matrix of the first step serves all. A position has converged when its pressures are those that the law asks for
*and* its forces are those of the pressures at the places reached.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .element_windows import Windows
from .position import taken

#: Steps after which a position has not converged.
STEPS = 40
#: Steps that are mixed.
DEPTH = 8
#: So many points beside those that ask for pressure may bear in a step.
BESIDE = 5
#: Exchanges of the points that bear, and how often more may be wrong than before.
EXCHANGES, CHANCES = 60, 3


@dataclass(frozen=True)
class State:
    """Pressures at the contact points and what they cause.

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
    """Contact points as they lie to their mates in a state.

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


def seen(windows: Windows, state: State, turn: ComplexArray, points: IntArray) -> Seen:
    """The contact points `points` in a state, with the windows turned by `turn`, shape (W,)."""
    found = windows.project(windows.placed(state.displacement, turn), points, state.place[points])
    normal = found.normal
    own, mate = windows.owner[points], windows.facing[points]
    rows = np.concatenate(
        [
            windows.slave_shapes[points] * (normal * turn[own].conj())[:, None],
            -found.shapes * (normal * turn[mate].conj())[:, None],
        ],
        axis=1,
    )
    reached = found.reached
    trial = np.maximum(-windows.parameter[points] * found.gap - state.stress[points], 0.0)
    return Seen(
        points=points,
        nodes=np.concatenate([windows.slave_nodes[points], found.edge[:, None] + np.arange(3)], axis=1),
        normal=rows,
        place=found.place,
        gap=found.gap,
        area=np.where(reached, windows.areas(found.place, points), 0.0),
        reached=reached,
        trial=np.where(reached, trial, 0.0),
    )


@dataclass
class Equations:
    """M = I + (gamma G C + S) G^T W on the points that may bear; the others change as it is solved.

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


def equations_of(windows: Windows, rows: Seen, asks: BoolArray) -> Equations:
    """Those on the points `rows`, of which those that ask for pressure bear at first."""
    points, count = rows.points, len(rows.points)
    nodes, column = np.unique(rows.nodes, return_inverse=True)
    G = np.zeros((count, len(nodes)), dtype=complex)
    G[np.arange(count)[:, None], column.reshape(-1, 6)] = rows.normal
    matrix = np.eye(count)
    for block in windows.blocks:
        own = slice(*np.searchsorted(nodes, [block.nodes.start, block.nodes.stop]))
        unknowns = (2 * (nodes[own] - block.nodes.start)[:, None] + np.arange(2)).ravel()
        opening = np.ascontiguousarray(G[:, own]).view(float)
        loads = (opening * rows.area[:, None]).T
        columns = block.matrix.take(unknowns, axis=1)
        matrix += windows.parameter[points, None] * (opening @ (columns.take(unknowns, axis=0) @ loads))
        if len(block.matrix) > block.matrix.shape[1]:
            mine = np.flatnonzero((points >= block.points.start) & (points < block.points.stop))
            stress = block.matrix.shape[1] + points[mine] - block.points.start
            matrix[mine] += columns.take(stress, axis=0) @ loads
    return Equations(points, matrix, asks)


def step(windows: Windows, state: State, rows: Seen, equations: Equations, *, held: bool = False) -> State:
    """One step with the contact points `rows`, among which are those of the `equations`.

    These need not be made of these very rows: the residual is.
    """
    points, size = rows.points, len(windows.points)
    now, mine = state.pressure[points], np.searchsorted(rows.points, equations.points)
    guess, stress = windows.respond(rows.forces(now, size))
    opened = rows.gap + rows.closing(guess - state.displacement)
    trial = -windows.parameter[points] * opened - stress[points]
    right = trial[mine] - now[mine] + equations.matrix @ now[mine]
    pressure = np.zeros(len(state.pressure))
    pressure[equations.points] = equations.solve(right, rows.reached[mine], held=held)
    forces = rows.forces(pressure[points], size)
    displacement, stress = windows.respond(forces)
    return State(pressure, stress, state.place, forces, displacement)


def _mixed(past: list[tuple[Array, Array]], old: State, new: State) -> State:
    """The new state mixed with those of the steps before, so that their changes cancel best.

    (Anderson's method: Walker & Ni, *SIAM J. Numer. Anal.* 49, 2011.)
    """
    before, here = (
        np.concatenate([one.forces.view(float), one.displacement.view(float), one.pressure, one.stress])
        for one in (old, new)
    )
    past.append((here, here[: 2 * len(new.forces)] - before[: 2 * len(new.forces)]))
    del past[: -DEPTH - 1]
    if len(past) == 1:
        return new
    reached, change = (np.array(part) for part in zip(*past, strict=True))
    share = np.linalg.lstsq(np.diff(change, axis=0).T, change[-1], rcond=1e-10)[0]
    n, q = 2 * len(new.forces), len(new.pressure)
    forces, moved, pressure, stress = np.split(here - share @ np.diff(reached, axis=0), [n, 2 * n, 2 * n + q])
    return State(pressure, stress, new.place, forces.view(complex), moved.view(complex))


@dataclass(frozen=True)
class Outcome:
    """End of the iteration.

    Attributes
    ----------
    state
        Last state.
    equations
        The last ones; None where it has not converged.
    iterations
        Steps.
    """

    state: State
    equations: Equations | None
    iterations: int


def solve(windows: Windows, state: State, tolerance: float) -> Outcome:
    """Solve a position from a first state, whose pressures choose the points that bear at first."""
    equations: Equations | None = None
    past: list[tuple[Array, Array]] = []
    for number in range(STEPS + 1):
        found = seen(windows, state, windows.turn, np.arange(len(windows.owner)))
        state = replace(state, place=found.place)
        if number and _error(windows, state, found) < max(tolerance, _rounding(windows, found)):
            return Outcome(state, equations, number)
        bears = state.pressure > 0
        asks = found.trial > 0 if number else bears
        if not asks.any():  # mixing may open all gaps by the overlap of a stiff law: go on with the points that bear
            asks = bears
        if number == STEPS or not asks.any():
            break
        if equations is None or np.count_nonzero(asks[equations.points]) < np.count_nonzero(asks):
            beside = np.convolve(asks, np.ones(2 * BESIDE + 1))[BESIDE:-BESIDE] > 0
            may = np.flatnonzero(beside & found.reached)
            equations = equations_of(windows, taken(found, may), asks[may])
        state = _mixed(past, state, step(windows, state, found, equations))
    return Outcome(state, None, number)


def turned(windows: Windows, state: State, equations: Equations, turn: ComplexArray, tolerance: float) -> State:
    """A converged state with its windows turned on to `turn`, shape (W,), and the same points bearing.

    Parameters
    ----------
    tolerance
        Accuracy of the forces relative to their change; without it there are none.
    """
    points, past = equations.points, list[tuple[Array, Array]]()
    forces = seen(windows, state, windows.turn, points).forces(state.pressure[points], len(windows.points))
    for _ in range(STEPS):
        made = step(windows, state, seen(windows, state, turn, points), equations, held=True)
        moved, last = (np.abs(made.forces - before).sum() for before in (forces, state.forces))
        if not last > tolerance * moved:
            return made
        state = _mixed(past, state, made)
    return replace(state, forces=np.full_like(forces, np.nan))


def _error(windows: Windows, state: State, found: Seen) -> float:
    """How far the pressures are from what the law asks or the forces from those of the pressures at the places
    reached, the larger, relative to their sums.
    """
    off = (found.area * np.abs(state.pressure - found.trial)).sum() / max((found.area * found.trial).sum(), 1e-300)
    now = found.forces(state.pressure, len(windows.points))
    return float(max(off, np.abs(state.forces - now).sum() / max(np.abs(now).sum(), 1e-300)))


def _rounding(windows: Windows, found: Seen) -> float:
    """Smallest error that rounding lets the law reach: gamma times the last bit of a coordinate."""
    stiff = (found.area * (found.trial > 0) * windows.parameter).sum()
    extent = windows.elastic.centre_distance
    return float(np.finfo(float).eps * extent * stiff / max((found.area * found.trial).sum(), 1e-300))
