r"""The relief that is best for a load: bounds, several torques, one objective, and what tolerances make of it.

Minimised over the variables x within their bounds is

.. math:: f(x) = \sum_i w_i \Big(\frac{W_e\,\Delta e_i}{1\,\mathrm{um}} + \frac{W_p\,p_i}{1\,\mathrm{GPa}} +
    \frac{W_r\,\sigma_i}{100\,\mathrm{MPa}}\Big)\Big/\sum_i w_i

over the torques i: peak-to-peak loaded transmission error, largest pressure (edges included) and largest root stress.
The error is a largest less a least value, so f has edges and valleys: differential evolution searches (Storn & Price,
J. Global Optimization 11, 1997, by scipy) from a map over the first two variables on, and Nelder's and Mead's method
ends. Evaluations are independent and the same in any process, so that an executor changes no digit.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from ..shown import Shown
from ..typing import Array
from .relief_problem import Evaluation, ReliefProblem

#: Members of the population for each variable; more variables than these have no worst case over all corners.
POPULATION, CORNERS = 8, 6
#: Relative size of the steps in which the last search ends, of the bounds and of the objective.
LAST_STEP, LAST_CHANGE = 1e-4, 1e-5


@dataclass(frozen=True, repr=False)
class ReliefResult(Shown):
    """The best choice, and what is round it.

    Attributes
    ----------
    problem
        What was asked.
    x : ndarray, shape (n,)
        Values of the variables (m).
    best, without
        Evaluations there, and with the amounts of all variables 0.
    axes : tuple of ndarray
        Values of the first one or two variables in the map (m).
    map : ndarray, shape of the axes
        Objective there, the other variables at the middle of their bounds.
    low, high : ndarray, shape (n,)
        Objective where one variable is at the end of its tolerance.
    worst
        Objective at the worst corner of all tolerances.
    evaluations
        How many were made.
    """

    problem: ReliefProblem
    x: Array
    best: Evaluation
    without: Evaluation
    axes: tuple[Array, ...]
    map: Array
    low: Array
    high: Array
    worst: float
    evaluations: int

    def facts(self) -> dict[str, str]:
        """Values of the variables, objective and peak-to-peak error beside those without, evaluations."""
        peaks = [1e6 * float(max(one.peak_to_peak, default=math.nan)) for one in (self.best, self.without)]
        return {
            **{v.name: f"{1e6 * x:.4g} um" for v, x in zip(self.problem.variables, self.x, strict=True)},
            "objective": f"{self.best.value:.4g}, without {self.without.value:.4g}",
            "transmission error": f"peak to peak {peaks[0]:.3g} um, without {peaks[1]:.3g} um",
            "evaluations": str(self.evaluations),
        }


def optimise_relief(
    problem: ReliefProblem,
    *,
    map_points: int = 9,
    generations: int = 8,
    seed: int = 1,
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> ReliefResult:
    """Search for the best choice of the variables.

    Parameters
    ----------
    map_points
        Values of each of the first two variables in the map.
    generations
        Most generations of differential evolution.
    seed
        Its seed.
    executor
        Where evaluations run side by side; None: here, one after the other. The result is the same, bit for bit.
    progress
        Called with evaluations done, about how many there are, and a name.

    Raises
    ------
    InputError
        Where the bounds contain no valid gear.
    """
    from scipy.optimize import differential_evolution, minimize

    variables = problem.variables
    low, high = (np.array([getattr(v, end) for v in variables]) for end in ("low", "high"))
    size = POPULATION * len(variables)
    total = map_points ** min(2, len(variables)) + size * (generations + 1)
    done = 0

    def each(points: Iterable[Any], function: Callable[[Any], Any]) -> list[Any]:
        nonlocal done
        made = []
        for one in (map if executor is None else executor.map)(function, points):
            made.append(one)
            done += 1
            if progress is not None:
                progress(min(done, total), total, "evaluations")
        return made

    axes = tuple(np.linspace(v.low, v.high, map_points) for v in variables[:2])
    middle = 0.5 * (low + high)
    grid = [(*point, *middle[len(axes) :]) for point in itertools.product(*axes)]
    found = each(grid, problem.evaluate)
    values = np.array([one.value for one in found])
    if not np.isfinite(values).any():
        name = variables[0].name
        reason = (
            f"no gear between the bounds is valid; the first one (SI): {found[0].problem or 'its positions failed'}"
        )
        raise InputError(name, (variables[0].low, variables[0].high), reason, "change the bounds")
    first = np.array(grid[int(np.argmin(values))])
    best, value = first, float(values.min())
    if generations:
        searched = differential_evolution(
            problem.value,
            list(zip(low, high, strict=True)),
            maxiter=generations,
            popsize=POPULATION,
            rng=np.random.default_rng(seed),
            polish=False,
            updating="deferred",
            workers=lambda function, points: each(points, function),
            x0=first,
        )
        if searched.fun < value:
            best, value = searched.x, float(searched.fun)
    scale = high - low

    def scaled(u: Array) -> float:
        nonlocal done
        done += 1
        return problem.value(low + u * scale)

    start = (best - low) / scale
    simplex = np.tile(start, (len(start) + 1, 1))
    for i in range(len(start)):
        simplex[i + 1, i] += 0.03 if start[i] < 0.5 else -0.03
    ended = minimize(
        scaled,
        start,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(start),
        options={
            "initial_simplex": simplex,
            "xatol": LAST_STEP,
            "fatol": LAST_CHANGE * value,
            "maxfev": 40 * len(start),
        },
    )
    if ended.fun < value:
        best = low + ended.x * scale
    ends = np.array([v.tolerance for v in variables])
    least = np.array([0.0 if v.quantity.endswith(".amount") else -math.inf for v in variables])
    beside = [
        np.maximum(best + sign * np.eye(len(best))[i] * ends, least) for i in range(len(best)) for sign in (-1, 1)
    ]
    corners = []
    if ends.any() and len(best) <= CORNERS:
        corners = [
            np.maximum(best + np.array(signs) * ends, least) for signs in itertools.product((-1, 1), repeat=len(best))
        ]
    base = tuple(v.absent for v in variables)
    made = each([best, base, *beside, *corners], problem.evaluate)
    around = np.array([one.value for one in made[2 : 2 + len(beside)]]).reshape(-1, 2)
    return ReliefResult(
        problem=problem,
        x=best,
        best=made[0],
        without=made[1],
        axes=axes,
        map=values.reshape([len(axis) for axis in axes]),
        low=around[:, 0],
        high=around[:, 1],
        worst=max((one.value for one in made[2:]), default=made[0].value),
        evaluations=done,
    )
