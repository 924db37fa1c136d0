"""Faults of the journal of studies: full disks, kills, damage, other files in its place, two programs.

Each leaves the rows that were stored before, or is refused with a cure; no row is there twice, and a refusal changes
nothing.
"""

from __future__ import annotations

import csv
import errno
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from gearfe.base.errors import InputError
from gearfe.study import journal as module
from gearfe.study import run
from gearfe.study.case import Row
from gearfe.study.job import read_study, run_study
from gearfe.study.journal import Journal, cell_text
from tests.makers.studies import rows_of, stored_rows, written
from tests.places import ROOT

CASES = [(i / 7, f"text {i}, with a comma") for i in range(60)]
HEAD = {"study": {"cases": 60, "note": "n" * 300}, "base": {"list": [1, 2.5, "text"]}}


def row(number: int) -> Row:
    if number % 5:
        return Row(number, (number / 3,), "done", "", 0.1)
    return Row(number, (float("nan"),), "invalid", 'a "quoted", cell', 0.1)


def journal(folder: Path, **changes: object) -> Journal:
    head, cases = changes.pop("head", HEAD), changes.pop("cases", CASES)
    return Journal(folder, head, {"gearfe": "1"}, ["p", "q"], ["o"], cases=cases, **changes)  # type: ignore[arg-type]


def filled(folder: Path, count: int = 60) -> dict[str, list[str]]:
    """A folder with so many rows, and its columns."""
    with journal(folder) as rows:
        for first in range(0, count, 7):
            rows.append(map(row, range(first, min(first + 7, count))), CASES)
        return rows.cells()


def opened(folder: Path) -> tuple[dict[str, list[str]], InputError | None]:
    """Columns of a journal, or why it is refused."""
    try:
        with journal(folder) as rows:
            return rows.cells(), None
    except InputError as error:
        return {}, error


def test_columns_are_the_table_and_the_rows(tmp_path):
    columns = filled(tmp_path)
    with (tmp_path / "study.csv").open(newline="", encoding="utf-8") as stream:
        table = list(csv.reader(stream))
    assert {name: [line[i] for line in table[1:]] for i, name in enumerate(table[0])} == columns
    assert columns["case"] == [str(i) for i in range(60)]
    assert columns["q"] == [text for _, text in CASES]
    assert columns["o"] == [cell_text(row(i).outputs[0]) for i in range(60)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.csv", "study.db", "study.json"]


# ------------------------------------------------------------------------------------------------------- full disks


def test_a_database_that_cannot_grow_keeps_its_rows_and_goes_on(tmp_path):
    rows = journal(tmp_path)
    rows.append(map(row, range(10)), CASES)
    assert rows._connection is not None
    ((pages,),) = rows._connection.execute("PRAGMA page_count")
    rows._connection.execute(f"PRAGMA max_page_count = {pages}")  # SQLITE_FULL, as on a full disk
    with pytest.raises(InputError, match=r"cannot be written \(database or disk is full\).*give the same command"):
        rows.append(map(row, range(10, 60)), CASES)
    assert rows.done == set(range(10))
    rows.append(map(row, range(5, 60)), CASES)  # there is room again
    columns = rows.finish()
    (tmp_path / "other").mkdir()
    assert columns == filled(tmp_path / "other")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root mounts a small disk")
def test_a_small_disk(tmp_path):
    """Rows of an earlier journal vanished here without an error."""
    mounted = ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(tmp_path)]
    if subprocess.run(mounted, capture_output=True, check=False).returncode:
        pytest.skip("no mounts here")
    try:
        values = [(float(i),) for i in range(410)]
        rows = Journal(tmp_path, {}, {"gearfe": "1"}, ["p"], ["o"], cases=values)
        with pytest.raises(InputError, match="disk is full"):
            rows.append([Row(i, (1 / 3,), "done", "", 0.1) for i in range(400)], values)
        assert rows.done == set()
        subprocess.run(["mount", "-o", "remount,size=1m", str(tmp_path)], check=True)
        for some in (range(400), range(400, 410)):
            rows.append([Row(i, (1 / 3,), "done", "", 0.1) for i in some], values)
        assert rows.finish()["case"] == [str(i) for i in range(410)]
    finally:
        subprocess.run(["umount", "-l", str(tmp_path)], check=True)


