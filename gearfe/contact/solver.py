"""Positions of a gear pair in contact: search for the teeth that overlap, Newton's method, torques and tangent.

Two iterations solve the same equations. Most positions are solved in lockstep, on windows that just hold the contact
(`gearfe.contact.group_newton`); those that outgrow them once more on larger ones. What does not converge there, or has
a law that the lockstep does not know, goes to the general iteration (`gearfe.contact.newton`), and where that fails
too the twist is raised in steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Projection, unreached
from .group import gather, rigid_projection
from .group_newton import iterate
from .group_results import outgrown, results_of, scenes_of
from .group_start import starting_states
from .laws import ContactLaw
from .newton import Dialogue, Linearised, Outcome, State, linearise, newton
from .overlap import CLOSE, REACH, WHOLE, Overlap, overlaps, rigidly_apart, windows_of
from .scene import MeshingPair, Scene, Window, assemble, assemble_all, project_all
from .start import starting_state

Array = NDArray[Any]

#: Relative residual of the contact pressures at which a position counts as converged.
TOLERANCE = 1e-10
#: Positions solved side by side.
BATCH = 64
#: Memory for the matrices of positions that are solved side by side.
GROUP_BYTES = 60e6
#: A law without stress that is too hard to start with, as points change sides at every step, is solved softened to this
#: share of its stiffness first, and then to so many times as much, by smaller factors where that fails.
SOFTEST, SOFTNESS_STEP, SMALLEST_STEP = 0.01, 3.2, 1.1
#: The same in lockstep, at fixed shares.
SOFTER = (0.01, 0.03, 0.1, 0.3)
#: Accuracy of the softer solutions, and Newton steps for each.
SOFT_TOLERANCE, SOFT_ITERATIONS = 1e-2, 20
#: Newton steps spent on one difficult position before it is given up.
MAX_STEPS = 320


@dataclass(frozen=True)
class Position:
    """Solution of one position.

    Attributes
    ----------
    status
        ``converged``, ``no_contact`` (the undeformed gears are clear of each other), ``under_resolved`` (they overlap,
        yet no contact point does) or ``not_converged``. Torques are 0 without contact, not-a-number when not solved.
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
    scene, forces, force_rate
        Pieces of flank (without their matrices), the nodal forces on them in tooth axes (N) and their derivatives with
        respect to the twist (N/rad), for recovering fields; None without a solution.
    pressure : ndarray, shape (q,)
        Pressure at the scene's contact points (Pa); None without a solution.
    route
        ``direct``: solved on the mesh; ``hertz`` or ``blend``: see `gearfe.routes`.
    stress_loads, stress_load_rate
        Loads on the normal stress at the contact points (N m2) and their derivatives (N m2/rad); empty with theta = 0.
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
    force_rate: Array | None = None
    route: str = "direct"
    pressure: Array | None = None
    stress_loads: Array | None = None
    stress_load_rate: Array | None = None


def solve_position(pair: MeshingPair, pinion_angle: float, twist: float, *, tolerance: float = TOLERANCE) -> Position:
    """Solve the contact of a gear pair at one pinion angle (rad) and wheel twist (rad)."""
    return solve_positions(pair, np.array([pinion_angle]), twist, tolerance=tolerance)[0]


def solve_positions(
    pair: MeshingPair, pinion_angles: Array, twists: Array | float, *, tolerance: float = TOLERANCE
) -> list[Position]:
    """Solve the contact of a gear pair at several positions.

    Parameters
    ----------
    pinion_angles : ndarray, shape (n,)
        rad.
    twists : float or ndarray, shape (n,)
        Wheel twist (rad).
    tolerance
        Relative residual of the contact pressures, sum w |p - p(g, sigma)| / sum w p.
    """
    angles = np.atleast_1d(np.asarray(pinion_angles, dtype=float))
    twist = np.broadcast_to(np.asarray(twists, dtype=float), angles.shape)
    made: list[Position] = []
    for first in range(0, len(angles), BATCH):
        part = slice(first, first + BATCH)
        made += _solve_batch(pair, angles[part], twist[part], tolerance)
    return made


