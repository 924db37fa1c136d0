"""Taylor integration of planar scenes: orders, work space, backend; the loops are in the kernel modules."""

from __future__ import annotations

import math
from functools import lru_cache
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import compiled, kernel_fold, kernel_rows, kernel_run, kernel_series
from .tables import Array, Assembly, Ints, Tables

FUNCTIONS = (*kernel_rows.FUNCTIONS, *kernel_series.FUNCTIONS, *kernel_fold.FUNCTIONS, *kernel_run.FUNCTIONS)
NAMES = {**kernel_rows.GLOBALS, **kernel_run.NAMES}
MOST_FOLDS = 4


class Work(NamedTuple):
    """Scratch arrays; n bodies with the ground, m rows, s springs, l moving lines, K orders."""

    QS: Array  # (K, 3n) series of the coordinates
    DT: Array  # (K, n) j theta_j
    SN: Array  # (K, n)
    CS: Array
    A: Array
    B: Array
    LM: Array  # (K, m) multipliers
    TF: Array  # (functions, K)
    NX: Array  # (K, l)
    NY: Array
    DX: Array
    DY: Array
    FX: Array
    FY: Array
    EX: Array  # (K, s)
    EY: Array
    EL: Array
    EI: Array
    EF: Array
    G: Array  # (m, 2, 3)
    H: Array
    val: Array  # (m + nnz,)
    diag: Array  # (m,)
    mu: Array
    rhs: Array
    F: Array  # (3n,)
    u: Array
    work: Array
    dq: Array
    dv: Array
    acc: Array  # (n,)
    c: Array
    s: Array
    skip: Ints  # (m,)
    drop: Ints  # (MOST_FOLDS,)
    Z: Array  # (MOST_FOLDS, m)
    Y: Array
    E: Array
    P: Array  # (MOST_FOLDS, 3n)
    BR: Array
    border: Array  # (MOST_FOLDS, MOST_FOLDS)
    small: Array
    nu: Array  # (MOST_FOLDS,)


def work_space(tables: Tables, order: int) -> Work:
    """Scratch arrays for series up to `order`."""
    n = tables.inverse_mass.size // 3
    m = tables.row_kind.size
    size = {
        "K": order + 3,
        "n": n,
        "3n": 3 * n,
        "m": m,
        "l": tables.slots.size,
        "s": tables.spring_body.shape[0],
        "f": tables.piece_first.size - 1,
        "d": MOST_FOLDS,
    }
    shapes = {"QS": "K 3n", "LM": "K m", "TF": "f K", "Z": "d m", "Y": "d m", "E": "d m", "P": "d 3n", "BR": "d 3n"}
    shapes |= dict.fromkeys(("DT", "SN", "CS", "A", "B"), "K n") | dict.fromkeys(("EX", "EY", "EL", "EI", "EF"), "K s")
    shapes |= dict.fromkeys(("NX", "NY", "DX", "DY", "FX", "FY"), "K l") | {"border": "d d", "small": "d d", "nu": "d"}
    shapes |= dict.fromkeys(("diag", "mu", "rhs"), "m") | dict.fromkeys(("F", "u", "work", "dq", "dv"), "3n")
    shapes |= dict.fromkeys(("acc", "c", "s"), "n")
    arrays: dict[str, NDArray] = {k: np.zeros([size[i] for i in v.split()]) for k, v in shapes.items()}
    arrays |= {"G": np.zeros((m, 2, 3)), "H": np.zeros((m, 2, 3)), "val": np.zeros(m + tables.ldl_row.size)}
    arrays |= {"skip": np.zeros(m, dtype=np.int64), "drop": np.zeros(MOST_FOLDS, dtype=np.int64)}
    return Work(**arrays)


class Pieces(NamedTuple):
    """Result of the loop: status, times (steps + 1,), coefficients (steps, order + 1, 3n), folds at each start."""

    status: int
    times: Array
    coefficients: Array
    folds: Ints


@lru_cache(maxsize=2)
def kernels(jit: bool) -> SimpleNamespace:
    """The bound kernels, compiled or plain."""
    if jit:
        return compiled.bind(FUNCTIONS, NAMES, compiled=True)
    from .plain import REPLACE

    return compiled.bind(FUNCTIONS, NAMES, compiled=False, replace=REPLACE)


def order_for(tolerance: float) -> int:
    """Order that costs least: about half the number of decimal digits times ln 10, plus a margin (measured)."""
    return int(min(30, max(8, math.ceil(-0.55 * math.log(tolerance)) + 6)))


def run(
    assembly: Assembly,
    q: Array,
    v: Array,
    span: tuple[float, float],
    *,
    tolerance: float,
    redundant: Ints,
    order: int | None = None,
    longest: float = math.inf,
    most: int = 1_000_000,
    jit: bool = True,
    work: Work | None = None,
) -> Pieces:
    """Integrate the scene from the consistent state (q, v) of its moving bodies over `span`."""
    order = order or order_for(tolerance)
    tb = assembly.tables
    w = work or work_space(tb, order)
    q = np.concatenate([q, np.zeros(3)])
    v = np.concatenate([v, np.zeros(3)])
    status, _, times, coefficients, folds = kernels(jit).integrate_series(
        tb, w, float(span[0]), float(span[1]), q, v, order, float(tolerance), assembly.length, redundant,
        assembly.breaks, float(longest), int(most),
    )  # fmt: skip
    return Pieces(int(status), times, coefficients, folds)
