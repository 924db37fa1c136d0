"""A study from its file to its table: read, checked on the base job, run, resumed, summed up."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..base.cache import versions
from ..base.config import build, read_toml
from ..base.errors import InputError
from ..base.files import output_folder
from ..base.progress import count, one_thread
from ..base.tables.study import StudyTable
from .case import DIED, ERROR, HERE, INVALID, Row, Task, evaluate, files_named
from .design import Cases, study_cases
from .journal import Journal, only_writer
from .parameters import WHERE, Parameter, read_parameters
from .run import serially, side_by_side
from .statistics import StudyResult

#: A study whose first cases, so many, all have no answer is stopped.
HOPELESS = 50
#: Tables of a job that cases share much work in: those that agree in them run one after the other.
COSTLY = ("pair", "gears", "meshes", "materials", "stiffness", "housing")


@dataclass(frozen=True)
class Study:
    """A study as read.

    Attributes
    ----------
    path
        The file.
    table
        [study].
    parameters
        What is varied.
    cases
        Case by case the values of the parameters.
    task
        The base job and the outputs.
    """

    path: Path
    table: StudyTable
    parameters: tuple[Parameter, ...]
    cases: Cases
    task: Task

    @property
    def head(self) -> dict[str, Any]:
        """Return the data that determine the rows: study, base job, rows and content of the named files."""
        head: dict[str, Any] = {"study": asdict(self.table), "base": dict(self.task.raw)}
        if self.table.design == "rows":
            head["rows"] = [list(row) for row in self.cases]
        folder = self.task.path.parent
        named = files_named([self.table.parameters, head["base"], head.get("rows", [])], folder)
        contents = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in sorted(named)}
        return {**head, "files": contents}

    def evaluate(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Outputs with some parameters at these values, the others as the base job has them.

        Raises
        ------
        InputError
            What the job's command would refuse.
        """
        names = tuple(values)
        task = Task(**{**vars(self.task), "names": names})
        with one_thread():
            return evaluate(task, list(values.values()), HERE)[0]


def solved_rows(
    task: Task,
    cases: Sequence[tuple[int, tuple[Any, ...]]],
    jobs: int | None,
    executor: Executor | None,
    workers: int | None,
    check: Callable[[], None] | None = None,
) -> Iterator[list[Row]]:
    """Yield the rows of the cases from where they are to run.

    Parameters
    ----------
    task : Task
        Job and outputs of the study.
    cases : sequence of (int, tuple)
        Numbers and values of the cases.
    jobs : int or None
        Processes; None: as many as there are processors.
    executor : Executor or None
        Where the cases run instead.
    workers : int or None
        Cases that the executor runs side by side; None: its own number, else 4.
    check : callable, optional
        Function called regularly while cases run; it raises if the executor has stopped.
    """
    if executor is not None:
        return side_by_side(task, cases, workers or getattr(executor, "_max_workers", None) or 4, executor, check)
    many = min(jobs or os.cpu_count() or 1, max(1, len(cases)))
    return serially(task, cases) if many == 1 else side_by_side(task, cases, many)


def read_study(path: str | Path) -> Study:
    """Read a study and its base job, and check its parameters and outputs.

    Raises
    ------
    InputError
        For every mistake in the file that shows without solving a case.
    """
    raw = read_toml(path)
    path = Path(path)
    if "study" not in raw:
        raise InputError("[study]", None, f"is missing in {path.name}", "add a table [study]")
    table: StudyTable = build(StudyTable, raw["study"], "study")
    base = (path if table.base is None else path.parent / table.base).absolute()
    tables = {name: one for name, one in (raw if table.base is None else read_toml(base)).items() if name != "study"}
    parameters, cases = study_cases(table, path.parent, tables)
    names = tuple(one.name for one in parameters)
    also = {one.name: one.also for one in parameters}
    worst_over, least = _worst(table, parameters, tables)
    task = Task(table.job, base, tables, table.estimate, names, table.outputs, also, table.mesh, worst_over, least)
    task.expressions()
    for case in cases[:1]:
        task.tables(case)
    return Study(path, table, parameters, cases, task)


