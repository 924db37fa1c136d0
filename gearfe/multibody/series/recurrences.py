"""Taylor series of a program about one point: loops over its registers, its rows and the orders of its motion.

Compiled functions that call each other in every order of every step. Arrays of series have the shape (variables or
registers, orders). The variables are z = (q, functions u of one coordinate, forms of the squares), see `row_tables`.

Registers: order k of y = f(a) follows from orders up to k of a and below k of y. Sines and cosines follow from s' = c
theta', c' = -s theta' (Barrio, Appl. Math. Comput. 163 (2005) 525). A register that leaves the piece of its table or
switch ends the step.

Rows: values, gradients G, and the factors S = G M^-1 G^T = L D L^T.

The motion follows from the index-3 equations, with q(t) = sum_j q_j (t - t0)^j and the same for the multipliers. Order
k of the motion and order k + 2 of the constraints are

    M (k+2)(k+1) q_{k+2} + G_0^T lambda_k = f_k - sum_{i>=1} G_i^T lambda_{k-i},       G_0 q_{k+2} = -r_{k+2}

with r the part of the constraint that lower orders fix. One factorisation of S = G_0 M^-1 G_0^T serves all orders.
Forces of registers and rows act along the variables; one along u acts as u' on its coordinate.

At a passing singular position some rows Z^T G_0 vanish while B = Z^T dG/dt does not. There order k + 3 of Z^T g
fixes q_{k+2} along B, and the multipliers have a simple pole: lambda = (Z nu_0)/t + ... . Both conditions together
give the bordered system with the rows B; multipliers and forces are then stored one order up ("shift").

Light links: where the joints make a link carry far more than its own mass, M^-1 of the link hides the heavy ones in S.
The elimination then uses N = M + D with the added mass D on these few coordinates c, and

    N q + G^T lambda = f + D q,    q = q_N + sum_c X_c q_c,    X_c = D_c times the answer of N to a unit force on c

is solved exactly: (1 - X) q_c = (q_N)_c once per order. No 1/m of a light link appears, so it may be without mass.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...base.typing import Array, IntArray
from .tape import ANGLE, COS, DIV, ENTRY, EXP, FUNCTION, LINEAR, LOG, MUL, POWER, RATE, SHIFT, SIDE, SIN, SUM, TANH

if TYPE_CHECKING:
    from .row_tables import Equations
    from .tape import Code, Program, Switches
    from .timefunctions import Times
    from .work_space import Border, Run, Work

#: Looks within a step for a register that leaves its piece; share of the step in which it has left at once.
LOOKS, AT_ONCE = 24, 1e-5
#: Register values that are rounding, as parts of the largest terms of their series.
NOISE = 1e-12
#: How far a register may lie outside of its piece, or is no zero, of the largest terms of its series.
OUTSIDE = 1e-6


def cauchy(a: Array, i: int, b: Array, j: int, k: int) -> float:
    """Return order k of the product of two series, sum_p a_p b_(k-p).

    Parameters
    ----------
    a, b : ndarray or SIMD, shape (rows, orders[, W])
        Series.
    i, j : int
        Rows of the factors in a and b.
    k : int
        Order.
    """
    value = 0.0
    for p in range(k + 1):
        value += a[i, p] * b[j, k - p]
    return value


def weighted(a: Array, i: int, b: Array, j: int, k: int, last: int) -> float:
    """Return the sum of p a_p b_(k-p) over p = 1 .. last.

    Parameters
    ----------
    a, b : ndarray or SIMD, shape (rows, orders[, W])
        Series.
    i, j : int
        Rows of the factors in a and b.
    k : int
        Order.
    last : int
        Last term of the sum.
    """
    value = 0.0
    for p in range(1, last + 1):
        value += p * a[i, p] * b[j, k - p]
    return value


def tape_order(tb: Program, Z: Array, R: Array, TF: Array, pieces: IntArray, k: int) -> None:
    """Write order k of the series of all registers.

    Parameters
    ----------
    tb : Program
        The system on a tape.
    Z : ndarray, shape (variables, orders)
        Series of the variables, known up to order k + 1.
    R : ndarray, shape (registers, orders)
        Series of the registers; order k is written.
    TF : ndarray, shape (functions, orders)
        Series of the functions of time.
    pieces : ndarray of int, shape (switches,)
        Pieces that the switches are on.
    k : int
        Order.

    References
    ----------
    E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, Sec. I.8.
    """
    code: Code = tb.code
    switches: Switches = tb.switches
    for r in range(code.op.shape[0]):
        op = code.op[r, 0]
        a = code.op[r, 1]
        b = code.op[r, 2]
        f = code.factor[r, 0]
        value = 0.0
        if op == SUM:
            if a >= 0:
                value += f * R[a, k]
            if b >= 0:
                value += code.factor[r, 1] * R[b, k]
            if k == 0:
                value += code.factor[r, 2]
        elif op == LINEAR:
            for p in range(code.first[a], code.first[a + 1]):
                value += code.weight[p] * Z[code.variable[p], k]
            if k == 0:
                value += code.factor[r, 2]
        elif op == RATE:
            for p in range(code.first[a], code.first[a + 1]):
                value += code.weight[p] * Z[code.variable[p], k + 1]
            value *= k + 1
        elif op == FUNCTION:
            value = TF[a, k]
        elif op == MUL:
            value = cauchy(R, a, R, b, k)
        elif op == DIV:
            value = R[a, k]
            for p in range(1, k + 1):
                value -= R[b, p] * R[r, k - p]
            value /= R[b, 0]
        elif op == SIDE:
            value = pieces[b] * R[a, k]
        elif op == SHIFT:
            value = R[a, k]
            if k == 0:
                value -= lower_knot(switches, b, pieces[b])
        elif op == ENTRY:
            if k == 0:
                value = switches.entry[switches.first[a] + own_piece(switches, a, pieces[a]), b]
        elif k == 0:
            x = R[a, 0]
            if op == POWER:
                value = x**f
            elif op == EXP:
                value = math.exp(min(x, 710.0))
            elif op == LOG:
                value = np.log(x)
            elif op == SIN:
                value = math.sin(x)
            elif op == COS:
                value = math.cos(x)
            elif op == TANH:
                value = math.tanh(x)
            else:
                value = math.atan2(x, R[b, 0])
        elif op == POWER:
            for p in range(1, k + 1):
                value += (f * p - (k - p)) * R[a, p] * R[r, k - p]
            value /= k * R[a, 0]
        elif op == EXP:
            value = weighted(R, a, R, r, k, k) / k
        elif op == LOG:
            value = (R[a, k] - weighted(R, r, R, a, k, k - 1) / k) / R[a, 0]
        elif op in (SIN, TANH):
            value = weighted(R, a, R, b, k, k) / k
        elif op == COS:
            value = -weighted(R, a, R, b, k, k) / k
        else:  # an angle: (x^2 + y^2) theta' = x y' - y x'
            square = code.op[r, 3]
            value = weighted(R, a, R, b, k, k) - weighted(R, b, R, a, k, k) - weighted(R, r, R, square, k, k - 1)
            value /= k * R[square, 0]
        R[r, k] = value


def curve_orders(tb: Program, Z: Array, pieces: IntArray, k: int) -> None:
    """Write order k of the variables that are functions of one coordinate, as far as it is known.

    Parameters
    ----------
    tb : Program
        The system on a tape.
    Z : ndarray or SIMD, shape (variables, orders[, W])
        Series of the variables; those of functions change.
    pieces : ndarray of int, shape (switches,)
        Pieces that the switches are on.
    k : int
        Order.
    """
    place, sign, switches = tb.curves.place, tb.curves.sign, tb.switches
    n = tb.mass.shape[0]
    for f in range(place.shape[0]):
        q = place[f, 0]
        s = place[f, 2]
        d = place[f, 3]
        if k > 0:
            Z[n + f, k] = sign[f] * weighted(Z, q, Z, place[f, 1], k, k) / k
        elif s < 0:
            Z[n + f, 0] = np.sin(Z[q, 0]) if d else np.cos(Z[q, 0])
        else:
            x = Z[q, 0] - lower_knot(switches, s, pieces[s])
            at = switches.first[s] + own_piece(switches, s, pieces[s])
            value = 0.0
            for p in range(4 - d):
                factor = switches.entry[at, p]
                for e in range(d):
                    factor *= 3 - p - e
                value = value * x + factor
            Z[n + f, 0] = value


def curve_forces(tb: Program, Z: Array, H: Array, k: int, out: Array) -> None:
    """Add order k of the forces on coordinates that act along functions of them.

    Parameters
    ----------
    tb : Program
        The system on a tape.
    Z : ndarray or SIMD, shape (variables, orders[, W])
        Series of the variables.
    H : ndarray or SIMD, shape (variables, orders[, W])
        Series of the forces along the variables.
    k : int
        Order.
    out : ndarray or SIMD, shape (n[, W])
        Order k of the forces on the coordinates; changed.
    """
    curves = tb.curves
    n = tb.mass.shape[0]
    for f in range(curves.place.shape[0]):
        out[curves.place[f, 0]] += curves.sign[f] * cauchy(Z, curves.place[f, 1], H, n + f, k)


def own_piece(switches: Switches, s: int, piece: int) -> int:
    """Number of a table's piece, which continues to count beyond one period."""
    count = switches.first[s + 1] - switches.first[s] - 1
    return piece % count if switches.period[s] > 0.0 else piece


