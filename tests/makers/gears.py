"""Gear pairs that several tests use."""

import math

from gearfe import Gear, GearPair
from gearfe.base.config import build
from gearfe.base.tables.gearbox import NamedMesh, pair_gearbox
from gearfe.base.tables.microgeometry import MicrogeometryTable
from gearfe.base.tables.pair import PairTable


def gear(teeth, *, module=2.5e-3, pressure_angle=25.0, width=10e-3, bore=0.2, **form):
    """Gear with a bore of `bore` times its pitch diameter."""
    return Gear(teeth, module, math.radians(pressure_angle), width, bore * teeth * module, **form)


def pair(z1=20, z2=30, *, centre_distance=None, pinion=None, wheel=None, **form):
    """Pair of gears with a common form; `pinion` and `wheel` hold what only one of them has."""
    return GearPair(gear(z1, **{**form, **(pinion or {})}), gear(z2, **{**form, **(wheel or {})}), centre_distance)


def uneven(table: MicrogeometryTable) -> NamedMesh:
    """A mesh of a pinion and a wheel with the deviations of a table, as its job file has it."""
    form = {"module_mm": 2.5, "pressure_angle_deg": 25.0, "face_width_mm": 10.0}
    gears = {name: {"teeth": z, "bore_diameter_mm": 10.0} for name, z in (("pinion", 20), ("wheel", 30))}
    (mesh,) = pair_gearbox(build(PairTable, {**form, **gears}, "pair"), table).meshes.values()
    return mesh
