r"""Estimate the excess stiffness of extruded elements of order 3 from those of order 4.

The estimate is that of `fem.bodies.mesh_error`, :math:`\sum_i r_i^T K_i^{-1} r_i` over the functions s_i that the next
order adds. Hierarchical functions of a prism are products of those of a triangle (of corners, edges and the inside:
Szabo, Babuska, Finite Element Analysis, 1991, ch. 6) and of a line (ends, then integrals of Legendre's). The next order
adds those products of which one factor has degree 4. Where stresses are singular the energy of the error falls as
:math:`p^{-4\alpha}`, :math:`\alpha = 0.544`. From order 3 to 4 it falls to 0.53, so the error is 2.1 times the
reduction by the next order. `FACTOR` covers what the sum over single functions and the rest of the error add to that.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, IntArray
from ..meshing.housing_mesh import Extrusion
from ..plane import Material
from ..prisms import ORDER, isotropic_blocks, lagrange, plane_parts, triangle_maps, triangle_rule
from .mesh_error import add_up, barycentric, difference, energy_taken, product

#: Error over what the next order's functions take one by one.
FACTOR = 4.0
#: Elements whose matrices are made at a time: they stay in the processor's cache.
ELEMENTS = 32


#: Ends of a triangle's edges.
_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
#: Products by their factors: rows of the plane functions (of degree 4 first), rows of the line's (ends, then degrees 2
#: to 4), and places of these in a layer, of which each has four and the next layer's first.
_GROUPS = ((slice(0, 5), slice(0, 5), np.array([0, 4, 1, 2, 3])), (slice(5, 15), slice(4, 5), np.array([1])))


def prism_energy_lost(
    mesh: Extrusion, used: IntArray, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]
) -> Array:
    """Estimate the energy that the mesh keeps fields from giving up, a quadratic form over them.

    Parameters
    ----------
    mesh : Extrusion
        The mesh (m).
    used : (n,)
        Number ``point * levels + level`` of each node.
    material : Material
        Elasticity and density.
    fields : (3 n, k)
        Nodal displacements, each in equilibrium with the inertia of its own frequency.
    eigenvalues : (k,)
        Squares of these circular frequencies (rad^2/s^2); 0 for a static field.
    rigid
        Sets of nodes that are held or move as a rigid thing: no function acts within one.

    Returns
    -------
    energy : ndarray, shape (k, k)
        In N m.
    """
    count, levels = fields.shape[1], len(mesh.levels)
    field, plane, line, numbers = fields.reshape(-1, 3, count), _plane(mesh), _line(), _number(mesh)
    found = _found(mesh, numbers)
    residual, stiffness = np.zeros((len(found), 3, count)), np.zeros((len(found), 3, 3))
    for layer, solid in enumerate(mesh.solid):
        half = 0.5 * (mesh.levels[ORDER * layer + ORDER] - mesh.levels[ORDER * layer])
        for chosen in np.array_split(np.flatnonzero(solid), np.arange(ELEMENTS, solid.sum(), ELEMENTS)):
            own = mesh.triangles[chosen][:, :, None] * levels + ORDER * layer + np.arange(ORDER + 1)
            values = field[np.searchsorted(used, own)]
            for group in _GROUPS:
                elements = _elements(plane, line, group, chosen, half, material)
                left = elements.residual(values, eigenvalues) * numbers.signs[chosen, group[0]][..., None, None, None]
                place = np.searchsorted(found, _places(mesh, numbers, layer, chosen, group))
                add_up(place, (left, residual), (elements.own, stiffness))
    own_plane, step = divmod(found, 4 * len(mesh.solid) + 1)
    node = numbers.node[own_plane] * levels + ORDER * (step // 4) + (step % 4 > 0)
    acting = np.ones(len(found), dtype=bool)
    for chosen in rigid:
        acting &= ~np.isin(node, used[chosen])
    return FACTOR * energy_taken(residual, stiffness, acting)


class _Numbers(NamedTuple):
    """Numbers of the plane functions in the mesh."""

    #: (m, 15)
    place: IntArray
    #: (m, 15) sign that makes a function the same in all its triangles
    signs: Array
    #: (count,) a node of the mesh on the corner or edge, or in the triangle, that the function belongs to
    node: IntArray


_Group = tuple[slice, slice, IntArray]


def _number(mesh: Extrusion) -> _Numbers:
    triangles, n = mesh.triangles, len(mesh.points)
    ends = np.sort(triangles[:, _EDGES], axis=2)
    _, first, edge = np.unique(ends[..., 0] * n + ends[..., 1], return_index=True, return_inverse=True)
    edge, m = edge.reshape(-1, 3), len(triangles)
    on_edge, centre, own = triangles[:, [3, 5, 7]].ravel()[first], triangles[:, 9], np.arange(m)[:, None]
    turned = np.where(triangles[:, _EDGES[:, 0]] < triangles[:, _EDGES[:, 1]], 1.0, -1.0)
    parts = [edge, own, own, triangles[:, :3], edge, edge, own]
    nodes = [on_edge, centre, centre, np.arange(n), on_edge, on_edge, centre]
    begin = np.cumsum([0, *(len(one) for one in nodes[:-1])])
    place = np.hstack([part + offset for part, offset in zip(parts, begin, strict=True)])
    return _Numbers(place, np.hstack([np.ones((m, 11)), turned, np.ones((m, 1))]), np.concatenate(nodes))


def _places(mesh: Extrusion, numbers: _Numbers, layer: int, chosen: IntArray, group: _Group) -> IntArray:
    """(m, s, j) numbers of products in all layers, those of elements in one of them."""
    rows, _, steps = group
    return np.asarray(numbers.place[chosen, rows][:, :, None] * (4 * len(mesh.solid) + 1) + 4 * layer + steps)


def _found(mesh: Extrusion, numbers: _Numbers) -> IntArray:
    """Numbers of the products that solid elements have, ascending."""
    layers = [(layer, np.flatnonzero(solid), group) for layer, solid in enumerate(mesh.solid) for group in _GROUPS]
    return np.unique(np.concatenate([_places(mesh, numbers, *one).ravel() for one in layers]))


class _Plane(NamedTuple):
    """Derivatives at the points of the rule, with the areas that belong to these."""

    #: ``x``, ``z``, ``0`` of the added and lower functions: (m, 15, p), times the areas; of their own (m, 10, p)
    added: dict[str, Array]
    own: dict[str, Array]
    #: (m, p)
    areas: Array


def _plane(mesh: Extrusion) -> _Plane:
    rule, maps = triangle_rule(), triangle_maps(mesh.points, mesh.triangles)
    values, slopes = _triangle_functions()
    added = {name: np.asarray(part * maps.areas[:, None]) for name, part in plane_parts(maps, values, slopes).items()}
    return _Plane(added, plane_parts(maps, rule.values, rule.slopes), maps.areas)


@cache
def _triangle_functions() -> tuple[Array, Array]:
    """Values (15, p), slopes (15, p, 2): edges and inside of degree 4, then corners, edges and inside below it."""
    corners = barycentric(triangle_rule().points)
    pairs = [(corners[a], corners[b]) for a, b in _EDGES]
    across = [difference(*pair) for pair in pairs]
    second = [(5.0 * t * t - 1.0, 10.0 * t * dt) for t, dt in across]
    inside = [(one - 1.0 / 3.0, d_one) for one, d_one in corners]
    made = [product(*pair, third) for pair, third in zip(pairs, second, strict=True)]
    made += [product(*corners, inside[0]), product(*corners, inside[1])]
    made += corners
    made += [product(*pair) for pair in pairs]
    made += [product(*pair, odd) for pair, odd in zip(pairs, across, strict=True)]
    made += [product(*corners)]
    return np.array([value for value, _ in made]), np.array([slope.T for _, slope in made])


class _Line(NamedTuple):
    """Integrals over -1..1 of line functions (5 rows) times an element's own (4 columns), and with themselves."""

    mass: Array
    row_slope: Array
    column_slope: Array
    stiffness: Array
    own: tuple[Array, Array, Array]


