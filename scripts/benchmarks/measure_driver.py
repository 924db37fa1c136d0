"""What a study's driver costs: empty cases through its processes, and the time to the first answer of a fresh one.

    python scripts/benchmarks/measure_driver.py --cases 100000 --workers 2 --study geometry/relief_study.toml

Empty cases go through pool, groups and table as those of a study do. They go in groups, as cases of milliseconds do,
and alone, as cases of a second do. Told are elapsed and the driver's own processor seconds a case, how many workers one
driver keeps busy at one second a case (the inverse of its own seconds a case alone), the memory of the driver with all
rows, and the seconds from the start of a pool to its first row: of empty cases, and of the first case of a study.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gearfe.base.errors import InputError
from gearfe.study import run
from gearfe.study.case import Task
from gearfe.study.job import read_study
from gearfe.study.journal import Journal, only_writer


class Empty(Task):
    """A job that has no answer at once."""

    def tables(self, values: Sequence[Any]) -> dict[str, Any]:
        """None: the case is a row with its message."""
        raise InputError("case", values[0], "is empty", "it measures the driver")


def measured(count: int, workers: int, folder: Path) -> tuple[float, float, float]:
    """Elapsed seconds from the first row to the last, the driver's processor seconds, and seconds to the first row."""
    names = ("a", "b", "c")
    task = Empty("mechanism", Path("none"), {}, False, names, {"y": "1"}, {})
    cases = [(n, (float(n), 0.1 * n, 1.0 / (n + 1))) for n in range(count)]
    values = dict(cases)
    with only_writer(folder):
        journal = Journal(folder, {}, {}, names, ("y",))
        began, first, used = time.perf_counter(), 0.0, 0.0
        for rows in run.side_by_side(task, cases, workers):
            if not first:
                first, used = time.perf_counter(), time.process_time()
            journal.append(rows, values)
        elapsed, used = time.perf_counter() - first, time.process_time() - used
        found = journal.finish()
        assert len(found["case"]) == count
    return elapsed, used, first - began


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000, metavar="N", help="empty cases in groups")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes")
    parser.add_argument("--study", metavar="FILE", help="whose first case is timed from a fresh process")
    args = parser.parse_args()
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    for name, count, largest in (("in groups", args.cases, run.LARGEST), ("alone", args.cases, 1)):
        run.LARGEST = largest
        with tempfile.TemporaryDirectory() as folder:
            elapsed, used, first = measured(count, args.workers, Path(folder))
        told = f"{1e3 * elapsed / count:.3f} ms elapsed, {1e3 * used / count:.3f} ms of the driver a case"
        keeps = "" if largest > 1 else f"; keeps {count / used:.0f} workers busy at one second a case"
        print(f"{count} empty cases {name}: {told}{keeps}; first row after {first:.2f} s", flush=True)
    if args.study:
        study = read_study(args.study)
        began, used, took = time.perf_counter(), os.times(), 0.0
        for rows in run.side_by_side(study.task, [(0, study.cases[0])], 1):
            took = time.perf_counter() - began
            assert rows[0].status == "done", rows[0].message
        for process in multiprocessing.active_children():
            process.join()  # its processor seconds count then
        spent = sum(os.times()[:4]) - sum(used[:4])
        print(f"first row of {args.study} from a fresh process after {took:.2f} s, processor {spent:.2f} s")
    print(f"driver's memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
