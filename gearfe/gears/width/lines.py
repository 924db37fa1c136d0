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
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from ...base.typing import Array, BoolArray, IntArray
from .compliance import WideCompliance, legendre
from .flanks import WideFlanks
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
SETTLED, ROUGH = 1e-7, 3e-3
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

    def gap(self, z: Array, rows: Rows, pair: IntArray) -> Array:
        """Gap d (m) of tooth pairs at z (m), where `rows` has their place on the law's tables."""
        flanks, mesh = self.flanks, self.compliance.mesh
        gap = np.zeros(len(z))
        for gear, tooth in enumerate((pair, -1 - pair)):
            gap -= flanks.material(gear, rows.roll[:, gear], z, tooth, mesh.faces[gear])
            gap -= flanks.profiles[gear].turn_of(tooth) * (rows.arm if gear else rows.pinion_arm)
        return np.asarray(gap - self.levers(z, rows) @ [flanks.misalignment.in_plane, flanks.misalignment.across])

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
    """Points of the lines of contact of a position, n of them.

    Attributes
    ----------
    z, weight : ndarray, shape (n,)
        Axial coordinates and Gauss weights (m).
    pair : ndarray, shape (n,)
        Tooth pairs.
    rows : Rows
        Tables of the pair's law there.
    twist : float
        Twist of the wheel (rad) to which the pair angles belong.
    touch : ndarray, shape (n,)
        Twist at which a point touches (rad).
    levers : ndarray, shape (n, 3)
        Twist of the wheel that a unit of twist, tilt in the plane of action and tilt across are worth (-).
    loads : list of ndarray, shapes (n, size)
        Unit forces of the points on the stations and functions of both gears.
    influence : ndarray, shape (n, n)
        T (rad/(N m)).
    """

    z: Array
    weight: Array
    pair: IntArray
    rows: Rows
    twist: float
    touch: Array
    levers: Array
    loads: list[Array]
    influence: Array

    def __len__(self) -> int:
        return len(self.z)


def _slopes(values: Array) -> Array:
    """Mean slopes on both sides of each load, per spacing of the loads, shape (n, loads)."""
    between = np.diff(values, axis=1)
    return np.concatenate([between[:, :1], 0.5 * (between[:, :-1] + between[:, 1:]), between[:, -1:]], axis=1)


@dataclass(frozen=True)
class Looks:
    """Places on all lines that can meet at a pinion angle and a twist, q of them, by tooth pair and z.

    Attributes
    ----------
    pair : ndarray, shape (q,)
        Tooth pairs.
    z : ndarray, shape (q,)
        Axial coordinates (m), with the ends of the lines and the kinks of their gaps.
    kink : ndarray of bool, shape (q,)
        Whether the gap or the compliance has a kink there.
    rows : Rows
        Tables of the pair's law there.
    first : ndarray, shape (q,)
        Twist of the first contact at this pair angle (rad).
    """

    pair: IntArray
    z: Array
    kink: BoolArray
    rows: Rows
    first: Array

    @property
    def least(self) -> float:
        """Twist at which the rigid gears touch first (rad), infinite where they do not."""
        return float(self.first.min(initial=math.inf))


