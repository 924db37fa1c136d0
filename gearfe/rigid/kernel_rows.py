"""Constraint rows of a linkage: residuals, gradients, S = G M^-1 G^T = L D L^T. Plain loops, compiled
when numba is.

The functions here are written in the subset of Python that numba compiles; `gearfe.rigid.compiled` binds them together.
Coordinates q hold (x, y, theta) of every body and of the ground, shape (3 (n + 1),).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..typing import Array, IntArray
from .kernel_names import EW, EX, EY, KC, KS, KT, KX, KY

if TYPE_CHECKING:
    from .ordering import Factor
    from .tables import Forms, Times, Vectors


def fill(x: Array, value: float) -> None:
    """x := value (a loop compiles far faster than a slice assignment, which brings its error messages along)."""
    for i in range(x.shape[0]):
        x[i] = value


def copy(x: Array, y: Array) -> None:
    """y := x."""
    for i in range(x.shape[0]):
        y[i] = x[i]


def trigonometry(q: Array, c: Array, s: Array) -> None:
    """Cosine and sine of every angle."""
    for b in range(c.shape[0]):
        c[b] = math.cos(q[3 * b + 2])
        s[b] = math.sin(q[3 * b + 2])


def vector_at(vectors: Vectors, k: int, q: Array, c: Array, s: Array) -> tuple[float, float]:
    """Components of vector k."""
    x = 0.0
    y = 0.0
    for side in range(2):
        b = vectors.bodies[k, side]
        px = vectors.end[k, side, EX]
        py = vectors.end[k, side, EY]
        x += vectors.end[k, side, EW] * q[3 * b] + c[b] * px - s[b] * py
        y += vectors.end[k, side, EW] * q[3 * b + 1] + s[b] * px + c[b] * py
    return x, y


def arm_at(vectors: Vectors, k: int, a: int, c: Array, s: Array) -> tuple[float, float]:
    """Arm of vector k at its end a, in the ground's axes."""
    b = vectors.bodies[k, a]
    px = vectors.end[k, a, EX]
    py = vectors.end[k, a, EY]
    return c[b] * px - s[b] * py, s[b] * px + c[b] * py


def vector_rate(vectors: Vectors, k: int, v: Array, c: Array, s: Array) -> tuple[float, float]:
    """Components of the rate of vector k."""
    x = 0.0
    y = 0.0
    for side in range(2):
        b = vectors.bodies[k, side]
        px = vectors.end[k, side, EX]
        py = vectors.end[k, side, EY]
        x += vectors.end[k, side, EW] * v[3 * b] - v[3 * b + 2] * (s[b] * px + c[b] * py)
        y += vectors.end[k, side, EW] * v[3 * b + 1] + v[3 * b + 2] * (c[b] * px - s[b] * py)
    return x, y


def gradients(forms: Forms, vectors: Vectors, q: Array, c: Array, s: Array, G: Array) -> None:
    """G[r, side] = gradient of constraint r with respect to (x, y, theta) of its body on that side; shape (m, 2, 3)."""
    for r in range(G.shape[0]):
        for a in range(2):
            b = forms.bodies[r, a]
            G[r, a, 0] = forms.factor[r, a, KX]
            G[r, a, 1] = forms.factor[r, a, KY]
            G[r, a, 2] = forms.factor[r, a, KT] - forms.factor[r, a, KC] * s[b] + forms.factor[r, a, KS] * c[b]
    for p in range(forms.product.shape[0]):
        r = forms.product[p, 0]
        for one in range(2):
            k = forms.product[p, 1 + one]
            ux, uy = vector_at(vectors, forms.product[p, 2 - one], q, c, s)
            for a in range(2):
                rx, ry = arm_at(vectors, k, a, c, s)
                G[r, a, 0] += vectors.end[k, a, EW] * ux
                G[r, a, 1] += vectors.end[k, a, EW] * uy
                G[r, a, 2] += rx * uy - ry * ux


