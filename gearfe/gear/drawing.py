"""Plain geometry for pictures of a gear pair: placed outlines, circles, the path of contact. Millimetres."""

from __future__ import annotations

import math

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


def single_pair_stretches(pair: GearPair, start: float, end: float) -> list[tuple[float, float]]:
    """Stretches of pinion angle (rad) in which rigid, unmodified gears have one pair of teeth in contact."""
    points = pair.path
    if not 1.0 <= pair.contact_ratio_active < 2.0:
        return []
    low, high, cycle = points["B"].pinion_angle, points["D"].pinion_angle, pair.mesh_cycle
    first, last = math.floor((start - high) / cycle), math.ceil((end - low) / cycle)
    found = [(max(start, low + n * cycle), min(end, high + n * cycle)) for n in range(first, last + 1)]
    return [(a, b) for a, b in found if b > a]
