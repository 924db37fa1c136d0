"""The transient of a train through the core's `integrate`, and what it means: a `TrainResponse`."""

from __future__ import annotations

import math
import time as clock
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..progress import stage
from ..rigid import Trajectory, integrate
from .floquet import train_multipliers
from .model import TrainModel
from .motion import Motion, motion
from .response import TrainResponse

Array = NDArray[np.float64]

#: The finer run shares a little of the error; with this factor the estimate covers it.
SAFETY = 1.5
#: An approach or a bore's displacement beyond this part of the module means that nothing holds any more.
DIVERGED = 0.25
#: A multiplier beyond this is an instability, not round-off.
STABLE = 1.0 + 1e-6


def simulate(
    model: TrainModel,
    times: ArrayLike,
    *,
    tolerance: float = 1e-6,
    method: str = "auto",
    floquet: bool = False,
    estimate: bool = False,
    band_hz: float = 5000.0,
    backend: str = "auto",
) -> TrainResponse:
    """Integrate a train and evaluate it at the asked times.

    Parameters
    ----------
    model
        From `gearfe.train.build_train`.
    times : array_like, shape (n,)
        Output times (s), rising from 0; the steps of the integration do not depend on them.
    tolerance
        Of the integration, relative to each coordinate's largest value.
    method
        ``auto``, ``explicit`` or ``implicit``, see `gearfe.rigid.integrate`.
    floquet
        Compute the multipliers over the common mesh period.
    estimate
        Estimate the errors: of the integration from a second run with a hundredth of the tolerance and shorter steps,
        and of the housing's reduction up to `band_hz` (Hz).
    backend
        ``compiled``, ``plain`` or ``auto``.

    Returns
    -------
    TrainResponse
        Up to the time reached; its status says why it ended earlier than asked.
    """
    t = np.atleast_1d(np.asarray(times, dtype=float))
    if t.size < 2 or not np.isfinite(t).all() or t[0] != 0.0 or not (np.diff(t) > 0).all():
        raise InputError(
            "times", None, "must be at least two rising numbers that begin with 0", "give the output times in s"
        )
    begin = clock.perf_counter()
    with np.errstate(over="ignore", invalid="ignore"):
        trajectory, moved = _run(model, t, tolerance, method, backend)
        status, keep, why = _ended(model, trajectory, moved)
    moved = _cut(moved, keep)
    compiling = float(trajectory.statistics.get("compile_seconds", 0.0))
    seconds = clock.perf_counter() - begin - compiling
    statistics = {
        **trajectory.statistics,
        "method": trajectory.method,
        "seconds": seconds,
        "free_coordinates": model.core.T.shape[1],
        "redundant_constraints": redundant_names(model),
        "smallest_contact_force_N": [float(f.min(initial=np.inf)) for f in moved.contact_force.T],
    }
    response = _response(model, moved, status, statistics)
    warnings = _pulls(model, moved)
    if status != "done":
        warnings.append(f"the run ended at {1e3 * response.time_reached:.6g} ms of {1e3 * t[-1]:.6g} ms: {status}{why}")
    estimates: dict[str, float] = {}
    if estimate:
        estimates = _estimates(model, response, t[: len(moved.time)], tolerance, method, band_hz)
    multipliers, note = (None, "not computed") if not floquet else train_multipliers(model)
    if multipliers is not None and abs(multipliers[0]) > STABLE:
        growth, period = abs(multipliers[0]) - 1.0, float(response.common_period_s or 0.0)
        warnings.append(
            f"the train is parametrically unstable: its vibration grows by {100 * growth:.3g} % in each common mesh "
            f"period of {1e3 * period:.4g} ms; add damping, or change the speed"
        )
    return replace(response, floquet=multipliers, floquet_note=note, estimates=estimates, warnings=tuple(warnings))


def _run(
    model: TrainModel, t: Array, tolerance: float, method: str, backend: str, longest: float = np.inf
) -> tuple[Trajectory, Motion]:
    if not len(model.core.squares):
        method = "explicit"  # nothing is left to integrate
    options: dict[str, Any] = {"tolerance": tolerance, "start": model.start, "backend": backend, "longest": longest}
    trajectory = integrate(model.system, t, method=method, **options)
    return trajectory, motion(model, trajectory)


def _ended(model: TrainModel, trajectory: Trajectory, moved: Motion) -> tuple[str, int, str]:
    """Status, the number of output times up to which the results hold, and what moved too far."""
    limit = DIVERGED * min((line.module for line in model.meshes), default=1e-3)
    reach = (
        np.abs(moved.q @ np.array([line.row for line in model.meshes]).T)
        if model.meshes
        else np.zeros((len(moved.q), 1))
    )
    shafts = np.abs(moved.q[:, [i + j for i in model.first for j in range(3)]])
    worst = np.maximum(reach.max(axis=1), shafts.max(axis=1))
    bad = ~np.isfinite(moved.q).all(axis=1) | ~(worst <= limit)
    if bad.any():
        at = int(np.argmax(bad))
        return "diverged", at, _too_far(model, reach[at], shafts[at], limit)
    return ("diverged" if trajectory.status == 4 else trajectory.message), len(moved.time), ""


