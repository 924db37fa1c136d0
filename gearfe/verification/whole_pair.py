"""Two whole gears as a contact problem of the verification route."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.closest import chains_of, nearest_places, project
from ..contact.flank import edge_shapes, gauss_rule
from ..elasticity import Material, Plane
from ..meshing.tooth_sector import SectorMesh
from ..meshing.whole_gear import WholeGear, whole_gear
from .bodies import Bodies, ElasticBody
from .constitution import Kinematics
from .laws import ContactLaw
from .problem import ContactProblem, Surface, edge_lengths
from .segments import Quadrature

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
    points_per_edge
        Gauss points on each contact edge, or on each of its segments.
    quadrature
        ``points`` or ``segments``.
    kinematics
        ``small`` or ``finite`` strain (Saint Venant-Kirchhoff).
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
        return Bodies(
            tuple(
                ElasticBody(
                    whole.points,
                    whole.triangles,
                    whole.boundaries,
                    gear.material,
                    gear.plane,
                    thickness=gear.thickness,
                )
                for whole, gear in zip(self.gears, (self.pinion, self.wheel), strict=True)
            )
        )

    @property
    def node_of(self) -> tuple[IntArray, ...]:
        """scikit-fem's number of each gear's nodes."""
        return self.bodies.node_of

    @property
    def unknowns(self) -> IntArray:
        """Unknowns of each node of the scikit-fem mesh (in its numbering), shape (n, 2)."""
        return self.bodies.unknowns

    @property
    def hub_stiffness(self) -> Any:
        """Stiffness of both gears in their hubs' frames, from the scikit-fem form (N/m)."""
        return self.bodies.stiffness

    def angles(self, pinion_angle: float, twist: float) -> tuple[float, float]:
        """Angles of both gears' tooth 0 (rad): the wheel's stands half a pitch above the line of centres at 0."""
        z1, z2 = self.pinion.mesh.teeth, self.wheel.mesh.teeth
        return pinion_angle, twist - pinion_angle * z1 / z2 + np.pi + np.pi / z2

    def _turns(self, pinion_angle: float, twist: float) -> Array:
        """Rotation matrix of each node, shape (n, 2, 2)."""
        turns = np.empty((len(self.unknowns), 2, 2))
        for nodes, angle in zip(self.node_of, self.angles(pinion_angle, twist), strict=True):
            c, s = np.cos(angle), np.sin(angle)
            turns[nodes] = [[c, -s], [s, c]]
        return turns

    def mesh_at(self, pinion_angle: float, twist: float) -> Any:
        """Both gears in their present places."""
        places = np.einsum("nij,jn->in", self._turns(pinion_angle, twist), self.bodies.mesh.doflocs)
        places[0, self.node_of[1]] += self.centre_distance
        return self.bodies.moved(np.ascontiguousarray(places))

    def stiffness_at(self, pinion_angle: float, twist: float) -> Any:
        """Stiffness in global axes (N/m)."""
        from scipy.sparse import coo_matrix

        rows = np.broadcast_to(self.unknowns[:, :, None], (len(self.unknowns), 2, 2))
        columns = rows.transpose(0, 2, 1)
        turn = coo_matrix((self._turns(pinion_angle, twist).ravel(), (rows.ravel(), columns.ravel()))).tocsr()
        return turn @ self.hub_stiffness @ turn.T

    def problem(self, law: ContactLaw, pinion_angle: float, twist: float) -> ContactProblem | None:
        """Contact problem of all flanks that come near each other, or None when none do."""
        mesh = self.mesh_at(pinion_angle, twist)
        places = mesh.doflocs.T
        reach = 2 * abs(twist) * float(np.linalg.norm(places - [self.centre_distance, 0], axis=1).max())
        facing = []
        for one, two in self._couples(places, pinion_angle, twist):
            surfaces = []
            for gear, edges, mate in ((0, one, two), (1, two, one)):
                size = edge_lengths(places[edges], self.points_per_edge).max()
                near = _distance(_points_on(places[edges]), places[np.unique(mate)]).min(axis=1) < reach + size
                surfaces.append(Surface(gear, edges, near))
            facing.append((surfaces[0], surfaces[1]))
        if not any(surface.near.any() for couple in facing for surface in couple):
            return None
        bores = [n[np.unique(g.boundaries["bore"])] for n, g in zip(self.node_of, self.gears, strict=True)]
        fixed = self.unknowns[np.concatenate(bores)].ravel()
        return ContactProblem(
            bodies=self.bodies,
            mesh=mesh,
            facing=tuple(facing),
            law=law,
            width=self.width,
            fixed=fixed,
            values=np.zeros(len(fixed)),
            loads=np.zeros(self.unknowns.size),
            points_per_edge=self.points_per_edge,
            quadrature=self.quadrature,
            kinematics=self.kinematics,
            stiffness=self.stiffness_at(pinion_angle, twist) if self.kinematics == "small" else None,
            skins=tuple((k, k, self.node_of[k][g.contact].reshape(-1, 3)) for k, g in enumerate(self.gears)),
        )

    def _couples(self, places: Array, pinion_angle: float, twist: float) -> list[tuple[IntArray, IntArray]]:
        """Flanks that may touch, the pinion's and the wheel's of each tooth pair: contact edges (mesh nodes)."""
        z1, z2 = self.pinion.mesh.teeth, self.wheel.mesh.teeth
        central = round(-pinion_angle * z1 / (2 * np.pi))
        found = []
        for k in range(central - 3, central + 4):
            edges1 = self.node_of[0][self.gears[0].contact[k % z1]]
            edges2 = self.node_of[1][self.gears[1].contact[(-1 - k) % z2]]
            longest = np.linalg.norm(np.ptp(places[edges1], axis=1), axis=-1).max()
            reach = 2 * abs(twist) * self.centre_distance + longest
            if _distance(places[edges1[:, 1]][:, None], places[edges2.ravel()]).min() < reach:
                found.append((edges1, edges2))
        return found

    def rigid_overlap(self, problem: ContactProblem) -> bool:
        """Whether the undeformed flanks overlap at any of their nodes."""
        places = problem.mesh.doflocs.T
        for one, two in problem.facing:
            points, nodes = places[np.unique(one.edges)], places[two.nodes]
            chain = chains_of(nodes, np.array([len(two.edges)]), np.zeros(len(points), dtype=np.int64))
            if (project(points, chain, nearest_places(points, nodes)).gap < 0).any():
                return True
        return False


def _points_on(corners: Array, count: int = 4) -> Array:
    """Points on edges, shape (e, 3, 2): shape (e, count, 2)."""
    return np.asarray(np.einsum("qa,eai->eqi", edge_shapes(gauss_rule(count)[0])[0], corners))


def _distance(points: Array, nodes: Array) -> Array:
    """Distance to the nearest of `nodes`, shape (k, 2), of points, shape (a, b, 2)."""
    apart = points[:, :, None, :] - nodes
    return np.sqrt(np.min(apart[..., 0] ** 2 + apart[..., 1] ** 2, axis=-1))
