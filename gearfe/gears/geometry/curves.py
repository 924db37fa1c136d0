"""Plane curves of a gear tooth with exact points, normals and arc lengths; points and vectors are complex numbers.

The involute is described by the roll length s, the length of its tangent to the base circle (ISO 21771, 4.3): with
tau = B - s/r_b, e1 = exp(i tau), e2 = i e1 and B = psi + inv(alpha),

    P(s) = r_b e1 + s e2,    radius = sqrt(r_b^2 + s^2),    polar angle = B - (s/r_b - atan(s/r_b)),    normal = e2.

The root is the envelope of a rack tip rounded with radius rho. Its round's centre lies d below the pitch line. The
common normal of a cutter and its envelope passes through the instantaneous centre (Litvin & Fuentes, *Gear Geometry and
Applied Theory*, ch. 6). So the contact normal n = (sin g, -cos g) passes through the pitch point (0, r), and rack and
gear touch at (0, r) + L n with L = d/cos g + rho. By then the rack has moved by X_m = d tan g - c_x, and the gear has
rolled by X_m/r. The transverse section of a helical gear's rack is stretched along the pitch line by q = 1/cos(beta),
so the round is an ellipse. Its point with the normal n lies q^2 rho sin(g)/w beside and rho cos(g)/w below its centre,
w^2 = 1 + (q^2 - 1) sin^2 g. So L = d/cos g + rho/w and X_m = d tan g - (q^2 - 1) rho sin(g)/w - c_x.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from ...base.typing import Array, ComplexArray
from .deviation import Deviation

Point = tuple[float, float]

_PANELS = 24
#: Most steps of Newton's method for a roll length, and its moves that are rounding, in parts of the longest.
NEWTON, ROLL_ROUNDING = 12, 1e-15


@cache
def _gauss() -> tuple[Array, Array]:
    """Points and weights on -1..1; made on first use, because gears that cannot run are refused before that."""
    return np.polynomial.legendre.leggauss(12)


def inv(angle: float) -> float:
    """Involute function tan(angle) - angle; `angle` in rad."""
    return math.tan(angle) - angle


def inverse_inv(value: float) -> float:
    """Angle (rad) in [0, pi/2) with ``inv(angle) = value >= 0``; Newton on the convex u - atan(u) from above."""
    if value <= 0.0:
        return 0.0
    u = value + math.pi / 2
    for _ in range(200):
        step = (u - math.atan(u) - value) * (1.0 + u * u) / (u * u)
        u -= step
        if abs(step) <= 1e-16 * u:
            break
    return math.atan(u)


def bisect(function: Callable[[float], float], low: float, high: float) -> float:
    """Point where `function` changes from negative (at `low`) to positive (at `high`), to the last bit."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if function(middle) < 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@dataclass(frozen=True)
class Arc:
    """Circular arc, passed clockwise with the material on the side of its centre; angles in rad, lengths in m.

    With a negative radius the angle is still that of the outward normal, but the point lies opposite to it, and the
    material is on the far side from the centre. Tip and root circles of internal gears and concave fillets are such
    arcs.
    """

    centre: Point
    radius: float
    start_angle: float
    end_angle: float

    def point(self, t: Array) -> ComplexArray:
        return complex(*self.centre) + self.radius * self.normal(t)

    def normal(self, t: Array) -> ComplexArray:
        return np.exp(1j * (self.start_angle + t * (self.end_angle - self.start_angle)))

    def speed(self, t: Array) -> Array:
        return np.full(np.shape(t), abs(self.radius * (self.start_angle - self.end_angle)))


