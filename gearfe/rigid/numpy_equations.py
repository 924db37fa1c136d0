"""What a step of collocation asks of any system of elements, by NumPy; as `kernel_equations`, which is compiled."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..typing import Array
from .explicit import on_constraints
from .start import Start
from .system import System

if TYPE_CHECKING:
    from .collocation import Scheme
    from .kernel_collocation import Stages


class SystemEquations:
    """A system with the matrices of one stage and their factors."""

    def __init__(self, system: System, start: Start) -> None:
        self.system, self.active, self.excess = system, start.active, start.excess
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


def fill(x: Array, value: float) -> None:
    """x := value."""
    x[...] = value


def copy(x: Array, y: Array) -> None:
    """y := x."""
    y[...] = x


def combine(X: Array, Y: Array, out: Array) -> None:
    """out := X Y, for as many rows of Y as X has columns."""
    out[: len(X)] = X @ Y[: X.shape[1]]


def stage(eq: SystemEquations, w: Stages, tab: Scheme, i: int, t: float) -> None:
    """See `kernel_equations.stage`."""
    system, q, v = eq.system, w.Q[i], w.V[i]
    force = system.force(t, q, v, stressed=False)
    for k, (element, index, part, shape) in enumerate(eq.stressed):
        if i == len(w.Z):  # the step's begin
            w.S[i, part] = element.stress(q[index], v[index]).ravel()
            force[index] += element.force(t, q[index], v[index])
            continue
        pull, lacks = eq.tangents[k].force(q[index], v[index], w.S[i, part].reshape(shape))
        force[index] += pull
        w.S[i, part] += lacks.ravel()
    G = system.jacobian(t, q)[eq.active]
    w.rest[i] = system.mass @ w.A[i] - force + G.T @ w.L[i]
    w.gap[i] = w.now[1] * (G @ v + system.rate(t, q)[eq.active]) if tab.level else system.residual(t, q)[eq.active]


def linearise(eq: SystemEquations, w: Stages, i: int, t: float) -> bool:
    """Tangents and rows at a stage; whether they are finite."""
    system, q, v = eq.system, w.Q[i], w.V[i]
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        return False
    eq.by_q, eq.by_v = system.force_jacobian(t, q, v, stressed=False)
    eq.tangents = []
    for element, index, part, shape in eq.stressed:
        tangent = element.tangent(q[index], v[index], w.S[i, part].reshape(shape))
        eq.by_q[np.ix_(index, index)] += tangent.by_q
        eq.by_v[np.ix_(index, index)] += tangent.by_v
        eq.tangents.append(tangent)
    multipliers = np.zeros(system.rows)
    multipliers[eq.active] = w.L[i]
    eq.curvature = joint_stiffness(system, t, q, multipliers)
    eq.G = system.jacobian(t, q)[eq.active]
    return all(np.isfinite(x).all() for x in (eq.by_q, eq.by_v, eq.curvature, eq.G))


def factorise(eq: SystemEquations, w: Stages, tab: Scheme, k: int, h: float) -> bool:  # noqa: ARG001
    """Factor of eigenvalue k."""
    system = eq.system
    mu = tab.values[k, 0] if k == 0 else complex(*tab.values[k])
    top = mu**2 / h**2 * system.mass - mu / h * eq.by_v - eq.by_q + eq.curvature
    if k == 0:
        eq.solves = []
    eq.solves.append(saddle_solver(top, eq.G, system.units, system.row_units[eq.active]))
    return True


def solve(eq: SystemEquations, w: Stages, tab: Scheme, k: int) -> None:
    """w.r, w.g of eigenvalue k := changes."""
    if k == 0:
        w.r[0], w.g[0] = eq.solves[0](-w.r[0], -w.g[0] / tab.values[0, 0] ** tab.level)
        return
    a, b = 2 * k - 1, 2 * k
    force, gap = eq.solves[k](-w.r[a] - 1j * w.r[b], (-w.g[a] - 1j * w.g[b]) / complex(*tab.values[k]) ** tab.level)
    w.r[a], w.r[b], w.g[a], w.g[b] = force.real, force.imag, gap.real, gap.imag


def change(eq: SystemEquations, w: Stages, tab: Scheme, h: float, moved: bool) -> float:
    """See `kernel_equations.change`."""
    s, most = len(w.Z), 0.0
    if moved:
        most = float(np.abs(w.dZ / w.limit).max())
        w.Z[:] += w.dZ
        w.L[:s] += w.dL
        rates = tab.inverse @ w.dZ / h
        for k, (_, index, part, _) in enumerate(eq.stressed):
            for i in range(s):
                w.S[i, part] += eq.tangents[k].change(w.dZ[i][index], rates[i][index]).ravel()
    w.Q[:s] = w.q + h * tab.c[:, None] * w.v + w.Z
    w.V[:s] = w.v + tab.inverse @ w.Z / h
    w.A[:s] = tab.twice @ w.Z / h**2
    return most


def defect(eq: SystemEquations, w: Stages, tab: Scheme, h: float) -> float:
    """See `kernel_equations.defect`."""
    s, system, M = len(w.Z), eq.system, eq.system.mass
    first, second = w.v - tab.defect @ w.V[:s], -w.rest[s] - M @ (tab.defect @ w.A[:s])
    none = np.zeros(len(w.gap[0]))
    if len(none):
        G = system.jacobian(w.now[0], w.q)[eq.active]
        second = M @ saddle_solver(M, G, system.units, system.row_units[eq.active])(second, none)[0]
    off, _ = eq.solves[0](second + tab.values[0, 0] / h * M @ first - eq.by_v @ first, none)
    return float(np.sqrt(np.mean((off / w.limit) ** 2)))


def end_state(w: Stages, tab: Scheme, h: float) -> None:
    """Coordinates and velocities at the step's end."""
    w.qn[:] = w.q + h * w.v + tab.ends[0] @ w.Z
    w.vn[:] = w.v + tab.ends[1] @ w.Z / h


