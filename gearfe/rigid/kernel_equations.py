"""What a step of collocation asks of a system that is written on a tape: forces, tangents, rows, compiled.

Forces of registers and their derivatives are orders 0 and 1 of the registers' series (`kernel_tape`), those of beams
and of bodies in floating frames are in closed form, as in `beam.Beam` and `floating.Floating`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..typing import Array, IntArray
from .kernel_elastic import add_bar_tangents, add_bars, add_float_tangents, add_floats
from .kernel_quadratic import gradients, row_orders
from .kernel_rows import copy, fill, time_series
from .kernel_tape import curve_forces, curve_orders, piece_at, tape_order

if TYPE_CHECKING:
    from .collocation import Scheme
    from .kernel_collocation import Stages
    from .tape import Program


class Band(NamedTuple):
    """Order of the unknowns and entries of the matrices."""

    place: IntArray  # (n + m,) of coordinates, then rows, in the matrices
    entry: IntArray  # (e, 2) of the tangents that may be none
    held: IntArray  # (p, 2) of the mass matrix
    mass: Array  # (p,)
    acting: IntArray  # (a,) coordinates that registers depend on


class Scratch(NamedTuple):
    """Work arrays; N = n + m."""

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
    B: Array  # (2, N, N) factors of the real eigenvalue and of the mass matrix
    A: np.ndarray  # (r, N, N) complex
    pivot: IntArray  # (r + 2, N) of all factors, the mass matrix's last
    first: IntArray
    last: IntArray
    x: Array  # (N,)
    y: np.ndarray  # (N,) complex
    scale: Array  # (r + 2,)
    law: Array  # (k, widest) derivatives of the stresses
    z: Array  # (2, 4) of a beam's point: strains' arguments, and their rates or changes
    slope: Array  # (3, 4)
    by: Array  # (2, 4, 4) tangents by them
    shapes: Array  # (3, widest) of a body in a floating frame: shares of modes, strains, rates of the shares
    blocks: Array  # (strains, coordinates)


class Equations(NamedTuple):
    """A system."""

    program: Program
    band: Band
    own: Scratch


def own_pieces(eq: Equations) -> bool:
    """Pieces of all switches at the variables in P; whether every table has a value there."""
    tb, own = eq.program, eq.own
    switches = tb.switches
    covered = True
    for s in range(own.pieces.shape[0]):
        tape_order(tb, own.P, own.R, own.TF, own.pieces, 0)
        piece = piece_at(switches, s, own.R[switches.register[s], 0])
        if switches.first[s + 1] > switches.first[s] and switches.period[s] == 0.0 and piece < 0:
            covered = False
            piece = 0
        own.pieces[s] = piece
    return covered


def variables(eq: Equations, q: Array, v: Array) -> None:
    """P := variables and rates."""
    tb, own, P = eq.program, eq.own, eq.own.P
    for i in range(q.shape[0]):
        P[i, 0] = q[i]
        P[i, 1] = v[i]
        P[i, 2] = 0.0
    for f in range(tb.curves.sign.shape[0]):
        s = tb.curves.place[f, 2]
        if s >= 0 and tb.curves.place[f, 3] == 0:
            piece = piece_at(tb.switches, s, q[tb.curves.place[f, 0]])
            own.pieces[s] = piece if tb.switches.period[s] > 0.0 else max(0, piece)
    curve_orders(tb, P, own.pieces, 0)
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


def stage(eq: Equations, w: Stages, tab: Scheme, i: int, t: float) -> None:
    """w.rest[i], w.gap[i]: what is left of the equations at a stage; its stresses become those of its coordinates.

    The force is the one that Newton's method sees (`beam.Tangent`).
    """
    tb, own, band = eq.program, eq.own, eq.band
    F = own.F
    q, v, rest = w.Q[i], w.V[i], w.rest[i]
    n = q.shape[0]
    variables(eq, q, v)
    begin = i == w.Z.shape[0]
    time_series(tb.times, t, (w.now[1] > 0.0) == begin, 2, own.TF)
    row_orders(tb, own.P, own.TF, tab.level, w.gap[i])
    if tab.level == 1:
        for r in range(w.gap.shape[1]):
            w.gap[i, r] *= w.now[1]
    gradients(tb, own.P, own)
    covered = own_pieces(eq)
    tape_order(tb, own.P, own.R, own.TF, own.pieces, 0)
    copy(tb.constant, F)
    registers_push(eq, 0, F)
    for e in range(tb.block.shape[0]):
        F[tb.block[e, 0]] -= tb.stiffness[e] * q[tb.block[e, 1]] + tb.damping[e] * v[tb.block[e, 1]]
    add_bars(tb.bars, q, v, w.S[i], own, F)
    add_floats(tb.floats, q, v, w.S[i], own, F)
    for j in range(n):
        rest[j] = -F[j]
    for e in range(band.held.shape[0]):
        rest[band.held[e, 0]] += band.mass[e] * w.A[i, band.held[e, 1]]
    for r in range(own.G.shape[0]):
        for j in range(n):
            rest[j] += own.G[r, j] * w.L[i, r]
    if not covered:
        rest[0] = np.nan


def linearise(eq: Equations, w: Stages, i: int, t: float) -> bool:
    """Tangents and rows at a stage; whether they are finite."""
    tb, own, band = eq.program, eq.own, eq.band
    K, C, P, D = own.K, own.C, own.P, own.D
    q, v = w.Q[i], w.V[i]
    n = q.shape[0]
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
        factor = w.L[i, rows.pair[p, 0]] * rows.weight[p] * turned(tb, P, one) * turned(tb, P, two)
        a = coordinate(tb, one)
        b = coordinate(tb, two)
        K[a, b] -= factor
        K[b, a] -= factor
    for r in range(D.shape[0]):
        for f in range(tb.curves.sign.shape[0]):
            j = tb.curves.place[f, 0]
            K[j, j] -= w.L[i, r] * D[r, n + f] * bend(tb, P, f)
    for e in range(tb.block.shape[0]):
        K[tb.block[e, 0], tb.block[e, 1]] -= tb.stiffness[e]
        C[tb.block[e, 0], tb.block[e, 1]] -= tb.damping[e]
    add_bar_tangents(tb.bars, q, v, w.S[i], own, K, C)
    add_float_tangents(tb.floats, q, v, w.S[i], own, K, C)
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
    own_pieces(eq)
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


FUNCTIONS = (own_pieces, variables, registers_push, coordinate, turned, bend, add_register_tangents, stage, linearise)
