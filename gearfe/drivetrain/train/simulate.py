"""The transient of a train through the core's `integrate`, and what it means: a `TrainResponse`."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.progress import count, stage
from ...base.record_spectrum import FASTEST, OVERSAMPLING
from ...base.typing import Array
from ...fem.reduction.error import response_error
from ...multibody import IntegrationError, Start, Status, Trajectory, constant, integrate
from ...multibody.integrators.integrate import chosen_method
from .gear_train import Drive, Load
from .model import TrainModel
from .parting import Parting, apart_in_steps, beyond_law, parted
from .planetary import mesh_families
from .response import TrainResponse, joined
from .states import TrainStates, train_states
from .statics import ROUND_OFF

#: Share of the nominal speed from which on a drive by torque leaves the speed of the frames of carriers.
OFF_NOMINAL = 0.01
#: Torques whose sum is this part of the largest balance.
BALANCED = 1e-3
#: The finer run shares a little of the error; with this factor the estimate covers it.
SAFETY = 1.5
#: An approach or a bore's displacement beyond this part of the module means that nothing holds any more.
DIVERGED = 0.25
#: A piece holds so many numbers of the state (4 MB) and is evaluated in some ten times that memory ...
PIECE_NUMBERS = 500_000
#: ... but has so many samples at least.
LEAST_SAMPLES = 256
#: What a run counts, piece by piece.
COUNTED = ("steps", "evaluations", "orders", "newton_iterations", "rejected", "compile_seconds")


@dataclass(frozen=True)
class TransientOptions:
    """How a train is integrated, and what is evaluated beside its response.

    Attributes
    ----------
    tolerance
        Of the integration, relative to each coordinate's largest value.
    method
        ``auto``, ``taylor`` or ``implicit``, see `gearfe.multibody.integrators.integrate`.
    estimate
        Estimate the errors. That of the integration comes from a second run with a hundredth of the tolerance and
        shorter steps, that of the housing's reduction holds up to `band_hz` (Hz).
    """

    tolerance: float = 1e-6
    method: str = "auto"
    estimate: bool = False
    band_hz: float = 5000.0


def simulate(model: TrainModel, times: ArrayLike, *, raise_on_failure: bool = True, **options: Any) -> TrainResponse:
    """Integrate a train and evaluate it at the output times.

    Parameters
    ----------
    model
        From `gearfe.drivetrain.train.build_train`.
    times : array_like, shape (n,)
        Output times (s), rising from 0; the steps of the integration do not depend on them.
    raise_on_failure
        Raise where the end is not reached; without it the response as far as it came is returned, with its status.
    options
        Of `TransientOptions`: ``tolerance``, ``method``, ``estimate``, ``band_hz``.

    Raises
    ------
    IntegrationError
        For a run that ended early; its ``result`` is the response.
    """
    made = joined(list(simulate_in_pieces(model, times, **options)))
    if raise_on_failure and made.status != "done":
        raise IntegrationError(made, made.status, made.time_reached, float(np.max(times)))
    return made


def simulate_in_pieces(model: TrainModel, times: ArrayLike, **options: Any) -> Iterator[TrainResponse]:
    """What `simulate` does, handed over piece by piece, so that a long run needs no more memory than a short one.

    The pieces follow each other without gaps; the status of the last one says whether the run reached its end. What is
    no sample (status, statistics, estimates, warnings) holds for the whole run in the last piece.
    """
    t = np.atleast_1d(np.asarray(times, dtype=float))
    if t.size < 2 or not np.isfinite(t).all() or t[0] != 0.0 or not (np.diff(t) > 0).all():
        raise InputError(
            "times", None, "must be at least two rising numbers that begin with 0", "give the output times in s"
        )
    return _pieces(model, t, TransientOptions(**options))


def _pieces(model: TrainModel, t: Array, options: TransientOptions) -> Iterator[TrainResponse]:
    totals, begin, start = _Totals(), 0, model.start
    if options.method == "auto":
        options = replace(options, method=chosen_method(model.system, model.start, float(t[-1])))
    finer = None
    if options.estimate:
        finer = _FinerRun(replace(options, tolerance=max(1e-2 * options.tolerance, 1e-13)), model.start)
    for end in _ends(model, t):
        if begin or end < len(t) - 1:
            count(begin, len(t) - 1, "times")
        clocked = clock.perf_counter()
        with np.errstate(over="ignore", invalid="ignore"):
            trajectory, moved = _run(model, t[begin : end + 1], options, start)
            status, keep, why = _ended(model, trajectory, moved)
        kept = _cut(moved, min(1, begin), keep)
        totals.add(model, trajectory, kept, clock.perf_counter() - clocked)
        last = status != "done" or end == len(t) - 1
        if finer is not None:
            finer.compare(model, t[begin : end + 1], kept, int(trajectory.statistics["steps"]))
        response = response_of(model, kept, status, totals.reached, totals.statistics(model, trajectory))
        if last:
            if begin:
                count(0, 0)  # what follows is no part of the count
            ended = f"of {1e3 * float(t[-1]):.6g} ms: {response.status}{why}"
            yield _whole(model, response, totals, finer, ended, options)
            return
        yield response
        begin, start = end, replace(start, time=float(t[end]), q=moved.q[-1].copy(), v=moved.v[-1].copy())


def _ends(model: TrainModel, t: Array) -> Iterator[int]:
    """Number of the last time of each piece: a piece is as long as its samples and its steps allow."""
    samples = max(LEAST_SAMPLES, PIECE_NUMBERS // model.system.size)
    highest = min(float(model.coupled_frequencies_hz.max(initial=0.0)), FASTEST)
    span = samples / max(2.0 * OVERSAMPLING * highest, 1e-300)
    at = 0
    while at < len(t) - 1:
        far = int(np.searchsorted(t, t[at] + span, side="right")) - 1
        at = min(max(at + 1, min(at + samples, far)), len(t) - 1)
        yield at


def _run(
    model: TrainModel, t: Array, options: TransientOptions, start: Start, longest: float = np.inf
) -> tuple[Trajectory, TrainStates]:
    trajectory = integrate(
        model.system,
        t,
        method=options.method if len(model.modal.eigenvalues) else "implicit",  # which sees that nothing moves
        tolerance=options.tolerance,
        start=start,
        longest=longest,
        raise_on_failure=False,  # the response has its own status
    )
    return trajectory, train_states(model, trajectory)


@dataclass
class _Totals:
    """What a run adds up from piece to piece."""

    seconds: float = 0.0
    reached: float = 0.0
    counted: dict[str, Any] = field(default_factory=dict)
    least: Array = field(default_factory=lambda: np.zeros(0))
    least_at: Array = field(default_factory=lambda: np.zeros(0))
    most: Array = field(default_factory=lambda: np.zeros(0))
    parting: list[Parting] = field(default_factory=list)
    speeds: list[tuple[float, float]] = field(default_factory=list)

    def add(self, model: TrainModel, trajectory: Trajectory, moved: TrainStates, seconds: float) -> None:
        """Count steps and seconds, keep each mesh's least force, its time, the largest size, and when teeth part."""
        self.seconds += seconds - float(trajectory.statistics.get("compile_seconds", 0.0))
        for name in COUNTED:
            if name in trajectory.statistics:
                self.counted[name] = self.counted.get(name, 0) + trajectory.statistics[name]
        force = moved.contact_force
        if not len(self.least):
            self.least, self.most = np.full(force.shape[1], np.inf), np.zeros(force.shape[1])
            self.least_at = np.zeros(force.shape[1])
            self.parting = [Parting() for _ in range(force.shape[1])]
        if len(force):
            ends, apart = apart_in_steps(model, trajectory, float(moved.time[-1]))
            for one, values in zip(self.parting, apart.T, strict=True):
                one.add(ends, values)
            self.reached = float(moved.time[-1])
            low = force.min(axis=0)
            self.least_at = np.where(low < self.least, moved.time[force.argmin(axis=0)], self.least_at)
            self.least = np.minimum(low, self.least)
            self.most = np.maximum(np.abs(force).max(axis=0), self.most)
            torques, rate = model.forces.speed_torques, model.angle(moved.time, 1)
            turned = [over.ratio * rate + moved.v @ model.directions[:, over.direction] for over in torques]
            self.speeds = [
                (min(low, float(speed.min())), max(high, float(speed.max())))
                for (low, high), speed in zip(self.speeds or [(np.inf, -np.inf)] * len(torques), turned, strict=True)
            ]

    def beyond(self, model: TrainModel) -> list[str]:
        """Sentences about torques over speed whose shafts turn faster than they are known for."""
        ends: list[Drive | Load] = [model.train.driven, *model.train.loads]
        ends = [end for end in ends if end.over_speed is not None]
        found = []
        for end, over, (low, high) in zip(ends, model.forces.speed_torques, self.speeds, strict=False):
            known = over.function.breaks
            if known and (low < known[0] or high > known[-1]):
                found.append(
                    f"the torque over speed on shaft {end.shaft} is known from {known[0]:.6g} to {known[-1]:.6g} "
                    f"rad/s, and the speed went from {low:.6g} to {high:.6g}: beyond, the torque of the end holds"
                )
        return found

    def statistics(self, model: TrainModel, trajectory: Trajectory) -> dict[str, Any]:
        """Statistics of the response."""
        return {
            **trajectory.statistics,
            **self.counted,
            "method": trajectory.method,
            "seconds": self.seconds,
            "free_coordinates": model.modal.T.shape[1],
            "redundant_constraints": redundant_names(model),
            "smallest_contact_force_N": self.least.tolist(),
            "steady_forces_N": model.kinematics.steady_forces.tolist(),
            "flanks": [line.description for line in model.meshes],
            "friction_coefficients": [0.0 if x.sliding is None else x.sliding.coefficient for x in model.meshes],
            **parted(self.parting, [line.rigid or line.pulls for line in model.meshes]),
        }

    def pulls(self, model: TrainModel) -> list[str]:
        """Sentences about meshes whose spring pulls."""
        return [
            f"mesh {line.name} pulls: {force:.5g} N at {1e3 * at:.5g} ms; the spring acts both ways, real teeth would "
            "part there"
            for line, force, at, most in zip(model.meshes, self.least, self.least_at, self.most, strict=True)
            if line.pulls and force < -1e-6 * most
        ]


