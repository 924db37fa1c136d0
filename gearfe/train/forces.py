r"""All forces of a train that are not constant matrices, along few directions: one formulation for many times at once.

The motion is split into rolling and a small rest: the rotation of a shaft is :math:`g\,\psi(t) + u`, psi the drive's
angle, g the shaft's ratio to it, u a coordinate. With u, u' along the directions, the forces are

- of a *flank with a stiffness curve*: along the approach d, :math:`-(k(\varphi)\,(u_d - j) - k_0 u_d)` with
  :math:`\varphi = s\,(g\psi + u_r) + \varphi_0` and r the driver's rotation. The part with the mean :math:`k_0` stands
  in the system's stiffness. A flank that may part bears where :math:`u_d > j`;
- of a *flank with a mesh law* (`gearfe.meshlaw.law`): :math:`-(F\,\langle 1 + \chi u_d'\rangle - k_0 u_d)` along d, and
  :math:`-s M` along r, the driver's rotation relative to the line of centres; with *friction* (`gearfe.train.friction`)
  :math:`-\sum\mu N_k s(v_k/v_0)` across the line of action, and that times :math:`e_k` along the driver's turn
  against the driven gear;
- *gyroscopic*: :math:`-J_p\Omega\,(u_{d+1}', -u_d')`, :math:`\Omega = g\psi' + u_{d+2}'`, on the tilts d, d + 1 of a
  shaft with the spin d + 2;
- *torques*: functions of time along a direction.

A mesh has one flank, or two: the back flank has its own approach, along the other line of action, and its law is
the driving one's at the mirrored phase, behind the backlash j.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from ..meshlaw.law import MeshLaw
from ..rigid.timefunctions import TimeFunction
from ..stiffness.periodic import PeriodicInterpolant
from ..typing import Array, BoolArray
from .friction import Sliding, smooth_sign


class Drag(NamedTuple):
    """Friction of a flank: force across the line of action (N), its moment about the pitch point (N m), the power that
    it takes (W)."""

    across: Array
    turning: Array
    power: Array


class FlankForces(NamedTuple):
    """Forces of a flank at n times, (n,) each: along the approach (N), damping included; of a law the moment on the
    phase (N m), and its friction."""

    force: Array
    moment: Array | None = None
    drag: Drag | None = None


@dataclass(frozen=True, eq=False)
class MeshFlank(ABC):
    """One side of a mesh.

    Attributes
    ----------
    direction, turn
        Numbers of the approach and of the driver's rotation among the directions.
    ratio, sense, phase
        The phase is ``sense (ratio psi + u[turn]) + phase`` (rad).
    mean
        Stiffness (N/m) that the system's constant part has along the approach already.
    gap
        Approach (m) at which unmodified flanks touch.
    """

    direction: int
    turn: int
    ratio: float
    sense: float
    phase: float
    mean: float
    gap: float

    @abstractmethod
    def forces(self, angle: Array, rate: Array, u: Array, du: Array) -> FlankForces:
        """Forces at rotations of the drive (rad) and their rates, (n,), u and du of shape (n, directions)."""

    @abstractmethod
    def bears(self, phase: Array, approach: Array) -> BoolArray:
        """Whether its teeth touch at phases (rad) and approaches beyond the gap (m), (n,)."""

    def phase_and_approach(self, angle: Array, u: Array) -> tuple[Array, Array]:
        """Phase (rad) and approach beyond the gap (m), u of shape (n, directions)."""
        return self.sense * (self.ratio * angle + u[:, self.turn]) + self.phase, u[:, self.direction] - self.gap


@dataclass(frozen=True, eq=False)
class CurveFlank(MeshFlank):
    """Force k(phase) times approach; where `parts`, none before the touch."""

    damping: ClassVar[float] = 0.0
    rayleigh: ClassVar[float] = 0.0
    sliding: ClassVar[None] = None
    curve: PeriodicInterpolant
    parts: bool

    def forces(self, angle: Array, rate: Array, u: Array, du: Array) -> FlankForces:  # noqa: ARG002
        """Forces at rotations of the drive (rad) and their rates, (n,), u and du of shape (n, directions)."""
        phase, approach = self.phase_and_approach(angle, u)
        force = self.curve(phase).value * approach
        return FlankForces(np.maximum(force, 0.0) if self.parts else force)

    def bears(self, phase: Array, approach: Array) -> BoolArray:  # noqa: ARG002
        """Whether its teeth touch at phases (rad) and approaches beyond the gap (m), (n,)."""
        return np.asarray((approach > 0.0) | (not self.parts))


@dataclass(frozen=True, eq=False)
class LawFlank(MeshFlank):
    """A mesh law; `damping` is chi (s/m), `sliding` its friction or None.

    `shifts`, shape (L,), is the approach (m) by which tooth pair k touches later, k taken modulo L: its pitch errors.
    `rayleigh` (N s/m) is what the system's constant part damps along the approach already.
    """

    law: MeshLaw
    damping: float
    sliding: Sliding | None = None
    shifts: Array = field(default_factory=lambda: np.zeros(1))
    rayleigh: float = 0.0

    def bears(self, phase: Array, approach: Array) -> BoolArray:
        """Whether its teeth touch at phases (rad) and approaches beyond the gap (m), (n,)."""
        return np.asarray(approach > self.law.touching(phase, self.shifts_at(phase)))

    def shifts_at(self, phase: Array) -> Array:
        """Shifts (m) of the pairs in the law's slots at phases (n,), shape (n, slots)."""
        return np.asarray(self.shifts[self.law.pair_numbers(phase) % len(self.shifts)])

    def forces(self, angle: Array, rate: Array, u: Array, du: Array) -> FlankForces:
        """Forces at rotations of the drive (rad) and their rates, (n,), u and du of shape (n, directions)."""
        phase, approach = self.phase_and_approach(angle, u)
        made = self.law(phase, approach, self.shifts_at(phase))
        presses = np.maximum(1.0 + self.damping * du[:, self.direction], 0.0)
        one = self.sliding
        if one is None:
            return FlankForces(made.force * presses, made.moment)
        e = one.radius * (self.law.pair_phases(phase) - one.pitch_phase)
        spin = one.ratio * rate + du[:, one.spin]
        speed = du[:, one.across, None] + e * spin[:, None]
        drag = one.coefficient * made.pair_forces * presses[:, None] * smooth_sign(speed / one.speed)[0]
        friction = Drag(*(np.asarray((drag * arm).sum(axis=1)) for arm in (1.0, e, speed)))
        return FlankForces(made.force * presses, made.moment, friction)


