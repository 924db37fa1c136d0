"""Derivatives of the forces of meshes as full matrices."""

from __future__ import annotations

import numpy as np

from gearfe.drivetrain.runup.balance import Pushes


def slopes_of(pushes: Pushes) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives with freedoms and with rates, shapes (S, m, m)."""
    samples, size = pushes.value.shape
    full = np.zeros((samples, size, 2 * size))
    full[:, pushes.by.forces, pushes.by.freedoms] = pushes.by.values
    return full[:, :, :size], full[:, :, size:]
