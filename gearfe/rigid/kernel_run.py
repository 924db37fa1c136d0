"""The integration loop of the Taylor method: expand, choose the step, land, project; land on folds rather than jump them.

Step length from the last two coefficients (Jorba & Zou, Exp. Math. 14 (2005) 99): |q_N| h^N <= tolerance in units of
`length` and 1 rad. A series started at the distance d from a fold amplifies round-off by (h/d)^N beyond it, so a step never
crosses a fold: it ends there, and the next one is expanded there with the bordered equations of `kernel_series`.
"""

from __future__ import annotations

import numpy as np

DONE, TOO_SMALL, TOO_MANY, SINGULAR, NOT_FINITE = 0, 1, 2, 3, 4
#: Pivot of S relative to its diagonal below which a fold is looked for.
NEAR = 0.3


def step_length(QS, order, tolerance, length):
    """Longest step whose last two terms stay below the tolerance."""
    last = 0.0
    before = 0.0
    for i in range(QS.shape[1]):
        unit = 1.0 if i % 3 == 2 else length
        last = max(last, abs(QS[order, i]) / unit)
        before = max(before, abs(QS[order - 1, i]) / unit)
    step = np.inf
    if last > 0.0:
        step = min(step, (tolerance / last) ** (1.0 / order))
    if before > 0.0:
        step = min(step, (tolerance / before) ** (1.0 / (order - 1)))
    if not (np.isfinite(last) and np.isfinite(before)):
        step = 0.0
    return step


def clear_series(w, q, v, order):
    """Series that holds position and velocity only."""
    w.QS[0, :] = q
    w.QS[1, :] = v
    for j in range(2, order + 1):
        w.QS[j, :] = 0.0


def fold_behind(tb, t, sign, q, v, order, tolerance, length, base, where, ahead, w, qn, vn):
    """A start just past a fold begins on the fold: (folds, time from the start to it)."""
    forward = sign > 0.0
    w.skip[:] = base
    clear_series(w, q, v, order)
    expand(tb, t, forward, order, 0, w)  # noqa: F821
    step = step_length(w.QS, order, tolerance, length)
    if abs(ahead) > step:
        return 0, 0.0
    folds, found = locate_fold(  # noqa: F821
        tb, t, forward, w.QS, order, ahead, abs(ahead), base, where, length, w, qn, vn
    )
    if folds > 0 and sign * found > 0.0:
        folds = 0
    return folds, found


def begin(tb, t, sign, q, v, order, tolerance, length, base, w, qn, vn):
    """Consistent start: (folds, time shift, time to the fold ahead, status); the state is in q, v."""
    forward = sign > 0.0
    qn[:] = q
    vn[:] = v
    w.skip[:] = base
    first, least, where = project(tb, t, forward, qn, vn, base, length, w)  # noqa: F821
    if where < 0 or (least > NEAR and np.isfinite(first)):
        q[:] = qn
        v[:] = vn
        return 0, 0.0, np.inf, DONE
    trigonometry(q, w.c, w.s)  # noqa: F821
    gradients(tb, q, w.c, w.s, w.G)  # noqa: F821
    least, where = factorise(tb, w.G, base, w.val, w.diag)  # noqa: F821
    ahead, share = fold_ahead(tb, q, v, where, w)  # noqa: F821
    if least < 1e-10:
        speed = 1e-300
        for i in range(v.shape[0]):
            speed = max(speed, abs(v[i]) / (1.0 if i % 3 == 2 else length))
        clear_series(w, q, v, order)
        folds, found = locate_fold(  # noqa: F821
            tb, t, forward, w.QS, order, 0.0, 1e-3 / speed, base, where, length, w, qn, vn
        )
        if folds == 0:
            return 0, 0.0, np.inf, SINGULAR
        q[:] = qn
        v[:] = vn
        return folds, found, np.inf, DONE
    first, least, where = project(tb, t, forward, q, v, base, length, w)  # noqa: F821
    ahead, share = fold_ahead(tb, q, v, where, w)  # noqa: F821
    if share < 0.5:
        ahead = np.inf
    if sign * ahead < 0.0:
        folds, found = fold_behind(tb, t, sign, q, v, order, tolerance, length, base, where, ahead, w, qn, vn)
        if folds > 0:
            q[:] = qn
            v[:] = vn
            return folds, found, np.inf, DONE
        project(tb, t, forward, q, v, base, length, w)  # noqa: F821
    return 0, 0.0, ahead, DONE


