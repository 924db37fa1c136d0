"""Layout of a gear train: what its kinematics follow from, as values.

Trains that differ in stiffness, damping, friction or housing only have equal layouts, and so the same kinematics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from ...base.typing import Array
from ...multibody.series.timefunctions import TimeFunction

T = TypeVar("T", float, Array)

#: Pitch errors of the left and of the right flanks of a gear (m), one a tooth, or none.
PitchErrors = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True)
class LayoutGear:
    """A gear as kinematics see it.

    Attributes
    ----------
    name
        Of the gear.
    shaft
        Number of its shaft.
    teeth
        Their number, negative of an internal gear.
    base_radius
        Radius of the base circle (m).
    pitch_errors
        See `gearfe.drivetrain.train.ShaftGear`.
    """

    name: str
    shaft: int
    teeth: int
    base_radius: float
    pitch_errors: PitchErrors = ((), ())


@dataclass(frozen=True)
class LayoutMesh:
    """A gear mesh as kinematics see it.

    Attributes
    ----------
    name
        Of the mesh.
    driver, driven
        The gears, of an internal pair the external gear first.
    towards
        Angle (rad) of the line from the driver's axis to the pitch point, from the train's first direction e1.
    distance
        Of the axes (m).
    contact_twist
        Half the backlash as a twist of the driven gear (rad).
    phase
        Given angle of the gear that drives at the start (rad), or None.
    carrier
        Number of the shaft that carries the axis of one of the gears; None: both axes are fixed.
    ring_drives
        Whether the internal gear, `driven`, drives.
    """

    name: str
    driver: LayoutGear
    driven: LayoutGear
    towards: float
    distance: float
    contact_twist: float
    phase: float | None
    carrier: int | None = None
    ring_drives: bool = False

    @property
    def driving(self) -> LayoutGear:
        """The gear that drives."""
        return self.driven if self.ring_drives else self.driver

    @property
    def turns_alike(self) -> bool:
        """Whether both gears turn in one sense: one of them is internal."""
        return self.driver.teeth * self.driven.teeth < 0

    def mate_phase(self, phase: T, *, of_ring: bool = True) -> T:
        """Return the phase (rad) of one gear of an internal pair for that of the other.

        Parameters
        ----------
        phase
            Rotation of a gear past a tooth on the line of centres, in the sense in which it pushes (rad).
        of_ring
            Whether that gear is the internal one; else it is the external one.
        """
        z1, z2 = self.driver.teeth, abs(self.driven.teeth)
        known, sought = (z2, z1) if of_ring else (z1, z2)
        return (math.pi + z2 * self.contact_twist - known * phase) / sought


@dataclass(frozen=True)
class LayoutCarrier:
    """A carrier with its planets as kinematics see it.

    Attributes
    ----------
    name
        Of the carrier.
    shaft
        Number of the shaft that it is.
    sets
        Sets of planets that are alike: (number of its shaft, angle about the carrier's axis in rad) of each planet.
    """

    name: str
    shaft: int
    sets: tuple[tuple[tuple[int, float], ...], ...]


@dataclass(frozen=True)
class TrainLayout:
    """Shafts, gears and meshes of a train with its drive and its loads.

    Attributes
    ----------
    shafts
        Their names.
    driven
        Number of the shaft that the drive turns.
    speed
        Of the drive (rad/s) over time.
    gears, meshes
        Of the train, in its order.
    loads
        Pairs (number of a shaft, torque over time in N m).
    couplings
        Pairs of numbers of shafts on one axis that turn alike.
    guided
        Pairs (number of a shaft, its speed over that of the drive) of shafts whose rotation is prescribed; 0: fixed.
    carriers
        Of the train.
    """

    shafts: tuple[str, ...]
    driven: int
    speed: TimeFunction
    gears: tuple[LayoutGear, ...]
    meshes: tuple[LayoutMesh, ...]
    loads: tuple[tuple[int, TimeFunction], ...]
    couplings: tuple[tuple[int, int], ...] = ()
    guided: tuple[tuple[int, Fraction], ...] = ()
    carriers: tuple[LayoutCarrier, ...] = ()
