"""What commands with ``--report`` and `gearfe report` share: heading, pictures and data of the gears, the page."""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.tables.report import ReportTable
from .arguments import HEADING, REPORT, with_keys

if TYPE_CHECKING:
    from ..output.report_page import Heading, Picture, Run, Sheet

#: Meshes whose gears a report has at most.
MOST_MESHES = 6


def heading_of(args: argparse.Namespace, raw: dict[str, Any], title: str, date: str) -> Heading:
    """Heading by the options, else by the table [report] of the job, else with these texts.

    Parameters
    ----------
    args : Namespace
        The command line.
    raw : dict
        The parsed job; empty without one.
    title, date : str
        What stands there without options and keys.
    """
    from ..base.config import build
    from ..output.report_page import Heading

    table = build(ReportTable, raw["report"], "report") if "report" in raw else ReportTable()
    table = with_keys(args, table, **HEADING)
    return Heading(table.title or title, table.author, table.remark, table.date or date)


def gears_of(raw: dict[str, Any], job: str) -> tuple[list[Picture], list[Sheet]]:
    """Picture of the whole gearbox, or of the one pair, and data of the gears; nothing for jobs without gears."""
    from ..base.errors import InputError
    from ..base.tables.jobs import whole_gearbox
    from ..output.report_sheets import gear_sheets

    if not {"pair", "gears"} & raw.keys():
        return [], []
    from ..gears.gearmesh.job import materials_of
    from ..gears.geometry.derived import derived_geometry
    from ..gears.geometry.pair import pair_of

    gears: dict[str, dict[str, Any]] = {}
    pairs: dict[str, dict[str, Any]] = {}
    pictures: list[Picture] = []
    try:
        meshes = list(whole_gearbox(raw, job).meshes.values())
        for mesh in meshes[:MOST_MESHES]:
            pair = pair_of(mesh)
            pairs[mesh.name] = geometry = derived_geometry(pair)
            both = zip(mesh.gears, ("pinion", "wheel"), (pair.pinion, pair.wheel), materials_of(mesh), strict=True)
            for named, side, gear, material in both:
                gears[named.name] = {
                    **geometry[side],
                    "pressure_angle_deg": math.degrees(gear.pressure_angle),
                    "helix_angle_deg": math.degrees(gear.helix_angle) if gear.helical else None,
                    "face_width_mm": 1e3 * gear.face_width,
                    "youngs_modulus_GPa": 1e-9 * material.youngs_modulus,
                }
        pictures = _drawn(raw, job, pair_of(meshes[0]))
    except InputError as error:
        print(f"gearfe: warning: the gears are not in the report: {error}", file=sys.stderr)
    return pictures, gear_sheets(gears, pairs)


def loads_of(raw: dict[str, Any], job: str) -> list[Sheet]:
    """Loads of meshes and bearings in steady running; nothing for jobs that are no gearbox."""
    from ..base.errors import InputError

    if "train" not in raw:
        return []
    from ..drivetrain.gearbox.overview import overview_sheets

    try:
        return overview_sheets(job, raw)
    except InputError as error:
        print(f"gearfe: warning: the loads are not in the report: {error}", file=sys.stderr)
        return []


def _drawn(raw: dict[str, Any], job: str, pair: Any) -> list[Picture]:
    """Picture of the whole gearbox of a file with shafts, else of a pair."""
    from ..base.errors import InputError
    from ..drivetrain.gearbox.layout import gearbox_layout
    from ..figures.gearbox import gearbox_picture
    from ..figures.gears import pair_picture
    from ..figures.style import save
    from ..output.report_page import picture_of

    layout = None
    if "shafts" in raw or "train" in raw:
        try:
            layout = gearbox_layout(raw, job)
        except InputError:
            layout = None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / ("gear_pair.png" if layout is None else "gearbox.png")
        save(pair_picture(pair) if layout is None else gearbox_picture(layout), path)
        return [picture_of(path)]


def write_report(folder: Path, heading: Heading, runs: Sequence[Run], raw: dict[str, Any], job: str | None) -> None:
    """Write the page into a folder.

    Parameters
    ----------
    folder : Path
        The folder.
    heading : Heading
        Title, author, remark, date.
    runs : sequence of Run
        The runs.
    raw : dict
        The parsed job; empty without one.
    job : str, optional
        The job file.
    """
    from ..output.report_page import Report, report_page

    text = "" if job is None else Path(job).read_text(encoding="utf-8-sig")
    pictures, sheets = gears_of(raw, job) if job is not None else ([], [])
    shown = {name for run in runs for name in run.pictures}
    gears = [picture for picture in pictures if picture.name not in shown], sheets
    loads = [] if job is None else loads_of(raw, job)
    page = Report(heading, gears, runs, ("", "") if job is None else (Path(job).name, text), loads)
    (folder / REPORT).write_text(report_page(page), encoding="utf-8", errors="backslashreplace", newline="\n")
