"""Taylor series of the index-3 equations of a program about one point.

With q(t) = sum_j q_j (t - t0)^j and the multipliers likewise, order k of the motion and order k + 2 of the
constraints read

    M (k+2)(k+1) q_{k+2} + G_0^T lambda_k = f_k - sum_{i>=1} G_i^T lambda_{k-i},       G_0 q_{k+2} = -r_{k+2}

with r the part of the constraint that lower orders fix. One factorisation of S = G_0 M^-1 G_0^T serves all orders.
Sines and cosines follow from s' = c theta', c' = -s theta' (Barrio, Appl. Math. Comput. 163 (2005) 525); forces of
registers and rows act along the variables z = (q, functions u of one coordinate), one along u as u' on its coordinate.

At a passing singular position some rows Z^T G_0 vanish while B = Z^T dG/dt does not. There order k + 3 of Z^T g
fixes q_{k+2} along B, and the multipliers have a simple pole: lambda = (Z nu_0)/t + ... . Both conditions together
give the bordered system with the rows B; multipliers and forces are then stored one order up ("shift").

Light links: where the joints make a link carry far more than its own mass, M^-1 of the link hides the heavy ones in S.
The elimination then uses N = M + D with the excess D on these few coordinates c, and

    N q + G^T lambda = f + D q,    q = q_N + sum_c X_c q_c,    X_c = D_c times the answer of N to a unit force on c

is solved exactly: (1 - X) q_c = (q_N)_c once per order. No 1/m of a light link appears, so it may be without mass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...typing import Array
from .kernel_rows import accelerations, add_transposed, copy, fill, solve, time_series, times_gradients, variables
from .kernel_tape import curve_forces, curve_orders, tape_order

if TYPE_CHECKING:
    from .row_tables import Equations
    from .work_space import Border, Run, Work


def square_orders(tb: Equations, w: Work, j: int) -> None:
    """Order j of the forms of the squares."""
    square, Z = tb.square, w.Z
    z = w.slope.shape[0]
    for s in range(square.row.shape[0]):
        value = 0.0
        for e in range(square.first[s], square.first[s + 1]):
            value += square.weight[e] * Z[square.variable[e], j]
        Z[z + s, j] = value


def row_orders(tb: Equations, w: Work, j: int, out: Array) -> None:
    """Order j >= 2 of every row without the part of q_j."""
    rows, gradient, square, Z = tb.program.rows, tb.gradient, tb.square, w.Z
    curve_orders(tb.program, Z, w.pieces, j)
    square_orders(tb, w, j)
    for r in range(out.shape[0]):
        out[r] = -w.TF[rows.motion[r], j] if rows.motion[r] >= 0 else 0.0
    for e in range(gradient.turning.shape[0]):
        out[gradient.turning[e, 0]] += gradient.factor[e] * Z[gradient.turning[e, 2], j]
    z = w.slope.shape[0]
    for s in range(square.row.shape[0]):
        form = Z[z + s]
        value = 0.0
        for p in range((j + 1) // 2):
            value += form[p] * form[j - p]
        value *= 2.0
        if j % 2 == 0:
            value += form[j // 2] ** 2
        out[square.row[s]] += square.factor[s] * value


def push_orders(tb: Equations, w: Work, k: int, at: int, F: Array) -> None:
    """F := order k of all forces but those of the multipliers of that order; those along variables in w.H[:, at]."""
    program, square, Z, H, L = tb.program, tb.square, w.Z, w.H, w.L
    code = program.code
    n = F.shape[0]
    z = w.slope.shape[0]
    for i in range(z):
        H[i, at] = 0.0
    for p in range(code.push.shape[0]):
        H[code.push[p, 1], at] += code.share[p] * w.R[code.push[p, 0], k]
    for s in range(square.row.shape[0]):
        form, held = Z[z + s], L[square.row[s]]
        value = 0.0
        for e in range(1, at + 1):
            value += form[e] * held[at - e]
        add_square(tb, H, s, at, value)
    for i in range(n):
        F[i] = H[i, at]
        if k == 0:
            F[i] += program.constant[i]
    for e in range(program.block.shape[0]):
        i = program.block[e, 1]
        F[program.block[e, 0]] -= program.stiffness[e] * Z[i, k] + program.damping[e] * (k + 1) * Z[i, k + 1]
    curve_forces(program, Z, H, at, F)


def add_square(tb: Equations, H: Array, s: int, at: int, value: float) -> None:
    """Order `at` of the force of a square, `value` that of its form times the multiplier."""
    square = tb.square
    value *= 2.0 * square.factor[s]
    for e in range(square.first[s], square.first[s + 1]):
        H[square.variable[e], at] -= square.weight[e] * value


def add_multipliers(tb: Equations, w: Work, at: int, values: Array) -> None:
    """Multipliers `values` (one per row) join order `at`: what turns with a body goes into w.H."""
    gradient, L, H = tb.gradient, w.L, w.H
    for r in range(values.shape[0]):
        L[r, at] += values[r]
    for e in range(gradient.turning.shape[0]):
        H[gradient.turning[e, 2], at] -= gradient.factor[e] * values[gradient.turning[e, 0]]
    add_square_multipliers(tb, w, at, 0, values)


def add_square_multipliers(tb: Equations, w: Work, at: int, i: int, values: Array) -> None:
    """Order `at` of the force of every square gains order i of its form times its multiplier."""
    square = tb.square
    z = w.slope.shape[0]
    for s in range(square.row.shape[0]):
        add_square(tb, w.H, s, at, w.Z[z + s, i] * values[square.row[s]])


def finish_order(tb: Equations, w: Work, j: int) -> None:
    """Everything that follows from q_j in w.a: curves and squares."""
    Z, curves = w.Z, tb.program.curves
    n = w.a.shape[0]
    for i in range(n):
        Z[i, j] = w.a[i]
    for f in range(curves.sign.shape[0]):
        Z[n + f, j] += w.slope[n + f] * w.a[curves.place[f, 0]]
    square_orders(tb, w, j)


def expand(tb: Equations, w: Work, run: Run, t: float, singular: int) -> None:
    """Series w.Z of the variables from w.q, w.v; w.G, w.val hold gradients and factor there, w.border singular rows.

    `singular` is their number: 0 at a regular position.
    """
    border, skip = w.border, w.skip
    mu, rhs, F, u = w.mu, w.rhs, w.F, w.u
    shift = 1 if singular > 0 else 0
    time_series(tb.program.times, t, run.sign > 0.0, run.order + 2, w.TF)
    start_series(tb, w)
    if tb.mass.light.shape[0] > 0:
        carry_responses(tb, singular, w)
    for k in range(run.order - 1):
        j = k + 2
        at = k + shift
        alpha = float(j * (j - 1))
        share = 1.0 / alpha
        tape_order(tb.program, w.Z, w.R, w.TF, w.pieces, k)
        push_orders(tb, w, k, at, F)
        row_orders(tb, w, j, rhs)
        accelerations(tb, F, u)
        for i in range(u.shape[0]):
            u[i] *= share
        if singular > 0:
            border_rows(tb, w, j, singular)
        times_gradients(tb, w.G, u, mu)
        for r in range(mu.shape[0]):
            mu[r] = mu[r] + rhs[r] if skip[r] == 0 else 0.0
        constrained(tb, singular, w, mu, u, w.a)
        if tb.mass.light.shape[0] > 0:
            add_carried(tb, singular, w, mu, w.a)
        for r in range(mu.shape[0]):
            mu[r] *= alpha
        add_multipliers(tb, w, at, mu)
        if singular > 0:  # the multipliers Z nu belong one order below the regular ones
            for r in range(mu.shape[0]):
                mu[r] = 0.0
                for p in range(singular):
                    mu[r] += alpha * border.Z[p, r] * border.nu[p]
            add_multipliers(tb, w, at - 1, mu)
            add_square_multipliers(tb, w, at, 1, mu)
        finish_order(tb, w, j)
    if w.pieces.shape[0] > 0 or tb.program.code.checked.shape[0] > 0:
        tape_order(tb.program, w.Z, w.R, w.TF, w.pieces, run.order - 1)


def constrained(tb: Equations, singular: int, w: Work, mu: Array, u: Array, q: Array) -> None:
    """q := the motion that a free motion u becomes under the constraints; mu (and border.nu): gaps in, multipliers
    out."""
    border, F = w.border, w.F
    if singular > 0:
        border_solve(tb, w.val, border, mu, singular)
    else:
        solve(tb, w.val, mu)
    fill(F, 0.0)
    add_transposed(tb, w.G, mu, 1.0, F)
    for p in range(singular):
        for i in range(F.shape[0]):
            F[i] += border.B[p, i] * border.nu[p]
    accelerations(tb, F, w.work)
    for i in range(F.shape[0]):
        q[i] = u[i] - w.work[i]


def carry_responses(tb: Equations, singular: int, w: Work) -> None:
    """w.carry: what a unit of every light coordinate adds to coordinates (X) and multipliers (Y, W); 1 - X = L U.

    D (1 - X) is symmetric and positive definite, so it needs no pivots.
    """
    carry, light, border, u = w.carry, tb.mass.light, w.border, w.u
    k = light.shape[0]
    for c in range(k):
        fill(w.F, 0.0)
        w.F[light[c]] = tb.mass.excess[c]
        accelerations(tb, w.F, u)
        times_gradients(tb, w.G, u, carry.Y[c])
        for r in range(carry.Y.shape[1]):
            if w.skip[r] != 0:
                carry.Y[c, r] = 0.0
        for p in range(singular):
            border.nu[p] = 0.0
            for i in range(u.shape[0]):
                border.nu[p] += border.B[p, i] * u[i]
        constrained(tb, singular, w, carry.Y[c], u, carry.X[c])
        for p in range(singular):
            carry.W[c, p] = border.nu[p]
    lu = carry.lu
    for e in range(k):
        for c in range(k):
            lu[e, c] = (1.0 if e == c else 0.0) - carry.X[c, light[e]]
            for i in range(min(e, c)):
                lu[e, c] -= lu[e, i] * lu[i, c]
            if c < e:
                lu[e, c] /= lu[c, c]


def add_carried(tb: Equations, singular: int, w: Work, mu: Array, q: Array) -> None:
    """Motion q and multipliers mu (and border.nu) of the masses N become those of the masses M."""
    carry, light = w.carry, tb.mass.light
    lu, own = carry.lu, carry.own
    k = light.shape[0]
    for e in range(k):
        own[e] = q[light[e]]
        for c in range(e):
            own[e] -= lu[e, c] * own[c]
    for e in range(k - 1, -1, -1):
        for c in range(e + 1, k):
            own[e] -= lu[e, c] * own[c]
        own[e] /= lu[e, e]
    for c in range(k):
        value = own[c]
        for i in range(q.shape[0]):
            q[i] += carry.X[c, i] * value
        for r in range(mu.shape[0]):
            mu[r] += carry.Y[c, r] * value
        for p in range(singular):
            w.border.nu[p] += carry.W[c, p] * value


def start_series(tb: Equations, w: Work) -> None:
    """Orders 0 and 1 from position and velocity; all others zero."""
    Z = w.Z
    variables(tb, w, w.q)
    for i in range(Z.shape[0]):
        fill(Z[i], 0.0)
        Z[i, 0] = w.P[i, 0]
    for r in range(w.L.shape[0]):
        fill(w.L[r], 0.0)
    for i in range(w.H.shape[0]):
        w.H[i, 0] = 0.0
    copy(w.v, w.a)
    finish_order(tb, w, 1)


def border_rows(tb: Equations, w: Work, j: int, singular: int) -> None:
    """Order j + 1 of Z^T g with q_j and q_{j+1} left out: border.nu; the part of q_j is B q_j."""
    border, work, u = w.border, w.mu, w.u
    row_orders(tb, w, j + 1, work)
    for p in range(singular):
        value = 0.0
        for r in range(work.shape[0]):
            value += border.Z[p, r] * work[r]
        for i in range(u.shape[0]):
            value += border.B[p, i] * u[i]
        border.nu[p] = value


def border_solve(tb: Equations, val: Array, border: Border, mu: Array, singular: int) -> None:
    """Bordered solve: in come the regular right-hand side in mu and the one of the rows B in nu; out the
    multipliers."""
    for p in range(singular):
        for r in range(mu.shape[0]):
            border.nu[p] -= border.Y[p, r] * mu[r]
    small_solve(border.schur, singular, border.nu, border.small)
    solve(tb, val, mu)
    for p in range(singular):
        for r in range(mu.shape[0]):
            mu[r] -= border.Y[p, r] * border.nu[p]


def small_solve(matrix: Array, size: int, x: Array, work: Array) -> None:
    """x := matrix^-1 x by Gaussian elimination with row pivots (a few unknowns)."""
    for i in range(size):
        for j in range(size):
            work[i, j] = matrix[i, j]
    for i in range(size):
        best = i
        for k in range(i + 1, size):
            if abs(work[k, i]) > abs(work[best, i]):
                best = k
        if best != i:
            for j in range(size):
                keep = work[i, j]
                work[i, j] = work[best, j]
                work[best, j] = keep
            keep = x[i]
            x[i] = x[best]
            x[best] = keep
        for k in range(i + 1, size):
            factor = work[k, i] / work[i, i]
            x[k] -= factor * x[i]
            for j in range(i, size):
                work[k, j] -= factor * work[i, j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= work[i, j] * x[j]
        x[i] /= work[i, i]


FUNCTIONS = (
    square_orders, row_orders, push_orders, add_square, add_multipliers, add_square_multipliers, finish_order, expand,
    constrained, carry_responses, add_carried, start_series, border_rows, border_solve, small_solve,
)  # fmt: skip
