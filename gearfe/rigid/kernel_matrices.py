"""Matrices of a step of collocation in units that compare, their factors and solutions, compiled.

Those of all eigenvalues lie side by side in lanes (`kernel_saddle`); the matrix of masses, too, in every lane alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..typing import Array
from .kernel_saddle import factorise_band, solve_band
from .lanes import Lanes

if TYPE_CHECKING:
    from .collocation import Scheme
    from .kernel_collocation import Stages
    from .kernel_equations import Equations
    from .lanes import flat, halves

#: Numbers of the factors: of the step's matrices, and of the masses with the rows.
STEP, MASS = 0, 1


def assemble(eq: Equations, k: int, x: Any, y: Any, tangents: float) -> bool:
    """Factor k := that of the matrices with mu/h = x + i y, in units that compare; with the tangents, or without."""
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


FUNCTIONS = (assemble, factorise, factorise_mass, across, solve_systems, solve, solve_mass)
NAMES = {"STEP": STEP, "MASS": MASS}
