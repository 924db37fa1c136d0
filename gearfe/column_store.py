"""A table that grows by rows and is read by columns, in memory while it is small, else in a temporary file."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from .typing import Array

#: Bytes up to which the table stays in memory.
IN_MEMORY = 32 << 20


class ColumnStore:
    """Rows of `columns` numbers, appended block by block; the file, in `folder`, goes away with the object."""

    def __init__(self, columns: int, folder: Path | None = None) -> None:
        self.columns = columns
        self._blocks: list[int] = []
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY, dir=None if folder is None else str(folder))  # noqa: SIM115 (lives as long as the table)

    def append(self, rows: Array) -> None:
        """Add a block of rows, (n, columns)."""
        if len(rows):
            self._blocks.append(len(rows))
            self._file.write(np.ascontiguousarray(rows.T).tobytes())

    def column(self, number: int) -> Array:
        """(rows,) a whole column."""
        parts, begin = [], 0
        for count in self._blocks:
            self._file.seek(8 * (begin + number * count))
            parts.append(np.frombuffer(self._file.read(8 * count)))
            begin += count * self.columns
        self._file.seek(0, 2)
        return np.concatenate(parts) if parts else np.zeros(0)
