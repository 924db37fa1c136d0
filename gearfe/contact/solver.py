"""Positions of a gear pair in contact: search for the teeth that overlap, and Newton's method.

Two iterations solve the same equations. Most positions are solved in lockstep, on windows that just hold the contact
(`gearfe.contact.group_newton`); those that outgrow them once more on larger ones. What does not converge there, or has
a law that the lockstep does not know, goes to the general iteration (`gearfe.contact.newton`), and where that fails
too the twist is raised in steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Projection
from .group import gather, rigid_projection
from .group_newton import iterate
from .group_results import outgrown, results_of, scenes_of
from .group_start import starting_states
from .laws import ContactLaw
from .newton import Dialogue, Outcome, State, newton
from .overlap import CLOSE, REACH, WHOLE, Overlap, overlaps, rigidly_apart, windows_of
from .position import Position, finish, unsolved
from .scene import MeshingPair, Scene, Window, assemble, assemble_all, project_all
from .start import starting_state

__all__ = [
    "Position",
    "in_lockstep",
    "solve_group",
    "solve_on_whole_windows",
    "solve_position",
    "solve_positions",
    "stable",
]

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
#: A law with multipliers starts from a penalty so many times its complementarity parameter: near the contact without
#: overlap, where that parameter's own overlap would tell too many points to bear.
STIFFER = 30.0
#: Newton steps of a law with multipliers from the Hertzian guess, unless it is nearly done. A corner that dents deeply
#: has several equilibria on one mesh; what is not found soon is left to the penalty, by way of which both gears have
#: mostly found the same one.
SOON = 15
#: Accuracy of the softer solutions, and Newton steps for each.
SOFT_TOLERANCE, SOFT_ITERATIONS = 1e-2, 20
#: Newton steps spent on one difficult position before it is given up, where so many points lie inside the mate; where
#: there are more, so many fewer that the matrices cost no more.
MAX_STEPS, USUAL_POINTS = 320, 350
#: The twist is raised for this many steps in any case.
LEAST_STEPS = 40


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
        made += [stable(p) for p in _solve_batch(pair, angles[part], twist[part], tolerance)]
    return made


def solve_on_whole_windows(pair: MeshingPair, angle: float, twist: float, *, tolerance: float = TOLERANCE) -> Position:
    """One position (rad, rad) once more, from the Hertzian guess where all that overlaps may bear: a check of the usual
    windows, which are narrower and take longer where contact reaches their rims.
    """
    (found,) = overlaps(pair, np.array([angle]), np.array([twist]))
    if not found:
        return unsolved("no_contact")
    scene = assemble(pair, windows_of(pair, found, angle, twist, WHOLE))
    (outcome,) = _side_by_side([scene], [_solving(pair, scene, tolerance)])
    if outcome.status != "converged":
        return unsolved(outcome.status, outcome.iterations)
    return stable(finish(scene, outcome, outcome.iterations))


def stable(position: Position) -> Position:
    """The position, or ``not_converged`` where its torque falls with the twist: no gear pair rests there.

    Sharp corners that dent by a fifth of a module snap from one place of the mate to the next.
    """
    if position.status == "converged" and not position.tangent > 0:
        return unsolved("not_converged", position.iterations)
    return position


def _solve_batch(pair: MeshingPair, angles: Array, twists: Array, tolerance: float) -> list[Position]:
    found = overlaps(pair, angles, twists)
    positions: list[Position | None] = [None] * len(angles)
    for i in (i for i, overlapping in enumerate(found) if not overlapping):
        clear = rigidly_apart(pair, angles[i], twists[i])
        positions[i] = unsolved("no_contact" if clear else "under_resolved")
    facing = [i for i, overlapping in enumerate(found) if overlapping]
    if in_lockstep(pair.law):
        facing = _quickly(pair, angles, twists, found, facing, positions, tolerance)
    windows = {i: windows_of(pair, found[i], angles[i], twists[i]) for i in facing}
    for group in _groups([windows[i][-1].nodes.stop for i in facing]):
        places = [facing[k] for k in group]
        scenes = assemble_all(pair, [windows[i] for i in places])
        seen = [(scene.rigid.gap < 0).any() for scene in scenes]
        for i in (i for i, one in zip(places, seen, strict=True) if not one):
            positions[i] = unsolved("under_resolved")
        places = [i for i, one in zip(places, seen, strict=True) if one]
        scenes = [scene for scene, one in zip(scenes, seen, strict=True) if one]
        outcomes = _side_by_side(scenes, [_solving(pair, s, tolerance) for s in scenes])
        for i, scene, outcome in zip(places, scenes, outcomes, strict=True):
            if outcome.status != "converged" or _outgrown(pair, scene, outcome):
                failed = (windows[i], outcome)
                positions[i] = _with_care(pair, angles[i], twists[i], found[i], failed, tolerance)
            else:
                positions[i] = finish(scene, outcome, outcome.iterations)
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
    beyond = outgrown(group, outcomes.motion, rigid)
    outcomes = replace(outcomes, converged=outcomes.converged & ~beyond)
    results = results_of(pair, group, outcomes)
    scenes = scenes_of(pair, group, rigid, (results.forces, results.force_rate), outcomes.motion.pressure)
    made: list[Position] = []
    for b, (scene, pressed, loads, rate) in enumerate(scenes):
        steps = int(outcomes.iterations[b])
        if not outcomes.converged[b]:
            made.append(unsolved("outgrown" if beyond[b] else "not_converged", steps))
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
                pair_widths=results.half_width[first // 2 : end // 2],
                scene=scene,
                forces=loads,
                force_rate=rate,
                pressure=pressed,
            )
        )
    return made


def in_lockstep(law: ContactLaw) -> bool:
    """Whether the lockstep iteration serves the law: p = max(0, -gamma g - s sigma_n), and no term in the variation of
    the stress.
    """
    return law.theta == 0 and law.multiplier is None


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
    """Whether the contact reaches the rim of a window that could be larger, or what lies behind it; or would, see
    `group_results.outgrown`."""
    loaded, found = outcome.state.pressure > 0, outcome.projection
    bearing = set((scene.owner[loaded] // 2).tolist())
    for i, w in enumerate(scene.windows):
        mine = np.flatnonzero(scene.owner == i)
        first, last = w.first_edge > 0, w.first_edge + w.edges < pair.bodies[w.gear].flank.edges
        if len(mine):
            q = len(mine) // w.edges
            if (first and loaded[mine[:q]].any()) or (last and loaded[mine[-q:]].any()):
                return True
            deepest = int(np.argmin(scene.rigid.gap[mine]))
            at_rim = (first and deepest < q) or (last and deepest >= len(mine) - q)
            if at_rim and scene.rigid.gap[mine[deepest]] < 0 and i // 2 not in bearing:
                return True
        facing = (scene.mate == i) & found.beyond
        if (first and (found.place[facing] <= 0).any()) or (last and (found.place[facing] >= w.edges).any()):
            return True
    return False


def _with_care(
    pair: MeshingPair,
    angle: float,
    twist: float,
    found: list[Overlap],
    failed: tuple[Sequence[Window], Outcome],
    tolerance: float,
) -> Position:
    """Second attempt on the whole overlap; where that fails too, the twist is raised in steps, each from the last.

    `failed` are windows and outcome of the first attempt, which is not repeated if the same would be done again.
    """
    windows = windows_of(pair, found, angle, twist, WHOLE)
    scene = assemble(pair, windows)
    before, outcome = failed
    steps = outcome.iterations
    if pair.law.uses_stress or scene.hats is not None or list(windows) != list(before):
        outcome = _side_by_side([scene], [_solving(pair, scene, tolerance, by_penalty=True)])[0]
        steps += outcome.iterations
    inside = max(1, int((scene.rigid.gap < 0).sum()))
    most = max(steps + LEAST_STEPS, MAX_STEPS * min(1.0, (USUAL_POINTS / inside) ** 2))
    done, step, last, owner = 0.0, 0.25, None, scene.owner
    while outcome.status != "converged" and step > 0.01 and steps < most:
        share = min(1.0, done + step)
        turned = tuple(replace(w, angle=pair.tooth_angle(w.gear, w.tooth, angle, share * twist)) for w in scene.windows)
        part = assemble(pair, turned)
        if not (part.rigid.gap < 0).any():
            done = share
            if share >= 1.0:
                break
            continue
        # at another twist the law may set its points on the other gear: what was found there is no start then
        fits = last is not None and np.array_equal(owner, part.owner)
        tried = _alone(part, last.scaled(share / done) if last is not None and fits else _start(pair, part), tolerance)
        steps += tried.iterations
        if tried.status == "converged":
            done, step = share, 1.5 * step
            last, owner = replace(tried.state, place=tried.projection.place), part.owner
            if share >= 1.0:
                scene, outcome = part, tried
        else:
            step *= 0.5
    return finish(scene, outcome, steps) if outcome.status == "converged" else unsolved(outcome.status, steps)


def _solving(pair: MeshingPair, scene: Scene, tolerance: float, *, by_penalty: bool = False) -> Dialogue:
    """Newton's method from the Hertzian guess; for laws without stress by way of softer ones.

    Parameters
    ----------
    by_penalty
        Laws with stress or multipliers start from what a penalty at their points comes to, softened.
    """
    state, steps = _start(pair, scene), 0
    if pair.law.uses_stress or scene.hats is not None:
        if by_penalty:
            none = np.zeros((0, 0))
            stiffer = 1.0 if scene.hats is None else STIFFER
            plain = replace(
                scene, theta=0, stress=none, stress_stress=none, hats=None, parameter=stiffer * scene.parameter
            )
            softly = yield from _softened(plain, state, SOFT_TOLERANCE, SOFTEST / stiffer)
            steps = softly.iterations
            if softly.status == "converged":
                state = replace(softly.state, place=softly.projection.place)
        few = () if scene.hats is None or by_penalty else (SOON,)
        outcome = yield from newton(scene, state, tolerance, *few)
        return replace(outcome, iterations=steps + outcome.iterations)
    return (yield from _softened(scene, state, tolerance))


def _softened(scene: Scene, state: State, tolerance: float, softest: float = SOFTEST) -> Dialogue:
    """A law without stress by way of softer ones."""
    share, factor, solved, steps = softest, SOFTNESS_STEP, 0.0, 0
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
