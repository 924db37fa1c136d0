"""One position of a gear pair: which teeth face each other, the pieces of flank that may touch, and their compliance.

Frames. The pinion's centre is the origin, the wheel's centre lies at (a, 0). At pinion angle 0 the pinion tooth 0 is
centred on the line of centres and a wheel space faces it; angles are counter-clockwise. Pair k joins the left flanks of
the pinion tooth k and of the wheel tooth -1 - k (tooth 0 of the wheel is the one below the line of centres then).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .closest import Projection, chains_of, nearest_places, project
from .compliance import GearBody
from .flank import edge_nodes
from .laws import ContactLaw

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class MeshingPair:
    """Two elastic gears in mesh.

    Parameters
    ----------
    pinion, wheel
        Elastic gears.
    centre_distance
        a (m).
    width
        Common face width (m).
    law
        Contact law.
    """

    pinion: GearBody
    wheel: GearBody
    centre_distance: float
    width: float
    law: ContactLaw

    @property
    def bodies(self) -> tuple[GearBody, GearBody]:
        """Pinion and wheel."""
        return self.pinion, self.wheel

    @property
    def pitch_angle(self) -> float:
        """Mesh cycle in terms of the pinion's rotation (rad)."""
        return 2 * np.pi / self.pinion.teeth

    def wheel_angle(self, pinion_angle: float, twist: float) -> float:
        """Wheel rotation (rad): -pinion angle z1/z2 + twist."""
        return -pinion_angle * self.pinion.teeth / self.wheel.teeth + twist


@dataclass(frozen=True)
class Window:
    """A piece of one tooth's contact surface that may touch the mate.

    Attributes
    ----------
    gear
        0 pinion, 1 wheel.
    pair
        Index of the tooth pair within the scene.
    tooth
        Tooth number, the compliance depends on differences of it only.
    first_edge, edges
        Range of edges of the tooth's contact surface.
    first_node
        Where its nodes start in the scene.
    angle
        Angle of the tooth's frame (rad).
    """

    gear: int
    pair: int
    tooth: int
    first_edge: int
    edges: int
    first_node: int
    angle: float

    @property
    def nodes(self) -> slice:
        """Its nodes in the scene."""
        return slice(self.first_node, self.first_node + 2 * self.edges + 1)

    @property
    def unknowns(self) -> slice:
        """Its unknowns in the scene."""
        return slice(2 * self.first_node, 2 * (self.first_node + 2 * self.edges + 1))

    @property
    def flank_unknowns(self) -> slice:
        """The same within the tooth's contact surface."""
        return slice(4 * self.first_edge, 4 * (self.first_edge + self.edges) + 2)


@dataclass(frozen=True)
class Scene:
    """What the solver needs of one position; everything is expressed in global axes.

    Attributes
    ----------
    windows
        Pieces of flank, pinion's and wheel's of each pair.
    points : ndarray, shape (n, 2)
        Undeformed nodes in their present places (m).
    lever : ndarray, shape (n, 2)
        Velocity of the undeformed nodes for unit rotation of the wheel: e_z x (x - c) on the wheel, 0 on the pinion (m).
    of_wheel : ndarray of bool, shape (n,)
    compliance : ndarray, shape (2n, 2n)
        Displacements of the nodes for forces on them (m/N).
    stress : ndarray, shape (q, 2n)
        Normal stress at the contact points for forces on the nodes (Pa/N), zero for laws without stress.
    slave_nodes, slave_shapes : ndarray, shape (q, 3)
        Nodes and shape functions of each contact point.
    mate : ndarray, shape (q,)
        Window that each contact point is projected onto.
    weight : ndarray, shape (q,)
        Area of each contact point (m2).
    fade : ndarray, shape (q,)
        Half of the point's own stretch of surface, in edges of the mate: over this last bit before the end of the
        mate's surface (a sharp tip) the point's share fades out, so that sliding past the corner is continuous.
    parameter : ndarray, shape (q,)
        The law's gamma (Pa/m).
    pair : ndarray, shape (q,)
        Tooth pair of each contact point.
    on_pinion : ndarray of bool, shape (q,)
        Which body carries the point.
    rigid_gap, place : ndarray, shape (q,)
        Gap (m) and closest place of the undeformed bodies.
    depth : ndarray, shape (pairs,)
        Largest overlap of the undeformed bodies (m).
    """

    windows: tuple[Window, ...]
    points: Array
    lever: Array
    of_wheel: NDArray[np.bool_]
    wheel_centre: Array
    compliance: Array
    stress: Array
    slave_nodes: IntArray
    slave_shapes: Array
    mate: IntArray
    weight: Array
    fade: Array
    parameter: Array
    pair: IntArray
    on_pinion: NDArray[np.bool_]
    rigid_gap: Array
    place: Array
    depth: Array

    @property
    def pairs(self) -> int:
        """Number of tooth pairs that overlap when rigid."""
        return len(self.depth)

    def project(self, displacement: Array, place: Array) -> Projection:
        """Closest points of all contact points when the nodes are displaced by `displacement`, shape (2n,) (m)."""
        nodes = self.points + displacement.reshape(-1, 2)
        slave = np.einsum("qa,qai->qi", self.slave_shapes, nodes[self.slave_nodes])
        counts = np.array([w.edges for w in self.windows])
        return project(slave, chains_of(nodes, counts, self.mate), place)

    def areas(self, place: Array) -> Array:
        """Areas of the contact points (m2), faded out towards the end of the mate's surface."""
        counts = np.array([w.edges for w in self.windows])
        return self.weight * np.clip((counts[self.mate] - place) / self.fade, 0.0, 1.0)


