"""Gear pairs that run together, and the pair of a job file; `geometry.mesh_geometry` says how they stand and turn.

SI units and radians. Whether two gears can run together is checked by `gearfe.gears.geometry.validity`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from numbers import Real
from typing import Any

import numpy as np

from ...base.errors import InputError, given
from ...base.shown import Shown
from ...base.tables.gearbox import NamedGear, NamedMesh, pair_gearbox, shift_by_distance
from ...base.tables.pair import FROM_DISTANCE, RING_KEYS, PairTable, transverse_teeth
from .gear_data import TipRelief, Web, nominal_span, rounding
from .mesh_geometry import MeshGeometry, PathPoint
from .spur_gear import Gear
from .validity import check_pair, check_seat, missing_addendum, pair_warnings, rounding_notes

__all__ = ["Gear", "GearPair", "MeshGeometry", "PathPoint", "TipRelief"]


@dataclass(frozen=True, repr=False)
class GearPair(MeshGeometry, Shown):
    """Two spur or helical gears in mesh, checked when made.

    Parameters
    ----------
    pinion, wheel
        The gears; the pinion drives, and the wheel may be an internal gear.
    axial_offset
        Middle of the wheel's face width less that of the pinion's, along the axes (m).
    centre_distance
        Centre distance |a| (m); None: from the profile shifts, without backlash of unthinned teeth. One that is too
        small only by rounding (`gear_data.rounding`) makes the wheel's teeth thinner by that.
    notes
        How given data were taken that fit each other except for rounding, one sentence each.

    Raises
    ------
    InputError
        For gears that cannot mesh, jam, interfere, or have a contact ratio below 1; of helical gears the total one.
    """

    notes: tuple[str, ...] = field(default=(), kw_only=True, compare=False)
    #: The wheel as given, whose teeth may be thicker.
    given_wheel: Gear = field(init=False, compare=False)

    def __post_init__(self) -> None:
        offset = self.axial_offset
        jam = check_seat(MeshGeometry(self.pinion, self.wheel, self.centre_distance, axial_offset=offset))
        object.__setattr__(self, "given_wheel", self.wheel)
        notes = list(self.notes)
        if jam > 0.0:
            wheel = self.wheel
            thinning = jam * math.cos(wheel.base_helix_angle) / math.cos(wheel.pressure_angle)
            thinner = replace(self.wheel, tooth_thinning=self.wheel.tooth_thinning + thinning)
            object.__setattr__(self, "wheel", thinner)
            notes.append(
                f"the centre distance jams the teeth by {1e6 * jam:.3g} um on the line of action, by rounding: the "
                f"wheel's teeth are taken {1e6 * thinning:.3g} um thinner, without backlash"
            )
        check_pair(self)
        notes += [note for note in rounding_notes(self) if note not in notes]
        object.__setattr__(self, "notes", tuple(notes))

    def facts(self) -> dict[str, str]:
        """Teeth, module, centre distance, contact ratio."""
        return {
            "teeth": f"{self.pinion.teeth}/{self.wheel.teeth}",
            "module": f"{1e3 * self.pinion.module:.6g} mm",
            "centre distance": f"{1e3 * self.wheel_centre:.6g} mm",
            "working pressure angle": f"{math.degrees(self.working_pressure_angle):.5g} deg",
            "contact ratio": f"{self.contact_ratio:.4g}",
            "backlash": f"{1e3 * self.backlash:.4g} mm",
        } | self._helix()

    def _helix(self) -> dict[str, str]:
        if not self.pinion.helical:
            return {}
        angle = f"{math.degrees(self.pinion.helix_angle):.5g} deg, pinion {self.pinion.hand}"
        return {"helix angle": angle, "overlap ratio": f"{self.overlap_ratio:.4g}"}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is legal but deserves a look, one sentence each."""
        return (*self.notes, *pair_warnings(self))

    @classmethod
    def from_table(cls, table: PairTable) -> GearPair:
        """Pair that a job file's [pair] table describes; errors name the file's keys and units."""
        (mesh,) = pair_gearbox(table).meshes.values()
        return pair_of(mesh)


