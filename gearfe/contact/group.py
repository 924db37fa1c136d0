"""Many positions of a gear pair laid side by side in flat arrays, so that one array operation serves them all.

Order. Positions follow one another; within a position first all windows of the pinion, then all of the wheel. The
unknowns and the contact points of one gear in one position are then one stretch, a *block*, and its elastic response
is one matrix,

    (displacements, normal stresses) = operator @ forces.

Nothing is padded: what differs in size from position to position (the blocks' matrices) is handled block by block,
and a position's numbers do not depend on its company.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Chains, Projection, chains_of, project
from .corners import growths, shares
from .law_data import slave_windows
from .scene import MeshingPair, Window

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Block:
    """One gear in one position.

    Attributes
    ----------
    matrix : ndarray, shape (m + q, m)
        Displacements of its m unknowns (m/N), then normal stresses at its q contact points (Pa/N; none for laws without
        stress), for forces on the unknowns.
    forces, response : ndarray, shape (m,), (m + q,)
        Views of the group's scratch arrays.
    """

    matrix: Array
    forces: Array
    response: Array


@dataclass(frozen=True)
class Group:
    """B positions side by side: W windows, n nodes, q contact points.

    Attributes
    ----------
    windows : tuple of tuple of Window
        Of each position, in couples (pinion's, wheel's), as in a `Scene`.
    order : list of list of int
        Of each position the places in `windows` of its windows in this group's order.
    first_window : ndarray, shape (B + 1,)
    counts, gear, position, couple, mate : ndarray, shape (W,)
        Edges of each window, its gear, position, couple (numbered through the group) and the window that it faces.
    first_node, first_point : ndarray, shape (W + 1,)
    points : ndarray, shape (n, 2)
        Undeformed nodes (m).
    cosine, sine : ndarray, shape (n,)
        Of the angle of the tooth that each node belongs to.
    owner : ndarray, shape (q,)
        Window of each contact point; `at`, its position; `facing`, the window it is projected onto.
    slave_nodes, slave_shapes, weight, growth, fade, parameter
        See `Scene`.
    blocks : list of Block
        Two of each position.
    moved, stressed : ndarray
        Where displacements and stresses stand in the blocks' responses.
    extendable : ndarray of bool, shape (W, 2)
        Whether a longer window exists, at its start and at its end.
    """

    windows: tuple[tuple[Window, ...], ...]
    order: list[list[int]]
    first_window: IntArray
    counts: IntArray
    gear: IntArray
    position: IntArray
    couple: IntArray
    mate: IntArray
    first_node: IntArray
    first_point: IntArray
    points: Array
    cosine: Array
    sine: Array
    node_window: IntArray
    owner: IntArray
    at: IntArray
    facing: IntArray
    slave_nodes: IntArray
    slave_shapes: Array
    weight: Array
    growth: Array
    fade: Array
    parameter: Array
    blocks: list[Block]
    moved: IntArray
    stressed: IntArray | None
    scratch: tuple[Array, Array]
    extendable: NDArray[np.bool_]
    rotation: Array

    @cached_property
    def block_window(self) -> IntArray:
        """First window of each block, shape (2B,)."""
        half = self.first_window[:-1] + np.diff(self.first_window) // 2
        return np.stack([self.first_window[:-1], half], axis=1).ravel()

    @property
    def size(self) -> int:
        """Number of positions."""
        return len(self.windows)

    def respond(self, forces: Array, chosen: Sequence[int] | IntArray) -> tuple[Array, Array]:
        """Displacements (m), shape (2n,), and stresses (Pa), shape (q,), for forces (N), shape (2n,).

        Only the positions `chosen` are computed; the others' numbers mean nothing.
        """
        loads, response = self.scratch
        loads[:] = forces
        for b in chosen:
            for block in (self.blocks[2 * b], self.blocks[2 * b + 1]):
                np.dot(block.matrix, block.forces, out=block.response)
        stress = np.zeros(len(self.weight)) if self.stressed is None else response[self.stressed]
        return response[self.moved], stress

    def placed(self, displacement: Array) -> Array:
        """Nodes in their places when displaced by `displacement`, shape (2n,) in tooth axes: shape (n, 2) (m)."""
        u, v = displacement[::2], displacement[1::2]
        nodes = self.points.copy()
        nodes[:, 0] += self.cosine * u - self.sine * v
        nodes[:, 1] += self.sine * u + self.cosine * v
        return nodes

    def areas(self, place: Array, chosen: IntArray | slice = slice(None)) -> Array:
        """Areas of contact points as far as they lie before the end of the mate's surface, see `Scene.areas`."""
        past = self.counts[self.facing[chosen]] - place
        return self.weight[chosen] * np.clip(0.5 + past / (2 * self.fade[chosen]), 0.0, 1.0)

    def slaves(self, nodes: Array, chosen: IntArray | slice = slice(None)) -> Array:
        """Places of contact points for given node places (m)."""
        corners, shapes = nodes[self.slave_nodes[chosen]], self.slave_shapes[chosen]
        return (shapes[:, :1] * corners[:, 0] + shapes[:, 1:2] * corners[:, 1]) + shapes[:, 2:] * corners[:, 2]

    def project(self, nodes: Array, places: Array, chosen: IntArray) -> Projection:
        """Closest points of the contact points `chosen` on their mates, from starting places."""
        chains = chains_of(nodes, self.counts, self.facing[chosen], self.fade[chosen])
        return project(self.slaves(nodes, chosen), chains, places)


