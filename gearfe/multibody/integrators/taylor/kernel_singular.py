"""Projection onto the constraints, and passing singular positions: where they are, and the state on them.

At a passing singular position a combination z^T g of the constraints loses its gradient, G^T z = 0, while the motion
carries it through zero: B = d(G^T z)/dt != 0. Two branches cross there. The motion continues on the one its velocity
selects: z^T G v = 0 holds the position to it, z^T g'' = 0 its velocity, and both are linear in the direction B.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....typing import Array
from ...series.recurrences import (
    accelerations,
    add_transposed,
    border_solve,
    factorise,
    fill,
    gradient_rates,
    gradients,
    inner,
    residuals,
    solve,
    time_series,
    times_gradients,
)

if TYPE_CHECKING:
    from ...series.row_tables import Equations
    from ...series.work_space import Border, Run, Work

#: Pivot of S relative to its diagonal below which a singular position is looked for.
NEAR = 0.3
#: Pivot (square of a distance in rad) of other rows at the singular position of one row below which they are tried
#: together with it.
TOGETHER = 1e-6


def evaluate(Z: Array, order: int, h: float, q: Array, v: Array) -> None:
    """Write the state of a series at t0 + h.

    Parameters
    ----------
    Z : ndarray, shape (variables, orders)
        Series of the variables, coordinates first.
    order : int
        Highest order that counts.
    h : float
        Time from the expansion (s).
    q, v : ndarray, shape (n,)
        Coordinates and velocities; written.
    """
    for i in range(q.shape[0]):
        value = Z[i, order]
        rate = 0.0
        for j in range(order - 1, -1, -1):
            rate = rate * h + value
            value = value * h + Z[i, j]
        q[i] = value
        v[i] = rate


def factor_at(tb: Equations, w: Work, q: Array) -> tuple[float, int]:
    """w.G, w.val, w.diag at the coordinates q; the least pivot ratio and its row."""
    gradients(tb, w, q)
    return factorise(tb, w, w.base, 0.0)


def project(tb: Equations, w: Work, run: Run, t: float, q: Array, v: Array) -> tuple[float, float]:
    """Move a state onto g = 0 and G v = df/dt by the smallest change in the mass norm.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Scratch arrays; ``w.G``, ``w.val``, ``w.diag`` then belong to the new state.
    run : Run
        What holds for the whole run.
    t : float
        Time (s).
    q, v : ndarray, shape (n,)
        Coordinates and velocities; changed.

    Returns
    -------
    first : float
        First change of the coordinates in their units; infinite if the projection does not converge.
    least : float
        Least pivot ratio.
    """
    rows = tb.program.rows
    time_series(tb.program.times, t, run.sign > 0.0, 3, w.TF)
    first = 0.0
    for sweep in range(8):
        least, _ = factor_at(tb, w, q)
        residuals(tb, w, w.mu)
        change = least_change(tb, w, q)
        if sweep == 0:
            first = change
        if change < 1e-9 or not np.isfinite(change):  # the next change would be its square
            break
    if first > 0.0:
        least, _ = factor_at(tb, w, q)
    for _ in range(2):
        times_gradients(tb, w.G, v, w.mu)
        for r in range(w.mu.shape[0]):
            if rows.motion[r] >= 0:
                w.mu[r] -= w.TF[rows.motion[r], 1]
        faster = least_change(tb, w, v)
    if change >= 1e-9 or not np.isfinite(change + faster):
        first = np.inf
    return first, least


def least_change(tb: Equations, w: Work, x: Array) -> float:
    """x -= M^-1 G^T S^-1 w.mu: the smallest change (in the mass norm) that lowers G x by w.mu. Returns its largest
    entry, in units of the coordinates; infinity where it is no number."""
    for r in range(w.mu.shape[0]):
        if w.base[r] != 0:
            w.mu[r] = 0.0
    solve(tb, w.val, w.mu)
    fill(w.F, 0.0)
    add_transposed(tb, w.G, w.mu, 1.0, w.F)
    biggest = 0.0
    total = 0.0
    accelerations(tb, w.F, w.u)
    for i in range(x.shape[0]):
        x[i] -= w.u[i]
        total += abs(w.u[i])  # unlike a maximum, a sum keeps what is not a number
        biggest = max(biggest, abs(w.u[i]) / tb.program.unit[i])
    return biggest if np.isfinite(total) else np.inf


def regular_parts(tb: Equations, w: Work, row: int) -> None:
    """w.mu := S^-1 S e_row over the rows that are not skipped: how they make up the gradient of `row`."""
    row_gradient(tb, w, row)
    accelerations(tb, w.u, w.F)
    times_gradients(tb, w.G, w.F, w.mu)
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    solve(tb, w.val, w.mu)


def row_gradient(tb: Equations, w: Work, r: int) -> None:
    """w.u := the gradient of row r."""
    fill(w.u, 0.0)
    for e in range(tb.gradient.first[r], tb.gradient.first[r + 1]):
        w.u[tb.gradient.column[e]] = w.G[e]


def row_square(tb: Equations, w: Work, r: int) -> float:
    """Square of the gradient of row r in the norm of the inverse masses; it is in w.u."""
    row_gradient(tb, w, r)
    return inner(tb, w.u, w.u)


def next_singular(tb: Equations, w: Work, run: Run, v: Array, low: float, high: float) -> tuple[float, int]:
    """Estimate the first singular position from here within low < sign tau < high.

    It is judged from all small pivots. For each such row z = S^-1 e_row, p = G^T z. It stands on the gradients of all
    other rows, so only the part of B = dG^T/dt z across them moves it: what is left of B without all rows, and the part
    along p. Were the row's passing to remove p, most of that part would be along p.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Gradients and factor at the state.
    run : Run
        What holds for the whole run.
    v : ndarray, shape (n,)
        Velocities there.
    low, high : float
        Bounds of the time in the direction of travel (s).

    Returns
    -------
    tau : float
        Time from here (s); infinite for none.
    row : int
        Row that passes, -1 for none.
    """
    z, sign = w.rhs, run.sign
    m = w.mu.shape[0]
    found = np.inf
    first = -1
    moving = False
    for row in range(m):
        if w.base[row] != 0 or NEAR * w.val[row] * w.diag[row] <= 1.0:
            continue
        if not moving:
            gradient_rates(tb, w, v)
            moving = True
        fill(w.mu, 0.0)
        w.mu[row] = 1.0
        solve(tb, w.val, w.mu)
        for r in range(m):
            z[r] = w.mu[r] / w.mu[row] if r != row else 1.0
        fill(w.F, 0.0)
        add_transposed(tb, w.G, z, 1.0, w.F)
        fill(w.u, 0.0)
        add_transposed(tb, w.dG, z, 1.0, w.u)
        pp = inner(tb, w.F, w.F)
        pb = inner(tb, w.F, w.u)
        if pp <= 0.0 or pb == 0.0:
            continue
        tau = -pp / pb
        if not (low < sign * tau < high and sign * tau < sign * found):
            continue
        accelerations(tb, w.u, w.F)
        times_gradients(tb, w.G, w.F, w.mu)
        for r in range(m):
            if w.base[r] != 0:  # redundant rows take no part
                w.mu[r] = 0.0
        solve(tb, w.val, w.mu)
        add_transposed(tb, w.G, w.mu, -1.0, w.u)
        if pb * pb > pp * inner(tb, w.u, w.u):
            found = tau
            first = row
    return found, first


def singular_frame(tb: Equations, w: Work, q: Array, v: Array, bound: float) -> int:
    """Set up the bordered system of the singular rows: Z, B and p = G^T Z in w.border.

    The rows with w.skip = 2 are left out of the factor, and rows with pivots below `bound` join them.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Scratch arrays; gradients, factor and border change.
    q, v : ndarray, shape (n,)
        Coordinates and velocities.
    bound : float
        Pivot ratio below which a row joins.

    Returns
    -------
    count : int
        Number of singular rows; 0 if the bordered system is singular, too.
    """
    border = w.border
    m = w.mu.shape[0]
    gradients(tb, w, q)
    gradient_rates(tb, w, v)
    factorise(tb, w, w.skip, bound)
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
        add_transposed(tb, w.G, border.Z[p], 1.0, border.P[p])
        fill(border.B[p], 0.0)
        add_transposed(tb, w.dG, border.Z[p], 1.0, border.B[p])
        accelerations(tb, border.B[p], w.F)
        times_gradients(tb, w.G, w.F, w.mu)
        for r in range(m):
            border.E[p, r] = w.mu[r] if w.skip[r] == 0 else 0.0
            border.Y[p, r] = border.E[p, r]
        solve(tb, w.val, border.Y[p])
    for p in range(count):
        for k in range(p + 1):
            value = inner(tb, border.B[p], border.B[k])
            for r in range(m):
                value -= border.Y[p, r] * border.E[k, r]
            border.schur[p, k] = value
            border.schur[k, p] = value
    return count if border_share(tb, border, count) > 1e-8 else 0


def border_share(tb: Equations, border: Border, count: int) -> float:
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
        plain = inner(tb, border.B[p], border.B[p])
        share = L[p, p] / plain if plain > 0.0 else 0.0
        if not share > 1e-30:
            return 0.0
        least = min(least, share)
    return least


def border_change(tb: Equations, w: Work, count: int, x: Array) -> float:
    """Lower [G_reg; B] x by (w.mu, border.nu) with the smallest change of x in the mass norm.

    Parameters
    ----------
    tb : Equations
        The system.
    w : Work
        Factor, border and right-hand sides; changed.
    count : int
        Number of singular rows.
    x : ndarray, shape (n,)
        Coordinates or velocities; changed.

    Returns
    -------
    largest : float
        Largest entry of the change, in units of the coordinates.
    """
    border = w.border
    for r in range(w.mu.shape[0]):
        if w.skip[r] != 0:
            w.mu[r] = 0.0
    border_solve(tb, w.val, border, w.mu, count)
    fill(w.F, 0.0)
    add_transposed(tb, w.G, w.mu, 1.0, w.F)
    for p in range(count):
        for i in range(x.shape[0]):
            w.F[i] += border.B[p, i] * border.nu[p]
    accelerations(tb, w.F, w.u)
    biggest = 0.0
    for i in range(x.shape[0]):
        x[i] -= w.u[i]
        biggest = max(biggest, abs(w.u[i]) / tb.program.unit[i])
    return biggest


def combination(border: Border, p: int, values: Array) -> float:
    """z_p . values."""
    total = 0.0
    for r in range(values.shape[0]):
        total += border.Z[p, r] * values[r]
    return total


FUNCTIONS = (
    evaluate, factor_at, project, least_change, regular_parts, row_gradient, row_square, next_singular, singular_frame,
    border_share, border_change, combination,
)  # fmt: skip
NAMES = {"NEAR": NEAR, "TOGETHER": TOGETHER}