@cache
def _line() -> _Line:
    x, w = np.polynomial.legendre.leggauss(6)
    one = np.polynomial.Polynomial
    bubble = one([1.0, 0.0, -1.0])
    functions = [one([0.5, -0.5]), one([0.5, 0.5]), bubble, bubble * one([0.0, 1.0]), bubble * one([-1.0, 0.0, 5.0])]
    values, slopes = (np.array([f(x) for f in made]) for made in (functions, [f.deriv() for f in functions]))
    own, own_slopes = (np.array([f(x) for f in made]) for made in (lagrange(), [f.deriv() for f in lagrange()]))
    themselves = (
        np.einsum("ip,ip,p->i", values, values, w),
        np.einsum("ip,ip,p->i", slopes, values, w),
        np.einsum("ip,ip,p->i", slopes, slopes, w),
    )
    pairs = ((values, own), (slopes, own), (values, own_slopes), (slopes, own_slopes))
    mass, row_slope, column_slope, stiffness = ((row * w) @ column.T for row, column in pairs)
    return _Line(mass, row_slope, column_slope, stiffness, themselves)


class _Elements(NamedTuple):
    """Matrices of elements between added functions, (plane s) x (line j), and their own, (plane 10) x (line 4)."""

    #: (m, s j 3, 120) stiffness (N/m)
    stiffness: Array
    #: (m, s j, 40) mass of one axis (kg)
    mass: Array
    #: (m, s, j, 3, 3) stiffness of each added function with itself
    own: Array

    def residual(self, values: Array, eigenvalues: Array) -> Array:
        """(m, s, j, 3, k) forces that nodal displacements (m, 10, 4, 3, k) leave unbalanced."""
        m, count = len(values), len(eigenvalues)
        shape = (*self.own.shape[:4], count)
        left = np.matmul(self.mass, values.reshape(m, -1, 3 * count)).reshape(shape)
        left *= eigenvalues
        left -= np.matmul(self.stiffness, values.reshape(m, -1, count)).reshape(shape)
        return np.asarray(left)