def ranges(starts: IntArray, lengths: IntArray) -> IntArray:
    """All of start, start + 1, ..., start + length - 1, one after the other."""
    ends = np.cumsum(lengths)
    return np.repeat(starts - ends + lengths, lengths) + np.arange(ends[-1] if len(ends) else 0)


def gather(pair: MeshingPair, positions: Sequence[Sequence[Window]]) -> Group:
    """Lay the positions with these windows side by side."""
    order = [[*range(0, len(w), 2), *range(1, len(w), 2)] for w in positions]
    flat = [windows[i] for windows, places in zip(positions, order, strict=True) for i in places]
    lengths = np.array([len(w) for w in positions])
    first_window = np.concatenate([[0], np.cumsum(lengths)])
    position = np.repeat(np.arange(len(positions)), lengths)
    half = np.repeat(lengths // 2, lengths)
    index = np.arange(len(flat))
    gear = np.array([w.gear for w in flat])
    mate = np.where(gear == 0, index + half, index - half)
    couple = np.where(gear == 0, index, mate) - first_window[position]
    couple += (first_window // 2)[position]
    first_edge, counts = np.array([w.first_edge for w in flat]), np.array([w.edges for w in flat])
    flanks = [body.flank for body in pair.bodies]
    made = _geometry(pair, flat, gear, first_edge, counts)
    share, growth = np.ones(len(flat)), np.zeros(len(flat))
    if pair.law.sides == "both":
        angles = [(flat[min(i, m)].angle, flat[max(i, m)].angle) for i, m in zip(index, mate, strict=True)]
        share = np.array([shares(pair.corners, a)[g] for a, g in zip(angles, gear, strict=True)])
        growth = np.array([growths(pair.corners, a)[g] for a, g in zip(angles, gear, strict=True)])
    carries = np.zeros(len(flat), dtype=bool)
    for windows, places, first in zip(positions, order, first_window[:-1], strict=True):
        carries[first : first + len(places)] = np.isin(places, slave_windows(pair, windows))
    made |= _contact_points(pair, gear, position, first_edge, counts, mate, made["first_node"], share, carries)
    made["growth"] = growth[made["owner"]]
    first_node, _first_point = made["first_node"], made["first_point"]
    operators = [_operator(pair, gear, windows[gear::2]) for windows in positions for gear in (0, 1)]
    edges_of = np.array([flank.edges for flank in flanks])[gear]
    extendable = np.stack([first_edge > 0, first_edge + counts < edges_of], axis=1)
    # stretches of nodes, points and responses of each block
    starts = np.stack([first_window[:-1], first_window[:-1] + lengths // 2], axis=1).ravel()
    unknowns = 2 * np.diff(np.append(first_node[starts], first_node[-1]))
    rows = np.array([len(m) for m in operators])
    offset = np.concatenate([[0], np.cumsum(rows)])
    loads, response = np.zeros(unknowns.sum()), np.zeros(offset[-1])
    at = np.concatenate([[0], np.cumsum(unknowns)])
    blocks = [Block(m, loads[at[i] : at[i + 1]], response[offset[i] : offset[i + 1]]) for i, m in enumerate(operators)]
    moved = ranges(offset[:-1], unknowns)
    stressed = ranges(offset[:-1] + unknowns, rows - unknowns) if pair.law.uses_stress else None
    return Group(
        windows=tuple(tuple(w) for w in positions),
        order=order,
        first_window=first_window,
        counts=counts,
        gear=gear,
        position=position,
        couple=couple,
        mate=mate,
        blocks=blocks,
        moved=moved,
        stressed=stressed,
        scratch=(loads, response),
        extendable=extendable,
        **made,
    )


def _geometry(
    pair: MeshingPair, flat: list[Window], gear: IntArray, first_edge: IntArray, counts: IntArray
) -> dict[str, Any]:
    """Nodes in their places."""
    flanks = [body.flank for body in pair.bodies]
    nodes = 2 * counts + 1
    offset = np.array([0, len(flanks[0].points)])
    local = np.concatenate([f.points for f in flanks])[ranges(offset[gear] + 2 * first_edge, nodes)]
    angle = np.array([w.angle for w in flat])
    cosine, sine = np.repeat(np.cos(angle), nodes), np.repeat(np.sin(angle), nodes)
    points = np.empty_like(local)
    points[:, 0] = cosine * local[:, 0] - sine * local[:, 1] + np.repeat(gear * pair.centre_distance, nodes)
    points[:, 1] = sine * local[:, 0] + cosine * local[:, 1]
    rotation = np.stack([cosine, -sine, sine, cosine], axis=1).reshape(-1, 2, 2)
    return {
        "first_node": np.concatenate([[0], np.cumsum(nodes)]),
        "points": points,
        "cosine": cosine,
        "sine": sine,
        "rotation": rotation,
        "node_window": np.repeat(np.arange(len(flat)), nodes),
    }


def _contact_points(
    pair: MeshingPair,
    gear: IntArray,
    position: IntArray,
    first_edge: IntArray,
    counts: IntArray,
    mate: IntArray,
    first_node: IntArray,
    share: Array,
    carries: NDArray[np.bool_],
) -> dict[str, Any]:
    law, flanks = pair.law, [body.flank for body in pair.bodies]
    quadrature = np.array([flank.shapes.shape[0] for flank in flanks])
    per_window = np.where(carries, quadrature[gear] * counts, 0)
    owner = np.repeat(np.arange(len(gear)), per_window)
    within = ranges(np.zeros(len(gear), dtype=np.int64), per_window)
    edge = within // quadrature[gear[owner]]
    # lengths and parameters of all points of both flanks, one after the other
    start = np.array([0, flanks[0].weights.size])
    number = start[gear[owner]] + quadrature[gear[owner]] * first_edge[owner] + within
    lengths = np.concatenate([f.weights.ravel() for f in flanks])[number]
    gammas = [
        np.repeat(law.parameter(body.surface_modulus, f.sizes), n)
        for body, f, n in zip(pair.bodies, flanks, quadrature, strict=True)
    ]
    sizes, last = np.concatenate([f.sizes for f in flanks]), first_edge + counts - 1
    last_size = sizes[np.array([0, flanks[0].edges])[gear] + last]
    shapes = np.concatenate([f.shapes for f in flanks])
    facing = mate[owner]
    return {
        "first_point": np.concatenate([[0], np.cumsum(per_window)]),
        "owner": owner,
        "at": position[owner],
        "facing": facing,
        "slave_nodes": (first_node[owner] + 2 * edge)[:, None] + np.arange(3),
        "slave_shapes": shapes[np.array([0, quadrature[0]])[gear[owner]] + within % quadrature[gear[owner]]],
        "weight": pair.width * share[owner] * lengths,
        "fade": 0.5 * lengths / last_size[facing],
        "parameter": np.concatenate(gammas)[number],
    }


def _operator(pair: MeshingPair, gear: int, windows: Sequence[Window]) -> Array:
    """Displacements and stresses of one gear's windows for forces on them, see `Block`."""
    body, law = pair.bodies[gear], pair.law
    sizes = [2 * (2 * w.edges + 1) for w in windows]
    unknowns = [slice(a, a + n) for a, n in zip(np.cumsum([0, *sizes]).tolist(), sizes, strict=False)]
    count, stressed, stress = sum(sizes), [], law.uses_stress and law.sides in ("both", ("pinion", "wheel")[gear])
    q, row = body.flank.shapes.shape[0], count
    if stress:
        for w in windows:
            stressed.append(slice(row, row + q * w.edges))
            row += q * w.edges
    matrix = np.empty((row, count))
    for j, loaded in enumerate(windows):
        columns = loaded.flank_unknowns
        for i, moved in enumerate(windows):
            driven = body.far.driven[moved.tooth - loaded.tooth][:, columns]
            part = matrix[unknowns[i], unknowns[j]]
            np.matmul(body.far.flank[moved.flank_unknowns], driven, out=part)
            if i == j:
                part += body.own[moved.flank_unknowns, columns]
            if stress:
                assert body.far.stress is not None
                assert body.stress_own is not None
                rows = slice(q * moved.first_edge, q * (moved.first_edge + moved.edges))
                part = matrix[stressed[i], unknowns[j]]
                np.matmul(body.far.stress[rows], driven, out=part)
                if i == j:
                    part += body.stress_own[rows, columns]
    return matrix


def rigid_projection(pair: MeshingPair, group: Group, deepest: IntArray) -> Projection:
    """Closest points of all contact points of the undeformed gears.

    Parameters
    ----------
    deepest : ndarray, shape (W,)
        Edge of each window's flank where it overlaps most: from there, the search starts as far along the mate's flank
        as a point lies along its own.
    """
    start = np.empty(len(group.owner))
    arcs = [np.concatenate([[0.0], np.cumsum(body.flank.sizes)]) for body in pair.bodies]
    first_edge = np.array([w.first_edge for windows, order in zip(group.windows, group.order, strict=True)
                           for w in (windows[i] for i in order)])  # fmt: skip
    gear, facing = group.gear[group.owner], group.facing
    edge = (group.slave_nodes[:, 0] - group.first_node[group.owner]) // 2 + first_edge[group.owner]
    share = group.slave_shapes[:, 2] + 0.5 * group.slave_shapes[:, 1]  # position within the edge
    for g in (0, 1):
        own, other = arcs[g], arcs[1 - g]
        mine = np.flatnonzero(gear == g)
        e, mate = edge[mine], facing[mine]
        ahead = own[e] + share[mine] * (own[e + 1] - own[e]) - own[deepest[group.owner[mine]]]
        start[mine] = np.interp(other[deepest[mate]] - ahead, other, np.arange(len(other))) - first_edge[mate]
    start = np.minimum(np.maximum(start, 0.0), group.counts[facing].astype(float))
    chains: Chains = chains_of(group.points, group.counts, facing, group.fade)
    return project(group.slaves(group.points), chains, start)
