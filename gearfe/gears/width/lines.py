r"""Lines of contact of all tooth pairs at one position, and how they share a load.

A line is a tooth pair k over the common width; its point at z has the pair angle
:math:`\psi = \varphi + \kappa z + 2\pi k/z_1 - \tfrac12 i\theta` of `.pair_law`, where the pair has its first contact
t, its arms, and its compliance. Lines are broken at the ends of the path of contact, beyond which tips may be loaded,
and have Gauss points with weights w in each stretch. With the gap d of `.flanks`, a twist :math:`\theta` and the
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
#: the least for a stretch, and those of a stretch beyond the path of contact.
POINTS_PER_FUNCTION, LEAST_POINTS, TIP_POINTS = 2.0, 4, 6
#: Change of the twist, in parts of its way since the first touch, that ends the placing of points: it moves the torque
#: by 1e-3 of itself. How often they are placed, and how often their reach may become less from one to the next.
PLACED, PLACINGS, FREE_PLACINGS = 1e-4, 12, 4
#: Steps in which any number of points may lose their load or be let in. That converges in a few steps or runs in a
#: circle; afterwards one does at a time, along the way of the convex problem of the moments, which has no circles.
QUICK_STEPS = 15
#: Change of the moments in parts of their sum in a whole step, below which another point is let in.
ONE_BY_ONE = 1e-3
#: Newton steps, change of the moments in parts of their sum in the last one, and the overlap (m) of a point that
#: carries nothing that is none.
STEPS, SETTLED, CLOSED = 300, 1e-9, 1e-12
#: A, k and q of free ends at Poisson's ratios (-), within 2 % of the resolved block.
AT_END = {0.2: (2.79, 0.264, 2.03), 0.3: (2.35, 0.301, 1.60), 0.4: (2.13, 0.329, 1.43)}
#: Least roll length (modules) for the curvature that the half widths at free ends follow from.
LEAST_ROLL = 0.2
#: Least derivative of c in parts of c/M under the lightest load, so that no contact yields less under more load.
STIFFEST = 0.05
#: Least twist beyond the first touch that points are placed for, in those of a usual stiffness.
LEAST_AHEAD = 0.1
#: Gauss points over the load of what a contact stores.
ENERGY_POINTS = 5
#: Change of the torque in parts of itself that ends the placing of points at a twist: what is left is a tenth of it,
#: since the ends of the load come nearer by that each time.
TWIST_PLACED = 1e-4
#: Points of a stretch without load, and the least length (widths) of a stretch that ends where the load does.
FREE_POINTS, LEAST_STRETCH = 2, 1e-3
#: Places on a line at which its gap is looked at.
LOOKS = 33


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
    touch : ndarray, shape (n,)
        Twist at which a point touches (rad).
    levers : ndarray, shape (n, 3)
        Twist of the wheel that a unit of twist, tilt in the plane of action and tilt across are worth (-).
    influence : ndarray, shape (n, n)
        T (rad/(N m)).
    """

    z: Array
    weight: Array
    pair: IntArray
    rows: Rows
    touch: Array
    levers: Array
    influence: Array

    def __len__(self) -> int:
        return len(self.z)

    @cached_property
    def slopes(self) -> Array:
        """Slopes of the cubics between the loads of C, shape (n, loads)."""
        return _slopes(self.rows.yields)

    @cached_property
    def excess_slopes(self) -> Array:
        """Slopes of the cubics between the loads of delta, shape (n, loads)."""
        return _slopes(self.rows.excess)


def _slopes(values: Array) -> Array:
    """Mean slopes on both sides of each load, per spacing of the loads, shape (n, loads)."""
    between = np.diff(values, axis=1)
    return np.concatenate([between[:, :1], 0.5 * (between[:, :-1] + between[:, 1:]), between[:, -1:]], axis=1)


@dataclass(frozen=True)
class Looks:
    """Where the lines at a pinion angle and a twist are closest: l lines that can meet.

    Attributes
    ----------
    pair : ndarray, shape (l,)
        Tooth pairs.
    gap : ndarray, shape (l,)
        Least of the gap d along each line, as a twist (rad).
    least
        Twist at which the rigid gears touch first (rad), infinite where they do not.
    """

    pair: IntArray
    gap: Array
    least: float


