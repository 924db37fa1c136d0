"""Structured meshes of second-order triangles, written down by hand: blocks, rings and Hertz' bodies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gearfe.fem.plane import Material
from gearfe.gears.contact.whole_gears.bodies import ElasticBody

Array = NDArray[np.float64]


def mapped_grid(
    columns: Array, rows: Array, place: Callable[[Array, Array], tuple[Array, Array]], material: Material
) -> ElasticBody:
    """Body whose cells between `columns` and `rows` (values of two parameters) are cut into two triangles each.

    Nodes, those in the middle of edges too, are at `place(s, t)` and so on the exact outline. Boundaries by name:
    ``bottom``, ``top`` (first and last row), ``left``, ``right`` (first and last column).
    """
    nx, ny = len(columns) - 1, len(rows) - 1
    s, t = _with_middles(columns), _with_middles(rows)
    number = np.arange((2 * nx + 1) * (2 * ny + 1)).reshape(2 * nx + 1, 2 * ny + 1)
    x, y = place(*np.meshgrid(s, t, indexing="ij"))
    i, j = (2 * k.ravel() for k in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))

    def node(a: int, b: int) -> NDArray[np.int64]:
        return number[i + a, j + b]

    lower = [node(0, 0), node(2, 0), node(2, 2), node(1, 0), node(2, 1), node(1, 1)]
    upper = [node(0, 0), node(2, 2), node(0, 2), node(1, 1), node(1, 2), node(0, 1)]
    triangles = np.concatenate([np.stack(lower, axis=1), np.stack(upper, axis=1)])

    def chain(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.stack([nodes[:-2:2], nodes[1:-1:2], nodes[2::2]], axis=1)

    boundaries = {
        "bottom": chain(number[:, 0]),
        "top": chain(number[:, -1]),
        "left": chain(number[0]),
        "right": chain(number[-1]),
    }
    return ElasticBody(np.stack([x.ravel(), y.ravel()], axis=1), triangles, boundaries, material)


def block(x: tuple[float, float], y: tuple[float, float], nx: int, ny: int, material: Material) -> ElasticBody:
    """Rectangle of nx times ny cells."""
    return mapped_grid(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1), lambda s, t: (s, t), material)


def quarter_ring(inner: float, outer: float, nr: int, nt: int, material: Material) -> ElasticBody:
    """Quarter of a ring in x, y >= 0: ``left`` the inner and ``right`` the outer circle, ``bottom`` on the x axis,
    ``top`` on the y axis."""
    return mapped_grid(
        np.linspace(inner, outer, nr + 1),
        np.linspace(0, np.pi / 2, nt + 1),
        lambda r, t: (r * np.cos(t), r * np.sin(t)),
        material,
    )


def _with_middles(values: Array) -> Array:
    both = np.empty(2 * len(values) - 1)
    both[::2], both[1::2] = values, 0.5 * (values[1:] + values[:-1])
    return both
