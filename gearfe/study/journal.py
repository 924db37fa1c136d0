"""The journal of a study: ``study.db``, an SQLite database that receives finished cases, and its exports.

The database is the only record; ``study.csv`` and ``study.json`` are exports, written whole or not at all. What it
survives, and by what:

kill, full disk
    A transaction for each arrival of results: all of its rows are there, or none. It is a rollback journal, not a
    write-ahead log, so all committed rows are in the one file that a user sees and copies. A damaged log would drop the
    rows behind the damage without an error, and its shared memory does not work in network folders.
loss of power
    Full synchronisation. It takes some 20 ms on a slow disk, so rows come in groups (`gearfe.study.run`).
damage
    SQLite has no checksums: each line has one, and the file's header holds the number of rows, changed in the same
    transaction. `PRAGMA integrity_check` covers the pages.
another file in its place
    The description is compared before SQLite may write or play back anything (``immutable``).
two programs
    A lock of the folder, and the exclusive lock of SQLite where network folders have no locks of folders.
"""

from __future__ import annotations

import csv
import importlib
import json
import os
import sqlite3
import stat
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from ..base.errors import LONGEST_TEXT, InputError
from ..base.files import quoted, whole_file, write_json
from .case import Row

try:
    import fcntl
except ImportError:  # of POSIX alone
    fcntl = None  # type: ignore[assignment]

DATABASE, TABLE, HEAD = "study.db", "study.csv", "study.json"
#: File of the folder that Windows locks; elsewhere the folder itself is locked.
LOCK = ".study.lock"
#: Columns beside parameters and outputs.
FIRST, LAST = ("case",), ("status", "message", "seconds")
#: Marks the database in its header ("gear" in ASCII); bytes of a page: a small one fits a disk that is nearly full.
APPLICATION, PAGE = 0x67656172, 1024
#: Tables of the database, all with the same columns: the study's description, versions of the program, rows.
TABLES = ("head", "versions", "rows")
SCHEMA = {name: f"CREATE TABLE {name} (number INTEGER PRIMARY KEY, line TEXT, crc INTEGER)" for name in TABLES}
#: Ends of the names of files that SQLite keeps beside a database; a study has only the first.
COMPANIONS = ("-journal", "-wal", "-shm")
#: First bytes of a rollback journal that SQLite has to play back (sqlite.org/fileformat2.html, section 3).
HOT = bytes.fromhex("d9d505f920a163d7")
#: Result codes of SQLite where a file system has no locks of files, as some parallel ones of clusters have not.
NO_LOCKS = (sqlite3.SQLITE_IOERR_LOCK, sqlite3.SQLITE_IOERR_RDLOCK)
#: Seconds between two exports while cases run, and the largest share of the time that exports take.
EXPORT_S, EXPORT_SHARE = 2.0, 0.05
#: What to do about a file that is not the journal of the study, and about a damaged one.
ELSEWHERE = "choose another --out, or give --restart to start again"
REPAIR = "restore a copy of it, or give --restart to start again"


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
            raise _busy(folder) from None
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


def _busy(folder: Path) -> InputError:
    cure = "wait for its end, or choose another --out"
    return InputError("--out", str(folder), "is being written by another study", cure)


