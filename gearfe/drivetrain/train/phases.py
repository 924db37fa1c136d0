r"""Places of the teeth at the start: the phase of a mesh is geometry.

With :math:`\tau` the angle of a tooth's middle about the train's axis and :math:`\beta` that of the line of centres
from driver (1) to driven gear (2), driving flanks touch when

.. math::
    z_1(\tau_1 - \beta) + z_2(\tau_2 - \beta - \pi) = \pi + s\,z_2\,h \pmod{2\pi} ,

s the driver's sense (+1 or -1) and h half the backlash as a twist of the driven gear: for h = 0 a tooth on the line of
centres faces a space. An internal driven gear has a negative z_2. Its teeth face the driver's at beta, the direction
from the driver's axis to the pitch point. So the term is :math:`z_2(\tau_2 - \beta)`, with :math:`+s|z_2|h`. The curve
of the mesh begins at :math:`\varphi_0 = s(\tau_1 - \beta)`; an internal gear that drives is then at
:math:`\varphi_2 = -s(\tau_2 - \beta)`, with :math:`z_1\varphi_0 + |z_2|\varphi_2 = \pi + |z_2|h`. Gears joined by
meshes are one group, so one angle places all their teeth. Gears on one shaft that are joined by no mesh are keyed on it
independently of each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...base.tables.pair import ROUNDING_MM
from ...base.typing import Array
from .layout import LayoutMesh, TrainLayout

#: Agreement of the shafts' places that is checked, relative to the centre distance.
SAME = 1e-6
#: Agreement of a given phase with the teeth of shared gears, as a part of a tooth pitch.
NEAR = 1e-3


@dataclass(frozen=True)
class ToothPlaces:
    """Where teeth stand at the start.

    Attributes
    ----------
    angles
        Gear -> angle (rad) of the middle of one of its teeth, about the train's axis from the frame's first direction.
    phases
        For each mesh, the driver's rotation (rad) past a tooth on the line of centres, in its driving sense.
    """

    angles: dict[str, float]
    phases: tuple[float, ...]


@dataclass(frozen=True)
class _Join:
    """A mesh as a relation of two teeth: ``z1 (t1 - towards) + z2 (t2 - facing) = remainder``, modulo 2 pi."""

    mesh: LayoutMesh
    sense: float

    @property
    def teeth(self) -> tuple[int, int]:
        """Of driver and driven gear."""
        return self.mesh.driver.teeth, self.mesh.driven.teeth

    @property
    def given_phase(self) -> float:
        """Phase (rad) of the driver that is given, or 0 of the gear that drives."""
        phase = self.mesh.phase or 0.0
        return self.mesh.mate_phase(phase) if self.mesh.ring_drives else phase

    @property
    def remainder(self) -> float:
        """Right side of the relation (rad)."""
        return math.pi + self.sense * abs(self.mesh.driven.teeth) * self.mesh.contact_twist

    @property
    def facing(self) -> float:
        """Angle of the pitch point about the axis of the driven gear (rad)."""
        return self.mesh.towards if self.mesh.turns_alike else self.mesh.towards + math.pi

    def driver_tooth_at(self, phase: float) -> float:
        """Driver's tooth at a phase."""
        return self.mesh.towards + self.sense * phase

    def phase(self, tooth: float) -> float:
        """Phase (rad, 0 to a pitch) of the driver's tooth."""
        return _in_pitch(self.sense * (tooth - self.mesh.towards), 2.0 * math.pi / self.teeth[0])

    def driven_tooth(self, tooth: float) -> float:
        """Place of a driven tooth for a driver's."""
        towards, (z1, z2) = self.mesh.towards, self.teeth
        return self.facing + (self.remainder - z1 * (tooth - towards)) / z2

    def driver_tooth(self, tooth: float) -> float:
        """Place of a driver's tooth for a driven one."""
        towards, (z1, z2) = self.mesh.towards, self.teeth
        return towards + (self.remainder - z2 * (tooth - self.facing)) / z1

    def turn_left(self, driver: float, driven: float) -> float:
        """Rotation of the driver (rad) that is missing for its flanks to touch, at most half a pitch."""
        towards, (z1, z2) = self.mesh.towards, self.teeth
        sides = z1 * (driver - towards) + z2 * (driven - self.facing)
        return math.remainder(sides - self.remainder, 2.0 * math.pi) / z1


def tooth_places(layout: TrainLayout, senses: Sequence[float]) -> ToothPlaces:
    """Places of all teeth and phases of all meshes.

    In the first mesh of a connected group of gears the gear that drives has the phase 0, unless a phase is given.

    Parameters
    ----------
    senses
        For each mesh, +1 or -1: the driver turns about the axis or against it.

    Raises
    ------
    InputError
        For a closed chain of gears whose driving flanks cannot all touch, and for a given phase that the teeth of
        shared gears contradict.
    """
    joins = [_Join(mesh, float(sense)) for mesh, sense in zip(layout.meshes, senses, strict=True)]
    angles: dict[str, float] = {}
    for join in sorted(joins, key=lambda j: j.mesh.phase is None):
        if join.mesh.driver.name not in angles and join.mesh.driven.name not in angles:
            angles[join.mesh.driver.name] = join.driver_tooth_at(join.given_phase)
            _spread(joins, angles)
    room = 2.0 * sum(max(SAME * mesh.distance, 1e-3 * ROUNDING_MM) for mesh in layout.meshes)
    for join in joins:
        _check(join, angles, room)
    phases = tuple(join.phase(angles[join.mesh.driver.name]) for join in joins)
    return ToothPlaces({gear.name: angles.get(gear.name, 0.0) for gear in layout.gears}, phases)


