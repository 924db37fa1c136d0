r"""Motion of a train at many times at once: system coordinates, contact forces, and the accelerations behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rigid import Trajectory
from ..typing import Array
from .model import TrainModel


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
    approach : (n, meshes)
        Along the lines of action (m).
    drive_torque : (n,)
        Torque of the drive on its shaft (N m).
    """

    time: Array
    q: Array
    v: Array
    a: Array
    contact_force: Array
    approach: Array
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
    rows = np.array([line.row for line in model.meshes]).reshape(-1, q.shape[1])
    return Motion(t, q, v, a, contact_forces(model, t, q, v, multipliers), q @ rows.T, push)


def forces(model: TrainModel, t: Array, q: Array, v: Array) -> Array:
    """All forces but the constant blocks on the system's coordinates, shape (n, size)."""
    W = model.directions
    made: Array = model.forces(t, q @ W, v @ W) @ W.T
    return made


def contact_forces(model: TrainModel, t: Array, q: Array, v: Array, multipliers: dict[str, Array]) -> Array:
    """F of each mesh (N): spring and damper, or the multiplier of a rigid mesh; of back flanks negative."""
    out = np.zeros((len(t), len(model.meshes)))
    u, du = q @ model.directions, v @ model.directions
    flanks = iter(model.forces.flanks)
    for i, line in enumerate(model.meshes):
        if line.rigid:
            out[:, i] = multipliers[f"mesh {line.name}"][:, 0]
            continue
        out[:, i] = model.forces.of_flank(next(flanks), t, u, du)
        if line.backlash is not None:
            out[:, i] -= model.forces.of_flank(next(flanks), t, u, du)
        if line.law is None:
            out[:, i] += line.damping * (v @ line.row)
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
