"""What one case of a study gives, and outputs: arithmetic over its columns and its summary, never run as code.

The syntax is Python's: names of columns of the job's main table, ``table.column`` for the others, ``summary.key.key``,
numbers, ``+ - * / **``, comparisons, ``&`` and ``|`` between them, ``[...]`` with a number, a text or a comparison, and
the functions of `FUNCTIONS`.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError, unknown_name
from ..base.shown import as_numbers

#: Functions of numbers and columns; gaps of a column (not-a-number) are left out.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "mean": lambda x: np.mean(_there(x)),
    "min": lambda x: np.min(_there(x)),
    "max": lambda x: np.max(_there(x)),
    "sum": lambda x: np.sum(_there(x)),
    "ptp": lambda x: np.ptp(_there(x)),
    "rms": lambda x: np.sqrt(np.mean(np.square(_there(x)))),
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "log10": np.log10,
    "interp": np.interp,
    "count": np.count_nonzero,
}
_OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.USub: lambda x, _: -x,
    ast.UAdd: lambda x, _: x,
}


@dataclass(frozen=True)
class Answer:
    """Tables and summary of a job, as its command writes them.

    Attributes
    ----------
    tables
        Name -> column -> values; the first one is the main table.
    summary
        Content of the job's summary.
    problem
        What did not work though the job has an answer: positions that failed, a run that ended early; else empty.
    """

    tables: Mapping[str, Mapping[str, Any]]
    summary: Mapping[str, Any]
    problem: str = ""

    def names(self) -> dict[str, Any]:
        """Everything that an output may name: columns of the main table, tables, summary."""
        main = next(iter(self.tables.values()), {})
        return {**main, **self.tables, "summary": self.summary}


def value_of(tree: ast.expr, answer: Answer, label: str) -> float:
    """The output's value, one number.

    Raises
    ------
    InputError
        Names that the job does not give, with the near match; what is not one number.
    """
    try:
        with np.errstate(all="ignore"):
            found = _value(tree, answer, label)
            made = np.asarray(np.nan if found is None else found, dtype=float)
    except InputError:
        raise
    except (TypeError, ValueError, IndexError, KeyError, ZeroDivisionError, OverflowError, RecursionError) as error:
        raise InputError(label, None, f"has no value ({error})", "look at the job's own tables") from None
    if made.size != 1:
        cure = "take mean(), min(), max(), ptp() of it, or choose one: [torque_Nm == 100]"
        raise InputError(label, None, f"gives {made.size} values: must be one number", cure)
    return float(made.reshape(()) if made.ndim == 0 else made.ravel()[0])


def _value(node: ast.expr, answer: Answer, label: str) -> Any:  # noqa: PLR0911 (a value for each kind of node)
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float, str)):
        return float(node.value) if isinstance(node.value, int) else node.value
    if isinstance(node, ast.Name):
        return _named(answer.names(), node.id, label)
    if isinstance(node, ast.Attribute):
        within = _value(node.value, answer, label)
        if not isinstance(within, Mapping):
            raise InputError(label, None, f"{ast.unparse(node.value)} has nothing below it", "leave .NAME out")
        return _named(within, node.attr, label)
    if isinstance(node, ast.Subscript):
        within, index = _value(node.value, answer, label), _value(node.slice, answer, label)
        if isinstance(within, Mapping):
            return _named(within, str(index), label)
        where = int(index) if isinstance(index, float) else np.asarray(index, dtype=bool)
        return as_numbers(within)[where]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function = _named(FUNCTIONS, node.func.id, label)
        return function(*(_value(part, answer, label) for part in node.args))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.left, answer, label), _value(node.right, answer, label))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.operand, answer, label), None)
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _OPERATORS:
        left, right = _value(node.left, answer, label), _value(node.comparators[0], answer, label)
        return _OPERATORS[type(node.ops[0])](left, right)
    cure = "use names, numbers, + - * / **, comparisons, [...] and " + ", ".join(f"{name}()" for name in FUNCTIONS)
    raise InputError(label, None, f"does not know {ast.unparse(node)[:40]!r}", cure)


def _there(values: Any) -> Any:
    """Values of a column without its gaps; a column of gaps alone stays one gap."""
    made = np.asarray(values, dtype=float)
    found = made[np.isfinite(made)]
    return found if found.size else np.array([np.nan])


def _named(known: Mapping[str, Any], name: str, label: str) -> Any:
    if name not in known:
        raise unknown_name(label, name, known)
    value = known[name]
    return as_numbers(value) if isinstance(value, (list, tuple)) else value
