r"""Along the periodic motions of an oscillator over the speed, round turning points (pseudo-arclength).

With the unknown harmonics x in parts of their scale and :math:`\sigma = \Omega/\Omega_u`, the curve of solutions of
:math:`r(x, \sigma) = 0` has the tangent t of :math:`[r_x\; r_\sigma]\,t = 0`; a step s along it ends on

.. math:: t_x\cdot(x - x_0) + t_\sigma(\sigma - \sigma_0) = s

(Keller 1977; Nayfeh & Balachandran, Applied Nonlinear Dynamics, Sec. 6.1). Where the curve goes on smoothly from one
asked speed to the next, extrapolation of the forces (which know nothing of the resonances behind them) and Newton's
method at that speed do; the two agree or the short steps decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ..typing import Array, ComplexArray
from .balance import (
    FOUND,
    Evaluated,
    Newton,
    Orbit,
    Oscillator,
    Unknowns,
    evaluate,
    flexibility_of,
    jacobian,
    moved,
    settled,
    size_of,
    solve,
    unknowns_of,
    widened,
)

#: Newton steps of a corrector; a step is kept where the correction is smaller than this part of it.
CORRECTIONS, CLOSE = 20, 0.35
#: An extrapolation this near to what is found (in parts of the scale) is on the same curve.
NEAR = 0.2
#: Steps along the curve, in parts of the scale: first, least, largest; growth from one to the next.
FIRST, LEAST, LARGEST, GROWTH = 0.05, 1e-5, 0.4, 1.6
#: Cosine of the largest angle (60 degrees) between tangents a step apart, and how far an arc of that angle ends beside
#: its first tangent, in parts of the step: tan 30 degrees.
ALIGNED, BENT = 0.5, 1.0 / math.sqrt(3.0)
#: A tangent has all harmonics of which this part of a change comes back through the forces: it sees no others.
ALONG = 0.05
#: A step this long at most leads round a turning point.
TURNING = 0.1
#: Steps along the curve between two asked speeds, at most.
MOST = 400
#: Extrapolation takes so many speeds before, Newton's method then so many steps; else the speeds between are halved so
#: many times.
BACK, STEPS, HALVINGS = 3, 10, 3
#: An error below this part of the tolerance lets so many of the harmonics go on.
EASY, FEWER = 0.4, 0.8
#: Change of the speed, relative, for a derivative.
NUDGE = 1e-6


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
        At asked speeds in the order in which the curve passes them, and the one nearest to each turning point.
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
    unknowns: Unknowns
    along: Array  # t_x, packed
    rising: float  # t_sigma


def follow(
    system: Oscillator, speeds: Sequence[float] | Array, start: Orbit, *, tolerance: float, highest: float,
    progress: Callable[[int, int], None] | None = None,
) -> Curve:  # fmt: skip
    """Along the curve of solutions from an orbit at the first of the speeds, until it passes the first or the last one.

    Parameters
    ----------
    speeds
        Asked speeds (rad/s), rising or falling in size.
    tolerance
        Of the error estimate of each orbit.
    highest
        Angular frequency (rad/s) that the harmonics reach at least.
    """
    walk = _Walk(system, np.asarray(speeds, dtype=float), tolerance, highest)
    return walk.run(start, progress)


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
        self.before: Newton | None = None
        self.number = 0  # of the asked speed that was reached
        self.heading = 1

    def run(self, start: Orbit, progress: Callable[[int, int], None] | None) -> Curve:
        orbit, note = self._kept(start), ""
        passed: set[tuple[int, int]] = set()
        while 0 <= self.number + self.heading < len(self.speeds):
            if (len(self.turns), self.number) in passed:  # between two turns each speed is passed once
                note = f"the direction of the curve is lost at {orbit.speed:.6g} rad/s"
                break
            passed.add((len(self.turns), self.number))
            if progress is not None:
                progress(self.number, len(self.speeds) - 1)
            target = float(self.speeds[self.number + self.heading])
            made = self._onward(target) if self.heading > 0 else None
            if made is not None:
                made, self.before = settled(self.system, made, self.before, self.tolerance)
            if made is not None and made.found:
                self.number += 1
                orbit = self._kept(made)
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
        """Harmonics at a speed: what is asked for, and as many more as the orbit before needed."""
        fewer = orbit.error < EASY * self.tolerance
        return max(
            self.system.harmonics(speed, self.highest),
            self.system.rounded(FEWER * orbit.harmonics if fewer else orbit.harmonics),
        )

    def _onward(self, speed: float, halvings: int = HALVINGS) -> Orbit | None:
        """Orbit at a speed by extrapolation, where needed over speeds between."""
        if len(self.back) < (2 if self.turns else 1):  # one orbit behind a turning point does not tell its side
            return None
        made = self._extrapolated(speed)
        if made is not None or not halvings:
            return made
        if self._onward(0.5 * (speed + self.back[-1].speed), halvings - 1) is None:
            return None
        return self._onward(speed, halvings - 1)

    def _extrapolated(self, speed: float) -> Orbit | None:
        """Orbit at a speed from those before on this branch, where both agree."""
        back, system = self.back[-BACK:], self.system
        count = self._count(speed, back[-1])
        known = np.array([widened(o.forces, count) for o in back])
        forces = _lagrange(np.array([o.speed for o in back]), known, speed)
        places = moved(system, flexibility_of(system, speed, count), forces)
        orbit, self.before = solve(system, speed, places, self.tolerance, self.before, steps=STEPS)
        if not orbit.found:
            return None
        step = size_of(places - back[-1].with_harmonics(count), system.scale)
        off = size_of(orbit.places - places, system.scale)
        if off > max(CLOSE * step, NEAR):
            return None
        self.back.append(orbit)
        return orbit

    def _stepwise(self, orbit: Orbit) -> Orbit | str:
        """Short steps along the curve until it passes the next asked speed, up or down."""
        sign = 1.0 if self.speeds[-1] >= self.speeds[0] else -1.0
        place = self._tangent(orbit, None, sign * self.heading)
        if place is None:
            return f"no direction of the curve at {orbit.speed:.6g} rad/s"
        place = self._toward(orbit, place)
        step, speeds = FIRST, self.speeds
        for _ in range(MOST):
            new, quick = self._corrected(place, step)
            if new is None:
                step *= 0.5
                if step < LEAST:
                    return f"no motion was found beyond {place.orbit.speed:.6g} rad/s on this branch"
                continue
            turned = new.rising * place.rising < 0.0
            asked = [k for k in (self.number - 1, self.number, self.number + 1) if 0 <= k < len(speeds)]
            a, b = place.orbit.speed, new.orbit.speed
            passed = [k for k in asked if (a - speeds[k]) * (b - speeds[k]) <= 0.0 and a != speeds[k]]
            if turned and step > (2.0 * LEAST if passed else TURNING):  # in which order, and where: shorter steps tell
                step *= 0.5
                continue
            if turned:
                nearest = min(place, new, key=lambda p: abs(p.rising)).orbit
                self.orbits.append(nearest)
                self.branch.append(len(self.turns))
                speed = _turning(place, new, step, self.unit)
                self.turns.append(Turn(speed, len(self.orbits) - 1))
                self.heading = -self.heading
            off = self._left(b) or self._beyond(new.orbit)
            if passed:
                landed = self._landed(place, new, float(speeds[passed[0]]))
                if landed is None and step > 4.0 * LEAST:  # from nearer
                    step *= 0.25
                    continue
                if landed is None:
                    return f"no motion was found at {speeds[passed[0]]:.6g} rad/s on this branch"
                self.number = passed[0]
                self.last = new if turned else place
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

    last: _Place | None = None

    def _toward(self, orbit: Orbit, place: _Place) -> _Place:
        """The tangent in the direction in which the curve was followed."""
        last = self.last
        if last is None or abs(last.orbit.speed - orbit.speed) > self.unit:
            return place
        made = self._tangent(orbit, last, 1.0)
        return place if made is None else made

    def _equations(self, orbit: Orbit) -> tuple[Evaluated, ComplexArray]:
        H = self.system.flexibility(orbit.speed, orbit.harmonics)
        return evaluate(self.system, orbit.speed, orbit.places, self.system.lattice(orbit.harmonics), H), H

    def _tangent(self, orbit: Orbit, last: _Place | None, sign: float) -> _Place | None:
        at, H = self._equations(orbit)
        unknowns = unknowns_of(self.system, orbit.speed, orbit.places, at, H, ALONG)
        M = self._bordered(orbit, unknowns, at, H)
        if last is None:
            M[-1, -1] = sign
        else:
            M[-1, :-1], M[-1, -1] = _moved(last, unknowns), last.rising
        right = np.zeros(len(M))
        right[-1] = 1.0
        try:
            t = np.linalg.solve(M, right)
        except np.linalg.LinAlgError:
            return None
        t /= np.linalg.norm(t)
        return _Place(orbit, unknowns, t[:-1], float(t[-1]))

    def _bordered(self, orbit: Orbit, unknowns: Unknowns, at: Evaluated, H: ComplexArray) -> Array:
        """[r_x r_sigma] with an empty last row."""
        J = jacobian(self.system, orbit.speed, unknowns, at, H)
        M = np.zeros((len(J) + 1, len(J) + 1))
        M[:-1, :-1] = J
        other = replace(orbit, speed=orbit.speed * (1.0 + NUDGE))
        change = (self._equations(other)[0].residual - at.residual) / (NUDGE * orbit.speed / self.unit)
        M[:-1, -1] = unknowns.packed(change, self.system.scale)
        return M

    def _corrected(self, place: _Place, step: float) -> tuple[_Place | None, bool]:
        """Next point of the curve, and whether it was found easily."""
        system, unknowns = self.system, place.unknowns
        speed = place.orbit.speed + step * place.rising * self.unit
        guess = place.orbit.with_harmonics(max(self._count(speed, place.orbit), int(unknowns.lines[-1])))
        guess[unknowns.lines, unknowns.freedoms] += unknowns.unpacked(step * place.along, system.scale)
        made = self._newton(Orbit(speed, guess, np.zeros_like(guess), math.nan, False, 0), place, step)
        if made is None or made.steps > CORRECTIONS:
            return None, False
        new = self._tangent(made, place, 1.0)
        if new is None:
            return None, False
        aligned = _moved(place, new.unknowns) @ new.along + new.rising * place.rising
        if aligned < ALIGNED or abs(made.speed - speed) > BENT * step * self.unit:  # round a bend, or on another curve
            return None, False
        return new, made.steps <= 8

    def _newton(self, orbit: Orbit, place: _Place, step: float) -> Orbit | None:
        unknowns, scale = place.unknowns, self.system.scale
        begin = unknowns.packed(place.orbit.places, scale)
        factors = None
        size = math.inf
        for taken in range(1, CORRECTIONS + 1):
            at, H = self._equations(orbit)
            last = (
                place.along @ (unknowns.packed(orbit.places, scale) - begin)
                + place.rising * (orbit.speed - place.orbit.speed) / self.unit
                - step
            )
            found = math.hypot(size_of(at.residual, scale), last)
            if found < FOUND * self.tolerance:
                return replace(orbit, forces=at.forces, found=True, steps=taken)
            if not math.isfinite(found) or found > 10.0 * size:
                return None
            if factors is None or found > 0.2 * size:
                M = self._bordered(orbit, unknowns, at, H)
                M[-1, :-1], M[-1, -1] = place.along, place.rising
                factors = lu_factor(M, check_finite=False)
            size = found
            change = lu_solve(factors, np.append(unknowns.packed(at.residual, scale), last), check_finite=False)
            places = orbit.places - at.residual
            where = unknowns.lines, unknowns.freedoms
            places[where] = orbit.places[where] - unknowns.unpacked(change[:-1], scale)
            orbit = replace(orbit, speed=orbit.speed - change[-1] * self.unit, places=places)
        return None

    def _landed(self, one: _Place, two: _Place, speed: float) -> Orbit | None:
        """Orbit at a speed between two points of the curve."""
        a, b = one.orbit, two.orbit
        part = (speed - a.speed) / (b.speed - a.speed)
        count = max(a.harmonics, b.harmonics)
        guess = (1.0 - part) * a.with_harmonics(count) + part * b.with_harmonics(count)
        orbit, newton = solve(self.system, speed, guess, self.tolerance)
        if not orbit.found:
            return None
        orbit, self.before = settled(self.system, orbit, newton, self.tolerance)
        return orbit if orbit.found else None


def _moved(place: _Place, unknowns: Unknowns) -> Array:
    """A tangent over other unknowns, 0 where it had none."""
    one = np.ones(int(max(unknowns.freedoms.max(), place.unknowns.freedoms.max())) + 1)
    made = np.zeros((int(max(unknowns.lines[-1], place.unknowns.lines[-1])) + 1, len(one)), dtype=complex)
    made[place.unknowns.lines, place.unknowns.freedoms] = place.unknowns.unpacked(place.along, one)
    return unknowns.packed(made, one)


def _lagrange(x: Array, values: ComplexArray, at: float) -> ComplexArray:
    """Polynomial through values at x, at another place."""
    weights = [np.prod([(at - b) / (a - b) for b in x if b != a]) for a in x]
    return np.asarray(np.tensordot(np.array(weights), values, axes=1))


def _turning(a: _Place, b: _Place, step: float, unit: float) -> float:
    """Speed (rad/s) at which the cubic turns that has the speeds and rises of two points, a step along the first's
    tangent apart.
    """
    turned = _moved(a, b.unknowns) @ b.along + a.rising * b.rising
    one, two, rise = step * unit * a.rising, step * unit * b.rising / turned, b.orbit.speed - a.orbit.speed
    cubic = np.polynomial.Polynomial([a.orbit.speed, one, 3.0 * rise - 2.0 * one - two, one + two - 2.0 * rise])
    ends = np.real(cubic.deriv().roots())
    return float(cubic(ends[(ends >= 0.0) & (ends <= 1.0)][0]))
