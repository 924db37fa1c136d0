r"""Floquet multipliers: does a periodic linear system grow from one period to the next?

.. math::
    \dot y = v,\qquad \dot v = -\Omega^2 y - D v + \sum_m p_m(t)\, w_m w_m^T y ,\qquad p_m(t + T) = p_m(t)

The multipliers are the eigenvalues of the monodromy matrix, the map of (y, v) over T; one of modulus > 1 means
parametric instability (Nayfeh & Mook, Nonlinear Oscillations, Sec. 5.2). The constant part is solved exactly
(exponentials of its eigenvalues), the periodic part changes v by an amount that depends on y only, so both alternate
in the splitting of order 4 with six stages for such systems (Blanes & Moan, J. Comput. Appl. Math. 142, 2002, SRKN6b);
steps are halved until the moduli stand still.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .model import TrainModel

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_B = (0.0829844064174052, 0.396309801498368, -0.0390563049223486)
_A = (0.245298957184271, 0.604872665711080)
KICKS = np.array([*_B, 1 - 2 * sum(_B), *_B[::-1]])
DRIFTS = np.array([*_A, 0.5 - sum(_A), 0.5 - sum(_A), *_A[::-1]])
#: Eigenvectors worse conditioned than this are not used; the exponentials then come from the matrix itself.
WORST_CONDITION = 1e8
MOST_STEPS = 1 << 14


def multipliers(
    squares: Array, damping: Array, directions: Array, gains: Callable[[Array], Array], period: float, *,
    tolerance: float = 1e-6, first: int = 64,
) -> Complex | None:  # fmt: skip
    """Floquet multipliers, largest modulus first; None when numbers overflow even with the shortest steps.

    Parameters
    ----------
    squares : (n,)
        Omega^2 (rad2/s2); negative ones are allowed.
    damping : (n, n)
        D (1/s), gyroscopic terms included.
    directions : (n, m)
        w_m.
    gains
        Times (k,) to p_m (k, m).
    period
        T (s).
    tolerance
        Change of any multiplier's modulus from one number of steps to the next, relative to the largest.
    first
        Fewest steps.

    Returns
    -------
    ndarray of complex, shape (2n,)
    """

    def found(steps: int) -> Complex | None:
        # the splitting also steps back: heavy damping then grows, and overflows where steps are long
        with np.errstate(over="ignore", invalid="ignore"):
            X = _monodromy(squares, damping, directions, gains, period, steps)
        return _sorted(np.linalg.eigvals(X)) if np.isfinite(X).all() else None

    steps = first
    before = found(steps)
    while steps < MOST_STEPS:
        steps *= 2
        now = found(steps)
        settled = False
        if now is not None and before is not None:
            settled = bool(np.abs(np.abs(now) - np.abs(before)).max() < tolerance * np.abs(now).max())
        before = now
        if settled:
            break
    return before


def _sorted(values: NDArray[Any]) -> Complex:
    return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])


def _monodromy(
    squares: Array, damping: Array, directions: Array, gains: Callable[[Array], Array], period: float, steps: int
) -> Complex:
    """Map of (omega y, v) over the period: scaled so, the undamped constant part is a rotation."""
    n, h = len(squares), period / steps
    scale = np.maximum(np.sqrt(np.abs(squares)), 1.0 / period)
    A = np.block([[np.zeros((n, n)), np.diag(scale)], [np.diag(-squares / scale), -damping]])
    values, V = np.linalg.eig(A)
    good = np.isfinite(V).all() and np.linalg.cond(V) < WORST_CONDITION
    into = np.vstack([np.zeros_like(directions), directions])
    out = np.vstack([directions / scale[:, None], np.zeros_like(directions)]).T
    if good:
        X: Complex = np.eye(2 * n, dtype=complex)
        into, out = np.linalg.solve(V, into), out @ V
        flows = [np.exp(h * a * values)[:, None] for a in DRIFTS]
    else:
        from scipy.linalg import expm

        X = np.eye(2 * n, dtype=complex)
        flows = [expm(h * a * A) for a in DRIFTS]
    places = np.concatenate([[0.0], np.cumsum(DRIFTS)])
    times = h * (np.arange(steps)[:, None] + places[None, :])
    strength = h * KICKS[None, :, None] * np.asarray(gains(times.ravel())).reshape(steps, len(places), -1)
    for number in range(steps):
        for stage in range(len(places)):
            X += into @ (strength[number, stage][:, None] * (out @ X))
            if stage < len(flows):
                X = flows[stage] * X if good else flows[stage] @ X
    return X


def train_multipliers(model: TrainModel) -> tuple[Complex | None, str]:
    """Multipliers of a train at its steady speed over the common period of its meshes, or the reason for none."""
    speed = model.steady_speed
    assert model.scene.drive is not None
    if model.scene.drive.speed.sines or speed == 0.0:
        return None, "the drive has no steady speed"
    if model.rolling.common_turns is None:
        return None, model.rolling.note
    core, lines = model.core, [line for line in model.meshes if line.curve is not None]
    period = float(model.rolling.common_turns) * 2 * math.pi / abs(speed)
    damping = core.damping.copy()
    if model.scene.damping.gyroscopic:
        for body, first, ratio in zip(model.shafts, model.first, model.ratios, strict=True):
            one, two = core.T[first + 3], core.T[first + 4]
            damping += body.rotor.polar * ratio * speed * (np.outer(one, two) - np.outer(two, one))
    directions = np.array([line.row @ core.T for line in lines]).reshape(len(lines), -1).T

    def gains(t: Array) -> Array:
        return np.array([line.mean - line.stiffness(speed * t) for line in lines]).reshape(len(lines), -1).T

    made = multipliers(core.squares, damping, directions, gains, period)
    return made, "" if made is not None else f"numbers overflow within the common mesh period of {1e3 * period:.4g} ms"
