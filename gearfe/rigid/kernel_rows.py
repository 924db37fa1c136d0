"""Constraint rows of a planar scene: residuals, gradients, S = G M^-1 G^T = L D L^T. Plain loops, compiled when numba is.

The functions here are written in the subset of Python that numba compiles; `gearfe.rigid.compiled` binds them together.
Coordinates q hold (x, y, theta) of every body and of the ground, shape (3 (n + 1),).
"""

from __future__ import annotations

import math

import numpy as np


def trigonometry(q, c, s):
    """Cosine and sine of every angle."""
    for b in range(c.shape[0]):
        c[b] = math.cos(q[3 * b + 2])
        s[b] = math.sin(q[3 * b + 2])


def gradients(tb, q, c, s, G):
    """G[r, side] = gradient of row r with respect to (x, y, theta) of its body on that side; shape (m, 2, 3)."""
    for r in range(tb.row_kind.shape[0]):
        if tb.row_kind[r] == 0:
            for a in range(2):
                b = tb.row_body[r, a]
                G[r, a, 0] = tb.row_factor[r, a, 0]
                G[r, a, 1] = tb.row_factor[r, a, 1]
                G[r, a, 2] = tb.row_factor[r, a, 2] - tb.row_factor[r, a, 3] * s[b] + tb.row_factor[r, a, 4] * c[b]
        else:
            a = tb.row_body[r, 0]
            b = tb.row_body[r, 1]
            nx = c[a] * tb.row_slot[r, 0] - s[a] * tb.row_slot[r, 1]
            ny = s[a] * tb.row_slot[r, 0] + c[a] * tb.row_slot[r, 1]
            rx = c[b] * tb.row_slot[r, 2] - s[b] * tb.row_slot[r, 3]
            ry = s[b] * tb.row_slot[r, 2] + c[b] * tb.row_slot[r, 3]
            dx = q[3 * b] + rx - q[3 * a]
            dy = q[3 * b + 1] + ry - q[3 * a + 1]
            G[r, 0, 0] = -nx
            G[r, 0, 1] = -ny
            G[r, 0, 2] = nx * dy - ny * dx
            G[r, 1, 0] = nx
            G[r, 1, 1] = ny
            G[r, 1, 2] = ny * rx - nx * ry


def gradient_rates(tb, q, v, c, s, H):
    """H = dG/dt along the velocity v, same layout as G."""
    for r in range(tb.row_kind.shape[0]):
        if tb.row_kind[r] == 0:
            for a in range(2):
                b = tb.row_body[r, a]
                w = v[3 * b + 2]
                H[r, a, 0] = 0.0
                H[r, a, 1] = 0.0
                H[r, a, 2] = -w * (tb.row_factor[r, a, 3] * c[b] + tb.row_factor[r, a, 4] * s[b])
        else:
            a = tb.row_body[r, 0]
            b = tb.row_body[r, 1]
            wa = v[3 * a + 2]
            wb = v[3 * b + 2]
            nx = c[a] * tb.row_slot[r, 0] - s[a] * tb.row_slot[r, 1]
            ny = s[a] * tb.row_slot[r, 0] + c[a] * tb.row_slot[r, 1]
            rx = c[b] * tb.row_slot[r, 2] - s[b] * tb.row_slot[r, 3]
            ry = s[b] * tb.row_slot[r, 2] + c[b] * tb.row_slot[r, 3]
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


def residuals(tb, q, c, s, f, g):
    """Value of every row; f holds the value of every time function."""
    for r in range(tb.row_kind.shape[0]):
        a = tb.row_body[r, 0]
        b = tb.row_body[r, 1]
        value = tb.row_constant[r]
        if tb.row_time[r] >= 0:
            value -= f[tb.row_time[r]]
        if tb.row_kind[r] == 0:
            for side in range(2):
                k = tb.row_body[r, side]
                value += tb.row_factor[r, side, 0] * q[3 * k] + tb.row_factor[r, side, 1] * q[3 * k + 1]
                value += tb.row_factor[r, side, 2] * q[3 * k + 2]
                value += tb.row_factor[r, side, 3] * c[k] + tb.row_factor[r, side, 4] * s[k]
        else:
            nx = c[a] * tb.row_slot[r, 0] - s[a] * tb.row_slot[r, 1]
            ny = s[a] * tb.row_slot[r, 0] + c[a] * tb.row_slot[r, 1]
            dx = q[3 * b] + c[b] * tb.row_slot[r, 2] - s[b] * tb.row_slot[r, 3] - q[3 * a]
            dy = q[3 * b + 1] + s[b] * tb.row_slot[r, 2] + c[b] * tb.row_slot[r, 3] - q[3 * a + 1]
            value += nx * dx + ny * dy
        g[r] = value


def times_gradients(tb, G, u, out):
    """out = G u, one number per row."""
    for r in range(tb.row_kind.shape[0]):
        a = 3 * tb.row_body[r, 0]
        b = 3 * tb.row_body[r, 1]
        out[r] = (
            G[r, 0, 0] * u[a] + G[r, 0, 1] * u[a + 1] + G[r, 0, 2] * u[a + 2]
            + G[r, 1, 0] * u[b] + G[r, 1, 1] * u[b + 1] + G[r, 1, 2] * u[b + 2]
        )  # fmt: skip


