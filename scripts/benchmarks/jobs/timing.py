"""What a piece of work costs: processor time, wall time and peak memory of this process, over several runs."""

from __future__ import annotations

import contextlib
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")


@dataclass(frozen=True)
class Cost:
    """Of one piece of work.

    Attributes
    ----------
    cpu_s, cpu_median_s, wall_s, wall_median_s
        Smallest and median of the runs (s). Processor time counts all threads of the process.
    peak_MB
        Largest resident memory during the runs, with all that the process held before (MB); nan where the system does
        not tell.
    runs
        Number of runs.
    """

    cpu_s: float
    cpu_median_s: float
    wall_s: float
    wall_median_s: float
    peak_MB: float
    runs: int

    @property
    def columns(self) -> dict[str, float]:
        """As columns of a table."""
        return {name: getattr(self, name) for name in COLUMNS}


#: Columns that `Cost` fills.
COLUMNS = ("cpu_s", "cpu_median_s", "wall_s", "wall_median_s", "peak_MB", "runs")


def measured(
    job: Callable[[], Result], *, runs: int = 3, least_s: float = 0.0, most_s: float = 20.0
) -> tuple[Result, Cost]:
    """Run `job` several times; return the last result and the cost of one run.

    Parameters
    ----------
    runs
        Least number of runs.
    least_s
        Repeat short work until so much processor time is spent (s): a clock tick is far below it.
    most_s
        No further run once so much wall time is spent (s): long work varies little, and the benchmark must end.
    """
    cpu: list[float] = []
    wall: list[float] = []
    reset_peak()
    while True:
        begin, ticks = time.perf_counter(), time.process_time()
        result = job()
        cpu.append(time.process_time() - ticks)
        wall.append(time.perf_counter() - begin)
        enough = len(cpu) >= runs and sum(cpu) >= least_s
        if enough or sum(wall) >= most_s or len(cpu) >= 1000:
            break
    cost = Cost(min(cpu), statistics.median(cpu), min(wall), statistics.median(wall), peak_megabytes(), len(cpu))
    return result, cost


def reset_peak() -> None:
    """Forget the peak of the resident memory (Linux; elsewhere the peak stays that of the whole process)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def peak_megabytes() -> float:
    """Largest resident memory since `reset_peak` (MB)."""
    try:
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return 1.024e-3 * float(line.split()[1])
    except OSError:
        pass
    try:
        import resource
    except ImportError:
        return float("nan")
    return 1.024e-3 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
