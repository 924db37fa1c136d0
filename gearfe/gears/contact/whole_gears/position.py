"""One position of two whole gears in contact, small strain or Saint Venant-Kirchhoff bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ....base.typing import Array
from ..laws import ElementLaw
from .contact_state import contact_at
from .newton import TOLERANCE, ContactSolution, elastic_start, solve_contact
from .pair import MeshingArcs, WholePair
from .problem import ContactProblem

#: First and smallest step of the twist, as shares of it, where it is raised in steps.
FIRST_STEP, SMALLEST_STEP = 0.25, 0.02
#: Tolerance of solutions that only start another.
ROUGHLY = 1e-4


@dataclass(frozen=True)
class WholePosition:
    """Solution of one position on whole gears.

    Attributes
    ----------
    status
        ``converged``; ``no_contact``; ``under_resolved``, the rigid gears overlap but no contact point does;
        ``not_converged``. The numbers of the last two are NaN.
    torque_wheel, torque_pinion
        Moments of the contact pressure about the shafts (N m).
    torque_wheel_reaction
        Moment of the reactions at the bore of the wheel (N m).
    peak_pressure
        Largest pressure at a contact point (Pa).
    elements_per_contact
        Length of the narrowest contact in edges of its flank (-): its points under pressure over those of an edge.
    iterations
        Newton iterations of all steps.
    problem, solution
        Contact problem, and its solution with displacements and pressures; None without contact.
    """

    status: str
    torque_wheel: float = math.nan
    torque_pinion: float = math.nan
    torque_wheel_reaction: float = math.nan
    peak_pressure: float = math.nan
    elements_per_contact: float = math.nan
    iterations: int = 0
    problem: ContactProblem | None = None
    solution: ContactSolution | None = None


#: Position in which the gears do not touch.
APART = WholePosition("no_contact", 0.0, 0.0, 0.0, 0.0)


def solve_position(
    pair: WholePair, law: ElementLaw, pinion_angle: float, twist: float, *, tolerance: float = TOLERANCE
) -> WholePosition:
    """Solve the contact of two whole gears at one position.

    Where Newton's method fails from `elastic_start`, the twist is raised in steps, each from the last solution; a step
    that fails is cut in half.

    Parameters
    ----------
    pair
        Meshes and materials of both gears.
    law
        Contact law.
    pinion_angle
        Pinion angle (rad).
    twist
        Twist of the wheel from the centred position (rad).
    tolerance
        Out-of-balance forces relative to the contact forces.
    """
    meshing = pair.arcs(pinion_angle, twist)
    if meshing is None:
        return APART
    return _solved(pair, meshing, law, (pinion_angle, twist), tolerance)


def _solved(
    pair: WholePair, meshing: MeshingArcs, law: ElementLaw, place: tuple[float, float], tolerance: float
) -> WholePosition:
    """Return the solution on arcs of the gears at a place: pinion angle and twist (rad)."""
    problem = pair.problem(meshing, law, *place)
    if problem is None:
        return APART
    start = contact_at(problem, np.zeros(problem.unknowns.size))
    if not (start.projection.gap < 0).any():
        overlap = any((problem.node_gaps(*couple) < 0).any() for couple in problem.facing)
        return WholePosition("under_resolved") if overlap else APART
    if pair.kinematics == "finite":
        # strains of the rigid overlap are out of all proportion: start from the solution of small strain
        small = _solved(replace(pair, kinematics="small"), meshing, law, place, ROUGHLY)
        if small.solution is not None:
            start = contact_at(problem, small.solution.u)
    else:
        start = elastic_start(problem)
    solution = solve_contact(problem, start, tolerance=tolerance)
    if solution.status == "converged":
        return _position(pair, meshing, problem, solution, solution.iterations)
    raised, more = _raised(pair, meshing, law, place, tolerance)
    iterations = solution.iterations + more
    if raised is None:
        return WholePosition("not_converged", iterations=iterations)
    return _position(pair, meshing, *raised, iterations)


def _raised(
    pair: WholePair, meshing: MeshingArcs, law: ElementLaw, place: tuple[float, float], tolerance: float
) -> tuple[tuple[ContactProblem, ContactSolution] | None, int]:
    """Return problem and solution at the end of steps of the twist, and the iterations of all of them."""
    done, step, iterations, u = 0.0, FIRST_STEP, 0, None
    pinion_angle, twist = place
    while step > SMALLEST_STEP:
        share = min(1.0, done + step)
        problem = pair.problem(meshing, law, pinion_angle, share * twist)
        if problem is not None:
            start = contact_at(problem, np.zeros(problem.unknowns.size) if u is None else u * (share / done))
        if problem is None or (share < 1 and not (start.projection.gap < 0).any()):  # nothing touches yet
            done = share
            continue
        solution = solve_contact(problem, start, tolerance=tolerance if share == 1 else ROUGHLY)
        iterations += solution.iterations
        if solution.status != "converged":
            step *= 0.5
        elif share == 1:
            return (problem, solution), iterations
        else:
            done, step, u = share, 1.5 * step, solution.u
    return None, iterations


def _position(
    pair: WholePair, meshing: MeshingArcs, problem: ContactProblem, solution: ContactSolution, iterations: int
) -> WholePosition:
    """Return the numbers of a solution: moments about the shafts, pressure, width of the contact."""
    u = solution.u[problem.unknowns]
    placed = problem.mesh.doflocs.T + u
    force, internal = solution.state.forces[problem.unknowns], solution.internal[problem.unknowns]
    # the supports of condensed sectors carry the moment of the forces on their faces, at small strain
    on_remainder = (problem.remainder @ solution.u)[problem.unknowns]
    pinion, wheel = meshing.bodies.node_of
    bore = wheel[np.isin(problem.unknowns[wheel, 0], problem.fixed)]
    from_wheel = placed - [pair.wheel_centre, 0.0]
    reaction = _moment(from_wheel[bore], internal[bore]) - _moment((from_wheel - u)[wheel], on_remainder[wheel])
    loaded = np.bincount(solution.state.points.mate, solution.state.pressure > 0) / problem.points_per_edge
    return WholePosition(
        status="converged",
        torque_wheel=-pair.sign * _moment(from_wheel[wheel], force[wheel]),
        torque_pinion=-_moment(placed[pinion], force[pinion]),
        torque_wheel_reaction=pair.sign * reaction,
        peak_pressure=float(solution.state.pressure.max()),
        elements_per_contact=float(loaded[loaded > 0].min()) if pair.quadrature == "points" else math.nan,
        iterations=iterations,
        problem=problem,
        solution=solution,
    )


def _moment(arm: Array, force: Array) -> float:
    return float(np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))
