"""How fast the springs and dampers of a system are in a state."""

from __future__ import annotations

import numpy as np

from .carried import free_motions
from .start import Start
from .system import System


def fastest_rate(system: System, start: Start) -> tuple[float, float]:
    """Fastest decay (1/s) and fastest vibration (rad/s) of the free motion in a state.

    The linear part of forces is projected onto the directions that the constraints leave free.
    """
    if not (system.linear or _has_springs(system)):
        return 0.0, 0.0
    by_q, by_v = system.force_jacobian(start.time, start.q, start.v)
    G = system.jacobian(start.time, start.q)[start.active] / system.row_units[start.active, None]
    free = system.units[:, None] * free_motions(G * system.units)
    root = np.linalg.solve(np.linalg.qr(system.mass_root() @ free)[1].T, free.T).T  # root^T M root = 1
    K, C = -root.T @ by_q @ root, -root.T @ by_v @ root
    if K.size == 0:
        return 0.0, 0.0
    decay = float(np.abs(np.linalg.eigvals(C)).max()) if C.any() else 0.0
    omega = float(np.sqrt(np.abs(np.linalg.eigvals(K)).max()))
    return decay, omega


def _has_springs(system: System) -> bool:
    linkage = system.linkage
    if linkage is None:
        return bool(system.forces)
    forces = linkage.assembly.tables.forces
    return bool(forces.spring.size or forces.along.any())
