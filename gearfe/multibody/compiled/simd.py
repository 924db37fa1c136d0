"""Numbers side by side: one of each of several stages, or systems of equations, which kernels take at once.

The last axis of a `Lanes` array are its lanes. In NumPy it is an array like others; in compiled kernels an element of
it is all lanes of a row, one vector of the processor, with +, -, *, /, abs, `np.maximum`, `np.sin` and `np.cos` of its
own (`lanes_type`). Loops over stages or systems are none then, and what leads to a row is read once for all of them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...typing import Array

#: Bytes at a multiple of which vectors of the processor begin.
ALIGNED = 64


class Lanes(np.ndarray):
    """An array of float64 whose last axis are lanes."""


def lanes(*shape: int) -> Lanes:
    """Zeros of a shape, whose last axis are lanes."""
    raw = np.zeros(math.prod(shape) + ALIGNED // 8)
    first = -raw.ctypes.data % ALIGNED // 8
    made: Lanes = raw[first : first + math.prod(shape)].reshape(shape).view(Lanes)
    return made


def as_lanes(values: Array) -> Lanes:
    """A copy of an array whose last axis are lanes."""
    made = lanes(*values.shape)
    made[...] = values
    return made


def flat(x: Any) -> Any:
    """The same numbers as an array of float64."""
    return x.view(np.ndarray)


def halves(x: Any) -> Any:
    """The same numbers with half as many lanes; the axis before them is the half."""
    return x.reshape(*x.shape[:-1], 2, x.shape[-1] // 2)


def total(x: Any) -> float:
    """Sum over the lanes."""
    return float(x.sum())


def highest(x: Any) -> float:
    """Largest lane, not-a-number where one is."""
    return float(x.max())


NAMES = {"flat": flat, "halves": halves, "total": total, "highest": highest}
