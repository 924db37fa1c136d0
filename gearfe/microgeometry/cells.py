r"""Positions of a pair with deviations at given torques: all cells of pinion angles and torques, side by side.

The twist of each cell is expected (`gearfe.contact.half_plane_twist`), and solved; where the torque is off by more than
`ACCEPTED`, again. With the approach :math:`\delta` since the first touch, the last step is one along the tangent of
:math:`\ln\delta` over :math:`\ln T`, whose error is of the order of `ACCEPTED` squared; forces move with their own
rates. Small strain: finite strain, which the stiffness curve adds, changes approaches by 0.1 to 0.2 per cent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..contact.half_plane import solve_half_plane
from ..contact.half_plane_result import PairContacts
from ..contact.half_plane_step import HalfPlanePair
from ..contact.half_plane_twist import expected_twists
from ..contact.records import joined, taken
from ..gear.touching import Touching

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Relative miss of the torque from which the tangent leads to it; most solutions of a cell, and failed ones among them.
ACCEPTED, TRIES, FAILURES = 1e-3, 25, 3
#: What a failed solution's approach is stretched by for the next one.
ASIDE = 1.003


@dataclass(frozen=True)
class Cells:
    """Solved cells, c of them.

    Attributes
    ----------
    twist, touch : ndarray, shape (c,)
        Twist of the wheel that carries the torque, and that at which the first rigid flanks touch (rad); from where a
        wheel space faces the pinion tooth.
    torque_pinion, tangent : ndarray, shape (c,)
        Torque at the pinion's hub (N m) and d torque/d twist (N m/rad).
    status : ndarray of str, shape (c,)
        ``converged``, or why there are no numbers: ``not_converged``, ``torque_not_reached``.
    contacts
        Loaded tooth pairs, `position` being the number of the cell; solved at `solved_twist`, forces and widths moved
        on to `twist`.
    solved_twist : ndarray, shape (c,)
        Twist of the last solution (rad).
    """

    twist: Array
    touch: Array
    torque_pinion: Array
    tangent: Array
    status: NDArray[np.str_]
    contacts: PairContacts
    solved_twist: Array


def of_positions(met: Touching, numbers: IntArray) -> Touching:
    """What `met` says of the positions `numbers`, which become 0, 1, ..."""
    first, end = (np.searchsorted(met.position, numbers, side=side) for side in ("left", "right"))
    counts = end - first
    position = np.repeat(np.arange(len(numbers)), counts)
    row = np.arange(len(position)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
    return replace(met.take(row), position=position)


def solve_cells(law: HalfPlanePair, angles: Array, torques: Array, touching: Touching) -> Cells:
    """Solve cells at pinion angles (rad) and torques (N m) at the wheel, both of shape (c,).

    Parameters
    ----------
    touching
        What `law.teeth.touching` says of these angles.
    """
    count = len(angles)
    touch = np.full(count, np.inf)
    np.minimum.at(touch, touching.position, touching.twist)
    twist = expected_twists(law, torques, touching)
    low, high = touch.copy(), np.full(count, np.inf)
    made = {name: np.full(count, np.nan) for name in ("twist", "torque_pinion", "tangent", "solved_twist")}
    status = np.full(count, "torque_not_reached", dtype="<U18")
    failures = np.zeros(count, dtype=np.int64)
    contacts: list[PairContacts] = []
    open_ = np.arange(count)
    for _ in range(TRIES):
        if len(open_) == 0:
            break
        found = solve_half_plane(law, angles[open_], twist[open_], touching=of_positions(touching, open_))
        solved = found.status == "converged"
        goal, T = torques[open_], np.where(solved, found.torque_wheel, np.nan)
        delta = twist[open_] - touch[open_]
        good = solved & (T > 0)
        ratio = np.divide(goal, T, out=np.ones(len(open_)), where=good)
        power = np.divide(T, found.tangent * delta, out=np.ones(len(open_)), where=good & (found.tangent * delta > 0))
        step = touch[open_] + delta * ratio**power
        near = good & (np.abs(T / goal - 1) <= ACCEPTED)
        done = open_[near]
        made["twist"][done], made["solved_twist"][done] = step[near], twist[done]
        made["torque_pinion"][done] = (found.torque_pinion * ratio)[near]
        made["tangent"][done], status[done] = found.tangent[near], "converged"
        rows = near[found.contacts.position]
        one = taken(found.contacts, np.flatnonzero(rows))
        contacts.append(_moved(replace(one, position=open_[one.position]), made["twist"] - made["solved_twist"]))
        # the interval that holds the goal
        little = (solved & (goal > T)) | (found.status == "no_contact")
        low[open_[little]] = np.maximum(low, twist)[open_[little]]
        much = open_[good & (goal <= T)]
        high[much] = np.minimum(high, twist)[much]
        failed = found.status == "not_converged"
        failures[open_[failed]] += 1
        status[open_[failed]] = "not_converged"
        step = np.where(failed, touch[open_] + ASIDE * delta, step)
        inside = (step > low[open_]) & (step < high[open_])
        halved = np.where(np.isfinite(high[open_]), 0.5 * (low + high)[open_], touch[open_] + 2 * np.abs(delta))
        twist[open_] = np.where(inside | failed, step, halved)
        open_ = open_[~near & (failures[open_] < FAILURES)]
    every = joined(contacts)
    order = np.lexsort((every.pair, every.position))
    return Cells(touch=touch, status=status, contacts=taken(every, order), **made)


def _moved(contacts: PairContacts, by: Array) -> PairContacts:
    """Forces and widths at twists (rad) further on by `by`, one entry a cell."""
    here = by[contacts.position]
    force = np.maximum(contacts.force + contacts.force_rate * here, 0.0)
    scale = np.divide(force, contacts.force, out=np.ones(len(force)), where=contacts.force > 0)
    width = contacts.half_width * np.exp(contacts.growth * here)
    return replace(
        contacts,
        force=force,
        torque_wheel=contacts.torque_wheel * scale,
        torque_pinion=contacts.torque_pinion * scale,
        half_width=width,
        hertz_pressure=contacts.hertz_pressure * scale * contacts.half_width / width,
    )
