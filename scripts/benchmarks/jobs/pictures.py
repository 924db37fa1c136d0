"""One picture a table: run time against error (or size), drawn by matplotlib from the rows on disk."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.base.files import whole_file

from .record import Row, read_rows

Draw = Callable[[Any, list[Row]], None]
#: Colours of programs, by their names in tables; marks and dashes of the lines of one program.
COLOURS = {
    "gearfe": "#1f5a99", "exudyn": "#d9730d", "scipy_ivp": "#3a8c5c", "sundials": "#b3261e", "calculix": "#6d4c9f",
    "getfem": "#0f766e",
}  # fmt: skip
OTHERS = ("#1f5a99", "#d9730d", "#3a8c5c", "#b3261e", "#6d4c9f")
MARKERS, STYLES = "os^vDP*X<>", ("-", "--", ":", "-.")
NAMES = {"scipy_ivp": "scipy", "sundials": "SUNDIALS", "calculix": "CalculiX", "getfem": "GetFEM"}


def draw_all(folder: Path) -> list[str]:
    """Draw every table of the folder that has a picture, unless it is newer than its table and this module; returns the
    names of the files.
    """
    made = []
    for name, draw in PICTURES.items():
        table, picture = folder / f"{name}.csv", folder / f"{name}.png"
        if not table.exists():
            continue
        changed = max(path.stat().st_mtime_ns for path in (table, Path(__file__)))
        if not (picture.exists() and picture.stat().st_mtime_ns >= changed):
            draw_one(picture, read_rows(table), draw)
        made.append(picture.name)
    return made


def draw_one(path: Path, rows: list[Row], draw: Draw) -> None:
    """One picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure, rows)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110)


