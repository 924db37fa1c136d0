"""Records of arrays whose first axis counts the same things: some of these, or several records one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

Record = TypeVar("Record")


def taken(record: Record, index: Any) -> Record:
    """The entries `index` of every array, of records within the record likewise; None stays."""
    made: dict[str, Any] = {}
    for field in fields(record):  # type: ignore[arg-type]
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray):
            made[field.name] = value[index]
        else:
            made[field.name] = None if value is None else taken(value, index)
    return type(record)(**made)


def joined(parts: Sequence[Record]) -> Record:
    """Records of one kind put one after the other."""
    made: dict[str, Any] = {}
    for field in fields(parts[0]):  # type: ignore[arg-type]
        values = [getattr(part, field.name) for part in parts]
        if isinstance(values[0], np.ndarray):
            made[field.name] = np.concatenate(values)
        else:
            made[field.name] = None if values[0] is None else joined(values)
    return type(parts[0])(**made)
