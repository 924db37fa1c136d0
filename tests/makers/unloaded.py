"""When do the rigid, undeformed flanks just touch? The unloaded transmission error of the exact profiles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearfe.gears.geometry.first_contact import ToothFlanks
from gearfe.gears.geometry.pair import MeshGeometry

Array = NDArray[np.float64]


def unloaded_twist(pair: MeshGeometry, pinion_angles: ArrayLike) -> Array:
    """Twist of the wheel (rad) at which the rigid driving flanks just touch; 0 faces a pinion tooth with a wheel space.

    The least over all tooth pairs (`gearfe.gears.geometry.first_contact`).

    Parameters
    ----------
    pinion_angles : array_like, shape (n,)
        Pinion angles (rad).

    Returns
    -------
    ndarray, shape (n,)
    """
    angles = np.asarray(pinion_angles, dtype=float)
    found = ToothFlanks(pair).first_contacts(angles)
    least = np.full(len(angles), math.inf)
    np.minimum.at(least, found.position, found.twist)
    return least
