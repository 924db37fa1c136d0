"""Cross-sections of shafts at which their motion is shown, and the way from coordinates to their motion.

Shafts that bend have them, and those that carry no gear, with which they could be drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, IntArray
from .gear_train import GearTrain
from .mesh_element import Shafts

#: Cross-sections along a shaft that are shown, about so many beside the ends of its sections.
SHOWN = 24


@dataclass(frozen=True, eq=False)
class ShaftSections:
    """Cross-sections of all elastic shafts and of those without gears, k of them, two where the diameter steps.

    Attributes
    ----------
    shaft : ndarray, shape (k,)
        Number of the shaft of each.
    centres : ndarray, shape (k, 3)
        Points on the axes at rest (m).
    radii : ndarray, shape (k,)
        Outer radii (m).
    ratios : ndarray, shape (k,)
        Speed of the shaft of each over that of the drive.
    columns : ndarray, shape (c,)
        Numbers of the shafts' coordinates in the system.
    rows : ndarray, shape (k, 6, c)
        Displacement (m) and rotation (rad) along x, y, z beside rolling for unit coordinates.
    """

    shaft: IntArray
    centres: Array
    radii: Array
    ratios: Array
    columns: IntArray
    rows: Array


def shaft_sections(train: GearTrain, placed: Shafts) -> ShaftSections | None:
    """Cross-sections of shafts that are elastic or without gears, placed in the system; None without any."""
    axis, carrying = train.frame[2], {gear.shaft for gear in train.gears}
    shown = [number for number, shaft in enumerate(train.shafts) if shaft.sections or shaft.name not in carrying]
    if not shown:
        return None
    columns = np.concatenate([placed.first[i] + np.arange(placed.bodies[i].size) for i in shown])
    number, centres, radii, rows = list[int](), list[Array](), list[float](), list[Array]()
    for i in shown:
        shaft, middle = train.shafts[i], np.array(train.shafts[i].point, dtype=float)
        places, begin = [], len(centres)
        for low, high, first, last in shaft.outline:
            parts = np.linspace(0.0, 1.0, 1 + max(1, round(SHOWN * (high - low) / shaft.length)))
            places += [low + part * (high - low) for part in parts]
            radii += [first + part * (last - first) for part in parts]
        centres += [middle + place * axis for place in places]
        number += [i] * len(places)
        along = np.array(centres[begin:]) @ axis
        rows.append(placed.whole(i, placed.bodies[i].section_rows(along, train.frame))[..., columns])
    ratios = np.array(placed.ratios)[number]
    return ShaftSections(np.array(number), np.array(centres), np.array(radii), ratios, columns, np.concatenate(rows))
