"""``gearfe microgeometry JOB.toml --out DIR``: what deviations of micrometres do to a loaded pair."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ..progress import count
from ..tables.microgeometry import MicrogeometryTable
from ..tables.stiffness import StiffnessTable
from .arguments import add_job, add_keys, with_keys
from .common import add_folder, tell
from .loadmap import add_loads, with_loads

if TYPE_CHECKING:
    from ..contact.compliance import MeshingPair
    from ..loadmap.root_stress import PairRoots
    from ..progress import Stopwatch
    from ..stiffness.job import StiffnessJob


#: Files that a run can leave.
FILES = ("microgeometry*.csv", "microgeometry*.png", "microgeometry.json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    help_ = "job file with the tables [pair], [stiffness] and [microgeometry]"
    add_job(parser, "job", help_)
    add_folder(parser)
    add_loads(parser)
    add_keys(parser, MicrogeometryTable, "mesh_cycles", "flank")
    add_keys(parser, StiffnessTable, "coarsen")


def condensed(job: StiffnessJob, root_stress: bool, watch: Stopwatch) -> tuple[MeshingPair, PairRoots | None]:
    """Both gears of a job condensed for the half-plane law, and the meshes of their roots where stresses are wanted."""
    from ..loadmap.root_stress import pair_roots
    from ..stiffness.sweep import elastic_pair
    from ..threads import one_thread

    elastic = elastic_pair(job.pair, job.model, law="half_plane", watch=watch)
    if not root_stress:
        return elastic, None
    with watch.stage("root meshes"), one_thread():
        return elastic, pair_roots(elastic)


def run(args: argparse.Namespace) -> int:
    """Solve the pair and write the files; 1 when a position failed."""
    started = time.perf_counter()
    from ..config import load_job

    # a mistake in the file is told before NumPy, SciPy and the finite elements load
    tables = load_job(args.job, ("pair", "microgeometry"), ("stiffness",))
    table = with_keys(args, with_loads(args, tables["microgeometry"]), "mesh_cycles", "flank")
    torques = table.torques()

    from ..gear.pair import GearPair

    pair = GearPair.from_table(tables["pair"])

    from ..contact.half_plane import half_plane_pair
    from ..gear.deviation_job import deviations_of
    from ..microgeometry.report import (
        cell_table,
        law_remarks,
        order_table,
        pair_table,
        report_lines,
        summary,
        torque_table,
        warnings,
    )
    from ..microgeometry.solve import load_mesh
    from ..output.files import output_folder, whole_set, write_csv, write_json
    from ..progress import Stopwatch
    from ..stiffness.job import StiffnessJob

    watch = Stopwatch({"program start": time.perf_counter() - started})
    job = StiffnessJob(tables["pair"], with_keys(args, tables.get("stiffness", StiffnessTable()), "coarsen"), pair)
    beside = Path(args.job).parent
    with watch.stage("deviations"):
        deviations = deviations_of(table, pair, beside)
        other = {"left": "right", "right": "left"}[table.flank]
        back = deviations_of(table, pair, beside, flank=other)
    folder = output_folder(args.out)
    elastic, roots = condensed(job, table.root_stress, watch)
    with watch.stage("positions"):
        law = half_plane_pair(elastic).deviated(deviations)
        made = load_mesh(
            law,
            torques,
            positions=table.positions,
            mesh_cycles=table.mesh_cycles,
            roots=roots,
            back=back,
            progress=count,
        )
    with whole_set(folder, FILES) as place:
        with watch.stage("tables"):
            write_csv(place / "microgeometry.csv", cell_table(made))
            write_csv(place / "microgeometry_torques.csv", torque_table(made))
            write_csv(place / "microgeometry_pairs.csv", pair_table(made))
            write_csv(place / "microgeometry_orders.csv", order_table(made))
        if not args.no_pictures:
            from ..figures.microgeometry import flank_figure, microgeometry_picture
            from ..figures.style import save

            with watch.stage("pictures"):
                flank_figure(place / "microgeometry_flanks.png", table, pair, beside)
                save(microgeometry_picture(made), place / "microgeometry.png", dpi=110)
        watch.seconds["total"] = time.perf_counter() - started
        write_json(place / "microgeometry.json", summary(job, table, made, deviations, watch.seconds))
        names = sorted(path.name for path in place.iterdir())
    tell([*report_lines(made), *law_remarks(job)], folder, names, watch.seconds, warnings(pair, made))
    return 1 if made.failed.any() else 0
