"""Data of one gear and its rack, and what follows from them in closed form (ISO 21771 names, SI units).

All angles are in radians, lengths in metres. A helical gear has the data of its normal section, those of its rack:
normal module, normal pressure angle, coefficients in units of the normal module. What follows from them is of the
transverse section, which is that of the gear's profile, unless the name says normal. Spur gears have one section.

An internal gear has a negative number of teeth. By ISO 21771 its diameters are negative, too, and every formula holds
for both kinds of gear. Here radii and diameters are positive magnitudes, which `GearData.sign` turns into the
standard's values; roll lengths have the standard's sign. So roll lengths rise from root to tip on every flank, from
-S_f to -S_a on an internal one. Its tooth 0 stands on the -x axis and points to +x, like a point of radius -r and polar
angle 0. Its left flank is the one at y > 0, and its teeth are counted clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

from ...base.tables.pair import ROUNDING_MM
from .curves import inv

#: Differences of coefficients that are taken for rounding (times module): published ones have four digits.
ROUNDED = 1e-4


def rounding(module: float) -> float:
    """Difference of lengths (m) of a gear that is taken for rounding: 1 um, or that of coefficients of four digits."""
    return max(1e-3 * ROUNDING_MM, ROUNDED * module)


@dataclass(frozen=True)
class TipRelief:
    """Material taken off the flank towards the tip: amount * ((s - s0)/length)^exponent, normal to the involute.

    Parameters
    ----------
    amount
        Relief at the tip circle (m).
    length
        Roll length measured from the tip circle over which it runs out (m).
    exponent
        1: linear, 2: parabolic (-); at least 1.
    """

    amount: float
    length: float
    exponent: float = 1.0


@dataclass(frozen=True)
class Web:
    """Disc between rim and hub that is narrower than the face of an external gear.

    Parameters
    ----------
    width
        Along the axis (m).
    outer_diameter
        Inner diameter of the rim, where the web ends (m).
    inner_diameter
        Outer diameter of the hub (m); None: the web reaches down to the bore.
    offset
        Middle of the web less that of the face width, along the axis (m).
    """

    width: float
    outer_diameter: float
    inner_diameter: float | None = None
    offset: float = 0.0

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii at which it ends within the gear (m), the outer one first."""
        diameters = (self.outer_diameter, self.inner_diameter)
        return tuple(0.5 * diameter for diameter in diameters if diameter is not None)


