r"""First-order effect of finite strain on the torque of a small-strain solution.

With the Green strain :math:`E = \varepsilon + \eta`, :math:`\eta = \tfrac12\nabla u^T\nabla u`, a Saint
Venant-Kirchhoff body stores :math:`\Delta W = \int \sigma(\varepsilon):\eta + \tfrac12\,\eta:C:\eta` more than the
linear one. The equilibrium minimises the whole energy, so by the envelope theorem the energy at given twist changes by
:math:`\Delta W(u)` of the small-strain solution to first order, and the torque, its derivative with the twist
:math:`\varphi`, by

.. math::
    \Delta T = \frac{d}{d\varphi}\Delta W(u(\varphi))
    = \int \big(\tau + \nabla u\,(\sigma(\varepsilon) + \tau)\big) : \nabla u', \qquad \tau = C:\eta.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..elasticity import physical_gradients, triangle_shapes
from ..typing import Array
from .compliance import GearBody, MeshingPair, sector_displacements
from .position import TORQUES, Positions

#: Sectors on either side of a loaded tooth that take part: the effect is cubic in the strain. Six instead of one change
#: the torque of the shipped pair by 2.4e-4 at 0.5 deg, and by less than 5e-5 at 0.05 deg.
NEIGHBOURS = 1
#: Positions whose fields are in memory together, and numbers (of displacement gradients) worked on at a time.
TOGETHER = 24
BLOCK = 40_000


def with_shares(found: Positions, share: Array) -> Positions:
    """Positions with their torques raised by the finite-strain shares c = Delta T / T, shape (n,).

    Both hubs' torques and the loads take the same factor: the force changes, not its line. The share grows with the
    twist about as the torque does, so the tangent takes 1 + 2 c.
    """
    made = {name: getattr(found, name) * (1 + share) for name in TORQUES} | {"tangent": found.tangent * (1 + 2 * share)}
    contacts = found.contacts
    raised = contacts.torque_wheel * (1 + share)[contacts.position]
    factors = [(1 + share)[one.position, None] for one in found.loads]
    loads = tuple(replace(o, force=o.force * f, rate=o.rate * f) for o, f in zip(found.loads, factors, strict=True))
    return replace(found, contacts=replace(contacts, torque_wheel=raised), loads=loads, **made)


def finite_strain_shares(pair: MeshingPair, found: Positions, neighbours: int = NEIGHBOURS) -> Array:
    """Delta T / T of each position, shape (n,), from its loads; 0 where there are none.

    So many `neighbours` of a loaded tooth on either side take part.
    """
    shares = np.zeros(len(found))
    loaded = np.unique(found.loads[0].position)
    for first in range(0, len(loaded), TOGETHER):
        mine = loaded[first : first + TOGETHER]
        part = found.take(mine)
        shares[mine] = sum(_extra_torques(pair, gear, part, neighbours) for gear in (0, 1)) / part.torque_wheel
    return shares


def _extra_torques(pair: MeshingPair, gear: int, found: Positions, neighbours: int) -> Array:
    """Delta T from one gear (N m), shape (n,)."""
    body, loads = pair.bodies[gear], found.loads[gear]
    near = (loads.tooth[:, None] + np.arange(-neighbours, neighbours + 1)) % body.teeth
    sectors = np.unique(loads.position[:, None] * body.teeth + near)
    position, tooth = np.divmod(sectors, body.teeth)
    energy = _energy_rates(body, sector_displacements(body, loads, position, tooth, rates=True))
    return np.bincount(position, energy, len(found))


def _energy_rates(body: GearBody, fields: Array) -> Array:
    """d Delta W / d twist of s sectors, from their displacements, then their rates, shape (nodes, 2, 2s)."""
    r, s = np.array([1, 4, 1]) / 6, np.array([1, 1, 4]) / 6  # three points, exact to degree 2
    triangles = body.mesh.triangles
    gradients, det = physical_gradients(body.mesh.points[triangles], triangle_shapes(r, s)[1])
    volume = body.thickness * det / 6
    lam, mu = body.material.lame(body.plane)
    m, sectors = len(triangles), fields.shape[2] // 2
    at = gradients.transpose(0, 1, 3, 2).reshape(m, 6, 6)  # (point, derivative) x node
    energy = np.zeros(sectors)
    step = max(1, BLOCK // max(1, 12 * sectors))  # triangles whose numbers stay in the cache
    for first in range(0, m, step):
        part = slice(first, first + step)
        own = fields[triangles[part]]
        h = np.matmul(at[part], own.reshape(len(own), 6, -1)).reshape(len(own), 3, 2, 2, 2 * sectors)
        # h[m, q, j, i] = d u_i / d x_j
        energy += volume[part].ravel() @ _density(lam, mu, h[..., :sectors], h[..., sectors:]).reshape(-1, sectors)
    return energy


def _density(lam: float, mu: float, state: Array, rate: Array) -> Array:
    """d Delta W / d twist per volume: (tau + grad u (sigma + tau)) : grad u' with tau = C:eta."""
    a, c, b, d = (state[:, :, j, i] for j in (0, 1) for i in (0, 1))  # grad u = (a b; c d)
    xx, yy, xy = 0.5 * (a * a + c * c), 0.5 * (b * b + d * d), mu * (a * b + c * d)
    mean, strain = lam * (xx + yy), lam * (a + d)
    xx, yy = mean + 2 * mu * xx, mean + 2 * mu * yy
    s_xx, s_yy, s_xy = xx + strain + 2 * mu * a, yy + strain + 2 * mu * d, xy + mu * (b + c)
    first = (xx + a * s_xx + b * s_xy) * rate[:, :, 0, 0] + (xy + a * s_xy + b * s_yy) * rate[:, :, 1, 0]
    second = (xy + c * s_xx + d * s_xy) * rate[:, :, 0, 1] + (yy + c * s_xy + d * s_yy) * rate[:, :, 1, 1]
    return np.asarray(first + second)
