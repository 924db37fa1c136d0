# mypy: ignore-errors
"""Compiled loop of the explicit method of order 8 in modal coordinates; the same steps as `explicit.step_through`.

`law(t, u, du, parameters, out)` is bound by name: forces `out` along the directions, from u = W y + offset and
du = W y'.
"""

from __future__ import annotations

import math

import numpy as np


def modal_rhs(squares, damping, diagonal, full, constant, W, offset, first, parameters, t, y, dy, u, du, out):
    """dy of the state y = (coordinates, velocities)."""
    n = squares.shape[0]
    for i in range(n):
        dy[i] = y[n + i]
        dy[n + i] = constant[i] - squares[i] * y[i] - diagonal[i] * y[n + i]
    if full:
        for i in range(n):
            value = 0.0
            for j in range(n):
                value += damping[i, j] * y[n + j]
            dy[n + i] -= value - diagonal[i] * y[n + i]
    rows = W.shape[0]
    p = 0
    while p + 3 < rows:  # four directions at a time: y and dy are read once for all
        a0, a1, a2, a3 = offset[p], offset[p + 1], offset[p + 2], offset[p + 3]
        b0, b1, b2, b3 = 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            value, rate = y[i], y[n + i]
            a0 += W[p, i] * value
            a1 += W[p + 1, i] * value
            a2 += W[p + 2, i] * value
            a3 += W[p + 3, i] * value
            b0 += W[p, i] * rate
            b1 += W[p + 1, i] * rate
            b2 += W[p + 2, i] * rate
            b3 += W[p + 3, i] * rate
        u[p], u[p + 1], u[p + 2], u[p + 3] = a0, a1, a2, a3
        du[p], du[p + 1], du[p + 2], du[p + 3] = b0, b1, b2, b3
        p += 4
    while p < rows:
        place = offset[p]
        speed = 0.0
        for i in range(n):
            place += W[p, i] * y[i]
            speed += W[p, i] * y[n + i]
        u[p] = place
        du[p] = speed
        p += 1
    for k in range(first.shape[0] - 1):
        a = first[k]
        b = first[k + 1]
        law(t, u[a:b], du[a:b], parameters[k], out[a:b])  # noqa: F821
    p = 0
    while p + 3 < rows:
        f0, f1, f2, f3 = out[p], out[p + 1], out[p + 2], out[p + 3]
        for i in range(n):
            dy[n + i] += W[p, i] * f0 + W[p + 1, i] * f1 + W[p + 2, i] * f2 + W[p + 3, i] * f3
        p += 4
    while p < rows:
        for i in range(n):
            dy[n + i] += W[p, i] * out[p]
        p += 1


def no_corner(t, sign, u, du, parameters):  # noqa: ARG001
    """A law without corners."""
    return 1e300


def next_corner(W, offset, first, parameters, t, sign, y, u, du):
    """Time to the nearest corner of all laws from the state y; u and du are scratch."""
    rows = W.shape[0]
    n = W.shape[1]
    for p in range(rows):
        place = offset[p]
        speed = 0.0
        for i in range(n):
            place += W[p, i] * y[i]
            speed += W[p, i] * y[n + i]
        u[p] = place
        du[p] = speed
    nearest = 1e300
    for k in range(first.shape[0] - 1):
        a = first[k]
        b = first[k + 1]
        nearest = min(nearest, corner(t, sign, u[a:b], du[a:b], parameters[k]))  # noqa: F821
    return nearest


