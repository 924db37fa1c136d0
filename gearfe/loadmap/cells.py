"""Pieces of computing a load map: predicting a cell, the order of the torques, bringing a level to its torque."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..stiffness.positions import Solved

Array = NDArray[Any]
IntArray = NDArray[Any]

#: p: the share of finite strain of a single pair of teeth grows about like this power of its load.
SHARE_POWER = 0.75


def spent_share(pair_torques: Array) -> float:
    """T^p sum s^(1 + p) of the torques that the pairs carry (N m)."""
    carried = np.maximum(pair_torques, 0.0)
    return float((carried ** (1 + SHARE_POWER)).sum() / carried.sum())


def log_twist(x: float, known: Array, y: Array, slope: Array) -> float:
    """Cubic Hermite between the two nearest known levels round x; beyond the last, a parabola through its slopes."""
    order = np.argsort(known)
    known, y, slope = known[order], y[order], slope[order]
    k = int(np.searchsorted(known, x))
    if 0 < k < len(known):
        h = known[k] - known[k - 1]
        t = (x - known[k - 1]) / h
        low, high, rise = h * slope[k - 1], h * slope[k], y[k] - y[k - 1]
        return float(y[k - 1] + t * (low + t * (3 * rise - 2 * low - high + t * (low + high - 2 * rise))))
    end, other = (0, 1) if k == 0 else (len(known) - 1, len(known) - 2)
    bend = 0.0
    if len(known) > 1:
        bend = (slope[end] - slope[other]) / (known[end] - known[other])
    step = x - known[end]
    steepest = np.clip(slope[end] + 0.5 * bend * step, 0.3, 1.2)
    return float(y[end] + steepest * step)


def outward(count: int) -> list[int]:
    """Numbers 0 .. count - 1: every other one outward from the middle, then the ones between these."""
    middle = count // 2
    even = [*range(middle, count, 2), *range(middle - 2, -1, -2)]
    ends = [i for i in (0, count - 1) if i not in even]
    return [*even, *ends, *(i for i in range(count) if i not in {*even, *ends})]


def one_cell(made: Solved, k: int) -> Solved:
    """Cell k of some that were solved together."""
    part = slice(k, k + 1)
    numbers = {name: values[part] for name, values in made.numbers.items()}
    return Solved(made.twist[part], numbers, [made.pairs[k]], made.iterations[part], [made.status[k]])


def closed_level(cells: list[Solved], goal: float, share: Array, touching: Array, tally: IntArray) -> Solved:
    """The level at its torque: the last small step, then the share of finite strain.

    The step follows the tangent of ln delta over ln T, delta the twist beyond `touching`, shape (n,) (rad).
    """
    twist = np.concatenate([c.twist for c in cells])
    numbers = {name: np.concatenate([c.numbers[name] for c in cells]) for name in cells[0].numbers}
    status = [c.status[0] for c in cells]
    good = np.array(status) == "converged"
    with np.errstate(invalid="ignore", divide="ignore"):
        torque, tangent = numbers["torque_wheel"], numbers["tangent"]
        delta = twist - touching
        step = (goal / (1 + share) / torque) ** (torque / (delta * tangent))
        twist = np.where(good, touching + delta * step, twist)
        factor = np.where(good, goal / torque, 1.0)  # the step and the share together
        root = np.where(good, np.sqrt(goal / (1 + share) / torque), 1.0)
    moved = dict(numbers)
    for name in ("torque_wheel", "torque_pinion", "torque_wheel_reaction"):
        moved[name] = numbers[name] * factor
    moved["torque_wheel"] = np.where(good, goal, moved["torque_wheel"])
    moved["tangent"] = tangent * (1 + 2 * share)
    for name in ("peak_pressure", "edge_pressure"):
        moved[name] = numbers[name] * root
    pairs = [(c.pairs[0][0], c.pairs[0][1] * f) for c, f in zip(cells, factor, strict=True)]
    return replace(
        cells[0],
        twist=twist,
        numbers=moved,
        pairs=pairs,
        iterations=tally,
        status=status,
    )
