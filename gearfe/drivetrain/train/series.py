r"""The forces of a train by the orders of their Taylor series: those of `drivetrain.train.forces`, as recurrences.

Over x, time :math:`t + s x`, all forces follow order by order from Cauchy's rule for products. Rows of a memory hold
series: first the functions of time, then those of the gyroscopic moments and of the flanks. The forces of tooth pairs
(mesh laws) are solved for from :math:`t + \Lambda(z, f) + \sum C F = \delta`, in which their highest order is linear.
Whole numbers tell on which cells of their laws the flanks are; a step ends where one leaves its cell
(`train.discontinuities`). The functions see each other and the constants by name, in plain Python and compiled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...base.typing import Array, IntArray
from ...gears.gearmesh.law import Laws
from ...gears.gearmesh.periodic import Curves
from ...gears.gearmesh.width_law import WidthLaws
from ...multibody.series.recurrences import time_series
from ...multibody.series.timefunctions import Times
from .friction import product, smoothed_sign

#: Rows of a flank: phase from the cell's node with its square and cube, approach, numbers of the cell (four
#: coefficients, then the phase of its node); of one with a curve then its stiffness, the numbers of its transmission
#: error, the slope of that, the rate of the phase, and along the face width the tilt, the lever with its numbers, those
#: of the moment, and the spring force; of one with a mesh law 1 + chi
#: delta', J, forces at the end of the step before, sliding for unit e.
Z, Z2, Z3, DELTA, CELL, STIFFNESS, ERROR, RISES, TURNING, TIPPED, OFFSET, OFFSETS, MOMENTS, PRESS, PER_CURVE = range(15)
DAMPED, JACOBIAN, BEFORE, SPIN, SLOTS = range(STIFFNESS, STIFFNESS + 5)
#: Rows of a flank with a law over the face width, after the cell of its phase: 1 + chi delta', tilt, x, then force and
#: the slopes of t with phase and tilt, Horner's sums over the tilt (of t, of its slopes) and over x, those of the
#: energy's polynomials over the tilt for each power of x, of their slopes with the tilt, and with the phase.
WIDE_DAMPED, WIDE_TILT, WIDE_X, WIDE_FORCE, RISE_Z, RISE_Y = range(STIFFNESS, STIFFNESS + 6)
WIDE_SUMS = RISE_Y + 1
WIDE_POWERS, WIDE_CUBIC = 6, 4
WIDE_X_SUMS = WIDE_SUMS + 3 * WIDE_CUBIC
WIDE_INNER = WIDE_X_SUMS + 3 * WIDE_POWERS
PER_WIDE = WIDE_INNER + 3 * WIDE_CUBIC * WIDE_POWERS
#: Rows of a slot: f = F - F_0, F, gap of a pair that does not bear, Lambda's inner polynomials (Horner), coefficients
#: of t (then F_0), and of the energy; t', inner polynomials of the energy's slope, normal force; of friction e with its
#: coefficients, v/v0, its smoothed sign with what makes it, force.
F, FULL, GAP, H1, H2, H3, TOUCHES, ENERGIES, RISE, E1, E2, E3, E4 = range(13)
NORMAL, ARM, LEVER, SPEED, SIGN, SQUARE, INNER, DRAG, PER_SLOT = range(E4 + 1, E4 + 10)
#: Rows of a couple of slots: C, its coefficients, C', product of both forces.
COUPLE, NUMBERS, COUPLE_SLOPE, BOTH, PER_COUPLE = range(5)
#: Rows of a gyroscopic moment: angular momentum, rates of both tilts; of a frame that turns beside these its speed,
#: its square, half the rate of the momentum, and both places.
MOMENTUM, TILT, OTHER, TURN, TURN2, EULER, FIRST, SECOND, PER_GYRO = range(9)
#: Rows of a turned spring: cosine less 1 and sine of the frame's rotation, motion of both directions that stand still
#: (of a damper its rate) and of both that turn.
COSINE, SINE, STILL1, STILL2, TURNS1, TURNS2, PER_TURNED = range(7)
#: Rows of a torque over speed: the speed from the origin of its piece, then Horner's sums of its polynomial.
PLACE, SUMS = range(2)
#: Column of the phase of a cell's node, and of F_0 beside the coefficients of t.
ORIGIN = 4
#: What a step may not pass: the cell of a phase, touch of a flank with a curve, pull of a damper, the cell of a pair,
#: the range of its sliding speed, the piece of a torque over speed, the cells of x and of the tilt of a law over the
#: face width.
PHASE, TOUCH, PULL, PAIR, SLIDE, SPEEDING, OVERLAP, TILTED = range(8)
#: Whole numbers of a flank: mesh cycle, cell, whether it bears (a curve) or damping acts (>= 0: it does); then the
#: cells of the slots, -1 for pairs that do not bear; then the ranges of
#: v/v0, see `gearfe.drivetrain.train.friction.smoothed_sign`.
PER_FLANK = 3
#: And of a flank with a law over the face width: the cell of x, -1 apart, and that of the tilt.
PER_WIDE_FLANK = PER_FLANK + 2
#: Most Newton steps for order 0 of the pair forces, and their relative change in the last one.
NEWTON, CHANGED = 50, 1e-9


class Gyros(NamedTuple):
    """Gyroscopic moments, see `gearfe.drivetrain.train.forces.Gyro`."""

    direction: IntArray
    spin: IntArray
    ratio: Array
    polar: Array
    stiffening: Array
    euler: Array
    offset: Array
    circulating: Array


class Turneds(NamedTuple):
    """Turned springs and dampers, see `gearfe.drivetrain.train.forces.Turned`."""

    still: IntArray
    turning: IntArray
    ratio: Array
    of_rates: IntArray
    row: IntArray  # (n,) first row


class Flanks(NamedTuple):
    """Flanks, see `gearfe.drivetrain.train.forces`: `damping` is chi (s/m) of a law and c (N s/m) of a curve."""

    direction: IntArray
    turn: IntArray
    ratio: Array
    sense: Array
    phase: Array
    mean: Array
    gap: Array
    damping: Array
    mean_damping: Array
    always: Array
    tilt: IntArray
    against: Array


class Slides(NamedTuple):
    """Friction of each flank, see `drivetrain.train.friction.Sliding`; the coefficient is 0 where there is none."""

    coefficient: Array
    speed: Array
    across: IntArray
    spin: IntArray
    ratio: Array
    radius: Array
    pitch_phase: Array


class Places(NamedTuple):
    """Which tables and rows belong to each flank."""

    curve: IntArray  # (f,) number of the curve, -1 for one with a mesh law, -2 for one over the face width
    law: IntArray  # (f,) number of the mesh law, or of the law over the face width
    row: IntArray  # (f,) first row
    piece: IntArray  # (f,) first whole number
    shifted: IntArray  # (f + 1,) first of the shifts of each flank
    shifts: Array  # of the tooth pairs (m), one flank after the other


class Speeds(NamedTuple):
    """Torques over speed, see `gearfe.drivetrain.train.forces.SpeedTorque`."""

    direction: IntArray  # (n,)
    ratio: Array  # (n,)
    damping: Array  # (n,)
    first: IntArray  # (n + 1,) first piece of each
    start: Array  # (pieces,) speed at which a piece begins
    origin: Array  # (pieces,)
    factor: Array  # (pieces, width) lowest power first
    slack: Array  # (n,) speed that is round-off
    row: IntArray  # (n,) first row
    piece: IntArray  # (n,) whole number: the piece


class Program(NamedTuple):
    """The whole."""

    times: Times  # psi and the torques
    torques: IntArray  # directions
    gyros: Gyros
    turned: Turneds
    flanks: Flanks
    slides: Slides
    places: Places
    watches: IntArray  # (w, 4): what, flank, row, slot
    curves: Curves
    errors: Array  # (all nodes, 4) transmission errors over the phase, on the nodes of the curves
    levers: Array  # (all nodes, 4) places along the face width, alike
    moments: Array  # (all nodes, 4) moments along the face width, alike
    laws: Laws
    wide: WidthLaws
    speeds: Speeds


def train_order(j: int, t: float, s: float, u: Array, p: Program, memory: Array, pieces: IntArray, out: Array) -> None:
    """Write order j of the train's forces over x, at time t + s x; see the module's docstring.

    Parameters
    ----------
    j : int
        Order; all lower ones have been computed, 0 starts the step.
    t : float
        Time at the start of the step (s).
    s : float
        Trial step (s), negative backwards in time.
    u : ndarray, shape (directions, orders)
        Series of the motion along the directions, known up to order j + 1.
    p : Program
        Tables of the train's forces.
    memory : ndarray, shape (rows, orders)
        Series of the step; order j is written.
    pieces : ndarray of int, shape (whole numbers,)
        Cells that the flanks are on.
    out : ndarray, shape (directions,)
        Order j of the forces (N, N m).
    """
    if j == 0:
        _step_begins(t, s, p, memory, pieces)
    rate = (j + 1) / s
    for i in range(out.shape[0]):
        out[i] = 0.0
    for i in range(p.torques.shape[0]):
        out[p.torques[i]] += memory[1 + i, j]
    for i in range(p.gyros.polar.shape[0]):
        d = p.gyros.direction[i]
        row = 1 + p.torques.shape[0] + PER_GYRO * i
        if p.gyros.polar[i] != 0.0:
            turned = p.gyros.ratio[i] * memory[0, j + 1] + u[p.gyros.spin[i], j + 1]
            memory[row + MOMENTUM, j] = p.gyros.polar[i] * rate * turned
            memory[row + TILT, j] = rate * u[d, j + 1]
            memory[row + OTHER, j] = rate * u[d + 1, j + 1]
            out[d] -= product(j, row + MOMENTUM, row + OTHER, memory)
            out[d + 1] += product(j, row + MOMENTUM, row + TILT, memory)
        if p.gyros.stiffening[i] != 0.0 or p.gyros.euler[i] != 0.0 or p.gyros.circulating[i] != 0.0:
            memory[row + FIRST, j] = u[d, j]
            memory[row + SECOND, j] = u[d + 1, j]
            if j == 0:
                memory[row + FIRST, 0] += p.gyros.offset[i]
            memory[row + TURN, j] = rate * memory[0, j + 1]
        if p.gyros.circulating[i] != 0.0:
            out[d] += p.gyros.circulating[i] * product(j, row + TURN, row + SECOND, memory)
            out[d + 1] -= p.gyros.circulating[i] * product(j, row + TURN, row + FIRST, memory)
        if p.gyros.stiffening[i] != 0.0:
            memory[row + TURN2, j] = product(j, row + TURN, row + TURN, memory)
            out[d] += p.gyros.stiffening[i] * product(j, row + TURN2, row + FIRST, memory)
            out[d + 1] += p.gyros.stiffening[i] * product(j, row + TURN2, row + SECOND, memory)
        if p.gyros.euler[i] != 0.0:
            if j + 2 < memory.shape[1]:
                twice = (j + 2) * (j + 1) / (s * s) * memory[0, j + 2]
                memory[row + EULER, j] = 0.5 * p.gyros.euler[i] * p.gyros.polar[i] * p.gyros.ratio[i] * twice
            else:
                memory[row + EULER, j] = 0.0
            out[d] -= product(j, row + EULER, row + SECOND, memory)
            out[d + 1] += product(j, row + EULER, row + FIRST, memory)
    for k in range(p.turned.row.shape[0]):
        _turned(j, k, rate, u, p, memory, out)
    for k in range(p.speeds.row.shape[0]):
        _over_speed(j, k, rate, u, p, memory, pieces, out)
    for k in range(p.places.row.shape[0]):
        row = p.places.row[k]
        d = p.flanks.direction[k]
        memory[row + Z, j] = p.flanks.sense[k] * (p.flanks.ratio[k] * memory[0, j] + u[p.flanks.turn[k], j])
        memory[row + DELTA, j] = u[d, j]
        if j == 0:
            memory[row + Z, 0] += p.flanks.phase[k] - memory[row + CELL, ORIGIN]
            memory[row + DELTA, 0] -= p.flanks.gap[k]
        memory[row + Z2, j] = product(j, row + Z, row + Z, memory)
        memory[row + Z3, j] = product(j, row + Z2, row + Z, memory)
        out[d] += p.flanks.mean[k] * u[d, j]
        out[d] += p.flanks.mean_damping[k] * rate * u[d, j + 1]
        if p.places.curve[k] == -1:
            _contact(j, k, rate, u, p, memory, pieces, out)
        elif p.places.curve[k] == -2:
            _over_width(j, k, rate, u, p, memory, pieces, out)
        else:
            memory[row + STIFFNESS, j] = _cubic(j, row, row + CELL, 0, memory)
            memory[row + DELTA, j] -= _cubic(j, row, row + ERROR, 0, memory)
            tilt = p.flanks.tilt[k]
            if tilt >= 0:
                memory[row + TIPPED, j] = u[tilt, j]
                memory[row + OFFSET, j] = _cubic(j, row, row + OFFSETS, 0, memory)
                memory[row + DELTA, j] += product(j, row + OFFSET, row + TIPPED, memory)
                out[tilt] -= _cubic(j, row, row + MOMENTS, 0, memory)
            memory[row + RISES, j] = _cubic_slope(j, row, row + ERROR, 0, memory)
            turned = p.flanks.ratio[k] * memory[0, j + 1] + u[p.flanks.turn[k], j + 1]
            memory[row + TURNING, j] = p.flanks.sense[k] * rate * turned
            late = product(j, row + RISES, row + TURNING, memory)  # rate of the transmission error
            out[d] += p.flanks.always[k] * late
            if pieces[p.places.piece[k] + 2] >= 0:
                memory[row + PRESS, j] = product(j, row + STIFFNESS, row + DELTA, memory)
                out[d] -= memory[row + PRESS, j]
                if tilt >= 0:
                    out[tilt] -= product(j, row + OFFSET, row + PRESS, memory)
                out[d] -= p.flanks.damping[k] * (rate * u[d, j + 1] - late)


def _turned(j: int, k: int, rate: float, u: Array, p: Program, memory: Array, out: Array) -> None:
    """Add order j of the forces of the turned spring or damper k; on the bore a damper has the rate of (R - 1) w."""
    row = p.turned.row[k]
    b = p.turned.still[k]
    w = p.turned.turning[k]
    order = j
    scale = 1.0
    if p.turned.of_rates[k] != 0:
        order = j + 1
        scale = rate
    for i in range(2):
        memory[row + TURNS1 + i, j] = u[w + i, j]
        memory[row + TURNS1 + i, order] = u[w + i, order]
        memory[row + STILL1 + i, j] = scale * u[b + i, order]
    first = product(order, row + COSINE, row + TURNS1, memory) - product(order, row + SINE, row + TURNS2, memory)
    second = product(order, row + SINE, row + TURNS1, memory) + product(order, row + COSINE, row + TURNS2, memory)
    out[b] += scale * first
    out[b + 1] += scale * second
    out[w] += product(j, row + COSINE, row + STILL1, memory) + product(j, row + SINE, row + STILL2, memory)
    out[w + 1] += product(j, row + COSINE, row + STILL2, memory) - product(j, row + SINE, row + STILL1, memory)


def _rotation_begins(k: int, p: Program, memory: Array) -> None:
    """Write all orders of cosine less 1 and sine of the rotation of the frame of turned spring k, from that of psi.

    With c = cos z and s = sin z: j c_j is less the sum of i z_i s_(j-i), and j s_j that of i z_i c_(j-i).
    """
    row = p.turned.row[k]
    ratio = p.turned.ratio[k]
    memory[row + COSINE, 0] = math.cos(ratio * memory[0, 0])
    memory[row + SINE, 0] = math.sin(ratio * memory[0, 0])
    for j in range(1, memory.shape[1]):
        cosine = 0.0
        sine = 0.0
        for i in range(1, j + 1):
            part = i * ratio * memory[0, i] / j
            cosine -= part * memory[row + SINE, j - i]
            sine += part * memory[row + COSINE, j - i]
        memory[row + COSINE, j] = cosine
        memory[row + SINE, j] = sine
    memory[row + COSINE, 0] -= 1.0


def _over_speed(
    j: int, k: int, rate: float, u: Array, p: Program, memory: Array, pieces: IntArray, out: Array
) -> None:  # fmt: skip
    """Add order j of the torque k over speed: the polynomial of its piece, by Horner's rule."""
    d = p.speeds.direction[k]
    row = p.speeds.row[k]
    piece = p.speeds.first[k] + pieces[p.speeds.piece[k]]
    width = p.speeds.factor.shape[1]
    memory[row + PLACE, j] = rate * (p.speeds.ratio[k] * memory[0, j + 1] + u[d, j + 1])
    if j == 0:
        memory[row + PLACE, 0] -= p.speeds.origin[piece]
    value = p.speeds.factor[piece, width - 1] if j == 0 else 0.0
    for power in range(width - 2, -1, -1):
        memory[row + SUMS + power, j] = value
        value = product(j, row + SUMS + power, row + PLACE, memory)
        if j == 0:
            value += p.speeds.factor[piece, power]
    out[d] += value + p.speeds.damping[k] * rate * u[d, j + 1]


