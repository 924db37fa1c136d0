r"""Compiled loop over the kicks of `gearfe.drivetrain.runup.monodromy`.

With the forces :math:`f = A(t)\,(r + R f)` of the periodic part, where r is what the integrated modes read and R what
all others yield at once, a kick of the weight h adds

.. math:: h\,W\,(1 - A R)^{-1} A\,r

to the state. The columns of the map are the rows of ``x``, so every inner loop runs along contiguous numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.typing import Array
from ...multibody.compiled import kernels as compiled

#: Forces that a loop over the coordinates takes at a time, written out in `_kicked`: a count.
AT_ONCE = 3


class Kicks(NamedTuple):
    """Arguments of `kick_through`: d forces, p reads, w real coordinates, K kicks a step."""

    x: Array  # (columns, w) columns of the map, then those over all steps
    strengths: Array  # (steps, K, d, p) A at the kicks
    yields: Array  # (p, d) R
    weights: Array  # (K,) h
    reads: Array  # (K, p, w) what the forces depend on
    pushes: Array  # (K, e, w) change of the coordinates by unit forces; e is d rounded up to a multiple of `AT_ONCE`
    turns: Array  # (K, w) factors of the flow after a kick, real and imaginary parts beside each other; (0, w) without
    moves: Array  # (K, w, w) the flow after a kick as a matrix that rows are multiplied by; (0, w, w) without
    flows: Array  # (K,) 1.0 where the flow acts after a kick, else 0.0
    work: Array  # scratch, see `scratch`


def kick_through(run: Kicks) -> int:
    """Take the columns of the map through all kicks; returns 0."""
    x, strengths, yields, weights, reads, pushes = (
        run.x, run.strengths, run.yields, run.weights, run.reads, run.pushes,
    )  # fmt: skip
    turns, moves, flows, work = run.turns, run.moves, run.flows, run.work
    steps, kicks, forces, seen = strengths.shape
    width = x.shape[1]
    for s in range(steps):
        for j in range(kicks):
            _yielding(strengths[s, j], yields, work)
            for a in range(pushes.shape[1]):  # forces of unit coordinates, behind the scratch of the elimination
                for k in range(width):
                    work[forces + a, k] = 0.0
                for b in range(seen if a < forces else 0):
                    part = weights[j] * work[a, forces + b]
                    if part != 0.0:
                        for k in range(width):
                            work[forces + a, k] += part * reads[j, b, k]
            _kicked(x, pushes[j], work, forces)
            if flows[j] != 0.0:
                if moves.shape[0] > 0:
                    _moved(x, moves[j], work)
                else:
                    for i in range(x.shape[0]):
                        for k in range(0, width, 2):
                            real = turns[j, k] * x[i, k] - turns[j, k + 1] * x[i, k + 1]
                            x[i, k + 1] = turns[j, k] * x[i, k + 1] + turns[j, k + 1] * x[i, k]
                            x[i, k] = real
    return 0


def _kicked(x: Array, push: Array, work: Array, first: int) -> None:
    """Add a kick to each row of x, three forces at a time: so they stay in the processor's registers."""
    width, forces = x.shape[1], push.shape[0]
    last = work.shape[0] - 1
    for i in range(x.shape[0]):
        for a in range(0, forces, 3):
            one = 0.0
            two = 0.0
            three = 0.0
            for k in range(width):
                one += x[i, k] * work[first + a, k]
                two += x[i, k] * work[first + a + 1, k]
                three += x[i, k] * work[first + a + 2, k]
            work[last, a] = one
            work[last, a + 1] = two
            work[last, a + 2] = three
        for a in range(0, forces, 3):
            one = work[last, a]
            two = work[last, a + 1]
            three = work[last, a + 2]
            for k in range(width):
                x[i, k] += one * push[a, k] + two * push[a + 1, k] + three * push[a + 2, k]


def _yielding(strength: Array, yields: Array, work: Array) -> None:
    """(1 - A R)^-1 A behind the first d columns of the first d rows, by elimination with row exchanges."""
    forces, seen = strength.shape
    whole = forces + seen
    for a in range(forces):
        for b in range(forces):
            both = 0.0
            for c in range(seen):
                both += strength[a, c] * yields[c, b]
            work[a, b] = (1.0 if a == b else 0.0) - both
        for c in range(seen):
            work[a, forces + c] = strength[a, c]
    for a in range(forces):
        best = a
        for i in range(a + 1, forces):
            if abs(work[i, a]) > abs(work[best, a]):
                best = i
        if best != a:
            for k in range(a, whole):
                kept = work[a, k]
                work[a, k] = work[best, k]
                work[best, k] = kept
        over = 1.0 / work[a, a]
        for k in range(a, whole):
            work[a, k] *= over
        for i in range(forces):
            factor = work[i, a]
            if i != a and factor != 0.0:
                for k in range(a, whole):
                    work[i, k] -= factor * work[a, k]


def _moved(x: Array, move: Array, work: Array) -> None:
    """Each row of x times a matrix, by way of the last row of the scratch."""
    width, last = x.shape[1], work.shape[0] - 1
    for i in range(x.shape[0]):
        for k in range(width):
            work[last, k] = x[i, k]
            x[i, k] = 0.0
        for b in range(width):
            part = work[last, b]
            for k in range(width):
                x[i, k] += part * move[b, k]


FUNCTIONS = (kick_through, _kicked, _yielding, _moved)
KERNELS = compiled.Kernels(FUNCTIONS, {}, ("kick_through",), ("_kicked", "_yielding", "_moved"))


def scratch(forces: int, seen: int, width: int) -> Array:
    """Work space of `kick_through`."""
    return np.empty((2 * forces + AT_ONCE, max(forces + seen, width, forces + AT_ONCE)))


def run_kicks(kicks: Kicks) -> None:
    """Run `kick_through`, whose result is in `Kicks.x`."""
    run = KERNELS.compiled.kick_through.on(compiled.packed(kicks))
    if KERNELS.loaded:
        run()
    else:
        KERNELS.load(run)


def load_kernel() -> None:
    """Compile the kernel, or load it, by a map over no steps."""
    none = np.zeros((0, 0))
    run_kicks(
        Kicks(
            none, np.zeros((0, 0, 0, 0)), none, np.zeros(0), np.zeros((0, 0, 0)), np.zeros((0, 0, 0)), none,
            np.zeros((0, 0, 0)), np.zeros(0), scratch(0, 0, 0),
        )
    )  # fmt: skip