def gradient_rates(forms: Forms, vectors: Vectors, q: Array, v: Array, c: Array, s: Array, H: Array) -> None:
    """H = dG/dt along the velocity v, same layout as G."""
    for r in range(H.shape[0]):
        for a in range(2):
            b = forms.bodies[r, a]
            H[r, a, 0] = 0.0
            H[r, a, 1] = 0.0
            H[r, a, 2] = -v[3 * b + 2] * (forms.factor[r, a, KC] * c[b] + forms.factor[r, a, KS] * s[b])
    for p in range(forms.product.shape[0]):
        r = forms.product[p, 0]
        for one in range(2):
            k = forms.product[p, 1 + one]
            ux, uy = vector_at(vectors, forms.product[p, 2 - one], q, c, s)
            dx, dy = vector_rate(vectors, forms.product[p, 2 - one], v, c, s)
            for a in range(2):
                spin = v[3 * forms.bodies[r, a] + 2]
                rx, ry = arm_at(vectors, k, a, c, s)
                H[r, a, 0] += vectors.end[k, a, EW] * dx
                H[r, a, 1] += vectors.end[k, a, EW] * dy
                H[r, a, 2] += rx * dy - ry * dx - spin * (rx * ux + ry * uy)


def residuals(forms: Forms, vectors: Vectors, q: Array, c: Array, s: Array, f: Array, g: Array) -> None:
    """Value of every constraint; f holds the value of every time function."""
    for r in range(g.shape[0]):
        value = forms.constant[r]
        if forms.motion[r] >= 0:
            value -= f[forms.motion[r]]
        for a in range(2):
            b = forms.bodies[r, a]
            value += forms.factor[r, a, KX] * q[3 * b] + forms.factor[r, a, KY] * q[3 * b + 1]
            value += forms.factor[r, a, KT] * q[3 * b + 2]
            value += forms.factor[r, a, KC] * c[b] + forms.factor[r, a, KS] * s[b]
        g[r] = value
    for p in range(forms.product.shape[0]):
        ux, uy = vector_at(vectors, forms.product[p, 1], q, c, s)
        vx, vy = vector_at(vectors, forms.product[p, 2], q, c, s)
        g[forms.product[p, 0]] += ux * vx + uy * vy


def times_gradients(forms: Forms, G: Array, u: Array, out: Array) -> None:
    """out = G u, one number per row."""
    for r in range(out.shape[0]):
        a = 3 * forms.bodies[r, 0]
        b = 3 * forms.bodies[r, 1]
        out[r] = (
            G[r, 0, 0] * u[a] + G[r, 0, 1] * u[a + 1] + G[r, 0, 2] * u[a + 2]
            + G[r, 1, 0] * u[b] + G[r, 1, 1] * u[b + 1] + G[r, 1, 2] * u[b + 2]
        )  # fmt: skip


def add_transposed(forms: Forms, G: Array, mu: Array, factor: float, out: Array) -> None:
    """out += factor G^T mu."""
    for r in range(mu.shape[0]):
        for side in range(2):
            b = 3 * forms.bodies[r, side]
            value = factor * mu[r]
            out[b] += G[r, side, 0] * value
            out[b + 1] += G[r, side, 1] * value
            out[b + 2] += G[r, side, 2] * value


def factorise(
    plan: Factor, mass: Array, G: Array, skip: IntArray, val: Array, diag: Array, bound: float
) -> tuple[float, int]:
    """L D L^T of S in val (m reciprocals of D, then the entries of L); rows with skip != 0 become unit rows.

    Rows whose pivot falls below `bound` of their diagonal become unit rows, too, and get skip = 2.
    Returns the smallest pivot relative to its diagonal of S, and its row (-1 when there is none).
    """
    m = diag.shape[0]
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


def solve(plan: Factor, val: Array, x: Array) -> None:
    """x := S^-1 x with the factor of `factorise`."""
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
    fill,
    copy,
    trigonometry,
    vector_at,
    arm_at,
    vector_rate,
    gradients,
    gradient_rates,
    residuals,
    times_gradients,
    add_transposed,
    factorise,
    solve,
    time_series,
)
GLOBALS = {"math": math, "np": np}
