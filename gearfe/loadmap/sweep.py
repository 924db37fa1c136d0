r"""A load map computed: the twist at which each pinion angle carries each torque.

All cells of a few torques are solved side by side, then all others, whose twists are predicted from these (as in
`gearfe.loadmap.load_map`: cubic in :math:`\ln\delta` over :math:`\ln T`). A cell is accepted when its torque lies
within :math:`\epsilon` = 3e-4 of the goal; the twist then takes one step along the tangent of :math:`\ln\delta` over
:math:`\ln T`, whose error is a few hundredths of :math:`\epsilon^2`, and what else there is moves with the torque
(forces as T, pressures as :math:`\sqrt T`).

Finite strain changes the torque by a share c. The energy that it adds is spent pair by pair, each with about the power
:math:`2 + p` of its load, so that with the pairs' shares :math:`s_k` of the torque

.. math:: c = \kappa\, T^p \sum_k s_k^{1+p}, \qquad p = 0.75,

where :math:`\kappa` hardly depends on torque and angle, also where pairs come and go (c itself varies fivefold over a
map and jumps there). It is evaluated at the torques that are solved first and interpolated, and directly in the cells
where c may be off by more than 5e-5.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..contact.compliance import MeshingPair
from ..contact.finite_strain import with_shares
from ..contact.model import DEFAULT_MODEL, PairModel
from ..contact.position import Positions, joined, together
from ..errors import InputError
from ..gear.pair import GearPair
from ..stiffness.positions import (
    PositionSolver,
    Progress,
    TorqueGoals,
    at_torques,
    checked_contact,
    closed,
    position_solver,
    standard_stiffness,
)
from ..stiffness.sweep import asked_positions, assembled_curve, distinct_angles, elastic_pair
from ..stopwatch import Stopwatch
from ..threads import one_thread
from ..typing import Array, IntArray
from .cells import StrainShares, predicted
from .load_map import LoadMap

if TYPE_CHECKING:
    from .root_stress import PairRoots, ToothRoots


#: Relative miss of the torque at which a cell is accepted.
ACCEPTED = 3e-4
#: Torques that are solved first, and cells that are in memory together from then on.
LEVELS, TOGETHER = 5, 4000
#: Largest number of cells.
MOST_CELLS = 200_000
#: Angles over one mesh cycle where none are given.
ANGLES = 18


def sweep_loads(
    pair: GearPair,
    torques: ArrayLike,
    model: PairModel = DEFAULT_MODEL,
    *,
    angles: ArrayLike | None = None,
    root_stress: bool = False,
    kinematics: Literal["small", "finite"] = "finite",
    elastic: MeshingPair | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> LoadMap:
    """Stiffness, transmission error, load share, peak pressure and root stress over pinion angle and torque.

    Parameters
    ----------
    torques : array_like, shape (m,)
        Torques at the wheel's hub (N m), > 0.
    angles : array_like, shape (n,), optional
        Pinion angles (rad); without them, 18 over one mesh cycle. Positions that differ by whole mesh cycles are
        solved once.
    root_stress
        Also the tension at the tooth roots, on refined meshes of its own, see `gearfe.loadmap.root_stress`.
    model, kinematics, elastic, progress, changes
        See `gearfe.stiffness.sweep.sweep_stiffness`.

    Returns
    -------
    LoadMap
        With every cell asked for; one that failed has its status and not-a-number.

    Raises
    ------
    InputError
        For torques or angles out of range.
    """
    asked, finite = asked_positions(pair, angles, ANGLES, kinematics)
    goals = np.unique(np.atleast_1d(np.asarray(torques, dtype=float)))
    if goals.ndim != 1 or len(goals) == 0 or not (np.isfinite(goals).all() and goals[0] > 0):
        raise InputError("torques", torques, "must be finite and > 0 N m", "give torques at the wheel's hub")
    watch = Stopwatch()
    if elastic is None:
        elastic = elastic_pair(pair, model, watch=watch, **changes)
    solved_angles, source = distinct_angles(asked, pair.mesh_cycle)
    if len(goals) * len(solved_angles) > MOST_CELLS:
        problem = f"makes more than {MOST_CELLS} cells with {len(solved_angles)} angles"
        raise InputError("torques", len(goals), problem, "use fewer torques or angles")
    solver = position_solver(pair, elastic)
    with watch.stage("unloaded flanks"):
        touching = solver.touching_twists(solved_angles)
    roots = None
    if root_stress:
        from .root_stress import pair_roots

        with watch.stage("root meshes"), one_thread():
            roots = pair_roots(pair, elastic)
    with watch.stage("cells"), one_thread():
        found, at_roots = _cells(solver, solved_angles, goals, touching, roots, progress, finite=finite)
    n = len(solved_angles)
    levels = [found.take(slice(row * n, (row + 1) * n)) for row in range(len(goals))]
    curves = tuple(
        assembled_curve(solver, asked, source, checked_contact(level, touching), touching, searched=True)
        for level in levels
    )
    root = None
    if at_roots is not None:
        from .root_stress import root_map

        root = root_map(at_roots, (len(goals), n), source)
    return LoadMap(goals, curves, root, dict(watch.seconds))


def _cells(
    solver: PositionSolver,
    angles: Array,
    goals: Array,
    touching: Array,
    roots: PairRoots | None,
    progress: Progress | None,
    *,
    finite: bool,
) -> tuple[Positions, ToothRoots | None]:
    """All cells of a map, torque by torque: their positions, and their root stresses where these are asked for."""
    n, torque = len(angles), np.repeat(goals, len(angles))
    angle, touch = np.tile(angles, len(goals)), np.tile(touching, len(goals))
    known = np.unique(np.linspace(0, len(goals) - 1, LEVELS).round().astype(np.int64))
    rest = np.setdiff1d(np.arange(len(goals)), known)
    groups = [known, *np.array_split(rest, max(1, math.ceil(len(rest) * n / TOGETHER)))]
    strain = StrainShares(solver.elastic, angles, goals, known) if finite else None
    usual = touch + torque / standard_stiffness(solver)
    parts: list[Positions] = []
    at_roots: list[ToothRoots] = []
    order: list[IntArray] = []
    for rows in groups if len(rest) else [known]:
        cells = (rows[:, None] * n + np.arange(n)).ravel()
        ahead: dict[str, Any] = {}
        if rows is not known:
            twist, carried = predicted(parts[0], goals[known], touching, goals[rows])
            expected = 0.0 if strain is None else strain.expected(rows, carried)
            ahead["start"] = np.where(np.isfinite(twist), twist, usual[cells]), expected
        shares_of = None if strain is None else partial(strain.at, rows)
        ahead |= {"kept": np.arange(len(cells)), "tolerance": ACCEPTED}
        own = TorqueGoals(angle[cells], torque[cells], touch[cells])
        found, share = at_torques(solver, own, shares_of, **ahead)
        if roots is not None:
            made = roots.at(found)
            factor = own.torque[made.position] / found.torque_wheel[made.position]
            at_roots.append(replace(made, position=cells[made.position], stress=made.stress * factor[:, None]))
        found = closed(with_shares(found, share), own)
        parts.append(found.with_loads(np.zeros(len(cells), dtype=bool)))
        order.append(cells)
        if progress is not None:
            progress(sum(len(part) for part in order), len(torque), "cells")
    whole = together(parts).take(np.argsort(np.concatenate(order)))
    return whole, joined(at_roots) if at_roots else None
