"""Files: text and tables of the user, every mistake named, and those that are written, whole or not at all.

Text is UTF-8, with or without its byte order mark. What is written gets a temporary name beside the target and is
renamed when it is complete.
"""

from __future__ import annotations

import codecs
import csv
import filecmp
import io
import json
import os
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import InputError, NotFiniteWarning, unknown_name

#: More than any job file or table has (bytes).
LARGEST = 2**28
#: Byte order marks; the longer ones first, for those of UTF-32 begin like those of UTF-16.
_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
#: Name -> values, a sequence or an array.
Columns = Mapping[str, Any]
#: Name of temporary folders, and the age (s) at which one must be a leftover.
WRITING, LEFTOVER_S = ".writing-", 86400.0
#: Rows of a table that are text at a time.
AT_ONCE = 4096
#: The summary of a run, and those that are made from its other files after it.
SUMMARY, KEPT_LATER = "summary.json", ("report.html", "tables.npz", "tables.h5", "tables.mat", "tables.uff")


@dataclass(frozen=True)
class Written:
    """Names of the files that a run wrote to a folder, and of those of an earlier run that it removed."""

    folder: Path
    names: tuple[str, ...]
    removed: tuple[str, ...] = ()


_records: list[list[Written]] = []


def read_text(path: str | Path, field: str, *, foreign: bool = False) -> str:
    """Text of a file; `field` names it in messages.

    Text of another program (`foreign`) may be Windows-1252 or Latin-1, as comments of older pre-processors are.

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, or is no UTF-8 text.
    """
    raw = read_bytes(path, field)
    encoding = next((name for mark, name in _MARKS.items() if raw.startswith(mark)), "")
    if encoding:
        raise InputError(field, str(path), f"is written in {encoding}", "save it as UTF-8")
    if b"\0" in raw:
        raise InputError(field, str(path), "is no text: it has bytes of zero", "name a text file, or save it as UTF-8")
    try:
        return raw.removeprefix(codecs.BOM_UTF8).decode()
    except UnicodeDecodeError as error:
        if foreign:
            return raw.decode(_single_bytes(raw)[1], "replace")
        raise InputError(field, str(path), *_encoding_problem(raw, error.start)) from None


