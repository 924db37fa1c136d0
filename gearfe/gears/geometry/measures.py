r"""Spans of teeth and the backlash that allowances of tooth thickness and centre distance leave (ISO 21771, DIN 3960).

A tooth that is thinner by :math:`|A_s|` at the reference circle, in the normal section, leaves
:math:`|A_s|\cos\alpha_t/\cos\beta` more along the transverse line of action, on which

.. math::
    j_{bt} = 2\,(r_{b1} + r_{b2})(\mathrm{inv}\,\alpha_{wt} - \mathrm{inv}\,\alpha_t) - 2\,(x_1 + x_2)\,m_n
    \tan\alpha_n\cos\alpha_t/\cos\beta + \sum |A_s|\cos\alpha_t/\cos\beta,

divided by :math:`\cos\alpha_{wt}` the circumferential backlash at the working circles :math:`j_{wt}`, and
:math:`j_n = j_{bt}\cos\beta_b`. Base radius and centre distance of an internal gear are negative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...base.errors import InputError
from .curves import inv
from .gear_data import GearData
from .mesh_geometry import MeshGeometry


def span_of(gear: GearData, teeth: int, thinning: float) -> float:
    """Return the span size W_k (m) over so many teeth whose thinning is `thinning` (m)."""
    return gear.span_size(teeth) + (gear.tooth_thinning - thinning) * math.cos(gear.pressure_angle)


@dataclass(frozen=True)
class Backlash:
    """Largest and least backlash (m): circumferential at the working circles, and normal to the flanks."""

    circumferential: tuple[float, float]
    normal: tuple[float, float]


def backlash_limits(
    pair: MeshGeometry,
    thickness: tuple[tuple[float, float], tuple[float, float]],
    distance: tuple[float, float] = (0.0, 0.0),
) -> Backlash:
    """Return the largest and the least backlash that allowances leave.

    Parameters
    ----------
    pair : MeshGeometry
        The gears; what thins their teeth does not count.
    thickness
        Return upper and lower allowance of the tooth thickness of pinion and wheel, A_sne and A_sni (m). They are those
        at the reference circle in the normal section, negative for thinner teeth.
    distance
        Upper and lower allowance of the centre distance (m).

    Raises
    ------
    InputError
        For an upper allowance below the lower one.
    """
    for name, (upper, lower) in (("thickness", thickness[0]), ("thickness", thickness[1]), ("distance", distance)):
        if upper < lower:
            raise InputError(
                name, None, f"has an upper allowance of {1e6 * upper:g} um below the lower one", "swap them"
            )
    pinion = pair.pinion
    base = pinion.signed_base_radius + pair.wheel.signed_base_radius
    cosine = math.cos(pinion.transverse_pressure_angle) / math.cos(pinion.helix_angle)
    shift = pinion.profile_shift + pair.wheel.profile_shift
    nominal = 2.0 * base * inv(pinion.transverse_pressure_angle)
    nominal += 2.0 * shift * pinion.module * math.tan(pinion.pressure_angle) * cosine

    def along(allowance: float, thinner: float) -> tuple[float, float]:
        """Backlash at the working circles and normal to the flanks."""
        angle = math.acos(base / (pair.wheel_centre + pair.sign * allowance))
        play = 2.0 * base * inv(angle) - nominal + thinner * cosine
        return play / math.cos(angle), play * math.cos(pinion.base_helix_angle)

    thicker, thinner = -thickness[0][0] - thickness[1][0], -thickness[0][1] - thickness[1][1]
    loose, tight = distance[::-1] if pair.internal else distance  # a pinion nearer to its ring has less backlash
    least, most = along(tight, thicker), along(loose, thinner)
    return Backlash((most[0], least[0]), (most[1], least[1]))
