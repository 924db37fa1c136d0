"""Pictures of gear pairs and their stiffness, written whole as PNG (or PDF, SVG: the suffix decides).

Drawn on matplotlib's `Figure` with the Agg canvas: no window system, no global state. matplotlib is imported when the
first picture is drawn. Arguments are plain arrays in everyday units, as they appear on the axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..output.files import whole_file
from ..typing import Array, IntArray

BLUE, ORANGE, GREEN, RED, GREY = "#1f5a99", "#d9730d", "#3a8c5c", "#b3261e", "#6b7280"
PINION_FILL, WHEEL_FILL = "#dbe7f3", "#f3e6d8"


def new_figure(width: float, height: float) -> Any:
    """Empty figure (inches) on the Agg canvas."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Any, path: str | Path, *, dpi: int = 130) -> None:
    """Write a figure whole."""
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=dpi)


def tidy(axes: Any) -> None:
    """Axes with a light grid, open at the top and to the right."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#e5e7eb", linewidth=0.8)
    axes.set_axisbelow(True)


def stiffness_figure(
    path: str | Path,
    *,
    title: str,
    line: tuple[Array, Array],
    points: tuple[Array, Array],
    failed: Array,
    single: Sequence[tuple[float, float]],
    levels: Mapping[str, float],
    shares: Sequence[tuple[Array, Array]] = (),
) -> None:
    """Stiffness along the line of action and load sharing against the pinion angle.

    Parameters
    ----------
    line, points
        Pinion angle (deg) and stiffness (N/um): the interpolated curve, and the solved positions.
    failed : ndarray
        Pinion angles (deg) of positions without a solution.
    single
        Stretches of pinion angle (deg) in which rigid gears have one pair of teeth in contact, shaded.
    levels
        Horizontal lines to compare with: label -> stiffness (N/um); far ones are only named.
    shares
        For each tooth pair, pinion angle (deg) and share of the torque (-).
    """
    figure = new_figure(9.0, 6.2 if shares else 4.4)
    grid = figure.add_gridspec(2, 1, height_ratios=(2.6, 1.0)) if shares else figure.add_gridspec(1, 1)
    axes = figure.add_subplot(grid[0])
    tidy(axes)
    for number, (start, end) in enumerate(single):
        axes.axvspan(start, end, color="#f3f4f6", zorder=0, label=None if number else "single-pair contact (rigid)")
    low, high = np.nanmin(points[1], initial=np.inf), np.nanmax(points[1], initial=-np.inf)
    for (label, level), dashes in zip(levels.items(), ((6, 3), (2, 2), (6, 2, 2, 2)), strict=False):
        if low - (high - low) <= level <= high + (high - low):
            axes.axhline(level, color=GREY, linewidth=1.1, dashes=dashes, label=f"{label}: {level:.4g}")
        else:
            axes.plot([], [], " ", label=f"{label}: {level:.4g} (off the scale)")
    axes.plot(*line, color=BLUE, linewidth=2.0, label="k, interpolated")
    axes.plot(*points, "o", color=BLUE, markersize=4.5, markerfacecolor="white", label="solved positions")
    if len(failed):
        bottom = axes.get_ylim()[0]
        axes.plot(failed, np.full(len(failed), bottom), "x", color=RED, clip_on=False, label="failed positions")
    axes.set_ylabel("mesh stiffness k  (N/µm)")
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlim(line[0][0], line[0][-1])
    axes.margins(y=0.12)
    figure.legend(fontsize=8.5, loc="outside lower center", ncols=3, frameon=False)
    if shares:
        lower = figure.add_subplot(grid[1], sharex=axes)
        tidy(lower)
        axes.tick_params(labelbottom=False)
        for number, (angle, share) in enumerate(shares):
            color = (BLUE, ORANGE, GREEN)[number % 3]
            lower.plot(angle, share, ".-", color=color, linewidth=1.4, markersize=4)
        lower.set_ylim(-0.03, 1.06)
        lower.set_ylabel("load share (–)")
        axes = lower
    axes.set_xlabel("pinion angle (deg)")
    save(figure, path)


def pair_figure(
    path: str | Path,
    *,
    title: str,
    outlines: Sequence[Array],
    circles: Sequence[tuple[str, tuple[float, float], float]],
    line_of_action: Array,
    path_points: Mapping[str, tuple[float, float]],
    zoom: tuple[float, float, float],
    notes: str = "",
) -> None:
    """Meshed pair: the whole gears, and the meshing zone with line of action and path of contact.

    Parameters
    ----------
    outlines
        Closed outlines of pinion and wheel, shape (n, 2) (mm).
    circles
        (kind, centre, radius) in mm; kinds ``bore``, ``pitch``, ``base``, ``tip``, ``root``.
    line_of_action : ndarray, shape (2, 2)
        Its points on both base circles (mm).
    path_points
        Points of the path of contact: letter -> place (mm).
    zoom
        Centre x, y and half width (mm) of the enlarged zone.
    notes
        Text below the enlarged zone, for the derived geometry.
    """
    figure = new_figure(12.5, 6.4)
    whole, near = figure.subplots(1, 2, width_ratios=(1.0, 1.0))
    styles = {
        "pitch": (GREY, (0, (7, 2, 1.5, 2)), 0.9, "working pitch circles"),
        "base": (GREEN, (0, (4, 3)), 0.9, "base circles"),
        "tip": ("#9ca3af", (0, (1, 2)), 0.8, "tip circles"),
    }
    angle = np.linspace(0, 2 * np.pi, 721)
    for axes in (whole, near):
        for outline, fill, edge in zip(outlines, (PINION_FILL, WHEEL_FILL), (BLUE, ORANGE), strict=True):
            axes.fill(outline[:, 0], outline[:, 1], facecolor=fill, edgecolor=edge, linewidth=1.1)
        named = set()
        for kind, (x, y), radius in circles:
            if kind == "bore":
                axes.fill(
                    x + radius * np.cos(angle), y + radius * np.sin(angle), facecolor="white", edgecolor="#374151", lw=1
                )
                continue
            color, dash, width, label = styles[kind]
            axes.plot(
                x + radius * np.cos(angle),
                y + radius * np.sin(angle),
                color=color,
                linestyle=dash,
                linewidth=width,
                label=None if kind in named else label,
            )
            named.add(kind)
        axes.plot(line_of_action[:, 0], line_of_action[:, 1], color=RED, linewidth=1.0, label="line of action")
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
    whole.set_ylabel("y (mm)")
    for kind, (x, y), _ in circles:
        if kind == "bore":
            whole.plot(x, y, "+", color="#374151", markersize=9)
    x, y, half = zoom
    whole.add_patch(_rectangle(x, y, half))
    whole.set_title(title, loc="left", fontsize=11)
    marks = np.array(list(path_points.values()))
    near.plot(marks[:, 0], marks[:, 1], color=RED, linewidth=2.4, label="path of contact A–E")
    near.plot(marks[:, 0], marks[:, 1], "o", color=RED, markersize=4)
    for letter, (px, py) in path_points.items():
        near.annotate(
            letter, (px, py), xytext=(6, 5), textcoords="offset points", color=RED, weight="bold", fontsize=10
        )
    near.set_xlim(x - half, x + half)
    near.set_ylim(y - half, y + half)
    near.set_title("meshing zone", loc="left", fontsize=11)
    near.legend(fontsize=8, loc="upper right", framealpha=0.95)
    if notes:
        near.text(
            0.015,
            0.015,
            notes,
            transform=near.transAxes,
            fontsize=8,
            va="bottom",
            family="monospace",
            bbox={"facecolor": "white", "alpha": 0.9, "edgecolor": "#d1d5db"},
        )
    save(figure, path)


def _rectangle(x: float, y: float, half: float) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - half, y - half), 2 * half, 2 * half, fill=False, edgecolor="#374151", linewidth=0.9)


def stress_figure(
    path: str | Path,
    *,
    title: str,
    parts: Sequence[tuple[Array, IntArray, Array]],
    zoom: tuple[float, float, float],
) -> None:
    """Von Mises stress in the meshing zone on the deformed gears.

    Parameters
    ----------
    parts
        For each gear: points, shape (n, 2) (mm), straight triangles, shape (m, 3), and stress at the points (MPa).
    zoom
        Centre x, y and half width (mm) of the picture.
    """
    from matplotlib.ticker import MaxNLocator

    x, y, half = zoom
    shown = []
    for points, triangles, stress in parts:
        middle = points[triangles].mean(axis=1)
        near = (np.abs(middle - (x, y)) < 1.15 * half).all(axis=1)
        shown.append((points, triangles[near], stress))
    largest = max(float(stress[triangles].max(initial=0.0)) for _, triangles, stress in shown)
    top = color_limit(shown)
    figure = new_figure(8.0, 7.0)
    axes = figure.add_subplot()
    drawn = draw_zone(axes, shown, zoom, top)
    axes.set_title(f"{title}\nlargest value {largest:.4g} MPa", loc="left", fontsize=11)
    bar = figure.colorbar(drawn, ax=axes, shrink=0.85, extend="max" if largest > top else "neither")
    bar.set_label("von Mises stress (MPa)")
    bar.locator = MaxNLocator(8)
    bar.update_ticks()
    save(figure, path, dpi=110)


def draw_zone(
    axes: Any, parts: Sequence[tuple[Array, IntArray, Array]], zoom: tuple[float, float, float], top: float
) -> Any:
    """Draw the stress of both gears in the meshing zone, colours from 0 to `top`; the answer is for a colour bar.

    Parameters
    ----------
    parts, zoom
        See `stress_figure`.
    """
    x, y, half = zoom
    drawn = None
    for points, triangles, stress in parts:
        drawn = axes.tripcolor(
            points[:, 0], points[:, 1], triangles, stress, shading="gouraud", cmap="turbo", vmin=0.0, vmax=top
        )
        drawn.set_in_layout(False)  # the axes hold it, and asking for its extent takes a second
        draw_rim(axes, points, triangles)
    axes.set_aspect("equal")
    axes.set_xlim(x - half, x + half)
    axes.set_ylim(y - half, y + half)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    return drawn


def color_limit(parts: Sequence[tuple[Array, IntArray, Array]], *, share: float = 0.004) -> float:
    """Stress that a `share` of the area exceeds: colours up to it show the roots too, not the contact's peak alone.

    Parameters
    ----------
    parts
        For each gear: points, triangles and stress, as for `stress_figure`.
    """
    level = np.concatenate([stress[triangles].mean(axis=1) for _, triangles, stress in parts])
    edges = [(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]]) for p, t, _ in parts]
    area = np.abs(np.concatenate([a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] for a, b in edges]))
    if not (len(level) and level.max() > 0):
        return 1.0
    order = np.argsort(level)[::-1]
    beyond = np.cumsum(area[order]) / area.sum()
    return float(level[order[min(int(np.searchsorted(beyond, share)), len(order) - 1)]])


def draw_rim(axes: Any, points: Array, triangles: IntArray) -> None:
    """Draw the edges that belong to one triangle only, as one line with gaps (thousands of lines take seconds)."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, first, count = np.unique(edges[:, 0] * len(points) + edges[:, 1], return_index=True, return_counts=True)
    ends = points[edges[first[count == 1]]]
    gaps = np.full((len(ends), 1, 2), np.nan)
    x, y = np.concatenate([ends, gaps], axis=1).reshape(-1, 2).T
    axes.plot(x, y, color="#111827", linewidth=0.7, solid_capstyle="round")
