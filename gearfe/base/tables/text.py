"""Commented job files, made from the tables' own descriptions, so that they never fall behind them."""

from __future__ import annotations

import dataclasses
import json
import re
import textwrap
import types
import typing
from collections.abc import Mapping
from typing import Any

from ..config import type_hints

#: Columns of a line before its comment is put above it.
_WIDTH, _COMMENT = 118, 40


def table_text(
    cls: type, example: Mapping[str, Any], name: str = "", *, brief: bool = False, seen: set[type] | None = None
) -> str:
    """TOML of a table: keys of `example` as they are, all others as comments with their defaults, each explained.

    A commented key is valid TOML without its ``#``, and means what holds without it.

    Parameters
    ----------
    cls
        Dataclass of the table, its fields made with `gearfe.base.config.quantity`.
    example
        Key -> value; nested tables are mappings, lists of tables are lists of mappings.
    name
        Of the table; empty for the top of a file.
    brief
        Leave out the keys that are not in the example.
    seen
        Tables that were explained in full before: they are brief.
    """
    seen = set() if seen is None else seen
    brief = brief or cls in seen
    seen.add(cls)
    hints = type_hints(cls)
    own, below = [f"[{name}]"] if name else [], []
    for field in dataclasses.fields(cls):
        inner, many = inner_table(hints[field.name])
        full = f"{name.strip('[]')}.{field.name}".lstrip(".")
        doc = field.metadata.get("doc", "")
        given = example.get(field.name)
        if inner is None and isinstance(given, Mapping):
            lines = [f"{_key(key)} = {toml_value(value)}" for key, value in given.items()]
            head = f"[{full}] # {doc}" if len(full) + len(doc) < _WIDTH - 4 else f"{_wrapped(doc)}[{full}]"
            below.append("\n".join([head, *lines, ""]))
        elif inner is None:
            line = _line(field, example, doc, brief)
            if line:
                own.append(line)
        elif field.name not in example:
            if not brief:
                keys = ", ".join(f.name for f in dataclasses.fields(inner))
                header = {"list": f"[[{full}]]", "dict": f"[{full}.NAME]", "": f"[{full}]"}[many]
                below.append(_wrapped(f"{header}: optional. Keys: {keys}"))
        else:
            below += _nested(inner, many, example[field.name], full, doc, brief, seen)
    text = "\n".join(own) + "\n" if len(own) > bool(name) or not below else ""
    return "\n".join([text, *below] if text else below)


def _nested(inner: type, many: str, given: Any, full: str, doc: str, brief: bool, seen: set[type]) -> list[str]:
    if many == "list":
        return [table_text(inner, item, f"[{full}]", brief=brief, seen=seen) for item in given]
    if many == "dict":
        items = given.items()
        return [table_text(inner, item, f"{full}.{_key(key)}", brief=brief, seen=seen) for key, item in items]
    remark = "" if brief or not doc or doc.startswith("[") else _wrapped(doc)
    return [remark + table_text(inner, given, full, brief=brief, seen=seen)]


def _line(field: Any, example: Mapping[str, Any], doc: str, brief: bool) -> str:
    choices = field.metadata.get("choices")
    if choices and not all(choice in doc for choice in choices):
        doc += " (" + ", ".join(choices) + ")"
    if field.name in example:
        code = f"{field.name} = {toml_value(example[field.name])}"
    elif brief:
        return ""
    else:
        default = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        if default is None:  # TOML has no word for it: the key is named, but nothing stands there to be switched on
            return _wrapped(f"{field.name} (not set): {doc}").rstrip("\n")
        code = f"# {field.name} = {toml_value(default)}"
    line = f"{code:<{_COMMENT}} # {doc}" if doc else code
    return line if len(line) <= _WIDTH else _wrapped(doc) + code


def inner_table(hint: Any) -> tuple[type | None, str]:
    """Dataclass that a field holds, if it does, and whether as a ``list`` or a ``dict``."""
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        found = [inner_table(option) for option in inside if option is not type(None)]
        return (None, "") if any(inner is None for inner, _ in found) else found[0]
    if origin is tuple and len(inside) == 2 and inside[1] is Ellipsis:
        return _table(inside[0]), "list"
    if origin is dict:
        return _table(inside[1]), "dict"
    return _table(hint), ""


def _table(hint: Any) -> type | None:
    return hint if isinstance(hint, type) and dataclasses.is_dataclass(hint) else None


def toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return (
            "{ " + ", ".join(f"{_key(key)} = {toml_value(item)}" for key, item in value.items()) + " }"
            if value
            else "{}"
        )
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return toml_value({f.name: v for f in dataclasses.fields(value) if (v := getattr(value, f.name)) is not None})
    return repr(value)


def _key(name: str) -> str:
    """Bare where TOML allows it."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def _wrapped(text: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent="# ", subsequent_indent="# ") + "\n"


def toml_document(tables: Mapping[str, Any], name: str = "") -> str:
    """TOML of parsed tables: plain keys first, then tables and lists of tables below their names."""
    plain, below = [], []
    for key, value in tables.items():
        full = f"{name}.{_key(key)}".lstrip(".")
        if isinstance(value, Mapping):
            below.append(f"[{full}]\n{toml_document(value, full)}")
        elif isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
            below += [f"[[{full}]]\n{toml_document(item, full)}" for item in value]
        else:
            plain.append(f"{_key(key)} = {toml_value(value)}")
    return "\n".join([*("\n".join([*plain, ""]) for _ in plain[:1]), *below])
