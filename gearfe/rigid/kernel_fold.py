# mypy: ignore-errors
"""Projection onto the constraints, and passing singular positions: where they are, and the state on them.

At a passing singular position (fold) a combination z^T g of the constraints loses its gradient, G^T z = 0,
while the motion
carries it through zero: B = d(G^T z)/dt != 0. Two branches cross there. The motion continues on the one its velocity
selects: z^T G v = 0 holds the position to it, z^T g'' = 0 its velocity, and both are linear in the direction B.
"""

from __future__ import annotations

import numpy as np

from .kernel_rows import (
    add_transposed,
    copy,
    factorise,
    fill,
    gradient_rates,
    gradients,
    least_norm,
    residuals,
    solve,
    time_series,
    times_gradients,
    trigonometry,
)
from .kernel_series import fold_solve


def evaluate(QS, order, h, q, v):
    """State of the series at t0 + h."""
    for i in range(q.shape[0]):
        q[i] = QS[order, i]
        v[i] = 0.0
    for j in range(order - 1, -1, -1):
        for i in range(q.shape[0]):
            v[i] = v[i] * h + q[i]
            q[i] = q[i] * h + QS[j, i]


def project(tb, t, forward, q, v, base, length, w):
    """Onto g = 0 and G v = df/dt by the smallest change in the mass norm; w.G, w.val, w.diag belong to the new point.

    Returns the first position change relative to `length` (and 1 rad), the least pivot ratio and its row.
    """
    rows, plan, mass = tb.rows, tb.plan, tb.mass
    time_series(tb.times, t, forward, 3, w.TF)
    first = 0.0
    for sweep in range(8):
        trigonometry(q, w.c, w.s)
        gradients(rows, q, w.c, w.s, w.G)
        least, where = factorise(rows, plan, mass, w.G, base, w.val, w.diag)
        residuals(rows, q, w.c, w.s, w.TF[:, 0], w.mu)
        change = least_norm(rows, plan, mass, w.G, w.val, base, w.mu, w.F, q)
        change = change / min(length, 1.0)
        if sweep == 0:
            first = change
        if change < 1e-9 or not np.isfinite(change):  # the next change would be its square
            break
    if first > 0.0:
        trigonometry(q, w.c, w.s)
        gradients(rows, q, w.c, w.s, w.G)
        least, where = factorise(rows, plan, mass, w.G, base, w.val, w.diag)
    for _ in range(2):
        times_gradients(rows, w.G, v, w.mu)
        for r in range(w.mu.shape[0]):
            if rows.ints[r, 3] >= 0:
                w.mu[r] -= w.TF[rows.ints[r, 3], 1]
        least_norm(rows, plan, mass, w.G, w.val, base, w.mu, w.F, v)
    if change >= 1e-9 or not np.isfinite(change):
        first = np.inf
    return first, least, where


def fold_ahead(tb, q, v, base, where, w):
    """Time from here to the nearest fold, judged from z = S^-1 e_where: (time, share of G^T z that its passing
    removes).

    p = G^T z stands on the gradients of all other rows, so only the part of B = dG^T/dt z across them moves it: what is
    left of B without all rows, and the part along p.
    """
    rows, plan, mass, fold = tb.rows, tb.plan, tb.mass, w.fold
    m = rows.ints.shape[0]
    fill(w.mu, 0.0)
    w.mu[where] = 1.0
    solve(plan, w.val, w.mu)
    for r in range(m):
        fold.Z[0, r] = w.mu[r] / w.mu[where] if r != where else 1.0
    gradient_rates(rows, q, v, w.c, w.s, w.H)
    fill(w.F, 0.0)
    add_transposed(rows, w.G, fold.Z[0], 1.0, w.F)
    fill(w.u, 0.0)
    add_transposed(rows, w.H, fold.Z[0], 1.0, w.u)
    pp = 0.0
    pb = 0.0
    for i in range(w.u.shape[0]):
        pp += w.F[i] * w.F[i] * mass[i]
        pb += w.F[i] * w.u[i] * mass[i]
    if pp <= 0.0 or pb == 0.0:
        return np.inf, 0.0
    for i in range(w.u.shape[0]):
        w.F[i] = w.u[i] * mass[i]
    times_gradients(rows, w.G, w.F, w.mu)
    for r in range(m):
        if base[r] != 0:  # redundant rows take no part
            w.mu[r] = 0.0
    solve(plan, w.val, w.mu)
    add_transposed(rows, w.G, w.mu, -1.0, w.u)
    rest = 0.0
    for i in range(w.u.shape[0]):
        rest += w.u[i] * w.u[i] * mass[i]
    along = pb * pb / pp
    return -pp / pb, along / (along + rest)


