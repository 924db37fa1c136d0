"""Hertzian guesses of the contacts of many positions at once; the formulas are those of `gearfe.contact.start`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Projection, gap_rows, unreached
from .group import Group
from .scene import MeshingPair
from .start import carried

Array = NDArray[Any]
IntArray = NDArray[Any]


def starting_states(pair: MeshingPair, group: Group, rigid: Projection) -> tuple[Array, Array]:
    """Pressures (Pa), shape (q,), and forces (N), shape (2n,), of elliptic contacts, see `start.starting_state`."""
    areas = group.areas(rigid.place)
    effective = 1 / sum(body.material.contact_compliance(body.plane) for body in pair.bodies)
    slave = group.slaves(group.points)
    couple = group.couple[group.owner]
    couples = int(group.first_window[-1]) // 2
    distance, depth, radius = _geometry(group, rigid, slave)
    nearest = _third_nearest(group, distance)
    reachable = ~unreached(rigid.gap)
    half_width = np.sqrt(0.12 * radius * np.maximum(depth, 0.0))
    pressure, forces = np.zeros(len(areas)), np.zeros(2 * len(group.points))
    for _ in range(2):
        width = np.maximum(half_width[couple], 1.2 * nearest[group.owner])
        shape = np.where(reachable, np.sqrt(np.maximum(0.0, 1 - (distance / width) ** 2)), 0.0)
        total = np.bincount(couple, weights=shape * areas, minlength=couples)
        shape /= np.maximum(total, 1e-300)[couple]
        used = np.flatnonzero(shape > 0)
        rows = gap_rows(rigid.take(used), group.slave_nodes[used], group.slave_shapes[used], group.rotation)
        loads = rows.normal * (shape * areas)[used, None, None]
        unknown = 2 * rows.nodes[:, :, None] + np.arange(2)
        unit = np.bincount(unknown.ravel(), weights=loads.ravel(), minlength=2 * len(group.points))
        overlap = -np.bincount(couple, weights=shape * areas * rigid.gap, minlength=couples)
        force = _forces(group, unit, overlap)
        half_width = np.sqrt(4 * force * radius / (np.pi * effective * pair.width))
        pressure = force[couple] * shape
        forces = np.repeat(force[group.couple[group.node_window]], 2) * unit
    return pressure, forces


def _geometry(group: Group, rigid: Projection, slave: Array) -> tuple[Array, Array, Array]:
    """Distance of each contact point from the deepest point of its window; depth and relative radius of each couple."""
    windows, couples = len(group.counts), int(group.first_window[-1]) // 2
    overlapped = (rigid.gap < 0) & (rigid.place <= group.counts[group.facing])
    first = group.first_point[:-1]
    filled = np.flatnonzero(np.diff(group.first_point))
    # the deepest of the overlapped points, or of all where there is none
    any_overlap = np.bincount(group.owner[overlapped], minlength=windows) > 0
    gap = np.where(overlapped | ~any_overlap[group.owner], rigid.gap, np.inf)
    lowest = np.full(windows, np.inf)
    lowest[filled] = np.minimum.reduceat(gap, first[filled])
    hits = np.flatnonzero(gap == lowest[group.owner])
    bottom = np.zeros(windows, dtype=np.int64)
    bottom[group.owner[hits][::-1]] = hits[::-1]
    away = slave - slave[bottom[group.owner]]
    square = away[:, 0] ** 2 + away[:, 1] ** 2
    # curvature of the gap: least squares of gap + depth = s^2 / (2 rho) over the overlapped points
    rise = np.where(overlapped, rigid.gap - lowest[group.owner], 0.0)
    slope = np.bincount(group.owner, weights=square * rise, minlength=windows)
    weight = np.bincount(group.owner, weights=np.where(overlapped, square**2, 0.0), minlength=windows)
    rho = np.divide(weight, 2 * slope, out=np.zeros(windows), where=slope > 0)
    depth, radius = np.zeros(couples), np.zeros(couples)
    np.maximum.at(depth, group.couple[any_overlap], -lowest[any_overlap])
    np.maximum.at(radius, group.couple[any_overlap], rho[any_overlap])
    return np.sqrt(square), depth, radius


def _third_nearest(group: Group, distance: Array) -> Array:
    """Of each window the distance to the third nearest contact point, shape (W,)."""
    order = np.lexsort((distance, group.owner))
    count = np.diff(group.first_point)
    filled = np.flatnonzero(count)
    nearest = np.zeros(len(count))
    nearest[filled] = distance[order[group.first_point[filled] + np.minimum(2, count[filled] - 1)]]
    return nearest


def _forces(group: Group, unit: Array, overlap: Array) -> Array:
    """Force of each couple (N), shape (couples,), from the mutual compliances under the unit loads."""
    couples = np.diff(group.first_window) // 2
    node_couple = group.couple[group.node_window]
    place = node_couple - (group.first_window[:-1] // 2)[group.position[group.node_window]]  # within its position
    columns = []
    for k in range(int(couples.max())):  # the displacements for one couple's unit load after the other
        loads = np.where(np.repeat(place == k, 2), unit, 0.0)
        moved = group.respond(loads, np.flatnonzero(couples > k).tolist())[0]
        columns.append(np.bincount(np.repeat(node_couple, 2), weights=unit * moved, minlength=len(overlap)))
    mutual, force = np.array(columns), np.zeros(len(overlap))
    for first, count in zip((group.first_window[:-1] // 2).tolist(), couples.tolist(), strict=True):
        own = slice(first, first + count)
        force[own] = carried(mutual[:count, own], overlap[own])
    return force
