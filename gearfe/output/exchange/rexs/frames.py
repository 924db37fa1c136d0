"""Locate components: local coordinate systems of REXS, each relative to another component.

A component has its origin (``support_vector``, mm) and the directions of its u and w axis in the system of its
reference component; v = w x u (https://spec.rexs.info, "Position and orientation in space").
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ....base.errors import InputError
from .model import Component, Model

Vector = tuple[float, float, float]
#: Angle between axes that count as parallel (rad), and error of the length of an axis: rounded decimals.
PARALLEL, LENGTH = 1e-6, 1e-3


@dataclass(frozen=True)
class Frame:
    """A coordinate system in that of the gear unit."""

    origin: Vector
    u: Vector
    v: Vector
    w: Vector

    def point(self, local: Sequence[float]) -> Vector:
        """Return a point of this system in that of the gear unit."""
        return _sum(self.origin, self.direction(local))

    def direction(self, local: Sequence[float]) -> Vector:
        """Return a direction of this system in that of the gear unit."""
        axes = zip(self.u, self.v, self.w, strict=True)
        return tuple(sum(part * axis for part, axis in zip(local, row, strict=True)) for row in axes)  # type: ignore[return-value]


ROOT = Frame((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def frames_of(model: Model) -> dict[int, Frame]:
    """Return the frames of all components that have a place.

    Raises
    ------
    InputError
        For references to components that do not exist or that are circular, vectors of another length than three, and
        axes that are no unit vectors at right angles.
    """
    frames: dict[int, Frame] = {}
    for number in model.components:
        _frame(model, number, frames, [])
    return frames


def _frame(model: Model, number: int, frames: dict[int, Frame], path: list[int]) -> Frame | None:
    if number in frames:
        return frames[number]
    component = model.components[number]
    where = f"reference_component_for_position of {component.label}"
    if number in path:
        circle = " -> ".join(map(str, [*path[path.index(number) :], number]))
        raise InputError(where, path[-1], f"goes in a circle: {circle}", "the gear unit refers to itself only")
    if "support_vector" not in component.attributes or component.attributes["support_vector"].value is None:
        return None
    reference = component.attributes.get("reference_component_for_position")
    parent = ROOT
    if reference is not None and reference.value not in (None, number):
        if reference.value not in model.components:
            raise InputError(where, reference.value, "refers to a component that does not exist", "correct it")
        known = _reference(model, reference.value, frames, [*path, number])
        if known is None:
            target = model.components[reference.value].label
            raise InputError(where, reference.value, f"refers to {target}, which has no support_vector", "add it")
        parent = known
    u = _axis(component, "u_axis_vector", (1.0, 0.0, 0.0))
    w = _axis(component, "w_axis_vector", (0.0, 0.0, 1.0))
    if abs(sum(a * b for a, b in zip(u, w, strict=True))) > LENGTH:
        raise InputError(f"w_axis_vector of {component.label}", list(w), "is not at a right angle to u", "correct it")
    u, w = parent.direction(u), parent.direction(w)
    frames[number] = Frame(parent.point(_vector(component, "support_vector")), u, cross(w, u), w)
    return frames[number]


def _reference(model: Model, number: int, frames: dict[int, Frame], path: list[int]) -> Frame | None:
    """Frame of a reference; chains longer than any drawing has are refused before the stack ends."""
    if len(path) > 200:
        where = f"reference_component_for_position of {model.components[path[0]].label}"
        raise InputError(where, None, "goes over more than 200 components", "refer to the gear unit")
    return _frame(model, number, frames, path)


def _vector(component: Component, name: str) -> Vector:
    values = component.attributes[name].numbers("mm")
    if len(values) != 3:
        raise InputError(f"{name} of {component.label}", list(values), "must have three numbers", "correct it")
    return (values[0], values[1], values[2])


def _axis(component: Component, name: str, default: Vector) -> Vector:
    if name not in component.attributes or component.attributes[name].value is None:
        return default
    vector = _vector(component, name)
    length = math.sqrt(sum(part * part for part in vector))
    if abs(length - 1.0) > LENGTH:
        raise InputError(f"{name} of {component.label}", list(vector), "must have the length 1", "correct it")
    return vector if length == 1.0 else (vector[0] / length, vector[1] / length, vector[2] / length)


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return sum(x * y for x, y in zip(a, b, strict=True))


def _sum(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@dataclass(frozen=True)
class Axes:
    """Axes of a job in the system of the gear unit: shafts run along y; x, y, z are right-handed."""

    x: Vector
    y: Vector
    z: Vector

    def of(self, point: Vector) -> Vector:
        """Return x, y, z of a point."""
        return (dot(point, self.x), dot(point, self.y), dot(point, self.z))


def axes_along(u: Vector) -> Axes:
    """Return the axes of a job: y along the shafts, z along v of the gear unit if possible."""
    size = max(abs(part) for part in u)
    along = (0.0, 1.0, 0.0) if abs(u[1]) < 0.9 * size else (0.0, 0.0, 1.0)
    share = dot(along, u)
    z = (along[0] - share * u[0], along[1] - share * u[1], along[2] - share * u[2])
    length = math.sqrt(dot(z, z))
    z = (z[0] / length, z[1] / length, z[2] / length)
    return Axes(cross(u, z), u, z)
