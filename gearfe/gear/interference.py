"""Do the tips of one rigid gear enter the material of its mate? Answered by rolling the pair."""

from __future__ import annotations

import math

import numpy as np

from ..typing import Array
from .spur_gear import Gear

#: Penetrations below this many modules are taken for the discretisation of the outlines.
TOLERANCE = 1e-4


def tip_penetration(gear: Gear, mate: Gear, centre_distance: float, twist: float, *, positions: int = 241) -> float:
    """Largest depth (m) by which tips of `mate` enter `gear` while the pair rolls with its left flanks in contact.

    The mate's outline from the middle of its addendum outwards is followed through the space of the gear. In the
    gear's frame the outline of its tooth is a single-valued polar angle over the radius, which tells inside from
    outside; the depth of a point inside is its distance to that outline.

    Parameters
    ----------
    centre_distance
        Distance (m) between the axes; the gear is at the origin, the mate on +x.
    twist
        Turn (rad) of the mate that closes the backlash on the left flanks.
    positions
        Number of rotations through the engagement of one tooth.
    """
    outline, tip = _outline(gear), _tip_outline(mate)
    reach = (centre_distance**2 + mate.tip_radius**2 - gear.tip_radius**2) / (2.0 * centre_distance * mate.tip_radius)
    if reach >= 1.0:
        return 0.0
    widest = math.acos(max(reach, 0.0)) + mate.profile.tip_half_angle
    swing = np.linspace(-widest, widest, positions)
    gear_angle = -(swing - math.pi / mate.teeth - twist) * mate.teeth / gear.teeth
    turn = np.exp(1j * (math.pi + swing))[:, None]
    placed = (centre_distance + turn * tip) * np.exp(-1j * gear_angle)[:, None]
    radius, angle = np.abs(placed), np.angle(placed)
    pitch = 2.0 * math.pi / gear.teeth
    angle = np.abs(angle - pitch * np.round(angle / pitch))
    inside = angle < np.interp(radius, np.abs(outline), np.angle(outline), left=math.inf, right=-math.inf)
    suspects = (radius * np.exp(1j * angle))[inside]
    deepest = 0.0
    for part in np.array_split(suspects, 1 + suspects.size // 2000):
        if part.size:
            deepest = max(deepest, float(_distance(part, outline).max()))
    return deepest


def _distance(points: Array, outline: Array) -> Array:
    """Distance of complex points to the chords next to the nearest vertex of a complex polyline."""
    nearest = np.abs(points[:, None] - outline).argmin(axis=1)
    best = np.abs(points - outline[nearest])
    for step in (-1, 0):
        first = np.clip(nearest + step, 0, len(outline) - 2)
        start, chord = outline[first], outline[first + 1] - outline[first]
        along = np.clip(np.real((points - start) * np.conj(chord)) / np.abs(chord) ** 2, 0.0, 1.0)
        best = np.minimum(best, np.abs(points - start - along * chord))
    return best


def _outline(gear: Gear) -> Array:
    """Left half profile as complex numbers with growing radius."""
    t = np.linspace(0.0, 1.0, 401)
    pieces = [s.points(t) for s in gear.profile.segments if s.name != "tip"]
    points = np.concatenate(pieces)
    made = points[:, 0] + 1j * points[:, 1]
    radius = np.abs(made)
    return made[np.concatenate([[True], np.diff(np.maximum.accumulate(radius)) > 0.0])]


def _tip_outline(gear: Gear) -> Array:
    """Both sides of a tooth from half the roll length above the form point outwards, as complex numbers."""
    profile = gear.profile
    t = np.linspace(0.0, 1.0, 17)
    pieces = [profile.points_of_roll(0.5 * (profile.form_roll + profile.round_roll) * (1 - t) + profile.round_roll * t)]
    pieces += [s.points(t) for s in profile.segments if s.name in ("tip_round", "tip")]
    left = np.concatenate(pieces)
    made = left[:, 0] + 1j * left[:, 1]
    return np.concatenate([made, np.conj(made)])
