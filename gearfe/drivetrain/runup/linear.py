r"""What is linear in a train: modal coordinates behind a few freedoms, as a dynamic flexibility.

.. math::
    \ddot y + D\dot y + \Lambda y = c + P f + \Omega\,G\dot y, \qquad u = P^T y,
    \qquad \hat u = H(i\omega)\,\hat f

G are the gyroscopic moments of steady spins: skew, along two tilts of each shaft. The poles of the rest are found once
for all speeds and frequencies; gyroscopic moments are forces that react on the tilts, of few freedoms, so they cost a
small solution a frequency (Woodbury's identity).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, BoolArray, ComplexArray, IntArray

#: Squares of frequencies below this part of the largest are round-off: such a mode moves freely.
ROUND_OFF = 1e-12


class Poles(NamedTuple):
    """Partial fractions of the flexibility without gyroscopic moments."""

    values: ComplexArray  # (2n,) 1/s
    out: ComplexArray  # (n, 2n) eigenvectors, modal coordinates
    into: ComplexArray  # (2n, p) of unit forces along all p freedoms, tilts last


class Pairs(NamedTuple):
    """Poles in pairs, conjugate or both real."""

    sums: Array  # (n, 2) sum and product
    numerators: Array  # (n, 2 entries): a and b beside each other
    one: IntArray  # (n,) numbers of the poles
    two: IntArray
    conjugate: BoolArray  # (n,)


@dataclass(frozen=True, eq=False)
class Linear:
    """Modal coordinates of unit mass and what acts on them linearly.

    Parameters
    ----------
    squares : (n,)
        Squares of the natural frequencies (rad2/s2), all > 0.
    damping : (n, n)
        D (1/s).
    places : (n, m)
        P: modal coordinates to the freedoms along which other forces act.
    constant : (n,)
        c: constant modal force.
    tilts : (n, 2 s)
        Both tilts of each shaft, shaft by shaft.
    momenta : (s,)
        Angular momentum of each shaft for unit speed (kg m2).
    """

    squares: Array
    damping: Array
    places: Array
    constant: Array
    tilts: Array = field(default_factory=lambda: np.zeros((0, 0)))
    momenta: Array = field(default_factory=lambda: np.zeros(0))
    _last: dict[float, tuple[Array, ComplexArray, ComplexArray]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        n = len(self.squares)
        if not self.tilts.size:
            object.__setattr__(self, "tilts", np.zeros((n, 0)))
        if (self.squares <= ROUND_OFF * self.squares.max(initial=0.0)).any():
            problem = "moves freely, so its place in steady running is open"
            cure = "hold the housing at its feet, and each shaft along its axis"
            raise InputError("train", None, f"a part of it {problem}", cure)

    @property
    def size(self) -> int:
        """Freedoms m."""
        return self.places.shape[1]

    @cached_property
    def poles(self) -> Poles:
        """Eigenvalues and vectors of the first-order form, scaled so that without damping it is a rotation."""
        n = len(self.squares)
        rates = np.sqrt(self.squares)
        A = np.block([[np.zeros((n, n)), np.diag(rates)], [-np.diag(rates), -self.damping]])
        values, vectors = np.linalg.eig(A)
        every = np.hstack([self.places, self.tilts])
        forces = np.vstack([np.zeros_like(every), every])
        into = np.linalg.solve(vectors, forces.astype(complex))
        return Poles(values.astype(complex), np.asarray(vectors[:n] / rates[:, None], dtype=complex), into)

    @cached_property
    def _pairs(self) -> Pairs:
        """Poles in pairs.

        A pair gives :math:`(a s + b)/(s^2 - (\\lambda_1 + \\lambda_2) s + \\lambda_1\\lambda_2)`. The flexibility is
        symmetric: entries are those of its upper half.
        """
        poles, every = self.poles, np.hstack([self.places, self.tilts])
        up = np.triu_indices(every.shape[1])
        residues = np.einsum("aj,jb->jab", every.T @ poles.out, poles.into)[:, up[0], up[1]]
        plane = np.flatnonzero(poles.values.imag > 0.0)
        conjugate = [int(np.argmin(np.abs(poles.values - poles.values[j].conj()))) for j in plane]
        line = np.flatnonzero(poles.values.imag == 0.0)
        one, two = np.concatenate([plane, line[::2]]), np.concatenate([np.array(conjugate, int), line[1::2]])
        first, second = poles.values[one, None], poles.values[two, None]
        a, b = residues[one] + residues[two], -(residues[one] * second + residues[two] * first)
        sums = np.hstack([(first + second).real, (first * second).real])
        return Pairs(sums, np.ascontiguousarray(np.hstack([a.real, b.real])), one, two, poles.values.imag[one] > 0.0)

    @cached_property
    def _entries(self) -> IntArray:
        """Entry of the upper half that stands at each place of the flexibility of all freedoms, (p p,)."""
        p = self.size + self.tilts.shape[1]
        made = np.zeros((p, p), dtype=np.int64)
        up = np.triu_indices(p)
        made[up] = np.arange(len(up[0]))
        return np.maximum(made, made.T).ravel()

    def _own(self, omega: Array) -> ComplexArray:
        """Flexibility of all freedoms without gyroscopic moments, (k, p, p)."""
        numerators = self._pairs.numerators
        over = self._over(omega)
        real, imaginary = (part @ numerators for part in over)
        k, p = len(omega), self.size + self.tilts.shape[1]
        count, w = numerators.shape[1] // 2, omega[:, None]
        values = np.empty((k, count), dtype=complex)
        values.real = real[:, count:] - w * imaginary[:, :count]
        values.imag = imaginary[:, count:] + w * real[:, :count]
        for line, pair in zip(*np.nonzero((over[0] == 0.0) & (over[1] == 0.0)), strict=True):
            reached = np.abs(numerators[pair]) > np.finfo(float).eps * np.abs(numerators).max(axis=0)
            values[line, reached[:count] | reached[count:]] = np.inf  # a resonance without damping
        made: ComplexArray = values[:, self._entries].reshape(k, p, p)
        return made

    @cached_property
    def gyroscopic(self) -> Array:
        """(2 s, 2 s) gyroscopic moments for unit rates of the tilts and unit speed."""
        return np.kron(np.diag(self.momenta), np.array([[0.0, -1.0], [1.0, 0.0]]))

    @cached_property
    def statics(self) -> Array:
        """(m, m) flexibility of the freedoms at rest."""
        return np.asarray(self.places.T @ (self.places / self.squares[:, None]))

    @cached_property
    def rest(self) -> Array:
        """(m,) freedoms under the constant force alone."""
        return np.asarray(self.places.T @ (self.constant / self.squares))

    def _turning(self, omega: Array, speed: float) -> tuple[ComplexArray, ComplexArray]:
        """Flexibility at the freedoms, (k, m, m), and gyroscopic moments for unit forces, (k, 2 s, m).

        Those of the last speed are kept: its first frequencies are evaluated again and again.
        """
        m, count = self.size, len(omega)
        kept = self._last.get(speed)  # once: other threads may be at another speed
        if kept is not None and np.array_equal(kept[0][:count], omega):
            return kept[1][:count], kept[2][:count]
        p = m + self.tilts.shape[1]
        whole = self._own(omega)
        # gyroscopic moments that react on tilts: those of both tilts of a shaft change places
        other = np.arange(p - m) ^ 1
        turning = 1j * speed * omega[:, None] * self.gyroscopic[np.arange(p - m), other]
        react = turning[..., None] * whole[:, m + other]
        left = np.eye(p - m) - react[..., m:]
        moments = np.asarray(np.linalg.solve(left, react[..., :m]), dtype=complex)
        made = np.asarray(whole[:, :m, :m] + whole[:, :m, m:] @ moments)
        made[omega == 0.0] = self.statics
        for values in (made, moments):
            values.setflags(write=False)
        self._last.clear()
        self._last[speed] = omega, made, moments
        return made, moments

    def flexibility(self, omega: Array, speed: float) -> ComplexArray:
        """H (k, m, m) at the angular frequencies (k,); `speed` turns the shafts."""
        return self._turning(omega, speed)[0]

    def modal(self, omega: Array, speed: float, forces: ComplexArray) -> ComplexArray:
        """Modal coordinates (k, n) under forces (k, m) at the freedoms; at the first omega, 0, the constant one too."""
        _, moments = self._turning(omega, speed)
        every = np.concatenate([forces, (moments @ forces[..., None])[..., 0]], axis=1)
        into, shapes = self._excited
        real, imaginary = self._over(omega)
        rates, values = np.split(real_times(every, into), 2, axis=1)
        parts = 1j * omega[:, None] * rates + values
        parts *= np.tile(real + 1j * imaginary, 2)
        made = real_times(parts, shapes)
        still = omega == 0.0
        made[still] = forces[still] @ self.places.T / self.squares
        made[0] += self.constant / self.squares
        return made

    def _over(self, omega: Array) -> tuple[Array, Array]:
        """Real and imaginary parts (k, n) of one over the denominators of all pairs; 0 exactly at an undamped pole."""
        sums = self._pairs.sums
        real, imaginary = sums[:, 1] - (omega**2)[:, None], -omega[:, None] * sums[:, 0]
        size = real**2 + imaginary**2
        size = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        return real * size, -imaginary * size

    @cached_property
    def _excited(self) -> tuple[Array, Array]:
        """Numerators (p, 4 n) of the pairs' parts, first what counts s times, and modal coordinates (2 n, n) for parts.

        With the vectors i and o of a pole, conjugate ones have the parts of Re o and Im o, real ones those of each o.
        """
        pairs, poles = self._pairs, self.poles
        (i1, i2), (o1, o2) = ((x[..., pairs.one], x[..., pairs.two]) for x in (poles.into.T, poles.out))
        first, second, plane = poles.values[pairs.one], poles.values[pairs.two], pairs.conjugate
        rates = np.where(plane, i1 + i2, i1), np.where(plane, 1j * (i1 - i2), i2)
        values = (
            np.where(plane, i1 * second + i2 * first, i1 * second),
            np.where(plane, 1j * (i1 * second - i2 * first), i2 * first),
        )
        into = np.hstack([*rates, *(-x for x in values)]).real
        shapes = np.hstack([o1.real, np.where(plane, o1.imag, o2.real)]).T
        return np.ascontiguousarray(into), np.ascontiguousarray(shapes)


def real_times(values: ComplexArray, matrix: Array) -> ComplexArray:
    """Product of complex rows (k, n) and a real matrix (n, p), which stays real."""
    both = np.concatenate([values.real, values.imag]) @ matrix
    made = np.empty((len(values), matrix.shape[1]), dtype=complex)
    made.real, made.imag = both[: len(values)], both[len(values) :]
    return made
