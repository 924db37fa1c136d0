"""Plain geometry for pictures of a gear pair: placed outlines, circles, the path of contact. Millimetres."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..typing import Array
from .pair import GearPair
from .spur_gear import Gear


def gear_outline(gear: Gear, angle: float, centre: tuple[float, float], *, per_segment: int = 24) -> Array:
    """Closed outline of a whole gear (mm); `angle` (rad) turns the frame of tooth 0, `centre` is in m."""
    half = gear.profile.polyline(per_segment)
    left = half[:, 0] + 1j * half[:, 1]
    tooth = np.concatenate([np.conj(left), left[::-1][1:]])  # counter-clockwise: right flank, tip, left flank
    turns = np.exp(1j * (angle + 2 * np.pi * np.arange(gear.teeth) / gear.teeth))
    around = (turns[:, None] * tooth[:-1]).ravel() + complex(*centre)
    around = np.append(around, around[0])
    return 1e3 * np.stack([around.real, around.imag], axis=1)


def path_place(pair: GearPair, pinion_roll: float) -> tuple[float, float]:
    """Place (mm) on the line of action at a roll length (m) of the pinion's driving flank."""
    foot = pair.pinion.base_radius * np.exp(-1j * pair.working_pressure_angle)
    along = 1j * np.exp(-1j * pair.working_pressure_angle)
    point = 1e3 * (foot + pinion_roll * along)
    return float(point.real), float(point.imag)


def zone(pair: GearPair, *, modules: float = 3.0) -> tuple[float, float, float]:
    """Centre and half width (mm) of the meshing zone: the path of contact with some teeth round it."""
    start, end = (path_place(pair, s) for s in pair.path_limits(rounded=False))
    half = 0.5 * math.dist(start, end) + 1e3 * modules * 0.5 * pair.pinion.module
    return 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), half


def pair_drawing(pair: GearPair, pinion_angle: float = 0.0) -> dict[str, Any]:
    """Arguments of `gearfe.figures.style.pair_figure` at a pinion angle (rad)."""
    a = pair.working_centre_distance
    pinion, wheel = pair.pinion, pair.wheel
    outlines = [
        gear_outline(pinion, pinion_angle, (0.0, 0.0)),
        gear_outline(wheel, pair.wheel_angle_at(pinion_angle) + pair.wheel_phase, (a, 0.0)),
    ]
    circles = []
    for gear, x, pitch in ((pinion, 0.0, pair.pinion_working_radius), (wheel, a, pair.wheel_working_radius)):
        radii = {"bore": 0.5 * gear.bore_diameter, "pitch": pitch, "base": gear.base_radius, "tip": gear.tip_radius}
        circles += [(kind, (1e3 * x, 0.0), 1e3 * radius) for kind, radius in radii.items()]
    x, y, half = zone(pair)
    return {
        "outlines": outlines,
        "circles": circles,
        "line_of_action": np.array([path_place(pair, 0.0), path_place(pair, pair.tangent_length)]),
        "path_points": {name: path_place(pair, point.pinion_roll) for name, point in pair.path.items()},
        "zoom": (x, y, half),
    }


def single_pair_stretches(pair: GearPair, start: float, end: float) -> list[tuple[float, float]]:
    """Stretches of pinion angle (rad) in which rigid, unmodified gears have one pair of teeth in contact."""
    points = pair.path
    if not 1.0 <= pair.contact_ratio_active < 2.0:
        return []
    low, high, cycle = points["B"].pinion_angle, points["D"].pinion_angle, pair.mesh_cycle
    first, last = math.floor((start - high) / cycle), math.ceil((end - low) / cycle)
    found = [(max(start, low + n * cycle), min(end, high + n * cycle)) for n in range(first, last + 1)]
    return [(a, b) for a, b in found if b > a]
