"""From the contacts of the half-plane law to nodal loads on the mesh: for fields, root stress and finite strain.

The loads are the consistent ones of the pressures on the panels, at their places on the deformed flanks and along the
common normal. Fields recovered from them are those of the teeth away from the contact; nearer than an element or two
they show what the coarse flank makes of the pressure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .flank import edge_shapes
from .flank_compliance import FlankCompliance
from .half_plane_result import PairContacts
from .moved_faces import WAY
from .position import Position
from .scene import MeshingPair, Window

Array = NDArray[Any]


def with_loads(
    position: Position,
    sides: Sequence[FlankCompliance],
    elastic: MeshingPair,
    contacts: PairContacts,
    angle: float,
    twist: float,
) -> Position:
    """The position with pieces of flank, the nodal forces on them, and their rates with the twist.

    Parameters
    ----------
    sides
        Flanks of pinion and wheel.
    contacts
        Loaded pairs of this position.
    angle, twist
        Pinion angle and twist from the centred position (rad).
    """
    windows: list[Window] = []
    forces: list[Array] = []
    rates: list[Array] = []
    node = 0
    for k in range(len(contacts)):
        for g, tooth in enumerate((int(contacts.pair[k]), -1 - int(contacts.pair[k]))):
            first, (shares, moved) = _nodal(sides[g], elastic.bodies[g].flank.sizes, contacts, k, g)
            edges = (len(shares) - 1) // 2
            windows.append(Window(g, tooth, first, edges, node))
            node += 2 * edges + 1
            along = (2 * g - 1) * contacts.normal[k] * np.exp(-1j * elastic.tooth_angle(g, tooth, angle, twist))
            # the wheel's axes turn on with the twist
            rate = contacts.force_rate[k] + 1j * (contacts.normal_rate[k] - g) * contacts.force[k]
            forces.append((contacts.force[k] * along * shares).view(float))
            rates.append((along * (rate * shares + contacts.force[k] * moved)).view(float))
    if not windows:
        return position
    return replace(
        position,
        windows=tuple(windows),
        forces=np.concatenate(forces),
        force_rate=np.concatenate(rates),
        contacts=contacts,
    )


def _nodal(side: FlankCompliance, sizes: Array, contacts: PairContacts, k: int, gear: int) -> tuple[int, Array]:
    """First edge under the pressure of a pair, and for the nodes from there on the shares of the force, which add up to
    1, and their rates with the twist (1/rad) as the pressure moves along the flank and widens, shape (2, nodes).
    """
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    load = contacts.pressure[k] * contacts.width[k]
    arc = contacts.panel_arc[k, gear] + side.offset
    edge = np.clip(np.searchsorted(ends, arc, side="right") - 1, 0, len(sizes) - 1)
    value, slope, _ = edge_shapes(np.clip((arc - ends[edge]) / sizes[edge], 0.0, 1.0))
    first, last = int(edge[load > 0].min()), int(edge[load > 0].max())
    nodal = np.zeros((2, 2 * (last - first + 1) + 1))
    inside, share = load > 0, (load / load[load > 0].sum())[:, None]
    nodes = 2 * (edge[inside, None] - first) + np.arange(3)
    np.add.at(nodal[0], nodes, (value * share)[inside])
    moves = contacts.arc_rate[k, gear] + WAY[gear] * contacts.x[k] * contacts.growth[k]
    np.add.at(nodal[1], nodes, (slope * (moves / sizes[edge])[:, None] * share)[inside])
    return first, nodal
