"""Find where a step of a train's series ends: phases and pair forces that leave their cells, flanks that meet or part,
flanks that slide fast enough for full friction, and torques over speed that enter another piece.

The functions see each other and their constants by name, in plain Python and compiled.
"""

from __future__ import annotations

from ...base.typing import Array, IntArray
from .friction import UNKNOWN
from .series import BEFORE, GAP, OVERLAP, PAIR, PER_FLANK, PHASE, SLIDE, SPEEDING, TILTED, TOUCH, F, Program

#: Part of a cell's width by which a discontinuity is passed in its prediction, so that the step contains it.
PAST = 2e-3
#: Part of a cell's width that counts as none, and approach (m) whose part `SAME` counts as none.
SAME, SMALL = 1e-9, 1e-7
#: Parts of a step in which a series is looked at for leaving its cell.
SAMPLES = 6


def train_discontinuity(last: int, limit: float, p: Program, memory: Array, pieces: IntArray, ahead: bool) -> float:
    """Find the first x at which a watched series leaves its cell.

    Without `ahead`, what is off its cell at that x goes on to the next cell: memory and pieces change.

    Parameters
    ----------
    last : int
        Highest order of the series that counts.
    limit : float
        Largest x that is searched, in parts of the trial step.
    p : Program
        Tables of the train's forces.
    memory : ndarray, shape (rows, orders)
        Series over x; row numbers as in `gearfe.drivetrain.train.series`.
    pieces : ndarray of int, shape (whole numbers,)
        Cells that the flanks are on.
    ahead : bool
        Whether to predict the end of a phase's cell from orders 0 and 1, a little beyond it, and leave the pieces.

    Returns
    -------
    x : float
        First x at which a series leaves its cell; 2 if none does up to `limit`.
    """
    nearest = 2.0
    for w in range(p.watches.shape[0]):
        low, high, slack = _bounds(w, p, pieces)
        row = _watched(w, p, pieces)
        if not ahead:
            nearest = min(nearest, leaves(memory, row, last, low, high, slack, min(limit, nearest)))
        elif p.watches[w, 0] == PHASE and memory[row, 1] != 0.0:
            way = (1.0 + PAST) * high - memory[row, 0] if memory[row, 1] > 0.0 else memory[row, 0] + PAST * high
            nearest = min(nearest, max(0.0, way) / abs(memory[row, 1]))
    if not ahead:
        for w in range(p.watches.shape[0]):
            _go_on(w, last, min(limit, nearest), nearest <= limit, p, memory, pieces)
    return nearest


def _watched(w: int, p: Program, pieces: IntArray) -> int:
    """Return the row of a watched series: of a tooth pair its force, or its gap."""
    k = p.watches[w, 1]
    row = p.watches[w, 2]
    if p.watches[w, 0] == PAIR:
        loaded = pieces[p.places.piece[k] + PER_FLANK + p.watches[w, 3]] >= 0
        return row + F if loaded else row + GAP
    return row


def _bounds(w: int, p: Program, pieces: IntArray) -> tuple[float, float, float]:
    """Return the lower and upper bound of a watched series' cell, and the excess beyond them that is rounding."""
    kind = p.watches[w, 0]
    k = p.watches[w, 1]
    if kind == SPEEDING:
        piece = p.speeds.first[k] + pieces[p.speeds.piece[k]]
        first = p.speeds.start[piece] - p.speeds.origin[piece] if piece > p.speeds.first[k] else -1e300
        end = p.speeds.start[piece + 1] - p.speeds.origin[piece] if piece + 1 < p.speeds.first[k + 1] else 1e300
        return first, end, p.speeds.slack[k]
    at = p.places.piece[k]
    law = p.places.law[k]
    if kind == PHASE:
        if p.places.curve[k] >= 0:
            node = p.curves.first[p.places.curve[k]] + pieces[at + 1]
            width = p.curves.nodes[node + 1] - p.curves.nodes[node]
        elif p.places.curve[k] == -2:
            width = p.wide.nodes[law, pieces[at + 1] + 1] - p.wide.nodes[law, pieces[at + 1]]
        else:
            width = p.laws.nodes[law, pieces[at + 1] + 1] - p.laws.nodes[law, pieces[at + 1]]
        return 0.0, width, SAME * width
    if kind in (OVERLAP, TILTED):
        return _wide_bounds(kind, law, pieces[at + PER_FLANK + (1 if kind == TILTED else 0)], p)
    if kind == PAIR:
        part = pieces[at + PER_FLANK + p.watches[w, 3]]
        width = SMALL if part < 0 else p.laws.forces[law, part + 1] - p.laws.forces[law, part]
        high = 0.0 if part < 0 else (width if part < p.laws.parts[law] - 1 else 1e300)
        return (-1e300 if part < 0 else 0.0), high, SAME * width
    if kind == SLIDE:
        side = pieces[at + PER_FLANK + p.laws.touch.shape[1] + p.watches[w, 3]]
        low = -1.0 if side == 0 else (1.0 if side == 1 else -1e300)
        return low, (1.0 if side == 0 else (-1.0 if side == -1 else 1e300)), SAME
    slack = SAME * SMALL if kind == TOUCH else SAME
    return (0.0, 1e300, slack) if pieces[at + 2] >= 0 else (-1e300, 0.0, slack)


