"""Job files as they should not be, and a world that does not help: what the program does to the disk.

Kinds of cases:

- *mutated* (nearly all): a job file with random mutations goes through the program in this process. Its exit code must
  be 0, 1, 2 or, where it is interrupted at its time limit, 130; nothing may be written outside of the output folder,
  no program be started, and no text of the file be run as code. An audit hook (PEP 578) watches all of that;
- *killed*: the program as a process of its own, killed at a random moment: each file in the output folder is whole, and
  a second run succeeds;
- *full*: it runs with a limit on the size of files: exit code 2 with a reason, or 0;
- *disk*: its output folder is on a mounted disk of 4 to 32 KiB, and so is the cache of every other one: the same, and
  all files or none;
- *read_only*: on a disk that is mounted to be read only: exit code 2 with a reason;
- *closed*: its output folder cannot be made or written to: exit code 2 with a reason;
- *shared*: two processes with one empty cache and one job at the same time: both tables are the same.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .campaign import Campaign, Case
from .faults import closed_run, disk_run, full_run, killed_run, read_only_run, shared_run
from .in_process import mutated_run
from .mutations import base_jobs, mutated
from .outcome import Finding

#: One in so many cases is not a mutated file.
DISTURBED = 100
RUNS: dict[str, Callable[[Case, Path], Finding]] = {
    "mutated": mutated_run,
    "killed": killed_run,
    "full": full_run,
    "disk": disk_run,
    "read_only": read_only_run,
    "closed": closed_run,
    "shared": shared_run,
}
KINDS = ("killed", "full", "closed", "disk", "read_only", "shared", "killed", "disk")


def draw(random: np.random.Generator, number: int) -> Case:
    """A mutated job; each hundredth case is a whole job in a world that does not help."""
    jobs = base_jobs()
    if number % DISTURBED:
        names = list(jobs)
        shares = np.array([jobs[name].share for name in names])
        name = names[random.choice(len(names), p=shares / shares.sum())]
        text = mutated(random, jobs[name].text, int(random.choice([1, 1, 1, 2, 3, 6])))
        data: dict[str, Any] = {"arguments": list(jobs[name].arguments), "base": name}
        command = " ".join(["gearfe", *jobs[name].arguments[:1], "job.toml --out out", *jobs[name].arguments[1:]])
        return Case(number, "mutated", {"job.toml": text}, command, data)
    kind = KINDS[(number // DISTURBED) % len(KINDS)]
    name = str(random.choice(["stiffness", "mechanism", "vibration"]))
    data = {"arguments": list(jobs[name].arguments), "base": name, "share": float(random.uniform(0.05, 1.0))}
    data |= {"bytes": int(10 ** random.uniform(0, 5.5)), "choice": int(random.integers(1 << 30))}
    return Case(number, kind, {"job.toml": jobs[name].text}, f"gearfe {name} job.toml --out out", data)


def run(case: Case, folder: Path) -> Finding:
    """Run the case by its kind."""
    return RUNS[case.kind](case, folder)


CAMPAIGN = Campaign("files", 10_000, (0, 100, 200, 300, 400, 5300, *range(1, 61)), 30.0, draw, run, long_is_bad=False)
