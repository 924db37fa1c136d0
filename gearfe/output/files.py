"""Files written whole or not at all: a temporary file beside the target, renamed when it is complete."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import InputError

#: Name -> values, a sequence or an array.
Columns = Mapping[str, Any]
#: Name of temporary folders, and the age (s) at which one must be a leftover.
WRITING, LEFTOVER_S = ".writing-", 86400.0
#: Rows of a table that are text at a time.
AT_ONCE = 4096


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; on success it replaces `path` in one step, on failure it is removed.

    The temporary name keeps the suffix of `path`, because writers choose their format from it.
    """
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    except OSError as error:  # tell the file that is wanted, not the temporary one
        raise type(error)(error.errno, error.strerror, str(target)) from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


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


def write_csv(path: str | Path, columns: Columns) -> None:
    """Write a table: one header line of names with units, then one line per row; floats carry 17 significant digits."""
    with csv_table(path) as write:
        write(columns)


@contextmanager
def csv_table(path: str | Path) -> Iterator[Callable[[Columns], None]]:
    """Yield a function that writes the next rows of a table, given as columns; the file appears whole at the end."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8") as stream:
        begun = False

        def write(columns: Columns) -> None:
            nonlocal begun
            if not begun:
                stream.write(",".join(columns) + "\n")
                begun = True
            for first in range(0, max(map(len, columns.values()), default=0), AT_ONCE):
                some = [_listed(values[first : first + AT_ONCE]) for values in columns.values()]
                stream.writelines(",".join(map(_cell, row)) + "\n" for row in zip(*some, strict=True))

        yield write


def _listed(values: Any) -> Sequence[Any]:
    """Plain numbers of an array of them, which are faster to write."""
    return values.tolist() if getattr(getattr(values, "dtype", None), "kind", "") in ("f", "i") else values


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write a summary file; numpy scalars and arrays become plain numbers and lists, not-a-number becomes null."""
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(_plain(content), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def not_finite(columns: Mapping[str, Any]) -> list[str]:
    """A sentence for each column with numbers that are infinite or none: such a table is no success."""
    import numpy as np

    found = []
    for name, values in columns.items():
        rows = np.flatnonzero(~np.isfinite(np.asarray(values, dtype=float))) + 1
        if len(rows):
            of = f"{len(rows)} of {len(values)} values are not finite (inf or nan)"
            found.append(f"column {name}: {of}, the first in row {rows[0]}")
    return found


def _cell(value: Any) -> str:
    if isinstance(value, (str, bool)):
        return str(value)
    return str(int(value)) if _is_integer(value) else f"{float(value):.17g}"


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
def whole_set(folder: Path, may_write: Sequence[str] = ()) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; its files move to `folder` when all of them are written, else none.

    Parameters
    ----------
    may_write
        Patterns of all files that this kind of run can write: those of an earlier run that this one does not replace
        are removed, so that no old picture stands beside new tables.
    """
    _remove_leftovers(folder)
    with tempfile.TemporaryDirectory(prefix=WRITING, dir=folder) as name:
        made = Path(name)
        yield made
        new = {path.name for path in made.iterdir()}
        for path in sorted(made.iterdir()):
            path.replace(folder / path.name)
        for old in {old for pattern in may_write for old in folder.glob(pattern)}:
            if old.name not in new and old.is_file():
                old.unlink()


def _remove_leftovers(folder: Path) -> None:
    """Remove temporary folders of runs that were killed; younger ones may belong to a run that is still going on."""
    for old in folder.glob(f"{WRITING}*"):
        with suppress(OSError):
            if time.time() - old.stat().st_mtime > LEFTOVER_S:
                shutil.rmtree(old)
