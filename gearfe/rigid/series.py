"""Taylor integration of systems that can be written on a tape: constant mass, quadratic rows, analytic forces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..typing import Array, IntArray
from . import kernel_quadratic, kernel_rows, kernel_steps, kernel_tape, kernel_tape_run
from .compiled import Kernels
from .dense import Polynomials
from .packed import Packed
from .start import Start
from .steps import Status, Watch, run_in_pieces
from .system import System
from .tape import Program, Tape
from .taylor import order_for

FUNCTIONS = (
    kernel_rows.fill,
    kernel_rows.copy,
    kernel_rows.time_series,
    *kernel_tape.FUNCTIONS,
    *kernel_quadratic.FUNCTIONS,
    *kernel_steps.FUNCTIONS,
    *kernel_tape_run.FUNCTIONS,
)
NAMES = {**kernel_rows.GLOBALS, **kernel_tape.NAMES, **kernel_tape_run.NAMES}
HOT = ("fill", "copy", "cauchy", "weighted", "horner", "largest", "margin", "lower_knot", "own_piece")
KERNELS = Kernels(FUNCTIONS, NAMES, ("quadratic_steps",), HOT)
#: Steps between two looks at the clock, and at most coefficients in one piece of the output.
FIRST, MOST_NUMBERS = 16, 2_000_000


class Work(NamedTuple):
    """State and scratch arrays; n coordinates, m rows, K orders, z variables."""

    q: Array  # (n,) state reached
    v: Array
    pieces: IntArray  # of the switches
    qn: Array  # (n,) state at the end of a step
    vn: Array
    Z: Array  # (z, K) series of the variables
    H: Array  # (z, K) forces along them
    L: Array  # (m, K) multipliers
    R: Array  # (registers, K)
    TF: Array  # (functions, K)
    P: Array  # (z, 2) one state
    R0: Array  # (registers, 1) there
    H0: Array  # (z, 1)
    D: Array  # (m, z) rows by variables
    G: Array  # (m, n)
    A: Array  # (n + m, n + m) factor
    pivot: IntArray  # (n + m,)
    scale: Array  # (1,) of the masses in the factor
    x: Array  # (n + m,)
    F: Array  # (n,)
    gap: Array  # (m,)


def tape_program(system: System) -> Program | None:
    """The system on a tape; None where an element has no series."""
    program = written(system)
    return None if program is None or len(program.bars.place) or len(program.floats.place) else program


def written(system: System) -> Program | None:
    """The system on a tape; None where an element cannot be written."""
    known: dict[str, Program | None] = system.__dict__
    if "_program" not in known:
        known["_program"] = _program(system)
    return known["_program"]


def _program(system: System) -> Program | None:
    tape = Tape(system.size)
    for element, places in zip(system.elements, system.index, strict=True):
        write: Any = getattr(element, "write", None)
        if write is None:
            if element.rows or hasattr(element, "force"):
                return None
        elif not write(tape, places):
            return None
    return tape.program(system.mass, system.damping, system.stiffness, system.units)


def without_redundant(program: Program, active: np.ndarray) -> Program:
    """Without the rows that are redundant."""
    if active.all():
        return program
    rows, number = program.rows, np.cumsum(active) - 1
    held, pairs = active[rows.place[:, 0]], active[rows.pair[:, 0]]
    place, pair = rows.place[held], rows.pair[pairs]
    place[:, 0], pair[:, 0] = number[place[:, 0]], number[pair[:, 0]]
    kept = rows._replace(
        place=place, factor=rows.factor[held], pair=pair, weight=rows.weight[pairs],
        constant=rows.constant[active], motion=rows.motion[active], unit=rows.unit[active],
    )  # fmt: skip
    return program._replace(rows=kept)


def _work(program: Program, order: int) -> Work:
    n, m, z = len(program.mass), len(program.rows.constant), len(program.mass) + len(program.curves.sign)
    K, registers, functions = order + 2, len(program.code.op), len(program.times.first) - 1
    shapes: list[tuple[int, ...]] = [(z, K), (z, K), (m, K), (registers, K), (functions, K)]
    shapes += [(z, 2), (registers, 1), (z, 1), (m, z), (m, n), (n + m, n + m)]
    vectors = [np.zeros(n) for _ in range(4)]
    pieces, pivot = (np.zeros(k, dtype=np.int64) for k in (len(program.switches.register), n + m))
    last = [np.zeros(1), np.zeros(n + m), np.zeros(n), np.zeros(m)]
    arrays: list[Any] = [*vectors[:2], pieces, *vectors[2:], *(np.zeros(shape) for shape in shapes), pivot, *last]
    return Work._make(arrays)


def first_pieces(program: Program, w: Work, t: float, forward: bool) -> bool:
    """Pieces of all switches at the state in w; whether every table has a value there."""
    plain, n = KERNELS.plain, len(w.q)
    w.Z[:n, 0], w.Z[:n, 1] = w.q, w.v
    plain.time_series(program.times, t, forward, 2, w.TF)
    for k in (0, 1):
        plain.curve_orders(program, w.Z, w.pieces, k)
    for s, register in enumerate(program.switches.register):
        plain.tape_order(program, w.Z, w.R, w.TF, w.pieces, 0)
        w.pieces[s] = piece = plain.piece_at(program.switches, s, w.R[register, 0])
        knots = program.switches.first[s + 1] - program.switches.first[s]
        if knots and piece < 0 and not program.switches.period[s]:
            return False
    return True


def run_series(
    system: System, start: Start, times: Array, *, local: float, longest: float, most: int, watch: Watch | None = None
) -> tuple[Polynomials, Status, dict[str, Any]]:
    """Integrate; returns (dense output, status, statistics). `local` is the tolerance of the last terms."""
    program = tape_program(system)
    assert program is not None  # the caller asks before
    program = without_redundant(program, start.active)
    order, end, t = order_for(local), float(times[-1]), start.time
    sign = 1.0 if end >= t else -1.0
    run = kernel_steps.Run(t, end, sign, order, local, float(longest), system.breaks)
    w, n = _work(program, order), system.size
    w.q[:], w.v[:] = start.q, start.v
    with np.errstate(all="ignore"):
        covered = first_pieces(program, w, t, sign > 0.0)
    handed, now, made = (Packed(program), Packed(w), Packed(run)), np.array([t]), np.zeros(1, dtype=np.int64)
    advance = KERNELS.compiled.quadratic_steps
    none = kernel_tape_run.Output(now, made, np.zeros(1), np.zeros((0, order + 1, n)))
    compiling = KERNELS.load(lambda: advance(*handed[:2], Packed(run._replace(end=t)), Packed(none)))
    ends, series = [np.array([t])], [np.zeros((0, order + 1, n))]

    def fill(room: int) -> tuple[int, float, int]:
        T, C = np.empty(room + 1), np.empty((room, order + 1, n))
        status = advance(*handed, Packed(kernel_tape_run.Output(now, made, T, C)))
        count = int(made[0])
        ends.append(T[1 : count + 1])
        series.append(C[:count])
        return status, float(now[0]), count

    status, done = Status.NOT_FINITE, 0
    if covered:
        status, done = run_in_pieces(
            fill, t, lambda: (w.q, w.v), room=FIRST, largest=max(FIRST, MOST_NUMBERS // max(1, (order + 1) * n)),
            most=most, watch=watch,
        )  # fmt: skip
    if status in (Status.STEP_TOO_SMALL, Status.NOT_FINITE):
        status = _because_of_loads(system, w, float(now[0]), sign * abs(end - start.time), status)
    statistics = {
        "scheme": "Taylor series", "steps": done, "order": order, "backend": "compiled", "compile_seconds": compiling,
    }  # fmt: skip
    return Polynomials(np.concatenate(ends), np.concatenate(series)), status, statistics


def _because_of_loads(system: System, w: Work, t: float, span: float, status: Status) -> Status:
    """Why a run ended at the state in w: not finite where loads have no value there, or just beyond; they say so."""
    system.forget_complaints()
    for ahead in (0.0, 1e-9, 1e-6):
        d = ahead * span
        with np.errstate(all="ignore"):
            system.blame(t + d, w.q + d * w.v, w.v + 2.0 * d * w.Z[: len(w.q), 2])
        if system.complaint:
            return Status.NOT_FINITE
    return status
