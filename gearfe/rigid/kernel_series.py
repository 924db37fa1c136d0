"""Taylor series of the index-3 equations of a planar scene about one point.

With q(t) = sum_j q_j (t - t0)^j and the multipliers likewise, order k of the motion and order k + 2 of the constraints read

    M (k+2)(k+1) q_{k+2} + G_0^T lambda_k = f_k - sum_{i>=1} G_i^T lambda_{k-i},       G_0 q_{k+2} = -r_{k+2}

with r the part of the constraint that lower orders fix. One factorisation of S = G_0 M^-1 G_0^T serves all orders. Sines and
cosines follow from s' = c theta', c' = -s theta' (Barrio, Appl. Math. Comput. 163 (2005) 525); every force that acts at
a point of a body enters through two sums A, B with the torque s A + c B, so the price does not depend on the joints.

At a passing singular position (fold) some rows Z^T G_0 vanish while B = Z^T dG/dt does not. There order k + 3 of Z^T g
fixes q_{k+2} along B, and the multipliers have a simple pole: lambda = (Z nu_0)/t + ... . Both conditions together give the
bordered system with the rows B; multipliers are then stored one order up ("shift").
"""

from __future__ import annotations

import numpy as np


def angle_orders(w, j, known):
    """Orders j of sine and cosine from the orders of theta below `known`: what theta_j itself adds comes later."""
    n = w.CS.shape[1]
    for b in range(n):
        w.SN[j, b] = 0.0
        w.CS[j, b] = 0.0
    for i in range(1, known):
        for b in range(n):
            d = w.DT[i, b]
            w.SN[j, b] += d * w.CS[j - i, b]
            w.CS[j, b] -= d * w.SN[j - i, b]
    for b in range(n):
        w.SN[j, b] /= j
        w.CS[j, b] /= j


def slot_orders(tb, w, j):
    """Orders j of the normal n and the distance D of every moving line, from the orders j of q, sine and cosine."""
    for k in range(tb.slots.shape[0]):
        r = tb.slots[k]
        a = tb.row_body[r, 0]
        b = tb.row_body[r, 1]
        w.NX[j, k] = w.CS[j, a] * tb.row_slot[r, 0] - w.SN[j, a] * tb.row_slot[r, 1]
        w.NY[j, k] = w.SN[j, a] * tb.row_slot[r, 0] + w.CS[j, a] * tb.row_slot[r, 1]
        rx = w.CS[j, b] * tb.row_slot[r, 2] - w.SN[j, b] * tb.row_slot[r, 3]
        ry = w.SN[j, b] * tb.row_slot[r, 2] + w.CS[j, b] * tb.row_slot[r, 3]
        w.DX[j, k] = w.QS[j, 3 * b] + rx - w.QS[j, 3 * a]
        w.DY[j, k] = w.QS[j, 3 * b + 1] + ry - w.QS[j, 3 * a + 1]


def row_orders(tb, w, j, out):
    """Order j >= 2 of every constraint row without the part of q_j."""
    for r in range(tb.row_kind.shape[0]):
        value = 0.0
        if tb.row_time[r] >= 0:
            value = -w.TF[tb.row_time[r], j]
        if tb.row_kind[r] == 0:
            for side in range(2):
                b = tb.row_body[r, side]
                value += tb.row_factor[r, side, 3] * w.CS[j, b] + tb.row_factor[r, side, 4] * w.SN[j, b]
        out[r] = value
    for k in range(tb.slots.shape[0]):
        value = 0.0
        for i in range(j + 1):
            value += w.NX[i, k] * w.DX[j - i, k] + w.NY[i, k] * w.DY[j - i, k]
        out[tb.slots[k]] += value


