r"""The search for the twist, or the approach, at which teeth carry given loads: safeguarded Newton's method.

The load T rises with the twist, from nothing at the first contact of the rigid flanks. With the deflection
:math:`\delta` beyond that, :math:`\ln\delta` is nearly straight over :math:`\ln T` for line contacts; Newton's step
there, from the load T to the goal :math:`T_0`,

.. math:: \delta^+ = \delta\,(T_0/T)^{T/(\delta\,T')},

is taken with the tangent T' where it stays between the largest twist that was too little and the smallest that was too
much; otherwise the interval is halved, or the deflection doubled while nothing has been too much yet. Curves, load maps
and mesh laws search by this; T may be a torque over a twist or a force over an approach.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray

#: Relative miss of a force from which one step leads to its approach, whose error is of the order of its square;
#: rounding of an approach (parts of the reach); most evaluations of a mesh law for it.
LAW_NEAR, LAW_ROUNDING, LAW_EVALUATIONS = 1e-8, 1e-15, 60


class Response(NamedTuple):
    """Loads at n twists and their derivatives with respect to the twist, both of shape (n,)."""

    load: Array
    tangent: Array


def newton_twist(twist: Array, first_contact: Array, response: Response, goal: Array) -> Array:
    """Return the twists of Newton's step above, shape (n,); NaN without a load.

    Parameters
    ----------
    twist, first_contact : ndarray, shape (n,)
        Twists now, and at the first contact of the rigid flanks.
    response
        Response at the twists.
    goal : ndarray, shape (n,)
        Loads, > 0.
    """
    with np.errstate(all="ignore"):
        delta = twist - first_contact
        return np.asarray(
            first_contact + delta * (goal / response.load) ** (response.load / (delta * response.tangent))
        )


def search_load(
    evaluate: Callable[[IntArray, Array], Response],
    twist: Array,
    response: Response,
    goal: Array,
    *,
    first_contact: Array,
    most: Array | float,
    near: float,
    rounding: float,
    evaluations: int,
) -> tuple[Array, Response, IntArray]:
    """Search for the twists that carry given loads, many at once.

    Parameters
    ----------
    evaluate
        ``evaluate(numbers, twists)`` gives the response of the cells of these numbers.
    twist : ndarray, shape (n,)
        First guesses.
    response
        Response there.
    goal : ndarray, shape (n,)
        Loads, > 0.
    first_contact : ndarray, shape (n,)
        Twists at the first contact of the rigid flanks.
    most
        Largest twists tried.
    near
        Relative miss of a goal that ends the search.
    rounding
        Change of the twist whose load ends the search, too.
    evaluations
        Largest number of evaluations of a cell.

    Returns
    -------
    twist, response
        Last twists, and the response there.
    missed : ndarray of int
        Numbers of the cells whose load is still off its goal. Failed cells, whose response is NaN, are not among them.
    """
    low, high = first_contact.copy(), np.full(len(goal), np.inf)
    for number in range(evaluations + 1):
        miss = response.load - goal
        missed = np.flatnonzero(np.abs(miss) > np.maximum(near * goal, np.nan_to_num(rounding * response.tangent)))
        if len(missed) == 0 or number == evaluations:
            break
        low, high = np.where(miss < 0, twist, low), np.where(miss > 0, twist, high)
        step = newton_twist(twist, first_contact, response, goal)
        with np.errstate(invalid="ignore"):
            between = np.where(np.isfinite(high), 0.5 * (low + high), np.clip(2 * twist - first_contact, twist, most))
        step = np.where((low < step) & (step < high), np.minimum(step, most), between)
        twist = twist.copy()
        twist[missed] = step[missed]
        load, tangent = response.load.copy(), response.tangent.copy()
        load[missed], tangent[missed] = evaluate(missed, twist[missed])
        response = Response(load, tangent)
    return twist, response, missed


def approach_of_force(
    evaluate: Callable[[IntArray, Array], Response], force: Array, first_contact: Array, most: Array, reach: float
) -> Array:
    """Return the approach (m) at which a mesh law carries each force; that of the first contact without one.

    Parameters
    ----------
    evaluate
        ``evaluate(numbers, approaches)`` gives force (N) and tangent (N/m) at the places of these numbers.
    force : ndarray, shape (n,)
        Mesh forces (N).
    first_contact : ndarray, shape (n,)
        Approaches (m) at which the rigid flanks touch.
    most : ndarray, shape (n,)
        Forces (N) at the end of the law.
    reach : float
        Approach beyond the first contact (m) at which the law ends.

    Raises
    ------
    InputError
        For a force beyond what the law is known for.
    """
    if (force > most).any():
        problem = f"must be <= {most.min():.6g} N"
        raise InputError("force", float(force.max()), problem, "make the law for larger torques")
    approach = first_contact.copy()
    loaded = np.flatnonzero(force > 0.0)
    first, goal = first_contact[loaded], force[loaded]

    def of_loaded(numbers: IntArray, approaches: Array) -> Response:
        return evaluate(loaded[numbers], approaches)

    guess = first + reach * goal / most[loaded]
    approaches, response, _ = search_load(
        of_loaded,
        guess,
        of_loaded(np.arange(len(loaded)), guess),
        goal,
        first_contact=first,
        most=first + reach,
        near=LAW_NEAR,
        rounding=LAW_ROUNDING * reach,
        evaluations=LAW_EVALUATIONS,
    )
    approach[loaded] = newton_twist(approaches, first, response, goal)
    return approach
