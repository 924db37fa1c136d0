"""``gearfe loadmap JOB.toml --out DIR``: a gear pair, with its deviations, over pinion angle and torque."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import InputError
from ..base.tables.loadmap import LoadMapTable
from ..base.tables.pair import StiffnessTable, check_law
from .arguments import (
    add_folder,
    add_job,
    add_keys,
    add_mesh,
    add_removed,
    check_option,
    each_mesh,
    print_results,
    with_keys,
)

if TYPE_CHECKING:
    from ..base.tables.gearbox import NamedMesh

#: Keys of [stiffness], and of the table of loads, that options stand for.
MODEL = ("law", "plane", "kinematics", "coarsen")
LOADS = ("positions", "mesh_cycles", "root_stress")
#: Files that a run can leave.
FILES = ("loadmap*.csv", "loadmap*.png", "loadmap_flank.vtkhdf", "loadmap.json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "job", "job file with the tables [pair], [stiffness], [loadmap] and [microgeometry]")
    add_mesh(parser)
    add_folder(parser)
    load = parser.add_mutually_exclusive_group()
    load.add_argument(
        "--torques-Nm", type=float, nargs="+", metavar="T", dest="torques_Nm", help="torques at the wheel's hub (N m)"
    )
    load.add_argument(
        "--torques-pinion-Nm", type=float, nargs="+", metavar="T", dest="torques_pinion_Nm",
        help="torques at the pinion's hub (N m)",
    )  # fmt: skip
    load.add_argument(
        "--torque-range", type=float, nargs=3, metavar=("START", "STOP", "COUNT"), help="a range of torques (N m)"
    )
    add_keys(parser, LoadMapTable, *LOADS, spacing="torque_spacing")
    add_keys(parser, StiffnessTable, *MODEL)
    parser.add_argument(
        "--no-estimate",
        action="store_true",
        help="leave out the error estimate of loads that vary along the face width",
    )
    add_removed(parser, StiffnessTable.REMOVED)
    add_removed(parser, {"flank": ("is a key of [microgeometry]", "write --set microgeometry.flank=right")})


def run(args: argparse.Namespace) -> int:
    """Compute the maps and write the files; 1 when a cell failed."""
    return each_mesh(args, _run_mesh)


def _run_mesh(args: argparse.Namespace, mesh: NamedMesh) -> int:
    """The map of one mesh."""
    started = time.perf_counter()
    mesh = replace(mesh, stiffness=_overridden_model(mesh.stiffness, args))
    table = _with_loads(args, mesh.loads).at_wheel(mesh.ratio)
    table.torques()

    from ..gears.geometry.pair import pair_of

    pair = pair_of(mesh)  # gears that cannot run together show with NumPy alone
    if mesh.along_width():
        from .along_width import run_along_width

        return run_along_width(args, mesh, pair, started, table)
    if args.no_estimate:
        problem = "is for loads that vary along the face width"
        raise InputError("--no-estimate", None, problem, "leave it out: maps of loads alike along it have no estimate")

    from ..base.files import output_folder, whole_set, write_csvs, write_json
    from ..base.progress import Stopwatch
    from ..gears.gearmesh.job import job_map, stiffness_job
    from ..gears.gearmesh.report import deviation_lines, map_lines, map_summary, map_tables, warnings

    watch, beside = Stopwatch({"program start": time.perf_counter() - started}), Path(args.job).parent
    with watch.stage("geometry"):
        job = stiffness_job(mesh, beside, pair)
        deviations = deviation_lines(job)  # impossible ones are refused before the folder is made
    folder = output_folder(args.out)
    load_map = job_map(job, table)
    watch.seconds.update(load_map.timings)
    with whole_set(folder, FILES) as made:
        with watch.stage("tables"):
            write_csvs(made, map_tables(load_map))
        if not args.no_pictures:
            from ..figures.flanks import flank_picture
            from ..figures.load_map import load_map_picture, load_picture
            from ..figures.style import save

            with watch.stage("pictures"):
                gears = f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}"
                title = f"{gears}, {load_map.span}, plane {job.table.plane}, law {job.table.law}"
                save(load_map_picture(load_map, title), made / "loadmap.png", dpi=110)
                save(load_picture(load_map, title), made / "loadmap_load.png", dpi=110)
                if mesh.deviates:
                    picture = flank_picture(mesh, pair, beside)
                    save(picture, made / "loadmap_flanks.png", dpi=110)
        watch.seconds["total"] = time.perf_counter() - started
        write_json(made / "loadmap.json", map_summary(job, table, load_map, watch.seconds))
        names = sorted(path.name for path in made.iterdir())
    print_results([*map_lines(load_map), *deviations], folder, names, watch.seconds, warnings(job, load_map))
    return 1 if load_map.failed.any() else 0


def _overridden_model(table: StiffnessTable, args: argparse.Namespace) -> StiffnessTable:
    """The table with the command's options instead of the file's values, checked like these."""
    if args.law is not None:
        check_law("--law", args.law)
    made = with_keys(args, table, *MODEL)
    made.check("stiffness")
    return made


def _with_loads(args: argparse.Namespace, table: LoadMapTable) -> LoadMapTable:
    """The table with the options of loads instead of the file's values, checked like these."""
    from ..base.errors import InputError

    more: dict[str, Any] = {}
    none = {"torques_Nm": None, "torques_pinion_Nm": None, "torque_start_Nm": None, "torque_stop_Nm": None}
    for key in ("torques_Nm", "torques_pinion_Nm"):
        if (given := getattr(args, key)) is not None:
            for torque in given:
                check_option("--" + key.replace("_", "-"), torque, LoadMapTable, key)
            more |= {**none, key: tuple(given)}
    if args.torque_range is not None:
        start, stop, count = args.torque_range
        if not float(count).is_integer():
            raise InputError("--torque-range COUNT", count, "must be a whole number")
        ends = {"torque_start_Nm": start, "torque_stop_Nm": stop, "torque_count": int(count)}
        for key, value in ends.items():
            check_option("--torque-range", value, LoadMapTable, key)
        more |= {**none, **ends}
    made = with_keys(args, replace(table, **more), *LOADS, spacing="torque_spacing")
    made.check(table.NAME)
    return made
