"""Matrices of Nastran: DMIG entries of a bulk data or punch file (NX/MSC Nastran Quick Reference Guide, entry DMIG).

An entry is a header (matrix name, 0, form, type) or a column: node and freedom of the column, then node, freedom and
value of its rows, four fields each. Fields are 8 characters wide, 16 in large format (``DMIG*``), or parted by commas.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from ..errors import InputError

Label = tuple[int, int]
#: Values by row and column.
Entries = dict[tuple[Label, Label], float]

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d+)|[eEdD](\d+))?$")


def read_dmig(text: str, path: Path, field: str) -> dict[str, Entries]:
    """Entries of all matrices, by name.

    Raises
    ------
    InputError
        For complex matrices, and for lines that cannot be read.
    """
    matrices: dict[str, Entries] = {}
    for line, card in _cards(text):
        name = card[1].upper()
        try:
            if card[2] == "0":
                if card[4:5] and card[4] in ("3", "4"):
                    cure = "bring a real matrix; damping is [housing.damping]"
                    raise InputError(field, path.name, f"the matrix {name} is complex", cure)
                matrices.setdefault(name, {})
                continue
            column = (int(card[2]), int(card[3] or 0))
            made = matrices.setdefault(name, {})
            for at in range(5, len(card), 4):
                row = card[at : at + 4]
                if row[0]:
                    made[(int(row[0]), int(row[1] or 0)), column] = number(row[2])
        except InputError:
            raise
        except (ValueError, IndexError):
            problem = f"the DMIG entry of line {line} cannot be read"
            raise InputError(
                field, path.name, problem, "write node, freedom, and rows of node, freedom, value"
            ) from None
    return matrices


def number(text: str) -> float:
    """A real of Nastran: 2.5, 2.5E+3, 2.5D+3 or 2.5+3."""
    found = _REAL.match(text)
    if found is None:
        raise ValueError(text)
    return float(f"{found[1]}e{found[2] or found[3] or 0}")


def _cards(text: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each DMIG entry, continuation lines in rows of eight fields (two large lines)."""
    card: list[str] = []
    begun = 0
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.startswith("$"):
            continue
        first = line.split(",")[0][:8].strip().upper() if "," in line else line[:8].strip().upper()
        if first.rstrip("*") == "DMIG":
            if card:
                yield begun, card
            card, begun = ["DMIG", *_fields(line)], number
        elif card and (line[0] in " *+\t,"):
            card += _fields(line)
        elif card:
            yield begun, card
            card = []
    if card:
        yield begun, card


def _fields(line: str) -> list[str]:
    """Data fields of a line: eight, or four of a large line."""
    large = line[:8].rstrip().endswith("*") or line.startswith("*")
    count, width = (4, 16) if large else (8, 8)
    if "," in line:
        cells = [cell.strip() for cell in line.split(",")[1 : 1 + count]]
    else:
        cells = [line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]
    return cells + [""] * (count - len(cells))
