"""Joints and forces of a linkage as forms and vectors in order, with the bookkeeping that people need.

Body b has the coordinates (x, y) of its mass centre and its angle theta, in this order; the ground is body number n.
All arms are relative to the mass centre.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError, shown, unknown_name
from ...base.typing import Array, BoolArray
from ..series.ordering import elimination_order
from ..series.timefunctions import TimeFunction, constant
from .bodies import Body, Frames
from .forces import Along, Force, SpanFunction, StateFunction, Tension, Weight
from .forms import GROUND, Form
from .joints import Joint, Profile

#: Classes whose names are not those of mechanism files.
_KINDS = {"GearRatio": "gear", "PointForce": "force"}


class Held(NamedTuple):
    """A constraint: ``form = motion(t)``, or ``form = profile(angle of a body)``."""

    joint: int  # number of the joint
    label: str
    form: Form
    motion: TimeFunction | None
    profile: tuple[int, Profile] | None  # number of the body


class Assembly(NamedTuple):
    """A linkage of n bodies and m constraints."""

    rows: tuple[Held, ...]
    row_joint: tuple[int, ...]  # joint number of each constraint
    row_label: tuple[str, ...]  # what the constraint holds, for messages
    row_holds_length: BoolArray  # (m,) whether it holds lengths, not angles and directions alone
    springs: tuple[tuple[str, Tension], ...]
    along: tuple[Along, ...]
    weight: Array  # (3n,) constant generalised forces (gravity)
    start_q: Array  # (3n,) start coordinates of the mass centres
    start_v: Array  # (3n,)
    breaks: Array  # times at which a time function changes its piece
    length: float  # characteristic length (m)
    centre: Array  # (n + 1, 2) mass centre in the body's frame

    @property
    def state_loads(self) -> list[tuple[int, StateFunction]]:
        """Numbers among the forces along forms of loads that depend on the state."""
        return [(k, a.load) for k, a in enumerate(self.along) if isinstance(a.load, StateFunction)]

    @property
    def tension_laws(self) -> list[tuple[int, SpanFunction]]:
        """Numbers among the springs of those with laws."""
        return [(k, t.law) for k, (_, t) in enumerate(self.springs) if t.law is not None]


def label_of(part: object, number: int) -> str:
    """Return kind and name of a joint or force for messages, or its number where it has no name."""
    kind = type(part).__name__
    words = _KINDS.get(kind) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind).lower()
    return f"{words} {getattr(part, 'name', '') or number}"


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
            raise InputError("body name", body.name, "is used twice", "give every body a different name")
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


def assemble(joints: tuple[Joint, ...], forces: tuple[Force, ...], frames: Frames) -> Assembly:
    """Joints and forces in order; constraints in the order of elimination that fills G M^-1 G^T least."""
    n = len(frames.bodies)
    rows: list[Held] = []
    for number, joint in enumerate(joints):
        label = label_of(joint, number)
        for what, form, motion, profile in joint.rows(frames):
            held = None if profile is None else (frames.number[profile[0]], profile[1])
            rows.append(Held(number, f"{label} ({what})", form, motion, held))
    rows = [rows[i] for i in elimination_order([(r.joint, r.form.bodies) for r in rows], n)]
    masses = np.array([b.mass for b in frames.bodies], dtype=float)
    weight = np.zeros((n, 3))
    springs: list[tuple[str, Tension]] = []
    along: list[Along] = []
    for force in forces:
        for part in force.parts(frames):
            if isinstance(part, Weight):
                weight[:, :2] += masses[:, None] * np.asarray(part.acceleration)
            elif isinstance(part, Tension):
                springs.append((f"spring {force.name or len(springs) + 1!r}", part))
            else:
                along.append(part)
    q0, v0 = _start(frames.bodies, frames)
    functions = [f for f in (*(r.motion for r in rows), *(a.load for a in along)) if isinstance(f, TimeFunction)]
    return Assembly(
        tuple(rows),
        row_joint=tuple(r.joint for r in rows),
        row_label=tuple(r.label for r in rows),
        row_holds_length=np.array([_holds_length(r.form) for r in rows], dtype=bool),
        springs=tuple(springs),
        along=tuple(along),
        weight=weight.ravel(),
        start_q=q0,
        start_v=v0,
        breaks=np.unique([t for f in functions for t in f.breaks if math.isfinite(t)]).astype(float),
        length=_length(rows, [part for _, part in springs], q0, n),
        centre=np.array([*(b.centre for b in frames.bodies), (0.0, 0.0)], dtype=float),
    )


def _start(bodies: tuple[Body, ...], frames: Frames) -> tuple[Array, Array]:
    q, v = np.zeros((len(bodies), 3)), np.zeros((len(bodies), 3))
    for i, b in enumerate(bodies):
        q[i] = *frames.start_place(b.name, b.centre), b.angle
        arm = q[i, :2] - np.asarray(b.position)
        v[i] = b.velocity[0] - b.rate * arm[1], b.velocity[1] + b.rate * arm[0], b.rate
    return q.ravel(), v.ravel()


def _holds_length(form: Form) -> bool:
    """Return whether positions enter the form, not only angles and directions."""
    weights = [end[0] for pair in form.products for vector in pair for end in vector.ends.values()]
    return any(weights) or any(terms[k] for terms in form.terms.values() for k in (0, 1, 3, 4))


def _length(rows: list[Held], tensions: list[Tension], q0: Array, ground: int) -> float:
    """The longest arm or free length; of a mechanism without any, the farthest place."""
    vectors = [v for row in rows for pair in row.form.products for v in pair if any(e[0] for e in v.ends.values())]
    arms = [e[1:] for v in (*vectors, *(t.vector for t in tensions)) for b, e in v.ends.items()]
    arms += [terms[3:] for row in rows for b, terms in row.form.terms.items() if b != ground]
    size = max((abs(x) for x in (*np.ravel(arms), *(t.free_length for t in tensions))), default=0.0)
    if size == 0.0:
        size = float(np.abs(q0.reshape(-1, 3)[:, :2]).max(initial=0.0))
    return float(size) or 1.0
