"""Root stress over torque and angle, and its columns in the table of a load map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..gear.deviation_job import GEARS
from ..stiffness.curve import numbers
from ..typing import Array


@dataclass(frozen=True)
class RootMap:
    """Root stress over torque and angle; the third axis is the gear (pinion, wheel).

    Attributes
    ----------
    stress : ndarray, shape (m, n, 2, p)
        Largest tension along the loaded side's fillet of the teeth of pairs `leading_pair`, `leading_pair` - 1, ...
        (Pa); not-a-number where the pair carries nothing.
    diameter : ndarray, shape (m, n, 2)
        Where the largest one of them acts (m).
    error : ndarray, shape (m, n, 2)
        Its estimated relative error (-), see `gearfe.loadmap.root_stress`.
    """

    stress: Array
    diameter: Array
    error: Array

    @property
    def largest(self) -> Array:
        """Largest root stress of each gear over its loaded teeth, shape (m, n, 2) (Pa)."""
        known = np.where(np.isfinite(self.stress), self.stress, -np.inf).max(axis=3)
        return np.where(np.isfinite(known), known, np.nan)


def root_columns(root: RootMap) -> dict[str, Array]:
    """Columns of the root stresses, each of shape (m, n)."""
    columns: dict[str, Array] = {}
    for g, gear in enumerate(GEARS):
        columns[f"root_stress_{gear}_MPa"] = root.largest[:, :, g]
        columns[f"root_diameter_{gear}_mm"] = root.diameter[:, :, g]
        columns[f"root_stress_error_{gear}"] = root.error[:, :, g]
    for g, gear in enumerate(GEARS):
        for j in range(root.stress.shape[3]):
            columns[f"root_stress_{gear}_{j + 1}_MPa"] = root.stress[:, :, g, j]
    return columns


def root_of(columns: Mapping[str, Sequence[str]], shape: tuple[int, int], path: str | Path) -> RootMap | None:
    """The root stresses that a table holds as text, or None; `shape` is (m, n), `path` is named in messages."""
    if f"root_stress_{GEARS[0]}_MPa" not in columns:
        return None

    def read(name: str) -> Array:
        return np.stack([numbers(columns, name.format(g), path).reshape(shape) for g in GEARS], axis=2)

    count = 0
    while f"root_stress_{GEARS[0]}_{count + 1}_MPa" in columns:
        count += 1
    parts = [read(f"root_stress_{{}}_{j + 1}_MPa") for j in range(count)]
    return RootMap(np.stack(parts, axis=3), read("root_diameter_{}_mm"), read("root_stress_error_{}"))
