"""The gap between two exact flanks around the point where they first touch, and what lies near it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contact.hertz import Edge, LocalContact, wedge_factor
from ..contact.scene import MeshingPair
from ..gear.pair import GearPair
from ..gear.touching import Face, Flanks, Touching

Array = NDArray[np.float64]

#: Nearest and farthest known places of the gap from the point of contact (modules), and their number on either side.
NEAR, FAR, PLACES = 1e-8, 0.4, 90
#: Distance, as a share of a gear's radius, up to which differences of places have too much rounding.
ROUNDED = 1e-8
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
    sides = [
        # the sign makes n of the wheel's outward normal too
        _Side(face, float(touching.place[k, g]), g, (1 - 2 * g) * complex(np.exp(1j * turn) / touching.normal[k]))
        for g, (face, turn) in enumerate(zip(flanks.faces, flanks.turns(touching, k), strict=True))
    ]
    marks = [(side, mark, side.arc(mark)) for side in sides for mark in side.face.marks()]
    ends = [(side, arc) for side, mark, arc in marks if mark == side.face.end and side.face.sharp]
    smooth = min(abs(arc) for _, _, arc in marks)
    factors = [
        shares[side.gear] * (wedge_factor(side.face.tip_angle(), side.opening) - 2 / math.pi) for side, _ in ends
    ]
    module = pair.pinion.module
    beside = np.geomspace(NEAR * module, FAR * module, PLACES)
    x = np.concatenate([-beside[::-1], [0.0], beside])
    bend = sum(side.face.curvature(side.place, math.inf) for side in sides)
    clear = smooth > CLEAR * element and 0 < bend < math.inf
    edges = tuple(
        Edge(arc if clear else side.along(arc), f, side.gear) for (side, arc), f in zip(ends, factors, strict=True)
    )
    if clear:
        return LocalContact(1 / sum(shares), 1 / bend, x, 0.5 * bend * x**2, edges, smooth)
    u = flanks.pinion.moved(sides[0].place, x)
    inside = (u >= 0.0) & (u <= flanks.pinion.end)
    gap, x = flanks.gap(touching, k, np.where(inside, u, 0.0)), sides[0].all_along(x)
    known = inside & np.isfinite(gap)
    known[PLACES], gap[PLACES] = True, 0.0
    for side, mate in (sides, sides[::-1]):
        if side.face.fall > 0.0:
            start, tip = side.along(side.arc(0.0)), mate.along(mate.arc(mate.face.end))
            _fall_back(x, gap, known, start, tip, side.up, side.face.fall)
    x, gap = x[known], np.maximum(gap[known], 0.0)
    # lighter contacts than reach the next edge or jump know the curvature at the point alone
    radius = float(1 / bend) if smooth > 0 and 0 < bend < math.inf else _radius(x, gap, CURVED * module)
    return LocalContact(1 / sum(shares), radius, x, gap, edges, smooth)


@dataclass(frozen=True)
class _Side:
    """One face as seen from the point where it touches: `turned` makes 1 of its normal there, but at an edge."""

    face: Face
    place: float
    gear: int
    turned: complex

    @property
    def up(self) -> float:
        """Sign of x towards the tip of its tooth."""
        return 1.0 if self.gear == 0 else -1.0

    @property
    def opening(self) -> float:
        """Angle (rad) between the face where it ends and the common tangent: `gearfe.contact.hertz.wedge_factor`'s."""
        return float(np.angle(complex(self.face.normals(np.array(self.face.end))) * self.turned))

    def all_along(self, x: Array) -> Array:
        """Coordinates along the common tangent of places at the arc lengths x (m), both towards the pinion's tip.

        Of near ones by the direction of the face at half of the arc, that of the chord up to the third order: a
        difference of places would be rounding.
        """
        half, at = (np.clip(self.face.moved(self.place, s * self.up * x), 0.0, self.face.end) for s in (0.5, 1.0))
        near = x * (self.face.normals(half) * self.turned).real
        touch = complex(self.face.points(np.array(self.place)))
        chord = (self.face.points(at) - touch) * self.turned
        ends = [(1 + ROUNDED) * self.face.distance(self.place, mark) for mark in (0.0, self.face.end)]
        far = np.abs(x) > ROUNDED * abs(touch)
        return np.where(far & (self.up * x >= ends[0]) & (self.up * x <= ends[1]), -self.up * chord.imag, near)

    def along(self, x: float) -> float:
        """The same of one arc length."""
        return float(self.all_along(np.array([x]))[0])

    def arc(self, mark: float) -> float:
        """Arc length (m) to a parameter of the face, towards the pinion's tip."""
        return self.up * self.face.distance(self.place, mark)


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
    outwards = -up * (gap[on[1]] - gap[on[0]]) / (x[on[1]] - x[on[0]])
    at_the_edge = gap[on[0]] + outwards * -up * (start - x[on[0]])
    made = at_the_edge + math.tan(math.atan(outwards) + fall) * np.abs(x[beyond] - start)
    gap[beyond], known[beyond] = made, made >= 0.0


def _radius(x: Array, gap: Array, far: float) -> float:
    """Relative radius of curvature (m): gap = x^2/(2 radius), on the mean of both sides, or on the one there is."""
    sides = [np.interp(s * far, x, gap) for s in (-1.0, 1.0) if x[0] <= s * far <= x[-1]]
    mean = float(np.mean(sides)) if sides else 0.0
    return far**2 / (2 * mean) if mean > 0 else far
