"""Times of dense output: within the run, or an error."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .contract import Array

#: Times may lie outside of the run by so much of its length: rounding of output times.
SLACK = 1e-9


def within_run(run: Array, times: ArrayLike) -> Array:
    """The times (s), shape (n,), those outside by rounding moved to the ends.

    Parameters
    ----------
    run : ndarray, shape (steps + 1,)
        Ends of the steps (s), rising or falling.
    times
        Asked times (s).

    Raises
    ------
    InputError
        When a time lies outside: the polynomials of the steps say nothing there.
    """
    asked = np.atleast_1d(np.asarray(times, dtype=float))
    low, high = min(run[0], run[-1]), max(run[0], run[-1])
    slack = SLACK * (high - low) + 1e-12 * max(abs(low), abs(high))
    outside = ~((asked >= low - slack) & (asked <= high + slack))
    if outside.any():
        problem = f"lies outside of the run, which goes from {run[0]:.9g} to {run[-1]:.9g} s"
        cure = "ask for times within it, or integrate further"
        raise InputError("times", float(asked[np.argmax(outside)]), problem, cure)
    return np.clip(asked, low, high)
