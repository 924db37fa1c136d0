"""The cases of a study, one after the other, on processes, or on any executor; each finished one is handed on at once.

Cases go in groups of about `GROUP_SECONDS`, so that handing over costs little. The cases of groups that never come
back run again one by one, with nothing beside them, so that it is known whose fault a death is, `AGAIN` times at most.
Where a case runs changes no digit of its row.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from multiprocessing import connection, get_context, parent_process
from typing import Any

from ..errors import InputError
from ..isolation import away
from ..progress import one_thread
from .case import DIED, HERE, Row, Task, solve_case, solve_group

#: Seconds of a group of cases, and groups that wait for each worker.
GROUP_SECONDS, WAITING = 0.5, 2
#: How often cases run again after the worker that had them died.
AGAIN = 2
#: Cases of a group at most, and seconds between two looks whether an executor still answers.
LARGEST, LOOK_SECONDS = 1000, 1.0

#: (number, values)
Case = tuple[int, tuple[Any, ...]]


def serially(task: Task, cases: Iterable[Case]) -> Iterator[list[Row]]:
    """Rows, one case after the other in this process."""
    with one_thread():
        for number, values in cases:
            yield [solve_case(task, number, values, HERE)]


def side_by_side(
    task: Task,
    cases: Iterable[Case],
    workers: int,
    executor: Executor | None = None,
    check: Callable[[], None] | None = None,
) -> Iterator[list[Row]]:
    """Rows in the order in which they come.

    Parameters
    ----------
    workers
        How many processes there are.
    executor
        Where the cases run; it stays open. None: on processes of our own, and one that dies is replaced.
    check
        Called now and then while cases run; raises when the executor will not answer any more.

    Raises
    ------
    InputError
        When processes of our own end before they work, as those of a script do that starts a study wherever it is read.
    """
    pool, begun = (executor, None) if executor is not None else _begun(workers)
    ahead = iter(cases)
    running: dict[Future[list[Row]], list[Case]] = {}
    suspects: deque[Case] = deque()
    deaths: Counter[int] = Counter()
    size = 1
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
            for future in ended:
                group = running.pop(future)
                try:
                    rows = future.result()
                except Exception as error:  # errors of cases are in their rows: this one is the executor's
                    lost.append((group, f"{type(error).__name__}: {error}"))
                    continue
                mean = sum(row.seconds for row in rows) / len(rows)
                size = max(1, min(LARGEST, 2 * size, int(GROUP_SECONDS / max(mean, 1e-9))))
                yield rows
            if lost and begun is not None:
                if begun.exception() is not None:
                    cure = 'a script, which processes read again, calls it under `if __name__ == "__main__":`'
                    raise InputError("jobs", workers, "makes processes that end as they begin", cure)
                lost += [(group, lost[0][1]) for group in running.values()]
                running.clear()
                pool.shutdown(wait=False, cancel_futures=True)
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
        """Start a process where one is missing, and hand a call to one."""
        with away():
            return super().submit(*call, **options)


def processes(workers: int) -> Executor:
    """Fresh processes, whatever this one has loaded; on Windows no pool has more than 61 (`concurrent.futures`)."""
    return IsolatedPool(min(workers, 61) if sys.platform == "win32" else workers)


def _begun(workers: int) -> tuple[Executor, Future[int] | None]:
    """Fresh processes, and a future that shows whether they begin."""
    pool = processes(workers)
    return pool, pool.submit(os.getpid)


def _begin(folder: str) -> None:
    """Enter the folder of the program that started this worker, leave Ctrl-C to it, and end with it in any case."""
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
