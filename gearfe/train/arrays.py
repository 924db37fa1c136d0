"""Stiffness curves and mesh laws of a train as arrays, for the compiled recurrences of `gearfe.train.series`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..meshlaw.law import NEVER, MeshLaw
from ..stiffness.periodic import PeriodicInterpolant
from ..typing import Array, IntArray


class Curves(NamedTuple):
    """Stiffness curves, one after the other."""

    first: IntArray  # (c + 1,) first node of each
    nodes: Array  # (all nodes,) rising phases; the last of each is its first plus the period
    cubics: Array  # (all nodes, 4) stiffness over the phase from each node but the last


class Laws(NamedTuple):
    """l mesh laws, filled up to the largest: see `gearfe.meshlaw.law.MeshLaw`."""

    cells: IntArray  # (l,) cells of the phase
    parts: IntArray  # (l,) cells of the pair force
    nodes: Array  # (l, n + 1)
    forces: Array  # (l, m + 1)
    touch: Array  # (l, s, n, 4)
    energies: Array  # (l, s, n, m, 5, 4)
    coupling: Array  # (l, s s, n, 4) lower slot times s plus upper slot


def curve_arrays(curves: Sequence[PeriodicInterpolant]) -> Curves:
    """Arrays of curves."""
    return Curves(
        np.cumsum([0, *(len(curve.nodes) for curve in curves)]).astype(np.int64),
        np.concatenate([np.zeros(0), *(curve.nodes for curve in curves)]),
        np.concatenate([np.zeros((0, 4)), *(np.vstack([curve.cubics, np.zeros(4)]) for curve in curves)]),
    )


def law_arrays(laws: Sequence[MeshLaw]) -> Laws:
    """Arrays of mesh laws."""
    count, sizes = len(laws), [(law.slots, len(law.nodes) - 1, len(law.forces) - 1) for law in laws]
    slots, cells, parts = (max((size[i] for size in sizes), default=1) for i in range(3))
    made = Laws(
        np.array([size[1] for size in sizes], dtype=np.int64),
        np.array([size[2] for size in sizes], dtype=np.int64),
        np.zeros((count, cells + 1)),
        np.zeros((count, parts + 1)),
        np.zeros((count, slots, cells, 4)),
        np.zeros((count, slots, cells, parts, 5, 4)),
        np.zeros((count, slots * slots, cells, 4)),
    )
    made.touch[..., 0] = NEVER
    for i, (law, (s, n, m)) in enumerate(zip(laws, sizes, strict=True)):
        made.nodes[i, : n + 1], made.forces[i, : m + 1] = law.nodes, law.forces
        made.touch[i, :s, :n], made.energies[i, :s, :n, :m] = law.touch, law.energies.swapaxes(3, 4)
        for low in range(s - 1):
            for up in range(low + 1, s):
                made.coupling[i, low * slots + up, :n] = law.coupling[up - low - 1, low]
    return made
