"""Expressions of the time as functions of time that the integrators can differentiate: pieces of polynomials.

A piece [a, b] has the polynomial through f at the Chebyshev points of degree `DEGREE`. It is kept where its last two
Chebyshev coefficients are rounding (`ROUNDING` times the largest value of f), and halved elsewhere (L. N. Trefethen,
Approximation Theory and Approximation Practice, SIAM 2013, chapters 4 and 8). If f or a derivative jumps, the halving
does not end. Such a motion would make a speed or an acceleration jump, and is refused.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import chebyshev

from ..base.errors import InputError
from ..base.expressions import Node, compute, quantities, without_value
from ..base.typing import Array
from ..multibody import TimeFunction, constant

#: Degree of a piece, and the size of its last coefficients that counts as rounding.
DEGREE, ROUNDING = 16, 1e-14
#: Places of a piece, beside the points, at which it is compared with the function, and how well they agree.
BETWEEN, AGREES = np.array([-0.9713, -0.6091, -0.2347, 0.1279, 0.4453, 0.8377]), 1e-12
#: Times of the run at which the pieces are compared with the function, too: a pulse shorter than that is not seen.
LOOKS = 20_001
#: Most pieces: steps end where a piece does.
MOST_PIECES = 20_000
#: Part of the run by which the function goes on after its end: steps of estimates may pass it.
BEYOND = 0.05


def time_function_of(node: Node, text: str, label: str, end: float) -> TimeFunction:
    """Return an expression of the time alone as a function of time.

    Parameters
    ----------
    node : Node
        The parsed expression.
    text, label : str
        The expression and its key, for messages.
    end : float
        End of the run (s), > 0.

    Raises
    ------
    InputError
        For an expression that has no value at some time of the run, and for one that is not smooth.
    """

    def values(times: Array) -> Array:
        return np.broadcast_to(np.asarray(compute(node, {("time", None): times}, label), dtype=float), times.shape)

    looked_at = np.linspace(0.0, end, LOOKS)
    samples = values(looked_at)
    if not np.isfinite(samples).all():
        at = float(looked_at[~np.isfinite(samples)][0])
        why = without_value(node, {("time", None): at})
        raise InputError(label, text, f"has no value at {at:.6g} s" + (f": {why}" if why else ""), "correct it")
    if not quantities(node):
        return constant(float(samples[0]))
    scale = float(np.abs(samples).max())
    points = chebyshev.chebpts1(DEGREE + 1)
    origins, rows, starts = [], [], []
    waiting = [(0.0, (1.0 + BEYOND) * end)]
    while waiting:
        first, last = waiting.pop()
        middle, half = 0.5 * (first + last), 0.5 * (last - first)
        with np.errstate(all="ignore"):
            nodal = values(middle + half * points)
        if not np.isfinite(nodal).all() and first >= end:  # beyond the run the last polynomial goes on
            continue
        coefficients = chebyshev.chebfit(points, nodal, DEGREE) if np.isfinite(nodal).all() else np.full(3, math.nan)
        slope = np.abs(chebyshev.chebval(points, chebyshev.chebder(coefficients))).max() / half
        noise = float(np.finfo(float).eps * last * slope)  # of the function, from rounding in the time
        smooth = np.abs(coefficients[-2:]).max() <= ROUNDING * scale + noise
        if smooth:  # a fast function, or a short pulse, may look smooth at few points
            held = slice(*np.searchsorted(looked_at, (first, last)).tolist())
            times = np.append(middle + half * BETWEEN, looked_at[held])
            off = np.append(values(times[: len(BETWEEN)]), samples[held])
            off = np.abs(off - chebyshev.chebval((times - middle) / half, coefficients))
            smooth = off.max() <= AGREES * scale + 10.0 * noise
        if smooth:
            starts.append(first)
            origins.append(middle)
            powers = chebyshev.cheb2poly(coefficients)
            rows.append(tuple((powers / half ** np.arange(len(powers))).tolist()))
        elif len(starts) + len(waiting) > MOST_PIECES or half < 1e-9 * end:
            problem = f"is not smooth, or too fast, near {middle:.6g} s"
            raise InputError(label, text, problem, "prescribe a motion without jumps in its derivatives")
        else:
            waiting += [(middle, last), (first, middle)]
    return TimeFunction((-math.inf, *starts[1:]), tuple(origins), tuple(rows))
