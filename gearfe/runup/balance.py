r"""Steady motions by harmonic balance: linear behind a few freedoms, everything else evaluated in time.

With the harmonics :math:`u(\theta) = \mathrm{Re}\sum_k \hat u_k e^{ik\cdot\theta}`, :math:`\theta = \omega t`, of the
freedoms and the forces :math:`f(\theta, u, \dot u)` over one phase (a periodic motion) or several (a quasi-periodic
one; Schilder, Vogt, Schreiber & Osinga, Int. J. Numer. Meth. Eng. 67, 2006; Guskov & Thouverez, J. Vib. Acoust. 134,
2012; Krack & Gross, Harmonic Balance for Nonlinear Vibration Problems, 2019),

.. math::
    r_k = \hat u_k - \hat u^0_k - H(ik\cdot\omega)\,\hat f_k(\hat u) = 0

for the first K harmonics of `gearfe.runup.torus`.

Forces are sampled over the phases and transformed (alternating frequency/time; Cameron & Griffin, J. Appl. Mech. 56,
1989). Newton's method takes their derivatives from the same samples: with the Fourier coefficients g of df/du,

.. math:: \delta\hat f_k = \sum_l g_{k-l}\,\delta\hat u_l + g_{k+l}\,\overline{\delta\hat u_l} .

Amplitudes that change and follow others little through the forces are no unknowns of Newton's method but are found by
substitution, which converges there by itself. The error is estimated from what is left of the equations with twice the
harmonics and four times the samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ..typing import Array, ComplexArray, IntArray
from . import torus
from .linear import Linear
from .torus import Lattice

#: Newton steps, and halvings of one of them.
STEPS, HALVINGS = 60, 8
#: A motion is found where what is left of the equations is smaller than this part of the tolerance.
FOUND = 3e-2
#: Where Newton's method goes to and fro over a touch of flanks that falls on a sample, this many steps without halving
#: what is left end it; less than this is left to the error estimate to judge, which asks for more samples.
IDLE, LEFT = 8, 1e-4
#: A step that leaves more than this of the residual asks for a new Jacobian.
SLOW = 0.2
#: Amplitudes are unknowns of Newton's method where a change of them comes back larger than this through the forces, and
#: their harmonic is larger than this part of the scale.
COMES_BACK, PRESENT = 0.1, 1e-7
#: The error estimate is multiplied by this.
SAFETY = 2.0
#: Where the estimate misses the tolerance, harmonics grow by this factor.
GROWTH = 1.5
#: Harmonics to begin with, at most, where there are several phases.
PLENTY = 256
#: Most harmonics (half as many with two phases, a quarter with three: these take more samples), and unknown amplitudes.
MOST_HARMONICS, MOST_UNKNOWN = 4096, 800


class Pushes(NamedTuple):
    """Forces at S places of the phases, and their derivatives."""

    value: Array  # (S, m)
    by_place: Array  # (S, m, m): of force i with freedom j
    by_rate: Array | None  # (S, m, m)


class SteadyForces(Protocol):
    """What is not linear, or not constant."""

    def __call__(self, theta: Array, speed: float, u: Array, du: Array) -> Pushes:
        """Forces at phases theta (S, n), the freedoms and their rates (1/s) being u and du, (S, m)."""


@dataclass(frozen=True, eq=False)
class Oscillator:
    """A linear part with periodic forces.

    Parameters
    ----------
    linear, forces
        Its parts.
    turns : (n,)
        Turns of the drive in one period of each phase: ``omega = |speed| / turns``.
    scale : (m,)
        Size of each freedom, by which errors are measured.
    orders : (meshes, n)
        Harmonics that excite, one for each mesh: its cycles in a period of its phase.
    limit
        Largest motion that means something, in parts of the scale.
    """

    linear: Linear
    forces: SteadyForces
    turns: tuple[float, ...]
    scale: Array
    orders: tuple[tuple[int, ...], ...] = ((1,),)
    limit: float = math.inf

    @cached_property
    def periods(self) -> tuple[float, ...]:
        """Of the phases, in parts of that of the first."""
        return tuple(turns / self.turns[0] for turns in self.turns)

    def omega(self, speed: float, count: int) -> Array:
        """Angular frequencies (rad/s) of the harmonics 0 to `count`, none negative."""
        waves, _ = torus.harmonics(self.periods, count)
        return np.asarray((waves * (abs(speed) / np.array(self.turns))).sum(axis=1))

    def lattice(self, count: int) -> Lattice:
        """Places at which so many harmonics are sampled."""
        return torus.lattice(self.periods, count)

    def harmonics(self, speed: float, highest: float) -> int:
        """Number of harmonics: multiples up to an angular frequency (rad/s), eight of each mesh at least.

        With several phases they reach less far where that would be more than `PLENTY`: the error estimate adds to them.
        """
        order = max(8 * cycles / b for mesh in self.orders for cycles, b in zip(mesh, self.periods, strict=True))
        least = torus.count_below(self.periods, order)
        count = torus.count_below(self.periods, max(order, highest * self.turns[0] / abs(speed)))
        return self.rounded(count if len(self.turns) == 1 else max(least, min(count, PLENTY)))

    def rounded(self, harmonics: float) -> int:
        """Number whose samples transform quickly, at least as many as asked for but for the most."""
        return min(8 * math.ceil(harmonics / 8), MOST_HARMONICS >> len(self.turns) - 1)

    def flexibility(self, speed: float, count: int) -> ComplexArray:
        """H at harmonics 0 to `count`, (count + 1, m, m)."""
        return self.linear.flexibility(self.omega(speed, count), speed)


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic or quasi-periodic motion.

    Attributes
    ----------
    speed
        Of the drive (rad/s).
    places : (K + 1, m)
        Complex amplitudes of the freedoms at the harmonics 0 to K.
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


class Unknowns(NamedTuple):
    """Amplitudes that Newton's method finds: (u,) numbers of harmonics, rising, and of freedoms."""

    lines: IntArray
    freedoms: IntArray

    def packed(self, amplitudes: ComplexArray, scale: Array) -> Array:
        """Real unknowns in parts of the scale: all real parts, then the imaginary ones but those of the constant."""
        a = amplitudes[self.lines, self.freedoms] / scale[self.freedoms]
        return np.concatenate([a.real, a[self.lines > 0].imag])

    def unpacked(self, x: Array, scale: Array) -> ComplexArray:
        """(u,) amplitudes: the reverse of `packed`."""
        u = len(self.lines)
        made = x[:u].astype(complex)
        made[self.lines > 0] += 1j * x[u:]
        return np.asarray(made * scale[self.freedoms])


