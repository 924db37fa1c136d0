"""Matrices of a step of collocation in units that compare, their factors and solutions, compiled.

They are banded saddle matrices [[T, G^T], [G, 0]] of one pattern, complex, those of all eigenvalues side by side in
lanes; the matrix of masses, too, in every lane alike. They are stored by columns, real and imaginary parts in turn:
B[j, i, 0] is the real part of row i of column j. Rows are exchanged for all matrices alike, where the diagonal is small
in their sum (threshold pivoting: Duff, Erisman & Reid, Direct Methods for Sparse Matrices, 2nd ed., Oxford 2017, Sec.
5.2).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....typing import Array, IntArray
from ...compiled.simd import Lanes

if TYPE_CHECKING:
    from ...compiled.simd import flat, halves, total
    from .kernel_collocation import Stages
    from .kernel_equations import Equations
    from .scheme import Scheme

#: Numbers of the factors: of the step's matrices, and of the masses with the rows.
STEP, MASS = 0, 1
#: Share of the largest entry below the diagonal that the diagonal has where it is the pivot.
DIAGONAL = 0.1


def factorise_band(
    B: Lanes, over: Lanes, reach: IntArray, pivot: IntArray, low: IntArray, top: IntArray, right: IntArray
) -> bool:
    """Factorise the band matrices B = L U in place, with pivots for all matrices alike.

    Parameters
    ----------
    B : SIMD, shape (N, N, 2, R)
        Matrices by columns, real and imaginary parts; becomes L and U.
    over : SIMD, shape (N, 2, R)
        Reciprocals of the pivots; written.
    reach : ndarray of int, shape (N,)
        Last row that a column may come to.
    pivot : ndarray of int, shape (N,)
        Row exchanged with each row; written.
    low, top : ndarray of int, shape (N,)
        Last row of each column of L, and first row of each column of U; written.
    right : ndarray of int, shape (N,)
        Last column of each row; changed.

    Returns
    -------
    regular : bool
        False if a pivot vanishes.
    """
    size = B.shape[0]
    for j in range(size):
        top[j] = j
    for c in range(size):
        best = c
        most = 0.0
        here = 0.0
        low[c] = c
        for i in range(c, reach[c] + 1):
            value = total(abs(B[c, i, 0]) + abs(B[c, i, 1]))
            if i == c:
                here = value
            if value > 0.0:
                low[c] = i
            if value > most:
                most = value
                best = i
        if not 0.0 < most < 1e300:
            return False
        if here >= DIAGONAL * most:
            best = c
        pivot[c] = best
        if best != c:
            for j in range(c, max(right[c], right[best]) + 1):
                for k in range(2):
                    kept = 1.0 * B[j, c, k]
                    B[j, c, k] = B[j, best, k]
                    B[j, best, k] = kept
            right[c], right[best] = right[best], right[c]
        x = B[c, c, 0]
        y = B[c, c, 1]
        share = 1.0 / (x * x + y * y)
        x = x * share
        y = -y * share
        over[c, 0] = x
        over[c, 1] = y
        for i in range(c + 1, low[c] + 1):
            a = B[c, i, 0]
            b = B[c, i, 1]
            B[c, i, 0], B[c, i, 1] = a * x - b * y, a * y + b * x
            right[i] = max(right[i], right[c])
        for j in range(c + 1, right[c] + 1):
            x = B[j, c, 0]
            y = B[j, c, 1]
            if total(abs(x) + abs(y)) > 0.0:
                top[j] = min(top[j], c)
                for i in range(c + 1, low[c] + 1):
                    a = B[c, i, 0]
                    b = B[c, i, 1]
                    B[j, i, 0] -= a * x - b * y
                    B[j, i, 1] -= a * y + b * x
    return True


def solve_band(B: Lanes, over: Lanes, pivot: IntArray, low: IntArray, top: IntArray, x: Lanes) -> None:
    """Replace x by B^-1 x with the factors of `factorise_band`.

    Parameters
    ----------
    B : SIMD, shape (N, N, 2, R)
        L and U.
    over : SIMD, shape (N, 2, R)
        Reciprocals of the pivots.
    pivot, low, top : ndarray of int, shape (N,)
        As `factorise_band` left them.
    x : SIMD, shape (N, 2, R)
        Right-hand side, then solution; real and imaginary parts.
    """
    size = B.shape[0]
    for c in range(size):
        best = pivot[c]
        a = 1.0 * x[best, 0]
        b = 1.0 * x[best, 1]
        if best != c:
            x[best, 0] = x[c, 0]
            x[best, 1] = x[c, 1]
            x[c, 0] = a
            x[c, 1] = b
        for i in range(c + 1, low[c] + 1):
            x[i, 0] -= B[c, i, 0] * a - B[c, i, 1] * b
            x[i, 1] -= B[c, i, 0] * b + B[c, i, 1] * a
    for c in range(size - 1, -1, -1):
        a = x[c, 0] * over[c, 0] - x[c, 1] * over[c, 1]
        b = x[c, 0] * over[c, 1] + x[c, 1] * over[c, 0]
        x[c, 0] = a
        x[c, 1] = b
        for i in range(top[c], c):
            x[i, 0] -= B[c, i, 0] * a - B[c, i, 1] * b
            x[i, 1] -= B[c, i, 0] * b + B[c, i, 1] * a


def assemble(eq: Equations, k: int, x: Any, y: Any, tangents: float) -> bool:
    """Assemble and factorise the matrices of all eigenvalues, in units that compare.

    With z = x + i y they are [[z^2 M - z C - K, G^T], [G, 0]], K and C the derivatives of the forces.

    Parameters
    ----------
    eq : Equations
        The system, with K, C and G of one state; the factors in ``eq.own`` change.
    k : int
        Number of the factor: `STEP` or `MASS`.
    x, y : SIMD, shape (R,)
        Real and imaginary part of mu/h (1/s); for the matrix of masses 1 and 0.
    tangents : float
        Factor of K and C: 1, or 0 for the matrix of masses.

    Returns
    -------
    regular : bool
        False if a pivot vanishes.
    """
    tb, own, band = eq.program, eq.own, eq.band
    unit, place, G = tb.unit, band.place, own.G
    B = own.B[k]
    n = unit.shape[0]
    for j in range(B.shape[0]):
        for i in range(band.begin[j], band.reach[j] + 1):
            B[j, i, 0] = 0.0
            B[j, i, 1] = 0.0
    square = x * x - y * y
    cross = 2.0 * x * y
    most = 0.0 * x + 1e-300
    for i in range(n):
        damping = tangents * own.C[i, i]
        first = square * tb.mass[i, i] - x * damping - tangents * own.K[i, i]
        second = cross * tb.mass[i, i] - y * damping
        most = np.maximum(most, (abs(first) + abs(second)) * unit[i] ** 2)
    over = 1.0 / most
    x = x * (over * tangents)
    y = y * (over * tangents)
    square = square * over
    cross = cross * over
    rest = over * tangents
    for e in range(band.entry.shape[0]):
        i = band.entry[e, 0]
        j = band.entry[e, 1]
        scale = unit[i] * unit[j]
        damping = scale * own.C[i, j]
        mass = scale * band.mass[e]
        B[place[j], place[i], 0] = square * mass - x * damping - rest * (scale * own.K[i, j])
        B[place[j], place[i], 1] = cross * mass - y * damping
    for r in range(G.shape[0]):
        for i in range(n):
            if G[r, i] != 0.0:
                value = G[r, i] * unit[i] / tb.rows.unit[r]
                B[place[n + r], place[i], 0] = value
                B[place[i], place[n + r], 0] = value
    own.scale[k] = most
    for i in range(B.shape[0]):
        own.right[i] = band.right[i]
    return factorise_band(B, own.over[k], band.reach, own.pivot[k], own.low[k], own.top[k], own.right)


def factorise(eq: Equations, w: Stages, tab: Scheme) -> bool:
    """Factors of all eigenvalues."""
    one = 1.0 / w.now[1]
    return assemble(eq, STEP, tab.side.values[0] * one, tab.side.values[1] * one, 1.0)


def factorise_mass(eq: Equations, tab: Scheme, t: float) -> bool:
    """Factor of the matrix of masses and of the rows in G, which are those of the time t."""
    none = 0.0 * tab.side.values[0]
    eq.own.at[0] = t
    return assemble(eq, MASS, none + 1.0, none, 0.0)


def across(X: Lanes, Y: Lanes, out: Lanes) -> None:
    """out := Y with other lanes: sum_j Y[:, lane j] X[j]."""
    values = flat(Y)
    for a in range(values.shape[0]):
        made = X[0] * values[a, 0]
        for j in range(1, X.shape[0]):
            made += X[j] * values[a, j]
        out[a] = made


def solve_systems(eq: Equations, w: Stages, tab: Scheme) -> None:
    """w.r, w.g of the systems := minus their solutions."""
    tb, own, place = eq.program, eq.own, eq.band.place
    r, g, x, over, scale = halves(w.r), halves(w.g), own.x, tab.side.over, own.scale[STEP]
    n = tb.unit.shape[0]
    m = tb.rows.unit.shape[0]
    less = -1.0 / scale
    for i in range(n):
        x[place[i], 0] = r[i, 0] * (less * tb.unit[i])
        x[place[i], 1] = r[i, 1] * (less * tb.unit[i])
    for k in range(m):
        share = -1.0 / tb.rows.unit[k]
        x[place[n + k], 0] = share * (g[k, 0] * over[0] - g[k, 1] * over[1])
        x[place[n + k], 1] = share * (g[k, 0] * over[1] + g[k, 1] * over[0])
    solve_band(own.B[STEP], own.over[STEP], own.pivot[STEP], own.low[STEP], own.top[STEP], x)
    for i in range(n):
        r[i, 0] = x[place[i], 0] * tb.unit[i]
        r[i, 1] = x[place[i], 1] * tb.unit[i]
    for k in range(m):
        share = 1.0 / tb.rows.unit[k]
        g[k, 0] = x[place[n + k], 0] * (scale * share)
        g[k, 1] = x[place[n + k], 1] * (scale * share)


def solve(eq: Equations, w: Stages, tab: Scheme) -> None:
    """w.dZ, w.dL := changes that what is left of the equations asks for."""
    across(tab.side.back, w.rest, w.r)
    across(tab.side.back, w.gap, w.g)
    solve_systems(eq, w, tab)
    across(tab.side.basis, w.r, w.dZ)
    across(tab.side.basis, w.g, w.dL)


def solve_mass(eq: Equations, force: Array, gap: Array) -> None:
    """force, gap := minus the solution of [[M, G^T], [G, 0]]."""
    tb, own, place = eq.program, eq.own, eq.band.place
    x, found, scale = own.x, flat(own.x), flat(own.scale)[MASS, 0]
    n = tb.unit.shape[0]
    m = tb.rows.unit.shape[0]
    for i in range(n + m):
        x[i, 1] = 0.0
    for i in range(n):
        x[place[i], 0] = -force[i] * tb.unit[i] / scale
    for r in range(m):
        x[place[n + r], 0] = -gap[r] / tb.rows.unit[r]
    solve_band(own.B[MASS], own.over[MASS], own.pivot[MASS], own.low[MASS], own.top[MASS], x)
    for i in range(n):
        force[i] = found[place[i], 0, 0] * tb.unit[i]
    for r in range(m):
        gap[r] = found[place[n + r], 0, 0] * scale / tb.rows.unit[r]


FUNCTIONS = (
    factorise_band,
    solve_band,
    assemble,
    factorise,
    factorise_mass,
    across,
    solve_systems,
    solve,
    solve_mass,
)
NAMES = {"STEP": STEP, "MASS": MASS, "DIAGONAL": DIAGONAL}
