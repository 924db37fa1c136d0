"""Nitsche's and the penalty law by finite elements: positions of a gear pair from first loads on its flanks.

The first loads are those of the half-plane law. They say which tooth pairs bear and where: windows about them are the
pieces of mesh in which the contact is solved, and Newton's method starts there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .compliance import MeshingPair
from .element_batch import Batch, batch_of
from .element_newton import Equations, State, first_state, solve
from .position import Contacts, FlankLoads, PointPressures, Positions, no_contact, of_positions

#: What the twist is ahead for derivatives, as a share of the gears' deformation.
AHEAD = 1e-4
#: Windows reach beyond the nodes that are loaded at first by this share of their edges, and by so many edges; then,
#: where a position has not converged in them, further: contacts of soft penalties are wide.
REACHES = ((0.2, 2), (1.0, 6))
#: Positions that are solved side by side.
SIDE_BY_SIDE = 16


def solve_elements(elastic: MeshingPair, angles: Array, twists: Array, loads: tuple[FlankLoads, ...]) -> Positions:
    """Solve the contact of several positions on the mesh.

    Parameters
    ----------
    angles, twists : ndarray, shape (n,)
        Pinion angles and twists (rad).
    loads
        On the flanks of pinion and wheel, to start from: row by row they face each other. Positions without any have
        ``no_contact``.
    """
    made = no_contact(angles, twists, [len(body.own) for body in elastic.bodies])
    pinion, wheel = (_of_teeth(one) for one in loads)
    open_ = np.unique(pinion.position)
    for reach in REACHES:
        for start in range(0, len(open_), SIDE_BY_SIDE):
            chosen = open_[start : start + SIDE_BY_SIDE]
            first = of_positions(pinion, chosen), of_positions(wheel, chosen)
            batch, forces = batch_of(elastic, first, angles[chosen], twists[chosen], reach)
            made = made.replaced(chosen, _positions(batch, first_state(batch, forces), made.take(chosen)))
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
    here, of = solve(batch, start, batch.turn, equations), batch.node_position
    one, of_windows = _torques(batch, here, batch.turn)
    work = np.bincount(of, (here.forces.conj() * here.displacement).real, batch.size)
    ahead = AHEAD * np.divide(work, one["torque_wheel"], out=np.ones(batch.size), where=one["torque_wheel"] > 0)
    turn = batch.turn * np.exp(1j * batch.gear * ahead[batch.position])
    there = solve(batch, here, turn, equations)
    tangent = (_torques(batch, there, turn)[0]["torque_wheel"] - one["torque_wheel"]) / ahead
    pinion, wheel = (np.flatnonzero(batch.gear == g) for g in (0, 1))
    x = batch.slaves(batch.placed(here.displacement, batch.turn), np.arange(len(batch.owner)))
    load = batch.weight * np.maximum(here.pressure, 0.0)
    widths = half_widths(batch.owner % len(wheel), x, load, len(wheel))
    solved = here.converged & there.converged & (tangent > 0) & ~_at_rims(batch, here)
    made = replace(
        places,
        iterations=here.iterations,
        contacts=Contacts(batch.position[wheel], batch.tooth[pinion], of_windows[wheel], widths),
        loads=tuple(_loads(batch, own, here, there, ahead) for own in (pinion, wheel)),
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


def _points(batch: Batch, state: State) -> PointPressures:
    """Pressures on every loaded flank, by its own contact points or by those of its mate."""
    facing = batch.mate[batch.owner]
    mates = np.flatnonzero(~np.isin(facing, batch.owner))
    window = np.concatenate([batch.owner, facing[mates]])
    place = np.concatenate([batch.slave_place, state.place[mates]]) + batch.first_edge[window]
    pressure = np.maximum(np.concatenate([state.pressure, state.pressure[mates]]), 0.0)
    pair, gear = batch.tooth[window % (len(batch.gear) // 2)], batch.gear[window]
    order = np.argsort(batch.position[window], kind="stable")
    return PointPressures(batch.position[window][order], gear[order], pair[order], place[order], pressure[order])


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


def _torques(batch: Batch, state: State, turn: ComplexArray) -> tuple[dict[str, Array], Array]:
    """Moments that the hubs need (N m): shape (B,), and of each window about its own hub, shape (W,)."""
    hub = (batch.gear * batch.elastic.centre_distance)[batch.window]
    force, wheel = turn[batch.window] * state.forces, batch.gear[batch.window] == 1
    placed, still = (batch.placed(u, turn) - hub for u in (state.displacement, np.zeros_like(force)))
    moment, reaction = (-(arm.conj() * force).imag for arm in (placed, still))

    def total(values: Array, chosen: BoolArray) -> Array:
        return np.bincount(batch.node_position, np.where(chosen, values, 0.0), batch.size)

    torques = {
        "torque_wheel": total(moment, wheel),
        "torque_pinion": total(moment, ~wheel),
        "torque_wheel_reaction": total(reaction, wheel),
    }
    return torques, np.bincount(batch.window, moment, len(batch.gear))
