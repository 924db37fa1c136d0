r"""Newton's method for one position: pressures at the contact points of two elastic gears.

Unknown are the pressures p at the contact points. With the rows G = dg/du, the areas W, the compliance C of the flanks
and the stress rows S (stress for forces),

.. math::
    f = G(u)^T W p, \qquad u = C f, \qquad p = \max(0, -\gamma g(u) - S f).

Linearised at (u, p), with the moving normals' part H = sum_q w_q p_q d2g/du2 of the tangent, the active points solve

.. math::
    (I + (\gamma G C + S) G^T W)\, p = -\gamma (g - G u) - (\gamma G C + S) d, \qquad d = H (u^+ - u),

where d, a small correction, is iterated within the step on one factorisation. The scheme is a semi-smooth Newton method
(Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991) in the few hundred unknowns that touch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from .closest import Projection, gap_rows, project, unreached
from .scene import MeshingPair, Scene, scene_of

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Relative change of the contact force at which a position counts as converged.
TOLERANCE = 1e-10
MAX_ITERATIONS = 40
#: Newton steps taken in full before the line search watches over them.
FREE_ITERATIONS = 3


@dataclass(frozen=True)
class Position:
    """Solution of one position.

    Attributes
    ----------
    status
        ``converged``, ``no_contact`` (the teeth do not reach each other), ``under_resolved`` (the undeformed gears
        overlap, yet no contact point does) or ``not_converged``.
    torque_wheel, torque_pinion
        Moments that the hubs need, energy-conjugate: sum of (x - c) x f over the current places (N m).
    torque_wheel_reaction
        Moment of the reactions at the wheel's bore: sum of (x - u - c) x f (N m).
    tangent
        d torque_wheel / d twist (N m/rad).
    pair_numbers : tuple of int
        Pair k joins pinion tooth k and wheel tooth -1 - k.
    pair_torques : ndarray
        Share of each pair in `torque_wheel` (N m).
    peak_pressure
        Largest pressure at a contact point (Pa).
    iterations
        Newton steps.
    """

    status: str
    torque_wheel: float
    torque_pinion: float
    torque_wheel_reaction: float
    tangent: float
    pair_numbers: tuple[int, ...]
    pair_torques: Array
    peak_pressure: float
    iterations: int
    scene: Scene | None = None
    forces: Array | None = None


@dataclass(frozen=True)
class _State:
    """Nodal forces with the displacements that they cause, and the pressures they came from."""

    pressure: Array
    forces: Array
    displacement: Array
    place: Array


@dataclass(frozen=True)
class _Linearised:
    """The active points at one state, on the unknowns of the nodes that they touch.

    Attributes
    ----------
    unknowns : ndarray, shape (t,)
        Unknowns of the touched nodes.
    opening : ndarray, shape (a, t)
        dg/du of the active points.
    weighted : ndarray, shape (t, a)
        G^T W.
    response : ndarray, shape (a, t)
        gamma dg/du C + S.
    """

    unknowns: IntArray
    opening: Array
    weighted: Array
    tilt: Array
    slide: Array
    projection: Projection
    loads: Array
    parameter: Array
    compliance: Array
    response: Array
    factor: Any

    def bending(self, change: Array) -> Array:
        """H change: how the contact forces turn and move when the touched nodes move by `change`, shape (t,)."""
        p = self.projection
        metric = np.einsum("ni,ni->n", p.tangent, p.tangent)
        tilt, slide = self.tilt @ change, self.slide @ change
        share = 1 - p.gap * p.curvature / metric
        to_slide = -share * (tilt + p.curvature * slide)
        to_tilt = -share * slide + p.gap / metric * tilt
        return (self.loads * to_slide) @ self.slide + (self.loads * to_tilt) @ self.tilt


def _linearise(scene: Scene, projection: Projection, active: IntArray, pressure: Array) -> _Linearised:
    chosen = projection.take(active)
    slave = scene.slave_nodes[active]
    nodes, local = np.unique(np.concatenate([slave, chosen.edge[:, None] + np.arange(3)], axis=1), return_inverse=True)
    local = local.reshape(len(active), 6)
    parts = gap_rows(chosen, local[:, 3:], local[:, :3], scene.slave_shapes[active], len(nodes))
    rows, tilt, slide = (part.reshape(len(part), 2 * len(nodes)) for part in parts)
    unknowns = (2 * nodes[:, None] + np.arange(2)).ravel()
    areas, gamma = scene.areas(projection.place)[active], scene.parameter[active]
    compliance = scene.compliance[unknowns[:, None], unknowns]
    steep = np.einsum("ni,ni->n", chosen.normal, chosen.tangent)
    opening = rows - steep[:, None] * slide
    response = gamma[:, None] * (opening @ compliance)
    if len(scene.stress):
        response += scene.stress[active[:, None], unknowns]
    weighted = rows.T * areas
    matrix = response @ weighted
    matrix.flat[:: len(matrix) + 1] += 1.0
    factor = lu_factor(matrix, overwrite_a=True, check_finite=False)
    loads = areas * pressure[active]
    return _Linearised(unknowns, opening, weighted, tilt, slide, chosen, loads, gamma, compliance, response, factor)


def _trial(scene: Scene, projection: Projection, forces: Array) -> Array:
    """max(0, -gamma g - S f): the pressure that the law asks for at this state (Pa)."""
    trial = -scene.parameter * projection.gap
    if len(scene.stress):
        trial -= scene.stress @ forces
    trial[unreached(projection.gap)] = 0.0
    return np.maximum(trial, 0.0)


def solve_position(pair: MeshingPair, pinion_angle: float, twist: float, *, tolerance: float = TOLERANCE) -> Position:
    """Solve the contact of a gear pair at one pinion angle (rad) and wheel twist (rad).

    A Hertzian guess starts Newton's method; where that fails, the twist is raised in steps on the same flanks.
    """
    scene = scene_of(pair, pinion_angle, twist)
    if scene is None:
        return _empty("no_contact")
    if not (scene.rigid_gap < 0).any():
        return _empty("under_resolved")
    status, state, steps = _newton(scene, starting_state(pair, scene), tolerance)
    if status == "not_converged":
        status, state, more = _continued(pair, pinion_angle, twist, scene, tolerance)
        steps += more
    if status != "converged":
        return _empty(status, steps)
    return _finish(scene, state, steps)


def _continued(
    pair: MeshingPair, pinion_angle: float, twist: float, scene: Scene, tolerance: float
) -> tuple[str, _State, int]:
    """Raise the twist in steps, each started from the last, halving the step where it fails."""
    done, step, steps = 0.0, 0.25, 0
    state: _State | None = None
    status = "not_converged"
    while step > 0.01:
        share = min(1.0, done + step)
        part = scene_of(pair, pinion_angle, share * twist, windows=scene.windows)
        assert part is not None
        if state is None:
            start = starting_state(pair, part)
        else:
            scale = share / done
            start = _State(scale * state.pressure, scale * state.forces, scale * state.displacement, state.place)
        if not (start.pressure > 0).any():
            done, state = share, None
            if share >= 1.0:
                return "under_resolved", start, steps
            continue
        status, found, count = _newton(part, start, tolerance)
        steps += count
        if status == "converged":
            done, state, step = share, found, 1.5 * step
            if share >= 1.0:
                return status, found, steps
        else:
            step *= 0.5
    return status, start, steps


def _newton(scene: Scene, state: _State, tolerance: float) -> tuple[str, _State, int]:
    """Semi-smooth Newton with a backtracking line search on the weighted pressure residual."""
    residual = np.inf
    projection = scene.project(state.displacement, state.place)
    wanted = state.pressure  # the guess chooses the first active set; afterwards the law does
    limit = 1e3 * float(np.sum(scene.weight * state.pressure))
    for iteration in range(1, MAX_ITERATIONS + 1):
        active = np.flatnonzero((wanted > 0) & ~unreached(projection.gap))
        if len(active) == 0:
            return "under_resolved", state, iteration
        lin = _linearise(scene, projection, active, state.pressure)
        aim = _step(scene, lin, active, projection, state, tolerance)
        total = float(np.sum(scene.weight * np.abs(aim.pressure)))
        if not np.isfinite(total) or total > limit:
            return "not_converged", state, iteration
        length, best = 1.0, None
        for _ in range(6):
            tried = _between(state, aim, length)
            found = scene.project(tried.displacement, projection.place)
            asked = _trial(scene, found, tried.forces)
            areas = scene.areas(found.place)
            scale = max(float(np.sum(areas * asked)), 1e-12 * total)
            error = float(np.sum(areas * np.abs(tried.pressure - asked))) / scale
            if best is None or error < best[0]:
                best = (error, tried, found, asked)
            if error < (1 - 0.1 * length) * residual or iteration <= FREE_ITERATIONS:
                break
            length *= 0.5
        assert best is not None
        residual, state, projection, wanted = best
        if residual < tolerance:
            return "converged", _State(state.pressure, state.forces, state.displacement, projection.place), iteration
    return "not_converged", state, MAX_ITERATIONS


def _between(old: _State, new: _State, length: float) -> _State:
    if length == 1.0:
        return new
    mix = [a + length * (b - a) for a, b in zip(_numbers(old), _numbers(new), strict=True)]
    return _State(mix[0], mix[1], mix[2], new.place)


def _numbers(state: _State) -> tuple[Array, Array, Array]:
    return state.pressure, state.forces, state.displacement


def _step(
    scene: Scene, lin: _Linearised, active: IntArray, projection: Projection, state: _State, tolerance: float
) -> _State:
    """Solve the linearised contact for the active points; d is iterated on the same factorisation."""
    before = state.displacement[lin.unknowns]
    right = -lin.parameter * (projection.gap[active] - lin.opening @ before)
    turned = np.zeros(len(lin.unknowns))
    for _ in range(6):
        solved = lu_solve(lin.factor, right - lin.response @ turned, check_finite=False)
        local = lin.weighted @ solved + turned
        update = lin.bending(lin.compliance @ local - before)
        if np.max(np.abs(update - turned)) <= 1e-2 * tolerance * np.max(np.abs(local)):
            break
        turned = update
    pressure = np.zeros(len(scene.weight))
    pressure[active] = solved
    forces = np.zeros(2 * len(scene.points))
    forces[lin.unknowns] = local
    return _State(pressure, forces, scene.compliance[:, lin.unknowns] @ local, projection.place)


def starting_state(pair: MeshingPair, scene: Scene) -> _State:
    """Hertzian pressures and the displacements that they cause."""
    pressure = starting_pressure(pair, scene)
    rows = _rows_only(scene, scene.project(np.zeros(2 * len(scene.points)), scene.place), pressure > 0)
    forces = rows.T @ (scene.weight * pressure)[pressure > 0]
    return _State(pressure, forces, scene.compliance @ forces, scene.place)


def _rows_only(scene: Scene, projection: Projection, chosen: NDArray[np.bool_]) -> Array:
    size = len(scene.points)
    index = np.flatnonzero(chosen)
    part = projection.take(index)
    master = part.edge[:, None] + np.arange(3)
    rows, _, _ = gap_rows(part, master, scene.slave_nodes[index], scene.slave_shapes[index], size)
    return rows.reshape(len(rows), 2 * size)


def starting_pressure(pair: MeshingPair, scene: Scene) -> Array:
    """Hertzian guess: each pair carries an elliptic pressure about its deepest point, sized by the pairs' compliances."""
    areas = scene.weight
    slave = np.einsum("qa,qai->qi", scene.slave_shapes, scene.points[scene.slave_nodes])
    gaps = np.where(unreached(scene.rigid_gap), np.inf, scene.rigid_gap)
    effective = 1 / sum(b.material.contact_compliance(b.plane) for b in pair.bodies)
    half_width = np.full(scene.pairs, 0.0)
    projection = scene.project(np.zeros(2 * len(scene.points)), scene.place)
    pressure = np.zeros(len(areas))
    forces = np.zeros(scene.pairs)
    for attempt in range(3):
        shapes = np.zeros((scene.pairs, len(areas)))
        for k in range(scene.pairs):
            for side in (True, False):
                mine = (scene.pair == k) & (scene.on_pinion == side) & np.isfinite(gaps)
                if not mine.any():
                    continue
                deepest = np.flatnonzero(mine)[np.argmin(gaps[mine])]
                distance = np.linalg.norm(slave - slave[deepest], axis=1)
                edge = pair.bodies[0 if side else 1].flank.sizes.max()
                width = max(
                    half_width[k], 0.25 * edge if attempt else edge, 3 * np.sort(distance[mine])[min(2, mine.sum() - 1)]
                )
                shapes[k] += np.where(mine, np.sqrt(np.maximum(0.0, 1 - (distance / width) ** 2)), 0.0)
        shapes /= np.maximum(shapes @ areas, 1e-300)[:, None]
        used = shapes.max(axis=0) > 0
        rows = _rows_only(scene, projection, used)
        unit = (shapes[:, used] * areas[used]) @ rows
        mutual = unit @ scene.compliance @ unit.T
        overlap = -(shapes[:, used] * areas[used]) @ scene.rigid_gap[used]
        forces = _carried(mutual, overlap)
        # half width of a line contact, b^2 = 4 F rho/(pi E* w); the overlap's length gives rho: s^2 = 2 rho depth
        for k in range(scene.pairs):
            mine = (scene.pair == k) & (gaps < 0)
            reach = 0.5 * np.max(np.ptp(slave[mine], axis=0)) if mine.any() else 0.0
            radius = reach**2 / (2 * scene.depth[k]) if scene.depth[k] > 0 else 0.0
            half_width[k] = np.sqrt(4 * forces[k] * radius / (np.pi * effective * pair.width))
        pressure = forces @ shapes
    return pressure


