"""Both whole gears for another program: fine teeth where they mesh, coarse ones elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gearfe.gears.geometry.pair import GearPair
from gearfe.gears.teeth.tooth_sector import sector_recipes
from gearfe.gears.teeth.whole_gear import mixed_gear
from gearfe.output.exchange.mesh_export import MeshPart

#: Teeth on either side of the line of centres that are fine.
REACH = 1


@dataclass(frozen=True)
class ContactTask:
    """One position of a gear pair, in millimetres for another program.

    Attributes
    ----------
    pinion, wheel
        Meshes in their places before the twist (m), driving flanks of the fine teeth as boundary ``contact``.
    centre
        Distance of the wheel's centre from the origin (m).
    twist
        Twist of the wheel (rad).
    base_radius
        Of the wheel (m).
    width
        Face width (m).
    """

    pinion: MeshPart
    wheel: MeshPart
    centre: float
    twist: float
    base_radius: float
    width: float

    @property
    def unknowns(self) -> int:
        """Two a node."""
        return 2 * (len(self.pinion.points) + len(self.wheel.points))


def contact_task(pair: GearPair, angle: float, twist: float, coarsen: float) -> ContactTask:
    """The pair at a pinion angle (rad): fine teeth by `coarsen`, the others as coarse as their common sides allow."""
    turned = [angle, -angle * pair.pinion.teeth / pair.wheel.teeth + math.pi + math.pi / pair.wheel.teeth]
    facing = [0.0, math.pi]
    parts = []
    for number, gear in enumerate((pair.pinion, pair.wheel)):
        recipe = sector_recipes(pair, coarsen=coarsen)[number]
        step = 2.0 * math.pi / gear.teeth
        central = round((facing[number] - turned[number]) / step)
        part = mixed_gear(gear, recipe, {central + k for k in range(-REACH, REACH + 1)})
        c, s = math.cos(turned[number]), math.sin(turned[number])
        place = np.array([pair.working_centre_distance * number, 0.0])
        parts.append(replace(part, points=part.points @ np.array([[c, s], [-s, c]]) + place))
    width = min(pair.pinion.face_width, pair.wheel.face_width)
    return ContactTask(parts[0], parts[1], pair.working_centre_distance, twist, pair.wheel.base_radius, width)
