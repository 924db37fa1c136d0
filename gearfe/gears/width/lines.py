r"""Lines of contact of all tooth pairs at one position, and how they share a load.

A line is a tooth pair k over the common width; its point at z has the pair angle
:math:`\psi = \varphi + \kappa z + 2\pi k/z_1 - \tfrac12 i\theta` of `.pair_law`, where the pair has its first contact
t, its arms, and its compliance. Their loaded parts are divided at all kinks of the gap and of the compliance, and
have Gauss points with weights w in each stretch. With the gap d of `.flanks`, a twist :math:`\theta` and the
forces F of the points, f = F/w per width,

.. math::
    g_j = \bar r_j(\theta - t_j) - d_j - C_j(f_j)\,f_j - \sum_l T_{jl}\,F_l \le 0, \quad F_j \ge 0, \quad g_j F_j = 0 .

:math:`T_{jl} = \sum_{gears} v_j H_{k_j - k_l} v_l` is the influence between all points of all lines, with
:math:`v = N(s)\otimes n\otimes P(z)` the stations' and Legendre functions there. The torque on the wheel is
:math:`\sum (1 + \delta_j)\,r_2 F`, the derivative of the energy with the twist at a pinion angle: the pair angle moves
back as the twist grows, so that the approach grows by :math:`r_2` per twist, and under load by the excess
:math:`\delta_j(f_j)` of `.pair_law` more. Unknowns are the moments :math:`m = r_2 F`, whose points touch at the twist
:math:`\theta - (\bar r(\theta - t) - d)/r_2`; T is that of the twist at which points are placed, which is the
solution's to `PLACED`.

Newton's method with an active set solves it at a given twist or, with the twist bordered, at a given torque. The
tangent over twist and tilts follows from the same matrix: :math:`B^T(T + c')^{-1}B` over the loaded points, where the
twist has :math:`d((1 + \delta)\,m)/dm` in B.

**Ends of the load.** A loaded part of a line ends where the approach that is left to the contacts,
:math:`\bar r(\theta - t) - d - \sum_l T_l F_l`, vanishes. It is evaluated at any places
of the lines, all kinks among them. Points are placed on the loaded parts that follow from it, until these agree with
those of the points to `ENDS_PLACED`. The load vanishes at its ends, so that an error of an end enters the solution by
its square only.

**Kinks** are the ends of the path of contact, beyond which tips may be loaded, kinks of the profiles, and those of the
material over roll and z: where end reliefs and reliefs of corners begin, and lines of measured grids. Gauss points that
straddle where an end relief begins, with ends of the load between them, err by up to 9 % of the peak to peak of the
transmission error.

**Free ends.** Close to an end of a gear the contact under a line load is more compliant than in plane strain, down to
the width of its pressure. The finite elements contain this for bumps of half width a only. Between a and the half
width b of the contact, the half-plane's :math:`2/(\pi E')` grows at the distance :math:`\zeta` from the end by

.. math::
    A\,\frac{\nu^2}{1-\nu^2}\,\ln\frac{a\,w(\zeta/a)}{b\,w(\zeta/b)}, \qquad w(x) = x + \frac{k}{1 + q x} .

A, k and q (`AT_END`) are those of an elastic block with a free end under elliptic pressures, by finite elements that
resolve it (`scripts/benchmarks/calibrate_free_ends.py`); at the very end A is the law of the quarter-space's corner.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...base.typing import Array, BoolArray, IntArray
from ..contact.position import joined, of_positions, ranges, taken
from .compliance import WideCompliance, legendre
from .flanks import WideFlanks
from .mesh import WideMesh
from .pair_law import PairLaw, pair_law

#: Gauss points of a line over the whole width for each function of the load, by the root of its share of the width;
#: the least for a stretch.
POINTS_PER_FUNCTION, LEAST_POINTS = 2.0, 4
#: Change of the twist, in parts of its way since the first touch, and of the ends of the load, in parts of its length,
#: that end the placing of points. How often they are placed, and how often the ends may change.
PLACED, ENDS_PLACED, PLACINGS, FREE_PLACINGS = 2e-3, 1e-3, 12, 8
#: Steps in which any number of points may lose their load or be let in. That converges in a few steps or runs in a
#: circle; afterwards one does at a time, along the way of the convex problem of the moments, which has no circles.
QUICK_STEPS = 15
#: Change of the moments in parts of their sum in a whole step, below which another point is let in.
ONE_BY_ONE = 1e-3
#: Newton steps, and the overlap (m) of a point that carries nothing that is none.
STEPS, CLOSED = 300, 1e-12
#: Change of the moments in parts of their sum in the last step, and in that for points that may be placed anew. The
#: iteration converges quadratically: what is left after it is about the square.
SETTLED, ROUGH = 1e-9, 3e-3
#: A, k and q of free ends at Poisson's ratios (-), within 2 % of the resolved block.
AT_END = {0.2: (2.79, 0.264, 2.03), 0.3: (2.35, 0.301, 1.60), 0.4: (2.13, 0.329, 1.43)}
#: Least roll length (modules) for the curvature that the half widths at free ends follow from.
LEAST_ROLL = 0.2
#: Least derivative of c in parts of c/M under the lightest load, so that no contact yields less under more load.
STIFFEST = 0.05
#: Least twist beyond the first touch that points are placed for, in those of a usual stiffness.
LEAST_AHEAD = 0.1
#: Intervals between the places of a loaded part at which its line load is computed, for a stretch by the root of its
#: share, and the least of a stretch.
DENSE, LEAST_DENSE = 32, 4
#: Steps to the line load of an approach, their change of its logarithm at the end, and the least approach looked for
#: in parts of the largest.
LOAD_STEPS, LOAD_SETTLED, LEAST_LEFT = 30, 1e-10, 1e-12
#: Gauss points over the load of what a contact stores.
ENERGY_POINTS = 5
#: Least length (widths) of a stretch that begins or ends at a kink, and of a loaded part.
LEAST_STRETCH, SHORTEST = 1e-3, 1e-9
#: Places on a line at which its gap is looked at; distance of those beside an end of the load in parts of its length.
LOOKS, BESIDE = 21, 0.01
#: Functions of the load of all positions that are solved side by side: large arrays cost less per position, and more
#: memory. Numbers that a position has for its lines.
BATCH, KEYS = 1000, 1 << 32
#: Steps by secants to where a line crosses a seam of the material.
SECANTS = 4


@dataclass(frozen=True)
class ContactLines:
    """Elastic gears with their flanks, ready for positions; `contact_lines` makes it and says what is in it."""

    compliance: WideCompliance
    flanks: WideFlanks
    law: PairLaw
    density: float = POINTS_PER_FUNCTION

    def with_flanks(self, flanks: WideFlanks) -> ContactLines:
        """Return the same gears with other flanks; with the same profiles that costs nothing."""
        if flanks.profiles == self.flanks.profiles:
            return replace(self, flanks=flanks)
        return contact_lines(self.compliance, flanks, density=self.density)

    def gap(self, z: Array, rows: Rows, pair: IntArray, tilt: Array | float = 0.0) -> Array:
        """Return the gap d (m) of tooth pairs, shape (n,).

        Parameters
        ----------
        z : ndarray, shape (n,)
            Axial coordinates (m).
        rows : Rows
            Tables of the pair's law there.
        pair : ndarray, shape (n,)
            Tooth pairs.
        tilt : ndarray, shape (n,)
            Tilts in the plane of action beside that of the flanks (rad).
        """
        flanks, mesh = self.flanks, self.compliance.mesh
        gap = np.zeros(len(z))
        for gear, tooth in enumerate((pair, -1 - pair)):
            gap -= flanks.material(gear, rows.roll[:, gear], z, tooth, mesh.faces[gear])
            gap -= flanks.profiles[gear].turn_of(tooth) * (rows.arm if gear else rows.pinion_arm)
        levers, misalignment = self.levers(z, rows), flanks.misalignment
        return np.asarray(gap - levers[:, 0] * (misalignment.in_plane + tilt) - levers[:, 1] * misalignment.across)

    def levers(self, z: Array, rows: Rows) -> Array:
        """Approach of the flanks at z (m) per tilt in the plane of action and across it, shape (n, 2) (m/rad)."""
        seen = rows.normal / self.law.forward
        off = z - 0.5 * sum(self.compliance.mesh.zone)
        return np.stack([off * seen.real, -off * seen.imag], axis=1)


def contact_lines(
    compliance: WideCompliance, flanks: WideFlanks | None = None, *, density: float = POINTS_PER_FUNCTION
) -> ContactLines:
    """Prepare elastic gears with their flanks for positions: seconds for new profiles, then from the cache.

    Parameters
    ----------
    compliance : WideCompliance
        The gears.
    flanks : WideFlanks
        Their flanks; without modifications if not given.
    density
        Points of a line over the whole width, for each function of the load.
    """
    flanks = WideFlanks() if flanks is None else flanks
    return ContactLines(compliance, flanks, pair_law(compliance, flanks.profiles), density)


@dataclass(frozen=True)
class Rows:
    """The tables of `PairLaw` at n pair angles; see there."""

    touch: Array
    arm: Array
    pinion_arm: Array
    normal: Array
    point: Array
    roll: Array
    arc: Array
    tooth_normal: Array
    yields: Array
    excess: Array

    @cached_property
    def slopes(self) -> Array:
        """Slopes of the cubics between the loads of C, shape (n, loads)."""
        return _slopes(self.yields)

    @cached_property
    def excess_slopes(self) -> Array:
        """Slopes of the cubics between the loads of delta, shape (n, loads)."""
        return _slopes(self.excess)


def rows_at(law: PairLaw, angle: Array) -> Rows:
    """Tables of a pair's law, linear between their marks, at pair angles (rad), shape (n,)."""
    i = np.clip(np.searchsorted(law.angle, angle, side="right") - 1, 0, len(law.angle) - 2)
    share = (angle - law.angle[i]) / (law.angle[i + 1] - law.angle[i])

    below = law.packed[i]
    packed = below + share[:, None] * (law.packed[i + 1] - below)
    return Rows(
        touch=packed[:, 0],
        arm=packed[:, 1],
        pinion_arm=packed[:, 2],
        normal=packed[:, 3] + 1j * packed[:, 4],
        point=packed[:, 5] + 1j * packed[:, 6],
        roll=packed[:, 7:9],
        arc=packed[:, 9:11],
        tooth_normal=packed[:, 11:15].reshape(-1, 2, 2),
        yields=packed[:, 15 : 15 + len(law.forces)],
        excess=packed[:, 15 + len(law.forces) :],
    )


