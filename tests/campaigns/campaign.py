"""What a campaign is, and where each of them lives.

A campaign module provides ``CAMPAIGN``, a `Campaign` with

1. ``draw(random, number)``: a case from its own random generator: a kind, and the texts of its job files. The same
   generator state and number give the same case;
2. ``run(case, folder)``: a `Finding`. Input errors may be raised: they count as refusals. Any other exception is a
   defect. `folder` is empty and belongs to the case;
3. ``tables(outcomes)``: further tables for the results folder, name -> columns;
4. numbers: how many cases the full form has, and how many seconds one may take.
"""

from __future__ import annotations

import importlib
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.base.errors import unknown_name

from .outcome import Finding, Outcome

#: Name -> module below ``tests.campaigns``, in the order of ``scripts/benchmarks/stress.py all``.
CAMPAIGNS: dict[str, str] = {
    "gears": "gears",
    "laws": "laws",
    "mesh_laws": "mesh_laws",
    "width": "width",
    "mechanisms": "mechanisms",
    "trains": "trains",
    "files": "files",
    "estimates": "estimates",
}


@dataclass(frozen=True)
class Case:
    """A case that can be run.

    Parameters
    ----------
    number
        Within the campaign.
    kind
        What sort of case, for the tables.
    files
        Name -> text of the files that make the case; the first is the job.
    command
        How to run it by hand, such as ``gearfe stiffness job.toml --out out``.
    data
        What the checks need to know and the files do not say.
    """

    number: int
    kind: str
    files: Mapping[str, str]
    command: str
    data: Mapping[str, Any] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Write the files into a folder; return the path of the job."""
        for name, text in self.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        return folder / next(iter(self.files), "job.toml")


Columns = Mapping[str, Sequence[Any]]


def no_tables(outcomes: Sequence[Outcome]) -> dict[str, Columns]:
    """A campaign without further tables."""
    return {}


@dataclass(frozen=True)
class Campaign:
    """See the module's docstring.

    Parameters
    ----------
    full
        Number of cases of the full form.
    short
        Case numbers of the short form, which the tests run.
    seconds
        Time limit of a case.
    long_is_bad
        Whether a case over its limit is a defect; not for campaigns whose cases may ask for long runs.
    compiles
        Whether its cases need kernels that may have to be compiled first: case 0 then runs once outside of the limits.
    """

    name: str
    full: int
    short: tuple[int, ...]
    seconds: float
    draw: Callable[[np.random.Generator, int], Case]
    run: Callable[[Case, Path], Finding]
    tables: Callable[[Sequence[Outcome]], dict[str, Columns]] = no_tables
    long_is_bad: bool = True
    compiles: bool = False

    def case(self, seed: int, number: int) -> Case:
        """The case of that number: drawn from a generator of its own, so any one can be drawn alone."""
        return self.draw(np.random.default_rng([seed, zlib.crc32(self.name.encode()), number]), number)


def campaign_named(name: str) -> Campaign:
    """The campaign of that name; its module is loaded only now."""
    if name not in CAMPAIGNS:
        raise unknown_name("campaign", name, (*CAMPAIGNS, "all"))
    made: Campaign = importlib.import_module(f".{CAMPAIGNS[name]}", __package__).CAMPAIGN
    return made
