"""The integration loop of the Taylor method: expand, choose the step, land, project; land on singular positions rather
than jump them.

Terms count in units of the length and 1 rad (`kernel_steps`). A series started at the distance d from a singular
position amplifies round-off by (h/d)^N beyond it, so a step never crosses one: it ends there, and the next one is
expanded there with the bordered equations of `kernel_series`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..typing import Array, IntArray
from .kernel_locate import exchange, locate
from .kernel_names import AHEAD, BEGUN, LAST_STEP, ROW, SINGULAR, TIME
from .kernel_rows import copy, fill
from .kernel_series import expand
from .kernel_singular import evaluate, factor_at, next_singular, project
from .kernel_steps import even_step, next_goal, series_step
from .steps import Status

if TYPE_CHECKING:
    from .kernel_steps import Run
    from .tables import Tables
    from .taylor import Work

DONE, STEP_TOO_SMALL, MOST_STEPS = int(Status.DONE), int(Status.STEP_TOO_SMALL), int(Status.MOST_STEPS)
NO_BRANCH, NOT_FINITE, SINGULAR_START = int(Status.NO_BRANCH), int(Status.NOT_FINITE), int(Status.SINGULAR_START)
#: Angle (rad) that bodies turn against each other between two looks for singular positions.
FAR = 0.5


def step_length(QS: Array, run: Run) -> float:
    """Longest step whose last two terms stay below the tolerance."""
    order = run.order
    last = 0.0
    before = 0.0
    both = 0.0
    for i in range(QS.shape[1]):
        both += abs(QS[order, i]) + abs(QS[order - 1, i])  # unlike a maximum, a sum keeps what is not a number
        unit = 1.0 if i % 3 == 2 else run.length
        last = max(last, abs(QS[order, i]) / unit)
        before = max(before, abs(QS[order - 1, i]) / unit)
    return series_step(last, before, run) if np.isfinite(both) else 0.0


def clear_series(w: Work, order: int) -> None:
    """Series that holds position and velocity only."""
    copy(w.q, w.QS[0])
    copy(w.v, w.QS[1])
    for j in range(2, order + 1):
        fill(w.QS[j], 0.0)


def singular_behind(tb: Tables, w: Work, run: Run, t: float, ahead: float, where: int) -> tuple[int, float]:
    """A start just past a singular position begins on it: (singular rows, time from the start to it)."""
    copy(w.base, w.skip)
    clear_series(w, run.order)
    expand(tb, w, run, t, 0)
    if abs(ahead) > step_length(w.QS, run):
        return 0, 0.0
    count, found = locate(tb, w, run, t, ahead, abs(ahead), where)
    if count > 0 and run.sign * found > 0.0:
        count = 0
    return count, found


def begin(tb: Tables, w: Work, run: Run, t: float) -> tuple[int, float, float, int, int]:
    """Consistent start beside a singular position: (singular rows, time shift, time to the one ahead, its row, status).

    The state is in w.q, w.v.
    """
    while True:
        least, where = factor_at(tb, w, w.q)
        if least >= 1e-10:
            break
        speed = 1e-300
        for i in range(w.v.shape[0]):
            speed = max(speed, abs(w.v[i]) / (1.0 if i % 3 == 2 else run.length))
        clear_series(w, run.order)
        count, found = locate(tb, w, run, t, 0.0, 1e-3 / speed, where)
        if count == 0:
            return 0, 0.0, np.inf, -1, NO_BRANCH
        count = exchange(tb, w, count)
        if count > 0:
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return count, found, np.inf, -1, DONE
    project(tb, w, run, t, w.q, w.v)
    ahead, where = next_singular(tb, w, run, w.q, w.v, -np.inf, np.inf)
    if where >= 0 and run.sign * ahead < 0.0:
        count, found = singular_behind(tb, w, run, t, ahead, where)
        if count > 0:
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return count, found, np.inf, -1, DONE
        project(tb, w, run, t, w.q, w.v)
        ahead, where = np.inf, -1
    return 0, 0.0, ahead, where, DONE


def turned(QS: Array, q: Array) -> float:
    """Largest angle by which two bodies (or a body and the ground) turned against each other in the series."""
    most = 0.0
    least = 0.0
    for i in range(2, q.shape[0], 3):
        most = max(most, q[i] - QS[0, i])
        least = min(least, q[i] - QS[0, i])
    return most - least


def singular_within(tb: Tables, w: Work, run: Run, h: float, low: float, high: float) -> tuple[float, int]:
    """First singular position of the series within low < sign tau < high, from looks inside the step: (time, row).

    The row is -1 where there is none.
    """
    evaluate(w.QS, run.order, h, w.qn, w.vn)
    looks = int(np.ceil(turned(w.QS, w.qn) / FAR))
    for k in range(1, looks):
        place = h * k / looks
        evaluate(w.QS, run.order, place, w.qn, w.vn)
        factor_at(tb, w, w.qn)
        spacing = abs(h) / looks
        first = max(-spacing, low - run.sign * place)
        tau, row = next_singular(tb, w, run, w.qn, w.vn, first, min(spacing, high - run.sign * place))
        if row >= 0:
            return place + tau, row
    return np.inf, -1


def land(tb: Tables, w: Work, run: Run, state: Array, h: float, close: float) -> tuple[float, int, float, int, int]:
    """End of a step of at most |h|: (step, singular rows there, time to the next ones, their row, status).

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
        guess, where = singular_within(tb, w, run, h, lowest, near)
        evaluate(w.QS, run.order, h, w.qn, w.vn)
        first, least = project(tb, w, run, t + h, w.qn, w.vn)
        tau, after = next_singular(tb, w, run, w.qn, w.vn, lowest - abs(h), np.inf)
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
                    tau, after = next_singular(tb, w, run, w.qn, w.vn, 0.0, np.inf)
                    return found, count, tau, after, DONE
                h = 0.6 * found
                evaluate(w.QS, run.order, h, w.qn, w.vn)
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


