"""Errors that a user can mend: each names the field, the value, what is allowed and the cure."""

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
    r"heli(x|cal)|^beta(_|$)|skew|herringbone|overlap_ratio|normal_module|transverse_(module|pressure)":
        ("helical gears", "spur gears only"),
    r"internal|(^|_)ring(_|$)|annulus": ("internal gears", "external spur gears only"),
    r"planet|carrier|sun(_|$)|epicyclic": ("planetary gears", "spur gears on fixed shafts only"),
    r"bevel|hypoid|cone_angle|pitch_cone|miter": ("bevel gears", "spur gears only"),
    r"worm|lead_angle": ("worm gears", "spur gears only"),
    r"crown|barrel|lead_(mod|corr|dev|slope)|misalign|face_load|end_relief|flank_line|parallelism|slope_deviation":
        ("modifications and loads that vary along the face width", "spur gears only (profiles: [microgeometry])"),
    r"tors\w*_stiff|stiff\w*_tors|bending_stiff|(elastic|flexible|compliant)_shaft|shaft_(stiff|elastic|compl|flex)|"
    r"shear_modulus": ("elastic shafts", "spur gears on rigid shafts only"),
}  # fmt: skip
#: Tables of gear jobs.
GEAR_TABLES = ("pair", "stiffness", "loadmap", "microgeometry", "train", "runup")


class _Short(reprlib.Repr):
    """Values as a message shows them: what is long is cut, what is huge is given by its power of ten."""

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
    """A request that cannot be met as it stands; the message says which value is wrong and how to mend it.

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
    """Error for a key or table of a job that does not exist; of a gear job, what is out of scope is named.

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
    return unknown_name(field or where or "job file", key, known)


#: Names of other programs and of textbooks -> those of expressions here.
SYNONYMS = {
    **dict.fromkeys(("theta", "phi", "alpha", "beta", "psi", "rotation", "rot"), "angle"),
    **dict.fromkeys(("omega", "w", "angular_velocity", "thetadot", "theta_dot", "phidot", "phi_dot"), "rate"),
    **{
        "t": "time",
        "ln": "log",
        "fabs": "abs",
        "arcsin": "asin",
        "arccos": "acos",
        "arctan": "atan",
        "arctan2": "atan2",
    },
}


def nearest(name: str, choices: Iterable[str]) -> str:
    """Question for the known name that means the same as a wrong one, or is nearest to it; empty when none is."""
    choices = list(choices)
    meant = [choice for choice in choices if choice.partition("(")[0] == SYNONYMS.get(name.lower())]
    if meant:
        return f"did you mean {meant[0]!r}?"
    near = difflib.get_close_matches(name[:LONGEST_TEXT], choices, n=1)
    return f"did you mean {near[0]!r}?" if near else ""


def listed(choices: Iterable[str]) -> str:
    """The known names."""
    return "known names: " + (", ".join(choices) or "none")
