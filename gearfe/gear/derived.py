"""What follows from the data of a gear pair, in everyday units with the unit in every name (ISO 21771 names), and plain
geometry for pictures in millimetres: placed outlines, circles, the path of contact.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..typing import Array
from .iso6336 import mesh_stiffness, single_stiffness
from .pair import GearPair
from .spur_gear import Gear


def derived_geometry(pair: GearPair, spans: tuple[int | None, int | None] = (None, None)) -> dict[str, Any]:
    """Derived geometry of the pair and both gears: name with unit -> number.

    Parameters
    ----------
    spans
        Numbers of teeth that span sizes of pinion and wheel are over; None: as many as touch nearest to d + 2 x m.
    """
    return {
        "gear_ratio": pair.gear_ratio,
        "centre_distance_mm": 1e3 * pair.working_centre_distance,
        "working_pressure_angle_deg": math.degrees(pair.working_pressure_angle),
        "base_pitch_mm": 1e3 * pair.base_pitch,
        "backlash_mm": 1e3 * pair.backlash,
        "normal_backlash_mm": 1e3 * pair.normal_backlash,
        "lost_motion_to_contact_deg": math.degrees(pair.contact_twist),
        "contact_ratio": pair.contact_ratio,
        "contact_ratio_active": pair.contact_ratio_active,
        "contact_ratio_effective": pair.contact_ratio_effective,
        "path_length_mm": 1e3 * pair.path_length,
        "mesh_cycle_deg": math.degrees(pair.mesh_cycle),
        "path_of_contact": {
            name: {
                "pinion_roll_mm": 1e3 * point.pinion_roll,
                "wheel_roll_mm": 1e3 * point.wheel_roll,
                "pinion_angle_deg": math.degrees(point.pinion_angle),
            }
            for name, point in pair.path.items()
        },
        "pinion": _of_gear(pair.pinion, pair.pinion_working_radius, spans[0]),
        "wheel": _of_gear(pair.wheel, pair.wheel_working_radius, spans[1]),
    }


def _of_gear(gear: Gear, working_radius: float, span: int | None) -> dict[str, Any]:
    spanned = gear.span_teeth if span is None else span
    return {
        "teeth": gear.teeth,
        "module_mm": 1e3 * gear.module,
        "pitch_diameter_mm": 1e3 * gear.pitch_diameter,
        "working_pitch_diameter_mm": 2e3 * working_radius,
        "base_diameter_mm": 2e3 * gear.base_radius,
        "tip_diameter_mm": 2e3 * gear.tip_radius,
        "root_diameter_mm": 2e3 * gear.root_radius,
        "form_diameter_mm": 2e3 * gear.form_radius,
        "bore_diameter_mm": 1e3 * gear.bore_diameter,
        "tip_thickness_mm": 1e3 * gear.tip_thickness,
        "profile_shift": gear.profile_shift,
        "span_teeth": spanned,
        "span_mm": 1e3 * gear.span_size(spanned),
        "undercut": gear.undercut,
    }


def iso_values(pair: GearPair, pinion_modulus: float, wheel_modulus: float) -> dict[str, float]:
    """ISO 6336-1 method B for the pair: c', c_gamma per face width, and c_gamma times the common face width.

    Parameters
    ----------
    pinion_modulus, wheel_modulus
        Young's moduli (Pa).
    """
    width = min(pair.pinion.face_width, pair.wheel.face_width)
    single = single_stiffness(pair, pinion_modulus, wheel_modulus)
    mean = mesh_stiffness(pair, pinion_modulus, wheel_modulus)
    return {
        "c_prime_N_per_mm_um": single * 1e-9,
        "c_gamma_N_per_mm_um": mean * 1e-9,
        "c_gamma_times_width_N_per_m": mean * width,
    }


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
