"""Where steps of a series begin and end: their length from the last terms, breaks of the forces, the end of the run.

Step length from the last two coefficients (Jorba & Zou, Exp. Math. 14 (2005) 99-117): |q_N| h^N <= tolerance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..typing import Array


class Run(NamedTuple):
    """What holds for a whole run."""

    begin: float  # (s)
    end: float
    sign: float  # of time
    order: int
    tolerance: float  # of the last terms
    longest: float  # step (s)
    breaks: Array  # times at which steps end, rising (s)
    length: float = 1.0  # that compares with 1 rad (m), where coordinates have no units of their own


def series_step(last: float, before: float, run: Run) -> float:
    """Longest step on which the last term and the one before, as coefficients, stay below the tolerance."""
    step = np.inf
    if last > 0.0:
        step = min(step, (run.tolerance / last) ** (1.0 / run.order))
    if before > 0.0:
        step = min(step, (run.tolerance / before) ** (1.0 / (run.order - 1)))
    return step


def next_goal(breaks: Array, t: float, end: float, sign: float) -> float:
    """The first break after the time t, or the end of the run."""
    count = breaks.shape[0]
    rounding = 1e-13 * max(abs(t), abs(end - t))
    low = 0
    high = count
    while low < high:
        middle = (low + high) // 2
        if sign * (breaks[middle if sign > 0.0 else count - 1 - middle] - t) <= rounding:
            low = middle + 1
        else:
            high = middle
    if low < count:
        found = breaks[low if sign > 0.0 else count - 1 - low]
        if sign * (end - found) > 0.0:
            return found
    return end


def even_step(size: float, remains: float) -> float:
    """A step of at most this size towards a goal: no short one is left before it."""
    if size >= remains:
        return remains
    return 0.5 * remains if size > 0.5 * remains else size


FUNCTIONS = (series_step, next_goal, even_step)
