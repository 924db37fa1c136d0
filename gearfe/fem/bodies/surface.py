r"""Outer surface of a body: faces, normals, and the integral of the squared normal velocity.

The integral of ``(v . n)^2 dA`` over faces with six nodes and shape functions N_a is ``v^T G^T G v``. G has a row for
each quadrature point, with ``sqrt(w dA) N_a n_k`` in the column of node a and axis k.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ...base.typing import Array, IntArray


class FaceFunctions(NamedTuple):
    """Functions of the ``a`` nodes of a face, at the ``p`` points of a quadrature rule."""

    #: (a, p)
    values: Array
    #: (a, p, 2) derivatives by two directions, anticlockwise seen from outside
    slopes: Array
    #: (p,)
    weights: Array

    def areas(self, place: Array) -> Array:
        """(f, p, 3) outward normals times the points' areas (m2), of faces with nodes at `place` (f, a, 3) (m)."""
        first, second = (np.einsum("fak,ap->fpk", place, self.slopes[..., axis]) for axis in range(2))
        return np.asarray(np.cross(first, second) * self.weights[:, None])


@cache
def triangle_functions(a: int) -> FaceFunctions:
    """Functions of triangles with 3 or 6 nodes; the rule is exact for squares on flat ones."""
    from skfem import ElementTriP1, ElementTriP2
    from skfem.quadrature import get_quadrature_tri

    element, order = (ElementTriP1(), 2) if a == 3 else (ElementTriP2(), 4)
    points, weights = get_quadrature_tri(order)
    basis = [element.lbasis(points, k) for k in range(a)]
    values = np.array([np.broadcast_to(v, weights.shape) for v, _ in basis])
    slopes = np.array([np.broadcast_to(g, (2, len(weights))).T for _, g in basis])
    return FaceFunctions(values, slopes, weights)


def nodal_normals(nodes: Array, faces: IntArray) -> Array:
    """(n, 3) outward unit normals at the nodes of the faces, weighted by area; zero at all other nodes."""
    functions, total = triangle_functions(faces.shape[1]), np.zeros_like(nodes)
    weight = np.abs(functions.values) / np.abs(functions.values).sum(axis=0)
    parts = np.einsum("ap,fpk->fak", weight, functions.areas(nodes[faces]))
    for axis in range(3):
        total[:, axis] = np.bincount(faces.ravel(), weights=parts[:, :, axis].ravel(), minlength=len(nodes))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)


def normal_velocity(functions: FaceFunctions, nodes: Array, faces: IntArray) -> sparse.csr_array:
    """(f p, 3 n) matrix G with ``|G v|^2`` the integral of the squared normal velocity over the faces (m4/s2)."""
    areas = functions.areas(nodes[faces])
    scaled = areas / np.sqrt(np.maximum(np.linalg.norm(areas, axis=2), 1e-300))[..., None]
    entries = np.einsum("ap,fpk->fpak", functions.values, scaled)
    f, p, a, _ = entries.shape
    columns = np.broadcast_to(3 * faces[:, None, :, None] + np.arange(3), entries.shape)
    starts = np.arange(0, f * p * a * 3 + 1, a * 3)
    return sparse.csr_array((entries.ravel(), columns.ravel(), starts), shape=(f * p, 3 * len(nodes)))


class Surface(NamedTuple):
    """Outer surface of a mesh."""

    #: (f, 3) or (f, 6) triangles, anticlockwise seen from outside
    faces: IntArray
    #: (rows, 3 n) G with ``|G v|^2`` the integral of the squared normal velocity, v the nodal velocities
    normal_velocity: sparse.csr_array

    def radiation(self, shapes: Array) -> Array:
        """(N, N) matrix R with ``qdot^T R qdot`` that integral for the field ``shapes @ qdot`` (m4/s2)."""
        rows = self.normal_velocity @ shapes
        return np.asarray(rows.T @ rows)
