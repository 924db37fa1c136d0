# mypy: ignore-errors
"""Taylor series in modal coordinates, compiled: y'' = c - w^2 y - D y' + W^T phi(t, u, u'), u = W y + offset.

With y = sum_j y_j x^j, x = (t - t0) / s running from 0 to 1 over the trial step s, the equation of motion gives

    (j + 2)(j + 1) y_{j+2} = s^2 (c_j - w^2 y_j + W^T phi_j) - s (j + 1) D y_{j+1}

(Hairer, Norsett & Wanner I, Sec. I.8). phi_j comes from the law's own recurrences (`gearfe.rigid.contract.SeriesLaw`),
bound by the names `law_order`, `law_corner`. One order costs two small products with W, half a stage of
a Runge-Kutta method of order 8, and takes the fastest mode further. A step ends where its law has a corner; the number
of orders follows from the terms.
"""

from __future__ import annotations

import math

import numpy as np

#: Orders that are computed in any case: a force that sets in as a polynomial of degree 5 shows up to order 7.
LEAST = 8


def project(W, y, j, out):
    """out[k, j] = sum_i W[k, i] y[j, i]; four directions at a time, so that y is read once for all."""
    n = y.shape[1]
    rows = W.shape[0]
    p = 0
    while p + 3 < rows:
        a0, a1, a2, a3 = 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            value = y[j, i]
            a0 += W[p, i] * value
            a1 += W[p + 1, i] * value
            a2 += W[p + 2, i] * value
            a3 += W[p + 3, i] * value
        out[p, j], out[p + 1, j], out[p + 2, j], out[p + 3, j] = a0, a1, a2, a3
        p += 4
    while p < rows:
        value = 0.0
        for i in range(n):
            value += W[p, i] * y[j, i]
        out[p, j] = value
        p += 1


def add_forces(W, force, factor, y, row):
    """y[row] += factor W^T force, directions without force left out."""
    n = y.shape[1]
    p = 0
    rows = W.shape[0]
    while p < rows:
        if force[p] == 0.0:
            p += 1
            continue
        second = p + 1
        while second < rows and force[second] == 0.0:
            second += 1
        f0 = factor * force[p]
        if second < rows:
            f1 = factor * force[second]
            for i in range(n):
                y[row, i] += f0 * W[p, i] + f1 * W[second, i]
        else:
            for i in range(n):
                y[row, i] += f0 * W[p, i]
        p = second + 1


def next_order(squares, damping, diagonal, full, constant, W, force, s, y, j):
    """Order j + 2 of the coordinates."""
    n = squares.shape[0]
    below = 1.0 / ((j + 2.0) * (j + 1.0))
    square = s * s * below
    slope = s * (j + 1.0) * below
    for i in range(n):
        y[j + 2, i] = -square * squares[i] * y[j, i] - slope * diagonal[i] * y[j + 1, i]
    if j == 0:
        for i in range(n):
            y[2, i] += square * constant[i]
    if full:
        for i in range(n):
            value = 0.0
            for k in range(n):
                value += damping[i, k] * y[j + 1, k]
            y[j + 2, i] -= slope * (value - diagonal[i] * y[j + 1, i])
    add_forces(W, force, square, y, j + 2)


def evaluate(y, last, x, s, value, rate):
    """Coordinates and velocities at x (Horner)."""
    n = y.shape[1]
    for i in range(n):
        value[i] = y[last, i]
        rate[i] = 0.0
    for j in range(last - 1, -1, -1):
        for i in range(n):
            rate[i] = rate[i] * x + value[i]
            value[i] = value[i] * x + y[j, i]
    for i in range(n):
        rate[i] /= s


def widen(state, value, rate, step, reach, pull):
    """Largest coordinates and accelerations so far, the mean acceleration of a step standing for all of it."""
    n = value.shape[0]
    for i in range(n):
        reach[i] = max(reach[i], abs(value[i]))
        pull[i] = max(pull[i], abs(rate[i] - state[n + i]) / step)


def set_weights(squares, reach, pull, tolerance, weight):
    """1 / limit of each coordinate: `tolerance` of its largest value, and of what its largest acceleration makes."""
    n = squares.shape[0]
    far = 0.0
    strong = 0.0
    for i in range(n):
        far = max(far, reach[i])
        strong = max(strong, pull[i])
    for i in range(n):
        limit = max(reach[i], 1e-6 * far)
        if squares[i] > 0.0:
            limit = min(limit, max(pull[i], 1e-3 * strong) / squares[i])
        weight[i] = 1.0 / (tolerance * limit + 1e-100)


def velocity_term(y, j, power, weight):
    """Size of the term j of the velocity, over the trial step, in parts of the limits."""
    size = 0.0
    for i in range(weight.shape[0]):
        off = y[j, i] * weight[i]
        size += off * off
    return j * math.sqrt(size) * power


