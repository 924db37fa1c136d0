r"""Gear trains: random curves, any damping, resonance, parametric instability, symmetry, random housings.

Each case is a [train] job with its stiffness curves beside it. Checks of a run that reached its end:

- *estimate*: the contact forces differ from those of a run at a tolerance of 1e-11 by no more than ten times the
  estimate of the integration's error that the run states;
- *floquet* and *seen*: what repeats with the period T obeys d(t + T) = Phi d(t) for d(t) = y(t + T) - y(t), so d grows
  by the largest multiplier that the analysis found: an instability found is an instability seen, and the other way
  round;
- *mean*: a damped train in its steady state carries the static force on average;
- *axial*, *tilt*, *mirror*: spur gears push nothing along the axis, symmetric scenes do not tilt, and a symmetric
  elastic housing stays its own mirror image (it takes the place of the job's rigid bores; no job can ask for one);
- *order*: half the step, kept fixed, divides the error by 2^7 (Taylor) or 2^5 (implicit), scenes without corners;
- *plain*: torques that change sign behind backlashes give the motion of the plain equations
  J_i u_i'' = M_i - sum s r_b F, F = k(phi) (x - gap) + d x', which scipy integrates from touch to touch;
- *settled*: damped trains with constant stiffness end at the static force, however long the steps are beside the
  fastest vibration.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from gearfe.drivetrain.gearbox.job import job_train, read_train_job, train_body
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.runup.train_stability import train_stability
from gearfe.drivetrain.train import TrainModel, TrainResponse, build_train, simulate
from gearfe.drivetrain.train.states import train_states
from gearfe.multibody import integrate

from .campaign import Campaign, Case
from .frames import symmetric_frame
from .outcome import Check, Finding
from .rows import KINDS, row
from .toml_text import toml_text

#: Periods over which growth is measured, the second half of them counting.
PERIODS = 60
#: Multipliers within this share of 1 are neither found stable nor unstable.
MARGIN = 0.02
TRUTH = 1e-11
#: Order of the error at the loosest tolerance: series begin with that, Radau IIA has 5.
LEAST_ORDER = {"taylor": 7.0, "implicit": 5.0}
#: Fixed steps that an order is measured with, at most.
MOST_STEPS = {"taylor": 3000, "implicit": 300}


def draw(random: np.random.Generator, number: int) -> Case:
    """Kinds take turns; one in forty trains has a real housing."""
    kind = "housing" if number % 40 == 39 else KINDS[number % len(KINDS)]
    tables, files, data = row(random, kind)
    return Case(number, kind, {"job.toml": toml_text(tables), **files}, "gearfe vibration job.toml --out out", data)


def run(case: Case, folder: Path) -> Finding:
    """Build, simulate, check."""
    job = read_train_job(case.write(folder))
    curves = train_curves(job)
    body, reflect = train_body(job), None
    if "frame" in case.data:
        bores = job.table.rigid_bores
        points = 1e-3 * np.array([[b.x_mm, b.y_mm, b.z_mm] for b in bores])
        random = np.random.default_rng(int(case.data["frame"]))
        body, reflect = symmetric_frame(random, tuple(str(b.attachment) for b in bores), points)
    train = job_train(job, curves, body)
    model = build_train(train)
    measures: dict[str, Any] = {"frequencies": len(model.coupled_frequencies_hz), "shafts": len(train.shafts)}
    if case.kind == "floquet":
        return _floquet(model, measures)
    table = job.table
    made = simulate(
        model, job.times, tolerance=table.tolerance, method=table.method, estimate=case.kind != "stiff",
        raise_on_failure=False,
    )  # fmt: skip
    measures |= {"method": made.statistics.get("method", ""), "steps": made.statistics.get("steps", "")}
    measures |= {"tolerance": table.tolerance, **{f"estimate_{k}": v for k, v in made.estimates.items()}}
    if made.status != "done":
        found = train_stability(model).multipliers
        told = "" if found is None else f", largest multiplier {abs(found[0]):.4g}"
        return Finding("stopped", f"{made.status} at {made.time_reached:.4g} s{told}", (), measures)
    checks = []
    if case.kind == "stiff":
        checks += _settled(model, made, measures)
    else:
        checks += _against_truth(model, job.times, made, measures, smooth=bool(case.data["smooth"]))
    if case.kind == "resonance":
        checks += _mean_force(train, made)
    if case.kind == "rattle":
        checks += _plain(model, job.times, made)
    if case.kind == "symmetric":
        checks += _symmetry(made, reflect)
    return Finding("done", "; ".join(made.warnings)[:200], checks, measures)


def _against_truth(
    model: TrainModel, times: Any, made: TrainResponse, measures: dict[str, Any], *, smooth: bool
) -> list[Check]:
    """Contact forces against a far finer run, relative to the largest of each mesh; smooth scenes: the order, too."""
    truth = simulate(model, times, tolerance=TRUTH, method="taylor", raise_on_failure=False)
    if truth.status != "done" or "integration" not in made.estimates:
        return []
    scale = np.maximum(np.abs(truth.contact_force).max(axis=0, initial=0.0), 1e-300)
    off = (np.abs(made.contact_force - truth.contact_force).max(axis=0, initial=0.0) / scale).max(initial=0.0)
    measures["error"] = float(f"{off:.3g}")
    checks = [Check("estimate", float(off), 10.0 * made.estimates["integration"] + 1e-9)]
    if smooth:
        checks += _order(model, times, str(made.statistics["method"]), truth.contact_force)
    return checks


def _order(model: TrainModel, times: Any, method: str, truth: Any) -> list[Check]:
    """What is missing of the methods' least orders, from two runs with fixed steps."""
    fastest = 2.0 * math.pi * float(model.coupled_frequencies_hz.max(initial=1.0))
    step = (2.0 if method == "implicit" else 1.0) / fastest  # radians of the fastest vibration; shorter: only rounding
    if times[-1] / step > MOST_STEPS[method]:
        return []
    errors = []
    for longest in (step, 0.5 * step):
        options: dict[str, Any] = {"method": method, "tolerance": 0.1, "start": model.start, "raise_on_failure": False}
        made = integrate(model.system, times, longest=longest, **options)
        if made.status != 0:
            return [Check("order", math.inf, 1.0)]
        errors.append(float(np.abs(train_states(model, made).contact_force - truth).max() / np.abs(truth).max()))
    if errors[1] < 1e-12:  # rounding
        return []
    missing = LEAST_ORDER[method] - math.log2(errors[0] / errors[1])
    return [Check("order", missing, 1.0)]


