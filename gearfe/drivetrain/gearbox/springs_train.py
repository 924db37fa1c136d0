"""The train of a job at rest, with springs as meshes: how far its shafts, bearings and housing let gears tilt."""

from __future__ import annotations

from dataclasses import replace

from ...base.tables.gearbox import Gearbox, NamedMesh
from ...base.tables.pair import MaterialTable
from ...base.tables.train import TrainMeshTable, TrainTable
from ...fem.reduction.modal_body import ModalBody
from ...gears.geometry.pair import gear_pair
from ...gears.rating.stiffness import iso_values
from ..train.gear_train import GearTrain
from ..train.misalignment import TiltingTrain
from ..train.model import build_train
from .job import Stiffness, TrainJob, job_train, train_body


def tilting_train(job: TrainJob, number: int) -> TiltingTrain:
    """Return the train of a job at rest with springs as meshes, and moments on the gears of one mesh."""
    train = springs_train(job, train_body(job))
    meshes = tuple(replace(mesh, moments=i == number) for i, mesh in enumerate(train.meshes))
    return TiltingTrain(build_train(replace(train, meshes=meshes)), number)


def springs_train(job: TrainJob, body: ModalBody | None = None) -> GearTrain:
    """Return the train of a job with the mean stiffness of ISO 6336-1 in each mesh, without friction and deviations.

    Parameters
    ----------
    job : TrainJob
        The job.
    body : ModalBody, optional
        Its housing; None: a rigid one.
    """
    job = replace(job, gearbox=_without_flanks(job.gearbox), table=_with_springs(job.table))
    train = job_train(job, _mean_stiffness(job), body)
    return replace(train, meshes=tuple(replace(mesh, friction=0.0) for mesh in train.meshes))


def _without_flanks(box: Gearbox) -> Gearbox:
    """The gears without deviations and tilts, which statics do not feel."""
    meshes = {
        name: replace(
            mesh,
            misalignment_um=0.0,
            misalignment_across_um=0.0,
            driver=replace(mesh.driver, microgeometry=None),
            driven=replace(mesh.driven, microgeometry=None),
        )
        for name, mesh in box.meshes.items()
    }
    return Gearbox({name: replace(gear, microgeometry=None) for name, gear in box.gears.items()}, meshes)


def _with_springs(table: TrainTable) -> TrainTable:
    """[train] with springs as meshes, whose back flanks, should the loads press them, are as stiff as driving ones."""

    def spring(mesh: TrainMeshTable) -> TrainMeshTable:
        plain = replace(mesh, mesh_model=None, mesh_model_tilt_um=None, curve=None, mesh_table=None, rigid=False)
        return replace(plain, stiffness_N_per_m=1.0, backlash_um=0.0)

    return replace(table, meshes=tuple(spring(mesh) for mesh in table.meshes))


def _mean_stiffness(job: TrainJob) -> tuple[Stiffness, ...]:
    """c_gamma of ISO 6336-1 times the width for each mesh: loops of gears share their torque by it, others do not."""
    train = job_train(job)

    def stiffness(number: int, named: NamedMesh) -> float:
        mesh = train.meshes[number]
        pair = gear_pair(train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance)
        moduli = [1e9 * (gear.material or MaterialTable()).youngs_modulus_GPa for gear in named.gears]
        return float(iso_values(pair, moduli[0], moduli[1])["c_gamma_times_width_N_per_m"])

    return tuple(stiffness(number, named) for number, named in enumerate(job.meshes))