def _solve_batch(pair: MeshingPair, angles: Array, twists: Array, tolerance: float) -> list[Position]:
    found = overlaps(pair, angles, twists)
    positions: list[Position | None] = [None] * len(angles)
    for i in (i for i, overlapping in enumerate(found) if not overlapping):
        clear = rigidly_apart(pair, angles[i], twists[i])
        positions[i] = _unsolved("no_contact" if clear else "under_resolved")
    facing = [i for i, overlapping in enumerate(found) if overlapping]
    if in_lockstep(pair.law):
        facing = _quickly(pair, angles, twists, found, facing, positions, tolerance)
    windows = {i: windows_of(pair, found[i], angles[i], twists[i]) for i in facing}
    for group in _groups([windows[i][-1].nodes.stop for i in facing]):
        places = [facing[k] for k in group]
        scenes = assemble_all(pair, [windows[i] for i in places])
        seen = [(scene.rigid.gap < 0).any() for scene in scenes]
        for i in (i for i, one in zip(places, seen, strict=True) if not one):
            positions[i] = _unsolved("under_resolved")
        places = [i for i, one in zip(places, seen, strict=True) if one]
        scenes = [scene for scene, one in zip(scenes, seen, strict=True) if one]
        outcomes = _side_by_side(scenes, [_solving(pair, s, tolerance) for s in scenes])
        for i, scene, outcome in zip(places, scenes, outcomes, strict=True):
            if outcome.status != "converged" or _outgrown(pair, scene, outcome):
                positions[i] = _with_care(pair, angles[i], twists[i], found[i], outcome.iterations, tolerance)
            else:
                positions[i] = _finish(scene, outcome, outcome.iterations)
    return [p for p in positions if p is not None]


def _quickly(
    pair: MeshingPair,
    angles: Array,
    twists: Array,
    found: Sequence[list[Overlap]],
    facing: Sequence[int],
    positions: list[Position | None],
    tolerance: float,
) -> list[int]:
    """Solve the positions `facing` in lockstep; the answer are those for which that was not enough."""
    left: list[int] = []
    waiting = list(facing)
    for reach, softly in ((CLOSE, False), (REACH, False), (REACH, True)):
        if softly:
            if pair.law.uses_stress:
                break
            waiting, left = sorted(left + waiting), []
        windows = {i: windows_of(pair, found[i], angles[i], twists[i], reach) for i in waiting}
        outgrew: list[int] = []
        for group in _groups([windows[i][-1].nodes.stop for i in waiting]):
            places = [waiting[k] for k in group]
            made = solve_group(pair, [windows[i] for i in places], [found[i] for i in places], tolerance, softly=softly)
            for i, position in zip(places, made, strict=True):
                if position.status == "converged":
                    positions[i] = position
                else:
                    (outgrew if position.status == "outgrown" else left).append(i)
        waiting = outgrew
    return sorted(left + waiting)


