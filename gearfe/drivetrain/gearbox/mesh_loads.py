"""Loads of the meshes of a train in steady running, as a rating takes them.

Torques balance on all shafts without losses (`gearfe.drivetrain.train.kinematics`), speeds are those against the
carrier of a planetary stage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from ...base.errors import InputError
from ...base.tables.rating import GearRatingTable, MeshRatingTable, RatingTable
from ..train.gear_train import GearTrain
from ..train.kinematics import against, fastest
from .job import TrainJob

#: Mean stress influence factor of teeth that are loaded on both flanks, ISO 6336-3, annex B: case-hardened idlers.
BOTH_FLANKS = 0.7
#: Force of a mesh (N) below which it carries nothing, over the largest of the train.
IDLE = 1e-9


@dataclass(frozen=True)
class MeshLoad:
    """Load of a mesh; pairs are of its gears, of an internal pair the external one first.

    Attributes
    ----------
    drives
        Number of the gear that drives in these pairs.
    torque
        At the gear that drives, of this mesh alone (N m).
    speed
        Of this gear against the carrier of its stage, without sign (1/min).
    mates
        Meshes of the gear that load the flank of this one.
    both_flanks
        Whether other meshes load the other flank; False where this one carries nothing.
    fixed
        Whether the gear's shaft is held.
    """

    drives: int
    torque: float
    speed: float
    mates: tuple[int, int]
    both_flanks: tuple[bool, bool]
    fixed: tuple[bool, bool]


def mesh_loads(train: GearTrain) -> dict[str, MeshLoad]:
    """Return the load of each mesh by its name."""
    layout, rolled = train.layout, train.kinematics
    speed = 30.0 / math.pi * fastest(layout.speed)
    held = {shaft for shaft, ratio in layout.guided if ratio == 0}
    largest = max((abs(float(force)) for force in rolled.steady_forces), default=0.0)

    def carries(force: float) -> bool:
        return abs(float(force)) > IDLE * largest

    # torque of each mesh on its gears about the axis, by the gear: its sign is that of the flank
    flanks: dict[str, list[float]] = {}
    for mesh, force, sense in zip(layout.meshes, rolled.steady_forces, rolled.senses, strict=True):
        for gear, side in ((mesh.driver, -1.0), (mesh.driven, 1.0 if mesh.turns_alike else -1.0)):
            if carries(force):
                flanks.setdefault(gear.name, []).append(side * sense * float(force))
    found = {}
    for mesh, force, sense in zip(layout.meshes, rolled.steady_forces, rolled.senses, strict=True):
        gears = mesh.driver, mesh.driven
        own = (-sense * float(force), (1.0 if mesh.turns_alike else -1.0) * sense * float(force))
        alike = [
            [other * push > 0.0 for other in flanks.get(gear.name, [])] for gear, push in zip(gears, own, strict=True)
        ]
        found[mesh.name] = MeshLoad(
            drives=int(mesh.ring_drives),
            torque=abs(float(force)) * abs(mesh.driving.base_radius) if carries(force) else 0.0,
            speed=speed * abs(float(against(mesh, mesh.driving.shaft, rolled.ratios))),
            mates=(max(1, sum(alike[0])), max(1, sum(alike[1]))),
            both_flanks=(carries(force) and not all(alike[0]), carries(force) and not all(alike[1])),
            fixed=(mesh.driver.shaft in held, mesh.driven.shaft in held),
        )
    return found


def drive_speed(job: TrainJob, mesh: str, speed: float) -> tuple[int, float]:
    """Return the number of a mesh in the train, from 1 on, and the speed of the drive (rad/s) at one of its driver.

    Parameters
    ----------
    job : TrainJob
        The train.
    mesh : str
        Name of the mesh; of one of planets that is written once the first counts.
    speed : float
        Of the driver of the mesh against the carrier of its stage (1/min).

    Raises
    ------
    InputError
        For mistakes in the train, and a mesh that is not in it.
    """
    train = job.rigid_train
    names = [item.name for item in train.layout.meshes]
    name = mesh if mesh in names else f"{mesh}_1"
    if name not in names:
        problem = f"is not among the meshes of [train]: {', '.join(names)}"
        raise InputError("mesh", mesh, problem, "choose one of them by --mesh, or leave out --runup")
    number = names.index(name)
    item = train.layout.meshes[number]
    ratio = abs(float(against(item, item.driving.shaft, train.kinematics.ratios)))
    return number + 1, speed * math.pi / 30.0 / ratio if ratio else 0.0


def with_train(table: RatingTable, job: TrainJob, mesh: str, gears: tuple[str, str], given: bool) -> RatingTable:
    """Return a table [rating] in which a mesh has the load that the train gives it where the file says nothing.

    Parameters
    ----------
    table : RatingTable
        The table.
    job : TrainJob
        The train.
    mesh : str
        Name of the mesh; one of planets is written once and has the load of the first planet.
    gears : (str, str)
        Names of its gears, of an internal pair the external one first.
    given : bool
        Whether [stiffness] gives the torque.

    Raises
    ------
    InputError
        For mistakes in the train, and a mesh without a speed that the train does not have.
    """
    loads = mesh_loads(job.rigid_train)
    load = loads.get(mesh) or loads.get(f"{mesh}_1")
    if load is None:
        keys = table.of_mesh(mesh, {mesh: None, **table.meshes})
        if keys.speed_rpm is None and not keys.spectrum:
            problem = f"is required: the mesh {mesh} is not in [train], which has {', '.join(loads)}"
            cure = f"add the speed of the driver (1/min) to [rating.meshes.{mesh}], or add the mesh to [train]"
            raise InputError(f"rating.meshes.{mesh}.speed_rpm", None, problem, cure)
        return table
    changed = dict(table.gears)
    for name, mates, both, fixed in zip(gears, load.mates, load.both_flanks, load.fixed, strict=True):
        own = table.gears.get(name, GearRatingTable())
        merged = table.of_gear(name, {name: None, **table.gears})
        more: dict[str, Any] = {}
        if merged.mates is None:
            more["mates"] = mates
        if merged.alternating_factor is None and both:
            more["alternating_factor"] = BOTH_FLANKS
        if merged.fixed is None and fixed:
            more["fixed"] = True
        changed[name] = replace(own, **more)
    return replace(table, gears=changed, meshes=_loaded(table, load, mesh, changed[gears[load.drives]].mates, given))


def _loaded(
    table: RatingTable, load: MeshLoad, mesh: str, mates: int | None, given: bool
) -> dict[str, MeshRatingTable]:
    """Keys of the meshes with torque and speed of one of them, unless the file has them or a load spectrum."""
    own = table.meshes.get(mesh, MeshRatingTable())
    merged = table.of_mesh(mesh, {mesh: None, **table.meshes})
    if merged.spectrum:
        return dict(table.meshes)
    more: dict[str, Any] = {}
    if merged.speed_rpm is None:
        if not load.speed > 0.0:
            problem = f"is required: in [train] the driver of mesh {mesh} does not turn against its mate"
            cure = "add the speed of the driver (1/min), or give train.drive a speed"
            raise InputError(f"rating.meshes.{mesh}.speed_rpm", None, problem, cure)
        more["speed_rpm"] = load.speed
    if merged.torque_driver_Nm is None and not given and load.torque > 0.0:
        more["torque_driver_Nm"] = load.torque * (mates or table.mates or 1)
    return {**table.meshes, mesh: replace(own, **more)}
