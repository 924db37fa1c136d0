"""Two whole gears as a contact problem."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import KDTree

from gearfe.contact.laws import ElementLaw
from gearfe.elasticity import Material, Plane
from gearfe.meshing.tooth_sector import SectorMesh
from gearfe.meshing.whole_gear import WholeGear, whole_gear
from gearfe.typing import Array

from .bodies import Bodies, ElasticBody
from .constitution import Kinematics
from .problem import ContactProblem, Surface
from .segments import Quadrature


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
        a (m).
    width
        Common face width (m).
    points_per_edge, quadrature, kinematics
        As in `tests.verification.problem.ContactProblem`.
    """

    pinion: ElasticGear
    wheel: ElasticGear
    centre_distance: float
    width: float
    points_per_edge: int = 4
    quadrature: Quadrature = "points"
    kinematics: Kinematics = "small"

    @cached_property
    def gears(self) -> tuple[WholeGear, WholeGear]:
        """Whole meshes of pinion and wheel."""
        return whole_gear(self.pinion.mesh), whole_gear(self.wheel.mesh)

    @cached_property
    def bodies(self) -> Bodies:
        """Both gears, each in its hub's frame, in one mesh."""
        parts = [
            ElasticBody(
                whole.points, whole.triangles, whole.boundaries, gear.material, gear.plane, thickness=gear.thickness
            )
            for whole, gear in zip(self.gears, (self.pinion, self.wheel), strict=True)
        ]
        return Bodies(tuple(parts))

    def angles(self, pinion_angle: float, twist: float) -> tuple[float, float]:
        """Angles of both gears' tooth 0 (rad): the wheel's stands half a pitch above the line of centres at 0."""
        z1, z2 = self.pinion.mesh.teeth, self.wheel.mesh.teeth
        return pinion_angle, twist - pinion_angle * z1 / z2 + np.pi + np.pi / z2

    def problem(self, law: ElementLaw, pinion_angle: float, twist: float) -> ContactProblem | None:
        """Contact problem of all flanks that come near each other, or None when none do."""
        unknowns, nodes = self.bodies.unknowns, self.bodies.node_of
        turns = np.empty((len(unknowns), 2, 2))
        for own, angle in zip(nodes, self.angles(pinion_angle, twist), strict=True):
            c, s = np.cos(angle), np.sin(angle)
            turns[own] = [[c, -s], [s, c]]
        places = np.einsum("nij,jn->in", turns, self.bodies.mesh.doflocs)
        places[0, nodes[1]] += self.centre_distance
        mesh = self.bodies.moved(np.ascontiguousarray(places))
        facing = self._facing(places.T, pinion_angle, twist)
        if not facing:
            return None
        stiffness = None
        if self.kinematics == "small":
            rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
            turn = coo_matrix((turns.ravel(), (rows.ravel(), columns.ravel()))).tocsr()
            stiffness = turn @ self.bodies.stiffness @ turn.T
        bores = [own[np.unique(gear.boundaries["bore"])] for own, gear in zip(nodes, self.gears, strict=True)]
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
            skins=tuple((k, k, nodes[k][gear.contact].reshape(-1, 3)) for k, gear in enumerate(self.gears)),
        )

    def _facing(self, places: Array, pinion_angle: float, twist: float) -> tuple[tuple[Surface, Surface], ...]:
        """Flanks that may touch, pinion and wheel of each tooth pair; edges farther apart than the twist reaches stay
        without contact points."""
        z1, z2 = self.pinion.mesh.teeth, self.wheel.mesh.teeth
        central = round(-pinion_angle * z1 / (2 * np.pi))
        couples = []
        for k in range(central - 3, central + 4):
            teeth = (self.gears[0].contact[k % z1], self.gears[1].contact[(-1 - k) % z2])
            chains = [own[tooth] for own, tooth in zip(self.bodies.node_of, teeth, strict=True)]
            longest = max(np.linalg.norm(np.ptp(places[edges], axis=1), axis=-1).max() for edges in chains)
            reach = 2 * abs(twist) * self.centre_distance + 2 * longest
            near = [
                np.flatnonzero(KDTree(places[np.unique(mate)]).query(places[edges])[0].min(axis=1) < reach)
                for edges, mate in (chains, chains[::-1])
            ]
            if len(near[0]) and len(near[1]):
                couples.append((Surface(0, chains[0], near[0]), Surface(1, chains[1], near[1])))
        return tuple(couples)
