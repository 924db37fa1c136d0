"""Contact of elastic bodies in all unknowns at once, by a semi-smooth Newton method with a backtracking line search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from ....base.progress import count
from ....base.typing import Array, IntArray
from .contact_state import ContactState, contact_at
from .problem import ContactProblem

#: Out-of-balance forces, relative to the contact forces, at which a solution counts as converged.
TOLERANCE = 1e-10
#: Most Newton iterations.
MAX_ITERATIONS = 25
#: Newton steps that are taken in full before the line search begins.
FREE_ITERATIONS = 3
#: Moves of `elastic_start`: with fewer, Newton's method takes up to three times as many steps (20/30 pair).
PASSES = 4
#: Most halvings of a step.
HALVINGS = 5
#: Out-of-balance (-) below which a factorisation is kept while each step with it divides that by ten: points under
#: pressure hardly change any more, and factorisations are most of the time.
NEAR = 1e-2


@dataclass(frozen=True)
class ContactSolution:
    """Bodies in contact.

    Attributes
    ----------
    status
        ``converged`` or ``not_converged``.
    state
        Contact at the last displacement.
    internal : ndarray
        Internal forces (N); at prescribed unknowns they are the reactions.
    residuals
        Out-of-balance forces after each iteration, relative to the contact forces.
    """

    status: str
    state: ContactState
    internal: Array
    residuals: tuple[float, ...]

    @property
    def u(self) -> Array:
        """Displacements of all unknowns (m)."""
        return self.state.u

    @property
    def iterations(self) -> int:
        """Newton iterations."""
        return len(self.residuals)


def solve_contact(
    problem: ContactProblem, start: ContactState | None = None, *, tolerance: float = TOLERANCE
) -> ContactSolution:
    """Solve a contact problem.

    Parameters
    ----------
    problem
        Bodies, supports, loads and surfaces.
    start
        State to start from; without one the bodies are undeformed.
    tolerance
        Out-of-balance forces relative to the contact forces (or loads, where those are larger).
    """
    state = contact_at(problem, np.zeros(problem.unknowns.size)) if start is None else start
    internal = problem.constitution.forces(state.u)
    free = np.setdiff1d(np.arange(problem.unknowns.size), problem.fixed)
    residuals, newton = [np.inf], None
    for iteration in range(MAX_ITERATIONS):
        count(iteration, None, "Newton iterations")
        if newton is None:
            newton = _Linearised(problem, state, free)
        step = newton.step(problem, state, internal)
        trials = []
        for length in 0.5 ** np.arange(HALVINGS + 1):
            trial = contact_at(problem, state.u + length * step)
            internal = problem.constitution.forces(trial.u)
            trials.append((_out_of_balance(problem, trial, internal, free), trial, internal))
            if trials[-1][0] < (1 - 0.1 * length) * residuals[-1] or iteration < FREE_ITERATIONS:
                break
        residual, state, internal = min(trials, key=lambda trial: trial[0])
        residuals.append(residual)
        if residual < max(tolerance, _rounding(problem, state, newton.diagonal)):
            return ContactSolution("converged", state, internal, tuple(residuals[1:]))
        if np.isnan(residual):
            break
        if residual > min(NEAR, 0.1 * residuals[-2]):
            newton = None
    return ContactSolution("not_converged", state, internal, tuple(residuals[1:]))


def elastic_start(problem: ContactProblem) -> ContactState:
    """Return a contact near the solution of bodies whose rigid shapes overlap.

    Each of `PASSES` moves the bodies along their deflection under the forces that are out of balance, up to where these
    do no more work. The deep and wide overlap of the rigid bodies shrinks to about that of the contact. From the
    overlap itself Newton's method takes twice as many steps, or fails beyond a hundredth of a tooth.
    """
    stiffness = problem.constitution.tangent(np.zeros(problem.unknowns.size))
    free = np.setdiff1d(np.arange(problem.unknowns.size), problem.fixed)
    factor = _factorised(stiffness, free)
    state = contact_at(problem, np.zeros(problem.unknowns.size))
    for _ in range(PASSES):
        origin, way = state.u, np.zeros(len(state.u))
        way[free] = factor.solve((state.forces - stiffness @ origin)[free])

        def work(share: float, origin: Array = origin, way: Array = way) -> float:
            u = origin + share * way
            return float(way @ (stiffness @ u - contact_at(problem, u).forces))

        share = brentq(work, 0.0, 1.0, xtol=1e-4, rtol=0.02) if work(1.0) > 0 else 1.0
        state = contact_at(problem, origin + share * way)
    return state


def _factorised(matrix: Any, free: IntArray) -> Any:
    """Return the factorisation of a sparse matrix on the free unknowns."""
    return splu(csc_matrix(matrix[free][:, free]), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})


def _scale(problem: ContactProblem, state: ContactState) -> float:
    return max(float(np.abs(state.forces).sum()), float(np.abs(problem.loads).sum()))


def _rounding(problem: ContactProblem, state: ContactState, diagonal: Array) -> float:
    """Return the smallest residual above rounding: last bits of places times gamma, of u times the stiffness."""
    gamma = state.points.gamma * (state.pressure > 0)
    extent = float(np.abs(problem.mesh.doflocs).max())
    forces = extent * float(state.points.weight @ gamma) + float(np.abs(diagonal) @ np.abs(state.u))
    return 4 * float(np.finfo(float).eps) * forces / max(_scale(problem, state), 1e-300)


def _out_of_balance(problem: ContactProblem, state: ContactState, internal: Array, free: IntArray) -> float:
    """Return the out-of-balance forces relative to the contact forces."""
    scale = _scale(problem, state)
    out = float(np.abs((state.forces + problem.loads - internal)[free]).sum())
    return out / scale if scale > 0 else np.inf


class _Linearised:
    """Problem linearised at a state: factorised tangent on the free unknowns."""

    def __init__(self, problem: ContactProblem, state: ContactState, free: IntArray) -> None:
        matrix = csc_matrix(problem.constitution.tangent(state.u) - state.tangent())
        self.diagonal, self._free, self._held = matrix.diagonal(), free, matrix[:, problem.fixed][free]
        self._factor = _factorised(matrix, free)

    def step(self, problem: ContactProblem, state: ContactState, internal: Array) -> Array:
        """Return Newton's step of the displacements (m) at a state with these internal forces (N)."""
        step = np.zeros(len(state.u))
        step[problem.fixed] = problem.values - state.u[problem.fixed]
        out = (state.forces + problem.loads - internal)[self._free] - self._held @ step[problem.fixed]
        step[self._free] = self._factor.solve(out)
        return step