def _settled(model: TrainModel, made: TrainResponse, measures: dict[str, Any]) -> list[Check]:
    """Contact forces at the end against statics; notes how far a step goes in the fastest vibration (rad)."""
    own = 2.0 * math.pi * model.coupled_frequencies_hz
    half, end = 0.5 * model.train.damping.alpha, float(made.time[-1])
    measures["step_rad"] = float(f"{own.max(initial=0.0) * end / max(1, int(made.statistics['steps'])):.3g}")
    slowest = half - math.sqrt(max(half**2 - float(own.min(initial=half)) ** 2, 0.0))  # less when it creeps
    off = np.abs(np.abs(made.contact_force[-1]) / np.abs(model.kinematics.steady_forces) - 1.0)
    left = 100.0 * math.exp(-slowest * end) + 30.0 * float(measures["tolerance"])
    return [Check("settled", float(off.max()), 1e-8 + left)]


def _plain(model: TrainModel, times: Any, made: TrainResponse) -> list[Check]:
    """Approaches of a row of shafts that only turn against scipy's DOP853, in parts of the largest.

    Its steps end at no touch, and the motion may be chaotic: both errors grow alike, so the estimate limits the second.
    """
    train, rolled = model.train, model.kinematics
    inertia = np.array([shaft.rotor.polar for shaft in model.shafts])
    senses, turning = np.array(rolled.senses), model.ratios[:-1] * model.steady_speed
    arms = np.array([[train.gear(name).gear.base_radius for name in (m.driver, m.driven)] for m in train.meshes])
    curves = [mesh.interpolant() for mesh in train.meshes]
    gaps, damping = (np.array([getattr(m, name) for m in train.meshes]) for name in ("backlash", "damping"))
    in_contact = np.array([mesh.damps_in_contact for mesh in train.meshes])
    count = len(curves)

    def approach(turns: Any) -> Any:
        turns = np.concatenate([[0.0], turns])  # the drive holds the first shaft to its speed
        return senses * (arms[:, 0] * turns[:-1] + arms[:, 1] * turns[1:])

    def slope(t: float, y: Any) -> Any:
        turns, rates = y[:count], y[count:]
        x = approach(turns)
        phase = senses * (turning * t + np.concatenate([[0.0], turns[:-1]])) + np.array(rolled.phases)
        deep = np.where(x > 0.0, x, np.minimum(x + gaps, 0.0))
        stiffness = [
            float(curve(place if d >= 0.0 else -place).value)
            for curve, place, d in zip(curves, phase, deep, strict=True)
        ]
        push = senses * (stiffness * deep + damping * np.where(in_contact & (deep == 0.0), 0.0, approach(rates)))
        moment = -np.concatenate([[0.0], push * arms[:, 1]]) - np.concatenate([push * arms[:, 0], [0.0]])
        moment[-1] += sum(float(load.torque(t)) for load in train.loads)
        return np.concatenate([rates, moment[1:] / inertia[1:]])

    ran = solve_ivp(slope, (0.0, times[-1]), np.zeros(2 * count), "DOP853", t_eval=times, rtol=1e-12, atol=1e-18)
    plain = np.array([approach(turns) for turns in ran.y[:count].T])
    reached = made.transmission_error[: len(plain)]  # scipy may give up at a jump of the dampers' forces
    off = np.abs(reached - plain).max(axis=0) / np.abs(plain).max(axis=0)
    return [Check("plain", float(off.max()), 1e-4 + 10.0 * made.estimates["integration"])]


