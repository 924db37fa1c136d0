"""Steady states of a train over its speed: `steady_state` at one, `run_up` along a range, all branches that join."""

from __future__ import annotations

import importlib
import itertools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..shown import ShownTable
from ..threads import one_thread
from ..train.kinematics import drive_sense
from ..train.model import TrainModel
from ..typing import Array, ComplexArray
from .balance import Orbit, settled, solve
from .condensed import CondensedTrain, condense
from .follow import Curve, follow
from .results import SteadyState, steady_result
from .stability import Bifurcation, kind_of, multipliers

#: Where no motion is found at the first speed, others are tried so many times as far away, each a part of it farther.
TRIES, AWAY = 6, 0.01


@dataclass(frozen=True, eq=False, repr=False)
class RunUp(ShownTable):
    """Steady states along a range of speeds.

    Attributes
    ----------
    train
        The condensed train.
    speeds : (n,)
        Asked speeds (rad/s).
    states
        Steady states at these speeds in the order in which their curve passes them: on branch 0 upwards, after a
        turning point on branch 1 back, after the next one on branch 2 upwards again; and one next to each turning
        point, as the last of its branch.
    turning_speeds : (turns,)
        Speeds of the turning points (rad/s), between branch 0 and 1, 1 and 2, ...
    bifurcations
        Where motions change their stability: turning points, period doubling, Neimark-Sacker; only turning points where
        no multipliers were asked for.
    notes
        What could not be followed, and why.
    tolerance, band_hz
        Asked error (parts of the approach under the steady force) and highest frequency of interest (Hz).
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
        # tables stand above the run-up, so they are looked up where one is asked for
        made: dict[str, Any] = importlib.import_module(".report", __package__).runup_columns(self)
        return made

    def sweep(self, *, up: bool = True) -> tuple[SteadyState, ...]:
        """One state at each speed that was reached: what a slow run-up, or a slow run-down, meets there.

        Where a branch ends, or is stable no longer, the motion jumps to the stable one that is left; where none is
        known the first of all is taken, whose `stable` says so.
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
        From `gearfe.train.build_train`; the loads count as they are in the end.
    speed
        Of the drive (rad/s), in the sense of the model's.
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
    train = condense(model)
    _checked(model, [speed])
    with one_thread():
        made = _first(train, float(speed), None if guess is None else guess.orbit, tolerance, band_hz)
    if made is None:
        problem = "has no periodic motion that was found"
        cure = "give a guess from a neighbouring speed (run_up finds them), more damping, or look at a transient"
        raise InputError("speed", float(speed), problem, cure)
    with one_thread():
        found = multipliers(train.system, made) if stability else None
    return steady_result(train, made, 0, found)


def run_up(
    model: TrainModel, speeds: ArrayLike, *, tolerance: float = 1e-3, band_hz: float = 5000.0, stability: bool = True,
    executor: Executor | None = None, progress: Callable[[int, int], None] | None = None,
) -> RunUp:  # fmt: skip
    """Steady states of a train along a range of speeds, round the turning points of their curve.

    Parameters
    ----------
    speeds : array_like, shape (n,)
        Speeds of the drive (rad/s), all of one sign, rising or falling in size.
    tolerance, band_hz, stability
        See `steady_state`.
    executor
        Computes multipliers beside each other; None: one after the other.
    progress
        Called with the number of the speed reached and of the last.

    Raises
    ------
    InputError
        For speeds that contain zero or change sign, and trains without a steady state.
    """
    given = _checked(model, speeds)
    train, notes = condense(model), []
    orbits: list[tuple[Orbit, int]] = []
    turns: list[float] = []
    left = given
    with one_thread():
        while len(left):
            if progress is not None:
                progress(len(given) - len(left), len(given) - 1)
            start = _first(train, float(left[0]), None, tolerance, band_hz)
            if start is None:
                notes.append(f"no periodic motion was found at {left[0]:.6g} rad/s")
                left = left[1:]
                continue
            highest = 2.0 * math.pi * band_hz
            curve = follow(train.system, left, start, tolerance=tolerance, highest=highest, progress=progress)
            first = len(turns)
            orbits += _numbered(curve, orbits, first)
            turns += [turn.speed for turn in curve.turns]
            reached = max(range(len(left)), key=lambda k: any(o.speed == left[k] for o in curve.orbits) * (k + 1))
            missing = left[reached + 1 :]
            if curve.note:
                notes.append(curve.note)
            elif len(missing):
                back = f"the motions from {left[0]:.6g} rad/s on turn back and leave the range where they began"
                notes.append(f"{back}; others were looked for from {missing[0]:.6g} rad/s on")
            left = missing
        found: list[ComplexArray | None] = [None] * len(orbits)
        if stability:
            ways = map if executor is None else executor.map
            found = list(ways(partial(multipliers, train.system), [orbit for orbit, _ in orbits]))
    states = tuple(steady_result(train, *orbit, each) for orbit, each in zip(orbits, found, strict=True))
    changes = _bifurcations(states, turns)
    return RunUp(train, given, states, np.array(turns), changes, tuple(notes), tolerance, band_hz)


def _numbered(curve: Curve, before: Sequence[tuple[Orbit, int]], turns: int) -> list[tuple[Orbit, int]]:
    """Orbits with the numbers of their branches, going on from a curve before; a gap is no turning point."""
    first = turns + turns % 2 if before else 0
    return [(orbit, first + branch) for orbit, branch in zip(curve.orbits, curve.branch, strict=True)]


def _bifurcations(states: Sequence[SteadyState], turns: Sequence[float]) -> tuple[Bifurcation, ...]:
    """Turning points, and where a branch's largest multiplier passes the unit circle."""
    found = [Bifurcation(speed, "turning point", branch) for branch, speed in enumerate(turns)]
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


def _first(train: CondensedTrain, speed: float, guess: Orbit | None, tolerance: float, band_hz: float) -> Orbit | None:
    """Orbit at a speed from a guess, from rest, or along the curve from a speed nearby."""
    system, highest = train.system, 2.0 * math.pi * band_hz
    for number in range(1 if guess is not None else TRIES):
        away = speed * (1.0 + AWAY * number * (-1.0) ** number)
        count = system.harmonics(away, highest)
        if guess is not None:
            places = guess.with_harmonics(max(count, guess.harmonics))
        else:
            places = np.zeros((count + 1, system.linear.size), dtype=complex)
            places[0] = system.linear.rest
        orbit = settled(system, *solve(system, away, places, tolerance), tolerance)
        if not orbit.found:
            continue
        if number == 0:
            return orbit
        made = follow(system, [away, speed], orbit, tolerance=tolerance, highest=highest)
        there = [o for o in made.orbits if o.speed == speed]
        if there:
            return replace(there[0])
    return None


def _checked(model: TrainModel, speeds: ArrayLike | Sequence[float]) -> Array:
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
