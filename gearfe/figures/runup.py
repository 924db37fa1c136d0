"""Pictures of a run-up: waterfall, Campbell diagram, order cuts, dynamic transmission error and factor over the speed.

Arguments are plain arrays in the units on the axes; nothing is computed here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..typing import Array, IntArray
from .style import BLUE, GREEN, GREY, ORANGE, RED, new_figure, save, tidy

COLOURS = (BLUE, ORANGE, GREEN, RED, "#6d4c9f", "#0f766e", "#8a5a2b")


class OrderLine(NamedTuple):
    """An order of a mesh: its label, and frequency (kHz) for 1 rad/s of the drive."""

    label: str
    slope: float
    mesh: int


class Pieces(NamedTuple):
    """A curve over the speed in pieces, one a branch: speeds (rad/s), values, whether each is stable."""

    speed: Array
    value: Array
    branch: IntArray
    stable: Array


def waterfall_figure(
    path: str | Path, *, title: str, speed: Array, frequency: Array, level: Array, lines: Sequence[OrderLine],
    quantity: str, highest: float,
) -> None:  # fmt: skip
    """Spectra over the speed: all lines of the period as coloured tracks, the meshes' orders named.

    Parameters
    ----------
    speed : (n,)
        Rising (rad/s).
    frequency, level : (n, lines)
        kHz, and dB of `quantity`; not-a-number beyond the band.
    highest
        End of the frequency axis (kHz).
    """
    from matplotlib.collections import LineCollection

    figure = new_figure(10.5, 6.4)
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_facecolor("#0b1020")
    top = float(np.nanmax(level[:, 1:], initial=0.0))
    segments, values = [], []
    for k in range(1, frequency.shape[1]):
        points = np.stack([speed, frequency[:, k]], axis=1)
        both = np.isfinite(points[:-1, 1]) & np.isfinite(points[1:, 1])
        segments += [points[i : i + 2] for i in np.flatnonzero(both)]
        values += [0.5 * (level[i, k] + level[i + 1, k]) for i in np.flatnonzero(both)]
    order = np.argsort(values)  # loud ones on top
    tracks = LineCollection(
        [segments[i] for i in order], array=np.array(values)[order], cmap="inferno", linewidths=2.6, capstyle="butt"
    )
    tracks.set_clim(top - 70.0, top)
    axes.add_collection(tracks)
    axes.set_xlim(float(speed[0]), float(speed[-1]))
    axes.set_ylim(0.0, highest)
    for line in lines:
        _label_order(axes, line, float(speed[0]), float(speed[-1]), highest, "white")
    axes.set_xlabel("speed of the drive  (rad/s)")
    axes.set_ylabel("frequency  (kHz)")
    _rpm(axes)
    figure.colorbar(tracks, ax=axes, pad=0.09, label=quantity)
    save(figure, path)


def campbell_figure(
    path: str | Path, *, title: str, speed: Array, frequency: Array, damping: Array, names: Sequence[str],
    lines: Sequence[OrderLine], crossings: Sequence[tuple[float, float]], highest: float,
) -> None:  # fmt: skip
    """Natural frequencies over the speed with the meshes' orders; modes with much strain in meshes are drawn strong.

    Parameters
    ----------
    frequency : (n, modes), damping : (modes,)
        kHz; parts of the critical damping.
    names
        Label of each mode, or an empty text for those that are drawn thin.
    crossings
        Speed (rad/s) and frequency (kHz) of the marked critical speeds.
    """
    figure = new_figure(10.5, 6.4)
    axes = figure.add_subplot()
    tidy(axes)
    axes.set_title(title, fontsize=11, loc="left")
    low, high = float(speed[0]), float(speed[-1])
    taken: list[float] = []
    for mode in range(frequency.shape[1]):
        strong = bool(names[mode])
        axes.plot(speed, frequency[:, mode], color=BLUE if strong else "#b6c2d1", linewidth=1.6 if strong else 0.7)
        if strong and frequency[-1, mode] <= highest:
            place = float(frequency[-1, mode])
            while any(abs(place - t) < 0.028 * highest for t in taken):
                place += 0.007 * highest
            taken.append(place)
            text = f"{names[mode]}, {100.0 * damping[mode]:.2g} % damping"
            axes.annotate(
                text, (high, float(frequency[-1, mode])), (high + 0.012 * (high - low), place), fontsize=7.5,
                color=BLUE, va="center", annotation_clip=False,
            )  # fmt: skip
    for line in lines:
        axes.plot([low, high], [line.slope * low, line.slope * high], color=COLOURS[1 + line.mesh], linewidth=1.0)
        _label_order(axes, line, low, high, highest, COLOURS[1 + line.mesh])
    if crossings:
        axes.plot(*np.array(crossings).T, "o", color=RED, markersize=4.0, markerfacecolor="white", zorder=5)
    axes.set_xlim(low, high)
    axes.set_ylim(0.0, highest)
    axes.set_xlabel("speed of the drive  (rad/s)")
    axes.set_ylabel("frequency  (kHz)")
    _rpm(axes)
    save(figure, path)


def curves_figure(
    path: str | Path, *, title: str, panels: Sequence[tuple[str, Mapping[str, Pieces]]], turns: Sequence[float] = (),
    levels: Mapping[int, Mapping[str, tuple[Array, Array]]] | None = None, logarithmic: bool = False,
) -> None:  # fmt: skip
    """Curves over the speed, panel by panel; unstable stretches dashed, turning points as thin lines.

    Parameters
    ----------
    panels
        Label of the axis, and name -> curve.
    levels
        Number of a panel -> further thin curves, name -> (speed, value).
    """
    figure = new_figure(10.5, 1.0 + 3.0 * len(panels))
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    for number, (label, curves) in enumerate(panels):
        axes = figure.add_subplot(len(panels), 1, number + 1)
        tidy(axes)
        for colour, (name, curve) in zip(_cycle(), curves.items(), strict=False):
            first = True
            for branch in dict.fromkeys(curve.branch.tolist()):
                at = np.flatnonzero(curve.branch == branch)
                if at[0] and curve.branch[at[0] - 1] == branch - 1:  # the turning point between them
                    at = np.append(at[0] - 1, at)
                for stable in (True, False):
                    shown = np.where(curve.stable[at] == stable, curve.value[at], np.nan)
                    if not np.isfinite(shown).any():
                        continue
                    if not stable:  # join on to the stable neighbours
                        here = curve.stable[at] == stable
                        joined = here.copy()
                        joined[1:] |= here[:-1]
                        joined[:-1] |= here[1:]
                        shown = np.where(joined, curve.value[at], np.nan)
                    axes.plot(
                        curve.speed[at], shown, color=colour, linewidth=1.5 if stable else 1.0,
                        linestyle="-" if stable else (0, (3, 2)), label=name if first else None,
                        marker="." if len(at) < 3 else None, markersize=3.0,
                    )  # fmt: skip
                    first = False
        for name, (speed, value) in ((levels or {}).get(number) or {}).items():
            axes.plot(speed, value, color=GREY, linewidth=1.0, dashes=(6, 3), label=name)
        for turn in turns:
            axes.axvline(turn, color=GREY, linewidth=0.6, dashes=(1, 2))
        positive = any((curve.value > 0.0).any() for curve in curves.values())
        if logarithmic and positive:
            axes.set_yscale("log")
        axes.set_ylabel(label)
        axes.legend(fontsize=8, frameon=False, ncols=min(6, max(1, len(curves))), loc="upper left")
        axes.margins(x=0.0)
        if not (logarithmic and positive):
            low, high = axes.get_ylim()
            axes.set_ylim(low, high + 0.12 * (high - low))
    axes.set_xlabel("speed of the drive  (rad/s)")
    save(figure, path)


def instability_figure(path: str | Path, *, title: str, speed: Array, load: Array, growth: Array) -> None:
    """Growth (1/s) of vibration without damping over speed (n,) and load factor (m,), shape (m, n)."""
    figure = new_figure(10.5, 4.6)
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    rows = np.arange(len(load))
    shown = axes.pcolormesh(speed, rows, growth, cmap="magma_r", shading="nearest", vmin=0.0)
    axes.set_yticks(rows, [f"{x:g}" for x in load])
    axes.set_xlabel("speed of the drive  (rad/s)")
    axes.set_ylabel("factor on the loads")
    _rpm(axes)
    figure.colorbar(shown, ax=axes, pad=0.02, label="growth, and damping that holds it  (1/s)")
    save(figure, path)


def _label_order(axes: Any, line: OrderLine, low: float, high: float, highest: float, colour: str) -> None:
    """Name of an order where its line leaves the picture."""
    end = min(high, highest / line.slope)
    if end <= low:
        return
    above = line.slope * high > highest
    y = 0.985 * highest if above else line.slope * (high - 0.01 * (high - low))
    axes.annotate(
        line.label, (y / line.slope, y), (-4, 0) if above else (0, 3), textcoords="offset points", fontsize=7.5,
        color=colour, ha="right", va="top" if above else "bottom",
    )  # fmt: skip


def _rpm(axes: Any) -> None:
    """Upper axis in turns per minute."""
    factor = 30.0 / np.pi
    upper = axes.secondary_xaxis("top", functions=(lambda x: factor * x, lambda x: x / factor))
    upper.set_xlabel("speed of the drive  (rpm)", fontsize=8.5)
    upper.tick_params(labelsize=8)


def _cycle() -> list[str]:
    return list(COLOURS) * 4
