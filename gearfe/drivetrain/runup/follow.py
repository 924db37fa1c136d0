r"""Along the periodic motions of an oscillator over the speed, round turning points (pseudo-arclength).

With the harmonics x in parts of their scale and :math:`\sigma = \Omega/\Omega_u`, the curve of solutions of
:math:`r(x, \sigma) = 0` has the tangent t of :math:`[r_x\; r_\sigma]\,t = 0`; a step s along it ends on

.. math:: t_x\cdot(x - x_0) + t_\sigma(\sigma - \sigma_0) = s

(Keller 1977; Nayfeh & Balachandran, Applied Nonlinear Dynamics, Sec. 6.1). Where the curve is smooth from one given
speed to the next, the forces are extrapolated, as they are smooth across resonances, and Newton's method is applied at
that speed. If one of its steps does not contract, the short steps along the curve are taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.progress import count
from ...base.typing import Array, ComplexArray
from .balance import (
    CONTRACTS,
    FOUND,
    INEXACT,
    Evaluated,
    Orbit,
    Oscillator,
    evaluate,
    flexibility_of,
    moved,
    packed,
    product,
    settled,
    size_of,
    solve,
    unpacked,
    widened,
)
from .krylov import gmres

#: Newton steps of a corrector, and of one that lets the next step be longer.
CORRECTIONS, QUICK = 20, 5
#: Steps along the curve, in parts of the scale: first, least, largest; growth from one to the next.
FIRST, LEAST, LARGEST, GROWTH = 0.05, 1e-5, 0.4, 1.6
#: Cosine of the largest angle (60 degrees) between tangents a step apart, and how far an arc of that angle ends beside
#: its first tangent, in parts of the step: tan 30 degrees.
ALIGNED, BENT = 0.5, 1.0 / math.sqrt(3.0)
#: What is left of the equations of a tangent.
TANGENT = 1e-3
#: A step this long at most leads round a turning point.
TURNING = 0.1
#: Steps along the curve between two given speeds, at most.
MOST = 400
#: Extrapolation takes so many speeds before; where it misses, speeds between are halved so many times.
BACK, HALVINGS = 3, 3
#: An error below this part of the tolerance lets so many of the harmonics go on.
EASY, FEWER = 0.4, 0.8
#: Change of the speed for a derivative, in parts of its unit.
NUDGE = 1e-5


class Turn(NamedTuple):
    """A turning point."""

    speed: float  # rad/s
    number: int  # of the orbit nearest to it


@dataclass(frozen=True, eq=False)
class Curve:
    """Orbits along one curve of solutions.

    Attributes
    ----------
    orbits
        At given speeds in the order in which the curve passes them, and the one nearest to each turning point.
    branch
        Number of each orbit's branch: it grows at each turning point.
    turns
        Turning points.
    note
        Why the curve was left, or nothing.
    """

    orbits: tuple[Orbit, ...]
    branch: tuple[int, ...]
    turns: tuple[Turn, ...]
    note: str


class _Place(NamedTuple):
    """A point of the curve with its tangent."""

    orbit: Orbit
    along: ComplexArray  # t_x, (K + 1, m) in parts of the scale
    rising: float  # t_sigma


def follow(
    system: Oscillator, speeds: Sequence[float] | Array, start: Orbit, *, tolerance: float, highest: float,
) -> Curve:  # fmt: skip
    """Follow the curve of solutions from an orbit at the first speed until it passes the first or last speed.

    Parameters
    ----------
    system : Oscillator
        The oscillator.
    speeds : array_like, shape (n,)
        Asked speeds (rad/s), rising or falling in size.
    start : Orbit
        A solution at the first of them.
    tolerance : float
        Of the error estimate of each orbit, in parts of the scale.
    highest : float
        Angular frequency (rad/s) that the harmonics reach at least.
    """
    walk = _Walk(system, np.asarray(speeds, dtype=float), tolerance, highest)
    return walk.run(start)


@dataclass(eq=False)
class _Walk:
    system: Oscillator
    speeds: Array
    tolerance: float
    highest: float

    def __post_init__(self) -> None:
        self.unit = max(abs(float(self.speeds[-1] - self.speeds[0])), 1e-3 * abs(float(self.speeds[0]))) / 20.0
        self.orbits: list[Orbit] = []
        self.branch: list[int] = []
        self.turns: list[Turn] = []
        self.back: list[Orbit] = []  # on this branch, to extrapolate from
        self.number = 0  # of the given speed that was reached
        self.heading = 1
        self.step = FIRST  # along the curve, from one given speed to the next
        self.last: _Place | None = None  # before the orbit that it led to

    def run(self, start: Orbit) -> Curve:
        orbit, note = self._kept(start), ""
        passed: set[tuple[int, int]] = set()
        while 0 <= self.number + self.heading < len(self.speeds):
            if (len(self.turns), self.number) in passed:  # between two turns each speed is passed once
                note = f"the direction of the curve is lost at {orbit.speed:.6g} rad/s"
                break
            passed.add((len(self.turns), self.number))
            count(self.number, len(self.speeds) - 1, "speeds")
            target = float(self.speeds[self.number + self.heading])
            made = self._onward(target) if self.heading > 0 else None
            passes = None if made is None else settled(self.system, *made, self.tolerance)
            if passes is not None and passes.found:
                self.number, self.step, self.last = self.number + 1, FIRST, None
                orbit = self._kept(passes)
                continue
            found = self._stepwise(orbit)
            if isinstance(found, str):
                note = found
                break
            orbit = found
        return Curve(tuple(self.orbits), tuple(self.branch), tuple(self.turns), note)

    def _kept(self, orbit: Orbit) -> Orbit:
        if self.branch and self.branch[-1] != len(self.turns):
            self.back = []
        if self.back and self.back[-1].speed == orbit.speed:
            self.back.pop()
        self.back.append(orbit)
        self.orbits.append(orbit)
        self.branch.append(len(self.turns))
        return orbit

    def _count(self, speed: float, orbit: Orbit) -> int:
        """Harmonics at a speed: those of the band, and as many more as the orbit before needed."""
        fewer = orbit.error < EASY * self.tolerance
        return max(
            self.system.harmonics(speed, self.highest),
            self.system.rounded(FEWER * orbit.harmonics if fewer else orbit.harmonics),
        )

    def _onward(self, speed: float, halvings: int = HALVINGS) -> tuple[Orbit, Evaluated] | None:
        """Orbit at a speed by extrapolation, where needed over speeds between, and the equations there."""
        if len(self.back) < (2 if self.turns else 1):  # one orbit behind a turning point does not define the branch
            return None
        made = self._extrapolated(speed)
        if made is not None or not halvings:
            return made
        if self._onward(0.5 * (speed + self.back[-1].speed), halvings - 1) is None:
            return None
        return self._onward(speed, halvings - 1)

    def _extrapolated(self, speed: float) -> tuple[Orbit, Evaluated] | None:
        """Orbit at a speed in the range of convergence of the extrapolation from those before on this branch."""
        back, system = self.back[-BACK:], self.system
        count = self._count(speed, back[-1])
        known = np.array([widened(o.forces, count) for o in back])
        forces = _lagrange(np.array([o.speed for o in back]), known, speed)
        places = moved(system, speed, flexibility_of(system, speed, count), forces)
        orbit, at = solve(system, speed, places, self.tolerance, near=True)
        if not orbit.found:
            return None
        self.back.append(orbit)
        return orbit, at

    def _stepwise(self, orbit: Orbit) -> Orbit | str:
        """Short steps along the curve until it passes the next given speed, up or down."""
        sign = 1.0 if self.speeds[-1] >= self.speeds[0] else -1.0
        place = self._tangent(orbit, self.last, sign * self.heading)
        if place is None:
            return f"no direction of the curve at {orbit.speed:.6g} rad/s"
        step, speeds = self.step, self.speeds
        for _ in range(MOST):
            new, quick = self._corrected(place, step)
            if new is None:
                step *= 0.5
                if step < LEAST:
                    return f"no motion was found beyond {place.orbit.speed:.6g} rad/s on this branch"
                continue
            turned = new.rising * place.rising < 0.0
            near = [k for k in (self.number - 1, self.number, self.number + 1) if 0 <= k < len(speeds)]
            a, b = place.orbit.speed, new.orbit.speed
            passed = [k for k in near if (a - speeds[k]) * (b - speeds[k]) <= 0.0 and a != speeds[k]]
            if turned and step > (2.0 * LEAST if passed else TURNING):  # order and location need shorter steps
                step *= 0.5
                continue
            if turned:
                nearest = min(place, new, key=lambda p: abs(p.rising)).orbit
                if nearest is not self.orbits[-1]:  # a given speed may be the turning point
                    self.orbits.append(nearest)
                    self.branch.append(len(self.turns))
                speed = _turning(place, new, step, self.unit)
                self.turns.append(Turn(speed, len(self.orbits) - 1))
                self.heading = -self.heading
            off = self._left(b) or self._beyond(new.orbit)
            if passed:
                speed = float(speeds[passed[0]])
                between, at = self._between(place, new, speed)
                if not between.found and step > 4.0 * LEAST:  # from nearer
                    step *= 0.25
                    continue
                landed = settled(self.system, between, at, self.tolerance)
                if not landed.found:
                    why = "with as many harmonics as its error needs" if between.found else "on this branch"
                    return f"no motion was found at {speed:.6g} rad/s {why}"
                self.number = passed[0]
                self.last, self.step = new if turned else place, step
                return self._kept(landed)
            if off:
                self.number = -1 if self.heading < 0 else len(speeds)
                return off
            place = new
            step = min(step * (GROWTH if quick else 1.0), LARGEST)
        return f"more than {MOST} steps along the curve at {place.orbit.speed:.6g} rad/s"

    def _left(self, speed: float) -> str:
        low, high = sorted((float(self.speeds[0]), float(self.speeds[-1])))
        return "" if low - self.unit < speed < high + self.unit else f"the curve leaves the range at {speed:.6g} rad/s"

    def _beyond(self, orbit: Orbit) -> str:
        if size_of(orbit.places, self.system.scale) <= self.system.limit:
            return ""
        return f"the motion grows beyond all that holds at {orbit.speed:.6g} rad/s: too little damping at a resonance"

    def _equations(self, orbit: Orbit) -> tuple[Evaluated, ComplexArray]:
        H = self.system.flexibility(orbit.speed, orbit.harmonics)
        return evaluate(self.system, orbit.speed, orbit.places, self.system.lattice(orbit.harmonics), H), H

    def _tangent(self, orbit: Orbit, last: _Place | None, sign: float) -> _Place | None:
        along, rising = np.zeros_like(orbit.places), sign
        if last is not None:
            along, rising = widened(last.along, orbit.harmonics), last.rising
        right = np.zeros(2 * along.size + 1)
        right[-1] = 1.0
        t = self._solved(orbit, *self._equations(orbit), _Place(orbit, along, rising), right, TANGENT)
        size = float(np.linalg.norm(t))
        if not (0.0 < size < math.inf):
            return None
        t /= size
        return _Place(orbit, unpacked(t[:-1], np.ones(along.shape[1])), float(t[-1]))

    def _solved(
        self, orbit: Orbit, at: Evaluated, H: ComplexArray, beside: _Place, right: Array, part: float
    ) -> Array:  # fmt: skip
        """Solution of ``[r_x r_sigma; t_x t_sigma] x = right`` with the tangent beside."""
        system, scale = self.system, self.system.scale
        changed = product(system, orbit.speed, at, H)
        other = replace(orbit, speed=orbit.speed + NUDGE * self.unit)
        by_speed = (self._equations(other)[0].residual - at.residual) / NUDGE
        column, row = packed(by_speed, scale), packed(beside.along, np.ones(len(scale)))

        def bordered(x: Array) -> Array:
            return np.append(changed(x[:-1]) + column * x[-1], row @ x[:-1] + beside.rising * x[-1])

        return gmres(bordered, right, part)

    def _corrected(self, place: _Place, step: float) -> tuple[_Place | None, bool]:
        """Next point of the curve, and whether it was found easily."""
        speed = place.orbit.speed + step * place.rising * self.unit
        guess = place.orbit.with_harmonics(self._count(speed, place.orbit))
        guess += step * widened(place.along, len(guess) - 1) * self.system.scale
        made = self._newton(Orbit(speed, guess, np.zeros_like(guess), math.nan, False, 0), place, step)
        if made is None or made.steps > CORRECTIONS:
            return None, False
        new = self._tangent(made, place, 1.0)
        if new is None:
            return None, False
        if _cosine(place, new) < ALIGNED or abs(made.speed - speed) > BENT * step * self.unit:  # a bend, another curve
            return None, False
        return new, made.steps <= QUICK

    def _newton(self, orbit: Orbit, place: _Place, step: float) -> Orbit | None:
        scale, count = self.system.scale, orbit.harmonics
        beside = place._replace(along=widened(place.along, count))
        begin, row = packed(place.orbit.with_harmonics(count), scale), packed(beside.along, np.ones(len(scale)))
        size = math.inf
        for taken in range(1, CORRECTIONS + 1):
            at, H = self._equations(orbit)
            last = (
                row @ (packed(orbit.places, scale) - begin)
                + place.rising * (orbit.speed - place.orbit.speed) / self.unit
                - step
            )
            found = math.hypot(size_of(at.residual, scale), last)
            if found < FOUND * self.tolerance:
                return replace(orbit, forces=at.forces, found=True, steps=taken)
            if not found <= CONTRACTS * size:
                return None
            size = found
            change = self._solved(orbit, at, H, beside, np.append(packed(at.residual, scale), last), INEXACT)
            places = orbit.places - unpacked(change[:-1], scale)
            orbit = replace(orbit, speed=orbit.speed - float(change[-1]) * self.unit, places=places)
        return None

    def _between(self, one: _Place, two: _Place, speed: float) -> tuple[Orbit, Evaluated]:
        """Orbit at a speed between two points of the curve, in the range of convergence."""
        a, b = one.orbit, two.orbit
        part = (speed - a.speed) / (b.speed - a.speed)
        count = max(a.harmonics, b.harmonics)
        guess = (1.0 - part) * a.with_harmonics(count) + part * b.with_harmonics(count)
        return solve(self.system, speed, guess, self.tolerance, near=True)


def _cosine(one: _Place, two: _Place) -> float:
    """Of the angle between the tangents of two places."""
    count = max(len(one.along), len(two.along)) - 1
    a, b = (widened(place.along, count) for place in (one, two))
    return float(np.vdot(a, b).real) + one.rising * two.rising


def _lagrange(x: Array, values: ComplexArray, at: float) -> ComplexArray:
    """Polynomial through values at x, at another place."""
    weights = [np.prod([(at - b) / (a - b) for b in x if b != a]) for a in x]
    return np.asarray(np.tensordot(np.array(weights), values, axes=1))


def _turning(a: _Place, b: _Place, step: float, unit: float) -> float:
    """Speed (rad/s) at which the cubic turns that has the speeds and rises of two points, a step along the first's
    tangent apart.
    """
    one, two, rise = step * unit * a.rising, step * unit * b.rising / _cosine(a, b), b.orbit.speed - a.orbit.speed
    cubic = np.polynomial.Polynomial([a.orbit.speed, one, 3.0 * rise - 2.0 * one - two, one + two - 2.0 * rise])
    ends = np.real(cubic.deriv().roots())
    return float(cubic(ends[(ends >= 0.0) & (ends <= 1.0)][0]))
