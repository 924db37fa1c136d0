"""Positions of a sweep solved in batches, at given twists or at given torques."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..contact.finite_strain import finite_strain_shares, interpolated_shares, sample_numbers, with_shares
from ..contact.position import TORQUES, Positions, together
from ..errors import InputError
from ..gear.iso6336 import mesh_stiffness
from ..gear.validity import MOST_YIELD
from ..typing import Array, IntArray
from .position_solver import NONE, ElementSolver, PositionSolver
from .torque_control import ANGLE_ROUNDING, newton_twist, twists_for_torque

Progress = Callable[[int, int, str], None]

#: Positions handed to the solver at once: enough to work side by side, few enough to stay small in memory.
BATCH = 128
#: The finite-strain share changes with the twist that it moves, by about a hundredth of itself each pass.
SHARE_PASSES = 6


def in_batches(
    solver: PositionSolver, angles: Array, twists: Array, kept: IntArray = NONE, progress: Progress | None = None
) -> Positions:
    """Positions at pinion angles and twists, both of shape (n,) (rad); those numbered `kept` with loads."""
    made = []
    for start in range(0, max(1, len(angles)), BATCH):
        part = slice(start, start + BATCH)
        made.append(solver.solve(angles[part], twists[part], kept - start))
        if progress is not None:
            progress(min(start + BATCH, len(angles)), len(angles), "positions")
    return together(made)


def at_twists(
    solver: PositionSolver, angles: Array, twists: Array, progress: Progress | None, *, finite: bool = False
) -> Positions:
    """Positions at pinion angles and twists, both of shape (n,) (rad); with or without finite strain."""
    cycle = solver.elastic.pitch_angle
    sampled = sample_numbers(angles, cycle) if finite else NONE
    found = in_batches(solver, angles, twists, sampled, progress)
    if not finite:
        return found
    shares = finite_strain_shares(solver.elastic, found.take(sampled))
    return with_shares(found, interpolated_shares(angles, angles[sampled], shares, cycle))


def check_torque(solver: PositionSolver, torque: float) -> None:
    """Raise `InputError` for a torque (N m) that small strain is not meant for."""
    pair = solver.pair
    most = MOST_YIELD * pair.pinion.module * usual_stiffness(solver) / pair.wheel.base_radius
    if torque > most:
        problem = f"must be <= {most:.3g} N m: the teeth would yield by more than {MOST_YIELD:g} modules"
        raise InputError("torque", torque, problem, "linear elasticity does not reach so far; give less")


def usual_stiffness(solver: PositionSolver) -> float:
    """Torque per twist by the standard's mesh stiffness (N m/rad)."""
    pair, elastic = solver.pair, solver.elastic
    moduli = [body.material.youngs_modulus for body in elastic.bodies]
    return mesh_stiffness(pair, moduli[0], moduli[1]) * elastic.width * pair.wheel.base_radius**2


def at_torques(
    solver: PositionSolver,
    angles: Array,
    goal: Array,
    touching: Array,
    shares_of: Callable[[Positions], Array] | None,
    *,
    first: Array | None = None,
    share: Array | float = 0.0,
    kept: IntArray = NONE,
    tolerance: float | None = None,
    progress: Progress | None = None,
) -> tuple[Positions, Array]:
    """Small-strain positions whose torques make `goal` (N m) with their shares of finite strain, and these shares.

    Laws on elements start from the twists of the half-plane law, so that they are asked for loads near the goal.

    Parameters
    ----------
    touching
        Twists (rad), shape (n,), at which the rigid flanks touch.
    shares_of
        Says the shares of positions; without it there are none.
    first, share
        Twists to start from (rad), by default by the standard's stiffness, and shares expected there.
    tolerance
        Relative error of the torque, by default the solver's.
    """
    accepted = solver.torque_tolerance if tolerance is None else tolerance
    twist = touching + goal / usual_stiffness(solver) if first is None else first
    share = np.broadcast_to(share, goal.shape)
    if isinstance(solver, ElementSolver) and first is None:
        twist = at_torques(solver.half_plane, angles, goal, touching, None)[0].twist

    def search(chosen: IntArray) -> Positions:
        def solve(numbers: IntArray, twists: Array) -> Positions:
            own = chosen[numbers]
            if progress is not None:
                progress(len(goal) - len(own), len(goal), "positions")
            return in_batches(solver, angles[own], twists, np.flatnonzero(np.isin(own, kept)))

        most = math.pi / solver.pair.wheel.teeth
        aim, at = (goal / (1 + share))[chosen], {"touching": touching[chosen], "first": twist[chosen]}
        return twists_for_torque(solve, aim, most=most, tolerance=accepted, **at)

    found = search(np.arange(len(goal)))
    for _ in range(SHARE_PASSES if shares_of else 0):
        assert shares_of is not None
        share = shares_of(found)
        aim = goal / (1 + share)
        with np.errstate(invalid="ignore"):
            off = (found.status == "converged") & (np.abs(found.torque_wheel - aim) > accepted * goal)
        again = np.flatnonzero(off)  # what was not reached is not asked for once more
        if len(again) == 0:
            break
        twist = newton_twist(found.twist, touching, found.torque_wheel, found.tangent, aim)
        more = search(again)
        found = found.replaced(again, replace(more, iterations=more.iterations + found.iterations[again]))
    if progress is not None:
        progress(len(goal), len(goal), "positions")
    return found, np.asarray(share)


