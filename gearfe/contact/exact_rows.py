r"""Exact variations of the gaps on chains of quadratic edges, with the blended normals' own dependence on the nodes.

`gearfe.contact.closest` writes the variations with the turning of the blended normal from the point's own edge. That is
all there is on a smooth surface; where a corner dents the mate, edges meet at kinks, and what the neighbours' ends add
to the normal counts as much. With :math:`x_s - x_m(\xi) = g\,n`, :math:`t` the unit vector across n,
:math:`D = \delta x_s - \delta x_m`, :math:`\tau = t\cdot a`, :math:`\nu = t\cdot n'`,
:math:`\vartheta_\delta = t\cdot\delta n` at fixed :math:`\xi`, :math:`A_\delta = n\cdot\delta x_m'` and
:math:`M = \tau + g\nu`, the two components of :math:`\delta(x_s - x_m - g\,n) = 0` give

.. math::
    \delta g = n\cdot D - (n\cdot a)\,\delta\xi, \qquad M\,\delta\xi = t\cdot D - g\,\vartheta_\delta

and, as :math:`t\cdot D = M\,\delta\xi + g\,\vartheta_\delta`,

.. math::
    \Delta(n\cdot D) = (\nu\,\Delta\xi + \vartheta_\Delta)(M\,\delta\xi + g\,\vartheta_\delta) - A_\delta\,\Delta\xi .

The blended normal is :math:`n = b/|b|`, :math:`b = n_e(\xi) + (1-\xi)(\bar n_0 - n_e(0)) + \xi(\bar n_1 - n_e(1))` with
the edge's own normal :math:`n_e` and the unit vectors :math:`\bar n = S/|S|` along the sums S of both edges' normals at
each end; :math:`\delta n_e = -t_e (n_e\cdot\delta a_e)/|a_e|` everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Projection

Array = NDArray[Any]
IntArray = NDArray[Any]

#: Ranges of a point's ten nodes within which no node is met twice.
PARTS = (slice(0, 3), slice(3, 5), slice(5, 8), slice(8, 10))
#: Derivatives of an edge's shape functions at its start and end.
AT_START, AT_END = np.array([-3.0, 4.0, -1.0]), np.array([1.0, -4.0, 3.0])


@dataclass(frozen=True)
class ExactRows:
    """Variations of n gaps over ten nodes each: three of the point's own edge, seven of the mate's and its neighbours.

    Attributes
    ----------
    nodes : ndarray, shape (n, 10)
        Node numbers. Neighbours that do not exist repeat others, with coefficients of 0.
    normal, slide, turn, lift : ndarray, shape (n, 10, 2)
        Coefficients of n.D, delta xi, theta and A, in the axes of the tooth that each node belongs to.
    steep, metric, bow : ndarray, shape (n,)
        n.a, M and nu.
    """

    nodes: IntArray
    normal: Array
    slide: Array
    turn: Array
    lift: Array
    steep: Array
    metric: Array
    bow: Array


def exact_rows(
    projection: Projection,
    edges: IntArray,
    placed: Array,
    slave_nodes: IntArray,
    slave_shapes: Array,
    rotation: Array,
) -> ExactRows:
    """Variations at the closest points `projection`.

    Parameters
    ----------
    edges : ndarray, shape (n,)
        Number of edges of the chain that each point is projected onto.
    placed : ndarray, shape (k, 2)
        Places of all nodes (m).
    slave_nodes, slave_shapes : ndarray, shape (n, 3)
        Nodes of each point's own edge and its shape functions there.
    rotation : ndarray, shape (k, 2, 2)
        Tooth axes to global axes, of each node.
    """
    p, count = projection, len(projection.gap)
    number = np.minimum(p.place.astype(np.int64), edges - 1)
    s = p.place - number
    left, right = number > 0, number + 1 < edges
    own = p.edge[:, None] + np.arange(3)
    before = np.where(left[:, None], own - 2, own)
    after = np.where(right[:, None], own + 2, own)
    n, a = p.normal, p.tangent
    t = np.stack([n[:, 1], -n[:, 0]], axis=1)
    here = _Edge.at(placed, own, p.slopes, a)
    start, end = _Edge.at(placed, own, AT_START), _Edge.at(placed, own, AT_END)
    arriving, leaving = _Edge.at(placed, before, AT_END), _Edge.at(placed, after, AT_START)
    low, across_low = _mean(start, arriving, t)
    high, across_high = _mean(end, leaving, t)
    low_share, high_share = np.where(left, 1 - s, 0.0), np.where(right, s, 0.0)
    bend = placed[own[:, 0]] - 2 * placed[own[:, 1]] + placed[own[:, 2]]  # a' / 4
    blended = here.normal + low_share[:, None] * (low - start.normal) + high_share[:, None] * (high - end.normal)
    size = np.sqrt(_dot(blended, blended))
    slope = here.tangent * (-4 * _dot(here.normal, bend) / here.length**2)[:, None]
    slope += right[:, None] * (high - end.normal) - left[:, None] * (low - start.normal)
    bow = _dot(t, slope) / size

    turn = np.zeros((count, 7, 2))
    low_share, high_share = low_share[:, None] / size[:, None], high_share[:, None] / size[:, None]
    turn[:, 2:5] = here.response(t / size[:, None])
    turn[:, 2:5] += start.response(low_share * (across_low - t)) + end.response(high_share * (across_high - t))
    turn[:, 0:3] += arriving.response(low_share * across_low)
    turn[:, 4:7] += leaving.response(high_share * across_high)

    normal, slide, lift = np.zeros((3, count, 10, 2))
    spun = np.zeros((count, 10, 2))
    steep, metric = _dot(n, a), _dot(t, a) + p.gap * bow
    normal[:, :3], normal[:, 5:8] = slave_shapes[:, :, None] * n[:, None], -p.shapes[:, :, None] * n[:, None]
    slide[:, :3], slide[:, 5:8] = slave_shapes[:, :, None] * t[:, None], -p.shapes[:, :, None] * t[:, None]
    spun[:, 3:] = turn
    slide = (slide - p.gap[:, None, None] * spun) / metric[:, None, None]
    lift[:, 5:8] = p.slopes[:, :, None] * n[:, None]
    nodes = np.concatenate([slave_nodes, before[:, :2], own, after[:, 1:]], axis=1)
    axes = rotation[nodes]
    normal, slide, spun, lift = (_turned(x, axes) for x in (normal, slide, spun, lift))
    return ExactRows(nodes, normal, slide, spun, lift, steep, metric, bow)


def _turned(vectors: Array, axes: Array) -> Array:
    """v . axes of each node, shape (n, 10, 2); written out, as products of small matrices cost ten times as much."""
    made = vectors[..., :1] * axes[..., 0, :]
    made += vectors[..., 1:] * axes[..., 1, :]
    return made


@dataclass(frozen=True)
class _Edge:
    """Tangents a, lengths |a| and normals of edges at one place of each, and the slopes there, shape (n, 3)."""

    slopes: Array
    tangent: Array
    length: Array
    normal: Array

    @staticmethod
    def at(placed: Array, nodes: IntArray, slopes: Array, tangent: Array | None = None) -> _Edge:
        slopes = np.broadcast_to(slopes, nodes.shape)
        a = np.matmul(slopes[:, None, :], placed[nodes])[:, 0] if tangent is None else tangent
        length = np.sqrt(_dot(a, a))
        return _Edge(slopes, a, length, np.stack([-a[:, 1], a[:, 0]], axis=1) / length[:, None])

    def response(self, vector: Array) -> Array:
        """Coefficients of vector . delta n over the edge's nodes, shape (n, 3, 2)."""
        share = -_dot(vector, self.tangent) / self.length**2
        return (share[:, None] * self.slopes)[:, :, None] * self.normal[:, None]


def _mean(one: _Edge, other: _Edge, across: Array) -> tuple[Array, Array]:
    """Unit vector along the sum of both normals, and v with across . (its variation) = v . (the sum's)."""
    total = one.normal + other.normal
    length = np.sqrt(_dot(total, total))[:, None]
    mean = total / length
    return mean, (across - _dot(across, mean)[:, None] * mean) / length


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)
