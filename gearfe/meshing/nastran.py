"""Bulk data of Nastran: its entries, and the nodes, solids and faces of a mesh (NX/MSC Nastran Quick Reference Guide).

An entry is a name and data fields, eight a line, 8 characters wide, 16 in large format (``GRID*``), or with commas.
Reals may leave out the E of their exponent (2.5+3), and a property that is left blank has the element's number:
gmsh's reader knows neither.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..typing import Array, IntArray

#: Elements by entry: meshio's names without and with midside nodes, and their numbers of nodes.
KINDS = {
    "CTETRA": {4: "tetra", 10: "tetra10"},
    "CTRIA3": {3: "triangle"},
    "CTRIAR": {3: "triangle"},
    "CTRIA6": {3: "triangle", 6: "triangle6"},
    "CHEXA": {8: "hexahedron", 20: "hexahedron20"},
    "CPENTA": {6: "wedge", 15: "wedge15"},
    "CPYRAM": {5: "pyramid", 13: "pyramid13"},
}
CARDS = ("GRID", "GRDSET", "INCLUDE", *KINDS)

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d+)|[eEdD](\d+))?$")


class BulkMesh(NamedTuple):
    """Nodes (n, 3), node numbers of the elements of each of meshio's kinds, nodes of each property by its number."""

    points: Array
    cells: dict[str, IntArray]
    properties: dict[str, IntArray]


def number(text: str) -> float:
    """A real of Nastran: 2.5, 2.5E+3, 2.5D+3 or 2.5+3."""
    found = _REAL.match(text)
    if found is None:
        raise ValueError(text)
    return float(f"{found[1]}e{found[2] or found[3] or 0}")


def entries(text: str, names: Iterable[str]) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each entry of these names, with those of its continuation lines in their order."""
    chosen = set(names)
    card: list[str] = []
    begun = 0
    for line_number, whole in enumerate(text.splitlines(), start=1):
        line = whole.partition("$")[0]
        if not line.strip():
            continue
        first = (line.split(",")[0] if "," in line else line)[:8].strip().upper().rstrip("*")
        if card and line[0] in " *+\t,":
            card += _fields(line)
            continue
        if card:
            yield begun, card
        words = first.split()
        name = words[0] if words and words[0] == "INCLUDE" else first.rstrip("_")  # meshio writes CTETRA_
        card, begun = ([name, *_fields(line)] if name in chosen else []), line_number
    if card:
        yield begun, card


def _fields(line: str) -> list[str]:
    """Data fields of a line: eight, or four of a large line."""
    first, *cells = line.split(",") if "," in line else [line[:8]]
    count, width = (4, 16) if first.rstrip().endswith("*") or first.startswith("*") else (8, 8)
    if not cells:
        cells = [line[8 + i * width : 8 + (i + 1) * width] for i in range(count)]
    cells = [cell.strip() for cell in cells[:count]]
    return cells + [""] * (count - len(cells))


def read_bulk_mesh(text: str, path: Path, field: str) -> BulkMesh:
    """Mesh of a bulk data file.

    Raises
    ------
    InputError
        For entries that cannot be read, other files, nodes that are missing or in a local coordinate system.
    """
    places: dict[int, tuple[float, float, float]] = {}
    elements: dict[str, list[tuple[int, ...]]] = {}
    faces: dict[str, set[int]] = {}
    solids: dict[str, set[int]] = {}
    system = ""
    for line, card in entries(text, CARDS):
        name = card[0]
        if name == "INCLUDE":
            raise InputError(field, path.name, f"line {line} includes another file", "write all into one file")
        try:
            if name == "GRDSET":
                system = card[2]
            elif name == "GRID":
                node, own = int(card[1]), card[2] or system
                if own not in ("", "0"):
                    problem = f"node {node} (line {line}) stands in coordinate system {own}"
                    raise InputError(field, path.name, problem, "write the nodes in the basic system")
                x, y, z = (number(text or "0") for text in card[3:6])
                places[node] = (x, y, z)
            else:
                kind, nodes = _element(name, card)
                elements.setdefault(kind, []).append(nodes)
                if card[2]:
                    (faces if kind.startswith("tri") else solids).setdefault(str(int(card[2])), set()).update(nodes)
        except InputError:
            raise
        except (ValueError, IndexError):
            problem = f"the entry {name} of line {line} cannot be read"
            cure = "mend that line: fields of 8 or 16 characters, or parted by commas"
            raise InputError(field, path.name, problem, cure) from None
    if not places:
        raise InputError(field, path.name, "has no nodes (GRID)", "is it whole? or write it as .msh (gmsh) or .vtu")
    row = dict(zip(places, range(len(places)), strict=True))
    groups = {**solids, **faces}
    try:
        cells = {kind: np.array([[row[node] for node in nodes] for nodes in found]) for kind, found in elements.items()}
        properties = {key: np.array([row[node] for node in sorted(nodes)]) for key, nodes in groups.items()}
    except KeyError as missing:
        problem = f"an element has the node {missing.args[0]}, which the file does not tell"
        raise InputError(field, path.name, problem, "write all nodes (GRID) into this file") from None
    return BulkMesh(np.array(list(places.values())), cells, properties)


def _element(name: str, card: list[str]) -> tuple[str, tuple[int, ...]]:
    """meshio's kind and the nodes of an element."""
    kinds = KINDS[name]
    nodes = tuple(int(cell) for cell in card[3 : 3 + max(kinds)] if cell)
    if len(nodes) not in kinds:
        raise ValueError
    return kinds[len(nodes)], nodes
