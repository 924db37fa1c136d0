"""Stiffness of the meshes of a train job: from files or computed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.cache import cache_key
from ...base.errors import InputError
from ...base.progress import stage
from ...base.tables.gearbox import NamedGear, NamedMesh
from ...base.tables.train import MEAN, POTENTIAL
from ...gears.contact.laws import HalfPlane, PairModel, check_alike, check_deviations, check_torque
from ...gears.gearmesh.curve import NO_CYCLE, StiffnessCurve
from ...gears.gearmesh.job import StiffnessJob, cached_curve
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.law_store import cached_law
from ...gears.gearmesh.mesh_table import MeshTable, read_mesh_table
from ...gears.gearmesh.width_law import LEAST_TILT, WidthLaw
from ...gears.geometry.deviation_job import deviations_of, pitch_errors_of
from ...gears.geometry.face import NOMINAL, ToothDeviations
from ...gears.geometry.pair import GearPair, gear_pair
from ..train.gear_train import GearMesh, GearTrain
from .job import Stiffness, TrainJob, back_flanks, job_train

if TYPE_CHECKING:
    from ...gears.contact.laws import ContactLaw
    from ..train.misalignment import TiltingTrain

#: A mesh law is made for so many times the torque in steady running: vibration has room.
ROOM = 5.0
#: Tilt for which a law over the face width is made, in those that its force without room makes, and that it makes with
#: a moment of the force on a sixth of the width; the largest (m over the width), as of mesh_model_tilt_um.
TILT_ROOM, MOST_TILT = 2.0, 500e-6
#: Compliance against tilting, times stiffness of the mesh and square of the width, that is round-off.
RIGID = 1e-9
#: Positions at which the error of a law's stiffness is estimated.
ESTIMATED = 8
#: Positions of a curve at the carried torque.
POSITIONS = 36


def train_curves(
    job: TrainJob,
    files: Sequence[str | Path] = (),
    *,
    estimate: bool = False,
) -> tuple[Stiffness, ...]:
    """Stiffness of each mesh: from `files`, from the file or number its table names, or computed (and cached).

    Parameters
    ----------
    files
        CSV files, one for all meshes or one a mesh; they win over the job's.
    estimate
        Whether computed curves carry an estimate of their error.
    """
    meshes = job.table.meshes
    if files and len(files) not in (1, len(meshes)):
        problem = f"{len(files)} files for {len(meshes)} meshes"
        raise InputError("curve", [str(f) for f in files], problem, "give one for all, or one a mesh")
    train = job_train(job)
    wide = {} if files else _wide(job, train)
    found: list[Stiffness] = []
    tables = [mesh.where for mesh in job.gearbox.meshes.values()]
    for number, (mesh, made) in enumerate(zip(meshes, train.meshes, strict=True)):
        teeth = train.gear(made.driver).gear.teeth
        if files:
            found.append(_read_curve(Path(files[number if len(files) > 1 else 0]), teeth))
        elif mesh.rigid:
            found.append(None)
        elif mesh.stiffness_N_per_m is not None:
            found.append(mesh.stiffness_N_per_m)
        elif mesh.mesh_table is not None:
            file, method = job.path.parent / mesh.mesh_table, job.table.curves.interpolation
            with _key_in_messages(f"{tables[number]}.mesh_table", mesh.mesh_table):
                found.append(read_mesh_table(file, method=method, **_table_roles(train, number)))
        elif mesh.curve is not None:
            with _key_in_messages(f"{tables[number]}.curve", mesh.curve):
                found.append(_read_curve(job.path.parent / mesh.curve, teeth))
        elif number in wide:
            found.append(wide[number])
        elif job.table.model_of(mesh) == POTENTIAL:
            found.append(_computed_law(job, train, number, estimate))
        elif _driving(job, train, number).along_width(places=False) is not None:
            found.append(_computed_spring(job, train, number))
        else:
            curve = _computed_curve(job, train, number, estimate)
            constant = job.table.model_of(mesh) == MEAN
            found.append(curve.interpolant("k_mesh", method="cubic").mean if constant else curve)
    return tuple(found)


def _wide(job: TrainJob, train: GearTrain) -> dict[int, WidthLaw]:
    """Laws over the face width of the meshes that have one, by number; meshes with springs are checked before them."""
    laws = []
    for number, mesh in enumerate(job.table.meshes):
        if mesh.rigid or (mesh.stiffness_N_per_m, mesh.mesh_table, mesh.curve) != (None, None, None):
            continue
        if law_over_width(job, number):
            laws.append(number)
        elif job.table.model_of(mesh) != POTENTIAL and _driving(job, train, number).along_width(places=False):
            _check_wide(job, train, number)
    return _wide_laws(job, train, laws)


def compute_meshes(train: GearTrain) -> GearTrain:
    """Return a train with the mesh law of each mesh that has a model, for `ROOM` times its force in steady running.

    Meshes of equal gears with equal models share the law of the largest force. Laws are kept on disk.

    Raises
    ------
    InputError
        For gears that cannot run together, a mesh that carries no load in steady running, and forces that are too
        large for linear elasticity.
    """
    steady = np.abs(train.kinematics.steady_forces)

    def contact(mesh: GearMesh) -> tuple[Any, ...]:
        return train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance, mesh.stiffness

    laws: dict[str, MeshLaw] = {}
    for mesh in train.meshes:
        model = mesh.stiffness
        if isinstance(model, PairModel):
            most = ROOM * max(
                f for f, other in zip(steady, train.meshes, strict=True) if contact(other) == contact(mesh)
            )
            if not most > 0.0:
                problem = "carries no torque in steady running, so the range of its mesh law is unknown"
                raise InputError(f"mesh {mesh.name!r}", None, problem, "add a load to the train")
            with stage(mesh.name):
                laws[mesh.name] = cached_law(gear_pair(*contact(mesh)[:3]), model, float(most))
    meshes = (replace(mesh, stiffness=laws.get(mesh.name, mesh.stiffness)) for mesh in train.meshes)
    return replace(train, meshes=tuple(meshes))


@contextmanager
def _key_in_messages(key: str, file: str) -> Iterator[None]:
    """Name the key and the file that it gives in errors of that file."""
    try:
        yield
    except InputError as error:
        raise InputError(key, file, error.problem, error.cure) from None


def _table_roles(train: GearTrain, number: int) -> dict[str, Any]:
    """Pitch of the gear that drives, base radius of the driven one, and the latter's phase where it is the pinion."""
    mesh = train.layout.meshes[number]
    pitches = [2.0 * math.pi / abs(gear.teeth) for gear in (mesh.driver, mesh.driven)]
    if not mesh.ring_drives:
        return {"pitch": pitches[0], "driven_base_radius": mesh.driven.base_radius}
    mate = {"mate_pitch": pitches[0], "mate_phase": mesh.mate_phase}
    return {"pitch": pitches[1], "driven_base_radius": mesh.driver.base_radius, **mate}


