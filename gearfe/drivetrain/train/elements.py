r"""Elements of a train for the rigid core: shaft, hinge, bearing, constant springs and dampers.

First coordinates of a shaft: displacement of its mass centre along x, y, z (m), small tilts about e1 and e2 (rad), and
the difference of its spin about the axis a from rolling with the drive (rad). All are of its mean motion. What is fixed
on a shaft moves as the section that carries it (`ShaftBody`). A housing has the six coordinates of each bore, then its
internal ones. Forces of second order in the small motions (torque times tilt) are left out.

**Mass and inertia** of a shaft with its gears follow from geometry and density. A gear is its exact tooth outline of
width b outside the shaft (or its bore, where that is wider). An internal gear is the part of its rim outside of the
outline. With the polygon's :math:`A = \tfrac12\sum c_i`, :math:`J = \tfrac1{12}\sum c_i(|p_i|^2 + p_i\cdot p_{i+1} +
|p_{i+1}|^2)`, :math:`c_i = p_i \times p_{i+1}` (Green's theorem), its mass is :math:`\rho b A`, its polar inertia
:math:`\rho b J`, its transverse one :math:`\rho b J/2 + m b^2/12`. All are summed about the common mass centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from ...gears.geometry.derived import gear_outline
from ...gears.geometry.pair import Gear
from ...multibody import Element, LinearJoint, ModalBlocks
from .gear_train import GearTrain, Shaft, ShaftGear

#: Points on each piece of a tooth's outline: area good to 1e-7.
POINTS = 200


@dataclass(frozen=True, eq=False)
class Rotor:
    """A shaft with its gears as one rigid body.

    Attributes
    ----------
    mass
        kg.
    polar, transverse
        Moments of inertia about the axis and about any transverse line through the mass centre (kg m2).
    centre : (3,)
        Mass centre (m).
    """

    mass: float
    polar: float
    transverse: float
    centre: Array


class Masses(NamedTuple):
    """Mass properties of a part of a shaft."""

    mass: float  # kg
    polar: float  # kg m2, about the axis
    transverse: float  # kg m2, about any transverse line through its mass centre
    along: float  # m, its mass centre along the axis


def section_masses(shaft: Shaft, middle: float) -> list[Masses]:
    """Sections of a shaft whose middle is at a coordinate along the axis (m): hollow cylinders and cones."""
    nodes, weights = np.polynomial.legendre.leggauss(3)  # exact up to the fourth powers of the radii
    masses = []
    for (low, high, *_), section in zip(shaft.outline, shaft.sections, strict=True):
        part, length = 0.5 * (1.0 + nodes), high - low
        ends = ((section.outer_start, section.outer_end), (section.inner_start, section.inner_end))
        outer, inner = (0.5 * (start + part * (end - start)) for start, end in ends)
        slices = 0.5 * length * weights * section.density * math.pi * (outer**2 - inner**2)
        mass, polar = float(slices.sum()), float(0.5 * slices @ (outer**2 + inner**2))
        centre = float(slices @ part) / mass
        transverse = 0.5 * polar + float(slices @ (length * (part - centre)) ** 2)
        masses.append(Masses(mass, polar, transverse, middle + low + centre * length))
    return masses


def gear_masses(item: ShaftGear, shaft: Shaft, middle: float) -> Masses:
    """Gear outside of its shaft, or outside of its bore where that is wider; an internal gear up to its rim diameter.

    Parameters
    ----------
    item : ShaftGear
        The gear.
    shaft : Shaft
        Its shaft.
    middle : float
        Coordinate of the middle of the shaft along the axis (m).

    Raises
    ------
    InputError
        If the shaft reaches the teeth.
    """
    gear, width = item.gear, item.gear.face_width
    area, second = outline_moments(gear)
    if gear.internal:  # the rim outside of its teeth
        rim = 0.5 * (gear.rim_diameter or 0.0)
        mass = item.density * width * (math.pi * rim**2 - area)
        polar = item.density * width * (0.5 * math.pi * rim**4 - second)
        return Masses(mass, polar, 0.5 * polar + mass * width**2 / 12.0, item.along)
    radius = shaft.radius_within(item.along - middle - 0.5 * width, item.along - middle + 0.5 * width)
    if radius >= gear.root_radius:
        problem = f"radius {1e3 * radius:g} mm reaches the teeth of gear {item.name!r}"
        cure = f"must be < {1e3 * gear.root_radius:.6g} mm, its root radius"
        raise InputError(f"shaft {shaft.name!r}", None, problem, cure)
    inner = max(radius, 0.5 * gear.bore_diameter)
    mass = item.density * width * (area - math.pi * inner**2)
    polar = item.density * width * (second - 0.5 * math.pi * inner**4)
    transverse, along = 0.5 * polar + mass * width**2 / 12.0, 0.0
    if (web := gear.narrow_web) is not None:  # less the empty rings on both sides of the web
        outer, hub = web.radii[0], max(inner, *web.radii[1:])
        for low, high in ((-0.5 * width, web.offset - 0.5 * web.width), (web.offset + 0.5 * web.width, 0.5 * width)):
            ring = item.density * (high - low) * math.pi * (outer**2 - hub**2)
            middle = 0.5 * (low + high)
            ring_polar = 0.5 * ring * (outer**2 + hub**2)
            mass, polar, along = mass - ring, polar - ring_polar, along - ring * middle
            transverse -= 0.5 * ring_polar + ring * ((high - low) ** 2 / 12.0 + middle**2)
        along /= mass
        transverse -= mass * along**2
    return Masses(mass, polar, transverse, item.along + along)


@lru_cache(maxsize=64)
def outline_moments(gear: Gear) -> tuple[float, float]:
    """Area (m2) and polar second moment (m4) inside a gear's tooth outline."""
    p = 1e-3 * gear_outline(gear, 0.0, (0.0, 0.0), per_segment=POINTS)[:-1]
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    second = (cross * ((p * p).sum(axis=1) + (p * q).sum(axis=1) + (q * q).sum(axis=1))).sum() / 12.0
    return abs(float(cross.sum())) / 2.0, abs(float(second))


