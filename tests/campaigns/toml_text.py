"""TOML text of nested plain data: job files of drawn cases."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any


def toml_text(tables: Mapping[str, Any], name: str = "") -> str:
    """Text of nested mappings: numbers, texts, lists, tables, and lists of tables; entries that are None are left
    out."""
    lines, below = [], []
    for key, value in tables.items():
        full = f"{name}.{_key(key)}" if name else _key(key)
        if value is None:
            continue
        if isinstance(value, Mapping):
            below.append(f"\n[{full}]\n" + toml_text(value, full))
        elif isinstance(value, (list, tuple)) and value and all(isinstance(v, Mapping) for v in value):
            below += [f"\n[[{full}]]\n" + toml_text(v, full) for v in value]
        else:
            lines.append(f"{_key(key)} = {_value(value)}\n")
    return "".join(lines + below)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)


def _value(value: Any) -> str:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    if isinstance(value, (int, float)):
        text = repr(value)
        return text if isinstance(value, int) or any(c in text for c in ".e") else text + ".0"
    return json.dumps(str(value), ensure_ascii=False)
