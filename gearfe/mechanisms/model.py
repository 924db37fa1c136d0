"""A mechanism file becomes a rigid system with names."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, unknown_name
from ..rigid import (
    GROUND,
    Body,
    Forced,
    PlanarScene,
    Scene,
    Start,
    System,
    TimeFunction,
    consistent_start,
    constant,
    polynomial,
    sine,
    smoothed_step,
)
from ..tables.mechanism import (
    FORCES,
    JOINTS,
    BodyTable,
    ForceTable,
    FunctionTable,
    JointTable,
    Kind,
    MechanismFile,
    read_mechanism_file,
)
from .expressions import OF_POINT, PLAIN, Node, compute, parse, quantities

Point = tuple[float, float]


@dataclass(frozen=True)
class Mechanism:
    """A planar mechanism with its named points, outputs and run.

    Parameters
    ----------
    file : MechanismFile
        The tables as read.
    system : System
        One planar scene.
    outputs : dict
        Column name -> parsed expression.
    """

    file: MechanismFile
    system: System
    outputs: Mapping[str, Node] = field(repr=False)
    path: Path = Path()

    @property
    def planar(self) -> PlanarScene:
        """The only element of the system."""
        element = self.system.elements[0]
        assert isinstance(element, PlanarScene)
        return element

    @property
    def scene(self) -> Scene:
        """Bodies, joints and forces."""
        return self.planar.scene

    def point(self, where: str, label: str = "point") -> tuple[int, Point]:
        """Body number and coordinates relative to the mass centre of ``body.point``, ``body.centre`` or ``body``."""
        body, _, name = where.partition(".")
        index = self.scene.body_index
        if body not in index:
            raise unknown_name(label, body, index)
        at = (0.0, 0.0) if name in ("", "origin") else None
        centre = self.planar.assembly.centre[index[body]]
        if name == "centre":
            return index[body], (0.0, 0.0)
        if at is None:
            points = self.file.ground.points_m if body == GROUND else self.file.bodies[body].points_m
            if name not in points:
                raise unknown_name(f"{label}: points of {body}", name, [*points, "origin", "centre"])
            at = points[name]
        return index[body], (at[0] - centre[0], at[1] - centre[1])

    def values(self, wanted: set[tuple[str, str | None]], q, v=None, a=None):  # type: ignore[no-untyped-def]
        """Quantities of bodies, joints and points for states of shape (n, size)."""
        found = {}
        for kind, what in wanted:
            if kind in PLAIN:
                continue
            assert what is not None
            if kind in OF_POINT:
                x, y = self._point_values(kind, what, q, v, a)
                found[kind, what] = x if kind.endswith("x") else y
            else:
                source = {"angle": q, "rate": v, "angular_acceleration": a}[kind]
                found[kind, what] = self._angle(what, source)
        return found

    def _angle(self, what: str, source):  # type: ignore[no-untyped-def]
        index = self.scene.body_index

        def of(body: str):  # type: ignore[no-untyped-def]
            i = index[body]
            return np.zeros(len(source)) if body == GROUND else source[:, 3 * i + 2]

        if what in index:
            return of(what)
        if what in self.file.joints:
            joint = self.file.joints[what]
            return of(joint.body) - of(joint.to)
        raise unknown_name("expression", what, [*index, *self.file.joints])

    def _point_values(self, kind: str, where: str, q, v, a):  # type: ignore[no-untyped-def]
        body, (lx, ly) = self.point(where, "expression")
        if body == len(self.scene.bodies):
            zero = np.zeros(len(q))
            return (zero + lx, zero + ly) if kind in ("x", "y") else (zero, zero)
        k = 3 * body
        c, s = np.cos(q[:, k + 2]), np.sin(q[:, k + 2])
        rx, ry = c * lx - s * ly, s * lx + c * ly
        if kind in ("x", "y"):
            return q[:, k] + rx, q[:, k + 1] + ry
        w = v[:, k + 2]
        if kind in ("vx", "vy"):
            return v[:, k] - w * ry, v[:, k + 1] + w * rx
        d = a[:, k + 2]
        return a[:, k] - d * ry - w * w * rx, a[:, k + 1] + d * rx - w * w * ry

    def start(self, time: float = 0.0) -> Start:
        """Consistent start state with the forced values of the file.

        Raises
        ------
        InputError
            When a loop cannot close, forced values contradict the joints, or nothing is free to move.
        """
        positions = [self._forced(text, target, 0) for text, target in self.file.start.positions.items()]
        velocities = [self._forced(text, target, 1) for text, target in self.file.start.velocities.items()]
        made = consistent_start(self.system, time, positions=positions, velocities=velocities)
        if made.freedoms.net <= 0 and not self.planar.driven:
            count = f"{made.freedoms.coordinates} coordinates, {made.freedoms.constraints} constraints"
            cure = "remove a joint, or prescribe a motion"
            raise InputError("joints", None, f"nothing is free to move ({count})", cure)
        return made

    def _forced(self, text: str, target: float, level: int) -> Forced:
        label = f"start.{('positions', 'velocities')[level]} {text!r}"
        node = parse(text, label)
        wanted = quantities(node)
        allowed = (("angle", "x", "y"), ("rate", "vx", "vy"))[level]
        for kind, _ in wanted:
            if kind not in allowed:
                problem = f"uses {kind}; only {', '.join(allowed)} can be forced here"
                raise InputError(label, None, problem, "use one of these")

        def position(q):  # type: ignore[no-untyped-def]
            return float(np.asarray(compute(node, self.values(wanted, q[None, :]))).reshape(-1)[0])

        def slope(q):  # type: ignore[no-untyped-def]
            steps = 1e-6 * np.diag(self.system.units)
            states = np.concatenate([q + steps, q - steps])
            ends = np.broadcast_to(compute(node, self.values(wanted, states)), len(states))
            return (ends[: len(q)] - ends[len(q) :]) / (2e-6 * self.system.units)

        def rate_slope(q):  # type: ignore[no-untyped-def]
            n = len(q)
            states = np.broadcast_to(q, (n + 1, n))
            made = np.broadcast_to(
                compute(node, self.values(wanted, states, np.vstack([np.eye(n), np.zeros(n)]))), n + 1
            )
            return made[:n] - made[n]

        here = self.system.start_q
        with np.errstate(all="ignore"):
            known = [position(here), *slope(here)] if level == 0 else rate_slope(here)
        if not np.isfinite(known).all():
            problem = "is not a finite number, or has no finite slope, at the start poses"
            raise InputError(label, None, problem, "force another expression, or give other start poses")
        if level == 0:
            return Forced(text, target, position, slope)
        offset = self._offset(node, wanted, label)
        return Forced(text, target - offset, position, rate_slope)

    def _offset(self, node: Node, wanted: set[tuple[str, str | None]], label: str) -> float:
        """What the expression of a velocity adds to its linear part; refuses one that is not linear."""
        random = np.random.default_rng(2)
        q = np.broadcast_to(self.system.start_q, (5, self.system.size))
        v = random.standard_normal((5, self.system.size)) * self.system.units
        v[0], v[3], v[4] = 0.0, 2.0 * v[1] - 3.0 * v[2], -v[1]
        at = np.broadcast_to(compute(node, self.values(wanted, q, v)), 5)
        part = at - at[0]
        rest = max(abs(part[3] - 2.0 * part[1] + 3.0 * part[2]), abs(part[4] + part[1]))
        if not np.isfinite(at).all() or rest > 1e-9 * float(np.abs(at).max()):
            raise InputError(label, None, "is not linear in the velocities", "force a sum of multiples of velocities")
        return float(at[0])


def load_mechanism(path: str | Path) -> Mechanism:
    """Read a mechanism file.

    Raises
    ------
    InputError
        For anything that the file has wrong, with the name of the entry and the cure.
    """
    return make_mechanism(read_mechanism_file(path), Path(path))


def make_mechanism(file: MechanismFile, path: Path = Path()) -> Mechanism:
    """Mechanism from its tables."""
    bodies = tuple(_body(name, table) for name, table in file.bodies.items())
    if not bodies:
        raise InputError("bodies", None, "there is none", "add a table [bodies.NAME]")
    joints = tuple(_part(file, f"joints.{n}", n, table, JOINTS[table.type]) for n, table in file.joints.items())
    forces = tuple(_part(file, f"forces.{n}", n, table, FORCES[table.type]) for n, table in file.forces.items())
    system = System([PlanarScene(Scene(bodies, joints, forces))])
    outputs: dict[str, Node] = {}
    made = Mechanism(file, system, outputs, path)
    zero = np.zeros((1, system.size))
    for i, output in enumerate(file.outputs):
        if output.name in outputs or output.name == "time_s":
            raise InputError(f"outputs[{i}].name", output.name, "is used twice", "rename the column")
        node = parse(output.value, f"outputs[{i}].value")
        made.values(quantities(node), zero, zero, zero)  # names exist
        outputs[output.name] = node
    for path_table in file.paths:
        if isinstance(path_table.point, str):
            made.point(f"{path_table.body}.{path_table.point}", "paths")
    for name in (*file.figure.curves, *file.figure.reference_columns):
        if name not in outputs:
            raise unknown_name("figure", name, outputs)
    return made


def _body(name: str, t: BodyTable) -> Body:
    angle = t.angle_rad if t.angle_rad is not None else math.radians(t.angle_deg or 0.0)
    return Body(name, t.mass_kg, t.inertia_kg_m2, t.centre_m, t.position_m, angle, t.velocity_m_per_s, t.rate_rad_per_s)


def _place(file: MechanismFile, body: str, point: str | Point | None, label: str) -> Point:
    if point is None:
        return (0.0, 0.0)
    if not isinstance(point, str):
        return point
    points = file.ground.points_m if body == GROUND else file.bodies[body].points_m
    if point == "centre" and body != GROUND:
        return file.bodies[body].centre_m
    if point not in points:
        raise unknown_name(f"{label}: points of {body}", point, points)
    return points[point]


def _part(file: MechanismFile, label: str, name: str, table: JointTable | ForceTable, kind: Kind) -> Any:
    """Joint or force from its table: the class of its type, the keys as its fields, what is not given by default."""
    module, _, cls = kind.reference.partition(":")
    values: dict[str, Any] = {}
    for key, field_name in kind.fields.items():
        value = getattr(table, key)
        if key in ("point", "to_point"):
            value = _place(file, str(table.body if key == "point" else table.to), value, f"{label}.{key}")
        elif isinstance(value, FunctionTable):
            value = time_function(value)
        elif key.endswith("_deg") and value is not None:
            value = math.radians(value)
        if value is not None:
            values[field_name] = value
    return getattr(importlib.import_module(module), cls)(**values, name=name)


def time_function(table: FunctionTable) -> TimeFunction:
    """Function of time from a table."""
    made = constant(table.constant)
    if table.polynomial:
        made = made + polynomial(table.polynomial, table.origin_s)
    if table.step is not None:
        assert table.step_width_s is not None
        made = made + smoothed_step(table.step_centre_s, table.step_width_s, table.step)
    if table.sine is not None:
        made = made + sine(table.sine, 2 * math.pi * table.frequency_hz, math.radians(table.phase_deg))
    return made
