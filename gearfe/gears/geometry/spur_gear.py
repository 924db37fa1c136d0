"""One spur or helical gear, checked, with the exact profile of its transverse section.

What a gear here has:

- *Teeth*: 8 and more. Fewer are undercut so far that their flanks end within the path of contact. An internal gear has
  12 and more, written with a minus sign.
- *Rim*: a quarter of a module between bore and root circle, and a bore that holds the gear; of an internal gear between
  root circle and outer diameter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from numbers import Integral, Real
from typing import Any

from ...base.errors import InputError
from .cutter import LEAST_CUTTER
from .gear_data import GearData
from .involute import ToothProfile, tooth_profile

#: Numbers of teeth.
LEAST_TEETH, LEAST_RING, MOST_TEETH = 8, 12, 1000
#: Ways to hold the rim of an internal gear.
RIMS = ("bolted", "free")
#: Hands of a helix.
HANDS = ("right", "left")
#: Largest helix angle (rad): gears of parallel axes in service have up to 45 deg.
MOST_HELIX = math.radians(45.0)
#: Modules and face widths beyond it (m) are mistakes, and large ones overflow.
LARGEST = 1e4
#: Rounding of lengths in parts of themselves.
SAME_LENGTH = 1e-9
#: Least tip round that is not a sharp corner, times module: meshers need seconds for less, and elements degenerate.
LEAST_ROUND = 1e-6
#: Least rim between bore and root circle, times module.
LEAST_RIM = 0.25
#: Least width of a web and least height of web, rim and hub, times module.
LEAST_WEB = 0.1
#: Least bore, times module: plane elasticity gives a point no stiffness, and a bore of a hundredth tears loose.
LEAST_BORE = 0.05


@dataclass(frozen=True)
class Gear(GearData):
    """Spur or helical gear, external or internal; arguments as of `GearData`.

    Raises
    ------
    InputError
        For data that no gear here has, and profiles that no rack or cutter makes.
    """

    def __repr__(self) -> str:
        """Return the call that makes the gear, without arguments that have their defaults."""
        entries = [(entry, getattr(self, entry.name)) for entry in fields(self)]
        return f"Gear({', '.join(f'{entry.name}={value!r}' for entry, value in entries if value != entry.default)})"

    def __post_init__(self) -> None:
        check_gear(self)
        _ = self.profile

    @cached_property
    def profile(self) -> ToothProfile:
        """Exact half profile, see `gearfe.gears.geometry.involute.tooth_profile`."""
        return tooth_profile(self)

    @cached_property
    def form_roll(self) -> float:
        """Roll length of the form point, where the involute starts (m)."""
        return self.profile.form_roll

    @cached_property
    def form_radius(self) -> float:
        """Root form radius r_Ff (m)."""
        return math.hypot(self.base_radius, self.profile.form_roll)

    @cached_property
    def undercut(self) -> bool:
        """True when the rack's tip cuts into the involute."""
        return self.profile.undercut

    @cached_property
    def tip_thickness(self) -> float:
        """Tooth thickness at the tip circle, as if not rounded (m)."""
        return 2.0 * self.tip_radius * self.profile.tip_half_angle


