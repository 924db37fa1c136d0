"""Arithmetic expressions over named quantities: numbers, ``+ - * / **``, the functions of `FUNCTIONS`, a mechanism's
tables, and quantities, ``time`` or ``x(rod.tip)``.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError, unknown_name
from ..base.expressions import syntax

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
_OPERATORS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
_ARITHMETIC: dict[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power, "negative": np.negative,
}  # fmt: skip
#: The largest number that there is.
LARGEST = float(np.finfo(float).max)
#: A function of numbers, not-a-number where it has no value.
Table = Callable[[Any], Any]


@dataclass(frozen=True)
class Node:
    """A piece of an expression: kind is "number", "quantity", "call", "table" or an operator."""

    kind: str
    value: Any = None
    parts: tuple[Node, ...] = ()


def parse(
    text: str, label: str, tables: Mapping[str, Table] | None = None, *, known: Sequence[str] = (*PLAIN, *NAMED)
) -> Node:
    """Return the syntax tree of an arithmetic expression.

    Parameters
    ----------
    text : str
        The expression.
    label : str
        Name of its key in messages.
    tables : mapping, optional
        Functions of one number by name.
    known : sequence of str
        Quantities that messages offer for an unknown name. Those that take no body extend `PLAIN`.

    Raises
    ------
    InputError
        If the text is not arithmetic on named quantities.
    """
    functions, where = tables or {}, f"{label} = {text!r}"
    plain, named = [q for q in known if q not in NAMED], [q for q in known if q in NAMED]

    def node(tree: ast.expr) -> Node:  # noqa: PLR0911 (a value for each kind of node)
        match tree:
            case ast.Constant(value=float() | int() as value) if not isinstance(value, bool):
                if not abs(value) <= LARGEST:
                    raise _wrong(label, text, f"a number in it is larger than {LARGEST:.2g}")
                return Node("number", float(value))
            case ast.Name(id="pi"):
                return Node("number", float(np.pi))
            case ast.Name(id=name) if name in plain or name in PLAIN:
                return Node("quantity", (name, None))
            case ast.Name(id=name):
                raise unknown_name(where, name, [*plain, "pi", *(f"{q}(...)" for q in named)])
            case ast.UnaryOp(op=ast.USub()):
                return Node("negative", parts=(node(tree.operand),))
            case ast.UnaryOp(op=ast.UAdd()):
                return node(tree.operand)
            case ast.BinOp() if type(tree.op) in _OPERATORS:
                return Node(_OPERATORS[type(tree.op)], parts=(node(tree.left), node(tree.right)))
            case ast.Call(func=ast.Name(id=name), keywords=[]):
                return call(name, tree.args)
        raise _wrong(label, text, f"cannot read {ast.unparse(tree)[:40]!r}")

    def call(name: str, arguments: Sequence[ast.expr]) -> Node:
        if name in NAMED:
            match arguments:
                case [ast.Name() | ast.Attribute(value=ast.Name()) as what]:
                    return Node("quantity", (name, ast.unparse(what)))
            one = {OF_BODY: "a body or joint", OF_LINK: "a flexible link"}
            example = next((text for names, text in one.items() if name in names), "a point such as rod.B")
            raise _wrong(label, text, f"{name}(...) needs the name of {example}")
        if name not in FUNCTIONS and name not in functions:
            raise unknown_name(where, name, [*FUNCTIONS, *functions, *named])
        count = 1 if name in functions else FUNCTIONS[name][0]
        if len(arguments) != count:
            raise _wrong(label, text, f"{name} takes {count} argument(s), not {len(arguments)}")
        parts = tuple(node(one) for one in arguments)
        return Node("table", (name, functions[name]), parts) if name in functions else Node("call", name, parts)

    return node(syntax(text, label))


def quantities(node: Node) -> set[tuple[str, str | None]]:
    """Quantities (name, argument) that the expression uses."""
    found = {node.value} if node.kind == "quantity" else set()
    for part in node.parts:
        found |= quantities(part)
    return found


def compute(node: Node, values: Mapping[tuple[str, str | None], Any]) -> Any:
    """Value of the expression; `values` holds every quantity as a number or an array."""
    with np.errstate(all="ignore"):
        return value_of(node, values)


def value_of(node: Node, values: Mapping[tuple[str, str | None], Any]) -> Any:
    """As `compute`; what becomes of an operation without a value is the caller's `numpy.errstate`."""
    if node.kind == "number":
        return node.value
    if node.kind == "quantity":
        return values[node.value]
    parts = [np.asarray(value_of(part, values), dtype=float) for part in node.parts]
    if node.kind == "table":
        return node.value[1](*parts)
    return FUNCTIONS[node.value][1](*parts) if node.kind == "call" else _ARITHMETIC[node.kind](*parts)


def without_value(node: Node, values: Mapping[tuple[str, str | None], Any]) -> str:
    """The first operation that has no value, with its numbers, in words; empty where all have one."""
    for part in node.parts:
        if found := without_value(part, values):
            return found
    if np.isfinite(compute(node, values)):
        return ""
    numbers = [f"{float(compute(part, values)):g}" for part in node.parts]
    if node.kind == "table":
        name, table = node.value
        return f"table {name!r} goes from {table.x[0]:g} to {table.x[-1]:g} and is asked at {numbers[0]}"
    if node.kind in _OPERATORS.values():
        return f"{f' {node.kind} '.join(numbers)} has no value"
    return f"{node.value}({', '.join(numbers)}) has no value"


def _wrong(label: str, text: str, problem: str) -> InputError:
    cure = "write arithmetic on numbers, angle(body), x(body.point), vx(...), ax(...), kinetic, time, pi"
    return InputError(label, text, f"is not an expression: {problem}", cure)
