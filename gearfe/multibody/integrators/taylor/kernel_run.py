"""The integration loop of the Taylor method: expand, choose the step, land, project; land on singular positions rather
than jump them, and where a switch leaves its piece.

Terms count in units of the coordinates (`kernel_steps`). A series started at the distance d from a singular position
amplifies round-off by (h/d)^N beyond it, so a step never crosses one: it ends there, and the next one is expanded there
with the bordered equations of `series.recurrences`. Forces within the step are checked against their series.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....typing import Array, IntArray
from ...core.steps import Status
from ...series.recurrences import (
    OUTSIDE,
    accelerations,
    add_carried,
    carry_responses,
    constrained,
    copy,
    curve_forces,
    expand,
    fill,
    horner,
    is_pole,
    largest,
    leaves,
    margin,
    next_piece,
    rates,
    tape_order,
    time_series,
    times_gradients,
    variables,
)
from .kernel_locate import exchange, locate
from .kernel_singular import evaluate, factor_at, next_singular, project
from .kernel_steps import even_step, next_goal, series_step

if TYPE_CHECKING:
    from ...series.row_tables import Equations
    from ...series.work_space import Run, Work

DONE, STEP_TOO_SMALL, MOST_STEPS = int(Status.DONE), int(Status.STEP_TOO_SMALL), int(Status.MOST_STEPS)
NO_BRANCH, NOT_FINITE, SINGULAR_START = int(Status.NO_BRANCH), int(Status.NOT_FINITE), int(Status.SINGULAR_START)
#: State of a run: time, singular rows there, time to the next singular position, 1 once begun, last step, row of the
#: next singular position (-1 for none).
TIME, SINGULAR, AHEAD, BEGUN, LAST_STEP, ROW = range(6)
#: Angle (rad) that bodies turn against each other between two looks for singular positions.
FAR = 0.5
#: Most changes of pieces at one time.
MOST_CHANGES = 50
#: Places within a step at which forces are compared with their series; rounding of what they find; share of a step that
#: is tried after one that was off.
LOOKS_WITHIN, ROUNDING, SHORTER = 4, 1e-11, 0.6


def step_length(tb: Equations, w: Work, run: Run) -> float:
    """Longest step whose last two terms stay below the tolerance, also those of what switches."""
    Z, R, order, unit = w.Z, w.R, run.order, tb.program.unit
    last = 0.0
    before = 0.0
    both = 0.0
    for i in range(unit.shape[0]):
        one, two = abs(Z[i, order]) / unit[i], abs(Z[i, order - 1]) / unit[i]
        both += one + two  # unlike a maximum, a sum keeps what is not a number
        last = max(last, one)
        before = max(before, two)
    step = min(series_step(last, before, run), run.longest, abs(run.end - run.begin))
    for s in range(w.pieces.shape[0]):
        r = tb.program.switches.register[s]
        for _ in range(200):
            bound = run.tolerance * max(abs(R[r, 0]), abs(R[r, 1]) * step, abs(R[r, 2]) * step**2)
            if max(abs(R[r, order - 1]) * step ** (order - 1), abs(R[r, order - 2]) * step ** (order - 2)) <= bound:
                break
            step *= 0.9
    return step if np.isfinite(both) else 0.0


def clear_series(w: Work) -> None:
    """Series that holds position and velocity only."""
    for i in range(w.q.shape[0]):
        fill(w.Z[i], 0.0)
        w.Z[i, 0] = w.q[i]
        w.Z[i, 1] = w.v[i]


def _singular_behind(tb: Equations, w: Work, run: Run, t: float, ahead: float, where: int) -> tuple[int, float]:
    """Find the singular position just behind a start: (singular rows, time from the start to it)."""
    copy(w.base, w.skip)
    expand(tb, w, run, t, 0)
    if abs(ahead) > step_length(tb, w, run):
        return 0, 0.0
    count, found = locate(tb, w, run, t, ahead, abs(ahead), where)
    if count > 0 and run.sign * found > 0.0:
        count = 0
    return count, found


def begin(tb: Equations, w: Work, run: Run, t: float) -> tuple[int, float, float, int, int]:
    """Find a consistent start next to a singular position; the state is then in w.q, w.v.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        State of the start in ``w.q``, ``w.v``; changed.
    run : Run
        What holds for the whole run.
    t : float
        Time of the start (s).

    Returns
    -------
    singular : int
        Number of rows that are singular there.
    shift : float
        Time from t to the state (s).
    ahead : float
        Time to the singular position ahead (s); infinite for none.
    row : int
        Row that passes there, -1 for none.
    status : int
        `DONE`, or `NO_BRANCH` if the velocity selects no branch.
    """
    while True:
        least, where = factor_at(tb, w, w.q)
        if least >= 1e-10:
            break
        speed = 1e-300
        for i in range(w.v.shape[0]):
            speed = max(speed, abs(w.v[i]) / tb.program.unit[i])
        clear_series(w)
        count, found = locate(tb, w, run, t, 0.0, 1e-3 / speed, where)
        if count == 0:
            return 0, 0.0, np.inf, -1, NO_BRANCH
        count = exchange(tb, w, count)
        if count > 0:
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return count, found, np.inf, -1, DONE
    project(tb, w, run, t, w.q, w.v)
    ahead, where = next_singular(tb, w, run, w.v, -np.inf, np.inf)
    if where >= 0 and run.sign * ahead < 0.0:
        count, found = _singular_behind(tb, w, run, t, ahead, where)
        if count > 0:
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return count, found, np.inf, -1, DONE
        project(tb, w, run, t, w.q, w.v)
        ahead, where = np.inf, -1
    return 0, 0.0, ahead, where, DONE


def turned(tb: Equations, w: Work) -> float:
    """Largest angle by which two bodies (or a body and the ground) turn against each other from w.Z to w.qn."""
    most = 0.0
    least = 0.0
    curves = tb.program.curves
    for f in range(curves.sign.shape[0]):
        i = curves.place[f, 0]
        most = max(most, w.qn[i] - w.Z[i, 0])
        least = min(least, w.qn[i] - w.Z[i, 0])
    return most - least


def _singular_within(tb: Equations, w: Work, run: Run, h: float, low: float, high: float) -> tuple[float, int]:
    """Find the first singular position of the series within low < sign tau < high: (time, row).

    It is searched from several places inside the step. The row is -1 if there is none.
    """
    evaluate(w.Z, run.order, h, w.qn, w.vn)
    looks = int(np.ceil(turned(tb, w) / FAR))
    for k in range(1, looks):
        place = h * k / looks
        evaluate(w.Z, run.order, place, w.qn, w.vn)
        factor_at(tb, w, w.qn)
        spacing = abs(h) / looks
        first = max(-spacing, low - run.sign * place)
        tau, row = next_singular(tb, w, run, w.vn, first, min(spacing, high - run.sign * place))
        if row >= 0:
            return place + tau, row
    return np.inf, -1


def _land(tb: Equations, w: Work, run: Run, state: Array, h: float, close: float) -> tuple[float, int, float, int, int]:
    """End a step of at most |h|: (step, singular rows there, time to the next ones, their row, status).

    The state there is in w.qn, w.vn.

    A singular position ahead within `close` (0.7 of the last step) is landed on even when |h| is shorter: so close to
    it, round-off in the last coefficients and not the motion sets |h|.
    """
    t, ahead, row, sign = state[TIME], state[AHEAD], int(state[ROW]), run.sign
    base = w.base
    passed = 0.0  # up to there none is left to find
    for _ in range(40 + 4 * base.shape[0]):
        lowest = max(passed, 1e-3 * abs(h)) if state[SINGULAR] > 0.0 else passed
        near = max(1.3 * abs(h), close)
        guess, where = _singular_within(tb, w, run, h, lowest, near)
        evaluate(w.Z, run.order, h, w.qn, w.vn)
        first, least = project(tb, w, run, t + h, w.qn, w.vn)
        tau, after = next_singular(tb, w, run, w.vn, lowest - abs(h), np.inf)
        if where < 0 and after >= 0:
            guess = h + tau
            where = after
        if (where < 0 or sign * guess >= near) and row >= 0 and lowest < sign * ahead < near:
            guess = ahead
            where = row
        if where >= 0 and base[where] == 0 and lowest < sign * guess < near:
            reach = 0.5 * max(abs(h), abs(guess))
            count, found = locate(tb, w, run, t, guess, reach, where)
            if count > 0 and lowest < sign * found:
                if sign * found <= max(1.000001 * abs(h), close):
                    count = exchange(tb, w, count)
                    if count == 0:  # it was one of the chosen rows only: look again
                        continue
                    tau, after = next_singular(tb, w, run, w.vn, 0.0, np.inf)
                    return found, count, tau, after, DONE
                h = 0.6 * found
                evaluate(w.Z, run.order, h, w.qn, w.vn)
                first, least = project(tb, w, run, t + h, w.qn, w.vn)
                if first < 1e3 * run.tolerance + 1e-10:
                    return h, 0, found - h, where, DONE
                continue
            passed = 1.01 * abs(guess)  # none, or the one at the beginning of the step
            continue
        if first < 1e3 * run.tolerance + 1e-10 and least > 1e-12:
            return h, 0, tau, after, DONE
        h = 0.7 * h
    return h, 0, np.inf, -1, STEP_TOO_SMALL


def _defect(tb: Equations, w: Work, run: Run, t: float, h: float, singular: int) -> float:
    """Return the largest error of the series within the step h by the forces there, in units of the coordinates.

    Terms of a series do not show what is too small to be in them: tanh(100) is 1 to the last digit, but it is none
    of its neighbours'. The factor is that at the end of the step, with `singular` rows.
    """
    program = tb.program
    P, F, code, switches = w.P, w.F, program.code, program.switches
    n = w.q.shape[0]
    if tb.mass.light.shape[0] > 0:
        carry_responses(tb, singular, w)
    most = 0.0
    for look in range(LOOKS_WITHIN):
        place = h * (look + 1) / LOOKS_WITHIN
        evaluate(w.Z, run.order, place, w.dq, w.dv)
        variables(tb, w, w.dq)
        rates(tb, w, w.dv)
        ends = look == LOOKS_WITHIN - 1
        time_series(program.times, t + place, run.sign < 0.0 if ends else run.sign > 0.0, 1, w.TF)
        tape_order(program, P, w.R0, w.TF, w.pieces, 0)
        for s in range(w.pieces.shape[0]):
            r = switches.register[s]
            if margin(switches, s, w.pieces[s], w.R0[r, 0]) < -OUTSIDE * largest(w.R, r, run.order - 1, h):
                return np.inf
        for i in range(w.H0.shape[0]):
            w.H0[i, 0] = 0.0
        for c in range(code.checked.shape[0]):
            p = code.checked[c]
            r = code.push[p, 0]
            w.H0[code.push[p, 1], 0] += code.share[p] * (w.R0[r, 0] - horner(w.R, r, run.order - 1, place))
        for i in range(n):
            F[i] = w.H0[i, 0]
        curve_forces(program, P, w.H0, 0, F)
        accelerations(tb, F, w.u)
        times_gradients(tb, w.G, w.u, w.mu)
        for r in range(w.mu.shape[0]):
            if w.skip[r] != 0:
                w.mu[r] = 0.0
        for p in range(singular):
            w.border.nu[p] = 0.0
            for i in range(n):
                w.border.nu[p] += w.border.B[p, i] * w.u[i]
        constrained(tb, singular, w, w.mu, w.u, w.a)
        if tb.mass.light.shape[0] > 0:
            add_carried(tb, singular, w, w.mu, w.a)
        for i in range(n):
            off = abs(w.a[i]) * h * h / program.unit[i]
            most = max(most, off) if np.isfinite(off) else np.inf
    return most


class Output(NamedTuple):
    """What a run fills, and where it stands."""

    state: Array  # (6,) time, singular rows, time to the singular position ahead ..., see above
    times: Array  # (room + 1,) ends of the steps (s)
    coefficients: Array  # (room, order + 1, n) of their series
    singular: IntArray  # (room,) number of singular rows at the start of each
    made: IntArray  # (1,) number of steps


def integrate_series(tb: Equations, w: Work, run: Run, out: Output) -> int:
    """Integrate from (w.q, w.v) to run.end, or until the output is full.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        State and scratch arrays; call again with the same ones to go on.
    run : Run
        What holds for the whole run.
    out : Output
        Steps and their series, and the state of the run.

    Returns
    -------
    status : int
        Of `Status`; SINGULAR_START asks for `begin` (rare, so it stays in Python) before the next call.
    """
    state, T, C, singular = out.state, out.times, out.coefficients, out.singular
    sign, pieces, switches, order = run.sign, w.pieces, tb.program.switches, run.order
    t = state[TIME]
    status = DONE
    count = 0
    changes = 0
    out.made[0] = 0
    bound = 2.0 * order**2 * run.tolerance + ROUNDING
    if state[BEGUN] == 0.0:
        copy(w.q, w.qn)
        copy(w.v, w.vn)
        copy(w.base, w.skip)
        first, least = project(tb, w, run, t, w.q, w.v)
        if least < 1e-6 or not np.isfinite(first):
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return SINGULAR_START
        state[AHEAD], state[ROW] = next_singular(tb, w, run, w.v, 0.0, np.inf)
        state[BEGUN] = 1.0
    T[0] = t
    while status == DONE and sign * (run.end - t) > 0.0:
        if count >= singular.shape[0]:
            status = MOST_STEPS
            break
        rows = int(state[SINGULAR])
        expand(tb, w, run, t, rows)
        size = step_length(tb, w, run)
        if not size > 1e-14 * max(abs(t), abs(run.end - run.begin)):
            status = STEP_TOO_SMALL
            break
        goal = next_goal(run.breaks, t, run.end, sign)
        remains = sign * (goal - t)
        size = even_step(size, remains)
        h, where = leaves(tb.program, w.R, pieces, order - 1, sign * size)
        if where >= 0 and is_pole(switches, w.R, where, order - 1, h, size):
            status = NOT_FINITE
            break
        if h == 0.0:
            changes += 1
            other = next_piece(switches, where, pieces[where], w.R[switches.register[where], 0])
            if other == pieces[where] or changes > MOST_CHANGES:
                status = NOT_FINITE
                break
            pieces[where] = other
            continue
        close = min(0.7 * state[LAST_STEP], remains)
        rows_there, ahead, row, off = 0, np.inf, -1, np.inf
        for _ in range(60):
            limit = h
            if where >= 0:
                close = min(close, abs(h))
            h, rows_there, ahead, row, status = _land(tb, w, run, state, limit, close)
            if status != DONE:
                break
            if rows_there == 0:
                copy(w.base, w.skip)
            if h != limit:
                where = -1
            if tb.program.code.checked.shape[0] == 0:
                off = 0.0
                break
            off = _defect(tb, w, run, t, h, rows_there)
            if off < bound:
                break
            h *= SHORTER
            close = 0.0
            where = -1
        if status == DONE and not off < bound:
            status = STEP_TOO_SMALL
        if status != DONE:
            break
        for k in range(order + 1):
            for i in range(C.shape[2]):
                C[count, k, i] = w.Z[i, k]
        singular[count] = rows
        changes = 0
        if where >= 0:
            r = switches.register[where]
            other = next_piece(switches, where, pieces[where], horner(w.R, r, order - 1, h))
            if other == pieces[where]:
                status = NOT_FINITE
            else:
                pieces[where] = other
        t = goal if h == sign * remains else t + h
        count += 1
        T[count] = t
        copy(w.qn, w.q)
        copy(w.vn, w.v)
        state[TIME] = t
        state[SINGULAR] = rows_there
        state[AHEAD] = ahead
        state[LAST_STEP] = abs(h)
        state[ROW] = row
    for i in range(w.q.shape[0]):
        if not (np.isfinite(w.q[i]) and np.isfinite(w.v[i])):
            status = NOT_FINITE
    out.made[0] = count
    return status


FUNCTIONS = (step_length, turned, _singular_within, _land, _defect, integrate_series)
STARTERS = (clear_series, _singular_behind, begin)
NAMES = {
    "DONE": DONE, "STEP_TOO_SMALL": STEP_TOO_SMALL, "MOST_STEPS": MOST_STEPS, "NO_BRANCH": NO_BRANCH,
    "NOT_FINITE": NOT_FINITE, "SINGULAR_START": SINGULAR_START, "TIME": TIME, "SINGULAR": SINGULAR, "AHEAD": AHEAD,
    "BEGUN": BEGUN, "LAST_STEP": LAST_STEP, "ROW": ROW, "FAR": FAR, "MOST_CHANGES": MOST_CHANGES,
    "LOOKS_WITHIN": LOOKS_WITHIN, "ROUNDING": ROUNDING, "SHORTER": SHORTER,
}  # fmt: skip
