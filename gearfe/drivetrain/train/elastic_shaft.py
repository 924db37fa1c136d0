r"""An elastic shaft in a train: a rotor of Timoshenko beams, reduced to few coordinates, with its gears as rigid discs.

The first six coordinates are those of a rigid shaft. They are modes without strain, so mass and stiffness do not couple
them to the others, which have unit mass and the squares of their frequencies as stiffness:

.. math:: q = (u_c, \theta_1, \theta_2, \vartheta, \eta),\qquad u(y) = R(y)\,q ,

u the displacement and rotation of the section at y. Gears, bores, drive and loads act on the sections that carry them:
they are the stations whose static deflections the reduction keeps (`gearfe.fem.beams`). A gear is a disc at the middle
of its face; it stiffens nothing. Gyroscopic moments of sections and gears turn with the mean spin of the shaft.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from ...fem.beams import BeamShaft, Disc, ReducedShaft, Station, reduce_shaft
from ..bearings import BallBearing, RollerBearing
from .driveline import spring_places
from .elements import Gyration, Rotor, ShaftBody, gear_masses
from .gear_train import Coupling, GearTrain, Machine, Shaft, ShaftForce, ShaftGear, common_face

#: Gyroscopic couples below this part of the largest are left out, as they count at this part of the highest frequency.
#: Whirl frequencies of a train with shafts of 20 mm then change by 2e-8 at 600 rad/s and by 5e-7 at 3000 rad/s, and
#: those of a rotor with an overhung gear by 5e-7 at 500 rad/s and by 4e-6 at 4000 rad/s.
LEAST_GYRATION, COUNTED_AT = 1e-4, 0.1

#: Part of a face width by which the middles of two faces may differ and count as one.
SAME_MIDDLE = 1e-6


@dataclass(frozen=True, eq=False)
class ElasticShaft(ShaftBody):
    """A reduced shaft with its gears.

    Parameters
    ----------
    reduced
        The reduced beams.
    base : ndarray, shape (3,)
        A point of the axis (m).
    highest_hz
        Highest frequency of interest (Hz).
    damping_ratio
        Of its own modes.
    beta
        Factor of the stiffness in the damping (s).
    start_rate
        Spin beside rolling at the start (rad/s).
    """

    reduced: ReducedShaft
    base: Array
    highest_hz: float
    damping_ratio: float = 0.0
    beta: float = 0.0
    start_rate: float = 0.0
    name: str = "shaft"

    @property
    def size(self) -> int:  # type: ignore[override]
        """Number of coordinates."""
        return self.reduced.size

    @cached_property
    def rotor(self) -> Rotor:  # type: ignore[override]
        """Mass properties of the whole."""
        reduced, axis = self.reduced, self.reduced.frame[2]
        centre = self.base + (reduced.centre - self.base @ axis) * axis
        return Rotor(reduced.mass, reduced.polar, reduced.transverse, centre)

    def mass(self) -> Array:
        """diag(m, m, m, J_t, J_t, J_p, 1, ...)."""
        return self.reduced.mass_matrix()

    def blocks(self) -> tuple[Array, Array]:
        """Damping and stiffness, diagonal and zero of the mean motion."""
        squares = self.reduced.stiffness_diagonal
        return np.diag(2.0 * self.damping_ratio * np.sqrt(squares) + self.beta * squares), np.diag(squares)

    def start(self) -> tuple[Array, Array]:
        """At rest except for the spin."""
        rates = np.zeros(self.size)
        rates[5] = self.start_rate
        return np.zeros(self.size), rates

    def point_rows(self, point: Array, frame: Array, along: float | None = None) -> Array:
        """Displacement of a point that moves with the section at `along`, (3, size); see `ShaftBody`."""
        axis = self.reduced.frame[2]
        place = float(point @ axis) if along is None else along
        rows = self.reduced.rows(place)
        arm = point - self.base - (place - self.base @ axis) * axis
        return np.asarray(rows[:3] + np.cross(frame, arm).T @ rows[3:])

    def turn_rows(self, along: float) -> Array:
        """Rotation of the section at a coordinate along the axis (m) about e1, e2, a, (3, size)."""
        return self.reduced.rows(along)[3:]

    def section_rows(self, along: Array, frame: Array) -> Array:
        """Motion of sections along x, y, z, (k, 6, size); see `ShaftBody`."""
        rows = self.reduced.rows(along)
        return np.concatenate([rows[:, :3], frame.T @ rows[:, 3:]], axis=1)

    def gyrations(self) -> tuple[Gyration, ...]:
        r"""Gyroscopic couples that matter, the largest first.

        Moments :math:`\Omega\omega\,\Gamma` count against the dynamic stiffness :math:`\omega_i^2 + \omega_c^2` (times
        the mass) of each coordinate, :math:`\omega_c` a tenth of the highest frequency: residual coordinates, stiff as
        they are, turn by next to nothing. In these units couples below `LEAST_GYRATION` of the largest are left out.
        """
        reduced, pairs = self.reduced, self.reduced.gyroscopic
        root = np.sqrt([[pair.inertia] for pair in pairs])
        first, second = (root * np.array([getattr(pair, name) for pair in pairs]) for name in ("first", "second"))
        stiffness = (
            reduced.stiffness_diagonal + (2.0 * math.pi * COUNTED_AT * self.highest_hz) ** 2 * reduced.mass_diagonal
        )
        mixed, sizes, _ = np.linalg.svd(second / np.sqrt(stiffness), full_matrices=False)
        kept = sizes**2 >= LEAST_GYRATION * sizes[0] ** 2
        over = mixed.T[kept] / sizes[kept, None]
        return tuple(
            Gyration(float(size) ** 2, *couple)
            for size, *couple in zip(sizes[kept], over @ first, over @ second, strict=True)
        )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the coordinates beyond the six of the mean motion, of `gearfe.fem.beams.reduced.KINDS`."""
        return self.reduced.kinds

    def elastic_facts(self) -> dict[str, Any]:
        """Entries of the summary: coordinates, elements, own modes without bearings, and their errors."""
        reduced = self.reduced
        modes = ~reduced.residual
        return {
            "coordinates": reduced.size,
            "elements": reduced.elements,
            "highest_frequency_Hz": self.highest_hz,
            "own_frequencies_Hz": reduced.frequencies_hz[modes],
            "largest_frequency_error": float(reduced.frequency_errors[modes].max(initial=0.0)),
            "gyroscopic_couples": len(self.gyrations()),
        }