class Journal:
    """Rows of a study in a folder; the only writer, see `only_writer`. Leaving its ``with`` block exports the rows.

    Parameters
    ----------
    folder
        Where the files are.
    head
        What decides the rows: a study with another one does not continue here.
    versions
        Of program and libraries.
    parameters, outputs
        Names of the columns.
    cases
        Values of the parameters by number of the case: rows in the folder must have them. None: not known beforehand.
    restart
        Begin again, and delete earlier results in the folder.

    Raises
    ------
    InputError
        When the folder holds another study or something else, is damaged, or cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        head: Mapping[str, Any],
        versions: Mapping[str, str],
        parameters: Sequence[str],
        outputs: Sequence[str],
        *,
        cases: Sequence[Sequence[Any]] | None = None,
        restart: bool = False,
    ) -> None:
        self.folder, self.path = folder, folder / DATABASE
        self.columns = (*FIRST, *parameters, *outputs, *LAST)
        self.done: set[int] = set()
        self._cases, self._versions = cases, json.dumps(dict(versions))
        self._head = json.dumps({"study": json.loads(json.dumps(head, default=str)), "columns": self.columns})
        self._connection: sqlite3.Connection | None = None
        self._exported, self._export_due = -1, 0.0
        with _stored(self.folder):
            if restart:
                self._remove()
            if not _there(self.path):
                self._create()
        self._open()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            with suppress(*(() if kind is None else (InputError,))):  # the first error says more
                self._export()
        finally:
            self._close()

    def append(self, rows: Iterable[Row], values: Sequence[Sequence[Any]] | Mapping[int, Sequence[Any]]) -> None:
        """Add finished cases, all of them or none, once each; `values` by number of the case.

        Raises
        ------
        InputError
            When they cannot be stored; the rows of earlier calls are.
        """
        lines = {
            row.case: _line(
                (row.case, *values[row.case], *row.outputs, row.status, row.message, float(f"{row.seconds:.4g}"))
            )
            for row in rows
            if row.case not in self.done
        }
        connection = self._connection or self._open()
        try:
            with _stored(self.folder):
                connection.execute("BEGIN")
                _insert(connection, "rows", lines)
                connection.execute(f"PRAGMA user_version = {len(self.done) + len(lines)}")
                connection.execute("COMMIT")
        except BaseException:
            self._close()  # what is there is read again
            raise
        self.done.update(lines)
        if time.monotonic() >= self._export_due:
            with suppress(InputError):  # the export at the end counts
                self._export()

    def cells(self) -> dict[str, list[str]]:
        """Columns of the table as text, by rising case."""
        body = list(csv.reader(self._sorted()))
        return {name: [row[i] for row in body] for i, name in enumerate(self.columns)}

    def finish(self) -> dict[str, list[str]]:
        """Export and close the journal; return its columns as `cells` does."""
        with self:
            return self.cells()

    # ---- the database ----------------------------------------------------------------------------------------------

    def _create(self) -> None:
        """Write an empty database, whole or not at all."""
        for name in (TABLE, HEAD):
            if _there(self.folder / name):
                problem = f"holds a {name} without its {DATABASE}: an earlier gearfe wrote it, or somebody removed that"
                raise InputError("--out", str(self.folder), problem, ELSEWHERE)
        for end in COMPANIONS:  # of a database that is gone: SQLite would play them back into this one
            _beside(self.path, end).unlink(missing_ok=True)
        with whole_file(self.path) as temporary, closing(_connected(temporary, "mode=rw")) as connection:
            connection.execute(f"PRAGMA page_size = {PAGE}")
            connection.execute("PRAGMA journal_mode = MEMORY")
            connection.execute("BEGIN")
            connection.execute(f"PRAGMA application_id = {APPLICATION}")
            for statement in SCHEMA.values():
                connection.execute(statement)
            _insert(connection, "head", {0: self._head})
            _insert(connection, "versions", {0: self._versions})
            connection.execute("COMMIT")

    def _remove(self) -> None:
        """Remove the study of the folder; its database last, so that a kill leaves either study whole."""
        if _there(self.path) and all(map(_regular, self._files())):
            try:
                with closing(_connected(self.path, "mode=ro")) as connection:
                    connection.execute("SELECT name FROM sqlite_schema").fetchall()
            except sqlite3.Error as error:  # a damaged one goes, one in use stays
                if _code(error) == sqlite3.SQLITE_BUSY:
                    raise
        for name in (TABLE, HEAD, DATABASE):
            (self.folder / name).unlink(missing_ok=True)

    def _open(self) -> sqlite3.Connection:
        """Open the database for writing, after its description and all of its rows are checked."""
        self._compare()
        with _stored(self.folder):
            try:
                connection = _alone(self.path, "mode=rw")
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode not in NO_LOCKS:
                    raise
                connection = _alone(self.path, "mode=rw&nolock=1")
        self._connection = connection
        try:
            with self._reading():
                self.done = self._checked(connection)
                versions = list(self._lines(connection, "versions"))
            if not versions or versions[-1][1] != self._versions:
                with _stored(self.folder):
                    connection.execute("DELETE FROM versions WHERE number = ?", (len(self.done),))  # that made no row
                    _insert(connection, "versions", {len(self.done): self._versions})
            with _stored(self.folder):
                connection.execute("COMMIT")
        except BaseException:
            self._close()
            raise
        return connection

    def _close(self) -> None:
        """Close the database; a transaction that is open leaves nothing."""
        connection, self._connection = self._connection, None
        if connection is not None:
            with suppress(sqlite3.Error):
                connection.close()

    def _files(self) -> list[Path]:
        return [self.path, *(_beside(self.path, end) for end in COMPANIONS)]

    def _compare(self) -> None:
        """Refuse what is not the journal of this study, without a change of it."""
        for path in self._files():
            if not _regular(path):
                raise InputError("--out", str(path), "is a link or a folder, not a file", f"remove it, or {ELSEWHERE}")
        for end in ("-wal", "-shm"):
            if _there(_beside(self.path, end)):
                raise InputError("--out", str(_beside(self.path, end)), "is no file of a study", "move it away")
        rollback = _beside(self.path, "-journal")
        with self._reading():
            begin = rollback.open("rb").read(len(HOT)) if _there(rollback) else b""
            if begin.strip(b"\0") and begin != HOT:
                raise InputError("--out", str(rollback), "is no file of a study, or damaged", "move it away")
            with closing(_connected(self.path, "immutable=1")) as connection:
                ((application,),) = connection.execute("PRAGMA application_id")
                if application != APPLICATION:
                    raise InputError("--out", str(self.path), "is no journal of a study", ELSEWHERE)
                if dict(connection.execute("SELECT name, sql FROM sqlite_schema")) != SCHEMA:
                    raise self._damaged("its tables are not those of a study")
                ((_, line),) = self._lines(connection, "head")
            key = _difference(json.loads(line), json.loads(self._head))
        if key:
            problem = f"holds the rows of another study: {key.removeprefix('study.')} differs"
            raise InputError("--out", str(self.folder), problem, ELSEWHERE)

    def _checked(self, connection: sqlite3.Connection) -> set[int]:
        """Numbers of the rows, all of which are sound and of this study."""
        ((state,),) = connection.execute("PRAGMA integrity_check(1)")
        if state != "ok":
            raise self._damaged(str(state).splitlines()[-1])
        done = set()
        for number, line in self._lines(connection, "rows"):
            if not self._is_of(number, line):
                problem = f"has a case {number} that the study does not have, or with other values"
                raise InputError("--out", str(self.path), problem, f"NumPy or SciPy of another version? {ELSEWHERE}")
            done.add(number)
        ((count,),) = connection.execute("PRAGMA user_version")
        if len(done) != count:
            raise self._damaged(f"it has {len(done)} of {count} rows")
        return done

    def _is_of(self, number: int, line: str) -> bool:
        if self._cases is None:
            return number >= 0 and line.startswith(f"{number},")
        return 0 <= number < len(self._cases) and line.startswith(_line((number, *self._cases[number])) + ",")

    def _lines(self, connection: sqlite3.Connection, table: str) -> Iterator[tuple[int, str]]:
        """Lines of a table by rising number, each checked."""
        for number, line, crc in connection.execute(f"SELECT number, line, crc FROM {table} ORDER BY number"):
            if crc != _checksum(number, line):
                raise self._damaged(f"line {number} of its table {table} does not match its checksum")
            yield number, line

    def _damaged(self, what: str) -> InputError:
        return _damaged(self.path, what)

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Convert read failures to errors: the file is damaged, or another kind of file."""
        try:
            yield
        except InputError:
            raise
        except sqlite3.Error as error:
            if _code(error) in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_PERM, sqlite3.SQLITE_IOERR):
                raise _refused(self.folder, error) from None
            raise self._damaged(str(error)) from None
        except OSError as error:
            raise _refused(self.folder, error) from None
        except (
            ValueError,
            TypeError,
            AttributeError,
            OverflowError,
            MemoryError,
        ):  # bytes that are no text, cells without a value
            raise self._damaged("a line cannot be read") from None

    # ---- exports ---------------------------------------------------------------------------------------------------

    def _sorted(self) -> Iterator[str]:
        connection = self._connection or self._open()
        with self._reading():
            yield from (line for _, line in self._lines(connection, "rows"))

    def _export(self) -> None:
        """Write the table and the description, each whole or not at all."""
        if self._exported == len(self.done) and _there(self.folder / TABLE):
            return
        began = time.monotonic()
        connection = self._connection or self._open()
        with _stored(self.folder):
            with whole_file(self.folder / TABLE) as made, made.open("w", encoding="utf-8", newline="") as stream:
                stream.write(_line(self.columns) + "\n")
                stream.writelines(f"{line}\n" for line in self._sorted())
            versions = [{"rows_before": n, **json.loads(line)} for n, line in self._lines(connection, "versions")]
            write_json(self.folder / HEAD, {"study": json.loads(self._head)["study"], "versions": versions})
        ended = time.monotonic()
        self._exported = len(self.done)
        self._export_due = ended + max(EXPORT_S, (ended - began) / EXPORT_SHARE)


