"""Pieces of flank of many positions side by side in flat arrays, so that one array operation serves them all.

Windows are sorted by gear, position and tooth pair: those of all pinions, then in the same order those of the wheels
that they face. Nodes and contact points of one gear in one position are then one stretch, a *block*.

Vectors are complex numbers x + i y. Displacements and forces are in the axes of the tooth that a node belongs to, in
which the matrices are the same at every position.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from .compliance import GearBody, MeshingPair
from .flank import Flank, project
from .laws import carrying, on_elements, uses_stress
from .position import FlankLoads, Positions, ranges


@dataclass(frozen=True)
class Block:
    """One gear in one position: its n nodes and q contact points in the batch, and what forces on the nodes do.

    Attributes
    ----------
    nodes, points : slice
    compliance : ndarray, shape (2 n, 2 n)
        Displacements of the nodes (m/N).
    stress : ndarray, shape (q, 2 n)
        Normal stresses at the contact points (Pa/N); no rows for laws without stress.
    """

    nodes: slice
    points: slice
    compliance: Array
    stress: Array


@dataclass(frozen=True)
class Batch:
    """B positions side by side: W windows, n nodes, q contact points.

    Attributes
    ----------
    elastic
        The gears.
    size
        B.
    position, gear, tooth, mate, first_edge, counts : ndarray, shape (W,)
        Of each window: its position, gear and tooth, the window that it faces, and its edges.
    turn : ndarray of complex, shape (W,)
        Unit number that turns tooth axes to global ones.
    window, node : ndarray, shape (n,)
        Of each node its window, and its number on the flank.
    points : ndarray of complex, shape (n,)
        Undeformed nodes, tooth axes (m).
    owner : ndarray, shape (q,)
        Window of each contact point, which is projected onto that window's mate.
    slave_place : ndarray, shape (q,)
        Place of each contact point on the chain of edges of its own window.
    slave_nodes, slave_shapes : ndarray, shape (q, 3)
        Nodes and shape functions of each contact point.
    weight : ndarray, shape (q,)
        Area of each contact point (m2).
    end_weighting : ndarray, shape (q,)
        Half of the point's own stretch of surface, in edges of the mate. Where a stretch lies across the end of the
        mate's surface (a sharp tip), the part past the end does not count. So sliding past the corner is continuous.
    parameter : ndarray, shape (q,)
        The law's gamma (Pa/m).
    blocks : list of Block
        Of the pinion in each position, then of the wheel.
    """

    elastic: MeshingPair
    size: int
    position: IntArray
    gear: IntArray
    tooth: IntArray
    mate: IntArray
    first_edge: IntArray
    counts: IntArray
    turn: ComplexArray
    window: IntArray
    node: IntArray
    points: ComplexArray
    owner: IntArray
    slave_place: Array
    slave_nodes: IntArray
    slave_shapes: Array
    weight: Array
    end_weighting: Array
    parameter: Array
    blocks: list[Block]

    @property
    def pairs(self) -> int:
        """Number of windows of one gear: window w of the pinion and w + pairs of the wheel face each other."""
        return len(self.gear) // 2

    @property
    def at(self) -> IntArray:
        """Position of each contact point, shape (q,)."""
        return self.position[self.owner]

    @property
    def node_position(self) -> IntArray:
        """Position of each node, shape (n,)."""
        return self.position[self.window]

    def respond(self, forces: ComplexArray, chosen: Iterable[int]) -> tuple[ComplexArray, Array]:
        """Displacements (m), shape (n,), and stresses at the contact points (Pa), shape (q,), for forces (N).

        Only the positions `chosen` are computed; the others' numbers are 0.
        """
        moved, stress = np.zeros_like(forces), np.zeros(len(self.weight))
        for b in chosen:
            for block in self.blocks[b :: self.size]:
                load = forces[block.nodes].view(float)
                moved[block.nodes] = (block.compliance @ load).view(complex)
                if len(block.stress):
                    stress[block.points] = block.stress @ load
        return moved, stress

    def placed(self, displacement: ComplexArray, turn: ComplexArray) -> ComplexArray:
        """Nodes in their places (m) when displaced (m) and with the windows turned by `turn`, shape (W,)."""
        hub = self.gear * self.elastic.wheel_centre
        return np.asarray(turn[self.window] * (self.points + displacement) + hub[self.window])

    def slaves(self, placed: ComplexArray, points: IntArray) -> ComplexArray:
        """Places of contact points (m) for places of the nodes."""
        return np.asarray((self.slave_shapes[points] * placed[self.slave_nodes[points]]).sum(axis=1))


def batch_of(elastic: MeshingPair, expected: Positions, reach: tuple[float, int]) -> tuple[Batch, ComplexArray]:
    """Lay positions side by side, in windows about the nodes that are loaded; and the forces on their nodes (N).

    Parameters
    ----------
    expected
        B positions with loads, all of them; row by row those of pinion and wheel face each other.
    reach
        How far windows go beyond their loaded nodes: share of those edges, and edges.
    """
    loads, angles, twists = [_of_teeth(one) for one in expected.loads], expected.pinion_angle, expected.twist
    m, law = len(loads[0].tooth), on_elements(elastic.law)
    gear, position = np.repeat([0, 1], m), np.tile(loads[0].position, 2)
    tooth, mate = np.concatenate([one.tooth for one in loads]), np.roll(np.arange(2 * m), m)
    flanks = [body.flank for body in elastic.bodies]
    of_gears = list(zip(flanks, loads, strict=True))
    low, counts = np.concatenate([_window(flank, one.force, *reach) for flank, one in of_gears], axis=1)
    bears = carrying(law, np.stack([_to_tip(flank, one.force) for flank, one in of_gears], axis=1)).T.ravel()
    last_edge = np.concatenate([flank.sizes[-1 + (low + counts)[gear == g]] for g, flank in enumerate(flanks)])
    nodes, first_node = 2 * counts + 1, np.cumsum(2 * counts + 1) - 2 * counts - 1
    of_nodes, of_points = [], []
    for g, (flank, load) in enumerate(of_gears):
        own, q = np.flatnonzero(gear == g), len(flank.shapes)
        node, row = ranges(2 * low[own], nodes[own]), np.repeat(np.arange(m), nodes[own])
        of_nodes.append((node, flank.points[node] @ [1, 1j], load.force.view(complex)[row, node]))
        number = np.where(bears, q * counts, 0)[own]
        point, owner = ranges(q * low[own], number), np.repeat(own, number)
        edge, shapes, length = point // q, flank.shapes[point % q], flank.weights.ravel()[point]
        place, parameter = edge - low[owner], law.parameter(elastic.bodies[g].surface_modulus, flank.sizes)[edge]
        end_weighting = 0.5 * length / last_edge[mate[owner]]
        of_points.append((owner, place, shapes, length, end_weighting, parameter))
    node, points, forces = (np.concatenate(part) for part in zip(*of_nodes, strict=True))
    owner, edge, shapes, length, end_weighting, parameter = map(np.concatenate, zip(*of_points, strict=True))
    turned = [elastic.tooth_angle(g, tooth, angles[position], twists[position]) for g in (0, 1)]
    made = Batch(
        elastic=elastic,
        size=len(angles),
        position=position,
        gear=gear,
        tooth=tooth,
        mate=mate,
        first_edge=low,
        counts=counts,
        turn=np.exp(1j * np.where(gear == 0, *turned)),
        window=np.repeat(np.arange(2 * m), nodes),
        node=node,
        points=points,
        owner=owner,
        slave_place=edge + shapes @ [0.0, 0.5, 1.0],
        slave_nodes=(first_node[owner] + 2 * edge)[:, None] + np.arange(3),
        slave_shapes=shapes,
        weight=elastic.width * np.where(bears & bears[mate], 0.5, 1.0)[owner] * length,
        end_weighting=end_weighting,
        parameter=parameter,
        blocks=[],
    )
    return replace(made, blocks=_blocks(made, bears & uses_stress(law))), forces


def _window(flank: Flank, force: Array, share: float, margin: int) -> IntArray:
    """First edges and numbers of edges of windows about the loaded nodes of m flanks, shape (2, m)."""
    on = force.view(complex) != 0
    low, end = on.argmax(axis=1) // 2, (len(flank.nodes) - on[:, ::-1].argmax(axis=1)) // 2
    more = margin + np.ceil(share * (end - low)).astype(np.int64)
    first = np.maximum(low - more, 0)
    return np.stack([first, np.minimum(end + more, flank.edges) - first])


def _to_tip(flank: Flank, force: Array) -> Array:
    """How far from the flank's end the loads on its nodes lie in the mean (m), shape (m,)."""
    load, arc = np.abs(force.view(complex)), flank.arc(0.5 * np.arange(len(flank.nodes)))
    return np.asarray(flank.ends[-1] - load @ arc / load.sum(axis=1))


