"""Numbers side by side: one of each of several stages, or systems of equations, which kernels take at once.

The last axis of a `SimdArray` are the SIMD lanes of the processor. In NumPy it is an array like others. In compiled
kernels an element of it is a whole row, one vector of the processor. The vector has its operations +, -, *, /, abs,
`np.maximum`, `np.sin` and `np.cos` (`simd_type`). So kernels need no loops over stages or systems, and indices of a row
are read once for all of them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.typing import Array

#: Bytes at a multiple of which vectors of the processor begin.
ALIGNED = 64


class SimdArray(np.ndarray):
    """An array of float64 whose last axis is one SIMD vector."""


def simd_zeros(*shape: int) -> SimdArray:
    """Zeros of a shape, whose last axis is one SIMD vector."""
    raw = np.zeros(math.prod(shape) + ALIGNED // 8)
    first = -raw.ctypes.data % ALIGNED // 8
    made: SimdArray = raw[first : first + math.prod(shape)].reshape(shape).view(SimdArray)
    return made


def simd_copy(values: Array) -> SimdArray:
    """A copy of an array whose last axis is one SIMD vector."""
    made = simd_zeros(*values.shape)
    made[...] = values
    return made


def flat(x: Any) -> Any:
    """The same numbers as an array of float64."""
    return x.view(np.ndarray)


def halves(x: Any) -> Any:
    """The same numbers in vectors of half the width; the axis before is the half."""
    return x.reshape(*x.shape[:-1], 2, x.shape[-1] // 2)


def total(x: Any) -> float:
    """Sum over a vector."""
    return float(x.sum())


def highest(x: Any) -> float:
    """Largest entry; NaN where one is NaN."""
    return float(x.max())


NAMES = {"flat": flat, "halves": halves, "total": total, "highest": highest}
