r"""First contact of the rigid driving flanks of each tooth pair: place and twist on exact curves, to rounding.

About the wheel's centre every point of the wheel's flank moves on a circle. Seen from there, the pinion's flank has the
polar angle :math:`\varphi_1(u)` at its parameter u. The wheel's flank has :math:`\varphi_2(r(u))` at the same radius
and zero twist. That point of the pinion's flank is met at the twist

.. math:: D(u) = \varphi_1(u) - \varphi_2(r(u)),

of an internal gear, which a positive twist turns clockwise, at its negative; the pair touches at
:math:`\varphi_k = \min_u D`. On the path of contact and on rounds and reliefs the minimum is smooth, and parabolas
close in on it. At the kink of a relief it is a kink of D. Before and after the path, where a sharp tip carries load, it
is an end of the range.

Each tooth may have deviations of its own: a profile, and a turn about the gear's centre by its pitch error.

**Faces in mesh**, as loads and rotations have moved them, are seen along a common normal. About a centre O with the
unit normal n out of the pinion and the tangent t = -i n, a point is O + n h + t x. The face of a gear whose tooth is
turned by the unit number q about the gear's centre c, and displaced by d + d'(s - s_0) about the arc s_0, is

.. math:: Z(s) = q\,(z(s) + d + d'\,(s-s_0)) + c, \qquad h - i x = (Z(s) - O)/n .

At a given x its arc follows from Newton's method on the exact curve. The gap between the faces is the difference of
their heights h at the same x, which is exact for any rotation and displacement of the faces. Arrays hold pinion and
wheel in their second axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from .face import AT_AN_END, NOMINAL, Face, FlankTables, ToothDeviations, face_of
from .pair import MeshGeometry

#: Points of the first search along a flank and of each closer look, and how often it looks closer at most; points
#: besides for each piece of a deviation, whose waves may be short.
COARSE, CLOSER, REFINEMENTS, PER_PIECE = 97, 65, 13, 2
_CLOSER = np.linspace(-1.0, 1.0, CLOSER)
#: Change of the least twist (rad) from one look to the next that ends the search: points are twenty times closer in the
#: next one, so that what is left is rounding.
SETTLED = 4e-14
#: Steps to the place of the pinion's flank that meets a mark of the wheel's: what is left is rounding.
MARK_STEPS = 6
#: Least relative curvature (1/m) of an internal pair's flanks, for first guesses: a hollow flank with waves may have
#: less.
LEAST_CURVATURE = 1.0


@dataclass(frozen=True)
class FirstContacts:
    """First contacts of n tooth pairs whose rigid flanks meet over all positions; pinion and wheel in second axes.

    Attributes
    ----------
    position : ndarray, shape (n,)
        Number of the pinion angle.
    pair : ndarray, shape (n,)
        Pair number k: pinion tooth k, wheel tooth -1 - k.
    angle : ndarray, shape (n,)
        Pinion angle (rad).
    twist : ndarray, shape (n,)
        Twist of the wheel at which the pair touches (rad).
    place : ndarray, shape (n, 2)
        Parameters u of the points of contact on pinion and wheel.
    point, normal : ndarray of complex, shape (n,)
        Point of contact and common normal out of the pinion, global axes.
    arm : ndarray, shape (n, 2)
        Torques of pinion and wheel per force (m).
    curvature : ndarray, shape (n,)
        Relative curvature of both flanks there (1/m), infinite at a sharp corner.
    flank : ndarray, shape (n, 2)
        Numbers of their flanks in `ToothFlanks.faces`.
    frames : ndarray, shape (n, 2)
        Angles that turn these flanks, at zero twist (rad).
    """

    position: IntArray
    pair: IntArray
    angle: Array
    twist: Array
    place: Array
    point: ComplexArray
    normal: ComplexArray
    arm: Array
    curvature: Array
    flank: IntArray
    frames: Array

    def take(self, index: Any) -> FirstContacts:
        """The pairs `index`."""
        return FirstContacts(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def __len__(self) -> int:
        return len(self.pair)


class ToothFlanks:
    """Working flanks of all teeth of pinion and wheel.

    Parameters
    ----------
    pair
        Geometry.
    deviations
        Of pinion and wheel.

    Attributes
    ----------
    faces : tuple of Face
        The distinct flanks: the pinion's profiles, then the wheel's.
    """

    def __init__(self, pair: MeshGeometry, deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL) -> None:
        self.pair, self.deviations = pair, deviations
        faces: list[Face] = []
        for gear, own in zip((pair.pinion, pair.wheel), deviations, strict=True):
            own.check(gear.tooth_count)
            faces += [face_of(gear, one) for one in own.profiles]
        self.faces = tuple(faces)

    def flank(self, number: IntArray) -> IntArray:
        """Flanks of the tooth pairs `number` (pinion tooth k, wheel tooth -1 - k): numbers in `faces`, shape (n, 2)."""
        pinion, wheel = self.deviations
        return np.stack([pinion.profile_of(number), wheel.profile_of(-1 - number) + len(pinion.profiles)], axis=1)

    def frames(self, angle: Array, number: IntArray, twist: Array | float) -> Array:
        """Angles (rad) that turn these flanks, pitch errors included, at pinion angles and twists of the wheel (rad),
        shape (n, 2).
        """
        teeth = number, -1 - number
        ways = 1, self.pair.sign
        errors = (way * own.turn_of(tooth) for way, own, tooth in zip(ways, self.deviations, teeth, strict=True))
        angles = (self.pair.tooth_angle(gear, tooth, angle, twist) for gear, tooth in enumerate(teeth))
        return np.stack([one + error for one, error in zip(angles, errors, strict=True)], axis=1)

    def first_contacts(self, angles: Array) -> FirstContacts:
        """Return the first contact of every tooth pair that can meet at the given pinion angles (rad), shape (p,)."""
        return self.first_contacts_of(*candidates(self.pair, np.asarray(angles, dtype=float)))

    def first_contacts_of(self, position: IntArray, angle: Array, number: IntArray) -> FirstContacts:
        """Return the first contact of the tooth pairs `number` at pinion angles (rad), shape (n,), where they meet.

        Positions are in rising order, and the numbers of each of them.
        """
        flank, frames, a = self.flank(number), self.frames(angle, number, 0.0), self.pair.wheel_centre
        sign = self.pair.sign
        least, places = np.full(len(number), np.inf), np.zeros((len(number), 2))
        point: ComplexArray = np.zeros(len(number), dtype=complex)
        normal = np.zeros_like(point)
        curvature = np.zeros(len(number))
        couple = flank @ [len(self.faces), 1]
        for one in set(couple.tolist()):
            pinion, wheel = (self.faces[i] for i in divmod(one, len(self.faces)))
            rows = np.flatnonzero(couple == one)
            u, twist = _least(pinion, wheel, a, frames[rows])
            rows, u, twist = rows[np.isfinite(twist)], u[np.isfinite(twist)], twist[np.isfinite(twist)]
            turn = np.exp(1j * frames[rows])
            point[rows] = pinion.points(u) * turn[:, 0]
            mate = wheel.at_radius(np.abs(point[rows] - a))
            mate = np.where(mate > wheel.end - AT_AN_END, wheel.end, np.where(np.abs(mate) < AT_AN_END, 0.0, mate))
            (bent, bend), (mate_bent, mate_bend) = pinion.turning(u), wheel.turning(mate)
            # the normal of the flatter face is the surer one; at the mate's corner it is the only one
            normals = pinion.normals(u) * turn[:, 0], -wheel.normals(mate) * turn[:, 1] * np.exp(1j * sign * twist)
            bent = np.maximum(bent + mate_bent, LEAST_CURVATURE) if wheel.internal else bent + mate_bent
            normal[rows], curvature[rows] = np.where(bend > mate_bend, *normals[::-1]), bent
            least[rows], places[rows] = twist, np.stack([u, mate], axis=1)
        arm = np.stack([_cross(point, normal), -sign * _cross(point - a, normal)], axis=1)
        every = FirstContacts(position, number, angle, least, places, point, normal, arm, curvature, flank, frames)
        return every.take(np.isfinite(least))


def _met_at(pinion: Face, wheel: Face, a: float, frames: Array, u: Array) -> tuple[Array, Array]:
    """Return D (rad) at parameters u of the pinion's flank, and the radii there about the wheel's centre (m), both of
    shape (n, m). D is infinite where the wheel's flank has no such radius.

    Parameters
    ----------
    a
        x of the wheel's centre (m).
    frames : ndarray, shape (n, 2)
        Angles of the teeth at zero twist (rad).
    """
    turn = np.exp(1j * frames)
    seen = pinion.points(u) * turn[:, :1] - a
    radius, (low, *_, high) = np.abs(seen), (wheel.radii[::-1] if wheel.internal else wheel.radii)
    mate = wheel.points(wheel.at_radius(radius)) * turn[:, 1:]
    between = np.angle(mate / seen) if wheel.internal else np.angle(seen / mate)
    reached = (radius >= low * (1 - 1e-15)) if wheel.internal else (radius >= low)
    return np.where(reached & (radius <= high * (1 + 1e-15)), between, np.inf), radius


def _least(pinion: Face, wheel: Face, a: float, frames: Array) -> tuple[Array, Array]:
    """Return the parameters of the pinion's flank at which n tooth pairs touch first, and the least twists (rad) there.
    These are infinite where the pairs do not meet. The arguments are those of `_met_at`.
    """
    pieces = [len(face.flank.deviation.pieces) for face in (pinion, wheel) if face.flank.deviation is not None]
    coarse, low, high = COARSE + PER_PIECE * max(pieces, default=0), pinion.start, pinion.end
    grid, step = np.broadcast_to(np.linspace(low, high, coarse), (len(frames), coarse)), (high - low) / (coarse - 1)
    values, radii = _met_at(pinion, wheel, a, frames, grid)
    best, least, _ = _lowest(grid, values, step)
    mark_row, mark_place, mark_least = _marks_below(pinion, wheel, a, frames, grid, values, radii, least)
    row = np.append(np.arange(len(frames)), mark_row)
    best, least = np.append(best, mark_place), np.append(least, mark_least)
    open_, change = np.flatnonzero(np.isfinite(least)), np.zeros(len(least))
    for _ in range(1, REFINEMENTS):
        if len(open_) == 0:
            break
        reach = 1.5 * step
        middle = np.minimum(np.maximum(best[open_], low + reach), high - reach)[:, None]
        u = np.minimum(np.maximum(middle + reach * _CLOSER, low), high)
        step = 2.0 * reach / (CLOSER - 1)
        place, value, known = _lowest(u, _met_at(pinion, wheel, a, frames[row[open_]], u)[0], step)
        seen = np.isfinite(value)
        open_, place, value, known = open_[seen], place[seen], value[seen], known[seen]
        change[open_] = np.abs(value - least[open_])
        best[open_], least[open_] = place, value
        lowest = np.full(len(frames), np.inf)
        np.minimum.at(lowest, row, least + change)
        # a further look changes less: it ends where rounding is left, or where another valley of the row is deeper
        open_ = open_[~(known & (change[open_] <= SETTLED)) & (value - change[open_] <= lowest[row[open_]])]
    order = np.lexsort((-least, row))  # of several valleys of a row, the deepest is assigned last
    places, twists = np.zeros(len(frames)), np.full(len(frames), np.inf)
    places[row[order]], twists[row[order]] = best[order], least[order]
    return np.where(np.abs(places) < AT_AN_END, 0.0, places), twists


def _marks_below(
    pinion: Face, wheel: Face, a: float, frames: Array, grid: Array, values: Array, radii: Array, least: Array
) -> tuple[IntArray, Array, Array]:
    """Further places to look closer at: marks of either flank where D may have a valley between the points of a grid.

    An edge, as of an undercut, and the begin of a round or a relief make valleys that are narrower than its steps.

    Parameters
    ----------
    grid, values, radii : ndarray, shape (n, m)
        Rising parameters of the pinion's flank, D there (rad), and radii about the wheel's centre (m).
    least : ndarray, shape (n,)
        Lowest D known (rad).

    Returns
    -------
    row, place, value : ndarray, shape (c,)
        Numbers of the tooth pairs, parameters of the marks and D there (rad).
    """
    goals = np.array(pinion.marks), np.abs(wheel.points(np.array([*wheel.marks, wheel.end])))
    beyond = [x[:, None] > goal[:, None] for x, goal in zip((grid, radii), goals, strict=True)]
    row, mark, k = np.nonzero(np.concatenate([x[:, :, :-1] != x[:, :, 1:] for x in beyond], axis=1))
    low, bend = _going_on(values, row, k)
    deep = low - bend < least[row]
    row, mark, k, bend = row[deep], mark[deep], k[deep], bend[deep]
    place, met = np.concatenate(goals)[mark], mark >= len(goals[0])
    at, inner, outer = row[met], k[met], k[met] + 1
    ends = [(grid[at, n], radii[at, n]) for n in (inner, outer)]
    place[met] = _at_radius(pinion, a, frames[at], place[met], *ends, larger=wheel.internal)
    value = _met_at(pinion, wheel, a, frames[row], place[:, None])[0][:, 0]
    low = value - bend < least[row]
    return row[low], place[low], value[low]


def _going_on(values: Array, row: IntArray, k: IntArray) -> tuple[Array, Array]:
    """Return the lowest value of D between the points k and k + 1 of a row if it is extrapolated from both sides, and
    the larger second difference of both sides, by which it may be lower still (rad). Infinite values do not count.
    """
    near = values[row[:, None], np.clip(k[:, None] + np.arange(-2, 4), 0, values.shape[1] - 1)]
    a, b, c, d, e, f = np.where(np.isfinite(near), near, np.nan).T
    low = np.fmin(np.fmin(c, 2.0 * c - b), np.fmin(d, 2.0 * d - e))
    return low, np.nan_to_num(np.fmax(np.abs(a - 2.0 * b + c), np.abs(f - 2.0 * e + d)))


def _at_radius(
    pinion: Face,
    a: float,
    frames: Array,
    goal: Array,
    inner: tuple[Array, Array],
    outer: tuple[Array, Array],
    *,
    larger: bool = False,
) -> Array:
    """Return the parameters of the pinion's flank with the radii `goal` about the wheel's centre (m), shape (n,), just
    within the smaller radii, or the larger ones. `inner` and `outer` are parameters on either side with the radii
    there.
    """
    turn, side = np.exp(1j * frames[:, 0]), np.where((inner[1] < outer[1]) != larger, -AT_AN_END, AT_AN_END)
    (u, off), (u_outer, off_outer) = (inner[0], inner[1] - goal), (outer[0], outer[1] - goal)
    for _ in range(MARK_STEPS if len(goal) else 0):  # regula falsi, by Illinois
        middle = u - off * (u_outer - u) / (off_outer - off)
        off_middle = np.abs(pinion.points(middle) * turn - a) - goal
        same = (off_middle > 0.0) == (off_outer > 0.0)
        u, off = np.where(same, u, u_outer), np.where(same, 0.5 * off, off_outer)
        u_outer, off_outer = middle, off_middle
    return np.clip(u_outer + side, pinion.start, pinion.end)


def _lowest(u: Array, values: Array, step: float) -> tuple[Array, Array, BoolArray]:
    """Return the place and the value of the lowest point of the parabola through the lowest value of each row and those
    beside it, `step` apart. The third value tells whether these are finite, so that no end of the mate's flank lies
    between them.
    """
    rows, last = np.arange(len(u)), u.shape[1] - 1
    k = np.argmin(values, axis=1)
    lowest, middle = values[rows, k], np.minimum(np.maximum(k, 1), last - 1)
    before, here, after = (values[rows, middle + j] for j in (-1, 0, 1))
    known = np.isfinite(before + here + after)
    before, after = (np.subtract(one, here, out=np.zeros(len(u)), where=known) for one in (before, after))
    bend = np.where(known & (before + after > 0), before + after, np.inf)
    shift = np.minimum(np.maximum(0.5 * (before - after) / bend, -1.0), 1.0)
    value = here + shift * (0.5 * (after - before) + 0.5 * shift * (before + after))
    better = known & (value < lowest)
    return np.where(better, u[rows, middle] + step * shift, u[rows, k]), np.where(better, value, lowest), known


def candidates(pair: MeshGeometry, angles: Array) -> tuple[IntArray, Array, IntArray]:
    """Pinion teeth whose tip can reach the wheel's tip circle: positions, pinion angles (rad) and tooth numbers."""
    a, tip1, tip2 = pair.wheel_centre, pair.pinion.tip_radius, pair.wheel.tip_radius
    reach = math.acos(min(1.0, max(-1.0, (a * a + tip1 * tip1 - tip2 * tip2) / (2 * a * tip1))))
    reach += pair.pinion.profile.tip_half_angle + 0.5 * pair.mesh_cycle
    half = math.ceil(reach / pair.mesh_cycle)
    number = np.round(-angles / pair.mesh_cycle).astype(np.int64)[:, None] + np.arange(-half, half + 1)
    position, tooth = np.nonzero(np.abs(angles[:, None] + number * pair.mesh_cycle) <= reach)
    return position, angles[position], number[position, tooth]


