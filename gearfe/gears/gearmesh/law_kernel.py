r"""A mesh law with the derivatives that Newton's method needs, sample by sample, compiled.

The pair forces minimise the convex energy :math:`E = \sum_k[\Phi - F_k(\delta - t)] + \sum_{k<l} CF_kF_l` over
:math:`F_k \ge 0`. Projected Newton steps, halved until E falls, converge from any initial forces (D. P. Bertsekas,
Projected Newton methods for optimization problems with simple constraints, SIAM J. Control Optim. 20, 1982).

With :math:`g_k = t'(\psi_k) + \Lambda_\psi(\psi_k, F_k) + \sum_l C'_{kl}F_l` and J as in `gearfe.gears.gearmesh.law`,

.. math::
    \frac{dF_k}{d\delta} = (J^{-1}1)_k,\quad \frac{dF_k}{d\varphi} = -(J^{-1}g)_k,\quad
    \frac{\partial M}{\partial\delta} = \frac{\partial F}{\partial\varphi},\quad
    \frac{\partial M}{\partial\varphi} = -\sum_k\Big[F_k t'' + \Phi_{\psi\psi} + g_k\frac{dF_k}{d\varphi}\Big]
    - \sum_{k<l} C''F_kF_l .
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...base.typing import Array
from ...multibody.compiled import kernels as compiled
from ...multibody.compiled.packed import Packed

#: Newton steps for the pair forces, their relative change in the last one: what is left is of the order of its square.
MOST, SETTLED = 100, 1e-7
#: Halvings of a step; least part of the expected fall of the energy (Armijo), and what rounding leaves of the energy.
HALVINGS, FALL, ROUNDING = 40, 1e-4, 1e-14
#: Columns of the results: F, M, dF/d approach, dF/d phase = dM/d approach, dM/d phase, W, 1 where beyond the reach.
FORCE, MOMENT, TANGENT, CROSS, BEND, ENERGY, BEYOND, RESULTS = range(8)
#: Rows of the work space, before those of the matrix and of C: gap, t', t'', Lambda and its derivative with the force,
#: Phi, two of its derivatives and one of Lambda with the angle, whether a pair is loaded, two right sides that become
#: solutions, g, slope of the energy, pair forces on trial, cell of the force with the energy's polynomial there.
GAPS, TOUCH1, TOUCH2, LAMBDA, GIVES, PHI, TURN, TURN2, SHIFT, BEARS, RIGHT1, RIGHT2, BEFORE, OFF, TRIAL, PART = range(
    16
)
ROWS = PART + 6


class LawTables(NamedTuple):
    """A mesh law, see `gearfe.gears.gearmesh.law.MeshLaw`."""

    nodes: Array
    forces: Array
    touch: Array
    energies: Array  # (s, n, m, 5, 4)
    coupling: Array
    reach: float


class Jets(NamedTuple):
    """Arguments and results of `law_jets`."""

    phase: Array  # (n,) (rad)
    approach: Array  # (n,) (m)
    shifts: Array  # (n, s) further approach at which each pair touches (m)
    pairs: Array  # (n, s) pair forces to begin with, then found (N)
    slopes: Array  # (2, n, s) their derivatives with approach and phase
    work: Array  # scratch
    out: Array  # (n, RESULTS)


def law_jets(law: LawTables, at: Jets) -> int:
    """Forces, moments and their derivatives at phases and approaches; returns 0."""
    phase, approach, shifts, pairs, slopes, work, out = (
        at.phase, at.approach, at.shifts, at.pairs, at.slopes, at.work, at.out,
    )  # fmt: skip
    nodes, forces, touch, energies, coupling = law.nodes, law.forces, law.touch, law.energies, law.coupling
    slots = touch.shape[0]
    cells = nodes.shape[0] - 1
    cycle = nodes[cells] - nodes[0]
    for i in range(phase.shape[0]):
        x = phase[i]
        settled = math.isfinite(x) and math.isfinite(approach[i])
        if settled:
            x -= math.floor((x - nodes[0]) / cycle) * cycle
        cell = 0
        top = cells
        while top - cell > 1:
            middle = (cell + top) // 2
            if nodes[middle] <= x:
                cell = middle
            else:
                top = middle
        z = x - nodes[cell]
        least = 1e300
        for k in range(slots):
            c = touch[k, cell]
            t = c[0] + z * (c[1] + z * (c[2] + z * c[3])) + shifts[i, k]
            least = min(least, t)
            work[GAPS, k] = approach[i] - t
            work[TOUCH1, k] = c[1] + z * (2.0 * c[2] + 3.0 * z * c[3])
            work[TOUCH2, k] = 2.0 * c[2] + 6.0 * z * c[3]
        out[i, BEYOND] = 1.0 if approach[i] - least > law.reach else 0.0
        if settled and approach[i] <= least:  # all pairs are apart
            for k in range(slots):
                pairs[i, k] = 0.0
                slopes[0, i, k] = 0.0
                slopes[1, i, k] = 0.0
            for k in range(BEYOND):
                out[i, k] = 0.0
            continue
        for k in range(slots):
            work[PART, k] = -1.0
            for j in range(k + 1, slots):
                c = coupling[j - k - 1, k, cell]
                both = c[0] + z * (c[1] + z * (c[2] + z * c[3]))
                work[ROWS + slots + k, j] = both
                work[ROWS + slots + j, k] = both
        _compliances(forces, energies, cell, z, pairs[i], work)
        energy = _slopes_of_energy(slots, pairs[i], work)
        largest = 0.0
        for k in range(slots):
            largest = max(largest, pairs[i, k])
        most = MOST if settled else 0
        settled = False
        for _ in range(most):
            for k in range(slots):
                off = work[OFF, k]
                work[BEARS, k] = 1.0 if pairs[i, k] > SETTLED * largest or off < 0.0 else 0.0
                work[RIGHT1, k] = -off
            matrix(slots, work)
            for k in range(slots):
                if work[BEARS, k] == 0.0:
                    work[RIGHT1, k] = -pairs[i, k]
                work[RIGHT2, k] = work[OFF, k]  # where the step begins
            solved(slots, 1, work)
            share = 1.0
            for _ in range(HALVINGS):
                change = 0.0
                largest = 0.0
                fall = 0.0
                for k in range(slots):
                    new = max(pairs[i, k] + share * work[RIGHT1, k], 0.0)
                    move = new - pairs[i, k]
                    change = max(change, abs(move))
                    largest = max(largest, new)
                    fall += work[RIGHT2, k] * move
                    work[TRIAL, k] = new
                _compliances(forces, energies, cell, z, work[TRIAL], work)
                lower = _slopes_of_energy(slots, work[TRIAL], work)
                if lower <= energy + FALL * fall + ROUNDING * (abs(energy) + abs(lower)):
                    break
                share *= 0.5
            energy = lower
            for k in range(slots):
                pairs[i, k] = work[TRIAL, k]
            if share == 1.0 and change <= SETTLED * largest:
                settled = True
                break
        if not settled:  # phase or approach are not finite, or the law is not convex
            for k in range(slots):
                pairs[i, k] = 0.0
            for k in range(RESULTS):
                out[i, k] = math.nan
            continue
        _turning(forces, energies, cell, z, pairs[i], work)
        force = 0.0
        moment = 0.0
        bend = 0.0
        for k in range(slots):
            F = pairs[i, k]
            work[BEARS, k] = 1.0 if F > 0.0 else 0.0
            force += F
            moment -= F * work[TOUCH1, k] + work[TURN, k]
            bend -= F * work[TOUCH2, k] + work[TURN2, k]
            work[BEFORE, k] = work[TOUCH1, k] + work[SHIFT, k]
        for k in range(slots):
            for j in range(k + 1, slots):
                c = coupling[j - k - 1, k, cell]
                once = c[1] + z * (2.0 * c[2] + 3.0 * z * c[3])
                both = pairs[i, k] * pairs[i, j]
                work[BEFORE, k] += once * pairs[i, j]
                work[BEFORE, j] += once * pairs[i, k]
                moment -= once * both
                bend -= (2.0 * c[2] + 6.0 * z * c[3]) * both
        for k in range(slots):
            work[RIGHT1, k] = work[BEARS, k]
            work[RIGHT2, k] = -work[BEFORE, k] * work[BEARS, k]
        matrix(slots, work)
        solved(slots, 2, work)
        tangent = 0.0
        cross = 0.0
        for k in range(slots):
            tangent += work[RIGHT1, k]
            cross += work[RIGHT2, k]
            bend -= work[BEFORE, k] * work[RIGHT2, k]
            slopes[0, i, k] = work[RIGHT1, k]
            slopes[1, i, k] = work[RIGHT2, k]
        out[i, FORCE] = force
        out[i, MOMENT] = moment
        out[i, TANGENT] = tangent
        out[i, CROSS] = cross
        out[i, BEND] = bend
        out[i, ENERGY] = -energy
    return 0


def _slopes_of_energy(slots: int, pairs: Array, work: Array) -> float:
    """E = sum(Phi - F gap) + sum(C F F)/2, whose least value over all F >= 0 is -W; its slopes become row `OFF`."""
    energy = 0.0
    for k in range(slots):
        others = 0.0
        for j in range(slots):
            if j != k:
                others += work[ROWS + slots + k, j] * pairs[j]
        work[OFF, k] = work[LAMBDA, k] + others - work[GAPS, k]
        energy += work[PHI, k] + pairs[k] * (0.5 * others - work[GAPS, k])
    return energy


def _compliances(forces: Array, energies: Array, cell: int, z: float, pairs: Array, work: Array) -> None:
    """Phi, Lambda and its derivative with the force, from the polynomials of the pairs' cells."""
    parts = forces.shape[0] - 1
    for k in range(pairs.shape[0]):
        part = 0
        while part < parts - 1 and pairs[k] >= forces[part + 1]:
            part += 1
        if work[PART, k] != part:
            work[PART, k] = part
            for b in range(5):
                c = energies[k, cell, part, b]
                work[PART + 1 + b, k] = c[0] + z * (c[1] + z * (c[2] + z * c[3]))
        f = pairs[k] - forces[part]
        e0, e1, e2, e3, e4 = (
            work[PART + 1, k], work[PART + 2, k], work[PART + 3, k], work[PART + 4, k], work[PART + 5, k],
        )  # fmt: skip
        work[PHI, k] = e0 + f * (e1 + f * (e2 + f * (e3 + f * e4)))
        work[LAMBDA, k] = e1 + f * (2.0 * e2 + f * (3.0 * e3 + f * 4.0 * e4))
        work[GIVES, k] = 2.0 * e2 + f * (6.0 * e3 + f * 12.0 * e4)