#: Argument of `Gear` or `GearPair` -> its key in a job file and the key's unit in SI.
KEYS: dict[str, tuple[str, float]] = {
    "module": ("module_mm", 1e-3),
    "pressure_angle": ("pressure_angle_deg", math.pi / 180.0),
    "face_width": ("face_width_mm", 1e-3),
    "bore_diameter": ("bore_diameter_mm", 1e-3),
    "web.width": ("web_width_mm", 1e-3),
    "web.outer_diameter": ("web_outer_diameter_mm", 1e-3),
    "web.inner_diameter": ("web_inner_diameter_mm", 1e-3),
    "web.offset": ("web_offset_mm", 1e-3),
    "rim_diameter": ("rim_diameter_mm", 1e-3),
    "form_diameter": ("form_diameter_mm", 1e-3),
    "tip_round": ("tip_round_mm", 1e-3),
    "tip_relief.amount": ("tip_relief_amount_um", 1e-6),
    "tip_relief.length": ("tip_relief_length_mm", 1e-3),
    "tip_relief.exponent": ("tip_relief_exponent", 1.0),
    "tooth_thinning": ("tooth_thinning_um", 1e-6),
    "helix_angle": ("helix_angle_deg", math.pi / 180.0),
    "hand": ("helix_hand", 1.0),
    "centre_distance": ("centre_distance_mm", 1e-3),
}


def gear_pair(
    pinion: Gear,
    wheel: Gear,
    centre_distance: float | None = None,
    notes: tuple[str, ...] = (),
    axial_offset: float = 0.0,
) -> GearPair:
    """Return a checked pair; equal gears at an equal centre distance with equal notes share one.

    Parameters
    ----------
    pinion, wheel : Gear
        The gears.
    centre_distance : float, optional
        In m; without it, without backlash.
    notes : tuple of str
        How given data were taken that fit each other except for rounding.
    axial_offset : float
        Middle of the wheel's face width less that of the pinion's, along the axes (m).

    Raises
    ------
    InputError
        For gears that cannot run together.
    """
    if centre_distance is not None and not isinstance(centre_distance, Real):
        return GearPair(pinion, wheel, centre_distance)  # which refuses it
    return _shared_pair(pinion, wheel, centre_distance, notes, axial_offset)


@lru_cache(maxsize=256)
def _shared_pair(
    pinion: Gear, wheel: Gear, centre_distance: float | None, notes: tuple[str, ...], axial_offset: float
) -> GearPair:
    return GearPair(pinion, wheel, centre_distance, notes=notes, axial_offset=axial_offset)


#: Arguments of `Web`.
WEB = ("width", "outer_diameter", "inner_diameter", "offset")


def gear_of_form(teeth: int, form: Mapping[str, Any]) -> Gear:
    """Gear with the keys of `gearfe.base.tables.pair.tooth_form`, ``module_mm``, and those of its bore or rim."""
    made = {key: value for key, value in form.items() if value is not None or key not in RING_KEYS}
    for name, (key, unit) in KEYS.items():
        if made.get(key) is not None:
            value = made.pop(key)
            made[name] = value if isinstance(value, str) else value * unit
    amount, length, exponent = (made.pop(f"tip_relief.{name}", None) for name in ("amount", "length", "exponent"))
    web = {name: made.pop(f"web.{name}") for name in WEB if f"web.{name}" in made}
    if web:
        made["web"] = Web(**web)
    if amount:
        made["tip_relief"] = TipRelief(amount, given(length, "tip_relief_length_mm"), exponent)
    return Gear(teeth, **{name: made[name] for name in made if name != "tip_relief_length_mm"})


