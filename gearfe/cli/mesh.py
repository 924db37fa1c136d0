"""``gearfe mesh JOB.toml``: the meshes of a gear pair for another program, or a deck that runs there."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.progress import stage
from ..base.tables.pair import StiffnessTable
from .arguments import add_job, add_json, add_keys, add_mesh, add_pictures, check_option, with_keys

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..base.tables.gearbox import NamedMesh
    from ..gears.gearmesh.job import StiffnessJob
    from ..gears.geometry.pair import GearPair
    from ..output.exchange.mesh_export import MeshPart, Part


#: Teeth of each gear whose flanks are fine in a deck, by default.
DECK_TEETH = 3
#: Most layers of elements along the width.
MOST_LAYERS = 200


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "job", "job file with the table [pair], or meshes by name")
    add_mesh(parser)
    parser.add_argument(
        "--out",
        metavar="DIR|FILE",
        help="folder for gears.msh (a deck: gears.inp), or a file of any format, by its suffix (default: out/JOB/mesh)",
    )
    parser.add_argument(
        "--gear",
        choices=("both", "pinion", "wheel"),
        default="both",
        metavar="both|pinion|wheel",
        help="which gear (default: both)",
    )
    parser.add_argument("--sector", action="store_true", help="one tooth of each gear instead of whole gears")
    parser.add_argument(
        "--teeth",
        type=int,
        metavar="N",
        help=f"fine flanks only at the N teeth of each gear in mesh (default: all, of a deck {DECK_TEETH})",
    )
    parser.add_argument("--angle-deg", type=float, default=0.0, metavar="X", help="pinion angle (deg, default: 0)")
    parser.add_argument(
        "--deck",
        action="store_true",
        help="an input deck that CalculiX runs unchanged: contact at the load of [stiffness] (.inp)",
    )
    parser.add_argument(
        "--layers",
        type=int,
        metavar="N",
        help="layers of elements along the width of gears whose load varies along it (default: by their width)",
    )
    add_pictures(parser)
    add_json(parser)
    add_keys(parser, StiffnessTable, "coarsen", "flank_coarsen")


def run(args: argparse.Namespace) -> int:
    """Write the file and name its groups."""
    from ..base.config import read_toml
    from ..base.errors import InputError
    from ..base.tables.jobs import only_mesh

    out = Path(args.out) if args.out else Path("out") / Path(args.job).stem / "mesh"
    args.out = str(out if out.suffix else out / ("gears.inp" if args.deck else "gears.msh"))
    # mistakes in the file show before NumPy, SciPy and the finite elements load
    mesh = only_mesh(read_toml(args.job), args.job, args.mesh)
    table = with_keys(args, mesh.stiffness, "coarsen", "flank_coarsen")
    table.check("stiffness")
    check_option("--angle-deg", args.angle_deg, StiffnessTable, "angle_start_deg")
    _check(args)

    from ..gears.geometry.pair import pair_of

    pair = pair_of(mesh)  # gears that cannot run together show with NumPy alone
    solid = mesh.along_width(places=False) is not None
    if args.layers is not None and not solid:
        problem = "is for gears whose load varies along the face width: these are meshed in the plane"
        raise InputError("--layers", args.layers, problem, "leave it out")

    from ..base.files import output_folder
    from ..output.exchange.mesh_export import format_of, group_sizes

    format_of(args.out)
    output_folder(Path(args.out).parent)
    parts: Mapping[str, Part]
    if solid:
        from .solid_mesh import write_solid_mesh

        parts, sections, solved = write_solid_mesh(args, mesh, table, pair)
    else:
        parts, sections, solved = _write_plane(args, mesh, table, pair)
    if not args.no_pictures:
        from ..figures.gears import mesh_figure

        with stage("picture"):
            mesh_figure(Path(args.out).with_suffix(".png"), sections, None if args.sector else pair)
    nodes, sizes = sum(len(part.points) for part in parts.values()), group_sizes(parts)
    where, sides = (" in space", "faces") if solid else ("", "edges")
    print(f"written to {args.out}: {nodes} nodes{where}, millimetres, groups with their elements or {sides}:")
    for name, count in sizes.items():
        print(f"  {name:<24} {count}")
    args.summary = {"file": args.out, "nodes": nodes, "groups": sizes, **solved}
    return 0


def _write_plane(
    args: argparse.Namespace, mesh: NamedMesh, table: StiffnessTable, pair: GearPair
) -> tuple[dict[str, MeshPart], dict[str, MeshPart], dict[str, float]]:
    """Write a mesh or a deck in the plane; return its parts, twice, and what was solved for the deck."""
    from ..gears.gearmesh.job import StiffnessJob
    from ..output.exchange.mesh_export import export_mesh

    one, two = (replace(gear, microgeometry=None) for gear in mesh.gears)
    job = StiffnessJob(replace(mesh, stiffness=table, driver=one, driven=two), pair)
    solved: dict[str, float] = {}
    if args.deck:
        parts, solved = _deck(args, job)
    else:
        parts = _parts(args, job, wheel_angle=pair.wheel_angle_at(math.radians(args.angle_deg)))
        with stage("writing"):
            export_mesh(args.out, parts, plane=job.table.plane)
    return parts, parts, solved


def _check(args: argparse.Namespace) -> None:
    """Raise `InputError` for options that do not go together."""
    from ..base.errors import InputError

    if args.teeth is not None and args.teeth < 1:
        raise InputError("--teeth", args.teeth, "must be >= 1", "3 reach as far as a common pair meshes")
    if args.layers is not None and not 1 <= args.layers <= MOST_LAYERS:
        raise InputError("--layers", args.layers, f"must be >= 1 and <= {MOST_LAYERS}", "5 to 20 are usual")
    if args.teeth is not None and args.sector:
        raise InputError("--teeth", args.teeth, "goes with whole gears", "leave out --sector")
    if args.deck and (args.sector or args.gear != "both"):
        raise InputError("--deck", None, "needs both whole gears", "leave out --sector and --gear")
    if args.deck and Path(args.out).suffix.lower() != ".inp":
        raise InputError("--out", args.out, "must end in .inp for a deck", "as --out pair.inp")


def _parts(args: argparse.Namespace, job: StiffnessJob, wheel_angle: float) -> dict[str, MeshPart]:
    """The meshes in their places, the wheel turned by `wheel_angle` (rad) from where a space faces the pinion."""
    from ..gears.teeth.tooth_sector import sector_mesh, sector_recipes
    from ..gears.teeth.whole_gear import in_mesh, mixed_gear, teeth_near
    from ..output.exchange.mesh_export import MeshPart

    pair, table = job.pair, job.table
    toward = in_mesh(pair)
    recipes = sector_recipes(pair, coarsen=table.coarsen, flank_coarsen=table.flank_coarsen)
    turned = (math.radians(args.angle_deg), wheel_angle + pair.wheel_phase)
    parts = {}
    for number, name in enumerate(("pinion", "wheel")):
        if args.gear in ("both", name):
            gear = (pair.pinion, pair.wheel)[number]
            with stage(f"meshing the {name}"):
                if args.sector:
                    mesh = sector_mesh(gear, recipes[number])
                    made = MeshPart(mesh.points, mesh.triangles, {**mesh.boundaries, "contact": mesh.contact_edges()})
                else:
                    most = gear.tooth_count if args.teeth is None else min(args.teeth, gear.tooth_count)
                    made = mixed_gear(gear, recipes[number], teeth_near(gear, turned[number], toward[number], most))
            parts[name] = _placed(made, turned[number], pair.wheel_centre * number)
    return parts


def _placed(part: MeshPart, angle: float, x: float) -> MeshPart:
    import numpy as np

    c, s = math.cos(angle), math.sin(angle)
    return replace(part, points=part.points @ np.array([[c, s], [-s, c]]) + np.array([x, 0.0]))


def _deck(args: argparse.Namespace, job: StiffnessJob) -> tuple[dict[str, MeshPart], dict[str, float]]:
    """Solve the position here, and write the deck of the same twist; its parts, torque and twist."""
    import numpy as np

    from ..base.errors import InputError
    from ..gears.gearmesh.sweep import sweep_stiffness
    from ..output.exchange.calculix_deck import Deck, write_deck
    from ..version import VERSION

    sweep = {**job.sweep, "angles": np.array([math.radians(args.angle_deg)])}
    curve = sweep_stiffness(job.pair, job.model, **sweep)
    twist, torque = float(curve.twist[0]), float(curve.torque_wheel[0])
    if not math.isfinite(torque) or twist <= 0.0:
        raise InputError(
            "--deck", None, f"the contact of this position has no solution ({curve.status[0]})", "try another load"
        )
    least = int(np.sum(curve.load_share[0] > 0.0))
    args.teeth = max(DECK_TEETH, least) if args.teeth is None else args.teeth
    if args.teeth < least:
        problem = "leaves loaded tooth pairs without contact boundary: the deck would have no equilibrium"
        raise InputError("--teeth", args.teeth, problem, f"give {least} or more, or leave it out ({DECK_TEETH})")
    parts = _parts(args, job, wheel_angle=float(curve.wheel_angle[0]) - job.pair.sign * twist)
    pair = job.pair
    width = min(pair.pinion.face_width, pair.wheel.face_width)
    heading = (
        f"gearfe {VERSION}, {job.table.law}: torque {torque:.9g} N m at the wheel's hub, twist {twist:.9g} rad",
        f"centre of the wheel x = {1e3 * pair.wheel_centre:.9g} mm, pinion angle {args.angle_deg:g} deg",
        "contact acts between the driving flanks of the fine teeth",
    )
    materials = [(m.youngs_modulus, m.poisson_ratio) for m in job.materials]
    deck = Deck(parts, materials, pair.wheel_centre, pair.sign * twist, width, job.table.plane, heading)
    with stage("writing"):
        write_deck(args.out, deck)
    print(f"run it: ccx {Path(args.out).stem}; torque at the wheel's hub by gearfe: {torque:.6g} N m")
    print(f"twist of the wheel: {twist:.9g} rad")
    return parts, {"torque_wheel_Nm": torque, "twist_rad": twist}