@dataclass(frozen=True)
class GearData:
    """Unchecked data of a gear; `gearfe.gears.geometry.spur_gear.Gear` checks them and describes the arguments."""

    teeth: int
    module: float
    pressure_angle: float
    face_width: float
    bore_diameter: float = 0.0
    profile_shift: float = field(default=0.0, kw_only=True)
    addendum: float = field(default=1.0, kw_only=True)
    dedendum: float = field(default=1.25, kw_only=True)
    rack_tip_radius: float = field(default=0.3, kw_only=True)
    tip_round: float = field(default=0.0, kw_only=True)
    tip_shortening: float = field(default=0.0, kw_only=True)
    tip_relief: TipRelief | None = field(default=None, kw_only=True)
    tooth_thinning: float = field(default=0.0, kw_only=True)
    helix_angle: float = field(default=0.0, kw_only=True)
    hand: str = field(default="right", kw_only=True)
    web: Web | None = field(default=None, kw_only=True)
    rim_diameter: float | None = field(default=None, kw_only=True)
    rim: str = field(default="bolted", kw_only=True)
    cutter_teeth: int | None = field(default=None, kw_only=True)
    cutter_shift: float = field(default=0.0, kw_only=True)
    form_diameter: float | None = field(default=None, kw_only=True)

    @property
    def internal(self) -> bool:
        """Whether it is an internal gear."""
        return self.teeth < 0

    @property
    def sign(self) -> int:
        """Sign of the standard's diameters: 1, of an internal gear -1."""
        return -1 if self.teeth < 0 else 1

    @property
    def tooth_count(self) -> int:
        """Number of teeth |z| without sign."""
        return abs(self.teeth)

    @property
    def narrow_web(self) -> Web | None:
        """Web if it is narrower than the face."""
        web = self.web
        return web if web is not None and web.width < (1.0 - ROUNDED) * self.face_width else None

    @cached_property
    def held_radius(self) -> float:
        """Radius of the circle by which the gear is held (m): its bore, or the outside of an internal gear's rim."""
        return 0.5 * (self.bore_diameter if self.rim_diameter is None else self.rim_diameter)

    @cached_property
    def signed_base_radius(self) -> float:
        """Base radius with the standard's sign (m)."""
        return self.sign * self.base_radius

    @cached_property
    def helical(self) -> bool:
        """Whether it has a helix angle."""
        return self.helix_angle != 0.0

    @cached_property
    def transverse_module(self) -> float:
        """Transverse module m_t = m_n/cos(beta) (m)."""
        return self.module / math.cos(self.helix_angle)

    @cached_property
    def transverse_pressure_angle(self) -> float:
        """Transverse pressure angle alpha_t at the reference circle (rad): tan(alpha_t) = tan(alpha_n)/cos(beta)."""
        return transverse_angle(self.pressure_angle, self.helix_angle)

    @cached_property
    def base_helix_angle(self) -> float:
        """Helix angle beta_b at the base circle (rad): sin(beta_b) = sin(beta) cos(alpha_n)."""
        return math.asin(math.sin(self.helix_angle) * math.cos(self.pressure_angle))

    @cached_property
    def twist_rate(self) -> float:
        """Turn of the transverse section per length along the axis, tan(beta)/r (rad/m).

        Positive for a right hand: sections nearer to the viewer of the transverse plane are turned counter-clockwise.
        """
        rate = math.tan(self.helix_angle) / self.reference_radius
        return -rate if self.hand == "left" else rate

    @cached_property
    def virtual_teeth(self) -> float:
        """Virtual number of teeth z_n = z/(cos^2(beta_b) cos(beta)) (-), negative for an internal gear."""
        return self.teeth / (math.cos(self.base_helix_angle) ** 2 * math.cos(self.helix_angle))

    @cached_property
    def pitch_diameter(self) -> float:
        """Reference diameter d = |z| m_t (m)."""
        return self.tooth_count * self.transverse_module

    @cached_property
    def reference_radius(self) -> float:
        """Reference radius r = |z| m_t/2 (m)."""
        return 0.5 * self.pitch_diameter

    @cached_property
    def base_radius(self) -> float:
        """Base radius r_b = r cos(alpha_t) (m)."""
        return self.reference_radius * math.cos(self.transverse_pressure_angle)

    @cached_property
    def base_pitch(self) -> float:
        """Transverse base pitch p_bt = pi m_t cos(alpha_t) (m)."""
        return math.pi * self.transverse_module * math.cos(self.transverse_pressure_angle)

    @cached_property
    def reference_modules(self) -> float:
        """Reference radius over normal module, |z|/(2 cos(beta)) (-)."""
        return self.tooth_count / 2 / math.cos(self.helix_angle)

    @cached_property
    def tip_radius(self) -> float:
        """Tip radius r_a = r + (h_aP + x - k) m_n (m); of an internal gear r - (h_aP + x - k) m_n."""
        s = self.sign
        height = self.reference_modules + s * self.addendum + s * self.profile_shift - s * self.tip_shortening
        return self.module * height

    @cached_property
    def root_radius(self) -> float:
        """Root radius r_f = r + (x - h_fP) m_n (m); of an internal gear r - (x - h_fP) m_n."""
        s = self.sign
        return self.module * (self.reference_modules + s * self.profile_shift - s * self.dedendum)

    @cached_property
    def half_thickness_angle(self) -> float:
        """Half the angular tooth thickness at the reference circle (rad).

        psi = pi/(2z) + 2 x tan(alpha_n)/z - thinning/(z m_n) with z = |z|: cos(beta) cancels, as s_t = s_n/cos(beta)
        and m_t = m_n/cos(beta).
        """
        z = self.tooth_count
        return (
            math.pi / (2 * z)
            + 2.0 * self.profile_shift * math.tan(self.pressure_angle) / z
            - self.tooth_thinning / (z * self.module)
        )

    @cached_property
    def base_angle(self) -> float:
        """Polar angle psi + inv(alpha_t) at which the left involute leaves the base circle (rad).

        Of an internal gear -psi + inv(alpha_t), counted from the -x axis.
        """
        return self.sign * self.half_thickness_angle + inv(self.transverse_pressure_angle)

    def roll_length(self, radius: float) -> float:
        """Roll length of the involute at a radius >= r_b, sqrt(radius^2 - r_b^2) (m), negative on an internal gear."""
        return self.sign * math.sqrt(max(0.0, (radius - self.base_radius) * (radius + self.base_radius)))

    def span_size(self, teeth: int) -> float:
        """Span size over k teeth less thinning s, W_k - s cos(alpha_n) (m), see `nominal_span`.

        Of an internal gear over k spaces, and negative.
        """
        nominal = self.module * nominal_span(
            self.teeth, self.profile_shift, self.pressure_angle, teeth, self.helix_angle
        )
        return nominal - self.tooth_thinning * math.cos(self.pressure_angle)

    @cached_property
    def span_teeth(self) -> int:
        """Number of teeth whose span touches the flanks nearest to the diameter d + 2 x m.

        The plates touch where the roll length is half the span, seen along the base helix: W_k^2 cos^2(beta_b) =
        d_v^2 - d_b^2, solved for k. Of an internal gear it is the number of spaces, and the diameter d - 2 x m.
        """
        diameter = self.pitch_diameter + self.sign * 2.0 * self.profile_shift * self.module
        span = math.sqrt(max(0.0, diameter**2 - (2.0 * self.base_radius) ** 2))
        cosine = math.cos(self.base_helix_angle)
        return max(2, round(1.0 + (span / cosine - abs(self.span_size(1))) / (self.base_pitch * cosine)))


def transverse_angle(angle: float, helix: float) -> float:
    """Transverse pressure angle (rad) of a normal one at a helix angle (rad); without one the same, bit by bit."""
    return math.atan(math.tan(angle) / math.cos(helix)) if helix else angle


def nominal_span(z: int, x: float, angle: float, k: int, helix: float = 0.0) -> float:
    """Return the span size over normal module without thinning.

    W_k/m_n = cos(alpha_n) [(k - 1/2) pi + z inv(alpha_t)] + 2 x sin(alpha_n), with (1/2 - k) pi for z < 0.

    Parameters
    ----------
    z : int
        Number of teeth, negative for an internal gear.
    x : float
        Profile shift coefficient.
    angle : float
        Normal pressure angle alpha_n (rad).
    k : int
        Number of teeth spanned, of an internal gear of spaces.
    helix : float
        Helix angle beta (rad).
    """
    teeth = k - 0.5 if z > 0 else 0.5 - k
    return math.cos(angle) * (teeth * math.pi + z * inv(transverse_angle(angle, helix))) + 2.0 * x * math.sin(angle)
