"""Define the tables [pair] and [stiffness], and register contact laws by name.

They hold a pair of gears, their materials, and the settings of its mesh stiffness, in the units of job files. NumPy is
not loaded for them.

Keys of the tooth form may stand in [pair], for both gears, or in [pair.pinion] and [pair.wheel], which then win.

A new law is one class (its contract is in `gears.contact.laws`) and one line in this module. For another package the
line is the entry point ``name = "module:Class"`` in the group ``gearfe.laws``. Job files, the command line and Python
then accept its name. Its parameters are the fields of the class, the table ``law_parameters`` and the option
``--law-parameter``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from ..config import quantity
from ..errors import InputError, given, nearest

#: What holds where the file gives no value; the other keys are required.
DEFAULTS: dict[str, float] = {
    "profile_shift": 0.0,
    "addendum": 1.0,
    "dedendum": 1.25,
    "rack_tip_radius": 0.3,
    "tip_round_mm": 0.0,
    "tip_shortening": 0.0,
    "tip_relief_amount_um": 0.0,
    "tip_relief_exponent": 1.0,
    "tooth_thinning_um": 0.0,
    "helix_angle_deg": 0.0,
}
#: Hands of a helix.
HANDS = ("right", "left")
#: Keys of a gear's drawing -> those of the tooth form that they stand for.
INSTEAD: dict[str, tuple[str, ...]] = {
    "tip_diameter_mm": ("addendum", "tip_shortening"),
    "root_diameter_mm": ("dedendum",),
    "span_mm": ("tooth_thinning_um",),
}
#: Profile shift that follows from the centre distance and the other gear's shift.
FROM_DISTANCE = "from centre distance"
#: Differences of given lengths that are taken for rounding (mm): a centre distance is printed to 0.001 mm.
ROUNDING_MM = 1e-3
REQUIRED = ("pressure_angle_deg", "face_width_mm")
OPTIONAL = ("tip_relief_length_mm",)
#: Modules that count as equal (relative).
SAME = 1e-9
#: Numbers of teeth of external and internal gears.
LEAST_TEETH, LEAST_RING, MOST_TEETH = 8, 12, 1000
#: Ways to hold the rim of an internal gear.
RIMS = ("bolted", "free")
#: Keys of internal gears alone, and those whose numbers may have the standard's minus sign there.
RING_KEYS = ("rim_diameter_mm", "rim", "cutter_teeth", "cutter_shift", "form_diameter_mm")
SIGNED = (
    *("pitch_diameter_mm", "tip_diameter_mm", "root_diameter_mm"),
    *("rim_diameter_mm", "form_diameter_mm", "span_mm"),
)
#: Keys of the web of an external gear.
WEB_KEYS = ("web_width_mm", "web_outer_diameter_mm", "web_inner_diameter_mm", "web_offset_mm")
#: What the bore is.
BORE_DOC = "diameter of the rigid bore (mm); it decides the stiffness level"


@dataclass(frozen=True)
class MaterialTable:
    """Isotropic linear elastic material; without any key, structural steel."""

    youngs_modulus_GPa: float = quantity(200.0, doc="Young's modulus (GPa)", low=1e-9, high=2000.0)
    poisson_ratio: float = quantity(0.30, doc="Poisson's ratio (-)", low=0.0, below=0.5)
    density_kg_per_m3: float = quantity(7850.0, doc="density (kg/m3)", above=0.0)


@dataclass(frozen=True)
class ToothFormTable:
    """Keys that both gears may share; coefficients are in units of the module, the normal one of helical gears."""

    module_mm: float | None = quantity(None, doc="normal module (mm), instead of pitch_diameter_mm", above=0.0)
    pressure_angle_deg: float | None = quantity(
        None, doc="normal pressure angle at the reference circle (deg)", low=5.0, high=45.0
    )
    helix_angle_deg: float | None = quantity(
        None,
        doc="helix angle at the reference circle (deg), without sign (helix_hand); by default 0, a spur gear",
        low=0.0,
        high=45.0,
    )
    face_width_mm: float | None = quantity(None, doc="face width (mm)", above=0.0)
    profile_shift: float | str | None = quantity(
        None,
        choices=(FROM_DISTANCE,),
        doc='profile shift coefficient x (times module), by default 0; for one gear of a mesh "from centre distance"',
    )
    addendum: float | None = quantity(None, doc="addendum (times module), by default 1", above=0.0)
    dedendum: float | None = quantity(None, doc="dedendum (times module), by default 1.25", above=0.0)
    rack_tip_radius: float | None = quantity(
        None, doc="tip radius of the generating rack (times module), by default 0.3", low=0.0
    )
    tip_round_mm: float | None = quantity(
        None, doc="radius of the round between flank and tip circle (mm), by default 0", low=0.0
    )
    tip_shortening: float | None = quantity(None, doc="tip shortening k (times module), by default 0", low=0.0)
    tip_relief_amount_um: float | None = quantity(None, doc="tip relief at the tip circle (um), by default 0", low=0.0)
    tip_relief_length_mm: float | None = quantity(None, doc="roll length of the relief from the tip (mm)", above=0.0)
    tip_relief_exponent: float | None = quantity(
        None, doc="exponent of the relief: 1 linear (default), 2 parabolic", low=1.0
    )
    tooth_thinning_um: float | None = quantity(
        None,
        doc="arc taken off each tooth at the reference circle, in the normal section, for backlash (um), by default 0",
        low=0.0,
    )


def tooth_form(*tables: ToothFormTable) -> dict[str, Any]:
    """Keys of a tooth form but the module, each from the first table that gives it, else its default."""
    return {
        key: next((v for v in (getattr(table, key) for table in tables) if v is not None), DEFAULTS.get(key))
        for key in (*DEFAULTS, *REQUIRED, *OPTIONAL)
    }


@dataclass(frozen=True)
class GearBodyTable(ToothFormTable):
    """Teeth, bore and drawing of one gear."""

    teeth: int = quantity(
        doc="number of teeth, negative of an internal gear",
        low=-MOST_TEETH,
        high=MOST_TEETH,
    )
    helix_hand: str | None = quantity(
        None, doc="hand of the helix; left out: opposite to that of the mate, right for the driver", choices=HANDS
    )
    bore_diameter_mm: float | None = quantity(None, doc=BORE_DOC, above=0.0)
    web_width_mm: float | None = quantity(
        None,
        doc="width of the web between rim and hub (mm); left out: the gear is as wide everywhere as its face",
        above=0.0,
    )
    web_outer_diameter_mm: float | None = quantity(
        None, doc="inner diameter of the rim, where the web ends (mm), required with web_width_mm", above=0.0
    )
    web_inner_diameter_mm: float | None = quantity(
        None, doc="outer diameter of the hub (mm); left out: the web reaches down to the bore", above=0.0
    )
    web_offset_mm: float | None = quantity(
        None, doc="middle of the web less that of the face width, along y (mm), by default 0"
    )
    rim_diameter_mm: float | None = quantity(
        None, doc="outer diameter of the rim of an internal gear (mm), required there"
    )
    rim: str | None = quantity(
        None,
        doc="how the outer diameter of an internal gear is held: bolted (rigid, the default) or free "
        "(elastic; its mean displacement and turn are held)",
        choices=RIMS,
    )
    cutter_teeth: int | None = quantity(
        None,
        doc="number of teeth of the pinion-type cutter of an internal gear; left out: half of the gear's own, "
        "rounded down",
        low=8,
        high=MOST_TEETH,
    )
    cutter_shift: float | None = quantity(
        None, doc="profile shift coefficient of that cutter (times module), by default 0"
    )
    form_diameter_mm: float | None = quantity(
        None,
        doc="root form diameter of an internal gear (mm); a circular fillet leads from it to the root circle; "
        "left out: the root follows from the cutter",
    )
    pitch_diameter_mm: float | None = quantity(None, doc="reference diameter (mm), instead of module_mm")
    tip_diameter_mm: float | None = quantity(None, doc="tip diameter (mm), instead of addendum and tip_shortening")
    root_diameter_mm: float | None = quantity(None, doc="root diameter (mm), instead of dedendum")
    span_mm: float | None = quantity(
        None,
        doc="span size over span_teeth teeth, of an internal gear over as many spaces, W_k (mm), instead of "
        "tooth_thinning_um",
    )
    span_teeth: int | None = quantity(None, doc="number of teeth k of span_mm", low=2)

    @property
    def internal(self) -> bool:
        """Return whether it is an internal gear."""
        return self.teeth < 0

    def size(self, key: str) -> float | None:
        """Magnitude of a diameter, which a file may write with the standard's minus sign for an internal gear."""
        value: float | None = getattr(self, key)
        return None if value is None else abs(value)


