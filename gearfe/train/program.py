r"""The forces of a train as a list of products of series: tables that `gearfe.train.series` runs through.

Rows of a memory hold series. Inputs are linear in the motion. Each operation then changes its row to

.. math:: \text{keep}\cdot\text{row} + \text{sign}\,\Big(\text{factor}\,\sum_a n_a z^a + A\,B\Big)

with a cubic of a phase z (or its slope) whose coefficients n stand in the row of its cell, and the product of two rows.
The forces of tooth pairs (mesh laws) are solved for between the operations `before` and `after`: from
:math:`t + \Lambda(z, f) + \sum C F = \delta`, in which their highest order is linear. Friction needs the
smoothed sign of a row (`gearfe.train.friction`). Outputs take rows to the directions of the forces.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..meshlaw.law import Laws, stacked_laws
from ..rigid.tables import Times, time_arrays
from ..stiffness.periodic import Curves, curve_arrays
from ..typing import Array, IntArray
from .forces import CurveFlank, LawFlank, MeshFlank, TrainForces

Row = tuple[tuple[int, ...], tuple[float, ...]]

#: Rows of a flank: phase from the cell's node with its square and cube, approach, numbers of the cell (four
#: coefficients, then the phase of its node); of one with a mesh law then 1 + chi delta', J, forces at the end of the
#: step before.
Z, Z2, Z3, DELTA, CELL, DAMPED, JACOBIAN, BEFORE, SLOTS = range(9)
#: Rows of a slot: f = F - F_0, F, gap of a pair that does not bear, Lambda's inner polynomials (Horner), coefficients
#: of t (then F_0), and of the energy.
F, FULL, GAP, H1, H2, H3, TOUCHES, ENERGIES, PER_SLOT = range(9)
#: Rows of a couple of slots: C, and its coefficients.
COUPLE, NUMBERS, PER_COUPLE = range(3)
#: Column of the phase of a cell's node, and of F_0 beside the coefficients of t.
ORIGIN = 4
#: Rows of a slot's friction: e of the pair, its coefficients, v/v0, its smoothed sign with what makes it, e times
#: that, normal force.
ARM, LEVER, SPEED, SIGN, SQUARE, INNER, TURNS, NORMAL, PER_SLIDE = range(9)
#: No polynomial, a cubic, its slope; or the smoothed sign of a row.
NOTHING, CUBIC, SLOPE, SMOOTH = range(4)
#: What a step may not pass: the cell of a phase, touch of a flank with a curve, pull of a damper, the cell of a pair,
#: the range of its sliding speed.
PHASE, TOUCH, PULL, PAIR, SLIDE = range(5)
#: Instead of the number of a piece: no condition.
ALWAYS = -1
#: Whole numbers of a flank: mesh cycle, cell, whether it bears (a curve) or damping acts (>= 0: it does); then the
#: cells of the slots, -1 for pairs that do not bear; with friction the ranges of v/v0: -1, 0 (within +-1), 1, or not
#: known.
PER_FLANK, UNKNOWN = 3, 2


class Inputs(NamedTuple):
    """Rows ``alpha psi + beta u`` of a direction, or the rates of both, plus a constant."""

    # (n, 4): row, direction, order of the derivative, row of the cell whose node the phase counts from or -1
    ints: IntArray
    reals: Array  # (n, 3): alpha, beta, constant


class Operations(NamedTuple):
    """See the module's docstring."""

    ints: IntArray  # (n, 9): row, A, B (-1: none), kind, row of z, row and column of the coefficients, two pieces >= 0
    reals: Array  # (n, 3): factor, sign, keep


class Outputs(NamedTuple):
    """Forces: a factor times a row, or (row -1) times the motion along the direction."""

    ints: IntArray  # (n, 2): direction, row
    reals: Array  # (n, 1)


class Flanks(NamedTuple):
    """All flanks, those with curves before those with mesh laws."""

    curves: IntArray  # (f,) number of the curve, -1 for one with a mesh law
    laws: IntArray  # (f,) number of the mesh law
    row: IntArray  # (f,) first row
    piece: IntArray  # (f,) first whole number
    first: IntArray  # (f + 2,) first operation before the solution of each flank, first and end of those after them
    slides: IntArray  # (f,) first row of friction, -1 without
    slide: Array  # (f, 2) r_b1 and psi_C of friction
    shifted: IntArray  # (f + 1,) first of the shifts of each flank
    shifts: Array  # of the tooth pairs (m), one flank after the other


