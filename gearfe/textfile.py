"""Text files of the user: UTF-8, with or without its byte order mark; anything else is named."""

from __future__ import annotations

import codecs
import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .errors import InputError, unknown_name

#: More than any job file or table has (bytes).
LARGEST = 2**28
#: Byte order marks; the longer ones first, for those of UTF-32 begin like those of UTF-16.
_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


def read_text(path: str | Path, field: str) -> str:
    """Text of a file; `field` names it in messages.

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, or is no UTF-8 text.
    """
    try:
        with Path(path).open("rb") as stream:
            raw = stream.read(LARGEST + 1)
    except FileNotFoundError:
        raise InputError(field, str(path), "there is no such file", "check the path") from None
    except IsADirectoryError:
        raise InputError(field, str(path), "is a folder, not a file", "name a file in it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(field, str(path), f"cannot be read ({reason})", "check the path and its rights") from None
    if len(raw) > LARGEST:
        raise InputError(field, str(path), f"is larger than {LARGEST >> 20} MB", "is it the right file?")
    encoding = next((name for mark, name in _MARKS.items() if raw.startswith(mark)), "")
    if encoding:
        raise InputError(field, str(path), f"is written in {encoding}", "save it as UTF-8")
    if b"\0" in raw:
        raise InputError(field, str(path), "is no text: it has bytes of zero", "name a text file, or save it as UTF-8")
    try:
        return raw.removeprefix(codecs.BOM_UTF8).decode()
    except UnicodeDecodeError as error:
        raise InputError(field, str(path), *_encoding_problem(raw, error.start)) from None


def _encoding_problem(raw: bytes, at: int) -> tuple[str, str]:
    """What bytes that are no UTF-8 are, and the cure; the first wrong one stands at `at`."""
    line = raw.count(b"\n", 0, at) + 1
    # Latin-1 has control characters where Windows-1252 has letters and quotes
    name, codec = ("Windows-1252", "cp1252") if any(0x80 <= byte < 0xA0 for byte in raw) else ("Latin-1", "latin-1")
    letter = raw[at : at + 1].decode(codec, "replace")
    return f"is not UTF-8 but, it seems, {name}: line {line} has {letter!r} as byte {raw[at]:#x}", "save it as UTF-8"


def _rows(path: str | Path, field: str) -> list[list[str]]:
    """Cells of a CSV file; semicolons or tabs between them, as spreadsheets of some countries write, are an error."""
    rows = list(csv.reader(io.StringIO(read_text(path, field))))
    if rows and len(rows[0]) == 1 and any(mark in rows[0][0] for mark in ";\t"):
        cure = "write commas between cells and points in numbers"
        raise InputError(field, str(path), "has other marks than commas between its cells", cure)
    return rows


def read_csv(path: str | Path, field: str) -> dict[str, list[str]]:
    """Columns of a CSV file as text, by name; `field` names the file in messages.

    Raises
    ------
    InputError
        When the file is missing, unreadable or not a rectangular table with a header.
    """
    rows = [row for row in _rows(path, field) if row]
    if len(rows) < 2:
        raise InputError(field, str(path), "has no rows", "give a CSV file with a header line and rows")
    names = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            problem = f"line {number} has {len(row)} cells, the header {len(names)}"
            raise InputError(field, str(path), problem, "mend that line")
    return {name: [row[i] for row in rows[1:]] for i, name in enumerate(names)}


def read_numbers(
    path: Path, field: str, needed: Sequence[str], optional: Sequence[str] = (), *, others: bool = True
) -> dict[str, Any]:
    """Columns of finite numbers of a CSV file as arrays, by name; `others`: whether further columns are allowed.

    Raises
    ------
    InputError
        When the file is missing or unreadable, a column is missing or unknown, a cell holds no finite number.
    """
    import numpy as np  # job files are read without it

    rows = _rows(path, field)
    header, known = [name.strip() for name in rows[0]] if rows else [], (*needed, *optional)
    for name in () if others else header:
        if name not in known:
            raise unknown_name(f"{field} {path.name}, column", name, known)
    for name in needed:
        if name not in header:
            raise InputError(field, path.name, f"has no column {name}", "its first line names the columns")
    body = [row for row in rows[1:] if any(cell.strip() for cell in row)]
    place = {name: i for i, name in enumerate(header) if name in known}
    made = np.empty((len(body), len(place)))
    for number, row in enumerate(body):
        try:
            made[number] = [float(row[i]) for i in place.values()]
        except (ValueError, IndexError):
            made[number] = np.nan
        if len(row) != len(header) or not np.isfinite(made[number]).all():
            problem = f"row {number + 1} must have {len(header)} numbers, all finite"
            raise InputError(field, path.name, problem, "mend that row")
    return dict(zip(place, made.T, strict=True))
