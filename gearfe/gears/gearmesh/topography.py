"""Measured flank topographies: material over roll length and face width, of some teeth or of all alike.

Between the places of the grid the material is bilinear; beyond its edges it stays what it is there. Teeth that were
not measured have the mean of those that were.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.errors import InputError
from ...base.files import read_numbers
from ...base.typing import Array, IntArray
from ..geometry.deviation_job import FlankOf, rolls_at
from ..geometry.pitch_errors import seen_from_behind

#: Share of the active profile, and of the face width, that a grid covers at least.
COVERED = 0.5
#: Jump of the slope (-) at a grid line that is a kink for the lines of contact, and most of them along an axis.
#: Where it is less, points 2 mm apart miss 0.25 um of the gap at most.
KINK, MOST_KINKS = 1e-3, 8
#: Columns of which one gives the place along the profile.
PLACES = ("roll_length_mm", "diameter_mm")


@dataclass(frozen=True, eq=False)
class MeasuredTopography:
    """Material of the flanks of a gear on grids.

    Parameters
    ----------
    roll : ndarray, shape (r,)
        Rising roll lengths (m).
    z : ndarray, shape (c,)
        Rising places along the axis (m).
    material : ndarray, shape (k, r, c)
        Material of k flanks (m), > 0: more.
    flank : ndarray of int, shape (teeth,)
        Number of each tooth's flank.
    """

    roll: Array
    z: Array
    material: Array
    flank: IntArray

    @property
    def alike(self) -> bool:
        """Whether all teeth are alike."""
        return len(np.unique(self.flank)) == 1

    @cached_property
    def kinks(self) -> Array:
        """Lines a z + b s = c of the grid over z and roll length s (m) where slopes jump the most, shape (lines, 3)."""
        lines = [(0.0, 1.0, s) for s in _sharpest(self.roll, self.material, 1)]
        return np.reshape(lines + [(1.0, 0.0, z) for z in _sharpest(self.z, self.material, 2)], (-1, 3))

    def __call__(self, roll: Array, z: Array, tooth: IntArray) -> Array:
        """Material (m) at roll lengths and axial coordinates (m) of teeth."""
        (i, s), (j, t) = _place(self.roll, roll), _place(self.z, z)
        k = self.flank[np.asarray(tooth) % len(self.flank)]
        low = (1 - s) * self.material[k, i, j] + s * self.material[k, i + 1, j]
        high = (1 - s) * self.material[k, i, j + 1] + s * self.material[k, i + 1, j + 1]
        return np.asarray((1 - t) * low + t * high)


def _sharpest(grid: Array, material: Array, axis: int) -> list[float]:
    """Return the places of a grid (m) at which the slope of the material (m) along an axis jumps the most."""
    values = np.moveaxis(material, axis, -1)
    slope = np.diff(values, axis=-1) / np.diff(grid)
    level = np.zeros((*slope.shape[:-1], 1))
    jump = np.abs(np.diff(np.concatenate([level, slope, level], axis=-1), axis=-1)).max(axis=(0, 1))
    order = np.argsort(-jump, kind="stable")[:MOST_KINKS]
    return sorted(grid[order[jump[order] > KINK]].tolist())


def _place(grid: Array, values: Array) -> tuple[IntArray, Array]:
    """Intervals of a rising grid, and shares of them, of values; those beyond its ends are at them."""
    i = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    return i, np.clip((values - grid[i]) / (grid[i + 1] - grid[i]), 0.0, 1.0)


def measured_topography(
    flank: FlankOf, face: tuple[float, float], sense: float, most: float
) -> MeasuredTopography | None:
    """Return the topography that a flank's table names, or None.

    Parameters
    ----------
    flank : FlankOf
        The flank of the job file.
    face : pair of float
        First and last z of the gear (m).
    sense : float
        z over y of the job file.
    most : float
        Largest deviation that is microgeometry (m).

    Raises
    ------
    InputError
        For a file that cannot be read, grids that are not whole or cover too little, and deviations out of range.
    """
    name, field = flank.own.topography_csv, f"{flank.where}.topography_csv"
    if name is None:
        return None
    columns = read_numbers(flank.folder / name, field, ("y_mm", "deviation_um"), (*PLACES, "tooth"), others=False)
    given = [key for key in PLACES if key in columns]
    if len(given) != 1:
        raise InputError(field, name, f"must have one of the columns {' and '.join(PLACES)}", "name the places once")
    gear = flank.gear
    if given[0] == "diameter_mm":
        of_roll = rolls_at(gear, columns["diameter_mm"], field)
    else:
        of_roll = 1e-3 * columns["roll_length_mm"]
        of_roll = -np.abs(of_roll) if gear.internal else of_roll
    roll, i = np.unique(of_roll, return_inverse=True)
    y, j = np.unique(1e-3 * columns["y_mm"], return_inverse=True)
    numbers = columns.get("tooth", np.zeros(len(i)))
    teeth, k = np.unique(numbers, return_inverse=True)
    if not (np.array_equal(teeth, teeth.astype(np.int64)) and teeth[0] >= 0 and teeth[-1] < gear.tooth_count):
        raise InputError(f"{field}, tooth", name, f"must be whole, >= 0 and < {gear.tooth_count}", "count from 0")
    shape = len(teeth), len(roll), len(y)
    cell = np.ravel_multi_index((k, i, j), shape)
    if min(shape[1:]) < 2 or len(cell) != np.prod(shape) or len(np.unique(cell)) != len(cell):
        problem = f"is no whole grid: {len(cell)} rows of {len(teeth)} teeth, {len(roll)} places by {len(y)} places"
        raise InputError(field, name, problem, "give every place of each tooth once, two or more along both ways")
    _check_cover(field, name, roll, flank.active, "active profile's roll length")
    width = gear.face_width
    _check_cover(field, name, y, (-0.5 * width, 0.5 * width), "face width, y counted from its middle")
    material = np.zeros(shape)
    material.ravel()[cell] = 1e-6 * columns["deviation_um"]
    if np.abs(material).max() > most:
        worst = 1e6 * float(material.ravel()[np.argmax(np.abs(material))])
        raise InputError(
            f"{field}, deviation_um", worst, f"must be >= {-1e6 * most:.4g} and <= {1e6 * most:.4g} um", "is it in um?"
        )
    order = slice(None, None, 1 if sense > 0.0 else -1)
    of_teeth = np.full(gear.tooth_count, len(teeth))
    if "tooth" in columns:
        of_teeth[teeth.astype(np.int64)] = np.arange(len(teeth))
    if sense < 0.0:
        of_teeth = np.array(seen_from_behind(of_teeth.tolist(), wheel=flank.number == 1))
    every = np.concatenate([material, material.mean(axis=0, keepdims=True)])
    return MeasuredTopography(roll, 0.5 * sum(face) + (sense * y)[order], every[:, :, order], of_teeth)


def _check_cover(field: str, name: str, places: Array, needed: tuple[float, float], what: str) -> None:
    """Raise `InputError` for a grid that covers little of a range (m)."""
    covered = min(places[-1], needed[1]) - max(places[0], needed[0])
    if covered < COVERED * (needed[1] - needed[0]):
        problem = (
            f"covers {1e3 * places[0]:.5g} to {1e3 * places[-1]:.5g} mm: must cover half of {1e3 * needed[0]:.5g} to "
            f"{1e3 * needed[1]:.5g} mm, the {what}"
        )
        raise InputError(field, name, problem, "give more places")