def fold_frame(tb, q, v, folds, w):
    """At a state with the rows fold.drop[:folds] left out: Z, B, the bordered system and p = G^T Z (in fold.P)."""
    rows, plan, mass, fold = tb.rows, tb.plan, tb.mass, w.fold
    m = rows.ints.shape[0]
    trigonometry(q, w.c, w.s)
    gradients(rows, q, w.c, w.s, w.G)
    gradient_rates(rows, q, v, w.c, w.s, w.H)
    least, where = factorise(rows, plan, mass, w.G, w.skip, w.val, w.diag)
    for p in range(folds):  # z = e_drop - S_reg^-1 (S e_drop)
        row = fold.drop[p]
        fill(w.mu, 0.0)
        w.mu[row] = 1.0
        fill(w.F, 0.0)
        add_transposed(rows, w.G, w.mu, 1.0, w.F)
        for i in range(w.F.shape[0]):
            w.F[i] *= mass[i]
        times_gradients(rows, w.G, w.F, w.mu)
        for r in range(m):
            if w.skip[r] != 0:
                w.mu[r] = 0.0
        solve(plan, w.val, w.mu)
        for r in range(m):
            fold.Z[p, r] = -w.mu[r]
        fold.Z[p, row] = 1.0
        fill(fold.P[p], 0.0)
        add_transposed(rows, w.G, fold.Z[p], 1.0, fold.P[p])
        fill(fold.B[p], 0.0)
        add_transposed(rows, w.H, fold.Z[p], 1.0, fold.B[p])
    for p in range(folds):
        for i in range(w.F.shape[0]):
            w.F[i] = fold.B[p, i] * mass[i]
        times_gradients(rows, w.G, w.F, w.mu)
        for r in range(m):
            fold.E[p, r] = w.mu[r] if w.skip[r] == 0 else 0.0
            fold.Y[p, r] = fold.E[p, r]
        solve(plan, w.val, fold.Y[p])
    share = 1.0
    for p in range(folds):
        for k in range(folds):
            plain = 0.0
            for i in range(w.F.shape[0]):
                plain += fold.B[p, i] * fold.B[k, i] * mass[i]
            value = plain
            for r in range(m):
                value -= fold.Y[p, r] * fold.E[k, r]
            fold.border[p, k] = value
            if p == k:
                share = min(share, value / plain if plain > 0.0 else 0.0)
    return share, least, where


def fold_change(tb, folds, w, u):
    """u -= the smallest change that lowers [G_reg; B] u by (w.mu, fold.nu); returns its largest entry."""
    rows, plan, mass, fold = tb.rows, tb.plan, tb.mass, w.fold
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    fold_solve(plan, w.val, fold, w.mu, folds)
    fill(w.F, 0.0)
    add_transposed(rows, w.G, w.mu, 1.0, w.F)
    biggest = 0.0
    for i in range(u.shape[0]):
        change = w.F[i]
        for p in range(folds):
            change += fold.B[p, i] * fold.nu[p]
        change *= mass[i]
        u[i] -= change
        biggest = max(biggest, abs(change))
    return biggest


def fold_combination(fold, p, values):
    """z_p . values."""
    total = 0.0
    for r in range(values.shape[0]):
        total += fold.Z[p, r] * values[r]
    return total