def look_at(lines: ContactLines, angle: float) -> Looks:
    """Look at the gaps along all lines that can meet; the pair angle of pair 0 at z = 0 is `angle` (rad)."""
    mesh, law = lines.compliance.mesh, lines.law
    rule, cycle = np.linspace(*mesh.zone, LOOKS), mesh.sections.mesh_cycle
    first, *_, last = np.sort(angle + mesh.turns[0] * rule)
    numbers = np.arange(math.ceil((law.angle[0] - last) / cycle), math.floor((law.angle[-1] - first) / cycle) + 1)
    psi = angle + mesh.turns[0] * rule + cycle * numbers[:, None]
    rows = rows_at(law, np.clip(psi.ravel(), law.angle[0], law.angle[-1]))
    gap = lines.gap(np.tile(rule, len(numbers)), rows, np.repeat(numbers, LOOKS)) / mean_arm(lines, rows)
    outside = (psi < law.angle[0]) | (psi > law.angle[-1])
    gap = np.where(outside, np.inf, gap.reshape(psi.shape))
    least = float((gap + rows.touch.reshape(psi.shape)).min(initial=math.inf))
    gaps = gap.min(axis=1, initial=math.inf)
    return Looks(numbers[np.isfinite(gaps)], gaps[np.isfinite(gaps)], least)


def mean_arm(lines: ContactLines, rows: Rows) -> Array:
    """Approach of the flanks per twist from their first contact (m), shape (n,)."""
    return np.asarray(0.5 * (rows.arm + lines.compliance.mesh.sections.gear_ratio * rows.pinion_arm))


def place_points(lines: ContactLines, angle: float, twist: float, before: Solution | None = None) -> Points:
    """Place points on all lines that may bear.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle, twist : float
        Pinion angle and twist of the wheel (rad).
    before : Solution, optional
        With points at a twist nearby: lines are broken where their load ends there.
    """
    mesh, law = lines.compliance.mesh, lines.law
    cycle, turn = mesh.sections.mesh_cycle, mesh.turns[0]
    middle = angle - 0.5 * mesh.sections.gear_ratio * twist
    looks = look_at(lines, middle)
    breaks = {} if before is None else load_ends(before)
    z, weight, pair = [np.zeros(0)], [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
    for k, gap in zip(looks.pair.tolist(), looks.gap.tolist(), strict=True):
        reached = _reached(law, twist - gap)
        if reached is None:
            continue
        marks = np.clip([reached[0], *law.path, reached[1]], *reached).tolist()
        for (start, end), tip in zip(itertools.pairwise(marks), (True, False, True), strict=True):
            stretch = _stretch(start, end, middle + k * cycle, turn, mesh.zone, tip)
            if stretch is None:
                continue
            apart = LEAST_STRETCH * mesh.width
            inner = [(at, loaded) for at, loaded in breaks.get(k, ()) if stretch[0] + apart < at < stretch[1] - apart]
            ends = [stretch[0], *(at for at, _ in inner), stretch[1]]
            loaded = [True] * (len(inner) + 1)
            for i, (_, before_it) in enumerate(inner):
                loaded[i], loaded[i + 1] = before_it, not before_it
            for (a, b), bears in zip(itertools.pairwise(ends), loaded, strict=True):
                share = (b - a) / mesh.width
                x, w = _gauss(_count(lines, share, tip=tip and turn != 0.0) if bears else FREE_POINTS)
                z.append(0.5 * (a + b) + 0.5 * (b - a) * x)
                weight.append(0.5 * (b - a) * w)
                pair.append(np.full(len(x), k))
    return _points(lines, middle, twist, np.concatenate(z), np.concatenate(weight), np.concatenate(pair))


def load_ends(solution: Solution) -> dict[int, list[tuple[float, bool]]]:
    """Return where the load ends on each line, by tooth pair: z (m), rising, and whether it bears at smaller z.

    The approach that is left to the contact itself vanishes there; it is straight between two points.
    """
    points = solution.points
    left = solution.twist - points.touch - points.influence @ solution.moment
    found: dict[int, list[tuple[float, bool]]] = {}
    for k in np.unique(points.pair).tolist():
        of_pair = np.flatnonzero(points.pair == k)
        of_pair = of_pair[np.argsort(points.z[of_pair])]
        z, approach = points.z[of_pair], left[of_pair]
        i = np.flatnonzero((approach[:-1] > 0.0) != (approach[1:] > 0.0))
        at = z[i] + (z[i + 1] - z[i]) * approach[i] / (approach[i] - approach[i + 1])
        found[k] = list(zip(at.tolist(), (approach[i] > 0.0).tolist(), strict=True))
    return found


def _reached(law: PairLaw, twist: float) -> tuple[float, float] | None:
    """First and last pair angle (rad) at which rigid flanks overlap at a twist (rad), or None."""
    inside = np.flatnonzero(law.touch < twist)
    if len(inside) == 0:
        return None
    ends = []
    for i, beyond in ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1)):
        at = law.angle[i]
        if 0 <= beyond < len(law.angle):
            at += (law.angle[beyond] - at) * (twist - law.touch[i]) / (law.touch[beyond] - law.touch[i])
        ends.append(float(at))
    return ends[0], ends[1]


