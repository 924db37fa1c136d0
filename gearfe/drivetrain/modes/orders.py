"""Orders of a train: multiples of its mesh frequencies and of its shafts' turns, in cycles a turn of the drive."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

from ..train.model import TrainModel


@dataclass(frozen=True)
class TrainOrder:
    """What may excite a train: an order of its meshes or shafts.

    Attributes
    ----------
    order
        Cycles in a turn of the drive.
    names
        What has this order, such as ``2 x mesh 1`` and ``1 x shaft output``.
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
    return [found[order] for order in sorted(found)]