def _cubic(j: int, z: int, numbers: int, column: int, memory: Array) -> float:
    """Return order j of a cubic of the phase in row z; its square and cube are in the next rows."""
    value = memory[numbers, column + 1] * memory[z, j] + memory[numbers, column + 2] * memory[z + 1, j]
    value += memory[numbers, column + 3] * memory[z + 2, j]
    return value + memory[numbers, column] if j == 0 else value


def _cubic_slope(j: int, z: int, numbers: int, column: int, memory: Array) -> float:
    """Return order j of the slope of a cubic of the phase in row z."""
    value = 2.0 * memory[numbers, column + 2] * memory[z, j] + 3.0 * memory[numbers, column + 3] * memory[z + 1, j]
    return value + memory[numbers, column + 1] if j == 0 else value


def _contact(
    j: int, k: int, rate: float, u: Array, p: Program, memory: Array, pieces: IntArray, out: Array
) -> None:  # fmt: skip
    """Add order j of the forces of flank k with a mesh law, after solving for its pair forces."""
    slots = p.laws.touch.shape[1]
    row = p.places.row[k]
    at = p.places.piece[k] + PER_FLANK
    d = p.flanks.direction[k]
    turn = p.flanks.turn[k]
    memory[row + DAMPED, j] = p.flanks.damping[k] * rate * u[d, j + 1]
    if j == 0:
        memory[row + DAMPED, 0] += 1.0
    settled = False
    for _ in range(NEWTON):  # for order 0 alone, whose forces then are those that make the gaps vanish
        _gaps(j, slots, memory, row, pieces, at)
        if settled:
            break
        change = _pair_forces(j, slots, memory, row, pieces, at)
        if j > 0:
            break
        settled = change <= CHANGED
    moment = 0.0
    couple = row + SLOTS + PER_SLOT * slots
    for slot in range(slots):
        pair = row + SLOTS + PER_SLOT * slot
        loaded = pieces[at + slot] >= 0
        if loaded:
            memory[pair + RISE, j] = _cubic_slope(j, row, pair + TOUCHES, 0, memory)
            memory[pair + E4, j] = _cubic_slope(j, row, pair + ENERGIES, 16, memory)
            moment += product(j, pair + FULL, pair + RISE, memory)
            for power in range(3, -1, -1):  # Horner over f of the energy's slope
                slope = _cubic_slope(j, row, pair + ENERGIES, 4 * power, memory)
                slope += product(j, pair + E1 + power, pair + F, memory)
                if power > 0:
                    memory[pair + E1 + power - 1, j] = slope
                else:
                    moment += slope
            memory[pair + NORMAL, j] = product(j, pair + FULL, row + DAMPED, memory)
            if pieces[at - 1] >= 0:
                out[d] -= memory[pair + NORMAL, j]
        for up in range(slot + 1, slots):
            if loaded and pieces[at + up] >= 0:
                other = row + SLOTS + PER_SLOT * up
                memory[couple + COUPLE_SLOPE, j] = _cubic_slope(j, row, couple + NUMBERS, 0, memory)
                memory[couple + BOTH, j] = product(j, pair + FULL, other + FULL, memory)
                moment += product(j, couple + COUPLE_SLOPE, couple + BOTH, memory)
            couple += PER_COUPLE
    out[turn] += p.flanks.sense[k] * moment
    if p.slides.coefficient[k] > 0.0:
        _friction(j, k, rate, u, p, memory, pieces, out)


