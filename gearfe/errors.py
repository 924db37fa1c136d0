"""Errors that a user can mend: each names the field, the value, what is allowed and the cure."""

from __future__ import annotations

import difflib
import math
import reprlib
from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")

#: Characters of a text, digits of a whole number and entries of a list that a message shows.
LONGEST_TEXT, MOST_DIGITS, MOST_ENTRIES = 80, 18, 6


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
    """

    def __init__(self, field: str, value: object, problem: str, cure: str = "") -> None:
        self.field, self.value, self.problem, self.cure = field, value, problem, cure
        given = "" if value is None else f" = {shown(value)}"
        super().__init__(f"{field}{given}: {problem}" + (f"; {cure}" if cure else ""))

    def __reduce__(self) -> tuple[object, ...]:
        return (InputError, (self.field, self.value, self.problem, self.cure))


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


class MissingLibraryError(RuntimeError):
    """A system library or optional package is absent; the message says how to install it."""


def unknown_name(field: str, name: str, known: Iterable[str]) -> InputError:
    """Error for a name that does not exist, with the nearest one that does."""
    choices = sorted(known)
    return InputError(field, None, f"unknown name {shown(name)}", nearest(name, choices) or listed(choices))


def nearest(name: str, choices: Iterable[str]) -> str:
    """Question for the known name that is nearest to a wrong one; empty when none is near."""
    near = difflib.get_close_matches(name[:LONGEST_TEXT], choices, n=1)
    return f"did you mean {near[0]!r}?" if near else ""


def listed(choices: Iterable[str]) -> str:
    """The known names."""
    return "known names: " + (", ".join(choices) or "none")
