"""A square matrix of a file: Matrix Market, matrices of Abaqus, DMIG entries, OUTPUT2 and OUTPUT4 of Nastran."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.files import read_text
from ...base.typing import Array
from .abaqus_matrix import is_substructure, read_entries, read_substructure
from .matrix_entries import Entries, Label, matrix_of
from .matrix_market import read_market
from .nastran_dmig import read_dmig
from .nastran_output import read_nastran


class Matrix(NamedTuple):
    """A square matrix, and node and degree of freedom of its rows where the file has them."""

    values: Array
    labels: list[Label]


def read_matrix(path: Path, field: str, initial: str = "K") -> Matrix:
    """Read a matrix, completed to both halves where the file has one of them.

    Parameters
    ----------
    path : Path
        The file.
    field : str
        Name of its key in messages.
    initial : str
        K for the stiffness, M for the mass: the type in a substructure of Abaqus. Of several matrices in a file of
        Nastran, the one whose name begins with this letter is taken.

    Raises
    ------
    InputError
        For files that cannot be read, and matrices that are not square or not finite.
    """
    if path.suffix.lower() in (".op2", ".op4"):
        return _whole(_chosen(read_nastran(path, field), path, field, initial), path, field)
    text = read_text(path, field, foreign=True)
    if text.lstrip().lower().startswith("%%matrixmarket"):
        return _whole(read_market(text, path, field), path, field)
    if is_substructure(text):
        values, labels = read_substructure(text, path, field, initial)
        return Matrix(_checked(values, path, field), labels)
    if re.search(r"^DMIG[ *,]", text, re.MULTILINE | re.IGNORECASE):
        return _whole(_chosen(read_dmig(text, path, field), path, field, initial), path, field)
    return _whole(read_entries(text, path, field), path, field)


def _whole(matrix: Array | Entries, path: Path, field: str) -> Matrix:
    """Both halves of a matrix given by values or by single entries."""
    if isinstance(matrix, dict):
        values, labels = matrix_of(matrix, path, field)
        return Matrix(_checked(values, path, field), labels)
    values = _checked(matrix, path, field)
    if not np.triu(values, 1).any() or not np.tril(values, -1).any():
        values = values + values.T - np.diag(np.diag(values))
    return Matrix(values, [])  # rows without names


def _chosen(found: Mapping[str, Array | Entries], path: Path, field: str, initial: str) -> Array | Entries:
    """The matrix of a file of Nastran whose name begins with `initial`, or the only one.

    Files of external superelements hold others beside it: vectors, rows for recovery, fillers of one row, and
    structural damping, K4.
    """
    square = {name: matrix for name, matrix in found.items() if _usable(matrix)}
    names = [n for n in square if len(square) == 1 or (n.startswith(initial) and not n.startswith("K4"))]
    if len(names) != 1:
        problem = f"has no single matrix whose name begins with {initial}: there are {', '.join(square) or 'none'}"
        raise InputError(field, path.name, problem, "leave one of them in the file, real and square")
    return square[names[0]]


def _usable(matrix: Array | Entries) -> bool:
    """Return whether a matrix has entries and, if it has no names, is square with more than one row."""
    return bool(matrix) if isinstance(matrix, dict) else 1 < len(matrix) == matrix.shape[1]


def _checked(values: Array, path: Path, field: str) -> Array:
    if values.ndim != 2 or values.shape[0] != values.shape[1] or not len(values):
        raise InputError(field, path.name, f"must be a square matrix, but has the shape {values.shape}", "transpose?")
    if not np.isfinite(values).all():
        i, j = np.argwhere(~np.isfinite(values))[0] + 1
        raise InputError(field, path.name, f"holds a number that is not finite, entry ({i}, {j})", "write it again")
    return values
