"""Static equilibrium of one rolling bearing under a given load."""

from __future__ import annotations

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .geometry import BallBearing, RollerBearing
from .minimum import least_energy
from .state import BearingState, deflected

#: A bearing whose rings move by more than this part of the element's diameter does not carry its load.
MOST = 0.5


def carrying(bearing: BallBearing | RollerBearing, load: Array) -> BearingState:
    """Return the state at which a bearing carries a load.

    Parameters
    ----------
    bearing : BallBearing or RollerBearing
        The bearing.
    load : ndarray, shape (5,)
        On the shaft: forces along e1, a, e2 (N), moments about e1, e2 (N m).

    Raises
    ------
    InputError
        For a load that the bearing alone cannot carry, such as a radial one on a single row with a contact angle.
    """
    force = np.asarray(load, dtype=float)
    radius = 0.5 * bearing.pitch_diameter
    scale = 1e-3 * bearing.diameter * np.array([1.0, 1.0, 1.0, 1.0 / radius, 1.0 / radius])
    size = float(np.abs(force * scale).max())
    if size == 0.0:
        return deflected(bearing, np.zeros(5))

    def energy(u: Array) -> tuple[float, Array, Array]:
        state = deflected(bearing, u)
        return state.energy - float(force @ u), state.load - force, state.stiffness

    found = least_energy(energy, np.zeros(5), scale, size)
    moved = float(np.abs(found.place / scale).max()) * 1e-3
    state = deflected(bearing, found.place)
    if not found.converged or moved > MOST or state.astray:
        problem = "cannot be carried by this bearing alone: its rings would slide or tilt apart"
        cure = "a single row with a contact angle needs an axial load along its sense, rollers without ribs carry none"
        raise InputError("load", [float(f"{x:.6g}") for x in force], problem, cure)
    return state
