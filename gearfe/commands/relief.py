"""``gearfe relief JOB.toml --out DIR``: the relief that is best at the job's torques."""

from __future__ import annotations

import argparse
import time
from contextlib import ExitStack
from pathlib import Path

from ..progress import count
from ..tables.microgeometry import MicrogeometryTable, ReliefTable
from ..tables.stiffness import StiffnessTable
from .arguments import add_job, add_keys, with_keys
from .common import add_folder, print_results

#: Files that a run can leave.
FILES = ("relief*.csv", "relief.png", "relief.json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    help_ = "job file with the tables [pair], [stiffness], [microgeometry] and [relief]"
    add_job(parser, "job", help_)
    add_folder(parser)
    add_keys(parser, ReliefTable, "positions", "map_points", "generations", "seed")
    add_keys(parser, StiffnessTable, "coarsen")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes (default 1); no digit changes")


def run(args: argparse.Namespace) -> int:
    """Search and write the files."""
    started = time.perf_counter()
    from ..config import load_job
    from ..errors import InputError

    # mistakes in the file show before NumPy, SciPy and the finite elements load
    tables = load_job(args.job, ("pair", "relief"), ("stiffness", "microgeometry"))
    table = with_keys(args, tables["relief"], "positions", "map_points", "generations", "seed")
    base = tables.get("microgeometry", MicrogeometryTable())
    if not 1 <= args.workers <= 1024:
        raise InputError("--workers", args.workers, "must be 1 to 1024", "as many as there are processors")

    from ..gear.pair import GearPair

    pair = GearPair.from_table(tables["pair"])

    from ..microgeometry.job import condensed
    from ..microgeometry.relief import optimise_relief
    from ..microgeometry.relief_job import (
        comparison,
        map_table,
        named,
        relief_problem,
        report_lines,
        summary,
        with_pitch_errors,
    )
    from ..microgeometry.report import law_remarks
    from ..output.files import output_folder, whole_set, write_csv, write_json
    from ..progress import Stopwatch
    from ..stiffness.job import StiffnessJob

    watch = Stopwatch({"program start": time.perf_counter() - started})
    job = StiffnessJob(tables["pair"], with_keys(args, tables.get("stiffness", StiffnessTable()), "coarsen"), pair)
    folder = output_folder(args.out)
    law, roots = condensed(job, root_stress=bool(table.root_stress_weight), watch=watch)
    problem = relief_problem(table, base, pair, Path(args.job).parent, law, roots)
    with watch.stage("search"), ExitStack() as stack:
        executor = None
        if args.workers > 1:
            from ..study.run import processes

            executor = stack.enter_context(processes(args.workers))
        try:
            made = optimise_relief(
                problem,
                map_points=table.map_points,
                generations=table.generations,
                seed=table.seed,
                executor=executor,
                progress=count,
            )
        except InputError as error:
            raise named(error, table, problem) from None
    with watch.stage("comparison"):
        compared = comparison(made)
        errors = with_pitch_errors(made, base, pair, Path(args.job).parent)
    with whole_set(folder, FILES) as place:
        write_csv(place / "relief_map.csv", map_table(table, made))
        write_csv(place / "relief_torques.csv", compared)
        if not args.no_pictures:
            from ..figures.microgeometry import relief_picture
            from ..figures.style import save

            with watch.stage("picture"):
                save(relief_picture(made, compared), place / "relief.png", dpi=110)
        watch.seconds["total"] = time.perf_counter() - started
        write_json(place / "relief.json", summary(job, base, table, made, errors, watch.seconds))
        names = sorted(path.name for path in place.iterdir())
    print_results([*report_lines(table, made, errors), *law_remarks(job)], folder, names, watch.seconds, pair.warnings)
    return 0