class Program(NamedTuple):
    """The whole."""

    times: Times
    inputs: Inputs
    operations: Operations
    outputs: Outputs
    flanks: Flanks
    watches: IntArray  # (w, 4): what, flank, row, slot
    curves: Curves
    laws: Laws


@dataclass
class Tables:
    """A program in the making."""

    rows: int
    pieces: int = 0
    inputs: list[Row] = field(default_factory=list)
    before: list[Operation] = field(default_factory=list)
    after: list[Operation] = field(default_factory=list)
    outputs: list[Row] = field(default_factory=list)
    watches: list[tuple[int, ...]] = field(default_factory=list)

    def take(self, count: int = 1) -> int:
        """First of so many new rows."""
        self.rows += count
        return self.rows - count

    def read(
        self, row: int, direction: int, order: int, alpha: float, beta: float, constant: float = 0.0, cell: int = -1
    ) -> int:
        """The row as an input."""
        self.inputs.append(((row, direction, order, cell), (alpha, beta, constant)))
        return row

    def force(self, direction: int, row: int, factor: float) -> None:
        """An output."""
        self.outputs.append(((direction, row), (factor,)))


@dataclass(frozen=True)
class Operation:
    """An entry of `Operations`."""

    row: int
    A: int = -1
    B: int = -1
    kind: int = NOTHING
    z: int = 0
    cell: int = 0
    column: int = 0
    factor: float = 1.0
    sign: float = 1.0
    keep: float = 0.0
    needs: tuple[int, int] = (ALWAYS, ALWAYS)

    @property
    def numbers(self) -> Row:
        """Whole numbers and reals of the entry."""
        places = self.row, self.A, self.B, self.kind, self.z, self.cell, self.column
        return (*places, *self.needs), (self.factor, self.sign, self.keep)


def train_program(forces: TrainForces) -> tuple[Program, int, int]:
    """Program of a train's forces, the rows of its memory, and how many whole numbers it keeps."""
    made = Tables(rows=1 + len(forces.torques))
    for number, (direction, _) in enumerate(forces.torques, start=1):
        made.force(direction, number, 1.0)
    for gyro in forces.gyros:
        d = gyro.direction
        momentum = made.read(made.take(), d + 2, 1, gyro.polar * gyro.ratio, gyro.polar)
        for tilt, other, sign in ((d, d + 1, -1.0), (d + 1, d, 1.0)):
            rate, row = made.read(made.take(), other, 1, 0.0, 1.0), made.take()
            made.after.append(Operation(row, A=momentum, B=rate))
            made.force(tilt, row, sign)
    laws = {id(flank.law): flank.law for flank in forces.contacts}
    tables = stacked_laws(list(laws.values()))
    first, rows, pieces = [], [], []
    slides: list[int] = []
    flanks: tuple[MeshFlank, ...] = (*forces.curves, *forces.contacts)
    for number, flank in enumerate(flanks):
        first.append(len(made.before))
        rows.append(made.rows)
        pieces.append(made.pieces)
        slides.append(-1)
        if isinstance(flank, CurveFlank):
            _curve(made, number, flank)
        elif isinstance(flank, LawFlank):
            slides[-1] = _contact(made, number, flank, tables.touch.shape[1])
    first += [len(made.before), len(made.before) + len(made.after)]
    count, order = len(forces.curves), list(laws)
    numbers = [order.index(id(flank.law)) for flank in forces.contacts]
    program = Program(
        time_arrays([forces.angle, *(torque for _, torque in forces.torques)]),
        Inputs(*_two(made.inputs, 4, 3)),
        Operations(*_two([one.numbers for one in made.before + made.after], 9, 3)),
        Outputs(*_two(made.outputs, 2, 1)),
        Flanks(
            _ints([*range(count), *(-1 for _ in numbers)]),
            _ints([*(0 for _ in range(count)), *numbers]),
            _ints(rows),
            _ints(pieces),
            _ints(first),
            _ints(slides),
            np.array([_slide(flank) for flank in flanks]).reshape(-1, 2),
            _ints(np.cumsum([0, *(len(_shifts(flank)) for flank in flanks)])),
            np.concatenate([np.zeros(0), *(_shifts(flank) for flank in flanks)]),
        ),
        _ints(made.watches).reshape(-1, 4),
        curve_arrays([flank.curve for flank in forces.curves]),
        tables,
    )
    return program, made.rows, made.pieces


