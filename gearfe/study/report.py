"""Lines that a study prints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def report_lines(summary: Mapping[str, Any]) -> list[str]:
    """What the command tells of a study."""
    statuses = ", ".join(f"{n} {status}" for status, n in summary["statuses"].items())
    lines = [f"{summary['cases']} cases: {statuses}; {summary['seconds_of_all_cases']:.3g} s of work"]
    for name, one in summary["outputs"].items():
        if not one["solved"]:
            lines.append(f"{name}: no case has a value")
            continue
        low, middle, high = (one["quantiles"][key]["value"] for key in ("5 %", "50 %", "95 %"))
        lines.append(f"{name}: base {one['base']:.5g}; median {middle:.5g}, 90 % of the cases {low:.5g} to {high:.5g}")
        if "yield" in one:
            lines.append(f"  within its limits: {_share(one['yield'])}")
        lines += _effects(one)
    if "yield" in summary:
        lines.append(f"within all limits: {_share(summary['yield'])}")
    if "pareto_cases" in summary:
        cases = summary["pareto_cases"]
        shown = ", ".join(map(str, cases[:12])) + (" ..." if len(cases) > 12 else "")
        lines.append(f"Pareto set: {len(cases)} cases ({shown})")
    return lines


def _effects(one: Mapping[str, Any]) -> list[str]:
    morris = one.get("morris")
    if morris:
        sizes = sorted(morris.items(), key=lambda item: -item[1]["mean_size"])
        parts = [f"{name} {e['mean_size']:.3g} (deviation {e['deviation']:.2g})" for name, e in sizes[:4]]
        return ["  elementary effects, mean size: " + ", ".join(parts)]
    sobol, change = one.get("sobol"), one["effects"]["change"]
    if sobol:
        totals = sorted(sobol["total_order"].items(), key=lambda item: -item[1])
        parts = [f"{name} {sobol['first_order'][name]:.2g} ({total:.2g})" for name, total in totals[:4]]
        return ["  Sobol's indices, first order (total): " + ", ".join(parts)]
    if not change:
        return []
    largest = sorted(change.items(), key=lambda item: -abs(item[1]))[:4]
    parts = [f"{name} {value:+.3g}" for name, value in largest]
    return [f"  change over a parameter's range: {', '.join(parts)} (linear, R2 {one['effects']['explained']:.2f})"]


def _share(found: Mapping[str, Any]) -> str:
    if found["share"] is None:
        return "no case is solved"
    low, high = found["interval"]
    share = f"{found['good']} of {found['cases']}, {100 * found['share']:.3g} %"
    return f"{share} (95 % interval {100 * low:.3g} to {100 * high:.3g} %)"
