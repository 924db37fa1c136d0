"""Trains of one pair of gears: with a mesh law, free in space, damped in contact."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gearfe.drivetrain.train import Drive, Load, build_train
from gearfe.drivetrain.train.states import train_states
from gearfe.multibody import constant, integrate
from tests.makers.trains import SPEED, base_radius, changed, curve, train

R1, R2 = base_radius(20), base_radius(30)


def pair(law, *, speed=600.0, torque=None, backlash=None, **changes):  # type: ignore[no-untyped-def]
    """One stage with a law; `torque` brakes the driven shaft."""
    gear_train = train([(20, 30)], **changes)
    mesh = dataclasses.replace(gear_train.meshes[0], stiffness=law, backlash=backlash)
    gear_train = dataclasses.replace(
        gear_train, meshes=(mesh,), drive=dataclasses.replace(gear_train.drive, speed=constant(speed))
    )
    if torque is not None:
        gear_train = dataclasses.replace(gear_train, loads=(Load("s1", None, torque),))
    return gear_train


def free_pair(law, force):  # type: ignore[no-untyped-def]
    """Both shafts free except for balanced torques, the drive a spring of no consequence."""
    gear_train = pair(law)
    drive = Drive("s0", "s0+", constant(600.0), stiffness=1e-9)
    loads = (Load("s0", None, constant(force * R1)), Load("s1", None, constant(force * R2)))
    return build_train(dataclasses.replace(gear_train, drive=drive, loads=loads))


def free_energy(model, law, times, tolerance):  # type: ignore[no-untyped-def]
    """Kinetic and elastic energy less the work of the torques (J), and the elastic part."""
    run = integrate(model.system, times, method="taylor", tolerance=tolerance, start=model.start)
    moved = train_states(model, run)
    line = model.meshes[0]
    spins = moved.q[:, [int(i) + 5 for i in model.first]]
    rates = moved.v[:, [int(i) + 5 for i in model.first]] + model.angle(moved.time, 1)[:, None] * model.ratios
    turned = spins + model.angle(moved.time)[:, None] * model.ratios
    kinetic = 0.5 * rates**2 @ np.array([s.rotor.polar for s in model.shafts])
    phase = line.sense * (line.ratio * model.angle(moved.time) + spins[:, 0]) + line.phase
    elastic_part = law(phase, moved.q @ line.row).energy
    work = sum(float(f(0.0)) * (turned @ np.array([d[int(i) + 5] for i in model.first])) for d, f in model.torques)
    return kinetic + elastic_part - work, elastic_part, moved


BACKLASH = 4e-5


def damped_pair(acts, *, torque, speed=SPEED, ratio=0.04, stiffness=None, backlash=BACKLASH):
    """A pair on stiff axes whose wheel alone may move, its damper a part of the critical one of the mean stiffness."""
    k = curve(20, swing=0.3, count=12) if stiffness is None else stiffness
    bare = train([(20, 30)], stiffness=lambda _: k)
    mass = build_train(bare).shafts[1].rotor.polar / base_radius(30) ** 2
    mean = k if isinstance(k, float) else k.mean
    damper = 2.0 * ratio * math.sqrt(mean * mass)
    mesh = dataclasses.replace(bare.meshes[0], damping=damper, backlash=backlash, damping_acts=acts)
    load = dataclasses.replace(bare.loads[0], torque=constant(torque))
    drive = dataclasses.replace(bare.drive, speed=constant(speed))
    return changed(bare, meshes=(mesh,), loads=(load,), drive=drive), mass, damper
