"""Two elastic gears in mesh, and the pieces of their teeth's flanks that a position deals with.

Frames. The pinion's centre is the origin, the wheel's centre lies at (a, 0). At pinion angle 0 the pinion tooth 0 is
centred on the line of centres and a wheel space faces it; angles are counter-clockwise. Pair k joins the left flanks of
the pinion tooth k and of the wheel tooth -1 - k (tooth 0 of the wheel is the one below the line of centres then).
Places are global; displacements and forces refer to the axes of the tooth they belong to, in which compliances are
the same at every position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from ..gear.deviation import NOMINAL, ToothDeviations
from ..typing import Array
from .compliance import GearBody
from .laws import ContactLaw, HalfPlane


@dataclass(frozen=True)
class MeshingPair:
    """Two elastic gears in mesh.

    Parameters
    ----------
    pinion, wheel
        Elastic gears.
    centre_distance
        a (m).
    width
        Common face width (m).
    law
        Contact law.
    coarsen, flank_coarsen, points_per_edge
        What the meshes were asked for, see `gearfe.stiffness.sweep.elastic_pair`; for a coarser one of the same kind.
    deviations
        Of micrometres, which no mesh has.
    """

    pinion: GearBody
    wheel: GearBody
    centre_distance: float
    width: float
    law: ContactLaw
    coarsen: float = 1.0
    flank_coarsen: float = 1.0
    points_per_edge: int = 4
    deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL

    def __post_init__(self) -> None:
        check_deviations(self.deviations, self.law)
        widths = [body.width for body in self.bodies]
        if self.law.uses_stress and widths != [self.width, self.width]:
            problem = f"the gears' surface stresses are made for contacts {widths} m wide"
            raise InputError("width", self.width, problem, "make the gears with it: gear_body(..., width=...)")

    @property
    def bodies(self) -> tuple[GearBody, GearBody]:
        """Pinion and wheel."""
        return self.pinion, self.wheel

    @property
    def contact_compliances(self) -> tuple[float, float]:
        """1/E' of both gears (1/Pa); a plane body of its own face width w_i carries the load of the common width and
        counts with w/w_i.
        """
        one, two = (b.material.contact_compliance(b.plane) * self.width / b.thickness for b in self.bodies)
        return one, two

    @property
    def pitch_angle(self) -> float:
        """Mesh cycle in terms of the pinion's rotation (rad)."""
        return 2 * np.pi / self.pinion.teeth

    def wheel_angle(self, pinion_angle: Any, twist: Any) -> Any:
        """Wheel rotation (rad): -pinion angle z1/z2 + twist."""
        return -pinion_angle * self.pinion.teeth / self.wheel.teeth + twist

    def tooth_angle(self, gear: int, tooth: Any, pinion_angle: Any, twist: Any) -> Any:
        """Angle (rad) of the frame of a tooth of the pinion (gear 0) or wheel (gear 1); numbers or arrays."""
        if gear == 0:
            return pinion_angle + 2 * np.pi * tooth / self.pinion.teeth
        return self.wheel_angle(pinion_angle, twist) + np.pi + (2 * tooth + 1) * np.pi / self.wheel.teeth

    def centre(self, gear: int) -> Array:
        """Centre of the pinion (0) or wheel (1), shape (2,) (m)."""
        return np.array([gear * self.centre_distance, 0.0])


def check_deviations(deviations: tuple[ToothDeviations, ToothDeviations], law: ContactLaw) -> None:
    """Raise `InputError` for deviations that a law, or the one mesh cycle of a curve or map, cannot have."""
    for name, own in zip(("pinion (driver)", "wheel (driven)"), deviations, strict=True):
        if not own.alike:
            what = "stand unevenly" if len(set(own.turn)) > 1 else "have different flanks"
            problem = f"its teeth {what}: curves, load maps and mesh laws are of one mesh cycle that repeats"
            cure = (
                "leave out pitch errors, measured teeth that differ, and waves that are no multiple of the teeth; "
                "gearfe microgeometry takes them"
            )
            raise InputError(f"deviations of the {name}", None, problem, cure)
    if deviations != NOMINAL and not isinstance(law, HalfPlane):
        problem = "takes flanks from meshes, which have no deviations of micrometres"
        raise InputError("law", law.name, problem, 'write law = "half_plane", or leave [microgeometry] out')


def turn(angle: float) -> Array:
    """Rotation matrix of `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
