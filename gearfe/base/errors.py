"""Errors that a user can fix: each names the field, the value, what is allowed and the cure."""

from __future__ import annotations

import difflib
import math
import re
import reprlib
from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")

#: Characters of a text, digits of a whole number and entries of a list that a message shows.
LONGEST_TEXT, MOST_DIGITS, MOST_ENTRIES = 80, 18, 6
#: Characters of a word (a path, say) and of a whole message.
LONGEST_WORD, LONGEST_MESSAGE = 200, 2000

#: Words in names of gear jobs that no table knows -> what is out of scope, and what there is instead.
OUT_OF_SCOPE: dict[str, tuple[str, str]] = {
    r"herringbone|double_helical": ("double helical gears", "spur gears and single helices only"),
    r"transverse_(module|pressure)|^m_?t(_|$)|alpha_?t":
        ("data of the transverse section", "spur gears and helical ones by their normal section only"),
    r"overlap_ratio|contact_ratio": ("results as keys", "gearfe gear prints the ratios of spur and helical gears"),
    r"internal|(^|_)ring(_|$)|annulus":
        ("internal gears by this name", "those among spur gears and helical gears have a negative number of teeth"),
    r"planet|carrier|sun(_|$)|epicyclic":
        ("planetary gears by this name", "[carriers.NAME] has planets, of spur gears or helical ones, and shafts name "
         "it as carrier"),
    r"bevel|hypoid|cone_(angle|dist)|pitch_cone|miter|spiral|^zerol": ("bevel gears", "spur gears only"),
    r"worm|lead_angle": ("worm gears", "spur gears only"),
    r"crossed|(shaft|axis|axes)_angle|non_parallel": ("shafts that are not parallel", "spur gears only"),
    r"asymmetric|(drive|coast)_(side_)?(pressure|flank|angle)": ("asymmetric teeth", "symmetric spur gears only"),
    r"cyclo|circular_arc|novikov|beveloid|tooth_(form|profile)|profile_type|non_?involute":
        ("teeth of another form", "involute spur gears only"),
    r"^rack(_gear)?$|^spline|face_gear|crown_gear": ("racks, splines and face gears", "pairs of spur gears only"),
    r"temperature|thermal|heat|conductiv|expansion": ("temperatures", "elastic spur gears without heat only"),
    r"yield|plastic|creep|hardening|damage|fatigue|wear":
        ("materials that yield, creep or wear", "spur gears of linear elastic material only"),
    r"(web|hub|spoke)_|rim_(?!diameter)":
        ("webs and rims by this name", "those of spur gears and helical gears are web_width_mm, web_outer_diameter_mm, "
         "web_inner_diameter_mm and web_offset_mm, of internal ones rim_diameter_mm"),
    r"^crown|^lead_|barrel|face_load|flank_line|parallelism|slope_deviation":
        ("modifications along the face width by this name", "those of spur gears and helical gears are "
         "helix_crowning_um, helix_slope_um, end_relief_low_um in [microgeometry], and misalignment_um in [pair]"),
    r"tors\w*_stiff|stiff\w*_tors|bending_stiff|(elastic|flexible|compliant)_shaft|shaft_(stiff|elastic|compl|flex)|"
    r"shear_modulus":
        ("stiffnesses of elastic shafts", "they follow from the sections and the material of a shaft with spur gears"),
}  # fmt: skip
#: Tables of gear jobs.
GEAR_TABLES = (
    *("pair", "stiffness", "loadmap", "microgeometry", "train", "runup", "modes"),
    *("gears", "meshes", "shafts", "bearings", "materials"),
)


