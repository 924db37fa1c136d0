r"""Harmonics of a motion with one or several phases, and where it is sampled.

A motion with the n base frequencies :math:`\omega` is a function of n phases, :math:`\theta = \omega t`, with a
harmonic for each vector k of n whole numbers,

.. math:: u(\theta) = \mathrm{Re}\sum_k \hat u_k\,e^{ik\cdot\theta} .

Of k and -k, whose frequencies :math:`k\cdot\omega` are opposite, the positive one counts. Harmonics stand in rising
order w. That of a multiple of one base frequency is its frequency, :math:`w = |k_p|\,\omega_p/\omega_1`. Combinations
come from the product of variations that are small each, and fall with the multiples of the meshes' own frequencies,

.. math:: w(k) = \Big(\sum_p\sqrt{|k_p| / r_p}\Big)^2 ,\qquad r_p = \frac{c_p}{\max_q (c_q/b_q)} ,

with the cycles :math:`c_p` of the fastest mesh of a phase in its period :math:`b_p`. So the first K of them hold the
multiples of all base frequencies up to one frequency, and in combinations as many multiples of slow meshes as of the
fastest one. With one phase they are 1, 2, 3, ... The last phases may be rotations of carriers in an elastic housing,
which are slow and couple each harmonic with its neighbours n + 1 and n - 1: they add :math:`|k_p|` times `PASS` to w
instead, so that each multiple of a mesh frequency has its sidebands. Harmonics are sampled at S places on a line that
winds round all phases, a lattice of rank 1 (Sloan & Joe, Lattice Methods for Multiple Integration, 1994),

.. math:: \theta_j = 2\pi j g / S ,\qquad e^{ik\cdot\theta_j} = e^{2\pi i j (k\cdot g) / S} ,

so one Fourier transform of length S holds them all: four samples for each harmonic at least, and with several phases as
many more as keep each of the K harmonics apart from all others of them.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray, IntArray

#: Samples for each harmonic, at least; least harmonics that are so sampled.
SAMPLES, LEAST = 4, 16
#: Steps g that are tried for a number of samples, and factor to the next number.
TRIED, MORE = 50, 1.1
#: Orders nearer to each other, relatively, are one.
ROUND_OFF = 1e-9
#: Lattices of several phases are made for so many counts of harmonics between one and its double.
RUNGS = 3
#: Growth of the order up to which harmonics are listed.
FARTHER = 1.3
#: What one rotation of a carrier adds to the order of a harmonic, in parts of the frequency of the first phase.
PASS = 0.5


class Phases(NamedTuple):
    """Phases of a motion: first those of meshes, last the rotations of carriers."""

    periods: tuple[float, ...]  # in parts of that of the first
    reaches: tuple[float, ...]  # of the phases of meshes: r

    @classmethod
    def of(cls, periods: tuple[float, ...], cycles: tuple[int, ...]) -> Phases:
        """Phases of periods, the first of which hold so many cycles of their fastest mesh."""
        fastest = max(count / period for count, period in zip(cycles, periods, strict=False))
        return cls(periods, tuple(count / fastest for count in cycles))

    @property
    def carriers(self) -> int:
        """Number of the phases that are rotations of carriers."""
        return len(self.periods) - len(self.reaches)


class Harmonics(NamedTuple):
    """Harmonics in rising order, the constant first."""

    waves: IntArray  # (K + 1, n): k
    order: Array  # (K + 1,): w


class Lattice(NamedTuple):
    """Samples of K + 1 harmonics, and where these stand in the transform of real values."""

    theta: Array  # (S, n) phases (rad)
    residue: IntArray  # (K + 1,) k . g
    place: IntArray  # (K + 1,) line of the transform
    conjugate: BoolArray  # (K + 1,) which stand there as the conjugate
    plain: bool  # whether all keep their own order and none is conjugate: those of one phase

    def synthesis(self, amplitudes: ComplexArray) -> Array:
        """(S, m) values of ``Re sum a_k exp(i k theta)``."""
        samples, count = len(self.theta), len(amplitudes)
        spectrum = np.zeros((samples // 2 + 1, amplitudes.shape[1]), dtype=complex)
        if self.plain:
            spectrum[:count] = amplitudes * (0.5 * samples)
            spectrum[0] *= 2.0
            return np.asarray(np.fft.irfft(spectrum, samples, axis=0))
        spectrum[self.place[:count]] = amplitudes * (0.5 * samples)
        flipped = self.place[:count][self.conjugate[:count]]
        if len(flipped):
            spectrum[flipped] = spectrum[flipped].conj()
        spectrum[0] *= 2.0
        return np.asarray(np.fft.irfft(spectrum, samples, axis=0))

    def analysis(self, values: Array) -> ComplexArray:
        """(K + 1, ...) complex amplitudes of values (S, ...)."""
        lines = np.fft.rfft(values, axis=0)
        made = (lines[: len(self.place)] if self.plain else lines[self.place]) * (2.0 / len(values))
        made[0] *= 0.5
        if self.plain:
            return np.asarray(made)
        np.conjugate(made, out=made, where=self.conjugate.reshape(-1, *[1] * (made.ndim - 1)))
        return np.asarray(made)


def below(phases: Phases, order: float) -> Harmonics:
    """All harmonics of less than an order, the constant included."""
    if len(phases.periods) == 1:
        rising = np.arange(math.ceil(order * (1.0 - ROUND_OFF)))
        return Harmonics(rising[:, None], rising.astype(float))
    waves, w = _of_meshes(phases, order)
    for _ in range(phases.carriers):
        most = np.floor(np.maximum(order - w, 0.0) / PASS).astype(int)
        before = np.repeat(np.arange(len(w)), 2 * most + 1)
        k = np.arange(len(before)) - (np.cumsum(2 * most + 1) - most - 1)[before]
        waves, w = np.column_stack([waves[before], k]), w[before] + PASS * np.abs(k)
    frequency, first = (waves / np.array(phases.periods)).sum(axis=1), np.argmax(waves != 0, axis=1)
    none = np.abs(frequency) <= ROUND_OFF * w
    kept = (w < order * (1.0 - ROUND_OFF)) & np.where(none, waves[np.arange(len(waves)), first] >= 0, frequency > 0.0)
    waves, w = waves[kept], w[kept]
    rising = np.lexsort((*waves.T[::-1], np.round(w / ROUND_OFF)))
    return Harmonics(waves[rising], w[rising])


def _of_meshes(phases: Phases, order: float) -> tuple[IntArray, Array]:
    """Multiples of each mesh phase and their combinations up to an order, both signs, and their orders."""
    waves, roots = np.zeros((1, 0), dtype=int), np.zeros(1)  # axis by axis, what is left of the order for the next
    for reach in phases.reaches:
        most = np.floor(reach * np.maximum(math.sqrt(order) - roots, 0.0) ** 2).astype(int)
        before = np.repeat(np.arange(len(roots)), 2 * most + 1)
        k = np.arange(len(before)) - (np.cumsum(2 * most + 1) - most - 1)[before]
        waves, roots = np.column_stack([waves[before], k]), roots[before] + np.sqrt(np.abs(k) / reach)
    combined = (waves != 0).sum(axis=1) != 1
    found, orders = [waves[combined]], [roots[combined] ** 2]
    for axis, period in enumerate(phases.periods[: len(phases.reaches)]):
        rising = np.arange(1, math.floor(order * period) + 1)
        multiples = np.zeros((2 * len(rising), len(phases.reaches)), dtype=int)
        multiples[:, axis] = np.concatenate([rising, -rising])
        found.append(multiples)
        orders.append(np.abs(multiples[:, axis]) / period)
    return np.concatenate(found), np.concatenate(orders)


@lru_cache(maxsize=64)
def harmonics(phases: Phases, count: int) -> Harmonics:
    """The constant and the first `count` harmonics, see `below`."""
    order = count + 2.0 if len(phases.periods) == 1 else 4.0
    while len(below(phases, order).waves) <= count:
        order *= FARTHER
    waves, w = (x[: count + 1] for x in below(phases, order))
    for x in (waves, w):
        x.setflags(write=False)
    return Harmonics(waves, w)


def count_below(phases: Phases, order: float) -> int:
    """Number of the first harmonic that is not below an order."""
    return len(below(phases, order).waves)


@lru_cache(maxsize=64)
def numbers(phases: Phases, count: int) -> dict[tuple[int, ...], int]:
    """Number of each of the first harmonics by its k."""
    return {tuple(k): number for number, k in enumerate(harmonics(phases, count).waves.tolist())}


def lattice(phases: Phases, count: int) -> Lattice:
    """Samples for the constant and the first `count` harmonics at least."""
    if len(phases.periods) > 1:  # it takes a search: the same for many
        count = math.ceil(2.0 ** (math.ceil(RUNGS * math.log2(max(count, LEAST))) / RUNGS))
    return _searched(phases, count)


@lru_cache(maxsize=64)
def _searched(phases: Phases, count: int) -> Lattice:
    waves, _ = harmonics(phases, count)
    several = len(phases.periods)
    every = np.concatenate([waves, -waves[1:]])
    samples = SAMPLES * max(count, LEAST)
    while True:
        rng = np.random.default_rng(samples)  # the same in each run
        for factor in rng.integers(1, samples, TRIED if several > 1 else 1).tolist():
            step = np.array([pow(factor, p, samples) for p in range(several)])
            if np.bincount((every @ step) % samples).max() == 1:
                residue = (waves @ step) % samples
                theta = 2.0 * math.pi * ((np.arange(samples)[:, None] * step) % samples) / samples
                conjugate = 2 * residue > samples
                place = np.where(conjugate, samples - residue, residue)
                plain = bool((place == np.arange(len(place))).all() and not conjugate.any())
                return Lattice(theta, residue, place, conjugate, plain)
        from scipy.fft import next_fast_len  # with one phase the first number of samples is enough

        samples = next_fast_len(math.ceil(MORE * samples) + 1, real=True)
