"""Coarse gear pairs that several contact tests share."""

from __future__ import annotations

import math
from functools import cache

from gearfe.fem.plane import Material, Plane
from gearfe.gears.contact.compliance import GearBody, MeshingPair, gear_body
from gearfe.gears.contact.laws import ContactLaw, PairModel
from gearfe.gears.contact.whole_gears.pair import ElasticGear, WholePair
from gearfe.gears.geometry.pair import Gear, GearPair, TipRelief
from gearfe.gears.teeth.tooth_sector import SectorMesh, sector_mesh, sector_recipes

WIDTH = 10e-3
STEEL = Material(200e9, 0.30)
#: Another material, so that a mix-up of the two gears shows.
IRON = Material(110e9, 0.26)


@cache
def gears(name: str) -> GearPair:
    """``sharp``: 10/13 teeth, sharp tips; ``modified``: shift, tip round and relief; ``reference``: the 20/30 pair."""
    angle, module = math.radians(25), 2.5e-3
    if name == "sharp":
        return GearPair(
            Gear(10, module, angle, WIDTH, 0.35 * 10 * module), Gear(13, module, angle, WIDTH, 0.35 * 13 * module)
        )
    if name == "modified":
        angle = math.radians(20)
        relief = TipRelief(8e-6, 1.5e-3, 1.5)
        return GearPair(
            Gear(12, module, angle, WIDTH, 8e-3, profile_shift=0.4, tip_round=0.1e-3, tip_relief=relief),
            Gear(14, module, angle, WIDTH, 10e-3, profile_shift=-0.05, tip_round=0.15e-3),
        )
    return GearPair(Gear(20, module, angle, WIDTH, 0.35 * 50e-3), Gear(30, module, angle, WIDTH, 0.35 * 75e-3))


@cache
def meshes(name: str, coarsen: float) -> tuple[SectorMesh, SectorMesh]:
    """Sector meshes of pinion and wheel."""
    pair = gears(name)
    recipes = sector_recipes(pair, coarsen=coarsen)
    return sector_mesh(pair.pinion, recipes[0], cache=False), sector_mesh(pair.wheel, recipes[1], cache=False)


@cache
def bodies(name: str, coarsen: float, plane: Plane, points: int = 4) -> tuple[GearBody, GearBody]:
    """Condensed gears: a steel pinion and an iron wheel."""
    pinion, wheel = meshes(name, coarsen)
    return (
        gear_body(pinion, STEEL, plane, WIDTH, points_per_edge=points),
        gear_body(wheel, IRON, plane, WIDTH, points_per_edge=points),
    )


def condensed(name: str, coarsen: float, plane: Plane, law: ContactLaw, points: int = 4) -> MeshingPair:
    """The pair on the condensed route."""
    pinion, wheel = bodies(name, coarsen, plane, points)
    return MeshingPair(gears(name), pinion, wheel, PairModel(law=law))


@cache
def whole(name: str, coarsen: float, plane: Plane) -> WholePair:
    """The pair as whole gears."""
    pinion, wheel = meshes(name, coarsen)
    return WholePair(
        ElasticGear(pinion, STEEL, plane, WIDTH),
        ElasticGear(wheel, IRON, plane, WIDTH),
        gears(name).working_centre_distance,
        WIDTH,
    )
