"""Job files: TOML tables read into frozen dataclasses, with every mistake named.

A table is a frozen dataclass whose fields are made with `quantity`; the reader checks types, ranges and names.
`gearfe.base.tables.jobs` says which tables there are.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import tomllib
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING
from pathlib import Path
from typing import Any, TypeVar

from .errors import InputError, nearest, shown, unknown_key
from .files import read_text
from .other_units import as_written, in_known_units, partner
from .suspects import LARGEST, other_unit

T = TypeVar("T")

#: Of a removed key: what became of it, and what to write instead, which may depend on its value.
Removed = tuple[str, str | Callable[[Any], str]]


def renamed(key: str) -> Removed:
    """Return the entry of `Removed` for a key whose name lacked the unit, and has it now."""
    return "has another name, which has its unit", lambda value: f"write {key} = {shown(value)}"


#: Whole numbers have 64 bits in arrays.
LARGEST_WHOLE = 2**63 - 1


def quantity(
    default: Any = MISSING,
    *,
    doc: str,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    below: float | None = None,
    choices: tuple[str, ...] | None = None,
    gone: Mapping[str, str] | None = None,
) -> Any:
    """Return the dataclass field of a key, with what is checked on reading.

    A mutable default (list, dict) is not accepted: use a tuple, ``None`` or a callable default, which makes it.

    Parameters
    ----------
    default : Any
        Value without the key; without a default the key is required.
    doc : str
        One sentence with the unit, for error messages and the generated reference of keys.
    low, high : float, optional
        Least and largest allowed value.
    above, below : float, optional
        Bounds that the value may not reach.
    choices : tuple of str, optional
        Allowed values.
    gone : mapping, optional
        Former value -> what to write instead.
    """
    meta = {"doc": doc, "low": low, "high": high, "above": above, "below": below, "choices": choices, "gone": gone}
    if callable(default):
        return dataclasses.field(default_factory=default, metadata=meta, kw_only=True)
    if default is MISSING:
        return dataclasses.field(metadata=meta, kw_only=True)
    return dataclasses.field(default=default, metadata=meta, kw_only=True)


def read_toml(path: str | Path) -> dict[str, Any]:
    """Parse a TOML file.

    Raises
    ------
    InputError
        When the file is missing, unreadable or not TOML.
    """
    text = read_text(path, "job file")
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise InputError("job file", str(path), "is not valid TOML (lists within lists too deep)", "fix it") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError("job file", str(path), f"is not valid TOML ({error})", "fix that line") from None
    except ValueError:  # Python reads no whole number of more than some thousand digits
        problem = "holds a whole number with thousands of digits"
        raise InputError("job file", str(path), problem, "write it as 1e300") from None
    for name, value in getattr(path, "changes", ()):
        set_key(tables, name, value, f"--set {name}")
    return tables


class JobFile(str):
    """Name of a job file, with changes of its keys: what `read_toml` reads is the file with these."""

    __slots__ = ("changes",)
    changes: tuple[tuple[str, Any], ...]

    def __new__(cls, path: str, changes: Iterable[str] = ()) -> JobFile:
        """The file, and changes written as ``table.key=value``; the value is TOML, or else a text."""
        made = super().__new__(cls, path)
        made.changes = tuple(_change(text) for text in changes)
        return made


def _change(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (equals and name.strip()):
        raise InputError("--set", text, "must be a key and its value", "write --set pair.pinion.teeth=21")
    try:
        return name.strip(), tomllib.loads(f"value = {value.strip()}")["value"]
    except ValueError:
        return name.strip(), value.strip()


def set_key(tables: dict[str, Any], name: str, value: Any, field: str) -> None:
    """Put a value under a dotted name into the tables of a job, as a TOML file would have it.

    Parameters
    ----------
    tables : dict
        Parsed job; changed.
    name : str
        Dotted name of the key; entries of lists by their number.
    value : Any
        Its value.
    field : str
        Name in messages.

    Raises
    ------
    InputError
        If the name leads through a value that is no table, or beyond a list.
    """
    parts = name.split(".")
    place: Any = tables
    for i, part in enumerate(parts):
        last = i == len(parts) - 1
        if isinstance(place, list):
            if not (part.isdigit() and int(part) < len(place)):
                above = ".".join(parts[:i])
                raise InputError(field, None, f"{above} has {len(place)} entries in the job, from 0 on", "choose one")
            if last:
                place[int(part)] = value
            else:
                place = place[int(part)]
        elif last:
            place.pop(partner(part), None)  # the same speed in the other unit
            place[part] = value
        else:
            place = place.setdefault(part, {})
        if not last and not isinstance(place, (dict, list)):
            rest = ".".join(parts[i + 1 :])
            cure = f"name that key, or write all of it as a table, {part} = {{ ..., {rest} = ... }}"
            raise InputError(field, None, f"{part} is the value {place!r} in the job, not a table", cure)


@functools.cache
def type_hints(cls: Any) -> dict[str, Any]:
    """Types of a table's fields (evaluated once: that takes longer than reading a table); a choice is a text."""
    hints = typing.get_type_hints(cls)
    return {name: str if typing.get_origin(hint) is typing.Literal else hint for name, hint in hints.items()}


