"""``gearfe rating JOB.toml``: load capacity of the meshes of a file by ISO 6336."""

from __future__ import annotations

import argparse
import math
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import add_folder, add_job, add_keys, add_mesh, each_mesh, print_results, with_keys

if TYPE_CHECKING:
    from ..base.tables.gearbox import NamedMesh
    from ..base.tables.rating import RatingTable
    from ..drivetrain.gearbox.job import TrainJob
    from ..gears.gearmesh.rated import Compared
    from ..gears.rating.rate import Rating

#: Keys of the table [rating] that options stand for.
KEYS = ("edition", "torque_driver_Nm", "speed_rpm", "life_h", "application_factor", "quality")


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

    parser.add_argument(
        "--runup",
        metavar="FOLDER",
        help="results of gearfe runup of this file: its dynamic factor at the speed, next to K_v",
    )
    parser.add_argument(
        "--with-computed",
        action="store_true",
        help="rate with the computed K_Hbeta and, with --runup, the dynamic factor instead of the standard's",
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
    train = None
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
    rows: list[Compared] = []
    if args.computed or (args.with_computed and mesh.along_width()):
        from ..gears.gearmesh.job import stiffness_job
        from ..gears.gearmesh.rated import compared

        with stage("computing the mesh"):
            rows = compared(stiffness_job(mesh, Path(args.job).parent, pair), rating)
    if args.runup is not None:
        rows.append(_dynamic_factor(args.runup, train, mesh, rating))
    if args.with_computed:
        table = _with_computed(table, mesh, rows)
        sources = {"K_Hbeta": "from contact analysis", "K_v": "from the run-up"}
        computed = {row.name: sources[row.name] for row in rows if row.name in sources}
        rating = replace(rate_mesh(mesh, table, box.gears, box.meshes, pair), computed=computed)
    found: dict[str, Any] = rating_summary(rating, pair, table, mesh.name)
    if rows:
        found["computed"] = [row.row() for row in rows]
    if args.with_computed:
        found["factors"] = "K_Hbeta and K_v of computed, where they stand there"
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


def _dynamic_factor(folder: str, train: TrainJob | None, mesh: NamedMesh, rating: Rating) -> Compared:
    """Dynamic factor of a run-up at the speed of a rating, next to K_v.

    Raises
    ------
    InputError
        For a file without [train], a folder without a run-up of it, a speed beyond it, and one without a stable motion.
    """
    import csv

    from ..base.errors import InputError
    from ..drivetrain.gearbox.mesh_loads import drive_speed
    from ..gears.gearmesh.rated import DYNAMIC, Compared

    if train is None:
        raise InputError("--runup", folder, "is of a file with [train], which this one is not", "leave it out")
    path = Path(folder) / "runup.csv"
    number, speed = drive_speed(train, mesh.name, rating.load.speed)
    column = f"dynamic_factor_{number}"
    branches: dict[str, list[tuple[float, float, bool]]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                # motions whose stability is undecided, or was not computed, count as stable
                point = abs(float(row["speed_rad_per_s"])), float(row[column]), float(row.get("stable", 1.0)) != 0.0
                branches.setdefault(row.get("branch", ""), []).append(point)
    except (OSError, KeyError, ValueError, TypeError):
        problem = f"has no runup.csv with the columns speed_rad_per_s and {column}"
        raise InputError("--runup", folder, problem, "write the folder of gearfe runup of this file") from None
    speeds = [point[0] for points in branches.values() for point in points]
    if not all(map(math.isfinite, speeds)):
        raise InputError("--runup", folder, "has speeds that are not finite", "compute the run-up again")
    # a speed in 1/min meets that of a motion only up to rounding
    speed = next((at for at in speeds if math.isclose(at, speed, rel_tol=1e-9)), speed)
    if not speeds or not min(speeds) <= speed <= max(speeds):
        reach = f"reaches from {min(speeds):.4g} to {max(speeds):.4g} rad/s" if speeds else "has no speeds"
        problem = f"{reach}, and the drive turns at {speed:.4g} rad/s in this rating"
        raise InputError("--runup", folder, problem, "compute more speeds ([runup])")
    motions = [motion for points in branches.values() for motion in _motions_at(sorted(points), speed)]
    factors = [factor for factor, stable in motions if stable]
    if not factors:
        problem = f"has no stable motion at {speed:.4g} rad/s of the drive"
        raise InputError("--runup", folder, problem, "rate at another speed, or leave out --runup")
    if not all(map(math.isfinite, factors)):
        problem = f"has a {column} that is not finite next to {speed:.4g} rad/s of the drive"
        raise InputError("--runup", folder, problem, "rate at another speed, or leave out --runup")
    meaning = f"dynamic factor; computed: of the run-up at {speed:.4g} rad/s of the drive"
    return Compared(DYNAMIC, "-", rating.general.K_v, max(factors), meaning)


def _motions_at(points: list[tuple[float, float, bool]], speed: float) -> list[tuple[float, bool]]:
    """Dynamic factors of one branch at a speed, and whether each motion can be stable.

    Between two speeds the factor is interpolated; the motion can be stable if that at either end is.

    Parameters
    ----------
    points
        Speed (rad/s), dynamic factor and stability of the branch's motions, by speed.
    speed
        Of the drive (rad/s).
    """
    exact = [(factor, stable) for at, factor, stable in points if at == speed]
    if exact:
        return exact
    return [
        (low[1] + (high[1] - low[1]) * (speed - low[0]) / (high[0] - low[0]), low[2] or high[2])
        for low, high in pairwise(points)
        if low[0] < speed < high[0]
    ]


def _with_computed(table: RatingTable, mesh: NamedMesh, rows: list[Compared]) -> RatingTable:
    """Return the table with the computed face load factor and dynamic factor of a mesh, each at least 1.

    Raises
    ------
    InputError
        Where neither was computed.
    """
    from ..base.errors import InputError
    from ..base.tables.rating import MeshRatingTable
    from ..gears.gearmesh.rated import DYNAMIC, FACE_LOAD

    keys = {FACE_LOAD: "face_load_factor", DYNAMIC: "dynamic_factor"}
    factors: dict[str, Any] = {keys[row.name]: max(1.0, row.computed) for row in rows if row.name in keys}
    if not factors:
        problem = f"has nothing to take in mesh {mesh.name!r}: its load is alike along the face width"
        raise InputError("--with-computed", None, problem, "add --runup FOLDER, or helix modifications or tilts")
    own = table.meshes.get(mesh.name, MeshRatingTable())
    return replace(table, meshes={**table.meshes, mesh.name: replace(own, **factors)})


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
