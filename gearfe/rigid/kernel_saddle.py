"""L U of several banded saddle matrices [[T, G^T], [G, 0]] of one pattern, side by side in lanes, complex.

Matrices are stored by columns, real and imaginary parts in turn: B[j, i, 0] is the real part of row i of column j. Rows
are exchanged for all matrices alike, where the diagonal is small in their sum (threshold pivoting: Duff, Erisman &
Reid, Direct Methods for Sparse Matrices, 2nd ed., Oxford 2017, Sec. 5.2).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..typing import IntArray
from .lanes import Lanes

if TYPE_CHECKING:
    from .lanes import total

#: Share of the largest entry below the diagonal that the diagonal has where it is the pivot.
DIAGONAL = 0.1


def factorise_band(
    B: Lanes, over: Lanes, reach: IntArray, pivot: IntArray, low: IntArray, top: IntArray, right: IntArray
) -> bool:
    """B := L U; False where a pivot vanishes.

    `over` (N, 2) becomes 1 / pivot, `low` the last row of a column of L, `top` the first row of one of U; `reach` is
    the last row that a column may come to, `right` the last column of each row, which changes.
    """
    size = B.shape[0]
    for j in range(size):
        top[j] = j
    for c in range(size):
        best = c
        most = 0.0
        here = 0.0
        low[c] = c
        for i in range(c, reach[c] + 1):
            value = total(abs(B[c, i, 0]) + abs(B[c, i, 1]))
            if i == c:
                here = value
            if value > 0.0:
                low[c] = i
            if value > most:
                most = value
                best = i
        if not 0.0 < most < 1e300:
            return False
        if here >= DIAGONAL * most:
            best = c
        pivot[c] = best
        if best != c:
            for j in range(c, max(right[c], right[best]) + 1):
                for k in range(2):
                    kept = 1.0 * B[j, c, k]
                    B[j, c, k] = B[j, best, k]
                    B[j, best, k] = kept
            right[c], right[best] = right[best], right[c]
        x = B[c, c, 0]
        y = B[c, c, 1]
        share = 1.0 / (x * x + y * y)
        x = x * share
        y = -y * share
        over[c, 0] = x
        over[c, 1] = y
        for i in range(c + 1, low[c] + 1):
            a = B[c, i, 0]
            b = B[c, i, 1]
            B[c, i, 0], B[c, i, 1] = a * x - b * y, a * y + b * x
            right[i] = max(right[i], right[c])
        for j in range(c + 1, right[c] + 1):
            x = B[j, c, 0]
            y = B[j, c, 1]
            if total(abs(x) + abs(y)) > 0.0:
                top[j] = min(top[j], c)
                for i in range(c + 1, low[c] + 1):
                    a = B[c, i, 0]
                    b = B[c, i, 1]
                    B[j, i, 0] -= a * x - b * y
                    B[j, i, 1] -= a * y + b * x
    return True


def solve_band(B: Lanes, over: Lanes, pivot: IntArray, low: IntArray, top: IntArray, x: Lanes) -> None:
    """x := B^-1 x, shape (N, 2) of real and imaginary parts."""
    size = B.shape[0]
    for c in range(size):
        best = pivot[c]
        a = 1.0 * x[best, 0]
        b = 1.0 * x[best, 1]
        if best != c:
            x[best, 0] = x[c, 0]
            x[best, 1] = x[c, 1]
            x[c, 0] = a
            x[c, 1] = b
        for i in range(c + 1, low[c] + 1):
            x[i, 0] -= B[c, i, 0] * a - B[c, i, 1] * b
            x[i, 1] -= B[c, i, 0] * b + B[c, i, 1] * a
    for c in range(size - 1, -1, -1):
        a = x[c, 0] * over[c, 0] - x[c, 1] * over[c, 1]
        b = x[c, 0] * over[c, 1] + x[c, 1] * over[c, 0]
        x[c, 0] = a
        x[c, 1] = b
        for i in range(top[c], c):
            x[i, 0] -= B[c, i, 0] * a - B[c, i, 1] * b
            x[i, 1] -= B[c, i, 0] * b + B[c, i, 1] * a


FUNCTIONS = (factorise_band, solve_band)
NAMES = {"DIAGONAL": DIAGONAL}
