r"""Displacement and stress on whole gears, recovered from a solved position.

The displacements of each sector come from `gearfe.contact.recovery`. Stresses are those of the elements at
their nodes, averaged over the elements that meet there; they are linear in the displacements, one sparse matrix a gear.
Beside contacts of the half-plane law that are narrower than its elements, they are those of `.contact_stress`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..contact.compliance import GearBody
from ..contact.position import Positions
from ..contact.recovery import sector_displacements
from ..contact.scene import MeshingPair, turn
from ..elasticity import physical_gradients, principal_stresses, triangle_shapes, von_mises
from ..meshing.whole_gear import WholeGear, whole_gear
from ..typing import Array, IntArray
from .contact_stress import bumped
from .flank_pressure import flank_pressures


@dataclass(frozen=True)
class GearField:
    """Fields on one whole gear in a position of the pair.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Undeformed nodes, turned with their gear (m).
    triangles : ndarray, shape (m, 6)
        Second-order triangles, see `gearfe.meshing.whole_gear.WholeGear`.
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
    """What recovering fields of one gear needs beyond its body.

    Attributes
    ----------
    body
        The elastic gear.
    whole
        Its whole mesh.
    stress_rows : sparse matrix, shape (3 s, 2 s)
        Sums over the elements at each sector node of the stresses xx, yy, xy (Pa/m).
    elements : ndarray, shape (n,)
        Number of elements that meet at each node of the whole gear.
    """

    body: GearBody
    whole: WholeGear
    stress_rows: Any
    elements: IntArray


def gear_recovery(body: GearBody) -> GearRecovery:
    """Prepare the recovery of fields for one gear."""
    whole = whole_gear(body.mesh)
    counts = np.bincount(whole.triangles.ravel(), minlength=len(whole.points))
    return GearRecovery(body, whole, _stress_rows(body), counts)


def _stress_rows(body: GearBody) -> Any:
    from scipy.sparse import csr_array

    mesh = body.mesh
    lam, mu = body.material.lame(body.plane)
    r = np.array([0.0, 1.0, 0.0, 0.5, 0.5, 0.0])
    s = np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.5])
    gradients, _ = physical_gradients(mesh.points[mesh.triangles], triangle_shapes(r, s)[1])  # (m, 6 places, 6, 2)
    x, y = gradients[..., 0], gradients[..., 1]
    stiff = lam + 2 * mu
    rows = np.stack(
        [np.stack([stiff * x, lam * y], -1), np.stack([lam * x, stiff * y], -1), np.stack([mu * y, mu * x], -1)], axis=2
    )  # (m, 6 places, 3 stresses, 6 nodes, 2)
    size = len(mesh.points)
    node = mesh.triangles
    row = 3 * node[:, :, None, None, None] + np.arange(3)[:, None, None]
    column = 2 * node[:, None, None, :, None] + np.arange(2)
    row, column = np.broadcast_arrays(row, column)
    return csr_array((rows.ravel(), (row.ravel(), column.ravel())), shape=(3 * size, 2 * size))


def gear_field(recovery: GearRecovery, pair: MeshingPair, position: Positions, angle: float, gear: int) -> GearField:
    """Fields of one gear.

    Parameters
    ----------
    position
        A converged position.
    angle
        Angle (rad) of the frame of tooth 0 of this gear.
    gear
        0 pinion, 1 wheel.
    """
    body, whole = recovery.body, recovery.whole
    teeth = body.teeth
    every = np.arange(teeth)
    local = sector_displacements(body, position.loads[gear], np.zeros_like(every), every)  # (s, 2, z)
    turns = angle + 2 * np.pi * np.arange(teeth) / teeth
    c, s = np.cos(turns), np.sin(turns)
    x, y = local[:, 0], local[:, 1]
    displacement = np.empty((len(whole.points), 2))
    displacement[whole.numbers.T] = np.stack([c * x - s * y, s * x + c * y], axis=-1)
    loads, beside = bumped(body, position, gear)
    if beside:
        local = sector_displacements(body, loads, np.zeros_like(every), every)
    sums = (recovery.stress_rows @ local.reshape(-1, teeth)).reshape(-1, 3, teeth)
    counts = recovery.elements[whole.numbers]
    for tooth, stress in beside:
        sums[:, :, tooth % teeth] += counts[tooth % teeth][:, None] * stress.T
    xx, yy, xy = sums[:, 0], sums[:, 1], sums[:, 2]
    turned = np.stack(
        [
            c * c * xx + s * s * yy - 2 * c * s * xy,
            s * s * xx + c * c * yy + 2 * c * s * xy,
            c * s * (xx - yy) + (c * c - s * s) * xy,
        ]
    )
    numbers = whole.numbers.T.ravel()
    total = [np.bincount(numbers, part.ravel(), len(whole.points)) / recovery.elements for part in turned]
    across = body.material.poisson_ratio * (total[0] + total[1]) if body.plane == "strain" else np.zeros(len(total[0]))
    points = whole.points @ turn(angle).T + pair.centre(gear)
    stress = np.stack([total[0], total[1], across, total[2]], axis=1)
    pressure = np.zeros(len(points))
    for one in flank_pressures(pair, position):
        if one.gear == gear:
            nodes = whole.numbers[one.tooth % teeth][body.flank.nodes]
            pressure[nodes] = np.maximum(pressure[nodes], one.at_nodes(len(nodes)))
    return GearField(points, whole.triangles, displacement, stress, pressure)


@dataclass(frozen=True)
class PairRecovery:
    """Fields on both gears of a pair; `at` gives them for one position."""

    pair: MeshingPair
    gears: tuple[GearRecovery, GearRecovery]

    def at(self, position: Positions, pinion_angle: float, twist: float) -> tuple[GearField, GearField]:
        """Fields of pinion and wheel.

        Parameters
        ----------
        position
            The solution at `pinion_angle` and `twist` (in all, lost motion included).
        """
        angles = [self.pair.tooth_angle(gear, 0, pinion_angle, twist) for gear in (0, 1)]
        pinion, wheel = (gear_field(self.gears[g], self.pair, position, angles[g], g) for g in (0, 1))
        return pinion, wheel


def pair_recovery(pair: MeshingPair) -> PairRecovery:
    """Prepare the recovery of fields for a pair."""
    pinion, wheel = (gear_recovery(body) for body in pair.bodies)
    return PairRecovery(pair, (pinion, wheel))


def straight_triangles(triangles: IntArray) -> IntArray:
    """Four straight triangles for each second-order one, shape (4 m, 3)."""
    parts = triangles[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]]
    return parts.reshape(-1, 3)