def _turning(forces: Array, energies: Array, cell: int, z: float, pairs: Array, work: Array) -> None:
    """First and second derivative of Phi with the angle, and Lambda's."""
    for k in range(pairs.shape[0]):
        part = int(work[PART, k])
        f = pairs[k] - forces[part]
        turn = 0.0
        turn2 = 0.0
        shift = 0.0
        for b in range(4, -1, -1):
            c = energies[k, cell, part, b]
            shift = shift * f + turn
            turn = turn * f + c[1] + z * (2.0 * c[2] + 3.0 * z * c[3])
            turn2 = turn2 * f + 2.0 * c[2] + 6.0 * z * c[3]
        work[TURN, k] = turn
        work[SHIFT, k] = shift
        work[TURN2, k] = turn2


def matrix(slots: int, work: Array) -> None:
    """J of the pairs that bear; ones on the diagonal for the others."""
    for k in range(slots):
        for j in range(slots):
            both = work[BEARS, k] > 0.0 and work[BEARS, j] > 0.0
            if j == k:
                work[ROWS + k, j] = work[GIVES, k] if both else 1.0
            else:
                work[ROWS + k, j] = work[ROWS + slots + k, j] if both else 0.0


def solved(slots: int, sides: int, work: Array) -> None:
    """One or both right sides over the matrix, by elimination in place: it is positive definite."""
    for k in range(slots):
        over = 1.0 / work[ROWS + k, k]
        for i in range(k + 1, slots):
            factor = work[ROWS + i, k] * over
            if factor != 0.0:
                for j in range(k + 1, slots):
                    work[ROWS + i, j] -= factor * work[ROWS + k, j]
                for side in range(RIGHT1, RIGHT1 + sides):
                    work[side, i] -= factor * work[side, k]
        work[ROWS + k, k] = over
    for side in range(RIGHT1, RIGHT1 + sides):
        for k in range(slots - 1, -1, -1):
            for j in range(k + 1, slots):
                work[side, k] -= work[ROWS + k, j] * work[side, j]
            work[side, k] *= work[ROWS + k, k]


