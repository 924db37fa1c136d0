r"""From a `GearTrain` to a system of the rigid core, with all hinges eliminated at set-up.

The rotation of shaft i is :math:`\varphi_i = g_i\psi(t) + u_i`: rolling with the drive, :math:`\psi = \int\Omega\,dt`,
and a small coordinate. So every constraint is linear and constant, the drive's too. :math:`u_d - a\cdot\theta_b = 0`
makes the rotation relative to the bore b equal to psi. Its multiplier is the torque that reacts on that bore. A drive
of changing speed adds :math:`-J_p g_i\ddot\psi` on every shaft.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.shown import Facts
from ...base.typing import Array, IntArray
from ...fem.reduction.modal_body import ModalBody
from ...multibody import (
    Element,
    LinearJoint,
    LocalForce,
    ModalBlocks,
    Start,
    System,
    TimeFunction,
    consistent_start,
    constant,
)
from ...multibody.core.elimination import ModalCoordinates, modal_coordinates
from ...multibody.series.timefunctions import sine
from .bearings import BearingLoads, bearing_loads, bore_motion, motion_parts, shaft_motion
from .checks import SAME, check_train, overlap
from .driveline import Driveline, MachineRotor, driveline, machine_rotors
from .elements import LinearForce, RigidShaft, ShaftBody, bearing, bore_rows, hinge, pin_rows, planes, rotor
from .forces import Gyro, SpeedTorque, TrainForces, Turned, derivative
from .gear_train import Carrier, Drive, Five, GearTrain, Load, Pin, Shaft, ShaftForce
from .kinematics import Kinematics, against, drive_sense, load_end
from .mesh_element import MeshLine, Shafts, mesh_lines
from .operating import (
    OperatingPoint,
    operating_point,
    rolling_bearings,
    with_operating_stiffness,
    with_pressed_bearings,
)
from .planetary import MeshFamily, mesh_families
from .program import train_series
from .shaft_sections import ShaftSections, shaft_sections

#: For periods of steady running, orders of loads are taken as whole multiples of one over a whole number up to this.
MOST_DENOMINATOR = 1000
#: Motions along the axis and by tilts, of those of `bore_rows`, that are held where only the others are free.
HELD_AFLOAT = [1, 3, 4]
#: Eigenvalues below this part of the largest one are those of free rotation, and round-off.
FREE = 1e-11
#: Part of the mean push of mesh forces along the axes and on tilts that, on free motions, is round-off.
UNHELD = 1e-6


class Turning(NamedTuple):
    """Forces on the coordinates of a system that grow with the speed of the drive, in small motions beside rolling.

    They are gyroscopic moments, Coriolis and centrifugal forces of the frames of carriers, and forces of dampers in
    fixed axes on what these frames move.
    """

    gyroscopic: Array  # (size, size) of rates, times the speed
    stiffening: Array  # (size, size) of coordinates, times its square
    thrown: Array  # (size,) constant ones, times its square
    circulating: Array  # (size, size) of coordinates, times the speed: skew


@dataclass(frozen=True, eq=False, repr=False)
class TrainModel(Facts):
    """A train ready to be simulated.

    Attributes
    ----------
    train
        What it was made from.
    system, modal, start
        System of the rigid core, its minimal coordinates, its start.
    angle
        psi(t), rotation of the drive (rad).
    shafts, housing
        Bodies.
    meshes
        The record of each mesh.
    torques
        Pairs (direction in the system, torque over time): loads, and the shafts' inertia under a changing drive. Last
        come the orders of loads.
    orders
        Cycles of each of these orders in a turn of the drive.
    forces, directions
        All that is not constant, and its directions, (system size, directions).
    first : (shafts,)
        Number of each shaft's first coordinate in the system.
    spin, spin_reference : (shafts, system size)
        Rotation of each shaft where it is measured, beside rolling, and relative to the bore that it is measured
        against.
    axial : (bores, system size)
        Displacement along the axis of each bore's reference point.
    bores
        Names of the bores that carry shafts, in the housing's order.
    driveline
        Machines, and the springs between them, shafts and shafts.
    drive_row : (system size,)
        Rotation that the drive prescribes or acts on, beside rolling.
    operating
        Rolling bearings under the steady torques, whose stiffness there the system has.
    """

    train: GearTrain
    system: System
    modal: ModalCoordinates
    start: Start
    angle: TimeFunction
    shafts: tuple[ShaftBody, ...]
    housing: ModalBlocks | None
    meshes: tuple[MeshLine, ...]
    torques: tuple[tuple[Array, TimeFunction], ...]
    orders: tuple[Fraction, ...]
    forces: TrainForces
    directions: Array
    first: IntArray
    spin: Array
    spin_reference: Array
    axial: Array
    bores: tuple[str, ...]
    driveline: Driveline
    drive_row: Array
    operating: OperatingPoint = field(default_factory=OperatingPoint)

    def facts(self) -> dict[str, str]:
        """Shafts, meshes, housing, unknowns."""
        frequencies = self.coupled_frequencies_hz
        return {
            "shafts": ", ".join(shaft.name for shaft in self.train.shafts),
            "meshes": ", ".join(line.name for line in self.meshes) or "none",
            "housing": "elastic" if self.housing is not None else "rigid",
            "unknowns": str(len(frequencies)),
            "lowest frequencies": ", ".join(f"{f:.4g}" for f in frequencies[:6]) + " Hz",
        }

    @property
    def kinematics(self) -> Kinematics:
        """Those of the train."""
        return self.train.kinematics

    @property
    def ratios(self) -> Array:
        """Speed of each shaft for unit speed of the drive."""
        return np.array([float(r) for r in self.kinematics.ratios])

    @property
    def steady_speed(self) -> float:
        """Speed of the drive once its function of time has ended (rad/s)."""
        breaks = self.train.driven.speed.breaks
        return float(self.train.driven.speed(max(breaks, default=0.0)))

    @property
    def torque_end(self) -> float:
        """Time at which all torques have reached what they stay at (s)."""
        return max((b for _, torque in self.torques for b in torque.breaks), default=0.0)

    @property
    def outer_push(self) -> Array:
        """Forces and moments on the shafts from outside of the train, other than torques, at their end, (size,)."""
        push = np.zeros(self.system.size)
        for force in self.train.forces:
            push += _force_direction(self.train, force, self.placed) * float(force.over(self.torque_end))
        return push

    @property
    def load_end(self) -> float:
        """Time at which all ramps of loads, of forces on shafts and of the drive have ended (s)."""
        drive = self.train.driven
        over_time = [drive.speed, *(force.over for force in self.train.forces)]
        over_time += [] if drive.torque is None else [drive.torque]
        return max([load_end(self.train.layout), *(end for function in over_time for end in function.breaks)])

    @property
    def coupled_frequencies_hz(self) -> Array:
        """Natural frequencies with mean mesh stiffness (Hz)."""
        return np.sqrt(np.maximum(self.modal.eigenvalues, 0.0)) / (2.0 * math.pi)

    @property
    def mesh_notes(self) -> list[str]:
        """How gears of meshes were taken, one sentence each: data that fit except for rounding, widths in part."""
        notes = [f"mesh {line.name}: {note}" for line in self.meshes for note in line.pair.notes]
        for line in self.meshes:
            one, two = self.train.gear(line.given.driver), self.train.gear(line.given.driven)
            common, smaller = overlap(one, two), min(one.gear.face_width, two.gear.face_width)
            given = isinstance(line.given.stiffness, float | int | None) or line.given.transmission_error is not None
            if common < smaller * (1.0 - SAME) and not given:
                notes.append(
                    f"mesh {line.name}: the gears share {1e3 * common:.4g} of {1e3 * smaller:.4g} mm of face width: "
                    "a computed mesh model is that of all of it; gearfe stiffness takes the common width"
                )
        return notes

    @property
    def back_flanks(self) -> Array:
        """What the stiffness at rest (size, size) has more because statics press back flanks of meshes (N/m).

        These have their own line of action, and the constant part of the system that of the driving flanks.
        """
        change = np.zeros_like(self.system.stiffness)
        for line, force in zip(self.meshes, self.kinematics.steady_forces.tolist(), strict=True):
            if force < 0.0 and line.backlash is not None:
                back = line.columns[1]
                change += line.mean * (np.outer(back, back) - np.outer(line.row, line.row))
        return change

    @property
    def preload(self) -> Array:
        """Generalised forces (size,) of the mean moments of meshes along their face widths, on the driving flanks."""
        steady = self.kinematics.steady_forces.tolist()
        moments = [line.preload for line, force in zip(self.meshes, steady, strict=True) if force > 0.0]
        return np.asarray(sum(moments, np.zeros(self.system.size)))

    @property
    def placed(self) -> Shafts:
        """The shafts in the coordinates of the system."""
        return Shafts(self.shafts, self.first, tuple(self.ratios), self.system.size)

    @cached_property
    def bearings(self) -> BearingLoads:
        """Loads on the bores that carry shafts."""
        shared = len(self.start.freedoms.redundant) > 0
        turns = self.frame_ratios.tolist()
        return bearing_loads(self.train, self.system, self.placed, self.bores, shared=shared, turns=turns)

    @cached_property
    def frame_ratios(self) -> Array:
        """Speed of the frame in which each shaft's motion is described, for unit speed of the drive; 0 without one."""
        frames = (self.train.frame_of(shaft.name) for shaft in self.train.shafts)
        return np.array([0.0 if f is None else self.ratios[self.train.shaft_number(f.shaft)] for f in frames])

    def frame_turns(self, t: Array, shafts: Sequence[int]) -> Array:
        """Rotations (n, shafts, 3, 3) from the frames of shafts to fixed axes, at times (n,)."""
        return self._about_axis(self.angle(t)[:, None] * self.frame_ratios[list(shafts)])

    def _about_axis(self, turned: Array) -> Array:
        """Rotations (..., 3, 3) about the axis by angles (rad)."""
        e1, e2, axis = self.train.frame
        across = np.outer(e1, e1) + np.outer(e2, e2)
        right = np.outer(e2, e1) - np.outer(e1, e2)
        return np.asarray(
            np.cos(turned)[..., None, None] * across + np.sin(turned)[..., None, None] * right + np.outer(axis, axis)
        )

    @cached_property
    def displaced(self) -> Array:
        """Displacements of shafts, of planets against the turned carrier, for unit coordinates, (size, 3 shafts)."""
        size = self.system.size
        moved = np.eye(size)[:, [first + i for first in self.first for i in range(3)]].reshape(size, -1, 3)
        for number, body in enumerate(self.shafts):
            angle, radius, follows = _carried(self.train, self.placed, number)
            if radius:
                plane = planes(body, self.train.frame)[0]
                round_ = math.cos(angle) * plane.second[:3] - math.sin(angle) * plane.first[:3]
                moved[:, number] -= np.outer(follows, round_)
        return np.asarray(moved.reshape(size, -1))

    def fixed_axes(self, t: Array, vectors: Array) -> Array:
        """Vectors (n, bores, k, 3) at the bores, in the frames of their shafts, along fixed axes."""
        if not self.train.carriers:
            return vectors
        return self.on_bores(self.angle(t)[:, None] * self.frame_ratios, vectors)

    def on_bores(self, turned: Array, vectors: Array) -> Array:
        """The same for rotations (n, shafts) of the frames of the shafts (rad)."""
        held = {bore: number for number, shaft in enumerate(self.train.shafts) for bore in shaft.bores}
        turns = self._about_axis(turned[:, [held[bore] for bore in self.bores]])
        return np.asarray(np.einsum("nbij,nbkj->nbki", turns, vectors))

    @property
    def turned_carriers(self) -> list[int]:
        """Numbers of the shafts of carriers that turn in an elastic housing: those of bearings with turned springs."""
        ratios = {spring.ratio for spring in self.forces.turned}
        shafts = [self.train.shaft_number(carrier.shaft) for carrier in self.train.carriers]
        return [number for number in shafts if self.ratios[number] in ratios]

    @property
    def families(self) -> tuple[MeshFamily, ...]:
        """Meshes of planetary stages by what they are, their phases in the sense in which their drivers turn."""
        rolled, layout = self.kinematics, self.train.layout
        sense = drive_sense(layout.speed) or 1.0
        turned = [
            phase * push * sense * math.copysign(1.0, against(mesh, mesh.driver.shaft, rolled.ratios))
            for mesh, phase, push in zip(layout.meshes, rolled.phases, rolled.senses, strict=True)
        ]
        return mesh_families(layout, turned)

    @cached_property
    def turning(self) -> Turning:
        """What turns, for unit speed of the drive."""
        return self._turning(self.forces.gyros)

    @cached_property
    def spinning(self) -> Turning:
        """The same of a train whose carriers stay where they are at the start, while its shafts turn."""
        resting = [replace(gyro, stiffening=0.0, circulating=0.0) for gyro in self.forces.gyros if not gyro.euler]
        return self._turning(resting)

    def _turning(self, gyros: Sequence[Gyro]) -> Turning:
        size = self.system.size
        gyroscopic, stiffening, circulating = np.zeros((3, size, size))
        thrown = np.zeros(size)
        for gyro in gyros:
            first, second = self.directions[:, gyro.direction : gyro.direction + 2].T
            across = np.outer(second, first) - np.outer(first, second)
            gyroscopic += gyro.polar * gyro.ratio * across
            circulating -= gyro.circulating * across
            stiffening += gyro.stiffening * (np.outer(first, first) + np.outer(second, second))
            thrown += gyro.stiffening * gyro.offset * first
        return Turning(gyroscopic, stiffening, thrown, circulating)

    @cached_property
    def sections(self) -> ShaftSections | None:
        """Cross-sections of the elastic shafts; None without any."""
        return shaft_sections(self.train, self.placed)

    @cached_property
    def bore_motion(self) -> Array:
        """Displacement and rotation of each bore along x, y, z for unit coordinates, (6 bores, system size)."""
        return bore_motion(self.train.housing, self.bores, self.system.size)

    @cached_property
    def multipliers_of_forces(self) -> Array:
        """Force left over on the coordinates to the least multipliers that hold it, (system size, rows)."""
        return np.asarray(np.linalg.pinv(self.system.jacobian(0.0, np.zeros(self.system.size))))


