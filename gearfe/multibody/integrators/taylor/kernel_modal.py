"""Taylor series in modal coordinates, compiled: y'' = c - w^2 y - D y' + W^T phi(t, u, u'), u = W y + offset.

With y = sum_j y_j x^j, x = (t - t0) / s running from 0 to 1 over the trial step s, the equation of motion gives

    (j + 2)(j + 1) y_{j+2} = s^2 (c_j - w^2 y_j + W^T phi_j) - s (j + 1) D y_{j+1}

(Hairer, Norsett & Wanner I, Sec. I.8). phi_j comes from the law's own recurrences
(`multibody.core.contract.SeriesLaw`), bound as `law_order` and `law_discontinuity`. One order costs two small products
with W, half a stage of a Runge-Kutta method of order 8, and takes the fastest mode further. A step ends where its law
has a discontinuity; the number of orders follows from the terms.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ....base.typing import Array, IntArray
from .kernels import next_goal

#: Orders that are computed in any case: a force that sets in as a polynomial of degree 5 shows up to order 7.
LEAST = 8


class Equations(NamedTuple):
    """Constant data of a run, for n coordinates and p directions."""

    eigenvalues: Array  # (n,) w^2 (rad2/s2)
    damping: Array  # (n, n) D
    diagonal: Array  # (n,) of D
    full: bool  # whether D has more than its diagonal
    constant: Array  # (n,) c
    W: Array  # (p, n)
    offset: Array  # (p,)
    law: Any  # parameters of the law
    breaks: Array  # times at which steps end (s)
    tolerance: float
    longest: float  # step (s)


class Work(NamedTuple):
    """Data that change from step to step, and scratch arrays; K orders."""

    memory: Array  # (rows, K) of the law
    pieces: IntArray
    state: Array  # (2n,)
    reach: Array  # (n,) largest coordinates and accelerations so far
    pull: Array
    y: Array  # (K, n) series of the coordinates
    u: Array  # (p, K) and along the directions
    force: Array  # (p,)
    weight: Array  # (n,)
    value: Array
    rate: Array


class Output(NamedTuple):
    """Output arrays of a run, and its current position."""

    now: Array  # (3,) time, end, trial step (s)
    counts: IntArray  # (3,) steps made, output times passed, orders computed
    output_times: Array  # (a,) times (s)
    found: Array  # (a, 2n) states there
    ends: Array  # (room,) of the steps (s)
    states: Array  # (room, 2n) there


def _unbound(*_: Any) -> Any:
    raise NotImplementedError


#: Placeholders until the `order` and `discontinuity` of a `gearfe.multibody.core.contract.SeriesLaw` are bound.
law_order: Callable[[int, float, float, Array, Any, Array, IntArray, Array], None] = _unbound
law_discontinuity: Callable[[int, float, Any, Array, IntArray, bool], float] = _unbound


def _project(W: Array, y: Array, j: int, out: Array) -> None:
    """Write out[k, j] = sum_i W[k, i] y[j, i].

    Four directions are summed at a time, so that y is read once for all.
    """
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


def _add_forces(W: Array, force: Array, factor: float, y: Array, row: int) -> None:
    """Add factor W^T force to y[row], skipping directions without force."""
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


def _next_order(run: Equations, force: Array, s: float, y: Array, j: int) -> None:
    """Write order j + 2 of the coordinates."""
    eigenvalues, diagonal, constant, damping = run.eigenvalues, run.diagonal, run.constant, run.damping
    n = eigenvalues.shape[0]
    below = 1.0 / ((j + 2.0) * (j + 1.0))
    square = s * s * below
    slope = s * (j + 1.0) * below
    for i in range(n):
        y[j + 2, i] = -square * eigenvalues[i] * y[j, i] - slope * diagonal[i] * y[j + 1, i]
    if j == 0:
        for i in range(n):
            y[2, i] += square * constant[i]
    if run.full:
        for i in range(n):
            value = 0.0
            for k in range(n):
                value += damping[i, k] * y[j + 1, k]
            y[j + 2, i] -= slope * (value - diagonal[i] * y[j + 1, i])
    _add_forces(run.W, force, square, y, j + 2)


def _evaluate(y: Array, last: int, x: float, s: float, value: Array, rate: Array) -> None:
    """Write coordinates and velocities at x (Horner)."""
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


def widen(w: Work, step: float) -> None:
    """Largest coordinates and accelerations so far, the mean acceleration of a step standing for all of it."""
    state, value, rate, reach, pull = w.state, w.value, w.rate, w.reach, w.pull
    n = value.shape[0]
    for i in range(n):
        reach[i] = max(reach[i], abs(value[i]))
        pull[i] = max(pull[i], abs(rate[i] - state[n + i]) / step)


def _set_weights(eigenvalues: Array, reach: Array, pull: Array, tolerance: float, weight: Array) -> None:
    """Write 1 / limit of each coordinate.

    The limit is `tolerance` of its largest value, and of what its largest acceleration makes of it.
    """
    n = eigenvalues.shape[0]
    far = 0.0
    strong = 0.0
    for i in range(n):
        far = max(far, reach[i])
        strong = max(strong, pull[i])
    for i in range(n):
        limit = max(reach[i], 1e-6 * far)
        if eigenvalues[i] > 0.0:
            limit = min(limit, max(pull[i], 1e-3 * strong) / eigenvalues[i])
        weight[i] = 1.0 / (tolerance * limit + 1e-100)


def _velocity_term(y: Array, j: int, power: float, weight: Array) -> float:
    """Return the size of term j of the velocity, over the trial step, in parts of the limits."""
    size = 0.0
    for i in range(weight.shape[0]):
        off = y[j, i] * weight[i]
        size += off * off
    return j * math.sqrt(size) * power


def _last_size(y: Array, last: int, end: float, weight: Array) -> float:
    """Return the size of the last term, or of the one before if that asks for a shorter step.

    A series may be even or odd.
    """
    size = _velocity_term(y, last, end**last, weight)
    before = _velocity_term(y, last - 1, end ** (last - 1), weight)
    return max(size, before ** (last / (last - 1.0)))


def modal_steps(run: Equations, w: Work, out: Output) -> int:
    """Steps from `out.now` to its end, or until `out.ends` is full; returns the status.

    A coordinate's limit is `tolerance` of its reach, and of what its pull makes of it: accelerations then hold as well
    as coordinates.
    """
    t, t1, h = out.now[0], out.now[1], out.now[2]
    at = out.counts[1]
    eigenvalues, offset, W, breaks, tolerance, longest = (
        run.eigenvalues, run.offset, run.W, run.breaks, run.tolerance, run.longest,
    )  # fmt: skip
    law, memory, pieces, state, reach, pull = run.law, w.memory, w.pieces, w.state, w.reach, w.pull
    y, u, force, weight, value, rate = w.y, w.u, w.force, w.weight, w.value, w.rate
    output_times, found, T, Y = out.output_times, out.found, out.ends, out.states
    n = eigenvalues.shape[0]
    most = memory.shape[1] - 1
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
        goal = next_goal(breaks, t, t1, sign)
        step = min(h, longest, abs(goal - t))
        fixed = step == abs(goal - t)
        if step < 1e-14 * max(abs(t), abs(t1 - begin)):
            status = 1
            break
        s = sign * step
        for i in range(n):
            y[0, i] = state[i]
            y[1, i] = s * state[n + i]
        _project(W, y, 0, u)
        for p in range(W.shape[0]):
            u[p, 0] += offset[p]
        _set_weights(eigenvalues, reach, pull, tolerance, weight)
        end = 1.0
        power = 1.0
        last = most
        size = 0.0
        before = 1e300
        largest = 0.0
        for j in range(most - 1):
            _project(W, y, j + 1, u)
            law_order(j, t, s, u, law, memory, pieces, force)
            _next_order(run, force, s, y, j)
            if j == 1:
                end = min(1.0, law_discontinuity(1, 1.0, law, memory, pieces, True))
                power = end * end
            power *= end
            size = _velocity_term(y, j + 2, power, weight)
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
        size = _last_size(y, last, end, weight)
        if 1.0 <= size < 1e-3 * largest:  # the sum holds: the motion itself tells its size, as at a start from rest
            _evaluate(y, last, end, s, value, rate)
            widen(w, end * step)
            _set_weights(eigenvalues, reach, pull, tolerance, weight)
            size = _last_size(y, last, end, weight)
        if size > 1.0:  # too long: as far as the last term allows
            x = end * size ** (-1.0 / last)
        if still < 20:  # discontinuities that the law does not get past are no reason to stand still
            discontinuity = law_discontinuity(last - 2, x, law, memory, pieces, False)
            x = min(x, discontinuity)
        if x * step <= 1e-15 * max(abs(t), abs(t1 - begin)):
            still += 1
            if still > 40:  # it is not the discontinuities
                status = 1
                break
            continue
        still = 0
        ends = t + x * s
        if (fixed and x == 1.0) or abs(goal - ends) <= 1e-13 * max(abs(goal), abs(t1 - begin)):
            ends = goal
        while at < output_times.shape[0] and sign * (output_times[at] - ends) <= 0.0:
            _evaluate(y, last, (output_times[at] - t) / s, s, value, rate)
            for i in range(n):
                found[at, i] = value[i]
                found[at, n + i] = rate[i]
            at += 1
        _evaluate(y, last, x, s, value, rate)
        widen(w, x * step)
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
    out.now[0], out.now[2] = t, h
    out.counts[0], out.counts[1], out.counts[2] = count, at, orders
    return status


def work_space(law: tuple[Array, IntArray], state: Array, directions: int) -> Work:
    """Arrays of a run from `state`, with the memory and the pieces of its law."""
    n, orders = len(state) // 2, law[0].shape[1]
    series = np.zeros((orders, n)), np.zeros((directions, orders)), np.zeros(directions)
    return Work(*law, state.copy(), np.abs(state[:n]), np.zeros(n), *series, np.zeros(n), np.zeros(n), np.zeros(n))


FUNCTIONS = (
    next_goal,
    _project,
    _add_forces,
    _next_order,
    _evaluate,
    widen,
    _set_weights,
    _velocity_term,
    _last_size,
    modal_steps,
)
