"""One position of a gear pair: which teeth face each other, the pieces of flank that may touch, and their compliance.

Frames. The pinion's centre is the origin, the wheel's centre lies at (a, 0). At pinion angle 0 the pinion tooth 0 is
centred on the line of centres and a wheel space faces it; angles are counter-clockwise. Pair k joins the left flanks of
the pinion tooth k and of the wheel tooth -1 - k (tooth 0 of the wheel is the one below the line of centres then).
Places are global; displacements and forces refer to the axes of the tooth they belong to, in which compliances are
the same at every position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .closest import Projection, chains_of, nearest_places, project, unreached
from .compliance import GearBody
from .corners import Bearing, growths, shares
from .flank import edge_nodes
from .law_data import check_stress_loads, law_data, slave_windows
from .laws import ContactLaw
from .multiplier import Hats

Array = NDArray[Any]
IntArray = NDArray[Any]


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
    corners
        Where the sharp tip corners bear, see `gearfe.contact.corners`.
    """

    pinion: GearBody
    wheel: GearBody
    centre_distance: float
    width: float
    law: ContactLaw
    corners: tuple[Bearing | None, Bearing | None] = (None, None)

    def __post_init__(self) -> None:
        check_stress_loads(self.bodies, self.law, self.width)
        widths = [body.width for body in self.bodies]
        if self.law.uses_stress and widths != [self.width, self.width]:
            problem = f"the gears' surface stresses are made for contacts {widths} m wide"
            raise InputError("width", self.width, problem, "make the gears with it: gear_body(..., width=...)")

    @property
    def bodies(self) -> tuple[GearBody, GearBody]:
        """Pinion and wheel."""
        return self.pinion, self.wheel

    @property
    def contact_compliances(self) -> tuple[float, float]:
        """1/E' of both gears (1/Pa); a plane body of its own face width w_i carries the load of the common width and
        counts with w/w_i.
        """
        one, two = (b.material.contact_compliance(b.plane) * self.width / b.thickness for b in self.bodies)
        return one, two

    @property
    def pitch_angle(self) -> float:
        """Mesh cycle in terms of the pinion's rotation (rad)."""
        return 2 * np.pi / self.pinion.teeth

    def wheel_angle(self, pinion_angle: Any, twist: Any) -> Any:
        """Wheel rotation (rad): -pinion angle z1/z2 + twist."""
        return -pinion_angle * self.pinion.teeth / self.wheel.teeth + twist

    def tooth_angle(self, gear: int, tooth: Any, pinion_angle: Any, twist: Any) -> Any:
        """Angle (rad) of the frame of a tooth of the pinion (gear 0) or wheel (gear 1); numbers or arrays."""
        if gear == 0:
            return pinion_angle + 2 * np.pi * tooth / self.pinion.teeth
        return self.wheel_angle(pinion_angle, twist) + np.pi + (2 * tooth + 1) * np.pi / self.wheel.teeth

    def centre(self, gear: int) -> Array:
        """Centre of the pinion (0) or wheel (1), shape (2,) (m)."""
        return np.array([gear * self.centre_distance, 0.0])


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
        Tooth number; the compliance depends on differences of it only.
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
    def flank_nodes(self) -> slice:
        """Its nodes within the tooth's contact surface."""
        return slice(2 * self.first_edge, 2 * (self.first_edge + self.edges) + 1)

    @property
    def flank_unknowns(self) -> slice:
        """Its unknowns within the tooth's contact surface."""
        return slice(4 * self.first_edge, 4 * (self.first_edge + self.edges) + 2)


