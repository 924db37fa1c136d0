"""Solve one collocation step of  M a = f(t, q, v) - G^T lambda,  g(t, q) = 0  by simplified Newton.

Radau stages hold the constraints (index 3). Gauss stages hold their rates (index 2), because constraints on the
positions would reduce the order (Ascher & Petzold, SIAM J. Numer. Anal. 28 (1991) 1097-1120). Radau stages hold the
rates, too, if loads are not linear in the state. Dry friction requires short steps, and rounding of the positions
divided by such a step would exceed the speed over which friction reverses.

Stresses S of stiff links are unknowns in addition to the coordinates. The matrices are those of one stage. The changes
follow from one system of the size of the mechanism for each eigenvalue mu of A^-1 (`collocation`),

    [ mu^2/h^2 M - mu/h df/dv - df/dq + d(G^T lambda)/dq    G^T ]
    [ G                                                      0  ].

Stages lie side by side in SIMD vectors (`compiled.simd`), and so do these systems: all are evaluated, factorised and
solved at once.

The error is that of the polynomials of the stages at the start of the step, v - V(0) and M (a - A(0)). It is filtered
by the matrix of the real eigenvalue (Hairer & Wanner II, Secs. IV.8, VI.1, VII.4). For coordinates with nonlinear loads
the error of the speed counts, too, because a force that reverses within a short step affects only the speed. It is
converted to a displacement by the time in which the fastest motion so far crosses the mechanism. The end is projected
onto the constraints of positions and velocities by the least changes in the mass norm.

Read from the bottom up: `collocation_step` calls `begin`, `stages`, `linearise` and `factorise` (matrices at one
stage), `solve`, `change`, `defect`, `project`. `stages` evaluates the residual of the equations, with the forces of
beams (`beam.Beam`) and floating frames (`floating.Floating`). `numpy_equations` has functions of the same names for any
`System`.

Forces of registers and their derivatives are orders 0 and 1 of the series of the registers (`series.recurrences`).
Those of beams and of bodies in floating frames are in closed form. Stresses S of all these form one row of unknowns.
``law`` holds the derivatives of each stress by the quantities that determine its strain. The force of a stage is that
of S plus, through `law`, that of the difference between S and the stress of the strains. S then becomes the stress of
the strains.

The matrices are complex banded saddle matrices [[T, G^T], [G, 0]] of one pattern. So is the matrix of masses, with
equal entries in the SIMD vectors. They are stored by columns, real and imaginary parts in turn: B[j, i, 0] is the real
part of row i of column j. Rows are exchanged in all matrices where the diagonal is small in their sum (threshold
pivoting: Duff, Erisman & Reid, Direct Methods for Sparse Matrices, 2nd ed., Oxford 2017, Sec. 5.2).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ....base.typing import Array, IntArray
from ...compiled.simd import NAMES as SIMD
from ...compiled.simd import SimdArray
from ...series.recurrences import NAMES as RECURRENCES
from ...series.recurrences import (
    REGISTERS,
    cauchy,
    curve_forces,
    curve_orders,
    fill,
    piece_at,
    set_pieces,
    tape_order,
    time_series,
)
from .scheme import Scheme
from .work_space import Equations, Scratch, Stages

if TYPE_CHECKING:
    from ...compiled.simd import flat, halves, highest, total
    from ...series.tape import Bars, Floats, Program

#: Changes relative to the tolerance below which a step counts, and at which Newton's rate is trusted to tell the rest.
SOLVED, TRUSTED_CHANGE, MOST_NEWTON = 1e-3, 0.3, 12
#: Share of the forces left over by the first guess that nonlinear loads may leave before the last change. In a short
#: step speeds may be far from solved where positions do not show it.
BALANCED = 1e-2
#: Rounding of a force, relative to what it is made of.
ROUNDED = 1e-12
#: Numbers of the factors: of the step's matrices, and of the masses with the rows.
STEP, MASS = 0, 1
#: Share of the largest entry below the diagonal that the diagonal has where it is the pivot.
DIAGONAL = 0.1


def bar_strains(bars: Bars, p: int, q: Array) -> Any:
    """(x', y', theta, theta') at a point, of one state or of all stages."""
    dx = 0.0 * q[0]
    dy = 0.0 * q[0]
    turn = 0.0 * q[0]
    bend = 0.0 * q[0]
    for k in range(4):
        at = bars.place[p, k]
        dx += bars.slope[p, k] * q[at]
        dy += bars.slope[p, k] * q[at + 1]
        turn += bars.shape[p, k] * q[at + 2]
        bend += bars.slope[p, k] * q[at + 2]
    return dx, dy, turn, bend


def add_bars(bars: Bars, q: SimdArray, v: SimdArray, S: SimdArray, law: Array, F: SimdArray) -> None:
    """Add the forces of all beams at all stages, and replace the stresses by those of the strains.

    Parameters
    ----------
    bars : Bars
        Gauss points of the beams.
    q, v : SIMD, shape (n, W)
        Coordinates and velocities.
    S : SIMD, shape (k, W)
        Stresses: axial force (N), shear force (N), bending moment (N m) of each point; changed.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses by x', y', theta, theta', as `add_bar_tangents` left them.
    F : SIMD, shape (n, W)
        Forces on the coordinates (N, N m); changed.
    """
    for p in range(bars.place.shape[0]):
        dx, dy, angle, curl = bar_strains(bars, p, q)
        c = np.cos(angle)
        s = np.sin(angle)
        stretch = c * dx + s * dy
        shear = c * dy - s * dx
        axial = stretch - 1.0
        across = 1.0 * shear
        bend = 1.0 * curl
        if bars.damping[p] > 0.0:
            x, y, turn, curling = bar_strains(bars, p, v)
            axial += bars.damping[p] * (c * x + s * y + shear * turn)
            across += bars.damping[p] * (c * y - s * x - stretch * turn)
            bend += bars.damping[p] * curling
        at = bars.stress[p]
        one = 1.0 * S[at]
        two = 1.0 * S[at + 1]
        three = 1.0 * S[at + 2]
        lack = axial - one * (1.0 / bars.stiffness[p, 0])
        skew = across - two * (1.0 / bars.stiffness[p, 1])
        more = bend - three * (1.0 / bars.stiffness[p, 2])
        S[at] = axial * bars.stiffness[p, 0]
        S[at + 1] = across * bars.stiffness[p, 1]
        S[at + 2] = bend * bars.stiffness[p, 2]
        x = c * one - s * two + lack * law[at, 0] + skew * law[at + 1, 0]
        y = s * one + c * two + lack * law[at, 1] + skew * law[at + 1, 1]
        moment = shear * one - stretch * two + lack * law[at, 2] + skew * law[at + 1, 2]
        moment *= bars.weight[p]
        couple = three + more * law[at + 2, 3]
        for k in range(4):
            j = bars.place[p, k]
            slope = bars.weight[p] * bars.slope[p, k]
            F[j] -= slope * x
            F[j + 1] -= slope * y
            F[j + 2] -= bars.shape[p, k] * moment + slope * couple


def add_bar_tangents(bars: Bars, q: Array, v: Array, S: Array, own: Scratch, K: Array, C: Array) -> None:
    """Add the derivatives of the beams' forces by coordinates and velocities, in one state.

    Parameters
    ----------
    bars : Bars
        Gauss points of the beams.
    q, v : ndarray, shape (n,)
        Coordinates and velocities.
    S : ndarray, shape (k,)
        Stresses.
    own : Scratch
        Work arrays; ``own.law`` becomes the derivatives of the stresses by x', y', theta, theta'.
    K, C : ndarray, shape (n, n)
        dF/dq and dF/dv; changed.
    """
    slope, by, rate, law = own.slope, own.by[0], own.by[1], own.law
    for p in range(bars.place.shape[0]):
        dx, dy, angle, _ = bar_strains(bars, p, q)
        d = bar_strains(bars, p, v)
        c = math.cos(angle)
        s = math.sin(angle)
        stretch = c * dx + s * dy
        shear = c * dy - s * dx
        for i in range(3):
            for j in range(4):
                slope[i, j] = 0.0
        slope[0, 0] = c
        slope[0, 1] = s
        slope[0, 2] = shear
        slope[1, 0] = -s
        slope[1, 1] = c
        slope[1, 2] = -stretch
        slope[2, 3] = 1.0
        at = bars.stress[p]
        tau = bars.damping[p]
        weight = bars.weight[p]
        for i in range(3):
            for j in range(4):
                law[at + i, j] = bars.stiffness[p, i] * slope[i, j]
        for a in range(4):
            for b in range(4):
                value = 0.0
                for i in range(3):
                    value += slope[i, a] * law[at + i, b]
                by[a, b] = -weight * value
                rate[a, b] = -tau * weight * value
        one = weight * S[at]
        two = weight * S[at + 1]
        by[0, 2] += one * s + two * c
        by[2, 0] += one * s + two * c
        by[1, 2] += two * s - one * c
        by[2, 1] += two * s - one * c
        by[2, 2] += one * stretch + two * shear
        if tau > 0.0:  # drift of the strains' rates with the state
            for a in range(3):
                first = tau * weight * law[at, a]
                second = tau * weight * law[at + 1, a]
                by[a, 0] += first * s * d[2] + second * c * d[2]
                by[a, 1] += second * s * d[2] - first * c * d[2]
                by[a, 2] -= first * (c * d[1] - s * d[0] - stretch * d[2])
                by[a, 2] += second * (c * d[0] + s * d[1] + shear * d[2])
        for k in range(4):
            i = bars.place[p, k]
            for n in range(4):
                j = bars.place[p, n]
                inner = bars.slope[p, k] * bars.slope[p, n]
                mixed = bars.slope[p, k] * bars.shape[p, n]
                other = bars.shape[p, k] * bars.slope[p, n]
                both = bars.shape[p, k] * bars.shape[p, n]
                for a in range(2):
                    for b in range(2):
                        K[i + a, j + b] += inner * by[a, b]
                        C[i + a, j + b] += inner * rate[a, b]
                    K[i + a, j + 2] += mixed * by[a, 2] + inner * by[a, 3]
                    C[i + a, j + 2] += mixed * rate[a, 2] + inner * rate[a, 3]
                    K[i + 2, j + a] += other * by[2, a] + inner * by[3, a]
                    C[i + 2, j + a] += other * rate[2, a] + inner * rate[3, a]
                K[i + 2, j + 2] += both * by[2, 2] + other * by[2, 3] + mixed * by[3, 2] + inner * by[3, 3]
                C[i + 2, j + 2] += both * rate[2, 2] + other * rate[2, 3] + mixed * rate[3, 2] + inner * rate[3, 3]


def bar_changes(bars: Bars, dq: SimdArray, dv: SimdArray, law: Array, S: SimdArray) -> None:
    """Add the changes of the beams' stresses with those of coordinates and velocities.

    Parameters
    ----------
    bars : Bars
        Gauss points of the beams.
    dq, dv : SIMD, shape (n, W)
        Changes of coordinates and velocities.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses, see `add_bar_tangents`.
    S : SIMD, shape (k, W)
        Stresses; changed.
    """
    for p in range(bars.place.shape[0]):
        x, y, turn, bend = bar_strains(bars, p, dq)
        if bars.damping[p] > 0.0:
            a, b, c, d = bar_strains(bars, p, dv)
            x += bars.damping[p] * a
            y += bars.damping[p] * b
            turn += bars.damping[p] * c
            bend += bars.damping[p] * d
        for i in range(3):
            at = bars.stress[p] + i
            S[at] += law[at, 0] * x + law[at, 1] * y + law[at, 2] * turn + law[at, 3] * bend


def _float_slopes(floats: Floats, b: int, q: Array, shapes: Array, blocks: Array) -> None:
    """Write the strains of a body in a floating frame, and their derivatives by the coordinates.

    The derivatives go to blocks (s, size), the shares eta of the modes to shapes[0], the strains (L + Q eta / 2) eta to
    shapes[1].
    """
    first, r, size = floats.place[b, 0], floats.place[b, 1], 2 * floats.place[b, 1] + 4
    eta, e = shapes[0], shapes[1]
    for k in range(r):
        p = first + 4 + 2 * k
        eta[k] = q[p] * q[first + 2] + q[p + 1] * q[first + 3]
    for s in range(floats.place[b, 2]):
        e[s] = 0.0
        for j in range(size):
            blocks[s, j] = 0.0
        for k in range(r):
            bent = 0.0 * eta[k]
            at = floats.place[b, 4] + (s * r + k) * r
            for m in range(r):
                bent += floats.quadratic[at + m] * eta[m]
            linear = floats.linear[floats.place[b, 3] + s * r + k]
            e[s] += (linear + 0.5 * bent) * eta[k]
            by = linear + bent
            p = first + 4 + 2 * k
            blocks[s, 2] += by * q[p]
            blocks[s, 3] += by * q[p + 1]
            blocks[s, 4 + 2 * k] = by * q[first + 2]
            blocks[s, 5 + 2 * k] = by * q[first + 3]


def add_floats(
    floats: Floats, q: SimdArray, v: SimdArray, S: SimdArray, law: Array, shapes: SimdArray, blocks: SimdArray,
    F: SimdArray,
) -> None:  # fmt: skip
    """Add the forces of bodies in floating frames at all stages, and replace the stresses by those of the strains.

    Parameters
    ----------
    floats : Floats
        The bodies.
    q, v : SIMD, shape (n, W)
        Coordinates and velocities.
    S : SIMD, shape (k, W)
        Stresses in the basis of strain energy (J^0.5); changed.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses by the body's coordinates, as `add_float_tangents` left them.
    shapes : SIMD, shape (2, widest, W)
        Scratch: shares of the modes, and strains.
    blocks : SIMD, shape (strains, coordinates, W)
        Scratch: derivatives of the strains.
    F : SIMD, shape (n, W)
        Forces on the coordinates; changed.
    """
    for b in range(floats.place.shape[0]):
        _float_slopes(floats, b, q, shapes, blocks)
        first, size, at = floats.place[b, 0], 2 * floats.place[b, 1] + 4, floats.place[b, 5]
        for s in range(floats.place[b, 2]):
            stress = 1.0 * shapes[1, s]
            if floats.damping[b] > 0.0:
                for j in range(size):
                    stress += floats.damping[b] * blocks[s, j] * v[first + j]
            lack = stress - S[at + s]
            for j in range(size):
                F[first + j] -= S[at + s] * blocks[s, j] + lack * law[at + s, j]
            S[at + s] = stress


def add_float_tangents(floats: Floats, q: Array, v: Array, S: Array, own: Scratch, K: Array, C: Array) -> None:
    """Add the derivatives of these bodies' forces by coordinates and velocities, in one state.

    Parameters
    ----------
    floats : Floats
        Bodies in floating frames.
    q, v : ndarray, shape (n,)
        Coordinates and velocities.
    S : ndarray, shape (k,)
        Stresses.
    own : Scratch
        Work arrays; ``own.law`` becomes the derivatives of the stresses by the body's coordinates.
    K, C : ndarray, shape (n, n)
        dF/dq and dF/dv; changed.
    """
    for b in range(floats.place.shape[0]):
        _float_slopes(floats, b, q, own.shapes, own.blocks)
        first, r, strains = floats.place[b, 0], floats.place[b, 1], floats.place[b, 2]
        at = floats.place[b, 5]
        size = 2 * r + 4
        tau = floats.damping[b]
        eta, swing, pull, pairs, drift = own.shapes[0], own.shapes[2], own.shapes[3], own.pairs, own.drift
        for k in range(r):  # rates of the shares
            p = first + 4 + 2 * k
            swing[k] = v[p] * q[first + 2] + v[p + 1] * q[first + 3] + q[p] * v[first + 2] + q[p + 1] * v[first + 3]
        for k in range(r):
            pull[k] = 0.0
            for m in range(r):
                pairs[k, m] = 0.0
        for s in range(strains):
            stress = S[at + s]
            for j in range(size):
                own.law[at + s, j] = own.blocks[s, j]
                drift[j] = 0.0
            for k in range(r):
                place = floats.place[b, 4] + (s * r + k) * r
                bent = floats.linear[floats.place[b, 3] + s * r + k]
                speed = 0.0
                for m in range(r):
                    value = floats.quadratic[place + m]
                    bent += value * eta[m]
                    speed += value * swing[m]
                    pairs[k, m] += stress * value
                pull[k] += stress * bent
                for c in range(2):  # of the strains' rates with the state
                    p = 4 + 2 * k + c
                    drift[p] = speed * q[first + 2 + c] + bent * v[first + 2 + c]
                    drift[2 + c] += speed * q[first + p] + bent * v[first + p]
            for i in range(size):
                value = own.blocks[s, i]
                for j in range(size):
                    K[first + i, first + j] -= value * (own.blocks[s, j] + tau * drift[j])
                    C[first + i, first + j] -= tau * value * own.blocks[s, j]
        for k in range(r):
            for m in range(r):
                _add_share_product(first, k, m, q, -pairs[k, m], K)
            for c in range(2):
                p = first + 4 + 2 * k + c
                K[p, first + 2 + c] -= pull[k]
                K[first + 2 + c, p] -= pull[k]


def _add_share_product(first: int, k: int, m: int, q: Array, factor: float, K: Array) -> None:
    """Add factor (d eta_k / dq)^T (d eta_m / dq) to K."""
    for c in range(2):
        one = first + 4 + 2 * k + c
        for e in range(2):
            two = first + 4 + 2 * m + e
            K[one, two] += factor * q[first + 2 + c] * q[first + 2 + e]
            K[one, first + 2 + e] += factor * q[first + 2 + c] * q[two]
            K[first + 2 + c, two] += factor * q[one] * q[first + 2 + e]
            K[first + 2 + c, first + 2 + e] += factor * q[one] * q[two]


def float_changes(floats: Floats, dq: SimdArray, dv: SimdArray, law: Array, S: SimdArray) -> None:
    """Add the changes of the bodies' stresses with those of coordinates and velocities.

    Parameters
    ----------
    floats : Floats
        Bodies in floating frames.
    dq, dv : SIMD, shape (n, W)
        Changes of coordinates and velocities.
    law : ndarray, shape (k, widest)
        Derivatives of the stresses, see `add_float_tangents`.
    S : SIMD, shape (k, W)
        Stresses; changed.
    """
    for b in range(floats.place.shape[0]):
        first, at = floats.place[b, 0], floats.place[b, 5]
        for s in range(floats.place[b, 2]):
            for j in range(2 * floats.place[b, 1] + 4):
                S[at + s] += law[at + s, j] * (dq[first + j] + floats.damping[b] * dv[first + j])


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


def all_variables(eq: Equations, q: SimdArray, v: SimdArray) -> None:
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


def stage_times(eq: Equations, places: Array, t: float, h: float) -> None:
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


def factorise_band(
    B: SimdArray, over: SimdArray, reach: IntArray, pivot: IntArray, low: IntArray, top: IntArray, right: IntArray
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


def solve_band(B: SimdArray, over: SimdArray, pivot: IntArray, low: IntArray, top: IntArray, x: SimdArray) -> None:
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


def across(X: SimdArray, Y: SimdArray, out: SimdArray) -> None:
    """out := Y with other SIMD entries: sum_j Y[:, entry j] X[j]."""
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


def begin(eq: Equations, w: Stages, tab: Scheme) -> None:
    """The stages as the step before tells them, with the stresses of the begin, and times of all."""
    t = w.now[0]
    h = w.now[1]
    s = tab.c.shape[0]
    stage_times(eq, tab.side.c, t, h)
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


def left_over(eq: Equations, w: Stages, tab: Scheme) -> float:
    """Largest force that nonlinear loads leave over at a stage, in units that compare; 0 where it is rounding."""
    tb, own, code = eq.program, eq.own, eq.program.code
    rest, force, Q, V = flat(w.rest), flat(eq.wide.F), flat(w.Q), flat(w.V)
    most = 0.0
    for c in range(code.checked.shape[0]):
        i = coordinate(tb, code.push[code.checked[c], 1])
        for j in range(tab.c.shape[0]):
            size = abs(force[i, j])
            for k in range(w.q.shape[0]):
                size += abs(own.K[i, k] * Q[k, j]) + abs(own.C[i, k] * V[k, j])
            if not abs(rest[i, j]) <= ROUNDED * size:
                most = max(most, abs(rest[i, j]) * tb.unit[i])
    return most


def defect(eq: Equations, w: Stages, tab: Scheme) -> float:
    """Error of the step over its limit; what rows can carry at the begin is none of it."""
    tb, own, band, code = eq.program, eq.own, eq.band, eq.program.code
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
    quick = 0.0  # of coordinates on which nonlinear loads act: waves that run elsewhere along a link do not count
    for c in range(code.checked.shape[0]):
        i = coordinate(tb, code.push[code.checked[c], 1])
        quick = max(quick, abs(found[i, 0]) / w.limit[i] - w.now[4])
    return max(math.sqrt(sum_of / n), quick * abs(one) * w.now[3])


def end_state(w: Stages, tab: Scheme) -> None:
    """Coordinates and velocities at the step's end."""
    h = w.now[1]
    for a in range(w.q.shape[0]):
        w.qn[a] = w.q[a] + h * w.v[a] + total(tab.side.ends[0] * w.Z[a])
        w.vn[a] = w.v[a] + total(tab.side.ends[1] * w.Z[a]) / h


def keep_path(w: Stages) -> None:
    """Store the points of the dense output."""
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
    stage_times(eq, tab.side.middles, w.now[0], w.now[1])
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


def collocation_step(eq: Any, w: Stages, tab: Scheme) -> int:
    """One trial step; the number of Newton's iterations, its negative where they did not converge."""
    t = w.now[0]
    h = w.now[1]
    begin(eq, w, tab)
    if not linearise(eq, w, tab.central, t + tab.c[tab.central] * h):
        return 0
    if not factorise(eq, w, tab):
        return 0
    moved = np.inf
    size = np.inf
    started = 0.0
    first_left = 0.0
    left = 0.0
    count = 0
    solved = False
    while count < MOST_NEWTON and not solved:
        count += 1
        stages(eq, w, tab)
        left = left_over(eq, w, tab)
        solve(eq, w, tab)
        size = change(eq, w, tab)
        if count == 1:
            started = size
            first_left = left
        solved = left <= BALANCED * first_left and (
            size < w.now[2]
            or (size < TRUSTED_CHANGE and moved < np.inf and size * size / max(moved, 1e-300) < w.now[2])
        )
        if not size < 2.0 * moved or (size < SOLVED and size > 0.5 * moved):  # not a number, or rounding
            break
        moved = size
    if not (solved or (size < SOLVED and left <= BALANCED * first_left)):
        return -count
    w.measures[0] = defect(eq, w, tab)
    end_state(w, tab)
    project(eq, w, tab)
    keep_path(w)
    w.measures[1] = gap_between(eq, w, tab)
    w.measures[2] = (moved / started) ** (1.0 / (count - 1.0)) if count > 2 and moved > 0.0 else 0.0
    return count


#: Functions of a step, with those that they call elsewhere.
FUNCTIONS = (
    *REGISTERS,
    bar_strains, add_bars, add_bar_tangents, bar_changes, _float_slopes, add_floats, _add_share_product,
    add_float_tangents, float_changes,
    row_orders, gradients, coordinate_pieces, variables, all_variables, registers_push, stage_times, add_registers,
    coordinate, turned, bend, add_register_tangents, stages, linearise,
    factorise_band, solve_band, assemble, factorise, factorise_mass, across, solve_systems, solve, solve_mass,
    begin, change, left_over, defect, end_state, keep_path, gap_between, project, collocation_step,
)  # fmt: skip
#: Small hot functions, which are copied into their callers.
HOT = ("fill", "cauchy", "weighted", "bar_strains", "coordinate", "turned")
#: Numbers of `collocation_step`.
NEWTON = {"SOLVED": SOLVED, "TRUSTED_CHANGE": TRUSTED_CHANGE, "MOST_NEWTON": MOST_NEWTON, "BALANCED": BALANCED}
NAMES = {**RECURRENCES, **SIMD, **NEWTON, "STEP": STEP, "MASS": MASS, "DIAGONAL": DIAGONAL, "ROUNDED": ROUNDED}