def in_keys(error: InputError, where: str, *, key: str = "", unit: float = 0.0) -> InputError:
    """Return the error of an argument of `Gear` as that of its key in a table, in the key's unit.

    Parameters
    ----------
    error : InputError
        The error.
    where : str
        Table of the key, for the message.
    key : str
        Key, if it is not the usual one.
    unit : float
        Unit of the key in SI; 0 for the usual one.
    """
    named, own = KEYS.get(error.field, (error.field, 1.0))
    value = float(f"{error.value / (unit or own):.12g}") if isinstance(error.value, float) else error.value
    limit = error.limit
    if limit is not None and not limit[2] and own != 1.0:  # in SI
        limit = (limit[0], limit[1] / own, "")
    if limit is not None and unit:
        limit = (limit[0], limit[1] * own / unit, limit[2])
    return InputError(f"{where}.{key or named}", value, error.reason, error.cure, limit)


#: Argument of `Gear` -> keys of a drawing that give it, the first that is written.
GIVE: dict[str, tuple[str, ...]] = {
    "addendum": ("tip_diameter_mm", "addendum", "tip_shortening"),
    "dedendum": ("root_diameter_mm",),
    "tooth_thinning": ("span_mm",),
    "module": ("pitch_diameter_mm",),
}


def pair_of(mesh: NamedMesh) -> GearPair:
    """Return the pair of gears that a mesh of a job file has, the driver as pinion.

    Raises
    ------
    InputError
        For gears that cannot be made or run together, in the file's keys and units.
    """
    written = _Written(mesh)
    gears = {side: written.gear(side) for side in SIDES}
    try:
        return gear_pair(gears["pinion"], gears["wheel"], written.distance, tuple(written.notes()), written.offset)
    except InputError as error:
        side, _, name = error.field.rpartition(".") if error.field.startswith(SIDES) else ("", "", "")
        raise written.error(error, side, name or error.field, gears) from None


def gear_of(named: NamedGear) -> Gear:
    """Return a gear of a job file that needs no mesh.

    Raises
    ------
    InputError
        For a gear that cannot be made, in the file's keys and units.
    """
    return _Written(NamedMesh("", named.where, named, named, None, named.where)).gear("pinion")


#: Roles of the gears of a mesh.
SIDES = ("pinion", "wheel")