def build_train(train: GearTrain) -> TrainModel:
    """Check a gear train and set up its system.

    Raises
    ------
    InputError
        If the parts of the train do not fit together; the message names the first mistake and the cure.
    """
    check_train(train)
    point = _operating_point(train)
    model = replace(_assembled(with_operating_stiffness(train, point)), operating=point)
    _check_held(model)
    return model


def _check_held(model: TrainModel) -> None:
    """Raise `InputError` for a shaft that mesh forces in steady running move along its axis or tilt, held by nothing.

    Such a motion closes no flank and yields to no spring: what the forces do along the axes and by tilts, loads take
    back by turning. Rolling itself has neither part, so that trains that a torque drives are looked at alike.
    """
    modal, axis = model.modal, model.train.frame[2]
    push = np.zeros(model.system.size)
    for line, force in zip(model.meshes, model.kinematics.steady_forces.tolist(), strict=True):
        pressed = line.columns[1] if force < 0.0 and line.backlash is not None else math.copysign(1.0, force) * line.row
        for first in model.first.tolist():
            push[first : first + 3] += abs(force) * (pressed[first : first + 3] @ axis) * axis
            push[first + 3 : first + 5] += abs(force) * pressed[first + 3 : first + 5]
    for first in model.first.tolist():
        outer = model.outer_push[first : first + 5]
        push[first : first + 3] += (outer[:3] @ axis) * axis
        push[first + 3 : first + 5] += outer[3:]
    along_modes = modal.T.T @ push
    free = modal.eigenvalues <= FREE * float(modal.eigenvalues.max(initial=0.0))
    _check_afloat(model, modal.T[:, free])
    unheld = np.where(free, along_modes, 0.0)
    lost = FREE * float(np.abs(modal.T).max(initial=0.0) * np.abs(push).max(initial=0.0))  # what hinges take leaves it
    if not float(np.linalg.norm(unheld)) > max(UNHELD * float(np.linalg.norm(along_modes)), lost):
        return
    moved = modal.T @ unheld
    slides = np.array([abs(float(moved[first : first + 3] @ axis)) for first in model.first.tolist()])
    tilts = np.array([float(np.linalg.norm(moved[first + 3 : first + 5])) for first in model.first.tolist()])
    tilts *= [0.5 * shaft.length for shaft in model.train.shafts]
    sliding = slides.max() >= tilts.max()
    shaft = model.train.shafts[int(np.argmax(slides if sliding else tilts))]
    problem = "is held by nothing along its axis, and the axial force of its helical gears moves it without end"
    cure = "give one of its bearings a stiffness along the axis, or leave it out for a rigid bearing"
    if not sliding:
        problem = "is held by nothing against tilting, and the forces of its gears tilt it without end"
        cure = "give it a second bearing, or one of its bearings a stiffness against tilting"
    raise InputError(f"shaft {shaft.name!r} bearings", list(shaft.bores), problem, cure)