def _largest_torque(job: TrainJob, number: int) -> float | None:
    """Torque at the wheel (N m) for mesh_model_torque_Nm, that at the driven gear."""
    torque, named = job.table.meshes[number].mesh_model_torque_Nm, job.meshes[number]
    return None if torque is None else torque * (named.ratio if named.ring_drives else 1.0)


def _read_curve(path: Path, teeth: int) -> StiffnessCurve:
    """A curve from a CSV file; without a period in the file, that of the driver."""
    try:
        return StiffnessCurve.from_csv(path)
    except InputError as error:
        if error.problem != NO_CYCLE:
            raise
    return StiffnessCurve.from_csv(path, mesh_cycle=2.0 * math.pi / teeth)


def carried_torque(train: GearTrain, number: int) -> float:
    """Torque (N m) at the wheel of a mesh in steady running, without sign."""
    driven = train.gear(train.meshes[number].driven).gear
    return abs(float(train.kinematics.steady_forces[number])) * driven.base_radius


def _computed_curve(job: TrainJob, train: GearTrain, number: int, estimate: bool) -> StiffnessCurve:
    """Curve of a mesh with the driver as pinion, by [stiffness] or at the torque that the mesh carries."""
    mesh = train.meshes[number]
    one, two = train.gear(mesh.driver).gear, train.gear(mesh.driven).gear
    pair = gear_pair(one, two, mesh.centre_distance)
    tables = _plain_job(job, number, pair)
    deviations, _ = _deviations(job, train, number, pair, tables.law)
    model = replace(tables.model, deviations=deviations)
    if job.table.curves.load in (None, "stiffness"):
        with stage(mesh.name):
            return cached_curve(pair, model, estimate_error=estimate, **tables.sweep)
    torque = carried_torque(train, number)
    if not torque > 0.0:
        problem = 'carries no torque, so train.curves.load = "torque" has no load to compute its curve with'
        raise InputError(f"mesh {mesh.name!r}", None, problem, 'add a load, or write load = "stiffness"')
    count = job.table.curves.positions or POSITIONS
    sweep: dict[str, Any] = {
        "torque": torque,
        "angles": pair.mesh_cycle * np.arange(count) / count,
        "kinematics": tables.table.kinematics,
    }
    with stage(mesh.name):
        return cached_curve(pair, model, estimate_error=estimate, **sweep)


