"""Files written whole or not at all: a temporary file beside the target, renamed when it is complete."""

from __future__ import annotations

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

from ..errors import InputError, NotFiniteWarning

#: Name -> values, a sequence or an array.
Columns = Mapping[str, Any]
#: Name of temporary folders, and the age (s) at which one must be a leftover.
WRITING, LEFTOVER_S = ".writing-", 86400.0
#: Rows of a table that are text at a time.
AT_ONCE = 4096
#: The summary of a run, and those that are made from its other files after it.
SUMMARY, KEPT_LATER = "summary.json", ("report.html", "tables.npz", "tables.h5", "tables.mat", "tables.uff")

_records: list[list[tuple[Path, list[str]]]] = []


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; on success it replaces `path` in one step, on failure it is removed.

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
    """A table under way: what writes its next rows, given as columns, and what its numbers are warned of at the end."""

    write: Callable[[Columns], None]
    warnings: list[str]


@contextmanager
def csv_table(path: str | Path, *, gaps: bool = True) -> Iterator[Table]:
    """Yield a table; the file appears whole at the end.

    Columns with infinite numbers are reported by a `NotFiniteWarning`; without `gaps`, where not-a-number says nothing
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
                stream.write(",".join(map(_quoted, columns)) + "\n")
                begun = True
            for first in range(0, max(map(len, columns.values()), default=0), AT_ONCE):
                some = [_listed(values[first : first + AT_ONCE]) for values in columns.values()]
                stream.writelines(",".join(map(_cell, row)) + "\n" for row in zip(*some, strict=True))

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


def _listed(values: Any) -> Sequence[Any]:
    """Plain numbers of an array of them, which are faster to write."""
    return values.tolist() if getattr(getattr(values, "dtype", None), "kind", "") in ("f", "i") else values


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write a summary file; numpy scalars and arrays become plain numbers and lists, not-a-number becomes null."""
    with whole_file(path) as temporary:
        temporary.write_text(
            json.dumps(_plain(content), indent=2, allow_nan=False) + "\n", encoding="utf-8", newline="\n"
        )


def _cell(value: Any) -> str:
    if isinstance(value, (str, bool)):
        return _quoted(str(value))
    return str(int(value)) if _is_integer(value) else f"{float(value):.17g}"


def _quoted(text: str) -> str:
    """A text as RFC 4180 has it: within quotes where a comma, a quote or an end of line stands in it."""
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
def recorded() -> Iterator[list[tuple[Path, list[str]]]]:
    """Yield a list that gets the folder and the names of each set of files written inside."""
    found: list[tuple[Path, list[str]]] = []
    _records.append(found)
    try:
        yield found
    finally:
        _records[:] = [one for one in _records if one is not found]  # equal ones may be another's


@contextmanager
def whole_set(folder: Path, may_write: Sequence[str] = (), beside: Sequence[str] = ()) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; its files move to `folder` when all of them are written, else none.

    Parameters
    ----------
    may_write
        Patterns of all files that this kind of run can write: those of an earlier run that this one does not replace
        are removed, so that no old picture stands beside new tables.
    beside
        Files of the same run that are in the folder already.
    """
    _remove_leftovers(folder)
    with tempfile.TemporaryDirectory(prefix=WRITING, dir=folder) as name:
        made = Path(name)
        yield made
        new = {path.name for path in made.iterdir()}
        if SUMMARY in new:
            may_write = (*may_write, *KEPT_LATER)
        for path in sorted(made.iterdir()):
            _move(path, folder / path.name)
        for old in {old for pattern in may_write for old in folder.glob(pattern)}:
            if old.name not in new and old.is_file():
                old.unlink()
        for record in _records:
            record.append((folder, sorted([*new, *beside])))


def _remove_leftovers(folder: Path) -> None:
    """Remove temporary folders of runs that were killed; younger ones may belong to a run that is still going on."""
    for old in folder.glob(f"{WRITING}*"):
        with suppress(OSError):
            if time.time() - old.stat().st_mtime > LEFTOVER_S:
                shutil.rmtree(old)
