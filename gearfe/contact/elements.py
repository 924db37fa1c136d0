"""Nitsche's and the penalty law by finite elements: positions of a gear pair from first contacts.

The first contacts are those of the half-plane law (`first_contacts`): where each tooth pair touches, how wide and under
which pressure. They place the windows in which the mesh's own contact is solved, and Newton's method starts there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .compliance import MeshingPair
from .element_batch import Batch, FirstContacts, batch_of, windows_of
from .element_newton import Outcome, State, projected, solve, turned
from .flank import edge_shapes
from .flank_compliance import FlankCompliance
from .half_plane_result import PairContacts
from .position import Contacts, FlankLoads, PointPressures, Positions, no_contact, of_positions

#: Relative error of pressures and forces at which a position counts as converged.
TOLERANCE = 1e-9
#: Windows reach beyond the first pressure by this share of its length and so many edges; again where the contact came
#: to a window's rim.
REACHES = ((0.2, 2), (1.0, 6))
#: What the twist is ahead for derivatives, as a share of the gears' deformation; relative accuracy of the differences.
AHEAD, SETTLED = 1e-4, 1e-5
#: Memory for the matrices of positions that are solved side by side.
BATCH_BYTES = 60e6


def first_contacts(sides: Sequence[FlankCompliance], contacts: PairContacts) -> FirstContacts:
    """The contacts that the half-plane law has found, as places on the chains of edges."""
    arc = contacts.panel_arc + np.array([side.offset for side in sides])[:, None]
    # the contacts of one tooth pair become one with all their panels
    step = (np.diff(contacts.position, prepend=-1) != 0) | (np.diff(contacts.pair, prepend=0) != 0)
    step[:1] = True
    whole = np.cumsum(step) - 1
    place = np.arange(len(whole)) - np.flatnonzero(step)[whole]
    size = 1 + int(place.max(initial=0))
    count, n = int(step.sum()), contacts.pressure.shape[1]
    arcs = np.repeat(arc[step][:, :, -1:], size * n, axis=2).reshape(count, 2, size, n)
    pressure, width = np.zeros((2, count, size, n))
    arcs[whole, :, place], pressure[whole, place], width[whole, place] = arc, contacts.pressure, contacts.width
    normal: ComplexArray = np.zeros(count, dtype=np.complex128)
    np.add.at(normal, whole, contacts.force * contacts.normal)
    return FirstContacts(
        position=contacts.position[step],
        pair=contacts.pair[step],
        normal=normal / np.abs(normal),
        arc=arcs.reshape(count, 2, size * n),
        pressure=pressure.reshape(count, size * n),
        width=width.reshape(count, size * n),
    )


def solve_elements(elastic: MeshingPair, angles: Array, twists: Array, first: FirstContacts) -> Positions:
    """Solve the contact of several positions on the mesh.

    Parameters
    ----------
    angles, twists : ndarray, shape (n,)
        Pinion angles and twists (rad).
    first
        Contacts to start from; positions without one have ``no_contact``.
    """
    made = no_contact(angles, twists, [len(body.own) for body in elastic.bodies])
    open_ = np.unique(first.position)
    for reach in REACHES:
        outgrown: list[int] = []
        for chosen in _batches(elastic, first, open_, reach):
            mine = of_positions(first, chosen)
            batch = batch_of(elastic, mine, angles[chosen], twists[chosen], reach)
            outcome = solve(batch, _start(batch, mine), TOLERANCE)
            rims = _at_rims(batch, outcome.state)
            held = {b: own for b, own in outcome.equations.items() if not rims[b]}
            outcome = replace(outcome, equations=held)  # what has outgrown its windows is not solved
            made = made.replaced(chosen, _positions(batch, outcome, made.take(chosen)))
            outgrown += chosen[rims].tolist()
        open_ = np.array(outgrown, dtype=np.int64)
    return made


def _batches(
    elastic: MeshingPair, first: FirstContacts, positions: IntArray, reach: tuple[float, int]
) -> list[IntArray]:
    """Positions in parts whose matrices fit into `BATCH_BYTES`."""
    nodes = 2 * windows_of(elastic, first, *reach)[1] + 1
    count = 1 + int(positions.max(initial=0))
    size = np.sum([np.bincount(first.position, of_gear, count) ** 2 for of_gear in nodes.T], axis=0)
    held = np.cumsum(96 * size[positions])  # 8 bytes, four numbers a pair of nodes, and twice as many stress rows
    return [part for part in np.split(positions, np.flatnonzero(np.diff(held // BATCH_BYTES)) + 1) if len(part)]


def _start(batch: Batch, first: FirstContacts) -> State:
    """Pressures at the contact points and forces on the nodes from those at the samples of the first contacts."""
    pressure, place = np.zeros(len(batch.owner)), np.zeros(len(batch.owner))
    forces = np.zeros(len(batch.points), dtype=complex)
    width, flanks = batch.elastic.width, [body.flank for body in batch.elastic.bodies]
    ends = [flank.ends for flank in flanks]
    bounds = np.searchsorted(batch.owner, np.arange(len(batch.gear) + 1))
    for w, (m, g) in enumerate(zip(batch.couple.tolist(), batch.gear.tolist(), strict=True)):
        arc, mate, load = first.arc[m, g], first.arc[m, 1 - g], first.pressure[m] * first.width[m]
        edge, xi = flanks[g].place(arc)
        on, shapes = np.flatnonzero(load > 0), edge_shapes(xi)[0]
        nodes = batch.first_node[w] + 2 * (edge[on, None] - batch.first_edge[w]) + np.arange(3)
        along = width * (2 * g - 1) * first.normal[m] * batch.turn[w].conj()
        np.add.at(forces, nodes, shapes[on] * (along * load[on])[:, None])
        mine = slice(bounds[w], bounds[w + 1])
        if mine.start == mine.stop:
            continue
        at = batch.slave_shapes[mine] @ [0.0, 0.5, 1.0] + (batch.slave_nodes[mine, 0] - batch.first_node[w]) // 2
        s = np.interp(at + batch.first_edge[w], np.arange(len(ends[g])), ends[g])
        order = np.argsort(arc)
        pressure[mine] = np.interp(s, arc[order], first.pressure[m][order], left=0.0, right=0.0)
        inside = np.clip(s, arc[order[0]], arc[order[-1]])
        way = np.sign(mate[order[-1]] - mate[order[0]])
        facing = np.interp(inside, arc[order], mate[order]) + way * (s - inside)
        chain = np.interp(facing, ends[1 - g], np.arange(len(ends[1 - g]))) - batch.first_edge[batch.mate[w]]
        place[mine] = np.clip(chain, 0.0, batch.counts[batch.mate[w]])
    displacement, stress = batch.respond(forces, range(batch.size))
    return State(pressure, stress, place, forces, displacement)


def _at_rims(batch: Batch, state: State) -> BoolArray:
    """Whether a contact has come to the rim of a window that could be longer, shape (B,)."""
    edges = np.array([body.flank.edges for body in batch.elastic.bodies])[batch.gear]
    low, high = batch.first_edge > 0, batch.first_edge + batch.counts < edges
    bears = np.flatnonzero(state.pressure > 0)
    own, facing, place = batch.owner[bears], batch.facing[bears], state.place[bears]
    edge = (batch.slave_nodes[bears, 0] - batch.first_node[own]) // 2
    rim = (low[own] & (edge == 0)) | (high[own] & (edge == batch.counts[own] - 1))
    # on the last edge of the mate's window the normal is not blended into its neighbour's
    rim |= (low[facing] & (place < 1)) | (high[facing] & (place > batch.counts[facing] - 1))
    return np.bincount(batch.at[bears[rim]], minlength=batch.size) > 0


def _positions(batch: Batch, outcome: Outcome, places: Positions) -> Positions:
    """The solved positions, with derivatives by the same equations at a slightly larger twist."""
    here, of = outcome.state, batch.node_position
    rows = projected(batch, here, batch.turn, outcome.points)
    forces = rows.forces(here.pressure[rows.points], len(batch.points))
    one, of_windows = _torques(batch, here, forces, batch.turn)
    work = np.bincount(of, (forces.conj() * here.displacement).real, batch.size)
    ahead = AHEAD * np.divide(work, one["torque_wheel"], out=np.ones(batch.size), where=one["torque_wheel"] > 0)
    turn = batch.turn * np.exp(1j * batch.gear * ahead[batch.position])
    there = turned(batch, outcome, turn, SETTLED)
    tangent = (_torques(batch, there, there.forces, turn)[0]["torque_wheel"] - one["torque_wheel"]) / ahead
    rate = (there.forces - forces) / ahead[of]
    every = np.arange(len(batch.owner))
    x = batch.slaves(batch.placed(here.displacement, batch.turn), every)
    loads = batch.weight * np.maximum(here.pressure, 0.0)
    widths = half_widths(batch.couple[batch.owner], x, loads, len(batch.gear) // 2)
    pinion, wheel = (np.flatnonzero(batch.gear == g) for g in (0, 1))
    contacts = Contacts(batch.position[wheel], -1 - batch.tooth[wheel], of_windows[wheel], widths[batch.couple[wheel]])
    solved = np.isin(np.arange(batch.size), list(outcome.equations)) & (tangent > 0)
    made = replace(
        places,
        iterations=outcome.iterations,
        contacts=contacts,
        loads=(_loads(batch, pinion, forces, rate), _loads(batch, wheel, forces, rate)),
        points=_points(batch, here),
        tangent=tangent,
        energy=0.5 * work,
        **one,
    )
    return made.with_status(np.where(solved, "converged", "not_converged"))


def _loads(batch: Batch, windows: IntArray, forces: ComplexArray, rate: ComplexArray) -> FlankLoads:
    """Loads on the nodes of one gear's windows, by those of whole flanks."""
    gear = batch.gear[windows[0]] if len(windows) else 0
    shape = len(windows), len(batch.elastic.bodies[gear].flank.nodes)
    row = np.full(len(batch.gear), -1)
    row[windows] = np.arange(len(windows))
    nodes = np.flatnonzero(row[batch.window] >= 0)
    window = batch.window[nodes]
    at = row[window], 2 * batch.first_edge[window] + nodes - batch.first_node[window]
    made = []
    for values in (forces, rate):
        whole = np.zeros(shape, dtype=complex)
        whole[at] = values[nodes]
        made.append(whole.view(float))
    return FlankLoads(batch.position[windows], batch.tooth[windows], *made)


