"""Pictures of a study: outputs against parameters, all cases as lines, changes over the parameters, the Pareto set."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..base.typing import Array
from ..study.statistics import StudyResult
from .style import BLUE, GREY, ORANGE, RED, headed, new_figure, save, shades, single, tidy

#: Parameters and outputs that a picture shows at most, and cases of which every one is drawn.
MOST, DRAWN = 6, 4000


def study_figures(folder: Path, result: StudyResult, summary: Mapping[str, Any], title: str) -> None:
    """Draw all pictures that a study has.

    Parameters
    ----------
    folder : Path
        Folder of the pictures.
    result
        The study.
    summary
        What its `summary` says.
    title : str
        Heading.
    """
    table, numbers, outputs = result.table, result.numbers(), _outputs(result)
    if not outputs:
        return
    if numbers:
        save(study_picture(result, title), folder / "study.png")
        _lines(folder / "study_lines.png", title, {**numbers, **outputs}, next(iter(outputs)))
        _tornado(folder / "study_tornado.png", title, {name: summary["outputs"][name] for name in outputs})
    aims = [*table.minimise, *table.maximise]
    if len(aims) == 2 and all(name in outputs for name in aims):
        _pareto(folder / "study_pareto.png", title, result, aims)


def _outputs(result: StudyResult) -> dict[str, Array]:
    """Outputs that some case has: values of the solved cases."""
    made = {name: np.where(result.done, result.output(name), np.nan) for name in result.table.outputs}
    return {name: values for name, values in made.items() if np.isfinite(values).any()}


def study_picture(result: StudyResult, title: str = "") -> Any:
    """Every output against every parameter, a point for each case; limits as lines.

    Without a parameter that is a number: against the number of the case.
    """
    parameters = result.numbers() or {"case": np.array([float(cell) for cell in result.cells["case"]])}
    outputs, limits = _outputs(result), result.table.limits
    names, rows = list(parameters)[:MOST], list(outputs)[:MOST]
    figure = new_figure(1.2 + 2.6 * len(names), 0.9 + 2.1 * len(rows))
    axes = figure.subplots(len(rows), len(names), squeeze=False, sharex="col", sharey="row")
    some = slice(None, None, -(-len(next(iter(outputs.values()))) // DRAWN) or 1)
    for i, row in enumerate(rows):
        for j, name in enumerate(names):
            part = axes[i, j]
            tidy(part)
            part.plot(parameters[name][some], outputs[row][some], ".", color=BLUE, markersize=6, alpha=0.6, mew=0)
            for end in (limits[row].low, limits[row].high) if row in limits else ():
                if end is not None:
                    part.axhline(end, color=RED, linewidth=1.0, dashes=(5, 3))
            if i == len(rows) - 1:
                part.set_xlabel(_short(name), fontsize=8.5)
        axes[i, 0].set_ylabel(row, fontsize=8.5)
    limited = "; dashed: limits" if any(name in limits for name in rows) else ""
    headed(figure, title + limited)
    return figure


def _lines(path: Path, title: str, columns: Mapping[str, Array], colour: str) -> None:
    """Every case as a line over its parameters and outputs, each scaled to its range; a column colours the lines."""
    from matplotlib.collections import LineCollection

    values = np.stack(list(columns.values()), axis=1)
    values = values[np.isfinite(values).all(axis=1)]
    values = values[:: -(-len(values) // DRAWN) or 1]
    figure = new_figure(max(6.0, 1.6 * values.shape[1]), 4.6)
    axes = figure.add_subplot()
    if len(values):
        low, high = values.min(axis=0), values.max(axis=0)
        span = np.where(high > low, high - low, 1.0)
        scaled = np.where(high > low, (values - low) / span, 0.5)
        of = values[:, list(columns).index(colour)]
        _, scale = shades(float(of.min()), float(of.max()) if np.ptp(of) > 0.0 else float(of.min()) + 1.0)
        places = np.arange(values.shape[1])
        lines = np.stack([np.broadcast_to(places, scaled.shape), scaled], axis=2)
        axes.add_collection(LineCollection(list(lines), colors=scale.to_rgba(of), linewidth=0.9, alpha=0.6))
        for place, (a, b) in enumerate(zip(low, high, strict=True)):
            axes.axvline(place, color=GREY, linewidth=0.8)
            axes.text(place, 1.03, f"{b:.4g}", ha="center", fontsize=8)
            axes.text(place, -0.03, f"{a:.4g}", ha="center", va="top", fontsize=8)
        figure.colorbar(scale, ax=axes, label=colour, shrink=0.9)
    axes.set_xticks(range(values.shape[1]), [_short(name) for name in columns], fontsize=8.5)
    axes.tick_params(axis="x", length=0, pad=16)
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    axes.set_xlim(-0.4, values.shape[1] - 0.6)
    axes.set_ylim(-0.1, 1.1)
    axes.set_title(title, fontsize=11, loc="left", pad=14)
    save(figure, path)


def _tornado(path: Path, title: str, outputs: Mapping[str, Mapping[str, Any]]) -> None:
    """How much each parameter changes each output (what the summary says of it), the largest on top."""
    sobol = {name: (one.get("sobol") or {}).get("total_order", {}) for name, one in outputs.items()}
    morris = {n: {p: e["mean_size"] for p, e in (one.get("morris") or {}).items()} for n, one in outputs.items()}
    effects, what = {n: _changes(one) for n, one in outputs.items()}, "change over the parameter's range:"
    if any("less" in one for one in outputs.values()):
        what = "a parameter off by its tolerance: change of"
    elif all(sobol.values()):
        effects, what = sobol, "Sobol's total index of"
    elif all(morris.values()):
        effects, what = morris, "mean size of the elementary effects on"
    rows = dict([(name, found) for name, found in effects.items() if found][:MOST])
    if not rows:
        return
    figure = new_figure(8.0, 0.8 + sum(0.75 + 0.28 * min(len(found), 10) for found in rows.values()))
    parts = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
    for part, (name, found) in zip(parts, rows.items(), strict=False):
        tidy(part)
        largest = sorted(found.items(), key=lambda item: abs(item[1]))[-10:]
        sizes = [value for _, value in largest]
        part.barh([_short(n, ", ") for n, _ in largest], sizes, color=[BLUE if v >= 0 else ORANGE for v in sizes])
        part.axvline(0.0, color="#374151", linewidth=0.9)
        part.set_xlabel(f"{what} {name}", fontsize=8.5)
        part.tick_params(labelsize=8.5)
    headed(figure, title)
    save(figure, path)


def _changes(one: Mapping[str, Any]) -> dict[str, float]:
    """Changes of an output over the ranges of a study, or off a search's best point by the tolerances."""
    if "less" not in one:
        return dict(one["effects"]["change"])
    return {f"{key} {sign}": value - one["best"] for sign in ("less", "more") for key, value in one[sign].items()}


def _pareto(path: Path, title: str, result: StudyResult, aims: list[str]) -> None:
    """Two outputs of all cases, and the cases that no other one beats."""
    outputs, best, good = _outputs(result), result.pareto(), result.good
    x, y = (outputs[name] for name in aims)
    figure, axes = single(6.4, 5.0, title)
    axes.plot(x[~good], y[~good], ".", color=GREY, alpha=0.5, mew=0, label="beyond a limit" if (~good).any() else None)
    axes.plot(x[good], y[good], ".", color=BLUE, alpha=0.7, mew=0, label="cases")
    order = best[np.argsort(x[best])]
    axes.plot(x[order], y[order], "o-", color=RED, markersize=5, linewidth=1.0, label="Pareto set")
    for number in order[:: -(-len(order) // 8) or 1]:
        axes.annotate(str(number), (x[number], y[number]), (5, 4), textcoords="offset points", fontsize=8, color=RED)
    axes.set_xlabel(aims[0])
    axes.set_ylabel(aims[1])
    axes.legend(fontsize=8.5, frameon=False)
    save(figure, path)


def _short(name: str, between: str = "\n") -> str:
    """The key on one line and its table on the other."""
    table, _, key = name.rpartition(".")
    return f"{key}{between}{table}" if table else key
