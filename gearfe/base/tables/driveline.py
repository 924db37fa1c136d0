"""Machines on the shafts of a train, and couplings between shafts: [machines.NAME], [couplings.NAME]."""

from __future__ import annotations

from dataclasses import dataclass

from ..config import quantity
from ..errors import InputError


@dataclass(frozen=True)
class _Spring:
    """A torsional spring with its damper."""

    stiffness_Nm_per_rad: float = quantity(above=0.0, doc="torsional stiffness (N m/rad)")
    damping_Nm_s_per_rad: float = quantity(0.0, low=0.0, doc="of the parallel damper (N m s/rad)")


@dataclass(frozen=True)
class _MachinePlace:
    """Data and position of a machine."""

    shaft: str = quantity(doc="name of the shaft that it is coupled to")
    y_mm: float | None = quantity(
        None, doc="position on an elastic shaft where it is coupled (mm), required there; without effect on a rigid one"
    )
    inertia_kg_m2: float = quantity(above=0.0, doc="inertia of its rotor about the axis (kg m2)")
    initial_speed_rad_per_s: float | None = quantity(
        None, doc="speed at the start (rad/s); left out: rolling with the drive"
    )


@dataclass(frozen=True)
class MachineTable(_Spring, _MachinePlace):
    """A motor or a driven machine: an inertia on a torsional spring at a shaft."""


@dataclass(frozen=True)
class _CoupledShafts:
    """The shafts of a coupling."""

    shafts: tuple[str, str] = quantity(doc="names of the two shafts, which lie on one axis and turn alike")

    def check(self, where: str) -> None:
        """A coupling joins two shafts."""
        if self.shafts[0] == self.shafts[1]:
            problem = "names one shaft twice"
            raise InputError(f"{where}.shafts", list(self.shafts), problem, "a coupling joins two shafts")


@dataclass(frozen=True)
class CouplingTable(_Spring, _CoupledShafts):
    """A torsional spring between two shafts on one axis."""


@dataclass(frozen=True)
class _Named:
    """Name of an entry of a list."""

    name: str = quantity(doc="name, used in the names of columns")


@dataclass(frozen=True)
class TrainMachineTable(MachineTable, _Named):
    """A machine with its name."""


@dataclass(frozen=True)
class TrainCouplingTable(CouplingTable, _Named):
    """A coupling with its name."""
