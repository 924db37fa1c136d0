"""Joints whose rows are quadratic in coordinates, cosines and sines: given by their coefficients alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...base.typing import Array, IntArray
from ..core.contract import Element
from ..core.tape_evaluation import TapeElement
from ..series.tape import Tape
from ..series.timefunctions import TimeFunction


@dataclass(frozen=True, eq=False)
class QuadraticJoint(TapeElement):
    """Rows g = c + L z + sum B z_i z_j - motion(t), z = (q, then cosine and sine of the coordinates `angles`).

    Frames of elastic bodies in vectors (|a|^2 = 1, a . b = 0), joints between such bodies, and planar ones are of this
    form. Such systems run compiled, by Taylor series, whatever else is linear in them.

    Parameters
    ----------
    touches
        Elements whose coordinates q are, one after the other.
    linear : ndarray, shape (rows, k + 2 angles)
        L.
    products
        (row, i, j, factor) of each product of two variables.
    constant : ndarray, shape (rows,), optional
        c.
    angles
        Numbers of coordinates in q.
    motions
        Row -> its motion.
    sizes : ndarray, shape (rows,), optional
        Values of each row that count as much as 1 rad.
    """

    touches: tuple[Element, ...] = field()
    linear: Array = field()
    products: Sequence[tuple[int, int, int, float]] = ()
    constant: Array | None = None
    angles: tuple[int, ...] = ()
    motions: Mapping[int, TimeFunction] = field(default_factory=dict)
    sizes: Array | None = None
    name: str = "quadratic joint"

    @property
    def rows(self) -> int:  # type: ignore[override]
        """Number of constraints."""
        return len(self.linear)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Return the times at which motions change their pieces."""
        return tuple(t for motion in self.motions.values() for t in motion.breaks)

    def units(self) -> tuple[Array, Array]:
        """Sizes of the rows."""
        return np.zeros(0), np.ones(self.rows) if self.sizes is None else self.sizes

    def write(self, tape: Tape, places: IntArray) -> bool:
        """The same rows on a tape."""
        variables = [int(p) for p in places]
        for at in self.angles:
            variables += tape.turn(variables[at])
        for r in range(self.rows):
            terms = {variables[i]: float(f) for i, f in enumerate(self.linear[r]) if f}
            products = [(variables[i], variables[j], f) for row, i, j, f in self.products if row == r]
            held = 0.0 if self.constant is None else float(self.constant[r])
            unit = 1.0 if self.sizes is None else float(self.sizes[r])
            tape.row(terms, products, held, self.motions.get(r), unit)
        return True