def _computed_spring(job: TrainJob, train: GearTrain, number: int) -> MeshTable:
    """Spring of a mesh whose load varies along the face width, with the driver as pinion.

    The load is the torque that the mesh carries, or that of [stiffness] where train.curves.load says so.
    """
    from ...gears.gearmesh.width_spring import mesh_spring, width_states  # teeth in three dimensions, for these meshes

    mesh, curves = train.meshes[number], job.table.curves
    pair = gear_pair(train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance)
    width = StiffnessJob(_driving(job, train, number), pair, job.path.parent)
    if back_flanks(job, train, number):
        _check_back_flanks(width.mesh)
    count = curves.positions or POSITIONS
    angles = pair.mesh_cycle * np.arange(count) / count
    load: dict[str, float]
    if curves.load == "stiffness":
        width.check_load()
        angles, table = np.radians(width.table.angles_deg(math.degrees(pair.mesh_cycle))), width.table
        load = {} if table.twist_deg is None else {"twist": math.radians(table.twist_deg)}
        if table.torque_Nm is not None:
            load = {"torque": table.torque_Nm}
        label = "stiffness.torque_Nm"
    else:
        load, label = {"torque": carried_torque(train, number)}, f"mesh {mesh.name!r} torque"
        if not load["torque"] > 0.0:
            problem = "carries no torque, so its stiffness along the face width has no load to be computed with"
            raise InputError(f"mesh {mesh.name!r}", None, problem, 'add a load, or write load = "stiffness"')
    if "torque" in load:
        check_torque(pair, PairModel(width.materials), load["torque"], label)
    with stage(mesh.name):
        states = width_states(width, angles, **load)
        mean = job.table.model_of(job.table.meshes[number]) == MEAN
        return mesh_spring(states, pair.mesh_cycle, mean=mean, method=curves.interpolation)


def law_over_width(job: TrainJob, number: int) -> bool:
    """Whether a mesh has a law over the face width; raise `InputError` for a tilt of a law that has none."""
    table, named = job.table.meshes[number], job.meshes[number]
    if job.table.model_of(table) != POTENTIAL:
        return False
    varies = named.along_width(("left", "right"), places=False) is not None
    if table.mesh_model_tilt_um is not None and not varies:
        where = f"mesh {named.name!r} mesh_model_tilt_um"
        problem = "is for loads that vary along the face width, and that of this mesh does not"
        raise InputError(where, table.mesh_model_tilt_um, problem, "leave it out")
    return varies


