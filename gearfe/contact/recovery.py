"""From the contact forces of a position back to displacements of whole tooth sectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compliance import GearBody
from .scene import Window

Array = NDArray[Any]


def flank_forces(body: GearBody, gear: int, windows: Sequence[Window], forces: Array) -> dict[int, Array]:
    """Forces on the whole contact surface of each loaded tooth of one gear: tooth number -> shape (f,) (N, tooth axes).

    Parameters
    ----------
    gear
        0 pinion, 1 wheel.
    forces : ndarray, shape (2n,)
        Forces on the scene's nodes (N, tooth axes).
    """
    loaded: dict[int, Array] = {}
    for w in windows:
        if w.gear != gear:
            continue
        whole = loaded.setdefault(w.tooth % body.teeth, np.zeros(len(body.own)))
        whole[w.flank_unknowns] += forces[w.unknowns]
    return loaded


def retained_displacements(body: GearBody, loaded: dict[int, Array], tooth: int) -> Array:
    """Displacements (m) of the retained unknowns (flank, then cut sides) of one sector, in its own axes."""
    sides = np.zeros(body.interface.shape[1])
    for number, force in loaded.items():
        sides += body.coupling[(tooth - number) % body.teeth] @ (force @ body.interface)
    flank = body.interface @ sides
    if tooth % body.teeth in loaded:
        flank += body.own @ loaded[tooth % body.teeth]
    return np.concatenate([flank, sides])


def sector_displacements(body: GearBody, cases: Sequence[tuple[dict[int, Array], int]]) -> Array:
    """Nodal displacements of sectors: one case is (forces on the loaded teeth, tooth number).

    Returns
    -------
    ndarray, shape (nodes, 2, cases)
        m, in the axes of each case's tooth.
    """
    values = np.stack([retained_displacements(body, loaded, tooth) for loaded, tooth in cases], axis=1)
    return body.condensed.recover(values).reshape(-1, 2, len(cases))