def _worst(
    table: StudyTable, varied: Sequence[Parameter], base: Mapping[str, Any]
) -> tuple[dict[str, tuple[Any, ...]], tuple[str, ...]]:
    """Values that the worst is taken over by key, and the outputs of which the least is the worst.

    Raises
    ------
    InputError
        For keys that do not exist or are varied, too, what is no list, and outputs whose worst is open.
    """
    if not table.worst_over:
        return {}, ()
    try:
        parameters = read_parameters(table.worst_over, table.job, base)
    except InputError as error:
        field = error.field.replace(f"{WHERE}.", "study.worst_over.")
        raise InputError(field, error.value, error.problem, error.cure) from None
    for one in parameters:
        if not one.values:
            raise InputError(
                f"study.worst_over.{one.name}", None, "must be a list of values", "write it as [low, high]"
            )
        for other in varied:
            for key in (other.name, *other.also):
                if f"{key}.".startswith(f"{one.name}.") or f"{one.name}.".startswith(f"{key}."):
                    problem = "is varied, too" if key == one.name else f"is varied, too, by {key}"
                    if key != other.name:
                        problem = f"is varied, too, by study.parameters.{other.name}.also"
                    raise InputError(f"study.worst_over.{one.name}", None, problem, "leave it out of the parameters")
    for name, limit in table.limits.items():
        low, high = limit.low is not None, limit.high is not None
        if low and high:
            problem = "has two limits, so its worst over other values is open"
            raise InputError(f"study.limits.{name}", [limit.low, limit.high], problem, "make an output for each limit")
        for opposite, names, limited in (("minimised", table.minimise, low), ("maximised", table.maximise, high)):
            if limited and name in names:
                problem = f"limits what is {opposite} from the other side, so its worst over other values is open"
                value = limit.low if low else limit.high
                raise InputError(
                    f"study.limits.{name}", value, problem, "make an output for the limit, another to rank"
                )
    least = [name for name, limit in table.limits.items() if limit.high is None and name not in table.minimise]
    return {one.name: tuple(one.values) for one in parameters}, (*table.maximise, *least)


def check_outputs(study: Study) -> dict[str, float]:
    """Outputs of the base job as it stands: its names are known before the cases run.

    Raises
    ------
    InputError
        What the job's command would refuse, and outputs that the job does not give.
    """
    with one_thread():
        return evaluate(Task(**{**vars(study.task), "names": ()}), (), HERE)[0]


def run_study(
    study: Study,
    folder: str | Path,
    *,
    jobs: int | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    check: Callable[[], None] | None = None,
    restart: bool = False,
) -> StudyResult:
    """Solve the cases that are missing in the folder's table; the result does not depend on where they run.

    Parameters
    ----------
    study : Study
        The study.
    folder
        Of ``study.db`` and its export ``study.csv``: a study that was interrupted continues.
    jobs
        Processes; None: as many as there are processors; 1: in this process.
    executor
        Where cases run instead: any of `concurrent.futures`, or a cluster's.
    workers
        How many cases the executor runs side by side; None: its own number, else 4.
    check
        Function called regularly while the executor works; it raises if the executor has stopped.
    restart
        Begin again, and delete earlier results in the folder.

    Raises
    ------
    InputError
        For outputs that the job does not give, and a folder with another study or in use by another program. For a
        study whose first cases all fail, or whose cases are not known beforehand.
    """
    if study.table.design == "search":
        raise InputError("study.design", "search", "has no cases beforehand", "gearfe study runs it; or gearfe.Search")
    base = check_outputs(study)
    folder = output_folder(folder)
    names = study.task.names, tuple(study.table.outputs)
    with (
        only_writer(folder),
        Journal(folder, study.head, versions(), *names, cases=study.cases, restart=restart) as journal,
    ):
        bad, first = 0, ""
        missing = [n for n in _order(study) if n not in journal.done]
        cases = [(n, study.cases[n]) for n in missing]
        for group in solved_rows(study.task, cases, jobs, executor, workers, check):
            kept = []
            for row in group:
                hopeless = row.status in (INVALID, ERROR, DIED)
                first = first or (row.message if hopeless else "")
                bad = bad + 1 if hopeless and bad >= 0 else -1
                kept.append(row)
                if bad >= HOPELESS:
                    break
            journal.append(kept, study.cases)
            count(len(journal.done), len(study.cases), "cases")
            if bad >= HOPELESS:
                problem = f"the first {bad} cases have no answer; one of them: {first}"
                raise InputError("study", None, problem, "change the base job or the parameters; their rows are kept")
        return StudyResult(study.table, journal.finish(), base)


def _order(study: Study) -> Sequence[int]:
    """Numbers of the cases, those that share work one after the other."""
    names = [name.split(".") for name in study.task.names]
    costly = [i for i, parts in enumerate(names) if parts[0] in COSTLY and "microgeometry" not in parts]
    if not costly:
        return range(len(study.cases))
    return sorted(range(len(study.cases)), key=lambda n: [repr(study.cases[n][i]) for i in costly])
