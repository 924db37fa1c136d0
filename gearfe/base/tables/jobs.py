"""Job files: which tables there are, and those that a command reads.

A job file may hold the tables of several jobs: a command reads those it needs by `load_job`. Of the others, keys, types
and ranges are checked, so a misspelt key is an error wherever it stands; the rules that join several keys are not.
"""

from __future__ import annotations

import importlib
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..config import build, read_toml
from ..errors import InputError, unknown_key, unknown_name
from .pair import LOADS, StiffnessTable

if TYPE_CHECKING:
    from .train import TrainTable

#: Table name in a job file -> "module:class" of the dataclass that describes it. Each module is light (no numpy).
TABLES: dict[str, str] = {
    "pair": "gearfe.base.tables.pair:PairTable",
    "stiffness": "gearfe.base.tables.pair:StiffnessTable",
    "loadmap": "gearfe.base.tables.loadmap:LoadMapTable",
    "microgeometry": "gearfe.base.tables.microgeometry:MicrogeometryTable",
    "housing": "gearfe.base.tables.housing:HousingTable",
    "train": "gearfe.base.tables.train:TrainTable",
    "runup": "gearfe.base.tables.runup:RunUpTable",
    "spectrum": "gearfe.base.tables.spectrum:SpectrumTable",
    "study": "gearfe.base.tables.study:StudyTable",
}
#: Tables that were: what became of them, and what to write instead.
REMOVED_TABLES = {
    "relief": (
        "is gone: the best relief is a search of gearfe study",
        'take the table out; [study] with design = "search" varies [microgeometry] (gearfe new relief.toml)',
    ),
}


def load_job(path: str | Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    """Read the `needed` (and, where present, `optional`) tables of a job file; check keys and ranges of all others.

    Returns
    -------
    dict
        Table name -> dataclass instance.
    """
    return job_tables(read_toml(path), path, needed, optional)


def job_tables(
    raw: dict[str, Any], path: str | Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the asked tables of a parsed job, checked.

    Parameters
    ----------
    raw : dict
        The parsed job.
    path : path
        Its file, named in messages.
    needed : tuple of str
        Tables that must be there.
    optional : tuple of str
        Tables that are returned if they are there.

    Raises
    ------
    InputError
        For unknown or missing tables, and for every mistake in a known one.
    """
    for name, table in raw.items():
        if name in REMOVED_TABLES:
            raise InputError(f"[{name}]", None, *REMOVED_TABLES[name])
        if name not in TABLES:
            if {"run", "bodies"} <= raw.keys():
                raise InputError("job file", str(path), "describes a mechanism", "run it: gearfe mechanism FILE")
            raise unknown_key("", name, table, TABLES, field=f"job file {Path(path).name}")
    for name in needed:
        if name not in raw:
            cure = f"add a table [{name}] (see gearfe new)"
            raise InputError(f"[{name}]", None, f"is missing in {Path(path).name}", cure)
    made: dict[str, Any] = {}
    for name, table in raw.items():
        if name in needed or name in optional:
            made[name] = build(table_class(name), table, name)
        else:
            build(table_class(name), table, name, rules=False)
    return made


def table_class(name: str) -> type:
    """Dataclass that describes the table `name` of a job file."""
    module, _, cls = TABLES[name].partition(":")
    return typing.cast(type, getattr(importlib.import_module(module), cls))


def read_train_tables(path: str | Path, variant: str | None = None) -> dict[str, Any]:
    """Tables of a train job by name: ``train`` with the chosen variant (None: that which the file names), and others.

    Raises
    ------
    InputError
        For every mistake in the tables, and an unknown variant.
    """
    return train_tables(read_toml(path), path, variant)


def train_tables(raw: dict[str, Any], path: str | Path, variant: str | None = None) -> dict[str, Any]:
    """The same of tables that are parsed; `path` is named in messages."""
    tables = job_tables(raw, path, ("train",), ("pair", "stiffness", "microgeometry", "housing", "spectrum"))
    table: TrainTable = tables["train"]
    table = table.chosen(table.variant if variant is None else variant)
    table.check_models()
    if table.variant:
        tables["stiffness"] = variant_stiffness(raw, table.variant)
    if table.housing == "elastic" and "housing" not in tables:
        raise InputError("train.housing", "elastic", "needs a table [housing]", 'add it, or write housing = "rigid"')
    return {**tables, "train": table}


def variant_stiffness(raw: Mapping[str, Any], name: str) -> StiffnessTable:
    """Return [stiffness] of the parsed tables with the keys that variant `name` of [train] has instead.

    Raises
    ------
    InputError
        For a variant that the file does not describe, and mistakes in its keys.
    """
    variants = raw.get("train", {}).get("variants", {})
    if name not in variants:
        raise unknown_name("variant", name, variants)
    shared, own = raw.get("stiffness", {}), variants[name].get("stiffness", {})
    if not own.keys().isdisjoint(LOADS):
        shared = {key: value for key, value in shared.items() if key not in LOADS}
    where = f"train.variants.{name}.stiffness" if own else "stiffness"
    return build(StiffnessTable, {**shared, **own}, where)
