r"""Rolling of a train: ratios of the shafts to the drive, mesh frequencies, the common period of all meshes.

With :math:`\Delta\varphi_2 = -(z_1/z_2)\,\Delta\varphi_1` at each mesh all ratios are rational, so the common period
is exact: a mesh repeats after :math:`1/(|g| z)` turns of the drive (g the ratio of its driver, z the driver's teeth),
and fractions have a least common multiple.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from ..errors import InputError
from ..multibody.series.timefunctions import TimeFunction
from ..typing import Array
from .gear_train import GearTrain

#: A common period of more cycles of the fastest mesh than this is of no practical use.
MOST_CYCLES = 200


@dataclass(frozen=True)
class Rolling:
    """Kinematics of a train.

    Attributes
    ----------
    ratios
        Speed of each shaft for unit speed of the drive, in the order of the shafts.
    cycles
        Mesh cycles in one turn of the drive, one a mesh.
    common_turns
        Turns of the drive after which all meshes are in phase again, the teeth with pitch errors, too; None beyond
        `MOST_CYCLES`.
    note
        Why there is none.
    """

    ratios: tuple[Fraction, ...]
    cycles: tuple[Fraction, ...]
    common_turns: Fraction | None
    note: str = ""


def rolling(train: GearTrain) -> Rolling:
    """Ratios and common period.

    Raises
    ------
    InputError
        For shafts that neither drive nor mesh hold, and for loops of gears whose ratios contradict each other.
    """
    known = {train.driven.shaft: Fraction(1)}
    links = []
    for mesh in train.meshes:
        one, two = train.gear(mesh.driver), train.gear(mesh.driven)
        links.append((mesh.name, one.shaft, two.shaft, Fraction(-one.gear.teeth, two.gear.teeth)))
    for _ in train.shafts:
        for name, driver, driven, ratio in links:
            for first, second, factor in ((driver, driven, ratio), (driven, driver, 1 / ratio)):
                if first not in known:
                    continue
                made = known[first] * factor
                if known.setdefault(second, made) != made:
                    problem = f"closes a loop that cannot turn: shaft {second!r} would need two speeds"
                    raise InputError(
                        f"mesh {name!r}", None, problem, "take a gear out of the loop, or change its teeth"
                    )
    for shaft in train.shafts:
        if shaft.name not in known:
            problem = "is held by nothing: neither the drive nor a mesh connects it to the train"
            raise InputError(f"shaft {shaft.name!r}", None, problem, "add a mesh between its gears and the train's")
    cycles = tuple(
        abs(known[train.gear(mesh.driver).shaft]) * train.gear(mesh.driver).gear.teeth for mesh in train.meshes
    )
    uneven = [g.shaft for g in train.gears if any(g.pitch_errors)]
    common, note = _common((*cycles, *(abs(known[shaft]) for shaft in uneven)))
    return Rolling(tuple(known[s.name] for s in train.shafts), cycles, common, note)


def shaft_ratios(train: GearTrain) -> dict[str, Fraction]:
    """Shaft -> its speed for unit speed of the drive."""
    return dict(zip((s.name for s in train.shafts), rolling(train).ratios, strict=True))


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
    made: list[tuple[Fraction, list[int]]] = []
    for mesh, own in enumerate(cycles):
        for number, (_, others) in enumerate(made):
            together = [*(cycles[i] for i in others), own]
            turns = _repeating(together)
            if turns * max(together) <= most:
                made[number] = turns, [*others, mesh]
                break
        else:
            made.append((1 / own, [mesh]))
    return made


def _repeating(cycles: Sequence[Fraction]) -> Fraction:
    """Turns after which what repeats so often in a turn is in phase again."""
    periods = [1 / c for c in cycles]
    return Fraction(math.lcm(*(p.numerator for p in periods)), math.gcd(*(p.denominator for p in periods)))


def _common(cycles: tuple[Fraction, ...]) -> tuple[Fraction | None, str]:
    """Turns after which all meshes are in phase again, or why there are none."""
    if not cycles:
        return None, "the train has no meshes"
    turns = _repeating(cycles)
    if turns * max(cycles) > MOST_CYCLES:
        count = int(turns * max(cycles))
        note = f"the meshes share a period of {count} mesh cycles only, more than {MOST_CYCLES}: none within reason"
        return None, note
    return turns, ""


def steady_forces(train: GearTrain) -> Array:
    """Force of each mesh (N) under the final torques of the loads, without inertia; shape (meshes,).

    At every shaft that is not driven the moments about the axis balance, base radius times force at each mesh. In a
    loop of gears the forces of least squares are returned: statics alone do not determine them.
    """
    return balanced_forces(train, driving_senses(train), load_torques(train, [load_end(train)]))[:, 0]


def load_end(train: GearTrain) -> float:
    """Time at which all load ramps have ended (s)."""
    return max((b for load in train.loads for b in load.torque.breaks), default=0.0)


def load_torques(train: GearTrain, times: Sequence[float] | Array) -> Array:
    """Torque of the loads on each shaft without its oscillating part (N m), shape (shafts, times)."""
    found = np.zeros((len(train.shafts), len(times)))
    for load in train.loads:
        found[train.shaft_number(load.shaft)] += replace(load.torque, sines=())(times)
    return found


def balanced_forces(train: GearTrain, senses: Sequence[float], torques: Array) -> Array:
    """Mesh forces (N), shape (meshes, n), that balance the torques (N m) on the shafts, shape (shafts, n)."""
    arms = np.zeros((len(train.shafts), len(train.meshes)))
    for column, (mesh, sense) in enumerate(zip(train.meshes, senses, strict=True)):
        for gear in (train.gear(mesh.driver), train.gear(mesh.driven)):
            arms[train.shaft_number(gear.shaft), column] += sense * gear.gear.base_radius
    free = [k for k, shaft in enumerate(train.shafts) if shaft.name != train.driven.shaft]
    return np.asarray(np.linalg.lstsq(arms[free], torques[free], rcond=None)[0])


def driving_senses(train: GearTrain) -> tuple[float, ...]:
    """For each mesh, +1 or -1: sense about the axis in which the driver pushes, that of its rotation.

    Where the drive stands still, it follows from the loads.
    """
    ratios = shaft_ratios(train)
    made = tuple(math.copysign(1.0, ratios[train.gear(mesh.driver).shaft]) for mesh in train.meshes)
    sense = drive_sense(train.driven.speed)
    if sense == 0.0:
        pressing = balanced_forces(train, made, load_torques(train, [load_end(train)])).sum()
        sense = math.copysign(1.0, pressing)
    return tuple(sense * s for s in made)


def drive_sense(speed: TimeFunction) -> float:
    """Sense in which the drive turns: that of its first speed that is not zero; 0 where it stands still."""
    found = [float(speed(t)) for t in _sample_times(speed)]
    return next((math.copysign(1.0, s) for s in found if s != 0.0), 0.0)


def fastest(speed: TimeFunction) -> float:
    """Largest speed of the drive (rad/s), without sign and oscillating parts."""
    steady = replace(speed, sines=())
    return max(abs(float(steady(t))) for t in _sample_times(speed))


def _sample_times(speed: TimeFunction) -> list[float]:
    """Breaks of a function of time, and times between them."""
    ends = (0.0, *speed.breaks)
    return sorted([*ends, *(0.5 * (a + b) for a, b in zip(ends, speed.breaks, strict=False))])
