r"""The forces of a train by the orders of their Taylor series: those of `gearfe.train.forces`, as recurrences.

Over x, time :math:`t + s x`, all forces follow order by order from Cauchy's rule for products
(`gearfe.train.program`). A step ends where a phase or a pair force leaves its cell, where flanks meet or part, and
where a damper would begin to pull.
"""

from __future__ import annotations

import numpy as np

from ..rigid import SeriesLaw
from ..rigid.kernel_rows import time_series
from ..typing import Array, IntArray
from . import corners
from . import program as tables
from .corners import SAME, train_corner
from .forces import CurveFlank, LawFlank, TrainForces
from .program import (
    BEFORE,
    CELL,
    DELTA,
    ENERGIES,
    FULL,
    GAP,
    H1,
    H2,
    H3,
    JACOBIAN,
    LEVER,
    NUMBERS,
    ORIGIN,
    PER_COUPLE,
    PER_FLANK,
    PER_SLIDE,
    PER_SLOT,
    SLOTS,
    SMOOTH,
    TOUCHES,
    UNKNOWN,
    F,
    Operations,
    Program,
    train_program,
)

#: Most Newton steps for order 0 of the pair forces, and their relative change in the last one.
NEWTON, CHANGED = 50, 1e-9


def train_order(j: int, t: float, s: float, u: Array, p: Program, memory: Array, pieces: IntArray, out: Array) -> None:
    """Order j of the forces over x, time t + s x, from the orders up to j + 1 of u; see the module's docstring."""
    if j == 0:
        step_begins(t, s, p, memory, pieces)
    for i in range(p.inputs.reals.shape[0]):
        row = p.inputs.ints[i, 0]
        d = p.inputs.ints[i, 1]
        k = j + p.inputs.ints[i, 2]
        value = p.inputs.reals[i, 0] * memory[0, k] + p.inputs.reals[i, 1] * u[d, k]
        if k > j:
            value *= (j + 1) / s
        if j == 0:
            value += p.inputs.reals[i, 2]
            if p.inputs.ints[i, 3] >= 0:
                value -= memory[p.inputs.ints[i, 3], ORIGIN]
        memory[row, j] = value
    slots = p.laws.touch.shape[1]
    flanks = p.flanks.row.shape[0]
    row = 0
    at = 0
    for k in range(flanks + 1):  # the last ones: what follows when all pair forces are known
        contact = k < flanks and p.flanks.curves[k] < 0
        if contact:
            row = p.flanks.row[k]
            at = p.flanks.piece[k] + PER_FLANK
        settled = j > 0 or not contact
        for _ in range(NEWTON):  # for order 0 alone, whose forces then are those that make the gaps vanish
            if contact:
                for slot in range(slots):
                    own = row + SLOTS + PER_SLOT * slot
                    memory[own + GAP, j] = memory[row + DELTA, j]
                    memory[own + F, j] = memory[own + FULL, 0] - memory[own + TOUCHES, ORIGIN] if j == 0 else 0.0
                    if j > 0:
                        memory[own + FULL, j] = 0.0
            operate(j, p.operations, p.flanks.first[k], p.flanks.first[k + 1], memory, pieces)
            if contact and not (settled and j == 0):
                change = pair_forces(j, slots, memory, row, pieces, at)
                settled = settled or change <= CHANGED
                if j > 0:
                    break
            else:
                break
    for i in range(out.shape[0]):
        out[i] = 0.0
    for i in range(p.outputs.reals.shape[0]):
        d = p.outputs.ints[i, 0]
        row = p.outputs.ints[i, 1]
        out[d] += p.outputs.reals[i, 0] * (memory[row, j] if row >= 0 else u[d, j])