def _cross(a: ComplexArray, b: ComplexArray) -> Array:
    return np.asarray((np.conj(a) * b).imag)


def first_contact_curve(
    pair: MeshGeometry,
    angles: Array,
    *,
    number: int = 0,
    deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL,
) -> Array:
    """Return the twists of the wheel at which a tooth pair's rigid flanks touch.

    The tooth pair `number` is pinion tooth k and wheel tooth -1 - k. It counts from where a wheel space faces the
    pinion tooth (`MeshGeometry.contact_twist` is where unmodified flanks touch) and is infinite where they cannot
    touch. Without deviations all pairs have one curve, shifted by mesh cycles.

    Parameters
    ----------
    pair : MeshGeometry
        The gears.
    angles : ndarray, shape (n,)
        Pinion angles (rad).
    number : int
        Number of the tooth pair.
    deviations : pair of ToothDeviations
        Of pinion and wheel.

    Returns
    -------
    twist : ndarray, shape (n,)
        In rad; infinite if the flanks cannot touch.
    """
    place = np.asarray(angles, dtype=float)
    numbers = np.full(len(place), number, dtype=np.int64)
    found = ToothFlanks(pair, deviations).first_contacts_of(np.arange(len(place)), place, numbers)
    made = np.full(len(place), np.inf)
    made[found.position] = found.twist
    return made