@dataclass(frozen=True)
class Points:
    """Points of the lines of contact of a position, n of them; or of m positions: all shapes then begin with m.

    Attributes
    ----------
    z, weight : ndarray, shape (n,)
        Axial coordinates and Gauss weights (m).
    real : ndarray of bool, shape (n,)
        Whether it is a point: positions with fewer points have their last one again, which does not count.
    pair : ndarray, shape (n,)
        Tooth pairs.
    rows : Rows
        Tables of the pair's law there.
    touch : ndarray, shape (n,)
        Twist at which a point touches (rad).
    levers : ndarray, shape (n, 3)
        Twist of the wheel that a unit of twist, tilt in the plane of action and tilt across are worth (-).
    influence : ndarray, shape (n, n)
        T (rad/(N m)).
    """

    z: Array
    weight: Array
    real: BoolArray
    pair: IntArray
    rows: Rows
    touch: Array
    levers: Array
    influence: Array

    def __len__(self) -> int:
        return len(self.z)


def _slopes(values: Array) -> Array:
    """Mean slopes on both sides of each load, per spacing of the loads, shape (n, loads)."""
    between = np.diff(values)
    return np.concatenate([between[..., :1], 0.5 * (between[..., :-1] + between[..., 1:]), between[..., -1:]], axis=-1)


@dataclass(frozen=True)
class Looks:
    """Places on all lines that can meet at pinion angles and twists, q of them, by position, tooth pair and z.

    Attributes
    ----------
    position, pair : ndarray, shape (q,)
        Numbers of the positions, and tooth pairs.
    z : ndarray, shape (q,)
        Axial coordinates (m), with the ends of the lines and the kinks of their gaps.
    kink : ndarray of bool, shape (q,)
        Whether the gap or the compliance has a kink there.
    rows : Rows
        Tables of the pair's law there.
    first : ndarray, shape (q,)
        Twist of the first contact at this pair angle (rad).
    least : ndarray, shape (positions,)
        Twist at which the rigid gears touch first (rad), infinite where they do not.
    """

    position: IntArray
    pair: IntArray
    z: Array
    kink: BoolArray
    rows: Rows
    first: Array
    least: Array


