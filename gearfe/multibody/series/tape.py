"""Equations of motion as a tape: a list of elementary operations whose Taylor series follow from one another.

The variables are z = (q, functions of single coordinates: cosines, sines, tables). Rows of constraints are quadratic
in them,

    g_r = c_r + sum_i L_ri z_i + sum B_rij z_i z_j - motion_r(t),

forces are registers of the tape along variables: a register f along z_i with the factor w gives the coordinates the
force w f dz_i/dq. Registers are sums, products, quotients, powers and other functions of registers before them, of
variables, their rates and time. `min`, `max`, `abs` and tables consist of pieces. They keep the piece that they are on,
and steps end where it ends. (Moore's recurrences: Hairer, Norsett & Wanner I, Sec. I.8; Jorba & Zou, Exp. Math. 14
(2005) 99-117.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, BoolArray, IntArray
from .timefunctions import TimeFunction, Times, time_arrays

#: Operations: f a + g b + c; of the variables, of their rates; of time; products and so on, see `recurrences`.
SUM, LINEAR, RATE, FUNCTION, MUL, DIV, POWER, EXP, LOG, SIN, COS, TANH, ANGLE, SIDE, SHIFT, ENTRY = range(16)
#: Factors of variables by their numbers.
Terms = Mapping[int, float]


class Rows(NamedTuple):
    """Constraints: p linear terms, b products."""

    place: IntArray  # (p, 2) row, variable
    factor: Array  # (p,)
    pair: IntArray  # (b, 3) row, variable, variable
    weight: Array  # (b,)
    constant: Array  # (m,)
    motion: IntArray  # (m,) function of time, -1 for none
    unit: Array  # (m,) sizes that count as much as 1 rad


class Code(NamedTuple):
    """The registers."""

    op: IntArray  # (registers, 4) operation and operands
    factor: Array  # (registers, 3)
    first: IntArray  # (leaves + 1,) terms of the linear forms of variables
    variable: IntArray  # (terms,)
    weight: Array  # (terms,)
    push: IntArray  # (pushes, 2) register, variable that it acts along
    share: Array  # (pushes,)
    checked: IntArray  # (c,) pushes of which a series may say too little: x^30, tanh 100 x


class Switches(NamedTuple):
    """Registers that choose among pieces: by their sign, or by the knots of a table."""

    register: IntArray  # (s,)
    first: IntArray  # (s + 1,) knots, of a table two or more
    knot: Array
    entry: Array  # (knots, 4) coefficients from a knot on, highest first
    period: Array  # (s,) 0 for none
    above: IntArray  # (s,) for a denominator the register above it, -1 for none


class Curves(NamedTuple):
    """Variables u(q) that are functions of one coordinate, f in all; their derivatives u' are such variables, too."""

    place: IntArray  # (f, 4) coordinate, variable u', switch of a table (-1: none), derivative of that
    sign: Array  # (f,) factor of u'; none for a third derivative, whose pieces are constant


class Bars(NamedTuple):
    """Gauss points of beams, p in all, each among four nodes."""

    place: IntArray  # (p, 4) coordinate x of the nodes, y and angle follow it
    shape: Array  # (p, 4) shape functions, and their derivatives by the arc length
    slope: Array  # (p, 4)
    weight: Array  # (p,)
    stiffness: Array  # (p, 3) axial, shear, bending
    damping: Array  # (p,) Kelvin and Voigt's time
    stress: IntArray  # (p,) number of the first of its three stresses


class Floats(NamedTuple):
    """Bodies in floating frames."""

    place: IntArray  # (b, 6) first coordinate, modes, strains, where its linear and quadratic begin, first stress
    linear: Array
    quadratic: Array
    damping: Array  # (b,)


