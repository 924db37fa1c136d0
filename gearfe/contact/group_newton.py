r"""Newton's method of `gearfe.contact.newton` for many positions in lockstep.

The same equations, arranged for speed. With the rows taken at the present state u, a step seeks p, f, u^+ with

.. math::
    f = G^T W p + d, \quad u^+ = C f, \quad p = -\gamma\,(g + \partial_u g\,(u^+ - u)) - S f, \quad d = H (u^+ - u)

on the active points. The residual r of the third equation is evaluated on the elastic response itself, and
:math:`p \leftarrow p + M^{-1} r` with the factorised :math:`M = I + (\gamma\,\partial_u g\,C + S) G^T W` repeats until
the step is solved. So M may be somewhat out of date: it is kept until the active set changes or until the repetitions
converge slowly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection, gap_rows, unreached
from .group import Group
from .newton import FREE_ITERATIONS, MAX_ITERATIONS

Array = NDArray[Any]
IntArray = NDArray[Any]

#: Largest number of repetitions within each step, and the number above which M counts as out of date.
REPEATS, SLOW = 12, 7


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
class Rows:
    """Rows of the active points, each over the 12 unknowns that it touches.

    Attributes
    ----------
    points : ndarray, shape (a,)
    at : ndarray, shape (a,)
        Position of each.
    unknowns : ndarray, shape (a, 12)
    opening, normal, tilt, slide : ndarray, shape (a, 12)
        dg/du, G, N and d xi, see `gearfe.contact.closest`.
    """

    points: IntArray
    at: IntArray
    unknowns: IntArray
    opening: Array
    normal: Array
    tilt: Array
    slide: Array
    loads: Array
    cut: Array
    share: Array
    curvature: Array
    thin: Array
    area: Array

    def take(self, chosen: NDArray[np.bool_]) -> Rows:
        """The rows `chosen`."""
        return Rows(**{name: getattr(self, name)[chosen] for name in self.__dataclass_fields__})

    def bending(self, change: Array) -> Array:
        """H change: how the contact forces turn and move when the nodes move by `change`, shape (2n,)."""
        moved = change[self.unknowns]
        tilt, slide = _dot(self.tilt, moved), _dot(self.slide, moved)
        to_slide = -self.loads * self.share * (tilt + self.curvature * slide)
        to_tilt = self.loads * (self.thin * tilt - self.share * slide)
        parts = to_slide[:, None] * self.slide + to_tilt[:, None] * self.tilt + (self.cut * slide)[:, None] * self.normal
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=len(change))

    def forces(self, pressure: Array, size: int) -> Array:
        """G^T W p, shape (size,)."""
        parts = (self.area * pressure)[:, None] * self.normal
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=size)


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)


@dataclass
class Factors:
    """Factorised M of each position, and the active set it was made for."""

    made: list[tuple[Array, IntArray] | None]
    active: NDArray[np.bool_]

    def solve(self, right: Array, at: IntArray, positions: IntArray) -> Array:
        """M^-1 right for the active points in order of position."""
        out = np.zeros_like(right)
        ends = np.cumsum(np.bincount(at, minlength=len(self.made))).tolist()
        for b in positions.tolist():
            factor = self.made[b]
            assert factor is not None
            mine = slice(ends[b] - len(factor[1]), ends[b])
            out[mine] = dgetrs(factor[0], factor[1], right[mine], trans=1)[0]
        return out


def rows_of(group: Group, motion: Motion, active: IntArray) -> Rows:
    """Rows of the active points at the present state."""
    chosen = motion.found.take(active)
    rows = gap_rows(chosen, group.slave_nodes[active], group.slave_shapes[active], group.rotation)
    steep = chosen.normal[:, 0] * chosen.tangent[:, 0] + chosen.normal[:, 1] * chosen.tangent[:, 1]
    normal, tilt, slide = (x.reshape(len(active), 12) for x in (rows.normal, rows.tilt, rows.slide))
    unknowns = (2 * rows.nodes[:, :, None] + np.arange(2)).reshape(len(active), 12)
    metric = chosen.tangent[:, 0] ** 2 + chosen.tangent[:, 1] ** 2
    area, pressure, weight = group.areas(chosen.place, active), motion.pressure[active], group.weight[active]
    across = (area > 0) & (area < weight)
    return Rows(
        points=active,
        at=group.at[active],
        unknowns=unknowns,
        opening=normal - steep[:, None] * slide,
        normal=normal,
        tilt=tilt,
        slide=slide,
        loads=area * pressure,
        cut=np.where(across, -weight / (2 * group.fade[active]) * pressure, 0.0),
        share=1 - chosen.gap * chosen.curvature / metric,
        curvature=chosen.curvature,
        thin=chosen.gap / metric,
        area=area,
    )


def refactor(group: Group, factors: Factors, rows: Rows, wanted: NDArray[np.bool_]) -> None:
    """Factorise M anew for the positions where `wanted`, shape (B,)."""
    mine = np.flatnonzero(wanted[rows.at])
    at, unknowns = rows.at[mine], rows.unknowns[mine]
    points = rows.points[mine]
    touched = np.zeros(len(group.points), dtype=bool)
    touched[unknowns[:, ::2] // 2] = True
    nodes = np.flatnonzero(touched)
    window = group.node_window[nodes]
    count = np.bincount(2 * group.position[window] + group.gear[window], minlength=2 * group.size)
    per_position = count[::2] + count[1::2]
    first = np.cumsum(per_position) - per_position
    column = np.empty(len(touched), dtype=np.int64)
    column[nodes] = 2 * (np.arange(len(nodes)) - first[group.position[window]])
    active = np.bincount(at, minlength=group.size)
    row = np.arange(len(mine)) - (np.cumsum(active) - active)[at]
    length = 2 * per_position
    area = active * length
    slot = (np.cumsum(area) - area)[at] + row * length[at]
    slots = slot[:, None] + column[unknowns // 2] + np.tile([0, 1], 6)
    opening, weighted = np.zeros(area.sum()), np.zeros(area.sum())
    opening[slots] = group.parameter[points][:, None] * rows.opening[mine]
    weighted[slots] = rows.area[mine][:, None] * rows.normal[mine]
    # unknowns and stress rows within their blocks
    half = group.first_window[:-1] + np.diff(group.first_window) // 2
    block_window = np.stack([group.first_window[:-1], half], axis=1).ravel()
    block_node, block_point = group.first_node[block_window], group.first_point[block_window]
    block = 2 * group.position[window] + group.gear[window]
    local = (2 * (nodes - block_node[block]))[:, None] + np.arange(2)
    local = local.ravel()
    own_block = 2 * at + group.gear[group.owner[points]]
    stress_row = points - block_point[own_block]
    of_block = np.bincount(own_block, minlength=2 * group.size).tolist()
    counts, actives = (2 * count).tolist(), active.tolist()
    a0 = c0 = m0 = 0
    for b in np.flatnonzero(wanted).tolist():
        a, t = actives[b], counts[2 * b] + counts[2 * b + 1]
        o, w = opening[m0 : m0 + a * t].reshape(a, t), weighted[m0 : m0 + a * t].reshape(a, t)
        response = np.empty((a, t))
        left, top = 0, 0
        for k in (2 * b, 2 * b + 1):
            right, bottom = left + counts[k], top + of_block[k]
            used, matrix = local[c0 + left : c0 + right], group.blocks[k].matrix
            np.matmul(o[:, left:right], matrix[used[:, None], used], out=response[:, left:right])
            if group.stressed is not None and bottom > top:
                stress = stress_row[a0 + top : a0 + bottom] + len(group.blocks[k].forces)
                response[top:bottom, left:right] += matrix[stress[:, None], used]
            left, top = right, bottom
        m = response @ w.T
        m.flat[:: a + 1] += 1.0
        # the transposed matrix is what LAPACK sees in C order: factorise that, solve transposed, and nothing is copied
        factors.made[b] = dgetrf(m.T, overwrite_a=1)[:2]
        a0, c0, m0 = a0 + a, c0 + t, m0 + a * t


@dataclass(frozen=True)
class Outcomes:
    """Last states, whether each position converged, shape (B,), its Newton steps, and the factors left over."""

    motion: Motion
    converged: NDArray[np.bool_]
    iterations: IntArray
    factors: Factors


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


def iterate(group: Group, pressure: Array, forces: Array, rigid: Projection, tolerance: float) -> Outcomes:
    """Solve all positions of the group from guessed pressures (Pa) and forces (N)."""
    size, every = group.size, np.arange(group.size)
    displacement, stress = group.respond(forces, every.tolist())
    motion = Motion(pressure, stress, pressure, forces, displacement, rigid, np.full(size, np.inf))
    evaluate(group, motion, rigid.place, group.weight, every, np.arange(len(pressure)))
    motion.residual[:] = np.inf
    motion.asked = pressure  # the guess chooses the first active set; afterwards the law does
    limit = 1e3 * np.bincount(group.at, weights=group.weight * pressure, minlength=size)
    factors = Factors([None] * size, np.zeros(len(pressure), dtype=bool))
    slow = np.ones(size, dtype=bool)
    live, converged = np.ones(size, dtype=bool), np.zeros(size, dtype=bool)
    iterations = np.zeros(size, dtype=np.int64)
    for iteration in range(1, MAX_ITERATIONS + 2):
        active = (motion.asked > 0) & ~unreached(motion.found.gap) & live[group.at]
        rows = rows_of(group, motion, np.flatnonzero(active))
        enough = np.maximum(tolerance, _rounding(group, motion))
        done = live & (motion.residual < enough)
        done &= _unbalanced(group, motion, rows) < tolerance
        converged |= done
        live &= ~done & (np.bincount(rows.at, minlength=size) > 0)
        if iteration > MAX_ITERATIONS or not live.any():
            break
        iterations[live] = iteration
        if not live[rows.at].all():
            rows = rows.take(live[rows.at])
            active &= live[group.at]
        stale = live & (slow | (np.bincount(group.at, weights=active != factors.active, minlength=size) > 0))
        if stale.any():
            refactor(group, factors, rows, stale)
            factors.active = np.where(stale[group.at], active, factors.active)
        aim, slow = _step(group, motion, rows, factors, live)
        slow &= ~stale
        total = np.bincount(group.at, weights=group.weight * np.abs(aim.pressure), minlength=size)
        live &= np.isfinite(total) & (total <= limit)
        motion = _searched(group, motion, aim, live, iteration, enough)
    return Outcomes(motion, converged, iterations, factors)


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


def _step(
    group: Group, motion: Motion, rows: Rows, factors: Factors, live: NDArray[np.bool_]
) -> tuple[Motion, NDArray[np.bool_]]:
    """Solve the step; the second answer says where the repetitions converged slowly."""
    points = rows.points
    gap = motion.found.gap[points]
    guess = motion.pressure[points]
    right = -group.parameter[points] * gap - motion.stress[points] - guess
    at_rest = np.zeros_like(motion.forces)
    solved = equilibrium(
        group, rows, factors, live, gap, -motion.displacement, at_rest, guess, right=right, tolerance=None
    )
    whole = np.zeros(len(motion.pressure))
    whole[points] = solved.pressure
    aim = Motion(whole, solved.stress, whole, solved.forces, solved.displacement, motion.found, motion.residual)
    return aim, solved.repeats > SLOW


@dataclass(frozen=True)
class Equilibrium:
    """Pressures of the active points, forces, displacements and stresses that belong together, and repetitions."""

    pressure: Array
    forces: Array
    displacement: Array
    stress: Array
    repeats: IntArray


def equilibrium(
    group: Group,
    rows: Rows,
    factors: Factors,
    live: NDArray[np.bool_],
    gap: Array,
    carried: Array,
    fixed: Array,
    pressure: Array,
    *,
    right: Array | None,
    tolerance: float | None,
) -> Equilibrium:
    """Solve f = G^T W p + H(v) + fixed,  v = C f + carried,  p = -gamma (gap + dg/du v) - S f  for the active points.

    Parameters
    ----------
    live : ndarray of bool, shape (B,)
        Positions that take part.
    gap, pressure : ndarray, shape (a,)
        Gaps (m), and the guess of the pressures (Pa).
    carried, fixed : ndarray, shape (2n,)
        Displacements (m) and forces (N).
    right
        What the third equation lacks for the guess, where that is known.
    tolerance
        On the last repetition, relative; None: a tenth of the square of the first, as much as a Newton step is worth.
    """
    points, size = rows.points, len(fixed)
    gamma = group.parameter[points]
    node_at = np.repeat(group.position[group.node_window], 2)
    open_, turned = live.copy(), np.zeros(size)
    limit = np.full(group.size, tolerance or 0.0)
    repeats = np.zeros(group.size, dtype=np.int64)
    for repeat in range(REPEATS):
        bent = 0.0
        if repeat or right is None:
            forces = rows.forces(pressure, size) + turned + fixed
            displaced, stress = group.respond(forces, np.flatnonzero(open_).tolist())
            change = displaced + carried
            right = -gamma * (gap + _dot(rows.opening, change[rows.unknowns])) - stress[points] - pressure
            now = np.where(open_[node_at], rows.bending(change), turned)
            bent = np.bincount(node_at, weights=np.abs(now - turned), minlength=group.size)
            bent = bent / np.bincount(node_at, weights=np.abs(forces), minlength=group.size).clip(1e-300)
            turned = now
        correction = factors.solve(right, rows.at, np.flatnonzero(open_))
        pressure = pressure + correction
        moved = np.bincount(rows.at, weights=rows.area * np.abs(correction), minlength=group.size)
        whole = np.bincount(rows.at, weights=rows.area * np.abs(pressure), minlength=group.size)
        moved = moved / np.maximum(whole, 1e-300)
        repeats += open_
        if repeat == 0:
            limit = np.clip(0.1 * moved**2, 1e-13, 1e-3) if tolerance is None else limit
            continue  # how the forces turn is known only from the next
        open_ &= ~(np.maximum(moved, bent) <= limit)
        if not open_.any():
            break
    forces = rows.forces(pressure, size) + turned + fixed
    displaced, stress = group.respond(forces, np.flatnonzero(live).tolist())
    return Equilibrium(pressure, forces, displaced, stress, repeats)


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
            best = Motion(
                *(x.copy() for x in (tried.pressure, tried.stress, tried.asked, tried.forces, tried.displacement)),
                tried.found,
                tried.residual.copy(),
            )
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
