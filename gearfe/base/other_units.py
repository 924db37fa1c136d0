"""Speeds of job files in rad/s or 1/min: ``speed_rpm`` stands for ``speed_rad_per_s`` wherever a speed is read.

A key in the other unit becomes the known one before a table is read, functions of time included. Both at once
contradict each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from .errors import InputError

#: Ends of keys: radians per second, revolutions per minute; and rad/s of one revolution per minute.
RADIANS, TURNS = "_rad_per_s", "_rpm"
RPM = math.pi / 30.0
#: Parts of a function of time, and the key of each that has its unit.
_SCALED = ("constant", "expression", "polynomial", "step", "sine")
_PARTS = {"steps": "height", "sines": "amplitude"}


def partner(key: str) -> str:
    """The same key in the other unit; empty for keys that are no speeds."""
    for own, other in ((RADIANS, TURNS), (TURNS, RADIANS)):
        if key.endswith(own):
            return key[: -len(own)] + other
    return ""


def in_known_units(table: Mapping[str, Any], known: Iterable[str], where: str) -> dict[str, Any]:
    """Return a parsed table whose speeds have the keys that are known.

    Parameters
    ----------
    table : mapping
        Parsed table.
    known : iterable of str
        Its keys.
    where : str
        Its name in messages.

    Raises
    ------
    InputError
        For a speed that stands there in both units.
    """
    names, found = set(known), dict(table)
    for key, value in table.items():
        other = partner(key) if key not in names else ""
        if other not in names:
            continue
        label = f"{where}.{key}" if where else key
        if other in table:
            raise InputError(label, value, f"says what {other} says", "leave one out")
        found[other] = _times(RPM if key.endswith(TURNS) else 1.0 / RPM, found.pop(key), label)
    return found


def as_written(error: InputError, known: str, written: str, value: Any) -> InputError:
    """Return the error of a speed with the name and the value that the user wrote in the other unit.

    Parameters
    ----------
    error : InputError
        The error of the known name.
    known, written : str
        Both names.
    value : Any
        What was written.
    """
    numbers = all(isinstance(item, (int, float)) and not isinstance(item, bool) for item in (value, error.value))
    reason = f"{error.problem} ({known} = {error.value:.6g})" if numbers else error.problem
    inner = error.field.removeprefix(known) if error.field.startswith(known) else ""
    return InputError(written + inner, error.value if inner else value, reason, error.cure)


def _times(factor: float, value: Any, label: str) -> Any:
    """A number, a list of numbers, an expression, or a function of time, times a factor."""
    if isinstance(value, bool):
        return value
    if isinstance(value, (int, float)):
        return factor * value
    if isinstance(value, str):
        return f"({value})*{factor!r}"
    if isinstance(value, list):
        return [_times(factor, item, label) for item in value]
    if not isinstance(value, dict):
        return value
    for key in ("csv", "table"):
        if key in value:
            raise InputError(f"{label}.{key}", value[key], "has values in rad/s", f"write the key {partner(label)}")
    changed = {key: _times(factor, item, label) if key in _SCALED else item for key, item in value.items()}
    if isinstance(value.get("points_ms"), list):
        changed["points_ms"] = [
            [row[0], _times(factor, row[1], label)] if isinstance(row, list) and len(row) == 2 else row
            for row in value["points_ms"]
        ]
    for part, key in _PARTS.items():
        if isinstance(value.get(part), list):
            changed[part] = [
                {**item, key: _times(factor, item[key], label)} if isinstance(item, dict) and key in item else item
                for item in value[part]
            ]
    return changed