def locate_fold(tb, t, forward, QS, order, guess, reach, base, where, length, small, w, q, v):
    """Time (from the point of expansion) and state of the fold near `guess`; folds = 0 when there is none.

    Newton on: regular rows of g = 0, z^T G v = 0, and time such that B . G^T z = 0. It is a true crossing when z^T g
    vanishes there too (rows with pivots below `small` count as passing at the same moment); a near miss (rod a
    little longer than the crank) leaves a residual and is integrated as usual.
    """
    rows, mass, fold = tb.rows, tb.mass, w.fold
    m = rows.ints.shape[0]
    n = q.shape[0]
    folds = 1
    fold.drop[0] = where
    for r in range(m):
        w.skip[r] = base[r]
    w.skip[where] = 1
    fill(w.dq, 0.0)
    fill(w.dv, 0.0)
    h = guess
    quality = np.inf
    near = 0
    for _ in range(25):
        evaluate(QS, order, h, q, v)
        for i in range(n):
            q[i] += w.dq[i]
            v[i] += w.dv[i]
        share, least, row = fold_frame(tb, q, v, folds, w)
        if share < 1e-8 or not np.isfinite(share):
            return 0, h
        time_series(tb.times, t + h, forward, 3, w.TF)
        move = 0.0
        weight = 0.0
        scale = 0.0
        for p in range(folds):
            for i in range(n):
                move -= fold.P[p, i] * fold.B[p, i] * mass[i]
            weight += fold.border[p, p]
        move = move / weight
        if near == 0:  # first the time alone: corrections made away from the fold would push along the motion
            h += move
            if abs(h - guess) > reach or not np.isfinite(h):
                return 0, h
            if abs(move) < 1e-7 * reach:
                near = 1
                if least < small and folds < fold.drop.shape[0]:  # another row passes at the same moment
                    fold.drop[folds] = row
                    w.skip[row] = 1
                    folds += 1
                    near = 0
            continue
        # position: g_reg and z^T (G v - df/dt)
        times_gradients(rows, w.G, v, w.mu)
        for r in range(m):
            if rows.ints[r, 3] >= 0:
                w.mu[r] -= w.TF[rows.ints[r, 3], 1]
        for p in range(folds):
            fold.nu[p] = fold_combination(fold, p, w.mu)
        residuals(rows, q, w.c, w.s, w.TF[:, 0], w.mu)
        quality = 0.0
        for p in range(folds):
            quality = max(quality, abs(fold_combination(fold, p, w.mu)))
            for r in range(m):
                scale = max(scale, abs(fold.Z[p, r]))
        copy(q, w.work)
        change = fold_change(tb, folds, w, q)
        for i in range(n):
            w.dq[i] += q[i] - w.work[i]
        # velocity: G_reg v - df/dt and half of z^T g'' (linear in v along B)
        times_gradients(rows, w.H, v, w.mu)
        for r in range(m):
            if rows.ints[r, 3] >= 0:
                w.mu[r] -= 2.0 * w.TF[rows.ints[r, 3], 2]
        for p in range(folds):
            fold.nu[p] = 0.5 * fold_combination(fold, p, w.mu)
        times_gradients(rows, w.G, v, w.mu)
        for r in range(m):
            if rows.ints[r, 3] >= 0:
                w.mu[r] -= w.TF[rows.ints[r, 3], 1]
        copy(v, w.work)
        fold_change(tb, folds, w, v)
        for i in range(n):
            w.dv[i] += v[i] - w.work[i]
        h += move
        if abs(h - guess) > reach or not np.isfinite(h) or not np.isfinite(change):
            return 0, h
        if abs(move) < 1e-10 * reach and change < 1e-10 * min(length, 1.0):  # the next change would be its square
            if quality > 1e-10 * max(length, 1.0) * max(scale, 1.0):
                return 0, h
            evaluate(QS, order, h, q, v)
            for i in range(n):
                q[i] += w.dq[i]
                v[i] += w.dv[i]
            share, least, row = fold_frame(tb, q, v, folds, w)
            return folds, h
    return 0, h


FUNCTIONS = (
    evaluate,
    project,
    fold_ahead,
    fold_frame,
    fold_change,
    fold_combination,
    locate_fold,
)
