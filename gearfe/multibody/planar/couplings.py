"""Joints that couple the motions of two bodies which others guide: gears, belts, racks, cams.

Teeth and belts couple what bodies turn against the line of their centres (Willis):

    theta_a - theta_c = (theta_b - theta_c) / ratio,     c: the carrier, on which both turn about fixed points.

`with_carriers` finds the carrier by the hinges; it is the ground where both axes are at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

from ...base.errors import InputError
from .bodies import Frames
from .forms import GROUND, Form, Point
from .joints import Fixed, Hinge, Joint, Prismatic, Profile, Row, Slot

#: Points of a body nearer than this share of its largest coordinate are one axis.
SAME_AXIS = 1e-6


@dataclass(frozen=True)
class GearRatio(Joint):
    """Body `b` turns by `ratio` times what body `a` turns, both against the `carrier`: one constraint.

    The ratio is -z_a/z_b for external gears, z_a/z_b where one of them is internal; `b` may be the ground, a ring at
    rest. Without a carrier it is the body on which both are hinged (`with_carriers`). The multiplier is the moment on
    `a` (N m), with the sign turned; `b` gets -1/ratio of it, the carrier what balances both.
    """

    a: str
    b: str
    ratio: float
    carrier: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.ratio) and self.ratio != 0.0):
            cure = "give -z_a/z_b for external gears"
            raise InputError(f"gear {self.name!r} ratio", self.ratio, "must be finite and not 0", cure)

    def rows(self, frames: Frames) -> list[Row]:
        """Hold theta_a - theta_b / ratio, angles against the carrier, at its initial value."""
        a, start_a = _turn(frames, self.a, self.carrier)
        b, start_b = _turn(frames, self.b, self.carrier)
        return [Row("angles", a - (1.0 / self.ratio) * b - (start_a - start_b / self.ratio))]


@dataclass(frozen=True)
class Belt(Joint):
    """Pulleys of the radii `radius_a`, `radius_b` (m) on bodies `a` and `b` pay out the same length: one constraint.

    A `crossed` belt turns them in opposite senses. Both turn against the `carrier`, as gears do; `b` may be the ground,
    a pulley at rest. The multiplier is the difference of both strands' tensions (N).
    """

    a: str
    b: str
    radius_a: float
    radius_b: float
    crossed: bool = False
    carrier: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for key in ("radius_a", "radius_b"):
            if not getattr(self, key) > 0.0:
                raise InputError(f"belt {self.name!r} {key}", getattr(self, key), "must be > 0 m", "give the radius")

    def rows(self, frames: Frames) -> list[Row]:
        """Hold r_a theta_a -+ r_b theta_b, angles against the carrier, at its initial value."""
        other = self.radius_b if self.crossed else -self.radius_b
        a, start_a = _turn(frames, self.a, self.carrier)
        b, start_b = _turn(frames, self.b, self.carrier)
        return [Row("length", self.radius_a * a + other * b - (self.radius_a * start_a + other * start_b))]


@dataclass(frozen=True)
class Rack(Joint):
    """Body `a` moves along `direction` by `radius` (m) times what body `b` turns: one constraint.

    Both motions and the direction refer to the frame of the `carrier`. Separate joints guide the rack and hold the
    pinion on it (`with_carriers`). A negative radius turns the sense. The multiplier is the tooth force along the
    direction (N).
    """

    a: str
    b: str
    radius: float
    direction: Point = (1.0, 0.0)
    point: Point = (0.0, 0.0)
    carrier: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius != 0.0):
            cure = "give the pinion's pitch radius"
            raise InputError(f"rack {self.name!r} radius", self.radius, "must be finite and not 0 m", cure)

    def rows(self, frames: Frames) -> list[Row]:
        """Hold u . P - r theta, in the frame of the carrier, at its initial value."""
        length = math.hypot(*self.direction)
        x, y = self.direction[0] / length, self.direction[1] / length
        place = frames.start_place(self.a, self.point)
        turn, start_turn = _turn(frames, self.b, self.carrier)
        if self.carrier in (None, GROUND):
            along = frames.point(self.a, self.point).along(x, y)
        else:
            place, centre = frames.start_seen_from(self.carrier, place), frames.arm(self.carrier, (0.0, 0.0))
            place = place[0] + centre[0], place[1] + centre[1]
            gap = frames.point(self.a, self.point) - frames.centre(self.carrier)
            along = frames.direction(self.carrier, (x, y)).dot(gap)
        start = x * place[0] + y * place[1] - self.radius * start_turn
        return [Row("length", along - self.radius * turn - start)]


@dataclass(frozen=True)
class Cam(Joint):
    """A coordinate of the follower, body `a`, is `profile` of the angle of body `b`: one constraint.

    `coordinate` is ``"angle"`` (rad), ``"x"`` or ``"y"`` (m, of the point `point`). The multiplier is the force or
    moment between both; nothing lifts off, so that its sign tells whether a spring would be needed. The cam gets the
    profile's slope times that.
    """

    a: str
    b: str
    coordinate: str
    profile: Profile
    point: Point = (0.0, 0.0)
    carrier: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        both_move(f"cam {self.name!r}", self.a, self.b)
        if self.coordinate not in ("angle", "x", "y"):
            where = f"cam {self.name!r} coordinate"
            raise InputError(where, self.coordinate, "must be one of angle, x, y", "choose one of these")
        if self.carrier not in (None, GROUND):
            problem = "must be the ground: angle and coordinate are those in space"
            raise InputError(f"cam {self.name!r} carrier", self.carrier, problem, "write 'ground', or leave it out")
        if self.coordinate == "angle" and self.point != (0.0, 0.0):
            where = f"cam {self.name!r} point"
            raise InputError(where, self.point, "has no part in an angle", "remove it, or let x or y follow")

    def rows(self, frames: Frames) -> list[Row]:
        """u - s(theta_b)."""
        if self.coordinate == "angle":
            moved = frames.angle(self.a)
        else:
            place = frames.point(self.a, self.point)
            moved = place.x if self.coordinate == "x" else place.y
        return [Row(self.coordinate, moved + 0.0 * frames.angle(self.b), profile=(self.b, self.profile))]


def both_move(label: str, *bodies: str) -> None:
    """Refuse a coupling to the ground."""
    if GROUND in bodies:
        raise InputError(label, GROUND, "couples turns of two bodies that move", "name the other body: to = ...")


def _turn(frames: Frames, body: str, carrier: str | None) -> tuple[Form, float]:
    """Angle of a body against the carrier, and its start value (rad)."""
    if carrier in (None, GROUND):
        return frames.angle(body), frames.start_angle(body)
    return frames.angle(body) - frames.angle(carrier), frames.start_angle(body) - frames.start_angle(carrier)


def with_carriers(joints: Sequence[Joint], frames: Frames) -> tuple[Joint, ...]:
    """Joints whose gears, belts, racks and cams have their carriers.

    Raises
    ------
    InputError
        When none or several bodies bear both, or a cam turns on a body that moves.
    """
    bearings = _Bearings(joints, frames)
    joints_with_carriers: list[Joint] = []
    for joint in joints:
        if isinstance(joint, Cam) and joint.carrier is None:
            bearings.at_rest(joint)
        elif isinstance(joint, GearRatio | Belt | Rack) and joint.carrier is None:
            joint = replace(joint, carrier=bearings.carrier(joint))  # noqa: PLW2901
        joints_with_carriers.append(joint)
    return tuple(joints_with_carriers)


class _Bearings:
    """Pairs of bodies that rotate about fixed points of each other by hinges; fixed joints merge bodies."""

    def __init__(self, joints: Sequence[Joint], frames: Frames) -> None:
        self.frames = frames
        self.root = {name: name for name in frames.number}
        for joint in joints:
            if isinstance(joint, Fixed):
                a, b = self.one(joint.a), self.one(joint.b)
                self.root[b if a == GROUND else a] = a if a == GROUND else b
        self.guides: dict[str, set[str]] = {}
        for joint in joints:
            if isinstance(joint, Slot | Prismatic):
                body, line = self.one(joint.body), self.one(joint.line)
                self.guides.setdefault(body, set()).add(line)
                self.guides.setdefault(line, set()).add(body)
        axes: list[tuple[str, Point]] = []
        pin: list[int] = []  # number of the pin of each axis
        for joint in joints:
            if isinstance(joint, Hinge):
                one, two = (
                    pin[self._axis(axes, pin, *end)] for end in ((joint.a, joint.point_a), (joint.b, joint.point_b))
                )
                pin[:] = [one if number == two else number for number in pin]
        self.pins = [{axes[k][0] for k, number in enumerate(pin) if number == one} for one in sorted(set(pin))]

    def one(self, body: str) -> str:
        """Name of the body that stands for all which are fixed to it."""
        while self.root[body] != body:
            body = self.root[body]
        return body

    def _axis(self, axes: list[tuple[str, Point]], pin: list[int], body: str, at: Point) -> int:
        whole = self.one(body)
        place = at if whole == body else self.frames.start_seen_from(whole, self.frames.start_place(body, at))
        for k, (other, known) in enumerate(axes):
            size = max(map(abs, (*known, *place)))
            if other == whole and math.dist(known, place) <= SAME_AXIS * size:
                return k
        axes.append((whole, place))
        pin.append(len(axes))
        return len(axes) - 1

    def bearers(self, body: str, apart: Set[str] = frozenset()) -> set[str]:
        """Bodies that the body turns on, about axes that bear none of the bodies `apart`."""
        whole = self.one(body)
        return set().union(*(pin for pin in self.pins if whole in pin and not pin & apart)) - {whole}

    def carrier(self, joint: GearRatio | Belt | Rack) -> str:
        """The body that bears both about different axes, the ground where it bears both.

        A body that is hinged on the ground turns about that point, whatever else is hinged to it.
        """
        kind = "gear" if isinstance(joint, GearRatio) else type(joint).__name__.lower()
        label, pair = f"{kind} {joint.name!r} carrier", {self.one(joint.a), self.one(joint.b)}
        guides = self.guides.get(self.one(joint.a), set()) if isinstance(joint, Rack) else None
        if GROUND in (self.bearers(joint.a) if guides is None else guides) & self.bearers(joint.b):
            return GROUND
        a, b = (self.bearers(name, pair - {self.one(name)}) for name in (joint.a, joint.b))
        both = sorted(((a if guides is None else guides) & b) - pair)
        if len(both) > 1:
            problem = f"may be {' or '.join(map(repr, both))}: each carries {joint.a!r} and {joint.b!r}"
            raise InputError(label, None, problem, "name it: carrier = ...")
        if not both:
            verb = "guides" if isinstance(joint, Rack) else "carries"
            problem = f"is unknown: no hinges say which body {verb} {joint.a!r} and carries {joint.b!r}"
            cure = (
                "name the body that holds the distance of their centres: carrier = ... (make a rod without mass a body)"
            )
            if GROUND in pair:
                cure = "name the other body: to = ...; or, of a ring at rest, the arm of the planet: carrier = ..."
            raise InputError(label, None, problem, cure)
        return both[0]

    def at_rest(self, cam: Cam) -> None:
        """Refuse a cam that only turns on bodies which move."""
        bearers = sorted(self.bearers(cam.b))
        if bearers and GROUND not in bearers:
            problem = f"turns on {bearers[0]!r}, but a cam's angle and its follower's coordinate are those in space"
            cure = "hinge the cam on the ground, or if that body does not rotate write carrier = 'ground'"
            raise InputError(f"cam {cam.name!r} carrier", None, problem, cure)
