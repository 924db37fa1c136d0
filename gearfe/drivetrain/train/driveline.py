r"""Machines and couplings of a train: inertias and torsional springs about its axes.

A machine is one coordinate, the rest of its rotation beside rolling with its shaft: :math:`\varphi_m = g\,\psi + u_m`,
g the ratio of the shaft. Its spring and damper act on :math:`u_m - u_s`, u_s the rotation of the shaft there. A
coupling joins two shafts on one axis, whose ratios are equal, at their ends that face each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...base.typing import Array
from ...multibody import Element
from .elements import LinearForce
from .gear_train import Coupling, Damping, GearTrain, Machine

if TYPE_CHECKING:
    from .mesh_element import Shafts


@dataclass(frozen=True, eq=False)
class MachineRotor(Element):
    """The rotor of a machine: one coordinate.

    Parameters
    ----------
    inertia
        About the axis (kg m2).
    start_rate
        Spin beside rolling at the start (rad/s).
    """

    inertia: float
    start_rate: float = 0.0
    name: str = "machine"
    size: int = 1

    def mass(self) -> Array:
        """Its inertia, (1, 1)."""
        return np.array([[self.inertia]])

    def start(self) -> tuple[Array, Array]:
        """Rolling with the drive except for its start rate."""
        return np.zeros(1), np.array([self.start_rate])


@dataclass(frozen=True, eq=False)
class Driveline:
    """Machines and torsional springs of a train in the coordinates of its system.

    Attributes
    ----------
    machines : ndarray, shape (machines, size)
        Rotation of each machine beside rolling.
    springs
        The machines, whose springs these are, and then the couplings.
    twists : ndarray, shape (springs, size)
        Rotation of a machine against its shaft, or of the first shaft of a coupling against the second.
    """

    machines: Array
    springs: tuple[Machine | Coupling, ...]
    twists: Array

    def torques(self, q: Array, v: Array) -> Array:
        """Torque of each spring with its damper on the shaft of a machine, or on the second one of a coupling (N m)."""
        stiffness, damping = (np.array([getattr(s, key) for s in self.springs]) for key in ("stiffness", "damping"))
        return np.asarray((q @ self.twists.T) * stiffness + (v @ self.twists.T) * damping)

    def elements(
        self, train: GearTrain, shafts: Shafts, rotors: Sequence[MachineRotor], damping: Damping
    ) -> list[LinearForce]:
        """Return springs and dampers, with those of Rayleigh damping.

        Parameters
        ----------
        train, shafts
            The train, and its shafts in the system.
        rotors
            Of its machines.
        damping
            Of the whole train.
        """
        made = []
        places = {shaft.name: (shafts.bodies[i], int(shafts.first[i])) for i, shaft in enumerate(train.shafts)}
        starts = range(shafts.size - len(rotors), shafts.size)
        own = {m.name: (rotor, at) for m, rotor, at in zip(train.machines, rotors, starts, strict=True)}
        for spring, row in zip(self.springs, self.twists, strict=True):
            if isinstance(spring, Machine):
                ends: list[tuple[Element, int]] = [own[spring.name], places[spring.shaft]]
            else:
                ends = [places[name] for name in spring.shafts]
            local = np.concatenate([row[at : at + body.size] for body, at in ends])
            square = np.outer(local, local)
            rate = spring.damping + damping.beta * spring.stiffness
            touches = tuple(body for body, _ in ends)
            made.append(LinearForce(touches, rate * square, spring.stiffness * square, f"spring of {spring.name}"))
        if damping.alpha > 0.0:
            none = np.zeros((1, 1))
            made += [LinearForce((r,), damping.alpha * r.mass(), none, f"damping of {r.name}") for r in rotors]
        return made


def machine_rotors(train: GearTrain, begin: float) -> tuple[MachineRotor, ...]:
    """Return the rotors of a train's machines, the drive turning with the speed `begin` (rad/s) at the start."""
    made = []
    for machine in train.machines:
        rolling = float(train.kinematics.ratios[train.shaft_number(machine.shaft)]) * begin
        rate = 0.0 if machine.initial_speed is None else machine.initial_speed - rolling
        made.append(MachineRotor(machine.inertia, rate, name=f"machine {machine.name}"))
    return tuple(made)


def driveline(train: GearTrain, shafts: Shafts) -> Driveline:
    """Return the machines and springs of a train; the machines' coordinates are the last of the system."""
    machines = np.eye(shafts.size)[shafts.size - len(train.machines) :]
    springs: tuple[Machine | Coupling, ...] = (*train.machines, *train.couplings)
    twists = np.zeros((len(springs), shafts.size))
    twists[: len(machines)] = machines
    for number, spring in enumerate(springs):
        signs = (-1.0,) if isinstance(spring, Machine) else (1.0, -1.0)
        for sign, (name, along) in zip(signs, spring_places(train, spring), strict=True):
            twists[number] += sign * _turn(shafts, train.shaft_number(name), along)
    return Driveline(machines, springs, twists)


def spring_places(train: GearTrain, spring: Machine | Coupling) -> list[tuple[str, float]]:
    """Shafts that a spring turns, and the coordinates along the axis (m) of their sections there."""
    if isinstance(spring, Machine):
        return [(spring.shaft, train.shaft_end(spring.shaft, 0.0) if spring.along is None else spring.along)]
    one, two = spring.shafts
    towards = train.shaft_end(two, 0.0) - train.shaft_end(one, 0.0)
    return [(one, train.shaft_end(one, towards)), (two, train.shaft_end(two, -towards))]


def _turn(shafts: Shafts, number: int, along: float) -> Array:
    return shafts.whole(number, shafts.bodies[number].turn_rows(along)[2])
