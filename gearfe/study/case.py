"""One case of a study: its values put into the base job, the job solved, its outputs evaluated."""

from __future__ import annotations

import copy
import ctypes
import functools
import itertools
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..base.config import set_key
from ..base.errors import InputError
from ..base.progress import one_thread
from .expressions import Answer, Output, read_output, value_of
from .kinds import Shared, solve

#: Of a row: solved; solved in part, the message says what failed; refused, as the job's command would; an error of
#: the program itself; the process died of it.
DONE, PARTLY, INVALID, ERROR, DIED = "done", "partly", "invalid", "error", "died"


#: Parameters of glibc's mallopt (malloc.h).
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
#: What the cases of this process share, whatever groups they come in.
HERE = Shared()


@dataclass(frozen=True)
class Task:
    """Common data of all cases of a study; small, because each group of cases carries it.

    Attributes
    ----------
    kind, path, raw, estimate
        Of the base job, see `gearfe.study.kinds.solve`.
    names
        Dotted names of the parameters.
    outputs
        Name -> expression.
    also
        Parameter -> names of further keys that take its value.
    mesh
        Mesh of the job, where it has several.
    worst_over
        Name of a key -> values; each case is solved at all of their combinations.
    least
        Outputs of which the least over these counts; of the others the largest does.
    """

    kind: str
    path: Path
    raw: Mapping[str, Any]
    estimate: bool
    names: tuple[str, ...]
    outputs: Mapping[str, str]
    also: Mapping[str, Sequence[str]]
    mesh: str | None = None
    worst_over: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    least: tuple[str, ...] = ()

    def combinations(self, values: Sequence[Any]) -> Iterator[dict[str, Any]]:
        """Yield the tables of the job with these values at all combinations of what the worst is taken over."""
        for combination in itertools.product(*self.worst_over.values()):
            job_tables = self.tables(values)
            for name, value in zip(self.worst_over, combination, strict=True):
                set_key(job_tables, name, value, f"study.worst_over.{name}")
            yield job_tables

    def tables(self, values: Sequence[Any]) -> dict[str, Any]:
        """Tables of the job with these values."""
        job_tables = copy.deepcopy(dict(self.raw))
        for name, value in zip(self.names, values, strict=True):
            for key in (name, *self.also.get(name, ())):
                set_key(job_tables, key, value, f"study.parameters.{name}")
        return job_tables

    def expressions(self) -> dict[str, Output]:
        """Outputs, parsed."""
        return {name: read_output(text, f"study.outputs.{name}") for name, text in self.outputs.items()}


@dataclass(frozen=True)
class Row:
    """Result of a case: outputs are NaN where it has none."""

    case: int
    outputs: tuple[float, ...]
    status: str
    message: str
    seconds: float


def evaluate(task: Task, values: Sequence[Any], shared: Shared) -> tuple[dict[str, float], Answer]:
    """Outputs of a case, and the job's answer: the first that has a problem where there are several.

    Raises
    ------
    InputError
        What the job's command would refuse, and outputs that the job does not give.
    """
    expressions, rows = task.expressions(), list[list[float]]()
    first: Answer | None = None
    for tables in task.combinations(values):
        answer = solve(task.kind, tables, task.path, shared, estimate=task.estimate, mesh=task.mesh)
        rows.append([value_of(output, answer) for output in expressions.values()])
        first = answer if first is None or not first.problem else first
    assert first is not None
    worst = {
        name: float(np.min(values) if name in task.least else np.max(values))  # NaN where one is
        for name, values in zip(expressions, zip(*rows, strict=True), strict=True)
    }
    return worst, first


def solve_case(task: Task, number: int, values: Sequence[Any], shared: Shared) -> Row:
    """Solve a case; an error in it becomes the status of its row.

    Parameters
    ----------
    task : Task
        Job and outputs of the study.
    number : int
        Number of the case.
    values : sequence
        Values of the parameters.
    shared : Shared
        Results that cases share.
    """
    began = time.perf_counter()
    nothing = (float("nan"),) * len(task.outputs)
    try:
        outputs, answer = evaluate(task, values, shared)
        status, found = (PARTLY if answer.problem else DONE), tuple(outputs.values())
        message = answer.problem
    except InputError as error:
        status, found, message = INVALID, nothing, str(error)
    except Exception as error:  # a study of thousands continues
        status, found, message = ERROR, nothing, f"{type(error).__name__}: {error}"
    return Row(number, found, status, " ".join(message.split()), time.perf_counter() - began)


def _names_file(text: Any, folder: Path) -> bool:
    if not isinstance(text, str) or not Path(text).suffix:
        return False
    try:
        return (folder / text).is_file()
    except OSError:  # an expression, too long for a name
        return False


def job_beside(raw: Any, folder: Path, place: Path) -> Any:
    """Return the tables of a job in `folder` for a job file in `place`, with valid paths of named files."""
    if isinstance(raw, dict):
        return {key: job_beside(value, folder, place) for key, value in raw.items()}
    if isinstance(raw, (list, tuple)):
        return [job_beside(value, folder, place) for value in raw]
    if not _names_file(raw, folder) or Path(raw).is_absolute():
        return raw
    try:
        return Path(os.path.relpath(folder / raw, place)).as_posix()
    except ValueError:  # on another drive of Windows
        return (folder / raw).resolve().as_posix()


def files_named(raw: Any, folder: Path) -> set[str]:
    """Files in `folder` that tables of a job name."""
    if isinstance(raw, (dict, list, tuple)):
        inside = raw.values() if isinstance(raw, dict) else raw
        return {name for value in inside for name in files_named(value, folder)}
    return {raw} if _names_file(raw, folder) else set()


@functools.cache
def _keep_memory() -> None:
    """Freed memory stays with the process, once for each process.

    Dask's workers give it back at once (MALLOC_TRIM_THRESHOLD_=65536), and pages that come and go cost a microgeometry
    a third of its time.
    """
    if os.environ.get("MALLOC_TRIM_THRESHOLD_"):
        with suppress(OSError, AttributeError, TypeError):  # of glibc alone
            mallopt = ctypes.CDLL(None).mallopt
            mallopt(_TRIM_THRESHOLD, 256 << 20)
            mallopt(_MMAP_THRESHOLD, 32 << 20)


def solve_group(task: Task, group: Sequence[tuple[int, tuple[Any, ...]]]) -> list[Row]:
    """Rows of some cases, (number, values) each."""
    _keep_memory()
    with one_thread():  # a number of threads changes digits
        return [solve_case(task, number, values, HERE) for number, values in group]
