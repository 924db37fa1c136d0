"""Values with their meaning, unit and formula: fields of dataclasses, and the entries of a report."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any


def cited(meaning: str, formula: str, unit: str = "-") -> Any:
    """Return a field of a dataclass of results.

    Parameters
    ----------
    meaning : str
        What it is.
    formula : str
        Standard, part, clause and number of the formula.
    unit : str
        Its unit; ``-`` for pure numbers.
    """
    return dataclasses.field(metadata={"meaning": meaning, "formula": formula, "unit": unit}, kw_only=True)


@dataclass(frozen=True)
class Entry:
    """A value of a report.

    Attributes
    ----------
    group, name
        Group of results, and symbol.
    value
        A number of the mesh, or one for each gear.
    unit, formula, meaning
        What the field says.
    """

    group: str
    name: str
    value: float | tuple[float, float]
    unit: str
    formula: str
    meaning: str


def entries(group: str, results: Any) -> Iterator[Entry]:
    """Entries of a dataclass whose fields are made with `cited`; others, and those without a value, are left out."""
    for field in dataclasses.fields(results):
        value = getattr(results, field.name)
        if value is not None and "formula" in field.metadata:
            yield Entry(
                group,
                field.name,
                value,
                field.metadata["unit"],
                field.metadata["formula"],
                field.metadata["meaning"],
            )
