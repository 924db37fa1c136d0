r"""Gears that their shafts tilt against each other, and the load along the face width that tilts them further.

At a torque the train carries its steady torques times that torque over the one that the mesh has in steady running. Its
tilts t and the moments M of the contact about the middle of the common width hold each other
(`gearfe.drivetrain.train.misalignment`):

.. math:: t = t_0 - C\,\bar M(t),

with :math:`\bar M` the mean over the positions: shafts do not follow single teeth. Newton's method solves it with the
tangent of the contact at constant torque. Manufacturing tilts of the file are added to t in the contact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.errors import InputError
from ...base.progress import Stopwatch
from ...base.tables.gearbox import FROM_SHAFTS, NamedMesh
from ...base.tables.jobs import train_tables
from ...base.typing import Array
from ...gears.gearmesh.job import StiffnessJob
from ...gears.gearmesh.width_job import MOST_GAP, axial_sense, map_angles, stiffness_angles
from ...gears.width import ContactLines, Misalignment, WidthSweep, sweep_width
from ..train.misalignment import TiltingTrain
from .job import train_job
from .mesh_stiffness import carried_torque
from .springs_train import tilting_train

if TYPE_CHECKING:
    from ...base.tables.loadmap import LoadMapTable

#: Newton steps at a torque; a tilt is found when it is so near (relative, and in m over the common width).
STEPS, CLOSE, CLOSE_M = 20, 1e-3, 1e-9


@dataclass(frozen=True, eq=False)
class ShaftTilts:
    """How the shafts of a train tilt the gears of a mesh.

    Attributes
    ----------
    mesh
        The mesh, on the flanks that the train presses.
    train
        The train at rest.
    torque
        At the driven gear of the mesh under the steady torques of the train (N m).
    """

    mesh: NamedMesh
    train: TiltingTrain
    torque: float


@dataclass(frozen=True, eq=False)
class TiltedSweep:
    """Contact over the face width at m torques, at the tilts that shafts and contact agree on.

    Attributes
    ----------
    sweep
        The contact.
    lines
        Lines of contact at the tilts of the last torque.
    tilts, before : ndarray, shape (m, 2)
        By the shafts, in the plane of action and across it (rad); and those by the force in the middle of the width.
    moments : ndarray, shape (m, 2)
        Means of the contact about that middle (N m), > 0: more load at larger y.
    steps : ndarray, shape (m,)
        Steps of Newton's method.
    residual : ndarray, shape (m,)
        By how much contact and shafts disagree in the end (rad).
    """

    sweep: WidthSweep
    lines: ContactLines
    tilts: Array
    before: Array
    moments: Array
    steps: Array
    residual: Array

    @property
    def settled(self) -> Array:
        """Which torques have their tilts, shape (m,)."""
        return np.asarray(np.isfinite(self.residual))

    @property
    def warnings(self) -> list[str]:
        """Return sentences on torques whose tilts were not found."""
        count = int(np.count_nonzero(~self.settled))
        sentence = f"{count} torques have no tilt that shafts and contact agree on: their results are of the last step"
        return [sentence] if count else []


def shaft_tilts(raw: dict[str, Any], path: str | Path, mesh: NamedMesh, variant: str | None = None) -> ShaftTilts:
    """Return how the shafts of a parsed job tilt the gears of one of its meshes.

    Parameters
    ----------
    raw : dict
        The parsed job.
    path : path
        Its file.
    mesh : NamedMesh
        The mesh.
    variant : str, optional
        Variant of [train].

    Raises
    ------
    InputError
        For a file without a train, mistakes in the train, and a mesh that carries no torque in it.
    """
    where = f"{mesh.where}.{FROM_SHAFTS}"
    if "train" not in raw:
        problem = "needs the shafts, bearings, drive and loads of a train, and the file has no table [train]"
        raise InputError(where, True, problem, "add it (gearfe new gearbox.toml shows one), or leave this key out")
    job = train_job(path, train_tables(raw, path, variant))
    if mesh.name not in job.gearbox.meshes:
        problem = "is a mesh of planets, whose tilts are not computed"
        raise InputError(where, True, problem, "leave it out; misalignment_um takes a tilt that is known")
    number = list(job.gearbox.meshes).index(mesh.name)
    statics = tilting_train(job, number)
    model = statics.model
    torque = carried_torque(model.train, number)
    if not torque > 0.0:
        problem = "needs a torque that bends the shafts, and the mesh carries none in steady running of the train"
        raise InputError(where, True, problem, "add a load ([[train.loads]])")
    kinematics = model.kinematics
    left = kinematics.senses[number] * kinematics.steady_forces[number] > 0.0
    return ShaftTilts(replace(mesh, flank="left" if left else "right"), statics, torque)


def job_tilts(
    job: StiffnessJob, lines: ContactLines, shafts: ShaftTilts, loads: LoadMapTable | None, watch: Stopwatch | None
) -> TiltedSweep:
    """Solve the contact of [stiffness], or of the torques of a load map, with gears that the shafts tilt.

    Parameters
    ----------
    job : StiffnessJob
        The mesh, with the flanks of `shafts`.
    lines : ContactLines
        Its lines of contact.
    shafts : ShaftTilts
        The train.
    loads
        [loadmap]; None: [stiffness].
    watch
        Takes the time of the stages.

    Raises
    ------
    InputError
        For a twist, which does not say how the shafts bend, and what `tilted_sweep` refuses.
    """
    if loads is not None:
        return tilted_sweep(job, lines, shafts, loads.torques(), map_angles(job, loads), watch)
    if job.table.torque_Nm is None:
        problem = f"is no load that bends shafts: {FROM_SHAFTS} of {shafts.mesh.where} needs a torque"
        raise InputError("stiffness.twist_deg", job.table.twist_deg, problem, "give torque_Nm instead")
    return tilted_sweep(job, lines, shafts, [job.table.torque_Nm], stiffness_angles(job), watch)


def tilted_sweep(
    job: StiffnessJob,
    lines: ContactLines,
    shafts: ShaftTilts,
    torques: Sequence[float],
    angles: Array,
    watch: Stopwatch | None = None,
) -> TiltedSweep:
    """Solve the contact at the tilts that the shafts have under each torque with the moments of the contact.

    Parameters
    ----------
    job : StiffnessJob
        The mesh, with the flanks of `shafts`.
    lines : ContactLines
        Its lines of contact.
    shafts : ShaftTilts
        The train.
    torques
        At the wheel (N m).
    angles : ndarray, shape (n,)
        Pinion angles (rad).
    watch
        Takes the time of the stages.

    Raises
    ------
    InputError
        For torques that the bearings cannot carry, and tilts that are no microgeometry.
    """
    found = [_at_torque(job, lines, shafts, torque, angles, watch) for torque in torques]
    columns = [np.array(values) for values in zip(*(one[1:] for one in found), strict=True)]
    last = tilted(job, lines, columns[0][-1])
    return TiltedSweep(_joined([one[0] for one in found]), last, *columns)


def _at_torque(
    job: StiffnessJob, lines: ContactLines, shafts: ShaftTilts, torque: float, angles: Array, watch: Stopwatch | None
) -> tuple[WidthSweep, Array, Array, Array, int, float]:
    """Sweep, tilts, tilts without moments, moments, steps and residual at one torque (N m)."""
    factor = torque / shafts.torque
    alone = shafts.train.at(factor, np.zeros(2))
    width = lines.compliance.mesh.width
    tilts, steps = alone.tilts, 0
    while True:
        _check_tilts(job, shafts.mesh, tilts, width, torque)
        sweep = sweep_width(tilted(job, lines, tilts), [torque], angles=angles, watch=watch)
        moments, stiffness = contact_moments(job, lines, sweep)
        held = shafts.train.at(factor, moments)
        off = tilts - held.tilts
        near = max(CLOSE * float(np.abs(held.tilts).max()), CLOSE_M / width)
        residual = float(np.abs(off).max())
        if residual <= near:
            return sweep, tilts, alone.tilts, moments, steps, residual
        if steps == STEPS or not math.isfinite(residual):
            return sweep, tilts, alone.tilts, moments, steps, math.nan
        tilts = tilts - np.linalg.solve(np.eye(2) + held.compliance @ stiffness, off)
        steps += 1


def tilted(job: StiffnessJob, lines: ContactLines, tilts: Array) -> ContactLines:
    """Return lines of contact whose axes are tilted by the shafts (rad, in the plane of action and across it), too."""
    given = lines.flanks.misalignment
    more = Misalignment(given.in_plane + axial_sense(job) * float(tilts[0]), given.across + float(tilts[1]))
    return lines.with_flanks(replace(lines.flanks, misalignment=more))


def contact_moments(job: StiffnessJob, lines: ContactLines, sweep: WidthSweep) -> tuple[Array, Array]:
    """Return mean moments of the contact at the first load on the driven gear about the pitch point, and their tangent.

    Parameters
    ----------
    job, lines, sweep
        The mesh, its lines of contact, and their sweep.

    Returns
    -------
    moments : ndarray, shape (2,)
        In the plane of action and across it (N m), > 0: more load at larger y, or moved to the left of the force.
    tangent : ndarray, shape (2, 2)
        Their change with the tilts at a constant torque (N m/rad).
    """
    mesh, forward = lines.compliance.mesh, lines.law.forward
    good = sweep.status[0] == "converged"
    if not good.any():
        return np.full(2, np.nan), np.eye(2)
    z, pair, force = 0.5 * sum(mesh.zone), mesh.sections, sweep.force[0, good]
    arm = np.array([pair.working_centre_distance - pair.pinion_working_radius, 0.0, -z])
    moment = (sweep.moment[0, good, 1] + np.cross(arm, force)).mean(axis=0)
    across, along = np.array([forward.real, forward.imag]), np.array([-forward.imag, forward.real])
    tangent = sweep.tangent[0, good]
    twist = np.maximum(tangent[:, 0, 0], 1e-300)[:, None, None]
    at_torque = (tangent[:, 1:, 1:] - tangent[:, 1:, :1] * tangent[:, :1, 1:] / twist).mean(axis=0)
    seen = np.array([axial_sense(job), 1.0])
    return seen * [moment[:2] @ along, moment[:2] @ across], np.outer(seen, seen) * at_torque


def _check_tilts(job: StiffnessJob, mesh: NamedMesh, tilts: Array, width: float, torque: float) -> None:
    gap, most = float(np.abs(tilts).max()) * width, MOST_GAP * job.pair.pinion.module
    if gap > most:
        problem = (
            f"tilts the gears by {1e6 * gap:.4g} um over their common width at {torque:.4g} N m: must be <= "
            f"{1e6 * most:.4g} um, {MOST_GAP:g} module, the range of microgeometry"
        )
        raise InputError(
            f"{mesh.where}.{FROM_SHAFTS}", True, problem, "stiffen shafts or bearings, or lower the torque"
        )


def _joined(sweeps: Sequence[WidthSweep]) -> WidthSweep:
    """Sweeps of one load each as the sweep of all of them."""
    first = sweeps[0]
    points = {
        own.name: np.concatenate([getattr(one.points, own.name) for one in sweeps]) for own in fields(first.points)
    }
    points["load"] = np.repeat(np.arange(len(sweeps)), [len(one.points.load) for one in sweeps])
    arrays = {
        own.name: np.concatenate([getattr(one, own.name) for one in sweeps])
        for own in fields(first)
        if own.name not in ("angle", "points", "timings")
    }
    return replace(first, points=type(first.points)(**points), timings=sweeps[-1].timings, **arrays)


# --- report ---------------------------------------------------------------------------------------------------------


def tilt_columns(job: StiffnessJob, found: TiltedSweep) -> dict[str, Any]:
    """Return the tilts by the shafts, a row for each torque."""
    over = 1e6 * found.lines.compliance.mesh.width
    torques = [row[np.isfinite(row)] for row in found.sweep.torque]
    return {
        "torque_wheel_Nm": np.array([row.mean() if len(row) else math.nan for row in torques]),
        "f_sh_um": over * found.tilts[:, 0],
        "across_um": over * found.tilts[:, 1],
        "f_sh_of_middle_force_um": over * found.before[:, 0],
        "across_of_middle_force_um": over * found.before[:, 1],
        "misalignment_um": over * found.tilts[:, 0] + job.mesh.misalignment_um,
        "misalignment_across_um": over * found.tilts[:, 1] + job.mesh.misalignment_across_um,
        "moment_in_plane_Nm": found.moments[:, 0],
        "moment_across_Nm": found.moments[:, 1],
        "steps": found.steps,
        "residual_um": over * found.residual,
    }


def tilt_entries(job: StiffnessJob, found: TiltedSweep) -> dict[str, Any]:
    """Return the entries of the summary: the driving flanks, and the tilts by torque."""
    by_torque = {name: values.tolist() for name, values in tilt_columns(job, found).items()}
    return {"misalignment_by_shafts": {"driving_flanks": job.mesh.flank, **by_torque}}


def tilt_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return the lines to print of the entries of the summary."""
    entry = summary["misalignment_by_shafts"]
    lines = [f"{entry['driving_flanks']} flanks drive, as the train turns and is loaded"]
    for i, torque in enumerate(entry["torque_wheel_Nm"]):
        lines.append(
            f"at {torque:.4g} N m the shafts tilt the gears by f_sh {entry['f_sh_um'][i]:.4g} um "
            f"({entry['f_sh_of_middle_force_um'][i]:.4g} um by a force in the middle of the width), across the plane "
            f"of action {entry['across_um'][i]:.3g} um; {entry['steps'][i]} steps, {entry['residual_um'][i]:.2g} um off"
        )
    return lines
