r"""Kinematics of a train: ratios of the shafts, driving senses, common period, teeth at the start, steady forces.

All ratios are rational (`gearfe.drivetrain.train.rolling`), so the common period is exact. A mesh repeats after
:math:`1/(|g| z)` turns of the drive, with g the speed of its driver over that of the drive (against the carrier of a
planetary stage) and z the driver's teeth. Fractions have a least common multiple. In steady running the moments about
the axis of each shaft that is not held balance. They are base radius times force at each mesh, and on a carrier the
opposite of what its meshes exert on their gears.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache

import numpy as np

from ...base.typing import Array
from ...multibody.series.timefunctions import TimeFunction
from .layout import LayoutMesh, TrainLayout
from .phases import pair_shifts, tooth_places
from .planetary import check_assembly
from .rolling import Rolling, rolling

#: A common period of more cycles of the fastest mesh than this is of no practical use.
MOST_CYCLES = 200
#: Forces of meshes that are smaller, in parts of the largest, are round-off: they say nothing of flanks.
ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False)
class Kinematics:
    """How a train rolls, and the forces of its meshes in steady running.

    Attributes
    ----------
    rolling
        Speeds of the shafts, and what their torques react on.
    drivers
        Speed of the driver of each mesh for unit speed of the drive, against the carrier of its stage.
    cycles
        Mesh cycles in one turn of the drive, one a mesh.
    common_turns
        Turns of the drive after which all meshes are in phase again, the teeth with pitch errors, too; None beyond
        `MOST_CYCLES`.
    note
        Why there is no common period, or nothing.
    senses
        For each mesh, +1 or -1: sense about the axis in which the driver pushes, that of its rotation, and the opposite
        where the internal gear drives. Where the drive stands still, it follows from the loads; in a planetary stage
        always, for there "driver" is a name only.
    steady_forces : ndarray, shape (meshes,)
        Force of each mesh (N) under the final torques of the loads, without inertia; negative presses the back flanks.
        In a loop of gears those of least squares: statics alone do not determine them.
    angles
        Gear -> angle (rad) of the middle of one of its teeth at the start, about the axis from the first direction e1.
    phases
        For each mesh, the driver's rotation (rad) past a tooth on the line of centres at the start, in its driving
        sense.
    shifts
        For each mesh how much later the pairs of its driving and of its back flanks touch (m), see
        `gearfe.drivetrain.train.phases.pair_shifts`.
    """

    rolling: Rolling
    drivers: tuple[Fraction, ...]
    cycles: tuple[Fraction, ...]
    common_turns: Fraction | None
    note: str
    senses: tuple[float, ...]
    steady_forces: Array
    angles: Mapping[str, float]
    phases: tuple[float, ...]
    shifts: tuple[tuple[Array, Array], ...]

    @property
    def ratios(self) -> tuple[Fraction, ...]:
        """Speed of each shaft for unit speed of the drive, in the order of the shafts."""
        return self.rolling.ratios

    @property
    def first_turning(self) -> int:
        """Number of the first shaft that turns, whose turns orders count."""
        return next(number for number, ratio in enumerate(self.ratios) if ratio)


@lru_cache(maxsize=32)
def kinematics(layout: TrainLayout) -> Kinematics:
    """Kinematics of a layout; `gearfe.drivetrain.train.GearTrain.kinematics` are those of a train.

    Raises
    ------
    InputError
        For what `gearfe.drivetrain.train.rolling.rolling` refuses, planets that cannot be assembled, and what
        `gearfe.drivetrain.train.phases.tooth_places` refuses.
    """
    rolled = rolling(layout)
    drivers = tuple(against(mesh, mesh.driver.shaft, rolled.ratios) for mesh in layout.meshes)
    cycles = tuple(abs(speed * mesh.driver.teeth) for speed, mesh in zip(drivers, layout.meshes, strict=True))
    common, note = _common((*cycles, *_uneven(layout, rolled.ratios)))
    senses, forces = _senses_and_forces(layout, drivers)
    forces.setflags(write=False)
    check_assembly(layout)
    places = tooth_places(layout, senses)
    shifts = tuple(pair_shifts(mesh, sense, places) for mesh, sense in zip(layout.meshes, senses, strict=True))
    return Kinematics(rolled, drivers, cycles, common, note, senses, forces, places.angles, places.phases, shifts)


def against(mesh: LayoutMesh, shaft: int, ratios: Sequence[Fraction]) -> Fraction:
    """Speed of a shaft for unit speed of the drive against the carrier of a mesh, or against the ground."""
    return ratios[shaft] - (0 if mesh.carrier is None else ratios[mesh.carrier])


def _uneven(layout: TrainLayout, ratios: Sequence[Fraction]) -> list[Fraction]:
    """Turns of the gears with pitch errors in a turn of the drive, against the carriers of their meshes."""
    return [
        abs(against(mesh, gear.shaft, ratios))
        for mesh in layout.meshes
        for gear in (mesh.driver, mesh.driven)
        if any(gear.pitch_errors)
    ]


def mesh_phases(cycles: Sequence[Fraction], most: int) -> list[tuple[Fraction, list[int]]]:
    """Meshes in groups that are each in phase again after no more than `most` cycles of their fastest.

    Parameters
    ----------
    cycles
        Mesh cycles in one turn of the drive, one a mesh.

    Returns
    -------
    For each group the turns of the drive after which it repeats, and the numbers of its meshes.
    """
    groups: list[tuple[Fraction, list[int]]] = []
    for mesh, own in enumerate(cycles):
        if not own:  # gears that stand still against each other
            continue
        for number, (_, others) in enumerate(groups):
            together = [*(cycles[i] for i in others), own]
            turns = _repeating(together)
            if turns * max(together) <= most:
                groups[number] = turns, [*others, mesh]
                break
        else:
            groups.append((1 / own, [mesh]))
    return groups


def _repeating(cycles: Sequence[Fraction]) -> Fraction:
    """Turns after which what repeats so often in a turn is in phase again."""
    periods = [1 / c for c in cycles if c]
    return Fraction(math.lcm(*(p.numerator for p in periods)), math.gcd(*(p.denominator for p in periods)))


def _common(cycles: tuple[Fraction, ...]) -> tuple[Fraction | None, str]:
    """Turns after which all meshes are in phase again, or why there are none."""
    if not cycles:
        return None, "the train has no meshes"
    if not any(cycles):
        return None, "the gears of no mesh rotate against each other"
    turns = _repeating(cycles)
    if turns * max(cycles) > MOST_CYCLES:
        count = int(turns * max(cycles))
        note = f"the meshes share a period of {count} mesh cycles only, more than {MOST_CYCLES}: none within reason"
        return None, note
    return turns, ""


def _senses_and_forces(layout: TrainLayout, drivers: Sequence[Fraction]) -> tuple[tuple[float, ...], Array]:
    """Driving senses, and steady forces (N), see `Kinematics`; `drivers` are the speeds of the meshes' drivers."""
    rolled = tuple(
        math.copysign(1.0, -speed if mesh.ring_drives else speed)
        for mesh, speed in zip(layout.meshes, drivers, strict=True)
    )
    forces = balanced_forces(layout, rolled, load_torques(layout, [load_end(layout)]))[:, 0]
    sense = drive_sense(layout.speed)
    if sense == 0.0:
        sense = math.copysign(1.0, forces.sum())
    carried = np.array([mesh.carrier is not None for mesh in layout.meshes], dtype=bool)
    least = -ROUND_OFF * float(np.abs(forces).max(initial=0.0))
    turned = np.where(carried & (sense * forces < least), -sense, sense)
    return tuple((turned * rolled).tolist()), turned * forces


