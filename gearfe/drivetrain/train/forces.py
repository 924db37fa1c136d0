r"""All forces of a train that are not constant matrices, along few directions: one formulation for many times at once.

The motion is split into rolling and a small rest: the rotation of a shaft is :math:`g\,\psi(t) + u`, psi the drive's
angle, g the shaft's ratio to it, u a coordinate. With u, u' along the directions, the forces are

- of a *flank with a stiffness curve*: along the approach d, :math:`-(k(\varphi)\,(u_d - j) - k_0 u_d)` with
  :math:`\varphi = s\,(g\psi + u_r) + \varphi_0` and r the driver's rotation. The part with the mean :math:`k_0` stands
  in the system's stiffness. A flank that may part bears where :math:`u_d > j`. A damper that acts in contact only
  adds :math:`-(c\,H(u_d - j)\,u_d' - c_0 u_d')`, H being Heaviside's step and :math:`c_0` what stands in the system's
  damping. One that acts along the face width has the approach :math:`u_d + \ell(\varphi) u_t`, u_t the tilt of the
  gears in the plane of action, and along it :math:`-(\ell F + m(\varphi))` with its spring force F;
- of a *flank with a mesh law* (`gears.gearmesh.law`): :math:`-(F\,\langle 1 + \chi u_d'\rangle - k_0 u_d)` along d, and
  :math:`-s M` along r, the driver's rotation relative to the line of centres; with *friction* (`train.friction`)
  :math:`-\sum\mu N_k s(v_k/v_0)` across the line of action, and that times :math:`e_k` along the driver's turn
  against the driven gear;
- of a *flank with a law over the face width* (`gears.gearmesh.width_law`): the same of F and M, and
  :math:`-(G - \kappa_0 u_t)` along the tilt, whose mean stiffness :math:`\kappa_0` the system has, too;
- *gyroscopic*: :math:`-J_p\Omega\,(u_{d+1}', -u_d')`, :math:`\Omega = g\psi' + u_s'`, on the tilts d, d + 1 of a
  shaft with the spin s;
- *dampers in a frame that turns*, of a damping constant c in fixed axes: with :math:`\Omega = g\psi'` they feel
  :math:`u' + \Omega J u`, J a quarter turn, and add :math:`c\,\Omega\,(u_{d+1}, -u_d)` on the directions d, d + 1;
- *turned springs and dampers* between a shaft in the frame of a carrier and a bore of an elastic housing: with its two
  directions b of the bore, the w of the shaft times the stiffness, and the rotation R of the frame,
  :math:`(R - 1)\,u_w` along b and :math:`(R^T - 1)\,u_b` along w, for R = 1 at the start is in the system's stiffness.
  A damper has the rates in fixed axes: :math:`\frac{d}{dt}[(R - 1)\,u_w]` and :math:`(R^T - 1)\,u_b'`;
- *torques*: functions of time along a direction d, and of the true speed there, :math:`T(g\psi' + u_d') + c\,u_d'`,
  c the slope that the system's damping has already.

A mesh has one flank, or two. The back flank has its own approach, along the other line of action. Its law is that of
the driving flank at the mirrored phase, behind the backlash j.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...base.typing import Array, BoolArray, IntArray
from ...gears.gearmesh.law import MeshForces, MeshLaw
from ...gears.gearmesh.mesh_table import Tilting
from ...gears.gearmesh.periodic import PeriodicInterpolant
from ...gears.gearmesh.width_law import WidthLaw
from ...multibody.series.timefunctions import TimeFunction
from .friction import Sliding, smooth_sign


class Drag(NamedTuple):
    """Friction of a flank at n times, (n, 2) each: force across the line of action (N) and its moment about the pitch
    point (N m). Their derivatives are by approach and phase, and by the rates of approach, of the displacement across,
    and of the turn. Last the power (W) that it takes, (n,).
    """

    value: Array
    by_approach: Array
    by_phase: Array
    by_rate: Array
    by_across_rate: Array
    by_turn_rate: Array
    power: Array


class FlankForces(NamedTuple):
    """Forces of a flank at n times, (n,) each."""

    force: Array  # N along the approach, damping included
    tangent: Array  # N/m
    cross: Array  # N/rad: of the force with the phase
    apart: BoolArray
    beyond: BoolArray  # farther than the law is known
    per_rate: Array | None = None  # N s/m
    moment: Array | None = None  # N m on the phase
    moment_by_approach: Array | None = None  # N m/m
    bend: Array | None = None  # N m/rad: of the moment with the phase
    drag: Drag | None = None
    momentum: Array | None = None  # N s: its rate of change is the damper's part of the force, which jumps at the touch
    momentum_by_phase: Array | float = 0.0  # N s/rad
    push: Array | float = 0.0  # N: the damper's part of the force
    couple: Array | None = None  # N m on the tilt
    by_tilt: Array | None = None  # N/rad: of the force
    couple_by_approach: Array | None = None  # N m/m
    couple_by_tilt: Array | None = None  # N m/rad
    couple_by_phase: Array | None = None  # N m/rad
    moment_by_tilt: Array | None = None  # N m/rad


class Slip(NamedTuple):
    """What forces depend on beside phase and approach: psi' (1/s), rates of approach, of the way across and of the turn
    (n, 3), friction, tilt."""

    rate: Array | float
    rates: Array
    sliding: Sliding | None
    tilt: Array | float = 0.0  # rad: of the gears, for flanks that act along the face width


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

    Flanks also have a `mean_damping` (N s/m), which the system's constant part has along the approach already, and a
    `damping` that acts while their teeth bear. `tilt` is the number of the tilt of the gears among the directions, for
    flanks that act along the face width, else -1. `against` is the stiffness against the tilt (N m/rad), which is in
    the system's constant part and in the flank's own moment.
    """

    tilt = -1
    against = 0.0

    direction: int
    turn: int
    ratio: float
    sense: float
    phase: float
    mean: float
    gap: float

    @abstractmethod
    def forces(self, phase: Array, approach: Array, slip: Slip, begin: Array | None = None) -> FlankForces:
        """Return the flank's forces and their derivatives at n times.

        Parameters
        ----------
        phase : ndarray, shape (n,)
            Phase of the mesh (rad).
        approach : ndarray, shape (n,)
            Approach beyond the touch (m).
        slip : Slip
            Rates of the motion, and the friction.
        begin : ndarray, shape (n, slots), optional
            Pair forces (N) from which the law's iteration starts, and which it overwrites, see `MeshLaw`.
        """

    @abstractmethod
    def bears(self, phase: Array, approach: Array) -> BoolArray:
        """Whether its teeth touch at phases (rad) and approaches beyond the touch (m), (n,)."""

    def touch(self, phase: Array) -> Array:  # noqa: ARG002
        """Approach (m) at which its flanks touch at phases (rad), except for what a law adds itself."""
        return np.asarray(self.gap)

    def beyond_touch(self, phase: Array, approach: Array, tilt: Array | float) -> Array:  # noqa: ARG002
        """Approach beyond the touch (m) at phases (rad), approaches (m) and tilts of the gears (rad), (n,)."""
        return np.asarray(approach - self.touch(phase))

    def phase_and_approach(self, angle: Array, u: Array) -> tuple[Array, Array]:
        """Phase (rad) and approach beyond the touch (m), u of shape (n, directions)."""
        phase = self.sense * (self.ratio * angle + u[:, self.turn]) + self.phase
        return phase, self.beyond_touch(phase, u[:, self.direction], self.tilt_of(u))

    def tilt_of(self, u: Array) -> Array | float:
        """Tilt of the gears (rad) where the flank acts along the face width, u of shape (n, directions)."""
        return np.asarray(u[:, self.tilt]) if self.tilt >= 0 else 0.0


