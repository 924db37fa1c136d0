"""Taylor integration of planar linkages: orders, work space, backend; the loops are in the kernel modules."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..typing import Array, IntArray
from . import (
    compiled,
    kernel_forces,
    kernel_locate,
    kernel_names,
    kernel_rows,
    kernel_run,
    kernel_series,
    kernel_singular,
    kernel_steps,
)
from .dense import Polynomials
from .packed import Packed
from .start import Start
from .steps import Status, Watch, run_in_pieces
from .tables import Assembly, Tables

#: Seconds of compiling the kernels (measured).
COMPILE_SECONDS = 15.0
FUNCTIONS = (
    *kernel_rows.FUNCTIONS, *kernel_forces.FUNCTIONS, *kernel_series.FUNCTIONS, *kernel_singular.FUNCTIONS,
    *kernel_locate.FUNCTIONS, *kernel_steps.FUNCTIONS, *kernel_run.FUNCTIONS,
)  # fmt: skip
NAMES = {
    **kernel_rows.GLOBALS,
    **kernel_names.NAMES,
    **kernel_singular.NAMES,
    **kernel_locate.NAMES,
    **kernel_run.NAMES,
}
HOT = (
    "fill", "copy", "trigonometry", "vector_at", "arm_at", "vector_rate", "gradients", "residuals",
    "times_gradients", "add_transposed", "solve", "least_change",
    "angle_orders", "vector_orders", "row_orders", "spring_orders", "force_orders", "form_order", "spring_force",
    "add_force", "add_arms", "product_forces", "add_multipliers", "add_product_multipliers", "torque_orders",
    "finish_order", "constrained",
)  # fmt: skip


KERNELS = compiled.Kernels(
    (*FUNCTIONS, *kernel_run.STARTERS), NAMES, ("integrate_series", "sample"), HOT, making=COMPILE_SECONDS
)
#: Steps between two looks at the clock at first: plain ones, compiled ones; at most coefficients in a piece.
FIRST_STEPS, FIRST_COMPILED, MOST_NUMBERS = 8, 64, 2_000_000


class Border(NamedTuple):
    """Rows of a passing singular position; d is the most that may pass at once."""

    Z: Array  # (d, m) combinations whose gradient vanishes
    Y: Array  # (d, m) S_reg^-1 E
    E: Array  # (d, m) G_reg M^-1 B^T
    P: Array  # (d, 3n) G^T Z
    B: Array  # (d, 3n) dG^T/dt Z
    schur: Array  # (d, d) Schur complement of the rows B
    small: Array  # (d, d)
    nu: Array  # (d,)
    drop: IntArray  # (d,) rows left out


class Carry(NamedTuple):
    """Answers of the masses N to k light coordinates, see kernel_series."""

    X: Array  # (k, 3n) coordinates
    Y: Array  # (k, m) multipliers
    W: Array  # (k, d) multipliers of the singular rows
    lu: Array  # (k, k)
    own: Array  # (k,)


class Work(NamedTuple):
    """Scratch arrays; n bodies with the ground, m rows, K orders."""

    QS: Array  # (K, 3n) series of the coordinates
    LM: Array  # (K, m) multipliers
    TF: Array  # (functions, K)
    bs: Array  # (5, K, n) Taylor coefficients of the bodies, see kernel_names
    vs: Array  # (2, K, vectors)
    ss: Array  # (3, K, springs)
    border: Border
    carry: Carry
    G: Array  # (m, 2, 3)
    H: Array  # (m, 2, 3) dG/dt
    val: Array  # (m + nnz,) factor
    diag: Array  # (m,)
    mu: Array  # (m,)
    rhs: Array  # (m,)
    F: Array  # (3n,)
    u: Array
    work: Array
    dq: Array
    dv: Array
    q: Array  # (3n,) state reached
    v: Array
    qn: Array  # (3n,) state at the end of a step
    vn: Array
    c: Array  # (n,)
    s: Array
    skip: IntArray  # (m,) rows left out here
    base: IntArray  # (m,) redundant rows: which ones are left out changes along the motion


def most_singular(tables: Tables) -> int:
    """How many rows can lose their gradients at once: those that close loops, for a tree of joints is never singular.

    Rows of one joint follow one another and join the same two bodies.
    """
    root: dict[int, int] = {}

    def top(body: int) -> int:
        while root.setdefault(body, body) != body:
            body = root[body]
        return body

    ends = tables.forms.bodies[: len(tables.forms.unit)]
    pairs: Counter[tuple[int, int]] = Counter((int(min(a, b)), int(max(a, b))) for a, b in ends)
    closing = 0
    for (a, b), count in pairs.items():
        if top(a) == top(b):
            closing += count
        else:
            root[top(a)] = top(b)
            closing += max(0, count - 2)
    return max(1, closing)


def work_space(tables: Tables, order: int) -> Work:
    """Scratch arrays for series up to `order`."""
    K, n3, m, d = order + 3, tables.mass.size, len(tables.forms.unit), most_singular(tables)
    k = tables.light.size
    n, vectors, springs = n3 // 3, len(tables.vectors.bodies), len(tables.forces.spring)

    def zeros(count: int, *shape: int) -> list[Any]:
        return [np.zeros(shape) for _ in range(count)]

    drop: Any = np.zeros(d, dtype=np.int64)
    border = [*zeros(3, d, m), *zeros(2, d, n3), *zeros(2, d, d), np.zeros(d), drop]
    arrays: list[Any] = [
        np.zeros((K, n3)),
        np.zeros((K, m)),
        np.zeros((tables.times.first.size - 1, K)),
        np.zeros((5, K, n)),
        np.zeros((2, K, vectors)),
        np.zeros((3, K, springs)),
        Border._make(border),
        Carry(np.zeros((k, n3)), np.zeros((k, m)), np.zeros((k, d)), np.zeros((k, k)), np.zeros(k)),
        *zeros(2, m, 2, 3),
        np.zeros(m + tables.plan.row.size),
        *zeros(3, m),
        *zeros(9, n3),
        *zeros(2, n),
        np.zeros(m, dtype=np.int64),
        np.zeros(m, dtype=np.int64),
    ]
    return Work._make(arrays)


class Prepared(NamedTuple):
    """Tables and work space of a linkage at one order, and what kernels get of them: the same, or both as blocks."""

    assembly: Assembly
    order: int
    jit: bool  # whether for compiled kernels
    work: Work
    handed: tuple[Any, Any]


def prepare(assembly: Assembly, order: int, jit: bool) -> Prepared:
    """What runs of one linkage at one order share."""
    tables = assembly.tables
    work = work_space(tables, order)
    return Prepared(assembly, order, jit, work, (Packed(tables), Packed(work)) if jit else (tables, work))


def load_kernels(prepared: Prepared, run: kernel_steps.Run) -> float:
    """Compile the kernels, or load them, by a run of no length; seconds that this took."""
    width = prepared.work.q.size - 3
    times, coefficients = np.zeros(2), np.zeros((1, run.order + 1, width))
    state = first_state(run.end)
    state[kernel_names.BEGUN] = 1.0

    def nothing() -> None:
        out = kernel_run.Output(state, times, coefficients, *np.zeros((2, 1), dtype=np.int64))
        KERNELS.compiled.integrate_series(*prepared.handed, Packed(run), Packed(out))
        sampler(times, coefficients, 1.0, np.zeros(1), 0, np.zeros((1, width)))

    return KERNELS.load(nothing)


def first_state(begin: float) -> Array:
    """State of a run that has not begun, see `kernel_names`."""
    return np.array([begin, 0.0, math.inf, 0.0, 0.0, -1.0])


def order_for(tolerance: float) -> int:
    """Order that costs least: about half the number of decimal digits times ln 10, plus a margin (measured)."""
    return int(min(26, max(8, math.ceil(-0.62 * math.log(tolerance)) + 7)))


def run_taylor(
    shared: Prepared,
    start: Start,
    end: float,
    *,
    tolerance: float,
    longest: float = math.inf,
    most: int = 1_000_000,
    watch: Watch | None = None,
) -> tuple[Polynomials, Status, dict[str, Any]]:
    """Integrate the linkage from its consistent start to the time `end`; (dense output, status, statistics).

    `tolerance` is that of the last terms. The dense output is without the ground's coordinates.
    """
    assembly, order, jit, w, both = shared
    t0 = start.time
    w.q[:-3], w.v[:-3], w.base[:] = start.q, start.v, ~start.active
    sign = 1.0 if end >= t0 else -1.0
    run = kernel_steps.Run(t0, end, sign, order, float(tolerance), float(longest), assembly.breaks, assembly.length)
    state, made = first_state(t0), np.zeros(1, dtype=np.int64)
    compiling = load_kernels(shared, run) if jit else 0.0
    advance = (KERNELS.compiled if jit else KERNELS.plain).integrate_series
    handed = (*both, Packed(run) if jit else run)
    width = w.q.size - 3
    parts: list[tuple[Array, Array, IntArray]] = []

    def fill(room: int) -> tuple[int, float, int]:
        times, coefficients = np.empty(room + 1), np.empty((room, order + 1, width))
        singular = np.zeros(room, dtype=np.int64)
        out = kernel_run.Output(state, times, coefficients, singular, made)
        status = advance(*handed, Packed(out) if jit else out)
        if status == Status.SINGULAR_START:
            rows, shift, ahead, row, status = KERNELS.plain.begin(assembly.tables, w, run, t0)
            state[:] = t0 + shift, rows, ahead, 1.0, 0.0, row
            if status == Status.DONE:
                return fill(room)
            times[0] = t0
        count = int(made[0])
        parts.append((times[: count + 1], coefficients[:count], singular[:count]))
        return status, float(state[kernel_names.TIME]), count

    def look(t: float, steps: int, moving: Callable[[], tuple[Array, Array]]) -> bool:
        regular = state[kernel_names.SINGULAR] == 0.0
        return watch is None or (steps > 0 and not regular) or watch(t, steps, moving)

    status, done = run_in_pieces(
        fill, t0, lambda: (w.q[:-3], w.v[:-3]), room=FIRST_COMPILED if jit else FIRST_STEPS,
        largest=max(FIRST_COMPILED, MOST_NUMBERS // ((order + 1) * width)), most=most, watch=look,
    )  # fmt: skip
    ends = np.concatenate([parts[0][0], *(p[0][1:] for p in parts[1:])])
    series = np.concatenate([p[1] for p in parts]) if len(parts) > 1 else parts[0][1]
    dense = Polynomials(ends, series, sampler if jit else None, t0)
    statistics = {
        "scheme": "Taylor series",
        "steps": done,
        "order": order,
        "backend": "compiled" if jit else "plain",
        "compile_seconds": compiling,
        "singular_passages": ends[np.flatnonzero(np.concatenate([p[2] for p in parts]))],
    }
    return dense, status, statistics


def sampler(times: Array, coefficients: Array, sign: float, t: Array, derivative: int, out: Array) -> None:
    """Compiled sums of the polynomials, see `Polynomials`."""
    KERNELS.compiled.sample(Packed(kernel_run.Samples(times, coefficients, sign, t, derivative, out)))
