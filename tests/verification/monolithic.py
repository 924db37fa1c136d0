"""Two whole gears in contact, solved in all unknowns at once.

The gears are a `ContactProblem` like any other bodies' (the blocks and rings of the patch tests, those of Hertz), with
strains small or of Saint Venant-Kirchhoff bodies. No compliance, no cyclic symmetry, no windows of flank: on the same
mesh and quadrature points the condensed route must give the same torques; what they cost differs a hundredfold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearfe.contact.laws import ElementLaw
from gearfe.typing import Array

from .contact_state import contact_at
from .newton import TOLERANCE, ContactSolution, solve_contact
from .problem import ContactProblem
from .whole_pair import WholePair

#: Smallest step of the twist, as a share of it, when it is raised in steps.
SMALLEST_STEP = 0.02
#: Tolerance of solutions that only start another.
ROUGHLY = 1e-4


@dataclass(frozen=True)
class MonolithicPosition:
    """Solution of one position on whole gears.

    Attributes
    ----------
    status
        ``converged``; ``no_contact``; ``under_resolved``, the rigid gears overlap but no contact point does;
        ``not_converged``.
    torque_wheel, torque_pinion
        Moments of the contact pressure about the shafts (N m).
    torque_wheel_reaction
        Moment of the reactions at the wheel's bore (N m).
    peak_pressure
        Pa.
    iterations
        Newton iterations of all steps.
    problem, solution
        What was solved, and displacements, pressures and places of the contact points; None without contact.
    """

    status: str
    torque_wheel: float
    torque_pinion: float
    torque_wheel_reaction: float
    peak_pressure: float
    iterations: int = 0
    problem: ContactProblem | None = None
    solution: ContactSolution | None = None


FAILED = (float("nan"),) * 4


def solve_monolithic(
    pair: WholePair, law: ElementLaw, pinion_angle: float, twist: float, *, tolerance: float = TOLERANCE
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
        return MonolithicPosition("no_contact", 0.0, 0.0, 0.0, 0.0)
    start = contact_at(problem, np.zeros(problem.unknowns.size))
    if not (start.projection.gap < 0).any():
        if any((problem.node_gaps(*couple) < 0).any() for couple in problem.facing):
            return MonolithicPosition("under_resolved", *FAILED)
        return MonolithicPosition("no_contact", 0.0, 0.0, 0.0, 0.0)
    if pair.kinematics == "finite":
        # strains of the rigid overlap are out of all proportion: start from the solution of small strain
        small = solve_monolithic(replace(pair, kinematics="small"), law, pinion_angle, twist, tolerance=ROUGHLY)
        if small.solution is not None:
            start = contact_at(problem, small.solution.u)
    solution = solve_contact(problem, start, tolerance=tolerance)
    if solution.status == "converged":
        return _position(pair, problem, solution, solution.iterations)
    raised, more = _raised(pair, law, pinion_angle, twist, tolerance)
    iterations = solution.iterations + more
    if raised is None:
        return MonolithicPosition("not_converged", *FAILED, iterations)
    return _position(pair, problem, raised, iterations)


def _raised(
    pair: WholePair, law: ElementLaw, pinion_angle: float, twist: float, tolerance: float
) -> tuple[ContactSolution | None, int]:
    """Solution at the end of steps of the twist, and the iterations of all of them."""
    done, step, iterations, u = 0.0, 0.25, 0, None
    while step > SMALLEST_STEP:
        share = min(1.0, done + step)
        problem = pair.problem(law, pinion_angle, share * twist)
        if problem is not None:
            start = contact_at(problem, np.zeros(problem.unknowns.size) if u is None else u * (share / done))
        if problem is None or (share < 1 and not (start.projection.gap < 0).any()):  # nothing touches yet
            done = share
            continue
        tried = solve_contact(problem, start, tolerance=tolerance if share == 1 else ROUGHLY)
        iterations += tried.iterations
        if tried.status != "converged":
            step *= 0.5
        elif share == 1:
            return tried, iterations
        else:
            done, step, u = share, 1.5 * step, tried.u
    return None, iterations


def _position(
    pair: WholePair, problem: ContactProblem, solution: ContactSolution, iterations: int
) -> MonolithicPosition:
    placed = problem.mesh.doflocs.T + solution.u[problem.unknowns]
    force, internal = solution.state.contact[problem.unknowns], solution.internal[problem.unknowns]
    pinion, wheel = pair.bodies.node_of
    bore = wheel[np.isin(problem.unknowns[wheel, 0], problem.fixed)]
    from_wheel = placed - [pair.centre_distance, 0.0]
    return MonolithicPosition(
        status="converged",
        torque_wheel=-_moment(from_wheel[wheel], force[wheel]),
        torque_pinion=-_moment(placed[pinion], force[pinion]),
        torque_wheel_reaction=_moment(from_wheel[bore], internal[bore]),
        peak_pressure=float(solution.state.pressure.max()),
        iterations=iterations,
        problem=problem,
        solution=solution,
    )


def _moment(arm: Array, force: Array) -> float:
    return float(np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))
