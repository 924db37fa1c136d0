"""Matrices of a step of collocation in units that compare, their factors and solutions, compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..typing import Array
from .kernel_rows import fill
from .kernel_saddle import factorise_band, solve_band

if TYPE_CHECKING:
    from .collocation import Scheme
    from .kernel_collocation import Stages
    from .kernel_equations import Equations


def assemble(eq: Equations, A: Any, mu: Any, h: float) -> float:
    """A := the matrix of an eigenvalue, in units that compare; its scale."""
    tb, own, band = eq.program, eq.own, eq.band
    unit, place = tb.unit, band.place
    n = unit.shape[0]
    for i in range(A.shape[0]):
        for j in range(A.shape[0]):
            A[i, j] = 0.0
    one = mu / h
    for e in range(band.held.shape[0]):
        i = band.held[e, 0]
        j = band.held[e, 1]
        A[place[i], place[j]] = one * one * band.mass[e]
    for e in range(band.entry.shape[0]):
        i = band.entry[e, 0]
        j = band.entry[e, 1]
        A[place[i], place[j]] -= one * own.C[i, j] + own.K[i, j]
    most = 1e-300
    for i in range(n):
        value = A[place[i], place[i]]
        most = max(most, (abs(value.real) + abs(value.imag)) * unit[i] ** 2)
    for e in range(band.entry.shape[0]):
        i = band.entry[e, 0]
        j = band.entry[e, 1]
        A[place[i], place[j]] *= unit[i] * unit[j] / most
    put_rows(eq, A)
    return most


def put_rows(eq: Equations, A: Any) -> None:
    """G into a matrix."""
    tb, place, G = eq.program, eq.band.place, eq.own.G
    n = tb.unit.shape[0]
    for r in range(G.shape[0]):
        for i in range(n):
            if G[r, i] != 0.0:
                value = G[r, i] * tb.unit[i] / tb.rows.unit[r]
                A[place[n + r], place[i]] = value
                A[place[i], place[n + r]] = value


def factorise(eq: Equations, w: Stages, tab: Scheme, k: int, h: float) -> bool:  # noqa: ARG001
    """Factor of eigenvalue k."""
    own = eq.own
    if k == 0:
        own.scale[0] = assemble(eq, own.B[0], tab.values[0, 0], h)
        return factorise_band(own.B[0], own.pivot[0], own.first[0], own.last[0])
    own.scale[k] = assemble(eq, own.A[k - 1], complex(tab.values[k, 0], tab.values[k, 1]), h)
    return factorise_band(own.A[k - 1], own.pivot[k], own.first[k], own.last[k])


def solve_real(eq: Equations, B: Array, k: int, force: Array, gap: Array) -> None:
    """force, gap := minus the solution by a real factor, whose pivots are those of number k."""
    tb, own, place = eq.program, eq.own, eq.band.place
    x, scale = own.x, own.scale[k]
    n = tb.unit.shape[0]
    m = tb.rows.unit.shape[0]
    for i in range(n):
        x[place[i]] = -force[i] * tb.unit[i] / scale
    for r in range(m):
        x[place[n + r]] = -gap[r] / tb.rows.unit[r]
    solve_band(B, own.pivot[k], own.first[k], own.last[k], x)
    for i in range(n):
        force[i] = x[place[i]] * tb.unit[i]
    for r in range(m):
        gap[r] = x[place[n + r]] * scale / tb.rows.unit[r]


def solve(eq: Equations, w: Stages, tab: Scheme, k: int) -> None:
    """w.r, w.g of eigenvalue k := changes."""
    tb, own, place = eq.program, eq.own, eq.band.place
    y, scale = own.y, own.scale[k]
    n = tb.unit.shape[0]
    m = tb.rows.unit.shape[0]
    if k == 0:
        if tab.level == 1:
            for r in range(m):
                w.g[0, r] /= tab.values[0, 0]
        solve_real(eq, own.B[0], 0, w.r[0], w.g[0])
        return
    mu = complex(tab.values[k, 0], tab.values[k, 1]) if tab.level == 1 else complex(1.0, 0.0)
    a = 2 * k - 1
    b = 2 * k
    for i in range(n):
        y[place[i]] = complex(-w.r[a, i], -w.r[b, i]) * (tb.unit[i] / scale)
    for r in range(m):
        y[place[n + r]] = complex(-w.g[a, r], -w.g[b, r]) / (mu * tb.rows.unit[r])
    solve_band(own.A[k - 1], own.pivot[k], own.first[k], own.last[k], y)
    for i in range(n):
        w.r[a, i] = y[place[i]].real * tb.unit[i]
        w.r[b, i] = y[place[i]].imag * tb.unit[i]
    for r in range(m):
        w.g[a, r] = y[place[n + r]].real * scale / tb.rows.unit[r]
        w.g[b, r] = y[place[n + r]].imag * scale / tb.rows.unit[r]


def factorise_mass(eq: Equations) -> bool:
    """Factor of the matrix of masses and of the rows in G."""
    tb, own, band = eq.program, eq.own, eq.band
    B, last = own.B[1], own.scale.shape[0] - 1
    for i in range(B.shape[0]):
        fill(B[i], 0.0)
    most = 1e-300
    for e in range(band.held.shape[0]):
        if band.held[e, 0] == band.held[e, 1]:
            most = max(most, band.mass[e] * tb.unit[band.held[e, 0]] ** 2)
    for e in range(band.held.shape[0]):
        i = band.held[e, 0]
        j = band.held[e, 1]
        B[band.place[i], band.place[j]] = band.mass[e] * tb.unit[i] * tb.unit[j] / most
    put_rows(eq, B)
    own.scale[last] = most
    return factorise_band(B, own.pivot[last], own.first[last], own.last[last])


FUNCTIONS = (put_rows, assemble, factorise, solve_real, solve, factorise_mass)