def modal_steps(
    squares, damping, diagonal, full, constant, W, offset, first, parameters, A, C, E3, E5, D,
    t, t1, y, h, scale, breaks, tolerance, longest, T, Y, P,
):  # fmt: skip
    """Steps until t1 or until the arrays are full: (status, steps, time, next step, evaluations)."""
    n2 = y.shape[0]
    n = n2 // 2
    K = np.zeros((16, n2))
    z = np.empty(n2)
    u = np.empty(W.shape[0])
    du = np.empty(W.shape[0])
    out = np.zeros(W.shape[0])
    limit = np.empty(n2)
    five = np.empty(n2)
    three = np.empty(n2)
    sign = 1.0 if t1 >= t else -1.0
    begin = t
    modal_rhs(squares, damping, diagonal, full, constant, W, offset, first, parameters, t, y, K[0], u, du, out)
    calls = 1
    count = 0
    status = 0
    while sign * (t1 - t) > 0.0:
        if count >= T.shape[0]:
            status = 2
            break
        goal = t1
        for i in range(breaks.shape[0]):
            if sign * (breaks[i] - t) > 1e-14 * max(1.0, abs(t)) and sign * (goal - breaks[i]) > 0.0:
                goal = breaks[i]
        step = min(h, longest, abs(goal - t))
        fixed = step == abs(goal - t)
        ahead = next_corner(W, offset, first, parameters, t, sign, y, u, du)
        whole = step
        if ahead < step:  # the step ends at a corner of the law
            step = ahead
            fixed = False
        elif ahead < 2.0 * step:  # two equal steps to the corner, instead of one and a sliver
            step = 0.5 * ahead
            fixed = False
        if step < 1e-14 * max(abs(t), abs(t1 - begin)):
            status = 1
            break
        d = sign * step
        for s in range(1, 13):
            for i in range(n2):
                z[i] = y[i]
            for r in range(s):
                factor = d * A[s, r]
                if factor != 0.0:
                    for i in range(n2):
                        z[i] += factor * K[r, i]
            modal_rhs(
                squares, damping, diagonal, full, constant, W, offset, first, parameters,
                t + C[s] * d, z, K[s], u, du, out,
            )  # fmt: skip
        calls += 12
        top_q = 0.0
        top_v = 0.0
        for i in range(n2):
            limit[i] = max(scale[i], abs(z[i]), step * abs(K[12, i])) * tolerance + 1e-300
            if i < n:
                top_q = max(top_q, limit[i])
            else:
                top_v = max(top_v, limit[i])
        for i in range(n2):
            five[i] = 0.0
            three[i] = 0.0
        for s in range(13):
            if E5[s] != 0.0 or E3[s] != 0.0:
                for i in range(n2):
                    five[i] += E5[s] * K[s, i]
                    three[i] += E3[s] * K[s, i]
        for i in range(n2):
            reach = 1.0 / (limit[i] + 1e-6 * (top_q if i < n else top_v))
            five[i] *= reach
            three[i] *= reach
        big = 0.0
        small = 0.0
        for i in range(n2):
            big += five[i] * five[i]
            small += three[i] * three[i]
        error = 0.0
        if big > 0.0:
            error = step * big / math.sqrt((big + 0.01 * small) * n2)
        if not np.isfinite(error):
            h = 0.2 * step
            if step < 1e-12 * abs(t1 - begin):
                status = 4
                break
            continue
        if error > 1.0:
            h = step * max(0.2, 0.9 * error ** (-0.125))
            continue
        for i in range(n2):
            Y[count, i] = z[i]
        for s in range(13, 16):
            for i in range(n2):
                z[i] = y[i]
            for r in range(s):
                factor = d * A[s, r]
                if factor != 0.0:
                    for i in range(n2):
                        z[i] += factor * K[r, i]
            modal_rhs(
                squares, damping, diagonal, full, constant, W, offset, first, parameters,
                t + C[s] * d, z, K[s], u, du, out,
            )  # fmt: skip
        calls += 3
        for i in range(n2):
            change = Y[count, i] - y[i]
            P[count, 0, i] = change
            P[count, 1, i] = d * K[0, i] - change
            P[count, 2, i] = 2.0 * change - d * (K[12, i] + K[0, i])
        for k in range(4):
            for i in range(n2):
                P[count, 3 + k, i] = 0.0
            for s in range(16):
                factor = d * D[k, s]
                if factor != 0.0:
                    for i in range(n2):
                        P[count, 3 + k, i] += factor * K[s, i]
        t = goal if fixed else t + d
        T[count] = t
        for i in range(n2):
            y[i] = Y[count, i]
            scale[i] = max(scale[i], abs(y[i]))
            K[0, i] = K[12, i]
        if fixed:  # a time function may change its piece here
            modal_rhs(squares, damping, diagonal, full, constant, W, offset, first, parameters, t, y, K[0], u, du, out)
            calls += 1
        count += 1
        grown = step * min(6.0, 0.9 * max(error, 1e-12) ** (-0.125))
        if step < whole or (fixed and error <= 0.01):  # shortened for other reasons than its error
            h = max(whole if error <= 0.5 else 0.0, grown)
        else:
            h = grown
    return status, count, t, h, calls


FUNCTIONS = (modal_rhs, next_corner, modal_steps)
