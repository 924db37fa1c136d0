"""``gearfe rating JOB.toml``: load capacity of the meshes of a file by ISO 6336."""

from __future__ import annotations

import argparse
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import add_folder, add_job, add_keys, add_mesh, each_mesh, print_results, with_keys

if TYPE_CHECKING:
    from ..base.tables.gearbox import NamedMesh
    from ..base.tables.rating import RatingTable
    from ..gears.gearmesh.rated import Compared

#: Keys of the table [rating] that options stand for.
KEYS = ("edition", "torque_Nm", "speed_rpm", "life_h", "application_factor", "quality")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    from ..base.tables.rating import RatingTable

    add_job(parser, "job", "job file with gears and the table [rating]")
    add_mesh(parser)
    add_folder(parser)
    add_keys(parser, RatingTable, *KEYS)
    parser.add_argument(
        "--computed",
        action="store_true",
        help="also compute stiffness, pressure and root stress by finite elements",
    )


def run(args: argparse.Namespace) -> int:
    """Rate each mesh; write rating.json, rating.csv and rating.png."""
    return each_mesh(args, _run_mesh)


def _run_mesh(args: argparse.Namespace, mesh: NamedMesh) -> int:
    """The rating of one mesh."""
    from ..base.config import read_toml
    from ..base.errors import unknown_name
    from ..base.tables.jobs import job_tables, whole_gearbox

    raw = read_toml(args.job)
    table = _with_options(args, job_tables(raw, args.job, ("rating",))["rating"])
    box = whole_gearbox(raw, args.job)
    if "train" in raw:
        from ..base.tables.jobs import train_tables
        from ..drivetrain.gearbox.job import train_job
        from ..drivetrain.gearbox.mesh_loads import with_train

        for kind, known in (("gears", box.gears), ("meshes", box.meshes)):
            for name in getattr(table, kind):  # before names of the train are added
                if name not in known:
                    raise unknown_name(f"rating.{kind}", name, known)
        names = mesh.driver.name, mesh.driven.name
        train = train_job(args.job, train_tables(raw, args.job))
        table = with_train(table, train, mesh.name, names, mesh.stiffness.torque_Nm is not None)

    from ..gears.geometry.pair import pair_of
    from ..gears.rating.rate import rate_mesh

    pair = pair_of(mesh)
    rating = rate_mesh(mesh, table, box.gears, box.meshes, pair)

    from ..base.files import output_folder, whole_set, write_csv, write_json
    from ..base.progress import stage
    from ..gears.rating.report import rating_lines, rating_summary

    folder = output_folder(args.out)
    found: dict[str, Any] = rating_summary(rating, pair, table, mesh.name)
    rows: list[Compared] = []
    if args.computed:
        from ..gears.gearmesh.job import stiffness_job
        from ..gears.gearmesh.rated import compared

        with stage("computing the mesh"):
            rows = compared(stiffness_job(mesh, Path(args.job).parent, pair), rating)
        found["computed"] = [row.row() for row in rows]
    with whole_set(folder, ("rating.png",)) as made:
        if not args.no_pictures:
            from ..figures.rating import rating_picture
            from ..figures.style import save

            with stage("drawing"):
                save(rating_picture(rating, found.get("computed", ())), made / "rating.png")
        write_json(made / "rating.json", found)
        write_csv(made / "rating.csv", dict(rating.columns()))
        files = sorted(path.name for path in made.iterdir())
    lines = rating_lines(rating)
    if rows:
        from ..gears.gearmesh.rated import compared_lines

        lines += compared_lines(rows)
    print_results(lines, folder, files, {}, found["warnings"])
    return 0


def _with_options(args: argparse.Namespace, table: RatingTable) -> RatingTable:
    """Return the table with the options that were given, which override the keys of single gears and meshes, too."""
    given = [key for key in KEYS if getattr(args, key) is not None]

    def without(single: Any) -> Any:
        return replace(single, **{field.name: None for field in fields(single) if field.name in given})

    changed: RatingTable = with_keys(args, table, *KEYS)
    return replace(
        changed,
        gears={name: without(single) for name, single in table.gears.items()},
        meshes={name: without(single) for name, single in table.meshes.items()},
    )
