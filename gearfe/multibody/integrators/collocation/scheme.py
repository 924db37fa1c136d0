"""Compute coefficients of collocation for second-order systems: Radau IIA or Gauss, odd numbers of stages.

The stages are at c_1 .. c_s of the step h, and A_ij = int_0^{c_i} l_j with Lagrange's polynomials l. Positions q + c h
v + Z have the velocities v + A^-1 Z / h and the accelerations A^-2 Z / h^2. Radau points (c_s = 1) have the order 2s -
1 and damp motions that are faster than the steps. Gauss points have the order 2s and conserve energy (Hairer & Wanner
II, Secs. IV.5, IV.8; Hairer, Lubich & Wanner, Geometric Numerical Integration, Sec. VI.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ....base.typing import Array
from ...compiled.simd import SimdArray, simd_copy
from ...core.dense import Polynomials

RADAU, GAUSS = "Radau IIA", "Gauss"
#: Degree of the polynomial through the speeds of a step that guesses those of the next: more would swing beyond it.
AHEAD = 4


class SideBySide(NamedTuple):
    """Hold the coefficients of all stages side by side, W = s + 1; the last one is the start of the step.

    Of the r + 1 systems the SIMD vectors hold the real parts, then the imaginary ones.
    """

    c: Array  # (W,)
    middles: Array  # (W,)
    inverse: SimdArray  # (s, W) to all stages from each
    back: SimdArray  # (s, W) to the systems from each stage
    basis: SimdArray  # (W, W) to the stages from each part
    between: SimdArray  # (k, W)
    defect: SimdArray  # (1, W)
    ends: SimdArray  # (2, W)
    values: SimdArray  # (2, r + 1)
    over: SimdArray  # (2, r + 1) of the rows where the stages hold their rates: 1 / values, else 1


class Scheme(NamedTuple):
    """Coefficients of s stages, r = (s - 1)/2 pairs of complex eigenvalues of A^-1."""

    c: Array  # (s,) places of the stages in the step
    inverse: Array  # (s, s) A^-1
    twice: Array  # (s, s) A^-2
    ends: Array  # (2, s) changes of q - h v and of h v at the step's end by Z
    defect: Array  # (s,) from values at the stages to that of their polynomial at the begin
    values: Array  # (r + 1, 2) eigenvalues, the real one first: real and imaginary parts
    back: Array  # (s, s) to their components: of the real one, then real and imaginary part for each pair
    basis: Array  # (s, s) its inverse
    level: int  # derivative of the constraints that the stages hold
    inner: int  # stages before the step's end
    central: int  # stage next to the middle
    path: Array  # (k, k) coefficients of powers of x from (q, h v, inner stages, q and h v at the end), k = inner + 4
    middles: Array  # (s,) places between the stages
    between: Array  # (s, k) from the same values to them
    speed: Array  # (s + 1, s + 1) coefficients of powers of x - 1 from values at 0, c
    ahead: Array  # (d + 1, s + 1) the same of the polynomial of degree d < s next to values at c, 0
    force: Array  # (s, s) coefficients of powers of x from values at the stages
    side: SideBySide


@lru_cache(maxsize=16)
def scheme(family: str, stages: int, rates: bool = False) -> Scheme:
    """Coefficients of a family with an odd number of stages; with `rates` Radau's, too, hold those of constraints."""
    series = np.zeros(stages + 1)
    series[stages], series[stages - 1] = 1.0, -1.0 if family == RADAU else 0.0
    c = 0.5 + 0.5 * np.sort(np.real(np.polynomial.legendre.legroots(series)))
    inner = stages
    if family == RADAU:
        c[-1], inner = 1.0, stages - 1
    powers = np.arange(stages)
    force = np.linalg.inv(c[:, None] ** powers)
    A = (c[:, None] ** (powers + 1) / (powers + 1)) @ force
    inverse = np.linalg.inv(A)
    values, vectors = np.linalg.eig(inverse)
    order = np.argsort(np.abs(values.imag))
    kept = [order[0], *(k for k in order[1:] if values[k].imag > 0.0)]
    columns = [np.real(vectors[:, kept[0]])]
    for k in kept[1:]:
        columns += [2.0 * np.real(vectors[:, k]), -2.0 * np.imag(vectors[:, k])]
    basis = np.column_stack(columns)
    b = (1.0 / (powers + 1)) @ force
    p = np.arange(inner + 4.0)
    path = path_matrix(c[:inner])
    middles = 0.5 * (np.append(0.0, c[:-1]) + c)
    between = middles[:, None] ** p @ path
    between[:, 0] = 1.0 - between[:, 2:-1].sum(axis=1)  # not 1e-10 off, which the joints would see
    before = np.vander(np.append(0.0, c) - 1.0, increasing=True)
    next_to = np.linalg.pinv(before[:, : min(AHEAD, stages - 1) + 1])
    mu = np.array([values[k] for k in kept])
    level = int(family == GAUSS or rates)
    parts = [0, *range(1, stages, 2), *range(2, stages, 2)]  # real parts, then imaginary ones except for the first
    entry = [*range(len(kept)), *range(len(kept) + 1, stages + 1)]

    def wide(rows: Array) -> SimdArray:
        return simd_copy(np.pad(rows, ((0, 0), (0, stages + 1 - rows.shape[1]))))

    systems, stage = np.zeros((stages, stages + 1)), np.zeros((stages + 1, stages))
    back = np.linalg.inv(basis)
    systems[:, entry], stage[entry] = back[parts].T, basis[:, parts].T
    begin = np.zeros((inner + 4, 1))
    begin[0] = 1.0
    ends = np.stack([b @ inverse, b @ inverse @ inverse])
    over = 1.0 / mu if level else np.ones(len(mu), dtype=complex)
    side = SideBySide(
        np.append(c, 0.0), np.append(middles, 0.0), wide(inverse.T), simd_copy(systems), wide(stage),
        simd_copy(np.hstack([between.T, begin])), wide(force[:1]), wide(ends), simd_copy(np.stack([mu.real, mu.imag])),
        simd_copy(np.stack([over.real, over.imag])),
    )  # fmt: skip
    return Scheme(
        c=c, inverse=inverse, twice=inverse @ inverse, ends=ends,
        defect=force[0].copy(), values=np.array([[values[k].real, values[k].imag] for k in kept]),
        back=back, basis=basis, level=level, inner=inner,
        central=int(np.abs(c - 0.5).argmin()),
        path=path, middles=middles, between=between,
        speed=np.linalg.inv(before), ahead=np.roll(next_to, -1, axis=1).copy(), force=force,
        side=side,
    )  # fmt: skip