def land(tb, t, sign, h, order, tolerance, length, base, folds, ahead, w, qn, vn):
    """End of a step of at most |h|: (step, folds there, time to the next fold, status); the state is in qn, vn."""
    forward = sign > 0.0
    for _ in range(40):
        evaluate(w.QS, order, h, qn, vn)  # noqa: F821
        first, least, where = project(tb, t + h, forward, qn, vn, base, length, w)  # noqa: F821
        guess = np.inf
        tau = np.inf
        if where >= 0 and least < NEAR:
            tau, share = fold_ahead(tb, qn, vn, where, w)  # noqa: F821
            if share > 0.5:
                guess = h + tau
            else:
                tau = np.inf
        if 0.0 < sign * ahead < 1.3 * abs(h):
            guess = ahead
        lowest = 0.05 * abs(h) if folds > 0 else 0.0
        if lowest < sign * guess < 1.3 * abs(h):
            reach = 0.5 * abs(h)
            found_folds, found = locate_fold(  # noqa: F821
                tb, t, forward, w.QS, order, guess, reach, base, where, length, w, qn, vn
            )
            if found_folds > 0 and lowest < sign * found:
                if sign * found <= 1.000001 * abs(h):
                    return found, found_folds, np.inf, DONE
                h = 0.6 * found
                evaluate(w.QS, order, h, qn, vn)  # noqa: F821
                w.skip[:] = base
                first, least, where = project(tb, t + h, forward, qn, vn, base, length, w)  # noqa: F821
                if first < 1e3 * tolerance + 1e-10:
                    return h, 0, found - h, DONE
            evaluate(w.QS, order, h, qn, vn)  # noqa: F821
            w.skip[:] = base
            first, least, where = project(tb, t + h, forward, qn, vn, base, length, w)  # noqa: F821
        if first < 1e3 * tolerance + 1e-10 and (where < 0 or least > 1e-12):
            return h, 0, tau, DONE
        h = 0.7 * h
    return h, 0, np.inf, TOO_SMALL


def integrate_series(tb, w, t0, t1, q, v, order, tolerance, length, base, breaks, longest, most):
    """Integrate from (q, v) at t0 to t1.

    Returns status, number of steps, step ends T (steps + 1,), coefficients C (steps, order + 1, n), folds at the start of
    every step (steps,).
    """
    n = q.shape[0]
    room = 64
    T = np.empty(room + 1)
    C = np.empty((room, order + 1, n))
    kind = np.zeros(room, dtype=np.int64)
    qn = np.empty(n)
    vn = np.empty(n)
    sign = 1.0 if t1 >= t0 else -1.0
    forward = sign > 0.0
    t = t0
    count = 0
    folds, shift, ahead, status = begin(tb, t, sign, q, v, order, tolerance, length, base, w, qn, vn)
    t += shift
    T[0] = t
    edge = 0 if forward else breaks.shape[0] - 1
    while status == DONE and sign * (t1 - t) > 0.0:
        if count >= most:
            status = TOO_MANY
            break
        w.QS[0, :] = q
        w.QS[1, :] = v
        expand(tb, t, forward, order, folds, w)  # noqa: F821
        size = min(step_length(w.QS, order, tolerance, length), longest)
        if not size > 1e-14 * max(abs(t), abs(t1 - t0)):
            status = TOO_SMALL
            break
        while 0 <= edge < breaks.shape[0] and sign * (breaks[edge] - t) <= 1e-13 * (1.0 + abs(t)):
            edge += 1 if forward else -1
        goal = t1
        if 0 <= edge < breaks.shape[0] and sign * (t1 - breaks[edge]) > 0.0:
            goal = breaks[edge]
        remains = sign * (goal - t)
        if size >= remains:
            size = remains
        elif size > 0.5 * remains:
            size = 0.5 * remains
        h, next_folds, next_ahead, status = land(
            tb, t, sign, sign * size, order, tolerance, length, base, folds, ahead, w, qn, vn
        )
        if status != DONE:
            break
        if count == room:
            T2 = np.empty(2 * room + 1)
            C2 = np.empty((2 * room, order + 1, n))
            kind2 = np.zeros(2 * room, dtype=np.int64)
            T2[: room + 1] = T
            C2[:room] = C
            kind2[:room] = kind
            T, C, kind = T2, C2, kind2
            room *= 2
        C[count] = w.QS[: order + 1]
        kind[count] = folds
        if next_folds == 0:
            w.skip[:] = base
        t = goal if h == sign * remains else t + h
        count += 1
        T[count] = t
        q[:] = qn
        v[:] = vn
        folds = next_folds
        ahead = next_ahead
    for i in range(n):
        if not (np.isfinite(q[i]) and np.isfinite(v[i])):
            status = NOT_FINITE
    return status, count, T[: count + 1], C[:count], kind[:count]


FUNCTIONS = (step_length, clear_series, fold_behind, begin, land, integrate_series)
NAMES = {
    "DONE": DONE,
    "TOO_SMALL": TOO_SMALL,
    "TOO_MANY": TOO_MANY,
    "SINGULAR": SINGULAR,
    "NOT_FINITE": NOT_FINITE,
    "NEAR": NEAR,
}
