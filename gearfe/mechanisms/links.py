"""Flexible links of a mechanism: from their tables to beams, from names to nodes, and what is asked of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.errors import InputError, given, unknown_name
from ..base.tables.beam import BeamTable
from ..base.tables.mechanism import BodyTable, ForceTable, JointTable, MechanismFile
from ..base.typing import Array
from ..multibody.core.system import System
from ..multibody.planar.beam import Beam
from ..multibody.planar.beam_link import BeamLink, Section
from ..multibody.planar.linkage import Linkage
from .plates import PlateLink

Point = tuple[float, float]
#: The fastest sound of any solid or liquid (m/s): Trachenko et al., Science Advances 6 (2020) eabc8662.
FASTEST_SOUND = 36.1e3


def section_of(table: BeamTable) -> Section:
    """Cross-section from its keys."""
    if table.width_m is not None and table.height_m is not None:
        return Section.rectangle(table.width_m, table.height_m)
    if table.diameter_m is not None:
        return Section.tube(table.diameter_m, table.inner_diameter_m)
    return Section(given(table.area_m2, "area_m2"), given(table.second_moment_m4, "second_moment_m4"), table.edge_m)


def doubts(file: MechanismFile) -> list[str]:
    """Notes on flexible links of no real material, sqrt(E / rho) > `FASTEST_SOUND`: as a rule, E is in another unit."""
    problems = []
    for name, body in file.bodies.items():
        table = body.beam or body.plate
        if table is None or not body.bends:
            continue
        speed = math.sqrt(1e9 * table.youngs_modulus_GPa / table.density_kg_per_m3)
        if speed > FASTEST_SOUND:
            key = f"bodies.{name}.{'plate' if body.beam is None else 'beam'}.youngs_modulus_GPa"
            problem = f"makes sound faster ({speed:.2g} m/s) than in any material ({FASTEST_SOUND:.2g} m/s)"
            cure = f"give it in GPa, with the density of {table.density_kg_per_m3:g} kg/m3 (steel: 210, 7850)"
            problems.append(f"{key} = {table.youngs_modulus_GPa:g}: {problem}; {cure}")
    return problems


def link_of(file: MechanismFile, name: str, table: BodyTable) -> BeamLink:
    """Flexible link from its tables, with nodes wherever points, joints or forces are."""
    beam = given(table.beam, f"bodies.{name}.beam")
    points = {x for x, _ in table.points_m.values()}
    parts: list[JointTable | ForceTable] = [*file.joints.values(), *file.forces.values()]
    for part in parts:
        for body, point in ((part.body, part.point), (part.to, part.to_point)):
            if body == name and isinstance(point, tuple):
                points.add(point[0])
    angle = table.angle_rad if table.angle_rad is not None else math.radians(table.angle_deg or 0.0)
    return BeamLink(
        name,
        beam.length_m,
        section_of(beam),
        1e9 * beam.youngs_modulus_GPa,
        beam.density_kg_per_m3,
        poisson_ratio=beam.poisson_ratio,
        damping=beam.damping_s,
        elements=beam.elements,
        points=tuple(sorted(points)),
        position=table.position_m,
        angle=angle,
        velocity=table.velocity_m_per_s,
        rate=table.rate_rad_per_s,
    )


@dataclass(frozen=True, eq=False)
class FlexibleLink:
    """A link of a mechanism with its beam.

    Parameters
    ----------
    beam
        Element of the system.
    points
        Named points in the link's frame (m).
    clamped
        Deflections are against the frame of the start's section, not against the chord through both ends.
    """

    beam: Beam
    points: dict[str, Point]
    clamped: bool

    @property
    def damping(self) -> float:
        """Kelvin and Voigt's time (s)."""
        return self.beam.link.damping

    def elastic_energy(self, q: Array) -> Array:
        """In states of the system (times, size) (J)."""
        return self.beam.elastic_energy(q)

    def loss(self, q: Array, v: Array) -> Array:
        """Power that damping takes (W)."""
        return self.beam.loss(q, v)

    def node(self, point: str, label: str) -> int:
        """Number of the node of a named point."""
        if point in ("", "origin"):
            return 0
        if point not in self.points:
            raise unknown_name(f"{label}: points of {self.beam.link.name}", point, [*self.points, "origin"])
        return self.beam.link.node(self.points[point][0])

    def places(self, q: Array, stations: Array | None = None) -> Array:
        """Return x, y, theta of the nodes, or at other stations (m) of the axis, for states (times, size): (times, n,
        3)."""
        nodes = q[:, self.beam.places].reshape(len(q), -1, 3)
        return nodes if stations is None else np.einsum("sn,tnk->tsk", self.beam.shapes(stations)[0], nodes)

    def _frame(self, q: Array) -> tuple[np.ndarray, np.ndarray]:
        """Place of the start and direction of the link's own frame, complex, shape (times, 1)."""
        ends = self.places(q)[:, [0, -1]]
        at = ends[..., :1] + 1j * ends[..., 1:2]
        return at[:, 0], np.exp(1j * (ends[:, 0, 2:] if self.clamped else np.angle(at[:, 1] - at[:, 0])))

    def offsets(self, q: Array, stations: Array | None = None) -> Array:
        """Displacements along and across in the link's own frame (m), shape (times, n, 2)."""
        (origin, direction), at = self._frame(q), self.places(q, stations)
        moved = (at[..., 0] + 1j * at[..., 1] - origin) / direction
        moved = moved - (self.beam.link.stations if stations is None else stations)
        return np.stack([moved.real, moved.imag], axis=-1)

    def exaggerated(self, q: Array, stations: Array, factor: float) -> Array:
        """Places with displacements in the link's own frame times a factor, shape (times, n, 2)."""
        offset = self.offsets(q, stations)
        more = (factor - 1.0) * (offset[..., 0] + 1j * offset[..., 1]) * self._frame(q)[1]
        return np.asarray(self.places(q, stations)[..., :2] + np.stack([more.real, more.imag], axis=-1), dtype=float)

    def edge_stress(self, resultants: Array, label: str) -> Array:
        """Largest normal stress |N|/A + |M| e/I over the section (Pa)."""
        section = self.beam.link.section
        if section.edge is None:
            raise InputError(
                label, None, f"link {self.beam.link.name!r} has no edge_m", "give the position of the outer fibre"
            )
        bending = np.abs(resultants[..., 2]) * section.edge / section.second_moment
        return np.asarray(np.abs(resultants[..., 0]) / section.area + bending, dtype=float)

    @cached_property
    def smooth(self) -> Array:
        """Stations for pictures (m)."""
        ends = self.beam.link.ends
        return np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in itertools.pairwise(ends)]))


