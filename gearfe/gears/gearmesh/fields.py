r"""Displacement and stress on whole gears, recovered from a solved position.

The displacements of each sector come from `gearfe.gears.contact.compliance`. Stresses are those of the elements at
their nodes, averaged over the elements that meet there; they are linear in the displacements, one sparse matrix a gear.

**Beside contacts of the half-plane law.** The elements of a flank are wider than most contacts. As in the influence
function (`gearfe.gears.contact.flank_compliance`), the finite elements therefore carry the force as a bump that they
resolve. This is an elliptic pressure of the same resultant at the same place, whose half width a is two elements. What
the contact's own pressure p does besides is local, and known without a mesh:

.. math:: \sigma = \sigma^{FE}[\text{bump}] + \sigma^{HP}[p] - \sigma^{HP}[\text{bump}]

with the stresses of a half-plane under pressures that are constant on panels :math:`|x-\xi| \le w/2` (Johnson, *Contact
Mechanics*, 1985, eq. 2.30), :math:`\tan\theta_{1,2} = z/(x-\xi\pm\tfrac12 w)` at the depth z,

.. math::
    \sigma_{x,z} = -\tfrac{p}{2\pi}\big(2(\theta_2-\theta_1) \pm (\sin 2\theta_2-\sin 2\theta_1)\big), \qquad
    \tau_{xz} = \tfrac{p}{2\pi}(\cos 2\theta_2-\cos 2\theta_1).

Both pressures have the same resultant at the same place. The stress of their difference falls with the cube of the
distance, so the shape of the tooth hardly affects it. Depths are those below the curved flank. If a contact is wider
than a bump, the elements resolve it. If it is closer to an end of the flank than a, there is no room for a bump. In
both cases nothing is changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.typing import Array, IntArray
from ...fem.plane import physical_gradients, principal_stresses, stress_rows, triangle_shapes, von_mises
from ..contact.compliance import GearBody, MeshingPair, sector_displacements, turn
from ..contact.flank import Flank, edge_nodes, edge_shapes
from ..contact.flank_compliance import BUMP_ELEMENTS, bumps
from ..contact.panels import EDGES
from ..contact.position import FlankLoads, Positions
from ..teeth.whole_gear import WholeGear, whole_gear
from .positions import position_solver

#: Positions solved side by side.
SIDE_BY_SIDE = 8
#: Shares of an elliptic pressure on the panels `EDGES`.
_SHARES = np.diff(EDGES * np.sqrt(1 - EDGES**2) + np.arcsin(EDGES)) / np.pi


def half_plane_stress(x: Array, z: Array, edges: Array, pressure: Array) -> Array:
    """Return the stresses xx, zz, xz (Pa) in a half-plane under constant pressures on panels.

    Parameters
    ----------
    x, z : ndarray, shape (n,)
        Places along the surface, and depths (m).
    edges : ndarray, shape (k + 1,)
        Rising edges of the panels (m).
    pressure : ndarray, shape (k,)
        On them (Pa).

    Returns
    -------
    stress : ndarray, shape (3, n)
        In Pa.
    """
    angle = np.arctan2(z[:, None], x[:, None] - edges)
    parts = 2 * np.diff(angle, axis=1), np.diff(np.sin(2 * angle), axis=1), np.diff(np.cos(2 * angle), axis=1)
    even, odd, shear = (part @ pressure / (2 * np.pi) for part in parts)
    return np.stack([-even - odd, -even + odd, shear])


def bumped(body: GearBody, position: Positions, gear: int) -> tuple[FlankLoads, list[tuple[int, Array]]]:
    """Loads of one gear at one position with bumps instead of narrow contacts, and what these make of the stresses.

    Returns
    -------
    loads
        For the finite elements.
    local : list of (int, ndarray of shape (3, nodes))
        Of each contact its tooth, and the stresses xx, yy, xy (Pa) at the nodes of its sector, tooth axes.
    """
    loads, contacts = position.loads[gear], position.contacts
    local: list[tuple[int, Array]] = []
    force = loads.force.copy()
    for k in range(len(contacts) if contacts.x.size else 0):  # contacts on the mesh are resolved by it
        flank, load = body.flank, contacts.pressure[k] * contacts.width[k]
        centre = float(contacts.panel_arc[k, gear] @ load / load.sum())
        edge = int(flank.place(np.array(centre))[0])
        half = BUMP_ELEMENTS * float(flank.sizes[edge])
        if half <= contacts.half_width[k] or not flank.ends[0] + half < centre < flank.ends[-1] - half:
            continue
        nodal = force[k].view(complex)
        total = nodal.sum()
        nodal[:] = total * bumps(flank, np.array([[centre]]), np.array([[half]]))[0]
        line = abs(total) / body.thickness
        way = 1 if gear == 0 else -1  # the panels run against the wheel's flank
        places = way * contacts.x[k][::way]
        own = contacts.pressure[k][::way], contacts.width[k][::way]
        edges = np.append(places - 0.5 * own[1], places[-1] + 0.5 * own[1][-1])
        bump = line * _SHARES / (half * np.diff(EDGES))
        x, z, tangent = flank_frame(body.flank, body.mesh.points, centre)
        stress = half_plane_stress(x, z, edges, own[0] * line / load.sum())
        stress -= half_plane_stress(x, z, half * EDGES, bump)
        stress[2] = -stress[2]  # y out of the material
        local.append((int(loads.tooth[k]), turned_stress(stress, tangent.real, tangent.imag)))
    return replace(loads, force=force), local


def flank_frame(flank: Flank, nodes: Array, centre: float) -> tuple[Array, Array, complex]:
    """Return places along the flank's tangent at an arc and depths below the flank, and the tangent towards the tip.

    Parameters
    ----------
    flank : Flank
        The flank.
    nodes : ndarray, shape (n, 2)
        Points of its tooth, in its axes (m).
    centre : float
        Arc length (m).
    """
    points = nodes @ np.array([1, 1j])
    edge, xi = flank.place(np.array([centre]))
    value, slope, _ = edge_shapes(xi)
    corners = (flank.points @ np.array([1, 1j]))[edge_nodes(edge)][0]
    origin, along = value[0] @ corners, slope[0] @ corners
    tangent = complex(along / abs(along))
    seen, surface = (points - origin) / tangent, (flank.points @ np.array([1, 1j]) - origin) / tangent
    order = np.argsort(surface.real)
    depth = np.interp(seen.real, surface.real[order], surface.imag[order]) - seen.imag
    return seen.real, np.maximum(depth, 0.0), tangent


def turned_stress(stress: Array, c: Array | float, s: Array | float) -> Array:
    """Components xx, yy, xy of plane stresses in axes turned by the angle of cosine c and sine s, shape (3, ...)."""
    xx, yy, xy = stress
    one, other = c * c * xx + s * s * yy - 2 * c * s * xy, s * s * xx + c * c * yy + 2 * c * s * xy
    return np.stack([one, other, c * s * (xx - yy) + (c * c - s * s) * xy])


@dataclass(frozen=True)
class FlankPressure:
    """Pressure along one tooth's contact surface; arrays have one entry per contact point or panel, from root to tip.

    Attributes
    ----------
    gear
        0 pinion, 1 wheel.
    pair, tooth
        Number of the tooth pair, and of the tooth.
    place : ndarray, shape (q,)
        Edge number plus position in the edge, along the tooth's whole contact surface.
    radius : ndarray, shape (q,)
        Distance of the undeformed point from the gear's centre (m).
    pressure : ndarray, shape (q,)
        Pa.
    """

    gear: int
    pair: int
    tooth: int
    place: Array
    radius: Array
    pressure: Array

    @property
    def shown(self) -> IntArray:
        """Contact points with pressure and one neighbour on either side."""
        carries = self.pressure > 0
        near = carries.copy()
        near[1:] |= carries[:-1]
        near[:-1] |= carries[1:]
        return np.flatnonzero(near)

    def at_nodes(self, count: int) -> Array:
        """Pressure (Pa) at the `count` nodes of the tooth's contact surface, linear between the contact points."""
        return np.asarray(np.interp(0.5 * np.arange(count), self.place, self.pressure, left=0.0, right=0.0))