def spring_orders(tb, w, j):
    """Order j of the span D, length L and 1/L of every spring."""
    for k in range(tb.spring_body.shape[0]):
        a = tb.spring_body[k, 0]
        b = tb.spring_body[k, 1]
        p = tb.spring_point[k]
        w.EX[j, k] = (
            w.QS[j, 3 * b] - w.QS[j, 3 * a] + w.CS[j, b] * p[2] - w.SN[j, b] * p[3] - w.CS[j, a] * p[0] + w.SN[j, a] * p[1]
        )
        w.EY[j, k] = (
            w.QS[j, 3 * b + 1] - w.QS[j, 3 * a + 1] + w.SN[j, b] * p[2] + w.CS[j, b] * p[3]
            - w.SN[j, a] * p[0] - w.CS[j, a] * p[1]
        )  # fmt: skip
        square = 0.0
        for i in range(j + 1):
            square += w.EX[i, k] * w.EX[j - i, k] + w.EY[i, k] * w.EY[j - i, k]
        if j == 0:
            w.EL[0, k] = np.sqrt(square)
            w.EI[0, k] = 1.0 / w.EL[0, k]
        else:
            for i in range(1, j):
                square -= w.EL[i, k] * w.EL[j - i, k]
            w.EL[j, k] = 0.5 * square * w.EI[0, k]
            inverse = 0.0
            for i in range(1, j + 1):
                inverse += w.EL[i, k] * w.EI[j - i, k]
            w.EI[j, k] = -inverse * w.EI[0, k]


def force_orders(tb, w, k, at, F):
    """Order k of all applied forces: F gets what does not turn with a body, A and B (at row `at`) what does."""
    n = w.CS.shape[1]
    for i in range(F.shape[0]):
        F[i] = tb.weight[i] if k == 0 else 0.0
    for b in range(n):
        w.A[at, b] = 0.0
        w.B[at, b] = 0.0
    for e in range(tb.spring_body.shape[0]):
        a = tb.spring_body[e, 0]
        b = tb.spring_body[e, 1]
        rigid = tb.spring_factor[e, 0]
        loss = tb.spring_factor[e, 1]
        value = -rigid * tb.spring_factor[e, 2] * w.EI[k, e]
        if k == 0:
            value += rigid
        if loss != 0.0:
            for i in range(k + 1):
                value += loss * (i + 1) * w.EL[i + 1, e] * w.EI[k - i, e]
        w.EF[k, e] = value
        fx = 0.0
        fy = 0.0
        for i in range(k + 1):
            fx += w.EF[i, e] * w.EX[k - i, e]
            fy += w.EF[i, e] * w.EY[k - i, e]
        p = tb.spring_point[e]
        F[3 * a] += fx
        F[3 * a + 1] += fy
        F[3 * b] -= fx
        F[3 * b + 1] -= fy
        w.A[at, a] -= p[0] * fx + p[1] * fy
        w.B[at, a] += p[0] * fy - p[1] * fx
        w.A[at, b] += p[2] * fx + p[3] * fy
        w.B[at, b] -= p[2] * fy - p[3] * fx
    for e in range(tb.linear_coordinate.shape[0]):
        i = tb.linear_coordinate[e, 0]
        j = tb.linear_coordinate[e, 1]
        value = -tb.linear_factor[e, 0] * (w.QS[k, i] - w.QS[k, j])
        value -= tb.linear_factor[e, 1] * (k + 1) * (w.QS[k + 1, i] - w.QS[k + 1, j])
        if k == 0:
            value += tb.linear_factor[e, 0] * tb.linear_factor[e, 2]
        F[i] += value
        F[j] -= value
    for e in range(tb.load_body.shape[0]):
        b = tb.load_body[e]
        fx = w.TF[tb.load_time[e, 0], k]
        fy = w.TF[tb.load_time[e, 1], k]
        F[3 * b] += fx
        F[3 * b + 1] += fy
        w.A[at, b] -= tb.load_point[e, 0] * fx + tb.load_point[e, 1] * fy
        w.B[at, b] += tb.load_point[e, 0] * fy - tb.load_point[e, 1] * fx
    for e in range(tb.moment_time.shape[0]):
        value = w.TF[tb.moment_time[e], k]
        F[3 * tb.moment_body[e, 0] + 2] += value
        F[3 * tb.moment_body[e, 1] + 2] -= value


