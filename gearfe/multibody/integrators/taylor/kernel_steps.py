"""Where steps of a series begin and end: their length from the last terms, breaks of the forces, the end of the run;
values in between.

Step length from the last two coefficients (Jorba & Zou, Exp. Math. 14 (2005) 99-117): |q_N| h^N <= tolerance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....typing import Array
from ...series.work_space import Run


def series_step(last: float, before: float, run: Run) -> float:
    """Longest step on which the last term and the one before, as coefficients, stay below the tolerance."""
    step = np.inf
    if last > 0.0:
        step = min(step, (run.tolerance / last) ** (1.0 / run.order))
    if before > 0.0:
        step = min(step, (run.tolerance / before) ** (1.0 / (run.order - 1)))
    return step


def next_goal(breaks: Array, t: float, end: float, sign: float) -> float:
    """Return the first break after a time, or the end of the run (s).

    Parameters
    ----------
    breaks : ndarray, shape (b,)
        Times at which steps end, rising (s).
    t : float
        Time (s).
    end : float
        End of the run (s).
    sign : float
        1 forwards in time, -1 backwards.
    """
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


class Samples(NamedTuple):
    """Where the pieces of a run are asked for, and what is found."""

    ends: Array  # (pieces + 1,) of the steps (s)
    coefficients: Array  # (pieces, orders, c)
    sign: float  # of time
    times: Array  # (t,) in order of travel (s)
    derivative: int
    out: Array  # (t, c) coordinates, or that derivative of them


def sample(samples: Samples) -> int:
    """Coordinates or a derivative of them from the series of the steps; returns 0."""
    T, C, sign, times, derivative, out = (
        samples.ends, samples.coefficients, samples.sign, samples.times, samples.derivative, samples.out,
    )  # fmt: skip
    piece = 0
    last = C.shape[0] - 1
    for i in range(times.shape[0]):
        while piece < last and sign * (times[i] - T[piece + 1]) > 0.0:
            piece += 1
        while piece > 0 and sign * (times[i] - T[piece]) < 0.0:
            piece -= 1
        h = times[i] - T[piece]
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        for j in range(C.shape[1] - 1, derivative - 1, -1):
            factor = 1.0
            for d in range(derivative):
                factor *= j - d
            for c in range(out.shape[1]):
                out[i, c] = out[i, c] * h + factor * C[piece, j, c]
    return 0


FUNCTIONS = (series_step, next_goal, even_step, sample)
