r"""Elements of a train for the rigid core: shaft, hinge, bearing, constant springs and dampers.

Coordinates of a shaft: displacement of its mass centre along x, y, z (m), small tilts about e1 and e2 (rad), and the
rest of its spin about the axis a beside rolling with the drive (rad). A housing has the six coordinates of each bore,
then its internal ones. Forces of second order in the small motions (torque times tilt) are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..rigid import Element, LinearJoint, ModalBlocks
from ..typing import Array
from .inertia import Rotor


@dataclass(frozen=True, eq=False)
class RigidShaft(Element):
    """A shaft with its gears: six coordinates, constant diagonal mass.

    Parameters
    ----------
    rotor
        Mass properties.
    start_rate
        Spin beside rolling at the start (rad/s).
    """

    rotor: Rotor
    start_rate: float = 0.0
    name: str = "shaft"
    size: int = 6

    def mass(self) -> Array:
        """diag(m, m, m, J_t, J_t, J_p)."""
        r = self.rotor
        return np.diag([r.mass, r.mass, r.mass, r.transverse, r.transverse, r.polar])

    def start(self) -> tuple[Array, Array]:
        """At rest but for the spin."""
        return np.zeros(6), np.array([0.0, 0.0, 0.0, 0.0, 0.0, self.start_rate])

    def point_rows(self, point: Array, frame: Array) -> Array:
        """Displacement of a point of the shaft, beside rolling: rows x, y, z on its coordinates, shape (3, 6)."""
        arm = point - self.rotor.centre
        return np.hstack([np.eye(3), np.cross(frame, arm).T])


@dataclass(frozen=True, eq=False)
class LinearForce(Element):
    """Constant springs and dampers between elements: force ``-C v - K q`` on their coordinates, (k, k) each."""

    touches: tuple[Element, ...] = field()
    C: Array = field()
    K: Array = field()
    name: str = "springs and dampers"

    def blocks(self) -> tuple[Array, Array]:
        """(C, K)."""
        return self.C, self.K


def bore_rows(shaft: RigidShaft, point: Array, frame: Array, bore: Array | None) -> Array:
    """Motion of shaft against bore: along e1, a, e2 and tilt about e1, e2; shape (5, 6 or 6 + N).

    Parameters
    ----------
    bore : (N, 6) or None
        Selects the bore's coordinates from the housing's; None for a rigid housing.
    """
    e1, e2, a = frame
    directions = np.array([e1, a, e2])
    moved = shaft.point_rows(point, frame)
    moved[:, 5] = 0.0  # the point is on the axis
    rows = np.zeros((5, 6))
    rows[:3] = directions @ moved
    rows[3, 3] = rows[4, 4] = 1.0
    if bore is None:
        return rows
    other = np.zeros((5, 6))
    other[:3, :3] = directions
    other[3, 3:], other[4, 3:] = e1, e2
    return np.hstack([rows, -other @ bore.T])


def hinge(shaft: RigidShaft, housing: ModalBlocks | None, rows: Array, name: str) -> LinearJoint:
    """Shaft and bore move alike but for the spin: five constraints."""
    touches: tuple[Element, ...] = (shaft,) if housing is None else (shaft, housing)
    return LinearJoint(touches, rows, np.zeros(len(rows)), name=name)


def bearing(
    shaft: RigidShaft, housing: ModalBlocks | None, rows: Array, stiffness: Array, damping: Array, name: str
) -> LinearForce:
    """Springs and dampers along the five rows."""
    touches: tuple[Element, ...] = (shaft,) if housing is None else (shaft, housing)
    return LinearForce(touches, rows.T @ (damping[:, None] * rows), rows.T @ (stiffness[:, None] * rows), name)
