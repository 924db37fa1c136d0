"""Pictures of a gear train's response: curves against the drive's rotation, spectrum, radiated power.

Arguments are plain arrays in the units on the axes; nothing is computed here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..output.files import whole_file
from ..typing import Array
from .style import BLUE, GREEN, GREY, ORANGE, RED, new_figure

COLOURS = (BLUE, ORANGE, GREEN, RED, "#6d4c9f", "#0f766e", "#8a5a2b")
_DPI = 130
#: First and last place of stretches.
Spans = Sequence[tuple[float, float]]
#: Lines of the meshes.
_DASHES = ((0, (6, 3)), (0, (2, 2)), (0, (6, 2, 2, 2)))


class Mark(NamedTuple):
    """A vertical line in a spectrum: group (one colour each), label, frequency (kHz)."""

    group: str
    label: str
    frequency: float


def response_figure(
    path: str | Path,
    *,
    title: str,
    angle: Array,
    forces: Mapping[str, Array],
    speeds: Mapping[str, Array],
    accelerations: Mapping[str, Array],
    attachment: tuple[str, Array],
    means: Mapping[str, float],
    apart: Mapping[str, Spans] | None = None,
) -> None:
    """Contact forces, shaft speeds, angular accelerations and one normal acceleration over the drive's rotation.

    Parameters
    ----------
    angle : (n,)
        Rotation of the drive (deg).
    forces
        Label -> contact force (kN).
    speeds, accelerations
        Shaft -> speed (rad/s) and angular acceleration (1000 rad/s2).
    attachment
        Label and normal acceleration (m/s2).
    means
        Label of a force -> its mean after the start (kN), drawn as a level.
    apart
        Label of a force -> (first, last) rotations (deg) between which the teeth are apart, drawn as bars below.
    """
    figure = _fixed(11.5, 7.6)
    figure.suptitle(title, fontsize=12, x=0.012, y=0.985, ha="left")
    grid = figure.add_gridspec(2, 2, left=0.062, right=0.985, top=0.905, bottom=0.068, hspace=0.3, wspace=0.16)
    axes = [_panel(figure.add_subplot(grid[0, 0]), "contact force  (kN)", "a", "contact forces")]
    for colour, (label, values) in zip(_cycle(), forces.items(), strict=False):
        axes[0].plot(angle, values, color=colour, linewidth=1.3, label=label)
        if label in means:
            axes[0].axhline(means[label], color=colour, linewidth=0.9, dashes=(6, 4))
    _bars(axes[0], list(forces), apart or {})
    axes[0].legend(fontsize=8.5, frameon=False, ncols=2, loc="upper left", bbox_to_anchor=(0.0, 1.0))
    top = max(float(np.max(v)) for v in forces.values())
    low = min(0.0, *(float(np.min(v)) for v in forces.values()))
    axes[0].set_ylim(low - 0.04 * (top - low), top + 0.22 * (top - low))
    rows = grid[0, 1].subgridspec(len(speeds), 1, hspace=0.35)
    for number, (colour, (label, values)) in enumerate(zip(_cycle(), speeds.items(), strict=False)):
        part = figure.add_subplot(rows[number])
        _panel(part, "", "b" if number == 0 else "", "shaft speeds" if number == 0 else "")
        part.plot(angle, values, color=colour, linewidth=1.2)
        half = max(0.55 * float(np.ptp(values)), 2e-3 * float(np.abs(values).max()), 1e-9)
        middle = 0.5 * float(values.max() + values.min())
        part.set_ylim(middle - 1.15 * half, middle + 1.15 * half)
        part.yaxis.get_major_formatter().set_useOffset(False)
        part.text(1.0, 1.02, label, transform=part.transAxes, fontsize=8.5, color=colour, ha="right", va="bottom")
        if number == len(speeds) // 2:
            part.set_ylabel("speed  (rad/s)")
        axes.append(part)
    turning = _panel(
        figure.add_subplot(grid[1, 0]), "angular acceleration  (1000 rad/s²)", "c", "angular accelerations"
    )
    for colour, (label, values) in zip(_cycle(), accelerations.items(), strict=False):
        turning.plot(angle, values, color=colour, linewidth=1.1, label=label)
    turning.legend(fontsize=8.5, frameon=False, ncols=max(1, min(4, len(accelerations))), loc="upper right")
    turning.margins(y=0.14)
    normal = _panel(figure.add_subplot(grid[1, 1]), "acceleration  (m/s²)", "d", attachment[0])
    normal.plot(angle, attachment[1], color=BLUE, linewidth=1.1)
    normal.axhline(0.0, color=GREY, linewidth=0.8)
    axes += [turning, normal]
    for part in axes:
        part.set_xlim(float(angle[0]), float(angle[-1]) if angle[-1] > angle[0] else float(angle[0]) + 1.0)
    for part in axes[1:-3]:
        part.tick_params(labelbottom=False)
    for part in (axes[0], axes[-3], turning, normal):
        part.set_xlabel("rotation of the drive  (deg)")
    _save(figure, path)


def transmission_figure(
    path: str | Path,
    *,
    title: str,
    angle: Array,
    dynamic: Mapping[str, Array],
    static: Mapping[str, Array],
    apart: Mapping[str, Spans],
) -> None:
    """Dynamic beside static transmission error over the drive's rotation, a panel for each mesh.

    Parameters
    ----------
    angle : (n,)
        Rotation of the drive (deg).
    dynamic, static
        Mesh -> approach along the line of action (um); static where it is known.
    apart
        Mesh -> (first, last) rotations (deg) between which its teeth are apart, drawn as bars below.
    """
    figure = _fixed(11.5, 1.3 + 2.7 * len(dynamic))
    figure.suptitle(title, fontsize=12, x=0.012, y=0.985, ha="left")
    tall = 1.3 + 2.7 * len(dynamic)
    room = {"top": 1.0 - 0.75 / tall, "bottom": 0.55 / tall, "hspace": 0.32}
    grid = figure.add_gridspec(len(dynamic), 1, left=0.062, right=0.985, **room)
    for number, (colour, (name, values)) in enumerate(zip(_cycle(), dynamic.items(), strict=False)):
        axes = _panel(figure.add_subplot(grid[number]), "approach  (µm)", "abcdefgh"[number % 8], name)
        axes.plot(angle, values, color=colour, linewidth=1.2, label="dynamic")
        if name in static:
            axes.plot(angle, static[name], color="#111827", linewidth=1.0, dashes=(4, 2), label="static")
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.15 * (high - low))
        _bars(axes, [name], apart)
        axes.legend(fontsize=8.5, frameon=False, ncols=3, loc="upper right")
        axes.set_xlim(float(angle[0]), float(angle[-1]) if angle[-1] > angle[0] else float(angle[0]) + 1.0)
    axes.set_xlabel("rotation of the drive  (deg)")
    _save(figure, path)


def _bars(axes: Any, names: Sequence[str], apart: Mapping[str, Spans]) -> None:
    """Bars at the lower edge, one row a name, where its teeth are apart."""
    shown = [name for name in names if apart.get(name)]
    for row, name in enumerate(shown):
        spans = [(first, last - first) for first, last in apart[name]]
        colour = COLOURS[names.index(name) % len(COLOURS)] if len(names) > 1 else RED
        place = (0.012 + 0.03 * row, 0.022)
        label = "teeth apart" if row == 0 else None
        axes.broken_barh(spans, place, transform=axes.get_xaxis_transform(), color=colour, linewidth=0, label=label)


def spectrum_figure(
    path: str | Path,
    *,
    title: str,
    frequency: Array,
    amplitude: Array,
    quantity: str,
    peaks: Sequence[tuple[float, float, str]],
    marks: Sequence[Mark],
    shaft: tuple[str, float],
    note: str,
    highest: float,
) -> None:
    """Amplitude spectrum as lines, mesh lines and their multiples marked, orders of a shaft on top.

    Parameters
    ----------
    frequency : (m,)
        Bins (kHz).
    amplitude : (m,)
        Amplitudes in the unit of `quantity`.
    quantity
        Label of the axis.
    peaks
        Frequency (kHz), amplitude and label of lines to name.
    marks
        Lines of the meshes.
    shaft
        Name and frequency (kHz) of the shaft whose orders are on top.
    title
        First line: what is shown; second line: of what.
    note
        Small text above: resolution, window, mean.
    highest
        End of the axis (kHz).
    """
    figure = _fixed(10.5, 4.9)
    axes = _frequency_axes(figure, title, marks, shaft, highest, note)
    axes.vlines(frequency, 0.0, amplitude, color=BLUE, linewidth=2.2)
    axes.plot(frequency, amplitude, "o", color=BLUE, markersize=3.4, markerfacecolor="white")
    shown = (frequency <= highest) & (frequency > 0.0)
    top = float(amplitude[shown].max(initial=0.0)) or 1.0
    axes.set_ylim(0.0, 1.3 * top)
    placed: list[tuple[float, float]] = []
    for place, size, label in peaks:
        height = size + 0.03 * top
        while any(abs(place - p) < 0.09 * highest and abs(height - h) < 0.065 * top for p, h in placed):
            height += 0.066 * top
        placed.append((place, height))
        axes.annotate(
            label,
            (place, size),
            (place, height),
            fontsize=8.5,
            ha="left" if place < 0.08 * highest else "center",
            va="bottom",
            bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.6},
        )
    axes.set_ylabel(quantity)
    _save(figure, path)


def power_figure(
    path: str | Path,
    *,
    title: str,
    frequency: Array,
    level: Array,
    marks: Sequence[Mark],
    shaft: tuple[str, float],
    note: str,
    highest: float,
) -> None:
    """Level of the equivalent radiated power of each line; see `spectrum_figure` for the arguments.

    Parameters
    ----------
    level : (m,)
        dB re 1e-12 W; minus infinity where nothing is radiated.
    """
    figure = _fixed(10.5, 4.6)
    axes = _frequency_axes(figure, title, marks, shaft, highest, note)
    shown = (frequency <= highest) & (frequency > 0.0) & np.isfinite(level)
    top = float(level[shown].max(initial=-300.0)) if shown.any() else 0.0
    bottom = max(top - 60.0, float(level[shown].min(initial=300.0)) - 3.0) if shown.any() else -10.0
    width = 0.72 * float(np.median(np.diff(frequency)))
    axes.bar(frequency[shown], level[shown] - bottom, width=width, bottom=bottom, color=BLUE, linewidth=0)
    axes.set_ylim(bottom, top + 0.18 * (top - bottom) + 1.0)
    axes.set_ylabel("radiated power level  (dB re 1 pW)")
    _save(figure, path)


def _frequency_axes(
    figure: Any, title: str, marks: Sequence[Mark], shaft: tuple[str, float], highest: float, note: str
) -> Any:
    axes = figure.add_axes((0.062, 0.175, 0.925, 0.615))
    _panel(axes, "", "", "")
    head, _, scene = title.partition("\n")
    figure.text(0.062, 0.945, head, fontsize=11)
    figure.text(0.062, 0.9, scene, fontsize=8.5, color="#374151")
    figure.text(0.987, 0.945, note, fontsize=8.5, color="#374151", ha="right")
    axes.set_xlim(0.0, highest)
    axes.set_xlabel("frequency  (kHz)")
    groups = sorted({mark.group for mark in marks})
    named: set[str] = set()
    for mark in sorted(marks):
        if mark.frequency > highest:
            continue
        number = groups.index(mark.group)
        colour, dash = (ORANGE, GREEN, RED, GREY)[number % 4], _DASHES[number % len(_DASHES)]
        label = None if mark.group in named else mark.group
        named.add(mark.group)
        axes.axvline(mark.frequency, color=colour, linewidth=1.0, linestyle=dash, zorder=1, label=label)
        axes.annotate(
            mark.label,
            (mark.frequency, 1.0),
            (-1.5 if number % 2 else 1.5, -3),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            fontsize=7.5,
            color=colour,
            ha="right" if number % 2 else "left",
            va="top",
        )
    if named:
        figure.legend(fontsize=8.5, loc="lower center", ncols=4, frameon=False)
    name, turns = shaft
    if turns > 0.0:
        above = axes.secondary_xaxis("top", functions=(lambda f: f / turns, lambda order: order * turns))
        above.set_xlabel(f"order of the shaft {name}", fontsize=9)
        above.tick_params(labelsize=8.5)
    return axes


def _fixed(width: float, height: float) -> Any:
    """Empty figure (inches) whose axes are placed by hand: twice as fast as a layout that is solved for."""
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    return figure


def _save(figure: Any, path: str | Path) -> None:
    """Write a PNG whole. The canvas is drawn once; `savefig` draws it twice."""
    figure.set_dpi(_DPI)
    with whole_file(path) as temporary:
        figure.canvas.print_png(temporary, pil_kwargs={"compress_level": 4})


def _panel(axes: Any, ylabel: str, letter: str, title: str) -> Any:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#e5e7eb", linewidth=0.8)
    axes.set_axisbelow(True)
    if ylabel:
        axes.set_ylabel(ylabel)
    if title:
        axes.set_title(f"({letter})  {title}", fontsize=10.5, loc="left")
    return axes


def _cycle() -> Sequence[str]:
    return COLOURS * 8
