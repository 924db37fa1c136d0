r"""Line contact of two elastic bodies at the scale of the contact itself: Hertz's law, and its like at edges.

A line load P (N/m) at s presses the surface of a half plane in by :math:`-\frac{2P}{\pi E'}\ln|x-s|` plus a rigid
motion, :math:`E' = E/(1-\nu^2)` in plane strain (Johnson, *Contact Mechanics*, 1985, ch. 2 and 5). For two bodies
:math:`1/E^* = 1/E'_1 + 1/E'_2`, and an elliptic pressure of half width a gives

.. math::
    u(x) = -\frac{2P}{\pi E^*}\Big(\ln\frac a2 - \frac12 + \frac{x^2}{a^2}\Big), \qquad
    \bar u = -\frac{2P}{\pi E^*}\Big(\ln\frac a2 - \frac14\Big)

in its midst and in the mean under itself. Surfaces with the gap :math:`x^2/2\rho` are so pressed at
:math:`a^2 = b^2 = 4P\rho/(\pi E^*)`, with the peak pressure :math:`p_0 = 2P/(\pi b)` and the approach
:math:`\lambda(P) = u(0)`, up to the rigid motion: P C with a constant C of the bodies' shape, which a finite-element
solution gives.

A body that ends in a sharp edge at the distance x from the point is no half plane. The displacement of its face by a
line load has the two limits of a wedge: :math:`-\frac{2P}{\pi E'}\ln|x-s|` near the load, and far away from it
:math:`-\frac{A P}{E'}\ln x`, with Michell's

.. math:: A = \frac{\cos^2\beta}{\alpha+\tfrac12\sin 2\alpha} + \frac{\sin^2\beta}{\alpha-\tfrac12\sin 2\alpha}

for the half angle :math:`\alpha` of the wedge and the angle :math:`\beta` between its middle and the load (Timoshenko
& Goodier, *Theory of Elasticity*, art. 38): :math:`\pi/2-\alpha` where the load is normal to the face, less by the
angle at which a bearing tip's face falls back from the mate's, to which the load is normal. Between them the face is
taken to move by :math:`-\frac{P}{E'}[\frac2\pi\ln|x-s| + (A-\frac2\pi)\ln(x+s)]`, symmetric as it must be (Betti). Its
second part turns the face too, by the mean slope

.. math:: -\frac{A-2/\pi}{E'}\,\frac4{a^2}\int\!\!\int p(x)\,(x-\bar x)\ln(x+s)\,p(s)\,ds\,dx

under an elliptic pressure of unit force and half width a.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Panels of the numerical contact, times that its range is fitted to the contact, and steps of the search for it.
PANELS, FITS, CHANGES = 48, 4, 30
#: A gap of this many P/E* lies outside the contact: an elliptic one ends at 2/pi.
OUTSIDE = 2.0


def half_width(load: Any, modulus: float, radius: float) -> Any:
    """Half width b (m) of a contact of surfaces with the relative radius of curvature `radius` (m).

    Parameters
    ----------
    load
        Force per width P (N/m).
    modulus
        E* (Pa).
    """
    return np.sqrt(4.0 * load * radius / (math.pi * modulus))


def wedge_factor(interior_angle: float, open_angle: float = 0.0) -> float:
    """A (-) for a load on one face of a wedge with the given angle (rad) between its faces; 2/pi for pi.

    Parameters
    ----------
    open_angle
        Angle (rad) by which the normal of the mate, along which the load acts, leans to the other face: > 0 where the
        tip itself bears, < 0 where a convex face touches below it.
    """
    alpha, beta = 0.5 * interior_angle, 0.5 * (math.pi - interior_angle) - open_angle
    along, across = alpha + 0.5 * math.sin(2 * alpha), alpha - 0.5 * math.sin(2 * alpha)
    return math.cos(beta) ** 2 / along + math.sin(beta) ** 2 / across


class Approach(NamedTuple):
    """What a local contact answers to a load.

    Attributes
    ----------
    approach
        lambda, up to C P (m).
    rate
        d lambda/d P (m2/N).
    moment, moment_rate
        First moment of the pressure about x = 0 (N) and its derivative (m): nothing under Hertz's.
    width
        Half of the contact's width (m).
    pressure
        Largest pressure (Pa).
    smooth
        Whether no sharp edge bears: under one linear elasticity has no bound for the pressure.
    equivalent
        Half width of Hertz's contact whose pressure has the same second moment (m), see `gearfe.contact.half_width`.
    """

    approach: float
    rate: float
    moment: float
    moment_rate: float
    width: float
    pressure: float
    smooth: bool
    equivalent: float


@dataclass(frozen=True)
class Edge:
    """A sharp edge in which one body's face ends.

    Attributes
    ----------
    place
        Its coordinate x (m).
    factor
        (A - 2/pi)/E' (1/Pa).
    body
        Whose face ends, 0 or 1.
    """

    place: float
    factor: float
    body: int = 0


@dataclass(frozen=True)
class LocalContact:
    """Two bodies that touch at x = 0.

    Attributes
    ----------
    modulus
        E* (Pa).
    radius
        Relative radius of curvature at the point (m).
    x, gap : ndarray, shape (n,)
        Gap between the undeformed faces (m) around the point, x rising, as far as both faces reach.
    edges
        Sharp edges of the bodies.
    smooth
        Distance (m) from the point to the nearest place where the gap is not that of smooth curves.
    """

    modulus: float
    radius: float
    x: Array
    gap: Array
    edges: tuple[Edge, ...] = ()
    smooth: float = math.inf
    _logs: tuple[Array, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with np.errstate(divide="ignore"):
            object.__setattr__(self, "_logs", (np.log(np.abs(self.x)), np.log(np.maximum(self.gap, 0.0))))

    @property
    def unit(self) -> float:
        """2/(pi E*) (1/Pa)."""
        return 2.0 / (math.pi * self.modulus)

    @property
    def clear(self) -> float:
        """Half width (m) up to which a contact is Hertz's: what is not smooth lies well beside it."""
        return 0.35 * self.smooth

    def elliptic_mean(self, low: float, high: float) -> float:
        """Mean displacement (m2/N) under an elliptic pressure of unit load from `low` to `high` (m)."""
        made = -self.unit * (math.log(0.25 * (high - low)) - 0.25)
        for edge in self.edges:
            distance, weight = _elliptic(edge, low, high)
            made -= edge.factor * float(weight @ np.log(distance[:, None] + distance) @ weight)
        return made

    def elliptic_turn(self, low: float, high: float) -> tuple[float, float]:
        """Rotations (1/(Pa m2), per force on a unit width) of both faces under the same pressure, towards their edges.

        The mean slope under it, weighed as the moment of an offset is. Beside no edge it is none.
        """
        made = [0.0, 0.0]
        for edge in self.edges:
            distance, weight = _elliptic(edge, low, high)
            off = (distance - 0.5 * (distance[0] + distance[-1])) * 16.0 / (high - low) ** 2
            made[edge.body] -= edge.factor * float((weight * off) @ np.log(distance[:, None] + distance) @ weight)
        return made[0], made[1]

    def under(self, load: float) -> Approach:
        """Approach and contact under the force per width P = `load` > 0 (N/m)."""
        b = float(half_width(load, self.modulus, self.radius))
        if b <= self.clear:
            rigid = sum(e.factor * math.log(2.0 * abs(e.place)) for e in self.edges)
            lam = load * (self.unit * (0.5 - math.log(0.5 * b)) - rigid)
            rate = self.unit * -math.log(0.5 * b) - rigid
            return Approach(lam, rate, 0.0, 0.0, b, 2.0 * load / (math.pi * b), True, b)
        return self._numerical(load)

    def gap_at(self, x: Array) -> Array:
        """Gap (m) at places x, a power law between the known ones."""
        logs, values = self._logs
        at, made = np.log(np.maximum(np.abs(x), 1e-300)), np.zeros_like(x)
        for sign in (-1.0, 1.0):
            known, asked = sign * self.x > 0, sign * x > 0
            if asked.any() and known.any():
                order = np.argsort(logs[known])
                made[asked] = np.exp(np.interp(at[asked], logs[known][order], values[known][order]))
        return made

    def _numerical(self, load: float) -> Approach:
        """Constant pressures on panels, refitted to the contact until it fills them."""
        height = OUTSIDE * load / self.modulus
        inside = np.flatnonzero(self.gap <= height)
        low, high = self.x[max(0, inside[0] - 1)], self.x[min(len(self.x) - 1, inside[-1] + 1)]
        for fit in range(FITS):
            nodes = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.linspace(0.0, math.pi, PANELS + 1))
            pressure, change, approach, rate = self._panels(load, nodes)
            used = np.flatnonzero(pressure > 0)
            first, last = int(used[0]), int(used[-1])
            done = first <= 1 and last >= PANELS - 2
            left = nodes[max(0, first - 1)]
            right = nodes[min(PANELS, last + 2)]
            if done or fit == FITS - 1:
                break
            low, high = left, right
        width = 0.5 * float(nodes[last + 1] - nodes[first])
        middle = 0.5 * float(nodes[last + 1] + nodes[first])
        smooth = all(abs(edge.place - middle) > 1.02 * width for edge in self.edges)
        place, size = 0.5 * (nodes[1:] + nodes[:-1]), np.diff(nodes)
        ends = _end(place, pressure, first, nodes[first], 1), _end(place, pressure, last, nodes[last + 1], -1)
        return Approach(
            approach,
            rate,
            float((place * size) @ pressure),
            float((place * size) @ change),
            0.5 * (ends[1] - ends[0]),
            float(pressure.max()),
            smooth,
            _equivalent(nodes, pressure),
        )

    def _panels(self, load: float, nodes: Array) -> tuple[Array, Array, float, float]:
        """Pressure and its derivative with the load on each panel, approach and its rate."""
        middle, size = 0.5 * (nodes[1:] + nodes[:-1]), np.diff(nodes)
        matrix = -self.unit * np.diff(_primitive(nodes - middle[:, None]), axis=1)
        for edge in self.edges:
            sign = 1.0 if edge.place >= middle[-1] else -1.0
            ends = sign * (edge.place - nodes) + sign * (edge.place - middle)[:, None]
            matrix += sign * edge.factor * np.diff(_primitive(ends), axis=1)
        gap = self.gap_at(middle)
        active = np.ones(len(middle), dtype=bool)
        for _ in range(CHANGES):
            n = int(active.sum())
            system = np.zeros((n + 1, n + 1))
            system[:n, :n] = matrix[np.ix_(active, active)]
            system[:n, n], system[n, :n] = -1.0, size[active]
            right = np.zeros((n + 1, 2))
            right[:n, 0], right[n] = -gap[active], (load, 1.0)
            solved = np.linalg.solve(system, right)
            pressure, change = np.zeros((2, len(middle)))
            pressure[active], change[active] = solved[:n].T
            approach, rate = solved[n]
            overlap = approach - gap - matrix @ pressure
            wanted = np.where(active, pressure > 0, overlap > 1e-12 * abs(load) / self.modulus)
            if (wanted == active).all():
                break
            active = wanted
        return np.maximum(pressure, 0.0), change, float(approach), float(rate)


