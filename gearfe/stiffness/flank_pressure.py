"""Contact pressure along the flanks of a solved position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..contact.flank import Flank, edge_nodes, edge_shapes
from ..contact.half_plane_result import PairContacts
from ..contact.position import Positions
from ..contact.scene import MeshingPair
from ..typing import Array


@dataclass(frozen=True)
class FlankPressure:
    """Pressure along one tooth's contact surface; arrays have one entry per contact point or panel, from root to tip.

    Attributes
    ----------
    gear
        0 pinion, 1 wheel.
    pair, tooth
        Number of the tooth pair, and of the tooth.
    place : ndarray, shape (q,)
        Edge number plus position in the edge, along the tooth's whole contact surface.
    radius : ndarray, shape (q,)
        Distance of the undeformed point from the gear's centre (m).
    pressure : ndarray, shape (q,)
        Pa.
    """

    gear: int
    pair: int
    tooth: int
    place: Array
    radius: Array
    pressure: Array

    def at_nodes(self, count: int) -> Array:
        """Pressure (Pa) at the `count` nodes of the tooth's contact surface, linear between the contact points."""
        return np.asarray(np.interp(0.5 * np.arange(count), self.place, self.pressure, left=0.0, right=0.0))


def flank_pressures(pair: MeshingPair, position: Positions) -> list[FlankPressure]:
    """Pressure on each loaded flank of one solved position, from its points or the half-plane law's panels."""
    points = position.points
    if points is None:
        return _of_panels(pair, position.contacts)
    made: list[FlankPressure] = []
    for gear, number in dict.fromkeys(zip(points.gear.tolist(), points.pair.tolist(), strict=True)):
        mine = (points.gear == gear) & (points.pair == number)
        radius = np.linalg.norm(_points(pair.bodies[gear].flank, points.place[mine]), axis=1)
        tooth = number if gear == 0 else -1 - number
        made.append(FlankPressure(gear, number, tooth, points.place[mine], radius, points.pressure[mine]))
    return made


def _of_panels(pair: MeshingPair, contacts: PairContacts) -> list[FlankPressure]:
    """Pressure on the panels of the half-plane law."""
    made = []
    for k, number in enumerate(contacts.pair.tolist()):
        for g, tooth in enumerate((number, -1 - number)):
            nodes = np.linalg.norm(pair.bodies[g].flank.points, axis=1)
            radius, pressure = contacts.panel_radius[k, g], contacts.pressure[k]
            if g == 1:  # the panels run along the pinion's flank, against the wheel's
                radius, pressure = radius[::-1], pressure[::-1]
            place = 0.5 * np.interp(radius, nodes, np.arange(len(nodes)))
            made.append(FlankPressure(g, number, tooth, place, radius, pressure))
    return made


def _points(flank: Flank, place: Array) -> Array:
    """Points (m) of a tooth's contact surface, shape (q, 2)."""
    edge = np.clip(place.astype(np.int64), 0, flank.edges - 1)
    shapes = edge_shapes(place - edge)[0]
    return np.asarray(np.einsum("qa,qai->qi", shapes, flank.points[edge_nodes(edge)]))
