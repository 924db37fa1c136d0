"""Planar bodies as plain data, and their frames, of which joints and forces make forms.

A body carries a frame: points, the mass centre and joint directions are given in that frame (m). The start pose is the
position of the frame's origin and its angle. The ground is the body named ``"ground"`` with its frame at rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ...base.errors import InputError
from .forms import Form, Point, Vector

#: Masses and inertias below this, or above its inverse, overflow in products.
LEAST_MASS = 1e-100


@dataclass(frozen=True)
class Body:
    """A rigid body that moves in the plane.

    Parameters
    ----------
    name : str
        Name used by joints and forces.
    mass : float
        Mass (kg), >= 0. It may be 0 where joints hold the body to others with mass.
    inertia : float
        Moment of inertia about the mass centre (kg m2), >= 0; 0 as for the mass.
    centre : (float, float)
        Mass centre in the body's frame (m).
    position, angle : (float, float), float
        Start position of the frame's origin (m) and start angle (rad).
    velocity, rate : (float, float), float
        Start velocity of the frame's origin (m/s) and start angular velocity (rad/s).
    """

    name: str
    mass: float
    inertia: float
    centre: Point = (0.0, 0.0)
    position: Point = (0.0, 0.0)
    angle: float = 0.0
    velocity: Point = (0.0, 0.0)
    rate: float = 0.0

    def __post_init__(self) -> None:
        for key in ("mass", "inertia"):
            value = getattr(self, key)
            unit = "kg" if key == "mass" else "kg m2"
            if math.isfinite(value) and value > 0.0 and not LEAST_MASS <= value <= 1.0 / LEAST_MASS:
                problem = f"must be >= {LEAST_MASS:g} and <= {1.0 / LEAST_MASS:g}: its inverse or its square overflows"
                raise InputError(f"body {self.name!r} {key}", value, problem, f"give it in {unit}")
            if not (math.isfinite(value) and value >= 0.0):
                cure = f"give a number in {unit}; 0 for a link without {key}"
                raise InputError(f"body {self.name!r} {key}", value, "must be finite and >= 0", cure)


@dataclass(frozen=True)
class Frames:
    """The bodies' frames: what joints and forces make their forms of.

    Parameters
    ----------
    bodies : tuple of Body
        The moving ones.
    number : dict
        Name -> number; the ground's is the number of moving bodies.
    """

    bodies: tuple[Body, ...]
    number: Mapping[str, int]

    def arm(self, body: str, at: Point) -> Point:
        """A point of the body's frame as seen from the mass centre."""
        i = self.number[body]
        x, y = (0.0, 0.0) if i == len(self.bodies) else self.bodies[i].centre
        return at[0] - x, at[1] - y

    def point(self, body: str, at: Point) -> Vector:
        """Place of a point of the body's frame."""
        return Vector({self.number[body]: (1.0, *self.arm(body, at))}, len(self.bodies))

    def centre(self, body: str) -> Vector:
        """Place of the mass centre; of the origin for the ground."""
        return Vector({self.number[body]: (1.0, 0.0, 0.0)}, len(self.bodies))

    def direction(self, body: str, along: Point) -> Vector:
        """Unit vector that turns with the body, from its components in the body's frame (of any length)."""
        length = math.hypot(*along)
        return Vector({self.number[body]: (0.0, along[0] / length, along[1] / length)}, len(self.bodies))

    def angle(self, body: str) -> Form:
        """Angle of the body (rad)."""
        return Form({self.number[body]: (0.0, 0.0, 1.0, 0.0, 0.0)})

    def start_angle(self, body: str) -> float:
        """Angle at the start pose (rad)."""
        i = self.number[body]
        return 0.0 if i == len(self.bodies) else self.bodies[i].angle

    def start_place(self, body: str, at: Point) -> Point:
        """Place of a point of the body's frame at the start pose (m)."""
        i = self.number[body]
        if i == len(self.bodies):
            return at
        place, (c, s) = self.bodies[i].position, _turn(self.bodies[i].angle)
        return place[0] + c * at[0] - s * at[1], place[1] + s * at[0] + c * at[1]

    def start_seen_from(self, body: str, place: Point) -> Point:
        """Return a point of the ground in the body's frame at the start pose (m)."""
        i = self.number[body]
        if i == len(self.bodies):
            return place
        origin, (c, s) = self.bodies[i].position, _turn(self.bodies[i].angle)
        x, y = place[0] - origin[0], place[1] - origin[1]
        return c * x + s * y, -s * x + c * y


def _turn(angle: float) -> Point:
    return math.cos(angle), math.sin(angle)
