r"""Quadrature points on slave edges: a Gauss rule on each edge, or on each of its segments.

The virtual work of the pressure has a kink at the points of a slave edge that face vertices of the mate, and is smooth
between them. Shape functions and normal of the mate are only continuous at vertices. With a Gauss rule across such a
kink a uniform pressure on a flat interface is no solution. With a rule on each segment between the kinks it is one
(Puso & Laursen, *Comput. Methods Appl. Mech. Eng.* 193, 2004; Farah, Popp & Wall, *Comput. Mech.* 55, 2015, compare
both). A vertex :math:`x_v` with the blended normal :math:`n_v` faces the slave point with

.. math:: (x_s(\xi) - x_v) \times n_v = 0,

a quadratic equation on a quadratic edge. Breaks are placed in the current configuration and move with it. Their motion
adds nothing to the derivative of the integral, because the integrand is continuous at them. The remaining error is of
the order of the quadrature error, and Newton's method converges fast.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ....base.typing import Array, IntArray
from ..flank import gauss_rule

Quadrature = Literal["points", "segments"]

#: Length (edges) below which a segment is left out: rounding of the breaks.
SHORTEST = 1e-9


def whole_edges(edge: IntArray, count: int) -> tuple[IntArray, Array, Array]:
    """Return edge, place on it (0 to 1) and weight (1 in sum) of the points of a Gauss rule on each edge."""
    return _gauss(edge, np.zeros(len(edge)), np.ones(len(edge)), count)


def segments(edge: IntArray, slave: Array, mate: Array, count: int) -> tuple[IntArray, Array, Array]:
    """Return edge, place on it and weight of the points of a Gauss rule on each segment.

    Parameters
    ----------
    edge : ndarray, shape (k,)
        Slave edges that get points.
    slave : ndarray, shape (e, 3, 2)
        Present places of the nodes of all slave edges (m).
    mate : ndarray, shape (2 f + 1, 2)
        Present places of the nodes of the mate's chain (m).
    count
        Points on each segment.
    """
    cut, xi = breaks(slave[edge], mate)
    pieces = np.concatenate([np.stack([edge, 0 * edge], axis=1), np.stack([edge[cut], xi], axis=1)])
    of, start = pieces[np.lexsort(pieces.T[::-1])].T
    end = np.where(np.append(of[1:] != of[:-1], True), 1.0, np.append(start[1:], 1.0))
    kept = end - start > SHORTEST
    return _gauss(of[kept].astype(np.int64), start[kept], end[kept], count)


def _gauss(edge: IntArray, start: Array, end: Array, count: int) -> tuple[IntArray, Array, Array]:
    at, weight = gauss_rule(count)
    length = (end - start)[:, None]
    return np.repeat(edge, count), (start[:, None] + length * at).ravel(), (length * weight).ravel()


def breaks(slave: Array, mate: Array) -> tuple[IntArray, Array]:
    """Return slave edges and places on them (0 to 1) that face vertices and ends of the mate's chain."""
    vertices, normals = mate[::2], _vertex_normals(mate)
    x0, x1, x2 = slave[:, 0], slave[:, 1], slave[:, 2]
    linear, quadratic = 4 * x1 - 3 * x0 - x2, 2 * (x0 - 2 * x1 + x2)
    c = _cross(x0 - vertices[:, None], normals[:, None])
    b = _cross(linear, normals[:, None])
    a = _cross(quadratic, normals[:, None])
    # roots of a xi^2 + b xi + c in the form that survives a = 0
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -0.5 * (b + np.where(b < 0, -1.0, 1.0) * np.sqrt(b * b - 4 * a * c))
        roots = np.stack([c / q, q / a])
    reach = np.linalg.norm(np.ptp(mate, axis=0))
    _, vertex, edge = inside = np.nonzero(np.isfinite(roots) & (roots > 0) & (roots < 1))
    xi = roots[inside][:, None]
    apart = x0[edge] + xi * (linear[edge] + xi * quadratic[edge]) - vertices[vertex]
    near = np.linalg.norm(apart, axis=1) < reach
    return edge[near], xi[near, 0]


def _vertex_normals(chain: Array) -> Array:
    """Return normals at the vertices of a chain, blended as `gearfe.gears.contact.flank` does, shape (f + 1, 2)."""
    x0, x1, x2 = chain[:-2:2], chain[1:-1:2], chain[2::2]
    at_start, at_end = _normal(4 * x1 - 3 * x0 - x2), _normal(x0 - 4 * x1 + 3 * x2)
    mean = at_end[:-1] + at_start[1:]
    return np.concatenate([at_start[:1], mean / np.linalg.norm(mean, axis=1, keepdims=True), at_end[-1:]])


def _normal(tangent: Array) -> Array:
    return np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / np.linalg.norm(tangent, axis=1, keepdims=True)


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