def _over_width(
    j: int, k: int, rate: float, u: Array, p: Program, memory: Array, pieces: IntArray, out: Array
) -> None:  # fmt: skip
    """Add order j of the forces of flank k with a law over the face width: polynomials of phase, x and tilt."""
    row = p.places.row[k]
    at = p.places.piece[k]
    law = p.places.law[k]
    d = p.flanks.direction[k]
    tilt = p.flanks.tilt[k]
    cell = pieces[at + 1]
    part = pieces[at + PER_FLANK]
    side = pieces[at + PER_FLANK + 1]
    if tilt >= 0:
        out[tilt] += p.flanks.against[k] * u[tilt, j]
        memory[row + WIDE_TILT, j] = u[tilt, j]
    else:
        memory[row + WIDE_TILT, j] = 0.0
    if j == 0:
        memory[row + WIDE_TILT, 0] -= p.wide.tilts[law, max(side - 1, 0)]
    memory[row + WIDE_DAMPED, j] = p.flanks.damping[k] * rate * u[d, j + 1]
    if j == 0:
        memory[row + WIDE_DAMPED, 0] += 1.0
    touch = p.wide.touch[law, cell, side]
    sums = row + WIDE_SUMS
    memory[row + WIDE_X, j] = memory[row + DELTA, j] - _bicubic(j, row, touch, sums, memory)
    if j == 0 and part >= 0:
        memory[row + WIDE_X, 0] -= p.wide.overlaps[law, part]
    if part < 0:
        return
    memory[row + RISE_Z, j] = _bicubic_by_phase(j, row, touch, sums + WIDE_CUBIC, memory)
    memory[row + RISE_Y, j] = _bicubic_by_tilt(j, row, touch, sums + 2 * WIDE_CUBIC, memory)
    force = 0.0
    turning = 0.0
    tilting = 0.0
    for power in range(WIDE_POWERS - 1, -1, -1):  # Horner over x
        inner = row + WIDE_INNER + 3 * WIDE_CUBIC * power
        over = row + WIDE_X_SUMS + power
        numbers = p.wide.energies[law, cell, part, side * WIDE_POWERS + power]
        if power > 0:
            force += power * _bicubic(j, row, numbers, inner, memory)
            if power > 1:
                memory[over, j] = force
                force = product(j, over, row + WIDE_X, memory)
        turning += _bicubic_by_phase(j, row, numbers, inner + WIDE_CUBIC, memory)
        tilting += _bicubic_by_tilt(j, row, numbers, inner + 2 * WIDE_CUBIC, memory)
        if power > 0:
            memory[over + WIDE_POWERS, j] = turning
            turning = product(j, over + WIDE_POWERS, row + WIDE_X, memory)
            memory[over + 2 * WIDE_POWERS, j] = tilting
            tilting = product(j, over + 2 * WIDE_POWERS, row + WIDE_X, memory)
    memory[row + WIDE_FORCE, j] = force
    turning -= product(j, row + WIDE_FORCE, row + RISE_Z, memory)
    tilting -= product(j, row + WIDE_FORCE, row + RISE_Y, memory)
    if pieces[at + 2] >= 0:
        out[d] -= product(j, row + WIDE_FORCE, row + WIDE_DAMPED, memory)
    out[p.flanks.turn[k]] -= p.flanks.sense[k] * turning
    if tilt >= 0:
        out[tilt] -= tilting


