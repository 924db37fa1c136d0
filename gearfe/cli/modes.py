"""``gearfe modes JOB.toml --out DIR``: modes of a gear train over its speed, Campbell diagram, critical speeds."""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

from ..base.shown import percent
from ..base.tables.modes import ModesTable
from .arguments import print_results, with_keys
from .vibration import add_train, title

#: Keys of [modes] that options stand for.
KEYS = ("speed_start_rad_per_s", "speed_stop_rad_per_s", "speeds", "band_Hz", "multiples", "shaft_multiples")
#: Critical speeds that are printed, at most.
PRINTED = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_train(parser, "job file with the table [train]", ModesTable, *KEYS, attachment=False)
    parser.add_argument(
        "--fields", nargs="*", type=int, metavar="N",
        help="write animated modes by their numbers for ParaView (VTKHDF series); without numbers those in which "
        "shafts move or meshes deform",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Compute and write."""
    started = time.perf_counter()
    from ..base.tables.jobs import load_job, read_train_tables

    # mistakes in the file show before NumPy, SciPy and the finite elements load
    tables = read_train_tables(args.job, args.variant)
    given = load_job(args.job, (), ("modes", "runup"))
    table = with_keys(args, given.get("modes", ModesTable()), *KEYS)
    table.check("modes")

    from ..base.files import output_folder
    from ..base.progress import Stopwatch
    from ..drivetrain.gearbox.job import train_job
    from ..drivetrain.modes.files import write_modes_result
    from ..drivetrain.modes.job import described, solved

    watch = Stopwatch({"program start": time.perf_counter() - started})
    with watch.stage("reading"):
        job = train_job(args.job, tables)
        folder = output_folder(args.out)
    result = solved(job, table, given.get("runup"), args.curve, watch=watch)
    draw = None
    if not args.no_pictures:
        from ..figures.campbell import draw_campbell

        draw = draw_campbell
    summary, names = write_modes_result(
        folder, result, fields=args.fields, draw=draw, title=title(job.table, driven=False), watch=watch,
        further=described(job, table, result),
    )  # fmt: skip
    print_results(_report_lines(summary), folder, names, watch.seconds, summary["warnings"])
    return 0


def _report_lines(summary: dict[str, Any]) -> list[str]:
    """Lines for the terminal."""
    from ..drivetrain.gearbox.inherited import inherited_lines
    from ..drivetrain.gearbox.stage_report import stage_lines

    start, stop = summary["speed_start_rad_per_s"], summary["speed_stop_rad_per_s"]
    lines = [f"{len(summary['modes'])} modes from {start:.6g} to {stop:.6g} rad/s"]
    if summary["free_motions"]:
        lines.append(f"{summary['free_motions']} motions that nothing holds, at 0 Hz: rotation of the shafts together")
    lines += [*inherited_lines(summary.get("inherited", {})), *stage_lines(summary)]
    for mode in summary["modes"]:
        low, high = mode["frequency_Hz"], mode["frequency_at_the_fastest_speed_Hz"]
        ends = list(dict.fromkeys(f"{x:.5g} Hz" if math.isfinite(x) else "overdamped" for x in (low, high)))
        hertz = " to ".join(ends)
        lines.append(f"{mode['name']}: {hertz}, {percent(mode['damping_ratio'], 3)} damping")
    reached = [c for c in summary["critical_speeds"] if c["excited"]]
    for c in reached[:PRINTED]:
        at = f"critical speed {c['speed_rad_per_s']:.6g} rad/s"
        lines.append(f"{at}: {c['order']} at {c['frequency_Hz']:.5g} Hz meets mode {c['mode']}, {c['label']}")
    if len(reached) > PRINTED:
        lines.append(f"{len(reached) - PRINTED} more of these, and where orders meet other modes: critical_speeds.csv")
    return lines
