"""Tables of a campaign, and its worst cases as job files."""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.base.files import whole_file, write_csv

from .campaign import Campaign
from .outcome import CLASSES, Outcome

#: How many defects, and how many of the slowest cases, are kept as files.
MOST_BAD, SLOWEST = 25, 3


def write_results(folder: Path, campaign: Campaign, seed: int, outcomes: Sequence[Outcome]) -> None:
    """``NAME_cases.csv`` (a row a case), ``NAME_outcomes.csv`` (a row a kind), reasons, further tables, kept cases."""
    if not outcomes:
        return
    name = campaign.name
    _rows(folder / f"{name}_cases.csv", case_rows(outcomes, seed))
    write_csv(folder / f"{name}_outcomes.csv", by_kind(outcomes))
    reasons = Counter(
        (row.outcome, re.sub(r"[-+]?\d[\d.e+-]*", "#", row.reason)[:160]) for row in outcomes if row.reason
    )
    table = [{"outcome": o, "reason": text, "cases": n} for (o, text), n in reasons.most_common()]
    _rows(folder / f"{name}_reasons.csv", table or [{"outcome": "", "reason": "", "cases": 0}])
    for title, columns in campaign.tables(outcomes).items():
        length = len(next(iter(columns.values()), ()))
        _rows(folder / f"{title}.csv", [{k: v[i] for k, v in columns.items()} for i in range(length)])
    keep_worst(folder / "kept", campaign, seed, outcomes)


def case_rows(outcomes: Sequence[Outcome], seed: int) -> list[dict[str, Any]]:
    """One row a case: class, seconds, reason, checks, measures."""
    measures = list(dict.fromkeys(key for row in outcomes for key in row.measures))
    rows = []
    for row in outcomes:
        made: dict[str, Any] = {"case": row.case, "seed": seed, "kind": row.kind, "outcome": row.outcome}
        made["seconds"] = float(f"{row.seconds:.4g}")
        worst = row.worst
        made |= {"worst_check": "" if worst is None else worst.name}
        made |= {"worst_share_of_limit": "" if worst is None else float(f"{worst.share:.4g}")}
        made["checks"] = "; ".join(f"{c.name} {c.value:.3g} of {c.limit:.3g}" for c in row.checks)
        made |= {key: row.measures.get(key, "") for key in measures}
        made["reason"] = row.reason
        rows.append(made)
    return rows


def by_kind(outcomes: Sequence[Outcome]) -> dict[str, list[Any]]:
    """One row a kind, the last one for all: counts of the classes, seconds, the check nearest to its limit."""
    kinds = [*dict.fromkeys(sorted(row.kind for row in outcomes)), "all"]
    columns: dict[str, list[Any]] = {"kind": kinds, "cases": []}
    columns |= {name: [] for name in CLASSES}
    columns |= {"median_s": [], "slowest_s": [], "worst_check": [], "worst_share_of_limit": []}
    for kind in kinds:
        rows = [row for row in outcomes if kind in ("all", row.kind)]
        counts = Counter(row.outcome for row in rows)
        columns["cases"].append(len(rows))
        for name in CLASSES:
            columns[name].append(counts[name])
        seconds = [row.seconds for row in rows]
        columns["median_s"].append(float(f"{np.median(seconds):.3g}"))
        columns["slowest_s"].append(float(f"{max(seconds):.3g}"))
        worst = max((w for row in rows if (w := row.worst)), key=lambda c: c.share, default=None)
        columns["worst_check"].append("" if worst is None else worst.name)
        columns["worst_share_of_limit"].append(0.0 if worst is None else float(f"{worst.share:.3g}"))
    return columns


def keep_worst(folder: Path, campaign: Campaign, seed: int, outcomes: Sequence[Outcome]) -> None:
    """Write the files of defects, of the slowest cases and of each check's nearest miss, with their rows."""
    chosen = [row for row in outcomes if row.bad][:MOST_BAD]
    chosen += sorted(outcomes, key=lambda row: -row.seconds)[:SLOWEST]
    names = dict.fromkeys(check.name for row in outcomes for check in row.checks)
    for name in names:
        shares = {row.case: c.share for row in outcomes for c in row.checks if c.name == name}
        chosen.append(max((row for row in outcomes if row.case in shares), key=lambda row: shares[row.case]))
    made = folder / campaign.name
    shutil.rmtree(made, ignore_errors=True)
    for row in {row.case: row for row in chosen}.values():
        case = campaign.case(seed, row.case)
        own = made / f"{row.case:05d}"
        own.mkdir(parents=True, exist_ok=True)
        case.write(own)
        again = f"python scripts/benchmarks/stress.py {campaign.name} --seed {seed} --case {row.case}"
        said = {**row.plain(), "seed": seed, "command": case.command, "again": again, "data": _json(case.data)}
        (own / "outcome.json").write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")


def _json(data: Mapping[str, Any]) -> dict[str, Any]:
    return {str(k): v if isinstance(v, (int, float, str, bool, list)) else repr(v) for k, v in data.items()}


def _rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """A table whose texts may hold commas and quotes."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
