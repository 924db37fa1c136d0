"""Elliptic pressures on the finite-element flank of one tooth: their nodal loads."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compliance import GearBody
from .flank import edge_shapes

Array = NDArray[Any]

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(10)


class Chain:
    """Flank of one gear by the arc length of its chain of edges, from the root's end."""

    def __init__(self, body: GearBody) -> None:
        flank = body.flank
        self.ends = np.concatenate([[0.0], np.cumsum(flank.sizes)])
        self.sizes = flank.sizes
        self._ends, self._sizes = self.ends.tolist(), self.sizes.tolist()
        self.corners = flank.points[2 * np.arange(flank.edges)[:, None] + np.arange(3)]
        self.radii = np.linalg.norm(flank.points[::2], axis=1)

    def arc_at(self, radius: float) -> float:
        """Arc length (m) at a radius (m)."""
        edge = int(np.clip(np.searchsorted(self.radii, radius) - 1, 0, len(self.sizes) - 1))
        low, high = self.radii[edge : edge + 2]
        xi = min(1.0, max(0.0, (radius - low) / (high - low)))
        for _ in range(8):
            value, slope, _ = edge_shapes(np.array(xi))
            point = value @ self.corners[edge]
            now = float(np.linalg.norm(point))
            rate = float(point @ (slope @ self.corners[edge])) / now
            step = (radius - now) / rate if rate > 0 else 0.0
            xi = min(1.0, max(0.0, xi + step))
            if abs(step) < 1e-12:
                break
        speed = np.linalg.norm(edge_shapes(0.5 * (_GAUSS_X + 1) * xi)[1] @ self.corners[edge], axis=-1)
        return float(self.ends[edge] + 0.5 * xi * (_GAUSS_W @ speed))

    def size_in(self, low: float, high: float) -> float:
        """Largest element between two arc lengths (m)."""
        first, last = self._edges(low, high)
        return max(self._sizes[first : last + 1])

    def size_at(self, arc: Array | float) -> Any:
        """Element size (m) at arc lengths, continuous between the middles of the elements."""
        return np.interp(arc, 0.5 * (self.ends[1:] + self.ends[:-1]), self.sizes)

    def _edges(self, low: float, high: float) -> tuple[int, int]:
        most = len(self._sizes) - 1
        first = min(max(bisect_right(self._ends, low) - 1, 0), most)
        return first, min(max(bisect_left(self._ends, high) - 1, first), most)

    def loads(self, low: float, high: float) -> tuple[slice, Array]:
        """Nodes under an elliptic pressure of unit force between two arc lengths (m), and its shares on them."""
        first, last = self._edges(low, high)
        edges = np.arange(first, last + 1)
        middle, a = 0.5 * (low + high), 0.5 * (high - low)
        # with s = middle - a cos t the pressure is smooth in t
        t0, t1 = (np.arccos(np.clip((middle - s) / a, -1.0, 1.0)) for s in (self.ends[edges], self.ends[edges + 1]))
        t = 0.5 * (t0 + t1)[:, None] + 0.5 * (t1 - t0)[:, None] * _GAUSS_X
        weight = 0.5 * (t1 - t0)[:, None] * _GAUSS_W * np.sin(t) ** 2 * (2.0 / math.pi)
        place = (middle - a * np.cos(t) - self.ends[edges][:, None]) / self.sizes[edges][:, None]
        parts = np.einsum("eq,eqa->ea", weight, edge_shapes(np.clip(place, 0.0, 1.0))[0])
        nodal = np.zeros(2 * len(edges) + 1)
        nodal[:-1:2] += parts[:, 0]
        nodal[1::2] += parts[:, 1]
        nodal[2::2] += parts[:, 2]
        return slice(2 * first, 2 * last + 3), nodal