def _over_phase(j: int, row: int, numbers: Array, memory: Array) -> float:
    """Return order j of a cubic of the phase of a flank."""
    value = numbers[1] * memory[row + Z, j] + numbers[2] * memory[row + Z2, j] + numbers[3] * memory[row + Z3, j]
    return value + numbers[0] if j == 0 else value


def _slope_over_phase(j: int, row: int, numbers: Array, memory: Array) -> float:
    """Return order j of the slope of a cubic of the phase of a flank."""
    value = 2.0 * numbers[2] * memory[row + Z, j] + 3.0 * numbers[3] * memory[row + Z2, j]
    return value + numbers[1] if j == 0 else value


def _bicubic(j: int, row: int, numbers: Array, sums: int, memory: Array) -> float:
    """Return order j of a polynomial of tilt and phase of a flank, by Horner's rule over the tilt."""
    value = _over_phase(j, row, numbers[3], memory)
    for power in range(2, -1, -1):
        memory[sums + power, j] = value
        value = product(j, sums + power, row + WIDE_TILT, memory) + _over_phase(j, row, numbers[power], memory)
    return value


def _bicubic_by_phase(j: int, row: int, numbers: Array, sums: int, memory: Array) -> float:
    """Return order j of the derivative of `_bicubic` with the phase."""
    value = _slope_over_phase(j, row, numbers[3], memory)
    for power in range(2, -1, -1):
        memory[sums + power, j] = value
        value = product(j, sums + power, row + WIDE_TILT, memory) + _slope_over_phase(j, row, numbers[power], memory)
    return value


