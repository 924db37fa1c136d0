"""Linear equations by products alone: generalised minimal residuals.

Saad & Schultz, SIAM J. Sci. Stat. Comput. 7, 1986. For the identity and a compact part the residual falls faster than
any geometric series (Campbell, Ipsen, Kelley & Meyer, BIT 36, 1996).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...base.typing import Array

#: Most products: so many vectors are kept.
MOST = 120


def gmres(product: Callable[[Array], Array], right: Array, part: float) -> Array:
    """x with ``|right - product(x)| <= part |right|``, or the best one of `MOST` products."""
    size = float(np.linalg.norm(right))
    if not (0.0 < size < math.inf):
        return np.zeros_like(right)
    most = min(MOST, len(right))
    basis, upper = np.empty((most + 1, len(right))), np.zeros((most + 1, most))
    aim = np.zeros(most + 1)
    basis[0], aim[0] = right / size, size
    turns: list[tuple[float, float]] = []
    for j in range(most):
        new, before = product(basis[j]), basis[: j + 1]
        column = before @ new
        new -= column @ before
        upper[: j + 1, j] = column
        beyond = float(np.linalg.norm(new))
        for i, (c, s) in enumerate(turns):  # Givens rotations make the matrix triangular
            a, b = upper[i, j], upper[i + 1, j]
            upper[i, j], upper[i + 1, j] = c * a + s * b, c * b - s * a
        length = math.hypot(upper[j, j], beyond)
        if length == 0.0 or not math.isfinite(length):
            most = j
            break
        c, s = upper[j, j] / length, beyond / length
        turns.append((c, s))
        upper[j, j] = length
        aim[j], aim[j + 1] = c * aim[j], -s * aim[j]
        most = j + 1
        if abs(aim[most]) <= part * size:
            break
        basis[j + 1] = new / beyond
    y = np.linalg.solve(upper[:most, :most], aim[:most])
    return np.asarray(y @ basis[:most])
