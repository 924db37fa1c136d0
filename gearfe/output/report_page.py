"""The report of a run: pictures, figures, tables, job and versions in one HTML file that opens without a network."""

from __future__ import annotations

import base64
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
body { font: 15px/1.5 system-ui, sans-serif; color: #1b1f24; background: #fff }
body { max-width: 1060px; margin: 2em auto; padding: 0 1.5em }
h1 { font-size: 1.6em; margin: 0 } h2 { font-size: 1.2em; margin: 2em 0 .5em; border-bottom: 1px solid #d0d7de }
.under { color: #57606a; margin: .2em 0 1.5em } nav a { margin-right: 1.2em }
figure { margin: 1.2em 0 } figure img { max-width: 100%; height: auto; border: 1px solid #e4e8ec }
figcaption, summary { color: #57606a; font-size: .9em }
table { border-collapse: collapse; font-size: .86em; font-variant-numeric: tabular-nums }
td, th { border-bottom: 1px solid #e4e8ec; padding: .2em .9em .2em 0; text-align: left; vertical-align: top }
.wide { overflow-x: auto } .wide td, .wide th { text-align: right } .wide td { white-space: nowrap }
pre { background: #f6f8fa; padding: .8em 1em; font-size: .84em; white-space: pre-wrap; overflow-wrap: anywhere }
details { margin: .5em 0 } details table { margin-left: 1.2em }
@media print { body { max-width: none; margin: 0 } figure, tr { break-inside: avoid } }
"""


@dataclass(frozen=True)
class Report:
    """What a report holds.

    Attributes
    ----------
    title, command
        Heading, and the line that made the run.
    said
        What the command printed.
    summary
        Figures, as in ``summary.json``.
    tables
        Name -> columns.
    pictures
        Files.
    job
        Name and text of the job file.
    """

    title: str
    command: str
    said: str = ""
    summary: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    pictures: Sequence[Path] = ()
    job: tuple[str, str] = ("", "")


def report_page(report: Report, made: str) -> str:
    """The page.

    Parameters
    ----------
    report
        Its content.
    made
        When, for the heading.
    """
    parts = {
        "Results": f"<pre>{html.escape(report.said)}</pre>" if report.said else "",
        "Pictures": "".join(map(_figure, report.pictures)),
        "Numbers": _mapping(report.summary),
        "Tables": "".join(_table(name, columns) for name, columns in report.tables.items()),
        "Job": f"<p>{html.escape(report.job[0])}</p><pre>{html.escape(report.job[1])}</pre>" if report.job[1] else "",
        "Versions": _mapping({**versions(LIBRARIES), "system": f"{platform.system()} {platform.machine()}"}),
    }
    parts = {name: text for name, text in parts.items() if text}
    links = "".join(f'<a href="#{name.lower()}">{name}</a>' for name in parts)
    body = "".join(f'<h2 id="{name.lower()}">{name}</h2>\n{text}\n' for name, text in parts.items())
    title = html.escape(report.title)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>\n<body><h1>{title}</h1>'
        f'<p class="under">{html.escape(made)} &middot; <code>{html.escape(report.command)}</code></p>'
        f"<nav>{links}</nav>\n{body}</body></html>\n"
    )


def _figure(path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    name = html.escape(path.name)
    image = f'<img alt="{name}" src="data:{PICTURES[path.suffix]};base64,{data}">'
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
    return isinstance(value, (Mapping, list)) and (isinstance(value, Mapping) or any(map(_nested_or_list, value)))


def _nested_or_list(value: Any) -> bool:
    return isinstance(value, (Mapping, list))


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
