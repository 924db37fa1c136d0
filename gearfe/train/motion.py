r"""Motion of a train at many times at once: system coordinates, contact forces, and the accelerations behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rigid import Trajectory
from .model import TrainModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """Coordinates of the system beside rolling, n times.

    Attributes
    ----------
    time : (n,)
    q, v, a : (n, size)
        Coordinates, rates, second rates.
    contact_force : (n, meshes)
        N.
    drive_torque : (n,)
        Torque of the drive on its shaft (N m).
    """

    time: Array
    q: Array
    v: Array
    a: Array
    contact_force: Array
    drive_torque: Array


def motion(model: TrainModel, trajectory: Trajectory) -> Motion:
    """Motion at the trajectory's times."""
    core, t = model.core, trajectory.time
    if trajectory.method in ("taylor", "explicit"):
        state = trajectory.dense.state(t)  # type: ignore[attr-defined]
        n = core.T.shape[1]
        y, dy = state[:, :n], state[:, n:]
        q, v = core.origin + y @ core.T.T, dy @ core.T.T
        ddy = core.constant - y * core.squares - dy @ core.damping.T + forces(model, t, q, v) @ core.T
        a = ddy @ core.T.T
    else:
        q, v, a = trajectory.q, trajectory.v, trajectory.a
    multipliers = joint_multipliers(model, t, q, v, a)
    drive = model.scene.drive
    assert drive is not None
    if drive.stiffness is None:
        push = -multipliers["drive"][:, 0]
    else:
        row = model.spin_reference[[s.name for s in model.scene.shafts].index(drive.shaft)]
        push = -drive.stiffness * (q @ row) - drive.damping * (v @ row)
    return Motion(t, q, v, a, contact_forces(model, t, q, v, multipliers), push)


def forces(model: TrainModel, t: Array, q: Array, v: Array) -> Array:
    """All forces but the constant blocks on the system's coordinates, shape (n, size)."""
    total = np.zeros_like(q)
    for line in model.meshes:
        if line.curve is not None:
            k = line.stiffness(model.angle(t), q[:, model.first[line.driver] + 5])
            total -= ((k - line.mean) * (q @ line.row))[:, None] * line.row
    speed = model.angle(t, 1)
    if model.scene.damping.gyroscopic:
        for body, first, ratio in zip(model.shafts, model.first, model.ratios, strict=True):
            momentum = body.rotor.polar * (ratio * speed + v[:, first + 5])
            total[:, first + 3] -= momentum * v[:, first + 4]
            total[:, first + 4] += momentum * v[:, first + 3]
    for direction, function in model.torques:
        total += function(t)[:, None] * direction
    return total


def contact_forces(model: TrainModel, t: Array, q: Array, v: Array, multipliers: dict[str, Array]) -> Array:
    """F of each mesh (N): spring and damper, or the multiplier of a rigid mesh."""
    out = np.zeros((len(t), len(model.meshes)))
    for i, line in enumerate(model.meshes):
        if line.curve is None:
            out[:, i] = multipliers[f"mesh {line.name}"][:, 0]
        else:
            k = line.stiffness(model.angle(t), q[:, model.first[line.driver] + 5])
            out[:, i] = k * (q @ line.row) + line.damping * (v @ line.row)
    return out


def joint_multipliers(model: TrainModel, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
    """Multipliers of each joint, (n, rows): the least ones where joints are redundant.

    From ``M a = f - G^T lambda``, so the force on the coordinates is ``-G^T lambda``.
    """
    system = model.system
    left = forces(model, t, q, v) - v @ system.damping.T - q @ system.stiffness - a @ system.mass
    multipliers = left @ model.multipliers_of_forces
    found, at = {}, 0
    for element, _ in system.joints:
        found[element.name] = multipliers[:, at : at + element.rows]
        at += element.rows
    return found
