r"""What is linear in a train: modal coordinates behind a few freedoms, as a dynamic flexibility.

.. math::
    \ddot y + D\dot y + \Lambda y = c + P f + \Omega\,(G\dot y + N y + r) + \Omega^2 (S y + h), \qquad u = P^T y,
    \qquad \hat u = H(i\omega)\,\hat f

G (skew) has the gyroscopic moments of steady spins and the Coriolis forces of frames that turn with carriers, S and h
the centrifugal forces of these frames, N (skew) and r what dampers in fixed axes do to motions that these frames carry
round. All act along few directions B: :math:`G = B g B^T`, :math:`S = B s B^T`, :math:`N = B n B^T`. The
poles without them are computed once for all speeds and frequencies. At each frequency they are reaction forces to the
motion along B, from a small system (Woodbury's identity). With more than half as many directions as modes the poles of
the whole are found at each speed instead, which costs less.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, BoolArray, ComplexArray, IntArray

#: Squares of frequencies below this part of the largest are round-off: such a mode moves freely. So are directions of
#: forces that are smaller than this part of the largest.
ROUND_OFF = 1e-12
#: Speeds whose poles are kept.
REMEMBERED = 256


class Poles(NamedTuple):
    """Eigenvalues and vectors of the first-order form; conjugate ones are next to each other.

    A pair of poles gives the flexibility ``(a s + b) / (s**2 - (l1 + l2) s + l1 l2)``, a partial fraction of it.
    """

    values: ComplexArray  # (2n,) 1/s
    out: ComplexArray  # (n, 2n) eigenvectors, modal coordinates
    into: ComplexArray  # (2n, p) of unit forces along p directions

    @property
    def pairs(self) -> tuple[IntArray, IntArray, BoolArray]:
        """Numbers of the poles of each pair, and whether they are conjugate; else both are real."""
        plane, line = np.flatnonzero(self.values.imag > 0.0), np.flatnonzero(self.values.imag == 0.0)
        one, two = np.concatenate([plane, line[::2]]), np.concatenate([plane + 1, line[1::2]])
        return one, two, self.values.imag[one] > 0.0

    def over(self, omega: Array) -> tuple[Array, Array]:
        """Real and imaginary parts (k, n) of one over the pairs' denominators; 0 exactly at an undamped pole."""
        first, second = (self.values[i] for i in self.pairs[:2])
        real, imaginary = (first * second).real - (omega**2)[:, None], -omega[:, None] * (first + second).real
        size = real**2 + imaginary**2
        size = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        return real * size, -imaginary * size


