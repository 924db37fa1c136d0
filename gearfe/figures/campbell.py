"""Pictures of a run-up over speed and frequency: waterfall, Campbell diagram, parametric instability."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.shown import percent
from ..base.typing import Array
from ..drivetrain.modes.critical import Campbell
from ..drivetrain.modes.energies import BENDING, HOUSING
from ..drivetrain.modes.orders import TrainOrder
from ..drivetrain.modes.whirl import LABELS, STRONG, WhirlModes
from ..drivetrain.runup.instability import InstabilityMap
from ..drivetrain.runup.orders import orders
from ..drivetrain.runup.report import waterfall
from ..drivetrain.runup.results import SteadyState
from ..drivetrain.runup.run_up import RunUp
from .style import BLUE, GREEN, GREY, RANGE_DB, RED, REFERENCE, level, new_figure, on_white, save, single

#: Width of an order's name of so many letters, and its height, in parts of the axes.
ROOM, LETTERS, TALL = 0.045, 4, 0.035
#: Height of a picture of orders, in parts of the highest one.
ABOVE = 1.05
#: Points of a curve of the Campbell diagram.
CURVE = 201
#: Colours of modes by their labels; of orders; of critical speeds that their orders reach.
MODE_COLOURS = {
    "forward whirl": BLUE, "backward whirl": RED, "planar whirl": "#0f766e", "mixed whirl": "#8a5a2b",
    "torsional": GREEN, "axial": "#6d4c9f", "housing": "#b6c2d1",
}  # fmt: skip
ORDER = "#6b7280"
EXCITED: dict[str, Any] = {"markersize": 4.0, "color": "black", "markerfacecolor": "white"}


class OrderLine(NamedTuple):
    """An order: its label, frequency (kHz) for 1 rad/s of the drive, and number of its mesh or colour."""

    label: str
    slope: float
    mesh: int


class Signal(NamedTuple):
    """What pictures of orders show: its name, unit, reference of levels with its name, and amplitudes of a state."""

    name: str
    unit: str
    reference: float
    level: str
    lines: Callable[[SteadyState], Array]  # (K + 1,)


def signal_of(run: RunUp, bore: int) -> Signal:
    """Acceleration at an attachment; in a housing that does not move, the contact force of the first mesh."""
    if any(s.acceleration.any() for s in run.states):
        name = f"Normal acceleration at attachment {run.train.model.bores[bore]}"
        label = "level of the acceleration  (dB re 1 µm/s²)"
        return Signal(name, "m/s²", REFERENCE, label, lambda s: np.abs(s.acceleration[:, bore]))
    name = f"Contact force of mesh 1 ({run.train.model.meshes[0].name})"
    return Signal(name, "N", 1.0, "level of the force  (dB re 1 N)", lambda s: np.abs(s.lines(s.force[:, 0])))


def bearing_signal(run: RunUp, bore: int) -> Signal:
    """Return the force of the shaft on a bore: root of the summed squares of its amplitudes."""
    name = f"Force of the shaft on bearing {run.train.model.bores[bore]}"
    label = "level of the force  (dB re 1 N)"
    return Signal(name, "N", 1.0, label, lambda s: np.linalg.norm(np.abs(s.bearing[:, bore, :3]), axis=1))


def draw_waterfall(
    path: Path, run: RunUp, signal: Signal, title: str, *, multiples: int, over_order: bool = False
) -> None:
    """Draw spectra over the speed of a slow run-up: coloured tracks, the meshes' orders named.

    Parameters
    ----------
    path : Path
        The picture.
    run : RunUp
        The run-up.
    signal : Signal
        What is drawn.
    title : str
        Second line of the heading.
    multiples : int
        Highest multiple of the mesh frequencies whose order is named.
    over_order : bool
        Whether tracks stand at their orders, up to those that are named, instead of their frequencies.
    """
    from matplotlib.collections import LineCollection

    swept = sorted(run.sweep(), key=lambda s: s.speed)
    made, named = waterfall(run, swept), order_lines(run, multiples)
    speed, inside = np.array([s.speed for s in swept]), np.isfinite(made["frequency_Hz"])
    if over_order:
        orders_of = {line.label: 1e3 * 2.0 * math.pi * line.slope for line in named}
        height, highest = np.where(inside, made["order"], np.nan), ABOVE * max(orders_of.values())
    else:
        height, highest = 1e-3 * made["frequency_Hz"], 1e-3 * run.band_hz
    size = np.full(height.shape, np.nan)
    for row, state in enumerate(swept):
        lines = signal.lines(state)
        size[row, inside[row]] = lines[[state.numbers[tuple(k)] for k in made["harmonic"][inside[row]].tolist()]]
    loud = level(size, signal.reference)
    figure = new_figure(10.5, 6.4)
    axes = figure.add_subplot()
    axes.set_title(f"{signal.name} in steady running\n{title}", fontsize=11, loc="left")
    top = float(np.nanmax(loud[:, 1:], initial=-240.0))
    segments, values = [], []
    for k in range(1, height.shape[1]):
        points = np.stack([speed, height[:, k]], axis=1)
        both = np.isfinite(points[:-1, 1]) & np.isfinite(points[1:, 1])
        segments += [points[i : i + 2] for i in np.flatnonzero(both)]
        values += [0.5 * (loud[i, k] + loud[i + 1, k]) for i in np.flatnonzero(both)]
    order = np.argsort(values)  # loud ones on top
    tracks = LineCollection(
        [segments[i] for i in order], array=np.array(values)[order], cmap=on_white("YlOrRd", 0.15, 1.0),
        linewidths=6.0 if over_order else 2.6, capstyle="butt",
    )  # fmt: skip
    tracks.set_clim(top - RANGE_DB, top)
    axes.add_collection(tracks)
    axes.set_xlim(float(speed[0]), float(speed[-1]))
    axes.set_ylim(0.0, highest)
    if over_order:
        axes.set_yticks(list(orders_of.values()), list(orders_of))
        axes.set_ylabel("order")
    else:
        _label_orders(axes, named, float(speed[0]), float(speed[-1]), highest, ["black"] * 99)
        axes.set_ylabel("frequency  (kHz)")
    axes.set_xlabel("speed of the drive  (rad/s)")
    _rpm(axes)
    figure.colorbar(tracks, ax=axes, pad=0.09, label=signal.level)
    save(figure, path)


def draw_campbell(path: Path, found: Campbell, title: str) -> None:
    """Draw the Campbell diagram into a file; `title` is the second line of its heading."""
    save(campbell_figure(found, title), path)


def modes_picture(modes: WhirlModes) -> Any:
    """The modes over the speed without orders."""
    highest = float(np.nanmax(modes.frequency)) if modes.frequency.size else 1.0
    return campbell_figure(Campbell(modes, [], [], 1.05 * highest), "")


def campbell_figure(found: Campbell, title: str) -> Any:
    """Return natural frequencies over the speed, coloured by what the modes are, with the orders that meet them.

    Parameters
    ----------
    found : Campbell
        Modes, orders and critical speeds.
    title : str
        Second line of the heading.
    """
    from matplotlib.lines import Line2D

    modes, last = found.modes, found.modes.fastest
    figure, axes = single(10.5, 6.8, f"Natural frequencies of the coupled train and orders\n{title}")
    low, high = float(modes.speeds.min()), float(modes.speeds.max())
    speed = np.linspace(low, high, CURVE)
    frequency = 1e-3 * np.array([modes.at(x) for x in speed]).reshape(CURVE, -1)
    highest = 1e-3 * found.band_hz
    strained = modes.mesh_strain[last].sum(axis=1)
    used: dict[str, str] = {}
    ends = frequency[-1]
    taken: list[float] = []
    for mode in np.argsort(np.where(np.isnan(ends), np.inf, ends)).tolist():
        kind, direction = modes.kinds[last][mode], modes.direction[last][mode]
        name = f"{direction} whirl" if kind == BENDING else LABELS[kind]
        colour = MODE_COLOURS.get(name, GREY)
        used[name] = colour
        weak = kind == HOUSING and strained[mode] < STRONG
        axes.plot(speed, frequency[:, mode], color=colour, linewidth=0.7 if weak else 1.7, zorder=2.0 if weak else 3.0)
        if ends[mode] <= highest:
            taken.append(max(float(ends[mode]), taken[-1] + 0.028 * highest if taken else 0.0))
            damping = percent(float(modes.damping_ratio[last, mode]))
            axes.annotate(
                f"{mode + 1}: {modes.labels[last][mode]}, {damping} damping", (high, float(ends[mode])),
                (high + 0.03 * (high - low), taken[-1]), fontsize=7.5, color=GREY if weak else colour, va="center",
                annotation_clip=False,
                arrowprops={"arrowstyle": "-", "color": "#b6c2d1", "linewidth": 0.5, "relpos": (0.0, 0.5)},
            )  # fmt: skip
    lines = [_order_line(order) for order in found.orders]
    for line in lines:
        dashes = (None, None) if line.mesh == 0 else (4, 2)
        axes.plot(
            [low, high], [line.slope * abs(low), line.slope * abs(high)], color=ORDER, linewidth=0.8, dashes=dashes
        )
    _label_orders(axes, lines, low, high, highest, [ORDER, ORDER])
    for reached, style in ((False, {"markersize": 1.8, "color": "#9ca3af"}), (True, EXCITED)):
        points = [(c.speed, 1e-3 * c.frequency) for c in found.met if found.excited(c) is reached]
        if points:
            axes.plot(*np.array(points).T, "o", zorder=5, **style)
    axes.set_xlim(low, high)
    axes.set_ylim(0.0, highest)
    axes.set_xlabel("speed of the drive  (rad/s)")
    axes.set_ylabel("frequency  (kHz)")
    _rpm(axes)
    handles = [Line2D([], [], color=colour, linewidth=1.7, label=name) for name, colour in used.items()]
    handles += (
        []
        if not lines
        else [
            Line2D([], [], color=ORDER, linewidth=0.8, label="mesh order (2×m1: twice mesh 1)"),
            Line2D([], [], color=ORDER, linewidth=0.8, dashes=(4, 2), label="shaft order"),
            Line2D([], [], linestyle="", marker="o", label="critical speed, excited (dots: not excited)", **EXCITED),
        ]
    )
    figure.legend(handles=handles, loc="outside lower left", ncols=4, fontsize=8, frameon=False)
    return figure


def _order_line(order: TrainOrder) -> OrderLine:
    """The line of an order with a short name: ``2×m1`` of meshes, ``1×output`` of shafts."""
    short = order.names[0].replace(" x mesh ", "×m").replace(" x shaft ", "×")
    return OrderLine(short, 1e-3 * order.order / (2.0 * math.pi), 0 if order.meshes else 1)


def draw_instability(path: Path, made: InstabilityMap, title: str) -> None:
    """Growth of vibration without damping over speed and load."""
    figure = new_figure(10.5, 4.6)
    axes = figure.add_subplot()
    axes.set_title(f"Parametric instability without damping\n{title}", fontsize=11, loc="left")
    rows = np.arange(len(made.loads))
    shown = axes.pcolormesh(
        made.speeds, rows, np.maximum(made.growth, 0.0), cmap="magma_r", shading="nearest", vmin=0.0
    )
    axes.set_yticks(rows, [f"{x:g}" for x in made.loads])
    axes.set_xlabel("speed of the drive  (rad/s)")
    axes.set_ylabel("factor on the loads")
    _rpm(axes)
    figure.colorbar(shown, ax=axes, pad=0.02, label="growth, and damping that holds it  (1/s)")
    save(figure, path)


def order_lines(run: RunUp, multiples: int) -> list[OrderLine]:
    """Lines of the multiples of the meshes' frequencies, one for those that agree."""
    made = []
    for cut in orders(run, multiples):
        if cut.mesh is not None:
            made.append(OrderLine(cut.names[0].replace(" x mesh ", "×m"), 1e-3 * cut.order / (2.0 * math.pi), cut.mesh))
    return made


