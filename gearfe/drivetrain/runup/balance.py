r"""Steady motions by harmonic balance: linear behind a few freedoms, everything else evaluated in time.

With the harmonics :math:`u(\theta) = \mathrm{Re}\sum_k \hat u_k e^{ik\cdot\theta}`, :math:`\theta = \omega t`, of the
freedoms and the forces :math:`f(\theta, u, \dot u)` over one phase (a periodic motion) or several (a quasi-periodic
one; Schilder, Vogt, Schreiber & Osinga, Int. J. Numer. Meth. Eng. 67, 2006; Guskov & Thouverez, J. Vib. Acoust. 134,
2012; Krack & Gross, Harmonic Balance for Nonlinear Vibration Problems, 2019),

.. math::
    r_k = \hat u_k - \hat u^0_k - H(ik\cdot\omega)\,\hat f_k(\hat u) = 0

for the first K harmonics of `gearfe.drivetrain.runup.torus`.

Forces are sampled over the phases and transformed (alternating frequency/time; Cameron & Griffin, J. Appl. Mech. 56,
1989). Newton's method takes their derivatives from the same samples: a change of the amplitudes is made a motion, times
the derivatives a change of the forces, and transformed back,

.. math:: \delta r = \delta\hat u - H\,\mathcal F\Big[\frac{\partial f}{\partial u}\,\delta u
    + \frac{\partial f}{\partial\dot u}\,\delta\dot u\Big] .

H falls with the frequency, so this is the identity and a compact part, for which the method of generalised minimal
residuals converges in a few products without a matrix (`runup.krylov`). The error is estimated from what is left
of the equations with twice the harmonics and four times the samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from ...base.typing import Array, ComplexArray, IntArray
from . import torus
from .coupling import Coupling, TurnedSpring, coupling
from .krylov import gmres
from .linear import Linear
from .torus import Lattice

#: Newton steps, and halvings of one of them.
STEPS, HALVINGS = 60, 8
#: A motion is found where what is left of the equations is smaller than this part of the tolerance.
FOUND = 3e-2
#: Where Newton's method goes to and fro over a touch of flanks that falls on a sample, this many steps without halving
#: what is left end it; less than this is left to the error estimate, which adds samples.
IDLE, LEFT = 8, 1e-4
#: What a step of Newton's method leaves of the linear equations, and of those for the error estimate.
INEXACT, ROUGH = 0.03, 0.1
#: A step from within the range of convergence leaves less than this part (Deuflhard, Newton Methods for Nonlinear
#: Problems, 2004, Sec. 5.1: continuation with contractions of a half).
CONTRACTS = 0.5
#: The error estimate is multiplied by this.
SAFETY = 2.0
#: Where the estimate misses the tolerance, harmonics grow by this factor.
GROWTH = 1.5
#: Harmonics to begin with, at most, where there are several phases.
PLENTY = 256
#: Most harmonics: a bound on time and memory, not on the error, whose estimate stays.
MOST_HARMONICS = 8192
#: Equations of turned springs that are kept.
KEPT = 4


class Changes(NamedTuple):
    """Derivatives of m forces with m freedoms and their rates at S places of the phases, those not all zero."""

    forces: IntArray  # (e,) number of the force, rising
    freedoms: IntArray  # (e,) number of the freedom, or of the rate behind all m freedoms; each pair is there once
    values: Array  # (S, e)

    def of_freedoms(self, count: int) -> Changes:
        """Those with the freedoms alone, m of them."""
        chosen = self.freedoms < count
        return Changes(self.forces[chosen], self.freedoms[chosen], self.values[:, chosen])


def changes(entries: Sequence[Entries], size: int, samples: int) -> Changes:
    """Derivatives of m forces (`size`) at S places (`samples`) as the sum of some."""
    none = np.zeros(0, dtype=np.int64)
    forces, freedoms = (np.concatenate([none, *(entry[i] for entry in entries)]) for i in range(2))
    values = np.hstack([np.zeros((samples, 0)), *(entry[2] for entry in entries)])
    keys, numbers = np.unique(2 * size * forces + freedoms, return_inverse=True)
    if len(keys) < len(numbers):
        values = values @ np.eye(len(keys))[numbers]
    else:
        values = values[:, np.argsort(numbers)]
    chosen = values.any(axis=0)
    keys = keys[chosen]
    return Changes(keys // (2 * size), keys % (2 * size), values[:, chosen])


#: Derivatives of forces: numbers (e,) of forces, numbers (e,) of freedoms or behind them of rates, values (S, e).
Entries = tuple[IntArray, IntArray, Array]


@dataclass(frozen=True, eq=False)
class Pushes:
    """Forces at S places of the phases, and their derivatives.

    Parameters
    ----------
    value : (S, m)
        Forces.
    entries
        Their derivatives, the sum of all.
    momentum : (S, m), optional
        Its rate of change is a further force: of dampers that act in contact only.
    momentum_entries
        Derivatives of the momentum with the freedoms.
    """

    value: Array
    entries: Sequence[Entries]
    momentum: Array | None = None
    momentum_entries: Sequence[Entries] = ()

    @cached_property
    def by(self) -> Changes:
        """Derivatives of the forces."""
        return changes(self.entries, self.value.shape[1], len(self.value))

    @cached_property
    def momentum_by(self) -> Changes | None:
        """Derivatives of the momentum."""
        if self.momentum is None:
            return None
        return changes(self.momentum_entries, self.value.shape[1], len(self.value))


class SteadyForces(Protocol):
    """What is not linear, or not constant."""

    def __call__(self, theta: Array, speed: float, u: Array, du: Array, /) -> Pushes:
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
    start : (m,), optional
        Where the search of a first motion begins, beside the freedoms under the constant forces alone.
    carriers
        So many of the last phases are rotations of carriers, see `gearfe.drivetrain.runup.torus`.
    turned
        Springs and dampers between the frames of these and an elastic housing.
    """

    linear: Linear
    forces: SteadyForces
    turns: tuple[float, ...]
    scale: Array
    orders: tuple[tuple[int, ...], ...] = ((1,),)
    limit: float = math.inf
    start: Array | None = None
    carriers: int = 0
    turned: tuple[TurnedSpring, ...] = ()
    _last: dict[tuple[float, int], Coupling] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def phases(self) -> torus.Phases:
        """Periods of the phases, and how far multiples of meshes reach in combinations."""
        cycles = tuple(max(1, *column) for column in zip(*self.orders, strict=True))
        periods = tuple(turns / self.turns[0] for turns in self.turns)
        return torus.Phases.of(periods, cycles[: len(periods) - self.carriers])

    def waves(self, count: int) -> IntArray:
        """Numbers k of the harmonics 0 to `count`, (count + 1, n)."""
        return torus.harmonics(self.phases, count).waves

    def numbers(self, count: int) -> dict[tuple[int, ...], int]:
        """Number of each of the harmonics 0 to `count` by its k."""
        return torus.numbers(self.phases, count)

    def omega(self, speed: float, count: int) -> Array:
        """Angular frequencies (rad/s) of the harmonics 0 to `count`, none negative."""
        return np.asarray((self.waves(count) * (abs(speed) / np.array(self.turns))).sum(axis=1))

    def lattice(self, count: int) -> Lattice:
        """Places at which so many harmonics are sampled."""
        return torus.lattice(self.phases, count)

    def harmonics(self, speed: float, highest: float, multiples: int = 8) -> int:
        """Number of harmonics: multiples up to an angular frequency (rad/s), so many of each mesh at least.

        With several phases they reach less far where that would be more than `PLENTY`: the error estimate adds to them.
        """
        periods = self.phases.periods
        order = max(multiples * cycles / b for mesh in self.orders for cycles, b in zip(mesh, periods, strict=True))
        most = torus.harmonics(self.phases, MOST_HARMONICS if len(periods) == 1 else PLENTY).order[-1]
        band = min(highest * self.turns[0] / abs(speed), float(most))
        return self.rounded(torus.count_below(self.phases, max(order, band)))

    def rounded(self, harmonics: float) -> int:
        """Number whose samples transform quickly, at least the given one, up to the most."""
        return min(8 * math.ceil(harmonics / 8), MOST_HARMONICS)

    def rest(self, speed: float) -> Array:
        """(m,) freedoms under the constant forces alone."""
        return self.linear.rest(speed)

    def flexibility(self, speed: float, count: int) -> ComplexArray:
        """H at harmonics 0 to `count`, (count + 1, m, m)."""
        return self.linear.flexibility(self.omega(speed, count), speed)

    def coupled(self, speed: float, places: ComplexArray, flexibility: ComplexArray) -> ComplexArray:
        """Motion (K + 1, m) with the springs of carriers, for that of the constant part, whose H is given."""
        if not self.turned:
            return places
        key = speed, len(places)
        known = self._last.get(key)
        if known is None:
            count = len(places) - 1
            known = coupling(self.turned, self.waves(count), self.carriers, self.omega(speed, count), flexibility)
            if len(self._last) >= KEPT:
                self._last.clear()
            self._last[key] = known
        return known(places)

    def turned_entries(self, theta: Array, speed: float) -> list[Entries]:
        """Derivatives of the forces of the springs of carriers at phases theta (S, n) and a speed (rad/s)."""
        rates = abs(speed) / np.array(self.turns)
        return [entry for spring in self.turned for entry in spring.entries(theta, rates, self.linear.size)]

    def whole_forces(self, orbit: Orbit) -> ComplexArray:
        """Amplitudes (K + 1, m) of the forces of an orbit, with those of the springs of carriers."""
        if not self.turned:
            return orbit.forces
        lattice = self.lattice(2 * orbit.harmonics)
        rates = 1j * self.omega(orbit.speed, orbit.harmonics)[:, None] * orbit.places
        both = lattice.synthesis(np.hstack([orbit.places, rates]))
        forces = np.zeros((len(both), self.linear.size))
        for rows, columns, values in self.turned_entries(lattice.theta, orbit.speed):
            np.add.at(forces.T, rows, (values * both[:, columns]).T)
        return np.asarray(orbit.forces + lattice.analysis(forces)[: len(orbit.places)])


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
        Estimate of the error of the freedoms, in parts of their scale; NaN where there is none.
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
    """Evaluate the residual r_k of the equations, and the forces, at given amplitudes.

    Parameters
    ----------
    system : Oscillator
        The oscillator.
    speed : float
        Speed of the drive (rad/s).
    places : ndarray of complex, shape (K + 1, m)
        Amplitudes of the freedoms (m, rad).
    lattice : Lattice
        Samples at which the forces are evaluated, of K harmonics at least.
    flexibility : ndarray of complex, shape (K + 1, m, m)
        H at the harmonics, see `flexibility_of`.
    """
    turning = 1j * system.omega(speed, len(places) - 1)[:, None]
    u, du = lattice.synthesis(places), lattice.synthesis(turning * places)
    pushes = system.forces(lattice.theta, speed, u, du)
    forces = lattice.analysis(pushes.value)[: len(places)]
    if pushes.momentum is not None:
        forces = forces + turning * lattice.analysis(pushes.momentum)[: len(places)]
    return Evaluated(places - moved(system, speed, flexibility, forces), forces, pushes, lattice)


