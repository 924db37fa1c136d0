"""The process that runs cases: one after the other, each interrupted at its limit, exceptions told apart."""

from __future__ import annotations

import os
import signal
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

from gearfe.base.errors import InputError, MissingLibraryError

from .campaign import Campaign, campaign_named
from .outcome import Outcome, judged

#: Seconds between the interruption of a case and the end of its process.
GRACE = 20.0
#: A case's limit is processor time, fair on a busy machine; one that waits ends after so many times as long.
WAITING = 5.0


class OverTime(BaseException):
    """The case is over its limit; not an `Exception`, so that no handler of the program under test takes it."""


def run_case(campaign: Campaign, seed: int, number: int) -> Outcome:
    """Draw and run one case in this process; the timer is not set here."""
    begin = time.perf_counter()
    case = campaign.case(seed, number)
    with tempfile.TemporaryDirectory(prefix="gearfe-stress-") as folder:
        try:
            found = campaign.run(case, Path(folder))
        except (InputError, MissingLibraryError) as error:
            return Outcome(number, case.kind, "refused", time.perf_counter() - begin, str(error))
        except OverTime:
            seconds = time.perf_counter() - begin
            said = f"not done after {campaign.seconds:g} s"
            return Outcome(number, case.kind, "hang" if campaign.long_is_bad else "limit", seconds, said)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            said = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
            return Outcome(number, case.kind, "traceback", time.perf_counter() - begin, said)
    return judged(number, case.kind, time.perf_counter() - begin, found)


def compile_series() -> None:
    """Compile the series of mechanisms with a pendulum, before any run has a limit of time."""
    from gearfe.multibody import Body, Gravity, Hinge, Linkage, System, integrate

    rod = Body("rod", 1.0, 0.1, (0.5, 0.0), (0.0, 0.0), 1.0)
    linkage = Linkage((rod,), (Hinge("rod", "ground"),), (Gravity((0.0, -9.81)),))
    integrate(System([linkage]), [0.0, 0.1], method="taylor")


def work(pipe: Any, name: str, seed: int) -> None:
    """Answer case numbers from `pipe` with rows, until None comes."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    campaign = campaign_named(name)
    if not campaign.compiles:
        os.environ["GEARFE_CACHE"] = "off"  # cases are met once

    def late(signum: int, frame: Any) -> None:
        raise OverTime

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which ends this process
    if campaign.compiles:  # an interrupted compilation would leave the compiler unusable
        run_case(campaign, seed, 0)
        compile_series()
        os.environ["GEARFE_CACHE"] = "off"  # from here on: the kernels are loaded
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, late)
        signal.signal(signal.SIGPROF, late)
    while (number := pipe.recv()) is not None:
        pipe.send(_timed(campaign, seed, number))


def _timed(campaign: Campaign, seed: int, number: int) -> Outcome:
    begin = time.perf_counter()
    try:
        if hasattr(signal, "SIGALRM"):
            signal.setitimer(signal.ITIMER_PROF, campaign.seconds)
            signal.setitimer(signal.ITIMER_REAL, WAITING * campaign.seconds)
        return run_case(campaign, seed, number)
    except OverTime:  # between the end of the case and here
        kind = campaign.case(seed, number).kind
        return Outcome(number, kind, "hang", time.perf_counter() - begin, f"not done after {campaign.seconds:g} s")
    finally:
        if hasattr(signal, "SIGALRM"):
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.setitimer(signal.ITIMER_REAL, 0.0)
