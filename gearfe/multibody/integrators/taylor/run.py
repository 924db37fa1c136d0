"""Taylor integration of systems that can be written on a tape: orders, work space, runs.

The loops are in `kernels` and `series.recurrences`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ....base.typing import Array, IntArray
from ...compiled.kernels import Kernels, packed
from ...core.dense import Polynomials
from ...core.start import Start
from ...core.steps import Pace, Status, run_in_pieces
from ...core.system import System
from ...series import recurrences
from ...series.row_tables import Equations, row_tables
from ...series.work_space import Run, Work, work_space
from ..discontinuities import load_problem_ahead
from . import kernels

HOT = (
    "fill", "copy", "cauchy", "weighted", "horner", "largest", "margin", "lower_knot", "own_piece", "curve_orders",
    "curve_forces", "variables", "rates", "gradients", "residuals", "times_gradients", "add_transposed",
    "accelerations", "inner", "solve", "least_change", "square_orders", "row_orders", "_push_orders", "_add_square",
    "_add_multipliers", "_add_square_multipliers", "finish_order", "constrained",
)  # fmt: skip


KERNELS = Kernels(
    (*recurrences.FUNCTIONS, *kernels.FUNCTIONS, *kernels.STARTERS), {**recurrences.NAMES, **kernels.NAMES},
    ("integrate_series", "sample"), HOT,
)  # fmt: skip
#: Steps of the first piece, and most coefficients in a piece.
FIRST_STEPS, MOST_NUMBERS = 64, 2_000_000
#: Distance from a pole, as a share of the way to it, at which loads are asked for their side of it.
NEAR_POLE = 1e-6


class TaylorRun(NamedTuple):
    """Hold one run of a system at one order: constant tables of all runs, and its own work space.

    `handed` are tables and work space as the kernels get them. Making a work space takes as long as a short run, so one
    that a run has left (`spare`) serves the next.
    """

    system: System
    tables: Equations
    order: int
    work: Work
    handed: tuple[Any, Any]
    spare: list[tuple[Work, Any]]


def prepare(system: System, start: Start, order: int) -> TaylorRun:
    """Tables of a system, made once, and a work space that no other run uses."""
    program = system.series
    assert program is not None  # the caller asks before
    light = np.flatnonzero(start.added_mass)

    def made() -> tuple[Equations, Any]:
        tables = row_tables(program, system.inverse_of(start.added_mass), start.added_mass)
        return tables, packed(tables)

    key = light.tobytes(), start.added_mass[light].tobytes()
    tables, handed = system.once(("row tables", *key), made)
    spare: list[tuple[Work, Any]] = system.once(("spare work", order, *key), list)
    try:
        work, packed_work = spare.pop()
    except IndexError:
        work = work_space(tables, order)
        packed_work = packed(work)
    return TaylorRun(system, tables, order, work, (handed, packed_work), spare)


def _first_pieces(tables: Equations, w: Work, t: float, forward: bool) -> bool:
    """Set the pieces of all switches at the state in w; return whether every table has a value there."""
    python, program = KERNELS.python, tables.program
    python.time_series(program.times, t, forward, 2, w.TF)
    python.variables(tables, w, w.q)
    python.rates(tables, w, w.v)
    return bool(python.set_pieces(program, w.P, w.R0, w.TF, w.pieces))


def load_kernels(prepared: TaylorRun, run: Run) -> float:
    """Compile the kernels, or load them, by a run of no length; seconds that this took."""
    width = prepared.work.q.size
    times, coefficients = np.zeros(2), np.zeros((1, run.order + 1, width))
    state = first_state(run.end)
    state[kernels.BEGUN] = 1.0

    def nothing() -> None:
        out = kernels.Output(state, times, coefficients, *np.zeros((2, 1), dtype=np.int64))
        KERNELS.compiled.integrate_series(*prepared.handed, packed(run), packed(out))
        _sampler(times, coefficients, 1.0, np.zeros(1), 0, np.zeros((1, width)))

    return KERNELS.load(nothing)


def first_state(begin: float) -> Array:
    """State of a run that has not begun, see `kernels`."""
    return np.array([begin, 0.0, math.inf, 0.0, 0.0, -1.0])


def order_for(tolerance: float) -> int:
    """Order that costs least: about half the number of decimal digits times ln 10, plus a margin (measured)."""
    return int(min(26, max(8, math.ceil(-0.62 * math.log(tolerance)) + 7)))


def run_taylor(
    shared: TaylorRun, start: Start, end: float, *, tolerance: float, longest: float = math.inf,
    pace: Pace | None = None, stiff: Callable[[float, float, Array, Array], bool] | None = None,
) -> tuple[Polynomials, Status, dict[str, Any]]:  # fmt: skip
    """Integrate from the consistent start to the time `end` by Taylor series.

    Parameters
    ----------
    shared : TaylorRun
        Tables of the system and a work space, see `prepare`.
    start : Start
        Consistent start.
    end : float
        Time at the end (s).
    tolerance : float
        Of the last terms of the series, in units of the coordinates.
    longest : float
        Longest step (s).
    pace : Pace, optional
        Bounds the number of steps and reports it.
    stiff : callable, optional
        Whether a decay limits the steps, by the time (s), the mean step (s), q and v; see `run_in_pieces`.

    Returns
    -------
    dense : Polynomials
        Coordinates over time.
    status : Status
        Why the run ended.
    statistics : dict
        Scheme, steps, order, times of change points.
    """
    system, tables, order, w, both, _ = shared
    t0 = start.time
    w.q[:], w.v[:], w.base[:] = start.q, start.v, ~start.active
    sign = 1.0 if end >= t0 else -1.0
    run = Run(t0, end, sign, order, float(tolerance), float(longest), system.breaks)
    state, made = first_state(t0), np.zeros(1, dtype=np.int64)
    with np.errstate(all="ignore"):
        covered = _first_pieces(tables, w, t0, sign > 0.0)
    compiling = load_kernels(shared, run)
    advance, handed = KERNELS.compiled.integrate_series, (*both, packed(run))
    width = w.q.size
    parts: list[tuple[Array, Array, IntArray]] = []

    def fill(room: int) -> tuple[int, float, int]:
        times, coefficients = np.empty(room + 1), np.empty((room, order + 1, width))
        singular = np.zeros(room, dtype=np.int64)
        out = kernels.Output(state, times, coefficients, singular, made)
        status = advance(*handed, packed(out)) if covered else Status.NOT_FINITE
        if status == Status.SINGULAR_START:
            rows, shift, ahead, row, status = KERNELS.python.begin(tables, w, run, t0)
            state[:] = t0 + shift, rows, ahead, 1.0, 0.0, row
            if status == Status.DONE:
                return fill(room)
            made[0] = 0
        times[0] = state[kernels.TIME] if made[0] == 0 else times[0]
        count = int(made[0])
        parts.append((times[: count + 1], coefficients[:count], singular[:count]))
        return status, float(state[kernels.TIME]), count

    with np.errstate(all="ignore"):
        status, done = run_in_pieces(
            fill, t0, room=FIRST_STEPS, largest=max(FIRST_STEPS, MOST_NUMBERS // ((order + 1) * width)), pace=pace,
            stiff=None if stiff is None else lambda t, step: stiff(t, step, w.q, w.v),
        )  # fmt: skip
    problem = ""
    if status in (Status.STEP_TOO_SMALL, Status.NOT_FINITE):
        problem = _load_problem(shared, run, float(state[kernels.TIME]), status)
        status = Status.NOT_FINITE if problem else status
    shared.spare.append((w, both[1]))
    ends = np.concatenate([parts[0][0], *(p[0][1:] for p in parts[1:])])
    series = np.concatenate([p[1] for p in parts]) if len(parts) > 1 else parts[0][1]
    dense = Polynomials(ends, series, _sampler, t0)
    statistics: dict[str, Any] = {
        "scheme": "Taylor series",
        "steps": done,
        "order": order,
        "compile_seconds": compiling,
        "change_points": ends[np.flatnonzero(np.concatenate([p[2] for p in parts]))],
    }
    if problem:
        statistics["load_problem"] = problem
    return dense, status, statistics


def _load_problem(shared: TaylorRun, run: Run, t: float, status: Status) -> str:
    """Return the load without a value at or just beyond the state in the work space, or with a pole."""
    system, tables, order, w, _, _ = shared
    python = KERNELS.python
    if problem := load_problem_ahead(system, t, (w.q, w.v, 2.0 * w.Z[: len(w.q), 2]), run.end - run.begin):
        return problem
    with np.errstate(all="ignore"):
        size = run.sign * python.step_length(tables, w, run)
        h, where = python.leaves(tables.program, w.R, w.pieces, order - 1, size)
        if status == Status.NOT_FINITE and where >= 0:
            states = []
            for place in (h * (1.0 - NEAR_POLE), h * (1.0 + NEAR_POLE)):
                python.evaluate(w.Z, order, place, w.qn, w.vn)
                states.append((t + place, w.qn.copy(), w.vn.copy()))
            return system.pole_between(*states)
    return ""


def _sampler(times: Array, coefficients: Array, sign: float, t: Array, derivative: int, out: Array) -> None:
    """Evaluate the polynomials of a run by compiled code, see `Polynomials`."""
    KERNELS.compiled.sample(packed(kernels.Samples(times, coefficients, sign, t, derivative, out)))
