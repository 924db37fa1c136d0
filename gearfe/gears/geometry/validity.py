"""What pairs are meant for: what lies beyond is refused, loads beyond it are flagged. `spur_gear` checks single gears.

- *Pair*: gears with a contact ratio of at least 1, for helical gears the total one. Rolling the pair shows whether tips
  enter the material of the mate.
- *Overlap* r_b times twist, by which rigid flanks would overlap along the line of action: up to 0.12 modules. That is
  how far the contact laws were held against each other (0.5 deg of twist of the 20/30 pair, docs/contact_laws.md). Each
  tooth, 2.25 modules high and 1.8 thick at its root, then yields by d = 0.06 modules: as a cantilever it has the strain
  3 t d/(2 h^2), 3 %, there. Steel would not bear it, and linear elasticity is a first order of it. A torque that makes
  twice that by the standard's stiffness is refused.
- *Width of contacts* of internal pairs: a half width of up to 0.1 of the smaller radius of curvature. A half-plane's
  surface is straight: what a contact of the half width b on a cylinder of the radius R has besides is of the order of
  (b/R)^2 (Johnson, *Contact Mechanics*, 1985, sec. 5.3). Nearly conforming flanks reach it at loads that teeth bear.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from .curves import bisect, inv, inverse_inv
from .gear_data import rounding
from .involute import largest_rack_tip_radius, least_shift
from .mesh_geometry import MeshGeometry
from .ring import CLEAR, radial_clearance, ring_depths, to_line
from .spur_gear import LEAST_ROUND, Gear

#: Largest overlap, times module.
MOST_OVERLAP = 0.12
#: Largest half width of a contact of an internal pair, times the smaller radius of curvature.
CONFORMING = 0.1
#: Largest yield of a tooth pair (modules) by the standard's stiffness under a given torque.
MOST_YIELD = 0.25
#: Penetrations below this many modules are taken for the discretisation of the outlines.
TOLERANCE = 1e-4
#: Least transverse contact ratio of a helical pair (-), whatever its overlap ratio: tips must reach each other.
LEAST_PATH = 0.1
#: Rotations through the engagement of one tooth at which tips are looked at.
POSITIONS = 241


def check_seat(pair: MeshGeometry) -> float:
    """Return the jam (m) on the line of action that rounding leaves: how much too near to each other the axes are.

    Raises
    ------
    InputError
        For gears of different modules or pressure angles, and a centre distance that is impossible or jams the teeth.
    """
    pinion, wheel = pair.pinion, pair.wheel
    if pinion.internal:
        problem = "is an internal gear, which is the wheel of a pair here"
        cure = "swap the gears: roles are names, and either gear may drive"
        raise InputError("pinion.teeth", pinion.teeth, problem, cure)
    if pair.internal and wheel.tooth_count <= pinion.teeth:
        problem = f"leaves no room for the {pinion.teeth} teeth of the pinion inside"
        raise InputError("wheel.teeth", wheel.teeth, problem, "use more teeth", ("<", -float(pinion.teeth), ""))
    degrees = 180.0 / math.pi
    for name, what, unit in (
        ("module", "module", 1e3),
        ("pressure_angle", "pressure angle", degrees),
        ("helix_angle", "helix angle", degrees),
    ):
        value, other = getattr(wheel, name), getattr(pinion, name)
        if abs(value - other) > 1e-9 * abs(other):
            symbol = "mm" if name == "module" else "deg"
            both = f"{unit * value:.9g} {symbol} and {unit * other:.9g} {symbol} (pinion)"
            problem = f"gears that differ in {what}, {both}, do not mesh"
            limit = ("equal to", unit * other, symbol)
            raise InputError(f"wheel.{name}", value, problem, f"give both the same {what}", limit)
    if pinion.helical and (pinion.hand == wheel.hand) != pair.internal:
        problem = "is the hand of both helices: that of external gears in mesh is opposite"
        if pair.internal:
            problem = f"is not the hand of the pinion ({pinion.hand}): an internal gear has that of its mate"
        raise InputError("wheel.hand", wheel.hand, problem, "give the other hand to one of them")
    if not pair.common_width > 0.0:
        most = 0.5e3 * (pinion.face_width + wheel.face_width)
        problem = f"leaves no common face width: the middles must be less than {most:.6g} mm apart"
        raise InputError("axial_offset", pair.axial_offset, problem, "move the gears towards each other")
    return _check_distance(pair)


def check_spur(pair: MeshGeometry, what: str) -> None:
    """Raise `InputError` for helical gears; `what` names the computation that takes spur gears only."""
    if pair.pinion.helical:
        problem = f"is of a helical gear: {what} takes spur gears only"
        raise InputError("pinion.helix_angle", pair.pinion.helix_angle, problem, "use gears without helix angle")
    smaller = min(pair.pinion.face_width, pair.wheel.face_width)
    if pair.common_width < smaller * (1.0 - 1e-9):
        problem = f"leaves {1e3 * pair.common_width:.4g} mm in common: {what} needs all of the smaller face width"
        cure = "leave it out, or use gearfe.gears.width, which takes the common width"
        raise InputError("axial_offset", getattr(pair, "axial_offset", None), problem, cure)


def check_pair(pair: MeshGeometry) -> None:
    """Raise `InputError` for gears that cannot run together; `check_seat` comes first."""
    pinion, wheel = pair.pinion, pair.wheel
    for name, gear, mate in (("pinion", pinion, wheel), ("wheel", wheel, pinion)):
        # of external gears compared as sums: the printed bound is tested to the last bit
        clearance, off = tip_clearance(pair, gear, mate), rounding(gear.module)
        sums = gear.tip_radius + mate.root_radius, pair.working_centre_distance + off
        if (clearance <= -off) if pair.internal else (sums[0] >= sums[1]):
            room = clearance / gear.module
            problem, limit = "makes the tip circle hit the mate's root circle", ("<", gear.addendum + room, "")
            cure = "use more tip_shortening, less addendum, more dedendum or more centre distance"
            raise InputError(f"{name}.addendum", gear.addendum, problem, cure, limit)
    _check_ratio(pair)
    for name, mate_name in (("pinion", "wheel"), ("wheel", "pinion")):
        _check_interference(pair, name, mate_name)


def tip_clearance(pair: MeshGeometry, gear: Gear, mate: Gear) -> float:
    """Tip clearance c (m) between the tip circle of a gear of the pair and its mate's root circle."""
    a = pair.working_centre_distance
    if not pair.internal:
        return a - mate.root_radius - gear.tip_radius
    return mate.root_radius - gear.tip_radius - a if mate.internal else gear.tip_radius - mate.root_radius - a