def check_gear(gear: GearData) -> None:
    """Raise `InputError` for data that no gear here has; the profile, which is made of them, has checks of its own."""
    teeth: Any = gear.teeth
    whole = isinstance(teeth, Integral) and not isinstance(teeth, bool)
    if not whole or not (LEAST_TEETH <= int(teeth) <= MOST_TEETH or -MOST_TEETH <= int(teeth) <= -LEAST_RING):
        problem = f"must be a whole number >= {LEAST_TEETH} and <= {MOST_TEETH}"
        if whole and int(teeth) < 0:
            problem = f"must be <= {-LEAST_RING} and >= {-MOST_TEETH} for an internal gear, else >= {LEAST_TEETH}"
        raise InputError("teeth", teeth, problem, "use another number of teeth")
    ranges = {
        "module": (0.0, LARGEST, False),
        "pressure_angle": (math.radians(5.0), math.radians(45.0), True),
        "face_width": (0.0, LARGEST, False),
        "bore_diameter": (0.0, math.inf, gear.internal),
        # -teeth/2 moves the reference line to the axis, and teeth are pointed long before teeth/2
        "profile_shift": (-0.5 * gear.tooth_count, 0.5 * gear.tooth_count, True),
        "addendum": (0.0, math.inf, False),
        "dedendum": (0.0, math.inf, False),
        "rack_tip_radius": (0.0, math.inf, True),
        "tip_round": (0.0, math.inf, True),
        "tip_shortening": (0.0, math.inf, True),
        "tooth_thinning": (0.0, math.inf, True),
        "helix_angle": (0.0, MOST_HELIX, True),
    }
    for name, (low, high, closed) in ranges.items():
        _check(name, getattr(gear, name), low, high, closed)
    if gear.hand not in HANDS:
        raise InputError("hand", gear.hand, "must be right or left", "a negative helix angle is one of the other hand")
    if gear.tip_relief is not None:
        _check("tip_relief.amount", gear.tip_relief.amount, 0.0, math.inf, True)
        _check("tip_relief.length", gear.tip_relief.length, 0.0, math.inf, False)
        _check("tip_relief.exponent", gear.tip_relief.exponent, 1.0, math.inf, True)
    if gear.half_thickness_angle <= 0.0:
        what, slope = "leaves no tooth thickness at the reference circle", 2.0 * math.tan(gear.pressure_angle)
        most = gear.module * (0.5 * math.pi + slope * gear.profile_shift)  # thickness without thinning
        if most > 0.0:
            cure = "use less thinning, a larger module or more profile shift"
            raise InputError("tooth_thinning", gear.tooth_thinning, what, cure, ("<", 1e6 * most, "um"))
        least = (gear.tooth_thinning / gear.module - 0.5 * math.pi) / slope
        problem = f"{what}: must be > {least:.6g}"
        raise InputError("profile_shift", gear.profile_shift, problem, "use more profile shift")
    _check_web(gear)
    if gear.internal:
        _check_ring(gear)
    else:
        _check_rim(gear)
    if 0.0 < gear.tip_round < LEAST_ROUND * gear.module:
        problem = f"must be 0 or >= {1e3 * LEAST_ROUND * gear.module:.6g} mm, {LEAST_ROUND:g} module"
        raise InputError("tip_round", gear.tip_round, problem, "write 0 for a sharp corner")
    if gear.tip_round > gear.module:
        problem = f"must be <= {1e3 * gear.module:.6g} mm, one module"
        raise InputError("tip_round", gear.tip_round, problem, "use a smaller tip round")


def _check(name: str, value: float, low: float, high: float, closed: bool) -> None:
    number = not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)
    if number and (low <= value <= high if closed else low < value < high):
        return
    signs = (">=", "<=") if closed else (">", "<")
    if number:  # a bound that other keys state in their own quantity
        small = value <= low
        sign, bound = (signs[0], low) if small else (signs[1], high)
        raise InputError(name, value, f"is too {'small' if small else 'large'}", "correct it", (sign, bound, ""))
    limits = [f"{sign} {limit:g}" for sign, limit in zip(signs, (low, high), strict=True) if math.isfinite(limit)]
    raise InputError(name, value, "must be a finite number" + "".join(f", {limit}" for limit in limits), "correct it")


def _check_web(gear: GearData) -> None:
    """Raise `InputError` unless the web of an external gear is between bore and root circle and within the face."""
    web, least = gear.web, LEAST_WEB * gear.module
    if web is None:
        return
    if gear.internal:
        problem = "is of external gears: the ring of an internal gear is as wide as its teeth"
        raise InputError("web.width", web.width, problem, "leave the keys of the web out")
    bore = gear.bore_diameter
    hub = bore if web.inner_diameter is None else web.inner_diameter
    ranges = {
        "web.width": (web.width, least, gear.face_width, "the face width"),
        "web.outer_diameter": (
            web.outer_diameter, hub + 2.0 * least, 2.0 * (gear.root_radius - LEAST_RIM * gear.module),
            f"{LEAST_RIM:g} module inside the root circle",
        ),
        "web.inner_diameter": (hub, bore if hub == bore else bore + 2.0 * least, math.inf, "the web's outer diameter"),
    }  # fmt: skip
    for name, (value, low, high, what) in ranges.items():
        _check(name, value, 0.0, LARGEST, False)
        if not low <= value <= high:
            problem = f"must be >= {1e3 * low:.6g} mm"
            if math.isfinite(high):
                problem += f" and <= {1e3 * high:.6g} mm, {what}"
            raise InputError(name, value, problem, "keep the web between hub or bore and rim")
    most = 0.5 * (gear.face_width - web.width)
    if not (math.isfinite(web.offset) and abs(web.offset) <= most * (1.0 + SAME_LENGTH) + SAME_LENGTH * web.width):
        problem = f"must be >= {-1e3 * most:.6g} mm and <= {1e3 * most:.6g} mm, so that the web is within the face"
        raise InputError("web.offset", web.offset, problem, "move the web less, or make it narrower")


