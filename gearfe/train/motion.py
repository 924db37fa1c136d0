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
    mesh_power, friction_power : (n, meshes)
        What the driver gives to the mesh, and what friction takes of it (W).
    """

    time: Array
    q: Array
    v: Array
    a: Array
    contact_force: Array
    approach: Array
    drive_torque: Array
    mesh_power: Array
    friction_power: Array


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
    drive = model.scene.driven
    if drive.stiffness is None:
        push = -multipliers["drive"][:, 0]
    else:
        row = model.spin_reference[[s.name for s in model.scene.shafts].index(drive.shaft)]
        push = -drive.stiffness * (q @ row) - drive.damping * (v @ row)
    rows = np.array([line.row for line in model.meshes]).reshape(-1, q.shape[1])
    force, drag, loss = contact_forces(model, t, q, v, multipliers)
    drivers = [line.driver for line in model.meshes]
    spin = [int(model.first[i]) + 5 for i in drivers]
    speed = model.angle(t, 1)[:, None] * model.ratios[drivers] + v[:, spin]
    arms = rows[np.arange(len(rows)), spin]
    return Motion(t, q, v, a, force, q @ rows.T, push, speed * (arms * force + drag), loss)


def forces(model: TrainModel, t: Array, q: Array, v: Array) -> Array:
    """All forces but the constant blocks on the system's coordinates, shape (n, size)."""
    W = model.directions
    made: Array = model.forces(t, q @ W, v @ W) @ W.T
    return made


def contact_forces(
    model: TrainModel, t: Array, q: Array, v: Array, multipliers: dict[str, Array]
) -> tuple[Array, Array, Array]:
    """Of each mesh F (N): spring and damper, or the multiplier of a rigid mesh; of back flanks negative. Then of its
    friction the torque against the driver (N m) and the power that it takes (W).
    """
    out, torque, power = np.zeros((3, len(t), len(model.meshes)))
    u, du = q @ model.directions, v @ model.directions
    flanks = iter(model.forces.flanks)
    for i, line in enumerate(model.meshes):
        if line.rigid:
            out[:, i] = multipliers[f"mesh {line.name}"][:, 0]
            continue
        for side in (1.0,) if line.backlash is None else (1.0, -1.0):
            made = model.forces.of_flank(next(flanks), t, u, du)
            out[:, i] += side * made.force
            if line.sliding is not None and made.drag is not None:
                torque[:, i] += line.sliding.arm * made.drag.across + made.drag.turning
                power[:, i] += made.drag.power
        if line.law is None:
            out[:, i] += line.damping * (v @ line.row)
    return out, torque, power


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
