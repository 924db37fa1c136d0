"""Joints whose rows are quadratic in coordinates, cosines and sines: given by their coefficients alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..typing import Array, IntArray
from .contract import Element
from .tape import Tape
from .timefunctions import TimeFunction


@dataclass(frozen=True, eq=False)
class QuadraticJoint(Element):
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
        """Where motions change their pieces."""
        return tuple(t for motion in self.motions.values() for t in motion.breaks)

    def units(self) -> tuple[Array, Array]:
        """Sizes of the rows."""
        return np.zeros(0), np.ones(self.rows) if self.sizes is None else self.sizes

    @cached_property
    def _tensor(self) -> Array:
        """Second derivatives by the variables, shape (rows, z, z)."""
        made = np.zeros((self.rows, self.linear.shape[1], self.linear.shape[1]))
        for r, i, j, factor in self.products:
            made[r, i, j] += factor
            made[r, j, i] += factor
        return made

    def _variables(self, q: Array) -> tuple[Array, Array]:
        """z, and its derivatives by q."""
        n, at = len(q), np.array(self.angles, dtype=int)
        c, s = np.cos(q[at]), np.sin(q[at])
        z, slope = np.append(q, np.column_stack([c, s]).ravel()), np.zeros((n + 2 * len(at), n))
        slope[:n] = np.eye(n)
        pair = n + 2 * np.arange(len(at))
        slope[pair, at], slope[pair + 1, at] = -s, c
        return z, slope

    def _motion(self, t: float, derivative: int) -> Array:
        out = np.zeros(self.rows)
        for row, motion in self.motions.items():
            out[row] = motion(t, derivative)
        return out

    def residual(self, t: float, q: Array) -> Array:
        """g."""
        z, _ = self._variables(q)
        held = 0.0 if self.constant is None else self.constant
        return np.asarray(held + (self.linear + 0.5 * self._tensor @ z) @ z - self._motion(t, 0), dtype=float)

    def rate(self, t: float, q: Array) -> Array:  # noqa: ARG002
        """Minus the rates of the motions."""
        return -self._motion(t, 1)

    def jacobian(self, t: float, q: Array) -> Array:  # noqa: ARG002
        """G."""
        z, slope = self._variables(q)
        return np.asarray((self.linear + self._tensor @ z) @ slope, dtype=float)

    def velocity_terms(self, t: float, q: Array, v: Array) -> Array:
        """g'' without its acceleration part."""
        z, slope = self._variables(q)
        rate, bend = slope @ v, np.zeros(len(z))
        for a, at in enumerate(self.angles):
            k = len(q) + 2 * a
            bend[k : k + 2] = -z[k : k + 2] * v[at] ** 2
        return np.asarray((self.linear + self._tensor @ z) @ bend + (self._tensor @ rate) @ rate - self._motion(t, 2))

    def curvature(self, q: Array, multipliers: Array) -> Array:
        """d(G^T lambda)/dq at fixed lambda."""
        z, slope = self._variables(q)
        full = slope.T @ np.tensordot(multipliers, self._tensor, 1) @ slope
        pull = multipliers @ (self.linear + self._tensor @ z)
        for a, at in enumerate(self.angles):
            k = len(q) + 2 * a
            full[at, at] -= pull[k : k + 2] @ z[k : k + 2]
        return np.asarray(full, dtype=float)

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
