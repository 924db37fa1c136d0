"""Two whole gears as a contact problem.

Teeth that may touch, and those between them, keep all their unknowns; the others are condensed (`.remainder`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import KDTree

from ....base.errors import InputError
from ....base.typing import Array, IntArray
from ...geometry.pair import GearPair
from ...geometry.validity import check_spur
from ...teeth.tooth_sector import sector_mesh, sector_recipes
from ..laws import ElementLaw, PairModel
from .bodies import Bodies
from .constitution import Kinematics
from .problem import ContactProblem, Surface
from .remainder import ElasticGear, GearArc, arc_of, rotation
from .segments import Quadrature

#: Teeth on either side of those that may touch whose finite strain counts: with 3, the torque of the shipped pair at
#: 0.5 deg is 7e-5 off that of whole gears, without any 4.5e-4.
BESIDE = 3


@dataclass(frozen=True)
class MeshingArcs:
    """Arcs of pinion and wheel whose teeth may touch, in one mesh.

    Attributes
    ----------
    elastic
        Both gears.
    arcs
        Their arcs.
    pairs
        Numbers of the tooth pairs that may touch: pair k joins the pinion's tooth k and the wheel's tooth -1 - k.
    """

    elastic: tuple[ElasticGear, ElasticGear]
    arcs: tuple[GearArc, GearArc]
    pairs: tuple[int, ...]

    @cached_property
    def bodies(self) -> Bodies:
        """Both arcs, each in the axes of its first tooth, in one mesh."""
        return Bodies(tuple(gear.body(arc.mesh) for gear, arc in zip(self.elastic, self.arcs, strict=True)))

    @cached_property
    def remainder(self) -> Any:
        """Stiffness of all other sectors on the unknowns of the bodies, sparse (N/m)."""
        total = coo_matrix((self.bodies.unknowns.size,) * 2).tocsr()
        for arc, of in zip(self.arcs, self.bodies.node_of, strict=True):
            unknowns = self.bodies.unknowns[of[arc.nodes]].ravel()
            rows, columns = np.broadcast_arrays(unknowns[:, None], unknowns)
            total = total + coo_matrix((arc.remainder.ravel(), (rows.ravel(), columns.ravel())), total.shape)
        return total

    def chains(self, pair: int) -> tuple[IntArray, IntArray]:
        """Return the edges of the flanks of pinion and wheel of a tooth pair: nodes of the joined mesh."""
        edges = []
        for gear, arc, of, tooth in zip(self.elastic, self.arcs, self.bodies.node_of, (pair, -1 - pair), strict=True):
            edges.append(of[arc.mesh.contact[(tooth - arc.first) % gear.mesh.teeth]])
        return edges[0], edges[1]


@dataclass(frozen=True)
class WholePair:
    """Two whole elastic gears in mesh.

    Parameters
    ----------
    pinion, wheel
        Gears.
    centre_distance
        |a| (m).
    width
        Common face width (m).
    points_per_edge, quadrature, kinematics
        As in `.problem.ContactProblem`.
    condensed
        Whether teeth that touch nothing are condensed. At small strain this changes nothing; at finite strain the
        condensed teeth keep small strain.
    """

    pinion: ElasticGear
    wheel: ElasticGear
    centre_distance: float
    width: float
    points_per_edge: int = 4
    quadrature: Quadrature = "points"
    kinematics: Kinematics = "small"
    condensed: bool = True

    @property
    def elastic(self) -> tuple[ElasticGear, ElasticGear]:
        """Pinion and wheel."""
        return self.pinion, self.wheel

    @property
    def sign(self) -> int:
        """1; -1 for an internal wheel, whose centre lies on the other side and which a twist turns the other way."""
        return -1 if self.wheel.mesh.internal else 1

    @property
    def wheel_centre(self) -> float:
        """x of the wheel's centre (m)."""
        return self.sign * self.centre_distance

    @property
    def unknowns(self) -> int:
        """Unknowns of both whole gears."""
        return sum(2 * gear.mesh.teeth * (len(gear.mesh.points) - len(gear.mesh.cut_left)) for gear in self.elastic)

    def angles(self, pinion_angle: float, twist: float) -> tuple[float, float]:
        """Return the angles of tooth 0 of both gears (rad).

        At pinion angle and twist 0 that of the wheel stands half a pitch above the line of centres.
        """
        z1, z2 = self.pinion.mesh.teeth, self.sign * self.wheel.mesh.teeth
        return pinion_angle, self.sign * twist - pinion_angle * z1 / z2 + np.pi + np.pi / z2

    def arcs(self, pinion_angle: float, twist: float) -> MeshingArcs | None:
        """Return the arcs with the teeth that may touch between no twist and `twist`, or None if none do."""
        z1 = self.pinion.mesh.teeth
        central = round(-pinion_angle * z1 / (2 * np.pi))
        near = []
        for pair in range(central - z1 // 2, central - z1 // 2 + z1):
            chains = []
            for gear, centre, angle, tooth in zip(
                self.elastic,
                (0.0, self.wheel_centre),
                self.angles(pinion_angle, twist),
                (pair, -1 - pair),
                strict=True,
            ):
                turned = gear.mesh.points @ rotation(angle + tooth * gear.mesh.pitch).T + np.array([centre, 0.0])
                chains.append(turned[gear.mesh.contact_edges()])
            if all(len(edges) for edges in self._near(chains[0], chains[1], twist)):
                near.append(pair)
        if not near:
            return None
        beside = BESIDE if self.kinematics == "finite" else 0
        every = max(gear.mesh.teeth for gear in self.elastic)
        count = near[-1] - near[0] + 1 + 2 * beside if self.condensed else every
        arcs = [
            arc_of(gear, first - beside, count)
            for gear, first in zip(self.elastic, (near[0], -1 - near[-1]), strict=True)
        ]
        return MeshingArcs(self.elastic, (arcs[0], arcs[1]), tuple(near))

    def problem(
        self, meshing: MeshingArcs, law: ElementLaw, pinion_angle: float, twist: float
    ) -> ContactProblem | None:
        """Return the contact problem of the flanks of arcs that come near each other, or None if none do.

        Parameters
        ----------
        meshing : MeshingArcs
            The teeth that may touch.
        law : ElementLaw
            Law of contact.
        pinion_angle, twist : float
            Rotation of the pinion and twist of the wheel (rad).

        Returns
        -------
        problem : ContactProblem or None
        """
        bodies = meshing.bodies
        unknowns, nodes = bodies.unknowns, bodies.node_of
        turns = np.empty((len(unknowns), 2, 2))
        for of, arc, angle in zip(nodes, meshing.arcs, self.angles(pinion_angle, twist), strict=True):
            turns[of] = rotation(angle + arc.angle)
        places = np.einsum("nij,jn->in", turns, bodies.mesh.doflocs)
        places[0, nodes[1]] += self.wheel_centre
        mesh = bodies.moved(np.ascontiguousarray(places))
        facing = []
        for pair in meshing.pairs:
            chains = meshing.chains(pair)
            near = self._near(places.T[chains[0]], places.T[chains[1]], twist)
            if len(near[0]) and len(near[1]):
                facing.append((Surface(0, chains[0], near[0]), Surface(1, chains[1], near[1])))
        if not facing:
            return None
        rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
        turn = coo_matrix((turns.ravel(), (rows.ravel(), columns.ravel()))).tocsr()
        rims = ("bore", "rim" if self.wheel.mesh.internal else "bore")
        held = [of[np.unique(arc.mesh.boundaries[rim])] for of, arc, rim in zip(nodes, meshing.arcs, rims, strict=True)]
        fixed = unknowns[np.concatenate(held)].ravel()
        return ContactProblem(
            bodies=bodies,
            mesh=mesh,
            facing=tuple(facing),
            law=law,
            width=self.width,
            fixed=fixed,
            values=np.zeros(len(fixed)),
            loads=np.zeros(unknowns.size),
            points_per_edge=self.points_per_edge,
            quadrature=self.quadrature,
            kinematics=self.kinematics,
            stiffness=turn @ bodies.stiffness @ turn.T if self.kinematics == "small" else None,
            remainder=turn @ meshing.remainder @ turn.T,
        )

    def _near(self, pinion: Array, wheel: Array, twist: float) -> tuple[IntArray, IntArray]:
        """Return the edges of two flanks, shapes (e, 3, 2) (m), that the twist can bring together."""
        longest = max(np.linalg.norm(np.ptp(edges, axis=1), axis=-1).max() for edges in (pinion, wheel))
        radius = np.linalg.norm(wheel - [self.wheel_centre, 0.0], axis=-1).max()
        reach = 2 * abs(twist) * max(radius, self.centre_distance) + 2 * longest
        near = [
            np.flatnonzero(KDTree(mate.reshape(-1, 2)).query(edges, distance_upper_bound=reach)[0].min(axis=1) < reach)
            for edges, mate in ((pinion, wheel), (wheel, pinion))
        ]
        return near[0], near[1]


def whole_pair(pair: GearPair, model: PairModel, kinematics: Kinematics = "small") -> WholePair:
    """Mesh both whole gears (or read their sectors from the cache) with the sizes of a model.

    Parameters
    ----------
    pair
        Geometry of the gears.
    model
        Materials, plane state, element sizes and contact points.
    kinematics
        ``small`` or ``finite`` strain.
    """
    check_spur(pair, "the check on whole gears")
    if pair.wheel.rim == "free":
        problem = "leaves the gear without a support: the check on whole gears holds the rim"
        raise InputError("wheel.rim", pair.wheel.rim, problem, "check with a bolted rim")
    gears = pair.pinion, pair.wheel
    recipes = sector_recipes(pair, coarsen=model.coarsen, flank_coarsen=model.mesh_flank_coarsen)
    pinion, wheel = (
        ElasticGear(sector_mesh(gear, recipe), material, model.plane, gear.face_width)
        for gear, recipe, material in zip(gears, recipes, model.materials, strict=True)
    )
    return WholePair(
        pinion,
        wheel,
        pair.working_centre_distance,
        min(gear.face_width for gear in gears),
        model.points_per_edge,
        kinematics=kinematics,
    )