def _bicubic_by_tilt(j: int, row: int, numbers: Array, sums: int, memory: Array) -> float:
    """Return order j of the derivative of `_bicubic` with the tilt."""
    value = 3.0 * _over_phase(j, row, numbers[3], memory)
    for power in range(2, 0, -1):
        memory[sums + power, j] = value
        value = product(j, sums + power, row + WIDE_TILT, memory)
        value += power * _over_phase(j, row, numbers[power], memory)
    return value


def _gaps(j: int, slots: int, memory: Array, row: int, pieces: IntArray, at: int) -> None:
    """Write order j of the residual of each pair's equation, with the pair forces known so far."""
    for slot in range(slots):
        pair = row + SLOTS + PER_SLOT * slot
        if j == 0:
            memory[pair + F, 0] = memory[pair + FULL, 0] - memory[pair + TOUCHES, ORIGIN]
        else:
            memory[pair + F, j] = 0.0
            memory[pair + FULL, j] = 0.0
        gap = memory[row + DELTA, j] - _cubic(j, row, pair + TOUCHES, 0, memory)
        if pieces[at + slot] >= 0:  # less Lambda, by Horner over f
            memory[pair + H3, j] = 4.0 * _cubic(j, row, pair + ENERGIES, 16, memory)
            for power in range(3, 0, -1):
                value = power * _cubic(j, row, pair + ENERGIES, 4 * power, memory)
                value += product(j, pair + H1 + power - 1, pair + F, memory)
                if power > 1:
                    memory[pair + H1 + power - 2, j] = value
                else:
                    gap -= value
        memory[pair + GAP, j] = gap
    couple = row + SLOTS + PER_SLOT * slots
    for low in range(slots):
        pair = row + SLOTS + PER_SLOT * low
        for up in range(low + 1, slots):
            other = row + SLOTS + PER_SLOT * up
            memory[couple, j] = _cubic(j, row, couple + NUMBERS, 0, memory)
            if pieces[at + up] >= 0:
                memory[pair + GAP, j] -= product(j, couple, other + FULL, memory)
            if pieces[at + low] >= 0:
                memory[other + GAP, j] -= product(j, couple, pair + FULL, memory)
            couple += PER_COUPLE


