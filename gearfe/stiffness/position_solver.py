"""Who solves positions of a pair for sweeps, maps and fields: the half-plane solver, or the routes of other laws."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..contact.half_plane import half_plane_pair, solve_half_plane
from ..contact.half_plane_loads import with_loads
from ..contact.half_plane_result import HalfPlaneSolution
from ..contact.laws import HalfPlane
from ..contact.records import joined, taken
from ..contact.scene import MeshingPair
from ..contact.solver import Position
from ..errors import InputError
from ..gear.pair import GearPair
from ..gear.touching import Flanks, Touching
from .routes import Route, Router

Array = NDArray[Any]


class PositionSolver(Protocol):
    """What solves positions of one pair."""

    @property
    def pair(self) -> GearPair: ...
    @property
    def elastic(self) -> MeshingPair: ...
    @property
    def flanks(self) -> Flanks: ...
    @property
    def torque_tolerance(self) -> float: ...
    def solve(self, angles: Array, twists: Array, kept: Collection[int] = ()) -> list[Position]: ...
    def touching_twists(self, angles: Array) -> Array: ...
    def touching(self, angles: Array) -> list[Touching]: ...


def position_solver(pair: GearPair, elastic: MeshingPair, route: Route = "auto") -> PositionSolver:
    """The solver of the elastic pair's law; `route` is for the laws on the mesh, see `gearfe.stiffness.routes`."""
    if not isinstance(elastic.law, HalfPlane):
        return Router(pair, elastic, route)
    if route != "auto":
        raise InputError("route", route, "has no meaning with the law half_plane", "leave it out")
    return HalfPlaneSolver(pair, elastic)


class HalfPlaneSolver:
    """Positions of one pair by the half-plane law."""

    #: Relative change of the forces from one step of the balance to the next leaves this of the torque.
    torque_tolerance = 1e-7

    def __init__(self, pair: GearPair, elastic: MeshingPair) -> None:
        self.pair, self.elastic = pair, elastic
        self.law = half_plane_pair(pair, elastic)
        self.flanks = self.law.flanks
        self._numbers: dict[float, int] = {}
        self._known = self.flanks.touching(np.zeros(0))

    def solve(self, angles: Array, twists: Array, kept: Collection[int] = ()) -> list[Position]:
        """Positions at pinion angles and twists (rad), both of shape (n,); `kept` ones with what fields need."""
        found = solve_half_plane(self.law, angles, twists, touching=self._touching(np.asarray(angles, dtype=float)))
        ends = np.searchsorted(found.contacts.position, np.arange(len(found) + 1))
        made = []
        for i in range(len(found)):
            position = _position(found, i, slice(int(ends[i]), int(ends[i + 1])))
            if i in kept and position.contacts is not None:
                place = float(found.pinion_angle[i]), float(found.twist[i])
                position = with_loads(position, self.law.sides, self.elastic, position.contacts, *place)
            made.append(position)
        return made

    def touching_twists(self, angles: Array) -> Array:
        """Twists (rad) at which the rigid gears just touch."""
        found = self._touching(np.asarray(angles, dtype=float))
        made = np.full(len(angles), math.inf)
        np.minimum.at(made, found.position, found.twist)
        return made

    def touching(self, angles: Array) -> list[Touching]:
        """Tooth pairs whose rigid flanks can meet, one entry an angle (rad)."""
        found = self._touching(np.asarray(angles, dtype=float))
        ends = np.searchsorted(found.position, np.arange(len(angles) + 1))
        return [found.take(slice(first, end)) for first, end in itertools.pairwise(ends.tolist())]

    def _touching(self, angles: Array) -> Touching:
        """The same in one, by position; searched for once an angle."""
        new = np.array(sorted(set(angles.tolist()) - self._numbers.keys()))
        if len(new):
            found = self.flanks.touching(new)
            found = replace(found, position=found.position + len(self._numbers))
            self._known = joined([self._known, found])
            self._numbers |= {angle: number for number, angle in enumerate(new.tolist(), start=len(self._numbers))}
        numbers = np.array([self._numbers[angle] for angle in angles.tolist()], dtype=np.int64)
        first, end = (np.searchsorted(self._known.position, numbers, side=side) for side in ("left", "right"))
        counts = end - first
        position = np.repeat(np.arange(len(angles)), counts)
        place = np.arange(len(position)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
        return replace(self._known.take(place), position=position)


def _position(found: HalfPlaneSolution, i: int, pairs: slice) -> Position:
    status = str(found.status[i])
    contacts = taken(found.contacts, pairs)
    position = Position(
        status=status,
        torque_wheel=float(found.torque_wheel[i]),
        torque_pinion=float(found.torque_pinion[i]),
        torque_wheel_reaction=float(found.torque_wheel_reaction[i]),
        tangent=float(found.tangent[i]),
        pair_numbers=tuple(contacts.pair.tolist()),
        pair_torques=contacts.torque_wheel,
        peak_pressure=0.0 if status == "no_contact" else math.nan,
        iterations=int(found.iterations[i]),
        pair_widths=contacts.half_width,
        route="half_plane",
    )
    if len(contacts) == 0:
        return position
    return replace(position, contacts=contacts, peak_pressure=float(contacts.pressure.max()))