class Output(NamedTuple):
    """What a run fills, and where it stands."""

    state: Array  # (6,) time, singular rows, time to the singular position ahead ..., see `kernel_names`
    times: Array  # (room + 1,) ends of the steps (s)
    coefficients: Array  # (room, order + 1, 3n) of their series, without the ground's
    singular: IntArray  # (room,) number of singular rows at the start of each
    made: IntArray  # (1,) number of steps


def integrate_series(tb: Tables, w: Work, run: Run, out: Output) -> int:
    """Integrate from (w.q, w.v) to run.end, or until the output is full; call again with the same state to go on.

    Returns the status. SINGULAR_START asks for `begin` (rare, so it stays in Python) before the next call.
    """
    state, T, C, singular = out.state, out.times, out.coefficients, out.singular
    sign = run.sign
    t = state[TIME]
    status = DONE
    count = 0
    out.made[0] = 0
    if state[BEGUN] == 0.0:
        copy(w.q, w.qn)
        copy(w.v, w.vn)
        copy(w.base, w.skip)
        first, least = project(tb, w, run, t, w.q, w.v)
        if least < 1e-6 or not np.isfinite(first):
            copy(w.qn, w.q)
            copy(w.vn, w.v)
            return SINGULAR_START
        state[AHEAD], state[ROW] = next_singular(tb, w, run, w.q, w.v, 0.0, np.inf)
        state[BEGUN] = 1.0
    T[0] = t
    while status == DONE and sign * (run.end - t) > 0.0:
        if count >= singular.shape[0]:
            status = MOST_STEPS
            break
        rows = int(state[SINGULAR])
        copy(w.q, w.QS[0])
        copy(w.v, w.QS[1])
        expand(tb, w, run, t, rows)
        size = min(step_length(w.QS, run), run.longest)
        if not size > 1e-14 * max(abs(t), abs(run.end - run.begin)):
            status = STEP_TOO_SMALL
            break
        goal = next_goal(run.breaks, t, run.end, sign)
        remains = sign * (goal - t)
        size = even_step(size, remains)
        h, rows_there, ahead, row, status = land(tb, w, run, state, sign * size, min(0.7 * state[LAST_STEP], remains))
        if status != DONE:
            break
        for j in range(run.order + 1):
            for i in range(C.shape[2]):
                C[count, j, i] = w.QS[j, i]
        singular[count] = rows
        if rows_there == 0:
            copy(w.base, w.skip)
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


class Samples(NamedTuple):
    """Where the pieces of a run are asked for, and what is found."""

    ends: Array  # (pieces + 1,) of the steps (s)
    coefficients: Array  # (pieces, orders, c)
    sign: float  # of time
    times: Array  # (t,) in order of travel (s)
    derivative: int
    out: Array  # (t, c) coordinates, or that derivative of them


def sample(samples: Samples) -> int:
    """Coordinates or a derivative of them from the pieces of `integrate_series`; returns 0."""
    T, C, sign, times, derivative, out = (
        samples.ends, samples.coefficients, samples.sign, samples.times, samples.derivative, samples.out,
    )  # fmt: skip
    piece = 0
    last = C.shape[0] - 1
    for i in range(times.shape[0]):
        while piece < last and sign * (times[i] - T[piece + 1]) > 0.0:
            piece += 1
        while piece > 0 and sign * (times[i] - T[piece]) < 0.0:
            piece -= 1
        h = times[i] - T[piece]
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        for j in range(C.shape[1] - 1, derivative - 1, -1):
            factor = 1.0
            for d in range(derivative):
                factor *= j - d
            for c in range(out.shape[1]):
                out[i, c] = out[i, c] * h + factor * C[piece, j, c]
    return 0


FUNCTIONS = (sample, step_length, turned, singular_within, land, integrate_series)
STARTERS = (clear_series, singular_behind, begin)
NAMES = {
    "DONE": DONE,
    "STEP_TOO_SMALL": STEP_TOO_SMALL,
    "MOST_STEPS": MOST_STEPS,
    "NO_BRANCH": NO_BRANCH,
    "NOT_FINITE": NOT_FINITE,
    "SINGULAR_START": SINGULAR_START,
    "FAR": FAR,
}