def check_gear(gear: GearBodyTable, where: str, shared: ToothFormTable | None = None, shared_where: str = "") -> None:
    """Raise `InputError` for keys of a gear that are missing or contradict each other.

    Parameters
    ----------
    gear : GearBodyTable
        The gear.
    where : str
        Its table in messages.
    shared : ToothFormTable, optional
        Keys that it shares with others.
    shared_where : str
        Table of these in messages.
    """
    _check_kind(gear, where)
    for key, others in INSTEAD.items():
        for other in others if getattr(gear, key) is not None else ():
            if getattr(gear, other) is not None:
                problem = f"says what {other} = {getattr(gear, other):g} says"
                raise InputError(f"{where}.{key}", getattr(gear, key), problem, "leave one out")
    if (gear.span_mm is None) != (gear.span_teeth is None):
        lacking = "span_mm" if gear.span_mm is None else "span_teeth"
        raise InputError(f"{where}.{lacking}", None, "is required with the other one", "give both, or neither")
    tables = (gear,) if shared is None else (gear, shared)
    module = next((table.module_mm for table in tables if table.module_mm is not None), None)
    if gear.pitch_diameter_mm is None and module is None:
        places = "" if shared is None else ", here or in the shared table,"
        raise InputError(
            f"{where}.module_mm", None, "is required", f"give the module (mm){places} or pitch_diameter_mm"
        )
    form = tooth_form(*tables)
    if gear.pitch_diameter_mm is not None and module is not None:
        teeth = transverse_teeth(gear.teeth, form["helix_angle_deg"])
        implied = abs(gear.pitch_diameter_mm) / teeth
        if abs(implied - module) > SAME * module and abs(implied - module) * teeth > ROUNDING_MM:
            problem = f"contradicts module_mm = {module:g}: {gear.teeth} teeth make it {module * teeth:.9g}"
            raise InputError(f"{where}.pitch_diameter_mm", gear.pitch_diameter_mm, problem, "leave one out")
    for key in REQUIRED:
        if form[key] is None:
            cure = "add it" if shared is None else f"add it to [{shared_where}] or to each gear"
            raise InputError(f"{shared_where or where}.{key}", None, "is required", cure)
    if form["tip_relief_amount_um"] and form["tip_relief_length_mm"] is None:
        cure = "add it, or leave out tip_relief_amount_um"
        raise InputError(f"{where}.tip_relief_length_mm", None, "is required with a tip relief", cure)