def _damaged(path: Path, what: str) -> InputError:
    """Error of a damaged file; what SQLite says of it may hold any bytes of it."""
    plain = "".join(letter if letter.isprintable() else "?" for letter in what)
    return InputError("--out", str(path), f"is damaged: {plain[:LONGEST_TEXT]}", REPAIR)


def _connected(path: Path, how: str) -> sqlite3.Connection:
    """A database that is there; nothing waits for another program."""
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?{how}", uri=True, timeout=0.0, isolation_level=None, check_same_thread=False
    )
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    return connection


def _alone(path: Path, how: str) -> sqlite3.Connection:
    """A database in a transaction that nobody else may read; what a kill left unfinished is played back."""
    connection = _connected(path, how)
    try:
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        connection.execute("BEGIN EXCLUSIVE")
    except BaseException:
        connection.close()
        raise
    return connection


def _insert(connection: sqlite3.Connection, table: str, lines: Mapping[int, str]) -> None:
    rows = ((number, line, _checksum(number, line)) for number, line in lines.items())
    connection.executemany(f"INSERT INTO {table} VALUES (?, ?, ?)", rows)


def _checksum(number: int, line: str) -> int:
    return zlib.crc32(line.encode(), number & 0xFFFFFFFF)


def _code(error: BaseException) -> int:
    """SQLite's result code without its extension; 0 where the error is Python's."""
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF


