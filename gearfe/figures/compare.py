"""Picture of a comparison: curves of two or three runs over each other, a panel for each quantity."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..base.typing import Array
from ..output.differences import Comparison
from ..output.run_curves import Line, Panel
from .style import BLUE, GREEN, GREY, ORANGE, headed, new_figure, tidy

#: Colour and dashes of each run.
COLOURS, DASHES = (BLUE, ORANGE, GREEN), ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))
#: Points of a curve that are drawn at most, as an envelope of the others.
MOST_POINTS = 4000
#: Lines of a spectrum that are drawn at most as stems; of more, their curve is.
STEMS = 250
#: Panels beside each other.
COLUMNS = 2


def comparison_picture(made: Comparison) -> Any:
    """Draw panels of the curves of all runs with error bands, and below them the differences to the first."""
    panels = made.panels
    rows = max(1, -(-len(panels) // COLUMNS))
    figure = new_figure(6.2 * min(COLUMNS, max(len(panels), 1)), 0.9 + 3.4 * rows)
    headed(figure, f"Comparison, {made.results[0].kind.title}: " + ", ".join(run.name for run in made.results))
    for number, panel in enumerate(panels):
        axes = figure.add_subplot(rows, min(COLUMNS, len(panels)), number + 1)
        tidy(axes)
        _draw(axes, panel)
    return figure


def _draw(axes: Any, panel: Panel) -> None:
    runs = len({line.run for line in panel.lines})
    places = sorted({float(x) for line in panel.lines for x in line.x}) if panel.kind == "bars" else []
    for line in panel.lines:
        colour, dash = COLOURS[line.run % 3], DASHES[line.run % 3]
        aside = line.run - 0.5 * (runs - 1)  # runs beside each other
        if panel.kind == "bars":
            at = np.searchsorted(places, line.x) + 0.8 * aside / runs
            bottom = _bottom(panel)
            axes.bar(at, line.y - bottom, width=0.8 / runs, bottom=bottom, color=colour, label=line.name)
        elif panel.kind == "lines" and len(line.x) <= STEMS:
            step = float(np.median(np.diff(line.x))) if len(line.x) > 1 else 1.0
            axes.vlines(line.x + 0.3 * step * aside, 0.0, line.y, color=colour, linewidth=1.6, label=line.name)
        else:
            for stretch in _stretches(line):
                axes.plot(*thinned(*stretch), color=colour, linestyle=dash, linewidth=1.3, label=line.name)
        if line.error is not None and np.isfinite(line.error).any():
            axes.fill_between(line.x, line.y - line.error, line.y + line.error, color=colour, alpha=0.2, linewidth=0)
    if places:
        axes.set_xticks(range(len(places)), [f"{1e3 * x if 'kHz' in panel.below else x:g}" for x in places], fontsize=7)
        axes.tick_params(axis="x", rotation=60)
    axes.set_xlabel(panel.below.replace("kHz", "Hz") if places else panel.below, fontsize=9.5)
    axes.set_ylabel(panel.beside, fontsize=9.5)
    axes.margins(x=0.01)
    handles, names = axes.get_legend_handles_labels()
    once = dict(zip(names, handles, strict=True))
    axes.legend(once.values(), once.keys(), fontsize=8, frameon=False)
    axes.tick_params(colors=GREY)


def _bottom(panel: Panel) -> float:
    """Where bars begin: at 0, those of levels 60 dB below the loudest."""
    if "dB" not in panel.beside:
        return 0.0
    values = np.concatenate([line.y for line in panel.lines])
    return float(np.nanmax(values, initial=-300.0)) - 60.0


def _stretches(line: Line) -> list[tuple[Array, Array]]:
    """A curve in pieces over rising or falling places: branches of a run-up turn back."""
    if len(line.x) < 3:
        return [(line.x, line.y)]
    sense = np.sign(np.diff(line.x))
    turns = np.flatnonzero((sense[1:] != sense[:-1]) & (sense[1:] != 0)) + 1
    ends = [0, *turns.tolist(), len(line.x) - 1]
    return [(line.x[a : b + 1], line.y[a : b + 1]) for a, b in pairwise(ends) if b > a]


def thinned(x: Array, y: Array, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """A curve of at most about `most` points: least and largest value of each group of neighbours, in their order."""
    if len(x) <= most:
        return x, y
    group = -(-2 * len(x) // most)
    count = len(x) // group
    blocks = np.nan_to_num(y[: count * group]).reshape(count, group)
    first = group * np.arange(count)
    at = np.sort(np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1), axis=1).ravel()
    at = np.unique(np.append(at, [0, len(x) - 1]))
    return x[at], y[at]