def _check_kind(gear: GearBodyTable, where: str) -> None:
    """Raise `InputError` for a number of teeth that no gear has, and for keys of the other kind of gear."""
    if -LEAST_RING < gear.teeth < LEAST_TEETH:
        problem = f"must be >= {LEAST_TEETH} for an external gear, <= {-LEAST_RING} for an internal gear"
        raise InputError(f"{where}.teeth", gear.teeth, problem, "use another number of teeth")
    for key in WEB_KEYS:
        value = getattr(gear, key)
        if value is not None and gear.internal:
            problem = "is of external gears: the ring of an internal gear is as wide as its teeth"
            raise InputError(f"{where}.{key}", value, problem, "leave it out")
        if value is not None and gear.web_width_mm is None:
            raise InputError(f"{where}.{key}", value, "is of a web, whose web_width_mm is missing", "add web_width_mm")
    if gear.web_width_mm is not None and gear.web_outer_diameter_mm is None:
        cure = "give the inner diameter of the rim (mm)"
        raise InputError(f"{where}.web_outer_diameter_mm", None, "is required with web_width_mm", cure)
    if gear.internal:
        if gear.bore_diameter_mm is not None:
            problem, cure = "is of external gears: an internal gear is held at its rim", "give rim_diameter_mm instead"
            raise InputError(f"{where}.bore_diameter_mm", gear.bore_diameter_mm, problem, cure)
        if gear.rim_diameter_mm is None:
            raise InputError(f"{where}.rim_diameter_mm", None, "is required for an internal gear", "add it")
    else:
        for key in RING_KEYS:
            if getattr(gear, key) is not None:
                problem = "is of internal gears alone, whose number of teeth is negative"
                raise InputError(f"{where}.{key}", getattr(gear, key), problem, "leave it out, or write teeth = -61")
        if gear.bore_diameter_mm is None:
            raise InputError(f"{where}.bore_diameter_mm", None, f"is required: {BORE_DOC}", "add it")
    for key in SIGNED:
        value = getattr(gear, key)
        if value is not None and (value == 0.0 or (value < 0.0 and not gear.internal)):
            problem = "must be > 0; negative sizes are of internal gears, by ISO 21771"
            raise InputError(f"{where}.{key}", value, problem, "correct it")


