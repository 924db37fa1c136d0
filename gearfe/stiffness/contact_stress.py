r"""Stress beside the contacts of the half-plane law, in place of what a coarse flank makes of their pressures.

The elements of a flank are wider than most contacts. As in the influence function (`gearfe.contact.flank_compliance`),
the finite elements therefore carry the force as a bump that they resolve: an elliptic pressure of the same resultant at
the same place, whose half width a is two elements. What the contact's own pressure p does besides is local, and known
without a mesh:

.. math:: \sigma = \sigma^{FE}[\text{bump}] + \sigma^{HP}[p] - \sigma^{HP}[\text{bump}]

with the stresses of a half-plane under pressures that are constant on panels :math:`|x-\xi| \le w/2` (Johnson, *Contact
Mechanics*, 1985, eq. 2.30), :math:`\tan\theta_{1,2} = z/(x-\xi\pm\tfrac12 w)` at the depth z,

.. math::
    \sigma_{x,z} = -\tfrac{p}{2\pi}\big(2(\theta_2-\theta_1) \pm (\sin 2\theta_2-\sin 2\theta_1)\big), \qquad
    \tau_{xz} = \tfrac{p}{2\pi}(\cos 2\theta_2-\cos 2\theta_1).

Force and place of both pressures are the same, so their difference falls off with the cube of the distance, and does
not see that the tooth is no half-plane. Depths are those below the curved flank. Where a contact is wider than a bump
the elements resolve it, and where it is nearer to an end of the flank than a, there is no room for one: nothing is
changed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..contact.compliance import GearBody
from ..contact.flank import Flank, edge_nodes, edge_shapes
from ..contact.half_plane_result import PairContacts
from ..contact.panels import EDGES
from ..contact.position import FlankLoads, Positions
from ..typing import Array

#: Half width of a bump in elements.
BUMP_ELEMENTS = 2.0
#: Shares of an elliptic pressure on the panels `EDGES`.
_SHARES = np.diff(EDGES * np.sqrt(1 - EDGES**2) + np.arcsin(EDGES)) / np.pi


def half_plane_stress(x: Array, z: Array, edges: Array, pressure: Array) -> Array:
    """Stresses xx, zz, xz (Pa) at places x and depths z (m) of shape (n,), shape (3, n).

    Parameters
    ----------
    edges : ndarray, shape (k + 1,)
        Rising edges of the panels (m).
    pressure : ndarray, shape (k,)
        On them (Pa).
    """
    angle = np.arctan2(z[:, None], x[:, None] - edges)
    parts = 2 * np.diff(angle, axis=1), np.diff(np.sin(2 * angle), axis=1), np.diff(np.cos(2 * angle), axis=1)
    even, odd, shear = (part @ pressure / (2 * np.pi) for part in parts)
    return np.stack([-even - odd, -even + odd, shear])


def bumped(body: GearBody, position: Positions, gear: int) -> tuple[FlankLoads, list[tuple[int, Array]]]:
    """Loads of one gear at one position with bumps in place of narrow contacts, and what these make of the stresses.

    Returns
    -------
    loads
        For the finite elements.
    local : list of (int, ndarray of shape (3, nodes))
        Of each contact its tooth, and the stresses xx, yy, xy (Pa) at the nodes of its sector, tooth axes.
    """
    loads, contacts = position.loads[gear], position.contacts
    local: list[tuple[int, Array]] = []
    if not isinstance(contacts, PairContacts):
        return loads, local
    force = loads.force.copy()
    for k in range(len(contacts)):
        flank, load = body.flank, contacts.pressure[k] * contacts.width[k]
        centre = flank.arc_at(float(contacts.panel_radius[k, gear] @ load / load.sum()))
        edge = int(flank.place(np.array(centre))[0])
        half = BUMP_ELEMENTS * float(flank.sizes[edge])
        if half <= contacts.half_width[k] or not half < centre < flank.ends[-1] - half:
            continue
        nodal = force[k].view(complex)
        total = nodal.sum()
        nodal[:] = total * _nodal_shares(flank, centre + half * 0.5 * (EDGES[1:] + EDGES[:-1]))
        line = abs(total) / body.thickness
        way = 1 if gear == 0 else -1  # the panels run against the wheel's flank
        places = way * contacts.x[k][::way]
        own = contacts.pressure[k][::way], contacts.width[k][::way]
        edges = np.append(places - 0.5 * own[1], places[-1] + 0.5 * own[1][-1])
        bump = line * _SHARES / (half * np.diff(EDGES))
        x, z, tangent = _frame(body, centre)
        stress = half_plane_stress(x, z, edges, own[0] * line / load.sum())
        stress -= half_plane_stress(x, z, half * EDGES, bump)
        local.append((int(loads.tooth[k]), _turned(stress, tangent)))
    return replace(loads, force=force), local


def _nodal_shares(flank: Flank, arcs: Array) -> Array:
    """Shares of an elliptic pressure's force on the nodes of a flank, shape (f,)."""
    edge, xi = flank.place(arcs)
    made = np.zeros(len(flank.nodes))
    np.add.at(made, edge_nodes(edge), edge_shapes(xi)[0] * _SHARES[:, None])
    return made


def _frame(body: GearBody, centre: float) -> tuple[Array, Array, complex]:
    """Places along the flank's tangent at an arc (m) and depths below the flank of all nodes of a sector, shape (n,),
    and the tangent towards the tip, tooth axes.
    """
    flank, points = body.flank, body.mesh.points @ np.array([1, 1j])
    edge, xi = flank.place(np.array([centre]))
    value, slope, _ = edge_shapes(xi)
    corners = (flank.points @ np.array([1, 1j]))[edge_nodes(edge)][0]
    origin, along = value[0] @ corners, slope[0] @ corners
    tangent = complex(along / abs(along))
    seen, surface = (points - origin) / tangent, (flank.points @ np.array([1, 1j]) - origin) / tangent
    order = np.argsort(surface.real)
    depth = np.interp(seen.real, surface.real[order], surface.imag[order]) - seen.imag
    return seen.real, np.maximum(depth, 0.0), tangent


def _turned(stress: Array, tangent: complex) -> Array:
    """Stresses along the tangent and the depth as xx, yy, xy in the axes of the tangent's components."""
    (xx, zz, xz), c, s = stress, tangent.real, tangent.imag
    xy = -xz  # y out of the material
    return np.stack(
        [
            c * c * xx + s * s * zz - 2 * c * s * xy,
            s * s * xx + c * c * zz + 2 * c * s * xy,
            c * s * (xx - zz) + (c * c - s * s) * xy,
        ]
    )