def _friction(
    j: int, k: int, rate: float, u: Array, p: Program, memory: Array, pieces: IntArray, out: Array
) -> None:  # fmt: skip
    """Add order j of the friction of flank k, whose pair forces are known."""
    slots = p.laws.touch.shape[1]
    row = p.places.row[k]
    at = p.places.piece[k] + PER_FLANK
    across = p.slides.across[k]
    spin = p.slides.spin[k]
    scale = rate / p.slides.speed[k]
    memory[row + SPIN, j] = scale * (p.slides.ratio[k] * memory[0, j + 1] + u[spin, j + 1])
    for slot in range(slots):
        pair = row + SLOTS + PER_SLOT * slot
        memory[pair + SPEED, j] = scale * u[across, j + 1]
        if pieces[at + slot] < 0:
            continue
        memory[pair + ARM, j] = _cubic(j, row, pair + LEVER, 0, memory)
        memory[pair + SPEED, j] += product(j, pair + ARM, row + SPIN, memory)
        smoothed_sign(j, pair + SPEED, pair + SIGN, at + slots + slot, memory, pieces)
        if pieces[at - 1] >= 0:
            memory[pair + DRAG, j] = p.slides.coefficient[k] * product(j, pair + NORMAL, pair + SIGN, memory)
            out[across] -= memory[pair + DRAG, j]
            out[spin] -= product(j, pair + DRAG, pair + ARM, memory)


