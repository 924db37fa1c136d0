"""Rows of a program by their variables: orders of the variables and of the rows, dense gradients (for collocation)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..typing import Array
from .kernel_rows import fill
from .kernel_tape import cauchy

if TYPE_CHECKING:
    from .kernel_equations import Scratch
    from .tape import Program


def row_orders(tb: Program, Z: Array, TF: Array, k: int, out: Array) -> None:
    """Order k of all rows."""
    rows = tb.rows
    for r in range(rows.constant.shape[0]):
        out[r] = rows.constant[r] if k == 0 else 0.0
        if rows.motion[r] >= 0:
            out[r] -= TF[rows.motion[r], k]
    for p in range(rows.place.shape[0]):
        out[rows.place[p, 0]] += rows.factor[p] * Z[rows.place[p, 1], k]
    for p in range(rows.pair.shape[0]):
        out[rows.pair[p, 0]] += rows.weight[p] * cauchy(Z, rows.pair[p, 1], Z, rows.pair[p, 2], k)


def gradients(tb: Program, Z: Array, w: Scratch) -> None:
    """w.G := dg/dq where the variables are Z[:, 0]."""
    rows, curves, G, D = tb.rows, tb.curves, w.G, w.D
    n = tb.mass.shape[0]
    for r in range(D.shape[0]):
        fill(D[r], 0.0)
    for p in range(rows.place.shape[0]):
        D[rows.place[p, 0], rows.place[p, 1]] += rows.factor[p]
    for p in range(rows.pair.shape[0]):
        r, i, j = rows.pair[p, 0], rows.pair[p, 1], rows.pair[p, 2]
        D[r, i] += rows.weight[p] * Z[j, 0]
        D[r, j] += rows.weight[p] * Z[i, 0]
    for r in range(D.shape[0]):
        for i in range(n):
            G[r, i] = D[r, i]
        for f in range(curves.place.shape[0]):
            G[r, curves.place[f, 0]] += D[r, n + f] * curves.sign[f] * Z[curves.place[f, 1], 0]


FUNCTIONS = (row_orders, gradients)
