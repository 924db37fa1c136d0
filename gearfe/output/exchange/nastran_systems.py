"""Transform nodes from local coordinate systems of Nastran to the basic one (Quick Reference Guide: CORD1R to CORD2S,
GRID).

CORD2x has three points in the system RID: the origin A, B on the z axis, and C in the half plane of x and z. CORD1x:
the same by nodes. Cylindrical coordinates are r, theta (deg), z; spherical ones r, theta from the z axis, phi (deg).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .included import Line
from .nastran_cards import number

#: Sine of the angle between the axes that a system's three points give, below which they lie in a line.
_LEAST_SINE = 1e-9
_BASIC = ("", "0")

Point = tuple[float, float, float]


class _Definition(NamedTuple):
    """A system: R, C or S, its line, and three points in another system, or three nodes."""

    kind: str
    line: Line
    points: tuple[Point, ...] = ()
    within: str = "0"
    nodes: tuple[int, ...] = ()


class _Axes(NamedTuple):
    """A system in the basic one: kind, axes as columns, and origin."""

    kind: str
    axes: Array
    origin: Array


class Systems:
    """The coordinate systems of a file."""

    def __init__(self, path: Path, field: str) -> None:
        self.path, self.field = path, field
        self.definitions: dict[str, _Definition] = {}
        self.axes: dict[str, _Axes] = {}

    def add(self, card: list[str], line: Line) -> None:
        """Add the systems of an entry CORD1x or CORD2x; ValueError or IndexError where it cannot be read."""
        kind = card[0][-1]
        if card[0].startswith("CORD2"):
            if len(card) <= 11:
                raise ValueError("a coordinate system has three points")
            a, b, c = (tuple(number(text or "0") for text in card[i : i + 3]) for i in (3, 6, 9))
            self._define(card[1], _Definition(kind, line, (a, b, c), card[2] or "0"))  # type: ignore[arg-type]
            return
        for first in (1, 5):
            if any(card[first : first + 4]):
                nodes = tuple(int(text) for text in card[first + 1 : first + 4])
                self._define(card[first], _Definition(kind, line, nodes=nodes))

    def _define(self, name: str, definition: _Definition) -> None:
        key = str(int(name))
        held = self.definitions.setdefault(key, definition)
        if held._replace(line=definition.line) != definition or key == "0":
            problem = f"{definition.line.place}: the coordinate system {key} is defined twice, differently"
            raise InputError(self.field, self.path.name, problem, "renumber one of them")

    def basic(self, grids: Mapping[int, tuple[Point, str, Line]]) -> Array:
        """Places of nodes (point, system, line) in the basic system, shape (n, 3).

        Raises
        ------
        InputError
            For systems that are missing, defined by themselves, or by points in a line.
        """
        places = np.array([point for point, _, _ in grids.values()], dtype=float).reshape(-1, 3)
        names = [name for _, name, _ in grids.values()]
        first = {name: line for _, name, line in reversed(list(grids.values()))}
        for name, line in first.items():
            if name not in _BASIC:
                chosen = np.array([own == name for own in names])
                axes = self._axes(name, line, grids, ())
                places[chosen] = [_place(axes, point) for point in places[chosen]]
        return places

    def _axes(
        self, name: str, line: Line, grids: Mapping[int, tuple[Point, str, Line]], above: tuple[str, ...]
    ) -> _Axes:
        """Axes of a system, in the basic one."""
        if name in _BASIC:
            return _Axes("R", np.eye(3), np.zeros(3))
        try:
            key = str(int(name))
        except ValueError:
            key = name
        if key in self.axes:
            return self.axes[key]
        if key not in self.definitions:
            known = ", ".join(self.definitions) or "none"
            problem = f"{line.place}: there is no coordinate system {name}; the file defines: {known}"
            raise InputError(self.field, self.path.name, problem, "include its CORD2R, or write in the basic system")
        definition = self.definitions[key]
        if key in above:
            problem = f"{definition.line.place}: the coordinate system {key} is defined by itself"
            raise InputError(self.field, self.path.name, problem, "define it in the basic system")
        corners = []
        for point in definition.points:
            corners.append(_place(self._axes(definition.within, definition.line, grids, (*above, key)), point))
        for node in definition.nodes:
            if node not in grids:
                problem = f"{definition.line.place}: there is no node {node} for this coordinate system"
                raise InputError(self.field, self.path.name, problem, "include its GRID entry")
            point, own, at = grids[node]
            corners.append(_place(self._axes(own, at, grids, (*above, key)), point))
        origin, up, side = corners[0], corners[1] - corners[0], corners[2] - corners[0]
        lengths = float(np.linalg.norm(up) * np.linalg.norm(side))
        across = np.cross(up, side)
        if not np.linalg.norm(across) > _LEAST_SINE * lengths:
            problem = f"{definition.line.place}: the three points of the coordinate system {key} lie in a line"
            raise InputError(self.field, self.path.name, problem, "correct them")
        z, y = up / np.linalg.norm(up), across / np.linalg.norm(across)
        self.axes[key] = _Axes(definition.kind, np.column_stack([np.cross(y, z), y, z]), origin)
        return self.axes[key]


def _place(system: _Axes, point: Point | Array) -> Array:
    """A point of a system in the basic one."""
    a, b, c = point
    if system.kind == "C":
        theta = np.radians(b)
        a, b = a * np.cos(theta), a * np.sin(theta)
    elif system.kind == "S":
        theta, phi = np.radians(b), np.radians(c)
        a, b, c = a * np.sin(theta) * np.cos(phi), a * np.sin(theta) * np.sin(phi), a * np.cos(theta)
    return np.asarray(system.origin + system.axes @ np.array([a, b, c], dtype=float))
