"""``gearfe mesh JOB.toml --out FILE``: the meshes of a gear pair for another program."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..progress import stage
from ..tables.stiffness import StiffnessTable
from .arguments import add_job, add_keys, with_keys

HELP = "meshes of a gear pair with named boundaries, as .msh, .vtu or .inp"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "job", "job file with the table [pair]")
    parser.add_argument("--out", metavar="FILE", required=True, help="file to write; its suffix chooses the format")
    parser.add_argument(
        "--gear", choices=("both", "pinion", "wheel"), default="both", help="which gear (default: both)"
    )
    parser.add_argument("--sector", action="store_true", help="one tooth of each gear instead of whole gears")
    add_keys(parser, StiffnessTable, "coarsen", "flank_coarsen")


def run(args: argparse.Namespace) -> int:
    """Write the file and name its groups."""
    from ..config import load_job

    # a mistake in the file is told before NumPy, SciPy and the finite elements load
    tables = load_job(args.job, ("pair",), ("stiffness",))
    table = with_keys(args, tables.get("stiffness", StiffnessTable()), "coarsen", "flank_coarsen")
    table.check("stiffness")

    from ..gear.pair import GearPair

    pair = GearPair.from_table(tables["pair"])  # gears that cannot run together: NumPy alone tells

    from ..meshing.export import export_mesh, format_of
    from ..meshing.recipe import sector_recipes
    from ..meshing.tooth_sector import sector_mesh
    from ..output.files import output_folder
    from ..stiffness.job import StiffnessJob

    format_of(args.out)
    job = StiffnessJob(tables["pair"], table, pair)
    output_folder(Path(args.out).parent)
    recipes = sector_recipes(job.pair, coarsen=table.coarsen, flank_coarsen=table.flank_coarsen)
    parts: dict[str, Any] = {}
    for number, name in enumerate(("pinion", "wheel")):
        if args.gear in ("both", name):
            gear = (job.pair.pinion, job.pair.wheel)[number]
            angle, place = (job.pair.wheel_phase, job.pair.working_centre_distance) if number else (0.0, 0.0)
            with stage(f"meshing the {name}"):
                parts[name] = _part(sector_mesh(gear, recipes[number]), angle, place, sector=args.sector)
    with stage("writing"):
        counts = export_mesh(args.out, parts, plane=job.table.plane)
    nodes = sum(len(part.points) for part in parts.values())
    print(f"written to {args.out}: {nodes} nodes, millimetres, groups with their elements or edges:")
    for name, count in counts.items():
        print(f"  {name:<24} {count}")
    return 0


def _part(mesh: Any, angle: float, x: float, *, sector: bool) -> Any:
    import numpy as np

    from ..meshing.export import MeshPart
    from ..meshing.whole_gear import whole_gear

    whole = mesh if sector else whole_gear(mesh)
    c, s = np.cos(angle), np.sin(angle)
    points = whole.points @ np.array([[c, s], [-s, c]]) + np.array([x, 0.0])
    return MeshPart(points, whole.triangles, whole.boundaries)
