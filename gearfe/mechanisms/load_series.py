"""Expressions on a tape: what gives loads their Taylor series."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..rigid import polynomial
from ..rigid.linkage_tape import BodyVariables
from ..rigid.tape import Tape
from .expressions import Node
from .tables import ValueTable

#: The register of a quantity (name, argument).
Leaf = Callable[[tuple[str, str | None]], int]
#: Bodies with signs and points of a quantity, see `mechanisms.loads.ExpressionLoad`.
Where = list[tuple[int, float, float, float]]


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


def quantity(bodies: BodyVariables, kind: str, where: Where) -> int:
    """Register of a quantity of bodies."""
    tape = bodies.tape
    if kind == "time":
        return clock(tape)
    total = None
    for body, sign, x, y in where:
        if kind in ("angle", "rate"):
            total = bodies.affine(body, (0.0, 0.0, sign, 0.0, 0.0), total)
        else:
            total = bodies.point(body, 1.0, x, y)[kind[-1] == "y"]
    if total is None:
        return tape.number(0.0)
    return tape.linear(*total) if kind in ("angle", "x", "y") else tape.rate(total.terms)