def step_begins(t: float, s: float, p: Program, memory: Array, pieces: IntArray) -> None:
    """Functions of time, and the numbers of the cells that the flanks are on, for a step."""
    time_series(p.times, t, s > 0.0, memory.shape[1], memory)
    for k in range(p.times.first.shape[0] - 1):
        scale = 1.0
        for i in range(memory.shape[1]):
            memory[k, i] *= scale
            scale *= s
    slots = p.laws.touch.shape[1]
    for k in range(p.flanks.row.shape[0]):
        row = p.flanks.row[k]
        at = p.flanks.piece[k]
        cell = pieces[at + 1]
        if p.flanks.curves[k] >= 0:
            first = p.curves.first[p.flanks.curves[k]]
            last = p.curves.first[p.flanks.curves[k] + 1] - 1
            cycle = p.curves.nodes[last] - p.curves.nodes[first]
            memory[row + CELL, ORIGIN] = p.curves.nodes[first + cell] + pieces[at] * cycle
            for a in range(4):
                memory[row + CELL, a] = p.curves.cubics[first + cell, a]
            continue
        law = p.flanks.laws[k]
        cycle = p.laws.nodes[law, p.laws.cells[law]] - p.laws.nodes[law, 0]
        memory[row + CELL, ORIGIN] = p.laws.nodes[law, cell] + pieces[at] * cycle
        couple = row + SLOTS + PER_SLOT * slots + NUMBERS
        for slot in range(slots):
            own = row + SLOTS + PER_SLOT * slot
            part = pieces[at + PER_FLANK + slot]
            memory[own + FULL, 0] = memory[row + BEFORE, slot] if part >= 0 else 0.0
            memory[own + TOUCHES, ORIGIN] = p.laws.forces[law, part] if part >= 0 else 0.0
            for a in range(4):
                memory[own + TOUCHES, a] = p.laws.touch[law, slot, cell, a]
            period = p.flanks.shifted[k + 1] - p.flanks.shifted[k]
            number = (slot - pieces[at]) % period  # of the pair
            memory[own + TOUCHES, 0] += p.flanks.shifts[p.flanks.shifted[k] + number]
            for power in range(5):
                for a in range(4):
                    if part >= 0:
                        memory[own + ENERGIES, 4 * power + a] = p.laws.energies[law, slot, cell, part, power, a]
            for up in range(slot + 1, slots):
                for a in range(4):
                    memory[couple, a] = p.laws.coupling[law, slot * slots + up, cell, a]
                couple += PER_COUPLE
            if p.flanks.slides[k] >= 0:
                lever = p.flanks.slides[k] + PER_SLIDE * slot + LEVER
                begin = p.laws.nodes[law, cell] + slot * cycle - p.flanks.slide[k, 1]
                memory[lever, 0] = p.flanks.slide[k, 0] * begin
                memory[lever, 1] = p.flanks.slide[k, 0]


def operate(j: int, operations: Operations, first: int, end: int, memory: Array, pieces: IntArray) -> None:
    """Order j of the rows that the operations change."""
    for i in range(first, end):
        one = operations.ints[i, 7]
        two = operations.ints[i, 8]
        if (one >= 0 and pieces[one] < 0) or (two >= 0 and pieces[two] < 0):
            continue
        row = operations.ints[i, 0]
        a = operations.ints[i, 1]
        b = operations.ints[i, 2]
        kind = operations.ints[i, 3]
        z = operations.ints[i, 4]
        value = 0.0
        if kind == SMOOTH:
            smoothed_sign(j, z, row, operations.ints[i, 5], memory, pieces)
            continue
        if kind > 0:
            n = operations.ints[i, 5]
            c = operations.ints[i, 6]
            if kind == 1:
                value = memory[n, c + 1] * memory[z, j] + memory[n, c + 2] * memory[z + 1, j]
                value += memory[n, c + 3] * memory[z + 2, j]
                if j == 0:
                    value += memory[n, c]
            else:
                value = 2.0 * memory[n, c + 2] * memory[z, j] + 3.0 * memory[n, c + 3] * memory[z + 1, j]
                if j == 0:
                    value += memory[n, c + 1]
            value *= operations.reals[i, 0]
        if a >= 0:
            for k in range(j + 1):  # Cauchy
                value += memory[a, k] * memory[b, j - k]
        memory[row, j] = operations.reals[i, 2] * memory[row, j] + operations.reals[i, 1] * value


