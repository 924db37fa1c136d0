"""Elliptic pressures on the finite-element flank of one tooth: their nodal loads, and probes of what the flank does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compliance import GearBody
from .flank import Flank, edge_shapes

Array = NDArray[Any]

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True)
class Loads:
    """An elliptic pressure of unit force on a flank, in the axes of its tooth.

    Attributes
    ----------
    unknowns
        Range of the flank's unknowns that it touches.
    edges
        First edge and number of edges.
    probes : ndarray, shape (3, u)
        Nodal forces (-); then what gives, of nodal displacements, the rotation (1/m) of the face and its slide (-),
        both as seen along the pinion's flank.
    span
        Arc lengths between which it acts, from the start of the first edge (m).
    """

    unknowns: slice
    edges: tuple[int, int]
    probes: Array
    span: tuple[float, float]

    def pressure(self, flank: Flank, width: float) -> Array:
        """The pressure itself (1/m2) at the contact points of its edges, on a face `width` wide (m)."""
        first, count = self.edges
        sizes = flank.sizes[first : first + count]
        xi = flank.shapes @ np.array([0.0, 0.5, 1.0])  # the shape functions reproduce the coordinate itself
        arc = (np.cumsum(sizes) - sizes)[:, None] + sizes[:, None] * xi
        middle, half = 0.5 * sum(self.span), 0.5 * (self.span[1] - self.span[0])
        return (np.sqrt(np.maximum(0.0, 1 - ((arc - middle) / half) ** 2)) * 2 / (math.pi * half * width)).ravel()


class Chain:
    """Flank of one gear by the arc length of its chain of edges, from the root's end."""

    def __init__(self, body: GearBody) -> None:
        flank = body.flank
        self.ends = np.concatenate([[0.0], np.cumsum(flank.sizes)])
        self.sizes = flank.sizes
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
        return float(self.sizes[first : last + 1].max())

    def size_at(self, arc: float) -> float:
        """Element size (m) at an arc length, continuous between the middles of the elements."""
        return float(np.interp(arc, 0.5 * (self.ends[1:] + self.ends[:-1]), self.sizes))

    def _edges(self, low: float, high: float) -> tuple[int, int]:
        first = int(np.clip(np.searchsorted(self.ends, low, side="right") - 1, 0, len(self.sizes) - 1))
        return first, int(np.clip(np.searchsorted(self.ends, high) - 1, first, len(self.sizes) - 1))

    def loads(self, low: float, high: float, normal: complex, *, sign: float) -> Loads:
        """Elliptic pressure between two arc lengths.

        Parameters
        ----------
        normal
            Common normal out of the pinion, in the axes of this tooth.
        sign
            -1 for the pinion, 1 for the wheel, whose chain runs against the pinion's.
        """
        first, last = self._edges(low, high)
        edges = np.arange(first, last + 1)
        middle, a = 0.5 * (low + high), 0.5 * (high - low)
        # with s = middle - a cos t the pressure is smooth in t
        t0, t1 = (np.arccos(np.clip((middle - s) / a, -1.0, 1.0)) for s in (self.ends[edges], self.ends[edges + 1]))
        t = 0.5 * (t0 + t1)[:, None] + 0.5 * (t1 - t0)[:, None] * _GAUSS_X
        off = -a * np.cos(t)
        weight = 0.5 * (t1 - t0)[:, None] * _GAUSS_W * np.sin(t) ** 2 * (2.0 / math.pi)
        place = (middle + off - self.ends[edges][:, None]) / self.sizes[edges][:, None]
        shapes = edge_shapes(np.clip(place, 0.0, 1.0))[0]
        # the mean square of the offset under the ellipse is a^2/4
        both = np.stack([weight, -sign * weight * off * 4.0 / a**2])
        nodal = np.zeros((2, 2 * len(edges) + 1))
        parts = np.einsum("peq,eqa->pea", both, shapes)
        nodal[:, :-1:2] += parts[:, :, 0]
        nodal[:, 1::2] += parts[:, :, 1]
        nodal[:, 2::2] += parts[:, :, 2]
        n, tangent = np.array([normal.real, normal.imag]), np.array([normal.imag, -normal.real])
        probes = np.stack([np.outer(nodal[0], sign * n), np.outer(nodal[1], n), np.outer(nodal[0], tangent)])
        start = float(self.ends[first])
        return Loads(
            slice(4 * first, 4 * (last + 1) + 2),
            (first, len(edges)),
            probes.reshape(3, -1),
            (low - start, high - start),
        )