def look_at(
    lines: ContactLines,
    angle: ArrayLike,
    twist: ArrayLike = 0.0,
    tilt: ArrayLike = 0.0,
    runs: Runs | None = None,
    chosen: IntArray | None = None,
) -> Looks:
    """Look at the gaps along all lines that can meet at pinion angles.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle, twist, tilt : array_like, shape (m,)
        Pinion angles, twists of the wheel, and tilts in the plane of action beside that of the flanks (rad).
    runs : Runs, optional
        Loaded parts, whose ends are among the places, with two more beside each.
    chosen : ndarray of int, optional
        Numbers of the positions that are looked at; all without it.
    """
    mesh, law, flanks = lines.compliance.mesh, lines.law, lines.flanks
    angle, twist, tilt = np.broadcast_arrays(np.atleast_1d(angle), twist, tilt)
    middle, cycle, turn = _middle(lines, angle, twist), *_pitches(mesh)
    chosen = np.arange(len(middle)) if chosen is None else chosen
    low, high = np.sort(middle[chosen, None] + turn * np.array(mesh.zone), axis=1).T
    lowest = np.ceil((law.angle[0] - high) / cycle).astype(np.int64)
    count = np.maximum(np.floor((law.angle[-1] - low) / cycle).astype(np.int64) - lowest + 1, 0)
    position, pair = np.repeat(chosen, count), ranges(lowest, count)
    psi, (first, last) = (middle[position] + cycle * pair)[:, None], np.broadcast_to(mesh.zone, (len(pair), 2)).T
    marks = np.zeros((len(pair), 0))
    if turn:
        ends = np.sort((law.angle[[0, -1]] - psi) / turn, axis=1)
        first, last = np.maximum(first, ends[:, 0]), np.minimum(last, ends[:, 1])
        marks = (law.marks - psi) / turn
    z = first[:, None] + (last - first)[:, None] * np.linspace(0.0, 1.0, LOOKS)
    kinks = [marks]
    for gear, face in enumerate(mesh.faces):
        seams = flanks.kinks(gear, face)
        if seams[:, 1].any():
            kinks.append(_kinks(seams, z, psi, turn, law.angle, law.roll[:, gear]))
        elif len(seams):
            kinks.append(np.broadcast_to(seams[:, 2] / seams[:, 0], (len(pair), len(seams))))
    at = np.concatenate(kinks, axis=1)
    inside = (at > first[:, None]) & (at < last[:, None])
    lines_of, places = [np.repeat(np.arange(len(pair)), LOOKS), np.nonzero(inside)[0]], [z.ravel(), at[inside]]
    if runs is not None:
        of_runs, known = _found(_keys(position, pair), runs.keys)
        beside = BESIDE * (runs.end - runs.start)
        ends = np.stack([end + i * beside for end in (runs.start, runs.end) for i in (-1.0, 0.0, 1.0)], axis=1)
        ends, of_ends = ends[known].ravel(), np.repeat(of_runs[known], 6)
        known = (ends > first[of_ends]) & (ends < last[of_ends])
        lines_of, places = [*lines_of, of_ends[known]], [*places, ends[known]]
    kink = np.repeat([False, True, False], [z.size, len(places[1]), sum(map(len, places[2:]))])
    line, z = np.concatenate(lines_of), np.concatenate(places)
    order = np.lexsort((z, line))
    line, z, kink = line[order], z[order], kink[order]
    return _looks(lines, middle, tilt, position[line], pair[line], z, kink)


def _looks(
    lines: ContactLines, middle: Array, tilt: Array, position: IntArray, pair: IntArray, z: Array, kink: BoolArray
) -> Looks:
    """Look at places; `middle`, `tilt`: pair angles of pair 0 at z = 0, and further tilts, of the positions (rad)."""
    cycle, turn = _pitches(lines.compliance.mesh)
    rows = rows_at(lines.law, middle[position] + cycle * pair + turn * z)
    first = rows.touch + lines.gap(z, rows, pair, tilt[position]) / mean_arm(lines, rows)
    least = np.full(len(middle), math.inf)
    np.minimum.at(least, position, first)
    return Looks(position, pair, z, kink, rows, first, least)


def _pitches(mesh: WideMesh) -> tuple[float, float]:
    """Pair angle from one pair to the next (rad), and its growth along z (rad/m)."""
    return mesh.sections.mesh_cycle, mesh.turns[0]


def _keys(position: IntArray, pair: IntArray) -> IntArray:
    """Return one number for each line, which rises with position and tooth pair."""
    return position * KEYS + pair


def _found(keys: IntArray, wanted: IntArray) -> tuple[IntArray, BoolArray]:
    """Return where rising `keys` have those wanted, and whether they do; the place is 0 where they do not."""
    at = np.searchsorted(keys, wanted)
    known = np.append(keys, 0)[at] == wanted
    known &= at < len(keys)
    return np.where(known, at, 0), known


def _starts(keys: IntArray) -> IntArray:
    """Return where each number of sorted keys begins."""
    return np.flatnonzero(np.diff(keys, prepend=keys[:1] - 1))


def _kinks(seams: Array, z: Array, psi: Array, turn: float, angle: Array, roll: Array) -> Array:
    """Return where lines cross seams a z + b s = c of a flank, shape (lines, seams); NaN where they do not.

    Parameters
    ----------
    seams : ndarray, shape (seams, 3)
        a, b, c.
    z : ndarray, shape (lines, looks)
        Axial coordinates along the lines (m).
    psi : ndarray, shape (lines, 1)
        Pair angles of the lines at z = 0 (rad).
    turn : float
        Their growth along z (rad/m).
    angle, roll : ndarray, shape (n,)
        Table of roll lengths s (m) over rising pair angles (rad).
    """
    a, b, c = seams.T[:, :, None, None]
    side = a * z + b * np.interp(psi + turn * z, angle, roll) - c
    crossed = (side[..., :-1] > 0.0) != (side[..., 1:] > 0.0)
    i = crossed.argmax(axis=-1)[..., None]
    before, behind = (np.take_along_axis(side, i + k, axis=-1)[..., 0] for k in (0, 1))
    low, high = (np.take_along_axis(np.broadcast_to(z, side.shape), i + k, axis=-1)[..., 0] for k in (0, 1))
    a, b, c = (one[..., 0] for one in (a, b, c))
    at = np.full(low.shape, np.nan)
    for _ in range(SECANTS):  # roll lengths have a kink at an end of the path
        share = np.divide(before, before - behind, out=np.full(before.shape, np.nan), where=crossed.any(axis=-1))
        at = low + np.clip(share, 0.0, 1.0) * (high - low)
        off = a * at + b * np.interp(psi[:, 0] + turn * at, angle, roll) - c
        same = (off > 0.0) == (before > 0.0)
        low, before = np.where(same, at, low), np.where(same, off, before)
        high, behind = np.where(same, high, at), np.where(same, behind, off)
    return np.asarray(at.T)


def _middle(lines: ContactLines, angle: Array, twist: Array) -> Array:
    """Pair angles (rad) of pair 0 at z = 0."""
    return angle - 0.5 * lines.compliance.mesh.ratio * twist


@dataclass(frozen=True)
class Runs:
    """Loaded parts of the lines, r of them, by position, tooth pair and z.

    Attributes
    ----------
    position, pair : ndarray, shape (r,)
        Numbers of the positions, and tooth pairs.
    start, end : ndarray, shape (r,)
        Between which z (m).
    """

    position: IntArray
    pair: IntArray
    start: Array
    end: Array

    @property
    def keys(self) -> IntArray:
        """Numbers of the lines, shape (r,)."""
        return _keys(self.position, self.pair)

    def near(self, other: Runs, size: int) -> BoolArray:
        """Return at which of so many positions the ends are those of others, to `ENDS_PLACED` of the lengths."""
        counts, others = (np.bincount(runs.position, minlength=size) for runs in (self, other))
        near = counts == others
        mine, its = (taken(runs, near[runs.position]) for runs in (self, other))
        apart = np.maximum(np.abs(mine.start - its.start), np.abs(mine.end - its.end))
        off = (mine.pair != its.pair) | (apart > ENDS_PLACED * (its.end - its.start))
        near[mine.position[off]] = False
        return near

    def joined(self, others: Runs) -> Runs:
        """Return them with others."""
        both = joined([self, others])
        return taken(both, np.lexsort((both.start, both.pair, both.position)))

    def within(self, looks: Looks) -> Runs:
        """Return what of them is on the lines that were looked at."""
        keys = _keys(looks.position, looks.pair)
        begin = _starts(keys)
        line, kept = _found(keys[begin], self.keys)
        stop = np.append(begin[1:], len(keys)) - 1
        line = line[kept]
        start = np.maximum(self.start[kept], looks.z[begin[line]])
        end = np.minimum(self.end[kept], looks.z[stop[line]])
        long = end - start > SHORTEST * np.ptp(looks.z)
        return Runs(self.position[kept][long], self.pair[kept][long], start[long], end[long])


