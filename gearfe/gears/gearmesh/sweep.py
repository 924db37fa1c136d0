r"""The sweep of a gear pair over pinion angle and load: a stiffness curve is a map with one load.

Conventions: the pinion centre is at the origin, the wheel at +x. At pinion angle 0 a pinion tooth is on the line of
centres and faces a wheel space. Angles are counter-clockwise. Wheel angle = -pinion angle z1/z2 + lost motion + twist.
The lost motion is half the backlash: it brings unmodified driving flanks to touch, and a positive twist presses them
together.

All cells, angle by load, are solved side by side in `Grid.solve`, at given twists or at the twists that carry given
torques. Angles after which the same teeth meet again are solved once.

    >>> curve = sweep_stiffness(pair, twist=math.radians(0.05))   # one mesh cycle in 20 positions
    >>> k, slope = curve.interpolate(math.radians(7.3))           # N/m and N/(m rad)
    >>> load_map = sweep_loads(pair, [25.0, 50.0, 100.0])         # N m; one mesh cycle in 18 positions
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.progress import Stopwatch, one_thread, stage
from ...base.typing import Array, IntArray
from ..contact.compliance import MeshingPair, gear_body, stored_gear_body
from ..contact.half_plane_pair import HalfPlanePair
from ..contact.laws import COARSENING, DEFAULT_MODEL, PairModel, check_alike, check_torque, law_text, uses_stress
from ..contact.position import Positions, in_batches, joined, taken
from ..geometry.face import ToothDeviations
from ..geometry.pair import GearPair
from ..geometry.validity import MOST_OVERLAP, check_spur, overlaps
from ..teeth.tooth_sector import sector_mesh, sector_recipes
from .curve import BACK, SOLVED, StiffnessCurve
from .load_map import LoadMap
from .pair_loads import PairLoads, conforms, contact_pressures, pair_loads
from .periodic import distinct_phases
from .positions import PositionSolver, at_torques, at_twists, checked_contact, curve_error, load_shares, position_solver
from .root_stress import PairRoots, ToothRoots, pair_roots, root_map

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["StiffnessCurve", "elastic_pair", "sweep_loads", "sweep_stiffness"]


#: Positions in one mesh cycle where no angles are given: of a curve, and of a map.
ANGLES, MAP_ANGLES = 20, 18
#: Positions that are in memory together with their loads and panels.
TOGETHER = 512
#: Largest number of cells of a map.
MOST_CELLS = 200_000


def elastic_pair(
    pair: GearPair,
    model: PairModel = DEFAULT_MODEL,
    *,
    watch: Stopwatch | None = None,
    store: bool = False,
    **changes: Any,
) -> MeshingPair:
    """Mesh both gears (or read their meshes from the cache) and condense them to their flanks.

    Parameters
    ----------
    pair : GearPair
        The gears.
    model
        Materials, contact law, element sizes.
    watch
        Takes the time of the stages.
    store
        Whether the cache keeps the condensed gears, too: some 20 MB each.
    changes
        Fields of the model to change, such as ``law="nitsche"``; see `PairModel.changed`.
    """
    check_spur(pair, "the law of plane sections")
    model = model.changed(**changes)
    watch = watch or Stopwatch()
    gears = (pair.pinion, pair.wheel)
    with watch.stage("meshes"):
        recipes = sector_recipes(pair, coarsen=model.coarsen, flank_coarsen=model.mesh_flank_coarsen)
        meshes = [sector_mesh(gear, recipe) for gear, recipe in zip(gears, recipes, strict=True)]
    width = min(gear.face_width for gear in gears)
    options: dict[str, Any] = {"points_per_edge": model.points_per_edge, "with_stress": uses_stress(model.law)}
    condense = stored_gear_body if store else gear_body
    with watch.stage("condensation"), one_thread():
        one, two = (
            condense(mesh, material, model.plane, gear.face_width, width=width, **options)
            for mesh, material, gear in zip(meshes, model.materials, gears, strict=True)
        )
    return MeshingPair(pair, one, two, model)


def coarser(elastic: MeshingPair, *, store: bool = False) -> MeshingPair:
    """The same gears on meshes `COARSENING` times coarser; `store`: see `elastic_pair`."""
    return elastic_pair(elastic.gears, elastic.model, store=store, coarsen=COARSENING * elastic.model.coarsen)


def sweep_stiffness(
    pair: GearPair,
    model: PairModel = DEFAULT_MODEL,
    *,
    twist: float | None = None,
    torque: float | None = None,
    angles: ArrayLike | None = None,
    kinematics: Literal["small", "finite"] = "finite",
    twist_from: Literal["contact", "centred"] = "contact",
    solve_all: bool = False,
    estimate_error: bool = False,
    elastic: MeshingPair | None = None,
    store: bool = False,
    **changes: Any,
) -> StiffnessCurve:
    """Compute the mesh stiffness over the rotation of the pinion, at a given twist or a given torque.

    Parameters
    ----------
    pair : GearPair
        The gears.
    model, changes
        Model of the pair, and fields of it to change, such as ``law="nitsche"``; see `elastic_pair`.
    twist
        Twist of the wheel (rad), > 0, counted as `twist_from` says.
    torque
        Torque at the wheel's hub (N m), > 0, instead of `twist`.
    angles : array_like, shape (n,), optional
        Pinion angles (rad); without them, 20 over one mesh cycle. Positions that differ by whole mesh cycles are
        solved once.
    kinematics
        ``small``: small strain in each hub's frame; ``finite`` (default) adds the first-order effect of finite strain
        on the torque, see `gearfe.gears.contact.compliance.finite_strain_shares`.
    twist_from
        Where the given `twist` counts from: ``contact``, where unmodified flanks touch; ``centred``, where a wheel
        space faces the pinion tooth, half the backlash before. Results count from contact in either case.
    solve_all
        Solve every position, also those that differ by whole mesh cycles.
    estimate_error
        Estimate the discretisation error from coarser meshes.
    elastic
        Result of an earlier `elastic_pair`, which replaces `model`.
    store
        Whether the cache keeps the condensed gears of the estimate, too, and of the curve; see `elastic_pair`.

    Returns
    -------
    StiffnessCurve
        With every position asked for; a position that failed has its status and NaN.

    Raises
    ------
    InputError
        For neither or both of twist and torque, or values out of range.
    """
    load, finite = _checked_load(pair, twist, torque, twist_from), _finite(kinematics)
    requested, watch = _requested(pair, angles, ANGLES), Stopwatch()
    if elastic is None:
        elastic = elastic_pair(pair, model, watch=watch, store=store, **changes)
    check_alike(elastic.deviations)
    if torque is not None:
        check_torque(pair, elastic.model, load)
    grid = Grid.over(
        position_solver(elastic), requested, [load], by_torque=torque is not None, finite=finite, solve_all=solve_all
    )
    solved, _ = grid.solve(watch)
    curve, _ = grid.cells(solved)
    if estimate_error:
        with watch.stage("error estimate"), one_thread():
            error, correction = curve_error(grid.solver, coarser(elastic, store=store), solved, finite=finite)
        curve = replace(curve, relative_error=error[grid.source], correction=correction[grid.source])
    return replace(curve, timings=dict(watch.seconds))


def sweep_loads(
    pair: GearPair,
    torques: ArrayLike,
    model: PairModel = DEFAULT_MODEL,
    *,
    angles: ArrayLike | None = None,
    positions: int = MAP_ANGLES,
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
        See `sweep_stiffness`; teeth may differ (``deviations=(pinion, wheel)``).
    angles : array_like, shape (n,), optional
        Pinion angles (rad), instead of `positions`. Angles that differ by the full period are solved once.
    positions, mesh_cycles
        Pinion angles in a mesh cycle, and how many cycles. None: one cycle where the teeth of each gear are alike on
        both sides, else the full period, the least common multiple of the teeth.
    root_stress
        Also the tension at the tooth roots, on separate refined meshes, see `gearfe.gears.gearmesh.root_stress`.
    back
        Deviations of the back flanks of pinion and wheel, of the pair seen from the other side. They are given by
        `geometry.deviation_job.deviations_of` and, for displaced teeth, by `geometry.pitch_errors.back_turns`. They
        tell whether the back flanks would touch: such positions have the status `gearfe.gears.gearmesh.curve.BACK` and
        no numbers.

    Returns
    -------
    LoadMap
        With all cells; one that failed has its status and NaN.

    Raises
    ------
    InputError
        For torques or angles out of range, and tooth pairs that carry nothing on their whole path.
    """
    goals, finite, watch = rising_torques(torques), _finite(kinematics), Stopwatch()
    if elastic is None:
        elastic = elastic_pair(pair, model, watch=watch, **changes)
    solver, cycles = position_solver(elastic), 0
    behind_model = None if back is None else solver.contact_model.deviated(back)
    period = max(model.mesh_cycles for model in (solver.contact_model, behind_model) if model is not None)
    if angles is None:
        cycles = period if mesh_cycles is None else mesh_cycles
    requested = _requested(pair, angles, positions, cycles)
    grid = Grid.over(solver, requested, goals, by_torque=True, finite=finite, period=period)
    if len(goals) * len(grid.angles) > MOST_CELLS:
        problem = f"makes more than {MOST_CELLS} cells with {len(grid.angles)} angles"
        raise InputError("torques", len(goals), problem, "use fewer torques or positions, or state mesh_cycles")
    roots = None
    if root_stress:
        with watch.stage("root meshes"), one_thread():
            roots = pair_roots(elastic)
    solved, at_roots = grid.solve(watch, roots)
    clearance = error_behind = None
    if behind_model is not None:
        error_behind, clearance = _back_flanks(grid, behind_model, solved)
        solved = solved.with_status(np.where(clearance < 0.0, BACK, solved.status))
        error_behind, clearance = error_behind[grid.source], clearance.reshape(grid.shape)[:, grid.source]
    root = None
    if at_roots is not None:
        good = solved.status[at_roots.position] != BACK
        root = root_map(taken(at_roots, good), grid.shape, grid.source)
    cells, loads = grid.cells(solved)
    load_map = LoadMap(goals, cells, root, loads, error_behind, clearance, cycles, pair, dict(watch.seconds))
    _check_contact(load_map, solver)
    return load_map


