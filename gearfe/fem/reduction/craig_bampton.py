r"""Craig-Bampton reduction of a sparse pair (K, M) with interface rows, corrected for what the left-out modes carry.

The unknowns of the full model are ``u = B q_b + E u_i``: the interface coordinates ``q_b`` (rigid attachments: six
each) move their rows through the constant matrix B. The internal unknowns ``u_i`` are free, and all other rows are
held.

.. math::
    u_i = \Psi q_b + \Phi \eta + \tilde X \xi,\qquad
    \Psi = -K_{ii}^{-1} K_{ib},\qquad K_{ii}\Phi = M_{ii}\Phi\Lambda,\qquad
    X = K_{ii}^{-1}(M_{ii}\Psi + M_{ib}) .

``Psi`` are the constraint modes, with which the static response at the interfaces is exact. ``Phi`` are the lowest
modes with the interfaces held (Craig, Bampton, AIAA J. 6, 1968). ``X`` are the first-order inertia corrections, the
quasi-static part of all modes that are left out. ``X`` is made M-orthonormal and M-orthogonal to ``Phi``. Both are then
transformed to the principal axes of their stiffness, so all internal coordinates have unit mass and diagonal stiffness.
One more level applies ``K^-1 M`` to the last one. The reduction is a Galerkin projection: frequencies converge from
above. One factorisation serves all steps.

**Error bound.** The dynamic stiffness at the interfaces is ``D(w) = K_bb - w^2 M_bb - w^4 b^T A(w)^{-1} b``, with
``A = K_ii - w^2 M_ii`` and ``b = M_ii Psi + M_ib``. Let V be the internal vectors, M-orthonormal with the stiffnesses
L. The projection replaces ``A^{-1} b`` by ``x = V g``, ``g = (L - w^2)^{-1} V^T b``. The error is
``dD = w^4 r^T A^{-1} r`` with the residual ``r = b - A x``. Modes have no residual. With corrections b lies in K V, and
r is ``w^2 K Y g``. Y is the part of ``K^{-1} M V`` that is K-orthogonal to V. On this part
``A >= (1 - w^2/w_next^2) K``, hence

.. math::
    dD \le \frac{w^8}{1 - w^2/w_{next}^2}\; g^T S\, g,\qquad S = Y^T K Y = V^T M K^{-1} M V - L^{-1},

with the first frequency ``w_next`` that is left out. Without corrections the bound has ``w^4 S`` instead of
``w^8 g^T S g``. S is then ``b^T K^{-1} b`` without the part of the modes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from ...base.errors import InputError
from ...base.progress import one_thread, stage
from ...base.typing import Array, IntArray
from ..multifrontal import Factor
from .lanczos import lowest_modes
from .modal_body import Reduction
from .sparse_solver import factorize

#: Part of its own size below which a correction vector counts as contained in the others.
DEPENDENT = 1e-6


@dataclass(frozen=True)
class Partition:
    """Matrices over the interface coordinates (b, m of them) and the internal unknowns (i, k of them).

    Attributes
    ----------
    boundary : (n, m)
        B: displacement of every row for unit interface coordinates; zero in internal and held rows. m may be 0.
    internal : (k,)
        Rows that are free and in no interface.
    k_ii, m_ii : (k, k) sparse
        Stiffness and mass of the internal unknowns.
    k_ib, m_ib : (k, m)
        Their coupling with the interfaces.
    k_bb, m_bb : (m, m)
        Stiffness and mass of the interfaces.
    """

    boundary: Array
    internal: IntArray
    k_ii: Any
    m_ii: Any
    k_ib: Array
    m_ib: Array
    k_bb: Array
    m_bb: Array


def partition(stiffness: Any, mass: Any, interface: Any, internal: IntArray) -> Partition:
    """Split a sparse model into interfaces and internal unknowns, so that the whole matrices can be dropped.

    Parameters
    ----------
    stiffness, mass : sparse matrix, shape (n, n)
        The whole matrices.
    interface : sparse matrix or ndarray, shape (n, m)
        Displacement of every row for unit interface coordinates.
    internal : ndarray of int, shape (k,)
        Rows that are free and in no interface.
    """
    boundary = np.asarray(interface.toarray() if sparse.issparse(interface) else interface, dtype=float)
    moved = np.flatnonzero(boundary.any(axis=1))  # few rows, which are the columns of a symmetric matrix, too
    found = []
    for matrix in (stiffness, mass):
        product = np.asarray(_submatrix(matrix, moved, square=False).T @ boundary[moved])
        found.append((_submatrix(matrix, internal), product[internal], _symmetric(boundary.T @ product)))
    (k_ii, k_ib, k_bb), (m_ii, m_ib, m_bb) = found
    return Partition(boundary, internal, k_ii, m_ii, k_ib, m_ib, k_bb, m_bb)


def _submatrix(matrix: Any, rows: IntArray, *, square: bool = True) -> Any:
    """These rows, and if `square` columns, of a sparse matrix; blocks (BSR) stay blocks where the rows are whole."""
    width = matrix.blocksize[0] if matrix.format == "bsr" else 1
    chosen = rows[::width] // width
    if width == 1 or not np.array_equal(rows, (width * chosen[:, None] + np.arange(width)).ravel()):
        chosen = sparse.csr_array(matrix)[rows]
        return chosen[:, rows] if square else chosen
    nodes = len(matrix.indptr) - 1
    blocks = sparse.csr_array((np.arange(len(matrix.indices)), matrix.indices, matrix.indptr), shape=(nodes, nodes))
    blocks = blocks[chosen][:, chosen] if square else blocks[chosen]
    shape = len(rows), len(rows) if square else matrix.shape[1]
    return sparse.bsr_array((matrix.data[blocks.data], blocks.indices, blocks.indptr), shape=shape)


@one_thread()
def reduce_model(
    parts: Partition,
    *,
    count: int | None = None,
    below_hz: float = math.inf,
    at_least: int = 0,
    at_most: int | None = None,
    corrections: int = 1,
    free: bool = False,
) -> Reduction:
    """Reduce a sparse model to its interface coordinates, its lowest modes and their quasi-static corrections.

    Parameters
    ----------
    parts
        The model, split into interfaces and internal unknowns (`partition`).
    count, below_hz
        Number of modes with the interfaces held, and their highest frequency (Hz): whichever ends first.
    at_least
        Number of modes kept in any case, when they are chosen by frequency.
    at_most
        Number of modes beyond which a highest frequency is refused.
    corrections
        Levels of correction vectors; 0 gives plain Craig-Bampton.
    free
        Whether a model without interfaces is held nowhere, so that its first modes are rigid-body modes.

    Raises
    ------
    InputError
        Neither `count` nor a finite `below_hz`; negative values; a model that can still move with its interfaces held.
    """
    _check(count, below_hz, corrections)
    k_ii, m_ii, k_ib, m_ib = parts.k_ii, parts.m_ii, parts.k_ib, parts.m_ib
    m = k_ib.shape[1]
    shift = rigid_shift(k_ii, m_ii) if m == 0 and free else 0.0
    with stage("factorising"):
        factor = factorize(k_ii + shift * m_ii if shift else k_ii)
        psi = -factor.solve(k_ib) if m else k_ib
    coupling = m_ii @ psi + m_ib
    limit = (2.0 * math.pi * below_hz) ** 2
    with stage("modes"):
        modes = lowest_modes(
            factor.solve,
            m_ii,
            count=count,
            limit=limit,
            at_least=at_least if count is None else 0,
            at_most=at_most if count is None else None,
            shift=shift,
        )
    added, left = _corrections(factor, m_ii, modes.vectors, coupling, corrections if m else 0)
    inner = np.concatenate([modes.vectors, added], axis=1)
    # principal axes of the whole inner space: of the modes' residuals only the square is lost, some 1e-10
    with_added = inner.T @ np.asarray(k_ii @ added)
    energy = np.diag(np.append(modes.eigenvalues, np.zeros(added.shape[1])))
    energy[:, len(modes.eigenvalues) :] = with_added
    energy[len(modes.eigenvalues) :] = with_added.T
    eigenvalues, axes = np.linalg.eigh(_symmetric(energy))
    inner = inner @ axes
    truncation = left
    if corrections and m:  # of the next level only what is K-orthogonal to the vectors kept
        last = axes[len(axes) - len(left) :]
        truncation = _symmetric(last.T @ (left - (last / eigenvalues) @ last.T) @ last)
    size = m + len(eigenvalues)
    k_red, m_red = np.zeros((size, size)), np.eye(size)
    k_red[:m, :m] = _symmetric(parts.k_bb + psi.T @ k_ib)
    m_red[:m, :m] = _symmetric(parts.m_bb + psi.T @ m_ib + coupling.T @ psi)
    m_red[:m, m:] = coupling.T @ inner
    m_red[m:, :m] = m_red[:m, m:].T
    k_red[range(m, size), range(m, size)] = eigenvalues
    shapes = np.zeros((len(parts.boundary), size))
    shapes[:, :m] = parts.boundary
    shapes[parts.internal, :m] = psi
    shapes[parts.internal, m:] = inner
    return Reduction(
        mass=m_red,
        stiffness=k_red,
        shapes=shapes,
        internal_hz=np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi),
        modes=len(modes.eigenvalues),
        truncation=truncation,
        corrections=corrections,
        next_hz=math.sqrt(max(modes.next_eigenvalue, 0.0)) / (2.0 * math.pi),
    )


def _corrections(factor: Factor, m_ii: Any, modes: Array, coupling: Array, levels: int) -> tuple[Array, Array]:
    """M-orthonormal correction vectors, and ``V^T M K^-1 M V`` of the last level's.

    ``X_1 = K^-1 b``, ``X_l = K^-1 M X_{l-1}``: all freed of the modes. Without corrections ``X_1^T b`` comes second.
    """
    m_modes = np.asarray(m_ii @ modes)
    blocks = [modes]

    def solved(load: Array) -> Array:
        x = factor.solve(load)
        return np.asarray(x - modes @ (m_modes.T @ x))

    x = solved(coupling)
    left = _symmetric(x.T @ coupling)
    for number in range(1, levels + 1):
        mx = np.asarray(m_ii @ x)
        if number > 1:
            x = solved(mx)
            mx = np.asarray(m_ii @ x)
        scale = np.maximum(np.sqrt(np.einsum("ij,ij->j", x, mx)), 1e-300)
        new, m_new = x / scale, mx / scale
        for again in (True, False):
            new = new - sum(basis @ (basis.T @ m_new) for basis in blocks)
            size, directions = np.linalg.eigh(_symmetric(new.T @ (m_ii @ new)))
            keep = size > DEPENDENT**2
            new = new @ (directions[:, keep] / np.sqrt(size[keep]))
            m_new = m_ii @ new if again else m_new
        blocks.append(new)
        if number == levels:
            m_new = np.asarray(m_ii @ new)
            left = _symmetric(solved(m_new).T @ m_new)
    return np.concatenate([np.zeros((len(modes), 0)), *blocks[1:]], axis=1), left


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))


def rigid_shift(stiffness: Any, mass: Any) -> float:
    """A shift far below the elastic modes and far above rounding, for a body that is held nowhere (rad^2/s^2)."""
    return float(1e-9 * np.max(stiffness.diagonal() / mass.diagonal()))


def _check(count: int | None, below_hz: float, corrections: int) -> None:
    if count is not None and count < 0:
        raise InputError("modes", count, "must be 0 or more", "0 keeps constraint modes and corrections only")
    if not below_hz > 0.0:
        raise InputError("below_hz", below_hz, "must be > 0", "give a frequency in Hz")
    if count is None and math.isinf(below_hz):
        raise InputError(
            "modes", None, "neither a number of modes nor a highest frequency is given", "give one of them"
        )
    if corrections < 0:
        raise InputError("corrections", corrections, "must be 0 or more", "1 is the default")