def rotor(train: GearTrain, shaft: Shaft) -> Rotor:
    """Mass properties of a shaft with the gears on it."""
    point, axis = np.array(shaft.point, dtype=float), train.frame[2]
    middle = float(point @ axis)
    m = shaft.density * math.pi * shaft.radius**2 * shaft.length
    parts = [Masses(m, 0.5 * m * shaft.radius**2, m * (3 * shaft.radius**2 + shaft.length**2) / 12.0, middle)]
    if shaft.sections:
        parts = section_masses(shaft, middle)
    parts += [gear_masses(item, shaft, middle) for item in train.gears if item.shaft == shaft.name]
    table = np.array(parts)
    total = table[:, 0].sum()
    along = float(table[:, 0] @ table[:, 3] / total)
    transverse = float((table[:, 2] + table[:, 0] * (table[:, 3] - along) ** 2).sum())
    centre = point + (along - float(point @ axis)) * axis
    given = (shaft.mass, shaft.polar_inertia, shaft.transverse_inertia)
    computed = (float(total), float(table[:, 1].sum()), transverse)
    mass, polar, transverse = (m if g is None else g for g, m in zip(given, computed, strict=True))
    return Rotor(mass, polar, transverse, centre)


class Gyration(NamedTuple):
    """Gyroscopic couple of a shaft: a polar inertia on two tilts, directions of its coordinates.

    A rigid shaft has one; of an elastic one they add up to the moments of all its sections and gears.
    """

    polar: float  # kg m2
    tilt: Array  # about e1, (size,)
    other: Array  # about e2, (size,)


class Plane(NamedTuple):
    """Two coordinates of a shaft, along e1 and e2 or about them, that have one inertia."""

    inertia: float
    first: Array  # (size,)
    second: Array  # (size,)


def planes(body: ShaftBody, frame: Array) -> tuple[Plane, ...]:
    """Motion of a shaft across the axis in pairs: of the mass centre, both tilts, elastic bending of unit mass."""
    unit = np.eye(body.size)
    across = unit[:3].T @ frame[:2].T
    pairs = [Plane(body.rotor.mass, *across.T), Plane(body.rotor.transverse, unit[3], unit[4])]
    bending = [[6 + i for i, kind in enumerate(body.kinds) if kind == f"bending {e}"] for e in ("e1", "e2")]
    return (*pairs, *(Plane(1.0, unit[one], unit[two]) for one, two in zip(*bending, strict=True)))


