"""Matrices given by single entries, with node and degree of freedom of their rows and columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array

#: Node and degree of freedom; scalar points of Nastran have freedom 0.
Label = tuple[int, int]
#: Values by row and column.
Entries = dict[tuple[Label, Label], float]

#: Rows up to which a matrix is taken for that of a reduced body: 200 MB.
MOST_ROWS = 5000


def add_entry(entries: Entries, row: Label, column: Label, value: float) -> None:
    """Add an entry of a matrix.

    Parameters
    ----------
    entries : dict
        Entries by row and column; changed.
    row, column : Label
        Labels of the entry's row and column.
    value : float
        Its value.

    Raises
    ------
    ValueError
        If the entry has another value already.
    """
    held = entries.setdefault((row, column), value)
    if held != value and not (np.isnan(held) and np.isnan(value)):
        raise ValueError(f"the entry of {shown(row)} and {shown(column)} was {held:.6g} before and is {value:.6g} here")


def matrix_of(entries: Entries, path: Path, field: str) -> tuple[Array, list[Label]]:
    """The matrix, both halves of it where the file has one, and the labels of its rows in rising order.

    Raises
    ------
    InputError
        For more rows than a reduced body has.
    """
    labels = sorted({label for both in entries for label in both})
    check_rows(len(labels), path, field)
    place = {label: i for i, label in enumerate(labels)}
    values = np.zeros((len(labels), len(labels)))
    for (one, other), value in entries.items():
        values[place[one], place[other]] = value
        if (other, one) not in entries:
            values[place[other], place[one]] = value
    return values, labels


def check_rows(count: int, path: Path, field: str) -> None:
    """Raise `InputError` for more rows than a reduced body has."""
    if count > MOST_ROWS:
        problem = f"has {count} rows; a reduced body has {MOST_ROWS} at most"
        cure = "the file may be damaged; else condense the matrix to its attachments and modes"
        raise InputError(field, path.name, problem, cure)


def shown(label: Label) -> str:
    """A row for messages."""
    return f"node {label[0]} freedom {label[1]}"