def _count(lines: ContactLines, share: float, *, tip: bool) -> int:
    """Points of a stretch over so much of the width; `tip`: beyond the path of contact."""
    if tip:
        return math.ceil(TIP_POINTS * lines.density / POINTS_PER_FUNCTION)
    return max(LEAST_POINTS, math.ceil(lines.density * lines.compliance.mesh.count * math.sqrt(share) - 1e-9))


@cache
def _gauss(count: int) -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(count)


def _stretch(
    first: float, last: float, at: float, turn: float, zone: tuple[float, float], tip: bool
) -> tuple[float, float] | None:
    """Return the z (m) between which a line runs through pair angles from one to another (rad), or None.

    Parameters
    ----------
    first, last : float
        Pair angles (rad).
    at, turn : float
        Pair angle at z = 0 (rad), and its growth with z (rad/m).
    zone : pair of float
        Common width (m).
    tip : bool
        Whether both pair angles are beyond the path of contact, to which its ends belong.
    """
    if turn == 0.0:
        inside = first < at < last if tip else first <= at <= last
        return zone if inside else None
    a, b = sorted(((first - at) / turn, (last - at) / turn))
    a, b = max(a, zone[0]), min(b, zone[1])
    return (a, b) if b - a > 1e-9 * (zone[1] - zone[0]) else None


def _points(lines: ContactLines, middle: float, twist: float, z: Array, weight: Array, pair: IntArray) -> Points:
    mesh, law = lines.compliance.mesh, lines.law
    rows = rows_at(law, middle + mesh.turns[0] * z + pair * mesh.sections.mesh_cycle)
    levers = np.concatenate([np.ones((len(z), 1)), lines.levers(z, rows) / rows.arm[:, None]], axis=1)
    approach = mean_arm(lines, rows) * (twist - rows.touch) - lines.gap(z, rows, pair)
    rows = replace(rows, yields=rows.yields + _softer_ends(lines, z, rows))
    influence = _influence(lines.compliance, z, pair, rows) / (rows.arm[:, None] * rows.arm)
    return Points(z, weight, pair, rows, twist - approach / rows.arm, levers, influence)


def _softer_ends(lines: ContactLines, z: Array, rows: Rows) -> Array:
    """What free ends of the gears add to the approach of half-planes per force per width (m2/N), shape (n, loads)."""
    compliance, forces = lines.compliance, lines.law.forces
    mesh, added = compliance.mesh, np.zeros((len(z), len(forces)))
    if mesh.count == 1:
        return added
    soft = sum(side.local.inverse_modulus for side in compliance.sides)
    rolls = np.maximum(rows.roll, LEAST_ROLL * mesh.module)
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


def _influence(compliance: WideCompliance, z: Array, pair: IntArray, rows: Rows) -> Array:
    """Approach of the flanks at each point per force at each (m/N), shape (n, n)."""
    mesh = compliance.mesh
    over_width = legendre(z, mesh.zone, mesh.count)
    values = compliance.shapes.at(rows.arc)[:, :, 0]
    found = np.zeros((len(z), len(z)))
    of_pair = {k: np.flatnonzero(pair == k) for k in np.unique(pair).tolist()}
    for gear, side in enumerate(compliance.sides):
        size = len(side.local.stations)
        load = values[:, gear, :size, None, None] * rows.tooth_normal[:, gear, None, :, None]
        load = (load * over_width[:, None, None]).reshape(len(z), 2 * size * mesh.count)
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


def own_twists(law: PairLaw, points: Points, moment: Array) -> tuple[Array, Array]:
    """How contacts yield at moments per width (N), shape (n,): C f/r_2 (rad) and its derivative (rad per N)."""
    force, spacing = moment / points.rows.arm, math.log(law.forces[1] / law.forces[0])
    x = np.log(np.maximum(force / law.forces[0], 1e-9)) / spacing
    share, slope, inside = _cubic(points.rows.yields, points.slopes, x)
    slope = np.where(x > inside, 0.0, slope)  # beyond the forces of the table C stays, so that C f rises
    share = share + (x - inside) * slope
    rate = np.maximum(share + slope / spacing, STIFFEST * points.rows.yields[:, 0])
    return share * force / points.rows.arm, rate / points.rows.arm**2


