"""The twist at which a gear pair carries a given torque: safeguarded Newton's method on many positions at once.

The torque rises with the twist, from nothing where the rigid flanks just touch. Newton's step with the solver's own
tangent is taken where it stays between the largest twist that was too little and the smallest that was too much;
otherwise the interval is halved, or the twist doubled while nothing has been too much yet.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.position import Position

Array = NDArray[np.float64]

#: Rounding of the gears' angles (rad) below which no twist can be told apart.
ANGLE_ROUNDING = 2e-15
#: Solutions of a position, and failed ones among them, after which it is given up.
MAX_SOLUTIONS, MAX_FAILURES = 40, 3
#: Relative width of the interval in which the torque is taken to jump past its goal.
JUMP = 1e-3
#: Between a twist that is too little and one that is too much, the torque jumps where it differs by so many times what
#: the tangent has for that interval, and the interval is no wider than `JUMP`.
STEEP = 10.0
#: Status of a position whose torque was not found although single solutions converged.
NOT_REACHED = "torque_not_reached"


class TorqueSolution(NamedTuple):
    """Twists that carry a torque.

    Attributes
    ----------
    twist : ndarray, shape (n,)
        rad.
    positions : list of Position
        Last solution of each position.
    iterations : ndarray, shape (n,)
        Newton iterations of all its solutions together.
    status : list of str
    """

    twist: Array
    positions: list[Position]
    iterations: NDArray[np.int64]
    status: list[str]


Solve = Callable[[Array, Array], list[Position]]


def twists_for_torque(
    solve: Solve, angles: Array, torque: Array, *, touching: Array, first: Array, most: float, tolerance: float = 1e-10
) -> TorqueSolution:
    """Find the twist of each position.

    Parameters
    ----------
    solve
        ``solve(angles, twists)`` gives the positions.
    angles : ndarray, shape (n,)
        Pinion angles (rad).
    torque : ndarray, shape (n,)
        Torques at the wheel's hub, > 0 (N m).
    touching, first : ndarray, shape (n,)
        Twists (rad) at which the rigid flanks touch, and first guesses above them.
    most
        Largest twist tried (rad).
    tolerance
        Relative accuracy of the torque.
    """
    low, high = touching.copy(), np.full(len(angles), np.inf)
    twist = np.minimum(first, most)
    found: list[Position | None] = [None] * len(angles)
    status = [NOT_REACHED] * len(angles)
    iterations, failures = np.zeros(len(angles), dtype=np.int64), np.zeros(len(angles), dtype=np.int64)
    below = np.zeros(len(angles), dtype=bool)
    little, much = np.full(len(angles), np.nan), np.full(len(angles), np.nan)  # torques there, as far as known
    open_ = np.arange(len(angles))
    for _ in range(MAX_SOLUTIONS):
        if len(open_) == 0:
            break
        still = []
        for i, position in zip(open_, solve(angles[open_], twist[open_]), strict=True):
            found[i] = position
            iterations[i] += position.iterations
            status[i] = NOT_REACHED if position.status in ("converged", "no_contact") else position.status
            step = 0.0
            if position.status == "converged":
                excess = position.torque_wheel - torque[i]
                if abs(excess) <= max(tolerance * torque[i], ANGLE_ROUNDING * position.tangent):
                    status[i] = "converged"
                    continue
                if excess < 0:
                    low[i], little[i] = twist[i], position.torque_wheel
                else:
                    high[i], much[i] = twist[i], position.torque_wheel
                width = high[i] - low[i]
                if width <= JUMP * high[i] and much[i] - little[i] > STEEP * position.tangent * width:
                    continue  # a corner that snaps on: no twist has this torque
                below[i] |= excess < 0
                step = -excess / position.tangent if position.tangent > 0 else 0.0
            elif position.status == "not_converged":
                failures[i] += 1
                if failures[i] == MAX_FAILURES:
                    continue
                if below[i]:
                    high[i], much[i] = twist[i], np.nan
                else:  # first guesses are low rather than high: double the twist
                    step = twist[i] - touching[i]
            elif position.status == "no_contact":
                low[i], little[i] = twist[i], np.nan
            else:
                continue
            tried = twist[i] + step
            if not low[i] < tried < high[i]:
                tried = 0.5 * (low[i] + high[i]) if np.isfinite(high[i]) else 2 * twist[i] - touching[i]
            if np.isfinite(high[i]) and high[i] - low[i] <= 1e-14 * high[i]:
                continue
            if tried == twist[i] or twist[i] >= most:
                continue
            twist[i] = min(tried, most)
            still.append(i)
        open_ = np.array(still, dtype=np.int64)
    return TorqueSolution(twist, [p for p in found if p is not None], iterations, status)
