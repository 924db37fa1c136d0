r"""Closest points on chains of quadratic edges, gaps, and their variations.

For a slave point :math:`x_s` and the master curve :math:`x_m(\xi)` with :math:`a = x_m'` the projection satisfies
:math:`x_s - x_m(\xi) = g\,n(\xi)`. The normal is the edge's own, blended linearly into the mean of both neighbours' at
each vertex: it is then continuous along the whole chain, and so are gap and forces. (With each edge's own normal a
point that faces a vertex jumps between two solutions and Newton's method cycles.) The contact force acts along n at
both points, so it is in equilibrium with itself whatever the blending.

With :math:`D = \delta x_s - \delta x_m` and :math:`N = n\cdot\delta x_m'` at fixed :math:`\xi`, :math:`m = a\cdot a`,
and
:math:`\kappa = -a\cdot n'` the normal's own turning,

.. math::
    \delta g = n\cdot D - (n\cdot a)\,\delta\xi, \qquad \delta\xi = \frac{a\cdot D + g N}{m - g\kappa}, \qquad
    \Delta(n\cdot D) = -(1 - g\kappa/m)(N_\Delta\,\delta\xi + N_\delta\,\Delta\xi + \kappa\,\delta\xi\,\Delta\xi)
    + \frac{g}{m} N_\Delta N_\delta

(Laursen, *Computational Contact and Impact Mechanics*, 2002, ch. 5, written out for two dimensions; the last two take
the normal's turning from the point's own edge).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..typing import Array, BoolArray, ComplexArray, IntArray
from .flank import edge_shapes

#: Gap (m) given to points whose projection runs off the end of the mate's surface: never in contact.
OFF_END = 1.0
#: Most steps of Newton's method, and its last step along the chain (edges): what is left after it is of its square.
STEPS, CLOSE = 15, 1e-7


@dataclass(frozen=True)
class Projection:
    """Closest points of n slave points; vectors are complex numbers x + i y.

    Attributes
    ----------
    place : ndarray, shape (n,)
        Edge number plus xi on the master chain.
    gap : ndarray, shape (n,)
        m, negative where the bodies overlap.
    normal : ndarray of complex, shape (n,)
        Outward unit normal of the master there.
    edge : ndarray, shape (n,)
        First node of the master edge.
    shapes : ndarray, shape (n, 3)
        Edge shape functions at the closest point.
    tangent : ndarray of complex, shape (n,)
        a (m).
    curvature : ndarray, shape (n,)
        kappa (m).
    """

    place: Array
    gap: Array
    normal: ComplexArray
    edge: IntArray
    shapes: Array
    tangent: ComplexArray
    curvature: Array

    @property
    def reached(self) -> BoolArray:
        """Whether the mate has a point that is closest: else the projection runs off the end of its surface."""
        return self.gap < OFF_END


def project(
    slave: ComplexArray,
    nodes: ComplexArray,
    counts: IntArray,
    chain_of: IntArray,
    place: Array,
    reach: Array | float = 0.0,
) -> Projection:
    """Closest points by Newton's method along the master's chains.

    Parameters
    ----------
    slave : ndarray of complex, shape (n,)
        Points (m).
    nodes : ndarray of complex, shape (k,)
        Nodes (m) of all chains, one after the other; a chain of e edges has 2 e + 1 of them.
    counts : ndarray, shape (c,)
        Number of edges of each chain.
    chain_of, place : ndarray, shape (n,)
        Chain that each slave point is projected onto, and where its search starts.
    reach : ndarray, shape (n,)
        How far beyond the end of its chain a point may be projected, onto the last edge continued (edges). Beyond, and
        before the start, the gap is `OFF_END`.
    """
    first, node, table = _edges(nodes, counts)
    first, edges = first[chain_of], counts[chain_of]
    last, place = edges + reach, place.copy()
    moving = np.arange(len(slave))
    for _ in range(STEPS):
        now = place[moving]
        at = _evaluate(slave[moving], table, first[moving], edges[moving], now)
        # residual: the part of the distance across the normal; its slope is -|a| as long as the gap is small
        slope = np.maximum(_cross(at.a, at.n) - _cross(at.d, at.turning), 0.2 * np.abs(at.a))
        low = np.maximum(at.edge - 0.999, 0.0)
        high = np.where(at.edge + 1 < edges[moving], at.edge + 1.999, last[moving])
        moved = np.minimum(np.maximum(now + _cross(at.d, at.n) / slope, low), high)
        place[moving] = moved
        moving = moving[np.abs(moved - now) > CLOSE]
        if len(moving) == 0:
            break
    at = _evaluate(slave, table, first, edges, place)
    off = ((place <= 0) | (place >= last)) & (np.abs(_cross(at.d, at.n)) > 1e-9 * np.abs(at.a))
    gap = np.where(off, OFF_END, _dot(at.d, at.n))
    shapes = edge_shapes(place - at.edge)[0]
    return Projection(place, gap, at.n, node[first + at.edge], shapes, at.a, -_dot(at.a, at.turning))


def _edges(nodes: ComplexArray, counts: IntArray) -> tuple[IntArray, IntArray, ComplexArray]:
    """First edge of each chain, first node of each edge, and of each edge the table of `_evaluate`, shape (5, e).

    That is start, linear and quadratic coefficient of x_m = start + xi linear + xi^2 quadratic (m), what the blended
    normal adds to the edge's own at its start, and how much more than that at its end.
    """
    first = np.concatenate([[0], np.cumsum(counts)])
    node = 2 * np.arange(first[-1]) + np.repeat(np.arange(len(counts)), counts)
    x0, x1, x2 = nodes[node], nodes[node + 1], nodes[node + 2]
    linear, quadratic = 4 * x1 - 3 * x0 - x2, 2 * (x0 - 2 * x1 + x2)
    at_start, at_end = (1j * a / np.abs(a) for a in (linear, linear + 2 * quadratic))
    added = np.zeros((2, len(node)), dtype=complex)
    left = np.setdiff1d(np.arange(len(node)), first[1:] - 1)
    mean = at_end[left] + at_start[left + 1]
    mean /= np.abs(mean)
    added[1, left], added[0, left + 1] = mean - at_end[left], mean - at_start[left + 1]
    return first, node, np.stack([x0, linear, quadratic, added[0], added[1] - added[0]])


class _Foot(NamedTuple):
    """Trial foot points: edge, x_s - x_m, a, blended unit normal, and the derivative of that before its scaling."""

    edge: IntArray
    d: ComplexArray
    a: ComplexArray
    n: ComplexArray
    turning: ComplexArray


def _evaluate(slave: ComplexArray, table: ComplexArray, first: IntArray, edges: IntArray, place: Array) -> _Foot:
    edge = np.minimum(place.astype(np.int64), edges - 1)
    s = place - edge
    start, linear, quadratic, added, more = table.take(first + edge, axis=1)
    a = linear + 2 * s * quadratic
    length = np.abs(a)
    n = added + s * more + 1j * a / length
    kappa = 2 * _cross(a, quadratic) / length**3
    return _Foot(edge, slave - start - s * (linear + s * quadratic), a, n / np.abs(n), more - kappa * a)


def _cross(a: ComplexArray, b: ComplexArray) -> Array:
    return a.real * b.imag - a.imag * b.real


def _dot(a: ComplexArray, b: ComplexArray) -> Array:
    return a.real * b.real + a.imag * b.imag
