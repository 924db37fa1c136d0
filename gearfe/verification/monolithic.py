r"""The verification route: two whole gears in contact, solved in all unknowns at once.

The gears are a `ContactProblem` like any other bodies' (the blocks and rings of the patch tests, those of Hertz), and
`gearfe.verification.body_contact` solves it, with strains small or of Saint Venant-Kirchhoff bodies. Nothing but the
closest-point search is shared with the condensed route: no compliance, no cyclic symmetry, no windows of flank. On the
same mesh and quadrature points both must give the same torques; what they cost differs a hundredfold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .body_contact import TOLERANCE, ContactSolution, solve_contact
from .contact_state import contact_at
from .laws import ContactLaw
from .problem import ContactProblem
from .whole_pair import WholePair

Array = NDArray[np.float64]

#: Smallest step of the twist, as a share of it, when it is raised in steps.
SMALLEST_STEP = 0.02


@dataclass(frozen=True)
class MonolithicPosition:
    """Solution of one position on whole gears.

    Attributes
    ----------
    status, torque_wheel, torque_pinion, torque_wheel_reaction, peak_pressure, iterations
        As in `gearfe.contact.solver.Position`.
    mesh
        scikit-fem mesh of both gears in their present places (pinion's triangles first).
    displacement : ndarray
        Unknowns on second-order vector elements (m).
    pressure, place : ndarray, shape (q,)
        Pressure at the contact points (Pa) and where they are (edge of the mate's flank plus xi).
    """

    status: str
    torque_wheel: float
    torque_pinion: float
    torque_wheel_reaction: float
    peak_pressure: float
    iterations: int
    mesh: Any
    displacement: Array
    pressure: Array
    place: Array


def solve_monolithic(
    pair: WholePair, law: ContactLaw, pinion_angle: float, twist: float, *, tolerance: float = TOLERANCE
) -> MonolithicPosition:
    """Solve the contact of two whole gears at one pinion angle (rad) and wheel twist (rad).

    Where Newton's method fails from the rigid gears, the twist is raised in steps, each from the last solution; a step
    that fails is cut in half.

    Parameters
    ----------
    pair
        Both gears' meshes and materials.
    law
        Contact law.
    tolerance
        Out-of-balance forces relative to the contact forces.
    """
    problem = pair.problem(law, pinion_angle, twist)
    if problem is None:
        return _empty("no_contact", None)
    start = contact_at(problem, np.zeros(problem.unknowns.size))
    if not (start.projection.gap < 0).any():
        return _empty("under_resolved" if pair.rigid_overlap(problem) else "no_contact", problem.mesh)
    if problem.kinematics == "finite":
        # strains of the rigid overlap are out of all proportion: start from the solution of small strain
        small = solve_monolithic(replace(pair, kinematics="small"), law, pinion_angle, twist, tolerance=1e-4)
        if small.status == "converged":
            start = contact_at(problem, small.displacement)
    solution: ContactSolution | None = solve_contact(problem, start, tolerance=tolerance)
    assert solution is not None
    iterations = solution.iterations
    if solution.status != "converged":
        solution, more = _raised(pair, law, pinion_angle, twist, tolerance)
        iterations += more
    if solution is None or solution.status != "converged":
        return _empty("not_converged", problem.mesh, iterations)
    return _finish(pair, problem, solution, iterations)


def _raised(
    pair: WholePair, law: ContactLaw, pinion_angle: float, twist: float, tolerance: float
) -> tuple[ContactSolution | None, int]:
    """Solution at the end of steps of the twist, and the iterations of all of them."""
    done, step, iterations = 0.0, 0.25, 0
    last: Array | None = None
    while step > SMALLEST_STEP:
        share = min(1.0, done + step)
        part = pair.problem(law, pinion_angle, share * twist)
        if part is None:  # nothing touches yet
            done = share
            continue
        guess = contact_at(part, np.zeros(part.unknowns.size) if last is None else last * (share / done))
        if not (guess.projection.gap < 0).any() and share < 1.0:
            done = share
            continue
        tried = solve_contact(part, guess, tolerance=tolerance if share == 1.0 else 1e-4)
        iterations += tried.iterations
        if tried.status != "converged":
            step *= 0.5
        elif share == 1.0:
            return tried, iterations
        else:
            done, step, last = share, 1.5 * step, tried.u
    return None, iterations


def _finish(pair: WholePair, problem: ContactProblem, solution: ContactSolution, iterations: int) -> MonolithicPosition:
    state = solution.state
    placed = problem.mesh.doflocs.T + state.u[problem.unknowns]
    force, internal = state.contact[problem.unknowns], solution.internal[problem.unknowns]
    wheel = np.zeros(len(placed), dtype=bool)
    wheel[pair.node_of[1]] = True
    centre = np.array([pair.centre_distance, 0.0])
    bore = wheel & np.isin(problem.unknowns[:, 0], problem.fixed)
    return MonolithicPosition(
        status="converged",
        torque_wheel=-_moment((placed - centre)[wheel], force[wheel]),
        torque_pinion=-_moment(placed[~wheel], force[~wheel]),
        torque_wheel_reaction=_moment((placed - centre)[bore], internal[bore]),
        peak_pressure=float(state.pressure.max()),
        iterations=iterations,
        mesh=problem.mesh,
        displacement=state.u,
        pressure=state.pressure,
        place=state.projection.place,
    )


def _moment(arm: Array, force: Array) -> float:
    return float(np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))


def _empty(status: str, mesh: Any, iterations: int = 0) -> MonolithicPosition:
    nothing = 0.0 if status == "no_contact" else float("nan")
    none = np.zeros(0)
    return MonolithicPosition(
        status, nothing, nothing, nothing, nothing, iterations, mesh, displacement=none, pressure=none, place=none
    )