#: Most steps of Newton's method for the arc at a place along the tangent, its last move in windows, and least cosine
#: between tangent and face.
NEWTON, NEAR, STEEPEST = 4, 1e-3, 0.2
#: Along the pinion's flank x grows with the arc, along the wheel's it falls.
WAY = np.array([1.0, -1.0])
_WAYS = WAY[:, None]


@dataclass(frozen=True)
class Faces:
    """Both faces of p contacts as seen from O along n.

    Attributes
    ----------
    turn : ndarray of complex, shape (p, 2)
        q/n.
    offset : ndarray of complex, shape (p, 2)
        ((c - O) + q d)/n (m).
    stretch : ndarray of complex, shape (p, 2)
        d' (-), tooth axes.
    arc : ndarray, shape (p, 2)
        s_0 (m).
    """

    turn: ComplexArray
    offset: ComplexArray
    stretch: ComplexArray
    arc: Array

    def heights(self, flanks: FlankTables, x: Array) -> tuple[Array, Array, ComplexArray]:
        """Arcs (m), heights (m) and undeformed points (m, tooth axes) of the faces at places x (m) of shape (p, n), or
        (p, 2, n) for places of each.

        All have the shape (p, 2, n). Where a face ends before, they are those of its end.
        """
        start, turn = self.arc[:, :, None], self.turn[:, :, None]
        stretch, offset = self.stretch[:, :, None], self.offset[:, :, None]
        x = x[:, None, :] if x.ndim == 2 else x
        close = NEAR * (x.max(axis=2, keepdims=True) - x.min(axis=2, keepdims=True))
        s = np.minimum(np.maximum(start + _WAYS * x, flanks.low), flanks.high)
        for _ in range(NEWTON):
            (a, b, c, d), t = flanks.pieces(s)
            tangent = ((3 * d * t + 2 * c) * t + b + stretch) * turn
            seen = (((d * t + c) * t + b) * t + a + stretch * (s - start)) * turn + offset
            move = _WAYS * (x + seen.imag) / np.maximum(STEEPEST, -_WAYS * tangent.imag)
            new = np.minimum(np.maximum(s + move, flanks.low), flanks.high)
            s = new
            if (np.abs(move) <= close).all():
                break
        (a, b, c, d), t = flanks.pieces(s)  # the last move may have crossed the begin of a relief
        point = ((d * t + c) * t + b) * t + a
        return s, ((point + stretch * (s - start)) * turn + offset).real, point

    def range(self, flanks: FlankTables, ends: Array) -> tuple[Array, Array]:
        """Least and largest x (m) that both faces reach between their arcs `ends` (m), shape (p, 2, 2)."""
        seen = flanks.points(ends) + self.stretch[:, :, None] * (ends - self.arc[:, :, None])
        x = -(seen * self.turn[:, :, None] + self.offset[:, :, None]).imag
        return np.maximum(x[:, 0, 0], x[:, 1, 1]), np.minimum(x[:, 0, 1], x[:, 1, 0])


