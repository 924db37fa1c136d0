# mypy: ignore-errors
"""Taylor series of the index-3 equations of a planar scene about one point.

With q(t) = sum_j q_j (t - t0)^j and the multipliers likewise, order k of the motion and order k + 2 of the
constraints read

    M (k+2)(k+1) q_{k+2} + G_0^T lambda_k = f_k - sum_{i>=1} G_i^T lambda_{k-i},       G_0 q_{k+2} = -r_{k+2}

with r the part of the constraint that lower orders fix. One factorisation of S = G_0 M^-1 G_0^T serves all
orders. Sines and
cosines follow from s' = c theta', c' = -s theta' (Barrio, Appl. Math. Comput. 163 (2005) 525); every force that acts at
a point of a body enters through two sums A, B with the torque s A + c B, so the price does not depend on the joints.

At a passing singular position (fold) some rows Z^T G_0 vanish while B = Z^T dG/dt does not. There order k + 3 of Z^T g
fixes q_{k+2} along B, and the multipliers have a simple pole: lambda = (Z nu_0)/t + ... . Both conditions
together give the
bordered system with the rows B; multipliers are then stored one order up ("shift").

Light links: where the joints make a link carry far more than its own mass, M^-1 of the link hides the heavy ones in S.
The elimination then uses N = M + D with the excess D on these few coordinates c, and

    N q + G^T lambda = f + D q,    q = q_N + sum_c X_c q_c,    X_c = D_c times the answer of N to a unit force on c

is solved exactly: (1 - X) q_c = (q_N)_c once per order. No 1/m of a light link appears, so it may be without mass.
"""

from __future__ import annotations

from .kernel_forces import force_orders, spring_orders
from .kernel_planes import AS, BS, CS, DT, DX, DY, FX, FY, NX, NY, SN
from .kernel_rows import add_transposed, fill, solve, time_series, times_gradients, trigonometry


def angle_orders(bs, j, known):
    """Orders j of sine and cosine from the orders of theta below `known`: what theta_j itself adds comes later."""
    for b in range(bs.shape[2]):
        sine = 0.0
        cosine = 0.0
        for i in range(1, known):
            sine += bs[DT, i, b] * bs[CS, j - i, b]
            cosine -= bs[DT, i, b] * bs[SN, j - i, b]
        bs[SN, j, b] = sine / j
        bs[CS, j, b] = cosine / j


def slot_orders(rows, QS, bs, ls, j):
    """Orders j of the normal n and the distance D of every moving line, from the orders j of q, sine and cosine."""
    for k in range(rows.lines.shape[0]):
        r = rows.lines[k]
        a = rows.ints[r, 0]
        b = rows.ints[r, 1]
        ls[NX, j, k] = bs[CS, j, a] * rows.reals[r, 10] - bs[SN, j, a] * rows.reals[r, 11]
        ls[NY, j, k] = bs[SN, j, a] * rows.reals[r, 10] + bs[CS, j, a] * rows.reals[r, 11]
        rx = bs[CS, j, b] * rows.reals[r, 12] - bs[SN, j, b] * rows.reals[r, 13]
        ry = bs[SN, j, b] * rows.reals[r, 12] + bs[CS, j, b] * rows.reals[r, 13]
        ls[DX, j, k] = QS[j, 3 * b] + rx - QS[j, 3 * a]
        ls[DY, j, k] = QS[j, 3 * b + 1] + ry - QS[j, 3 * a + 1]


def row_orders(rows, TF, bs, ls, j, out):
    """Order j >= 2 of every constraint row without the part of q_j."""
    for r in range(rows.ints.shape[0]):
        value = 0.0
        if rows.ints[r, 3] >= 0:
            value = -TF[rows.ints[r, 3], j]
        if rows.ints[r, 2] == 0:
            for side in range(2):
                b = rows.ints[r, side]
                value += rows.reals[r, 5 * side + 3] * bs[CS, j, b] + rows.reals[r, 5 * side + 4] * bs[SN, j, b]
        out[r] = value
    for k in range(rows.lines.shape[0]):
        value = 0.0
        for i in range(j + 1):
            value += ls[NX, i, k] * ls[DX, j - i, k] + ls[NY, i, k] * ls[DY, j - i, k]
        out[rows.lines[k]] += value


def slot_forces(rows, LM, bs, ls, at, F):
    """Known part of order `at` of the forces of moving ls, from the multipliers below that order."""
    for k in range(rows.lines.shape[0]):
        r = rows.lines[k]
        fx = 0.0
        fy = 0.0
        for i in range(1, at + 1):
            fx += ls[NX, i, k] * LM[at - i, r]
            fy += ls[NY, i, k] * LM[at - i, r]
        ls[FX, at, k] = fx
        ls[FY, at, k] = fy
        turn = 0.0
        for i in range(at + 1):
            turn += ls[FX, i, k] * ls[DY, at - i, k] - ls[FY, i, k] * ls[DX, at - i, k]
        a = rows.ints[r, 0]
        b = rows.ints[r, 1]
        F[3 * a] += fx
        F[3 * a + 1] += fy
        F[3 * a + 2] -= turn
        F[3 * b] -= fx
        F[3 * b + 1] -= fy
        slot_arms(rows, bs, at, r, b, fx, fy)


