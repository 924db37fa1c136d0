"""Gear pairs: how two spur gears mesh in the transverse plane (ISO 21771 names), and the pair of a job file.

Convention of a pair: pinion centre at the origin, wheel centre at (a, 0). At pinion angle 0 a pinion tooth (tooth 0) is
centred on the line of centres and a wheel space faces it. Angles are positive counter-clockwise; the wheel turns by
-pinion angle * z1/z2 + twist. A positive twist presses the driving flanks together: the left (counter-clockwise) flanks
of the pinion's teeth and the left flanks, in the wheel's own frame, of the wheel's teeth. Their line of action touches
the pinion's base circle at polar angle -alpha_w; with s1 and s2 the roll lengths on pinion and wheel, s1 + s2 =
a sin(alpha_w) along it, and a pinion flank passes s1 at the pinion angle s1/r_b1 - alpha_w - psi1 - inv(alpha).

SI units and radians. Whether two gears can run together is checked by `gearfe.gear.validity`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from numbers import Real
from typing import Any

from ..errors import InputError, given
from ..shown import Shown
from ..tables.pair import INSTEAD, GearTable, PairTable
from .curves import inv, inverse_inv
from .spur_gear import Gear, TipRelief, nominal_span
from .validity import check_pair, pair_warnings

__all__ = ["Gear", "GearPair", "MeshGeometry", "PathPoint", "TipRelief"]


@dataclass(frozen=True)
class PathPoint:
    """A point of the path of contact: roll lengths (m) on both gears and the pinion angle (rad) for tooth 0."""

    name: str
    pinion_roll: float
    wheel_roll: float
    pinion_angle: float


@dataclass(frozen=True)
class MeshGeometry:
    """Two external spur gears in mesh, not yet checked; `GearPair` is the checked one.

    Parameters
    ----------
    pinion, wheel
        The gears; the pinion drives.
    centre_distance
        Centre distance a (m); None: without backlash for the unthinned teeth, from the profile shifts.
    """

    pinion: Gear
    wheel: Gear
    centre_distance: float | None = None

    @cached_property
    def gear_ratio(self) -> float:
        """Gear ratio z2/z1 (-)."""
        return self.wheel.teeth / self.pinion.teeth

    @cached_property
    def reference_centre_distance(self) -> float:
        """Reference centre distance a_0 = (r_1 + r_2) (m)."""
        return self.pinion.reference_radius + self.wheel.reference_radius

    @cached_property
    def working_pressure_angle(self) -> float:
        """Working pressure angle alpha_w (rad): a_0 cos(alpha)/a = cos(alpha_w), or from the profile shifts,
        inv(alpha_w) = inv(alpha) + 2 (x_1 + x_2) tan(alpha)/(z_1 + z_2)."""
        alpha = self.pinion.pressure_angle
        if self.centre_distance is not None:
            return math.acos(self.reference_centre_distance * math.cos(alpha) / self.centre_distance)
        shift = self.pinion.profile_shift + self.wheel.profile_shift
        if shift == 0.0:
            return alpha
        return inverse_inv(inv(alpha) + 2.0 * shift * math.tan(alpha) / (self.pinion.teeth + self.wheel.teeth))

    @cached_property
    def working_centre_distance(self) -> float:
        """Centre distance a = a_0 cos(alpha)/cos(alpha_w) (m)."""
        if self.centre_distance is not None:
            return self.centre_distance
        if self.working_pressure_angle == self.pinion.pressure_angle:
            return self.reference_centre_distance
        ratio = math.cos(self.pinion.pressure_angle) / math.cos(self.working_pressure_angle)
        return self.reference_centre_distance * ratio

    @cached_property
    def pinion_working_radius(self) -> float:
        """Radius of the pinion's working pitch circle a/(1 + z2/z1) (m)."""
        return self.working_centre_distance / (1.0 + self.gear_ratio)

    @cached_property
    def wheel_working_radius(self) -> float:
        """Radius of the wheel's working pitch circle (m)."""
        return self.working_centre_distance - self.pinion_working_radius

    @cached_property
    def base_pitch(self) -> float:
        """Base pitch p_b (m)."""
        return self.pinion.base_pitch

    @cached_property
    def normal_backlash(self) -> float:
        """Backlash j_bn along the line of action (m): r_b1, r_b2 times the angles that the two teeth leave free."""
        half = inv(self.working_pressure_angle)
        pinion, wheel = self.pinion, self.wheel
        tooth1 = 2.0 * pinion.base_radius * (pinion.base_angle - half)
        tooth2 = 2.0 * wheel.base_radius * (wheel.base_angle - half)
        gap = self.base_pitch - tooth1 - tooth2
        return 0.0 if abs(gap) < 1e-12 else gap

    @cached_property
    def backlash(self) -> float:
        """Circumferential backlash j_wt = j_bn/cos(alpha_w) at the working pitch circles (m)."""
        return self.normal_backlash / math.cos(self.working_pressure_angle)

    @cached_property
    def contact_twist(self) -> float:
        """Twist of the wheel (rad) at which rigid driving flanks just touch: half the backlash, j_bn/(2 r_b2)."""
        return 0.5 * self.normal_backlash / self.wheel.base_radius

    @cached_property
    def mesh_cycle(self) -> float:
        """Pinion angle from one tooth to the next, 2 pi/z1 (rad)."""
        return 2.0 * math.pi / self.pinion.teeth

    @cached_property
    def tangent_length(self) -> float:
        """Length a sin(alpha_w) of the line of action between the base circles (m): s1 + s2 on it."""
        return self.working_centre_distance * math.sin(self.working_pressure_angle)

    def pinion_angle_at(self, pinion_roll: float) -> float:
        """Pinion angle (rad) at which the driving flank of tooth 0 passes the roll length `pinion_roll` (m)."""
        pinion = self.pinion
        return pinion_roll / pinion.base_radius - self.working_pressure_angle - pinion.base_angle

    def pinion_roll_at(self, pinion_angle: float) -> float:
        """Roll length (m) on the driving flank of tooth 0 on the line of action at a pinion angle (rad)."""
        pinion = self.pinion
        return pinion.base_radius * (pinion_angle + self.working_pressure_angle + pinion.base_angle)

    def wheel_angle_at(self, pinion_angle: Any, twist: Any = 0.0) -> Any:
        """Wheel angle (rad; a number or an array) from its meshing position, -pinion angle/ratio + twist."""
        return twist - pinion_angle / self.gear_ratio

    @cached_property
    def wheel_phase(self) -> float:
        """Angle pi + pi/z2 (rad) of the wheel's tooth frame at pinion angle 0: a space faces the pinion."""
        return math.pi + math.pi / self.wheel.teeth

    def tooth_angle(self, gear: int, tooth: Any, pinion_angle: Any, twist: Any) -> Any:
        """Angle (rad) of the frame of a tooth of the pinion (gear 0) or wheel (gear 1); numbers or arrays."""
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
        """Nominal transverse contact ratio eps_alpha (-): path between the tip circles (or form points, when they
        cut it short) over the base pitch; tip rounds and relief do not count."""
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
    def path_length(self) -> float:
        """Length g_alpha of the nominal path of contact (m)."""
        return self.contact_ratio * self.base_pitch

    @cached_property
    def path(self) -> dict[str, PathPoint]:
        """Points A, B, C, D, E of the active path (tip rounds respected, relief not).

        A: start of contact, at the wheel's tip; B = E - p_b: the tooth pair ahead leaves contact; C: pitch point;
        D = A + p_b: the next pair comes into contact; E: end, at the pinion's tip. Between B and D one pair carries
        when 1 <= contact ratio <= 2.
        """
        start, end = self.path_limits()
        pitch_point = self.pinion.base_radius * math.tan(self.working_pressure_angle)
        rolls = {"A": start, "B": end - self.base_pitch, "C": pitch_point, "D": start + self.base_pitch, "E": end}
        return {n: PathPoint(n, s, self.tangent_length - s, self.pinion_angle_at(s)) for n, s in rolls.items()}


