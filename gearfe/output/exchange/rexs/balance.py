"""Compute speeds and torques of a gear train from the kinematics of its meshes.

Each mesh is one row A of the constraints A omega = 0: z_1 omega_1 + z_2 omega_2 = (z_1 + z_2) omega_c (Willis). The
index c is the carrier of its axes if these rotate, and z < 0 for an internal gear. Torques T on the shafts balance with
the multipliers of the rows: T + A^T lambda = 0. The torque of a mesh on its gear is lambda z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

#: Digits of a derived speed or torque, relative size of what counts as zero.
DIGITS, ZERO = 12, 1e-9


@dataclass(frozen=True)
class Row:
    """One constraint: name of a mesh or coupling, and the factors of the speeds of the shafts."""

    name: str
    factors: Mapping[str, float]


def speeds_of(shafts: Sequence[str], rows: Sequence[Row], known: Mapping[str, float]) -> dict[str, float]:
    """Return the speeds (rad/s) that follow from known ones; shafts whose speed stays open are left out.

    Parameters
    ----------
    shafts
        Names.
    rows
        Constraints.
    known
        Shaft -> speed; 0 for one that is held.
    """
    place = {name: number for number, name in enumerate(shafts)}
    matrix = np.zeros((len(rows) + len(known), len(shafts)))
    right = np.zeros(len(matrix))
    for number, row in enumerate(rows):
        for name, factor in row.factors.items():
            matrix[number, place[name]] += factor / max(abs(value) for value in row.factors.values())
    for number, (name, speed) in enumerate(known.items(), start=len(rows)):
        matrix[number, place[name]], right[number] = 1.0, speed
    if not len(matrix):
        return {}
    values = np.linalg.lstsq(matrix, right, rcond=None)[0]
    open_ = _free(matrix)
    size = max((abs(value) for value in known.values()), default=1.0) or 1.0
    return {
        name: known.get(name, 0.0 if abs(values[i]) < ZERO * size else _rounded(values[i]))
        for name, i in place.items()
        if not open_[i]
    }


def torques_of(
    shafts: Sequence[str], rows: Sequence[Row], known: Mapping[str, float], unknown: Sequence[str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the unknown torques on shafts (N m) and the multiplier of each row (N m a tooth).

    Meshes that share a load without being the only way for it, as those of planets, get equal shares: the smallest
    sum of squares.

    Parameters
    ----------
    shafts, rows
        As of `speeds_of`.
    known
        Shaft -> torque on it; no entry: none.
    unknown
        Shafts whose torque is not known: driven, loaded or held ones.
    """
    place = {name: number for number, name in enumerate(shafts)}
    matrix = np.zeros((len(shafts), len(rows) + len(unknown)))
    for number, row in enumerate(rows):
        for name, factor in row.factors.items():
            matrix[place[name], number] += factor
    for number, name in enumerate(unknown, start=len(rows)):
        matrix[place[name], number] = 1.0
    right = np.zeros(len(shafts))
    for name, torque in known.items():
        right[place[name]] -= torque
    if not matrix.size:
        return {}, {}
    values, *_ = np.linalg.lstsq(matrix, right, rcond=None)
    size = max(float(np.abs(right).max(initial=0.0)), 1e-30)
    if float(np.abs(matrix @ values - right).max()) > 1e-6 * size:
        return {}, {}
    open_ = _free(matrix)
    torques = {
        name: _rounded(values[number]) for number, name in enumerate(unknown, start=len(rows)) if not open_[number]
    }
    return torques, {row.name: _rounded(values[number]) for number, row in enumerate(rows)}


def _free(matrix: np.ndarray) -> list[bool]:
    """Return whether each unknown stays open: it has a share in the null space."""
    _, sizes, vectors = np.linalg.svd(matrix)
    rank = int((sizes > ZERO * max(sizes.max(initial=0.0), 1e-30)).sum())
    return [bool(np.abs(vectors[rank:, i]).max(initial=0.0) > 1e-6) for i in range(matrix.shape[1])]


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
