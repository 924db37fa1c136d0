"""``gearfe stiffness JOB.toml --out DIR``: the mesh-stiffness curve of a gear pair."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.config import check_range
from ..base.progress import announce
from ..base.tables.pair import LOADS, StiffnessTable, check_law
from .arguments import (
    add_folder,
    add_job,
    add_keys,
    add_mesh,
    add_removed,
    check_option,
    each_mesh,
    number,
    print_results,
    with_keys,
)

if TYPE_CHECKING:
    from ..base.tables.gearbox import NamedMesh

#: Keys of the [stiffness] table that options stand for, beside the load and the angles.
KEYS = (
    "law", "nitsche_gamma0", "penalty_stiffness_N_per_mm3", "plane", "kinematics", "twist_from", "points_per_edge",
    "coarsen", "flank_coarsen", "solve_all", "interpolation",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "job", "job file with the tables [pair] and [stiffness]")
    add_mesh(parser)
    add_folder(parser)
    parser.add_argument("--variant", metavar="NAME", help="variant of [train] whose [stiffness] is used")
    add_keys(parser.add_mutually_exclusive_group(), StiffnessTable, *LOADS)
    parser.add_argument("--angles", type=float, nargs=3, metavar=("START", "STEP", "STOP"), help="pinion angles (deg)")
    add_keys(parser, StiffnessTable, *KEYS)
    parser.add_argument(
        "--law-parameter",
        nargs=2,
        action="append",
        metavar=("NAME", "X"),
        help="parameter of a law of another package; may be given several times",
    )
    add_removed(parser, {**StiffnessTable.REMOVED, "animate": ("has another name", "write --animation")})
    parser.add_argument(
        "--check",
        type=int,
        nargs="+",
        metavar="N",
        help="solve these positions again on whole gears, with all their unknowns, and compare: rows of the table, "
        "counted from 1; 5 to 40 s each on the default mesh",
    )
    parser.add_argument("--no-estimate", action="store_true", help="leave out the error estimate")
    parser.add_argument(
        "--range", type=float, metavar="X", help="end of the colours in the pictures of --fields (MPa; default: chosen)"
    )
    parser.add_argument(
        "--fields",
        nargs="*",
        type=field_angle,
        metavar="ANGLE",
        help="write displacement and stress of whole gears: 'all' (also without a value), or pinion angles (deg)",
    )
    parser.add_argument(
        "--animation",
        type=int,
        nargs="?",
        const=40,
        metavar="N",
        help="stress in the meshing zone in N frames (40), a GIF",
    )


def run(args: argparse.Namespace) -> int:
    """Compute the curves and write the files; 1 when a position failed."""
    return each_mesh(args, _run_mesh, args.variant)


def _run_mesh(args: argparse.Namespace, mesh: NamedMesh) -> int:
    """The curve of one mesh."""
    if args.range is not None:
        check_range(args.range, "--range", {"above": 0.0, "doc": "end of the colours (MPa)"})
    started = time.perf_counter()
    from ..base.errors import InputError

    mesh = replace(mesh, stiffness=overridden(mesh.stiffness, args).at_wheel(mesh.ratio))
    chosen = field_angles(args)
    if args.animation is not None and not 2 <= args.animation <= 1000:
        raise InputError("--animation", args.animation, "must be >= 2 and <= 1000 frames", "40 are usual")

    from ..gears.geometry.pair import pair_of

    pair = pair_of(mesh)  # gears that cannot run together show with NumPy alone
    if mesh.along_width():
        from .along_width import run_along_width

        return run_along_width(args, mesh, pair, started, fields=chosen)

    import numpy as np

    from ..base.files import output_folder, whole_set, write_json
    from ..base.progress import Stopwatch
    from ..gears.gearmesh.job import stiffness_job
    from ..gears.gearmesh.report import report_lines, summary, warnings
    from ..gears.gearmesh.sweep import sweep_stiffness

    watch = Stopwatch({"program start": time.perf_counter() - started})
    with watch.stage("geometry"):
        job = stiffness_job(mesh, Path(args.job).parent, pair)
        sweep = job.sweep
        if chosen is not None:
            from ..gears.gearmesh.fields_output import announce_nearest

            announce_nearest(np.degrees(sweep["angles"]), chosen)
        if args.check is not None:
            from ..gears.gearmesh.check import checked_rows, whole_law

            checked_rows(args.check, len(sweep["angles"]), "--check")
            whole_law(job.model, "--check")
    folder = output_folder(args.out)
    elastic = job.elastic(watch=watch)
    if args.fields is not None:
        from ..gears.gearmesh.fields_output import size_note

        announce(size_note(elastic, np.degrees(sweep["angles"]), chosen))
    curve = sweep_stiffness(job.pair, elastic=elastic, estimate_error=not args.no_estimate, store=True, **sweep)
    watch.seconds.update(curve.timings)
    check = None
    if args.check is not None:
        from ..gears.gearmesh.check import check_positions

        with watch.stage("check"):
            check = check_positions(curve, job.pair, args.check, job.model, kinematics=sweep["kinematics"])
    found = summary(job, curve, watch.seconds)
    may_write = ("stiffness*.png", "stiffness_*.csv", "*.vtkhdf", "stress_*deg.png", "pressure.*")
    with whole_set(folder, may_write) as made:
        with watch.stage("table"):
            curve.to_csv(made / "stiffness.csv")
            if check is not None:
                check.to_csv(made / "stiffness_check.csv")
        if args.fields is not None:
            with watch.stage("fields"):
                from ..gears.gearmesh.fields_output import write_fields

                def draw(position: Any, fields: Any) -> None:
                    from ..figures.stress import stress_figure

                    place = position.pinion_angle, position.twist
                    stress_figure(made, job.pair, place, fields, args.range)

                pressures = write_fields(made, elastic, curve, chosen, draw=None if args.no_pictures else draw)
                if pressures and not args.no_pictures:
                    from ..figures.stiffness import pressure_figure

                    pressure_figure(made / "pressure.png", job.pair, pressures)
        if args.animation is not None:
            with watch.stage("animation"):
                from ..figures.stress import stress_animation

                stress_animation(made / "stress.gif", elastic, curve, args.animation)
        if not args.no_pictures:
            with watch.stage("picture"):
                from ..figures.stiffness import stiffness_figure

                stiffness_figure(made / "stiffness.png", job, curve, found)
        watch.seconds["total"] = time.perf_counter() - started
        write_json(made / "summary.json", found)
        names = sorted(path.name for path in made.iterdir())
    lines, sentences = report_lines(job, curve, found), warnings(job, curve)
    if check is not None:
        lines += check.lines()
        sentences += check.warnings()
    print_results(lines, folder, names, watch.seconds, sentences)
    return 1 if curve.failed.any() or (check is not None and check.failed.any()) else 0


def field_angle(text: str) -> str | float:
    """A value of ``--fields``: all, or a pinion angle (deg)."""
    return text if text == "all" else float(text)


def field_angles(args: argparse.Namespace) -> list[float] | None:
    """Return the pinion angles (deg) of ``--fields``, None for all."""
    from ..base.errors import InputError

    given = args.fields or []
    chosen = [value for value in given if value != "all"]
    if chosen and len(chosen) < len(given):
        raise InputError("--fields", given, "must be 'all' or pinion angles (deg), not both")
    return chosen or None


def overridden(table: StiffnessTable, args: argparse.Namespace) -> StiffnessTable:
    """The table with the command's options instead of the file's values, checked like these."""
    if args.law is not None:
        check_law("--law", args.law)
    if any(getattr(args, key) is not None for key in LOADS):
        table = replace(table, twist_deg=None, torque_Nm=None, torque_pinion_Nm=None)
    table = with_keys(args, table, *LOADS, *KEYS)
    if args.angles is not None:
        keys = ("angle_start_deg", "angle_step_deg", "angle_stop_deg")
        for key, value in zip(keys, args.angles, strict=True):
            check_option("--angles START STEP STOP", value, StiffnessTable, key)
        table = replace(table, **dict(zip(keys, args.angles, strict=True)))
    if args.law_parameter is not None:
        given = {name: number("--law-parameter", text) for name, text in args.law_parameter}
        table = replace(table, law_parameters=given)
    table.check("--angles" if args.angles is not None else "stiffness")
    return table
