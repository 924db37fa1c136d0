"""Tables by name: [gears.NAME], [meshes.NAME], [shafts.NAME], [bearings.NAME], [carriers.NAME], [machines.NAME], ...

The tables of a pair ([pair], [microgeometry]) and the lists of a train ([[train.gears]], ...) are shorthand for these.
`gearfe.base.tables.gearbox` makes one form of either.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..config import build, quantity
from ..errors import InputError
from .bearing import BearingTable
from .carrier import CarrierTable
from .driveline import CouplingTable, MachineTable
from .loadmap import LoadMapTable
from .microgeometry import GearMicrogeometryTable
from .pair import GearBodyTable, MaterialTable, StiffnessTable, check_gear
from .train import ShaftTable, TrainMeshTable

#: Letters, digits, _ and -: names become parts of column names, and of files and folders.
_NAME = re.compile(r"[^\W_][\w-]*")
#: Most characters of a name that is a folder's.
LONGEST = 80
#: Names of devices on Windows, which no folder can have.
_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{digit}" for port in ("com", "lpt") for digit in range(1, 10))}


@dataclass(frozen=True)
class NamedGearTable(GearBodyTable):
    """One gear: its teeth, its material, the deviations of its flanks, and where it is on a shaft."""

    material: str | MaterialTable | None = quantity(  # noqa: RUF009
        None, doc="name of a material of [materials.NAME], or a table of its constants; left out: steel"
    )
    microgeometry: GearMicrogeometryTable | None = quantity(  # noqa: RUF009
        None, doc="deviations of its flanks"
    )
    shaft: str | None = quantity(None, doc="name of the one shaft that carries it")
    y_mm: float | None = quantity(None, doc="y of its middle plane (mm), along the axes; on no shaft, by default 0")

    def check(self, where: str) -> None:
        """Raise `InputError` for keys that are missing or contradict each other."""
        check_gear(self, where)
        if self.shaft is not None and self.y_mm is None:
            raise InputError(f"{where}.y_mm", None, "is required beside shaft", "add it, or leave out both")


@dataclass(frozen=True)
class NamedMeshTable(TrainMeshTable):
    """Two gears in mesh: how they stand, what loads them, and what the mesh is made of in a train."""

    flank: str = quantity("left", doc="the driving flanks of both gears: left or right", choices=("left", "right"))
    tolerance_class: int | None = quantity(
        None, doc="class of ISO 1328-1 whose profile tolerances the picture of the flanks shows", low=1, high=11
    )
    misalignment_um: float = quantity(
        0.0, doc="tilt of the axes in the plane of action (um over the common face width), > 0: closes larger y"
    )
    misalignment_across_um: float = quantity(
        0.0,
        doc="tilt of the axes across the plane of action (um over the common face width), > 0: the driven gear "
        "moves to the left of the force on it towards larger y",
    )
    misalignment_from_shafts: bool = quantity(
        False,
        doc="true: shafts, bearings and housing of the train tilt the gears as the torque bends them, beside the "
        "tilts above; for gearfe stiffness and gearfe loadmap",
    )
    stiffness: StiffnessTable | None = quantity(  # noqa: RUF009
        None, doc="keys of this mesh that win over those of [stiffness]: load, positions, contact law, sizes"
    )
    loadmap: LoadMapTable | None = quantity(  # noqa: RUF009
        None, doc="keys of this mesh that win over those of [loadmap]: torques and angles"
    )


@dataclass(frozen=True)
class NamedShaftTable(ShaftTable):
    """A shaft; what carries it are its bearings, or attachments of the housing that hold it as hinges."""

    attachments: tuple[int | str, ...] = quantity((), doc="attachments of the housing that carry it as hinges")


@dataclass(frozen=True)
class _BearingPlace:
    """Where a bearing is."""

    shaft: str = quantity(doc="name of the shaft that it carries")
    attachment: int | str | None = quantity(None, doc="bore (attachment) of the housing; left out: the bearing's name")
    y_mm: float | None = quantity(None, doc="its place along the shaft (mm), in a rigid housing without [housing]")


@dataclass(frozen=True)
class NamedBearingTable(BearingTable, _BearingPlace):
    """A bearing between a shaft and a bore of the housing: a hinge, springs and dampers, or a rolling bearing."""


#: Tables of tables -> dataclass of an entry.
NAMED: dict[str, type] = {
    "gears": NamedGearTable,
    "meshes": NamedMeshTable,
    "shafts": NamedShaftTable,
    "bearings": NamedBearingTable,
    "machines": MachineTable,
    "couplings": CouplingTable,
    "carriers": CarrierTable,
    "materials": MaterialTable,
}


def named_tables(kind: str, table: Any, *, rules: bool = True) -> dict[str, Any]:
    """Return the entries of a table of tables by name.

    Parameters
    ----------
    kind : str
        Key of `NAMED`.
    table : Any
        The parsed table.
    rules : bool
        Whether rules that join keys are checked, too.

    Raises
    ------
    InputError
        For an empty table, keys outside an entry, names with other characters than letters, digits, _ and -, names
        that differ by case only, and every mistake in an entry.
    """
    if not isinstance(table, Mapping):
        problem = "must be a table of tables"
        raise InputError(kind, table, problem, f"write [{kind}.NAME] and its keys below it, for each NAME")
    if not table:
        raise InputError(f"[{kind}]", None, "is empty", f"write at least one [{kind}.NAME], or leave it out")
    for name, entry in table.items():
        if not isinstance(entry, Mapping):
            problem = f"is in [{kind}], which has entries with names only"
            raise InputError(f"{kind}.{name}", entry, problem, f"write it below [{kind}.NAME]")
        if not _NAME.fullmatch(name):
            problem = "must have letters, digits, _ and - only, a letter or digit first: it names columns and files"
            raise InputError(f"name in [{kind}]", name, problem, f"rename it, as [{kind}.{_plain(name)}]")
        _check_twins(name, table, f"name in [{kind}]")
    return {name: build(NAMED[kind], entry, f"{kind}.{name}", rules=rules) for name, entry in table.items()}


def _check_twins(name: str, names: Iterable[str], where: str) -> None:
    """Raise `InputError` for a name that some file systems do not tell from another one."""
    twin = next((other for other in names if other != name and _folded(other) == _folded(name)), None)
    if twin is not None:
        problem = f"differs from {twin!r} by upper and lower case only"
        raise InputError(where, name, problem, "files of both would have one name: rename one")


def _folded(name: str) -> str:
    return unicodedata.normalize("NFKC", name).casefold()


def check_folders(meshes: Sequence[str]) -> None:
    """Raise `InputError` for names of meshes that cannot be those of folders, beside each other, on all systems."""
    where = "name of a mesh"
    for name in meshes:
        if not _NAME.fullmatch(name):
            problem = (
                "must have letters, digits, _ and - only, a letter or digit first: its results have a folder of it"
            )
            raise InputError(where, name, problem, f"rename it, or its gears, as {_plain(name)}")
        if len(name) > LONGEST:
            raise InputError(where, name, f"must have {LONGEST} characters or less", "rename it, or its gears")
        if name.lower() in _DEVICES:
            raise InputError(where, name, "is the name of a device on Windows, which no folder can have", "rename it")
        _check_twins(name, meshes, where)


def _plain(name: str) -> str:
    return re.sub(r"[^\w-]+", "_", name).strip("_-") or "NAME"
