# mypy: ignore-errors
"""Constraint rows of a planar scene: residuals, gradients, S = G M^-1 G^T = L D L^T. Plain loops, compiled
when numba is.

The functions here are written in the subset of Python that numba compiles; `gearfe.rigid.compiled` binds them together.
Coordinates q hold (x, y, theta) of every body and of the ground, shape (3 (n + 1),).
"""

from __future__ import annotations

import math

import numpy as np


def fill(x, value):
    """x := value (a loop compiles far faster than a slice assignment, which brings its error messages along)."""
    for i in range(x.shape[0]):
        x[i] = value


def copy(x, y):
    """y := x."""
    for i in range(x.shape[0]):
        y[i] = x[i]


def trigonometry(q, c, s):
    """Cosine and sine of every angle."""
    for b in range(c.shape[0]):
        c[b] = math.cos(q[3 * b + 2])
        s[b] = math.sin(q[3 * b + 2])


def gradients(rows, q, c, s, G):
    """G[r, side] = gradient of row r with respect to (x, y, theta) of its body on that side; shape (m, 2, 3)."""
    for r in range(rows.ints.shape[0]):
        if rows.ints[r, 2] == 0:
            for a in range(2):
                b = rows.ints[r, a]
                G[r, a, 0] = rows.reals[r, 5 * a]
                G[r, a, 1] = rows.reals[r, 5 * a + 1]
                G[r, a, 2] = (
                    rows.reals[r, 5 * a + 2] - rows.reals[r, 5 * a + 3] * s[b] + rows.reals[r, 5 * a + 4] * c[b]
                )
        else:
            a = rows.ints[r, 0]
            b = rows.ints[r, 1]
            nx = c[a] * rows.reals[r, 10] - s[a] * rows.reals[r, 11]
            ny = s[a] * rows.reals[r, 10] + c[a] * rows.reals[r, 11]
            rx = c[b] * rows.reals[r, 12] - s[b] * rows.reals[r, 13]
            ry = s[b] * rows.reals[r, 12] + c[b] * rows.reals[r, 13]
            dx = q[3 * b] + rx - q[3 * a]
            dy = q[3 * b + 1] + ry - q[3 * a + 1]
            G[r, 0, 0] = -nx
            G[r, 0, 1] = -ny
            G[r, 0, 2] = nx * dy - ny * dx
            G[r, 1, 0] = nx
            G[r, 1, 1] = ny
            G[r, 1, 2] = ny * rx - nx * ry


def gradient_rates(rows, q, v, c, s, H):
    """H = dG/dt along the velocity v, same layout as G."""
    for r in range(rows.ints.shape[0]):
        if rows.ints[r, 2] == 0:
            for a in range(2):
                b = rows.ints[r, a]
                w = v[3 * b + 2]
                H[r, a, 0] = 0.0
                H[r, a, 1] = 0.0
                H[r, a, 2] = -w * (rows.reals[r, 5 * a + 3] * c[b] + rows.reals[r, 5 * a + 4] * s[b])
        else:
            a = rows.ints[r, 0]
            b = rows.ints[r, 1]
            wa = v[3 * a + 2]
            wb = v[3 * b + 2]
            nx = c[a] * rows.reals[r, 10] - s[a] * rows.reals[r, 11]
            ny = s[a] * rows.reals[r, 10] + c[a] * rows.reals[r, 11]
            rx = c[b] * rows.reals[r, 12] - s[b] * rows.reals[r, 13]
            ry = s[b] * rows.reals[r, 12] + c[b] * rows.reals[r, 13]
            dx = q[3 * b] + rx - q[3 * a]
            dy = q[3 * b + 1] + ry - q[3 * a + 1]
            ux = v[3 * b] - wb * ry - v[3 * a]
            uy = v[3 * b + 1] + wb * rx - v[3 * a + 1]
            H[r, 0, 0] = wa * ny
            H[r, 0, 1] = -wa * nx
            H[r, 0, 2] = nx * uy - ny * ux - wa * (ny * dy + nx * dx)
            H[r, 1, 0] = -wa * ny
            H[r, 1, 1] = wa * nx
            H[r, 1, 2] = wa * (nx * rx + ny * ry) - wb * (ny * ry + nx * rx)


def residuals(rows, q, c, s, f, g):
    """Value of every row; f holds the value of every time function."""
    for r in range(rows.ints.shape[0]):
        a = rows.ints[r, 0]
        b = rows.ints[r, 1]
        value = rows.reals[r, 14]
        if rows.ints[r, 3] >= 0:
            value -= f[rows.ints[r, 3]]
        if rows.ints[r, 2] == 0:
            for side in range(2):
                k = rows.ints[r, side]
                value += rows.reals[r, 5 * side] * q[3 * k] + rows.reals[r, 5 * side + 1] * q[3 * k + 1]
                value += rows.reals[r, 5 * side + 2] * q[3 * k + 2]
                value += rows.reals[r, 5 * side + 3] * c[k] + rows.reals[r, 5 * side + 4] * s[k]
        else:
            nx = c[a] * rows.reals[r, 10] - s[a] * rows.reals[r, 11]
            ny = s[a] * rows.reals[r, 10] + c[a] * rows.reals[r, 11]
            dx = q[3 * b] + c[b] * rows.reals[r, 12] - s[b] * rows.reals[r, 13] - q[3 * a]
            dy = q[3 * b + 1] + s[b] * rows.reals[r, 12] + c[b] * rows.reals[r, 13] - q[3 * a + 1]
            value += nx * dx + ny * dy
        g[r] = value


