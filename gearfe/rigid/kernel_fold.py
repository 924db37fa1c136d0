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

#: Pivot of S relative to its diagonal below which a fold is looked for.
NEAR = 0.3
#: Pivot (square of a distance in rad) of other rows at the fold of one row below which they are tried together with it.
TOGETHER = 1e-6


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

    Returns the first position change relative to `length` (and 1 rad), and the least pivot ratio.
    """
    forms, vectors, plan, mass = tb.forms, tb.vectors, tb.plan, tb.mass
    time_series(tb.times, t, forward, 3, w.TF)
    first = 0.0
    for sweep in range(8):
        trigonometry(q, w.c, w.s)
        gradients(forms, vectors, q, w.c, w.s, w.G)
        least, _ = factorise(plan, mass, w.G, base, w.val, w.diag, 0.0)
        residuals(forms, vectors, q, w.c, w.s, w.TF[:, 0], w.mu)
        change = least_norm(forms, plan, mass, w.G, w.val, base, length, w.mu, w.F, q)
        if sweep == 0:
            first = change
        if change < 1e-9 or not np.isfinite(change):  # the next change would be its square
            break
    if first > 0.0:
        trigonometry(q, w.c, w.s)
        gradients(forms, vectors, q, w.c, w.s, w.G)
        least, _ = factorise(plan, mass, w.G, base, w.val, w.diag, 0.0)
    for _ in range(2):
        times_gradients(forms, w.G, v, w.mu)
        for r in range(w.mu.shape[0]):
            if forms.motion[r] >= 0:
                w.mu[r] -= w.TF[forms.motion[r], 1]
        least_norm(forms, plan, mass, w.G, w.val, base, length, w.mu, w.F, v)
    if change >= 1e-9 or not np.isfinite(change):
        first = np.inf
    return first, least


def regular_parts(forms, plan, mass, G, row, skip, val, work, z):
    """z := S^-1 S e_row over the rows that are not skipped: how they make up the gradient of `row`."""
    fill(work, 0.0)
    for side in range(2):
        b = 3 * forms.bodies[row, side]
        for k in range(3):
            work[b + k] += G[row, side, k] * mass[b + k]
    times_gradients(forms, G, work, z)
    for r in range(z.shape[0]):
        if skip[r] != 0:
            z[r] = 0.0
    solve(plan, val, z)


def row_square(forms, mass, G, r):
    """Square of the gradient of row r in the norm of the inverse masses."""
    total = 0.0
    for side in range(2):
        b = 3 * forms.bodies[r, side]
        for k in range(3):
            total += G[r, side, k] * G[r, side, k] * mass[b + k]
    return total


def next_fold(tb, q, v, base, sign, low, high, w):
    """First fold from here within low < sign tau < high, judged from all small pivots: (tau, row), row -1 for none.

    For each such row z = S^-1 e_row, p = G^T z. It stands on the gradients of all other rows, so only the part of
    B = dG^T/dt z across them moves it: what is left of B without all rows, and the part along p. Were the row's passing
    to remove p, most of that part would be along p.
    """
    forms, vectors, plan, mass, z = tb.forms, tb.vectors, tb.plan, tb.mass, w.rhs
    m = w.mu.shape[0]
    found = np.inf
    first = -1
    moving = False
    for row in range(m):
        if base[row] != 0 or NEAR * w.val[row] * w.diag[row] <= 1.0:
            continue
        if not moving:
            gradient_rates(forms, vectors, q, v, w.c, w.s, w.H)
            moving = True
        fill(w.mu, 0.0)
        w.mu[row] = 1.0
        solve(plan, w.val, w.mu)
        for r in range(m):
            z[r] = w.mu[r] / w.mu[row] if r != row else 1.0
        fill(w.F, 0.0)
        add_transposed(forms, w.G, z, 1.0, w.F)
        fill(w.u, 0.0)
        add_transposed(forms, w.H, z, 1.0, w.u)
        pp = 0.0
        pb = 0.0
        for i in range(w.u.shape[0]):
            pp += w.F[i] * w.F[i] * mass[i]
            pb += w.F[i] * w.u[i] * mass[i]
        if pp <= 0.0 or pb == 0.0:
            continue
        tau = -pp / pb
        if not (low < sign * tau < high and sign * tau < sign * found):
            continue
        for i in range(w.u.shape[0]):
            w.F[i] = w.u[i] * mass[i]
        times_gradients(forms, w.G, w.F, w.mu)
        for r in range(m):
            if base[r] != 0:  # redundant rows take no part
                w.mu[r] = 0.0
        solve(plan, w.val, w.mu)
        add_transposed(forms, w.G, w.mu, -1.0, w.u)
        rest = 0.0
        for i in range(w.u.shape[0]):
            rest += w.u[i] * w.u[i] * mass[i]
        if pb * pb > pp * rest:
            found = tau
            first = row
    return found, first


def fold_frame(tb, q, v, bound, w):
    """Z, B, the bordered system and p = G^T Z (in fold.P) of the rows with w.skip = 2, which are left out.

    Rows with pivots below `bound` join them. Returns their number (0 when the bordered system is singular, too).
    """
    forms, vectors, plan, mass, fold = tb.forms, tb.vectors, tb.plan, tb.mass, w.fold
    m = w.mu.shape[0]
    trigonometry(q, w.c, w.s)
    gradients(forms, vectors, q, w.c, w.s, w.G)
    gradient_rates(forms, vectors, q, v, w.c, w.s, w.H)
    factorise(plan, mass, w.G, w.skip, w.val, w.diag, bound)
    folds = 0
    for row in range(m):
        if w.skip[row] != 2:
            continue
        if folds == fold.drop.shape[0]:
            return 0
        p = folds
        fold.drop[p] = row
        folds += 1
        regular_parts(forms, plan, mass, w.G, row, w.skip, w.val, w.F, w.mu)
        for r in range(m):
            fold.Z[p, r] = -w.mu[r]
        fold.Z[p, row] = 1.0
        fill(fold.P[p], 0.0)
        add_transposed(forms, w.G, fold.Z[p], 1.0, fold.P[p])
        fill(fold.B[p], 0.0)
        add_transposed(forms, w.H, fold.Z[p], 1.0, fold.B[p])
        for i in range(w.F.shape[0]):
            w.F[i] = fold.B[p, i] * mass[i]
        times_gradients(forms, w.G, w.F, w.mu)
        for r in range(m):
            fold.E[p, r] = w.mu[r] if w.skip[r] == 0 else 0.0
            fold.Y[p, r] = fold.E[p, r]
        solve(plan, w.val, fold.Y[p])
    for p in range(folds):
        for k in range(p + 1):
            value = weighted(fold.B[p], fold.B[k], mass)
            for r in range(m):
                value -= fold.Y[p, r] * fold.E[k, r]
            fold.border[p, k] = value
            fold.border[k, p] = value
    return folds if border_share(fold, folds, mass) > 1e-8 else 0


def weighted(a, b, mass):
    """a . M^-1 b."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i] * mass[i]
    return total


