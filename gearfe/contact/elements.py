"""Nitsche's and the penalty law by finite elements: positions of a gear pair from first loads on its flanks.

The first loads are those of the half-plane law. They say which tooth pairs bear and where: windows about them are the
pieces of mesh in which the contact is solved, and Newton's method starts there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .compliance import MeshingPair
from .element_batch import Batch, batch_of
from .element_newton import Equations, State, first_state, solve
from .position import Contacts, FlankLoads, PointPressures, Positions, taken

#: What the twist is ahead for derivatives, as a share of the gears' deformation.
AHEAD = 1e-4
#: Windows reach beyond the nodes that are loaded at first by this share of their edges, and by so many edges; then,
#: where a position has not converged in them, further: contacts of soft penalties are wide.
REACHES = ((0.2, 2), (1.0, 6))
#: Positions that are solved side by side.
SIDE_BY_SIDE = 16


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
            places = expected.take(chosen)
            pinion, wheel = (_of_teeth(one) for one in places.loads)
            batch, forces = batch_of(elastic, (pinion, wheel), places.pinion_angle, places.twist, reach)
            made = made.replaced(chosen, _positions(batch, first_state(batch, forces), places))
        open_ = open_[made.status[open_] == "not_converged"]
    return made


def _of_teeth(loads: FlankLoads) -> FlankLoads:
    """One load a tooth: where it bears in several places, their sum."""
    first = np.flatnonzero((np.diff(loads.position, prepend=-1) != 0) | (np.diff(loads.tooth, prepend=0) != 0))
    force = np.add.reduceat(loads.force, first) if len(first) else loads.force
    return FlankLoads(loads.position[first], loads.tooth[first], force, force)


def _at_rims(batch: Batch, state: State) -> BoolArray:
    """Whether a contact has come to the rim of a window beyond which the flank goes on, shape (B,)."""
    edges = np.array([body.flank.edges for body in batch.elastic.bodies])[batch.gear]
    low, high = batch.first_edge > 0, batch.first_edge + batch.counts < edges
    bears = np.flatnonzero(state.pressure > 0)
    rim = np.zeros(len(bears), dtype=bool)
    # on the last edge of the mate's window the normal is not blended into its neighbour's
    for window, place in ((batch.owner, batch.slave_place), (batch.mate[batch.owner], state.place)):
        own, at = window[bears], place[bears]
        rim |= (low[own] & (at < 1)) | (high[own] & (at > batch.counts[own] - 1))
    return np.bincount(batch.at[bears[rim]], minlength=batch.size) > 0


def _positions(batch: Batch, start: State, places: Positions) -> Positions:
    """The solved positions, with derivatives by the same equations at a slightly larger twist."""
    equations: dict[int, Equations] = {}
    here = solve(batch, start, batch.turn, equations)
    one, contacts = _felt(batch, here, batch.turn)
    work = np.bincount(batch.node_position, (here.forces.conj() * here.displacement).real, batch.size)
    ahead = AHEAD * np.divide(work, one["torque_wheel"], out=np.ones(batch.size), where=one["torque_wheel"] > 0)
    turn = batch.turn * np.exp(1j * batch.gear * ahead[batch.position])
    there = solve(batch, here, turn, equations)
    two, later = _felt(batch, there, turn)
    tangent = (two["torque_wheel"] - one["torque_wheel"]) / ahead
    contacts = contacts.with_rates(later, ahead[contacts.position])
    solved = here.converged & there.converged & (tangent > 0) & ~_at_rims(batch, here)
    made = replace(
        places,
        iterations=here.iterations,
        contacts=taken(contacts, contacts.force > 0),
        loads=tuple(_loads(batch, np.flatnonzero(batch.gear == g), here, there, ahead) for g in (0, 1)),
        points=_points(batch, here),
        tangent=tangent,
        energy=0.5 * work,
        **one,
    )
    return made.with_status(np.where(solved, "converged", "not_converged"))


def _loads(batch: Batch, windows: IntArray, here: State, there: State, ahead: Array) -> FlankLoads:
    """Loads on the nodes of one gear's windows, by those of whole flanks."""
    flank = batch.elastic.bodies[batch.gear[windows[0]]].flank
    made = np.zeros((2, len(windows), len(flank.nodes)), dtype=complex)
    for row, w in enumerate(windows):
        own, nodes = batch.window == w, slice(2 * batch.first_edge[w], 2 * (batch.first_edge[w] + batch.counts[w]) + 1)
        made[:, row, nodes] = here.forces[own], (there.forces - here.forces)[own] / ahead[batch.position[w]]
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
    pair, place = batch.tooth[batch.owner[k] % (len(batch.gear) // 2)], _places(batch, state)[gear, k]
    return PointPressures(batch.at[k], gear, pair, place, np.maximum(state.pressure[k], 0.0))


def half_widths(pair: IntArray, place: ComplexArray, load: Array, count: int) -> Array:
    r"""Half widths b (m) of `count` contacts from the second moments of their pressures; not-a-number without load.

    Contact points show the largest pressure badly: it oscillates by some per cent on every mesh, and under a sharp edge
    it has no bound. Force and second moment converge. Hertz's elliptic pressure has the variance :math:`b^2/4` about
    its mean (Johnson, *Contact Mechanics*, 1985, eq. 4.43); :math:`b = 2\sqrt{\operatorname{var}_p(x)}` of any other.

    Parameters
    ----------
    pair, place, load : ndarray, shape (q,)
        Of each point the contact, the place (m), and pressure times area (N). The contact is nearly straight, so the
        largest principal variance is that along it.
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


def _felt(batch: Batch, state: State, turn: ComplexArray) -> tuple[dict[str, Array], Contacts]:
    """Moments that the hubs need (N m), shape (B,), and the contact of each tooth pair, without its rates."""
    pairs, gear = len(batch.gear) // 2, batch.gear[batch.window]
    force, hub = turn[batch.window] * state.forces, gear * batch.elastic.centre_distance
    placed, still = (batch.placed(u, turn) for u in (state.displacement, np.zeros_like(force)))
    moment, reaction = (-((places - hub).conj() * force).imag for places in (placed, still))

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