@dataclass(frozen=True)
class Windows:
    """Where p contacts can be.

    Attributes
    ----------
    low, high : ndarray, shape (p,)
        Ends of the window along x (m).
    nearest : ndarray, shape (p,)
        x where the faces are nearest to each other (m).
    mean_slope : ndarray, shape (p,)
        Slope of the mean of both faces there (-).
    """

    low: Array
    high: Array
    nearest: Array
    mean_slope: Array


#: Places at which a window is searched for, in units of the contact's expected half width.
LOOK = np.concatenate([-np.geomspace(0.03, 30, 20)[::-1], [0.0], np.geomspace(0.03, 30, 20)])


def windows(x: Array, h: Array, gap: Array, depth: Array) -> Windows:
    """Windows in which the gap is at most `depth` (m) above its least, linear in its root between places.

    Parameters
    ----------
    x, h : ndarray, shape (p, m), (p, 2, m)
        Rising places along the tangent (m), and heights of the faces there (m).
    gap, depth : ndarray, shape (p, m), (p,)
        m.
    """
    count = x.shape[1]
    row, number, last = count * np.arange(len(x)), np.arange(count), count - 1
    nearest = np.argmin(gap, axis=1)
    over = np.sqrt(gap - gap.take(row + nearest)[:, None]) - np.sqrt(depth)[:, None]
    wide = over > 0
    before, beyond = wide & (number < nearest[:, None]), wide & (number > nearest[:, None])
    ends = []
    for first, way in ((last - np.argmax(before[:, ::-1], axis=1), 1), (np.argmax(beyond, axis=1), -1)):
        # the first place that is out of the window, and the one before it; there is none past the last place
        outer = row + np.where(first * way < nearest * way, first, 0 if way > 0 else last)
        inner = np.minimum(np.maximum(outer + way, row), row + last)
        a, b, start = over.take(inner), over.take(outer), x.take(inner)
        share = np.where(b > np.maximum(a, 0), -a / np.where(b > a, b - a, 1.0), 1.0)
        ends.append(start + np.minimum(np.maximum(share, 0), 1) * (x.take(outer) - start))
    left, right = row + np.maximum(nearest - 1, 0), row + np.minimum(nearest + 1, last)
    middle = h[:, 0] + h[:, 1]
    rise = 0.5 * (middle.take(right) - middle.take(left))
    slope = rise / np.maximum(1e-12, x.take(right) - x.take(left))
    return Windows(ends[0], ends[1], x.take(row + nearest), slope)
