"""From the contact loads of a position back to displacements of whole tooth sectors.

The loads on a tooth are the forces on its contact surface and, behind them in the same vector, the stress loads at its
quadrature points where the contact law's theta makes any (`gearfe.contact.laws`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .compliance import GearBody
from .scene import Window

if TYPE_CHECKING:
    from .solver import Position

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
    if body.stress_loads is not None:
        raise ValueError("forces alone do not make the fields of a law with theta other than 0: use position_loads")
    loaded: dict[int, Array] = {}
    for w in windows:
        if w.gear != gear:
            continue
        whole = loaded.setdefault(w.tooth % body.teeth, np.zeros(len(body.own)))
        whole[w.flank_unknowns] += forces[w.unknowns]
    return loaded


def position_loads(body: GearBody, gear: int, position: Position, *, rate: bool = False) -> dict[int, Array]:
    """Loads on each loaded tooth of one gear in a solved position: tooth number -> shape (f,) or (f + e q,).

    Parameters
    ----------
    gear
        0 pinion, 1 wheel.
    rate
        The loads' derivative with respect to the twist instead.
    """
    scene = position.scene
    forces, stress = position.forces, position.stress_loads
    if rate:
        forces, stress = position.force_rate, position.stress_load_rate
    if scene is None or forces is None:
        raise ValueError(f"a position without a solution has no loads: {position.status}")
    if body.stress_loads is None:
        return flank_forces(body, gear, scene.windows, forces)
    if stress is None or len(stress) != len(scene.owner):
        raise ValueError("the position comes from another contact law than its gears are made for")
    q, f = body.flank.shapes.shape[0], len(body.own)
    loaded: dict[int, Array] = {}
    for i, w in enumerate(scene.windows):
        if w.gear != gear:
            continue
        whole = loaded.setdefault(w.tooth % body.teeth, np.zeros(f + len(body.stress_loads.own)))
        whole[w.flank_unknowns] += forces[w.unknowns]
        whole[f + q * w.first_edge : f + q * (w.first_edge + w.edges)] += stress[scene.owner == i]
    return loaded


def retained_displacements(body: GearBody, loaded: dict[int, Array], tooth: int) -> Array:
    """Displacements (m) of the retained unknowns (flank or skin, then cut sides) of one sector, in its own axes."""
    sides = np.zeros(body.interface.shape[1])
    f, own = len(body.own), loaded.get(tooth % body.teeth)
    for number, load in loaded.items():
        push = load[:f] @ body.interface
        if len(load) > f:
            assert body.stress_interface is not None
            push = push + load[f:] @ body.stress_interface
        sides += body.coupling[(tooth - number) % body.teeth] @ push
    loads = body.stress_loads
    near, far = (body.own, body.interface) if loads is None else (loads.skin, loads.skin_interface)
    surface = far @ sides
    if own is not None:
        surface += near @ own
    return np.concatenate([surface, sides])


def sector_displacements(body: GearBody, cases: Sequence[tuple[dict[int, Array], int]]) -> Array:
    """Nodal displacements of sectors: one case is (loads on the loaded teeth, tooth number).

    Returns
    -------
    ndarray, shape (nodes, 2, cases)
        m, in the axes of each case's tooth.
    """
    values = np.stack([retained_displacements(body, loaded, tooth) for loaded, tooth in cases], axis=1)
    return body.condensed.recover(values).reshape(-1, 2, len(cases))
