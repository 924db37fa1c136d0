"""A study in one process, on processes and on a local Dask cluster: seconds, ratios, and whether the rows are the same.

    python scripts/benchmarks/measure_study.py geometry/relief_study.toml --workers 2 --runs 3

The ways take turns, each in a fresh folder. Told are elapsed seconds and processor seconds of all processes that take
part (driver, workers, scheduler), the least of the runs each. Processes start within their time; the cluster is there
before, as it is for ``gearfe study --dask``. A first round warms it and is not counted.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from gearfe.study.job import Study, read_study, run_study


def processor_seconds() -> float:
    """Of this process, of those it started that live, and of those that ended."""
    import psutil

    multiprocessing.active_children()  # takes in those that ended
    living = psutil.Process().children(recursive=True)
    return sum(os.times()[:4]) + sum(sum(one.cpu_times()[:4]) for one in living)


def seconds(study: Study, **where: Any) -> tuple[float, float, list[list[str]]]:
    """Elapsed and processor seconds of all cases, and the rows without their seconds."""
    with tempfile.TemporaryDirectory() as folder:
        began, used = time.perf_counter(), processor_seconds()
        run_study(study, folder, **where)
        elapsed, used = time.perf_counter() - began, processor_seconds() - used
        with (Path(folder) / "study.csv").open(newline="", encoding="utf-8") as stream:
            return elapsed, used, [row[:-1] for row in csv.reader(stream)]


def main() -> int:
    """Measure and print; 1 when rows differ."""
    from dask.distributed import Client, LocalCluster

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", help="study file")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes, and workers of the cluster")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="how often each way runs")
    args = parser.parse_args()
    study, n, rows = read_study(args.study), args.workers, []
    spent: dict[str, list[tuple[float, float]]] = {}
    with (
        LocalCluster(n_workers=n, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        ways: dict[str, dict[str, Any]] = {
            "one process": {"jobs": 1},
            f"{n} processes": {"jobs": n},
            f"Dask, {n} workers": {"executor": client.get_executor(pure=False), "workers": n},
        }
        for run in range(args.runs + 1):
            for name, where in ways.items():
                elapsed, used, found = seconds(study, **where)
                rows.append(found)
                print(f"{run or 'first':>6}  {name:16} {elapsed:8.2f} s, processors {used:8.2f} s", flush=True)
                spent.setdefault(name, []).extend([(elapsed, used)] if run else [])
    same = all(found == rows[0] for found in rows)
    print(f"{len(study.cases)} cases; rows {'are the same' if same else 'DIFFER'} in all {len(rows)} runs")
    for what, one, many, dask in zip(
        ("elapsed", "processor"), *([min(s) for s in zip(*runs, strict=True)] for runs in spent.values()), strict=True
    ):
        share = n if what == "elapsed" else 1
        efficiency = one / share / many
        print(f"{what} seconds: efficiency of {n} processes {efficiency:.3f}, Dask over processes {dask / many:.3f}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
