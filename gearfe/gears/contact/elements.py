r"""Nitsche's and the penalty law by finite elements: positions of a gear pair from solutions that are near.

Those are the half-plane law's. They give the loaded tooth pairs and their positions. The contact is solved in windows
of the mesh about them (`.element_batch`), and Newton's method on the pressures at their points starts there.

The flanks have the compliance C, the contact points the areas W and the stress rows S. With the rows
:math:`G = n\cdot D` of the gaps' variation at the present state u = C f, a step solves

.. math::
    f^+ = G^T W p, \qquad p = \max(0,\; -\gamma\,(g + G\,(C f^+ - u)) - S f^+) .

G leaves out that the normals turn, that the forces move with the faces, and that the gap changes as its foot point
slides across blended normals. This enters with the next step, where gaps and rows are updated. A step reduces errors by
about the ratio of pressure to modulus. Steps are mixed with those before: errors shrink faster, and steps settle beside
corners. The matrix is updated until the solution is near. Under sharp corners pressures reach a third of the modulus,
and the rows turn with the faces. A position has converged when its pressures satisfy the law *and* its forces agree
with the pressures at the displaced points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from .compliance import MeshingPair
from .element_batch import Batch, ProjectedPoints, at_rims, batch_of, projected
from .position import Contacts, FlankLoads, PointPressures, Positions, taken

#: What the twist is ahead for derivatives, as a share of the gears' deformation.
AHEAD = 1e-4
#: Windows reach beyond the nodes that are loaded at first by this share of their edges, and by so many edges; then,
#: where a position has not converged in them, further: contacts of soft penalties are wide.
REACHES = ((0.2, 2), (1.0, 6))
#: Positions that are solved side by side.
SIDE_BY_SIDE = 16
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


def solve_elements(elastic: MeshingPair, expected: Positions) -> Positions:
    """Solve the contact of several positions on the mesh.

    Parameters
    ----------
    expected
        Solutions to start from, with loads: row by row those of pinion and wheel face each other. Those that have not
        converged stay as they are.
    """
    made = expected = replace(expected, contacts=expected.contacts.without_panels())
    open_ = np.flatnonzero(expected.status == "converged")
    for reach in REACHES:
        for start in range(0, len(open_), SIDE_BY_SIDE):
            chosen = open_[start : start + SIDE_BY_SIDE]
            first = expected.take(chosen)
            batch, forces = batch_of(elastic, first, reach)
            made = made.replaced(chosen, _positions(batch, first_state(batch, forces), first))
        open_ = open_[made.status[open_] == "not_converged"]
    return made


def _positions(batch: Batch, start: State, places: Positions) -> Positions:
    """The solved positions, with derivatives by the same equations at a slightly larger twist."""
    equations: dict[int, Equations] = {}
    here = solve(batch, start, batch.turn, equations)
    one, contacts = _felt(batch, here, batch.turn)
    work = np.bincount(batch.node_position, (here.forces.conj() * here.displacement).real, batch.size)
    ahead = AHEAD * np.divide(work, one["torque_wheel"], out=np.ones(batch.size), where=one["torque_wheel"] > 0)
    turn = batch.turn * np.exp(1j * batch.elastic.gears.sign * batch.gear * ahead[batch.position])
    there = solve(batch, here, turn, equations)
    two, later = _felt(batch, there, turn)
    tangent = (two["torque_wheel"] - one["torque_wheel"]) / ahead
    rate = (there.forces - here.forces) / ahead[batch.node_position]
    contacts = contacts.with_rates(later, ahead[contacts.position])
    solved = here.converged & there.converged & (tangent > 0) & ~at_rims(batch, here.pressure, here.place)
    made = replace(
        places,
        iterations=here.iterations,
        contacts=taken(contacts, contacts.force > 0),
        loads=tuple(_loads(batch, g, here.forces, rate) for g in (0, 1)),
        points=_points(batch, here),
        tangent=tangent,
        energy=0.5 * work,
        **one,
    )
    return made.with_status(np.where(solved, "converged", "not_converged"))


def _loads(batch: Batch, gear: int, here: ComplexArray, rate: ComplexArray) -> FlankLoads:
    """Forces on the nodes of one gear's windows (N) and their rates (N/rad), both of shape (n,), by whole flanks."""
    own = np.flatnonzero(batch.gear[batch.window] == gear)
    windows = slice(gear * batch.pairs, (gear + 1) * batch.pairs)
    made = np.zeros((2, batch.pairs, len(batch.elastic.bodies[gear].flank.nodes)), dtype=complex)
    made[:, batch.window[own] % batch.pairs, batch.node[own]] = here[own], rate[own]
    return FlankLoads(batch.position[windows], batch.tooth[windows], *made.view(float))


def _places(batch: Batch, state: State) -> Array:
    """Places of all contact points on the flanks of pinion and wheel, shape (2, q): edge number plus place in it."""
    own, mate = batch.owner, batch.mate[batch.owner]
    on_own, on_mate = batch.slave_place + batch.first_edge[own], state.place + batch.first_edge[mate]
    return np.where(batch.gear[own] == np.array([[0], [1]]), on_own, on_mate)


def _points(batch: Batch, state: State) -> PointPressures:
    """Pressures on every loaded flank, by its own contact points or by those of its mate."""
    alone = ~np.isin(batch.mate[batch.owner], batch.owner)
    gear, k = np.nonzero((batch.gear[batch.owner] == np.array([[0], [1]])) | alone)
    order = np.argsort(batch.at[k], kind="stable")
    gear, k = gear[order], k[order]
    pair, place = batch.tooth[batch.owner[k] % batch.pairs], _places(batch, state)[gear, k]
    return PointPressures(batch.at[k], gear, pair, place, np.maximum(state.pressure[k], 0.0))


