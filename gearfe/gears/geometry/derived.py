r"""What follows from the data of a gear pair: geometry in everyday units with the unit in every name (ISO 21771 names),
plain geometry for pictures in millimetres, and what ISO 6336-1:2006, method B, says of stiffness and dynamic factor:
sanity checks for the level of what is computed.

Clause 9: the minimum flexibility q' of a tooth pair is a series in the virtual tooth numbers and profile shifts,
valid for x1 >= x2 and -0.5 <= x1 + x2 <= 2 and for loads of at least 100 N per mm of face width; the factors turn the
theoretical single stiffness c'_th = 1/q' into that of a solid steel gear with the basic rack at hand.

Clause 6.5: with :math:`N = n_1/n_{E1}`, :math:`n_{E1}` the speed at which teeth mesh as often as
:math:`\sqrt{c_\gamma/m_{red}}` swings,

.. math::
    B_p = \frac{c' f_{pb,eff}}{K_A F_t/b},\quad B_f = \frac{c' f_{f\alpha,eff}}{K_A F_t/b},\quad
    B_k = \Big|1 - \frac{c' C_a}{K_A F_t/b}\Big|

.. math::
    K_v = \begin{cases}
    1 + N\,(C_{v1}B_p + C_{v2}B_f + C_{v3}B_k) & N \le N_S\\
    1 + C_{v1}B_p + C_{v2}B_f + C_{v4}B_k & N_S < N \le 1.15\\
    C_{v5}B_p + C_{v6}B_f + C_{v7} & N \ge 1.5
    \end{cases}

and straight between 1.15 and 1.5; N_S is 0.85, less below 100 N/mm.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.typing import Array
from .balls import ball_diameter, over_balls
from .cutter import cutter_facts
from .pair import GearPair, MeshGeometry
from .ring import CLEAR, radial_clearance
from .spur_gear import Gear
from .validity import tip_clearance

#: Young's modulus of steel that the standard refers to (Pa).
STEEL = 206e9
#: Correction factor C_M between measured and theoretical stiffness.
CORRECTION = 0.8
#: Names of the specific sliding of pinion and wheel at a point of the path.
SLIDING = ("pinion_specific_sliding", "wheel_specific_sliding")
_UNIT = 1e9  # N/(mm um) in N/m^2


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
        "pinion": _of_gear(pair.pinion, pair.pinion_working_radius, spans[0]),
        "wheel": _of_gear(pair.wheel, pair.wheel_working_radius, spans[1]),
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


def _of_gear(gear: Gear, working_radius: float, span: int | None) -> dict[str, Any]:
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


# ---- ISO 6336 -------------------------------------------------------------------------------------------------------


def flexibility(pinion: Gear, wheel: Gear) -> float:
    """q', minimum flexibility of a pair of teeth (mm um/N), of the virtual teeth z_n; an internal gear is a rack."""
    z1, z2 = pinion.virtual_teeth, math.inf if wheel.internal else wheel.virtual_teeth
    x1, x2 = pinion.profile_shift, wheel.profile_shift
    return (
        0.04723
        + 0.15551 / z1
        + 0.25791 / z2
        - 0.00635 * x1
        - 0.11654 * x1 / z1
        - 0.00193 * x2
        - 0.24188 * x2 / z2
        + 0.00529 * x1**2
        + 0.00182 * x2**2
    )


def rack_factor(gear: Gear) -> float:
    """C_B, basic rack factor (-): [1 + 0.5 (1.2 - h_fP/m)] [1 - 0.02 (20 deg - alpha)]."""
    return (1.0 + 0.5 * (1.2 - gear.dedendum)) * (1.0 - 0.02 * (20.0 - math.degrees(gear.pressure_angle)))


def pair_modulus(pinion: float, wheel: float) -> float:
    """Young's modulus E = 2 E1 E2/(E1 + E2) of a pair of two materials (Pa)."""
    return 2.0 * pinion * wheel / (pinion + wheel)


