r"""A load map computed: the twist at which each pinion angle carries each torque.

Each torque is a curve as `gearfe.stiffness.sweep` makes it; all cells are solved side by side.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..contact.compliance import MeshingPair
from ..contact.laws import DEFAULT_MODEL, PairModel
from ..contact.position import Positions, joined, together
from ..errors import InputError
from ..gear.pair import GearPair
from ..progress import Stopwatch, count, stage
from ..stiffness.job import Keep, StiffnessJob
from ..stiffness.positions import PositionSolver, at_torques, position_solver
from ..stiffness.sweep import assembled_curve, distinct_angles, elastic_pair, requested_angles
from ..tables.loadmap import LoadMapTable
from ..threads import one_thread
from ..typing import Array
from .load_map import LoadMap

if TYPE_CHECKING:
    from .root_stress import PairRoots, ToothRoots


#: Cells that are in memory together.
TOGETHER = 4000
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
        Also the tension at the tooth roots, on separate refined meshes, see `gearfe.loadmap.root_stress`.
    model, kinematics, elastic, changes
        See `gearfe.stiffness.sweep.sweep_stiffness`.

    Returns
    -------
    LoadMap
        With all cells; one that failed has its status and not-a-number.

    Raises
    ------
    InputError
        For torques or angles out of range.
    """
    requested, finite = requested_angles(pair, angles, ANGLES, kinematics)
    goals, watch = rising_torques(torques), Stopwatch()
    if elastic is None:
        elastic = elastic_pair(pair, model, watch=watch, **changes)
    solved_angles, source = distinct_angles(requested, pair.mesh_cycle)
    if len(goals) * len(solved_angles) > MOST_CELLS:
        problem = f"makes more than {MOST_CELLS} cells with {len(solved_angles)} angles"
        raise InputError("torques", len(goals), problem, "use fewer torques or angles")
    solver = position_solver(elastic)
    with watch.stage("unloaded flanks"):
        solver.touching(solved_angles)
    roots = None
    if root_stress:
        from .root_stress import pair_roots

        with watch.stage("root meshes"), one_thread():
            roots = pair_roots(elastic)
    with watch.stage("cells"), one_thread():
        found, at_roots = _cells(solver, solved_angles, goals, roots, finite=finite)
    n = len(solved_angles)
    levels = [found.take(slice(row * n, (row + 1) * n)) for row in range(len(goals))]
    curves = tuple(assembled_curve(solver, requested, source, level, searched=True) for level in levels)
    root = None
    if at_roots is not None:
        from .root_stress import root_map

        root = root_map(at_roots, (len(goals), n), source)
    return LoadMap(goals, curves, root, dict(watch.seconds))


def rising_torques(torques: ArrayLike) -> Array:
    """Torques at the wheel's hub (N m), each once and rising, shape (m,).

    Raises
    ------
    InputError
        For none, and for one that is not finite or not > 0.
    """
    made = np.unique(np.asarray(torques, dtype=float))
    if len(made) == 0 or not (np.isfinite(made).all() and made[0] > 0):
        raise InputError("torques", torques, "must be finite and > 0 N m", "give torques at the wheel's hub")
    return made


def job_map(job: StiffnessJob, table: LoadMapTable, *, keep: Keep | None = None) -> LoadMap:
    """The map of a job file: torques and angles of [loadmap], the model of [stiffness]; see `StiffnessJob.elastic`."""
    watch = Stopwatch()
    made = sweep_loads(
        job.pair,
        table.torques(),
        angles=np.arange(table.positions) * job.pair.mesh_cycle / table.positions,
        root_stress=table.root_stress,
        kinematics=job.table.kinematics,
        elastic=job.elastic(keep, watch),
    )
    return replace(made, timings={**watch.seconds, **made.timings})


def _cells(
    solver: PositionSolver,
    angles: Array,
    goals: Array,
    roots: PairRoots | None,
    *,
    finite: bool,
) -> tuple[Positions, ToothRoots | None]:
    """All cells of a map, torque by torque: their positions, and their root stresses where they are computed."""
    n, parts, at_roots = len(angles), [], []
    for rows in np.array_split(np.arange(len(goals)), max(1, math.ceil(len(goals) * n / TOGETHER))):
        torque = np.repeat(goals[rows], n)
        kept = np.arange(0 if roots is None else len(torque))
        count(int(rows[0]) * n, len(goals) * n, "cells")
        with stage("contacts"):
            found = at_torques(solver, np.tile(angles, len(rows)), torque, kept=kept, finite=finite)
        if roots is not None:
            made = roots.at(found)
            at_roots.append(replace(made, position=rows[0] * n + made.position))
        parts.append(found.with_loads(np.zeros(len(torque), dtype=bool)))
    return together(parts), joined(at_roots) if at_roots else None
