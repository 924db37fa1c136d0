"""Taylor series of systems with a constant mass matrix, quadratic constraints and forces on a tape, compiled.

With z = (q, cosines, sines, tables), q = sum_j q_j (t - t0)^j and the multipliers likewise, order k of the motion and
order k + 2 of the constraints read

    M (k+2)(k+1) q_{k+2} + G_0^T lambda_k = f_k - sum_{i>=1} G_i^T lambda_{k-i},       G_0 q_{k+2} = -r_{k+2}

with r the part of the constraint that lower orders fix: one factorisation of [[M, G^T], [G, 0]] serves all orders of a
step, and links without mass. (Linkages without loads by expression have kernels of their own, `kernel_series`,
with the sparse elimination of their rows, which end steps on singular positions.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..typing import Array, IntArray
from .kernel_rows import fill, time_series
from .kernel_tape import cauchy, curve_forces, curve_orders, tape_order

if TYPE_CHECKING:
    from .kernel_equations import Scratch
    from .kernel_steps import Run
    from .series import Work
    from .tape import Program


def row_orders(tb: Program, Z: Array, TF: Array, k: int, out: Array) -> None:
    """Order k of all rows."""
    rows = tb.rows
    for r in range(rows.constant.shape[0]):
        out[r] = rows.constant[r] if k == 0 else 0.0
        if rows.motion[r] >= 0:
            out[r] -= TF[rows.motion[r], k]
    for p in range(rows.place.shape[0]):
        out[rows.place[p, 0]] += rows.factor[p] * Z[rows.place[p, 1], k]
    for p in range(rows.pair.shape[0]):
        out[rows.pair[p, 0]] += rows.weight[p] * cauchy(Z, rows.pair[p, 1], Z, rows.pair[p, 2], k)


def gradients(tb: Program, Z: Array, w: Work | Scratch) -> None:
    """w.G := dg/dq where the variables are Z[:, 0]."""
    rows, curves, G, D = tb.rows, tb.curves, w.G, w.D
    n = tb.mass.shape[0]
    for r in range(D.shape[0]):
        fill(D[r], 0.0)
    for p in range(rows.place.shape[0]):
        D[rows.place[p, 0], rows.place[p, 1]] += rows.factor[p]
    for p in range(rows.pair.shape[0]):
        r, i, j = rows.pair[p, 0], rows.pair[p, 1], rows.pair[p, 2]
        D[r, i] += rows.weight[p] * Z[j, 0]
        D[r, j] += rows.weight[p] * Z[i, 0]
    for r in range(D.shape[0]):
        for i in range(n):
            G[r, i] = D[r, i]
        for f in range(curves.place.shape[0]):
            G[r, curves.place[f, 0]] += D[r, n + f] * curves.sign[f] * Z[curves.place[f, 1], 0]


def factorise(tb: Program, w: Work) -> float:
    """L U of [[M, G^T], [G, 0]] in units that compare, with row pivots; the least pivot."""
    A, G, pivot = w.A, w.G, w.pivot
    n, m = tb.mass.shape[0], G.shape[0]
    most = 1e-300
    for i in range(n):
        most = max(most, tb.mass[i, i] * tb.unit[i] ** 2)
    w.scale[0] = most
    for i in range(n):
        for j in range(n):
            A[i, j] = tb.mass[i, j] * tb.unit[i] * tb.unit[j] / most
    for r in range(m):
        for i in range(n):
            value = G[r, i] * tb.unit[i] / tb.rows.unit[r]
            A[n + r, i] = value
            A[i, n + r] = value
        for s in range(m):
            A[n + r, n + s] = 0.0
    least = np.inf
    size = n + m
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivot[k] = best
        if best != k:
            for j in range(size):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        least = min(least, abs(A[k, k]))
        if not abs(A[k, k]) > 0.0:
            return 0.0
        for i in range(k + 1, size):
            if A[i, k] != 0.0:
                A[i, k] /= A[k, k]
                factor = A[i, k]
                for j in range(k + 1, size):
                    A[i, j] -= factor * A[k, j]
    return least


def solve(tb: Program, w: Work, force: Array, gap: Array) -> None:
    """force, gap := the solution of M x + G^T y = force, G x = gap."""
    A, x = w.A, w.x
    n, m = force.shape[0], gap.shape[0]
    size = n + m
    for i in range(n):
        x[i] = force[i] * tb.unit[i] / w.scale[0]
    for r in range(m):
        x[n + r] = gap[r] / tb.rows.unit[r]
    for k in range(size):
        best = w.pivot[k]
        if best != k:
            x[k], x[best] = x[best], x[k]
    for i in range(size):
        value = x[i]
        for j in range(i):
            value -= A[i, j] * x[j]
        x[i] = value
    for i in range(size - 1, -1, -1):
        value = x[i]
        for j in range(i + 1, size):
            value -= A[i, j] * x[j]
        x[i] = value / A[i, i]
    for i in range(n):
        force[i] = x[i] * tb.unit[i]
    for r in range(m):
        gap[r] = x[n + r] * w.scale[0] / tb.rows.unit[r]


def add_row_forces(tb: Program, w: Work, k: int, first: int) -> None:
    """w.H -= order k of the forces of the rows along the variables, from order `first` of these on.

    From order 0 on these are the forces that the multipliers of order k add; from 1 on all those before.
    """
    rows, H, L, Z = tb.rows, w.H, w.L, w.Z
    last = 0 if first == 0 else k
    if first == 0:
        for p in range(rows.place.shape[0]):
            H[rows.place[p, 1], k] -= rows.factor[p] * L[rows.place[p, 0], k]
    for p in range(rows.pair.shape[0]):
        r, i, j = rows.pair[p, 0], rows.pair[p, 1], rows.pair[p, 2]
        one = 0.0
        two = 0.0
        for e in range(first, last + 1):
            one += Z[j, e] * L[r, k - e]
            two += Z[i, e] * L[r, k - e]
        H[i, k] -= rows.weight[p] * one
        H[j, k] -= rows.weight[p] * two


def expand(tb: Program, w: Work, run: Run, t: float, pieces: IntArray) -> None:
    """Series of the variables from orders 0 and 1 of the coordinates in w.Z; w.A holds the factor there."""
    Z, H, L, TF, F, gap = w.Z, w.H, w.L, w.TF, w.F, w.gap
    code, curves = tb.code, tb.curves
    n = tb.mass.shape[0]
    for i in range(n):
        for k in range(2, run.order + 1):
            Z[i, k] = 0.0
    time_series(tb.times, t, run.sign > 0.0, run.order + 1, TF)
    curve_orders(tb, Z, pieces, 0)
    curve_orders(tb, Z, pieces, 1)
    for k in range(run.order - 1):
        j = k + 2
        share = 1.0 / (j * (j - 1.0))
        tape_order(tb, Z, w.R, TF, pieces, k)
        for i in range(H.shape[0]):
            H[i, k] = 0.0
        for p in range(code.push.shape[0]):
            H[code.push[p, 1], k] += code.share[p] * w.R[code.push[p, 0], k]
        add_row_forces(tb, w, k, 1)
        for i in range(n):
            F[i] = H[i, k] + (tb.constant[i] if k == 0 else 0.0)
        for e in range(tb.block.shape[0]):
            i, at = tb.block[e, 0], tb.block[e, 1]
            F[i] -= tb.stiffness[e] * Z[at, k] + tb.damping[e] * (k + 1) * Z[at, k + 1]
        curve_forces(tb, Z, H, k, F)
        curve_orders(tb, Z, pieces, j)
        row_orders(tb, Z, TF, j, gap)
        for i in range(n):
            F[i] *= share
        for r in range(gap.shape[0]):
            gap[r] = -gap[r]
        solve(tb, w, F, gap)
        for i in range(n):
            Z[i, j] = F[i]
        for f in range(curves.place.shape[0]):
            Z[n + f, j] += curves.sign[f] * Z[curves.place[f, 1], 0] * F[curves.place[f, 0]]
        for r in range(gap.shape[0]):
            L[r, k] = gap[r] / share
        add_row_forces(tb, w, k, 0)
    tape_order(tb, Z, w.R, TF, pieces, run.order - 1)


FUNCTIONS = (row_orders, gradients, factorise, solve, add_row_forces, expand)
