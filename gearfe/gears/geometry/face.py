r"""Describe the working flank of a tooth by a parameter and by its arc length, and list the flanks of a gear.

A working flank consists of root, involute with its relief, and tip round.

Roots take no part in the first contact of rigid flanks, except where one is undercut. The involute then starts with an
edge, which can carry load as a sharp tip does. The mate's tip passes so close below this edge that the root may be
touched first.

**By arc length** it is one tabulated curve. Between knots on the exact curve, points are cubic in the arc length s,
with the exact points and unit tangents at both ends (Hermite). With :math:`\tau = s - s_i` that is
:math:`z(s) = z_i + t_i\tau + c_i\tau^2 + d_i\tau^3`. The knots include all marks, so kinks stay sharp; the error is
:math:`h^4\kappa''/384` of the curvature :math:`\kappa`, 1e-15 m on usual flanks, more near a base circle.

A flank with a deviation is tabulated by the arc length of the flank without it, so the same material has the same s
however far a waviness lengthens the curve. The tangents are longer than 1 by half the square of the deviation's slope.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from .curves import Arc, Involute, Root
from .deviation import Deviation
from .involute import deviated
from .spur_gear import Gear

#: A place is an end of the range, or a mark, when it is so near to it: places have the rounding of angles and radii.
AT_AN_END = 1e-9
#: Parameters on either side of a point between which a face's turning is taken.
BESIDE = 1e-5
#: Knots on the involute, on the tip round and on the upper half of the root.
INVOLUTE, ROUND, ROOT = 513, 65, 129
#: One-sided parameter (of a length of 1) at which the tangent at a knot is taken. It bows a piece too little, by a
#: quarter of its length times the angle by which the curve turns along this: below rounding.
BESIDE_KNOT = 1e-12
#: Most cells of the grid that finds the piece at an arc length.
MOST_CELLS = 1 << 15

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class Face:
    """Working flank of a gear in the frame of its tooth: u in [0, 1] is the involute, in [1, 2] the tip round, in
    [-0.5, 0] the upper half of the root.

    Attributes
    ----------
    flank
        Involute with relief and deviation, parameter linear in the roll length.
    round_
        Tip round, or None.
    root
        Trochoid of the root, or None.
    undercut
        Whether the involute starts with an edge, so that the root belongs to what can touch.
    """

    flank: Involute
    round_: Arc | None = None
    root: Root | None = None
    undercut: bool = False

    @property
    def start(self) -> float:
        """First parameter at which it can touch."""
        return -0.5 if self.undercut else 0.0

    @property
    def end(self) -> float:
        """Last parameter."""
        return 1.0 if self.round_ is None else 2.0

    @property
    def internal(self) -> bool:
        """Whether it is the flank of an internal gear, whose radii fall towards the tip."""
        return self.flank.base_radius < 0.0

    @property
    def sharp(self) -> bool:
        """Whether the flank ends in a corner."""
        return self.round_ is None

    def points(self, u: Array) -> ComplexArray:
        """Points (m) as complex numbers."""
        return self._of_curves("point", u)

    def normals(self, u: Array) -> ComplexArray:
        """Outward unit normals as complex numbers."""
        return self._of_curves("normal", u)

    def speeds(self, u: Array) -> Array:
        """Arc length per unit of u (m)."""
        return self._of_curves("speed", u)

    def _of_curves(self, what: str, u: Array) -> Any:
        """A quantity of the curve that each parameter lies on."""
        made = np.array(getattr(self.flank, what)(np.minimum(np.maximum(u, 0.0), 1.0)))
        for curve, there, start in ((self.round_, u > 1.0, 1.0), (self.root, u < 0.0, -1.0)):
            if curve is not None and there.any():
                made[there] = getattr(curve, what)(u[there] - start)
        if what == "point":
            made = np.where(u < 0.0, made + self.root_offset, made)
        return made

    @cached_property
    def root_offset(self) -> complex:
        """Displacement (m) of the root with a deviation: it ends where the involute starts, without a step."""
        if self.root is None or self.flank.deviation is None:
            return 0.0
        return complex((self.flank.point(np.zeros(1)) - self.root.point(np.ones(1)))[0])

    @cached_property
    def kinks(self) -> Array:
        """Rising parameters of the kinks of relief and deviation."""
        return self.flank.parameter(np.array(self.flank.kinks))

    @cached_property
    def radii(self) -> tuple[float, ...]:
        """Radii (m) of where it starts, of both ends of the involute, and of its end."""
        return tuple(np.abs(self.points(np.array([self.start, 0.0, 1.0, self.end]))).tolist())

    def at_radius(self, radius: Array) -> Array:
        """Parameter u of the points at given radii (m) within the range."""
        above, low = self._above_root(radius), radius < self.radii[1]
        if self.root is None or not (self.undercut and low.any()):
            return above
        return np.where(low, self._in_root(self.root, radius), above)

    def _in_root(self, root: Root, radius: Array) -> Array:
        """Parameter u in the root by Newton's method from a table; the radius grows all along it."""
        v = np.linspace(0.5, 1.0, 65)
        v = np.interp(radius, np.abs(root.point(v) + self.root_offset), v)
        for _ in range(3):
            point, along = root.point(v) + self.root_offset, -1j * root.normal(v)
            rate = (point.conj() * along).real / np.abs(point) * root.speed(v)
            v = np.clip(v + (radius - np.abs(point)) / rate, 0.5, 1.0)
        return v - 1.0

    def _above_root(self, radius: Array) -> Array:
        u = np.minimum(np.maximum(self.flank.parameter(self.flank.roll_at(radius)), 0.0), 1.0)
        if self.round_ is None:
            return u
        arc = self.round_
        centre = complex(*arc.centre)
        distance = abs(centre)
        cosine = (radius**2 - distance**2 - arc.radius**2) / (2.0 * distance * arc.radius)
        # the round is passed clockwise from the flank to the tip, on the left of its centre's ray (internal: the right)
        beside = np.arccos(np.clip(cosine, -1.0, 1.0))
        angle = math.atan2(centre.imag, centre.real) + (-beside if self.internal else beside)
        along = np.clip((angle - arc.start_angle) / (arc.end_angle - arc.start_angle), 0.0, 1.0)
        beyond = radius < self.radii[2] if self.internal else radius > self.radii[2]
        return np.where(beyond, 1.0 + along, u)

    def corners(self, u: Array) -> BoolArray:
        """Whether the face has a corner at u: a sharp tip, an undercut's edge, a kink (where a linear relief starts).

        Its normal may be any of a fan there, and without friction the force takes that of the smooth mate.
        """
        found = np.asarray((u >= self.end - AT_AN_END) & self.sharp)
        if self.undercut:
            found = found | (np.abs(u) < AT_AN_END)
        for kink in self.kinks:
            found = found | (np.abs(u - kink) <= AT_AN_END)
        return found

    def turning(self, u: Array) -> tuple[Array, Array]:
        """Curvature at u, and how much the normal turns around u per length, across marks, too (1/m); both are
        infinite at corners.

        Hollows of an external gear's flank count as flat; an internal gear's flank has a negative curvature.
        """
        at = np.minimum(np.maximum(u, self.start), 1.0)
        before, after = np.maximum(at - BESIDE, self.start), np.minimum(at + BESIDE, 1.0)
        for mark in self.marks:  # the curvature is not taken across it, beside which it is another
            if self.start < mark < 1.0:
                below = at <= mark
                before = np.where(below, before, np.maximum(before, mark))
                after = np.where(below, np.minimum(after, mark), after)
        around = np.minimum(np.maximum([u - BESIDE, u + BESIDE], self.start), self.end)
        normals = self.normals(np.stack([before, after, *around]))
        turned = np.angle(normals[::2] / normals[1::2])
        curvature = (turned[0] if self.internal else np.maximum(turned[0], 0.0)) / (self.speeds(at) * (after - before))
        if self.round_ is not None:
            curvature = np.where(u > 1.0, 1.0 / self.round_.radius, curvature)
        made = curvature, np.abs(turned[1]) / np.abs(np.subtract(*self.points(around)))
        curvature, bend = np.where(self.corners(u), math.inf, made)
        return curvature, bend

    @cached_property
    def marks(self) -> list[float]:
        """Parameters where the curvature jumps or the flank ends sharply."""
        found = [0.0, 1.0] if self.undercut else [1.0]
        if self.flank.amount > 0.0:
            found.append(float(self.flank.parameter(self.flank.relief_start)))
        return sorted({*found, *self.kinks.tolist()})

    @cached_property
    def knots(self) -> Array:
        """Rising parameters u of the k knots, from the middle of the root's trochoid (if any) to the end at the tip."""
        parts = [np.linspace(0, 1, INVOLUTE), np.linspace(1, self.end, ROUND), [m for m in self.marks if m < self.end]]
        return np.unique(np.concatenate([*parts, [] if self.root is None else np.linspace(-0.5, 0, ROOT)]))

    @cached_property
    def arc(self) -> Array:
        """Arc lengths s (m) of the knots without deviation, 0 where the involute starts, rising to the tip."""
        half = 0.5 * np.diff(self.knots)
        places = self.knots[:-1, None] + half[:, None] * (1 + _GAUSS_X)
        s = np.concatenate([[0.0], np.cumsum((self._nominal.speeds(places) @ _GAUSS_W) * half)])
        return np.asarray(s - s[np.searchsorted(self.knots, 0.0)])

    @cached_property
    def cubic(self) -> ComplexArray:
        """Coefficients of the powers of s - arc[i] in the pieces i between knots, in rising order, (4, k - 1)."""
        u, points = self.knots, self.points(self.knots)
        h, chord = np.diff(self.arc), np.diff(points)
        ends = np.clip([u[:-1] + BESIDE_KNOT, u[1:] - BESIDE_KNOT], u[0], u[-1])  # of each piece, from within
        speed = self._nominal.speeds(ends)
        stretch = np.where(speed > 0, self.speeds(ends) / np.where(speed > 0, speed, 1), 1)
        before, after = -1j * self.normals(ends) * stretch
        return np.stack(
            [points[:-1], before, (3 * chord / h - 2 * before - after) / h, (before + after - 2 * chord / h) / h**2]
        )

    @cached_property
    def misses(self) -> Array:
        r"""About how far the pieces are from the exact curve (m), shape (k - 1,): :math:`h^4\kappa''/384`.

        :math:`\kappa'' \approx 6\,\Delta d/h` is that of the lesser step of the third coefficients to the next pieces:
        no kink's.
        """
        step = np.abs(np.diff(self.cubic[3]))
        return np.asarray(np.diff(self.arc) ** 3 * np.minimum(np.append(step, step[-1]), np.append(step[0], step)) / 64)

    @cached_property
    def _nominal(self) -> Face:
        return replace(self, flank=replace(self.flank, deviation=None))

    @cached_property
    def _table(self) -> FlankTables:
        return flank_tables((self,))

    def at(self, s: Array) -> tuple[ComplexArray, ComplexArray]:
        """Points (m) and tangents dz/ds towards the tip at arc lengths s (m) within the curve."""
        points, tangents = self._table.at(np.asarray(s)[None])
        return points[0], tangents[0]

    def arc_at(self, u: Any) -> Array:
        """Arc lengths (m) of parameters u, linear between the knots."""
        return np.interp(u, self.knots, self.arc)

    def parameter_at(self, s: Any) -> Array:
        """Parameters u of arc lengths s (m), linear between the knots."""
        return np.interp(s, self.arc, self.knots)