def read_bytes(path: str | Path, field: str, largest: int = LARGEST) -> bytes:
    """Content of a file of at most `largest` bytes; `field` names it in messages.

    Raises
    ------
    InputError
        When there is no such file, or it cannot be read.
    """
    try:
        with Path(path).open("rb") as stream:
            raw = stream.read(largest + 1)
    except FileNotFoundError:
        raise InputError(field, str(path), "there is no such file", "check the path") from None
    except IsADirectoryError:
        raise InputError(field, str(path), "is a folder, not a file", "name a file in it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(field, str(path), f"cannot be read ({reason})", "check the path and its rights") from None
    if len(raw) > largest:
        raise InputError(field, str(path), f"is larger than {largest >> 20} MB", "is it the right file?")
    return raw


def _single_bytes(raw: bytes) -> tuple[str, str]:
    """Return the name and codec of text with one byte a character.

    Latin-1 has control characters where Windows-1252 has letters and quotes.
    """
    return ("Windows-1252", "cp1252") if any(0x80 <= byte < 0xA0 for byte in raw) else ("Latin-1", "latin-1")


def _encoding_problem(raw: bytes, at: int) -> tuple[str, str]:
    """Describe bytes that are not UTF-8, with the cure; the first wrong byte is at `at`."""
    line = raw.count(b"\n", 0, at) + 1
    name, codec = _single_bytes(raw)
    letter = raw[at : at + 1].decode(codec, "replace")
    return f"is not UTF-8 but, it seems, {name}: line {line} has {letter!r} as byte {raw[at]:#x}", "save it as UTF-8"


def csv_rows(text: str, path: str | Path, field: str) -> list[list[str]]:
    """Rows of the text of a CSV file, whatever its lines end with.

    Raises
    ------
    InputError
        For a text that is no table.
    """
    try:
        return list(csv.reader(io.StringIO(text, newline="")))
    except csv.Error as error:
        raise InputError(
            field, str(path), f"is no table ({error})", "write rows of cells with commas between"
        ) from None


def csv_records(text: str, path: str | Path, field: str) -> list[dict[str, str]]:
    """Rows of `csv_rows` below the header as cells by column; missing ones are empty."""
    header, *body = [row for row in csv_rows(text, path, field) if row] or [[]]
    return [dict(zip(header, (*row, *[""] * len(header)), strict=False)) for row in body]


def _check_header(names: Sequence[str], path: str | Path, field: str) -> None:
    """Raise `InputError` for two columns of one name."""
    twice = next((name for i, name in enumerate(names) if name and name in names[:i]), None)
    if twice is not None:
        raise InputError(field, str(path), f"has two columns {twice}", "rename one, or leave it out")


def _rows(path: str | Path, field: str) -> list[list[str]]:
    """Cells of a CSV file; semicolons or tabs between them, as spreadsheets of some countries write, are an error."""
    rows = csv_rows(read_text(path, field), path, field)
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
    _check_header(names, path, field)
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            problem = f"line {number} has {len(row)} cells, the header {len(names)}"
            raise InputError(field, str(path), problem, "correct that line")
    return {name: [row[i] for row in rows[1:]] for i, name in enumerate(names)}


def read_numbers(
    path: Path, field: str, needed: Sequence[str], optional: Sequence[str] = (), *, others: bool = True
) -> dict[str, Any]:
    """Read columns of finite numbers of a CSV file as arrays, by name.

    Parameters
    ----------
    path : Path
        The file.
    field : str
        Key that names it, for messages.
    needed : sequence of str
        Columns that must be there.
    optional : sequence of str
        Columns that are read if they are there.
    others : bool
        Whether further columns are allowed.

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
    _check_header([name for name in header if name in known], path, field)
    body = [row for row in rows[1:] if any(cell.strip() for cell in row)]
    place = {name: i for i, name in enumerate(header) if name in known}
    numbers = np.empty((len(body), len(place)))
    for number, row in enumerate(body):
        try:
            numbers[number] = [float(row[i]) for i in place.values()]
        except (ValueError, IndexError):
            numbers[number] = np.nan
        if len(row) != len(header) or not np.isfinite(numbers[number]).all():
            problem = f"row {number + 1} must have {len(header)} numbers, all finite"
            raise InputError(field, path.name, problem, "correct that row")
    return dict(zip(place, numbers.T, strict=True))


# ---- writing --------------------------------------------------------------------------------------------------------


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder. On success it replaces `path` in one step, on failure it is removed.

    The temporary name keeps the suffix of `path`, because writers choose their format from it.
    """
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    except OSError as error:  # name the target, not the temporary file
        raise type(error)(error.errno, error.strerror, str(target)) from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        _move(temporary, target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def _move(made: Path, target: Path) -> None:
    """Put a file where it is wanted; Windows refuses that where another program has the old one open."""
    try:
        made.replace(target)
    except PermissionError as error:
        raise PermissionError(error.errno, f"{error.strerror} (is it open in a program?)", str(target)) from None


def output_folder(path: str | Path) -> Path:
    """Make (if needed) and return the output folder.

    Raises
    ------
    InputError
        When it cannot be made or written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError("--out", str(path), f"cannot be written ({reason})", "choose another folder") from None
    return folder


def write_csv(path: str | Path, columns: Columns, *, gaps: bool = True) -> list[str]:
    """Write a table: one header line of names with units, then one line per row; floats carry 17 significant digits.

    Returns what `csv_table` warns of.
    """
    with csv_table(path, gaps=gaps) as table:
        table.write(columns)
    return table.warnings


def write_csvs(folder: Path, tables: Mapping[str, Columns]) -> None:
    """Write several tables: the first as ``NAME.csv``, the others as ``NAME_OTHER.csv``."""
    main = next(iter(tables), "")
    for name, columns in tables.items():
        write_csv(folder / (f"{main}.csv" if name == main else f"{main}_{name}.csv"), columns)


@dataclass(frozen=True)
class Table:
    """Hold a table that is being written: the writer of its next rows (columns), and its warnings."""

    write: Callable[[Columns], None]
    warnings: list[str]


@contextmanager
def csv_table(path: str | Path, *, gaps: bool = True) -> Iterator[Table]:
    """Yield a table; the file appears whole at the end.

    Columns with infinite numbers are reported by a `NotFiniteWarning`; without `gaps`, where NaN says nothing
    that the table means, those with such numbers too.
    """
    found: dict[str, list[int]] = {}  # column -> how many, and the first row
    rows = 0
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        begun = False

        def write(columns: Columns) -> None:
            nonlocal begun, rows
            for name, values in columns.items():
                bad = _not_finite(values, gaps)
                if len(bad):
                    found.setdefault(name, [0, rows + int(bad[0]) + 1])[0] += len(bad)
            rows += max(map(len, columns.values()), default=0)
            if not begun:
                stream.write(",".join(map(quoted, columns)) + "\n")
                begun = True
            for first in range(0, max(map(len, columns.values()), default=0), AT_ONCE):
                some = [_printed(values[first : first + AT_ONCE]) for values in columns.values()]
                row = ",".join(printed for printed, _ in some) + "\n"
                stream.writelines(row % cells for cells in zip(*(cells for _, cells in some), strict=True))

        table = Table(write, [])
        yield table
    for name, (count, first) in found.items():
        of = f"{count} of {rows} values are not finite (inf or nan)"
        table.warnings.append(f"{Path(path).name}: column {name}: {of}, the first in row {first}")
        warnings.warn(NotFiniteWarning(table.warnings[-1]), stacklevel=4)


def _not_finite(values: Any, gaps: bool) -> Any:
    """Numbers of the rows whose value is infinite, or without `gaps` no number; none in a column of words."""
    import numpy as np

    try:
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return ()
    return np.flatnonzero(np.isinf(numbers) if gaps else ~np.isfinite(numbers))


def _printed(values: Any) -> tuple[str, Sequence[Any]]:
    """Return the format of a column and its values: a format for a whole row is faster than one for each number."""
    kind = getattr(getattr(values, "dtype", None), "kind", "")
    if kind in ("f", "i"):
        return "%.17g" if kind == "f" else "%d", values.tolist()
    return "%s", [_cell(value) for value in values]


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write a summary file; numpy scalars and arrays become plain numbers and lists, NaN becomes null."""
    with whole_file(path) as temporary:
        temporary.write_text(
            json.dumps(_plain(content), indent=2, allow_nan=False) + "\n", encoding="utf-8", newline="\n"
        )


def _cell(value: Any) -> str:
    if isinstance(value, (str, bool)):
        return quoted(str(value))
    return str(int(value)) if _is_integer(value) else f"{float(value):.17g}"


def quoted(text: str) -> str:
    """Quote a text by RFC 4180 if it contains a comma, a quote or an end of line."""
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',"\r\n') else text


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) or getattr(getattr(value, "dtype", None), "kind", "") in ("i", "u")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float) and value != value:  # noqa: PLR0124
        return None
    if isinstance(value, float) and value in (float("inf"), float("-inf")):
        return None
    return value


