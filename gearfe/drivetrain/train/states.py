r"""States of a train at many times at once: system coordinates, contact forces, and the accelerations behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, BoolArray
from ...multibody import Trajectory
from .forces import FlankForces
from .model import TrainModel


@dataclass(frozen=True, eq=False)
class TrainStates:
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
    apart : (n, meshes)
        Whether no flank bears; a damper that acts nevertheless makes a force.
    drive_torque : (n,)
        Torque of the drive on its shaft (N m).
    mesh_power, friction_power : (n, meshes)
        What the driver gives to the mesh, in a planetary stage seen from its carrier; what friction takes of it (W).
    bearing : (n, bores, 6)
        Force (N) and moment (N m) of the shaft on each bore about its reference point, along x, y, z.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    contact_force: Array
    approach: Array
    apart: BoolArray
    drive_torque: Array
    mesh_power: Array
    friction_power: Array
    bearing: Array


def train_states(model: TrainModel, trajectory: Trajectory) -> TrainStates:
    """States at the trajectory's times."""
    modal, t, W = model.modal, trajectory.time, model.directions
    by_modes = trajectory.method == "taylor"
    if by_modes:
        state = trajectory.dense.state(t)  # type: ignore[attr-defined]
        n = modal.T.shape[1]
        y, dy = state[:, :n], state[:, n:]
        q, v = modal.origin + y @ modal.T.T, dy @ modal.T.T
    else:
        q, v, a = trajectory.q, trajectory.v, trajectory.a
    u, du = q @ W, v @ W
    flanks = model.forces.of_flanks(t, u, du)
    acting = model.forces(t, u, du, flanks) @ W.T
    if by_modes:
        a = (modal.constant - y * modal.eigenvalues - dy @ modal.damping.T + acting @ modal.T) @ modal.T.T
    multipliers = _joint_multipliers(model, q, v, a, acting)
    drive, row = model.train.driven, model.drive_row
    if drive.torque is not None:
        push = drive.torque(t) - drive.slope * (v @ row)
        if drive.over_speed is not None:
            push += drive.over_speed.change(model.angle(t, 1) + v @ row)
    elif drive.stiffness is None:
        push = -multipliers["drive"]
    else:
        push = -drive.stiffness * (q @ row) - drive.damping * (v @ row)
    rows = np.array([line.row for line in model.meshes]).reshape(-1, q.shape[1])
    force, drag, loss, apart = _contact_forces(model, v, flanks, multipliers)
    drivers = [line.driver for line in model.meshes]
    ratios = np.array([float(ratio) for ratio in model.kinematics.drivers])
    turning = np.array([line.spin for line in model.meshes]).reshape(-1, q.shape[1])
    speed = model.angle(t, 1)[:, None] * ratios + v @ turning.T
    arms = rows[np.arange(len(rows)), [int(model.first[i]) + 5 for i in drivers]]
    power = speed * (arms * force + drag)
    ring_drives = np.array([line.given.ring_drives for line in model.meshes], dtype=bool)
    power = np.where(ring_drives, loss - power, power)  # what the external gear does not take away, friction does
    turning, still = model.bearings.parts(q, v, a, acting, model.angle(t, 1))
    loads = model.fixed_axes(t, turning.reshape(len(t), -1, 2, 3)).reshape(len(t), -1, 6) + still
    return TrainStates(t, q, v, a, force, q @ rows.T, apart, push, power, loss, loads)


def _contact_forces(
    model: TrainModel, v: Array, flanks: list[FlankForces], multipliers: dict[str, Array]
) -> tuple[Array, Array, Array, BoolArray]:
    """Return force, friction torque and power, and contact loss of each mesh, all of shape (n, meshes).

    The force (N) is that of spring and damper, or the multiplier of a rigid mesh; on back flanks it is negative. The
    torque (N m) acts against the driver; the power (W) is what friction dissipates.
    """
    out, torque, power = np.zeros((3, len(v), len(model.meshes)))
    apart = np.zeros(out.shape, dtype=bool)
    flank_forces = iter(flanks)
    for i, line in enumerate(model.meshes):
        if line.rigid:
            out[:, i] = multipliers[f"mesh {line.name}"]
            continue
        apart[:, i] = not line.pulls
        for side in (1.0, -1.0)[: len(line.flanks)]:
            forces = next(flank_forces)
            out[:, i] += side * forces.force
            apart[:, i] &= forces.apart | (forces.force == 0.0)
            if line.sliding is not None and forces.drag is not None:
                torque[:, i] += forces.drag.value @ np.array([line.sliding.arm, 1.0])
                power[:, i] += forces.drag.power
        if not line.in_contact:
            out[:, i] += line.damping * (v @ line.row)
    return out, torque, power, apart


def _joint_multipliers(model: TrainModel, q: Array, v: Array, a: Array, acting: Array) -> dict[str, Array]:
    """Return the multipliers (n,) of the joints with one row, the rigid drive and rigid meshes, by name.

    They are the least ones if joints are redundant; `acting` are the forces of the train on the coordinates, (n, size).
    From ``M a = f - G^T lambda``, so the force on the coordinates is ``-G^T lambda``.
    """
    system = model.system
    rows = np.cumsum([0, *(element.rows for element, _ in system.joints)])
    single = {element.name: row for (element, _), row in zip(system.joints, rows, strict=False) if element.rows == 1}
    P = model.multipliers_of_forces[:, list(single.values())]
    multipliers = acting @ P - v @ (system.damping.T @ P) - q @ (system.stiffness @ P) - a @ (system.mass @ P)
    return dict(zip(single, multipliers.T, strict=True))
