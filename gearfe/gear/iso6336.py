"""Tooth stiffness after ISO 6336-1:2006, clause 9, method B: a sanity check for the level of a computed curve.

The minimum flexibility q' of a tooth pair is a series in the virtual tooth numbers and profile shifts,
valid for x1 >= x2 and -0.5 <= x1 + x2 <= 2 and for loads of at least 100 N per mm of face width; the factors turn the
theoretical single stiffness c'_th = 1/q' into that of a solid steel gear with the basic rack at hand.
"""

from __future__ import annotations

import math

from .mesh_geometry import MeshGeometry
from .spur_gear import Gear

#: Young's modulus of steel that the standard refers to (Pa).
STEEL = 206e9
#: Correction factor C_M between measured and theoretical stiffness.
CORRECTION = 0.8
_UNIT = 1e9  # N/(mm um) in N/m^2


def flexibility(pinion: Gear, wheel: Gear) -> float:
    """q', minimum flexibility of a pair of teeth (mm um/N); spur gears, so z_n = z."""
    z1, z2, x1, x2 = pinion.teeth, wheel.teeth, pinion.profile_shift, wheel.profile_shift
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

    c' = c'_th C_M C_R C_B cos(beta) E/E_steel with C_R = 1 (solid discs), beta = 0 and the mean C_B of both racks.

    Parameters
    ----------
    pinion_modulus, wheel_modulus
        Young's moduli (Pa).
    """
    rack = 0.5 * (rack_factor(pair.pinion) + rack_factor(pair.wheel))
    material = pair_modulus(pinion_modulus, wheel_modulus) / STEEL
    return _UNIT / flexibility(pair.pinion, pair.wheel) * CORRECTION * rack * material


def mesh_stiffness(pair: MeshGeometry, pinion_modulus: float, wheel_modulus: float) -> float:
    """c_gamma = c' (0.75 eps_alpha + 0.25), mean stiffness of the mesh per face width (N/m^2)."""
    return single_stiffness(pair, pinion_modulus, wheel_modulus) * (0.75 * pair.contact_ratio + 0.25)
