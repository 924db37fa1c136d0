r"""Lowest modes of ``K phi = lambda M phi`` by block Lanczos on ``A = (K + s M)^-1 M``.

The operator is self-adjoint in the M inner product. Its largest values ``theta = 1 / (lambda + s)`` belong to the
lowest modes, and one factorisation serves all steps. Blocks of several columns use a factorisation better than single
ones (eight: a fifth of the time per column). They find repeated frequencies up to the block's width. All vectors are
kept, and every new block is made orthogonal to all of them, so no spurious copies appear (Golub, Van Loan, Matrix
Computations, 4th ed., sec. 10.3; Grimes, Lewis, Simon, SIAM J. Matrix Anal. Appl. 15, 1994).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array

#: Residual of a mode, relative to theta, at which it counts as found; its frequency is then right to about its square.
TOLERANCE = 1e-5
#: The same for the first mode left out, whose frequency is only estimated.
NEAR = 1e-3


#: Seed of the random start.
SEED = 1


@dataclass(frozen=True)
class Modes:
    """Lowest modes of a pair (K, M).

    Attributes
    ----------
    eigenvalues : (k,)
        lambda = omega^2 (rad^2/s^2), ascending.
    vectors : (n, k)
        M-orthonormal.
    next_eigenvalue
        Estimate, from above, of the first eigenvalue that is left out; infinite when none is.
    """

    eigenvalues: Array
    vectors: Array
    next_eigenvalue: float


def lowest_modes(
    solve: Callable[[Array], Array],
    mass: Any,
    *,
    count: int | None = None,
    limit: float = math.inf,
    at_least: int = 0,
    at_most: int | None = None,
    shift: float = 0.0,
    block: int = 8,
) -> Modes:
    """Modes with the lowest eigenvalues: the first `count` of them, or all with ``lambda <= limit``.

    Parameters
    ----------
    solve
        Solves ``(K + shift M) x = b`` for (n, p) right-hand sides.
    mass : (n, n) sparse
        M, positive definite.
    count
        How many modes; ``None`` for all up to `limit`.
    limit
        Upper end of the eigenvalues (rad^2/s^2); with `count` given the smaller set is returned.
    at_least
        Least number of modes, even above the limit.
    at_most
        Number of modes below the limit with which the search is given up; by default it continues.
    shift
        s >= 0 (rad^2/s^2), for pairs whose K is singular.
    block
        Columns a step.

    Raises
    ------
    InputError
        When more than `at_most` modes lie below the limit.
    """
    n = mass.shape[0]
    needed = n if count is None else min(count, n)
    if needed == 0 or n == 0:
        return Modes(np.zeros(0), np.zeros((n, 0)), math.inf)
    p = max(1, min(block, n))
    basis = _Basis(n, mass, capacity=min(n, 4 * min(needed, 60) + 4 * p), width=p)
    start = solve(np.asarray(mass @ np.random.default_rng(SEED).standard_normal((n, p))))
    basis.append(start)
    projected = np.zeros((0, 0))
    done = 0
    while True:
        first, last = done, basis.size
        new = solve(basis.mass_times(first, last))
        coefficients, spill = basis.append(new)
        done = last
        grown = np.zeros((done, done))
        grown[:first, :first] = projected
        grown[:, first:] = coefficients[:done]
        grown[first:, :first] = coefficients[:first].T
        grown[first:, first:] = 0.5 * (coefficients[first:done] + coefficients[first:done].T)
        projected = grown
        theta, s = np.linalg.eigh(projected)
        theta, s = theta[::-1], s[:, ::-1]
        residual = np.linalg.norm(spill @ s[first:], axis=0) if len(spill) else np.zeros(done)
        eigenvalues = 1.0 / np.maximum(theta, 1e-300) - shift
        converged = residual <= TOLERANCE * np.abs(theta)
        near = residual <= NEAR * np.abs(theta)
        below = int(np.searchsorted(eigenvalues, limit, side="right"))
        if at_most is not None and below > at_most:  # values of the projection lie above those of the pair
            hz = [math.sqrt(max(value, 0.0)) / (2.0 * math.pi) for value in (limit, eigenvalues[at_most])]
            problem = f"more than {at_most} modes lie below it, {at_most} of them below about {hz[1]:.3g} Hz"
            cure = "give a lower one, or their number (modes); check modulus, density and unit of the mesh"
            raise InputError("modes_below_Hz", hz[0], problem, cure)
        inside = min(needed, max(at_least, below))
        exhausted = basis.size == done or done >= n
        inside = min(inside, n)
        if exhausted or (inside < done and bool(np.all(converged[:inside])) and bool(near[inside])):
            inside = min(inside, done)
            following = float(eigenvalues[inside]) if inside < done else math.inf
            vectors = basis.vectors[:, :done]
            del basis  # its products with M, while the modes are made
            return Modes(eigenvalues[:inside].copy(), vectors @ s[:, :inside], following)


class _Basis:
    """M-orthonormal columns that grow in place, beside their products with M."""

    def __init__(self, n: int, mass: Any, capacity: int, width: int) -> None:
        self._width = width
        self._q, self._mq = np.empty((capacity, n)).T, np.empty((capacity, n)).T
        self._mass = mass
        self.size = 0

    @property
    def vectors(self) -> Array:
        return self._q[:, : self.size]

    def mass_times(self, first: int, last: int) -> Array:
        """M times the columns ``first:last``."""
        return self._mq[:, first:last]

    def append(self, new: Array) -> tuple[Array, Array]:
        """Add the part of `new` that is orthogonal to the basis.

        In exact arithmetic only the last two blocks matter: they are taken out first, then all are, against rounding.

        Returns
        -------
        coefficients : (size before, p)
            M inner products of the basis with `new`.
        spill : (added, p)
            The rest in terms of the added columns: ``new = basis @ coefficients + added @ spill``.
        """
        w = np.asfortranarray(new)
        coefficients = np.zeros((self.size, w.shape[1]))
        recent = max(0, self.size - 3 * self._width)
        for first in (recent, 0):
            c = self._mq[:, first : self.size].T @ w
            w = w - self._q[:, first : self.size] @ c
            coefficients[first:] += c
        mw = np.asarray(self._mass @ w)
        spill = np.eye(w.shape[1])
        floor = 1e-28 * float(np.max(np.einsum("ij,ij->j", coefficients, coefficients), initial=0.0))
        for _ in range(2):
            gram = w.T @ mw
            size, directions = np.linalg.eigh(0.5 * (gram + gram.T))
            keep = size > max(floor, 1e-14 * float(np.max(size, initial=0.0)))
            root = np.sqrt(size[keep])
            w, mw = w @ (directions[:, keep] / root), mw @ (directions[:, keep] / root)
            spill = (directions[:, keep] * root).T @ spill
            floor = 0.0
        self._grow(w.shape[1])
        here = slice(self.size, self.size + w.shape[1])
        self._q[:, here], self._mq[:, here] = w, mw
        self.size += w.shape[1]
        return coefficients, spill

    def _grow(self, added: int) -> None:
        n, capacity = self._q.shape
        if self.size + added > capacity:
            for name in ("_q", "_mq"):
                grown = np.empty((max(3 * capacity // 2, self.size + added), n)).T
                grown[:, : self.size] = getattr(self, name)[:, : self.size]
                setattr(self, name, grown)
