"""Where forces leave their smooth pieces within a step of the implicit method.

A step that crosses a corner has an error that no estimate sees as it is. Such a step is made again, up to just before
the corner; from there a short one goes over it, and the method begins anew behind it. Jumps are passed like this, too.
"""

from __future__ import annotations

import math

import numpy as np

from ..typing import Array
from .collocated import QUINTIC
from .steps import StepControl
from .system import System

#: Looks within a step; bisections; length of the step over a corner, of the run's and of the tolerance.
LOOKS, HALVINGS, PASSING = 8, 45, 1e-3


class Corners:
    """Cuts the steps of one run at the corners of its forces.

    Parameters
    ----------
    system, control
        What runs, and its steps.
    tolerance
        Of the run.
    """

    def __init__(self, system: System, control: StepControl, tolerance: float) -> None:
        self.system, self.control = system, control
        self.near = max(PASSING * tolerance, 1e-12) * max(control.span, abs(control.t))
        self.off = not any(hasattr(element, "pieces") for element in system.elements)

    def passing(self, h: float) -> bool:
        """Whether a step is one over a corner, after which the method begins anew."""
        return not self.off and abs(h) <= 4.0 * self.near

    def cut(self, t: float, h: float, known: tuple[Array, ...], speeds: Array) -> bool:
        """Whether the step h from t is to be made again up to its first corner, which the control then knows.

        `known` are q, q' at its begin, q at the first two stages, q, q' at its end; `speeds` coefficients of powers of
        the time since its end.
        """
        if self.off or self.passing(h):
            return False
        before = self.system.pieces(t, known[0], known[1])
        if not before:
            self.off = not self.system.pieces(t + h, known[4], known[5])
            return False
        q0, v0, one, two, q1, v1 = known
        powers = QUINTIC @ np.stack([q0, h * v0, one, two, q1, h * v1])

        def left(x: float) -> bool:
            rates = (x * h - h) ** np.arange(4.0) @ speeds
            return self.system.pieces(t + x * h, x ** np.arange(6.0) @ powers, rates) != before

        looks = [k / LOOKS for k in range(1, LOOKS + 1)]
        high = next((x for x in looks if left(x)), None)
        if high is None:
            return False
        low = high - 1.0 / LOOKS
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if left(middle) else (middle, high)
        distance = low * abs(h)
        goal = distance - 0.5 * self.near if distance > self.near else 2.0 * self.near
        if goal >= abs(h):
            return False
        self.control.end_at(t + math.copysign(goal, h))
        return True
