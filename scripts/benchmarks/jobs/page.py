"""The accuracy page: Markdown from a results folder, with its pictures beside it."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

from gearfe.base.errors import InputError
from gearfe.base.files import whole_file

from .pictures import PICTURES, draw_all, exponent
from .record import Row, read_rows
from .tables import SECTIONS, Section, digits, markdown

#: Comparisons of the summary: (heading, table, its part, column of time, peer -> wanted factor).
PEERS: tuple[tuple[str, str, dict[str, str], str, dict[str, int]], ...] = (
    ("sweep of 40 positions", "sweep_peers", {}, "sweep_cpu_s", {"calculix": 200, "getfem": 200}),
    ("Andrews' mechanism", "mechanism_tolerance", {"mechanism": "andrews"}, "cpu_s", {"sundials": 15, "exudyn": 100}),
    ("housing to reduced body", "housing_peers", {}, "cpu_s", {"exudyn": 4, "calculix": 4}),
    ("gear train, 7 ms", "transient_tolerance", {"variant": "operating"}, "cpu_s", {"exudyn": 10}),
    ("gear train, steady running", "runup_peers", {"variant": "operating"}, "cpu_s", {}),
    ("gear train, steady running, teeth part", "runup_peers", {"variant": "parting"}, "cpu_s", {}),
    ("gear train, teeth part", "transient_tolerance", {"variant": "parting"}, "cpu_s", {"exudyn": 10, "scipy_ivp": 10}),
)
HEAD = """# Accuracy and time

One command measures the values on this page, and another writes it:

```
python scripts/benchmarks/benchmark.py all --out {folder}
python scripts/benchmarks/benchmark.py --out {folder} --page docs/development/accuracy.md
```

"""


def write_page(results: str | Path, page: str | Path) -> list[Path]:
    """Write the page and copy its pictures to a folder beside it that bears its name; returns the files."""
    folder, target = Path(results), Path(page)
    run = folder / "run.json"
    if not run.exists():
        raise InputError("--out", str(results), "holds no results", "run scripts/benchmarks/benchmark.py first")
    draw_all(folder)
    pictures = target.with_suffix("")
    lines = [
        HEAD.format(folder=folder.name if folder.is_absolute() else folder),
        *_machine(json.loads(run.read_text())),
        "",
    ]
    made = [target]
    found = [(s, read_rows(folder / f"{s.table}.csv")) for s in SECTIONS if (folder / f"{s.table}.csv").exists()]
    remarks = folder / "remarks.md"  # of whoever ran it: what else the machine did, what is missing
    if remarks.exists():
        lines += [remarks.read_text(encoding="utf-8").strip(), ""]
    lines += summary({s.table: s.prepare(rows) for s, rows in found})
    for section, rows in found:
        lines += _section(section, section.prepare(rows), folder)
        picture = folder / f"{section.table}.png"
        if section.table in PICTURES and picture.exists():
            pictures.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(picture, pictures / picture.name)
            made.append(pictures / picture.name)
            lines += [f"![{section.title}]({pictures.name}/{picture.name})", ""]
    for path in sorted(folder.glob("*_outcomes*.csv")):
        lines += _outcomes(path)
    with whole_file(target) as temporary:
        temporary.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    return made


def _machine(state: dict[str, Any]) -> list[str]:
    machine, versions = state["machine"], state["versions"]
    told = ", ".join(f"{name} {value}" for name, value in versions.items() if value != "missing")
    gone = ", ".join(name for name, value in versions.items() if value == "missing")
    lines = [
        f"{machine['processor']}, {machine['cores']} cores, {machine['memory_GiB']} GiB, {machine['system']}; "
        f"one thread per program. {told}." + (f" Not installed: {gone}." if gone else ""),
        "CPU is processor time, the smallest of several runs; wall is the elapsed time of the quickest run.",
    ]
    if state["quick"]:
        lines.append("**These are the small settings of a smoke run, which say nothing about speed.**")
    return lines


def _section(section: Section, rows: list[Row], folder: Path) -> list[str]:
    out = folder.name if folder.is_absolute() else folder
    command = f"python scripts/benchmarks/benchmark.py {section.command} --out {out}"
    return [f"## {section.title}", "", section.text, "", f"`{command}`", "", *markdown(section.columns, rows), ""]


def _outcomes(path: Path) -> list[str]:
    """Any table of outcomes of the campaigns, as it is."""
    rows = read_rows(path)
    if not rows:
        return []
    columns = {name: (name.replace("_", " "), digits) for name in rows[0]}
    return [
        f"## Campaign: {path.stem.replace('_outcomes', '').replace('_', ' ')}",
        "",
        f"`{path.name}`",
        "",
        *markdown(columns, rows),
        "",
    ]


def summary(tables: dict[str, list[Row]]) -> list[str]:
    """How many times faster than each peer at equal or smaller error, and the exponents."""
    rows: list[tuple[str, str, str]] = []
    for title, table, part, time, wanted in PEERS:
        own = [r for r in tables.get(table, []) if all(r[n] == v for n, v in part.items())]
        for peer in dict.fromkeys(r["program"] for r in own if r["program"] != "gearfe"):
            least = f">= {wanted[peer]}" if peer in wanted else "-"
            rows.append((f"{title}: times faster than {peer}", _faster(own, peer, time), least))
    for title, table, x, y, goal in (
        ("sweep: exponent in positions", "sweep_positions", "positions", "cpu_s", "1"),
        ("chain: exponent of a step in bodies", "mechanism_chains", "bodies", "us_a_step", "<= 1.2"),
        ("housing: exponent of time in unknowns", "housing_sizes", "unknowns", "cpu_s", "<= 1.4"),
    ):
        own = tables.get(table, [])
        if len(own) > 1:
            rows.append((title, f"{exponent(own, x, y):.2f}", goal))
    if not rows:
        return []
    head = ["| comparison | measured | target |", "|---|---|---|"]
    note = (
        "Each run of another program is compared with the quickest run of gearfe whose error is not larger. "
        "The range is over the runs of that program, with the smallest factor first."
    )
    return ["## Summary", "", note, "", *head, *(f"| {a} | {b} | {c} |" for a, b, c in rows), ""]


def _faster(rows: list[Row], peer: str, time: str) -> str:
    """Range of theirs/ours over the peer's runs, each against our quickest run of equal or smaller error."""
    ours = [r for r in rows if r["program"] == "gearfe"]
    best = min((r["error"] for r in ours if _number(r.get("error"))), default=math.inf)
    found = []
    for row in rows:
        if row["program"] != peer or not _number(row.get("error")) or row["error"] > 0.1:
            continue
        limit = max(row["error"], best)
        times = [r[time] for r in ours if _number(r.get("error")) and r["error"] <= limit and _number(r.get(time))]
        if times and _number(row.get(time)):
            found.append(row[time] / min(times))
    if not found:
        return "no result of theirs"
    low, high = min(found), max(found)
    return f"{low:.3g}" if len(found) == 1 else f"{low:.3g} to {high:.3g}"


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and value == value  # noqa: PLR0124
