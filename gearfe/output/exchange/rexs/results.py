"""Collect the results that a REXS file has attributes for, by component or by component and load case.

Geometry and accuracy belong to the component. What follows from loads and speeds is in the first load case of a load
spectrum, as other programs write it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Table of a job -> name of the data of one gear in one mesh.
GEAR_DATA = "gear_data"


@dataclass(frozen=True)
class Result:
    """One result.

    Attributes
    ----------
    table, name
        Entry of the job that it is of: ``gears``, ``meshes``, ``shafts``, ``bearings``; ``gear_data`` with the name
        ``MESH/GEAR`` for one gear in one mesh.
    attribute
        Identifier in REXS 2.0.0.
    value
        A number, or numbers of an array.
    unit
        Its unit, a name of `gearfe.output.exchange.rexs.units.UNITS`.
    loaded
        Whether it holds in one load case.
    """

    table: str
    name: str
    attribute: str
    value: float | int | bool | Sequence[float]
    unit: str = "none"
    loaded: bool = True


def gear_data(mesh: str, gear: str) -> str:
    """Return the name of the data of one gear in one mesh."""
    return f"{mesh}/{gear}"
