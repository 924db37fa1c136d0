"""Errors that a user can mend: each names the field, the value, what is allowed and the cure."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


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
        shown = "" if value is None else f" = {value!r}"
        super().__init__(f"{field}{shown}: {problem}" + (f"; {cure}" if cure else ""))

    def __reduce__(self) -> tuple[object, ...]:
        return (InputError, (self.field, self.value, self.problem, self.cure))


class MissingLibraryError(RuntimeError):
    """A system library or optional package is absent; the message says how to install it."""


def unknown_name(field: str, name: str, known: Iterable[str]) -> InputError:
    """Error for a name that does not exist, with the nearest one that does."""
    choices = sorted(known)
    near = difflib.get_close_matches(name, choices, n=1)
    cure = f"did you mean {near[0]!r}?" if near else "known names: " + ", ".join(choices)
    return InputError(field, None, f"unknown name {name!r}", cure)
