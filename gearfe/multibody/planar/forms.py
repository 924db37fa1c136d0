"""The algebra in which planar joints and forces are written: vectors that move with bodies, and scalars made of them.

    vector   V(q) = sum_bodies  w (x, y) + R(theta) p                          w, p constant
    form     u(q) = sum_bodies  kx x + ky y + kt theta + kc cos theta + ks sin theta  +  constant  +  sum U . V

Both are closed under sums and multiples; the product U . V of two vectors is a form, and an affine one where one of the
vectors stands still. Values, gradients, time derivatives and Taylor coefficients of every form follow from these
few numbers (`multibody.planar.linkage`), so a joint or a force says nothing more than which form it holds or acts
along.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .bodies import Body

#: Factors of x, y, theta, cos theta, sin theta of a body.
Terms = tuple[float, ...]
#: Weight w of a body's mass centre and components of the arm p in its frame.
End = tuple[float, ...]
Point = tuple[float, float]
#: Name of the body at rest.
GROUND = "ground"


@dataclass(frozen=True)
class Form:
    """A scalar of the planar coordinates.

    Parameters
    ----------
    terms : dict
        Body number -> factors of its x, y, theta, cos theta, sin theta.
    constant : float
        What does not move.
    products : tuple of (Vector, Vector)
        Inner products that are added.
    """

    terms: Mapping[int, Terms] = field(default_factory=dict)
    constant: float = 0.0
    products: tuple[tuple[Vector, Vector], ...] = ()

    def __add__(self, other: Form | float) -> Form:
        if not isinstance(other, Form):
            return Form(self.terms, self.constant + other, self.products)
        joined = {
            body: _sum(self.terms.get(body, _NO_TERMS), other.terms.get(body, _NO_TERMS))
            for body in dict.fromkeys((*self.terms, *other.terms))
        }
        return Form(joined, self.constant + other.constant, self.products + other.products)

    def __mul__(self, factor: float) -> Form:
        terms = {body: _times(factor, row) for body, row in self.terms.items()}
        return Form(terms, factor * self.constant, tuple((factor * u, v) for u, v in self.products))

    __rmul__ = __mul__

    def __sub__(self, other: Form | float) -> Form:
        return self + -1.0 * other

    @property
    def bodies(self) -> tuple[int, ...]:
        """Numbers of the bodies that it depends on, in the order in which they came."""
        ends = [body for product in self.products for vector in product for body in vector.ends]
        return tuple(dict.fromkeys((*self.terms, *ends)))


@dataclass(frozen=True)
class Vector:
    """A vector of the plane that moves with bodies, in the ground's axes.

    Parameters
    ----------
    ends : dict
        Body number -> weight of its mass centre, and the arm in its frame (m, or a unit for a direction).
    ground : int
        Number of the body at rest.
    """

    ends: Mapping[int, End]
    ground: int

    def __add__(self, other: Vector) -> Vector:
        bodies = dict.fromkeys((*self.ends, *other.ends))
        joined = {b: _sum(self.ends.get(b, _NO_END), other.ends.get(b, _NO_END)) for b in bodies}
        return Vector(joined, self.ground)

    def __mul__(self, factor: float) -> Vector:
        return Vector({body: _times(factor, end) for body, end in self.ends.items()}, self.ground)

    __rmul__ = __mul__

    def __sub__(self, other: Vector) -> Vector:
        return self + -1.0 * other

    @property
    def x(self) -> Form:
        """First component."""
        return self.along(1.0, 0.0)

    @property
    def y(self) -> Form:
        """Second component."""
        return self.along(0.0, 1.0)

    def along(self, x: float, y: float) -> Form:
        """Inner product with a vector (x, y) at rest."""
        terms = {body: (w * x, w * y, 0.0, x * px + y * py, y * px - x * py) for body, (w, px, py) in self.ends.items()}
        return Form(terms)

    def dot(self, other: Vector) -> Form:
        """Inner product."""
        for one, two in ((self, other), (other, self)):
            if one.ends.keys() == {one.ground}:
                return two.along(*one.ends[one.ground][1:3])
        return Form(products=((self, other),))


_NO_TERMS: Terms = (0.0, 0.0, 0.0, 0.0, 0.0)
_NO_END: End = (0.0, 0.0, 0.0)


def _sum(one: tuple[float, ...], two: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(a + b for a, b in zip(one, two, strict=True))


def _times(factor: float, row: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(factor * a for a in row)


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
        """Where a place of the ground lies in the body's frame at the start pose (m)."""
        i = self.number[body]
        if i == len(self.bodies):
            return place
        origin, (c, s) = self.bodies[i].position, _turn(self.bodies[i].angle)
        x, y = place[0] - origin[0], place[1] - origin[1]
        return c * x + s * y, -s * x + c * y


def _turn(angle: float) -> Point:
    return math.cos(angle), math.sin(angle)


#: Classes whose names are not those of mechanism files.
_KINDS = {"GearRatio": "gear", "PointForce": "force"}


def label_of(part: object, number: int) -> str:
    """Return kind and name of a joint or force for messages, or its number where it has no name."""
    kind = type(part).__name__
    words = _KINDS.get(kind) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind).lower()
    return f"{words} {getattr(part, 'name', '') or number}"