def last_size(y, last, end, weight):
    """Size of the last term, or of the one before if that asks for a shorter step: a series may be even or odd."""
    size = velocity_term(y, last, end**last, weight)
    before = velocity_term(y, last - 1, end ** (last - 1), weight)
    return max(size, before ** (last / (last - 1.0)))


def modal_steps(
    squares, damping, diagonal, full, constant, W, offset, parameters, memory, pieces, t, t1, state, h, reach,
    pull, breaks, tolerance, longest, asked, at, found, T, Y, work,
):  # fmt: skip
    """Steps from t to t1, or until T is full; states at the `asked` times go to `found`, step ends to T, Y.

    h is the trial step; reach, pull are the largest coordinates and accelerations so far. A coordinate's limit is
    `tolerance` of its reach, and of what its pull makes of it: accelerations then hold as well as coordinates. `work`:
    scratch arrays, see `work_space`. Returns (status, steps, time, h, orders computed, number of asked times passed).
    """
    n = squares.shape[0]
    most = memory.shape[1] - 1
    y, u, force, weight, value, rate = work
    sign = 1.0 if t1 >= t else -1.0
    begin = t
    count = 0
    orders = 0
    status = 0
    still = 0
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
        if step < 1e-14 * max(abs(t), abs(t1 - begin)):
            status = 1
            break
        s = sign * step
        for i in range(n):
            y[0, i] = state[i]
            y[1, i] = s * state[n + i]
        project(W, y, 0, u)
        for p in range(W.shape[0]):
            u[p, 0] += offset[p]
        set_weights(squares, reach, pull, tolerance, weight)
        end = 1.0
        power = 1.0
        last = most
        size = 0.0
        before = 1e300
        largest = 0.0
        for j in range(most - 1):
            project(W, y, j + 1, u)
            law_order(j, t, s, u, parameters, memory, pieces, force)  # noqa: F821
            next_order(squares, damping, diagonal, full, constant, W, force, s, y, j)
            if j == 1:
                end = min(1.0, law_corner(1, 1.0, parameters, memory, pieces, True))  # noqa: F821
                power = end * end
            power *= end
            size = velocity_term(y, j + 2, power, weight)
            if size < 1.0 and before < 1.0 and j >= LEAST - 2:
                last = j + 2
                break
            before = size
            largest = max(largest, size)
        orders += last
        for i in range(n):
            pull[i] = max(pull[i], abs(2.0 * y[2, i] / (s * s)))
        if not np.isfinite(size):
            h = 0.1 * step
            if h < 1e-12 * abs(t1 - begin):
                status = 4
                break
            continue
        x = end
        size = last_size(y, last, end, weight)
        if 1.0 <= size < 1e-3 * largest:  # the sum holds: the motion itself tells its size, as at a start from rest
            evaluate(y, last, end, s, value, rate)
            widen(state, value, rate, end * step, reach, pull)
            set_weights(squares, reach, pull, tolerance, weight)
            size = last_size(y, last, end, weight)
        if size > 1.0:  # too long: as far as the last term allows
            x = end * size ** (-1.0 / last)
        if still < 20:  # corners that the law does not get past are no reason to stand still
            corner = law_corner(last - 2, x, parameters, memory, pieces, False)  # noqa: F821
            x = min(x, corner)
        if x * step <= 1e-15 * max(abs(t), abs(t1 - begin)):
            still += 1
            if still > 40:  # it is not the corners
                status = 1
                break
            continue
        still = 0
        ends = t + x * s
        if (fixed and x == 1.0) or abs(goal - ends) <= 1e-13 * max(abs(goal), abs(t1 - begin)):
            ends = goal
        while at < asked.shape[0] and sign * (asked[at] - ends) <= 0.0:
            evaluate(y, last, (asked[at] - t) / s, s, value, rate)
            for i in range(n):
                found[at, i] = value[i]
                found[at, n + i] = rate[i]
            at += 1
        evaluate(y, last, x, s, value, rate)
        widen(state, value, rate, x * step, reach, pull)
        for i in range(n):
            state[i] = Y[count, i] = value[i]
            state[n + i] = Y[count, n + i] = rate[i]
        t = ends
        T[count] = t
        count += 1
        if size > 1.0:
            h = 0.9 * step * end * size ** (-1.0 / last)
        else:
            h = max(h, 0.9 * step * end * most / last)
    return status, count, t, h, orders, at


def work_space(n, directions, orders):
    """Scratch arrays of `modal_steps`: series of coordinates and along directions, forces, three of size n."""
    series = np.zeros((orders, n)), np.zeros((directions, orders)), np.zeros(directions)
    return *series, np.zeros(n), np.zeros(n), np.zeros(n)


FUNCTIONS = (project, add_forces, next_order, evaluate, widen, set_weights, velocity_term, last_size, modal_steps)
