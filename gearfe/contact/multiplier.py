r"""The multiplier space of the exact law: hats on the halves of the quadratic edges of the slave's flank.

Each vertex and each middle of the slave's edges has a hat, linear on either side of it. With the hats
:math:`\psi_i`, the pressure is :math:`p = \sum_i \lambda_i \psi_i`, the mean gap of a hat
:math:`\bar g_i = \int\psi_i g / \int\psi_i`, and the conditions are

.. math:: \lambda_i = \max(0,\; \lambda_i - c\,\bar g_i), \qquad c > 0

(Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991; Hueeber & Wohlmuth, Comput. Methods Appl. Mech. Eng. 194,
2005). Integrals run over the part of the surface that faces the mate: hats that a sharp end of the mate cuts weigh what
is left of them.

Stability. There are as many hats as the edges have displacement nodes. For :math:`\lambda = \sum \lambda_i \psi_i` take
the displacement v with the same nodal values, :math:`v = \sum \lambda_i N_i`: on each edge the symmetric part of
:math:`\int \psi_i N_j` is positive definite, so :math:`\int \lambda v \ge c \lVert\lambda\rVert^2` with one c for all
meshes, and the inf-sup condition follows (Wohlmuth, *Acta Numerica* 20, 2011, sec. 3; linear multipliers on halves of
quadratic edges: Puso, Laursen & Solberg, Comput. Methods Appl. Mech. Eng. 197, 2008; quadratic elements in unilateral
contact: Hild & Laborde, *Appl. Numer. Math.* 41, 2002).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
IntArray = NDArray[Any]


@dataclass(frozen=True)
class Hats:
    """Hat functions on chains of half edges, at their contact points.

    Attributes
    ----------
    count
        Number of multipliers.
    numbers : ndarray, shape (q, 2)
        The two multipliers at each point's half edge: its start's and its end's.
    values : ndarray, shape (q, 2)
        Their hats there.
    """

    count: int
    numbers: IntArray
    values: Array

    def at_points(self, multipliers: Array) -> Array:
        """Pressure at the points, shape (q,)."""
        return np.sum(multipliers[self.numbers] * self.values, axis=1)

    def integrated(self, density: Array) -> Array:
        """Sum over the points of hat times `density`, shape (q,): shape (count,)."""
        return np.bincount(self.numbers.ravel(), (self.values * density[:, None]).ravel(), minlength=self.count)

    def mean(self, areas: Array, values: Array) -> Array:
        """Mean of `values` weighted with hat and area; 0 where a hat has no area left."""
        below = self.integrated(areas)
        return np.divide(self.integrated(areas * values), below, out=np.zeros(self.count), where=below > 0)

    def matrix(self, chosen: IntArray, points: IntArray) -> Array:
        """Values of the hats `chosen` at the `points`, dense, shape (points, chosen)."""
        place = np.full(self.count, -1)
        place[chosen] = np.arange(len(chosen))
        numbers = place[self.numbers[points]]
        row, side = np.nonzero(numbers >= 0)
        dense = np.zeros((len(points), len(chosen)))
        dense[row, numbers[row, side]] = self.values[points][row, side]
        return dense


def hats_on(edge: IntArray, xi: Array) -> Hats:
    """Hats for points at xi in [0, 1] of edges.

    Parameters
    ----------
    edge : ndarray, shape (q,)
        Number of the vertex at which each point's edge starts; the next vertex is where it ends. A chain of n edges has
        n + 1 vertices, so the numbers leave one out between chains.
    """
    late = (xi > 0.5).astype(np.int64)
    first, along = 2 * edge + late, 2 * xi - late
    count = 2 * int(edge.max()) + 3 if len(edge) else 0
    return Hats(count, np.stack([first, first + 1], axis=1), np.stack([1 - along, along], axis=1))