#: No loaded part.
NO_RUNS = Runs(*np.zeros((2, 0), dtype=np.int64), *np.zeros((2, 0)))


def _runs(looks: Looks, left: Array) -> Runs:
    """Return where the approach `left` to the contacts is positive; it is straight between the places."""
    keys, z = _keys(looks.position, looks.pair), looks.z
    loaded, same = left > 0.0, keys[1:] == keys[:-1]
    size = np.abs(left)
    zero = z[:-1] + np.diff(z) * np.divide(size[:-1], size[:-1] + size[1:], out=np.zeros(len(same)), where=same)
    starts = np.where(np.append(False, same & ~loaded[:-1]), np.append(0.0, zero), z)
    ends = np.where(np.append(same & ~loaded[1:], False), np.append(zero, 0.0), z)
    first = loaded & np.append(True, ~(same & loaded[:-1]))
    last = loaded & np.append(~(same & loaded[1:]), True)
    return Runs(looks.position[first], looks.pair[first], starts[first], ends[last])


def mean_arm(lines: ContactLines, rows: Rows) -> Array:
    """Approach of the flanks per twist from their first contact (m), shape (n,)."""
    return np.asarray(0.5 * (rows.arm + lines.compliance.mesh.ratio * rows.pinion_arm))


@dataclass(frozen=True)
class Placing:
    """Points that are placed at m positions, n at most at one of them.

    Attributes
    ----------
    position, twist : ndarray, shape (m,)
        Rising numbers of the positions, and the twists for which the points are placed (rad).
    points : Points
        Points of the positions.
    count : ndarray, shape (m,)
        Points of each position.
    row, column : ndarray, shape (q,)
        Position and number of all points, one after the other.
    keys : ndarray, shape (q,)
        Numbers of their lines.
    loads : list of ndarray, shapes (q, size)
        Unit forces of the points on the stations and functions of both gears.
    stretches
        Stretches that have the points.
    """

    position: IntArray
    twist: Array
    points: Points
    count: IntArray
    row: IntArray
    column: IntArray
    keys: IntArray
    loads: list[Array]
    stretches: Runs

    def flat(self, values: Array) -> Array:
        """Return the values of all points, shape (q,), of those by position, shape (m, n)."""
        return np.asarray(values[self.row, self.column])

    def of_position(self, i: int) -> Points:
        """Return the points of the i-th position."""
        kept = slice(0, int(self.count[i]))
        return replace(taken(self.points, (i, kept)), influence=self.points.influence[i, kept, kept])


def place_points(
    lines: ContactLines, angle: Array, twist: Array, tilt: Array, chosen: IntArray, looks: Looks, runs: Runs
) -> Placing:
    """Place points on the loaded parts of all lines, which are divided at their kinks.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle, twist, tilt : ndarray, shape (positions,)
        As those of `look_at`.
    chosen : ndarray, shape (m,)
        Rising numbers of the positions.
    looks : Looks
        Kinks of the lines there.
    runs : Runs
        Loaded parts at these positions alone.
    """
    mesh, law, (cycle, turn) = lines.compliance.mesh, lines.law, _pitches(lines.compliance.mesh)
    stretches = _stretches(looks, runs, LEAST_STRETCH * mesh.width)
    middle, half = 0.5 * (stretches.start + stretches.end), 0.5 * (stretches.end - stretches.start)
    counts = np.ceil(lines.density * mesh.count * np.sqrt(2.0 * half / mesh.width) - 1e-9).astype(np.int64)
    counts = np.maximum(LEAST_POINTS, counts)
    x, weight = np.concatenate([np.zeros((2, 0)), *(_gauss(count) for count in counts.tolist())], axis=1)
    of = np.repeat(np.arange(len(counts)), counts)
    z, weight, pair, position = middle[of] + half[of] * x, half[of] * weight, stretches.pair[of], stretches.position[of]
    rows = rows_at(law, _middle(lines, angle, twist)[position] + turn * z + cycle * pair)
    levers = np.concatenate([np.ones((len(z), 1)), lines.levers(z, rows) / rows.arm[:, None]], axis=1)
    first = rows.touch + lines.gap(z, rows, pair, tilt[position]) / mean_arm(lines, rows)
    rows = _with_ends(lines, z, rows)
    loads, keys = _loads(lines.compliance, z, rows), _keys(position, pair)
    end = np.searchsorted(position, chosen, side="right")
    count = np.diff(end, prepend=0)
    row, column = np.repeat(np.arange(len(chosen)), count), ranges(np.zeros_like(count), count)
    place = (end - count)[:, None] + np.minimum(np.arange(count.max(initial=0)), count[:, None] - 1)
    at_place = taken(rows, place)
    points = Points(
        z=z[place],
        weight=weight[place],
        real=np.arange(place.shape[1]) < count[:, None],
        pair=pair[place],
        rows=at_place,
        touch=_touch(lines, rows, first, twist[position])[place],
        levers=levers[place],
        influence=_influence(lines.compliance, loads, keys, row, column, place.shape)
        / (at_place.arm[:, :, None] * at_place.arm[:, None]),
    )
    return Placing(chosen, twist[chosen], points, count, row, column, keys, loads, stretches)


def _stretches(looks: Looks, runs: Runs, least: float) -> Runs:
    """Divide runs at kinks that are `least` (m) apart, in the order of positions, tooth pairs and z."""
    z, keys = looks.z[looks.kink], _keys(looks.position, looks.pair)[looks.kink]
    order = np.lexsort((np.concatenate([runs.start, z]), np.concatenate([runs.keys, keys])))
    run = np.empty(len(order), dtype=np.int64)
    run[order] = np.cumsum(order < len(runs.start)) - 1  # the last one that begins before a kink, -1 where none does
    run = run[len(runs.start) :]
    low, high = np.append(runs.start, math.inf)[run], np.append(runs.end, math.inf)[run]
    kept = (np.append(runs.keys, 0)[run] == keys) & (z > low + least) & (z < high - least)
    z, run = z[kept], run[kept]
    kept = np.append(True, (np.diff(run) > 0) | (np.diff(z) > least))[: len(z)]  # kinks of both gears may be one
    z, run = z[kept], run[kept]
    of_run = np.concatenate([np.arange(len(runs.start)), run])
    low, high = np.concatenate([runs.start, z]), np.concatenate([runs.end, z])
    run = np.sort(of_run)
    low, high = low[np.lexsort((low, of_run))], high[np.lexsort((high, of_run))]
    return Runs(runs.position[run], runs.pair[run], low, high)


@cache
def _gauss(count: int) -> Array:
    """Gauss points and weights on (-1, 1), shape (2, count)."""
    return np.stack(np.polynomial.legendre.leggauss(count))


