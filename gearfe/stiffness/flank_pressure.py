"""Contact pressure along the flanks of a solved position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.flank import Flank, edge_nodes, edge_shapes
from ..contact.half_plane_result import PairContacts
from ..contact.position import Position
from ..contact.scene import MeshingPair

Array = NDArray[Any]


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


def flank_pressures(pair: MeshingPair, position: Position) -> list[FlankPressure]:
    """Pressure on each piece of flank of a solved position.

    On a gear whose flank carries no contact points of its own (one-sided laws) it is what the mate's points press on
    it, at their closest places.
    """
    if position.contacts is not None:
        return _of_panels(pair, position.contacts)
    made: list[FlankPressure] = []
    points = position.points
    if points is None:
        return made
    for i, w in enumerate(position.windows):
        flank = pair.bodies[w.gear].flank
        mine = np.flatnonzero(points.owner == i)
        if len(mine):
            place = w.first_edge + _own_places(flank, w.edges, len(mine))
        else:
            mine = np.flatnonzero(points.facing == i)
            mine = mine[np.argsort(points.place[mine], kind="stable")]
            place = w.first_edge + points.place[mine]
        radius = np.linalg.norm(_points(flank, place), axis=1)
        number = w.tooth if w.gear == 0 else -1 - w.tooth
        made.append(FlankPressure(w.gear, number, w.tooth, place, radius, points.pressure[mine]))
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


def _own_places(flank: Flank, edges: int, count: int) -> Array:
    """Edge plus position in it of the contact points of a piece of flank."""
    xi = flank.shapes @ np.array([0.0, 0.5, 1.0])  # the shape functions reproduce the coordinate itself
    assert count == edges * len(xi)
    return np.asarray((np.arange(edges)[:, None] + xi).ravel())


def _points(flank: Flank, place: Array) -> Array:
    """Points (m) of a tooth's contact surface, shape (q, 2)."""
    edge = np.clip(place.astype(np.int64), 0, flank.edges - 1)
    shapes = edge_shapes(place - edge)[0]
    return np.asarray(np.einsum("qa,qai->qi", shapes, flank.points[edge_nodes(edge)]))