def groups(rows: Iterable[Row], *names: str) -> dict[str, list[Row]]:
    """Rows by the text of some columns."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        label = " ".join(NAMES.get(str(row[n]), str(row[n])) for n in names if row.get(n, "") not in ("", None))
        found.setdefault(label, []).append(row)
    return found


def curves(axes: Any, rows: dict[str, list[Row]], x: str, y: str, parameter: str = "") -> None:
    """A line a group, in the order of x; a program has one colour everywhere, its lines differ by dashes and marks.

    Parameters
    ----------
    parameter
        Column whose value conflicts with each point; without it, none.
    """
    taken: dict[str, int] = {}
    for number, (label, own) in enumerate(rows.items()):
        points = [(r[x], r[y], r.get(parameter)) for r in own if _positive(r.get(x)) and _positive(r.get(y))]
        if not points:
            continue
        program = str(own[0].get("program", ""))
        nth = taken[program] = taken.get(program, -1) + 1
        colour, look = (COLOURS[program], nth) if program in COLOURS else (OTHERS[number % 5], number // 5)
        a, b, told = zip(*sorted(points, key=lambda point: point[:2]), strict=True)
        marker, dashes = MARKERS[look % len(MARKERS)], STYLES[look % len(STYLES)]
        axes.loglog(a, b, dashes, color=colour, marker=marker, ms=4, lw=1.2, label=label)
        for place, height, value in zip(a, b, told, strict=True):
            if isinstance(value, (int, float)):
                axes.annotate(
                    f"{value:g}", (place, height), (3, 3), textcoords="offset points", fontsize=7, color=colour
                )


def _positive(value: Any) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value) and value > 0


def time_error(
    by: tuple[str, ...], title: str, *, time: str = "cpu_s", error: str = "error", parameter: str = ""
) -> Draw:
    """Processor time over error, each point with its parameter."""

    def draw(figure: Any, rows: list[Row]) -> None:
        axes = figure.subplots()
        curves(axes, groups(rows, *by), error, time, parameter)
        axes.set(xlabel="relative error", ylabel="processor time (s)", title=title)
        _finish(axes)

    return draw


def over(x: str, y: str, labels: tuple[str, str], title: str, *, fit: bool = False) -> Draw:
    """Any column over any other, with the fitted exponent when asked."""

    def draw(figure: Any, rows: list[Row]) -> None:
        axes = figure.subplots()
        several = fit and len([r for r in rows if _positive(r.get(y))]) > 1
        curves(axes, {f"exponent {exponent(rows, x, y):.2f}" if several else "": rows}, x, y)
        axes.set(xlabel=labels[0], ylabel=labels[1], title=title)
        _finish(axes)

    return draw


def exponent(rows: list[Row], x: str, y: str) -> float:
    """Slope of log y over log x."""
    points = [(r[x], r[y]) for r in rows if _positive(r.get(x)) and _positive(r.get(y))]
    a, b = np.log(np.array(points)).T
    return float(np.polyfit(a, b, 1)[0])


def _finish(axes: Any) -> None:
    from matplotlib.ticker import LogLocator

    axes.margins(x=0.08)
    axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # names of all would meet
    axes.grid(visible=True, which="both", alpha=0.25)
    labels = axes.get_legend_handles_labels()[1]
    if any(labels):  # below the axes, where it covers no point
        axes.legend(fontsize=7.5, ncols=2, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.14))
        axes.figure.set_figheight(4.6 + 0.18 * -(-len(labels) // 2))
    axes.figure.draw_without_rendering()
    kept: list[Any] = []
    for text in axes.texts:  # a parameter that would cover another one is left out
        box = text.get_window_extent()
        text.set_visible(not any(box.overlaps(other) for other in kept))
        kept += [box] * text.get_visible()


def _mechanisms(figure: Any, rows: list[Row]) -> None:
    for axes, name in zip(figure.subplots(1, 2), ("andrews", "slider_crank"), strict=True):
        own = [r for r in rows if r["mechanism"] == name]
        curves(axes, groups(own, "program", "method"), "error", "cpu_s", "tolerance")
        axes.set(xlabel="largest error (rad)", ylabel="processor time (s)", title=name.replace("_", " "))
        _finish(axes)


def _sweep_peers(figure: Any, rows: list[Row]) -> None:
    from .sweep_peers import own_errors

    axes = figure.subplots()
    curves(axes, groups(own_errors(rows), "program"), "error", "sweep_cpu_s", "coarsen")
    axes.set(xlabel="difference from its own finest mesh", ylabel="processor time (s)", title="sweep of 40 positions")
    _finish(axes)


def _housing_sizes(figure: Any, rows: list[Row]) -> None:
    from .housing_study import frequency_errors

    left, right = figure.subplots(1, 2)
    own = [{**r, "error": e} for r, e in zip(rows, frequency_errors(rows), strict=True)]
    curves(left, {"": own}, "error", "cpu_s")
    left.set(xlabel="largest error of 20 frequencies", ylabel="processor time (s)", title="housing: mesh")
    text = f"exponent {exponent(own, 'unknowns', 'cpu_s'):.2f}" if len(own) > 1 else ""
    curves(right, {text: own}, "unknowns", "cpu_s")
    right.set(xlabel="unknowns", ylabel="processor time (s)", title="mesh to reduced body, 40 modes")
    for axes in (left, right):
        _finish(axes)


def bars(label: str, value: str, axis: str, title: str) -> Draw:
    """Horizontal bars."""

    def draw(figure: Any, rows: list[Row]) -> None:
        axes = figure.subplots()
        own = [r for r in rows if _positive(r.get(value))]
        axes.barh([str(r[label]) for r in own], [r[value] for r in own], color=OTHERS[0])
        axes.invert_yaxis()
        axes.set(xlabel=axis, title=title)
        axes.grid(visible=True, axis="x", alpha=0.25)

    return draw


PICTURES: Mapping[str, Draw] = {
    "sweep_sizes": time_error(
        ("law",), "stiffness, 40 positions at 0.05 deg: element size (coarsen) and law", parameter="coarsen"
    ),
    "sweep_verification": time_error(
        ("model",), "one position: condensed and whole gears", time="position_cpu_s", parameter="coarsen"
    ),
    "sweep_peers": _sweep_peers,
    "sweep_stages": bars("stage", "wall_s", "seconds", "stages of a default sweep of 40 positions"),
    "sweep_positions": over("positions", "cpu_s", ("positions", "processor time (s)"), "distinct positions", fit=True),
    "sweep_twists": over("twist_deg", "error", ("twist (deg)", "largest error"), "default settings against load"),
    "mechanism_tolerance": _mechanisms,
    "mechanism_chains": over("bodies", "us_a_step", ("bodies", "microseconds a step"), "chain of bodies", fit=True),
    "housing_sizes": _housing_sizes,
    "housing_reductions": time_error(
        ("levels",),
        "housing: modes (numbers) and correction levels (colours)",
        error="largest_error",
        parameter="modes",
    ),
    "transient_tolerance": time_error(
        ("variant", "program", "method"), "gear train, 7 ms: largest error of all signals", parameter="tolerance"
    ),
    "runup_peers": time_error(
        ("variant", "speed", "program", "method"), "gear train in steady running, one speed", parameter="tolerance"
    ),
    "transient_modes": over("modes", "acceleration_error", ("modes", "error below 5 kHz"), "modes of the housing"),
}
