"""The algebra in which planar joints and forces are written: vectors that move with bodies, and scalars made of them.

    vector   V(q) = sum_bodies  w (x, y) + R(theta) p                          w, p constant
    form     u(q) = sum_bodies  kx x + ky y + kt theta + kc cos theta + ks sin theta  +  constant  +  sum U . V

Both are closed under sums and multiples; the product U . V of two vectors is a form, and an affine one where one of the
vectors stands still. Values, gradients, time derivatives and Taylor coefficients of every form follow from these few
numbers (`multibody.planar.linkage`). A joint therefore only states the forms that it keeps at zero, a force those along
which it acts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
