r"""A load map computed: the twist at which each pinion angle carries each torque.

Each torque is a curve as `gearfe.gears.gearmesh.sweep` makes it; all cells are solved side by side.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.progress import Stopwatch, count, one_thread, stage
from ...base.tables.loadmap import LoadMapTable
from ...base.typing import Array, IntArray
from ..contact.compliance import MeshingPair
from ..contact.laws import DEFAULT_MODEL, PairModel
from ..contact.position import Positions, joined, taken, together
from ..geometry.face import ToothDeviations
from ..geometry.pair import GearPair
from .job import Keep, StiffnessJob
from .load_map import BACK, LoadMap
from .periodic import distinct_phases
from .positions import PositionSolver, at_torques, position_solver
from .root_stress import pair_roots, root_map
from .sweep import assembled_curve, elastic_pair, requested_angles

if TYPE_CHECKING:
    from ..contact.half_plane_pair import HalfPlanePair
    from .root_stress import PairRoots, ToothRoots


#: Cells that are in memory together.
TOGETHER = 512
#: Largest number of cells.
MOST_CELLS = 200_000
#: Angles over one mesh cycle where nothing else is said.
ANGLES = 18


def sweep_loads(
    pair: GearPair,
    torques: ArrayLike,
    model: PairModel = DEFAULT_MODEL,
    *,
    angles: ArrayLike | None = None,
    positions: int = ANGLES,
    mesh_cycles: int | None = None,
    root_stress: bool = False,
    back: tuple[ToothDeviations, ToothDeviations] | None = None,
    kinematics: Literal["small", "finite"] = "finite",
    elastic: MeshingPair | None = None,
    **changes: Any,
) -> LoadMap:
    """Compute stiffness, transmission error, load share, peak pressure and root stress over angle and torque.

    Parameters
    ----------
    pair : GearPair
        The gears.
    torques : array_like, shape (m,)
        Torques at the wheel's hub (N m), > 0.
    model, kinematics, elastic, changes
        See `gearfe.gears.gearmesh.sweep.sweep_stiffness`; teeth may differ (``deviations=(pinion, wheel)``).
    angles : array_like, shape (n,), optional
        Pinion angles (rad), instead of `positions`. Those after which all teeth meet again are solved once.
    positions, mesh_cycles
        Pinion angles in a mesh cycle, and how many cycles; None: one where the teeth of each gear are alike on both
        sides, else the full period, the least common multiple of the teeth.
    root_stress
        Also the tension at the tooth roots, on separate refined meshes, see `gearfe.gears.gearmesh.root_stress`.
    back
        Deviations of the back flanks of pinion and wheel, of the pair seen from the other side as
        `geometry.deviation_job.deviations_of` and, for displaced teeth, `geometry.pitch_errors.back_turns` give
        them, to know the room behind the teeth: positions without
        have the status `gearfe.gears.gearmesh.load_map.BACK` and no numbers.

    Returns
    -------
    LoadMap
        With all cells; one that failed has its status and not-a-number.

    Raises
    ------
    InputError
        For torques or angles out of range, and tooth pairs that carry nothing on their whole path.
    """
    goals, watch = rising_torques(torques), Stopwatch()
    if elastic is None:
        elastic = elastic_pair(pair, model, watch=watch, **changes)
    solver, cycles = position_solver(elastic), 0
    behind_model = None if back is None else solver.contact_model.deviated(back)
    period = max(model.mesh_cycles for model in (solver.contact_model, behind_model) if model is not None)
    if angles is None:
        cycles = period if mesh_cycles is None else mesh_cycles
        angles = np.arange(positions * cycles) * pair.mesh_cycle / positions
    requested, finite = requested_angles(pair, angles, ANGLES, kinematics)
    solved_angles, source = distinct_phases(requested, pair.mesh_cycle * period)
    if len(goals) * len(solved_angles) > MOST_CELLS:
        problem = f"makes more than {MOST_CELLS} cells with {len(solved_angles)} angles"
        raise InputError("torques", len(goals), problem, "use fewer torques or positions, or state mesh_cycles")
    with watch.stage("unloaded flanks"):
        solver.contact_model.first_contacts(solved_angles)
    roots = None
    if root_stress:
        with watch.stage("root meshes"), one_thread():
            roots = pair_roots(elastic)
    with watch.stage("cells"), one_thread():
        found, at_roots = _cells(solver, solved_angles, goals, roots, finite=finite)
    room = behind = None
    if behind_model is not None:
        behind, room = _room(solver, behind_model, solved_angles, found)
        found = found.with_status(np.where(room < 0.0, BACK, found.status))
        behind, room = behind[source], room.reshape(len(goals), -1)[:, source]
    n = len(solved_angles)
    levels = [found.take(slice(row * n, (row + 1) * n)) for row in range(len(goals))]
    made = [assembled_curve(solver, requested, source, level, searched=True) for level in levels]
    root = None
    if at_roots is not None:
        good = found.status[at_roots.position] != BACK
        root = root_map(taken(at_roots, good), (len(goals), n), source)
    curves, loads = (tuple(parts) for parts in zip(*made, strict=True))
    whole = LoadMap(goals, curves, root, loads, behind, room, cycles, pair, dict(watch.seconds))
    _check_contact(whole, solver)
    return whole


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
    """The map of a mesh of a job file: torques and angles of a table, its model, the deviations of its flanks."""
    watch = Stopwatch()
    made = sweep_loads(
        job.pair,
        table.torques(),
        positions=table.positions,
        mesh_cycles=table.mesh_cycles,
        root_stress=table.root_stress,
        back=job.back_deviations,
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
    n, size, parts, at_roots = len(angles), len(angles) * len(goals), [], []
    for numbers in np.array_split(np.arange(size), math.ceil(size / TOGETHER)):
        kept = np.arange(0 if roots is None else len(numbers))
        count(int(numbers[0]), size, "cells")
        with stage("contacts"):
            found = at_torques(solver, angles[numbers % n], goals[numbers // n], kept=kept, finite=finite)
        if roots is not None:
            made = roots.at(found)
            at_roots.append(replace(made, position=numbers[0] + made.position))
        found = replace(found, contacts=found.contacts.without_panels())
        parts.append(found.with_loads(np.zeros(len(numbers), dtype=bool)))
    return together(parts), joined(at_roots) if at_roots else None


def _room(solver: PositionSolver, behind_model: HalfPlanePair, angles: Array, found: Positions) -> tuple[Array, Array]:
    """Unloaded transmission error of the back flanks at all angles, shape (n,), and their clearance in all cells (m).

    Seen from the other side the pinion turns the other way.
    """
    pair, radius = solver.pair, solver.pair.wheel.base_radius
    behind = radius * (behind_model.first_contact_twists(-angles) - pair.contact_twist)
    error = radius * (found.twist - pair.contact_twist)
    room = pair.normal_backlash + np.tile(behind, len(found) // len(angles)) + error
    return behind, np.where(found.status == "converged", room, np.nan)


def _check_contact(made: LoadMap, solver: PositionSolver) -> None:
    """Raise `InputError` where a tooth pair carries nothing on its whole path: at the least torque, if at any."""
    cycles, period, geometry = made.mesh_cycles, solver.contact_model.mesh_cycles, solver.pair
    if not cycles or period == 1 or made.failed[0].any():
        return
    whole = cycles % period == 0
    start, end = (geometry.pinion_angle_at(s) / geometry.mesh_cycle for s in geometry.path_limits(rounded=True))
    # tooth pair k passes the path k mesh cycles earlier: those whose path lies within the angles
    expected = set(range(period) if whole else range(math.ceil(end) - cycles, math.floor(start) + 1))

    def number(k: IntArray) -> IntArray:
        return np.asarray(k % period if whole else k)

    lost = sorted(expected - set(number(made.pairs[0].pair).tolist()))
    if not lost:
        return
    curve, met = made.curves[0], solver.contact_model.first_contacts(made.pinion_angle)
    rows = np.flatnonzero(number(met.pair) == lost[0])
    position, twist = met.position[rows], met.twist[rows] - geometry.contact_twist
    gap = twist - curve.twist[position]  # of rigid flanks; loaded neighbours move a tooth away, too
    nearest = int(np.argmin(gap))
    tangent = curve.k_tangent[position[nearest]] * curve.base_radius**2
    k, least = lost[0], made.torque[0] + tangent * max(0.0, gap[nearest])
    problem = (
        f"{len(lost)} of {len(expected)} tooth pairs carry nothing on their whole path, among them pinion tooth "
        f"{k % geometry.pinion.teeth} on wheel tooth {(-1 - k) % geometry.wheel.teeth}: must be > about {least:.3g} N m"
    )
    cure = "give more torque, or smaller errors of pitch or profile"
    raise InputError("torques", float(made.torque[0]), problem, cure)
