"""Results of a command as its folder holds them: kind, summary, tables.

A comparison and a report take results from their files alone, so that runs of other days and other machines serve.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.files import read_text
from ..base.typing import Array
from .exchange.tables import read_csv


@dataclass(frozen=True)
class Kind:
    """A kind of results.

    Attributes
    ----------
    name
        Command that writes them.
    title
        What they are, in words.
    table
        File that only this kind has.
    summary
        File with the figures.
    needed
        Columns of `table` by which a file of another name is recognised.
    part_of
        File next to which `table` is a part of other results.
    """

    name: str
    title: str
    table: str
    summary: str
    needed: tuple[str, ...]
    part_of: str = ""


#: Kinds in the order in which a folder or a file is recognised.
KINDS = (
    Kind("loadmap", "load map", "loadmap.csv", "loadmap.json", ("torque_Nm", "pinion_angle_deg")),
    Kind("stiffness", "mesh stiffness", "stiffness.csv", "summary.json", ("pinion_angle_deg", "k_mesh")),
    Kind("runup", "run-up", "runup.csv", "summary.json", ("speed_rad_per_s", "branch")),
    Kind("vibration", "vibration", "response.csv", "summary.json", ("time_s", "contact_force_1")),
    Kind("rating", "rating by ISO 6336", "rating.csv", "rating.json", ("group", "name", "formula")),
    Kind(
        "modes",
        "natural frequencies and critical speeds",
        "critical_speeds.csv",
        "summary.json",
        ("meets", "mode", "excited"),
        "runup.csv",
    ),
    Kind("mechanism", "mechanism", "trajectory.csv", "summary.json", ("time_s",)),
)
_KNOWN = ", ".join(kind.name for kind in KINDS)


@dataclass(frozen=True)
class Results:
    """Results of one run.

    Attributes
    ----------
    kind
        What they are.
    name
        Short name, for legends and heads of columns.
    path
        The main table.
    summary
        Figures; empty for a table that stands alone.
    """

    kind: Kind
    name: str
    path: Path
    summary: Mapping[str, Any]

    @cached_property
    def main(self) -> dict[str, Array]:
        """Columns of the main table."""
        return read_csv(self.path)

    def table(self, name: str) -> dict[str, Array]:
        """Columns of another table of the run; empty if there is none."""
        path = self.path.with_name(name)
        return read_csv(path) if self.summary and path.exists() else {}


def kinds_of(folder: Path) -> tuple[Kind, ...]:
    """Kinds of the results that a folder holds."""
    return tuple(
        kind
        for kind in KINDS
        if (folder / kind.table).is_file() and not (kind.part_of and (folder / kind.part_of).is_file())
    )


def read_results(path: str | Path, field: str, name: str = "") -> Results:
    """Read the results of a folder, the first kind of several, or of one of its files; see `read_all`."""
    return read_all(path, field, name)[0]


def read_all(path: str | Path, field: str, name: str = "") -> tuple[Results, ...]:
    """Read the results of a folder, one for each kind that it holds, or of one of its files.

    Of kinds whose summaries have one name the newest table has the summary.

    Parameters
    ----------
    path : path
        Folder of a run, its summary, its main table, or a copy of that table.
    field : str
        What the path is, in messages.
    name : str
        Short name of the results; by default that of the path.

    Raises
    ------
    InputError
        If there are no results, or files are damaged.
    """
    location = Path(path)
    if not location.exists():
        raise InputError(field, str(path), "does not exist", "name a folder that a command wrote")
    name = name or (location.resolve().name if location.is_dir() else location.stem)
    summary = ""
    if location.suffix == ".json" and location.is_file():
        location, summary = location.parent, location.name
    if location.is_dir():
        kinds = kinds_of(location)
        if not kinds:
            inside = sorted({found.parent.name for k in KINDS for found in location.glob(f"*/{k.table}")})
            cure = f"name one of its folders: {', '.join(inside)}" if inside else f"name a folder of: {_KNOWN}"
            raise InputError(field, str(path), "holds no results that can be compared", cure)
        newest = {kind.summary: _newest(location, kind.summary) for kind in kinds}
        every = tuple(
            Results(
                kind,
                name,
                location / kind.table,
                _summary(location / kind.summary, field) if kind is newest[kind.summary] else {},
            )
            for kind in kinds
        )
        return tuple(results for results in every if results.kind is newest.get(summary)) or every
    return (_of_table(location, field, name),)


def _newest(folder: Path, summary: str) -> Kind:
    """Kind with the newest table in a folder, among those whose summary has a name."""
    kinds = [kind for kind in kinds_of(folder) if kind.summary == summary]
    return max(kinds, key=lambda kind: (folder / kind.table).stat().st_mtime)


def _of_table(path: Path, field: str, name: str) -> Results:
    """Read the results of a main table; with the name of a command, also the summary of its folder."""
    known = next((kind for kind in KINDS if kind.table == path.name), None)
    if known is not None:
        of_it = _newest(path.parent, known.summary) is known
        return Results(known, name, path, _summary(path.with_name(known.summary), field) if of_it else {})
    columns = read_csv(path)
    for kind in KINDS:
        if all(any(column.startswith(needed) for column in columns) for needed in kind.needed):
            return Results(kind, name, path, {})
    raise InputError(field, str(path), "is no main table of a run", f"name a folder, or a table of: {_KNOWN}")


def _summary(path: Path, field: str) -> Mapping[str, Any]:
    """Figures of a summary; empty if there is none.

    Raises
    ------
    InputError
        For a damaged file.
    """
    if not path.is_file():
        return {}
    try:
        content = json.loads(read_text(path, field))
    except ValueError as error:
        raise InputError(field, str(path), f"is no summary ({error})", "run the command again") from None
    if not isinstance(content, dict):
        raise InputError(field, str(path), "is no summary", "run the command again")
    return content


def short_names(paths: list[str]) -> list[str]:
    """Distinct short names of results: the last part of each path, with as much before it as tells them apart."""
    parts = [Path(path).resolve().with_suffix("").parts if Path(path).is_file() else Path(path).resolve().parts
             for path in paths]  # fmt: skip
    for count in range(1, max(map(len, parts), default=1) + 1):
        names = ["/".join(part[-count:]) for part in parts]
        if len(set(names)) == len(names):
            return [part[-1] if [p[-1] for p in parts].count(part[-1]) == 1 else name
                    for part, name in zip(parts, names, strict=True)]  # fmt: skip
    return [f"{part[-1]} ({number})" for number, part in enumerate(parts, start=1)]
