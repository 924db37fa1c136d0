r"""Positions that carry torques: all cells of pinion angles and torques, side by side, of load maps and loaded meshes.

The twist of each cell is expected (`gearfe.contact.half_plane_start`) and searched for until the torque is off by no
more than the solver's `nearly`. The last step is Newton's of the search (`gearfe.stiffness.torque_control`), whose
error is some hundredths of the square of the step; forces and widths move with their own rates.

Finite strain changes the torque by a share c, some thousandths, which is known at a few angles of each torque. At the
goal T of the whole, small strain carries T/(1 + c'); c grows like a power p of the load, so :math:`c' = c\,(1 - p\,c)`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..contact.finite_strain import finite_strain_shares, interpolated_shares, sample_numbers, with_shares
from ..contact.position import Positions
from ..stiffness.positions import NONE, PositionSolver, TorqueGoals, at_torques, closed, moved_to
from ..typing import Array, IntArray

#: p above.
SHARE_POWER = 0.75
#: Angles at which the share of finite strain is evaluated at a torque.
SHARE_ANGLES = 24


def solve_cells(solver: PositionSolver, goals: TorqueGoals, kept: IntArray = NONE, *, strain: int = 0) -> Positions:
    """Cells at their torques; those numbered `kept` with loads.

    Parameters
    ----------
    strain
        Number of angles, the same at every torque, if finite strain counts; all cells have loads then.
    """
    kept = np.arange(len(goals.angle)) if strain else kept
    found = at_torques(solver, goals, kept=kept, tolerance=solver.nearly)
    if not strain:
        return closed(found, goals)
    angles, cycle = goals.angle[:strain], solver.pair.mesh_cycle
    sampled = sample_numbers(angles, cycle, SHARE_ANGLES)
    known = (np.arange(0, len(found), strain)[:, None] + sampled).ravel()
    shares = finite_strain_shares(solver.elastic, found.take(known)).reshape(-1, len(sampled))
    share: Array = np.concatenate([interpolated_shares(angles, angles[sampled], one, cycle) for one in shares])
    share *= 1 - SHARE_POWER * share
    more = moved_to(
        solver, found, replace(goals, torque=goals.torque / (1 + share)), kept=kept, tolerance=solver.nearly
    )
    return closed(with_shares(found if more is None else more, share), goals)
