"""Links of plane finite elements: from their tables to elastic bodies, from names to interfaces, and what is asked."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.cache import cached_arrays, source_hash, versions
from ..base.errors import InputError, given, unknown_name
from ..base.progress import stage
from ..base.tables.mechanism import BodyTable
from ..base.tables.plate import InterfaceTable, PlateTable
from ..base.typing import Array, IntArray
from ..multibody.core.contract import Element
from ..multibody.planar.bodies import Body
from ..multibody.planar.floating import Floating, FloatingBody, frame_joint
from ..multibody.planar.linkage import Linkage

if TYPE_CHECKING:
    from ..fem.plane import Material
    from ..fem.reduction.plate_data import Interface, Plate

Point = tuple[float, float]
#: Times whose stresses are in memory together.
TOGETHER = 64
#: How far from an interface its nodes and points may lie, in parts of the link's size.
NEAR = 1e-6


def floating_body(plate: Plate, damping: float) -> FloatingBody:
    """Elastic body of the core from a reduced plate, with a damping time of Kelvin and Voigt (s)."""
    return FloatingBody(
        mass=plate.mass_matrix,
        linear=plate.linear,
        quadratic=plate.quadratic,
        centres=plate.centres,
        shifts=plate.shifts,
        turns=plate.turns,
        damping=damping,
        size=plate.size,
    )


@dataclass(frozen=True, eq=False)
class PlatePart:
    """A reduced plane part that is a link: its name, interfaces and start.

    Attributes
    ----------
    name, table, plate
        As in the file, and what was made of it.
    pose, speed
        Start of the frame (x, y, angle), and how fast they change.
    """

    name: str
    table: PlateTable
    plate: Plate
    pose: tuple[float, float, float]
    speed: tuple[float, float, float]

    @cached_property
    def body(self) -> FloatingBody:
        """The part as an elastic body of the core."""
        return floating_body(self.plate, self.table.damping_s)

    @property
    def node_names(self) -> tuple[str, ...]:
        """Names of the bodies at the interfaces: that of the link, then with ``.1``, ``.2`` ..."""
        return (self.name, *(f"{self.name}.{k}" for k in range(1, len(self.table.interfaces))))

    def at(self, place: Point, label: str) -> tuple[str, Point]:
        """Body of the interface on which a place of the frame lies, and the place as seen from its centre.

        Raises
        ------
        InputError
            Where it lies on none.
        """
        near = NEAR * self.plate.size
        for name, interface in zip(self.node_names, self.table.interfaces.values(), strict=True):
            if _distance(interface, np.array([place]))[0] <= near:
                x, y = interface.centre
                return name, (place[0] - x, place[1] - y)
        problem = f"lies on no interface of {self.name}: {', '.join(self.table.interfaces)}"
        cure = f"move it into one, or add [bodies.{self.name}.plate.interfaces.NAME] there"
        raise InputError(label, list(place), problem, cure)

    def nodes(self) -> tuple[Body, ...]:
        """Bodies without mass at the interfaces, which start as those of a rigid link."""
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        bodies = []
        for name, interface in zip(self.node_names, self.table.interfaces.values(), strict=True):
            dx, dy = interface.centre
            x, y = c * dx - s * dy, s * dx + c * dy
            place = (self.pose[0] + x, self.pose[1] + y)
            speed = (self.speed[0] - self.speed[2] * y, self.speed[1] + self.speed[2] * x)
            bodies.append(Body(name, 0.0, 0.0, (0.0, 0.0), place, self.pose[2], speed, self.speed[2]))
        return tuple(bodies)

    def rigid(self) -> Body:
        """The rigid link of the same mass and inertia."""
        plate, (x, y, angle) = self.plate, self.pose
        centre = (plate.centre.real, plate.centre.imag)
        return Body(self.name, plate.mass, plate.inertia, centre, (x, y), angle, self.speed[:2], self.speed[2])


@dataclass(frozen=True, eq=False)
class PlateLink:
    """A link of a mechanism with its elastic body; `own` are the body's coordinates in the system."""

    part: PlatePart
    element: Floating
    joint: Element
    points: dict[str, Point]
    own: slice
    nodes: IntArray  # (interfaces, 3) coordinates of the bodies at them

    def at(self, point: str, label: str) -> tuple[str, Point]:
        """Body and place of a named point."""
        if point in ("", "origin"):
            return self.part.at((0.0, 0.0), label)
        if point not in self.points:
            raise unknown_name(f"{label}: points of {self.part.name}", point, [*self.points, "origin"])
        return self.part.at(self.points[point], label)

    @property
    def damping(self) -> float:
        """Kelvin and Voigt's time (s)."""
        return self.part.table.damping_s

    def elastic_energy(self, q: Array) -> Array:
        """In states of the system (times, size) (J)."""
        return self.element.elastic_energy(q[..., self.own])

    def loss(self, q: Array, v: Array) -> Array:
        """Power that damping takes (W)."""
        return self.element.loss(q[..., self.own], v[..., self.own])

    def stresses(self, q: Array, v: Array) -> Array:
        """Stresses of the core in states of the system, shape (times, s)."""
        return np.array([self.element.stress(a[self.own], b[self.own]) for a, b in zip(q, v, strict=True)])

    def nodal_stresses(self, stress: Array) -> Array:
        """Return stresses xx, yy, xy at the nodes (Pa), shape (..., n, 3), from those of the core, shape (..., s)."""
        recovery = self.part.plate.stresses
        return np.asarray(stress @ recovery.reshape(-1, recovery.shape[2]).T).reshape(*stress.shape[:-1], -1, 3)

    def von_mises(self, stress: Array) -> Array:
        """Return von Mises' stress at the nodes (Pa), shape (..., n), from stresses of the core, shape (..., s)."""
        return von_mises_of(self.nodal_stresses(stress))

    def largest_von_mises(self, stresses: Array) -> Array:
        """Return the largest of von Mises' stress over the nodes (Pa), shape (times,), from those of the core."""
        blocks = range(0, len(stresses), TOGETHER)
        return np.concatenate([self.von_mises(stresses[k : k + TOGETHER]).max(axis=1) for k in blocks])

    def places(self, q: Array) -> np.ndarray:
        """Places of the nodes as complex numbers, shape (times, n)."""
        plate = self.part.plate
        vectors = q[:, self.own].reshape(len(q), -1, 2)
        z = vectors[..., 0] + 1j * vectors[..., 1]
        return np.asarray(z[:, :1] + z[:, 1:2] * plate.points + z[:, 2:] @ plate.modes.T)

    def _frame(self, q: Array) -> tuple[np.ndarray, np.ndarray]:
        """Place of the first interface and direction of the link's own frame, shape (times,)."""
        at = q[:, self.nodes[:, 0]] + 1j * q[:, self.nodes[:, 1]]
        if self.part.table.frame == "start" or len(self.nodes) < 2:
            return at[:, 0], np.exp(1j * (q[:, self.nodes[0, 2]]))
        chord = (at[:, 1] - at[:, 0]) / np.diff(self.part.body.centres[:2])
        return at[:, 0], np.exp(1j * np.angle(chord))

    def displacements(self, q: Array) -> np.ndarray:
        """Of the nodes in the link's own frame (m), complex, shape (times, n)."""
        origin, direction = self._frame(q)
        seen = (self.places(q) - origin[:, None]) / direction[:, None]
        plate = self.part.plate
        return np.asarray(seen - (plate.points - plate.centres[0]))

    def offset(self, q: Array, point: str, label: str) -> np.ndarray:
        """Displacement of a named point in the link's own frame (m), complex, shape (times,)."""
        name, (x, y) = self.at(point, label)
        which = self.part.node_names.index(name)
        k, body = self.nodes[which], self.part.body
        origin, direction = self._frame(q)
        place = q[:, k[0]] + 1j * q[:, k[1]] + np.exp(1j * q[:, k[2]]) * complex(x, y)
        start = body.centres[which] + complex(x, y) - body.centres[0]
        return np.asarray((place - origin) / direction - start)

    def exaggerated(self, q: Array, factor: float) -> np.ndarray:
        """Places with displacements in the link's own frame times a factor, complex, shape (times, n)."""
        return np.asarray(self.places(q) + (factor - 1.0) * self.displacements(q) * self._frame(q)[1][:, None])

    @cached_property
    def border(self) -> IntArray:
        """Sides of elements at the edge: ends and middle node, shape (sides, 3), ends in turn."""
        t = self.part.plate.triangles
        sides = np.concatenate([t[:, [0, 3, 1]], t[:, [1, 4, 2]], t[:, [2, 5, 0]]])
        middle, count = np.unique(sides[:, 1], return_counts=True)
        return np.asarray(sides[np.isin(sides[:, 1], middle[count == 1])], dtype=np.int64)

    @property
    def mesh(self) -> tuple[int, int]:
        """Number of nodes and of elements."""
        return len(self.part.plate.points), len(self.part.plate.triangles)


