"""Pictures of microgeometry: K-charts of the flanks, the Harris map with the order spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..gear import pitch_errors
from ..gear.deviation_job import GEARS, FlankOf, flank_deviations
from ..gear.pair import GearPair
from ..microgeometry.loaded_mesh import LoadedMesh
from ..tables.microgeometry import MicrogeometryTable
from ..typing import Array
from .style import BLUE, GREY, ORANGE, RED, headed, labelled, new_figure, save, shades, some_of, tidy

#: Lines of a panel; of more torques or profiles, so many are drawn.
MOST_LINES = 24


@dataclass(frozen=True)
class _Chart:
    """Deviations of the flanks of one side of a gear.

    Attributes
    ----------
    roll, active
        Roll lengths, and ends of the path of contact (mm).
    lines
        Deviations (um), one array a profile.
    band
        Half the width of the tolerance (um), where there is one.
    pitch
        Index deviations (um), where teeth differ.
    """

    title: str
    roll: Array
    active: tuple[float, ...]
    lines: list[Array]
    band: Array | None
    pitch: Array | None


def _chart(table: MicrogeometryTable, pair: GearPair, g: int, side: str, folder: Path) -> _Chart:
    one = FlankOf(table, pair, g, side, folder)
    gear, active = one.gear, one.active
    ends = gear.form_roll, gear.profile.tip_roll
    roll = np.unique(np.concatenate([np.linspace(*ends, 400), active]))
    own = flank_deviations(one)
    index, band = 1e6 * np.array(own.turn) * gear.reference_radius, None
    if table.tolerance_class is not None:
        allowed = pitch_errors.tolerances(gear, table.tolerance_class)
        band = 1e6 * (0.5 * allowed.form + allowed.slope * ((roll - ends[0]) / (ends[1] - ends[0])))
    return _Chart(
        title=f"{GEARS[g]}, {side} flanks{', driving' if side == table.flank else ''}",
        roll=1e3 * roll,
        active=tuple(1e3 * s for s in active),
        lines=[np.zeros(len(roll)) if one is None else 1e6 * one.at(roll)[0] for one in own.profiles],
        band=band,
        pitch=index if len(index) > 1 else None,
    )


def flank_figure(path: str | Path, table: MicrogeometryTable, pair: GearPair, folder: Path) -> None:
    """K-charts: deviation over roll length of both flanks of both gears, and their index deviations."""
    charts = [_chart(table, pair, g, side, folder) for g in (0, 1) for side in ("left", "right")]
    pitch = any(chart.pitch is not None for chart in charts)
    figure = new_figure(11.0, 7.6 if pitch else 5.0)
    grid = figure.subplots(2 if pitch else 1, len(charts), squeeze=False, height_ratios=(2.2, 1) if pitch else None)
    for column, chart in enumerate(charts):
        axes = grid[0][column]
        tidy(axes)
        lines = chart.lines
        if chart.band is not None:
            middle = np.mean(lines, axis=0)
            edges = (middle - chart.band, middle + chart.band)
            axes.fill_betweenx(chart.roll, *edges, color="#e5e7eb")
        for i in some_of(len(lines), MOST_LINES):
            axes.plot(lines[i], chart.roll, color=BLUE, linewidth=1.4 if len(lines) == 1 else 0.7)
        for end in chart.active:
            axes.axhline(end, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)))
        axes.set_title(chart.title, loc="left", fontsize=9.5)
        axes.set_xlabel("deviation (µm), + material", fontsize=9)
        if column == 0:
            axes.set_ylabel("roll length (mm)", fontsize=9)
        if pitch:
            below = grid[1][column]
            tidy(below)
            if chart.pitch is None:
                below.set_visible(False)
                continue
            below.bar(np.arange(len(chart.pitch)), chart.pitch, color=ORANGE, width=0.7)
            below.set_xlabel("tooth", fontsize=9)
            if column == 0:
                below.set_ylabel("index deviation (µm)", fontsize=9)
    allowed = f"; grey: profile tolerances, ISO 1328-1 class {table.tolerance_class}"
    grey = "" if table.tolerance_class is None else allowed
    title = "Deviations of the flanks; dashed: ends of the path of contact" + grey
    headed(figure, title)
    save(figure, path, dpi=110)


def microgeometry_picture(made: LoadedMesh) -> Any:
    """Harris map, peak-to-peak error, pressure and load share along the path, and the orders of the error."""
    pair, own, torque = made.pair, made.pairs, made.torque
    cycles, mesh_order = made.pinion_angle / pair.mesh_cycle, pair.pinion.teeth
    error, error_unloaded = 1e6 * made.transmission_error, 1e6 * made.transmission_error_unloaded
    order, free = made.spectrum(unloaded=True)
    spectrum, spectrum_unloaded = 1e6 * made.spectrum()[1][-1], 1e6 * free
    roll, stress, edge = 1e3 * own.roll[:, 0], 1e-6 * own.pressure, own.mark != ""
    figure = new_figure(12.0, 7.4)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.5, 1, 1.3))
    places = (grid[0, 0], grid[0, 1], grid[:, 2], grid[1, 0], grid[1, 1])
    harris, peak, spectrum_axes, share, pressure = (figure.add_subplot(place) for place in places)
    colour, scale = shades(float(torque[0]), float(torque[-1] if len(torque) > 1 else 1.01 * torque[0]))
    marker = "." if len(cycles) < 60 else ""
    harris.plot(cycles, error_unloaded, color=RED, linewidth=1.2, marker=marker, markersize=3, label="unloaded")
    for i in some_of(len(torque), MOST_LINES):
        color = colour(torque[i])
        harris.plot(cycles, error[i], color=color, linewidth=1.1, marker=marker, markersize=3)
        rows = np.flatnonzero(own.torque == i)
        rows = rows[np.argsort(roll[rows])]
        share.plot(roll[rows], own.share[rows], ".", markersize=2.5, color=color)
        smooth, sharp = rows[~edge[rows]], rows[edge[rows]]
        pressure.plot(roll[smooth], stress[smooth], ".", markersize=2.5, color=color)
        pressure.plot(roll[sharp], stress[sharp], "x", markersize=4, color=color)
    harris.legend(fontsize=8, frameon=False)
    peak.plot(torque, np.ptp(error, axis=1), "o-", color=BLUE, markersize=3.5)
    peak.axhline(np.ptp(error_unloaded), color=RED, linewidth=1, linestyle=(0, (4, 3)))
    peak.set_ylim(bottom=0)
    last = min(len(order) - 1, int(np.searchsorted(order, 4.5 * mesh_order)))
    bars = slice(1, last + 1)
    spectrum_axes.vlines(order[bars], 0, spectrum_unloaded[bars], color=RED, linewidth=3, alpha=0.35, label="unloaded")
    label = f"at {torque[-1]:.4g} N m"
    spectrum_axes.vlines(order[bars], 0, spectrum[bars], color=BLUE, linewidth=1.3, label=label)
    spectrum_axes.set_xticks(mesh_order * np.arange(5))
    spectrum_axes.set_ylim(bottom=0)
    spectrum_axes.legend(fontsize=8, frameon=False)
    for axes, text, below in (
        (harris, "transmission error (µm): Harris map", "pinion angle (mesh cycles)"),
        (peak, "peak to peak (µm); dashed: unloaded", "torque at the wheel (N m)"),
        (spectrum_axes, "orders of the transmission error (µm)", "order of the pinion's turn; grid: mesh"),
        (share, "load share of a tooth pair (–)", "roll length of the pinion (mm)"),
        (pressure, "pressure (MPa); x: beside an edge", "roll length of the pinion (mm)"),
    ):
        labelled(axes, text, below)
    bar = figure.colorbar(scale, ax=pressure, shrink=0.95, aspect=25, pad=0.02)
    bar.set_label("torque at the wheel (N m)")
    title = f"Gear pair {pair.pinion.teeth}/{pair.wheel.teeth}, {made.span}"
    headed(figure, title)
    return figure
