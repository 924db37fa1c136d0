"""Gear pairs that several tests use."""

import math

from gearfe import Gear, GearPair


def gear(teeth, *, module=2.5e-3, pressure_angle=25.0, width=10e-3, bore=0.2, **form):
    """Gear with a bore of `bore` times its pitch diameter."""
    return Gear(teeth, module, math.radians(pressure_angle), width, bore * teeth * module, **form)


def pair(z1=20, z2=30, *, centre_distance=None, pinion=None, wheel=None, **form):
    """Pair of gears with a common form; `pinion` and `wheel` hold what only one of them has."""
    return GearPair(gear(z1, **{**form, **(pinion or {})}), gear(z2, **{**form, **(wheel or {})}), centre_distance)