def _carried(compliance: Array, overlap: Array) -> Array:
    """Forces F >= 0 with C F = overlap where F > 0: pairs that would pull are let go, the weakest first."""
    forces = np.zeros(len(overlap))
    active = (overlap > 0) & (np.diagonal(compliance) > 0)
    while active.any():
        forces = np.zeros(len(overlap))
        forces[active] = np.linalg.solve(compliance[np.ix_(active, active)], overlap[active])
        if (forces >= 0).all():
            return forces
        active[np.argmin(forces)] = False
    return np.zeros(len(overlap))


def _finish(scene: Scene, state: _State, iterations: int) -> Position:
    active = np.flatnonzero(state.pressure > 0)
    projection = scene.project(state.displacement, state.place)
    lin = _linearise(scene, projection, active, state.pressure)
    forces = np.zeros(2 * len(scene.points))
    forces[lin.unknowns] = lin.weighted @ state.pressure[active]
    placed = scene.points + state.displacement.reshape(-1, 2)
    force = forces.reshape(-1, 2)
    wheel = scene.of_wheel
    about_wheel = -_moment(placed - scene.wheel_centre, force)
    reaction = -_moment(scene.points - scene.wheel_centre, force)
    of_pair = [[w for w in scene.windows if w.pair == k and w.gear == 1][0] for k in range(scene.pairs)]
    return Position(
        status="converged",
        torque_wheel=float(about_wheel[wheel].sum()),
        torque_pinion=-float(_moment(placed, force)[~wheel].sum()),
        torque_wheel_reaction=float(reaction[wheel].sum()),
        tangent=_tangent(scene, lin, forces, state.displacement),
        pair_numbers=tuple(-1 - w.tooth for w in of_pair),
        pair_torques=np.array([about_wheel[w.nodes].sum() for w in of_pair]),
        peak_pressure=float(state.pressure.max()),
        iterations=iterations,
        scene=scene,
        forces=forces,
    )


