"""The gap between two exact flanks around the point where they first touch, and what lies near it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..contact.hertz import Edge, LocalContact, wedge_factor
from ..contact.scene import MeshingPair
from ..gear.pair import GearPair
from ..gear.touching import Flanks, Touching

Array = NDArray[np.float64]

#: Nearest and farthest known places of the gap from the point of contact (modules), and their number on either side.
NEAR, FAR, PLACES = 1e-8, 0.4, 90
#: Distance (modules) over which the radius of curvature is taken at an edge.
CURVED = 0.01
#: Elements between a contact and the nearest edge or jump of curvature, from which on it is that of smooth curves.
CLEAR = 8.0


def local_contact(
    pair: GearPair, elastic: MeshingPair, flanks: Flanks, touching: Touching, k: int, element: float
) -> LocalContact:
    """Local contact of the pair number `k` of `touching`; x runs along the pinion's flank to its tip.

    Parameters
    ----------
    element
        Element size there (m). Where all edges are `CLEAR` elements away, the gap is the parabola of the curvatures.
    """
    shares = elastic.contact_compliances
    place = [float(u) for u in touching.place[k]]
    edges, smooth = [], math.inf
    for g, face in enumerate(flanks.faces):
        for mark in face.marks():
            distance = (1.0 if g == 0 else -1.0) * face.distance(place[g], mark)
            smooth = min(smooth, abs(distance))
            if mark == face.end and face.sharp:
                factor = wedge_factor(face.tip_angle(), _opening(flanks, touching, k, g)) - 2 / math.pi
                edges.append(Edge(distance, factor * shares[g], g))
    module = pair.pinion.module
    side = np.geomspace(NEAR * module, FAR * module, PLACES)
    x = np.concatenate([-side[::-1], [0.0], side])
    bend = sum(f.curvature(u, math.inf) for f, u in zip(flanks.faces, place, strict=True))
    if smooth > CLEAR * element and 0 < bend < math.inf:
        return LocalContact(1 / sum(shares), 1 / bend, x, 0.5 * bend * x**2, tuple(edges), smooth)
    u = flanks.pinion.moved(place[0], x)
    inside = (u >= 0.0) & (u <= flanks.pinion.end)
    gap = flanks.gap(touching, k, np.where(inside, u, 0.0))
    known = inside & np.isfinite(gap)
    known[PLACES], gap[PLACES] = True, 0.0
    for g, face in enumerate(flanks.faces):
        if face.fall > 0.0:
            up, mate = (1.0, flanks.faces[1]) if g == 0 else (-1.0, flanks.faces[0])
            tip = -up * mate.distance(place[1 - g], mate.end)
            _fall_back(x, gap, known, up * face.distance(place[g], 0.0), tip, up, face.fall)
    x, gap = x[known], np.maximum(gap[known], 0.0)
    # lighter contacts than reach the next edge or jump know the curvature at the point alone
    radius = float(1 / bend) if smooth > 0 and 0 < bend < math.inf else _radius(x, gap, CURVED * module)
    return LocalContact(1 / sum(shares), radius, x, gap, tuple(edges), smooth)


def _opening(flanks: Flanks, touching: Touching, k: int, g: int) -> float:
    """Angle (rad) between the face of gear g where it ends and the mate's where they touch, > 0 where they part."""
    if g == 0:
        turned, sign = touching.angle[k] + touching.pair[k] * flanks.pair.mesh_cycle, 1.0
    else:
        turned, sign = flanks.wheel_frame(touching.angle[k], touching.pair[k]) + touching.twist[k], -1.0
    normal = complex(flanks.faces[g].normals(np.array(flanks.faces[g].end))) * np.exp(1j * turned)
    return float(np.angle(sign * normal / touching.normal[k]))


def _fall_back(
    x: Array, gap: Array, known: NDArray[np.bool_], start: float, tip: float, up: float, fall: float
) -> None:
    """Fill in the gap beyond x = `start`, where a flank ends in an edge and its undercut root goes on: as a wedge.

    The concave root and the convex mate have about the same curvature, and contact at an edge is short.

    Parameters
    ----------
    tip
        Where the mate's face ends (m): there is no gap beyond it.
    up
        Sign of x on the flank's side of the edge.
    fall
        Angle (rad) between flank and root.
    """
    beyond = (up * (x - start) < 0) & (up * (x - tip) >= 0)
    on = np.flatnonzero(known & (up * (x - start) >= 0))
    on = on[np.argsort(np.abs(x[on] - start))][:2]
    if len(on) < 2 or not beyond.any():
        return
    slope = (gap[on[1]] - gap[on[0]]) / (x[on[1]] - x[on[0]])
    made = gap[on[0]] + slope * (x[beyond] - x[on[0]]) + fall * np.abs(x[beyond] - start)
    gap[beyond], known[beyond] = made, made >= 0.0


def _radius(x: Array, gap: Array, far: float) -> float:
    """Relative radius of curvature (m): gap = x^2/(2 radius), on the mean of both sides, or on the one there is."""
    sides = [np.interp(s * far, x, gap) for s in (-1.0, 1.0) if x[0] <= s * far <= x[-1]]
    mean = float(np.mean(sides)) if sides else 0.0
    return far**2 / (2 * mean) if mean > 0 else far
