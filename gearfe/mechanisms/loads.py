"""Loads by expression: compiled to nested functions of floats, with slopes by the chain rule (forward mode)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, given
from ..rigid import SpanFunction, StateFunction
from ..rigid.linkage_tape import BodyVariables
from ..rigid.tape import Tape
from ..typing import Array
from .expressions import OF_POINT, Node, quantities
from .load_series import clock, quantity, write_expression
from .tables import ValueTable

if TYPE_CHECKING:
    from .model import Mechanism

#: (value, slope by each quantity) of an expression at the values of its quantities.
Dual = tuple[float, Array]
Evaluate = Callable[[Sequence[float]], Dual]
#: What a load may depend on.
ALLOWED = ("time", "angle", "rate", "x", "y", "vx", "vy")
#: What the tension of a spring may depend on.
OF_SPAN = ("time", "length", "length_rate")


@dataclass(frozen=True)
class Rule:
    """A function of floats with its slopes."""

    value: Callable[..., float]
    slopes: Callable[..., tuple[float, ...]]


RULES: Mapping[str, Rule] = {
    "sqrt": Rule(math.sqrt, lambda x: (0.5 / math.sqrt(x),)),
    "sin": Rule(math.sin, lambda x: (math.cos(x),)),
    "cos": Rule(math.cos, lambda x: (-math.sin(x),)),
    "tan": Rule(math.tan, lambda x: (1.0 + math.tan(x) ** 2,)),
    "asin": Rule(math.asin, lambda x: (1.0 / math.sqrt(1.0 - x * x),)),
    "acos": Rule(math.acos, lambda x: (-1.0 / math.sqrt(1.0 - x * x),)),
    "atan": Rule(math.atan, lambda x: (1.0 / (1.0 + x * x),)),
    "atan2": Rule(math.atan2, lambda y, x: (x / (x * x + y * y), -y / (x * x + y * y))),
    "hypot": Rule(math.hypot, lambda x, y: (x / math.hypot(x, y), y / math.hypot(x, y))),
    "exp": Rule(math.exp, lambda x: (math.exp(x),)),
    "log": Rule(math.log, lambda x: (1.0 / x,)),
    "tanh": Rule(math.tanh, lambda x: (1.0 - math.tanh(x) ** 2,)),
    "abs": Rule(abs, lambda x: (math.copysign(1.0, x),)),
    "min": Rule(min, lambda x, y: (1.0, 0.0) if x <= y else (0.0, 1.0)),
    "max": Rule(max, lambda x, y: (1.0, 0.0) if x >= y else (0.0, 1.0)),
    "+": Rule(lambda x, y: x + y, lambda x, y: (1.0, 1.0)),  # noqa: ARG005
    "-": Rule(lambda x, y: x - y, lambda x, y: (1.0, -1.0)),  # noqa: ARG005
    "*": Rule(lambda x, y: x * y, lambda x, y: (y, x)),
    "/": Rule(lambda x, y: x / y, lambda x, y: (1.0 / y, -x / (y * y))),
    "negative": Rule(lambda x: -x, lambda x: (-1.0,)),  # noqa: ARG005
}


class Trouble(ArithmeticError):
    """A value that an expression does not have, in words."""


def _power(x: float, y: float) -> float:
    made = x**y
    if isinstance(made, complex):
        raise Trouble(f"{x:g} ** {y:g}")
    return float(made)


def compiled(node: Node, names: Sequence[tuple[str, str | None]]) -> Evaluate:
    """The expression as a function of the values of the quantities `names`, with slopes."""
    count = len(names)
    none = np.zeros(count)
    if node.kind == "number":
        return lambda _: (float(node.value), none)
    if node.kind == "quantity":
        k, unit = names.index(node.value), np.eye(count)[names.index(node.value)]
        return lambda values: (values[k], unit)
    parts = [compiled(p, names) for p in node.parts]
    if node.kind == "table":
        known: tuple[str, ValueTable] = node.value
        called, table = known

        def looked_up(values: Sequence[float]) -> Dual:
            x, slope = parts[0](values)
            if not table.covers(x):
                problem = f"table {called!r} goes from {table.x[0]:g} to {table.x[-1]:g} and is asked at {x:g}"
                raise Trouble(problem)
            return table.value(x), table.slope(x) * slope

        return looked_up
    if node.kind == "**":

        def powered(values: Sequence[float]) -> Dual:
            (x, dx), (y, dy) = (p(values) for p in parts)
            made = _power(x, y)
            slope = y * _power(x, y - 1.0) * dx if dx.any() else none
            return made, slope + made * math.log(x) * dy if dy.any() else slope

        return powered
    name = node.value if node.kind == "call" else node.kind
    rule = RULES[name]

    def applied(values: Sequence[float]) -> Dual:
        made = [p(values) for p in parts]
        arguments = [x for x, _ in made]
        try:
            value = rule.value(*arguments)
        except (ValueError, ZeroDivisionError, OverflowError):
            sign = {"/": " / ", "negative": "-"}.get(name)
            what = (
                sign.join(f"{x:g}" for x in arguments) if sign else f"{name}({', '.join(f'{x:g}' for x in arguments)})"
            )
            raise Trouble(f"{what} has no value") from None
        if not any(d.any() for _, d in made):
            return value, none
        try:
            slopes = rule.slopes(*arguments)
        except ZeroDivisionError:  # a corner such as sqrt at 0
            slopes = tuple(0.0 for _ in arguments)
        return value, np.sum([s * d for s, (_, d) in zip(slopes, made, strict=True)], axis=0)

    return applied


def corners(node: Node, names: Sequence[tuple[str, str | None]]) -> list[Callable[[Sequence[float]], int | None]]:
    """Numbers of the pieces that `abs`, `min`, `max` and tables are on, None beyond a table, and sides of poles."""
    found = [corner for part in node.parts for corner in corners(part, names)]
    parts = [compiled(part, names) for part in node.parts]
    if node.kind == "table":
        table: ValueTable = node.value[1]
        found.append(lambda values: table.place(parts[0](values)[0]))
    elif node.kind == "call" and node.value == "abs":
        found.append(lambda values: int(parts[0](values)[0] >= 0.0))
    elif node.kind == "call" and node.value in ("min", "max"):
        found.append(lambda values: int(parts[0](values)[0] >= parts[1](values)[0]))
    elif node.kind == "call" and node.value == "tan":
        found.append(lambda values: math.floor(parts[0](values)[0] / math.pi + 0.5))
    elif (base := _may_vanish(node)) is not None:
        below = compiled(base, names)
        found.append(lambda values: int(below(values)[0] >= 0.0))
    return found


def _may_vanish(node: Node) -> Node | None:
    """What must not pass zero: the root of a denominator, the base of a negative power."""
    base = (
        node.parts[1] if node.kind == "/" else node if node.kind == "**" and node.parts[1].kind == "negative" else None
    )
    while base is not None and base.kind in ("**", "negative"):
        base = base.parts[0]
    return base if base is not None and quantities(base) else None


def _pieces(found: list[Callable[[Sequence[float]], int | None]], values: Sequence[float]) -> tuple[int | None, ...]:
    try:
        return tuple(corner(values) for corner in found)
    except (Trouble, OverflowError, ZeroDivisionError, ValueError):
        return (None,)


class ExpressionLoad(StateFunction):
    """A load given by an expression; `bind` tells it the mechanism whose quantities it names.

    Parameters
    ----------
    text, label
        The expression as written, and its place in the file.
    node
        The expression parsed.
    """

    def __init__(self, text: str, label: str, node: Node) -> None:
        self.text, self.label, self.node = text, label, node
        self.names = sorted(quantities(node), key=str)
        for kind, _ in self.names:
            if kind not in ALLOWED:
                problem = f"uses {kind}; a load may depend on {', '.join(ALLOWED)}"
                raise InputError(label, text, problem, "use one of these")
        self.evaluate, self.corners = compiled(node, self.names), corners(node, self.names)

    def bind(self, mechanism: Mechanism) -> None:
        """Look up bodies and points."""
        self.size = mechanism.linkage.size
        self.places: list[tuple[str, list[tuple[int, float, float, float]]]] = []
        for kind, what in self.names:
            where: list[tuple[int, float, float, float]] = []  # body, sign, place in its frame
            if kind in ("angle", "rate"):
                for body, sign in mechanism.angle_of(given(what, self.label), self.label):
                    where.append((body, sign, 0.0, 0.0))
            elif kind in OF_POINT:
                body, (x, y) = mechanism.point(given(what, self.label), self.label)
                where.append((body, 1.0, x, y))
            self.places.append((kind, where))

    def value(self, t: float, q: Array, v: Array) -> float:
        """Value at a state."""
        try:
            made = self.evaluate([self._quantity(k, w, t, q, v) for k, w in self.places])[0]
        except (Trouble, OverflowError, ZeroDivisionError, ValueError) as error:
            self.complaint = f"{self.label} = {self.text!r} at {t:.6g} s: {error}"
            return math.nan
        return float(made)

    def slopes(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Slopes by coordinates and velocities."""
        by_q, by_v = np.zeros(self.size), np.zeros(self.size)
        try:
            slopes = self.evaluate([self._quantity(k, w, t, q, v) for k, w in self.places])[1]
        except (Trouble, OverflowError, ZeroDivisionError, ValueError):
            return by_q, by_v  # the value says so
        for slope, (kind, where) in zip(slopes, self.places, strict=True):
            for body, sign, x, y in where:
                k = 3 * body
                if slope == 0.0 or k >= self.size:
                    continue
                if kind == "angle":
                    by_q[k + 2] += slope * sign
                elif kind == "rate":
                    by_v[k + 2] += slope * sign
                else:
                    c, s = math.cos(q[k + 2]), math.sin(q[k + 2])
                    arm = c * x - s * y, s * x + c * y
                    along = kind[-1] == "y"
                    turned = arm[0] if along else -arm[1]
                    held = by_v if kind[0] == "v" else by_q
                    held[k + along] += slope
                    held[k + 2] += slope * turned
                    if kind[0] == "v":
                        by_q[k + 2] -= slope * v[k + 2] * arm[along]
        return by_q, by_v

    def pole(self, t: float, value: float) -> str:
        """Expression, time and value."""
        return f"{self.label} = {self.text!r} at {t:.6g} s: grows beyond {value:.0e} (a division by zero)"

    def pieces(self, t: float, q: Array, v: Array) -> tuple[int | None, ...]:
        """Pieces of all corners; None where there is no value."""
        values = [self._quantity(k, w, t, q, v) for k, w in self.places] if self.corners else []
        return _pieces(self.corners, values)

    def write(self, bodies: BodyVariables) -> int:
        """Its register on a tape."""
        places = dict(zip(self.names, self.places, strict=True))
        return write_expression(self.node, bodies.tape, lambda name: quantity(bodies, *places[name]))

    def _quantity(self, kind: str, where: list[tuple[int, float, float, float]], t: float, q: Array, v: Array) -> float:
        if kind == "time":
            return float(t)  # Python's division tells of zeros
        total = 0.0
        for body, sign, x, y in where:
            k = 3 * body
            if k >= self.size:
                total += {"x": x, "y": y}.get(kind, 0.0)
            elif kind in ("angle", "rate"):
                total += sign * float((q if kind == "angle" else v)[k + 2])
            else:
                c, s = math.cos(q[k + 2]), math.sin(q[k + 2])
                rx, ry = c * x - s * y, s * x + c * y
                w = float(v[k + 2])
                total += {"x": q[k] + rx, "y": q[k + 1] + ry, "vx": v[k] - w * ry, "vy": v[k + 1] + w * rx}[kind]
        return float(total)