def flank_pressures(pair: MeshingPair, position: Positions) -> list[FlankPressure]:
    """Pressure on each loaded flank of one solved position."""
    made: list[FlankPressure] = []
    points = position.points
    for gear, number in dict.fromkeys(zip(points.gear.tolist(), points.pair.tolist(), strict=True)):
        mine = np.flatnonzero((points.gear == gear) & (points.pair == number))
        mine = mine[np.argsort(points.place[mine], kind="stable")]
        radius = np.linalg.norm(_points(pair.bodies[gear].flank, points.place[mine]), axis=1)
        tooth = number if gear == 0 else -1 - number
        made.append(FlankPressure(gear, number, tooth, points.place[mine], radius, points.pressure[mine]))
    return made


def _points(flank: Flank, place: Array) -> Array:
    """Points (m) of a tooth's contact surface, shape (q, 2)."""
    edge = np.clip(place.astype(np.int64), 0, flank.edges - 1)
    shapes = edge_shapes(place - edge)[0]
    return np.asarray(np.einsum("qa,qai->qi", shapes, flank.points[edge_nodes(edge)]))


@dataclass(frozen=True)
class GearField:
    """Fields on one whole gear in a position of the pair.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Undeformed nodes, turned with their gear (m).
    triangles : ndarray, shape (m, 6)
        Second-order triangles, see `gearfe.gears.teeth.whole_gear.WholeGear`.
    displacement : ndarray, shape (n, 2)
        Elastic displacement against the rigid hub, global axes (m).
    stress : ndarray, shape (n, 4)
        xx, yy, zz, xy in global axes, averaged at the nodes (Pa).
    pressure : ndarray, shape (n,)
        Contact pressure (Pa), 0 away from the contact.
    """

    points: Array
    triangles: IntArray
    displacement: Array
    stress: Array
    pressure: Array

    @property
    def von_mises(self) -> Array:
        """Von Mises stress at the nodes (Pa)."""
        return von_mises(self.stress)

    @property
    def principal(self) -> tuple[Array, Array, Array]:
        """Principal stresses sigma_1 >= sigma_2 >= sigma_3 at the nodes (Pa); one of them acts along the axis."""
        return principal_stresses(self.stress)


