"""From the loads on the teeth of a gear back to displacements of whole tooth sectors."""

from __future__ import annotations

import numpy as np

from ..typing import Array, IntArray
from .compliance import GearBody
from .position import FlankLoads


def sector_displacements(
    body: GearBody, loads: FlankLoads, position: IntArray, tooth: IntArray, *, rates: bool = False
) -> Array:
    """Nodal displacements of c sectors, by their teeth, in the axes of each (m).

    Parameters
    ----------
    position, tooth : ndarray, shape (c,)
        Number of the position, and of the tooth.
    rates
        Whether their derivatives with respect to the twist (m/rad) follow, another c.

    Returns
    -------
    ndarray, shape (nodes, 2, c or 2 c)
    """
    of, load, step = loads.felt(position, tooth, body.teeth)
    parts = []
    for force in (loads.force, loads.rate) if rates else (loads.force,):
        on_sides = force @ body.interface
        sides, flank = np.zeros((len(position), body.interface.shape[1])), np.zeros((len(position), force.shape[1]))
        for k in np.unique(step):
            here = step == k
            np.add.at(sides, of[here], on_sides[load[here]] @ body.coupling[k].T)
            if k == 0:
                np.add.at(flank, of[here], force[load[here]] @ body.own)
        parts.append(np.concatenate([flank + sides @ body.interface.T, sides], axis=1))
    return body.condensed.recover(np.concatenate(parts).T).reshape(-1, 2, sum(len(part) for part in parts))
