"""A pair with its deviations solved over pinion angle and torque, in pieces whose memory stays small."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..contact.half_plane_result import PairContacts
from ..contact.half_plane_step import HalfPlanePair
from ..contact.position import Positions, joined, taken
from ..errors import InputError
from ..gear.deviation import ToothDeviations
from ..loadmap.root_stress import PairRoots
from ..loadmap.sweep import rising_torques
from ..progress import count, stage
from ..stiffness.contact_pressure import BLUNTING, reached_marks
from ..stiffness.positions import HalfPlaneSolver, at_torques, check_torque
from ..threads import one_thread
from ..typing import Array, BoolArray, IntArray
from .loaded_mesh import BACK, LoadedMesh, PairLoads, full_period

#: Cells solved at once, and most in all.
AT_ONCE, MOST_CELLS = 512, 1_000_000
#: What stays of a cell's position.
CELL = ("twist", "torque_pinion", "tangent", "status")


def load_mesh(
    law: HalfPlanePair,
    torques: ArrayLike,
    *,
    positions: int = 20,
    mesh_cycles: int | None = None,
    angles: ArrayLike | None = None,
    roots: PairRoots | None = None,
    back: tuple[ToothDeviations, ToothDeviations] | None = None,
) -> LoadedMesh:
    """Solve a pair with its deviations over pinion angle and torque.

    Parameters
    ----------
    law
        From `gearfe.contact.half_plane.half_plane_pair`, or its `deviated`.
    torques : array_like, shape (m,)
        At the wheel's hub (N m), > 0.
    positions
        Pinion angles in a mesh cycle.
    mesh_cycles
        How many cycles; None: one where all teeth of each gear are alike, else the full period.
    angles : array_like, shape (n,), optional
        Pinion angles (rad) instead.
    roots
        Of the same elastic gears (`gearfe.loadmap.root_stress.pair_roots`), for root stresses, too.
    back
        Deviations of the back flanks of pinion and wheel, of the pair seen from the other side as
        `gearfe.gear.deviation_job.deviations_of` gives them, to know the room behind the teeth: positions without
        have the status `gearfe.microgeometry.loaded_mesh.BACK` and no numbers.

    Raises
    ------
    InputError
        For torques out of range, too many cells, and tooth pairs that carry nothing on their whole path.
    """
    goals, pair = rising_torques(torques), law.pair
    check_torque(law, float(goals[-1]), "torques")
    place, cycles = _pinion_angles(law, positions, mesh_cycles, angles)
    if len(goals) * len(place) > MOST_CELLS:
        many = f"{len(goals) * len(place)} cells with {len(goals)} torques and {len(place)} angles"
        cure = "state a part of the period, fewer positions or torques"
        raise InputError("mesh_cycles", cycles, f"makes {many}: must be <= {MOST_CELLS}", cure)
    solver, lost = HalfPlaneSolver(law, None if roots is None else roots.pair), pair.contact_twist
    touch, behind = solver.touching_twists(place), None
    if back is not None:  # seen from the other side the pinion turns the other way
        behind = HalfPlaneSolver(law.deviated(back)).touching_twists(-place) - lost
    with one_thread():
        cells, loads, stress = _solve_cells(solver, law, place, goals, roots)
    cells["twist"], room = cells["twist"] - lost, None
    if behind is not None:
        room = pair.normal_backlash + pair.wheel.base_radius * (behind + cells["twist"])
        loads = _without_jammed(room < 0.0, cells, loads, stress)
    found = LoadedMesh(
        torque=goals,
        pinion_angle=place,
        mesh_cycles=cycles,
        twist_unloaded=touch - lost,
        twist_unloaded_back=behind,
        back_clearance=room,
        pairs=loads,
        root_stress=stress,
        pair=pair,
        **cells,
    )
    met = solver.touching(place)
    _check_contact(found, law, met.pair, met.position, met.twist - lost)
    return found


def _pinion_angles(
    law: HalfPlanePair, positions: int, mesh_cycles: int | None, angles: ArrayLike | None
) -> tuple[Array, int]:
    """Pinion angles (rad), and the mesh cycles that they divide into equal steps; 0 for given angles."""
    if angles is not None:
        return np.atleast_1d(np.asarray(angles, dtype=np.float64)), 0
    alike = all(one.alike for one in law.teeth.deviations)
    cycles = mesh_cycles if mesh_cycles is not None else 1 if alike else full_period(law.pair)
    return np.arange(positions * cycles) * (law.pair.mesh_cycle / positions), cycles


def _solve_cells(
    solver: HalfPlaneSolver,
    law: HalfPlanePair,
    place: Array,
    goals: Array,
    roots: PairRoots | None,
) -> tuple[dict[str, Array], PairLoads, Array | None]:
    """`CELL` of all torques and angles, shape (m, n), their loaded tooth pairs, and root stresses, shape (m, n, 2)."""
    n, size = len(place), len(goals) * len(place)
    stress = None if roots is None else np.full((size, 2), np.nan)
    cells: list[dict[str, Array]] = []
    pairs: list[PairLoads] = []
    for start in range(0, size, AT_ONCE):
        count(start, size, "cells")
        numbers = np.arange(start, min(start + AT_ONCE, size))
        angle, goal = numbers % n, goals[numbers // n]
        with stage("contacts"):
            made = at_torques(solver, place[angle], goal, kept=np.arange(0 if roots is None else len(goal)))
        if stress is not None and roots is not None:
            stress[numbers] = _root_stress(made, roots)
        pairs.append(_pair_loads(law, made, numbers, n))
        cells.append({name: getattr(made, name) for name in CELL})  # not the panels of the contacts
    shape = (len(goals), n)
    whole = {name: np.concatenate([one[name] for one in cells]).reshape(shape) for name in CELL}
    return whole, joined(pairs), None if stress is None else stress.reshape(*shape, 2)


def _without_jammed(jammed: BoolArray, cells: dict[str, Array], loads: PairLoads, stress: Array | None) -> PairLoads:
    """Mark the cells whose back flanks would bear, which lose their numbers; the loaded pairs of the others."""
    cells["status"] = np.where(jammed, BACK, cells["status"])
    for name in ("twist", "torque_pinion", "tangent"):
        cells[name] = np.where(jammed, np.nan, cells[name])
    if stress is not None:
        stress[jammed] = np.nan
    return taken(loads, np.flatnonzero(~jammed[loads.torque, loads.angle]))


def _pair_loads(law: HalfPlanePair, made: Positions, numbers: IntArray, n: int) -> PairLoads:
    own = made.contacts
    assert isinstance(own, PairContacts)
    own = taken(own, np.flatnonzero(own.force > 0))
    cell = numbers[own.position]
    force, width = own.force, law.width
    mark = reached_marks(law, own)
    blunting = np.where(mark != "", BLUNTING * law.pair.pinion.module, 0.0)
    flank = law.teeth.flank(own.pair)
    roll = np.full((len(own), 2), np.nan)
    for i, curve in enumerate(law.curves):
        u = np.where(flank == i, curve.parameter_at(own.arc), np.nan)
        rows = (u >= 0) & (u <= 1)
        roll[rows] = curve.face.flank.roll(u[rows])
    total = np.bincount(own.position, own.torque_wheel, len(numbers))
    return PairLoads(
        torque=cell // n,
        angle=cell % n,
        pair=own.pair,
        force=force,
        share=own.torque_wheel / total[own.position],
        roll=roll,
        half_width=own.half_width,
        pressure=2 * force / (math.pi * width * np.hypot(own.half_width, blunting)),
        mark=mark,
    )


def _root_stress(made: Positions, roots: PairRoots) -> Array:
    """Largest tension (Pa) at the roots of pinion and wheel, shape (c, 2)."""
    found = roots.at(made)
    stress = np.full((len(made), 2), -np.inf)
    np.maximum.at(stress, found.position, found.stress)
    return np.where(np.isfinite(stress), stress, np.nan)


def _check_contact(made: LoadedMesh, law: HalfPlanePair, pair: IntArray, position: IntArray, twist: Array) -> None:
    """Raise `InputError` where a tooth pair carries nothing on its whole path: at the least torque, if at any."""
    cycles, geometry = made.mesh_cycles, made.pair
    if not cycles:
        return
    start, end = (geometry.pinion_angle_at(s) for s in geometry.path_limits(rounded=True))
    whole = cycles % full_period(geometry) == 0 or all(one.alike for one in law.teeth.deviations)
    if whole:
        expected = set(range(cycles))
    else:  # tooth pair k passes the path k mesh cycles earlier: those whose path lies within the angles
        first, last = (angle / geometry.mesh_cycle for angle in (start, end))
        expected = set(range(math.ceil(last) - cycles, math.floor(first) + 1))
    if not expected or made.failed[0].any():
        return

    def number(k: IntArray) -> IntArray:
        return np.asarray(k % cycles if whole else k)

    loaded = set(number(made.pairs.pair[made.pairs.torque == 0]).tolist())
    lost = sorted(expected - loaded)
    if not lost:
        return
    rows = number(pair) == lost[0]
    gap = twist[rows] - made.twist[0, position[rows]]  # of rigid flanks; loaded neighbours move a tooth away, too
    nearest = int(np.argmin(gap))
    more = made.tangent[0, position[rows][nearest]] * max(0.0, gap[nearest])
    k = lost[0]
    problem = (
        f"{len(lost)} of {len(expected)} tooth pairs carry nothing on their whole path, among them pinion tooth "
        f"{k % geometry.pinion.teeth} on wheel tooth {(-1 - k) % geometry.wheel.teeth}: must be > about "
        f"{made.torque[0] + more:.3g} N m"
    )
    raise InputError(
        "torques", float(made.torque[0]), problem, "give more torque, or smaller errors of pitch or profile"
    )