def face_of(gear: Gear, deviation: Deviation | None = None) -> Face:
    """Working flank of a gear, with a deviation of micrometres."""
    profile = gear.profile
    flank, round_, root = profile.flank, profile.round_, profile.root
    if deviation:
        flank, round_ = deviated(gear, flank, deviation)
    # going up a convex flank its normal turns clockwise
    edge = profile.undercut and root is not None and np.angle(root.normal(np.array(1.0)) / flank.normal(np.array(0.0)))
    return Face(flank, round_, root, bool(edge and edge > 0.0))


@dataclass(frozen=True)
class FlankTables:
    """Several flanks in one table of k pieces, so that one look-up serves all: flanks in an axis of the arc lengths.

    Attributes
    ----------
    low, high : ndarray, shape (f, 1)
        First and last arc length of the f flanks (m).
    cells, start : ndarray, shape (f, 1)
        Cells per metre of a uniform grid on each flank, and the number of its first cell.
    piece : ndarray, shape (all cells,)
        The piece in which each cell starts.
    arc, beyond : ndarray, shape (k,)
        Arc length where each piece starts, and where the next one of the flank does (m).
    cubic : ndarray of complex, shape (4, k)
        As in `Face`.
    misses : ndarray, shape (k,)
        As in `Face` (m).
    steps
        Most pieces that start within a cell.
    """

    low: Array
    high: Array
    cells: Array
    start: IntArray
    piece: IntArray
    arc: Array
    beyond: Array
    cubic: ComplexArray
    misses: Array
    steps: int

    @cached_property
    def ends(self) -> Array:
        """First and last arc lengths (m), shape (f, 2)."""
        return np.concatenate([self.low, self.high], axis=-1)

    def of(self, flank: IntArray) -> FlankTables:
        """The same table with other axes of flanks: the flanks `flank`, shape (..., g), for arc lengths (..., g, m)."""
        return replace(
            self, low=self.low[flank], high=self.high[flank], cells=self.cells[flank], start=self.start[flank]
        )

    def piece_at(self, s: Array) -> IntArray:
        """Numbers of the pieces at arc lengths s (m), shape (..., f, m)."""
        i = self.piece.take(((s - self.low) * self.cells).astype(np.int64) + self.start)
        for _ in range(self.steps):
            i = i + (s >= self.beyond.take(i))
        return i

    def pieces(self, s: Array) -> tuple[ComplexArray, Array]:
        """Coefficients, shape (4, ..., f, m), and arc lengths within the pieces, for arc lengths s (m), (..., f, m)."""
        i = self.piece_at(s)
        return self.cubic.take(i, axis=1), s - self.arc.take(i)

    def at(self, s: Array) -> tuple[ComplexArray, ComplexArray]:
        """Points (m) and tangents dz/ds towards the tips at arc lengths s (m), shape (..., f, m), within the flanks."""
        (a, b, c, d), t = self.pieces(s)
        return ((d * t + c) * t + b) * t + a, (3 * d * t + 2 * c) * t + b

    def points(self, s: Array) -> ComplexArray:
        """Points alone."""
        (a, b, c, d), t = self.pieces(s)
        return np.asarray(((d * t + c) * t + b) * t + a)


