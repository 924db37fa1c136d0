"""Evaluate elements on a tape by NumPy: rows and forces with derivatives, in many states at once.

Each variable z_i of a tape is a function of one coordinate, with the slope z_i' and the bend z_i''. Rows are

    g = c + L z + sum w z_i z_j - motion(t),        dg/dq = sum dg/dz_i z_i',

a sum over the variables of each coordinate, and so are forces along variables. Registers are evaluated in groups: all
registers of one operation whose operands are known. Derivatives are evaluated with them (forward mode: Griewank &
Walther, Evaluating Derivatives, SIAM 2008, Sec. 3.1).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...base.typing import Array, IntArray
from ..series.tape import (
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
    Tape,
)
from .contract import Element

#: Operations without operands, and those with two.
LEAVES, BINARY = (LINEAR, RATE, FUNCTION), (SUM, MUL, DIV, ANGLE)
#: Value of an operation on registers x and y with its factors f.
VALUES: dict[int, Callable[[Any, Any, Array], Any]] = {
    SUM: lambda x, y, f: f[0] * x + f[1] * y + f[2],
    MUL: lambda x, y, _: x * y,
    DIV: lambda x, y, _: x / y,
    POWER: lambda x, _, f: x ** f[0],
    EXP: lambda x, *_: np.exp(x),
    LOG: lambda x, *_: np.log(x),
    SIN: lambda x, *_: np.sin(x),
    COS: lambda x, *_: np.cos(x),
    TANH: lambda x, *_: np.tanh(x),
    ANGLE: lambda x, y, _: np.arctan2(x, y),
    SIDE: lambda x, *_: np.abs(x),
}
#: Its slopes by x and y where its value is r.
SLOPES: dict[int, Callable[[Any, Any, Any, Array], tuple[Any, Any]]] = {
    SUM: lambda _, __, ___, f: (f[0], f[1]),
    MUL: lambda _, x, y, __: (y, x),
    DIV: lambda r, _, y, __: (1.0 / y, -r / y),
    POWER: lambda _, x, __, f: (f[0] * x ** (f[0] - 1.0), 0.0),
    EXP: lambda r, *_: (r, 0.0),
    LOG: lambda _, x, *__: (1.0 / x, 0.0),
    SIN: lambda _, x, *__: (np.cos(x), 0.0),
    COS: lambda _, x, *__: (-np.sin(x), 0.0),
    TANH: lambda r, *_: (1.0 - r * r, 0.0),
    ANGLE: lambda _, x, y, __: (y / (x * x + y * y), -x / (x * x + y * y)),
    SIDE: lambda _, x, *__: (np.where(x >= 0.0, 1.0, -1.0), 0.0),
    SHIFT: lambda *_: (1.0, 0.0),
}


class Variables(NamedTuple):
    """Variables of a tape and, last, 1; their derivatives by their coordinates; shapes (z + 1, ...), states last."""

    value: Array
    slope: Array
    bend: Array


class _Sums(NamedTuple):
    """Terms in the order of the sums that they belong to."""

    size: int  # number of sums
    target: IntArray  # (s,) those that have terms
    first: IntArray  # (s,) their first terms
    order: IntArray  # (terms,) numbers of the terms

    def of(self, terms: Array) -> Array:
        """Sums of terms (terms, ...), shape (size, ...)."""
        out = np.zeros((self.size, *terms.shape[1:]))
        if len(self.target):
            out[self.target] = np.add.reduceat(terms[self.order], self.first, axis=0)
        return out


def _sums(size: int, target: IntArray) -> _Sums:
    order = np.argsort(target, kind="stable")
    first = np.flatnonzero(np.diff(target[order], prepend=-1))
    return _Sums(size, target[order][first], first, order)


class _Group(NamedTuple):
    """Registers of one operation."""

    op: int
    own: IntArray  # (g,)
    one: IntArray  # (g,) operands, -1 for none
    two: IntArray  # registers alone: switches are no operands
    factor: Array  # (g, 3)


class TapeValues:
    """Rows, registers and forces of a tape.

    Parameters
    ----------
    tape : Tape
        For n coordinates; with m rows and k registers. What is written on it later does not count.
    """

    def __init__(self, tape: Tape) -> None:
        n = self.size = tape.size
        none = np.zeros((n, n))
        program = self.program = tape.program(none, none, none, np.ones(n))
        self.functions, self.rows = tuple(tape.functions), len(program.rows.constant)
        at, _, switch, order = program.curves.place.T
        #: Coordinate of each variable, and the variables that are cosines, then sines.
        self.coordinate = np.concatenate([np.arange(n), at, [0]])
        self._cosines, self._sines = (n + np.flatnonzero((switch < 0) & (order == k)) for k in (0, 1))
        self._profiles = [(n + f, int(switch[f])) for f in np.flatnonzero((switch >= 0) & (order == 0))]
        self._gather = _sums(n, self.coordinate)
        rows, code, one = program.rows, program.code, n + len(at)
        #: Terms w z_i z_j of the rows, those of single variables with 1; and as seen from each of their variables.
        self._row = np.append(rows.place[:, 0], rows.pair[:, 0])
        self._pair = np.concatenate([np.append(rows.place[:, 1:], one + 0 * rows.place[:, :1], 1), rows.pair[:, 1:]]).T
        self._weight = np.append(rows.factor, rows.weight)
        self._by_row = _sums(self.rows, self._row)
        seen = np.flatnonzero(self._pair.ravel() != one)
        self._slope = self._pair.ravel()[seen], self._pair[::-1].ravel()[seen], np.tile(self._weight, 2)[seen]
        self._by_entry = _sums(self.rows * n, np.tile(self._row, 2)[seen] * n + self.coordinate[self._slope[0]])
        self._by_push = _sums(n, self.coordinate[code.push[:, 1]])
        leaf = np.repeat(np.arange(len(code.first) - 1), np.diff(code.first))
        self._leaves = np.zeros((len(code.first) - 1, one + 1))
        np.add.at(self._leaves, (leaf, code.variable), code.weight)
        self._groups = _groups(code.op, code.factor, program.switches.register)
        self._known: tuple[Array, Variables] | None = None

    # rows -----------------------------------------------------------------------------------------------------
    def variables(self, q: Array) -> Variables:
        """Variables at the coordinates q, shape (n,) or (states, n); those of the last ones are remembered."""
        known = self._known  # another thread may remember others meanwhile
        if known is None or not np.array_equal(known[0], q):
            known = self._known = q.copy(), self._variables(q.T)
        return known[1]

    def _variables(self, q: Array) -> Variables:
        n, (_, then, _, _) = self.size, self.program.curves.place.T
        value, slope, bend = np.zeros((3, len(self.coordinate), *q.shape[1:]))
        value[:n], slope[:n], value[-1] = q, 1.0, 1.0
        angles = q[self.coordinate[self._cosines]]
        value[self._cosines], value[self._sines] = np.cos(angles), np.sin(angles)
        for variable, switch in self._profiles:
            knots, entries, period = self._table(switch)
            x, k = _piece(knots, period, q[self.coordinate[variable]])
            for d in range(4):
                made = np.polynomial.polynomial.polyder(entries[:, ::-1].T, d)[:, k]
                value[variable + d] = sum(c * x**p for p, c in enumerate(made))
        sign = _spread(self.program.curves.sign, q)
        slope[n:-1] = sign * value[then]
        bend[n:-1] = sign * slope[then]
        return Variables(value, slope, bend)

    def motion(self, t: float | Array, derivative: int) -> Array:
        """Prescribed motions of the rows, shape (..., m)."""
        number = self.program.rows.motion
        out = np.zeros((*np.shape(t), len(number)))
        for r in np.flatnonzero(number >= 0):
            out[..., r] = self.functions[number[r]](t, derivative)
        return out

    def _sum_rows(self, x: Array, y: Array) -> Array:
        """sum w x_i y_j of the rows, shape (..., m)."""
        one, two = self._pair
        return self._by_row.of(_spread(self._weight, x) * x[one] * y[two]).T

    def residual(self, t: float | Array, q: Array) -> Array:
        """g, shape (..., m), in states (..., n) at times (...)."""
        z = self.variables(q).value
        return np.asarray(self.program.rows.constant + self._sum_rows(z, z) - self.motion(t, 0))

    def jacobian(self, q: Array) -> Array:
        """G, shape (..., m, n)."""
        z, (own, other, weight) = self.variables(q), self._slope
        gradient = self._by_entry.of(_spread(weight, z.slope) * z.slope[own] * z.value[other])
        return gradient.T.reshape(*q.shape[:-1], self.rows, self.size)

    def velocity_terms(self, t: float | Array, q: Array, v: Array) -> Array:
        """g'' without its acceleration part, shape (..., m)."""
        z, speed = self.variables(q), v.T[self.coordinate]
        rate, pull = z.slope * speed, z.bend * speed**2
        terms = self._sum_rows(pull, z.value) + self._sum_rows(z.value, pull) + 2.0 * self._sum_rows(rate, rate)
        return np.asarray(terms - self.motion(t, 2))

    def curvature(self, q: Array, multipliers: Array) -> Array:
        """d(G^T lambda)/dq at fixed lambda, shape (n, n), in one state."""
        z, (one, two), pull = self.variables(q), self._pair, multipliers[self._row] * self._weight
        full, along = np.zeros((self.size, self.size)), np.zeros(self.size)
        np.add.at(full, (self.coordinate[one], self.coordinate[two]), pull * z.slope[one] * z.slope[two])
        np.add.at(along, self.coordinate[one], pull * z.bend[one] * z.value[two])
        np.add.at(along, self.coordinate[two], pull * z.value[one] * z.bend[two])
        return full + full.T + np.diag(along)

    # registers ------------------------------------------------------------------------------------------------
    def registers(self, t: float | Array, q: Array, v: Array) -> Array:
        """Values of all registers, shape (k + 1, ...), the last one 0; NaN beyond the ends of tables."""
        z = self.variables(q)
        R = np.zeros((len(self.program.code.op) + 1, *q.shape[:-1]))
        with np.errstate(all="ignore"):
            for op, own, one, two, factor in self._groups:
                if op == LINEAR:
                    R[own] = self._leaves[one] @ z.value + _spread(factor[:, 2], R)
                elif op == RATE:
                    R[own] = self._leaves[one] @ (z.slope * v.T[self.coordinate])
                elif op == FUNCTION:
                    for r, k in zip(own, one, strict=True):
                        R[r] = self.functions[k](t)
                elif op in (SHIFT, ENTRY):
                    for r, (_, a, b, _) in zip(own, self.program.code.op[own], strict=True):
                        x, k = self._place(b if op == SHIFT else a, R)
                        R[r] = x if op == SHIFT else self._table(a)[1][k, b] + 0.0 * x
                else:
                    R[own] = VALUES[op](R[one], R[two], _spread(factor.T, R))
        return R

    def slopes(self, q: Array, v: Array, R: Array) -> Array:
        """Derivatives of the registers R of one state by (q, v), shape (k + 1, 2 n).

        Without a value they are 0, and at kinks such as that of a root at 0.
        """
        z, speed = self.variables(q), v[self.coordinate]
        D = np.zeros((len(R), 2 * self.size))
        with np.errstate(all="ignore"):
            for op, own, one, two, factor in self._groups:
                if op == LINEAR:
                    D[own, : self.size] = self._gather.of((self._leaves[one] * z.slope).T).T
                elif op == RATE:
                    parts = [self._leaves[one] * z.bend * speed, self._leaves[one] * z.slope]
                    D[own] = np.vstack([self._gather.of(part.T) for part in parts]).T
                elif op not in (FUNCTION, ENTRY):
                    by = SLOPES[op](R[own], R[one], R[two], factor.T)
                    made = sum(_spread(np.asarray(b), D) * D[a] for b, a in zip(by, (one, two), strict=True))
                    D[own] = np.where(np.isfinite(made), made, 0.0)
        return D

    def force(self, q: Array, R: Array) -> Array:
        """Forces of registers (k + 1, ...) and the constant ones, shape (..., n)."""
        return self._along(R, self.variables(q).slope).T + self.program.constant

    def force_slopes(self, q: Array, v: Array, R: Array) -> tuple[Array, Array]:
        """Return the derivatives of the forces by q and v in one state, shapes (n, n)."""
        z, n = self.variables(q), self.size
        slopes = self._along(self.slopes(q, v, R), z.slope[:, None])
        return slopes[:, :n] + np.diag(self._along(R, z.bend)), slopes[:, n:]

    def _along(self, R: Array, slope: Array) -> Array:
        """Forces of registers along variables with those slopes, shape (n, ...)."""
        register, variable = self.program.code.push.T
        return self._by_push.of(_spread(self.program.code.share, R) * R[register] * slope[variable])

    # pieces ---------------------------------------------------------------------------------------------------
    @cached_property
    def switches(self) -> list[int]:
        """Numbers of those at which forces have kinks, jumps or poles: all but profiles'."""
        held = set(self.program.curves.place[:, 2].tolist())
        return [s for s in range(len(self.program.switches.register)) if s not in held]

    @property
    def has_knots(self) -> bool:
        """Return whether rows follow profiles, whose third derivative jumps at knots."""
        return bool(self._profiles)

    def knots(self, q: Array) -> IntArray:
        """Pieces of the profiles that the rows are on in states (..., n), shape (..., profiles)."""
        tables = ((self._table(switch), q[..., self.coordinate[variable]]) for variable, switch in self._profiles)
        return np.stack([_piece(knots, period, x)[1] for (knots, _, period), x in tables], axis=-1)

    def pieces(self, R: Array) -> IntArray:
        """Numbers of the smooth pieces that registers (k + 1, ...) are on, shape (..., s); -1 without a value."""
        places = (self._place(s, R) for s in self.switches)
        numbers = [np.where(np.isfinite(x), k, -1) for x, k in places]
        return np.stack(numbers, axis=-1) if numbers else np.zeros((*R.shape[1:], 0), dtype=np.int64)

    def _table(self, switch: int) -> tuple[Array, Array, float]:
        """Knots, coefficients (pieces, 4) of powers of the distance from the knot below, highest first, and period."""
        switches = self.program.switches
        part = slice(switches.first[switch], switches.first[switch + 1])
        return switches.knot[part], switches.entry[part][:-1], float(switches.period[switch])

    def _place(self, switch: int, R: Array) -> tuple[Any, Any]:
        """Distance of a switch's register from the knot below, and the number of its piece; NaN beyond."""
        x, (knots, _, period) = R[self.program.switches.register[switch]], self._table(switch)
        if not len(knots):
            return x, x >= 0.0
        inside = (period > 0.0) | ((knots[0] <= x) & (x <= knots[-1]))
        return np.where(inside, 1.0, np.nan) * _piece(knots, period, x)[0], _piece(knots, period, x)[1]


