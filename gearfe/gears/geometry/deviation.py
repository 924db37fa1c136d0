"""Deviations of micrometres of the flank of a tooth.

A deviation is a length along the normal of the involute, over its roll length: more material where it is positive. Its
cubic pieces hold the usual modifications exactly, kinks included (a linear relief, a K-chart's corners).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.typing import Array

#: Jump of the slope (-) from which on a break is a kink.
KINK = 1e-9


@dataclass(frozen=True)
class Deviation:
    """Deviation of a flank along the normal of its involute, measured or designed.

    Attributes
    ----------
    breaks : tuple of float, length k + 1
        Roll lengths (m), rising.
    pieces : tuple of k tuples of 4 floats
        Between two breaks the coefficients of the rising powers of the roll length from the first of them. The
        deviation (m), > 0: more material, is continuous, and constant beyond the breaks.
    """

    breaks: tuple[float, ...]
    pieces: tuple[tuple[float, float, float, float], ...]

    @classmethod
    def straight(cls, roll: ArrayLike, height: ArrayLike) -> Deviation:
        """Straight lines between points (m): a K-chart's."""
        s, h = _points(roll, height)
        slope = np.diff(h) / np.diff(s)
        return _made(s, [h[:-1], slope, 0 * slope, 0 * slope])

    @classmethod
    def through(cls, roll: ArrayLike, height: ArrayLike) -> Deviation:
        """Smooth curve through measured points (m): monotone cubics (Fritsch & Carlson, SIAM J. Numer. Anal. 17, 1980).

        Between two points it stays within their values, so it does not oscillate beside a kink. A kink at a point, with
        a change of slope d, is missed by 4/27 d h at most in the intervals h beside it.
        """
        from scipy.interpolate import PchipInterpolator  # only measured flanks need it

        s, h = _points(roll, height)
        return _made(s, PchipInterpolator(s, h).c[::-1])

    @classmethod
    def sampled(cls, function: Callable[[Array], tuple[Array, Array]], roll: ArrayLike) -> Deviation:
        """Cubics with the values (m) and slopes (-) that `function` has at roll lengths (m)."""
        s = np.asarray(roll, dtype=float)
        h, slope = (np.asarray(one, dtype=float) for one in function(s))
        d, chord = np.diff(s), np.diff(h) / np.diff(s)
        second = (3 * chord - 2 * slope[:-1] - slope[1:]) / d
        return _made(s, [h[:-1], slope[:-1], second, (slope[:-1] + slope[1:] - 2 * chord) / d**2])

    @cached_property
    def _arrays(self) -> tuple[Array, Array]:
        return np.array(self.breaks), np.array(self.pieces).T.copy()

    def at(self, s: Any) -> tuple[Array, Array]:
        """Deviation (m) and its slope (-) at roll lengths s (m); at a break the slope of the piece behind it."""
        breaks, (a, b, c, d) = self._arrays
        i = np.clip(np.searchsorted(breaks, s, side="right") - 1, 0, len(a) - 1)
        inside = np.minimum(np.maximum(s, breaks[0]), breaks[-1])
        t = inside - breaks[i]
        b, c, d = b[i], c[i], d[i]
        return a[i] + t * (b + t * (c + t * d)), np.where(inside == s, b + t * (2 * c + 3 * t * d), 0.0)

    @cached_property
    def kinks(self) -> tuple[float, ...]:
        """Roll lengths (m) where the slope jumps, the first and the last break included."""
        s, (_, b, c, d) = self._arrays
        h = np.diff(s)
        end = b + h * (2 * c + 3 * h * d)
        return tuple(s[np.abs(np.append(b, 0.0) - np.append(0.0, end)) > KINK].tolist())

    @cached_property
    def most(self) -> float:
        """Largest size (m), at its breaks and between them."""
        return float(np.abs(self.at(self._dense)[0]).max())

    @cached_property
    def steepest(self) -> float:
        """Largest size of the slope (-)."""
        return float(np.abs(self.at(self._dense)[1]).max())

    @cached_property
    def _dense(self) -> Array:
        s = self._arrays[0]
        return np.append((s[:-1, None] + np.diff(s)[:, None] * np.linspace(0, 1, 8, endpoint=False)).ravel(), s[-1])

    def scaled(self, factor: float) -> Deviation:
        """So many times as large."""
        return _made(np.array(self.breaks), factor * np.array(self.pieces).T)


def _points(roll: ArrayLike, height: ArrayLike) -> tuple[Array, Array]:
    s, h = np.asarray(roll, dtype=float), np.asarray(height, dtype=float)
    if s.ndim != 1 or s.shape != h.shape or len(s) < 2:
        raise InputError(
            "points", s.shape, "must be two points at least, each a roll length and a deviation", "add some"
        )
    if not (np.isfinite(s).all() and np.isfinite(h).all() and (np.diff(s) > 0).all()):
        raise InputError("points", None, "must be finite, the roll lengths rising", "sort them, and take doubles out")
    return s, h


def _made(breaks: Array, coefficients: Any) -> Deviation:
    pieces = np.asarray(coefficients).T.tolist()
    return Deviation(tuple(breaks.tolist()), tuple((p[0], p[1], p[2], p[3]) for p in pieces))


def total(parts: Sequence[Deviation]) -> Deviation | None:
    """Sum of deviations, exactly; None of none."""
    if len(parts) <= 1:
        return parts[0] if parts else None
    breaks = np.unique(np.concatenate([part.breaks for part in parts]))
    start, h, made = breaks[:-1], np.diff(breaks), np.zeros((4, len(breaks) - 1))
    for part in parts:
        s, (a, b, c, d) = part._arrays
        i = np.searchsorted(s, start + 0.5 * h, side="right") - 1
        on = (i >= 0) & (i < len(a))
        t, i = start - s[np.clip(i, 0, len(s) - 1)], np.clip(i, 0, len(a) - 1)
        a, b, c, d = a[i], b[i], c[i], d[i]
        moved = np.array([a + t * (b + t * (c + t * d)), b + t * (2 * c + 3 * t * d), c + 3 * t * d, d])
        constant = np.zeros_like(moved)
        constant[0] = part.at(start + 0.5 * h)[0]
        made += np.where(on, moved, constant)
    return _made(breaks, made)
