"""Solved positions of a gear pair: what the hubs feel, the contacts, and the nodal loads that make fields.

Arrays have one entry a position. Contacts, teeth and points of the positions have records of their own, sorted by the
number of the position.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.progress import count
from ...base.typing import Array, BoolArray, ComplexArray, Dataclass, IntArray


@cache
def _names(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def taken(record: Dataclass, index: Any) -> Dataclass:
    """The entries `index` of every array, of records within the record likewise."""
    own = [getattr(record, name) for name in _names(type(record))]
    return type(record)(*(v[index] if isinstance(v, np.ndarray) else taken(v, index) for v in own))


def joined(parts: Sequence[Dataclass]) -> Dataclass:
    """Records of one kind, one after the other."""
    if len(parts) == 1:
        return parts[0]
    own = [[getattr(part, name) for part in parts] for name in _names(type(parts[0]))]
    return type(parts[0])(*(np.concatenate(v) if isinstance(v[0], np.ndarray) else joined(v) for v in own))


def of_positions(record: Dataclass, chosen: IntArray) -> Dataclass:
    """The entries of the positions `chosen`, numbered in their order; the record's are sorted by `position`."""
    where: Any = record
    first, end = (np.searchsorted(where.position, chosen, side=side) for side in ("left", "right"))
    made: Any = taken(record, ranges(first, end - first))
    return replace(made, position=np.repeat(np.arange(len(chosen)), end - first))


def ranges(starts: IntArray, lengths: IntArray) -> IntArray:
    """All of start, start + 1, ..., start + length - 1, one after the other."""
    ends = np.cumsum(lengths)
    return np.repeat(starts - ends + lengths, lengths) + np.arange(ends[-1] if len(ends) else 0)


@dataclass(frozen=True)
class Contacts:
    """Loaded contacts, m of them over all positions, by position, pair number and place on the pinion's flank.

    By the half-plane law a tooth pair has one contact for each stretch of its flanks that carries load. By laws on the
    mesh it has one, without panels.

    Attributes
    ----------
    position : ndarray, shape (m,)
        Number of the position.
    pair : ndarray, shape (m,)
        Pair number k: pinion tooth k, wheel tooth -1 - k.
    force : ndarray, shape (m,)
        Contact force on the whole width (N).
    torque_wheel : ndarray, shape (m,)
        Moment of the force about the wheel's hub (N m), at the deformed place: share in the position's `torque_wheel`.
    point, normal : ndarray of complex, shape (m,)
        Centre of pressure (m) and direction of the force on the wheel, global axes.
    arc : ndarray, shape (m, 2)
        The material there on pinion and wheel: arc length from the start of the working flank (m).
    half_width : ndarray, shape (m,)
        b = 2 sqrt(variance of the pressure about its mean) (m): Hertz's where the pressure is elliptic.
    force_rate, normal_rate, growth : ndarray, shape (m,)
        d force/d twist (N/rad), the normal's rotation per twist (-), and d ln b/d twist (1/rad).
    arc_rate : ndarray, shape (m, 2)
        d arc/d twist (m/rad).
    x, width, pressure : ndarray, shape (m, n)
        Panels: middles along the tangent -i n from the centre of pressure, widths (m), and pressures (Pa).
    panel_arc : ndarray, shape (m, 2, n)
        Arc lengths of the panels' middles on both faces (m).
    """

    position: IntArray
    pair: IntArray
    force: Array
    torque_wheel: Array
    point: ComplexArray
    normal: ComplexArray
    arc: Array
    half_width: Array
    force_rate: Array
    normal_rate: Array
    growth: Array
    arc_rate: Array
    x: Array
    width: Array
    pressure: Array
    panel_arc: Array

    def __len__(self) -> int:
        return len(self.pair)

    def with_rates(self, ahead: Contacts, by: Array) -> Contacts:
        """These with the rates that lead to the same ones `ahead`, at twists larger by `by` (rad), shape (m,)."""
        with np.errstate(divide="ignore", invalid="ignore"):  # contacts without load have no width
            growth = 0.5 * ((ahead.half_width / self.half_width) ** 2 - 1) / by
        return replace(
            self,
            force_rate=(ahead.force - self.force) / by,
            normal_rate=np.angle(ahead.normal / self.normal) / by,
            growth=growth,
            arc_rate=(ahead.arc - self.arc) / by[:, None],
        )

    def without_panels(self) -> Contacts:
        """Return the contacts without their panels, for many positions in little memory."""
        panels = ("x", "width", "pressure", "panel_arc")
        return replace(self, **{name: getattr(self, name)[..., :0] for name in panels})

    def moved(self, by: Array) -> Contacts:
        """These at twists larger by `by` (rad), one number a position: forces and widths."""
        here = by[self.position]
        force = np.maximum(self.force + self.force_rate * here, 0.0)
        scale = np.divide(force, self.force, out=np.ones(len(force)), where=self.force > 0)
        return replace(
            self,
            force=force,
            torque_wheel=self.torque_wheel * scale,
            half_width=self.half_width * np.exp(self.growth * here),
        )


