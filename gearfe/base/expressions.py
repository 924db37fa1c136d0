"""Arithmetic expressions of job files: one syntax, one table of functions and constants, never run as code.

The syntax is Python's: numbers, ``+ - * / **``, the constants and functions below, and the names of a `Names`. These
are plain names (``time``), quantities of a part (``x(rod.tip)``) and tables (``cam(time)``). If names are columns of
tables, there are also ``table.column``, texts, comparisons, and ``&`` and ``|`` between these. ``[...]`` takes a
number, a text or a comparison. Functions reduce a column to one number. `parse` makes a tree of `Node`; `compute` gives
its value for numbers and arrays alike.
"""

from __future__ import annotations

import ast
import keyword
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .errors import InputError, unknown_name
from .shown import as_numbers

#: Most characters and operations of an expression: evaluations go down its tree, one call to a level.
LONGEST, OPERATIONS = 2000, 200
#: The largest number that there is.
LARGEST = float(np.finfo(float).max)
#: Constants by name.
CONSTANTS = {"pi": float(np.pi)}
#: A function of one number, NaN where it has no value.
Table = Callable[[Any], Any]
#: A quantity and what it is of: ("time", None), ("x", "rod.tip").
Quantity = tuple[str, str | None]


def _known(values: Any) -> Any:
    """Values of a column without its gaps (NaN); a column of gaps alone stays one gap."""
    column = np.asarray(values, dtype=float)
    finite = column[np.isfinite(column)]
    return finite if finite.size else np.array([np.nan])


#: Functions of numbers by name and number of arguments, element by element on arrays.
FUNCTIONS: dict[tuple[str, int], Callable[..., Any]] = {
    ("sqrt", 1): np.sqrt,
    ("sin", 1): np.sin,
    ("cos", 1): np.cos,
    ("tan", 1): np.tan,
    ("asin", 1): np.arcsin,
    ("acos", 1): np.arccos,
    ("atan", 1): np.arctan,
    ("atan2", 2): np.arctan2,
    ("hypot", 2): np.hypot,
    ("abs", 1): np.abs,
    ("exp", 1): np.exp,
    ("log", 1): np.log,
    ("log10", 1): np.log10,
    ("tanh", 1): np.tanh,
    ("min", 2): np.minimum,
    ("max", 2): np.maximum,
}
#: Functions that make one number of columns; gaps of a column are left out.
OF_COLUMNS: dict[tuple[str, int], Callable[..., Any]] = {
    ("mean", 1): lambda x: np.mean(_known(x)),
    ("min", 1): lambda x: np.min(_known(x)),
    ("max", 1): lambda x: np.max(_known(x)),
    ("sum", 1): lambda x: np.sum(_known(x)),
    ("ptp", 1): lambda x: np.ptp(_known(x)),
    ("rms", 1): lambda x: np.sqrt(np.mean(np.square(_known(x)))),
    ("count", 1): np.count_nonzero,
    ("interp", 3): np.interp,
}
_CALLS = FUNCTIONS | OF_COLUMNS
_ARITHMETIC: dict[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power, "negative": np.negative,
}  # fmt: skip
_LOGIC: dict[str, Callable[..., Any]] = {
    "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal, "!=": np.not_equal,
    "&": np.bitwise_and, "|": np.bitwise_or,
}  # fmt: skip
_SIGNS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**", ast.BitAnd: "&", ast.BitOr: "|",
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


@dataclass(frozen=True)
class Names:
    """Names that an expression may use besides functions and constants.

    Attributes
    ----------
    plain : sequence of str or None
        Names of quantities. None: columns of tables, which are looked up when the expression is evaluated.
    of : mapping of str to str
        Quantities of something -> what their argument must be, for messages: ``{"x": "a point such as rod.B"}``.
    tables : mapping
        Functions of one number that the job defines, by name.
    what : str
        The expression in messages: ``a load``.
    others : sequence of str
        Quantities that exist, but not in such an expression.
    constants : mapping
        Numbers that the job names.
    """

    plain: Sequence[str] | None = ()
    of: Mapping[str, str] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    what: str = "an expression"
    others: Sequence[str] = ()
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def columns(self) -> bool:
        """Return whether names are columns of tables."""
        return self.plain is None

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of the functions."""
        return tuple(dict.fromkeys(name for name, _ in (_CALLS if self.columns else FUNCTIONS)))

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantities and constants as one writes them."""
        return (*(self.plain or ()), *(f"{name}(...)" for name in self.of), *CONSTANTS, *self.constants)


@dataclass(frozen=True)
class Node:
    """A piece of an expression.

    Attributes
    ----------
    kind : str
        "number", "text", "quantity", "call", "table", "member" (``a.b``), "item" (``a[b]``), "negative" or a sign.
    value
        Number, text, quantity, name of a function, name and function of a table, or name of a member.
    parts : tuple of Node
        Arguments or operands.
    """

    kind: str
    value: Any = None
    parts: tuple[Node, ...] = ()


