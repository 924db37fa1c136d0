r"""The map of a periodic linear system over its period.

.. math::
    \dot y = v,\qquad \dot v = -\Omega^2 y - D v + W\,C(t)\,(R^T y,\ S^T v),\qquad C(t + T) = C(t)

The multipliers are the eigenvalues of the monodromy matrix, the map of (y, v) over T; one of modulus > 1 means
parametric instability (Nayfeh & Mook, Nonlinear Oscillations, Sec. 5.2). The constant part is solved exactly
(exponentials of its eigenvalues), the periodic part changes v only, by terms of y (others are small), so both
alternate in the splitting of order 4 with six stages for such systems (Blanes & Moan, J. Comput. Appl. Math. 142, 2002,
SRKN6b).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, ComplexArray
from .monodromy_kernel import AT_ONCE, Kicks, run_kicks, scratch

_B = (0.0829844064174052, 0.396309801498368, -0.0390563049223486)
_A = (0.245298957184271, 0.604872665711080)
KICKS = np.array([*_B, 1 - 2 * sum(_B), *_B[::-1]])
DRIFTS = np.array([*_A, 0.5 - sum(_A), 0.5 - sum(_A), *_A[::-1]])
#: Where the periodic part acts within a step.
PLACES = np.concatenate([[0.0], np.cumsum(DRIFTS)])
#: Eigenvectors worse conditioned than this are not used; the exponentials then come from the matrix itself.
WORST_CONDITION = 1e8
#: Decay of modes within a step, as an exponent, up to which nothing is lost by taking its kicks to its begin.
CALM = 1.0


@dataclass(frozen=True, eq=False)
class Flow:
    """Exact flow of the constant part, in eigenvector coordinates, one of each conjugate pair.

    Attributes
    ----------
    scale : (n,)
        State is (scale y, v): scaled so, the undamped constant part is a rotation.
    values : (k,) or None
        Eigenvalues (1/s), those below the real axis left out; None: the coordinates are the state itself.
    matrix : (2n, 2n)
        Of the scaled state.
    into : (k, 2n)
        State to coordinates.
    out : (2n, k)
        Coordinates to state, which is the real part.
    """

    scale: Array
    values: ComplexArray | None
    matrix: Array
    into: ComplexArray
    out: ComplexArray

    def over(self, length: float, *, of_rows: bool = False) -> Callable[[ComplexArray], ComplexArray]:
        """The flow over a time (s), of rows of coordinates (.., k), or of rows that coordinates are multiplied by."""
        if self.values is not None:
            factors = np.exp(length * self.values)
            return lambda x: x * factors
        from scipy.linalg import expm

        matrix = expm(length * self.matrix).astype(complex)
        return lambda x: x @ (matrix if of_rows else matrix.T)

    def factors(self, lengths: Array) -> tuple[Array, Array]:
        """The flow over some times (s), of rows of coordinates in parts (.., 2 k).

        Returns
        -------
        turns : ndarray, shape (lengths, 2 k)
            Factors of the coordinates in parts; (0, 2 k) where the coordinates are the state itself.
        moves : ndarray, shape (lengths, 2 k, 2 k)
            Matrices that rows are multiplied by there; else (0, 2 k, 2 k).
        """
        width = 2 * len(self.into)
        if self.values is not None:
            return _parts(np.exp(lengths[:, None] * self.values)), np.zeros((0, width, width))
        from scipy.linalg import expm

        moves = np.zeros((len(lengths), width, width))  # imaginary parts are 0 and stay it
        for move, length in zip(moves, lengths.tolist(), strict=True):
            move[::2, ::2] = expm(length * self.matrix).T
        return np.zeros((0, width)), moves


def flow(stiffness: Array, damping: Array, period: float) -> Flow:
    """Flow of ``y'' = -stiffness y - damping y'``, matrices of shape (n, n)."""
    n = len(stiffness)
    scale = np.maximum(np.sqrt(np.abs(np.diag(stiffness))), 1.0 / period)
    A = np.block([[np.zeros((n, n)), np.diag(scale)], [-stiffness / scale, -damping]])
    values, V = np.linalg.eig(A)
    if np.isfinite(V).all() and _well_conditioned(V):
        kept = values.imag >= 0.0
        twice = np.where(values[kept].imag > 0.0, 2.0, 1.0)
        return Flow(scale, values[kept].astype(complex), A, np.linalg.inv(V)[kept], V[:, kept] * twice)
    whole = np.eye(2 * n, dtype=complex)
    return Flow(scale, None, A, whole, whole)


