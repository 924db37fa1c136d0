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
from scipy.sparse import csr_array

from .closest import Projection

Array = NDArray[Any]
IntArray = NDArray[Any]

#: Derivatives of an edge's shape functions at its start and end, shape (3, 1).
AT_START, AT_END = np.array([[-3.0], [4.0], [-1.0]]), np.array([[1.0], [-4.0], [3.0]])


@dataclass(frozen=True)
class ExactRows:
    """Variations of n gaps over ten nodes each: three of the point's own edge, seven of the mate's and its neighbours.

    The points come last: numpy is several times quicker along a long axis than on pairs of components.

    Attributes
    ----------
    nodes : ndarray, shape (10, n)
        Node numbers. Neighbours that do not exist repeat others, with coefficients of 0.
    normal, slide, turn, lift : ndarray, shape (10, 2, n)
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
    own = p.edge + np.arange(3)[:, None]
    before, after = np.where(left, own - 2, own), np.where(right, own + 2, own)
    n, slave, shapes = _columns(p.normal), _columns(slave_shapes), _columns(p.shapes)
    t = np.stack([n[1], -n[0]])
    x, arrived, left_for = (placed.T.take(nodes, axis=1).transpose(1, 0, 2) for nodes in (own, before, after))
    here = _Edge.at(x, _columns(p.slopes))
    start, end = _Edge.at(x, AT_START), _Edge.at(x, AT_END)
    arriving, leaving = _Edge.at(arrived, AT_END), _Edge.at(left_for, AT_START)
    low, across_low = _mean(start, arriving, t)
    high, across_high = _mean(end, leaving, t)
    low_share, high_share = np.where(left, 1 - s, 0.0), np.where(right, s, 0.0)
    low_kink, high_kink = low - start.normal, high - end.normal
    size = _length(here.normal + low_share * low_kink + high_share * high_kink)
    bend = x[0] - 2 * x[1] + x[2]  # a' / 4
    slope = here.tangent * (-4 * _dot(here.normal, bend) / here.length**2) + right * high_kink - left * low_kink
    bow = _dot(t, slope) / size
    low_share, high_share = low_share / size, high_share / size
    steep, metric = _dot(n, here.tangent), _dot(t, here.tangent) + p.gap * bow

    # all nodes of one point and body share their axes, so few vectors have to be turned into them
    own_axes, axes = _columns(rotation[slave_nodes[:, 0]]), _columns(rotation[p.edge])
    turn = np.zeros((10, 2, count))
    turn[5:8] = here.response(t / size, axes)
    turn[5:8] += start.response(low_share * (across_low - t), axes)
    turn[5:8] += end.response(high_share * (across_high - t), axes)
    turn[3:6] += arriving.response(low_share * across_low, axes)
    turn[7:10] += leaving.response(high_share * across_high, axes)
    normal, lift = np.zeros((2, 10, 2, count))
    n_mate = _turned(n, axes)
    np.multiply(slave[:, None], _turned(n, own_axes), out=normal[:3])
    np.multiply(-shapes[:, None], n_mate, out=normal[5:8])
    np.multiply(_columns(p.slopes)[:, None], n_mate, out=lift[5:8])
    slide = turn * (-p.gap / metric)
    slide[:3] += slave[:, None] * _turned(t / metric, own_axes)
    slide[5:8] -= shapes[:, None] * _turned(t / metric, axes)
    nodes = np.concatenate([slave_nodes.T, before[:2], own, after[1:]])
    return ExactRows(nodes, normal, slide, turn, lift, steep, metric, bow)


def sparse_rows(values: Array, columns: IntArray, count: int) -> csr_array:
    """One row a point over `count` unknowns: `values` and their `columns`, shape (20, n). Doubled columns add up."""
    points = values.shape[1]
    return csr_array((values.T.ravel(), columns.T.ravel(), 20 * np.arange(points + 1)), shape=(points, count))


def turning_stiffness(
    normal: Array,
    slide: Array,
    turn: Array,
    lift: Array,
    *,
    metric: Array,
    bow: Array,
    gap: Array,
    loads: Array,
    cut: Array,
    columns: IntArray,
    count: int,
) -> Any:
    """H, sparse, shape (count, count): how contact forces turn and move with the nodes (N/m).

    Parameters
    ----------
    normal, slide, turn, lift : ndarray, shape (20, n)
        Those of `ExactRows`, the two axes of each node one after the other.
    metric, bow, gap : ndarray, shape (n,)
        Those of `ExactRows` and of the projection (m).
    loads, cut : ndarray, shape (n,)
        Forces w p at the points (N), and how they shrink as the points slide past a sharp end (N).
    columns, count
        Unknowns of the coefficients, and how many there are.
    """  # fmt: skip

    def spread(values: Array) -> csr_array:
        return sparse_rows(values, columns, count)

    found = spread(metric * slide + gap * turn).T @ spread(loads * (bow * slide + turn))
    found = found - spread(lift).T @ spread(loads * slide)
    return found + spread(normal).T @ spread(cut * slide) if cut.any() else found


def _columns(values: Array) -> Array:
    """The points' axis last, in memory too."""
    return np.ascontiguousarray(np.moveaxis(values, 0, -1))


def _turned(vectors: Array, axes: Array) -> Array:
    """v . axes, shape (2, n); written out, as products of small matrices cost ten times as much."""
    return np.asarray(vectors[0] * axes[0] + vectors[1] * axes[1])


@dataclass(frozen=True)
class _Edge:
    """Tangents a, lengths |a| and normals of n edges at one place of each; slopes of the shapes, shape (3, n or 1)."""

    slopes: Array
    tangent: Array
    length: Array
    normal: Array

    @staticmethod
    def at(corners: Array, slopes: Array) -> _Edge:
        """Of edges with the nodes `corners`, shape (3, 2, n)."""
        a = slopes[0] * corners[0] + slopes[1] * corners[1] + slopes[2] * corners[2]
        length = _length(a)
        return _Edge(slopes, a, length, np.stack([-a[1], a[0]]) / length)

    def response(self, vector: Array, axes: Array) -> Array:
        """Coefficients of vector . delta n over the edge's nodes, shape (3, 2, n), in these axes."""
        return self.slopes[:, None] * (_turned(self.normal, axes) * (-_dot(vector, self.tangent) / self.length**2))


def _mean(one: _Edge, other: _Edge, across: Array) -> tuple[Array, Array]:
    """Unit vector along the sum of both normals, and v with across . (its variation) = v . (the sum's)."""
    total = one.normal + other.normal
    length = _length(total)
    mean = total / length
    return mean, (across - _dot(across, mean) * mean) / length


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1])


def _length(a: Array) -> Array:
    return np.sqrt(_dot(a, a))
