"""Explicit Runge-Kutta of order 8 (Dormand & Prince; Hairer, Norsett & Wanner I, Sec. II.10) with projection.

Constrained systems are integrated in (q, v) with the accelerations of the index-1 form and projected onto position and
velocity constraints after every step. Systems whose constraints are linear and constant run in modal coordinates
(`gearfe.rigid.modal`), where the projection has nothing to do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..typing import Array
from .corners import TRUSTED, Corners, Path
from .dense import Polynomials, within_run
from .start import Start, on_constraints
from .steps import Status, StepControl, StepLaw, Watch, first_step
from .system import System

SCHEME = "Runge-Kutta of order 8"
LAW = StepLaw(exponent=1 / 8, growth=6.0, least_error=1e-12)
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


#: ``expand(t, y, k)``: derivative k of the system's coordinates in the state y (k = 2 is dear).
Expand = Callable[[float, Array, int], Array]


class Problem(NamedTuple):
    """A first-order problem y' = f(t, y) of a system, y = (coordinates, velocities)."""

    rhs: Rhs
    project: Rhs  # onto the constraints
    expand: Expand
    sizes: Array  # of the components of y that compare
    system: System | None = None  # whose forces may have corners; y then are its (q, v)


@dataclass(frozen=True)
class States:
    """Dense output: polynomials of degree 7 of the state, from which (q, v, a) follow at any time."""

    polynomials: Polynomials
    expand: Expand

    @property
    def times(self) -> Array:
        """Ends of the steps (s)."""
        return self.polynomials.times

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        """Coordinates, velocities or accelerations at the times t."""
        t = within_run(self.times, t)
        return np.array([self.expand(ti, yi, derivative) for ti, yi in zip(t, self.state(t), strict=True)])

    def state(self, t: Array) -> Array:
        """Integrated state y at the times t, (times, 2n)."""
        return self.polynomials(t)


def run_explicit(
    system: System, start: Start, times: Array, *, tolerance: float, longest: float, most: int,
    watch: Watch | None = None,
) -> tuple[States, Status, dict[str, Any]]:  # fmt: skip
    """Integrate; returns (dense output, status, statistics)."""
    n, active, excess = system.size, start.active, start.excess

    def rhs(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], system.acceleration(t, y[:n], y[n:], active, excess)[0]])

    def project(t: float, y: Array) -> Array:
        return np.concatenate(on_constraints(system, t, y[:n], y[n:], active))

    def expand(t: float, y: Array, derivative: int) -> Array:
        return y[derivative * n : (derivative + 1) * n] if derivative < 2 else rhs(t, y)[n:]

    problem = Problem(rhs, project, expand, np.tile(system.units, 2), system)
    y0 = np.concatenate([start.q, start.v])
    options: dict[str, Any] = {"breaks": system.breaks, "longest": longest, "most": most, "watch": watch}
    return run_problem(problem, (start.time, float(times[-1])), y0, tolerance, **options)


def run_problem(
    problem: Problem, span: tuple[float, float], y0: Array, tolerance: float, **options: Any
) -> tuple[States, Status, dict[str, Any]]:
    """Adaptive steps: (dense output, status, statistics); `options` as those of `StepControl`.

    The error is measured against the largest value that each component has had.
    """
    tab, sizes = tableau(), problem.sizes
    y, n = np.array(y0, dtype=float), len(y0) // 2
    t = span[0]
    K = np.zeros((16, y.size))
    K[0] = problem.rhs(t, y)
    scale = np.abs(y)
    relative = y / sizes, K[0] / sizes
    first = first_step(relative[0][:n], relative[1][:n], relative[1][n:], abs(span[1] - span[0]))
    control = StepControl(LAW, span, first, **options)
    corners = Corners(problem.system, control, tolerance)
    ends, coefficients = [t], []
    evaluations = 1

    def state() -> tuple[Array, Array]:
        return problem.expand(t, y, 0), problem.expand(t, y, 1)

    while (d := control.next_step(state)) is not None:
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for s in range(1, 12):
                    K[s] = problem.rhs(t + tab.C[s] * d, finite(y + d * (tab.A[s, :s] @ K[:s])))
                new = y + d * (tab.B @ K[:12])
                K[12] = problem.rhs(t + d, finite(new))
        except np.linalg.LinAlgError:  # a stage ran away (a singular position): a shorter step, or a status
            control.fail(Status.NOT_FINITE)
            continue
        evaluations += 12
        error = _error(tab, K, d, np.maximum(scale, np.abs(new)), sizes, tolerance)
        if not np.isfinite(error):
            control.fail(Status.NOT_FINITE)
            continue
        if error > (1.0 if corners.system is None else TRUSTED):
            control.reject(error)
            continue
        for s in range(13, 16):
            K[s] = problem.rhs(t + tab.C[s] * d, y + d * (tab.A[s, :s] @ K[:s]))
        evaluations += 3
        polynomial = _polynomial(tab, K, d, y, new)
        if corners.cut(t, d, _path(polynomial, d)):
            continue
        if error > 1.0:
            control.reject(error)
            continue
        coefficients.append(polynomial)
        t = control.accept(error)
        y = problem.project(t, new)
        scale = np.maximum(scale, np.abs(y))
        K[0] = problem.rhs(t, y)
        evaluations += 1
        ends.append(t)
    dense = Polynomials(np.array(ends), np.array(coefficients).reshape(len(coefficients), 8, y.size))
    statistics = {"scheme": SCHEME, "steps": control.accepted, "evaluations": evaluations}
    return States(dense, problem.expand), control.status, statistics


def _error(tab: Tableau, K: Array, d: float, reach: Array, sizes: Array, tolerance: float) -> float:
    """Error of a step d over the tolerance, by the embedded methods of order 5 and 3."""
    n = len(reach) // 2
    limit = np.maximum(reach, abs(d) * np.abs(K[12])) * tolerance + 1e-300
    relative = limit / sizes
    limit = limit + 1e-6 * sizes * np.repeat([relative[:n].max(initial=0.0), relative[n:].max(initial=0.0)], n)
    five, three = (tab.E5 @ K[:13]) / limit, (tab.E3 @ K[:13]) / limit
    big, small = float(five @ five), float(three @ three)
    return 0.0 if big == 0.0 else abs(d) * big / math.sqrt((big + 0.01 * small) * len(reach))


def _path(polynomial: Array, d: float) -> Path:
    """(q, v) at shares of the step."""
    n = polynomial.shape[1] // 2

    def path(x: float | Array) -> tuple[Array, Array]:
        y = (np.asarray(x)[..., None] * d) ** np.arange(8.0) @ polynomial
        return y[..., :n], y[..., n:]

    return path


def _polynomial(tab: Tableau, K: Array, d: float, y: Array, new: Array) -> Array:
    """Coefficients of powers of t - t_k, shape (8, 2n), of y + x (F0 + (1 - x) (F1 + x (...))), x = (t - t_k)/d."""
    change = new - y
    F = [change, d * K[0] - change, 2 * change - d * (K[12] + K[0]), *(d * (tab.D @ K))]
    out = np.zeros((8, y.size))
    for i, f in enumerate(reversed(F)):
        out[0] += f
        moved = np.roll(out, 1, axis=0)  # times x
        out = moved if i % 2 == 0 else out - moved  # times x, times 1 - x by turns
    out[0] += y
    return out / d ** np.arange(8)[:, None]


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
