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
        Variables, torques and objective.
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
    """Search for the best choice of the variables: a map, differential evolution from its best point, Nelder-Mead.

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
    variables = problem.variables
    total = map_points ** min(2, len(variables)) + POPULATION * len(variables) * (generations + 1)
    evaluations = _Evaluations(problem, executor, progress, total)
    axes = tuple(np.linspace(v.low, v.high, map_points) for v in variables[:2])
    best, values = _best_of_map(evaluations, axes)
    value = float(values.min())
    if generations:
        best, value = _evolved(evaluations, best, value, generations, seed)
    best = _polished(evaluations, best, value)
    beside, corners = _tolerance_points(problem, best)
    absent = tuple(v.absent for v in variables)
    made = evaluations.each([best, absent, *beside, *corners], problem.evaluate)
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
        evaluations=evaluations.done,
    )


class _Evaluations:
    """Evaluations of a problem here or on an executor, counted."""

    def __init__(
        self,
        problem: ReliefProblem,
        executor: Executor | None,
        progress: Callable[[int, int, str], None] | None,
        total: int,
    ) -> None:
        self.problem, self.done = problem, 0
        self._map = map if executor is None else executor.map
        self._progress, self._total = progress, total

    def each(self, points: Iterable[Any], function: Callable[[Any], Any]) -> list[Any]:
        """What a function gives at each point, in their order."""
        made = []
        for one in self._map(function, points):
            made.append(one)
            self.done += 1
            if self._progress is not None:
                self._progress(min(self.done, self._total), self._total, "evaluations")
        return made

    def value(self, x: Array) -> float:
        """Objective at one point, here."""
        self.done += 1
        return self.problem.value(x)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest values of the variables (m)."""
        low, high = (np.array([getattr(v, end) for v in self.problem.variables]) for end in ("low", "high"))
        return low, high


def _best_of_map(evaluations: _Evaluations, axes: tuple[Array, ...]) -> tuple[Array, Array]:
    """Best point of a map over the first variables, the others in the middle of their bounds, and all objectives."""
    low, high = evaluations.bounds
    middle = 0.5 * (low + high)
    grid = [(*point, *middle[len(axes) :]) for point in itertools.product(*axes)]
    found = evaluations.each(grid, evaluations.problem.evaluate)
    values = np.array([one.value for one in found])
    if not np.isfinite(values).any():
        first = evaluations.problem.variables[0]
        reason = (
            f"no gear between the bounds is valid; the first one (SI): {found[0].problem or 'its positions failed'}"
        )
        raise InputError(first.name, (first.low, first.high), reason, "change the bounds")
    return np.array(grid[int(np.argmin(values))]), values


def _evolved(evaluations: _Evaluations, best: Array, value: float, generations: int, seed: int) -> tuple[Array, float]:
    """Best point and objective by differential evolution; at least as good as those given."""
    from scipy.optimize import differential_evolution

    searched = differential_evolution(
        evaluations.problem.value,
        list(zip(*evaluations.bounds, strict=True)),
        maxiter=generations,
        popsize=POPULATION,
        rng=np.random.default_rng(seed),
        polish=False,
        updating="deferred",
        workers=lambda function, points: evaluations.each(points, function),
        x0=best,
    )
    return (searched.x, float(searched.fun)) if searched.fun < value else (best, value)


def _polished(evaluations: _Evaluations, best: Array, value: float) -> Array:
    """Best point by Nelder's and Mead's method over the bounds scaled to 0..1; at least as good as the one given."""
    from scipy.optimize import minimize

    low, high = evaluations.bounds
    scale = high - low
    start = (best - low) / scale
    simplex = np.tile(start, (len(start) + 1, 1))
    for i in range(len(start)):
        simplex[i + 1, i] += 0.03 if start[i] < 0.5 else -0.03
    options = {"initial_simplex": simplex, "xatol": LAST_STEP, "fatol": LAST_CHANGE * value, "maxfev": 40 * len(start)}
    ended = minimize(
        lambda u: evaluations.value(low + u * scale),
        start,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(start),
        options=options,
    )
    return np.asarray(low + ended.x * scale) if ended.fun < value else best


def _tolerance_points(problem: ReliefProblem, best: Array) -> tuple[list[Array], list[Array]]:
    """Points with one variable at an end of its tolerance (low and high of the first, ...), and with all at theirs."""
    ends = np.array([v.tolerance for v in problem.variables])
    least = np.array([0.0 if v.quantity.endswith(".amount") else -math.inf for v in problem.variables])
    signs = [sign * unit for unit in np.eye(len(best)) for sign in (-1, 1)]
    corners = itertools.product((-1, 1), repeat=len(best)) if ends.any() and len(best) <= CORNERS else ()
    beside, far = ([np.maximum(best + np.array(s) * ends, least) for s in some] for some in (signs, corners))
    return beside, far