def _blocks(batch: Batch, stressed: BoolArray) -> list[Block]:
    """The response of the pinion in each position, then of the wheel."""
    made = []
    bounds = np.searchsorted(batch.gear * batch.size + batch.position, np.arange(2 * batch.size + 1))
    nodes, points = (np.searchsorted(of, bounds).tolist() for of in (batch.window, batch.owner))
    for k, windows in enumerate(itertools.pairwise(bounds.tolist())):
        body, own = batch.elastic.bodies[batch.gear[windows[0]]], slice(*windows)
        q, tooth, ends = len(body.flank.shapes), batch.tooth[own], batch.first_edge[own] + batch.counts[own]
        edges = list(zip(batch.first_edge[own].tolist(), ends.tolist(), strict=True))
        columns = [slice(4 * first, 4 * end + 2) for first, end in edges]
        rows = [
            slice(q * first, q * end) if s else slice(0) for (first, end), s in zip(edges, stressed[own], strict=True)
        ]
        compliance = _response(body, tooth, (body.interface, body.own), columns, columns)
        stress = _response(body, tooth, (body.stress_interface, body.stress_own), rows, columns)
        made.append(Block(slice(*nodes[k : k + 2]), slice(*points[k : k + 2]), compliance, stress))
    return made


def _response(
    body: GearBody, tooth: IntArray, answers: tuple[Array, Array], rows: list[slice], columns: list[slice]
) -> Array:
    """What forces on the flanks of teeth, at the unknowns `columns`, make of the rows of each.

    `answers` are those of a tooth to its cut sides' displacements, and to forces on its own flank with the sides held.
    """
    through_sides, own = answers
    parts = []
    for i, row in enumerate(rows):
        line = [through_sides[row] @ body.driven(int(tooth[i] - at))[:, columns[j]] for j, at in enumerate(tooth)]
        line[i] += own[row, columns[i]]
        parts.append(line)
    return np.block(parts)


