"""State and scratch arrays of a run by series on a tape, and what holds for the whole run."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base.typing import Array, IntArray
from .row_tables import Equations


class Run(NamedTuple):
    """Constant data of a run."""

    begin: float  # (s)
    end: float
    sign: float  # of time
    order: int
    tolerance: float  # of the last terms
    longest: float  # step (s)
    breaks: Array  # times at which steps end, rising (s)


class Border(NamedTuple):
    """Rows of a passing singular position; as many as all may pass at once."""

    Z: Array  # (m, m) combinations whose gradient vanishes
    Y: Array  # (m, m) S_reg^-1 E
    E: Array  # (m, m) G_reg M^-1 B^T
    P: Array  # (m, n) G^T Z
    B: Array  # (m, n) dG^T/dt Z
    schur: Array  # (m, m) Schur complement of the rows B
    small: Array  # (m, m)
    nu: Array  # (m,)
    drop: IntArray  # (m,) rows left out


class Regularisation(NamedTuple):
    """Answers of the masses N to k light coordinates, see `recurrences`."""

    X: Array  # (k, n) coordinates
    Y: Array  # (k, m) multipliers
    W: Array  # (k, m) multipliers of the singular rows
    lu: Array  # (k, k)
    own: Array  # (k,)


class Work(NamedTuple):
    """State and scratch arrays; n coordinates, m rows, z variables and s squares' forms, K orders."""

    Z: Array  # (z + s, K) series of the variables
    H: Array  # (z, K) forces along them
    L: Array  # (m, K) multipliers
    R: Array  # (registers, K)
    TF: Array  # (functions, K)
    P: Array  # (z + s, 2) variables of one state, and their rates
    R0: Array  # (registers, 1) there
    H0: Array  # (z, 1)
    slope: Array  # (z,) dz/dq
    bend: Array  # (z,) its rate
    G: Array  # (entries,) gradients of the rows
    dG: Array  # (entries,) their rates
    val: Array  # (m + nnz,) factor
    diag: Array  # (m,)
    mu: Array  # (m,)
    rhs: Array  # (m,)
    q: Array  # (n,) state reached
    v: Array
    qn: Array  # (n,) state at the end of a step
    vn: Array
    F: Array
    u: Array
    a: Array
    work: Array
    dq: Array
    dv: Array
    skip: IntArray  # (m,) rows left out here
    base: IntArray  # (m,) redundant rows: which ones are left out changes along the motion
    pieces: IntArray  # of the switches
    border: Border
    regularisation: Regularisation


def work_space(tb: Equations, order: int) -> Work:
    """Scratch arrays for series up to `order`."""
    program, K = tb.program, order + 3
    n, m, k = len(program.mass), len(program.rows.constant), len(tb.mass.light)
    z, registers, functions = n + len(program.curves.sign), len(program.code.op), len(program.times.first) - 1
    forms, entries = z + len(tb.square.row), len(tb.gradient.column)

    def zeros(*shapes: int | tuple[int, ...]) -> list[Any]:
        return [np.zeros(shape) for shape in shapes]

    def whole(size: int) -> IntArray:
        return np.zeros(size, dtype=np.int64)

    border = Border._make([*zeros(*[(m, m)] * 3, *[(m, n)] * 2, *[(m, m)] * 2, m), whole(m)])
    regularisation = Regularisation._make(zeros((k, n), (k, m), (k, m), (k, k), k))
    series = zeros((forms, K), (z, K), (m, K), (registers, K), (functions, K), (forms, 2), (registers, 1), (z, 1), z, z)
    rows = zeros(entries, entries, m + len(tb.factor.row), m, m, m)
    numbers = [whole(m), whole(m), whole(len(program.switches.register))]
    arrays: list[Any] = [*series, *rows, *zeros(*[n] * 10), *numbers, border, regularisation]
    return Work._make(arrays)