def single_stiffness(pair: MeshGeometry, pinion_modulus: float, wheel_modulus: float) -> float:
    """c', maximum stiffness of one tooth pair per face width (N/m^2; 1e9 N/m^2 = 1 N/(mm um)).

    c' = c'_th C_M C_R C_B cos(beta) E/E_steel with C_R = 1 (solid discs) and the mean C_B of both racks.

    Parameters
    ----------
    pinion_modulus, wheel_modulus
        Young's moduli (Pa).
    """
    rack = 0.5 * (rack_factor(pair.pinion) + rack_factor(pair.wheel))
    material = pair_modulus(pinion_modulus, wheel_modulus) / STEEL
    return (
        _UNIT / flexibility(pair.pinion, pair.wheel) * CORRECTION * rack * material * math.cos(pair.pinion.helix_angle)
    )


def mesh_stiffness(pair: MeshGeometry, pinion_modulus: float, wheel_modulus: float) -> float:
    """c_gamma = c' (0.75 eps_alpha + 0.25), mean stiffness of the mesh per face width (N/m^2)."""
    return single_stiffness(pair, pinion_modulus, wheel_modulus) * (0.75 * pair.contact_ratio + 0.25)


def dynamic_factor(
    pair: MeshGeometry, speeds: ArrayLike, *, stiffness: float, mass: float, force: float, relief: float = 0.0,
    deviations: tuple[float, float] = (0.0, 0.0),
) -> Array:  # fmt: skip
    """Compute K_v of a spur pair at speeds of its pinion.

    Parameters
    ----------
    pair : MeshGeometry
        The gears.
    speeds : array_like, shape (n,)
        rad/s.
    stiffness
        Mean stiffness of the mesh, c_gamma b (N/m).
    mass
        Reduced mass of pinion and wheel, and of what turns with them, on the line of action (kg).
    force
        Along the line of action, K_A included (N).
    relief, deviations
        C_a; effective deviations of pitch and profile, f_pb,eff and f_falpha,eff (m).
    """
    pitch, profile = deviations
    N = np.abs(np.asarray(speeds, dtype=float)) * pair.pinion.teeth / math.sqrt(stiffness / mass)
    ratio, width = pair.contact_ratio, min(pair.pinion.face_width, pair.wheel.face_width)
    load = force * math.cos(pair.pinion.transverse_pressure_angle) / width
    single = stiffness / width / (0.75 * ratio + 0.25)
    p, f, k = single * pitch / load, single * profile / load, abs(1.0 - single * relief / load)
    if ratio <= 2.0:
        of_pitch, of_profile, below, at, beyond = 0.32, 0.34, 0.23, 0.90, 0.47
    else:
        of_pitch, of_profile, below = 0.32, 0.57 / (ratio - 0.3), 0.096 / (ratio - 1.56)
        at, beyond = (0.57 - 0.05 * ratio) / (ratio - 1.44), 0.12 / (ratio - 1.74)
    still = 0.125 * math.sin(math.pi * (min(max(ratio, 1.5), 2.5) - 2.0)) + 0.875
    whole = of_pitch * p + of_profile * f
    resonant, fast = 1.0 + whole + at * k, 0.47 * p + beyond * f + still
    first = 0.85 if load >= 100e3 else 0.5 + 0.35 * math.sqrt(load / 100e3)
    later = fast + (resonant - fast) * np.clip((1.5 - N) / 0.35, 0.0, 1.0)
    return np.where(first >= N, 1.0 + N * (whole + below * k), later)


def iso_values(pair: GearPair, pinion_modulus: float, wheel_modulus: float) -> dict[str, float]:
    """ISO 6336-1 method B for the pair: c', c_gamma per face width, and c_gamma times the common face width.

    Parameters
    ----------
    pinion_modulus, wheel_modulus
        Young's moduli (Pa).
    """
    width = pair.common_width
    single = single_stiffness(pair, pinion_modulus, wheel_modulus)
    mean = mesh_stiffness(pair, pinion_modulus, wheel_modulus)
    return {
        "c_prime_N_per_mm_um": single * 1e-9,
        "c_gamma_N_per_mm_um": mean * 1e-9,
        "c_gamma_times_width_N_per_m": mean * width,
    }