def at_torque(
    solver: PositionSolver, angles: Array, torque: float, touching: Array, progress: Progress | None, *, finite: bool
) -> Positions:
    """Positions at pinion angles (rad), shape (n,), that carry `torque` (N m); with or without finite strain."""
    cycle, goal = solver.elastic.pitch_angle, np.full(len(angles), torque)
    sampled = sample_numbers(angles, cycle)

    def shares_of(found: Positions) -> Array:
        return interpolated_shares(
            angles, angles[sampled], finite_strain_shares(solver.elastic, found.take(sampled)), cycle
        )

    shares = shares_of if finite else None
    found = with_shares(*at_torques(solver, angles, goal, touching, shares, kept=sampled, progress=progress))
    return closed(found, goal, touching)


def closed(found: Positions, goal: Array, touching: Array) -> Positions:
    """Positions whose torques are nearly `goal` (N m), brought there by the last small step of their twists.

    Moments change with the torque, widths of contacts with its root.
    """
    good = found.status == "converged"
    factor = np.where(good, goal / np.where(good, found.torque_wheel, 1.0), 1.0)
    moments = {name: getattr(found, name) * factor for name in TORQUES if name != "tangent"}
    moments["torque_wheel"] = np.where(good, goal, found.torque_wheel)
    twist = newton_twist(found.twist, touching, found.torque_wheel, found.tangent, goal)
    contacts, of_contacts = found.contacts, factor[found.contacts.position]
    contacts = replace(
        contacts,
        torque_wheel=contacts.torque_wheel * of_contacts,
        half_width=contacts.half_width * np.sqrt(of_contacts),
    )
    return replace(found, twist=np.where(good, twist, found.twist), contacts=contacts, **moments)


def honest(found: Positions, touching: Array) -> Positions:
    """Mark positions without contact whose exact rigid flanks overlap, and take all numbers off failed ones.

    `touching` are the twists (rad), shape (n,), at which the rigid flanks touch.
    """
    overlap = (found.status == "no_contact") & (found.twist > touching + ANGLE_ROUNDING)
    return found.stated(np.where(overlap, "not_converged", found.status))


def load_shares(found: Positions) -> tuple[Array, Array]:
    """Number of the leading pair of each position, and the shares of it and of the pairs behind it."""
    contacts, count = found.contacts, len(found)
    carry = contacts.torque_wheel > 0
    position, pair = contacts.position[carry], contacts.pair[carry]
    leading = np.full(count, -np.inf)
    np.maximum.at(leading, position, pair)
    behind = leading[position].astype(np.int64) - pair
    shares = np.zeros((count, int(behind.max(initial=0)) + 1))
    np.add.at(shares, (position, behind), contacts.torque_wheel[carry] / found.torque_wheel[position])
    leading[np.isinf(leading)] = np.nan
    shares[np.isnan(found.torque_wheel)] = np.nan
    return leading, shares
