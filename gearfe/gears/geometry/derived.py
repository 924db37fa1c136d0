"""Derive the geometry of a gear pair, with names of ISO 21771 and the unit in every name.

Plain geometry for pictures is in mm.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.typing import Array
from .balls import ball_diameter, over_balls
from .cutter import cutter_facts
from .pair import GearPair, MeshGeometry
from .ring import CLEAR, radial_clearance
from .spur_gear import Gear
from .validity import tip_clearance

#: Names of the specific sliding of pinion and wheel at a point of the path.
SLIDING = ("pinion_specific_sliding", "wheel_specific_sliding")


def derived_geometry(pair: GearPair, spans: tuple[int | None, int | None] = (None, None)) -> dict[str, Any]:
    """Derived geometry of the pair and both gears: name with unit -> number.

    Diameters, span sizes and the centre distance of internal gears are negative, as ISO 21771 has them.

    Parameters
    ----------
    spans
        Numbers of teeth that span sizes of pinion and wheel are over; None: as many as touch nearest to d + 2 x m.
    """
    helix = _of_helix(pair) if pair.pinion.helical else {}
    return {
        "gear_ratio": pair.gear_ratio,
        "centre_distance_mm": 1e3 * pair.wheel_centre,
        "working_pressure_angle_deg": math.degrees(pair.working_pressure_angle),
        "base_pitch_mm": 1e3 * pair.base_pitch,
        "backlash_mm": 1e3 * pair.backlash,
        "normal_backlash_mm": 1e3 * pair.normal_backlash,
        "lost_motion_to_contact_deg": math.degrees(pair.contact_twist),
        "contact_ratio": pair.contact_ratio,
        "contact_ratio_active": pair.contact_ratio_active,
        "contact_ratio_effective": pair.contact_ratio_effective,
        **helix,
        **(_of_internal(pair) if pair.internal else {}),
        "path_length_mm": 1e3 * pair.path_length,
        "mesh_cycle_deg": math.degrees(pair.mesh_cycle),
        "path_of_contact": {
            name: {
                "pinion_roll_mm": 1e3 * point.pinion_roll,
                "wheel_roll_mm": 1e3 * point.wheel_roll,
                "pinion_angle_deg": math.degrees(point.pinion_angle),
                **dict(zip(SLIDING, specific_sliding(pair, name), strict=True)),
            }
            for name, point in pair.path.items()
        },
        "pinion": _of_gear(pair.pinion, pair.pinion_working_radius, spans[0], pair.path["A"].pinion_roll),
        "wheel": _of_gear(pair.wheel, pair.wheel_working_radius, spans[1], pair.path["E"].wheel_roll),
    }


def _of_helix(pair: MeshGeometry) -> dict[str, Any]:
    """What a helix adds to the geometry of a pair."""
    pinion = pair.pinion
    return {
        "overlap_ratio": pair.overlap_ratio,
        "total_contact_ratio": pair.total_contact_ratio,
        "helix_angle_deg": math.degrees(pinion.helix_angle),
        "base_helix_angle_deg": math.degrees(pinion.base_helix_angle),
        "working_helix_angle_deg": math.degrees(pair.working_helix_angle),
        "transverse_module_mm": 1e3 * pinion.transverse_module,
        "transverse_pressure_angle_deg": math.degrees(pinion.transverse_pressure_angle),
        "common_face_width_mm": 1e3 * pair.common_width,
    }


def _helix_of_gear(gear: Gear, span: float) -> dict[str, Any]:
    """What a helix adds to the geometry of a gear with a span size (m)."""
    return {
        "helix_hand": gear.hand,
        "lead_mm": 2e3 * math.pi / abs(gear.twist_rate),
        "virtual_teeth": gear.virtual_teeth,
        "span_least_face_width_mm": 1e3 * abs(span) * math.sin(gear.base_helix_angle),
    }


def _of_internal(pair: MeshGeometry) -> dict[str, Any]:
    """What belongs to the geometry of an internal pair alone."""
    pinion, ring = pair.pinion, pair.wheel
    radial = radial_clearance(pinion, ring, pair.working_centre_distance)
    return {
        "tip_clearance_pinion_mm": 1e3 * tip_clearance(pair, pinion, ring),
        "tip_clearance_wheel_mm": 1e3 * tip_clearance(pair, ring, pinion),
        "radial_assembly": radial >= -CLEAR * ring.module,
        "radial_assembly_clearance_mm": 1e3 * radial,
        "relative_curvature_A_per_mm": 1e-3 * relative_curvature(pair, "A"),
        "relative_curvature_E_per_mm": 1e-3 * relative_curvature(pair, "E"),
    }


def relative_curvature(pair: MeshGeometry, point: str) -> float:
    """Relative curvature 1/rho_1 + 1/rho_2 (1/m) at a point of the path, whose rho are the roll lengths with sign.

    With sin(beta_b) of helical gears it is in the normal section: times cos(beta_b).
    """
    at = pair.path[point]
    return (1.0 / at.pinion_roll + 1.0 / at.wheel_roll) * math.cos(pair.pinion.base_helix_angle)


def specific_sliding(pair: MeshGeometry, point: str) -> tuple[float, float]:
    """Specific sliding of pinion and wheel (-) at a point of the path: 1 - (speed of the mate's flank)/(own speed)."""
    at, u = pair.path[point], pair.gear_ratio
    ratio = at.wheel_roll / (u * at.pinion_roll) if at.pinion_roll else math.inf
    return 1.0 - ratio, (1.0 - 1.0 / ratio if ratio else -math.inf)


def _of_ring(gear: Gear) -> dict[str, Any]:
    """Rim and root of an internal gear."""
    root = cutter_facts(gear) if gear.form_diameter is None else {}
    return {"rim_diameter_mm": -1e3 * (gear.rim_diameter or 0.0), "rim": gear.rim, **root}


def _of_gear(gear: Gear, working_radius: float, span: int | None, active_roll: float) -> dict[str, Any]:
    """Geometry of a gear whose flank is active from a roll length (m) on."""
    spanned, sign, balls = gear.span_teeth if span is None else span, gear.sign, ball_diameter(gear)
    held = _of_ring(gear) if gear.internal else {"bore_diameter_mm": 1e3 * gear.bore_diameter}
    return {
        "teeth": gear.teeth,
        "module_mm": 1e3 * gear.module,
        "pitch_diameter_mm": sign * 1e3 * gear.pitch_diameter,
        "working_pitch_diameter_mm": sign * 2e3 * working_radius,
        "base_diameter_mm": sign * 2e3 * gear.base_radius,
        "tip_diameter_mm": sign * 2e3 * gear.tip_radius,
        "root_diameter_mm": sign * 2e3 * gear.root_radius,
        "form_diameter_mm": sign * 2e3 * gear.form_radius,
        "active_tip_diameter_mm": sign * 2e3 * active_tip_radius(gear),
        "active_root_diameter_mm": sign * 2e3 * math.hypot(gear.base_radius, active_roll),
        **held,
        "tip_thickness_mm": 1e3 * gear.tip_thickness,
        "profile_shift": gear.profile_shift,
        "span_teeth": spanned,
        "span_mm": 1e3 * gear.span_size(spanned),
        "ball_diameter_mm": 1e3 * balls,
        "over_balls_mm": 1e3 * over_balls(gear, balls),
        **(_helix_of_gear(gear, gear.span_size(spanned)) if gear.helical else {}),
        "undercut": gear.undercut,
    }


def active_tip_radius(gear: Gear) -> float:
    """Radius at which the flank ends (m): at the tip circle, or where its tip round begins."""
    return math.hypot(gear.base_radius, min(gear.profile.round_roll, gear.profile.tip_roll))


def gear_outline(gear: Gear, angle: float, centre: tuple[float, float], *, per_segment: int = 24) -> Array:
    """Return the closed outline of a whole gear.

    Parameters
    ----------
    gear : Gear
        The gear.
    angle : float
        Angle of the frame of tooth 0 (rad).
    centre : (float, float)
        Centre of the gear (m).
    per_segment : int
        Points on each piece of a tooth.

    Returns
    -------
    outline : ndarray, shape (n, 2)
        Points (mm), the first one again at the end.
    """
    half = gear.profile.polyline(per_segment)
    left = half[:, 0] + 1j * half[:, 1]
    tooth = np.concatenate([np.conj(left), left[::-1][1:]])  # counter-clockwise: right flank, tip, left flank
    turns = np.exp(1j * (angle + 2 * np.pi * np.arange(gear.tooth_count) / gear.teeth))
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