def _place(made: Tables, flank: MeshFlank, rows: int) -> int:
    """First row of a flank that takes so many; phase and approach are inputs, square and cube of the phase follow."""
    row = made.take(rows)
    made.read(row + Z, flank.turn, 0, flank.sense * flank.ratio, flank.sense, flank.phase, row + CELL)
    made.read(row + DELTA, flank.direction, 0, 0.0, 1.0, -flank.gap)
    made.before += [Operation(row + Z2, A=row + Z, B=row + Z), Operation(row + Z3, A=row + Z2, B=row + Z)]
    made.force(flank.direction, -1, flank.mean)
    return row


def _curve(made: Tables, number: int, flank: CurveFlank) -> None:
    row = _place(made, flank, CELL + 1)
    bears = (made.pieces + 2, ALWAYS)
    stiffness, force = made.take(), made.take()
    made.after.append(Operation(stiffness, kind=CUBIC, z=row, cell=row + CELL))
    made.after.append(Operation(force))
    made.after.append(Operation(force, A=stiffness, B=row + DELTA, needs=bears))
    made.force(flank.direction, force, -1.0)
    made.watches.append((PHASE, number, row + Z, 0))
    if flank.parts:
        made.watches.append((TOUCH, number, row + DELTA, 0))
    made.pieces += PER_FLANK