def _check_distance(pair: MeshGeometry) -> float:
    """Raise `InputError` for an impossible centre distance; return the jam (m) that rounding leaves."""
    pinion, wheel = pair.pinion, pair.wheel
    sign = pair.sign
    alpha, lowest = pinion.transverse_pressure_angle, sign * pinion.base_radius + wheel.base_radius
    if pair.centre_distance is None:
        shift = pinion.profile_shift + wheel.profile_shift
        least = -0.5 * (pinion.teeth + wheel.teeth) * inv(alpha) / math.tan(pinion.pressure_angle)
        if sign * shift <= sign * least:
            way, size = ("<", "smaller") if pair.internal else (">", "larger")
            limit = (way, least - wheel.profile_shift, "")
            problem, cure = (
                f"leaves no working pressure angle (sum of both: {way} {least:.6g})",
                f"use {size} profile shifts",
            )
            raise InputError("pinion.profile_shift", pinion.profile_shift, problem, cure, limit)
        return 0.0
    a = pair.centre_distance
    if isinstance(a, bool) or not isinstance(a, Real) or not math.isfinite(a) or a <= lowest:
        problem = f"leaves no working pressure angle: must be finite and > {1e3 * lowest:.9g} mm"
        raise InputError("centre_distance", a, problem, "use a larger centre distance, or leave it out")
    if pair.base_backlash < 0.0:
        rolled = pinion.base_radius * pinion.base_angle + wheel.signed_base_radius * wheel.base_angle
        tight = lowest / math.cos(inverse_inv((rolled - pair.base_pitch / 2) / (sign * lowest)))
        if sign * (tight - a) <= rounding(pinion.module):
            return -pair.base_backlash
        way, size = ("<=", "smaller") if pair.internal else (">=", "larger")
        problem = f"jams the teeth (backlash {1e3 * pair.backlash:.6g} mm): must be {way} {1e3 * tight:.12g} mm"
        cure = f"use a {size} centre distance, less profile shift or more tooth thinning, or leave it out"
        raise InputError("centre_distance", a, problem, cure)
    return 0.0


