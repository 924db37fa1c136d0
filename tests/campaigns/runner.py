"""Run a campaign: cases in a process of their own, limits of time for each and for all, results in a folder."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gearfe.base.progress import count

from .campaign import Campaign, campaign_named
from .outcome import Outcome
from .record import CampaignRecord
from .report import write_results
from .worker import GRACE, WAITING, run_case, work

#: Seconds that compiling the kernels may take, once.
COMPILE = 600.0


@dataclass(frozen=True)
class Ran:
    """What a campaign came to: its rows, how many cases were asked for, and whether the time ran out before them."""

    name: str
    outcomes: tuple[Outcome, ...]
    asked: int

    @property
    def bad(self) -> tuple[Outcome, ...]:
        """Rows that show a defect."""
        return tuple(row for row in self.outcomes if row.bad)

    @property
    def complete(self) -> bool:
        """Whether all cases were run."""
        return len(self.outcomes) >= self.asked


def run_campaign(
    name: str,
    folder: Path,
    *,
    seed: int = 1,
    cases: int | None = None,
    short: bool = False,
    seconds: float | None = None,
    apart: bool = True,
) -> Ran:
    """Run cases 0, 1, ... of a campaign; those that the folder holds already are not run again.

    Parameters
    ----------
    folder
        Takes the record, the tables and the kept cases.
    cases
        How many; None: the full form.
    short
        The short form instead.
    seconds
        Time for all; what is not begun by then is left for another run.
    apart
        Run in a process of its own, which survives crashes and ends hangs; False: in this one, without limits.
    """
    campaign = campaign_named(name)
    wanted = campaign.short if short else range(campaign.full if cases is None else cases)
    record = CampaignRecord(folder, name, seed)
    left = [number for number in wanted if number not in record.rows]
    end = None if seconds is None else time.monotonic() + seconds

    def numbers() -> Iterable[int]:
        for number in left:
            if end is not None and time.monotonic() >= end:
                return
            yield number

    bad = sum(row.bad for row in record.rows.values())
    rows = _apart(campaign, seed, numbers()) if apart else (run_case(campaign, seed, n) for n in numbers())
    try:
        for row in rows:
            record.add(row)
            bad += row.bad
            count(len(record.rows), len(wanted), f"cases, {bad} bad")
    finally:
        write_results(folder, campaign, seed, record.outcomes)
    return Ran(name, tuple(row for row in record.outcomes if row.case in wanted), len(wanted))


def _apart(campaign: Campaign, seed: int, numbers: Iterable[int]) -> Iterable[Outcome]:
    """Rows from a worker process; one that hangs or dies costs its case and is replaced."""
    worker: Any = None
    pipe: Any = None
    try:
        for number in numbers:
            patience = 2 * GRACE  # the first case also waits for the process to start and load its libraries
            if worker is None:
                worker, pipe = _worker(campaign.name, seed)
                patience += COMPILE if campaign.compiles else 0.0
            begin = time.monotonic()
            pipe.send(number)
            row = _answer(campaign, seed, number, worker, pipe, begin, patience)
            if row.outcome in ("crash", "hang"):
                _end(worker)
                worker = None
            yield row
    finally:
        if worker is not None:
            _end(worker, pipe)


def _answer(
    campaign: Campaign, seed: int, number: int, worker: Any, pipe: Any, begin: float, patience: float
) -> Outcome:
    try:
        if pipe.poll(WAITING * campaign.seconds + patience):
            made: Outcome = pipe.recv()
            return made
    except (EOFError, OSError):
        worker.join(5.0)
        kind = campaign.case(seed, number).kind
        said = f"the process ended with code {worker.exitcode}"
        return Outcome(number, kind, "crash", time.monotonic() - begin, said)
    kind = campaign.case(seed, number).kind
    said = f"not done after {WAITING * campaign.seconds:g} s, and not to be interrupted"
    return Outcome(number, kind, "hang", time.monotonic() - begin, said)


def _worker(name: str, seed: int) -> tuple[Any, Any]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    worker = context.Process(target=work, args=(theirs, name, seed), daemon=False)
    with _environment({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}):
        worker.start()
    theirs.close()
    return worker, ours


def _end(worker: Any, pipe: Any = None) -> None:
    if pipe is not None:
        try:
            pipe.send(None)
            worker.join(5.0)
        except OSError:
            pass
    if worker.is_alive():
        worker.kill()
    worker.join()


@contextmanager
def _environment(values: dict[str, str]) -> Any:
    """Environment of a child: one thread (the campaign measures times)."""
    before = {key: os.environ.get(key) for key in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for key, value in before.items():
            if value is None:
                del os.environ[key]
            else:
                os.environ[key] = value
