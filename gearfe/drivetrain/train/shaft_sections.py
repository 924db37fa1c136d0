"""Cross-sections of elastic shafts at which their motion is shown, and the way from coordinates to their motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, IntArray
from .model import TrainModel

#: Cross-sections along a shaft that are shown, about so many beside the ends of its sections.
SHOWN = 24


@dataclass(frozen=True, eq=False)
class ShaftSections:
    """Cross-sections of all elastic shafts, k of them, two where the diameter steps.

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


def shaft_sections(model: TrainModel) -> ShaftSections | None:
    """Cross-sections of the elastic shafts of a train; None without any."""
    frame = model.train.frame
    bodies = [(i, shaft) for i, shaft in enumerate(model.train.shafts) if shaft.sections]
    if not bodies:
        return None
    ends = [(int(model.first[i]), int(model.first[i]) + model.shafts[i].size) for i, _ in bodies]
    columns = np.concatenate([np.arange(*end) for end in ends])
    number, centres, radii, rows = list[int](), list[Array](), list[float](), list[Array]()
    for i, shaft in bodies:
        body, middle = model.shafts[i], np.array(shaft.point, dtype=float)
        for low, high, first, last in shaft.outline:
            for part in np.linspace(0.0, 1.0, 1 + max(1, round(SHOWN * (high - low) / shaft.length))):
                centre = middle + (low + part * (high - low)) * frame[2]
                along = float(centre @ frame[2])
                own = np.vstack([body.point_rows(centre, frame, along), frame.T @ body.turn_rows(along)])
                whole = np.zeros((6, model.system.size))
                whole[:, model.first[i] : model.first[i] + body.size] = own
                number.append(i)
                centres.append(centre)
                radii.append(first + part * (last - first))
                rows.append(whole[:, columns])
    ratios = model.ratios[number]
    return ShaftSections(np.array(number), np.array(centres), np.array(radii), ratios, columns, np.array(rows))
