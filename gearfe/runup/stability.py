r"""Stability of a periodic motion: Floquet multipliers of the motion itself.

Small motions beside the orbit feel the forces' derivatives along it,

.. math:: \ddot y + D\dot y + \Lambda y = P\,[A(t)\,P^T y + B(t)\,P^T\dot y] + \Omega\,G\dot y ,

so the orbit is stable where all multipliers, eigenvalues of the map of (y, y') over a period, have a modulus below 1
(Nayfeh & Balachandran, Applied Nonlinear Dynamics, Sec. 3.2). `gearfe.train.monodromy` integrates the map. Modes that
the forces reach little are not in it: they yield as they do at rest, and have the multipliers of free decay. A mode
counts where its share in the forces' change, beside its damping, is more than `REACHED`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..train.monodromy import KICKS, flow, kick_times, monodromy
from ..typing import Array, BoolArray, ComplexArray
from .balance import Orbit, Oscillator, rates
from .linear import Linear

#: Least strength of the forces on a mode, in parts of its damping.
REACHED = 0.01
#: Steps of the period, of seven kicks each: first, most. Where the forces' derivatives jump they are doubled until the
#: largest modulus stands still to this part.
STEPS, MOST, SETTLED = 64, 256, 3e-3
#: Change of a stiffness from one kick to the next, in parts of that of the whole system, that is a jump.
JUMP = 0.5
#: Imaginary part of a multiplier, in parts of its modulus, that is none.
REAL = 1e-6
#: A multiplier beyond this is an instability, not round-off.
STABLE = 1.0 + 1e-6


class Bifurcation(NamedTuple):
    """Where a branch changes its stability."""

    speed: float  # rad/s
    kind: str  # turning point, period doubling, Neimark-Sacker
    branch: int  # before it


def multipliers(system: Oscillator, orbit: Orbit, *, reached: float = REACHED, steps: int = STEPS) -> ComplexArray:
    """Floquet multipliers of an orbit, largest modulus first, (2 n,)."""
    made, jumps = _multipliers(system, orbit, reached, steps)
    while jumps and steps < MOST:
        steps *= 2
        before = abs(made[0])
        made, _ = _multipliers(system, orbit, reached, steps)
        if abs(abs(made[0]) - before) <= SETTLED * abs(made[0]):
            break
    return made


def _multipliers(system: Oscillator, orbit: Orbit, reached: float, steps: int) -> tuple[ComplexArray, bool]:
    """Multipliers with so many steps, and whether derivatives jump."""
    theta = kicks(steps)
    turns = np.exp(1j * theta[:, None] * np.arange(orbit.harmonics + 1))
    u, du = ((turns @ x).real for x in (orbit.places, rates(orbit.places, system.omega0(orbit.speed))))
    _, A, B = system.forces(theta, orbit.speed, u, du)
    order = np.argsort(theta, kind="stable")  # kicks step back, too
    changes = np.abs(np.diff(A[order], axis=0)).max(axis=0)
    jumps = bool((np.diag(changes) * np.diag(system.linear.statics) > JUMP).any())
    kept = strengths(system.linear, A) > reached * np.diag(system.linear.damping) / np.sqrt(system.linear.squares)
    return around(system, orbit.speed, A, B, kept), jumps


def kicks(steps: int) -> Array:
    """(steps stages,) places of the period (rad) at which `around` takes derivatives."""
    return kick_times(np.linspace(0.0, 2.0 * math.pi, steps + 1)).ravel()


def strengths(linear: Linear, A: Array) -> Array:
    """(n,) how much the largest derivatives of the forces change each mode's stiffness, relative to it."""
    size, places = np.abs(A).max(axis=0), np.abs(linear.places)
    return np.asarray(np.einsum("ni,ij,nj->n", places, size, places) / linear.squares)


def around(
    system: Oscillator, speed: float, A: Array, B: Array | None, kept: BoolArray, *, damped: bool = True
) -> ComplexArray:
    """Multipliers for the derivatives A, B of the forces at `kicks`, the largest modulus first.

    Parameters
    ----------
    kept : (n,)
        Modes that are integrated; the others yield as they do at rest.
    damped
        False: without the damping of the linear part.
    """
    linear, m = system.linear, system.linear.size
    period = 2.0 * math.pi / system.omega0(speed)
    stages = len(KICKS)
    edges = np.linspace(0.0, period, len(A) // stages + 1)
    places, tilts = linear.places[kept], linear.tilts[kept]
    swap = np.kron(np.diag(linear.momenta), np.array([[0.0, -1.0], [1.0, 0.0]])) * speed
    D = linear.damping if damped else np.zeros_like(linear.damping)
    # what the other modes yield at once: u = P y + R f, f = A u
    rest = linear.places[~kept].T @ (linear.places[~kept] / linear.squares[~kept, None])
    A = A @ np.linalg.inv(np.eye(m) - rest @ A)
    both = np.concatenate([A, np.zeros_like(A) if B is None else B], axis=2).reshape(-1, stages, m, 2 * m)
    none = np.zeros_like(places)
    with np.errstate(over="ignore", invalid="ignore"):
        constant = flow(linear.squares[kept], D[np.ix_(kept, kept)] - tilts @ swap @ tilts.T, period)
        X = monodromy(constant, edges, places, np.block([[places, none], [none, places]]), both)
    made = np.linalg.eigvals(X) if np.isfinite(X).all() else np.array([np.inf])
    made = np.concatenate([made, _free(linear.squares[~kept], np.diag(D)[~kept], period)]).astype(complex)
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