class ExpressionTension(SpanFunction):
    """The tension of a spring given by an expression; text, label and node as of `ExpressionLoad`."""

    def __init__(self, text: str, label: str, node: Node) -> None:
        self.text, self.label, self.node = text, label, node
        names = [(name, None) for name in OF_SPAN]
        for kind, _ in quantities(node):
            if kind not in OF_SPAN:
                problem = f"uses {kind}; a tension may depend on {', '.join(OF_SPAN)}"
                raise InputError(label, text, problem, "use one of these")
        self.evaluate, self.corners = compiled(node, names), corners(node, names)

    def value(self, t: float, length: float, rate: float) -> float:
        """Tension (N)."""
        try:
            return float(self.evaluate([float(t), length, rate])[0])
        except (Trouble, OverflowError, ZeroDivisionError, ValueError) as error:
            self.complaint = f"{self.label} = {self.text!r} at {t:.6g} s: {error}"
            return math.nan

    def slopes(self, t: float, length: float, rate: float) -> tuple[float, float]:
        """Slopes by length and rate."""
        try:
            _, by_length, by_rate = self.evaluate([float(t), length, rate])[1]
        except (Trouble, OverflowError, ZeroDivisionError, ValueError):
            return 0.0, 0.0  # the value says so
        return float(by_length), float(by_rate)

    def pieces(self, t: float, length: float, rate: float) -> tuple[int | None, ...]:
        """Pieces of all corners; None where there is no value."""
        return _pieces(self.corners, [float(t), length, rate])

    def write(self, tape: Tape, length: int, rate: int) -> int:
        """Its register on a tape."""
        known = {"length": length, "length_rate": rate}
        return write_expression(self.node, tape, lambda name: known[name[0]] if name[0] in known else clock(tape))
