r"""How much too stiff extruded elements of order 3 make a body: what those of order 4 would let it do.

The estimate is that of `gearfe.housing.mesh_error`, :math:`\sum_i r_i^T K_i^{-1} r_i` over the functions s_i that the
next order adds. Hierarchical functions of a prism are products of those of a triangle (of corners, edges and the
inside: Szabo, Babuska, Finite Element Analysis, 1991, ch. 6) and of a line (ends, then integrals of Legendre's);
the next order adds those products of which one factor has degree 4. Where stresses are singular the energy of the error
falls as :math:`p^{-4\alpha}`, :math:`\alpha = 0.544`: from 3 to 4 to 0.53, so that the error is 2.1 times what the
next order takes off. `FACTOR` covers what the sum over single functions and the rest of the error add to that.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from ..elasticity import Material
from ..meshing.housing_mesh import Extrusion
from ..prisms import ORDER, isotropic_blocks, lagrange, plane_parts, triangle_maps, triangle_rule
from ..typing import Array, BoolArray, IntArray
from .mesh_error import add_up, energy_taken

#: Error over what the next order's functions take one by one.
FACTOR = 4.0
#: Elements whose matrices are made at a time: they stay in the processor's cache.
ELEMENTS = 32


#: Ends of a triangle's edges.
_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
#: Rows of the plane functions of degree 4 (edges, inside), and of those of lower degree (corners, edges, inside).
_NEW, _OLD = slice(0, 5), slice(5, 15)
#: Rows of the line's functions: ends and degrees 2 to 4 with new plane functions, degree 4 with old ones.
_ALL, _FOURTH = slice(0, 5), slice(4, 5)


def prism_energy_lost(
    mesh: Extrusion, used: IntArray, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]
) -> Array:
    """Estimated energy that the mesh keeps fields from giving up, a quadratic form over them: (k, k), N m.

    Parameters
    ----------
    mesh
        The mesh (m).
    used : (n,)
        Number ``point * levels + level`` of each node.
    fields : (3 n, k)
        Nodal displacements, each in equilibrium with the inertia of its own frequency.
    eigenvalues : (k,)
        Squares of these circular frequencies (rad^2/s^2); 0 for a static field.
    rigid
        Sets of nodes that are held or move as a rigid thing: no function acts within one.
    """
    count, levels = fields.shape[1], len(mesh.levels)
    field = fields.reshape(-1, 3, count)
    plane, numbers, line = _plane(mesh), _number(mesh), _line()
    still = np.zeros((len(mesh.points) * levels, len(rigid)), dtype=bool)
    for column, chosen in enumerate(rigid):
        still[used[chosen], column] = True
    groups = [_Group(numbers.new, _NEW, _ALL), _Group(numbers.old, _OLD, _FOURTH)]
    lost = np.zeros((count, count))
    # residuals and stiffnesses of functions at the level between two layers: (plane functions, 3, k), (.., 3, 3)
    below = (np.zeros((len(numbers.new.node), 3, count)), np.zeros((len(numbers.new.node), 3, 3)))
    for layer, solid in enumerate(mesh.solid):
        chosen = np.flatnonzero(solid)
        half = 0.5 * (mesh.levels[ORDER * layer + ORDER] - mesh.levels[ORDER * layer])
        own = mesh.triangles[chosen][:, :, None] * levels + ORDER * layer + np.arange(ORDER + 1)
        own = np.searchsorted(used, own)
        for group in groups:
            total, lines = len(group.numbers.node), len(line.mass[group.line])
            residual, stiffness = np.zeros((total, lines, 3, count)), np.zeros((total, lines, 3, 3))
            for first in range(0, len(chosen), ELEMENTS):
                part = slice(first, first + ELEMENTS)
                elements = _elements(plane, line, group, chosen[part], half, material)
                found = elements.residual(field[own[part]], eigenvalues)
                place, signs = group.numbers.place[chosen[part]], group.numbers.signs[chosen[part]]
                found *= signs[:, :, None, None, None]
                add_up(place, (found, residual), (elements.own, stiffness))
            inside = _acting(group.numbers, ORDER * layer + 1, levels, still)
            for j in range(residual.shape[1]):
                if group.line == _ALL and j == 0:
                    below = (below[0] + residual[:, j], below[1] + stiffness[:, j])
                    lost += energy_taken(*below, _acting(group.numbers, ORDER * layer, levels, still))
                elif group.line == _ALL and j == 1:
                    below = (residual[:, j], stiffness[:, j])
                else:
                    lost += energy_taken(residual[:, j], stiffness[:, j], inside)
    lost += energy_taken(*below, _acting(numbers.new, levels - 1, levels, still))
    return np.asarray(FACTOR * lost)


class _Numbers(NamedTuple):
    """Numbers of plane functions in the mesh."""

    #: (m, s)
    place: IntArray
    #: (m, s) sign that makes a function the same in all its triangles
    signs: Array
    #: (count,) a node of the mesh on the corner or edge, or in the triangle, that the function belongs to
    node: IntArray


class _Group(NamedTuple):
    """Plane functions, their rows, and the rows of the line functions that they are multiplied with."""

    numbers: _Numbers
    plane: slice
    line: slice


class _BothNumbers(NamedTuple):
    new: _Numbers
    old: _Numbers


def _number(mesh: Extrusion) -> _BothNumbers:
    triangles, n = mesh.triangles, len(mesh.points)
    ends = np.sort(triangles[:, _EDGES], axis=2)
    keys, first, edge = np.unique(ends[..., 0] * n + ends[..., 1], return_index=True, return_inverse=True)
    edge = edge.reshape(-1, 3)
    e, m = len(keys), len(triangles)
    on_edge, centre, own = triangles[:, [3, 5, 7]].ravel()[first], triangles[:, 9], np.arange(m)[:, None]
    new = _Numbers(np.hstack([edge, e + own, e + m + own]), np.ones((m, 5)), np.concatenate([on_edge, centre, centre]))
    turned = np.where(triangles[:, _EDGES[:, 0]] < triangles[:, _EDGES[:, 1]], 1.0, -1.0)
    place = np.hstack([triangles[:, :3], n + edge, n + e + edge, n + 2 * e + own])
    signs = np.hstack([np.ones((m, 6)), turned, np.ones((m, 1))])
    return _BothNumbers(new, _Numbers(place, signs, np.concatenate([np.arange(n), on_edge, on_edge, centre])))


def _acting(numbers: _Numbers, level: int, levels: int, still: BoolArray) -> BoolArray:
    """Whether functions may act: those of a corner, edge or face that lies within no rigid set, by one of its nodes."""
    return np.asarray(~still[numbers.node * levels + level].any(axis=1))


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
    x, y = triangle_rule().points
    corner = np.array([1.0 - x - y, x, y])
    slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])[:, None, :]

    def product(*factors: tuple[Array, Array]) -> tuple[Array, Array]:
        value, gradient = np.ones_like(x), np.zeros((len(x), 2))
        for one, d_one in factors:
            value, gradient = value * one, gradient * one[:, None] + value[:, None] * d_one
        return value, gradient

    corners = [(corner[k], np.broadcast_to(slope[k], (len(x), 2))) for k in range(3)]
    across = [(corner[a] - corner[b], np.broadcast_to(slope[a] - slope[b], (len(x), 2))) for a, b in _EDGES]
    second = [(5.0 * t * t - 1.0, 10.0 * t[:, None] * dt) for t, dt in across]
    inside = [(one - 1.0 / 3.0, d_one) for one, d_one in corners]
    pairs = [(corners[a], corners[b]) for a, b in _EDGES]
    made = [product(*pair, third) for pair, third in zip(pairs, second, strict=True)]
    made += [product(*corners, inside[0]), product(*corners, inside[1])]
    made += corners
    made += [product(*pair) for pair in pairs]
    made += [product(*pair, odd) for pair, odd in zip(pairs, across, strict=True)]
    made += [product(*corners)]
    return np.array([value for value, _ in made]), np.array([gradient for _, gradient in made])


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
    added = {name: part[chosen][:, group.plane] for name, part in plane.added.items()}
    lower = {name: part[chosen].transpose(0, 2, 1) for name, part in plane.own.items()}
    mass, row_slope, column_slope, stiff = (
        factor * part[group.line] for factor, part in zip((half, 1.0, 1.0, 1.0 / half), line[:4], strict=True)
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

    m_own, s_own, k_own = (part[group.line] for part in line.own)
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