def _tips_ratio(pair: MeshGeometry, *, rounded: bool) -> float:
    """Contact ratio between the tips alone, as if no flank were undercut."""
    rolls = [
        (g.profile.round_roll if rounded and g.tip_round > 0.0 else g.profile.tip_roll)
        for g in (pair.pinion, pair.wheel)
    ]
    return (sum(rolls) - pair.tangent_length) / pair.base_pitch


def missing_addendum(pair: MeshGeometry, names: Sequence[str]) -> float:
    """Return by how much (times module) the addenda of named gears must grow for the least contact ratio of tips."""

    def ratio(more: float) -> float:
        gears = ((getattr(pair, name), more if name in names else 0.0) for name in ("pinion", "wheel"))
        rolls = sum(gear.roll_length(gear.tip_radius + gear.sign * add * gear.module) for gear, add in gears)
        return (rolls - pair.tangent_length) / pair.base_pitch - least

    least = least_ratio(pair)
    return bisect(ratio, 0.0, abs(pair.tangent_length) / pair.pinion.module)


def least_ratio(pair: MeshGeometry) -> float:
    """Least transverse contact ratio (-) that hands over from tooth to tooth: 1 less the overlap ratio."""
    return max(1.0 - pair.overlap_ratio, LEAST_PATH)


def _check_ratio(pair: MeshGeometry) -> None:
    nominal, active, least = _tips_ratio(pair, rounded=False), pair.contact_ratio_active, least_ratio(pair)
    short = f"{least:.4g}"
    if pair.pinion.helical:
        short += f" (with an overlap ratio of {pair.overlap_ratio:.4g})"
    if nominal < least:
        gear: Gear
        problem, cure = f"gives a contact ratio of {nominal:.4g} < {short}", "use less tip_shortening, or more teeth"
        # the distance of the points of tangency that leaves the least path between the tips
        tangent = pair.tangent_length - (least - nominal) * pair.base_pitch
        if pair.internal and pair.centre_distance is not None and pair.backlash > 1e-3 * pair.base_pitch:
            lowest = pair.wheel.base_radius - pair.pinion.base_radius
            limit = (">=", 1e3 * math.hypot(tangent, lowest), "mm")
            raise InputError("centre_distance", pair.centre_distance, problem, "use a larger centre distance", limit)
        if pair.centre_distance is not None and pair.backlash > 1e-3 * pair.base_pitch and tangent > 0.0:
            most = math.hypot(tangent, pair.pinion.base_radius + pair.wheel.base_radius)
            cure = "use a smaller centre distance"
            raise InputError("centre_distance", pair.centre_distance, problem, cure, ("<=", 1e3 * most, "mm"))
        name = min(("pinion", "wheel"), key=lambda name: getattr(pair, name).addendum)
        if pair.internal:  # the ring's tips end at its base circle, whatever its addendum
            name = "pinion"
        gear = getattr(pair, name)
        limit = (">=", gear.addendum + missing_addendum(pair, (name,)), "")
        raise InputError(f"{name}.addendum", gear.addendum, problem, cure, limit)
    if active >= least:
        return
    rounded = _tips_ratio(pair, rounded=True)
    if rounded < least:
        name = "pinion" if pair.pinion.tip_round >= pair.wheel.tip_round else "wheel"
        gear = getattr(pair, name)
        problem, cure = f"leaves a contact ratio of {rounded:.4g} < {short}", "use a smaller tip round"
        largest = _largest_round(gear, gear.profile.round_roll + (least - rounded) * pair.base_pitch)
        raise InputError(f"{name}.tip_round", gear.tip_round, problem, cure, largest)
    cuts = {name: lost for name, lost in _lost_to_form_points(pair).items() if lost > 0.0}
    name = max(cuts, key=cuts.__getitem__)
    gear = getattr(pair, name)
    if pair.internal and not gear.undercut:
        _check_interference(pair, name, "wheel" if name == "pinion" else "pinion")
    problem = f"leaves an undercut root that eats the path of contact: contact ratio {active:.4g}, must be >= {short}"
    cure = f"use more profile shift (no undercut from {least_shift(gear):.4g} on), more teeth or less dedendum"
    raise InputError(f"{name}.profile_shift", gear.profile_shift, problem, cure)


