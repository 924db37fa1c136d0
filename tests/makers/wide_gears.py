"""Gears with face widths that several tests use."""

from __future__ import annotations

import math
from functools import lru_cache

from gearfe import Gear, GearPair
from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.width import ContactLines, WideMesh, contact_lines, wide_compliance
from gearfe.gears.width.lines import POINTS_PER_FUNCTION

from .gears import pair as gear_pair

#: The spur pair of the comparisons with CalculiX: 20/30 teeth of 2.5 mm, 25 degrees, 10 mm wide.
SPUR = gear_pair(tip_round=1e-4)

#: Width (m) of the internal pair.
INTERNAL_WIDTH = 20e-3

#: A job file of a small helical pair: 14/16 teeth of 2.5 mm, 15 degrees, 5 mm wide.
HELICAL_JOB = """
[pair]
module_mm = 2.5
pressure_angle_deg = 20.0
helix_angle_deg = 15.0
face_width_mm = 5.0
tip_round_mm = 0.1
[pair.pinion]
teeth = 14
profile_shift = 0.3
bore_diameter_mm = 20.0
[pair.wheel]
teeth = 16
bore_diameter_mm = 24.0
[stiffness]
torque_Nm = 40.0
"""


def helical_mesh(hand: float = 1.0, *, teeth: tuple[int, int] = (23, 47), swapped: bool = False) -> WideMesh:
    """Helical gears of normal module 2 mm, 15 degrees, 20 mm wide, on coarse sections."""
    beta, module, width = math.radians(15.0), 2e-3, 20e-3
    c = math.cos(beta)
    form = {"addendum": c, "dedendum": 1.25 * c, "rack_tip_radius": 0.3 * c, "tip_round": 5e-5}
    angle = math.atan(math.tan(math.radians(20.0)) / c)
    pinion, wheel = (
        Gear(z, module / c, angle, width, bore, **form) for z, bore in zip(teeth, (16e-3, 32e-3), strict=True)
    )
    base = hand * math.atan(math.tan(beta) * math.cos(angle))
    sections = MeshGeometry(wheel, pinion) if swapped else MeshGeometry(pinion, wheel)
    return WideMesh(sections, -base if swapped else base, functions=6, coarsen=3.0)


@lru_cache(maxsize=8)
def helical_lines(hand: float = 1.0, *, swapped: bool = False) -> ContactLines:
    return contact_lines(wide_compliance(helical_mesh(hand, swapped=swapped)))


@lru_cache(maxsize=8)
def spur_lines(
    *, whole: bool = True, functions: int | None = None, density: float = POINTS_PER_FUNCTION
) -> ContactLines:
    compliance = wide_compliance(WideMesh(SPUR, functions=functions), whole=whole)
    return contact_lines(compliance, density=density)


def internal_pair(helix: float = 0.0, hand: str = "right") -> GearPair:
    """A planet of 22 teeth in a ring of 61, module 4 mm (of the normal section), tips that stay on the involutes."""
    c = math.cos(helix)
    form = {
        "module": 4e-3, "pressure_angle": math.radians(20.0), "face_width": INTERNAL_WIDTH, "tip_round": 1e-4,
        "helix_angle": helix, "hand": hand,
    }  # fmt: skip
    planet = Gear(22, bore_diameter=40e-3, **form)
    return GearPair(planet, Gear(-61, rim_diameter=290e-3 / c, addendum=0.85, **form))


@lru_cache(maxsize=8)
def internal_lines(hand: str = "right", functions: int = 6) -> ContactLines:
    mesh = WideMesh(internal_pair(math.radians(12.0), hand), functions=functions, coarsen=3.0)
    return contact_lines(wide_compliance(mesh))