class _Written:
    """A mesh as its user wrote it: its gears, and errors of their arguments in the keys that were written."""

    def __init__(self, mesh: NamedMesh) -> None:
        self.mesh = mesh
        self.named = dict(zip(SIDES, mesh.gears, strict=True))
        #: What messages call the gears.
        self.called = {
            side: f"the {side}" if gear.name == side else f"gear {gear.name!r}" for side, gear in self.named.items()
        }
        #: Gear whose profile shift follows from the centre distance, or nothing.
        self.derived = next((s for s, gear in self.named.items() if mesh.name and gear.shift_from == mesh.name), "")
        self.thinned_um: dict[str, float] = {}

    @property
    def _distance_key(self) -> str:
        return f"{self.mesh.centre_distance_where}.centre_distance_mm"

    def _shift(self, side: str, distance_mm: float) -> float:
        """Profile shift of the gear of a side that a centre distance (mm) gives."""
        mate = self.named["wheel" if side == "pinion" else "pinion"]
        return shift_by_distance(self.named[side], mate, distance_mm, self._distance_key)

    def gear(self, side: str) -> Gear:
        """The gear of a side.

        Raises
        ------
        InputError
            For data that no gear has, in the file's keys and units.
        """
        try:
            return self._gear(side, self.named[side].form["profile_shift"])
        except InputError as error:
            raise self.error(error, side, error.field) from None

    def _gear(self, side: str, shift: float) -> Gear:
        form = {**self.named[side].form, "profile_shift": shift}
        return gear_of_form(self.named[side].teeth, form | self._of_drawing(side, form))

    def _of_drawing(self, side: str, form: Mapping[str, Any]) -> dict[str, float]:
        """Keys of the tooth form that drawing values stand for: tip and root diameters, the span size."""
        teeth, drawn = self.named[side].teeth, self.named[side].drawn
        module_mm, half, x = form["module_mm"], self._half_teeth(side), form["profile_shift"]
        made: dict[str, float] = {}
        sign = -1 if teeth < 0 else 1
        if "tip_diameter_mm" in drawn:
            height = sign * (0.5 * drawn["tip_diameter_mm"] / module_mm - half)
            made |= {"addendum": height - x, "tip_shortening": 0.0}
        if "root_diameter_mm" in drawn:
            made["dedendum"] = sign * (half + sign * x - 0.5 * drawn["root_diameter_mm"] / module_mm)
        if "span_mm" in drawn:
            angle, span, over = math.radians(form["pressure_angle_deg"]), drawn["span_mm"], drawn["span_teeth"]
            most = module_mm * nominal_span(teeth, x, angle, over, self._helix(side))
            if span > most + 1e3 * rounding(1e-3 * module_mm):
                what = f"{over} spaces" if teeth < 0 else f"{over} teeth"
                problem = (
                    f"must be <= {most:.6g} mm, the span over {what} without backlash of {abs(teeth)} teeth, module "
                    f"{module_mm:.6g} mm, profile_shift {x:.6g}"
                )
                cure = (
                    "if you changed one of these, change span_mm and span_teeth as well, or remove both and give the "
                    "backlash by tooth_thinning_um"
                )
                raise InputError("span_mm", span, problem, cure)
            self.thinned_um[side] = 1e3 * (most - span) / math.cos(angle)
            made["tooth_thinning_um"] = max(0.0, self.thinned_um[side])
        return made

    def notes(self) -> list[str]:
        """Return what follows from other keys, and what was taken although it differs by rounding."""
        notes: list[str] = []
        if self.derived:
            x = self.named[self.derived].form["profile_shift"]
            notes.append(f"profile_shift of {self.called[self.derived]} by the centre distance: {x + 0.0:.6g}")
        for side, thinned in self.thinned_um.items():
            if thinned < 0.0:
                off = -thinned * math.cos(self._angle(side))
                notes.append(
                    f"span_mm of {self.called[side]} is {off:.3g} um larger than that "
                    "without backlash, by rounding: tooth_thinning_um is taken as 0"
                )
        for side in SIDES:
            named = self.named[side]
            module, given_mm = named.form["module_mm"], named.drawn.get("pitch_diameter_mm")
            diameter = 2.0 * self._half_teeth(side) * module
            if given_mm is not None and abs(given_mm - diameter) > 1e-9 * given_mm:
                off = 1e3 * abs(given_mm - diameter)
                notes.append(
                    f"pitch_diameter_mm of {self.called[side]} differs from {named.teeth} teeth of the common module "
                    f"{module:.9g} mm by {off:.3g} um, by rounding: the module is taken"
                )
        return notes

    def _angle(self, side: str) -> float:
        return math.radians(self.named[side].form["pressure_angle_deg"])

    def _helix(self, side: str) -> float:
        return math.radians(self.named[side].form["helix_angle_deg"])

    def _half_teeth(self, side: str) -> float:
        """Reference radius over normal module, z/(2 cos(beta))."""
        return 0.5 * transverse_teeth(self.named[side].teeth, self.named[side].form["helix_angle_deg"])

    def _written(self, side: str, name: str) -> tuple[str, str]:
        """Key that gives an argument of a gear, and its table; an empty text where the user wrote none."""
        usual, named = KEYS.get(name, (name, 1.0))[0], self.named[side]
        keys = {key: named.written(key) for key in (*GIVE.get(name, ()), usual)}
        found = [(key, where) for key, where in keys.items() if where]
        return min(found, key=lambda one: one[1] != named.where, default=(usual, ""))

    def error(self, error: InputError, side: str, name: str, gears: Mapping[str, Gear] | None = None) -> InputError:
        """Return the error of an argument as that of the key that was written, its bound as one of that key.

        Parameters
        ----------
        error : InputError
            The error.
        side : str
            Gear; nothing for the pair.
        name : str
            Argument of the gear or of the pair.
        gears : mapping of str to Gear, optional
            Both gears, for errors of the pair.
        """
        error = InputError(name, error.value, error.reason, error.cure, error.limit)
        if not side:
            gear = self.mesh.driven
            of_place = InputError(f"{gear.where}.y_mm", gear.y_mm, error.reason, error.cure)
            return of_place if name == "axial_offset" else in_keys(error, self.mesh.centre_distance_where)
        if side == self.derived and (gears is None or name == "profile_shift"):
            return self._of_distance(error, side, gears)
        if gears is not None and error.limit is not None:
            side, error = self._of_pair(error, side, gears)
        key, where = self._written(side, error.field)
        if gears is None and not where and error.field in ("addendum", "dedendum"):
            shift = self._of_shift(error, side)
            if shift is not None:
                return shift
        where = where or self.named[side].where
        if key == "pitch_diameter_mm":
            return in_keys(error, where, key=key, unit=5e-4 / self._half_teeth(side))
        if key == KEYS.get(error.field, (error.field, 1.0))[0]:
            return in_keys(error, where)
        return self._of_key(error, side, key, where)

    def _of_key(self, error: InputError, side: str, key: str, where: str) -> InputError:
        """The error of a coefficient as that of the diameter, span size or tip shortening that gives it."""
        named = self.named[side]
        value = named.drawn.get(key, named.form.get(key))
        if error.limit is None:
            number = f"{error.value:.6g}" if isinstance(error.value, float) else str(error.value)
            return InputError(f"{where}.{key}", value, f"makes {error.field} {number}: {error.reason}", error.cure)
        form, (sign, bound, unit) = named.form, error.limit
        module, x = form["module_mm"], form["profile_shift"]
        side_sign = -1 if named.teeth < 0 else 1
        inward = key == ("tip_diameter_mm" if named.teeth < 0 else "root_diameter_mm")
        if inward or key in ("span_mm", "tip_shortening"):  # these fall as what they stand for grows
            sign = {"<": ">", ">": "<", ">=": "<=", "<=": ">="}[sign]
        if key == "span_mm":
            over = named.drawn["span_teeth"]
            whole = module * nominal_span(named.teeth, x, self._angle(side), over, self._helix(side))
            limit = whole - 1e3 * bound * (1e-6 if unit == "um" else 1.0) * math.cos(self._angle(side))
        elif key == "tip_shortening":
            limit = form["tip_shortening"] + form["addendum"] - bound
            if sign == "<=" and limit < 0.0:
                cure = "use less tip_shortening of both gears, or more addendum"
                return InputError(f"{where}.{key}", value, f"{error.reason}, even with 0 here", cure)
        else:
            height = x + (bound if key == "tip_diameter_mm" else -bound)
            limit = module * (2.0 * self._half_teeth(side) + side_sign * 2.0 * height)
        unit, cure = " mm" * key.endswith("_mm"), f"use a {'smaller' if '<' in sign else 'larger'} {key}"
        return InputError(f"{where}.{key}", value, f"{error.reason}: must be {sign} {limit:.6g}{unit}", cure)

    def _of_pair(self, error: InputError, side: str, gears: Mapping[str, Gear]) -> tuple[str, InputError]:
        """Gear and error of a pair's bound: of the gear whose key was written, or of both where they share it."""
        mate = "wheel" if side == "pinion" else "pinion"
        name, (sign, bound, unit) = error.field, given(error.limit, "limit")
        own, other = (self._written(each, name)[1] for each in (side, mate))
        reason, cure, shared = error.reason, error.cure, own == other != ""
        if name == "profile_shift":  # the bound of the sum
            total = bound + gears[mate].profile_shift
            side = mate if other and not own else side
            bound = 0.5 * total if shared else total - gears["wheel" if side == "pinion" else "pinion"].profile_shift
        elif name == "addendum" and sign == ">=":  # tips of both gears make the contact ratio
            side = mate if other and not own else side
            pair = MeshGeometry(gears["pinion"], gears["wheel"], self.distance)
            bound = gears[side].addendum + missing_addendum(pair, ("pinion", "wheel") if shared else (side,))
        elif name == "addendum" and not own and self._written(mate, "dedendum")[1] and "root circle" in reason:
            reason = f"lets the {side}'s tip circle hit the root circle"
            sign, bound = ">", gears[mate].dedendum + gears[side].addendum - bound
            name, side, cure = "dedendum", mate, "use more dedendum"
        return side, InputError(name, getattr(gears[side], name), reason, cure, (sign, bound, unit))

    @property
    def offset(self) -> float:
        """Place of the driven gear along the axes less that of the driver (m); of spur gears it decides no geometry."""
        one, two = self.mesh.gears
        return 1e-3 * (two.y_mm - one.y_mm) if one.form["helix_angle_deg"] else 0.0

    @property
    def distance(self) -> float | None:
        """Centre distance (m)."""
        return None if self.mesh.centre_distance_mm is None else 1e-3 * self.mesh.centre_distance_mm

    def _possible(self, side: str, shift: float, gears: Mapping[str, Gear] | None, distance: float | None) -> bool:
        """Whether there is a gear with a profile shift, and with `gears` a pair with it at a distance (m)."""
        try:
            gear = self._gear(side, shift)
            if gears is not None:
                both = {**gears, side: gear}
                GearPair(both["pinion"], both["wheel"], centre_distance=distance)
        except InputError:
            return False
        return True

    def _of_shift(self, error: InputError, side: str) -> InputError | None:
        """The error of a coefficient that the user did not write as one of the profile shift, where that makes it."""
        key, where = self._written(side, "profile_shift")
        x = self.named[side].form["profile_shift"]
        near = [s for s in np.linspace(-0.5, 1.0, 31).tolist() if self._possible(side, s, None, None)] if where else []
        if not near or where != self.named[side].where:
            return None
        good = _last(lambda s: self._possible(side, s, None, None), min(near, key=lambda s: abs(s - x)), x, 1e-7)
        cure = f"use {'less' if good < x else 'more'} {key}"
        problem = f"{error.reason}: must be {'<=' if good < x else '>='} {good:.6g}"
        return InputError(f"{where}.{key}", x, problem, cure)

    def _of_distance(self, error: InputError, side: str, gears: Mapping[str, Gear] | None) -> InputError:
        """The error of a gear whose profile shift follows from the centre distance as one of that distance."""
        named = self.named[side]
        a, x = given(self.mesh.centre_distance_mm, self._distance_key), named.form["profile_shift"]
        problem = f"makes profile_shift {x:.5g} of {self.called[side]}: {error.reason}"

        def possible(a: float) -> bool:
            return self._possible(side, self._shift(side, a), gears, 1e-3 * a)

        halves = [math.copysign(self._half_teeth(each), self.named[each].teeth) for each in SIDES]
        reference = abs(sum(halves)) * named.form["module_mm"]
        near = [d for d in np.linspace(0.99 * reference, 1.05 * reference, 121).tolist() if possible(d)]
        if not near:
            return InputError(f"{named.where}.profile_shift", FROM_DISTANCE, problem, error.cure)
        good = _last(possible, min(near, key=lambda d: abs(d - a)), a, 1e-7 * a)
        cure = f"use a {'smaller' if good < a else 'larger'} centre distance, or write the profile shift"
        problem = f"{problem}: must be {'<=' if good < a else '>='} {good:.7g} mm"
        return InputError(self._distance_key, a, problem, cure)


def _last(possible: Callable[[float], bool], good: float, bad: float, close: float) -> float:
    """Last possible value between one that is and one that is not, to `close`."""
    while abs(bad - good) > close:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if possible(middle) else (good, middle)
    return good
