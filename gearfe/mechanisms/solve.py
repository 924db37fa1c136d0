"""Solve a mechanism by its analysis, once or with many values of its keys, and return tables.

Results do not depend on where the cases run."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..base.config import read_toml, set_key
from ..base.errors import InputError
from ..base.progress import one_thread
from ..base.tables.mechanism import RunTable, mechanism_tables
from ..base.typing import Array
from ..multibody import Start, Trajectory, integrate
from ..multibody.core.equilibrium import Equilibrium, equilibrium
from ..multibody.core.inverse import prescribed_motion
from ..multibody.core.modes import Modes, modes
from .job import output_times
from .model import Mechanism, make_mechanism
from .rest import at_rest, mode_columns
from .results import Results, evaluate

#: Cases that travel together to a process: one takes milliseconds.
TOGETHER = 16


@dataclass(frozen=True)
class Solution:
    """Result of an analysis.

    Attributes
    ----------
    start, results, rest, modes
        The closed start; outputs and energies, of one time for a state of rest; that state; the vibrations asked for.
    """

    start: Start
    results: Results
    rest: Equilibrium | None = None
    modes: Modes | None = None

    @property
    def problem(self) -> str:
        """Why a run ended early; else empty."""
        trajectory = self.results.trajectory
        return "" if trajectory.status == 0 else trajectory.message

    def tables(self) -> dict[str, dict[str, Any]]:
        """Table -> column -> values: of the files that the command writes, the main one first."""
        time = {"time_s": self.results.trajectory.time}
        if self.rest is not None:
            rest = {"equilibrium": dict(self.results.outputs)}
            return rest if self.modes is None else {"modes": mode_columns(self.modes), **rest}
        return {"trajectory": {**time, **self.results.outputs}, "energy": {**time, **self.results.energy}}


def solve(mechanism: Mechanism) -> Solution:
    """Run the analysis of the file.

    Raises
    ------
    InputError
        What the command would refuse.
    """
    run, start = mechanism.file.run, mechanism.start()
    if run.analysis in ("equilibrium", "modes"):
        rest = equilibrium(mechanism.system, start)
        vibrations = modes(mechanism.system, start, rest, run.modes) if run.analysis == "modes" else None
        return Solution(start, evaluate(mechanism, at_rest(mechanism, start, rest)), rest, vibrations)
    return Solution(start, evaluate(mechanism, _moved(mechanism, start)))


def _moved(mechanism: Mechanism, start: Start) -> Trajectory:
    run, system = mechanism.file.run, mechanism.system
    times = output_times(run.end_s, run.step_s)
    if run.analysis == "inverse":
        return prescribed_motion(system, start, times)
    options: dict[str, Any] = {"start": start, "tolerance": mechanism.tolerance, "raise_on_failure": False}
    with np.errstate(over="ignore", invalid="ignore"):
        return integrate(system, times, method=run.method, **options)


@dataclass(frozen=True)
class Case:
    """Results of one set of values.

    Attributes
    ----------
    values
        Dotted name of a key -> its value.
    tables
        Table -> column -> values: ``trajectory`` and ``energy``, or ``equilibrium`` and ``modes``, as in the command's
        files; empty where there is no answer.
    problem
        Why there is no answer, or why a run ended early; else empty.
    """

    values: Mapping[str, Any]
    tables: Mapping[str, Mapping[str, Array]] = field(default_factory=dict, repr=False)
    problem: str = ""

    def __getitem__(self, column: str) -> Array:
        """A column of any table, the main one first."""
        for table in self.tables.values():
            if column in table:
                return table[column]
        raise KeyError(self.problem or column)


def sweep(
    file: str | Path,
    cases: Iterable[Mapping[str, Any]],
    *,
    executor: Executor | None = None,
    run: RunTable | None = None,
) -> list[Case]:
    """Solve a mechanism file with other values of its keys, ``{"bodies.rod.mass_kg": 2.5}`` for example.

    A case without an answer says why and stops nothing. Digits do not depend on where a case runs. Tables of cases that
    outlive the program, statistics and designs are what `gearfe study` is for.

    Parameters
    ----------
    file
        The mechanism file.
    cases
        Values by dotted names, case by case.
    executor
        Any of `concurrent.futures`; None: one case after the other, here.
    run
        Instead of the file's [run].
    """
    one = partial(_case, read_toml(file), Path(file), run)
    return list(map(one, cases) if executor is None else executor.map(one, list(cases), chunksize=TOGETHER))


def _case(raw: Mapping[str, Any], path: Path, run: RunTable | None, values: Mapping[str, Any]) -> Case:
    try:
        tables = copy.deepcopy(dict(raw))
        for name, value in values.items():
            set_key(tables, name, value, name)
        file = mechanism_tables(tables)
        with one_thread():
            solution = solve(make_mechanism(file if run is None else replace(file, run=run), path))
    except InputError as error:
        return Case(values, problem=str(error))
    return Case(values, solution.tables(), solution.problem)