def elastic_shaft(train: GearTrain, shaft: Shaft, start_rate: float) -> ElasticShaft:
    """Return a shaft with sections, with its gears.

    Parameters
    ----------
    train : GearTrain
        The train.
    shaft : Shaft
        One of its shafts, which has sections.
    start_rate : float
        Spin beside rolling at the start (rad/s).

    Raises
    ------
    InputError
        For a highest frequency that takes too many elements.
    """
    frame = tuple(tuple(map(float, row)) for row in train.frame)
    try:
        reduced = reduced_shaft(beam_shaft(train, shaft), frame, shaft.highest_hz, shaft.elements)
    except InputError as error:
        if error.field != "highest frequency (Hz)":
            raise
        raise InputError(f"shaft {shaft.name!r} highest_frequency_Hz", error.value, error.problem, error.cure) from None
    base, beta = np.array(shaft.point, dtype=float), train.damping.beta
    return ElasticShaft(
        reduced, base, shaft.highest_hz, shaft.damping_ratio, beta, start_rate, name=f"shaft {shaft.name}"
    )


def beam_shaft(train: GearTrain, shaft: Shaft) -> BeamShaft:
    """Sections, gears and loaded places of a shaft."""
    middle = float(np.array(shaft.point) @ train.frame[2])
    discs, stations = [], []
    for item in (gear for gear in train.gears if gear.shaft == shaft.name):
        mass, polar, transverse, along = gear_masses(item, shaft, middle)
        discs.append(Disc(along, mass, polar, transverse))
        stations.append(Station(along, f"gear {item.name}", _gear_loads(train, item)))
    for bore in shaft.bores:
        along = float(train.bore_points[bore] @ train.frame[2])
        stations.append(Station(along, f"attachment {bore}", _bore_loads(train, bore)))
    if train.floats(shaft.name):
        stations.append(Station(middle, "hold along the axis", ("axial", "tilt")))
    for name, end in train.shaft_ends(shaft.name):
        if not end.machine:
            stations.append(Station(train.place(end), name, ("torsion",)))
    for number, force in enumerate(train.forces):
        if force.shaft == shaft.name:
            stations.append(Station(force.along, f"force {number + 1}", _force_loads(train, force)))
    springs: list[Machine | Coupling] = [*train.machines, *train.couplings]
    for spring in springs:
        for name, along in spring_places(train, spring):
            if name == shaft.name:
                stations.append(Station(along, f"spring of {spring.name}", ("torsion",)))
    return BeamShaft(middle - 0.5 * shaft.length, shaft.sections, tuple(discs), tuple(stations), f"shaft {shaft.name}")


