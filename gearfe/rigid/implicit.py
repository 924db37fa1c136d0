"""Radau IIA of order 5 on the index-3 equations, for stiff and flexible systems.

Three collocation stages of  M A = f(t, Q, V) - G^T Lambda,  g(t, Q) = 0  (Hairer & Wanner II, Secs. IV.8, VI.1, VII.4;
the positions converge with order 5). After every step the velocities are projected onto G v = -dg/dt, and the
multipliers
follow from the accelerations, which restores the order of both. With Z = Q - q0 - c h v0 the stage accelerations are
A^-2 Z / h^2, so Newton needs one real and one complex matrix of the size of the index-3 system:

    [ mu^2/h^2 M - mu/h df/dv - df/dq + d(G^T Lambda)/dq    G^T ]
    [ G                                                      0  ]
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .choice import STOPPED, Watch
from .contract import Array, Element, LocalForce, ModalBlocks
from .elimination import Minimal, is_linear, minimal
from .explicit import first_step, on_constraints
from .start import Start
from .system import System
from .within import within_run

ROOT6 = math.sqrt(6.0)
C = np.array([(4 - ROOT6) / 10, (4 + ROOT6) / 10, 1.0])
A = np.array(
    [
        [(88 - 7 * ROOT6) / 360, (296 - 169 * ROOT6) / 1800, (-2 + 3 * ROOT6) / 225],
        [(296 + 169 * ROOT6) / 1800, (88 + 7 * ROOT6) / 360, (-2 - 3 * ROOT6) / 225],
        [(16 - ROOT6) / 36, (16 + ROOT6) / 36, 1 / 9],
    ]
)
INVERSE = np.linalg.inv(A)
MU, BASIS = np.linalg.eig(INVERSE)
ORDER = np.argsort(np.abs(MU.imag))  # the real one first, then a conjugate pair
MU, BASIS = MU[ORDER], BASIS[:, ORDER]
BACK = np.linalg.inv(BASIS)
ERROR = np.array([-13 - 7 * ROOT6, -13 + 7 * ROOT6, -1.0]) / 3
MOST_NEWTON = 10
#: Asked tolerance -> that of steps in modal coordinates: accelerations weigh the fast modes more than the state does.
MODES_SHARE = 0.03


@dataclass(frozen=True)
class Hermite:
    """Dense output: on every step the polynomial of degree 5 through q, v, a of its ends."""

    times: Array
    q: Array
    v: Array
    a: Array

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        """Coordinates (or a derivative of them) at the times t."""
        t = within_run(self.times, t)
        sign = 1.0 if self.times[-1] >= self.times[0] else -1.0
        k = np.clip(np.searchsorted(sign * self.times, sign * t, side="right") - 1, 0, max(0, len(self.times) - 2))
        h = (self.times[k + 1] - self.times[k])[:, None]
        x = (t - self.times[k])[:, None] / h
        q0, v0, a0 = self.q[k], h * self.v[k], h * h * self.a[k]
        q1, v1, a1 = self.q[k + 1], h * self.v[k + 1], h * h * self.a[k + 1]
        d = q1 - q0 - v0 - a0 / 2
        e, f = v1 - v0 - a0, a1 - a0
        coefficients = [q0, v0, a0 / 2, 10 * d - 4 * e + f / 2, -15 * d + 7 * e - f, 6 * d - 3 * e + f / 2]
        out = np.zeros_like(q0)
        for j in range(5, derivative - 1, -1):
            out = out * x + math.perm(j, derivative) * coefficients[j]
        return out / h**derivative


def run_implicit(  # type: ignore[no-untyped-def]
    system: System, start: Start, times: Array, *, tolerance: float, longest: float, most: int,
    watch: Watch | None = None,
):  # fmt: skip
    """Integrate; returns (dense output, status, statistics). Linear constant constraints are eliminated before."""
    if system.joints and is_linear(system) and all(isinstance(e, LocalForce) for e, _ in system.forces):
        core = minimal(system)
        inner, begin = in_modes(core, start)
        local = max(MODES_SHARE * tolerance, 1e-13)

        def told(t: float, steps: int, state: Callable[[], tuple[Array, Array]]) -> bool:
            return watch is None or watch(t, steps, lambda: (core.origin + core.T @ state()[0], core.T @ state()[1]))

        options: dict[str, Any] = {"tolerance": local, "longest": longest, "most": most, "watch": told}
        dense, status, statistics = run_implicit(inner, begin, times, **options)
        q, v, a = core.origin + dense.q @ core.T.T, dense.v @ core.T.T, dense.a @ core.T.T
        return Hermite(dense.times, q, v, a), status, {**statistics, "free_coordinates": inner.size}
    t, t1 = start.time, float(times[-1])
    sign = 1.0 if t1 >= t else -1.0
    n, active = system.size, start.active
    q, v = start.q.copy(), start.v.copy()
    a, multipliers = system.acceleration(t, q, v, active, start.excess)
    span = abs(t1 - t)
    reach = np.maximum(np.abs(q), 1e-300)
    units = system.units
    pair = [np.concatenate([x, y]) / np.tile(units, 2) for x, y in ((q, v), (v, a))]
    h = min(longest, first_step(pair[0], pair[1], span))
    goals = sorted((b for b in system.breaks if sign * (b - t) > 0 and sign * (t1 - b) > 0), key=lambda b: sign * b)
    goals.append(t1)
    record = [(t, q, v, a)]
    status, newton, rejected, before = 0, 0, 0, 0.0
    while sign * (t1 - t) > 0.0:
        if len(record) > most:
            status = 2
            break
        if watch is not None and not watch(t, len(record) - 1, lambda: record[-1][1:3]):
            status = STOPPED
            break
        while sign * (goals[0] - t) <= 1e-14 * max(abs(t), span):
            goals.pop(0)
        step = min(h, longest, abs(goals[0] - t))
        fixed = step == abs(goals[0] - t)
        if step < 1e-13 * max(abs(t), span):
            status = 1 if rejected < 50 else 5
            break
        least = 1e-3 * units * max(float((reach / units).max()), 1e-12)
        limit = tolerance * np.maximum(np.maximum(reach, step * np.abs(v)), least)
        made = radau_step(system, t, q, v, a, multipliers, sign * step, limit, active)
        newton += made.iterations
        if not made.converged:
            h, rejected = 0.3 * step, rejected + 1
            continue
        if made.error > 1.0:
            h, rejected = step * max(0.2, 0.9 * made.error**-0.25), rejected + 1
            continue
        t = goals[0] if fixed else t + sign * step
        state = on_constraints(system, t, made.q, made.v, active, start.excess)
        q, v = state[:n], state[n:]
        a, multipliers = system.acceleration(t, q, v, active, start.excess)
        reach = np.maximum(reach, np.abs(q))
        record.append((t, q, v, a))
        factor = 0.9 * max(made.error, 1e-8) ** -0.25
        if before > 0.0 and made.error > 0.0:  # predictive control (Gustafsson)
            factor = min(factor, factor * (before / made.error) ** 0.25 * 1.0)
        before = made.error
        h = max(h, step) if fixed and made.error < 0.01 else step * min(5.0, max(0.2, factor))
    dense = Hermite(*(np.array([r[k] for r in record]) for k in range(4)))
    counts = {"scheme": "Radau IIA of order 5", "steps": len(record) - 1}
    return dense, status, {**counts, "newton_iterations": newton, "rejected": rejected}


def in_modes(core: Minimal, start: Start) -> tuple[System, Start]:
    """The system in its minimal coordinates, which no joint holds, and its start there."""
    body = ModalBlocks(np.eye(len(core.squares)), core.damping, np.diag(core.squares))
    elements: list[Element] = [body]
    for force, index in core.system.forces:
        assert isinstance(force, LocalForce)
        offset = core.origin[index] @ force.W

        def law(t: float, u: Array, du: Array, own: Any = force.law, offset: Array = offset) -> Array:
            return np.asarray(own(t, u + offset, du))

        elements.append(LocalForce((body,), core.T[index].T @ force.W, law, breaks=force.breaks))
    elements.append(LocalForce((body,), core.constant[:, None], lambda *_: np.ones(1)))
    q, v = core.reduce(start.q, start.v)
    return System(elements), replace(start, q=q, v=v, active=np.zeros(0, dtype=bool), excess=np.zeros(0))


@dataclass(frozen=True)
class Step:
    """One trial step."""

    q: Array
    v: Array
    error: float
    iterations: int
    converged: bool


def radau_step(
    system: System,
    t: float,
    q: Array,
    v: Array,
    a: Array,
    multipliers: Array,
    h: float,
    limit: Array,
    active: np.ndarray,
) -> Step:
    """Simplified Newton on the three stages, and the embedded error estimate against `limit`."""
    n, m = system.size, int(active.sum())
    middle, middle_q, middle_v = t + h / 2, q + h / 2 * v + h * h / 8 * a, v + h / 2 * a
    by_q, by_v = system.force_jacobian(middle, middle_q, middle_v)
    curvature = joint_stiffness(system, middle, middle_q, multipliers)
    G = system.jacobian(middle, middle_q)[active]
    M = system.mass
    solves = []
    for mu in MU[:2]:
        factor = mu.real if abs(mu.imag) < 1e-12 else mu
        top = factor**2 / h**2 * M - factor / h * by_v - by_q + curvature
        solves.append(saddle_solver(top, G, system.units, system.row_units[active]))
    Z = 0.5 * (C * h)[:, None] ** 2 * a
    L = np.tile(multipliers[active], (3, 1))
    moved = math.inf
    converged = False
    iterations = 0
    while iterations < MOST_NEWTON:
        iterations += 1
        V = v + INVERSE @ Z / h
        acceleration = INVERSE @ (INVERSE @ Z) / h**2
        rest, gaps = np.empty((3, n)), np.empty((3, m))
        for i in range(3):
            Q = q + C[i] * h * v + Z[i]
            ti = t + C[i] * h
            Gi = system.jacobian(ti, Q)[active]
            rest[i] = M @ acceleration[i] - system.force(ti, Q, V[i]) + Gi.T @ L[i]
            gaps[i] = system.residual(ti, Q)[active]
        r, g = BACK @ rest, BACK @ gaps
        dz0, dl0 = solves[0](-r[0].real, -g[0].real)
        dz1, dl1 = solves[1](-r[1], -g[1])
        dZ = np.real(np.outer(BASIS[:, 0], dz0)) + 2 * np.real(np.outer(BASIS[:, 1], dz1))
        dL = np.real(np.outer(BASIS[:, 0], dl0)) + 2 * np.real(np.outer(BASIS[:, 1], dl1))
        Z, L = Z + dZ, L + dL
        size = float(np.abs(dZ / limit).max())
        if not math.isfinite(size):
            break
        if size < 1e-3 or (size < 0.1 and moved < math.inf and size * size / max(moved, 1e-300) < 1e-3):
            converged = True
            break
        if size > 2.0 * moved:
            break
        moved = size
    if not converged:
        return Step(q, v, math.inf, iterations, False)
    new_q, new_v = q + h * v + Z[2], v + (INVERSE @ Z)[2] / h
    first = v + ERROR @ (Z + np.outer(C, h * v)) / h
    second = M @ (a + ERROR @ (INVERSE @ Z) / h**2)
    mu = MU[0].real
    off, _ = solves[0](second + (mu / h * M - by_v) @ first, np.zeros(m))
    return Step(new_q, new_v, float(np.sqrt(np.mean((off.real / limit) ** 2))), iterations, True)


def joint_stiffness(system: System, t: float, q: Array, multipliers: Array) -> Array:
    """d(G^T lambda)/dq; closed form for the planar scene, central differences otherwise."""
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