def lower_knot(switches: Switches, s: int, piece: int) -> float:
    """Return the index at which a piece of a table begins."""
    count = switches.first[s + 1] - switches.first[s] - 1
    turns = piece // count if switches.period[s] > 0.0 else 0
    return switches.knot[switches.first[s] + piece - turns * count] + turns * switches.period[s]


def piece_at(switches: Switches, s: int, x: float) -> int:
    """Piece of a value; below the first or beyond the last one where a table has none."""
    first = switches.first[s]
    count = switches.first[s + 1] - first - 1
    if count < 0:
        return 1 if x >= 0.0 else -1
    turns = 0
    if switches.period[s] > 0.0:
        turns = int(np.floor((x - switches.knot[first]) / switches.period[s]))
        x -= turns * switches.period[s]
    k = 0
    while k < count - 1 and x >= switches.knot[first + k + 1]:
        k += 1
    if switches.period[s] == 0.0 and not (switches.knot[first] <= x <= switches.knot[first + count]):
        return -1
    return k + turns * count


def set_pieces(tb: Program, Z: Array, R: Array, TF: Array, pieces: IntArray) -> bool:
    """Set the pieces of all switches from the variables Z[:, 0]; beyond the ends of a table, the nearest.

    Parameters
    ----------
    tb : Program
        The system on a tape.
    Z : ndarray, shape (variables, orders)
        Series of the variables, known up to order 1.
    R : ndarray, shape (registers, orders)
        Series of the registers; order 0 is written.
    TF : ndarray, shape (functions, orders)
        Series of the functions of time.
    pieces : ndarray of int, shape (switches,)
        Pieces; written.

    Returns
    -------
    covered : bool
        Whether no value is beyond the ends of its table.
    """
    switches: Switches = tb.switches
    covered = True
    for s in range(pieces.shape[0]):
        tape_order(tb, Z, R, TF, pieces, 0)
        x = R[switches.register[s], 0]
        piece = piece_at(switches, s, x)
        first = switches.first[s]
        if switches.first[s + 1] > first and switches.period[s] == 0.0 and piece < 0:
            covered = False
            piece = 0 if x < switches.knot[first] else switches.first[s + 1] - first - 2
        pieces[s] = piece
    return covered