def _points(batch: Batch, state: State) -> PointPressures:
    """Pressures on every loaded flank, by its own contact points or by those of its mate."""
    mates = np.flatnonzero(~np.isin(batch.facing, batch.owner))
    own = batch.slave_shapes @ [0.0, 0.5, 1.0] + (batch.slave_nodes[:, 0] - batch.first_node[batch.owner]) // 2
    window = np.concatenate([batch.owner, batch.facing[mates]])
    place = np.concatenate([own, state.place[mates]]) + batch.first_edge[window]
    pressure = np.maximum(state.pressure, 0.0)
    order = np.lexsort((place, window))
    window = window[order]
    number = np.where(batch.gear == 0, batch.tooth, -1 - batch.tooth)[window]
    pressure = np.concatenate([pressure, pressure[mates]])[order]
    return PointPressures(batch.position[window], batch.gear[window], number, place[order], pressure)


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
    total = np.bincount(pair, load, count)
    total = np.where(total > 0, total, np.nan)

    def mean(values: Array) -> Array:
        return np.bincount(pair, load * values, count) / total

    off = place - (mean(place.real) + 1j * mean(place.imag))[pair]
    square = off * off  # its mean's size is the difference of the principal variances, the mean of |off|^2 their sum
    return np.sqrt(2 * (mean(np.abs(square)) + np.abs(mean(square.real) + 1j * mean(square.imag))))


def _torques(batch: Batch, state: State, forces: ComplexArray, turn: ComplexArray) -> tuple[dict[str, Array], Array]:
    """Moments that the hubs need (N m): shape (B,), and of each window about its own hub, shape (W,)."""
    hub = (batch.gear * batch.elastic.centre_distance)[batch.window]
    force, wheel = turn[batch.window] * forces, batch.gear[batch.window] == 1
    placed, still = (batch.placed(u, turn) - hub for u in (state.displacement, np.zeros_like(forces)))
    moment, reaction = (-(arm.conj() * force).imag for arm in (placed, still))

    def total(values: Array, chosen: BoolArray) -> Array:
        return np.bincount(batch.node_position, np.where(chosen, values, 0.0), batch.size)

    torques = {
        "torque_wheel": total(moment, wheel),
        "torque_pinion": total(moment, ~wheel),
        "torque_wheel_reaction": total(reaction, wheel),
    }
    return torques, np.bincount(batch.window, moment, len(batch.gear))