@dataclass(frozen=True)
class _WideLaw:
    """What the law over the face width of a mesh needs: jobs of driving and back flanks, and its range.

    Attributes
    ----------
    number
        Of the mesh.
    driving, back
        Gears with their driving and back flanks; back is None where these mirror the driving ones or never bear.
    key
        Hash of both: equal ones have the same law.
    most, usual
        Largest force of the law, and the force that the train's parts yield to in its tilt (N).
    """

    number: int
    driving: StiffnessJob
    back: StiffnessJob | None
    key: str
    most: float
    usual: float


def _wide_laws(job: TrainJob, train: GearTrain, numbers: Sequence[int]) -> dict[int, WidthLaw]:
    """Laws over the face width of meshes by number; equal gears and flanks share the one of the widest range."""
    if not numbers:
        return {}
    from ...gears.gearmesh.width_law_store import cached_width_law  # teeth in three dimensions, for these meshes

    plans = [_wide_law(job, train, number) for number in numbers]  # all are checked before the first is computed
    laws: dict[str, WidthLaw] = {}
    for plan in plans:
        if plan.key in laws:
            continue
        alike = [other for other in plans if other.key == plan.key]
        force = rounded_up(max(other.most for other in alike))
        tilt = max(_tilt(job, other) for other in alike)
        with stage(train.meshes[plan.number].name):
            law = cached_width_law(plan.driving, force, tilt)
            if plan.back is not None:
                law = replace(law, back=cached_width_law(plan.back, force, 0.0))
        laws[plan.key] = law
    return {plan.number: laws[plan.key] for plan in plans}


def _wide_law(job: TrainJob, train: GearTrain, number: int) -> _WideLaw:
    """What a mesh's law over the face width needs, with the driver as pinion.

    Raises
    ------
    InputError
        For gears, flanks, friction and loads that such a law does not take.
    """
    from ...gears.gearmesh.width_job import wide_mesh  # teeth in three dimensions, for these meshes
    from ...gears.gearmesh.width_law_store import width_law_parts

    mesh = train.meshes[number]
    pair = gear_pair(train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance)
    _check_wide(job, train, number)
    driving, back = (
        StiffnessJob(replace(job.meshes[number], flank=flank), pair, job.path.parent)
        for flank in _flanks(train, number)
    )
    carried = carried_torque(train, number)
    most = _largest_torque(job, number) or ROOM * carried
    label = f"mesh {mesh.name!r} mesh_model_torque_Nm"
    if not most > 0.0:
        problem = "carries no torque in steady running, so the range of its mesh law is unknown"
        raise InputError(label, None, problem, "give mesh_model_torque_Nm")
    try:
        wide_mesh(driving).check_torque(most, label)
    except InputError as error:
        problem = f"is the largest of its law ({ROOM:g} times the steady one where none is given): {error.problem}"
        raise InputError(label, float(f"{most:.6g}"), problem, "give a smaller load, or mesh_model_torque_Nm") from None
    others = back_flanks(job, train, number) and _flanks_differ(driving.mesh)
    parts = [width_law_parts(flanks) for flanks in ((driving, back) if others else (driving,))]
    usual = max(carried, _largest_torque(job, number) or 0.0)
    radius = pair.wheel.base_radius
    key = cache_key("wide-law", parts)
    return _WideLaw(number, driving, back if others else None, key, most / radius, usual / radius)


def _check_wide(job: TrainJob, train: GearTrain, number: int) -> None:
    """Raise `InputError` for what a law or spring over the face width does not take, with what a train can do."""
    from ...gears.gearmesh.width_job import wide_mesh  # teeth in three dimensions, for these meshes

    named, table = job.meshes[number], job.table.meshes[number]
    mesh = train.meshes[number]
    pair = gear_pair(train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance)
    wide_mesh(StiffnessJob(_driving(job, train, number), pair, job.path.parent))
    cause, _ = named.along_width(("left", "right"), places=False) or ("", None)
    if table.friction or table.roughness_um:
        key = "friction" if table.friction else "roughness_um"
        problem = f"needs forces of single tooth pairs, and {cause} makes the load vary along the face width"
        cure = f"leave it out, or {cause}"
        raise InputError(f"mesh {named.name!r} {key}", getattr(table, key), problem, cure)
    for side in named.gears:
        if any(pitch_errors_of(side, train.gear(side.name).gear, job.path.parent)):
            problem = (
                f"has pitch errors, and {cause} makes the load vary along the face width, for which teeth are alike"
            )
            cure = f"leave them out, or {cause}"
            raise InputError(side.microgeometry_where or side.where, None, problem, cure)