def von_mises_of(stresses: Array) -> Array:
    """Return von Mises' stress (Pa), shape (...), of plane stresses xx, yy, xy (Pa), shape (..., 3)."""
    x, y, shear = np.moveaxis(stresses, -1, 0)
    return np.asarray(np.sqrt(x * x - x * y + y * y + 3.0 * shear * shear))


#: Modules whose text decides a reduced plate.
_MODULES = (
    "fem/reduction/plate",
    "fem/reduction/plate_data",
    "fem/plane",
    "fem/meshing/plate_mesh",
    "mechanisms/plates",
)
#: Numbers of a plate that are stored as arrays of no dimension.
_NUMBERS = {"size": float, "mass": float, "centre": complex, "inertia": float}


def part_of_plate(name: str, table: BodyTable, folder: Path) -> PlatePart:
    """A link from its tables; the finite elements are condensed once for all links of the same shape and material."""
    plate = given(table.plate, f"bodies.{name}.plate")
    source = None if plate.mesh is None else folder / plate.mesh
    where = f"bodies.{name}.plate"
    angle = table.angle_rad if table.angle_rad is not None else math.radians(table.angle_deg or 0.0)
    reduced = _reduced(_Shape(plate, source, where), _fingerprint(source, f"{where}.mesh"))
    speed = (*table.velocity_m_per_s, table.rate_rad_per_s)
    return PlatePart(name, plate, reduced, (*table.position_m, angle), speed)