def _step_begins(t: float, s: float, p: Program, memory: Array, pieces: IntArray) -> None:
    """Write the functions of time, and the coefficients of the cells that the flanks are on, for a step."""
    time_series(p.times, t, s > 0.0, memory.shape[1], memory)
    for k in range(p.times.first.shape[0] - 1):
        scale = 1.0
        for i in range(memory.shape[1]):
            memory[k, i] *= scale
            scale *= s
    for k in range(p.turned.row.shape[0]):
        _rotation_begins(k, p, memory)
    slots = p.laws.touch.shape[1]
    for k in range(p.places.row.shape[0]):
        row = p.places.row[k]
        at = p.places.piece[k]
        cell = pieces[at + 1]
        if p.places.curve[k] >= 0:
            first = p.curves.first[p.places.curve[k]]
            last = p.curves.first[p.places.curve[k] + 1] - 1
            cycle = p.curves.nodes[last] - p.curves.nodes[first]
            memory[row + CELL, ORIGIN] = p.curves.nodes[first + cell] + pieces[at] * cycle
            for a in range(4):
                memory[row + CELL, a] = p.curves.cubics[first + cell, a]
                memory[row + ERROR, a] = p.errors[first + cell, a]
                memory[row + OFFSETS, a] = p.levers[first + cell, a]
                memory[row + MOMENTS, a] = p.moments[first + cell, a]
            continue
        law = p.places.law[k]
        if p.places.curve[k] == -2:
            cycle = p.wide.nodes[law, p.wide.cells[law]] - p.wide.nodes[law, 0]
            memory[row + CELL, ORIGIN] = p.wide.nodes[law, cell] + pieces[at] * cycle
            continue
        cycle = p.laws.nodes[law, p.laws.cells[law]] - p.laws.nodes[law, 0]
        memory[row + CELL, ORIGIN] = p.laws.nodes[law, cell] + pieces[at] * cycle
        couple = row + SLOTS + PER_SLOT * slots + NUMBERS
        for slot in range(slots):
            pair = row + SLOTS + PER_SLOT * slot
            part = pieces[at + PER_FLANK + slot]
            memory[pair + FULL, 0] = memory[row + BEFORE, slot] if part >= 0 else 0.0
            memory[pair + TOUCHES, ORIGIN] = p.laws.forces[law, part] if part >= 0 else 0.0
            for a in range(4):
                memory[pair + TOUCHES, a] = p.laws.touch[law, slot, cell, a]
            period = p.places.shifted[k + 1] - p.places.shifted[k]
            number = (slot - pieces[at]) % period  # of the pair
            memory[pair + TOUCHES, 0] += p.places.shifts[p.places.shifted[k] + number]
            for power in range(5):
                for a in range(4):
                    if part >= 0:
                        memory[pair + ENERGIES, 4 * power + a] = p.laws.energies[law, slot, cell, part, power, a]
            for up in range(slot + 1, slots):
                for a in range(4):
                    memory[couple, a] = p.laws.coupling[law, slot * slots + up, cell, a]
                couple += PER_COUPLE
            begin = p.laws.nodes[law, cell] + slot * cycle - p.slides.pitch_phase[k]
            memory[pair + LEVER, 0] = p.slides.radius[k] * begin
            memory[pair + LEVER, 1] = p.slides.radius[k]


