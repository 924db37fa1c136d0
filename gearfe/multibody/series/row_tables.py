"""Lay out the rows and masses of a program as flat arrays for series.

The arrays are gradients, squares, and S = G M^-1 G^T = L D L^T.

The quadratic part of a row is a sum of squares of forms of the variables, sum_k d_k (w_k . z)^2, from its eigenvalues
and eigenvectors. A distance has two squares, a line that rotates with a body four. They are variables behind those of
the program.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.typing import Array, IntArray
from .ordering import Factor, symbolic_factor
from .tape import Program

#: Places in arrays: compiled code need not ask for negative ones.
Numbers = NDArray[np.uint64]
#: Eigenvalues and entries of eigenvectors below this share of the largest are rounding.
ROUNDING = 1e-14


class Masses(NamedTuple):
    """Inverse of the mass matrix with the added masses of light links (`multibody.core.mass_regularisation`)."""

    place: Numbers  # (e, 2) its entries
    inverse: Array  # (e,)
    light: IntArray  # (k,) coordinates
    added_mass: Array  # (k,)


class Gradients(NamedTuple):
    """Gradients of the rows: what stands still, and the shares of curves (cosines, sines, tables)."""

    first: IntArray  # (m + 1,) entries of each row
    row: Numbers  # (entries,)
    column: Numbers  # (entries,) coordinate
    still: Array  # (entries,)
    turning: Numbers  # (t, 3) row, entry, variable
    factor: Array  # (t,)


class Squares(NamedTuple):
    """Terms d (w . z)^2 of rows."""

    row: IntArray  # (s,)
    factor: Array  # (s,) d
    first: IntArray  # (s + 1,)
    variable: Numbers  # (p,)
    weight: Array  # (p,) w
    entry: Numbers  # (p,) of the gradients


class Equations(NamedTuple):
    """Everything that the kernels of a series need."""

    program: Program
    mass: Masses
    gradient: Gradients
    square: Squares
    product: Numbers  # (e, 4) target in S, two entries of gradients, entry of the masses
    factor: Factor


def row_tables(program: Program, inverse: Array, added_mass: Array) -> Equations:
    """Tables of a program.

    Parameters
    ----------
    program
        On whose rows they are.
    inverse : ndarray, shape (n, n)
        Inverse of the mass matrix with the added masses.
    added_mass : ndarray, shape (n,)
        Of the light coordinates, else 0.
    """
    rows, n = program.rows, len(program.mass)
    m = len(rows.constant)
    coordinate = np.append(np.arange(n), program.curves.place[:, 0])
    entries: list[dict[int, int]] = [{} for _ in range(m)]  # column -> number within the row
    for r, variable in [*rows.place.tolist(), *rows.pair[:, :2].tolist(), *rows.pair[:, ::2].tolist()]:
        entries[r].setdefault(int(coordinate[variable]), len(entries[r]))
    first = np.cumsum([0, *map(len, entries)]).astype(np.int64)

    def entry(r: int, variable: int) -> int:
        return int(first[r]) + entries[r][int(coordinate[variable])]

    still, turning, factor = np.zeros(first[-1]), [], []
    for (r, variable), value in zip(rows.place.tolist(), rows.factor.tolist(), strict=True):
        if variable < n:
            still[entry(r, variable)] += value
        else:
            turning.append((r, entry(r, variable), variable))
            factor.append(value)
    column = np.array([i for row in entries for i in row], dtype=np.uint64)
    row = np.repeat(np.arange(m, dtype=np.uint64), np.diff(first))
    gradient = Gradients(first, row, column, still, _numbers(turning, 3), np.array(factor, dtype=float))
    squares = [(r, d, w) for r in range(m) for d, w in _squares(rows.pair, rows.weight, r)]
    terms = [(v, w, entry(r, v)) for r, _, weights in squares for v, w in weights.items()]
    square = Squares(
        np.array([r for r, _, _ in squares], dtype=np.int64),
        np.array([d for _, d, _ in squares], dtype=float),
        np.cumsum([0, *(len(w) for _, _, w in squares)]).astype(np.int64),
        np.array([v for v, _, _ in terms], dtype=np.uint64),
        np.array([w for _, w, _ in terms], dtype=float),
        np.array([e for _, _, e in terms], dtype=np.uint64),
    )
    place = np.argwhere(inverse != 0.0)
    light = np.flatnonzero(added_mass)
    masses = Masses(np.ascontiguousarray(place, dtype=np.uint64), inverse[tuple(place.T)], light, added_mass[light])
    holders: dict[int, list[tuple[int, int]]] = defaultdict(list)  # column -> rows and their entries
    for r in range(m):
        for e in range(int(first[r]), int(first[r + 1])):
            holders[int(column[e])].append((r, e))
    joined = [
        (r, s, a, b, e)
        for e, (i, j) in enumerate(place.tolist())
        for r, a in holders[i]
        for s, b in holders[j]
        if r >= s
    ]
    made, target = symbolic_factor(m, {(r, s) for r, s, *_ in joined})
    products = _numbers([(target(r, s), a, b, e) for r, s, a, b, e in joined], 4)
    return Equations(program, masses, gradient, square, products, made)


def _squares(pair: IntArray, weight: Array, r: int) -> list[tuple[float, dict[int, float]]]:
    """Factors and forms of the squares of a row."""
    own = pair[:, 0] == r
    variables = np.unique(pair[own, 1:])
    if not len(variables):
        return []
    matrix = np.zeros((len(variables), len(variables)))
    one, two = np.searchsorted(variables, pair[own, 1:]).T
    np.add.at(matrix, (one, two), 0.5 * weight[own])
    np.add.at(matrix, (two, one), 0.5 * weight[own])
    values, vectors = np.linalg.eigh(matrix)
    kept = np.flatnonzero(np.abs(values) > ROUNDING * np.abs(values).max())
    return [
        (
            float(values[k]),
            {int(v): float(w) for v, w in zip(variables, vectors[:, k], strict=True) if abs(w) > ROUNDING},
        )
        for k in kept
    ]


def _numbers(values: Sequence[tuple[int, ...]], width: int) -> Numbers:
    return np.array(values, dtype=np.uint64).reshape(-1, width)
