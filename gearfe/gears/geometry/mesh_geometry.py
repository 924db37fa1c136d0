"""How two gears mesh in the transverse plane, and how far along their axes (ISO 21771 names).

Convention of a pair: pinion centre at the origin, wheel centre at (a, 0). At pinion angle 0 a pinion tooth (tooth 0) is
centred on the line of centres and a wheel space faces it. Angles are positive counter-clockwise; the wheel turns by
-pinion angle * z1/z2 + twist. A positive twist presses the driving flanks together. These are the left
(counter-clockwise) flanks of the pinion's teeth, and the left flanks of the wheel's teeth in the wheel's own frame.
Their line of action touches the pinion's base circle at polar angle -alpha_w. The roll lengths s1 on the pinion and s2
on the wheel satisfy s1 + s2 = a sin(alpha_w) along it. A pinion flank passes s1 at the pinion angle s1/r_b1 - alpha_w -
psi1 - inv(alpha).

The wheel may be an internal gear. All relations hold with the negative z2, a, r_b2 and s2 of ISO 21771. Its centre lies
at (-|a|, 0), and it rotates in the sense of the pinion. A positive twist closes the driving flanks always: it turns an
internal wheel clockwise. Centre distances and radii here are magnitudes, roll lengths and the gear ratio have signs.

SI units and radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from .curves import inv, inverse_inv
from .spur_gear import Gear


class ContactModel:
    """What a pair of gears is computed with: a base of classes that need finite elements, without these."""


@dataclass(frozen=True)
class PathPoint:
    """A point of the path of contact: roll lengths (m) on both gears and the pinion angle (rad) for tooth 0."""

    name: str
    pinion_roll: float
    wheel_roll: float
    pinion_angle: float


@dataclass(frozen=True)
class MeshGeometry:
    """Two gears in mesh, not yet checked; `GearPair` is the checked one.

    Parameters
    ----------
    pinion, wheel
        The gears; the pinion drives, and the wheel may be an internal gear.
    centre_distance
        Centre distance |a| (m); None: without backlash for the unthinned teeth, from the profile shifts.
    axial_offset
        Middle of the wheel's face width less that of the pinion's, along the axes (m).
    """

    pinion: Gear
    wheel: Gear
    centre_distance: float | None = None
    axial_offset: float = field(default=0.0, kw_only=True)

    @cached_property
    def internal(self) -> bool:
        """Whether the wheel is an internal gear."""
        return self.wheel.internal

    @cached_property
    def sign(self) -> int:
        """Sign of the standard's centre distance: 1, of an internal pair -1."""
        return self.wheel.sign

    @cached_property
    def wheel_centre(self) -> float:
        """x of the wheel's centre (m), the standard's centre distance: negative for an internal pair."""
        return self.sign * self.working_centre_distance

    @cached_property
    def gear_ratio(self) -> float:
        """Gear ratio z2/z1 (-), negative for an internal pair."""
        return self.wheel.teeth / self.pinion.teeth

    @cached_property
    def reference_centre_distance(self) -> float:
        """Reference centre distance a_0 = r_1 + r_2 (m), of an internal pair r_2 - r_1."""
        return self.sign * self.pinion.reference_radius + self.wheel.reference_radius

    @cached_property
    def working_pressure_angle(self) -> float:
        """Transverse working pressure angle alpha_wt (rad): a_0 cos(alpha_t)/a = cos(alpha_wt), or from the profile
        shifts, inv(alpha_wt) = inv(alpha_t) + 2 (x_1 + x_2) tan(alpha_n)/(z_1 + z_2)."""
        alpha, normal = self.pinion.transverse_pressure_angle, self.pinion.pressure_angle
        if self.centre_distance is not None:
            return math.acos(self.reference_centre_distance * math.cos(alpha) / self.centre_distance)
        shift = self.pinion.profile_shift + self.wheel.profile_shift
        if shift == 0.0:
            return alpha
        return inverse_inv(inv(alpha) + 2.0 * shift * math.tan(normal) / (self.pinion.teeth + self.wheel.teeth))

    @cached_property
    def working_centre_distance(self) -> float:
        """Centre distance a = a_0 cos(alpha_t)/cos(alpha_wt) (m)."""
        if self.centre_distance is not None:
            return self.centre_distance
        if self.working_pressure_angle == self.pinion.transverse_pressure_angle:
            return self.reference_centre_distance
        ratio = math.cos(self.pinion.transverse_pressure_angle) / math.cos(self.working_pressure_angle)
        return self.reference_centre_distance * ratio

    @cached_property
    def pinion_working_radius(self) -> float:
        """Radius of the pinion's working pitch circle a/(1 + z2/z1) (m)."""
        return self.wheel_centre / (1.0 + self.gear_ratio)

    @cached_property
    def wheel_working_radius(self) -> float:
        """Radius of the wheel's working pitch circle (m)."""
        return self.working_centre_distance - self.sign * self.pinion_working_radius

    @cached_property
    def base_pitch(self) -> float:
        """Transverse base pitch p_bt (m)."""
        return self.pinion.base_pitch

    @cached_property
    def base_backlash(self) -> float:
        """Backlash j_bt along the line of action in the transverse plane (m): r_b1, r_b2 times the angles that the two
        teeth leave free."""
        half = inv(self.working_pressure_angle)
        pinion, wheel = self.pinion, self.wheel
        tooth1 = 2.0 * pinion.base_radius * (pinion.base_angle - half)
        tooth2 = 2.0 * wheel.signed_base_radius * (wheel.base_angle - half)
        gap = self.base_pitch - tooth1 - tooth2
        return 0.0 if abs(gap) < 1e-12 else gap

    @cached_property
    def backlash(self) -> float:
        """Circumferential backlash j_wt = j_bt/cos(alpha_wt) at the working pitch circles (m)."""
        return self.base_backlash / math.cos(self.working_pressure_angle)

    @cached_property
    def normal_backlash(self) -> float:
        """Normal backlash j_bn = j_bt cos(beta_b), the least distance of the flanks (m)."""
        return self.base_backlash * math.cos(self.pinion.base_helix_angle)

    @cached_property
    def contact_twist(self) -> float:
        """Twist of the wheel (rad) at which rigid driving flanks just touch: half the backlash, j_bt/(2 r_b2)."""
        return 0.5 * self.base_backlash / self.wheel.base_radius

    @cached_property
    def mesh_cycle(self) -> float:
        """Pinion angle from one tooth to the next, 2 pi/z1 (rad)."""
        return 2.0 * math.pi / self.pinion.teeth

    @cached_property
    def tangent_length(self) -> float:
        """Length a sin(alpha_w) of the line of action between the base circles (m): s1 + s2 on it.

        Negative for an internal pair, whose line of action touches both base circles on one side of the contact.
        """
        return self.wheel_centre * math.sin(self.working_pressure_angle)

    def pinion_angle_at(self, pinion_roll: float) -> float:
        """Pinion angle (rad) at which the driving flank of tooth 0 passes the roll length `pinion_roll` (m)."""
        pinion = self.pinion
        return pinion_roll / pinion.base_radius - self.working_pressure_angle - pinion.base_angle

    def pinion_roll_at(self, pinion_angle: float) -> float:
        """Roll length (m) on the driving flank of tooth 0 on the line of action at a pinion angle (rad)."""
        pinion = self.pinion
        return pinion.base_radius * (pinion_angle + self.working_pressure_angle + pinion.base_angle)

    def wheel_angle_at(self, pinion_angle: Any, twist: Any = 0.0) -> Any:
        """Wheel angle (rad; a number or an array) from its meshing position, -pinion angle/ratio + twist.

        A twist turns an internal wheel by its negative.
        """
        return self.sign * twist - pinion_angle / self.gear_ratio

    @cached_property
    def wheel_phase(self) -> float:
        """Angle pi + pi/z2 (rad) of the wheel's tooth frame at pinion angle 0: a space faces the pinion."""
        return math.pi + math.pi / self.wheel.teeth

    def tooth_angle(self, gear: int, tooth: Any, pinion_angle: Any, twist: Any) -> Any:
        """Return the angle of the frame of a tooth (rad).

        Parameters
        ----------
        gear : int
            0 for the pinion, 1 for the wheel.
        tooth : int or ndarray
            Number of the tooth.
        pinion_angle : float or ndarray
            Pinion angle (rad).
        twist : float or ndarray
            Twist of the wheel from the centred position (rad).
        """
        if gear == 0:
            return pinion_angle + tooth * self.mesh_cycle
        wheel = self.wheel_phase + 2.0 * math.pi * tooth / self.wheel.teeth
        return wheel + self.wheel_angle_at(pinion_angle, twist)

    def path_limits(self, *, rounded: bool = True, relieved: bool = False) -> tuple[float, float]:
        """Pinion roll lengths (m) at which contact starts (wheel's tip) and ends (pinion's tip).

        Tips end at the tip circle, with `rounded` where the tip round starts, with `relieved` where the relief starts
        (if that is lower). No flank reaches below its form point.
        """

        def tip(gear: Gear) -> float:
            profile = gear.profile
            end = min(profile.round_roll, profile.tip_roll) if rounded else profile.tip_roll
            return min(end, profile.relief_roll) if relieved else end

        start = max(self.tangent_length - tip(self.wheel), self.pinion.form_roll)
        end = min(tip(self.pinion), self.tangent_length - self.wheel.form_roll)
        return start, end

    @cached_property
    def contact_ratio(self) -> float:
        """Nominal transverse contact ratio eps_alpha (-): path between the tip circles (or form points, if they shorten
        it) over the base pitch.

        Tip rounds and relief are not considered."""
        start, end = self.path_limits(rounded=False)
        return (end - start) / self.base_pitch

    @cached_property
    def contact_ratio_active(self) -> float:
        """Contact ratio (-) of the path between the starts of the tip rounds; relief does not count."""
        start, end = self.path_limits()
        return (end - start) / self.base_pitch

    @cached_property
    def contact_ratio_effective(self) -> float:
        """Contact ratio (-) of the full involute only: the path ends where a tip round or a tip relief starts. This is
        what an unloaded pair has; under load, contact grows into the relieved part up to `contact_ratio_active`."""
        start, end = self.path_limits(relieved=True)
        return max(0.0, end - start) / self.base_pitch

    @cached_property
    def common_width(self) -> float:
        """Width b on which both gears have teeth (m)."""
        one, two = self.pinion.face_width, self.wheel.face_width
        return min(one, two, 0.5 * (one + two) - abs(self.axial_offset))

    @cached_property
    def overlap_ratio(self) -> float:
        """Overlap ratio eps_beta = b sin(beta)/(pi m_n) (-)."""
        pinion = self.pinion
        return self.common_width * math.sin(pinion.helix_angle) / (math.pi * pinion.module)

    @cached_property
    def total_contact_ratio(self) -> float:
        """Total contact ratio eps_gamma = eps_alpha + eps_beta (-)."""
        return self.contact_ratio + self.overlap_ratio

    @cached_property
    def working_helix_angle(self) -> float:
        """Helix angle beta_w at the working pitch circles (rad): tan(beta_w) = r_w tan(beta)/r."""
        pinion = self.pinion
        return math.atan(math.tan(pinion.helix_angle) * self.pinion_working_radius / pinion.reference_radius)

    @cached_property
    def path_length(self) -> float:
        """Length g_alpha of the nominal path of contact (m)."""
        return self.contact_ratio * self.base_pitch

    @cached_property
    def path(self) -> dict[str, PathPoint]:
        """Points A, B, C, D, E of the active path (tip rounds respected, relief not).

        A: start of contact, at the wheel's tip. B = E - p_b: the tooth pair ahead leaves contact. C: pitch point. D = A
        + p_b: the next pair comes into contact. E: end, at the pinion's tip. Between B and D one pair carries when 1 <=
        contact ratio <= 2.
        """
        start, end = self.path_limits()
        pitch_point = self.pinion.base_radius * math.tan(self.working_pressure_angle)
        rolls = {"A": start, "B": end - self.base_pitch, "C": pitch_point, "D": start + self.base_pitch, "E": end}
        return {n: PathPoint(n, s, self.tangent_length - s, self.pinion_angle_at(s)) for n, s in rolls.items()}