def solve_group(
    pair: MeshingPair,
    windows: Sequence[Sequence[Window]],
    found: Sequence[list[Overlap]],
    tolerance: float,
    *,
    softly: bool = False,
) -> list[Position]:
    """Positions with these windows, solved in lockstep, perhaps by way of softer laws: ``converged``, ``not_converged``

    or ``outgrown``.
    """
    group = gather(pair, windows)
    deepest = np.array([one.deepest[g] for overlapping in found for g in (0, 1) for one in overlapping])
    rigid = rigid_projection(pair, group, deepest)
    pressure, forces = starting_states(pair, group, rigid)
    for share in SOFTER if softly else ():
        softer = iterate(
            replace(group, parameter=share * group.parameter), pressure, forces, rigid, SOFT_TOLERANCE, SOFT_TOLERANCE
        )
        at_points, at_nodes = softer.converged[group.at], softer.converged[group.position[group.node_window]]
        pressure = np.where(at_points, softer.motion.pressure, pressure)
        forces = np.where(np.repeat(at_nodes, 2), softer.motion.forces, forces)
    outcomes = iterate(group, pressure, forces, rigid, tolerance)
    beyond = outgrown(group, outcomes.motion)
    outcomes = replace(outcomes, converged=outcomes.converged & ~beyond)
    results = results_of(pair, group, outcomes)
    scenes = scenes_of(pair, group, rigid, (results.forces, results.force_rate), outcomes.motion.pressure)
    made: list[Position] = []
    for b, (scene, pressed, loads, rate) in enumerate(scenes):
        steps = int(outcomes.iterations[b])
        if not outcomes.converged[b]:
            made.append(_unsolved("outgrown" if beyond[b] else "not_converged", steps))
            continue
        first, end = group.first_window[b : b + 2].tolist()
        made.append(
            Position(
                status="converged",
                torque_wheel=float(results.torque_wheel[b]),
                torque_pinion=float(results.torque_pinion[b]),
                torque_wheel_reaction=float(results.torque_wheel_reaction[b]),
                tangent=float(results.tangent[b]),
                pair_numbers=tuple(-1 - w.tooth for w in scene.windows[1::2]),
                pair_torques=results.window_torque[(first + end) // 2 : end],
                peak_pressure=float(results.peak_pressure[b]),
                iterations=steps,
                scene=scene,
                forces=loads,
                force_rate=rate,
                pressure=pressed,
            )
        )
    return made


def in_lockstep(law: ContactLaw) -> bool:
    """Whether the lockstep iteration serves the law: p = max(0, -gamma g - s sigma_n) on sides that no position moves,
    and no term in the variation of the stress.
    """
    return law.theta == 0 and law.multiplier is None and law.sides != "tip"


def _groups(nodes: Sequence[int]) -> list[list[int]]:
    """Consecutive positions whose dense matrices, of `nodes` nodes each, fit into `GROUP_BYTES` together."""
    groups: list[list[int]] = [[]] if nodes else []
    held = 0
    for i, count in enumerate(nodes):
        size = 8 * 3 * (2 * count) ** 2  # compliance, and about twice as many stress rows
        if groups[-1] and held + size > GROUP_BYTES:
            groups.append([])
            held = 0
        groups[-1].append(i)
        held += size
    return groups


def _start(pair: MeshingPair, scene: Scene) -> State:
    pressure, forces = starting_state(pair, scene)
    return State(pressure, forces, scene.compliance @ forces, scene.rigid.place)


def _side_by_side(scenes: Sequence[Scene], dialogues: Sequence[Dialogue]) -> list[Outcome]:
    """Run all iterations to their ends, answering their requests for projections together."""
    outcomes: dict[int, Outcome] = {}
    requests: dict[int, tuple[Array, Array]] = {i: next(d) for i, d in enumerate(dialogues)}
    while requests:
        waiting = list(requests)
        nodes, feet = [requests[i][0] for i in waiting], [requests[i][1] for i in waiting]
        answers: list[Projection] = project_all([scenes[i] for i in waiting], nodes, feet)
        requests = {}
        for i, answer in zip(waiting, answers, strict=True):
            try:
                requests[i] = dialogues[i].send(answer)
            except StopIteration as done:
                outcomes[i] = done.value
    return [outcomes[i] for i in range(len(scenes))]


def _outgrown(pair: MeshingPair, scene: Scene, outcome: Outcome) -> bool:
    """Whether the contact reaches the rim of a window that could be larger, or what lies behind it."""
    loaded, found = outcome.state.pressure > 0, outcome.projection
    for i, w in enumerate(scene.windows):
        mine = np.flatnonzero(scene.owner == i)
        first, last = w.first_edge > 0, w.first_edge + w.edges < pair.bodies[w.gear].flank.edges
        if len(mine):
            q = len(mine) // w.edges
            if (first and loaded[mine[:q]].any()) or (last and loaded[mine[-q:]].any()):
                return True
        facing = (scene.mate == i) & found.beyond
        if (first and (found.place[facing] <= 0).any()) or (last and (found.place[facing] >= w.edges).any()):
            return True
    return False


def _with_care(
    pair: MeshingPair, angle: float, twist: float, found: list[Overlap], steps: int, tolerance: float
) -> Position:
    """Second attempt on the whole overlap; where that fails too, the twist is raised in steps, each from the last."""
    scene = assemble(pair, windows_of(pair, found, angle, twist, WHOLE))
    outcome = _side_by_side([scene], [_solving(pair, scene, tolerance)])[0]
    steps += outcome.iterations
    done, step, last = 0.0, 0.25, None
    while outcome.status != "converged" and step > 0.01 and steps < MAX_STEPS:
        share = min(1.0, done + step)
        turned = tuple(replace(w, angle=pair.tooth_angle(w.gear, w.tooth, angle, share * twist)) for w in scene.windows)
        part = assemble(pair, turned)
        if not (part.rigid.gap < 0).any():
            done = share
            if share >= 1.0:
                break
            continue
        tried = _alone(part, _start(pair, part) if last is None else last.scaled(share / done), tolerance)
        steps += tried.iterations
        if tried.status == "converged":
            done, step = share, 1.5 * step
            last = replace(tried.state, place=tried.projection.place)
            if share >= 1.0:
                scene, outcome = part, tried
        else:
            step *= 0.5
    return _finish(scene, outcome, steps) if outcome.status == "converged" else _unsolved(outcome.status, steps)


def _solving(pair: MeshingPair, scene: Scene, tolerance: float) -> Dialogue:
    """Newton's method from the Hertzian guess; for laws without stress by way of softer ones."""
    state = _start(pair, scene)
    if pair.law.uses_stress or scene.hats is not None:
        return (yield from newton(scene, state, tolerance))
    share, factor, solved, steps = SOFTEST, SOFTNESS_STEP, 0.0, 0
    while True:
        softer = scene if share == 1.0 else replace(scene, parameter=share * scene.parameter)
        outcome = yield from newton(softer, state, SOFT_TOLERANCE if share < 1.0 else tolerance, SOFT_ITERATIONS)
        steps += outcome.iterations
        if outcome.status == "converged":
            if share == 1.0:
                break
            state, solved = replace(outcome.state, place=outcome.projection.place), share
        else:
            factor = np.sqrt(factor)
            if solved == 0.0 or factor < SMALLEST_STEP:
                outcome = yield from newton(scene, state, tolerance)
                steps += outcome.iterations
                break
        share = min(1.0, factor * solved)
    return replace(outcome, iterations=steps)


def _alone(scene: Scene, start: State, tolerance: float) -> Outcome:
    return _side_by_side([scene], [newton(scene, start, tolerance)])[0]


def _finish(scene: Scene, outcome: Outcome, iterations: int) -> Position:
    state = outcome.state
    active = np.flatnonzero(state.unknown > 0)
    placed = scene.placed(state.displacement)
    lin = linearise(scene, outcome.projection, active, state.pressure, placed)
    forces = np.zeros(2 * len(scene.points))
    forces[lin.unknowns] = lin.weighted @ state.unknown[active]
    force = np.matmul(scene.rotation, forces.reshape(-1, 2, 1))[:, :, 0]
    wheel = scene.of_wheel
    about_wheel = -_moment(placed - scene.wheel_centre, force)
    reaction = -_moment(scene.points - scene.wheel_centre, force)
    of_pair = scene.windows[1::2]
    tangent, force_rate, solved = _tangent(scene, lin, forces, placed)
    load_rate = np.zeros(len(scene.weight) if scene.theta else 0)
    if scene.theta:
        load_rate[active] = lin.relief * solved
    return Position(
        status="converged",
        torque_wheel=float(about_wheel[wheel].sum()),
        torque_pinion=-float(_moment(placed, force)[~wheel].sum()),
        torque_wheel_reaction=float(reaction[wheel].sum()),
        tangent=tangent,
        pair_numbers=tuple(-1 - w.tooth for w in of_pair),
        pair_torques=np.array([about_wheel[w.nodes].sum() for w in of_pair]),
        peak_pressure=float(state.pressure[~unreached(outcome.projection.gap)].max()),
        iterations=iterations,
        scene=replace(  # without the megabytes
            scene, compliance=np.zeros((0, 0)), stress=np.zeros((0, 0)), stress_stress=np.zeros((0, 0))
        ),
        forces=forces,
        force_rate=force_rate,
        pressure=np.where(unreached(outcome.projection.gap), 0.0, state.pressure),
        stress_loads=state.stress_loads,
        stress_load_rate=load_rate,
    )


def _moment(arm: Array, force: Array) -> Array:
    return arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]


