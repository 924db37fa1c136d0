"""Pictures of a load map: over the pinion angle; over the torque, along the path of contact and by orders."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..base.typing import Array
from ..gears.gearmesh.load_map import LoadMap
from ..gears.geometry.deviation_job import GEARS
from .style import BLUE, ORANGE, RED, headed, labelled, new_figure, shades, some_of

#: Lines of a panel; of more torques, so many are drawn.
MOST_LINES = 24


#: Panels beside each other, and their size (inches).
COLUMNS, WIDE, TALL = 2, 5.6, 3.5


class _Frame(NamedTuple):
    """Figure with panels, colour of a torque, its scale, whether torques are on a logarithmic axis."""

    figure: Any
    panels: list[Any]
    colour: Callable[[float], Any]
    scale: Any
    logarithmic: bool


def _framed(made: LoadMap, count: int, title: str) -> _Frame:
    torque, rows = made.torque, -(-count // COLUMNS)
    figure = new_figure(WIDE * min(COLUMNS, count) + 0.9, TALL * rows + 0.5)
    panels: list[Any] = figure.subplots(rows, min(COLUMNS, count), squeeze=False).ravel().tolist()
    for axes in panels[count:]:
        axes.set_visible(False)
    logarithmic = len(torque) > 2 and torque[-1] / torque[0] > 10 and _is_geometric(torque)
    low, high = float(torque[0]), float(torque[-1] if len(torque) > 1 else 1.01 * torque[0])
    headed(figure, title)
    return _Frame(figure, panels, *shades(low, high, logarithmic=logarithmic), logarithmic)


def _with_bar(frame: _Frame) -> Any:
    """The figure with the scale of the torques beside its panels."""
    bar = frame.figure.colorbar(frame.scale, ax=frame.panels, shrink=0.85, aspect=35, pad=0.015)
    if frame.logarithmic:
        _plain_ticks(bar.ax.yaxis)
    bar.set_label("torque at the wheel (N m)")
    return frame.figure


def load_map_picture(made: LoadMap, title: str = "") -> Any:
    """Panels over the pinion angle, coloured by torque: stiffness, transmission error, share, pressure, root stress."""
    angle, label, panels = _over_the_angle(made)
    frame = _framed(made, len(panels), title)
    shown = some_of(len(made.torque), MOST_LINES)
    style: dict[str, Any] = {"marker": "." if len(angle) < 60 else "", "markersize": 3, "linewidth": 1.1}
    for (name, values), axes in zip(panels.items(), frame.panels, strict=False):
        labelled(axes, name, label)
        if name.startswith("transmission error"):  # Harris map
            axes.plot(angle, _closed(1e6 * made.transmission_error_unloaded, angle), color=RED, label="rigid", **style)
            axes.legend(fontsize=8, frameon=False)
        for row in shown:
            axes.plot(angle, values[row], color=frame.colour(made.torque[row]), **style)
        axes.set_xlim(angle[0], angle[-1])
    return _with_bar(frame)


def load_picture(made: LoadMap, title: str = "") -> Any:
    """Panels along the path of contact, over orders and over the torque."""
    over = {
        "mean stiffness  (N/µm)": (1e-6 * made.quantity("k_mesh").mean(axis=1), BLUE),
        "transmission error, peak to peak  (µm)": (1e6 * made.peak_to_peak, ORANGE),
    }
    frame = _framed(made, len(over) + 2 * bool(made.pairs) + bool(made.mesh_cycles), title)
    places = iter(frame.panels)
    for (name, (means, color)), axes in zip(over.items(), places, strict=False):
        labelled(axes, name, "torque at the wheel (N m)")
        axes.plot(made.torque, means, "o-", color=color, markersize=3.5, linewidth=1.4)
        if frame.logarithmic:
            axes.set_xscale("log")
            _plain_ticks(axes.xaxis)
    if made.pairs:
        shown = some_of(len(made.torque), MOST_LINES)
        _along_the_path(next(places), next(places), made, shown, frame.colour)
    if made.mesh_cycles:
        _orders(next(places), made)
    return _with_bar(frame)


def _over_the_angle(made: LoadMap) -> tuple[Array, str, dict[str, Array]]:
    """Pinion angles (deg, or mesh cycles of several), shape (n,), their label, and label -> values, shape (m, n)."""
    angle = np.degrees(made.pinion_angle)
    cycle = float(np.degrees(made.curves[0].mesh_cycle))
    if np.isclose(angle[0], 0.0) and made.mesh_cycles == 1 and angle[-1] < cycle:
        angle = np.append(angle, cycle)  # the first position again at the end of the cycle
    label = "pinion angle (deg)"
    if made.mesh_cycles > 1 and made.pair is not None:
        angle, label = angle / np.degrees(made.pair.mesh_cycle), "pinion angle (mesh cycles)"
    panels = {
        "mesh stiffness k  (N/µm)": 1e-6 * made.quantity("k_mesh"),
        "transmission error  (µm)": 1e6 * made.quantity("transmission_error"),
    }
    if not made.pairs:
        panels["largest load share of a pair  (–)"] = np.stack([c.load_share.max(axis=1) for c in made.curves])
        panels["Hertzian pressure  (MPa)"] = 1e-6 * made.quantity("peak_pressure")
    if made.root is not None:
        for g, gear in enumerate(GEARS):
            panels[f"root stress, {gear}  (MPa)"] = 1e-6 * made.root.largest[:, :, g]
    return angle, label, {name: _closed(values, angle) for name, values in panels.items()}


def _closed(values: Array, angle: Array) -> Array:
    """Values at the angles, the first ones again where there is one angle more."""
    return values if values.shape[-1] == len(angle) else np.concatenate([values, values[..., :1]], axis=-1)


def _along_the_path(share: Any, pressure: Any, made: LoadMap, shown: Any, colour: Any) -> None:
    """Load share and pressure of the tooth pairs over the pinion's roll length."""
    labelled(share, "load share of a tooth pair  (–)", "roll length of the pinion (mm)")
    labelled(pressure, "pressure (MPa); x: next to an edge", "roll length of the pinion (mm)")
    for row in shown:
        own, color = made.pairs[row], colour(made.torque[row])
        roll, sharp = 1e3 * own.roll[:, 0], own.edge > 0
        share.plot(roll, own.share, ".", markersize=2.5, color=color)
        for marker, size, these in ((".", 2.5, ~sharp), ("x", 4, sharp)):
            pressure.plot(roll[these], 1e-6 * own.pressure[these], marker, markersize=size, color=color)


def _orders(axes: Any, made: LoadMap) -> None:
    """Orders of the transmission error up to the fourth of the mesh, unloaded and at the largest torque."""
    order, free = made.spectrum(unloaded=True)
    mesh_order = order[min(made.mesh_cycles, len(order) - 1)]
    bars = slice(1, min(len(order), int(np.searchsorted(order, 4.5 * mesh_order)) + 1))
    axes.vlines(order[bars], 0, 1e6 * free[bars], color=RED, linewidth=3, alpha=0.35, label="rigid")
    loaded, label = 1e6 * made.spectrum()[1][-1], f"at {made.torque[-1]:.4g} N m"
    axes.vlines(order[bars], 0, loaded[bars], color=BLUE, linewidth=1.3, label=label)
    axes.set_xticks(mesh_order * np.arange(5))
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=8, frameon=False)
    labelled(axes, "orders of the transmission error (µm)", "order of the pinion's rotation; grid: mesh")


def _is_geometric(torque: Array) -> bool:
    ratio = np.log(torque[1:] / torque[:-1])
    return bool(ratio.max() < 2.5 * ratio.min())


def _plain_ticks(axis: Any) -> None:
    """1, 2, 5, 10, ... written out."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
