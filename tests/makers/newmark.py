r"""Implicit transient of a linear model, full or reduced: ``M a + C v + K u = f(t)`` by Newmark's average acceleration.

.. math::
    u_1 = u_0 + h v_0 + \tfrac{h^2}{4}(a_0 + a_1),\qquad v_1 = v_0 + \tfrac{h}{2}(a_0 + a_1)

gives for each step one system with the constant matrix ``M + h/2 C + h^2/4 K``, factorised once (Newmark, J. Eng. Mech.
Div. ASCE 85, 1959). Second order, unconditionally stable, without numerical damping. It is the verification route: the
same steps on the full and on the reduced matrices differ by the reduction only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from gearfe.base.progress import one_thread
from gearfe.base.typing import Array
from gearfe.fem.reduction.sparse_solver import factorize


@dataclass(frozen=True, eq=False)
class Transient:
    """Response of the watched unknowns.

    Attributes
    ----------
    time : (steps + 1,)
        Times (s).
    displacement, velocity, acceleration : (steps + 1, w)
        Of the watched unknowns (SI).
    """

    time: Array
    displacement: Array
    velocity: Array
    acceleration: Array


@one_thread()
def newmark(
    mass: Any,
    damping: Any,
    stiffness: Any,
    load: Callable[[float], Array],
    *,
    step: float,
    steps: int,
    watch: Any = slice(None),
) -> Transient:
    """Integrate from rest.

    Parameters
    ----------
    mass, damping, stiffness : (n, n)
        Symmetric, all sparse or all dense.
    load
        Time (s) to forces on the first k unknowns, (k,); the rest carry none.
    step, steps
        Step (s) and number of steps.
    watch
        Index of the unknowns that are kept.
    """
    n = mass.shape[0]
    matrix = mass + (0.5 * step) * damping + (0.25 * step**2) * stiffness
    solve, solve_mass = _solver(matrix), None
    u, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
    first = np.asarray(load(0.0), dtype=float)
    if np.any(first):
        solve_mass = _solver(mass)
        a = solve_mass(_padded(first, n))
    kept = [(u[watch], v[watch], a[watch])]
    for number in range(1, steps + 1):
        u_free = u + step * v + 0.25 * step**2 * a
        v_free = v + 0.5 * step * a
        force = _padded(np.asarray(load(number * step), dtype=float), n)
        a = solve(force - damping @ v_free - stiffness @ u_free)
        u, v = u_free + 0.25 * step**2 * a, v_free + 0.5 * step * a
        kept.append((u[watch], v[watch], a[watch]))
    history = np.array(kept)
    return Transient(step * np.arange(steps + 1, dtype=float), history[:, 0], history[:, 1], history[:, 2])


def smooth_ramp(time: float, duration: float) -> float:
    """Smoothed step from 0 to 1 over `duration` (s), half a cosine."""
    if time <= 0.0:
        return 0.0
    return 1.0 if time >= duration else 0.5 * (1.0 - float(np.cos(np.pi * time / duration)))


def _padded(force: Array, n: int) -> Array:
    full = np.zeros(n)
    full[: len(force)] = force
    return full


def _solver(matrix: Any) -> Callable[[Array], Array]:
    if sparse.issparse(matrix):
        return factorize(matrix).solve
    from scipy.linalg import cho_factor, cho_solve

    factor = cho_factor(matrix)
    return lambda b: np.asarray(cho_solve(factor, b))


def below(signal: np.ndarray, step: float, limit_hz: float) -> np.ndarray:
    """The part of a signal below a frequency."""
    spectrum = np.fft.rfft(signal)
    spectrum[np.fft.rfftfreq(len(signal), step) > limit_hz] = 0.0
    return np.fft.irfft(spectrum, len(signal))
