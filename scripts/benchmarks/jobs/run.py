"""All jobs of the benchmark, and the one call that runs them."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable, Sequence
from pathlib import Path

from gearfe.base.progress import one_thread

from .record import Record, open_record, told

#: Job -> module of this package; its function is called run_<job>.
JOBS = {
    "sweep": "sweep_study",
    "mechanism": "mechanism_study",
    "housing": "housing_study",
    "transient": "transient_study",
    "runup": "runup_study",
    "skipped": "skipped_study",
    "references": "reference_study",
    "cold": "cold_study",
}


def run_jobs(
    jobs: Sequence[str],
    out: str | Path,
    *,
    quick: bool = False,
    peers: bool = True,
    against: str = "",
    say: Callable[[str], None] = told,
) -> Record:
    """Run jobs, one thread each, draw the pictures; finished rows of an earlier run in `out` are kept."""
    from .pictures import draw_all

    logging.getLogger("skfem").setLevel(logging.ERROR)  # it tells about memory layouts, once a position
    record = open_record(out, quick=quick, peers=peers, against=against, say=say)
    for job in jobs:
        say(job)
        module = importlib.import_module(f".{JOBS[job]}", __package__)
        with one_thread():
            getattr(module, f"run_{job}")(record)
        draw_all(record.folder)
    return record
