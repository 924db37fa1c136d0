# mypy: ignore-errors
"""The integration loop of the Taylor method: expand, choose the step, land, project; land on folds rather than
jump them.

Step length from the last two coefficients (Jorba & Zou, Exp. Math. 14 (2005) 99): |q_N| h^N <= tolerance in units of
`length` and 1 rad. A series started at the distance d from a fold amplifies round-off by (h/d)^N beyond it, so
a step never
crosses a fold: it ends there, and the next one is expanded there with the bordered equations of `kernel_series`.
"""

from __future__ import annotations

import numpy as np

from .kernel_fold import evaluate, next_fold, project
from .kernel_locate import exchange, locate_fold
from .kernel_rows import copy, factorise, fill, gradients, trigonometry
from .kernel_series import expand
from .status import Status

DONE, TOO_SMALL, FULL = int(Status.DONE), int(Status.STEP_TOO_SMALL), int(Status.MOST_STEPS)
SINGULAR, NOT_FINITE, AT_FOLD = int(Status.NO_BRANCH), int(Status.NOT_FINITE), int(Status.SINGULAR_START)
#: Angle (rad) that bodies turn against each other between two looks for folds.
FAR = 0.5


def step_length(QS, order, tolerance, length):
    """Longest step whose last two terms stay below the tolerance."""
    last = 0.0
    before = 0.0
    both = 0.0
    for i in range(QS.shape[1]):
        both += abs(QS[order, i]) + abs(QS[order - 1, i])  # unlike a maximum, a sum keeps what is not a number
        unit = 1.0 if i % 3 == 2 else length
        last = max(last, abs(QS[order, i]) / unit)
        before = max(before, abs(QS[order - 1, i]) / unit)
    step = np.inf
    if last > 0.0:
        step = min(step, (tolerance / last) ** (1.0 / order))
    if before > 0.0:
        step = min(step, (tolerance / before) ** (1.0 / (order - 1)))
    if not np.isfinite(both):
        step = 0.0
    return step


def clear_series(w, q, v, order):
    """Series that holds position and velocity only."""
    copy(q, w.QS[0])
    copy(v, w.QS[1])
    for j in range(2, order + 1):
        fill(w.QS[j], 0.0)


def fold_behind(tb, t, sign, q, v, order, tolerance, length, base, where, ahead, none, w, qn, vn):
    """A start just past a fold begins on the fold: (folds, time from the start to it)."""
    forward = sign > 0.0
    copy(base, w.skip)
    clear_series(w, q, v, order)
    expand(tb, t, forward, order, none, w)
    step = step_length(w.QS, order, tolerance, length)
    if abs(ahead) > step:
        return 0, 0.0
    folds, found = locate_fold(tb, t, forward, w.QS, order, ahead, abs(ahead), base, where, length, w, qn, vn)
    if folds > 0 and sign * found > 0.0:
        folds = 0
    return folds, found


def begin(tb, t, sign, q, v, order, tolerance, length, base, none, w, qn, vn):
    """Consistent start beside a fold: (folds, time shift, time to the fold ahead, its row, status); state in q, v."""
    forward = sign > 0.0
    while True:
        trigonometry(q, w.c, w.s)
        gradients(tb.forms, tb.vectors, q, w.c, w.s, w.G)
        least, where = factorise(tb.plan, tb.mass, w.G, base, w.val, w.diag, 0.0)
        if least >= 1e-10:
            break
        speed = 1e-300
        for i in range(v.shape[0]):
            speed = max(speed, abs(v[i]) / (1.0 if i % 3 == 2 else length))
        clear_series(w, q, v, order)
        folds, found = locate_fold(tb, t, forward, w.QS, order, 0.0, 1e-3 / speed, base, where, length, w, qn, vn)
        if folds == 0:
            return 0, 0.0, np.inf, -1, SINGULAR
        folds = exchange(tb, base, folds, w, qn, vn)
        if folds > 0:
            copy(qn, q)
            copy(vn, v)
            return folds, found, np.inf, -1, DONE
    project(tb, t, forward, q, v, base, length, w)
    ahead, where = next_fold(tb, q, v, base, sign, -np.inf, np.inf, w)
    if where >= 0 and sign * ahead < 0.0:
        folds, found = fold_behind(tb, t, sign, q, v, order, tolerance, length, base, where, ahead, none, w, qn, vn)
        if folds > 0:
            copy(qn, q)
            copy(vn, v)
            return folds, found, np.inf, -1, DONE
        project(tb, t, forward, q, v, base, length, w)
        ahead, where = np.inf, -1
    return 0, 0.0, ahead, where, DONE


