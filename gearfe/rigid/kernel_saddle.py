"""L U of banded saddle matrices [[T, G^T], [G, 0]] with row pivots, real or complex, in dense storage.

Rows keep where their entries begin and end, so an order of the unknowns with a narrow band costs what its band costs.
"""

from __future__ import annotations

from typing import Any

from ..typing import IntArray


def magnitude(x: Any) -> float:
    """|Re x| + |Im x|."""
    return abs(x.real) + abs(x.imag)


def factorise_band(A: Any, pivot: IntArray, first: IntArray, last: IntArray) -> bool:
    """A := L U; `first`, `last` become the first and last entry of each row. False where a pivot vanishes."""
    size = A.shape[0]
    for i in range(size):
        j = 0
        while j < size - 1 and magnitude(A[i, j]) == 0.0:
            j += 1
        first[i] = j
        j = size - 1
        while j > 0 and magnitude(A[i, j]) == 0.0:
            j -= 1
        last[i] = j
    for k in range(size):
        best = k
        most = magnitude(A[k, k])
        for i in range(k + 1, size):
            if first[i] <= k and magnitude(A[i, k]) > most:
                best = i
                most = magnitude(A[i, k])
        pivot[k] = best
        if not 0.0 < most < 1e300:
            return False
        if best != k:
            for j in range(size):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            first[k], first[best] = first[best], first[k]
            last[k], last[best] = last[best], last[k]
        over = 1.0 / A[k, k]
        end = last[k] + 1
        for i in range(k + 1, size):
            if first[i] <= k and magnitude(A[i, k]) != 0.0:
                factor = A[i, k] * over
                A[i, k] = factor
                for j in range(k + 1, end):
                    A[i, j] -= factor * A[k, j]
                last[i] = max(last[i], last[k])
    return True


def solve_band(A: Any, pivot: IntArray, first: IntArray, last: IntArray, x: Any) -> None:
    """x := A^-1 x."""
    size = A.shape[0]
    for k in range(size):
        best = pivot[k]
        if best != k:
            x[k], x[best] = x[best], x[k]
    for i in range(size):
        value = x[i]
        for j in range(first[i], i):
            value -= A[i, j] * x[j]
        x[i] = value
    for i in range(size - 1, -1, -1):
        value = x[i]
        for j in range(i + 1, last[i] + 1):
            value -= A[i, j] * x[j]
        x[i] = value / A[i, i]


FUNCTIONS = (magnitude, factorise_band, solve_band)
