"""Where a step of a train's series ends: phases and pair forces that leave their cells, flanks that meet or part,
flanks that slide fast enough for full friction.

The functions see each other and their constants by name, in plain Python and compiled.
"""

from __future__ import annotations

from ..typing import Array, IntArray
from .friction import UNKNOWN
from .series import BEFORE, GAP, PAIR, PER_FLANK, PHASE, SLIDE, TOUCH, F, Program

#: Part of a cell's width by which a corner is passed in its prediction, so that the step contains it.
PAST = 2e-3
#: Part of a cell's width that counts as none, and approach (m) whose part `SAME` counts as none.
SAME, SMALL = 1e-9, 1e-7
#: Parts of a step in which a series is looked at for leaving its cell.
SAMPLES = 6


def train_corner(last: int, limit: float, p: Program, memory: Array, pieces: IntArray, ahead: bool) -> float:
    """Where x, up to `limit`, first takes something off its cell; 2 when nothing does.

    `ahead`: a little past the place to which the phases go at their present rate; pieces stay. Otherwise what is off
    its cell there goes on to the next.
    """
    nearest = 2.0
    for w in range(p.watches.shape[0]):
        low, high, slack = bounds(w, p, pieces)
        row = watched(w, p, pieces)
        if not ahead:
            nearest = min(nearest, leaves(memory, row, last, low, high, slack, min(limit, nearest)))
        elif p.watches[w, 0] == PHASE and memory[row, 1] != 0.0:
            way = (1.0 + PAST) * high - memory[row, 0] if memory[row, 1] > 0.0 else memory[row, 0] + PAST * high
            nearest = min(nearest, max(0.0, way) / abs(memory[row, 1]))
    if not ahead:
        for w in range(p.watches.shape[0]):
            go_on(w, last, min(limit, nearest), nearest <= limit, p, memory, pieces)
    return nearest


def watched(w: int, p: Program, pieces: IntArray) -> int:
    """Row of what is watched: of a pair its force, or its gap."""
    k = p.watches[w, 1]
    row = p.watches[w, 2]
    if p.watches[w, 0] == PAIR:
        bears = pieces[p.places.piece[k] + PER_FLANK + p.watches[w, 3]] >= 0
        return row + F if bears else row + GAP
    return row


def bounds(w: int, p: Program, pieces: IntArray) -> tuple[float, float, float]:
    """Cell of what is watched, and how much beyond it counts as none."""
    kind = p.watches[w, 0]
    k = p.watches[w, 1]
    at = p.places.piece[k]
    law = p.places.law[k]
    if kind == PHASE:
        if p.places.curve[k] >= 0:
            node = p.curves.first[p.places.curve[k]] + pieces[at + 1]
            width = p.curves.nodes[node + 1] - p.curves.nodes[node]
        else:
            width = p.laws.nodes[law, pieces[at + 1] + 1] - p.laws.nodes[law, pieces[at + 1]]
        return 0.0, width, SAME * width
    if kind == PAIR:
        part = pieces[at + PER_FLANK + p.watches[w, 3]]
        if part >= 0:
            width = p.laws.forces[law, part + 1] - p.laws.forces[law, part]
            return 0.0, (width if part < p.laws.parts[law] - 1 else 1e300), SAME * width
        return -1e300, 0.0, SAME * SMALL
    if kind == SLIDE:
        side = pieces[at + PER_FLANK + p.laws.touch.shape[1] + p.watches[w, 3]]
        if side == 0:
            return -1.0, 1.0, SAME
        return (1.0 if side == 1 else -1e300), (-1.0 if side == -1 else 1e300), SAME
    slack = SAME * SMALL if kind == TOUCH else SAME
    return (0.0, 1e300, slack) if pieces[at + 2] >= 0 else (-1e300, 0.0, slack)


