r"""Estimate the excess stiffness of a mesh from elements of the next order.

A field u_h of a mesh is in equilibrium with the functions v of its own elements (a mode:
:math:`\omega^2 m(u_h, v) = a(u_h, v)`), but not with functions s that the elements lack. The energy that they would
take,

.. math::
    \eta^2 = \sum_i r_i^T K_i^{-1} r_i,\qquad r_i = \omega^2 m(u_h, s_i) - a(u_h, s_i),\quad K_i = a(s_i, s_i),

is an estimate of the energy of the error (Bank, Weiser, Math. Comp. 44, 1985; Verfuerth, A Review of A Posteriori Error
Estimation, 1996, ch. 1.4). Here s_i are the three displacements of each hierarchical function that the next order adds
on an edge or a face: :math:`\lambda_a\lambda_b(\lambda_a-\lambda_b)` and :math:`\lambda_a\lambda_b\lambda_c` to
quadratic tetrahedra, :math:`\lambda_a\lambda_b` to linear ones. An error of energy is one of an eigenvalue (Strang,
Fix, An Analysis of the Finite Element Method, ch. 6): :math:`\lambda_h-\lambda = \|u_h-u\|^2` for a mode of unit modal
mass. As a quadratic form over many fields it is the change of the body's stiffness matrix, for frequencies and
responses alike.

The next order leaves an error, too. Where stresses are singular, and that is where housings err, energies of errors
fall with the order p as :math:`p^{-4\alpha}` (Babuska, Suri, SIAM Review 36, 1994), :math:`\alpha = 0.544` at an inner
right angle (Williams, J. Appl. Mech. 19, 1952): from 2 to 3 they fall to 0.41, so that the error is 1.7 times what the
next order takes off. The sum over single functions equals that of all together up to a factor near one.
Measured: 1.65 to 2.1 for the modes of housings, 1.1 to 2.5 for clamped beams and plates, elements one through the
thickness or more. `FACTOR` covers these.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from ...base.typing import Array, BoolArray, IntArray
from ..plane import Material
from ..solid import EDGES, ElementMatrices, Functions, curved_elements, element_matrices, shape_functions

#: Error over what the next order's functions take one by one: 1.7 by theory, at most 2.5 measured.
FACTOR = 3.0
#: Smallest volume ratio at a quadrature point, against the element's mean: below it an element is folded.
_SOUND = 0.02
#: Corners of the faces, and the numbers of their edges.
_FACES = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]])
_FACE_EDGES = np.array([[0, 1, 2], [0, 4, 3], [1, 5, 4], [2, 5, 3]])
#: Degree of the quadrature rule: 1 and 2 from the gradients on straight elements, two more on curved ones.
_DEGREE = 5
#: Elements at a time, for the memory that takes.
_CHUNK = 300


def energy_lost(
    nodes: Array, tets: IntArray, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]
) -> Array:
    """Estimate the energy that the mesh keeps fields from giving up, a quadratic form over them.

    Parameters
    ----------
    nodes : ndarray, shape (n, 3)
        Nodes (m).
    tets : ndarray of int, shape (m, 4 or 10)
        Nodes of the tetrahedra.
    material : Material
        Elasticity and density.
    fields : ndarray, shape (3 n, k)
        Nodal displacements, each in equilibrium with the inertia of its own frequency.
    eigenvalues : ndarray, shape (k,)
        Squares of these circular frequencies (rad^2/s^2); 0 for a static field.
    rigid : list of ndarray of int
        Sets of nodes that are held or move as a rigid thing: no function acts within one.

    Returns
    -------
    energy : ndarray, shape (k, k)
        In N m.
    """
    numbers, residual, stiffness = _unbalanced(nodes, tets, material, fields, eigenvalues, rigid)
    return FACTOR * energy_taken(residual, stiffness, numbers.acting)


def energy_lost_by_element(
    nodes: Array, tets: IntArray, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]
) -> Array:
    """Estimate the energy of `energy_lost` for each field alone, element by element.

    The part of each function is shared equally by the elements around it.

    Parameters
    ----------
    nodes, tets, material, fields, eigenvalues, rigid
        See `energy_lost`.

    Returns
    -------
    energy : ndarray, shape (m, k)
        In N m.
    """
    numbers, residual, stiffness = _unbalanced(nodes, tets, material, fields, eigenvalues, rigid)
    chosen, taken = _taken(residual, stiffness, numbers.acting)
    energy = np.zeros((numbers.total, fields.shape[1]))
    energy[chosen] = (taken**2).sum(axis=1) / np.bincount(numbers.place.ravel(), minlength=numbers.total)[chosen, None]
    return np.asarray(FACTOR * energy[numbers.place].sum(axis=1))


def _unbalanced(
    nodes: Array, tets: IntArray, material: Material, fields: Array, eigenvalues: Array, rigid: list[IntArray]
) -> tuple[_Numbers, Array, Array]:
    """Numbers of the added functions, their residuals (n, 3, k) and stiffnesses (n, 3, 3)."""
    made, count = _functions(tets.shape[1]), fields.shape[1]
    numbers = _number(nodes, tets, rigid)
    curved = curved_elements(nodes, tets)
    field = fields.reshape(len(nodes), 3, count)
    residual = np.zeros((numbers.total, 3 * count))
    stiffness = np.zeros((numbers.total, 9))
    for first in range(0, len(tets), _CHUNK):
        chosen = slice(first, first + _CHUNK)
        for part in (first + np.flatnonzero(~curved[chosen]), first + np.flatnonzero(curved[chosen])):
            if not len(part):
                continue
            matrices = element_matrices(nodes, tets[part], material, made[:2], made[:2])
            unsound = matrices.density.min(axis=1) <= _SOUND * np.abs(matrices.density).mean(axis=1)
            matrices.coefficients[unsound], matrices.density[unsound] = 0.0, 0.0
            found, block = _residual(made, matrices, field[tets[part]], eigenvalues)
            found *= numbers.signs[part][:, :, None, None]
            add_up(numbers.place[part], (found, residual), (block, stiffness))
    return numbers, residual.reshape(-1, 3, count), stiffness.reshape(-1, 3, 3)


def add_up(place: IntArray, *parts: tuple[Array, Array]) -> None:
    """Add what elements give to functions numbered `place` (m, s): parts (m, s, ...) to totals (functions, ...)."""
    rows, column = np.unique(place, return_inverse=True)
    entries = (np.ones(column.size), (column.ravel(), np.arange(column.size)))
    gather = sparse.csr_array(entries, shape=(len(rows), column.size))
    for part, total in parts:
        total[rows] += (gather @ part.reshape(column.size, -1)).reshape(len(rows), *total.shape[1:])


def energy_taken(residual: Array, stiffness: Array, acting: BoolArray) -> Array:
    """Energy (k, k) that functions take, one by one: residuals (n, 3, k), stiffnesses (n, 3, 3)."""
    taken = _taken(residual, stiffness, acting)[1].reshape(-1, residual.shape[-1])
    return np.asarray(taken.T @ taken)


def _taken(residual: Array, stiffness: Array, acting: BoolArray) -> tuple[IntArray, Array]:
    """Numbers (c,) of the functions that act, and (c, 3, k) whose squares are the energies that they take."""
    chosen = np.flatnonzero(acting & (np.trace(stiffness, axis1=1, axis2=2) > 0.0))
    upright = np.linalg.inv(np.linalg.cholesky(stiffness[chosen]))
    return chosen, np.matmul(upright, residual[chosen])


#: Values (p,) of a function and its derivatives (d, p) by the reference axes, at p points.
Function = tuple[Array, Array]


def barycentric(points: Array) -> list[Function]:
    """The coordinates of a simplex's corners, the first at the origin, at points (d, p)."""
    slopes = np.vstack([-np.ones(len(points)), np.eye(len(points))])[:, :, None] * np.ones(points.shape[1])
    return list(zip([1.0 - points.sum(axis=0), *points], slopes, strict=True))


