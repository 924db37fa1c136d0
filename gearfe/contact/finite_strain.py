r"""First-order effect of finite strain on the torque of a small-strain solution.

With the Green strain :math:`E = \varepsilon + \eta`, :math:`\eta = \tfrac12\nabla u^T\nabla u`, a Saint
Venant-Kirchhoff body stores :math:`\Delta W = \int \sigma(\varepsilon):\eta + \tfrac12\,\eta:C:\eta` more than the
linear one. The equilibrium minimises the whole energy, so by the envelope theorem the energy at given twist changes by
:math:`\Delta W(u)` of the small-strain solution to first order, and the torque, its derivative with the twist
:math:`\varphi`, by

.. math::
    \Delta T = \frac{d}{d\varphi}\Delta W(u(\varphi))
    = \int \sigma(\varepsilon'):\eta + \sigma(\varepsilon):\eta' + \eta:C:\eta',
    \qquad \eta' = \mathrm{sym}(\nabla u^T\nabla u').
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..elasticity import physical_gradients, triangle_shapes
from ..typing import Array, IntArray
from .compliance import GearBody, MeshingPair, sector_displacements
from .position import TORQUES, Positions

#: Sectors on either side of a loaded tooth that take part: the effect is cubic in the strain and dies out fast.
NEIGHBOURS = 1
#: Positions whose fields are in memory together, and numbers (of displacement gradients) worked on at a time.
TOGETHER = 24
BLOCK = 40_000
#: Positions at which a sweep evaluates the share; over a mesh cycle it varies by about a third of itself.
SAMPLES = 9


def sample_numbers(angles: Array, cycle: float, most: int = SAMPLES) -> IntArray:
    """At most so many of the positions at `angles` (rad), spread evenly over the mesh cycle (rad): their numbers."""
    order = np.argsort(np.mod(angles, cycle), kind="stable")
    return order[np.unique(np.linspace(0, len(order) - 1, min(most, len(order))).round().astype(np.int64))]


def interpolated_shares(angles: Array, samples: Array, shares: Array, cycle: float) -> Array:
    """Shares at `angles` from those at the angles `samples` (rad), linear in the phase; not-a-numbers are left out."""
    good = np.isfinite(shares)
    if not good.any():
        return np.zeros(len(angles))
    return np.interp(np.mod(angles, cycle), np.mod(samples[good], cycle), shares[good], period=cycle)


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
    """Delta T / T of each position, shape (n,), from its loads; not-a-number where there are none.

    So many `neighbours` of a loaded tooth on either side take part.
    """
    shares = np.full(len(found), np.nan)
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
    """d Delta W / d twist per volume."""
    strain, strain_rate = _strain(state), _strain(rate)
    curved, curved_rate = _curved(state, state), _curved(state, rate)
    curved_rate = (2 * curved_rate[0], 2 * curved_rate[1], 2 * curved_rate[2])
    both = (strain[0] + curved[0], strain[1] + curved[1], strain[2] + curved[2])
    return _work(lam, mu, strain_rate, curved) + _work(lam, mu, both, curved_rate)


#: Components 00, 11, 01 of a plane symmetric tensor.
_Tensor = tuple[Array, Array, Array]


def _curved(a: Array, b: Array) -> _Tensor:
    """sym(grad a^T grad b) / 2."""

    def product(i: int, j: int) -> Array:
        return a[:, :, i, 0] * b[:, :, j, 0] + a[:, :, i, 1] * b[:, :, j, 1]

    return 0.5 * product(0, 0), 0.5 * product(1, 1), 0.25 * (product(0, 1) + product(1, 0))


def _strain(h: Array) -> _Tensor:
    return h[:, :, 0, 0], h[:, :, 1, 1], 0.5 * (h[:, :, 0, 1] + h[:, :, 1, 0])


def _work(lam: float, mu: float, a: _Tensor, b: _Tensor) -> Array:
    """a : C : b = lam tr(a) tr(b) + 2 mu a : b."""
    return lam * (a[0] + a[1]) * (b[0] + b[1]) + 2 * mu * (a[0] * b[0] + a[1] * b[1] + 2 * a[2] * b[2])
