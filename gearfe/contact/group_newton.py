r"""Newton's method of `gearfe.contact.newton` for many positions in lockstep.

With the rows taken at the present state u, a step solves on the active points

.. math::
    f = G^T W p + d, \quad u^+ = C f, \quad p = -\gamma\,(g + \partial_u g\,(u^+ - u)) - S f, \quad d = H (u^+ - u),

d by repetition on one factorisation, as often as the step is worth. A position has converged when its pressures are
those that the law asks for *and* its forces are those of the pressures at the places reached: the second closes only
with the square of the last step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Projection, unreached
from .group import Group
from .group_rows import Rows, coupled, linearised, rows_of
from .newton import FREE_ITERATIONS

Array = NDArray[Any]
IntArray = NDArray[Any]

#: Newton steps after which a position is left to the solver of single positions: most need four to ten.
MAX_ITERATIONS = 16
#: Newton steps after which a position whose residual does not even halve is given up here.
PATIENCE = 7
#: Largest number of repetitions for the forces' turning; each gains two to three digits.
REPEATS = 8
#: Relative accuracy of the repetitions where there is no step to compare with.
EXACT = 1e-12


@dataclass
class Motion:
    """Present state of all positions (changed in place, position by position).

    Attributes
    ----------
    pressure, stress, asked : ndarray, shape (q,)
        p, normal stress S f, and the pressure that the law asks for (Pa).
    forces, displacement : ndarray, shape (2n,)
        N, m.
    found : Projection
        Closest points at the displacements.
    residual : ndarray, shape (B,)
    """

    pressure: Array
    stress: Array
    asked: Array
    forces: Array
    displacement: Array
    found: Projection
    residual: Array

    def accept(self, other: Motion, of: Array, points: IntArray, unknowns: IntArray) -> None:
        """Take over the state `other` at the positions `of`, with their points and unknowns."""
        for name in ("pressure", "stress", "asked"):
            getattr(self, name)[points] = getattr(other, name)[points]
        for name in ("forces", "displacement"):
            getattr(self, name)[unknowns] = getattr(other, name)[unknowns]
        for name in Projection.__dataclass_fields__:
            getattr(self.found, name)[points] = getattr(other.found, name)[points]
        self.residual[of] = other.residual[of]


@dataclass(frozen=True)
class Outcomes:
    """Last states, whether each position converged, shape (B,), and its Newton steps."""

    motion: Motion
    converged: NDArray[np.bool_]
    iterations: IntArray


def evaluate(group: Group, motion: Motion, start: Array, before: Array, of: IntArray, points: IntArray) -> None:
    """Closest points, asked pressures and residuals of a trial state at the positions `of` with their `points`."""
    found = group.project(group.placed(motion.displacement), start[points], points)
    motion.found = _spread(found, points, len(start))
    asked = np.maximum(-group.parameter[points] * found.gap - motion.stress[points], 0.0)
    asked[unreached(found.gap)] = 0.0
    motion.asked = np.zeros(len(start))
    motion.asked[points] = asked
    area, at = group.areas(found.place, points), group.at[points]
    pressure = motion.pressure[points]
    scale = np.bincount(at, weights=area * asked, minlength=group.size)
    total = np.bincount(at, weights=group.weight[points] * np.abs(pressure), minlength=group.size)
    # sliding past a sharp end changes the areas behind the forces as well
    wrong = area * np.abs(pressure - asked) + np.abs(area - before[points]) * asked
    error = np.bincount(at, weights=wrong, minlength=group.size)
    motion.residual = np.full(group.size, np.nan)
    motion.residual[of] = error[of] / np.maximum(np.maximum(scale, 1e-12 * total)[of], 1e-300)


def _spread(found: Projection, points: IntArray, count: int) -> Projection:
    if len(points) == count:
        return found
    made = {}
    for name in Projection.__dataclass_fields__:
        part = getattr(found, name)
        whole = np.zeros((count, *part.shape[1:]), dtype=part.dtype)
        whole[points] = part
        made[name] = whole
    return Projection(**made)


def iterate(
    group: Group, pressure: Array, forces: Array, rigid: Projection, tolerance: float, unbalanced: float | None = None
) -> Outcomes:
    """Solve all positions of the group from guessed pressures (Pa) and forces (N).

    `unbalanced` is the accuracy asked of the forces, ten times `tolerance` where it is not given.
    """
    size, every = group.size, np.arange(group.size)
    displacement, stress = group.respond(forces, every.tolist())
    motion = Motion(pressure, stress, pressure, forces, displacement, rigid, np.full(size, np.inf))
    evaluate(group, motion, rigid.place, group.weight, every, np.arange(len(pressure)))
    motion.residual[:] = np.inf
    motion.asked = pressure  # the guess chooses the first active set; afterwards the law does
    limit = 1e3 * np.bincount(group.at, weights=group.weight * pressure, minlength=size)
    live, converged = np.ones(size, dtype=bool), np.zeros(size, dtype=bool)
    iterations = np.zeros(size, dtype=np.int64)
    for iteration in range(1, MAX_ITERATIONS + 2):
        active = (motion.asked > 0) & ~unreached(motion.found.gap) & live[group.at]
        rows = rows_of(group, motion.found, motion.pressure, np.flatnonzero(active), group.placed(motion.displacement))
        enough = np.maximum(tolerance, _rounding(group, motion))
        done = live & (motion.residual < enough)
        done &= _unbalanced(group, motion, rows) < (10 * tolerance if unbalanced is None else unbalanced)
        converged |= done
        live &= ~done & (np.bincount(rows.at, minlength=size) > 0)
        if iteration > MAX_ITERATIONS or not live.any():
            break
        iterations[live] = iteration
        if not live[rows.at].all():
            rows = rows.take(live[rows.at])
        aim = _step(group, motion, rows, live)
        total = np.bincount(group.at, weights=group.weight * np.abs(aim.pressure), minlength=size)
        live &= np.isfinite(total) & (total <= limit)
        before = motion.residual
        motion = _searched(group, motion, aim, live, iteration, enough)
        if iteration >= PATIENCE:  # the solver of single positions may do better: do not hold the others up
            live &= ~(motion.residual > np.maximum(0.5 * before, enough))
    return Outcomes(motion, converged, iterations)


def _unbalanced(group: Group, motion: Motion, rows: Rows) -> Array:
    """|f - G(u)^T W p| / |f| of each position: how much the contact forces moved and turned since they were solved."""
    wrong = np.abs(motion.forces - rows.forces(motion.pressure[rows.points], len(motion.forces)))
    node_at = np.repeat(group.position[group.node_window], 2)
    total = np.bincount(node_at, weights=np.abs(motion.forces), minlength=group.size)
    return np.bincount(node_at, weights=wrong, minlength=group.size) / np.maximum(total, 1e-300)


def _rounding(group: Group, motion: Motion) -> Array:
    """Smallest residual that rounding lets the law reach in each position, see `newton`."""
    area = group.areas(motion.found.place) * (motion.asked > 0)
    stiff = np.bincount(group.at, weights=area * group.parameter, minlength=group.size)
    load = np.bincount(group.at, weights=area * motion.asked, minlength=group.size)
    extent = float(np.abs(group.points).max())
    return np.finfo(float).eps * extent * stiff / np.maximum(load, 1e-300)


def _step(group: Group, motion: Motion, rows: Rows, live: NDArray[np.bool_]) -> Motion:
    """Solution of the contact linearised at the present state."""
    points = rows.points
    before = np.einsum("ij,ij->j", rows.opening, motion.displacement[rows.unknowns])
    right = -group.parameter[points] * (motion.found.gap[points] - before)
    solved = equilibrium(group, rows, right, motion.displacement, motion.pressure[points])
    whole = np.zeros(len(motion.pressure))
    whole[points] = solved[0]
    displaced, stress = group.respond(solved[1], np.flatnonzero(live).tolist())
    return Motion(whole, stress, whole, solved[1], displaced, motion.found, motion.residual)


def equilibrium(
    group: Group, rows: Rows, right: Array, origin: Array, guess: Array | None, fixed: Array | None = None
) -> tuple[Array, Array]:
    """Pressures p of the active points and forces f, shape (2n,), with

    p = right - R (f - G^T W p) - R G^T W p  for f = G^T W p + H(C f - origin) + fixed.

    Parameters
    ----------
    right : ndarray, shape (a,)
        Pa.
    origin, fixed : ndarray, shape (2n,)
        Displacements (m) and forces (N).
    guess : ndarray, shape (a,), optional
        What the pressures were: repeated as often as a step from there is worth, to a third of its relative square.
        Without it, to `EXACT`.
    """
    size, linear = len(origin), linearised(group, rows)
    node_at = np.repeat(group.position[group.node_window], 2)
    open_, limit = np.ones(group.size, dtype=bool), np.full(group.size, EXACT)
    still = np.zeros(size) if fixed is None else fixed
    added = still.copy()
    pressure = linear.solve(right if fixed is None else right - linear.pressures(fixed, len(right)))
    if guess is not None:
        moved = np.bincount(rows.at, weights=rows.area * np.abs(pressure - guess), minlength=group.size)
        whole = np.bincount(rows.at, weights=rows.area * np.abs(pressure), minlength=group.size)
        limit = np.clip(0.3 * (moved / np.maximum(whole, 1e-300)) ** 2, 1e-13, 1e-3)
    past: tuple[Array, Array] | None = None
    for _ in range(REPEATS):
        forces = rows.forces(pressure, size) + added
        now = still + rows.bending(linear.displacements(forces) - origin)
        gone = now - added
        bent = np.bincount(node_at, weights=np.abs(gone), minlength=group.size)
        whole = np.bincount(node_at, weights=np.abs(forces), minlength=group.size)
        open_ &= bent > limit * whole
        if not open_.any():
            break
        linear = linear.of(open_)
        mixed = now
        if past is not None:
            # Anderson's mixing with the repetition before: at a corner a single motion decays slowly by itself
            change = gone - past[1]
            product = np.bincount(node_at, weights=gone * change, minlength=group.size)
            square = np.bincount(node_at, weights=change * change, minlength=group.size)
            share = np.divide(product, square, out=np.zeros(group.size), where=square > 0)
            mixed = now - np.clip(share, -2.0, 2.0)[node_at] * (now - past[0])
        past = now, gone
        # positions that are done keep their numbers, whatever their company needs
        added = np.where(open_[node_at], mixed, added)
        pressure = np.where(open_[rows.at], linear.solve(right - linear.pressures(added, len(right))), pressure)
    else:
        # at a deep corner repetitions may diverge: solved as one system
        for piece in linear.of(open_).pieces:
            whose, unknowns = rows.at == piece.position, linear.touched[piece.unknowns]
            mine = rows.take(whose)
            pressure[whose], forces = coupled(mine, piece, unknowns, right[whose], origin[unknowns], still[unknowns])
            added[unknowns] = forces - mine.forces(pressure[whose], size)[unknowns]
    return pressure, rows.forces(pressure, size) + added


def _searched(
    group: Group, motion: Motion, aim: Motion, live: NDArray[np.bool_], iteration: int, enough: Array
) -> Motion:
    """Backtracking line search on the pressure residual, of each live position on its own."""
    node_at = np.repeat(group.position[group.node_window], 2)
    before = group.areas(motion.found.place)
    length = np.ones(group.size)
    best = motion
    open_ = live.copy()
    for trial in range(6):
        of = np.flatnonzero(open_)
        points = np.flatnonzero(open_[group.at])
        tried = aim if trial == 0 else _between(motion, aim, length[group.at], length[node_at])
        evaluate(group, tried, motion.found.place, before, of, points)
        if trial == 0:
            arrays = (tried.pressure, tried.stress, tried.asked, tried.forces, tried.displacement)
            p, sigma, asked, f, u = (x.copy() for x in arrays)
            best = Motion(p, sigma, asked, f, u, tried.found, tried.residual.copy())
        else:
            better = open_ & (tried.residual < best.residual)
            best.accept(tried, better, np.flatnonzero(better[group.at]), np.flatnonzero(better[node_at]))
        if iteration <= FREE_ITERATIONS:
            break
        open_ &= ~(tried.residual < np.maximum((1 - 0.1 * length) * motion.residual, enough))
        if not open_.any():
            break
        length[open_] *= 0.5
    # positions that are done keep their state
    rest = ~live
    if rest.any():
        best.accept(motion, rest, np.flatnonzero(rest[group.at]), np.flatnonzero(rest[node_at]))
    return best


def _between(old: Motion, new: Motion, points: Array, unknowns: Array) -> Motion:
    return Motion(
        old.pressure + points * (new.pressure - old.pressure),
        old.stress + points * (new.stress - old.stress),
        old.asked,
        old.forces + unknowns * (new.forces - old.forces),
        old.displacement + unknowns * (new.displacement - old.displacement),
        old.found,
        old.residual,
    )
