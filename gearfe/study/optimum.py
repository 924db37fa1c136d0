"""Run the search of a study: its best point, the points around it within the tolerances, and their report."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..base.errors import InputError
from .parameters import Parameter
from .search import Search, Solution
from .statistics import StudyResult

#: Members of the population for each parameter at most; fewest points of differential evolution (scipy's), its share
#: of the points of a search and its generations where these allow; more tolerances than this have no worst corner.
POPULATION, FEWEST, EVOLVED, GENERATIONS, CORNERS = 8, 5, 0.6, 4, 6
#: A parameter nearer to an end than this share of its range is reported to be there.
AT_END = 1e-3

Outputs = Mapping[str, float]


@dataclass(frozen=True)
class Optimum:
    """Result of a search.

    Attributes
    ----------
    result
        All points.
    parameters
        Of the study.
    best
        The best point.
    beside
        Parameter -> outputs where it is less and where it is more by its tolerance; NaN where no job can be.
    corners
        Outputs at all corners of the tolerances.
    """

    result: StudyResult
    parameters: Sequence[Parameter]
    best: Solution
    beside: Mapping[str, tuple[Outputs, Outputs]]
    corners: Sequence[Outputs]

    def summary(self) -> dict[str, Any]:
        """Content of summary.json."""
        every = [self.best.outputs, *itertools.chain(*self.beside.values()), *self.corners]
        outputs: dict[str, Any] = {}
        for name in self.result.table.outputs:
            known = [one[name] for one in every if math.isfinite(one[name])]
            outputs[name] = {
                "base": self.result.base[name],
                "best": self.best.outputs[name],
                "less": {key: less[name] for key, (less, _) in self.beside.items()},
                "more": {key: more[name] for key, (_, more) in self.beside.items()},
                "within_tolerances": [min(known), max(known)],
            }
        return {
            "cases": len(self.result.done),
            "statuses": dict(Counter(self.result.cells["status"])),
            "best_case": self.best.case,
            "best": self.best.point,
            "at_their_ends": [one.name for one in self.parameters if _at_end(one, self.best.point[one.name])],
            "outputs": outputs,
            "seconds_of_all_cases": float(sum(float(cell) for cell in self.result.cells["seconds"])),
        }


def _at_end(one: Parameter, value: float) -> bool:
    low, high = one.ends
    return min(value - low, high - value) < AT_END * (high - low)


def report_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lines for the terminal, of the summary of an `Optimum`."""
    values = ", ".join(f"{name} = {value:.4g}" for name, value in summary["best"].items())
    lines = [f"best of {summary['cases']} points, case {summary['best_case']}: {values}"]
    for name, one in summary["outputs"].items():
        low, high = one["within_tolerances"]
        within = f", {low:.4g} to {high:.4g} within the tolerances" if one["less"] else ""
        lines.append(f"{name}: {one['best']:.4g}, base {one['base']:.4g}{within}")
        for key, less in one["less"].items():
            lines.append(f"  {key} less by its tolerance {less:.4g}, more {one['more'][key]:.4g}")
    if summary["at_their_ends"]:
        ends = ", ".join(summary["at_their_ends"])
        lines.append(f"at an end of its range: {ends}; a wider one may hold a better point")
    return lines


def interrupted_line(search: Search) -> str:
    """Return the best point so far of an interrupted search."""
    best = search.best()
    if best is None:
        return f"none of {len(search)} points so far has an answer within the limits"
    cells = ", ".join(f"{name} = {value:.6g}" for name, value in (best.point | best.outputs).items())
    return f"best of {len(search)} points so far, case {best.case}: {cells}"


def optimum(search: Search) -> Optimum:
    """Differential evolution comes first, then the Nelder-Mead method from the best of its points, then the points
    within the tolerances. Together they are at most the study's `cases`, unless these are too few for the first
    population.

    Raises
    ------
    InputError
        Where no point has an answer within the limits.
    """
    table, parameters = search.study.table, search.study.parameters
    distributions = {one.name: one.distribution for one in parameters}
    off = {name: d.tolerance for name, d in distributions.items() if d is not None and d.tolerance > 0.0}
    units = [tuple(sign * (i == k) for i in range(len(off))) for k in range(len(off)) for sign in (-1, 1)]
    corners = list(itertools.product((-1, 1), repeat=len(off))) if 0 < len(off) <= CORNERS else []
    budget = max(FEWEST, table.cases - len(set(units) | set(corners)))
    d, evolved = len(parameters), EVOLVED * budget
    population = max(math.ceil(FEWEST / d), min(POPULATION, int(evolved / (GENERATIONS * d))))
    rounds = max(0, int(evolved / (population * d)) - 1)
    search.evolve(rounds=rounds, population=population, seed=table.seed)
    best = search.refine(budget - search.asked)
    if best is None:
        problem = "has no point with an answer within the limits" + search.first_problem()
        raise InputError("study", search.study.path.name, problem, "change ends or limits; the points are kept")

    def moved(signs: Sequence[int]) -> dict[str, Any]:
        ends = {name: best.point[name] + s * size for s, (name, size) in zip(signs, off.items(), strict=True)}
        return {**best.point, **ends}

    corner_outputs = search.solve([moved(signs) for signs in (*units, *corners)])
    pairs = list(zip(corner_outputs[0 : len(units) : 2], corner_outputs[1 : len(units) : 2], strict=True))
    beside = dict(zip(off, pairs, strict=True))
    return Optimum(search.result(), parameters, best, beside, corner_outputs[len(units) :])
