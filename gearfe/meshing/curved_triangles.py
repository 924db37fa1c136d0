"""Triangles of second order: nodes in the middle of edges, and whether the elements are the right way out."""

from __future__ import annotations

import numpy as np

from ..elasticity import triangle_shapes
from ..typing import Array, IntArray

#: Places in a triangle at which its Jacobian is looked at (area coordinates): det is quadratic there.
_EACH = 6
_PLACES = np.array([(i, j, _EACH - i - j) for i in range(_EACH + 1) for j in range(_EACH + 1 - i)]) / _EACH


def least_jacobian(points: Array, triangles: Array) -> Array:
    r"""Smallest :math:`\det \partial x/\partial \xi` of each triangle, in twice its straight area (-).

    It is looked at on a lattice with seven places along each edge. Where it is not positive, the element is inside out
    there; a triangle without area has not-a-number or infinity.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Positions (m).
    triangles : ndarray, shape (m, 6)
        Corners counter-clockwise, then the nodes in the middle of edges 01, 12, 20.
    """
    place = points[triangles]
    slopes = triangle_shapes(*_PLACES[:, 1:].T)[1]
    (u, v), (r, s) = np.einsum("nki,pkj->ijnp", place, slopes, optimize=True)
    least = (u * s - v * r).min(axis=1)
    u, v = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return least / np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def second_order(corners: Array, triangles: IntArray) -> tuple[Array, IntArray, IntArray]:
    """Add a node in the middle of each edge of straight triangles.

    Returns
    -------
    points, triangles
        With the new nodes after the corners.
    edges : ndarray, shape (e, 2)
        Corners of the edges, the smaller number first, in lexical order; edge k has the middle node len(corners) + k.
    """
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, first, inverse = np.unique(edges[:, 0] * len(corners) + edges[:, 1], return_index=True, return_inverse=True)
    pairs = edges[first]
    middles = 0.5 * (corners[pairs[:, 0]] + corners[pairs[:, 1]])
    quadratic = np.concatenate([triangles, len(corners) + inverse.reshape(-1, 3)], axis=1)
    return np.concatenate([corners, middles]), quadratic, pairs