def transverse_teeth(teeth: int, helix_deg: float) -> float:
    """Reference diameter over normal module, |z|/cos(beta) (-), at a helix angle (deg)."""
    return abs(teeth) / math.cos(math.radians(helix_deg))


def module_mm_of(gear: GearBodyTable, written: float | None, common: float | None, helix_deg: float) -> float:
    """Return the normal module of a gear (mm): that of its pitch diameter, or one that differs by rounding alone.

    Parameters
    ----------
    gear : GearBodyTable
        The gear.
    written : float, optional
        Module that its tables give (mm).
    common : float, optional
        Module of the gears that mesh with it (mm), see `common_module_mm`.
    helix_deg : float
        Its helix angle (deg).
    """
    if gear.pitch_diameter_mm is None:
        return given(written, "module_mm")
    teeth = transverse_teeth(gear.teeth, helix_deg)
    diameter = abs(gear.pitch_diameter_mm)
    implied, module = diameter / teeth, common if written is None else written
    if module is None or abs(implied - module) <= SAME * module:
        return implied
    return module if abs(module * teeth - diameter) <= ROUNDING_MM else implied


def common_module_mm(gears: Iterable[GearBodyTable], helix_deg: float) -> float | None:
    """Return the normal module (mm) that one of the meshing gears gives, or that of their pitch diameters.

    `helix_deg` is their helix angle (deg).
    """
    gears = list(gears)
    if named := [gear.module_mm for gear in gears if gear.module_mm is not None]:
        return named[0]
    diameters = [abs(gear.pitch_diameter_mm) for gear in gears if gear.pitch_diameter_mm is not None]
    if len(diameters) < len(gears):
        return None
    return sum(diameters) / transverse_teeth(sum(abs(gear.teeth) for gear in gears), helix_deg)


def magnitude(distance_mm: float | None, internal: bool, where: str) -> float | None:
    """Return the magnitude of a centre distance (mm), which may have the minus sign of an internal pair alone.

    Raises
    ------
    InputError
        For 0 and for the negative distance of external gears.
    """
    if distance_mm is None:
        return None
    if distance_mm == 0.0 or (distance_mm < 0.0 and not internal):
        problem = "must be > 0; a negative one is of an internal pair, by ISO 21771"
        raise InputError(f"{where}.centre_distance_mm", distance_mm, problem, "correct it, or leave it out")
    return abs(distance_mm)


@dataclass(frozen=True)
class GearTable(GearBodyTable):
    """One gear of [pair]."""

    y_mm: float = quantity(0.0, doc="y of its middle plane (mm), along the axes, towards the viewer of the section")
    material: MaterialTable | None = quantity(None, doc="material of this gear, if not the shared one")  # noqa: RUF009