def flank_tables(faces: Sequence[Face]) -> FlankTables:
    """One table of several flanks."""
    counts, pieces, steps, first = [], [], 1, 0
    for face in faces:
        length = face.arc[-1] - face.arc[0]
        count = min(MOST_CELLS, math.ceil(length / np.diff(face.arc).min()))
        ends = face.arc[0] + length * np.arange(count + 1) / count
        found = np.clip(np.searchsorted(face.arc, ends, side="right") - 1, 0, len(face.arc) - 2)
        steps = max(steps, int(np.diff(found).max()))  # rounding beside a piece's end does not matter
        pieces.append(found + first)
        counts.append(count)
        first += len(face.arc) - 1
    low, high = (np.array([[face.arc[end]] for face in faces]) for end in (0, -1))
    return FlankTables(
        low=low,
        high=high,
        cells=np.array(counts)[:, None] / (high - low),
        start=(np.cumsum([0, *(count + 1 for count in counts[:-1])]))[:, None],
        piece=np.concatenate(pieces),
        arc=np.concatenate([face.arc[:-1] for face in faces]),
        beyond=np.concatenate([np.append(face.arc[1:-1], np.inf) for face in faces]),
        cubic=np.concatenate([face.cubic for face in faces], axis=1),
        misses=np.concatenate([face.misses for face in faces]),
        steps=steps,
    )


