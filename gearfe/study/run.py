"""Run the cases of a study in this process, on processes or on any executor, and return them in groups.

Groups take about `GROUP_SECONDS`, so that handing over and storing cost little; a kill loses no more than that. The
cases of groups that never return run again one by one, at most `AGAIN` times. Nothing else runs then, so the case that
ends a process is known. Processes that end as they start say nothing about cases: they are replaced. Where a case runs
changes no digit of its row.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from multiprocessing import connection, get_context, parent_process
from typing import Any

from ..base.errors import InputError
from ..base.isolation import away
from ..base.progress import one_thread
from .case import DIED, HERE, Row, Task, solve_case, solve_group

#: Seconds of a group of cases, and groups that wait for each worker.
GROUP_SECONDS, WAITING = 0.5, 2
#: How often cases run again after the worker that had them died, and processes are started in vain.
AGAIN, STARTS = 2, 5
#: Seconds to wait for the exit codes of processes that have ended.
EXIT_SECONDS = 5.0
#: Cases of a group at most, and seconds between two looks whether an executor still answers.
LARGEST, LOOK_SECONDS = 1000, 1.0

#: (number, values)
Case = tuple[int, tuple[Any, ...]]


def serially(task: Task, cases: Iterable[Case]) -> Iterator[list[Row]]:
    """Rows, one case after the other in this process."""
    rows: list[Row] = []
    with one_thread():
        begun = time.monotonic()
        for number, values in cases:
            rows.append(solve_case(task, number, values, HERE))
            if time.monotonic() - begun >= GROUP_SECONDS:
                yield rows
                rows, begun = [], time.monotonic()
    if rows:
        yield rows


def side_by_side(
    task: Task,
    cases: Iterable[Case],
    workers: int,
    executor: Executor | None = None,
    check: Callable[[], None] | None = None,
) -> Iterator[list[Row]]:
    """Yield rows in the order in which they are solved.

    Parameters
    ----------
    task : Task
        Job and outputs of the study.
    cases : iterable of (int, tuple)
        Numbers and values of the cases.
    workers
        How many processes there are.
    executor
        Where the cases run; it stays open. None: on processes of our own, and one that dies is replaced.
    check
        Function called regularly while cases run; it raises if the executor has stopped.

    Raises
    ------
    InputError
        When worker processes end before they work. That happens to a script that starts a study at import, and where
        something kills each process.
    """
    pool, begun = (executor, None) if executor is not None else _begun(workers)
    ahead = iter(cases)
    running: dict[Future[list[Row]], list[Case]] = {}
    suspects: deque[Case] = deque()
    deaths: Counter[int] = Counter()
    size, starts = 1, 0
    try:
        while True:
            alone = bool(suspects)
            lost: list[tuple[list[Case], str]] = []
            while len(running) < (1 if alone else workers * WAITING):
                group = [suspects.popleft()] if alone else list(itertools.islice(ahead, size))
                if not group:
                    break
                try:
                    running[pool.submit(solve_group, task, group)] = group
                except BrokenExecutor as error:
                    lost.append((group, str(error)))
                    break
            if not (running or lost):
                return
            look = None if check is None else LOOK_SECONDS
            ended = wait(running, look, FIRST_COMPLETED).done if running else ()
            if check is not None:
                check()
            arrived: list[Row] = []
            for future in ended:
                group = running.pop(future)
                try:
                    rows = future.result()
                except Exception as error:  # errors of cases are in their rows: this one is the executor's
                    lost.append((group, f"{type(error).__name__}: {error}"))
                    continue
                mean = sum(row.seconds for row in rows) / len(rows)
                size = max(1, min(LARGEST, 2 * size, int(GROUP_SECONDS / max(mean, 1e-9))))
                arrived += rows
            if arrived:  # all at once: storing costs the same for many
                yield arrived
            if lost and begun is not None:
                lost += [(group, lost[0][1]) for group in running.values()]
                running.clear()
                worked = begun.exception() is None
                starts = 0 if worked else starts + 1
                if not worked:
                    _refuse(workers, _exit_codes(pool), starts)
                    again = [case for group, _ in lost for case in group]
                    if alone:
                        suspects.extendleft(reversed(again))
                    else:
                        ahead = itertools.chain(again, ahead)
                    lost = []
                end_processes(pool)
                pool, begun = _begun(workers)
            for group, reason in lost:
                for case in group:
                    deaths[case[0]] += alone
                    if deaths[case[0]] < AGAIN:
                        suspects.append(case)
                    else:
                        yield [Row(case[0], (float("nan"),) * len(task.outputs), DIED, reason, 0.0)]
    finally:
        if executor is None:
            end_processes(pool)


class IsolatedPool(ProcessPoolExecutor):
    """Pool whose processes begin in an empty folder, so that none imports modules of the working folder.

    multiprocessing starts them by ``python -c``; once begun, they take this process's path of modules and folder.
    """

    def __init__(self, workers: int) -> None:
        folder = os.getcwd()
        with away():
            super().__init__(workers, get_context("spawn"), _begin, (folder,))

    def submit(self, *call: Any, **options: Any) -> Future[Any]:
        """Start a process where one is missing, and hand a call to one.

        Raises
        ------
        BrokenExecutor
            That is also the case where a process died so recently that only the queue is closed yet. The library then
            starts a process with the closed queue, whose error has no number of the operating system.
        """
        try:
            with away():
                return super().submit(*call, **options)
        except (OSError, ValueError) as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise
            raise BrokenExecutor("a process of the pool ended abruptly") from error


def _refuse(workers: int, codes: Sequence[int], starts: int) -> None:
    """Raise where processes that ended as they started would do so again."""
    if any(code > 0 for code in codes):  # an error of theirs; who is killed, as the pool kills the others, has signals
        cure = 'a script, which processes read again, calls it under `if __name__ == "__main__":`'
        raise InputError("jobs", workers, "makes processes that end as they begin", cure)
    if starts >= STARTS:
        signals = ", ".join(map(str, sorted({-code for code in codes}))) or "unknown"
        problem = f"makes processes that are killed as they begin, {starts} times (signal {signals})"
        raise InputError("jobs", workers, problem, "is memory short? finished rows are kept: take fewer, or 1")


def _exit_codes(pool: Any) -> list[int]:
    """End a broken pool; exit codes of its processes, negative where a signal ended them."""
    running = list((getattr(pool, "_processes", None) or {}).values())
    end_processes(pool)
    limit = time.monotonic() + EXIT_SECONDS
    while any(process.exitcode is None for process in running) and time.monotonic() < limit:
        time.sleep(0.01)  # the pool collects them
    return [process.exitcode for process in running if process.exitcode is not None]


def processes(workers: int) -> Executor:
    """Fresh processes, whatever this one has loaded; on Windows no pool has more than 61 (`concurrent.futures`)."""
    return IsolatedPool(min(workers, 61) if sys.platform == "win32" else workers)


def _begun(workers: int) -> tuple[Executor, Future[int] | None]:
    """Fresh processes, and a finished future that shows whether they begin.

    No other process starts before. The library gives a process that starts while another one dies a closed queue. Such
    a process ends with an error instead of the signal that ended the other one.
    """
    pool = processes(workers)
    begun = pool.submit(os.getpid)
    wait([begun])
    return pool, begun


def _begin(folder: str) -> None:
    """Enter the folder of the program that started this worker, ignore Ctrl-C, and end when it ends."""
    os.chdir(folder)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)


def end_processes(pool: Any) -> None:
    """End a pool without waiting for what still runs."""
    running = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in running:
        process.terminate()
