r"""Small-strain elasticity of extruded and twisted bodies: plane sections times functions along the axis.

The body is a section that turns by :math:`\kappa z` along its axis z, as a helical gear does; :math:`\kappa = 0` is a
prism. In axes :math:`(\xi, \eta)` that turn with it nothing depends on z. With the displacement
:math:`(R(\kappa z)\,v,\; w)`, the quarter turn J and
:math:`L = \kappa(\eta\,\partial_\xi - \xi\,\partial_\eta)`, the derivative along z at a place at rest, strains are

.. math::
    \varepsilon_{zz} = w_{,z} + L w, \qquad
    (\gamma_{xz}, \gamma_{yz}) = \nabla w + v_{,z} + L v + \kappa J v ,

the others those of v in the plane: :math:`\varepsilon = B_0 u + B_1 u_{,z}` with operators of the section alone.
:math:`u = \sum\varphi_a(\xi,\eta)\,\chi_p(z)` then gives sums of products of section and line integrals,

.. math::
    K = A_{00}\otimes M + A_{01}\otimes C + A_{01}^T\otimes C^T + A_{11}\otimes S, \qquad
    A_{ij} = \int B_i^T E B_j, \quad M, C, S = \int\chi\chi,\ \int\chi\chi',\ \int\chi'\chi' .

Nothing is integrated over the volume. Free ends are natural conditions. v and w may have different functions. With one
constant for v and none for w, this is plane strain. A prism that is symmetric about its middle has two separate systems
of half the size: v even with w odd, and v odd with w even.

Sections are six-node triangles; a node has the unknowns of v along x, of v along y, then of w. Kronecker products of
arrays by NumPy: `scipy.sparse.kron` keeps zeros and orders the unknowns of a node apart.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.typing import Array, BoolArray, IntArray
from .multifrontal import BlockRows, Factor, eliminate, elimination_order
from .plane import Material, physical_gradients, triangle_rule

#: Stiffness of what is empty, in parts of the material's: small against all digits that are wanted, and large against
#: rounding (the fictitious domain of J. Parvizian, A. Duester, E. Rank, Finite cell method, Comput. Mech. 41, 2007).
VOID = 1e-9


@dataclass(frozen=True)
class AxialFunctions:
    """Functions along the axis at the points of a quadrature rule.

    Attributes
    ----------
    points, weights : ndarray, shape (q,)
        Rule over the whole length (m).
    values, slopes : ndarray, shape (q, n)
        The functions (-) and their derivatives (1/m).
    """

    points: Array
    weights: Array
    values: Array
    slopes: Array

    @property
    def count(self) -> int:
        """Number of functions n."""
        return self.values.shape[1]

    def combined(self, combinations: Array) -> AxialFunctions:
        """Linear combinations of the functions, one a column of `combinations`, shape (n, k)."""
        return replace(self, values=self.values @ combinations, slopes=self.slopes @ combinations)

    def by_parity(self) -> tuple[AxialFunctions, AxialFunctions]:
        """Even and odd combinations about the middle, where element ends and orders are symmetric about it."""
        n = self.count
        mirror = np.eye(n)[::-1]
        pairs = np.eye(n)[:, : n // 2]
        even = np.concatenate([pairs, np.eye(n)[:, n // 2 : (n + 1) // 2]], axis=1)
        return self.combined(even + mirror @ even), self.combined(pairs - mirror @ pairs)


def lobatto_functions(ends: Sequence[float], orders: Sequence[int], breaks: Sequence[float] = ()) -> AxialFunctions:
    """Lagrange polynomials through the Gauss-Lobatto points of line elements, continuous from one to the next.

    Parameters
    ----------
    ends : sequence of float, length k + 1
        Rising ends of the elements (m).
    orders : sequence of int, length k
        Polynomial order of each element, >= 1; a single element of order 0 has one constant.
    breaks
        Places (m) between which the quadrature is exact for products with polynomials.

    Returns
    -------
    AxialFunctions
        1 + the sum of the orders, by place.
    """
    parts: list[AxialFunctions] = []
    for number, ((low, high), order) in enumerate(zip(itertools.pairwise(ends), orders, strict=True)):
        rule, weights = np.polynomial.legendre.leggauss(order + 2)
        for a, b in itertools.pairwise(sorted({low, high, *(at for at in breaks if low < at < high)})):
            points = 0.5 * (a + b) + 0.5 * (b - a) * rule
            parts.append(replace(_on_element(ends, orders, number, points), weights=0.5 * (b - a) * weights))
    return _joined(parts)


def lobatto_functions_at(ends: Sequence[float], orders: Sequence[int], places: Array) -> AxialFunctions:
    """Return the functions of `lobatto_functions` at rising places (m) within their ends, without weights."""
    number = np.clip(np.searchsorted(ends, places, side="right") - 1, 0, len(orders) - 1)
    return _joined([_on_element(ends, orders, i, places[number == i]) for i in range(len(orders))])


def _on_element(ends: Sequence[float], orders: Sequence[int], number: int, points: Array) -> AxialFunctions:
    """All functions at points (m) of one element, without weights."""
    low, high, order = ends[number], ends[number + 1], orders[number]
    start = sum(orders[:number])
    to_nodal = np.linalg.inv(np.polynomial.legendre.legvander(_lobatto_points(order), order))
    slopes = [np.polynomial.legendre.Legendre.basis(k).deriv() for k in range(order + 1)]
    at = (2 * points - low - high) / (high - low)
    values, rates = np.zeros((2, len(points), 1 + sum(orders)))
    span = slice(start, start + order + 1)
    values[:, span] = np.polynomial.legendre.legvander(at, order) @ to_nodal
    rates[:, span] = 2 / (high - low) * np.stack([one(at) for one in slopes], axis=1) @ to_nodal
    return AxialFunctions(points, np.zeros(len(points)), values, rates)


def _joined(parts: Sequence[AxialFunctions]) -> AxialFunctions:
    names = ("points", "weights", "values", "slopes")
    return AxialFunctions(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _lobatto_points(order: int) -> Array:
    if order == 0:
        return np.zeros(1)
    inner = np.polynomial.legendre.Legendre.basis(order).deriv().roots()
    return np.concatenate([[-1.0], np.sort(np.real(inner)), [1.0]])


@dataclass(frozen=True)
class SectionIntegrals:
    """Hold A_00, A_01 and A_11 of m triangles, each of shape (m, 6, 3, 6, 3): node and axis of both functions.

    Units N/m2 (A_00), N/m (A_01) and N (A_11), of functions without unit.
    """

    straight: Array
    mixed: Array
    axial: Array


def section_integrals(points: Array, triangles: IntArray, material: Material, turn: float = 0.0) -> SectionIntegrals:
    """Integrals of the section over its triangles.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Nodes (m), the axis at the origin.
    triangles : ndarray, shape (m, 6)
        Curved six-node triangles.
    material : Material
        Elasticity.
    turn : float
        kappa (rad/m), by which the section turns along the axis.
    """
    _, _, weights, values, reference = triangle_rule()
    gradients, det = physical_gradients(points[triangles], reference)
    place = np.einsum("qa,max->mqx", values, points[triangles])
    along = turn * (place[..., 1:] * gradients[..., 0] - place[..., :1] * gradients[..., 1])  # L
    around = turn * np.broadcast_to(values, along.shape)  # of kappa J
    x, y = np.moveaxis(gradients, -1, 0)
    zeroth, first = np.zeros((2, *det.shape, 6, 6, 3))  # strains xx, yy, zz, yz, xz, xy; node; axis
    zeroth[:, :, 0, :, 0] = zeroth[:, :, 5, :, 1] = zeroth[:, :, 4, :, 2] = x
    zeroth[:, :, 1, :, 1] = zeroth[:, :, 5, :, 0] = zeroth[:, :, 3, :, 2] = y
    zeroth[:, :, 4, :, 0] = zeroth[:, :, 3, :, 1] = zeroth[:, :, 2, :, 2] = along
    zeroth[:, :, 3, :, 0], zeroth[:, :, 4, :, 1] = around, -around
    first[:, :, 4, :, 0] = first[:, :, 3, :, 1] = first[:, :, 2, :, 2] = values
    zeroth, first = (rows.reshape(*det.shape, 6, 18) for rows in (zeroth, first))
    volume = (weights * det)[..., None, None]
    stresses = [volume * (elasticity(material) @ rows) for rows in (zeroth, first)]
    m = len(triangles)

    def product(rows: Array, stress: Array) -> Array:
        flat = np.matmul(rows.reshape(m, -1, 18).transpose(0, 2, 1), stress.reshape(m, -1, 18))
        return np.asarray(flat.reshape(m, 6, 3, 6, 3))

    return SectionIntegrals(product(zeroth, stresses[0]), product(zeroth, stresses[1]), product(first, stresses[1]))


@dataclass(frozen=True)
class Layers:
    """Which triangles of a section have material between two places of the axis only.

    Elsewhere they have `VOID` of it, which holds the functions there that no material holds.

    Attributes
    ----------
    narrow : ndarray of bool, shape (m,)
        Triangles that do.
    ends
        First and last place (m) of their material, between two points of the rule of the functions along the axis.
    """

    narrow: BoolArray
    ends: tuple[float, float]

    def groups(self, functions: AxialFunctions) -> list[tuple[BoolArray, Array]]:
        """Return groups of triangles with weights of the rule: the material that they have there."""
        low, high = self.ends
        solid = (functions.points >= low) & (functions.points <= high)
        weights = functions.weights
        return [(~self.narrow, weights), (self.narrow, np.where(solid, weights, VOID * weights))]


def elasticity(material: Material) -> Array:
    """Stresses xx, yy, zz, yz, xz, xy (Pa) of strains in this order, shear strains as gamma."""
    lam, mu = material.lame()
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = lam
    matrix[range(6), range(6)] += [2 * mu] * 3 + [mu] * 3
    return matrix


def condense_extruded(
    points: Array,
    triangles: IntArray,
    section: SectionIntegrals,
    functions: tuple[AxialFunctions, AxialFunctions | None],
    *,
    retained: IntArray,
    fixed: IntArray,
    layers: Layers | None = None,
) -> Factor:
    """Factorise an extruded body down to the Schur complement of the retained nodes.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Nodes (m).
    triangles : ndarray, shape (m, 6)
        Nodes of the triangles.
    section : SectionIntegrals
        Of the triangles.
    functions : pair of AxialFunctions
        Along the axis, on one rule: of v, and of w (None: w is zero).
    retained, fixed : ndarray
        Nodes that are kept, and nodes held at zero over the whole length.
    layers : Layers, optional
        Where triangles have material along the axis; everywhere if not given.

    Returns
    -------
    Factor
        With 2 n_v + n_w unknowns a node.

    Raises
    ------
    numpy.linalg.LinAlgError
        A body that can move, or elements inside out.
    """
    plane, axial = functions
    width = 2 * plane.count + (0 if axial is None else axial.count)
    centres = points[triangles[:, :3]].mean(axis=1)
    order, ends = elimination_order(triangles, centres, nodes=len(points), retained=retained, fixed=fixed, width=width)
    number = np.full(len(points), len(order))
    number[order] = np.arange(len(order))
    matrix = _assembled(number[triangles], section, functions, len(order), layers)
    return eliminate(matrix, ends, order, len(points), len(retained))


def _assembled(
    elements: IntArray,
    section: SectionIntegrals,
    functions: tuple[AxialFunctions, AxialFunctions | None],
    nodes: int,
    layers: Layers | None = None,
) -> BlockRows:
    """Upper block rows of K on the first nodes, so many of them; the others are held."""
    shape = len(elements), 6, 6
    rows = np.broadcast_to(elements[:, :, None], shape).ravel()
    columns = np.broadcast_to(elements[:, None, :], shape).ravel()
    kept = np.flatnonzero((rows <= columns) & (columns < nodes))
    key = rows[kept] * nodes + columns[kept]
    by_key = np.argsort(key, kind="stable")
    key, kept = key[by_key], kept[by_key]
    first = np.flatnonzero(np.diff(key, prepend=-1))

    def summed(integrals: Array, chosen: BoolArray) -> Array:
        """Sums over chosen triangles by couple of nodes, shape (couples, 3, 3)."""
        of_couples = (integrals * chosen[:, None, None, None, None]).transpose(0, 1, 3, 2, 4).reshape(-1, 3, 3)
        return np.asarray(np.add.reduceat(of_couples[kept], first, axis=0))

    mixed = section.mixed
    integrals = section.straight, mixed, mixed.transpose(0, 3, 4, 1, 2), section.axial
    every = np.ones(len(elements), dtype=bool)
    groups = [(every, functions[0].weights)] if layers is None else layers.groups(functions[0])
    of_axis = [functions[0], functions[0], functions[1]]
    counts = [0 if one is None else one.count for one in of_axis]
    starts = np.cumsum([0, *counts])
    blocks = np.zeros((len(first), starts[-1], starts[-1]))
    sums = [([summed(a, chosen) for a in integrals], weights) for chosen, weights in groups]
    for (i, row), (j, column) in itertools.product(enumerate(of_axis), repeat=2):
        if row is None or column is None:
            continue
        span = slice(starts[i], starts[i + 1]), slice(starts[j], starts[j + 1])
        for parts, weights in sums:
            weighted = weights[:, None] * column.values, weights[:, None] * column.slopes
            line = [row.values.T @ weighted[0], row.values.T @ weighted[1], row.slopes.T @ weighted[0],
                    row.slopes.T @ weighted[1]]  # fmt: skip
            block = np.stack([a[:, i, j] for a in parts], axis=1) @ np.stack(line).reshape(4, -1)
            blocks[:, span[0], span[1]] += block.reshape(-1, counts[i], counts[j])
    row_of, column_of = np.divmod(key[first], nodes)
    return BlockRows(np.searchsorted(row_of, np.arange(nodes + 1)), column_of, blocks)