FUNCTIONS = (law_jets, _slopes_of_energy, _compliances, _turning, matrix, solved)
#: Functions that are copied into the loop: a call costs as much as what they do.
INLINE = tuple(function.__name__ for function in FUNCTIONS[1:])
NAMES = {name: value for name, value in globals().items() if name == "math" or isinstance(value, int | float)}


KERNELS = compiled.Kernels(FUNCTIONS, NAMES, ("law_jets",), INLINE)


def packed_tables(tables: LawTables) -> LawTables | Packed:
    """What `evaluate` gets of a law."""
    made: LawTables | Packed = compiled.packed(tables)
    return made


def load_kernel() -> None:
    """Compile the kernel, or load it, by a law that is asked nowhere."""
    law = LawTables(
        np.zeros(2), np.zeros(2), np.zeros((1, 1, 4)), np.zeros((1, 1, 1, 5, 4)), np.zeros((0, 0, 1, 4)), 1.0
    )
    evaluate(packed_tables(law), np.zeros(0), np.zeros(0), np.zeros((0, 1)), np.zeros((0, 1)))


def evaluate(
    tables: LawTables | Packed, phase: Array, approach: Array, shifts: Array, pairs: Array
) -> tuple[Array, Array]:
    """Evaluate a law at n places, see `law_jets`.

    Parameters
    ----------
    tables : LawTables
        The law, as `packed_tables` gives it.
    phase : ndarray, shape (n,)
        Pinion angles (rad).
    approach : ndarray, shape (n,)
        Approaches (m).
    shifts : ndarray, shape (n, s)
        Further approach at which each pair touches (m).
    pairs : ndarray, shape (n, s)
        Pair forces (N); those found are written.

    Returns
    -------
    out, slopes : ndarray, shapes (n, RESULTS), (2, n, s)
        Results of the law, and derivatives of the pair forces.
    """
    count, slots = pairs.shape
    out, slopes, work = np.zeros((count, RESULTS)), np.zeros((2, count, slots)), np.zeros((ROWS + 2 * slots, slots))
    at = Jets(phase, approach, shifts, pairs, slopes, work, out)
    run = KERNELS.compiled.law_jets.on(tables, Packed(at) if isinstance(tables, Packed) else at)
    if KERNELS.loaded:
        run()
    else:
        KERNELS.load(run)
    return out, slopes
