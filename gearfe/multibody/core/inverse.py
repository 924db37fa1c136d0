"""Inverse dynamics: the motion that joints prescribe, without integrating, and the forces that it takes.

At every time the positions satisfy g(t, q) = 0; then G v = -dg/dt and G a = -(velocity terms). The multipliers follow
from M a = f - G^T lambda as in every trajectory.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .dense import hermite
from .mass_regularisation import RANK
from .start import Start, close, closes
from .steps import Status
from .stopped import locked
from .system import System
from .trajectory import Trajectory

#: Largest change of a coordinate between two closed positions, in its unit: steps are halved above it.
LARGEST, HALVINGS = 0.2, 12


def prescribed_motion(system: System, start: Start, times: Array) -> Trajectory:
    """The motion over the `times` of a system that its joints leave no freedom.

    Raises
    ------
    InputError
        When something is free to move, which needs integration, or a load has no value at one of the times.
    """
    if start.freedoms.net > 0:
        problem = f"leave {start.freedoms.net} freedoms: forces follow from a motion only where it is prescribed whole"
        raise InputError("joints", None, problem, "prescribe a motion for each, or run it as transient")
    states = [_moves(system, start, float(times[0]), start.q)]
    done = [float(times[0])]
    status = Status.DONE
    for goal in times[1:]:
        reached = _advance(system, start, done, states, float(goal))
        if not reached:
            status = Status.NOT_SOLVED
            break
    for t, (q, v, _) in zip(done, states, strict=True):
        if not np.isfinite(system.force(t, q, v)).all():
            why = system.load_problem(t, q, v) or f"at {t:.6g} s"
            raise InputError("forces", None, f"have no value on the way: {why}", "correct the expression")
    statistics: dict[str, Any] = {"scheme": "closed positions", "steps": len(done) - 1}
    if status is not Status.DONE and (why := locked(system, done[-1], states[-1][0], start.active)):
        statistics["locked"] = why
    kept = np.asarray(times[: np.searchsorted(times, done[-1], side="right")])
    q, v, a = (np.array([s[k] for s in states]) for k in range(3))
    dense = hermite(np.array(done), q, v, a)
    return Trajectory(system, start, kept, status, "inverse", statistics, dense)


def _advance(
    system: System, start: Start, done: list[float], states: list[tuple[Array, Array, Array]], goal: float
) -> bool:
    """Closed positions up to `goal`; False where one is not found."""
    halved, step = 0, goal - done[-1]
    while done[-1] < goal:
        h = min(step, goal - done[-1])
        t = goal if h == goal - done[-1] else done[-1] + h
        q, v, a = states[-1]
        guess = q + h * v + 0.5 * h * h * a
        found, gap = close(system, t, guess, ())
        far = float(np.abs((found - q) / system.units).max(initial=0.0))
        off = float(np.abs((found - guess) / system.units).max(initial=0.0))
        if closes(system, found, gap) and off <= LARGEST * max(far, 1e-9) + 1e-9 and far <= 5 * LARGEST:
            done.append(t)
            states.append(_moves(system, start, t, found))
        else:
            halved, step = halved + 1, 0.5 * h
            if halved > HALVINGS:
                return False
    return True


def _moves(system: System, start: Start, t: float, q: Array) -> tuple[Array, Array, Array]:
    """Coordinates, velocities and accelerations of a closed position."""
    sizes, units = system.row_units[start.active], system.units
    G = system.jacobian(t, q)[start.active] * units / sizes[:, None]
    v = units * np.linalg.lstsq(G, -system.rate(t, q)[start.active] / sizes, rcond=RANK)[0]
    a = units * np.linalg.lstsq(G, -system.velocity_terms(t, q, v)[start.active] / sizes, rcond=RANK)[0]
    return q, v, a