def test_an_export_that_fails_leaves_the_old_table(tmp_path, monkeypatch):
    filled(tmp_path, 10)
    before = (tmp_path / "study.csv").read_bytes()
    rows = journal(tmp_path)
    rows._export_due = float("inf")
    rows.append(map(row, range(10, 20)), CASES)

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.mkstemp", full)
    with pytest.raises(InputError, match=r"study.csv.*cannot be written \(No space left on device\)"):
        rows.finish()
    monkeypatch.undo()
    assert (tmp_path / "study.csv").read_bytes() == before
    assert len(journal(tmp_path).finish()["case"]) == 20


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_is_read_only(tmp_path):
    filled(tmp_path, 10)
    (tmp_path / "study.db").chmod(0o400)
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match="cannot be written"):
            journal(tmp_path)
    finally:
        tmp_path.chmod(0o700)


# ------------------------------------------------------------------------------------------------------------- kills

STORING = """
import sys
from pathlib import Path
from tests.study.test_study_journal import CASES, journal, row
rows = journal(Path(sys.argv[1]))
for i in range(60):
    rows.append([row(i)], CASES)
    print(i, flush=True)
"""


@pytest.mark.parametrize("seed", range(4))
def test_a_row_that_was_stored_outlives_a_kill(tmp_path, seed):
    line = [sys.executable, "-c", STORING, str(tmp_path)]
    program = subprocess.Popen(
        line, stdout=subprocess.PIPE, text=True, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert program.stdout is not None
    wanted = random.Random(seed).randrange(1, 50)
    told = [program.stdout.readline() for _ in range(wanted)]
    program.kill()
    told += program.stdout.readlines()
    program.wait()
    numbers = [int(text) for text in told if text.endswith("\n")]
    rows = journal(tmp_path)
    assert set(numbers) <= rows.done <= {*numbers, max(numbers) + 1}
    rows.append(map(row, range(60)), CASES)
    columns = rows.finish()
    (tmp_path / "other").mkdir()
    assert columns == filled(tmp_path / "other")


def half_stored(folder: Path) -> tuple[bytes, bytes]:
    """Database and rollback journal as a kill in the middle of a transaction leaves them; 10 rows stand."""
    rows = journal(folder)
    rows.append(map(row, range(10)), CASES)
    connection = rows._connection
    assert connection is not None
    connection.execute("PRAGMA cache_size = 1")
    connection.execute("BEGIN")
    lines = {n: f"{n},half of a transaction," + "x" * 200 for n in range(10, 60)}
    connection.executemany("INSERT INTO rows VALUES (?, ?, 0)", lines.items())
    state = (folder / "study.db").read_bytes(), (folder / "study.db-journal").read_bytes()
    rows._close()
    assert len(state[0]) > (folder / "study.db").stat().st_size  # some pages were written
    return state


def test_half_a_transaction_is_taken_back(tmp_path):
    database, rollback = half_stored(tmp_path)
    (tmp_path / "study.db").write_bytes(database)
    (tmp_path / "study.db-journal").write_bytes(rollback)
    rows = journal(tmp_path)
    assert rows.done == set(range(10))
    assert rows.cells()["case"] == [str(i) for i in range(10)]


def test_half_a_transaction_without_its_rollback_is_refused(tmp_path):
    database, rollback = half_stored(tmp_path)
    dice = random.Random(2)
    for change in range(40):
        raw = bytearray(rollback)
        if change % 2:
            del raw[dice.randrange(len(raw)) :]
        else:
            raw[dice.randrange(len(raw))] ^= 1 << dice.randrange(8)
        (tmp_path / "study.db").write_bytes(database)
        (tmp_path / "study.db-journal").write_bytes(raw)
        cells, error = opened(tmp_path)
        assert error is None or error.cure
        assert error or cells["o"] == [cell_text(row(i).outputs[0]) for i in range(10)]


def test_the_rollback_of_a_database_that_is_gone_is_not_played_into_the_next(tmp_path):
    _, rollback = half_stored(tmp_path)
    for name in ("study.db", "study.csv", "study.json"):
        (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / "study.db-journal").write_bytes(rollback)
    rows = journal(tmp_path)
    assert rows.done == set()
    rows.append(map(row, range(60)), CASES)
    assert len(rows.finish()["case"]) == 60


# ------------------------------------------------------------------------------------------------------------ damage


def test_damage_is_refused_or_does_no_harm(tmp_path):
    """Bits, bytes, stretches of zeros, blocks in another place, cut ends, anywhere in the file."""
    columns = filled(tmp_path)
    raw, dice, refused = (tmp_path / "study.db").read_bytes(), random.Random(5), 0
    for change in range(150):
        damaged, at = bytearray(raw), dice.randrange(len(raw)) if change > 30 else dice.randrange(100)
        if change % 5 == 0:
            damaged[at] ^= 1 << dice.randrange(8)
        elif change % 5 == 1:
            damaged[at] = dice.randrange(256)
        elif change % 5 == 2:
            damaged[at : at + 40] = bytes(len(damaged[at : at + 40]))
        elif change % 5 == 3:
            block = dice.choice([1024, 512, 64])
            to = dice.randrange(len(raw) - block)
            damaged[to : to + block] = raw[to - to % block :][:block]
        else:
            del damaged[at:]
        for path in tmp_path.iterdir():
            path.unlink()
        (tmp_path / "study.db").write_bytes(damaged)
        cells, error = opened(tmp_path)
        if error is None:
            assert cells == columns
            continue
        assert error.cure
        assert len(str(error)) < 400
        assert (tmp_path / "study.db").read_bytes() == bytes(damaged)
        refused += 1
    assert refused > 50


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("UPDATE rows SET number = 7000 WHERE number = 7", "line 7000 of its table rows does not match its checksum"),
        ("UPDATE rows SET line = replace(line, ',done', ',invalid')", "does not match its checksum"),
        ("DELETE FROM rows WHERE number = 7", "it has 59 of 60 rows"),
        ("INSERT INTO rows VALUES (-1, '-1,0.0,text', 0)", "line -1"),
        ("UPDATE rows SET line = NULL WHERE number = 3", "is damaged"),
        ("UPDATE rows SET line = 1e300 WHERE number = 3", "is damaged"),
        ("UPDATE rows SET line = x'ff00ff' WHERE number = 3", "is damaged"),
        ("CREATE TRIGGER t AFTER INSERT ON rows BEGIN DELETE FROM rows; END", "its tables are not those of a study"),
        ("ALTER TABLE rows ADD COLUMN more TEXT", "its tables are not those of a study"),
        ("DROP TABLE rows", "its tables are not those of a study"),
    ],
)
def test_changes_by_another_program_are_refused(tmp_path, statement, message):
    filled(tmp_path)
    with closing(sqlite3.connect(tmp_path / "study.db")) as connection, connection:
        connection.execute(statement)
    before = (tmp_path / "study.db").read_bytes()
    with pytest.raises(InputError, match=message) as caught:
        journal(tmp_path)
    assert "--restart" in caught.value.cure
    assert (tmp_path / "study.db").read_bytes() == before
    assert len(journal(tmp_path, restart=True).done) == 0


