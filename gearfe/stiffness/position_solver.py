"""Who solves positions of a pair for sweeps, maps and fields: the half-plane law, or finite elements at the contact."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..contact.elements import first_contacts, solve_elements
from ..contact.half_plane import half_plane_pair, solve_half_plane
from ..contact.half_plane_loads import flank_loads
from ..contact.laws import HalfPlane
from ..contact.position import Positions
from ..contact.records import joined, of_positions, taken
from ..contact.scene import MeshingPair
from ..gear.pair import GearPair
from ..gear.touching import Touching
from ..typing import Array, IntArray

NONE: IntArray = np.zeros(0, dtype=np.int64)


def position_solver(pair: GearPair, elastic: MeshingPair, *, resolved_only: bool = True) -> PositionSolver:
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
        self.curves = [self.law.curves[flank] for flank in self.law.teeth.flank(np.zeros(1, dtype=np.int64))[0]]
        self._angles = np.zeros(0)
        self._known = self.law.teeth.touching(self._angles)

    def solve(self, angles: Array, twists: Array, kept: IntArray = NONE) -> Positions:
        """Positions at pinion angles and twists (rad), both of shape (n,); those numbered `kept` with loads."""
        found = solve_half_plane(self.law, angles, twists, touching=self.touching(angles))
        wanted = taken(found.contacts, np.isin(found.contacts.position, kept))
        loads = flank_loads(self.law.sides, self.elastic, wanted, found.pinion_angle, found.twist)
        return replace(found, loads=loads)

    def touching_twists(self, angles: Array) -> Array:
        """Twists (rad) at which the rigid gears just touch."""
        found = self.touching(angles)
        made = np.full(len(angles), math.inf)
        np.minimum.at(made, found.position, found.twist)
        return made

    def touching(self, angles: Array) -> Touching:
        """Tooth pairs whose rigid flanks can meet at pinion angles (rad), by position; searched for once an angle."""
        new = np.setdiff1d(angles, self._angles)
        if len(new):
            found = self.law.teeth.touching(new)
            found = replace(found, position=found.position + len(self._angles))
            self._known = joined([self._known, found])
            self._angles = np.concatenate([self._angles, new])
        order = np.argsort(self._angles)
        return of_positions(self._known, order[np.searchsorted(self._angles, angles, sorter=order)])


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
        self.curves = self.half_plane.curves
        self.touching, self.touching_twists = self.half_plane.touching, self.half_plane.touching_twists

    def solve(self, angles: Array, twists: Array, kept: IntArray = NONE) -> Positions:
        """Positions at pinion angles and twists (rad), both of shape (n,); those numbered `kept` with loads."""
        expected = self.half_plane.solve(angles, twists)
        loaded = expected.status == "converged"
        thin = loaded & self.resolved_only & (self.elements_per_contact(expected) < 1.0)
        contacts = expected.contacts
        first = first_contacts(self.half_plane.law.sides, taken(contacts, ~thin[contacts.position]))
        found = solve_elements(self.elastic, expected.pinion_angle, expected.twist, first)
        status = np.where(thin, "under_resolved", np.where(loaded, found.status, expected.status))
        iterations = np.where(loaded & ~thin, found.iterations, expected.iterations)
        return replace(found.stated(status), iterations=iterations).told(np.isin(np.arange(len(found)), kept))

    def elements_per_contact(self, found: Positions) -> Array:
        """Elements that see the contact of positions of `half_plane`, shape (n,): harmonic means, by force, over their
        tooth pairs; not-a-number without contact.
        """
        contacts = found.contacts
        sizes = np.zeros(len(contacts))
        for gear, (side, body) in enumerate(zip(self.half_plane.law.sides, self.elastic.bodies, strict=True)):
            edge, _ = body.flank.place(contacts.arc[:, gear] + side.offset)
            sizes = np.maximum(sizes, body.flank.sizes[edge])
        weights = contacts.force, contacts.force * sizes / (2 * contacts.half_width)
        force, spread = (np.bincount(contacts.position, weight, len(found)) for weight in weights)
        return np.divide(force, spread, out=np.full(len(found), np.nan), where=spread > 0)


PositionSolver = HalfPlaneSolver | ElementSolver