@dataclass(frozen=True)
class PairTable(ToothFormTable):
    """Shorthand for two gears, pinion and wheel, and their mesh.

    Shared keys stand here, those of one gear in [pair.pinion] and [pair.wheel], [pair.material] is of both.
    """

    pinion: GearTable = quantity(doc="the driving gear")  # noqa: RUF009
    wheel: GearTable = quantity(doc="the driven gear")  # noqa: RUF009
    centre_distance_mm: float | None = quantity(
        None,
        doc="centre distance (mm), with or without the minus sign of an internal pair; without it, from the profile "
        "shifts without backlash",
    )
    misalignment_um: float = quantity(
        0.0, doc="tilt of the axes in the plane of action (um over the common face width), > 0: closes larger y"
    )
    misalignment_across_um: float = quantity(
        0.0,
        doc="tilt of the axes across the plane of action (um over the common face width); > 0: towards larger y "
        "the driven gear moves to the left of the force on it",
    )
    material: MaterialTable = quantity(MaterialTable, doc="material of both gears")  # noqa: RUF009

    def tooth_form(self, side: str) -> dict[str, Any]:
        """Keys of the tooth form of the gear `side` ("pinion" or "wheel"), shared values and defaults filled in."""
        return tooth_form(getattr(self, side), self)

    def module_mm_of(self, side: str) -> float:
        """Module of the gear `side` (mm), from its own pitch diameter or module, or from the shared module."""
        own: GearTable = getattr(self, side)
        written = own.module_mm if own.module_mm is not None else self.module_mm
        helix_deg = self.tooth_form(side)["helix_angle_deg"]
        return module_mm_of(own, written, common_module_mm((self.pinion, self.wheel), helix_deg), helix_deg)

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that are missing or contradict each other."""
        self._check_shifts(where)
        for side in ("pinion", "wheel"):
            check_gear(getattr(self, side), f"{where}.{side}", self, where)
        magnitude(self.centre_distance_mm, self.pinion.internal or self.wheel.internal, where)

    def _check_shifts(self, where: str) -> None:
        """Raise `InputError` unless at most one profile shift follows from a centre distance, which is given then."""
        sides = [side for side in ("pinion", "wheel") if self.tooth_form(side)["profile_shift"] == FROM_DISTANCE]
        if not sides:
            return
        own = getattr(self, sides[-1]).profile_shift is not None
        label = f"{where}.{sides[-1]}.profile_shift" if own else f"{where}.profile_shift"
        if len(sides) == 2:
            problem = "is written for both gears: a centre distance gives the sum of their profile shifts alone"
            raise InputError(label, FROM_DISTANCE, problem, "write the number of one of them")
        if self.centre_distance_mm is None:
            cure = f"add {where}.centre_distance_mm, or write a number"
            raise InputError(label, FROM_DISTANCE, "needs a centre distance", cure)


#: Law that holds where none is named.
DEFAULT_LAW = "half_plane"
#: Name -> "module:class" of the laws of this package.
LAWS: dict[str, str] = {
    "half_plane": "gearfe.gears.contact.laws:HalfPlane",
    "nitsche": "gearfe.gears.contact.laws:Nitsche",
    "penalty": "gearfe.gears.contact.laws:Penalty",
}
#: Group of entry points in which other packages name theirs.
GROUP = "gearfe.laws"
#: Names of laws that were, and what to write instead.
REMOVED = {"exact": ("is gone", "use half_plane")}


def known_laws() -> dict[str, str]:
    """Name -> "module:class" of all laws, those of other packages included; none takes the name of one of these."""
    from importlib import metadata  # which takes longer to load than a file to read

    return {point.name: point.value for point in metadata.entry_points(group=GROUP)} | LAWS


def check_law(label: str, name: str) -> None:
    """Raise `InputError` unless there is a law called `name`; `label` names the key or option in the message."""
    if name in LAWS:
        return
    if name in REMOVED:
        raise InputError(label, name, *REMOVED[name])
    known = known_laws()
    if name not in known:
        problem = "must be one of " + ", ".join([*LAWS, *sorted(known.keys() - LAWS)])
        raise InputError(label, name, problem, nearest(name, known))


#: More positions than this are a slip of the keyboard.
MOST_POSITIONS = 100_000


#: Beyond these angles rounding is more than 1e-10 deg.
FAR_DEG = 1e6

#: Finest flank elements, in default ones: some 1,200 on a flank, whose compliances take gigabytes.
FINEST = 0.1


def check_flank_coarsen(coarsen: float, flank_coarsen: float, field: str) -> None:
    """Raise `InputError` unless the flanks' elements are within the range that is known to work."""
    least = max(FINEST, FINEST / coarsen)
    if not least * (1 - 1e-12) <= flank_coarsen <= 10.0:
        problem = f"must be >= {least:g} with coarsen {coarsen:g}, and <= 10"
        raise InputError(field, flank_coarsen, problem, "1 leaves the flanks to coarsen")


#: Keys of [stiffness] that give its load, at most one of them.
LOADS = ("twist_deg", "torque_Nm", "torque_pinion_Nm")