def slot_forces(tb, w, at, F):
    """Known part of order `at` of the forces of moving lines, from the multipliers below that order."""
    for k in range(tb.slots.shape[0]):
        r = tb.slots[k]
        fx = 0.0
        fy = 0.0
        for i in range(1, at + 1):
            fx += w.NX[i, k] * w.LM[at - i, r]
            fy += w.NY[i, k] * w.LM[at - i, r]
        w.FX[at, k] = fx
        w.FY[at, k] = fy
        turn = 0.0
        for i in range(at + 1):
            turn += w.FX[i, k] * w.DY[at - i, k] - w.FY[i, k] * w.DX[at - i, k]
        a = tb.row_body[r, 0]
        b = tb.row_body[r, 1]
        F[3 * a] += fx
        F[3 * a + 1] += fy
        F[3 * a + 2] -= turn
        F[3 * b] -= fx
        F[3 * b + 1] -= fy
        slot_arms(tb, w, at, r, b, fx, fy)


def slot_arms(tb, w, at, r, b, fx, fy):
    """Reaction (fx, fy) of the moving line r on the point of body b, in the sums A and B."""
    x = tb.row_slot[r, 2]
    y = tb.row_slot[r, 3]
    w.A[at, b] += x * fx + y * fy
    w.B[at, b] -= x * fy - y * fx


def add_multiplier(tb, w, at, r, value):
    """Multiplier `value` of row r joins order `at`: its turning part goes into A, B (and into the force of a moving line)."""
    w.LM[at, r] += value
    if tb.row_kind[r] == 0:
        for side in range(2):
            b = tb.row_body[r, side]
            w.A[at, b] += tb.row_factor[r, side, 3] * value
            w.B[at, b] -= tb.row_factor[r, side, 4] * value


def add_slot_multipliers(tb, w, at, i, values):
    """The same for rows of moving lines: order `at` of the force gains n_i times the multiplier."""
    for k in range(tb.slots.shape[0]):
        r = tb.slots[k]
        fx = w.NX[i, k] * values[r]
        fy = w.NY[i, k] * values[r]
        w.FX[at, k] += fx
        w.FY[at, k] += fy
        slot_arms(tb, w, at, r, tb.row_body[r, 1], fx, fy)


def torque_orders(w, at, F):
    """F gains order `at` of s A + c B for every body."""
    n = w.CS.shape[1]
    for b in range(n):
        w.acc[b] = 0.0
    for i in range(at + 1):
        for b in range(n):
            w.acc[b] += w.SN[i, b] * w.A[at - i, b] + w.CS[i, b] * w.B[at - i, b]
    for b in range(n):
        F[3 * b + 2] += w.acc[b]


def finish_order(tb, w, j):
    """Everything that follows from q_j: sine, cosine, lines, springs."""
    n = w.CS.shape[1]
    for b in range(n):
        theta = w.QS[j, 3 * b + 2]
        w.DT[j, b] = j * theta
        w.SN[j, b] += w.CS[0, b] * theta
        w.CS[j, b] -= w.SN[0, b] * theta
    slot_orders(tb, w, j)
    spring_orders(tb, w, j)