def _contact(made: Tables, number: int, flank: LawFlank, slots: int) -> int:
    """A flank with a mesh law; the first row of its friction, -1 without."""
    row = _place(made, flank, SLOTS + PER_SLOT * slots + PER_COUPLE * (slots * (slots - 1) // 2))
    made.read(row + DAMPED, flank.direction, 1, 0.0, flank.damping, 1.0)
    if flank.rayleigh > 0.0:
        made.force(flank.direction, made.read(made.take(), flank.direction, 1, 0.0, flank.rayleigh), 1.0)
    pull, moment = made.take(), made.take()
    made.after += [Operation(pull), Operation(moment)]
    cells = made.pieces + PER_FLANK
    for slot in range(slots):
        own, need = row + SLOTS + PER_SLOT * slot, (cells + slot, ALWAYS)
        _pair(made, row, own, need)
        slope = made.take()
        made.after.append(Operation(slope, kind=SLOPE, z=row, cell=own + TOUCHES, needs=need))
        made.after.append(Operation(moment, A=own + FULL, B=slope, sign=-1.0, keep=1.0, needs=need))
        below = -1
        for power in range(4, -1, -1):  # Horner over f of the energy's slope
            inner, last = made.take(), power == 0
            made.after.append(
                Operation(
                    moment if last else inner, A=below, B=own + F, kind=SLOPE, z=row, cell=own + ENERGIES,
                    column=4 * power, sign=-1.0 if last else 1.0, keep=float(last), needs=need,
                )
            )  # fmt: skip
            below = inner
        acts = (cells + slot, made.pieces + 2)
        made.after.append(Operation(pull, A=own + FULL, B=row + DAMPED, keep=1.0, needs=acts))
        made.watches.append((PAIR, number, own, slot))
    couple = row + SLOTS + PER_SLOT * slots
    for low in range(slots):
        for up in range(low + 1, slots):
            one_pair, other = (row + SLOTS + PER_SLOT * k for k in (low, up))
            made.before.append(Operation(couple, kind=CUBIC, z=row, cell=couple + NUMBERS))
            for here, there, k in ((one_pair, other, up), (other, one_pair, low)):
                need = (cells + k, ALWAYS)
                made.before.append(Operation(here + GAP, A=couple, B=there + FULL, sign=-1.0, keep=1.0, needs=need))
            slope, both, product = made.take(), (cells + low, cells + up), made.take()
            made.after.append(Operation(slope, kind=SLOPE, z=row, cell=couple + NUMBERS, needs=both))
            made.after.append(Operation(product, A=one_pair + FULL, B=other + FULL, needs=both))
            made.after.append(Operation(moment, A=slope, B=product, sign=-1.0, keep=1.0, needs=both))
            couple += PER_COUPLE
    made.force(flank.direction, pull, -1.0)
    made.force(flank.turn, moment, -flank.sense)
    if flank.damping > 0.0:
        made.watches.append((PULL, number, row + DAMPED, 0))
    slides = _friction(made, number, flank, row, slots)
    made.watches.append((PHASE, number, row + Z, 0))  # the last: pairs go on to other slots with it
    made.pieces += PER_FLANK + slots * (1 if flank.sliding is None else 2)
    return slides


def _slide(flank: MeshFlank) -> tuple[float, float]:
    sliding = flank.sliding if isinstance(flank, LawFlank) else None
    return (0.0, 0.0) if sliding is None else (sliding.radius, sliding.pitch_phase)


def _shifts(flank: MeshFlank) -> Array:
    return flank.shifts if isinstance(flank, LawFlank) else np.zeros(1)


def _friction(made: Tables, number: int, flank: LawFlank, row: int, slots: int) -> int:
    """Friction of the pairs of a flank: its first row, -1 without."""
    sliding = flank.sliding
    if sliding is None:
        return -1
    first, scale = made.take(PER_SLIDE * slots), 1.0 / sliding.speed
    spin = made.read(made.take(), sliding.spin, 1, sliding.ratio * scale, scale)
    across, turning = made.take(), made.take()
    made.after += [Operation(across), Operation(turning)]
    for slot in range(slots):
        own, pair = first + PER_SLIDE * slot, row + SLOTS + PER_SLOT * slot
        need = (made.pieces + PER_FLANK + slot, ALWAYS)
        acts = (need[0], made.pieces + 2)
        made.watches.append((SLIDE, number, own + SPEED, slot))
        made.read(own + SPEED, sliding.across, 1, 0.0, scale)
        made.after += [
            Operation(own + ARM, kind=CUBIC, z=row, cell=own + LEVER, needs=need),
            Operation(own + SPEED, A=own + ARM, B=spin, keep=1.0, needs=need),
            Operation(own + SIGN, kind=SMOOTH, z=own + SPEED, cell=need[0] + slots, needs=need),
            Operation(own + TURNS, A=own + ARM, B=own + SIGN, needs=need),
            Operation(own + NORMAL, A=pair + FULL, B=row + DAMPED, needs=need),
            Operation(across, A=own + NORMAL, B=own + SIGN, keep=1.0, needs=acts),
            Operation(turning, A=own + NORMAL, B=own + TURNS, keep=1.0, needs=acts),
        ]
    made.force(sliding.across, across, -sliding.coefficient)
    made.force(sliding.spin, turning, -sliding.coefficient)
    return first


def _pair(made: Tables, row: int, own: int, need: tuple[int, int]) -> None:
    """Gap of a slot less Lambda, by Horner over f: H3, H2, H1."""
    touch = Operation(own + GAP, kind=CUBIC, z=row, cell=own + TOUCHES, sign=-1.0, keep=1.0)
    made.before.append(touch)
    below = -1
    for power in range(4, 0, -1):
        last = power == 1
        made.before.append(
            Operation(
                own + (GAP if last else H1 + power - 2), kind=CUBIC, z=row, cell=own + ENERGIES, column=4 * power,
                A=below, B=own + F, factor=float(power), sign=-1.0 if last else 1.0, keep=float(last), needs=need,
            )
        )  # fmt: skip
        below = own + H1 + power - 2


def _two(rows: list[Row], ints: int, reals: int) -> tuple[IntArray, Array]:
    return _ints([row[0] for row in rows]).reshape(-1, ints), np.array([r[1] for r in rows], float).reshape(-1, reals)


def _ints(values: object) -> IntArray:
    return np.array(values, dtype=np.int64)
