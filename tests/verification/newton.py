r"""Contact of elastic bodies in all unknowns at once, by a semi-smooth Newton method with a backtracking line search.

The weak form and its derivative are in `tests.verification.forms`. The exact law adds an equation for each of its
multipliers, with the mean gap :math:`\bar g_i = \int\psi_i g / \int\psi_i` and any c > 0,

.. math:: \lambda_i = \max(0,\; \lambda_i - c\,\bar g_i),

a primal-dual active set (Alart & Curnier, *Comput. Methods Appl. Mech. Eng.* 92, 1991; Hueeber & Wohlmuth, *Comput.
Methods Appl. Mech. Eng.* 194, 2005).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from gearfe.typing import Array, IntArray

from .contact_state import ContactState, contact_at, multiplier_basis
from .forms import gap_change, unit_pressure_work
from .problem import ContactProblem

#: Out-of-balance forces relative to the contact forces at which a position counts as converged.
TOLERANCE = 1e-10
MAX_ITERATIONS = 25
#: Newton steps taken in full before the line search watches over them.
FREE_ITERATIONS = 3
#: Halvings of a step.
HALVINGS = 5


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
        Out-of-balance after each iteration, relative to the contact forces.
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
    start
        State to start from; without one the bodies are undeformed and their contact is the rigid one.
    tolerance
        Out-of-balance forces relative to the contact forces (or loads, where those are larger).
    """
    closing = problem.closing if start is None else 0.0
    state = contact_at(problem, np.zeros(problem.unknowns.size), closing=closing) if start is None else start
    free = np.setdiff1d(np.arange(problem.unknowns.size), problem.fixed)
    residuals = [np.inf]
    for iteration in range(MAX_ITERATIONS):
        step, aim, diagonal = _newton_step(problem, state, free, closing)
        tried = []
        for length in 0.5 ** np.arange(HALVINGS + 1):
            there = contact_at(problem, state.u + length * step, state.multipliers + length * (aim - state.multipliers))
            internal = problem.constitution.forces(there.u)
            tried.append((_out_of_balance(problem, there, internal, free), there, internal))
            if tried[-1][0] < (1 - 0.1 * length) * residuals[-1] or iteration < FREE_ITERATIONS:
                break
        residual, state, internal = min(tried, key=lambda found: found[0])
        residuals.append(residual)
        closing = 0.0
        if residual < max(tolerance, _rounding(problem, state, diagonal)):
            return ContactSolution("converged", state, internal, tuple(residuals[1:]))
        if np.isnan(residual):
            break
    return ContactSolution("not_converged", state, internal, tuple(residuals[1:]))


def _scale(problem: ContactProblem, state: ContactState) -> float:
    return max(float(np.abs(state.contact).sum()), float(np.abs(problem.loads).sum()))


def _rounding(problem: ContactProblem, state: ContactState, diagonal: Array) -> float:
    """Smallest residual that rounding lets through: last bits of places times gamma, of u times the stiffness."""
    gamma = state.points.gamma * (state.pressure > 0)
    extent = float(np.abs(problem.mesh.doflocs).max())
    forces = extent * float(state.points.weight @ gamma) + float(np.abs(diagonal) @ np.abs(state.u))
    return 4 * float(np.finfo(float).eps) * forces / max(_scale(problem, state), 1e-300)


def _out_of_balance(problem: ContactProblem, state: ContactState, internal: Array, free: IntArray) -> float:
    """Forces that nothing balances, and what is left of the complementarity, relative to the contact forces."""
    scale = _scale(problem, state)
    left = float(np.abs((state.forces + problem.loads - internal)[free]).sum())
    if problem.law.name == "exact":
        _, areas, gaps, parameter = _mean_gaps(state)
        asked = np.maximum(0.0, state.multipliers - parameter * gaps)
        left += float(areas @ np.abs(state.multipliers - asked))
    return left / scale if scale > 0 else np.inf


def _newton_step(
    problem: ContactProblem, state: ContactState, free: IntArray, closing: float
) -> tuple[Array, Array, Array]:
    """Newton's step of the displacements, the multipliers that it aims at, and the matrix' diagonal."""
    matrix = problem.constitution.tangent(state.u) - state.tangent()
    step = np.zeros(len(state.u))
    step[problem.fixed] = problem.values - state.u[problem.fixed]
    out = problem.loads - problem.constitution.forces(state.u) - matrix @ step
    factor = splu(csc_matrix(matrix[free][:, free]), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    if problem.law.name != "exact":
        step[free] = factor.solve((out + state.forces)[free])
        return step, state.multipliers, matrix.diagonal()
    # K du = out + B lambda,  G du = -(mean gap times area),  with B and G the work and the gaps of the active basis
    basis, areas, gaps, parameter = _mean_gaps(state)
    active = np.flatnonzero((state.multipliers - parameter * (gaps - closing) > 0) & (areas > 0))
    work, change = ((basis.T @ state.rows(form))[active].tocsc() for form in (unit_pressure_work, gap_change))
    loose = factor.solve(out[free])
    pushed = factor.solve(work[:, free].T.toarray())
    aim = np.zeros(len(state.multipliers))
    present = areas[active] * gaps[active] + change @ step
    aim[active] = np.linalg.solve(change[:, free] @ pushed, -present - change[:, free] @ loose)
    step[free] = loose + pushed @ aim[active]
    return step, aim, matrix.diagonal()


def _mean_gaps(state: ContactState) -> tuple[Any, Array, Array, Array]:
    """Hats at the points, their areas (m2), mean gaps (m) and the law's parameter (Pa/m)."""
    basis, parameter = multiplier_basis(state.points)
    weight = state.points.weight * state.share
    areas = basis.T @ weight
    gaps = np.divide(basis.T @ (weight * state.projection.gap), areas, out=np.ones(len(areas)), where=areas > 0)
    return basis, areas, gaps, parameter
