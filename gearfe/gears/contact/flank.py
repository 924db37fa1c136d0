r"""The contact surface of one tooth: a chain of quadratic edges from root to tip with its quadrature points.

Edge e has the nodes 2e, 2e + 1, 2e + 2 (start, middle, end) and x(xi) = sum_a N_a(xi) x_a, 0 <= xi <= 1. The material
lies to the right of the chain, so the outward normal is the tangent turned by +90 degrees.

**Closest points.** For a slave point :math:`x_s` and the master curve :math:`x_m(\xi)` with :math:`a = x_m'` the
projection satisfies :math:`x_s - x_m(\xi) = g\,n(\xi)`. The normal is the edge's own, blended linearly into the mean of
both neighbours' at each vertex. It is then continuous along the whole chain, and so are gap and forces. (With each
edge's own normal a point that faces a vertex jumps between two solutions, and Newton's method cycles.) The contact
force acts along n at both points, so both forces are in equilibrium with any blending.

With :math:`a = x_m'`, :math:`\kappa = -a\cdot n'` is the normal's own turning.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from ...fem.plane import Material, Plane, physical_gradients, stress_rows, triangle_shapes
from ..teeth.tooth_sector import SectorMesh


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
    start
        Edge at which the working flank starts: arc lengths count from there.
    """

    nodes: IntArray
    points: Array
    shapes: Array
    weights: Array
    sizes: Array
    start: int

    @property
    def edges(self) -> int:
        """Number of edges."""
        return len(self.sizes)

    @cached_property
    def ends(self) -> Array:
        """Arc lengths of the edges' ends (m), shape (e + 1,)."""
        arc = np.concatenate([[0.0], np.cumsum(self.sizes)])
        return np.asarray(arc - arc[self.start])

    def place(self, arc: Array) -> tuple[IntArray, Array]:
        """Edges and positions in them (0 to 1) at arc lengths (m)."""
        edge = np.clip(np.searchsorted(self.ends, arc, side="right") - 1, 0, self.edges - 1)
        return edge, np.clip((arc - self.ends[edge]) / self.sizes[edge], 0.0, 1.0)

    def arc(self, place: Array) -> Array:
        """Arc lengths (m) at places: edge numbers plus positions in them."""
        return np.interp(place, np.arange(self.edges + 1), self.ends)


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
    start = int(np.flatnonzero(nodes[::2] == mesh.boundaries["flank_left"][-1, 2])[0])
    return Flank(nodes, points, shapes, weights, weights.sum(axis=1), start)


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
    r"""Return the rows of :math:`\sigma_n = n\cdot\sigma(u)\,n` at the quadrature points of the contact surface.

    With the gradients of the triangle behind the edge and the normal of the undeformed edge.

    Parameters
    ----------
    mesh : SectorMesh
        Mesh of one tooth sector.
    material : Material
        Elasticity of the gear.
    plane : str
        ``stress`` or ``strain``.
    points_per_edge : int
        Quadrature points q on each contact edge.

    Returns
    -------
    unknowns : ndarray, shape (e, 12)
        Mesh unknowns (2 node, 2 node + 1) of the triangle behind each edge.
    rows : ndarray, shape (e, q, 12)
        Coefficients (Pa/m).
    """
    chain, (xi, _) = mesh.contact_edges(), gauss_rule(points_per_edge)
    behind = np.zeros(len(mesh.points), dtype=np.int64)
    behind[mesh.triangles[:, 3:]] = np.arange(len(mesh.triangles))[:, None]
    triangles = mesh.triangles[behind[chain[:, 1]]]
    start, end = (np.eye(3)[(triangles[:, :3] == chain[:, [k]]).argmax(axis=1)][:, None] for k in (0, 2))
    _, r, s = np.moveaxis(start + (end - start) * xi[:, None], -1, 0)
    stresses = stress_rows(physical_gradients(mesh.points[triangles], triangle_shapes(r, s)[1])[0], material, plane)
    tangent = np.einsum("qa,eai->eqi", edge_shapes(xi)[1], mesh.points[chain])
    y, x = np.moveaxis(
        tangent / np.linalg.norm(tangent, axis=-1, keepdims=True), -1, 0
    )  # the normal, except for the sign of one
    rows = np.einsum("seq,eqsai->eqai", np.stack([x * x, y * y, -2 * x * y]), stresses)
    unknowns = 2 * triangles[:, :, None] + np.arange(2)
    return unknowns.reshape(len(chain), 12), rows.reshape(*r.shape, 12)


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

    That is start, linear and quadratic coefficient of x_m = start + xi linear + xi^2 quadratic (m). After them come
    what the blended normal adds to the edge's own at its start, and how much more than that at its end.
    """
    first = np.concatenate([[0], np.cumsum(counts)])
    node = 2 * np.arange(first[-1]) + np.repeat(np.arange(len(counts)), counts)
    x0, x1, x2 = nodes[node], nodes[node + 1], nodes[node + 2]
    linear, quadratic = 4 * x1 - 3 * x0 - x2, 2 * (x0 - 2 * x1 + x2)
    at_start, at_end = (1j * a / np.abs(a) for a in (linear, linear + 2 * quadratic))
    added = np.zeros((2, len(node)), dtype=complex)
    inner = np.ones(len(node), dtype=bool)
    inner[first[1:] - 1] = False
    left = np.flatnonzero(inner)
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