Flank = CurveFlank | LawFlank


@dataclass(frozen=True)
class Gyro:
    """Gyroscopic moments on the tilts `direction` and the one after it; `polar` in kg m2."""

    direction: int
    ratio: float
    polar: float


@dataclass(frozen=True, eq=False)
class TrainForces:
    """The forces along `size` directions.

    Attributes
    ----------
    angle
        psi, rotation of the drive (rad).
    gyros, flanks
        What depends on the motion.
    torques
        Pairs (direction, torque over time in N m).
    """

    size: int
    angle: TimeFunction
    gyros: tuple[Gyro, ...]
    flanks: tuple[Flank, ...]
    torques: tuple[tuple[int, TimeFunction], ...]

    def of_flanks(self, t: Array, u: Array, du: Array) -> list[FlankForces]:
        """Forces of each flank at the times t (n,), u and du of shape (n, directions)."""
        angle, rate = self.angle(t), self.angle(t, 1)
        return [flank.forces(angle, rate, u, du) for flank in self.flanks]

    def __call__(self, t: Array, u: Array, du: Array, flanks: list[FlankForces] | None = None) -> Array:
        """Forces at the times t (n,), u and du of shape (n, directions); shape (n, directions).

        `flanks`: what `of_flanks` says, where it is known already.
        """
        out = np.zeros_like(u)
        rate = self.angle(t, 1)
        for flank, made in zip(self.flanks, flanks or self.of_flanks(t, u, du), strict=True):
            out[:, flank.direction] += flank.mean * u[:, flank.direction] + flank.rayleigh * du[:, flank.direction]
            out[:, flank.direction] -= made.force
            if made.moment is not None:
                out[:, flank.turn] -= flank.sense * made.moment
            if flank.sliding is not None and made.drag is not None:
                out[:, flank.sliding.across] -= made.drag.across
                out[:, flank.sliding.spin] -= made.drag.turning
        for gyro in self.gyros:
            d = gyro.direction
            momentum = gyro.polar * (gyro.ratio * rate + du[:, d + 2])
            out[:, d] -= momentum * du[:, d + 1]
            out[:, d + 1] += momentum * du[:, d]
        for direction, torque in self.torques:
            out[:, direction] += torque(t)
        return out

    @property
    def at_one_time(self) -> Callable[[float, Array, Array], Array]:
        """The same as a function ``(t, u, du) -> (size,)``."""

        def law(t: float, u: Array, du: Array) -> Array:
            made: Array = self(np.array([t]), u[None], du[None])[0]
            return made

        return law

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which a function of time is not smooth."""
        return tuple(sorted({*self.angle.breaks, *(b for _, torque in self.torques for b in torque.breaks)}))


def derivative(function: TimeFunction) -> TimeFunction:
    """d/dt of a function of time, away from its breaks."""
    rows = tuple(tuple(j * c for j, c in enumerate(row))[1:] or (0.0,) for row in function.coefficients)
    sines = tuple((a * w, w, p + math.pi / 2) for a, w, p in function.sines)
    return TimeFunction(function.starts, function.origins, rows, sines)