@dataclass(frozen=True)
class StiffnessTable:
    """Load, positions, model and mesh of a rotation sweep."""

    #: Keys that were: what became of them, and what to write instead.
    REMOVED: ClassVar[dict[str, tuple[str, str]]] = {
        "route": (
            "is gone: one law answers every load",
            'leave it out; law = "half_plane" (the default) needs no mesh that resolves the contact',
        ),
        "law_sides": (
            "is gone: the law fixes the flanks that it is integrated on (nitsche both, penalty the nearer tip's)",
            "leave it out; other sides are in Python: gearfe.gears.contact.laws",
        ),
        "nitsche_theta": (
            "is gone: theta is 0",
            "leave it out",
        ),
    }

    twist_deg: float | None = quantity(
        None, doc="twist of the wheel against the pinion (deg), or give torque_Nm", above=0.0, below=36.0
    )
    torque_Nm: float | None = quantity(None, doc="torque at the wheel's hub (N m), or give twist_deg", above=0.0)
    torque_pinion_Nm: float | None = quantity(
        None, doc="torque at the hub of the pinion, the driver (N m); torque_Nm is this times z2/z1", above=0.0
    )
    twist_from: Literal["contact", "centred"] = quantity(
        "contact",
        doc="reference of twist_deg: contact (unmodified driving flanks touch) or centred (pinion tooth in the "
        "middle of a wheel space, half the backlash on either side)",
        choices=("contact", "centred"),
    )
    angle_start_deg: float = quantity(0.0, doc="first pinion angle (deg)", low=-FAR_DEG, high=FAR_DEG)
    angle_step_deg: float = quantity(1.0, doc="step of the pinion angle (deg)", above=0.0)
    angle_stop_deg: float | None = quantity(
        None, doc="last pinion angle (deg); without it, one mesh cycle", low=-FAR_DEG, high=FAR_DEG
    )
    plane: Literal["strain", "stress"] = quantity(
        "strain", doc="plane strain or plane stress", choices=("strain", "stress")
    )
    law: str = quantity(
        DEFAULT_LAW,
        doc="contact law: half_plane (every load), nitsche or penalty (on the flanks' elements), or another package's",
    )
    law_parameters: dict[str, float] = quantity(  # noqa: RUF009
        dict, doc="parameters of a law of another package, by name (in its own units)"
    )
    kinematics: Literal["small", "finite"] = quantity(
        "finite",
        doc="small (small strain) or finite (with the first-order effect of finite strain on the torque)",
        choices=("small", "finite"),
    )
    nitsche_gamma0: float | None = quantity(
        None, doc="parameter of the law nitsche, gamma h/E (-); left out: 1, the most accurate", low=1e-6, high=1e9
    )
    penalty_stiffness_N_per_mm3: float | None = quantity(
        None,
        doc="parameter of the law penalty (N/mm3), by default 300 E/h with the flank's largest element h",
        low=1e3,
        high=1e13,
    )
    points_per_edge: int = quantity(4, doc="contact points on each element edge of a flank", low=2, high=10)
    coarsen: float = quantity(
        1.0, doc="factor on all element sizes; 2 is faster and two to four times less accurate", low=0.2, high=5.0
    )
    flank_coarsen: float = quantity(
        1.0, doc="factor on the element sizes of the driving flanks, in addition to coarsen", low=0.1, high=10.0
    )
    solve_all: bool = quantity(False, doc="true: also solve positions that differ by whole mesh cycles")
    interpolation: str = quantity(
        "cubic", doc="interpolation between the positions: cubic (monotone) or linear", choices=("cubic", "linear")
    )

    def at_wheel(self, ratio: float) -> StiffnessTable:
        """Return the table with the torque at the wheel; `ratio` is z2/z1."""
        if self.torque_pinion_Nm is None:
            return self
        return replace(self, torque_Nm=ratio * self.torque_pinion_Nm, torque_pinion_Nm=None)

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that contradict each other."""
        found = [key for key in LOADS if getattr(self, key) is not None]
        if len(found) > 1:
            problem = f"conflicts with {found[0]}"
            raise InputError(f"{where}.{found[1]}", getattr(self, found[1]), problem, "leave one of them out")
        check_flank_coarsen(self.coarsen, self.flank_coarsen, f"{where}.flank_coarsen")
        check_law(f"{where}.law", self.law)
        if self.angle_stop_deg is not None and self.angle_stop_deg < self.angle_start_deg:
            problem = f"must be >= angle_start_deg = {self.angle_start_deg:g}"
            raise InputError(f"{where}.angle_stop_deg", self.angle_stop_deg, problem, "swap them")

    def angles_deg(self, mesh_cycle_deg: float) -> list[float]:
        """Pinion angles (deg), the last one included.

        Raises
        ------
        InputError
            For steps that make more than `MOST_POSITIONS`.
        """
        start, step, stop = self.angle_start_deg, self.angle_step_deg, self.angle_stop_deg
        if (mesh_cycle_deg if stop is None else stop - start) / step > MOST_POSITIONS:
            problem = f"makes more than {MOST_POSITIONS} positions"
            raise InputError("stiffness.angle_step_deg", step, problem, "use a larger step")
        if stop is None:
            count = max(1, round(mesh_cycle_deg / step))
            return [start + mesh_cycle_deg * i / count for i in range(count)]
        return [start + step * i for i in range(int((stop - start) / step + 1e-9) + 1)]