@contextmanager
def recorded() -> Iterator[list[Written]]:
    """Yield a list that gets an entry for each set of files written inside."""
    notes: list[Written] = []
    _records.append(notes)
    try:
        yield notes
    finally:
        _records[:] = [one for one in _records if one is not notes]  # equal ones may be another's


@contextmanager
def whole_set(folder: Path, may_write: Sequence[str] = (), beside: Sequence[str] = ()) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; its files move to `folder` when all of them are written, else none.

    Parameters
    ----------
    may_write
        Patterns of all files that this kind of run can write. Files of an earlier run that this one does not replace
        are removed if the results changed, so that no old picture remains next to new tables. They stay if all tables
        and summaries that both runs wrote are equal.
    beside
        Files of the same run that are in the folder already.
    """
    _remove_leftovers(folder)
    with tempfile.TemporaryDirectory(prefix=WRITING, dir=folder) as name:
        temporary = Path(name)
        yield temporary
        new = {path.name for path in temporary.iterdir()}
        if SUMMARY in new:
            may_write = (*may_write, *KEPT_LATER)
        earlier = {
            old for pattern in may_write for old in folder.glob(pattern) if old.name not in new and old.is_file()
        }
        stale = set() if earlier and _unchanged(temporary, folder) else earlier
        for path in sorted(temporary.iterdir()):
            _move(path, folder / path.name)
        for old in stale:
            old.unlink()
        removed = tuple(sorted(old.name for old in stale))
        for record in _records:
            record.append(Written(folder, tuple(sorted([*new, *beside])), removed))


def _unchanged(new: Path, old: Path) -> bool:
    """Return whether all tables and summaries in both folders are equal except for computing times; at least one is."""
    common = [path for path in new.iterdir() if path.suffix in (".csv", ".json") and (old / path.name).is_file()]
    return bool(common) and all(_equal(path, old / path.name) for path in common)


def _equal(one: Path, other: Path) -> bool:
    """Return whether two tables, or two summaries without their computing times, are equal."""
    if one.suffix == ".csv":
        return filecmp.cmp(one, other, shallow=False)
    try:
        contents = [json.loads(path.read_text(encoding="utf-8")) for path in (one, other)]
    except ValueError:
        return False
    first, second = (
        {key: value for key, value in content.items() if not key.startswith("timings")}
        if isinstance(content, dict)
        else content
        for content in contents
    )
    return bool(first == second)


def _remove_leftovers(folder: Path) -> None:
    """Remove temporary folders of runs that were killed; younger ones may belong to a run that is still going on."""
    for old in folder.glob(f"{WRITING}*"):
        with suppress(OSError):
            if time.time() - old.stat().st_mtime > LEFTOVER_S:
                shutil.rmtree(old)
