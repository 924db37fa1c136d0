"""Pieces of flank of many positions side by side in flat arrays, so that one array operation serves them all.

Windows are sorted by position, within it by gear, within that by tooth pair. Nodes and contact points of one gear in
one position are then one stretch, a *block*, and its elastic response is one matrix,

    (displacements, normal stresses) = matrix @ forces.

Vectors are complex numbers x + i y. Displacements and forces are in the axes of the tooth that a node belongs to, in
which the matrices are the same at every position.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .compliance import GearBody, MeshingPair
from .flank import Projection, project
from .laws import carrying, on_elements, uses_stress
from .position import ranges


@dataclass(frozen=True)
class FirstContacts:
    """Where m contacts are taken to be before they are solved, sampled at n places along each.

    Attributes
    ----------
    position, pair : ndarray, shape (m,)
        Number of the position, in rising order, and of the tooth pair: pinion tooth k, wheel tooth -1 - k.
    normal : ndarray of complex, shape (m,)
        Common normal out of the pinion, global axes.
    arc : ndarray, shape (m, 2, n)
        Arc length (m) of the samples on the chains of edges of pinion and wheel: what touches each other.
    pressure, width : ndarray, shape (m, n)
        Pressure at the samples (Pa) and the length that each stands for (m).
    """

    position: IntArray
    pair: IntArray
    normal: ComplexArray
    arc: Array
    pressure: Array
    width: Array


@dataclass(frozen=True)
class Block:
    """One gear in one position: its nodes and contact points in the batch, and its response.

    Attributes
    ----------
    nodes, points : slice
    matrix : ndarray, shape (2 n + q, 2 n)
        Displacements of its n nodes (m/N), then normal stresses at its q contact points (Pa/N; no rows for laws
        without stress), for forces on the nodes.
    """

    nodes: slice
    points: slice
    matrix: Array

    @property
    def unknowns(self) -> slice:
        """Components x, y of its nodes in turn."""
        return slice(2 * self.nodes.start, 2 * self.nodes.stop)


@dataclass(frozen=True)
class Batch:
    """B positions side by side: W windows, n nodes, q contact points.

    Attributes
    ----------
    elastic
        The gears.
    size
        B.
    position, gear, tooth, couple, mate, first_edge, counts : ndarray, shape (W,)
        Of each window: its position, gear and tooth, its contact, the window that it faces, and its edges.
    turn : ndarray of complex, shape (W,)
        Unit number that turns tooth axes to global ones.
    first_node : ndarray, shape (W + 1,)
    window : ndarray, shape (n,)
        Of each node.
    points : ndarray of complex, shape (n,)
        Undeformed nodes, tooth axes (m).
    owner, at, facing : ndarray, shape (q,)
        Of each contact point: its window, its position, and the window that it is projected onto.
    slave_nodes, slave_shapes : ndarray, shape (q, 3)
        Nodes and shape functions of each contact point.
    weight : ndarray, shape (q,)
        Area of each contact point (m2).
    end_weighting : ndarray, shape (q,)
        Half of the point's own stretch of surface, in edges of the mate. Where a stretch lies across the end of the
        mate's surface (a sharp tip), the part that is past it does not count, so that sliding past the corner is
        continuous.
    parameter : ndarray, shape (q,)
        The law's gamma (Pa/m).
    blocks : list of Block
        Pinion and wheel of each position in turn.
    """

    elastic: MeshingPair
    size: int
    position: IntArray
    gear: IntArray
    tooth: IntArray
    couple: IntArray
    mate: IntArray
    first_edge: IntArray
    counts: IntArray
    turn: ComplexArray
    first_node: IntArray
    window: IntArray
    points: ComplexArray
    owner: IntArray
    at: IntArray
    facing: IntArray
    slave_nodes: IntArray
    slave_shapes: Array
    weight: Array
    end_weighting: Array
    parameter: Array
    blocks: list[Block]

    @property
    def node_position(self) -> IntArray:
        """Position of each node, shape (n,)."""
        return self.position[self.window]

    def respond(self, forces: ComplexArray, chosen: Iterable[int]) -> tuple[ComplexArray, Array]:
        """Displacements (m), shape (n,), and stresses at the contact points (Pa), shape (q,), for forces (N).

        Only the positions `chosen` are computed; the others' numbers are 0.
        """
        moved, stress = np.zeros_like(forces), np.zeros(len(self.weight))
        loads, out = forces.view(float), moved.view(float)
        for b in chosen:
            for block in self.blocks[2 * b : 2 * b + 2]:
                both = block.matrix @ loads[block.unknowns]
                count = block.unknowns.stop - block.unknowns.start
                out[block.unknowns] = both[:count]
                if len(both) > count:
                    stress[block.points] = both[count:]
        return moved, stress

    def placed(self, displacement: ComplexArray, turn: ComplexArray) -> ComplexArray:
        """Nodes in their places (m) when displaced (m) and with the windows turned by `turn`, shape (W,)."""
        hub = self.gear * self.elastic.centre_distance
        return np.asarray(turn[self.window] * (self.points + displacement) + hub[self.window])

    def slaves(self, placed: ComplexArray, points: IntArray) -> ComplexArray:
        """Places of contact points (m) for places of the nodes."""
        return np.asarray((self.slave_shapes[points] * placed[self.slave_nodes[points]]).sum(axis=1))

    def project(self, placed: ComplexArray, points: IntArray, start: Array) -> Projection:
        """Closest points of the contact points `points` on their mates, from starting places."""
        mates = self.counts, self.facing[points]
        return project(self.slaves(placed, points), placed, *mates, start, self.end_weighting[points])

    def areas(self, place: Array, points: IntArray) -> Array:
        """Areas of contact points (m2) as far as they lie before the end of the mate's surface."""
        past = self.counts[self.facing[points]] - place
        return self.weight[points] * np.clip(0.5 + past / (2 * self.end_weighting[points]), 0.0, 1.0)


