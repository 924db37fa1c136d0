"""One call for all integrators: `integrate(system, times, method=..., tolerance=...)`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.progress import stage
from ...base.typing import Array
from ..core.dense import Dense
from ..core.elimination import is_linear, modal_coordinates
from ..core.mass_regularisation import loose_link
from ..core.modes import fastest_rate, rates
from ..core.start import Start, consistent_start
from ..core.steps import ROUNDING, Pace, Status
from ..core.stopped import locked, short_steps
from ..core.system import System
from ..core.trajectory import IntegrationError, Trajectory
from .collocation.run import run_implicit
from .collocation.scheme import GAUSS, RADAU
from .discontinuities import load_problem_ahead
from .taylor import run as taylor
from .taylor.modal import run_modal_taylor, series_force

Run = tuple[Dense, Status, dict[str, Any]]
#: Points of collocation by method.
COLLOCATION = {"implicit": RADAU, "symplectic": GAUSS}
#: Ends of runs whose cause is looked for.
UNFINISHED = (Status.STEP_TOO_SMALL, Status.NOT_FINITE, Status.NOT_SOLVED, Status.ENDLESS, Status.MOST_STEPS)
METHODS = ("auto", "taylor", *COLLOCATION)
#: Asked tolerance -> largest last term of a Taylor step. The benchmark mechanisms amplify local errors some
#: hundred times.
LOCAL_SHARE = 5e-4
#: The rule of `auto`: collocation where the fastest decay exceeds so many times the fastest vibration and, times the
#: duration, the second number, or the third in modal coordinates, where collocation is not compiled (measured:
#: docs/development/integrators.md).
OVERDAMPED, DECAYED, DECAYED_MODAL = 3.0, 3e3, 1e6
#: Fastest rate times the duration from which on steps of series are below the rounding of the run's time.
HOPELESS = 1e12
#: Steps of series are limited by a decay where the decay times the step is between these numbers (their stability ends
#: at about a third of their order), and that is worth a look where so many such steps are left.
LIMITED, MANY_LEFT = (0.1, 100.0), 1e3
#: What to write for methods that exist no more.
GONE_METHODS = {"explicit": 'explicit was removed: leave the method out, or write "implicit"'}


@stage("integrating")
def integrate(
    system: System,
    times: ArrayLike,
    *,
    method: str = "auto",
    tolerance: float = 1e-9,
    start: Start | None = None,
    longest: float = math.inf,
    most_steps: int = 1_000_000,
    raise_on_failure: bool = True,
) -> Trajectory:
    """Integrate a system over the given times.

    Parameters
    ----------
    system : System
        Bodies, joints and forces.
    times : array_like
        Times at which results are wanted (s), rising or falling; the first is the start.
    method : {"auto", "taylor", "implicit", "symplectic"}
        "taylor": Taylor series, for systems whose equations are available as such (all mechanism files with rigid
        links). Gear trains, whose constraints are linear and whose only force has a law with a series, are integrated
        in modal coordinates. "implicit": collocation at 7 points of Radau IIA, for stiff systems, flexible links and
        forces written in plain Python. "auto" takes one of these two by a rule (`chosen_method`). "symplectic":
        collocation at Gauss's points in steps of equal length, which conserves energy if nothing dissipates it.
    tolerance : float
        Allowed error of a step, of angles in rad and of positions relative to the size of the mechanism; 1e-13 to 0.1.
    start : Start, optional
        From `consistent_start`. By default that of the mechanism file with its table [start], or for a system built in
        Python the start poses and velocities of the bodies, made consistent (and kept).
    longest : float
        Longest step (s).
    most_steps : int
        Give up after this number of steps.
    raise_on_failure : bool
        Raise where the end is not reached; without it the trajectory as far as it came is returned, with its status.

    Returns
    -------
    Trajectory
        With a status. `Trajectory.method` is the method that ``auto`` took.

    Raises
    ------
    IntegrationError
        For a run that ended early; its ``result`` is the trajectory.
    InputError
        For values out of range, and starts that cannot be made consistent.
    """
    output_times = np.atleast_1d(np.asarray(times, dtype=float))
    _check(output_times, method, tolerance)
    if start is None:
        start = _default_start(system, float(output_times[0]))
    duration = abs(float(output_times[-1]) - start.time)
    chosen = chosen_method(system, start, duration) if method == "auto" else method
    options = {"tolerance": tolerance, "longest": longest}
    end = float(output_times[-1])
    stiff = partial(_stiff, system, start, end) if method == "auto" and not _modal(system) else None
    with np.errstate(all="ignore"):  # a state that is not finite has a status of its own
        dense, status, statistics = _run(system, chosen, options, start, output_times, most_steps, stiff)
        # a decay limits the steps, or a load has no series at a state on the way
        if status is Status.STIFF or (
            method == "auto" and chosen == "taylor" and status is Status.STEP_TOO_SMALL and not system.algebraic
        ):
            chosen = "implicit"
            dense, status, statistics = _run(system, chosen, options, start, output_times, most_steps)
    sign = 1.0 if output_times[-1] >= output_times[0] else -1.0
    reached = sign * dense.times[-1] + 1e-12 * abs(dense.times[-1])
    kept = output_times if status is Status.DONE else output_times[sign * output_times <= reached]
    if status is Status.DONE and not _dropped_rows_hold(system, start, dense, tolerance):
        status = Status.REDUNDANT_NOT_MET
    if status in UNFINISHED:
        cause = _cause(system, start, dense, float(output_times[-1]), statistics.get("load_problem", ""))
        statistics = {**statistics, **cause}
    made = Trajectory(system, start, kept, status, chosen, statistics, dense)
    if raise_on_failure and made.status is not Status.DONE:
        raise IntegrationError(made, made.message, made.reached, float(output_times[-1]))
    return made


def _cause(system: System, start: Start, dense: Dense, goal: float, load_problem: str) -> dict[str, str]:
    """Why a run stopped before its goal (s): one entry for the statistics, or none where no cause is known."""
    span, last = goal - start.time, dense.times[-6:]  # the very last ones may be beyond all numbers
    if len(last) > 1:
        end, step = float(last[-1]), float(np.abs(np.diff(last)).mean())
        (q, v, a), states = (dense(last[-1:], k)[0] for k in range(3)), (dense(last, 0), dense(last, 1))
    else:  # no step was completed
        end, q, v = start.time, start.q, start.v
        step, states = ROUNDING * max(abs(end), abs(span)), (q[None], v[None])
        a = system.acceleration(end, q, v, start.active, start.added_mass)[0]
    if problem := load_problem or load_problem_ahead(system, end, (q, v, a), span):
        return {"load_problem": problem}
    if link := loose_link(system, last, *states, start.active, start.added_mass):
        return {"loose_link": link}
    if why := locked(system, end, q, start.active):
        return {"locked": why}
    why = short_steps(system, start, end, (q, v, a), step, abs(span))
    return {"short_steps": why} if why else {}


def _dropped_rows_hold(system: System, start: Start, dense: Dense, tolerance: float) -> bool:
    """Return whether all rows are met along the run, whichever of a redundant set was left out on the way."""
    left_out = ~start.active
    if not left_out.any() or len(dense.times) < 2 or is_linear(system):  # constant rows hold as they did at the start
        return True
    times = dense.times[:: max(1, len(dense.times) // 50)]
    times = np.append(times, dense.times[-1])
    states = dense(times, 0)
    gaps = [np.abs(system.residual(t, q) / system.row_units).max() for t, q in zip(times, states, strict=True)]
    scale = 1.0 if system.algebraic else max(1.0, float(np.abs(states / system.units).max()))
    return bool(max(gaps) <= max(1e-8, 1e3 * tolerance) * scale)


def chosen_method(system: System, start: Start, duration: float) -> str:
    """Return the method that ``auto`` begins with for a run of that duration (s), by the rule in docs/integrators.md.

    The rule depends only on the system and its start, and later on the number of steps (`_stiff`). The same file
    therefore has the same digits on every machine. The decay at the start decides only where it stays: nonlinear loads
    change it.
    """
    if not _has_series(system) or any(element.stiff for element in system.elements):
        return "implicit"
    decay, vibration = _rates(system, start)
    long = DECAYED_MODAL if _modal(system) else DECAYED
    lasting = _modal(system) or len(system.series.code.checked) == 0  # type: ignore[union-attr]
    overdamped = lasting and decay > OVERDAMPED * vibration and decay * duration > long
    return "implicit" if overdamped or max(decay, vibration) * duration > HOPELESS else "taylor"


def _stiff(system: System, start: Start, end: float, t: float, step: float, q: Array, v: Array) -> bool:
    """Return whether a decay limits the mean step (s) of series at a state in a long remaining run."""
    left = abs(end - t)
    if not left > MANY_LEFT * step:
        return False
    _, decay, vibration = rates(system, replace(start, time=t, q=q.copy(), v=v.copy()))
    limited = LIMITED[0] < decay * step < LIMITED[1]
    return limited and decay > OVERDAMPED * vibration and decay * left > DECAYED


def _has_series(system: System) -> bool:
    """Return whether motions are Taylor series: on a tape, or in modal coordinates under a force whose law has one."""
    return series_force(system) is not None if _modal(system) else system.series is not None


def _modal(system: System) -> bool:
    """Return whether series are those of modal coordinates."""
    return is_linear(system) and not any(element.planar_bodies for element in system.elements)


@lru_cache(maxsize=4)
def _rates(system: System, start: Start) -> tuple[float, float]:
    """Fastest decay and vibration (1/s) at a start; an error estimate asks again for the same."""
    return fastest_rate(system, start)


def _run(
    system: System, method: str, options: dict[str, Any], start: Start, times: Array, most: int,
    stiff: Callable[[float, float, Array, Array], bool] | None = None,
) -> Run:  # fmt: skip
    """Integrate by one method; `stiff` may end Taylor series of a linkage, see `run_in_pieces`."""
    pace = Pace(start.time, float(times[-1]), most)
    if method in COLLOCATION:
        program = None if system.program is None else system.program.without_redundant(start.active)
        more = options | {"family": COLLOCATION[method], "program": program}
        return run_implicit(system, start, times, pace=pace, **more)
    if _modal(system):
        if series_force(system) is None:
            problem = "needs a linkage, or linear constraints and one force whose law has a series"
            raise InputError("method", "taylor", problem, "use method='implicit'")
        return run_modal_taylor(modal_coordinates(system), start, times, pace=pace, **options)
    if system.series is None:
        problem = "needs rows and forces that can be written on a tape (gearfe.multibody.core.contract)"
        raise InputError("method", "taylor", problem, "use method='implicit'")
    local = max(LOCAL_SHARE * options["tolerance"], 5e-16)
    prepared = taylor.prepare(system, start, taylor.order_for(local))
    end, longest = float(times[-1]), options["longest"]
    return taylor.run_taylor(prepared, start, end, tolerance=local, longest=longest, pace=pace, stiff=stiff)


def _default_start(system: System, time: float) -> Start:
    rule = system.start_rule or partial(consistent_start, system)
    return system.once(("start", time), lambda: rule(time))


def _check(times: np.ndarray, method: str, tolerance: float) -> None:
    if times.size < 2 or not np.isfinite(times).all():
        raise InputError("times", None, "must be at least two finite numbers", "give the start and the end")
    steps = np.diff(times)
    if not ((steps > 0).all() or (steps < 0).all()):
        raise InputError("times", None, "must rise (or fall) from one to the next", "sort them and drop doubles")
    if method not in METHODS:
        cure = GONE_METHODS.get(method, "choose one of these")
        raise InputError("method", method, "must be one of " + ", ".join(METHODS), cure)
    if not (math.isfinite(tolerance) and 1e-13 <= tolerance <= 0.1):
        raise InputError("tolerance", tolerance, "must be from 1e-13 to 0.1", "1e-9 is a good start")