def _pair_forces(j: int, slots: int, memory: Array, row: int, pieces: IntArray, at: int) -> float:
    """Solve J f = residual for order j of the pair forces.

    For j = 0 this is a step of Newton's method. Returns the largest change, relative to the largest force.
    """
    column = max(j, 1)  # column 0 is the state at which J is taken
    J = row + JACOBIAN
    couple = row + SLOTS + PER_SLOT * slots
    for low in range(slots):
        pair = row + SLOTS + PER_SLOT * low
        loaded = pieces[at + low] >= 0
        f = memory[pair + F, 0]
        slope = memory[pair + H1, 0] + f * (memory[pair + H2, 0] + f * memory[pair + H3, 0])
        memory[J, low * slots + low] = slope if loaded else 1.0
        memory[pair + F, column] = memory[pair + GAP, j] if loaded else 0.0
        for up in range(low + 1, slots):
            both = loaded and pieces[at + up] >= 0
            memory[J, low * slots + up] = memory[couple, 0] if both else 0.0
            memory[J, up * slots + low] = memory[J, low * slots + up]
            couple += PER_COUPLE
    for a in range(slots):
        for b in range(a + 1, slots):
            factor = memory[J, b * slots + a] / memory[J, a * slots + a]
            for c in range(a, slots):
                memory[J, b * slots + c] -= factor * memory[J, a * slots + c]
            force = row + SLOTS + PER_SLOT * a + F
            memory[force + PER_SLOT * (b - a), column] -= factor * memory[force, column]
    change = 0.0
    largest = 1e-300
    for a in range(slots - 1, -1, -1):
        pair = row + SLOTS + PER_SLOT * a
        for c in range(a + 1, slots):
            memory[pair + F, column] -= memory[J, a * slots + c] * memory[pair + PER_SLOT * (c - a) + F, column]
        memory[pair + F, column] /= memory[J, a * slots + a]
        f = memory[pair + F, column]
        memory[pair + FULL, j] += f
        change = max(change, abs(f))
        largest = max(largest, abs(memory[pair + FULL, 0]))
    if j == 0:
        return change / largest
    couple = row + SLOTS + PER_SLOT * slots
    for low in range(slots):  # what depends on the forces
        pair = row + SLOTS + PER_SLOT * low
        f = memory[pair + F, j]
        bend = f * memory[pair + H3, 0]
        memory[pair + H2, j] += bend
        memory[pair + H1, j] += f * memory[pair + H2, 0] + memory[pair + F, 0] * bend
        for up in range(low + 1, slots):
            other = row + SLOTS + PER_SLOT * up
            memory[pair + GAP, j] -= memory[couple, 0] * memory[other + F, j]
            memory[other + GAP, j] -= memory[couple, 0] * f
            couple += PER_COUPLE
    return 0.0


FUNCTIONS = (
    _step_begins, product, _turned, _rotation_begins, _over_speed, _cubic, _cubic_slope, _contact, _gaps, _friction,
    smoothed_sign, _pair_forces, time_series, _over_width, _over_phase, _slope_over_phase, _bicubic, _bicubic_by_phase,
    _bicubic_by_tilt,
)  # fmt: skip