@dataclass
class _FinerRun:
    """A second run beside the first, with a hundredth of the tolerance and steps half as long."""

    options: TransientOptions
    start: Start
    off: Array = field(default_factory=lambda: np.zeros(0))
    size: Array = field(default_factory=lambda: np.zeros(0))

    @stage("error estimates")
    def compare(self, model: TrainModel, t: Array, kept: TrainStates, steps: int) -> None:
        """Go on to the end of the piece `t` and compare forces and accelerations where both runs hold."""
        # where the corners of the curves set the steps, a tolerance alone would repeat them
        longest = 0.5 * float(t[-1] - t[0]) / max(1, steps)
        with np.errstate(over="ignore", invalid="ignore"):
            _, finer = _run(model, t, self.options, self.start, longest)
            one = np.hstack([kept.contact_force, kept.a @ model.axial.T])
            two = np.hstack([finer.contact_force, finer.a @ model.axial.T])
        shared, places = np.searchsorted(finer.time, kept.time), np.arange(len(kept.time))
        inside = shared < len(finer.time)
        one, two = one[places[inside]], two[shared[inside]]
        if not len(self.off):
            self.off = self.size = np.zeros(one.shape[1])
        self.off = np.maximum(self.off, np.abs(one - two).max(axis=0, initial=0.0))
        self.size = np.maximum(self.size, np.abs(two).max(axis=0, initial=0.0))
        if len(finer.time) == len(t):
            self.start = replace(self.start, time=float(t[-1]), q=finer.q[-1].copy(), v=finer.v[-1].copy())

    @property
    def error(self) -> float:
        """Largest error of a force or acceleration, relative to its largest value."""
        return SAFETY * float((self.off / np.maximum(self.size, 1e-300)).max(initial=0.0))