@dataclass(frozen=True)
class ToothDeviations:
    """Deviations of the working flanks of a gear's teeth.

    Attributes
    ----------
    profiles : tuple of Deviation or None
        The distinct profiles; None: the involute as the gear has it.
    profile : tuple of int
        Number of each tooth's profile, one entry a tooth, or one for all.
    turn : tuple of float
        Pitch errors as the turn (rad) of each tooth's flank about the gear's centre, > 0 counter-clockwise (internal
        gears: clockwise). That is out of the material of the driving flanks, which then touch earlier. One entry a
        tooth, or one for all.
    """

    profiles: tuple[Deviation | None, ...] = (None,)
    profile: tuple[int, ...] = (0,)
    turn: tuple[float, ...] = (0.0,)

    def __post_init__(self) -> None:
        if not self.profiles or min(self.profile) < 0 or max(self.profile) >= len(self.profiles):
            raise InputError("profile", self.profile, f"must be numbers of the {len(self.profiles)} profiles")

    def check(self, teeth: int) -> None:
        """Raise `InputError` for a list that has neither one entry nor one a tooth."""
        for name in ("profile", "turn"):
            if len(getattr(self, name)) not in (1, teeth):
                problem = f"must have one entry, or one for each of the {teeth} teeth"
                raise InputError(name, len(getattr(self, name)), problem, "give as many as the gear has teeth")

    @property
    def alike(self) -> bool:
        """Whether all teeth are the same."""
        return len(set(self.profile)) == 1 and len(set(self.turn)) == 1

    def profile_of(self, tooth: IntArray) -> IntArray:
        """Numbers of the profiles of teeth, which count on round the gear."""
        return np.asarray(np.array(self.profile, dtype=np.int64)[tooth % len(self.profile)])

    def turn_of(self, tooth: IntArray) -> Array:
        """Their turns (rad)."""
        return np.asarray(np.array(self.turn, dtype=float)[tooth % len(self.turn)])


#: Gears as their geometry says.
NOMINAL = (ToothDeviations(), ToothDeviations())
