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
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..typing import Array
from .collocated import MIDDLE, C, collocated
from .contract import Element, LocalForce, ModalBlocks
from .corners import TRUSTED, Corners, collocated_path
from .dense import Polynomials, hermite
from .elimination import ModalCoordinates, is_linear, modal_coordinates
from .explicit import on_constraints
from .start import Start
from .steps import Status, StepControl, StepLaw, Watch, first_step
from .system import System

ROOT6 = math.sqrt(6.0)
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
#: Cubic through values at 0, C: its powers of x - 1, lowest first.
CUBIC = np.linalg.inv(np.vander(np.append(0.0, C) - 1.0, increasing=True))
MOST_NEWTON = 10
LAW = StepLaw(exponent=0.25, growth=5.0, least_error=1e-8, predictive=True)
#: Share of a step that is tried after Newton did not converge.
NOT_SOLVED_SHARE = 0.3
#: Asked tolerance -> that of steps in modal coordinates: accelerations weigh the fast modes more than the state does.
MODES_SHARE = 0.03


class State(NamedTuple):
    """Where a step begins."""

    t: float
    q: Array
    v: Array
    a: Array
    multipliers: Array


def run_implicit(
    system: System, start: Start, times: Array, *, tolerance: float, longest: float, most: int,
    watch: Watch | None = None,
) -> tuple[Polynomials, Status, dict[str, Any]]:  # fmt: skip
    """Integrate; returns (dense output, status, statistics). Linear constant constraints are eliminated before."""
    options: dict[str, Any] = {"longest": longest, "most": most}
    if system.joints and is_linear(system) and all(isinstance(e, LocalForce) for e, _ in system.forces):
        modal = modal_coordinates(system)
        inner, begin = in_modes(modal, start)
        local = max(MODES_SHARE * tolerance, 1e-13)

        def watch_modes(t: float, steps: int, state: Callable[[], tuple[Array, Array]]) -> bool:
            return watch is None or watch(t, steps, lambda: (modal.origin + modal.T @ state()[0], modal.T @ state()[1]))

        within, status, statistics = run_implicit(inner, begin, times, tolerance=local, watch=watch_modes, **options)
        coefficients = within.coefficients @ modal.T.T
        coefficients[:, 0] += modal.origin
        return Polynomials(within.times, coefficients), status, {**statistics, "free_coordinates": inner.size}
    active, units = start.active, system.units
    pair = system.acceleration(start.time, start.q, start.v, active, start.excess)
    here = State(start.time, start.q.copy(), start.v.copy(), *pair)
    span = (start.time, float(times[-1]))
    first = first_step(here.q / units, here.v / units, here.a / units, abs(span[1] - span[0]))
    control = StepControl(LAW, span, first, breaks=system.breaks, watch=watch, **options)
    corners = Corners(system, control, tolerance)
    reach = np.maximum(np.abs(here.q), 1e-300)
    record: list[State] = [here]
    stages, forces = [], []
    newton = 0
    last: Array | None = None

    def state() -> tuple[Array, Array]:
        return here.q, here.v

    while (h := control.next_step(state)) is not None:
        least = 1e-3 * units * max(float((reach / units).max()), 1e-12)
        limit = tolerance * np.maximum(np.maximum(reach, abs(h) * np.abs(here.v)), least)
        made = radau_step(system, here, h, limit, active, last)
        newton += made.iterations
        if not made.converged:
            control.fail(Status.NOT_SOLVED, NOT_SOLVED_SHARE)
            continue
        error = max(made.error, _gap_between(system, here, h, made, active) / tolerance)
        path = collocated_path(h, (here.q, here.v, *made.stages, made.q, made.v), made.speeds)
        if error <= TRUSTED and corners.cut(here.t, h, path):
            continue
        if error > 1.0:
            control.reject(error)
            continue
        t = control.accept(error)
        q, v = np.split(on_constraints(system, t, made.q, made.v, active, start.excess), 2)
        here = State(t, q, v, *system.acceleration(t, q, v, active, start.excess))
        reach, last = np.maximum(reach, np.abs(q)), None if corners.passing(h) else made.speeds
        record.append(here)
        stages.append(made.stages)
        forces.append(made.forces)
    # accelerations of stiff links at the steps' ends are the rounding of their strains; those of others are exact
    dense: Polynomials
    if system.stressed and stages:
        ends, q, v = (np.array([r[k] for r in record]) for k in range(3))
        dense = collocated(ends, q, v, np.array(stages), np.array(forces))
    else:
        dense = hermite(*(np.array([r[k] for r in record]) for k in range(4)))
    counts = {"scheme": "Radau IIA of order 5", "steps": control.accepted}
    return dense, control.status, {**counts, "newton_iterations": newton, "rejected": control.rejected}


def _gap_between(system: System, here: State, h: float, made: Step, active: np.ndarray) -> float:
    """Largest gap of a constraint in the middle of a step, in its unit: where joints prescribe the motion, the error of
    what they leave free says nothing about the curve between the stages."""
    if not active.any():
        return 0.0
    middle = MIDDLE @ np.stack([here.q, h * here.v, *made.stages, made.q, h * made.v])
    gap = system.residual(here.t + 0.5 * h, middle)[active] / system.row_units[active]
    return float(np.abs(gap).max())