class Reacting(NamedTuple):
    """Forces G, S and N along few directions."""

    basis: Array  # (n, r) orthonormal directions B
    gyroscopic: Array  # (r, r) g
    stiffening: Array  # (r, r) s
    circulating: Array  # (r, r) n


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
    gyroscopic, stiffening, circulating : (n, n)
        G, S and N.
    thrown, dragged : (n,)
        h and r.
    """

    squares: Array
    damping: Array
    places: Array
    constant: Array
    gyroscopic: Array = field(default_factory=lambda: np.zeros((0, 0)))
    stiffening: Array = field(default_factory=lambda: np.zeros((0, 0)))
    thrown: Array = field(default_factory=lambda: np.zeros(0))
    circulating: Array = field(default_factory=lambda: np.zeros((0, 0)))
    dragged: Array = field(default_factory=lambda: np.zeros(0))
    _last: dict[float, tuple[Array, ComplexArray, ComplexArray]] = field(default_factory=dict, repr=False)
    _known: dict[float, Poles] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        n = len(self.squares)
        square, line = (n, n), (n,)
        shapes = {"gyroscopic": square, "stiffening": square, "circulating": square, "thrown": line, "dragged": line}
        for name, shape in shapes.items():
            if not getattr(self, name).size:
                object.__setattr__(self, name, np.zeros(shape))
        if (self.squares <= ROUND_OFF * self.squares.max(initial=0.0)).any():
            problem = "moves freely, so its place in steady running is open"
            cure = "hold the housing at its feet, each shaft along its axis, and one of sun, ring and carrier across it"
            raise InputError("train", None, f"a part of it {problem}", cure)

    @property
    def size(self) -> int:
        """Freedoms m."""
        return self.places.shape[1]

    @cached_property
    def _reacting(self) -> Reacting | None:
        """G, S and N along few directions; None where there are too many of them."""
        n = len(self.squares)
        forms = self.gyroscopic, self.stiffening, self.circulating
        basis, sizes, _ = np.linalg.svd(np.hstack(forms), full_matrices=False)
        basis = basis[:, sizes > ROUND_OFF * sizes.max(initial=0.0)]
        if 2 * basis.shape[1] > n:
            return None
        return Reacting(basis, *(basis.T @ form @ basis for form in forms))

    @cached_property
    def _every(self) -> Array:
        """(n, p) directions of the flexibility that partial fractions give: P, and B where its forces react."""
        return self.places if self._reacting is None else np.hstack([self.places, self._reacting.basis])

    def stiffness(self, speed: float, *, damped: bool = True) -> Array:
        """(n, n) stiffness at a speed, that of frames that turn included, with or without what dampers do there."""
        stiffness = np.diag(self.squares) - speed**2 * self.stiffening
        return np.asarray(stiffness - speed * self.circulating if damped else stiffness)

    def poles(self, speed: float) -> Poles:
        """Poles at a speed, without forces that react; those of the last `REMEMBERED` speeds are kept.

        They are of a form that is scaled so that without damping and S it is a rotation.
        """
        speed = 0.0 if self._reacting is not None else speed
        known = self._known.get(speed)  # once: other threads may add and remove some
        if known is not None:
            return known
        n, rates = len(self.squares), np.sqrt(self.squares)
        below = -self.stiffness(speed) / rates
        A = np.block([[np.zeros((n, n)), np.diag(rates)], [below, speed * self.gyroscopic - self.damping]])
        values, vectors = np.linalg.eig(A)
        forces = np.vstack([np.zeros_like(self._every), self._every])
        into = np.linalg.solve(vectors, forces.astype(complex))
        poles = Poles(values.astype(complex), np.asarray(vectors[:n] / rates[:, None], dtype=complex), into)
        if len(self._known) >= REMEMBERED:
            self._known.clear()
        self._known[speed] = poles
        return poles

    def _numerators(self, poles: Poles) -> Array:
        """(n, 2 entries) a and b of the pairs of poles beside each other, for the entries that are computed."""
        one, two, conjugate = poles.pairs
        shares = self._every.T @ poles.out

        def residues(i: IntArray) -> ComplexArray:
            every = shares.T[i, :, None] * poles.into[i, None]
            return np.asarray(every.reshape(len(i), -1)[:, self._kept])

        first, second = poles.values[one, None], poles.values[two, None]
        r = residues(one)
        a, b = 2.0 * r.real, -2.0 * (r * second).real
        if not conjugate.all():
            line = ~conjugate
            other = residues(two[line])
            a[line] = (r[line] + other).real
            b[line] = -(r[line] * second[line] + other * first[line]).real
        return np.hstack([a, b])

    @cached_property
    def _kept(self) -> IntArray:
        """Entries of the flexibility (p p,) that are computed: its upper half where it is symmetric."""
        p = self._every.shape[1]
        if self._reacting is None:
            return np.arange(p * p)
        up = np.triu_indices(p)
        return np.asarray(up[0] * p + up[1])

    @cached_property
    def _entries(self) -> IntArray:
        """Number among the computed entries of each entry of the flexibility, (p p,)."""
        p = self._every.shape[1]
        numbers = np.zeros((p, p), dtype=np.int64)
        numbers.ravel()[self._kept] = np.arange(len(self._kept))
        return numbers.ravel() if self._reacting is None else np.maximum(numbers, numbers.T).ravel()

    def _own(self, omega: Array, speed: float) -> ComplexArray:
        """Flexibility of all directions without forces that react, (k, p, p)."""
        poles = self.poles(speed)
        numerators, over = self._numerators(poles), poles.over(omega)
        real, imaginary = (part @ numerators for part in over)
        k, p = len(omega), self._every.shape[1]
        count, w = numerators.shape[1] // 2, omega[:, None]
        values = np.empty((k, count), dtype=complex)
        values.real = real[:, count:] - w * imaginary[:, :count]
        values.imag = imaginary[:, count:] + w * real[:, :count]
        for line, pair in zip(*np.nonzero((over[0] == 0.0) & (over[1] == 0.0)), strict=True):
            reached = np.abs(numerators[pair]) > np.finfo(float).eps * np.abs(numerators).max(axis=0)
            values[line, reached[:count] | reached[count:]] = np.inf  # a resonance without damping
        return np.asarray((values if self._reacting is None else values[:, self._entries]).reshape(k, p, p))

    @cached_property
    def statics(self) -> Array:
        """(m, m) flexibility of the freedoms at rest."""
        return np.asarray(self.places.T @ (self.places / self.squares[:, None]))

    def still(self, speed: float, forces: Array) -> Array:
        """Modal coordinates (n, k) under constant modal forces (n, k) at a speed."""
        if not (speed and (self.stiffening.any() or self.circulating.any())):
            return np.asarray(forces / self.squares[:, None])
        return np.asarray(np.linalg.solve(self.stiffness(speed), forces))

    def rest(self, speed: float = 0.0) -> Array:
        """(m,) freedoms under the constant forces alone."""
        return np.asarray(self.places.T @ self.still(speed, self._constant(speed)[:, None])[:, 0])

    def _constant(self, speed: float) -> Array:
        return np.asarray(self.constant + speed**2 * self.thrown + speed * self.dragged)

    def _turning(self, omega: Array, speed: float) -> tuple[ComplexArray, ComplexArray]:
        """Flexibility at the freedoms, (k, m, m), and forces that react to unit forces, (k, r, m).

        Those of the last speed are kept: its first frequencies are evaluated again and again.
        """
        m, count, reacting = self.size, len(omega), self._reacting
        kept = self._last.get(speed)  # once: other threads may be at another speed
        if kept is not None and np.array_equal(kept[0][:count], omega):
            return kept[1][:count], kept[2][:count]
        made = self._own(omega, speed)
        reactions = np.zeros((count, 0, m), dtype=complex)
        if reacting is not None:
            whole, r = made, made.shape[1] - m
            turning = 1j * speed * omega[:, None, None] * reacting.gyroscopic
            turning += speed**2 * reacting.stiffening + speed * reacting.circulating
            react = turning @ whole[:, m:]
            reactions = np.asarray(np.linalg.solve(np.eye(r) - react[..., m:], react[..., :m]), dtype=complex)
            made = np.asarray(whole[:, :m, :m] + whole[:, :m, m:] @ reactions)
        made[omega == 0.0] = self.places.T @ self.still(speed, self.places)
        for values in (made, reactions):
            values.setflags(write=False)
        self._last.clear()
        self._last[speed] = omega, made, reactions
        return made, reactions

    def flexibility(self, omega: Array, speed: float) -> ComplexArray:
        """H (k, m, m) at the angular frequencies (k,); `speed` turns the shafts."""
        return self._turning(omega, speed)[0]

    def modal(self, omega: Array, speed: float, forces: ComplexArray) -> ComplexArray:
        """Modal coordinates (k, n) under forces (k, m) at the freedoms; at omega = 0 the constant ones too."""
        every = forces
        if self._reacting is not None:
            _, reactions = self._turning(omega, speed)
            every = np.concatenate([forces, (reactions @ forces[..., None])[..., 0]], axis=1)
        poles = self.poles(speed)
        into, shapes = _excited(poles)
        real, imaginary = poles.over(omega)
        rates, values = np.split(real_times(every, into), 2, axis=1)
        parts = 1j * omega[:, None] * rates + values
        parts *= np.tile(real + 1j * imaginary, 2)
        made = real_times(parts, shapes)
        still = omega == 0.0
        made[still] = self.still(speed, self.places @ forces[still].T.real).T
        made[0] += self.still(speed, self._constant(speed)[:, None])[:, 0]
        return made


def _excited(poles: Poles) -> tuple[Array, Array]:
    """Numerators (p, 4 n) of the pairs' parts, first what counts s times, and modal coordinates (2 n, n) for parts.

    With the vectors i and o of a pole, conjugate ones have the parts of Re o and Im o, real ones those of each o.
    """
    one, two, plane = poles.pairs
    (i1, i2), (o1, o2) = ((x[..., one], x[..., two]) for x in (poles.into.T, poles.out))
    first, second = poles.values[one], poles.values[two]
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
