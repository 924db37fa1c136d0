"""Steady states of a train over its speed: `steady_state` at one, `run_up` along a range, all branches that join."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..threads import one_thread
from ..train.kinematics import drive_sense
from ..train.model import TrainModel
from ..typing import Array
from .balance import Orbit, settled, solve
from .condensed import CondensedTrain, condense
from .follow import Curve, follow
from .results import SteadyState, steady_result

#: Where no motion is found at the first speed, others are tried so many times as far away, each a part of it farther.
TRIES, AWAY = 12, 0.01


@dataclass(frozen=True, eq=False)
class RunUp:
    """Steady states along a range of speeds.

    Attributes
    ----------
    train
        The condensed train.
    speeds : (n,)
        Asked speeds (rad/s).
    states
        Steady states at these speeds in the order in which their curve passes them: on branch 0 upwards, after a
        turning point on branch 1 back, after the next one on branch 2 upwards again.
    turning_speeds : (turns,)
        Speeds of the turning points (rad/s), between branch 0 and 1, 1 and 2, ...
    notes
        What could not be followed, and why.
    tolerance, band_hz
        Asked error (parts of the approach under the steady force) and highest frequency of interest (Hz).
    """

    train: CondensedTrain
    speeds: Array
    states: tuple[SteadyState, ...]
    turning_speeds: Array
    notes: tuple[str, ...]
    tolerance: float
    band_hz: float

    def sweep(self, *, up: bool = True) -> tuple[SteadyState, ...]:
        """One state at each speed that was reached: what a slow run-up, or a slow run-down, meets there.

        At a turning point the motion jumps to the branch that is left.
        """
        found: dict[float, SteadyState] = {}
        for state in self.states:
            before = found.get(state.speed)
            if state.branch % 2 == 0 and (before is None or (state.branch > before.branch) is not up):
                found[state.speed] = state
        return tuple(found[speed] for speed in sorted(found, key=abs))


def steady_state(
    model: TrainModel, speed: float, guess: SteadyState | None = None, *, tolerance: float = 1e-3,
    band_hz: float = 5000.0,
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
    return steady_result(train, made, 0)


def run_up(
    model: TrainModel, speeds: ArrayLike, *, tolerance: float = 1e-3, band_hz: float = 5000.0,
    progress: Callable[[int, int], None] | None = None,
) -> RunUp:  # fmt: skip
    """Steady states of a train along a range of speeds, round the turning points of their curve.

    Parameters
    ----------
    speeds : array_like, shape (n,)
        Speeds of the drive (rad/s), all of one sign, rising or falling in size.
    tolerance, band_hz
        See `steady_state`.
    progress
        Called with the number of the speed reached and of the last.

    Raises
    ------
    InputError
        For speeds that contain zero or change sign, and trains without a steady state.
    """
    asked = _checked(model, speeds)
    train, notes = condense(model), []
    states: list[SteadyState] = []
    turns: list[float] = []
    left = asked
    with one_thread():
        while len(left):
            start = _first(train, float(left[0]), None, tolerance, band_hz)
            if start is None:
                notes.append(f"no periodic motion was found at {left[0]:.6g} rad/s")
                left = left[1:]
                continue
            options = {"tolerance": tolerance, "highest": 2.0 * math.pi * band_hz, "progress": progress}
            curve = follow(train.system, left, start, **options)  # type: ignore[arg-type]
            first = len(turns)
            states += _results(train, curve, 2 * math.ceil(first / 2))
            turns += [turn.speed for turn in curve.turns]
            if not curve.note:
                break
            notes.append(curve.note)
            reached = max(range(len(left)), key=lambda k: any(o.speed == left[k] for o in curve.orbits) * (k + 1))
            left = left[reached + 1 :]
    return RunUp(train, asked, tuple(states), np.array(turns), tuple(notes), tolerance, band_hz)


def _results(train: CondensedTrain, curve: Curve, first: int) -> list[SteadyState]:
    return [steady_result(train, o, first + b) for o, b in zip(curve.orbits, curve.branch, strict=True)]


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
        orbit, newton = solve(system, away, places, tolerance)
        orbit, _ = settled(system, orbit, newton, tolerance)
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
    asked = np.atleast_1d(np.asarray(speeds, dtype=float))
    sizes = np.abs(asked)
    if not len(asked) or not np.isfinite(asked).all() or (sizes == 0.0).any() or np.ptp(np.sign(asked)) > 0.0:
        shown = f"{asked.min():.6g} to {asked.max():.6g}" if len(asked) else "none"
        problem = f"contain zero, change sign or are not finite: {shown} rad/s"
        raise InputError("speeds", None, problem, "ask for speeds of one sense; a train at rest has no orders")
    if len(asked) > 1 and not ((np.diff(sizes) > 0.0).all() or (np.diff(sizes) < 0.0).all()):
        raise InputError("speeds", None, "do not rise or fall all the way", "sort them, each once")
    assert model.scene.drive is not None
    sense = drive_sense(model.scene.drive.speed)
    if sense * asked[0] < 0.0:
        problem = "turns against the drive of the model, whose driving flanks are others"
        raise InputError("speeds", float(asked[0]), problem, "build the model with a drive of this sense")
    return asked
