"""``gearfe runup JOB.toml --out DIR``: steady states of a gear train over its speed."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import Any

from ..base.shown import percent
from ..base.tables.runup import RunUpTable
from .arguments import print_results, with_keys
from .vibration import add_train, title

#: Keys of [runup] that options stand for.
KEYS = (
    "speed_start_rad_per_s",
    "speed_stop_rad_per_s",
    "speeds",
    "tolerance",
    "band_Hz",
    "multiples",
    "shaft_multiples",
)
#: Bifurcations in words.
MEANING = {
    "turning point": "turning points of the steady motion (jumps)",
    "period doubling": "loss of stability with twice the period (period doubling)",
    "Neimark-Sacker": "loss of stability with a new frequency (Neimark-Sacker bifurcation)",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_train(parser, "job file with the tables [train] and [runup]", RunUpTable, *KEYS)
    parser.add_argument("--no-stability", action="store_true", help="leave out the Floquet multipliers")
    parser.add_argument(
        "--fields", action="store_true", help="modes with strain energy in the meshes, for ParaView (VTKHDF series)"
    )


def run(args: argparse.Namespace) -> int:
    """Compute and write; 1 when the range was not covered."""
    started = time.perf_counter()
    from ..base.errors import unknown_name
    from ..base.tables.jobs import read_train_tables

    # mistakes in the file show before NumPy, SciPy and the finite elements load
    tables = read_train_tables(args.job, args.variant)
    table = with_keys(args, _own_table(args.job), *KEYS)
    table.check("runup")
    if args.no_stability:
        table = replace(table, stability=False)

    from ..base.files import output_folder
    from ..base.progress import Stopwatch
    from ..drivetrain.gearbox.job import train_job
    from ..drivetrain.runup.files import RunUpChoice, write_runup
    from ..drivetrain.runup.job import described, solved

    watch = Stopwatch({"program start": time.perf_counter() - started})
    with watch.stage("reading"):
        job = train_job(args.job, tables)
        bores = [str(a) for s in job.table.shafts for a in s.attachments]
        if args.attachment is not None and args.attachment not in bores:
            raise unknown_name("--attachment", args.attachment, bores)
        folder = output_folder(args.out)
    made, unstable = solved(job, table, args.curve, watch=watch)
    draw = None
    if not args.no_pictures:
        from ..figures.runup import RunUpPictures

        draw = RunUpPictures(title(job.table, driven=False))
    choice = RunUpChoice(table.multiples, args.attachment, args.fields, table.shaft_multiples)
    further = described(job, table, made.train.model.train)
    summary, names = write_runup(folder, made, choice, draw=draw, watch=watch, further=further, unstable=unstable)
    print_results(_report_lines(summary), folder, names, watch.seconds, summary["warnings"])
    return 0 if summary["speeds_reached"] == summary["speeds"] else 1


def _own_table(job: str) -> RunUpTable:
    from ..base.tables.jobs import load_job

    found: RunUpTable = load_job(job, ("runup",))["runup"]
    return found


def _report_lines(summary: dict[str, Any]) -> list[str]:
    """Lines for the terminal."""
    from ..drivetrain.gearbox.bearing_report import bearing_lines
    from ..drivetrain.gearbox.inherited import inherited_lines
    from ..drivetrain.gearbox.shaft_report import shaft_lines
    from ..drivetrain.gearbox.stage_report import stage_lines

    lines = [
        f"{summary['speeds_reached']} of {summary['speeds']} speeds, {summary['steady_states']} steady states; largest "
        f"error estimate {summary['largest_error_estimate']:.2g} of the approach under the steady force"
    ]
    lines += [*inherited_lines(summary.get("inherited", {})), *shaft_lines(summary), *stage_lines(summary)]
    lines += bearing_lines(summary.get("bearings", {}))
    changes: dict[str, list[str]] = {}
    for change in summary["bifurcations"]:
        changes.setdefault(change["kind"], []).append(f"{change['speed_rad_per_s']:.6g}")
    lines += [f"{MEANING.get(kind, kind)} at {', '.join(speeds)} rad/s" for kind, speeds in changes.items()]
    factors, open_shares = summary["largest_dynamic_factor"], summary["largest_share_without_contact"]
    for i, (name, factor, open_) in enumerate(zip(summary["mesh_names"], factors, open_shares, strict=True)):
        parts = []
        if factor is not None:
            parts.append(f"dynamic factor up to {factor['value']:.3g} at {factor['speed_rad_per_s']:.6g} rad/s")
        if open_ is not None and open_["value"] > 0.0:
            share = open_["value"]
            parts.append(f"apart up to {percent(share, 3)} of the time at {open_['speed_rad_per_s']:.6g} rad/s")
        lines.append(f"mesh {i + 1} ({name}): " + ", ".join(parts or ["no steady force"]))
    for peak in summary["peaks"][:6]:
        where = f"{peak['order']} at {peak['frequency_Hz']:.0f} Hz"
        if peak["mode"] is None:
            beside = f"{where} dominates, and meets no mode within {100.0 * peak['searched_within']:g} % of the speed"
            lines.append(f"peak at {peak['speed_rad_per_s']:.6g} rad/s: {beside}; {_factor(peak)}")
        else:
            met = f"{where} meets {peak['mode']}, {peak['mode_frequency_Hz']:.0f} Hz"
            lines.append(f"critical speed {peak['speed_rad_per_s']:.6g} rad/s: {met}; {_factor(peak)}")
    return lines


def _factor(peak: dict[str, Any]) -> str:
    return f"dynamic factor {peak['dynamic_factor']:.3g} in {peak['mesh']}"
