r"""What a periodic motion of a train means: forces, transmission errors, vibration, power.

All accelerations come from the forces of the motion and the flexibility of the whole train at once, so harmonics far
above those of Newton's method are there too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..typing import Array, ComplexArray
from ..vibration.radiation import AIR_IMPEDANCE
from .balance import Orbit, analysis, rates, samples_of, synthesis
from .condensed import CondensedTrain
from .mesh_forces import sampled
from .stability import STABLE


@dataclass(frozen=True, eq=False)
class SteadyState:
    """Steady running at one speed; S samples of the period, K + 1 harmonics of it, the constant first.

    Attributes
    ----------
    speed
        Of the drive (rad/s).
    branch
        0 for the branch that the run-up begins on; one more after each turning point.
    orbit
        The motion at the freedoms of the meshes.
    period
        s.
    frequency : (K + 1,)
        Hz.
    order : (K + 1,)
        Frequency over that of the drive's turns.
    force : (S, meshes)
        Contact force (N), of back flanks negative.
    transmission_error : (S, meshes)
        Approach along the line of action (m).
    apart : (meshes,)
        Share of the period without contact.
    beyond
        Whether a mesh goes beyond what its law is known for.
    acceleration : (K + 1, bores)
        Complex amplitudes along the shafts at the attachments (m/s2).
    power : (K + 1,) or None
        Equivalent radiated power of each line (W); None for a rigid housing.
    multipliers : (2 modes,) or None
        Floquet multipliers of the motion, largest modulus first; None where they were not asked for.
    """

    speed: float
    branch: int
    orbit: Orbit
    period: float
    frequency: Array
    order: Array
    force: Array
    transmission_error: Array
    apart: Array
    beyond: bool
    acceleration: ComplexArray
    power: Array | None
    multipliers: ComplexArray | None = None

    @property
    def stable(self) -> bool | None:
        """Whether small disturbances die out; None where multipliers were not asked for."""
        return None if self.multipliers is None else bool(abs(self.multipliers[0]) <= STABLE)

    @property
    def error(self) -> float:
        """Estimate of the error of the meshes' approaches, in parts of those under the steady force."""
        return self.orbit.error

    def rms(self, band_hz: float) -> Array:
        """(bores,) root mean square of the accelerations up to a frequency (m/s2)."""
        inside = (self.frequency > 0.0) & (self.frequency <= band_hz)
        return np.asarray(np.sqrt(0.5 * (np.abs(self.acceleration[inside]) ** 2).sum(axis=0)))

    def at_harmonic(self, values: Array, harmonic: int) -> ComplexArray:
        """Complex amplitude of samples at a harmonic of the period."""
        return np.asarray(analysis(values)[harmonic])


def steady_result(
    train: CondensedTrain, orbit: Orbit, branch: int, multipliers: ComplexArray | None = None
) -> SteadyState:
    """Evaluate an orbit."""
    system, model = train.system, train.model
    omega0, count = system.omega0(orbit.speed), orbit.harmonics
    samples = samples_of(count)
    theta = sampled(samples)
    u, du = synthesis(orbit.places, samples), synthesis(rates(orbit.places, omega0), samples)
    force, approach = np.zeros((samples, len(model.meshes))), np.zeros((samples, len(model.meshes)))
    apart, beyond = np.zeros(len(model.meshes)), False
    for i, (line, numbers) in enumerate(zip(model.meshes, train.flanks_of_mesh, strict=True)):
        open_ = np.ones(samples, dtype=bool)
        for number, sign in zip(numbers, (1.0, -1.0), strict=False):
            at = train.forces.flank(number, theta, orbit.speed, u, du)
            force[:, i] += sign * at.force
            open_ &= at.apart
            beyond |= bool(at.beyond.any())
        along = train.forces.freedoms[numbers[0], 0]
        approach[:, i], apart[i] = u[:, along], open_.mean()
        if line.law is None:
            force[:, i] += line.damping * du[:, along]
    omega = omega0 * np.arange(count + 1)
    modal = system.linear.modal(omega, orbit.speed, orbit.forces)
    acceleration = -(omega**2)[:, None] * (modal @ train.bores_of_modes.T)
    power = None
    if train.radiation_of_modes is not None:
        square = (modal.conj() * (modal @ train.radiation_of_modes)).sum(axis=1).real
        power = 0.5 * AIR_IMPEDANCE * omega**2 * np.maximum(square, 0.0)
    frequency = omega / (2.0 * math.pi)
    return SteadyState(
        orbit.speed, branch, orbit, 2.0 * math.pi / omega0, frequency, np.arange(count + 1) / system.turns, force,
        approach, apart, beyond, acceleration, power, multipliers,
    )  # fmt: skip