@dataclass(frozen=True)
class Trochoid:
    """Envelope of the rack's tip round, from the root circle (g = 0) to the normal angle `end` (rad).

    `depth` d (m), `radius` rho (m) and `offset` c_x (m) place the round of the rack tooth, whose middle meets the
    gear's space at polar angle `space_angle` (rad). `reference_radius` is r (m). `stretch` q is that of the round along
    the pitch line. Its speed is L + X' (L/r - cos g), rho + L d/(r cos^2 g) for q = 1, and d(R^2)/dg = 2 r sin g times
    it: the radius R grows all along the curve.
    """

    reference_radius: float
    depth: float
    radius: float
    offset: float
    space_angle: float
    end: float
    stretch: float = 1.0

    def at(self, g: Array) -> ComplexArray:
        """Points (m) where the contact normal has the angle g (rad), shape (n,)."""
        reach = self.depth / np.cos(g) + self.radius / self._widened(g)
        return (1j * self.reference_radius - 1j * reach * np.exp(1j * g)) * self._turn(g)

    def point(self, t: Array) -> ComplexArray:
        return self.at(t * self.end)

    def normal(self, t: Array) -> ComplexArray:
        g = t * self.end
        return 1j * np.exp(1j * g) * self._turn(g)

    def speed(self, t: Array) -> Array:
        g = t * self.end
        widened, over = self._widened(g), self.stretch**2 - 1.0
        reach = self.depth / np.cos(g) + self.radius / widened
        # what the stretch adds to the radius of curvature of the round, and to the move X' of the rack
        beside = -over * self.radius * np.cos(g) / widened**3
        round_ = self.radius / widened - beside * np.cos(g)
        move = self.depth + beside * np.cos(g) ** 2  # X' cos^2 g
        return self.end * np.abs(round_ + reach * move / (self.reference_radius * np.cos(g) ** 2))

    def _turn(self, g: Array) -> ComplexArray:
        move = self.depth * np.tan(g) - self.offset
        if self.stretch != 1.0:
            move = move - (self.stretch**2 - 1.0) * self.radius * np.sin(g) / self._widened(g)
        return np.exp(1j * (move / self.reference_radius + self.space_angle - math.pi / 2))

    def _widened(self, g: Array) -> Array:
        """w at normal angles g (rad), 1 where the round is a circle."""
        return np.sqrt(1.0 + (self.stretch**2 - 1.0) * np.sin(g) ** 2)


@dataclass(frozen=True)
class CutterTrochoid:
    """Envelope of a pinion-type cutter's tip round in an internal gear, from the root circle (g = 0) to the flank.

    Gear and cutter roll on pitch circles of the radii `gear_radius` R and `cutter_radius` R_0 (m) about centres on one
    side of the pitch point P. The round has the radius `radius` rho (m). Its centre Q lies at the radius
    `centre_radius` r_c (m) of the cutter, and at the polar angle `half_angle` theta (rad) from the middle of the
    cutter's tooth. That tooth faces the middle of the gear's space at polar angle pi + `space_angle` (rad). The normal
    at the angle g to the line of centres passes through P (Litvin & Fuentes, ch. 6). With D = sqrt(r_c^2 - R_0^2 sin^2
    g), Q lies L = D - R_0 cos g from P. The gear has then turned by chi = R_0/R (arg(R_0 + L exp(i g)) - theta). The
    speed along the curve is (L + rho) - chi' (R cos g + L + rho) with chi' = R_0 L/(R D).
    """

    gear_radius: float
    cutter_radius: float
    centre_radius: float
    half_angle: float
    radius: float
    space_angle: float
    end: float

    def point(self, t: Array) -> ComplexArray:
        g = t * self.end
        reach = self._root(g) - self.cutter_radius * np.cos(g) + self.radius
        return -(self.gear_radius + reach * np.exp(1j * g)) * np.exp(1j * (self.space_angle - self._turn(g)))

    def normal(self, t: Array) -> ComplexArray:
        g = t * self.end
        return np.asarray(np.exp(1j * (g + self.space_angle - self._turn(g))))

    def speed(self, t: Array) -> Array:
        return np.abs(self.advance(t))

    def advance(self, t: Array) -> Array:
        """Derivative of the arc length (m) with t; negative where the curve runs backwards."""
        g = t * self.end
        root = self._root(g)
        length = root - self.cutter_radius * np.cos(g)
        turning = self.cutter_radius / self.gear_radius * length / root
        reach = length + self.radius
        return np.asarray(self.end * (reach - turning * (self.gear_radius * np.cos(g) + reach)))

    def _root(self, g: Array) -> Array:
        return np.asarray(np.sqrt(self.centre_radius**2 - (self.cutter_radius * np.sin(g)) ** 2))

    def _turn(self, g: Array) -> Array:
        length = self._root(g) - self.cutter_radius * np.cos(g)
        place = np.arctan2(length * np.sin(g), self.cutter_radius + length * np.cos(g))
        return np.asarray(self.cutter_radius / self.gear_radius * (place - self.half_angle))