def smoothed_sign(j: int, x: int, row: int, piece: int, memory: Array, pieces: IntArray) -> None:
    """Order j of s(x) in a row, of x2 and of s / x in the next ones; a range that is not known follows from x."""
    if j == 0 and pieces[piece] == UNKNOWN:
        pieces[piece] = 1 if memory[x, 0] > 1.0 else -1 if memory[x, 0] < -1.0 else 0
    if pieces[piece] != 0:
        memory[row, j] = float(pieces[piece]) if j == 0 else 0.0
        return
    square = 0.0
    for k in range(j + 1):
        square += memory[x, k] * memory[x, j - k]
    memory[row + 1, j] = square
    inner = -1.25 * square
    for k in range(j + 1):
        inner += 0.375 * memory[row + 1, k] * memory[row + 1, j - k]
    memory[row + 2, j] = inner + 1.875 if j == 0 else inner
    value = 0.0
    for k in range(j + 1):
        value += memory[x, k] * memory[row + 2, j - k]
    memory[row, j] = value


def pair_forces(j: int, slots: int, memory: Array, row: int, pieces: IntArray, at: int) -> float:
    """Order j of the pair forces from what their gaps lack, J f = gap; for j = 0 a step of Newton's method.

    Returns the largest change, relative to the largest force.
    """
    column = max(j, 1)  # column 0 is the state at which J is taken
    J = row + JACOBIAN
    couple = row + SLOTS + PER_SLOT * slots
    for low in range(slots):
        own = row + SLOTS + PER_SLOT * low
        bears = pieces[at + low] >= 0
        f = memory[own + F, 0]
        slope = memory[own + H1, 0] + f * (memory[own + H2, 0] + f * memory[own + H3, 0])
        memory[J, low * slots + low] = slope if bears else 1.0
        memory[own + F, column] = memory[own + GAP, j] if bears else 0.0
        for up in range(low + 1, slots):
            both = bears and pieces[at + up] >= 0
            memory[J, low * slots + up] = memory[couple, 0] if both else 0.0
            memory[J, up * slots + low] = memory[J, low * slots + up]
            couple += PER_COUPLE
    for a in range(slots):
        for b in range(a + 1, slots):
            factor = memory[J, b * slots + a] / memory[J, a * slots + a]
            for c in range(a, slots):
                memory[J, b * slots + c] -= factor * memory[J, a * slots + c]
            one = row + SLOTS + PER_SLOT * a + F
            memory[one + PER_SLOT * (b - a), column] -= factor * memory[one, column]
    change = 0.0
    largest = 1e-300
    for a in range(slots - 1, -1, -1):
        own = row + SLOTS + PER_SLOT * a
        for c in range(a + 1, slots):
            memory[own + F, column] -= memory[J, a * slots + c] * memory[own + PER_SLOT * (c - a) + F, column]
        memory[own + F, column] /= memory[J, a * slots + a]
        f = memory[own + F, column]
        memory[own + FULL, j] += f
        change = max(change, abs(f))
        largest = max(largest, abs(memory[own + FULL, 0]))
    if j == 0:
        return change / largest
    couple = row + SLOTS + PER_SLOT * slots
    for low in range(slots):  # what depends on the forces
        own = row + SLOTS + PER_SLOT * low
        f = memory[own + F, j]
        bend = f * memory[own + H3, 0]
        memory[own + H2, j] += bend
        memory[own + H1, j] += f * memory[own + H2, 0] + memory[own + F, 0] * bend
        for up in range(low + 1, slots):
            other = row + SLOTS + PER_SLOT * up
            memory[own + GAP, j] -= memory[couple, 0] * memory[other + F, j]
            memory[other + GAP, j] -= memory[couple, 0] * f
            couple += PER_COUPLE
    return 0.0


