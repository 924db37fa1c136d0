"""Entries of Nastran's bulk data (NX/MSC Nastran Quick Reference Guide).

An entry is a name and data fields, eight a line, 8 characters wide, 16 in large format (``GRID*``), or with commas.
Reals may leave out the E of their exponent (2.5+3).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

from .included import Inclusion, Line

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d+)|[eEdD](\d+))?$")
_INCLUDE = re.compile(r"\s*INCLUDE\s+(.+)$", re.IGNORECASE)


def number(text: str) -> float:
    """A real of Nastran: 2.5, 2.5E+3, 2.5D+3 or 2.5+3; ValueError for anything else."""
    found = _REAL.match(text)
    if found is None:
        raise ValueError(text)
    value = float(f"{found[1]}e{found[2] or found[3] or 0}")
    if math.isinf(value):
        raise ValueError(f"{text} is larger than any number")
    return value


def inclusion(line: str) -> Inclusion | None:
    """File that a line includes."""
    found = _INCLUDE.match(line.partition("$")[0])
    return None if found is None else Inclusion(found[1].strip().strip("'\"").strip())


def entries(lines: Iterable[Line], names: Iterable[str]) -> Iterator[tuple[Line, list[str]]]:
    """Yield first line and fields of each entry of these names, with those of its continuation lines in their order."""
    chosen = set(names)
    card: list[str] = []
    begun: Line | None = None
    for whole in lines:
        line = whole.text.partition("$")[0]
        line = line if "," in line else line.expandtabs(8)
        if not line.strip():
            continue
        first = (line.split(",")[0] if "," in line else line)[:8].strip().upper().rstrip("*")
        if card and line[0] in " *+\t,":
            card += _fields(line)
            continue
        if card and begun is not None:
            yield begun, card
        if first == "ENDDATA":
            return
        name = first.rstrip("_")  # meshio writes CTETRA_
        card, begun = ([name, *_fields(line)] if name in chosen else []), whole
    if card and begun is not None:
        yield begun, card


def _fields(line: str) -> list[str]:
    """Data fields of a line: eight, or four of a large line."""
    first, *cells = line.split(",") if "," in line else [line[:8]]
    count, width = (4, 16) if first.rstrip().endswith("*") or first.startswith("*") else (8, 8)
    if not cells:
        cells = [line[8 + i * width : 8 + (i + 1) * width] for i in range(count)]
    cells = [cell.strip() for cell in cells[:count]]
    return cells + [""] * (count - len(cells))
