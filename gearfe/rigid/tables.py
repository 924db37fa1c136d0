"""A planar linkage as arrays: forms, vectors and time functions, and the elimination plan of G M^-1 G^T.

Body b has the coordinates (x, y) of its mass centre and its angle theta, in this order; the ground is body
number n with inverse mass zero, so loops need no special case. All arms are relative to the mass centre.

The forms (`gearfe.rigid.forms`) are numbered: first the m constraints, g = form - motion(t), then those along which
forces act. Each depends on two bodies. Vectors, too, have two ends; those of springs come first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..typing import Array, BoolArray, IntArray
from .forces import Along, Force, Tension, Weight
from .forms import End, Form, Frames, Terms, Vector
from .joints import Joint, Profile
from .ordering import elimination_order
from .planar import Body
from .statefunctions import SpanFunction, StateFunction
from .timefunctions import TimeFunction, constant


class Forms(NamedTuple):
    """Scalars of the coordinates: m constraints, then those along which forces act; r in all."""

    bodies: IntArray  # (r, 2)
    motion: IntArray  # (r,) time function: the motion of a constraint, the load of a force; -1 for none
    factor: Array  # (r, 2, 5) of x, y, theta, cos theta, sin theta of both bodies
    constant: Array  # (r,)
    unit: Array  # (m,) the mechanism's length where a constraint holds lengths, 1 where it holds angles
    product: IntArray  # (p, 3) form and two vectors whose inner product it contains, their ends on the form's bodies


class Vectors(NamedTuple):
    """Vectors that move with two bodies; the first ones are the spans of the springs."""

    bodies: IntArray  # (v, 2)
    end: Array  # (v, 2, 3) of each body: weight of the mass centre, components of the arm in its frame


class Forces(NamedTuple):
    """Applied forces."""

    weight: Array  # (3 (n + 1),) constant generalised forces (gravity)
    spring: Array  # (s, 3) stiffness, damping, free length of the tension along vector s
    along: Array  # (f, 2) stiffness, damping along form m + f


class Times(NamedTuple):
    """Time functions: polynomial pieces and sines."""

    first: IntArray  # (functions + 1,) pieces of each time function
    start: Array  # (pieces,)
    origin: Array  # (pieces,)
    factor: Array  # (pieces, width)
    sine_first: IntArray  # (functions + 1,)
    sine: Array  # (sines, 3)


class Tables(NamedTuple):
    """A linkage of n bodies and m constraints."""

    forms: Forms
    vectors: Vectors
    forces: Forces


class Assembly(NamedTuple):
    """Tables of a linkage with the bookkeeping that people need."""

    tables: Tables
    row_joint: tuple[int, ...]  # joint number of each constraint
    row_label: tuple[str, ...]  # what the constraint holds, for messages
    row_holds_length: BoolArray  # (m,) whether it holds lengths, not angles and directions alone
    profiles: tuple[tuple[int, int, Profile], ...]  # constraint, which of its bodies, profile of that one's angle
    spring_label: tuple[str, ...]
    tension_laws: tuple[tuple[int, SpanFunction], ...]  # number among the springs, and the law
    functions: tuple[TimeFunction, ...]  # in the order of the tables
    state_loads: tuple[tuple[int, StateFunction], ...]  # number among the forces along forms, and the load
    start_q: Array  # (3n,) start coordinates of the mass centres
    start_v: Array  # (3n,)
    breaks: Array  # times at which a time function changes its piece
    length: float  # characteristic length (m)
    centre: Array  # (n + 1, 2) mass centre in the body's frame


class _Row(NamedTuple):
    """A form on its two bodies."""

    joint: int
    label: str
    form: Form
    bodies: tuple[int, int]
    motion: int
    profile: tuple[int, Profile] | None = None  # which of its bodies turns it


def assemble(joints: tuple[Joint, ...], forces: tuple[Force, ...], frames: Frames) -> Assembly:
    """Arrays of joints and forces; constraints are numbered in the order of elimination that fills G M^-1 G^T least."""
    n = len(frames.bodies)
    functions: list[TimeFunction] = []

    def numbered(function: TimeFunction | StateFunction | None) -> int:
        if function is None or isinstance(function, StateFunction):
            return -1
        functions.append(function)
        return len(functions) - 1

    rows: list[_Row] = []
    for number, joint in enumerate(joints):
        label = f"{type(joint).__name__.lower()} {joint.name or number}"
        for what, form, motion, profile in joint.rows(frames):
            bodies = _two(form.bodies, n, label)
            held = None if profile is None else (bodies.index(frames.number[profile[0]]), profile[1])
            rows.append(_Row(number, f"{label} ({what})", form, bodies, numbered(motion), held))
    rows = [rows[i] for i in elimination_order([(r.joint, r.bodies) for r in rows], n)]
    weight = np.zeros((n + 1, 3))
    masses = np.array([b.mass for b in frames.bodies], dtype=float)
    tensions: list[tuple[str, Tension]] = []
    along: list[Along] = []
    loads: list[_Row] = []
    for force in forces:
        label = f"{type(force).__name__.lower()} {force.name!r}"
        for part in force.parts(frames):
            if isinstance(part, Weight):
                weight[:-1, :2] += masses[:, None] * np.asarray(part.acceleration)
            elif isinstance(part, Tension):
                tensions.append((f"spring {force.name or len(tensions) + 1!r}", part))
            else:
                along.append(part)
                loads.append(_Row(-1, label, part.form, _two(part.form.bodies, n, label), numbered(part.load)))
    spans = [(part.vector, _two(tuple(part.vector.ends), n, label)) for label, part in tensions]
    q0, v0 = _start(frames.bodies, frames)
    length = _length(rows, [part for _, part in tensions], q0, n)
    lengths = np.array([_holds_length(r.form) for r in rows], dtype=bool)
    forms, vectors = _form_arrays(rows, loads, spans, np.where(lengths, length, 1.0))
    acting = Forces(
        weight.ravel(),
        _floats([(t.stiffness, t.damping, t.free_length) for _, t in tensions], 3),
        _floats([(a.stiffness, a.damping) for a in along], 2),
    )
    tables = Tables(forms, vectors, acting)
    return Assembly(
        tables,
        row_joint=tuple(r.joint for r in rows),
        row_label=tuple(r.label for r in rows),
        row_holds_length=lengths,
        spring_label=tuple(label for label, _ in tensions),
        tension_laws=tuple((k, t.law) for k, (_, t) in enumerate(tensions) if t.law is not None),
        profiles=tuple((i, *row.profile) for i, row in enumerate(rows) if row.profile is not None),
        functions=tuple(functions),
        state_loads=tuple((k, a.load) for k, a in enumerate(along) if isinstance(a.load, StateFunction)),
        start_q=q0,
        start_v=v0,
        breaks=np.unique([t for f in functions for t in f.breaks if math.isfinite(t)]).astype(float),
        length=length,
        centre=np.array([*(b.centre for b in frames.bodies), (0.0, 0.0)], dtype=float),
    )


def _two(bodies: tuple[int, ...], ground: int, label: str) -> tuple[int, int]:
    """The bodies of a form, the ground beside a single one."""
    if len(bodies) > 2:
        raise InputError(label, None, "depends on more than two bodies", "divide it among several joints or forces")
    one, two = (*bodies, ground, ground)[:2]
    return one, two


def _start(bodies: tuple[Body, ...], frames: Frames) -> tuple[Array, Array]:
    q, v = np.zeros((len(bodies), 3)), np.zeros((len(bodies), 3))
    for i, b in enumerate(bodies):
        q[i] = *frames.start_place(b.name, b.centre), b.angle
        arm = q[i, :2] - np.asarray(b.position)
        v[i] = b.velocity[0] - b.rate * arm[1], b.velocity[1] + b.rate * arm[0], b.rate
    return q.ravel(), v.ravel()


def _form_arrays(
    rows: list[_Row], loads: list[_Row], spans: list[tuple[Vector, tuple[int, int]]], unit: Array
) -> tuple[Forms, Vectors]:
    every = [*rows, *loads]
    vectors = list(spans)
    products: list[tuple[int, int, int]] = []
    for r, row in enumerate(every):
        for pair in row.form.products:
            products.append((r, len(vectors), len(vectors) + 1))
            vectors += [(vector, row.bodies) for vector in pair]
    no_terms: Terms = (0.0, 0.0, 0.0, 0.0, 0.0)
    no_end: End = (0.0, 0.0, 0.0)
    ends = [[vector.ends.get(b, no_end) for b in bodies] for vector, bodies in vectors]
    for end, (_, bodies) in zip(ends, vectors, strict=True):
        if bodies[0] == bodies[1]:
            end[1] = no_end
    factor = [[row.form.terms.get(b, no_terms) for b in row.bodies] for row in every]
    for terms, row in zip(factor, every, strict=True):
        if row.bodies[0] == row.bodies[1]:
            terms[1] = no_terms
    forms = Forms(
        bodies=_ints([row.bodies for row in every], 2),
        motion=np.array([row.motion for row in every], dtype=np.int64),
        factor=np.array(factor, dtype=float).reshape(-1, 2, 5),
        constant=np.array([row.form.constant for row in every], dtype=float),
        unit=unit,
        product=_ints(products, 3),
    )
    return forms, Vectors(_ints([b for _, b in vectors], 2), np.array(ends, dtype=float).reshape(-1, 2, 3))


def _holds_length(form: Form) -> bool:
    """Whether places enter the form, not angles and directions alone."""
    weights = [end[0] for pair in form.products for vector in pair for end in vector.ends.values()]
    return any(weights) or any(terms[k] for terms in form.terms.values() for k in (0, 1, 3, 4))


def time_arrays(functions: list[TimeFunction]) -> Times:
    """Arrays of functions of time, for the kernels."""
    used = functions or [constant(0.0)]
    width = max(len(row) for f in used for row in f.coefficients)
    return Times(
        first=np.cumsum([0, *(len(f.starts) for f in used)]).astype(np.int64),
        start=np.array([s for f in used for s in f.starts], dtype=float),
        origin=np.array([o for f in used for o in f.origins], dtype=float),
        factor=np.array([[*row, *[0.0] * (width - len(row))] for f in used for row in f.coefficients]),
        sine_first=np.cumsum([0, *(len(f.sines) for f in used)]).astype(np.int64),
        sine=_floats([s for f in used for s in f.sines], 3),
    )


def _length(rows: list[_Row], tensions: list[Tension], q0: Array, ground: int) -> float:
    """The longest arm or free length; of a mechanism without any, the farthest place."""
    vectors = [v for row in rows for pair in row.form.products for v in pair if any(e[0] for e in v.ends.values())]
    arms = [e[1:] for v in (*vectors, *(t.vector for t in tensions)) for b, e in v.ends.items()]
    arms += [terms[3:] for row in rows for b, terms in row.form.terms.items() if b != ground]
    size = max((abs(x) for x in (*np.ravel(arms), *(t.free_length for t in tensions))), default=0.0)
    if size == 0.0:
        size = float(np.abs(q0.reshape(-1, 3)[:, :2]).max(initial=0.0))
    return float(size) or 1.0


def _ints(values: Sequence[Sequence[int]], width: int) -> IntArray:
    return np.array(values, dtype=np.int64).reshape(-1, width)


def _floats(values: Sequence[Sequence[float]], width: int) -> Array:
    return np.array(values, dtype=float).reshape(-1, width)
