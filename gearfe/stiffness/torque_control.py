r"""The twist at which a gear pair carries a given torque: safeguarded Newton's method on many positions at once.

The torque T rises with the twist, from nothing where the rigid flanks just touch. With the deflection :math:`\delta`
beyond that, :math:`\ln\delta` is nearly straight over :math:`\ln T` for line contacts; Newton's step there,

.. math:: \delta^+ = \delta\,(T_0/T)^{T/(\delta\,T')},

is taken with the solver's own tangent T' where it stays between the largest twist that was too little and the smallest
that was too much; otherwise the interval is halved, or the deflection doubled while nothing has been too much yet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..contact.position import Positions
from ..typing import Array, IntArray

#: Rounding of the gears' angles (rad) below which no twist can be told apart.
ANGLE_ROUNDING = 2e-15
#: Solutions of a position, and failed ones among them, after which it is given up.
MAX_SOLUTIONS, MAX_FAILURES = 40, 3
#: Between a twist that is too little and one that is too much, the torque jumps past its goal where it differs by so
#: many times what the tangent has for that interval, and the interval is relatively no wider than the other number.
STEEP, JUMP = 10.0, 1e-3
#: Status of a position whose torque was not found although single solutions converged.
NOT_REACHED = "torque_not_reached"


def newton_twist(twist: Array, touching: Array, torque: Array, tangent: Array, goal: Array) -> Array:
    """Newton's step above, shape (n,) (rad); not-a-number without a torque."""
    with np.errstate(all="ignore"):
        delta = twist - touching
        return np.asarray(touching + delta * (goal / torque) ** (torque / (delta * tangent)))


def twists_for_torque(
    solve: Callable[[IntArray, Array], Positions],
    goal: Array,
    *,
    touching: Array,
    first: Array,
    most: float,
    tolerance: float = 1e-10,
) -> Positions:
    """Find the twist of each position.

    Parameters
    ----------
    solve
        ``solve(numbers, twists)`` gives the positions of these numbers.
    goal : ndarray, shape (n,)
        Torques at the wheel's hub, > 0 (N m).
    touching, first : ndarray, shape (n,)
        Twists (rad) at which the rigid flanks touch, and first guesses above them.
    most
        Largest twist tried (rad).
    tolerance
        Relative accuracy of the torque.

    Returns
    -------
    Positions
        The last solutions, with the iterations of all.
    """
    low, high, twist = touching.copy(), np.full(len(goal), np.inf), np.minimum(first, most)
    little, much = np.zeros(len(goal)), np.full(len(goal), np.nan)  # torques there
    iterations, failures = np.zeros((2, len(goal)), dtype=np.int64)
    reached = np.zeros(len(goal), dtype=bool)
    open_ = np.arange(len(goal))
    found = made = solve(open_, twist)
    for count in range(1, MAX_SOLUTIONS + 1):
        at, touch, asked = twist[open_], touching[open_], goal[open_]
        torque, tangent = made.torque_wheel, np.nan_to_num(made.tangent)
        solved, failed, clear = (made.status == s for s in ("converged", "not_converged", "no_contact"))
        iterations[open_] += made.iterations
        failures[open_] += failed
        reached[open_] = solved & (np.abs(torque - asked) <= np.maximum(tolerance * asked, ANGLE_ROUNDING * tangent))
        less = (solved | clear) & (torque < asked)
        more = np.where(failed, little[open_] > 0, solved & ~less)  # before, first guesses are low rather than high
        low[open_[less]], little[open_[less]] = at[less], torque[less]
        high[open_[more]], much[open_[more]] = at[more], torque[more]
        below, above = low[open_], high[open_]
        tried = newton_twist(at, touch, torque, tangent, asked)
        halved = np.where(np.isfinite(above), 0.5 * (below + above), 2 * at - touch)
        tried = np.where(solved & (below < tried) & (tried < above), tried, halved)
        twist[open_] = np.minimum(tried, most)
        width = np.where(np.isfinite(above), above - below, 1.0)
        jumps = (width <= JUMP * at) & ((much - little)[open_] > STEEP * tangent * width)
        narrow = width <= 1e-14 * at
        goes_on = ~reached[open_] & (solved | failed | clear) & (failures[open_] < MAX_FAILURES) & ~jumps & ~narrow
        open_ = open_[goes_on & (tried != at) & (at < most)]
        if len(open_) == 0 or count == MAX_SOLUTIONS:
            break
        made = solve(open_, twist[open_])
        found = found.replaced(open_, made)
    given_up = ~reached & np.isin(found.status, ("converged", "no_contact"))
    status = np.where(given_up, NOT_REACHED, found.status)
    return replace(found.stated(status), iterations=iterations)
