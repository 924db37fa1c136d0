"""Where the sharp tip corners of a gear pair bear on the mate's flank, off the path of contact.

Without friction a corner pushes along the normal of the smooth flank that it bears on. Contact points on the corner's
body project onto that flank and take its normal; points on the smooth flank take the normal of the corner's own flank,
which turns away from it with every degree past the end of the path. The patch is so short that refinement hardly mends
that (docs/verification.md). From the end of the path on, the share of the corner's points in the unbiased contact
therefore rises from a half to one.
"""

from __future__ import annotations

from ..gear.mesh_geometry import MeshGeometry

#: Range of angles (rad) of the pinion's tooth frame: where a corner starts to bear, and from where it bears alone.
Bearing = tuple[float, float]

#: Roll length over which the share rises, times module; torques change by 0.02 % between a third and three times that.
RISE = 0.05


def corner_bearings(pair: MeshGeometry) -> tuple[Bearing | None, Bearing | None]:
    """Where the corners of pinion and wheel bear, None where the tip is rounded.

    The pinion's corner bears beyond the end E of the path of contact (increasing angle), the wheel's before its start A
    (decreasing angle).
    """
    start, end = (pair.pinion_angle_at(roll) for roll in pair.path_limits())
    rise = RISE * pair.pinion.module / pair.pinion.base_radius
    pinion = None if pair.pinion.tip_round > 0.0 else (end, end + rise)
    wheel = None if pair.wheel.tip_round > 0.0 else (start, start - rise)
    return pinion, wheel


def shares(bearings: tuple[Bearing | None, Bearing | None], angle: float) -> tuple[float, float]:
    """Shares of the contact that the points on pinion and wheel carry at an angle (rad) of the pinion's tooth frame."""
    bears = [0.0 if b is None else min(1.0, max(0.0, (angle - b[0]) / (b[1] - b[0]))) for b in bearings]
    pinion = 0.5 * (1 + bears[0] - bears[1])
    return pinion, 1 - pinion
