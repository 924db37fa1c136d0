"""The working flanks of all teeth of a gear pair, each tooth with the deviations of its own, and when they touch."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ..typing import Array, IntArray
from .deviation import NOMINAL, ToothDeviations
from .mesh_geometry import MeshGeometry
from .touching import Face, Flanks, Touching, candidates, face_of


class ToothFlanks:
    """Working flanks of pinion and wheel.

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
        gears = (pair.pinion, pair.wheel)
        for gear, own in zip(gears, deviations, strict=True):
            own.check(gear.teeth)
        self._made = [[face_of(gear, one) for one in own.profiles] for gear, own in zip(gears, deviations, strict=True)]
        self.faces: tuple[Face, ...] = (*self._made[0], *self._made[1])

    @cached_property
    def first(self) -> Flanks:
        """The first profiles of both gears."""
        return Flanks(self.pair, (self._made[0][0], self._made[1][0]))

    def gear_of(self, flank: int) -> int:
        """Gear (0 pinion, 1 wheel) of a flank, by its number in `faces`."""
        return int(flank >= len(self._made[0]))

    def flank(self, number: IntArray) -> IntArray:
        """Flanks of the tooth pairs `number` (pinion tooth k, wheel tooth -1 - k): numbers in `faces`, shape (n, 2)."""
        pinion, wheel = self.deviations
        return np.stack([pinion.profile_of(number), wheel.profile_of(-1 - number) + len(pinion.profiles)], axis=1)

    def turn(self, number: IntArray) -> Array:
        """Turns (rad) of these flanks by pitch errors, shape (n, 2)."""
        pinion, wheel = self.deviations
        return np.stack([pinion.turn_of(number), wheel.turn_of(-1 - number)], axis=1)

    def touching(self, angles: Array) -> Touching:
        r"""First touch of every tooth pair that can meet at the given pinion angles (rad), shape (p,).

        A tooth of the pinion turned by :math:`\epsilon_1` is where it would be at an angle larger by that, and one of
        the wheel turned by :math:`\epsilon_2` where a larger twist would have it, so that the pair k touches at the
        twist

        .. math:: t_k(\psi) = t(\psi + \epsilon_1) - \epsilon_1 z_1/z_2 - \epsilon_2

        with t of the same profiles without these turns.
        """
        return self.first_touch(*candidates(self.pair, np.asarray(angles, dtype=float)))

    def first_touch(self, position: IntArray, angle: Array, number: IntArray) -> Touching:
        """The same of the tooth pairs `number` at pinion angles (rad), of those of them that meet; shape (n,)."""
        flank, turn = self.flank(number), self.turn(number)
        couples, couple = np.unique(flank, axis=0, return_inverse=True)
        parts, rows = [], []
        for i, (one, other) in enumerate(couples.tolist()):
            row = np.flatnonzero(couple.ravel() == i)
            flanks = Flanks(self.pair, (self.faces[one], self.faces[other]))
            # the row in place of the position: pairs that do not meet fall out
            parts.append(flanks.first_touch(row, (angle + turn[:, 0])[row], number[row]))
            rows.append(parts[-1].position)
        if not parts:
            return self.first.first_touch(position, angle, number)
        row = np.concatenate(rows)
        order = np.argsort(row, kind="stable")
        row = row[order]
        made = _joined(parts).take(order)
        twist = made.twist - turn[row, 0] / self.pair.gear_ratio - turn[row, 1]
        return replace(made, position=position[row], angle=angle[row], twist=twist, flank=flank[row], turn=turn[row])


def touching_curve(
    pair: MeshGeometry,
    angles: Array,
    *,
    number: int = 0,
    deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL,
) -> Array:
    """Twist of the wheel (rad) at which a tooth pair's rigid flanks touch at pinion angles (rad), shape (n,).

    The tooth pair `number` is pinion tooth k and wheel tooth -1 - k. It counts from where a wheel space faces the
    pinion tooth (`MeshGeometry.contact_twist` is where unmodified flanks touch) and is infinite where they cannot
    touch. Without deviations all pairs have one curve, shifted by mesh cycles.
    """
    place = np.asarray(angles, dtype=float)
    numbers = np.full(len(place), number, dtype=np.int64)
    found = ToothFlanks(pair, deviations).first_touch(np.arange(len(place)), place, numbers)
    made = np.full(len(place), np.inf)
    made[found.position] = found.twist
    return made


def _joined(parts: list[Touching]) -> Touching:
    names = Touching.__dataclass_fields__
    return Touching(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
