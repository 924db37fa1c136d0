r"""Forces of all flanks of a train at the freedoms of its meshes, with their derivatives, over the phases.

The same forces as `train.forces`: with the turns n of the drive in a period of each phase :math:`\theta`, the
phase of a flank is :math:`s(g\,n\cdot\theta + u_r) + \varphi_0`, but for whole cycles of the mesh, so the rotation's
feedback on the phase is kept. What stands in the linear part already, the mean stiffness along the approach, is taken
off.

A damper that acts in contact only has a force that jumps at the touch. It is the rate of change of what does not,

.. math:: c\,H(\delta)\,\dot\delta = \frac{d}{dt}\,c\max(\delta, 0) ,

so its harmonics are :math:`ik\cdot\omega` times those of :math:`c\max(\delta, 0)`, and Newton's method has their
derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...base.typing import Array, IntArray
from ..train.forces import Flank, FlankForces, LawFlank, Slip, SpeedTorque
from ..train.friction import Sliding
from .balance import Pushes


@dataclass(frozen=True, eq=False)
class Rubbing:
    """Friction of a flank at any speed of the drive.

    Parameters
    ----------
    sliding
        At the speed that the model was built for.
    speed
        That one (rad/s).
    coefficient
        Of friction at another speed; None: the same.
    """

    sliding: Sliding
    speed: float
    coefficient: Callable[[float], float] | None

    def at(self, speed: float) -> Sliding:
        """Friction at a speed; it sets in as far along the path of contact as at the model's."""
        mu = self.sliding.coefficient if self.coefficient is None else self.coefficient(speed)
        return replace(self.sliding, coefficient=mu, speed=self.sliding.speed * abs(speed / self.speed))


#: A torque repeats with a phase where its cycles in the phase's period are a whole number to this part.
WHOLE = 1e-9


@dataclass(frozen=True, eq=False)
class SwingingTorque:
    """A torque ``amplitude sin(omega t + phase)`` along a freedom, which repeats with a phase of the motion.

    Parameters
    ----------
    freedom
        Its number.
    amplitude, omega, phase
        N m, rad/s, rad.
    turns : (n,)
        Turns of the drive in a period of each phase.
    per_turn
        Cycles in a turn of the drive of one that follows the speed, which counts instead of omega; else 0.
    """

    freedom: int
    amplitude: float
    omega: float
    phase: float
    turns: Array
    per_turn: float = 0.0

    def at_speed(self, speed: float) -> float:
        """Angular frequency (rad/s) at a speed of the drive (rad/s)."""
        return self.per_turn * abs(speed) if self.per_turn else self.omega

    def waves(self, speed: float) -> IntArray | None:
        """Cycles in a period of each phase at a speed of the drive (rad/s), (n,); None where none has whole ones."""
        cycles = self.at_speed(speed) / abs(speed) * self.turns
        whole = np.round(cycles)
        found = np.flatnonzero((np.abs(cycles - whole) <= WHOLE * cycles) & (whole > 0.0))
        return None if not len(found) else np.asarray(whole * (np.arange(len(cycles)) == found[0]), dtype=np.int64)

    def at(self, theta: Array, speed: float) -> Array:
        """The torque (N m) at phases theta (S, n)."""
        waves = self.waves(speed)
        assert waves is not None  # such speeds are left out before
        return np.asarray(self.amplitude * np.sin(theta @ waves + self.phase))


