r"""The root of an internal gear: as a pinion-type cutter leaves it, or a circular fillet between given diameters.

The cutter has :math:`z_0` teeth of the profile shift :math:`x_0` and rolls with the gear without backlash, so

.. math::
    \operatorname{inv}\alpha_0 = \operatorname{inv}\alpha_t + \frac{2 (x_0 + x)\tan\alpha_n}{z_0 + z}, \qquad
    a_0 = \frac{(|z| - z_0)\,m_t}{2}\,\frac{\cos\alpha_t}{\cos\alpha_0}

with the gear's negative z (ISO 21771). Its tip circle reaches the root circle, which the gear's data give:
:math:`r_{a0} = r_f - a_0`. Its tip round is a circle in the transverse section. What the gear's teeth are thinned by,
the cutter's are thicker.

A cutter may cut away what it has generated (Colbourne, *The Geometry of Involute Gears*, 1987, ch. 8):

- *involute*: tips of the gear that lie within where the cutter's involute begins, at its base circle;
- *trochoid*: tips of cutter and gear that meet beside the path, if the numbers of teeth are too close (`tips_apart`);
- *radial infeed*: the cutter moves into the gear along the line of centres, see `gearfe.gears.geometry.ring`.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from ...base.errors import InputError
from .curves import Arc, CutterTrochoid, Root, bisect, inv, inverse_inv
from .gear_data import GearData, rounding

#: Angles (rad) that are none.
NIL = 1e-12
#: Fewest teeth of a cutter.
LEAST_CUTTER = 8


@dataclass(frozen=True)
class Cutter:
    """Pinion-type cutter of an internal gear.

    Parameters
    ----------
    gear
        The internal gear.
    teeth
        Number of teeth z_0.
    working_angle
        Transverse working pressure angle alpha_0 with the gear (rad).
    """

    gear: GearData
    teeth: int
    working_angle: float

    @cached_property
    def base_radius(self) -> float:
        """Base radius (m)."""
        gear = self.gear
        return 0.5 * self.teeth * gear.transverse_module * math.cos(gear.transverse_pressure_angle)

    @cached_property
    def pitch_radii(self) -> tuple[float, float]:
        """Radii of the pitch circles of gear and cutter (m)."""
        cosine = math.cos(self.working_angle)
        return self.gear.base_radius / cosine, self.base_radius / cosine

    @cached_property
    def centre_distance(self) -> float:
        """Distance a_0 of the axes (m), without sign."""
        return self.pitch_radii[0] - self.pitch_radii[1]

    @cached_property
    def tip_radius(self) -> float:
        """Tip radius r_a0 (m), which cuts the gear's root circle."""
        return self.gear.root_radius - self.centre_distance

    @cached_property
    def base_angle(self) -> float:
        """Half the angular thickness of its teeth at the base circle (rad), for no backlash in the gear's spaces."""
        gear, working = self.gear, inv(self.working_angle)
        space = math.pi / gear.tooth_count + gear.base_angle - working
        return working + self.pitch_radii[0] / self.pitch_radii[1] * space

    def round_centre(self, radius: float) -> tuple[float, float, float]:
        """Return the centre of a tip round of `radius` (m): its radius (m), its polar angle (rad), and the distance of
        its normal to the flank from the base circle's point of tangency (m)."""
        centre = self.tip_radius - radius
        core = (centre - self.base_radius) * (centre + self.base_radius)
        along = math.sqrt(max(core, 0.0))
        angle = self.base_angle - (along + radius) / self.base_radius + math.atan2(along, self.base_radius)
        return centre, angle, along


def cutter_of(gear: GearData) -> Cutter:
    """Return the cutter of an internal gear.

    Raises
    ------
    InputError
        For one that cannot roll with the gear.
    """
    teeth = gear.tooth_count // 2 if gear.cutter_teeth is None else gear.cutter_teeth
    step = 2.0 * math.tan(gear.pressure_angle) / (teeth - gear.tooth_count)
    alpha = inv(gear.transverse_pressure_angle)
    value = alpha + step * (gear.cutter_shift + gear.profile_shift)
    if value <= 0.0:
        limit = ("<", -alpha / step - gear.profile_shift, "")
        problem = "leaves no working pressure angle of cutter and gear"
        raise InputError("cutter_shift", gear.cutter_shift, problem, "use a smaller shift of the cutter", limit)
    return Cutter(gear, teeth, inverse_inv(value))


@dataclass(frozen=True)
class RingRoot:
    """Root of an internal gear.

    Attributes
    ----------
    curve
        Between root circle and involute; None where they meet in a corner.
    land
        Polar angle of the root circle on one side of the middle of the space (rad).
    form_roll
        Roll length at which the involute starts (m), < 0.
    """

    curve: Root | None
    land: float
    form_roll: float


