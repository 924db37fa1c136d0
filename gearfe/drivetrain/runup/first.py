r"""A first motion at a speed, without a guess: it grows out of the state without vibration.

Of the flexibility for all that swings a part s is taken, :math:`s\,H(ik\cdot\omega)` for :math:`k \ne 0`. Without it
only the mean forces are in balance. From there the curve of solutions over s, followed round its turning points, leads
to s = 1. It cannot end before, and it cannot go to infinity, as damping bounds the motions (homotopy; Allgower & Georg,
Introduction to Numerical Continuation Methods, 2003, Ch. 11).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ...base.typing import Array, ComplexArray
from .balance import Orbit, Oscillator, Pushes, settled, solve
from .follow import follow

#: Multiples of each mesh frequency on the way; the error estimate and the band add to them in the end.
FEW = 3


@dataclass(frozen=True, eq=False)
class Growing(Oscillator):
    """An oscillator at one speed; the part s of the vibration replaces the speed."""

    speed: float = 0.0

    def omega(self, _part: float, count: int) -> Array:
        return super().omega(self.speed, count)

    def harmonics(self, _part: float, _highest: float, multiples: int = FEW) -> int:
        return super().harmonics(self.speed, 0.0, multiples)

    def rest(self, _part: float) -> Array:
        return super().rest(self.speed)

    def flexibility(self, part: float, count: int) -> ComplexArray:
        whole = self.linear.flexibility(self.omega(part, count), self.speed)
        return np.concatenate([whole[:1], part * whole[1:]])


def first_motion(system: Oscillator, speed: float, *, tolerance: float, highest: float) -> Orbit | None:
    """Find a steady motion at a speed without a guess, see the module's docstring.

    Parameters
    ----------
    system : Oscillator
        The oscillator.
    speed : float
        Speed of the drive (rad/s).
    tolerance : float
        Of the error estimate, in parts of the scale.
    highest : float
        Angular frequency (rad/s) that the harmonics reach at least.

    Returns
    -------
    orbit : Orbit or None
        None if no motion was found.
    """

    def forces(theta: Array, _part: float, u: Array, du: Array) -> Pushes:
        return system.forces(theta, speed, u, du)

    parts = {item.name: getattr(system, item.name) for item in fields(Oscillator) if item.init} | {"forces": forces}
    grows = Growing(**parts, speed=speed)
    places = np.zeros((grows.harmonics(0.0, 0.0) + 1, system.linear.size), dtype=complex)
    places[0] = system.rest(speed) + (0.0 if system.start is None else system.start)
    start, _ = solve(grows, 0.0, places, tolerance)
    if not start.found:
        return None
    curve = follow(grows, [0.0, 1.0], start, tolerance=tolerance, highest=highest)
    ends = [orbit for orbit in curve.orbits if orbit.speed == 1.0]
    if not ends:
        return None
    count = max(ends[0].harmonics, system.harmonics(speed, highest))
    orbit = settled(system, *solve(system, speed, ends[0].with_harmonics(count), tolerance), tolerance)
    return orbit if orbit.found else None
