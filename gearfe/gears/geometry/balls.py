r"""Dimension of a gear over balls in opposite spaces, between balls for an internal gear (ISO 21771).

A ball of the diameter :math:`D_M` in a space has its centre on the circle of the diameter :math:`d_K`,

.. math::
    \operatorname{inv}\alpha_K = \operatorname{inv}\alpha_t + \frac{D_M}{z m_n \cos\alpha_n}
    - \Big(\frac{\pi}{z} - \psi\Big), \qquad d_K = \frac{d_b}{\cos\alpha_K},

with half the tooth thickness angle :math:`\psi`, and :math:`M_{dK} = d_K + D_M`; with an odd number of teeth
:math:`d_K \cos\frac{\pi}{2z} + D_M`. Of an internal gear z, :math:`\psi`, :math:`d_b` and :math:`M_{dK}` are negative.
"""

from __future__ import annotations

import math

from .curves import inv, inverse_inv
from .gear_data import GearData

#: Ball diameters are rounded to this share of a module.
STEP = 0.05
#: Steps of the iteration for the ball of a helical gear, each of which gains a digit or more.
_STEPS = 60


def touching_ball(gear: GearData) -> float:
    """Diameter (m) of the balls that touch the flanks at the circle d + 2 x m_n.

    The ball touches where the roll length is that of its centre less D_M/2 cos(beta_b), as the normal is inclined by
    the base helix angle. So alpha_K = pi/z - psi - inv(alpha_t) + tan(alpha_v) - D_M/d_b sin(beta_b) tan(beta_b).
    """
    radius = gear.reference_radius + gear.sign * gear.profile_shift * gear.module
    slope = abs(gear.roll_length(radius)) / gear.base_radius  # tan(alpha_v)
    straight = math.pi / gear.teeth - gear.base_angle + slope
    helix, base, size = gear.base_helix_angle, 2.0 * gear.signed_base_radius, 0.0
    for _ in range(_STEPS if gear.helical else 1):
        centre = straight - size / base * math.sin(helix) * math.tan(helix)
        size = base * (math.tan(centre) - slope) / math.cos(helix)
    return size


def ball_diameter(gear: GearData) -> float:
    """Diameter (m) of balls that touch the flanks near the circle d + 2 x m_n, rounded to a twentieth of a module."""
    step = STEP * gear.module
    return max(1, round(touching_ball(gear) / step)) * step


def over_balls(gear: GearData, diameter: float, thinning: float | None = None) -> float:
    """Return the dimension over balls M_dK (m), negative for an internal gear; NaN where the balls touch no involute.

    Parameters
    ----------
    gear : GearData
        The gear.
    diameter : float
        Diameter of the balls (m).
    thinning : float, optional
        Thinning of its teeth at the reference circle, in the normal section (m); None: that of the gear.
    """
    z = gear.teeth
    share = diameter / (z * gear.module * math.cos(gear.pressure_angle))
    thinner = 0.0 if thinning is None else (thinning - gear.tooth_thinning) / (z * gear.module)
    half = gear.sign * gear.half_thickness_angle - thinner
    value = inv(gear.transverse_pressure_angle) + share - (math.pi / z - half)
    if value <= 0.0:
        return math.nan
    centres = 2.0 * gear.signed_base_radius / math.cos(inverse_inv(value))
    return centres * (math.cos(0.5 * math.pi / z) if z % 2 else 1.0) + diameter
