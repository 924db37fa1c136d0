"""States of the stages of a step of collocation, its error, its end on the constraints, compiled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...series.recurrences import fill, time_series
from .kernel_elastic import bar_changes, float_changes
from .kernel_equations import all_variables, gradients, lane_times, row_orders, stages, variables
from .kernel_matrices import across, factorise_mass, solve_mass, solve_systems

if TYPE_CHECKING:
    from ...compiled.simd import flat, highest, total
    from .kernel_collocation import Stages
    from .kernel_equations import Equations
    from .scheme import Scheme


def begin(eq: Equations, w: Stages, tab: Scheme) -> None:
    """The stages as the step before tells them, with the stresses of the begin, and times of all."""
    t = w.now[0]
    h = w.now[1]
    s = tab.c.shape[0]
    lane_times(eq, tab.side.c, t, h)
    for a in range(w.q.shape[0]):
        made = w.guess[0] * w.speeds[0, a]
        for k in range(1, w.guess.shape[0]):
            made += w.guess[k] * w.speeds[k, a]
        w.Z[a] = made
    across(tab.side.inverse, w.Z, w.V)
    across(tab.side.inverse, w.V, w.A)
    Q = flat(w.Q)
    for a in range(w.q.shape[0]):
        w.Q[a] = w.Z[a] + w.q[a]
        for i in range(s):
            Q[a, i] += tab.c[i] * h * w.v[a]
        w.V[a] = w.V[a] * (1.0 / h) + w.v[a]
        w.A[a] *= 1.0 / (h * h)
    L = flat(w.L)
    for r in range(L.shape[0]):
        w.L[r] = w.multipliers[r]
        L[r, s] = 0.0
    stages(eq, w, tab)  # the stresses become those of the coordinates
    S = flat(w.S)
    for k in range(S.shape[0]):
        w.S[k] = S[k, s]


def change(eq: Equations, w: Stages, tab: Scheme) -> float:
    """The stages after their changes; the largest change of a position over its limit."""
    h = w.now[1]
    most = 0.0 * w.dZ[0]
    across(tab.side.inverse, w.dZ, w.r)
    for a in range(w.q.shape[0]):
        most = np.maximum(most, abs(w.dZ[a]) * (1.0 / w.limit[a]))
        w.r[a] *= 1.0 / h
        w.Z[a] += w.dZ[a]
        w.Q[a] += w.dZ[a]
        w.V[a] += w.r[a]
    for r in range(w.L.shape[0]):
        w.L[r] += w.dL[r]
    bar_changes(eq.program.bars, w.dZ, w.r, eq.own.law, w.S)
    float_changes(eq.program.floats, w.dZ, w.r, eq.own.law, w.S)
    across(tab.side.inverse, w.r, w.dZ)
    for a in range(w.q.shape[0]):
        w.A[a] += w.dZ[a] * (1.0 / h)
    return highest(most)


def defect(eq: Equations, w: Stages, tab: Scheme) -> float:
    """Error of the step over its limit; what rows can carry at the begin is none of it."""
    own, band = eq.own, eq.band
    n = w.q.shape[0]
    s = tab.c.shape[0]
    first, second, right, gap = own.F, own.q, own.v, own.gap
    one = tab.values[0, 0] / w.now[1]
    rest = flat(w.rest)
    for a in range(n):
        first[a] = w.v[a] - total(tab.side.defect[0] * w.V[a])
        second[a] = total(tab.side.defect[0] * w.A[a])
        right[a] = rest[a, s]
    for e in range(band.held.shape[0]):
        right[band.held[e, 0]] += band.masses[e] * second[band.held[e, 1]]
    if gap.shape[0] > 0:
        if own.at[0] != w.now[0]:  # else the step before has left it
            variables(eq, w.q, w.v)
            gradients(eq.program, own.P, own)
            if not factorise_mass(eq, tab, w.now[0]):
                return np.inf
        fill(gap, 0.0)
        solve_mass(eq, right, gap)
        for a in range(n):
            second[a] = right[a]
            right[a] = 0.0
        for e in range(band.held.shape[0]):
            right[band.held[e, 0]] -= band.masses[e] * second[band.held[e, 1]]
    for e in range(band.held.shape[0]):
        right[band.held[e, 0]] -= one * band.masses[e] * first[band.held[e, 1]]
    for e in range(band.entry.shape[0]):
        right[band.entry[e, 0]] += own.C[band.entry[e, 0], band.entry[e, 1]] * first[band.entry[e, 1]]
    found = flat(w.r)
    for a in range(n):
        w.r[a] = 0.0
        found[a, 0] = right[a]
    for r in range(gap.shape[0]):
        w.g[r] = 0.0
    solve_systems(eq, w, tab)
    sum_of = 0.0
    for a in range(n):
        sum_of += (found[a, 0] / w.limit[a]) ** 2
    return math.sqrt(sum_of / n)


def end_state(w: Stages, tab: Scheme) -> None:
    """Coordinates and velocities at the step's end."""
    h = w.now[1]
    for a in range(w.q.shape[0]):
        w.qn[a] = w.q[a] + h * w.v[a] + total(tab.side.ends[0] * w.Z[a])
        w.vn[a] = w.v[a] + total(tab.side.ends[1] * w.Z[a]) / h


