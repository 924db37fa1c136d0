"""Records of arrays whose first axis counts the same things: some of these, or several records one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from ..typing import IntArray

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
    if len(parts) == 1:
        return parts[0]
    made: dict[str, Any] = {}
    for field in fields(parts[0]):  # type: ignore[arg-type]
        values = [getattr(part, field.name) for part in parts]
        if isinstance(values[0], np.ndarray):
            made[field.name] = np.concatenate(values)
        else:
            made[field.name] = None if values[0] is None else joined(values)
    return type(parts[0])(**made)


def of_positions(record: Record, chosen: IntArray) -> Record:
    """The entries of the positions `chosen`, numbered in their order; the record's are sorted by `position`."""
    position: IntArray = record.position  # type: ignore[attr-defined]
    first, end = (np.searchsorted(position, chosen, side=side) for side in ("left", "right"))
    made: Any = taken(record, ranges(first, end - first))
    return replace(made, position=np.repeat(np.arange(len(chosen)), end - first))


def ranges(starts: IntArray, lengths: IntArray) -> IntArray:
    """All of start, start + 1, ..., start + length - 1, one after the other."""
    ends = np.cumsum(lengths)
    return np.repeat(starts - ends + lengths, lengths) + np.arange(ends[-1] if len(ends) else 0)
