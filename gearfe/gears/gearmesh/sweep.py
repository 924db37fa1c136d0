r"""Rotation sweep: from a gear pair to its mesh-stiffness curve.

Conventions: pinion centre at the origin, wheel at +x; at pinion angle 0 a pinion tooth stands on the line of centres
and a wheel space faces it; angles are counter-clockwise; wheel angle = -pinion angle z1/z2 + lost motion + twist. The
lost motion is half the backlash: it brings unmodified driving flanks to touch, and a positive twist presses them
together.

Pressures are Hertz's on smooth flanks, and apart from it where an edge bears. A tooth pair that carries the force F
over the width w, on flanks of relative curvature :math:`1/\rho` where they touch, has Hertz's peak pressure (Johnson,
*Contact Mechanics*, 1985, eq. 4.45)

.. math:: p_H = \sqrt{\frac{F E^*}{\pi\rho w}} = \frac{2F}{\pi b_H w} .

The computed pressure has a half width b of its own, by its second moment (`gears.contact.elements.half_widths`), so
:math:`|b/b_H - 1|` tells how far from Hertz's the contact is: the discretisation, flanks whose curvature changes along
the contact, teeth that are no half-planes. On flanks with deviations of micrometres, whose curvature where they touch
may be that of a wave shorter than the contact, :math:`2F/(\pi b w)` itself stands for the pressure.

Where the contact reaches an edge of a face, the pressure of linear elasticity has no bound (a sharp tip, the kink where
a linear relief starts, the edge of an undercut), or the radius of a tip round decides it. What stands for it there is

.. math:: p_e = \frac{2F}{\pi w \sqrt{b^2 + \epsilon^2}}, \qquad \epsilon = 0.01\,m,

the peak of a Hertzian contact with the same force and second moment, blunted by a hundredth of a module: a figure to
compare designs with, which neither the mesh nor a contact of some micrometres decides. It is no stress of the material.

    >>> curve = sweep_stiffness(pair, twist=math.radians(0.05))   # one mesh cycle in 20 positions
    >>> k, slope = curve.interpolate(math.radians(7.3))           # N/m and N/(m rad)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.progress import Stopwatch, one_thread
from ...base.typing import Array, BoolArray, IntArray
from ..contact.compliance import MeshingPair, gear_body
from ..contact.half_plane_pair import HalfPlanePair
from ..contact.laws import COARSENING, DEFAULT_MODEL, PairModel, check_alike, check_torque, law_text, uses_stress
from ..contact.position import Positions
from ..geometry.face import NOMINAL
from ..geometry.pair import GearPair
from ..geometry.validity import MOST_OVERLAP, overlaps
from ..teeth.tooth_sector import sector_mesh, sector_recipes
from .curve import EDGES, ROUNDED, SINGULAR, SOLVED, StiffnessCurve
from .periodic import distinct_phases
from .positions import PositionSolver, at_torques, at_twists, checked_contact, curve_error, load_shares, position_solver

__all__ = ["StiffnessCurve", "elastic_pair", "sweep_stiffness"]


#: Positions in one mesh cycle where no angles are given.
ANGLES = 20
#: Blunting length of edges (modules).
BLUNTING = 0.01


def elastic_pair(
    pair: GearPair, model: PairModel = DEFAULT_MODEL, *, watch: Stopwatch | None = None, **changes: Any
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
    changes
        Fields of the model to change, such as ``law="nitsche"``; see `PairModel.changed`.
    """
    model = model.changed(**changes)
    watch = watch or Stopwatch()
    gears = (pair.pinion, pair.wheel)
    with watch.stage("meshes"):
        recipes = sector_recipes(pair, coarsen=model.coarsen, flank_coarsen=model.mesh_flank_coarsen)
        meshes = [sector_mesh(gear, recipe) for gear, recipe in zip(gears, recipes, strict=True)]
    width = min(gear.face_width for gear in gears)
    options: dict[str, Any] = {"points_per_edge": model.points_per_edge, "with_stress": uses_stress(model.law)}
    with watch.stage("condensation"), one_thread():
        one, two = (
            gear_body(mesh, material, model.plane, gear.face_width, width=width, **options)
            for mesh, material, gear in zip(meshes, model.materials, gears, strict=True)
        )
    return MeshingPair(pair, one, two, model)


