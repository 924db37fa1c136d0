# mypy: ignore-errors
"""Finding a passing singular position: the rows that pass together, its moment, the state there.

The conditions are in `kernel_fold`. All rows that pass at the same moment take part, however many loops fold at once.
"""

from __future__ import annotations

import numpy as np

from .kernel_fold import (
    TOGETHER,
    evaluate,
    fold_change,
    fold_combination,
    fold_frame,
    regular_parts,
    row_square,
    weighted,
)
from .kernel_rows import add_transposed, copy, fill, residuals, time_series, times_gradients
from .kernel_series import small_solve

#: Pivot of another row at the fold of one row below which it passes with it (eps^(2/3): at the distance d between two
#: folds, rounding leaves eps / d^2 of the velocities, more than taking both for one does).
SAME = 4e-11


def moved_state(QS, order, h, w, q, v):
    """State of the series at h with the corrections w.dq, w.dv."""
    evaluate(QS, order, h, q, v)
    for i in range(q.shape[0]):
        q[i] += w.dq[i]
        v[i] += w.dv[i]


def time_to_fold(fold, p, mass):
    """Time from here to the moment at which P_p vanishes along B_p."""
    return -weighted(fold.P[p], fold.B[p], mass) / fold.border[p, p]


def locate_fold(tb, t, forward, QS, order, guess, reach, base, where, length, w, q, v):
    """Time (from the point of expansion) and state of the fold near `guess`; folds = 0 when there is none.

    Newton on: regular rows of g = 0, z^T G v = 0, and time such that B . G^T z = 0. It is a true crossing when z^T g
    vanishes there too; a near miss (rod a little longer than the crank) leaves a residual and is integrated as usual.
    All rows that pass at the same moment take part: those with pivots below `TOGETHER` near the fold of the first one,
    less those that keep a gradient where the others have none.
    """
    folds, h = meet(tb, QS, order, guess, reach, base, where, w, q, v)
    for _ in range(folds):
        folds, h = converge(tb, t, forward, QS, order, h, guess, reach, length, w, q, v)
        if folds == 0 or not split_folds(tb, folds, where, w):
            break
    if folds == 0 or not passes(tb, folds, w, q):
        return 0, h
    return folds, h


def meet(tb, QS, order, guess, reach, base, where, w, q, v):
    """Number of rows (w.skip = 2) that pass about when the row `where` does, and its time along the series."""
    h = guess
    for _ in range(30):
        copy(base, w.skip)
        w.skip[where] = 2
        evaluate(QS, order, h, q, v)
        folds = fold_frame(tb, q, v, TOGETHER, w)
        move = np.inf
        for p in range(folds):
            if w.fold.drop[p] == where:
                move = time_to_fold(w.fold, p, tb.mass)
        if not abs(h + move - guess) <= reach:
            return 0, h
        if abs(move) < 1e-4 * reach:
            left = 0
            for p in range(folds):
                if abs(time_to_fold(w.fold, p, tb.mass) - move) > 0.5 * reach:
                    w.skip[w.fold.drop[p]] = 0
                else:
                    left += 1
            return left, h + move
        h += move
    return 0, h


def converge(tb, t, forward, QS, order, h, guess, reach, length, w, q, v):
    """Newton of `locate_fold` from the time h for the rows with w.skip = 2."""
    forms, vectors, mass, fold = tb.forms, tb.vectors, tb.mass, w.fold
    n = q.shape[0]
    fill(w.dq, 0.0)
    fill(w.dv, 0.0)
    for _ in range(30):
        moved_state(QS, order, h, w, q, v)
        folds = fold_frame(tb, q, v, 0.0, w)
        if folds == 0:
            return 0, h
        move = 0.0
        for p in range(folds):
            move += time_to_fold(fold, p, mass) / folds
        # position: g_reg and z^T (G v - df/dt)
        time_series(tb.times, t + h, forward, 3, w.TF)
        times_gradients(forms, w.G, v, w.mu)
        add_rates(forms, w.TF, 1, -1.0, w.mu)
        for p in range(folds):
            fold.nu[p] = fold_combination(fold, p, w.mu)
        residuals(forms, vectors, q, w.c, w.s, w.TF[:, 0], w.mu)
        copy(q, w.work)
        change = fold_change(tb, folds, length, w, q)
        for i in range(n):
            w.dq[i] += q[i] - w.work[i]
        # velocity: G_reg v - df/dt and half of z^T g'' (linear in v along B)
        times_gradients(forms, w.H, v, w.mu)
        add_rates(forms, w.TF, 2, -2.0, w.mu)
        for p in range(folds):
            fold.nu[p] = 0.5 * fold_combination(fold, p, w.mu)
        times_gradients(forms, w.G, v, w.mu)
        add_rates(forms, w.TF, 1, -1.0, w.mu)
        copy(v, w.work)
        fold_change(tb, folds, length, w, v)
        for i in range(n):
            w.dv[i] += v[i] - w.work[i]
        h += move
        if abs(h - guess) > reach or not np.isfinite(h) or not np.isfinite(change):
            return 0, h
        if abs(move) < 1e-10 * reach and change < 1e-10:  # the next change would be its square
            moved_state(QS, order, h, w, q, v)
            return fold_frame(tb, q, v, 0.0, w), h
    return 0, h


