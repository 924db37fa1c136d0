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

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..elasticity import physical_gradients, triangle_shapes
from .compliance import GearBody
from .recovery import flank_forces, sector_displacements
from .scene import MeshingPair
from .solver import Position

Array = NDArray[Any]

#: Sectors on either side of a loaded tooth that take part: the effect is cubic in the strain and dies out fast.
NEIGHBOURS = 2


def finite_strain_shares(pair: MeshingPair, positions: Sequence[Position]) -> Array:
    """Delta T / T of each position (not-a-number where it has no solution), shape (n,)."""
    shares = np.full(len(positions), np.nan)
    for i, position in enumerate(positions):
        if position.status == "converged":
            shares[i] = sum(_extra_torque(pair, gear, position) for gear in (0, 1)) / position.torque_wheel
    return shares


def _extra_torque(pair: MeshingPair, gear: int, position: Position) -> float:
    """Delta T from one gear (N m)."""
    assert position.scene is not None
    assert position.forces is not None
    assert position.force_rate is not None
    body = pair.bodies[gear]
    loads = flank_forces(body, gear, position.scene.windows, position.forces)
    rates = flank_forces(body, gear, position.scene.windows, position.force_rate)
    teeth = {(t + k) % body.teeth for t in loads for k in range(-NEIGHBOURS, NEIGHBOURS + 1)}
    cases = [(case, tooth) for case in (loads, rates) for tooth in sorted(teeth)]
    return _energy_rate(body, sector_displacements(body, cases))


def _energy_rate(body: GearBody, fields: Array) -> float:
    """d Delta W / d twist over the sectors whose displacements, then displacement rates, are given, (nodes, 2, 2s)."""
    r, s = np.array([1, 4, 1]) / 6, np.array([1, 1, 4]) / 6  # three points, exact to degree 2
    triangles = body.mesh.triangles
    gradients, det = physical_gradients(body.mesh.points[triangles], triangle_shapes(r, s)[1])
    volume = body.thickness * det / 6
    lam, mu = body.material.lame(body.plane)
    m, sectors = len(triangles), fields.shape[2] // 2
    at = gradients.transpose(0, 1, 3, 2).reshape(m, 6, 6)  # (point, derivative) x node
    h = np.matmul(at, fields[triangles].reshape(m, 6, -1)).reshape(m, 3, 2, 2, 2 * sectors)
    # h[m, q, j, i] = d u_i / d x_j
    state, rate = h[..., :sectors], h[..., sectors:]
    strain, strain_rate = _strain(state), _strain(rate)
    curved, curved_rate = _curved(state, state), _curved(state, rate)
    curved_rate = (2 * curved_rate[0], 2 * curved_rate[1], 2 * curved_rate[2])
    density = (
        _work(lam, mu, strain_rate, curved) + _work(lam, mu, strain, curved_rate) + _work(lam, mu, curved, curved_rate)
    )
    return float(np.einsum("mq,mqs->", volume, density))


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