@dataclass(frozen=True, eq=False)
class CurveFlank(MeshFlank):
    """Force k(phase) (approach - e(phase)); where `parts`, none before the touch.

    `damping` is c (N s/m) of a damper that acts in contact only: at the touch its force jumps. `error` is e (m), the
    unloaded static transmission error, on the nodes of the curve, or None. Dampers act on the rate of approach - e;
    `always` is c (N s/m) of the one that the system's constant part has along the approach. `tilting`, on the nodes of
    the curve too, says how the flank acts along the face width; its stiffness is in the system's constant part.
    """

    sliding: ClassVar[None] = None
    curve: PeriodicInterpolant
    parts: bool
    damping: float = 0.0
    mean_damping: float = 0.0
    error: PeriodicInterpolant | None = None
    always: float = 0.0
    tilt: int = -1
    tilting: Tilting | None = None

    def beyond_touch(self, phase: Array, approach: Array, tilt: Array | float) -> Array:
        """Approach beyond the touch (m) at phases (rad), approaches (m) and tilts of the gears (rad), (n,)."""
        beyond = approach - self.touch(phase)
        return np.asarray(beyond if self.tilting is None else beyond + self.tilting.lever(phase).value * tilt)

    def touch(self, phase: Array) -> Array:
        """Approach (m) at which its flanks touch at phases (rad): gap and transmission error."""
        return np.asarray(self.gap if self.error is None else self.gap + self.error(phase).value)

    def forces(self, phase: Array, approach: Array, slip: Slip, begin: Array | None = None) -> FlankForces:  # noqa: ARG002
        """Return the forces of a stiffness curve and of its contact damper at n times.

        Parameters
        ----------
        phase : ndarray, shape (n,)
            Phase of the mesh (rad).
        approach : ndarray, shape (n,)
            Approach beyond the touch (m).
        slip : Slip
            Rates of the motion; dampers use those of the approach and of the phase.
        begin : ndarray, optional
            Not used: a curve has no pair forces.
        """
        bears = self.bears(phase, approach)
        if not bears.any() and self.error is None and self.tilting is None:
            none = np.zeros(len(phase))
            damper: dict[str, Any] = {"per_rate": none, "momentum": none, "push": none} if self.damping > 0.0 else {}
            return FlankForces(none, none, none, ~bears, bears, **damper)
        k, slope = self.curve(phase)
        late, rise = (0.0, 0.0) if self.error is None else self.error(phase)
        along: dict[str, Any] = {}
        if self.tilting is not None:
            lever, more = self.tilting.lever(phase)
            moment, steep = self.tilting.moment(phase)
        closing = rise if self.tilting is None else rise - more * slip.tilt
        force, tangent, cross = (np.where(bears, x, 0.0) for x in (k * approach, k, slope * approach - k * closing))
        if self.tilting is not None:
            by_phase = more * force + lever * cross + steep
            by_tilt = lever * tangent
            along = {"couple": lever * force + moment, "by_tilt": by_tilt, "couple_by_approach": by_tilt}
            along |= {"couple_by_tilt": lever * by_tilt, "couple_by_phase": by_phase}
        never = np.zeros(len(phase), dtype=bool)
        if not (self.damping > 0.0 or (self.error is not None and self.always > 0.0)):
            return FlankForces(force, tangent, cross, ~bears, never, **along)
        c, momentum = np.where(bears, self.damping, 0.0), np.where(bears, self.damping * approach, 0.0)
        turning = self.sense * (self.ratio * slip.rate + slip.rates[:, 2])
        push = c * slip.rates[:, 0] - (c + self.always) * rise * turning
        return FlankForces(
            force + push, tangent, cross, ~bears, never, per_rate=c, momentum=momentum - self.always * late,
            momentum_by_phase=-(c + self.always) * rise, push=push, **along,
        )  # fmt: skip

    def bears(self, phase: Array, approach: Array) -> BoolArray:  # noqa: ARG002
        """Whether its teeth touch at phases (rad) and approaches beyond the touch (m), (n,)."""
        return np.asarray((approach > 0.0) | (not self.parts))