def in_modes(modal: ModalCoordinates, start: Start) -> tuple[System, Start]:
    """The system in its minimal coordinates, which no joint holds, and its start there."""
    body = ModalBlocks(np.eye(len(modal.eigenvalues)), modal.damping, np.diag(modal.eigenvalues))
    elements: list[Element] = [body]
    for force, index in modal.system.forces:
        assert isinstance(force, LocalForce)
        offset = modal.origin[index] @ force.W

        def law(t: float, u: Array, du: Array, own: Any = force.law, offset: Array = offset) -> Array:
            return np.asarray(own(t, u + offset, du))

        elements.append(LocalForce((body,), modal.T[index].T @ force.W, law, breaks=force.breaks))
    elements.append(LocalForce((body,), modal.constant[:, None], lambda *_: np.ones(1)))
    q, v = modal.reduce(start.q, start.v)
    return System(elements), replace(start, q=q, v=v, active=np.zeros(0, dtype=bool), excess=np.zeros(0))


def no_values() -> Array:
    """Of a step that did not converge."""
    return np.zeros((0, 0))


@dataclass(frozen=True)
class Step:
    """One trial step."""

    q: Array
    v: Array
    error: float
    iterations: int
    converged: bool
    # of a step that converged: coordinates (2, n) of the first two stages, forces (3, all rows and stresses) at all
    # three, speeds (4, n) as coefficients of powers of the time (s) since the step's end, lowest first
    stages: Array = field(default_factory=no_values)
    forces: Array = field(default_factory=no_values)
    speeds: Array = field(default_factory=no_values)


def radau_step(
    system: System, here: State, h: float, limit: Array, active: np.ndarray, last: Array | None = None
) -> Step:
    """Simplified Newton on the three stages, and the embedded error estimate against `limit`.

    `last`: the speeds of the step before, whose continuation is the first guess (Hairer & Wanner II, Sec. IV.8).
    """
    t, q, v, a, multipliers = here
    n, m = system.size, int(active.sum())
    at = np.append(C, 0.5) * h
    if last is None:
        ahead, speed = 0.5 * at[:, None] ** 2 * a, v + h / 2 * a
    else:
        powers = at[:, None] ** np.arange(1, 4)
        ahead, speed = (at[:, None] * powers / np.arange(2, 5)) @ last[1:], v + powers[3] @ last[1:]
    middle, middle_q, middle_v = t + h / 2, q + h / 2 * v + ahead[3], speed
    by_q, by_v = system.force_jacobian(middle, middle_q, middle_v, stressed=False)
    stresses, tangents = [], []
    for element, index in system.stressed:
        stress = element.stress(q[index], v[index])
        tangent = element.tangent(middle_q[index], middle_v[index], stress)
        by_q[np.ix_(index, index)] += tangent.by_q
        by_v[np.ix_(index, index)] += tangent.by_v
        tangents.append(tangent)
        stresses.append([stress, stress, stress])
    curvature = joint_stiffness(system, middle, middle_q, multipliers)
    G = system.jacobian(middle, middle_q)[active]
    M = system.mass
    if not all(np.isfinite(x).all() for x in (middle_q, by_q, by_v, curvature, G)):
        return Step(q, v, math.inf, 0, False)
    solves = []
    for mu in MU[:2]:
        factor = mu.real if abs(mu.imag) < 1e-12 else mu
        top = factor**2 / h**2 * M - factor / h * by_v - by_q + curvature
        solves.append(saddle_solver(top, G, system.units, system.row_units[active]))
    Z = ahead[:3]
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
            force = system.force(ti, Q, V[i], stressed=False)
            for k, (_, index) in enumerate(system.stressed):
                pull, lacks = tangents[k].force(Q[index], V[i][index], stresses[k][i])
                force[index] += pull
                stresses[k][i] = stresses[k][i] + lacks
            rest[i] = M @ acceleration[i] - force + Gi.T @ L[i]
            gaps[i] = system.residual(ti, Q)[active]
        r, g = BACK @ rest, BACK @ gaps
        dz0, dl0 = solves[0](-r[0].real, -g[0].real)
        dz1, dl1 = solves[1](-r[1], -g[1])
        dZ = np.real(np.outer(BASIS[:, 0], dz0)) + 2 * np.real(np.outer(BASIS[:, 1], dz1))
        dL = np.real(np.outer(BASIS[:, 0], dl0)) + 2 * np.real(np.outer(BASIS[:, 1], dl1))
        Z, L = Z + dZ, L + dL
        dV = INVERSE @ dZ / h
        for k, (_, index) in enumerate(system.stressed):
            for i in range(3):
                stresses[k][i] = stresses[k][i] + tangents[k].change(dZ[i][index], dV[i][index])
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
    pulls = np.zeros((3, system.rows))
    pulls[:, active] = L
    speeds = np.vstack([v, v + INVERSE @ Z / h])
    return Step(
        new_q,
        new_v,
        float(np.sqrt(np.mean((off.real / limit) ** 2))),
        iterations,
        True,
        stages=q + (C * h)[:2, None] * v + Z[:2],
        forces=np.hstack([pulls, *(np.reshape(stress, (3, -1)) for stress in stresses)]),
        speeds=(CUBIC @ speeds) / h ** np.arange(4)[:, None],
    )


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