@dataclass(frozen=True)
class Scene:
    """What the solver needs of one position.

    Attributes
    ----------
    windows
        Pieces of flank, pinion's and wheel's of each pair.
    counts : ndarray, shape (windows,)
        Edges of each window.
    points : ndarray, shape (n, 2)
        Undeformed nodes in their present places (m).
    rotation : ndarray, shape (n, 2, 2)
        Tooth axes to global axes, of each node.
    of_wheel : ndarray of bool, shape (n,)
    compliance : ndarray, shape (2n, 2n)
        Displacements of the nodes for forces on them, tooth axes (m/N).
    stress : ndarray, shape (q, 2n)
        Normal stress at the contact points for forces on the nodes (Pa/N); no rows for laws without stress.
    slave_nodes, slave_shapes : ndarray, shape (q, 3)
        Nodes and shape functions of each contact point.
    mate : ndarray, shape (q,)
        Window that each contact point is projected onto.
    weight : ndarray, shape (q,)
        Area of each contact point (m2).
    growth : ndarray, shape (q,)
        Rate of ln(weight) with the twist (1/rad), see `corners.growths`.
    fade : ndarray, shape (q,)
        Half of the point's own stretch of surface, in edges of the mate. Where a stretch lies across the end of the
        mate's surface (a sharp tip), the part that is past it does not count, so that sliding past the corner is
        continuous.
    parameter : ndarray, shape (q,)
        The law's gamma (Pa/m).
    owner : ndarray, shape (q,)
        Window that carries each contact point.
    pair : ndarray, shape (q,)
        Tooth pair of each contact point.
    rigid : Projection
        Closest points of the undeformed bodies.
    theta
        The law's.
    stress_stress : ndarray, shape (q, q)
        Normal stress at the contact points for stress loads at them (Pa/(N m2)); no rows with theta = 0.
    hats : Hats, or None
        Multiplier space of the exact law.
    """

    windows: tuple[Window, ...]
    counts: IntArray
    points: Array
    rotation: Array
    of_wheel: NDArray[np.bool_]
    wheel_centre: Array
    compliance: Array
    stress: Array
    slave_nodes: IntArray
    slave_shapes: Array
    mate: IntArray
    weight: Array
    growth: Array
    fade: Array
    parameter: Array
    owner: IntArray
    pair: IntArray
    rigid: Projection
    theta: int = 0
    stress_stress: Array = field(default_factory=lambda: np.zeros((0, 0)))
    hats: Hats | None = None

    @property
    def pairs(self) -> int:
        """Number of tooth pairs that overlap when rigid."""
        return len(self.windows) // 2

    def placed(self, displacement: Array) -> Array:
        """Nodes in their places when displaced by `displacement`, shape (2n,) in tooth axes: shape (n, 2) (m)."""
        return self.points + np.matmul(self.rotation, displacement.reshape(-1, 2, 1))[:, :, 0]

    def slaves(self, nodes: Array) -> Array:
        """Places of the contact points for given node places, shape (q, 2) (m)."""
        corners = nodes[self.slave_nodes]
        return np.matmul(self.slave_shapes[:, None, :], corners)[:, 0, :]

    def areas(self, place: Array) -> Array:
        """Areas of the contact points (m2) as far as they lie before the end of the mate's surface."""
        return self.weight * np.clip(0.5 + (self.counts[self.mate] - place) / (2 * self.fade), 0.0, 1.0)

    def facing(self, projection: Projection) -> Array:
        """Areas of the contact points (m2) as far as they face the mate at all."""
        return np.where(unreached(projection.gap), 0.0, self.areas(projection.place))


@dataclass(frozen=True)
class _Chained:
    """What a scene gives to a common search for closest points."""

    counts: IntArray
    mate: IntArray
    fade: Array


def project_all(scenes: Sequence[Scene], nodes: Sequence[Array], places: Sequence[Array]) -> list[Projection]:
    """Closest points of several scenes in one pass (numpy's cost per call is then shared).

    Parameters
    ----------
    nodes, places
        For each scene the places of its nodes (m) and where to start on the mates' chains.
    """
    slaves = [scene.slaves(x) for scene, x in zip(scenes, nodes, strict=True)]
    return _project([_Chained(s.counts, s.mate, s.fade) for s in scenes], nodes, slaves, places)


def _project(
    parts: Sequence[_Chained], nodes: Sequence[Array], slaves: Sequence[Array], places: Sequence[Array]
) -> list[Projection]:
    windows = np.cumsum([0, *(len(p.counts) for p in parts)])
    mates = [p.mate + first for p, first in zip(parts, windows, strict=False)]
    reach = np.concatenate([p.fade for p in parts])
    counts = np.concatenate([p.counts for p in parts])
    chains = chains_of(np.concatenate(nodes), counts, np.concatenate(mates), reach)
    found = project(np.concatenate(slaves), chains, np.concatenate(places))
    made, first, node = [], 0, 0
    for part, own in zip(parts, nodes, strict=True):
        one = found.take(slice(first, first + len(part.mate)))
        made.append(replace(one, edge=one.edge - node))
        first += len(part.mate)
        node += len(own)
    return made