def go_on(w: int, last: int, x: float, corner: bool, p: Program, memory: Array, pieces: IntArray) -> None:
    """Keep the pair forces at x for the next step; where x is a corner, go on to the cell beyond it."""
    kind = p.watches[w, 0]
    k = p.watches[w, 1]
    at = p.places.piece[k]
    row = p.places.row[k]
    slot = p.watches[w, 3]
    low, high, slack = bounds(w, p, pieces)
    value, slope = polynomial(memory, watched(w, p, pieces), last, x)
    up = corner and slope > 0.0 and value >= high - slack
    down = corner and slope < 0.0 and value <= low + slack
    if kind == PAIR:
        part = pieces[at + PER_FLANK + slot]
        law = p.places.law[k]
        memory[row + BEFORE, slot] = p.laws.forces[law, part] + value if part >= 0 else 0.0
        if up or (down and part >= 0):
            pieces[at + PER_FLANK + slot] = part + 1 if up else part - 1
            if part == 0 and down:
                pieces[at + PER_FLANK + p.laws.touch.shape[1] + slot] = UNKNOWN
    elif kind == SLIDE:
        if up or down:
            pieces[at + PER_FLANK + p.laws.touch.shape[1] + slot] += 1 if up else -1
    elif kind != PHASE:
        if up or down:
            pieces[at + 2] = 0 if up else -1
    elif up or down:
        cells = p.laws.cells[p.places.law[k]] if p.places.curve[k] < 0 else 0
        if p.places.curve[k] >= 0:
            cells = p.curves.first[p.places.curve[k] + 1] - 1 - p.curves.first[p.places.curve[k]]
        pieces[at + 1] += 1 if up else -1
        if 0 <= pieces[at + 1] < cells:
            return
        pieces[at + 1] = 0 if up else cells - 1
        pieces[at] += 1 if up else -1
        if p.places.curve[k] < 0:  # each pair goes on to the next slot
            slots = p.laws.touch.shape[1]
            for i in range(slots):
                to = slots - 1 - i if up else i
                come = to - 1 if up else to + 1
                inside = 0 <= come < slots
                pieces[at + PER_FLANK + to] = pieces[at + PER_FLANK + come] if inside else -1
                memory[row + BEFORE, to] = memory[row + BEFORE, come] if inside else 0.0
                pieces[at + PER_FLANK + slots + to] = UNKNOWN


def leaves(memory: Array, row: int, last: int, low: float, high: float, slack: float, limit: float) -> float:
    """Where x, up to `limit`, first takes the series in a row of the memory out of [low, high]; 2 when it stays.

    It is looked at in a few places; between two of them at its turning point, where tangents allow it to pass there.
    """
    before = 0.0
    value = memory[row, 0]
    slope = memory[row, 1]
    if slope < 0.0:  # one that begins a rounding or a slack outside, on its way in, does not leave there
        high = max(high, value)
    else:
        low = min(low, value)
    for i in range(SAMPLES):
        end = limit * (i + 1) / SAMPLES
        there, rate = polynomial(memory, row, last, end)
        x = end
        found = there
        one = value + slope * (end - before)
        two = there - rate * (end - before)
        above = slope > 0.0 and rate < 0.0 and there <= high + slack and min(one, two) > high + slack
        below = slope < 0.0 and rate > 0.0 and there >= low - slack and max(one, two) < low - slack
        if above or below:
            x, found = turning(memory, row, last, before, end, above)
        if found > high + slack or found < low - slack:
            over = found > high + slack
            return crossing(memory, row, last, (before, x), high if over else low, over, 1e-3 * slack)
        before = end
        value = there
        slope = rate
    return 2.0


def turning(memory: Array, row: int, last: int, begin: float, end: float, rises: bool) -> tuple[float, float]:
    """Place and value where the slope of a series changes its sign."""
    x = 0.5 * (begin + end)
    value = 0.0
    for _ in range(40):
        x = 0.5 * (begin + end)
        value, slope = polynomial(memory, row, last, x)
        if (slope > 0.0) == rises:
            begin = x
        else:
            end = x
    return x, value


def crossing(
    memory: Array, row: int, last: int, between: tuple[float, float], goal: float, rises: bool, close: float
) -> float:
    """Where a series passes `goal` between two places: Newton's method, kept between them by halving."""
    begin, end = between
    x = end
    for _ in range(80):
        value, slope = polynomial(memory, row, last, x)
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


def polynomial(memory: Array, row: int, last: int, x: float) -> tuple[float, float]:
    """Value and slope at x of the series in a row of the memory."""
    value = 0.0
    slope = 0.0
    for j in range(last, -1, -1):
        slope = slope * x + value
        value = value * x + memory[row, j]
    return value, slope


FUNCTIONS = (watched, bounds, go_on, leaves, turning, crossing, polynomial)