#: Curves between root circle and involute.
Root = Trochoid | CutterTrochoid | Arc


@dataclass(frozen=True)
class Involute:
    """Involute, moved inwards along its normal by a tip relief delta(s) = amount ((s - relief_start)/length)^exponent.

    With u = s/r_b: Q = P - delta e2, dQ/ds = (u - delta/r_b) e1 - delta' e2; normal along (u - delta/r_b) e2 +
    delta' e1.
    The parameter is linear in the roll length from `start` to `end` (m). At a kink (exponent 1, s = relief_start) the
    normal is that of the unrelieved side. The flank of an internal gear has a negative base radius and negative roll
    lengths.
    """

    base_radius: float
    base_angle: float
    start: float
    end: float
    amount: float = 0.0
    relief_start: float = math.inf
    length: float = 1.0
    exponent: float = 1.0
    deviation: Deviation | None = None

    @property
    def modified(self) -> bool:
        """Whether it is not the involute itself."""
        return self.amount > 0.0 or self.deviation is not None

    @cached_property
    def kinks(self) -> tuple[float, ...]:
        """Rising roll lengths (m) within the flank where its normal jumps: of a linear relief, of the deviation."""
        found = set() if self.deviation is None else set(self.deviation.kinks)
        if self.amount > 0.0 and self.exponent == 1.0:
            found.add(self.relief_start)
        return tuple(sorted(s for s in found if self.start < s < self.end))

    def relief(self, s: Array) -> tuple[Array, Array]:
        """Relief (m), less the deviation, and its slope d delta/ds (-) at roll lengths s (m)."""
        s = np.asarray(s, dtype=float)
        depth, slope = np.zeros_like(s), np.zeros_like(s)
        if self.amount > 0.0:
            x = np.maximum(0.0, (s - self.relief_start) / self.length)
            depth = self.amount * x**self.exponent
            slope = np.where(x > 0.0, self.amount * self.exponent / self.length * x ** (self.exponent - 1.0), 0.0)
        if self.deviation is not None:
            height, rise = self.deviation.at(s)
            depth, slope = depth - height, slope - rise
        return depth, slope

    def at(self, s: Array) -> ComplexArray:
        """Points (m) at roll lengths s (m), shape (n,)."""
        beside = s - self.relief(s)[0] if self.modified else s
        return np.exp(1j * (self.base_angle - s / self.base_radius)) * (self.base_radius + 1j * beside)

    def normal_at(self, s: Array) -> ComplexArray:
        """Outward unit normals at roll lengths s (m), shape (n,)."""
        across = 1j * np.exp(1j * (self.base_angle - s / self.base_radius))
        if not self.modified:
            return across
        delta, slope = self.relief(s)
        forward = (s - delta) / self.base_radius
        size = np.hypot(forward, slope)
        turned = (forward - 1j * slope) / np.where(size > 0.0, size, 1.0)
        return np.asarray(across * np.where(size > 0.0, turned, 1.0))

    def roll(self, t: Array) -> Array:
        """Roll length (m) at the parameter t."""
        return self.start + t * (self.end - self.start)

    def parameter(self, roll: Any) -> Any:
        """Parameter t at a roll length (m)."""
        return (roll - self.start) / (self.end - self.start)

    def roll_at(self, radius: Any) -> Array:
        """Roll lengths (m) of the points at radii r (m), from the base circle on: s - delta(s) = sqrt(r^2 - r_b^2)."""
        forward = np.sqrt(np.maximum(0.0, (radius - self.base_radius) * (radius + self.base_radius)))
        if self.base_radius < 0.0:
            forward = -forward
        s = forward
        for _ in range(NEWTON if self.modified else 0):
            depth, slope = self.relief(s)
            move = (s - depth - forward) / (1.0 - slope)
            s = s - move
            if (np.abs(move) <= ROLL_ROUNDING * abs(self.end)).all():
                break
        return np.asarray(s)

    def point(self, t: Array) -> ComplexArray:
        return self.at(self.roll(t))

    def normal(self, t: Array) -> ComplexArray:
        return self.normal_at(self.roll(t))

    def speed(self, t: Array) -> Array:
        s = self.roll(t)
        delta, slope = self.relief(s)
        return (self.end - self.start) * np.hypot((s - delta) / self.base_radius, slope)


