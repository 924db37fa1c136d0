r"""Floquet multipliers: does a periodic linear system grow from one period to the next?

.. math::
    \dot y = v,\qquad \dot v = -\Omega^2 y - D v + W\,C(t)\,(R^T y,\ S^T v),\qquad C(t + T) = C(t)

The multipliers are the eigenvalues of the monodromy matrix, the map of (y, v) over T; one of modulus > 1 means
parametric instability (Nayfeh & Mook, Nonlinear Oscillations, Sec. 5.2). The constant part is solved exactly
(exponentials of its eigenvalues), the periodic part changes v only, by what depends on y but for small terms, so both
alternate in the splitting of order 4 with six stages for such systems (Blanes & Moan, J. Comput. Appl. Math. 142, 2002,
SRKN6b); steps are halved until the moduli stand still. The matrices are small: one thread does best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..threads import one_thread
from ..typing import Array, ComplexArray

_B = (0.0829844064174052, 0.396309801498368, -0.0390563049223486)
_A = (0.245298957184271, 0.604872665711080)
KICKS = np.array([*_B, 1 - 2 * sum(_B), *_B[::-1]])
DRIFTS = np.array([*_A, 0.5 - sum(_A), 0.5 - sum(_A), *_A[::-1]])
#: Where the periodic part acts within a step.
PLACES = np.concatenate([[0.0], np.cumsum(DRIFTS)])
#: Eigenvectors worse conditioned than this are not used; the exponentials then come from the matrix itself.
WORST_CONDITION = 1e8
MOST_STEPS = 1 << 14


@dataclass(frozen=True, eq=False)
class Flow:
    """Exact flow of the constant part, in coordinates of its own: eigenvectors, of conjugate pairs one.

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

    def over(self, length: float) -> Callable[[ComplexArray], ComplexArray]:
        """The flow over a time (s)."""
        if self.values is not None:
            factors = np.exp(length * self.values)[:, None]
            return lambda x: factors * x
        from scipy.linalg import expm

        matrix = expm(length * self.matrix)
        return lambda x: matrix @ x


def flow(eigenvalues: Array, damping: Array, period: float) -> Flow:
    """Flow of ``y'' = -eigenvalues y - damping y'``."""
    n = len(eigenvalues)
    scale = np.maximum(np.sqrt(np.abs(eigenvalues)), 1.0 / period)
    A = np.block([[np.zeros((n, n)), np.diag(scale)], [np.diag(-eigenvalues / scale), -damping]])
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


def walk(
    constant: Flow, edges: Array, state: Array, kick: Callable[[int, int, float, ComplexArray], None]
) -> Array:  # fmt: skip
    """State (2n, columns) at the last of the step ends `edges` from the state at the first.

    `kick(step, stage, length, coordinates)` adds the periodic part over a length of time (s) to the coordinates.
    """
    x = constant.into @ state
    lengths = np.diff(edges)
    flows: list[Callable[[ComplexArray], ComplexArray]] = []
    before = None
    for step, h in enumerate(lengths):
        if before is None or abs(h - before) > 1e-12 * h:
            distinct = {a: constant.over(h * a) for a in set(DRIFTS)}
            flows, before = [distinct[a] for a in DRIFTS], h
        for stage, weight in enumerate(KICKS):
            kick(step, stage, h * weight, x)
            if stage < len(flows):
                x = flows[stage](x)
    return np.asarray((constant.out @ x).real)


def kick_times(edges: Array) -> Array:
    """Times of the kicks, (steps, stages)."""
    return edges[:-1, None] + np.diff(edges)[:, None] * PLACES[None, :]


def monodromy(constant: Flow, edges: Array, directions: Array, reads: Array, strengths: Array) -> Array:
    """Map of the state (scale y, v) over the period.

    Parameters
    ----------
    edges : (steps + 1,)
        Step ends (s).
    directions : (n, d)
        W, accelerations.
    reads : (2n, p)
        What the periodic part depends on, as rows on (y, v).
    strengths : (steps, stages, d, p)
        C at the kicks.
    """
    n = len(directions)
    into = constant.into @ np.vstack([np.zeros_like(directions), directions])
    rows = (reads.T / np.concatenate([constant.scale, np.ones(n)])) @ constant.out

    def kick(step: int, stage: int, length: float, x: ComplexArray) -> None:
        x += into @ (length * (strengths[step, stage] @ (rows @ x).real))

    return walk(constant, edges, np.eye(2 * n), kick)


def multipliers(
    eigenvalues: Array, damping: Array, directions: Array, gains: Callable[[Array], Array], period: float, *,
    tolerance: float = 1e-6, first: int = 64,
) -> ComplexArray | None:  # fmt: skip
    """Floquet multipliers, largest modulus first; None when numbers overflow even with the shortest steps.

    Parameters
    ----------
    eigenvalues : (n,)
        Omega^2 (rad2/s2); negative ones are allowed.
    damping : (n, n)
        D (1/s), gyroscopic terms included.
    directions : (n, m)
        w_m: the periodic part is ``sum_m p_m(t) w_m w_m^T y``.
    gains
        Times (k,) to p_m (k, m).
    period
        T (s).
    tolerance, first
        See `settled`.

    Returns
    -------
    ndarray of complex, shape (2n,)
    """
    with one_thread():
        constant = flow(eigenvalues, damping, period)
        reads = np.vstack([directions, np.zeros_like(directions)])

        def found(steps: int) -> Array:
            edges = np.linspace(0.0, period, steps + 1)
            values = np.asarray(gains(kick_times(edges).ravel())).reshape(steps, len(PLACES), -1)
            return monodromy(constant, edges, directions, reads, values[..., None] * np.eye(values.shape[-1]))

        return settled(found, tolerance=tolerance, first=first)


def settled(found: Callable[[int], Array | None], *, tolerance: float = 1e-6, first: int = 64) -> ComplexArray | None:
    """Eigenvalues of the monodromy matrices `found` with more and more steps, until their moduli stand still.

    Parameters
    ----------
    found
        Number of steps to the matrix, or None.
    tolerance
        Change of any multiplier's modulus from one number of steps to the next, relative to the largest.
    first
        Fewest steps.
    """

    def sorted_values(steps: int) -> ComplexArray | None:
        # the splitting also steps back: heavy damping then grows, and overflows where steps are long
        with np.errstate(over="ignore", invalid="ignore"):
            X = found(steps)
        if X is None or not np.isfinite(X).all():
            return None
        values: Array = np.linalg.eigvals(X)
        return np.asarray(values[np.argsort(-np.abs(values), kind="stable")], dtype=complex)

    steps = first
    before = sorted_values(steps)
    while steps < MOST_STEPS:
        steps *= 2
        now = sorted_values(steps)
        if now is not None and before is not None:
            change = np.abs(np.abs(now) - np.abs(before)).max()
            if change < tolerance * np.abs(now).max():
                return now
        before = now
    return before