def _elliptic(edge: Edge, low: float, high: float) -> tuple[Array, Array]:
    """Distances (m) from an edge, and weights, of points that integrate an elliptic pressure of unit force."""
    angle = math.pi * np.arange(1, 17) / 17.0
    x = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)
    return np.abs(x - edge.place), np.sin(angle) ** 2 * 2.0 / 17.0


def _end(place: Array, pressure: Array, outer: int, node: float, inwards: int) -> float:
    """Where the pressure ends: beyond the panel `outer` its square falls on as between the last two.

    The panels in contact change by jumps with the load, this place does not. Under a sharp edge, where the pressure
    rises, it is the panel's outer node.
    """
    inner = outer + inwards
    if not 0 <= inner < len(place):
        return node
    low, high = pressure[outer] ** 2, pressure[inner] ** 2
    if high <= low:
        return node
    end = place[outer] + low / (high - low) * (place[outer] - place[inner])
    beyond = outer - inwards
    most = place[beyond] if 0 <= beyond < len(place) else node
    return float(max(end, most) if inwards > 0 else min(end, most))


def _equivalent(nodes: Array, pressure: Array) -> float:
    """Twice the deviation of constant pressures on panels between `nodes` (m)."""
    load = pressure * np.diff(nodes)
    low, high = nodes[:-1], nodes[1:]
    mean = float(load @ (0.5 * (low + high)) / load.sum())
    low, high = low - mean, high - mean
    return 2.0 * math.sqrt(float(load @ (low * low + low * high + high * high)) / (3.0 * float(load.sum())))


def _primitive(z: Array) -> Array:
    """z ln|z| - z."""
    size = np.abs(z)
    return z * np.log(np.where(size > 0, size, 1.0)) - z