def fields_of(table: type) -> dict[str, dataclasses.Field[Any]]:
    """Fields of a dataclass by name."""
    return {field.name: field for field in dataclasses.fields(typing.cast(Any, table))}


def build(cls: type[T], table: Any, where: str, *, rules: bool = True) -> T:
    """Frozen dataclass `cls` from a parsed TOML table; `where` is the table's name for messages.

    Understands ``int``, ``float``, ``bool``, ``str``, ``X | None``, ``tuple[X, ...]``, fixed tuples, ``dict[str, X]``,
    and nested dataclasses. A dataclass may define ``check(self, where)`` for rules that join several fields (not
    checked without `rules`). ``REMOVED`` maps each removed key to its replacement (see `Removed`). ``SHORT`` is the key
    whose value may replace the whole table as a text.

    Raises
    ------
    InputError
        Unknown key (with the nearest known one), missing key, wrong type, value out of range, a rule broken.
    """
    result = _built(cls, table, where)
    if rules:
        _check_rules(result, where)
    return result


def _built(cls: type[T], table: Any, where: str) -> T:
    """The same without the rules that join several fields."""
    fields, kind = fields_of(cls), typing.cast(Any, cls)
    if isinstance(table, str) and hasattr(cls, "SHORT"):
        table = {kind.SHORT: table}
    if not isinstance(table, dict):
        raise InputError(where, table, "must be a table of keys and values", f"write [{where}] and its keys below it")
    given, table = table, in_known_units(table, fields, where)
    hints = type_hints(kind)
    # what chooses among kinds first: a wrong kind brings keys of its own
    for name, spec in fields.items():
        if spec.metadata.get("choices") and name in table:
            _convert(hints[name], table[name], _joined(where, name), spec.metadata)
    for key in table:
        if key in getattr(cls, "REMOVED", ()):
            problem, cure = kind.REMOVED[key]
            raise InputError(_joined(where, key), table[key], problem, cure(table[key]) if callable(cure) else cure)
        if key not in fields:
            raise unknown_key(where, key, table[key], fields)
    values: dict[str, Any] = {}
    for name, spec in fields.items():
        label = _joined(where, name)
        if name in table:
            try:
                values[name] = _convert(hints[name], table[name], label, spec.metadata)
            except InputError as error:
                if name in given:
                    raise
                raise as_written(error, label, _joined(where, partner(name)), given[partner(name)]) from None
        elif spec.default is MISSING and spec.default_factory is MISSING:
            doc = spec.metadata.get("doc", "")
            raise InputError(label, None, "is required", f"add {_written(hints[name], label)} ({doc})")
    return cls(**values)


def _check_rules(made: Any, where: str) -> None:
    """Call ``check`` of the tables within a table, and then its own."""
    if isinstance(made, tuple):
        for i, item in enumerate(made):
            _check_rules(item, f"{where}[{i}]")
    elif isinstance(made, dict):
        for key, item in made.items():
            _check_rules(item, f"{where}.{key}")
    elif dataclasses.is_dataclass(made):
        for name in fields_of(type(made)):
            _check_rules(getattr(made, name), _joined(where, name))
        if hasattr(made, "check"):
            made.check(where)


def _written(hint: Any, label: str) -> str:
    """Return the TOML form of a missing key: a table, one of several, or like its neighbours."""
    inner = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else hint
    if not dataclasses.is_dataclass(inner):
        return "it"
    return f"[{label}]" if inner is hint else f"[[{label}]]"