@dataclass(frozen=True)
class GearRecovery:
    """Fields of one elastic gear; `at` gives them for one position."""

    body: GearBody

    @cached_property
    def whole(self) -> WholeGear:
        """Its whole mesh."""
        return whole_gear(self.body.mesh)

    @cached_property
    def elements(self) -> IntArray:
        """Number of elements that meet at each node of the whole gear, shape (n,)."""
        return np.bincount(self.whole.triangles.ravel(), minlength=len(self.whole.points))

    @cached_property
    def stress_rows(self) -> Any:
        """Sums over the elements at each sector node of the stresses xx, yy, xy (Pa/m), sparse, shape (3 s, 2 s)."""
        from scipy.sparse import csr_array

        mesh = self.body.mesh
        r = np.array([0.0, 1.0, 0.0, 0.5, 0.5, 0.0])
        s = np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.5])
        gradients, _ = physical_gradients(mesh.points[mesh.triangles], triangle_shapes(r, s)[1])  # (m, 6 places, 6, 2)
        rows = stress_rows(gradients, self.body.material, self.body.plane)
        row = 3 * mesh.triangles[:, :, None, None, None] + np.arange(3)[:, None, None]
        column = 2 * mesh.triangles[:, None, None, :, None] + np.arange(2)
        row, column = np.broadcast_arrays(row, column)
        size = len(mesh.points)
        return csr_array((rows.ravel(), (row.ravel(), column.ravel())), shape=(3 * size, 2 * size))

    def at(self, pair: MeshingPair, gear: int, position: Positions) -> GearField:
        """Fields at a converged position of the pair whose pinion (0) or wheel (1) it is."""
        body, whole = self.body, self.whole
        numbers = np.array(whole.numbers)  # (z, s)
        angle = pair.tooth_angle(gear, 0, position.pinion_angle, position.twist)
        teeth = body.teeth
        every = np.arange(teeth)
        local = sector_displacements(body, position.loads[gear], np.zeros_like(every), every)  # (s, 2, z)
        turns = angle + body.mesh.pitch * np.arange(teeth)
        c, s = np.cos(turns), np.sin(turns)
        x, y = local[:, 0], local[:, 1]
        displacement = np.empty((len(whole.points), 2))
        displacement[numbers.T] = np.stack([c * x - s * y, s * x + c * y], axis=-1)
        loads, beside = bumped(body, position, gear)
        if beside:
            local = sector_displacements(body, loads, np.zeros_like(every), every)
        sums = (self.stress_rows @ local.reshape(-1, teeth)).reshape(-1, 3, teeth)
        counts = self.elements[numbers]
        for tooth, stress in beside:
            sums[:, :, tooth % teeth] += counts[tooth % teeth][:, None] * stress.T
        turned = turned_stress(sums.swapaxes(0, 1), c, s)
        total = [np.bincount(numbers.T.ravel(), part.ravel(), len(whole.points)) / self.elements for part in turned]
        held = body.material.poisson_ratio if body.plane == "strain" else 0.0
        points = whole.points @ turn(angle).T + [gear * pair.wheel_centre, 0.0]
        stress = np.stack([total[0], total[1], held * (total[0] + total[1]), total[2]], axis=1)
        pressure = np.zeros(len(points))
        for one in flank_pressures(pair, position):
            if one.gear == gear:
                nodes = numbers[one.tooth % teeth][body.flank.nodes]
                pressure[nodes] = np.maximum(pressure[nodes], one.at_nodes(len(nodes)))
        return GearField(points, whole.triangles, displacement, stress, pressure)


def field_recovery(pair: MeshingPair) -> Callable[[Positions], tuple[GearField, GearField]]:
    """What gives the fields of pinion and wheel at a converged position."""
    pinion, wheel = (GearRecovery(body) for body in pair.bodies)
    return lambda position: (pinion.at(pair, 0, position), wheel.at(pair, 1, position))


def solved_fields(
    pair: MeshingPair, angles: Array, twists: Array
) -> Iterator[tuple[Positions, tuple[GearField, GearField]]]:
    """Positions at pinion angles and twists (rad) with their fields; one that does not converge is left out."""
    solver, fields = position_solver(pair), field_recovery(pair)
    for first in range(0, len(angles), SIDE_BY_SIDE):
        part = slice(first, first + SIDE_BY_SIDE)
        for position in solver.solve(angles[part], twists[part], kept=np.arange(SIDE_BY_SIDE)):
            if position.status == "converged":
                yield position, fields(position)


def straight_triangles(triangles: IntArray) -> IntArray:
    """Four straight triangles for each second-order one, shape (4 m, 3)."""
    parts = triangles[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]]
    return parts.reshape(-1, 3)