def rising_torques(torques: ArrayLike) -> Array:
    """Return torques at the wheel's hub (N m), each once and rising, shape (m,).

    Raises
    ------
    InputError
        For none, and for one that is not finite or not > 0.
    """
    rising = np.unique(np.asarray(torques, dtype=float))
    if len(rising) == 0 or not (np.isfinite(rising).all() and rising[0] > 0):
        raise InputError("torques", torques, "must be finite and > 0 N m", "give torques at the wheel's hub")
    return rising


def _requested(pair: GearPair, angles: ArrayLike | None, positions: int, cycles: int = 1) -> Array:
    """Return the pinion angles asked for (rad), shape (n,), or so many `positions` in each of the mesh `cycles`.

    Raises
    ------
    InputError
        For angles that are no list of finite numbers.
    """
    if angles is None:
        angles = np.arange(positions * cycles) * pair.mesh_cycle / positions
    requested = np.atleast_1d(np.asarray(angles, float))
    if requested.ndim != 1 or len(requested) == 0 or not np.isfinite(requested).all():
        raise InputError("angles", angles, "must be a list of finite angles (rad)", "give at least one angle")
    return requested


def _finite(kinematics: str) -> bool:
    """Return whether finite strain counts; raise `InputError` for other kinematics."""
    if kinematics not in ("small", "finite"):
        raise InputError("kinematics", kinematics, "must be small or finite")
    return kinematics == "finite"


