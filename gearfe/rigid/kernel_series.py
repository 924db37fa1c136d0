# mypy: ignore-errors
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

from .kernel_rows import add_transposed, fill, solve, time_series, times_gradients, trigonometry


def angle_orders(bodies, j, known):
    """Orders j of sine and cosine from the orders of theta below `known`: what theta_j itself adds comes later."""
    n = bodies.CS.shape[1]
    for b in range(n):
        bodies.SN[j, b] = 0.0
        bodies.CS[j, b] = 0.0
    for i in range(1, known):
        for b in range(n):
            d = bodies.DT[i, b]
            bodies.SN[j, b] += d * bodies.CS[j - i, b]
            bodies.CS[j, b] -= d * bodies.SN[j - i, b]
    for b in range(n):
        bodies.SN[j, b] /= j
        bodies.CS[j, b] /= j


def slot_orders(rows, QS, bodies, lines, j):
    """Orders j of the normal n and the distance D of every moving line, from the orders j of q, sine and cosine."""
    for k in range(rows.lines.shape[0]):
        r = rows.lines[k]
        a = rows.body[r, 0]
        b = rows.body[r, 1]
        lines.NX[j, k] = bodies.CS[j, a] * rows.slot[r, 0] - bodies.SN[j, a] * rows.slot[r, 1]
        lines.NY[j, k] = bodies.SN[j, a] * rows.slot[r, 0] + bodies.CS[j, a] * rows.slot[r, 1]
        rx = bodies.CS[j, b] * rows.slot[r, 2] - bodies.SN[j, b] * rows.slot[r, 3]
        ry = bodies.SN[j, b] * rows.slot[r, 2] + bodies.CS[j, b] * rows.slot[r, 3]
        lines.DX[j, k] = QS[j, 3 * b] + rx - QS[j, 3 * a]
        lines.DY[j, k] = QS[j, 3 * b + 1] + ry - QS[j, 3 * a + 1]


def row_orders(rows, TF, bodies, lines, j, out):
    """Order j >= 2 of every constraint row without the part of q_j."""
    for r in range(rows.kind.shape[0]):
        value = 0.0
        if rows.time[r] >= 0:
            value = -TF[rows.time[r], j]
        if rows.kind[r] == 0:
            for side in range(2):
                b = rows.body[r, side]
                value += rows.factor[r, side, 3] * bodies.CS[j, b] + rows.factor[r, side, 4] * bodies.SN[j, b]
        out[r] = value
    for k in range(rows.lines.shape[0]):
        value = 0.0
        for i in range(j + 1):
            value += lines.NX[i, k] * lines.DX[j - i, k] + lines.NY[i, k] * lines.DY[j - i, k]
        out[rows.lines[k]] += value


def spring_orders(forces, QS, bodies, spans, j):
    """Order j of the span D, length L and 1/L of every spring."""
    for k in range(forces.spring_body.shape[0]):
        a = forces.spring_body[k, 0]
        b = forces.spring_body[k, 1]
        p = forces.spring_point[k]
        spans.EX[j, k] = (
            QS[j, 3 * b] - QS[j, 3 * a] + bodies.CS[j, b] * p[2] - bodies.SN[j, b] * p[3] - bodies.CS[j, a] * p[0] + bodies.SN[j, a] * p[1]
        )
        spans.EY[j, k] = (
            QS[j, 3 * b + 1] - QS[j, 3 * a + 1] + bodies.SN[j, b] * p[2] + bodies.CS[j, b] * p[3]
            - bodies.SN[j, a] * p[0] - bodies.CS[j, a] * p[1]
        )  # fmt: skip
        square = 0.0
        for i in range(j + 1):
            square += spans.EX[i, k] * spans.EX[j - i, k] + spans.EY[i, k] * spans.EY[j - i, k]
        if j == 0:
            spans.EL[0, k] = np.sqrt(square)
            spans.EI[0, k] = 1.0 / spans.EL[0, k]
        else:
            for i in range(1, j):
                square -= spans.EL[i, k] * spans.EL[j - i, k]
            spans.EL[j, k] = 0.5 * square * spans.EI[0, k]
            inverse = 0.0
            for i in range(1, j + 1):
                inverse += spans.EL[i, k] * spans.EI[j - i, k]
            spans.EI[j, k] = -inverse * spans.EI[0, k]


