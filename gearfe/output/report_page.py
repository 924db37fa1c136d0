"""Write the report of one run or of a gearbox as one HTML file that opens offline.

Job files, names and results come from strangers, so every text is escaped. There are no scripts and no external
resources. What is needed for checking only (all figures, printed lines, first rows of the tables, the job file) is
folded, and is not printed.
"""

from __future__ import annotations

import base64
import hashlib
import html
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..base.cache import versions
from ..base.typing import Array

#: Libraries whose versions the page lists.
LIBRARIES = ("numpy", "scipy", "scikit-fem", "gmsh", "meshio", "numba", "h5py", "matplotlib", "pyvista")
#: Rows that are shown of a table, entries of a list, and pictures' kinds.
ROWS, ENTRIES = 10, 12
PICTURES = {".png": "image/png", ".gif": "image/gif", ".svg": "image/svg+xml"}
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1f24; background: #fff }
body { max-width: 1000px; margin: 2em auto; padding: 0 1.5em }
h1 { font-size: 1.6em; margin: 0 } h2 { font-size: 1.25em; margin: 1.6em 0 .5em; border-bottom: 1px solid #d0d7de }
h3 { font-size: 1em; margin: 1em 0 .3em }
.under { color: #57606a; margin: .2em 0 .4em } .remark { margin: .4em 0 1em; white-space: pre-line }
figure { margin: .8em 0 } figure img { max-width: 100%; height: auto }
figcaption, summary { color: #57606a; font-size: .9em }
table { border-collapse: collapse; font-size: .86em; font-variant-numeric: tabular-nums }
td, th { border-bottom: 1px solid #e4e8ec; padding: .15em .9em .15em 0; text-align: left; vertical-align: top }
th { font-weight: 600 } td.n, th.n { text-align: right }
.side { display: flex; flex-wrap: wrap; gap: 0 2.5em; align-items: flex-start }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr)); gap: 0 1.5em }
.wide + .under { font-size: .86em } .wide { overflow-x: auto; max-width: 100% } .wide td { white-space: nowrap }
pre { background: #f6f8fa; padding: .8em 1em; font-size: .84em; white-space: pre-wrap; overflow-wrap: anywhere }
details { margin: .4em 0 } details table { margin-left: 1.2em }
@page { size: A4; margin: 12mm }
@media print {
  body { max-width: none; margin: 0; padding: 0; font: 8pt/1.22 system-ui, sans-serif }
  td, th { padding: .02em .6em .02em 0 }
  .side { gap: 0 1.2em } .pictures { grid-template-columns: repeat(2, 1fr); gap: 0 4mm }
  .many { grid-template-columns: repeat(3, 1fr) } .single { grid-template-columns: 1fr }
  figure { margin: .4em 0 } figure img { max-height: 58mm; width: auto } figure, tr { break-inside: avoid }
  .one .pictures { grid-template-columns: 1fr } .one img { max-height: 76mm } .single img { max-height: 82mm }
  pre { columns: 60mm; font-size: 6.4pt }
  table { break-inside: avoid }
  h2, h3 { break-after: avoid } h2 { margin: .7em 0 .3em } h3 { margin: .6em 0 .2em } .under { margin: .1em 0 }
  details { display: none } .wide { overflow: visible } .wide td { white-space: normal }
  .wide td:first-child { white-space: nowrap }
}
"""


@dataclass(frozen=True)
class Heading:
    """Title, author, remark and date of a report."""

    title: str
    author: str = ""
    remark: str = ""
    date: str = ""


@dataclass(frozen=True)
class Sheet:
    """A table of a report.

    Attributes
    ----------
    title
        Above it.
    head
        Heads of the columns; empty for none.
    rows
        Cells as texts.
    note
        Below it.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


@dataclass(frozen=True)
class Picture:
    """A picture: name, kind (MIME) and bytes."""

    name: str
    kind: str
    content: bytes


@dataclass(frozen=True)
class Run:
    """One run in a report.

    Attributes
    ----------
    title, command
        Heading; the line that made the run, if it is known.
    said
        What the command printed.
    sheets
        Tables of results.
    summary
        All figures, as in the summary.
    tables
        Name -> columns; their first rows are folded.
    pictures
        Caption -> file.
    """

    title: str
    command: str = ""
    said: str = ""
    sheets: Sequence[Sheet] = ()
    summary: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    pictures: Mapping[str, Path] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """Content of a report.

    Attributes
    ----------
    heading
        Title, author, remark, date.
    gears
        Pictures and tables of the gears.
    runs
        The runs.
    job
        Name and text of the job file; empty without one.
    loads
        Tables of the loads of a gearbox.
    """

    heading: Heading
    gears: tuple[Sequence[Picture], Sequence[Sheet]] = ((), ())
    runs: Sequence[Run] = ()
    job: tuple[str, str] = ("", "")
    loads: Sequence[Sheet] = ()


def picture_of(path: Path, name: str = "") -> Picture:
    """A picture from a file, with its own name by default."""
    return Picture(name or path.name, PICTURES[path.suffix], path.read_bytes())


def report_page(report: Report) -> str:
    """Return the page."""
    pictures, sheets = report.gears
    parts = [("Gears", _figures(pictures) + _sheets(sheets))] if pictures or sheets else []
    if report.loads:
        parts.append(("Loads", _sheets(report.loads)))
    parts += [(run.title, _run(run)) for run in report.runs]
    parts.append(("Provenance", _provenance(report)))
    body = "".join(f"<h2>{html.escape(name)}</h2>\n{text}\n" for name, text in parts)
    heading = report.heading
    kind = ' class="one"' if len(report.runs) == 1 else ""
    title = html.escape(heading.title)
    under = " &middot; ".join(html.escape(text) for text in (heading.author, heading.date) if text)
    remark = f'<p class="remark">{html.escape(heading.remark)}</p>' if heading.remark else ""
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>\n<body{kind}>'
        f'<h1>{title}</h1><p class="under">{under}</p>{remark}\n{body}</body></html>\n'
    )


def _run(run: Run) -> str:
    """Tables and pictures of a run, and folded what is needed for checking."""
    folded = {
        "What the command printed": f"<pre>{html.escape(run.said)}</pre>" if run.said else "",
        "All figures": _mapping(run.summary),
        "Tables": "".join(_table(name, columns) for name, columns in run.tables.items()),
    }
    text = _sheets(run.sheets) + _figures([picture_of(path, name) for name, path in run.pictures.items()])
    if not run.sheets and run.said:
        text += f"<pre>{html.escape(run.said)}</pre>"
        del folded["What the command printed"]
    details = (f"<details><summary>{name}</summary>{inside}</details>" for name, inside in folded.items() if inside)
    return text + "".join(details)


def _provenance(report: Report) -> str:
    """Versions, the job file with its hash, the commands."""
    name, text = report.job
    rows = {"program": f"gearfe {versions()['gearfe']}, {platform.system()} {platform.machine()}"}
    if text:
        rows |= {"job file": name, "its SHA-256": hashlib.sha256(text.encode("utf-8")).hexdigest()}
    rows |= {f"command, {run.title}": run.command for run in report.runs if run.command}
    libraries = f"<details><summary>Versions</summary>{_mapping(versions(LIBRARIES))}</details>"
    job = f"<details><summary>Job file</summary><pre>{html.escape(text)}</pre></details>" if text else ""
    return _mapping(rows) + libraries + job


def _sheets(sheets: Sequence[Sheet]) -> str:
    """Tables, narrow ones next to each other."""
    return '<div class="side">' + "".join(f"<div>{_sheet(sheet)}</div>" for sheet in sheets) + "</div>\n"


def _figures(pictures: Sequence[Picture]) -> str:
    """Pictures, on paper two or three in a row."""
    if not pictures:
        return ""
    across = " single" if len(pictures) == 1 else " many" if all(map(_upright, pictures)) else ""
    return f'<div class="pictures{across}">' + "".join(map(_figure, pictures)) + "</div>\n"


def _upright(picture: Picture) -> bool:
    """Whether a PNG is less than 1.3 times as wide as it is high."""
    width, height = (int.from_bytes(picture.content[i : i + 4], "big") for i in (16, 20))
    return picture.kind == "image/png" and width < 1.3 * height


def _sheet(sheet: Sheet) -> str:
    """A table with its title and note."""
    head = "".join(f"<th{_right(i)}>{html.escape(cell)}</th>" for i, cell in enumerate(sheet.head))
    rows = "".join(
        "<tr>" + "".join(f"<td{_right(i)}>{html.escape(cell)}</td>" for i, cell in enumerate(row)) + "</tr>"
        for row in sheet.rows
    )
    title = f"<h3>{html.escape(sheet.title)}</h3>" if sheet.title else ""
    note = f'<p class="under">{html.escape(sheet.note)}</p>' if sheet.note else ""
    head = f"<thead><tr>{head}</tr></thead>" if head else ""
    return f'{title}<div class="wide"><table>{head}{rows}</table></div>{note}\n'


def _right(column: int) -> str:
    """Numbers stand to the right of the first column."""
    return ' class="n"' if column else ""


def _figure(picture: Picture) -> str:
    data = base64.b64encode(picture.content).decode("ascii")
    name = html.escape(picture.name)
    image = f'<img alt="{name}" src="data:{picture.kind};base64,{data}">'
    return f"<figure>{image}<figcaption>{name}</figcaption></figure>\n"


def _mapping(values: Mapping[str, Any]) -> str:
    """Plain values in a table; what is nested folds open below."""
    plain = {name: value for name, value in values.items() if not _nested(value)}
    rows = "".join(f"<tr><td>{html.escape(name)}</td><td>{_value(value)}</td></tr>" for name, value in plain.items())
    text = f"<table>{rows}</table>" if rows else ""
    for name, value in values.items():
        if _nested(value):
            inside = value if isinstance(value, Mapping) else {str(i + 1): one for i, one in enumerate(value[:ENTRIES])}
            text += f"<details><summary>{html.escape(name)} ({len(value)})</summary>{_mapping(inside)}</details>"
    return text


def _nested(value: Any) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, list) and any(isinstance(x, (Mapping, list)) for x in value)
    )


def _value(value: Any) -> str:
    if isinstance(value, list):
        more = f", ... ({len(value)})" if len(value) > ENTRIES else "" if value else "-"
        return ", ".join(map(_value, value[:ENTRIES])) + more
    if isinstance(value, float):
        return f"{value:.6g}"
    return "-" if value in (None, "") else html.escape(str(value))


def _table(name: str, columns: Mapping[str, Array]) -> str:
    count = len(next(iter(columns.values()), ()))
    heads = "".join(f"<th>{html.escape(column)}</th>" for column in columns)
    rows = "".join(
        "<tr>" + "".join(f"<td>{_cell(values[i])}</td>" for values in columns.values()) + "</tr>"
        for i in range(min(count, ROWS))
    )
    more = f"{count} rows, {len(columns)} columns" + (f"; the first {ROWS}" if count > ROWS else "")
    opened = f"<details><summary>{html.escape(name)}.csv: {more}</summary>"
    return f'{opened}<div class="wide"><table><tr>{heads}</tr>{rows}</table></div></details>\n'


def _cell(value: Any) -> str:
    number = isinstance(value, float)
    if number and not math.isfinite(value):
        return "-"
    return f"{value:.6g}" if number else html.escape(str(value))
