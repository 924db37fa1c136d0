"""Waves on flanks, for the law that has them in its curves and for meshes whose flank nodes are moved."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gearfe.gears.contact.compliance import MeshingPair
from gearfe.gears.geometry.deviation import Deviation
from gearfe.gears.geometry.face import ToothDeviations, face_of
from gearfe.gears.geometry.pair import GearPair
from gearfe.gears.geometry.spur_gear import Gear


def wave(gear: Gear, waves: float, amplitude: float, phase: float = 0.3) -> ToothDeviations:
    """A sine over the roll angle, so many times round the gear."""
    flank, k = face_of(gear).flank, waves / gear.base_radius
    count = max(40, int(16 * (flank.end - flank.start) * k / (2 * math.pi)))

    def at(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return amplitude * np.sin(k * s + phase), amplitude * k * np.cos(k * s + phase)

    return ToothDeviations((Deviation.sampled(at, np.linspace(flank.start, flank.end, count)),))


def waved(pair: GearPair, elastic: MeshingPair, pinion: ToothDeviations) -> MeshingPair:
    """The meshed gears with the nodes of the pinion's flank moved along their normals, its elasticity as it was."""
    body, face, deviation = elastic.pinion, face_of(pair.pinion), pinion.profiles[0]
    assert deviation is not None
    points = body.flank.points @ np.array([1, 1j])
    roll = np.sqrt(np.maximum(np.abs(points) ** 2 - face.flank.base_radius**2, 0.0))
    at = np.clip(roll, face.flank.start, face.flank.end)
    moved = points + deviation.at(at)[0] * face.normals(face.flank.parameter(at))
    flank = replace(body.flank, points=np.stack([moved.real, moved.imag], axis=1))
    return replace(elastic, pinion=replace(body, flank=flank))