def parse(text: str, label: str, names: Names) -> Node:
    """Return the tree of an expression.

    Parameters
    ----------
    text : str
        The expression.
    label : str
        Name of its key in messages.
    names : Names
        Names that it may use.

    Raises
    ------
    InputError
        If the text is too long, not arithmetic, or uses unknown names.
    """
    return _Parser(text, label, names).node(_syntax(text, label))


def quantities(node: Node) -> set[Quantity]:
    """Quantities (name, argument) that the expression uses."""
    used = {node.value} if node.kind == "quantity" else set()
    for part in node.parts:
        used |= quantities(part)
    return used


def compute(node: Node, values: Mapping[Quantity, Any], label: str = "") -> Any:
    """Return the value of the expression, with NaN and infinity where an operation has no value.

    Parameters
    ----------
    node : Node
        The expression.
    values : mapping
        Every quantity as a number or an array; with columns also texts and mappings.
    label : str
        Name of its key in messages.

    Raises
    ------
    InputError
        For members and items that a table does not have.
    """
    with np.errstate(all="ignore"):
        return value_of(node, values, label)


def value_of(node: Node, values: Mapping[Quantity, Any], label: str = "") -> Any:
    """Return the same as `compute`; the caller's `numpy.errstate` decides on operations without a value."""
    parts = [value_of(part, values, label) for part in node.parts]
    match node.kind:
        case "number" | "text":
            return node.value
        case "quantity":
            return _plain(values[node.value])
        case "member":
            return _below(parts[0], node.value, label)
        case "item":
            return _item(parts[0], parts[1], label)
    if node.kind in _LOGIC:
        return _LOGIC[node.kind](*(np.asarray(part) for part in parts))
    function = _function(node)
    return function(*(np.asarray(part, dtype=float) for part in parts))


def _function(node: Node) -> Callable[..., Any]:
    """Function of numbers that a node applies to its parts."""
    if node.kind == "table":
        return node.value[1]
    return _CALLS[node.value, len(node.parts)] if node.kind == "call" else _ARITHMETIC[node.kind]


def without_value(node: Node, values: Mapping[Quantity, Any]) -> str:
    """Describe the first operation on single numbers that has no value; return an empty string if there is none."""
    for part in node.parts:
        if problem := without_value(part, values):
            return problem
    if node.kind not in ("call", "table", *_ARITHMETIC):
        return ""
    result, *arguments = (np.asarray(compute(one, values), dtype=float) for one in (node, *node.parts))
    if result.size != 1 or np.isfinite(result).all() or not all(a.size == 1 and np.isfinite(a) for a in arguments):
        return ""
    numbers = [f"{float(argument):g}" for argument in arguments]
    if node.kind == "table":
        name, table = node.value
        return f"table {name!r} goes from {table.x[0]:g} to {table.x[-1]:g} and is asked at {numbers[0]}"
    if node.kind == "call":
        return f"{node.value}({', '.join(numbers)}) has no value"
    return f"{f' {node.kind} '.join(numbers)} has no value"


def _plain(value: Any) -> Any:
    """A list as an array of numbers."""
    return as_numbers(value) if isinstance(value, (list, tuple)) else value


def _below(table: Any, name: str, label: str) -> Any:
    """Entry of a mapping."""
    if not isinstance(table, Mapping):
        raise InputError(label, None, "has nothing below it", f"leave .{name} out")
    if name not in table:
        raise unknown_name(label, name, table)
    return _plain(table[name])


def _item(column: Any, index: Any, label: str) -> Any:
    """Entries of a column by a number or a comparison, or of a mapping by a text."""
    if isinstance(column, Mapping):
        return _below(column, str(index), label)
    place = np.asarray(index)
    if place.ndim == 0 and place.dtype.kind == "f":
        if not float(place).is_integer():
            raise InputError(
                label, float(place), "is not an index of a column", "count from 0, or from the end with -1"
            )
        return as_numbers(column)[int(place)]
    return as_numbers(column)[np.asarray(place, dtype=bool)]


