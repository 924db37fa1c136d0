r"""Minimum of a convex energy by Newton's method with a shift, as in Levenberg and Marquardt.

The step solves :math:`(H + \mu D)\,\Delta x = -g`, D a diagonal of typical stiffnesses; :math:`\mu` falls where the
quadratic model predicts the energy well and grows where it does not (J. Nocedal and S. J. Wright, Numerical
Optimization, 2nd ed., 2006, ch. 10). So it starts where a bearing without load has no stiffness yet, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array

#: Steps at most.
MOST_STEPS = 300
#: Gradient, in parts of the load, at which the energy is at its minimum.
CLOSE = 1e-10
#: Least shift, in parts of the largest stiffness: free directions without a load stay where they are.
LEAST_SHIFT = 1e-13
#: Coordinates beyond this many of their typical values run away: the energy has no minimum.
FAR = 1e6


@dataclass(frozen=True, eq=False)
class Minimum:
    """A point of least energy, or the last one before the search was given up.

    Attributes
    ----------
    place : ndarray, shape (n,)
        The point.
    converged
        Whether the gradient vanishes there.
    steps
        Newton steps taken.
    residual
        Gradient in parts of the load.
    """

    place: Array
    converged: bool
    steps: int
    residual: float


def least_energy(
    energy: Callable[[Array], tuple[float, Array, Array]], start: Array, scale: Array, load: float
) -> Minimum:
    """Return the minimum of a convex energy.

    Parameters
    ----------
    energy : callable
        Point to (energy, gradient, second derivative).
    start : ndarray, shape (n,)
        Where to start.
    scale : ndarray, shape (n,)
        A typical value of each coordinate: gradients count times these.
    load : float
        Gradient times scale that the residual is measured by.
    """
    x, shift = np.array(start, dtype=float), 1.0
    value, gradient, second = energy(x)
    for step in range(MOST_STEPS):
        scaled, curvature = gradient * scale, second * np.outer(scale, scale)
        residual = float(np.abs(scaled).max()) / load
        if residual <= CLOSE:
            return Minimum(x, True, step, residual)
        size = max(float(np.diag(curvature).max()), load)
        move = -np.linalg.solve(curvature + shift * size * np.eye(len(x)), scaled)
        gain = -(scaled @ move + 0.5 * move @ curvature @ move)
        trial = x + scale * move
        new = energy(trial)
        # within round-off of the energy the gradient decides
        rounding = 1e-14 * (abs(value) + abs(float(scaled @ move)))
        better = value - new[0] >= 0.1 * gain or (
            gain <= rounding and float(np.abs(new[1] * scale).max()) < float(np.abs(scaled).max())
        )
        if np.isfinite(new[0]) and better:
            x, (value, gradient, second) = trial, new
            shift = max(0.1 * shift, LEAST_SHIFT)
        else:
            shift *= 10.0
        if shift > 1.0 / LEAST_SHIFT or float(np.abs(x / scale).max()) > FAR:
            break
    residual = float(np.abs(gradient * scale).max()) / load
    return Minimum(x, residual <= CLOSE, step + 1, residual)
