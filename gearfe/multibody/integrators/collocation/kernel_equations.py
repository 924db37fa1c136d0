"""What a step of collocation asks of a system that is written on a tape: forces of all stages, tangents of one.

Forces of registers and their derivatives are orders 0 and 1 of the registers' series (`series.recurrences`), those of
beams and of bodies in floating frames are in closed form, as in `beam.Beam` and `floating.Floating`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....typing import Array, IntArray
from ...compiled.simd import Lanes
from ...series.recurrences import (
    cauchy,
    curve_forces,
    curve_orders,
    fill,
    piece_at,
    set_pieces,
    tape_order,
    time_series,
)
from .kernel_elastic import add_bar_tangents, add_bars, add_float_tangents, add_floats

if TYPE_CHECKING:
    from ...compiled.simd import flat
    from ...series.tape import Program
    from .kernel_collocation import Stages
    from .scheme import Scheme


class Band(NamedTuple):
    """Order of the unknowns and entries of the matrices."""

    place: IntArray  # (N,) of coordinates, then rows, in the matrices; N = n + m
    entry: IntArray  # (e, 2) of the matrices that may be none, but for the rows'
    mass: Array  # (e,) of them
    held: IntArray  # (p, 2) of the mass matrix
    masses: Array  # (p,)
    acting: IntArray  # (a,) coordinates that registers depend on
    begin: IntArray  # (N,) first and last rows that a column of the factors may come to
    reach: IntArray  # (N,)
    right: IntArray  # (N,) last column of each row of the matrices


class Scratch(NamedTuple):
    """Work arrays of one state, and the factors of all systems, R = r + 1."""

    q: Array  # (n,)
    v: Array
    s: Array  # (k,) stresses
    L: Array  # (m,) multipliers
    gap: Array  # (m,)
    at: Array  # (1,) time of the factor of the mass matrix
    P: Array  # (z, 3) series of the variables
    R: Array  # (registers, 3)
    TF: Array  # (functions, 4)
    pieces: IntArray  # of the switches
    H: Array  # (z, 1)
    F: Array  # (n,)
    D: Array  # (m, z) rows by variables
    G: Array  # (m, n)
    K: Array  # (n, n) derivatives of the forces, less those of the rows' forces, by coordinates
    C: Array  # (n, n) by velocities
    B: Lanes  # (2, N, N, 2, R) factors of the step's matrices and of the mass matrix
    over: Lanes  # (2, N, 2, R)
    scale: Lanes  # (2, R)
    pivot: IntArray  # (2, N)
    low: IntArray  # (2, N)
    top: IntArray  # (2, N)
    right: IntArray  # (N,)
    x: Lanes  # (N, 2, R)
    law: Array  # (k, widest) derivatives of the stresses
    slope: Array  # (3, 4)
    by: Array  # (2, 4, 4) tangents of a beam's point by its strains' arguments, and by their rates
    shapes: (
        Array  # (4, widest) of a body in a floating frame: shares of modes, strains, rates of the shares, their forces
    )
    pairs: Array  # (widest, widest) derivatives of these forces by the shares
    drift: Array  # (coordinates,) derivatives of a strain's rate
    blocks: Array  # (strains, coordinates)


class Wide(NamedTuple):
    """Work arrays of all stages."""

    P: Lanes  # (z, 2, W) variables and rates
    TF: Lanes  # (functions, 2, W)
    H: Lanes  # (z, 1, W)
    F: Lanes  # (n, W)
    shapes: Lanes  # (2, widest, W)
    blocks: Lanes  # (strains, coordinates, W)


class Equations(NamedTuple):
    """A system."""

    program: Program
    band: Band
    own: Scratch
    wide: Wide


def row_orders(tb: Program, Z: Array, TF: Array, k: int, out: Array) -> None:
    """Write order k of the series of all rows.

    Parameters
    ----------
    tb : Program
        The system.
    Z : ndarray or SIMD, shape (z, orders[, W])
        Series of the variables, at one place or at all stages.
    TF : ndarray or SIMD, shape (functions, orders[, W])
        Series of the functions of time.
    k : int
        Order.
    out : ndarray or SIMD, shape (m[, W])
        Order k of the rows.
    """
    rows = tb.rows
    for r in range(rows.constant.shape[0]):
        out[r] = rows.constant[r] if k == 0 else 0.0
        if rows.motion[r] >= 0:
            out[r] -= TF[rows.motion[r], k]
    for p in range(rows.place.shape[0]):
        out[rows.place[p, 0]] += rows.factor[p] * Z[rows.place[p, 1], k]
    for p in range(rows.pair.shape[0]):
        out[rows.pair[p, 0]] += rows.weight[p] * cauchy(Z, rows.pair[p, 1], Z, rows.pair[p, 2], k)


def gradients(tb: Program, Z: Array, w: Scratch) -> None:
    """w.G := dg/dq where the variables are Z[:, 0]."""
    rows, curves, G, D = tb.rows, tb.curves, w.G, w.D
    n = tb.mass.shape[0]
    for r in range(D.shape[0]):
        fill(D[r], 0.0)
    for p in range(rows.place.shape[0]):
        D[rows.place[p, 0], rows.place[p, 1]] += rows.factor[p]
    for p in range(rows.pair.shape[0]):
        r, i, j = rows.pair[p, 0], rows.pair[p, 1], rows.pair[p, 2]
        D[r, i] += rows.weight[p] * Z[j, 0]
        D[r, j] += rows.weight[p] * Z[i, 0]
    for r in range(D.shape[0]):
        for i in range(n):
            G[r, i] = D[r, i]
        for f in range(curves.place.shape[0]):
            G[r, curves.place[f, 0]] += D[r, n + f] * curves.sign[f] * Z[curves.place[f, 1], 0]


def coordinate_pieces(eq: Equations, q: Array) -> None:
    """Pieces of the tables of coordinates."""
    tb, pieces = eq.program, eq.own.pieces
    for f in range(tb.curves.sign.shape[0]):
        s = tb.curves.place[f, 2]
        if s >= 0 and tb.curves.place[f, 3] == 0:
            piece = piece_at(tb.switches, s, q[tb.curves.place[f, 0]])
            pieces[s] = piece if tb.switches.period[s] > 0.0 else max(0, piece)


def variables(eq: Equations, q: Array, v: Array) -> None:
    """P := variables and rates of one state."""
    tb, own, P = eq.program, eq.own, eq.own.P
    for i in range(q.shape[0]):
        P[i, 0] = q[i]
        P[i, 1] = v[i]
        P[i, 2] = 0.0
    coordinate_pieces(eq, q)
    curve_orders(tb, P, own.pieces, 0)
    curve_orders(tb, P, own.pieces, 1)


def all_variables(eq: Equations, q: Lanes, v: Lanes) -> None:
    """wide.P := variables and rates of all stages; these may be on different pieces of tables."""
    tb, own, P = eq.program, eq.own, eq.wide.P
    place, values, Q = tb.curves.place, flat(P), flat(q)
    n = q.shape[0]
    tables = False
    for i in range(n):
        P[i, 0] = q[i]
        P[i, 1] = v[i]
    for f in range(place.shape[0]):
        tables = tables or place[f, 2] >= 0
    curve_orders(tb, P, own.pieces, 0)
    if tables:
        for i in range(Q.shape[1]):
            for j in range(n):
                own.q[j] = Q[j, i]
                own.P[j, 0] = Q[j, i]
            coordinate_pieces(eq, own.q)
            curve_orders(tb, own.P, own.pieces, 0)
            for f in range(place.shape[0]):
                if place[f, 2] >= 0:
                    values[n + f, 0, i] = own.P[n + f, 0]
    curve_orders(tb, P, own.pieces, 1)


def registers_push(eq: Equations, k: int, F: Array) -> None:
    """F += order k of the registers as forces on the coordinates; these are in H, too."""
    own, code = eq.own, eq.program.code
    H = own.H
    for i in range(H.shape[0]):
        H[i, 0] = 0.0
    for p in range(code.push.shape[0]):
        H[code.push[p, 1], 0] += code.share[p] * own.R[code.push[p, 0], k]
    for i in range(F.shape[0]):
        F[i] += H[i, 0]
    curve_forces(eq.program, own.P, H, 0, F)


def lane_times(eq: Equations, places: Array, t: float, h: float) -> None:
    """Write the functions of time and their rates at all stages of a step.

    Parameters
    ----------
    eq : Equations
        The system; ``eq.wide.TF`` changes.
    places : ndarray, shape (W,)
        Shares of the step at the stages, last the 0 of its begin.
    t : float
        Time at the begin (s).
    h : float
        Step (s), negative backwards in time.
    """
    TF, values = eq.own.TF, flat(eq.wide.TF)
    last = places.shape[0] - 1
    for i in range(last + 1):
        time_series(eq.program.times, t + places[i] * h, (h > 0.0) == (i == last), 2, TF)
        for f in range(TF.shape[0]):
            values[f, 0, i] = TF[f, 0]
            values[f, 1, i] = TF[f, 1]


def add_registers(eq: Equations) -> float:
    """H += forces of the registers, stage by stage; how many stages are beyond the end of a table."""
    tb, own = eq.program, eq.own
    code = tb.code
    P, TF, H = flat(eq.wide.P), flat(eq.wide.TF), flat(eq.wide.H)
    beyond = 0.0
    for i in range(P.shape[2]):
        for z in range(P.shape[0]):
            own.P[z, 0] = P[z, 0, i]
            own.P[z, 1] = P[z, 1, i]
        for f in range(TF.shape[0]):
            own.TF[f, 0] = TF[f, 0, i]
        covered = set_pieces(tb, own.P, own.R, own.TF, own.pieces)
        tape_order(tb, own.P, own.R, own.TF, own.pieces, 0)
        for p in range(code.push.shape[0]):
            H[code.push[p, 1], 0, i] += code.share[p] * own.R[code.push[p, 0], 0]
        if not covered and i < P.shape[2] - 1:
            beyond += 1.0
    return beyond


def stages(eq: Equations, w: Stages, tab: Scheme) -> None:
    """w.rest, w.gap: what is left of the equations at all stages; their stresses become those of their coordinates.

    The force is the one that Newton's method sees (`beam.Tangent`).
    """
    tb, band, wide, rows = eq.program, eq.band, eq.wide, eq.program.rows
    P, H, F = wide.P, wide.H, wide.F
    n = w.q.shape[0]
    all_variables(eq, w.Q, w.V)
    row_orders(tb, P, wide.TF, tab.level, w.gap)
    if tab.level == 1:
        for r in range(w.gap.shape[0]):
            w.gap[r] *= w.now[1]
    for z in range(H.shape[0]):
        H[z, 0] = 0.0
    w.measures[3] = add_registers(eq) if tb.code.op.shape[0] > 0 else 0.0
    for p in range(rows.place.shape[0]):
        H[rows.place[p, 1], 0] -= rows.factor[p] * w.L[rows.place[p, 0]]
    for p in range(rows.pair.shape[0]):
        one = rows.pair[p, 1]
        two = rows.pair[p, 2]
        force = rows.weight[p] * w.L[rows.pair[p, 0]]
        H[one, 0] -= force * P[two, 0]
        H[two, 0] -= force * P[one, 0]
    for i in range(n):
        F[i] = H[i, 0] + tb.constant[i]
    curve_forces(tb, P, H, 0, F)
    for e in range(tb.block.shape[0]):
        F[tb.block[e, 0]] -= tb.stiffness[e] * w.Q[tb.block[e, 1]] + tb.damping[e] * w.V[tb.block[e, 1]]
    add_bars(tb.bars, w.Q, w.V, w.S, eq.own.law, F)
    add_floats(tb.floats, w.Q, w.V, w.S, eq.own.law, wide.shapes, wide.blocks, F)
    for i in range(n):
        w.rest[i] = -F[i]
    for e in range(band.held.shape[0]):
        w.rest[band.held[e, 0]] += band.masses[e] * w.A[band.held[e, 1]]


def linearise(eq: Equations, w: Stages, i: int, t: float) -> bool:
    """Write the tangents K and C and the gradients G of the rows at a stage.

    Parameters
    ----------
    eq : Equations
        The system; ``eq.own`` changes.
    w : Stages
        State and unknowns of the step.
    i : int
        Number of the stage.
    t : float
        Its time (s).

    Returns
    -------
    finite : bool
        Whether the tangents are finite.
    """
    tb, own, band = eq.program, eq.own, eq.band
    K, C, P, D, q, v, L = own.K, own.C, own.P, own.D, own.q, own.v, own.L
    n = q.shape[0]
    Q, V, S, Ls = flat(w.Q), flat(w.V), flat(w.S), flat(w.L)
    for a in range(n):
        q[a] = Q[a, i]
        v[a] = V[a, i]
    for k in range(own.s.shape[0]):
        own.s[k] = S[k, i]
    for r in range(L.shape[0]):
        L[r] = Ls[r, i]
    for e in range(band.entry.shape[0]):
        K[band.entry[e, 0], band.entry[e, 1]] = 0.0
        C[band.entry[e, 0], band.entry[e, 1]] = 0.0
    variables(eq, q, v)
    time_series(tb.times, t, w.now[1] < 0.0, 2, own.TF)
    gradients(tb, P, own)
    rows = tb.rows
    for p in range(rows.pair.shape[0]):
        one = rows.pair[p, 1]
        two = rows.pair[p, 2]
        factor = L[rows.pair[p, 0]] * rows.weight[p] * turned(tb, P, one) * turned(tb, P, two)
        a = coordinate(tb, one)
        b = coordinate(tb, two)
        K[a, b] -= factor
        K[b, a] -= factor
    for r in range(D.shape[0]):
        for f in range(tb.curves.sign.shape[0]):
            j = tb.curves.place[f, 0]
            K[j, j] -= L[r] * D[r, n + f] * bend(tb, P, f)
    for e in range(tb.block.shape[0]):
        K[tb.block[e, 0], tb.block[e, 1]] -= tb.stiffness[e]
        C[tb.block[e, 0], tb.block[e, 1]] -= tb.damping[e]
    add_bar_tangents(tb.bars, q, v, own.s, own, K, C)
    add_float_tangents(tb.floats, q, v, own.s, own, K, C)
    if tb.code.push.shape[0] > 0:
        add_register_tangents(eq, q, v)
    total = 0.0
    for e in range(band.entry.shape[0]):
        total += K[band.entry[e, 0], band.entry[e, 1]] + C[band.entry[e, 0], band.entry[e, 1]]
    return bool(np.isfinite(total))


def coordinate(tb: Program, variable: int) -> int:
    """Number of the coordinate that a variable depends on."""
    n = tb.mass.shape[0]
    if variable < n:
        return variable
    return tb.curves.place[variable - n, 0]


def turned(tb: Program, P: Array, variable: int) -> float:
    """Derivative of a variable by its coordinate."""
    n = tb.mass.shape[0]
    if variable < n:
        return 1.0
    return tb.curves.sign[variable - n] * P[tb.curves.place[variable - n, 1], 0]


def bend(tb: Program, P: Array, f: int) -> float:
    """Second derivative of a function of a coordinate by it."""
    return tb.curves.sign[f] * turned(tb, P, tb.curves.place[f, 1])


def add_register_tangents(eq: Equations, q: Array, v: Array) -> None:
    """K, C += derivatives of the registers' forces: order 1 of their series along a direction, rates apart."""
    tb, own, band = eq.program, eq.own, eq.band
    P, R, F, curves = own.P, own.R, own.F, tb.curves
    n = q.shape[0]
    set_pieces(tb, P, R, own.TF, own.pieces)
    tape_order(tb, P, R, own.TF, own.pieces, 0)
    for f in range(own.TF.shape[0]):
        own.TF[f, 1] = 0.0
    registers_push(eq, 0, F)
    for f in range(curves.sign.shape[0]):
        own.K[curves.place[f, 0], curves.place[f, 0]] += own.H[n + f, 0] * bend(tb, P, f)
    for d in range(2 * band.acting.shape[0]):
        j = band.acting[d // 2]
        by_rate = d % 2 == 1
        for i in range(P.shape[0]):
            P[i, 1] = 0.0
            P[i, 2] = 0.0
        if by_rate:
            P[j, 2] = 0.5
        else:
            P[j, 1] = 1.0
        for f in range(curves.sign.shape[0]):
            if curves.place[f, 0] == j:
                if by_rate:
                    P[n + f, 2] = 0.5 * turned(tb, P, n + f)
                else:
                    P[n + f, 1] = turned(tb, P, n + f)
                    P[n + f, 2] = 0.5 * bend(tb, P, f) * v[j]
        tape_order(tb, P, R, own.TF, own.pieces, 1)
        fill(F, 0.0)
        registers_push(eq, 1, F)
        for i in range(n):
            if F[i] != 0.0:
                if by_rate:
                    own.C[i, j] += F[i]
                else:
                    own.K[i, j] += F[i]


FUNCTIONS = (
    row_orders, gradients, coordinate_pieces, variables, all_variables, registers_push, lane_times, add_registers,
    coordinate, turned, bend, add_register_tangents, stages, linearise,
)  # fmt: skip