def keep_path(w: Stages, h: float) -> None:
    """What the dense output goes through."""
    w.known[0], w.known[1], w.known[-2], w.known[-1] = w.q, h * w.v, w.qn, h * w.vn
    w.known[2:-2] = w.Q[: len(w.known) - 4]


def gap_between(eq: SystemEquations, w: Stages, tab: Scheme, t: float, h: float) -> float:
    """Largest gap of a row between the stages, in its unit."""
    if not eq.active.any() or not np.isfinite(w.known).all():
        return 0.0
    states = zip(t + tab.middles * h, tab.between @ w.known, strict=True)
    gaps = [eq.system.residual(*state)[eq.active] / eq.system.row_units[eq.active] for state in states]
    return float(np.abs(gaps).max())


def project(eq: SystemEquations, w: Stages, t: float) -> None:
    """w.qn, w.vn onto the constraints, by the least changes in the mass norm."""
    made = on_constraints(eq.system, t, w.qn, w.vn, eq.active, eq.excess)
    w.qn[:], w.vn[:] = made[: len(w.qn)], made[len(w.qn) :]


def joint_stiffness(system: System, t: float, q: Array, multipliers: Array) -> Array:
    """d(G^T lambda)/dq; closed form for the linkage, central differences otherwise."""
    full = np.zeros((system.size, system.size))
    at = 0
    for element, index in system.joints:
        part = multipliers[at : at + element.rows]
        at += element.rows
        if element.constant_jacobian or not part.any():
            continue
        own: Any = getattr(element, "curvature", None)
        if own is not None:
            full[np.ix_(index, index)] += own(q[index], part)
            continue
        local = q[index]
        for j in range(len(index)):
            step = 1e-6 * max(1.0, abs(local[j]))
            ends = []
            for sign in (1.0, -1.0):
                moved = local.copy()
                moved[j] += sign * step
                ends.append(element.jacobian(t, moved).T @ part)  # type: ignore[attr-defined]
            full[index, index[j]] += (ends[0] - ends[1]) / (2 * step)
    return full


def saddle_solver(
    top: Array, G: Array, units: Array, row_units: Array
) -> Callable[[Array, Array], tuple[Array, Array]]:
    """Solver of [[top, G^T], [G, 0]], scaled by the units of coordinates and rows; sparse when it is large."""
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

        solve: Callable[[Array], Array] = splu(csc_matrix(matrix)).solve
    else:
        from scipy.linalg import lu_factor, lu_solve

        factor = lu_factor(matrix, check_finite=False)

        def solve(b: Array) -> Array:
            return lu_solve(factor, b, check_finite=False)

    def apply(force: Array, gap: Array) -> tuple[Array, Array]:
        x = solve(np.concatenate([force * units * scale, gap / row_units]).astype(matrix.dtype))
        return x[:n] * units, x[n:] / scale / row_units

    return apply


FUNCTIONS = (
    fill, copy, combine, stage, linearise, factorise, solve, change, defect, end_state, keep_path, gap_between, project,
)  # fmt: skip
NAMES = {"np": np, "math": math, "saddle_solver": saddle_solver, "joint_stiffness": joint_stiffness,
         "on_constraints": on_constraints}  # fmt: skip