def add_transposed(tb, G, mu, factor, out):
    """out += factor G^T mu."""
    for r in range(tb.row_kind.shape[0]):
        for side in range(2):
            b = 3 * tb.row_body[r, side]
            value = factor * mu[r]
            out[b] += G[r, side, 0] * value
            out[b + 1] += G[r, side, 1] * value
            out[b + 2] += G[r, side, 2] * value


def factorise(tb, G, skip, val, diag):
    """L D L^T of S in val (m diagonal numbers, then the entries of L); rows with skip != 0 become unit rows.

    Returns the smallest pivot relative to its diagonal of S, and its row (-1 when there is none).
    """
    m = tb.row_kind.shape[0]
    val[:] = 0.0
    for e in range(tb.entry.shape[0]):
        r = tb.entry[e, 1]
        s = tb.entry[e, 3]
        if skip[r] == 0 and skip[s] == 0:
            a = tb.entry[e, 2]
            b = tb.entry[e, 4]
            k = 3 * tb.entry[e, 5]
            val[tb.entry[e, 0]] += (
                G[r, a, 0] * G[s, b, 0] * tb.inverse_mass[k]
                + G[r, a, 1] * G[s, b, 1] * tb.inverse_mass[k + 1]
                + G[r, a, 2] * G[s, b, 2] * tb.inverse_mass[k + 2]
            )
    least = 1.0
    where = -1
    for r in range(m):
        if skip[r] != 0 or val[r] <= 0.0:
            diag[r] = 1.0
            if skip[r] != 0:
                val[r] = 1.0
        else:
            diag[r] = val[r]
    for j in range(m):
        ratio = val[j] / diag[j]
        if skip[j] == 0 and ratio < least:
            least = ratio
            where = j
        if ratio < 1e-30:
            val[j] = 1e-30 * diag[j]
        d = val[j]
        for e in range(tb.ldl_start[j], tb.ldl_start[j + 1]):
            val[m + e] /= d
        for u in range(tb.update_start[j], tb.update_start[j + 1]):
            val[tb.update[u, 0]] -= val[m + tb.update[u, 1]] * val[m + tb.update[u, 2]] * d
    return least, where


def solve(tb, val, x):
    """x := S^-1 x with the factor of `factorise`."""
    m = tb.row_kind.shape[0]
    for j in range(m):
        xj = x[j]
        for e in range(tb.ldl_start[j], tb.ldl_start[j + 1]):
            x[tb.ldl_row[e]] -= val[m + e] * xj
    for j in range(m):
        x[j] /= val[j]
    for j in range(m - 1, -1, -1):
        xj = x[j]
        for e in range(tb.ldl_start[j], tb.ldl_start[j + 1]):
            xj -= val[m + e] * x[tb.ldl_row[e]]
        x[j] = xj


def time_series(tb, t, forward, orders, out):
    """Taylor coefficients of every time function at t, on the piece ahead in the direction of travel; (functions, orders)."""
    width = tb.piece_factor.shape[1]
    for k in range(tb.piece_first.shape[0] - 1):
        p = tb.piece_first[k]
        slack = 1e-13 * (1.0 + abs(t))
        for i in range(tb.piece_first[k] + 1, tb.piece_first[k + 1]):
            begin = tb.piece_start[i]
            if (forward and t >= begin - slack) or (not forward and t > begin + slack):
                p = i
        d = t - tb.piece_origin[p]
        for j in range(orders):
            out[k, j] = 0.0
        for j in range(width - 1, -1, -1):  # Horner with a growing Taylor shift
            for i in range(min(orders - 1, width), 0, -1):
                out[k, i] = out[k, i] * d + out[k, i - 1]
            out[k, 0] = out[k, 0] * d + tb.piece_factor[p, j]
        for i in range(tb.sine_first[k], tb.sine_first[k + 1]):
            scale = tb.sine[i, 0]
            phase = tb.sine[i, 1] * t + tb.sine[i, 2]
            for j in range(orders):
                out[k, j] += scale * math.sin(phase + 0.5 * math.pi * j)
                scale *= tb.sine[i, 1] / (j + 1)


def least_norm(tb, G, val, skip, rhs, work, u):
    """u -= M^-1 G^T S^-1 rhs: the smallest change (in the mass norm) that lowers G u by rhs. Returns its largest entry."""
    for r in range(rhs.shape[0]):
        if skip[r] != 0:
            rhs[r] = 0.0
    solve(tb, val, rhs)
    work[:] = 0.0
    add_transposed(tb, G, rhs, 1.0, work)
    biggest = 0.0
    for i in range(u.shape[0]):
        change = work[i] * tb.inverse_mass[i]
        u[i] -= change
        biggest = max(biggest, abs(change))
    return biggest


FUNCTIONS = (
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
