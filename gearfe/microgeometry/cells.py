r"""Positions of a pair with deviations at given torques: all cells of pinion angles and torques, side by side.

The twist of each cell is expected (`gearfe.contact.half_plane_start`) and searched for until the torque is off by no
more than `ACCEPTED`. The last step is Newton's of the search (`gearfe.stiffness.torque_control`), whose error is of the
order of that squared; forces and widths move with their own rates. Small strain: finite strain, which the stiffness
curve adds, changes approaches by 0.1 to 0.2 per cent.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..contact.half_plane import solve_half_plane
from ..contact.half_plane_result import PairContacts
from ..contact.half_plane_start import expected_twists
from ..contact.half_plane_step import HalfPlanePair
from ..contact.position import Positions, of_positions
from ..gear.touching import Touching
from ..stiffness.torque_control import newton_twist, twists_for_torque
from ..typing import Array, IntArray

#: Relative miss of the torque from which one step leads to it.
ACCEPTED = 1e-3


def solve_cells(law: HalfPlanePair, angles: Array, torques: Array, touching: Touching) -> Positions:
    """Positions at pinion angles (rad) that carry torques (N m) at the wheel, both of shape (n,).

    Parameters
    ----------
    touching
        What `law.teeth.touching` says of these angles.

    Returns
    -------
    Positions
        At the torques, without loads on nodes.
    """
    touch = np.full(len(angles), np.inf)
    np.minimum.at(touch, touching.position, touching.twist)

    def solve(numbers: IntArray, twists: Array) -> Positions:
        return solve_half_plane(law, angles[numbers], twists, touching=of_positions(touching, numbers))

    most = math.pi / law.pair.wheel.teeth
    first = expected_twists(law, torques, touching)
    found = twists_for_torque(solve, torques, touching=touch, first=first, most=most, tolerance=ACCEPTED)
    twist = newton_twist(found.twist, touch, found.torque_wheel, found.tangent, torques)
    contacts = found.contacts
    assert isinstance(contacts, PairContacts)
    ratio = torques / found.torque_wheel
    return replace(
        found,
        twist=twist,
        torque_wheel=np.where(found.status == "converged", torques, np.nan),
        torque_pinion=found.torque_pinion * ratio,
        torque_wheel_reaction=found.torque_wheel_reaction * ratio,
        contacts=_moved(contacts, twist - found.twist),
    )


def _moved(contacts: PairContacts, by: Array) -> PairContacts:
    """Forces and widths at twists (rad) further on by `by`, one entry a position."""
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
