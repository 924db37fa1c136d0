r"""Mass and inertia of a shaft with its gears, from geometry and density.

A gear is its exact tooth outline of width b outside the shaft (or its bore, where that is wider); with the polygon's
:math:`A = \tfrac12\sum c_i`, :math:`J = \tfrac1{12}\sum c_i(|p_i|^2 + p_i\cdot p_{i+1} + |p_{i+1}|^2)`, :math:`c_i =
p_i \times p_{i+1}` (Green's theorem), its mass is :math:`\rho b A`, its polar inertia :math:`\rho b J`, its transverse
one :math:`\rho b J/2 + m b^2/12`. All are summed about the common mass centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..errors import InputError
from ..gear.derived import gear_outline
from ..gear.pair import Gear
from ..typing import Array
from .gear_train import Shaft, ShaftGear

#: Points on each piece of a tooth's outline: area good to 1e-7.
POINTS = 200


@dataclass(frozen=True, eq=False)
class Rotor:
    """A shaft with its gears as one rigid body.

    Attributes
    ----------
    mass
        kg.
    polar, transverse
        Moments of inertia about the axis and about any transverse line through the mass centre (kg m2).
    centre : (3,)
        Mass centre (m).
    """

    mass: float
    polar: float
    transverse: float
    centre: Array


@lru_cache(maxsize=64)
def outline_moments(gear: Gear) -> tuple[float, float]:
    """Area (m2) and polar second moment (m4) inside a gear's tooth outline."""
    p = 1e-3 * gear_outline(gear, 0.0, (0.0, 0.0), per_segment=POINTS)[:-1]
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    second = (cross * ((p * p).sum(axis=1) + (p * q).sum(axis=1) + (q * q).sum(axis=1))).sum() / 12.0
    return abs(float(cross.sum())) / 2.0, abs(float(second))


def rotor(shaft: Shaft, gears: tuple[ShaftGear, ...], axis: Array) -> Rotor:
    """Mass properties of a shaft with the gears on it."""
    point = np.array(shaft.point, dtype=float)
    m = shaft.density * math.pi * shaft.radius**2 * shaft.length
    parts = [(m, 0.5 * m * shaft.radius**2, m * (3 * shaft.radius**2 + shaft.length**2) / 12.0, float(point @ axis))]
    for item in gears:
        gear = item.gear
        if shaft.radius >= gear.root_radius:
            problem = f"radius {1e3 * shaft.radius:g} mm reaches the teeth of gear {item.name!r}"
            cure = f"must be < {1e3 * gear.root_radius:.6g} mm, its root radius"
            raise InputError(f"shaft {shaft.name!r}", None, problem, cure)
        inner = max(shaft.radius, 0.5 * gear.bore_diameter)
        area, second = outline_moments(gear)
        width = gear.face_width
        mass = item.density * width * (area - math.pi * inner**2)
        polar = item.density * width * (second - 0.5 * math.pi * inner**4)
        parts.append((mass, polar, 0.5 * polar + mass * width**2 / 12.0, item.along))
    table = np.array(parts)
    total = table[:, 0].sum()
    along = float(table[:, 0] @ table[:, 3] / total)
    transverse = float((table[:, 2] + table[:, 0] * (table[:, 3] - along) ** 2).sum())
    centre = point + (along - float(point @ axis)) * axis
    given = (shaft.mass, shaft.polar_inertia, shaft.transverse_inertia)
    made = (float(total), float(table[:, 1].sum()), transverse)
    mass, polar, transverse = (m if g is None else g for g, m in zip(given, made, strict=True))
    return Rotor(mass, polar, transverse, centre)
