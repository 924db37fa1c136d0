"""Taylor series of the registers of a tape, order by order, and where they leave the pieces that they are on.

Arrays of series have the shape (variables or registers, orders): order k of what follows from y = f(a) comes from
orders up to k of a and below k of y.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...typing import Array, IntArray
from .tape import (  # fmt: skip
    ANGLE,
    COS,
    DIV,
    ENTRY,
    EXP,
    FUNCTION,
    LINEAR,
    LOG,
    MUL,
    POWER,
    RATE,
    SHIFT,
    SIDE,
    SIN,
    SUM,
    TANH,
)

if TYPE_CHECKING:
    from .tape import Code, Program, Switches

#: Looks within a step for a register that leaves its piece; share of the step in which it has left at once.
LOOKS, AT_ONCE = 24, 1e-5
#: Register values that are rounding, as parts of the largest terms of their series.
NOISE = 1e-12
#: How far a register may lie outside of its piece, or is no zero, of the largest terms of its series.
OUTSIDE = 1e-6


def cauchy(a: Array, i: int, b: Array, j: int, k: int) -> float:
    """Order k of the product of the series i of a and j of b."""
    value = 0.0
    for p in range(k + 1):
        value += a[i, p] * b[j, k - p]
    return value


def weighted(a: Array, i: int, b: Array, j: int, k: int, last: int) -> float:
    """sum_p p a_p b_{k-p} for p = 1 .. last."""
    value = 0.0
    for p in range(1, last + 1):
        value += p * a[i, p] * b[j, k - p]
    return value


def tape_order(tb: Program, Z: Array, R: Array, TF: Array, pieces: IntArray, k: int) -> None:
    """Order k of all registers; Z holds the variables up to order k + 1."""
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
    """Order k of all variables that are functions of one coordinate, as far as orders of that are known."""
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
    """out += order k of the forces on coordinates of the forces with the series H along the variables."""
    curves = tb.curves
    n = tb.mass.shape[0]
    for f in range(curves.place.shape[0]):
        out[curves.place[f, 0]] += curves.sign[f] * cauchy(Z, curves.place[f, 1], H, n + f, k)


def own_piece(switches: Switches, s: int, piece: int) -> int:
    """Number of a table's piece, which goes on to count beyond one period."""
    count = switches.first[s + 1] - switches.first[s] - 1
    return piece % count if switches.period[s] > 0.0 else piece


def lower_knot(switches: Switches, s: int, piece: int) -> float:
    """Where a piece of a table begins."""
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
    """Pieces of all switches where the variables are Z[:, 0], of tables beyond their ends the nearest; whether none is
    beyond."""
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
    """How far inside of its piece a value lies, negative outside."""
    if switches.first[s + 1] == switches.first[s]:
        return piece * x
    low = x - lower_knot(switches, s, piece)
    if switches.period[s] == 0.0 and piece == switches.first[s + 1] - switches.first[s] - 2:
        high = switches.knot[switches.first[s + 1] - 1] - x
    else:
        high = lower_knot(switches, s, piece + 1) - x
    return min(low, high)


def horner(R: Array, r: int, last: int, h: float) -> float:
    """Value of a series."""
    value = 0.0
    for k in range(last, -1, -1):
        value = value * h + R[r, k]
    return value


def largest(R: Array, r: int, last: int, h: float) -> float:
    """Sum of the sizes of all terms of a series."""
    value = 0.0
    for k in range(last, -1, -1):
        value = value * abs(h) + abs(R[r, k])
    return value


def leaves(tb: Program, R: Array, pieces: IntArray, last: int, h: float) -> tuple[float, int]:
    """First time up to h at which a register leaves its piece, and its switch; (h, -1) where none does.

    A time of 0 is one that has left at once.
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
    """Piece beyond the nearer end of this one; itself where a table has none."""
    if switches.first[s + 1] == switches.first[s]:
        return -piece
    count = switches.first[s + 1] - switches.first[s] - 1
    low = x - lower_knot(switches, s, piece)
    other = piece - 1 if low <= margin(switches, s, piece, x) else piece + 1
    if switches.period[s] == 0.0 and (other < 0 or other >= count):
        return piece
    return other


def is_pole(switches: Switches, R: Array, s: int, last: int, h: float, size: float) -> bool:
    """Whether the switch is a denominator at whose zero, the time h ahead, what is above it is none of its own.

    Zero beside its terms over the step `size`.
    """
    above = switches.above[s]
    return above >= 0 and abs(horner(R, above, last, h)) > OUTSIDE * largest(R, above, last, size)


FUNCTIONS = (
    is_pole, cauchy, weighted, curve_orders, curve_forces, tape_order,
    own_piece, lower_knot, piece_at, set_pieces, margin, horner, largest, leaves, next_piece,
)  # fmt: skip
NAMES = {
    "SUM": SUM, "LINEAR": LINEAR, "RATE": RATE, "FUNCTION": FUNCTION, "MUL": MUL, "DIV": DIV, "POWER": POWER,
    "EXP": EXP, "LOG": LOG, "SIN": SIN, "COS": COS, "TANH": TANH, "ANGLE": ANGLE, "SIDE": SIDE, "SHIFT": SHIFT,
    "ENTRY": ENTRY, "LOOKS": LOOKS, "AT_ONCE": AT_ONCE, "NOISE": NOISE,
    "OUTSIDE": OUTSIDE,
}  # fmt: skip
