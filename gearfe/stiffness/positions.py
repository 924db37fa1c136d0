"""Positions of a sweep solved in batches, at given twists or at a given torque, and gathered into arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.finite_strain import finite_strain_shares, interpolated_shares, sample_numbers, with_share
from ..contact.position import Position
from ..errors import InputError
from ..gear.iso6336 import mesh_stiffness
from ..gear.validity import MOST_YIELD
from .contact_pressure import contact_pressures
from .curve import SOLVED
from .position_solver import ElementSolver, PositionSolver, bare
from .torque_control import ANGLE_ROUNDING, TorqueSolution, twists_for_torque

Array = NDArray[Any]
IntArray = NDArray[Any]
Progress = Callable[[int, int, str], None]

#: Positions handed to the solver at once: enough to work side by side, few enough to stay small in memory.
BATCH = 64
#: Torque mode: the finite-strain share changes with the twist that it moves, by about a hundredth of itself each pass.
SHARE_PASSES, SHARE_TOLERANCE = 6, 1e-10


@dataclass(frozen=True)
class Solved:
    """Solutions of n positions, without what only fields need.

    Attributes
    ----------
    twist : ndarray, shape (n,)
        Twist in all, lost motion included (rad).
    numbers : dict of str to ndarray, shape (n,)
        ``torque_wheel``, ``torque_pinion``, ``torque_wheel_reaction``, ``tangent``, see `Position`, and the quantities
        of `gearfe.stiffness.contact_pressure`.
    pairs : list of (ndarray, ndarray)
        For each position the numbers of the tooth pairs that carry load, and their torques (N m).
    iterations : ndarray, shape (n,)
    status : list of str
    """

    twist: Array
    numbers: dict[str, Array]
    pairs: list[tuple[IntArray, Array]]
    iterations: IntArray
    status: list[str]


def at_twists(
    solver: PositionSolver,
    angles: Array,
    twists: Array,
    progress: Progress | None,
    *,
    finite: bool = False,
    observe: Callable[[int, Position], None] | None = None,
) -> Solved:
    """Solve positions at given pinion angles and twists, both of shape (n,) (rad); with or without finite strain.

    `observe` is called with the number of each position and its small-strain solution, forces included, which are not
    kept.
    """
    elastic = solver.elastic
    sampled = sample_numbers(angles, elastic.pitch_angle) if finite else np.zeros(0, dtype=np.int64)
    keep = set(sampled.tolist())
    positions: list[Position] = []
    for start in range(0, len(angles), BATCH):
        part = slice(start, start + BATCH)
        kept = (sampled - start).tolist() if observe is None else range(len(angles[part]))
        made = solver.solve(angles[part], twists[part], kept)
        if observe is not None:
            for i, position in enumerate(made, start=start):
                observe(i, position)
        positions += [p if start + i in keep else bare(p) for i, p in enumerate(made)]
        if progress is not None:
            progress(len(positions), len(angles), "positions")
    if finite:
        shares = finite_strain_shares(elastic, [positions[i] for i in sampled])
        every = interpolated_shares(angles, angles[sampled], shares, elastic.pitch_angle)
        positions = [bare(with_share(p, c)) for p, c in zip(positions, every, strict=True)]
    iterations = np.array([p.iterations for p in positions], dtype=np.int64)
    return _collect(solver, angles, twists, positions, iterations, [p.status for p in positions])


def check_torque(solver: PositionSolver, torque: float) -> None:
    """Raise `InputError` for a torque (N m) that small strain is not meant for."""
    pair = solver.pair
    most = MOST_YIELD * pair.pinion.module * _usual_stiffness(solver) * pair.wheel.base_radius
    if torque > most:
        problem = f"must be <= {most:.3g} N m: the teeth would yield by more than {MOST_YIELD:g} modules"
        raise InputError("torque", torque, problem, "linear elasticity does not reach so far; give less")


def _usual_stiffness(solver: PositionSolver) -> float:
    """Mesh stiffness by the standard (N/m)."""
    pair, elastic = solver.pair, solver.elastic
    moduli = [body.material.youngs_modulus for body in elastic.bodies]
    return mesh_stiffness(pair, moduli[0], moduli[1]) * elastic.width


def at_torque(
    solver: PositionSolver,
    angles: Array,
    torque: float,
    touching: Array,
    progress: Progress | None,
    *,
    finite: bool = False,
) -> Solved:
    """Find the twists at which positions carry `torque` (N m), and solve them.

    The first position starts from the standard's stiffness, the others from the compliance that it showed; laws on
    elements start from the twists of the half-plane law, so that they are asked for loads near the goal. `touching` are
    the twists (rad), shape (n,), at which the rigid flanks touch. With finite strain the share of the torque is
    evaluated at the twists so found, which then move by that share.
    """
    guess = touching + torque / (_usual_stiffness(solver) * solver.pair.wheel.base_radius**2)
    goal = np.full(len(angles), torque)
    if isinstance(solver, ElementSolver):
        guess = _search(solver.half_plane, angles, goal, touching, guess, None).twist
    found = _search(solver, angles, goal, touching, guess, progress)
    if finite:
        found = _with_shares(solver, angles, goal, touching, found)
    return _collect(solver, angles, found.twist, found.positions, found.iterations, found.status)


def _with_shares(
    solver: PositionSolver, angles: Array, goal: Array, touching: Array, found: TorqueSolution
) -> TorqueSolution:
    """Move the twists until torque and finite-strain share at the same twist make the goal."""
    elastic = solver.elastic
    sampled = sample_numbers(angles, elastic.pitch_angle)
    iterations, before = found.iterations.copy(), np.zeros(len(angles))
    for _ in range(SHARE_PASSES):
        positions = solver.solve(angles[sampled], found.twist[sampled], range(len(sampled)))
        shares = finite_strain_shares(elastic, positions)
        every = interpolated_shares(angles, angles[sampled], shares, elastic.pitch_angle)
        reached, tangent = (np.array([getattr(p, n) for p in found.positions]) for n in ("torque_wheel", "tangent"))
        good = np.array(found.status) == "converged"
        step = np.divide(goal / (1 + every) - reached, tangent, out=np.zeros(len(goal)), where=good & (tangent > 0))
        again = np.flatnonzero(good)  # what was not reached is not asked for once more
        if len(again) == 0:
            break
        searched = _search(
            solver, angles[again], (goal / (1 + every))[again], touching[again], (found.twist + step)[again], None
        )
        found = _replaced(found, again, searched)
        iterations[again] += searched.iterations
        if np.max(np.abs(every - before)) <= max(SHARE_TOLERANCE, solver.torque_tolerance):
            break
        before = every
    raised = [with_share(p, c) for p, c in zip(found.positions, every, strict=True)]
    return found._replace(positions=raised, iterations=iterations)


def _replaced(found: TorqueSolution, places: IntArray, others: TorqueSolution) -> TorqueSolution:
    """The solutions `found`, with `others` at the places `places`."""
    twist, iterations = found.twist.copy(), found.iterations.copy()
    positions, status = list(found.positions), list(found.status)
    twist[places], iterations[places] = others.twist, others.iterations
    for place, position, one in zip(places.tolist(), others.positions, others.status, strict=True):
        positions[place], status[place] = position, one
    return TorqueSolution(twist, positions, iterations, status)


def _search(
    solver: PositionSolver,
    angles: Array,
    goal: Array,
    touching: Array,
    first: Array,
    progress: Progress | None,
) -> TorqueSolution:
    """Twists that carry the torques `goal` (N m), the first position ahead of the others to improve their guesses."""
    parts: list[TorqueSolution] = []
    starts = [0, *range(1, len(angles), BATCH)]
    for start, stop in zip(starts, [*starts[1:], len(angles)], strict=True):
        part = slice(start, stop)
        found = twists_for_torque(
            solver.solve,
            angles[part],
            goal[part],
            touching=touching[part],
            first=first[part],
            most=math.pi / solver.pair.wheel.teeth,
            tolerance=solver.torque_tolerance,
        )
        parts.append(found)
        if start == 0 and found.status[0] == "converged":
            first = touching + (found.twist[0] - touching[0]) / (first[0] - touching[0]) * (first - touching)
        if progress is not None:
            progress(stop, len(angles), "positions")
    return TorqueSolution(
        np.concatenate([f.twist for f in parts]),
        [position for f in parts for position in f.positions],
        np.concatenate([f.iterations for f in parts]),
        [one for f in parts for one in f.status],
    )


def _collect(
    solver: PositionSolver,
    angles: Array,
    twists: Array,
    positions: list[Position],
    iterations: IntArray,
    status: list[str],
) -> Solved:
    names = ("torque_wheel", "torque_pinion", "torque_wheel_reaction", "tangent")
    numbers = {name: np.array([getattr(p, name) for p in positions], dtype=float) for name in names}
    numbers |= contact_pressures(solver.elastic, solver.flanks, solver.touching(angles), positions)
    pairs = []
    for p in positions:
        carry = np.asarray(p.pair_torques) > 0
        pairs.append((np.asarray(p.pair_numbers, dtype=np.int64)[carry], np.asarray(p.pair_torques)[carry]))
    return Solved(twists, numbers, pairs, iterations, status)


def honest(solved: Solved, touching: Array) -> Solved:
    """Mark positions without contact whose exact rigid flanks overlap, and take all numbers off failed ones.

    `touching` are the twists (rad), shape (n,), at which the rigid flanks touch.
    """
    status = [
        "not_converged" if s == "no_contact" and twist > touch + ANGLE_ROUNDING else s
        for s, twist, touch in zip(solved.status, solved.twist, touching, strict=True)
    ]
    bad = ~np.isin(status, SOLVED)
    numbers = {n: np.where(bad, 0 if n == "edge" else np.nan, values) for n, values in solved.numbers.items()}
    return replace(solved, numbers=numbers, status=status)


def load_shares(pairs: list[tuple[IntArray, Array]], torque: Array) -> tuple[Array, Array]:
    """Number of the leading pair of each position, and the shares of it and of the pairs behind it."""
    leading = np.array([float(numbers.max()) if len(numbers) else np.nan for numbers, _ in pairs])
    most = max((int(np.ptp(numbers)) + 1 for numbers, _ in pairs if len(numbers)), default=1)
    shares = np.zeros((len(pairs), most))
    for i, (numbers, torques) in enumerate(pairs):
        if len(numbers):
            shares[i, numbers.max() - numbers] = torques / torque[i]
    failed = ~np.isfinite(torque)
    shares[failed], leading[failed] = np.nan, np.nan
    return leading, shares