def force_orders(forces, QS, TF, bodies, spans, k, at, F):
    """Order k of all applied forces: F gets what does not turn with a body, A and B (at row `at`) what does."""
    n = bodies.CS.shape[1]
    for i in range(F.shape[0]):
        F[i] = forces.weight[i] if k == 0 else 0.0
    for b in range(n):
        bodies.A[at, b] = 0.0
        bodies.B[at, b] = 0.0
    for e in range(forces.spring_body.shape[0]):
        a = forces.spring_body[e, 0]
        b = forces.spring_body[e, 1]
        rigid = forces.spring_factor[e, 0]
        loss = forces.spring_factor[e, 1]
        value = -rigid * forces.spring_factor[e, 2] * spans.EI[k, e]
        if k == 0:
            value += rigid
        if loss != 0.0:
            for i in range(k + 1):
                value += loss * (i + 1) * spans.EL[i + 1, e] * spans.EI[k - i, e]
        spans.EF[k, e] = value
        fx = 0.0
        fy = 0.0
        for i in range(k + 1):
            fx += spans.EF[i, e] * spans.EX[k - i, e]
            fy += spans.EF[i, e] * spans.EY[k - i, e]
        p = forces.spring_point[e]
        F[3 * a] += fx
        F[3 * a + 1] += fy
        F[3 * b] -= fx
        F[3 * b + 1] -= fy
        bodies.A[at, a] -= p[0] * fx + p[1] * fy
        bodies.B[at, a] += p[0] * fy - p[1] * fx
        bodies.A[at, b] += p[2] * fx + p[3] * fy
        bodies.B[at, b] -= p[2] * fy - p[3] * fx
    for e in range(forces.linear_coordinate.shape[0]):
        i = forces.linear_coordinate[e, 0]
        j = forces.linear_coordinate[e, 1]
        value = -forces.linear_factor[e, 0] * (QS[k, i] - QS[k, j])
        value -= forces.linear_factor[e, 1] * (k + 1) * (QS[k + 1, i] - QS[k + 1, j])
        if k == 0:
            value += forces.linear_factor[e, 0] * forces.linear_factor[e, 2]
        F[i] += value
        F[j] -= value
    for e in range(forces.load_body.shape[0]):
        b = forces.load_body[e]
        fx = TF[forces.load_time[e, 0], k]
        fy = TF[forces.load_time[e, 1], k]
        F[3 * b] += fx
        F[3 * b + 1] += fy
        bodies.A[at, b] -= forces.load_point[e, 0] * fx + forces.load_point[e, 1] * fy
        bodies.B[at, b] += forces.load_point[e, 0] * fy - forces.load_point[e, 1] * fx
    for e in range(forces.moment_time.shape[0]):
        value = TF[forces.moment_time[e], k]
        F[3 * forces.moment_body[e, 0] + 2] += value
        F[3 * forces.moment_body[e, 1] + 2] -= value


def slot_forces(rows, LM, bodies, lines, at, F):
    """Known part of order `at` of the forces of moving lines, from the multipliers below that order."""
    for k in range(rows.lines.shape[0]):
        r = rows.lines[k]
        fx = 0.0
        fy = 0.0
        for i in range(1, at + 1):
            fx += lines.NX[i, k] * LM[at - i, r]
            fy += lines.NY[i, k] * LM[at - i, r]
        lines.FX[at, k] = fx
        lines.FY[at, k] = fy
        turn = 0.0
        for i in range(at + 1):
            turn += lines.FX[i, k] * lines.DY[at - i, k] - lines.FY[i, k] * lines.DX[at - i, k]
        a = rows.body[r, 0]
        b = rows.body[r, 1]
        F[3 * a] += fx
        F[3 * a + 1] += fy
        F[3 * a + 2] -= turn
        F[3 * b] -= fx
        F[3 * b + 1] -= fy
        slot_arms(rows, bodies, at, r, b, fx, fy)


def slot_arms(rows, bodies, at, r, b, fx, fy):
    """Reaction (fx, fy) of the moving line r on the point of body b, in the sums A and B."""
    x = rows.slot[r, 2]
    y = rows.slot[r, 3]
    bodies.A[at, b] += x * fx + y * fy
    bodies.B[at, b] -= x * fy - y * fx


def add_multipliers(rows, LM, bodies, lines, at, values):
    """Multipliers `values` (one per row) join order `at`: what turns with a body goes into A, B, and into the lines' forces."""
    for r in range(values.shape[0]):
        value = values[r]
        LM[at, r] += value
        if rows.kind[r] == 0:
            for side in range(2):
                b = rows.body[r, side]
                bodies.A[at, b] += rows.factor[r, side, 3] * value
                bodies.B[at, b] -= rows.factor[r, side, 4] * value
    add_line_multipliers(rows, bodies, lines, at, 0, values)


def add_line_multipliers(rows, bodies, lines, at, i, values):
    """Order `at` of the force of every moving line gains n_i times its multiplier."""
    for k in range(rows.lines.shape[0]):
        r = rows.lines[k]
        fx = lines.NX[i, k] * values[r]
        fy = lines.NY[i, k] * values[r]
        lines.FX[at, k] += fx
        lines.FY[at, k] += fy
        slot_arms(rows, bodies, at, r, rows.body[r, 1], fx, fy)


def torque_orders(bodies, at, F):
    """F gains order `at` of s A + c B for every body."""
    n = bodies.CS.shape[1]
    for b in range(n):
        bodies.acc[b] = 0.0
    for i in range(at + 1):
        for b in range(n):
            bodies.acc[b] += bodies.SN[i, b] * bodies.A[at - i, b] + bodies.CS[i, b] * bodies.B[at - i, b]
    for b in range(n):
        F[3 * b + 2] += bodies.acc[b]


