"""Which contact laws there are: their names, and where their classes stand. NumPy is not loaded for it.

A new law is one class (its contract is in `gearfe.contact.laws`) and one line: here, or for another package the entry
point ``name = "module:Class"`` in the group ``gearfe.laws``. Job files, the command line and Python then know it by its
name; its numbers are the table ``law_parameters``, the option ``--law-parameter``, the fields of the class.
"""

from __future__ import annotations

import importlib
from importlib import metadata
from typing import Any

from ..errors import InputError, nearest

#: Law that holds where none is named.
DEFAULT_LAW = "half_plane"
#: Name -> "module:class" of the laws of this package.
LAWS: dict[str, str] = {
    "half_plane": "gearfe.contact.laws:HalfPlane",
    "nitsche": "gearfe.contact.laws:Nitsche",
    "penalty": "gearfe.contact.laws:Penalty",
}
#: Group of entry points in which other packages name theirs.
GROUP = "gearfe.laws"
#: Names of laws that were, and what to write instead.
REMOVED = {"exact": ("is a law of the tests' whole-gear route alone", "use half_plane")}


def known_laws() -> dict[str, str]:
    """Name -> "module:class" of all laws, those of other packages included; none takes the name of one of these."""
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


def law_class(name: str) -> Any:
    """Class of the law called `name`."""
    check_law("law", name)
    reference = LAWS.get(name) or known_laws()[name]
    module, _, attribute = reference.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        problem = f"cannot be loaded from {reference} ({error})"
        raise InputError("law", name, problem, f"mend the package that names it in the group {GROUP}") from None
