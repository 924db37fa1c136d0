"""Static equilibrium of a system: f(t, q, 0) = G^T lambda with g(t, q) = 0, where the energy is least.

Newton's method on the motions y that the joints leave free, dq = dq_g + T y with G T = 0 and G dq_g = -g:

    (T^T K T + sigma) y = T^T (f - K dq_g),        K = -df/dq + d(G^T lambda)/dq

sigma >= 0 makes the matrix positive definite, so that every step goes downhill (Nocedal & Wright, Numerical
Optimization, Sec. 3.4). It is zero at the end, so the solution is a minimum of the energy and no saddle.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .mass_regularisation import free_motions
from .start import Start
from .system import System

#: Largest move in a step, in units of the coordinates (rad, the mechanism's length).
LARGEST_MOVE = 0.3
#: Moves below this, in the same units, are rounding; those that may still be when steps no longer get smaller.
RESTS, ROUNDING = 1e-13, 1e-8
MOST_STEPS = 300


@dataclass(frozen=True)
class Equilibrium:
    """A state of rest.

    Attributes
    ----------
    q, multipliers
        Coordinates, and constraint forces.
    residual
        Largest force left (N, or N m over the mechanism's length).
    steps
        Of the iteration.
    """

    q: Array
    multipliers: Array = field(repr=False)
    residual: float
    steps: int


def equilibrium(system: System, start: Start) -> Equilibrium:
    """The stable equilibrium downhill from `start`, at its time; its speeds do not count.

    Raises
    ------
    InputError
        When there is none, or the start rests where the energy is not least, with the residual. When joints prescribe a
        motion that does not rest at that time.
    """
    check_rests(system, start.time, start.q)
    t, active, units = start.time, start.active, system.units
    q, zero = start.q.copy(), np.zeros(system.size)
    before = np.inf
    for step in range(1, MOST_STEPS + 1):
        f, G = system.force(t, q, zero), system.jacobian(t, q)[active]
        multipliers = np.zeros(system.rows)
        multipliers[active] = np.linalg.lstsq((G * units).T, f * units, rcond=None)[0]
        K = stiffness_at(system, t, q, multipliers) * np.outer(units, units)
        scaled = G * units / system.row_units[active, None]
        T = free_motions(scaled)
        gap = -np.linalg.lstsq(scaled, system.residual(t, q)[active] / system.row_units[active], rcond=None)[0]
        y, shifted = _downhill(T.T @ K @ T, T.T @ (f * units - K @ gap))
        move = gap + T @ y
        far = float(np.abs(move).max(initial=0.0))
        if not np.isfinite(far):
            break
        q = q + min(1.0, LARGEST_MOVE / max(far, LARGEST_MOVE)) * units * move
        if far < RESTS or (far < ROUNDING and far > 0.5 * before):
            if shifted:
                break
            return Equilibrium(q, multipliers, _left(system, t, q, active), step)
        before = far
    left = _left(system, t, q, active)
    if far < ROUNDING:
        problem = "is not stable where the start rests: something moves there without force"
        cure = "disturb the start position, or add a support"
    else:
        problem = f"was not found in {step} steps: a force of {left:.3g} N is left"
        cure = "look for loads that nothing carries, or give a start that is nearer"
    raise InputError("equilibrium", None, problem, cure)


def check_rests(system: System, t: float, q: Array) -> None:
    """No joint prescribes a speed at the time t.

    Raises
    ------
    InputError
        Where one does; it is named.
    """
    moving = np.abs(system.rate(t, q) / system.row_units)
    if moving.max(initial=0.0) > 0.0:
        name = system.row_names()[int(moving.argmax())]
        problem = f"moves at {t:g} s: equilibrium and modes are those of a state of rest"
        raise InputError(name, None, problem, "prescribe a constant, or describe the mechanism in a turning frame")


def stiffness_at(system: System, t: float, q: Array, multipliers: Array) -> Array:
    """Return the stiffness K = -df/dq + d(G^T lambda)/dq at rest.

    Parameters
    ----------
    system : System
        The system.
    t : float
        Time (s).
    q : ndarray, shape (size,)
        Coordinates at rest.
    multipliers : ndarray, shape (rows,)
        Constraint forces lambda there.

    Returns
    -------
    K : ndarray, shape (size, size)
        With respect to the coordinates.
    """
    return system.curvature(t, q, multipliers) - system.force_jacobian(t, q, np.zeros(system.size))[0]


def _downhill(K: Array, force: Array) -> tuple[Array, bool]:
    """The move along which the energy falls, and whether it needed a shift."""
    if len(K) == 0:
        return np.zeros(0), False
    K = 0.5 * (K + K.T)
    try:
        np.linalg.cholesky(K)
        return np.linalg.solve(K, force), False
    except np.linalg.LinAlgError:
        values, turn = np.linalg.eigh(K)
    least = 1e-14 * max(float(np.abs(values).max()), 1e-300)
    # the size of negative curvatures counts, that of none is as soft as the softest that counts
    size = np.abs(values)
    size[size <= least] = size[size > least].min(initial=float(np.abs(force).max()) or 1.0)
    return turn @ ((turn.T @ force) / size), True


def _left(system: System, t: float, q: Array, active: np.ndarray) -> float:
    """Largest force that nothing balances, moments over the mechanism's length (N)."""
    G = system.jacobian(t, q)[active] * system.units
    f = system.force(t, q, np.zeros(system.size)) * system.units
    rest = f - G.T @ np.linalg.lstsq(G.T, f, rcond=None)[0]
    return float(np.abs(rest).max(initial=0.0)) / float(system.units.max())
