r"""Closest points on chains of quadratic edges, gaps, and their variations.

For a slave point :math:`x_s` and the master curve :math:`x_m(\xi)` with :math:`a = x_m'` the projection satisfies
:math:`x_s - x_m(\xi) = g\,n(\xi)`. The normal is the edge's own, blended linearly into the mean of both neighbours' at
each vertex: it is then continuous along the whole chain, and so are gap and forces. (With each edge's own normal a point
that faces a vertex jumps between two solutions and Newton's method cycles.) The contact force acts along n at both
points, so it is in equilibrium with itself whatever the blending.

With :math:`D = \delta x_s - \delta x_m` and :math:`N = n\cdot\delta x_m'` at fixed :math:`\xi`, :math:`m = a\cdot a`, and
:math:`\kappa = -a\cdot n'` the normal's own turning,

.. math::
    \delta g = n\cdot D - (n\cdot a)\,\delta\xi, \qquad \delta\xi = \frac{a\cdot D + g N}{m - g\kappa}, \qquad
    \Delta(n\cdot D) = -(1 - g\kappa/m)(N_\Delta\,\delta\xi + N_\delta\,\Delta\xi + \kappa\,\delta\xi\,\Delta\xi)
    + \frac{g}{m} N_\Delta N_\delta

(Laursen, *Computational Contact and Impact Mechanics*, 2002, ch. 5, written out for two dimensions; the last expression
leaves out products of n.a, which is of the order of the kinks between edges).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .flank import edge_shapes

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Gap (m) given to points whose projection runs off the end of the mate's surface: never in contact.
OFF_END = 1.0


@dataclass(frozen=True)
class Projection:
    """Closest points of n slave points.

    Attributes
    ----------
    place : ndarray, shape (n,)
        Edge number plus xi on the master chain.
    gap : ndarray, shape (n,)
        m, negative where the bodies overlap.
    normal : ndarray, shape (n, 2)
        Outward unit normal of the master there.
    edge : ndarray, shape (n,)
        First node of the master edge.
    shapes, slopes : ndarray, shape (n, 3)
        Edge shape functions and their derivatives at the closest point.
    tangent : ndarray, shape (n, 2)
        a (m).
    curvature : ndarray, shape (n,)
        kappa (m).
    """

    place: Array
    gap: Array
    normal: Array
    edge: IntArray
    shapes: Array
    slopes: Array
    tangent: Array
    curvature: Array

    def take(self, index: IntArray) -> Projection:
        """The projections of the points `index`."""
        return Projection(**{name: getattr(self, name)[index] for name in self.__dataclass_fields__})


@dataclass(frozen=True)
class Chains:
    """Master curves: edges of all chains, prepared for projection.

    Attributes
    ----------
    first, edges : ndarray, shape (n,)
        For each slave point the first edge (in the arrays below) and the number of edges of its chain.
    start, linear, quadratic : ndarray, shape (e, 2)
        x_m = start + xi linear + xi^2 quadratic on each edge (m).
    bend_start, bend_end : ndarray, shape (e, 2)
        What the blended normal adds to the edge's own at its two ends.
    node : ndarray, shape (e,)
        First node of each edge.
    """

    first: IntArray
    edges: IntArray
    start: Array
    linear: Array
    quadratic: Array
    bend_start: Array
    bend_end: Array
    node: IntArray


def chains_of(nodes: Array, counts: IntArray, chain_of: IntArray) -> Chains:
    """Prepare chains that follow one another in `nodes`.

    Parameters
    ----------
    nodes : ndarray, shape (k, 2)
        Nodes of all chains (m); a chain of e edges has 2 e + 1 of them.
    counts : ndarray, shape (c,)
        Number of edges of each chain.
    chain_of : ndarray, shape (n,)
        Chain that each slave point is projected onto.
    """
    first_edge = np.concatenate([[0], np.cumsum(counts)])
    node = 2 * np.arange(first_edge[-1]) + np.repeat(np.arange(len(counts)), counts)
    x0, x1, x2 = nodes[node], nodes[node + 1], nodes[node + 2]
    linear, quadratic = 4 * x1 - 3 * x0 - x2, 2 * (x0 - 2 * x1 + x2)
    at_start, at_end = _normal(linear), _normal(linear + 2 * quadratic)
    bend_start, bend_end = np.zeros_like(at_start), np.zeros_like(at_end)
    joint = np.ones(len(node), dtype=bool)
    joint[first_edge[1:] - 1] = False
    left = np.flatnonzero(joint)
    mean = at_end[left] + at_start[left + 1]
    mean /= np.sqrt(mean[:, :1] ** 2 + mean[:, 1:] ** 2)
    bend_end[left], bend_start[left + 1] = mean - at_end[left], mean - at_start[left + 1]
    return Chains(first_edge[chain_of], counts[chain_of], x0, linear, quadratic, bend_start, bend_end, node)


def _normal(tangent: Array) -> Array:
    length = np.sqrt(tangent[:, 0] ** 2 + tangent[:, 1] ** 2)
    return np.stack([-tangent[:, 1] / length, tangent[:, 0] / length], axis=1)


def nearest_places(points: Array, chain: Array) -> Array:
    """Starting places on a chain of 2 e + 1 nodes: the nearest node of each point, shape (n,)."""
    x, y = points[:, 0, None] - chain[:, 0], points[:, 1, None] - chain[:, 1]
    return 0.5 * np.argmin(x * x + y * y, axis=1).astype(np.float64)


def project(
    slave: Array, chains: Chains, place: Array, *, iterations: int = 15, tolerance: float = 1e-12
) -> Projection:
    """Closest points by Newton's method along the chain, from the starting places `place`, shape (n,).

    Points whose projection runs off either end of the chain get the gap `OFF_END`.
    """
    place = place.copy()
    for _ in range(iterations):
        edge, xi, distance, a, normal, turning, _ = _evaluate(slave, chains, place)
        metric = a[:, 0] ** 2 + a[:, 1] ** 2
        # residual: the part of the distance across the normal, measured along a
        across = distance[:, 0] * normal[:, 1] - distance[:, 1] * normal[:, 0]
        slope = a[:, 0] * normal[:, 1] - a[:, 1] * normal[:, 0]
        slope -= distance[:, 0] * turning[:, 1] - distance[:, 1] * turning[:, 0]
        root = np.sqrt(metric)
        slope = np.maximum(slope, 0.2 * root)
        moved = np.clip(place + across / slope, edge - 0.999, edge + 1.999)
        moved = np.clip(moved, 0.0, chains.edges)
        step, place = moved - place, moved
        if np.max(np.abs(step), initial=0.0) < tolerance:
            break
    edge, xi, distance, a, normal, turning, number = _evaluate(slave, chains, place)
    gap = distance[:, 0] * normal[:, 0] + distance[:, 1] * normal[:, 1]
    across = distance[:, 0] * normal[:, 1] - distance[:, 1] * normal[:, 0]
    length = np.sqrt(a[:, 0] ** 2 + a[:, 1] ** 2)
    gap[((place <= 0) | (place >= chains.edges)) & (np.abs(across) > 1e-9 * length)] = OFF_END
    shapes, slopes, _ = edge_shapes(xi)
    curvature = -(a[:, 0] * turning[:, 0] + a[:, 1] * turning[:, 1])
    return Projection(place, gap, normal, chains.node[number], shapes, slopes, a, curvature)


def _evaluate(
    slave: Array, chains: Chains, place: Array
) -> tuple[IntArray, Array, Array, Array, Array, Array, IntArray]:
    """Edge, xi, x_s - x_m, tangent, blended unit normal and its derivative, and the edge's number in the arrays."""
    edge = np.minimum(place.astype(np.int64), chains.edges - 1)
    xi = place - edge
    number = chains.first + edge
    s = xi[:, None]
    linear, quadratic = chains.linear[number], chains.quadratic[number]
    distance = slave - chains.start[number] - s * (linear + s * quadratic)
    b = 2 * quadratic
    a = linear + s * b
    length = np.sqrt(a[:, 0] ** 2 + a[:, 1] ** 2)[:, None]
    own = np.stack([-a[:, 1], a[:, 0]], axis=1) / length
    kappa = (own[:, 0] * b[:, 0] + own[:, 1] * b[:, 1])[:, None]
    start, end = chains.bend_start[number], chains.bend_end[number]
    normal = own + (1 - s) * start + s * end
    size = np.sqrt(normal[:, 0] ** 2 + normal[:, 1] ** 2)[:, None]
    turning = -kappa / length**2 * a + end - start
    return edge, xi, distance, a, normal / size, turning, number