def _label_orders(
    axes: Any, lines: Sequence[OrderLine], low: float, high: float, highest: float, colours: Sequence[str]
) -> None:
    """Names of orders where their lines leave the picture.

    At the right end, a label that would overlap another one moves back along its line. At the top it is left out, as is
    one left of the picture.
    """
    taken = low  # no label leaves the picture
    before, back, width = math.inf, 0.0, 0.0
    for line in sorted(lines, key=lambda line: -line.slope):
        end, above = min(high, highest / line.slope), line.slope * high > highest
        room = ROOM * max(1.0, len(line.label) / LETTERS)
        if end <= low or (above and end < taken + room * (high - low)):
            continue
        taken = end if above else taken
        if not above:
            back = back + width if before - line.slope * high < TALL * highest else 0.0
            before, width = line.slope * high, room
            if back + room > 1.0:
                continue
        y = 0.985 * highest if above else line.slope * (high - (0.01 + back) * (high - low))
        axes.annotate(
            line.label, (y / line.slope, y), (-4, 0) if above else (0, 3), textcoords="offset points",
            fontsize=7.5, color=colours[line.mesh], ha="right", va="top" if above else "bottom",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6}, zorder=5,
        )  # fmt: skip


def _rpm(axes: Any) -> None:
    """Upper axis in turns per minute."""
    factor = 30.0 / np.pi
    upper = axes.secondary_xaxis("top", functions=(lambda x: factor * x, lambda x: x / factor))
    upper.set_xlabel("speed of the drive  (rpm)", fontsize=8.5)
    upper.tick_params(labelsize=8)
