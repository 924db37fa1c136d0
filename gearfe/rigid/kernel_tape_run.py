"""The integration loop of series on a tape: expand, choose the step, end it where a piece ends, project.

The length of a step (`kernel_steps`) is checked: forces within the
step against their series, the state at its end against the constraints.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..typing import Array, IntArray
from .kernel_quadratic import expand, factorise, gradients, row_orders, solve
from .kernel_rows import copy, fill, time_series
from .kernel_steps import even_step, next_goal, series_step
from .kernel_tape import (
    OUTSIDE,
    curve_forces,
    curve_orders,
    horner,
    is_pole,
    largest,
    leaves,
    margin,
    next_piece,
    tape_order,
)
from .steps import Status

if TYPE_CHECKING:
    from .kernel_steps import Run
    from .series import Work
    from .tape import Program

DONE, STEP_TOO_SMALL, MOST_STEPS = int(Status.DONE), int(Status.STEP_TOO_SMALL), int(Status.MOST_STEPS)
NOT_FINITE = int(Status.NOT_FINITE)
#: Least pivot of the scaled matrix; most changes of pieces at one time.
LEAST_PIVOT, MOST_CHANGES = 1e-13, 50
#: Places within a step at which forces are compared with their series; rounding of what they find; share of a step that
#: is tried after one that was off.
LOOKS_WITHIN, ROUNDING, SHORTER = 4, 1e-11, 0.6


def step_length(tb: Program, w: Work, run: Run) -> float:
    """Longest step whose last two terms stay below the tolerance, also those of what switches."""
    Z, R, end = w.Z, w.R, run.order - 1
    last = 0.0
    before = 0.0
    both = 0.0
    for i in range(tb.mass.shape[0]):
        one, two = abs(Z[i, run.order]) / tb.unit[i], abs(Z[i, run.order - 1]) / tb.unit[i]
        both += one + two  # unlike a maximum, a sum keeps what is not a number
        last = max(last, one)
        before = max(before, two)
    step = min(series_step(last, before, run), run.longest, abs(run.end - run.begin))
    for s in range(tb.switches.register.shape[0]):
        r = tb.switches.register[s]
        for _ in range(200):
            bound = run.tolerance * max(abs(R[r, 0]), abs(R[r, 1]) * step, abs(R[r, 2]) * step**2)
            if max(abs(R[r, end]) * step**end, abs(R[r, end - 1]) * step ** (end - 1)) <= bound:
                break
            step *= 0.9
    return step if np.isfinite(both) else 0.0


def project(tb: Program, w: Work, run: Run, t: float, h: float) -> tuple[float, float]:
    """The state (w.qn, w.vn) onto the constraints by the least changes in the mass norm, with the factor there in w.A.

    Returns how far off it was, velocities times the step h, and the least pivot.
    """
    P, F, gap, TF = w.P, w.F, w.gap, w.TF
    n = w.qn.shape[0]
    time_series(tb.times, t, run.sign > 0.0, 2, TF)
    off = 0.0
    least = 1.0
    for turn in range(4):
        for i in range(n):
            P[i, 0], P[i, 1] = w.qn[i], w.vn[i]
        curve_orders(tb, P, w.pieces, 0)
        curve_orders(tb, P, w.pieces, 1)
        row_orders(tb, P, TF, 0, gap)
        most = 0.0
        for r in range(gap.shape[0]):
            most = max(most, abs(gap[r]) / tb.rows.unit[r])
            gap[r] = -gap[r]
        if turn == 0:
            off = most
        if turn == 0 or most > 1e-15:
            gradients(tb, P, w)
            least = factorise(tb, w)
            if not least > LEAST_PIVOT:
                return np.inf, least
        if most <= 1e-15:
            break
        fill(F, 0.0)
        solve(tb, w, F, gap)
        for i in range(n):
            w.qn[i] += F[i]
    row_orders(tb, P, TF, 1, gap)
    for r in range(gap.shape[0]):
        off = max(off, abs(h * gap[r]) / tb.rows.unit[r])
        gap[r] = -gap[r]
    fill(F, 0.0)
    solve(tb, w, F, gap)
    for i in range(n):
        w.vn[i] += F[i]
    return off, least


def defect(tb: Program, w: Work, run: Run, t: float, h: float, pieces: IntArray) -> float:
    """Most that the series in w.Z, w.R are off within the step h, by the forces there: in coordinates, as 1 rad.

    Terms of a series do not tell of what is too small to be in them: tanh(100) is 1 to the last digit, but it is none
    of its neighbours'. With the factor at the end of the step in w.A.
    """
    P, F, gap, code = w.P, w.F, w.gap, tb.code
    n = w.q.shape[0]
    most = 0.0
    for look in range(LOOKS_WITHIN):
        place = h * (look + 1) / LOOKS_WITHIN
        for i in range(n):
            value = 0.0
            for k in range(run.order, 0, -1):
                value = value * place + k * w.Z[i, k]
            P[i, 0], P[i, 1] = horner(w.Z, i, run.order, place), value
        curve_orders(tb, P, pieces, 0)
        curve_orders(tb, P, pieces, 1)
        time_series(tb.times, t + place, run.sign < 0.0 if look == LOOKS_WITHIN - 1 else run.sign > 0.0, 1, w.TF)
        tape_order(tb, P, w.R0, w.TF, pieces, 0)
        for s in range(pieces.shape[0]):
            r = tb.switches.register[s]
            if margin(tb.switches, s, pieces[s], w.R0[r, 0]) < -OUTSIDE * largest(w.R, r, run.order - 1, h):
                return np.inf
        for i in range(P.shape[0]):
            w.H0[i, 0] = 0.0
        for p in range(code.push.shape[0]):
            r = code.push[p, 0]
            w.H0[code.push[p, 1], 0] += code.share[p] * (w.R0[r, 0] - horner(w.R, r, run.order - 1, place))
        for i in range(n):
            F[i] = w.H0[i, 0]
        curve_forces(tb, P, w.H0, 0, F)
        fill(gap, 0.0)
        solve(tb, w, F, gap)
        for i in range(n):
            off = abs(F[i]) * h * h / tb.unit[i]
            most = max(most, off) if np.isfinite(off) else np.inf
    return most


class Output(NamedTuple):
    """What a run fills, and where it stands."""

    now: Array  # (1,) time (s)
    made: IntArray  # (1,) number of steps
    times: Array  # (room + 1,) ends of the steps (s)
    coefficients: Array  # (room, order + 1, n) of their series


def quadratic_steps(tb: Program, w: Work, run: Run, out: Output) -> int:
    """Integrate from (w.q, w.v) at `out.now` to run.end, or until the output is full; returns the status."""
    t, T, C = out.now[0], out.times, out.coefficients
    out.made[0] = 0
    sign, n, pieces = run.sign, w.q.shape[0], w.pieces
    status = DONE
    count = 0
    changes = 0
    code = tb.code
    bound = 2.0 * run.order**2 * run.tolerance + ROUNDING
    T[0] = t
    copy(w.q, w.qn)
    copy(w.v, w.vn)
    off, _ = project(tb, w, run, t, 0.0)
    if not np.isfinite(off):
        return STEP_TOO_SMALL
    copy(w.qn, w.q)
    copy(w.vn, w.v)
    while status == DONE and sign * (run.end - t) > 0.0:
        if count >= C.shape[0]:
            status = MOST_STEPS
            break
        for i in range(n):
            w.Z[i, 0], w.Z[i, 1] = w.q[i], w.v[i]
        expand(tb, w, run, t, pieces)
        size = step_length(tb, w, run)
        if not size > 1e-14 * max(abs(t), abs(run.end - run.begin)):
            status = STEP_TOO_SMALL
            break
        goal = next_goal(run.breaks, t, run.end, sign)
        remains = sign * (goal - t)
        size = even_step(size, remains)
        h, where = leaves(tb, w.R, pieces, run.order - 1, sign * size)
        if where >= 0 and is_pole(tb.switches, w.R, where, run.order - 1, h, size):
            status = NOT_FINITE
            break
        if h == 0.0:
            changes += 1
            other = next_piece(tb.switches, where, pieces[where], w.R[tb.switches.register[where], 0])
            if other == pieces[where] or changes > MOST_CHANGES:
                status = NOT_FINITE
                break
            pieces[where] = other
            continue
        for _ in range(60):
            for i in range(n):
                value = 0.0
                for k in range(run.order, 0, -1):
                    value = value * h + k * w.Z[i, k]
                w.qn[i] = horner(w.Z, i, run.order, h)
                w.vn[i] = value
            off, _ = project(tb, w, run, t + h, h)
            if off < 1e3 * run.tolerance + 1e-10:
                if code.push.shape[0] == 0 or defect(tb, w, run, t, h, pieces) < bound:
                    break
                off = np.inf
            h *= SHORTER
            where = -1
        if not off < 1e3 * run.tolerance + 1e-10:
            status = STEP_TOO_SMALL
            break
        for k in range(run.order + 1):
            for i in range(n):
                C[count, k, i] = w.Z[i, k]
        changes = 0
        if where >= 0:
            r = tb.switches.register[where]
            other = next_piece(tb.switches, where, pieces[where], horner(w.R, r, run.order - 1, h))
            if other == pieces[where]:
                status = NOT_FINITE
            else:
                pieces[where] = other
        t = goal if h == sign * remains else t + h
        count += 1
        T[count] = t
        copy(w.qn, w.q)
        copy(w.vn, w.v)
    out.now[0], out.made[0] = t, count
    return status


FUNCTIONS = (step_length, project, defect, quadratic_steps)
NAMES = {
    "DONE": DONE, "STEP_TOO_SMALL": STEP_TOO_SMALL, "MOST_STEPS": MOST_STEPS, "NOT_FINITE": NOT_FINITE,
    "LEAST_PIVOT": LEAST_PIVOT, "MOST_CHANGES": MOST_CHANGES,
    "LOOKS_WITHIN": LOOKS_WITHIN, "ROUNDING": ROUNDING, "SHORTER": SHORTER,
}  # fmt: skip