def _wide_bounds(kind: int, law: int, cell: int, p: Program) -> tuple[float, float, float]:
    """Return bounds and rounding of a cell of x (-1: apart), or of the tilt, of a law over the face width."""
    below = 0 if kind == TILTED else -1
    last = p.wide.sides[law] if kind == TILTED else p.wide.parts[law] - 1
    width = 1e300
    slack = SAME * SMALL
    if kind == TILTED:
        slack = SAME * (p.wide.tilts[law, 1] - p.wide.tilts[law, 0])
    if cell == below:
        return -1e300, 0.0, slack
    if cell < last:
        width = p.wide.overlaps[law, cell + 1] - p.wide.overlaps[law, cell]
        if kind == TILTED:
            width = p.wide.tilts[law, cell] - p.wide.tilts[law, cell - 1]
    return 0.0, width, slack


def _go_on(w: int, last: int, x: float, reached: bool, p: Program, memory: Array, pieces: IntArray) -> None:
    """Keep the pair forces at x for the next step; at a discontinuity, go on to the next cell."""
    kind = p.watches[w, 0]
    k = p.watches[w, 1]
    low, high, slack = _bounds(w, p, pieces)
    value, slope = _polynomial(memory, _watched(w, p, pieces), last, x)
    up = reached and slope > 0.0 and value >= high - slack
    down = reached and slope < 0.0 and value <= low + slack
    if kind == SPEEDING:
        if up or down:
            pieces[p.speeds.piece[k]] += 1 if up else -1
        return
    at = p.places.piece[k]
    row = p.places.row[k]
    slot = p.watches[w, 3]
    if kind == PAIR:
        part = pieces[at + PER_FLANK + slot]
        law = p.places.law[k]
        memory[row + BEFORE, slot] = p.laws.forces[law, part] + value if part >= 0 else 0.0
        if up or (down and part >= 0):
            pieces[at + PER_FLANK + slot] = part + 1 if up else part - 1
            if part == 0 and down:
                pieces[at + PER_FLANK + p.laws.touch.shape[1] + slot] = UNKNOWN
    elif kind in (OVERLAP, TILTED):
        if up or down:
            pieces[at + PER_FLANK + (1 if kind == TILTED else 0)] += 1 if up else -1
    elif kind == SLIDE:
        if up or down:
            pieces[at + PER_FLANK + p.laws.touch.shape[1] + slot] += 1 if up else -1
    elif kind != PHASE:
        if up or down:
            pieces[at + 2] = 0 if up else -1
    elif up or down:
        cells = p.laws.cells[p.places.law[k]] if p.places.curve[k] == -1 else 0
        if p.places.curve[k] == -2:
            cells = p.wide.cells[p.places.law[k]]
        if p.places.curve[k] >= 0:
            cells = p.curves.first[p.places.curve[k] + 1] - 1 - p.curves.first[p.places.curve[k]]
        pieces[at + 1] += 1 if up else -1
        if 0 <= pieces[at + 1] < cells:
            return
        pieces[at + 1] = 0 if up else cells - 1
        pieces[at] += 1 if up else -1
        if p.places.curve[k] == -1:  # each pair goes on to the next slot
            slots = p.laws.touch.shape[1]
            for i in range(slots):
                to = slots - 1 - i if up else i
                come = to - 1 if up else to + 1
                inside = 0 <= come < slots
                pieces[at + PER_FLANK + to] = pieces[at + PER_FLANK + come] if inside else -1
                memory[row + BEFORE, to] = memory[row + BEFORE, come] if inside else 0.0
                pieces[at + PER_FLANK + slots + to] = UNKNOWN


