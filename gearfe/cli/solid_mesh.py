"""What `gearfe mesh` does for gears whose load varies along the face width: meshes and decks in space."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import InputError
from ..base.progress import stage

if TYPE_CHECKING:
    from ..base.tables.gearbox import NamedMesh
    from ..base.tables.pair import StiffnessTable
    from ..gears.gearmesh.job import StiffnessJob
    from ..gears.geometry.pair import GearPair
    from ..gears.width import WidthSweep
    from ..output.exchange.mesh_export import MeshPart, Part

#: Elements of the flanks in those of sections in the plane: a mesh in space has them in every layer.
FLANK_COARSEN = 1.5
#: Distance (m) at which the flanks of a deck begin, so that contact starts without overlap.
APART = 1e-6


def write_solid_mesh(
    args: argparse.Namespace, mesh: NamedMesh, table: StiffnessTable, pair: GearPair
) -> tuple[dict[str, Part], dict[str, MeshPart], dict[str, float]]:
    """Write a mesh or a deck of gears in space; return its parts, their sections and the deck's solution.

    Parameters
    ----------
    args : Namespace
        Parsed command line.
    mesh, table, pair
        The mesh of two gears, its [stiffness], and its gears.

    Raises
    ------
    InputError
        For tilts that come from a train, and positions without a solution.
    """
    if mesh.misalignment_from_shafts:
        problem = "gives tilts by the load of a train, which a mesh of finite elements does not have"
        raise InputError(f"{mesh.where}.misalignment_from_shafts", True, problem, "give misalignment_um instead")

    from ..gears.gearmesh import width_job
    from ..gears.gearmesh.job import stiffness_job
    from ..output.exchange.mesh_export import export_mesh

    job = stiffness_job(replace(mesh, stiffness=table), Path(args.job).parent, pair)
    width_job.check_stiffness_job(job)
    if args.deck:
        return _deck(args, job)
    parts, sections = _parts(args, job, -pair.contact_twist, (set(), set()))
    with stage("writing"):
        export_mesh(args.out, parts)
    return parts, sections, {}


def _parts(
    args: argparse.Namespace, job: StiffnessJob, twist: float, loaded: tuple[set[int], set[int]]
) -> tuple[dict[str, Part], dict[str, MeshPart]]:
    """The gears in space at a twist (rad) from where unmodified flanks touch, and their sections at z = 0.

    `loaded`: numbers of the teeth of both gears that have fine flanks in any case; without any, all or the nearest.
    """
    import numpy as np

    from ..gears.gearmesh.solid_parts import gear_solid, graded_levels
    from ..gears.gearmesh.width_job import wide_flanks, wide_mesh
    from ..gears.teeth.tooth_sector import sector_mesh, sector_recipes
    from ..gears.teeth.whole_gear import in_mesh, mixed_gear, teeth_near
    from ..output.exchange.mesh_export import MeshPart

    mesh, pair = wide_mesh(job), job.pair
    flanks = wide_flanks(job, mesh)
    flank = FLANK_COARSEN * job.table.flank_coarsen
    recipes = sector_recipes(mesh.sections, coarsen=mesh.coarsen, flank_coarsen=flank)
    place, toward = (math.radians(args.angle_deg), twist), in_mesh(pair)
    parts: dict[str, Part] = {}
    sections: dict[str, MeshPart] = {}
    for number, name in enumerate(("pinion", "wheel")):
        if args.gear not in ("both", name):
            continue
        gear = mesh.gears[number]
        first = float(pair.tooth_angle(number, 0, place[0], pair.contact_twist + twist))
        with stage(f"meshing the {name}"):
            section: Any
            if args.sector:
                section = sector_mesh(gear, recipes[number])
                drawn = MeshPart(section.points, section.triangles, section.boundaries)
            else:
                fine = set(loaded[number])
                if args.teeth is not None:
                    fine |= teeth_near(gear, first, toward[number], min(args.teeth, gear.tooth_count))
                drawn = section = mixed_gear(gear, recipes[number], fine or range(gear.tooth_count))
            levels = graded_levels(mesh.faces[number], mesh.count if args.layers is None else args.layers)
            parts[name] = gear_solid(section, mesh, flanks, number, place, levels)
            c, s = math.cos(first), math.sin(first)
            points = drawn.points @ np.array([[c, s], [-s, c]]) + np.array([pair.wheel_centre * number, 0.0])
            sections[name] = MeshPart(points, drawn.triangles, drawn.boundaries)
    return parts, sections


def _deck(args: argparse.Namespace, job: StiffnessJob) -> tuple[dict[str, Part], dict[str, MeshPart], dict[str, float]]:
    """Solve the position here, and write the deck of the same twist; its parts, sections, torque and twist."""
    import numpy as np

    from ..gears.gearmesh.width_job import axial_sense, job_lines, position_sweep
    from ..gears.width.lines import look_at
    from ..output.exchange.calculix_deck import Deck, write_deck
    from ..version import VERSION

    angle, pair = math.radians(args.angle_deg), job.pair
    with stage("position"):
        lines = job_lines(job)
        sweep = position_sweep(job, lines, angle)
    if sweep.status[0, 0] != "converged" or not sweep.torque[0, 0] > 0.0:
        problem = f"the contact of this position has no solution ({sweep.status[0, 0]})"
        raise InputError("--deck", None, problem, "try another load")
    torque, loaded = float(sweep.torque[0, 0]), _loaded_teeth(sweep, pair)
    if args.teeth is not None and args.teeth < len(loaded[0]):
        problem = "leaves loaded tooth pairs without a contact boundary: the deck would not find equilibrium"
        raise InputError("--teeth", args.teeth, problem, f"give {len(loaded[0])} or more, or leave it out")
    begin = float(look_at(lines, angle).least[0]) - APART / pair.wheel.base_radius
    twist = float(sweep.twist[0, 0]) - begin
    parts, sections = _parts(args, job, begin, loaded)
    axis = "the axes of the job file" if axial_sense(job) > 0.0 else "seen from the other side: y and z count backwards"
    heading = (
        f"gearfe {VERSION}, lines of contact: torque {torque:.9g} N m at the wheel's hub, twist {twist:.9g} rad",
        f"centre of the wheel x = {1e3 * pair.wheel_centre:.9g} mm, pinion angle {args.angle_deg:g} deg; {axis}",
        f"axial force on the wheel {float(sweep.axial_force[0, 0]):.9g} N",
        "modifications of the driving flanks and the tilt of the axes are in the nodes of the fine teeth",
    )
    materials = [(m.youngs_modulus, m.poisson_ratio) for m in job.materials]
    with stage("writing"):
        write_deck(args.out, Deck(parts, materials, pair.wheel_centre, twist, 0.0, heading=heading))
    print(f"run it: ccx {Path(args.out).stem}; torque at the wheel's hub by gearfe: {torque:.6g} N m")
    print(f"twist of the wheel: {twist:.9g} rad")
    force = float(np.asarray(sweep.axial_force)[0, 0])
    return parts, sections, {"torque_wheel_Nm": torque, "twist_rad": twist, "axial_force_wheel_N": force}


def _loaded_teeth(sweep: WidthSweep, pair: GearPair) -> tuple[set[int], set[int]]:
    """Numbers of the teeth of pinion and wheel that bear."""
    pairs = set(sweep.points.pair.tolist())
    return {k % pair.pinion.teeth for k in pairs}, {(-1 - k) % pair.wheel.teeth for k in pairs}