def times_gradients(rows, G, u, out):
    """out = G u, one number per row."""
    for r in range(rows.ints.shape[0]):
        a = 3 * rows.ints[r, 0]
        b = 3 * rows.ints[r, 1]
        out[r] = (
            G[r, 0, 0] * u[a] + G[r, 0, 1] * u[a + 1] + G[r, 0, 2] * u[a + 2]
            + G[r, 1, 0] * u[b] + G[r, 1, 1] * u[b + 1] + G[r, 1, 2] * u[b + 2]
        )  # fmt: skip


def add_transposed(rows, G, mu, factor, out):
    """out += factor G^T mu."""
    for r in range(rows.ints.shape[0]):
        for side in range(2):
            b = 3 * rows.ints[r, side]
            value = factor * mu[r]
            out[b] += G[r, side, 0] * value
            out[b + 1] += G[r, side, 1] * value
            out[b + 2] += G[r, side, 2] * value


def factorise(rows, plan, mass, G, skip, val, diag, bound):
    """L D L^T of S in val (m reciprocals of D, then the entries of L); rows with skip != 0 become unit rows.

    Rows whose pivot falls below `bound` of their diagonal become unit rows, too, and get skip = 2.
    Returns the smallest pivot relative to its diagonal of S, and its row (-1 when there is none).
    """
    m = rows.ints.shape[0]
    fill(val, 0.0)
    for e in range(plan.entry.shape[0]):
        r = plan.entry[e, 1]
        s = plan.entry[e, 3]
        if skip[r] == 0 and skip[s] == 0:
            a = plan.entry[e, 2]
            b = plan.entry[e, 4]
            k = 3 * plan.entry[e, 5]
            val[plan.entry[e, 0]] += (
                G[r, a, 0] * G[s, b, 0] * mass[k]
                + G[r, a, 1] * G[s, b, 1] * mass[k + 1]
                + G[r, a, 2] * G[s, b, 2] * mass[k + 2]
            )
    least = 1.0
    where = -1
    dropped = False
    for r in range(m):
        if skip[r] != 0 or val[r] <= 0.0:
            diag[r] = 1.0
            if skip[r] != 0:
                val[r] = 1.0
        else:
            diag[r] = val[r]
    for j in range(m):
        ratio = val[j] / diag[j]
        if bound > 0.0 and ratio < bound and skip[j] == 0:  # rounding may leave less than nothing
            skip[j] = 2
            val[j] = 1.0
            dropped = True
            for e in range(plan.start[j], plan.start[j + 1]):
                val[m + e] = 0.0
            continue
        if skip[j] == 0 and ratio < least:
            least = ratio
            where = j
        if ratio < 1e-30:
            val[j] = 1e-30 * diag[j]
        d = val[j]
        for e in range(plan.start[j], plan.start[j + 1]):
            val[m + e] /= d
        for u in range(plan.update_start[j], plan.update_start[j + 1]):
            val[plan.update[u, 0]] -= val[m + plan.update[u, 1]] * val[m + plan.update[u, 2]] * d
    if dropped:
        for e in range(plan.row.shape[0]):
            if skip[plan.row[e]] == 2:
                val[m + e] = 0.0
    for j in range(m):
        val[j] = 1.0 / val[j]
    return least, where


def solve(plan, val, x):
    """x := S^-1 x with the factor of `factorise`."""
    m = x.shape[0]
    for e in range(plan.row.shape[0]):
        x[plan.row[e]] -= val[m + e] * x[plan.column[e]]
    for j in range(m):
        x[j] *= val[j]
    for e in range(plan.row.shape[0] - 1, -1, -1):
        x[plan.column[e]] -= val[m + e] * x[plan.row[e]]


def time_series(times, t, forward, orders, out):
    """Taylor coefficients of every time function at t, on the piece ahead in the direction of travel;
    (functions, orders)."""
    width = times.factor.shape[1]
    for k in range(times.first.shape[0] - 1):
        p = times.first[k]
        slack = 1e-13 * abs(t)
        for i in range(times.first[k] + 1, times.first[k + 1]):
            begin = times.start[i]
            if (forward and t >= begin - slack) or (not forward and t > begin + slack):
                p = i
        d = t - times.origin[p]
        for j in range(orders):
            out[k, j] = 0.0
        for j in range(width - 1, -1, -1):  # Horner with a growing Taylor shift
            for i in range(min(orders - 1, width), 0, -1):
                out[k, i] = out[k, i] * d + out[k, i - 1]
            out[k, 0] = out[k, 0] * d + times.factor[p, j]
        for i in range(times.sine_first[k], times.sine_first[k + 1]):
            scale = times.sine[i, 0]
            phase = times.sine[i, 1] * t + times.sine[i, 2]
            for j in range(orders):
                out[k, j] += scale * math.sin(phase + 0.5 * math.pi * j)
                scale *= times.sine[i, 1] / (j + 1)


def least_norm(rows, plan, mass, G, val, skip, length, rhs, work, u):
    """u -= M^-1 G^T S^-1 rhs: the smallest change (in the mass norm) that lowers G u by rhs. Returns its
    largest entry, in units of `length` and 1 rad."""
    for r in range(rhs.shape[0]):
        if skip[r] != 0:
            rhs[r] = 0.0
    solve(plan, val, rhs)
    fill(work, 0.0)
    add_transposed(rows, G, rhs, 1.0, work)
    biggest = 0.0
    for i in range(u.shape[0]):
        change = work[i] * mass[i]
        u[i] -= change
        biggest = max(biggest, abs(change) / (1.0 if i % 3 == 2 else length))
    return biggest


FUNCTIONS = (
    fill,
    copy,
    trigonometry,
    gradients,
    gradient_rates,
    residuals,
    times_gradients,
    add_transposed,
    factorise,
    solve,
    time_series,
    least_norm,
)
GLOBALS = {"math": math, "np": np}
