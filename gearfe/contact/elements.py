"""Nitsche's and the penalty law by finite elements: positions of a gear pair from first contacts.

The first contacts are those of the half-plane law (`first_contacts`): where each tooth pair touches, how wide and under
which pressure. They place the windows in which the mesh's own contact is solved, and Newton's method starts there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..typing import Array, ComplexArray, IntArray
from .compliance import MeshingPair
from .element_newton import Equations, State, seen, solve, turned
from .element_windows import FirstContacts, Windows, windows_of
from .flank import edge_shapes
from .flank_compliance import FlankCompliance
from .half_plane_result import PairContacts
from .position import Contacts, FlankLoads, PointPressures, Positions, no_contact, of_positions, together

#: Relative error of pressures and forces at which a position counts as converged.
TOLERANCE = 1e-9
#: Windows reach beyond the first pressure by this share of its length and so many edges; again where the contact came
#: to a window's rim.
REACHES = ((0.2, 2), (1.0, 6))
#: What the twist is ahead for derivatives, as a share of the gears' deformation; relative accuracy of the differences.
AHEAD, SETTLED = 1e-4, 1e-5


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
    touching = np.unique(first.position)
    solved = [
        _solved(elastic, of_positions(first, touching[[i]]), made.take(touching[[i]])) for i in range(len(touching))
    ]
    return made.replaced(touching, together(solved)) if solved else made


def _solved(elastic: MeshingPair, first: FirstContacts, place: Positions) -> Positions:
    """One position with contacts; what has outgrown its windows twice is not solved."""
    for reach in REACHES:
        windows = windows_of(elastic, first, float(place.pinion_angle[0]), float(place.twist[0]), reach)
        outcome = solve(windows, _start(windows, first), TOLERANCE)
        if not _at_rim(windows, outcome.state):
            break
    else:
        outcome = replace(outcome, equations=None)
    place = replace(place, iterations=np.array([outcome.iterations]))
    if outcome.equations is None:
        return place.stated(np.array(["not_converged"]))
    return _position(windows, outcome.state, outcome.equations, place)


def _start(windows: Windows, first: FirstContacts) -> State:
    """Pressures at the contact points and forces on the nodes from those at the samples of the first contacts."""
    pressure, place, own = np.zeros(len(windows.owner)), np.zeros(len(windows.owner)), windows.place
    forces = np.zeros(len(windows.points), dtype=complex)
    flanks = [body.flank for body in windows.elastic.bodies]
    bounds = np.searchsorted(windows.owner, np.arange(len(windows.gear) + 1))
    for w, g in enumerate(windows.gear.tolist()):
        m = w % len(first.pair)
        arc, mate, load = first.arc[m, g], first.arc[m, 1 - g], first.pressure[m] * first.width[m]
        edge, xi = flanks[g].place(arc)
        on, shapes = np.flatnonzero(load > 0), edge_shapes(xi)[0]
        nodes = windows.first_node[w] + 2 * (edge[on, None] - windows.first_edge[w]) + np.arange(3)
        along = windows.elastic.width * (2 * g - 1) * first.normal[m] * windows.turn[w].conj()
        np.add.at(forces, nodes, shapes[on] * (along * load[on])[:, None])
        mine = slice(bounds[w], bounds[w + 1])
        if mine.start == mine.stop:
            continue
        ends, facing, other = flanks[g].ends, flanks[1 - g].ends, windows.mate[w]
        s = np.interp(own[mine] + windows.first_edge[w], np.arange(len(ends)), ends)
        order = np.argsort(arc)
        pressure[mine] = np.interp(s, arc[order], first.pressure[m][order], left=0.0, right=0.0)
        inside = np.clip(s, arc[order[0]], arc[order[-1]])
        way = np.sign(mate[order[-1]] - mate[order[0]])
        there = np.interp(inside, arc[order], mate[order]) + way * (s - inside)
        chain = np.interp(there, facing, np.arange(len(facing))) - windows.first_edge[other]
        place[mine] = np.clip(chain, 0.0, windows.counts[other])
    displacement, stress = windows.respond(forces)
    return State(pressure, stress, place, forces, displacement)


def _at_rim(windows: Windows, state: State) -> bool:
    """Whether a contact has come to the rim of a window that could be longer."""
    edges = np.array([body.flank.edges for body in windows.elastic.bodies])[windows.gear]
    low, high = windows.first_edge > 0, windows.first_edge + windows.counts < edges
    bears = np.flatnonzero(state.pressure > 0)
    own, facing, place = windows.owner[bears], windows.facing[bears], state.place[bears]
    edge = (windows.slave_nodes[bears, 0] - windows.first_node[own]) // 2
    rim = (low[own] & (edge == 0)) | (high[own] & (edge == windows.counts[own] - 1))
    # on the last edge of the mate's window the normal is not blended into its neighbour's
    rim |= (low[facing] & (place < 1)) | (high[facing] & (place > windows.counts[facing] - 1))
    return bool(rim.any())


def _position(windows: Windows, here: State, equations: Equations, place: Positions) -> Positions:
    """The solved position, with derivatives by the same equations at a slightly larger twist."""
    points = equations.points
    forces = seen(windows, here, windows.turn, points).forces(here.pressure[points], len(windows.points))
    one, of_windows = _torques(windows, here, forces, windows.turn)
    work = (forces.conj() * here.displacement).real.sum()
    torque = one["torque_wheel"]
    ahead = AHEAD * work / torque if torque > 0 else AHEAD
    turn = windows.turn * np.exp(1j * windows.gear * ahead)
    there = turned(windows, here, equations, turn, SETTLED)
    tangent = (_torques(windows, there, there.forces, turn)[0]["torque_wheel"] - torque) / ahead
    rate, pairs = (there.forces - forces) / ahead, len(windows.gear) // 2
    x = windows.slaves(windows.placed(here.displacement, windows.turn), np.arange(len(windows.owner)))
    loads = windows.weight * np.maximum(here.pressure, 0.0)
    widths, none = half_widths(windows.owner % pairs, x, loads, pairs), np.zeros(pairs, dtype=np.int64)
    made = replace(
        place,
        contacts=Contacts(none, windows.tooth[:pairs], of_windows[pairs:], widths),
        loads=tuple(_loads(windows, gear, forces, rate) for gear in (0, 1)),
        points=_points(windows, here),
        energy=np.array([0.5 * work]),
        tangent=np.array([tangent]),
        **{name: np.array([value]) for name, value in one.items()},
    )
    return made.stated(np.array(["converged" if tangent > 0 else "not_converged"]))


def _loads(windows: Windows, gear: int, forces: ComplexArray, rate: ComplexArray) -> FlankLoads:
    """Loads on the nodes of one gear's windows, by those of whole flanks."""
    own = np.flatnonzero(windows.gear == gear)
    nodes = slice(windows.first_node[own[0]], windows.first_node[own[-1] + 1])
    window = windows.window[nodes]
    at = (
        window - own[0],
        2 * windows.first_edge[window] + np.arange(nodes.start, nodes.stop) - windows.first_node[window],
    )
    made = []
    for values in (forces, rate):
        whole = np.zeros((len(own), len(windows.elastic.bodies[gear].flank.nodes)), dtype=complex)
        whole[at] = values[nodes]
        made.append(whole.view(float))
    return FlankLoads(np.zeros(len(own), dtype=np.int64), windows.tooth[own], *made)


