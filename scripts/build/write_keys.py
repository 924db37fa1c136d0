#!/usr/bin/env python3
"""Write docs/keys.md, the reference page of all keys of the job files, from the tables' own descriptions."""

from __future__ import annotations

import dataclasses
import types
import typing
from pathlib import Path
from typing import Any

from gearfe.base.config import type_hints
from gearfe.base.tables.bearing import BearingTable
from gearfe.base.tables.jobs import NAMED, TABLES, table_class
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.base.tables.pair import GearBodyTable, ToothFormTable
from gearfe.base.tables.text import inner_table, toml_value
from gearfe.base.tables.train import ShaftTable, TrainMeshTable

PAGE = Path(__file__).resolve().parents[2] / "docs" / "keys.md"
HEAD = """# Keys of the job files

This page lists every key of every job file with its range, default and unit. A key whose default is *required* must be
given; where it is -, it may be left out. Error messages, `gearfe new` and the options of the commands use the same
descriptions (`gearfe/base/tables/`, written by `python scripts/build/write_keys.py`).
"""


#: Classes whose keys several tables have -> what their section is called.
SHARED: dict[type, str] = {
    ToothFormTable: "Tooth form",
    GearBodyTable: "Gear",
    TrainMeshTable: "Mesh",
    ShaftTable: "Shaft",
    BearingTable: "Bearing",
}


def reference_page() -> str:
    """Markdown of all tables, each nested one below the one that holds it, each key once."""
    parts = [HEAD, "## Keys of several tables\n"]
    seen: dict[type, str] = {}
    for table, title in SHARED.items():
        parts += [f"### {title}\n", *_sections(table, title, seen)]
    top = seen | {table_class(name): name for name in TABLES}
    for kind in NAMED:
        parts.append(f"## `[{kind}.NAME]`\n")
        parts += _sections(table_class(kind), f"{kind}.NAME", top)
    for name in TABLES:
        parts.append(f"## `[{name}]`\n")
        parts += _sections(table_class(name), name, dict(top))
    parts.append("## Mechanism files\n")
    parts += _sections(MechanismFile, "", {})
    return "\n".join(parts).rstrip("\n") + "\n"


def _sections(table: type, name: str, seen: dict[type, str]) -> list[str]:
    """The table's keys, then its nested tables; one that was described before is named only, and so are its keys."""
    known = next((base for base in table.__mro__[1:] if base in seen), None)
    inherited = set() if known is None else {field.name for field in dataclasses.fields(known)}
    seen[table] = name
    hints = type_hints(table)
    rows: list[str] = []
    below: list[str] = []
    for field in dataclasses.fields(table):
        if field.name in inherited:
            continue
        inner, many = inner_table(hints[field.name])
        full = f"{name}.{field.name}".lstrip(".")
        title = {"list": f"[[{full}]]", "dict": f"[{full}.NAME]", "": f"[{full}]"}[many]
        if inner is None:
            rows.append(_row(field, hints[field.name]))
        elif inner in seen:
            rows.append(f"| `{title}` | table | - | {_same(field.metadata['doc'], seen[inner])} |")
        else:
            doc = field.metadata["doc"]
            below += [f"### `{title}`\n", f"{doc[:1].upper()}{doc[1:]}.\n" if not doc.startswith("[") else ""]
            below += _sections(inner, full if many != "dict" else f"{full}.NAME", seen)
    keys = [] if known is None else [f"All keys of {_place(seen[known])}{', and:' if rows else '.'}\n"]
    head = ["| key | value | default | meaning |", "|---|---|---|---|"]
    return [*keys, *((*head, *rows, "") if rows else ()), *below]


def _place(name: str) -> str:
    return f"[{name}](#{name.lower().replace(' ', '-')})" if name in SHARED.values() else f"`[{name}]`"


def _same(doc: str, other: str) -> str:
    """What is said of a table whose keys are those of another."""
    keys = f"keys as in {_place(other)}"
    return keys if doc.startswith("[") else f"{_cell(doc)}: {keys}"


def _row(field: Any, hint: Any) -> str:
    known = field.metadata
    if field.default is not dataclasses.MISSING:
        default = "-" if field.default is None else f"`{toml_value(field.default)}`"
    elif field.default_factory is not dataclasses.MISSING:
        default = f"`{toml_value(field.default_factory())}`"
    else:
        default = "*required*"
    return f"| `{field.name}` | {_cell(_value(hint, known))} | {_cell(default)} | {_cell(known['doc'])} |"


def _value(hint: Any, known: Any) -> str:
    """Kind of value with its range or choices."""
    if known["choices"]:
        choices = ", ".join(f'`"{choice}"`' for choice in known["choices"])
        kinds = [kind for kind in _kind(hint).split(" or ") if kind != "text"]  # a number, or a list of the choices
        return "".join(f"{kind} of " if kind.startswith("list") else f"{kind} or " for kind in kinds) + choices
    low, high, above, below = (known[k] for k in ("low", "high", "above", "below"))
    bounds = [f">= {low:g}"] if low is not None else [f"> {above:g}"] if above is not None else []
    bounds += [f"<= {high:g}"] if high is not None else [f"< {below:g}"] if below is not None else []
    return " ".join([_kind(hint), ", ".join(bounds)]).strip()


def _kind(hint: Any) -> str:
    plain = {int: "whole number", float: "number", bool: "true or false", str: "text", Any: "value"}
    if hint in plain:
        return plain[hint]
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(_kind(option) for option in inside if option is not type(None)))
    if origin is tuple:
        return "list" if inside[-1:] == (Ellipsis,) else f"list of {len(inside)}"
    return "table"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(reference_page(), encoding="utf-8", newline="\n")
    print(f"written: {PAGE}")
