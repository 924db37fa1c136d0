r"""Places of the teeth at the start: the phase of a mesh is geometry.

With :math:`\tau` the angle of a tooth's middle about the train's axis and :math:`\beta` that of the line of centres
from driver (1) to driven gear (2), driving flanks touch when

.. math::
    z_1(\tau_1 - \beta) + z_2(\tau_2 - \beta - \pi) = \pi + s\,z_2\,h \pmod{2\pi} ,

s the driver's sense (+1 or -1) and h half the backlash as a twist of the driven gear: for h = 0 a tooth on the line
of centres faces a space. The curve of the mesh begins at :math:`\varphi_0 = s(\tau_1 - \beta)`. Gears joined by meshes
are one group, so one angle places all their teeth; gears on one shaft that are joined by no mesh are keyed on it
independently of each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..gear.pair import MeshGeometry
from ..typing import Array
from .gear_train import GearMesh, GearTrain

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
    """A mesh as a relation of two teeth: ``z1 (t1 - towards) + z2 (t2 - towards - pi) = rest``, modulo 2 pi."""

    mesh: GearMesh
    sense: float
    towards: float
    teeth: tuple[int, int]
    rest: float
    base_radius: float
    distance: float

    def driver_tooth_at(self, phase: float) -> float:
        """Driver's tooth at a phase."""
        return self.towards + self.sense * phase

    def phase(self, tooth: float) -> float:
        """Phase (rad, 0 to a pitch) of the driver's tooth."""
        pitch = 2.0 * math.pi / self.teeth[0]
        found = (self.sense * (tooth - self.towards)) % pitch
        return 0.0 if min(found, pitch - found) < 1e-9 * pitch else found

    def driven_tooth(self, tooth: float) -> float:
        """Place of a driven tooth for a driver's."""
        return self.towards + math.pi + (self.rest - self.teeth[0] * (tooth - self.towards)) / self.teeth[1]

    def driver_tooth(self, tooth: float) -> float:
        """Place of a driver's tooth for a driven one."""
        return self.towards + (self.rest - self.teeth[1] * (tooth - self.towards - math.pi)) / self.teeth[0]

    def turn_left(self, driver: float, driven: float) -> float:
        """Rotation of the driver (rad) that is missing for its flanks to touch, at most half a pitch."""
        sides = self.teeth[0] * (driver - self.towards) + self.teeth[1] * (driven - self.towards - math.pi)
        return math.remainder(sides - self.rest, 2.0 * math.pi) / self.teeth[0]


