"""Points of a study for an optimiser: solved side by side, kept on disk, never solved twice.

The study says what is searched: parameters between their ends, the output in `minimise` or `maximise`, and the limits
of outputs as constraints. `Search.evolve` is scipy's differential evolution, `Search.refine` its Nelder-Mead; any other
optimiser is an `Optimiser`, with `ask` and `tell`, or calls `Search.solve` itself.
"""

from __future__ import annotations

import itertools
import math
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..base.cache import versions
from ..base.errors import InputError
from ..base.files import output_folder
from ..base.progress import count
from ..base.shown import Facts
from ..base.typing import Array
from .case import DIED, DONE, Row
from .job import Study, check_outputs, solved_rows
from .journal import Journal, cell_text, only_writer
from .run import end_processes, processes
from .statistics import StudyResult

#: A constraint's value of a point that has no answer, beyond its limit.
FAR = 1e30
#: First steps of `Search.refine` as a share of the range; a coordinate is found as well as this share of its tolerance,
#: or without one as this share of its range.
FIRST_STEP, TOLERANCE_SHARE, RANGE_SHARE = 0.03, 0.1, 1e-3

Point = Mapping[str, Any]


class Optimiser(Protocol):
    """Ask-and-tell interface of an optimiser."""

    def ask(self) -> Sequence[Point]:
        """Points to solve side by side, parameter -> value; none: it has ended."""

    def tell(self, points: Sequence[Point], outputs: Sequence[Mapping[str, float]]) -> None:
        """Outputs of these points, NaN where a point has no answer."""


@dataclass(frozen=True)
class Solution:
    """A point and its outputs; `case` is its row in the table."""

    case: int
    point: dict[str, Any]
    outputs: dict[str, float]


