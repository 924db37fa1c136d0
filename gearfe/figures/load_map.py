"""Picture of a load map: what changes with the pinion angle, one line a torque, and what changes with the torque."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..gear.deviation_job import GEARS
from ..loadmap.load_map import LoadMap
from ..typing import Array
from .style import BLUE, ORANGE, headed, labelled, new_figure, shades, some_of

#: Lines of a panel; of more torques, so many are drawn.
MOST_LINES = 24


def load_map_picture(made: LoadMap, title: str = "") -> Any:
    """Panels over the pinion angle coloured by torque, and mean stiffness and transmission error over the torque."""
    angle, torque, panels = _over_the_cycle(made)
    count = len(panels) + 2
    columns = -(-count // 2)
    figure = new_figure(3.9 * columns + 0.9, 6.6)
    every: list[Any] = figure.subplots(2, columns, squeeze=False).ravel().tolist()
    logarithmic = len(torque) > 2 and torque[-1] / torque[0] > 10 and _is_geometric(torque)
    low, high = float(torque[0]), float(torque[-1] if len(torque) > 1 else 1.01 * torque[0])
    colour, scale = shades(low, high, logarithmic=logarithmic)
    shown = some_of(len(torque), MOST_LINES)
    marker = "." if len(angle) < 60 else ""
    for axes, (label, values) in zip(every, panels.items(), strict=False):
        labelled(axes, label, "pinion angle (deg)")
        for row in shown:
            axes.plot(angle, values[row], marker=marker, markersize=3, linewidth=1.1, color=colour(torque[row]))
        axes.set_xlim(angle[0], angle[-1])
    over = {
        "mean stiffness  (N/µm)": 1e-6 * made.quantity("k_mesh").mean(axis=1),
        "transmission error, peak to peak  (µm)": 1e6 * made.peak_to_peak,
    }
    for axes, (label, values), color in zip(every[len(panels) :], over.items(), (BLUE, ORANGE), strict=False):
        labelled(axes, label, "torque at the wheel (N m)")
        axes.plot(torque, values, "o-", color=color, markersize=3.5, linewidth=1.4)
        if logarithmic:
            axes.set_xscale("log")
            _plain_ticks(axes.xaxis)
    for axes in every[count:]:
        axes.set_visible(False)
    bar = figure.colorbar(scale, ax=every, shrink=0.85, aspect=35, pad=0.015)
    if logarithmic:
        _plain_ticks(bar.ax.yaxis)
    bar.set_label("torque at the wheel (N m)")
    headed(figure, title)
    return figure


def _over_the_cycle(made: LoadMap) -> tuple[Array, Array, dict[str, Array]]:
    """Pinion angles (deg), shape (n,), torques (N m), shape (m,), and label -> values, shape (m, n)."""
    cycle, angle = np.degrees(made.mesh_cycle), np.degrees(made.pinion_angle)
    inside = bool(len(angle) and np.isclose(angle[0], 0.0) and angle[-1] < cycle)
    close = slice(0, 1 if inside else 0)  # the first position again at the end of the cycle
    panels = {
        "mesh stiffness k  (N/µm)": 1e-6 * made.quantity("k_mesh"),
        "transmission error  (µm)": 1e6 * made.quantity("transmission_error"),
        "largest load share of a pair  (–)": np.stack([c.load_share.max(axis=1) for c in made.curves]),
        "Hertzian pressure  (MPa)": 1e-6 * made.quantity("peak_pressure"),
    }
    if made.root is not None:
        for g, gear in enumerate(GEARS):
            panels[f"root stress, {gear}  (MPa)"] = 1e-6 * made.root.largest[:, :, g]
    closed = {name: np.concatenate([values, values[:, close]], axis=1) for name, values in panels.items()}
    return np.append(angle, [cycle] if inside else []), made.torque, closed


def _is_geometric(torque: Array) -> bool:
    ratio = np.log(torque[1:] / torque[:-1])
    return bool(ratio.max() < 2.5 * ratio.min())


def _plain_ticks(axis: Any) -> None:
    """1, 2, 5, 10, ... written out."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
