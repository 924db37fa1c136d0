"""Steady states of a train over its speed: `steady_state` at one, `run_up` along a range, all branches that join."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.progress import count, one_thread, stage
from ...base.shown import ShownTable
from ...base.typing import Array, ComplexArray
from ..train.kinematics import drive_sense
from ..train.model import TrainModel
from .balance import Orbit, settled, size_of, solve
from .columns import runup_columns
from .condensed import CondensedTrain, condense, unmatched
from .first import first_motion
from .follow import Curve, Turn, follow
from .results import SteadyState, steady_result
from .stability import Bifurcation, kind_of, multipliers


@dataclass(frozen=True, eq=False, repr=False)
class RunUp(ShownTable):
    """Steady states along a range of speeds.

    Attributes
    ----------
    train
        The condensed train.
    speeds : (n,)
        Given speeds (rad/s).
    states
        Steady states at these speeds in the order in which their curve passes them: on branch 0 upwards, after a
        turning point on branch 1 back, after the next one on branch 2 upwards again. There is also one next to each
        turning point, as the last of its branch.
    turning_speeds : (turns,)
        Speeds of the turning points (rad/s) in the order in which the curves pass them; `bifurcations` name branches.
    bifurcations
        Where motions change their stability: turning points, period doubling, Neimark-Sacker; only turning points
        without multipliers.
    notes
        What could not be followed, and why.
    tolerance, band_hz
        Given tolerance (parts of the approach under the steady force) and highest frequency of interest (Hz).
    """

    train: CondensedTrain
    speeds: Array
    states: tuple[SteadyState, ...]
    turning_speeds: Array
    bifurcations: tuple[Bifurcation, ...]
    notes: tuple[str, ...]
    tolerance: float
    band_hz: float

    def facts(self) -> dict[str, str]:
        """Speeds, states and what happens between them."""
        unstable = sum(state.stable is False for state in self.states)
        return {
            "speeds": f"{len(self.speeds)}, {self.speeds[0]:.4g} to {self.speeds[-1]:.4g} rad/s",
            "steady states": f"{len(self.states)}, {unstable} of them unstable",
            "turning points": ", ".join(f"{speed:.5g}" for speed in self.turning_speeds) or "none",
            "teeth apart": f"at {sum(bool(state.apart.any()) for state in self.states)} states",
        }

    def columns(self) -> dict[str, Any]:
        """The table runup.csv: a row for each steady state, along the curve."""
        return runup_columns(self.train, self.states, self.band_hz)

    def sweep(self, *, up: bool = True) -> tuple[SteadyState, ...]:
        """One state at each speed that was reached: what a slow run-up, or a slow run-down, meets there.

        Where a branch ends, or is no longer stable, the motion jumps to the remaining stable one. Where no stable one
        is known, the first of all is taken; its `stable` is false.
        """
        found: dict[float, list[SteadyState]] = {}
        given = set(self.speeds.tolist())
        for state in (s for s in self.states if s.speed in given):
            found.setdefault(state.speed, []).append(state)
        made = []
        for speed in sorted(found, key=abs):
            left = [s for s in found[speed] if s.stable or (s.stable is None and s.branch % 2 == 0)] or found[speed]
            made.append(min(left, key=lambda s: s.branch if up else -s.branch))
        return tuple(made)


def steady_state(
    model: TrainModel, speed: float, guess: SteadyState | None = None, *, tolerance: float = 1e-3,
    band_hz: float = 5000.0, stability: bool = True,
) -> SteadyState:  # fmt: skip
    """Steady running of a train at a speed of its drive, by harmonic balance.

    Parameters
    ----------
    model
        From `gearfe.drivetrain.train.build_train`; loads have their final values.
    speed
        Speed of the drive (rad/s), with the sign of the model's.
    guess
        A state to begin with, such as that of a neighbouring speed: it decides between two branches.
    tolerance
        Of the meshes' approaches, in parts of those under the steady force.
    band_hz
        Harmonics reach this frequency at least (Hz).
    stability
        Compute Floquet multipliers.

    Raises
    ------
    InputError
        For a train or speed that has no steady state, and where none was found.
    """
    _checked(model, [speed])
    train = condense(model, speeds=[speed])
    reason = unmatched(train, speed)
    if reason:
        raise InputError("speed", float(speed), f"has no periodic motion: {reason}", "look at it with gearfe vibration")
    with one_thread():
        highest = _highest(train, band_hz, speed)
        if guess is None:
            made = first_motion(train.system, float(speed), tolerance=tolerance, highest=highest)
        else:
            places = guess.orbit.with_harmonics(max(train.system.harmonics(speed, highest), guess.orbit.harmonics))
            made = settled(train.system, *solve(train.system, float(speed), places, tolerance), tolerance)
    if made is None or not made.found:
        problem = "has no periodic motion that was found"
        cure = "give a guess from a neighbouring speed (run_up finds them), more damping, or look at a transient"
        raise InputError("speed", float(speed), problem, cure)
    with one_thread():
        found = multipliers(train.system, made) if stability else None
    return steady_result(train, made, 0, found)


def run_up(
    model: TrainModel, speeds: ArrayLike, *, tolerance: float = 1e-3, band_hz: float = 5000.0, stability: bool = True,
    executor: Executor | None = None,
) -> RunUp:  # fmt: skip
    """Find the steady states of a train along a range of speeds, beyond turning points of their curve.

    Parameters
    ----------
    model : TrainModel
        The train.
    speeds : array_like, shape (n,)
        Speeds of the drive (rad/s), all of one sign, rising or falling in size.
    tolerance, band_hz, stability
        See `steady_state`.
    executor : Executor, optional
        Computes multipliers in parallel; None: one after the other.

    Raises
    ------
    InputError
        For speeds that contain zero or change sign, and trains without a steady state.
    """
    given = _checked(model, speeds)
    train = condense(model, speeds=given.tolist())
    made = _Curves([], [], [])
    lost: list[float] = []
    options: dict[str, Any] = {"tolerance": tolerance, "highest": _highest(train, band_hz, float(np.abs(given).max()))}
    with one_thread():
        begin = 0
        unmatched_orders = any(unmatched(train, float(speed)) for speed in given)
        if unmatched_orders or not all(torque.per_turn for torque in train.forces.torques):  # each speed by itself
            lost += _one_by_one(train, given, made, options)
            begin = len(given)
        while begin < len(given):
            count(begin, len(given) - 1, "speeds")
            with stage("first motion"):
                start = first_motion(train.system, float(given[begin]), **options)
            if start is None:
                lost.append(float(given[begin]))
                begin += 1
                continue
            with stage("back"):
                back = follow(train.system, given[begin::-1], start, **options) if begin else None
            curve = follow(train.system, given[begin:], start, **options)
            made.join(back, curve, train.system.scale)
            passed = {o.speed for o in curve.orbits}
            reached = max(k for k in range(begin, len(given)) if given[k] in passed)
            if curve.note:
                made.notes.append(curve.note)
            elif reached + 1 < len(given):
                turned = f"the motions from {given[begin]:.6g} rad/s on turn back and leave the range where they began"
                made.notes.append(f"{turned}; others were looked for from {given[reached + 1]:.6g} rad/s on")
            begin = reached + 1
        orbits = made.orbits
        found: list[ComplexArray | None] = [None] * len(orbits)
        if stability:
            ways = map if executor is None else executor.map
            found = list(ways(partial(multipliers, train.system), [orbit for orbit, _ in orbits]))
    states = tuple(steady_result(train, *orbit, each) for orbit, each in zip(orbits, found, strict=True))
    missing = [speed for speed in lost if all(orbit.speed != speed for orbit, _ in orbits)]
    notes = [*made.notes, *([_unfound(missing)] if missing else [])]
    turning = np.array([turn.speed for turn in made.turns])
    return RunUp(train, given, states, turning, _bifurcations(states, made.turns), tuple(notes), tolerance, band_hz)


def _highest(train: CondensedTrain, band_hz: float, speed: float) -> float:
    """Angular frequency (rad/s) that harmonics reach at least: that of the band, and twice those of torques."""
    return max(2.0 * math.pi * band_hz, *(2.0 * torque.at_speed(speed) for torque in train.forces.torques), 0.0)


def _one_by_one(train: CondensedTrain, speeds: Array, made: _Curves, options: dict[str, Any]) -> list[float]:
    """Motions at speeds that have no curve between them, since a torque has a frequency of its own; those not found."""
    lost: list[float] = []
    refused: list[tuple[float, str]] = []
    for number, speed in enumerate(speeds.tolist()):
        count(number, len(speeds) - 1, "speeds")
        reason = unmatched(train, speed)
        if reason:
            refused.append((speed, reason))
            continue
        with stage("first motion"):
            orbit = first_motion(train.system, speed, **options)
        if orbit is None:
            lost.append(speed)
        else:
            made.orbits.append((orbit, 0))
    if refused:
        many = f"at {len(refused)} of {len(speeds)} speeds no motion was sought: at {refused[0][0]:.9g} rad/s "
        made.notes.append(
            many + refused[0][1] + "; look at it with gearfe vibration, or write orders, which follow the speed"
        )
    return lost


def _unfound(speeds: Sequence[float]) -> str:
    """Speeds without a motion that was found."""
    many = f"{len(speeds)} speeds, {speeds[0]:.6g} to " if len(speeds) > 1 else ""
    return (
        f"no motion with the periods of the meshes was found at {many}{speeds[-1]:.6g} rad/s: what runs there may "
        "never repeat; look at a transient"
    )


class _Curves(NamedTuple):
    """What was found so far: orbits with the numbers of their branches, turning points with the branch before."""

    orbits: list[tuple[Orbit, int]]
    turns: list[Bifurcation]
    notes: list[str]

    def join(self, back: Curve | None, ahead: Curve, scale: Array) -> None:
        """Add a curve that was followed both ways from one orbit; what its way back meets of those before is left out.

        Branches with even numbers rise, so numbers of a curve may begin one farther; a gap is no turning point.
        """
        behind, turns = ([], ()) if back is None else self._new(back, scale)
        first = (max(b for _, b in self.orbits) if self.orbits else 0) + len(turns)
        first += first % 2
        ends = [(turns[j].speed, first - j - 1) for j in reversed(range(len(turns)))]
        ends += [(turn.speed, first + j) for j, turn in enumerate(ahead.turns)]
        self.turns.extend(Bifurcation(speed, "turning point", branch) for speed, branch in ends)
        self.orbits.extend((orbit, first - branch) for orbit, branch in reversed(behind))
        self.orbits.extend((orbit, first + branch) for orbit, branch in zip(ahead.orbits, ahead.branch, strict=True))

    def _new(self, back: Curve, scale: Array) -> tuple[list[tuple[Orbit, int]], Sequence[Turn]]:
        """Orbits of a way back behind its first, up to one that is known, and the turning points among them."""
        found: list[tuple[Orbit, int]] = []
        for orbit, branch in zip(back.orbits[1:], back.branch[1:], strict=True):
            if any(_same(orbit, known, scale) for known, _ in self.orbits):
                break
            found.append((orbit, branch))
        return found, [turn for turn in back.turns if turn.number <= len(found)]


def _same(one: Orbit, two: Orbit, scale: Array) -> bool:
    """Whether two orbits at a speed differ by no more than their errors."""
    count = max(one.harmonics, two.harmonics)
    return one.speed == two.speed and bool(
        size_of(one.with_harmonics(count) - two.with_harmonics(count), scale) <= one.error + two.error
    )


def _bifurcations(states: Sequence[SteadyState], turns: Sequence[Bifurcation]) -> tuple[Bifurcation, ...]:
    """Turning points, and where a branch's largest multiplier passes the unit circle."""
    found = list(turns)
    for one, two in itertools.pairwise(s for s in states if not math.isnan(s.error)):  # without those at turning points
        if one.branch != two.branch or None in (one.stable, two.stable) or one.stable == two.stable:
            continue
        assert one.multipliers is not None
        assert two.multipliers is not None
        a, b = abs(one.multipliers[0]) - 1.0, abs(two.multipliers[0]) - 1.0
        speed = one.speed + (two.speed - one.speed) * a / (a - b)
        kind = kind_of(one.multipliers, two.multipliers) if math.isfinite(one.period) else "loss of stability"
        found.append(Bifurcation(float(speed), kind, one.branch))
    return tuple(sorted(found, key=lambda b: b.branch))


def _checked(model: TrainModel, speeds: ArrayLike | Sequence[float]) -> Array:
    if model.train.driven.torque is not None:
        problem = "is by torque, and steady states are those at a speed"
        raise InputError("drive", None, problem, "leave the torque out: the drive's speed is then prescribed")
    given = np.atleast_1d(np.asarray(speeds, dtype=float))
    sizes = np.abs(given)
    if not len(given) or not np.isfinite(given).all() or (sizes == 0.0).any() or np.ptp(np.sign(given)) > 0.0:
        shown = f"{given.min():.6g} to {given.max():.6g}" if len(given) else "none"
        problem = f"contain zero, change sign or are not finite: {shown} rad/s"
        raise InputError("speeds", None, problem, "ask for speeds of one sense; a train at rest has no orders")
    if len(given) > 1 and not ((np.diff(sizes) > 0.0).all() or (np.diff(sizes) < 0.0).all()):
        raise InputError("speeds", None, "do not rise or fall all the way", "sort them, each once")
    sense = drive_sense(model.train.driven.speed)
    if sense * given[0] < 0.0:
        problem = "turns against the drive of the model, whose driving flanks are others"
        raise InputError("speeds", float(given[0]), problem, "build the model with a drive of this sense")
    return given