def leaves(memory: Array, row: int, last: int, low: float, high: float, slack: float, limit: float) -> float:
    """Find the first x up to `limit` at which a series leaves the interval [low, high].

    The series is sampled at `SAMPLES` places, and at its turning point between two of them if tangents allow it to
    leave the interval there.

    Parameters
    ----------
    memory : ndarray, shape (rows, orders)
        Series over x.
    row : int
        Row of the series.
    last : int
        Highest order that counts.
    low, high : float
        Bounds of the interval, in the unit of the series. A series that starts outside and moves inwards does not
        leave.
    slack : float
        Excess beyond a bound that counts as rounding, in the same unit.
    limit : float
        Largest x that is searched, in parts of the trial step.

    Returns
    -------
    x : float
        Where the series passes a bound; 2 if it stays inside.
    """
    before = 0.0
    value = memory[row, 0]
    slope = memory[row, 1]
    if slope < 0.0:  # a series that begins a rounding or a slack outside and moves inwards does not leave there
        high = max(high, value)
    else:
        low = min(low, value)
    for i in range(SAMPLES):
        end = limit * (i + 1) / SAMPLES
        end_value, end_slope = _polynomial(memory, row, last, end)
        x = end
        extreme = end_value
        tangent = value + slope * (end - before)
        end_tangent = end_value - end_slope * (end - before)
        above = slope > 0.0 and end_slope < 0.0 and end_value <= high + slack
        above = above and min(tangent, end_tangent) > high + slack
        below = slope < 0.0 and end_slope > 0.0 and end_value >= low - slack
        below = below and max(tangent, end_tangent) < low - slack
        if above or below:
            x, extreme = _turning(memory, row, last, before, end, above)
        if extreme > high + slack or extreme < low - slack:
            over = extreme > high + slack
            return _crossing(memory, row, last, (before, x), high if over else low, over, 1e-3 * slack)
        before = end
        value = end_value
        slope = end_slope
    return 2.0


def _turning(memory: Array, row: int, last: int, begin: float, end: float, rises: bool) -> tuple[float, float]:
    """Find x and value where the slope of a series changes its sign, by bisection."""
    x = 0.5 * (begin + end)
    value = 0.0
    for _ in range(40):
        x = 0.5 * (begin + end)
        value, slope = _polynomial(memory, row, last, x)
        if (slope > 0.0) == rises:
            begin = x
        else:
            end = x
    return x, value


def _crossing(
    memory: Array, row: int, last: int, between: tuple[float, float], goal: float, rises: bool, close: float
) -> float:
    """Find x at which a series passes `goal` between two places by Newton's method, safeguarded by bisection."""
    begin, end = between
    x = end
    for _ in range(80):
        value, slope = _polynomial(memory, row, last, x)
        if (value > goal) == rises:
            end = x
        else:
            begin = x
        if abs(value - goal) <= close or end - begin <= 1e-16:
            break
        x = x - (value - goal) / slope if slope != 0.0 else 2.0
        if not (begin < x < end):
            x = 0.5 * (begin + end)
    return x


def _polynomial(memory: Array, row: int, last: int, x: float) -> tuple[float, float]:
    """Return value and slope at x of the series in a row of the memory (Horner)."""
    value = 0.0
    slope = 0.0
    for j in range(last, -1, -1):
        slope = slope * x + value
        value = value * x + memory[row, j]
    return value, slope


FUNCTIONS = (_watched, _bounds, _wide_bounds, _go_on, leaves, _turning, _crossing, _polynomial)