def tooth_places(train: GearTrain, senses: Sequence[float]) -> ToothPlaces:
    """Places of all teeth and phases of all meshes.

    The first mesh of a connected group of gears has the phase 0, unless one of them is given a phase.

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
    joins = [_join(train, mesh, sense) for mesh, sense in zip(train.meshes, senses, strict=True)]
    found: dict[str, float] = {}
    for join in sorted(joins, key=lambda j: j.mesh.phase is None):
        if join.mesh.driver not in found and join.mesh.driven not in found:
            found[join.mesh.driver] = join.driver_tooth_at(join.mesh.phase or 0.0)
            _spread(joins, found)
    room = 2.0 * SAME * sum(join.distance for join in joins)
    for join in joins:
        _check(join, found, room)
    phases = tuple(join.phase(found[join.mesh.driver]) for join in joins)
    return ToothPlaces({gear.name: found.get(gear.name, 0.0) for gear in train.gears}, phases)


def _join(train: GearTrain, mesh: GearMesh, sense: float) -> _Join:
    one, two = train.gear(mesh.driver), train.gear(mesh.driven)
    arm = train.frame[:2] @ (np.array(train.shaft(two.shaft).point) - np.array(train.shaft(one.shaft).point))
    pair = MeshGeometry(one.gear, two.gear, mesh.centre_distance)
    return _Join(
        mesh,
        float(sense),
        math.atan2(arm[1], arm[0]),
        (one.gear.teeth, two.gear.teeth),
        math.pi + sense * two.gear.teeth * pair.contact_twist,
        one.gear.base_radius,
        float(np.linalg.norm(arm)),
    )


def _spread(joins: Sequence[_Join], found: dict[str, float]) -> None:
    """Places of all gears connected by meshes with those found."""
    before = 0
    while len(found) > before:
        before = len(found)
        for join in joins:
            driver, driven = join.mesh.driver, join.mesh.driven
            if driver in found and driven not in found:
                found[driven] = join.driven_tooth(found[driver])
            elif driven in found and driver not in found:
                found[driver] = join.driver_tooth(found[driven])


def _check(join: _Join, found: dict[str, float], room: float) -> None:
    """The mesh's flanks touch, and a phase that was given is that of its gears."""
    mesh, pitch = join.mesh, 2.0 * math.pi / join.teeth[0]
    turn = join.turn_left(found[mesh.driver], found[mesh.driven])
    if abs(turn) * join.base_radius > room:
        problem = (
            "closes a chain of gears that cannot be assembled with all driving flanks in contact: "
            f"gear {mesh.driver!r} stands {math.degrees(abs(turn)):.6g} deg ({abs(turn) / pitch:.4g} of its pitch, "
            f"{math.degrees(pitch):.6g} deg) off, {1e3 * abs(turn) * join.base_radius:.4g} mm on its base circle"
        )
        cure = "move a shaft of the chain, or change tooth numbers, so that the chain closes on whole teeth"
        raise InputError(f"mesh {mesh.name!r}", None, problem, cure)
    if mesh.phase is None:
        return
    made = join.phase(found[mesh.driver])
    if abs(math.remainder(mesh.phase - made, pitch)) > NEAR * pitch:
        degrees = f"{math.degrees(made):.9g}"
        problem = f"contradicts the teeth of gears that it shares with other meshes, which make it {degrees} deg"
        cure = f"leave it out, or write {degrees} (whole pitches of {math.degrees(pitch):.6g} deg more are the same)"
        raise InputError(f"mesh {mesh.name!r} phase_deg", math.degrees(mesh.phase), problem, cure)


def pair_shifts(train: GearTrain, mesh: GearMesh, sense: float, places: ToothPlaces) -> tuple[Array, Array]:
    """Return how much later the tooth pairs of a mesh touch because of the gears' pitch errors.

    Pair k is the k-th tooth of the driver behind the one whose place is the phase. It meets the driver's tooth
    :math:`s(k + m_1)` and the driven gear's :math:`m_2 - s k`, with m1, m2 from the places at the start, and touches
    later by :math:`-(e_1 + e_2)`. On the back flanks all is seen from the other side, with the sense -s.

    Parameters
    ----------
    train : GearTrain
        The train, whose gears have the pitch errors.
    mesh : GearMesh
        One of its meshes.
    sense : float
        +1 or -1: the driver turns about the train's axis or against it.
    places : ToothPlaces
        Angles of the teeth at the start.

    Returns
    -------
    driving, back : ndarray, shape (L,)
        Shifts (m) of the pairs on the driving and on the back flanks. L is a period of the pairs, the least common
        multiple of the numbers of teeth, or 1 without errors.
    """
    join = _join(train, mesh, sense)
    return _shifts(train, join, places, join.sense), _shifts(train, join, places, -join.sense)


def _shifts(train: GearTrain, join: _Join, places: ToothPlaces, sense: float) -> Array:
    one, two = train.gear(join.mesh.driver), train.gear(join.mesh.driven)
    errors = [np.array(g.pitch_errors[0 if sense > 0.0 else 1] or (0.0,)) for g in (one, two)]
    if not any(e.any() for e in errors):
        return np.zeros(1)
    p1, p2 = (2.0 * math.pi / teeth for teeth in join.teeth)
    driver, driven = (places.angles[g.name] for g in (one, two))
    phase = join.sense * sense * join.phase(driver)
    first = round((phase - sense * (driver - join.towards)) / p1)
    facing = (join.towards + math.pi - driven - sense * phase * p2 / p1) / p2 - 0.5 * sense
    k = np.arange(math.lcm(*join.teeth))
    turn = round(sense)
    met = turn * (k + first), round(facing) - turn * k
    return -np.asarray(sum(e[j % len(e)] for e, j in zip(errors, met, strict=True)))