def coarser(elastic: MeshingPair) -> MeshingPair:
    """The same gears on meshes `COARSENING` times coarser."""
    return elastic_pair(elastic.gears, elastic.model, coarsen=COARSENING * elastic.model.coarsen)


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
        The pair from `elastic_pair`, when it is there already; the model is not looked at then.

    Returns
    -------
    StiffnessCurve
        With every position asked for; a position that failed has its status and not-a-number.

    Raises
    ------
    InputError
        For neither or both of twist and torque, or values out of range.
    """
    load, watch = _checked_load(pair, twist, torque, twist_from), Stopwatch()
    requested, finite = requested_angles(pair, angles, ANGLES, kinematics)
    if elastic is None:
        elastic = elastic_pair(pair, model, watch=watch, **changes)
    check_alike(elastic.deviations)
    solved_angles, source = (
        (requested, np.arange(len(requested))) if solve_all else distinct_phases(requested, pair.mesh_cycle)
    )
    if torque is not None:
        check_torque(pair, elastic.model, load)
    solver = position_solver(elastic)
    with watch.stage("unloaded flanks"):
        solver.contact_model.first_contacts(solved_angles)
    with watch.stage("positions"), one_thread():
        solve = at_twists if torque is None else at_torques
        solved = solve(solver, solved_angles, np.full(len(solved_angles), load), finite=finite)
    curve, _ = assembled_curve(solver, requested, source, solved, searched=torque is not None)
    if estimate_error:
        with watch.stage("error estimate"), one_thread():
            error = curve_error(solver, coarser(elastic), solved, finite=finite)
        curve = replace(curve, relative_error=error[source])
    return replace(curve, timings=dict(watch.seconds))


def requested_angles(pair: GearPair, angles: ArrayLike | None, count: int, kinematics: str) -> tuple[Array, bool]:
    """Return the pinion angles of a sweep (rad), and whether finite strain counts.

    Parameters
    ----------
    pair : GearPair
        The gears.
    angles : array_like, shape (n,), or None
        Asked angles (rad).
    count : int
        Number of angles over one mesh cycle if none are asked for.
    kinematics : str
        ``small`` or ``finite``.

    Raises
    ------
    InputError
        For other kinematics, and angles that are not a list of finite numbers.
    """
    if kinematics not in ("small", "finite"):
        raise InputError("kinematics", kinematics, "must be small or finite")
    requested = (
        np.arange(count) * pair.mesh_cycle / count if angles is None else np.atleast_1d(np.asarray(angles, float))
    )
    if requested.ndim != 1 or len(requested) == 0 or not np.isfinite(requested).all():
        raise InputError("angles", angles, "must be a list of finite angles (rad)", "give at least one angle")
    return requested, kinematics == "finite"


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


def assembled_curve(
    solver: PositionSolver, requested: Array, source: IntArray, solved: Positions, *, searched: bool
) -> tuple[StiffnessCurve, PairLoads]:
    """Return the curve at all asked angles, and the loaded pairs there.

    Parameters
    ----------
    solver : PositionSolver
        The gears.
    requested : ndarray, shape (n,)
        Asked pinion angles (rad).
    source : ndarray of int, shape (n,)
        Number of the position among those solved for each of the angles.
    solved : Positions
        Solved positions.
    searched
        Whether the twist is a result, not given.
    """
    pair, law = solver.pair, solver.elastic.law
    radius, lost = pair.wheel.base_radius, pair.contact_twist
    solved = checked_contact(solver, solved).take(source)
    failed = ~np.isin(solved.status, SOLVED)
    total = np.where(failed & searched, np.nan, solved.twist)
    twist, torque = total - lost, solved.torque_wheel
    deflection = total - solver.contact_model.first_contact_twist(solved.pinion_angle)
    stiffness = np.divide(torque, deflection, out=np.zeros_like(torque), where=torque != 0.0)  # not-a-number stays
    cycles = np.round((requested - solved.pinion_angle) / pair.mesh_cycle).astype(np.int64)
    leading, shares = load_shares(solved)
    loads = pair_loads(solver, solved)
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
        transmission_error_unloaded=(solver.contact_model.first_contact_twists(solved.pinion_angle) - lost) * radius,
        leading_pair=leading - cycles,
        load_share=shares,
        teeth_in_contact=np.where(failed, -1, (shares > 0).sum(axis=1)),
        iterations=solved.iterations,
        status=solved.status,
        law=np.full(len(source), law.name),
        contact_law=law_text(law),
        beyond_validity=np.where(np.isnan(twist), -1, overlaps(pair, twist) > MOST_OVERLAP),
        mesh_cycle=pair.mesh_cycle * solver.contact_model.mesh_cycles,
        base_radius=radius,
        lost_motion=lost,
        **contact_pressures(solved, loads),
    )
    return curve, replace(loads, pair=loads.pair - cycles[loads.position])


@dataclass(frozen=True)
class PairLoads:
    """Tooth pairs that carry load, q of them over all positions, by position.

    Attributes
    ----------
    position, pair : ndarray, shape (q,)
        Number of the position; pair number k: pinion tooth k, wheel tooth -1 - k, counted on round the gears.
    force : ndarray, shape (q,)
        On the whole width (N).
    share : ndarray, shape (q,)
        Share of the wheel's torque (-).
    roll : ndarray, shape (q, 2)
        Roll lengths of the middle of the contact on pinion and wheel (m); not-a-number off the involutes.
    half_width, pressure, error : ndarray, shape (q,)
        Half width (m), pressure above (Pa), and how far the contact is from Hertz's (-).
    edge : ndarray, shape (q,)
        Which edge bears, the place in `EDGES`.
    """

    position: IntArray
    pair: IntArray
    force: Array
    share: Array
    roll: Array
    half_width: Array
    pressure: Array
    error: Array
    edge: IntArray


def pair_loads(solver: PositionSolver, found: Positions) -> PairLoads:
    """Loaded tooth pairs of positions."""
    elastic, contacts = solver.elastic, found.contacts
    first_contact = solver.contact_model.first_contacts(found.pinion_angle)
    met, pairs = ((np.stack([one.position, one.pair], axis=1) @ [1 << 32, 1]) for one in (first_contact, contacts))
    k = np.minimum(np.searchsorted(met, pairs), len(met) - 1)
    known = np.flatnonzero((contacts.torque_wheel > 0) & (met[k] == pairs))
    k, position, width = k[known], contacts.position[known], contacts.half_width[known]
    force = contacts.torque_wheel[known] / (first_contact.arm[k, 1] * elastic.width)
    curvature, flat = first_contact.curvature[k], np.isfinite(first_contact.curvature[k])
    flank, half = first_contact.flank[k], width[:, None, None]
    middle = solver.contact_model.arc_at(flank, first_contact.place[k])[:, :, None]
    reached = marks_met(solver.contact_model, flank, middle - half, middle + half)
    rounded = solver.contact_model.marks[0] == "round"
    bears = np.where(reached[:, rounded].any(axis=1), ROUNDED, 0)
    bears[reached[:, ~rounded].any(axis=1)] = SINGULAR
    several = np.unique(pairs[known], return_inverse=True, return_counts=True)
    bears[several[2][several[1]] > 1] = ROUNDED  # not where the rigid flanks touch first, nor with one ellipse
    bears[~flat] = SINGULAR  # it touches at the corner itself, however narrow the contact
    hertz = np.sqrt(force / solver.contact_model.inverse_modulus.sum() * np.where(flat, curvature, 0.0) / math.pi)
    blunted = 2 * force / (math.pi * np.hypot(width, BLUNTING * solver.pair.pinion.module))
    off = np.abs(width * math.pi * hertz / (2 * force) - 1)
    if elastic.deviations != NOMINAL:  # waves shorter than the contact say nothing of its pressure; its width does
        hertz = 2 * force / (math.pi * width)
    return PairLoads(
        position=position,
        pair=contacts.pair[known],
        force=force * elastic.width,
        share=contacts.torque_wheel[known] / found.torque_wheel[position],
        roll=_rolls(solver.contact_model, flank, contacts.arc[known]),
        half_width=width,
        pressure=np.where(bears > 0, blunted, hertz),
        error=off,
        edge=bears,
    )


def _rolls(contact_model: HalfPlanePair, flank: IntArray, arc: Array) -> Array:
    """Roll lengths (m) at arcs (m) of the flanks `flank`, all of shape (q, 2); not-a-number off the involutes."""
    made = np.full(arc.shape, np.nan)
    for i in np.unique(flank):
        face, here = contact_model.teeth.faces[i], np.nonzero(flank == i)
        u = face.parameter_at(arc[here])
        on = (u >= 0) & (u <= 1)
        made[tuple(one[on] for one in here)] = face.flank.roll(u[on])
    return made


def marks_met(contact_model: HalfPlanePair, flank: IntArray, low: Array, high: Array) -> BoolArray:
    """Return which of `HalfPlanePair.marks` lie between two arcs of contacts.

    Parameters
    ----------
    contact_model : HalfPlanePair
        The pair.
    flank : ndarray of int, shape (m, 2)
        Flanks of the contacts.
    low, high : ndarray, shape (m, 2, 1)
        Arcs (m).

    Returns
    -------
    met : ndarray of bool, shape (m, k)
        For each contact and mark.
    """
    _, of, (first, last) = contact_model.marks
    return np.asarray(((flank[:, :, None] == of) & (low <= last) & (high >= first)).any(axis=1))


def contact_pressures(found: Positions, loads: PairLoads) -> dict[str, Any]:
    """The fields of a `StiffnessCurve` that tell what bears at n positions, from their loaded pairs."""
    edge, at_edges = np.zeros(len(found), dtype=np.int64), np.full(len(found), np.nan)
    pressure, error = np.where(found.status == "no_contact", 0.0, np.full((2, len(found)), np.nan))
    np.maximum.at(edge, loads.position, loads.edge)
    sharp, smooth = np.flatnonzero(loads.edge > 0), np.flatnonzero(loads.edge == 0)
    np.fmax.at(at_edges, loads.position[sharp], loads.pressure[sharp])
    smooth = smooth[np.argsort(loads.pressure[smooth], kind="stable")]  # the largest of a position comes last and stays
    pressure[loads.position[smooth]], error[loads.position[smooth]] = loads.pressure[smooth], loads.error[smooth]
    words = np.array(EDGES)[np.where(np.isin(found.status, SOLVED), edge, 0)]
    return {"peak_pressure": pressure, "peak_pressure_error": error, "edge_pressure": at_edges, "edge": words}