def _tangent(scene: Scene, lin: Linearised, forces: Array, placed: Array) -> tuple[float, Array, Array]:
    """d torque / d twist, d forces / d twist and d (active unknowns) / d twist.

    In the axes of the wheel's teeth the wheel's nodes are carried by e_z x (x - c) dphi, and
    df = G^T W dp + H dx - dphi e_z x f,  dx = carried + C df,  dp = -gamma dg - S df.
    """
    nodes = lin.unknowns[::2] // 2
    wheel = scene.of_wheel[nodes][:, None]
    axes = scene.rotation[nodes]
    arm = np.matmul((placed - scene.wheel_centre)[nodes][:, None, :], axes)[:, 0, :]
    force = forces[lin.unknowns].reshape(-1, 2)
    carried = np.where(wheel, _quarter_turn(arm), 0.0).ravel()
    frame = np.where(wheel, _quarter_turn(force), 0.0).ravel()
    right = lin.response @ frame - lin.parameter * (lin.opening @ carried)
    solved, rate = lin.solve(right, carried - lin.compliance @ frame)
    moved = carried + lin.moved(solved, rate - frame)
    change = _moment(arm, (rate - frame).reshape(-1, 2)) + _moment((moved - carried).reshape(-1, 2), force)
    spread = np.zeros_like(forces)
    spread[lin.unknowns] = rate - frame
    return -float(change[wheel[:, 0]].sum()), spread, solved


def _quarter_turn(vectors: Array) -> Array:
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


def _unsolved(status: str, iterations: int = 0) -> Position:
    nothing = 0.0 if status == "no_contact" else float("nan")
    return Position(status, nothing, nothing, nothing, nothing, (), np.zeros(0), nothing, iterations)