def test_cases_that_the_study_does_not_have_are_refused(tmp_path):
    """As where another version of a library draws other values for the same seed."""
    filled(tmp_path)
    for cases in (CASES[:59], [*CASES[:59], (0.5, "another")]):
        with pytest.raises(InputError, match="case 59 that the study does not have, or with other values"):
            journal(tmp_path, cases=cases)


# ---------------------------------------------------------------------------------------- other things in its place


def _text(place: Path, _: Path) -> None:
    place.write_text("a letter\n" * 1000)


def _empty(place: Path, _: Path) -> None:
    place.touch()


def _link(place: Path, valuable: Path) -> None:
    place.symlink_to(valuable)


def _link_to_nothing(place: Path, valuable: Path) -> None:
    place.symlink_to(valuable.with_name("nothing"))


def _folder(place: Path, _: Path) -> None:
    place.mkdir()


def _pipe(place: Path, _: Path) -> None:
    os.mkfifo(place)


def _database(place: Path, _: Path) -> None:
    with closing(sqlite3.connect(place)) as connection, connection:
        connection.execute("CREATE TABLE rows (number INTEGER PRIMARY KEY, line TEXT, crc INTEGER)")


def _another_study(place: Path, valuable: Path) -> None:
    other = valuable.parent / "other"
    other.mkdir()
    with journal(other, head={**HEAD, "base": {"list": [2]}}) as rows:
        rows.append([row(1)], CASES)
    (other / "study.db").rename(place)