def _well_conditioned(V: ComplexArray) -> bool:
    """Whether `V` may be inverted; with no rows it may."""
    sizes = np.linalg.svd(V, compute_uv=False)
    return bool(sizes.max(initial=0.0) < WORST_CONDITION * sizes.min(initial=np.inf))


def kick_times(edges: Array) -> Array:
    """Times of the kicks, (steps, stages)."""
    return edges[:-1, None] + np.diff(edges)[:, None] * PLACES[None, :]


def monodromy(
    constant: Flow, edges: Array, directions: Array, reads: Array, strengths: Array, yields: Array | None = None
) -> Array:
    """Return the map of the state (scale y, v) over the time of the steps.

    Within a step the coordinates are those of its begin: kicks are taken there by the flow, which so acts once. Where
    modes decay within a step that would lose digits, and the flow acts between kicks.

    Parameters
    ----------
    constant : Flow
        Flow of the constant part.
    edges : ndarray, shape (steps + 1,)
        Step ends (s), even.
    directions : ndarray, shape (n, d)
        W, accelerations.
    reads : ndarray, shape (2n, p)
        What the periodic part depends on, as rows on (y, v).
    strengths : ndarray, shape (steps, stages, d, p)
        C at the kicks.
    yields : ndarray, shape (p, d), optional
        What other modes add to the reads at once under unit forces; by default nothing.

    Returns
    -------
    matrix : ndarray, shape (2n, 2n)
        Monodromy matrix.
    """
    n, (seen, forces) = len(directions), (reads.shape[1], directions.shape[1])
    into = constant.into @ np.vstack([np.zeros_like(directions), directions])
    rows = (reads.T / np.concatenate([constant.scale, np.ones(n)])) @ constant.out
    length = (edges[-1] - edges[0]) / (len(edges) - 1)
    # columns of the map as rows, real and imaginary parts beside each other: products are real
    x = np.array(constant.into.T, dtype=complex, order="C")  # a copy, which the kernel changes
    calm = constant.values is not None and length * float(np.abs(constant.values.real).max(initial=0.0)) < CALM
    begins, drifts = (PLACES, [*[0.0] * len(DRIFTS), 1.0]) if calm else (np.zeros(len(PLACES)), [*DRIFTS, 0.0])
    parts, width = _parts(x), 2 * x.shape[1]
    turns, moves = constant.factors(length * np.array(drifts))
    run_kicks(
        Kicks(
            parts,
            np.ascontiguousarray(strengths),
            np.zeros((seen, forces)) if yields is None else np.ascontiguousarray(yields),
            length * KICKS,
            np.array([_parts(constant.over(length * place, of_rows=True)(rows).conj()) for place in begins]),
            _padded(np.array([_parts(constant.over(-length * place)(into.T)) for place in begins])),
            turns,
            moves,
            np.sign(drifts),
            scratch(forces, seen, width),
        )
    )
    return np.asarray((parts.view(complex) @ constant.out.T).real.T)


def _padded(pushes: Array) -> Array:
    """Pushes (K, d, w) with as many more forces, without effect, as make groups of `AT_ONCE`."""
    stages, forces, width = pushes.shape
    return np.concatenate([pushes, np.zeros((stages, -forces % AT_ONCE, width))], axis=1)


def _parts(values: ComplexArray) -> Array:
    """Rows (k, n) as real ones (k, 2n), real and imaginary part of each number beside each other."""
    return np.ascontiguousarray(values, dtype=complex).view(float)
