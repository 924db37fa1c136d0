"""Rotation sweep: from a gear pair to its mesh-stiffness curve.

Conventions: pinion centre at the origin, wheel at +x; at pinion angle 0 a pinion tooth stands on the line of centres
and a wheel space faces it; angles are counter-clockwise; wheel angle = -pinion angle z1/z2 + lost motion + twist. The
lost motion is half the backlash: it brings unmodified driving flanks to touch, and a positive twist presses them
together.

    >>> curve = sweep_stiffness(pair, twist=math.radians(0.05))   # one mesh cycle in 20 positions
    >>> k, slope = curve.interpolate(math.radians(7.3))           # N/m and N/(m rad)
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..contact.compliance import MeshingPair, gear_body
from ..contact.laws import ContactLaw, HalfPlane, law_named, law_text, uses_stress
from ..contact.position import Positions
from ..elasticity import Material, Plane
from ..errors import InputError
from ..gear.deviation import NOMINAL, ToothDeviations
from ..gear.pair import GearPair
from ..gear.validity import MOST_OVERLAP, overlaps
from ..meshing.recipe import sector_recipes
from ..meshing.tooth_sector import sector_mesh
from ..stopwatch import Stopwatch
from ..tables.laws import DEFAULT_LAW
from ..tables.stiffness import check_flank_coarsen
from ..threads import one_thread
from ..typing import Array, IntArray
from .contact_pressure import EDGES, contact_pressures
from .curve import SOLVED, ErrorEstimate, StiffnessCurve
from .curve_error import COARSENING, curve_error
from .periodic import wrapped_phase
from .positions import (
    PositionSolver,
    Progress,
    at_torque,
    at_twists,
    check_torque,
    checked_contact,
    load_shares,
    position_solver,
)

__all__ = ["ErrorEstimate", "StiffnessCurve", "elastic_pair", "sweep_stiffness"]


#: Flank elements of the half-plane law, which need not resolve contacts: times those of the laws on the mesh, and at
#: most so many times the default ones.
HALF_PLANE_FLANK, HALF_PLANE_COARSEST = 4.0, 6.0

#: Structural steel, the material where none is given.
STEEL = Material()


def elastic_pair(
    pair: GearPair,
    materials: Material | tuple[Material, Material] = STEEL,
    *,
    plane: Plane = "strain",
    law: str | ContactLaw = DEFAULT_LAW,
    coarsen: float = 1.0,
    flank_coarsen: float = 1.0,
    points_per_edge: int = 4,
    deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL,
    watch: Stopwatch | None = None,
) -> MeshingPair:
    """Mesh both gears (or read their meshes from the cache) and condense them to their flanks.

    Parameters
    ----------
    materials
        Of both gears, or of pinion and wheel.
    plane
        ``strain`` or ``stress``.
    law
        Contact law, or the name of one with its default parameter.
    coarsen, flank_coarsen
        Factor on all element sizes, and besides on those of the driving flanks. The half-plane law's flanks are coarser
        by `HALF_PLANE_FLANK`, as far as `HALF_PLANE_COARSEST` allows.
    points_per_edge
        Contact points on each edge of a flank.
    deviations
        Of the driving flanks of pinion and wheel, all teeth alike; the half-plane law alone takes them.
    watch
        Takes the time of the stages.
    """
    if plane not in ("strain", "stress"):
        raise InputError("plane", plane, "must be strain or stress")
    # the error estimate of a mesh at the limit is coarser by COARSENING
    if not (math.isfinite(coarsen) and 0.2 <= coarsen <= 5.0 * COARSENING):
        raise InputError("coarsen", coarsen, "must be >= 0.2 and <= 5", "1 is the default mesh, 2 twice its sizes")
    check_flank_coarsen(coarsen, flank_coarsen, "flank_coarsen")
    chosen = law_named(law) if isinstance(law, str) else law
    asked = coarsen, flank_coarsen, points_per_edge
    flank_coarsen = flank_factor(chosen, coarsen, flank_coarsen)
    both = (materials, materials) if isinstance(materials, Material) else materials
    watch = watch or Stopwatch()
    gears = (pair.pinion, pair.wheel)
    with watch.stage("meshes"):
        recipes = sector_recipes(pair, coarsen=coarsen, flank_coarsen=flank_coarsen)
        meshes = [sector_mesh(gear, recipe) for gear, recipe in zip(gears, recipes, strict=True)]
    width = min(gear.face_width for gear in gears)
    with watch.stage("condensation"), one_thread():
        bodies = [
            gear_body(
                mesh,
                material,
                plane,
                gear.face_width,
                points_per_edge=points_per_edge,
                with_stress=uses_stress(chosen),
                width=width,
            )
            for mesh, material, gear in zip(meshes, both, gears, strict=True)
        ]
    return MeshingPair(bodies[0], bodies[1], pair.working_centre_distance, width, chosen, *asked, deviations)


def coarser(pair: GearPair, elastic: MeshingPair) -> MeshingPair:
    """The same gears on meshes `COARSENING` times coarser."""
    return elastic_pair(
        pair,
        (elastic.pinion.material, elastic.wheel.material),
        plane=elastic.pinion.plane,
        law=elastic.law,
        coarsen=COARSENING * elastic.coarsen,
        flank_coarsen=elastic.flank_coarsen,
        points_per_edge=elastic.points_per_edge,
        deviations=elastic.deviations,
    )


def flank_factor(law: ContactLaw, coarsen: float, flank_coarsen: float = 1.0) -> float:
    """`flank_coarsen` of the mesh that a law gets: the half-plane law's is coarser, see `elastic_pair`."""
    if not isinstance(law, HalfPlane):
        return flank_coarsen
    return min(HALF_PLANE_FLANK * flank_coarsen, max(1.0, HALF_PLANE_COARSEST / coarsen))