def wheel_moments(law: PairLaw, points: Points, moment: Array) -> tuple[Array, Array]:
    """Moments of the points on the wheel (1 + delta) m (N m), and their derivatives with m = `moment`, shape (n,)."""
    force, spacing = moment / (points.weight * points.rows.arm), math.log(law.forces[1] / law.forces[0])
    x = np.log(np.maximum(force / law.forces[0], 1e-9)) / spacing
    excess, slope, inside = _cubic(points.rows.excess, points.excess_slopes, x)
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
    tangent : ndarray, shape (3, 3)
        Torque and moments of the tilts by twist, tilt in the plane of action and tilt across (N m/rad).
    converged
        Whether the iteration settled.
    steps
        Newton steps.
    """

    points: Points
    twist: float
    moment: Array
    wheel_moment: Array
    tangent: Array
    converged: bool
    steps: int

    @property
    def torque(self) -> float:
        """Torque at the wheel (N m)."""
        return float(self.wheel_moment.sum())


def solve_position(
    lines: ContactLines, angle: float, *, torque: float | None = None, twist: float | None = None, guess: float = 0.0
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
    guess : float
        Twist (rad) at which a torque is expected; 0: by a usual stiffness.
    """
    if torque is None:
        assert twist is not None
        at_twist = _newton(lines, place_points(lines, angle, twist), twist=twist, torque=None)
        for _ in range(PLACINGS):
            torque_before = at_twist.torque
            points = place_points(lines, angle, twist, at_twist)
            at_twist = _newton(lines, points, twist=twist, torque=None, before=at_twist)
            if abs(at_twist.torque - torque_before) <= TWIST_PLACED * torque_before:
                break
        return at_twist
    least = look_at(lines, angle).least
    if not math.isfinite(least):
        return Solution(_nowhere(lines), math.nan, np.zeros(0), np.zeros(0), np.zeros((3, 3)), False, 0)
    ahead = guess - least if guess > least else torque / lines.compliance.mesh.usual_stiffness
    steps, settled, before = 0, False, None
    broken = None
    for number in range(PLACINGS):
        broken = before if number < FREE_PLACINGS else broken  # ends of light loads may jump to and fro
        points = place_points(lines, angle, least + ahead, broken)
        solution = _newton(lines, points, torque=torque, twist=None, before=before)
        steps, before = steps + solution.steps, solution
        # between the places that are looked at, a line may touch a little earlier
        new = max(solution.twist - least, LEAST_AHEAD * torque / lines.compliance.mesh.usual_stiffness)
        free = number < FREE_PLACINGS
        near = abs(new - ahead) <= PLACED * new or (not free and new <= ahead)
        settled = solution.converged and number > 0 and near
        if settled:
            break
        ahead = new if free else max(new, ahead)
    return replace(solution, steps=steps, converged=settled)


def _nowhere(lines: ContactLines) -> Points:
    """No points."""
    nothing = np.zeros(0)
    return _points(lines, lines.law.angle[0], 0.0, nothing, nothing, nothing.astype(np.int64))


def _newton(
    lines: ContactLines,
    points: Points,
    *,
    torque: float | None,
    twist: float | None,
    before: Solution | None = None,
) -> Solution:
    """Solve the complementary problem of the points at a torque (N m) or a twist (rad).

    It begins with the loads along the lines of the solution `before`.
    """
    law, n, weight = lines.law, len(points), points.weight
    loaded: BoolArray = np.ones(n, dtype=bool)
    moment = np.zeros(n) if before is None else _density(before, points) * weight
    if moment.any():
        loaded = moment > 0
    elif torque is None:
        loaded = points.touch < twist
        start = np.where(loaded, twist - points.touch, 0.0) * weight
        moment = start * lines.compliance.mesh.usual_stiffness / lines.compliance.mesh.width
    else:
        moment = torque * weight / max(weight.sum(), 1e-300)
    at, steps, converged = math.nan if twist is None else twist, 0, n == 0 and torque is None
    closed = CLOSED / lines.compliance.mesh.sections.wheel.base_radius
    while n and not converged and steps < STEPS:
        steps += 1
        own, rate = own_twists(law, points, moment / weight)
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
        if not (leaving.any() or (overlap > closed).any()) and change < SETTLED:
            converged = True
        loaded = (loaded & ~leaving) | entering
        if not loaded.any():
            converged = torque is None and not (overlap > closed).any()
            loaded = points.touch <= points.touch.min()
    on_wheel, worth = wheel_moments(law, points, moment)
    return Solution(points, at, moment, on_wheel, _tangent(law, points, moment, worth), converged, steps)


def _density(before: Solution, points: Points) -> Array:
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
    rate = own_twists(law, points, moment / points.weight)[1]
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
    complementary = sum((b * own_twists(law, points, a * per_width)[0] for a, b in parts), np.zeros(len(points)))
    own = own_twists(law, points, per_width)[0] - complementary
    return float(own @ moment + 0.5 * moment @ points.influence @ moment)
