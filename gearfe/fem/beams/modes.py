r"""Compute elastic vectors of a free shaft: modes up to a frequency, and static responses without these.

For a family of motions with stiffness K, mass M and M-orthonormal rigid vectors R (K R = 0), the matrix
``K_s = K + alpha M R (M R)^T`` is positive definite. Its eigenvectors are the rigid ones, with ``alpha``, and the
elastic ones of (K, M). They follow from the largest eigenvalues of ``C^-1 M C^-T``, ``K_s = C C^T``, without the rigid
ones. Low frequencies are then accurate to rounding, however high the highest ones of the elements are.

**Residual vectors.** A load f with the rigid part removed, ``f - M R R^T f``, deforms the free shaft by ``K_s^-1 (f -
M R R^T f)`` (inertia relief). What the modes Phi (squares Lambda) leave out of it, ``X = K_s^-1 (...) - Phi
Lambda^-1 Phi^T f``, is orthogonal to them in M and K. Turned to the principal axes of ``X^T K X, X^T M X`` these are
vectors of unit mass with diagonal stiffness. With all of them, displacements under static loads at the stations are
exact.

**Error of the elements.** Functions T of two more degrees in each element would lower the squared frequency of mode phi
by about ``r^T (T^T K T)^-1 r``, ``r = T^T (K - lambda M) phi``. This is the first term of a perturbation series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ...base.typing import Array
from .elements import Family

#: Part of the largest squared period of a shaft below which one is rounding: that of some hundred unknowns.
ROUNDING = 1e-12

#: Part of a loaded direction's own compliance below which a residual vector is rounding.
DEPENDENT = 1e-10


@dataclass(frozen=True, eq=False)
class ElasticVectors:
    """Elastic coordinates of a family of motions, unit mass, orthogonal to the rigid ones and to each other.

    Attributes
    ----------
    squares : (n,)
        Squared angular frequencies (rad2/s2): of the modes, ascending, then of the residual vectors.
    vectors : (own unknowns, n)
        Displacements and rotations for unit coordinates.
    modes
        How many are modes.
    errors : (n,)
        Estimated relative errors of the frequencies by the elements; NaN for residual vectors.
    compliance : (loads,)
        Static compliance of the free shaft at each load along it.
    """

    squares: Array
    vectors: Array
    modes: int
    errors: Array
    compliance: Array


def elastic_vectors(
    family: Family,
    lengths: Array,
    rigid: Array,
    trial: Array,
    loads: Array,
    modes_below_hz: float,
) -> ElasticVectors:
    """Return the free modes of a family up to a frequency and its residual vectors.

    Parameters
    ----------
    family : Family
        Matrices.
    lengths : ndarray, shape (E,)
        Lengths of the elements (m).
    rigid : ndarray, shape (own, r)
        Rigid-body vectors.
    trial : ndarray, shape (own,)
        A smooth deformation, whose frequency gives the scale of the elastic ones.
    loads : ndarray, shape (own, l)
        Unit loads at the stations.
    modes_below_hz : float
        Highest frequency of the modes (Hz); infinite for all.
    """
    own = family.own
    stiffness, mass = family.stiffness[:own, :own], family.mass[:own, :own]
    basis = rigid @ linalg.inv(linalg.cholesky(rigid.T @ mass @ rigid, lower=True)).T
    momentum = mass @ basis
    smooth = trial - basis @ (momentum.T @ trial)
    alpha = float(smooth @ stiffness @ smooth) / float(smooth @ mass @ smooth)
    factor = linalg.cholesky(stiffness + alpha * momentum @ momentum.T, lower=True)
    half = linalg.solve_triangular(factor, mass, lower=True)
    inverse = linalg.solve_triangular(factor, half.T, lower=True)
    unit = factor.T @ basis / math.sqrt(alpha)
    inverse -= unit @ unit.T / alpha
    lowest = max((2.0 * math.pi * modes_below_hz) ** -2, ROUNDING * float(np.trace(inverse)))
    values, turned = linalg.eigh(inverse, subset_by_value=(lowest, math.inf))
    count = min(len(values), own - rigid.shape[1])
    values, turned = values[::-1][:count], turned[:, ::-1][:, :count]
    modes = linalg.solve_triangular(factor, turned / np.sqrt(values), lower=True, trans="T")
    modes -= basis @ (momentum.T @ modes)
    squares = 1.0 / values
    errors = _element_errors(family, lengths, modes, squares)

    balanced = loads - momentum @ (basis.T @ loads)
    response = linalg.cho_solve((factor, True), balanced)
    response -= basis @ (momentum.T @ response)
    compliance = np.einsum("il,il->l", loads, response)
    response -= modes @ ((modes.T @ loads) / squares[:, None])
    extra, residual = _principal(mass, loads, response, compliance)
    return ElasticVectors(
        np.concatenate([squares, residual]),
        np.hstack([modes, extra]),
        len(squares),
        np.concatenate([errors, np.full(len(residual), math.nan)]),
        compliance,
    )


def _principal(mass: Array, loads: Array, response: Array, compliance: Array) -> tuple[Array, Array]:
    """Return residual vectors of unit mass, and their squares."""
    if not loads.shape[1]:
        return np.zeros((len(loads), 0)), np.zeros(0)
    scale = 1.0 / np.sqrt(compliance)
    gram = loads.T @ response * scale[:, None] * scale
    size, axes = linalg.eigh(0.5 * (gram + gram.T))
    kept = size > DEPENDENT
    vectors = response @ (scale[:, None] * axes[:, kept] / np.sqrt(size[kept]))
    values, turned = linalg.eigh(vectors.T @ mass @ vectors)
    chosen = values > 0.0
    values, turned = values[chosen][::-1], turned[:, chosen][:, ::-1]
    return vectors @ turned / np.sqrt(values), 1.0 / values


def _element_errors(family: Family, lengths: Array, modes: Array, squares: Array) -> Array:
    """Estimated relative errors of frequencies: see the module."""
    own, probes = family.own, extra_functions(family, lengths)
    residual = family.stiffness[:, :own] @ modes - family.mass[:, :own] @ (modes * squares)
    against = probes.T @ residual
    lowered = np.einsum(
        "en,en->n", against, linalg.solve(probes.T @ family.stiffness @ probes, against, assume_a="pos")
    )
    return 0.5 * lowered / squares


def extra_functions(family: Family, lengths: Array) -> Array:
    """Return the functions of `EXTRA` more degrees in all elements of given lengths (m), a column each.

    A rotation comes with the deflection whose slope it is, so that it takes no shear energy: with ``psi_j`` of
    `fem.beams.elements.hierarchic`, ``integral psi_j = (psi_(j+1)/sqrt(2j+1) - psi_(j-1)/sqrt(2j-3)) / sqrt(2j-1)``.
    """
    size, own = len(family.stiffness), family.own
    columns = np.eye(size)[:, own:]
    if len(family.fields) == 2:
        deflection, rotation = family.fields
        element, j = np.nonzero(rotation >= own)
        column, half = rotation[element, j] - own, 0.5 * lengths[element]
        columns[deflection[element, j + 1], column] = half / np.sqrt((2 * j + 1) * (2 * j - 1))
        columns[deflection[element, j - 1], column] = -half / np.sqrt((2 * j - 3) * (2 * j - 1))
    return columns
