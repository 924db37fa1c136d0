"""A train as an oscillator of few freedoms: approaches of its flanks, and the rotations that their phases follow."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from ...gears.geometry.pair import MeshGeometry
from ..train.forces import Flank
from ..train.friction import Lubrication
from ..train.kinematics import drive_sense, fastest, mesh_phases
from ..train.model import TrainModel
from ..train.simulate import DIVERGED
from .balance import Oscillator
from .coupling import TurnedSpring
from .linear import Linear
from .mesh_forces import WHOLE, MeshForces, Rubbing, SwingingTorque

#: Meshes whose common period is of no more cycles share a phase: two phases then cost more than the longer period.
SHARED = 12
#: Most mesh cycles in a turn of the drive, after which motions repeat under torques of whole orders of its shaft, as
#: motors and engines have them. Harmonics and samples grow with their number.
LONGEST = 64
#: Most phases: harmonics and samples grow with their number.
MOST_PHASES = 3
#: Unit directions that differ by no more are one.
PARALLEL = 1e-12


@dataclass(frozen=True, eq=False)
class CondensedTrain:
    """A train in steady running.

    Attributes
    ----------
    model
        What it was made of.
    system
        Its freedoms, forces and linear part.
    forces
        Those of the flanks.
    flanks_of_mesh
        For each mesh the numbers of its driving flank and, where it has one, of its back flank.
    steady
        Force of each mesh by statics (N).
    directions : (system size, m)
        Of the freedoms.
    torque : (system size,)
        Constant torques on the coordinates.
    frames : (shafts, phases)
        Rotation of the frame of each shaft for one of each phase; 0 in a rigid housing.
    """

    model: TrainModel
    system: Oscillator
    forces: MeshForces
    flanks_of_mesh: tuple[tuple[int, ...], ...]
    steady: Array
    directions: Array
    torque: Array
    frames: Array

    @cached_property
    def passes(self) -> dict[int, tuple[str, int]]:
        """Carriers that turn in an elastic housing, by phase: their names, and the most planets of one of them."""
        made: dict[int, tuple[str, int]] = {}
        for carrier in self.model.train.carriers:
            turned = self.frames[self.model.train.shaft_number(carrier.shaft)]
            for phase in np.flatnonzero(turned).tolist():
                name, planets = f"carrier {carrier.name}", len(carrier.pins)
                if phase in made:  # of one speed with another carrier
                    name, planets = f"{made[phase][0]} and {carrier.name}", max(planets, made[phase][1])
                made[phase] = name, planets
        return made

    @cached_property
    def bores_of_modes(self) -> Array:
        """(bores, n) displacement along the shafts at each bore for unit modal coordinates."""
        return np.asarray(self.model.axial @ self.model.modal.T)

    @cached_property
    def displaced_of_modes(self) -> Array:
        """(n, 3 shafts) displacements of the shafts for unit modal coordinates, see `TrainModel.displaced`."""
        return np.asarray(self.model.modal.T.T @ self.model.displaced)

    @cached_property
    def radiation_of_modes(self) -> Array | None:
        """(n, n) surface matrix of the housing in modal coordinates; None where the housing has no surface."""
        housing = self.model.train.housing
        if housing is None or not housing.has_mesh:
            return None
        shapes = self.model.modal.T[: housing.size]
        return np.asarray(shapes.T @ housing.radiation @ shapes)


def condense(model: TrainModel, shared: int = SHARED, speeds: Sequence[float] = ()) -> CondensedTrain:
    """The few freedoms of a train's meshes, at the loads that it has in the end.

    Parameters
    ----------
    shared
        Meshes that are in phase again after so many cycles at most share a phase.
    speeds
        Of the drive (rad/s), for loads that oscillate: periods of phases grow to those of torques that repeat after no
        more than `SHARED` cycles of the fastest mesh, or after a turn of the drive of no more than `LONGEST`.

    Raises
    ------
    InputError
        For meshes of more than `MOST_PHASES` phases, rigid meshes, loads that are neither constant nor sines, and parts
        that nothing holds.
    """
    _check(model)
    modal, rolled = model.modal, model.kinematics
    phases = mesh_phases(rolled.cycles, shared)
    carriers = sorted({abs(rolled.ratios[number]) for number in model.turned_carriers})
    if len(phases) + len(carriers) > MOST_PHASES:
        problem = f"need {len(phases)} phases of their own, more than {MOST_PHASES}: {rolled.note}"
        if carriers:
            problem = f"need {len(phases)} phases, and carriers in an elastic housing {len(carriers)} more: more than "
            problem += str(MOST_PHASES)
        raise InputError("train.meshes", None, problem, "look at it with gearfe vibration")
    phases = [*_with_torques(model, phases, speeds), *((1 / ratio, []) for ratio in carriers)]
    turns = [turns for turns, _ in phases]
    sense = drive_sense(model.train.driven.speed) or 1.0
    flanks = model.forces.flanks
    reads = [_directions(f) for f in flanks]
    fixed = len(model.torques) - len(model.orders)
    per_turn = [0.0] * fixed + [float(cycles) for cycles in model.orders]
    waves = zip(model.forces.torques, per_turn, strict=True)
    swinging = [(direction, wave, cycles) for (direction, torque), cycles in waves for wave in torque.sines]
    over_speed = model.forces.speed_torques
    acted = [*(direction for direction, *_ in swinging), *(over.direction for over in over_speed)]
    used = sorted({*(x for four in reads for x in four if x >= 0), *acted})
    freedoms = np.array([[used.index(x) if x >= 0 else -1 for x in four] for four in reads])
    frames = {float(sign * ratio): sense * sign * np.eye(len(phases))[number - len(carriers)]
              for number, ratio in enumerate(carriers) for sign in (1, -1)}  # fmt: skip
    columns, springs = _turned_springs(model, len(used), frames)
    directions = np.column_stack([model.directions[:, used], *columns])
    ends = ((d, float(replace(f, sines=())(model.torque_end))) for d, f in model.torques)
    torque = sum((d * value for d, value in ends), start=np.zeros(len(modal.T)))
    push = modal.constant + modal.T.T @ torque
    turning = model.turning
    linear = Linear(
        modal.eigenvalues, _damping(model), modal.T.T @ directions, push, modal.T.T @ turning.gyroscopic @ modal.T,
        modal.T.T @ turning.stiffening @ modal.T, modal.T.T @ (turning.thrown + turning.stiffening @ modal.origin),
        modal.T.T @ turning.circulating @ modal.T, modal.T.T @ turning.circulating @ modal.origin,
    )  # fmt: skip
    steady = model.kinematics.steady_forces
    ends = np.cumsum([0, *(len(line.flanks) for line in model.meshes)]).tolist()
    of_mesh = tuple(tuple(range(a, b)) for a, b in itertools.pairwise(ends))
    mesh_of = {number: mesh for mesh, numbers in enumerate(of_mesh) for number in numbers}
    rubbing = [_rubbing(model, flank, mesh_of[i], float(steady[mesh_of[i]])) for i, flank in enumerate(flanks)]
    orders = np.array([[int(c * t) * (i in at) for t, at in phases] for i, c in enumerate(rolled.cycles)])
    of_flank = np.array([np.where(orders[mesh_of[i]] > 0, [float(t) for t in turns], 0.0) for i in range(len(flanks))])
    whole = np.array([float(t) for t in turns])
    torques = [SwingingTorque(used.index(direction), *wave, whole, cycles) for direction, wave, cycles in swinging]
    speeding = [replace(over, direction=used.index(over.direction)) for over in over_speed]
    forces = MeshForces(flanks, freedoms, sense * of_flank, rubbing, torques, speeding)
    more = [*(torque.freedom for torque in torques), *(over.direction for over in speeding)]
    scale = _scale(model, linear, freedoms, flanks, more, springs)
    limit = DIVERGED * min(line.module for line in model.meshes) / float(scale[freedoms[:, 0]].max())
    many = tuple(tuple(row) for row in orders.tolist())
    turned = np.array([frames.get(float(ratio), np.zeros(len(phases))) for ratio in model.frame_ratios])
    start = np.zeros(linear.size)
    for numbers, force in zip(of_mesh, steady.tolist(), strict=True):
        if force < 0.0 and len(numbers) == 2:  # statics press the back flanks, which bear behind the backlash
            start[freedoms[list(numbers), 0]] += flanks[numbers[1]].gap * np.array([-1.0, 1.0])
    system = Oscillator(
        linear, forces, tuple(float(t) for t in turns), scale, many, limit, start, len(carriers), tuple(springs)
    )
    return CondensedTrain(model, system, forces, of_mesh, steady, directions, torque, turned)


def _turned_springs(
    model: TrainModel, count: int, frames: Mapping[float, Array]
) -> tuple[list[Array], list[TurnedSpring]]:
    """Springs and dampers between frames of carriers and an elastic housing, at freedoms of their own.

    Parameters
    ----------
    model : TrainModel
        The train.
    count : int
        Number of the first of these freedoms.
    frames : mapping of float to ndarray, shape (phases,)
        Rotation of a carrier for one of each phase, by its speed in parts of that of the drive.

    Returns
    -------
    columns : list of ndarray, shape (system size,)
        Unit directions of the freedoms.
    springs : list of TurnedSpring
    """
    columns, springs = list[Array](), list[TurnedSpring]()

    def freedom(direction: Array) -> tuple[int, float]:
        """Number of the freedom along a direction, and its length."""
        length = float(np.linalg.norm(direction))
        unit = direction / length
        for number, known in enumerate(columns):
            if np.abs(known - unit).max() <= PARALLEL:
                return count + number, length
        columns.append(unit)
        return count + len(columns) - 1, length

    for each in model.forces.turned:
        numbers = [each.still, each.still + 1, each.turning, each.turning + 1]
        along = model.directions[:, numbers].T
        if not along.any(axis=1).all():  # a bearing without stiffness or damping in this plane
            continue
        freedoms, lengths = zip(*map(freedom, along), strict=True)
        springs.append(TurnedSpring(np.array(freedoms), np.array(lengths), each.of_rates, *_frame(frames[each.ratio])))
    return columns, springs


def _frame(rotation: Array) -> tuple[int, float]:
    """Number of the phase that is a rotation, and its sign."""
    phase = int(np.flatnonzero(rotation)[0])
    return phase, float(rotation[phase])


def _rubbing(model: TrainModel, flank: Flank, mesh: int, force: float) -> Rubbing | None:
    """Friction of a flank of a mesh, whose coefficient may follow from the speed."""
    if flank.sliding is None:
        return None
    line = model.meshes[mesh]
    oil = line.given.friction
    coefficient = None
    if isinstance(oil, Lubrication):
        coefficient = partial(_of_drive, oil, line.pair, force, flank.ratio)
    return Rubbing(flank.sliding, fastest(model.train.driven.speed), coefficient)


def _of_drive(oil: Lubrication, pair: MeshGeometry, force: float, ratio: float, speed: float) -> float:
    """Coefficient of friction at a speed of the drive (rad/s)."""
    return oil.coefficient(pair, force, ratio * speed)


def _directions(flank: Flank) -> tuple[int, int, int, int]:
    """Numbers of a flank's approach and turn, and of those of its friction, or of its gears' tilt, or -1."""
    sliding = flank.sliding
    return flank.direction, flank.turn, *((flank.tilt, -1) if sliding is None else (sliding.across, sliding.spin))


def _check(model: TrainModel) -> None:
    if not model.meshes:
        raise InputError("train.meshes", None, "is empty: nothing excites the train", "add a mesh")
    for line in model.meshes:
        if line.rigid:
            problem = "is a constraint without a stiffness, which excites nothing"
            raise InputError(f"mesh {line.name!r} rigid", True, problem, "give it a stiffness, a curve or a law")
    for gear in model.train.gears:
        if any(gear.pitch_errors):
            problem = "has pitch errors: its motion repeats with the full period of the teeth, not with the meshes"
            raise InputError(f"gear {gear.name!r}", None, problem, "look at it with gearfe vibration")
    for load in model.train.loads:
        if not replace(load.torque, sines=()).ends:
            problem = "changes all the time: no motion repeats with the meshes"
            cure = "write what oscillates in sines, or look at it with gearfe vibration"
            raise InputError(f"load on {load.shaft!r}", None, problem, cure)
    if not model.train.driven.speed.ends:
        problem = "has no speed in the end: no motion repeats with the meshes"
        raise InputError(
            "train.drive", None, problem, "prescribe a constant speed, or look at it with gearfe vibration"
        )


def _with_torques(
    model: TrainModel, phases: list[tuple[Fraction, list[int]]], speeds: Sequence[float]
) -> list[tuple[Fraction, list[int]]]:
    """Phases whose periods hold whole cycles of the torques that oscillate, at as many of the speeds as can be."""
    cycles, fixed = model.kinematics.cycles, len(model.torques) - len(model.orders)
    omegas = {wave[1] for _, function in model.torques[:fixed] for wave in function.sines}
    in_turn = [float(order) for order in model.orders] + [omega / abs(speed) for omega in omegas for speed in speeds]
    for each in in_turn:
        for number, (turns, meshes) in enumerate(phases):
            part = Fraction(each * float(turns)).limit_denominator(LONGEST)
            longer = turns * part.denominator
            near = abs(each * float(turns) - float(part)) <= WHOLE * float(part)
            fastest_mesh = longer * max(cycles[i] for i in meshes)
            most = LONGEST if (1 / longer).denominator == 1 else SHARED
            if part > 0 and near and fastest_mesh <= most:
                phases = [*phases[:number], (longer, meshes), *phases[number + 1 :]]
                break
    return phases


def unmatched(train: CondensedTrain, speed: float) -> str:
    """Why no motion repeats at a speed (rad/s) under torques that oscillate, or nothing."""
    for torque in train.forces.torques:
        if torque.waves(speed) is None:
            hertz = torque.at_speed(speed) / (2.0 * math.pi)
            meshes = float(train.model.kinematics.cycles[0]) * abs(speed) / (2.0 * math.pi)
            said = f"a torque oscillates with {hertz:.9g} Hz, {hertz / meshes:.9g} times the frequency of mesh 1"
            return (
                f"{said}: the motion does not repeat within {SHARED} mesh cycles, nor within a turn of the drive of up "
                f"to {LONGEST}"
            )
    return ""


def _damping(model: TrainModel) -> Array:
    """Of the coordinates, without what the forces of flanks that damp in contact only take off."""
    made = model.modal.damping.copy()
    for line in model.meshes:
        if line.in_contact:
            along = model.modal.T.T @ line.row
            made -= line.rayleigh * np.outer(along, along)
    return made


def _scale(
    model: TrainModel,
    linear: Linear,
    freedoms: Array,
    flanks: Sequence[Flank],
    torques: Sequence[int],
    springs: Sequence[TurnedSpring],
) -> Array:
    """Approach of each mesh under its steady force; rotations that move a base circle so far."""
    rest = np.abs(linear.rest())
    size = max(float(rest[np.unique(freedoms[:, 0])].max()), 1e-9)
    scale = np.full(linear.size, size)
    if len(springs):  # as far as the energy of a touch moves them
        flexible = np.diag(linear.statics)
        own = np.unique(np.concatenate([spring.freedoms for spring in springs]))
        scale[own] = size * np.sqrt(flexible[own] / flexible[np.unique(freedoms[:, 0])].max())
    scale[list(torques)] = size / (0.5 * model.meshes[0].module * 2.0 * math.pi)
    for flank, (d, r, a, s) in zip(flanks, freedoms, strict=True):
        if flank.mean > 0.0:
            scale[d] = max(float(rest[d]), 0.1 * size)
        for turn in (r, s, a if flank.tilt >= 0 else -1):
            if turn >= 0:
                scale[turn] = size / (0.5 * model.meshes[0].module * 2.0 * math.pi)
    return scale