def moved(system: Oscillator, speed: float, flexibility: ComplexArray, forces: ComplexArray) -> ComplexArray:
    """Return amplitudes of the freedoms under forces and the constant ones.

    Parameters
    ----------
    system : Oscillator
        The oscillator.
    speed : float
        Speed of the drive (rad/s).
    flexibility : ndarray of complex, shape (K + 1, m, m)
        H at the harmonics, see `flexibility_of`.
    forces : ndarray of complex, shape (K + 1, m)
        Amplitudes of the forces (N, N m).

    Returns
    -------
    places : ndarray of complex, shape (K + 1, m)
    """
    made = (flexibility @ forces[..., None])[..., 0]
    made[0] += system.rest(speed)
    return system.coupled(speed, np.asarray(made), flexibility)


def packed(amplitudes: ComplexArray, scale: Array) -> Array:
    """Real vector of amplitudes in parts of the scale."""
    return np.ascontiguousarray(amplitudes / scale).view(float).ravel()


def unpacked(x: Array, scale: Array) -> ComplexArray:
    """(K + 1, m) amplitudes: the reverse of `packed`."""
    return np.asarray(x.view(complex).reshape(-1, len(scale)) * scale)


def product(system: Oscillator, speed: float, at: Evaluated, flexibility: ComplexArray) -> Callable[[Array], Array]:
    """Return the Jacobian of the residual as a function of a change of the amplitudes.

    Parameters
    ----------
    system : Oscillator
        The oscillator.
    speed : float
        Speed of the drive (rad/s).
    at : Evaluated
        The equations at the amplitudes of linearisation.
    flexibility : ndarray of complex, shape (K + 1, m, m)
        H at the harmonics, see `flexibility_of`.

    Returns
    -------
    changed : callable
        Change of the amplitudes -> change of the residual; real vectors as of `packed`.
    """
    lattice, scale, count = at.lattice, system.scale, len(at.residual)
    turning = 1j * system.omega(speed, count - 1)[:, None]
    parts = [_part(at.pushes.by, flexibility, None)]
    if at.pushes.momentum_by is not None:
        parts.append(_part(at.pushes.momentum_by, flexibility, turning))
    used, places = np.unique(np.concatenate([part.freedoms for part in parts]), return_inverse=True)
    of_rates = used >= len(scale)
    columns, wheres = used % len(scale), np.split(places, [len(parts[0].freedoms)])

    def changed(x: Array) -> Array:
        change = unpacked(x, scale)
        moves = change[:, columns]
        if of_rates.any():
            moves[:, of_rates] *= turning
        sampled, moves = lattice.synthesis(moves), np.zeros_like(change)
        for part, where in zip(parts, wheres, strict=False):
            forces = lattice.analysis((part.values * sampled[:, where]) @ part.sums)[:count]
            moves += (part.way @ (forces if part.factor is None else part.factor * forces)[..., None])[..., 0]
        return packed(change - system.coupled(speed, moves, flexibility), scale)

    return changed