def _spread(joins: Sequence[_Join], angles: dict[str, float]) -> None:
    """Add the places of all gears that meshes connect with those known."""
    before = 0
    while len(angles) > before:
        before = len(angles)
        for join in joins:
            driver, driven = join.mesh.driver.name, join.mesh.driven.name
            if driver in angles and driven not in angles:
                angles[driven] = join.driven_tooth(angles[driver])
            elif driven in angles and driver not in angles:
                angles[driver] = join.driver_tooth(angles[driven])


def _check(join: _Join, angles: dict[str, float], room: float) -> None:
    """The mesh's flanks touch, and a phase that was given is that of its gears."""
    mesh, pitch = join.mesh, 2.0 * math.pi / join.teeth[0]
    turn = join.turn_left(angles[mesh.driver.name], angles[mesh.driven.name])
    radius = mesh.driver.base_radius
    if abs(turn) * radius > room:
        problem = (
            "closes a chain of gears that cannot be assembled with all driving flanks in contact: "
            f"gear {mesh.driver.name!r} is {math.degrees(abs(turn)):.6g} deg ({abs(turn) / pitch:.4g} of its "
            f"pitch, {math.degrees(pitch):.6g} deg) off, {1e3 * abs(turn) * radius:.4g} mm on its base circle"
        )
        cure = "move a shaft of the chain, or change tooth numbers, so that the chain closes on whole teeth"
        raise InputError(f"mesh {mesh.name!r}", None, problem, cure)
    if mesh.phase is None:
        return
    geometric = join.phase(angles[mesh.driver.name])
    if abs(math.remainder(join.given_phase - geometric, pitch)) > NEAR * pitch:
        if mesh.ring_drives:
            pitch = 2.0 * math.pi / abs(join.teeth[1])
            geometric = _in_pitch(mesh.mate_phase(geometric, of_ring=False), pitch)
        degrees = f"{math.degrees(geometric):.9g}"
        problem = f"contradicts the teeth of gears that it shares with other meshes, which make it {degrees} deg"
        cure = f"leave it out, or write {degrees} (whole pitches of {math.degrees(pitch):.6g} deg more are the same)"
        raise InputError(f"mesh {mesh.name!r} phase_deg", math.degrees(mesh.phase), problem, cure)


def _in_pitch(angle: float, pitch: float) -> float:
    """Return an angle (rad) less whole pitches; a pitch less round-off is 0."""
    angle %= pitch
    return 0.0 if min(angle, pitch - angle) < 1e-9 * pitch else angle


def pair_shifts(mesh: LayoutMesh, sense: float, places: ToothPlaces) -> tuple[Array, Array]:
    r"""Return how much later the tooth pairs of a mesh touch because of the gears' pitch errors.

    Pair k is the k-th tooth of the driver behind the one whose place is the phase. It meets the driver's tooth
    :math:`s(k + m_1)` and the driven gear's :math:`m_2 - s k` (:math:`m_2 + s k` of an internal one), with m1, m2 from
    the places at the start, and touches later by :math:`-(e_1 + e_2)`. On the back flanks all is seen from the other
    side, with the sense -s.

    Parameters
    ----------
    mesh
        Whose gears have the pitch errors.
    sense
        +1 or -1: the driver turns about the train's axis or against it.
    places
        Angles of the teeth at the start.

    Returns
    -------
    driving, back : ndarray, shape (L,)
        Shifts (m) of the pairs on the driving and on the back flanks. L is a period of the pairs, the least common
        multiple of the numbers of teeth, or 1 without errors.
    """
    join = _Join(mesh, float(sense))
    return _shifts(join, places, join.sense), _shifts(join, places, -join.sense)


def _shifts(join: _Join, places: ToothPlaces, sense: float) -> Array:
    gears, towards = (join.mesh.driver, join.mesh.driven), join.mesh.towards
    errors = [np.array(g.pitch_errors[0 if sense > 0.0 else 1] or (0.0,)) for g in gears]
    if not any(e.any() for e in errors):
        return np.zeros(1)
    p1, p2 = (2.0 * math.pi / abs(teeth) for teeth in join.teeth)
    side = -1 if join.mesh.turns_alike else 1
    driver, driven = (places.angles[g.name] for g in gears)
    phase = join.sense * sense * join.phase(driver)
    first = round((phase - sense * (driver - towards)) / p1)
    facing = (join.facing - driven - side * sense * phase * p2 / p1) / p2 - 0.5 * side * sense
    k = np.arange(math.lcm(*join.teeth))
    turn = round(sense)
    met = turn * (k + first), round(facing) - side * turn * k
    return -np.asarray(sum(e[j % len(e)] for e, j in zip(errors, met, strict=True)))