def margin(switches: Switches, s: int, piece: int, x: float) -> float:
    """Return how far inside of its piece a value lies.

    Parameters
    ----------
    switches : Switches
        Switches of the tape.
    s : int
        Number of the switch.
    piece : int
        Its piece.
    x : float
        Value of its register.

    Returns
    -------
    distance : float
        To the nearer end of the piece, in the unit of the register; negative outside.
    """
    if switches.first[s + 1] == switches.first[s]:
        return piece * x
    low = x - lower_knot(switches, s, piece)
    if switches.period[s] == 0.0 and piece == switches.first[s + 1] - switches.first[s] - 2:
        high = switches.knot[switches.first[s + 1] - 1] - x
    else:
        high = lower_knot(switches, s, piece + 1) - x
    return min(low, high)


def horner(R: Array, r: int, last: int, h: float) -> float:
    """Return the value of a series.

    Parameters
    ----------
    R : ndarray, shape (registers, orders)
        Series.
    r : int
        Row.
    last : int
        Highest order that counts.
    h : float
        Time from the expansion (s).
    """
    value = 0.0
    for k in range(last, -1, -1):
        value = value * h + R[r, k]
    return value


def largest(R: Array, r: int, last: int, h: float) -> float:
    """Return the sum of the sizes of all terms of a series.

    Parameters
    ----------
    R : ndarray, shape (registers, orders)
        Series.
    r : int
        Row.
    last : int
        Highest order that counts.
    h : float
        Time from the expansion (s).
    """
    value = 0.0
    for k in range(last, -1, -1):
        value = value * abs(h) + abs(R[r, k])
    return value