def _fingerprint(source: Path | None, field: str) -> str:
    """Return a hash of a mesh file and of the files that it includes; empty without one."""
    if source is None or not source.is_file():
        return ""
    from ..fem.meshing.mesh_file import source_fingerprint

    return source_fingerprint(source, field)


@dataclass(frozen=True)
class _Shape:
    """Data that determine a plate; equal for equal tables."""

    table: PlateTable
    source: Path | None
    where: str

    def __hash__(self) -> int:
        return hash(repr(self.table))


@lru_cache(maxsize=16)
def _reduced(shape: _Shape, text: str) -> Plate:
    """Return the reduced plate of a table and a hash of its mesh, from the cache if possible."""
    from ..fem.plane import Material
    from ..fem.reduction.plate_data import Plate

    table, made = shape.table, []
    material = Material(1e9 * table.youngs_modulus_GPa, table.poisson_ratio, density=table.density_kg_per_m3)

    def make() -> dict[str, Any]:
        made.append(_reduce(shape, material))
        return {own.name: np.asarray(getattr(made[0], own.name)) for own in fields(Plate)}

    code = [source_hash(*_MODULES), versions()]
    # keys of a recipe have no order, but the frame goes with the first interface
    recipe = {"table": table, "interfaces": list(table.interfaces), "mesh": text, "code": code}
    arrays = cached_arrays("plate", recipe, make)
    if made:
        return made[0]
    values: dict[str, Any] = {name: _NUMBERS.get(name, np.asarray)(value) for name, value in arrays.items()}
    return Plate(**values)


