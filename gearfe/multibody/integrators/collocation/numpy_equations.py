"""Evaluate the equations of a collocation step for any system by NumPy; `kernels` are the compiled ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ....base.typing import Array
from ...compiled import simd
from ...core.start import Start, on_constraints
from ...core.system import System
from .kernels import end_state, keep_path
from .scheme import Scheme
from .work_space import Stages


class SystemEquations:
    """A system with the matrices of one stage and their factors."""

    def __init__(self, system: System, start: Start) -> None:
        self.system, self.active = system, start.active
        self.tangents: list[Any] = []
        self.solves: list[Any] = []
        self.by_q = self.by_v = self.curvature = self.G = np.zeros((0, 0))
        at = 0
        #: Of every element with stresses: itself, its coordinates, its part of the stresses and their shape.
        self.stressed: list[tuple[Any, np.ndarray, slice, tuple[int, ...]]] = []
        for element, index in system.stressed:
            shape = np.shape(element.stress(start.q[index], start.v[index]))
            self.stressed.append((element, index, slice(at, at + math.prod(shape)), shape))
            at += math.prod(shape)
        self.stresses = at


def begin(eq: SystemEquations, w: Stages, tab: Scheme) -> None:
    """See `kernels.begin`."""
    h = w.now[1]
    w.Z[:] = w.speeds.T @ w.guess
    w.Q[:] = w.q[:, None] + h * tab.side.c * w.v[:, None] + w.Z
    w.V[:] = w.v[:, None] + w.Z[:, :-1] @ tab.side.inverse / h
    w.A[:, :-1] = w.Z[:, :-1] @ tab.twice.T / h**2
    w.A[:, -1] = w.L[:, -1] = 0.0
    w.L[:, :-1] = w.multipliers[:, None]
    for element, index, part, _ in eq.stressed:
        w.S[part] = element.stress(w.q[index], w.v[index]).ravel()[:, None]


def stages(eq: SystemEquations, w: Stages, tab: Scheme) -> None:
    """See `kernels.stages`; all stages in one call of each element where it takes many states."""
    system, s = eq.system, len(tab.c)
    t, q, v = w.now[0] + tab.side.c * w.now[1], w.Q.view(np.ndarray).T.copy(), w.V.view(np.ndarray).T.copy()
    force = system.force(t, q, v, stressed=False)
    for k, (element, index, part, shape) in enumerate(eq.stressed):
        force[s, index] += element.force(t[s], q[s, index], v[s, index])  # the step's begin
        for i in range(s):
            pull, lacks = eq.tangents[k].force(q[i, index], v[i, index], w.S[part, i].reshape(shape))
            force[i, index] += pull
            w.S[part, i] += lacks.ravel()
    G = system.jacobian(t, q)[:, eq.active]
    w.rest[:] = system.mass @ w.A - force.T + np.einsum("irn,ri->ni", G, w.L.view(np.ndarray))
    if tab.level:
        w.gap[:] = w.now[1] * ((G @ v[..., None])[..., 0] + system.rate(t, q)[:, eq.active]).T
    else:
        w.gap[:] = system.residual(t, q)[:, eq.active].T


def linearise(eq: SystemEquations, w: Stages, i: int, t: float) -> bool:
    """Compute the tangents of the forces and the gradients of the rows at a stage.

    Parameters
    ----------
    eq : SystemEquations
        The system; its matrices change.
    w : Stages
        State and unknowns of the step.
    i : int
        Number of the stage.
    t : float
        Its time (s).

    Returns
    -------
    finite : bool
        Whether state and matrices are finite.
    """
    system, q, v = eq.system, w.Q[:, i].view(np.ndarray), w.V[:, i].view(np.ndarray)
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        return False
    eq.by_q, eq.by_v = system.force_jacobian(t, q, v, stressed=False)
    eq.tangents = []
    for element, index, part, shape in eq.stressed:
        tangent = element.tangent(q[index], v[index], w.S[part, i].reshape(shape))
        eq.by_q[np.ix_(index, index)] += tangent.by_q
        eq.by_v[np.ix_(index, index)] += tangent.by_v
        eq.tangents.append(tangent)
    multipliers = np.zeros(system.rows)
    multipliers[eq.active] = w.L[:, i]
    eq.curvature = system.curvature(t, q, multipliers)
    eq.G = system.jacobian(t, q)[eq.active]
    return all(np.isfinite(x).all() for x in (eq.by_q, eq.by_v, eq.curvature, eq.G))


def factorise(eq: SystemEquations, w: Stages, tab: Scheme) -> bool:
    """Factors of all eigenvalues; False where a pivot vanishes."""
    system, h = eq.system, w.now[1]
    eq.solves = []
    for k, (real, imag) in enumerate(tab.values):
        mu = complex(real, imag) if k else real
        top = mu**2 / h**2 * system.mass - mu / h * eq.by_v - eq.by_q + eq.curvature
        made = saddle_solver(top, eq.G, system.units, system.row_units[eq.active])
        if made is None:
            return False
        eq.solves.append(made)
    return True


def solve(eq: SystemEquations, w: Stages, tab: Scheme) -> None:
    """See `kernels.solve`."""
    s = len(tab.c)
    r, g = tab.back @ w.rest[:, :s].T, tab.back @ w.gap[:, :s].T
    r[0], g[0] = eq.solves[0](-r[0], -g[0] / tab.values[0, 0] ** tab.level)
    for k in range(1, len(tab.values)):
        a, b = 2 * k - 1, 2 * k
        force, gap = eq.solves[k](-r[a] - 1j * r[b], (-g[a] - 1j * g[b]) / complex(*tab.values[k]) ** tab.level)
        r[a], r[b], g[a], g[b] = force.real, force.imag, gap.real, gap.imag
    w.dZ[:, :s], w.dL[:, :s] = (tab.basis @ r).T, (tab.basis @ g).T


def left_over(eq: SystemEquations, w: Stages, tab: Scheme) -> float:  # noqa: ARG001
    """See `kernels.left_over`; elements do not say whether their forces are linear, and count as such."""
    return 0.0


def change(eq: SystemEquations, w: Stages, tab: Scheme) -> float:
    """See `kernels.change`."""
    s, h = len(tab.c), w.now[1]
    rates = w.dZ[:, :-1] @ tab.side.inverse / h
    w.Z[:] += w.dZ
    w.Q[:] += w.dZ
    w.V[:] += rates
    w.A[:, :-1] += w.dZ[:, :-1] @ tab.twice.T / h**2
    w.L[:] += w.dL
    for k, (_, index, part, _) in enumerate(eq.stressed):
        for i in range(s):
            w.S[part, i] += eq.tangents[k].change(w.dZ[index, i], rates[index, i]).ravel()
    return float((np.abs(w.dZ) / w.limit[:, None]).max())


def defect(eq: SystemEquations, w: Stages, tab: Scheme) -> float:
    """See `kernels.defect`."""
    system, M, h = eq.system, eq.system.mass, w.now[1]
    first, second = w.v - w.V[:, :-1] @ tab.defect, -w.rest[:, -1] - M @ (w.A[:, :-1] @ tab.defect)
    none = np.zeros(len(w.gap))
    if len(none):
        G = system.jacobian(w.now[0], w.q)[eq.active]
        made = saddle_solver(M, G, system.units, system.row_units[eq.active])
        if made is None:
            return math.inf
        second = M @ made(second, none)[0]
    off, _ = eq.solves[0](second + tab.values[0, 0] / h * M @ first - eq.by_v @ first, none)
    return float(np.sqrt(np.mean((off / w.limit) ** 2)))


def gap_between(eq: SystemEquations, w: Stages, tab: Scheme) -> float:
    """Largest gap of a row between the stages, in its unit."""
    if not eq.active.any() or not np.isfinite(w.known).all():
        return 0.0
    gaps = eq.system.residual(w.now[0] + tab.middles * w.now[1], tab.between @ w.known)
    return float(np.abs(gaps[:, eq.active] / eq.system.row_units[eq.active]).max())


def project(eq: SystemEquations, w: Stages, tab: Scheme) -> None:  # noqa: ARG001
    """w.qn, w.vn onto the constraints, by the least changes in the mass norm."""
    w.qn[:], w.vn[:] = on_constraints(eq.system, w.now[0] + w.now[1], w.qn, w.vn, eq.active)


def saddle_solver(
    top: Array, G: Array, units: Array, row_units: Array
) -> Callable[[Array, Array], tuple[Array, Array]] | None:
    """Factorise [[top, G^T], [G, 0]], scaled by the units of coordinates and rows; sparse if it is large.

    Parameters
    ----------
    top : ndarray, shape (n, n)
        Block of the coordinates, real or complex.
    G : ndarray, shape (m, n)
        Gradients of the rows.
    units : ndarray, shape (n,)
        Units of the coordinates.
    row_units : ndarray, shape (m,)
        Units of the rows.

    Returns
    -------
    solve : callable or None
        ``solve(force, gap)`` returns the change of the coordinates (n,) and the multipliers (m,); None if the matrix is
        singular.
    """
    n, m = len(top), len(G)
    top, G = top * np.outer(units, units), G * units / row_units[:, None]
    scale = 1.0 / max(1e-300, float(np.abs(np.diagonal(top)).max()))
    matrix = np.zeros((n + m, n + m), dtype=top.dtype)
    matrix[:n, :n] = top * scale
    matrix[:n, n:] = G.T
    matrix[n:, :n] = G
    if n + m > 150:
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        try:
            solve: Callable[[Array], Array] = splu(csc_matrix(matrix)).solve
        except RuntimeError:  # exactly singular
            return None
    else:
        from scipy.linalg import get_lapack_funcs

        factorised, solved = get_lapack_funcs(("getrf", "getrs"), (matrix,))
        factors, pivots, vanishing = factorised(matrix)
        if vanishing:
            return None

        def solve(b: Array) -> Array:
            return np.asarray(solved(factors, pivots, b)[0])

    def apply(force: Array, gap: Array) -> tuple[Array, Array]:
        x = solve(np.concatenate([force * units * scale, gap / row_units]).astype(matrix.dtype))
        return x[:n] * units, x[n:] / scale / row_units

    return apply


FUNCTIONS = (
    begin, stages, left_over, linearise, factorise, solve, change, defect, end_state, keep_path,
    gap_between, project,
)  # fmt: skip
NAMES = {**simd.NAMES, "np": np, "math": math, "saddle_solver": saddle_solver,
         "on_constraints": on_constraints}  # fmt: skip
