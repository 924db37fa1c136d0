"""Where the sharp tip corners of a gear pair bear on the mate's flank, off the path of contact.

Without friction a corner pushes along the normal of the smooth flank that it bears on. Contact points on the corner's
body project onto that flank and take its normal; points on the smooth flank take the normal of the corner's own flank,
which turns away from it with every degree past the end of the path. The patch is so short that refinement hardly mends
that (docs/verification.md). From the end of the path on, the share of the corner's points in the unbiased contact
therefore rises from a half to one.

The share rises with the rotation of the corner's own gear, so that it does not matter which gear is called the pinion.
At a given pinion angle the wheel's corners then bear the more, the larger the twist, and tangents follow that.
"""

from __future__ import annotations

import math

from ..gear.mesh_geometry import MeshGeometry

#: Range of angles (rad) of the gear's own tooth frame: where its corner starts to bear, and from where it bears alone.
Bearing = tuple[float, float]

#: Roll length over which the share rises, times module; torques change by 0.02 % between a third and three times that.
RISE = 0.05


def corner_bearings(pair: MeshGeometry) -> tuple[Bearing | None, Bearing | None]:
    """Where the corners of pinion and wheel bear, None where the tip is rounded.

    The pinion's corner bears beyond the end E of the path of contact, the wheel's before its start A: both at rising
    roll lengths and angles of their own gear. The wheel's tooth frames stand at pi when they face the pinion.
    """
    start, end = pair.path_limits()
    made: list[Bearing | None] = []
    for gear, roll, facing in ((pair.pinion, end, 0.0), (pair.wheel, pair.tangent_length - start, math.pi)):
        angle = facing + roll / gear.base_radius - pair.working_pressure_angle - gear.base_angle
        rise = RISE * pair.pinion.module / gear.base_radius
        made.append(None if gear.tip_round > 0.0 else (angle, angle + rise))
    return made[0], made[1]


def shares(bearings: tuple[Bearing | None, Bearing | None], angles: tuple[float, float]) -> tuple[float, float]:
    """Shares of the contact that the points on pinion and wheel carry, given the angles (rad) of the tooth frames."""
    bears = [
        0.0 if b is None else min(1.0, max(0.0, (angle - b[0]) / (b[1] - b[0])))
        for b, angle in zip(bearings, angles, strict=True)
    ]
    pinion = 0.5 * (1 + bears[0] - bears[1])
    return pinion, 1 - pinion


def growths(bearings: tuple[Bearing | None, Bearing | None], angles: tuple[float, float]) -> tuple[float, float]:
    """Rates of ln(shares) with the twist (1/rad): the wheel's frame turns with it, the pinion's stands."""
    wheel = bearings[1]
    if wheel is None or not wheel[0] < angles[1] < wheel[1]:
        return 0.0, 0.0
    rate = 0.5 / (wheel[1] - wheel[0])
    pinion, other = shares(bearings, angles)
    return -rate / pinion, rate / other
