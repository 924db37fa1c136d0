r"""Where an internal gear's tips and those of its mate collide, and whether the mate can be moved in radially.

Tips of a pinion and an internal gear of nearly as many teeth meet beside the path of contact, where the teeth come
together and part. This is trochoid interference (DIN 3993; Colbourne, *The Geometry of Involute Gears*, 1987, ch. 8).
Here the pair is rolled, and the points of either outline are looked up in the other one, so roots count as well.

*Radial assembly*: a pinion that is moved along the line of centres does not turn. Each of its points beyond the corner
of a neighbouring tip has to pass this corner. So it must not lie farther from the line of centres than the corner.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, ComplexArray
from .spur_gear import Gear

#: Positions of a tooth through which a pair is rolled; points on each piece of an outline.
POSITIONS, PER_PIECE = 401, 33
#: Overlap (modules) of an assembly that is rounding.
CLEAR = 1e-6


class RingDepths(NamedTuple):
    """Depths (m) by which the pinion's teeth enter the ring's material, and the ring's tips the pinion's."""

    pinion: float
    ring: float


def half_outline(gear: Gear, per_piece: int = PER_PIECE) -> ComplexArray:
    """Left half of a tooth from the middle of the space to that of the tip, its middle on the positive real axis."""
    t = np.linspace(0.0, 1.0, per_piece)
    return np.asarray(gear.sign * np.concatenate([segment.curve.point(t) for segment in gear.profile.segments]))


def ring_depths(pinion: Gear, ring: Gear, centre_distance: float, twist: float) -> RingDepths:
    """Return the depths by which teeth enter each other while the pair rolls once through its mesh.

    Parameters
    ----------
    pinion, ring : Gear
        The gears.
    centre_distance : float
        Distance of the axes (m), without sign.
    twist : float
        Turn of the ring that closes the backlash on the left flanks (rad).
    """
    outlines = [half_outline(gear) for gear in (pinion, ring)]
    teeth = [np.concatenate([half, half.conj()]) for half in outlines]
    a, tip1, tip2 = centre_distance, pinion.tip_radius, ring.tip_radius
    cosines = (tip2**2 - tip1**2 - a * a) / (2.0 * a * tip1), (tip2**2 - tip1**2 + a * a) / (2.0 * a * tip2)
    depths = []
    for number, (gear, points, mate, cosine) in enumerate(
        zip((pinion, ring), teeth, outlines[::-1], cosines, strict=True)
    ):
        if cosine >= 1.0:
            depths.append(0.0)
            continue
        swing = math.acos(max(cosine, -1.0)) + 2.0 * math.pi / gear.tooth_count
        place = np.linspace(-swing, swing, POSITIONS)[:, None]
        # the pinion's centre is the origin, the ring's lies at -a; both turn the same way
        other = (ring, pinion)[number]
        turned = (place - (math.pi / gear.tooth_count if number else 0.0)) * gear.tooth_count / other.tooth_count
        if number == 0:  # points of the pinion's tooth in the frame of the ring, whose space faces it
            turned = turned + math.pi / other.tooth_count - twist
            placed = (a + np.exp(1j * place) * points) * np.exp(-1j * turned)
        else:
            placed = (np.exp(1j * (place - twist)) * points - a) * np.exp(-1j * turned)
        depths.append(_depth(placed.ravel(), mate, other))
    return RingDepths(*depths)


def _depth(points: ComplexArray, half: ComplexArray, gear: Gear) -> float:
    """Largest depth (m) of points in the teeth of a gear whose half tooth is `half`."""
    pitch = 2.0 * math.pi / gear.tooth_count
    radius, angle = np.abs(points), np.angle(points)
    angle = np.abs(angle - pitch * np.round(angle / pitch))
    line = half[gear.sign * np.abs(half) <= gear.sign * gear.tip_radius * (1.0 + 1e-12)]
    order = np.argsort(np.abs(line), kind="stable")
    radii, angles = np.abs(line)[order], np.angle(line)[order]
    inside = angle < np.interp(radius, radii, angles)
    inside &= (radius > gear.tip_radius) if gear.internal else (radius < gear.tip_radius)
    suspects = (radius * np.exp(1j * angle))[inside]
    deepest = 0.0
    for part in np.array_split(suspects, 1 + suspects.size // 2000):
        if part.size:
            deepest = max(deepest, float(to_line(part, half).max()))
    return deepest


def to_line(points: ComplexArray, line: ComplexArray) -> Array:
    """Distances (m) of points to the chords next to the nearest vertex of a polyline."""
    nearest = np.abs(points[:, None] - line).argmin(axis=1)
    best = np.abs(points - line[nearest])
    for step in (-1, 0):
        first = np.clip(nearest + step, 0, len(line) - 2)
        start, chord = line[first], line[first + 1] - line[first]
        size = np.maximum(np.abs(chord) ** 2, 1e-300)
        along = np.clip(np.real((points - start) * np.conj(chord)) / size, 0.0, 1.0)
        best = np.minimum(best, np.abs(points - start - along * chord))
    return np.asarray(best)


def radial_clearance(pinion: Gear, ring: Gear, centre_distance: float) -> float:
    """Return the least clearance (m) of tips across the line of centres while a pinion is moved into a ring.

    A tooth of the pinion, or a space, is on the line of centres, the better of both; negative where tips collide. The
    backlash is shared by both flanks.

    Parameters
    ----------
    pinion, ring : Gear
        The gears.
    centre_distance : float
        Distance of the axes (m), without sign.
    """
    half = half_outline(pinion)
    above = half[np.angle(half) >= -1e-15]  # the upper side of the tooth on +x, root to tip
    tip = ring.profile.tip_half_angle
    best = -math.inf
    for first in (0.0, 0.5):
        clearance = math.inf
        for k in range(pinion.tooth_count // 2 + 1):
            turn, at = (k + first) * 2.0 * math.pi / pinion.tooth_count, (k + first) * 2.0 * math.pi / ring.tooth_count
            if turn > 0.5 * math.pi + math.pi / pinion.tooth_count:
                break
            corner = ring.tip_radius * np.exp(1j * (at + math.pi / ring.tooth_count - tip)) - centre_distance
            points = above * np.exp(1j * turn)
            beyond = points.real > corner.real
            if beyond.any():
                clearance = min(clearance, float((corner.imag - points.imag[beyond]).min()))
        best = max(best, clearance)
    return best
