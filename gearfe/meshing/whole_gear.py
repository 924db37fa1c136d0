"""A whole gear from one tooth sector: turned copies, merged along their cut sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .tooth_sector import SectorMesh

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class WholeGear:
    """Second-order triangles of a whole gear, tooth 0 centred on the x axis, the others counter-clockwise.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Node positions (m).
    triangles : ndarray, shape (m, 6)
        Corner nodes counter-clockwise, then the nodes in the middle of edges 01, 12, 20; sector after sector.
    boundaries : dict of str to ndarray, shape (k, 3)
        Outline edges (start, middle, end node) as in `SectorMesh`, without the cut sides, tooth after tooth.
    contact : ndarray, shape (z, e, 3)
        `SectorMesh.contact_edges` of each tooth.
    node_of : ndarray, shape (z, sector nodes)
        Node of the whole gear that each sector node has become: the way for fields from sectors to the gear.
    """

    points: Array
    triangles: IntArray
    boundaries: dict[str, IntArray]
    contact: IntArray
    node_of: IntArray


def whole_gear(sector: SectorMesh) -> WholeGear:
    """Turn a sector round the gear; a node on two sectors' common side is taken from the right side of the left one."""
    z, count = sector.teeth, len(sector.points)
    inner = np.ones(count, dtype=bool)
    inner[sector.cut_left] = False
    number = np.cumsum(inner) - 1
    kept = int(inner.sum())
    tooth = np.arange(z)[:, None]
    node_of = tooth * kept + number
    node_of[:, sector.cut_left] = (tooth + 1) % z * kept + number[sector.cut_right]
    angle = 2 * np.pi / z * np.arange(z)
    turns = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    points = np.einsum("ijz,nj->zni", turns, sector.points[inner]).reshape(-1, 2)
    outline = {n: e for n, e in sector.boundaries.items() if not n.startswith("cut")}
    return WholeGear(
        points=points,
        triangles=node_of[:, sector.triangles].reshape(-1, 6),
        boundaries={name: node_of[:, edges].reshape(-1, 3) for name, edges in outline.items()},
        contact=node_of[:, sector.contact_edges()],
        node_of=node_of,
    )