class Newton(NamedTuple):
    """The Jacobian of some unknowns, factorised."""

    unknowns: Unknowns
    factors: tuple[Array, Array]

    def step(self, residual: ComplexArray, scale: Array) -> ComplexArray:
        """Change of all amplitudes: that of Newton's method, and by substitution where they are no unknowns."""
        made, at = -residual, self.unknowns
        found = lu_solve(self.factors, at.packed(residual, scale), check_finite=False)
        made[at.lines, at.freedoms] = -at.unpacked(found, scale)
        return made


class Evaluated(NamedTuple):
    """The equations at some amplitudes."""

    residual: ComplexArray  # (K + 1, m)
    forces: ComplexArray  # (K + 1, m)
    pushes: Pushes
    lattice: Lattice


def widened(amplitudes: ComplexArray, count: int) -> ComplexArray:
    """(count + 1, m) amplitudes up to another harmonic, new ones 0."""
    made = np.zeros((count + 1, amplitudes.shape[1]), dtype=complex)
    shared = min(count + 1, len(amplitudes))
    made[:shared] = amplitudes[:shared]
    return made


def evaluate(
    system: Oscillator, speed: float, places: ComplexArray, lattice: Lattice, flexibility: ComplexArray
) -> Evaluated:
    """What is left of the equations."""
    turning = 1j * system.omega(speed, len(places) - 1)[:, None]
    u, du = lattice.synthesis(places), lattice.synthesis(turning * places)
    pushes = system.forces(lattice.theta, speed, u, du)
    forces = lattice.analysis(pushes.value)[: len(places)]
    return Evaluated(places - moved(system, flexibility, forces), forces, pushes, lattice)


def moved(system: Oscillator, flexibility: ComplexArray, forces: ComplexArray) -> ComplexArray:
    """Amplitudes (K + 1, m) of the freedoms under forces of such amplitudes and the constant one."""
    made = (flexibility @ forces[..., None])[..., 0]
    made[0] += system.linear.rest
    return np.asarray(made)


def jacobian(system: Oscillator, speed: float, unknowns: Unknowns, at: Evaluated, flexibility: ComplexArray) -> Array:
    """Derivative of the residual of the unknowns with these, in parts of the scale, over `packed` ones."""
    pushes, samples, scale = at.pushes, len(at.pushes.value), system.scale
    lines, freedoms, u = unknowns.lines, unknowns.freedoms, len(unknowns.lines)
    residue, turning = at.lattice.residue[lines], 1j * system.omega(speed, int(lines.max()))[lines]
    half = np.where(lines == 0, 0.5, 1.0)
    plus, minus = np.empty((u, u), dtype=complex), np.empty((u, u), dtype=complex)
    for j in np.unique(freedoms):
        by = np.flatnonzero(freedoms == j)
        near, far = (residue[:, None] - residue[by]) % samples, (residue[:, None] + residue[by]) % samples
        A, B = np.zeros(near.shape, dtype=complex), np.zeros(near.shape, dtype=complex)
        for i in range(len(scale)):
            H = (half * flexibility[lines, freedoms, i] * scale[j] / scale[freedoms])[:, None]
            place, rate = pushes.by_place[:, i, j], None if pushes.by_rate is None else pushes.by_rate[:, i, j]
            if place.any():
                g = np.fft.fft(place) / samples
                A += H * g[near]
                B += H * g[far]
            if rate is not None and rate.any():
                g = np.fft.fft(rate) / samples
                A += H * g[near] * turning[by]
                B -= H * g[far] * turning[by]
        plus[:, by], minus[:, by] = A + B, A - B
    wave = lines > 0
    made = np.empty((u + wave.sum(), u + wave.sum()))
    made[:u, :u], made[:u, u:] = -plus.real, minus[:, wave].imag
    made[u:, :u], made[u:, u:] = -plus[wave].imag, -minus[np.ix_(wave, wave)].real
    made[np.diag_indices(len(made))] += 1.0
    return made