@dataclass(frozen=True, repr=False)
class GearPair(MeshGeometry, Shown):
    """Two external spur gears in mesh, checked when made.

    Parameters
    ----------
    pinion, wheel
        The gears; the pinion drives.
    centre_distance
        Centre distance a (m); None: without backlash for the unthinned teeth, from the profile shifts.

    Raises
    ------
    InputError
        For gears that cannot mesh, jam, interfere, or have a contact ratio below 1.
    """

    def __post_init__(self) -> None:
        check_pair(self)

    def facts(self) -> dict[str, str]:
        """Teeth, module, centre distance, contact ratio."""
        return {
            "teeth": f"{self.pinion.teeth}/{self.wheel.teeth}",
            "module": f"{1e3 * self.pinion.module:.6g} mm",
            "centre distance": f"{1e3 * self.working_centre_distance:.6g} mm",
            "working pressure angle": f"{math.degrees(self.working_pressure_angle):.5g} deg",
            "contact ratio": f"{self.contact_ratio:.4g}",
            "backlash": f"{1e3 * self.backlash:.4g} mm",
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is legal but deserves a look, one sentence each."""
        return tuple(pair_warnings(self))

    @classmethod
    def from_table(cls, table: PairTable) -> GearPair:
        """Pair that a job file's [pair] table describes; errors name the file's keys and units."""
        pinion, wheel = _gear_from_table(table, "pinion"), _gear_from_table(table, "wheel")
        distance = table.centre_distance_mm
        try:
            return gear_pair(pinion, wheel, None if distance is None else distance * 1e-3)
        except InputError as error:
            side, _, name = error.field.rpartition(".") if error.field.startswith(("pinion", "wheel")) else ("", "", "")
            raise _renamed(error, table, side, name or error.field) from None


#: Argument of `Gear` or `GearPair` -> its key in a job file and the key's unit in SI.
KEYS: dict[str, tuple[str, float]] = {
    "module": ("module_mm", 1e-3),
    "pressure_angle": ("pressure_angle_deg", math.pi / 180.0),
    "face_width": ("face_width_mm", 1e-3),
    "bore_diameter": ("bore_diameter_mm", 1e-3),
    "tip_round": ("tip_round_mm", 1e-3),
    "tip_relief.amount": ("tip_relief_amount_um", 1e-6),
    "tip_relief.length": ("tip_relief_length_mm", 1e-3),
    "tip_relief.exponent": ("tip_relief_exponent", 1.0),
    "tooth_thinning": ("tooth_thinning_um", 1e-6),
    "centre_distance": ("centre_distance_mm", 1e-3),
}


def gear_pair(pinion: Gear, wheel: Gear, centre_distance: float | None = None) -> GearPair:
    """A checked pair; equal gears at an equal centre distance (m) share one.

    Raises
    ------
    InputError
        For gears that cannot run together.
    """
    if centre_distance is not None and not isinstance(centre_distance, Real):
        return GearPair(pinion, wheel, centre_distance)  # which refuses it
    return _shared_pair(pinion, wheel, centre_distance)


@lru_cache(maxsize=256)
def _shared_pair(pinion: Gear, wheel: Gear, centre_distance: float | None) -> GearPair:
    return GearPair(pinion, wheel, centre_distance)


def _gear_from_table(table: PairTable, side: str) -> Gear:
    own: GearTable = getattr(table, side)
    form = {**table.tooth_form(side), "module_mm": table.module_mm_of(side), "bore_diameter_mm": own.bore_diameter_mm}
    form |= _of_drawing(own, form, f"pair.{side}")
    try:
        return gear_of_form(own.teeth, form)
    except InputError as error:
        raise _renamed(error, table, side, error.field) from None


def _of_drawing(own: GearTable, form: Mapping[str, Any], where: str) -> dict[str, float]:
    """Keys of the tooth form that the drawing values of a gear stand for: tip and root diameters, the span size."""
    module_mm, half, x = form["module_mm"], 0.5 * own.teeth, float(form["profile_shift"])
    made: dict[str, float] = {}
    if own.tip_diameter_mm is not None:
        made |= {"addendum": 0.5 * own.tip_diameter_mm / module_mm - half - x, "tip_shortening": 0.0}
    if own.root_diameter_mm is not None:
        made["dedendum"] = half + x - 0.5 * own.root_diameter_mm / module_mm
    if own.span_mm is not None and own.span_teeth is not None:
        angle = math.radians(form["pressure_angle_deg"])
        most = module_mm * nominal_span(own.teeth, x, angle, own.span_teeth)
        if own.span_mm > most:
            problem = f"must be <= {most:.6g} mm, the span over {own.span_teeth} teeth without backlash"
            raise InputError(f"{where}.span_mm", own.span_mm, problem, "use more profile_shift, or another span_teeth")
        made["tooth_thinning_um"] = 1e3 * (most - own.span_mm) / math.cos(angle)
    return made


def gear_of_form(teeth: int, form: Mapping[str, Any]) -> Gear:
    """Gear with the keys of `gearfe.tables.pair.tooth_form`, ``module_mm`` and ``bore_diameter_mm``."""
    made = dict(form)
    for name, (key, unit) in KEYS.items():
        if made.get(key) is not None:
            made[name] = made.pop(key) * unit
    amount, length, exponent = (made.pop(f"tip_relief.{name}", None) for name in ("amount", "length", "exponent"))
    if amount:
        made["tip_relief"] = TipRelief(amount, given(length, "tip_relief_length_mm"), exponent)
    return Gear(teeth, **{name: made[name] for name in made if name != "tip_relief_length_mm"})


def in_keys(error: InputError, where: str, *, key: str = "", unit: float = 0.0) -> InputError:
    """The error of an argument of `Gear` as that of its key in a table, in the key's unit."""
    named, own = KEYS.get(error.field, (error.field, 1.0))
    value = float(f"{error.value / (unit or own):.12g}") if isinstance(error.value, float) else error.value
    return InputError(f"{where}.{key or named}", value, error.problem, error.cure)


def _of_drawn(error: InputError, table: PairTable, side: str, drawn: str, made: str) -> InputError:
    """The error of a coefficient as that of the drawing value that it was made from, its bound as one of that value."""
    own: GearTable = getattr(table, side)
    field, value = f"pair.{side}.{drawn}", getattr(own, drawn)
    if error.limit is None:
        return InputError(field, value, f"{made}: {error.problem}", error.cure)
    sign, bound, _ = error.limit
    form, module = table.tooth_form(side), table.module_mm_of(side)
    shift = float(form["profile_shift"])
    if drawn != "tip_diameter_mm":  # these fall as the dedendum and the thinning grow
        sign = {"<": ">", ">": "<", ">=": "<="}[sign]
    if drawn == "span_mm":
        angle = math.radians(form["pressure_angle_deg"])
        whole = module * nominal_span(own.teeth, shift, angle, given(own.span_teeth, "span_teeth"))
        limit = whole - 1e-3 * bound * math.cos(angle)
    else:
        limit = module * (own.teeth + 2.0 * shift + 2.0 * (bound if drawn == "tip_diameter_mm" else -bound))
    cure = f"use a {'smaller' if '<' in sign else 'larger'} {drawn}"
    return InputError(field, value, f"{made}: {error.reason}: must be {sign} {limit:.6g} mm", cure)


def _renamed(error: InputError, table: PairTable, side: str, name: str) -> InputError:
    """The same error in the words of the job file: its key where it was given, its unit."""
    error = InputError(name, error.value, error.reason, error.cure, error.limit)
    key, unit = KEYS.get(name, (name, 1.0))
    if not side:
        return in_keys(error, "pair")
    own: GearTable = getattr(table, side)
    for drawn, stands_for in INSTEAD.items():
        if key in stands_for and getattr(own, drawn) is not None:
            number = error.value / unit if isinstance(error.value, float) else error.value
            return _of_drawn(error, table, side, drawn, f"makes {key} {number:.6g}")
    if name == "module" and own.pitch_diameter_mm is not None:
        return in_keys(error, f"pair.{side}", key="pitch_diameter_mm", unit=1e-3 / own.teeth)
    shared = getattr(own, key, None) is None and getattr(table, key, None) is not None
    return in_keys(error, "pair" if shared else f"pair.{side}")
