"""Locate kinks and jumps of forces within a step of collocation.

The error estimate of a step that crosses a kink is not valid. Such a step is repeated up to just before the kink. A
short step then crosses it, and the method starts again behind it. Jumps are crossed in the same way; poles and ends of
tables are not.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from ...base.typing import Array
from ..core.steps import Status, StepControl
from ..core.system import System

#: Looks within a step; bisections; length of the step over a kink, of the run's and of the tolerance.
LOOKS, HALVINGS, PASSING = 8, 45, 1e-3
#: A force that grows so many times from each of these distances (shares of the step) to the next has a pole.
POLE, POLE_AT = 20.0, (1e-3, 1e-6, 1e-9)
#: A run ends at this share of its length before a pole; until then steps go this part of the way.
POLE_SHARE, POLE_NEARER = 1e-3, 0.7
#: How far beyond the end of a run that stopped loads without a value are sought, as shares of the run's length.
AHEAD = (1e-9, 1e-6, 1e-5)
#: Steps with larger errors (over the tolerance) do not show where discontinuities are.
TRUSTED = 1e3
#: A knot of a profile in this share of a step at either end does not cut it: an error of the cube of the share. A cut
#: is found to 2**-KNOT_HALVINGS of the step.
KNOT_SHARE, KNOT_HALVINGS = 1e-3, 15
#: Rounding of the speed of a stage, relative to positions over the step: 1e-16 by the inverse of the stages' integrals.
ROUNDING = 1e-14
#: (q, q') at shares of a step, one or many of shape (k,).
Path = Callable[[float | Array], tuple[Array, Array]]


class Discontinuities:
    """Cut the steps of a run at the discontinuities of its forces.

    Parameters
    ----------
    system, control
        What runs, and its steps; no system has no discontinuities.
    tolerance
        Of the run.
    """

    def __init__(self, system: System | None, control: StepControl, tolerance: float) -> None:
        self.control = control
        self.system = system if system is not None and system.pieced else None
        self.profiled = system if system is not None and system.has_knots else None
        #: Which load has no value, or grows beyond all bounds, where the run cannot continue.
        self.load_problem = ""
        self.near = max(PASSING * tolerance, 1e-12) * max(control.span, abs(control.t))

    @property
    def cutting(self) -> bool:
        """Return whether the path of a step must be passed to `cut`."""
        return self.system is not None or self.profiled is not None

    def passing(self, h: float) -> bool:
        """Return whether a step crosses a kink, after which the method restarts."""
        return self.system is not None and abs(h) <= 4.0 * self.near

    def cut(self, t: float, h: float, path: Path) -> bool:
        """Return whether the step h from t is rejected; the next one then ends before a kink."""
        system = self.system
        if self.profiled is not None and not self.passing(h) and (share := _knot(self.profiled, path)) < 1.0:
            self.control.end_at(t + share * h)
            return True
        if system is None or self.passing(h) or (found := _kink(system, t, h, path)) is None:
            return False
        low, high, ends = found
        distance = low * abs(h)
        if grows := _pole(system, t, h, path, low):
            self.load_problem = system.load_pole(*grows)
            goal, room = POLE_NEARER * distance, POLE_SHARE * self.control.span
        elif ends:
            goal, room = distance, self.near
        else:
            goal, room = (distance - 0.5 * self.near if distance > self.near else 2.0 * self.near), -1.0
        if distance <= room:
            beyond = (t + high * h, *path(high))
            self.load_problem = system.load_problem(*beyond) or system.load_pole(*beyond) or self.load_problem
            self.control.fail(Status.NOT_FINITE, 1.0)
            self.control.status = Status.NOT_FINITE
        elif goal < abs(h):
            self.control.end_at(t + math.copysign(goal, h))
        else:
            return False
        return True


def _kink(system: System, t: float, h: float, path: Path) -> tuple[float, float, bool] | None:
    """Shares of the step just before and behind the first kink, and whether loads have no value behind it."""
    looks = np.arange(LOOKS + 1) / LOOKS
    found = system.pieces(t + looks * h, *path(looks))
    if (found[0] < 0).any():
        return 0.0, 0.0, True
    left = (found != found[0]).any(axis=1)
    if not left.any():
        return None
    high = float(looks[left.argmax()])
    low = high - 1.0 / LOOKS
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        moved = (system.pieces(t + middle * h, *path(middle)) != found[0]).any()
        low, high = (low, middle) if moved else (middle, high)
    return low, high, bool((system.pieces(t + high * h, *path(high)) < 0).any())


def _knot(system: System, path: Path) -> float:
    """Share of the step at which rows first pass a knot of their profile; 1 where they pass none."""
    looks = np.linspace(KNOT_SHARE, 1.0 - KNOT_SHARE, LOOKS + 1)
    numbers = system.knots(path(looks)[0])
    left = (numbers != numbers[0]).any(axis=1)
    if not left.any():
        return 1.0
    high = float(looks[left.argmax()])
    low = float(looks[left.argmax() - 1])
    for _ in range(KNOT_HALVINGS):
        middle = 0.5 * (low + high)
        moved = (system.knots(path(middle)[0]) != numbers[0]).any()
        low, high = (low, middle) if moved else (middle, high)
    return high


def _pole(system: System, t: float, h: float, path: Path, x: float) -> tuple[float, Array, Array] | None:
    """Return the state (t, q, v) nearest to a pole of forces at the fraction x of the step; None without pole."""
    side = -x if x > 0.5 else 1.0 - x
    sizes = []
    for distance in POLE_AT:
        place = x + distance * side
        there = (t + place * h, *path(place))
        sizes.append(float(np.abs(system.force(*there)).max()))
    return there if all(near > POLE * far for far, near in itertools.pairwise(sizes)) else None


def load_problem_ahead(system: System, t: float, state: tuple[Array, Array, Array], span: float) -> str:
    """Return which load has no value, or a pole, at a state or shortly after it.

    Parameters
    ----------
    system : System
        The system.
    t : float
        Time of the state (s).
    state : tuple of ndarray, shape (size,)
        Coordinates, velocities and accelerations.
    span : float
        Length of the run (s); shares `AHEAD` of it are searched.

    Returns
    -------
    problem : str
        Empty if no load has one, or the state is not finite.
    """
    if not np.isfinite(state).all():
        return ""
    q, v, a = state
    with np.errstate(all="ignore"):
        if problem := system.load_problem(t, q, v) or system.load_pole(t, q, v):
            return problem
        for reach in np.multiply(AHEAD, span):

            def path(x: float | Array, reach: float = float(reach)) -> tuple[Array, Array]:
                way = np.asarray(x)[..., None] * reach
                return q + way * v, v + way * a

            later = (t + reach, *path(1.0))
            if problem := system.load_problem(*later) or system.load_pole(*later):
                return problem
            if (found := _kink(system, t, reach, path)) and (grows := _pole(system, t, reach, path, found[0])):
                return system.load_pole(*grows)
    return ""


def quiet_speeds(c: Array, v: Array, V: Array, vn: Array, scale: Array) -> Array:
    """Replace speeds at the stages that are off a straight line by rounding alone with those of the line.

    They are differences of positions over the step: with short ones no more than rounding. Those of the ends keep the
    constraints.

    Parameters
    ----------
    c : ndarray, shape (s,)
        Shares of the step at the stages.
    v : ndarray, shape (n,)
        Speeds at the begin of the step.
    V : ndarray, shape (s, n)
        Speeds at the stages.
    vn : ndarray, shape (n,)
        Speeds at the end of the step.
    scale : ndarray, shape (n,)
        Size of the positions over the length of the step.
    """
    line = v + c[:, None] * (vn - v)
    return np.where(np.abs(V - line) < ROUNDING * scale, line, V)


def collocated_path(h: float, powers: Array, speeds: Array) -> Path:
    """Path of a step of the implicit method.

    `powers` are coefficients of powers of the fraction x of the step, `speeds` those of powers of the time since its
    end. Velocities from the coordinates would contain their rounding divided by the step.
    """
    p, r = np.arange(float(len(powers))), np.arange(float(len(speeds)))

    def path(x: float | Array) -> tuple[Array, Array]:
        share = np.asarray(x)[..., None]
        return share**p @ powers, (share * h - h) ** r @ speeds

    return path