@pytest.mark.skipif(sys.platform == "win32", reason="links and pipes are POSIX")
@pytest.mark.parametrize(
    "put", [_text, _empty, _link, _link_to_nothing, _folder, _pipe, _database, _another_study], ids=lambda f: f.__name__
)
@pytest.mark.parametrize("name", ["study.db", "study.db-journal", "study.db-wal"])
def test_something_else_in_its_place_is_refused_and_stays(tmp_path, put: Callable[[Path, Path], None], name):
    out, valuable = tmp_path / "out", tmp_path / "valuable.txt"
    out.mkdir()
    valuable.write_text("case,p,q,o\n1,2,3,4\n5,6")
    filled(out)
    place = out / name
    place.unlink(missing_ok=True)
    put(place, valuable)
    regular = place.is_file() and not place.is_symlink()
    before = place.read_bytes() if regular else b""
    if put is _empty and name == "study.db-journal":  # as SQLite itself leaves one
        assert len(journal(out).done) == 60
        return
    with pytest.raises(InputError) as caught:
        journal(out)
    assert caught.value.cure
    assert os.path.lexists(place)
    assert not regular or place.read_bytes() == before
    assert valuable.read_text() == "case,p,q,o\n1,2,3,4\n5,6"
    assert not (tmp_path / "nothing").exists()
    if put is _folder:
        with pytest.raises(InputError, match="cannot be written"):
            journal(out, restart=True)
    else:
        assert journal(out, restart=True).finish()["case"] == []
    assert valuable.read_text() == "case,p,q,o\n1,2,3,4\n5,6"


def test_rows_of_an_earlier_version_are_refused_and_stay(tmp_path):
    table = "case,p,q,o,status,message,seconds\n0,0.0,text,1.5,done,,0.1\n"
    (tmp_path / "study.csv").write_text(table)
    with pytest.raises(InputError, match=r"holds a study.csv without its study.db: an earlier gearfe.*--restart"):
        journal(tmp_path)
    assert (tmp_path / "study.csv").read_text() == table
    assert not (tmp_path / "study.db").exists()


@pytest.mark.parametrize("restart", [False, True])
def test_a_second_program_where_folders_have_no_locks_is_refused(tmp_path, restart):
    """SQLite's own lock, as in folders of a network."""
    first = journal(tmp_path)
    first.append([row(0)], CASES)
    with pytest.raises(InputError, match="is being written by another study"):
        journal(tmp_path, restart=restart)
    first.append([row(1)], CASES)
    assert first.finish()["case"] == ["0", "1"]


