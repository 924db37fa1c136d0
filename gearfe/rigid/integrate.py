"""One call for all integrators: `integrate(system, times, method=..., tolerance=...)`."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..progress import announce, count, stage
from ..typing import Array
from . import compiled, taylor
from .carried import loose_link
from .choice import Choice, Way, joined, joined_statistics
from .collocation import GAUSS, RADAU
from .corners import blame_ahead
from .dense import Dense
from .elimination import is_linear, modal_coordinates
from .linkage import Linkage
from .modal import series_force
from .start import Start, consistent_start
from .steps import Status, Watch
from .stopped import locked, short_steps
from .system import System
from .trajectory import IntegrationError, Trajectory

Run = tuple[Dense, Status, dict[str, Any]]
#: Points of the implicit methods.
COLLOCATION = {"implicit": RADAU, "symplectic": GAUSS}
#: Ends of runs whose cause is looked for.
UNFINISHED = (Status.STEP_TOO_SMALL, Status.NOT_FINITE, Status.NOT_SOLVED, Status.ENDLESS, Status.MOST_STEPS)
METHODS = ("auto", "taylor", "explicit", *COLLOCATION)
#: Asked tolerance -> largest last term of a Taylor step. The benchmark mechanisms amplify local errors some
#: hundred times.
LOCAL_SHARE = 5e-4
#: Seconds of the shortest trials that tell a pace (measured): ten steps of Radau IIA, and before these loading
#: scipy.linalg once; eight steps of plain series or Runge-Kutta.
IMPLICIT_TRIAL, LOADING_LINALG, PLAIN_TRIAL = 0.02, 0.25, 0.01
#: Rates from which on steps of a series or of Runge-Kutta are below the rounding of the run's time.
HOPELESS = 1e12
#: How many times as fast as plain steps compiled ones are (measured: 170 with one body, 200 with seven).
COMPILED_FASTER = 180.0
#: The same of the implicit method, for a link of four beam elements (measured).
IMPLICIT_FASTER = 30.0
#: Seconds that plain steps of each method have cost in this process: from the price of its kernels on, these would have
#: paid.
_PLAIN_SPENT = dict.fromkeys(METHODS, 0.0)
COMPILING = "compiling the kernels once, about a quarter of a minute; backend='plain' does without"
MISSING_NUMBA = "numba would make it some hundred times as fast: pip install 'gearfe[fast]'"


@stage("integrating")
def integrate(
    system: System,
    times: ArrayLike,
    *,
    method: str = "auto",
    tolerance: float = 1e-9,
    start: Start | None = None,
    backend: str = "auto",
    longest: float = math.inf,
    most_steps: int = 1_000_000,
    raise_on_failure: bool = True,
    runs: float = 1.0,
) -> Trajectory:
    """Integrate a system over the given times.

    Parameters
    ----------
    system : System
        Bodies, joints and forces.
    times : array_like
        Times at which results are wanted (s), rising or falling; the first is the start.
    method : {"auto", "taylor", "explicit", "implicit", "symplectic"}
        "taylor": Taylor series of the index-3 equations, where rows and forces can be written on a tape (planar
        linkages, loads by expression, frames in vectors); in modal coordinates (compiled) where the constraints are
        linear and the only force has a law with a series: gear trains. "explicit": any smooth system,
        Runge-Kutta of order 8, with projection where constraints are not linear. "implicit": Radau IIA of 7 stages, for
        stiff ones, compiled where rows and forces can be written on a tape. "auto" takes the one of "taylor" (else
        "explicit") and "implicit" that is predicted to take the fewest seconds, and changes over when that proves wrong
        (`gearfe.rigid.choice`). "symplectic": the implicit method with Gauss's points in steps of one length, which
        keeps the energy where nothing takes any.
    tolerance : float
        Accuracy asked for, relative to 1 rad and to the size of the mechanism; 1e-13 to 0.1.
    start : Start, optional
        From `consistent_start`; by default the start poses of the bodies, made consistent (and remembered).
    backend : {"auto", "compiled", "plain"}
        Compiled kernels need a moment on their first use ever; "plain" runs the same algorithm in NumPy. "auto" begins
        with plain series as long as these cost less than compiling or loading the kernels would.
    longest : float
        Longest step (s).
    most_steps : int
        Give up after this number of steps.
    raise_on_failure : bool
        Raise where the end is not reached; without it the trajectory as far as it came is returned, with its status.
    runs : float
        How many runs of this length the caller makes by the way chosen here, this one included: they share what
        loading compiled kernels costs.

    Returns
    -------
    Trajectory
        With a status. Where there was a choice, ``statistics["choice"]`` lists what each method did, with predicted and
        real seconds; a program that shows progress (`gearfe.progress`) tells after two seconds what is left.

    Raises
    ------
    IntegrationError
        For a run that ended early; its ``result`` is the trajectory.
    InputError
        For values out of range, and starts that cannot be made consistent.
    """
    output_times = np.atleast_1d(np.asarray(times, dtype=float))
    _check(output_times, method, tolerance, backend)
    if start is None:
        start = _default_start(system, float(output_times[0]))
    ways = ways_of(system, start, output_times, method, backend, {"tolerance": tolerance, "longest": longest}, runs)
    with np.errstate(over="ignore", invalid="ignore"):  # a state that is not finite has a status of its own
        if len(ways) == 1:
            dense, status, statistics = ways[0].run(
                start, output_times, most_steps, partial(_counted, start.time, output_times[-1])
            )
            chosen = ways[0].method
        else:
            choice = Choice(ways, start, output_times, most=most_steps)
            legs = choice.run()
            for leg in legs:
                if leg.way.backend == "plain":
                    _PLAIN_SPENT[leg.way.method] += leg.seconds
            statistics = joined_statistics(legs, choice.said)
            used = {leg.way.method for leg in legs}
            chosen, status = used.pop() if len(used) == 1 else "auto", legs[-1].status
            dense = joined(legs)
    sign = 1.0 if output_times[-1] >= output_times[0] else -1.0
    reached = sign * dense.times[-1] + 1e-12 * abs(dense.times[-1])
    kept = output_times if status is Status.DONE else output_times[sign * output_times <= reached]
    if status is Status.DONE and not _dropped_rows_hold(system, start, dense, tolerance):
        status = Status.REDUNDANT_NOT_MET
    if status in UNFINISHED and len(dense.times) > 1:
        last = dense.times[-6:]  # the very last ones may be beyond all numbers
        end, (q, v, a) = float(last[-1]), (dense(last[-1:], k)[0] for k in range(3))
        blame_ahead(system, end, (q, v, a), float(output_times[-1]) - start.time)
        link = loose_link(system, last, dense(last, 0), dense(last, 1), start)
        statistics = statistics if link is None else {**statistics, "loose_link": link}
        if link is None and (why := locked(system, end, q, start.active)):
            statistics = {**statistics, "locked": why}
        elif cause := short_steps(system, start, end, q, v, float(np.abs(np.diff(last)).mean())):
            statistics = {**statistics, "short_steps": cause}
    if status is not Status.DONE and (why := system.complaint):
        statistics = {**statistics, "complaint": why}
    made = Trajectory(system, start, kept, status, chosen, statistics, dense)
    if raise_on_failure and made.status is not Status.DONE:
        raise IntegrationError(made, made.message, made.reached, float(output_times[-1]))
    return made


def _counted(begin: float, end: float, t: float, steps: int, state: Any) -> bool:  # noqa: ARG001 - a `choice.Watch`
    """Tell how far the only way is."""
    count(abs(t - begin), abs(float(end) - begin))
    return True


def _dropped_rows_hold(system: System, start: Start, dense: Dense, tolerance: float) -> bool:
    """Whether all rows are met along the run, whichever of a redundant set was left out on the way."""
    left_out = ~start.active
    if not left_out.any() or len(dense.times) < 2 or is_linear(system):  # constant rows hold as they did at the start
        return True
    times = dense.times[:: max(1, len(dense.times) // 50)]
    times = np.append(times, dense.times[-1])
    states = dense(times, 0)
    gaps = [np.abs(system.residual(t, q) / system.row_units).max() for t, q in zip(times, states, strict=True)]
    scale = 1.0 if system.linkage is not None else max(1.0, float(np.abs(states / system.units).max()))
    return bool(max(gaps) <= max(1e-8, 1e3 * tolerance) * scale)


def ways_of(
    system: System, start: Start, times: Array, method: str, backend: str, options: dict[str, Any], runs: float = 1.0
) -> list[Way]:
    """Ways to integrate that `method` and `backend` leave open, the one to begin with first."""
    trial = IMPLICIT_TRIAL + (0.0 if "scipy.linalg" in sys.modules else LOADING_LINALG)
    rate = (
        partial(_rate, system) if system.linkage is not None or is_linear(system) else None
    )  # it does not see all other elements
    auto = method == "auto"
    implicit: list[Way] = []
    if auto or method in COLLOCATION:
        kind = "implicit" if auto else method
        held = options | {"family": COLLOCATION[kind]}
        slow = Way(kind, "plain", partial(_implicit, system, False, held), trial, rate=rate)
        implicit = _implicit_ways(system, backend, held, slow, runs)
    stuck = auto and (any(e.stiff for e in system.elements) or _hopeless(system, start, times))
    cure = _cure(system, backend)
    explicit = Way("explicit", "", partial(_explicit, system, backend, options), PLAIN_TRIAL, cure=cure)
    if stuck or method in ("explicit", *COLLOCATION):
        return [explicit] if method == "explicit" else implicit
    return [*_series_ways(system, auto, backend, options, explicit, runs), *implicit]


def _series_ways(
    system: System, auto: bool, backend: str, options: dict[str, Any], explicit: Way, runs: float
) -> list[Way]:
    """Series of what can be written on a tape, else in modal coordinates; Runge-Kutta where there is none."""
    if is_linear(system) and not any(isinstance(e, Linkage) for e in system.elements):
        modal = Way("taylor", "", partial(_modal_taylor, system, backend, options), PLAIN_TRIAL)
        return [explicit] if auto and (series_force(system) is None or not use_compiled(backend)) else [modal]
    if system.series is None:
        if auto:
            return [explicit]
        problem = "needs rows and forces that can be written on a tape (gearfe.rigid.contract)"
        raise InputError("method", "taylor", problem, "use method='explicit' or 'implicit'")
    instead = explicit if auto and system.linkage is None else None
    run = partial(_taylor, system, False, options)
    plain = Way("taylor", "plain", run, PLAIN_TRIAL, instead=instead, cure=explicit.cure)
    if not use_compiled(backend):
        return [plain]
    loading = taylor.KERNELS.seconds / runs
    run = partial(_taylor, system, True, options)
    quick = Way("taylor", "compiled", run, loading, loading, COMPILED_FASTER, instead=instead)
    return [quick] if backend == "compiled" or loading <= _PLAIN_SPENT["taylor"] else [plain, quick]


def _cure(system: System, backend: str) -> str:
    """What to tell where compiled series could run, were numba there."""
    if backend != "auto" or compiled.available():
        return ""
    able = series_force(system) is not None or system.series is not None
    return MISSING_NUMBA if able else ""


def _hopeless(system: System, start: Start, times: Array) -> bool:
    """Whether the fastest rate at the start leaves steps of series or Runge-Kutta no length."""
    return abs(float(times[-1] - times[0])) * _rate(system, start) > HOPELESS


def _rate(system: System, start: Start) -> float:
    """Fastest rate (1/s) of springs and dampers in a state; that of the last one asked for is remembered."""
    from .modes import fastest_rate

    known: tuple[Start, float] | None = system.__dict__.get("_rate")
    if known is None or known[0] is not start:
        known = system.__dict__["_rate"] = (start, max(fastest_rate(system, start)))
    return known[1]


def _explicit(
    system: System, backend: str, options: dict[str, Any], start: Start, times: Array, most: int, watch: Watch | None
) -> Run:
    from .explicit import run_explicit
    from .modal import run_modal_explicit

    if backend == "compiled":
        use_compiled(backend)  # refused without numba
    if is_linear(system):
        return run_modal_explicit(modal_coordinates(system), start, times, most=most, watch=watch, **options)
    return run_explicit(system, start, times, most=most, watch=watch, **options)


def _modal_taylor(
    system: System, backend: str, options: dict[str, Any], start: Start, times: Array, most: int, watch: Watch | None
) -> Run:
    from .modal import run_modal_taylor

    if series_force(system) is None:
        problem = "needs a linkage, or linear constraints and one force whose law has a series"
        raise InputError("method", "taylor", problem, "use method='explicit' or 'implicit'")
    if not use_compiled(backend):
        raise InputError("backend", backend, "has no series in modal coordinates", "use method='explicit', or numba")
    return run_modal_taylor(modal_coordinates(system), start, times, most=most, watch=watch, **options)


def _implicit_ways(system: System, backend: str, options: dict[str, Any], plain: Way, runs: float) -> list[Way]:
    """The implicit method plain, compiled, or the first and the second where that must be compiled now."""
    if not use_compiled(backend) or system.program is None:
        return [replace(plain, backend="")]
    from .implicit import KERNELS

    loading = KERNELS.seconds / runs
    quick = replace(
        plain, backend="compiled", run=partial(_implicit, system, True, options), trial=IMPLICIT_TRIAL + loading
    )
    if backend == "compiled" or KERNELS.ready or loading <= _PLAIN_SPENT[plain.method]:
        return [quick]
    return [plain, replace(quick, loading=loading, ratio=IMPLICIT_FASTER)]


def _implicit(
    system: System, jit: bool, options: dict[str, Any], start: Start, times: Array, most: int, watch: Watch | None
) -> Run:
    from .implicit import KERNELS, run_implicit

    if jit:
        _told(KERNELS)
    program = system.program if jit else None
    held = None if program is None else program.without_redundant(start.active)
    return run_implicit(system, start, times, most=most, watch=watch, program=held, **options)


def _taylor(
    system: System, jit: bool, options: dict[str, Any], start: Start, times: Array, most: int, watch: Watch | None
) -> Run:
    if jit:
        _told(taylor.KERNELS)
    local, longest = max(LOCAL_SHARE * options["tolerance"], 5e-16), options["longest"]
    prepared = taylor.prepare(system, start, taylor.order_for(local), jit)
    end = float(times[-1])
    return taylor.run_taylor(prepared, start, end, tolerance=local, longest=longest, most=most, watch=watch)


def _told(kernels: compiled.Kernels) -> None:
    """Tell of the wait for kernels that are not there yet."""
    if not kernels.ready:
        announce(COMPILING)


def use_compiled(backend: str) -> bool:
    """Whether to run compiled kernels: as asked, or whenever numba is there."""
    if backend == "plain":
        return False
    if backend == "compiled" and not compiled.available():
        raise InputError("backend", backend, "needs numba", "pip install 'gearfe[fast]', or use backend='plain'")
    return compiled.available()


def _default_start(system: System, time: float) -> Start:
    known: dict[float, Start] = system.__dict__.setdefault("_starts", {})
    if time not in known:
        known[time] = consistent_start(system, time)
    return known[time]


def _check(times: np.ndarray, method: str, tolerance: float, backend: str) -> None:
    if times.size < 2 or not np.isfinite(times).all():
        raise InputError("times", None, "must be at least two finite numbers", "give the start and the end")
    steps = np.diff(times)
    if not ((steps > 0).all() or (steps < 0).all()):
        raise InputError("times", None, "must rise (or fall) from one to the next", "sort them and drop doubles")
    if method not in METHODS:
        raise InputError("method", method, "must be one of " + ", ".join(METHODS), "choose one of these")
    if backend not in ("auto", "compiled", "plain"):
        raise InputError("backend", backend, "must be one of auto, compiled, plain", "choose one of these")
    if not (math.isfinite(tolerance) and 1e-13 <= tolerance <= 0.1):
        raise InputError("tolerance", tolerance, "must be from 1e-13 to 0.1", "1e-9 is a good start")