def _largest_round(gear: Gear, roll: float) -> tuple[str, float, str] | None:
    """Limit of a tip round that begins at a roll length (m) or farther out; None where no round does."""
    least, most = LEAST_ROUND * gear.module, gear.tip_round
    if replace(gear, tip_round=least).profile.round_roll < roll:
        return None
    while most - least > 1e-9 * gear.module:
        middle = 0.5 * (least + most)
        least, most = (middle, most) if replace(gear, tip_round=middle).profile.round_roll >= roll else (least, middle)
    return ("<=", 1e3 * least, "mm")


def _lost_to_form_points(pair: MeshGeometry) -> dict[str, float]:
    """Length (m) of path that the mate's active tip reaches below each gear's form point; <= 0 when there is none."""

    def lost(gear: Gear, mate: Gear) -> float:
        tip = min(mate.profile.round_roll, mate.profile.tip_roll)
        return gear.form_roll - (pair.tangent_length - tip)

    return {"pinion": lost(pair.pinion, pair.wheel), "wheel": lost(pair.wheel, pair.pinion)}


def _check_interference(pair: MeshGeometry, name: str, mate_name: str) -> None:
    gear, mate = getattr(pair, name), getattr(pair, mate_name)
    cure = "use less addendum or more tip_shortening there, more dedendum or a smaller rack_tip_radius here"
    lost = _lost_to_form_points(pair)[name]
    if lost > rounding(gear.module) and not gear.undercut:
        allowed = math.hypot(mate.base_radius, pair.tangent_length - gear.form_roll)
        most = mate.addendum - mate.sign * (mate.tip_radius - allowed) / mate.module
        problem = (
            f"makes the tip reach {1e3 * lost:.4g} mm of roll length below the start of the {name}'s involute "
            f"(form diameter {2e3 * gear.form_radius:.6g} mm), where the root is no involute"
        )
        raise InputError(f"{mate_name}.addendum", mate.addendum, problem, cure, ("<", most, ""))
    depth = _tip_depth(pair, gear, mate)
    if depth > _allowed_depth(gear):
        problem = f"makes the tip cut {1e3 * depth:.4g} mm into the {name}'s root"
        if pair.internal:
            problem = f"makes the teeth cut {1e3 * depth:.4g} mm into those of the {name} beside the path of contact"
            cure = "use less addendum or more tip_shortening, a larger difference of the numbers of teeth"
        raise InputError(f"{mate_name}.addendum", mate.addendum, problem, cure, _largest_addendum(pair, gear, mate))


