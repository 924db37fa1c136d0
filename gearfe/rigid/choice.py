"""Choosing among integrators by predicted seconds, and changing over when a prediction proves wrong.

A way to integrate tells its progress after every few steps. What it has left takes, at the pace of its last steps,

    seconds left = (end - t) * (processor seconds) / (time passed in the motion).

The first way begins. As soon as its pace is known (its steps no longer grow from the first one, or have cost `EARLY` of
what they have left), others are tried by real steps from the same start. A trial is won
when it has clearly less left than the first, and then is the run. It is lost when it has spent `SHARE` of what the
first has left, or from `EARLY` on when its pace is slower and its steps do not grow: those of an implicit method grow
as fast motions decay, so that its pace at first says too little. When a run takes `WRONG` times what was predicted,
others are tried again from the state reached. A way that is stuck may have one that goes on. The whole so costs at most
about twice what the best way takes.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..progress import SILENT, count, say
from ..typing import Array
from .dense import Dense, Joined
from .start import Start
from .steps import Status, Watch

#: A trial may cost this part of what the running way has left: with less, one that is lost might have been the best.
SHARE, EARLY = 0.75, 0.1
#: How many times faster a way must be to take over (clocks are noisy); how many times its prediction a run may take.
FASTER, WRONG = 1.5, 2.0
#: The shortest trial must cost less than this part of what the running way has left.
WORTH = 0.2
#: Steps do not grow when those of the second half are no longer than this many times those of the first.
GROWTH = 1.2
#: Steps after which a pace counts: the first ones grow from a careful guess, by a factor of five or six each.
LEAST_STEPS = 8
#: The last steps that make the pace: this part of all.
RECENT = 8
#: A motion exp(-r t) gives a series steps r h = (tolerance n!)^(1/n) = 3 or so, with orders n of 18 to 26; steps of
#: half of that are set by it, shorter ones by the motion of the mechanism.
STIFF = 1.5
#: A way that ends so may be followed by another.
STUCK = (Status.STEP_TOO_SMALL,)
#: Statistics that add up.
SUMS = ("steps", "evaluations", "orders", "newton_iterations", "rejected")
#: Processor seconds; Windows counts those of a thread by sixty-fourths of a second, so there it is the time elapsed.
SECONDS = time.perf_counter if sys.platform == "win32" else time.thread_time
#: ``run(start, times, most, watch)`` -> dense output, status, statistics.
Run = Callable[[Start, Array, int, Watch | None], tuple[Dense, Status, dict[str, Any]]]


@dataclass(frozen=True)
class Way:
    """One way to integrate a system.

    Parameters
    ----------
    method, backend
        Their names.
    run
        Does it, see `Run`.
    trial
        Seconds of the shortest trial that tells something.
    loading
        Seconds before its first step, for a way that is known to be `ratio` times as fast as another backend of its
        method: that one's pace tells its own, without a trial.
    rate
        Fastest rate (1/s) of springs and dampers in a state, for a way that follows the motion less well: it is tried
        only where this rate sets the steps of the running one (`STIFF`).
    cure
        What would make it faster, told beside its prediction.
    """

    method: str
    backend: str
    run: Run
    trial: float = 0.0
    loading: float = 0.0
    ratio: float = 1.0
    rate: Callable[[Start], float] | None = None
    instead: Way | None = None
    cure: str = ""

    @property
    def name(self) -> str:
        """Method and backend."""
        return f"{self.method} ({self.backend})" if self.backend else self.method


@dataclass(frozen=True)
class Leg:
    """What one way did of a run: predicted seconds (None for a run that ended before there was a pace), real ones."""

    way: Way
    dense: Dense
    status: Status
    statistics: Mapping[str, Any]
    predicted: float | None
    seconds: float


class Pace:
    """Seconds that a run has spent and has left, from when it told of its progress."""

    def __init__(self, end: float, clock: Callable[[], float]) -> None:
        self.end, self.clock = end, clock
        self.reports: list[tuple[float, float]] = []
        self.steps: list[int] = []
        self.away = 0.0  # seconds that others took meanwhile

    def at(self, t: float, steps: int) -> tuple[float, float]:
        """(seconds spent, seconds left) at the time t of the motion, after so many steps."""
        now = self.clock() - self.away
        if not self.reports or t != self.reports[-1][1]:  # else the step was not accepted
            self.reports.append((now, t))
            self.steps.append(steps)
        then = self.reports[-1 - min(len(self.reports) - 1, max(1, len(self.reports) // RECENT))]
        passed = abs(t - then[1])
        left = (now - then[0]) * abs(self.end - t) / passed if passed > 0.0 else math.inf
        return now - self.reports[0][0], left

    @property
    def shortest(self) -> float:
        """Seconds of the shortest run: twice the steps after which a pace counts (the first may have loaded things)."""
        steps = len(self.reports) - 2
        return 2 * LEAST_STEPS * (self.reports[-1][0] - self.reports[1][0]) / steps if steps > 0 else 0.0

    @property
    def grows(self) -> bool:
        """Whether the steps in the second half of the progress told are longer than those in the first."""
        first, middle, last = ((self.reports[k][1], self.steps[k]) for k in (0, len(self.steps) // 2, -1))
        early, late = ((abs(b[0] - a[0]) / max(1, b[1] - a[1])) for a, b in ((first, middle), (middle, last)))
        return last[1] < 2 * LEAST_STEPS or late > GROWTH * early


class Choice:
    """A run by the ways that are predicted to be the fastest.

    Parameters
    ----------
    ways
        Those that can do it, the one to begin with first.
    start, times
        Where it begins, and asked times; the last is the end.
    most
        Largest number of steps.
    clock
        Seconds of processor time.
    """

    def __init__(
        self,
        ways: Sequence[Way],
        start: Start,
        times: Array,
        *,
        most: int = 1_000_000,
        clock: Callable[[], float] = SECONDS,
    ) -> None:
        self.ways, self.start, self.times, self.most = tuple(ways), start, times, most
        self.clock = clock

    def run(self) -> list[Leg]:
        """The legs from the start to the end; `said` holds what was said about the choice."""
        self.said: list[str] = []
        legs = self._legs(self.ways[0], self.start, 0)
        assert legs is not None
        return legs

    def _legs(
        self, way: Way, start: Start, used: int, *, trial: float | None = None, predicted: float | None = None
    ) -> list[Leg] | None:
        """Legs from `start` on, the first by `way`; None for a trial lost against a way with `trial` seconds left."""
        pace = Pace(float(self.times[-1]), self.clock)
        lost = whole = shown = False  # whole: others did all of it
        rest: list[Leg] | None = None

        def watch(t: float, steps: int, state: Callable[[], tuple[Array, Array]]) -> bool:
            nonlocal trial, lost, predicted, rest, whole, shown
            elapsed, left = pace.at(t, steps)
            count(abs(t - self.start.time), abs(float(self.times[-1]) - self.start.time), way.method)
            if trial is None and not shown and min(elapsed, left) > SILENT:
                shown = True
                say(f"method {way.name}: about {left:.2g} s left{way.cure and '; '}{way.cure}")
            if trial is not None:
                if left * FASTER < trial:
                    trial, predicted = None, elapsed + left
                    self._say(way, left, start.time)
                    return True
                lost = max(elapsed, pace.shortest) > SHARE * trial or (elapsed > EARLY * trial and not pace.grows)
                return not lost
            if steps < LEAST_STEPS or (predicted is not None and elapsed + left <= WRONG * predicted):
                return True
            if predicted is None and pace.grows and elapsed < EARLY * left:
                return True  # a first step guessed with care says too little
            whole = predicted is None and start is self.start
            predicted = elapsed + left
            before = self.clock()
            q, v = state()
            here = start if whole else replace(start, time=float(t), q=q.copy(), v=v.copy())
            rest = self._better(way, left, here, abs(t - start.time) / steps, used if whole else used + steps)
            pace.away += self.clock() - before
            return rest is None

        sign = math.copysign(1.0, self.times[-1] - start.time)
        ahead = self.times if start is self.start else self.times[sign * self.times > sign * start.time]
        dense, status, statistics = way.run(start, ahead, self.most - used, watch)
        if trial is not None and (lost or status != Status.DONE):
            return None
        began = pace.reports[0][0] if pace.reports else self.clock()
        own = Leg(way, dense, status, statistics, predicted, self.clock() - pace.away - began)
        if rest is None and status in STUCK and way.instead is not None:
            t = np.array([dense.times[-1]])
            here = start if len(dense.times) < 2 else replace(start, time=t[0], q=dense(t, 0)[0], v=dense(t, 1)[0])
            return [own, *(self._legs(way.instead, here, used + len(dense.times) - 1) or [])]
        if rest is None:
            return [own]
        return rest if whole else [own, *rest]

    def _better(self, way: Way, left: float, here: Start, step: float, used: int) -> list[Leg] | None:
        """Legs of a way that takes over at `here` from one with so many seconds left; None when none is faster."""
        known = [w for w in self.ways if w.method == way.method and w.ratio > way.ratio]
        seconds = [w.loading + left * way.ratio / w.ratio for w in known]
        best = min([left, *seconds])
        for other in self.ways:
            if other.method != way.method and WORTH * best > other.trial:
                if other.rate is not None and other.rate(here) * step < STIFF:
                    continue
                made = self._legs(other, here, used, trial=best)
                if made is not None:
                    return made
        if best == left:
            if here is self.start:
                self._say(way, left, here.time)
            return None
        other = known[seconds.index(best)]
        self._say(other, best, here.time)
        return self._legs(other, here, used, predicted=best)

    def _say(self, way: Way, seconds: float, t: float) -> None:
        where = "" if t == self.start.time else f" from {t:.6g} s on"
        self.said.append(f"method {way.name}{where}: about {seconds:.2g} s")


def joined(legs: Sequence[Leg]) -> Dense:
    """Dense output of all legs that made a step."""
    parts: tuple[Any, ...] = tuple(leg.dense for leg in legs if len(leg.dense.times) > 1) or (legs[-1].dense,)
    if len(parts) > 1:
        return Joined(parts)
    one: Dense = parts[0]
    return one


def joined_statistics(legs: Sequence[Leg], said: Sequence[str]) -> dict[str, Any]:
    """Statistics of the last leg, with the sums over all legs, and the choice made."""
    made = dict(legs[-1].statistics)
    for leg in legs[:-1]:
        for key, value in leg.statistics.items():
            if key == "singular_passages":
                made[key] = np.concatenate([value, made.get(key, np.zeros(0))])
            elif key in SUMS:
                made[key] = made.get(key, 0) + value
    reports = [
        {
            "method": leg.way.name,
            "until_s": float(leg.dense.times[-1]),
            "predicted_s": leg.predicted,
            "took_s": leg.seconds,
        }
        for leg in legs
    ]
    return {**made, "choice": reports, "predictions": list(said)}