@dataclass(frozen=True, eq=False)
class MeshForces:
    """Forces of flanks at the m freedoms.

    Parameters
    ----------
    flanks
        Of all meshes.
    freedoms : (f, 4)
        For each flank the numbers of its approach and of its driver's rotation among the freedoms, and of the
        displacement and turn that its friction acts on, or of the tilt of its gears (-1 without).
    turns : (f, n)
        For each flank the turns of the drive in a period of the phase that its mesh follows, negative where it turns
        backwards; 0 of other phases.
    rubbing
        Friction of each flank, or None.
    torques
        Those that swing.
    speed_torques
        Torques over speed, whose directions are numbers of freedoms.
    """

    flanks: Sequence[Flank]
    freedoms: IntArray
    turns: Array
    rubbing: Sequence[Rubbing | None]
    torques: Sequence[SwingingTorque] = ()
    speed_torques: Sequence[SpeedTorque] = ()
    _pairs: dict[tuple[int, int], Array] = field(default_factory=dict, repr=False)

    def flank(self, number: int, theta: Array, speed: float, u: Array, du: Array) -> FlankForces:
        """Return the forces of one flank at S places of the phases.

        Parameters
        ----------
        number : int
            Number of the flank.
        theta : ndarray, shape (S, n)
            Phases of the motion (rad).
        speed : float
            Speed of the drive (rad/s).
        u, du : ndarray, shape (S, m)
            Freedoms (m, rad) and their rates (m/s, rad/s).
        """
        flank, rubs = self.flanks[number], self.rubbing[number]
        along, turn, across, spin = self.freedoms[number]
        phase = flank.sense * (flank.ratio * (theta @ self.turns[number]) + u[:, turn]) + flank.phase
        begin = None
        if isinstance(flank, LawFlank):
            begin = self._pairs.get((number, len(phase)))
            if begin is None:
                begin = self._pairs[number, len(phase)] = np.zeros((len(phase), flank.law.slots))
        tilt = u[:, across] if flank.tilt >= 0 else 0.0
        rates = du[:, [along, across, turn if spin < 0 else spin]]
        slip = Slip(speed, rates, None if rubs is None else rubs.at(speed), tilt)
        return flank.forces(phase, flank.beyond_touch(phase, u[:, along], tilt), slip, begin)

    def __call__(self, theta: Array, speed: float, u: Array, du: Array) -> Pushes:
        """Forces at the freedoms, what the linear part has taken off."""
        value = np.zeros_like(u)
        by_place = np.zeros((*u.shape, u.shape[1]))
        by_rate, momentum, momentum_by_place = None, None, None
        for number, (flank, (d, r, a, s)) in enumerate(zip(self.flanks, self.freedoms, strict=True)):
            at = self.flank(number, theta, speed, u, du)
            value[:, d] += flank.mean * u[:, d] - at.force
            by_place[:, d, d] += flank.mean - at.tangent
            by_place[:, d, r] -= flank.sense * at.cross
            if at.lever is not None and at.couple is not None and at.couple_by_phase is not None:
                value[:, a] -= at.couple
                by_place[:, d, a] -= at.tangent * at.lever
                by_place[:, a, d] -= at.tangent * at.lever
                by_place[:, a, a] -= at.tangent * at.lever**2
                by_place[:, a, r] -= flank.sense * at.couple_by_phase
            if at.momentum is not None and at.per_rate is not None:
                if momentum is None or momentum_by_place is None:
                    momentum, momentum_by_place = np.zeros_like(u), np.zeros_like(by_place)
                value[:, d] += at.push
                momentum[:, d] -= at.momentum
                momentum_by_place[:, d, d] -= at.per_rate
                momentum_by_place[:, d, r] -= flank.sense * at.momentum_by_phase
                continue
            if by_rate is None and (at.per_rate is not None or at.drag is not None):
                by_rate = np.zeros_like(by_place)
            if at.per_rate is not None and by_rate is not None:
                by_rate[:, d, d] -= at.per_rate
            if at.moment is not None and at.moment_by_approach is not None:
                value[:, r] -= flank.sense * at.moment
                by_place[:, r, d] -= flank.sense * at.moment_by_approach
                by_place[:, r, r] -= at.bend
            if at.drag is not None and by_rate is not None:
                for i, on in enumerate((a, s)):
                    value[:, on] -= at.drag.value[:, i]
                    by_place[:, on, d] -= at.drag.by_approach[:, i]
                    by_place[:, on, r] -= flank.sense * at.drag.by_phase[:, i]
                    by_rate[:, on, d] -= at.drag.by_rate[:, i]
                    by_rate[:, on, a] -= at.drag.by_across_rate[:, i]
                    by_rate[:, on, s] -= at.drag.by_turn_rate[:, i]
        for torque in self.torques:
            value[:, torque.freedom] += torque.at(theta, speed)
        for over in self.speed_torques:
            d = over.direction
            if by_rate is None:
                by_rate = np.zeros_like(by_place)
            value[:, d] += over.at(speed, du[:, d])
            by_rate[:, d, d] += over.slope(speed, du[:, d])
        return Pushes(value, by_place, by_rate, momentum, momentum_by_place)