@dataclass(frozen=True)
class _Densities:
    """Moments per width (N) at q places along lines, by the lines' numbers `keys` and z (m)."""

    keys: IntArray
    z: Array
    density: Array

    def at(self, keys: IntArray, z: Array) -> Array:
        """Return them at other places, shape (p,): straight between those known on a line, 0 on other lines."""
        start = _starts(self.keys)
        line, known = _found(self.keys[start], keys)
        if not known.any():
            return np.zeros(len(z))
        stop = np.append(start[1:], len(self.keys)) - 1
        apart = 2.0 * (np.ptp(self.z) + np.ptp(z))  # of lines in one row
        row = np.repeat(np.arange(len(start)), np.diff(start, append=len(self.keys)))
        within = np.clip(z, self.z[start[line]], self.z[stop[line]])
        return np.where(known, np.interp(line * apart + within, row * apart + self.z, self.density), 0.0)


#: No load.
NO_LOADS = _Densities(np.zeros(0, dtype=np.int64), *np.zeros((2, 0)))


def _touch(lines: ContactLines, rows: Rows, first: Array, twist: Array) -> Array:
    """Twist (rad) at which places touch, to first order from twists (rad); `first`: that of their first contact."""
    return np.asarray(twist - mean_arm(lines, rows) * (twist - first) / rows.arm)


def _with_ends(lines: ContactLines, z: Array, rows: Rows) -> Rows:
    """Tables at z (m) with what free ends of the gears add to C."""
    return replace(rows, yields=_rising(rows.yields + _softer_ends(lines, z, rows), lines.law.forces))


def _softer_ends(lines: ContactLines, z: Array, rows: Rows) -> Array:
    """What free ends of the gears add to the approach of half-planes per force per width (m2/N), shape (n, loads)."""
    compliance, forces = lines.compliance, lines.law.forces
    mesh, added = compliance.mesh, np.zeros((len(z), len(forces)))
    if mesh.count == 1:
        return added
    soft = sum(side.local.inverse_modulus for side in compliance.sides)
    rolls = np.maximum(np.abs(rows.roll), LEAST_ROLL * mesh.module) * [1, mesh.sections.sign]
    radius = rolls.prod(axis=1) / rolls.sum(axis=1)
    hertz = np.sqrt(4.0 / math.pi * soft * radius[:, None] * forces)
    for side, material, face in zip(compliance.sides, mesh.materials, mesh.faces, strict=True):
        nu = material.poisson_ratio
        grows, k, q = (np.interp(nu, list(AT_END), column) for column in zip(*AT_END.values(), strict=True))
        scale = 2.0 / math.pi * side.local.inverse_modulus * grows * nu**2 / (1.0 - nu**2)
        bump = side.usual_bump
        half = np.minimum(hertz, bump)
        for end in face:
            apart = np.abs(z - end)[:, None]
            wide, narrow = (apart + a * k / (1.0 + q * apart / a) for a in (bump, half))
            added += scale * np.log(wide / narrow)
    return added


def _rising(yields: Array, forces: Array) -> Array:
    """Raise C (m2/N) under heavy loads so far that the approach C f rises with f by `STIFFEST` at least.

    Half-planes under loads beyond all materials yield less under more load. The problem of the moments would have
    several solutions there.
    """
    least = STIFFEST * yields[:, :1]
    return np.asarray(np.maximum.accumulate((yields - least) * forces, axis=1) / forces + least)


def _loads(compliance: WideCompliance, z: Array, rows: Rows) -> list[Array]:
    """Return the loads of unit forces at points on the stations and functions of both gears, shapes (n, size)."""
    mesh = compliance.mesh
    over_width = legendre(z, mesh.zone, mesh.count)
    values = compliance.shapes.values_at(rows.arc)
    loads = []
    for gear, side in enumerate(compliance.sides):
        size = len(side.local.stations)
        load = values[:, gear, :size, None] * rows.tooth_normal[:, gear, None]
        loads.append((load[..., None] * over_width[:, None, None]).reshape(len(z), 2 * size * mesh.count))
    return loads


def _influence(
    compliance: WideCompliance,
    loads: list[Array],
    keys: IntArray,
    row: IntArray,
    column: IntArray,
    shape: tuple[int, int],
) -> Array:
    """Return the approach of the flanks at points per force at those of the same position (m/N), shape (m, n, n).

    Parameters
    ----------
    compliance : WideCompliance
        The gears.
    loads : list of ndarray, shapes (q, size)
        Loads of the points on both gears.
    keys, row, column : ndarray, shape (q,)
        As those of `Placing`.
    shape
        m and n.
    """
    found = np.zeros((*shape, shape[1]))
    start = _starts(keys)
    size = np.diff(start, append=len(keys))
    position, first, last = row[start].tolist(), column[start].tolist(), (column[start] + size).tolist()
    for gear, (side, load) in enumerate(zip(compliance.sides, loads, strict=True)):
        for step in range(compliance.steps + 1):
            # the wheel's teeth count the other way round
            on_line, known = _found(keys[start], keys[start] + step * (1 - 2 * gear))
            source = np.flatnonzero(known)
            square = side.influence[step].reshape(load.shape[1], load.shape[1])
            sources = load[ranges(start[source], size[source])] if step else load
            moved = sources @ (square.T if step else square)
            end = 0
            for i, j in zip(on_line[source].tolist(), source.tolist(), strict=True):
                begin, end = end, end + last[j] - first[j]
                block = load[start[i] : start[i] + size[i]] @ moved[begin:end].T
                felt, loaded = slice(first[i], last[i]), slice(first[j], last[j])
                if step == 0:
                    found[position[i], felt, loaded] += 0.5 * (block + block.T)
                else:
                    found[position[i], felt, loaded] += block
                    found[position[i], loaded, felt] += block.T
    return found