def _of_teeth(loads: FlankLoads) -> FlankLoads:
    """One load a tooth: where it bears in several places, their sum."""
    first = np.flatnonzero((np.diff(loads.position, prepend=-1) != 0) | (np.diff(loads.tooth, prepend=0) != 0))
    force = np.add.reduceat(loads.force, first) if len(first) else loads.force
    return FlankLoads(loads.position[first], loads.tooth[first], force, force)


@dataclass(frozen=True)
class ProjectedPoints:
    """Contact points of some positions as they lie to their mates in a state.

    Attributes
    ----------
    points, at : ndarray, shape (k,)
        Numbers of the contact points, and of their positions.
    nodes : ndarray, shape (k, 6)
        Nodes of each point's own edge and of the edge that it faces.
    normal : ndarray of complex, shape (k, 6)
        G: coefficients of the nodes' displacements in the gap, tooth axes.
    place, gap, area : ndarray, shape (k,)
        Foot points on the mates' chains of edges, gaps (m), and areas as far as they face the mate (m2). Without a
        closest point they are `gearfe.gears.contact.flank.OFF_END` and none.
    trial : ndarray, shape (k,)
        Pressure that the law asks for (Pa).
    """

    points: IntArray
    at: IntArray
    nodes: IntArray
    normal: ComplexArray
    place: Array
    gap: Array
    area: Array
    trial: Array

    def forces(self, pressure: Array, count: int) -> ComplexArray:
        """G^T W p (N), shape (n,), for pressures (Pa), shape (k,)."""
        loads, nodes = self.normal * (self.area * pressure)[:, None], self.nodes.ravel()
        x, y = (np.bincount(nodes, part.ravel(), count) for part in (loads.real, loads.imag))
        return np.asarray(x + 1j * y)

    def closing(self, displacement: ComplexArray) -> Array:
        """G u (m), shape (k,)."""
        return np.asarray((self.normal.conj() * displacement[self.nodes]).real.sum(axis=1))