def add_rates(forms, TF, order, factor, out):
    """out += factor times the coefficient `order` of every row's time function."""
    for r in range(out.shape[0]):
        if forms.motion[r] >= 0:
            out[r] += factor * TF[forms.motion[r], order]


def split_folds(tb, folds, where, w):
    """Whether some rows pass at another moment than the row `where`; then those that pass with it (w.skip = 2) are
    left."""
    forms, mass, fold = tb.forms, tb.mass, w.fold
    worst = 0.0
    own = 0.0
    for p in range(folds):
        size = row_square(forms, mass, w.G, fold.drop[p])
        worst = max(worst, weighted(fold.P[p], fold.P[p], mass) / size)
        fold.nu[p] = time_to_fold(fold, p, mass)
        if fold.drop[p] == where:
            own = fold.nu[p]
    if worst < SAME:
        return False
    far = 0.0
    for p in range(folds):
        far = max(far, abs(fold.nu[p] - own))
    kept = 0
    for p in range(folds):
        if abs(fold.nu[p] - own) > 0.5 * far:
            w.skip[fold.drop[p]] = 0
        else:
            kept += 1
    return kept < folds


def exchange(tb, base, folds, w, q, v):
    """Number of folds that are left when every redundant row that has a gradient of its own here takes the place of a
    row that lost its.

    Which row of a dependent set may be left out changes along the motion: without the x-row of one of three parallel
    cranks, what is left loses rank where that crank's end moves along x, though the mechanism is regular there.
    """
    forms, plan, mass, fold = tb.forms, tb.plan, tb.mass, w.fold
    for row in range(base.shape[0]):
        if base[row] == 0 or folds == 0:
            continue
        regular_parts(forms, plan, mass, w.G, row, w.skip, w.val, w.F, w.mu)
        for r in range(w.mu.shape[0]):
            w.mu[r] = -w.mu[r]
        w.mu[row] = 1.0
        fill(w.F, 0.0)
        add_transposed(forms, w.G, w.mu, 1.0, w.F)
        if weighted(w.F, w.F, mass) < TOGETHER * row_square(forms, mass, w.G, row):
            continue
        for p in range(folds):
            fold.nu[p] = weighted(fold.B[p], w.F, mass)
        small_solve(fold.border, folds, fold.nu, fold.small)
        most = 0
        for p in range(1, folds):
            if fold.nu[p] ** 2 * fold.border[p, p] > fold.nu[most] ** 2 * fold.border[most, most]:
                most = p
        base[row] = 0
        base[fold.drop[most]] = 1
        w.skip[row] = 0
        w.skip[fold.drop[most]] = 1
        folds = fold_frame(tb, q, v, 0.0, w)
    return folds


def passes(tb, folds, w, q):
    """Whether z^T g vanishes, so that two branches cross, for all folds."""
    forms, vectors, fold = tb.forms, tb.vectors, w.fold
    residuals(forms, vectors, q, w.c, w.s, w.TF[:, 0], w.mu)
    for p in range(folds):
        scale = 0.0
        for r in range(w.mu.shape[0]):
            scale = max(scale, abs(fold.Z[p, r]) * tb.forms.unit[r])
        if abs(fold_combination(fold, p, w.mu)) > 1e-10 * scale:
            return False
    return True


FUNCTIONS = (
    moved_state,
    time_to_fold,
    locate_fold,
    meet,
    converge,
    add_rates,
    split_folds,
    exchange,
    passes,
)
NAMES = {"SAME": SAME}
