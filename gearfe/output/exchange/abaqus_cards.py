"""Keyword lines of Abaqus' (CalculiX') input files with their data.

A keyword line begins with one asterisk and continues after a final comma. Blanks in keywords and case do not matter. A
comment begins with two asterisks (Abaqus Analysis User's Guide, section "Input syntax rules").
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from ...base.errors import InputError
from .included import Inclusion, Line

_INCLUDE = re.compile(r"\*\s*INCLUDE\s*,", re.IGNORECASE)
#: Cards whose data may be in a file of its own; files of other cards, such as loads, do not matter.
FROM_FILES = ("INCLUDE", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")
_FROM_FILES = re.compile(rf"\*\s*({'|'.join(FROM_FILES)})\s*,", re.IGNORECASE)
_INPUT = re.compile(r",\s*INPUT\s*=\s*(\"[^\"]*\"|[^,]*)", re.IGNORECASE)
_PARTS = re.compile(r'((?:[^,"]|"[^"]*")*)(?:,|$)')


class Card(NamedTuple):
    """A keyword line without blanks in capitals, its parameters (capitals -> value), its data lines, and its place.

    Comments are the lines with two asterisks that follow the keyword line.
    """

    name: str
    keys: dict[str, str]
    data: list[Line]
    line: Line
    comments: list[Line]


class Fault(NamedTuple):
    """Context of error messages of a file: the key that named it, and the file."""

    field: str
    path: Path

    def at(self, line: Line, problem: str, cure: str = "correct that line") -> InputError:
        """Error at a line."""
        return InputError(self.field, self.path.name, f"{line.place}: {problem}", cure)


def inclusion(line: str) -> Inclusion | None:
    """File whose lines follow: that of an *INCLUDE, or the data of another card."""
    if not _FROM_FILES.match(line.lstrip()):
        return None
    named = _INPUT.search(line)
    return None if named is None else Inclusion(named[1].strip().strip('"'), not _INCLUDE.match(line.lstrip()))


def cards(lines: Iterable[Line], fault: Fault, refused: Mapping[str, tuple[str, str]]) -> Iterator[Card]:
    """Yield the cards of a file.

    Parameters
    ----------
    lines : iterable of Line
        The file's lines.
    fault : Fault
        How mistakes are reported.
    refused : mapping
        Names of cards that are not supported -> what they do, and the cure.

    Raises
    ------
    InputError
        For cards of `refused`, and for data before the first card.
    """
    card: Card | None = None
    begun: Line | None = None  # a keyword line that continues
    for line in lines:
        text = line.text.strip()
        if text.startswith("**") and card is not None:
            card.comments.append(line)
        if not text or text.startswith("**"):
            continue
        if begun is None and not text.startswith("*"):
            if card is None:
                problem = f"data before the first card: {text[:40]!r}"
                raise fault.at(line, problem, "is it an input file of Abaqus or CalculiX?")
            card.data.append(line._replace(text=text))
            continue
        begun = line._replace(text=text) if begun is None else begun._replace(text=begun.text + text)
        if begun.text.endswith(","):
            continue
        if card is not None:
            yield card
        card, begun = _card(begun, fault, refused), None
    if begun is not None:
        raise fault.at(begun, "the card continues after its last comma, but the file ends", "is the file whole?")
    if card is not None:
        yield card


def _card(line: Line, fault: Fault, refused: Mapping[str, tuple[str, str]]) -> Card:
    first, *others = split(line.text)
    name = "".join(first[1:].split()).upper()
    keys = {}
    for word in others:
        key, _, value = word.partition("=")
        keys["".join(key.split()).upper()] = value.strip().strip('"')
    if name in refused:
        does, cure = refused[name]
        problem = f"the card {first} {does}, which is not supported"
        raise fault.at(line, problem, cure)
    if name == "INCLUDE" or (name in FROM_FILES and "INPUT" in keys and inclusion(line.text) is None):
        raise fault.at(line, "a file is included that cannot be found", "write *INCLUDE, INPUT=file in one line")
    return Card(name, keys, [], line, [])


def split(text: str) -> list[str]:
    """Cells between commas, those within quotes whole; a comma at the end makes none."""
    if '"' not in text:
        cells = [cell.strip() for cell in text.split(",")]
    else:
        cells = [found[1].strip() for found in _PARTS.finditer(text)]
        cells = cells[:-1] if cells and not cells[-1] else cells  # the empty match at the end
    while cells and not cells[-1]:
        cells.pop()
    return cells


def real(text: str) -> float:
    """A real of Abaqus: 2.5, 2.5E3, 2.5D3; an empty cell is 0. Raises `ValueError` for anything else."""
    if not text:
        return 0.0
    if "_" in text:  # which Python allows
        raise ValueError(text)
    try:
        return float(text)
    except ValueError:
        return float(text.upper().replace("D", "E"))