def _there(path: Path) -> bool:
    """Return whether a name is taken; a link that leads nowhere takes it, too."""
    return os.path.lexists(path)


def _regular(path: Path) -> bool:
    """Return whether a name is free or a file's: SQLite would follow a link, and wait at a pipe."""
    return not _there(path) or stat.S_ISREG(path.lstat().st_mode)


def _beside(path: Path, end: str) -> Path:
    return Path(f"{path}{end}")


@contextmanager
def _stored(folder: Path) -> Iterator[None]:
    """Convert write failures to errors with a cure, for example for a full disk."""
    try:
        yield
    except InputError:
        raise
    except (sqlite3.Error, OSError) as error:
        raise _refused(folder, error) from None


def _refused(folder: Path, error: sqlite3.Error | OSError) -> InputError:
    code = _code(error)
    if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
        return _busy(folder)
    if code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
        return _damaged(folder / DATABASE, str(error))
    path = getattr(error, "filename", None) or str(folder / DATABASE)
    reason = getattr(error, "strerror", None) or str(error)
    cure = "finished rows are kept: check space and permissions there, and give the same command"
    return InputError("--out", str(path), f"cannot be written ({reason})", cure)


def _line(cells: Sequence[Any]) -> str:
    """Cells as a line of the table, without its end."""
    line = ",".join(quoted(cell_text(cell)) for cell in cells)
    return line.encode("utf-8", "backslashreplace").decode()  # names of files need not be text


def cell_text(cell: Any) -> str:
    """A value as it stands in the table: a number reads the same again."""
    if isinstance(cell, float):
        return repr(cell)
    return json.dumps(cell) if isinstance(cell, (list, dict)) else str(cell)


def _difference(there: Any, here: Any, name: str = "") -> str:
    """First key in which two headers differ; empty where they are the same."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in [*here, *(k for k in there if k not in here)]:
            difference = _difference(there.get(key), here.get(key), f"{name}.{key}".lstrip("."))
            if difference:
                return difference
        return ""
    return "" if there == here else name or "the study"
