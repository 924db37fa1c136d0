"""Flexible links as plain data: section, material, elements and start of a straight beam."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .bodies import Body
from .forms import Point

#: Nodes of an element on -1..1 (Gauss-Lobatto).
NODES = np.array([-1.0, -math.sqrt(0.2), math.sqrt(0.2), 1.0])
#: Points closer than this share of the length share a node.
TOGETHER = 1e-9


@dataclass(frozen=True)
class Section:
    """Cross-section of a beam.

    Parameters
    ----------
    area : float
        Area A (m2).
    second_moment : float
        Second moment of area I about the axis of bending (m4).
    edge : float, optional
        Distance of the outer fibre from the axis (m), for stresses.
    shear_factor : float
        Part of the area that carries shear.
    """

    area: float
    second_moment: float
    edge: float | None = None
    shear_factor: float = 5.0 / 6.0

    @classmethod
    def rectangle(cls, width: float, height: float) -> Section:
        """Rectangle; `height` lies in the plane of motion (m)."""
        return cls(width * height, width * height**3 / 12.0, height / 2.0)

    @classmethod
    def tube(cls, outer: float, inner: float = 0.0) -> Section:
        """Circle or ring of these diameters (m)."""
        area, second = math.pi / 4 * (outer**2 - inner**2), math.pi / 64 * (outer**4 - inner**4)
        return cls(area, second, outer / 2.0, 0.9 if inner == 0.0 else 0.5)


@dataclass(frozen=True)
class BeamLink:
    """Describe a straight flexible link. The origin of its frame is the start of its axis, the x axis.

    Parameters
    ----------
    name : str
        Name of the link, and of the body at its start.
    length : float
        Length of the axis (m).
    section : Section
        Its cross-section.
    young_modulus, density : float
        Pa, kg/m3.
    poisson_ratio : float
        For the shear modulus E / (2 (1 + nu)).
    damping : float
        Kelvin and Voigt's time tau (s).
    elements : int
        Least number of cubic elements; there is at least one between two of the `points`.
    points : tuple of float
        Arc lengths at which there must be nodes (m); both ends have some.
    position, angle, velocity, rate
        Start of the frame, as of a `Body`.
    """

    name: str
    length: float
    section: Section
    young_modulus: float
    density: float
    poisson_ratio: float = 0.3
    damping: float = 0.0
    elements: int = 4
    points: tuple[float, ...] = ()
    position: Point = (0.0, 0.0)
    angle: float = 0.0
    velocity: Point = (0.0, 0.0)
    rate: float = 0.0

    def __post_init__(self) -> None:
        label = f"flexible link {self.name!r}"
        positive = {
            "length": (self.length, "m"),
            "section area": (self.section.area, "m2"),
            "section second_moment": (self.section.second_moment, "m4"),
            "section shear_factor": (self.section.shear_factor, "one"),
            "young_modulus": (self.young_modulus, "Pa"),
            "density": (self.density, "kg/m3"),
        }
        for key, (value, unit) in positive.items():
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{label} {key}", value, "must be finite and > 0", f"give it in {unit}")
        if not (math.isfinite(self.damping) and self.damping >= 0.0):
            raise InputError(f"{label} damping", self.damping, "must be finite and >= 0", "give a time in s")
        if not -1.0 < self.poisson_ratio <= 0.5:
            raise InputError(f"{label} poisson_ratio", self.poisson_ratio, "must be > -1 and <= 0.5", "0.3 is steel's")
        if self.elements < 1:
            raise InputError(f"{label} elements", self.elements, "must be >= 1", "4 suit most links")
        for s in self.points:
            if not -TOGETHER * self.length <= s <= (1.0 + TOGETHER) * self.length:
                problem = f"lies outside of the link's axis, which goes from 0 to {self.length:g} m"
                raise InputError(f"{label} point x", s, problem, "move it onto the axis, or make the link longer")

    @cached_property
    def ends(self) -> Array:
        """Arc lengths of the elements' ends, shape (elements + 1,)."""
        at = [0.0]
        for s in sorted(self.points):
            if s - at[-1] > TOGETHER * self.length and self.length - s > TOGETHER * self.length:
                at.append(s)
        at.append(self.length)
        parts = [np.zeros(1)]
        for a, b in itertools.pairwise(at):
            count = max(1, round(self.elements * (b - a) / self.length))
            parts.append(a + (b - a) * np.arange(1, count + 1) / count)
        return np.concatenate(parts)

    @cached_property
    def stations(self) -> Array:
        """Arc lengths of the nodes (m), shape (3 elements + 1,)."""
        ends = self.ends
        inner = 0.5 * (ends[:-1, None] + ends[1:, None]) + 0.5 * np.diff(ends)[:, None] * NODES[:3]
        inner[:, 0] = ends[:-1]
        return np.append(inner.ravel(), self.length)

    def node(self, s: float) -> int:
        """Number of the node at the arc length s, which must be one of the `points` or an end."""
        number = int(np.abs(self.stations - s).argmin())
        if abs(self.stations[number] - s) > 2.0 * TOGETHER * self.length:
            raise InputError(f"flexible link {self.name!r} point x", s, "has no node", "name it among the points")
        return number

    @property
    def node_names(self) -> tuple[str, ...]:
        """Names of the bodies that are its nodes: that of the link, then with ``.1``, ``.2`` ..."""
        return (self.name, *(f"{self.name}.{k}" for k in range(1, len(self.stations))))

    def nodes(self) -> tuple[Body, ...]:
        """Bodies for the linkage, which start as those of a straight rigid link."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        (x, y), (vx, vy), w = self.position, self.velocity, self.rate
        return tuple(
            Body(
                name, 0.0, 0.0, (0.0, 0.0), (x + c * at, y + s * at), self.angle, (vx - w * s * at, vy + w * c * at), w
            )
            for name, at in zip(self.node_names, self.stations, strict=True)
        )

    def rigid(self) -> Body:
        """The rigid link of the same mass and inertia."""
        mass = self.density * self.section.area * self.length
        inertia = mass * self.length**2 / 12.0 + self.density * self.section.second_moment * self.length
        centre = (self.length / 2.0, 0.0)
        return Body(self.name, mass, inertia, centre, self.position, self.angle, self.velocity, self.rate)