def leaves(tb: Program, R: Array, pieces: IntArray, last: int, h: float) -> tuple[float, int]:
    """Find the first time up to h at which a register leaves its piece.

    Parameters
    ----------
    tb : Program
        The system on a tape.
    R : ndarray, shape (registers, orders)
        Series of the registers.
    pieces : ndarray of int, shape (switches,)
        Pieces that the switches are on.
    last : int
        Highest order that counts.
    h : float
        Largest time from the expansion (s), negative backwards.

    Returns
    -------
    time : float
        From the expansion (s); 0 for a register that leaves at once, h if none leaves.
    switch : int
        Number of its switch, -1 if none leaves.
    """
    switches: Switches = tb.switches
    found = -1
    for s in range(pieces.shape[0]):
        r = switches.register[s]
        every = largest(R, r, last, h)
        most = every - abs(R[r, 0])
        noise = NOISE * every
        if not most > 0.0 or margin(switches, s, pieces[s], R[r, 0]) > 1.0001 * most + noise:
            continue
        before = 0.0
        for look in range(LOOKS + 1):
            place = h * AT_ONCE if look == 0 else h * look / LOOKS
            value = margin(switches, s, pieces[s], horner(R, r, last, place))
            if value < -noise or (look == 0 and value < 0.0):
                if look == 0 and margin(switches, s, pieces[s], R[r, 0]) <= noise:
                    return 0.0, s
                low = before
                high = place
                for _ in range(60):
                    middle = 0.5 * (low + high)
                    if margin(switches, s, pieces[s], horner(R, r, last, middle)) >= 0.0:
                        low = middle
                    else:
                        high = middle
                if abs(high) < abs(h):
                    h = high
                    found = s
                break
            before = place
    return h, found


def next_piece(switches: Switches, s: int, piece: int, x: float) -> int:
    """Return the piece beyond the nearer end of a piece.

    Parameters
    ----------
    switches : Switches
        Switches of the tape.
    s : int
        Number of the switch.
    piece : int
        Its piece.
    x : float
        Value of its register.

    Returns
    -------
    piece : int
        The same piece if the table ends there.
    """
    if switches.first[s + 1] == switches.first[s]:
        return -piece
    count = switches.first[s + 1] - switches.first[s] - 1
    low = x - lower_knot(switches, s, piece)
    other = piece - 1 if low <= margin(switches, s, piece, x) else piece + 1
    if switches.period[s] == 0.0 and (other < 0 or other >= count):
        return piece
    return other


def is_pole(switches: Switches, R: Array, s: int, last: int, h: float, size: float) -> bool:
    """Return whether a switch is a denominator at whose zero the numerator does not vanish.

    Parameters
    ----------
    switches : Switches
        Switches of the tape.
    R : ndarray, shape (registers, orders)
        Series of the registers.
    s : int
        Number of the switch.
    last : int
        Highest order that counts.
    h : float
        Time of the zero from the expansion (s).
    size : float
        Step (s); the numerator is compared with its terms over this step.
    """
    above = switches.above[s]
    return above >= 0 and abs(horner(R, above, last, h)) > OUTSIDE * largest(R, above, last, size)


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
    """Write G u, one number per row.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    G : ndarray, shape (entries,)
        Gradients of the rows, or their rates.
    u : ndarray, shape (n,)
        Motion of the coordinates.
    out : ndarray, shape (m,)
        The product; written.
    """
    gradient = tb.gradient
    fill(out, 0.0)
    for e in range(G.shape[0]):
        out[gradient.row[e]] += G[e] * u[gradient.column[e]]


