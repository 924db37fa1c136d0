r"""Small-strain elasticity on extruded elements of order 3: triangles in the plane of x and z times layers along y.

An element's functions are products, :math:`\phi_{ap} = \varphi_a(x, z)\,\chi_p(y)`, and so its matrices are sums of
products of plane and line integrals,

.. math::
    \int \partial_x\phi\,\partial_z\phi = \int\partial_x\varphi_a\,\partial_z\varphi_b \int\chi_p\chi_q,\qquad
    \int \partial_x\phi\,\partial_y\phi = \int\partial_x\varphi_a\,\varphi_b \int\chi_p\chi_q' ,\ \ldots

Nothing of this is shared with the tetrahedra of `gearfe.fem.solid` but the equations, which stand there.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..base.typing import Array, BoolArray, IntArray
from .plane import Material
from .solid import SolidMatrices

#: Order of the elements in the plane and along y.
ORDER = 3
#: Places of a triangle's nodes in gmsh's order, in thirds of its sides: corners, two on each edge, the centre.
LATTICE = np.array([[0, 0], [3, 0], [0, 3], [1, 0], [2, 0], [2, 1], [1, 2], [0, 2], [0, 1], [1, 1]]) / 3.0
#: Degree of the rule on a triangle (the mass of a curved one: 3 + 3 from the product, 4 from the map).
_DEGREE = 10
#: Pairs of derivatives, of the row's function and of the column's (0 for none), whose plane integrals are wanted.
PAIRS = ("xx", "zz", "xz", "zx", "x0", "0x", "z0", "0z", "00")


class TriangleRule(NamedTuple):
    """The ten functions of a triangle of order 3 at the ``p`` points of a quadrature rule."""

    #: (2, p)
    points: Array
    #: (10, p)
    values: Array
    #: (10, p, 2)
    slopes: Array
    #: (p,)
    weights: Array


@cache
def triangle_rule() -> TriangleRule:
    """Functions that are 1 at their own node of `LATTICE`, 0 at the others."""
    from skfem.quadrature import get_quadrature_tri

    points, weights = get_quadrature_tri(_DEGREE)
    powers = np.array([(i, j) for i in range(ORDER + 1) for j in range(ORDER + 1 - i)])
    weight = np.linalg.inv(_monomials(powers, LATTICE.T))
    values = weight @ _monomials(powers, points)
    slopes = []
    for axis in range(2):
        lower = powers.copy()
        lower[:, axis] = np.maximum(powers[:, axis] - 1, 0)
        slopes.append(weight @ (powers[:, axis, None] * _monomials(lower, points)))
    return TriangleRule(points, values, np.stack(slopes, axis=-1), weights)


def _monomials(powers: IntArray, points: Array) -> Array:
    """(powers, points) values of x^i y^j."""
    return np.asarray(points[0] ** powers[:, :1] * points[1] ** powers[:, 1:])


class TriangleMaps(NamedTuple):
    """Maps of ``m`` triangles at the points of the rule."""

    #: (m, p) area that belongs to a point (m2)
    areas: Array
    #: (m, p, 2, 2) gradient of the inverse map, [reference axis, x or z]
    inverse: Array


def triangle_maps(points: Array, triangles: IntArray) -> TriangleMaps:
    """Maps of triangles (m, 10) with nodes at `points` (n, 2) (m)."""
    rule = triangle_rule()
    forward = np.einsum("eak,apm->epkm", points[triangles], rule.slopes, optimize=True)
    return TriangleMaps(np.abs(np.linalg.det(forward)) * rule.weights, np.asarray(np.linalg.inv(forward)))


def volume_ratios(points: Array, triangles: IntArray) -> Array:
    """Return (m,) smallest over mean volume ratio of each triangle at the points of the rule; 1 if straight."""
    det = np.linalg.det(np.einsum("eak,apm->epkm", points[triangles], triangle_rule().slopes, optimize=True))
    mean = det.mean(axis=1)
    return np.asarray((det * np.sign(mean)[:, None]).min(axis=1) / np.maximum(np.abs(mean), 1e-300))


def plane_parts(maps: TriangleMaps, values: Array, slopes: Array) -> dict[str, Array]:
    """(m, a, p) of functions with `values` (a, p) and reference `slopes` (a, p, 2): d/dx, d/dz, and themselves."""
    gradient = np.einsum("apm,epmk->eapk", slopes, maps.inverse, optimize=True)
    whole = np.broadcast_to(values, gradient.shape[:3])
    return {"x": gradient[..., 0], "z": gradient[..., 1], "0": whole}


def plane_integrals(points: Array, triangles: IntArray) -> dict[str, Array]:
    """(m, 10, 10) integrals over the triangles by the names of `PAIRS`."""
    rule, maps = triangle_rule(), triangle_maps(points, triangles)
    parts = plane_parts(maps, rule.values, rule.slopes)
    return {
        name: np.asarray((parts[name[0]] * maps.areas[:, None]) @ parts[name[1]].transpose(0, 2, 1)) for name in PAIRS
    }


def lagrange() -> list[np.polynomial.Polynomial]:
    """Functions of a line element on -1..1, its nodes equally spaced from end to end."""
    grid = np.linspace(-1.0, 1.0, ORDER + 1)
    made = [np.polynomial.Polynomial.fromroots(np.delete(grid, k)) for k in range(ORDER + 1)]
    return [one / one(grid[k]) for k, one in enumerate(made)]


def assemble_prisms(
    points: Array, triangles: IntArray, levels: Array, solid: BoolArray, material: Material
) -> SolidMatrices:
    """Stiffness and consistent mass as sums of (plane matrix) x (line matrix), one term for each set of solid faces.

    Over the nodes that solid elements use, in the order of their numbers ``point * levels + level``.

    Parameters
    ----------
    points : (n, 2)
        x and z (m).
    triangles : (m, 10)
        Nodes in the order of `LATTICE`.
    levels : (l,)
        y (m), `ORDER` to a layer.
    solid : (layers, m)
        Whether a triangle is solid in a layer.
    material
        The solid.
    """
    plane = plane_integrals(points, triangles)
    count = len(levels)
    size = len(points) * count
    keys: list[IntArray] = []
    terms: list[Array] = []
    masses: list[Array] = []
    sets, which = np.unique(solid, axis=0, return_inverse=True)
    for number, active in enumerate(sets):
        if not active.any():
            continue
        line = _line_integrals(levels, np.flatnonzero(which.ravel() == number))
        nodes = triangles[active]
        rows, columns = np.repeat(nodes, 10, axis=1).ravel(), np.tile(nodes, (1, 10)).ravel()
        pairs, inverse = np.unique(rows * len(points) + columns, return_inverse=True)
        flat = {
            name: np.bincount(inverse, weights=values[active].ravel(), minlength=len(pairs))[:, None]
            for name, values in plane.items()
        }
        p, q = np.nonzero(line["touch"] > 0.0)
        first = (pairs // len(points))[:, None] * count + p
        second = (pairs % len(points))[:, None] * count + q
        keys.append((first * size + second).ravel())
        m, d, k, dt = (line[name][p, q] for name in ("mass", "slope", "stiffness", "slope of the column's"))
        # derivative of the row's function, of the column's; y lies between x and z
        products = [[flat["xx"] * m, flat["x0"] * dt, flat["xz"] * m],
                    [flat["0x"] * d, flat["00"] * k, flat["0z"] * d],
                    [flat["zx"] * m, flat["z0"] * dt, flat["zz"] * m]]  # fmt: skip
        terms.append(isotropic_blocks(products, material).reshape(-1, 3, 3))
        masses.append((material.density * flat["00"] * m).ravel())
    found, place = np.unique(np.concatenate(keys), return_inverse=True)
    used, rows = np.unique(found // size, return_inverse=True)
    columns = np.searchsorted(used, found % size).astype(np.int32)  # half the memory of the masses' numbers
    starts = np.searchsorted(rows, np.arange(len(used) + 1)).astype(np.int32)
    mass, blocks = np.zeros(len(found)), np.zeros((len(found), 3, 3))
    for here in reversed(np.split(place, np.cumsum([len(one) for one in masses])[:-1])):
        mass[here] += masses.pop()  # the entries of one set are different ones
        blocks[here] += terms.pop()
    n = len(used)
    stiffness = sparse.bsr_array((blocks, columns, starts), shape=(3 * n, 3 * n))
    return SolidMatrices(stiffness, sparse.csr_array((mass, columns, starts), shape=(n, n)))


def isotropic_blocks(products: list[list[Array]], material: Material) -> Array:
    """(..., 3, 3) stiffness of isotropic elasticity between two functions.

    With ``P_ij`` (...) the integral of d_i (row's function) times d_j (column's), entry (i, j) is
    ``lambda P_ij + mu P_ji``, and mu times the trace of P more on the diagonal.
    """
    lam, mu = material.lame()
    blocks = np.empty((*products[0][0].shape, 3, 3))
    trace = mu * (products[0][0] + products[1][1] + products[2][2])
    for i in range(3):
        for j in range(3):
            blocks[..., i, j] = lam * products[i][j] + mu * products[j][i] + (trace if i == j else 0.0)
    return blocks


def _line_integrals(levels: Array, layers: IntArray) -> dict[str, Array]:
    """(l, l) integrals over the chosen layers: mass, slope (of the row's function), stiffness; which levels touch."""
    x, w = np.polynomial.legendre.leggauss(ORDER + 1)
    functions = lagrange()
    values = np.array([one(x) for one in functions])
    slopes = np.array([one.deriv()(x) for one in functions])
    made = {name: np.zeros((len(levels), len(levels))) for name in ("mass", "slope", "stiffness", "touch")}
    for layer in layers:
        at = slice(ORDER * layer, ORDER * layer + ORDER + 1)
        half = 0.5 * (levels[at][-1] - levels[at][0])
        made["mass"][at, at] += half * (values * w) @ values.T
        made["slope"][at, at] += (slopes * w) @ values.T
        made["stiffness"][at, at] += (slopes * w) @ slopes.T / half
        made["touch"][at, at] = 1.0
    made["slope of the column's"] = made["slope"].T
    return made
