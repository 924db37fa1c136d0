"""Read matrices from DMIG entries of a bulk data or punch file (NX/MSC Nastran Quick Reference Guide, entry DMIG).

An entry is a header (matrix name, 0, form, type) or a column. A column has its node and degree of freedom, then node,
degree of freedom and value of its rows, four fields each.
"""

from __future__ import annotations

from pathlib import Path

from ...base.errors import InputError
from .included import lines_of
from .matrix_entries import Entries, add_entry
from .nastran_cards import entries, number


def read_dmig(text: str, path: Path, field: str) -> dict[str, Entries]:
    """Entries of all matrices, by name.

    Raises
    ------
    InputError
        For complex matrices, and for lines that cannot be read.
    """
    matrices: dict[str, Entries] = {}
    for line, card in entries(lines_of(text, path.name), ("DMIG",)):
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
                    add_entry(made, (int(row[0]), int(row[1] or 0)), column, number(row[2]))
        except InputError:
            raise
        except (ValueError, IndexError, OverflowError) as error:
            problem = f"the DMIG entry of line {line.number} cannot be read ({error})"
            cure = "write node, freedom, and rows of node, freedom, value, each entry once"
            raise InputError(field, path.name, problem, cure) from None
    return matrices
