"""``gearfe microgeometry JOB.toml --out DIR``: what deviations of micrometres do to a loaded pair."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from ..tables.microgeometry import MicrogeometryTable
from ..tables.stiffness import StiffnessTable
from .arguments import add_job, add_keys, with_keys
from .common import add_folder, print_results
from .loadmap import add_loads, with_loads

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


def run(args: argparse.Namespace) -> int:
    """Solve the pair and write the files; 1 when a position failed."""
    started = time.perf_counter()
    from ..config import load_job

    # mistakes in the file show before NumPy, SciPy and the finite elements load
    tables = load_job(args.job, ("pair", "microgeometry"), ("stiffness",))
    table = with_keys(args, with_loads(args, tables["microgeometry"]), "mesh_cycles", "flank")
    table.torques()

    from ..gear.pair import GearPair

    pair = GearPair.from_table(tables["pair"])

    from ..microgeometry.job import both_flanks, solved
    from ..microgeometry.report import law_remarks, report_lines, summary, warnings
    from ..microgeometry.report import tables as mesh_tables
    from ..output.files import output_folder, whole_set, write_csvs, write_json
    from ..progress import Stopwatch
    from ..stiffness.job import StiffnessJob

    watch = Stopwatch({"program start": time.perf_counter() - started})
    beside = Path(args.job).parent
    stiffness = with_keys(args, tables.get("stiffness", StiffnessTable()), "coarsen")
    job = StiffnessJob(tables["pair"], stiffness, pair, folder=beside)
    with watch.stage("deviations"):
        flanks = both_flanks(job, table)
    folder = output_folder(args.out)
    made = solved(job, table, flanks, watch=watch)
    with whole_set(folder, FILES) as place:
        with watch.stage("tables"):
            write_csvs(place, mesh_tables(made))
        if not args.no_pictures:
            from ..figures.microgeometry import flank_figure, microgeometry_picture
            from ..figures.style import save

            with watch.stage("pictures"):
                flank_figure(place / "microgeometry_flanks.png", table, pair, beside)
                save(microgeometry_picture(made), place / "microgeometry.png", dpi=110)
        watch.seconds["total"] = time.perf_counter() - started
        write_json(place / "microgeometry.json", summary(job, table, made, flanks[0], watch.seconds))
        names = sorted(path.name for path in place.iterdir())
    print_results([*report_lines(made), *law_remarks(job)], folder, names, watch.seconds, warnings(pair, made))
    return 1 if made.failed.any() else 0