def ring_root(gear: GearData) -> RingRoot:
    """Return the root of an internal gear.

    Raises
    ------
    InputError
        Where no cutter makes one, or given diameters leave no room for a fillet.
    """
    if gear.tip_radius <= gear.base_radius:
        most = gear.addendum - (gear.base_radius - gear.tip_radius) / gear.module
        problem, cure = "puts the tip circle within the base circle, where no involute is", "use less addendum"
        raise InputError("addendum", gear.addendum, problem, cure, ("<", most, ""))
    return _filleted(gear) if gear.form_diameter is not None else _cut(gear, cutter_of(gear))


def _cut(gear: GearData, cutter: Cutter) -> RingRoot:
    pitch, own = cutter.pitch_radii
    lowest, rho = cutter.base_radius, gear.rack_tip_radius * gear.module
    if cutter.tip_radius <= lowest:
        problem = f"puts the cutter's tip circle within its base circle of {2e3 * lowest:.6g} mm"
        most = (lowest + cutter.centre_distance) / gear.module - gear.reference_modules + gear.profile_shift
        raise InputError("dedendum", gear.dedendum, problem, "use more dedendum, or more cutter_teeth", (">", most, ""))
    _check_cutter_tip(gear, cutter)
    largest = _largest_round(cutter)
    if rho - largest > rounding(gear.module):
        limit = math.floor(1e4 * largest / gear.module) / 1e4
        problem = f"exceeds the tip of the cutter with {cutter.teeth} teeth: must be <= {limit:g}"
        cure = "use a smaller radius, less dedendum or more cutter_teeth"
        raise InputError("rack_tip_radius", gear.rack_tip_radius, problem, cure)
    rho = min(rho, largest)
    centre, half, along = cutter.round_centre(rho)
    reach = cutter.centre_distance * math.sin(cutter.working_angle)
    form_roll = -(reach + along + rho)
    end = 0.5 * math.pi - cutter.working_angle
    half = half if half > NIL else 0.0
    curve = CutterTrochoid(pitch, own, centre, half, rho, math.pi / gear.teeth, end)
    if (curve.advance(np.linspace(0.0, 1.0, 129)) < -1e-9 * gear.module).any():
        problem = "makes the cutter undercut the root"
        raise InputError("cutter_teeth", cutter.teeth, problem, "use fewer cutter_teeth, or less dedendum")
    _check_generation(gear, cutter)
    return RingRoot(curve, own / pitch * half, form_roll)


def _check_cutter_tip(gear: GearData, cutter: Cutter) -> None:
    """Raise `InputError` for a cutter whose teeth are pointed."""
    if cutter.round_centre(0.0)[1] > 0.0:
        return
    if cutter.base_angle <= 0.0:
        problem = f"leaves the cutter with {cutter.teeth} teeth no thickness"
        raise InputError("profile_shift", gear.profile_shift, problem, "use less profile shift, or more tooth thinning")
    peak = cutter.base_radius / math.cos(inverse_inv(cutter.base_angle))
    most = (peak + cutter.centre_distance) / gear.module - gear.reference_modules + gear.profile_shift
    problem = f"makes the teeth of the cutter with {cutter.teeth} teeth pointed"
    raise InputError("dedendum", gear.dedendum, problem, "use less dedendum, or more cutter_teeth", ("<", most, ""))


def _largest_round(cutter: Cutter) -> float:
    """Largest tip round of a cutter (m): its middle on that of the tooth, or its begin at the base circle."""
    most = cutter.tip_radius - cutter.base_radius

    def too_large(rho: float) -> float:
        return 1.0 if cutter.round_centre(rho)[1] < 0.0 else -1.0

    return bisect(too_large, 0.0, most) if too_large(most) > 0.0 else most


def _check_generation(gear: GearData, cutter: Cutter) -> None:
    """Raise `InputError` where the cutter cuts away tips that it has generated."""
    reach = cutter.centre_distance * math.sin(cutter.working_angle)
    lost = reach - abs(gear.roll_length(gear.tip_radius))
    if lost > rounding(gear.module):
        most = gear.addendum - (math.hypot(gear.base_radius, reach) - gear.tip_radius) / gear.module
        problem = (
            f"lets the cutter with {cutter.teeth} teeth cut the tips: they reach {1e3 * lost:.4g} mm of roll length "
            "past the begin of its involute"
        )
        cure = "use less addendum or more tip_shortening, or more cutter_teeth"
        raise InputError("addendum", gear.addendum, problem, cure, ("<=", most, ""))
    if tips_apart(gear, cutter.tip_radius, cutter.teeth, cutter.centre_distance, cutter.working_angle) < 0.0:
        shape = "" if gear.cutter_teeth is not None else f" (by default {cutter.teeth})"
        problem = f"is too close to the gear's number of teeth{shape}: tips of cutter and gear meet beside the path"
        fewer = [n for n in range(LEAST_CUTTER, cutter.teeth) if _generates(gear, n)]
        limit = ("<=", float(fewer[-1]), "") if fewer else None
        raise InputError("cutter_teeth", cutter.teeth, problem, "use fewer cutter_teeth, or less addendum", limit)


