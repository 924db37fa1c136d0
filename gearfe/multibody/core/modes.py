"""Small vibrations about a state of rest.

The state is at rest, and T is a basis of the motions that the joints leave free (G T = 0). With M, C = -df/dv and K =
-df/dq + d(G^T lambda)/dq, small motions T u exp(l t) satisfy

    (l^2 M_r + l C_r + K_r) u = 0,        M_r = T^T M T, ...

It is solved for m = 1/l, because the values of slow motions are then the largest and the most exact. Links may have no
mass, and C and K need not be symmetric (Tisseur & Meerbergen, SIAM Review 43 (2001) 235-286).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .equilibrium import Equilibrium, check_rests, stiffness_at
from .mass_regularisation import free_motions
from .start import Start
from .system import System

#: Motions that decay or vibrate faster than this many times the slowest are rounding, or without mass.
FASTEST = 1e9


@dataclass(frozen=True)
class Modes:
    """Vibrations, then decays without vibration, the slowest first.

    Attributes
    ----------
    rates : ndarray of complex, shape (n,)
        l (1/s): decay and angular frequency; with a positive imaginary part, or real.
    shapes : ndarray of complex, shape (n, size)
        Coordinates, the largest in units of the coordinates 1.
    """

    rates: np.ndarray
    shapes: np.ndarray = field(repr=False)

    @property
    def frequencies(self) -> Array:
        """|l| / (2 pi) (Hz): of the vibration without damping."""
        return np.asarray(np.abs(self.rates) / (2 * np.pi))

    @property
    def damping_ratios(self) -> Array:
        """-Re l / |l|; 1 for a decay without vibration."""
        return np.asarray(-self.rates.real / np.abs(self.rates))


def modes(system: System, start: Start, rest: Equilibrium, count: int) -> Modes:
    """Compute the slowest small motions about an equilibrium.

    Parameters
    ----------
    system : System
        The system.
    start : Start
        Time, and the constraints that are not redundant.
    rest : Equilibrium
        The state of rest.
    count : int
        Largest number of motions.

    Raises
    ------
    InputError
        If joints prescribe a motion: the state does not rest.
    """
    t, active, units = start.time, start.active, system.units
    check_rests(system, t, rest.q)
    zero = np.zeros(system.size)
    G = system.jacobian(t, rest.q)[active] * units / system.row_units[active, None]
    T = units[:, None] * free_motions(G)
    M, C = T.T @ system.mass @ T, -T.T @ system.force_jacobian(t, rest.q, zero)[1] @ T
    K = T.T @ stiffness_at(system, t, rest.q, rest.multipliers) @ T
    n = len(K)
    if n == 0:
        problem = "has no motion that its joints leave free, so nothing vibrates"
        raise InputError("mechanism", None, problem, "leave out a joint or a prescribed motion, or ask for no modes")
    companion = np.zeros((2 * n, 2 * n))  # of (m u, u) in powers of m: m^2 K + m C + M = 0, scaled by the slowest rate
    soft = np.linalg.solve(K, np.hstack([C, M]))
    scale = float(np.sqrt(np.abs(np.linalg.eigvals(soft[:, n:])).max())) or 1.0
    companion[:n] = -np.hstack([soft[:, :n] / scale, soft[:, n:] / scale**2])
    companion[n:, :n] = np.eye(n)
    m, vectors = np.linalg.eig(companion)
    kept = np.flatnonzero((np.abs(m) > np.abs(m).max() / FASTEST) & (m.imag <= 0.0))  # l = 1/m turns the sign
    kept = kept[np.lexsort((-np.abs(m[kept]), m[kept].imag == 0.0))][:count]
    shapes = (T @ vectors[n:, kept]).T
    largest = np.abs(shapes / units).argmax(axis=1)
    shapes = shapes / (shapes / units)[np.arange(len(kept)), largest][:, None]
    return Modes(1.0 / (scale * m[kept]), shapes)


def fastest_rate(system: System, start: Start) -> tuple[float, float]:
    """Fastest decay (1/s) and fastest vibration (rad/s) of the free motion in a state."""
    if not (system.linear or any(not element.steady_forces for element, _ in system.forces)):
        return 0.0, 0.0
    growth, decay, vibration = rates(system, start)
    return max(growth, decay), vibration


def rates(system: System, start: Start) -> tuple[float, float, float]:
    """Fastest growth and decay by velocities (1/s) and fastest vibration (rad/s) of the free motion in a state.

    The linear part of forces is projected onto the directions that the constraints leave free.
    """
    by_q, by_v = system.force_jacobian(start.time, start.q, start.v)
    G = system.jacobian(start.time, start.q)[start.active] / system.row_units[start.active, None]
    free = system.units[:, None] * free_motions(G * system.units)
    root = np.linalg.solve(np.linalg.qr(system.mass_root @ free)[1].T, free.T).T  # root^T M root = 1
    K, C = -root.T @ by_q @ root, -root.T @ by_v @ root
    if K.size == 0 or not (np.isfinite(K).all() and np.isfinite(C).all()):  # nothing moves, or a load has no value
        return 0.0, 0.0, 0.0
    damping = np.linalg.eigvals(C) if C.any() else np.zeros(1)
    signs = damping.real < 0.0
    growth, decay = (float(np.abs(damping[kept]).max(initial=0.0)) for kept in (signs, ~signs))
    return growth, decay, float(np.sqrt(np.abs(np.linalg.eigvals(K)).max()))