def windows_of(elastic: MeshingPair, first: FirstContacts, share: float, margin: int) -> tuple[IntArray, IntArray]:
    """First edge and number of edges of the window of each contact on either gear, shape (m, 2).

    They reach beyond the pressure by `share` of its length and `margin` edges.
    """
    low, count = np.zeros((2, len(first.pair), 2), dtype=np.int64)
    for g, body in enumerate(elastic.bodies):
        ends, arc = body.flank.ends, first.arc[:, g]
        least = np.where(first.pressure > 0, arc, np.inf).min(axis=1)
        most = np.where(first.pressure > 0, arc, -np.inf).max(axis=1)
        more = share * (most - least)
        low[:, g] = np.maximum(np.searchsorted(ends, least - more, side="right") - 1 - margin, 0)
        count[:, g] = np.minimum(np.searchsorted(ends, most + more) + margin, body.flank.edges) - low[:, g]
    return low, count


def batch_of(
    elastic: MeshingPair, first: FirstContacts, angles: Array, twists: Array, reach: tuple[float, int]
) -> Batch:
    """Lay the positions of these contacts side by side.

    Parameters
    ----------
    angles, twists : ndarray, shape (B,)
        Pinion angles and twists of the positions (rad); every position has a contact.
    reach
        `share` and `margin` of `windows_of`.
    """
    flanks, m = [body.flank for body in elastic.bodies], len(first.pair)
    low, count = windows_of(elastic, first, *reach)
    gear, couple = np.repeat([0, 1], m), np.tile(np.arange(m), 2)
    order = np.lexsort((couple, gear, first.position[couple]))
    gear, couple, mate = gear[order], couple[order], np.argsort(order)[(order + m) % (2 * m)]
    position, first_edge, counts = first.position[couple], low[couple, gear], count[couple, gear]
    tooth = np.where(gear == 0, first.pair[couple], -1 - first.pair[couple])
    turned = [elastic.tooth_angle(g, tooth, angles[position], twists[position]) for g in (0, 1)]
    nodes = 2 * counts + 1
    first_node = np.concatenate([[0], np.cumsum(nodes)])
    local = np.concatenate([f.points for f in flanks])[
        ranges(np.array([0, len(flanks[0].points)])[gear] + 2 * first_edge, nodes)
    ]
    # contact points: of a window's flank one stretch
    bears = carried_by(elastic, first)[couple, gear]
    quadrature = np.array([len(flank.shapes) for flank in flanks])
    per_window = np.where(bears, quadrature[gear] * counts, 0)
    owner = np.repeat(np.arange(2 * m), per_window)
    within, own, facing = ranges(np.zeros_like(per_window), per_window), gear[owner], mate[owner]
    number = np.array([0, flanks[0].weights.size])[own] + quadrature[own] * first_edge[owner] + within
    lengths = np.concatenate([f.weights.ravel() for f in flanks])[number]
    gammas = [
        np.repeat(on_elements(elastic.law).parameter(body.surface_modulus, body.flank.sizes), n)
        for body, n in zip(elastic.bodies, quadrature, strict=True)
    ]
    last = np.concatenate([f.sizes for f in flanks])[np.array([0, flanks[0].edges])[gear] + first_edge + counts - 1]
    shapes = np.concatenate([f.shapes for f in flanks])
    made = Batch(
        elastic=elastic,
        size=len(angles),
        position=position,
        gear=gear,
        tooth=tooth,
        couple=couple,
        mate=mate,
        first_edge=first_edge,
        counts=counts,
        turn=np.exp(1j * np.where(gear == 0, *turned)),
        first_node=first_node,
        window=np.repeat(np.arange(2 * m), nodes),
        points=local @ np.array([1.0, 1.0j]),
        owner=owner,
        at=position[owner],
        facing=facing,
        slave_nodes=(first_node[owner] + 2 * (within // quadrature[own]))[:, None] + np.arange(3),
        slave_shapes=shapes[np.array([0, quadrature[0]])[own] + within % quadrature[own]],
        weight=elastic.width * np.where(bears[owner] & bears[facing], 0.5, 1.0) * lengths,
        end_weighting=0.5 * lengths / last[facing],
        parameter=np.concatenate(gammas)[number],
        blocks=[],
    )
    return replace(made, blocks=_blocks(made, bears))


def carried_by(elastic: MeshingPair, first: FirstContacts) -> BoolArray:
    """Whether pinion and wheel carry contact points of the law at each contact, shape (m, 2)."""
    load = first.pressure * first.width
    mean = (first.arc * load[:, None, :]).sum(axis=2) / load.sum(axis=1)[:, None]
    return carrying(on_elements(elastic.law), np.array([body.flank.ends[-1] for body in elastic.bodies]) - mean)


def _blocks(batch: Batch, bears: BoolArray) -> list[Block]:
    """The response of pinion and wheel in each position."""
    made, bodies, stressed = [], batch.elastic.bodies, bears & uses_stress(batch.elastic.law)
    edges = np.searchsorted(2 * batch.position + batch.gear, np.arange(2 * batch.size + 1)).tolist()
    for start, end in itertools.pairwise(edges):
        points = slice(*np.searchsorted(batch.owner, [start, end]).tolist())
        nodes = slice(int(batch.first_node[start]), int(batch.first_node[end]))
        made.append(Block(nodes, points, _response(batch, bodies[batch.gear[start]], range(start, end), stressed)))
    return made


def _response(batch: Batch, body: GearBody, windows: range, stressed: BoolArray) -> Array:
    """Displacements and stresses of one gear's windows for forces on them, see `Block`."""
    q, tooth = body.flank.shapes.shape[0], batch.tooth.tolist()
    nodes = batch.first_node - batch.first_node[windows[0]]
    row = 2 * int(nodes[windows[-1] + 1])
    moved, of_flank, of_points, rows = {}, {}, {}, {}
    for w in windows:
        first, end = int(batch.first_edge[w]), int(batch.first_edge[w] + batch.counts[w])
        moved[w], of_flank[w] = slice(2 * nodes[w], 2 * nodes[w + 1]), slice(4 * first, 4 * end + 2)
        if stressed[w]:
            of_points[w], rows[w] = slice(q * first, q * end), slice(row, row + q * (end - first))
            row = rows[w].stop
    matrix = np.empty((row, 2 * int(nodes[windows[-1] + 1])))
    for j in windows:
        for i in windows:
            driven = body.far.driven[tooth[i] - tooth[j]][:, of_flank[j]]
            part = matrix[moved[i], moved[j]]
            np.matmul(body.far.flank[of_flank[i]], driven, out=part)
            if i == j:
                part += body.own[of_flank[i], of_flank[j]]
            if i not in rows:
                continue
            part = matrix[rows[i], moved[j]]
            np.matmul(body.far.stress[of_points[i]], driven, out=part)
            if i == j:
                part += body.stress_own[of_points[i], of_flank[j]]
    return matrix
