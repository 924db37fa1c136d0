"""What `gearfe stiffness` and `gearfe loadmap` do for gears whose load varies along the face width."""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import InputError
from ..base.progress import Stopwatch
from .arguments import print_results

if TYPE_CHECKING:
    from ..base.tables.gearbox import NamedMesh
    from ..base.tables.loadmap import LoadMapTable
    from ..gears.geometry.pair import GearPair
    from ..gears.width import ContactLines, WidthSweep

#: Options of `gearfe stiffness` that are for loads alike along the face width.
PLANE_OPTIONS = ("check", "animation")


def run_along_width(
    args: argparse.Namespace,
    mesh: NamedMesh,
    pair: GearPair,
    started: float,
    loads: LoadMapTable | None = None,
    fields: list[float] | None = None,
) -> int:
    """Compute a mesh whose load varies along the face width and write its files; 1 when a position failed.

    Parameters
    ----------
    args : Namespace
        Parsed command line.
    mesh, pair
        The mesh, and its gears.
    started
        `time.perf_counter` when the command began (s).
    loads
        Torques and positions of a load map; without them, those of [stiffness].
    fields
        Pinion angles (deg) of which fields are asked for, None for all; where ``--fields`` is given.

    Raises
    ------
    InputError
        For options and keys that are for loads alike along the face width.
    """
    cause = mesh.along_width()
    for name in PLANE_OPTIONS:
        if getattr(args, name, None) is not None:
            problem = f"is for loads alike along the face width, which {cause[0] if cause else 'the mesh'} makes vary"
            raise InputError(f"--{name}", getattr(args, name) or None, problem, "leave it out")

    if getattr(args, "fields", None) is not None:
        for gear in mesh.gears:
            if gear.has_web:
                problem, cure = "is not implemented for gears with a web", "leave --fields out"
                raise InputError(f"{gear.where}.web_width_mm", gear.form["web_width_mm"], problem, cure)

    import numpy as np

    from ..base.files import output_folder, whole_set, write_csvs, write_json
    from ..gears.gearmesh import width_job
    from ..gears.gearmesh.job import stiffness_job
    from ..gears.gearmesh.width_report import (
        flank_loads,
        load_columns,
        pattern_columns,
        root_columns,
        sweep_columns,
        width_lines,
        width_summary,
        width_warnings,
        write_flank,
    )

    watch = Stopwatch({"program start": time.perf_counter() - started})
    shafts = None
    if mesh.misalignment_from_shafts:
        from ..base.config import read_toml
        from ..drivetrain.gearbox import shaft_tilts

        with watch.stage("train at rest"):
            shafts = shaft_tilts.shaft_tilts(read_toml(args.job), args.job, mesh, getattr(args, "variant", None))
        mesh = shafts.mesh
    job = stiffness_job(mesh, Path(args.job).parent, pair)
    if loads is None:
        width_job.check_stiffness_job(job)
        if fields is not None:
            from ..gears.gearmesh.fields_output import announce_nearest

            announce_nearest(np.degrees(width_job.stiffness_angles(job)), fields)
    else:
        width_job.check_map_job(job, loads)
    folder = output_folder(args.out)
    lines = width_job.job_lines(job, watch=watch)
    by_shafts, untilted, solve = None, lines, None
    if shafts is not None:
        by_shafts = shaft_tilts.job_tilts(job, lines, shafts, loads, watch)

        def solve(changed: ContactLines) -> WidthSweep:
            return shaft_tilts.job_tilts(job, changed, shafts, loads, None).sweep

        sweep, lines = by_shafts.sweep, by_shafts.lines
    else:
        sweep = width_job.job_sweep(job, lines, loads, watch)
    wide, name = lines.compliance.mesh, "stiffness" if loads is None else "loadmap"
    flanks = flank_loads(job, wide, sweep)
    tables = {} if loads is None else {loads.NAME: asdict(loads)}
    errors = None
    if not args.no_estimate and (sweep.status == "converged").any():
        errors = width_job.estimated_errors(job, untilted, sweep, loads, watch, solve)
    roots = None
    if loads is not None and loads.root_stress and (sweep.status == "converged").any():
        from ..gears.gearmesh.width_root import wide_roots

        with watch.stage("root stress"):
            roots = wide_roots(lines, sweep)
    found = width_summary(job, wide, sweep, watch.seconds, errors=errors, roots=roots, **tables)
    report, sentences, more = width_lines(found), width_warnings(job, wide, sweep), {}
    if roots is not None:
        more["root"] = root_columns(job, sweep, roots)
    if by_shafts is not None:
        more["misalignment"] = shaft_tilts.tilt_columns(job, by_shafts)
        found |= shaft_tilts.tilt_entries(job, by_shafts)
        report += shaft_tilts.tilt_lines(found)
        sentences += by_shafts.warnings
    may_write: tuple[str, ...] = (f"{name}*.png", f"{name}*.csv", f"{name}*.vtkhdf")
    if loads is None:
        may_write += ("fields.vtkhdf", "stress_*deg.png", "pressure.*")
    with whole_set(folder, may_write) as made:
        with watch.stage("tables"):
            main, load = sweep_columns(job, wide, sweep, roots), load_columns(job, sweep)
            write_csvs(made, {name: main, "load": load, "pattern": pattern_columns(flanks), **more})
            write_flank(made / f"{name}_flank.vtkhdf", job, flanks[-1])
        if getattr(args, "fields", None) is not None:
            with watch.stage("fields"):
                from ..gears.gearmesh.fields_output import write_solid_fields

                def draw(cell: tuple[int, int], sections: Any) -> None:
                    from ..figures.stress import stress_figure

                    place = float(sweep.angle[cell[1]]), float(pair.contact_twist + sweep.twist[cell])
                    note = f"section at y = {1e3 * sections[0].z:.4g} mm, "
                    stress_figure(made, pair, place, sections, args.range, note=note)

                write_solid_fields(made, job, lines, sweep, fields, draw=None if args.no_pictures else draw)
        if not args.no_pictures:
            from ..figures.flank_load import flank_load_picture
            from ..figures.style import save

            with watch.stage("picture"):
                title = f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}, load along the face width"
                picture = flank_load_picture(flanks, sweep, pair.wheel.base_radius, pair.path_limits(), title)
                save(picture, made / f"{name}_load.png")
                if roots is not None:
                    from ..figures.flank_load import root_picture

                    save(root_picture(root_columns(job, sweep, roots), title), made / f"{name}_root.png")
                if mesh.deviates and loads is not None:
                    from ..figures.flanks import flank_picture

                    save(flank_picture(mesh, pair, job.folder), made / "loadmap_flanks.png", dpi=110)
        watch.seconds["total"] = time.perf_counter() - started
        write_json(made / ("summary.json" if loads is None else "loadmap.json"), found)
        names = sorted(path.name for path in made.iterdir())
    print_results(report, folder, names, watch.seconds, sentences)
    unsettled = by_shafts is not None and not by_shafts.settled.all()
    return 1 if unsettled or (sweep.status != "converged").any() else 0