def load_end(layout: TrainLayout) -> float:
    """Time at which all load ramps have ended (s)."""
    return max((b for _, torque in layout.loads for b in torque.breaks), default=0.0)


def load_torques(layout: TrainLayout, times: Sequence[float] | Array) -> Array:
    """Torque of the loads on each shaft without its oscillating part (N m), shape (shafts, times)."""
    torques = np.zeros((len(layout.shafts), len(times)))
    for shaft, torque in layout.loads:
        torques[shaft] += replace(torque, sines=())(times)
    return torques


def balanced_forces(layout: TrainLayout, senses: Sequence[float], torques: Array) -> Array:
    """Mesh forces (N), shape (meshes, n), that balance the torques (N m) on the shafts, shape (shafts, n)."""
    count = len(layout.meshes)
    arms = np.zeros((len(layout.shafts), count + len(layout.couplings)))
    for column, (mesh, sense) in enumerate(zip(layout.meshes, senses, strict=True)):
        for gear, side in ((mesh.driver, 1.0), (mesh.driven, -1.0 if mesh.turns_alike else 1.0)):
            arms[gear.shaft, column] += side * sense * gear.base_radius
            if mesh.carrier is not None:
                arms[mesh.carrier, column] -= side * sense * gear.base_radius
    for column, (one, two) in enumerate(layout.couplings, start=count):
        arms[one, column], arms[two, column] = 0.01, -0.01  # as of a force at an arm of 10 mm
    held = {layout.driven, *(shaft for shaft, _ in layout.guided)}
    free = [shaft for shaft in range(len(layout.shafts)) if shaft not in held]
    return np.asarray(np.linalg.lstsq(arms[free], torques[free], rcond=None)[0][:count])


def drive_sense(speed: TimeFunction) -> float:
    """Sense in which the drive turns: that of its first speed that is not zero; 0 where it stands still."""
    speeds = [float(speed(t)) for t in _sample_times(speed)]
    return next((math.copysign(1.0, s) for s in speeds if s != 0.0), 0.0)


def fastest(speed: TimeFunction) -> float:
    """Largest speed of the drive (rad/s), without sign and oscillating parts."""
    steady = replace(speed, sines=())
    return max(abs(float(steady(t))) for t in _sample_times(speed))


def _sample_times(speed: TimeFunction) -> list[float]:
    """Breaks of a function of time, and times between them."""
    ends = (0.0, *speed.breaks)
    return sorted([*ends, *(0.5 * (a + b) for a, b in zip(ends, speed.breaks, strict=False))])
