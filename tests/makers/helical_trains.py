"""Small trains of helical gears in rigid housings, on hinges or on bearings."""

from __future__ import annotations

import math
from typing import Any

from gearfe.drivetrain.train import Drive, GearMesh, GearTrain, Load, Shaft, ShaftGear
from gearfe.drivetrain.train.gear_train import Bearing
from gearfe.gears.geometry.pair import Gear
from gearfe.multibody import constant

BETA, MODULE, WIDTH = math.radians(20.0), 2.5e-3, 0.02
#: Places of both bearings of a shaft along it (m).
LOW, HIGH = -0.045, 0.035
OTHER = {"right": "left", "left": "right"}
#: A bearing that holds its shaft along the axis, and one that does not: x, y, z (N/m) and tilts.
FIXED, FLOATING = (3e8, 1e8, 2e8, 0.0, 0.0), (2.5e8, 0.0, 4e8, 0.0, 0.0)


def helical_gear(teeth: int, hand: str, beta: float = BETA) -> Gear:
    return Gear(teeth, MODULE, math.radians(20.0), WIDTH, 0.01, helix_angle=beta, hand=hand)


def shaft(name: str, x: float) -> Shaft:
    return Shaft(name, (x, 0.0, 0.0), 0.1, 0.01, (f"{name} high", f"{name} low"))


def bores(places: dict[str, float]) -> dict[str, tuple[float, float, float]]:
    ends = (("high", HIGH), ("low", LOW))
    return {f"{name} {end}": (x, y, 0.0) for name, x in places.items() for end, y in ends}


def bearings(names: tuple[str, ...]) -> tuple[Bearing, ...]:
    """The high bearing of each shaft holds it along the axis."""
    made = []
    for name in names:
        made += [Bearing(f"{name} high", FIXED, (50.0,) * 5), Bearing(f"{name} low", FLOATING, (50.0,) * 5)]
    return tuple(made)


def helical_pair(
    hand: str = "right", sense: float = 1.0, *, torque: float = 60.0, along: float = 0.01, speed: float = 100.0,
    beta: float = BETA, on_bearings: bool = True, **mesh: Any,
) -> GearTrain:  # fmt: skip
    """Driver s0 with the given hand at x = 0, driven s1 at +x; the driver turns in a sense about y. Torque in N m."""
    one, two = helical_gear(20, hand, beta), helical_gear(30, OTHER[hand], beta)
    distance = one.reference_radius + two.reference_radius
    mesh = {"stiffness": 2e8, **mesh}
    return GearTrain(
        (shaft("s0", 0.0), shaft("s1", distance)),
        (ShaftGear("driver", "s0", along, one), ShaftGear("driven", "s1", along, two)),
        (GearMesh("driver", "driven", **mesh),),
        Drive("s0", "s0 high", constant(sense * speed)),
        (Load("s1", "s1 high", constant(sense * torque)),),
        rigid_bores=bores({"s0": 0.0, "s1": distance}),
        bearings=bearings(("s0", "s1")) if on_bearings else (),
    )


def helical_chain(second_beta: float, *, idler: bool = False, torque: float = 60.0) -> GearTrain:
    """Three shafts in an x row: an idler gear on the middle one, or two gears of one hand with two angles."""
    first, second = helical_gear(20, "right"), helical_gear(30, "left")
    third, fourth = helical_gear(24, "left", second_beta), helical_gear(40, "right", second_beta)
    if idler:
        third, fourth = second, helical_gear(40, "right")
    places = [0.0, first.reference_radius + second.reference_radius]
    places.append(places[1] + third.reference_radius + fourth.reference_radius)
    gears = [ShaftGear("a", "s0", 0.012, first), ShaftGear("b", "s1", 0.012, second)]
    gears += [] if idler else [ShaftGear("c", "s1", -0.015, third)]
    gears.append(ShaftGear("d", "s2", 0.012 if idler else -0.015, fourth))
    names = ("s0", "s1", "s2")
    return GearTrain(
        tuple(shaft(name, x) for name, x in zip(names, places, strict=True)),
        tuple(gears),
        (GearMesh("a", "b", 2e8), GearMesh("b" if idler else "c", "d", 2e8)),
        Drive("s0", "s0 high", constant(100.0)),
        (Load("s2", "s2 high", constant(-torque)),),
        rigid_bores=bores(dict(zip(names, places, strict=True))),
        bearings=bearings(names),
    )
