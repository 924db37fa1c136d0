"""Variables of planar bodies on a tape, and the forms and vectors of `multibody.planar.forms` made of these."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ...base.typing import IntArray
from ..series.tape import Tape
from .forms import Form, Vector


class Affine(NamedTuple):
    """A form of the variables of a tape."""

    terms: dict[int, float]
    constant: float


class BodyVariables:
    """Variables x, y, theta, cos theta, sin theta of the bodies of a linkage; the ground's are constants.

    Parameters
    ----------
    tape : Tape
        On which they are.
    places : ndarray of int, shape (3n,)
        Numbers of the coordinates.
    """

    def __init__(self, tape: Tape, places: IntArray) -> None:
        self.tape, self.places = tape, [int(p) for p in places]

    def affine(self, body: int, factors: Sequence[float], into: Affine | None = None) -> Affine:
        """kx x + ky y + kt theta + kc cos theta + ks sin theta, added to another one."""
        terms, constant = (dict(into.terms), into.constant) if into is not None else ({}, 0.0)
        if 3 * body >= len(self.places):
            return Affine(terms, constant + float(factors[3]))
        own = self.places[3 * body : 3 * body + 3]
        turning = self.tape.turn(own[2]) if factors[3] or factors[4] else ()
        for variable, factor in zip((*own, *turning), factors, strict=False):
            if factor:
                terms[variable] = terms.get(variable, 0.0) + float(factor)
        return Affine(terms, constant)

    def point(
        self, body: int, weight: float, x: float, y: float, into: tuple[Affine, Affine] | None = None
    ) -> tuple[Affine, Affine]:
        """Return the components of ``weight (x_b, y_b) + R(theta) (x, y)``, added to others.

        (x_b, y_b) is the body's mass centre and theta its angle.

        Parameters
        ----------
        body : int
            Number of the body; the number of bodies stands for the ground.
        weight : float
            Factor of the mass centre: 1 for a point of the body, 0 for a direction.
        x, y : float
            Vector in the frame of the body (m).
        into : pair of Affine, optional
            Components to which these are added.
        """
        one, two = into if into is not None else (None, None)
        across = self.affine(body, (weight, 0.0, 0.0, x, -y), one)
        return across, self.affine(body, (0.0, weight, 0.0, y, x), two)

    def form(self, form: Form) -> Affine:
        """The linear part of a form: all of it except its products."""
        linear = Affine({}, form.constant)
        for body, factors in form.terms.items():
            linear = self.affine(body, factors, linear)
        return linear

    def vector(self, vector: Vector) -> tuple[Affine, Affine]:
        """Components of a vector."""
        made = Affine({}, 0.0), Affine({}, 0.0)
        for body, end in vector.ends.items():
            weight, x, y = end
            made = self.point(body, weight, x, y, made)
        return made