def turn(angle: float) -> Array:
    """Rotation matrix of `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def overlapping_windows(pair: MeshingPair, pinion_angle: float, twist: float) -> tuple[tuple[Window, ...], Array]:
    """Windows of the tooth pairs whose undeformed flanks overlap, and the depth of each overlap (m)."""
    # a pair can only touch while its pinion tooth is near the line of centres: two pitches either way are ample
    central = -pinion_angle / pair.pitch_angle
    numbers = range(int(np.floor(central)) - 3, int(np.ceil(central)) + 4)
    windows: list[Window] = []
    depths = []
    node = 0
    for k in numbers:
        angle1 = tooth_angle(pair, 0, k, pinion_angle, twist)
        angle2 = tooth_angle(pair, 1, -1 - k, pinion_angle, twist)
        found = _overlap(pair, angle1, angle2)
        if found is None:
            continue
        depth, ranges = found
        for gear, tooth, angle, (low, high) in ((0, k, angle1, ranges[0]), (1, -1 - k, angle2, ranges[1])):
            windows.append(Window(gear, len(depths), tooth, low, high - low, node, angle))
            node += 2 * (high - low) + 1
        depths.append(depth)
    return tuple(windows), np.array(depths)


def _overlap(pair: MeshingPair, angle1: float, angle2: float) -> tuple[float, list[tuple[int, int]]] | None:
    """Depth of the overlap of two rigid flanks and the ranges of edges within it, or None when they are apart."""
    one, two = pair.pinion.flank, pair.wheel.flank
    points1 = one.points[::2] @ turn(angle1).T
    points2 = two.points @ turn(angle2).T + np.array([pair.centre_distance, 0.0])
    reach1, reach2 = np.linalg.norm(points1[-1]), pair.centre_distance - np.linalg.norm(two.points[-1])
    if reach1 < 0.5 * reach2:
        return None
    low, high = points2.min(axis=0), points2.max(axis=0)
    if (points1.max(axis=0) < low).any() or (points1.min(axis=0) > high).any():
        return None
    chain = chains_of(points2, np.array([two.edges]), np.zeros(len(points1), dtype=np.int64))
    found = project(points1, chain, nearest_places(points1, points2), iterations=6)
    inside = np.flatnonzero(found.gap < 0)
    if len(inside) == 0:
        return None
    place = found.place[inside]
    ranges = [
        (max(0, inside[0] - MARGIN), min(one.edges, inside[-1] + MARGIN)),
        (max(0, int(place.min()) - MARGIN), min(two.edges, int(place.max()) + 1 + MARGIN)),
    ]
    return float(-found.gap[inside].min()), ranges


#: Edges added on either side of the overlap of the undeformed flanks.
MARGIN = 4


def scene_of(
    pair: MeshingPair, pinion_angle: float, twist: float, *, windows: tuple[Window, ...] | None = None
) -> Scene | None:
    """Assemble a position, or None when no teeth overlap.

    With `windows` (those of a larger twist) the same pieces of flank are used, turned to this twist.
    """
    if windows is None:
        windows, depth = overlapping_windows(pair, pinion_angle, twist)
        if not windows:
            return None
    else:
        windows = _turned_windows(pair, windows, pinion_angle, twist)
        depth = np.zeros(1 + max(w.pair for w in windows))
    count = windows[-1].nodes.stop
    centre = np.array([pair.centre_distance, 0.0])
    points, of_wheel = np.empty((count, 2)), np.zeros(count, dtype=bool)
    for w in windows:
        local = pair.bodies[w.gear].flank.points[2 * w.first_edge : 2 * (w.first_edge + w.edges) + 1]
        points[w.nodes] = local @ turn(w.angle).T + (centre if w.gear else 0.0)
        of_wheel[w.nodes] = bool(w.gear)
    arm = points - centre
    lever = np.where(of_wheel[:, None], np.stack([-arm[:, 1], arm[:, 0]], axis=1), 0.0)
    slaves = [w for w in windows if pair.law.sides == "both" or (pair.law.sides == "pinion") == (w.gear == 0)]
    columns = _contact_points(pair, windows, slaves)
    slave = np.einsum("qa,qai->qi", columns["slave_shapes"], points[columns["slave_nodes"]])
    start = np.empty(len(slave))
    for w in slaves:
        mate = _mate(windows, w)
        rows = columns["owner"] == w.first_node
        start[rows] = nearest_places(slave[rows], points[mate.nodes])
    counts = np.array([w.edges for w in windows])
    rigid = project(slave, chains_of(points, counts, columns["mate"]), start)
    del columns["owner"]
    if not depth.any():
        np.maximum.at(depth, columns["pair"], -rigid.gap)
    return Scene(
        windows=windows,
        points=points,
        lever=lever,
        of_wheel=of_wheel,
        wheel_centre=centre,
        compliance=_compliance(pair, windows, count),
        stress=_stress(pair, windows, slaves, count),
        rigid_gap=rigid.gap,
        place=rigid.place,
        depth=depth,
        **columns,
    )


def _turned_windows(
    pair: MeshingPair, windows: tuple[Window, ...], pinion_angle: float, twist: float
) -> tuple[Window, ...]:
    return tuple(replace(w, angle=tooth_angle(pair, w.gear, w.tooth, pinion_angle, twist)) for w in windows)


def tooth_angle(pair: MeshingPair, gear: int, tooth: int, pinion_angle: float, twist: float) -> float:
    """Angle (rad) of the frame of a tooth of the pinion (gear 0) or wheel (gear 1)."""
    if gear == 0:
        return pinion_angle + 2 * np.pi * tooth / pair.pinion.teeth
    return pair.wheel_angle(pinion_angle, twist) + np.pi + (2 * tooth + 1) * np.pi / pair.wheel.teeth


def _mate(windows: Sequence[Window], window: Window) -> Window:
    return next(w for w in windows if w.pair == window.pair and w.gear != window.gear)


def _contact_points(pair: MeshingPair, windows: Sequence[Window], slaves: Sequence[Window]) -> dict[str, NDArray]:
    share = pair.width * (0.5 if pair.law.sides == "both" else 1.0)
    parts: dict[str, list[NDArray]] = {}
    for w in slaves:
        body, mate = pair.bodies[w.gear], _mate(windows, w)
        flank, mate_flank = body.flank, pair.bodies[mate.gear].flank
        own = slice(w.first_edge, w.first_edge + w.edges)
        q = flank.shapes.shape[0]
        n = w.edges * q
        gamma = pair.law.parameter(body.material.youngs_modulus, flank.sizes[own])
        made = {
            "slave_nodes": np.repeat(w.first_node + edge_nodes(np.arange(w.edges)), q, axis=0),
            "slave_shapes": np.tile(flank.shapes, (w.edges, 1)),
            "mate": np.full(n, windows.index(mate)),
            "weight": share * flank.weights[own].ravel(),
            "fade": 0.5 * flank.weights[own].ravel() / mate_flank.sizes[mate.first_edge + mate.edges - 1],
            "parameter": np.repeat(gamma, q),
            "pair": np.full(n, w.pair),
            "on_pinion": np.full(n, w.gear == 0),
            "owner": np.full(n, w.first_node),
        }
        for name, value in made.items():
            parts.setdefault(name, []).append(value)
    return {name: np.concatenate(values) for name, values in parts.items()}


def _compliance(pair: MeshingPair, windows: Sequence[Window], count: int) -> Array:
    """Compliance between all window nodes in global axes; the two gears do not feel each other's elasticity."""
    full = np.zeros((2 * count, 2 * count))
    for gear, body in enumerate(pair.bodies):
        own = [w for w in windows if w.gear == gear]
        sides = [body.interface[w.flank_unknowns] for w in own]
        for i, loaded in enumerate(own):
            for j, moved in enumerate(own):
                if j < i:
                    continue
                step = (moved.tooth - loaded.tooth) % body.teeth
                block = sides[j] @ (body.coupling[step] @ sides[i].T)
                if i == j:
                    block += body.own[loaded.flank_unknowns, loaded.flank_unknowns]
                block = _turned(_turned(block, loaded.angle).T, moved.angle).T
                full[moved.unknowns, loaded.unknowns] = block
                if i != j:
                    full[loaded.unknowns, moved.unknowns] = block.T
    return full


def _turned(columns: Array, angle: float) -> Array:
    """Matrix whose columns (two a node) refer to tooth axes, made to refer to global axes."""
    shape = columns.shape
    return (columns.reshape(shape[0], -1, 2) @ turn(angle).T).reshape(shape)


def _stress(pair: MeshingPair, windows: Sequence[Window], slaves: Sequence[Window], count: int) -> Array:
    if not pair.law.uses_stress:
        return np.zeros((0, 2 * count))
    rows = []
    for w in slaves:
        body = pair.bodies[w.gear]
        assert body.stress_own is not None
        assert body.stress_interface is not None
        q = body.flank.shapes.shape[0]
        own = slice(q * w.first_edge, q * (w.first_edge + w.edges))
        part = np.zeros((q * w.edges, 2 * count))
        for loaded in windows:
            if loaded.gear != w.gear:
                continue
            step = (w.tooth - loaded.tooth) % body.teeth
            block = body.stress_interface[own] @ (body.coupling[step] @ body.interface[loaded.flank_unknowns].T)
            if loaded is w:
                block += body.stress_own[own, loaded.flank_unknowns]
            part[:, loaded.unknowns] = _turned(block, loaded.angle)
        rows.append(part)
    return np.concatenate(rows)