def _spread(factors: Array, like: Array) -> Array:
    """Factors (..., k) of things (k, ...) in many states, or in one."""
    return factors[..., None] if like.ndim > 1 and factors.ndim else factors


def _piece(knots: Array, period: float, x: Array) -> tuple[Array, Any]:
    """Distance from the knot below, and its number; beyond a table's ends of the nearest piece."""
    if period > 0.0:
        x = knots[0] + (x - knots[0]) % period
    k = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    return x - knots[k], k


def _groups(op: IntArray, factor: Array, switched: IntArray) -> list[_Group]:
    """Registers by levels and operations, in an order in which operands are known."""
    level, found, groups = [0] * (len(op) + 1), defaultdict[tuple[int, int], list[int]](list), []
    for r, (kind, a, b, _) in enumerate(op.tolist()):
        needed = [] if kind in LEAVES else [switched[a]] if kind == ENTRY else [a, b] if kind in BINARY else [a]
        level[r] = 1 + max((level[k] for k in needed), default=0)
        found[level[r], kind].append(r)
    for place, kind in sorted(found):
        own = np.array(found[place, kind])
        two = op[own, 2] if kind in BINARY else np.full(len(own), -1)
        groups.append(_Group(kind, own, op[own, 1], two, factor[own]))
    return groups