def _syntax(text: str, label: str) -> ast.expr:
    """Python's tree of the text."""
    if len(text) > LONGEST:
        raise InputError(label, None, f"is longer than {LONGEST} characters", "split it into several outputs")
    if sum(text.count(sign) for sign in "+-*/(") > OPERATIONS:
        raise InputError(label, None, f"has more than {OPERATIONS} operations", "split it into several outputs")
    try:
        tree = ast.parse(_in_line(text), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        problem, cure = str(error).partition(" (")[0], "write numbers, names and functions as in Python"
        words = [word for word in re.findall(r"\w+", text) if keyword.iskeyword(word)]
        if words:
            cure += f"; {words[0]} is one of its keywords and cannot be a name"
        raise InputError(label, text, f"is not an expression: {problem}", cure) from None
    if _depth(tree) > OPERATIONS:
        raise InputError(label, None, f"is nested more than {OPERATIONS} times", "split it into several outputs")
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
            parts = [(_written(text, part), isinstance(part, ast.BinOp)) for part in (node.left, node.right)]
            power = " ** ".join(f"({part})" if joined else part for part, joined in parts)
            raise InputError(label, text, "has ^, which is no power in this syntax", f"write {power}")
    return tree


def _in_line(text: str) -> str:
    return " ".join(text.splitlines()).strip()


def _written(text: str, tree: ast.AST) -> str:
    """A piece of Python's tree as the text has it."""
    return ast.get_source_segment(_in_line(text), tree) or ""


def _depth(tree: ast.AST) -> int:
    """Levels of expressions below each other, counted without recursion."""
    depth, level = 0, [tree]
    while level:
        depth += 1
        level = [child for node in level for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
    return depth


@dataclass(frozen=True)
class _Parser:
    """From Python's tree to ours, which has only what is known."""

    text: str
    label: str
    names: Names

    def node(self, tree: ast.expr) -> Node:  # noqa: PLR0911 (a value for each kind of node)
        columns = self.names.columns
        match tree:
            case ast.Constant(value=float() | int() as value) if not isinstance(value, bool):
                if not abs(value) <= LARGEST:
                    raise self.wrong(f"a number in it is larger than {LARGEST:.2g}")
                return Node("number", float(value))
            case ast.Constant(value=str() as value) if columns:
                return Node("text", value)
            case ast.Name(id=name):
                return self.name(name)
            case ast.UnaryOp(op=ast.USub()):
                return Node("negative", parts=(self.node(tree.operand),))
            case ast.UnaryOp(op=ast.UAdd()):
                return self.node(tree.operand)
            case ast.BinOp() if self.sign(tree.op):
                return Node(self.sign(tree.op), parts=(self.node(tree.left), self.node(tree.right)))
            case ast.Compare(ops=[sign], comparators=[right]) if self.sign(sign):
                return Node(self.sign(sign), parts=(self.node(tree.left), self.node(right)))
            case ast.Call(func=ast.Name(id=name), keywords=[]):
                return self.call(name, tree.args)
            case ast.Attribute() if columns:
                return Node("member", tree.attr, (self.node(tree.value),))
            case ast.Subscript() if columns:
                return Node("item", parts=(self.node(tree.value), self.node(tree.slice)))
        raise self.wrong(f"cannot read {_written(self.text, tree)[:40]!r}")

    def sign(self, operator: ast.AST) -> str:
        """Sign of an operator, or nothing for one that is not known here."""
        sign = _SIGNS.get(type(operator), "")
        return sign if self.names.columns or sign in _ARITHMETIC else ""

    def name(self, name: str) -> Node:
        plain = self.names.plain
        for constants in (CONSTANTS, self.names.constants):
            if name in constants:
                return Node("number", float(constants[name]))
        if plain is None or name in plain:
            return Node("quantity", (name, None))
        raise self.unknown(name, self.names.quantities)

    def call(self, name: str, arguments: Sequence[ast.expr]) -> Node:
        names = self.names
        if name in names.of:
            match arguments:
                case [ast.Name() | ast.Attribute(value=ast.Name()) as argument]:
                    return Node("quantity", (name, ast.unparse(argument)))
            raise self.wrong(f"{name}(...) needs the name of {names.of[name]}")
        counts = [count for known, count in _CALLS if known == name and (names.columns or (name, count) in FUNCTIONS)]
        counts += [1] if name in names.tables else []
        if not counts:
            raise self.unknown(name, [*names.functions, *names.tables, *names.of])
        if len(arguments) not in counts:
            known = " or ".join(map(str, counts))
            raise self.wrong(f"{name} takes {known} argument(s), not {len(arguments)}")
        parts = tuple(self.node(argument) for argument in arguments)
        return Node("table", (name, names.tables[name]), parts) if name in names.tables else Node("call", name, parts)

    def unknown(self, name: str, known: Sequence[str]) -> InputError:
        """Error for a name that does not exist, or not in such an expression; `known` could stand there."""
        names = self.names
        if name in names.others:
            quantities_here = ", ".join((*(names.plain or ()), *names.of))
            problem = f"uses {name}; {names.what} may depend on {quantities_here}"
            return InputError(self.label, self.text, problem, "use one of these")
        return unknown_name(f"{self.label} = {self.text!r}", name, known)

    def wrong(self, problem: str) -> InputError:
        names = self.names
        known = ("names", "texts", "comparisons", "[...]") if names.columns else names.quantities
        functions = ", ".join(f"{name}()" for name in (*names.functions, *names.tables))
        cure = f"use numbers, + - * / **, {', '.join(known)} and {functions}"
        return InputError(self.label, self.text, f"is not an expression: {problem}", cure)
