"""The table of a study on disk: a row is appended whole as soon as its case is done, and found again after a kill.

``study.json`` says what the study is; ``study.csv`` has a row for each finished case. While cases are missing, rows
stand as they came; `finish` sorts them.
"""

from __future__ import annotations

import csv
import importlib
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import whole_file, write_json
from .case import Row

try:
    import fcntl
except ImportError:  # of POSIX alone
    fcntl = None  # type: ignore[assignment]

TABLE, HEAD = "study.csv", "study.json"
#: File of the folder that Windows locks; elsewhere the folder itself is locked.
LOCK = ".study.lock"
#: Columns beside parameters and outputs.
FIRST, LAST = ("case",), ("status", "message", "seconds")


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Hold the folder; however the program ends, the system gives it free (flock(2), or _locking of Windows).

    Raises
    ------
    InputError
        When another program holds it.
    """
    handle = os.open(folder, os.O_RDONLY) if fcntl is not None else os.open(folder / LOCK, os.O_RDWR | os.O_CREAT)
    try:
        try:
            _lock(handle)
        except (BlockingIOError, PermissionError):  # as POSIX, as Windows has it
            problem, cure = "is being written by another study", "wait for its end, or choose another --out"
            raise InputError("--out", str(folder), problem, cure) from None
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(handle)


def _lock(handle: int) -> None:
    """Lock what is open, or raise at once where another program has."""
    if fcntl is not None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    else:
        windows: Any = importlib.import_module("msvcrt")
        windows.locking(handle, windows.LK_NBLCK, 1)


@contextmanager
def _kept(path: Path) -> Iterator[None]:
    """A disk that is full, say: rows that stand stay."""
    try:
        yield
    except OSError as error:
        cure = "the rows are kept: make room, and give the same command"
        raise InputError("--out", str(path), f"cannot be written ({error.strerror})", cure) from None


class Journal:
    """Rows of a study in a folder; the only writer, see `only_writer`.

    Parameters
    ----------
    folder
        Where the files are.
    head
        What decides the rows: a study with another one does not go on here.
    versions
        Of program and libraries.
    parameters, outputs
        Names of the columns.
    restart
        Begin anew, whatever the folder holds.

    Raises
    ------
    InputError
        When the folder holds another study.
    """

    def __init__(
        self,
        folder: Path,
        head: Mapping[str, Any],
        versions: Mapping[str, str],
        parameters: Sequence[str],
        outputs: Sequence[str],
        *,
        restart: bool = False,
    ) -> None:
        self.path = folder / TABLE
        if restart:
            self.path.unlink(missing_ok=True)
        self.columns = (*FIRST, *parameters, *outputs, *LAST)
        self.done: set[int] = set()
        plain = json.loads(json.dumps(head, default=str))
        made: dict[str, Any] = {"study": plain, "versions": [{"rows_before": 0, **versions}]}
        if self.path.exists():
            there = self._same(folder / HEAD, plain)
            self._recover()
            if {**there["versions"][-1], "rows_before": 0} != made["versions"][0]:
                there["versions"].append({"rows_before": len(self.done), **versions})
                write_json(folder / HEAD, there)
        else:
            write_json(folder / HEAD, made)
            with whole_file(self.path) as temporary:
                temporary.write_text(_line(self.columns), encoding="utf-8", newline="\n")

    def _same(self, path: Path, head: dict[str, Any]) -> dict[str, Any]:
        cure = "choose another --out, or give --restart to begin anew"
        try:
            there: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            study, _ = there["study"], there["versions"][-1]["rows_before"]
        except (OSError, ValueError, KeyError, TypeError):
            problem = f"holds a {TABLE} without its {HEAD}"
            raise InputError("--out", str(path.parent), problem, cure) from None
        key = _difference(study, head)
        if key:
            raise InputError("--out", str(path.parent), f"holds the rows of another study: {key} differs", cure)
        return there

    def _recover(self) -> None:
        """Numbers of the rows that are there; what a kill left of a last row goes."""
        raw = self.path.read_bytes()
        whole = raw[: raw.rfind(b"\n") + 1]
        if len(whole) < len(raw):
            os.truncate(self.path, len(whole))
        rows = csv.reader(io.StringIO(whole.decode("utf-8")))
        header = next(rows, [])
        if tuple(header) != self.columns:
            problem = f"{TABLE} has other columns than the study"
            raise InputError("--out", str(self.path.parent), problem, "give --restart to begin anew")
        self.done = {int(row[0]) for row in rows if row}

    def append(self, rows: Iterable[Row], values: Sequence[Sequence[Any]] | Mapping[int, Sequence[Any]]) -> None:
        """Add finished cases, once each; `values` by number of the case."""
        fresh = [row for row in rows if row.case not in self.done]
        text = "".join(
            _line((row.case, *values[row.case], *row.outputs, row.status, row.message, float(f"{row.seconds:.4g}")))
            for row in fresh
        )
        with _kept(self.path), self.path.open("ab", buffering=0) as stream:
            stream.write(text.encode("utf-8"))  # one write: no half rows beside other programs' reading
        self.done.update(row.case for row in fresh)

    def finish(self) -> dict[str, list[str]]:
        """Sort the table by case, and return its columns as text."""
        with self.path.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.reader(stream))
        header, body = rows[0], sorted((row for row in rows[1:] if row), key=lambda row: int(row[0]))
        with _kept(self.path), whole_file(self.path) as made, made.open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerows([header, *body])
        return {name: [row[i] for row in body] for i, name in enumerate(header)}


def _line(cells: Sequence[Any]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerow([cell_text(cell) for cell in cells])
    return stream.getvalue()


def cell_text(cell: Any) -> str:
    """A value as it stands in the table: a number reads the same again."""
    if isinstance(cell, float):
        return repr(cell)
    return json.dumps(cell) if isinstance(cell, (list, dict)) else str(cell)


def _difference(there: Any, here: Any, name: str = "") -> str:
    """First key in which two headers differ; empty where they are the same."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in [*here, *(k for k in there if k not in here)]:
            found = _difference(there.get(key), here.get(key), f"{name}.{key}".lstrip("."))
            if found:
                return found
        return ""
    return "" if there == here else name or "the study"
