"""Why a run stopped before its end: positions in which a mechanism locks, and what makes the steps short.

With the gradients G of the constraints g(t, q) = 0, velocities follow from ``G v = -dg/dt``. In a locked position G
loses rank: a combination w of its rows vanishes, ``w^T G = 0``. The prescribed motion still requires
``w^T dg/dt != 0``, so no velocity satisfies it. (In a singular position that a mechanism passes, that share is zero.)
The row forces w hold the links in equilibrium. A link that is loaded at two points only lies along the line of its
force. Such links with one common direction are in line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...base.typing import Array, BoolArray
from .modes import rates
from .start import Start
from .steps import ROUNDING
from .system import System

#: Before a lock the smallest singular value of G falls with the root of the time left; below this share of the next
#: one G counts as losing rank.
RANK_LOST = 1e-2
#: Shares of the largest row force, or of the largest prescribed rate, below which a row takes no part.
PART = 1e-3
#: Sine of the angle between the forces of two links below which these are in line.
IN_LINE = 0.05
#: Product of a rate and the length of a step from which on the rate explains the step.
EXPLAINS = 0.1
#: Multiples of a step, before and behind a state, between which a load that reverses is sought; share of its largest
#: value by which it must change between two of them.
LOOKS, REVERSES = np.concatenate([-np.logspace(1, -3, 9), [0.0], np.logspace(-3, 1, 9)]), 0.5
#: Least relative change of a load that depends on speeds when these change by 2 %; how many times the rounding of the
#: time steps need for a reversal.
CHANGES, FAR_ABOVE = 1e-6, 100.0
#: Share of a change that half the range must hold for a load to be steeper there than over the whole: linear is 0.5.
STEEPER = 0.76


def locked(system: System, time: float, q: Array, active: BoolArray) -> str:
    """Return why the prescribed motion cannot continue from a state, or an empty string.

    Parameters
    ----------
    system : System
        The mechanism.
    time : float
        Time (s).
    q : ndarray, shape (size,)
        Coordinates at that time.
    active : ndarray of bool, shape (rows,)
        Constraints that are not redundant.
    """
    rate = (system.rate(time, q) / system.row_units)[active]
    G = (system.jacobian(time, q) * system.units / system.row_units[:, None])[active]
    if not (rate.any() and np.isfinite(G).all()):
        return ""
    left, sizes, _ = np.linalg.svd(G, full_matrices=False)
    if len(sizes) < 2 or sizes[-1] > RANK_LOST * sizes[-2]:
        return ""
    force = left[:, -1]
    largest = np.abs(force).max()
    if abs(force @ rate) <= PART * largest * np.abs(rate).max():
        return ""
    carried = np.zeros(system.rows)
    carried[active] = np.where(np.abs(force) > PART * largest, force, 0.0) / system.row_units[active]
    driving = carried * system.rate(time, q) != 0.0
    drive = next(name for name, drives in zip(system.row_names(), driving, strict=True) if drives)
    links = _links_in_line(system, time, q, carried)
    where = f" with {' and '.join(links)} in line" if len(links) > 1 else ""
    return f"the mechanism locks{where} ({drive.partition(' (')[0]} asks for a motion beyond this position)"


def _links_in_line(system: System, time: float, q: Array, carried: Array) -> list[str]:
    """Names of links, rods among them, that row forces load at two points only, along one direction: the largest set.

    Forces of joints at one point of a link count as one, that of a drive too; a drive's moment has no point.
    """
    lines: list[tuple[str, Array]] = []
    at_rows = 0
    gradients = system.jacobian(time, q)
    for element, index in system.joints:
        rows = slice(at_rows, at_rows + element.rows)
        at_rows += element.rows
        for number, body in enumerate(element.planar_bodies):
            own = index[3 * number : 3 * number + 3]
            pull = carried[rows, None] * gradients[rows][:, own] * system.units[own]
            places = [element.joint_places[joint].get(body, joint) for joint in element.row_joint]
            ends = np.array([pull[[place == end for place in places]].sum(axis=0) for end in dict.fromkeys(places)])
            sizes = np.linalg.norm(ends[:, :2], axis=1)
            loaded = np.abs(ends).max(axis=1) > PART * np.abs(pull).max(initial=0.0)
            if loaded.sum() == 2 and (sizes[loaded] > PART * sizes.max()).all():
                lines.append((body, ends[loaded][0, :2] / sizes[loaded][0]))
        for row, name in enumerate(element.row_names):
            pull = carried[rows][row] * gradients[rows][row, index].reshape(-1)
            if name.startswith("distance ") and pull.any():  # a rod without mass
                first = next(k for k in range(0, len(pull), 3) if pull[k : k + 2].any())
                lines.append(
                    (name.partition(" (")[0], pull[first : first + 2] / np.linalg.norm(pull[first : first + 2]))
                )
    groups = [[name for name, (x, y) in lines if abs(x * along[1] - y * along[0]) < IN_LINE] for _, along in lines]
    return max(groups, key=len, default=[])


def short_steps(
    system: System, start: Start, time: float, state: tuple[Array, Array, Array], step: float, span: float
) -> str:
    """Return the fastest process in a state where steps are short, in words.

    It compares the rotation of bodies, growth and decay by forces that depend on velocities, and loads that reverse,
    such as dry friction. It also compares vibration, and forces that change with time alone. Loads are named where they
    are known.

    Parameters
    ----------
    system : System
        The system.
    start : Start
        Start of the run.
    time : float
        Time of the state (s).
    state : tuple of ndarray, shape (size,)
        Coordinates, velocities and accelerations there.
    step : float
        Length of the steps (s).
    span : float
        Length of the run (s).

    Returns
    -------
    cause : str
        Empty if no process explains the steps, or the state is not finite.
    """
    q, v, _ = state
    if not np.isfinite(state).all() or step <= 0.0:
        return ""
    state_there = replace(start, time=time, q=q, v=v)
    growth, decay, vibration = rates(system, state_there)
    force, later = (system.force(time + share * step, q, v) for share in (0.0, 1.0))
    change = float(np.abs(later - force).max(initial=0.0)) / max(float(np.abs(force).max(initial=0.0)), 1e-300) / step
    turning = np.where(system.turns, np.abs(v), 0.0)
    body = system.coordinate_names()[int(turning.argmax())].removesuffix("_angle_rad")
    load, (reversing, reversal) = _load_of_speed(system, time, q, v), _reversal(system, time, state, step)
    # dry friction is steepest at rest: there it has to take longer than the rounding of the time
    least, at_rest = FAR_ABOVE * ROUNDING * max(abs(time), span), rates(system, replace(state_there, v=0.0 * v))[1]

    def slower(name: str, what: str, rate: float) -> str:
        """The cause, and how much wider the range of speeds has to be in which the load builds up."""
        wider = 10.0 ** np.ceil(np.log10(max(1.0, least * max(rate, at_rest))))
        cure = f"; let it build up over {wider:g} times the range of speeds" if wider > 1.0 else ""
        return f"{name} {what} within {1.0 / max(rate, 1e-300):.3g} s{cure}"

    causes = {
        f"{load} feeds the motion, which grows e-fold every {1.0 / max(growth, 1e-300):.3g} s": growth,
        slower(load, "damps the motion", decay): decay,
        slower(reversing, "reverses", 1.0 / reversal): 1.0 / reversal,
        f"it vibrates at {vibration / (2.0 * np.pi):.3g} Hz": vibration,
        f"a force changes within {1.0 / max(change, 1e-300):.3g} s": change,
        f"{body} turns at {float(turning.max(initial=0.0)):.3g} rad/s": float(turning.max(initial=0.0)),
    }
    explaining = [cause for cause, rate in causes.items() if rate * step > EXPLAINS]
    return max(explaining, key=lambda cause: causes[cause], default="")


def _load_of_speed(system: System, time: float, q: Array, v: Array) -> str:
    """Return the load that changes most, relative to itself, with the size of the velocities."""
    for shares in ((0.99, 1.01), (0.0, 1.0)):  # saturated friction changes from rest alone
        slow, fast = (system.load_values(time, q, share * v) for share in shares)
        changes = [
            (abs(high - low) / max(abs(low), abs(high), 1e-300), name)
            for (name, low), (_, high) in zip(slow, fast, strict=True)
        ]
        change, name = max(changes, default=(0.0, ""))
        if change > CHANGES:
            return name
    return "a force"


def _reversal(system: System, time: float, state: tuple[Array, Array, Array], step: float) -> tuple[str, float]:
    """Return the load that reverses fastest on the way through a state, and the time that it takes (s).

    The velocities are followed along the accelerations for some steps before and behind the state. The time is
    infinite where no load reverses.
    """
    q, v, a = state

    def loads(steps: float) -> list[tuple[str, float]]:
        return system.load_values(time, q, v + steps * step * a)

    names = [name for name, _ in loads(0.0)]
    fastest = "", np.inf
    for number, name in enumerate(names):

        def value(steps: float, number: int = number) -> float:
            return loads(steps)[number][1]

        values = np.array([value(steps) for steps in LOOKS])
        jump = np.abs(np.diff(values))
        k = int(np.nan_to_num(jump).argmax())
        if jump[k] > REVERSES * np.abs(values).max():
            low, high = _steepest(value, float(LOOKS[k]), float(LOOKS[k + 1]))
            fastest = min(fastest, (name, (high - low) * step), key=lambda pair: pair[1])
    return fastest


def _steepest(value: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Return the part of a range with most of a function's change, halved until it is about linear."""
    while True:
        quarters = low + (high - low) * np.linspace(0.0, 1.0, 5)
        values = np.array([value(float(x)) for x in quarters])
        changes = np.abs(values[2:] - values[:-2])
        k = int(changes.argmax())
        narrower = float(quarters[k]), float(quarters[k + 2])
        if not changes[k] > STEEPER * abs(values[4] - values[0]) or not 0.0 < narrower[1] - narrower[0] < high - low:
            return low, high
        low, high = narrower