def turn(angle: float) -> Array:
    """Rotation matrix of `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def assemble(pair: MeshingPair, windows: Sequence[Window]) -> Scene:
    """Gather places, contact points and compliances of the given pieces of flank."""
    return assemble_all(pair, [windows])[0]


def assemble_all(pair: MeshingPair, positions: Sequence[Sequence[Window]]) -> list[Scene]:
    """Scenes of several positions, given by their windows; see `assemble`."""
    parts = [_gathered(pair, windows) for windows in positions]
    chained = [_Chained(p["counts"], p["mate"], p["fade"]) for p in parts]
    slaves = [np.matmul(p["slave_shapes"][:, None, :], p["points"][p["slave_nodes"]])[:, 0, :] for p in parts]
    starts = []
    for windows, part, slave in zip(positions, parts, slaves, strict=True):
        start = np.empty(len(slave))
        for i in np.unique(part["owner"]):
            rows = part["owner"] == i
            start[rows] = nearest_places(slave[rows], part["points"][windows[i ^ 1].nodes])
        starts.append(start)
    rigid = _project(chained, [p["points"] for p in parts], slaves, starts)
    return [
        Scene(windows=tuple(windows), rigid=one, **part)
        for windows, part, one in zip(positions, parts, rigid, strict=True)
    ]


def _gathered(pair: MeshingPair, windows: Sequence[Window]) -> dict[str, Any]:
    """Attributes of a scene except its windows and closest points."""
    count = windows[-1].nodes.stop
    points, rotation = np.empty((count, 2)), np.empty((count, 2, 2))
    of_wheel = np.zeros(count, dtype=bool)
    for w in windows:
        matrix = turn(w.angle)
        points[w.nodes] = pair.bodies[w.gear].flank.points[w.flank_nodes] @ matrix.T + pair.centre(w.gear)
        rotation[w.nodes] = matrix
        of_wheel[w.nodes] = bool(w.gear)
    slaves = slave_windows(pair, windows)
    return {
        "counts": np.array([w.edges for w in windows]),
        "points": points,
        "rotation": rotation,
        "of_wheel": of_wheel,
        "wheel_centre": pair.centre(1),
        "compliance": _compliance(pair, windows, count),
        "stress": _stress(pair, windows, slaves, count),
        **_contact_points(pair, windows, slaves),
        **law_data(pair, windows, slaves),
    }


def _contact_points(pair: MeshingPair, windows: Sequence[Window], slaves: list[int]) -> dict[str, NDArray]:
    parts: dict[str, list[NDArray]] = {}
    for i in slaves:
        w, mate = windows[i], windows[i ^ 1]  # windows come in couples: pinion's, wheel's
        body, mate_flank = pair.bodies[w.gear], pair.bodies[mate.gear].flank
        flank = body.flank
        own = slice(w.first_edge, w.first_edge + w.edges)
        q = flank.shapes.shape[0]
        n = w.edges * q
        lengths = flank.weights[own].ravel()
        gamma = pair.law.parameter(body.surface_modulus, flank.sizes)[own]
        angles = windows[i & ~1].angle, windows[i | 1].angle
        share, growth = 1.0, 0.0
        if pair.law.sides == "both":
            share, growth = shares(pair.corners, angles)[w.gear], growths(pair.corners, angles)[w.gear]
        made = {
            "slave_nodes": np.repeat(w.first_node + edge_nodes(np.arange(w.edges)), q, axis=0),
            "slave_shapes": np.tile(flank.shapes, (w.edges, 1)),
            "mate": np.full(n, i ^ 1),
            "weight": share * pair.width * lengths,
            "growth": np.full(n, growth),
            "fade": 0.5 * lengths / mate_flank.sizes[mate.first_edge + mate.edges - 1],
            "parameter": np.repeat(gamma, q),
            "owner": np.full(n, i),
            "pair": np.full(n, w.pair),
        }
        for name, value in made.items():
            parts.setdefault(name, []).append(value)
    return {name: np.concatenate(values) for name, values in parts.items()}


def _compliance(pair: MeshingPair, windows: Sequence[Window], count: int) -> Array:
    """Compliance between all window nodes; the two gears do not feel each other's elasticity."""
    full = np.zeros((2 * count, 2 * count))
    for loaded in windows:
        body = pair.bodies[loaded.gear]
        for moved in windows:
            if moved.gear != loaded.gear:
                continue
            driven = body.far.driven[moved.tooth - loaded.tooth][:, loaded.flank_unknowns]
            block = full[moved.unknowns, loaded.unknowns]
            np.matmul(body.far.flank[moved.flank_unknowns], driven, out=block)
            if moved is loaded:
                block += body.own[loaded.flank_unknowns, loaded.flank_unknowns]
    return full


def _stress(pair: MeshingPair, windows: Sequence[Window], slaves: list[int], count: int) -> Array:
    if not pair.law.uses_stress:
        return np.zeros((0, 2 * count))
    rows = []
    for i in slaves:
        w = windows[i]
        body = pair.bodies[w.gear]
        assert body.stress_own is not None
        assert body.far.stress is not None
        q = body.flank.shapes.shape[0]
        own = slice(q * w.first_edge, q * (w.first_edge + w.edges))
        part = np.zeros((q * w.edges, 2 * count))
        for loaded in windows:
            if loaded.gear != w.gear:
                continue
            block = part[:, loaded.unknowns]
            driven = body.far.driven[w.tooth - loaded.tooth][:, loaded.flank_unknowns]
            np.matmul(body.far.stress[own], driven, out=block)
            if loaded is w:
                block += body.stress_own[own, loaded.flank_unknowns]
        rows.append(part)
    return np.concatenate(rows)
