"""One mechanism with many values of its keys, side by side where an executor is given."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..config import build, read_toml, set_key
from ..errors import InputError
from ..progress import one_thread
from ..tables.mechanism import MechanismFile, RunTable
from ..typing import Array
from .model import make_mechanism
from .solve import solve

#: Cases that travel together to a process: one takes milliseconds.
TOGETHER = 16


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
        In place of the file's [run].
    """
    one = partial(_case, read_toml(file), Path(file), run)
    return list(map(one, cases) if executor is None else executor.map(one, list(cases), chunksize=TOGETHER))


def _case(raw: Mapping[str, Any], path: Path, run: RunTable | None, values: Mapping[str, Any]) -> Case:
    try:
        tables = copy.deepcopy(dict(raw))
        for name, value in values.items():
            set_key(tables, name, value, name)
        file = build(MechanismFile, tables, "")
        with one_thread():
            made = solve(make_mechanism(file if run is None else replace(file, run=run), path))
    except InputError as error:
        return Case(values, problem=str(error))
    return Case(values, made.tables(), made.problem)
