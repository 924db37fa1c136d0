"""Read matrices that Abaqus writes, of substructures and of complete models.

*SUBSTRUCTURE MATRIX OUTPUT writes a *USER ELEMENT whose nodes a comment names (``** ELEMENT NODES``). It also writes
the degrees of freedom of its nodes (those of a node are valid for the nodes after it). For each *MATRIX it writes the
lower triangle, row by row. *MATRIX OUTPUT writes lines of node, degree of freedom, node, degree of freedom, value. See
the Abaqus Keywords Guide (*USER ELEMENT, *MATRIX, *MATRIX INPUT) and the Analysis User's Guide, "Generating matrices".
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .abaqus_cards import Card, Fault, cards, real, split
from .included import lines_of
from .matrix_entries import Entries, Label, add_entry, check_rows

_KINDS = {"K": "STIFFNESS", "M": "MASS"}
_KEYWORD = re.compile(r"^\s*\*\s*(USER\s+ELEMENT|MATRIX)\s*,", re.IGNORECASE | re.MULTILINE)
_WHOLE = "the file may be cut short or damaged: write it again"


def is_substructure(text: str) -> bool:
    """Return whether a text has the matrices of a substructure."""
    return _KEYWORD.search(text) is not None


def read_substructure(text: str, path: Path, field: str, initial: str) -> tuple[Array, list[Label]]:
    """Matrix of a substructure, and the node and degree of freedom of its rows where the file names the nodes.

    Parameters
    ----------
    text
        Content of the file.
    path, field
        File, and key that named it, for messages.
    initial
        K for the stiffness, M for the mass.

    Raises
    ------
    InputError
        When there is no such matrix, or it has not the numbers that its nodes and degrees of freedom ask for.
    """
    kind, fault = _KINDS[initial], Fault(field, path)
    nodes: list[int] = []
    freedoms: list[tuple[int, list[int]]] = []
    count, symmetric = 0, True
    blocks: dict[str, list[float]] = {}
    for card in cards(lines_of(text, path.name), fault, {}):
        line = card.line
        try:
            nodes += _named_nodes(card)
            if card.name == "USERELEMENT":
                count, symmetric = int(card.keys["NODES"]), "UNSYMM" not in card.keys
                for line in card.data:
                    numbers = [int(word) for word in split(line.text) if word]
                    first, *own = numbers if freedoms else [1, *numbers]
                    freedoms.append((first, own))
            elif card.name == "MATRIX":
                name = card.keys["TYPE"].upper()
                if name in blocks:
                    raise fault.at(line, f"the matrix {name} is there twice", "leave one substructure in the file")
                blocks[name] = []
                for line in card.data:
                    blocks[name] += [real(word) for word in split(line.text) if word]
        except InputError:
            raise
        except (ValueError, KeyError):
            problem = f"line {line.number} of this substructure cannot be read: {line.text.strip()[:60]!r}"
            raise InputError(field, path.name, problem, _WHOLE) from None
    if kind not in blocks:
        known = ", ".join(blocks) or "none"
        problem = f"has no *MATRIX, TYPE={kind}; there are: {known}"
        raise InputError(field, path.name, problem, f"write it with *SUBSTRUCTURE MATRIX OUTPUT, {kind}=YES")
    labels = _labels(nodes, freedoms, count, path, field)
    n, entries = len(labels), np.array(blocks[kind])
    asked = n * (n + 1) // 2 if symmetric else n * n
    if len(entries) != asked:
        problem = (
            f"the {kind} of {count} nodes with {n} degrees of freedom must have {asked} numbers, but has {len(entries)}"
        )
        raise InputError(field, path.name, problem, f"rows are missing or doubled; {_WHOLE}")
    if not symmetric:
        return entries.reshape(n, n), labels if nodes else []
    values = np.zeros((n, n))
    values[np.tril_indices(n)] = entries
    return values + np.tril(values, -1).T, labels if nodes else []


def _named_nodes(card: Card) -> list[int]:
    """Nodes of a substructure that the comments of a card name, after one that announces them."""
    nodes: list[int] = []
    naming = False
    for line in card.comments:
        words = line.text.strip().strip("* ")
        if naming and re.fullmatch(r"[\d\s,]+", words):
            nodes += [int(word) for word in re.split(r"[,\s]+", words) if word]
        else:
            naming = words.upper() == "ELEMENT NODES"
    return nodes


def _labels(nodes: list[int], freedoms: list[tuple[int, list[int]]], count: int, path: Path, field: str) -> list[Label]:
    """Node and degree of freedom of each row; nodes by their place where no comment names them."""
    starts = [first for first, _ in freedoms]
    check_rows(count, path, field)
    if not count > 0 or not freedoms or starts != sorted(set(starts)) or starts[-1] > count:
        problem = f"the lines of degrees of freedom of its *USER ELEMENT do not fit its {count} nodes"
        raise InputError(field, path.name, problem, _WHOLE)
    if nodes and (len(nodes) != count or len(set(nodes)) != count):
        problem = f"the comment ELEMENT NODES names {len(nodes)} nodes, the *USER ELEMENT has {count}, each once"
        raise InputError(field, path.name, problem, _WHOLE)
    names = nodes or list(range(1, count + 1))
    ends = [*starts[1:], count + 1]
    check_rows(sum((last - first) * len(own) for (first, own), last in zip(freedoms, ends, strict=True)), path, field)
    labels = []
    for (first, own), last in zip(freedoms, ends, strict=True):
        labels += [(names[place - 1], freedom) for place in range(first, last) for freedom in own]
    if len(set(labels)) != len(labels):
        raise InputError(field, path.name, "its *USER ELEMENT has a freedom of a node twice", _WHOLE)
    return labels


def read_entries(text: str, path: Path, field: str) -> Entries:
    """Matrix of lines of node, degree of freedom, node, degree of freedom, value, with commas or blanks between.

    Raises
    ------
    InputError
        For lines that are none, and entries with two values.
    """
    entries: Entries = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("*"):
            continue
        cells = [cell for cell in re.split(r"\s*,\s*|\s+", line.strip()) if cell]
        try:
            a, b, c, d = (int(cell) for cell in cells[:4])
            (value,) = (real(cell) for cell in cells[4:])
        except ValueError:
            problem = (
                f"is neither Matrix Market nor matrices of Abaqus nor DMIG: line {number} is {line.strip()[:60]!r}"
            )
            cure = "begin it with %%MatrixMarket, or write lines of node, freedom, node, freedom, value"
            raise InputError(field, path.name, problem, cure) from None
        try:
            add_entry(entries, (a, b), (c, d), value)
        except ValueError as error:
            raise InputError(field, path.name, f"line {number}: {error}", "write each entry once") from None
    return entries