class _Part(NamedTuple):
    """Derivatives of forces, and what these move."""

    freedoms: IntArray  # (e,)
    values: Array  # (S, e)
    sums: Array  # (e, r) which entries add up to which force
    way: ComplexArray  # (K + 1, m, r) flexibility
    factor: ComplexArray | None  # (K + 1, 1) of the forces


def _part(by: Changes, flexibility: ComplexArray, factor: ComplexArray | None) -> _Part:
    forces, numbers = np.unique(by.forces, return_inverse=True)
    way = np.ascontiguousarray(flexibility[:, :, forces])
    return _Part(by.freedoms, by.values, np.eye(len(forces))[numbers], way, factor)


def flexibility_of(system: Oscillator, speed: float, count: int) -> ComplexArray:
    """H at harmonics 0 to `count`, computed at once up to the harmonics of `error_of`."""
    return system.flexibility(speed, 2 * count)[: count + 1]


def size_of(amplitudes: ComplexArray, scale: Array) -> float:
    """Norm in parts of the scale."""
    return float(np.linalg.norm(amplitudes / scale))


def solve(
    system: Oscillator, speed: float, guess: ComplexArray, tolerance: float, *, near: bool = False
) -> tuple[Orbit, Evaluated]:
    """Find the steady motion at a speed from a guess, without an error estimate.

    Parameters
    ----------
    system : Oscillator
        The oscillator.
    speed : float
        Speed of the drive (rad/s).
    guess : ndarray of complex, shape (K + 1, m)
        Amplitudes from which Newton's method starts (m, rad).
    tolerance : float
        Of the error in the end, in parts of the scale.
    near : bool
        Whether the search ends at a step that contracts too little: only a motion in the guess's own range of
        convergence.

    Returns
    -------
    orbit : Orbit
        Best motion that was reached; `Orbit.found` is true if it solves the equations.
    at : Evaluated
        The equations there.
    """
    count = len(guess) - 1
    H, lattice, scale = flexibility_of(system, speed, count), system.lattice(count), system.scale
    places = guess.copy()
    places[0] = places[0].real
    with np.errstate(invalid="ignore"):  # at the resonance of an undamped mode
        at = evaluate(system, speed, places, lattice, H)
    size, taken = size_of(at.residual, scale), 0
    best, idle = (size, places, at), 0
    enough = FOUND * tolerance
    while size >= enough and taken < STEPS and idle < IDLE and math.isfinite(size):
        taken += 1
        step = -unpacked(gmres(product(system, speed, at, H), packed(at.residual, scale), INEXACT), scale)
        part = 1.0
        for _ in range(HALVINGS):
            new = evaluate(system, speed, places + part * step, lattice, H)
            left = size_of(new.residual, scale)
            if left <= (1.0 - 0.1 * part) * size:
                break
            part *= 0.5
            if near:
                break
        if near and left > CONTRACTS * size:
            break
        places, at, size = places + part * step, new, left
        idle = 0 if size < 0.5 * best[0] else idle + 1
        if size < best[0]:
            best = size, places, at
    found = best[0] < (enough if idle < IDLE else max(enough, LEFT))
    return Orbit(speed, best[1], best[2].forces, math.nan, bool(found), taken), best[2]


