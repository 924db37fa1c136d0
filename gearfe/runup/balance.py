r"""Periodic motions by harmonic balance: linear behind a few freedoms, everything else evaluated in time.

With the harmonics :math:`u(\theta) = \mathrm{Re}\sum_k \hat u_k e^{ik\theta}`, :math:`\theta = \omega_0 t`, of the
freedoms and the forces :math:`f(\theta, u, \dot u)`,

.. math::
    r_k = \hat u_k - \hat u^0_k - H(ik\omega_0)\,\hat f_k(\hat u) = 0 ,\qquad k = 0 \dots K .

Forces are sampled over the period and transformed (alternating frequency/time; Cameron & Griffin, J. Appl. Mech. 56,
1989). Newton's method takes their derivatives from the same samples: with the Fourier coefficients g of df/du,

.. math:: \delta\hat f_k = \sum_l g_{k-l}\,\delta\hat u_l + g_{k+l}\,\overline{\delta\hat u_l} .

Harmonics at which the forces' changes move the freedoms little are no unknowns of Newton's method but follow by
substitution, which converges there by itself. The error is estimated from what is left of the equations with twice the
harmonics and four times the samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .linear import Linear

#: Newton steps, and halvings of one of them.
STEPS, HALVINGS = 60, 8
#: A motion is found where what is left of the equations is smaller than this part of the tolerance.
FOUND = 3e-2
#: Where Newton's method goes to and fro over a touch of flanks that falls on a sample, this many steps without halving
#: what is left end it; less than this is left to the error estimate to judge, which asks for more samples.
IDLE, LEFT = 8, 1e-4
#: A step that leaves more than this of the residual asks for a new Jacobian.
SLOW = 0.2
#: Harmonics are unknowns of Newton's method where a change of them comes back larger than this through the forces, and
#: they are larger than this part of the scale.
COMES_BACK, PRESENT = 0.1, 1e-7
#: Samples of the period for each harmonic of the highest.
SAMPLES = 4
#: The error estimate is multiplied by this.
SAFETY = 2.0
#: Where the estimate misses the tolerance, harmonics grow by this factor.
GROWTH = 1.5
#: Most harmonics, and most unknown ones.
MOST_HARMONICS, MOST_UNKNOWN = 4096, 400


class Pushes(NamedTuple):
    """Forces at S places of the period, and their derivatives."""

    value: Array  # (S, m)
    by_place: Array  # (S, m, m): of force i with freedom j
    by_rate: Array | None  # (S, m, m)


class PeriodicForces(Protocol):
    """What is not linear, or not constant."""

    def __call__(self, theta: Array, speed: float, u: Array, du: Array) -> Pushes:
        """Forces at theta (S,), the freedoms and their rates (1/s) being u and du, (S, m)."""


@dataclass(frozen=True, eq=False)
class Oscillator:
    """A linear part with periodic forces.

    Parameters
    ----------
    linear, forces
        Its parts.
    turns
        Turns of the drive in one period: ``omega0 = |speed| / turns``.
    scale : (m,)
        Size of each freedom, by which errors are measured.
    orders
        Harmonics of the period that excite: mesh cycles in a period.
    limit
        Largest motion that means something, in parts of the scale.
    """

    linear: Linear
    forces: PeriodicForces
    turns: float
    scale: Array
    orders: tuple[int, ...] = (1,)
    limit: float = math.inf

    def omega0(self, speed: float) -> float:
        """Angular frequency of the period (rad/s)."""
        return abs(speed) / self.turns

    def harmonics(self, speed: float, highest: float) -> int:
        """Harmonics up to an angular frequency (rad/s), and eight of each order at least."""
        return rounded(max(8 * max(self.orders), highest / self.omega0(speed)))

    def flexibility(self, speed: float, count: int) -> ComplexArray:
        """H at harmonics 0 to `count`, (count + 1, m, m)."""
        return self.linear.flexibility(np.arange(count + 1) * self.omega0(speed), speed)


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic motion.

    Attributes
    ----------
    speed
        Of the drive (rad/s).
    places : (K + 1, m)
        Complex amplitudes of the freedoms at the harmonics 0 to K of the period.
    forces : (K + 1, m)
        Of the forces on them.
    error
        Estimate of the error of the freedoms, in parts of their scale; not-a-number where there is none.
    found
        Whether the equations are solved.
    steps
        Newton steps taken.
    """

    speed: float
    places: ComplexArray
    forces: ComplexArray
    error: float
    found: bool
    steps: int

    @property
    def harmonics(self) -> int:
        """K."""
        return len(self.places) - 1

    def with_harmonics(self, count: int) -> ComplexArray:
        """Amplitudes of the freedoms up to another harmonic, new ones 0."""
        return widened(self.places, count)


class Newton(NamedTuple):
    """The Jacobian of some unknown harmonics, factorised."""

    waves: IntArray
    factors: tuple[Array, Array]

    def __call__(self, residual: Array) -> Array:
        """Jacobian's inverse times a vector."""
        return np.asarray(lu_solve(self.factors, residual, check_finite=False))


