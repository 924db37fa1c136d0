"""A planar scene as arrays: rows of constraints, springs and loads, and the elimination plan of G M^-1 G^T.

Body b has the coordinates (x, y) of its mass centre and its angle theta, in this order; the ground is body
number n with
inverse mass zero, so loops need no special case. All local points are relative to the mass centre.

A constraint row is one of two kinds, with bodies a, b = row_body[r]:

    kind 0  affine in (x, y, theta, cos theta, sin theta) of both bodies:
       sum_body kx x + ky y + kt theta + kc cos theta + ks sin theta + constant - f(t) = 0
       (hinge, fixed, prescribed motion, slot along a line of the ground)
    kind 1  point of b on a line of the moving body a, with n = R(theta_a) n0 and D = P_b - X_a:
       n . D + constant - f(t) = 0
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .ordering import Factor, elimination_plan
from .planar import (
    GROUND,
    Body,
    CoordinateSpring,
    Fixed,
    Gravity,
    Hinge,
    Moment,
    PointForce,
    Prismatic,
    Scene,
    Slot,
    Spring,
)
from .timefunctions import TimeFunction, constant

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Rows(NamedTuple):
    """Constraint rows."""

    ints: Ints  # (m, 4) body a, body b, kind, time function that is subtracted (-1 for none)
    reals: Array  # (m, 15) kx, ky, kt, kc, ks of both bodies; n0x, n0y, x and y of the point on b; constant
    lines: Ints  # (rows of kind 1,) their row numbers


class Forces(NamedTuple):
    """Applied forces; springs come first.

    Columns of `ints`: kind, a, b, first and second time function. Columns of `reals` for each kind:

    0  spring between points of the bodies a and b: x, y on a, x, y on b, stiffness, damping, free length
    1  spring on the difference of the coordinates a and b: stiffness, damping, reference
    2  force of two time functions at a point of body a: x, y
    3  moment of a time function on body a, the opposite on body b
    """

    weight: Array  # (3 (n + 1),) constant generalised forces (gravity)
    ints: Ints  # (f, 5)
    reals: Array  # (f, 7)


class Times(NamedTuple):
    """Time functions: polynomial pieces and sines."""

    first: Ints  # (functions + 1,) pieces of each time function
    start: Array  # (pieces,)
    origin: Array  # (pieces,)
    factor: Array  # (pieces, width)
    sine_first: Ints  # (functions + 1,)
    sine: Array  # (sines, 3)


class Tables(NamedTuple):
    """Everything the planar kernels need, for n bodies and m rows."""

    mass: Array  # (3 (n + 1),) inverse of m, m, I of each body (with the excess of light ones), zero for the ground
    light: Ints  # (k,) coordinates that are eliminated with more than their own mass, see `gearfe.rigid.carried`
    excess: Array  # (k,) by how much
    rows: Rows
    plan: Factor
    forces: Forces
    times: Times


class Assembly(NamedTuple):
    """Tables of a scene with the bookkeeping that people need."""

    tables: Tables
    row_joint: tuple[int, ...]  # joint number of each row
    row_label: tuple[str, ...]  # what the row holds, for messages
    start_q: Array  # (3n,) start coordinates of the mass centres
    start_v: Array  # (3n,)
    breaks: Array  # times at which a time function changes its piece
    length: float  # characteristic length (m)
    centre: Array  # (n + 1, 2) mass centre in the body's frame


def assemble(scene: Scene) -> Assembly:
    """Arrays of `scene`; rows are numbered in the order of elimination that fills G M^-1 G^T least."""
    n = len(scene.bodies)
    index = scene.body_index
    centre = np.array([*(b.centre for b in scene.bodies), (0.0, 0.0)], dtype=float)
    q0, v0 = _start(scene.bodies)
    functions: list[TimeFunction] = []

    def time(function: TimeFunction) -> int:
        functions.append(function)
        return len(functions) - 1

    def local(body: str, point: tuple[float, float]) -> tuple[float, float]:
        c = centre[index[body]]
        return float(point[0] - c[0]), float(point[1] - c[1])

    rows: list[_Row] = []
    for number, joint in enumerate(scene.joints):
        label = f"{type(joint).__name__.lower()} {joint.name or number}"
        for row in _joint_rows(joint, index, local, q0, n):
            kind, bodies, factor, slot, const, function, what = row
            rows.append(_Row(number, f"{label} ({what})", kind, bodies, factor, slot, const,
                             -1 if function is None else time(function)))  # fmt: skip
    plan = elimination_plan([(r.joint, r.bodies) for r in rows], n)
    rows = [rows[i] for i in plan.order]
    weight = np.zeros(3 * (n + 1))
    for force in scene.forces:
        if isinstance(force, Gravity):
            for i, body in enumerate(scene.bodies):
                weight[3 * i : 3 * i + 2] += body.mass * np.asarray(force.acceleration)
    inverse = np.zeros(3 * (n + 1))
    with np.errstate(divide="ignore"):  # a link may be without mass: see `carrying`
        inverse[:-3] = 1.0 / np.array([(b.mass, b.mass, b.inertia) for b in scene.bodies], dtype=float).ravel()
    forces = Forces(weight, *_force_arrays(scene, local, time))
    tables = Tables(inverse, *_NONE, _row_arrays(rows), plan.factor, forces, _time_arrays(functions))
    breaks = np.unique([t for f in functions for t in f.breaks if math.isfinite(t)]).astype(float)
    return Assembly(
        tables, tuple(r.joint for r in rows), tuple(r.label for r in rows), q0, v0, breaks, _length(tables, q0), centre
    )


_NONE = (np.zeros(0, dtype=np.int64), np.zeros(0))


def carrying(assembly: Assembly, excess: Array) -> Assembly:
    """The assembly with masses raised by `excess`, shape (3n,), in the elimination."""
    light = np.flatnonzero(excess)
    if light.size == 0:
        return assembly
    tables = assembly.tables
    inverse = tables.mass.copy()
    inverse[light] = 1.0 / (1.0 / inverse[light] + excess[light])
    return assembly._replace(tables=tables._replace(mass=inverse, light=light, excess=excess[light]))


class _Row(NamedTuple):
    joint: int
    label: str
    kind: int
    bodies: tuple[int, int]
    factor: Array
    slot: tuple[float, float, float, float]
    constant: float
    time: int


def _start(bodies: tuple[Body, ...]) -> tuple[Array, Array]:
    q, v = np.zeros(3 * len(bodies)), np.zeros(3 * len(bodies))
    for i, b in enumerate(bodies):
        c, s = math.cos(b.angle), math.sin(b.angle)
        arm = np.array([c * b.centre[0] - s * b.centre[1], s * b.centre[0] + c * b.centre[1]])
        q[3 * i : 3 * i + 2] = np.asarray(b.position) + arm
        v[3 * i : 3 * i + 2] = np.asarray(b.velocity) + b.rate * np.array([-arm[1], arm[0]])
        q[3 * i + 2], v[3 * i + 2] = b.angle, b.rate
    return q, v


def _joint_rows(joint, index, local, q0, n):  # type: ignore[no-untyped-def]
    """Rows of one joint: kind, bodies, factors, slot data, constant, time function, name of the condition."""
    no_slot = (0.0, 0.0, 0.0, 0.0)

    def angle(body: str) -> float:
        i = index[body]
        return 0.0 if i == n else float(q0[3 * i + 2])

    def affine(bodies, terms, const, function, what):  # type: ignore[no-untyped-def]
        factor = np.array(terms, dtype=float)
        for side in range(2):
            if bodies[side] == n:  # the ground stands at x = y = theta = 0: cosine terms are constants
                const += factor[side, 3]
                factor[side] = 0.0
        return 0, bodies, factor, no_slot, const, function, what

    def point(body, at, sign):  # type: ignore[no-untyped-def]
        x, y = local(body, at)
        return (sign, 0, 0, sign * x, -sign * y), (0, sign, 0, sign * y, sign * x)

    def turn(a, b, value, function):  # type: ignore[no-untyped-def]
        return affine((index[a], index[b]), ((0, 0, 1, 0, 0), (0, 0, -1, 0, 0)), -value, function, "angle")

    if isinstance(joint, Hinge | Fixed):
        at_a = getattr(joint, "point_a", (0.0, 0.0))
        if isinstance(joint, Fixed):
            at_b = _seen_from(joint, index, q0, n, local)
        else:
            at_b = joint.point_b
        one, two = point(joint.a, at_a, 1.0), point(joint.b, at_b, -1.0)
        bodies = (index[joint.a], index[joint.b])
        made = [affine(bodies, (one[k], two[k]), 0.0, None, "xy"[k]) for k in range(2)]
        if isinstance(joint, Fixed):
            made.append(turn(joint.a, joint.b, angle(joint.a) - angle(joint.b), None))
        return made
    if isinstance(joint, Slot | Prismatic):
        made = [_line_row(joint, index, local, n, affine, point)]
        if isinstance(joint, Prismatic):
            held = angle(joint.body) - angle(joint.line) if joint.angle is None else joint.angle
            made.append(turn(joint.body, joint.line, held, None))
        return made
    function: TimeFunction = joint.function
    other = joint.relative_to
    if joint.coordinate in ("angle", "rate"):
        if joint.coordinate == "rate":
            function = function.integral(angle(joint.body) - angle(other))
        return [turn(joint.body, other, 0.0, function)]
    k = "xy".index(joint.coordinate)
    terms = (point(joint.body, joint.point, 1.0)[k], (0.0,) * 5)
    return [affine((index[joint.body], n), terms, 0.0, function, joint.coordinate)]


def _line_row(joint, index, local, n, affine, point):  # type: ignore[no-untyped-def]
    length = math.hypot(*joint.direction)
    normal = (-joint.direction[1] / length, joint.direction[0] / length)
    start = local(joint.line, joint.origin)
    const = -(normal[0] * start[0] + normal[1] * start[1])
    if joint.line == GROUND:
        ex, ey = point(joint.body, joint.point, 1.0)
        row = tuple(normal[0] * a + normal[1] * b for a, b in zip(ex, ey, strict=True))
        return affine((index[joint.body], n), (row, (0.0,) * 5), const, None, "across the line")
    slot = (*normal, *local(joint.body, joint.point))
    return 1, (index[joint.line], index[joint.body]), np.zeros((2, 5)), slot, const, None, "across the line"


def _seen_from(joint, index, q0, n, local):  # type: ignore[no-untyped-def]
    """Point (0, 0) of body a, written in the frame of body b, as the scene starts."""
    i, j = index[joint.a], index[joint.b]
    x, y = local(joint.a, (0.0, 0.0))
    c, s = math.cos(q0[3 * i + 2]), math.sin(q0[3 * i + 2])
    place = q0[3 * i : 3 * i + 2] + np.array([c * x - s * y, s * x + c * y])
    if j == n:
        return tuple(place)
    c, s = math.cos(q0[3 * j + 2]), math.sin(q0[3 * j + 2])
    d = place - q0[3 * j : 3 * j + 2]
    back = local(joint.b, (0.0, 0.0))
    return c * d[0] + s * d[1] - back[0], -s * d[0] + c * d[1] - back[1]


def _coordinates(force: CoordinateSpring, index) -> tuple[int, int]:  # type: ignore[no-untyped-def]
    place = ("x", "y", "angle").index(force.coordinate)
    return 3 * index[force.body] + place, 3 * index[force.relative_to] + place


def _row_arrays(rows: list[_Row]) -> Rows:
    return Rows(
        ints=_ints([(*r.bodies, r.kind, r.time) for r in rows], 4),
        reals=_floats([(*np.ravel(r.factor), *r.slot, r.constant) for r in rows], 15),
        lines=np.array([i for i, r in enumerate(rows) if r.kind == 1], dtype=np.int64),
    )


def _force_arrays(scene: Scene, local, time) -> tuple[Ints, Array]:  # type: ignore[no-untyped-def]
    at = scene.body_index
    rows: list[tuple[tuple[int, ...], tuple[float, ...]]] = []
    for f in scene.forces:
        if isinstance(f, Spring):
            ends = (*local(f.a, f.point_a), *local(f.b, f.point_b))
            rows.append(((0, at[f.a], at[f.b], -1, -1), (*ends, f.stiffness, f.damping, f.free_length)))
        elif isinstance(f, CoordinateSpring):
            rows.append(((1, *_coordinates(f, at), -1, -1), (f.stiffness, f.damping, f.reference, 0, 0, 0, 0)))
        elif isinstance(f, PointForce):
            rows.append(
                ((2, at[f.body], len(scene.bodies), time(f.x), time(f.y)), (*local(f.body, f.point), 0, 0, 0, 0, 0))
            )
        elif isinstance(f, Moment):
            rows.append(((3, at[f.body], at[f.reaction], time(f.function), -1), (0.0,) * 7))
    rows.sort(key=lambda row: row[0][0])
    return _ints([r[0] for r in rows], 5), _floats([r[1] for r in rows], 7)


def _time_arrays(functions: list[TimeFunction]) -> Times:
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


def _length(tables: Tables, q0: Array) -> float:
    springs = tables.forces.reals[tables.forces.ints[:, 0] == 0]
    sizes = [tables.rows.reals[:, [3, 4, 8, 9, 12, 13]], springs[:, [0, 1, 2, 3, 6]]]
    size = max(float(np.abs(a).max(initial=0.0)) for a in sizes)
    if size == 0.0:
        size = float(np.abs(q0.reshape(-1, 3)[:, :2]).max(initial=0.0))
    return size or 1.0


def _ints(values, width: int) -> Ints:  # type: ignore[no-untyped-def]
    return np.array(values, dtype=np.int64).reshape(-1, width)


def _floats(values, width: int) -> Array:  # type: ignore[no-untyped-def]
    return np.array(values, dtype=float).reshape(-1, width)
