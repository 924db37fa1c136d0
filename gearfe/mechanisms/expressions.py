"""Arithmetic expressions over named quantities, parsed here and never evaluated as code.

expression := term (("+" | "-") term)*        term := factor (("*" | "/") factor)*
factor := ("+" | "-") factor | power          power := atom ("**" factor)?
atom := number | name | name "(" expression ("," expression)* ")" | quantity "(" what ")" | "(" expression ")"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, unknown_name

#: Functions of numbers.
FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    "sqrt": (1, np.sqrt),
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tan": (1, np.tan),
    "asin": (1, np.arcsin),
    "acos": (1, np.arccos),
    "atan": (1, np.arctan),
    "atan2": (2, np.arctan2),
    "hypot": (2, np.hypot),
    "abs": (1, np.abs),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "tanh": (1, np.tanh),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
}
#: Quantities of a body or joint, and of a point.
OF_BODY = ("angle", "rate", "angular_acceleration")
OF_POINT = ("x", "y", "vx", "vy", "ax", "ay")
#: Quantities of a point of a flexible link, of one of finite elements, and of a flexible link.
OF_SECTION = ("deflection", "stretch", "axial_force", "shear_force", "bending_moment", "edge_stress")
OF_PLATE = ("largest_von_mises",)
OF_LINK = ("elastic_energy", "largest_edge_stress", *OF_PLATE)
NAMED = (*OF_BODY, *OF_POINT, *OF_SECTION, *OF_LINK)
#: Quantities of the whole mechanism.
PLAIN = ("time", "kinetic", "potential", "work", "total")
_TOKEN = re.compile(
    r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*(?:\.\w+)?)|(\*\*|[-+*/(),]))"
)
_DEEPEST = 60
#: A function of numbers, not-a-number where it has no value.
Table = Callable[[Any], Any]


@dataclass(frozen=True)
class Node:
    """A piece of an expression: kind is "number", "quantity", "call", "table" or an operator."""

    kind: str
    value: Any = None
    parts: tuple[Node, ...] = ()


def parse(text: str, label: str, tables: Mapping[str, Table] | None = None, *, plain: Sequence[str] = PLAIN) -> Node:
    """Syntax tree of `text`; `label` names it in messages, `tables` are functions of one number by name.

    `plain` are the quantities that stand without a body.

    Raises
    ------
    InputError
        When it is not arithmetic on named quantities.
    """
    tokens, at = [], 0
    stripped = text.rstrip()
    if len(stripped) > 2000:
        raise InputError(label, None, "is longer than 2000 characters", "split it into several outputs")
    if sum(stripped.count(sign) for sign in "+-*/(") > 200:
        raise InputError(label, None, "has more than 200 operations", "split it into several outputs")
    while at < len(stripped):
        match = _TOKEN.match(stripped, at)
        if match is None:
            raise _wrong(label, text, f"cannot read {stripped[at:].strip()[:20]!r}")
        number, name, operator = match.groups()
        tokens.append(("number", number) if number else ("name", name) if name else ("operator", operator))
        at = match.end()
    reader = _Reader(tokens, text, label, tables or {}, plain)
    node = reader.sum(0)
    if reader.at != len(tokens):
        raise _wrong(label, text, f"did not expect {tokens[reader.at][1]!r}")
    return node


def quantities(node: Node) -> set[tuple[str, str | None]]:
    """Quantities (name, argument) that the expression uses."""
    found = {node.value} if node.kind == "quantity" else set()
    for part in node.parts:
        found |= quantities(part)
    return found


def compute(node: Node, values: Mapping[tuple[str, str | None], Any]) -> Any:
    """Value of the expression; `values` holds every quantity as a number or an array."""
    if node.kind == "number":
        return node.value
    if node.kind == "quantity":
        return values[node.value]
    if node.kind == "table":
        return node.value[1](compute(node.parts[0], values))
    parts = [compute(p, values) for p in node.parts]
    with np.errstate(all="ignore"):
        if node.kind == "call":
            return FUNCTIONS[node.value][1](*parts)
        if node.kind == "negative":
            return -parts[0]
        left, right = (np.asarray(p, dtype=float) for p in parts)
        return {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power}[node.kind](left, right)


class _Reader:
    """Recursive descent over the tokens."""

    def __init__(
        self, tokens: list[tuple[str, str]], text: str, label: str, tables: Mapping[str, Table], plain: Sequence[str]
    ) -> None:
        self.tokens, self.text, self.label, self.at = tokens, text, label, 0
        self.tables, self.plain = tables, plain

    def _next(self) -> tuple[str, str]:
        return self.tokens[self.at] if self.at < len(self.tokens) else ("end", "")

    def _take(self, operator: str) -> None:
        if self._next() != ("operator", operator):
            seen = self._next()[1] or "the end"
            raise _wrong(self.label, self.text, f"expected {operator!r} before {seen!r}")
        self.at += 1

    def sum(self, depth: int) -> Node:
        if depth > _DEEPEST:
            raise _wrong(self.label, self.text, "is nested too deeply")
        node = self._product(depth)
        while self._next() in (("operator", "+"), ("operator", "-")):
            sign = self._next()[1]
            self.at += 1
            node = Node(sign, parts=(node, self._product(depth)))
        return node

    def _product(self, depth: int) -> Node:
        node = self._factor(depth)
        while self._next() in (("operator", "*"), ("operator", "/")):
            sign = self._next()[1]
            self.at += 1
            node = Node(sign, parts=(node, self._factor(depth)))
        return node

    def _factor(self, depth: int) -> Node:
        if depth > _DEEPEST:
            raise _wrong(self.label, self.text, "is nested too deeply")
        if self._next() in (("operator", "+"), ("operator", "-")):
            negative = self._next()[1] == "-"
            self.at += 1
            inner = self._factor(depth + 1)
            return Node("negative", parts=(inner,)) if negative else inner
        node = self._atom(depth)
        if self._next() == ("operator", "**"):
            self.at += 1
            node = Node("**", parts=(node, self._factor(depth + 1)))
        return node

    def _atom(self, depth: int) -> Node:
        kind, value = self._next()
        self.at += 1
        if kind == "number":
            return Node("number", float(value))
        if (kind, value) == ("operator", "("):
            node = self.sum(depth + 1)
            self._take(")")
            return node
        if kind != "name":
            self.at -= 1
            raise _wrong(self.label, self.text, f"expected a number or a name before {value or 'the end'!r}")
        if self._next() != ("operator", "("):
            return self._plain(value)
        self.at += 1
        if value in NAMED:
            kind, what = self._next()
            if kind != "name":
                one = {OF_BODY: "a body or joint", OF_LINK: "a flexible link"}
                example = next((text for names, text in one.items() if value in names), "a point such as rod.B")
                raise _wrong(self.label, self.text, f"{value}(...) needs the name of {example}")
            self.at += 1
            self._take(")")
            return Node("quantity", (value, what))
        if value not in FUNCTIONS and value not in self.tables:
            raise unknown_name(f"{self.label} = {self.text!r}", value, [*FUNCTIONS, *self.tables, *NAMED])
        parts = [self.sum(depth + 1)]
        while self._next() == ("operator", ","):
            self.at += 1
            parts.append(self.sum(depth + 1))
        self._take(")")
        wanted = 1 if value in self.tables else FUNCTIONS[value][0]
        if len(parts) != wanted:
            raise _wrong(self.label, self.text, f"{value} takes {wanted} argument(s), not {len(parts)}")
        if value in self.tables:
            return Node("table", (value, self.tables[value]), tuple(parts))
        return Node("call", value, tuple(parts))

    def _plain(self, name: str) -> Node:
        if name == "pi":
            return Node("number", float(np.pi))
        if name not in self.plain:
            known = [*self.plain, "pi", *(f"{q}(...)" for q in NAMED)]
            raise unknown_name(f"{self.label} = {self.text!r}", name, known)
        return Node("quantity", (name, None))


def _wrong(label: str, text: str, problem: str) -> InputError:
    cure = "write arithmetic on numbers, angle(body), x(body.point), vx(...), ax(...), kinetic, time, pi"
    return InputError(label, text, f"is not an expression: {problem}", cure)