def expand(tb, t, forward, order, folds, w):
    """Fill w.QS[2..order] from w.QS[0], w.QS[1]; w.G, w.val hold gradients and factor there, w.Z, w.BR the fold's rows.

    `folds` is the number of singular rows: 0 at a regular position.
    """
    n = w.CS.shape[1]
    m = tb.row_kind.shape[0]
    shift = 1 if folds > 0 else 0
    time_series(tb, t, forward, order + 2, w.TF)  # noqa: F821
    w.LM[: order + 2, :] = 0.0
    w.FX[0, :] = 0.0
    w.FY[0, :] = 0.0
    trigonometry(w.QS[0], w.CS[0], w.SN[0])  # noqa: F821
    for b in range(n):
        w.DT[0, b] = 0.0
        w.SN[1, b] = 0.0
        w.CS[1, b] = 0.0
        w.A[0, b] = 0.0
        w.B[0, b] = 0.0
    slot_orders(tb, w, 0)
    spring_orders(tb, w, 0)
    for j in range(2, order + 2):
        w.QS[j, :] = 0.0
    finish_order(tb, w, 1)
    for k in range(order - 1):
        j = k + 2
        at = k + shift
        alpha = float(j * (j - 1))
        force_orders(tb, w, k, at, w.F)
        slot_forces(tb, w, at, w.F)
        torque_orders(w, at, w.F)
        angle_orders(w, j, j)
        slot_orders(tb, w, j)
        row_orders(tb, w, j, w.rhs)
        for i in range(w.F.shape[0]):
            w.u[i] = w.F[i] * tb.inverse_mass[i] / alpha
        if folds > 0:
            fold_rows(tb, w, j, folds)
        times_gradients(tb, w.G, w.u, w.mu)  # noqa: F821
        for r in range(m):
            w.mu[r] = w.mu[r] + w.rhs[r] if w.skip[r] == 0 else 0.0
        if folds > 0:
            fold_solve(tb, w, folds)
        else:
            solve(tb, w.val, w.mu)  # noqa: F821
        w.F[:] = 0.0
        add_transposed(tb, w.G, w.mu, 1.0, w.F)  # noqa: F821
        for p in range(folds):
            for i in range(w.F.shape[0]):
                w.F[i] += w.BR[p, i] * w.nu[p]
        for i in range(w.F.shape[0]):
            w.QS[j, i] = w.u[i] - w.F[i] * tb.inverse_mass[i]
        for r in range(m):
            w.mu[r] *= alpha
            add_multiplier(tb, w, at, r, w.mu[r])
        add_slot_multipliers(tb, w, at, 0, w.mu)
        if folds > 0:
            fold_multipliers(tb, w, at - 1, folds, alpha)
        finish_order(tb, w, j)


def fold_rows(tb, w, j, folds):
    """Order j + 1 of Z^T g with q_j and q_{j+1} left out: w.nu; the part of q_j is B q_j."""
    m = tb.row_kind.shape[0]
    angle_orders(w, j + 1, j)
    slot_orders(tb, w, j + 1)
    row_orders(tb, w, j + 1, w.mu)
    for p in range(folds):
        value = 0.0
        for r in range(m):
            value += w.Z[p, r] * w.mu[r]
        for i in range(w.u.shape[0]):
            value += w.BR[p, i] * w.u[i]
        w.nu[p] = value


def fold_solve(tb, w, folds):
    """Bordered solve: in come the regular right-hand side in w.mu and the one of the rows B in w.nu; out the multipliers."""
    m = tb.row_kind.shape[0]
    for p in range(folds):
        for r in range(m):
            w.nu[p] -= w.Y[p, r] * w.mu[r]
    small_solve(w.border, folds, w.nu, w.small)
    solve(tb, w.val, w.mu)  # noqa: F821
    for p in range(folds):
        for r in range(m):
            w.mu[r] -= w.Y[p, r] * w.nu[p]


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


def fold_multipliers(tb, w, at, folds, alpha):
    """The multipliers Z nu belong one order below the regular ones."""
    m = tb.row_kind.shape[0]
    for r in range(m):
        value = 0.0
        for p in range(folds):
            value += w.Z[p, r] * w.nu[p]
        w.mu[r] = alpha * value
        if value != 0.0:
            add_multiplier(tb, w, at, r, w.mu[r])
    add_slot_multipliers(tb, w, at, 0, w.mu)
    add_slot_multipliers(tb, w, at + 1, 1, w.mu)


FUNCTIONS = (
    angle_orders,
    slot_orders,
    row_orders,
    spring_orders,
    force_orders,
    slot_forces,
    slot_arms,
    add_multiplier,
    add_slot_multipliers,
    torque_orders,
    finish_order,
    expand,
    fold_rows,
    fold_solve,
    small_solve,
    fold_multipliers,
)
