#!/usr/bin/env python3
"""Calibrate how a line load yields close to a free end: an elastic block under elliptic pressures, by finite elements.

The block is a prism of `gearfe.fem.extruded`, half of it by symmetry of its middle, with elements along the axis that
are as thin at its ends as the narrowest pressure. The mean displacement under each pressure, less that in the middle of
the block, is printed in units of (2/(pi E')) nu^2/(1 - nu^2) per line load, over the distance from the end; then A, k
and q of `gearfe.gears.width.lines` by least squares over the differences between all pressures. docs/face_width.md has
the result. A minute for each of Poisson's ratios.

Usage: python scripts/benchmarks/calibrate_free_ends.py [--nu 0.2 0.3 0.4]
"""

from __future__ import annotations

import argparse
import itertools
import math
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from gearfe.base.progress import one_thread
from gearfe.base.typing import Array, IntArray
from gearfe.fem.extruded import condense_extruded, lobatto_functions, lobatto_functions_at, section_integrals
from gearfe.fem.plane import Material
from gearfe.gears.contact.flank import edge_shapes
from gearfe.gears.contact.laws import STEEL

#: Half width and depth of the block, its length, smallest elements of section and axis (m), and their growth.
SIZE, LENGTH, FINE, THIN, GROWTH, THICKER = 5e-3, 8e-3, 4e-5, 4e-5, 1.45, 2.0
#: Half widths of the pressures (m).
HALVES = (8e-5, 1.2e-4, 2e-4, 4e-4, 8e-4)
#: Places along the axis (m), and how far from the end the differences are fitted.
PLACES = np.concatenate([np.linspace(0.0, 1e-3, 41), np.linspace(1.05e-3, 0.5 * LENGTH, 30)])
FITTED = 1.5e-3


def graded(first: float, length: float, growth: float) -> Array:
    """Ends of elements from 0 to a length (m), each larger than the one before."""
    sizes = first * growth ** np.arange(math.ceil(math.log1p(length / first * (growth - 1.0)) / math.log(growth)))
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    return ends * length / ends[-1]


def section() -> tuple[Array, IntArray, IntArray, IntArray, Array]:
    """Nodes, triangles, nodes of the bottom and of the surface, and ends of the surface's edges (m)."""
    right = graded(FINE, SIZE, GROWTH)
    ends = np.concatenate([-right[:0:-1], right])
    x, y = (np.interp(np.arange(2 * len(e) - 1) / 2, np.arange(len(e)), e) for e in (ends, -right[::-1]))
    number = np.arange(len(x) * len(y)).reshape(len(y), len(x))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    triangles = []
    for j, i in itertools.product(range(0, len(y) - 2, 2), range(0, len(x) - 2, 2)):
        n = number[j : j + 3, i : i + 3]
        triangles.append([n[0, 0], n[0, 2], n[2, 2], n[0, 1], n[1, 2], n[1, 1]])
        triangles.append([n[0, 0], n[2, 2], n[2, 0], n[1, 1], n[2, 1], n[1, 0]])
    return points, np.array(triangles), number[0], number[-1], ends


def shares(half: float, ends: Array) -> Array:
    """Shares of an elliptic unit force on the nodes of the surface."""
    t, weight = np.polynomial.legendre.leggauss(400)
    angle = 0.5 * math.pi * (t + 1.0)
    place, load = -half * np.cos(angle), weight * np.sin(angle) ** 2
    edge = np.clip(np.searchsorted(ends, place, side="right") - 1, 0, len(ends) - 2)
    values = edge_shapes((place - ends[edge]) / np.diff(ends)[edge])[0]
    found = np.zeros(2 * len(ends) - 1)
    np.add.at(found, 2 * edge[:, None] + np.arange(3), load[:, None] * values)
    return np.asarray(found / load.sum())


def displacements(material: Material) -> Array:
    """Mean displacement under each pressure at `PLACES`, less that in the middle, in units of the docstring."""
    points, triangles, bottom, surface, edges = section()
    thin = graded(THIN, 0.5 * LENGTH, THICKER)
    ends = [*thin, *(LENGTH - thin[-2::-1])]
    orders = [3] * (len(ends) - 1)
    even, odd = lobatto_functions(ends, orders).by_parity()
    at = lobatto_functions_at(ends, orders, PLACES).by_parity()[0]
    width = 2 * even.count + odd.count
    integrals = section_integrals(points, triangles, material)
    with one_thread():
        factor = condense_extruded(
            points, triangles, integrals, (even, odd), retained=np.zeros(0, dtype=np.int64), fixed=bottom
        )
        loads = np.zeros((len(points), width, len(HALVES)))
        each = np.stack([shares(half, edges) for half in HALVES], axis=1)
        loads[surface, even.count : 2 * even.count] = -each[:, None] * (even.values.T @ even.weights)[:, None]
        size = len(points) * width
        moved = factor.solve(loads.reshape(size, -1)).reshape(loads.shape)[surface, even.count : 2 * even.count]
    found = -np.einsum("lp,spc,sc->cl", at.values, moved, each)
    nu = material.poisson_ratio
    unit = 2.0 / math.pi * (1.0 - nu**2) / material.youngs_modulus * nu**2 / (1.0 - nu**2)
    return np.asarray((found - found[:, -1:]) / unit)


def fitted(values: Array) -> tuple[Array, float]:
    """A, k and q, and the largest error of a difference."""
    near = PLACES < FITTED
    couples = list(itertools.combinations(range(len(HALVES)), 2))

    def off(parameters: Array) -> Array:
        grows, k, q = parameters
        wide = [PLACES[near] + half * k / (1.0 + q * PLACES[near] / half) for half in HALVES]
        return np.concatenate([
            grows * np.log(wide[j] / wide[i]) - (values[i] - values[j])[near] for i, j in couples
        ])  # fmt: skip

    answer = least_squares(off, (2.3, 0.3, 1.6))
    return answer.x, float(np.abs(answer.fun).max())


def main() -> None:
    """Print the displacements and the constants."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nu", type=float, nargs="+", default=[0.2, 0.3, 0.4])
    for nu in parser.parse_args().nu:
        values = displacements(replace(STEEL, poisson_ratio=nu))
        (grows, k, q), error = fitted(values)
        print(
            f"nu {nu:g}: A {grows:.3f}, k {k:.4f}, q {q:.3f}; largest error {error:.3f} of {np.ptp(values[:, 0]):.3f}"
        )
        for place in (0.0, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3):
            row = values[:, int(np.abs(PLACES - place).argmin())]
            print(f"  {1e3 * place:.2f} mm:", "  ".join(f"{value:.3f}" for value in row))


if __name__ == "__main__":
    main()