def sweep_stiffness(
    pair: GearPair,
    *,
    twist: float | None = None,
    torque: float | None = None,
    angles: ArrayLike | None = None,
    materials: Material | tuple[Material, Material] = STEEL,
    plane: Plane = "strain",
    law: str | ContactLaw = DEFAULT_LAW,
    kinematics: Literal["small", "finite"] = "finite",
    twist_from: Literal["contact", "centred"] = "contact",
    solve_all: bool = False,
    coarsen: float = 1.0,
    flank_coarsen: float = 1.0,
    points_per_edge: int = 4,
    deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL,
    estimate_error: bool = False,
    elastic: MeshingPair | None = None,
    progress: Progress | None = None,
) -> StiffnessCurve:
    """Mesh stiffness over the rotation of the pinion, at a given twist or a given torque.

    Parameters
    ----------
    twist
        Twist of the wheel (rad), > 0, counted as `twist_from` says.
    torque
        Torque at the wheel's hub (N m), > 0, instead of `twist`.
    angles : array_like, shape (n,), optional
        Pinion angles (rad); without them, 20 over one mesh cycle. Positions that differ by whole mesh cycles are
        solved once.
    materials, plane, law, coarsen, flank_coarsen, points_per_edge, deviations
        See `elastic_pair`.
    kinematics
        ``small``: small strain in each hub's frame; ``finite`` (default) adds the first-order effect of finite strain
        on the torque, see `gearfe.contact.finite_strain`.
    twist_from
        Where the given `twist` counts from: ``contact``, where unmodified flanks touch; ``centred``, where a wheel
        space faces the pinion tooth, half the backlash before. Results count from contact in either case.
    solve_all
        Solve every position, also those that differ by whole mesh cycles.
    estimate_error
        Estimate the discretisation error from coarser meshes.
    elastic
        The pair from `elastic_pair`, when it is there already; its arguments are not looked at then.
    progress
        Called with positions done, positions in all, and the stage's name.

    Returns
    -------
    StiffnessCurve
        With every position asked for; a position that failed has its status and not-a-number.

    Raises
    ------
    InputError
        For neither or both of twist and torque, or values out of range.
    """
    if kinematics not in ("small", "finite"):
        raise InputError("kinematics", kinematics, "must be small or finite")
    load = _checked_load(pair, twist, torque, twist_from)
    cycle = pair.mesh_cycle
    asked = np.arange(20) * cycle / 20 if angles is None else np.atleast_1d(np.asarray(angles, dtype=float))
    if asked.ndim != 1 or len(asked) == 0 or not np.isfinite(asked).all():
        raise InputError("angles", angles, "must be a list of finite angles (rad)", "give at least one angle")
    watch, finite = Stopwatch(), kinematics == "finite"
    if elastic is None:
        sizes: dict[str, Any] = {"coarsen": coarsen, "flank_coarsen": flank_coarsen, "points_per_edge": points_per_edge}
        elastic = elastic_pair(pair, materials, plane=plane, law=law, deviations=deviations, watch=watch, **sizes)
    solved_angles, source = (asked, np.arange(len(asked))) if solve_all else distinct_angles(asked, cycle)
    solver = position_solver(pair, elastic)
    if torque is not None:
        check_torque(solver, load)
    with watch.stage("unloaded flanks"):
        touching = solver.touching_twists(solved_angles)
    with watch.stage("positions"), one_thread():
        if torque is None:
            solved = at_twists(solver, solved_angles, np.full(len(solved_angles), load), progress, finite=finite)
        else:
            solved = at_torque(solver, solved_angles, load, touching, progress, finite=finite)
    solved = checked_contact(solved, touching)
    error = None
    if estimate_error:
        with watch.stage("error estimate"), one_thread():
            error = curve_error(solver, coarser(pair, elastic), solved, finite=finite)
    curve = assembled_curve(solver, asked, source, solved, touching, searched=torque is not None)
    return replace(curve, timings=dict(watch.seconds), error=error)


