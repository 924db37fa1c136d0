"""Which pictures a study has, and what is on them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..figures.study import parallel_figure, pareto_figure, scatter_figure, tornado_figure
from .statistics import StudyResult


def write_figures(folder: Path, result: StudyResult, summary: Mapping[str, Any], title: str) -> None:
    """All pictures that a study has.

    Parameters
    ----------
    result
        The study.
    summary
        What its `summary` says.
    """
    table, numbers = result.table, result.numbers()
    outputs = {name: np.where(result.done, result.output(name), np.nan) for name in table.outputs}
    outputs = {name: values for name, values in outputs.items() if np.isfinite(values).any()}
    if not outputs:
        return
    if numbers:
        limits = {name: (limit.low, limit.high) for name, limit in table.limits.items()}
        scatter_figure(folder / "study.png", title=title, parameters=numbers, outputs=outputs, limits=limits)
        columns = {**numbers, **outputs}
        parallel_figure(folder / "study_lines.png", title=title, columns=columns, colour=next(iter(outputs)))
        sobol = {name: (summary["outputs"][name].get("sobol") or {}).get("total_order", {}) for name in outputs}
        morris = {name: _sizes(summary["outputs"][name].get("morris") or {}) for name in outputs}
        whole = all(sobol.values())
        effects = {name: summary["outputs"][name]["effects"]["change"] for name in outputs}
        effects = sobol if whole else morris if all(morris.values()) else effects
        if any(effects.values()):
            what = "Sobol's total index of" if whole else "change over the parameter's range:"
            what = "mean size of the elementary effects on" if effects is morris else what
            notes = {name: f"{what} {name}" for name in outputs}
            tornado_figure(folder / "study_tornado.png", title=title, effects=effects, notes=notes)
    aims = [*table.minimise, *table.maximise]
    if len(aims) == 2 and all(name in outputs for name in aims):
        pair = [(name, outputs[name]) for name in aims]
        best, good = result.pareto(), result.good
        pareto_figure(folder / "study_pareto.png", title=title, first=pair[0], second=pair[1], best=best, good=good)


def _sizes(effects: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    return {name: one["mean_size"] for name, one in effects.items()}