def _elements(
    plane: _Plane, line: _Line, group: _Group, chosen: IntArray, half: float, material: Material
) -> _Elements:
    """Matrices of the chosen triangles' elements in a layer of half the thickness `half`."""
    added = {name: part[chosen][:, group[0]] for name, part in plane.added.items()}
    lower = {name: part[chosen].transpose(0, 2, 1) for name, part in plane.own.items()}
    mass, row_slope, column_slope, stiff = (
        factor * part[group[1]] for factor, part in zip((half, 1.0, 1.0, 1.0 / half), line[:4], strict=True)
    )

    def product(row: str, column: str, along: Array) -> Array:
        return np.asarray((added[row] @ lower[column])[:, :, None, :, None] * along[:, None, :])

    # derivative of the added function, of the field; y lies between x and z
    both = isotropic_blocks(
        [[product("x", "x", mass), product("x", "0", column_slope), product("x", "z", mass)],
         [product("0", "x", row_slope), product("0", "0", stiff), product("0", "z", row_slope)],
         [product("z", "x", mass), product("z", "0", column_slope), product("z", "z", mass)]], material
    )  # fmt: skip
    areas = np.maximum(plane.areas[chosen][:, None], 1e-300)

    def with_itself(one: str, two: str, along: Array) -> Array:
        return np.asarray(np.sum(added[one] * added[two] / areas, axis=2)[:, :, None] * along)

    m_own, s_own, k_own = (part[group[1]] for part in line.own)
    xy, yz = with_itself("x", "0", s_own), with_itself("z", "0", s_own)
    xz = with_itself("x", "z", half * m_own)
    own = isotropic_blocks(
        [[with_itself("x", "x", half * m_own), xy, xz],
         [xy, with_itself("0", "0", k_own / half), yz],
         [xz, yz, with_itself("z", "z", half * m_own)]], material
    )  # fmt: skip
    m, s, j = both.shape[:3]
    stiffness = both.transpose(0, 1, 2, 5, 3, 4, 6).reshape(m, 3 * s * j, -1)
    return _Elements(stiffness, material.density * product("0", "0", mass).reshape(m, s * j, -1), own)
