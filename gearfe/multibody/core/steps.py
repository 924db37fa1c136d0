"""Control steps: lengths from errors, breaks of the forces, the end of the run, and its reason.

An integrator asks for a step, tries it, and reports the outcome:

    while (step := control.next_step()) is not None:
        ...
        if error <= 1.0: control.accept(error)      # error relative to the tolerance
        else: control.reject(error)             # or fail(status) where it has no size

An error of order h^(1/e) in the step h gives the next one h 0.9 error^-e (Hairer & Wanner II, Sec. IV.8).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ...base.progress import announce, count, duration
from ...base.typing import Array

#: Share of the step that the error allows; the least part of a step that is tried after one that was rejected.
SAFETY, LEAST = 0.9, 0.2
#: A step that ended at a break or at the end was cut: unless its error was above this share, the next is not shorter.
CUT = 0.01
#: Steps below this share of the time, or of the run's length, are rounding. (Dry friction of the width 1e-9 rad/s at a
#: node of a beam decays within 1e-16 s, and steps have to find the time at which it sticks as closely as that.)
ROUNDING = 1e-15
#: Share of a step by which it is made longer to end at a break or at the end: rounding of the time leaves no step.
STRETCH = 1e-6
#: Steps before the first look at the pace, and how many times as many are made at the next.
FIRST_LOOK, FARTHER = 512, 1.2
#: How many times the steps allowed a run may need by its pace before it stops, from the first and the second of these
#: numbers of steps on.
ENDLESS, STEADY_ENDLESS, SURE = 100.0, 3.0, (4096, 16384)


@dataclass(frozen=True)
class StepLaw:
    """Step-control parameters of a method.

    Parameters
    ----------
    exponent
        e in h ~ error^-e.
    growth
        Most times that a step may grow.
    least_error
        Below it an error is rounding.
    predictive
        Gustafsson's rule: the last two errors tell the trend.
    steady
        Steps keep their length, or halve it: changes of it give energy to vibrations that are faster than the steps.
    """

    exponent: float
    growth: float
    least_error: float
    predictive: bool = False
    steady: bool = False


class Pace:
    """The number of steps that a run needs, extrapolated from the steps so far.

    The times in which the number of steps doubles are continued as the geometric series of the last four. They double
    at a steady pace, and stay constant if a force makes the motion grow. They grow by 2**(1/p) if the number of steps
    is proportional to time to the power p. Of the ratios of successive times the largest counts. One change to shorter
    steps lowers two of the three, so neither that nor a burst of short steps ends a run.

    Parameters
    ----------
    begin, end : float
        Of the run (s).
    most : int
        Number of steps allowed.
    """

    def __init__(self, begin: float, end: float, most: int) -> None:
        self.begin, self.end, self.most = begin, end, most
        self.needed = 0.0  # steps in all; 0: not known yet
        self._marks = [(0, begin)]  # (steps, time) at numbers ever farther apart
        self._begun = time.monotonic()
        self._announced = False

    def hopeless(self, t: float, steps: int) -> bool:
        """Report the progress at time t (s) after so many steps, and whether the rest needs far too many."""
        if steps == 0:
            self._begun = time.monotonic()
        looked = steps >= FARTHER * self._marks[-1][0] and steps > 0
        if looked:
            self._marks.append((steps, t))
            self.needed = self._extrapolated(t, steps)
        count(abs(t - self.begin), abs(self.end - self.begin), steps=(steps, min(self.needed, float(self.most))))
        if not looked or self.needed <= self.most:
            return False
        hopeless = steps >= SURE[0] and self.needed > (ENDLESS if steps < SURE[1] else STEADY_ENDLESS) * self.most
        if not (hopeless or self._announced) and steps >= SURE[0]:
            self._announced = True
            each = (time.monotonic() - self._begun) / steps
            needs = f"{self.needed:.1g} steps, {duration(each * self.needed)}"
            stops = f"{self.most:.1g} steps, {duration(each * self.most)}"
            announce(f"at this pace the run would need {needs}; it stops after {stops}")
        return hopeless

    def _extrapolated(self, t: float, steps: int) -> float:
        """Steps that the run needs in all; 0 where too few are made to tell."""
        if steps < FIRST_LOOK:
            return 0.0
        counts, times = zip(*self._marks, strict=True)
        at = np.interp(steps / 2.0 ** np.arange(4, -1, -1), counts, times)
        took = np.maximum(np.abs(np.diff(at)), 1e-300)
        ratio, left = float((took[1:] / took[:-1]).max()), abs(self.end - t)
        if abs(ratio - 1.0) < 1e-6:
            doublings = left / took[-1]
        else:
            inside = 1.0 + left * (ratio - 1.0) / (took[-1] * ratio)
            doublings = math.log(inside) / math.log(ratio) if inside > 0.0 else math.inf
        return float(steps * 2.0 ** min(doublings, 1000.0))


class StepControl:
    """The steps of one run.

    Parameters
    ----------
    law
        Of the method.
    span : (float, float)
        Begin and end (s).
    first
        First trial step (s), > 0.
    breaks
        Times at which forces are not smooth: steps end there.
    longest
        Longest step (s).
    pace
        Bounds the number of steps and reports it.
    """

    def __init__(
        self,
        law: StepLaw,
        span: tuple[float, float],
        first: float,
        *,
        breaks: Array,
        longest: float = math.inf,
        pace: Pace | None = None,
    ) -> None:
        self.law, self.longest, self.pace = law, longest, pace
        self.t, self.end = span
        self.sign = 1.0 if self.end >= self.t else -1.0
        self.span = abs(self.end - self.t)
        inside = (float(b) for b in breaks if self.sign * (b - self.t) > 0 and self.sign * (self.end - b) > 0)
        self.goals = [*sorted(inside, key=lambda b: self.sign * b), self.end]
        self.trial = first
        self.status = Status.DONE
        self.accepted = self.rejected = 0
        self._step, self._cut, self._before = 0.0, False, 0.0
        self._added = False  # whether the first goal is one of `end_at`

    def next_step(self) -> float | None:
        """The next step to try, with the sign of time; None when the run has ended, `status` then says why."""
        rounding = ROUNDING * max(abs(self.t), self.span)
        if self.status is not Status.DONE or self.sign * (self.end - self.t) <= rounding:
            return None
        if self.pace is not None and self.accepted >= self.pace.most:
            self.status = Status.MOST_STEPS
            return None
        if self.pace is not None and self.pace.hopeless(self.t, self.accepted):
            self.status = Status.ENDLESS
            return None
        while self.sign * (self.goals[0] - self.t) <= rounding:
            self.goals.pop(0)
            self._added = False
        left = abs(self.goals[0] - self.t)
        self._step = min(self.trial, self.longest, left)
        if left <= (1.0 + STRETCH) * self._step:
            self._step = left
        self._cut = self._step == left
        if self._step < rounding:
            self.status = Status.STEP_TOO_SMALL
            return None
        return self.sign * self._step

    def accept(self, error: float) -> float:
        """The step is made; the time reached."""
        law = self.law
        error = max(error, law.least_error)
        self.t = self.goals[0] if self._cut else self.t + self.sign * self._step
        factor = SAFETY * error**-law.exponent
        if law.predictive and self._before > 0.0:
            factor = min(factor, factor * (self._before / error) ** law.exponent)
        self._before = error
        grown = self._step * min(law.growth, max(LEAST, factor))
        if not law.steady:
            self.trial = max(self.trial, self._step) if self._cut and error <= CUT else grown
        self.accepted += 1
        return self.t

    def reject(self, error: float) -> None:
        """The step is not made: its error is above 1."""
        self.rejected += 1
        self.trial = self._step * (0.5 if self.law.steady else max(LEAST, SAFETY * error**-self.law.exponent))

    def end_at(self, t: float) -> None:
        """The step is not made: one that ends at the time t, within it, is next."""
        self.rejected += 1
        if self._added:
            self.goals.pop(0)
        self.goals.insert(0, t)
        self._added, self.trial = True, self._step

    def fail(self, status: Status, share: float = LEAST) -> None:
        """Reject a step without a finite error: try `share` of it next, or end the run with `status`."""
        self.rejected += 1
        self.trial = (0.5 if self.law.steady else share) * self._step
        if self._step < ROUNDING * max(1e-300, self.span):
            self.status = status


def run_in_pieces(
    fill: Callable[[int], tuple[int, float, int]],
    begin: float,
    *,
    room: int,
    largest: int,
    pace: Pace | None = None,
    stiff: Callable[[float, float], bool] | None = None,
) -> tuple[Status, int]:
    """A compiled loop by pieces of its output; (why it ended, number of steps).

    Parameters
    ----------
    fill
        Goes on by at most so many steps and keeps its output; (status, time reached, steps made).
    begin
        Time at the begin (s).
    room, largest
        Steps of the first piece; the next ones have twice as many, up to this.
    pace
        Bounds the number of steps and reports it, between two pieces.
    stiff
        Whether to end the run with `Status.STIFF`, by the time (s) and the mean step of the last piece (s).
    """
    done, before = 0, begin
    if pace is not None:
        pace.hopeless(begin, 0)
    while pace is None or done < pace.most:
        status, t, made = fill(room if pace is None else min(room, pace.most - done))
        done += made
        if status != Status.MOST_STEPS:
            return Status(status), done
        if stiff is not None and stiff(t, abs(t - before) / made):
            return Status.STIFF, done
        before = t
        if pace is not None and pace.hopeless(t, done):
            return Status.ENDLESS, done
        room = min(2 * room, max(largest, room))
    return Status.MOST_STEPS, done


def first_step(q: Array, v: Array, a: Array, span: float) -> float:
    """Return a careful first step from the state at the start.

    It is a hundredth of the time in which the speeds change by their own size. From rest it is the time in which the
    accelerations change the coordinates by 5e-9 of their size.

    Parameters
    ----------
    q, v, a : ndarray, shape (size,)
        Coordinates, velocities and accelerations, divided by the units of the coordinates.
    span : float
        Length of the run (s).

    Returns
    -------
    step : float
        Between 1e-9 and 1e-3 of the span (s).
    """
    far, speed, pull = (float(abs(x).max(initial=0.0)) for x in (q, v, a))
    guess = 1e-3 * span
    if pull > 0.0:
        guess = min(guess, max(0.01 * speed / pull, 1e-4 * math.sqrt(far / pull)))
    return max(guess, 1e-9 * span)


class Status(IntEnum):
    """Why a run ended; the compiled loops return these numbers, too."""

    DONE = 0
    STEP_TOO_SMALL = 1
    MOST_STEPS = 2
    NO_BRANCH = 3
    NOT_FINITE = 4
    NOT_SOLVED = 5
    SINGULAR_START = 6
    REDUNDANT_NOT_MET = 7
    ENDLESS = 8
    STIFF = 9

    @property
    def message(self) -> str:
        """The status in words."""
        return _MESSAGES[self]

    def __str__(self) -> str:
        return self.name.lower()


_MESSAGES = {
    Status.DONE: "done",
    Status.STEP_TOO_SMALL: "the step became too small for the tolerance",
    Status.MOST_STEPS: "the largest number of steps was reached",
    Status.NO_BRANCH: "the start is a singular position and its velocity selects no branch",
    Status.NOT_FINITE: "the state is not finite",
    Status.NOT_SOLVED: "the equations could not be solved in a step",
    Status.SINGULAR_START: "the start is next to a singular position",
    Status.ENDLESS: "the steps became so short that the rest would take more than can be made",
    Status.STIFF: "a force damps the motion so fast that it limits the steps",
    Status.REDUNDANT_NOT_MET: "constraints that were taken for redundant at the start are not met by the motion",
}
