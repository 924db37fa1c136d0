"""A whole gear from its tooth sector: turned copies whose common sides share their nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import Array, IntArray
from .tooth_sector import SectorMesh


@dataclass(frozen=True)
class WholeGear:
    """Second-order triangles of a whole gear in the frame of its hub, which is that of tooth 0.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Node positions (m).
    triangles : ndarray, shape (m, 6)
        Corner nodes counter-clockwise, then the nodes in the middle of edges 01, 12, 20; tooth by tooth.
    boundaries : dict of str to ndarray, shape (k, 3)
        Outline edges (start, middle, end node): ``bore``, ``root``, ``flank_right``, ``flank_left``, ``tip``.
    contact : ndarray, shape (z, e, 3)
        `SectorMesh.contact_edges` of each tooth.
    numbers : ndarray, shape (z, s)
        Node of the whole gear for each tooth and each node of the sector.
    """

    points: Array
    triangles: IntArray
    boundaries: dict[str, IntArray]
    contact: IntArray
    numbers: IntArray


def whole_gear(mesh: SectorMesh) -> WholeGear:
    """Join `mesh.teeth` turned copies of a sector."""
    teeth, size = mesh.teeth, len(mesh.points)
    own = np.ones(size, dtype=bool)
    own[mesh.cut_left] = False
    local = np.cumsum(own) - 1
    count = int(own.sum())
    first = count * np.arange(teeth)
    numbers = first[:, None] + local
    # the left side of a sector is the right side of the next one
    numbers[:, mesh.cut_left] = np.roll(first, -1)[:, None] + local[mesh.cut_right]
    turns = 2 * np.pi * np.arange(teeth) / teeth
    x, y = mesh.points[own].T
    c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]
    points = np.stack([c * x - s * y, s * x + c * y], axis=-1).reshape(-1, 2)
    boundaries = {}
    for name in ("bore", "root", "flank_right", "flank_left", "tip"):
        parts = [mesh.boundaries[key] for key in (name, f"{name}_right", f"{name}_left") if key in mesh.boundaries]
        if parts:
            boundaries[name] = numbers[:, np.concatenate(parts)].reshape(-1, 3)
    contact = numbers[:, mesh.contact_edges()]
    return WholeGear(points, numbers[:, mesh.triangles].reshape(-1, 6), boundaries, contact, numbers)
