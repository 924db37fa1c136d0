"""Read the mesh of an input file of Abaqus or CalculiX: parts, instances, nodes, elements, sets and surfaces.

Nodes and elements have their numbers in the part, in the instance, or in the assembly. An instance is its part,
displaced and then rotated about an axis. Sets of the assembly name nodes by ``INSTANCE=`` or as ``instance.number``.
Cards of materials, loads and steps are ignored; they come from the job (Abaqus Keywords Guide: *NODE, *ELEMENT,
*SYSTEM, *NSET, *ELSET, *SURFACE, *PART, *INSTANCE, *ASSEMBLY).
"""

from __future__ import annotations

import difflib
import math
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from .abaqus_cards import Card, Fault, Line, cards, inclusion, real, split
from .included import included_lines
from .source_mesh import SourceMesh

#: Cards that make or move nodes and elements, join parts, add mass or stiffness, or change the file's text, and that
#: are not supported: without them the body would be another one. Name -> what it does, and the cure.
_WRITE = "write all nodes and elements in full (preprint of Abaqus, or an export of the mesh)"
_RIGID = "delete it: bores are rigid by [[housing.bores]], held faces by [[housing.held]]"
_SOLID = "delete it with its elements if it does not matter, or model it by solid elements"
_MERGE = "merge the meshes so that the parts share their nodes, then delete it"
REFUSED = {
    **dict.fromkeys(("NGEN", "NFILL", "NCOPY", "NMAP", "ADJUST"), ("makes or moves nodes", _WRITE)),
    **dict.fromkeys(("ELGEN", "ELCOPY", "SYMMETRICMODELGENERATION", "MODELCHANGE"), ("changes the elements", _WRITE)),
    **dict.fromkeys(("IMPERFECTION", "IMPORT", "IMPORTNODESET", "IMPORTELSET"), ("takes data of another run", _WRITE)),
    **dict.fromkeys(("PARAMETER", "MANIFEST"), ("replaces text of the file", "write numbers and names in full")),
    **dict.fromkeys(
        ("TIE", "EMBEDDEDELEMENT", "SHELLTOSOLIDCOUPLING", "FASTENER", "CYCLICSYMMETRYMODEL"), ("joins parts", _MERGE)
    ),
    **dict.fromkeys(
        ("EQUATION", "MPC", "RIGIDBODY", "COUPLING", "KINEMATICCOUPLING", "DISTRIBUTINGCOUPLING", "PRE-TENSIONSECTION"),
        ("ties nodes to each other", _RIGID),
    ),
    **dict.fromkeys(
        (
            "MASS",
            "ROTARYINERTIA",
            "NONSTRUCTURALMASS",
            "SPRING",
            "DASHPOT",
            "JOINT",
            "CONNECTORSECTION",
            "GAP",
            "FOUNDATION",
        ),
        ("adds mass or stiffness", _SOLID),
    ),
    **dict.fromkeys(
        (
            *("SHELLSECTION", "SHELLGENERALSECTION", "MEMBRANESECTION", "SURFACESECTION", "REBARLAYER"),
            *("BEAMSECTION", "BEAMGENERALSECTION", "FRAMESECTION", "REBAR"),
        ),
        ("adds shells or beams", _SOLID),
    ),
    **dict.fromkeys(
        ("USERELEMENT", "MATRIXINPUT", "MATRIXASSEMBLE", "SUPERELEMENT", "SUBSTRUCTUREPROPERTY"),
        ("adds matrices", "give a substructure as [housing.superelement]"),
    ),
}
#: Families of elements: what a type begins with, and meshio's kinds by the number of nodes.
_SOLIDS = {4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27", 6: "wedge"}
_SOLIDS |= {15: "wedge15", 5: "pyramid", 13: "pyramid13"}
_FACES = {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8", 9: "quad9"}
_LINES = {2: "line", 3: "line3"}
_FAMILIES = (
    (re.compile(r"(?:D|AC)?C3D(\d+)"), _SOLIDS),
    (re.compile(r"(?:CPS|CPE|CPEG|CAX|C2D|DC2D|DCAX|M3D|SFM3D|R3D|F3D|S|SC|DS)(\d+)"), _FACES),
    (re.compile(r"T[23]D(\d)"), _LINES),
)
_SPECIAL = {"STRI3": ("triangle", 3), "STRI65": ("triangle6", 6), "SC6R": ("wedge", 6), "SC8R": ("hexahedron", 8)}
#: Faces of tetrahedra by Abaqus' names: places of their corners, and of the nodes in the middle of their edges.
_TETRA_FACES = {"S1": [0, 1, 2, 4, 5, 6], "S2": [0, 3, 1, 7, 8, 4], "S3": [1, 3, 2, 8, 9, 5], "S4": [2, 3, 0, 9, 7, 6]}
#: Instance of what belongs to none; likeness from which an unknown card is a misspelt one; sets within sets.
_NONE, MISSPELT, DEEPEST = "", 0.85, 50

#: A node or an element: instance and number.
Label = tuple[str, int]
Point = tuple[float, float, float]


@dataclass
class _Members:
    """Hold the members of a set or surface: words of the file with their instance and position."""

    name: str
    #: (words of a line, instance, line); of GENERATE cards (first, last, increment)
    rows: list[tuple[list[str], str, Line]] = field(default_factory=list)
    ranges: list[tuple[int, int, int, str]] = field(default_factory=list)
    #: element sets whose nodes belong to a node set
    of_elements: list[tuple[str, str, Line]] = field(default_factory=list)

    def copy(self) -> _Members:
        """Return members that can be extended without these."""
        return _Members(self.name, [*self.rows], [*self.ranges], [*self.of_elements])


@dataclass
class _Space:
    """Numbering space of nodes and elements: a part, an instance, or the assembly."""

    nodes: dict[int, Point] = field(default_factory=dict)
    elements: dict[int, tuple[str, tuple[str, ...], Line]] = field(default_factory=dict)
    node_sets: dict[str, _Members] = field(default_factory=dict)
    element_sets: dict[str, _Members] = field(default_factory=dict)
    surfaces: dict[str, _Members] = field(default_factory=dict)

    def copy(self) -> _Space:
        """Return a space of its own with the same content."""
        sets = (
            {key: members.copy() for key, members in kind.items()}
            for kind in (self.node_sets, self.element_sets, self.surfaces)
        )
        return _Space(dict(self.nodes), dict(self.elements), *sets)


def read_abaqus(path: Path, field: str) -> SourceMesh:
    """Mesh of an input file.

    Raises
    ------
    InputError
        For lines that cannot be read, numbers and names that do not exist, and cards without which the body would be
        another one.
    """
    return _Reader(Fault(field, path)).read()


class _Reader:
    """Hold the state of reading: the spaces so far, the open one, and its system of coordinates."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        self.parts: dict[str, _Space] = {}
        self.spaces: dict[str, _Space] = {_NONE: _Space()}
        self.titles: dict[str, str] = {_NONE: ""}  # of instances, as written
        self.open, self.instance = self.spaces[_NONE], _NONE
        self.moves: list[Line] = []
        self.system: tuple[Array, Array] | None = None
        self.lost: dict[str, int] = {}
        self.resolved: dict[tuple[str, str, str], set[Label]] = {}
        self.row: dict[Label, int] = {}
        self.nodes_of: dict[Label, list[int]] = {}

    def read(self) -> SourceMesh:
        acts = {
            "PART": self._part,
            "ENDPART": self._end,
            "INSTANCE": self._instance,
            "ENDINSTANCE": self._end_instance,
            "SYSTEM": self._system,
            "NODE": self._node,
            "ELEMENT": self._element,
            "NSET": self._nset,
            "ELSET": self._elset,
            "SURFACE": self._surface,
        }
        for card in cards(included_lines(self.fault.path, self.fault.field, inclusion), self.fault, REFUSED):
            if card.name in acts:
                acts[card.name](card)
            elif like := difflib.get_close_matches(card.name, acts, n=1, cutoff=MISSPELT):
                raise self.fault.at(card.line, f"there is no card *{card.name}", f"did you mean *{like[0]}?")
        if self.instance != _NONE:
            problem = f"the instance {self.titles[self.instance]} does not end (*END INSTANCE)"
            raise InputError(self.fault.field, self.fault.path.name, problem, "is the file whole?")
        if self.parts and len(self.spaces) == 1 and not self.open.nodes:
            problem, cure = "has parts but no *INSTANCE, so none of them is in the model", "add *ASSEMBLY and *INSTANCE"
            raise InputError(self.fault.field, self.fault.path.name, problem, cure)
        return self._mesh()

    # ---- cards ----

    def _part(self, card: Card) -> None:
        self.open = self.parts.setdefault(self._name(card, "NAME").casefold(), _Space())
        self.system = None

    def _end(self, _: Card) -> None:
        self.open, self.instance, self.system = self.spaces[_NONE], _NONE, None

    def _instance(self, card: Card) -> None:
        title, part = self._name(card, "NAME"), card.keys.get("PART", "")
        key = title.casefold()
        if "LIBRARY" in card.keys:
            raise self.fault.at(card.line, "the instance is of another run (LIBRARY)", "write its part into the file")
        if key in self.spaces:
            raise self.fault.at(card.line, f"the instance {title} is defined twice", "give each a different name")
        if part.casefold() not in self.parts:
            known = ", ".join(self.parts) or "none"
            raise self.fault.at(card.line, f"there is no part {part!r} before its instance; there are: {known}")
        self.open = self.spaces[key] = self.parts[part.casefold()].copy()
        self.titles[key], self.moves, self.instance, self.system = title, card.data, key, None

    def _end_instance(self, card: Card) -> None:
        if self.instance == _NONE:
            raise self.fault.at(card.line, "ends an instance that has not begun")
        turn, shift = self._placement()
        nodes = self.open.nodes
        if nodes:
            placed = np.array(list(nodes.values())) @ turn.T + shift
            self.open.nodes = dict(zip(nodes, map(tuple, placed.tolist()), strict=True))
        self._end(card)

    def _placement(self) -> tuple[Array, Array]:
        """Rotation matrix and shift of an instance: moved first, then turned about the axis through two points."""
        if len(self.moves) > 2:
            raise self.fault.at(self.moves[2], "an instance has at most two lines: translation and rotation")
        rows = [self._reals(line, 3 if i == 0 else 7) for i, line in enumerate(self.moves)]
        shift = np.array(rows[0]) if rows else np.zeros(3)
        if len(rows) < 2:
            return np.eye(3), shift
        a, axis, angle = np.array(rows[1][:3]), np.subtract(rows[1][3:6], rows[1][:3]), math.radians(rows[1][6])
        length = float(np.linalg.norm(axis))
        if not length > 0.0:
            raise self.fault.at(self.moves[1], "both points of the axis of rotation are the same")
        turn = _rotation(axis / length, angle)
        return turn, turn @ (shift - a) + a

    def _system(self, card: Card) -> None:
        """Coordinates of the nodes that follow: origin, a point of the x axis, a point of the x-y plane."""
        if not card.data:
            self.system = None
            return
        numbers = self._reals(card.data[0], 6)
        origin, along = np.array(numbers[:3]), np.subtract(numbers[3:6], numbers[:3])
        if len(split(card.data[0].text)) <= 3:
            self.system = np.eye(3), origin
            return
        if len(card.data) > 1:
            side = np.subtract(self._reals(card.data[1], 3), origin)
        else:
            side = np.cross([0.0, 0.0, 1.0], along)
        normal = np.cross(along, side)
        if not np.linalg.norm(normal) > 0.0:
            raise self.fault.at(card.data[0], "the points of the coordinate system lie in a line")
        x, z = along / np.linalg.norm(along), normal / np.linalg.norm(normal)
        self.system = np.column_stack([x, np.cross(z, x), z]), origin

    def _node(self, card: Card) -> None:
        kind = card.keys.get("SYSTEM", "R").upper()
        if kind not in ("R", "C"):
            problem = f"coordinates of the system {kind!r} are not supported"
            raise self.fault.at(card.line, problem, "write them in R (x, y, z) or C (r, angle in degrees, z)")
        numbers = []
        for line in card.data:
            cells = split(line.text)
            try:
                number, a, b, c = int(cells[0]), *(real(cell) for cell in [*cells[1:4], "", "", ""][:3])
                if kind == "C":
                    a, b = a * math.cos(math.radians(b)), a * math.sin(math.radians(b))
                if not all(map(math.isfinite, (a, b, c))):
                    raise ValueError("not finite")
            except (ValueError, IndexError, OverflowError):
                raise self.fault.at(line, f"is no node: {line.text[:60]!r}", "write number, x, y, z") from None
            if self.system is not None:
                a, b, c = (self.system[0] @ (a, b, c) + self.system[1]).tolist()
            if self.open.nodes.setdefault(number, (a, b, c)) != (a, b, c):
                raise self.fault.at(line, f"node {number} is defined twice, at different places", "renumber one")
            numbers.append(str(number))
        if card.keys.get("NSET"):
            self._members(self.open.node_sets, card.keys["NSET"]).rows.append((numbers, _NONE, card.line))

    def _element(self, card: Card) -> None:
        kind, count = self._kind(card)
        names: list[str] = []  # of an element that may continue in the next line
        numbers = []
        for line in card.data:
            names = [*names, *split(line.text)]
            if len(names) > count + 1:
                problem = f"the element {names[0]} of type {card.keys['TYPE']} must have {count} nodes"
                raise self.fault.at(line, f"{problem}, up to here {len(names) - 1} were read")
            if len(names) < count + 1:
                continue
            try:
                number, nodes = int(names[0]), tuple(names[1:])
            except ValueError:
                raise self.fault.at(line, f"is no element: {line.text[:60]!r}") from None
            held = self.open.elements.setdefault(number, (kind, nodes, line))
            if held[:2] != (kind, nodes):
                raise self.fault.at(line, f"element {number} is defined twice, with different nodes", "renumber one")
            numbers.append(names[0])
            names = []
        if names:
            raise self.fault.at(card.data[-1], f"the element {names[0]} has {len(names) - 1} of its {count} nodes")
        if card.keys.get("ELSET"):
            self._members(self.open.element_sets, card.keys["ELSET"]).rows.append((numbers, _NONE, card.line))

    def _kind(self, card: Card) -> tuple[str, int]:
        """meshio's kind and number of nodes of a card's elements."""
        kind = card.keys.get("TYPE", "").upper()
        if kind in _SPECIAL:
            return _SPECIAL[kind]
        for pattern, kinds in _FAMILIES:
            found = pattern.match(kind)
            if found and int(found[1]) in kinds:
                return kinds[int(found[1])], int(found[1])
        problem = f"elements of type {kind or '(none)'} are not supported: they would add mass or stiffness"
        cure = "take tetrahedra C3D10 or C3D4, and remove these elements if they do not matter"
        raise self.fault.at(card.line, problem, cure)

    def _nset(self, card: Card) -> None:
        members = self._members(self.open.node_sets, self._name(card, "NSET"))
        if "ELSET" in card.keys:
            members.of_elements.append((card.keys["ELSET"], self._owner(card), card.line))
        self._rows(members, card)

    def _elset(self, card: Card) -> None:
        self._rows(self._members(self.open.element_sets, self._name(card, "ELSET")), card)

    def _rows(self, members: _Members, card: Card) -> None:
        owner = self._owner(card)
        for line in card.data:
            cells = split(line.text)
            if "GENERATE" not in card.keys:
                members.rows.append((cells, owner, line))
                continue
            try:
                first, last, step = (int(cell) for cell in (*cells, "1")[:3]) if len(cells) > 1 else (0, 0, 0)
            except ValueError:
                step = 0
            if step <= 0 or last < first:
                raise self.fault.at(line, "is no range", "write first number, last number, increment")
            members.ranges.append((first, last, step, owner))

    def _surface(self, card: Card) -> None:
        members = self._members(self.open.surfaces, self._name(card, "NAME"))
        kind = card.keys.get("TYPE", "ELEMENT").upper()
        if kind in ("ELEMENT", "NODE") and "COMBINE" not in card.keys:
            members.rows += [([kind, *split(line.text)], _NONE, line) for line in card.data]

    def _owner(self, card: Card) -> str:
        """Instance that a card of the assembly speaks of."""
        title = card.keys.get("INSTANCE", "")
        if title and title.casefold() not in self.spaces:
            known = ", ".join(filter(None, self.titles.values())) or "none"
            raise self.fault.at(card.line, f"there is no instance {title!r} before this card; there are: {known}")
        return title.casefold()

    def _name(self, card: Card, key: str) -> str:
        if not card.keys.get(key):
            raise self.fault.at(card.line, f"the card *{card.name} has no {key}=", f"write {key}=name")
        return card.keys[key]

    def _members(self, sets: dict[str, _Members], name: str) -> _Members:
        return sets.setdefault(name.casefold(), _Members(name))

    def _reals(self, line: Line, count: int) -> list[float]:
        """Numbers of a line, filled with zeros; finite."""
        cells = split(line.text)
        try:
            numbers = [real(cell) for cell in cells] + [0.0] * (count - len(cells))
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(map(math.isfinite, numbers)):
            raise self.fault.at(line, f"must have up to {count} numbers: {line.text[:60]!r}")
        return numbers

    # ---- the whole ----

    def _mesh(self) -> SourceMesh:
        labels = [(key, number) for key, space in self.spaces.items() for number in space.nodes]
        self.row = {label: i for i, label in enumerate(labels)}
        points = [point for space in self.spaces.values() for point in space.nodes.values()]
        if not points:
            raise InputError(self.fault.field, self.fault.path.name, "has no nodes (*NODE)", "is the file whole?")
        cells: dict[str, list[list[int]]] = {}
        for key, space in self.spaces.items():
            for number, (kind, names, line) in space.elements.items():
                nodes = [self._row(name, key, number, line) for name in names]
                cells.setdefault(kind, []).append(nodes)
                self.nodes_of[key, number] = nodes
        groups = self._groups()
        notes = tuple(
            f"the set {name} lists {count} numbers that the file does not define: they are left out"
            for name, count in self.lost.items()
        )
        self._check_joined()
        arrays = {kind: np.array(rows, dtype=np.int64) for kind, rows in cells.items()}
        return SourceMesh(np.array(points, dtype=float), arrays, groups, notes)

    def _check_joined(self) -> None:
        """Raise `InputError` where solid elements of several instances share no nodes: instances have their own."""
        solids = {
            key: sum(kind in _SOLIDS.values() for kind, _, _ in space.elements.values())
            for key, space in self.spaces.items()
        }
        apart = [f"{self.titles[key]} ({count} elements)" for key, count in solids.items() if key != _NONE and count]
        if len(apart) > 1 and not solids[_NONE]:
            problem = f"the instances {', '.join(apart)} share no nodes, so they are separate bodies"
            cure = (
                "merge their meshes in the pre-processor (Abaqus/CAE: Merge/Cut Instances, mesh, merge nodes), "
                "or remove the *INSTANCE of what is not part of the housing"
            )
            raise InputError(self.fault.field, self.fault.path.name, problem, cure)

    def _row(self, name: str, key: str, number: int, line: Line) -> int:
        """Row of a node that an element names."""
        try:
            return self.row[self._label(name, key)]
        except (KeyError, ValueError):
            cure = "write all nodes into the file, or include theirs by *INCLUDE"
            raise self.fault.at(line, f"element {number} has the node {name!r}, which is not defined", cure) from None

    def _label(self, name: str, key: str) -> Label:
        """Label of ``number`` or ``instance.number``; ValueError for other words."""
        owner, point, number = name.rpartition(".")
        owner = owner.strip('" ').casefold() if point else key
        if owner not in self.spaces:
            raise ValueError(name)
        return owner, int(number)

    def _groups(self) -> dict[str, IntArray]:
        """Nodes by name: sets of nodes before surfaces before sets of elements of the same name.

        Those of instances have the name ``instance.name``, and ``name`` where only one instance has it.
        """
        found: dict[tuple[str, str], tuple[str, list[int]]] = {}
        for key, space in self.spaces.items():
            for name, members in space.node_sets.items():
                found[key, name] = members.name, [self.row[label] for label in self._labels("node_sets", key, name)]
            for name, members in space.surfaces.items():
                found.setdefault((key, name), (members.name, self._surface_nodes(key, members)))
            for name, members in space.element_sets.items():
                labels = self._labels("element_sets", key, name)
                nodes = [node for label in labels for node in self.nodes_of[label]]
                found.setdefault((key, name), (members.name, nodes))
        times = Counter(name for _, name in found)
        groups: dict[str, IntArray] = {}
        for (key, name), (title, nodes) in found.items():
            whole = np.unique(np.array(nodes, dtype=np.int64))
            if len(whole) and (key == _NONE or times[name] == 1):
                groups[title] = whole
            if len(whole) and key != _NONE:
                groups[f"{self.titles[key]}.{title}"] = whole
        return groups

    def _labels(self, kind: str, key: str, name: str, above: tuple[tuple[str, str], ...] = ()) -> set[Label]:
        """Nodes (``node_sets``) or elements (``element_sets``) of a set, with those of the sets that it names."""
        if (kind, key, name) in self.resolved:
            return self.resolved[kind, key, name]
        known = self.row if kind == "node_sets" else self.nodes_of
        members = getattr(self.spaces[key], kind)[name]
        found: set[Label] = set()
        for words, owner, line in members.rows:
            where = owner or key
            for word in filter(None, words):
                try:
                    label = self._label(word, where)
                except ValueError:
                    found |= self._named(kind, where, word, line, (*above, (key, name)))
                    continue
                if label in known:
                    found.add(label)
                else:
                    self.lost[members.name] = self.lost.get(members.name, 0) + 1
        for first, last, step, owner in members.ranges:
            space = self.spaces[owner or key]
            numbers = space.nodes if kind == "node_sets" else space.elements
            found |= {(owner or key, n) for n in numbers if first <= n <= last and (n - first) % step == 0}
        for word, owner, line in members.of_elements:
            rows = {
                n for element in self._named("element_sets", owner or key, word, line) for n in self.nodes_of[element]
            }
            found |= {label for label, row in self.row.items() if row in rows}
        self.resolved[kind, key, name] = found
        return found

    def _named(self, kind: str, key: str, word: str, line: Line, above: tuple[tuple[str, str], ...] = ()) -> set[Label]:
        """Members of a set by its name, or ``instance.name``."""
        text = word.strip('"').casefold()
        owner, _, inner = text.partition(".")
        if text not in getattr(self.spaces[key], kind) and inner and owner in self.spaces:
            key, text = owner, inner
        if text not in getattr(self.spaces[key], kind):
            raise self.fault.at(line, f"names {word!r}, which is neither a number nor a set", "define it, or remove it")
        if (key, text) in above:
            raise self.fault.at(line, f"the set {word!r} contains itself", "remove it there")
        if len(above) > DEEPEST:
            raise self.fault.at(line, f"more than {DEEPEST} sets contain each other", "list the numbers")
        return self._labels(kind, key, text, above)

    def _surface_nodes(self, key: str, members: _Members) -> list[int]:
        """Nodes of a surface: of faces S1 to S4 of tetrahedra, of elements without thickness, or of node sets."""
        found: list[int] = []
        for words, _, line in members.rows:
            kind, name, side = (*words, "", "")[:3]
            if not name:
                continue
            try:
                labels = {self._label(name, key)}
            except ValueError:
                labels = self._named("node_sets" if kind == "NODE" else "element_sets", key, name, line)
            if kind == "NODE":
                found += [self.row[label] for label in labels if label in self.row]
                continue
            for label in labels & self.nodes_of.keys():
                nodes, solid = self.nodes_of[label], self.spaces[label[0]].elements[label[1]][0]
                if not solid.startswith("tetra"):
                    found += nodes
                else:
                    found += [nodes[place] for place in _TETRA_FACES.get(side.upper(), []) if place < len(nodes)]
        return found


def _rotation(axis: Array, angle: float) -> Array:
    """Matrix of a rotation about a unit vector (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)
