"""Functions of time that the integrators can differentiate and integrate exactly: pieces of polynomials plus sines.

    f(t) = sum_j c_j (t - o)^j  on the piece that holds t,   plus   sum_i A_i sin(w_i t + p_i)

Steps of the integrators end where a piece ends, so a piecewise function costs no accuracy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.typing import Array, IntArray


@dataclass(frozen=True)
class TimeFunction:
    """A piecewise polynomial of time plus harmonic terms; add with ``+``, scale with ``*``.

    Parameters
    ----------
    starts : tuple of float
        Time at which each piece begins (s); the first is minus infinity.
    origins : tuple of float
        Time about which the polynomial of each piece is written (s).
    coefficients : tuple of tuple of float
        Polynomial of each piece, lowest power first.
    sines : tuple of (amplitude, angular frequency in rad/s, phase in rad)
        Terms ``A sin(w t + p)``.
    """

    starts: tuple[float, ...] = (-math.inf,)
    origins: tuple[float, ...] = (0.0,)
    coefficients: tuple[tuple[float, ...], ...] = ((0.0,),)
    sines: tuple[tuple[float, float, float], ...] = ()

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Value (or derivative of that order) at the times `t` (s)."""
        time = np.asarray(t, dtype=float)
        starts, origins, rows = _tables(self.starts, self.origins, self.coefficients, derivative)
        if len(starts) == 1:
            x, rows = time - origins[0], rows[0]
        else:
            piece = np.searchsorted(starts, time, side="right") - 1
            x, rows = time - origins[piece], rows[piece]
        out = rows[..., -1] + 0.0 * x
        for j in range(rows.shape[-1] - 2, -1, -1):
            out = out * x + rows[..., j]
        for amplitude, omega, phase in self.sines:
            out = out + amplitude * omega**derivative * np.sin(omega * time + phase + derivative * math.pi / 2)
        return out

    def __add__(self, other: TimeFunction) -> TimeFunction:
        starts = tuple(sorted({*self.starts, *other.starts}))
        origins, rows = [], []
        for start in starts:
            first, second = self._piece(start), other._piece(start)
            origin = first[0] if len(first[1]) > 1 else second[0]
            one, two = _moved(first, origin), _moved(second, origin)
            width = max(len(one), len(two))
            rows.append(tuple(sum(c[j] if j < len(c) else 0.0 for c in (one, two)) for j in range(width)))
            origins.append(origin)
        return TimeFunction(starts, tuple(origins), tuple(rows), self.sines + other.sines)

    def __mul__(self, factor: float) -> TimeFunction:
        rows = tuple(tuple(factor * c for c in row) for row in self.coefficients)
        return TimeFunction(self.starts, self.origins, rows, tuple((factor * a, w, p) for a, w, p in self.sines))

    __rmul__ = __mul__

    def squared(self) -> TimeFunction:
        """Return the square of the function.

        Raises
        ------
        InputError
            When it has sines beside pieces that are not constant: their products have no place here.
        """
        rows = tuple(tuple(float(c) for c in np.convolve(row, row)) for row in self.coefficients)
        square = TimeFunction(self.starts, self.origins, rows)
        if not self.sines:
            return square
        if self.breaks or any(self.coefficients[0][1:]):
            problem = "has sines together with a polynomial, a step or a table: the square of the sum has no such form"
            raise InputError("function of time", None, problem, "give sines and a constant, or the others")
        level = self.coefficients[0][0]
        terms = [sine(2.0 * level * a, w, p) for a, w, p in self.sines]
        for a, w, p in self.sines:
            for b, u, r in self.sines:  # sin sin = (cos(difference) - cos(sum)) / 2
                terms.append(sine(0.5 * a * b, w - u, p - r + math.pi / 2))
                terms.append(sine(-0.5 * a * b, w + u, p + r + math.pi / 2))
        return sum(terms, square)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which one piece changes to the next (s)."""
        return self.starts[1:]

    @property
    def steady(self) -> bool:
        """Return whether it is constant."""
        return self.ends and not self.breaks

    @property
    def ends(self) -> bool:
        """Return whether it is constant in the end."""
        return not self.sines and not any(self.coefficients[-1][1:])

    def integral(self, value: float = 0.0, at: float = 0.0) -> TimeFunction:
        """Antiderivative that takes `value` at the time `at`: a prescribed rate becomes a prescribed angle."""
        rows: list[tuple[float, ...]] = []
        level = 0.0
        for i, (origin, row) in enumerate(zip(self.origins, self.coefficients, strict=True)):
            raised = [0.0, *(c / (j + 1) for j, c in enumerate(row))]
            if i:  # continuous where the pieces meet
                before = np.polynomial.Polynomial(rows[-1])(self.starts[i] - self.origins[i - 1])
                level = float(before - np.polynomial.Polynomial(raised)(self.starts[i] - origin))
            raised[0] += level
            rows.append(tuple(raised))
        sines = tuple((a / w, w, p - math.pi / 2) for a, w, p in self.sines if w != 0.0)
        antiderivative = TimeFunction(self.starts, self.origins, tuple(rows), sines)
        offset = value - float(antiderivative(at))
        return antiderivative + constant(offset)

    def _piece(self, start: float) -> tuple[float, tuple[float, ...]]:
        i = max(k for k, s in enumerate(self.starts) if s <= start)
        return self.origins[i], self.coefficients[i]


@lru_cache(maxsize=256)
def _tables(
    starts: tuple[float, ...], origins: tuple[float, ...], coefficients: tuple[tuple[float, ...], ...], derivative: int
) -> tuple[Array, Array, Array]:
    """Starts, origins and the coefficients of a derivative, (pieces, width), as arrays."""
    rows = np.zeros((len(coefficients), max(len(row) for row in coefficients)))
    for i, row in enumerate(coefficients):
        rows[i, : len(row)] = row
    for _ in range(derivative):
        rows = (rows * np.arange(rows.shape[1]))[:, 1:] if rows.shape[1] > 1 else 0.0 * rows
    return np.array(starts), np.array(origins), rows


def constant(value: float) -> TimeFunction:
    """The same `value` at all times."""
    return TimeFunction(coefficients=((float(value),),))


def polynomial(coefficients: tuple[float, ...], origin: float = 0.0) -> TimeFunction:
    """``sum_j c_j (t - origin)^j``, lowest power first."""
    return TimeFunction(origins=(float(origin),), coefficients=(tuple(float(c) for c in coefficients),))


def sine(amplitude: float, omega: float, phase: float = 0.0) -> TimeFunction:
    """``amplitude sin(omega t + phase)`` with omega in rad/s and phase in rad."""
    if omega == 0.0:
        return constant(amplitude * math.sin(phase))
    return TimeFunction(sines=((float(amplitude), float(omega), float(phase)),))


def smoothed_step(centre: float, width: float, height: float = 1.0) -> TimeFunction:
    """Step from 0 to `height`: ``10 x^3 - 15 x^4 + 6 x^5`` with ``x = (t - centre + width/2) / width``."""
    least = max(1e-30, 4 * float(np.spacing(abs(centre))))  # the fifth power has to exist, and the rise to take time
    if not (math.isfinite(centre) and math.isfinite(width) and width >= least):
        problem = f"must be finite and >= {least:.3g} s at the centre {centre:.6g} s"
        raise InputError("smoothed step width", width, problem, "give the duration of the rise")
    begin = centre - width / 2
    rise = (0.0, 0.0, 0.0, 10.0 * height / width**3, -15.0 * height / width**4, 6.0 * height / width**5)
    return TimeFunction((-math.inf, begin, begin + width), (begin, begin, begin + width), ((0.0,), rise, (height,)))


def _moved(piece: tuple[float, tuple[float, ...]], origin: float) -> tuple[float, ...]:
    """Coefficients of the same polynomial about another origin."""
    shift = origin - piece[0]
    if shift == 0.0 or len(piece[1]) == 1:
        return piece[1]
    moved = np.polynomial.Polynomial(piece[1])(np.polynomial.Polynomial([shift, 1.0]))
    return tuple(float(c) for c in moved.coef)


class Times(NamedTuple):
    """Time functions: polynomial pieces and sines."""

    first: IntArray  # (functions + 1,) pieces of each time function
    start: Array  # (pieces,)
    origin: Array  # (pieces,)
    factor: Array  # (pieces, width)
    sine_first: IntArray  # (functions + 1,)
    sine: Array  # (sines, 3)


def time_arrays(functions: list[TimeFunction]) -> Times:
    """Arrays of functions of time, for the kernels."""
    used = functions or [constant(0.0)]
    width = max(len(row) for f in used for row in f.coefficients)
    return Times(
        first=np.cumsum([0, *(len(f.starts) for f in used)]).astype(np.int64),
        start=np.array([s for f in used for s in f.starts], dtype=float),
        origin=np.array([o for f in used for o in f.origins], dtype=float),
        factor=np.array([[*row, *[0.0] * (width - len(row))] for f in used for row in f.coefficients]),
        sine_first=np.cumsum([0, *(len(f.sines) for f in used)]).astype(np.int64),
        sine=np.array([s for f in used for s in f.sines], dtype=float).reshape(-1, 3),
    )
