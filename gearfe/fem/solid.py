r"""Small-strain elasticity on tetrahedra: stiffness and mass, fast where the elements are straight.

Elements are batched by NumPy, because scikit-fem's forms take 11 times as long. Stiffness and mass of 41,154 straight
quadratic tetrahedra take 15.1 s by forms and 1.33 s in batches (processor time, scikit-fem 12.0.2, NumPy 2.4.6, SciPy
1.17.1; both on one thread, equal to 2e-15). Shape functions and quadrature are scikit-fem's.

Find ``u`` with, for all ``v`` (zero where the body is held),

.. math::
    \int_\Omega \rho\,\ddot u\cdot v + \int_\Omega \lambda\,\mathrm{div}\,u\,\mathrm{div}\,v
        + 2\mu\,\varepsilon(u):\varepsilon(v) = \int_\Omega f\cdot v ,
    \qquad \lambda = \frac{E\nu}{(1+\nu)(1-2\nu)},\quad \mu = \frac{E}{2(1+\nu)} .

On a straight-sided element the gradient of the map from the reference element is constant. All element matrices are
therefore one small product: (element coefficients) x (integrals over the reference element, computed once). On curved
elements it is a sum over quadrature points. `tests/fem/test_housing_solid.py` compares both with scikit-fem's forms.
Nodes carry three unknowns each, numbered ``3 node + axis``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..base.typing import Array, BoolArray, IntArray
from .plane import Material

#: Corner pairs of the edges in the order of the midside nodes (VTK, Abaqus, CalculiX; scikit-fem's too).
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
#: Corner triples of the faces, each seen anticlockwise from outside, and their midside nodes in the same order.
FACES = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]])
#: A midside node further than this part of the edge's length from the edge's middle makes its element a curved one.
STRAIGHT = 1e-9
#: Degree of the quadrature rule for the stiffness of curved elements (14 points, all weights positive).
CURVED_DEGREE = 5


class SolidMatrices(NamedTuple):
    """Assembled matrices of a body; ``n`` nodes."""

    #: (3n, 3n) stiffness (N/m), symmetric, in blocks of a node's three rows
    stiffness: sparse.bsr_array
    #: (n, n) mass of one axis (kg), CSR; the full mass is ``kron(mass, eye(3))``
    nodal_mass: sparse.csr_array

    @property
    def mass(self) -> sparse.csr_array:
        """(3n, 3n) consistent mass (kg)."""
        return expand_nodal(self.nodal_mass)


def expand_nodal(nodal: sparse.csr_array) -> sparse.csr_array:
    """``kron(nodal, eye(3))`` in CSR: the same scalar matrix on each of the three axes."""
    return sparse.kron(nodal, sparse.eye_array(3), format="csr")


def assemble(nodes: Array, tets: IntArray, material: Material) -> SolidMatrices:
    """Stiffness and consistent mass of a tetrahedral mesh.

    Parameters
    ----------
    nodes : (n, 3)
        Coordinates (m).
    tets : (m, 4) or (m, 10)
        Node numbers, corners first, midside nodes in the order of `EDGES`.
    material
        The solid.
    """
    curved = curved_elements(nodes, tets)
    tets = np.concatenate([tets[~curved], tets[curved]])
    straight, bent = np.split(tets, [int((~curved).sum())])
    parts = []
    for part, degrees in ((straight, (2, 6)), (bent, (CURVED_DEGREE, 7))):
        if len(part):
            stiff, heavy = (shape_functions(tets.shape[1], degree) for degree in degrees)
            parts.append(element_matrices(nodes, part, material, (stiff, stiff), (heavy, heavy)))
    pattern = _pattern(tets, len(nodes))

    def summed(local: list[Array]) -> Array:
        weights = np.concatenate([entries.ravel() for entries in local])
        return np.asarray(np.bincount(pattern.place, weights=weights, minlength=len(pattern.columns)), dtype=float)

    mass = summed([part.mass() for part in parts])
    blocks = np.empty((len(pattern.columns), 3, 3))
    for i in range(3):
        for j in range(3):
            blocks[:, i, j] = summed([part.stiffness(i, j) for part in parts])
    n = len(nodes)
    stiffness = sparse.bsr_array((blocks, pattern.columns, pattern.starts), shape=(3 * n, 3 * n))
    return SolidMatrices(stiffness, sparse.csr_array((mass, pattern.columns, pattern.starts), shape=(n, n)))


def curved_elements(nodes: Array, tets: IntArray) -> BoolArray:
    """(m,) whether a midside node lies off the middle of its edge."""
    if tets.shape[1] == 4:
        return np.zeros(len(tets), dtype=bool)
    first, second = nodes[tets[:, EDGES[:, 0]]], nodes[tets[:, EDGES[:, 1]]]
    offset = np.linalg.norm(nodes[tets[:, 4:]] - 0.5 * (first + second), axis=2)
    return np.asarray(np.any(offset > STRAIGHT * np.linalg.norm(second - first, axis=2), axis=1))


def jacobian_determinants(nodes: Array, tets: IntArray) -> Array:
    """(m, points) volume ratio at the quadrature points: six times the volume, one value, of linear elements.

    A value that is not positive marks an inverted or collapsed element.
    """
    a = tets.shape[1]
    slopes = [shape_functions(a, degree).slopes for degree in ((1,) if a == 4 else (CURVED_DEGREE, 7))]
    return maps(nodes, tets, np.concatenate(slopes, axis=2))[0]


class _Pattern(NamedTuple):
    """Map from element entries to the node-by-node sparse matrix."""

    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    place: IntArray


def _pattern(tets: IntArray, n: int) -> _Pattern:
    a = tets.shape[1]
    keys = (np.repeat(tets, a, axis=1).astype(np.int64) * n + np.tile(tets, (1, a))).ravel()
    found, place = np.unique(keys, return_inverse=True)
    starts = np.searchsorted(found, np.arange(n + 1, dtype=np.int64) * n).astype(np.int32)
    return _Pattern(starts, (found % n).astype(np.int32), place)


class Functions(NamedTuple):
    """Functions of an element at the ``p`` points of a quadrature rule."""

    #: (a, p)
    values: Array
    #: (a, 3, p) derivatives by the reference axes
    slopes: Array
    #: (p,)
    weights: Array


@cache
def shape_functions(a: int, order: int) -> Functions:
    """Shape functions of an element with `a` nodes, at the points of a rule of the given degree."""
    from skfem import ElementTetP1, ElementTetP2
    from skfem.quadrature import get_quadrature_tet

    element = ElementTetP1() if a == 4 else ElementTetP2()
    points, weights = get_quadrature_tet(order)
    values = [element.lbasis(points, k) for k in range(a)]
    phi = np.array([np.broadcast_to(v, weights.shape) for v, _ in values])
    gradients = np.array([np.broadcast_to(g, (3, len(weights))) for _, g in values])
    return Functions(phi, gradients, weights)


@dataclass(frozen=True)
class ElementMatrices:
    """Element matrices of ``m`` elements as (coefficients of each element) @ (integrals over the reference element).

    Rows are functions (s of them), columns others (a), or the same.
    """

    #: (m, 3, 3, 9 p) coefficients of the stiffness blocks; p quadrature points (straight: one set for all)
    coefficients: Array
    #: (9 p, s a) of d phi_s / d xi_m  d phi_a / d xi_n
    gradients: Array
    #: (m, q) density times volume ratio, and (q, s a) of phi_s phi_a
    density: Array
    products: Array

    def stiffness(self, i: int, j: int) -> Array:
        """(m, s a) block that couples axes i and j."""
        return np.asarray(self.coefficients[:, i, j] @ self.gradients)

    def mass(self) -> Array:
        """(m, s a) mass of one axis."""
        return np.asarray(self.density @ self.products)


Pair = tuple[Functions, Functions]


def element_matrices(nodes: Array, tets: IntArray, material: Material, stiff: Pair, heavy: Pair) -> ElementMatrices:
    """Compute the factors of element matrices between pairs of functions, of elements all straight or all curved.

    The second ones are the elements' own. With J the gradient of the inverse map, ``d phi_a/d x_i = J[m, i] d phi_a/d
    xi_m``, block (i, j) of the element stiffness is the sum over quadrature points of ``w det (lambda J[m,i] J[n,j] +
    mu J[m,j] J[n,i] + mu delta_ij J[m,k] J[n,k])`` times ``d phi_s/d xi_m d phi_a/d xi_n``. On straight elements all
    but the last factor is constant.

    Parameters
    ----------
    nodes : ndarray, shape (n, 3)
        Nodes (m).
    tets : ndarray of int, shape (m, 10)
        Nodes of the tetrahedra.
    material : Material
        Elasticity and density.
    stiff : pair of Functions
        Test functions, and the elements' own, of the stiffness.
    heavy : pair of Functions
        The same of the mass.
    """
    curved = bool(curved_elements(nodes, tets[:1])[0])

    def mapped(own: Functions) -> tuple[Array, Array]:
        return maps(nodes, tets, own.slopes) if curved else maps(nodes, tets[:, :4], shape_functions(4, 1).slopes)

    rows, own = stiff
    det, inverse = mapped(own)
    (lam, mu), c = material.lame(), np.empty((len(tets), 3, 3, det.shape[1], 3, 3))
    total = np.einsum("epmk,epnk->epmn", inverse, inverse)
    for i in range(3):
        for j in range(3):
            direct = np.einsum("epm,epn->epmn", inverse[..., i], inverse[..., j])
            c[:, i, j] = lam * direct + mu * direct.swapaxes(-1, -2)
        c[:, i, i] += mu * total
    c *= det[:, None, None, :, None, None]
    gradients = np.einsum("smp,anp,p->pmnsa", rows.slopes, own.slopes, own.weights)
    lighter, own = heavy
    products = np.einsum("sp,ap,p->psa", lighter.values, own.values, own.weights)
    if not curved:
        gradients, products = gradients.sum(axis=0), products.sum(axis=0)
    return ElementMatrices(
        c.reshape(len(tets), 3, 3, -1),
        gradients.reshape(c[0, 0, 0].size, -1),
        material.density * mapped(own)[0],
        products.reshape(-1, products.shape[-2] * products.shape[-1]),
    )


def maps(nodes: Array, tets: IntArray, gradients: Array) -> tuple[Array, Array]:
    """Return (m, p) volume ratio and (m, p, 3, 3) gradient [xi axis, x axis] of the inverse map at `gradients`."""
    forward = np.einsum("eak,amp->epkm", nodes[tets], gradients, optimize=True)
    det = np.asarray(np.linalg.det(forward))
    solvable = np.where((det != 0.0)[..., None, None], forward, np.eye(3))
    return det, np.asarray(np.linalg.inv(solvable))