def _checked_load(pair: GearPair, twist: float | None, torque: float | None, twist_from: str) -> float:
    """Return the twist from the centred position (rad), or torque."""
    if twist_from not in ("contact", "centred"):
        raise InputError("twist_from", twist_from, "must be contact or centred")
    lost = pair.contact_twist if twist_from == "contact" else 0.0
    if twist is not None and torque is not None:
        raise InputError("twist, torque", None, "both are given", "give exactly one of them")
    if torque is not None:
        if not (math.isfinite(torque) and torque > 0):
            raise InputError("torque", torque, "must be finite and > 0 N m", "give the torque at the wheel's hub")
        return float(torque)
    if twist is None:
        raise InputError("twist, torque", None, "neither is given", "give exactly one of them")
    most = math.pi / pair.wheel.tooth_count - lost
    if not (math.isfinite(twist) and 0 < twist < most):
        problem = f"must be > 0 and < {most:.6g} rad ({math.degrees(most):.6g} deg, half a pitch of the wheel)"
        raise InputError("twist", twist, problem, "0.01 to 0.5 deg is usual")
    return float(twist) + lost


@dataclass(frozen=True)
class Grid:
    """Cells of a sweep: m loads at n pinion angles, load by load.

    Attributes
    ----------
    solver : PositionSolver
        The gears.
    requested : ndarray, shape (n,)
        Pinion angles asked for (rad).
    angles : ndarray, shape (s,)
        Pinion angles that are solved (rad).
    source : ndarray of int, shape (n,)
        Number of the solved angle of each of those asked for.
    loads : ndarray, shape (m,)
        Twists from the centred position (rad), or torques at the wheel (N m).
    by_torque, finite
        Whether loads are torques, and whether these have the effect of finite strain.
    """

    solver: PositionSolver
    requested: Array
    angles: Array
    source: IntArray
    loads: Array
    by_torque: bool
    finite: bool

    @classmethod
    def over(
        cls,
        solver: PositionSolver,
        requested: Array,
        loads: Sequence[float] | Array,
        *,
        by_torque: bool,
        finite: bool,
        period: int = 1,
        solve_all: bool = False,
    ) -> Grid:
        """Return the grid over angles and loads.

        Parameters
        ----------
        solver : PositionSolver
            The gears.
        requested : ndarray, shape (n,)
            Pinion angles asked for (rad).
        loads : array_like, shape (m,)
            Twists from the centred position (rad), or torques at the wheel (N m).
        by_torque, finite
            See `Grid`.
        period
            Mesh cycles after which angles repeat.
        solve_all
            Solve also angles that repeat.
        """
        angles, source = requested, np.arange(len(requested))
        if not solve_all:
            angles, source = distinct_phases(requested, solver.pair.mesh_cycle * period)
        return cls(solver, requested, angles, source, np.asarray(loads, dtype=float), by_torque, finite)

    @property
    def shape(self) -> tuple[int, int]:
        """Loads and solved angles."""
        return len(self.loads), len(self.angles)

    def solve(self, watch: Stopwatch, roots: PairRoots | None = None) -> tuple[Positions, ToothRoots | None]:
        """Solve all cells, without loads and panels in the result; with `roots` also their root stresses."""
        solver, n = self.solver, len(self.angles)
        at_load = at_torques if self.by_torque else at_twists
        at_roots: list[ToothRoots] = []

        def solve(cells: IntArray) -> Positions:
            kept = np.arange(0 if roots is None else len(cells))
            with stage("contacts"):
                solved = at_load(solver, self.angles[cells % n], self.loads[cells // n], kept=kept, finite=self.finite)
            if roots is not None:
                of_batch = roots.at(solved)
                at_roots.append(replace(of_batch, position=cells[0] + of_batch.position))
            return solved.without_loads()

        with watch.stage("unloaded flanks"):
            solver.contact_model.first_contacts(self.angles)
        with watch.stage("positions"), one_thread():
            solved = in_batches(solve, len(self.loads) * n, TOGETHER)
        return checked_contact(solver, solved), joined(at_roots) if at_roots else None

    def cells(self, solved: Positions) -> tuple[StiffnessCurve, PairLoads]:
        """Return the solved cells at all angles asked for, load by load, and their loaded tooth pairs."""
        solver, pair, law = self.solver, self.solver.pair, self.solver.elastic.law
        loads, radius, lost = len(self.loads), pair.wheel.base_radius, pair.contact_twist
        solved = solved.take((len(self.angles) * np.arange(loads)[:, None] + self.source).ravel())
        requested = np.tile(self.requested, loads)
        failed = ~np.isin(solved.status, SOLVED)
        total = np.where(failed & self.by_torque, np.nan, solved.twist)
        twist, torque = total - lost, solved.torque_wheel
        deflection = total - solver.contact_model.first_contact_twist(self.angles)
        stiffness = np.divide(torque, deflection, out=np.zeros_like(torque), where=torque != 0.0)  # NaN stays
        unloaded = solver.contact_model.first_contact_twists(solved.pinion_angle)
        cycles = np.round((requested - solved.pinion_angle) / pair.mesh_cycle).astype(np.int64)
        leading, shares = load_shares(solved)
        of_pairs = pair_loads(solver, solved)
        conforming = conforms(of_pairs, len(solved)) if pair.internal else np.zeros(len(solved), dtype=bool)
        curve = StiffnessCurve(
            pinion_angle=requested,
            wheel_angle=pair.wheel_angle_at(requested, total),
            twist=twist,
            torque_wheel=torque,
            torque_pinion=solved.torque_pinion,
            torque_wheel_reaction=solved.torque_wheel_reaction,
            k_torsional=stiffness,
            k_mesh=stiffness / radius**2,
            k_tangent=solved.tangent / radius**2,
            transmission_error=twist * radius,
            transmission_error_unloaded=(unloaded - lost) * radius,
            leading_pair=leading - cycles,
            load_share=shares,
            teeth_in_contact=np.where(failed, -1, (shares > 0).sum(axis=1)),
            iterations=solved.iterations,
            status=solved.status,
            law=np.full(len(requested), law.name),
            contact_law=law_text(law),
            beyond_validity=np.where(np.isnan(twist), -1, (overlaps(pair, twist) > MOST_OVERLAP) | conforming),
            mesh_cycle=pair.mesh_cycle * solver.contact_model.mesh_cycles,
            base_radius=radius,
            lost_motion=lost,
            **contact_pressures(solved, of_pairs),
        )
        return curve, replace(of_pairs, pair=of_pairs.pair - cycles[of_pairs.position])


def _back_flanks(grid: Grid, behind_model: HalfPlanePair, solved: Positions) -> tuple[Array, Array]:
    """Return the unloaded transmission error of the back flanks at the solved angles, shape (s,), and their clearance
    in all cells, shape (m s,) (m).

    Seen from the other side the pinion turns the other way.
    """
    pair, radius = grid.solver.pair, grid.solver.pair.wheel.base_radius
    error_behind = radius * (behind_model.first_contact_twists(-grid.angles) - pair.contact_twist)
    error = radius * (solved.twist - pair.contact_twist)
    clearance = pair.base_backlash + np.tile(error_behind, len(grid.loads)) + error
    return error_behind, np.where(solved.status == "converged", clearance, np.nan)


def _check_contact(load_map: LoadMap, solver: PositionSolver) -> None:
    """Raise `InputError` where a tooth pair carries nothing on its whole path: at the least torque, if at any."""
    cycles, period, geometry = load_map.mesh_cycles, solver.contact_model.mesh_cycles, solver.pair
    if not cycles or period == 1 or load_map.failed[0].any():
        return
    whole = cycles % period == 0
    start, end = (geometry.pinion_angle_at(s) / geometry.mesh_cycle for s in geometry.path_limits(rounded=True))
    # tooth pair k passes the path k mesh cycles earlier: those whose path lies within the angles
    expected = set(range(period) if whole else range(math.ceil(end) - cycles, math.floor(start) + 1))

    def number(k: IntArray) -> IntArray:
        return np.asarray(k % period if whole else k)

    lost = sorted(expected - set(number(load_map.pairs[0].pair).tolist()))
    if not lost:
        return
    curve, met = load_map.curves[0], solver.contact_model.first_contacts(load_map.pinion_angle)
    rows = np.flatnonzero(number(met.pair) == lost[0])
    position, twist = met.position[rows], met.twist[rows] - geometry.contact_twist
    gap = twist - curve.twist[position]  # of rigid flanks; loaded neighbours move a tooth away, too
    nearest = int(np.argmin(gap))
    tangent = curve.k_tangent[position[nearest]] * curve.base_radius**2
    k, least = lost[0], load_map.torque[0] + tangent * max(0.0, gap[nearest])
    tooth = k % geometry.pinion.teeth, (-1 - k) % geometry.wheel.tooth_count
    problem = (
        f"{len(lost)} of {len(expected)} tooth pairs carry nothing on their whole path, among them pinion tooth "
        f"{tooth[0]} on wheel tooth {tooth[1]}: must be > about {least:.3g} N m"
    )
    cure = "give more torque, or smaller errors of pitch or profile"
    raise InputError("torques", float(load_map.torque[0]), problem, cure)
