"""Who solves positions of a pair for sweeps, maps and fields: the half-plane law, or finite elements at the contact."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..contact.elements import first_contacts, solve_elements
from ..contact.half_plane import half_plane_pair, solve_half_plane
from ..contact.half_plane_loads import with_loads
from ..contact.half_plane_result import HalfPlaneSolution
from ..contact.laws import HalfPlane
from ..contact.position import Position, unsolved
from ..contact.records import joined, taken
from ..contact.scene import MeshingPair
from ..gear.pair import GearPair
from ..gear.touching import Flanks, Touching

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


def position_solver(
    pair: GearPair, elastic: MeshingPair, *, resolved_only: bool = True
) -> HalfPlaneSolver | ElementSolver:
    """The solver of the elastic pair's law; see `ElementSolver` for `resolved_only`."""
    if isinstance(elastic.law, HalfPlane):
        return HalfPlaneSolver(pair, elastic)
    return ElementSolver(pair, elastic, resolved_only=resolved_only)


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
    )
    if len(contacts) == 0:
        return position
    return replace(position, contacts=contacts, peak_pressure=float(contacts.pressure.max()))


class ElementSolver:
    r"""Positions of one pair by a law on the finite elements of its flanks, where these resolve the contact.

    The half-plane law of the same gears tells beforehand which tooth pairs bear, with the forces :math:`F_k`, and how
    wide their contacts are (:math:`2b_k`). Where

    .. math:: \sum_k F_k\,\frac{h_k}{2b_k} > \sum_k F_k

    with the longer of both flanks' elements there, :math:`h_k`, the contact is narrower than an element. The torque
    then swings with the place of the nodes (docs/contact_laws.md), and the position is ``under_resolved``.

    Parameters
    ----------
    resolved_only
        False solves what the elements do not resolve, too: to measure the error that this makes.
    """

    #: Relative accuracy to which torques can be searched for.
    torque_tolerance = 1e-10

    def __init__(self, pair: GearPair, elastic: MeshingPair, *, resolved_only: bool = True) -> None:
        self.pair, self.elastic, self.resolved_only = pair, elastic, resolved_only
        self.half_plane = HalfPlaneSolver(pair, elastic)
        self.flanks = self.half_plane.flanks

    def solve(self, angles: Array, twists: Array, kept: Collection[int] = ()) -> list[Position]:
        """Positions at pinion angles and twists (rad), both of shape (n,); `kept` ones with what fields need."""
        twists = np.broadcast_to(np.asarray(twists, dtype=float), np.shape(angles))
        expected = self.half_plane.solve(angles, twists)
        made = [unsolved(p.status, p.iterations) for p in expected]
        for i, position in enumerate(expected):
            if position.status == "converged" and self.resolved_only and self.elements_per_contact(position) < 1.0:
                made[i] = unsolved("under_resolved", position.iterations)
        open_ = np.array([i for i, p in enumerate(made) if p.status == "converged"], dtype=np.int64)
        if len(open_):
            contacts = joined([expected[i].contacts for i in open_])
            first = first_contacts(self.half_plane.law.sides, contacts)
            solved = solve_elements(self.elastic, angles, twists, first)
            for i in open_:
                made[i] = solved[i]
        return [p if i in kept else bare(p) for i, p in enumerate(made)]

    def elements_per_contact(self, position: Position) -> float:
        """Elements of the flank within the width 2b of a contact: harmonic mean, by force, over the tooth pairs of a
        position of `half_plane`.
        """
        contacts = position.contacts
        assert contacts is not None
        sizes = np.zeros(len(contacts))
        for gear, (side, body) in enumerate(zip(self.half_plane.law.sides, self.elastic.bodies, strict=True)):
            ends = np.cumsum(body.flank.sizes)
            edge = np.searchsorted(ends, contacts.arc[:, gear] + side.offset)
            sizes = np.maximum(sizes, body.flank.sizes[np.minimum(edge, len(ends) - 1)])
        return float(contacts.force.sum() / (contacts.force @ (sizes / (2 * contacts.half_width))))

    def touching_twists(self, angles: Array) -> Array:
        """Twists (rad) at which the rigid gears just touch."""
        return self.half_plane.touching_twists(angles)

    def touching(self, angles: Array) -> list[Touching]:
        """Tooth pairs whose rigid flanks can meet, one entry an angle (rad)."""
        return self.half_plane.touching(angles)


def bare(position: Position) -> Position:
    """The position without what only fields need: a scene holds megabytes."""
    return replace(position, windows=(), forces=None, force_rate=None, points=None)