def turned(QS, q):
    """Largest angle by which two bodies (or a body and the ground) turned against each other in the series."""
    most = 0.0
    least = 0.0
    for i in range(2, q.shape[0], 3):
        most = max(most, q[i] - QS[0, i])
        least = min(least, q[i] - QS[0, i])
    return most - least


def fold_within(tb, sign, h, order, base, low, high, w, q, v):
    """First fold of the series within low < sign tau < high, from looks inside the step: (time, row), row -1 for
    none."""
    evaluate(w.QS, order, h, q, v)
    looks = int(np.ceil(turned(w.QS, q) / FAR))
    for k in range(1, looks):
        place = h * k / looks
        evaluate(w.QS, order, place, q, v)
        trigonometry(q, w.c, w.s)
        gradients(tb.forms, tb.vectors, q, w.c, w.s, w.G)
        factorise(tb.plan, tb.mass, w.G, base, w.val, w.diag, 0.0)
        spacing = abs(h) / looks
        tau, row = next_fold(
            tb, q, v, base, sign, max(-spacing, low - sign * place), min(spacing, high - sign * place), w
        )
        if row >= 0:
            return place + tau, row
    return np.inf, -1


def land(tb, t, sign, h, order, tolerance, length, base, folds, ahead, row, close, w, qn, vn):
    """End of a step of at most |h|: (step, folds there, time to the next fold, its row, status); state in qn, vn.

    A fold ahead within `close` (0.7 of the last step) is landed on even when |h| is shorter: so close to it,
    round-off in
    the last coefficients and not the motion sets |h|.
    """
    forward = sign > 0.0
    passed = 0.0  # up to there no fold is left to find
    for _ in range(40 + 4 * base.shape[0]):
        lowest = max(passed, 1e-3 * abs(h)) if folds > 0 else passed
        near = max(1.3 * abs(h), close)
        guess, where = fold_within(tb, sign, h, order, base, lowest, near, w, qn, vn)
        evaluate(w.QS, order, h, qn, vn)
        first, least = project(tb, t + h, forward, qn, vn, base, length, w)
        tau, after = next_fold(tb, qn, vn, base, sign, lowest - abs(h), np.inf, w)
        if where < 0 and after >= 0:
            guess = h + tau
            where = after
        if (where < 0 or sign * guess >= near) and row >= 0 and lowest < sign * ahead < near:
            guess = ahead
            where = row
        if where >= 0 and base[where] == 0 and lowest < sign * guess < near:
            reach = 0.5 * max(abs(h), abs(guess))
            found_folds, found = locate_fold(tb, t, forward, w.QS, order, guess, reach, base, where, length, w, qn, vn)
            if found_folds > 0 and lowest < sign * found:
                if sign * found <= max(1.000001 * abs(h), close):
                    found_folds = exchange(tb, base, found_folds, w, qn, vn)
                    if found_folds == 0:  # it was one of the chosen rows only: look again
                        continue
                    tau, after = next_fold(tb, qn, vn, w.skip, sign, 0.0, np.inf, w)
                    return found, found_folds, tau, after, DONE
                h = 0.6 * found
                evaluate(w.QS, order, h, qn, vn)
                first, least = project(tb, t + h, forward, qn, vn, base, length, w)
                if first < 1e3 * tolerance + 1e-10:
                    return h, 0, found - h, where, DONE
                continue
            passed = 1.01 * abs(guess)  # no fold, or the one at the beginning of the step
            continue
        if first < 1e3 * tolerance + 1e-10 and least > 1e-12:
            return h, 0, tau, after, DONE
        h = 0.7 * h
    return h, 0, np.inf, -1, TOO_SMALL


