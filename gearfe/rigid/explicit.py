"""Explicit Runge-Kutta of order 8 (Dormand & Prince; Hairer, Norsett & Wanner I, Sec. II.10) with projection.

Constrained systems are integrated in (q, v) with the accelerations of the index-1 form and projected onto position and
velocity constraints after every step. Systems whose constraints are linear and constant run in minimal
coordinates, where
the projection has nothing to do; there, a force with a compiled law is integrated by Taylor series instead
(`gearfe.rigid.modal`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from .carried import RANK
from .choice import STOPPED, Watch
from .contract import Array
from .elimination import is_linear, minimal
from .start import Start
from .system import System, own_motion
from .within import within_run

SCHEME = "Runge-Kutta of order 8"
Rhs = Callable[[float, Array], Array]


class Tableau(NamedTuple):
    """Coefficients: A (16, 16) with the three stages of the dense output, B (12,), C (16,), E3, E5 (13,), D (4, 16)."""

    A: Array
    B: Array
    C: Array
    E3: Array
    E5: Array
    D: Array


@lru_cache(maxsize=1)
def tableau() -> Tableau:
    """Coefficients as scipy publishes them on its DOP853 class."""
    from scipy.integrate import DOP853

    A = np.zeros((16, 16))
    A[:12, :12] = DOP853.A
    A[12, :12] = DOP853.B
    A[13:, : DOP853.A_EXTRA.shape[1]] = DOP853.A_EXTRA
    C = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA])
    return Tableau(A, DOP853.B, C, DOP853.E3, DOP853.E5, DOP853.D)


@dataclass(frozen=True)
class Pieces:
    """Dense output: on every step the polynomial of order 7; `expand` turns the state into (q, v, a)."""

    times: Array
    states: Array
    polynomials: Array  # (steps, 7, 2n)
    expand: Callable[[float, Array], tuple[Array, Array, Array]]

    def state(self, t: Array) -> Array:
        """Integrated state at the times t, (times, 2n)."""
        sign = 1.0 if self.times[-1] >= self.times[0] else -1.0
        k = np.clip(np.searchsorted(sign * self.times, sign * t, side="right") - 1, 0, len(self.polynomials) - 1)
        x = ((t - self.times[k]) / (self.times[k + 1] - self.times[k]))[:, None]
        y = np.zeros((len(t), self.states.shape[1]))
        for i in range(7):
            y += self.polynomials[k, 6 - i]
            y *= x if i % 2 == 0 else 1.0 - x
        return y + self.states[k]

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        """Coordinates, velocities or accelerations at the times t."""
        t = within_run(self.times, t)
        return np.array([self.expand(ti, yi)[derivative] for ti, yi in zip(t, self.state(t), strict=True)])


def run_explicit(  # type: ignore[no-untyped-def]
    system: System, start: Start, times: Array, *, tolerance: float, longest: float, most: int, jit: bool = True,
    watch: Watch | None = None,
):  # fmt: skip
    """Integrate; returns (dense output, status, statistics). `jit`: compiled laws run in a compiled loop."""
    if is_linear(system):
        from .modal import run_minimal

        options: dict[str, Any] = {"tolerance": tolerance, "longest": longest, "most": most, "jit": jit, "watch": watch}
        return run_minimal(minimal(system), start, times, **options)
    n = system.size
    active = start.active

    def rhs(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], system.acceleration(t, y[:n], y[n:], active, start.excess)[0]])

    def project(t: float, y: Array) -> Array:
        return on_constraints(system, t, y[:n], y[n:], active, start.excess)

    def expand(t: float, y: Array) -> tuple[Array, Array, Array]:
        return y[:n], y[n:], system.acceleration(t, y[:n], y[n:], active, start.excess)[0]

    y0 = np.concatenate([start.q, start.v])

    def told(t: float, steps: int, y: Array) -> bool:
        return watch is None or watch(t, steps, lambda: (y[:n], y[n:]))

    made = step_through(
        rhs, project, start.time, y0, times[-1], system.breaks, tolerance, longest, most, told, system.units
    )
    ends, states, polynomials, status, evaluations = made
    statistics: dict[str, Any] = {"scheme": SCHEME, "steps": len(polynomials), "evaluations": evaluations}
    return Pieces(ends, states, polynomials, expand), status, statistics


def on_constraints(
    system: System, t: float, q: Array, v: Array, active: np.ndarray, excess: Array | None = None
) -> Array:
    """State projected onto g = 0 and G v = -dg/dt; rows that are redundant follow by themselves.

    By the least changes in the mass norm; `excess` as in `System.acceleration`.
    """
    if system.rows == 0:
        return np.concatenate([q, v])
    sizes = system.row_units[active]
    extra = np.zeros(system.size) if excess is None or not excess.any() else excess
    inverse, light = system.inverse_of(extra) if extra.any() else system.inverse_mass, np.flatnonzero(extra)
    root = np.sqrt(inverse) if system.diagonal_mass else np.linalg.cholesky(inverse)

    def change(G: Array, gap: Array) -> Array:
        """Not-a-number where rows or gaps are not finite: the callers look at what comes back."""
        if not (np.isfinite(G).all() and np.isfinite(gap).all()):
            return np.full(system.size, np.nan)
        free = np.column_stack([np.zeros(system.size), (inverse * extra)[:, light]])
        right = G @ free
        right[:, 0] -= gap
        made = free - root @ np.linalg.lstsq(G @ root / sizes[:, None], right / sizes[:, None], rcond=RANK)[0]
        return own_motion(made, light)[0]

    for _ in range(5):
        gap = system.residual(t, q)[active]
        if np.abs(gap / sizes).max(initial=0.0) < 1e-14:
            break
        q = q - change(system.jacobian(t, q)[active], gap)
    G = system.jacobian(t, q)[active]
    return np.concatenate([q, v - change(G, G @ v + system.rate(t, q)[active])])


def step_through(
    rhs: Rhs, project: Rhs, t0: float, y0: Array, t1: float, breaks: Array, tolerance: float, longest: float, most: int,
    watch: Callable[[float, int, Array], bool] | None = None, units: Array | None = None,
) -> tuple[Array, Array, Array, int, int]:  # fmt: skip
    """Adaptive steps from t0 to t1: (ends, states, polynomials, status, evaluations).

    The error is measured against the largest value that each component has had; steps end at `breaks`.
    ``watch(t, steps, y)`` may end the run. `units` are sizes of the coordinates that compare (ones by default).
    """
    tab = tableau()
    sign = 1.0 if t1 >= t0 else -1.0
    t, y = t0, np.array(y0, dtype=float)
    K = np.zeros((16, y.size))
    K[0] = rhs(t, y)
    n = y.size // 2
    scale = np.abs(y)
    sizes = np.ones(2 * n) if units is None else np.tile(units, 2)
    h = first_step(y / sizes, K[0] / sizes, abs(t1 - t0))
    ends, states = [t], [y]
    polynomials: list[Array] = []
    status, evaluations = 0, 1
    corners = sorted((b for b in breaks if sign * (b - t0) > 0 and sign * (t1 - b) > 0), key=lambda b: sign * b)
    goals = [*corners, t1]
    fixed = False
    while sign * (t1 - t) > 0.0:
        if len(polynomials) >= most:
            status = 2
            break
        if watch is not None and not watch(t, len(polynomials), y):
            status = STOPPED
            break
        while sign * (goals[0] - t) <= 1e-14 * max(abs(t), abs(t1 - t0)):
            goals.pop(0)
        step = min(h, longest, abs(goals[0] - t))
        fixed = step == abs(goals[0] - t)
        if step < 1e-14 * max(abs(t), abs(t1 - t0)):
            status = 1
            break
        d = sign * step
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for s in range(1, 12):
                    K[s] = rhs(t + tab.C[s] * d, finite(y + d * (tab.A[s, :s] @ K[:s])))
                new = y + d * (tab.B @ K[:12])
                K[12] = rhs(t + d, finite(new))
        except np.linalg.LinAlgError:  # a stage ran away (a singular position): a shorter step, or a status
            h = 0.2 * step
            if step < 1e-12 * max(1e-300, abs(t1 - t0)):
                status = 4
                break
            continue
        evaluations += 12
        reach = np.maximum(scale, np.abs(new))
        limit = np.maximum(reach, step * np.abs(K[12])) * tolerance + 1e-300
        relative = limit / sizes
        limit = limit + 1e-6 * sizes * np.repeat([relative[:n].max(), relative[n:].max()], n)
        five, three = (tab.E5 @ K[:13]) / limit, (tab.E3 @ K[:13]) / limit
        big, small = float(five @ five), float(three @ three)
        error = step * big / math.sqrt((big + 0.01 * small) * y.size) if big > 0.0 else 0.0
        if not np.isfinite(error):
            h = 0.2 * step
            if step < 1e-12 * max(1e-300, abs(t1 - t0)):
                status = 4
                break
            continue
        if error > 1.0:
            h = step * max(0.2, 0.9 * error ** (-1 / 8))
            continue
        for s in range(13, 16):
            K[s] = rhs(t + tab.C[s] * d, y + d * (tab.A[s, :s] @ K[:s]))
        evaluations += 3
        change = new - y
        F = np.empty((7, y.size))
        F[0] = change
        F[1] = d * K[0] - change
        F[2] = 2 * change - d * (K[12] + K[0])
        F[3:] = d * (tab.D @ K)
        t = goals[0] if fixed else t + d
        polynomials.append(F)
        y = project(t, new)
        scale = np.maximum(scale, np.abs(y))
        K[0] = rhs(t, y)
        evaluations += 1
        ends.append(t)
        states.append(y)
        h = step * min(6.0, 0.9 * max(error, 1e-12) ** (-1 / 8)) if not fixed or error > 0.01 else max(h, step)
    shape = (len(polynomials), 7, y.size)
    return np.array(ends), np.array(states), np.array(polynomials).reshape(shape), status, evaluations


def finite(y: Array) -> Array:
    """The state itself when it is finite.

    Raises
    ------
    LinAlgError
        When it is not: no right-hand side needs to see it.
    """
    if not np.isfinite(y).all():
        raise np.linalg.LinAlgError("the state is not finite")
    return y


def first_step(y: Array, dy: Array, span: float) -> float:
    """A careful first step: a hundredth of the time in which the speeds change by themselves, or the one from rest in
    which the accelerations move the coordinates by 5e-9 of themselves."""
    n = y.size // 2
    far, speed, pull = (float(np.abs(x).max(initial=0.0)) for x in (y[:n], dy[:n], dy[n:]))
    guess = 1e-3 * span
    if pull > 0.0:
        guess = min(guess, max(0.01 * speed / pull, 1e-4 * math.sqrt(far / pull)))
    return max(guess, 1e-9 * span)