def _check_afloat(model: TrainModel, free: Array) -> None:
    """Raise `InputError` for a shaft without bearings that its gears let move across its axis without a force."""
    scale = float(np.abs(model.modal.T).max(initial=0.0))
    for shaft, first in zip(model.train.shafts, model.first.tolist(), strict=True):
        if model.train.floats(shaft.name) and np.abs(free[first : first + 3]).max(initial=0.0) > UNHELD * scale:
            problem = "has no bearings, and its gears let it move across its axis"
            cure = f'add [bearings.NAME] with shaft = "{shaft.name}", or mesh it with three planets or more'
            raise InputError(f"shaft {shaft.name!r} bearings", None, problem, cure)


def _operating_point(train: GearTrain) -> OperatingPoint:
    """Where the rolling bearings are under the steady torques; of a train without any nothing is computed."""
    bearings = rolling_bearings(train)
    if not bearings:
        return OperatingPoint()
    at_speed = replace(
        train,
        drive=replace(train.driven, torque=None, slope=0.0, over_speed=None),
        shafts=tuple(replace(shaft, initial_speed=None) for shaft in train.shafts),
        machines=tuple(replace(machine, initial_speed=None) for machine in train.machines),
    )
    model = _assembled(with_pressed_bearings(at_speed))
    placed = model.placed
    motions = {name: shaft_motion(model.train, placed, name) for name in bearings}
    stiffness = model.system.stiffness.copy()
    for item in model.train.bearings:
        if item.bore in motions:
            stiffness -= motions[item.bore].T @ item.stiffness_matrix @ motions[item.bore]
    speed, turning = model.steady_speed, model.turning
    stiffness += model.back_flanks - speed**2 * turning.stiffening
    end = model.load_end
    force = model.preload + speed**2 * turning.thrown
    for load in train.loads:
        force += _acts(train, load, placed) * float(replace(load.torque, sines=())(end))
    force += model.outer_push
    return operating_point(bearings, motions, stiffness, model.modal.T, force)


