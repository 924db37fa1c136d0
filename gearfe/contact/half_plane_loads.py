"""From the contacts of the half-plane law to nodal loads on the mesh: for fields, root stress and finite strain.

The loads are the consistent ones of the pressures on the panels, at their places on the deformed flanks and along the
common normal. Displacements recovered from them are those of the teeth; nearer to a contact than an element or two they
show what the coarse flank makes of the pressure. Stresses there: `gearfe.stiffness.contact_stress`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..typing import Array
from .flank import Flank, edge_shapes
from .flank_compliance import FlankCompliance
from .half_plane_result import PairContacts
from .moved_faces import WAY
from .position import FlankLoads
from .scene import MeshingPair


def flank_loads(
    sides: Sequence[FlankCompliance], elastic: MeshingPair, contacts: PairContacts, angles: Array, twists: Array
) -> tuple[FlankLoads, FlankLoads]:
    """Loads on the flanks of pinion and wheel.

    Parameters
    ----------
    sides
        Flanks of pinion and wheel.
    contacts
        m loaded pairs.
    angles, twists : ndarray, shape (n,)
        Pinion angles and twists from the centred position (rad) of the positions that they are of.
    """
    place = angles[contacts.position], twists[contacts.position]
    made = []
    for g, tooth in enumerate((contacts.pair, -1 - contacts.pair)):
        shares, moved = _nodal(sides[g], elastic.bodies[g].flank, contacts, g)
        along = (2 * g - 1) * contacts.normal * np.exp(-1j * elastic.tooth_angle(g, tooth, *place))
        # the wheel's axes turn on with the twist
        rate = contacts.force_rate + 1j * (contacts.normal_rate - g) * contacts.force
        force = (contacts.force * along)[:, None] * shares
        change = along[:, None] * (rate[:, None] * shares + contacts.force[:, None] * moved)
        made.append(FlankLoads(contacts.position, tooth, force.view(float), change.view(float)))
    return made[0], made[1]


def _nodal(side: FlankCompliance, flank: Flank, contacts: PairContacts, gear: int) -> tuple[Array, Array]:
    """Of each pair the shares of the force on the nodes of the flank, which add up to 1, and their rates with the twist
    (1/rad) as the pressure moves along the flank and widens, both of shape (m, nodes).
    """
    load = contacts.pressure * contacts.width
    edge, xi = flank.place(contacts.panel_arc[:, gear] + side.offset)
    value, slope, _ = edge_shapes(xi)
    share = load / load.sum(axis=1, keepdims=True)
    moves = contacts.arc_rate[:, gear, None] + WAY[gear] * contacts.x * contacts.growth[:, None]
    shape = len(load), len(flank.nodes)
    at = (np.arange(shape[0])[:, None] * shape[1] + 2 * edge)[:, :, None] + np.arange(3)
    weights = value * share[:, :, None], slope * (moves / flank.sizes[edge] * share)[:, :, None]
    shares, moved = (np.bincount(at.ravel(), w.ravel(), shape[0] * shape[1]).reshape(shape) for w in weights)
    return shares, moved