def flexibility_of(system: Oscillator, speed: float, count: int) -> ComplexArray:
    """H at harmonics 0 to `count`, made at once up to where `error_of` asks for it."""
    return system.flexibility(speed, 2 * count)[: count + 1]


def unknowns_of(
    system: Oscillator, speed: float, places: ComplexArray, at: Evaluated, flexibility: ComplexArray,
    least: float = COMES_BACK,
) -> Unknowns:  # fmt: skip
    """Amplitudes that need Newton's method: those whose change comes back by more than this part through the forces,
    those that follow others by more, of harmonics that are there; and the constant of all freedoms.

    One that follows and is no unknown lags a step behind: what is left of the equations then grows in a good step.
    """
    ratio = system.scale[None, :] / system.scale[:, None]
    strength = np.abs(at.pushes.by_place).mean(axis=0) * ratio
    if at.pushes.by_rate is not None:
        omega = system.omega(speed, len(places) - 1)[:, None, None]
        strength = strength + omega * np.abs(at.pushes.by_rate).mean(axis=0) * ratio
    back = (np.abs(flexibility) * ratio) @ strength  # (K + 1, m, m)
    acts = (back.sum(axis=1) > least).any(axis=0)
    size = np.abs(places / system.scale).max(axis=1, keepdims=True)
    gain = back[:, acts].sum(axis=1) * (size > PRESENT)
    follows = back[:, :, acts].sum(axis=2) * (size > PRESENT)
    taken = (gain > least) | (follows > least)
    if taken.sum() > MOST_UNKNOWN:
        taken = taken & (gain * size >= np.sort((gain * size)[taken])[-MOST_UNKNOWN])
    taken[0] = True
    lines, freedoms = np.nonzero(taken)
    return Unknowns(lines, freedoms)


def newton(system: Oscillator, speed: float, unknowns: Unknowns, at: Evaluated, flexibility: ComplexArray) -> Newton:
    """Factorised Jacobian."""
    J = jacobian(system, speed, unknowns, at, flexibility)
    return Newton(unknowns, lu_factor(J, overwrite_a=True, check_finite=False))


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
    H, lattice, scale = flexibility_of(system, speed, count), system.lattice(count), system.scale
    places = guess.copy()
    places[0] = places[0].real
    at = evaluate(system, speed, places, lattice, H)
    size, fresh, taken = size_of(at.residual, scale), False, 0
    best, idle = (size, places, at.forces), 0
    if before is not None and before.unknowns.lines[-1] > count:
        before = None
    enough = FOUND * tolerance
    while size >= enough and taken < steps and idle < IDLE and math.isfinite(size):
        if before is None:
            before = newton(system, speed, unknowns_of(system, speed, places, at, H), at, H)
            fresh = True
        taken += 1
        step = before.step(at.residual, scale)
        part = 1.0
        for _ in range(HALVINGS if fresh else 1):
            new = evaluate(system, speed, places + part * step, lattice, H)
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
    left = evaluate(system, orbit.speed, places, system.lattice(2 * count), H)
    if before is None:
        before = newton(system, orbit.speed, unknowns_of(system, orbit.speed, places, left, H), left, H)
    step = before.step(left.residual, system.scale)
    return SAFETY * size_of(step, system.scale), places + step


def settled(system: Oscillator, orbit: Orbit, before: Newton | None, tolerance: float) -> tuple[Orbit, Newton | None]:
    """An orbit with as many harmonics as its error estimate needs to meet a tolerance."""
    while orbit.found:
        error, guess = error_of(system, orbit, before)
        orbit = replace(orbit, error=error)
        more = system.rounded(GROWTH * orbit.harmonics)
        if error <= tolerance or more <= orbit.harmonics:
            break
        guess = guess[: more + 1]
        steps = orbit.steps
        orbit, before = solve(system, orbit.speed, guess, tolerance, before)
        orbit = replace(orbit, steps=steps + orbit.steps)
    return orbit, before
