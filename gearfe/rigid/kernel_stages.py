"""States of the stages of a step of collocation, its error, its end on the constraints, compiled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..typing import Array
from .kernel_elastic import bar_changes, float_changes
from .kernel_equations import variables
from .kernel_matrices import factorise_mass, solve, solve_real
from .kernel_quadratic import gradients, row_orders
from .kernel_rows import fill, time_series

if TYPE_CHECKING:
    from .collocation import Scheme
    from .kernel_collocation import Stages
    from .kernel_equations import Equations


def combine(X: Array, Y: Array, out: Array) -> None:
    """out := X Y, for as many rows of Y as X has columns."""
    for i in range(X.shape[0]):
        for a in range(Y.shape[1]):
            out[i, a] = 0.0
        for j in range(X.shape[1]):
            factor = X[i, j]
            if factor != 0.0:
                for a in range(Y.shape[1]):
                    out[i, a] += factor * Y[j, a]


def change(eq: Equations, w: Stages, tab: Scheme, h: float, moved: bool) -> float:
    """Positions, velocities, accelerations of the stages from Z, after its changes and those of the multipliers and
    stresses; the largest change of a position over its limit."""
    s, n = w.Z.shape
    most = 0.0
    if moved:
        for i in range(s):
            for a in range(n):
                part = abs(w.dZ[i, a]) / w.limit[a]
                most = part if not part <= most else most
                w.Z[i, a] += w.dZ[i, a]
            for r in range(w.L.shape[1]):
                w.L[i, r] += w.dL[i, r]
        combine(tab.inverse, w.dZ, w.r)
        for i in range(s):
            for a in range(n):
                w.r[i, a] /= h
            bar_changes(eq.program.bars, w.dZ[i], w.r[i], eq.own, w.S[i])
            float_changes(eq.program.floats, w.dZ[i], w.r[i], eq.own, w.S[i])
    combine(tab.inverse, w.Z, w.V)
    combine(tab.twice, w.Z, w.A)
    for i in range(s):
        for a in range(n):
            w.Q[i, a] = w.q[a] + tab.c[i] * h * w.v[a] + w.Z[i, a]
            w.V[i, a] = w.v[a] + w.V[i, a] / h
            w.A[i, a] /= h * h
    return most


def defect(eq: Equations, w: Stages, tab: Scheme, h: float) -> float:
    """Error of the step over its limit; what rows can carry at the begin is none of it."""
    own, band = eq.own, eq.band
    s, n = w.Z.shape
    first, right = own.F, w.r[0]
    one = tab.values[0, 0] / h
    for a in range(n):
        first[a] = w.v[a]
        w.dZ[0, a] = 0.0
        right[a] = w.rest[s, a]
        for i in range(s):
            first[a] -= tab.defect[i] * w.V[i, a]
            w.dZ[0, a] += tab.defect[i] * w.A[i, a]
    for e in range(band.held.shape[0]):
        right[band.held[e, 0]] += band.mass[e] * w.dZ[0, band.held[e, 1]]
    fill(w.g[0], 0.0)
    if w.g.shape[1] > 0:
        variables(eq, w.q, w.v)
        gradients(eq.program, own.P, own)
        if not factorise_mass(eq):
            return np.inf
        solve_real(eq, own.B[1], own.scale.shape[0] - 1, right, w.g[0])
        for a in range(n):
            w.dZ[0, a] = right[a]
            right[a] = 0.0
        for e in range(band.held.shape[0]):
            right[band.held[e, 0]] -= band.mass[e] * w.dZ[0, band.held[e, 1]]
    for e in range(band.held.shape[0]):
        right[band.held[e, 0]] -= one * band.mass[e] * first[band.held[e, 1]]
    for e in range(band.entry.shape[0]):
        right[band.entry[e, 0]] += own.C[band.entry[e, 0], band.entry[e, 1]] * first[band.entry[e, 1]]
    fill(w.g[0], 0.0)
    solve(eq, w, tab, 0)
    total = 0.0
    for a in range(n):
        total += (right[a] / w.limit[a]) ** 2
    return math.sqrt(total / n)


def end_state(w: Stages, tab: Scheme, h: float) -> None:
    """Coordinates and velocities at the step's end."""
    for a in range(w.q.shape[0]):
        w.qn[a] = w.q[a] + h * w.v[a]
        w.vn[a] = w.v[a]
        for i in range(w.Z.shape[0]):
            w.qn[a] += tab.ends[0, i] * w.Z[i, a]
            w.vn[a] += tab.ends[1, i] * w.Z[i, a] / h


def keep_path(w: Stages, h: float) -> None:
    """What the dense output goes through."""
    last = w.known.shape[0] - 1
    for a in range(w.q.shape[0]):
        w.known[0, a] = w.q[a]
        w.known[1, a] = h * w.v[a]
        for k in range(last - 3):
            w.known[k + 2, a] = w.Q[k, a]
        w.known[last - 1, a] = w.qn[a]
        w.known[last, a] = h * w.vn[a]


def row_gap(eq: Equations, q: Array, t: float, forward: bool, gap: Array) -> float:
    """Rows at coordinates, and the largest in its unit."""
    tb, own = eq.program, eq.own
    variables(eq, q, own.F)
    time_series(tb.times, t, forward, 2, own.TF)
    row_orders(tb, own.P, own.TF, 0, gap)
    most = 0.0
    for r in range(gap.shape[0]):
        most = max(most, abs(gap[r]) / tb.rows.unit[r])
    return most


def gap_between(eq: Equations, w: Stages, tab: Scheme, t: float, h: float) -> float:
    """Largest gap of a row between the stages, in its unit."""
    combine(tab.between, w.known, w.dZ)
    most = 0.0
    for i in range(w.dZ.shape[0]):
        most = max(most, row_gap(eq, w.dZ[i], t + tab.middles[i] * h, h > 0.0, w.gap[0]))
    return most


def project(eq: Equations, w: Stages, t: float) -> None:
    """w.qn, w.vn onto the constraints, by the least changes in the mass norm."""
    tb, own = eq.program, eq.own
    n = w.qn.shape[0]
    gap, last = w.g[0], own.scale.shape[0] - 1
    if gap.shape[0] == 0:
        return
    before = w.now[1] < 0.0
    for turn in range(5):
        most = row_gap(eq, w.qn, t, before, gap)
        if turn > 0 and not most > 1e-14:
            break
        if turn == 0:
            gradients(tb, own.P, own)
            if not factorise_mass(eq):
                w.qn[0] = np.nan
                return
        fill(w.r[0], 0.0)
        solve_real(eq, own.B[1], last, w.r[0], gap)
        for i in range(n):
            w.qn[i] += w.r[0, i]
    variables(eq, w.qn, w.vn)
    row_orders(tb, own.P, own.TF, 1, gap)
    fill(w.r[0], 0.0)
    solve_real(eq, own.B[1], last, w.r[0], gap)
    for i in range(n):
        w.vn[i] += w.r[0, i]


FUNCTIONS = (combine, change, defect, end_state, keep_path, row_gap, gap_between, project)
