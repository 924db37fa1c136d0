"""Torques, tangents and scenes of positions that were solved side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Projection
from .group import Group, ranges
from .group_newton import Motion, Outcomes, equilibrium
from .group_rows import Rows, rows_of
from .half_width import half_widths
from .scene import MeshingPair, Scene

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Results:
    """Of each position of a group; numbers mean nothing where it did not converge.

    Attributes
    ----------
    torque_wheel, torque_pinion, torque_wheel_reaction, tangent, peak_pressure : ndarray, shape (B,)
        See `gearfe.contact.solver.Position`.
    window_torque : ndarray, shape (W,)
        About the wheel's centre, of the wheel's windows (N m).
    half_width : ndarray, shape (W/2,)
        Of the contact of each couple of windows (m).
    forces, force_rate : ndarray, shape (2n,)
        N and N/rad, tooth axes.
    """

    torque_wheel: Array
    torque_pinion: Array
    torque_wheel_reaction: Array
    tangent: Array
    peak_pressure: Array
    window_torque: Array
    half_width: Array
    forces: Array
    force_rate: Array


def results_of(pair: MeshingPair, group: Group, outcomes: Outcomes) -> Results:
    """Evaluate the converged positions."""
    motion, good = outcomes.motion, outcomes.converged
    placed = group.placed(motion.displacement)
    rows = rows_of(group, motion.found, motion.pressure, np.flatnonzero((motion.pressure > 0) & good[group.at]), placed)
    forces = rows.forces(motion.pressure[rows.points], len(motion.forces))
    centre = pair.centre(1)
    window = group.node_window
    of_wheel = group.gear[window] == 1
    x, y = forces[::2], forces[1::2]
    force = np.stack([group.cosine * x - group.sine * y, group.sine * x + group.cosine * y], axis=1)
    windows = len(group.counts)
    about = np.bincount(window, weights=-_moment(placed - centre, force), minlength=windows)
    rigid = np.bincount(window, weights=-_moment(group.points - centre, force), minlength=windows)
    pinion = np.bincount(window, weights=-_moment(placed, force), minlength=windows)
    loads = motion.pressure[rows.points]
    grown = rows.forces(loads * group.growth[rows.points], len(forces))
    rate = _force_rates(group, rows, forces, grown, placed - centre, good)
    peak = np.zeros(group.size)
    np.maximum.at(peak, group.at, motion.pressure)
    wheel = group.gear == 1

    def of_positions(values: Array, chosen: NDArray[np.bool_]) -> Array:
        return np.bincount(group.position, weights=np.where(chosen, values, 0.0), minlength=group.size)

    moment = np.where(of_wheel, rate[1], 0.0)
    return Results(
        torque_wheel=of_positions(about, wheel),
        torque_pinion=of_positions(pinion, ~wheel),
        torque_wheel_reaction=of_positions(rigid, wheel),
        tangent=-np.bincount(group.position[window], weights=moment, minlength=group.size),
        peak_pressure=peak,
        window_torque=about,
        half_width=half_widths(
            group.couple[group.owner],
            np.einsum("qa,qai->qi", group.slave_shapes, placed[group.slave_nodes]),
            group.weight * np.maximum(motion.pressure, 0.0),
            windows // 2,
        ),
        forces=forces,
        force_rate=rate[0],
    )


def _moment(arm: Array, force: Array) -> Array:
    return arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]


def _force_rates(
    group: Group, rows: Rows, forces: Array, grown: Array, arm: Array, good: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """d forces / d twist (N/rad), and of each node the rate of its moment about the wheel's centre (N m/rad).

    In the axes of the wheel's teeth the wheel's nodes are carried by e_z x (x - c) dphi, and
    df = G^T (W dp + dW p) + H dx - dphi e_z x f,  dx = carried + C df,  dp = -gamma dg - S df,
    where the areas W grow only with the shares of corners: `grown` is G^T dW p/dphi.
    """
    wheel = (group.gear[group.node_window] == 1)[:, None]
    local = np.stack(
        [group.cosine * arm[:, 0] + group.sine * arm[:, 1], -group.sine * arm[:, 0] + group.cosine * arm[:, 1]], axis=1
    )
    force = forces.reshape(-1, 2)
    carried = np.where(wheel, _quarter_turn(local), 0.0).ravel()
    frame = np.where(wheel, _quarter_turn(force), 0.0).ravel()
    opened = np.einsum("ij,ij->j", rows.opening, carried[rows.unknowns])
    rate = equilibrium(group, rows, -group.parameter[rows.points] * opened, -carried, None, grown - frame)[1]
    moved = group.respond(rate, np.flatnonzero(good).tolist())[0].reshape(-1, 2)  # C df = dx - carried
    return rate, _moment(local, rate.reshape(-1, 2)) + _moment(moved, force)


def _quarter_turn(vectors: Array) -> Array:
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


def outgrown(group: Group, motion: Motion, rigid: Projection) -> NDArray[np.bool_]:
    """Whether a contact comes to the rim of a window that could be larger, shape (B,); or would, were it longer: where
    a pair of windows bears nothing, and the undeformed gears overlap most at the rim of one."""
    found, loaded = motion.found, motion.pressure > 0
    bad = np.zeros(group.size, dtype=bool)
    edge = (group.slave_nodes[:, 0] - group.first_node[group.owner]) // 2
    starts, ends = group.extendable[:, 0], group.extendable[:, 1]
    own, facing = group.owner, group.facing
    at_rim = (starts[own] & (edge == 0)) | (ends[own] & (edge == group.counts[own] - 1))
    bad[group.at[loaded & at_rim]] = True
    # on the last edge of the mate's window the normal is not blended into its neighbour's
    behind, ahead = found.beyond & (found.place <= 0), found.beyond & (found.place > 0)
    bad[group.at[starts[facing] & (behind | (loaded & (found.place < 1)))]] = True
    bad[group.at[ends[facing] & (ahead | (loaded & (found.place > group.counts[facing] - 1)))]] = True
    first = group.first_point[:-1][np.diff(group.first_point) > 0]
    deepest = np.lexsort((rigid.gap, own))[first]
    bears = np.bincount(group.couple[own[loaded]], minlength=len(group.gear)) > 0
    missed = ~bears[group.couple[own[deepest]]] & (rigid.gap[deepest] < 0) & at_rim[deepest]
    bad[group.at[deepest[missed]]] = True
    return bad


def scenes_of(
    pair: MeshingPair, group: Group, rigid: Projection, vectors: Sequence[Array], pressure: Array
) -> list[tuple[Any, ...]]:
    """Each position as a scene (without its matrices), its pressures, and its stretches of the nodal `vectors`."""
    windows = np.arange(int(group.first_window[-1]))
    first = group.first_window[group.position]
    half = np.diff(group.first_window)[group.position] // 2
    order = first + (windows - first) // 2 + ((windows - first) % 2) * half  # window of the group at each place
    place = np.empty_like(windows)
    place[order] = windows - first
    nodes = ranges(group.first_node[order], np.diff(group.first_node)[order])
    points = ranges(group.first_point[order], np.diff(group.first_point)[order])
    first_node = group.first_node[group.first_window]
    number = np.empty(len(nodes), dtype=np.int64)
    number[nodes] = np.arange(len(nodes)) - np.repeat(first_node[:-1], np.diff(first_node))
    unknowns = (2 * nodes[:, None] + np.arange(2)).ravel()
    of_node = {
        "points": group.points[nodes],
        "rotation": group.rotation[nodes],
        "of_wheel": (group.gear[group.node_window] == 1)[nodes],
    }
    owner = place[group.owner]
    of_point: dict[str, Any] = {
        "slave_nodes": number[group.slave_nodes[points]],
        "slave_shapes": group.slave_shapes[points],
        "mate": place[group.facing][points],
        "weight": group.weight[points],
        "growth": group.growth[points],
        "fade": group.fade[points],
        "parameter": group.parameter[points],
        "owner": owner[points],
        "pair": owner[points] // 2,
    }
    seen = replace(rigid.take(points), edge=number[rigid.edge[points]])
    ordered = [vector[unknowns] for vector in vectors]
    counts, empty = group.counts[order], np.zeros((0, 0))
    first_point = group.first_point[group.first_window]
    made = []
    for b in range(group.size):
        at = slice(*first_node[b : b + 2].tolist())
        own = slice(*first_point[b : b + 2].tolist())
        scene = Scene(
            windows=group.windows[b],
            counts=counts[slice(*group.first_window[b : b + 2].tolist())],
            wheel_centre=pair.centre(1),
            compliance=empty,
            stress=empty,
            rigid=seen.take(own),
            **{name: values[at] for name, values in of_node.items()},
            **{name: values[own] for name, values in of_point.items()},
        )
        made.append((scene, pressure[points[own]], *(vector[2 * at.start : 2 * at.stop] for vector in ordered)))
    return made