def _whole(
    model: TrainModel,
    response: TrainResponse,
    totals: _Totals,
    finer: _FinerRun | None,
    ended: str,
    options: TransientOptions,
) -> TrainResponse:
    """The last piece with estimates and warnings of the whole run."""
    warnings = model.mesh_notes + model.operating.warnings + totals.pulls(model) + _loose(model)
    warnings += totals.beyond(model) + unbalanced(model) + _frames(model, response)
    if response.status == "done":
        warnings += _late_ramps(model, response.time_reached)
    else:
        warnings.append(f"the run ended at {1e3 * response.time_reached:.6g} ms {ended}")
    estimates: dict[str, float] = {}
    if finer is not None:
        estimates["integration"] = finer.error
        if model.train.housing is not None:
            estimates["reduction"] = response_error(model.train.housing, options.band_hz)
    return replace(response, estimates=estimates, warnings=tuple(warnings))


def _late_ramps(model: TrainModel, end: float) -> list[str]:
    """Return sentences about ramps that begin at the end of the run (s) or later."""
    train = model.train
    ramps = [("drive", train.driven.speed), ("drive", train.driven.torque or constant(0.0))]
    ramps += [(f"load {number} on shaft {load.shaft}", load.torque) for number, load in enumerate(train.loads, 1)]
    ramps += [(f"force {number} on shaft {force.shaft}", force.over) for number, force in enumerate(train.forces, 1)]
    return [
        f"the ramp of the {name} begins at {1e3 * ramp.breaks[0]:.6g} ms, and the run ends at {1e3 * end:.6g} ms: it "
        "never acts; begin the ramp earlier, or simulate longer"
        for name, ramp in ramps
        if ramp.breaks and ramp.breaks[0] >= end
    ]


