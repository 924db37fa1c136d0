"""Orders of a train: multiples of its mesh frequencies and of its shafts' turns, in cycles a turn of the drive."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

from ..train.kinematics import drive_sense
from ..train.model import TrainModel


@dataclass(frozen=True)
class TrainOrder:
    """What may excite a train: an order of its meshes or shafts.

    Attributes
    ----------
    order
        Cycles in a turn of the drive.
    names
        What has this order, such as ``2 x mesh 1``, ``1 x mesh 1 + 1 x carrier arm`` and ``1 x shaft output``.
    meshes, shafts
        Their numbers.
    """

    order: float
    names: tuple[str, ...]
    meshes: tuple[int, ...] = ()
    shafts: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """All names."""
        return " = ".join(self.names)

    def frequency(self, speed: float) -> float:
        """Frequency (Hz) at a speed of the drive (rad/s)."""
        return self.order * abs(speed) / (2.0 * math.pi)


def train_orders(model: TrainModel, multiples: int, shaft_multiples: int) -> list[TrainOrder]:
    """Return the orders of a train by rising order; those that agree are one.

    Parameters
    ----------
    model : TrainModel
        The train.
    multiples, shaft_multiples : int
        Highest multiples of each mesh frequency and of the turns of each shaft.
    """
    found: dict[Fraction, TrainOrder] = {}

    def add(order: Fraction, name: str, meshes: tuple[int, ...] = (), shafts: tuple[int, ...] = ()) -> None:
        known = found.get(order, TrainOrder(float(order), ()))
        found[order] = replace(
            known, names=(*known.names, name), meshes=known.meshes + meshes, shafts=known.shafts + shafts
        )

    rolled = model.kinematics
    for mesh, cycles in enumerate(rolled.cycles):
        for a in range(1, multiples + 1) if cycles else ():  # gears that stand still against each other excite nothing
            add(a * cycles, f"{a} x mesh {mesh + 1}", meshes=(mesh,))
    for shaft, ratio in enumerate(rolled.ratios):
        for a in range(1, shaft_multiples + 1) if ratio else ():
            add(a * abs(ratio), f"{a} x shaft {model.train.shafts[shaft].name}", shafts=(shaft,))
    for order, name, meshes in _sidebands(model, multiples):
        add(order, name, meshes=meshes)
    return [found[order] for order in sorted(found)]


def _sidebands(model: TrainModel, multiples: int) -> Iterator[tuple[Fraction, str, tuple[int, ...]]]:
    """Sidebands of mesh orders that carry something in an elastic housing, where carriers turn.

    The mesh forces across the axis rotate with the carrier. Their harmonics of the order n therefore act on the housing
    at n + c and n - c, with the rotations c of the carrier. With pins out of place both carry something. Sidebands of
    more passes, of a housing that is not alike in all directions, are much smaller: orders.csv of a run-up has them.
    """
    train, rolled = model.train, model.kinematics
    turned = set(model.turned_carriers)
    for family in model.families:
        carrier = next(c for c in train.carriers if c.name == family.carrier)
        number = train.shaft_number(carrier.shaft)
        ratio, cycles = rolled.ratios[number], rolled.cycles[family.meshes[0]]
        if number not in turned or not cycles:
            continue
        uneven = any(any(pin.error) for pin in carrier.pins)
        sense = 1 if float(ratio) * (drive_sense(train.driven.speed) or 1.0) > 0.0 else -1
        for a in range(1, multiples + 1):
            for sign, passes in (("-", -1), ("+", 1)):
                order = a * cycles + passes * abs(ratio)
                mesh, turn = f"{a} x mesh {family.meshes[0] + 1}", f"1 x carrier {carrier.name}"
                if order and (uneven or family.carries(a, sense * passes)):
                    # where the carrier rotates faster than its gears mesh, the lower sideband has a negative order
                    yield abs(order), f"{mesh} {sign} {turn}" if order > 0 else f"{turn} - {mesh}", family.meshes
