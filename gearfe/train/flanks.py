"""Which flanks bear: the loads of a train must press the driving flanks of every mesh together.

A mesh has the curve of its driving flanks only. By statics at each time, inertia of the rolling shafts included, a mesh
force below 0 means that the back flanks bear: a torque of the wrong sign, or a mesh whose driven gear drives.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..meshlaw.law import MeshLaw
from ..typing import Array, BoolArray
from .gear_train import GearTrain
from .inertia import rotor
from .kinematics import balanced_forces, drive_sense, driving_senses, load_torques, rolling

#: Times looked at in each piece of the loads and of the drive.
LOOKS = 64
#: Smaller forces, relative to the largest, are round-off.
NONE = 1e-9


def check_flanks(train: GearTrain) -> None:
    """Raise `InputError` where the loads press the back flanks of a mesh, at whatever time.

    Oscillating parts of loads are left out: what matters is the torque about which they swing. Inertia alone is no
    mistake: a drive that slows down lets teeth part for a while, of which the run warns.
    """
    if not train.loads or not train.meshes:
        return
    times = _times(train)
    senses = driving_senses(train)
    loads = balanced_forces(train, senses, load_torques(train, times))
    whole = loads + balanced_forces(train, senses, _inertia(train, times))
    least = -NONE * float(np.abs(loads).max())
    wrong = (loads < least) & (whole < least) & one_sided(train)[:, None]
    if wrong.any():
        at = int(np.argmin(np.where(wrong, loads, np.inf).min(axis=0)))
        mesh = int(np.argmin(np.where(wrong[:, at], loads[:, at], np.inf)))
        raise _back_flank_error(train, mesh, float(times[at]), senses)


def one_sided(train: GearTrain) -> BoolArray:
    """For each mesh, whether nothing is known of its back flanks."""
    own = [isinstance(mesh.stiffness, MeshLaw) and mesh.stiffness.backlash > 0.0 for mesh in train.meshes]
    return np.array(
        [mesh.backlash is None and not has for mesh, has in zip(train.meshes, own, strict=True)], dtype=bool
    )


def _times(train: GearTrain) -> Array:
    breaks = {b for load in train.loads for b in load.torque.breaks} | set(train.driven.speed.breaks)
    ends = sorted({0.0, *(b for b in breaks if b > 0.0)})
    inner = [np.linspace(a, b, LOOKS) for a, b in itertools.pairwise(ends)]
    return np.unique(np.concatenate([ends, *inner]))


def _inertia(train: GearTrain, times: Array) -> Array:
    """Torque of inertia of each shaft as it rolls with the drive (N m), shape (shafts, times)."""
    push = replace(train.driven.speed, sines=())(times, 1)
    axis = train.frame[2]
    polar = [rotor(s, tuple(g for g in train.gears if g.shaft == s.name), axis).polar for s in train.shafts]
    ratios = [float(r) for r in rolling(train).ratios]
    return -np.outer(np.multiply(polar, ratios), push)


def _back_flank_error(train: GearTrain, number: int, time: float, senses: tuple[float, ...]) -> InputError:
    """The load that does most to press the back flanks of a mesh, and what to change."""
    mesh = train.meshes[number]
    alone = [
        float(balanced_forces(train, senses, load_torques(replace(train, loads=(load,)), [time]))[number, 0])
        for load in train.loads
    ]
    load = train.loads[int(np.argmin(alone))]
    torque = float(replace(load.torque, sines=())(time))
    ratios = dict(zip((s.name for s in train.shafts), rolling(train).ratios, strict=True))
    speed = float(ratios[load.shaft]) * drive_sense(train.driven.speed)
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
        problem = f"brakes, but gear {mesh.driven!r} drives gear {mesh.driver!r}; {flanks}"
        cure = f"exchange driver and driven of mesh {mesh.name!r}, or change the sign of the torque"
    return InputError(f"load on {load.shaft!r} torque_Nm", torque, problem, cure)
