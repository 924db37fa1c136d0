"""One call for all integrators: `integrate(system, times, method=..., tolerance=...)`."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from . import compiled, kernel_run, taylor
from .backend import compiled_is_ready
from .start import Start, consistent_start
from .system import System
from .trajectory import Trajectory

METHODS = ("auto", "taylor", "explicit", "implicit")
#: Asked tolerance -> largest last term of a Taylor step. The benchmark mechanisms amplify local errors some
#: hundred times.
LOCAL_SHARE = 5e-4
#: Ratio of masses from which on a link counts as massless, and least singular value of the constraints' unit gradients
#: at a start that is no singular position.
MASSLESS, REGULAR = 1e10, 1e-6
COMPILING = "gearfe: compiling the kernels once (about a minute); backend='plain' does without"


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
) -> Trajectory:
    """Integrate a system over the given times.

    Parameters
    ----------
    system : System
        Bodies, joints and forces.
    times : array_like
        Times at which results are wanted (s), rising or falling; the first is the start.
    method : {"auto", "taylor", "explicit", "implicit"}
        "taylor": series of the index-3 equations, planar scenes only, any accuracy. "explicit": Runge-Kutta of order 8
        with projection, any smooth system. "implicit": Radau IIA of order 5 on the index-3 equations, for stiff ones.
        "auto" takes "taylor" when the system is a planar scene that is not stiff and has no link without mass, else
        "explicit", else "implicit".
    tolerance : float
        Accuracy asked for, relative to 1 rad and to the size of the mechanism; 1e-13 to 0.1.
    start : Start, optional
        From `consistent_start`; by default the start poses of the bodies, made consistent (and remembered).
    backend : {"auto", "compiled", "plain"}
        Compiled kernels need a moment on their first use ever; "plain" runs the same algorithm in NumPy.
    longest : float
        Longest step (s).
    most_steps : int
        Give up after this number of steps.

    Returns
    -------
    Trajectory
        With a status; what was computed is returned even when the end was not reached.
    """
    asked = np.atleast_1d(np.asarray(times, dtype=float))
    _check(asked, method, tolerance, backend)
    if start is None:
        start = _default_start(system, float(asked[0]))
    chosen = choose_method(system, start, float(asked[-1] - asked[0])) if method == "auto" else method
    options: dict[str, Any] = {"tolerance": tolerance, "longest": longest, "most": most_steps}
    with np.errstate(over="ignore", invalid="ignore"):  # a state that is not finite has a status of its own
        if chosen == "taylor":
            dense, status, statistics = _taylor(system, start, asked, backend, **options)
        elif chosen == "explicit":
            from .explicit import run_explicit

            dense, status, statistics = run_explicit(system, start, asked, jit=use_compiled(backend), **options)
        else:
            from .implicit import run_implicit

            dense, status, statistics = run_implicit(system, start, asked, **options)
    sign = 1.0 if asked[-1] >= asked[0] else -1.0
    reached = sign * dense.times[-1] + 1e-12 * max(1.0, abs(dense.times[-1]))
    kept = asked if status == 0 else asked[sign * asked <= reached]
    if status == 0 and not _dropped_rows_hold(system, start, dense, tolerance):
        status = 6
    return Trajectory(system, start, kept, status, chosen, statistics, dense)


def _dropped_rows_hold(system: System, start: Start, dense: Any, tolerance: float) -> bool:
    """Whether all rows are met along the run, whichever of a redundant set was left out on the way."""
    left_out = ~start.active
    if not left_out.any() or len(dense.times) < 2:
        return True
    times = dense.times[:: max(1, len(dense.times) // 50)]
    times = np.append(times, dense.times[-1])
    states = dense(times, 0)
    gaps = [np.abs(system.residual(t, q)).max() for t, q in zip(times, states, strict=True)]
    scale = system.planar.assembly.length if system.planar is not None else max(1.0, float(np.abs(states).max()))
    return bool(max(gaps) <= max(1e-8, 1e3 * tolerance) * max(1.0, scale))


def choose_method(system: System, start: Start, span: float) -> str:
    """The method that "auto" takes: Taylor for planar scenes, explicit otherwise, implicit when the start is stiff or a
    link of a planar scene has next to no mass.

    Stiff: explicit steps would have to follow the damping or the fastest vibration more than 30,000 times over the run.
    """
    scene = system.planar
    from .stiffness_estimate import fastest_rate

    key = id(start)
    known: dict[int, tuple] = system.__dict__.setdefault("_rates", {})
    if key not in known:
        known[key] = (fastest_rate(system, start), start)  # the start is kept, so its id stays its own
    decay, omega = known[key][0]
    work = abs(span) * decay / 4.0 + abs(span) * omega / 4.0
    if work > 30_000 or (scene is not None and _has_massless_links(system, start)):
        return "implicit"
    return "taylor" if scene is not None else "explicit"


def _has_massless_links(system: System, start: Start) -> bool:
    """Whether masses differ so much that the series cannot tell a link without mass from a singular position.

    They eliminate on G M^-1 G^T, which tells singular positions by its pivots; the implicit method solves for M and G
    side by side. At a truly singular start the series stay, for they alone follow the branch that the velocity selects.
    """
    assert system.planar is not None
    inverse = system.planar.assembly.tables.mass.reshape(-1, 3)[:-1]
    moving = inverse[:, 0][inverse[:, 0] > 0]  # moments of inertia follow masses and sizes
    if len(moving) == 0 or moving.max() < MASSLESS * moving.min():
        return False
    gradients = system.jacobian(start.time, start.q)[start.active]
    gradients = gradients / np.linalg.norm(gradients, axis=1, keepdims=True)
    return len(gradients) > 0 and bool(np.linalg.svd(gradients, compute_uv=False)[-1] > REGULAR)


def _taylor(system: System, start: Start, times, backend: str, *, tolerance, longest, most):  # type: ignore[no-untyped-def]
    scene = system.planar
    if scene is None:
        cure = "use method='explicit' or 'implicit'"
        raise InputError("method", "taylor", "needs a system that is one planar scene", cure)
    local = max(LOCAL_SHARE * tolerance, 5e-16)
    order = taylor.order_for(local)
    jit = use_compiled(backend)
    if jit and not compiled_is_ready():
        print(COMPILING, file=sys.stderr, flush=True)
    key = (order, jit)
    cache = scene.__dict__.setdefault("_work", {})
    if key not in cache:
        cache[key] = taylor.work_space(scene.assembly.tables, order)
    redundant = (~start.active).astype(np.int64)
    pieces = taylor.run(
        scene.assembly, start.q, start.v, (start.time, float(times[-1])), tolerance=local, redundant=redundant,
        order=order, longest=longest, most=most, jit=jit, work=cache[key],
    )  # fmt: skip
    status = 2 if pieces.status == kernel_run.FULL else pieces.status
    where = np.flatnonzero(pieces.folds)
    statistics = {
        "steps": len(pieces.coefficients),
        "order": order,
        "backend": "compiled" if jit else "plain",
        "singular_passages": pieces.times[where],
    }
    return pieces, status, statistics


def use_compiled(backend: str) -> bool:
    """Whether to run compiled kernels: as asked, or whenever numba is there."""
    if backend == "plain":
        return False
    if backend == "compiled" and not compiled.available():
        raise InputError("backend", backend, "needs numba", "pip install numba, or use backend='plain'")
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