@dataclass(frozen=True)
class Segment:
    """One smooth piece of the half profile.

    Parameters
    ----------
    name
        ``root_circle``, ``trochoid`` (or ``fillet``), ``involute``, ``tip_round`` or ``tip``.
    curve
        The exact curve over t in [0, 1].
    start, end
        End points (m), the same numbers in the neighbouring segments.
    breaks
        Parameters 0 < t < 1 where the curvature (or, with a linear relief, the normal) jumps.
    """

    name: str
    curve: Root | Involute
    start: Point
    end: Point
    breaks: tuple[float, ...] = ()

    def points(self, t: Array) -> Array:
        """Points (m) at the parameters t, shape (n, 2); t = 0 and 1 give `start` and `end` exactly."""
        t = np.asarray(t, dtype=float)
        made = coordinates(self.curve.point(t))
        return np.where((t == 0.0)[..., None], self.start, np.where((t == 1.0)[..., None], self.end, made))

    def normals(self, t: Array) -> Array:
        """Outward unit normals of the material at the parameters t, shape (n, 2)."""
        return coordinates(self.curve.normal(np.asarray(t, dtype=float)))

    @property
    def length(self) -> float:
        """Arc length (m)."""
        return float(self._table[1][-1])

    def arc_length_at(self, t: Array) -> Array:
        """Arc length (m) from the start to the parameters t, shape (n,)."""
        knots, sums = self._table
        t = np.clip(np.asarray(t, dtype=float), 0.0, 1.0)
        panel = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
        return sums[panel] + self._integral(knots[panel], t)

    def parameter_at(self, arc_length: Array) -> Array:
        """Parameters t at given arc lengths (m) from the start, shape (n,); safeguarded Newton."""
        knots, sums = self._table
        goal = np.clip(np.asarray(arc_length, dtype=float), 0.0, sums[-1])
        panel = np.clip(np.searchsorted(sums, goal, side="right") - 1, 0, len(knots) - 2)
        low, high = knots[panel], knots[panel + 1]
        t = low + (high - low) * (goal - sums[panel]) / (sums[panel + 1] - sums[panel])
        for _ in range(60):
            excess = sums[panel] + self._integral(knots[panel], t) - goal
            low, high = np.where(excess < 0.0, t, low), np.where(excess > 0.0, t, high)
            speed = self.curve.speed(t)
            newton = t - excess / np.where(speed > 0.0, speed, 1.0)
            inside = (speed > 0.0) & (newton >= low) & (newton <= high)
            step = np.where(inside, newton, 0.5 * (low + high)) - t
            step = np.where(excess == 0.0, 0.0, step)
            t = t + step
            if np.all(np.abs(step) <= 1e-15):
                break
        t = np.where(goal == sums[-1], 1.0, t)
        return np.where(goal == 0.0, 0.0, t)

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        knots = np.union1d(np.linspace(0.0, 1.0, _PANELS + 1), np.asarray(self.breaks, dtype=float))
        return knots, np.concatenate([[0.0], np.cumsum(self._integral(knots[:-1], knots[1:]))])

    def _integral(self, low: Array, high: Array) -> Array:
        half, (x, w) = 0.5 * (high - low), _gauss()
        nodes = (0.5 * (high + low))[..., None] + half[..., None] * x
        return half * (self.curve.speed(nodes) @ w)


def coordinates(points: ComplexArray) -> Array:
    """x and y of complex numbers, shape (..., 2)."""
    return np.stack([points.real, points.imag], axis=-1)
