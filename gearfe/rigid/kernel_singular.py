"""Projection onto the constraints, and passing singular positions: where they are, and the state on them.

At a passing singular position a combination z^T g of the constraints loses its gradient, G^T z = 0, while the motion
carries it through zero: B = d(G^T z)/dt != 0. Two branches cross there. The motion continues on the one its velocity
selects: z^T G v = 0 holds the position to it, z^T g'' = 0 its velocity, and both are linear in the direction B.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..typing import Array
from .kernel_rows import (
    add_transposed,
    factorise,
    fill,
    gradient_rates,
    gradients,
    residuals,
    solve,
    time_series,
    times_gradients,
    trigonometry,
)
from .kernel_series import border_solve

if TYPE_CHECKING:
    from .kernel_steps import Run
    from .tables import Forms, Tables
    from .taylor import Border, Work

#: Pivot of S relative to its diagonal below which a singular position is looked for.
NEAR = 0.3
#: Pivot (square of a distance in rad) of other rows at the singular position of one row below which they are tried
#: together with it.
TOGETHER = 1e-6


def evaluate(QS: Array, order: int, h: float, q: Array, v: Array) -> None:
    """State of the series at t0 + h."""
    for i in range(q.shape[0]):
        q[i] = QS[order, i]
        v[i] = 0.0
    for j in range(order - 1, -1, -1):
        for i in range(q.shape[0]):
            v[i] = v[i] * h + q[i]
            q[i] = q[i] * h + QS[j, i]


def factor_at(tb: Tables, w: Work, q: Array) -> tuple[float, int]:
    """w.G, w.val, w.diag at the coordinates q; the least pivot ratio and its row."""
    trigonometry(q, w.c, w.s)
    gradients(tb.forms, tb.vectors, q, w.c, w.s, w.G)
    return factorise(tb.plan, tb.mass, w.G, w.base, w.val, w.diag, 0.0)


def project(tb: Tables, w: Work, run: Run, t: float, q: Array, v: Array) -> tuple[float, float]:
    """Onto g = 0 and G v = df/dt by the smallest change in the mass norm; w.G, w.val, w.diag belong to the new point.

    Returns the first position change relative to the length (and 1 rad), and the least pivot ratio.
    """
    forms = tb.forms
    time_series(tb.times, t, run.sign > 0.0, 3, w.TF)
    first = 0.0
    for sweep in range(8):
        least, _ = factor_at(tb, w, q)
        residuals(forms, tb.vectors, q, w.c, w.s, w.TF[:, 0], w.mu)
        change = least_change(tb, w, run, q)
        if sweep == 0:
            first = change
        if change < 1e-9 or not np.isfinite(change):  # the next change would be its square
            break
    if first > 0.0:
        least, _ = factor_at(tb, w, q)
    for _ in range(2):
        times_gradients(forms, w.G, v, w.mu)
        for r in range(w.mu.shape[0]):
            if forms.motion[r] >= 0:
                w.mu[r] -= w.TF[forms.motion[r], 1]
        faster = least_change(tb, w, run, v)
    if change >= 1e-9 or not np.isfinite(change + faster):
        first = np.inf
    return first, least


def least_change(tb: Tables, w: Work, run: Run, u: Array) -> float:
    """u -= M^-1 G^T S^-1 w.mu: the smallest change (in the mass norm) that lowers G u by w.mu. Returns its largest
    entry, in units of the length and 1 rad; infinity where it is no number."""
    for r in range(w.mu.shape[0]):
        if w.base[r] != 0:
            w.mu[r] = 0.0
    solve(tb.plan, w.val, w.mu)
    fill(w.F, 0.0)
    add_transposed(tb.forms, w.G, w.mu, 1.0, w.F)
    biggest = 0.0
    total = 0.0
    for i in range(u.shape[0]):
        change = w.F[i] * tb.mass[i]
        u[i] -= change
        total += abs(change)  # unlike a maximum, a sum keeps what is not a number
        biggest = max(biggest, abs(change) / (1.0 if i % 3 == 2 else run.length))
    return biggest if np.isfinite(total) else np.inf


def regular_parts(tb: Tables, w: Work, row: int) -> None:
    """w.mu := S^-1 S e_row over the rows that are not skipped: how they make up the gradient of `row`."""
    fill(w.F, 0.0)
    for side in range(2):
        b = 3 * tb.forms.bodies[row, side]
        for k in range(3):
            w.F[b + k] += w.G[row, side, k] * tb.mass[b + k]
    times_gradients(tb.forms, w.G, w.F, w.mu)
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    solve(tb.plan, w.val, w.mu)


def row_square(forms: Forms, mass: Array, G: Array, r: int) -> float:
    """Square of the gradient of row r in the norm of the inverse masses."""
    total = 0.0
    for side in range(2):
        b = 3 * forms.bodies[r, side]
        for k in range(3):
            total += G[r, side, k] * G[r, side, k] * mass[b + k]
    return total


def next_singular(tb: Tables, w: Work, run: Run, q: Array, v: Array, low: float, high: float) -> tuple[float, int]:
    """First singular position from here within low < sign tau < high, judged from all small pivots: (tau, row).

    The row is -1 where there is none.

    For each such row z = S^-1 e_row, p = G^T z. It stands on the gradients of all other rows, so only the part of
    B = dG^T/dt z across them moves it: what is left of B without all rows, and the part along p. Were the row's passing
    to remove p, most of that part would be along p.
    """
    forms, vectors, plan, mass, z, sign = tb.forms, tb.vectors, tb.plan, tb.mass, w.rhs, run.sign
    m = w.mu.shape[0]
    found = np.inf
    first = -1
    moving = False
    for row in range(m):
        if w.base[row] != 0 or NEAR * w.val[row] * w.diag[row] <= 1.0:
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
            if w.base[r] != 0:  # redundant rows take no part
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


def singular_frame(tb: Tables, w: Work, q: Array, v: Array, bound: float) -> int:
    """Z, B, the bordered system and p = G^T Z (in border.P) of the rows with w.skip = 2, which are left out.

    Rows with pivots below `bound` join them. Returns their number (0 when the bordered system is singular, too).
    """
    forms, vectors, plan, mass, border = tb.forms, tb.vectors, tb.plan, tb.mass, w.border
    m = w.mu.shape[0]
    trigonometry(q, w.c, w.s)
    gradients(forms, vectors, q, w.c, w.s, w.G)
    gradient_rates(forms, vectors, q, v, w.c, w.s, w.H)
    factorise(plan, mass, w.G, w.skip, w.val, w.diag, bound)
    count = 0
    for row in range(m):
        if w.skip[row] != 2:
            continue
        if count == border.drop.shape[0]:
            return 0
        p = count
        border.drop[p] = row
        count += 1
        regular_parts(tb, w, row)
        for r in range(m):
            border.Z[p, r] = -w.mu[r]
        border.Z[p, row] = 1.0
        fill(border.P[p], 0.0)
        add_transposed(forms, w.G, border.Z[p], 1.0, border.P[p])
        fill(border.B[p], 0.0)
        add_transposed(forms, w.H, border.Z[p], 1.0, border.B[p])
        for i in range(w.F.shape[0]):
            w.F[i] = border.B[p, i] * mass[i]
        times_gradients(forms, w.G, w.F, w.mu)
        for r in range(m):
            border.E[p, r] = w.mu[r] if w.skip[r] == 0 else 0.0
            border.Y[p, r] = border.E[p, r]
        solve(plan, w.val, border.Y[p])
    for p in range(count):
        for k in range(p + 1):
            value = weighted(border.B[p], border.B[k], mass)
            for r in range(m):
                value -= border.Y[p, r] * border.E[k, r]
            border.schur[p, k] = value
            border.schur[k, p] = value
    return count if border_share(border, count, mass) > 1e-8 else 0


def weighted(a: Array, b: Array, mass: Array) -> float:
    """a . M^-1 b."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i] * mass[i]
    return total


