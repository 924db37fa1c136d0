r"""Outer surface of a body: faces, normals, and the integral of the squared normal velocity.

``integral of (v . n)^2 dA`` over faces with six nodes: with the shape functions N_a on a face this is
``v^T G^T G v``, one row of G for each quadrature point, ``sqrt(w dA) N_a n_k`` in the column of node a, axis k.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..typing import Array, IntArray


class SurfaceQuadrature(NamedTuple):
    """Values at the quadrature points of ``f`` faces, ``p`` points each."""

    #: (p, a) shape functions
    values: Array
    #: (f, p, 3) outward normals times the area that belongs to the point (m2)
    areas: Array


def surface_quadrature(nodes: Array, faces: IntArray) -> SurfaceQuadrature:
    """Shape functions and area vectors of (f, 3) or (f, 6) faces, curved or flat; exact for squares on flat faces."""
    from skfem import ElementTriP1, ElementTriP2
    from skfem.quadrature import get_quadrature_tri

    element, order = (ElementTriP1(), 2) if faces.shape[1] == 3 else (ElementTriP2(), 4)
    points, weights = get_quadrature_tri(order)
    basis = [element.lbasis(points, k) for k in range(faces.shape[1])]
    values = np.array([np.broadcast_to(v, weights.shape) for v, _ in basis]).T
    slopes = np.array([np.broadcast_to(g, (2, len(weights))) for _, g in basis])
    first, second = (np.einsum("fak,ap->fpk", nodes[faces], slopes[:, axis]) for axis in range(2))
    return SurfaceQuadrature(values, np.cross(first, second) * weights[:, None])


def nodal_normals(nodes: Array, faces: IntArray) -> Array:
    """(n, 3) outward unit normals at the nodes of the faces, weighted by area; zero at all other nodes."""
    quadrature = surface_quadrature(nodes, faces)
    total = np.zeros_like(nodes)
    weight = np.abs(quadrature.values) / np.abs(quadrature.values).sum(axis=1, keepdims=True)
    parts = np.einsum("pa,fpk->fak", weight, quadrature.areas)
    for axis in range(3):
        total[:, axis] = np.bincount(faces.ravel(), weights=parts[:, :, axis].ravel(), minlength=len(nodes))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)


def normal_velocity(quadrature: SurfaceQuadrature, faces: IntArray, n: int) -> sparse.csr_array:
    """(f p, 3 n) matrix G with ``|G v|^2`` the integral of the squared normal velocity over the faces (m4/s2)."""
    size = np.linalg.norm(quadrature.areas, axis=2)
    scaled = quadrature.areas / np.sqrt(np.maximum(size, 1e-300))[..., None]
    entries = np.einsum("pa,fpk->fpak", quadrature.values, scaled)
    f, p, a, _ = entries.shape
    columns = np.broadcast_to(3 * faces[:, None, :, None] + np.arange(3), entries.shape)
    starts = np.arange(0, f * p * a * 3 + 1, a * 3)
    return sparse.csr_array((entries.ravel(), columns.ravel(), starts), shape=(f * p, 3 * n))


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