def integrate_series(tb, w, t0, t1, q, v, order, tolerance, length, base, breaks, longest, state, T, C, kind):
    """Integrate from (q, v) to t1, or until the arrays are full; call again with the same arguments to go on.

    `state` holds (time, folds, time to the fold ahead, 1 once begun, last step, row of the fold ahead); T (room + 1,)
    receives step ends, C (room, order + 1, 3n) coefficients without the ground's, kind (room,) the number of folds at
    the start of each.

    Returns status, number of steps. AT_FOLD asks for `begin` (rare, so it stays in Python) before the next call.
    """
    sign = 1.0 if t1 >= t0 else -1.0
    forward = sign > 0.0
    t = state[0]
    folds = int(state[1])
    ahead = state[2]
    last = state[4]
    row = int(state[5])
    status = DONE
    count = 0
    if state[3] == 0.0:
        copy(q, w.qn)
        copy(v, w.vn)
        copy(base, w.skip)
        first, least = project(tb, t, forward, q, v, base, length, w)
        if least < 1e-6 or not np.isfinite(first):
            copy(w.qn, q)
            copy(w.vn, v)
            return AT_FOLD, 0
        ahead, row = next_fold(tb, q, v, base, sign, 0.0, np.inf, w)
        state[3] = 1.0
    T[0] = t
    edge = 0 if forward else breaks.shape[0] - 1
    while status == DONE and sign * (t1 - t) > 0.0:
        if count >= kind.shape[0]:
            status = FULL
            break
        copy(q, w.QS[0])
        copy(v, w.QS[1])
        expand(tb, t, forward, order, folds, w)
        size = min(step_length(w.QS, order, tolerance, length), longest)
        if not size > 1e-14 * max(abs(t), abs(t1 - t0)):
            status = TOO_SMALL
            break
        while 0 <= edge < breaks.shape[0] and sign * (breaks[edge] - t) <= 1e-13 * abs(t):
            edge += 1 if forward else -1
        goal = t1
        if 0 <= edge < breaks.shape[0] and sign * (t1 - breaks[edge]) > 0.0:
            goal = breaks[edge]
        remains = sign * (goal - t)
        if size >= remains:
            size = remains
        elif size > 0.5 * remains:
            size = 0.5 * remains
        h, next_folds, next_ahead, next_row, status = land(
            tb,
            t,
            sign,
            sign * size,
            order,
            tolerance,
            length,
            base,
            folds,
            ahead,
            row,
            min(0.7 * last, remains),
            w,
            w.qn,
            w.vn,
        )
        if status != DONE:
            break
        for j in range(order + 1):
            for i in range(C.shape[2]):
                C[count, j, i] = w.QS[j, i]
        kind[count] = folds
        if next_folds == 0:
            copy(base, w.skip)
        t = goal if h == sign * remains else t + h
        count += 1
        T[count] = t
        copy(w.qn, q)
        copy(w.vn, v)
        folds = next_folds
        ahead = next_ahead
        row = next_row
        last = abs(h)
    for i in range(q.shape[0]):
        if not (np.isfinite(q[i]) and np.isfinite(v[i])):
            status = NOT_FINITE
    state[0] = t
    state[1] = folds
    state[2] = ahead
    state[4] = last
    state[5] = row
    return status, count


def sample(T, C, sign, times, derivative, out):
    """Coordinates or a derivative of them at `times` (in order of travel) from the pieces of `integrate_series`."""
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


FUNCTIONS = (sample, step_length, turned, fold_within, land, integrate_series)
STARTERS = (clear_series, fold_behind, begin)
NAMES = {
    "DONE": DONE,
    "TOO_SMALL": TOO_SMALL,
    "FULL": FULL,
    "SINGULAR": SINGULAR,
    "NOT_FINITE": NOT_FINITE,
    "AT_FOLD": AT_FOLD,
    "FAR": FAR,
}