@dataclass(frozen=True, eq=False)
class LawFlank(MeshFlank):
    """A mesh law; `damping` is chi (s/m), `sliding` its friction or None.

    `shifts`, shape (L,), is the approach (m) by which tooth pair k touches later, k taken modulo L: its pitch errors.
    """

    always: ClassVar[float] = 0.0
    law: MeshLaw
    damping: float
    sliding: Sliding | None = None
    shifts: Array = field(default_factory=lambda: np.zeros(1))
    mean_damping: float = 0.0

    def bears(self, phase: Array, approach: Array) -> BoolArray:
        """Whether its teeth touch at phases (rad) and approaches beyond the touch (m), (n,)."""
        return np.asarray(approach > self.law.first_contact(phase, self.shifts_at(phase)))

    def shifts_at(self, phase: Array) -> Array:
        """Shifts (m) of the pairs in the law's slots at phases (n,), shape (n, slots), or (1,) of all pairs."""
        if len(self.shifts) == 1:
            return self.shifts
        return np.asarray(self.shifts[self.law.pair_numbers(phase) % len(self.shifts)])

    def forces(self, phase: Array, approach: Array, slip: Slip, begin: Array | None = None) -> FlankForces:
        """Return the forces of a mesh law, with damping and friction, at n times.

        Parameters
        ----------
        phase : ndarray, shape (n,)
            Phase of the mesh (rad).
        approach : ndarray, shape (n,)
            Approach beyond the touch (m).
        slip : Slip
            Rates of the motion, and the friction.
        begin : ndarray, shape (n, slots), optional
            Pair forces (N) from which the law's iteration starts, and which it overwrites, see `MeshLaw`.
        """
        loads = self.law(phase, approach, self.shifts_at(phase), begin)
        push = 1.0 + self.damping * slip.rates[:, 0]
        more = np.where(push > 0.0, self.damping, 0.0)
        push = np.maximum(push, 0.0)
        return FlankForces(
            loads.force * push, loads.tangent * push, loads.cross * push, loads.force <= 0.0, loads.beyond,
            loads.force * more if self.damping > 0.0 else None, loads.moment, loads.cross, loads.bend,
            None if slip.sliding is None else self._drag(phase, loads, slip, slip.sliding, push, more),
        )  # fmt: skip

    def _drag(self, phase: Array, loads: MeshForces, slip: Slip, sliding: Sliding, push: Array, more: Array) -> Drag:
        """Friction of `gearfe.drivetrain.train.friction` with its derivatives."""
        pairs, slopes = loads.pair_forces, loads.pair_slopes
        arm = sliding.radius * (self.law.pair_phases(phase) - sliding.pitch_phase)
        turning = (sliding.ratio * slip.rate + slip.rates[:, 2])[:, None]
        speed = slip.rates[:, 1, None] + arm * turning
        share, slope = smooth_sign(speed / sliding.speed)
        steep = sliding.coefficient * pairs * push[:, None] * slope / sliding.speed
        pulls = sliding.coefficient * share
        drag = pulls * pairs * push[:, None]
        arms = np.stack([np.ones_like(arm), arm])  # of the force and of its moment

        def summed(x: Array) -> Array:
            return np.asarray((arms * x).sum(axis=2).T)

        by_phase = summed(pulls * slopes[1] * push[:, None] + steep * sliding.radius * turning)
        by_phase[:, 1] += sliding.radius * drag.sum(axis=1)
        return Drag(
            summed(drag), summed(pulls * slopes[0] * push[:, None]), by_phase, summed(pulls * pairs * more[:, None]),
            summed(steep), summed(steep * arm), (drag * speed).sum(axis=1),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class WidthFlank(MeshFlank):
    """A law over the face width; `damping` is chi (s/m). Without a number of the tilt it acts as without a tilt."""

    sliding: ClassVar[None] = None
    always: ClassVar[float] = 0.0
    law: WidthLaw
    damping: float
    mean_damping: float = 0.0
    tilt: int = -1
    against: float = 0.0

    def beyond_touch(self, phase: Array, approach: Array, tilt: Array | float) -> Array:
        """Approach beyond the touch (m) at phases (rad), approaches (m) and tilts of the gears (rad), (n,)."""
        return np.asarray(approach - self.gap - self.law.first_contact(phase, tilt))

    def bears(self, phase: Array, approach: Array) -> BoolArray:  # noqa: ARG002
        """Whether its teeth touch at phases (rad) and approaches beyond the touch (m), (n,)."""
        return np.asarray(approach > 0.0)

    def forces(self, phase: Array, approach: Array, slip: Slip, begin: Array | None = None) -> FlankForces:  # noqa: ARG002
        """Return the forces of a law over the face width, with damping, at n times.

        Parameters
        ----------
        phase : ndarray, shape (n,)
            Phase of the mesh (rad).
        approach : ndarray, shape (n,)
            Approach beyond the touch (m).
        slip : Slip
            Rates of the motion, and the tilt.
        begin : ndarray, optional
            Not used: the law has no pair forces.
        """
        at = self.law.at(phase, approach, np.broadcast_to(slip.tilt, phase.shape))
        push = 1.0 + self.damping * slip.rates[:, 0]
        more = np.where(push > 0.0, self.damping, 0.0)
        push = np.maximum(push, 0.0)
        along: dict[str, Any] = {}
        if self.tilt >= 0:
            along = {"couple": at.couple - self.against * slip.tilt, "by_tilt": at.by_tilt * push}
            along |= {"couple_by_approach": at.by_tilt, "couple_by_tilt": at.against - self.against}
            along |= {"couple_by_phase": at.twist, "moment_by_tilt": at.twist}
        return FlankForces(
            at.force * push, at.tangent * push, at.cross * push, approach <= 0.0, at.beyond,
            at.force * more if self.damping > 0.0 else None, at.moment, at.cross, at.bend, **along,
        )  # fmt: skip


Flank = CurveFlank | LawFlank | WidthFlank


@dataclass(frozen=True)
class Gyro:
    r"""Forces that turn the motion along the directions `direction` and the one after it: gyroscopic, or of a frame.

    With :math:`H = p\,(g\psi' + u_s')`, p the polar inertia and s the direction of the spin, the moments on two tilts
    are :math:`-H u_2'` and :math:`H u_1'`. In a frame that turns with :math:`\Omega = g\psi'` a mass m has the Coriolis
    forces with :math:`p = -2m`, the centrifugal ones :math:`m g^2\psi'^2 u` and those of Euler, :math:`-H' u_2/2` and
    :math:`H' u_1/2`; of its place on the first direction, `offset` (m) is part beside u. A damper c in fixed axes feels
    :math:`u' + \Omega J u`: the system has :math:`-c u'`, and :math:`c\,\Omega u_2` and :math:`-c\,\Omega u_1` are the
    rest.

    Attributes
    ----------
    direction, spin
        Numbers of directions.
    ratio
        g.
    polar
        p (kg m2, of a mass kg).
    stiffening
        Factor of psi'^2 u (kg m2, kg).
    euler
        Whether those forces act.
    offset
        m.
    circulating
        c g (N s/m, N m s/rad), of a damper in fixed axes.
    """

    direction: int
    spin: int
    ratio: float
    polar: float
    stiffening: float = 0.0
    euler: bool = False
    offset: float = 0.0
    circulating: float = 0.0

    @property
    def of_frame(self) -> bool:
        """Whether its motion is described in a frame that turns."""
        return self.euler or self.stiffening != 0.0 or self.circulating != 0.0


@dataclass(frozen=True)
class Turned:
    """What the rotation of a frame changes of the forces between two motions in a plane, one of them in the frame.

    Attributes
    ----------
    still, turning
        Numbers of the directions of the motion in fixed axes, and of the other motion times a stiffness or a damping
        constant. The second direction of each has the next number.
    ratio
        Speed of the frame over that of the drive.
    of_rates
        Whether it is a damper.
    """

    still: int
    turning: int
    ratio: float
    of_rates: bool

    def add(self, angle: Array, rate: Array, u: Array, du: Array, out: Array) -> None:
        """Add its forces.

        Parameters
        ----------
        angle, rate : ndarray, shape (n,)
            Rotation (rad) and speed (rad/s) of the drive.
        u, du : ndarray, shape (n, directions)
            Motion and its rate.
        out : ndarray, shape (n, directions)
            Forces to add to.
        """
        b, w = self.still, self.turning
        motion = du if self.of_rates else u
        cosine, sine = np.cos(self.ratio * angle) - 1.0, np.sin(self.ratio * angle)
        out[:, b] += cosine * motion[:, w] - sine * motion[:, w + 1]
        out[:, b + 1] += sine * motion[:, w] + cosine * motion[:, w + 1]
        out[:, w] += cosine * motion[:, b] + sine * motion[:, b + 1]
        out[:, w + 1] += cosine * motion[:, b + 1] - sine * motion[:, b]
        if self.of_rates:  # the rotation itself moves what is displaced
            speed = self.ratio * rate
            out[:, b] -= speed * (sine * u[:, w] + (cosine + 1.0) * u[:, w + 1])
            out[:, b + 1] += speed * ((cosine + 1.0) * u[:, w] - sine * u[:, w + 1])


@dataclass(frozen=True)
class SpeedTorque:
    """Torque along a direction over the true speed there.

    Attributes
    ----------
    direction
        Number of the direction, a rotation beside rolling.
    ratio
        Speed for unit speed of the drive.
    function
        Torque (N m) over speed (rad/s): pieces of polynomials.
    damping
        What the system's constant part has along the direction already (N m s/rad).
    """

    direction: int
    ratio: float
    function: TimeFunction
    damping: float

    def at(self, rate: Array | float, du: Array) -> Array:
        """Return the torque (N m) at n speeds of the drive and rates beside rolling (rad/s)."""
        return np.asarray(self.function(self.ratio * rate + du) + self.damping * du)

    def slope(self, rate: Array | float, du: Array) -> Array:
        """Return its change with the speed (N m s/rad) at the same."""
        return np.asarray(self.function(self.ratio * rate + du, 1) + self.damping)


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
    speed_torques
        Torques over speed.
    turned
        Springs and dampers between frames of carriers and an elastic housing.
    """

    size: int
    angle: TimeFunction
    gyros: tuple[Gyro, ...]
    flanks: tuple[Flank, ...]
    torques: tuple[tuple[int, TimeFunction], ...]
    speed_torques: tuple[SpeedTorque, ...] = ()
    turned: tuple[Turned, ...] = ()

    def of_flanks(self, t: Array, u: Array, du: Array) -> list[FlankForces]:
        """Forces of each flank at the times t (n,), u and du of shape (n, directions)."""
        angle, rate, forces = self.angle(t), self.angle(t, 1), []
        for flank in self.flanks:
            sliding = flank.sliding
            across = (flank.direction, flank.turn) if sliding is None else (sliding.across, sliding.spin)
            slip = Slip(rate, du[:, [flank.direction, *across]], sliding, flank.tilt_of(u))
            forces.append(flank.forces(*flank.phase_and_approach(angle, u), slip))
        return forces

    def __call__(self, t: Array, u: Array, du: Array, flanks: list[FlankForces] | None = None) -> Array:
        """Forces at the times t (n,), u and du of shape (n, directions); shape (n, directions).

        `flanks`: what `of_flanks` says, where it is known already.
        """
        out = np.zeros_like(u)
        rate = self.angle(t, 1)
        for flank, made in zip(self.flanks, flanks or self.of_flanks(t, u, du), strict=True):
            out[:, flank.direction] += flank.mean * u[:, flank.direction] + flank.mean_damping * du[:, flank.direction]
            out[:, flank.direction] -= made.force
            if made.moment is not None:
                out[:, flank.turn] -= flank.sense * made.moment
            if made.couple is not None:
                out[:, flank.tilt] -= made.couple
            if flank.sliding is not None and made.drag is not None:
                out[:, flank.sliding.across] -= made.drag.value[:, 0]
                out[:, flank.sliding.spin] -= made.drag.value[:, 1]
        for gyro in self.gyros:
            d = gyro.direction
            momentum = gyro.polar * (gyro.ratio * rate + du[:, gyro.spin])
            out[:, d] -= momentum * du[:, d + 1]
            out[:, d + 1] += momentum * du[:, d]
            if gyro.of_frame:
                first, second = u[:, d] + gyro.offset, u[:, d + 1]
                half = 0.5 * gyro.euler * gyro.polar * gyro.ratio * self.angle(t, 2)
                out[:, d] += gyro.stiffening * rate**2 * first - half * second
                out[:, d + 1] += gyro.stiffening * rate**2 * second + half * first
                out[:, d] += gyro.circulating * rate * second
                out[:, d + 1] -= gyro.circulating * rate * first
        angle = self.angle(t)
        for spring in self.turned:
            spring.add(angle, rate, u, du, out)
        for direction, torque in self.torques:
            out[:, direction] += torque(t)
        for over in self.speed_torques:
            out[:, over.direction] += over.at(rate, du[:, over.direction])
        return out

    @property
    def at_one_time(self) -> Callable[[float, Array, Array], Array]:
        """The same as a function ``(t, u, du) -> (size,)``."""

        def law(t: float, u: Array, du: Array) -> Array:
            made: Array = self(np.array([t]), u[None], du[None])[0]
            return made

        return law

    @property
    def jumps(self) -> bool:
        """Whether forces jump where teeth touch: dampers of curves that act in contact only."""
        return any(isinstance(flank, CurveFlank) and flank.damping > 0.0 for flank in self.flanks)

    def pieces(self, t: float | Array, u: Array, du: Array) -> IntArray:  # noqa: ARG002
        """Whether the teeth of each flank with a curve bear, 1 or 0, at times (...); shape (..., flanks).

        u and du have the shape (..., directions).
        """
        flat, angle = u.reshape(-1, self.size), np.atleast_1d(self.angle(t)).ravel()
        bearing = [
            flank.bears(*flank.phase_and_approach(angle, flat))
            for flank in self.flanks
            if isinstance(flank, CurveFlank)
        ]
        return np.stack(bearing, axis=-1).astype(np.int64).reshape(*u.shape[:-1], -1)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which a function of time is not smooth."""
        return tuple(sorted({*self.angle.breaks, *(b for _, torque in self.torques for b in torque.breaks)}))


def derivative(function: TimeFunction) -> TimeFunction:
    """d/dt of a function of time, away from its breaks."""
    rows = tuple(tuple(j * c for j, c in enumerate(row))[1:] or (0.0,) for row in function.coefficients)
    sines = tuple((a * w, w, p + math.pi / 2) for a, w, p in function.sines)
    return TimeFunction(function.starts, function.origins, rows, sines)
