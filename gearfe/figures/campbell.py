"""Pictures of a run-up over speed and frequency: waterfall, Campbell diagram, parametric instability."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.shown import percent
from ..base.typing import Array
from ..drivetrain.runup.critical import CriticalSpeeds
from ..drivetrain.runup.instability import InstabilityMap
from ..drivetrain.runup.modes import STRONG
from ..drivetrain.runup.orders import orders
from ..drivetrain.runup.report import waterfall
from ..drivetrain.runup.results import SteadyState
from ..drivetrain.runup.run_up import RunUp
from .style import BLUE, COLOURS, GREY, RANGE_DB, RED, REFERENCE, level, new_figure, on_white, save, single

#: Width and height of an order's name, in parts of the axes.
ROOM, TALL = 0.045, 0.035


class OrderLine(NamedTuple):
    """An order of a mesh: its label, and frequency (kHz) for 1 rad/s of the drive."""

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


def draw_waterfall(path: Path, run: RunUp, multiples: int, bore: int, title: str) -> None:
    """Draw spectra over the speed of a slow run-up: coloured tracks, the meshes' orders named.

    Parameters
    ----------
    path : Path
        The picture.
    run : RunUp
        The run-up.
    multiples : int
        Highest multiple of the mesh frequencies whose order is named.
    bore : int
        Number of the attachment whose acceleration is drawn.
    title : str
        Second line of the heading.
    """
    from matplotlib.collections import LineCollection

    swept = sorted(run.sweep(), key=lambda s: s.speed)
    made = waterfall(run, swept)
    frequency = 1e-3 * made["frequency_Hz"]
    signal, size = signal_of(run, bore), np.full(frequency.shape, np.nan)
    for row, state in enumerate(swept):
        found, lines = np.isfinite(frequency[row]), signal.lines(state)
        size[row, found] = lines[[state.numbers[tuple(k)] for k in made["harmonic"][found].tolist()]]
    loud = level(size, signal.reference)
    speed, highest = np.array([s.speed for s in swept]), 1e-3 * run.band_hz
    figure = new_figure(10.5, 6.4)
    axes = figure.add_subplot()
    axes.set_title(f"{signal.name} in steady running\n{title}", fontsize=11, loc="left")
    top = float(np.nanmax(loud[:, 1:], initial=-240.0))
    segments, values = [], []
    for k in range(1, frequency.shape[1]):
        points = np.stack([speed, frequency[:, k]], axis=1)
        both = np.isfinite(points[:-1, 1]) & np.isfinite(points[1:, 1])
        segments += [points[i : i + 2] for i in np.flatnonzero(both)]
        values += [0.5 * (loud[i, k] + loud[i + 1, k]) for i in np.flatnonzero(both)]
    order = np.argsort(values)  # loud ones on top
    tracks = LineCollection(
        [segments[i] for i in order], array=np.array(values)[order], cmap=on_white("YlOrRd", 0.15, 1.0),
        linewidths=2.6, capstyle="butt",
    )  # fmt: skip
    tracks.set_clim(top - RANGE_DB, top)
    axes.add_collection(tracks)
    axes.set_xlim(float(speed[0]), float(speed[-1]))
    axes.set_ylim(0.0, highest)
    _label_orders(axes, order_lines(run, multiples), float(speed[0]), float(speed[-1]), highest, ["black"] * 99)
    axes.set_xlabel("speed of the drive  (rad/s)")
    axes.set_ylabel("frequency  (kHz)")
    _rpm(axes)
    figure.colorbar(tracks, ax=axes, pad=0.09, label=signal.level)
    save(figure, path)


def draw_campbell(path: Path, run: RunUp, critical: CriticalSpeeds, multiples: int, title: str) -> None:
    """Draw natural frequencies over the speed with the meshes' orders; modes strained in meshes are strong.

    Parameters
    ----------
    path : Path
        The picture.
    run : RunUp
        The run-up.
    critical : CriticalSpeeds
        Modes and the speeds at which orders meet them.
    multiples : int
        Highest multiple of the mesh frequencies that is drawn.
    title : str
        Second line of the heading.
    """
    modes, met = critical.modes, critical.met
    share = modes.strain[:, : len(run.train.model.meshes)].sum(axis=1)
    rising, highest = np.argsort(modes.speeds), 1e-3 * run.band_hz
    speed, frequency, damping = modes.speeds[rising], 1e-3 * modes.frequency[rising], modes.damping_ratio[rising[-1]]
    crossings = [(c.speed, 1e-3 * c.frequency) for c in met if share[c.mode] >= STRONG]
    head = f"Natural frequencies of the coupled train and orders of its meshes\n{title}"
    figure, axes = single(10.5, 6.4, head)
    low, high = float(speed[0]), float(speed[-1])
    taken: list[float] = []
    for mode in range(frequency.shape[1]):
        strong = share[mode] >= STRONG
        axes.plot(speed, frequency[:, mode], color=BLUE if strong else "#b6c2d1", linewidth=1.6 if strong else 0.7)
        if frequency[-1, mode] <= highest:
            taken.append(max(float(frequency[-1, mode]), taken[-1] + 0.028 * highest if taken else 0.0))
            part = int(modes.strain[mode].argmax())
            most = f"{100.0 * modes.strain[mode, part]:.0f} % in {modes.strain_in[part]}"
            where = f"{100.0 * share[mode]:.0f} % in meshes" if strong else most
            axes.annotate(
                f"{mode + 1}: {where}, {percent(damping[mode])} damping", (high, float(frequency[-1, mode])),
                (high + 0.03 * (high - low), taken[-1]), fontsize=7.5, color=BLUE if strong else GREY, va="center",
                annotation_clip=False,
                arrowprops={"arrowstyle": "-", "color": "#b6c2d1", "linewidth": 0.5, "relpos": (0.0, 0.5)},
            )  # fmt: skip
    for line in order_lines(run, multiples):
        axes.plot([low, high], [line.slope * low, line.slope * high], color=COLOURS[1 + line.mesh], linewidth=1.0)
    _label_orders(axes, order_lines(run, multiples), low, high, highest, COLOURS[1:])
    if crossings:
        axes.plot(*np.array(crossings).T, "o", color=RED, markersize=4.0, markerfacecolor="white", zorder=5)
    axes.set_xlim(low, high)
    axes.set_ylim(0.0, highest)
    axes.set_xlabel("speed of the drive  (rad/s)")
    axes.set_ylabel("frequency  (kHz)")
    _rpm(axes)
    save(figure, path)


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

    At the right end one that would stand on another's goes back along its line; at the top that one, and one that would
    stand left of the picture, is left out.
    """
    taken = low  # no label leaves the picture
    before, back = math.inf, 0.0
    for line in sorted(lines, key=lambda line: -line.slope):
        end, above = min(high, highest / line.slope), line.slope * high > highest
        if end <= low or (above and end < taken + ROOM * (high - low)):
            continue
        taken = end if above else taken
        if not above:
            back = back + ROOM if before - line.slope * high < TALL * highest else 0.0
            before = line.slope * high
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