def difference(one: Function, other: Function) -> Function:
    """One function less another."""
    return one[0] - other[0], one[1] - other[1]


def product(*factors: Function) -> Function:
    """Product of functions."""
    value, slope = factors[0]
    for other, rise in factors[1:]:
        value, slope = value * other, slope * other + value * rise
    return value, slope


class _Functions(NamedTuple):
    """Functions that the next order adds (s of them), and the elements' own, at p quadrature points."""

    added: Functions
    own: Functions
    #: (9 p, s) of d phi_s / d xi_m  d phi_s / d xi_n
    themselves: Array


@cache
def _functions(a: int) -> _Functions:
    from skfem.quadrature import get_quadrature_tet

    points, _ = get_quadrature_tet(_DEGREE)
    corners = barycentric(points)
    edges = [(corners[one], corners[two], difference(corners[one], corners[two])) for one, two in EDGES]
    made = [product(*(factors[:2] if a == 4 else factors)) for factors in edges]
    made += [product(*(corners[k] for k in face)) for face in _FACES] if a == 10 else []
    values, slopes = (list(part) for part in zip(*made, strict=True))
    own = shape_functions(a, _DEGREE)
    added = Functions(np.array(values), np.array(slopes), own.weights)
    themselves = np.einsum("smp,snp,p->pmns", added.slopes, added.slopes, added.weights)
    return _Functions(added, own, themselves.reshape(-1, len(values)))


