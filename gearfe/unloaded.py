r"""When do the rigid, undeformed flanks just touch? The unloaded transmission error of the exact profiles.

About the wheel's centre every point of the wheel's driving flank moves on a circle, so with the polar angles
:math:`\varphi_1(r)` of the pinion's flank, seen from there, and :math:`\varphi_2(r)` of the wheel's at zero twist, the
pair touches at the twist :math:`\min_r (\varphi_1 - \varphi_2)`, and the gears at the least twist over all pairs.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .mesh_geometry import MeshGeometry
from .spur_gear import Gear

Array = NDArray[np.float64]

#: Points on the involute; chords of it leave the exact curve by less than a nanometre.
FLANK_POINTS = 1500


def unloaded_twist(pair: MeshGeometry, pinion_angles: ArrayLike) -> Array:
    """Twist of the wheel (rad) at which the rigid driving flanks just touch; 0 faces a pinion tooth with a wheel space.

    Parameters
    ----------
    pinion_angles : array_like, shape (n,)
        Pinion angles (rad).

    Returns
    -------
    ndarray, shape (n,)
    """
    pinion = _outline(pair.pinion, tip=True)
    wheel = _outline(pair.wheel, tip=False)
    wheel_radius, wheel_angle = np.abs(wheel), np.angle(wheel)
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(wheel_radius)) > 0])
    wheel_radius, wheel_angle = wheel_radius[rising], wheel_angle[rising]
    angles = np.asarray(pinion_angles, dtype=float)
    return np.array([_touch(pair, float(angle), pinion, wheel_radius, wheel_angle) for angle in angles])


def _outline(gear: Gear, *, tip: bool) -> NDArray[np.complex128]:
    """Left half profile as complex numbers, from root to tip."""
    counts = {"involute": FLANK_POINTS, "trochoid": 300, "tip_round": 300}
    pieces = [
        segment.points(np.linspace(0.0, 1.0, counts.get(segment.name, 20)))
        for segment in gear.profile.segments
        if tip or segment.name != "tip"
    ]
    points = np.concatenate(pieces)
    return points[:, 0] + 1j * points[:, 1]


def _touch(
    pair: MeshGeometry,
    pinion_angle: float,
    pinion: NDArray[np.complex128],
    wheel_radius: Array,
    wheel_angle: Array,
) -> float:
    a = pair.working_centre_distance
    tip1, tip2 = pair.pinion.tip_radius, pair.wheel.tip_radius
    # teeth whose tip can reach the wheel's tip circle, with half a pitch to spare
    reach = math.acos(min(1.0, max(-1.0, (a * a + tip1 * tip1 - tip2 * tip2) / (2 * a * tip1))))
    cycle = pair.mesh_cycle
    first = math.ceil((-pinion_angle - reach - 0.5 * cycle) / cycle)
    last = math.floor((-pinion_angle + reach + 0.5 * cycle) / cycle)
    least = math.inf
    for k in range(first, last + 1):
        placed = pinion * np.exp(1j * (pinion_angle + k * cycle)) - a
        radius = np.abs(placed)
        nearer = np.concatenate([[True], np.diff(np.minimum.accumulate(radius)) < 0])
        radius = radius[nearer][::-1]
        low, high = max(radius[0], wheel_radius[0]), min(radius[-1], wheel_radius[-1])
        if low > high:
            continue
        tooth = pair.wheel_angle_at(pinion_angle) + math.pi - (2 * k + 1) * math.pi / pair.wheel.teeth
        seen = np.angle(placed[nearer][::-1] * np.exp(-1j * tooth))
        both = np.concatenate([radius, wheel_radius, [low, high]])
        both = both[(both >= low) & (both <= high)]
        apart = np.interp(both, radius, seen) - np.interp(both, wheel_radius, wheel_angle)
        least = min(least, float(apart.min()))
    return least
