"""Two whole gears as a contact problem."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import KDTree

from ....base.errors import InputError
from ....base.typing import Array
from ....fem.plane import Material, Plane
from ...geometry.pair import GearPair
from ...geometry.validity import check_spur
from ...teeth.tooth_sector import SectorMesh, sector_mesh, sector_recipes
from ...teeth.whole_gear import WholeGear, whole_gear
from ..laws import ElementLaw, PairModel
from .bodies import Bodies, ElasticBody
from .constitution import Kinematics
from .problem import ContactProblem, Surface
from .segments import Quadrature

#: Tooth pairs on either side of the one nearest to the line of centres whose flanks are searched for contact.
PAIRS = 3


@dataclass(frozen=True)
class ElasticGear:
    """Sector mesh, material, plane state and face width (m) of a gear."""

    mesh: SectorMesh
    material: Material
    plane: Plane
    thickness: float


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
    """

    pinion: ElasticGear
    wheel: ElasticGear
    centre_distance: float
    width: float
    points_per_edge: int = 4
    quadrature: Quadrature = "points"
    kinematics: Kinematics = "small"

    @property
    def sign(self) -> int:
        """1; -1 for an internal wheel, whose centre lies on the other side and which a twist turns the other way."""
        return -1 if self.wheel.mesh.internal else 1

    @property
    def wheel_centre(self) -> float:
        """x of the wheel's centre (m)."""
        return self.sign * self.centre_distance

    @cached_property
    def gears(self) -> tuple[WholeGear, WholeGear]:
        """Whole meshes of pinion and wheel."""
        return whole_gear(self.pinion.mesh), whole_gear(self.wheel.mesh)

    @cached_property
    def bodies(self) -> Bodies:
        """Both gears, each in the frame of its hub, in one mesh."""
        parts = [
            ElasticBody(
                whole.points, whole.triangles, whole.boundaries, gear.material, gear.plane, thickness=gear.thickness
            )
            for whole, gear in zip(self.gears, (self.pinion, self.wheel), strict=True)
        ]
        return Bodies(tuple(parts))

    def angles(self, pinion_angle: float, twist: float) -> tuple[float, float]:
        """Return the angles of tooth 0 of both gears (rad).

        At pinion angle and twist 0 that of the wheel stands half a pitch above the line of centres.
        """
        z1, z2 = self.pinion.mesh.teeth, self.sign * self.wheel.mesh.teeth
        return pinion_angle, self.sign * twist - pinion_angle * z1 / z2 + np.pi + np.pi / z2

    def problem(self, law: ElementLaw, pinion_angle: float, twist: float) -> ContactProblem | None:
        """Return the contact problem of all flanks that come near each other, or None where none do."""
        unknowns, nodes = self.bodies.unknowns, self.bodies.node_of
        turns = np.empty((len(unknowns), 2, 2))
        for of_gear, angle in zip(nodes, self.angles(pinion_angle, twist), strict=True):
            c, s = np.cos(angle), np.sin(angle)
            turns[of_gear] = [[c, -s], [s, c]]
        places = np.einsum("nij,jn->in", turns, self.bodies.mesh.doflocs)
        places[0, nodes[1]] += self.wheel_centre
        mesh = self.bodies.moved(np.ascontiguousarray(places))
        facing = self._facing(places.T, pinion_angle, twist)
        if not facing:
            return None
        stiffness = None
        if self.kinematics == "small":
            rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
            turn = coo_matrix((turns.ravel(), (rows.ravel(), columns.ravel()))).tocsr()
            stiffness = turn @ self.bodies.stiffness @ turn.T
        rims = ("bore", "rim" if self.wheel.mesh.internal else "bore")
        bores = [of[np.unique(gear.boundaries[rim])] for of, gear, rim in zip(nodes, self.gears, rims, strict=True)]
        fixed = unknowns[np.concatenate(bores)].ravel()
        return ContactProblem(
            bodies=self.bodies,
            mesh=mesh,
            facing=facing,
            law=law,
            width=self.width,
            fixed=fixed,
            values=np.zeros(len(fixed)),
            loads=np.zeros(unknowns.size),
            points_per_edge=self.points_per_edge,
            quadrature=self.quadrature,
            kinematics=self.kinematics,
            stiffness=stiffness,
        )

    def _facing(self, places: Array, pinion_angle: float, twist: float) -> tuple[tuple[Surface, Surface], ...]:
        """Return the flanks that may touch, pinion and wheel of each tooth pair.

        Edges farther apart than the twist reaches get no contact points.
        """
        z1, z2 = self.pinion.mesh.teeth, self.wheel.mesh.teeth
        central = round(-pinion_angle * z1 / (2 * np.pi))
        couples = []
        for k in range(central - PAIRS, central + PAIRS + 1):
            teeth = (self.gears[0].contact[k % z1], self.gears[1].contact[(-1 - k) % z2])
            chains = [of[tooth] for of, tooth in zip(self.bodies.node_of, teeth, strict=True)]
            longest = max(np.linalg.norm(np.ptp(places[edges], axis=1), axis=-1).max() for edges in chains)
            reach = 2 * abs(twist) * self.centre_distance + 2 * longest
            near = [
                np.flatnonzero(KDTree(places[np.unique(mate)]).query(places[edges])[0].min(axis=1) < reach)
                for edges, mate in (chains, chains[::-1])
            ]
            if len(near[0]) and len(near[1]):
                couples.append((Surface(0, chains[0], near[0]), Surface(1, chains[1], near[1])))
        return tuple(couples)


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
