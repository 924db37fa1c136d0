"""Evaluate many cases: quantiles, yield, sensitivities, Sobol's indices, the Pareto set; and the lines to print."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.files import whole_file
from ..base.shown import ShownTable, as_numbers, library, percent
from ..base.tables.study import LimitTable, StudyTable
from ..base.typing import Array, BoolArray, IntArray
from .case import DONE

#: Quantiles of the summary, and the confidence of all intervals.
QUANTILES, CONFIDENCE = (0.05, 0.25, 0.5, 0.75, 0.95), 0.95


@dataclass(frozen=True, repr=False)
class StudyResult(ShownTable):
    """Rows of a study, sorted by case.

    Attributes
    ----------
    table
        [study].
    cells
        Column -> its cells as text, as in ``study.csv``.
    base
        Outputs of the base job.
    """

    table: StudyTable
    cells: Mapping[str, Sequence[str]]
    base: Mapping[str, float]

    AXES = ("case",)

    def columns(self) -> Mapping[str, Sequence[str]]:
        """The rows as they stand in ``study.csv``."""
        return self.cells

    def facts(self) -> dict[str, str]:
        """Cases, and what they say of each output."""
        made = {"cases": f"{len(self.cells['case'])}, {int(self.done.sum())} solved"}
        made["parameters"] = ", ".join(self.parameters)
        for name in self.table.outputs:
            found = self.output(name)[self.done]
            if len(found):
                made[name] = f"{np.median(found):.5g} in the median, {found.min():.5g} to {found.max():.5g}"
        return made

    @property
    def parameters(self) -> tuple[str, ...]:
        """Dotted names of the parameters."""
        return tuple(self.cells)[1 : -3 - len(self.table.outputs)]

    @property
    def done(self) -> BoolArray:
        """(n,) cases that were solved wholly."""
        return np.array([status == DONE for status in self.cells["status"]])

    def output(self, name: str) -> Array:
        """(n,) values of an output, NaN where a case has none."""
        return np.array([float(cell) for cell in self.cells[name]])

    def numbers(self) -> dict[str, Array]:
        """(n,) values of the parameters that are numbers and vary."""
        every = {name: as_numbers(self.cells[name]) for name in self.parameters}
        return {name: x.astype(float) for name, x in every.items() if x.dtype != object and x.size and np.ptp(x) > 0}

    @property
    def good(self) -> BoolArray:
        """(n,) cases that were solved wholly and keep all limits."""
        kept = self.done.copy()
        for name, limit in self.table.limits.items():
            kept &= within(self.output(name), limit)
        return kept

    def pareto(self) -> IntArray:
        """Cases that no other one beats in all of minimise and maximise; none where there are no such outputs."""
        t = self.table
        aims = [self.output(n) for n in t.minimise] + [-self.output(n) for n in t.maximise]
        if not aims:
            return np.zeros(0, dtype=np.int64)
        values = np.stack(aims, axis=1)
        return pareto_set(np.where(self.done[:, None] & np.isfinite(values).all(axis=1)[:, None], values, np.inf))

    def summary(self) -> dict[str, Any]:
        """Content of summary.json."""
        done = self.done
        outputs: dict[str, Any] = {}
        for name in self.table.outputs:
            values = self.output(name)[done]
            values = values[np.isfinite(values)]
            outputs[name] = {"base": self.base[name], **spread(values)}
            if name in self.table.limits:
                outputs[name]["yield"] = share_within(values, self.table.limits[name], int(done.sum()))
            outputs[name]["effects"] = self.effects(name)
            if self.table.design == "saltelli":
                outputs[name]["sobol"] = self.sobol(name)
            if self.table.design == "morris":
                outputs[name]["morris"] = self.morris(name)
        made: dict[str, Any] = {
            "cases": len(done),
            "statuses": dict(Counter(self.cells["status"])),
            "outputs": outputs,
            "seconds_of_all_cases": float(sum(float(cell) for cell in self.cells["seconds"])),
        }
        if self.table.limits:
            made["yield"] = proportion(int(self.good.sum()), int(done.sum()))
        if self.table.minimise or self.table.maximise:
            made["pareto_cases"] = self.pareto().tolist()
        return made

    def effects(self, name: str) -> dict[str, Any]:
        """Return the changes of an output over the parameters, from a linear model of the solved cases.

        ``change``: parameter -> change of the output from the 5 to the 95 % quantile of the parameter. ``explained``:
        share R^2 of the variance that the linear model explains. ``rank_correlation``: Spearman's.
        """
        from scipy.stats import spearmanr

        numbers, values = self.numbers(), self.output(name)
        use = self.done & np.isfinite(values)
        y = values[use]
        if not numbers or len(y) < len(numbers) + 2 or not np.ptp(y) > 0.0:
            return {"change": {}, "explained": math.nan, "rank_correlation": {}}
        x = np.stack([one[use] for one in numbers.values()], axis=1)
        middle, scale = x.mean(axis=0), x.std(axis=0)
        scale[scale == 0.0] = 1.0
        model = np.column_stack([(x - middle) / scale, np.ones(len(y))])
        slope = np.linalg.lstsq(model, y, rcond=None)[0]
        left = y - model @ slope
        low, high = np.quantile(x, [0.05, 0.95], axis=0)
        change = slope[:-1] * (high - low) / scale
        ranks = [float(spearmanr(column, y).statistic) if np.ptp(column) > 0.0 else math.nan for column in x.T]
        return {
            "change": dict(zip(numbers, change.tolist(), strict=True)),
            "explained": 1.0 - float(left @ left) / float(((y - y.mean()) ** 2).sum()),
            "rank_correlation": dict(zip(numbers, ranks, strict=True)),
        }

    def sobol(self, name: str) -> dict[str, Any] | None:
        """Sobol's indices of first order and in total, with their intervals; None where a case has no answer.

        Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, by `scipy.stats.sobol_indices`.
        """
        from scipy.stats import sobol_indices

        d = len(self.parameters)
        values = self.output(name)
        if not (self.done & np.isfinite(values)).all():
            return None
        n = len(values) // (d + 2)
        parts = {"f_A": values[None, :n], "f_B": values[None, n : 2 * n], "f_AB": values[2 * n :].reshape(d, 1, n)}
        indices = sobol_indices(func=parts, n=n)
        entries: dict[str, Any] = {
            "first_order": dict(zip(self.parameters, indices.first_order.ravel().tolist(), strict=True)),
            "total_order": dict(zip(self.parameters, indices.total_order.ravel().tolist(), strict=True)),
        }
        boot = indices.bootstrap(confidence_level=CONFIDENCE, n_resamples=200)
        for key in ("first_order", "total_order"):
            ends = getattr(boot, key).confidence_interval
            low, high = np.ravel(ends.low).tolist(), np.ravel(ends.high).tolist()
            entries[f"{key}_interval"] = dict(zip(self.parameters, map(list, zip(low, high, strict=True)), strict=True))
        return entries

    def morris(self, name: str) -> dict[str, Any] | None:
        """Elementary effects of an output: parameter -> mean, mean size, deviation; None where a case has no value.

        An effect is the change of the output over the change of the parameter as a share of its distribution, along the
        trajectories of `gearfe.study.design.trajectories`. Sizes show what matters, deviations what is not linear or
        acts together with others (Morris 1991; Campolongo et al., Environ. Model. Softw. 22 (2007) 1509).
        """
        d, values = len(self.parameters), self.output(name)
        if not (self.done & np.isfinite(values)).all():
            return None
        cells = np.array([self.cells[one] for one in self.parameters], dtype=object).T.reshape(-1, d + 1, d)
        changes = np.diff(values.reshape(-1, d + 1), axis=1)
        moved = cells[:, 1:] != cells[:, :-1]  # (trajectories, steps, parameters): one each
        numbers = [_number(cell) for cell in cells.ravel()]
        rising = np.diff(np.array(numbers).reshape(cells.shape), axis=1) >= 0.0
        entries = {}
        for i, parameter in enumerate(self.parameters):
            own = moved[:, :, i]
            effects = np.where(rising[:, :, i], changes, -changes)[own] / 0.5
            entries[parameter] = {
                "mean": float(effects.mean()) if len(effects) else 0.0,
                "mean_size": float(np.abs(effects).mean()) if len(effects) else 0.0,
                "deviation": float(effects.std(ddof=1)) if len(effects) > 1 else 0.0,
            }
        return entries

    def to_parquet(self, path: str | Path) -> None:
        """Write the rows as an Apache Parquet file, whole or not at all."""
        pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
        with whole_file(path) as temporary:
            parquet.write_table(pyarrow.table({n: as_numbers(cells) for n, cells in self.cells.items()}), temporary)


def _number(cell: str) -> float:
    """A number; a text stands for 0, for it has no direction."""
    try:
        return float(cell)
    except ValueError:
        return 0.0


def spread(values: Array) -> dict[str, Any]:
    """Mean, deviation, ends and quantiles of a sample with the intervals that hold the true ones.

    The interval of a quantile lies between two order statistics. The number of values below it is binomial for every
    distribution (David & Nagaraja, Order Statistics, 3rd ed., section 7.1). It is null where n is too small.
    """
    from scipy.stats import binom

    n = len(values)
    if not n:
        return {"solved": 0}
    ordered = np.sort(values)
    quantiles = {}
    for share in QUANTILES:
        low = int(binom.ppf(0.5 * (1.0 - CONFIDENCE), n, share))
        high = int(binom.ppf(0.5 * (1.0 + CONFIDENCE), n, share)) + 1
        quantiles[f"{100 * share:g} %"] = {
            "value": float(np.quantile(values, share)),
            "interval": [
                float(ordered[low - 1]) if low >= 1 else None,
                float(ordered[high - 1]) if high <= n else None,
            ],
        }
    return {
        "solved": n,
        "mean": float(values.mean()),
        "deviation": float(values.std(ddof=1)) if n > 1 else None,
        "least": float(ordered[0]),
        "largest": float(ordered[-1]),
        "quantiles": quantiles,
    }


def within(values: Array, limit: LimitTable) -> BoolArray:
    """Return which values are within the limits."""
    low = -math.inf if limit.low is None else limit.low
    high = math.inf if limit.high is None else limit.high
    return (low <= values) & (values <= high)


def share_within(values: Array, limit: LimitTable, cases: int) -> dict[str, Any]:
    """Share of solved cases that are good."""
    return proportion(int(within(values, limit).sum()), cases)


def proportion(good: int, cases: int) -> dict[str, Any]:
    """A share with its interval (Clopper & Pearson, Biometrika 26 (1934) 404)."""
    from scipy.stats import binomtest

    if not cases:
        return {"good": 0, "cases": 0, "share": None, "interval": None}
    ends = binomtest(good, cases).proportion_ci(CONFIDENCE, method="exact")
    return {"good": good, "cases": cases, "share": good / cases, "interval": [float(ends.low), float(ends.high)]}


def pareto_set(values: Array) -> IntArray:
    """Return the rows of (n, k) that no other row dominates, in rising order.

    A row dominates another one if it is as small in all columns and smaller in one.

    Rows that are infinite take no part.
    """
    finite = np.flatnonzero(np.isfinite(values).all(axis=1))
    order = finite[np.lexsort(values[finite].T[::-1])]
    kept: list[int] = []
    for row in order:  # who beats a row stands before it
        others = values[kept]
        if not kept or not ((others <= values[row]).all(axis=1) & (others < values[row]).any(axis=1)).any():
            kept.append(int(row))
    return np.array(sorted(kept), dtype=np.int64)


def report_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lines for the terminal."""
    statuses = ", ".join(f"{n} {status}" for status, n in summary["statuses"].items())
    lines = [f"{summary['cases']} cases: {statuses}; {summary['seconds_of_all_cases']:.3g} s of computing time"]
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
        parts = [f"{name} {e['mean_size']:.3g} (standard deviation {e['deviation']:.2g})" for name, e in sizes[:4]]
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
    explained = f"linear model, R2 {one['effects']['explained']:.2f}"
    return [f"  change over the range of each parameter: {', '.join(parts)} ({explained})"]


def _share(found: Mapping[str, Any]) -> str:
    if found["share"] is None:
        return "no case is solved"
    low, high = found["interval"]
    share = f"{found['good']} of {found['cases']}, {percent(found['share'], 3)}"
    return f"{share} (95 % interval {percent(low, 3)} to {percent(high, 3)})"