def _felt(batch: Batch, state: State, turn: ComplexArray) -> tuple[dict[str, Array], Contacts]:
    """Moments that the hubs need (N m), shape (B,), and the contact of each tooth pair, without its rates."""
    pairs, gear = batch.pairs, batch.gear[batch.window]
    force, hub = turn[batch.window] * state.forces, gear * batch.elastic.wheel_centre
    placed, still = (batch.placed(u, turn) for u in (state.displacement, np.zeros_like(force)))
    against = np.where(gear == 1, -batch.elastic.gears.sign, -1)  # moments that the hubs need; the wheel's by the twist
    moment, reaction = (against * ((places - hub).conj() * force).imag for places in (placed, still))

    def total(values: Array, g: int) -> Array:
        return np.bincount(batch.node_position, np.where(gear == g, values, 0.0), batch.size)

    torques = {
        "torque_wheel": total(moment, 1),
        "torque_pinion": total(moment, 0),
        "torque_wheel_reaction": total(reaction, 1),
    }
    on_wheel, x, y = (np.bincount(batch.window, v, 2 * pairs)[pairs:] for v in (moment, force.real, force.imag))
    pair, load = batch.owner % pairs, batch.weight * np.maximum(state.pressure, 0.0)
    at = batch.slaves(placed, np.arange(len(batch.owner)))
    arcs = [body.flank.arc(own) for body, own in zip(batch.elastic.bodies, _places(batch, state), strict=True)]
    size, unknown, none = np.hypot(x, y), np.full(pairs, np.nan), np.zeros((pairs, 0))
    return torques, Contacts(
        position=batch.position[pairs:],
        pair=batch.tooth[:pairs],
        force=size,
        torque_wheel=on_wheel,
        point=_means(pair, at, load, pairs),
        normal=np.exp(1j * np.arctan2(y, x)),
        arc=np.stack([_means(pair, arc, load, pairs).real for arc in arcs], axis=1),
        half_width=half_widths(pair, at, load, pairs),
        force_rate=unknown,
        normal_rate=unknown,
        growth=unknown,
        arc_rate=np.full((pairs, 2), np.nan),
        x=none,
        width=none,
        pressure=none,
        panel_arc=np.zeros((pairs, 2, 0)),
    )


def half_widths(pair: IntArray, place: ComplexArray, load: Array, count: int) -> Array:
    r"""Return the half widths b of contacts from the second moments of their pressures.

    Contact points show the largest pressure badly: it oscillates by some per cent on every mesh, and under a sharp edge
    it has no bound. Force and second moment converge. Hertz's elliptic pressure has the variance :math:`b^2/4` about
    its mean (Johnson, *Contact Mechanics*, 1985, eq. 4.43); :math:`b = 2\sqrt{\operatorname{var}_p(x)}` of any other.

    Parameters
    ----------
    pair, place, load : ndarray, shape (q,)
        Of each point the contact, the place (m), and pressure times area (N). The contact is nearly straight, so the
        largest principal variance is that along it.
    count : int
        Number of contacts.

    Returns
    -------
    b : ndarray, shape (count,)
        Half widths (m); NaN for contacts without load.
    """
    off = place - _means(pair, place, load, count)[pair]
    square = off * off  # its mean's size is the difference of the principal variances, the mean of |off|^2 their sum
    sums = np.abs(_means(pair, np.abs(square), load, count)) + np.abs(_means(pair, square, load, count))
    return np.asarray(np.sqrt(2 * sums))


def _means(pair: IntArray, values: Any, load: Array, count: int) -> Any:
    """Means of values at points by their loads, shape (count,)."""
    total, real, imag = (np.bincount(pair, load * part, count) for part in (1.0, values.real, values.imag))
    with np.errstate(invalid="ignore"):
        return (real + 1j * imag) / total


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


def _equations_of(batch: Batch, b: int, rows: ProjectedPoints, bears: BoolArray) -> Equations:
    """Return the equations of position b on the points `rows`, some of which bear at first."""
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
    """Solve all positions of a batch from a first state.

    Parameters
    ----------
    batch : Batch
        Positions side by side.
    start : State
        First state.
    turn : ndarray of complex, shape (W,)
        Unit numbers that turn the windows' tooth axes to global ones.
    equations : dict
        Position -> equations that were factorised near by; those of the last steps afterwards.

    Returns
    -------
    state : State
        `State.converged` says which positions converged.
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
        error, least = _errors(batch, rows, p, forces, now)
        converged |= live & (error < np.maximum(TOLERANCE, least))
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
                equations[b] = _equations_of(batch, b, taken(rows, may), p[may] > 0)
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


def _errors(
    batch: Batch, rows: ProjectedPoints, pressure: Array, forces: ComplexArray, now: ComplexArray
) -> tuple[Array, Array]:
    """Of each position its error, and the least that rounding lets the law reach, both of shape (B,).

    The error is the larger of two differences, relative to the sums: of the pressures from those of the law, and of the
    forces from those of the pressures at the places reached, `now`. The least possible error is gamma times the last
    bit of a coordinate.
    """

    def total(at: IntArray, values: Array) -> Array:
        return np.bincount(at, values, batch.size)

    least, of = 1e-300, batch.node_position
    load = np.maximum(total(rows.at, rows.area * rows.trial), least)
    off = total(rows.at, rows.area * np.abs(pressure - rows.trial)) / load
    changed = total(of, np.abs(forces - now)) / np.maximum(total(of, np.abs(now)), least)
    stiff = total(rows.at, rows.area * (rows.trial > 0) * batch.parameter[rows.points])
    return np.maximum(off, changed), np.finfo(float).eps * batch.elastic.gears.working_centre_distance * stiff / load