def _moment(arm: Array, force: Array) -> Array:
    return arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]


def _tangent(scene: Scene, lin: _Linearised, forces: Array, displacement: Array) -> float:
    """d torque / d twist: the wheel's nodes move with its rotation, its forces and compliance turn with its frame."""

    def turned(vector: Array) -> Array:
        v = vector.reshape(-1, 2)
        return np.where(scene.of_wheel[:, None], np.stack([-v[:, 1], v[:, 0]], axis=1), 0.0).ravel()

    carried = (scene.lever.ravel() + turned(displacement))[lin.unknowns]
    frame = turned(forces)[lin.unknowns]
    right = lin.response @ frame - lin.parameter * (lin.opening @ carried)
    bend = np.zeros(len(frame))
    for _ in range(12):
        solved = lu_solve(lin.factor, right - lin.response @ bend, check_finite=False)
        rate = lin.weighted @ solved + bend
        update = lin.bending(carried + lin.compliance @ (rate - frame))
        if np.max(np.abs(update - bend)) <= 1e-10 * np.max(np.abs(rate)):
            break
        bend = update
    moved = carried + lin.compliance @ (rate - frame)
    nodes = lin.unknowns[::2] // 2
    wheel = scene.of_wheel[nodes]
    place = (scene.points + displacement.reshape(-1, 2) - scene.wheel_centre)[nodes]
    change = _moment(place, rate.reshape(-1, 2)) + _moment(moved.reshape(-1, 2), forces.reshape(-1, 2)[nodes])
    return -float(change[wheel].sum())


def _empty(status: str, iterations: int = 0) -> Position:
    nothing = 0.0 if status == "no_contact" else float("nan")
    return Position(status, nothing, nothing, nothing, nothing, (), np.zeros(0), nothing, iterations)