class _Numbers(NamedTuple):
    """Numbers of the added functions in the mesh."""

    #: (m, s)
    place: IntArray
    #: (m, s) sign that makes a function the same in all its elements
    signs: Array
    #: (count,) whether it may act
    acting: BoolArray
    total: int


def _number(nodes: Array, tets: IntArray, rigid: list[IntArray]) -> _Numbers:
    a, n = tets.shape[1], len(nodes)
    ends = np.sort(tets[:, EDGES], axis=2)
    edges, edge = np.unique(ends[..., 0] * n + ends[..., 1], return_inverse=True)
    edge = edge.reshape(-1, 6)
    corners = np.sort(tets[:, _FACES], axis=2)
    faces, face = np.unique((corners[..., 0] * n + corners[..., 1]) * n + corners[..., 2], return_inverse=True)
    face = face.reshape(-1, 4)
    acting = np.ones(len(edges) + len(faces), dtype=bool)
    for chosen in rigid:
        inside = np.zeros(n, dtype=bool)
        inside[chosen] = True
        # second order: an edge through the material between two such nodes has a middle that is free
        still = inside[tets[:, 4:]] if a == 10 else np.all(inside[tets[:, EDGES]], axis=2)
        acting[edge[still]] = False
        acting[len(edges) + face[still[:, _FACE_EDGES].all(axis=2)]] = False
    if a == 4:
        return _Numbers(edge, np.ones(edge.shape), acting[: len(edges)], len(edges))
    signs = np.where(tets[:, EDGES[:, 0]] < tets[:, EDGES[:, 1]], 1.0, -1.0)
    place = np.hstack([edge, len(edges) + face])
    return _Numbers(place, np.hstack([signs, np.ones(face.shape)]), acting, len(acting))


def _residual(made: _Functions, matrices: ElementMatrices, field: Array, eigenvalues: Array) -> tuple[Array, Array]:
    """Return (m, s, 3, k) residuals and (m, s, 3, 3) stiffnesses of added functions for fields (m, a, 3, k)."""
    (m, a, _, k), s = field.shape, len(made.added.values)
    stiffness = np.empty((m, s, 3, a, 3))
    for i in range(3):
        for j in range(3):
            stiffness[:, :, i, :, j] = matrices.stiffness(i, j).reshape(m, s, a)
    residual = np.matmul(matrices.mass().reshape(m, s, a), field.reshape(m, a, 3 * k)).reshape(m, s, 3, k)
    residual *= eigenvalues
    residual -= np.matmul(stiffness.reshape(m, 3 * s, 3 * a), field.reshape(m, 3 * a, k)).reshape(m, s, 3, k)
    themselves = made.themselves.reshape(-1, matrices.coefficients.shape[-1], s).sum(axis=0)
    return residual, (matrices.coefficients @ themselves).transpose(0, 3, 1, 2)
