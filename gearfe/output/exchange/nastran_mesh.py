"""Nodes, solids and faces of a mesh in bulk data of Nastran (NX/MSC Nastran Quick Reference Guide).

gmsh's reader knows neither reals without the E of their exponent, nor properties that are left blank (the element's
number), nor local coordinate systems.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.typing import IntArray
from .included import Line, included_lines
from .nastran_cards import entries, inclusion, number
from .nastran_systems import Systems
from .source_mesh import SourceMesh

#: Elements by entry: meshio's names without and with midside nodes, and their numbers of nodes.
KINDS = {
    "CTETRA": {4: "tetra", 10: "tetra10"},
    "CTRIA3": {3: "triangle"},
    "CTRIAR": {3: "triangle"},
    "CTRIA6": {3: "triangle", 6: "triangle6"},
    "CQUAD4": {4: "quad"},
    "CQUADR": {4: "quad"},
    "CQUAD8": {4: "quad", 8: "quad8"},
    "CHEXA": {8: "hexahedron", 20: "hexahedron20"},
    "CPENTA": {6: "wedge", 15: "wedge15"},
    "CPYRAM": {5: "pyramid", 13: "pyramid13"},
}
SYSTEMS = ("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S")
#: Entries that tie nodes, add mass or stiffness, or take nodes from elsewhere: without them the body would be another.
_RIGID = ("ties nodes to each other", "delete it: bores are rigid by [[housing.bores]], held faces by [[housing.held]]")
_ADDS = ("adds mass or stiffness", "delete it if it does not matter, or model it by solid elements")
_OTHER = ("defines nodes that are not GRID entries", "write all nodes as GRID entries")
REFUSED = {
    **dict.fromkeys(("RBE1", "RBE2", "RBE2GS", "RBE3", "RBAR", "RBAR1", "RROD", "RSPLINE", "RSSCON"), _RIGID),
    **dict.fromkeys(("RTRPLT", "RTRPLT1", "RJOINT", "RGRID", "MPC", "MPCAX", "CWELD", "CFAST", "CSEAM"), _RIGID),
    **dict.fromkeys(("BGSET", "BCTSET"), _RIGID),
    **dict.fromkeys(("CONM1", "CONM2", "CMASS1", "CMASS2", "CMASS3", "CMASS4", "NSM", "NSM1", "NSML", "NSML1"), _ADDS),
    **dict.fromkeys(("CELAS1", "CELAS2", "CELAS3", "CELAS4", "CBUSH", "CBUSH1D", "CGAP", "CDAMP1", "CDAMP2"), _ADDS),
    # shells and bars by their properties: meshers write faces and edges as such elements without any
    **dict.fromkeys(("PSHELL", "PCOMP", "PCOMPG", "PSHEAR", "PBAR", "PBARL", "PBEAM", "PBEAML", "PBCOMP"), _ADDS),
    **dict.fromkeys(("PBEND", "PBEAM3", "PROD", "PTUBE", "CONROD", "GENEL", "CVISC", "DMIG"), _ADDS),
    **dict.fromkeys(("GRIDG", "GRIDF", "GRIDB", "SECONCT", "SELOC", "EGRID"), _OTHER),
    **dict.fromkeys(("CORD3G", "CORD3R"), ("is a coordinate system of a kind", "use CORD2R, CORD2C or CORD2S")),
    "BEGIN SUPER": ("begins a superelement", "write one part, or give matrices as [housing.superelement]"),
}
CARDS = ("GRID", "GRDSET", *SYSTEMS, *KINDS, *REFUSED)

#: Columns of a field, and columns by which its content may be off.
_WIDTH, _BESIDE = 8, 2
_BEGIN = re.compile(r"\s*BEGIN(\s|$)", re.IGNORECASE)


def _bulk(path: Path, field: str) -> Iterator[Line]:
    """Lines of the bulk data: those after BEGIN BULK, or all where there is none, includes in their places."""
    lines = list(included_lines(path, field, inclusion))
    begins = [i for i, line in enumerate(lines) if _BEGIN.match(line.text)]
    for i in begins:
        if "SUPER" in lines[i].text.upper() or i != begins[0]:
            does, cure = REFUSED["BEGIN SUPER"]
            raise InputError(field, path.name, f"{lines[i].place}: {lines[i].text.strip()} {does}", cure)
    yield from lines[begins[0] + 1 if begins else 0 :]


class _Unreadable(InputError):
    """An entry that cannot be read as it stands."""


def read_bulk_mesh(path: Path, field: str) -> SourceMesh:
    """Mesh of a bulk data file; groups are the numbers of properties.

    Raises
    ------
    InputError
        For entries that cannot be read or are not supported, and nodes and coordinate systems that are missing.
    """
    lines = list(_bulk(path, field))
    try:
        return _mesh_of(lines, path, field)
    except _Unreadable:
        aligned = [_aligned(line) for line in lines]
        moved = [line.place for line, other in zip(lines, aligned, strict=True) if line != other]
        if not moved:
            raise
    mesh = _mesh_of(aligned, path, field)
    more = f" and {len(moved) - 1} more lines" if len(moved) > 1 else ""
    return mesh._replace(notes=(f"{moved[0]}{more}: the fields are off their columns; they were moved into them",))


def _aligned(line: Line) -> Line:
    """The line with its words in their columns, where all end the same few columns beside the ends of fields."""
    text = line.text.partition("$")[0].rstrip()
    words = [found for found in re.finditer(r"\S+", text) if found.start() > 0]
    if "," in text or "*" in text or not words or len(text) <= _WIDTH:
        return line
    off = {(found.end() + _BESIDE) % _WIDTH - _BESIDE for found in words}
    drift = off.pop()
    if off or drift == 0 or abs(drift) > _BESIDE:
        return line
    head = text[: words[0].start()].rstrip().ljust(_WIDTH)
    cells = [""] * 8
    for found in words:
        place = (found.end() - drift) // _WIDTH - 2
        if not 0 <= place < len(cells) or len(found[0]) > _WIDTH:
            return line
        cells[place] = found[0]
    return line._replace(text=head + "".join(cell.rjust(_WIDTH) for cell in cells))


def _mesh_of(lines: Iterable[Line], path: Path, field: str) -> SourceMesh:
    """Mesh of the lines of bulk data."""
    grids: dict[int, tuple[tuple[float, float, float], str, Line]] = {}
    systems = Systems(path, field)
    elements: dict[str, list[tuple[int, ...]]] = {}
    known: dict[int, tuple[str, tuple[int, ...]]] = {}
    faces: dict[str, set[int]] = {}
    solids: dict[str, set[int]] = {}
    default = ""
    for line, card in entries(lines, CARDS):
        name = card[0]
        if name in REFUSED:
            does, cure = REFUSED[name]
            raise InputError(field, path.name, f"{line.place}: the entry {name} {does}, which is not supported", cure)
        try:
            if name == "GRDSET":
                default = card[2]
            elif name in SYSTEMS:
                systems.add(card, line)
            elif name == "GRID":
                x, y, z = (number(text or "0") for text in card[3:6])
                grid = (x, y, z), card[2], line
                if grids.setdefault(int(card[1]), grid)[:2] != grid[:2]:
                    problem = f"{line.place}: node {card[1]} is defined twice, at different places"
                    raise InputError(field, path.name, problem, "renumber one of them")
            else:
                kind, nodes = _element(name, card)
                own = int(card[1])
                if known.setdefault(own, (kind, nodes)) != (kind, nodes):
                    problem = f"{line.place}: element {own} is defined twice, with different nodes"
                    raise InputError(field, path.name, problem, "renumber one of them")
                elements.setdefault(kind, []).append(nodes)
                if card[2]:
                    surface = kind.startswith(("tri", "quad"))
                    (faces if surface else solids).setdefault(str(int(card[2])), set()).update(nodes)
        except InputError:
            raise
        except (ValueError, IndexError, OverflowError):
            problem = f"the entry {name} ({line.place}) cannot be read: {line.text[:60].strip()!r}"
            cure = "correct that line: fields of 8 or 16 characters, or separated by commas"
            raise _Unreadable(field, path.name, problem, cure) from None
    if not grids:
        raise InputError(field, path.name, "has no nodes (GRID)", "is the file whole? Is it bulk data of Nastran?")
    places = systems.basic({node: (point, own or default, line) for node, (point, own, line) in grids.items()})
    row = dict(zip(grids, range(len(grids)), strict=True))
    groups = {**solids, **faces}
    try:
        cells = {kind: np.array([[row[node] for node in nodes] for nodes in all_]) for kind, all_ in elements.items()}
        properties: dict[str, IntArray] = {
            key: np.array([row[node] for node in sorted(nodes)]) for key, nodes in groups.items()
        }
    except KeyError as missing:
        problem = f"an element has the node {missing.args[0]}, which no GRID entry defines"
        cure = "write all nodes (GRID) into this file, or include theirs by INCLUDE"
        raise InputError(field, path.name, problem, cure) from None
    return SourceMesh(places, cells, properties)


def _element(name: str, card: list[str]) -> tuple[str, tuple[int, ...]]:
    """meshio's kind and the nodes of an element."""
    kinds = KINDS[name]
    nodes = tuple(int(cell) for cell in card[3 : 3 + max(kinds)] if cell)
    if len(nodes) not in kinds:
        raise ValueError
    return kinds[len(nodes)], nodes
