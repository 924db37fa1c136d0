"""Which teeth overlap when the gears are rigid, and where: the windows in which contact is then sought.

All positions of a sweep are searched in one pass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import chains_of, nearest_places, project
from .scene import MeshingPair, Window

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Reach:
    """How far windows reach.

    Attributes
    ----------
    share
        Half width as a share of the overlap's.
    margin
        Edges added on either side.
    whole_tips
        Whether an overlap that comes near a tip is taken whole.
    """

    share: float
    margin: int
    whole_tips: bool = True


#: A line contact that closes the overlap delta is narrower: with F <= 0.25 E* w delta (a tooth pair is at most that
#: stiff) b^2 = 4 F rho/(pi E* w) <= (0.4)^2 2 rho delta.
REACH = Reach(0.45, 3)
#: What suffices for nearly all positions: a tooth pair with all the load has F = 0.13 E* w delta, b = 0.28 (2 rho
#: delta)^(1/2). The solver sees where it did not.
CLOSE = Reach(0.36, 1, whole_tips=False)
#: The whole overlap and beyond.
WHOLE = Reach(1.5, 3)
#: Every so many nodes of the mate's flank the search for the closest point tries one.
STRIDE = 3
#: By how much of its depth an overlap must exceed that of parabolas somewhere to count as flat. Usual flanks and
#: reliefs stay below 0.13; where only two or three vertices overlap it may be more, which costs a wider window.
FLAT = 0.15
#: Overlap, as a share of the length of a tooth's contact surface, from which on the wheel's vertices are asked too.
DEEP = 0.02


@dataclass(frozen=True)
class Overlap:
    """Overlap of one tooth pair when rigid.

    Attributes
    ----------
    tooth
        Pair number k: pinion tooth k, wheel tooth -1 - k.
    depth
        Largest overlap (m).
    ranges
        Edges (first, end) of pinion and wheel flank that overlap.
    deepest
        Edge of pinion and of wheel flank at the largest overlap.
    whole
        Whether contact may be anywhere in it: a hollow root takes part, which a tip can lie along and touch at both
        ends, or the overlap stays deep far from the deepest point.
    """

    tooth: int
    depth: float
    ranges: tuple[tuple[int, int], tuple[int, int]]
    deepest: tuple[int, int]
    whole: bool = False


def overlaps(pair: MeshingPair, angles: Array, twists: Array) -> list[list[Overlap]]:
    """Overlapping tooth pairs at each pinion angle (rad) and twist (rad).

    Looked for are the pinion's vertices in the wheel. Where teeth overlap so deeply that they bend far out of the way,
    a tip of the wheel may bear that none of them has come into: there the wheel's vertices are asked too.
    """
    position, teeth = _candidates(pair, angles, pair.pinion.flank.points[::2])
    found = _inside(pair, angles, twists, 0, position, teeth)
    lengths = [float(body.flank.sizes.sum()) for body in pair.bodies]
    deepest = np.zeros(len(angles))
    for (n, _), one in found.items():
        deepest[n] = max(deepest[n], one.depth)
    deep = deepest[position] > DEEP * min(lengths)
    if deep.any():
        for key, one in _inside(pair, angles, twists, 1, position[deep], teeth[deep]).items():
            found[key] = _merged(found[key], one) if key in found else one
    made: list[list[Overlap]] = [[] for _ in angles]
    for n, k in sorted(found):
        made[n].append(found[n, k])
    return made


def _inside(
    pair: MeshingPair, angles: Array, twists: Array, gear: int, position: IntArray, teeth: IntArray
) -> dict[tuple[int, int], Overlap]:
    """Overlaps by position and pair number, as the vertices of pinion (gear 0) or wheel (1) find them in the mate."""
    found: dict[tuple[int, int], Overlap] = {}
    if len(position) == 0:
        return found
    one_flank, two_flank = (pair.bodies[g].flank for g in (gear, 1 - gear))
    one, two = one_flank.points[::2], two_flank.points
    # own vertices in the frame of the mate's tooth
    numbers = (teeth, -1 - teeth)
    angle1, angle2 = (pair.tooth_angle(g, numbers[g], angles[position], twists[position]) for g in (gear, 1 - gear))
    placed = _rotated(one, angle1) + pair.centre(gear) - pair.centre(1 - gear)
    local = np.stack(
        [
            np.cos(angle2)[:, None] * placed[..., 0] + np.sin(angle2)[:, None] * placed[..., 1],
            -np.sin(angle2)[:, None] * placed[..., 0] + np.cos(angle2)[:, None] * placed[..., 1],
        ],
        axis=-1,
    )
    low, high, reach = two.min(axis=0), two.max(axis=0), np.linalg.norm(two[-1])
    near = ((local >= low) & (local <= high)).all(axis=-1) & (np.linalg.norm(local, axis=-1) <= reach * (1 + 1e-9))
    where = np.argwhere(near)
    if len(where) == 0:
        return found
    points = local[near]
    sizes = one_flank.sizes
    arc = np.concatenate([[0.0], np.cumsum(sizes)])
    chain = chains_of(two, np.array([(len(two) - 1) // 2]), np.zeros(len(points), dtype=np.int64))
    result = project(points, chain, STRIDE * nearest_places(points, two[::STRIDE]), iterations=8, tolerance=1e-6)
    inside = result.gap < 0
    for case in np.unique(where[inside, 0]):
        mine = np.flatnonzero(inside & (where[:, 0] == case))
        vertex, place, gap = where[mine, 1], result.place[mine], result.gap[mine]
        bottom = int(np.argmin(gap))
        element = float(sizes[np.minimum(vertex, len(sizes) - 1)].max())
        ranges = (int(vertex.min()), int(vertex.max())), (int(place.min()), int(place.max()) + 1)
        deepest = int(vertex[bottom]), int(place[bottom])
        found[int(position[case]), int(teeth[case])] = Overlap(
            tooth=int(teeth[case]),
            depth=float(-gap[bottom]),
            ranges=(ranges[gear], ranges[1 - gear]),
            deepest=(deepest[gear], deepest[1 - gear]),
            whole=vertex.min() < one_flank.root
            or place.min() < two_flank.root
            or _flat(arc[vertex] - arc[vertex[bottom]], gap / gap[bottom], element),
        )
    return found


def _flat(along: Array, share: Array, element: float) -> bool:
    """Whether shares of the largest overlap, at distances (m) along the flank, exceed those of parabolas.

    What overlaps ends up to an element beyond the last vertex inside.
    """
    length = float(np.abs(along).max()) + element
    return bool((share > 1 - (along / length) ** 2 + FLAT).any())


def _merged(one: Overlap, two: Overlap) -> Overlap:
    """What both have found."""
    (a, b), (c, d) = (((min(x[0], y[0]), max(x[1], y[1]))) for x, y in zip(one.ranges, two.ranges, strict=True))
    deeper = one if one.depth >= two.depth else two
    return replace(deeper, ranges=((a, b), (c, d)), whole=one.whole or two.whole)


def _candidates(pair: MeshingPair, angles: Array, flank: Array) -> tuple[IntArray, IntArray]:
    """Positions and pair numbers whose pinion flank reaches into the wheel's tip circle."""
    central = np.round(-angles / pair.pitch_angle).astype(np.int64)
    half = int(np.ceil(min(pair.pinion.teeth, 12) / 4))
    teeth = (central[:, None] + np.arange(-half, half + 1)).ravel()
    position = np.repeat(np.arange(len(angles)), 2 * half + 1)
    placed = _rotated(flank[:: max(1, len(flank) // 8)], pair.tooth_angle(0, teeth, angles[position], 0.0))
    reach = np.linalg.norm(pair.wheel.flank.points[-1])
    spacing = np.linalg.norm(flank[-1] - flank[0]) / 6
    close = (np.linalg.norm(placed - pair.centre(1), axis=-1) < reach + spacing).any(axis=1)
    return position[close], teeth[close]


def _rotated(points: Array, angles: Array) -> Array:
    """Points, shape (n, 2), turned by each of the angles, shape (c,): shape (c, n, 2)."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return np.stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]], axis=-1)


def windows_of(
    pair: MeshingPair, found: list[Overlap], angle: float, twist: float, reach: Reach = REACH
) -> list[Window]:
    """Windows about the deepest points of the overlaps."""
    windows: list[Window] = []
    node = 0
    arcs = [np.concatenate([[0.0], np.cumsum(body.flank.sizes)]) for body in pair.bodies]
    for number, overlap in enumerate(found):
        # a tip that digs in slides along its mate as the teeth bend: nothing is narrowed there
        tip = reach.whole_tips and any(_near_tip(arcs[gear], overlap.ranges[gear]) for gear in (0, 1))
        kept = max(1.0, reach.share) if tip else reach.share
        margin = reach.margin
        if overlap.whole:
            kept, margin = WHOLE.share, WHOLE.margin
        for gear, tooth in ((0, overlap.tooth), (1, -1 - overlap.tooth)):
            first, end = _narrowed(arcs[gear], overlap.ranges[gear], overlap.deepest[gear], kept, overlap.depth, margin)
            placed = pair.tooth_angle(gear, tooth, angle, twist)
            windows.append(Window(gear, number, tooth, first, end - first, node, placed))
            node += 2 * (end - first) + 1
    return windows


def _near_tip(arc: Array, span: tuple[int, int]) -> bool:
    """Whether an overlap comes as close to the tip as a fifth of its own length."""
    return bool(arc[-1] - arc[span[1]] < 0.2 * (arc[span[1]] - arc[span[0]]))


def _narrowed(
    arc: Array, span: tuple[int, int], deepest: int, share: float, depth: float, margin: int
) -> tuple[int, int]:
    """Range of edges about the deepest one; bending moves the contact along the flank by no more than the overlap."""
    first, end = span
    reach = share * max(arc[end] - arc[deepest], arc[deepest] - arc[first]) + depth
    low = int(np.searchsorted(arc, arc[deepest] - reach)) - 1
    high = int(np.searchsorted(arc, arc[deepest] + reach)) + 1
    return max(0, low - margin), min(len(arc) - 1, high + margin)


def rigidly_apart(pair: MeshingPair, angle: float, twist: float, *, samples: int = 24) -> bool:
    """Whether the undeformed flanks are clear of each other, judged on their curves and not only on their vertices."""
    one, two = pair.pinion.flank, pair.wheel.flank
    position, teeth = _candidates(pair, np.array([angle]), one.points[::2])
    dense = _dense(one.points, samples)
    chain = chains_of(two.points, np.array([two.edges]), np.zeros(len(dense), dtype=np.int64))
    for k in teeth[: len(position)]:
        placed = _rotated(dense, np.array([pair.tooth_angle(0, int(k), angle, twist)]))[0] - pair.centre(1)
        local = _rotated(placed, np.array([-pair.tooth_angle(1, -1 - int(k), angle, twist)]))[0]
        gap = project(local, chain, nearest_places(local, two.points)).gap
        if (gap < 0).any():
            return False
    return True


def _dense(nodes: Array, samples: int) -> Array:
    xi = np.linspace(0, 1, samples, endpoint=False)[:, None]
    x0, x1, x2 = nodes[:-2:2, None], nodes[1:-1:2, None], nodes[2::2, None]
    values = x0 * (1 - xi) * (1 - 2 * xi) + 4 * x1 * xi * (1 - xi) + x2 * xi * (2 * xi - 1)
    return values.reshape(-1, 2)
