# mypy: ignore-errors
r"""The forces of a train by the orders of their Taylor series: what `gearfe.train.law` gives at a time, as recurrences.

Over x, time :math:`t + s x`, the phase of a mesh counts from the node at which its cubic begins: with
:math:`z = \sum_j z_j x^j`, the products :math:`z^2, z^3` and :math:`(k(z) - k_0)\,u_d` follow order by order from
Cauchy's rule, as do momentum times tilt rate of the gyroscopic moments. Parameters and blocks are those of the law.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..rigid import SeriesLaw
from .law import time_function

#: Part of a cubic's width by which a corner is passed in its prediction, so that the step contains it.
PAST = 2e-3
#: Part of a cubic's width that counts as none.
SAME = 1e-9


def train_begin(t, sign, u, parameters, pieces):  # type: ignore[no-untyped-def]
    """Number of the cubic that each mesh is on, counted through all periods; at a node the one that lies ahead."""
    angle = 0.0
    rate = 0.0
    mesh = 0
    for block in range(int(parameters[0])):
        o = int(parameters[1 + block])
        if parameters[o] == 0.0:
            angle, rate = time_function(t, parameters, o + 1)
        elif parameters[o] == 1.0:
            r = int(parameters[o + 2])
            phase = parameters[o + 4] * (parameters[o + 3] * angle + u[r, 0]) + parameters[o + 5]
            speed = sign * parameters[o + 4] * (parameters[o + 3] * rate + u[r, 1])
            n = int(parameters[o + 7])
            first = o + 8
            period = parameters[first + n] - parameters[first]
            turn = math.floor((phase - parameters[first]) / period)
            place = phase - turn * period
            low = 0
            while low < n - 1 and parameters[first + low + 1] <= place:
                low += 1
            width = parameters[first + low + 1] - parameters[first + low]
            if speed > 0.0 and parameters[first + low + 1] - place < SAME * width:
                low += 1
            elif speed < 0.0 and place - parameters[first + low] < SAME * width:
                low -= 1
            pieces[mesh] = turn * n + low
            mesh += 1


def train_order(j, t, s, u, parameters, memory, pieces, out):  # type: ignore[no-untyped-def]
    """Order j of the forces over x, time t + s x, from the orders up to j + 1 of u; see the module's docstring.

    Rows of the memory, three to a block: a function of time; or phase from the cubic's node on, its square, the
    changing part of the stiffness; or momentum and the rates of both tilts.
    """
    for i in range(out.shape[0]):
        out[i] = 0.0
    mesh = 0
    for block in range(int(parameters[0])):
        o = int(parameters[1 + block])
        kind = parameters[o]
        row = 3 * block
        if kind == 1.0:
            d = int(parameters[o + 1])
            first = o + 8
            n = int(parameters[o + 7])
            turn = pieces[mesh] // n
            low = pieces[mesh] - turn * n
            mesh += 1
            value = parameters[o + 4] * (parameters[o + 3] * memory[0, j] + u[int(parameters[o + 2]), j])
            c = first + n + 1 + 4 * low
            stiffness = 0.0
            if j == 0:
                value += parameters[o + 5] - parameters[first + low]
                value -= turn * (parameters[first + n] - parameters[first])
                stiffness = parameters[c] - parameters[o + 6]
            memory[row, j] = value
            stiffness += parameters[c + 1] * value
            if parameters[c + 2] != 0.0 or parameters[c + 3] != 0.0:
                square = product(memory, row, memory, row, j)
                memory[row + 1, j] = square
                stiffness += parameters[c + 2] * square + parameters[c + 3] * product(memory, row + 1, memory, row, j)
            memory[row + 2, j] = stiffness
            out[d] -= product(memory, row + 2, u, d, j)
        elif kind == 2.0:
            d = int(parameters[o + 1])
            rate = (j + 1) / s
            memory[row, j] = parameters[o + 3] * rate * (parameters[o + 2] * memory[0, j + 1] + u[d + 2, j + 1])
            memory[row + 1, j] = rate * u[d, j + 1]
            memory[row + 2, j] = rate * u[d + 1, j + 1]
            out[d] -= product(memory, row, memory, row + 2, j)
            out[d + 1] += product(memory, row, memory, row + 1, j)
        else:
            if j == 0:
                time_orders(t, s, parameters, o + 1 if kind == 0.0 else o + 2, memory, row)
            if kind == 3.0:
                out[int(parameters[o + 1])] += memory[row, j]


def product(a, row, b, other, j):  # type: ignore[no-untyped-def]
    """Order j of the product of two series (Cauchy)."""
    total = 0.0
    for i in range(j + 1):
        total += a[row, i] * b[other, j - i]
    return total


def time_orders(t, s, parameters, at, memory, row):  # type: ignore[no-untyped-def]
    """All orders over x of the function of time whose numbers begin at `at`, on the piece that lies ahead."""
    pieces = int(parameters[at])
    width = int(parameters[at + 1])
    sines = int(parameters[at + 2])
    at += 3
    i = pieces - 1
    while i > 0 and parameters[at + i] > t + 0.5 * s:
        i -= 1
    x = t - parameters[at + pieces + i]
    first = at + 2 * pieces + i * width
    orders = memory.shape[1]
    for j in range(orders):
        memory[row, j] = 0.0
    for k in range(width - 1, -1, -1):  # Horner with (x + s z): the polynomial about t
        for j in range(min(width - 1, orders - 1), 0, -1):
            memory[row, j] = memory[row, j] * x + memory[row, j - 1] * s
        memory[row, 0] = memory[row, 0] * x + parameters[first + k]
    first = at + 2 * pieces + pieces * width
    for k in range(sines):
        turn = parameters[first + 3 * k + 1]
        size = parameters[first + 3 * k]
        for j in range(orders):
            memory[row, j] += size * math.sin(turn * t + parameters[first + 3 * k + 2] + 0.5 * math.pi * j)
            size *= turn * s / (j + 1)


def train_corner(last, limit, parameters, memory, pieces, ahead):  # type: ignore[no-untyped-def]
    """Where x, up to `limit`, first takes a mesh's phase off its cubic; 2 when nothing does.

    `ahead`: a little past the place to which the phase goes at its present rate; pieces stay. Otherwise meshes that
    are off their cubic there go on to the next.
    """
    nearest = 2.0
    for turn in range(1 if ahead else 2):  # find the place; go on from there
        mesh = 0
        for block in range(int(parameters[0])):
            o = int(parameters[1 + block])
            if parameters[o] != 1.0:
                continue
            row = 3 * block
            n = int(parameters[o + 7])
            low = pieces[mesh] % n
            width = parameters[o + 9 + low] - parameters[o + 8 + low]
            x = min(limit, nearest)
            place, slope = polynomial(memory, row, last, x)
            if ahead:
                slope = memory[row, 1]
                if slope != 0.0:
                    way = (1.0 + PAST) * width - memory[row, 0] if slope > 0.0 else memory[row, 0] + PAST * width
                    nearest = min(nearest, max(0.0, way) / abs(slope))
            elif turn == 1:
                if nearest <= limit and slope > 0.0 and place >= (1.0 - SAME) * width:
                    pieces[mesh] += 1
                elif nearest <= limit and slope < 0.0 and place <= SAME * width:
                    pieces[mesh] -= 1
            elif place > (1.0 + SAME) * width or place < -SAME * width:
                goal = width if place > 0.0 else 0.0
                begin = 0.0
                beyond = x
                side = 1.0 if place > goal else -1.0
                for _ in range(60):
                    step = (place - goal) / slope if slope != 0.0 else 1e300
                    x = x - step
                    if not (begin < x < beyond):
                        x = 0.5 * (begin + beyond)
                    place, slope = polynomial(memory, row, last, x)
                    if side * (place - goal) > 0.0:
                        beyond = x
                    else:
                        begin = x
                    if abs(place - goal) <= 1e-3 * SAME * width:
                        break
                nearest = min(nearest, x)
            mesh += 1
    return nearest


def polynomial(memory, row, last, x):  # type: ignore[no-untyped-def]
    """Value and slope at x of the series in a row of the memory."""
    value = 0.0
    slope = 0.0
    for j in range(last, -1, -1):
        slope = slope * x + value
        value = value * x + memory[row, j]
    return value, slope


def train_series(parameters: NDArray[np.float64], meshes: int) -> SeriesLaw:
    """The law with these parameters, whose blocks hold so many meshes of changing stiffness."""
    helpers = (time_function, product, time_orders, polynomial)
    return SeriesLaw(train_begin, train_order, train_corner, helpers, parameters, 3 * int(parameters[0]), meshes)