def rounded_up(value: float) -> float:
    """A positive number with three digits, at least as large up to round-off: forces that differ by it become alike."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.ceil(float(f'{value / step:.6g}')) * step:.3g}")


def _tilt(job: TrainJob, plan: _WideLaw) -> float:
    """Largest tilt (rad) of a law: of the file, or that which shafts, bearings and housing need at the usual force."""
    from ...gears.gearmesh.width_job import wide_mesh
    from .springs_train import tilting_train

    width = wide_mesh(plan.driving).width
    given = job.table.meshes[plan.number].mesh_model_tilt_um
    if given is not None:
        return 1e-6 * given / width
    statics = tilting_train(job, plan.number)
    return usual_tilt(statics, plan.usual, width)


def usual_tilt(statics: TiltingTrain, force: float, width: float) -> float:
    """Return the tilt (rad) for which the law of a mesh is made; 0: its gears cannot tilt.

    Parameters
    ----------
    statics : TiltingTrain
        The train at rest.
    force : float
        Of the mesh, without sign (N); at least the steady one counts.
    width : float
        Common face width (m).
    """
    line = statics.model.meshes[statics.number]
    steady = float(statics.model.kinematics.steady_forces[statics.number])
    force = max(force, abs(steady))
    at = statics.at(1.0, np.zeros(2), math.copysign(force - abs(steady), steady))
    compliance = float(at.compliance[0, 0])
    if not compliance * line.mean * width**2 > RIGID:
        return 0.0
    tilt = TILT_ROOM * (abs(float(at.tilts[0])) + compliance * force * width / 6.0)
    return float(f"{min(max(tilt, LEAST_TILT / width), MOST_TILT / width):.3g}")


def _driving(job: TrainJob, train: GearTrain, number: int) -> NamedMesh:
    """The mesh with the flanks that its sense of rotation lets drive."""
    return replace(job.meshes[number], flank=_flanks(train, number)[0])


def _flanks(train: GearTrain, number: int) -> tuple[str, str]:
    """Driving and back flanks of a mesh: the left ones drive where the driver turns about the axis of the shafts."""
    return ("left", "right") if train.kinematics.senses[number] > 0.0 else ("right", "left")


def _check_back_flanks(mesh: NamedMesh) -> None:
    """Raise `InputError` for back flanks with other modifications, for which a spring is not computed."""
    for gear in mesh.gears:
        if _sides_differ(gear):
            problem = f"left and right flanks differ, but mesh {mesh.name!r} has one stiffness for both"
            cure = 'make them alike, leave backlash_um out, or write mesh_model = "potential"'
            raise InputError(gear.microgeometry_where, None, problem, cure)


def _sides_differ(gear: NamedGear) -> bool:
    """Whether left and right flanks of a gear have different modifications."""
    given = gear.microgeometry
    return given is not None and given.flank("left") != given.flank("right")


def _flanks_differ(mesh: NamedMesh) -> bool:
    """Whether the back flanks of a mesh are no mirror image of the driving ones."""
    return any(_sides_differ(gear) for gear in mesh.gears)


def _computed_law(job: TrainJob, train: GearTrain, number: int, estimate: bool) -> MeshLaw:
    """Mesh law of a mesh with the driver as pinion; meshes of the same gears share the one for the largest torque."""

    mesh = train.meshes[number]
    pair = gear_pair(train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance)
    tables = _plain_job(job, number, pair)
    alike = [i for i in range(len(train.meshes)) if _contact(job, train, i) == _contact(job, train, number)]
    steady = max(carried_torque(train, i) for i in alike)
    most = _largest_torque(job, number) or ROOM * steady
    if not most > 0.0:
        problem = "carries no torque in steady running, so the range of its mesh law is unknown"
        raise InputError(f"mesh {mesh.name!r} mesh_model_torque_Nm", None, problem, "give mesh_model_torque_Nm")
    deviations, back = _deviations(job, train, number, pair, HalfPlane())
    model = replace(tables.model, law=HalfPlane(), deviations=deviations)
    with stage(mesh.name):
        try:
            law = cached_law(pair, model, most / pair.wheel.base_radius)
            if back != deviations:
                other = replace(model, deviations=back)
                law = replace(law, back=cached_law(pair, other, most / pair.wheel.base_radius))
        except InputError as error:
            if error.field != "force":
                raise
            problem = f"is the largest of its law ({ROOM:g} times the steady one where none is given): {error.problem}"
            label, cure = f"mesh {mesh.name!r} mesh_model_torque_Nm", "give a smaller load, or mesh_model_torque_Nm"
            raise InputError(label, float(f"{most:.6g}"), problem, cure) from None
        if not estimate:
            return law
        angles = pair.mesh_cycle * np.arange(ESTIMATED) / ESTIMATED
        sweep: dict[str, Any] = {"torque": most / ROOM, "angles": angles, "kinematics": "small"}
        curve = cached_curve(pair, model, estimate_error=True, **sweep)
    fit = max(side.error for side in law.sides)
    return replace(law, error=fit + curve.worst_error)


def _plain_job(job: TrainJob, number: int, pair: GearPair) -> StiffnessJob:
    """The stiffness job of a mesh, whose deviations are those of the flanks that its sense of rotation lets drive."""
    one, two = (replace(gear, microgeometry=None) for gear in job.meshes[number].gears)
    return StiffnessJob(replace(job.meshes[number], driver=one, driven=two), pair, job.path.parent)


def _contact(job: TrainJob, train: GearTrain, number: int) -> tuple[Any, ...]:
    """What decides the mesh law of a mesh, load and deviations apart."""
    mesh, named = train.meshes[number], job.meshes[number]
    gears = train.gear(mesh.driver).gear, train.gear(mesh.driven).gear
    model = replace(named.stiffness, twist_deg=None, torque_Nm=None)
    return gears, mesh.centre_distance, [gear.material for gear in named.gears], model


def _deviations(
    job: TrainJob, train: GearTrain, number: int, pair: GearPair, law: ContactLaw
) -> tuple[tuple[ToothDeviations, ToothDeviations], tuple[ToothDeviations, ToothDeviations]]:
    """Return the deviations of the driving flanks of a mesh, the left ones where the driver turns about the axis of the
    shafts, and those of its back flanks. Back flanks that never carry load get those of the driving flanks. A mesh
    law's have no pitch errors.

    Raises
    ------
    InputError
        For deviations that the law or one mesh cycle cannot have, and where a curve's back flanks bear and are others.
    """
    named = job.meshes[number]
    if not named.deviates:
        return NOMINAL, NOMINAL
    mesh = train.meshes[number]
    driving, back = (deviations_of(named, pair, job.path.parent, flank=flank) for flank in _flanks(train, number))
    mapped = job.table.model_of(job.table.meshes[number]) == POTENTIAL
    if mapped:  # pitch errors are the train's own
        driving, back = ((replace(a, turn=(0.0,)), replace(b, turn=(0.0,))) for a, b in (driving, back))
    if not back_flanks(job, train, number):
        back = driving
    for one in (driving, back):
        check_alike(one)
        check_deviations(one, law)
    if back != driving and not mapped:
        problem = f"left and right flanks differ, but mesh {mesh.name!r} has one curve for both"
        cure = 'write mesh_model = "potential", or give the mesh no backlash'
        wheres = [gear.microgeometry_where for gear in named.gears if gear.microgeometry is not None]
        raise InputError(wheres[0].removesuffix(".pinion").removesuffix(".wheel"), None, problem, cure)
    return driving, back
