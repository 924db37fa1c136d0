"""A mechanism described in a frame that turns at a constant rate about the ground's origin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...base.typing import Array
from .bodies import Frames
from .forces import Along, Force, StateFunction, Tension, Weight

if TYPE_CHECKING:
    from .linkage import Linkage
    from .variables import BodyVariables


@dataclass(frozen=True)
class TurningFrame(Force):
    """Centrifugal and Coriolis forces of a frame with the angular velocity `rate` w (rad/s), on all masses:

        m (w^2 x + 2 w y'),    m (w^2 y - 2 w x').

    Flexible links take theirs from here, too. An equilibrium is a steady rotation then, and modes are
    the vibrations about it. Energies are those of the frame; the potential has the centrifugal forces in it.
    """

    rate: float
    name: str = "turning frame"

    def parts(self, frames: Frames) -> list[Along | Tension | Weight]:
        """Springs of negative stiffness, and loads that depend on the velocities."""
        components: list[Along | Tension | Weight] = []
        for i, body in enumerate(frames.bodies):
            if body.mass > 0.0:
                centre, pull = frames.centre(body.name), body.mass * self.rate
                components.append(Along(centre.x, -pull * self.rate, load=Coriolis(3 * i + 1, 2.0 * pull)))
                components.append(Along(centre.y, -pull * self.rate, load=Coriolis(3 * i, -2.0 * pull)))
        return components


def field_and_rate(linkage: Linkage) -> tuple[Array, float]:
    """Uniform field (m/s2) that acts on a linkage, and the rate of its turning frame (rad/s)."""
    field = np.zeros(2)
    for force in linkage.forces:
        for part in force.parts(linkage.frames):
            if isinstance(part, Weight):
                field += part.acceleration
    return field, sum(f.rate for f in linkage.forces if isinstance(f, TurningFrame))


class Coriolis(StateFunction):
    """A load in proportion to one velocity."""

    def __init__(self, place: int, factor: float) -> None:
        self.place, self.factor = place, factor

    def value(self, t: float, q: Array, v: Array) -> float:  # noqa: ARG002
        """Factor times velocity."""
        return float(self.factor * v[self.place])

    def write(self, bodies: BodyVariables) -> int:
        """A rate."""
        return bodies.tape.rate({bodies.places[self.place]: self.factor})