def border_share(fold, folds, mass):
    """Least share of a direction B that neither the regular rows nor the other directions hold (pivots of L D L^T)."""
    L = fold.small
    least = 1.0
    for p in range(folds):
        for k in range(p + 1):
            L[p, k] = fold.border[p, k]
            for i in range(k):
                L[p, k] -= L[p, i] * L[k, i] * L[i, i]
            if k < p:
                L[p, k] /= L[k, k]
        plain = weighted(fold.B[p], fold.B[p], mass)
        share = L[p, p] / plain if plain > 0.0 else 0.0
        if not share > 1e-30:
            return 0.0
        least = min(least, share)
    return least


def fold_change(tb, folds, length, w, u):
    """u -= the smallest change that lowers [G_reg; B] u by (w.mu, fold.nu); returns its largest entry, in units of
    `length` and 1 rad."""
    forms, plan, mass, fold = tb.forms, tb.plan, tb.mass, w.fold
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    fold_solve(plan, w.val, fold, w.mu, folds)
    fill(w.F, 0.0)
    add_transposed(forms, w.G, w.mu, 1.0, w.F)
    biggest = 0.0
    for i in range(u.shape[0]):
        change = w.F[i]
        for p in range(folds):
            change += fold.B[p, i] * fold.nu[p]
        change *= mass[i]
        u[i] -= change
        biggest = max(biggest, abs(change) / (1.0 if i % 3 == 2 else length))
    return biggest


def fold_combination(fold, p, values):
    """z_p . values."""
    total = 0.0
    for r in range(values.shape[0]):
        total += fold.Z[p, r] * values[r]
    return total


FUNCTIONS = (
    evaluate,
    project,
    regular_parts,
    row_square,
    next_fold,
    fold_frame,
    weighted,
    border_share,
    fold_change,
    fold_combination,
)
NAMES = {"NEAR": NEAR, "TOGETHER": TOGETHER}