def look_at(lines: ContactLines, angle: float, twist: float = 0.0, runs: Runs | None = None) -> Looks:
    """Look at the gaps along all lines that can meet at a pinion angle.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle, twist : float
        Pinion angle and twist of the wheel (rad).
    runs : Runs, optional
        Loaded parts, whose ends are among the places, with two more beside each.
    """
    mesh, law, flanks = lines.compliance.mesh, lines.law, lines.flanks
    middle, cycle, turn = _middle(lines, angle, twist), mesh.sections.mesh_cycle, mesh.turns[0]
    low, high = sorted(middle + turn * z for z in mesh.zone)
    numbers = np.arange(math.ceil((law.angle[0] - high) / cycle), math.floor((law.angle[-1] - low) / cycle) + 1)
    psi, (first, last) = middle + cycle * numbers[:, None], np.broadcast_to(mesh.zone, (len(numbers), 2)).T
    marks = np.zeros((len(numbers), 0))
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
            kinks.append(np.broadcast_to(seams[:, 2] / seams[:, 0], (len(numbers), len(seams))))
    at = np.concatenate(kinks, axis=1)
    inside = (at > first[:, None]) & (at < last[:, None])
    lines_of, places = [np.repeat(np.arange(len(numbers)), LOOKS), np.nonzero(inside)[0]], [z.ravel(), at[inside]]
    if runs is not None and len(numbers):
        beside = BESIDE * (runs.end - runs.start)
        of_ends = np.tile(runs.pair, 6) - numbers[0]
        ends = np.concatenate([end + i * beside for end in (runs.start, runs.end) for i in (-1.0, 0.0, 1.0)])
        known = (of_ends >= 0) & (of_ends < len(numbers))
        of_ends, ends = of_ends[known], ends[known]
        known = (ends > first[of_ends]) & (ends < last[of_ends])
        lines_of, places = [*lines_of, of_ends[known]], [*places, ends[known]]
    kink = np.repeat([False, True, False], [z.size, len(places[1]), sum(map(len, places[2:]))])
    line, z = np.concatenate(lines_of), np.concatenate(places)
    order = np.lexsort((z, line))
    return _looks(lines, middle, numbers[line[order]], z[order], kink[order])


def _looks(lines: ContactLines, middle: float, pair: IntArray, z: Array, kink: BoolArray) -> Looks:
    """Look at places, where the pair angle of pair 0 at z = 0 is `middle` (rad)."""
    mesh = lines.compliance.mesh
    rows = rows_at(lines.law, middle + mesh.turns[0] * z + pair * mesh.sections.mesh_cycle)
    return Looks(pair, z, kink, rows, rows.touch + lines.gap(z, rows, pair) / mean_arm(lines, rows))


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


def _middle(lines: ContactLines, angle: float, twist: float) -> float:
    """Pair angle (rad) of pair 0 at z = 0."""
    return angle - 0.5 * lines.compliance.mesh.ratio * twist


@dataclass(frozen=True)
class Runs:
    """Loaded parts of the lines, r of them, by tooth pair and z.

    Attributes
    ----------
    pair : ndarray, shape (r,)
        Tooth pairs.
    start, end : ndarray, shape (r,)
        Between which z (m).
    """

    pair: IntArray
    start: Array
    end: Array

    def near(self, other: Runs) -> bool:
        """Return whether the ends are those of others, to `ENDS_PLACED` of the lengths."""
        if not np.array_equal(self.pair, other.pair):
            return False
        apart = np.maximum(np.abs(self.start - other.start), np.abs(self.end - other.end))
        return bool((apart <= ENDS_PLACED * (other.end - other.start)).all())

    def within(self, looks: Looks) -> Runs:
        """Return what of them is on the lines that were looked at."""
        pairs, begin = np.unique(looks.pair, return_index=True)
        stop = np.append(begin[1:], len(looks.pair)) - 1
        kept = np.isin(self.pair, pairs)
        line = np.searchsorted(pairs, self.pair[kept])
        start = np.maximum(self.start[kept], looks.z[begin[line]])
        end = np.minimum(self.end[kept], looks.z[stop[line]])
        long = end - start > SHORTEST * np.ptp(looks.z)
        return Runs(self.pair[kept][long], start[long], end[long])


#: No loaded part.
NO_RUNS = Runs(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))


