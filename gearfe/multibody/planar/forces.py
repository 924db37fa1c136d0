"""Planar forces as plain data, each with the forms and vectors that it acts along.

A new force is a class with `parts`, in this module or another. Its line in `gearfe.base.tables.kinds.FORCES` makes it
known to mechanism files.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from ...base.errors import InputError
from ...base.typing import Array
from ..series.timefunctions import TimeFunction, constant
from .bodies import Frames
from .forms import GROUND, Form, Point, Vector

if TYPE_CHECKING:
    from ..series.tape import Tape
    from .variables import BodyVariables


class StateFunction(ABC):
    """A load f(t, q, v) of the coordinates and velocities of a whole linkage.

    The law is written with the operations of a `Tape`, from which values and derivatives are computed. A load that
    cannot be written so is a `LocalForce`, or the ``force`` of another element (`multibody.core.contract`). Where it
    has no value, steps become shorter until the run ends; `value` is NaN there, and `problem` gives the reason.
    """

    @abstractmethod
    def write(self, bodies: BodyVariables) -> int:
        """Return the register of the value on the tape of the bodies' variables."""

    @abstractmethod
    def value(self, t: float, q: Array, v: Array) -> float:
        """f at a state, for messages."""

    @property
    def described(self) -> str:
        """The load in messages."""
        return "a load"

    def problem(self, t: float, q: Array, v: Array) -> str:
        """Return why it has no value at a state, or an empty string."""
        return "" if math.isfinite(self.value(t, q, v)) else f"a load has no value at {t:.6g} s"

    def pole(self, t: float, value: float) -> str:
        """Return the message for a load that grows beyond all bounds."""
        return f"a load grows beyond {value:.1g} at {t:.6g} s"


class SpanFunction(ABC):
    """A tension T(t, L, L') between two points by their distance L (m) and its rate L' (m/s); as `StateFunction`."""

    @abstractmethod
    def write(self, tape: Tape, length: int, rate: int) -> int:
        """Return the register of the tension from those of length and rate."""

    @abstractmethod
    def value(self, t: float, length: float, rate: float) -> float:
        """T (N), positive where it pulls, for messages."""

    @property
    def described(self) -> str:
        """The tension in messages."""
        return "a tension"

    def problem(self, t: float, length: float, rate: float) -> str:
        """Return why it has no value, or an empty string."""
        return "" if math.isfinite(self.value(t, length, rate)) else f"a tension has no value at {t:.6g} s"


class Along(NamedTuple):
    """Generalised force ``load - stiffness u - damping u'`` along an affine form u."""

    form: Form
    stiffness: float = 0.0
    damping: float = 0.0
    load: TimeFunction | StateFunction | None = None


class Tension(NamedTuple):
    """Tension ``stiffness (L - L0) + damping L' + law(t, L, L')`` along a vector of the length L."""

    vector: Vector
    stiffness: float
    damping: float
    free_length: float
    law: SpanFunction | None = None


class Weight(NamedTuple):
    """Uniform field (m/s2) on every body."""

    acceleration: Point


class Force(ABC):
    """Force on bodies: a frozen dataclass with a `name` and the names of its bodies.

    A force MUST provide `parts`. Fields called ``a``, ``b``, ``body``,
    ``relative_to``, ``reaction`` name bodies, others are numbers, points (m, in the frame of a body), functions of
    time.
    """

    name: str

    @abstractmethod
    def parts(self, frames: Frames) -> list[Along | Tension | Weight]:
        """Return the components of the force."""


@dataclass(frozen=True)
class Gravity(Force):
    """Uniform field (m/s2) on every body."""

    acceleration: Point = (0.0, -9.81)
    name: str = "gravity"

    def parts(self, frames: Frames) -> list[Along | Tension | Weight]:  # noqa: ARG002
        """The field."""
        return [Weight(self.acceleration)]


@dataclass(frozen=True)
class Spring(Force):
    """Spring-damper between two points: tension ``k (L - L0) + c L'`` along the line that joins them.

    With neither free length nor damping the force is k times the span, so the points may coincide. `law` adds any other
    tension by length and rate.
    """

    a: str
    b: str
    point_a: Point = (0.0, 0.0)
    point_b: Point = (0.0, 0.0)
    stiffness: float = 0.0
    damping: float = 0.0
    free_length: float = 0.0
    law: SpanFunction | None = None
    name: str = ""

    def parts(self, frames: Frames) -> list[Along | Tension | Weight]:
        """A tension along the span."""
        span = frames.point(self.b, self.point_b) - frames.point(self.a, self.point_a)
        return [Tension(span, self.stiffness, self.damping, self.free_length, self.law)]


@dataclass(frozen=True)
class CoordinateSpring(Force):
    """Spring and damper on one coordinate of a body's mass centre or angle: ``-k (u - u0) - c u'``.

    `coordinate` is ``"x"``, ``"y"`` (m, of the mass centre, against the ground) or ``"angle"`` (rad, against the body
    `relative_to`: a torsional spring).
    """

    body: str
    coordinate: str
    stiffness: float = 0.0
    damping: float = 0.0
    reference: float = 0.0
    relative_to: str = GROUND
    name: str = ""

    def __post_init__(self) -> None:
        if self.coordinate not in ("angle", "x", "y"):
            where = f"coordinate spring {self.name!r} coordinate"
            raise InputError(where, self.coordinate, "must be one of angle, x, y", "choose one of these")
        if self.coordinate != "angle" and self.relative_to != GROUND:
            where = f"coordinate spring {self.name!r} relative_to"
            raise InputError(where, self.relative_to, "only an angle can be relative to a body", "use a spring")

    def parts(self, frames: Frames) -> list[Along | Tension | Weight]:
        """A linear force along the coordinate."""
        if self.coordinate == "angle":
            moved = frames.angle(self.body) - frames.angle(self.relative_to)
        else:
            centre = frames.centre(self.body)
            moved = centre.x if self.coordinate == "x" else centre.y
        return [Along(moved - self.reference, self.stiffness, self.damping)]


@dataclass(frozen=True)
class PointForce(Force):
    """Force (N) with directions fixed in the ground, acting at a point that moves with the body."""

    body: str
    point: Point = (0.0, 0.0)
    x: TimeFunction | StateFunction = field(default_factory=lambda: constant(0.0))
    y: TimeFunction | StateFunction = field(default_factory=lambda: constant(0.0))
    name: str = ""

    def parts(self, frames: Frames) -> list[Along | Tension | Weight]:
        """Loads along both coordinates of the point."""
        place = frames.point(self.body, self.point)
        return [Along(place.x, load=self.x), Along(place.y, load=self.y)]


@dataclass(frozen=True)
class Moment(Force):
    """Moment (N m) on a body, with the opposite one on body `reaction` (the ground by default)."""

    body: str
    function: TimeFunction | StateFunction
    reaction: str = GROUND
    name: str = ""

    def parts(self, frames: Frames) -> list[Along | Tension | Weight]:
        """A load along the relative angle."""
        return [Along(frames.angle(self.body) - frames.angle(self.reaction), load=self.function)]