def projected(
    batch: Batch, turn: ComplexArray, displacement: ComplexArray, stress: Array, place: Array, points: IntArray
) -> ProjectedPoints:
    """Project contact points onto the mates' displaced surfaces.

    Parameters
    ----------
    batch : Batch
        Positions side by side.
    turn : ndarray of complex, shape (W,)
        Unit numbers that turn tooth axes to global ones.
    displacement : ndarray of complex, shape (n,)
        Displacements of the nodes, tooth axes (m).
    stress : ndarray, shape (points,)
        Normal stresses at the points (Pa).
    place : ndarray, shape (q,)
        Foot points from which the projection starts, on the mates' chains of edges.
    points : ndarray of int, shape (points,)
        Numbers of the contact points.
    """
    placed, own = batch.placed(displacement, turn), batch.owner[points]
    mate, half_stretch = batch.mate[own], batch.end_weighting[points]
    found = project(batch.slaves(placed, points), placed, batch.counts, mate, place[points], half_stretch)
    on_own = batch.slave_shapes[points] * (found.normal * turn[own].conj())[:, None]
    on_mate = -found.shapes * (found.normal * turn[mate].conj())[:, None]
    before_end = np.clip(0.5 + (batch.counts[mate] - found.place) / (2 * half_stretch), 0.0, 1.0)
    return ProjectedPoints(
        points=points,
        at=batch.position[own],
        nodes=np.concatenate([batch.slave_nodes[points], found.edge[:, None] + np.arange(3)], axis=1),
        normal=np.concatenate([on_own, on_mate], axis=1),
        place=found.place,
        gap=found.gap,
        area=np.where(found.reached, batch.weight[points] * before_end, 0.0),
        trial=np.maximum(-batch.parameter[points] * found.gap - stress[points], 0.0),
    )


def at_rims(batch: Batch, pressure: Array, place: Array) -> BoolArray:
    """Whether a contact has come to the rim of a window beyond which the flank goes on, shape (B,).

    Parameters
    ----------
    pressure, place : ndarray, shape (q,)
        Pressures at the contact points (Pa), and their foot points on the mates' chains of edges.
    """
    edges = np.array([body.flank.edges for body in batch.elastic.bodies])[batch.gear]
    low, high = batch.first_edge > 0, batch.first_edge + batch.counts < edges
    bears = np.flatnonzero(pressure > 0)
    rim = np.zeros(len(bears), dtype=bool)
    # on the last edge of the mate's window the normal is not blended into its neighbour's
    for window, places in ((batch.owner, batch.slave_place), (batch.mate[batch.owner], place)):
        own, at = window[bears], places[bears]
        rim |= (low[own] & (at < 1)) | (high[own] & (at > batch.counts[own] - 1))
    return np.bincount(batch.at[bears[rim]], minlength=batch.size) > 0