def add_transposed(tb: Equations, G: Array, mu: Array, factor: float, out: Array) -> None:
    """Add factor G^T mu.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    G : ndarray, shape (entries,)
        Gradients of the rows, or their rates.
    mu : ndarray, shape (m,)
        One number per row.
    factor : float
        Factor.
    out : ndarray, shape (n,)
        Sum along the coordinates; changed.
    """
    gradient = tb.gradient
    for e in range(G.shape[0]):
        out[gradient.column[e]] += factor * G[e] * mu[gradient.row[e]]


def accelerations(tb: Equations, force: Array, out: Array) -> None:
    """out = M^-1 force, M with the added masses."""
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
    """Factorise S = G M^-1 G^T = L D L^T with rows left out.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    w : Work
        Gradients in ``w.G``; ``w.val`` becomes m reciprocals of D, then the entries of L, ``w.diag`` the diagonal of S.
    skip : ndarray of int, shape (m,)
        Rows that are not 0 become unit rows; those that `bound` drops get 2.
    bound : float
        Rows whose pivot falls below this part of their diagonal become unit rows, too; 0 for none.

    Returns
    -------
    least : float
        Least pivot relative to its diagonal of S.
    where : int
        Its row, -1 if there is none.
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
    """Write the Taylor coefficients of every function of time, on the piece ahead in the direction of travel.

    Parameters
    ----------
    times : Times
        The functions.
    t : float
        Time (s).
    forward : bool
        Whether time runs forwards.
    orders : int
        Number of coefficients.
    out : ndarray, shape (functions, orders)
        Coefficients of powers of the time from t; written.
    """
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


def square_orders(tb: Equations, w: Work, j: int) -> None:
    """Order j of the forms of the squares."""
    square, Z = tb.square, w.Z
    z = w.slope.shape[0]
    for s in range(square.row.shape[0]):
        value = 0.0
        for e in range(square.first[s], square.first[s + 1]):
            value += square.weight[e] * Z[square.variable[e], j]
        Z[z + s, j] = value


def row_orders(tb: Equations, w: Work, j: int, out: Array) -> None:
    """Write order j >= 2 of every row without the part of q_j.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    w : Work
        Series of the variables below order j.
    j : int
        Order.
    out : ndarray, shape (m,)
        Order j of the rows; written.
    """
    rows, gradient, square, Z = tb.program.rows, tb.gradient, tb.square, w.Z
    curve_orders(tb.program, Z, w.pieces, j)
    square_orders(tb, w, j)
    for r in range(out.shape[0]):
        out[r] = -w.TF[rows.motion[r], j] if rows.motion[r] >= 0 else 0.0
    for e in range(gradient.turning.shape[0]):
        out[gradient.turning[e, 0]] += gradient.factor[e] * Z[gradient.turning[e, 2], j]
    z = w.slope.shape[0]
    for s in range(square.row.shape[0]):
        form = Z[z + s]
        value = 0.0
        for p in range((j + 1) // 2):
            value += form[p] * form[j - p]
        value *= 2.0
        if j % 2 == 0:
            value += form[j // 2] ** 2
        out[square.row[s]] += square.factor[s] * value


def _push_orders(tb: Equations, w: Work, k: int, at: int, F: Array) -> None:
    """Write order k of all forces except those of the multipliers of that order.

    Those along variables are in w.H[:, at].
    """
    program, square, Z, H, L = tb.program, tb.square, w.Z, w.H, w.L
    code = program.code
    n = F.shape[0]
    z = w.slope.shape[0]
    for i in range(z):
        H[i, at] = 0.0
    for p in range(code.push.shape[0]):
        H[code.push[p, 1], at] += code.share[p] * w.R[code.push[p, 0], k]
    for s in range(square.row.shape[0]):
        form, held = Z[z + s], L[square.row[s]]
        value = 0.0
        for e in range(1, at + 1):
            value += form[e] * held[at - e]
        _add_square(tb, H, s, at, value)
    for i in range(n):
        F[i] = H[i, at]
        if k == 0:
            F[i] += program.constant[i]
    for e in range(program.block.shape[0]):
        i = program.block[e, 1]
        F[program.block[e, 0]] -= program.stiffness[e] * Z[i, k] + program.damping[e] * (k + 1) * Z[i, k + 1]
    curve_forces(program, Z, H, at, F)


def _add_square(tb: Equations, H: Array, s: int, at: int, value: float) -> None:
    """Add order `at` of the force of a square; `value` is that of its form times the multiplier."""
    square = tb.square
    value *= 2.0 * square.factor[s]
    for e in range(square.first[s], square.first[s + 1]):
        H[square.variable[e], at] -= square.weight[e] * value


def _add_multipliers(tb: Equations, w: Work, at: int, values: Array) -> None:
    """Add multipliers `values` (one per row) to order `at`; what turns with a body goes into w.H."""
    gradient, L, H = tb.gradient, w.L, w.H
    for r in range(values.shape[0]):
        L[r, at] += values[r]
    for e in range(gradient.turning.shape[0]):
        H[gradient.turning[e, 2], at] -= gradient.factor[e] * values[gradient.turning[e, 0]]
    _add_square_multipliers(tb, w, at, 0, values)


def _add_square_multipliers(tb: Equations, w: Work, at: int, i: int, values: Array) -> None:
    """Add order i of the form of every square times its multiplier to order `at` of its force."""
    square = tb.square
    z = w.slope.shape[0]
    for s in range(square.row.shape[0]):
        _add_square(tb, w.H, s, at, w.Z[z + s, i] * values[square.row[s]])


def finish_order(tb: Equations, w: Work, j: int) -> None:
    """Everything that follows from q_j in w.a: curves and squares."""
    Z, curves = w.Z, tb.program.curves
    n = w.a.shape[0]
    for i in range(n):
        Z[i, j] = w.a[i]
    for f in range(curves.sign.shape[0]):
        Z[n + f, j] += w.slope[n + f] * w.a[curves.place[f, 0]]
    square_orders(tb, w, j)


def expand(tb: Equations, w: Work, run: Run, t: float, singular: int) -> None:
    """Write the series w.Z of the variables from the state w.q, w.v.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    w : Work
        State, gradients ``w.G``, factor ``w.val`` and singular rows ``w.border`` there; the series are written.
    run : Run
        What holds for the whole run.
    t : float
        Time of the state (s).
    singular : int
        Number of singular rows, 0 in a regular position.
    """
    border, skip = w.border, w.skip
    mu, rhs, F, u = w.mu, w.rhs, w.F, w.u
    shift = 1 if singular > 0 else 0
    time_series(tb.program.times, t, run.sign > 0.0, run.order + 2, w.TF)
    start_series(tb, w)
    if tb.mass.light.shape[0] > 0:
        regularisation_responses(tb, singular, w)
    for k in range(run.order - 1):
        j = k + 2
        at = k + shift
        alpha = float(j * (j - 1))
        share = 1.0 / alpha
        tape_order(tb.program, w.Z, w.R, w.TF, w.pieces, k)
        _push_orders(tb, w, k, at, F)
        row_orders(tb, w, j, rhs)
        accelerations(tb, F, u)
        for i in range(u.shape[0]):
            u[i] *= share
        if singular > 0:
            _border_rows(tb, w, j, singular)
        times_gradients(tb, w.G, u, mu)
        for r in range(mu.shape[0]):
            mu[r] = mu[r] + rhs[r] if skip[r] == 0 else 0.0
        constrained(tb, singular, w, mu, u, w.a)
        if tb.mass.light.shape[0] > 0:
            add_regularisation(tb, singular, w, mu, w.a)
        for r in range(mu.shape[0]):
            mu[r] *= alpha
        _add_multipliers(tb, w, at, mu)
        if singular > 0:  # the multipliers Z nu belong one order below the regular ones
            for r in range(mu.shape[0]):
                mu[r] = 0.0
                for p in range(singular):
                    mu[r] += alpha * border.Z[p, r] * border.nu[p]
            _add_multipliers(tb, w, at - 1, mu)
            _add_square_multipliers(tb, w, at, 1, mu)
        finish_order(tb, w, j)
    if w.pieces.shape[0] > 0 or tb.program.code.checked.shape[0] > 0:
        tape_order(tb.program, w.Z, w.R, w.TF, w.pieces, run.order - 1)


def constrained(tb: Equations, singular: int, w: Work, mu: Array, u: Array, q: Array) -> None:
    """Write the motion that a free motion becomes under the constraints, and the multipliers.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    singular : int
        Number of singular rows.
    w : Work
        Gradients, factor and singular rows; ``w.border.nu`` holds gaps, then multipliers of the singular rows.
    mu : ndarray, shape (m,)
        Gaps of the regular rows, then their multipliers.
    u : ndarray, shape (n,)
        Free motion of the coordinates.
    q : ndarray, shape (n,)
        Constrained motion; written.
    """
    border, F = w.border, w.F
    if singular > 0:
        border_solve(tb, w.val, border, mu, singular)
    else:
        solve(tb, w.val, mu)
    fill(F, 0.0)
    add_transposed(tb, w.G, mu, 1.0, F)
    for p in range(singular):
        for i in range(F.shape[0]):
            F[i] += border.B[p, i] * border.nu[p]
    accelerations(tb, F, w.work)
    for i in range(F.shape[0]):
        q[i] = u[i] - w.work[i]


def regularisation_responses(tb: Equations, singular: int, w: Work) -> None:
    """Set w.regularisation: what a unit of every light coordinate adds to coordinates (X) and multipliers (Y, W).

    And the factors of 1 - X = L U.

    D (1 - X) is symmetric and positive definite, so it needs no pivots.
    """
    responses, light, border, u = w.regularisation, tb.mass.light, w.border, w.u
    k = light.shape[0]
    for c in range(k):
        fill(w.F, 0.0)
        w.F[light[c]] = tb.mass.added_mass[c]
        accelerations(tb, w.F, u)
        times_gradients(tb, w.G, u, responses.Y[c])
        for r in range(responses.Y.shape[1]):
            if w.skip[r] != 0:
                responses.Y[c, r] = 0.0
        for p in range(singular):
            border.nu[p] = 0.0
            for i in range(u.shape[0]):
                border.nu[p] += border.B[p, i] * u[i]
        constrained(tb, singular, w, responses.Y[c], u, responses.X[c])
        for p in range(singular):
            responses.W[c, p] = border.nu[p]
    lu = responses.lu
    for e in range(k):
        for c in range(k):
            lu[e, c] = (1.0 if e == c else 0.0) - responses.X[c, light[e]]
            for i in range(min(e, c)):
                lu[e, c] -= lu[e, i] * lu[i, c]
            if c < e:
                lu[e, c] /= lu[c, c]


def add_regularisation(tb: Equations, singular: int, w: Work, mu: Array, q: Array) -> None:
    """Turn motion and multipliers of the raised masses N into those of the masses M.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    singular : int
        Number of singular rows.
    w : Work
        Responses to the light coordinates in ``w.regularisation``; ``w.border.nu`` changes.
    mu : ndarray, shape (m,)
        Multipliers; changed.
    q : ndarray, shape (n,)
        Motion of the coordinates; changed.
    """
    responses, light = w.regularisation, tb.mass.light
    lu, own = responses.lu, responses.own
    k = light.shape[0]
    for e in range(k):
        own[e] = q[light[e]]
        for c in range(e):
            own[e] -= lu[e, c] * own[c]
    for e in range(k - 1, -1, -1):
        for c in range(e + 1, k):
            own[e] -= lu[e, c] * own[c]
        own[e] /= lu[e, e]
    for c in range(k):
        value = own[c]
        for i in range(q.shape[0]):
            q[i] += responses.X[c, i] * value
        for r in range(mu.shape[0]):
            mu[r] += responses.Y[c, r] * value
        for p in range(singular):
            w.border.nu[p] += responses.W[c, p] * value


def start_series(tb: Equations, w: Work) -> None:
    """Orders 0 and 1 from position and velocity; all others zero."""
    Z = w.Z
    variables(tb, w, w.q)
    for i in range(Z.shape[0]):
        fill(Z[i], 0.0)
        Z[i, 0] = w.P[i, 0]
    for r in range(w.L.shape[0]):
        fill(w.L[r], 0.0)
    for i in range(w.H.shape[0]):
        w.H[i, 0] = 0.0
    copy(w.v, w.a)
    finish_order(tb, w, 1)


def _border_rows(tb: Equations, w: Work, j: int, singular: int) -> None:
    """Write order j + 1 of Z^T g without q_j and q_(j+1) to border.nu.

    The part of q_j is B q_j.
    """
    border, work, u = w.border, w.mu, w.u
    row_orders(tb, w, j + 1, work)
    for p in range(singular):
        value = 0.0
        for r in range(work.shape[0]):
            value += border.Z[p, r] * work[r]
        for i in range(u.shape[0]):
            value += border.B[p, i] * u[i]
        border.nu[p] = value


def border_solve(tb: Equations, val: Array, border: Border, mu: Array, singular: int) -> None:
    """Solve the bordered system of regular and singular rows.

    Parameters
    ----------
    tb : Equations
        Tables of the system.
    val : ndarray, shape (m + entries,)
        Factor of the regular rows.
    border : Border
        Singular rows; ``border.nu`` holds the right-hand side of the rows B, then their multipliers.
    mu : ndarray, shape (m,)
        Right-hand side of the regular rows, then their multipliers.
    singular : int
        Number of singular rows.
    """
    for p in range(singular):
        for r in range(mu.shape[0]):
            border.nu[p] -= border.Y[p, r] * mu[r]
    small_solve(border.schur, singular, border.nu, border.small)
    solve(tb, val, mu)
    for p in range(singular):
        for r in range(mu.shape[0]):
            mu[r] -= border.Y[p, r] * border.nu[p]


def small_solve(matrix: Array, size: int, x: Array, work: Array) -> None:
    """Solve a system of a few unknowns by Gaussian elimination with row pivots.

    Parameters
    ----------
    matrix : ndarray, shape (k, k)
        The matrix, k >= size.
    size : int
        Number of unknowns.
    x : ndarray, shape (k,)
        Right-hand side, then solution.
    work : ndarray, shape (k, k)
        Scratch.
    """
    for i in range(size):
        for j in range(size):
            work[i, j] = matrix[i, j]
    for i in range(size):
        best = i
        for k in range(i + 1, size):
            if abs(work[k, i]) > abs(work[best, i]):
                best = k
        if best != i:
            for j in range(size):
                keep = work[i, j]
                work[i, j] = work[best, j]
                work[best, j] = keep
            keep = x[i]
            x[i] = x[best]
            x[best] = keep
        for k in range(i + 1, size):
            factor = work[k, i] / work[i, i]
            x[k] -= factor * x[i]
            for j in range(i, size):
                work[k, j] -= factor * work[i, j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= work[i, j] * x[j]
        x[i] /= work[i, i]


#: Loops over registers, and the two loops over plain arrays that other integrators call as well.
REGISTERS = (
    is_pole, cauchy, weighted, curve_orders, curve_forces, tape_order,
    own_piece, lower_knot, piece_at, set_pieces, margin, horner, largest, leaves, next_piece, fill, time_series,
)  # fmt: skip
#: All functions of this module.
FUNCTIONS = (
    *REGISTERS,
    copy, variables, rates, gradients, gradient_rates, residuals, times_gradients, add_transposed,
    accelerations, inner, factorise, solve,
    square_orders, row_orders, _push_orders, _add_square, _add_multipliers, _add_square_multipliers, finish_order,
    expand, constrained, regularisation_responses, add_regularisation, start_series, _border_rows, border_solve,
    small_solve,
)  # fmt: skip
NAMES = {
    "math": math, "np": np,
    "SUM": SUM, "LINEAR": LINEAR, "RATE": RATE, "FUNCTION": FUNCTION, "MUL": MUL, "DIV": DIV, "POWER": POWER,
    "EXP": EXP, "LOG": LOG, "SIN": SIN, "COS": COS, "TANH": TANH, "ANGLE": ANGLE, "SIDE": SIDE, "SHIFT": SHIFT,
    "ENTRY": ENTRY, "LOOKS": LOOKS, "AT_ONCE": AT_ONCE, "NOISE": NOISE,
    "OUTSIDE": OUTSIDE,
}  # fmt: skip