def unreached(gap: Array) -> NDArray[np.bool_]:
    """Points whose projection runs off the end of the mate's surface."""
    return gap >= OFF_END


def gap_rows(
    projection: Projection, master_nodes: IntArray, slave_nodes: IntArray, slave_shapes: Array, size: int
) -> tuple[Array, Array, Array]:
    """Dense rows of n.D, N and dxi over the unknowns of all nodes (two a node), in the frame of the nodes.

    Parameters
    ----------
    master_nodes, slave_nodes : ndarray, shape (n, 3)
        Nodes of the edge projected onto and of the point's own edge, below `size`.
    slave_shapes : ndarray, shape (n, 3)
        Shape functions of the slave edge at the point.
    size
        Number of nodes.

    Returns
    -------
    gap, tilt, slide : ndarray, shape (n, size, 2)
        n.D; N; delta xi (per metre).
    """
    p = projection
    rows = np.arange(len(p.gap))[:, None]
    gap = np.zeros((len(p.gap), size, 2))
    tilt, slide = np.zeros_like(gap), np.zeros_like(gap)
    normal, tangent = p.normal[:, None, :], p.tangent[:, None, :]
    gap[rows, slave_nodes] = slave_shapes[:, :, None] * normal
    gap[rows, master_nodes] = -p.shapes[:, :, None] * normal
    tilt[rows, master_nodes] = p.slopes[:, :, None] * normal
    slide[rows, slave_nodes] = slave_shapes[:, :, None] * tangent
    slide[rows, master_nodes] = -p.shapes[:, :, None] * tangent
    metric = np.einsum("ni,ni->n", p.tangent, p.tangent)
    slide = (slide + p.gap[:, None, None] * tilt) / (metric - p.gap * p.curvature)[:, None, None]
    return gap, tilt, slide