def _generates(gear: GearData, teeth: int) -> bool:
    try:
        _cut(gear, cutter_of(replace(gear, cutter_teeth=teeth)))
    except InputError:
        return False
    return True


def tips_apart(gear: GearData, tip_radius: float, teeth: int, centre_distance: float, working_angle: float) -> float:
    r"""Return the angle of the pinion (rad) by which its tips pass those of an internal gear beside the path.

    With the pressure angles :math:`\alpha_{a}` at the tip circles, which meet at the angles :math:`\delta` from the
    line of centres,

    .. math:: z_1(\operatorname{inv}\alpha_{a1} + \delta_1) - |z_2| (\operatorname{inv}\alpha_{a2} + \delta_2)
        + (|z_2| - z_1)\operatorname{inv}\alpha_w \ge 0

    (DIN 3993; Colbourne 1987, ch. 8), here over z_1. Circles that do not meet leave it infinite.

    Parameters
    ----------
    gear : GearData
        The internal gear.
    tip_radius : float
        Tip radius of the pinion (m).
    teeth : int
        Its number of teeth.
    centre_distance : float
        Distance of the axes (m), without sign.
    working_angle : float
        Transverse working pressure angle (rad).
    """
    a, r1, r2 = centre_distance, tip_radius, gear.tip_radius
    base1 = gear.base_radius * teeth / gear.tooth_count
    cosines = (r2**2 - r1**2 - a**2) / (2.0 * a * r1), (r2**2 - r1**2 + a**2) / (2.0 * a * r2)
    if max(cosines) >= 1.0 or r1 <= base1 or r2 <= gear.base_radius:
        return math.inf
    if min(cosines) <= -1.0:
        return -math.inf
    bases = base1, gear.base_radius
    at1, at2 = (inv(math.acos(b / r)) + math.acos(c) for b, r, c in zip(bases, (r1, r2), cosines, strict=True))
    z1, z2 = teeth, gear.tooth_count
    return (z1 * at1 - z2 * at2 + (z2 - z1) * inv(working_angle)) / z1


def _filleted(gear: GearData) -> RingRoot:
    """Root of given root circle and form circle: an arc that is tangent to the root circle and to the involute."""
    form = 0.5 * (gear.form_diameter or 0.0)
    roll = gear.roll_length(form)
    low, high = max(gear.tip_radius, gear.base_radius), gear.root_radius
    if not low < form < high:
        problem = f"must be > {2e3 * low:.6g} and < {2e3 * high:.6g} mm, between tip and root circle"
        raise InputError("form_diameter", gear.form_diameter, problem, "correct it, or leave it out: a cutter makes it")
    rho = (high**2 - form**2) / (2.0 * (high + roll))
    turned = gear.base_angle - roll / gear.signed_base_radius
    normal = 1j * cmath.exp(1j * turned)
    centre = -cmath.exp(1j * turned) * (gear.base_radius - 1j * roll) + rho * normal
    middle, start = math.pi / gear.teeth, cmath.phase(-centre)
    land = start - middle
    if land < -NIL:
        least = bisect(lambda r: -_land(gear, r), form, high)
        problem = (
            f"makes a fillet of radius {1e3 * rho:.4g} mm that does not fit the space: must be >= {2e3 * least:.6g} mm"
        )
        raise InputError("form_diameter", gear.form_diameter, problem, "use a larger form diameter or more dedendum")
    arc = Arc((centre.real, centre.imag), -rho, start, cmath.phase(normal))
    return RingRoot(arc, max(land, 0.0), roll)


def _land(gear: GearData, form: float) -> float:
    """Polar angle (rad) of the root circle that the fillet of a form radius (m) leaves."""
    roll = gear.roll_length(form)
    rho = (gear.root_radius**2 - form**2) / (2.0 * (gear.root_radius + roll))
    turned = gear.base_angle - roll / gear.signed_base_radius
    centre = -cmath.exp(1j * turned) * (gear.base_radius - 1j * roll) + rho * 1j * cmath.exp(1j * turned)
    return cmath.phase(-centre) - math.pi / gear.teeth


@lru_cache(maxsize=64)
def cutter_facts(gear: GearData) -> dict[str, float]:
    """Cutter of an internal gear in the words of reports."""
    cutter = cutter_of(gear)
    return {
        "cutter_teeth": cutter.teeth,
        "cutter_shift": gear.cutter_shift,
        "cutter_tip_diameter_mm": 2e3 * cutter.tip_radius,
        "cutter_centre_distance_mm": -1e3 * cutter.centre_distance,
        "cutter_working_pressure_angle_deg": math.degrees(cutter.working_angle),
    }