def flexible_links(file: MechanismFile, planar: Linkage, links: dict[str, BeamLink]) -> dict[str, FlexibleLink]:
    """Links with their beams, which are elements of the system beside the linkage."""
    made = {}
    for name, link in links.items():
        table = file.bodies[name]
        beam = given(table.beam, f"bodies.{name}.beam")
        made[name] = FlexibleLink(Beam(planar, link), dict(table.points_m), beam.frame == "start")
    return made


def bent_start(links: Mapping[str, FlexibleLink | PlateLink], system: System, rigid: Linkage, state: Array) -> Array:
    """Return coordinates and rates in which the flexible links move as rigid ones do.

    Parameters
    ----------
    links : mapping
        Flexible links by name.
    system : System
        System with the flexible links, a linkage first.
    rigid : Linkage
        The same mechanism with rigid links.
    state : ndarray, shape (2, 3 * bodies)
        Coordinates and rates of the rigid linkage (m, rad; m/s, rad/s).

    Returns
    -------
    q, v : ndarray, shape (2, size)
        Coordinates and rates of the system, stacked.
    """
    planar = system.elements[0]
    assert isinstance(planar, Linkage)
    out = np.stack([system.start_q, system.start_v])
    index, other = planar.body_index, rigid.body_index
    for body in rigid.bodies:
        k = 3 * other[body.name]
        (x, y, angle), (vx, vy, w) = state[:, k : k + 3]
        link = links.get(body.name)
        if link is None:
            first = 3 * index[body.name]
            out[:, first : first + 3] = state[:, k : k + 3]
            continue
        c, s = math.cos(angle), math.sin(angle)
        arms = link.beam.link.stations + 0j if isinstance(link, FlexibleLink) else link.part.plate.centres
        arms = arms - complex(*body.centre)
        arm = arms * complex(c, s)
        turn = np.ones(len(arm))
        places = link.beam.places if isinstance(link, FlexibleLink) else link.nodes.ravel()
        out[0, places] = np.stack([x + arm.real, y + arm.imag, angle * turn], axis=1).ravel()
        out[1, places] = np.stack([vx - w * arm.imag, vy + w * arm.real, w * turn], axis=1).ravel()
        if isinstance(link, PlateLink):
            origin = -complex(*body.centre) * complex(c, s)
            pose, speed = (x + origin.real, y + origin.imag, angle), (vx - w * origin.imag, vy + w * origin.real, w)
            out[:, link.own] = link.element.moving(pose, speed)
    return out