def _mean_force(train: Any, made: Any) -> list[Check]:
    """Mean contact force over the last whole common periods against statics: accelerations have no mean."""
    period = made.common_period_s
    if not period:
        return []
    step = made.time[1] - made.time[0]
    count = int(0.25 * made.time[-1] / period) * round(period / step)
    if count < 50 or abs(period / step - round(period / step)) > 1e-6:
        return []
    wanted = np.abs(train.kinematics.steady_forces)
    mean = np.abs(made.contact_force[-count:].mean(axis=0))
    swing = np.ptp(made.contact_force[-count:], axis=0)
    # what is left of the start after the run, and the mean of a sampled swing
    return [Check("mean", float((np.abs(mean - wanted) / (wanted + 0.1 * swing)).max()), 0.02)]


def _symmetry(made: TrainResponse, reflect: Any) -> list[Check]:
    poses = made.gear_pose
    along = float(np.abs(poses[:, :, 1]).max())
    tilt = float(np.abs(poses[:, :, [3, 5]]).max())
    radial = float(np.abs(poses[:, :, [0, 2]]).max())
    size = float(np.abs(made.gear_centres).max()) + 1e-2
    checks = [
        Check("axial", along / max(radial, 1e-300), 1e-9),
        Check("tilt", tilt * size / max(radial, 1e-300), 1e-9),
    ]
    if reflect is not None:
        assert made.modal is not None
        moved = made.modal * np.tile([1.0, 1.0, 1.0, size, size, size], made.modal.shape[1] // 6 + 1)[: len(reflect)]
        off = float(np.abs(moved - moved @ reflect.T).max())
        checks.append(Check("mirror", off / max(float(np.abs(moved).max()), 1e-300), 1e-9))
    return checks


def _floquet(model: TrainModel, measures: dict[str, Any]) -> Finding:
    made = train_stability(model)
    found, turns = made.multipliers, model.kinematics.common_turns
    if found is None or turns is None:
        return Finding("refused", f"no multipliers: {made.note or model.kinematics.note}", (), measures)
    largest = abs(found[0])
    period = float(turns) * 2 * math.pi / abs(model.steady_speed)
    times = period * np.arange(PERIODS + 1)
    options: dict[str, Any] = {
        "method": "taylor",
        "tolerance": 1e-10,
        "start": model.start,
        "raise_on_failure": False,
    }
    trajectory = integrate(model.system, times, **options)
    if trajectory.status != 0:
        return Finding("stopped", trajectory.message, (), measures)
    moved = train_states(model, trajectory)
    size = np.abs(model.coupled_frequencies_hz[model.coupled_frequencies_hz > 0]).max(initial=1.0) * 2 * math.pi
    state = np.hstack([moved.q * size, moved.v])
    steps = np.linalg.norm(np.diff(state, axis=0), axis=1)
    lived = int(
        np.argmax(np.append(steps < 1e-6 * np.maximum.accumulate(steps), True))
    )  # below: the integration's error
    steps = steps[:lived]
    half = lived // 2
    measures |= {"largest_multiplier": float(f"{largest:.6g}")}
    if lived < 6 or not (np.isfinite(steps).all() and steps[-1] > 0.0):
        return Finding("done", "the difference of periods has died out", [Check("floquet", largest, 1.0)], measures)
    growth = float((steps[-1] / steps[half]) ** (1.0 / (len(steps) - 1 - half)))
    measures |= {"growth_seen": float(f"{growth:.6g}")}
    seen = [Check("seen", float(growth < 1.0 + 0.2 * (largest - 1.0)), 0.5)] if largest > 1.0 + MARGIN else []
    quiet = [Check("quiet", growth, 1.0 + MARGIN)] if largest < 1.0 - MARGIN else []
    rate = []
    if largest > 1.05:
        rate = [Check("floquet", abs(math.log(growth) / math.log(largest) - 1), 0.15)]
    return Finding("done", "", [*seen, *quiet, *rate], measures)


CAMPAIGN = Campaign("trains", 400, (1, 2, 3, 4, 8, 9, 10), 180.0, draw, run, compiles=True)
