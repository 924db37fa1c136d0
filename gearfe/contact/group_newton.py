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
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection, gap_rows, unreached
from .group import Group
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
        parts = (
            to_slide[:, None] * self.slide + to_tilt[:, None] * self.tilt + (self.cut * slide)[:, None] * self.normal
        )
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=len(change))

    def forces(self, pressure: Array, size: int) -> Array:
        """G^T W p, shape (size,)."""
        parts = (self.area * pressure)[:, None] * self.normal
        return np.bincount(self.unknowns.ravel(), weights=parts.ravel(), minlength=size)


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)


@dataclass(frozen=True)
class Piece:
    """Matrices of one position on the unknowns that its active points touch.

    Attributes
    ----------
    factor
        Of the transposed M = I + R G^T W.
    response : ndarray, shape (a, t)
        R = gamma dg/du C + S.
    compliance : tuple of (ndarray, ndarray)
        C of the pinion and of the wheel.
    position : int
    points, unknowns : slice
        Where its active points and touched unknowns stand among those of all positions.
    """

    factor: tuple[Array, IntArray]
    response: Array
    compliance: tuple[Array, Array]
    position: int
    points: slice
    unknowns: slice


@dataclass(frozen=True)
class Linear:
    """Linearised contact of several positions: their pieces and, one after the other, the unknowns that they touch."""

    pieces: list[Piece]
    touched: IntArray

    def of(self, chosen: NDArray[np.bool_]) -> Linear:
        """The positions `chosen`, shape (B,); of the others nothing is computed any more."""
        return Linear([piece for piece in self.pieces if chosen[piece.position]], self.touched)

    def solve(self, right: Array) -> Array:
        """M^-1 right, shape (a,)."""
        out = np.zeros_like(right)
        for piece in self.pieces:
            out[piece.points] = dgetrs(*piece.factor, right[piece.points], trans=1)[0]
        return out

    def pressures(self, forces: Array, count: int) -> Array:
        """R forces, shape (count,)."""
        loads, out = forces[self.touched], np.zeros(count)
        for piece in self.pieces:
            np.dot(piece.response, loads[piece.unknowns], out=out[piece.points])
        return out

    def displacements(self, forces: Array) -> Array:
        """C forces, shape (2n,); only the touched unknowns are computed."""
        loads, out = forces[self.touched], np.zeros(len(forces))
        moved = np.zeros_like(loads)
        for piece in self.pieces:
            pinion, wheel = piece.compliance
            first, end = piece.unknowns.start, piece.unknowns.stop
            middle = first + len(pinion)
            np.dot(pinion, loads[first:middle], out=moved[first:middle])
            np.dot(wheel, loads[middle:end], out=moved[middle:end])
        out[self.touched] = moved
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


def linearised(group: Group, rows: Rows) -> Linear:
    """Matrices of the active points, factorised."""
    at, unknowns, points = rows.at, rows.unknowns, rows.points
    touched = np.zeros(len(group.points), dtype=bool)
    touched[unknowns[:, ::2] // 2] = True
    nodes = np.flatnonzero(touched)
    window = group.node_window[nodes]
    block = 2 * group.position[window] + group.gear[window]
    count = np.bincount(block, minlength=2 * group.size)
    length = 2 * (count[::2] + count[1::2])  # touched unknowns of each position
    column = np.empty(len(touched), dtype=np.int64)
    column[nodes] = 2 * np.arange(len(nodes)) - (np.cumsum(length) - length)[group.position[window]]
    active = np.bincount(at, minlength=group.size)
    row = np.arange(len(at)) - (np.cumsum(active) - active)[at]
    area = active * length
    slot = (np.cumsum(area) - area)[at] + row * length[at]
    slots = slot[:, None] + column[unknowns // 2] + np.tile([0, 1], 6)
    opening, weighted = np.zeros(area.sum()), np.zeros(area.sum())
    opening[slots] = group.parameter[points][:, None] * rows.opening
    weighted[slots] = rows.area[:, None] * rows.normal
    # unknowns and stress rows within their blocks
    local = ((2 * (nodes - group.first_node[group.block_window[block]]))[:, None] + np.arange(2)).ravel()
    own = 2 * at + group.gear[group.owner[points]]
    stress = points - group.first_point[group.block_window[own]]
    rows_of_block, columns_of_block = np.bincount(own, minlength=2 * group.size).tolist(), (2 * count).tolist()
    pieces: list[Piece] = []
    top = left = start = 0
    for b in np.flatnonzero(active).tolist():
        a, t = rows_of_block[2 * b] + rows_of_block[2 * b + 1], columns_of_block[2 * b] + columns_of_block[2 * b + 1]
        part = slice(start, start + a * t)
        scaled, loads = opening[part].reshape(a, t), weighted[part].reshape(a, t)
        response, compliance = np.empty((a, t)), []
        r = c = 0
        for k in (2 * b, 2 * b + 1):
            matrix, rr, cc = group.blocks[k].matrix, r + rows_of_block[k], c + columns_of_block[k]
            used = local[left + c : left + cc]
            compliance.append(matrix[used[:, None], used])
            np.matmul(scaled[:, c:cc], compliance[-1], out=response[:, c:cc])
            if group.stressed is not None and rr > r:
                chosen = stress[top + r : top + rr] + len(group.blocks[k].forces)
                response[r:rr, c:cc] += matrix[chosen[:, None], used]
            r, c = rr, cc
        m = response @ loads.T
        m.flat[:: a + 1] += 1.0
        # the transposed matrix is what LAPACK sees in C order: factorise that, solve transposed, and nothing is copied
        factor = dgetrf(m.T, overwrite_a=1)[:2]
        both = (compliance[0], compliance[1])
        pieces.append(Piece(factor, response, both, b, slice(top, top + a), slice(left, left + t)))
        top, left, start = top + a, left + t, start + a * t
    return Linear(pieces, (2 * nodes[:, None] + np.arange(2)).ravel())


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


def iterate(group: Group, pressure: Array, forces: Array, rigid: Projection, tolerance: float) -> Outcomes:
    """Solve all positions of the group from guessed pressures (Pa) and forces (N)."""
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
        rows = rows_of(group, motion, np.flatnonzero(active))
        enough = np.maximum(tolerance, _rounding(group, motion))
        done = live & (motion.residual < enough)
        done &= _unbalanced(group, motion, rows) < 10 * tolerance
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
    before = np.einsum("ij,ij->i", rows.opening, motion.displacement[rows.unknowns])
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
    added = still
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