def test_a_file_system_without_locks_of_files(tmp_path, monkeypatch):
    """Some parallel ones of clusters: SQLite reports an error of input and output."""
    connected = module._connected

    class WithoutLocks(sqlite3.Connection):
        def execute(self, statement: str, *more: object) -> sqlite3.Cursor:
            if statement == "BEGIN EXCLUSIVE":
                error = sqlite3.OperationalError("disk I/O error")
                error.sqlite_errorcode = sqlite3.SQLITE_IOERR_LOCK
                raise error
            return super().execute(statement, *more)

    def connect(path: Path, how: str) -> sqlite3.Connection:
        return WithoutLocks(path, isolation_level=None) if how == "mode=rw" and path.exists() else connected(path, how)

    columns = filled(tmp_path, 20)
    monkeypatch.setattr(module, "_connected", connect)
    with journal(tmp_path) as rows:
        assert rows.cells() == columns
        rows.append(map(row, range(60)), CASES)
    assert journal(tmp_path).finish()["case"] == [str(i) for i in range(60)]


# ---------------------------------------------------------------------------------------------- workers at their start


def killed_at_start(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """The first processes of so many pools are killed as soon as they are there."""
    processes, left = run.processes, [count]

    def deadly(workers: int):
        pool = processes(workers)
        submit = pool.submit

        def submit_and_kill(*task: object):
            future = submit(*task)  # type: ignore[arg-type]
            if left[0] > 0 and task == (os.getpid,):
                left[0] -= 1
                os.kill(next(iter(pool._processes)), signal.SIGKILL)
            return future

        monkeypatch.setattr(pool, "submit", submit_and_kill)
        return pool

    monkeypatch.setattr(run, "processes", deadly)


def test_a_pool_whose_queue_is_closed_already_is_a_broken_one(monkeypatch):
    """A process that dies as another is started: the pool is not marked as broken yet, but its queue is closed."""

    def submit(self, *call, **options):
        raise errors.pop(0)

    monkeypatch.setattr(ProcessPoolExecutor, "submit", submit)
    pool = run.IsolatedPool(1)
    errors = [
        OSError("handle is closed"),
        ValueError("bad value(s) in fds_to_keep"),
        OSError(errno.EAGAIN, "no more processes"),
    ]
    for _ in range(2):
        with pytest.raises(BrokenExecutor):
            pool.submit(os.getpid)
    with pytest.raises(OSError, match="no more processes"):
        pool.submit(os.getpid)


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX")
def test_workers_that_are_killed_at_their_start_are_replaced(tmp_path, monkeypatch):
    study = read_study(written(tmp_path, cases=12))
    for name in ("one", "killed"):
        (tmp_path / name).mkdir()
    run_study(study, tmp_path / "one", jobs=1)
    killed_at_start(monkeypatch, 3)
    run_study(study, tmp_path / "killed", jobs=2)
    assert rows_of(tmp_path / "killed") == rows_of(tmp_path / "one")


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX")
def test_workers_that_are_always_killed_at_their_start_stop_the_study(tmp_path, monkeypatch):
    study = read_study(written(tmp_path, cases=12))
    killed_at_start(monkeypatch, 1000)
    with pytest.raises(InputError, match=r"killed as they begin, 5 times \(signal 9") as caught:
        run_study(study, tmp_path / "out", jobs=2)
    assert "__main__" not in str(caught.value)


# ------------------------------------------------------------------------------------------------------------- Ctrl-C


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as a signal")
def test_ctrl_c_keeps_the_cases_and_says_how_to_go_on(tmp_path):
    path, out = written(tmp_path, cases=100_000), tmp_path / "out"
    command = [sys.executable, "-m", "gearfe", "study", str(path), "--out", str(out), "--jobs", "1"]
    program = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    limit = time.monotonic() + 300.0
    while not (out / "study.csv").exists() and time.monotonic() < limit:
        time.sleep(0.02)
    program.send_signal(signal.SIGINT)
    _, said = program.communicate(timeout=300.0)
    assert program.returncode == 130
    assert "finished cases are kept in the output folder: the same command continues" in said
    assert "Traceback" not in said
    assert rows_of(out)[1:] == stored_rows(out) != []