def _joined(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name


def _convert(hint: Any, value: Any, label: str, meta: Any) -> Any:
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        options = [a for a in typing.get_args(hint) if a is not type(None)]
        # the option that is written like the value tells what is wrong with it
        options.sort(key=lambda option: not _written_like(option, value))
        problems: list[InputError] = []
        for option in options:
            try:
                return _convert(option, value, label, meta)
            except InputError as error:
                problems.append(error)
        raise problems[0]
    if origin is tuple:
        return _convert_tuple(hint, value, label, meta)
    if origin is dict:
        if not isinstance(value, dict):
            raise InputError(label, value, "must be a table", f"write [{label}]")
        inner = typing.get_args(hint)[1]
        return {key: _convert(inner, item, f"{label}.{key}", meta) for key, item in value.items()}
    if dataclasses.is_dataclass(hint):
        return _built(typing.cast(type, hint), value, label)
    if hint is Any:
        return value
    return _convert_scalar(hint, value, label, meta)


def _written_like(hint: Any, value: Any) -> bool:
    """Return whether a value of this kind is written in TOML like `value`: as list, table, text or number."""
    if isinstance(value, list):
        return typing.get_origin(hint) is tuple
    if isinstance(value, dict):
        return typing.get_origin(hint) is dict or dataclasses.is_dataclass(hint)
    return hint is str if isinstance(value, str) else hint in (int, float, bool)


def _convert_tuple(hint: Any, value: Any, label: str, meta: Any) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise InputError(label, value, "must be a list", "write [a, b, ...]")
    inner = typing.get_args(hint)
    if len(inner) == 2 and inner[1] is Ellipsis:
        return tuple(_convert(inner[0], item, f"{label}[{i}]", meta) for i, item in enumerate(value))
    if len(value) != len(inner):
        raise InputError(label, value, f"must have {len(inner)} entries", meta.get("doc", ""))
    return tuple(_convert(t, item, f"{label}[{i}]", meta) for i, (t, item) in enumerate(zip(inner, value, strict=True)))


def _convert_scalar(hint: Any, value: Any, label: str, meta: Any) -> Any:
    doc = meta.get("doc", "")
    if hint is bool or hint is str:
        if not isinstance(value, hint):
            kind = "true or false" if hint is bool else "a text in quotes"
            raise InputError(label, value, f"must be {kind}", doc)
        choices = meta.get("choices")
        if choices and value not in choices:
            problem = "must be one of " + ", ".join(choice or '""' for choice in choices)
            cure = (meta.get("gone") or {}).get(str(value))
            raise InputError(label, value, problem, cure or nearest(str(value), choices) or doc)
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(label, value, "must be a number", doc)
    if hint is int and not isinstance(value, int):
        raise InputError(label, value, "must be a whole number", doc)
    try:
        number = int(value) if hint is int else float(value)
    except OverflowError:  # a whole number beyond any float
        number = value
    check_range(number, label, meta)
    return number


def check_size(number: float, label: str, cure: str = "") -> None:
    """Raise `InputError` for numbers that are not finite or too large for any key, whole ones or others."""
    largest = LARGEST_WHOLE if isinstance(number, int) else LARGEST
    if not abs(number) <= largest:
        raise InputError(label, number, f"must be finite, of a size up to {largest:.3g}", cure)


def check_range(number: float, label: str, meta: Any) -> None:
    """Raise `InputError` when a number leaves the range that a field's metadata allow."""
    largest = LARGEST_WHOLE if isinstance(number, int) else LARGEST
    low, high, above, below = (meta.get(k) for k in ("low", "high", "above", "below"))
    outside = (
        abs(number) > largest
        or (isinstance(number, float) and not math.isfinite(number))
        or (low is not None and number < low)
        or (high is not None and number > high)
        or (above is not None and number <= above)
        or (below is not None and number >= below)
    )
    if outside:
        left = f">= {low:g}" if low is not None else f"> {above:g}" if above is not None else ""
        right = f"<= {high:g}" if high is not None else f"< {below:g}" if below is not None else ""
        size = (
            f"of a size up to {largest:.3g}" if largest < abs(number) < math.inf and not (right and number > 0) else ""
        )
        allowed = " and ".join(part for part in ("finite", left, right, size) if part)
        cure = other_unit(label.rpartition(".")[2], number) or meta.get("doc", "")
        raise InputError(label, number, f"must be {allowed}", cure)
