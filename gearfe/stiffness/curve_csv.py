"""The table of a stiffness curve: units of its columns, exact in both directions.

Numbers are scaled in decimal arithmetic, so 17 significant digits in the file's unit bring back the same double in SI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Context, Decimal
from pathlib import Path

import numpy as np

from ..errors import InputError, shown
from ..textfile import read_csv
from ..typing import Array

#: Far more digits than any double needs, so that a product is rounded once.
_EXACT = Context(prec=50)
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582")
#: Suffix of a column name -> factor from SI to that unit; other columns are in SI.
_FACTORS: dict[str, Decimal] = {
    "_deg": _EXACT.divide(Decimal(180), _PI),
    "_um": Decimal(10) ** 6,
    "_mm": Decimal(10) ** 3,
    "_MPa": Decimal(10) ** -6,
}


def factor_of(column: str) -> Decimal:
    """Factor from SI to the unit in a column's name."""
    return next((f for suffix, f in _FACTORS.items() if column.endswith(suffix)), Decimal(1))


def to_text(value: float, column: str) -> str:
    """Decimal text of an SI value in the column's unit: `from_text` gives the same double back."""
    if not np.isfinite(value):
        return "nan"
    exact = _EXACT.multiply(Decimal(float(value)), factor_of(column))
    short = _plain(Context(prec=15).plus(exact).normalize())  # where 15 digits are enough: 0.5 reads 0.5
    return short if from_text(short, column) == value else _plain(Context(prec=17).plus(exact))


def _plain(number: Decimal) -> str:
    """Without an exponent for numbers of everyday size."""
    return f"{number:f}" if -5 <= number.adjusted() < 17 else f"{number:e}"


def from_text(text: str, column: str) -> float:
    """SI value of a cell; an empty cell is not a number.

    Raises
    ------
    ValueError
        When the cell holds no number.
    """
    text = text.strip()
    if text.lower() in ("", "nan"):
        return float("nan")
    try:
        value = float(_EXACT.divide(Decimal(text), factor_of(column)))
    except (ArithmeticError, ValueError) as error:
        raise ValueError(text) from error
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def read_columns(path: str | Path) -> dict[str, list[str]]:
    """Columns of a CSV file as text, by name.

    Raises
    ------
    InputError
        When the file is missing, unreadable or not a rectangular table with a header.
    """
    return read_csv(path, "stiffness curve")


def numbers(columns: Mapping[str, Sequence[str]], name: str, path: str | Path) -> Array:
    """Column `name` in SI; all not-a-number where the file has no such column."""
    if name not in columns:
        return np.full(len(next(iter(columns.values()))), np.nan)
    try:
        return np.array([from_text(cell, name) for cell in columns[name]])
    except ValueError as error:
        problem = f"column {name} holds {shown(str(error))}, which is no finite number"
        raise InputError("stiffness curve", str(path), problem, "write a number, or leave the cell empty") from None