class Search(Facts):
    """Points of a study, each solved once.

    Use it with ``with``: its processes stay between the points of one round and the next, and end with it.

    Parameters
    ----------
    study
        Its parameters are the coordinates; its design is not used.
    folder
        Of ``study.db`` and its export ``study.csv``: an interrupted search finds its points there. None: kept in
        memory.
    jobs, executor, workers, check, restart
        As of `gearfe.study.job.run_study`.

    Raises
    ------
    InputError
        Outputs that the job does not give, a folder with another study or that another program writes.
    """

    def __init__(
        self,
        study: Study,
        folder: str | Path | None = None,
        *,
        jobs: int | None = None,
        executor: Executor | None = None,
        workers: int | None = None,
        check: Callable[[], None] | None = None,
        restart: bool = False,
    ) -> None:
        self.study, self._base = study, check_outputs(study)
        self._jobs, self._executor = jobs or os.cpu_count() or 1, executor
        self._workers, self._check = workers, check
        self._own: Executor | None = None
        self._case: dict[tuple[str, ...], int] = {}
        self._rows: list[Row] = []
        self._points: list[tuple[Any, ...]] = []
        self._asked: set[tuple[str, ...]] = set()
        self._journal: Journal | None = None
        self._held = ExitStack()
        if folder is not None:
            with ExitStack() as held:
                held.enter_context(only_writer(output_folder(folder)))
                self._journal = held.enter_context(self._known(Path(folder), restart))
                self._held = held.pop_all()

    def _known(self, folder: Path, restart: bool) -> Journal:
        """The points that stand in the folder, from now on with those of this search."""
        names, outputs = self.study.task.names, tuple(self.study.table.outputs)
        journal = Journal(folder, {**self.study.head, "search": True}, versions(), names, outputs, restart=restart)
        columns = journal.cells()
        for i, case in enumerate(columns["case"]):
            self._case[tuple(columns[name][i] for name in names)] = len(self._rows)
            outputs_of_row = tuple(float(columns[name][i]) for name in outputs)
            status, message, seconds = (columns[name][i] for name in ("status", "message", "seconds"))
            self._rows.append(Row(int(case), outputs_of_row, status, message, float(seconds)))
            self._points.append(tuple(_cell(columns[name][i]) for name in names))
        return journal

    def facts(self) -> dict[str, str]:
        """Study, parameters, outputs, points that are solved."""
        counts = Counter(row.status for row in self._rows)
        return {
            "study": self.study.path.name,
            "parameters": ", ".join(self.study.task.names),
            "outputs": ", ".join(self.study.task.outputs),
            "points": str(len(self)) + "".join(f", {count} {status}" for status, count in counts.items()),
        }

    def __enter__(self) -> Search:
        return self

    def __exit__(self, *error: Any) -> None:
        if self._own is not None:
            end_processes(self._own)
            self._own = None
        self._held.__exit__(*error)

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def asked(self) -> int:
        """Number of points that were asked for, solved now or in the folder before."""
        return len(self._asked)

    def solve(self, points: Sequence[Point]) -> list[dict[str, float]]:
        """Outputs at these points, in their order; NaN where a point has no answer.

        Raises
        ------
        InputError
            Points that do not name every parameter of the study, and no others.
        """
        names, keys, fresh = self.study.task.names, [], {}
        for point in points:
            if set(point) != set(names):
                wrong = sorted(set(point) ^ set(names))
                raise InputError("points", wrong[0], "is only in a point or only in the study", f"name {names}")
            values = tuple(_plain(point[name]) for name in names)
            key = tuple(map(cell_text, values))
            keys.append(key)
            self._asked.add(key)
            if key not in self._case and key not in fresh:
                fresh[key] = values
        if fresh:
            self._solve(fresh)
        outputs = self.study.task.outputs
        return [dict(zip(outputs, self._rows[self._case[key]].outputs, strict=True)) for key in keys]

    def _solve(self, fresh: Mapping[tuple[str, ...], tuple[Any, ...]]) -> None:
        taken = {row.case for row in self._rows}
        free = (number for number in itertools.count() if number not in taken)  # as without an interruption
        points = dict(zip(free, fresh.values(), strict=False))
        executor = self._executor
        if executor is None and self._jobs > 1:
            executor = self._own = self._own or processes(self._jobs)
        died: list[Row] = []
        task, cases = self.study.task, list(points.items())
        for rows in solved_rows(task, cases, self._jobs, executor, self._workers, self._check):
            died += [row for row in rows if row.status == DIED]
            self._keep([row for row in rows if row.status != DIED], points)
        if died and self._own is not None:  # a separate process for each shows whose fault it was
            end_processes(self._own)
            self._own = None
            again = [(row.case, points[row.case]) for row in died]
            for rows in solved_rows(task, again, self._jobs, None, None):
                self._keep(rows, points)
        else:
            self._keep(died, points)

    def _keep(self, rows: Sequence[Row], points: Mapping[int, tuple[Any, ...]]) -> None:
        """Store points that have come back."""
        if self._journal is not None:
            self._journal.append(rows, points)
        for row in rows:
            self._case[tuple(map(cell_text, points[row.case]))] = len(self._rows)
            self._rows.append(row)
            self._points.append(points[row.case])
        count(len(self), None, "points")

    def run(self, optimiser: Optimiser) -> Solution | None:
        """Ask, solve, tell, until the optimiser has no more points; then the best point."""
        while points := optimiser.ask():
            optimiser.tell(points, self.solve(points))
        return self.best()

    @property
    def aim(self) -> tuple[str, float]:
        """The one output that the study minimises or maximises, and its sign.

        Raises
        ------
        InputError
            Where there is not one.
        """
        table = self.study.table
        aims = [(name, 1.0) for name in table.minimise] + [(name, -1.0) for name in table.maximise]
        if len(aims) != 1:
            cure = "name one output in minimise or maximise; the others may have limits"
            raise InputError("study.minimise", [name for name, _ in aims], "must be one output for a search", cure)
        return aims[0]

    def best(self) -> Solution | None:
        """The best point of all that keep the limits; None where none does."""
        name, sign = self.aim
        outputs = tuple(self.study.table.outputs)
        solutions = (
            Solution(
                row.case,
                dict(zip(self.study.task.names, values, strict=True)),
                dict(zip(outputs, row.outputs, strict=True)),
            )
            for row, values in zip(self._rows, self._points, strict=True)
            if row.status == DONE
        )
        good = (one for one in solutions if math.isfinite(one.outputs[name]) and self._excess(one.outputs) <= 0.0)
        return min(good, key=lambda one: (sign * one.outputs[name], one.case), default=None)

    def _excess(self, outputs: Mapping[str, float]) -> float:
        """Return the largest violation of a limit; infinite if an output has no value."""
        worst = -math.inf
        for name, limit in self.study.table.limits.items():
            value = outputs[name]
            beyond = max(
                -math.inf if limit.high is None else value - limit.high,
                -math.inf if limit.low is None else limit.low - value,
            )
            worst = max(worst, beyond if math.isfinite(value) else math.inf)
        return worst

    def bounds(self) -> list[tuple[float, float]]:
        """Ends of the parameters.

        Raises
        ------
        InputError
            For a parameter without two ends.
        """
        return [one.ends for one in self.study.parameters]

    def _resolutions(self) -> Array:
        """Return the required resolution of each parameter, in its unit."""
        return np.array(
            [
                TOLERANCE_SHARE * d.tolerance if d is not None and d.tolerance > 0.0 else RANGE_SHARE * (high - low)
                for d, (low, high) in zip([p.distribution for p in self.study.parameters], self.bounds(), strict=True)
            ]
        )

    def evolve(self, *, rounds: int = 40, population: int = 10, seed: int = 1) -> Solution | None:
        """Search by differential evolution (Storn & Price 1997, by scipy), limits as its constraints (Lampinen 2002).

        Parameters
        ----------
        rounds
            Largest number of generations after the first population. The search ends earlier where the outputs of its
            members agree within 1 %, or their parameters within a tenth of the tolerances.
        population
            Members for each parameter.
        seed
            The same seed gives the same points: a search that was interrupted continues where it stood.

        Returns
        -------
        Solution or None
            The best point of all; None where none keeps the limits.
        """
        from scipy.optimize import NonlinearConstraint, differential_evolution

        name, sign = self.aim
        whole = [one.whole for one in self.study.parameters]

        def solved(x: Array) -> list[dict[str, float]]:
            named = (zip(self.study.task.names, row, whole, strict=True) for row in np.atleast_2d(x.T).tolist())
            return self.solve([{name: round(value) if w else value for name, value, w in row} for row in named])

        def objective(x: Array) -> Array:
            values = np.array([sign * one[name] for one in solved(x)])
            return np.where(np.isfinite(values), values, np.inf)

        def excess(x: Array) -> Array:
            return np.array([[min(self._excess(one), FAR) for one in solved(x)]])

        ends = self._resolutions()

        def agreed(intermediate_result: Any) -> bool:
            return bool((np.ptp(intermediate_result.population, axis=0) <= ends).all())

        limited = bool(self.study.table.limits)
        differential_evolution(
            objective,
            self.bounds(),
            constraints=(NonlinearConstraint(excess, -np.inf, 0.0),) if limited else (),
            maxiter=rounds,
            popsize=population,
            polish=False,
            callback=agreed,
            rng=np.random.default_rng(seed),
            integrality=whole,
            vectorized=True,
            updating="deferred",
        )
        return self.best()

    def refine(self, points: int | None = None) -> Solution | None:
        """Minimise by the Nelder-Mead method (by scipy) from the best point on.

        Whole numbers stay constant. Points beyond limits count as the worst. The method ends when its points agree
        within a tenth of the tolerances.

        Parameters
        ----------
        points
            To solve at most; None: 40 for each parameter.

        Returns
        -------
        Solution or None
            The best point of all; None where none keeps the limits.
        """
        from scipy.optimize import minimize

        begun, (name, sign) = self.best(), self.aim
        free = [one for one in self.study.parameters if not one.whole]
        most = 40 * len(free) if points is None else points
        if begun is None or not free or most < 1:
            return begun
        low, high = np.array([one.ends for one in free]).T
        unit = self._resolutions()[[not one.whole for one in self.study.parameters]]
        start = (np.array([begun.point[one.name] for one in free]) - low) / unit
        top = (high - low) / unit
        step = np.maximum(FIRST_STEP * top, 2.0)
        steps = np.where(start < 0.5 * top, step, -step)

        def objective(u: Array) -> float:
            values = dict(zip([one.name for one in free], np.clip(low + u * unit, low, high).tolist(), strict=True))
            (found,) = self.solve([begun.point if np.array_equal(u, start) else {**begun.point, **values}])
            good = math.isfinite(found[name]) and self._excess(found) <= 0.0
            return sign * found[name] if good else math.inf

        minimize(
            objective,
            start,
            method="Nelder-Mead",
            bounds=[(0.0, end) for end in top],
            options={
                "initial_simplex": np.vstack([start, start + np.diag(steps)]),
                "xatol": 1.0,
                "fatol": math.inf,  # below its tolerances, a change of the output is none that can be made
                "maxfev": most,
            },
        )
        return self.best()

    def result(self) -> StudyResult:
        """All points that stand in the folder."""
        if self._journal is None:
            raise InputError("folder", None, "is not given: the points are in memory alone", "name one to the Search")
        return StudyResult(self.study.table, self._journal.finish(), self._base)

    def first_problem(self) -> str:
        """Return the message of the first point without an answer, after a colon; empty if there is none."""
        return next((f"; the first one: {row.message}" for row in self._rows if row.message), "")


def _plain(value: Any) -> Any:
    """A number of NumPy as Python's."""
    return value.item() if isinstance(value, np.generic) else value


def _cell(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