def slot_arms(rows, bs, at, r, b, fx, fy):
    """Reaction (fx, fy) of the moving line r on the point of body b, in the sums A and B."""
    x = rows.reals[r, 12]
    y = rows.reals[r, 13]
    bs[AS, at, b] += x * fx + y * fy
    bs[BS, at, b] -= x * fy - y * fx


def add_multipliers(rows, LM, bs, ls, at, values):
    """Multipliers `values` (one per row) join order `at`: what turns with a body goes into A, B, and into the
    lines' forces."""
    for r in range(values.shape[0]):
        value = values[r]
        LM[at, r] += value
        if rows.ints[r, 2] == 0:
            for side in range(2):
                b = rows.ints[r, side]
                bs[AS, at, b] += rows.reals[r, 5 * side + 3] * value
                bs[BS, at, b] -= rows.reals[r, 5 * side + 4] * value
    add_line_multipliers(rows, bs, ls, at, 0, values)


def add_line_multipliers(rows, bs, ls, at, i, values):
    """Order `at` of the force of every moving line gains n_i times its multiplier."""
    for k in range(rows.lines.shape[0]):
        r = rows.lines[k]
        fx = ls[NX, i, k] * values[r]
        fy = ls[NY, i, k] * values[r]
        ls[FX, at, k] += fx
        ls[FY, at, k] += fy
        slot_arms(rows, bs, at, r, rows.ints[r, 1], fx, fy)


def torque_orders(bs, at, F):
    """F gains order `at` of s A + c B for every body."""
    for b in range(bs.shape[2]):
        torque = 0.0
        for i in range(at + 1):
            torque += bs[SN, i, b] * bs[AS, at - i, b] + bs[CS, i, b] * bs[BS, at - i, b]
        F[3 * b + 2] += torque


def finish_order(rows, forces, QS, bs, ls, es, j):
    """Everything that follows from q_j: sine, cosine, ls, springs."""
    n = bs.shape[2]
    for b in range(n):
        theta = QS[j, 3 * b + 2]
        bs[DT, j, b] = j * theta
        bs[SN, j, b] += bs[CS, 0, b] * theta
        bs[CS, j, b] -= bs[SN, 0, b] * theta
    slot_orders(rows, QS, bs, ls, j)
    spring_orders(forces, QS, bs, es, j)


def expand(tb, t, forward, order, folds, w):
    """Fill w.QS[2..order] from w.QS[0], w.QS[1]; w.G, w.val hold gradients and factor there, w.fold the fold's rows.

    `folds` is the number of singular rows: 0 at a regular position.
    """
    rows, forces, mass = tb.rows, tb.forces, tb.mass
    bs, ls, es, fold = w.bs, w.ls, w.es, w.fold
    QS, TF, LM, G, skip = w.QS, w.TF, w.LM, w.G, w.skip
    mu, rhs, F, u = w.mu, w.rhs, w.F, w.u
    shift = 1 if folds > 0 else 0
    time_series(tb.times, t, forward, order + 2, TF)
    start_series(rows, forces, order, QS, LM, bs, ls, es)
    if tb.light.shape[0] > 0:
        carry_responses(tb, folds, w)
    for k in range(order - 1):
        j = k + 2
        at = k + shift
        alpha = float(j * (j - 1))
        share = 1.0 / alpha
        force_orders(forces, QS, TF, bs, es, k, at, F)
        slot_forces(rows, LM, bs, ls, at, F)
        torque_orders(bs, at, F)
        angle_orders(bs, j, j)
        slot_orders(rows, QS, bs, ls, j)
        row_orders(rows, TF, bs, ls, j, rhs)
        for i in range(F.shape[0]):
            u[i] = F[i] * mass[i] * share
        if folds > 0:
            fold_rows(rows, QS, TF, bs, ls, fold, mu, u, j, folds)
        times_gradients(rows, G, u, mu)
        for r in range(mu.shape[0]):
            mu[r] = mu[r] + rhs[r] if skip[r] == 0 else 0.0
        constrained(tb, folds, w, mu, u, QS[j])
        if tb.light.shape[0] > 0:
            add_carried(tb, folds, w, mu, QS[j])
        for r in range(mu.shape[0]):
            mu[r] *= alpha
        add_multipliers(rows, LM, bs, ls, at, mu)
        if folds > 0:  # the multipliers Z nu belong one order below the regular ones
            for r in range(mu.shape[0]):
                mu[r] = 0.0
                for p in range(folds):
                    mu[r] += alpha * fold.Z[p, r] * fold.nu[p]
            add_multipliers(rows, LM, bs, ls, at - 1, mu)
            add_line_multipliers(rows, bs, ls, at, 1, mu)
        finish_order(rows, forces, QS, bs, ls, es, j)