def finish_order(rows, forces, QS, bodies, lines, spans, j):
    """Everything that follows from q_j: sine, cosine, lines, springs."""
    n = bodies.CS.shape[1]
    for b in range(n):
        theta = QS[j, 3 * b + 2]
        bodies.DT[j, b] = j * theta
        bodies.SN[j, b] += bodies.CS[0, b] * theta
        bodies.CS[j, b] -= bodies.SN[0, b] * theta
    slot_orders(rows, QS, bodies, lines, j)
    spring_orders(forces, QS, bodies, spans, j)


def expand(tb, t, forward, order, folds, w):
    """Fill w.QS[2..order] from w.QS[0], w.QS[1]; w.G, w.val hold gradients and factor there, w.fold the fold's rows.

    `folds` is the number of singular rows: 0 at a regular position.
    """
    rows, plan, forces, mass = tb.rows, tb.plan, tb.forces, tb.mass
    bodies, lines, spans, fold = w.bodies, w.lines, w.spans, w.fold
    QS, TF, LM, G, val, skip = w.QS, w.TF, w.LM, w.G, w.val, w.skip
    mu, rhs, F, u = w.mu, w.rhs, w.F, w.u
    shift = 1 if folds > 0 else 0
    time_series(tb.times, t, forward, order + 2, TF)
    start_series(rows, forces, order, QS, LM, bodies, lines, spans)
    for k in range(order - 1):
        j = k + 2
        at = k + shift
        alpha = float(j * (j - 1))
        force_orders(forces, QS, TF, bodies, spans, k, at, F)
        slot_forces(rows, LM, bodies, lines, at, F)
        torque_orders(bodies, at, F)
        angle_orders(bodies, j, j)
        slot_orders(rows, QS, bodies, lines, j)
        row_orders(rows, TF, bodies, lines, j, rhs)
        for i in range(F.shape[0]):
            u[i] = F[i] * mass[i] / alpha
        if folds > 0:
            fold_rows(rows, QS, TF, bodies, lines, fold, mu, u, j, folds)
        times_gradients(rows, G, u, mu)
        for r in range(mu.shape[0]):
            mu[r] = mu[r] + rhs[r] if skip[r] == 0 else 0.0
        if folds > 0:
            fold_solve(plan, val, fold, mu, folds)
        else:
            solve(plan, val, mu)
        fill(F, 0.0)
        add_transposed(rows, G, mu, 1.0, F)
        for p in range(folds):
            for i in range(F.shape[0]):
                F[i] += fold.B[p, i] * fold.nu[p]
        for i in range(F.shape[0]):
            QS[j, i] = u[i] - F[i] * mass[i]
        for r in range(mu.shape[0]):
            mu[r] *= alpha
        add_multipliers(rows, LM, bodies, lines, at, mu)
        if folds > 0:  # the multipliers Z nu belong one order below the regular ones
            for r in range(mu.shape[0]):
                mu[r] = 0.0
                for p in range(folds):
                    mu[r] += alpha * fold.Z[p, r] * fold.nu[p]
            add_multipliers(rows, LM, bodies, lines, at - 1, mu)
            add_line_multipliers(rows, bodies, lines, at, 1, mu)
        finish_order(rows, forces, QS, bodies, lines, spans, j)


def start_series(rows, forces, order, QS, LM, bodies, lines, spans):
    """Orders 0 and 1 from position and velocity; all others zero."""
    for j in range(2, order + 2):
        fill(QS[j], 0.0)
    for j in range(order + 2):
        fill(LM[j], 0.0)
    fill(lines.FX[0], 0.0)
    fill(lines.FY[0], 0.0)
    trigonometry(QS[0], bodies.CS[0], bodies.SN[0])
    fill(bodies.DT[0], 0.0)
    fill(bodies.SN[1], 0.0)
    fill(bodies.CS[1], 0.0)
    fill(bodies.A[0], 0.0)
    fill(bodies.B[0], 0.0)
    slot_orders(rows, QS, bodies, lines, 0)
    spring_orders(forces, QS, bodies, spans, 0)
    finish_order(rows, forces, QS, bodies, lines, spans, 1)


def fold_rows(rows, QS, TF, bodies, lines, fold, work, u, j, folds):
    """Order j + 1 of Z^T g with q_j and q_{j+1} left out: fold.nu; the part of q_j is B q_j."""
    angle_orders(bodies, j + 1, j)
    slot_orders(rows, QS, bodies, lines, j + 1)
    row_orders(rows, TF, bodies, lines, j + 1, work)
    for p in range(folds):
        value = 0.0
        for r in range(work.shape[0]):
            value += fold.Z[p, r] * work[r]
        for i in range(u.shape[0]):
            value += fold.B[p, i] * u[i]
        fold.nu[p] = value


def fold_solve(plan, val, fold, mu, folds):
    """Bordered solve: in come the regular right-hand side in mu and the one of the rows B in nu; out the multipliers."""
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
    spring_orders,
    force_orders,
    slot_forces,
    slot_arms,
    add_multipliers,
    add_line_multipliers,
    torque_orders,
    finish_order,
    expand,
    start_series,
    fold_rows,
    fold_solve,
    small_solve,
)
