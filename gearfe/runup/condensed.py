"""A train as an oscillator of few freedoms: approaches of its flanks, and the rotations that their phases follow."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..errors import InputError
from ..gear.pair import MeshGeometry
from ..train.forces import Flank
from ..train.friction import Lubrication
from ..train.kinematics import drive_sense, fastest, mesh_phases, steady_forces
from ..train.model import TrainModel
from ..train.simulate import DIVERGED
from ..typing import Array
from .balance import Oscillator
from .linear import Linear
from .mesh_forces import MeshForces, Rubbing

#: Meshes whose common period is of no more cycles share a phase: two phases then cost more than the longer period.
SHARED = 12
#: Most phases: harmonics and samples grow with their number.
MOST_PHASES = 3


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
    """

    model: TrainModel
    system: Oscillator
    forces: MeshForces
    flanks_of_mesh: tuple[tuple[int, ...], ...]
    steady: Array
    directions: Array
    torque: Array

    @cached_property
    def bores_of_modes(self) -> Array:
        """(bores, n) displacement along the shafts at each bore for unit modal coordinates."""
        return np.asarray(self.model.axial @ self.model.modal.T)

    @cached_property
    def radiation_of_modes(self) -> Array | None:
        """(n, n) surface matrix of the housing in modal coordinates; None where the housing has no surface."""
        housing = self.model.train.housing
        if housing is None or not housing.has_mesh:
            return None
        shapes = self.model.modal.T[: housing.size]
        return np.asarray(shapes.T @ housing.radiation @ shapes)


def condense(model: TrainModel, shared: int = SHARED) -> CondensedTrain:
    """The few freedoms of a train's meshes, at the loads that it has in the end.

    Parameters
    ----------
    shared
        Meshes that are in phase again after so many cycles at most share a phase.

    Raises
    ------
    InputError
        For meshes of more than `MOST_PHASES` phases, rigid meshes, loads that oscillate, and parts that nothing holds.
    """
    _check(model)
    modal, phases = model.modal, mesh_phases(model.rolling.cycles, shared)
    if len(phases) > MOST_PHASES:
        problem = f"need {len(phases)} phases of their own, more than {MOST_PHASES}: {model.rolling.note}"
        raise InputError("train.meshes", None, problem, "look at it with gearfe vibration")
    turns = [turns for turns, _ in phases]
    flanks = model.forces.flanks
    reads = [_directions(f) for f in flanks]
    used = sorted({x for four in reads for x in four if x >= 0})
    freedoms = np.array([[used.index(x) if x >= 0 else -1 for x in four] for four in reads])
    to_modes = modal.T.T @ model.directions
    torque = sum((d * float(f(model.torque_end)) for d, f in model.torques), start=np.zeros(len(modal.T)))
    push = modal.constant + modal.T.T @ torque
    gyros = model.forces.gyros
    tilts = [column for g in gyros for column in (g.direction, g.direction + 1)]
    linear = Linear(
        modal.eigenvalues, _damping(model), to_modes[:, used], push, to_modes[:, tilts],
        np.array([g.polar * g.ratio for g in gyros]),
    )  # fmt: skip
    sense = drive_sense(model.train.driven.speed) or 1.0
    steady = steady_forces(model.train)
    ends = np.cumsum([0, *map(len, model.sides)]).tolist()
    of_mesh = tuple(tuple(range(a, b)) for a, b in itertools.pairwise(ends))
    mesh_of = {number: mesh for mesh, numbers in enumerate(of_mesh) for number in numbers}
    rubbing = [_rubbing(model, flank, mesh_of[i], float(steady[mesh_of[i]])) for i, flank in enumerate(flanks)]
    orders = np.array([[int(c * t) * (i in at) for t, at in phases] for i, c in enumerate(model.rolling.cycles)])
    of_flank = np.array([np.where(orders[mesh_of[i]] > 0, [float(t) for t in turns], 0.0) for i in range(len(flanks))])
    forces = MeshForces(flanks, freedoms, sense * of_flank, rubbing)
    scale = _scale(model, linear, freedoms, flanks)
    limit = DIVERGED * min(line.module for line in model.meshes) / float(scale[freedoms[:, 0]].max())
    many = tuple(tuple(row) for row in orders.tolist())
    start = linear.rest.copy()
    for numbers, force in zip(of_mesh, steady.tolist(), strict=True):
        if force < 0.0 and len(numbers) == 2:  # statics press the back flanks, which bear behind the backlash
            start[freedoms[list(numbers), 0]] += flanks[numbers[1]].gap * np.array([-1.0, 1.0])
    system = Oscillator(linear, forces, tuple(float(t) for t in turns), scale, many, limit, start)
    return CondensedTrain(model, system, forces, of_mesh, steady, model.directions[:, used], torque)


def _rubbing(model: TrainModel, flank: Flank, mesh: int, force: float) -> Rubbing | None:
    """Friction of a flank of a mesh, whose coefficient may follow from the speed."""
    if flank.sliding is None:
        return None
    train, given = model.train, model.train.meshes[mesh].friction
    coefficient = None
    if isinstance(given, Lubrication):
        one, two = (train.gear(name).gear for name in (train.meshes[mesh].driver, train.meshes[mesh].driven))
        pair = MeshGeometry(one, two, train.meshes[mesh].centre_distance)
        coefficient = partial(_of_drive, given, pair, force, flank.ratio)
    return Rubbing(flank.sliding, fastest(train.driven.speed), coefficient)


def _of_drive(oil: Lubrication, pair: MeshGeometry, force: float, ratio: float, speed: float) -> float:
    """Coefficient of friction at a speed of the drive (rad/s)."""
    return oil.coefficient(pair, force, ratio * speed)


def _directions(flank: Flank) -> tuple[int, int, int, int]:
    """Numbers of a flank's approach and turn, and of those of its friction or -1."""
    sliding = flank.sliding
    return flank.direction, flank.turn, *((-1, -1) if sliding is None else (sliding.across, sliding.spin))


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
        if load.torque.sines:
            problem = "oscillates: no motion repeats with the meshes"
            raise InputError(f"load on {load.shaft!r}", None, problem, "look at it with gearfe vibration")


def _damping(model: TrainModel) -> Array:
    """Of the coordinates, without what the forces of flanks that damp in contact only take off."""
    made = model.modal.damping.copy()
    for line in model.meshes:
        if line.in_contact:
            along = model.modal.T.T @ line.row
            made -= line.rayleigh * np.outer(along, along)
    return made


def _scale(model: TrainModel, linear: Linear, freedoms: Array, flanks: Sequence[Flank]) -> Array:
    """Approach of each mesh under its steady force; rotations that move a base circle so far."""
    size = max(float(np.abs(linear.rest[np.unique(freedoms[:, 0])]).max()), 1e-9)
    scale = np.full(linear.size, size)
    for flank, (d, r, _, s) in zip(flanks, freedoms, strict=True):
        if flank.mean > 0.0:
            scale[d] = max(abs(float(linear.rest[d])), 0.1 * size)
        for turn in (r, s):
            if turn >= 0:
                scale[turn] = size / (0.5 * model.meshes[0].module * 2.0 * math.pi)
    return scale