class Program(NamedTuple):
    """Everything that the kernels need, for n coordinates and m rows."""

    mass: Array  # (n, n)
    block: IntArray  # (e, 2) entries of damping and stiffness
    damping: Array  # (e,)
    stiffness: Array  # (e,)
    constant: Array  # (n,) forces
    unit: Array  # (n,) sizes of the coordinates
    curves: Curves  # variables n, n + 1, ...
    rows: Rows
    code: Code
    switches: Switches
    times: Times
    bars: Bars
    floats: Floats

    def without_redundant(self, active: BoolArray) -> Program:
        """The same without the rows that are not `active`, shape (m,)."""
        if active.all():
            return self
        rows, number = self.rows, np.cumsum(active) - 1
        held, pairs = active[rows.place[:, 0]], active[rows.pair[:, 0]]
        place, pair = rows.place[held], rows.pair[pairs]
        place[:, 0], pair[:, 0] = number[place[:, 0]], number[pair[:, 0]]
        kept = rows._replace(
            place=place, factor=rows.factor[held], pair=pair, weight=rows.weight[pairs],
            constant=rows.constant[active], motion=rows.motion[active], unit=rows.unit[active],
        )  # fmt: skip
        return self._replace(rows=kept)


class Tape:
    """Writes the equations of a system; operations give the number of a register.

    Parameters
    ----------
    size : int
        Number of coordinates.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._curves: dict[tuple[object, ...], int] = {}
        self._curve_rows: list[tuple[int, int, int, int, float]] = []
        self.constant = np.zeros(size)
        self.functions: list[TimeFunction] = []
        self._rows: list[tuple[Terms, Sequence[tuple[int, int, float]], float, int, float]] = []
        self._ops: list[tuple[int, int, int, int]] = []
        self._factors: list[tuple[float, float, float]] = []
        self._leaves: list[Terms] = []
        self._pushes: list[tuple[int, int, float]] = []
        self._checked: list[int] = []
        self._switches: list[tuple[int, Array, Array, float, int]] = []
        self._known: dict[tuple[object, ...], int] = {}
        self._bars: list[tuple[Array, ...]] = []
        self._floats: list[tuple[tuple[int, ...], Array, Array, float]] = []
        self.stresses = 0

    def bars(
        self, place: IntArray, shape: Array, slope: Array, weight: Array, stiffness: Array, damping: float
    ) -> None:
        """Add the Gauss points of a beam.

        Parameters
        ----------
        place : ndarray of int, shape (p, 4)
            Coordinate x of the four nodes of each point; y and angle follow it.
        shape : ndarray, shape (p, 4)
            Shape functions.
        slope : ndarray, shape (p, 4)
            Their derivatives with the arc length (1/m).
        weight : ndarray, shape (p,)
            Weights of the quadrature (m).
        stiffness : ndarray, shape (3,)
            Axial EA (N), shear (N) and bending EI (N m2), of all points.
        damping : float
            Kelvin-Voigt time (s).
        """
        count = len(place)
        numbers = self.stresses + 3 * np.arange(count)
        self._bars.append(
            (place, shape, slope, weight, np.tile(stiffness, (count, 1)), np.full(count, damping), numbers)
        )
        self.stresses += 3 * count

    def floating(self, first: int, linear: Array, quadratic: Array, damping: float) -> None:
        """Add a body in a floating frame, see `floating.FloatingBody`.

        Parameters
        ----------
        first : int
            Number of its first coordinate.
        linear : ndarray, shape (s, r)
            L.
        quadratic : ndarray, shape (s, r, r)
            Q.
        damping : float
            Kelvin-Voigt time (s).
        """
        self._floats.append(((first, *linear.shape[::-1], self.stresses), linear, quadratic, damping))
        self.stresses += len(linear)

    def turn(self, angle: int) -> tuple[int, int]:
        """Variables that are cosine and sine of the coordinate `angle`."""
        if (angle,) not in self._curves:
            at = self._curves[angle,] = self.size + len(self._curve_rows)
            self._curve_rows += [(angle, at + 1, -1, 0, -1.0), (angle, at, -1, 1, 1.0)]
        at = self._curves[angle,]
        return at, at + 1

    def curve(self, coordinate: int, knots: Array, entries: Array, period: float = 0.0) -> int:
        """Return the variable that is a table of a coordinate.

        Parameters
        ----------
        coordinate : int
            Number of the coordinate.
        knots, entries, period
            As of `table`.
        """
        key = (coordinate, knots.tobytes(), entries.tobytes(), period)
        if key not in self._curves:
            at = self._curves[key] = self.size + len(self._curve_rows)
            number = self._table(self.linear({coordinate: 1.0}), knots, entries, period)
            self._curve_rows += [(coordinate, at + min(d + 1, 3), number, d, float(d < 3)) for d in range(4)]
        return self._curves[key]

    def row(
        self, terms: Terms, products: Sequence[tuple[int, int, float]] = (), constant: float = 0.0,
        motion: TimeFunction | None = None, unit: float = 1.0,
    ) -> None:  # fmt: skip
        """Add a constraint: terms + products + constant - motion(t) = 0.

        Parameters
        ----------
        terms : mapping
            Variable -> factor.
        products : sequence of (int, int, float)
            Two variables and the factor of their product.
        constant : float
            Constant term.
        motion : TimeFunction, optional
            Prescribed value over time.
        unit : float
            Size of the row that counts as much as 1 rad.
        """
        self._rows.append((terms, products, constant, -1 if motion is None else self._numbered(motion), unit))

    def push(self, register: int, terms: Terms, *, estimated: bool = False) -> None:
        """Add the force of a register along a form of the variables.

        With `estimated`, the last terms of its series give its error; other forces are checked within each step.
        """
        if not estimated:
            self._checked += range(len(self._pushes), len(self._pushes) + len(terms))
        self._pushes += [(register, variable, factor) for variable, factor in terms.items()]

    # leaves ---------------------------------------------------------------------------------------------------
    def number(self, value: float) -> int:
        """A constant."""
        return self._register(SUM, factors=(0.0, 0.0, float(value)))

    def linear(self, terms: Terms, constant: float = 0.0) -> int:
        """A form of the variables."""
        return self._leaf(LINEAR, terms, constant)

    def rate(self, terms: Terms) -> int:
        """Return the register of its rate."""
        return self._leaf(RATE, terms, 0.0)

    def function(self, function: TimeFunction) -> int:
        """A function of time."""
        return self._register(FUNCTION, self._numbered(function))

    # operations -----------------------------------------------------------------------------------------------
    def sum(self, a: int, b: int = -1, *, f: float = 1.0, g: float = 1.0, c: float = 0.0) -> int:
        """Return the register of f a + g b + c.

        Parameters
        ----------
        a : int
            Register.
        b : int
            Another register, -1 for none.
        f, g : float
            Their factors.
        c : float
            Constant term.
        """
        return self._register(SUM, a, b, factors=(f, g if b >= 0 else 0.0, c))

    def mul(self, a: int, b: int) -> int:
        """a b."""
        return self._register(MUL, a, b)

    def div(self, a: int, b: int) -> int:
        """a / b."""
        return self._register(DIV, a, b)

    def quotient(self, a: int, b: int) -> int:
        """a / b where b may come to zero: a pole, unless a does, too."""
        root = b
        while self._ops[root][0] == MUL and self._ops[root][1] == self._ops[root][2]:
            root = self._ops[root][1]
        if self._ops[root][:2] != (SUM, -1):
            self._switch(root, np.zeros(0), np.zeros((0, 4)), 0.0, a)
        return self.div(a, b)

    def power(self, a: int, exponent: float) -> int:
        """a to a constant power; small whole ones by products, which have values at zero, too."""
        whole = int(exponent)
        if whole != exponent or abs(whole) > 64:
            return self._register(POWER, a, factors=(exponent, 0.0, 0.0))
        if whole < 0:
            return self.quotient(self.number(1.0), self.power(a, float(-whole)))
        if whole < 2:
            return a if whole else self.number(1.0)
        half = self.power(a, float(whole // 2))
        square = self.mul(half, half)
        return self.mul(square, a) if whole % 2 else square

    def exp(self, a: int) -> int:
        """e to a."""
        return self._register(EXP, a)

    def log(self, a: int) -> int:
        """Natural logarithm."""
        return self._register(LOG, a)

    def sincos(self, a: int) -> tuple[int, int]:
        """Sine and cosine."""
        if (SIN, a) not in self._known:
            at = len(self._ops)
            self._known[SIN, a] = self._append(SIN, a, at + 1)
            self._append(COS, a, at)
        at = self._known[SIN, a]
        return at, at + 1

    def tanh(self, a: int) -> int:
        """Hyperbolic tangent y: y' = (1 - y^2) a'."""
        if (TANH, a) not in self._known:
            at = self._known[TANH, a] = self._append(TANH, a, len(self._ops) + 2)
            self._append(MUL, at, at)
            self._append(SUM, at + 1, -1, factors=(-1.0, 0.0, 1.0))
        return self._known[TANH, a]

    def angle(self, y: int, x: int) -> int:
        """atan2(y, x)."""
        square = self.sum(self.mul(x, x), self.mul(y, y))
        return self._register(ANGLE, y, x, square)

    def magnitude(self, a: int) -> int:
        """|a|."""
        if (SIDE, a) not in self._known:
            self._known[SIDE, a] = self._append(SIDE, a, self._switch(a, np.zeros(0), np.zeros((0, 4)), 0.0))
        return self._known[SIDE, a]

    def larger(self, a: int, b: int, sign: float = 1.0) -> int:
        """max(a, b); min(a, b) with the sign -1."""
        gap = self.magnitude(self.sum(a, b, g=-1.0))
        return self.sum(self.sum(a, b, f=0.5, g=0.5), gap, g=0.5 * sign)

    def table(self, a: int, knots: Array, entries: Array, period: float = 0.0) -> int:
        """Return the register of a piecewise cubic in a.

        Parameters
        ----------
        a : int
            Register of the argument.
        knots : ndarray, shape (k,)
            Ends of the pieces, rising.
        entries : ndarray, shape (k - 1, 4)
            Coefficients of powers of the argument less the lower knot, highest first.
        period : float
            Period of the argument; 0 for none.
        """
        number = self._table(a, knots, entries, period)
        shifted = self._append(SHIFT, a, number)
        made = self._append(ENTRY, number, 0)
        for k in range(1, 4):
            made = self.sum(self.mul(made, shifted), self._append(ENTRY, number, k))
        return made

    # ----------------------------------------------------------------------------------------------------------
    def _numbered(self, function: TimeFunction) -> int:
        self.functions.append(function)
        return len(self.functions) - 1

    def _leaf(self, kind: int, terms: Terms, constant: float) -> int:
        key = (kind, tuple(sorted(terms.items())), constant)
        if key not in self._known:
            self._leaves.append(terms)
            self._known[key] = self._append(kind, len(self._leaves) - 1, factors=(0.0, 0.0, constant))
        return self._known[key]

    def _register(
        self, op: int, a: int = -1, b: int = -1, c: int = -1, factors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> int:
        key = (op, a, b, c, factors)
        if key not in self._known:
            self._known[key] = self._append(op, a, b, c, factors)
        return self._known[key]

    def _append(
        self, op: int, a: int = -1, b: int = -1, c: int = -1, factors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> int:
        self._ops.append((op, a, b, c))
        self._factors.append(factors)
        return len(self._ops) - 1

    def _table(self, register: int, knots: Array, entries: Array, period: float) -> int:
        return self._switch(register, knots, np.vstack([entries, np.zeros(4)]), period)

    def _switch(self, register: int, knots: Array, entries: Array, period: float, above: int = -1) -> int:
        self._switches.append((register, knots, entries, period, above))
        return len(self._switches) - 1

    def program(self, mass: Array, damping: Array, stiffness: Array, unit: Array) -> Program:
        """Return all that was written, with the constant matrices of the system.

        Parameters
        ----------
        mass, damping, stiffness : ndarray, shape (n, n)
            Constant matrices.
        unit : ndarray, shape (n,)
            Units of the coordinates.
        """
        linear = [(r, i, f) for r, row in enumerate(self._rows) for i, f in row[0].items() if f != 0.0]
        products = [(r, i, j, f) for r, row in enumerate(self._rows) for i, j, f in row[1] if f != 0.0]
        rows = Rows(
            _ints([p[:2] for p in linear], 2),
            np.array([p[2] for p in linear], dtype=float),
            _ints([p[:3] for p in products], 3),
            np.array([p[3] for p in products], dtype=float),
            np.array([row[2] for row in self._rows], dtype=float),
            np.array([row[3] for row in self._rows], dtype=np.int64),
            np.array([row[4] for row in self._rows], dtype=float),
        )
        terms = [term for leaf in self._leaves for term in leaf.items()]
        code = Code(
            _ints(self._ops, 4),
            np.array(self._factors, dtype=float).reshape(-1, 3),
            np.cumsum([0, *(len(leaf) for leaf in self._leaves)]).astype(np.int64),
            np.array([i for i, _ in terms], dtype=np.int64),
            np.array([f for _, f in terms], dtype=float),
            _ints([p[:2] for p in self._pushes], 2),
            np.array([p[2] for p in self._pushes], dtype=float),
            np.array(self._checked, dtype=np.int64),
        )
        switches = Switches(
            np.array([s[0] for s in self._switches], dtype=np.int64),
            np.cumsum([0, *(len(s[1]) for s in self._switches)]).astype(np.int64),
            np.concatenate([np.zeros(0), *(s[1] for s in self._switches)]),
            np.concatenate([np.zeros((0, 4)), *(s[2] for s in self._switches)]),
            np.array([s[3] for s in self._switches], dtype=float),
            np.array([s[4] for s in self._switches], dtype=np.int64),
        )
        block = np.argwhere((damping != 0.0) | (stiffness != 0.0)).astype(np.int64)
        at = tuple(block.T)
        return Program(
            np.ascontiguousarray(mass), np.ascontiguousarray(block), damping[at], stiffness[at], self.constant, unit,
            Curves(_ints([r[:4] for r in self._curve_rows], 4), np.array([r[4] for r in self._curve_rows], float)),
            rows, code, switches, time_arrays(self.functions), self._bar_arrays(), self._float_arrays(),
        )  # fmt: skip

    def _bar_arrays(self) -> Bars:
        whole, numbers = np.zeros((0, 4), dtype=np.int64), np.zeros(0, dtype=np.int64)
        none = whole, np.zeros((0, 4)), np.zeros((0, 4)), np.zeros(0), np.zeros((0, 3)), np.zeros(0), numbers
        return Bars(*(np.ascontiguousarray(np.concatenate(parts)) for parts in zip(none, *self._bars, strict=True)))

    def _float_arrays(self) -> Floats:
        place, linear, quadratic = [], [np.zeros(0)], [np.zeros(0)]
        for (first, r, s, stress), L, Q, _ in self._floats:
            place.append((first, r, s, sum(map(len, linear)), sum(map(len, quadratic)), stress))
            linear.append(L.ravel())
            quadratic.append(Q.ravel())
        damping = np.array([part[3] for part in self._floats], dtype=float)
        return Floats(_ints(place, 6), np.concatenate(linear), np.concatenate(quadratic), damping)


def _ints(values: Sequence[Sequence[int]], width: int) -> IntArray:
    return np.array(values, dtype=np.int64).reshape(-1, width)