@dataclass(frozen=True)
class FlankLoads:
    """Loads on the contact surfaces of m teeth of one gear, tooth axes.

    Attributes
    ----------
    position, tooth : ndarray, shape (m,)
        Number of the position, and of the tooth.
    force, rate : ndarray, shape (m, f)
        Forces on the nodes of the tooth's contact surface (N) and their derivatives with respect to the twist (N/rad).
    """

    position: IntArray
    tooth: IntArray
    force: Array
    rate: Array

    def felt(self, position: IntArray, tooth: IntArray, teeth: int) -> tuple[IntArray, IntArray, IntArray]:
        """All couples of c teeth at positions, both of shape (c,), with the loads of the same position.

        Returns the numbers of the tooth and of the load, and how many teeth the first is ahead of the second. That is
        the number least in size on a gear with so many `teeth`.
        """
        first, end = (np.searchsorted(self.position, position, side=side) for side in ("left", "right"))
        of, load = np.repeat(np.arange(len(position)), end - first), ranges(first, end - first)
        return of, load, (tooth[of] - self.tooth[load] + teeth // 2) % teeth - teeth // 2


@dataclass(frozen=True)
class PointPressures:
    """Pressures at the contact points of a law on the mesh, or on the panels of the half-plane law, q of them.

    Attributes
    ----------
    position, gear, pair : ndarray, shape (q,)
        Number of the position, gear (0 pinion, 1 wheel) and tooth pair.
    place : ndarray, shape (q,)
        Edge number plus position in the edge, along the tooth's whole contact surface. On a gear without contact points
        of its own (one-sided laws) the closest places to those of the mate.
    pressure : ndarray, shape (q,)
        Pa.
    """

    position: IntArray
    gear: IntArray
    pair: IntArray
    place: Array
    pressure: Array


#: Where nothing was asked for.
NO_LOADS = FlankLoads(*np.zeros((2, 0), dtype=np.int64), *np.zeros((2, 0, 0)))
NO_POINTS = PointPressures(*np.zeros((3, 0), dtype=np.int64), *np.zeros((2, 0)))


@dataclass(frozen=True)
class Positions:
    """Solutions of n positions. `positions[i]` is one of them, with numbers instead of arrays of shape (n,).

    Attributes
    ----------
    pinion_angle, twist : ndarray, shape (n,)
        rad, the twist from where a wheel space faces the pinion tooth.
    status : ndarray of str, shape (n,)
        ``converged``, ``no_contact`` (the undeformed gears are clear of each other), ``under_resolved`` (elements too
        coarse for the contact) or ``not_converged``. Torques are 0 without contact, NaN when not solved.
    torque_wheel, torque_pinion : ndarray, shape (n,)
        Moments that the hubs need, energy-conjugate: sum of (x - c) x f over the current places (N m).
    torque_wheel_reaction : ndarray, shape (n,)
        Moment of the reactions at the wheel's bore: sum of (x - u - c) x f (N m).
    tangent : ndarray, shape (n,)
        d torque_wheel / d twist (N m/rad).
    iterations : ndarray, shape (n,)
        Newton steps.
    energy : ndarray, shape (n,)
        Elastic energy (J): the work of the contact forces.
    contacts
        That carry load.
    loads, points
        What fields need, loads of pinion and wheel and pressures along the flanks, at the positions where it was asked
        for.
    """

    pinion_angle: Array
    twist: Array
    status: NDArray[np.str_]
    torque_wheel: Array
    torque_pinion: Array
    torque_wheel_reaction: Array
    tangent: Array
    energy: Array
    iterations: IntArray
    contacts: Contacts
    loads: tuple[FlankLoads, ...] = (NO_LOADS, NO_LOADS)
    points: PointPressures = NO_POINTS

    def __len__(self) -> int:
        return len(self.twist)

    def __getitem__(self, i: int) -> Positions:
        return self.take(i)

    def __iter__(self) -> Iterator[Positions]:
        return (self[i] for i in range(len(self)))

    def take(self, chosen: int | IntArray | slice) -> Positions:
        """The positions `chosen`."""
        numbers = np.atleast_1d(np.arange(len(self))[chosen])
        return _by_field([self], lambda own: own[0][chosen], lambda own: of_positions(own[0], numbers))

    def replaced(self, places: IntArray, others: Positions) -> Positions:
        """These with `others` at the numbers `places`."""
        index = np.arange(len(self))
        index[places] = len(self) + np.arange(len(others))
        return together([self, others]).take(index)

    def with_status(self, status: NDArray[np.str_]) -> Positions:
        """These with another status: what has not converged has no contacts, loads and numbers."""
        good = status == "converged"
        none = np.where(status == "no_contact", 0.0, np.nan)
        names = (*TORQUES, "energy")
        numbers: dict[str, Any] = {name: np.where(good, getattr(self, name), none) for name in names}
        contacts = taken(self.contacts, good[self.contacts.position])
        return replace(self.with_loads(good), status=status, contacts=contacts, **numbers)

    def raised(self, share: Array) -> Positions:
        """These with torques raised by the shares c = Delta T / T of finite strain, shape (n,).

        Both hubs' torques and the loads take the same factor: the force changes, not its line. The share grows with the
        twist about as the torque does, so the tangent takes 1 + 2 c.
        """
        made = {name: getattr(self, name) * (1 + share) for name in TORQUES}
        made["tangent"] = self.tangent * (1 + 2 * share)
        contacts = replace(self.contacts, torque_wheel=self.contacts.torque_wheel * (1 + share)[self.contacts.position])
        factors = [(1 + share)[one.position, None] for one in self.loads]
        loads = tuple(replace(o, force=o.force * f, rate=o.rate * f) for o, f in zip(self.loads, factors, strict=True))
        return replace(self, contacts=contacts, loads=loads, **made)

    def with_loads(self, kept: BoolArray) -> Positions:
        """These with loads and point pressures of some alone, shape (n,)."""
        loads = tuple(taken(one, kept[one.position]) for one in self.loads)
        return replace(self, loads=loads, points=taken(self.points, kept[self.points.position]))

    def without_loads(self) -> Positions:
        """Return the positions without loads, point pressures and panels, for many positions in little memory."""
        return replace(self.with_loads(np.zeros(len(self), dtype=bool)), contacts=self.contacts.without_panels())


#: Rounding of the gears' angles (rad) below which twists cannot be distinguished.
ANGLE_ROUNDING = 2e-15
#: Type of the names of statuses.
STATUS = "<U18"
#: Numbers of a position that are moments about the hubs, or their rate.
TORQUES = ("torque_wheel", "torque_pinion", "torque_wheel_reaction", "tangent")


def _by_field(parts: Sequence[Positions], of_arrays: Callable[..., Any], of_records: Callable[..., Any]) -> Positions:
    """Positions whose fields are made of those of `parts` that have the same name."""

    def made(own: Sequence[Any]) -> Any:
        if isinstance(own[0], tuple):
            return tuple(made(one) for one in zip(*own, strict=True))
        return of_arrays(own) if isinstance(own[0], np.ndarray) else of_records(own)

    return Positions(*(made([getattr(part, name) for part in parts]) for name in _names(Positions)))


def together(parts: Sequence[Positions]) -> Positions:
    """Positions one after the other; parts without loads join those that have them."""
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(part) for part in parts[:-1])])

    def moved(records: Sequence[Any]) -> Any:
        own = [replace(one, position=one.position + start) for one, start in zip(records, starts, strict=True)]
        return joined([one for one in own if len(one.position)] or own[:1])

    return _by_field(parts, np.concatenate, moved)


#: Positions that are solved side by side: enough to share the calls, few enough to stay small in memory.
BATCH = 128


def in_batches(solve: Callable[[IntArray], Positions], size: int, batch: int = BATCH) -> Positions:
    """Return the positions 0 ... size - 1, of which `solve` gives those numbered, at most `batch` at a time."""
    solved = []
    for start in range(0, max(1, size), batch):
        end = min(start + batch, size)
        solved.append(solve(np.arange(start, end)))
        count(end, size, "positions")
    return together(solved)