def constrained(tb, folds, w, mu, u, q):
    """q := the motion that a free motion u becomes under the constraints; mu (and fold.nu): gaps in, multipliers
    out."""
    fold, F = w.fold, w.F
    if folds > 0:
        fold_solve(tb.plan, w.val, fold, mu, folds)
    else:
        solve(tb.plan, w.val, mu)
    fill(F, 0.0)
    add_transposed(tb.rows, w.G, mu, 1.0, F)
    for p in range(folds):
        for i in range(F.shape[0]):
            F[i] += fold.B[p, i] * fold.nu[p]
    for i in range(F.shape[0]):
        q[i] = u[i] - F[i] * tb.mass[i]


def carry_responses(tb, folds, w):
    """w.carry: what a unit of every light coordinate adds to coordinates (X) and multipliers (Y, W); 1 - X = L U.

    D (1 - X) is symmetric and positive definite, so it needs no pivots.
    """
    carry, light, fold, u = w.carry, tb.light, w.fold, w.u
    k = light.shape[0]
    for c in range(k):
        at = light[c]
        fill(u, 0.0)
        u[at] = tb.excess[c] * tb.mass[at]
        times_gradients(tb.rows, w.G, u, carry.Y[c])
        for r in range(carry.Y.shape[1]):
            if w.skip[r] != 0:
                carry.Y[c, r] = 0.0
        for p in range(folds):
            fold.nu[p] = fold.B[p, at] * u[at]
        constrained(tb, folds, w, carry.Y[c], u, carry.X[c])
        for p in range(folds):
            carry.W[c, p] = fold.nu[p]
    lu = carry.lu
    for e in range(k):
        for c in range(k):
            lu[e, c] = (1.0 if e == c else 0.0) - carry.X[c, light[e]]
            for i in range(min(e, c)):
                lu[e, c] -= lu[e, i] * lu[i, c]
            if c < e:
                lu[e, c] /= lu[c, c]


def add_carried(tb, folds, w, mu, q):
    """Motion q and multipliers mu (and fold.nu) of the masses N become those of the masses M."""
    carry, light = w.carry, tb.light
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
        for p in range(folds):
            w.fold.nu[p] += carry.W[c, p] * value


def start_series(rows, forces, order, QS, LM, bs, ls, es):
    """Orders 0 and 1 from position and velocity; all others zero."""
    for j in range(2, order + 2):
        fill(QS[j], 0.0)
    for j in range(order + 2):
        fill(LM[j], 0.0)
    fill(ls[FX, 0], 0.0)
    fill(ls[FY, 0], 0.0)
    trigonometry(QS[0], bs[CS, 0], bs[SN, 0])
    fill(bs[DT, 0], 0.0)
    fill(bs[SN, 1], 0.0)
    fill(bs[CS, 1], 0.0)
    fill(bs[AS, 0], 0.0)
    fill(bs[BS, 0], 0.0)
    slot_orders(rows, QS, bs, ls, 0)
    spring_orders(forces, QS, bs, es, 0)
    finish_order(rows, forces, QS, bs, ls, es, 1)


def fold_rows(rows, QS, TF, bs, ls, fold, work, u, j, folds):
    """Order j + 1 of Z^T g with q_j and q_{j+1} left out: fold.nu; the part of q_j is B q_j."""
    angle_orders(bs, j + 1, j)
    slot_orders(rows, QS, bs, ls, j + 1)
    row_orders(rows, TF, bs, ls, j + 1, work)
    for p in range(folds):
        value = 0.0
        for r in range(work.shape[0]):
            value += fold.Z[p, r] * work[r]
        for i in range(u.shape[0]):
            value += fold.B[p, i] * u[i]
        fold.nu[p] = value


def fold_solve(plan, val, fold, mu, folds):
    """Bordered solve: in come the regular right-hand side in mu and the one of the rows B in nu; out the
    multipliers."""
    for p in range(folds):
        for r in range(mu.shape[0]):
            fold.nu[p] -= fold.Y[p, r] * mu[r]
    small_solve(fold.border, folds, fold.nu, fold.small)
    solve(plan, val, mu)
    for p in range(folds):
        for r in range(mu.shape[0]):
            mu[r] -= fold.Y[p, r] * fold.nu[p]


def small_solve(matrix, size, x, work):
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
    angle_orders,
    slot_orders,
    row_orders,
    slot_forces,
    slot_arms,
    add_multipliers,
    add_line_multipliers,
    torque_orders,
    finish_order,
    expand,
    constrained,
    carry_responses,
    add_carried,
    start_series,
    fold_rows,
    fold_solve,
    small_solve,
)
