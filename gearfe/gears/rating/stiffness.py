r"""Tooth stiffness by ISO 6336-1:2006, clause 9, method B: the one place of its formulas.

The minimum flexibility q' of a tooth pair is a series in the virtual tooth numbers and profile shifts of pinion and
wheel (82). The pinion is the gear with fewer teeth. The series is valid for :math:`x_1 \ge x_2` and
:math:`-0.5 \le x_1 + x_2 \le 2`. An internal wheel has :math:`1/z_{n2} = 0`. With (80), (81), (83) to (86), (88), (91),
(92)

.. math::
    c'_{th} = 1/q', \quad c' = c'_{th}\,C_M C_R C_B\cos\beta\,E/E_{St}, \quad
    c_{\gamma\alpha} = c'\,(0.75\,\varepsilon_\alpha + 0.25), \quad c_{\gamma\beta} = 0.85\,c_{\gamma\alpha}.

Below 100 N/mm of line load :math:`F_tK_A/b`, c' is multiplied by its fourth root in units of 100 N/mm (90).
"""

from __future__ import annotations

import math

from ..geometry.mesh_geometry import MeshGeometry
from ..geometry.spur_gear import Gear

#: Young's modulus of steel that the standard refers to (Pa).
STEEL = 206e9
#: Correction factor C_M between measured and theoretical stiffness (83).
CORRECTION = 0.8
#: Line load (N/mm) below which the stiffness falls (90).
LIGHT = 100.0
_UNIT = 1e9  # N/(mm um) in N/m^2


def ordered(pair: MeshGeometry) -> tuple[Gear, Gear]:
    """Return pinion and wheel in the sense of the standard: the gear with fewer teeth first."""
    one, two = pair.pinion, pair.wheel
    return (one, two) if abs(one.teeth) <= abs(two.teeth) else (two, one)


def flexibility(one: Gear, two: Gear) -> float:
    """q', minimum flexibility of a pair of teeth (mm um/N), (82), of the virtual teeth z_n; internal gears: 1/z_n = 0.

    The gear with fewer teeth is the pinion of the series.
    """
    pinion, wheel = (one, two) if abs(one.teeth) <= abs(two.teeth) else (two, one)
    v1, v2 = (0.0 if gear.teeth < 0 else 1.0 / gear.virtual_teeth for gear in (pinion, wheel))
    x1, x2 = pinion.profile_shift, wheel.profile_shift
    return (
        0.04723
        + 0.15551 * v1
        + 0.25791 * v2
        - 0.00635 * x1
        - 0.11654 * x1 * v1
        - 0.00193 * x2
        - 0.24188 * x2 * v2
        + 0.00529 * x1**2
        + 0.00182 * x2**2
    )


def rack_factor(gear: Gear) -> float:
    """C_B, basic rack factor (-), (86): [1 + 0.5 (1.2 - h_fP/m)] [1 - 0.02 (20 deg - alpha)]."""
    return (1.0 + 0.5 * (1.2 - gear.dedendum)) * (1.0 - 0.02 * (20.0 - math.degrees(gear.pressure_angle)))


def blank_factor(width_ratio: float, rim_modules: float) -> float:
    """C_R of a gear with a web, (85): web over face width, rim over module, within the limits of the formula."""
    web, rim = min(max(width_ratio, 0.2), 1.2), min(max(rim_modules, 1.0), 1e3)
    return 1.0 + math.log(web) / (5.0 * math.exp(rim / 5.0))


def pair_modulus(pinion: float, wheel: float) -> float:
    """Young's modulus E = 2 E1 E2/(E1 + E2) of a pair of two materials (Pa), (89)."""
    return 2.0 * pinion * wheel / (pinion + wheel)


def single_stiffness(
    pair: MeshGeometry, pinion_modulus: float, wheel_modulus: float, *, blank: float = 1.0, line_load: float = LIGHT
) -> float:
    """Return c', the maximum stiffness of one tooth pair per face width (N/m^2; 1e9 N/m^2 = 1 N/(mm um)), (80).

    Parameters
    ----------
    pair : MeshGeometry
        The gears.
    pinion_modulus, wheel_modulus : float
        Young's moduli (Pa).
    blank : float
        Gear blank factor C_R; 1 for solid discs.
    line_load : float
        F_t K_A/b (N/mm).
    """
    rack = 0.5 * (rack_factor(pair.pinion) + rack_factor(pair.wheel))
    material = pair_modulus(pinion_modulus, wheel_modulus) / STEEL
    light = min(line_load / LIGHT, 1.0) ** 0.25
    return (
        _UNIT
        / flexibility(pair.pinion, pair.wheel)
        * CORRECTION
        * blank
        * rack
        * material
        * light
        * math.cos(pair.pinion.helix_angle)
    )


def mesh_stiffness(
    pair: MeshGeometry, pinion_modulus: float, wheel_modulus: float, *, line_load: float = LIGHT
) -> float:
    """Return the mean stiffness of the mesh per face width (N/m^2), c_gamma_alpha = c' (0.75 eps_alpha + 0.25), (91).

    Parameters
    ----------
    pair : MeshGeometry
        The gears.
    pinion_modulus, wheel_modulus : float
        Young's moduli (Pa).
    line_load : float
        F_t K_A/b (N/mm).
    """
    single = single_stiffness(pair, pinion_modulus, wheel_modulus, line_load=line_load)
    return single * (0.75 * pair.contact_ratio + 0.25)


def iso_values(
    pair: MeshGeometry, pinion_modulus: float, wheel_modulus: float, *, line_load: float = LIGHT
) -> dict[str, float]:
    """Return c' and c_gamma per face width by ISO 6336-1, method B, and c_gamma times the common face width.

    Parameters
    ----------
    pair : MeshGeometry
        The gears.
    pinion_modulus, wheel_modulus : float
        Young's moduli (Pa).
    line_load : float
        F_t K_A/b (N/mm); all above 100 N/mm are alike.
    """
    single = single_stiffness(pair, pinion_modulus, wheel_modulus, line_load=line_load)
    mean = mesh_stiffness(pair, pinion_modulus, wheel_modulus, line_load=line_load)
    return {
        "c_prime_N_per_mm_um": single * 1e-9,
        "c_gamma_N_per_mm_um": mean * 1e-9,
        "c_gamma_times_width_N_per_m": mean * pair.common_width,
    }