def _runs(pair: IntArray, z: Array, left: Array) -> Runs:
    """Return where the approach `left` to the contacts is positive; it is straight between places, by pair and z."""
    loaded, same = left > 0.0, pair[1:] == pair[:-1]
    size = np.abs(left)
    zero = z[:-1] + np.diff(z) * np.divide(size[:-1], size[:-1] + size[1:], out=np.zeros(len(size) - 1), where=same)
    starts = np.where(np.append(False, same & ~loaded[:-1]), np.append(0.0, zero), z)
    ends = np.where(np.append(same & ~loaded[1:], False), np.append(zero, 0.0), z)
    first = loaded & np.append(True, ~(same & loaded[:-1]))
    last = loaded & np.append(~(same & loaded[1:]), True)
    return Runs(pair[first], starts[first], ends[last])


def mean_arm(lines: ContactLines, rows: Rows) -> Array:
    """Approach of the flanks per twist from their first contact (m), shape (n,)."""
    return np.asarray(0.5 * (rows.arm + lines.compliance.mesh.ratio * rows.pinion_arm))


def place_points(lines: ContactLines, angle: float, twist: float, looks: Looks, runs: Runs) -> Points:
    """Place points on the loaded parts of all lines, which are divided at their kinks.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle, twist : float
        Pinion angle and twist of the wheel (rad).
    looks : Looks
        Kinks of the lines there.
    runs : Runs
        Loaded parts.
    """
    z, weight, pair = [np.zeros(0)], [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
    for stretches in _divided(lines, looks, runs):
        for k, a, b in stretches:
            x, w = _gauss(_count(lines, (b - a) / lines.compliance.mesh.width))
            z.append(0.5 * (a + b) + 0.5 * (b - a) * x)
            weight.append(0.5 * (b - a) * w)
            pair.append(np.full(len(x), k))
    middle = _middle(lines, angle, twist)
    return _points(lines, middle, twist, np.concatenate(z), np.concatenate(weight), np.concatenate(pair))


def _divided(lines: ContactLines, looks: Looks, runs: Runs) -> list[list[tuple[int, float, float]]]:
    """Return the stretches between kinks of each loaded part: tooth pair, first and last z (m)."""
    kinks, of_kinks, apart = looks.z[looks.kink], looks.pair[looks.kink], LEAST_STRETCH * lines.compliance.mesh.width
    parts = []
    for k, start, end in zip(runs.pair.tolist(), runs.start.tolist(), runs.end.tolist(), strict=True):
        inner = kinks[(of_kinks == k) & (kinks > start + apart) & (kinks < end - apart)].tolist()
        parts.append([(k, a, b) for a, b in itertools.pairwise([start, *inner, end])])
    return parts


def _count(lines: ContactLines, share: float) -> int:
    """Points of a stretch over so much of the width."""
    return max(LEAST_POINTS, math.ceil(lines.density * lines.compliance.mesh.count * math.sqrt(share) - 1e-9))


@cache
def _gauss(count: int) -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(count)


def _points(lines: ContactLines, middle: float, twist: float, z: Array, weight: Array, pair: IntArray) -> Points:
    mesh, law = lines.compliance.mesh, lines.law
    rows = rows_at(law, middle + mesh.turns[0] * z + pair * mesh.sections.mesh_cycle)
    levers = np.concatenate([np.ones((len(z), 1)), lines.levers(z, rows) / rows.arm[:, None]], axis=1)
    first = rows.touch + lines.gap(z, rows, pair) / mean_arm(lines, rows)
    rows = _with_ends(lines, z, rows)
    loads = _loads(lines.compliance, z, rows)
    influence = _influence(lines.compliance, loads, pair) / (rows.arm[:, None] * rows.arm)
    return Points(z, weight, pair, rows, twist, _touch(lines, rows, first, twist), levers, loads, influence)


def _touch(lines: ContactLines, rows: Rows, first: Array, twist: float) -> Array:
    """Twist (rad) at which places touch, to first order from a twist (rad); `first`: that of their first contact."""
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


def _influence(compliance: WideCompliance, loads: list[Array], pair: IntArray) -> Array:
    """Approach of the flanks at each point per force at each (m/N), shape (n, n)."""
    found = np.zeros((len(pair), len(pair)))
    of_pair = {k: np.flatnonzero(pair == k) for k in np.unique(pair).tolist()}
    for gear, (side, load) in enumerate(zip(compliance.sides, loads, strict=True)):
        for step in range(compliance.steps + 1):
            # the wheel's teeth count the other way round
            way = step * (1 - 2 * gear)
            couples = [(of_pair[k + way], source) for k, source in of_pair.items() if k + way in of_pair]
            if not couples:
                break
            square = side.influence[step].reshape(load.shape[1], load.shape[1])
            sources = np.concatenate([source for _, source in couples])
            moved = load[sources] @ (square.T if step else square)
            start = 0
            for felt, source in couples:
                block = load[felt] @ moved[start : start + len(source)].T
                start += len(source)
                if step == 0:
                    found[np.ix_(felt, source)] += 0.5 * (block + block.T)
                else:
                    found[np.ix_(felt, source)] += block
                    found[np.ix_(source, felt)] += block.T
    return found


def _approach_left(lines: ContactLines, looks: Looks, balance: _Balance | Solution) -> Array:
    """Twist (rad) left to the contacts themselves at the places looked at, shape (q,); that of rigid gears below 0."""
    compliance, points, rows = lines.compliance, balance.points, looks.rows
    mesh, force = compliance.mesh, balance.moment / points.rows.arm
    left = balance.twist - _touch(lines, rows, looks.first, points.twist)
    overlaps = left > 0.0  # of rigid gears, without which nothing is loaded
    pairs, line = np.unique(looks.pair[overlaps], return_inverse=True)
    over_width = legendre(looks.z[overlaps], mesh.zone, mesh.count)[:, :, None]
    values, normal = compliance.shapes.values_at(rows.arc[overlaps]), rows.tooth_normal[overlaps]
    approach = np.zeros(len(line))
    loaded = [(k, points.pair == k) for k in np.unique(points.pair).tolist()]
    for gear, (side, load) in enumerate(zip(compliance.sides, points.loads, strict=True)):
        size, moved = load.shape[1], np.zeros((len(pairs), load.shape[1]))
        steps = side.influence.reshape(-1, size, size)
        for k, of_pair in loaded:
            total = force[of_pair] @ load[of_pair]
            way = (pairs - k) * (1 - 2 * gear)
            for i, step in enumerate(way.tolist()):
                if abs(step) <= compliance.steps:
                    moved[i] += steps[step] @ total if step >= 0 else total @ steps[-step]
        along = (moved.reshape(len(pairs), size // mesh.count, mesh.count)[line] @ over_width)[..., 0]
        shape = values[:, gear, : len(side.local.stations), None] * normal[:, gear, None]
        approach += (shape.reshape(len(line), size // mesh.count) * along).sum(axis=1)
    left[overlaps] -= approach / rows.arm[overlaps]
    return left


def own_twists(law: PairLaw, rows: Rows, moment: Array) -> tuple[Array, Array]:
    """How contacts yield at moments per width (N), shape (n,): C f/r_2 (rad) and its derivative (rad per N)."""
    force, spacing = moment / rows.arm, math.log(law.forces[1] / law.forces[0])
    x = np.log(np.maximum(force / law.forces[0], 1e-9)) / spacing
    share, slope, inside = _cubic(rows.yields, rows.slopes, x)
    slope = np.where(x > inside, 0.0, slope)  # beyond the forces of the table C stays, so that C f rises
    share = share + (x - inside) * slope
    rate = np.maximum(share + slope / spacing, STIFFEST * rows.yields[:, 0])
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
    last = values.shape[1] - 1
    inside = np.minimum(np.maximum(x, 0.0), last)
    i = np.minimum(inside.astype(np.int64), last - 1)
    t, first = inside - i, i + np.arange(0, len(i) * (last + 1), last + 1)
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
    runs
        Loaded parts of the lines.
    looks
        Looks at the lines, with the kinks that divide these.
    tangent : ndarray, shape (3, 3)
        Torque and moments of the tilts by twist, tilt in the plane of action and tilt across (N m/rad).
    converged
        Whether the iteration settled.
    steps, placings
        Newton steps, and how often points were placed.
    """

    points: Points
    twist: float
    moment: Array
    wheel_moment: Array
    runs: Runs
    looks: Looks
    tangent: Array
    converged: bool
    steps: int
    placings: int

    @property
    def torque(self) -> float:
        """Torque at the wheel (N m)."""
        return float(self.wheel_moment.sum())

    def continued(self, before: Solution, share: float) -> Solution:
        """Return this solution with the twist and the ends of the load that continue those before it, to start from.

        Parameters
        ----------
        before : Solution
            Solution at the position before this one.
        share : float
            How far, in their distance (-).
        """
        start, end = self.runs.start.copy(), self.runs.end.copy()
        for k in np.unique(self.runs.pair).tolist():
            i, j = self.runs.pair == k, before.runs.pair == k
            if np.count_nonzero(i) == np.count_nonzero(j):
                start[i] += share * (start[i] - before.runs.start[j])
                end[i] += share * (end[i] - before.runs.end[j])
        twist = self.twist + share * (self.twist - before.twist)
        return replace(self, twist=twist, runs=Runs(self.runs.pair, start, end))


def line_load(lines: ContactLines, angle: float, solution: Solution) -> tuple[Looks, Array]:
    """Return places along the loaded parts of a solved position, their ends and kinks too, and the line loads (N/m).

    The line load is the force per width with which the contact yields by the approach that is left to it, as at the
    points of the lines. Where it is larger than on both sides, the place is the vertex of the parabola through all
    three, except at kinks.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle : float
        Pinion angle (rad).
    solution : Solution
        The position.
    """
    pair, z, kink = [np.zeros(0, dtype=np.int64)], [np.zeros(0)], [np.zeros(0, dtype=bool)]
    for stretches in _divided(lines, solution.looks, solution.runs):
        whole = stretches[-1][2] - stretches[0][1]
        for i, (k, a, b) in enumerate(stretches):
            intervals = max(LEAST_DENSE, math.ceil(DENSE * math.sqrt((b - a) / whole)))
            x = _dense(intervals)[min(i, 1) :]  # a kink once
            pair.append(np.full(len(x), k))
            z.append(a + (b - a) * x)
            kink.append((x == 0.0) | (x == 1.0))
    middle = _middle(lines, angle, solution.points.twist)
    looks = _looks(lines, middle, np.concatenate(pair), np.concatenate(z), np.concatenate(kink))
    left = _approach_left(lines, looks, solution)
    load = _load_of(lines.law, _with_ends(lines, looks.z, looks.rows), left)
    tops = np.flatnonzero((load[1:-1] >= load[:-2]) & (load[1:-1] > load[2:]) & ~looks.kink[1:-1]) + 1
    before, top, behind = (looks.z[tops + i] for i in (-1, 0, 1))
    rise, fall = (load[tops] - load[tops - 1]) / (top - before), (load[tops + 1] - load[tops]) / (behind - top)
    bend = (fall - rise) / (behind - before)
    vertex = 0.5 * (before + top - rise / bend)
    load[tops] += (vertex - top) * (rise + bend * (vertex - before))
    looks.z[tops] = vertex
    return _looks(lines, middle, looks.pair, looks.z, looks.kink), load


@cache
def _dense(count: int) -> Array:
    """Ends of so many intervals from 0 to 1, close to each other at both."""
    return np.asarray(0.5 - 0.5 * np.cos(math.pi * np.arange(count + 1) / count))


def solve_position(
    lines: ContactLines,
    angle: float,
    *,
    torque: float | None = None,
    twist: float | None = None,
    before: Solution | None = None,
) -> Solution:
    """Solve the contact at a pinion angle.

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
    before : Solution, optional
        Solved position close by, from which the iteration starts.
    """
    mesh = lines.compliance.mesh
    known: _Balance | Solution | None = before
    runs = None if before is None else before.runs
    at = before.twist if twist is None and before is not None else twist
    if at is None:
        assert torque is not None
        at = look_at(lines, angle).least + torque / mesh.usual_stiffness
    balance, steps, number, settled = None, 0, 0, False
    while not settled and number < PLACINGS and math.isfinite(at):
        number += 1
        looks = look_at(lines, angle, at, runs)
        rigid = at - _touch(lines, looks.rows, looks.first, at)
        if torque is not None and not (rigid > 0.0).any():
            at += LEAST_AHEAD * torque / mesh.usual_stiffness - rigid.max(initial=-math.inf)
            runs = None
            continue
        runs = _runs(looks.pair, looks.z, rigid) if runs is None else runs.within(looks)
        points = place_points(lines, angle, at, looks, runs)
        balance = known = _newton(lines, points, torque=torque, twist=twist, before=known, settled=ROUGH)
        steps, placed = steps + balance.steps, runs
        if number <= FREE_PLACINGS:
            runs = _runs(looks.pair, looks.z, _approach_left(lines, looks, balance))
        near = abs(balance.twist - at) <= PLACED * max(balance.twist - looks.least, 0.0)
        at = balance.twist
        if balance.converged and near and runs.near(placed):
            balance = _newton(lines, points, torque=torque, twist=twist, before=balance)
            steps, settled = steps + balance.steps, balance.converged
    if balance is None or runs is None:
        nothing = _Balance(_nowhere(lines), math.nan, np.zeros(0), converged=False, steps=0)
        return _solution(lines, nothing, NO_RUNS, look_at(lines, angle), 0)
    return _solution(lines, replace(balance, steps=steps, converged=settled), runs, looks, number)


def _nowhere(lines: ContactLines) -> Points:
    """No points."""
    nothing = np.zeros(0)
    return _points(lines, lines.law.angle[0], 0.0, nothing, nothing, nothing.astype(np.int64))


@dataclass(frozen=True)
class _Balance:
    """Moments (N m), shape (n,), of points at a twist (rad) that close their gaps if `converged`."""

    points: Points
    twist: float
    moment: Array
    converged: bool
    steps: int


def _newton(
    lines: ContactLines,
    points: Points,
    *,
    torque: float | None,
    twist: float | None,
    before: _Balance | Solution | None = None,
    settled: float = SETTLED,
) -> _Balance:
    """Solve the complementary problem of the points at a torque (N m) or a twist (rad).

    It begins with the loads along the lines of the solution `before`, and ends after a step that changes the moments by
    less than `settled` of their sum.
    """
    law, n, weight = lines.law, len(points), points.weight
    loaded: BoolArray = np.ones(n, dtype=bool)
    moment = np.zeros(n) if before is None else _density(before, points) * weight
    if moment.any():
        loaded = moment > 0
    else:
        rigid = np.maximum(points.twist - points.touch, 0.0)
        moment = rigid * weight * lines.compliance.mesh.usual_stiffness / lines.compliance.mesh.width
    at, steps, converged = math.nan if twist is None else twist, 0, n == 0 and torque is None
    closed = CLOSED / lines.compliance.mesh.sections.wheel.base_radius
    while n and not converged and steps < STEPS:
        steps += 1
        own, rate = own_twists(law, points.rows, moment / weight)
        i = np.flatnonzero(loaded)
        system = points.influence[i[:, None], i]
        rate /= weight
        system.flat[:: len(i) + 1] += rate[i]
        right = np.ones((len(i), 2))
        right[:, 0] = rate[i] * moment[i] - own[i] - points.touch[i]
        answer = np.linalg.solve(system, right)
        if torque is not None:
            on_wheel, worth = wheel_moments(law, points, moment)
            missing = torque - on_wheel.sum() + worth @ moment
            at = (missing - worth[i] @ answer[:, 0]) / (worth[i] @ answer[:, 1])
        new = np.zeros(n)
        new[i] = answer[:, 0] + at * answer[:, 1]
        leaving = loaded & (new <= 0)
        share = 1.0
        if steps > QUICK_STEPS and leaving.any():  # up to the first point that loses its load
            past = np.flatnonzero(leaving)
            shares = moment[past] / np.maximum(moment[past] - new[past], 1e-300)
            share = float(shares.min())
            leaving = np.zeros(n, dtype=bool)
            leaving[past[shares <= share]] = True
        new = np.where(leaving, 0.0, np.maximum(moment + share * (new - moment), 0.0))
        change = np.abs(new - moment).max() / max(new.sum(), 1e-300)
        moment = np.where(loaded, new, 0.0)
        overlap = np.where(loaded, 0.0, at - points.touch - points.influence @ moment)
        entering = overlap > closed
        if steps > QUICK_STEPS and entering.any():  # after a whole step the deepest alone
            entering = (overlap == overlap.max()) & (share == 1.0) & (change < ONE_BY_ONE)
        if not (leaving.any() or (overlap > closed).any()) and change < settled:
            converged = True
        loaded = (loaded & ~leaving) | entering
        if not loaded.any():
            converged = torque is None and not (overlap > closed).any()
            loaded = points.touch <= points.touch.min()
    return _Balance(points, at, moment, converged, steps)


def _solution(lines: ContactLines, balance: _Balance, runs: Runs, looks: Looks, placings: int) -> Solution:
    law, points, moment = lines.law, balance.points, balance.moment
    on_wheel, worth = wheel_moments(law, points, moment)
    tangent = _tangent(law, points, moment, worth)
    converged, steps = balance.converged, balance.steps
    return Solution(points, balance.twist, moment, on_wheel, runs, looks, tangent, converged, steps, placings)


def _density(before: _Balance | Solution, points: Points) -> Array:
    """Moments per width of a solution at other points, straight along its lines (N), shape (n,)."""
    density = before.moment / before.points.weight
    found = np.zeros(len(points))
    for k in np.unique(points.pair).tolist():
        of_pair, known = np.flatnonzero(points.pair == k), np.flatnonzero(before.points.pair == k)
        if len(known):
            known = known[np.argsort(before.points.z[known])]
            found[of_pair] = np.interp(points.z[of_pair], before.points.z[known], density[known])
    return found


def _tangent(law: PairLaw, points: Points, moment: Array, worth: Array) -> Array:
    """B^T (T + c')^-1 B over the loaded points (N m/rad), shape (3, 3); `worth`: derivatives of `wheel_moments`."""
    i = np.flatnonzero(moment > 0)
    if len(i) == 0:
        return np.zeros((3, 3))
    rate = own_twists(law, points.rows, moment / points.weight)[1]
    system = points.influence[i[:, None], i]
    system.flat[:: len(i) + 1] += rate[i] / points.weight[i]
    levers = points.levers[i] * np.stack([worth[i], np.ones(len(i)), np.ones(len(i))], axis=1)
    return np.asarray(levers.T @ np.linalg.solve(system, levers))


def stored_energy(law: PairLaw, solution: Solution) -> float:
    """Return the elastic energy of a solved position (J): of the contacts themselves, and by the influence."""
    points, moment = solution.points, solution.moment
    x, w = _gauss(ENERGY_POINTS)
    per_width = moment / points.weight
    parts = zip(0.5 * (x + 1.0), 0.5 * w, strict=True)
    complementary = sum((b * own_twists(law, points.rows, a * per_width)[0] for a, b in parts), np.zeros(len(points)))
    own = own_twists(law, points.rows, per_width)[0] - complementary
    return float(own @ moment + 0.5 * moment @ points.influence @ moment)