def _reduce(shape: _Shape, material: Material) -> Plate:
    from ..fem.reduction.plate import reduce_plate

    table = shape.table
    with stage("elastic link"):
        points, triangles = _mesh(shape)
        interfaces = _interfaces(points, table, shape.where)
        free = 2 * (len(points) - sum(len(interface.nodes) for interface in interfaces))
        if table.modes > free // 4:
            problem = f"are too many for a mesh with {free} displacements besides its interfaces"
            raise InputError(f"{shape.where}.modes", table.modes, problem, f"take at most {free // 4}, or a finer mesh")
        return reduce_plate(points, triangles, table.thickness_m, material, interfaces, table.modes)


def _mesh(shape: _Shape) -> tuple[Array, IntArray]:
    from ..fem.meshing.plate_mesh import check_outline, mesh_outline, read_plate

    table, where = shape.table, shape.where
    if table.outline_m is None:
        return read_plate(given(shape.source, f"{where}.mesh"), f"{where}.mesh", table.mesh_unit_m)
    holes = [
        (f"{where}.interfaces.{name}", *i.centre, i.radius_m)
        for name, i in table.interfaces.items()
        if i.radius_m is not None
    ]
    holes += [(f"{where}.holes_m[{k}]", *hole) for k, hole in enumerate(table.holes_m)]
    check_outline(table.outline_m, holes, f"{where}.outline_m")
    round_ = [hole[1:] for hole in holes]
    size = table.element_size_m or _width(np.array(table.outline_m), [r for *_, r in round_])
    return mesh_outline(table.outline_m, round_, size)


def _width(corners: Array, radii: list[float]) -> float:
    """Area over perimeter of a polygon with round holes (m): half the width of a thin strip."""
    ends = np.roll(corners, -1, axis=0)
    area = 0.5 * abs(float((corners[:, 0] * ends[:, 1] - corners[:, 1] * ends[:, 0]).sum()))
    area -= sum(math.pi * r**2 for r in radii)
    return area / (float(np.hypot(*(ends - corners).T).sum()) + sum(2 * math.pi * r for r in radii))


def _distance(interface: InterfaceTable, places: Array) -> Array:
    """Distance of places from an interface, inside a hole 0; shape (n,)."""
    if interface.edge_m is None:
        away = np.hypot(*(places - np.array(interface.centre)).T) - given(interface.radius_m, "radius_m")
        return np.maximum(away, 0.0)
    a, b = np.array(interface.edge_m)
    share = np.clip((places - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.asarray(np.hypot(*(a + share[:, None] * (b - a) - places).T))


def _interfaces(points: Array, table: PlateTable, where: str) -> list[Interface]:
    """Nodes of every interface."""
    from ..fem.reduction.plate_data import Interface

    near = NEAR * float(np.hypot(*np.ptp(points, axis=0)))
    interfaces: list[Interface] = []
    owner = np.full(len(points), "", dtype=object)
    for name, interface in table.interfaces.items():
        nodes = np.flatnonzero(_distance(interface, points) <= near)
        label = f"{where}.interfaces.{name}"
        if len(nodes) < 3:
            problem = f"has {len(nodes)} nodes of the mesh on it, and needs three"
            raise InputError(label, None, problem, "lay it on the edge of the part")
        taken = next((other for other in owner[nodes] if other), None)
        if taken is not None:
            raise InputError(label, None, f"shares nodes with interface {taken}", "leave elements between them")
        owner[nodes] = name
        interfaces.append(Interface(np.array(interface.centre), nodes))
    return interfaces


def plate_links(bodies: dict[str, BodyTable], planar: Linkage, parts: dict[str, PlatePart]) -> dict[str, PlateLink]:
    """Links with their elastic bodies, which stand in the system after the linkage and the beams, in their order."""
    made, at = {}, planar.size
    for name, part in parts.items():
        element = Floating(part.body, planar, name, part.pose, part.speed)
        nodes = np.array([[3 * planar.body_index[n] + k for k in range(3)] for n in part.node_names])
        joint = frame_joint(element, planar, part.node_names)
        own = slice(at, at + element.size)
        made[name] = PlateLink(part, element, joint, bodies[name].all_points, own, nodes)
        at += element.size
    return made
