"""From the contact forces of a position back to displacements of whole tooth sectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compliance import GearBody
from .position import Position

Array = NDArray[Any]


def position_forces(body: GearBody, gear: int, position: Position, *, rate: bool = False) -> dict[int, Array]:
    """Forces on the whole contact surface of each loaded tooth of one gear: tooth number -> shape (f,) (N, tooth axes).

    Parameters
    ----------
    gear
        0 pinion, 1 wheel.
    rate
        Their derivatives with respect to the twist instead (N/rad).
    """
    forces = position.force_rate if rate else position.forces
    if forces is None:
        raise ValueError(f"a position without a solution has no forces: {position.status}")
    loaded: dict[int, Array] = {}
    for w in position.windows:
        if w.gear == gear:
            whole = loaded.setdefault(w.tooth % body.teeth, np.zeros(len(body.own)))
            whole[w.flank_unknowns] += forces[w.unknowns]
    return loaded


def retained_displacements(body: GearBody, loaded: dict[int, Array], tooth: int) -> Array:
    """Displacements (m) of the retained unknowns (flank, then cut sides) of one sector, in its own axes."""
    sides = np.zeros(body.interface.shape[1])
    for number, load in loaded.items():
        sides += body.coupling[(tooth - number) % body.teeth] @ (load @ body.interface)
    flank = body.interface @ sides
    own = loaded.get(tooth % body.teeth)
    if own is not None:
        flank += body.own @ own
    return np.concatenate([flank, sides])


def sector_displacements(body: GearBody, cases: Sequence[tuple[dict[int, Array], int]]) -> Array:
    """Nodal displacements of sectors: one case is (loads on the loaded teeth, tooth number).

    Returns
    -------
    ndarray, shape (nodes, 2, cases)
        m, in the axes of each case's tooth.
    """
    values = np.stack([retained_displacements(body, loaded, tooth) for loaded, tooth in cases], axis=1)
    return body.condensed.recover(values).reshape(-1, 2, len(cases))
