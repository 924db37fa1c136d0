"""Where steps begin and end: lengths from errors, breaks of the forces, the end of the run, and why it ended.

An integrator asks for a step, tries it, and tells what came of it:

    while (step := control.next_step(state)) is not None:
        ...
        if error <= 1.0: control.accept(error)      # error relative to the tolerance
        else: control.reject(error)             # or fail(status) where it has no size

An error of order h^(1/e) in the step h gives the next one h 0.9 error^-e (Hairer & Wanner II, Sec. IV.8).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from ...base.progress import announce
from ...base.typing import Array

#: ``watch(t, steps, state)``: the time reached, the steps done, and a function that gives (q, v) there; False ends the
#: run. Called once with no steps when all is loaded, then after every few steps.
Watch = Callable[[float, int, Callable[[], tuple[Array, Array]]], bool]

#: Share of the step that the error allows; the least part of a step that is tried after one that was rejected.
SAFETY, LEAST = 0.9, 0.2
#: A step that ended at a break or at the end was cut: unless its error was above this share, the next is not shorter.
CUT = 0.01
#: Steps below this share of the time, or of the run's length, are rounding; steps below the second whose errors have no
#: size end the run.
ROUNDING, NO_SIZE = 1e-14, 1e-12
#: Share of a step by which it is made longer to end at a break or at the end: rounding of the time leaves no step.
STRETCH = 1e-6
#: Steps between two looks at the pace; how many times the steps allowed a run may need by its pace before it stops.
PACE, ENDLESS = 4096, 100.0
#: How many times the steps allowed a run may need by each of so many looks in a row, none below the one before by more
#: than this factor.
STEADY_ENDLESS, AGREEING, ALIKE = 3.0, 4, 1.1
#: Steps before the first doubling of their number that counts; doublings in a row, each in at most this many times the
#: time of the last, after which the number of steps counts as growing exponentially.
FIRST_DOUBLING, DOUBLINGS, SLOWER = 512, 3, 1.05


@dataclass(frozen=True)
class StepLaw:
    """What distinguishes methods.

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

    Two rules: the pace of the last steps stays (trusted sooner where it does not improve), or the number of steps
    doubles in equal times, as where a force feeds the motion. (Where steps grow shorter by a power of the time, up to
    the fourteenth, every doubling takes longer.)

    Parameters
    ----------
    begin, end : float
        Of the run (s).
    most : int
        Number of steps allowed.
    """

    def __init__(self, begin: float, end: float, most: int) -> None:
        self.end, self.most = end, most
        self._last = begin, 0
        self._doubled = begin, FIRST_DOUBLING
        self._times: list[float] = []  # that doublings took (s)
        self._announced = False
        self._needed: list[float] = []  # steps that the run needs, by the last looks

    def hopeless(self, t: float, steps: int) -> bool:
        """Whether the rest of the run needs `ENDLESS` times the steps allowed, at time t (s) after so many steps."""
        left = abs(self.end - t)
        if steps >= 2 * self._doubled[1]:
            doublings = math.log2(steps / self._doubled[1])
            self._times.append(abs(t - self._doubled[0]) / doublings)
            self._doubled = t, steps
        elif steps >= FIRST_DOUBLING and not self._times and self._doubled[1] == FIRST_DOUBLING:
            self._doubled = (t, steps) if steps < 2 * FIRST_DOUBLING else self._doubled
        recent = self._times[-DOUBLINGS:]
        steady = len(recent) == DOUBLINGS and all(b <= SLOWER * a for a, b in itertools.pairwise(recent))
        needed = 0.0
        if steady:
            needed = steps * 2.0 ** min(left / max(recent[-1], 1e-300), 1000.0)
        if steps >= self._last[1] + PACE:
            passed = abs(t - self._last[0])
            by_pace = steps + left * (steps - self._last[1]) / max(passed, 1e-300)
            needed = max(needed, by_pace)
            self._last, self._needed = (t, steps), [*self._needed[1 - AGREEING :], by_pace]
        stays = len(self._needed) == AGREEING and all(a <= ALIKE * b for a, b in itertools.pairwise(self._needed))
        hopeless = needed > ENDLESS * self.most or (stays and min(self._needed) > STEADY_ENDLESS * self.most)
        if needed > self.most and not (hopeless or self._announced):
            self._announced = True
            announce(f"at this pace the run would need {needed:.1g} steps; it stops after {self.most:.1g}")
        return hopeless


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
    longest, most
        Longest step (s), largest number of steps.
    watch
        See `Watch`.
    """

    def __init__(
        self,
        law: StepLaw,
        span: tuple[float, float],
        first: float,
        *,
        breaks: Array,
        longest: float = math.inf,
        most: int = 1_000_000,
        watch: Watch | None = None,
    ) -> None:
        self.law, self.longest, self.most, self.watch = law, longest, most, watch
        self.t, self.end = span
        self.sign = 1.0 if self.end >= self.t else -1.0
        self.span = abs(self.end - self.t)
        inside = (float(b) for b in breaks if self.sign * (b - self.t) > 0 and self.sign * (self.end - b) > 0)
        self.goals = [*sorted(inside, key=lambda b: self.sign * b), self.end]
        self.trial = first
        self.status = Status.DONE
        self.accepted = self.rejected = 0
        self._step, self._cut, self._before = 0.0, False, 0.0
        self._pace = Pace(self.t, self.end, most)
        self._added = False  # whether the first goal is one of `end_at`

    def next_step(self, state: Callable[[], tuple[Array, Array]]) -> float | None:
        """The next step to try, with the sign of time; None when the run has ended, `status` then says why."""
        rounding = ROUNDING * max(abs(self.t), self.span)
        if self.status is not Status.DONE or self.sign * (self.end - self.t) <= rounding:
            return None
        if self.accepted >= self.most:
            self.status = Status.MOST_STEPS
            return None
        if self._pace.hopeless(self.t, self.accepted):
            self.status = Status.ENDLESS
            return None
        if self.watch is not None and not self.watch(self.t, self.accepted, state):
            self.status = Status.STOPPED
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
        """The step is not made, and its error has no size: `share` of it is next, or the run ends with `status`."""
        self.rejected += 1
        self.trial = (0.5 if self.law.steady else share) * self._step
        if self._step < NO_SIZE * max(1e-300, self.span):
            self.status = status


