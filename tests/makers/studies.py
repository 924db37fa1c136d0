"""A study that takes milliseconds a case: Ishigami's function of the places of two free bodies."""

from __future__ import annotations

import csv
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

from gearfe.base.cache import versions
from gearfe.study.job import Study
from gearfe.study.journal import Journal
from gearfe.study.run import serially

#: Two free bodies at rest, whose places are the outputs: a job of two milliseconds.
BASE = """
[run]
end_s = 1e-3
step_s = 1e-3
method = "taylor"
[bodies.a]
mass_kg = 1.0
inertia_kg_m2 = 1.0
position_m = [0.0, 0.0]
[bodies.b]
mass_kg = 1.0
inertia_kg_m2 = 1.0
position_m = [0.0, 0.0]
[[outputs]]
name = "x1"
value = "x(a)"
[[outputs]]
name = "x2"
value = "y(a)"
[[outputs]]
name = "x3"
value = "x(b)"
"""
ISHIGAMI = """
[study]
job = "mechanism"
base = "base.toml"
design = "{design}"
cases = {cases}
seed = 3
[study.parameters]
bodies.a.position_m.0 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
bodies.a.position_m.1 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
bodies.b.position_m.0 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
[study.outputs]
y = "sin(x1[0]) + 7*sin(x2[0])**2 + 0.1*x3[0]**4*sin(x1[0])"
"""


def written(folder: Path, design: str = "sobol", cases: int = 8, **more: str) -> Path:
    """A study of Ishigami's function beside its base job."""
    (folder / "base.toml").write_text(BASE)
    text = ISHIGAMI.format(design=design, cases=cases)
    for old, new in more.items():
        text = text.replace(old.replace("__", " = "), new)
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def rows_of(folder: Path) -> list[list[str]]:
    """Rows of study.csv without the seconds."""
    with (folder / "study.csv").open(newline="") as stream:
        return [row[:-1] for row in csv.reader(stream)]


def stored_rows(folder: Path) -> list[list[str]]:
    """Rows of the database of a folder that no program has open, without the seconds."""
    with closing(sqlite3.connect(folder / "study.db")) as connection:
        lines = [line for (line,) in connection.execute("SELECT line FROM rows ORDER BY number")]
    return [row[:-1] for row in csv.reader(lines)]


def solved_before(study: Study, folder: Path, numbers: Iterable[int]) -> None:
    """Leave a folder as a run does that was killed after these cases: without exports."""
    journal = journal_of(study, folder)
    for rows in serially(study.task, [(n, study.cases[n]) for n in numbers]):
        journal.append(rows, study.cases)
    journal._close()
    (folder / "study.csv").unlink()
    (folder / "study.json").unlink()


def journal_of(study: Study, folder: Path) -> Journal:
    """The journal of a study, as the program opens it."""
    names = study.task.names, tuple(study.table.outputs)
    return Journal(folder, study.head, versions(), *names, cases=study.cases)
