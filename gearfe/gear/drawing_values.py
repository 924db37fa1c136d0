"""Values on drawings in place of coefficients: tip and root diameters, and the span size over several teeth.

The span size over k teeth (base tangent length) of ISO 21771, less what thinning s takes off,

.. math:: W_k = m\\cos\\alpha\\,[(k - 1/2)\\pi + z\\,\\mathrm{inv}\\,\\alpha] + 2 x m\\sin\\alpha - s\\cos\\alpha
"""

from __future__ import annotations

import math
from typing import Any

from ..errors import InputError
from ..tables.pair import GearTable
from .involute import inv
from .spur_gear import Gear


def coefficients(own: GearTable, module_mm: float, form: dict[str, Any], where: str) -> dict[str, float]:
    """Keys of the tooth form that the drawing values of a gear stand for.

    Parameters
    ----------
    module_mm
        Its module (mm).
    form
        Its tooth form without them, as `gearfe.tables.pair.PairTable.tooth_form` gives it.
    where
        Table that the gear stands in, for messages.

    Raises
    ------
    InputError
        For a span size that needs more material than the profile shift gives.
    """
    half, x = 0.5 * own.teeth, float(form["profile_shift"])
    made: dict[str, float] = {}
    if own.tip_diameter_mm is not None:
        made |= {"addendum": 0.5 * own.tip_diameter_mm / module_mm - half - x, "tip_shortening": 0.0}
    if own.root_diameter_mm is not None:
        made["dedendum"] = half + x - 0.5 * own.root_diameter_mm / module_mm
    if own.span_mm is not None and own.span_teeth is not None:
        angle = math.radians(form["pressure_angle_deg"])
        most = module_mm * _span(own.teeth, x, angle, own.span_teeth)
        if own.span_mm > most:
            problem = f"must be <= {most:.6g} mm, the span over {own.span_teeth} teeth without backlash"
            raise InputError(f"{where}.span_mm", own.span_mm, problem, "use more profile_shift, or another span_teeth")
        made["tooth_thinning_um"] = 1e3 * (most - own.span_mm) / math.cos(angle)
    return made


def span_size(gear: Gear, teeth: int) -> float:
    """Span size over so many teeth (m)."""
    nominal = gear.module * _span(gear.teeth, gear.profile_shift, gear.pressure_angle, teeth)
    return nominal - gear.tooth_thinning * math.cos(gear.pressure_angle)


def span_teeth(gear: Gear) -> int:
    """Number of teeth whose span touches the flanks nearest to the diameter d + 2 x m.

    The plates touch where the roll length is half the span: W_k^2 = d_v^2 - d_b^2, solved for k.
    """
    diameter = gear.pitch_diameter + 2.0 * gear.profile_shift * gear.module
    span = math.sqrt(max(0.0, diameter**2 - (2.0 * gear.base_radius) ** 2))
    return max(2, round(1.0 + (span - span_size(gear, 1)) / gear.base_pitch))


def _span(z: int, x: float, angle: float, k: int) -> float:
    """Span size without thinning (times module)."""
    return math.cos(angle) * ((k - 0.5) * math.pi + z * inv(angle)) + 2.0 * x * math.sin(angle)