def _points(windows: Windows, state: State) -> PointPressures:
    """Pressures on every loaded flank, by its own contact points or by those of its mate."""
    mates = np.flatnonzero(~np.isin(windows.facing, windows.owner))
    window = np.concatenate([windows.owner, windows.facing[mates]])
    place = np.concatenate([windows.place, state.place[mates]]) + windows.first_edge[window]
    pressure = np.maximum(np.concatenate([state.pressure, state.pressure[mates]]), 0.0)
    order = np.lexsort((place, window))
    window, gear = window[order], windows.gear[window[order]]
    number = np.where(gear == 0, windows.tooth[window], -1 - windows.tooth[window])
    return PointPressures(np.zeros_like(window), gear, number, place[order], pressure[order])


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


def _torques(
    windows: Windows, state: State, forces: ComplexArray, turn: ComplexArray
) -> tuple[dict[str, float], Array]:
    """Moments that the hubs need, and of each window about its own hub, shape (W,) (N m)."""
    hub = (windows.gear * windows.elastic.centre_distance)[windows.window]
    force, wheel = turn[windows.window] * forces, windows.gear[windows.window] == 1
    placed, still = (windows.placed(u, turn) - hub for u in (state.displacement, np.zeros_like(forces)))
    moment, reaction = (-(arm.conj() * force).imag for arm in (placed, still))
    torques = {
        "torque_wheel": float(moment[wheel].sum()),
        "torque_pinion": float(moment[~wheel].sum()),
        "torque_wheel_reaction": float(reaction[wheel].sum()),
    }
    return torques, np.bincount(windows.window, moment, len(windows.gear))
