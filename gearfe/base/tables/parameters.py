"""[parameters] of a mechanism file: numbers by name for the keys of all other tables.

Where a key takes a number, it may have an expression instead, of numbers and parameters: ``length_m = "2*r"``,
``angle_rad = "pi/4"``. Expressions of loads, outputs and start values know the parameters by their names. Expressions
load NumPy, so they are imported where a file has some.
"""

from __future__ import annotations

import dataclasses
import math
import re
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any

from ..config import check_size, type_hints
from ..errors import InputError, unknown_name
from ..other_units import partner

#: Name of the table.
PARAMETERS = "parameters"


def with_parameters(table: type, raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return a parsed file with numbers instead of expressions of its parameters.

    Parameters
    ----------
    table : type
        Dataclass of the file.
    raw : mapping
        The parsed file.

    Raises
    ------
    InputError
        For names that are none, and expressions that are not arithmetic, use unknown names, or have no finite value.
    """
    given = raw.get(PARAMETERS, {})
    if not isinstance(given, Mapping):  # which is an error of its own
        return dict(raw)
    known: dict[str, float] = {}
    taken = _taken() if given else set()
    for name, value in given.items():
        label = f"{PARAMETERS}.{name}"
        if not name.isidentifier():
            problem = "must be a word of letters, digits and _ (it is used in expressions)"
            raise InputError(PARAMETERS, name, problem, "rename it")
        if name in taken:
            raise InputError(PARAMETERS, name, "is the name of a function or a constant", "rename it")
        number = _value(value, label, known) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, int | float):
            cure = 'write a number, or an expression of the parameters above it, such as "2*r"'
            raise InputError(label, value, "must be a number", cure)
        check_size(number, label, "write a smaller one")
        known[name] = number
    used = set(_words({name: table for name, table in raw.items() if name != "title"}))
    for name in known:
        if name not in used:
            raise InputError(f"{PARAMETERS}.{name}", None, "is used nowhere", "use it in a key, or remove it")
    tables = {name: _resolved(type_hints(table).get(name, Any), value, name, known) for name, value in raw.items()}
    return {**tables, PARAMETERS: known} if known else tables


def _taken() -> set[str]:
    """Names of functions and constants, which no parameter may have."""
    from ..expressions import CONSTANTS, FUNCTIONS

    return {*(name for name, _ in FUNCTIONS), *CONSTANTS}


def _words(part: Any) -> Iterator[str]:
    """Words of all texts in a parsed file, and of the expressions that are keys of [start]."""
    if isinstance(part, str):
        yield from re.findall(r"\w+", part)
    elif isinstance(part, dict):
        for key, item in part.items():
            yield from re.findall(r"\w+", key) if not key.isidentifier() else ()
            yield from _words(item)
    elif isinstance(part, list):
        for item in part:
            yield from _words(item)


def _value(text: str, label: str, known: Mapping[str, float]) -> float:
    problem = "must be a number, or an expression of numbers and parameters: "
    if text.isidentifier() and text not in {*known, "pi"}:  # a mere word, which needs no NumPy to be refused
        unknown = unknown_name(label, text, [*known, "pi"])
        raise InputError(label, text, problem + unknown.problem, unknown.cure)

    from ..expressions import Names, compute, parse

    names = Names(what="a number", constants=known)
    try:
        value = float(compute(parse(text, label, names), {}))
    except InputError as error:
        raise InputError(label, text, problem + error.problem, error.cure) from None
    if not math.isfinite(value):
        raise InputError(label, text, "has no finite value", "correct it, or the parameters that it uses")
    return value


def _resolved(hint: Any, value: Any, label: str, known: Mapping[str, float]) -> Any:
    """A value of a type with numbers where this takes numbers and the file has expressions."""
    options = [hint]
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        options = [option for option in typing.get_args(hint) if option is not type(None)]
    if isinstance(value, str):
        if str in options or not {int, float} & set(options):
            return value
        number = _value(value, label, known)
        return int(number) if float not in options and number.is_integer() else number
    for option in options:
        inner = typing.get_args(option)
        if isinstance(value, list) and typing.get_origin(option) is tuple:
            kinds = [inner[0] if inner[-1] is Ellipsis else inner[min(i, len(inner) - 1)] for i in range(len(value))]
            return [_resolved(kinds[i], item, f"{label}[{i}]", known) for i, item in enumerate(value)]
        if isinstance(value, dict) and typing.get_origin(option) is dict:
            return {key: _resolved(inner[1], item, f"{label}.{key}", known) for key, item in value.items()}
        if isinstance(value, dict) and isinstance(option, type) and dataclasses.is_dataclass(option):
            hints = type_hints(option)
            return {
                key: _resolved(hints.get(key, hints.get(partner(key), Any)), item, f"{label}.{key}", known)
                for key, item in value.items()
            }
    return value