def on_body(model: TrainModel, body: ModalBody) -> TrainModel:
    """The same train on another body with as many coordinates, such as a softened one: its meshes stay as they are."""
    return replace(_assembled(replace(model.train, housing=body), model.meshes), operating=model.operating)


def _assembled(train: GearTrain, lines: tuple[MeshLine, ...] = ()) -> TrainModel:
    """The model of a train that is checked; `lines` are its meshes where they are known."""
    angle = train.driven.speed.integral(0.0, 0.0)
    housing = _housing(train)
    ratios = [float(r) for r in train.kinematics.ratios]
    begin = float(train.driven.speed(0.0))
    shafts = tuple(
        _shaft(train, shaft, 0.0 if shaft.initial_speed is None else shaft.initial_speed - g * begin)
        for shaft, g in zip(train.shafts, ratios, strict=True)
    )
    rotors = machine_rotors(train, begin)
    bodies: list[Element] = [*shafts, *rotors] if housing is None else [housing, *shafts, *rotors]
    size = sum(b.size for b in bodies)
    first = np.cumsum([0 if housing is None else housing.size, *(body.size for body in shafts)])[:-1]
    placed = Shafts(shafts, first, tuple(ratios), size)
    lines = lines or mesh_lines(train, placed)
    orders = _orders(train, placed)
    torques = _torques(train, placed, angle) + tuple(order[:2] for order in orders)
    forces, directions = _forces(train, lines, (torques, _speed_torques(train, placed)), angle, placed)
    series = train_series(forces)
    changing = LocalForce(
        tuple(bodies), directions, forces.at_one_time, series, forces.breaks, forces.pieces if forces.jumps else None,
        name="forces of the train",
    )  # fmt: skip
    spin = np.array([_turning(train, placed, shaft.name) for shaft in train.shafts])
    springs = driveline(train, placed)
    elements = [
        *bodies, *_supports(train, placed, housing, rotors), *_stages(train, placed, housing),
        *(line.element(bodies) for line in lines),
        *springs.elements(train, placed, rotors, train.damping), *_slopes(train, placed, bodies), changing,
    ]  # fmt: skip
    system, modal = _damped(train, elements, bodies)
    return TrainModel(
        train=train,
        system=system,
        modal=modal,
        start=_start(train, system, shafts, rotors, first),
        angle=angle,
        shafts=shafts,
        housing=housing,
        meshes=lines,
        torques=torques,
        orders=tuple(cycles for *_, cycles in orders),
        forces=forces,
        directions=directions,
        first=first,
        spin=spin,
        spin_reference=_spin_reference(train, spin),
        driveline=springs,
        drive_row=_acts(train, train.driven, placed),
        axial=_axial(train, size),
        bores=_used_bores(train),
    )


def _shaft(train: GearTrain, shaft: Shaft, start_rate: float) -> ShaftBody:
    """A shaft as a body: elastic if it has sections."""
    if not shaft.sections:
        return RigidShaft(rotor(train, shaft), start_rate, name=f"shaft {shaft.name}")
    from .elastic_shaft import elastic_shaft  # beams load for elastic shafts only

    return elastic_shaft(train, shaft, start_rate)