def run_in_pieces(
    fill: Callable[[int], tuple[int, float, int]],
    span: tuple[float, float],
    state: Callable[[], tuple[Array, Array]],
    *,
    room: int,
    largest: int,
    most: int,
    watch: Watch | None,
    stiff: Callable[[float, float, Array, Array], bool] | None = None,
) -> tuple[Status, int]:
    """A compiled loop by pieces of its output; (why it ended, number of steps).

    Parameters
    ----------
    fill
        Goes on by at most so many steps and keeps its output; (status, time reached, steps made).
    span, state
        Begin and end (s), and the state reached.
    room, largest
        Steps of the first piece; the next ones have twice as many, up to this.
    most
        Steps in all.
    watch
        See `Watch`; it looks between two pieces.
    stiff
        Whether to end the run with `Status.STIFF`, by the time (s), the mean step of the last piece (s), q and v.
    """
    done, pace, before = 0, Pace(*span, most), span[0]
    if watch is not None:
        watch(span[0], 0, state)
    while done < most:
        status, t, count = fill(min(room, most - done))
        done += count
        if status != Status.MOST_STEPS:
            return Status(status), done
        if stiff is not None and stiff(t, abs(t - before) / count, *state()):
            return Status.STIFF, done
        before = t
        if pace.hopeless(t, done):
            return Status.ENDLESS, done
        if done < most and watch is not None and not watch(t, done, state):
            return Status.STOPPED, done
        room = min(2 * room, max(largest, room))
    return Status.MOST_STEPS, done


def first_step(q: Array, v: Array, a: Array, span: float) -> float:
    """Return a careful first step from the state at the start.

    It is a hundredth of the time in which the speeds change by themselves, or the one from rest in which the
    accelerations move the coordinates by 5e-9 of themselves.

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

    STOPPED = -1
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
    Status.STOPPED: "ended by its watch",
    Status.DONE: "done",
    Status.STEP_TOO_SMALL: "the step became too small for the tolerance",
    Status.MOST_STEPS: "the largest number of steps was reached",
    Status.NO_BRANCH: "the start is a singular position and its velocity selects no branch",
    Status.NOT_FINITE: "the state is not finite",
    Status.NOT_SOLVED: "the equations could not be solved in a step",
    Status.SINGULAR_START: "the start is beside a singular position",
    Status.ENDLESS: "the steps became so short that the rest would take more than can be made",
    Status.STIFF: "a force damps the motion so fast that it limits the steps",
    Status.REDUNDANT_NOT_MET: "constraints that were taken for redundant at the start are not met by the motion",
}