def _approach_left(
    lines: ContactLines, looks: Looks, left: Array, sources: IntArray, loads: list[Array], force: Array
) -> Array:
    """Twist (rad) left to the contacts themselves at the places looked at, shape (q,); that of rigid gears below 0.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    looks : Looks
        The places.
    left : ndarray, shape (q,)
        Twist beyond that at which the rigid flanks touch there (rad).
    sources : ndarray, shape (p,)
        Numbers of the lines of points.
    loads : list of ndarray, shapes (p, size)
        Loads of unit forces at these points on both gears.
    force : ndarray, shape (p,)
        Forces there (N).
    """
    compliance, rows = lines.compliance, taken(looks.rows, overlaps := left > 0.0)  # without which nothing is loaded
    mesh, keys = compliance.mesh, _keys(looks.position[overlaps], looks.pair[overlaps])
    begin, loaded = _starts(keys), _starts(sources)
    spans = [slice(*span) for span in itertools.pairwise([*begin.tolist(), len(keys)])]
    over_width = legendre(looks.z[overlaps], mesh.zone, mesh.count)
    values = compliance.shapes.values_at(rows.arc)
    approach = np.zeros(len(keys))
    for gear, (side, load) in enumerate(zip(compliance.sides, loads, strict=True)):
        size = load.shape[1]
        total = np.add.reduceat(force[:, None] * load, loaded, axis=0) if len(loaded) else np.zeros((0, size))
        sums = np.zeros((len(begin), size))
        for step in range(-compliance.steps, compliance.steps + 1):
            source, known = _found(sources[loaded], keys[begin] - step * (1 - 2 * gear))
            square = side.influence[abs(step)].reshape(size, size)
            sums[known] += total[source[known]] @ (square.T if step >= 0 else square)
        moved = sums.reshape(len(begin), size // mesh.count, mesh.count)
        along = np.zeros((len(keys), moved.shape[1]))
        for span, of_line in zip(spans, moved, strict=True):
            along[span] = over_width[span] @ of_line.T
        shape = values[:, gear, : len(side.local.stations), None] * rows.tooth_normal[:, gear, None]
        approach += (shape.reshape(along.shape) * along).sum(axis=1)
    left = left.copy()
    left[overlaps] -= approach / rows.arm
    return left


def own_twists(law: PairLaw, rows: Rows, moment: Array) -> tuple[Array, Array]:
    """How contacts yield at moments per width (N), shape (n,): C f/r_2 (rad) and its derivative (rad per N)."""
    force, spacing = moment / rows.arm, math.log(law.forces[1] / law.forces[0])
    x = np.log(np.maximum(force / law.forces[0], 1e-9)) / spacing
    share, slope, inside = _cubic(rows.yields, rows.slopes, x)
    slope = np.where(x > inside, 0.0, slope)  # beyond the forces of the table C stays, so that C f rises
    share = share + (x - inside) * slope
    rate = np.maximum(share + slope / spacing, STIFFEST * rows.yields[..., 0])
    return share * force / rows.arm, rate / rows.arm**2


def _load_of(law: PairLaw, rows: Rows, left: Array) -> Array:
    """Force per width (N/m) with which contacts yield by twists `left` to them (rad), shape (n,); 0 for none."""
    target = np.maximum(left, LEAST_LEFT * left.max(initial=0.0) + 1e-300)
    moment, change = target * rows.arm**2 / rows.yields[:, 0], math.inf
    for _ in range(LOAD_STEPS):  # of the logarithm of the load, with which that of C f is nearly straight
        twist, rate = own_twists(law, rows, moment)
        step = np.log(target / twist) * twist / (rate * moment)
        moment, change = moment * np.exp(step), np.abs(step).max(initial=0.0)
        if change < LOAD_SETTLED:
            break
    return np.where(left > 0.0, moment / rows.arm, 0.0)


def wheel_moments(law: PairLaw, points: Points, moment: Array) -> tuple[Array, Array]:
    """Moments of the points on the wheel (1 + delta) m (N m), and their derivatives with m = `moment`, shape (n,)."""
    force, spacing = moment / (points.weight * points.rows.arm), math.log(law.forces[1] / law.forces[0])
    x = np.log(np.maximum(force / law.forces[0], 1e-9)) / spacing
    excess, slope, inside = _cubic(points.rows.excess, points.rows.excess_slopes, x)
    slope = np.where(x == inside, slope, 0.0)  # beyond the forces of the table delta stays
    return (1.0 + excess) * moment, 1.0 + excess + slope / spacing


def _cubic(values: Array, slopes: Array, x: Array) -> tuple[Array, Array, Array]:
    """Cubic between the loads of a table at x (in their spacings) within it: value, slope, and that x, shape (n,)."""
    last = values.shape[-1] - 1
    inside = np.minimum(np.maximum(x, 0.0), last)
    i = np.minimum(inside.astype(np.int64), last - 1)
    t, first = inside - i, i + np.arange(0, i.size * (last + 1), last + 1).reshape(i.shape)
    values, slopes = values.ravel(), slopes.ravel()
    a, b, da, db = values[first], values[first + 1], slopes[first], slopes[first + 1]
    c2, c3 = 3 * (b - a) - 2 * da - db, da + db - 2 * (b - a)
    return a + t * (da + t * (c2 + t * c3)), da + t * (2 * c2 + 3 * t * c3), inside


@dataclass(frozen=True)
class Solution:
    """A solved position.

    Attributes
    ----------
    points
        Its points.
    twist
        From where unmodified flanks touch (rad).
    moment : ndarray, shape (n,)
        m = r_2 F of the points (N m), the unknowns.
    wheel_moment : ndarray, shape (n,)
        Moments of the points on the wheel (N m), whose sum is the torque.
    tangent : ndarray, shape (3, 3)
        Torque and moments of the tilts by twist, tilt in the plane of action and tilt across (N m/rad).
    placed
        Twist for which the points are placed (rad).
    stretches
        Loaded parts of the lines between their kinks.
    converged
        Whether the iteration settled.
    steps, placings
        Newton steps, and how often points were placed.
    """

    points: Points
    twist: float
    moment: Array
    wheel_moment: Array
    tangent: Array
    placed: float
    stretches: Runs
    converged: bool
    steps: int
    placings: int

    @property
    def torque(self) -> float:
        """Torque at the wheel (N m)."""
        return float(self.wheel_moment.sum())


@dataclass(frozen=True)
class LineLoads:
    """Line loads along the loaded parts of solved positions, q of them, by position, tooth pair and z.

    Attributes
    ----------
    position, pair : ndarray, shape (q,)
        Numbers of the positions, and tooth pairs.
    z : ndarray, shape (q,)
        Axial coordinates (m).
    roll : ndarray, shape (q, 2)
        Roll lengths on pinion and wheel (m).
    load : ndarray, shape (q,)
        Forces per width (N/m).
    """

    position: IntArray
    pair: IntArray
    z: Array
    roll: Array
    load: Array


def line_loads(lines: ContactLines, angle: Array, solutions: Sequence[Solution]) -> LineLoads:
    """Return line loads at places along the loaded parts of solved positions, their ends and kinks too.

    The line load is the force per width with which the contact yields by the approach that is left to it, as at the
    points of the lines. Where it is larger than on both sides, the place is the vertex of the parabola through all
    three, except at kinks.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle : ndarray, shape (m,)
        Pinion angles (rad).
    solutions : sequence of Solution
        The positions, at least one.
    """
    return joined([_line_loads(lines, angle[of], solutions[of], of.start) for of in _batches(lines, len(solutions))])


def _line_loads(lines: ContactLines, angle: Array, solutions: Sequence[Solution], first: int) -> LineLoads:
    """Line loads of a batch of positions, of which the first has a number."""
    mesh, numbers = lines.compliance.mesh, np.arange(len(solutions))
    parts = joined([replace(one.stretches, position=one.stretches.position + i) for i, one in enumerate(solutions)])
    begins = np.append(True, (np.diff(parts.keys) > 0) | (parts.start[1:] != parts.end[:-1]))[: len(parts.pair)]
    run = np.cumsum(begins) - 1
    length = parts.end - parts.start
    share_of_run = length / np.bincount(run, length)[run]
    counts = np.maximum(LEAST_DENSE, np.ceil(DENSE * np.sqrt(share_of_run)).astype(np.int64))
    # a kink once
    share = [_dense(count)[0 if begin else 1 :] for count, begin in zip(counts.tolist(), begins.tolist(), strict=True)]
    of, x = np.repeat(np.arange(len(share)), [len(one) for one in share]), np.concatenate([np.zeros(0), *share])
    placed, twist = (np.array([getattr(one, name) for one in solutions]) for name in ("placed", "twist"))
    middle, z = _middle(lines, angle, placed), parts.start[of] + length[of] * x
    looks = _looks(lines, middle, np.zeros(len(middle)), parts.position[of], parts.pair[of], z, (x == 0.0) | (x == 1.0))

    points = joined([replace(one.points, influence=np.zeros((len(one.points), 0))) for one in solutions])
    sources = _keys(np.repeat(numbers, [len(one.points) for one in solutions]), points.pair)
    force = np.concatenate([one.moment for one in solutions]) / points.rows.arm
    left = twist[looks.position] - _touch(lines, looks.rows, looks.first, placed[looks.position])
    left = _approach_left(lines, looks, left, sources, _loads(lines.compliance, points.z, points.rows), force)
    load = _load_of(lines.law, _with_ends(lines, z, looks.rows), left)
    tops = np.flatnonzero((load[1:-1] >= load[:-2]) & (load[1:-1] > load[2:]) & ~looks.kink[1:-1]) + 1
    before, top, behind = (z[tops + i] for i in (-1, 0, 1))
    rise, fall = (load[tops] - load[tops - 1]) / (top - before), (load[tops + 1] - load[tops]) / (behind - top)
    bend = (fall - rise) / (behind - before)
    vertex = 0.5 * (before + top - rise / bend)
    load[tops] += (vertex - top) * (rise + bend * (vertex - before))
    z[tops] = vertex
    angles = middle[looks.position] + looks.pair * mesh.sections.mesh_cycle + mesh.turns[0] * z
    return LineLoads(looks.position + first, looks.pair, z, rows_at(lines.law, angles).roll, load)


@cache
def _dense(count: int) -> Array:
    """Ends of so many intervals from 0 to 1, close to each other at both."""
    return np.asarray(0.5 - 0.5 * np.cos(math.pi * np.arange(count + 1) / count))


def solve_position(
    lines: ContactLines, angle: float, *, torque: float | None = None, twist: float | None = None
) -> Solution:
    """Solve the contact at one pinion angle.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle : float
        Pinion angle (rad).
    torque : float, optional
        At the wheel (N m), > 0.
    twist : float, optional
        Of the wheel (rad), from where unmodified flanks touch, instead of `torque`.
    """
    load = {"torque" if twist is None else "twist": np.array([torque if twist is None else twist])}
    return solve_positions(lines, np.array([angle]), **load)[0]


def solve_positions(
    lines: ContactLines,
    angle: Array,
    *,
    torque: Array | None = None,
    twist: Array | None = None,
    tilt: Array | None = None,
) -> list[Solution]:
    """Solve the contact at pinion angles, side by side.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle : ndarray, shape (m,)
        Pinion angles (rad).
    torque : ndarray, shape (m,), optional
        At the wheel (N m), > 0.
    twist : ndarray, shape (m,), optional
        Of the wheel (rad), from where unmodified flanks touch, instead of `torque`.
    tilt : ndarray, shape (m,), optional
        Tilts in the plane of action (rad) beside that of the flanks.
    """
    solved: list[Solution] = []
    tilt = np.zeros(len(angle)) if tilt is None else tilt
    for of in _batches(lines, len(angle)):
        load, held = (None if values is None else values[of] for values in (torque, twist))
        solved += _solved(lines, angle[of], tilt[of], load, held)
    return solved


def _batches(lines: ContactLines, count: int) -> list[slice]:
    """Divide so many positions into batches."""
    size = math.ceil(BATCH / lines.compliance.mesh.count)
    return [slice(start, start + size) for start in range(0, count, size)]


def _solved(
    lines: ContactLines, angle: Array, tilt: Array, torque: Array | None, twist: Array | None
) -> list[Solution]:
    """Solve a batch of positions: place points, balance them, and place them anew until the ends of the load stay."""
    usual, size = lines.compliance.mesh.usual_stiffness, len(angle)
    solved: list[Solution | None] = [None] * size
    if twist is not None:
        at = np.array(twist, dtype=float)
    else:
        assert torque is not None
        at = look_at(lines, angle, tilt=tilt).least + torque / usual
    runs, before, steps = NO_RUNS, NO_LOADS, np.zeros(size, dtype=np.int64)
    active = np.flatnonzero(np.isfinite(at))
    for number in range(1, PLACINGS + 1):
        if not len(active):
            break
        looks = look_at(lines, angle, at, tilt, runs, active)
        touch = _touch(lines, looks.rows, looks.first, at[looks.position])
        rigid = at[looks.position] - touch
        begun = np.isin(looks.position, runs.position)  # the others begin where rigid flanks overlap
        placed = runs.within(looks).joined(_runs(looks, np.where(begun, -1.0, rigid)))
        placing = place_points(lines, angle, at, tilt, active, looks, placed)
        points, load = placing.points, None if torque is None else torque[active]
        balance = _newton(lines, points, _start(lines, placing, before), at[active], load, ROUGH)
        steps[active] += balance.steps
        before = _Densities(placing.keys, placing.flat(points.z), placing.flat(balance.moment / points.weight))

        new, empty = at.copy(), placing.count == 0
        new[active] = balance.twist
        runs = placed
        if number <= FREE_PLACINGS:
            left, force = new[looks.position] - touch, placing.flat(balance.moment / points.rows.arm)
            runs = _runs(looks, _approach_left(lines, looks, left, placing.keys, placing.loads, force))
        way = np.maximum(new[active] - looks.least[active], 0.0)
        near = (np.abs(new[active] - at[active]) <= PLACED * way) & runs.near(placed, size)[active]
        settled = balance.converged & near
        i = np.flatnonzero(settled | ~empty & np.isfinite(balance.twist) & (number == PLACINGS))
        final = _newton(
            lines, taken(points, i), balance.moment[i], balance.twist[i], None if load is None else load[i], SETTLED
        )
        settled[i] &= final.converged
        final = replace(final, converged=settled[i], steps=steps[active[i]] + final.steps)
        for j, solution in zip(active[i].tolist(), _solutions(lines.law, placing, i, final, number), strict=True):
            solved[j] = solution

        if torque is not None and empty.any():
            deepest = np.full(size, -math.inf)
            np.maximum.at(deepest, looks.position, rigid)
            j = active[empty]
            new[j] = at[j] + np.where(deepest[j] > 0.0, 0.0, LEAST_AHEAD * torque[j] / usual - deepest[j])
        at, active = new, active[~settled & np.isfinite(new[active])]
        runs = taken(runs, np.isin(runs.position, active))
    return [_unsolved(lines) if one is None else one for one in solved]


def _unsolved(lines: ContactLines) -> Solution:
    """Return a position that is not solved, without points."""
    zero, number = np.zeros(1), np.zeros(1, dtype=np.int64)
    looks = look_at(lines, zero, chosen=number[:0])
    placing = place_points(lines, zero, zero, zero, number, looks, NO_RUNS)
    balance = _Balance(np.full(1, math.nan), zero[:, None][:, :0], number > 0, number)
    return _solutions(lines.law, placing, number, balance, 0)[0]


def _start(lines: ContactLines, placing: Placing, before: _Densities) -> Array:
    """Return moments (N m) to begin with, shape (m, n): along the lines before, or from the overlap."""
    mesh, points, known = lines.compliance.mesh, placing.points, np.zeros(placing.points.z.shape)
    known[placing.row, placing.column] = before.at(placing.keys, placing.flat(points.z))
    rigid = np.maximum(placing.twist[:, None] - points.touch, 0.0) * (mesh.usual_stiffness / mesh.width)
    density = np.where((known > 0.0).any(axis=1, keepdims=True), known, rigid)
    return np.where(points.real, density * points.weight, 0.0)


@dataclass(frozen=True)
class _Balance:
    """Moments (N m), shape (m, n), of points at twists (rad), shape (m,), that close their gaps where `converged`."""

    twist: Array
    moment: Array
    converged: BoolArray
    steps: IntArray


def _newton(
    lines: ContactLines, points: Points, moment: Array, twist: Array, torque: Array | None, settled: float
) -> _Balance:
    """Solve the complementary problem of the points of m positions, n at each.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    points : Points
        Points.
    moment : ndarray, shape (m, n)
        Moments to begin with (N m).
    twist : ndarray, shape (m,)
        Twists of the wheel (rad), which hold without torques.
    torque : ndarray, shape (m,), or None
        Torques at the wheel (N m).
    settled
        Change of the moments in parts of their sum, below which a step is the last.
    """
    law, size, some = lines.law, len(points), points.real.any(axis=1)
    found = _Balance(
        twist=twist.copy() if torque is None else np.full(size, np.nan),
        moment=np.zeros(moment.shape),
        converged=np.logical_and(~some, torque is None),
        steps=np.zeros(size, dtype=np.int64),
    )
    closed = CLOSED / lines.compliance.mesh.sections.wheel.base_radius
    left, steps = np.flatnonzero(some), 0
    points, moment = taken(points, left), moment[left]
    loaded = moment > 0.0
    loaded |= points.real & ~loaded.any(axis=1, keepdims=True)
    while len(left) and steps < STEPS:
        steps += 1
        own, rate = own_twists(law, points.rows, moment / points.weight)
        rate /= points.weight
        right = np.stack([rate * moment - own - points.touch, np.ones(loaded.shape)], axis=2)
        answer = _solved_loaded(points, rate, loaded, right)
        at = twist[left]
        if torque is not None:
            on_wheel, worth = wheel_moments(law, points, moment)
            missing = torque[left] - (on_wheel - worth * moment).sum(axis=1)
            at = (missing - (worth * answer[..., 0]).sum(axis=1)) / (worth * answer[..., 1]).sum(axis=1)
        new = answer[..., 0] + at[:, None] * answer[..., 1]
        leaving, share = loaded & (new <= 0.0), np.ones(len(left))
        if steps > QUICK_STEPS:  # up to the first point that loses its load
            shares = np.divide(moment, moment - new, out=np.full(new.shape, math.inf), where=leaving & (moment > new))
            shares[leaving & (moment <= new)] = 0.0
            share = np.minimum(shares.min(axis=1), 1.0)
            leaving &= shares <= share[:, None]
        new = np.where(leaving, 0.0, np.maximum(moment + share[:, None] * (new - moment), 0.0))
        change = np.abs(new - moment).max(axis=1) / np.maximum(new.sum(axis=1), 1e-300)
        moment = np.where(loaded, new, 0.0)
        overlap = at[:, None] - points.touch - (points.influence @ moment[..., None])[..., 0]
        overlap = np.where(points.real & ~loaded, overlap, 0.0)
        overlapping = overlap > closed
        entering = overlapping
        if steps > QUICK_STEPS:  # after a whole step the deepest alone
            whole = (share == 1.0) & (change < ONE_BY_ONE)
            entering = overlapping & (overlap == overlap.max(axis=1, keepdims=True)) & whole[:, None]
        done = ~(leaving | overlapping).any(axis=1) & (change < settled)
        loaded = (loaded & ~leaving) | entering
        none = ~loaded.any(axis=1)
        if none.any():
            done = np.where(none, ~overlapping.any(axis=1) & (torque is None), done)
            loaded |= none[:, None] & points.real & (points.touch <= points.touch.min(axis=1, keepdims=True))
        if done.any() or steps == STEPS:
            found.twist[left], found.moment[left], found.steps[left] = at, moment, steps
            found.converged[left] = done
            left, points, moment, loaded = left[~done], taken(points, ~done), moment[~done], loaded[~done]
    return found


def _solved_loaded(points: Points, rate: Array, loaded: BoolArray, right: Array) -> Array:
    """Return (T + c')^-1 times right sides of shape (m, n, k) over the loaded points; zero at the others."""
    system = np.where(loaded[:, :, None] & loaded[:, None, :], points.influence, 0.0)
    i = np.arange(loaded.shape[1])
    system[:, i, i] += np.where(loaded, rate, 1.0)
    return np.asarray(np.linalg.solve(system, np.where(loaded[..., None], right, 0.0)))


def _solutions(law: PairLaw, placing: Placing, rows: IntArray, balance: _Balance, placings: int) -> list[Solution]:
    """Return the solutions of some rows of a placing; `balance` is of them alone."""
    points, moment = taken(placing.points, rows), balance.moment
    on_wheel, worth = wheel_moments(law, points, moment)
    tangent = _tangent(law, points, moment, worth)
    solutions = []
    for i, row in enumerate(rows.tolist()):
        own = slice(0, int(placing.count[row]))
        solutions.append(
            Solution(
                points=placing.of_position(row),
                twist=float(balance.twist[i]),
                moment=moment[i, own],
                wheel_moment=on_wheel[i, own],
                tangent=tangent[i],
                placed=float(placing.twist[row]),
                stretches=of_positions(placing.stretches, placing.position[[row]]),
                converged=bool(balance.converged[i]),
                steps=int(balance.steps[i]),
                placings=placings,
            )
        )
    return solutions


def _tangent(law: PairLaw, points: Points, moment: Array, worth: Array) -> Array:
    """Return B^T (T + c')^-1 B over the loaded points (N m/rad), shape (m, 3, 3); `worth`: as of `wheel_moments`."""
    rate = own_twists(law, points.rows, moment / points.weight)[1] / points.weight
    levers = points.levers * np.stack([worth, np.ones(worth.shape), np.ones(worth.shape)], axis=2)
    answer = _solved_loaded(points, rate, moment > 0.0, levers)
    return np.asarray(np.matmul(levers.swapaxes(1, 2), answer))


def stored_energy(law: PairLaw, solution: Solution) -> float:
    """Return the elastic energy of a solved position (J): of the contacts themselves, and by the influence."""
    points, moment = solution.points, solution.moment
    x, w = _gauss(ENERGY_POINTS)
    per_width = moment / points.weight
    parts = zip(0.5 * (x + 1.0), 0.5 * w, strict=True)
    complementary = sum((b * own_twists(law, points.rows, a * per_width)[0] for a, b in parts), np.zeros(len(points)))
    own = own_twists(law, points.rows, per_width)[0] - complementary
    return float(own @ moment + 0.5 * moment @ points.influence @ moment)