def _too_far(model: TrainModel, reach: Array, shafts: Array, limit: float) -> str:
    """What passed the limit: the motion may be bounded, but the gears' geometry no longer holds."""
    if not (np.isfinite(reach).all() and np.isfinite(shafts).all()):
        return ""
    if reach.max() > limit:
        what, size = f"mesh {model.meshes[int(reach.argmax())].name} yields", reach.max()
    else:
        what, size = f"shaft {model.scene.shafts[int(shafts.argmax()) // 3].name} moves", shafts.max()
    return (
        f"; {what} by {1e3 * size:.3g} mm, more than {DIVERGED:g} module ({1e3 * limit:.3g} mm), where the gears' "
        "geometry no longer holds: lower the load, ramp it up more slowly, or stiffen or damp meshes and bearings"
    )


def _cut(moved: Motion, keep: int) -> Motion:
    return Motion(*(getattr(moved, name)[:keep] for name in ("time", "q", "v", "a", "contact_force", "drive_torque")))


def _response(model: TrainModel, moved: Motion, status: str, statistics: dict[str, Any]) -> TrainResponse:
    scene, t = model.scene, moved.time
    spin = [int(i) + 5 for i in model.first]
    rate, push = (model.angle(t, k)[:, None] * model.ratios for k in (1, 2))
    bodies = 0 if model.housing is None else model.housing.size
    poses, centres = _gear_poses(model, moved)
    speed, common = abs(model.steady_speed), model.rolling.common_turns
    steady = not scene.drive.speed.sines if scene.drive else False
    return TrainResponse(
        time=t,
        drive_angle=model.angle(t),
        mesh_names=tuple(line.name for line in model.meshes),
        contact_force=moved.contact_force,
        drive_torque=moved.drive_torque,
        shaft_names=tuple(s.name for s in scene.shafts),
        speed=rate + moved.v @ model.spin_reference.T,
        speed_absolute=rate + moved.v[:, spin],
        acceleration=push + moved.a @ model.spin_reference.T,
        acceleration_absolute=push + moved.a[:, spin],
        attachment_names=model.bores,
        attachment_acceleration=moved.a @ model.axial.T,
        gear_names=tuple(g.name for g in scene.gears),
        gear_pose=poses,
        gear_centres=centres,
        modal=moved.q[:, :bodies] if bodies else None,
        modal_velocity=moved.v[:, :bodies] if bodies else None,
        modal_acceleration=moved.a[:, :bodies] if bodies else None,
        mesh_frequencies_Hz=np.array([float(c) for c in model.rolling.cycles]) * speed / (2 * math.pi),
        shaft_frequencies_Hz=np.abs(model.ratios) * speed / (2 * math.pi),
        common_period_s=float(common) * 2 * math.pi / speed if common and speed and steady else None,
        coupled_frequencies_Hz=model.coupled_frequencies_hz,
        floquet=None,
        floquet_note="not computed",
        status=status,
        time_reached=float(t[-1]) if len(t) else 0.0,
        load_end_s=model.load_end,
        statistics=statistics,
    )


def _gear_poses(model: TrainModel, moved: Motion) -> tuple[Array, Array]:
    scene, frame = model.scene, model.scene.frame
    names = [s.name for s in scene.shafts]
    poses = np.zeros((len(moved.time), len(scene.gears), 6))
    centres = np.zeros((len(scene.gears), 3))
    for i, item in enumerate(scene.gears):
        k = names.index(item.shaft)
        base = np.array(scene.shafts[k].point)
        centres[i] = base + (item.along - float(base @ frame[2])) * frame[2]
        own = moved.q[:, model.first[k] : model.first[k] + 6]
        turn = own[:, 3:].copy()
        poses[:, i, :3] = own @ model.shafts[k].point_rows(centres[i], frame).T
        turn[:, 2] += model.ratios[k] * model.angle(moved.time)
        poses[:, i, 3:] = turn @ frame
    return poses, centres


def redundant_names(model: TrainModel) -> list[str]:
    """Constraints that add nothing: two hinges of a rigid shaft in a rigid housing share five."""
    names = model.system.row_names()
    return [names[i] for i in model.start.freedoms.redundant]


def _pulls(model: TrainModel, moved: Motion) -> list[str]:
    said = []
    for line, force in zip(model.meshes, moved.contact_force.T, strict=True):
        if len(force) and force.min() < -1e-6 * np.abs(force).max():
            at = int(force.argmin())
            said.append(
                f"mesh {line.name} pulls: {force[at]:.5g} N at {1e3 * moved.time[at]:.5g} ms; the spring acts both "
                "ways, real teeth would part there"
            )
    return said


@stage("error estimates")
def _estimates(
    model: TrainModel, response: TrainResponse, t: Array, tolerance: float, method: str, band_hz: float
) -> dict[str, float]:
    """Errors relative to each signal's largest value (integration), and of the reduction up to a frequency."""
    found = {}
    if len(t) >= 2:
        with np.errstate(over="ignore", invalid="ignore"):
            # where the corners of the curves set the steps, a tolerance alone would repeat them
            longest = 0.5 * float(t[-1]) / max(1, int(response.statistics["steps"]))
            _, finer = _run(model, t, max(1e-2 * tolerance, 1e-13), method, "auto", longest)
        kept = min(len(finer.time), len(t))
        pairs = [(response.contact_force[:kept], finer.contact_force[:kept])]
        pairs.append((response.attachment_acceleration[:kept], finer.a[:kept] @ model.axial.T))
        worst = [np.abs(x - y).max(axis=0) / np.maximum(np.abs(y).max(axis=0), 1e-300) for x, y in pairs if np.any(y)]
        found["integration"] = SAFETY * float(max((w.max() for w in worst), default=0.0))
    body = model.scene.housing
    if body is not None:
        from ..reduction.error import reduction_error

        found["reduction"] = reduction_error(body, band_hz).response
    return found