def _gear_loads(train: GearTrain, item: ShaftGear) -> tuple[str, ...]:
    """Directions in which meshes load a shaft at a gear: each one costs coordinates and shorter steps."""
    helical = item.gear.twist_rate != 0.0  # an axial force at the pitch circle tilts, too
    tilts = helical
    for mesh in (mesh for mesh in train.meshes if item.name in (mesh.driver, mesh.driven)):
        low, high = common_face(train.gear(mesh.driver), train.gear(mesh.driven))
        # a mesh acts at the middle of the common width, or all along it
        off = abs(0.5 * (low + high) - item.along) > SAME_MIDDLE * item.gear.face_width
        tilts |= off or mesh.moments or mesh.acts_along_width
    return ("radial", *(("tilt",) if tilts else ()), *(("axial",) if helical else ()), "torsion")


def _force_loads(train: GearTrain, force: ShaftForce) -> tuple[str, ...]:
    """Directions in which a force and a moment load a shaft."""
    push, moment, axis = np.array(force.values[:3]), np.array(force.values[3:]), train.frame[2]
    found = {"radial": np.cross(push, axis).any(), "tilt": moment.any(), "axial": bool(push @ axis)}
    return tuple(name for name, loaded in found.items() if loaded)


def _bore_loads(train: GearTrain, bore: str) -> tuple[str, ...]:
    """Directions in which a hinge or bearing loads a shaft; a rolling bearing may load all of them."""
    bearing = next((b for b in train.bearings if b.bore == bore), None)
    if bearing is None or isinstance(bearing.stiffness, BallBearing | RollerBearing):
        return "radial", "tilt", "axial"
    size = np.abs(bearing.stiffness_matrix) + np.abs(bearing.damping_matrix)
    return ("radial", *(("tilt",) if size[:, 3:].any() else ()), *(("axial",) if size[:, 1].any() else ()))


@lru_cache(maxsize=32)
def reduced_shaft(
    shaft: BeamShaft, frame: tuple[tuple[float, ...], ...], highest_hz: float, elements: int | None
) -> ReducedShaft:
    """Return the reduced coordinates of a shaft, kept by the values that they follow from.

    Parameters
    ----------
    shaft : BeamShaft
        The shaft.
    frame : tuple, shape (3, 3)
        Rows e1, e2, a.
    highest_hz : float
        Highest frequency of its own modes that are kept (Hz).
    elements : int or None
        Number of elements; None: as that frequency needs.
    """
    return reduce_shaft(shaft, np.array(frame), highest_hz, elements=elements)