class ShaftBody(Element):
    """A shaft with its gears, rigid or elastic: what a train asks of it.

    Of its coordinates the first six are those of the mean motion: of the mass centre, both tilts, and the spin beside
    rolling. They are orthogonal to all others with respect to the mass.
    """

    rotor: Rotor
    start_rate: float

    def point_rows(self, point: Array, frame: Array, along: float | None = None) -> Array:
        """Return the displacement of a point along x, y, z beside rolling, per unit coordinate.

        Parameters
        ----------
        point : ndarray, shape (3,)
            In m.
        frame : ndarray, shape (3, 3)
            Rows e1, e2, a: directions of the train.
        along : float, optional
            Coordinate along the axis (m) of the section that carries the point; left out: that of the point.

        Returns
        -------
        rows : ndarray, shape (3, size)
        """
        raise NotImplementedError

    def turn_rows(self, along: float) -> Array:
        """Rotation of the section at a coordinate along the axis (m) about e1, e2, a per unit coordinate, (3, size)."""
        raise NotImplementedError

    def section_rows(self, along: Array, frame: Array) -> Array:
        """Return the motion of sections beside rolling: displacement and rotation along x, y, z, per unit coordinate.

        Parameters
        ----------
        along : ndarray, shape (k,)
            Coordinates along the axis (m).
        frame : ndarray, shape (3, 3)
            Rows e1, e2, a: directions of the train.

        Returns
        -------
        rows : ndarray, shape (k, 6, size)
        """
        raise NotImplementedError

    def gyrations(self) -> tuple[Gyration, ...]:
        """Gyroscopic couples."""
        raise NotImplementedError

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the coordinates beyond the six of the mean motion; a rigid shaft has none."""
        return ()

    def elastic_facts(self) -> dict[str, Any]:
        """Entries of the summary about an elastic shaft; none for a rigid one."""
        return {}


@dataclass(frozen=True, eq=False)
class RigidShaft(ShaftBody):
    """A shaft with its gears: six coordinates, constant diagonal mass.

    Parameters
    ----------
    rotor
        Mass properties.
    start_rate
        Spin beside rolling at the start (rad/s).
    """

    rotor: Rotor
    start_rate: float = 0.0
    name: str = "shaft"
    size: int = 6

    def mass(self) -> Array:
        """diag(m, m, m, J_t, J_t, J_p)."""
        r = self.rotor
        return np.diag([r.mass, r.mass, r.mass, r.transverse, r.transverse, r.polar])

    def start(self) -> tuple[Array, Array]:
        """At rest except for the spin."""
        return np.zeros(6), np.array([0.0, 0.0, 0.0, 0.0, 0.0, self.start_rate])

    def point_rows(self, point: Array, frame: Array, along: float | None = None) -> Array:  # noqa: ARG002
        """Displacement of a point along x, y, z beside rolling per unit coordinate, (3, 6); `along` does not matter."""
        arm = point - self.rotor.centre
        return np.hstack([np.eye(3), np.cross(frame, arm).T])

    def turn_rows(self, along: float) -> Array:  # noqa: ARG002
        """Rotation about e1, e2, a, the same of all sections, (3, 6)."""
        return np.eye(6)[3:]

    def section_rows(self, along: Array, frame: Array) -> Array:
        """Motion of sections along x, y, z, (k, 6, 6); see `ShaftBody`."""
        points = self.rotor.centre + (along - self.rotor.centre @ frame[2])[:, None] * frame[2]
        turns = np.hstack([np.zeros((3, 3)), frame.T])
        return np.array([np.vstack([self.point_rows(point, frame), turns]) for point in points])

    def gyrations(self) -> tuple[Gyration, ...]:
        """The one of the whole."""
        unit = np.eye(6)
        return (Gyration(self.rotor.polar, unit[3], unit[4]),)


@dataclass(frozen=True, eq=False)
class LinearForce(Element):
    """Constant springs and dampers between elements: force ``-C v - K q`` on their coordinates, (k, k) each."""

    touches: tuple[Element, ...] = field()
    C: Array = field()
    K: Array = field()
    name: str = "springs and dampers"

    def blocks(self) -> tuple[Array, Array]:
        """(C, K)."""
        return self.C, self.K


def bore_rows(shaft: ShaftBody, point: Array, frame: Array, bore: Array | None) -> Array:
    """Return the motion of a shaft relative to a bore: along e1, a, e2 and tilt about e1, e2.

    Parameters
    ----------
    shaft : ShaftBody
        The shaft.
    point : ndarray, shape (3,)
        Reference point of the bore, on the shaft's axis (m).
    frame : ndarray, shape (3, 3)
        Rows e1, e2, a: directions of the train.
    bore : ndarray, shape (N, 6), or None
        Selects the bore's coordinates from the housing's; None for a rigid housing.

    Returns
    -------
    rows : ndarray, shape (5, size) or (5, size + N)
        Relative displacements and tilts per unit coordinate of shaft and housing.
    """
    e1, e2, a = frame
    directions = np.array([e1, a, e2])
    moved = shaft.point_rows(point, frame)
    moved[:, 5] = 0.0  # the point is on the axis
    rows = np.zeros((5, shaft.size))
    rows[:3] = directions @ moved
    rows[3:] = shaft.turn_rows(float(point @ a))[:2]
    if bore is None:
        return rows
    other = np.zeros((5, 6))
    other[:3, :3] = directions
    other[3, 3:], other[4, 3:] = e1, e2
    return np.hstack([rows, -other @ bore.T])


def hinge(shaft: ShaftBody, housing: ModalBlocks | None, rows: Array, name: str) -> LinearJoint:
    """Return the ideal bearing of a shaft in a bore: five constraints that leave the spin free.

    Parameters
    ----------
    shaft : ShaftBody
        The shaft.
    housing : ModalBlocks or None
        Body with the bore; None for a rigid housing.
    rows : ndarray, shape (5, size) or (5, size + N)
        Motion of the shaft relative to the bore per unit coordinate, see `bore_rows`.
    name : str
        Name in messages.
    """
    touches: tuple[Element, ...] = (shaft,) if housing is None else (shaft, housing)
    return LinearJoint(touches, rows, np.zeros(len(rows)), name=name)


def pin_rows(planet: ShaftBody, carrier: ShaftBody, point: Array, radial: Array, frame: Array) -> Array:
    """Return the motion of a planet against its carrier: radial, along the axis, tangential, tilts about e1 and e2.

    Parameters
    ----------
    planet, carrier : ShaftBody
        Their shafts.
    point : ndarray, shape (3,)
        Middle of the pin (m).
    radial : ndarray, shape (3,)
        Unit vector from the carrier's axis to the pin.
    frame : ndarray, shape (3, 3)
        Rows e1, e2, a: directions of the train.

    Returns
    -------
    rows : ndarray, shape (5, sizes of planet and carrier)
    """
    axis = frame[2]
    directions, along = np.array([radial, axis, np.cross(axis, radial)]), float(point @ axis)
    rows = []
    for sign, body in ((1.0, planet), (-1.0, carrier)):
        moved = directions @ body.point_rows(point, frame, along)
        rows.append(sign * np.vstack([moved, body.turn_rows(along)[:2]]))
    return np.hstack(rows)


def bearing(
    shaft: ShaftBody, housing: ModalBlocks | None, rows: Array, stiffness: Array, damping: Array, name: str
) -> LinearForce:
    """Return the springs and dampers of a bearing on the five relative motions of shaft and bore.

    With the rows R, K = R^T stiffness R and C = R^T damping R.

    Parameters
    ----------
    shaft : ShaftBody
        The shaft.
    housing : ModalBlocks or None
        Body with the bore; None for a rigid housing.
    rows : ndarray, shape (5, size) or (5, size + N)
        R: motion of the shaft relative to the bore per unit coordinate, see `bore_rows`.
    stiffness : ndarray, shape (5, 5)
        Along e1, a, e2 (N/m) and about e1, e2 (N m/rad).
    damping : ndarray, shape (5, 5)
        In the same order (N s/m, N m s/rad).
    name : str
        Name in messages.
    """
    touches: tuple[Element, ...] = (shaft,) if housing is None else (shaft, housing)
    return LinearForce(touches, rows.T @ (damping @ rows), rows.T @ (stiffness @ rows), name)
