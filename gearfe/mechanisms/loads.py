"""Loads by expression: registers on a tape, from which values, slopes and corners follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from ..base.errors import InputError, given
from ..base.expressions import Node, compute, quantities, value_of, without_value
from ..base.typing import Array
from ..multibody import SpanFunction, StateFunction, polynomial
from ..multibody.planar.variables import Affine, BodyVariables
from ..multibody.series.tape import Tape
from .quantities import OF_POINT, PLAIN
from .tables import ValueTable

#: What a load may depend on.
ALLOWED = ("time", "angle", "rate", "x", "y", "vx", "vy")
#: What the tension of a spring may depend on.
OF_SPAN = ("time", "length", "length_rate")
#: The register of a quantity (name, argument).
Leaf = Callable[[tuple[str, str | None]], int]


class Quantities(Protocol):
    """Interface of loads to the mechanism in which they act (`mechanisms.model.Mechanism`)."""

    def angle_of(self, what: str, label: str) -> list[tuple[int, float]]:
        """Moving bodies, with signs, whose angles add up to a named one."""

    def point(self, where: str, label: str) -> tuple[int, tuple[float, float]]:
        """Body number of a named point, and its coordinates relative to the mass centre (m)."""

    def values(self, needed: set[tuple[str, str | None]], q: Array, v: Array) -> Mapping[tuple[str, str | None], Any]:
        """Values of named quantities in states (n, size)."""


class Formula:
    """An expression as a function of the values of its quantities.

    Parameters
    ----------
    text, label
        The expression as written, and its place in the file.
    node
        The expression parsed.
    """

    def __init__(self, text: str, label: str, node: Node) -> None:
        self.text, self.label, self.node, self.names = text, label, node, sorted(quantities(node), key=str)
        for base in constant_bases(node):
            if not base > 0.0:
                raise InputError(label, text, f"raises {base:g} to a power that varies", "give a base > 0")

    def at(self, known: Mapping[tuple[str, str | None], Any]) -> float:
        """Return the value for known quantities; NaN where it has none."""
        try:
            with np.errstate(divide="raise", invalid="raise", over="raise", under="ignore"):
                value = float(value_of(self.node, known))
        except FloatingPointError:
            return math.nan
        return value if math.isfinite(value) else math.nan

    @property
    def described(self) -> str:
        """Place in the file, and the expression, for messages."""
        return f"{self.label} = {self.text!r}"

    def missing(self, t: float, known: Mapping[tuple[str, str | None], Any]) -> str:
        """Return why it has no value at a time (s) for known quantities, or an empty string."""
        if math.isfinite(self.at(known)):
            return ""
        return f"{self.described} at {t:.6g} s: {without_value(self.node, known)}"


def divides(node: Node) -> bool:
    """Return whether it divides by a variable."""
    own = node.parts[1] if node.kind == "/" else node.parts[0] if node.kind == "**" else node
    below = node.kind == "/" or (node.kind == "**" and node.parts[1].kind == "negative")
    return (below and bool(quantities(own))) or node.value == "tan" or any(divides(part) for part in node.parts)


def constant_bases(node: Node) -> list[float]:
    """Numbers that are raised to powers that vary."""
    bases = [base for part in node.parts for base in constant_bases(part)]
    if node.kind == "**" and quantities(node.parts[1]) and not quantities(node.parts[0]):
        bases.append(float(compute(node.parts[0], {})))
    return bases


class ExpressionLoad(Formula, StateFunction):
    """A load given by an expression; `bind` sets the mechanism whose quantities it names.

    Parameters
    ----------
    text, label
        The expression as written, and its place in the file.
    node
        The expression parsed.
    """

    def bind(self, mechanism: Quantities) -> None:
        """Look up bodies, with signs, and points."""
        self.mechanism, label = mechanism, self.label
        self.where: dict[tuple[str, str | None], list[tuple[int, float, float, float]]] = {}
        for kind, what in self.names:
            places: list[tuple[int, float, float, float]] = []  # body, sign, place in its frame
            if kind in ("angle", "rate"):
                places = [(body, sign, 0.0, 0.0) for body, sign in mechanism.angle_of(given(what, label), label)]
            elif kind in OF_POINT:
                body, (x, y) = mechanism.point(given(what, label), label)
                places = [(body, 1.0, x, y)]
            self.where[kind, what] = places

    def value(self, t: float, q: Array, v: Array) -> float:
        """Value at a state."""
        return self.at(self._known(t, q, v))

    def problem(self, t: float, q: Array, v: Array) -> str:
        """Return the expression, the time and the operation without a value, or an empty string."""
        return self.missing(t, self._known(t, q, v))

    def _known(self, t: float, q: Array, v: Array) -> dict[tuple[str, str | None], Any]:
        """Values of its quantities at a state."""
        known = self.mechanism.values(set(self.names), q[None, :], v[None, :])
        return {name: t if name[0] in PLAIN else known[name][0] for name in self.names}

    def pole(self, t: float, value: float) -> str:
        """Expression, time and value."""
        why = " (a division by zero)" if divides(self.node) else ""
        return f"{self.described} at {t:.6g} s: grows beyond {value:.0e}{why}"

    def write(self, bodies: BodyVariables) -> int:
        """Return the register of the load on a tape."""
        return write_expression(self.node, bodies.tape, lambda name: self._quantity(bodies, name))

    def _quantity(self, bodies: BodyVariables, name: tuple[str, str | None]) -> int:
        """Register of one of its quantities."""
        kind, tape, total = name[0], bodies.tape, Affine({}, 0.0)
        if kind == "time":
            return clock(tape)
        for body, sign, x, y in self.where[name]:
            if kind in ("angle", "rate"):
                total = bodies.affine(body, (0.0, 0.0, sign, 0.0, 0.0), total)
            else:
                total = bodies.point(body, 1.0, x, y)[kind[-1] == "y"]
        return tape.linear(*total) if kind in ("angle", "x", "y") else tape.rate(total.terms)


class ExpressionTension(Formula, SpanFunction):
    """The tension of a spring given by an expression; text, label and node as of `ExpressionLoad`."""

    def value(self, t: float, length: float, rate: float) -> float:
        """Tension (N)."""
        return self.at(_of_span(t, length, rate))

    def problem(self, t: float, length: float, rate: float) -> str:
        """Return the expression, the time and the operation without a value, or an empty string."""
        return self.missing(t, _of_span(t, length, rate))

    def write(self, tape: Tape, length: int, rate: int) -> int:
        """Return the register of the load on a tape."""
        known = {"length": length, "length_rate": rate}
        return write_expression(self.node, tape, lambda name: known[name[0]] if name[0] in known else clock(tape))


def _of_span(t: float, length: float, rate: float) -> dict[tuple[str, str | None], Any]:
    return {(name, None): value for name, value in zip(OF_SPAN, (t, length, rate), strict=True)}


def _cosine_of_sine(tape: Tape, a: int) -> int:
    return tape.power(tape.sum(tape.mul(a, a), f=-1.0, c=1.0), 0.5)


CALLS: Mapping[str, Callable[..., int]] = {
    "sqrt": lambda tape, a: tape.power(a, 0.5),
    "sin": lambda tape, a: tape.sincos(a)[0],
    "cos": lambda tape, a: tape.sincos(a)[1],
    "tan": lambda tape, a: tape.quotient(*tape.sincos(a)),
    "asin": lambda tape, a: tape.angle(a, _cosine_of_sine(tape, a)),
    "acos": lambda tape, a: tape.angle(_cosine_of_sine(tape, a), a),
    "atan": lambda tape, a: tape.angle(a, tape.number(1.0)),
    "atan2": lambda tape, a, b: tape.angle(a, b),
    "hypot": lambda tape, a, b: tape.power(tape.sum(tape.mul(a, a), tape.mul(b, b)), 0.5),
    "exp": lambda tape, a: tape.exp(a),
    "log": lambda tape, a: tape.log(a),
    "log10": lambda tape, a: tape.sum(tape.log(a), f=1.0 / math.log(10.0)),
    "tanh": lambda tape, a: tape.tanh(a),
    "abs": lambda tape, a: tape.magnitude(a),
    "min": lambda tape, a, b: tape.larger(a, b, -1.0),
    "max": lambda tape, a, b: tape.larger(a, b),
    "+": lambda tape, a, b: tape.sum(a, b),
    "-": lambda tape, a, b: tape.sum(a, b, g=-1.0),
    "*": lambda tape, a, b: tape.mul(a, b),
    "/": lambda tape, a, b: tape.quotient(a, b),
    "negative": lambda tape, a: tape.sum(a, f=-1.0),
    "**": lambda tape, a, b: tape.exp(tape.mul(b, tape.log(a))),
}


def write_expression(node: Node, tape: Tape, leaf: Leaf) -> int:
    """Register of an expression."""
    if node.kind == "number":
        return tape.number(node.value)
    if node.kind == "quantity":
        return leaf(node.value)
    if node.kind == "**" and (exponent := _number(node.parts[1])) is not None:
        return tape.power(write_expression(node.parts[0], tape, leaf), exponent)
    parts = [write_expression(part, tape, leaf) for part in node.parts]
    if node.kind == "table":
        table: ValueTable = node.value[1]
        return tape.table(parts[0], table.x, table.pieces, table.period)
    return CALLS[node.value if node.kind == "call" else node.kind](tape, *parts)


def _number(node: Node) -> float | None:
    """Value of a number with or without a sign."""
    if node.kind == "negative":
        inner = _number(node.parts[0])
        return None if inner is None else -inner
    return float(node.value) if node.kind == "number" else None


def clock(tape: Tape) -> int:
    """Register of time."""
    return tape.function(polynomial((0.0, 1.0)))