def keep_path(w: Stages) -> None:
    """What the dense output goes through."""
    h = w.now[1]
    last = w.known.shape[0] - 1
    Q = flat(w.Q)
    for a in range(w.q.shape[0]):
        w.known[0, a] = w.q[a]
        w.known[1, a] = h * w.v[a]
        for k in range(last - 3):
            w.known[k + 2, a] = Q[a, k]
        w.known[last - 1, a] = w.qn[a]
        w.known[last, a] = h * w.vn[a]


def gap_between(eq: Equations, w: Stages, tab: Scheme) -> float:
    """Largest gap of a row between the stages, in its unit."""
    tb, wide = eq.program, eq.wide
    between = tab.side.between
    lane_times(eq, tab.side.middles, w.now[0], w.now[1])
    for a in range(w.q.shape[0]):
        made = between[0] * w.known[0, a]
        for k in range(1, between.shape[0]):
            made += between[k] * w.known[k, a]
        w.dZ[a] = made
    all_variables(eq, w.dZ, w.dZ)
    row_orders(tb, wide.P, wide.TF, 0, w.gap)
    most = 0.0 * between[0]
    for r in range(w.gap.shape[0]):
        most = np.maximum(most, abs(w.gap[r]) * (1.0 / tb.rows.unit[r]))
    return highest(most)


def project(eq: Equations, w: Stages, tab: Scheme) -> None:
    """w.qn, w.vn onto the constraints, by the least changes in the mass norm."""
    tb, own = eq.program, eq.own
    n = w.qn.shape[0]
    gap, moved = own.gap, own.q
    if gap.shape[0] == 0:
        return
    time_series(tb.times, w.now[0] + w.now[1], w.now[1] < 0.0, 2, own.TF)
    for turn in range(5):
        variables(eq, w.qn, w.vn)
        row_orders(tb, own.P, own.TF, 0, gap)
        most = 0.0
        for r in range(gap.shape[0]):
            most = max(most, abs(gap[r]) / tb.rows.unit[r])
        if turn > 0 and not most > 1e-14:
            break
        if turn == 0:
            gradients(tb, own.P, own)
            if not factorise_mass(eq, tab, w.now[0] + w.now[1]):
                w.qn[0] = np.nan
                return
        fill(moved, 0.0)
        solve_mass(eq, moved, gap)
        for i in range(n):
            w.qn[i] += moved[i]
    variables(eq, w.qn, w.vn)
    row_orders(tb, own.P, own.TF, 1, gap)
    fill(moved, 0.0)
    solve_mass(eq, moved, gap)
    for i in range(n):
        w.vn[i] += moved[i]


FUNCTIONS = (begin, change, defect, end_state, keep_path, gap_between, project)
