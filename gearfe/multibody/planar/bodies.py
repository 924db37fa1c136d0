"""Planar bodies as plain data, and what joints and forces may name of them.

A body carries a frame: points, the mass centre and joint directions are written in that frame (m); the start pose is
the position of the frame's origin and its angle. The ground is the body named ``"ground"`` with its frame at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import InputError, shown, unknown_name
from ..series.timefunctions import TimeFunction, constant
from .forces import Force, StateFunction
from .forms import GROUND, Point, label_of
from .joints import Joint

#: Masses and inertias below this, or above its inverse, overflow in products.
LEAST_MASS = 1e-100


@dataclass(frozen=True)
class Body:
    """A rigid body that moves in the plane.

    Parameters
    ----------
    name : str
        Name used by joints and forces.
    mass : float
        Mass (kg), >= 0; without mass where the joints hold the body to others that have some.
    inertia : float
        Moment of inertia about the mass centre (kg m2), >= 0, likewise.
    centre : (float, float)
        Mass centre in the body's frame (m).
    position, angle : (float, float), float
        Start position of the frame's origin (m) and start angle (rad).
    velocity, rate : (float, float), float
        Start velocity of the frame's origin (m/s) and start angular velocity (rad/s).
    """

    name: str
    mass: float
    inertia: float
    centre: Point = (0.0, 0.0)
    position: Point = (0.0, 0.0)
    angle: float = 0.0
    velocity: Point = (0.0, 0.0)
    rate: float = 0.0

    def __post_init__(self) -> None:
        for key in ("mass", "inertia"):
            value = getattr(self, key)
            unit = "kg" if key == "mass" else "kg m2"
            if math.isfinite(value) and value > 0.0 and not LEAST_MASS <= value <= 1.0 / LEAST_MASS:
                problem = f"must be >= {LEAST_MASS:g} and <= {1.0 / LEAST_MASS:g}: its inverse or its square overflows"
                raise InputError(f"body {self.name!r} {key}", value, problem, f"give it in {unit}")
            if not (math.isfinite(value) and value >= 0.0):
                cure = f"give a number in {unit}; 0 for a link without {key}"
                raise InputError(f"body {self.name!r} {key}", value, "must be finite and >= 0", cure)


def body_numbers(bodies: tuple[Body, ...], joints: tuple[Joint, ...], forces: tuple[Force, ...]) -> dict[str, int]:
    """Number of each body, the ground last.

    Raises
    ------
    InputError
        For names of bodies that are used twice or not there, and arguments that are not finite.
    """
    index: dict[str, int] = {GROUND: len(bodies)}
    for i, body in enumerate(bodies):
        if body.name in index:
            raise InputError("body name", body.name, "is used twice", "give every body a name of its own")
        index[body.name] = i
    for k, part in enumerate((*joints, *forces)):
        label = label_of(part, k)
        keys = ("a", "b", "body", "line", "relative_to", "reaction", "carrier")
        named = [(key, getattr(part, key)) for key in keys if hasattr(part, key)]
        used = [value for key, value in named if key != "carrier" or value is not None]
        for name in used:
            if not isinstance(name, str):
                order = ", ".join(vars(part))
                raise InputError(label, None, f"{shown(name)} is no name of a body", f"its arguments are {order}")
            if name not in index:
                raise unknown_name(label, name, index)
        for key, value in vars(part).items():
            values = value if isinstance(value, tuple) else (value,)
            if any(isinstance(x, float) and not math.isfinite(x) for x in values):
                raise InputError(f"{label} {key}", value, "must be finite", "give a number")
            if key in ("function", "x", "y") and not isinstance(value, TimeFunction | StateFunction):
                if not isinstance(value, int | float):
                    cure = "use constant, polynomial, sine, smoothed_step, or a StateFunction"
                    raise InputError(f"{label} {key}", None, "must be a function of time", cure)
                object.__setattr__(part, key, constant(float(value)))
        if getattr(part, "direction", None) == (0, 0):
            raise InputError(f"{label} direction", (0, 0), "must not be zero", "give the direction of the line")
        if len(used) >= 2 and used[0] == used[1]:
            cure = "name two different bodies (or the ground)"
            raise InputError(label, used[0], "joins a body to itself", cure)
        if len(used) == 3 and used[2] in used[:2]:
            cure = "name the body on which both turn"
            raise InputError(f"{label} carrier", used[2], "is one of the two that are coupled", cure)
    return index
