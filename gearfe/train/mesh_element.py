r"""The gear mesh: a spring and a damper between two shafts along the line of action, or the ideal rigid mesh.

With t the direction of the driver's velocity at the pitch point P, c the unit vector from driver to driven centre and
the working pressure angle :math:`\alpha_w`, the driven gear feels the force

.. math::
    F\,n,\quad n = \cos\alpha_w\,t + \sin\alpha_w\,c,\qquad F = k(\varphi)\,\delta + d\,\dot\delta,\qquad
    \delta = n\cdot\big(u_1(P) - u_2(P)\big) ,

the driver its opposite, u the displacements at P beside rolling: from rotations, housing motion and tilt. F > 0
presses. The phase :math:`\varphi` follows the driver's actual rotation in its driving sense; the derivative of k makes
no force. P lies in the middle of the face that both gears share. A rigid mesh is the constraint :math:`\delta = 0`, F
its multiplier.

What joins later stands apart: a transmission error is a second curve over the phase taken off delta, backlash with
loss of contact a function of delta in place of the product k delta, friction a force along a direction of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gear.pair import GearPair
from ..rigid import Element, LinearJoint
from ..stiffness.periodic import PeriodicInterpolant
from .checks import interpolant
from .elements import LinearForce, RigidShaft
from .law import mesh_block
from .scene import GearMesh, TrainScene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeshLine:
    """Where and how a mesh acts.

    Attributes
    ----------
    name
        ``driver-driven``.
    row : (system size,)
        Approach delta for unit coordinates of the system.
    direction, point : (3,)
        n and P (m).
    curve
        Stiffness over the driver's rotation; None for a rigid mesh.
    mean, damping
        Mean of k (N/m), infinite for a rigid mesh; d (N s/m), the Rayleigh part included.
    driver
        Number of the driver's shaft.
    ratio, sense, phase
        Ratio of the driver's shaft to the drive, its driving sense (+1 or -1), start of the curve (rad).
    module
        m.
    """

    name: str
    row: Array
    direction: Array
    point: Array
    curve: PeriodicInterpolant | None
    mean: float
    damping: float
    driver: int
    ratio: float
    sense: float
    phase: float
    module: float

    def stiffness(self, angle: Array, rest: Array | float = 0.0) -> Array:
        """k (N/m) at rotations `angle` (rad) of the drive, the driver's rotation beside rolling being `rest` (rad)."""
        assert self.curve is not None
        return np.asarray(self.curve(self.sense * (self.ratio * angle + rest) + self.phase).value)

    def element(self, bodies: Sequence[Element]) -> Element:
        """The constant part for the core: mean spring and damper, or the constraint."""
        if self.curve is None:
            return LinearJoint(tuple(bodies), self.row[None, :], np.zeros(1), name=f"mesh {self.name}")
        square = np.outer(self.row, self.row)
        return LinearForce(tuple(bodies), self.damping * square, self.mean * square, f"mesh {self.name}")

    def block(self, direction: int, driver: int) -> Array:
        """The changing part of the spring for the law, along `direction`; `driver` is that of the driver's rotation."""
        assert self.curve is not None
        return mesh_block(direction, driver, self.ratio, self.sense, self.phase, self.mean, self.curve)


def mesh_line(
    scene: TrainScene, mesh: GearMesh, shafts: Sequence[RigidShaft], first: NDArray[np.int64], ratios: Sequence[float],
    size: int, sense: float, phase: float,
) -> MeshLine:  # fmt: skip
    """Line of action of a mesh in a train whose shafts' coordinates begin at `first` of `size`."""
    names = [s.name for s in scene.shafts]
    one, two = scene.gear(mesh.driver), scene.gear(mesh.driven)
    i, j = names.index(one.shaft), names.index(two.shaft)
    a = scene.frame[2]
    pair = GearPair(one.gear, two.gear, mesh.centre_distance)
    alpha = pair.working_pressure_angle
    base = np.array(scene.shaft(one.shaft).point)
    arm = np.array(scene.shaft(two.shaft).point) - base
    arm = arm - (arm @ a) * a
    across = arm / np.linalg.norm(arm)
    line = math.cos(alpha) * sense * np.cross(a, across) + math.sin(alpha) * across
    low = max(g.along - 0.5 * g.gear.face_width for g in (one, two))
    high = min(g.along + 0.5 * g.gear.face_width for g in (one, two))
    point = base + (0.5 * (low + high) - float(base @ a)) * a + pair.pinion_working_radius * across
    row = np.zeros(size)
    row[first[i] : first[i] + 6] += line @ shafts[i].point_rows(point, scene.frame)
    row[first[j] : first[j] + 6] -= line @ shafts[j].point_rows(point, scene.frame)
    curve, mean, damping = None, math.inf, 0.0
    if mesh.stiffness is not None:
        curve = interpolant(mesh)
        mean = mean_value(curve)
        damping = mesh.damping + scene.damping.beta * mean
    return MeshLine(mesh.name, row, line, point, curve, mean, damping, i, ratios[i], sense, phase, one.gear.module)


def mean_value(curve: PeriodicInterpolant) -> float:
    """Mean of a curve over its period: the trapezium rule, and for cubics its correction with the slopes."""
    h = np.diff(curve.nodes)
    area = 0.5 * h @ (curve.values[:-1] + curve.values[1:])
    if curve.method == "cubic":
        area += (h * h / 12.0) @ (curve.slopes[:-1] - curve.slopes[1:])
    return float(area / curve.period)
