r"""Contact of elastic bodies as plain scikit-fem forms, solved in all unknowns at once.

Find the displacements u of all bodies, with prescribed values, such that for all v

.. math::
    a(u, v) - \int_{\Gamma_C} \frac{\theta}{\gamma}\,\sigma_n(u)\,\sigma_n(v)
    = \ell(v) + \int_{\Gamma_s} p\; n\cdot[v] + \int_{\Gamma_s} \frac{\theta}{\gamma}\, p\, \sigma_n(v), \qquad
    [v] = v(x_s) - v(x_m), \qquad p = \max(0,\; -\gamma g(u) - s\,\sigma_n(u)),

with a the elastic energy's form on the undeformed bodies in their present places (or its finite-strain counterpart,
`gearfe.verification.constitution`), x_m the closest point of the deformed mate, n its normal there and sigma_n the
normal stress at x_s. Newton's tangent adds, with the variations of `gearfe.contact.closest`,

.. math::
    \int_{\Gamma_s} H(p)\,(\gamma\,\delta g(u) + s\,\sigma_n(u))\,(n\cdot[v] + \tfrac{\theta}{\gamma}\sigma_n(v))
    \;-\; p\,\Delta(n\cdot[v])

and the change of the area of points whose stretch of surface lies across the mate's sharp end. A law on a multiplier
space has :math:`p = \sum_i \lambda_i\psi_i` instead, and one more equation for each of its active functions (a
primal-dual active set: Hueeber & Wohlmuth, *Comput. Methods Appl. Mech. Eng.* 194, 2005).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu

from .contact_state import ContactState, contact_at, contact_rows, contact_tangent, hat_functions
from .problem import ContactProblem

Array = NDArray[np.float64]
IntArray = NDArray[Any]

#: Out-of-balance forces relative to the contact forces at which a position counts as converged.
TOLERANCE = 1e-10
MAX_ITERATIONS = 25
#: Newton steps taken in full before the line search watches over them.
FREE_ITERATIONS = 3
#: After so many steps without contact forces near balance (residual above 1/2) a start is given up.
PATIENCE = 12


@dataclass(frozen=True)
class ContactSolution:
    """Bodies in contact.

    Attributes
    ----------
    status
        ``converged`` or ``not_converged``.
    state
        Contact at the last displacement; its `u` are the displacements (m).
    internal : ndarray
        Internal forces (N); at prescribed unknowns they are the reactions.
    iterations
        Newton iterations.
    residuals
        Out-of-balance after each, relative to the contact forces.
    """

    status: str
    state: ContactState
    internal: Array
    iterations: int
    residuals: tuple[float, ...]

    @property
    def u(self) -> Array:
        """Displacements of all unknowns (m)."""
        return self.state.u


def solve_contact(
    problem: ContactProblem, start: ContactState | None = None, *, tolerance: float = TOLERANCE
) -> ContactSolution:
    """Solve a contact problem by a semi-smooth Newton method with a backtracking line search.

    Parameters
    ----------
    start
        State to start from; without one the bodies are undeformed and their contact is the rigid one.
    tolerance
        Out-of-balance forces relative to the contact forces (or loads, where those are larger).
    """
    size = problem.unknowns.size
    state = contact_at(problem, np.zeros(size), closing=problem.closing) if start is None else start
    free = np.setdiff1d(np.arange(size), problem.fixed)
    residual, history = np.inf, list[float]()
    for iteration in range(1, MAX_ITERATIONS + 1):
        closing = problem.closing if iteration == 1 and start is None else 0.0
        step, aim, diagonal = _step(problem, state, free, closing)
        length, best = 1.0, None
        for _ in range(6):
            multipliers = state.multipliers + length * (aim - state.multipliers)
            tried = contact_at(problem, state.u + length * step, state, multipliers)
            internal = problem.constitution.forces(tried.u)
            error = _out_of_balance(problem, tried, internal, free)
            if best is None or error < best[0]:
                best = (error, tried, internal)
            if error < (1 - 0.1 * length) * residual or iteration <= FREE_ITERATIONS:
                break
            length *= 0.5
        assert best is not None
        residual, state, internal = best
        history.append(residual)
        if np.isnan(residual) or (iteration >= PATIENCE and residual > 0.5):
            break
        if residual < max(tolerance, _rounding(problem, state, diagonal)):
            return ContactSolution("converged", state, internal, iteration, tuple(history))
    return ContactSolution("not_converged", state, internal, iteration, tuple(history))


def _scale(problem: ContactProblem, state: ContactState) -> float:
    return max(float(np.abs(state.contact).sum()), float(np.abs(problem.loads).sum()))


def _rounding(problem: ContactProblem, state: ContactState, diagonal: Array) -> float:
    """Smallest residual that rounding lets through: last bits of places times gamma, of u times the stiffness."""
    parameter = problem.slaves.parameter[state.points.edge] * (state.pressure > 0)
    extent = float(np.abs(problem.mesh.doflocs).max())
    forces = extent * float(state.points.weight @ parameter) + float(np.abs(diagonal) @ np.abs(state.u))
    return 4 * float(np.finfo(float).eps) * forces / max(_scale(problem, state), 1e-300)


def _out_of_balance(problem: ContactProblem, state: ContactState, internal: Array, free: IntArray) -> float:
    """Forces that nothing balances, and what is left of the complementarity, relative to the contact forces."""
    scale = _scale(problem, state)
    left = float(np.abs((state.forces + problem.loads - internal)[free]).sum())
    if problem.law.name == "exact":
        _, areas, gaps, parameter = _mean_gaps(problem, state)
        asked = np.maximum(0.0, state.multipliers - parameter * gaps)
        left += float(areas @ np.abs(state.multipliers - asked))
    return left / scale if scale > 0 else np.inf


def _step(problem: ContactProblem, state: ContactState, free: IntArray, closing: float) -> tuple[Array, Array, Array]:
    """Newton's step of the displacements, the multipliers that it aims at, and the matrix' diagonal."""
    matrix = problem.constitution.tangent(state.u) + contact_tangent(problem, state)
    step = np.zeros(len(state.u))
    step[problem.fixed] = problem.values - state.u[problem.fixed]
    out = problem.loads - problem.constitution.forces(state.u) - matrix @ step
    factor = splu(csc_matrix(matrix[free][:, free]), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    if problem.law.name != "exact":
        step[free] = factor.solve((out + state.forces)[free])
        return step, state.multipliers, matrix.diagonal()
    hats, areas, gaps, parameter = _mean_gaps(problem, state)
    active = np.flatnonzero((state.multipliers - parameter * (gaps - closing) > 0) & (areas > 0))
    push, opening = contact_rows(state)
    weights = diags(state.points.weight * _reached_share(state))
    push_rows = (hats.T @ weights @ push)[active].tocsc()
    gap_rows = (hats.T @ weights @ opening)[active].tocsc()
    loose = factor.solve(out[free])
    moved = factor.solve(push_rows[:, free].T.toarray())
    rows = gap_rows[:, free]
    present = areas[active] * gaps[active] + gap_rows @ step
    aim = np.zeros(len(state.multipliers))
    aim[active] = np.linalg.solve(rows @ moved, -present - rows @ loose)
    step[free] = loose + moved @ aim[active]
    return step, aim, matrix.diagonal()


def _reached_share(state: ContactState) -> Array:
    from ..contact.closest import unreached

    return np.where(unreached(state.projection.gap), 0.0, np.asarray(state.fields["share"])[:, 0])


def _mean_gaps(problem: ContactProblem, state: ContactState) -> tuple[Any, Array, Array, Array]:
    """Multiplier functions at the points, their areas (m2), mean gaps (m) and the law's parameter (Pa/m)."""
    hats, parameter = hat_functions(problem, state.points)
    weight = state.points.weight * _reached_share(state)
    areas = hats.T @ weight
    gaps = np.divide(hats.T @ (weight * state.projection.gap), areas, out=np.ones(len(areas)), where=areas > 0)
    return hats, areas, gaps, parameter
