"""Statics of a train: which flanks bear, and the static transmission error.

The loads must press the driving flanks of every mesh together, for a mesh has the curve of its driving flanks only. By
statics at each time, inertia of the rolling shafts included, a mesh force below 0 means that the back flanks carry the
load. The torque has the wrong sign, or the driven gear of the mesh drives. The static transmission error is the
approach of a mesh that carries its steady force while the gears roll slowly.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, BoolArray
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.width_law import WidthLaw
from ...gears.geometry.validity import MOST_YIELD
from .elements import rotor
from .gear_train import GearMesh, GearTrain
from .kinematics import balanced_forces, drive_sense, load_torques

#: Times in each piece of the loads and of the drive.
SAMPLES = 64
#: Smaller forces, relative to the largest, are round-off.
ROUND_OFF = 1e-9


def check_flanks(train: GearTrain, single: BoolArray) -> None:
    """Raise `InputError` where the loads press the back flanks of a mesh, at whatever time, of which nothing is known.

    `single` are the meshes, shape (meshes,), of whose back flanks nothing is known.

    Oscillating parts of loads are left out: what matters is the torque about which they swing. Inertia alone is no
    mistake: a drive that slows down lets teeth part for a while, of which the run warns.
    """
    if not train.loads or not train.meshes:
        return
    times = _times(train)
    layout, senses = train.layout, train.kinematics.senses
    loads = balanced_forces(layout, senses, load_torques(layout, times))
    whole = loads + balanced_forces(layout, senses, _inertia(train, times))
    least = -ROUND_OFF * float(np.abs(loads).max())
    wrong = (loads < least) & (whole < least) & single[:, None]
    if wrong.any():
        at = int(np.argmin(np.where(wrong, loads, np.inf).min(axis=0)))
        mesh = int(np.argmin(np.where(wrong[:, at], loads[:, at], np.inf)))
        raise _back_flank_error(train, mesh, float(times[at]))


def one_sided(train: GearTrain) -> BoolArray:
    """For each mesh, whether nothing is known of its back flanks."""
    laws = (mesh.stiffness for mesh in train.meshes)
    own = [isinstance(law, MeshLaw | WidthLaw) and law.backlash > 0.0 for law in laws]
    return np.array(
        [mesh.backlash is None and not has for mesh, has in zip(train.meshes, own, strict=True)], dtype=bool
    )


def _times(train: GearTrain) -> Array:
    breaks = {b for load in train.loads for b in load.torque.breaks} | set(train.driven.speed.breaks)
    ends = sorted({0.0, *(b for b in breaks if b > 0.0)})
    inner = [np.linspace(a, b, SAMPLES) for a, b in itertools.pairwise(ends)]
    return np.unique(np.concatenate([ends, *inner]))


def _inertia(train: GearTrain, times: Array) -> Array:
    """Torque of inertia of each shaft as it rolls with the drive (N m), shape (shafts, times)."""
    push = replace(train.driven.speed, sines=())(times, 1)
    polar = [rotor(train, shaft).polar + train.inertia_of_machines(shaft.name) for shaft in train.shafts]
    for carrier in train.carriers:  # planets go round with it
        polar[train.shaft_number(carrier.shaft)] += sum(
            rotor(train, train.shaft(pin.shaft)).mass * float(np.sum(train.pin_arm(carrier, pin) ** 2))
            for pin in carrier.pins
        )
    return -np.outer(np.multiply(polar, [float(r) for r in train.kinematics.ratios]), push)


def _back_flank_error(train: GearTrain, number: int, time: float) -> InputError:
    """The load that does most to press the back flanks of a mesh, and what to change."""
    mesh, layout, senses = train.meshes[number], train.layout, train.kinematics.senses
    alone = [
        float(balanced_forces(layout, senses, load_torques(replace(layout, loads=(load,)), [time]))[number, 0])
        for load in layout.loads
    ]
    load = train.loads[int(np.argmin(alone))]
    torque = float(replace(load.torque, sines=())(time))
    speed = float(train.kinematics.ratios[train.shaft_number(load.shaft)]) * drive_sense(train.driven.speed)
    when = f" at {1e3 * time:.4g} ms" if time > 0.0 else ""
    force = f"by statics the force of mesh {mesh.name!r} is {min(alone):.6g} N{when}"
    flanks = f"it would press the back flanks, whose stiffness is not known: {force}"
    if torque * speed > 0.0:
        problem = f"drives the train: it acts in the sense in which shaft {load.shaft!r} turns, so {flanks}"
        cure = (
            f"write {-torque:g} to brake; where the load is meant to drive, exchange driver and driven of the meshes "
            "between it and the drive"
        )
    else:
        one, two = (mesh.driver, mesh.driven) if mesh.ring_drives else (mesh.driven, mesh.driver)
        problem = f"brakes, but gear {one!r} drives gear {two!r}; {flanks}"
        cure = f"exchange driver and driven of mesh {mesh.name!r}, or change the sign of the torque"
    return InputError(f"load on {load.shaft!r} torque_Nm", torque, problem, cure)


def check_yields(train: GearTrain) -> None:
    """Raise `InputError` where the steady force moves the flanks of a mesh further than the gears' geometry holds.

    A stiffness in another unit (N/um or N/mm for N/m) is the usual cause. Mesh laws know their range themselves.
    """
    for mesh, force in zip(train.meshes, train.kinematics.steady_forces.tolist(), strict=True):
        if mesh.stiffness is None or mesh.has_law:
            continue
        stiffness = float(mesh.interpolant().values.min())
        module = train.gear(mesh.driver).gear.module
        modules = abs(force) / stiffness / module
        if modules > MOST_YIELD:
            problem = (
                f"deflects by {1e3 * modules * module:.3g} mm, {modules:.3g} modules, under the force of steady "
                f"running, {abs(force):.5g} N: must be {MOST_YIELD:g} modules or less"
            )
            cure = "stiffnesses are in N/m (1 N/um is 1e6 N/m), torques in N m; write a larger one, or a lower torque"
            raise InputError(f"mesh {mesh.name!r} stiffness", stiffness, problem, cure)


def static_errors(train: GearTrain, angle: Array) -> tuple[Array | None, ...]:
    """Approach of each mesh (m) at rotations of the drive (rad), bodies rolling rigidly; None where nothing yields.

    A force that presses the back flanks makes the mirrored approach behind the backlash. None also where a force is
    beyond what a law is known for, or presses flanks of which nothing is known.
    """
    rolled = train.kinematics
    errors: list[Array | None] = []
    for number, mesh in enumerate(train.meshes):
        ratio = float(rolled.drivers[number])
        phase = rolled.senses[number] * ratio * angle + rolled.phases[number]
        errors.append(_approach(mesh, float(rolled.steady_forces[number]), phase, rolled.shifts[number]))
    return tuple(errors)


def _approach(mesh: GearMesh, force: float, phase: Array, shifts: tuple[Array, Array]) -> Array | None:
    law, gap = mesh.stiffness, mesh.backlash
    if law is None:
        return None
    if isinstance(law, MeshLaw | WidthLaw):
        gap = law.backlash or None if gap is None else gap
        if force < 0.0 and gap is None:
            return None
        side = 0 if force >= 0.0 else 1
        acting, own = law.sides[side], shifts[side]

        def late(x: Array) -> Array:
            """Shifts of the pairs, of a law that has pairs."""
            return np.zeros(()) if isinstance(acting, WidthLaw) else own[acting.pair_numbers(x) % len(own)]

        place = phase if force >= 0.0 else -phase
        if (abs(force) > acting.most(place, late(place))).any():
            return None
        return _side(lambda x: acting.approach(x, abs(force), late(x)), phase, force, gap)
    curve = mesh.interpolant()
    error = mesh.transmission_error if force >= 0.0 or gap is None else mesh.back_error

    def yielding(x: Array) -> Array:
        late = 0.0 if error is None else error(x).value
        return np.asarray(late + (force if gap is None else abs(force)) / curve(x).value)

    return _side(yielding, phase, force, gap)


def _side(approach: Callable[[Array], Array], phase: Array, force: float, gap: float | None) -> Array:
    """The approach of the flanks that the force presses."""
    return approach(phase) if force >= 0.0 or gap is None else -gap - approach(-phase)