class _Short(reprlib.Repr):
    """Format values for a message: long ones are cut, huge ones given by their power of ten."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = LONGEST_TEXT
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = MOST_ENTRIES
        self.maxlevel = 3

    def repr_int(self, x: int, level: int) -> str:  # noqa: ARG002 - the base class calls it so
        """A whole number; Python itself refuses to write those of more than some thousand digits."""
        if abs(x) < 10**MOST_DIGITS:
            return repr(x)
        power = math.floor(math.log10(abs(x)))
        return f"{'-' if x < 0 else ''}{10 ** (math.log10(abs(x)) - power):.3f}e+{power}"


def shown(value: object) -> str:
    """Text of a value for a message, never longer than a line or two."""
    return _Short().repr(value)


def cut(text: str) -> str:
    """Text of a message whose longest words, and the whole, are cut in the middle."""
    half = LONGEST_WORD // 2 - 2
    text = re.sub(rf"\S{{{LONGEST_WORD},}}", lambda word: f"{word[0][:half]}...{word[0][-half:]}", text)
    half = LONGEST_MESSAGE // 2
    return text if len(text) <= LONGEST_MESSAGE else f"{text[:half]} ... {text[-half:]}"


class InputError(ValueError):
    """Report a request that cannot be met; the message gives the wrong value and its cure.

    Parameters
    ----------
    field
        Name of the key or argument, as the user wrote it (``pair.pinion.teeth``).
    value
        The offending value; ``None`` when the fault is that there is none.
    problem
        What is wrong, with the allowed range.
    cure
        What the user can do about it.
    limit
        Sign, bound and unit of the value, as ``("<", 1.5, "")``, where `problem` leaves them out. The bound can then be
        stated in the quantity that the user wrote.
    """

    def __init__(
        self, field: str, value: object, problem: str, cure: str = "", limit: tuple[str, float, str] | None = None
    ) -> None:
        self.reason, self.limit = problem, limit
        if limit is not None:
            problem = f"{problem}: must be {limit[0]} {limit[1]:.5g} {limit[2]}".rstrip()
        self.field, self.value, self.problem, self.cure = field, value, problem, cure
        given = "" if value is None else f" = {shown(value)}"
        super().__init__(cut(f"{field}{given}: {problem}" + (f"; {cure}" if cure else "")))

    def __reduce__(self) -> tuple[object, ...]:
        return (InputError, (self.field, self.value, self.reason, self.cure, self.limit))


def given(value: T | None, field: str) -> T:
    """The value of an optional key that other keys make necessary.

    Raises
    ------
    InputError
        Where it is missing.
    """
    if value is None:
        raise InputError(field, None, "is required here", "add it")
    return value


class NotFiniteWarning(UserWarning):
    """A table that was written holds numbers that are infinite, or none where there must be one."""


class UnitWarning(UserWarning):
    """A value is likely in another unit than that of its argument."""


class MissingLibraryError(RuntimeError):
    """A system library or optional package is absent; the message says how to install it."""


def unknown_name(field: str, name: str, known: Iterable[str]) -> InputError:
    """Error for a name that does not exist, with the nearest one that does."""
    choices = sorted(known)
    return InputError(field, None, f"unknown name {shown(name)}", nearest(name, choices) or listed(choices))


def unknown_key(where: str, key: str, value: object, known: Iterable[str], *, field: str = "") -> InputError:
    """Return the error for an unknown key or table of a job. Gear jobs name what is out of scope.

    Parameters
    ----------
    where : str
        Table, or nothing for a table of the file.
    key : str
        Its unknown key.
    value : object
        Value of the key.
    known : iterable of str
        Keys that exist.
    field : str
        What an unknown name is reported of, by default the table.
    """
    if field or re.split(r"\W", where, maxsplit=1)[0] in GEAR_TABLES:
        for words, (what, only) in OUT_OF_SCOPE.items():
            if re.search(words, key[:LONGEST_TEXT].lower()):
                given = None if isinstance(value, (dict, list)) else value
                problem = f"{what} are not supported: {only}"
                return InputError(f"{where}.{key}" if where else f"[{key}]", given, problem, "leave it out")
        if meant := _symbol(key, known):
            return InputError(field or where, None, f"unknown name {shown(key)}", meant)
    return unknown_name(field or where or "job file", key, known)


#: Names of other programs and of textbooks -> those of expressions here.
SYNONYMS = {
    **dict.fromkeys(("revolute", "pin", "pivot", "rotational"), "hinge"),
    **dict.fromkeys(("slider", "translational", "sliding", "prism"), "prismatic"),
    **dict.fromkeys(("weld", "welded", "rigid", "clamp"), "fixed"),
    **dict.fromkeys(("motor", "actuator", "drive", "driver"), "prescribed"),
    **dict.fromkeys(("rod", "link", "bar"), "distance"),
    **dict.fromkeys(("theta", "phi", "alpha", "beta", "psi", "rotation", "rot"), "angle"),
    **dict.fromkeys(("omega", "w", "angular_velocity", "thetadot", "theta_dot", "phidot", "phi_dot"), "rate"),
    **{
        "tutorial": "undamped_springs",  # variant of the shipped train, by what it is
        "t": "time",
        "ln": "log",
        "fabs": "abs",
        "arcsin": "asin",
        "arccos": "acos",
        "arctan": "atan",
        "arctan2": "atan2",
    },
}


#: Symbols of gear technology (ISO 21771, ISO 6336) and other names -> keys of gear jobs; units at the end do not count.
SYMBOLS = {
    **dict.fromkeys(("z", "number_of_teeth", "teeth_number", "teeth_count", "n_teeth"), "teeth"),
    **dict.fromkeys(("m", "mn", "m_n", "modul", "normal_module", "diametral_pitch", "dp"), "module_mm"),
    **dict.fromkeys(("alpha", "alpha_n", "alphan", "phi", "normal_pressure_angle"), "pressure_angle_deg"),
    **dict.fromkeys(("beta", "helix", "helical", "skew"), "helix_angle_deg"),
    **dict.fromkeys(("hand", "helix_direction", "hand_of_helix"), "helix_hand"),
    **dict.fromkeys(("b", "width", "facewidth"), "face_width_mm"),
    **dict.fromkeys(("x", "addendum_modification", "shift"), "profile_shift"),
    **dict.fromkeys(("a", "a_w", "aw", "axis_distance", "shaft_distance"), "centre_distance_mm"),
    **dict.fromkeys(("d", "pitch_circle", "reference_diameter"), "pitch_diameter_mm"),
    **dict.fromkeys(("d_a", "da", "outer_diameter", "outside_diameter"), "tip_diameter_mm"),
    **dict.fromkeys(("d_f", "df"), "root_diameter_mm"),
    **dict.fromkeys(("d_b", "hole_diameter", "inner_diameter", "shaft_diameter"), "bore_diameter_mm"),
    **dict.fromkeys(("h_a", "ha", "h_ap"), "addendum"),
    **dict.fromkeys(("h_f", "hf", "h_fp"), "dedendum"),
    **dict.fromkeys(("rho_f", "rho_fp", "tip_radius_of_rack"), "rack_tip_radius"),
    **dict.fromkeys(("e", "elastic_modulus", "young"), "youngs_modulus_GPa"),
    **dict.fromkeys(("nu", "poisson", "ny"), "poisson_ratio"),
    "rho": "density_kg_per_m3",
    **dict.fromkeys(("t", "moment", "load"), "torque_Nm"),
    **dict.fromkeys(("omega", "n", "rpm", "speed_rpm"), "speed_rad_per_s"),
}
_UNIT = re.compile(r"_(mm|um|m|deg|rad|[gmk]?pa|nm?|knm|nmm|rpm|per_inch|(t|k?g)_per_[cm]?m3)$")


def _symbol(key: str, known: Iterable[str]) -> str:
    """Question for the key that a symbol of gear technology stands for, with or without a unit or number."""
    stem = _UNIT.sub("", key.lower())
    meant = SYMBOLS.get(key.lower()) or SYMBOLS.get(stem) or SYMBOLS.get(stem.rstrip("_12"))
    return f"did you mean {meant!r}?" if meant in set(known) else ""


def nearest(name: str, choices: Iterable[str]) -> str:
    """Return a question with the known name that matches a wrong one best; empty if none does."""
    choices = list(choices)
    meant = [choice for choice in choices if choice.partition("(")[0] == SYNONYMS.get(name.lower())]
    if meant:
        return f"did you mean {meant[0]!r}?"
    near = difflib.get_close_matches(name[:LONGEST_TEXT], choices, n=1)
    return f"did you mean {near[0]!r}?" if near else ""


def listed(choices: Iterable[str]) -> str:
    """The known names."""
    return "known names: " + (", ".join(choices) or "none")