def _check_ring(gear: GearData) -> None:
    """Raise `InputError` unless the internal gear has a rim, and a cutter or a form diameter."""
    if gear.bore_diameter != 0.0:
        problem, cure = "is that of an external gear", "leave it out, and give rim_diameter: the ring is held there"
        raise InputError("bore_diameter", gear.bore_diameter, problem, cure)
    least = 2.0 * (gear.root_radius + LEAST_RIM * gear.module)
    if gear.rim_diameter is None:
        cure = f"add the outer diameter of the rim: >= {1e3 * least:.6g} mm"
        raise InputError("rim_diameter", None, "is required for an internal gear", cure)
    _check("rim_diameter", gear.rim_diameter, 0.0, LARGEST, False)
    if gear.rim_diameter < least:
        problem = (
            f"must be >= {1e3 * least:.6g} mm, so that a rim of {LEAST_RIM:g} module is left outside the root circle "
            f"of {2e3 * gear.root_radius:.6g} mm"
        )
        raise InputError("rim_diameter", gear.rim_diameter, problem, "use a larger rim")
    if gear.rim not in RIMS:
        raise InputError("rim", gear.rim, "must be bolted or free", "a bolted rim is held all round")
    teeth: Any = gear.cutter_teeth
    if teeth is not None:
        whole, most = isinstance(teeth, Integral) and not isinstance(teeth, bool), gear.tooth_count - 2
        if not whole or not LEAST_CUTTER <= int(teeth) <= most:
            problem = f"must be a whole number >= {LEAST_CUTTER} and <= {most}"
            raise InputError("cutter_teeth", teeth, problem, "use another cutter, or leave it out")
    _check("cutter_shift", gear.cutter_shift, -0.5 * gear.tooth_count, 0.5 * gear.tooth_count, True)
    if gear.form_diameter is not None:
        _check("form_diameter", gear.form_diameter, 0.0, LARGEST, False)
        if teeth is not None or gear.cutter_shift:
            problem = "gives the root with the root diameter; a cutter would give it, too"
            raise InputError("form_diameter", gear.form_diameter, problem, "leave out one of form diameter and cutter")


def _check_rim(gear: GearData) -> None:
    """Raise `InputError` unless the gear has a bore that holds it and a rim around it."""
    given = {name: getattr(gear, name) for name in ("rim_diameter", "cutter_teeth", "form_diameter")}
    given |= {"cutter_shift": gear.cutter_shift or None, "rim": None if gear.rim == RIMS[0] else gear.rim}
    for name, value in given.items():
        if value is not None:
            cure = "leave it out, or write the number of teeth of an internal gear with a minus sign"
            raise InputError(name, value, "is of internal gears alone", cure)
    if gear.root_radius <= LEAST_RIM * gear.module:
        most = gear.reference_modules + gear.profile_shift - LEAST_RIM
        problem, cure = (
            "leaves no material inside the root circle",
            "use less dedendum, more teeth or more profile shift",
        )
        raise InputError("dedendum", gear.dedendum, problem, cure, ("<", most, ""))
    if not gear.bore_diameter >= LEAST_BORE * gear.module:
        problem = f"must be >= {1e3 * LEAST_BORE * gear.module:.6g} mm, {LEAST_BORE:g} module"
        cure = "use a larger bore: the gear is held there, and a point holds nothing"
        raise InputError("bore_diameter", gear.bore_diameter, problem, cure)
    limit = 2.0 * (gear.root_radius - LEAST_RIM * gear.module)
    if not gear.bore_diameter <= limit:
        problem = (
            f"must be <= {1e3 * limit:.6g} mm, so that a rim of {LEAST_RIM:g} module is left inside the root "
            f"circle of {2e3 * gear.root_radius:.6g} mm"
        )
        raise InputError("bore_diameter", gear.bore_diameter, problem, "use a smaller bore")