def _torques(train: GearTrain, shafts: Shafts, angle: TimeFunction) -> tuple[tuple[Array, TimeFunction], ...]:
    """Directions in the system with torques over time: loads, and the shafts' inertia when the drive changes speed."""
    made, first, size = [], shafts.first, shafts.size
    change = derivative(derivative(angle))
    for i, (shaft, ratio) in enumerate(zip(shafts.bodies, shafts.ratios, strict=True)):
        if change.sines or any(any(row) for row in change.coefficients):
            direction = np.zeros(size)
            direction[first[i] + 5] = 1.0
            made.append((direction, -ratio * shaft.rotor.polar * change))
    if made:
        made += [
            (direction, -shafts.ratios[train.shaft_number(machine.shaft)] * machine.inertia * change)
            for direction, machine in zip(_machines(train, size), train.machines, strict=True)
        ]
    if train.driven.torque is not None:
        made.append((_acts(train, train.driven, shafts), train.driven.torque))
    made += [(_acts(train, load, shafts), load.torque) for load in train.loads]
    made += [(_force_direction(train, force, shafts), force.over) for force in train.forces]
    for carrier in train.carriers:
        for pin in carrier.pins:
            if any(pin.error) and pin.stiffness is not None:  # springs whose rest is where the pin is
                rows, local = _pin_rows(train, shafts, carrier, pin), _pin_springs(pin)
                made.append(((local @ _pin_error(pin)) @ rows, constant(1.0)))
    return tuple(made)


def _force_direction(train: GearTrain, force: ShaftForce, shafts: Shafts) -> Array:
    """Direction in the system of a force and a moment on a section of a shaft."""
    number = train.shaft_number(force.shaft)
    rows = shafts.bodies[number].section_rows(np.array([force.along]), train.frame)[0]
    return shafts.whole(number, np.array(force.values) @ rows)


def _machines(train: GearTrain, size: int) -> Array:
    """Directions of the machines, whose coordinates are the last ones, (machines, size)."""
    return np.eye(size)[size - len(train.machines) :]


def _acts(train: GearTrain, end: Drive | Load, shafts: Shafts) -> Array:
    """Direction in the system of a torque, or of a prescribed rotation, and its reaction."""
    if end.machine:
        direction = _machines(train, shafts.size)[train.machine_number(end.machine)].copy()
    else:
        direction = _turning(train, shafts, end.shaft, train.place(end))
    if train.housing is not None and end.bore is not None:
        direction[: train.housing.size] -= bore_selector(train, end.bore)[:, 3:] @ train.frame[2]
    return direction


def _slopes(train: GearTrain, shafts: Shafts, bodies: list[Element]) -> list[Element]:
    """Dampers: torques that fall with the speed."""
    made: list[Element] = []
    ends: list[Drive | Load] = [train.driven, *train.loads]
    for number, end in enumerate(ends):
        slope = end.slope + (0.0 if end.over_speed is None else end.over_speed.slope)
        if slope != 0.0:
            row = _acts(train, end, shafts)
            square = np.outer(row, row)
            name = f"slope of load {number}" if number else "slope of the drive"
            made.append(LinearForce(tuple(bodies), slope * square, 0.0 * square, name))
    return made


def _speed_torques(train: GearTrain, shafts: Shafts) -> list[tuple[Array, SpeedTorque]]:
    """Directions in the system of torques over speed, and these, whose own directions are not numbered yet."""
    ends: list[Drive | Load] = [train.driven, *train.loads]
    found = []
    for end in ends:
        if end.over_speed is not None:
            ratio = shafts.ratios[train.shaft_number(end.shaft)]
            over = SpeedTorque(-1, ratio, end.over_speed.change, end.over_speed.slope)
            found.append((_acts(train, end, shafts), over))
    return found


def _orders(train: GearTrain, shafts: Shafts) -> list[tuple[Array, TimeFunction, Fraction]]:
    """Directions of the orders of loads, their torques over time, and cycles in a turn of the drive."""
    found, rolled = [], train.kinematics
    speed = abs(float(train.driven.speed(0.0)))
    for load in train.loads:
        direction = _acts(train, load, shafts)
        for order, amplitude, phase in load.orders:
            if load.mesh:
                number = next(i for i, mesh in enumerate(train.meshes) if mesh.name == load.mesh)
                per_turn, start = rolled.cycles[number], phase + order * _start_angle(train, number)
            else:
                per_turn, start = abs(rolled.ratios[train.shaft_number(load.shaft)]), phase
            cycles = Fraction(order).limit_denominator(MOST_DENOMINATOR) * per_turn
            found.append((direction, sine(amplitude, order * float(per_turn) * speed, start), cycles))
    return found


def _start_angle(train: GearTrain, number: int) -> float:
    """Rotation of a mesh's driver past a tooth on the line of centres at the start, 2 pi a pitch (rad)."""
    mesh, rolled = train.layout.meshes[number], train.kinematics
    turning = math.copysign(1.0, float(rolled.drivers[number])) * (drive_sense(train.layout.speed) or 1.0)
    forwards = turning * rolled.senses[number]  # phases are in the sense in which a gear pushes
    if mesh.ring_drives:
        return -forwards * abs(mesh.driven.teeth) * mesh.mate_phase(rolled.phases[number], of_ring=False)
    return forwards * mesh.driver.teeth * rolled.phases[number]


