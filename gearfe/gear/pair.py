"""Gear pairs: two spur gears, checked to run together. The front door of the geometry; SI units and radians.

`Gear` and `TipRelief` describe one gear (`gearfe.gear.spur_gear`), `GearPair` two in mesh: its quantities are those of
`gearfe.gear.mesh_geometry.MeshGeometry`, which also states the convention of angles and flanks.

Can two gears run together? Errors for those that cannot, warnings for those that barely do. Whether tips enter the
material of the mate is answered by rolling the pair.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from ..errors import InputError, given
from ..shown import Shown
from ..tables.pair import INSTEAD, GearTable, PairTable
from ..typing import Array
from .involute import inv, inverse_inv, least_shift
from .mesh_geometry import MeshGeometry, PathPoint
from .spur_gear import Gear, TipRelief, nominal_span

__all__ = ["Gear", "GearPair", "PathPoint", "TipRelief"]


def check_pair(pair: MeshGeometry) -> None:
    """Raise `InputError` for gears that cannot run together."""
    pinion, wheel = pair.pinion, pair.wheel
    for name, what, unit in (("module", "module", 1e3), ("pressure_angle", "pressure angle", 180.0 / math.pi)):
        value, other = getattr(wheel, name), getattr(pinion, name)
        if abs(value - other) > 1e-9 * abs(other):
            symbol = "mm" if name == "module" else "deg"
            both = f"{unit * value:.9g} {symbol} and {unit * other:.9g} {symbol} (pinion)"
            problem = f"gears that differ in {what}, {both}, do not mesh"
            raise InputError(f"wheel.{name}", value, problem, f"give both the same {what}")
    _check_distance(pair)
    a = pair.working_centre_distance
    for name, gear, mate in (("pinion", pinion, wheel), ("wheel", wheel, pinion)):
        if gear.tip_radius + mate.root_radius >= a:
            room = (a - mate.root_radius - gear.reference_radius) / gear.module
            problem = "makes the tip circle hit the mate's root circle: addendum + profile_shift - tip_shortening must"
            cure = "use more tip_shortening, less addendum, more dedendum or more centre distance"
            raise InputError(f"{name}.addendum", gear.addendum, f"{problem} be < {room:.6g}", cure)
    _check_ratio(pair)
    for name, gear, mate, own in (("pinion", pinion, wheel, "wheel"), ("wheel", wheel, pinion, "pinion")):
        _check_interference(pair, name, gear, mate, own)


def _check_distance(pair: MeshGeometry) -> None:
    pinion, wheel = pair.pinion, pair.wheel
    alpha, a0 = pinion.pressure_angle, pair.reference_centre_distance
    free = pinion.base_radius + wheel.base_radius
    involute = (
        pinion.base_radius * pinion.base_angle + wheel.base_radius * wheel.base_angle - pair.base_pitch / 2
    ) / free
    if pair.centre_distance is None:
        shift = pinion.profile_shift + wheel.profile_shift
        least = -0.5 * (pinion.teeth + wheel.teeth) * inv(alpha) / math.tan(alpha)
        if shift <= least:
            problem = f"leaves no working pressure angle: the sum of both profile shifts must be > {least:.6g}"
            raise InputError("pinion.profile_shift", pinion.profile_shift, problem, "use larger profile shifts")
        return
    a = pair.centre_distance
    lowest = a0 * math.cos(alpha)
    if isinstance(a, bool) or not isinstance(a, Real) or not math.isfinite(a) or a <= lowest:
        problem = f"leaves no working pressure angle: must be finite and > {1e3 * lowest:.9g} mm"
        raise InputError("centre_distance", a, problem, "use a larger centre distance, or leave it out")
    if pair.normal_backlash < 0.0:
        tight = lowest / math.cos(inverse_inv(involute))
        problem = f"jams the teeth (backlash {1e3 * pair.backlash:.6g} mm): must be >= {1e3 * tight:.12g} mm"
        cure = "use a larger centre distance, less profile shift or more tooth thinning, or leave it out"
        raise InputError("centre_distance", a, problem, cure)


def _tips_ratio(pair: MeshGeometry, *, rounded: bool) -> float:
    """Contact ratio between the tips alone, as if no flank were undercut."""
    rolls = [
        (g.profile.round_roll if rounded and g.tip_round > 0.0 else g.profile.tip_roll)
        for g in (pair.pinion, pair.wheel)
    ]
    return (sum(rolls) - pair.tangent_length) / pair.base_pitch


def _check_ratio(pair: MeshGeometry) -> None:
    nominal, active = _tips_ratio(pair, rounded=False), pair.contact_ratio_active
    if nominal < 1.0:
        problem = f"gives a contact ratio of {nominal:.4g}, must be >= 1"
        if pair.centre_distance is not None and pair.backlash > 1e-3 * pair.base_pitch:
            raise InputError("centre_distance", pair.centre_distance, problem, "use a smaller centre distance")
        cure = "use more addendum, less tip_shortening, more teeth or a smaller pressure angle"
        raise InputError("pinion.addendum", pair.pinion.addendum, problem, cure)
    if active >= 1.0:
        return
    rounded = _tips_ratio(pair, rounded=True)
    if rounded < 1.0:
        name = "pinion" if pair.pinion.tip_round >= pair.wheel.tip_round else "wheel"
        problem = f"leaves a contact ratio of {rounded:.4g}, must be >= 1"
        raise InputError(f"{name}.tip_round", getattr(pair, name).tip_round, problem, "use a smaller tip round")
    cuts = {name: lost for name, lost in _lost_to_form_points(pair).items() if lost > 0.0}
    name = max(cuts, key=cuts.__getitem__)
    gear: Gear = getattr(pair, name)
    problem = f"leaves an undercut root that eats the path of contact: contact ratio {active:.4g}, must be >= 1"
    cure = f"use more profile shift (no undercut from {least_shift(gear):.4g} on), more teeth or less dedendum"
    raise InputError(f"{name}.profile_shift", gear.profile_shift, problem, cure)


def _lost_to_form_points(pair: MeshGeometry) -> dict[str, float]:
    """Length (m) of path that the mate's active tip reaches below each gear's form point; <= 0 when there is none."""

    def lost(gear: Gear, mate: Gear) -> float:
        tip = min(mate.profile.round_roll, mate.profile.tip_roll)
        return gear.form_roll - (pair.tangent_length - tip)

    return {"pinion": lost(pair.pinion, pair.wheel), "wheel": lost(pair.wheel, pair.pinion)}


def _check_interference(pair: MeshGeometry, name: str, gear: Gear, mate: Gear, mate_name: str) -> None:
    cure = "use less addendum or more tip_shortening there, more dedendum or a smaller rack_tip_radius here"
    lost = _lost_to_form_points(pair)[name]
    if lost > 1e-7 * gear.module and not gear.undercut:
        allowed = math.hypot(mate.base_radius, pair.tangent_length - gear.form_roll)
        most = mate.addendum - (mate.tip_radius - allowed) / mate.module
        problem = (
            f"makes the tip reach {1e3 * lost:.4g} mm of roll length below the start of the {name}'s involute "
            f"(form diameter {2e3 * gear.form_radius:.6g} mm), where the root is no involute: must be < {most:.5g}"
        )
        raise InputError(f"{mate_name}.addendum", mate.addendum, problem, cure)
    depth = tip_penetration(gear, mate, pair.working_centre_distance, 0.5 * pair.normal_backlash / mate.base_radius)
    if depth > TOLERANCE * gear.module:
        problem = f"makes the tip cut {1e3 * depth:.4g} mm into the {name}'s root"
        raise InputError(f"{mate_name}.addendum", mate.addendum, problem, cure)


#: Penetrations below this many modules are taken for the discretisation of the outlines.
TOLERANCE = 1e-4
#: Rotations through the engagement of one tooth at which tips are looked at.
POSITIONS = 241


def tip_penetration(gear: Gear, mate: Gear, centre_distance: float, twist: float) -> float:
    """Largest depth (m) by which tips of `mate` enter `gear` while the pair rolls with its left flanks in contact.

    The mate's outline from the middle of its addendum outwards is followed through the space of the gear. In the
    gear's frame the outline of its tooth is a single-valued polar angle over the radius, which separates inside from
    outside; the depth of a point inside is its distance to that outline.

    Parameters
    ----------
    centre_distance
        Distance (m) between the axes; the gear is at the origin, the mate on +x.
    twist
        Turn (rad) of the mate that closes the backlash on the left flanks.
    """
    outline, tip = _outline(gear), _tip_outline(mate)
    reach = (centre_distance**2 + mate.tip_radius**2 - gear.tip_radius**2) / (2.0 * centre_distance * mate.tip_radius)
    if reach >= 1.0:
        return 0.0
    widest = math.acos(max(reach, 0.0)) + mate.profile.tip_half_angle
    swing = np.linspace(-widest, widest, POSITIONS)
    gear_angle = -(swing - math.pi / mate.teeth - twist) * mate.teeth / gear.teeth
    turn = np.exp(1j * (math.pi + swing))[:, None]
    placed = (centre_distance + turn * tip) * np.exp(-1j * gear_angle)[:, None]
    radius, angle = np.abs(placed), np.angle(placed)
    pitch = 2.0 * math.pi / gear.teeth
    angle = np.abs(angle - pitch * np.round(angle / pitch))
    inside = angle < np.interp(radius, np.abs(outline), np.angle(outline), left=math.inf, right=-math.inf)
    suspects = (radius * np.exp(1j * angle))[inside]
    deepest = 0.0
    for part in np.array_split(suspects, 1 + suspects.size // 2000):
        if part.size:
            deepest = max(deepest, float(_distance(part, outline).max()))
    return deepest


def _distance(points: Array, outline: Array) -> Array:
    """Distance of complex points to the chords next to the nearest vertex of a complex polyline."""
    nearest = np.abs(points[:, None] - outline).argmin(axis=1)
    best = np.abs(points - outline[nearest])
    for step in (-1, 0):
        first = np.clip(nearest + step, 0, len(outline) - 2)
        start, chord = outline[first], outline[first + 1] - outline[first]
        along = np.clip(np.real((points - start) * np.conj(chord)) / np.abs(chord) ** 2, 0.0, 1.0)
        best = np.minimum(best, np.abs(points - start - along * chord))
    return best


def _outline(gear: Gear) -> Array:
    """Left half profile as complex numbers with growing radius."""
    t = np.linspace(0.0, 1.0, 401)
    pieces = [s.points(t) for s in gear.profile.segments if s.name != "tip"]
    points = np.concatenate(pieces)
    made = points[:, 0] + 1j * points[:, 1]
    radius = np.abs(made)
    return made[np.concatenate([[True], np.diff(np.maximum.accumulate(radius)) > 0.0])]


def _tip_outline(gear: Gear) -> Array:
    """Both sides of a tooth from half the roll length above the form point outwards, as complex numbers."""
    profile = gear.profile
    t = np.linspace(0.0, 1.0, 17)
    pieces = [profile.points_of_roll(0.5 * (profile.form_roll + profile.round_roll) * (1 - t) + profile.round_roll * t)]
    pieces += [s.points(t) for s in profile.segments if s.name in ("tip_round", "tip")]
    left = np.concatenate(pieces)
    made = left[:, 0] + 1j * left[:, 1]
    return np.concatenate([made, np.conj(made)])


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
        said = []
        for name, lost in _lost_to_form_points(self).items():
            gear: Gear = getattr(self, name)
            if not gear.undercut:
                continue
            if lost > 0.0:
                said.append(
                    f"the {name} is undercut and loses {1e3 * lost:.4g} mm of the path of contact: contact ratio "
                    f"{self.contact_ratio_active:.4g} instead of {_tips_ratio(self, rounded=True):.4g}"
                )
            else:
                said.append(f"the {name} is undercut below its active flank; the path of contact is whole")
        if self.contact_ratio_effective < 1.0:
            said.append(
                f"tip relief leaves a contact ratio of {self.contact_ratio_effective:.4g} on the unrelieved flanks: "
                "unloaded, the teeth hand over on the relieved part"
            )
        return tuple(said)

    @classmethod
    def from_table(cls, table: PairTable) -> GearPair:
        """Pair that a job file's [pair] table describes; errors name the file's keys and units."""
        pinion, wheel = _gear_from_table(table, "pinion"), _gear_from_table(table, "wheel")
        distance = table.centre_distance_mm
        try:
            return cls(pinion, wheel, None if distance is None else distance * 1e-3)
        except InputError as error:
            side, _, name = error.field.rpartition(".") if error.field.startswith(("pinion", "wheel")) else ("", "", "")
            raise _renamed(error, table, side, name or error.field) from None


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


def _renamed(error: InputError, table: PairTable, side: str, name: str) -> InputError:
    """The same error in the words of the job file: its key where it was given, its unit."""
    error = InputError(name, error.value, error.problem, error.cure)
    key, unit = KEYS.get(name, (name, 1.0))
    if not side:
        return in_keys(error, "pair")
    own: GearTable = getattr(table, side)
    for drawn, stands_for in INSTEAD.items():
        if key in stands_for and getattr(own, drawn) is not None:
            number = error.value / unit if isinstance(error.value, float) else error.value
            problem = f"makes {key} {number:.6g}: {error.problem}"
            return InputError(f"pair.{side}.{drawn}", getattr(own, drawn), problem, error.cure)
    if name == "module" and own.pitch_diameter_mm is not None:
        return in_keys(error, f"pair.{side}", key="pitch_diameter_mm", unit=1e-3 / own.teeth)
    shared = getattr(own, key, None) is None and getattr(table, key, None) is not None
    return in_keys(error, "pair" if shared else f"pair.{side}")
