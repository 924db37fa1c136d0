r"""Stability of a steady motion: Floquet multipliers of the motion itself.

Small motions beside it feel the forces' derivatives along it,

.. math:: \ddot y + D\dot y + \Lambda y = P\,[A(t)\,P^T y + B(t)\,P^T\dot y] + \Omega\,(G\dot y + N y) + \Omega^2 S y ,

so it is stable where all multipliers, eigenvalues of the map of (y, y') over a time T after which A and B repeat, have
a modulus below 1 (Nayfeh & Balachandran, Applied Nonlinear Dynamics, Sec. 3.2). `runup.monodromy` integrates the
map. Modes that the forces reach little are not in it: they yield as they do at rest, and have the multipliers of free
decay. A mode counts where its share in the forces' change, beside its damping, is more than `REACHED`.

T is the period of the one phase. Several phases share one, too, as long as hunting teeth need to meet all others; up to
`LONGEST` mesh cycles T is that one. Beyond, T is a time after which all phases are nearly back: the growth
:math:`\ln|\mu|/T` then is a Lyapunov exponent up to a term that falls with T. Where it differs from that over about
half the time by as much as its own size, the multipliers are NaN.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray
from .balance import Changes, Orbit, Oscillator, changes
from .linear import Linear
from .monodromy import KICKS, PLACES, flow, kick_times, monodromy

#: Least strength of the forces on a mode, in parts of its damping.
REACHED = 0.01
#: Steps, of seven kicks each, of a mesh cycle at least. Where the forces' derivatives jump, steps at least, and most in
#: parts of the first number: they are doubled until the largest modulus stands still to this part.
OF_CYCLE, STEPS, MOST, SETTLED = 16, 64, 4, 3e-3
#: Phase (rad) of the highest integrated mode in a step, at most: pi, where steps become resonant with a mode and drive
#: it, less a tenth for the mode's own frequency, which changes with the stiffness.
TURNED = 2.8
#: Most steps for a given accuracy, and for the highest mode.
MOST_STEPS = 1 << 14
#: Change of a stiffness from one kick to the next, in parts of that of the whole system, that is a jump.
JUMP = 0.5
#: Imaginary part of a multiplier, in parts of its modulus, that is none.
REAL = 1e-6
#: A multiplier beyond this is an instability, not round-off.
STABLE = 1.0 + 1e-6
#: Cycles of the fastest mesh in the longest time of which multipliers are made: after which all phases are back, and
#: nearly so.
LONGEST, NEARLY = 200, 64
#: Phases are back where they miss less than this part of a period.
BACK = 1e-9


class Bifurcation(NamedTuple):
    """Where a branch changes its stability."""

    speed: float  # rad/s
    kind: str  # turning point, period doubling, Neimark-Sacker; of several phases: loss of stability
    branch: int  # before it


class Window(NamedTuple):
    """Time after which all phases are back, or nearly so."""

    turns: float  # of the drive
    half: float | None  # another such time, about half as long; None where all are back exactly
    cycles: float  # of the fastest mesh in all of it


def window(system: Oscillator) -> Window:
    """Time over which multipliers are made."""
    turns = np.array(system.turns)
    most = max(c / t for mesh in system.orders for c, t in zip(mesh, system.turns, strict=True))  # mesh cycles a turn
    if len(turns) == 1:
        return Window(float(turns[0]), None, float(most * turns[0]))
    tried = turns.min() * np.arange(1, math.floor(LONGEST / (most * turns.min())) + 1)
    off = np.abs(tried[:, None] / turns - np.round(tried[:, None] / turns)).max(axis=1)
    if (off < BACK).any():
        found = float(tried[np.argmax(off < BACK)])
        return Window(found, None, float(most * found))
    ends = [np.where((low < most * tried) & (most * tried <= high), off, math.inf)
            for low, high in ((0.25 * NEARLY, 0.5 * NEARLY), (0.75 * NEARLY, NEARLY))]  # fmt: skip
    half, whole = (float(tried[np.argmin(x)]) for x in ends)
    return Window(whole, half, float(most * whole))


def multipliers(system: Oscillator, orbit: Orbit, accuracy: float | None = None) -> ComplexArray:
    """Floquet multipliers of an orbit over `window`, largest modulus first, (2 n,); (1,) NaN if undecided.

    Parameters
    ----------
    accuracy
        Steps are doubled until no modulus changes by more than this part of the largest, and all modes are integrated.
        None, and where phases are nearly back only: until the largest changes by `SETTLED`, without the modes that the
        forces reach little.
    """
    span = window(system)
    quick = accuracy is None or span.half is not None
    reached, accuracy = (REACHED, SETTLED) if accuracy is None or quick else (0.0, accuracy)
    along = _derivatives(system, orbit, span, reached, steps_of(span))
    steps = steps_of(span, system.linear.squares[along.kept], orbit.speed)
    if along.jumps:
        steps = max(steps, STEPS)
    if steps > along.steps:
        along = _derivatives(system, orbit, span, reached, steps)
    made = around(system, orbit.speed, along.by, along.kept, span)
    most = MOST * steps if quick else MOST_STEPS
    while (along.jumps or not quick) and steps < most:
        steps, before = 2 * steps, made
        finer = _derivatives(system, orbit, span, reached, steps)
        made = around(system, orbit.speed, finer.by, finer.kept, span)
        compared = slice(1 if quick else None)
        with np.errstate(invalid="ignore"):  # both infinite
            off = np.abs(np.abs(made[compared]) - np.abs(before[compared])).max()
        if off <= accuracy * abs(made[0]):
            break
    return made


def steps_of(span: Window, squares: Array | None = None, speed: float = 1.0) -> int:
    """Return the number of steps: those of mesh cycles, and those that modes need at a speed.

    Parameters
    ----------
    span : Window
        Time over which the multipliers are made.
    squares : ndarray, shape (n,), optional
        Squares of the natural frequencies (rad2/s2) of the modes that are integrated; None: mesh cycles alone.
    speed : float
        Speed of the drive (rad/s).
    """
    highest = 0.0 if squares is None else math.sqrt(float(squares.max(initial=0.0)))
    phase = highest * 2.0 * math.pi * span.turns / abs(speed)
    return max(math.ceil(OF_CYCLE * span.cycles - 1e-6), min(math.ceil(phase / TURNED), MOST_STEPS))


class _Derivatives(NamedTuple):
    """Derivatives of the forces along a motion."""

    steps: int
    by: Changes  # at the kicks of these steps
    kept: BoolArray  # (n,) modes that they reach
    jumps: bool  # whether they jump


def _derivatives(system: Oscillator, orbit: Orbit, span: Window, reached: float, steps: int) -> _Derivatives:
    """Return the derivatives of the forces along an orbit at the kicks of so many steps."""
    theta, u, du = _along(system, orbit, span.turns, steps)
    pushes = system.forces(theta, orbit.speed, u, du)
    by = changes([*pushes.entries, *system.turned_entries(theta, orbit.speed)], system.linear.size, len(theta))
    order = np.argsort(kick_times(np.linspace(0.0, 1.0, steps + 1)).ravel(), kind="stable")  # kicks step back, too
    own = by.forces == by.freedoms
    steepest = np.abs(np.diff(by.values[order][:, own], axis=0)).max(axis=0)
    jumps = bool((steepest * np.diag(system.linear.statics)[by.forces[own]] > JUMP).any())
    kept = strengths(system.linear, by) >= reached * np.diag(system.linear.damping) / np.sqrt(system.linear.squares)
    if pushes.momentum_by is not None:
        step = 2.0 * math.pi * span.turns / abs(orbit.speed) / steps
        by, touches = _with_momentum(by, pushes.momentum_by, step, system.linear.size)
        jumps |= touches
    return _Derivatives(steps, by, kept, jumps)


def _with_momentum(by: Changes, momentum: Changes, step: float, size: int) -> tuple[Changes, bool]:
    """Add the derivatives of a force that is the rate of change of a momentum p(u), and say whether p_u jumps.

    Its change is p_u u' + p_u' u. Where teeth touch p_u jumps, and p_u' is an impulse, spread over its step (s). It
    is what the saltation matrix of a jump in the acceleration has (Leine & Nijmeijer, Dynamics and Bifurcations of
    Non-Smooth Mechanical Systems, 2004, Ch. 7).
    """
    samples, width = momentum.values.shape
    by_step = momentum.values.reshape(samples // len(KICKS), len(KICKS), width)
    change = (by_step[:, -1] - by_step[:, 0]) / step
    jumped = momentum.forces, momentum.freedoms, np.repeat(change, len(KICKS), axis=0)
    of_rates = momentum.forces, momentum.freedoms + size, momentum.values
    return changes([by, jumped, of_rates], size, len(by.values)), bool(change.any())


def _along(system: Oscillator, orbit: Orbit, turns: float, steps: int) -> tuple[Array, Array, Array]:
    """Return phases (S, n), and freedoms and rates (S, m), at the kicks over some turns of the drive."""
    speeds = 2.0 * math.pi * turns / steps / np.array(system.turns)  # of the phases, in a step
    line = system.waves(orbit.harmonics) @ speeds
    both = np.hstack([orbit.places, 1j * system.omega(orbit.speed, orbit.harmonics)[:, None] * orbit.places])
    begin = np.exp(1j * np.arange(steps)[:, None] * line)
    values = np.stack([(begin @ (np.exp(1j * place * line)[:, None] * both)).real for place in PLACES], axis=1)
    u, du = np.split(values.reshape(steps * len(PLACES), -1), 2, axis=1)
    return kicks(system, turns, steps), u, du


def kicks(system: Oscillator, turns: float, steps: int) -> Array:
    """(steps stages, n) phases at which `around` takes derivatives, over some turns of the drive."""
    return 2.0 * math.pi * kick_times(np.linspace(0.0, turns, steps + 1)).reshape(-1, 1) / np.array(system.turns)


def strengths(linear: Linear, by: Changes) -> Array:
    """(n,) how much the largest derivatives of the forces change each mode's stiffness, relative to it."""
    by, places = by.of_freedoms(linear.size), np.abs(linear.places)
    size = np.abs(by.values).max(axis=0, initial=0.0)
    return np.asarray((places[:, by.forces] * size * places[:, by.freedoms]).sum(axis=1) / linear.squares)