def _forces(
    train: GearTrain, lines: tuple[MeshLine, ...],
    acting: tuple[tuple[tuple[Array, TimeFunction], ...], list[tuple[Array, SpeedTorque]]],
    angle: TimeFunction, shafts: Shafts,
) -> tuple[TrainForces, Array]:  # fmt: skip
    """All that is not constant: of each shaft tilts and spin, of each mesh up to six directions, one a torque.

    `acting` are the torques over time and those over speed, with their directions in the system.
    """
    torques, over_speed = acting
    columns: list[Array] = []
    gyros: list[Gyro] = []
    frames = [train.frame_of(shaft.name) for shaft in train.shafts]
    turns = [0.0 if frame is None else shafts.ratios[train.shaft_number(frame.shaft)] for frame in frames]
    for number, (couples, spin) in enumerate(zip(shafts.gyrations, shafts.spins, strict=True)):
        for couple in couples:
            turn = turns[number] * shafts.ratios[number]
            gyros.append(Gyro(len(columns), spin, shafts.ratios[number], couple.polar, stiffening=-turn * couple.polar))
            columns += [shafts.whole(number, couple.tilt), shafts.whole(number, couple.other)]
        columns.append(np.eye(shafts.size)[shafts.first[number] + 5])
    columns += [column for line in lines for column in line.columns]  # numbered as in `mesh_lines`
    if not train.damping.gyroscopic:
        gyros = []
    if any(turns):
        still = len(columns)
        columns.append(np.zeros(shafts.size))  # the frame of a carrier turns by nothing beside the mean motion
        for number, turn in enumerate(turns):
            if turn and not (train.hinged(train.shafts[number].name) and shafts.bodies[number].size == 6):
                gyros += _of_frame(train, shafts, number, turn, columns, still)
                gyros += _dragged(train, shafts, number, turn, columns, still)
    flanks = tuple(flank for line in lines for flank in line.flanks)
    at = len(columns)
    columns += [direction for direction, _ in torques]
    numbered = tuple((at + i, function) for i, (_, function) in enumerate(torques))
    at = len(columns)
    columns += [direction for direction, _ in over_speed]
    speeds = tuple(replace(over, direction=at + i) for i, (_, over) in enumerate(over_speed))
    turned = [spring for n, turn in enumerate(turns) if turn for spring in _turned(train, shafts, n, turn, columns)]
    made = TrainForces(len(columns), angle, tuple(gyros), flanks, numbered, speeds, tuple(turned))
    return made, np.array(columns).T


def _turned(train: GearTrain, shafts: Shafts, number: int, turn: float, columns: list[Array]) -> list[Turned]:
    """Bearings of a shaft in a frame that turns `turn` times as fast as the drive, in an elastic housing."""
    if train.housing is None:
        return []
    found = list[Turned]()
    bearings = {bearing.bore: bearing for bearing in train.bearings}
    for bore in train.shafts[number].bores:
        of_shaft, of_bore = motion_parts(train, shafts, number, bore)
        stiffness = bearings[bore].stiffness_matrix
        damping = bearings[bore].damping_matrix + train.damping.beta * stiffness
        for of_rates, matrix in enumerate((stiffness, damping)):
            pushes = matrix @ of_shaft
            for plane in ([0, 2], [3, 4]) if matrix.any() else ():  # across the axis, and tilts
                found.append(Turned(len(columns), len(columns) + 2, turn, bool(of_rates)))
                columns += [*of_bore[plane], *pushes[plane]]
    return found


def _of_frame(
    train: GearTrain, shafts: Shafts, number: int, turn: float, columns: list[Array], still: int
) -> list[Gyro]:
    """Coriolis, centrifugal and Euler forces of a shaft whose motion is described in a frame that turns.

    The frame turns `turn` times as fast as the drive; directions are appended to the columns, of which `still` is of no
    motion. Those of a planet are radial and tangential, for its mean place is off the axis. Its centrifugal force acts
    along the arm of the carrier, which turns with it: with the rotation of the carrier alone it does no work.
    """
    gyros = list[Gyro]()
    frame = train.frame
    angle, radius, follows = _carried(train, shafts, number)
    turned = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    for index, plane in enumerate(planes(shafts.bodies[number], frame)):
        first, second = (shafts.whole(number, row) for row in turned @ np.array([plane.first, plane.second]))
        offset, moves = (0.0, 0.0 * follows) if index else (radius, follows)
        coriolis = Gyro(len(columns), still, turn, -2.0 * plane.inertia, euler=True, offset=offset)
        columns += [first, second]
        centrifugal = replace(
            coriolis, direction=len(columns), polar=0.0, euler=False, stiffening=plane.inertia * turn**2
        )
        columns += [first, second - moves]
        gyros += [coriolis, centrifugal]
    return gyros


def _dragged(
    train: GearTrain, shafts: Shafts, number: int, turn: float, columns: list[Array], still: int
) -> list[Gyro]:
    """Dampers in fixed axes on a shaft whose motion is described in a frame that turns: bearings, and the shaft's.

    Parameters and result are those of `_of_frame`. The damping matrix C of a bearing is alike in all directions, so its
    root S is, too: motion S x has the damping constant 1 along each direction.
    """
    body = shafts.bodies[number]
    own = body.blocks()
    inner = train.damping.alpha * body.mass() + (0.0 if own is None else own[0])
    dampers = [
        (float(p.first @ inner @ p.first), shafts.whole(number, p.first), shafts.whole(number, p.second))
        for p in planes(body, train.frame)
    ]
    for item in train.bearings:
        if item.bore in train.shafts[number].bores:
            damping = item.damping_matrix + train.damping.beta * item.stiffness_matrix
            moved = _root(damping) @ motion_parts(train, shafts, number, item.bore)[0]
            dampers += [(1.0, moved[0], moved[2]), (1.0, moved[3], moved[4])]
    gyros = list[Gyro]()
    for loss, first, second in dampers:
        if loss > 0.0 and (first.any() or second.any()):
            gyros.append(Gyro(len(columns), still, turn, 0.0, circulating=loss * turn))
            columns += [first, second]
    return gyros


