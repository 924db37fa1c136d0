"""Names in job files: which are allowed, those that are folders, and tables of tables by name ([gears.NAME])."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..config import build
from ..errors import InputError

#: Letters, digits, _ and -: names become parts of column names, and of files and folders.
_NAME = re.compile(r"[^\W_][\w-]*")
#: Most characters of a name that is a folder's.
LONGEST = 80
#: Names of devices on Windows, which no folder can have.
_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{digit}" for port in ("com", "lpt") for digit in range(1, 10))}


def named_tables(kind: str, entry_class: type, table: Any, *, rules: bool = True) -> dict[str, Any]:
    """Return the entries of a table of tables by name.

    Parameters
    ----------
    kind : str
        Name of the table of tables, for example ``gears``.
    entry_class : type
        Dataclass of an entry.
    table : Any
        The parsed table.
    rules : bool
        Whether rules that join keys are checked, too.

    Raises
    ------
    InputError
        For an empty table, keys outside an entry, names with other characters than letters, digits, _ and -, names
        that differ by case only, and every mistake in an entry.
    """
    if not isinstance(table, Mapping):
        problem = "must be a table of tables"
        raise InputError(kind, table, problem, f"write [{kind}.NAME] and its keys below it, for each NAME")
    if not table:
        raise InputError(f"[{kind}]", None, "is empty", f"write at least one [{kind}.NAME], or leave it out")
    for name, entry in table.items():
        if not isinstance(entry, Mapping):
            problem = f"is in [{kind}], which has entries with names only"
            raise InputError(f"{kind}.{name}", entry, problem, f"write it below [{kind}.NAME]")
        if not _NAME.fullmatch(name):
            problem = "must have letters, digits, _ and - only, a letter or digit first: it names columns and files"
            raise InputError(f"name in [{kind}]", name, problem, f"rename it, as [{kind}.{_plain(name)}]")
        _check_twins(name, table, f"name in [{kind}]")
    return {name: build(entry_class, entry, f"{kind}.{name}", rules=rules) for name, entry in table.items()}


def _check_twins(name: str, names: Iterable[str], where: str) -> None:
    """Raise `InputError` for a name that some file systems do not tell from another one."""
    twin = next((other for other in names if other != name and _folded(other) == _folded(name)), None)
    if twin is not None:
        problem = f"differs from {twin!r} by upper and lower case only"
        raise InputError(where, name, problem, "files of both would have one name: rename one")


def _folded(name: str) -> str:
    return unicodedata.normalize("NFKC", name).casefold()


def check_folders(meshes: Sequence[str]) -> None:
    """Raise `InputError` for names of meshes that cannot be those of folders, beside each other, on all systems."""
    where = "name of a mesh"
    for name in meshes:
        if not _NAME.fullmatch(name):
            problem = (
                "must have letters, digits, _ and - only, a letter or digit first: its results have a folder of it"
            )
            raise InputError(where, name, problem, f"rename it, or its gears, as {_plain(name)}")
        if len(name) > LONGEST:
            raise InputError(where, name, f"must have {LONGEST} characters or less", "rename it, or its gears")
        if name.lower() in _DEVICES:
            raise InputError(where, name, "is the name of a device on Windows, which no folder can have", "rename it")
        _check_twins(name, meshes, where)


def _plain(name: str) -> str:
    return re.sub(r"[^\w-]+", "_", name).strip("_-") or "NAME"
