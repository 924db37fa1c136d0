r"""What a steady motion of a train means: forces, transmission errors, vibration, power.

All accelerations follow from the forces of the motion and the flexibility of the whole train. They therefore contain
harmonics far above those of Newton's method, too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, ComplexArray, IntArray
from ..gearbox.radiation import AIR_IMPEDANCE
from .balance import Orbit
from .condensed import CondensedTrain
from .linear import real_times
from .stability import STABLE, window
from .torus import Lattice


@dataclass(frozen=True, eq=False)
class SteadyState:
    """Steady running at one speed: S places of its n phases, K + 1 harmonics, the constant first.

    Attributes
    ----------
    speed
        Of the drive (rad/s).
    branch
        0 for the branch that the run-up begins on; one more after each turning point.
    orbit
        The motion at the freedoms of the meshes.
    period
        Of the motion (s); infinite where it has several phases.
    waves : (K + 1, n)
        k: a harmonic has the phase k . theta. With one phase k = 0, 1, 2, ...
    numbers
        Number of a harmonic by its k.
    frequency : (K + 1,)
        Hz.
    order : (K + 1,)
        Frequency over that of the drive's turns.
    lattice
        Places S: ``lattice.theta`` (S, n), of one phase even over the period.
    force : (S, meshes)
        Contact force (N), of back flanks negative.
    transmission_error : (S, meshes)
        Approach along the line of action (m).
    apart : (meshes,)
        Share of the time without contact.
    beyond
        Whether a mesh goes beyond what its law is known for.
    displacement : (shafts,)
        Largest displacement of each shaft along an axis (m), its mean included, of planets against their carrier.
    acceleration : (K + 1, bores)
        Complex amplitudes along the shafts at the attachments (m/s2).
    bearing : (K + 1, bores, 6)
        Complex amplitudes of the force (N) and moment (N m) of the shaft on each bore about its reference point, along
        x, y, z.
    power : (K + 1,) or None
        Equivalent radiated power of each line (W); None for a rigid housing.
    span
        Time over which multipliers are made (s): the period, or after which all phases are back.
    multipliers : (2 modes,) or None
        Floquet multipliers of the motion, largest modulus first; None where not computed, one NaN
        where stability is undecided.
    """

    speed: float
    branch: int
    orbit: Orbit
    period: float
    waves: IntArray
    numbers: Mapping[tuple[int, ...], int]
    frequency: Array
    order: Array
    lattice: Lattice
    force: Array
    transmission_error: Array
    apart: Array
    beyond: bool
    displacement: Array
    acceleration: ComplexArray
    bearing: ComplexArray
    power: Array | None
    span: float
    multipliers: ComplexArray | None = None

    @property
    def stable(self) -> bool | None:
        """Whether small disturbances die out; None where it was not computed or is undecided."""
        largest = math.nan if self.multipliers is None else abs(self.multipliers[0])
        return None if math.isnan(largest) else bool(largest <= STABLE)

    @property
    def growth(self) -> float:
        """Rate (1/s) by which the slowest disturbance grows; NaN where it is not known."""
        if self.multipliers is None or not abs(self.multipliers[0]) > 0.0:
            return math.nan
        return math.log(abs(self.multipliers[0])) / self.span

    @property
    def error(self) -> float:
        """Estimate of the error of the mesh deflections, relative to those under the steady force."""
        return self.orbit.error

    def rms(self, band_hz: float) -> Array:
        """(bores,) root mean square of the accelerations up to a frequency (m/s2)."""
        inside = (self.frequency > 0.0) & (self.frequency <= band_hz)
        return np.asarray(np.sqrt(0.5 * (np.abs(self.acceleration[inside]) ** 2).sum(axis=0)))

    def lines(self, values: Array) -> ComplexArray:
        """(K + 1, ...) complex amplitudes of samples (S, ...) at the harmonics."""
        return self.lattice.analysis(values)[: len(self.frequency)]


def steady_result(
    train: CondensedTrain, orbit: Orbit, branch: int, multipliers: ComplexArray | None = None
) -> SteadyState:
    """Evaluate forces, transmission errors, accelerations, bearing loads and power of an orbit.

    Parameters
    ----------
    train : CondensedTrain
        The train.
    orbit : Orbit
        Its motion at the freedoms of the meshes.
    branch : int
        Number of the branch, see `SteadyState`.
    multipliers : ndarray of complex, shape (2 modes,), optional
        Floquet multipliers; None if they were not computed.
    """
    system, model = train.system, train.model
    count = orbit.harmonics
    omega, lattice = system.omega(orbit.speed, count), system.lattice(count)
    theta, samples = lattice.theta, len(lattice.theta)
    u, du = lattice.synthesis(orbit.places), lattice.synthesis(1j * omega[:, None] * orbit.places)
    force, approach = np.zeros((samples, len(model.meshes))), np.zeros((samples, len(model.meshes)))
    apart, beyond = np.zeros(len(model.meshes)), False
    of_flanks = train.forces.of_flanks(theta, orbit.speed, u, du)
    for i, (line, numbers) in enumerate(zip(model.meshes, train.flanks_of_mesh, strict=True)):
        open_ = np.ones(samples, dtype=bool)
        for number, sign in zip(numbers, (1.0, -1.0), strict=False):
            at = of_flanks[number]
            force[:, i] += sign * at.force
            open_ &= at.apart
            beyond |= bool(at.beyond.any())
        along = train.forces.freedoms[numbers[0], 0]
        approach[:, i], apart[i] = u[:, along], open_.mean()
        if not line.in_contact:
            force[:, i] += line.damping * du[:, along]
    forces = system.whole_forces(orbit)
    modal = system.linear.modal(omega, orbit.speed, forces)
    acceleration = -(omega**2)[:, None] * real_times(modal, train.bores_of_modes.T)
    moved = lattice.synthesis(real_times(modal, train.displaced_of_modes)) + model.modal.origin @ model.displaced
    displacement = np.abs(moved).reshape(len(moved), -1, 3).max(axis=(0, 2), initial=0.0)
    power = None
    if train.radiation_of_modes is not None:
        square = (modal.conj() * real_times(modal, train.radiation_of_modes)).sum(axis=1).real
        power = 0.5 * AIR_IMPEDANCE * omega**2 * np.maximum(square, 0.0)
    bearing = _bearing(train, orbit.speed, forces, omega, modal, lattice)
    second = 2.0 * math.pi / abs(orbit.speed)  # of one turn
    period = second * system.turns[0] if len(system.turns) == 1 else math.inf
    return SteadyState(
        orbit.speed, branch, orbit, period, system.waves(count),
        system.numbers(count), omega / (2.0 * math.pi), omega / abs(orbit.speed), lattice, force,
        approach, apart, beyond, displacement, acceleration, bearing, power, second * window(system).turns, multipliers,
    )  # fmt: skip


def _bearing(
    train: CondensedTrain, speed: float, forces: ComplexArray, omega: Array, modal: ComplexArray, lattice: Lattice
) -> ComplexArray:
    """Return the amplitudes of the loads on the bores, in an elastic housing along axes that stand still.

    Parameters
    ----------
    train : CondensedTrain
        The train.
    speed : float
        Speed of the drive (rad/s).
    forces : ndarray of complex, shape (K + 1, m)
        Amplitudes of all forces at the freedoms.
    omega : ndarray, shape (K + 1,)
        Angular frequencies (rad/s).
    modal : ndarray of complex, shape (K + 1, n)
        Amplitudes of the modal coordinates.
    lattice : Lattice
        Samples of the harmonics.
    """
    model, turning = train.model, 1j * omega[:, None]
    q = real_times(modal, model.modal.T.T)
    v, a = turning * q, -(omega**2)[:, None] * q
    acting = real_times(forces, train.directions.T)
    for line in model.meshes:
        if line.in_contact:  # which the constant part has, too
            acting += line.rayleigh * real_times(v, np.outer(line.row, line.row))
    q[0] += model.modal.origin
    turns = model.turning
    acting += speed * (real_times(v, turns.gyroscopic.T) + real_times(q, turns.circulating.T))
    acting += speed**2 * real_times(q, turns.stiffening)
    acting[0] += train.torque + speed**2 * turns.thrown
    loads, still = model.bearings.parts(q, v, a, acting, speed)
    if train.frames.any():
        vectors = lattice.synthesis(loads.reshape(len(q), -1)).reshape(-1, len(model.bores), 2, 3)
        turned = model.on_bores(lattice.theta @ train.frames.T, vectors)
        loads = lattice.analysis(turned.reshape(len(turned), -1, 6))[: len(q)]
    return np.asarray(loads + still)
