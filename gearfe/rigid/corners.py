"""Where forces leave their smooth pieces within a step of Runge-Kutta or of the implicit method.

A step that crosses a corner has an error that no estimate sees as it is. Such a step is made again, up to just before
the corner; from there a short one goes over it, and the method begins anew behind it. Jumps are passed like this, too;
poles are not.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from ..typing import Array
from .steps import Status, StepControl
from .system import System

#: Looks within a step; bisections; length of the step over a corner, of the run's and of the tolerance.
LOOKS, HALVINGS, PASSING = 8, 45, 1e-3
#: A force that grows so many times from each of these distances (shares of the step) to the next has a pole.
POLE, POLE_AT = 20.0, (1e-3, 1e-6, 1e-9)
#: A run ends at this share of its length before a pole; until then steps go this part of the way.
POLE_SHARE, POLE_NEARER = 1e-3, 0.7
#: Steps with larger errors (over the tolerance) do not tell where corners are.
TRUSTED = 1e3
#: (q, q') at a share of a step.
Path = Callable[[float], tuple[Array, Array]]


class Corners:
    """Cuts the steps of one run at the corners of its forces.

    Parameters
    ----------
    system, control
        What runs, and its steps; no system has no corners.
    tolerance
        Of the run.
    """

    def __init__(self, system: System | None, control: StepControl, tolerance: float) -> None:
        self.control = control
        self.system = system if system is not None and system.pieced else None
        self.near = max(PASSING * tolerance, 1e-12) * max(control.span, abs(control.t))

    def passing(self, h: float) -> bool:
        """Whether a step is one over a corner, after which the method begins anew."""
        return self.system is not None and abs(h) <= 4.0 * self.near

    def cut(self, t: float, h: float, path: Path) -> bool:
        """Whether the step h from t is not to stand: the control then knows that the next ends before a corner."""
        if self.system is None or self.passing(h):
            return False
        pieces = self.system.pieces
        before = pieces(t, *path(0.0))

        def left(x: float) -> bool:
            return pieces(t + x * h, *path(x)) != before

        high = next((k / LOOKS for k in range(1, LOOKS + 1) if left(k / LOOKS)), None)
        if high is None:
            return False
        low = high - 1.0 / LOOKS
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if left(middle) else (middle, high)
        distance = low * abs(h)
        if self._pole(t, h, path, low):
            if distance > POLE_SHARE * self.control.span:  # goes on up to it
                self.control.end_at(t + POLE_NEARER * low * h)
                return True
            self.control.fail(Status.NOT_FINITE, 1.0)
            self.control.status = Status.NOT_FINITE
            return True
        goal = distance - 0.5 * self.near if distance > self.near else 2.0 * self.near
        if goal >= abs(h):
            return False
        self.control.end_at(t + math.copysign(goal, h))
        return True

    def _pole(self, t: float, h: float, path: Path, x: float) -> bool:
        """Whether the forces have a pole at the share x of the step; their loads then say so."""
        assert self.system is not None
        side = -x if x > 0.5 else 1.0 - x
        sizes = []
        for distance in POLE_AT:
            place = x + distance * side
            there = (t + place * h, *path(place))
            sizes.append(float(np.abs(self.system.force(*there)).max()))
        if not all(near > POLE * far for far, near in itertools.pairwise(sizes)):
            return False
        self.system.blame(*there)
        return True


def collocated_path(h: float, powers: Array, speeds: Array) -> Path:
    """Path of a step of the implicit method.

    `powers` are coefficients of powers of the share x of the step, `speeds` of powers of the time since its end
    (velocities from the coordinates would be their rounding over the step).
    """
    p, r = np.arange(float(len(powers))), np.arange(float(len(speeds)))
    return lambda x: (x**p @ powers, (x * h - h) ** r @ speeds)
