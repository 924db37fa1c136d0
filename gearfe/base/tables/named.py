"""Tables by name: [gears.NAME], [meshes.NAME], [shafts.NAME], [bearings.NAME], [carriers.NAME], [machines.NAME], ...

The tables of a pair ([pair], [microgeometry]) and the lists of a train ([[train.gears]], ...) are shorthand for these.
`gearfe.base.tables.gearbox` makes one form of either.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..config import quantity
from ..errors import InputError
from .bearing import BearingTable
from .loadmap import LoadMapTable
from .microgeometry import GearMicrogeometryTable
from .pair import GearBodyTable, MaterialTable, StiffnessTable, check_gear
from .train import ShaftTable, TrainMeshTable


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
            raise InputError(f"{where}.y_mm", None, "is required with shaft", "add it, or leave out both")


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
        doc="tilt of the axes across the plane of action (um over the common face width); > 0: towards larger y "
        "the driven gear moves to the left of the force on it",
    )
    misalignment_from_shafts: bool = quantity(
        False,
        doc="true: gearfe stiffness and gearfe loadmap add the tilts of the gears by shafts, bearings and housing "
        "of the train under the torque",
    )
    stiffness: StiffnessTable | None = quantity(  # noqa: RUF009
        None, doc="keys of this mesh that override those of [stiffness]: load, positions, contact law, sizes"
    )
    loadmap: LoadMapTable | None = quantity(  # noqa: RUF009
        None, doc="keys of this mesh that override those of [loadmap]: torques and angles"
    )


@dataclass(frozen=True)
class NamedShaftTable(ShaftTable):
    """A shaft; what carries it are its bearings, or attachments of the housing that hold it as hinges."""

    attachments: tuple[int | str, ...] = quantity((), doc="attachments of the housing that carry it in rigid bearings")


@dataclass(frozen=True)
class _BearingPlace:
    """Position of a bearing."""

    shaft: str = quantity(doc="name of the shaft that it carries")
    attachment: int | str | None = quantity(None, doc="bore (attachment) of the housing; left out: the bearing's name")
    y_mm: float | None = quantity(None, doc="its place along the shaft (mm), in a rigid housing without [housing]")


@dataclass(frozen=True)
class NamedBearingTable(BearingTable, _BearingPlace):
    """A bearing between a shaft and a bore of the housing: a hinge, springs and dampers, or a rolling bearing."""