class TapeElement(Element):
    """An element whose rows follow from what it writes on a tape."""

    def write(self, tape: Tape, places: IntArray) -> bool:
        """Write rows and forces on a tape; `places` are the numbers of the local coordinates."""
        raise NotImplementedError

    @cached_property
    def values(self) -> TapeValues:
        """Return the written values, on a separate tape."""
        size = self.size + sum(other.size for other in self.touches)
        tape = Tape(size)
        self.write(tape, np.arange(size))
        return TapeValues(tape)

    def residual(self, t: float | Array, q: Array) -> Array:
        """g in states (..., size)."""
        return self.values.residual(t, q)

    def jacobian(self, t: float | Array, q: Array) -> Array:  # noqa: ARG002
        """G in states (..., size)."""
        return self.values.jacobian(q)

    def rate(self, t: float | Array, q: Array) -> Array:  # noqa: ARG002
        """Minus the rates of the prescribed motions."""
        return -self.values.motion(t, 1)

    def velocity_terms(self, t: float | Array, q: Array, v: Array) -> Array:
        """g'' without its acceleration part."""
        return self.values.velocity_terms(t, q, v)

    def curvature(self, q: Array, multipliers: Array) -> Array:
        """d(G^T lambda)/dq at fixed lambda: the geometric stiffness of the joints."""
        return self.values.curvature(q, multipliers)