def _checked_load(pair: GearPair, twist: float | None, torque: float | None, twist_from: str) -> float:
    """Twist from the centred position (rad), or torque."""
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
    most = math.pi / pair.wheel.teeth - lost
    if not (math.isfinite(twist) and 0 < twist < most):
        problem = f"must be > 0 and < {most:.6g} rad ({math.degrees(most):.6g} deg, half a pitch of the wheel)"
        raise InputError("twist", twist, problem, "0.01 to 0.5 deg is usual")
    return float(twist) + lost


def distinct_angles(angles: Array, cycle: float) -> tuple[Array, IntArray]:
    """Angles within one cycle that have to be solved, and for each asked angle the number of its own."""
    wrapped = wrapped_phase(angles, cycle)
    order = np.argsort(wrapped, kind="stable")
    new = np.concatenate([[True], np.diff(wrapped[order]) > 1e-9 * cycle])
    source = np.empty(len(angles), dtype=np.int64)
    source[order] = np.cumsum(new) - 1
    return wrapped[order][new], source


def assembled_curve(
    solver: PositionSolver, asked: Array, source: IntArray, solved: Positions, touching: Array, *, searched: bool
) -> StiffnessCurve:
    """The curve at all asked angles.

    Parameters
    ----------
    source
        Number of the position among those solved for each of the angles.
    touching
        Twists (rad), shape (n,), at which the rigid flanks of these touch.
    searched
        Whether the twist is a result, not given.
    """
    pair, law = solver.pair, solver.elastic.law
    radius, lost = pair.wheel.base_radius, pair.contact_twist
    failed = ~np.isin(solved.status, SOLVED)
    total = np.where(failed & searched, np.nan, solved.twist)
    twist, torque = total - lost, solved.torque_wheel
    deflection = total - solver.first_touch(touching)
    stiffness = np.divide(torque, deflection, out=np.zeros_like(torque), where=torque != 0.0)  # not-a-number stays
    cycles = np.round((asked - solved.pinion_angle[source]) / pair.mesh_cycle).astype(np.int64)
    leading, shares = load_shares(solved)
    pressures = contact_pressures(solver, solved)
    edge = np.where(failed, 0, pressures.pop("edge"))
    of_solved: dict[str, Any] = {
        "twist": twist,
        "torque_wheel": torque,
        "torque_pinion": solved.torque_pinion,
        "torque_wheel_reaction": solved.torque_wheel_reaction,
        "k_torsional": stiffness,
        "k_mesh": stiffness / radius**2,
        "k_tangent": solved.tangent / radius**2,
        "transmission_error": twist * radius,
        "transmission_error_unloaded": (touching - lost) * radius,
        "load_share": shares,
        "teeth_in_contact": np.where(failed, -1, (shares > 0).sum(axis=1)),
        "edge": np.array(EDGES)[edge],
        "iterations": solved.iterations,
        "status": solved.status,
        "beyond_validity": np.where(np.isnan(twist), -1, overlaps(pair, twist) > MOST_OVERLAP),
        **pressures,
    }
    return StiffnessCurve(
        pinion_angle=asked,
        wheel_angle=pair.wheel_angle_at(asked, total[source]),
        leading_pair=leading[source] - cycles,
        law=np.full(len(source), law.name),
        contact_law=law_text(law),
        mesh_cycle=pair.mesh_cycle,
        base_radius=radius,
        lost_motion=lost,
        **{name: values[source] for name, values in of_solved.items()},
    )
