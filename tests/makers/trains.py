"""Small trains for tests: rigid housings, and a light frame in place of a finite-element housing."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearfe.drivetrain.runup.condensed import condense
from gearfe.drivetrain.runup.results import SteadyState
from gearfe.drivetrain.train import Damping, Drive, GearMesh, GearTrain, Load, Shaft, ShaftGear, TrainModel
from gearfe.drivetrain.train.program import train_series
from gearfe.fem.reduction.modal_body import ModalBody
from gearfe.gears.gearmesh.periodic import PeriodicInterpolant, periodic_interpolant
from gearfe.gears.geometry.pair import Gear
from gearfe.multibody import TimeFunction, constant, smoothed_step

MODULE, ALPHA = 2.5e-3, math.radians(25.0)
SPEED, TORQUE = 600.0, -100.0


def gear(teeth: int, width: float = 0.01) -> Gear:
    """A gear of the shipped form."""
    return Gear(teeth, MODULE, ALPHA, width, 0.2 * teeth * MODULE, tip_round=1e-4)


def base_radius(teeth: int) -> float:
    return 0.5 * teeth * MODULE * math.cos(ALPHA)


def curve(
    teeth: int, mean: float = 1e8, swing: float = 0.1, method: str = "cubic", count: int = 40
) -> PeriodicInterpolant:
    """A smooth curve over one mesh cycle of a driver."""
    period = 2.0 * math.pi / teeth
    phase = period * np.arange(count) / count
    return periodic_interpolant(phase, mean * (1 + swing * np.cos(teeth * phase)), period, method=method)


def braking(stages: int) -> TimeFunction:
    """Torque that brakes the last shaft: it turns with the drive after an even number of stages."""
    return smoothed_step(0.5e-3, 1e-3, TORQUE * (-1) ** stages)


def train(
    stages: list[tuple[int, int]], *, stiffness: Any = 1e8, ys: list[float] | None = None, **changes: Any
) -> GearTrain:
    """Shafts in an x row; stage i joins shaft i and i + 1 by (driver teeth, driven teeth).

    `stiffness` is a constant, None (rigid), or a function of the driver's teeth.
    """
    places = [0.0]
    for one, two in stages:
        places.append(places[-1] + 0.5 * MODULE * (one + two))
    ys = ys or [0.012 - 0.012 * i for i in range(len(stages))]
    names = [f"s{i}" for i in range(len(places))]
    shafts = [Shaft(n, (x, 0.0, 0.0), 0.09, 0.01, (f"{n}+", f"{n}-")) for n, x in zip(names, places, strict=True)]
    gears, meshes = [], []
    for i, ((one, two), y) in enumerate(zip(stages, ys, strict=True)):
        gears += [ShaftGear(f"d{i}", names[i], y, gear(one)), ShaftGear(f"g{i}", names[i + 1], y, gear(two))]
        meshes.append(GearMesh(f"d{i}", f"g{i}", stiffness(one) if callable(stiffness) else stiffness))
    bores = {
        f"{n}{s}": (x, y, 0.0) for n, x in zip(names, places, strict=True) for s, y in (("+", 0.033), ("-", -0.033))
    }
    gear_train = GearTrain(
        shafts=tuple(shafts),
        gears=tuple(gears),
        meshes=tuple(meshes),
        drive=Drive("s0", "s0+", constant(SPEED)),
        loads=(Load(names[-1], f"{names[-1]}+", braking(len(stages))),),
        rigid_bores=bores,
    )
    return dataclasses.replace(gear_train, **changes)


SHIPPED = [(20, 30), (20, 30)]


def frame_body(gear_train: GearTrain, *, uneven: float = 0.0, skew: float = 0.0) -> ModalBody:
    """An elastic frame in place of the train's rigid housing: each bore on springs to ground and to its neighbours.

    It is mirror-symmetric about y = 0 and z = 0; `uneven` stiffens the bores at +y, `skew` couples x, y, z of a bore.
    """
    names, points = tuple(gear_train.rigid_bores), np.array(list(gear_train.rigid_bores.values()))
    n = len(names)
    local = np.diag([6e7, 2.5e7, 8e7, 4e4, 9e4, 5e4])
    if skew:
        local[0, 1] = local[1, 0] = skew * 3e7
        local[1, 2] = local[2, 1] = skew * 2e7
    K = np.zeros((6 * n + 2, 6 * n + 2))
    M = np.diag(np.concatenate([np.tile([0.4, 0.4, 0.4, 2e-4, 3e-4, 2e-4], n), [1.0, 1.0]]))
    link = np.diag([2e7, 1e7, 1.5e7, 1e4, 1e4, 1e4])
    for i in range(n):
        a = slice(6 * i, 6 * i + 6)
        K[a, a] += local * (1 + (uneven if points[i, 1] > 0 else 0.0))
        if i + 2 < n:
            b = slice(6 * i + 12, 6 * i + 18)
            for x, y, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                K[x, y] += sign * link
    K[-2, -2], K[-1, -1] = (2 * math.pi * 3000.0) ** 2, (2 * math.pi * 5200.0) ** 2
    for i in range(n):  # two internal modes that move all bores along x, and along z
        M[6 * i, -2] = M[-2, 6 * i] = 0.15
        M[6 * i + 2, -1] = M[-1, 6 * i + 2] = 0.12
    size = len(M)
    shapes = np.zeros((3 * n, size))
    for i in range(n):
        shapes[3 * i : 3 * i + 3, 6 * i : 6 * i + 3] = np.eye(3)
    none = np.zeros((0, 3), dtype=np.int64)
    return ModalBody(
        mass=M, damping=np.zeros_like(M), stiffness=K, attachment_names=names, attachment_points=points,
        attachment_axes=np.tile([0.0, 1.0, 0.0], (n, 1)), internal_hz=np.array([3000.0, 5200.0]), modes=2, nodes=points,
        elements=np.zeros((0, 4), dtype=np.int64), shapes=shapes, faces=none, normals=np.zeros((n, 3)),
        radiation=np.zeros_like(M), momentum=np.zeros((6, size)), rigid_mass=np.eye(6),
        truncation=np.zeros((2, 2)), corrections=1, next_hz=math.inf,
        softening=np.zeros_like(M), held=True,
    )  # fmt: skip


def elastic(gear_train: GearTrain, **options: Any) -> GearTrain:
    """The same train in the elastic frame."""
    return dataclasses.replace(gear_train, housing=frame_body(gear_train, **options), rigid_bores={})


def changed(gear_train: GearTrain, **changes: Any) -> GearTrain:
    return dataclasses.replace(gear_train, **changes)


def loaded(stages, stiffness, *, speed=600.0, torque=60.0, ratio=0.05, backlash=None, flexible=True, **options):  # type: ignore[no-untyped-def]
    """A train with a constant load from the begin on, all modes damped."""
    gear_train = train(stages, stiffness=stiffness, damping=Damping(ratio=ratio), **options)
    last = f"s{len(stages)}"
    load = Load(last, f"{last}+", constant(-torque * (-1) ** len(stages) * math.copysign(1.0, speed)))
    gear_train = dataclasses.replace(
        gear_train, loads=(load,), drive=dataclasses.replace(gear_train.drive, speed=constant(speed)),
        meshes=tuple(dataclasses.replace(m, backlash=backlash) for m in gear_train.meshes),
    )  # fmt: skip
    return elastic(gear_train, uneven=0.2, skew=0.5) if flexible else gear_train


def smooth(teeth):  # type: ignore[no-untyped-def]
    return curve(teeth, mean=1e8, swing=0.15)


Array = NDArray[np.float64]


def modal_start(model: TrainModel, state: SteadyState) -> Array:
    """Modal coordinates and their rates at the begin of the period."""
    omega = 2.0 * np.pi * state.frequency
    y = condense(model).system.linear.modal(omega, state.speed, state.orbit.forces)
    return np.concatenate([y.sum(axis=0).real, (1j * omega[:, None] * y).sum(axis=0).real])


def series_at_start(forces, t, sign, u, s):
    """Series law, memory and whole numbers at a start."""
    law = train_series(forces)
    memory, pieces = np.zeros((law.rows, u.shape[1])), np.zeros(law.pieces, dtype=np.int64)
    law.begin(t, sign, u[:, 0], u[:, 1] / s, memory, pieces)
    return law.parameters, memory, pieces
