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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .flank import edge_shapes

Array = NDArray[Any]
IntArray = NDArray[Any]

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

    def take(self, index: IntArray | slice) -> Projection:
        """The projections of the points `index`."""
        return Projection(**{name: getattr(self, name)[index] for name in self.__dataclass_fields__})


@dataclass(frozen=True)
class Chains:
    """Master curves: edges of all chains, prepared for projection.

    Attributes
    ----------
    first, edges : ndarray, shape (n,)
        For each slave point the first edge (in the arrays below) and the number of edges of its chain.
    reach : ndarray, shape (n,)
        How far beyond the end of its chain a point may be projected, onto the last edge continued (edges).
    table : ndarray, shape (10, e)
        Of each edge: start, linear and quadratic coefficient of x_m = start + xi linear + xi^2 quadratic (m), what the
        blended normal adds to the edge's own at its start, and how much more than that at its end.
    node : ndarray, shape (e,)
        First node of each edge.
    """

    first: IntArray
    edges: IntArray
    reach: Array
    table: Array
    node: IntArray


def chains_of(nodes: Array, counts: IntArray, chain_of: IntArray, reach: Array | None = None) -> Chains:
    """Prepare chains that follow one another in `nodes`.

    Parameters
    ----------
    nodes : ndarray, shape (k, 2)
        Nodes of all chains (m); a chain of e edges has 2 e + 1 of them.
    counts : ndarray, shape (c,)
        Number of edges of each chain.
    chain_of : ndarray, shape (n,)
        Chain that each slave point is projected onto.
    reach : ndarray, shape (n,), optional
        See `Chains`; nothing beyond the end without it.
    """
    first_edge = np.concatenate([[0], np.cumsum(counts)])
    node = 2 * np.arange(first_edge[-1]) + np.repeat(np.arange(len(counts)), counts)
    x0, x1, x2 = nodes[node], nodes[node + 1], nodes[node + 2]
    linear, quadratic = 4 * x1 - 3 * x0 - x2, 2 * (x0 - 2 * x1 + x2)
    at_start, at_end = _normal(linear), _normal(linear + 2 * quadratic)
    added = np.zeros((2, len(node), 2))
    joint = np.ones(len(node), dtype=bool)
    joint[first_edge[1:] - 1] = False
    left = np.flatnonzero(joint)
    mean = at_end[left] + at_start[left + 1]
    mean /= np.sqrt(mean[:, :1] ** 2 + mean[:, 1:] ** 2)
    added[1, left], added[0, left + 1] = mean - at_end[left], mean - at_start[left + 1]
    table = np.concatenate([x0.T, linear.T, quadratic.T, added[0].T, (added[1] - added[0]).T])
    beyond = np.zeros(len(chain_of)) if reach is None else reach
    return Chains(first_edge[chain_of], counts[chain_of], beyond, table, node)


def _normal(tangent: Array) -> Array:
    length = np.sqrt(tangent[:, 0] ** 2 + tangent[:, 1] ** 2)
    return np.stack([-tangent[:, 1] / length, tangent[:, 0] / length], axis=1)


def nearest_places(points: Array, chain: Array) -> Array:
    """Starting places on a chain of 2 e + 1 nodes: the nearest node of each point, shape (n,)."""
    nearest = np.empty(len(points))
    for first in range(0, len(points), 256):  # blocks that stay in the cache
        part = slice(first, first + 256)
        x, y = points[part, 0, None] - chain[:, 0], points[part, 1, None] - chain[:, 1]
        nearest[part] = 0.5 * np.argmin(x * x + y * y, axis=1)
    return nearest


def project(slave: Array, chains: Chains, place: Array, *, iterations: int = 15, tolerance: float = 1e-7) -> Projection:
    """Closest points by Newton's method along the chain, from the starting places `place`, shape (n,).

    Points whose projection runs off either end of the chain get the gap `OFF_END`. `tolerance` is on the last step
    along the chain (edges); what is left after it is of its square.
    """
    place = place.copy()
    last = chains.edges + chains.reach
    x, y = np.ascontiguousarray(slave[:, 0]), np.ascontiguousarray(slave[:, 1])
    moving: IntArray | None = None  # all of them
    for _ in range(iterations):
        now, edges, ends = (
            (place, chains.edges, last) if moving is None else (place[moving], chains.edges[moving], last[moving])
        )
        at = _evaluate(x, y, chains, now) if moving is None else _evaluate(x[moving], y[moving], chains, now, moving)
        # residual: the part of the distance across the normal; its slope is -|a| as long as the gap is small
        slope = at.ax * at.ny - at.ay * at.nx - (at.dx * at.ty - at.dy * at.tx)
        slope = np.maximum(slope, 0.2 * at.length)
        low = np.maximum(at.edge - 0.999, 0.0)
        high = np.where(at.edge + 1 < edges, at.edge + 1.999, ends)
        moved = np.minimum(np.maximum(now + (at.dx * at.ny - at.dy * at.nx) / slope, low), high)
        open_ = np.abs(moved - now) > tolerance
        if moving is None:
            place, moving = moved, np.flatnonzero(open_)
        else:
            place[moving] = moved
            moving = moving[open_]
        if len(moving) == 0:
            break
    at = _evaluate(x, y, chains, place)
    gap = at.dx * at.nx + at.dy * at.ny
    ends = (place <= 0) | (place >= last)
    sideways = np.abs(at.dx * at.ny - at.dy * at.nx)
    off = ends & (sideways > 1e-9 * at.length)
    gap[off] = OFF_END
    shapes, slopes, _ = edge_shapes(place - at.edge)
    normal, tangent = np.stack([at.nx, at.ny], axis=1), np.stack([at.ax, at.ay], axis=1)
    curvature = -(at.ax * at.tx + at.ay * at.ty)
    return Projection(place, gap, normal, chains.node[at.number], shapes, slopes, tangent, curvature)


class _Foot(NamedTuple):
    """Trial foot points: edge, x_s - x_m, a, |a|, blended unit normal and its derivative, edge number in the arrays."""

    edge: IntArray
    dx: Array
    dy: Array
    ax: Array
    ay: Array
    length: Array
    nx: Array
    ny: Array
    tx: Array
    ty: Array
    number: IntArray


def _evaluate(x: Array, y: Array, chains: Chains, place: Array, chosen: IntArray | slice = slice(None)) -> _Foot:
    """Components apart: numpy is several times quicker on contiguous arrays than on columns of two."""
    edge = np.minimum(place.astype(np.int64), chains.edges[chosen] - 1)
    number = chains.first[chosen] + edge
    s = place - edge
    x0, y0, lx, ly, qx, qy, sx, sy, bx, by = chains.table.take(number, axis=1)
    bow_x, bow_y = s * qx, s * qy
    dx, dy = x - x0 - s * (lx + bow_x), y - y0 - s * (ly + bow_y)
    ax, ay = lx + 2 * bow_x, ly + 2 * bow_y
    square = ax * ax + ay * ay
    length = np.sqrt(square)
    nx, ny = sx + s * bx - ay / length, sy + s * by + ax / length
    size = np.sqrt(nx * nx + ny * ny)
    kappa = 2 * (ax * qy - ay * qx) / (square * length)
    return _Foot(edge, dx, dy, ax, ay, length, nx / size, ny / size, bx - kappa * ax, by - kappa * ay, number)


def unreached(gap: Array) -> NDArray[np.bool_]:
    """Points whose projection runs off the end of the mate's surface."""
    return gap >= OFF_END
