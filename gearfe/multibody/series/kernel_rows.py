"""Rows of a program: values, gradients, S = G M^-1 G^T = L D L^T. Plain loops, compiled when numba is.

The functions here are written in the subset of Python that numba compiles; `multibody.compiled.kernels` binds them
together. Variables are z = (q, functions of one coordinate, squares' forms), see `gearfe.multibody.series.row_tables`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...typing import Array, IntArray
from .kernel_tape import curve_orders

if TYPE_CHECKING:
    from .row_tables import Equations
    from .timefunctions import Times
    from .work_space import Work


def fill(x: Array, value: float) -> None:
    """x := value (a loop compiles far faster than a slice assignment, which brings its error messages along)."""
    for i in range(x.shape[0]):
        x[i] = value


def copy(x: Array, y: Array) -> None:
    """y := x."""
    for i in range(x.shape[0]):
        y[i] = x[i]


def variables(tb: Equations, w: Work, q: Array) -> None:
    """Variables at the coordinates q in w.P, their slopes dz/dq in w.slope."""
    curves, square, P, slope = tb.program.curves, tb.square, w.P, w.slope
    n = q.shape[0]
    for i in range(n):
        P[i, 0] = q[i]
        slope[i] = 1.0
    curve_orders(tb.program, P, w.pieces, 0)
    for f in range(curves.sign.shape[0]):
        slope[n + f] = curves.sign[f] * P[curves.place[f, 1], 0]
    for s in range(square.row.shape[0]):
        value = 0.0
        for e in range(square.first[s], square.first[s + 1]):
            value += square.weight[e] * P[square.variable[e], 0]
        P[slope.shape[0] + s, 0] = value


def rates(tb: Equations, w: Work, v: Array) -> None:
    """Rates of the variables in w.P, of their slopes in w.bend, after `variables`."""
    curves, square, P, bend = tb.program.curves, tb.square, w.P, w.bend
    n = v.shape[0]
    for i in range(n):
        P[i, 1] = v[i]
    for f in range(curves.sign.shape[0]):
        P[n + f, 1] = w.slope[n + f] * v[curves.place[f, 0]]
    for f in range(curves.sign.shape[0]):
        bend[n + f] = curves.sign[f] * P[curves.place[f, 1], 1]
    for s in range(square.row.shape[0]):
        value = 0.0
        for e in range(square.first[s], square.first[s + 1]):
            value += square.weight[e] * P[square.variable[e], 1]
        P[bend.shape[0] + s, 1] = value


def gradients(tb: Equations, w: Work, q: Array) -> None:
    """Gradients of all rows at the coordinates q in w.G."""
    gradient, square, slope, G = tb.gradient, tb.square, w.slope, w.G
    variables(tb, w, q)
    copy(gradient.still, G)
    for e in range(gradient.turning.shape[0]):
        G[gradient.turning[e, 1]] += gradient.factor[e] * slope[gradient.turning[e, 2]]
    for s in range(square.row.shape[0]):
        value = 2.0 * square.factor[s] * w.P[slope.shape[0] + s, 0]
        for e in range(square.first[s], square.first[s + 1]):
            G[square.entry[e]] += value * square.weight[e] * slope[square.variable[e]]


def gradient_rates(tb: Equations, w: Work, v: Array) -> None:
    """w.dG = dG/dt along the velocity v, after `gradients`."""
    gradient, square, slope, bend, H = tb.gradient, tb.square, w.slope, w.bend, w.dG
    rates(tb, w, v)
    fill(H, 0.0)
    for e in range(gradient.turning.shape[0]):
        H[gradient.turning[e, 1]] += gradient.factor[e] * bend[gradient.turning[e, 2]]
    for s in range(square.row.shape[0]):
        value = 2.0 * square.factor[s] * w.P[slope.shape[0] + s, 0]
        rate = 2.0 * square.factor[s] * w.P[slope.shape[0] + s, 1]
        for e in range(square.first[s], square.first[s + 1]):
            i = square.variable[e]
            H[square.entry[e]] += square.weight[e] * (rate * slope[i] + value * bend[i])


def residuals(tb: Equations, w: Work, g: Array) -> None:
    """Value of every row, after `gradients`; w.TF holds the value of every function of time."""
    rows, gradient, square = tb.program.rows, tb.gradient, tb.square
    for r in range(g.shape[0]):
        value = rows.constant[r]
        if rows.motion[r] >= 0:
            value -= w.TF[rows.motion[r], 0]
        for e in range(gradient.first[r], gradient.first[r + 1]):
            value += gradient.still[e] * w.P[gradient.column[e], 0]
        g[r] = value
    for e in range(gradient.turning.shape[0]):
        g[gradient.turning[e, 0]] += gradient.factor[e] * w.P[gradient.turning[e, 2], 0]
    for s in range(square.row.shape[0]):
        value = w.P[w.slope.shape[0] + s, 0]
        g[square.row[s]] += square.factor[s] * value * value


def times_gradients(tb: Equations, G: Array, u: Array, out: Array) -> None:
    """out = G u, one number per row."""
    gradient = tb.gradient
    fill(out, 0.0)
    for e in range(G.shape[0]):
        out[gradient.row[e]] += G[e] * u[gradient.column[e]]


def add_transposed(tb: Equations, G: Array, mu: Array, factor: float, out: Array) -> None:
    """out += factor G^T mu."""
    gradient = tb.gradient
    for e in range(G.shape[0]):
        out[gradient.column[e]] += factor * G[e] * mu[gradient.row[e]]


def accelerations(tb: Equations, force: Array, out: Array) -> None:
    """out = M^-1 force, the masses raised by their excess."""
    mass = tb.mass
    if mass.inverse.shape[0] == out.shape[0]:  # diagonal
        for i in range(out.shape[0]):
            out[i] = mass.inverse[i] * force[i]
        return
    fill(out, 0.0)
    for e in range(mass.inverse.shape[0]):
        out[mass.place[e, 0]] += mass.inverse[e] * force[mass.place[e, 1]]


def inner(tb: Equations, a: Array, b: Array) -> float:
    """a . M^-1 b."""
    mass = tb.mass
    total = 0.0
    if mass.inverse.shape[0] == a.shape[0]:  # diagonal
        for i in range(a.shape[0]):
            total += a[i] * b[i] * mass.inverse[i]
        return total
    for e in range(mass.inverse.shape[0]):
        total += a[mass.place[e, 0]] * b[mass.place[e, 1]] * mass.inverse[e]
    return total


def factorise(tb: Equations, w: Work, skip: IntArray, bound: float) -> tuple[float, int]:
    """L D L^T of S in w.val (m reciprocals of D, then the entries of L); rows with skip != 0 become unit rows.

    Rows whose pivot falls below `bound` of their diagonal become unit rows, too, and get skip = 2.
    Returns the smallest pivot relative to its diagonal of S, and its row (-1 when there is none).
    """
    plan, product, inverse, G, val, diag = tb.factor, tb.product, tb.mass.inverse, w.G, w.val, w.diag
    m = diag.shape[0]
    fill(val, 0.0)
    for e in range(product.shape[0]):
        val[product[e, 0]] += G[product[e, 1]] * G[product[e, 2]] * inverse[product[e, 3]]
    for j in range(m):
        if skip[j] != 0:
            val[j] = 0.0
            for e in range(plan.start[j], plan.start[j + 1]):
                val[m + e] = 0.0
    for e in range(plan.row.shape[0]):
        if skip[plan.row[e]] != 0:
            val[m + e] = 0.0
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


def solve(tb: Equations, val: Array, x: Array) -> None:
    """x := S^-1 x with the factor of `factorise`."""
    plan = tb.factor
    m = x.shape[0]
    for e in range(plan.row.shape[0]):
        x[plan.row[e]] -= val[m + e] * x[plan.column[e]]
    for j in range(m):
        x[j] *= val[j]
    for e in range(plan.row.shape[0] - 1, -1, -1):
        x[plan.column[e]] -= val[m + e] * x[plan.row[e]]


def time_series(times: Times, t: float, forward: bool, orders: int, out: Array) -> None:
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


FUNCTIONS = (
    fill, copy, variables, rates, gradients, gradient_rates, residuals, times_gradients, add_transposed,
    accelerations, inner, factorise, solve, time_series,
)  # fmt: skip
GLOBALS = {"math": math, "np": np}