def _root(matrix: Array) -> Array:
    """Symmetric root of a symmetric matrix that is positive semi-definite."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def _carried(train: GearTrain, shafts: Shafts, number: int) -> tuple[float, float, Array]:
    """Angle (rad) and radius (m) of the place of a planet, and its way round with the carrier (system size,).

    All zero for a shaft that no carrier has.
    """
    name = train.shafts[number].name
    own = train.carrier_of(name)
    if own is None:
        return 0.0, 0.0, np.zeros(shafts.size)
    pin = next(pin for pin in own.pins if pin.shaft == name)
    radius, carrier = float(np.hypot(*train.pin_arm(own, pin))), train.shaft_number(own.shaft)
    turning = shafts.bodies[carrier].turn_rows(train.shaft_end(name, 0.0))[2]
    return train.pin_angle(own, pin), radius, radius * shafts.whole(carrier, turning)


def bore_selector(train: GearTrain, bore: str) -> Array:
    """Columns that pick a bore's six coordinates from the housing's, shape (N, 6)."""
    assert train.housing is not None
    return np.eye(train.housing.size)[:, train.housing.attachment(bore)]


def _housing(train: GearTrain) -> ModalBlocks | None:
    body = train.housing
    if body is None:
        return None
    damping = body.damping + train.damping.alpha * body.mass + train.damping.beta * body.stiffness
    return ModalBlocks(body.mass, damping, body.stiffness, name="housing")


def _supports(
    train: GearTrain, shafts: Shafts, housing: ModalBlocks | None, rotors: tuple[MachineRotor, ...]
) -> list[Element]:
    """Hinges or bearings of all bores, and the drive."""
    made: list[Element] = []
    bearings = {b.bore: b for b in train.bearings}
    for shaft, body in zip(train.shafts, shafts.bodies, strict=True):
        for bore in shaft.bores:
            chosen = None if housing is None else bore_selector(train, bore)
            rows = bore_rows(body, train.bore_points[bore], train.frame, chosen)
            if bore in bearings:
                stiffness = bearings[bore].stiffness_matrix
                damping = bearings[bore].damping_matrix + train.damping.beta * stiffness
                made.append(bearing(body, housing, rows, stiffness, damping, f"bearing {bore}"))
            else:
                made.append(hinge(body, housing, rows, f"hinge {bore}"))
        if train.floats(shaft.name):
            rows = bore_rows(body, np.array(shaft.point), train.frame, None)[HELD_AFLOAT]
            made.append(LinearJoint((body,), rows, np.zeros(len(rows)), name=f"hold of {shaft.name} along its axis"))
        if train.damping.alpha > 0.0:
            made.append(
                LinearForce((body,), train.damping.alpha * body.mass(), 0.0 * body.mass(), f"damping of {body.name}")
            )
        drive = train.driven
        if shaft.name == drive.shaft and drive.torque is None:
            turns: Element = body
            row = body.turn_rows(train.place(drive))[2:]
            if drive.machine:
                turns, row = rotors[train.machine_number(drive.machine)], np.ones((1, 1))
            touches: tuple[Element, ...] = (turns,)
            if housing is not None and drive.bore is not None:
                row = np.hstack([row, -(bore_selector(train, drive.bore)[:, 3:] @ train.frame[2])[None, :]])
                touches = (turns, housing)
            made.append(_drive(drive, touches, row))
    return made


def _stages(train: GearTrain, shafts: Shafts, housing: ModalBlocks | None) -> list[Element]:
    """Pins of planets, and what fixes or guides shafts."""
    made: list[Element] = []
    for carrier in train.carriers:
        middle = shafts.bodies[train.shaft_number(carrier.shaft)]
        for pin in carrier.pins:
            planet = shafts.bodies[train.shaft_number(pin.shaft)]
            whole, touches = _pin_rows(train, shafts, carrier, pin), (planet, middle)
            places = [(shafts.first[train.shaft_number(name)], body.size) for name, body in
                      ((pin.shaft, planet), (carrier.shaft, middle))]  # fmt: skip
            rows = np.hstack([whole[:, at : at + size] for at, size in places])
            name, held = f"pin {pin.shaft}", _held_by_pin(pin)
            if held:
                made.append(LinearJoint(touches, rows[held], _pin_error(pin)[held], name=name))
            if pin.stiffness is not None:
                stiffness = _pin_springs(pin)
                damping = _pin_matrix(pin.damping) + train.damping.beta * stiffness
                made.append(LinearForce(touches, rows.T @ damping @ rows, rows.T @ stiffness @ rows, name))
    for guide in train.guides:
        number = train.shaft_number(guide.shaft)
        body = shafts.bodies[number]
        row = body.turn_rows(train.shaft_end(guide.shaft, 0.0))[2:]
        touched: tuple[Element, ...] = (body,)
        if housing is not None and train.shafts[number].bores:  # which its torque reacts on
            selector = bore_selector(train, train.shafts[number].bores[0])
            row, touched = np.hstack([row, -(selector[:, 3:] @ train.frame[2])[None, :]]), (body, housing)
        name = f"hold of {guide.shaft}"
        if guide.stiffness is None:
            made.append(LinearJoint(touched, row, np.zeros(1), name=name))
            continue
        square, rate = row.T @ row, guide.damping + train.damping.beta * guide.stiffness
        made.append(LinearForce(touched, rate * square, guide.stiffness * square, name))
    return made


def _pin_rows(train: GearTrain, shafts: Shafts, carrier: Carrier, pin: Pin) -> Array:
    """Motion of a planet against its carrier at the middle of its shaft, (5, system size)."""
    arm, (e1, e2, _) = train.pin_arm(carrier, pin), train.frame
    radial = (arm[0] * e1 + arm[1] * e2) / np.hypot(*arm)
    one, two = train.shaft_number(pin.shaft), train.shaft_number(carrier.shaft)
    planet, middle = shafts.bodies[one], shafts.bodies[two]
    rows = pin_rows(planet, middle, np.array(train.shaft(pin.shaft).point), radial, train.frame)
    return shafts.whole(one, rows[:, : planet.size]) + shafts.whole(two, rows[:, planet.size :])


def _held_by_pin(pin: Pin) -> list[int]:
    """Motions of a planet against its carrier that a pin holds: radial, along the axis, tangential, tilts."""
    if pin.stiffness is None:
        return [0, 1, 2, 3, 4]
    return HELD_AFLOAT if isinstance(pin.stiffness, float | int) else []


def _pin_matrix(values: float | Five) -> Array:
    """Springs or dampers of a pin, (5, 5)."""
    return np.diag([values, 0.0, values, 0.0, 0.0] if isinstance(values, float | int) else values)


def _pin_springs(pin: Pin) -> Array:
    return np.zeros((5, 5)) if pin.stiffness is None else _pin_matrix(pin.stiffness)


def _pin_error(pin: Pin) -> Array:
    """Where the pin is on the carrier, beside its nominal place, (5,)."""
    return np.array([pin.error[0], 0.0, pin.error[1], 0.0, 0.0])


def _drive(drive: Drive, touches: tuple[Element, ...], row: Array) -> Element:
    """Rigid drive: a constraint on the relative rotation beside rolling; with a coupling: spring and damper on it."""
    if drive.stiffness is None:
        return LinearJoint(touches, row, np.zeros(1), name="drive")
    square = row.T @ row
    return LinearForce(touches, drive.damping * square, drive.stiffness * square, "drive")


def _damped(train: GearTrain, elements: list[Element], bodies: list[Element]) -> tuple[System, ModalCoordinates]:
    """System and minimal coordinates; modal damping is written in the modes of the coupled system itself."""
    system = System(elements)
    modal = modal_coordinates(system)
    ratios = np.atleast_1d(np.asarray(train.damping.ratio, dtype=float))
    if not ratios.any():
        return system, modal
    count = len(modal.eigenvalues)
    per_mode = np.append(ratios, np.full(max(0, count - len(ratios)), ratios[-1]))[:count]
    values = np.where(modal.eigenvalues > FREE * modal.eigenvalues.max(initial=0.0), modal.eigenvalues, 0.0)
    factors = 2.0 * per_mode * np.sqrt(values)
    back = modal.T.T @ system.mass
    whole = LinearForce(tuple(bodies), back.T @ (factors[:, None] * back), np.zeros_like(system.mass), "modal damping")
    damped = System([*elements, whole])
    # the modes are those without damping, and its matrix stays exactly diagonal
    in_modes = replace(modal, system=damped, damping=modal.damping + np.diag(factors))
    return damped, damped.once("modal coordinates", lambda: in_modes)


def _start(
    train: GearTrain, system: System, shafts: tuple[ShaftBody, ...], rotors: tuple[MachineRotor, ...], first: IntArray
) -> Start:
    """At rest beside rolling except for the given initial speeds, which the constraints must allow."""
    start = consistent_start(system, 0.0)
    open_rows = {system.row_names()[i] for i in start.freedoms.redundant}
    for mesh in train.meshes:
        if f"mesh {mesh.name} (0)" in open_rows:
            problem = (
                "leaves the forces open: rigid meshes close a loop in a rigid housing, and statics do not share it"
            )
            raise InputError(f"mesh {mesh.name!r} rigid", True, problem, "give the meshes of the loop a stiffness")
    size = len(start.v)
    spins = [
        (f"shaft {shaft.name!r}", shaft.initial_speed, float(start.v[i + 5]) - body.start_rate)
        for shaft, body, i in zip(train.shafts, shafts, first, strict=True)
    ]
    spins += [
        (f"machine {machine.name!r}", machine.initial_speed, float(start.v[i]) - rotor.start_rate)
        for machine, rotor, i in zip(train.machines, rotors, range(size - len(rotors), size), strict=True)
    ]
    for label, given, off in spins:
        if given is not None and abs(off) > 1e-6 * max(1.0, abs(given)):
            problem = f"contradicts the drive and the rigid parts, which make it {given + off:.9g} rad/s"
            cure = "leave it out, or give the drive or the mesh an elastic coupling"
            raise InputError(f"{label} initial speed", given, problem, cure)
    return start


def _used_bores(train: GearTrain) -> tuple[str, ...]:
    used = {b for s in train.shafts for b in s.bores}
    return tuple(name for name in train.bore_points if name in used)


def _measured_against(train: GearTrain, name: str) -> tuple[str, float]:
    """Bore against which a shaft's rotation is measured, and the coordinate (m) of the section that is measured.

    They are those of the drive, of a load, or of its first bore.
    """
    if not train.shaft(name).bores:  # a planet
        return "", train.shaft_end(name, 0.0)
    first = train.shaft(name).bores[0]
    ends = [
        (end.bore or first, train.place(end))
        for _, end in train.shaft_ends(name)
        if end.bore is not None or end.along is not None
    ]
    return next(iter(ends), (first, float(train.bore_points[first] @ train.frame[2])))


def _turning(train: GearTrain, shafts: Shafts, name: str, along: float | None = None) -> Array:
    """Rotation of the section of a shaft at a place (m), by default the one that is measured, (system size,)."""
    number = train.shaft_number(name)
    place = _measured_against(train, name)[1] if along is None else along
    return shafts.whole(number, shafts.bodies[number].turn_rows(place)[2])


def _spin_reference(train: GearTrain, spin: Array) -> Array:
    rows = spin.copy()
    for i, shaft in enumerate(train.shafts):
        if train.housing is not None and shaft.bores:
            bore = bore_selector(train, _measured_against(train, shaft.name)[0])
            rows[i, : len(bore)] -= bore[:, 3:] @ train.frame[2]
    return rows


def _axial(train: GearTrain, size: int) -> Array:
    bores = _used_bores(train)
    rows = np.zeros((len(bores), size))
    if train.housing is not None:
        for i, bore in enumerate(bores):
            selector = bore_selector(train, bore)
            rows[i, : len(selector)] = selector[:, :3] @ train.frame[2]
    return rows