def border_share(border: Border, count: int, mass: Array) -> float:
    """Least share of a direction B that neither the regular rows nor the other directions hold (pivots of L D L^T)."""
    L = border.small
    least = 1.0
    for p in range(count):
        for k in range(p + 1):
            L[p, k] = border.schur[p, k]
            for i in range(k):
                L[p, k] -= L[p, i] * L[k, i] * L[i, i]
            if k < p:
                L[p, k] /= L[k, k]
        plain = weighted(border.B[p], border.B[p], mass)
        share = L[p, p] / plain if plain > 0.0 else 0.0
        if not share > 1e-30:
            return 0.0
        least = min(least, share)
    return least


def border_change(tb: Tables, w: Work, run: Run, count: int, u: Array) -> float:
    """u -= the smallest change that lowers [G_reg; B] u by (w.mu, border.nu); returns its largest entry, in units of
    the length and 1 rad."""
    forms, plan, mass, border = tb.forms, tb.plan, tb.mass, w.border
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    border_solve(plan, w.val, border, w.mu, count)
    fill(w.F, 0.0)
    add_transposed(forms, w.G, w.mu, 1.0, w.F)
    biggest = 0.0
    for i in range(u.shape[0]):
        change = w.F[i]
        for p in range(count):
            change += border.B[p, i] * border.nu[p]
        change *= mass[i]
        u[i] -= change
        biggest = max(biggest, abs(change) / (1.0 if i % 3 == 2 else run.length))
    return biggest


def combination(border: Border, p: int, values: Array) -> float:
    """z_p . values."""
    total = 0.0
    for r in range(values.shape[0]):
        total += border.Z[p, r] * values[r]
    return total


FUNCTIONS = (
    evaluate,
    factor_at,
    project,
    least_change,
    regular_parts,
    row_square,
    next_singular,
    singular_frame,
    weighted,
    border_share,
    border_change,
    combination,
)
NAMES = {"NEAR": NEAR, "TOGETHER": TOGETHER}