def unbalanced(model: TrainModel) -> list[str]:
    """Return a sentence about torques over speed that do not balance at the speed that counts as steady."""
    train, drive = model.train, model.train.driven
    ends: list[Drive | Load] = [drive, *train.loads]
    if drive.torque is None or all(end.over_speed is None for end in ends):
        return []
    parts = []
    for end in ends:
        if end.torque is not None:
            steady = replace(end.torque, sines=())
            ratio = float(model.ratios[train.shaft_number(end.shaft)])
            parts.append(ratio * float(steady(max(steady.breaks, default=0.0))))
    left = sum(parts)
    if abs(left) <= BALANCED * max(map(abs, parts), default=0.0):
        return []
    return [
        f"the torques over speed do not balance at the speed that counts as steady: {left:.4g} N m are left on the "
        "drive; bearings and misalignment are those of that speed: give as speed_rad_per_s one near that at which they "
        "balance, or curves that reach it"
    ]


def _frames(model: TrainModel, response: TrainResponse) -> list[str]:
    """Sentences about what the frames of carriers leave out."""
    train, said = model.train, list[str]()
    said += [
        f"bearing forces of shaft {shaft.name} are sums of parts in frames that turn at different speeds: their size "
        "and direction across the axis hold for none of them"
        for shaft in train.shafts
        if train.carriers and train.between_frames(shaft.name)
    ]
    if train.carriers and train.driven.torque is not None and len(response.time):
        late = response.speed[3 * len(response.time) // 4 :, train.shaft_number(train.driven.shaft)]
        nominal, mean = model.steady_speed, float(late.mean())
        if abs(mean - nominal) > OFF_NOMINAL * abs(nominal):
            said.append(
                f"the drive turns at {mean:.5g} rad/s in the end, but the frames of the carriers, with Coriolis and "
                f"centrifugal forces, follow the nominal {nominal:.5g} rad/s: give that speed as speed_rad_per_s"
            )
    return said


def _loose(model: TrainModel) -> list[str]:
    """Sentences about meshes whose teeth may part and that nothing presses together in steady running."""
    forces = np.abs(model.kinematics.steady_forces)
    return [
        f"no load keeps the teeth of mesh {line.name} in contact: what they do depends on how they begin, and without "
        "damping it does not settle"
        for line, idle in zip(model.meshes, forces <= ROUND_OFF * forces.max(initial=0.0), strict=True)
        if idle and not (line.rigid or line.pulls)
    ]


def _ended(model: TrainModel, trajectory: Trajectory, moved: TrainStates) -> tuple[str, int, str]:
    """Status, the number of output times up to which the results hold, and what moved too far."""
    limit = DIVERGED * min((line.module for line in model.meshes), default=1e-3)
    reach = np.abs(moved.approach) if model.meshes else np.zeros((len(moved.q), 1))
    with np.errstate(invalid="ignore"):  # of motions that are not finite
        shafts = np.abs(moved.q @ model.displaced)
    worst = np.maximum(reach.max(axis=1), shafts.max(axis=1))
    bad = ~np.isfinite(moved.q).all(axis=1) | ~(worst <= limit)
    if bad.any():
        at = int(np.argmax(bad))
        return "diverged", at, _too_far(model, reach[at], shafts[at], limit)
    beyond = beyond_law(model, moved)
    if beyond is not None:
        return "beyond the mesh law", *beyond
    return ("diverged" if trajectory.status is Status.NOT_FINITE else trajectory.message), len(moved.time), ""


def _too_far(model: TrainModel, reach: Array, shafts: Array, limit: float) -> str:
    """What passed the limit: the motion may be bounded, but the gears' geometry no longer holds."""
    if not (np.isfinite(reach).all() and np.isfinite(shafts).all()):
        return ""
    if reach.max() > limit:
        what, size = f"mesh {model.meshes[int(reach.argmax())].name} deflects", reach.max()
    else:
        what, size = f"shaft {model.train.shafts[int(shafts.argmax()) // 3].name} moves", shafts.max()
    return (
        f"; {what} by {1e3 * size:.3g} mm, more than {DIVERGED:g} module ({1e3 * limit:.3g} mm), where the gears' "
        "geometry no longer holds: lower the load, ramp it up more slowly, or stiffen or damp meshes and bearings"
    )


def _cut(moved: TrainStates, first: int, keep: int) -> TrainStates:
    return TrainStates(*(getattr(moved, name)[first:keep] for name in TrainStates.__dataclass_fields__))


def response_of(
    model: TrainModel, moved: TrainStates, status: str, reached: float, statistics: dict[str, Any]
) -> TrainResponse:
    """Return a motion as a response, without error estimates.

    Parameters
    ----------
    model : TrainModel
        The train.
    moved : TrainStates
        Its states at n times.
    status : str
        ``done``, or why the run ended early.
    reached : float
        Time that was reached (s).
    statistics : dict
        Counts of the integration.
    """
    train, t = model.train, moved.time
    rate, push = (model.angle(t, k)[:, None] * model.ratios for k in (1, 2))
    bodies = 0 if model.housing is None else model.housing.size
    poses, centres = _gear_poses(model, moved)
    speed, common = abs(model.steady_speed), train.kinematics.common_turns
    steady = train.drive.speed.ends if train.drive else False
    sections = model.sections
    return TrainResponse(
        time=t,
        drive_angle=model.angle(t),
        rotation=model.angle(t)[:, None] * model.ratios + moved.q @ model.spin_reference.T,
        bearing_load=moved.bearing,
        bore_acceleration=(moved.a @ model.bore_motion.T).reshape(len(t), -1, 6),
        mesh_names=tuple(line.name for line in model.meshes),
        contact_force=moved.contact_force,
        transmission_error=moved.approach,
        apart=moved.apart,
        drive_torque=moved.drive_torque,
        mesh_power=moved.mesh_power,
        friction_power=moved.friction_power,
        shaft_names=tuple(s.name for s in train.shafts),
        speed=rate + moved.v @ model.spin_reference.T,
        speed_absolute=rate + moved.v @ model.spin.T,
        acceleration=push + moved.a @ model.spin_reference.T,
        acceleration_absolute=push + moved.a @ model.spin.T,
        attachment_names=model.bores,
        attachment_acceleration=moved.a @ model.axial.T,
        gear_names=tuple(g.name for g in train.gears),
        gear_pose=poses,
        gear_centres=centres,
        section_coordinates=None if sections is None else moved.q[:, sections.columns],
        sections=sections,
        modal=moved.q[:, :bodies] if bodies else None,
        modal_velocity=moved.v[:, :bodies] if bodies else None,
        modal_acceleration=moved.a[:, :bodies] if bodies else None,
        mesh_frequencies_Hz=np.array([float(c) for c in train.kinematics.cycles]) * speed / (2 * math.pi),
        shaft_frequencies_Hz=np.abs(model.ratios) * speed / (2 * math.pi),
        common_period_s=float(common) * 2 * math.pi / speed if common and speed and steady else None,
        coupled_frequencies_Hz=model.coupled_frequencies_hz,
        status=status,
        time_reached=reached,
        load_end_s=model.load_end,
        statistics=statistics,
        machine_speed=_machine_speeds(model, moved),
        spring_torque=model.driveline.torques(moved.q, moved.v),
        machine_names=tuple(m.name for m in train.machines),
        coupling_names=tuple(c.name for c in train.couplings),
        carrier_frequencies_Hz={
            c.name: abs(float(model.ratios[train.shaft_number(c.shaft)])) * speed / (2 * math.pi)
            for c in train.carriers
        },
        shared_meshes=tuple(family.meshes for family in mesh_families(train.layout, train.kinematics.phases)),
    )


def _machine_speeds(model: TrainModel, moved: TrainStates) -> Array:
    """Speed of each machine (rad/s), (n, machines)."""
    ratios = [model.ratios[model.train.shaft_number(machine.shaft)] for machine in model.train.machines]
    return model.angle(moved.time, 1)[:, None] * np.array(ratios) + moved.v @ model.driveline.machines.T


def _gear_poses(model: TrainModel, moved: TrainStates) -> tuple[Array, Array]:
    train, frame = model.train, model.train.frame
    poses = np.zeros((len(moved.time), len(train.gears), 6))
    centres = np.zeros((len(train.gears), 3))
    for i, item in enumerate(train.gears):
        k, body = train.shaft_number(item.shaft), model.shafts[train.shaft_number(item.shaft)]
        base = np.array(train.shafts[k].point)
        centres[i] = base + (item.along - float(base @ frame[2])) * frame[2]
        own = moved.q[:, model.first[k] : model.first[k] + body.size]
        turn = own @ body.turn_rows(item.along).T
        poses[:, i, :3] = own @ body.point_rows(centres[i], frame, item.along).T
        turn[:, 2] += model.ratios[k] * model.angle(moved.time)
        poses[:, i, 3:] = turn @ frame
        if model.frame_ratios[k]:  # in axes that stand still; a planet goes round with its carrier
            turns, carrier = model.frame_turns(moved.time, [k])[:, 0], train.carrier_of(item.shaft)
            arm = np.zeros(3)
            if carrier is not None:
                along = np.array(train.shaft(carrier.shaft).point)
                arm = base - along - float((base - along) @ frame[2]) * frame[2]
            poses[:, i, :3] = np.einsum("nij,nj->ni", turns, poses[:, i, :3] + arm) - arm
            poses[:, i, 3:] = np.einsum("nij,nj->ni", turns, poses[:, i, 3:])
    return poses, centres


def redundant_names(model: TrainModel) -> list[str]:
    """Constraints that add nothing: two hinges of a rigid shaft in a rigid housing share five."""
    names = model.system.row_names()
    return [names[i] for i in model.start.freedoms.redundant]
