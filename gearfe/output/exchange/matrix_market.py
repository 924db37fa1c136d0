"""Read matrices in Matrix Market format (Boisvert, Pozo & Remington, NISTIR 5935, 1996).

SciPy's compiled reader is not used. It writes beyond its memory if a file of the kind ``array`` holds more numbers than
its size line says, and adds up entries that are given twice.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.files import whole_file
from ...base.typing import Array
from .matrix_entries import check_rows

_WHOLE = "the file may be cut short or damaged: write it again"


def read_market(text: str, path: Path, field: str) -> Array:
    """The matrix of a text; of a symmetric one both halves.

    Raises
    ------
    InputError
        When the text is none, has another number of entries than its size line, gives one twice, or is complex.
    """
    lines = text.splitlines()
    words = lines[0].lower().split() if lines else []
    layout, numbers, symmetry = (*words[2:5], "", "", "")[:3]
    if "complex" in words or "hermitian" in words:
        raise InputError(field, path.name, "is complex", "bring a real matrix; damping is [housing.damping]")
    if (
        words[1:2] != ["matrix"]
        or layout not in ("coordinate", "array")
        or numbers not in ("real", "integer", "double")
    ):
        problem = f"cannot be read as Matrix Market: its first line is {lines[0][:80]!r}" if lines else "is empty"
        raise InputError(field, path.name, problem, "write: %%MatrixMarket matrix coordinate real symmetric")
    if symmetry not in ("general", "symmetric"):
        cure = "bring stiffness and mass of an elastic body: general or symmetric"
        raise InputError(field, path.name, f"is {symmetry or 'without a symmetry'}", cure)
    body = [(i, line.split()) for i, line in enumerate(lines[1:], start=2) if line.strip() and line.strip()[0] != "%"]
    at = 1
    try:
        at, size = body[0] if body else (len(lines), [])
        rows, columns, *count = (int(word) for word in size)
        if len(count) != (layout == "coordinate") or min(rows, columns, *count) < 0:
            raise ValueError("no size line")
        check_rows(max(rows, columns), path, field)
        values, given = np.zeros((rows, columns)), np.zeros((rows, columns), dtype=bool)
        if layout == "array":
            flat = [float(word) for at, cells in body[1:] for word in cells]
            chosen = np.tril(np.ones((rows, columns), dtype=bool)) if symmetry == "symmetric" else ~given
            along, down = np.nonzero(chosen.T)  # column by column
            if len(flat) != len(down):
                problem = f"has {len(flat)} numbers, its size line asks for {len(down)}"
                raise InputError(field, path.name, problem, _WHOLE)
            values[down, along] = flat
        else:
            if len(body) - 1 != count[0]:
                problem = f"has {len(body) - 1} entries, its size line says {count[0]}"
                raise InputError(field, path.name, problem, _WHOLE)
            for number, cells in body[1:]:
                at = number
                row, column, value = cells
                i, j = int(row) - 1, int(column) - 1
                if not (0 <= i < rows and 0 <= j < columns):
                    raise ValueError(f"there is no entry ({row}, {column})")
                if given[i, j] or (symmetry == "symmetric" and given[j, i]):
                    raise ValueError(f"the entry ({row}, {column}) or its mirror image is given twice")
                given[i, j], values[i, j] = True, float(value)
    except InputError:
        raise
    except (ValueError, OverflowError) as error:
        problem = f"cannot be read as Matrix Market, line {at}: {error}"
        raise InputError(field, path.name, problem, _WHOLE) from None
    if symmetry == "symmetric" and rows == columns:
        mirrored = values.T.copy()
        np.fill_diagonal(mirrored, 0.0)
        values = values + mirrored
    return values


def write_market(path: Path, matrix: Array) -> None:
    """Write a symmetric matrix; `read_market` gives back every number exactly."""
    from scipy.io import mmwrite

    with whole_file(path) as temporary:
        mmwrite(str(temporary), matrix, symmetry="symmetric", precision=17)