def _allowed_depth(gear: Gear) -> float:
    """Depth (m) of tips in a root that is taken for rounding and for the discretisation of the outlines."""
    return rounding(gear.module) + TOLERANCE * gear.module


def _tip_depth(pair: MeshGeometry, gear: Gear, mate: Gear) -> float:
    """Largest depth (m) by which tips of a mate enter a gear of the pair."""
    if pair.internal:
        ring, pinion = (gear, mate) if gear.internal else (mate, gear)
        depths = ring_depths(pinion, ring, pair.working_centre_distance, 0.5 * pair.base_backlash / ring.base_radius)
        return depths.ring if mate.internal else depths.pinion
    return tip_penetration(gear, mate, pair.working_centre_distance, 0.5 * pair.base_backlash / mate.base_radius)


def _largest_addendum(pair: MeshGeometry, gear: Gear, mate: Gear) -> tuple[str, float, str] | None:
    """Limit of a mate's addendum up to which its tips do not cut into a gear; None where they do with any."""

    def cuts(addendum: float) -> bool:
        try:
            shorter = replace(mate, addendum=addendum)
        except InputError:  # the tip round or relief does not fit
            shorter = replace(mate, addendum=addendum, tip_round=0.0, tip_relief=None)
        return _tip_depth(pair, gear, shorter) > _allowed_depth(gear)

    most = mate.addendum
    least = max(_addendum_at(mate, math.hypot(mate.base_radius, mate.form_roll)), 0.0) + 1e-3
    if least >= most or cuts(least):
        return None
    while most - least > 1e-5:
        middle = 0.5 * (least + most)
        least, most = (least, middle) if cuts(middle) else (middle, most)
    return ("<", least, "")


def _addendum_at(gear: Gear, radius: float) -> float:
    """Addendum (times module) that has its tip circle at a radius (m)."""
    return gear.addendum + gear.sign * (radius - gear.tip_radius) / gear.module