def error_of(system: Oscillator, orbit: Orbit, at: Evaluated) -> tuple[float, ComplexArray]:
    """Error estimate of an orbit, and the amplitudes that twice the harmonics would make at once.

    The residual of the equations on four times the samples gives a change of the orbit's harmonics by the Jacobian. The
    higher harmonics change by the residual itself.
    """
    count, speed, scale = 2 * orbit.harmonics, orbit.speed, system.scale
    H = system.flexibility(speed, count)
    places = orbit.with_harmonics(count)
    left = evaluate(system, speed, places, system.lattice(2 * count), H).residual
    step, inner = -left, orbit.harmonics + 1
    step[:inner] = -unpacked(gmres(product(system, speed, at, H[:inner]), packed(left[:inner], scale), ROUGH), scale)
    return SAFETY * size_of(step, scale), places + step


def settled(system: Oscillator, orbit: Orbit, at: Evaluated, tolerance: float) -> Orbit:
    """Add harmonics to an orbit until its error estimate meets a tolerance.

    Parameters
    ----------
    system : Oscillator
        The oscillator.
    orbit : Orbit
        A solution of the equations.
    at : Evaluated
        The equations there.
    tolerance : float
        Of the error estimate, in parts of the scale.

    Returns
    -------
    orbit : Orbit
        With its error estimate, above the tolerance if the most harmonics do not suffice; not found if a solution with
        more harmonics was lost.
    """
    while orbit.found:
        error, guess = error_of(system, orbit, at)
        orbit = replace(orbit, error=error)
        more = system.rounded(GROWTH * orbit.harmonics)
        if error <= tolerance or more <= orbit.harmonics:
            break
        steps = orbit.steps
        orbit, at = solve(system, orbit.speed, guess[: more + 1], tolerance)
        orbit = replace(orbit, steps=steps + orbit.steps)
    return orbit
