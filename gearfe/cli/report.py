"""``gearfe report JOB.toml``: one page of all results of a job: stiffness, load map, vibration, run-up, rating."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import REPORT, add_heading, add_job, add_json, print_results

if TYPE_CHECKING:
    from ..output.report_page import Run


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "job", "job file")
    parser.add_argument(
        "--results",
        metavar="DIR",
        help="folder that holds the folders of results (default: out/JOB, as of all commands)",
    )
    parser.add_argument("--out", metavar="DIR", help="folder of report.html (default: that of the results)")
    parser.set_defaults(format="csv")
    add_heading(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Collect the results and write report.html."""
    from ..base.config import read_toml
    from ..base.errors import InputError
    from ..base.files import output_folder, whole_set
    from ..base.progress import stage
    from ..output.report_sheets import PICTURES_OF_RUN, PICTURES_OF_SEVERAL, date_of, joined, run_of
    from ..output.results import KINDS, kinds_of, read_all
    from .reporting import heading_of, write_report

    raw, job = read_toml(args.job), Path(args.job)
    place = Path(args.results or Path("out") / job.stem)
    folders = [
        path
        for path in (place, *sorted(place.glob("*")), *sorted(place.glob("*/*")))
        if path.is_dir() and kinds_of(path)
    ]
    if not folders:
        known = ", ".join(kind.name for kind in KINDS)
        raise InputError(
            "--results", str(place), f"holds no results of {known}", f"run gearfe stiffness {job.name} first"
        )
    found = [
        results
        for folder in folders
        for results in read_all(folder, "--results", "/".join(folder.relative_to(place).parts) or folder.name)
    ]
    found.sort(
        key=lambda results: (
            [kind.name for kind in KINDS].index(results.kind.name) if results.kind.name != "rating" else -1
        )
    )
    newest = max((results.path for results in found), key=lambda path: path.stat().st_mtime)
    old = dict.fromkeys(results.name for results in found if results.path.stat().st_mtime < job.stat().st_mtime)
    most = PICTURES_OF_RUN if len(found) == 1 else PICTURES_OF_SEVERAL
    kinds: dict[str, dict[str, Run]] = {}
    drawn = set()
    for results in found:
        place_of = results.path.parent
        kinds_there = sum(other.path.parent == place_of for other in found)
        # the pictures of a folder with several kinds of results are in the first of them
        run = run_of(results, most=0 if place_of in drawn else kinds_there * most)
        kinds.setdefault(run.title, {})[results.name.removeprefix(f"{results.kind.name}/")] = run
        drawn.add(place_of)
    runs = [
        joined(title, alike) if len(alike) > 1 else replace(run, title=f"{title} ({name})")
        for title, alike in kinds.items()
        for name, run in list(alike.items())[:1]
    ]
    folder = output_folder(args.out or place)
    with whole_set(folder, (REPORT,)) as made, stage("report"):
        heading = heading_of(args, raw, job.stem, date_of(newest))
        write_report(made, heading, runs, raw, str(job))
    names = [results.name for results in found]
    shown = [
        f"{results.name} ({results.kind.name})" if names.count(results.name) > 1 else results.name for results in found
    ]
    lines = [f"{len(found)} runs: {', '.join(shown)}"]
    warnings = [f"{name} is older than the last change of {job.name}: run it again" for name in old]
    print_results(lines, folder, [REPORT], {}, warnings)
    return 0