def train_begin(
    t: float, sign: float, motion: tuple[Array, Array], p: Program, forces: TrainForces, memory: Array, pieces: IntArray
) -> None:
    """Cells of all flanks at a start, at a node the one that lies ahead, and the pair forces there; not compiled.

    `motion` are values and rates along the directions of the forces.
    """
    u, du = motion
    angle, rate = float(forces.angle(t)), float(forces.angle(t, 1))
    slots = p.laws.touch.shape[1]
    flanks: tuple[CurveFlank | LawFlank, ...] = (*forces.curves, *forces.contacts)
    for k, flank in enumerate(flanks):
        at, row = p.flanks.piece[k], p.flanks.row[k]
        phase, approach = (float(x[0]) for x in flank.phase_and_approach(np.array([angle]), u[None]))
        speed = sign * flank.sense * (flank.ratio * rate + du[flank.turn])
        if isinstance(flank, CurveFlank):
            pieces[at : at + 2] = ahead_of(flank.curve.nodes, phase, speed)
            bears = approach > 0.0 or (approach == 0.0 and sign * du[flank.direction] > 0.0)
            pieces[at + 2] = 0 if bears or not flank.parts else -1
            continue
        turn, cell = ahead_of(flank.law.nodes, phase, speed)
        pieces[at : at + 3] = turn, cell, 0 if 1.0 + flank.damping * du[flank.direction] > 0.0 else -1
        force = np.zeros(slots)
        made = flank.law(np.array([phase]), np.array([approach]), flank.shifts_at(np.array([phase]))).pair_forces[0]
        shift = turn - int(flank.law.locate(np.array([phase]))[0][0])  # a node at which a cycle ends lies behind
        for slot in range(flank.law.slots):
            if 0 <= slot + shift < slots:
                force[slot + shift] = made[slot]
        part = np.minimum(np.searchsorted(flank.law.forces, force, side="right") - 1, len(flank.law.forces) - 2)
        pieces[at + PER_FLANK : at + PER_FLANK + slots] = np.where(force > 0.0, part, -1)
        if flank.sliding is not None:
            pieces[at + PER_FLANK + slots : at + PER_FLANK + 2 * slots] = UNKNOWN
        memory[row + BEFORE, :slots] = force


def ahead_of(nodes: Array, phase: float, speed: float) -> tuple[int, int]:
    """Cycle and cell that a phase is in, at a node those that lie ahead."""
    cells, period = len(nodes) - 1, nodes[-1] - nodes[0]
    turn = int(np.floor((phase - nodes[0]) / period))
    place = phase - turn * period
    cell = min(max(int(np.searchsorted(nodes, place, side="right")) - 1, 0), cells - 1)
    width = nodes[cell + 1] - nodes[cell]
    if speed > 0.0 and nodes[cell + 1] - place < SAME * width:
        cell += 1
    elif speed < 0.0 and place - nodes[cell] < SAME * width:
        cell -= 1
    return turn + cell // cells, cell % cells


def train_series(forces: TrainForces) -> SeriesLaw:
    """The series of a train's forces."""
    program, rows, pieces = train_program(forces)

    def begin(
        t: float, sign: float, u: Array, du: Array, memory: Array,
        numbers: IntArray,
    ) -> None:  # fmt: skip
        train_begin(t, sign, (u, du), program, forces, memory, numbers)

    constants: dict[str, float] = {"NEWTON": NEWTON, "CHANGED": CHANGED}
    for module in (tables, corners):
        found = {name: value for name, value in vars(module).items() if name.isupper()}
        constants |= {name: value for name, value in found.items() if isinstance(value, int | float)}
    own = (step_begins, operate, smoothed_sign, pair_forces, *corners.FUNCTIONS)
    return SeriesLaw(
        begin, train_order, train_corner, (*own, time_series), program, rows, pieces, constants,
    )  # fmt: skip
