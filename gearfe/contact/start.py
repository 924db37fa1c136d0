"""Hertzian guess of the contact: where Newton's method starts, at any position and load, without a neighbour's help."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import gap_rows, unreached
from .scene import MeshingPair, Scene

Array = NDArray[Any]


def starting_state(pair: MeshingPair, scene: Scene) -> tuple[Array, Array]:
    """Pressures (Pa), shape (q,), and forces (N), shape (2n,), of elliptic contacts about each overlap's deepest point.

    The forces follow from the pairs' mutual compliances under those pressures: C F = overlap, F >= 0. The half width
    follows from the force, b^2 = 4 F rho/(pi E* w) (Johnson, *Contact Mechanics*, 1985, eq. 4.43), with rho from the
    overlap, reach^2 = 2 rho depth.
    """
    projection = scene.rigid
    areas = scene.areas(projection.place)
    overlapped = (projection.gap < 0) & (projection.place <= scene.counts[scene.mate])
    slave = scene.slaves(scene.points)
    effective = 1 / sum(b.material.contact_compliance(b.plane) for b in pair.bodies)
    centre, depth, radius = _geometry(scene, slave, overlapped)
    nearest = np.array([_third_nearest(slave[scene.owner == i], centre[i]) for i in range(len(scene.windows))])
    distance = np.linalg.norm(slave - centre[scene.owner], axis=1)
    reachable = ~unreached(scene.rigid.gap)
    half_width = np.sqrt(0.12 * radius * np.maximum(depth, 0.0))
    forces, pressure = np.zeros(scene.pairs), np.zeros(len(areas))
    for _ in range(2):
        width = np.maximum(half_width[scene.pair], 1.2 * nearest[scene.owner])
        shape = np.where(reachable, np.sqrt(np.maximum(0.0, 1 - (distance / width) ** 2)), 0.0)
        total = np.bincount(scene.pair, weights=shape * areas, minlength=scene.pairs)
        shape /= np.maximum(total, 1e-300)[scene.pair]
        used = np.flatnonzero(shape > 0)
        rows = gap_rows(projection.take(used), scene.slave_nodes[used], scene.slave_shapes[used], scene.rotation)
        loads = rows.normal * (shape * areas)[used, None, None]
        unknown = 2 * rows.nodes[:, :, None] + np.arange(2)
        size = 2 * len(scene.points)
        slot = scene.pair[used, None, None] * size + unknown
        unit = np.bincount(slot.ravel(), weights=loads.ravel(), minlength=scene.pairs * size).reshape(-1, size)
        mutual = unit @ scene.compliance @ unit.T
        overlap = -np.bincount(scene.pair, weights=shape * areas * scene.rigid.gap, minlength=scene.pairs)
        forces = carried(mutual, overlap)
        half_width = np.sqrt(4 * forces * radius / (np.pi * effective * pair.width))
        pressure = forces[scene.pair] * shape
    return pressure, forces @ unit


def _geometry(scene: Scene, slave: Array, overlapped: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Deepest point of each window (its place), overlap depth and relative radius of curvature of each pair (m)."""
    centre = np.zeros((len(scene.windows), 2))
    depth, radius = np.zeros(scene.pairs), np.zeros(scene.pairs)
    for i, window in enumerate(scene.windows):
        mine = np.flatnonzero((scene.owner == i) & overlapped)
        if len(mine) == 0:
            own = np.flatnonzero(scene.owner == i)
            if len(own):
                centre[i] = slave[own[np.argmin(scene.rigid.gap[own])]]
            continue
        bottom = mine[np.argmin(scene.rigid.gap[mine])]
        centre[i] = slave[bottom]
        k = window.pair
        depth[k] = max(depth[k], -scene.rigid.gap[bottom])
        # curvature of the gap: least squares of gap + depth = s^2 / (2 rho) over the overlapped points
        square = np.sum((slave[mine] - slave[bottom]) ** 2, axis=1)
        rise = scene.rigid.gap[mine] - scene.rigid.gap[bottom]
        slope = float(square @ rise)
        radius[k] = max(radius[k], float(square @ square) / (2 * slope) if slope > 0 else 0.0)
    return centre, depth, radius


def _third_nearest(points: Array, centre: Array) -> float:
    """Distance to the third nearest contact point: a guess that holds fewer points than that is no line contact."""
    if len(points) == 0:
        return 0.0
    distance = np.sum((points - centre) ** 2, axis=1)
    return float(np.sqrt(np.partition(distance, min(2, len(distance) - 1))[min(2, len(distance) - 1)]))


def carried(compliance: Array, overlap: Array) -> Array:
    """Forces F >= 0 with C F = overlap where F > 0: pairs that would pull are let go, the weakest first."""
    active = (overlap > 0) & (np.diagonal(compliance) > 0)
    if active.all():
        forces = np.linalg.solve(compliance, overlap)
        if forces.min() >= 0:
            return forces
    while active.any():
        forces = np.zeros(len(overlap))
        forces[active] = np.linalg.solve(compliance[np.ix_(active, active)], overlap[active])
        if (forces >= 0).all():
            return forces
        active[np.argmin(forces)] = False
    return np.zeros(len(overlap))