class Evaluated(NamedTuple):
    """The equations at some amplitudes."""

    residual: ComplexArray  # (K + 1, m)
    forces: ComplexArray  # (K + 1, m)
    pushes: Pushes


def widened(amplitudes: ComplexArray, count: int) -> ComplexArray:
    """(count + 1, m) amplitudes up to another harmonic, new ones 0."""
    made = np.zeros((count + 1, amplitudes.shape[1]), dtype=complex)
    shared = min(count + 1, len(amplitudes))
    made[:shared] = amplitudes[:shared]
    return made


def synthesis(amplitudes: ComplexArray, samples: int) -> Array:
    """(samples, m) values of ``Re sum a_k exp(i k theta)`` at even places."""
    spectrum = np.zeros((samples // 2 + 1, amplitudes.shape[1]), dtype=complex)
    spectrum[: len(amplitudes)] = 0.5 * samples * amplitudes
    spectrum[0] *= 2.0
    return np.asarray(np.fft.irfft(spectrum, samples, axis=0))


def analysis(values: Array) -> ComplexArray:
    """(samples // 2 + 1, ...) complex amplitudes of values at even places."""
    made = np.fft.rfft(values, axis=0) * (2.0 / len(values))
    made[0] *= 0.5
    return np.asarray(made)


def rounded(harmonics: float) -> int:
    """Number of harmonics whose samples transform quickly, at least as many as asked for but for the most."""
    return min(8 * math.ceil(harmonics / 8), MOST_HARMONICS)


def samples_of(harmonics: int) -> int:
    """Even number of samples of a period."""
    return 2 * math.ceil(0.5 * SAMPLES * max(harmonics, 16))


def rates(amplitudes: ComplexArray, omega0: float) -> ComplexArray:
    """Amplitudes of the time derivative."""
    made: ComplexArray = 1j * omega0 * np.arange(len(amplitudes))[:, None] * amplitudes
    return made


def evaluate(
    system: Oscillator, speed: float, places: ComplexArray, samples: int, flexibility: ComplexArray
) -> Evaluated:
    """What is left of the equations."""
    theta = 2.0 * math.pi * np.arange(samples) / samples
    u, du = synthesis(places, samples), synthesis(rates(places, system.omega0(speed)), samples)
    pushes = system.forces(theta, speed, u, du)
    forces = analysis(pushes.value)[: len(places)]
    return Evaluated(places - moved(system, flexibility, forces), forces, pushes)


def moved(system: Oscillator, flexibility: ComplexArray, forces: ComplexArray) -> ComplexArray:
    """Amplitudes (K + 1, m) of the freedoms under forces of such amplitudes and the constant one."""
    made = (flexibility @ forces[..., None])[..., 0]
    made[0] += system.linear.rest
    return np.asarray(made)


def jacobian(system: Oscillator, speed: float, waves: IntArray, pushes: Pushes, flexibility: ComplexArray) -> Array:
    """Derivative of the residual of some harmonics with these, in parts of the scale, over `packed` unknowns."""
    samples, k, m = len(pushes.value), len(waves), system.linear.size
    near, far = (waves[:, None] - waves[None, :]) % samples, (waves[:, None] + waves[None, :]) % samples
    ratio = system.scale[None, :] / system.scale[:, None]
    g = np.fft.fft(pushes.by_place, axis=0) / samples
    A, B = g[near], g[far]  # (k, l, m, m)
    if pushes.by_rate is not None:
        g, turning = np.fft.fft(pushes.by_rate, axis=0) / samples, 1j * system.omega0(speed) * waves
        A = A + g[near] * turning[None, :, None, None]
        B = B - g[far] * turning[None, :, None, None]
    A[0] *= 0.5
    B[0] *= 0.5
    H = flexibility[waves] * ratio
    A, B = (H @ (x * ratio).transpose(0, 2, 1, 3).reshape(k, m, k * m) for x in (A, B))
    A, B = (x.reshape(k * m, k * m) for x in (A, B))
    plus, minus = A + B, 1j * (A - B)
    made = -np.block([[plus.real, minus[:, m:].real], [plus[m:].imag, minus[m:, m:].imag]])
    made[np.diag_indices(len(made))] += 1.0
    return np.asarray(made)


def packed(amplitudes: ComplexArray, scale: Array) -> Array:
    """Real unknowns in parts of the scale: all real parts, then the imaginary ones but that of the mean."""
    a = amplitudes / scale
    return np.concatenate([a.real.ravel(), a[1:].imag.ravel()])


def unpacked(x: Array, scale: Array) -> ComplexArray:
    """The reverse of `packed`."""
    m = len(scale)
    count = (len(x) // m + 1) // 2
    made = x[: count * m].reshape(count, m).astype(complex)
    made[1:] += 1j * x[count * m :].reshape(count - 1, m)
    return np.asarray(made * scale)


def flexibility_of(system: Oscillator, speed: float, count: int) -> ComplexArray:
    """H at harmonics 0 to `count`, made at once up to where `error_of` asks for it."""
    return system.flexibility(speed, 2 * count)[: count + 1]


def unknown_waves(
    system: Oscillator, places: ComplexArray, pushes: Pushes, flexibility: ComplexArray, least: float = COMES_BACK
) -> IntArray:
    """Harmonics that need Newton's method: where this part of a change comes back through the forces, and which are
    there.
    """
    ratio = system.scale[None, :] / system.scale[:, None]
    strength = np.abs(pushes.by_place).mean(axis=0) * ratio
    back = ((np.abs(flexibility) * ratio) @ strength).sum(axis=2).max(axis=1)
    there: BoolArray = np.abs(places / system.scale).max(axis=1) > PRESENT
    taken = there & (back > least)
    taken[0] = True
    found = np.flatnonzero(taken)
    if len(found) > MOST_UNKNOWN:
        strongest = np.argsort(-(back * np.abs(places / system.scale).max(axis=1))[found], kind="stable")
        found = np.union1d([0], found[strongest[:MOST_UNKNOWN]])
    return found


def newton(system: Oscillator, speed: float, waves: IntArray, pushes: Pushes, flexibility: ComplexArray) -> Newton:
    """Factorised Jacobian."""
    J = jacobian(system, speed, waves, pushes, flexibility)
    return Newton(waves, lu_factor(J, check_finite=False))


def size_of(amplitudes: ComplexArray, scale: Array) -> float:
    """Norm in parts of the scale."""
    return float(np.linalg.norm(amplitudes / scale))


def solve(
    system: Oscillator,
    speed: float,
    guess: ComplexArray,
    tolerance: float,
    before: Newton | None = None,
    *,
    steps: int = STEPS,
) -> tuple[Orbit, Newton | None]:
    """Periodic motion at a speed, from a guess; without an error estimate.

    Parameters
    ----------
    guess : (K + 1, m)
        Amplitudes to begin with.
    tolerance
        Of the error in the end, in parts of the scale.
    before
        A Jacobian to begin with, such as that of a neighbouring speed; a new one is made where it is too slow.
    """
    count = len(guess) - 1
    H, samples, scale = flexibility_of(system, speed, count), samples_of(count), system.scale
    places = guess.copy()
    places[0] = places[0].real
    at = evaluate(system, speed, places, samples, H)
    size, fresh, taken = size_of(at.residual, scale), False, 0
    best, idle = (size, places, at.forces), 0
    if before is not None and before.waves[-1] > count:
        before = None
    enough = FOUND * tolerance
    while size >= enough and taken < steps and idle < IDLE and math.isfinite(size):
        if before is None:
            waves = unknown_waves(system, places, at.pushes, H)
            before, fresh = newton(system, speed, waves, at.pushes, H), True
        taken += 1
        step = -at.residual
        step[before.waves] = unpacked(-before(packed(at.residual[before.waves], scale)), scale)
        part = 1.0
        for _ in range(HALVINGS if fresh else 1):
            new = evaluate(system, speed, places + part * step, samples, H)
            left = size_of(new.residual, scale)
            if left <= (1.0 - 0.1 * part) * size:
                break
            part *= 0.5
        else:
            if not fresh:  # this was another motion's Jacobian
                before = None
                continue
        if left > SLOW * size:
            before = None
        places, at, size, fresh = places + part * step, new, left, False
        idle = 0 if size < 0.5 * best[0] else idle + 1
        if size < best[0]:
            best = size, places, at.forces
    found = best[0] < (enough if idle < IDLE else max(enough, LEFT))
    return Orbit(speed, best[1], best[2], math.nan, bool(found), taken), before


def error_of(system: Oscillator, orbit: Orbit, before: Newton | None) -> tuple[float, ComplexArray]:
    """Error estimate of an orbit, and the amplitudes that twice the harmonics would make at once.

    What is left of the equations on four times the samples is taken to a change of the unknowns by the Jacobian; the
    other harmonics change by it themselves.
    """
    count = 2 * orbit.harmonics
    H = system.flexibility(orbit.speed, count)
    places = orbit.with_harmonics(count)
    left = evaluate(system, orbit.speed, places, samples_of(2 * count), H)
    if before is None:
        before = newton(system, orbit.speed, unknown_waves(system, places, left.pushes, H), left.pushes, H)
    step = -left.residual
    step[before.waves] = unpacked(-before(packed(left.residual[before.waves], system.scale)), system.scale)
    return SAFETY * size_of(step, system.scale), places + step


def settled(system: Oscillator, orbit: Orbit, before: Newton | None, tolerance: float) -> tuple[Orbit, Newton | None]:
    """An orbit with as many harmonics as its error estimate needs to meet a tolerance."""
    while orbit.found:
        error, guess = error_of(system, orbit, before)
        orbit = replace(orbit, error=error)
        more = rounded(GROWTH * orbit.harmonics)
        if error <= tolerance or more <= orbit.harmonics:
            break
        guess = guess[: more + 1]
        steps = orbit.steps
        orbit, before = solve(system, orbit.speed, guess, tolerance, before)
        orbit = replace(orbit, steps=steps + orbit.steps)
    return orbit, before
