"""Values from CSV tables: straight lines or monotone cubics between the points, nothing beyond them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.files import csv_records, read_text
from ..base.tables.mechanism import ValueTableTable
from ..base.typing import Array
from ..multibody import TimeFunction
from ..multibody.series.tape import Tape


@dataclass(frozen=True, eq=False)
class ValueTable:
    """y over x.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Points, x rising.
    kind
        "cubic": monotone cubics (Fritsch & Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304); "linear";
        "periodic": a cubic spline that continues beyond its ends, for which the last y is the first.
    """

    x: Array
    y: Array
    kind: str = "cubic"

    def covers(self, x: Any) -> Any:
        """Return whether the table has a value there."""
        return (self.kind == "periodic") | ((self.x[0] <= x) & (x <= self.x[-1]))

    @cached_property
    def _pieces(self) -> Array:
        """Coefficients of powers of x - x_k, highest first, shape (4, n - 1)."""
        if self.kind != "linear" and len(self.x) > 2:
            from scipy.interpolate import CubicSpline, PchipInterpolator

            if self.kind == "periodic":
                return np.asarray(CubicSpline(self.x, self.y, bc_type="periodic").c, dtype=float)
            return np.asarray(PchipInterpolator(self.x, self.y).c, dtype=float)
        slopes = np.diff(self.y) / np.diff(self.x)
        zero = np.zeros_like(slopes)
        return np.stack([zero, zero, slopes, self.y[:-1]])

    @property
    def pieces(self) -> Array:
        """Coefficients of powers of x - x_k, highest first, shape (n - 1, 4)."""
        return self._pieces.T

    @property
    def period(self) -> float:
        """Return the period, 0 for none."""
        return float(self.x[-1] - self.x[0]) if self.kind == "periodic" else 0.0

    def write(self, tape: Tape, coordinate: int) -> int:
        """Variable of a tape that is the table of a coordinate."""
        return tape.curve(coordinate, self.x, self.pieces, self.period)

    def over_time(self) -> TimeFunction:
        """The table as a function of time: pieces that every method differentiates exactly, and that end steps."""
        starts = (-math.inf, *(float(t) for t in self.x[1:-1]))
        rows = tuple(tuple(float(c) for c in row[::-1]) for row in self._pieces.T)
        return TimeFunction(starts, tuple(float(t) for t in self.x[:-1]), rows)

    def _at(self, x: Any) -> tuple[Any, Any]:
        """Distances from the knots below, and numbers of the pieces."""
        if self.kind == "periodic":
            x = self.x[0] + (x - self.x[0]) % self.period
        k = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        return x - self.x[k], k

    def __call__(self, x: Array) -> Array:
        """y at x, NaN beyond the table."""
        return np.where(self.covers(x), self.value(x), np.nan)

    def value(self, x: Array) -> Any:
        """y at x."""
        h, k = self._at(x)
        c = self._pieces[:, k]
        return ((c[0] * h + c[1]) * h + c[2]) * h + c[3]


def read_table(name: str, table: ValueTableTable, folder: Path) -> ValueTable:
    """Columns of a CSV file as a table.

    Raises
    ------
    InputError
        When a column is missing, holds no numbers, or does not rise.
    """
    label, source = f"tables.{name}", folder / table.file
    lines = [line for line in read_text(source, f"{label}.file").splitlines() if line.strip() and line[:1] != "#"]
    rows = csv_records("\n".join(lines), source, f"{label}.file")
    columns = []
    for key in ("x", "y"):
        column = getattr(table, key)
        if not rows or column not in rows[0]:
            known = ", ".join(rows[0]) if rows else "none"
            raise InputError(f"{label}.{key}", column, f"is no column of {source.name} (it has {known})", "name one")
        try:
            columns.append(np.array([float(row[column]) for row in rows]))
        except (TypeError, ValueError) as error:
            problem = f"is no column of numbers in {source.name} ({error})"
            raise InputError(f"{label}.{key}", column, problem, "correct the file") from None
    x, y = columns
    if len(x) < 2 or not np.isfinite([x, y]).all():
        raise InputError(f"{label}.file", str(source), "needs two rows or more, all finite", "correct the file")
    if not (np.diff(x) > 0.0).all():
        raise InputError(f"{label}.x", table.x, "must rise from row to row", "sort the rows and drop doubles")
    if table.interpolation == "periodic" and not (len(x) > 2 and abs(y[-1] - y[0]) <= 1e-9 * np.ptp(y)):
        raise InputError(f"{label}.y", table.y, "must end with its first value", "close the period")
    if table.interpolation == "periodic":
        y[-1] = y[0]
    return ValueTable(x, y, table.interpolation)
