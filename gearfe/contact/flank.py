"""The contact surface of one tooth: a chain of quadratic edges from root to tip with its quadrature points.

Edge e has the nodes 2e, 2e + 1, 2e + 2 (start, middle, end) and x(xi) = sum_a N_a(xi) x_a, 0 <= xi <= 1. The material
lies to the right of the chain, so the outward normal is the tangent turned by +90 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..elasticity import Material, Plane, physical_gradients, triangle_shapes
from ..meshing.tooth_sector import SectorMesh
from ..typing import Array, BoolArray, IntArray


def edge_shapes(xi: Array) -> tuple[Array, Array, Array]:
    """Values, first and second derivatives of the three edge shape functions at `xi`; each has shape (..., 3)."""
    value = np.stack([(1 - xi) * (1 - 2 * xi), 4 * xi * (1 - xi), xi * (2 * xi - 1)], axis=-1)
    first = np.stack([4 * xi - 3, 4 - 8 * xi, 4 * xi - 1], axis=-1)
    second = np.broadcast_to(np.array([4.0, -8.0, 4.0]), value.shape)
    return value, first, second


@dataclass(frozen=True)
class Flank:
    """Contact surface of one tooth in its own frame.

    Attributes
    ----------
    nodes : ndarray, shape (2 e + 1,)
        Mesh node numbers from root to tip.
    points : ndarray, shape (2 e + 1, 2)
        Their positions (m).
    shapes : ndarray, shape (q, 3)
        Edge shape functions at the quadrature points of an edge.
    weights : ndarray, shape (e, q)
        Quadrature weight times arc length (m).
    sizes : ndarray, shape (e,)
        Edge lengths (m).
    """

    nodes: IntArray
    points: Array
    shapes: Array
    weights: Array
    sizes: Array

    @property
    def edges(self) -> int:
        """Number of edges."""
        return len(self.sizes)

    @cached_property
    def ends(self) -> Array:
        """Arc lengths of the edges' ends, from the root's (m), shape (e + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.sizes)])

    def place(self, arc: Array) -> tuple[IntArray, Array]:
        """Edges and positions in them (0 to 1) at arc lengths (m)."""
        edge = np.clip(np.searchsorted(self.ends, arc, side="right") - 1, 0, self.edges - 1)
        return edge, np.clip((arc - self.ends[edge]) / self.sizes[edge], 0.0, 1.0)

    def arc_at(self, radius: float) -> float:
        """Arc length (m) at a radius (m)."""
        radii = np.linalg.norm(self.points[::2], axis=1)
        edge = int(np.clip(np.searchsorted(radii, radius) - 1, 0, self.edges - 1))
        corners = self.points[2 * edge : 2 * edge + 3]
        xi = min(1.0, max(0.0, (radius - radii[edge]) / (radii[edge + 1] - radii[edge])))
        for _ in range(8):
            value, slope, _ = edge_shapes(np.array(xi))
            point = value @ corners
            now = float(np.linalg.norm(point))
            rate = float(point @ (slope @ corners)) / now
            step = (radius - now) / rate if rate > 0 else 0.0
            xi = min(1.0, max(0.0, xi + step))
            if abs(step) < 1e-12:
                break
        at, weight = gauss_rule(10)
        return float(self.ends[edge] + xi * (weight @ np.linalg.norm(edge_shapes(xi * at)[1] @ corners, axis=-1)))


def flank_of(mesh: SectorMesh, points_per_edge: int) -> Flank:
    """Contact surface of a meshed tooth with a Gauss-Legendre rule on each edge."""
    chain = mesh.contact_edges()
    nodes = np.append(chain[:, :2].ravel(), chain[-1, 2])
    points = mesh.points[nodes]
    xi, weight = gauss_rule(points_per_edge)
    shapes, first, _ = edge_shapes(xi)
    corners = points[edge_nodes(np.arange(len(chain)))]
    speed = np.linalg.norm(np.einsum("qa,eai->eqi", first, corners), axis=-1)
    weights = speed * weight
    return Flank(nodes, points, shapes, weights, weights.sum(axis=1))


def gauss_rule(count: int) -> tuple[Array, Array]:
    """Gauss-Legendre points and weights on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(count)
    return 0.5 * (x + 1), 0.5 * w


def edge_nodes(edges: IntArray) -> IntArray:
    """Positions in the chain of the three nodes of each edge, shape (..., 3)."""
    return 2 * edges[..., None] + np.arange(3)


def normal_stress_rows(
    mesh: SectorMesh, material: Material, plane: Plane, points_per_edge: int
) -> tuple[IntArray, Array]:
    r"""Rows of :math:`\sigma_n = n\cdot\sigma(u)\,n` at the quadrature points of the contact surface.

    :math:`\sigma_n = \sum_{a,i} (\lambda N_{a,i} + 2\mu\, n_i\, n\cdot\nabla N_a)\, u_{ai}` with the gradients of the
    triangle behind the edge and the normal of the undeformed edge.

    Returns
    -------
    unknowns : ndarray, shape (e, 12)
        Mesh unknowns (2 node, 2 node + 1) of the triangle behind each edge.
    rows : ndarray, shape (e, q, 12)
        Coefficients (Pa/m).
    """
    chain = mesh.contact_edges()
    triangle, side, forward = _triangles_behind(mesh.triangles, chain)
    xi, _ = gauss_rule(points_per_edge)
    along = np.where(forward[:, None], xi, 1 - xi)  # position along the triangle's own edge direction
    corner_r, corner_s = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    after = (side + 1) % 3
    r = corner_r[side][:, None] * (1 - along) + corner_r[after][:, None] * along
    s = corner_s[side][:, None] * (1 - along) + corner_s[after][:, None] * along
    shape = r.shape
    reference = triangle_shapes(r.ravel(), s.ravel())[1].reshape(*shape, 6, 2)
    gradients, _ = physical_gradients(mesh.points[mesh.triangles[triangle]], reference)
    _, first, _ = edge_shapes(xi)
    tangent = np.einsum("qa,eai->eqi", first, mesh.points[chain])
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
    lam, mu = material.lame(plane)
    slope = np.einsum("eqaj,eqj->eqa", gradients, normal)
    rows = lam * gradients + 2 * mu * slope[..., None] * normal[:, :, None, :]
    unknowns = 2 * mesh.triangles[triangle][:, :, None] + np.arange(2)
    return unknowns.reshape(len(chain), 12), rows.reshape(*shape, 12)


def _triangles_behind(triangles: IntArray, chain: IntArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Triangle that owns each edge, which of its sides it is, and whether both run the same way."""
    slot = {int(node): k for k, node in enumerate(chain[:, 1])}
    found_triangle, found_side = np.zeros(len(chain), dtype=np.int64), np.zeros(len(chain), dtype=np.int64)
    number, side = np.nonzero(np.isin(triangles[:, 3:], chain[:, 1]))
    for t, k in zip(number, side, strict=True):
        edge = slot[int(triangles[t, 3 + k])]
        found_triangle[edge], found_side[edge] = t, k
    return found_triangle, found_side, triangles[found_triangle, found_side] == chain[:, 0]