def tip_penetration(gear: Gear, mate: Gear, centre_distance: float, twist: float) -> float:
    """Return the largest depth by which tips of a mate enter a gear while the pair rolls.

    The left flanks are in contact. The mate's outline from the middle of its addendum outwards is followed through the
    space of the gear. In the gear's frame the outline of its tooth is a single-valued polar angle over the radius,
    which separates inside from outside. The depth of a point inside is its distance to that outline.

    Parameters
    ----------
    gear : Gear
        The gear.
    mate : Gear
        The gear whose tips are followed.
    centre_distance
        Distance (m) between the axes; the gear is at the origin, the mate on +x.
    twist
        Turn (rad) of the mate that closes the backlash on the left flanks.

    Returns
    -------
    depth : float
        In m.
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
            deepest = max(deepest, float(to_line(part, outline).max()))
    return deepest


def _outline(gear: Gear) -> Array:
    """Left half profile as complex numbers with growing radius."""
    t = np.linspace(0.0, 1.0, 401)
    made = np.concatenate([s.curve.point(t) for s in gear.profile.segments if s.name != "tip"])
    radius = np.abs(made)
    return made[np.concatenate([[True], np.diff(np.maximum.accumulate(radius)) > 0.0])]


def _tip_outline(gear: Gear) -> Array:
    """Both sides of a tooth from half the roll length above the form point outwards, as complex numbers."""
    profile = gear.profile
    t = np.linspace(0.0, 1.0, 17)
    pieces = [profile.flank.point(0.5 * (1 + t))]
    pieces += [s.curve.point(t) for s in profile.segments if s.name in ("tip_round", "tip")]
    made = np.concatenate(pieces)
    return np.concatenate([made, np.conj(made)])


def rounding_notes(pair: MeshGeometry) -> list[str]:
    """Return how the data of gears were taken where they fit each other except for rounding, one sentence each."""
    notes = []
    for name, gear, mate in (("pinion", pair.pinion, pair.wheel), ("wheel", pair.wheel, pair.pinion)):
        largest = math.inf if gear.internal else largest_rack_tip_radius(gear)
        if gear.rack_tip_radius > largest * (1.0 + 1e-12):
            notes.append(
                f"rack_tip_radius {gear.rack_tip_radius:g} of the {name} exceeds a full fillet by rounding: "
                f"{largest:.6g} is taken"
            )
        room = tip_clearance(pair, gear, mate)
        if room <= 0.0:
            notes.append(
                f"the tip clearance of the {name} is {1e6 * room:.3g} um, 0 except for rounding: tips that touch the "
                "root circle are taken to carry nothing"
            )
    for name, lost in _lost_to_form_points(pair).items():
        if lost > 1e-7 * pair.pinion.module and not getattr(pair, name).undercut:
            notes.append(
                f"the mate's tip reaches {1e6 * lost:.3g} um of roll length below the start of the {name}'s involute, "
                "by rounding: the path of contact ends at that start"
            )
    return notes


def pair_warnings(pair: MeshGeometry) -> list[str]:
    """What is legal but deserves a look, one sentence each."""
    said = []
    for name, lost in _lost_to_form_points(pair).items():
        gear: Gear = getattr(pair, name)
        if not gear.undercut:
            continue
        if lost > 0.0:
            said.append(
                f"the {name} is undercut and loses {1e3 * lost:.4g} mm of the path of contact: contact ratio "
                f"{pair.contact_ratio_active:.4g} instead of {_tips_ratio(pair, rounded=True):.4g}"
            )
        else:
            said.append(f"the {name} is undercut below its active flank; the path of contact is whole")
    if pair.internal:
        said += ring_warnings(pair)
    if pair.contact_ratio_effective < least_ratio(pair):
        said.append(
            f"tip relief leaves a contact ratio of {pair.contact_ratio_effective:.4g} on the unrelieved flanks: "
            "unloaded, the teeth hand over on the relieved part"
        )
    return said


def ring_warnings(pair: MeshGeometry) -> list[str]:
    """What is said of the assembly of an internal pair and of the cutter of its ring, one sentence each."""
    said, ring = [], pair.wheel
    clearance = radial_clearance(pair.pinion, ring, pair.working_centre_distance)
    if clearance < -CLEAR * ring.module:
        said.append(
            f"the pinion cannot be moved into the internal gear radially, tips overlap by {-1e3 * clearance:.4g} mm: "
            "assemble along the axis"
        )
    return said


def overlaps(pair: MeshGeometry, twist: ArrayLike) -> Array:
    """Overlaps (modules) of the rigid flanks at twists (rad) from where they touch."""
    return np.asarray(twist, dtype=float) * pair.wheel.base_radius / pair.pinion.module


def overlap_warnings(pair: MeshGeometry, twist: Array, beyond: IntArray) -> list[str]:
    """What is said of the positions flagged as beyond validity, at twists (rad) from where flanks touch."""
    found = overlaps(pair, twist[beyond == 1])
    if pair.internal and (near := np.count_nonzero(found <= MOST_OVERLAP)):
        found = found[found > MOST_OVERLAP]
        said = (
            f"{near} positions are beyond validity (column beyond_validity): contacts are wider than {CONFORMING:g} of "
            "the smaller radius of curvature on either side, where flanks conform and half-planes do not hold; use "
            "less load, or a contact law on elements"
        )
        return [said, *(overlap_warnings(pair, twist, beyond * (overlaps(pair, twist) > MOST_OVERLAP)))]
    if not found.size:
        return []
    reason = (
        f"the flanks overlap by up to {found.max():.3g} modules, beyond the {MOST_OVERLAP:g} that the laws hold for"
    )
    return [f"{found.size} positions are beyond validity (column beyond_validity): {reason}; use less load"]