def around(
    system: Oscillator, speed: float, by: Changes, kept: BoolArray, span: Window, *, damped: bool = True
) -> ComplexArray:
    """Return the multipliers for given derivatives of the forces at `kicks`, the largest modulus first.

    Parameters
    ----------
    system : Oscillator
        The oscillator, for its linear part.
    speed : float
        Speed of the drive (rad/s).
    by : Changes
        Derivatives of the forces.
    kept : ndarray of bool, shape (n,)
        Modes that are integrated; the others yield as they do at rest.
    span : Window
        Time over which the multipliers are made.
    damped : bool
        Whether the linear part has its damping.

    Returns
    -------
    multipliers : ndarray of complex, shape (2 n,)
        Of shape (1,) and NaN if the growth over `span` and over half of it disagree.
    """
    linear = system.linear
    second = 2.0 * math.pi / abs(speed)  # of one turn
    stages = len(KICKS)
    edges = np.linspace(0.0, span.turns * second, len(by.values) // stages + 1)
    places, others = linear.places[kept], linear.places[~kept]
    D = linear.damping if damped else np.zeros_like(linear.damping)
    pushed, rows = np.unique(by.forces, return_inverse=True)
    seen, columns = np.unique(by.freedoms, return_inverse=True)
    of_freedoms = seen < linear.size
    both = np.zeros((len(by.values), len(pushed), len(seen)))
    both[:, rows, columns] = by.values
    # what the other modes yield at once: u = P y + R f, f = A u
    yields = others[:, seen % linear.size].T @ (others[:, pushed] / linear.squares[~kept, None])
    yields *= of_freedoms[:, None]
    by_step = both.reshape(len(both) // stages, stages, len(pushed), len(seen))
    reads = places[:, seen % linear.size]
    reads = np.vstack([reads * of_freedoms, reads * ~of_freedoms])
    free = linear.squares[~kept], np.diag(D)[~kept]
    with np.errstate(over="ignore", invalid="ignore"):
        among = np.ix_(kept, kept)
        stiffness = linear.stiffness(speed, damped=damped)
        constant = flow(stiffness[among], (D - speed * linear.gyroscopic)[among], edges[-1])

        def map_over(first: int, last: int) -> Array:
            return monodromy(constant, edges[first : last + 1], places[:, pushed], reads, by_step[first:last], yields)

        if span.half is None:
            return _sorted(map_over(0, len(edges) - 1), free, edges[-1])
        middle = round(span.half / span.turns * (len(edges) - 1))
        X = map_over(0, middle)
        half, whole = _sorted(X, free, edges[middle]), _sorted(map_over(middle, len(edges) - 1) @ X, free, edges[-1])
    growth, before = math.log(abs(whole[0])) / edges[-1], math.log(abs(half[0])) / edges[middle]
    agree = math.isfinite(growth) and abs(growth) > abs(growth - before)  # a map that overflows says nothing
    return whole if agree else np.array([math.nan + 0j])


def _sorted(X: Array, free: tuple[Array, Array], time: float) -> ComplexArray:
    """Eigenvalues of a map over a time (s), and multipliers of modes that are free, largest modulus first."""
    made = np.linalg.eigvals(X) if np.isfinite(X).all() else np.full(len(X), np.inf)
    made = np.concatenate([made, _free(*free, time)]).astype(complex)
    return np.asarray(made[np.argsort(-np.abs(made), kind="stable")])


def kind_of(one: ComplexArray, two: ComplexArray) -> str:
    """What happens between orbits of which one is stable, by the multiplier that leaves the unit circle."""
    leaving = next((x for x in (one[0], two[0]) if abs(x) > STABLE), one[0])
    if abs(leaving.imag) > REAL * abs(leaving):
        return "Neimark-Sacker"
    return "period doubling" if leaving.real < 0.0 else "turning point"


def _free(squares: Array, damping: Array, period: float) -> ComplexArray:
    """Multipliers of modes by themselves."""
    root = np.sqrt((0.25 * damping**2 - squares).astype(complex))
    return np.asarray(np.exp(period * np.concatenate([-0.5 * damping + root, -0.5 * damping - root])))