def path_matrix(c: Array, accelerations: bool = False, origin: float = 0.0) -> Array:
    """Compute coefficients of powers of x - origin for the path of a step.

    They follow from q and h v at 0 and 1, q at c, and h^2 q'' at 0 and 1.

    About the middle of the step rounding weighs a thousand times less at the step's end than about its begin.
    """
    p = np.arange(len(c) + (6.0 if accelerations else 4.0))

    def derivative(x: float, k: int) -> Array:
        factors = np.array([math.perm(j, k) for j in range(len(p))], dtype=float)
        return np.asarray(factors * (x - origin) ** np.maximum(p - k, 0.0))

    rows = [derivative(0.0, 0), derivative(0.0, 1), *(derivative(x, 0) for x in c), derivative(1.0, 0)]
    rows += [derivative(1.0, 1), *([derivative(0.0, 2), derivative(1.0, 2)] if accelerations else [])]
    return np.linalg.inv(np.array(rows))


@dataclass(frozen=True)
class Collocated(Polynomials):
    """Dense output through the stages; `forces`: multipliers of all rows, then stresses of the elements that have some.

    Both are unknowns of the stages. Stresses that follow from the coordinates between them would err by the stiffness
    times the error of a strain, which is that of the coordinates.
    """

    forces: Polynomials | None = None


def powers_of_path(path: Array, known: Array, inner: int) -> Array:
    """Coefficients of powers of x, the lowest first, from (..., k, n) as `path_matrix` has them."""
    moved = known.copy()
    for k in (*range(2, inner + 3), 0):
        moved[..., k, :] -= known[..., 0, :]  # differences round less
    made: Array = path @ moved
    made[..., 0, :] += known[..., 0, :]
    return made
