"""A law over the face width in closed form: crowned flanks of thin slices, each a spring that varies with the phase."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gearfe.gears.gearmesh.width_law import WidthLaw, WidthTable, law_coefficients


class SliceForces(NamedTuple):
    """First contact (m), energy (J), force (N), moments on phase and tilt (N m), slopes of the force (N/m, N/rad)."""

    touch: np.ndarray
    energy: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    couple: np.ndarray
    tangent: np.ndarray
    by_tilt: np.ndarray


class Slices(NamedTuple):
    """Slices at y of stiffness k (1 + swing cos(2 pi phi/cycle)) that touch at late + crown y^2 + error(phi)."""

    cycle: float = 2.0 * math.pi / 20
    width: float = 0.02
    stiffness: float = 2e8
    crown: float = 0.15
    swing: float = 0.2
    error: float = 2e-6
    off: float = 1e-3

    def __call__(self, phase: np.ndarray, approach: np.ndarray, tilt: np.ndarray) -> SliceForces:
        x, w = np.polynomial.legendre.leggauss(400)
        y, turn = 0.5 * self.width * x, 2.0 * math.pi / self.cycle
        phase, approach, tilt = (v[..., None] for v in np.broadcast_arrays(phase, approach, tilt))
        k = 0.5 * w * self.stiffness * (1.0 + self.swing * np.cos(turn * phase))
        rise = -0.5 * w * self.stiffness * self.swing * turn * np.sin(turn * phase)
        late = self.crown * (y - self.off) ** 2 + self.error * np.sin(turn * phase) - y * tilt
        over = np.maximum(approach - late, 0.0)
        steep = self.error * turn * np.cos(turn * phase)
        return SliceForces(
            late.min(axis=-1),
            (0.5 * k * over**2).sum(axis=-1),
            (k * over).sum(axis=-1),
            (0.5 * rise * over**2 - k * over * steep).sum(axis=-1),
            (k * over * y).sum(axis=-1),
            (k * (over > 0.0)).sum(axis=-1),
            (k * (over > 0.0) * y).sum(axis=-1),
        )


def sliced_law(
    slices: Slices | None = None, cells: tuple[int, int, int] = (24, 12, 12), *, reach: float = 60e-6,
    tilt: float = 1.5e-3, backlash: float = 0.0,
) -> WidthLaw:  # fmt: skip
    """The law of slices, from their forces on a grid."""
    slices = slices or Slices()
    angle = slices.cycle * np.arange(cells[0]) / cells[0]
    overlap = reach * np.linspace(0.0, 1.0, cells[1] + 1) ** 2
    tilts = np.linspace(-tilt, tilt, cells[2] + 1) if cells[2] else np.zeros(1)
    touch = slices(angle[:, None], 0.0, tilts).touch
    at = slices(angle[:, None, None], touch[:, None, :] + overlap[:, None], tilts)
    tangent = at.tangent.copy()
    tangent[:, 0] = 0.0
    by_tilt, couple = at.by_tilt.copy(), at.couple
    by_tilt[:, 0] = 0.0
    table = WidthTable(angle, overlap, tilts, touch, at.energy, at.force, tangent, couple, by_tilt)
    radii = (0.02254, 0.03381)
    nodes = np.append(angle, slices.cycle)
    coefficients = law_coefficients(table, slices.cycle)
    largest = float(at.force[:, -1].min())
    return WidthLaw(nodes, overlap, tilts, *coefficients, radii, slices.width, backlash, largest, 1e-3, 3e-4)
